"""Kepler's equation: where on its orbit a body is at a time, to the rounding of floats (elliptic, parabolic and hyperbolic)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError
from ...reference import functions as f

#: A function's value and two derivatives.
Terms = Callable[[Array], tuple[Array, Array, Array]]

#: Above this a mean anomaly has lost its place within a revolution.
LARGEST_ANGLE = 2.0**40

#: The largest eccentricity, and the largest mean anomaly of an orbit that is no ellipse, so that nothing is beyond the floats.
LARGEST = 1e100

#: The most improvements of the first guess. Each triples its digits; three suffice where it is good.
MOST_ITERATIONS = 30

#: E − sin E and sinh F − F below this by their series of 11 terms, whose next one is below a rounding, 1/25! of the first 1/3!.
SERIES_BELOW = 1.5

#: 1/3!, 1/5!, … 1/23!
INVERSE_FACTORIALS = tuple(1.0 / math.factorial(n) for n in range(3, 24, 2))

#: A turn as the float nearest to it, and what it is short of a turn.
TURN, TURN_REST = 2.0 * math.pi, 2.4492935982947064e-16


def eccentric_anomaly(mean_anomaly: Any, e: Any) -> Array:
    """Solve Kepler's equation for the eccentric anomaly, to a rounding or two of it.

    | orbit | e | equation | the mean anomaly grows by |
    |---|---|---|---|
    | ellipse | below 1 | E − e·sin E = M | √(μ/a³) per unit of time |
    | parabola | 1 | D + D³/3 = M; D is the tangent of half the true anomaly | √(μ/(2q³)), q the least distance |
    | hyperbola | above 1 | e·sinh F − F = M | √(μ/(−a)³) |

    Args:
        mean_anomaly: M in rad, from the periapsis, of any sign; on an ellipse up to 2⁴⁰.
        e: eccentricity, zero or more; broadcasts.

    Returns:
        E, D or F, of an ellipse in the same revolution as M.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> sw.orbits.eccentric_anomaly(np.pi / 2, [0.0, 0.5, 0.99])
        array([1.57079633, 2.02097994, 2.30544318])
    """
    mean, e = checks.numbers("mean_anomaly", mean_anomaly, unit="rad"), eccentricity(e)
    shape = checks.batch_shape({"mean_anomaly": mean.shape, "e": e.shape})
    checks.fits("mean_anomaly, e: the anomalies", 24, shape, "ask for fewer")
    mean, e = np.broadcast_to(mean, shape), np.broadcast_to(e, shape)
    revolving("mean_anomaly", mean, e)
    return solved(mean, e)


def eccentricity(e: Any) -> Array:
    """The argument ``e`` if it is zero or more."""
    e = checks.not_negative("e", e, "an eccentricity")
    if (wrong := e > LARGEST).any():
        raise ArgumentError(f"e: expected an eccentricity of at most {LARGEST:g}, got {e[wrong][0]:g}")
    return np.asarray(e)


def revolving(argument: str, mean: Array, e: Array) -> None:
    """Raise if a mean anomaly of an ellipse is so large that its place within a revolution is lost."""
    if (wrong := (np.abs(mean) > LARGEST_ANGLE) & (e < 1.0)).any():
        raise ArgumentError(
            f"{argument}: expected an angle of at most {LARGEST_ANGLE:.3g} rad, beyond which the place within a revolution is "
            f"lost, got {mean[wrong][0]:g}"
        )
    if (wrong := np.abs(mean) > LARGEST).any():
        raise ArgumentError(f"{argument}: expected at most {LARGEST:g}, got {mean[wrong][0]:g}")


def solved(mean: Array, e: Array) -> Array:
    """The eccentric anomaly of checked numbers of one shape; NaN where one is."""
    anomaly = np.full(mean.shape, math.nan)
    with np.errstate(invalid="ignore", under="ignore"):
        for where, solve in ((e < 1.0, _ellipse), (e == 1.0, lambda mean, _: parabola(mean)), (e > 1.0, _hyperbola)):
            if where.any():
                anomaly[where] = solve(mean[where], e[where])
    return anomaly


def parabola(mean: Array) -> Array:
    """D of D + D³/3 = M, Barker's equation: 2·sinh(⅓·arsinh(3M/2))."""
    return np.asarray(np.copysign(2.0 * f.sinh(_arsinh(1.5 * np.abs(mean)) / 3.0), mean))


def _ellipse(mean: Array, e: Array) -> Array:
    turns = np.rint(mean / TURN)
    within = (mean - turns * TURN) - turns * TURN_REST
    wanted = np.abs(within)
    anomaly = _guess(wanted, e)

    def terms(x: Array) -> tuple[Array, Array, Array]:
        return (1.0 - e) * x + e * short_of_sine(x) - wanted, 1.0 - e * f.cos(x), e * f.sin(x)

    anomaly = _improved(anomaly, terms, lambda x: np.clip(x, 0.0, math.pi))
    return (np.copysign(anomaly, within) + turns * TURN_REST) + turns * TURN


def _hyperbola(mean: Array, e: Array) -> Array:
    wanted = np.abs(mean)

    def terms(x: Array) -> tuple[Array, Array, Array]:
        return (e - 1.0) * x + e * beyond_sinh(x) - wanted, e * f.cosh(x) - 1.0, e * f.sinh(x)

    return np.copysign(_improved(_guess(wanted, e), terms, lambda x: np.clip(x, 0.0, 709.0)), mean)


def _guess(mean: Array, e: Array) -> Array:
    """A first guess by a cubic (Mikkola 1987, Celestial Mechanics 40, 329), for all M ≥ 0 and e: within some thousandths."""
    alpha, beta = np.abs(1.0 - e) / (4.0 * e + 0.5), 0.5 * mean / (4.0 * e + 0.5)
    z = f.cbrt(beta + f.hypot(beta, alpha * np.sqrt(alpha)))
    z = np.where(z > 0.0, z, 1.0)
    s = 2.0 * beta / (z * z + alpha + (alpha / z) ** 2)  # z − α/z without its cancellation
    bent = s**5
    ellipse = s - 0.078 * bent / (1.0 + e)
    hyperbola = s + 0.071 * bent / ((1.0 + 0.45 * s * s) * (1.0 + 4.0 * s * s) * np.maximum(e, 1.0))
    guess: Array = np.where(e < 1.0, mean + e * (3.0 * ellipse - 4.0 * ellipse**3), 3.0 * _arsinh(hyperbola))
    return guess


def _improved(anomaly: Array, terms: Terms, within: Callable[[Array], Array]) -> Array:
    """The root of a function from a first guess, by Halley's method; ``terms`` are its value and two derivatives."""
    anomaly = within(anomaly)
    for _ in range(MOST_ITERATIONS):
        value, slope, bend = terms(anomaly)
        slope = np.maximum(slope, np.finfo(float).tiny)
        newton = value / slope
        nearer = within(anomaly - newton / np.maximum(1.0 - 0.5 * newton * bend / slope, 0.25))
        change = np.abs(nearer - anomaly)
        anomaly = nearer
        if not (change > 1e-11 * anomaly).any():  # the next change is below a rounding
            break
    value, slope, _ = terms(anomaly)
    return within(anomaly - value / np.maximum(slope, np.finfo(float).tiny))


def short_of_sine(x: Array) -> Array:
    """X − sin x, without the cancellation of small angles."""
    z = x * x
    small = _series(np.minimum(z, SERIES_BELOW * SERIES_BELOW), -1.0)
    return np.where(np.abs(x) < SERIES_BELOW, x * (z * small), x - f.sin(x))


def beyond_sinh(x: Array) -> Array:
    """Sinh x − x, likewise."""
    z = x * x
    small = _series(np.minimum(z, SERIES_BELOW * SERIES_BELOW), 1.0)
    return np.asarray(np.where(np.abs(x) < SERIES_BELOW, x * (z * small), f.sinh(x) - x))


def _series(z: Array, sign: float) -> Array:
    """1/3! + sign·z/5! + z²/7! + …"""
    total = np.full_like(z, INVERSE_FACTORIALS[-1])
    for factor in reversed(INVERSE_FACTORIALS[:-1]):
        total = factor + sign * (z * total)
    return total


def _arsinh(x: Array) -> Array:
    """Arsinh of numbers that are not negative, without cancellation and without overflow."""
    small = f.log1p(x + x * (x / (1.0 + f.hypot(1.0, x))))
    return np.asarray(np.where(x < 1e150, small, f.log(x) + math.log(2.0)))
