"""The three sweeps: what varies, how far members go, and what is kept of each. The same for all who compute them."""

from __future__ import annotations

from math import isqrt
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

# ---- a driven spring with two wells (Duffing): the states of the last periods of the drive, against its strength
OMEGA, DELTA = 1.2, 0.3
TRANSIENT, PERIODS, STEPS_OF_A_PERIOD = 100, 8, 50
PERIOD = 2.0 * np.pi / OMEGA


def strengths(size: int) -> Array:
    """Of the drive, shape (size,). Members start with v = 0, y = 1."""
    return np.linspace(0.2, 0.65, size)


# ---- a bob above three magnets: the number of the one that is nearest in the end, against where it is let go
GRAVITY, FRICTION, HEIGHT = 0.5, 0.2, 0.3
EXTENT, END, STEPS = 2.4, 40.0, 1000
MAGNETS = ((-float(np.sqrt(0.75)), -0.5), (float(np.sqrt(0.75)), -0.5), (0.0, 1.0))


def bobs(size: int) -> Array:
    """Coordinates at the start, at rest, shape (2, size²)."""
    side = (np.arange(size) - 0.5 * (size - 1)) * (2.0 * EXTENT / size)
    return np.stack(np.broadcast_arrays(side, side[:, np.newaxis])).reshape(2, -1)


def nearest(y: Array) -> Array:
    """The number of the nearest magnet, for coordinates of shape (2, …)."""
    return np.argmin([(y[0] - a) ** 2 + (y[1] - b) ** 2 for a, b in MAGNETS], axis=0).astype(np.int8)


# ---- three bodies near the figure-eight: when two are first far apart, against their velocities
X = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
V = (0.347116888118926938, 0.532724945388030229)
TURN = 6.32591398292621167759
WIDTH, TURNS, OBSERVED_OF_A_TURN = 0.12, 30, 10
#: Of a step, relative; and the most steps of a member, for what comes all but to a collision.
TOLERANCE, MAX_STEPS = 1e-10, 300 * TURNS
APART = 4.0


def velocities(size: int) -> Array:
    """Of the first two bodies; the third has −2 times that. Shape (2, size²)."""
    off = np.linspace(-WIDTH, WIDTH, size)
    return np.stack(np.broadcast_arrays(V[0] + off, (V[1] + off)[:, np.newaxis])).reshape(2, -1)


#: Members of each sweep by its size, that of the full run, and that of a quick one.
SIZES: dict[str, tuple[int, int]] = {"bifurcation": (1_000_000, 4000), "basins": (2000, 64), "figure_eight": (317, 24)}


#: Who would take too long is given so many times fewer members, and shown as if it had made them all.
SHARES: dict[tuple[str, str], int] = {
    ("heyoka", "bifurcation"): 25,
    ("heyoka", "basins"): 100,
    ("heyoka", "figure_eight"): 9,
    ("numba", "figure_eight"): 9,
}


def smaller(name: str, size: int, times: int) -> int:
    """The size of a sweep with so many times fewer members."""
    return size // times if name == "bifurcation" else size // isqrt(times)


def members(name: str, size: int) -> int:
    """How many."""
    return size if name == "bifurcation" else size * size
