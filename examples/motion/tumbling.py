"""Spin about the middle axis turns over, again and again
======================================================

Dzhanibekov's wing nut: a free body spins steadily about its axes of least and of
largest moment, but not about the one between. A tilt of a hundredth grows, and after
some turns the body faces the other way.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

body = sw.RigidBody([1.0, 2.0, 3.0])
tilted = np.eye(3) + 0.01 * (1.0 - np.eye(3))  # three members, each about another axis
still = np.array([1.0, 0.0, 0.0, 0.0])[:, None]
run = sw.integrate(body, "rk4", v=tilted, y=still, dt=0.02, steps=2500, every=5)
spin = np.array([run.v[:, axis, axis] for axis in range(3)])
assert spin[0].min() > 0.99 < spin[2].min()
assert spin[1].min() < -0.99

figure, all_three = plt.subplots(
    3, 1, figsize=(7.2, 5.4), dpi=120, layout="constrained", sharex=True, sharey=True
)
names = "smallest moment: steady", "middle moment: turns over", "largest moment: steady"
for axes, values, name, colour in zip(
    all_three, spin, names, ("#25a985", "#c75a22", "#175ca6"), strict=True
):
    axes.plot(run.t, values, color=colour, linewidth=2)
    axes.text(13.5, 0.1, name, color=colour, size=10)
    axes.set(ylim=(-1.2, 1.2), ylabel="ω")
    axes.spines[["top", "right"]].set_visible(False)
all_three[-1].set_xlabel("time, in the inverse of the spin")
