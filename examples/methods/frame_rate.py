"""At 60 frames a second a spring may have 19 Hz
=============================================

A thousand springs in one call, one step of False Euler a frame. Up to Φ = 2, which is
60/π = 19.1 Hz, amplitudes stay bounded; above it every spring blows up, the sooner the
stiffer.
"""

import warnings

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

frequency = np.linspace(1.0, 30.0, 1000)
with warnings.catch_warnings():
    warnings.simplefilter("ignore", sw.DivergenceWarning)
    run = sw.integrate(
        sw.Oscillator(2.0 * np.pi * frequency),
        "false_euler",
        v=0.0,
        y=1.0,
        dt=1 / 60,
        steps=3600,
    )
bad = run.status == sw.Status.DIVERGED
assert frequency[bad].min() > 60.0 / np.pi > frequency[~bad].max() - 0.2

figure, axes = plt.subplots(figsize=(7.2, 4.2), dpi=120, layout="constrained")
axes.axvspan(1.0, 60.0 / np.pi, color="#e6f3ee")
axes.plot(
    frequency[bad], run.first_bad_step[bad] / 60.0, color="#c75a22", linewidth=2.5
)
axes.text(10.0, 25.0, "stable for ever", color="#1b7a60", ha="center", size=13)
axes.text(
    20.6, 25.0, "seconds until the largest\nnumber is passed", color="#c75a22", size=12
)
axes.annotate(
    "60/π = 19.1 Hz", (60 / np.pi, 2.0), (11.5, 6.0), arrowprops={"arrowstyle": "->"}
)
axes.set(
    xlabel="frequency of the spring in Hz",
    ylabel="seconds until it overflows",
    xlim=(1, 30),
    ylim=(0, 60),
)
axes.spines[["top", "right"]].set_visible(False)
