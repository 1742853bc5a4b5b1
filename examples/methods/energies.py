"""Who gains energy, who loses it, who keeps it
============================================

An undamped oscillator by five methods, with 13 steps a period. The order of a method
does not say what happens to its energy: False Euler, of order 1, keeps it in a band for
ever; Runge-Kutta 4 loses all of it in the end.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

METHODS = {
    "standard_heun": ("#c75a22", "Standard Heun gains"),
    "rk4": ("#175ca6", "Runge-Kutta 4 loses"),
    "false_heun": ("#111111", "False Heun loses fast"),
    "false_euler": ("#efb02e", "False Euler: in a band"),
    "leapfrog": ("#25a985", "leapfrog: in a narrower one"),
}
places = {
    "standard_heun": (3.5, 6.0),
    "rk4": (170, 0.33),
    "false_heun": (12, 0.05),
    "false_euler": (150, 1.5),
    "leapfrog": (25, 0.62),
}
figure, axes = plt.subplots(figsize=(7.2, 4.8), dpi=120, layout="constrained")
for name, (colour, told) in METHODS.items():
    run = sw.integrate(
        sw.Oscillator(), name, v=0.0, y=1.0, dt=0.5, steps=10_000, every=1
    )
    energy = run.energy / run.energy[0]
    shown = (energy < 30.0) & (run.t > 0.0)
    axes.loglog(run.t[shown], energy[shown], color=colour, linewidth=1.2)
    axes.text(*places[name], told, color=colour, weight="bold")
    if name in ("false_euler", "leapfrog"):
        assert np.abs(energy - 1.0).max() < 0.4
    elif name == "rk4":
        assert np.isclose(energy[-1], (1.0 - 0.5**6 / 72.0 + 0.5**8 / 576.0) ** 10_000)
axes.set(
    xlabel="time; a period is 6.28",
    ylabel="energy, of that at the start",
    ylim=(0.02, 30.0),
    xlim=(0.5, 5000),
)
axes.spines[["top", "right"]].set_visible(False)
