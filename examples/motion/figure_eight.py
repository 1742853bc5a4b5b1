"""Three bodies follow each other round a figure of eight
======================================================

The orbit of Moore, Chenciner and Montgomery. Leapfrog keeps to it over ten turns;
Standard Euler, with as many steps, has left it within one.
"""

import matplotlib.pyplot as plt
import stepwell as sw

scene = sw.scenes.figure_eight()
steps = 10 * 250  # ten turns
kept = scene.run("leapfrog", dt=scene.period / 250, steps=steps, every=1)
lost = scene.run("standard_euler", dt=scene.period / 250, steps=250, every=1)
assert scene.state_error(kept)[250] < 0.05 < 0.3 < scene.state_error(lost)[-1]

figure, both = plt.subplots(
    2, 1, figsize=(7.2, 6.0), dpi=120, layout="constrained", sharex=True
)
for axes, run, title in zip(
    both, (kept, lost), ("Leapfrog, ten turns", "Standard Euler, one turn"), strict=True
):
    for body, colour in enumerate(("#175ca6", "#c75a22", "#25a985")):
        axes.plot(*run.y[:, body].T, color=colour, linewidth=1.5)
        axes.plot(*run.y[-1, body], "o", color=colour, markersize=9)
    axes.set(aspect="equal", xlim=(-1.9, 1.9), ylim=(-0.8, 0.8))
    axes.set_axis_off()
    axes.set_title(title, loc="left")
