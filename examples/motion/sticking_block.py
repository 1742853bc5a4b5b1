"""A block on a spring sticks where friction holds it
==================================================

Coulomb's friction takes the same from each half swing, so the turns lie on two straight
lines. Where the spring pulls with less than friction holds, the velocity is exactly
zero and stays so.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

FRICTION = 0.08
block = sw.Oscillator(1.0, friction=FRICTION, form="physical")
run = sw.integrate(block, "false_euler", v=0.0, y=1.0, dt=1e-3, steps=30_000, every=10)
moves = np.flatnonzero(run.v)[-1]
assert abs(run.y[-1]) < FRICTION
assert (run.v[moves + 1 :] == 0.0).all()

figure, axes = plt.subplots(figsize=(7.2, 4.0), dpi=120, layout="constrained")
axes.axhspan(-FRICTION, FRICTION, color="#e9eef4")
axes.plot(run.t, run.y, color="#175ca6", linewidth=2)
turns = 1.0 - 2.0 * FRICTION / np.pi * run.t
for sign in (1.0, -1.0):
    axes.plot(
        run.t[turns > 0],
        sign * turns[turns > 0],
        color="#888888",
        linestyle="--",
        linewidth=1,
    )
axes.plot(run.t[moves], run.y[moves], "o", color="#c75a22", markersize=9)
axes.text(
    run.t[moves] + 0.3,
    run.y[moves] + 0.06,
    f"sticks at {run.y[-1]:.3f}",
    color="#c75a22",
)
axes.text(
    29.8,
    -0.1,
    "in this band friction holds the block",
    ha="right",
    va="top",
    color="#445566",
)
axes.set(xlabel="time", ylabel="place of the block", xlim=(0, 30))
axes.set_title("The turns lie on two straight lines, and then it sticks")
axes.spines[["top", "right"]].set_visible(False)
