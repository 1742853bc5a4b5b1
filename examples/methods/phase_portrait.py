"""Standard Euler spirals out, False Euler stays on an ellipse
===========================================================

The phase diagram of an oscillator by three methods at the same cost, one evaluation a
step, with 21 steps a period. The difference between the first two is one line: False
Euler uses the new velocity for the place.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

PHI = 0.3  # angle of a step
figure, axes = plt.subplots(figsize=(6.8, 6.8), dpi=120, layout="constrained")
for method, steps, colour in (
    ("standard_euler", 21, "#efb02e"),
    ("false_euler", 420, "#111111"),
):
    run = sw.integrate(
        sw.Oscillator(), method, v=0.0, y=1.0, dt=PHI, steps=steps, every=1
    )
    axes.plot(
        run.y,
        run.v,
        "o-" if steps < 100 else ".",
        color=colour,
        markersize=4,
        linewidth=1,
    )
    if method == "standard_euler":
        assert np.isclose(run.energy[-1], 0.5 * (1.0 + PHI**2) ** steps)
    else:
        # its ellipse, for ever
        assert np.allclose(run.v**2 + run.y**2 - PHI * run.v * run.y, 1.0)
angle = np.linspace(0.0, 2.0 * np.pi, 200)
axes.plot(np.cos(angle), np.sin(angle), color="#b8b8b8", linewidth=5, zorder=0)
axes.text(0.0, 0.08, "grey: the true motion", ha="center")
axes.text(0.0, -0.15, "False Euler, 20 periods", ha="center", color="#111111")
axes.text(1.25, 2.0, "Standard Euler,\none period", color="#b07a08")
axes.set(aspect="equal", xlabel="coordinate y", ylabel="velocity v")
axes.spines[["top", "right"]].set_visible(False)
