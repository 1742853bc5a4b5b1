"""A push against the energy error keeps three bodies together
===========================================================

Standard Euler gains energy in every step, and the bodies of Appendix D fly apart.
Hoffmann's control adds a push along the velocity that takes the gain back. The energy
is then right; the motion, which is chaotic, is another one.
"""

import warnings

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

scene = sw.scenes.energy_control()
start = {"v": scene.v, "y": scene.y, "dt": scene.dt, "steps": 4000, "every": 4}
# two bodies meet within a step, which is where the energy jumps
with warnings.catch_warnings():
    warnings.simplefilter("ignore", sw.AccuracyWarning)
    alone = sw.integrate(scene.system, "standard_euler", **start)
    controlled = sw.integrate(
        scene.system, "standard_euler", **start, control=sw.EnergyControl(0.3)
    )
gained, kept = (
    np.median(abs(run.energy - run.energy[0])) for run in (alone, controlled)
)
assert kept < 0.1 * gained

figure, both = plt.subplots(1, 2, figsize=(9.0, 4.8), dpi=120, layout="constrained")
titles = (
    f"without control: energy error {gained:.2f}",
    f"with control: {kept:.4f} (medians)",
)
for axes, run, title in zip(both, (alone, controlled), titles, strict=True):
    for body, colour in enumerate(("#175ca6", "#c75a22", "#25a985")):
        axes.plot(*run.y[:, body].T, color=colour, linewidth=0.9)
        axes.plot(*run.y[-1, body], "o", color=colour)
    reach = 1.05 * np.abs(alone.y).max()
    axes.set(
        aspect="equal",
        xticks=[],
        yticks=[],
        xlim=(-reach, reach),
        ylim=(-reach, reach),
        title=title,
    )
