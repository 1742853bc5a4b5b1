"""By Runge-Kutta 4."""

import numpy as np
import stepwell as sw

from .work import END, FRICTION, GRAVITY, HEIGHT, MAGNETS, STEPS, bobs, nearest


@sw.system(shape=(2,))
def pendulum(t, v, y):
    force = -GRAVITY * y - FRICTION * v
    for magnet in MAGNETS:
        away = np.array(magnet) - y
        r2 = away[0] ** 2 + away[1] ** 2 + HEIGHT**2
        force = force + 1.0 / (r2 * np.sqrt(r2)) * away
    return force


def magnet(run):
    return nearest(run.y[-1])


def run(size):
    axes = {"y": ("start", bobs(size))}
    return sw.sweep(pendulum, axes, "rk4", v=0.0, dt=END / STEPS, steps=STEPS, outcomes=magnet).magnet.values
