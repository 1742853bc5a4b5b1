"""Methods swing too fast or too slow
==================================

The frequency that each method gives an undamped oscillator, over the angle Φ of a step.
False Euler is 4.7 % too fast with six steps a period; Runge-Kutta 4 half a percent too
slow.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

METHODS = {
    "false_euler": ("#efb02e", (1.22, 8.0)),
    "standard_euler": ("#8a8a8a", (0.4, -16.5)),
    "standard_heun": ("#c75a22", (1.22, 11.6)),
    "semi_false_heun": ("#111111", (0.75, -7.0)),
    "rk4": ("#175ca6", (1.22, -1.9)),
    "pefrl": ("#74194f", (1.22, 0.5)),
}
phi = np.linspace(0.01, 1.2, 300)
figure, axes = plt.subplots(figsize=(7.2, 5.0), dpi=120, layout="constrained")
for name, (colour, place) in METHODS.items():
    found = sw.analyse(sw.Oscillator(), name, dt=phi)
    axes.plot(phi, 100.0 * (found.frequency_ratio - 1.0), color=colour, linewidth=2)
    axes.text(*place, sw.method(name).title, color=colour, weight="bold")
assert (
    abs(
        sw.analyse(sw.Oscillator(), "false_euler", dt=1.0).frequency_ratio - np.pi / 3.0
    )
    < 1e-12
)
axes.axhline(0.0, color="#b8b8b8", linewidth=1)
axes.set(
    xlabel="Φ = ω₀·dt, the angle of a step",
    ylabel="frequency too high by, in %",
    xlim=(0, 1.55),
    ylim=(-20, 14),
)
axes.spines[["top", "right"]].set_visible(False)
