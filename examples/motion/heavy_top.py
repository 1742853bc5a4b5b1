"""A top that is let go falls, and comes up again
==============================================

Three heavy tops spin at different rates and are let go at 30 degrees. Their tips fall
until the spin leads them round, and come up again at cusps: the faster the spin, the
shorter the fall.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

figure, axes = plt.subplots(figsize=(7.2, 6.4), dpi=120, layout="constrained")
for spin, colour in ((7.0, "#c75a22"), (10.0, "#175ca6"), (20.0, "#25a985")):
    scene = sw.scenes.heavy_top(spin=spin)
    run = scene.run("dop853", dt=0.01, steps=round(scene.horizon / 0.01), every=1)
    tip = np.moveaxis(np.array([sw.quaternion.matrix(q)[:, 2] for q in run.y]), -1, 0)
    lean = np.degrees(np.arccos(tip[2]))
    assert np.ptp(run.energy) < 1e-6
    axes.plot(
        tip[0],
        tip[1],
        color=colour,
        linewidth=2,
        label=f"spin {spin:g}: falls by {np.ptp(lean):.1f}°",
    )
axes.plot(0.0, 0.0, "k+", markersize=12)
axes.text(0.03, 0.02, "upright")
axes.legend(
    loc="upper center",
    bbox_to_anchor=(0.53, 0.5),
    fontsize=9,
    frameon=False,
    title="rad per unit of time",
)
axes.set(aspect="equal", xlabel="x of the tip", ylabel="y of the tip")
axes.set_title("Tops seen from above: cusps at 30° from upright")
axes.spines[["top", "right"]].set_visible(False)
