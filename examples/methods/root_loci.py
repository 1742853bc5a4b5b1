"""Where the eigenvalues of a step go as the step grows
====================================================

A step of an oscillator is a matrix, and a method is stable while the eigenvalues of
that matrix are within the unit circle. Standard Euler's leave it at once, False Euler's
run along it and part at −1, and those of Runge-Kutta 4 return to it at Φ = 2.83.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

phi = np.linspace(0.0, 3.0, 301)[1:]
figure, axes = plt.subplots(figsize=(6.8, 6.4), dpi=120, layout="constrained")
for name, colour, place in (
    ("standard_euler", "#111111", (1.02, 1.12)),
    ("false_euler", "#efb02e", (-1.62, 0.12)),
    ("rk4", "#175ca6", (-0.4, 0.3)),
):
    found = sw.analyse(sw.Oscillator(), name, dt=phi)
    z = np.stack([np.linalg.eigvals(P) for P in np.moveaxis(found.P, -1, 0)])
    axes.plot(z.real, z.imag, ".", color=colour, markersize=4)
    axes.text(*place, sw.method(name).title, color=colour, weight="bold")
    outside = phi[np.abs(z).max(axis=1) > 1.0 + 1e-6].min()
    assert (
        0.0 <= outside - float(sw.stability_limit(sw.Oscillator(), name) or 0.0) < 0.02
    )
angle = np.linspace(0.0, 2.0 * np.pi, 300)
axes.plot(np.cos(angle), np.sin(angle), color="#b8b8b8", linewidth=1.2, zorder=0)
axes.set(
    aspect="equal",
    xlim=(-1.7, 1.7),
    ylim=(-1.5, 1.5),
    xlabel="real part",
    ylabel="imaginary part",
)
axes.spines[["top", "right"]].set_visible(False)
