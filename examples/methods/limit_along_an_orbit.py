"""A comet's step is set where it passes the sun
=============================================

The longest step for which leapfrog is stable, at every state of one turn on an ellipse.
Far out it may be eighty times as long as where the two bodies are nearest; a fixed step
has to be the shortest.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

scene = sw.scenes.kepler(e=0.9)
run = scene.run("leapfrog", dt=0.001, steps=6283, every=20)
along = sw.stability_along(run)
assert along.limits.max() > 50.0 * along.dt
at = np.clip(along.limits, 1e-3, None)

figure, axes = plt.subplots(figsize=(8.0, 4.4), dpi=120, layout="constrained")
apart = run.y[:, 0] - run.y[:, 1]
drawn = axes.scatter(*apart.T, c=np.log10(at), s=26, cmap="cividis")
axes.plot(0.0, 0.0, "o", color="#c75a22", markersize=10)
bar = figure.colorbar(drawn, label="longest stable step, in units of time", shrink=0.8)
bar.set_ticks([-1, 0], labels=["0.1", "1"])
axes.annotate(
    f"no more than {float(along.dt):.3f} here",
    apart[0],
    (-0.9, 0.75),
    arrowprops={"arrowstyle": "->"},
)
axes.set(aspect="equal")
axes.set_axis_off()
