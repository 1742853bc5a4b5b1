"""What tests of rods share."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.errors import ArgumentError

CONTROL, RESETTING = sw.LengthControl(0.5), sw.Projection("length")


#: Two rods of length 1 with unit masses below the origin in a plane, and three.
TWO = sw.Rods([1.0, 1.0], [((0.0, 0.0), 0), (0, 1)], 1.0)


def hanging(*angles: float) -> Any:
    """Places of a chain of rods of length 1, each at an angle from straight down."""
    return np.cumsum([[math.sin(a), -math.cos(a)] for a in angles], axis=0)


def quiet(*arguments: Any, **options: Any) -> sw.Run:
    """A run of which it is known that it diverges, or that its rods do not keep their lengths."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        return sw.integrate(*arguments, **options)


def cone(degrees: float = 60.0) -> tuple[dict[str, Any], float]:
    """A start that circles at an angle from below, and its period 2π√(l·cosθ/g)."""
    angle = math.radians(degrees)
    omega = 1.0 / math.sqrt(math.cos(angle))
    y = [math.sin(angle), 0.0, -math.cos(angle)]
    return {"v": [0.0, omega * math.sin(angle), 0.0], "y": y}, 2.0 * math.pi / omega


@sw.system
def in_angles(t: Any, v: Any, y: Any, *, m: float = 2.0, long: float = 0.7) -> Any:
    """The double pendulum of rods 1 and ``long`` with masses 1 and m, gravity 1, by Lagrange's equations for its angles."""
    sine, cosine = np.sin(y[0] - y[1]), np.cos(y[0] - y[1])
    first = -m * long * v[1] ** 2 * sine - (1.0 + m) * np.sin(y[0])
    second = v[0] ** 2 * sine - np.sin(y[1])
    bottom = 1.0 + m * sine**2
    return np.array([(first - m * cosine * second) / bottom, ((1.0 + m) * second - cosine * first) / (long * bottom)])


def places(angles: Any, rates: Any, long: float = 0.7) -> tuple[Any, Any]:
    """v and y of the points, from angles and their rates."""
    lengths = np.array([1.0, long])
    y = np.stack([lengths * np.sin(angles), -lengths * np.cos(angles)], axis=-1)
    v = rates[..., None] * np.stack([lengths * np.cos(angles), lengths * np.sin(angles)], axis=-1)
    return np.cumsum(v, axis=-2), np.cumsum(y, axis=-2)


DOUBLE = sw.Rods([1.0, 2.0], [((0.0, 0.0), 0), (0, 1)], [1.0, 0.7])


ANGLES, RATES = np.array([1.5, -0.4]), np.array([0.3, 0.9])


def apart_from_angles(backend: str = "rust") -> float:
    """How far rods are from the same motion in angles, at t = 10, both to a tight tolerance."""
    v, y = places(ANGLES, RATES)
    options: dict[str, Any] = {"tolerance": 1e-13, "at": [10.0]}
    known = sw.integrate(in_angles(), "dop853", v=RATES, y=ANGLES, **options)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = sw.integrate(DOUBLE, "dop853", v=v, y=y, backend=backend, max_steps=2000, **options)
    except ArgumentError:
        return math.inf
    apart = [np.abs(a - b).max() for a, b in zip((run.v[-1], run.y[-1]), places(known.y[-1], known.v[-1]), strict=True)]
    return float(np.nan_to_num(max(apart), nan=math.inf))
