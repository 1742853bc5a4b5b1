"""A resonance curve in one call
=============================

Four thousand oscillators, each driven at a frequency of its own and at one of four
damping ratios, are members of one batch. Their amplitudes lie on the curve of the
textbook.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

drive = np.linspace(0.3, 1.8, 1000)
damping = np.array([0.05, 0.1, 0.2, 0.5])[:, None]
force = sw.Sinusoid(amplitude=1.0, omega=drive)
swing = sw.Oscillator(1.0, damping=damping, a=force, form="physical")
settled = sw.integrate(swing, "rk4", v=0.0, y=0.0, dt=0.05, steps=4000)
run = sw.integrate(swing, "rk4", resume=settled, steps=440, every=1)
amplitude = np.abs(run.y).max(axis=0)
true = 1.0 / np.hypot(1.0 - drive**2, 2.0 * damping * drive)
assert np.abs(amplitude / true - 1.0).max() < 0.01

figure, axes = plt.subplots(figsize=(7.2, 4.6), dpi=120, layout="constrained")
colours = "#c75a22", "#175ca6", "#25a985", "#74194f"
for number, (each, curve, D, colour) in enumerate(
    zip(amplitude, true, damping[:, 0], colours, strict=True)
):
    axes.plot(drive, curve, color="#bbbbbb", linewidth=5)
    axes.plot(drive, each, color=colour, linewidth=1.6)
    axes.text(1.35, 5.4 - 0.6 * number, f"D = {D:g}", color=colour, weight="bold")
axes.text(1.35, 6.0, "grey: the formula\ncolour: RK4, 4000 members")
axes.set(
    xlabel="frequency of the drive, in units of ω₀",
    ylabel="amplitude",
    xlim=(0.3, 1.8),
    ylim=(0, 10.5),
)
axes.spines[["top", "right"]].set_visible(False)
