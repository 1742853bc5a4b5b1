"""A cloth a hundred times too stiff for leapfrog falls at one step a frame
========================================================================

A square cloth hangs from two corners, at 60 frames a second with one step each.
Leapfrog bears springs a hundredth as stiff; with these it tears the cloth apart within
half a second. Linearly implicit Euler solves equations for the velocities, and what is
too fast for a frame dies out.
"""

import warnings

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

N, FRAME = 10, 1 / 60
at = np.arange(N * N).reshape(N, N)
pairs = np.concatenate(
    [
        np.stack([a.ravel(), b.ravel()], axis=1)
        for a, b in ((at[:, :-1], at[:, 1:]), (at[:-1], at[1:]))
    ]
)
y = np.zeros((N * N, 3))
y[:, 0], y[:, 1] = (
    np.tile(np.linspace(0.0, 1.0, N), N),
    np.repeat(np.linspace(0.0, -1.0, N), N),
)


def cloth(stiffness):
    return sw.Springs(
        pairs,
        stiffness=stiffness,
        layout=y,
        masses=0.01,
        fixed=[0, N - 1],
        gravity=(0.0, 0.0, -9.81),
    )


# Leapfrog is stable where ω·dt < 2, and no ω² is larger than that of a particle and its
# neighbour with four springs each.
bearable = 0.01 * (2.0 / FRAME) ** 2 / 8.0
stiff = cloth(100.0 * bearable)
run = sw.integrate(
    stiff, "linearly_implicit_euler", v=0.0, y=y, dt=FRAME, steps=90, every=15
)
with warnings.catch_warnings():
    warnings.simplefilter("ignore", Warning)
    other = sw.integrate(stiff, "leapfrog", v=0.0, y=y, dt=FRAME, steps=30)
assert not np.abs(other.y[-1]).max() < 100.0
assert not run.status
lengths = np.linalg.norm(run.y[:, pairs[:, 0]] - run.y[:, pairs[:, 1]], axis=-1) * (
    N - 1
)
assert abs(lengths - 1.0).max() < 0.2

figure, panels = plt.subplots(1, 5, figsize=(11.0, 2.4), sharey=True)
for panel, t, places in zip(panels, run.t, run.y, strict=False):
    net = places.reshape(N, N, 3)
    seen = np.stack(
        [net[..., 0] + 0.5 * net[..., 1], net[..., 2] + 0.3 * net[..., 1]], axis=-1
    )
    for line in (*seen, *seen.transpose(1, 0, 2)):
        panel.plot(*line.T, color="#222222", linewidth=0.8)
    panel.set(xlim=(-0.6, 1.6), ylim=(-1.3, 0.1), aspect="equal", title=f"t = {t:.2f}")
    panel.set_axis_off()
figure.suptitle(
    "One step a frame, with springs a hundred times as stiff as leapfrog bears",
    weight="bold",
)
figure.tight_layout()
