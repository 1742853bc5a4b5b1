"""A cloth falls on a ball, and stays there
========================================

576 particles joined by springs, with friction on the ball and on the floor. The step is
the longest for which False Euler is safe, found before the run.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

n = 24
at = np.arange(n * n).reshape(n, n)
ends = [
    (at[:, :-1], at[:, 1:]),
    (at[:-1], at[1:]),
    (at[:-1, :-1], at[1:, 1:]),
    (at[:-1, 1:], at[1:, :-1]),
]
pairs = np.concatenate([np.stack([i.ravel(), j.ravel()], axis=1) for i, j in ends])
y = np.stack(
    [at % n / (n - 1) - 0.5, at // n / (n - 1) - 0.5, 0.0 * at], axis=-1
).reshape(-1, 3)
ball = sw.Sphere((0.0, 0.0, -0.35), 0.3, restitution=0.0, friction=0.8)
floor = sw.Floor(restitution=0.0, friction=0.5, offset=-0.65)
cloth = sw.Springs(
    pairs,
    stiffness=60.0,
    layout=y,
    damping=0.02,
    masses=1e-3,
    drag=1e-3,
    gravity=(0, 0, -9.81),
    floor=[ball, floor],
)
steps = int(np.ceil(1 / 60 / cloth.safe_step("false_euler")))  # of each frame
run = sw.integrate(
    cloth,
    "false_euler",
    v=0.0,
    y=y,
    dt=1 / 60 / steps,
    steps=180 * steps,
    every=6 * steps,
)
away = np.linalg.norm(run.y[-1] - ball.centre, axis=1) - ball.radius
assert away.min() > -1e-4
assert (away < 1e-3).sum() > 100

figure = plt.figure(figsize=(9.0, 2.7), dpi=120, layout="constrained")
for place, saved in enumerate((0, 2, 5, 30)):
    axes = figure.add_subplot(1, 4, place + 1, projection="3d")
    net = run.y[saved].reshape(n, n, 3)
    axes.plot_surface(
        *np.moveaxis(net, -1, 0),
        color="#6fa8dc",
        edgecolor="#175ca6",
        linewidth=0.2,
        rcount=n,
        ccount=n,
    )
    axes.set(xlim=(-0.45, 0.45), ylim=(-0.45, 0.45), zlim=(-0.65, 0.1))
    axes.set_box_aspect((1, 1, 0.83), zoom=1.3)
    axes.view_init(elev=18, azim=-60)
    axes.set_axis_off()
    axes.set_title(f"t = {run.t[saved]:.1f} s")
