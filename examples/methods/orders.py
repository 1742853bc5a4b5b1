"""Half the step: a half, a quarter, a sixteenth of the error
==========================================================

The order of a method is the slope of its error over the step. On a large swing of a
pendulum the slopes are 1, 2, 4 and 8, until rounding ends the gain.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

METHODS = (
    ("standard_heun", "#c75a22", 3.0),
    ("false_euler", "#efb02e", 0.4),
    ("leapfrog", "#25a985", 0.06),
    ("rk4", "#175ca6", 8e-3),
    ("dop853", "#10123a", 2e-6),
)
start = {"v": 0.0, "y": 2.0}
true = sw.integrate(sw.Pendulum(), "dop853", **start, dt=10.0 / 2**10, steps=2**10)

figure, axes = plt.subplots(figsize=(7.2, 5.4), dpi=120, layout="constrained")
for name, colour, place in METHODS:
    steps = 2 ** np.arange(4, 15 if name != "dop853" else 8)
    ends = [
        sw.integrate(sw.Pendulum(), name, **start, dt=10.0 / n, steps=int(n))
        for n in steps
    ]
    error = np.array(
        [np.hypot(end.y[-1] - true.y[-1], end.v[-1] - true.v[-1]) for end in ends]
    )
    usable = error > 1e-12
    slope = -np.polyfit(np.log(steps[usable][-4:]), np.log(error[usable][-4:]), 1)[0]
    # with few steps errors may fall faster
    assert -0.3 < slope - sw.method(name).order < 1.5, (name, slope)
    axes.loglog(10.0 / steps, error, "o-", color=colour, linewidth=2, markersize=4)
    axes.text(
        0.8,
        place,
        f"{sw.method(name).title}, order {sw.method(name).order}",
        color=colour,
        va="center",
    )
axes.set(xlabel="step, in units of time", ylabel="error at t = 10", xlim=(4e-4, 30.0))
axes.spines[["top", "right"]].set_visible(False)
