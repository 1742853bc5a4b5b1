"""Arenstorf's orbit loops round the moon and comes home
=====================================================

A body without mass between earth and moon, seen in the frame that turns with them.
Adaptive steps are short near the moon and long elsewhere; a fixed step would have to be
the shortest of them all the way.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

scene = sw.scenes.arenstorf()
times = np.linspace(0.0, scene.period, 800)
run = sw.integrate(
    scene.system, "dop853", v=scene.v, y=scene.y, tolerance=1e-10, at=times
)
assert np.linalg.norm(run.y[-1] - run.y[0]) < 1e-4

figure, axes = plt.subplots(figsize=(7.2, 6.4), dpi=120, layout="constrained")
axes.plot(*run.y.T, color="#175ca6", linewidth=1.8)
axes.plot(*run.y[::8].T, "o", color="#175ca6", markersize=3)
axes.plot(-scene.system.mu, 0.0, "o", color="#25a985", markersize=15)
axes.plot(1.0 - scene.system.mu, 0.0, "o", color="#777777", markersize=7)
axes.text(-scene.system.mu, -0.16, "earth", ha="center")
axes.text(1.03, 0.06, "moon", ha="left")
axes.set(aspect="equal")
axes.set_axis_off()
axes.set_title(
    f"One period in {int(run.paces.accepted)} adaptive steps; dots at equal times"
)
