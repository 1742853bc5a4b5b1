"""Orbital elements of one body about another: to states and back."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array, Blocks, Shape
from ...base.immutable import by_value
from ...errors import ArgumentError, ShapeError
from ...model.parameters import aligned
from ...reference import functions as f
from ...reference.systems.rods import dot
from .kepler import LARGEST_ANGLE, beyond_sinh, eccentricity, revolving, short_of_sine, solved

#: An eccentricity or the sine of an inclination below this is a rounding: angles that depend on its direction are then zero.
NONE = 16.0 * 2.0**-52

#: Ways to say how large an orbit is, and where on it the body is: at most one of each.
SIZES = ("a", "period", "periapsis")
PLACES = ("true_anomaly", "mean_anomaly", "eccentric_anomaly", "true_longitude", "mean_longitude", "time_of_periapsis")
ARGUMENTS = ("argument_of_periapsis", "longitude_of_periapsis")

#: All names of elements.
NAMES = (*SIZES, "e", "inclination", "node", *ARGUMENTS, *PLACES)


@by_value
class Elements(NamedTuple):
    """The orbits of bodies, each of the shape of what they were computed from. Angles are in rad.

    Of a circle (e below 4·10⁻¹⁵) ``argument_of_periapsis`` is 0: anomalies are counted from the node. Of an orbit in the plane of
    reference (the sine of its inclination below 4·10⁻¹⁵) ``node`` is 0: the argument of the periapsis is counted from the first
    axis, in the direction of motion. A body that moves along the line to the other has e = 1 and no angles: they are NaN, and so
    are all elements of a state that is not finite.

    Attributes:
        mu: μ, G times the mass of both.
        a: semi-major axis; below zero of a hyperbola, infinite of a parabola.
        periapsis: the least distance q.
        e: eccentricity.
        inclination: 0 to π; 0 or π in the plane.
        node: longitude Ω of the ascending node, −π to π, from the first axis.
        argument_of_periapsis: ω, −π to π, from the node in the direction of motion.
        true_anomaly: −π to π, from the periapsis.
        t: the time of the state, for ``time_of_periapsis``.

    Example:
        >>> bodies, v, y = sw.orbits.system([1.0, 1e-3], a=1.0, e=0.5, mean_anomaly=2.0, G=1.0)
        >>> orbit = sw.orbits.elements(bodies, v, y)
        >>> orbit.a.round(12), orbit.e.round(12), orbit.mean_anomaly.round(12)
        (array([1.]), array([0.5]), array([2.]))
    """

    mu: Array
    a: Array
    periapsis: Array
    e: Array
    inclination: Array
    node: Array
    argument_of_periapsis: Array
    true_anomaly: Array
    t: Any = 0.0

    @property
    def eccentric_anomaly(self) -> Array:
        """E of an ellipse, F of a hyperbola, the tangent of half the true anomaly of a parabola."""
        return eccentric_of_true(self.true_anomaly, self.e)

    @property
    def mean_anomaly(self) -> Array:
        """M, which grows in proportion to the time; of an ellipse −π to π."""
        return mean_of_eccentric(self.eccentric_anomaly, self.e)

    @property
    def mean_motion(self) -> Array:
        """How fast the mean anomaly grows, in rad per unit of time: √(μ/|a|³), of a parabola √(μ/(2q³))."""
        return mean_motion(self.mu, self.a, self.periapsis)

    @property
    def period(self) -> Array:
        """The time of a revolution; infinite if the orbit is not an ellipse."""
        with np.errstate(divide="ignore"):
            return np.where(self.e < 1.0, 2.0 * math.pi / self.mean_motion, np.where(self.e >= 1.0, np.inf, np.nan))

    @property
    def apoapsis(self) -> Array:
        """The greatest distance; infinite if the orbit is not an ellipse."""
        with np.errstate(invalid="ignore"):
            return np.where(self.e < 1.0, self.a * (1.0 + self.e), np.where(self.e >= 1.0, np.inf, np.nan))

    @property
    def longitude_of_periapsis(self) -> Array:
        """ϖ = Ω + ω, −π to π."""
        return _within_a_turn(self.node + self.argument_of_periapsis)

    @property
    def true_longitude(self) -> Array:
        """Ω + ω and the true anomaly, −π to π."""
        return _within_a_turn(self.node + self.argument_of_periapsis + self.true_anomaly)

    @property
    def mean_longitude(self) -> Array:
        """Ω + ω and the mean anomaly, −π to π; where e ≥ 1, its mean anomaly is no angle, and it has any size."""
        longitude = self.node + self.argument_of_periapsis + self.mean_anomaly
        return np.where(self.e < 1.0, _within_a_turn(longitude), longitude)

    @property
    def time_of_periapsis(self) -> Array:
        """A time at which the body is at its periapsis: of an ellipse the nearest one."""
        with np.errstate(divide="ignore", invalid="ignore"):
            narrow = np.where(self.e == 1.0, 0.5 ** (1.0 / 3.0), np.abs(1.0 - self.e))
            # By e and q, as the anomaly is: near a parabola they say what the axis does not.
            rate = np.sqrt(self.mu * narrow / self.periapsis) * (narrow / self.periapsis)
            return np.asarray(self.t - self.mean_anomaly / rate)


def state(mu: Any, *, t: Any = 0.0, dim: int | None = None, **elements: Any) -> Blocks:
    """The velocity and the place of a body on an orbit, relative to the other one.

    Args:
        mu: μ, G times the mass of both, above zero; broadcasts over the others.
        t: the time of the state; only ``time_of_periapsis`` needs it.
        dim: 2 or 3; if None, 3 if an inclination or a node is among the elements.
        **elements: as those of ``orbits.system``, each a number or an array of the batch.

    Returns:
        v and y, shape (dim, *batch).

    Raises:
        ArgumentError: if an argument is wrong, or the elements are those of no orbit.

    Example:
        >>> v, y = sw.orbits.state(1.0, periapsis=1.0, e=1.0, true_anomaly=np.pi / 2)  # a parabola, a right angle on
        >>> v.round(6), y.round(6)
        (array([-0.707107,  0.707107]), array([0., 2.]))
    """
    mu = checks.numbers("mu", mu, positive=True)
    dim, read = read_elements(elements, dim)
    t = checks.numbers("t", t, unit="units of time")
    batch = checks.batch_shape({name: array.shape for name, array in (read | {"mu": mu, "t": t}).items()})
    checks.fits("elements: the states", 60, batch, "ask for fewer")
    return placed(np.broadcast_to(mu, batch), t, dim, {name: np.broadcast_to(array, batch) for name, array in read.items()})


def of_state(mu: Any, v: Any, y: Any, *, t: Any = 0.0) -> Elements:
    """The elements of the orbit of one body about another.

    Args:
        mu: μ, G times the mass of both, above zero; broadcasts.
        v: velocity relative to the other body, shape (2 or 3, *batch).
        y: place relative to it, likewise, not zero.
        t: the time of the state, for ``time_of_periapsis``; broadcasts.

    Returns:
        The elements, shape (*batch).

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> orbit = sw.orbits.of_state(1.0, v=[0.0, 1.2], y=[1.0, 0.0])
        >>> float(orbit.e.round(12)), float(orbit.apoapsis.round(6))
        (0.44, 2.571429)
    """
    mu = checks.numbers("mu", mu, positive=True)
    blocks = [checks.numbers(name, block) for name, block in (("v", v), ("y", y))]
    for name, block in zip(("v", "y"), blocks, strict=True):
        if block.ndim == 0 or len(block) not in (2, 3):
            raise ShapeError(f"{name}: expected 2 or 3 numbers along the first axis, got shape {block.shape}")
    if len(blocks[0]) != len(blocks[1]):
        raise ShapeError(f"v and y: expected as many dimensions in both, got shapes {blocks[0].shape} and {blocks[1].shape}")
    t = checks.numbers("t", t, unit="units of time")
    batch = checks.batch_shape({"mu": mu.shape, "v": blocks[0].shape[1:], "y": blocks[1].shape[1:], "t": t.shape})
    checks.fits("v, y: the elements", 60, batch, "ask for fewer")
    v, y = (np.broadcast_to(aligned(block, 1, batch), (len(block), *batch)) for block in blocks)
    if not np.abs(y).max(axis=0).all():
        raise ArgumentError("y: expected a place other than that of the other body, got one that is zero")
    return of_pair(np.broadcast_to(mu, batch), v, y, t)


def read_elements(elements: dict[str, Any], dim: int | None) -> tuple[int, dict[str, Array]]:
    """The dimension and the checked numbers of what a caller says of an orbit, by name; not yet of one shape."""
    for name in elements:
        checks.known("elements", name, NAMES)
    told = {name: value for name, value in elements.items() if value is not None}
    for kind, names, least in (
        ("the size of an orbit", SIZES, 1),
        ("the direction of the periapsis", ARGUMENTS, 0),
        ("the place on an orbit", PLACES, 0),
    ):
        of = [name for name in names if name in told]
        if len(of) > 1 or len(of) < least:
            some = "one of" if least else "at most one of"
            raise ArgumentError(f"{kind}: expected {some} {', '.join(names)}, got {' and '.join(of) or 'none'}")
    read = {name: checks.numbers(name, value) for name, value in told.items() if name != "e"}
    read["e"] = eccentricity(told.get("e", 0.0))
    for name in ("period", "periapsis"):
        if name in read:
            read[name] = checks.numbers(name, read[name], positive=True)
    is_flat = "inclination" not in told and "node" not in told
    size = checks.count("dim", dim, 2, 3) if dim is not None else 2 if is_flat else 3
    if "inclination" in read:
        i = read["inclination"]
        if (wrong := (i < 0.0) | (i > math.pi)).any():
            raise ArgumentError(f"inclination: expected angles of 0 to π in rad, got {i[wrong][0]:g}")
        if size == 2 and (wrong := (i != 0.0) & (i != math.pi)).any():
            raise ArgumentError(f"inclination: expected 0 or π in the plane, dim=2, got {i[wrong][0]:g}; give dim=3")
    for name in set(told) - {*SIZES, "e", "inclination", "mean_anomaly", "eccentric_anomaly", "mean_longitude"}:
        if name != "time_of_periapsis" and (wrong := np.abs(read[name]) > LARGEST_ANGLE).any():
            raise ArgumentError(f"{name}: expected an angle of at most {LARGEST_ANGLE:.3g} rad, got {read[name][wrong][0]:g}")
    return size, read


def placed(mu: Array, t: Array, dim: int, read: dict[str, Array]) -> Blocks:
    """The states of elements that are checked one by one and have one shape."""
    with np.errstate(all="ignore"):  # what is beyond the range of floats is refused
        return _placed(mu, t, dim, read)


def _placed(mu: Array, t: Array, dim: int, read: dict[str, Array]) -> Blocks:
    e, zero = read["e"], np.zeros(mu.shape)
    a, q = _sizes(mu, e, read)
    inclination, node = read.get("inclination", zero), read.get("node", zero)
    argument = read.get("argument_of_periapsis", zero)
    if "longitude_of_periapsis" in read:
        argument = read["longitude_of_periapsis"] - node
    anomaly = _anomalies(mu, a, q, e, t, node + argument, read)
    (v_along, v_across), (along, across) = _in_its_plane(mu, a, q, e, anomaly)
    cw, sw, cn, sn = f.cos(argument), f.sin(argument), f.cos(node), f.sin(node)
    # cos π is −1 but sin π of floats is not 0, which would lift an orbit out of the plane.
    ci, si = f.cos(inclination), np.where(inclination == math.pi, 0.0, f.sin(inclination))

    def turned(along: Array, across: Array) -> Array:
        from_node, beyond = along * cw - across * sw, along * sw + across * cw
        flat = [cn * from_node - sn * (ci * beyond), sn * from_node + cn * (ci * beyond)]
        return np.stack([*flat, si * beyond] if dim == 3 else flat)

    v, y = turned(v_along, v_across), turned(along, across)
    if not (np.isfinite(v).all() and np.isfinite(y).all()):
        raise ArgumentError("elements: expected an orbit whose places and velocities are floats, got one beyond their range")
    return v, y


def _sizes(mu: Array, e: Array, read: dict[str, Array]) -> Blocks:
    if "periapsis" in read:
        q = read["periapsis"]
        with np.errstate(divide="ignore"):
            return q / (1.0 - e), q
    if "period" in read:
        if (wrong := e >= 1.0).any():
            raise ArgumentError(f"period: expected an ellipse, e below 1, got e = {e[wrong][0]:g}; give a or periapsis")
        root = f.cbrt(mu) * f.cbrt(read["period"] / (2.0 * math.pi)) ** 2
        return root, root * (1.0 - e)
    a = read["a"]
    if (wrong := e == 1.0).any():
        raise ArgumentError("a: a parabola, e = 1, has no semi-major axis; give periapsis")
    if (wrong := (a == 0.0) | ((a > 0.0) != (e < 1.0))).any():
        raise ArgumentError(
            f"a: expected a semi-major axis above zero with e below 1, or below zero with e above 1, got a = {a[wrong][0]:g} "
            f"with e = {e[wrong][0]:g}"
        )
    return a, a * (1.0 - e)


def _anomalies(mu: Array, a: Array, q: Array, e: Array, t: Array, longitude: Array, read: dict[str, Array]) -> Array:
    """The eccentric anomaly, from what says where the body is; from its periapsis if nothing does."""
    if "eccentric_anomaly" in read:
        return _inside("eccentric_anomaly", read["eccentric_anomaly"], e)
    for name, since in (("true_anomaly", 0.0), ("true_longitude", longitude)):
        if name in read:
            true = _within_a_turn(read[name] - since)
            with np.errstate(divide="ignore", invalid="ignore"):
                outside = (1.0 + e * f.cos(true) <= 0.0) & (e > 1.0) | (np.abs(true) >= math.pi) & (e >= 1.0)
            if outside.any():
                raise ArgumentError(
                    f"{name}: expected a true anomaly at which the orbit has a place, for e = {e[outside][0]:g} below "
                    f"{math.acos(max(-1.0 / e[outside][0], -1.0)):.6g} rad from the periapsis, got {true[outside][0]:g}"
                )
            return eccentric_of_true(true, e)
    if "time_of_periapsis" in read:
        name, mean = "time_of_periapsis", (t - read["time_of_periapsis"]) * mean_motion(mu, a, q)
    elif "mean_longitude" in read:
        name, mean = "mean_longitude", read["mean_longitude"] - longitude
    else:
        name, mean = "mean_anomaly", read.get("mean_anomaly", np.zeros(mu.shape))
    if not np.isfinite(mean).all():
        raise ArgumentError(f"{name}: expected an orbit whose mean anomaly is a float, got one beyond their range")
    revolving(name, mean, e)
    return solved(mean, e)


def _inside(name: str, anomaly: Array, e: Array) -> Array:
    """An eccentric anomaly that is given, if its sine or its hyperbolic sine is a float."""
    most = np.where(e < 1.0, LARGEST_ANGLE, np.where(e > 1.0, 350.0, 1e150))
    if (wrong := np.abs(anomaly) > most).any():
        raise ArgumentError(f"{name}: expected at most {most[wrong][0]:.3g}, got {anomaly[wrong][0]:g}")
    return anomaly


def _in_its_plane(mu: Array, a: Array, q: Array, e: Array, x: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Velocity and place along the direction of the periapsis and across it, by the eccentric anomaly.

    Written so that nothing cancels near the periapsis of an orbit whose e is close to 1.
    """
    round_, flat = e < 1.0, e == 1.0
    size, angle = np.where(flat, 1.0, np.abs(a)), np.where(round_, x, 0.0)
    bow = np.where(round_ | flat, 0.0, x)
    half, sine, cosine = f.sin(0.5 * angle), f.sin(angle), f.cos(angle)
    half_h, sine_h, cosine_h = f.sinh(0.5 * bow), f.sinh(bow), f.cosh(bow)
    square = np.where(round_, half * half, half_h * half_h)
    side = np.sqrt(q * (1.0 + e))  # √p
    with np.errstate(over="ignore", invalid="ignore"):
        along = np.where(flat, q * (1.0 - x * x), q - 2.0 * size * square)
        wide = np.sqrt(size) * side
        across = np.where(flat, 2.0 * q * x, wide * np.where(round_, sine, sine_h))
        distance = np.where(flat, q * (1.0 + x * x), q + 2.0 * size * e * square)
        sideways = np.where(flat, x * np.sqrt(2.0 * q), np.sqrt(size) * np.where(round_, sine, sine_h))
        root = np.sqrt(mu)
        v_along = -(root * sideways) / distance
        v_across = (root * side) * np.where(flat, 1.0, np.where(round_, cosine, cosine_h)) / distance
    return (v_along, v_across), (along, across)


def of_pair(mu: Array, v: Array, y: Array, t: Any) -> Elements:
    """The elements of relative states of one shape, (dim, *batch); NaN where one is."""
    with np.errstate(all="ignore"):
        if len(y) == 2:
            v, y = (np.concatenate([block, np.zeros_like(block[:1])]) for block in (v, y))
        r, square, radial = f.hypot(f.hypot(y[0], y[1]), y[2]), dot(v, v), dot(y, v)
        h = np.stack([y[1] * v[2] - y[2] * v[1], y[2] * v[0] - y[0] * v[2], y[0] * v[1] - y[1] * v[0]])
        flat = f.hypot(h[0], h[1])
        size = f.hypot(flat, h[2])
        axis = h / size
        # Towards the periapsis, of length e, by its parts along y and across it.
        outward = y / r
        p_over_r = (size / r) * (size / r) * (r / mu)
        e_out, e_side = p_over_r - 1.0, -(radial / r) * (size / mu)
        e = f.hypot(e_out, e_side)
        is_line, is_flat, is_round = size == 0.0, flat <= NONE * size, e <= NONE
        energy = 2.0 / r - square / mu
        a = 1.0 / energy
        # Near a parabola e² = 1 − p/a says on which side of it the orbit is, as the energy does.
        p = size * size / mu
        e = np.where(is_line, 1.0, np.where(np.abs(p * energy) < 0.25, np.sqrt(1.0 - p * energy), e))
        a = np.where((e == 1.0) & ~is_line, np.inf, a)
        q = np.where(is_line, 0.0, p / (1.0 + e))
        node = np.where(is_flat, 0.0, f.arctan2(h[0], -h[1]))
        inclination = np.where(is_flat, np.where(h[2] < 0.0, math.pi, 0.0), f.arctan2(flat, h[2]))
        inclination = np.where(is_line | np.isnan(e), np.nan, inclination)
        # The angle of the body from the node in the direction of motion, and from the periapsis.
        to_node = np.stack([f.cos(node), f.sin(node), np.zeros_like(node)])
        beyond = _cross(axis, to_node)
        latitude = f.arctan2(dot(outward, beyond), dot(outward, to_node))
        true = np.where(is_round, latitude, f.arctan2(-e_side, e_out))
        argument = np.where(is_round, 0.0, _within_a_turn(latitude - true))
        unknown = is_line | np.isnan(e)
        node, argument, true = (np.where(unknown, np.nan, angle) for angle in (node, argument, true))
    return Elements(mu, a, q, e, inclination, node, argument, true, t)


def eccentric_of_true(true: Array, e: Array) -> Array:
    """E, F or D of a true anomaly within ±π."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sine, cosine = f.sin(0.5 * true), f.cos(0.5 * true)
        narrow, wide = np.sqrt(np.abs(1.0 - e)), np.sqrt(1.0 + e)
        share = (narrow * sine) / (wide * cosine)
        bow = np.clip(share, -1.0, 1.0)
        hyperbola = f.log1p(2.0 * np.abs(bow) / (1.0 - np.abs(bow)))  # 2·artanh
        ellipse = 2.0 * f.arctan2(narrow * sine, wide * cosine)
        other = np.where(e > 1.0, np.copysign(hyperbola, share), sine / cosine)
        return np.asarray(np.where(e < 1.0, ellipse, other))


def mean_of_eccentric(x: Array, e: Array) -> Array:
    """M of E, F or D, without the cancellation where e is close to 1."""
    with np.errstate(invalid="ignore", over="ignore"):
        round_ = np.where(e < 1.0, x, 0.0)
        bow = np.where(e > 1.0, x, 0.0)
        ellipse = (1.0 - e) * round_ + e * short_of_sine(round_)
        hyperbola = (e - 1.0) * bow + e * beyond_sinh(bow)
        mean = np.where(e < 1.0, ellipse, np.where(e > 1.0, hyperbola, x + x * x * x / 3.0))
        return np.asarray(np.where(np.isnan(x) | np.isnan(e), np.nan, mean))


def mean_motion(mu: Array, a: Array, q: Array) -> Array:
    """√(μ/|a|³), or √(μ/(2q³)) of a parabola."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        size = np.where(np.isinf(a), q, np.abs(a))
        return np.sqrt(np.where(np.isinf(a), 0.5, 1.0) * mu / size) / size


def _within_a_turn(angle: Array) -> Array:
    """The angle, −π to π."""
    return np.asarray(angle - 2.0 * math.pi * np.rint(angle / (2.0 * math.pi)))


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def spread(name: str, values: Array, own: int, batch: Shape) -> Array:
    """Numbers over orbits and a batch: one for all orbits, or one for each along the first axis."""
    if values.ndim == 0:
        return np.broadcast_to(values, (own, *batch))
    if len(values) != own:
        raise ShapeError(
            f"{name}: expected one number, or one for each of the {own} orbiting bodies along the first axis, got shape "
            f"{values.shape}"
        )
    return np.broadcast_to(aligned(values, 1, batch), (own, *batch))
