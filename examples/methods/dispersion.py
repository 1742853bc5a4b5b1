"""On a chain short waves are late
===============================

A kick runs along 300 masses joined by springs. Long waves run at √(k/m) masses per unit
of time; short ones are slower, so a wake follows the front, and every crest is later
than the one before.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

N, SPEED = 300, 2.0
kick = np.zeros(N)
kick[0] = 1.0
run = sw.integrate(
    sw.Chain(N, stiffness=SPEED**2, mass=1.0),
    "leapfrog",
    v=kick,
    y=0.0,
    dt=0.05,
    steps=2600,
    every=10,
)
front = np.array(
    [np.flatnonzero(abs(y) > 0.25 * abs(y).max()).max() for y in run.y[40:]]
)
assert np.abs(front - SPEED * run.t[40:]).max() < 12

figure, axes = plt.subplots(figsize=(7.2, 4.8), dpi=120, layout="constrained")
largest = np.abs(run.v[30:]).max() * 0.6
axes.pcolormesh(
    run.t,
    np.arange(N),
    run.v.T,
    cmap="RdBu_r",
    vmin=-largest,
    vmax=largest,
    shading="nearest",
    rasterized=True,
)
axes.plot(
    run.t,
    np.minimum(SPEED * run.t, N) + 12,
    color="#111111",
    linewidth=1.2,
    linestyle="--",
)
axes.text(
    62,
    165,
    "√(k/m) masses per unit of time",
    rotation=40,
    color="#111111",
    ha="center",
    va="center",
)
axes.set(xlabel="time", ylabel="mass", ylim=(0, N - 1), xlim=(0, 130))
axes.set_title("Velocities along a chain after a kick")
