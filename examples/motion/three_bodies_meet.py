"""Burrau's three bodies: two leave together, the third alone
==========================================================

Masses 3, 4 and 5 at rest at the corners of a right triangle. After some close
encounters the two heavier leave as a pair. Only adaptive steps get through: the closest
encounter is at a ten-thousandth of the first distance.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw
from matplotlib.patheffects import withStroke

scene = sw.scenes.pythagorean()
run = sw.integrate(
    scene.system,
    "dop853",
    v=scene.v,
    y=scene.y,
    tolerance=1e-12,
    at=np.linspace(0.0, 68.0, 8000),
    record="closest",
)
assert np.ptp(run.energy) < 1e-4 * abs(run.energy[0])

figure, axes = plt.subplots(figsize=(7.2, 6.4), dpi=120, layout="constrained")
halo = [withStroke(linewidth=4, foreground="white")]  # read on the curves, too
for body, (mass, colour) in enumerate(
    zip((3, 4, 5), ("#25a985", "#c75a22", "#175ca6"), strict=True)
):
    axes.plot(*run.y[:, body].T, color=colour, linewidth=0.9)
    axes.plot(*run.y[0, body], "s", color=colour, markersize=8)
    axes.text(
        *(run.y[0, body] + [0.15, 0.15]),
        f"mass {mass}",
        color=colour,
        weight="bold",
        path_effects=halo,
    )
axes.set(aspect="equal", xlim=(-5, 5), ylim=(-5, 5))
axes.set_axis_off()
axes.set_title("Three bodies that start at rest, at the squares")
