"""A pendulum in space draws a rosette
===================================

Pushed sideways, a pendulum does not return to where it was: its ellipse turns. For
small swings the angle per swing is ¾·π times the product of both half axes, in units of
the rod.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

pendulum = sw.Pendulum3D(length=1.0, gravity=1.0)
LONG, SHORT = 0.5, 0.12
y = [LONG, 0.0, -np.sqrt(1.0 - LONG**2)]
run = sw.integrate(
    pendulum,
    "dop853",
    v=[0.0, SHORT, 0.0],
    y=y,
    tolerance=1e-10,
    at=np.linspace(0.0, 120.0, 6000),
)
far = np.hypot(run.y[:, 0], run.y[:, 1])
tops = np.flatnonzero((far[1:-1] > far[:-2]) & (far[1:-1] > far[2:])) + 1
turned = np.unwrap(2.0 * np.arctan2(run.y[tops, 1], run.y[tops, 0])) / 2.0
each_swing = 2.0 * np.polyfit(np.arange(len(tops)), turned, 1)[0]
told = 0.75 * np.pi * LONG * SHORT
# to first order in the squares of the half axes, of which one is a quarter
assert abs(each_swing / told - 1.0) < 0.3

figure, axes = plt.subplots(figsize=(6.4, 6.4), dpi=120, layout="constrained")
axes.scatter(run.y[:, 0], run.y[:, 1], c=run.t, s=1.5, cmap="cividis")
axes.plot(run.y[tops, 0], run.y[tops, 1], ".", color="#c75a22", markersize=7)
axes.set(aspect="equal")
axes.set_axis_off()
axes.set_title(
    f"Seen from above: the ellipse turns by {np.degrees(each_swing):.1f}° a swing"
)
