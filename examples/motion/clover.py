"""Large steps make a clover leaf of a circle
==========================================

Three bodies chase each other round the unit circle (Appendix C). With 21 steps a turn,
False Euler leads each of them round an ellipse of its own, off the centre: the three
leaves of a clover.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

scene = sw.scenes.clover()
run = scene.run("false_euler", dt=0.3, steps=21, every=1)
radius = np.hypot(*np.moveaxis(run.y, -1, 0))
assert radius.min() < 0.95 < 1.1 < radius.max()

figure, axes = plt.subplots(figsize=(7.2, 7.2), dpi=120, layout="constrained")
for body, colour in enumerate(("#175ca6", "#c75a22", "#25a985")):
    axes.plot(*run.y[:, body].T, "o-", color=colour, linewidth=2.2, markersize=5)
angle = np.linspace(0.0, 2.0 * np.pi, 200)
axes.plot(np.cos(angle), np.sin(angle), color="#111111", linewidth=2)
axes.text(
    0.0,
    0.0,
    "black: the true motion\nlines: False Euler,\none turn in 21 steps",
    ha="center",
    va="center",
    size=13,
)
axes.set(aspect="equal")
axes.set_axis_off()
axes.set_title("Large steps make a clover leaf of a circle")
