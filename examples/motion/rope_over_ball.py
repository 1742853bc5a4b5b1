"""A rope of rods falls over a ball and rests
==========================================

Eight points joined by seven rods, let go level. After each step a projection resets the
lengths, so that the rods stay rods to the last digits, whatever they hit.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

joined = [(i, i + 1) for i in range(7)]
ball = sw.Sphere((1.2, 0.0), 0.5, restitution=0.3, friction=0.4)
rope = sw.Rods(
    np.ones(8),
    joined,
    0.5,
    gravity=9.81,
    floor=[sw.Floor(restitution=0.3, friction=0.4), ball],
)
level = np.stack([0.5 * np.arange(8.0), np.ones(8)], axis=1)
keep = sw.Projection("length")
run = sw.integrate(
    rope,
    "rk4",
    v=0.0,
    y=level,
    dt=1 / 120,
    steps=1200,
    every=6,
    control=keep,
    record="length_error",
)
assert run.recorded["length_error"].max() < 1e-9
assert np.abs(run.v[-1]).max() < 1e-6

figure, axes = plt.subplots(figsize=(8.0, 3.6), dpi=120, layout="constrained")
shown = (0, 4, 7, 9, 11, len(run.t) - 1)
for k, saved in enumerate(shown):
    shade = 0.75 - 0.15 * k
    last = saved == shown[-1]
    axes.plot(
        *run.y[saved].T,
        "o-",
        color="#175ca6" if last else str(max(shade, 0.3)),
        linewidth=3 if last else 1.5,
        markersize=6,
    )
    if k < 3:
        axes.text(
            run.y[saved, -1, 0] + 0.08,
            run.y[saved, -1, 1],
            f"t = {run.t[saved]:.2f}",
            color="#444444",
            va="center",
        )
axes.text(2.2, 0.12, f"at rest, t = {run.t[-1]:.0f}", color="#175ca6", weight="bold")
axes.add_patch(plt.Circle((1.2, 0.0), 0.5, color="#e8e2d8", zorder=0))
axes.axhline(0.0, color="black", linewidth=1.5)
axes.fill_between([-0.2, 4.2], -0.55, 0.0, color="white", zorder=0)
axes.set(aspect="equal", xlim=(-0.2, 4.2), ylim=(-0.1, 1.15))
axes.set_axis_off()
