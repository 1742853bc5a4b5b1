"""Bodies on orbits about those before them: as a system with its start, and back; Jacobi's coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import by_value
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...model.parameters import aligned
from ...model.systems import NBody, System
from ...runs.result import Run
from .elements import Elements, of_pair, placed, read_elements, spread

#: What bodies may orbit, as a word.
CENTRES = ("jacobi", "astrocentric")


@by_value
class Start(NamedTuple):
    """Bodies and their start.

    Attributes:
        system: the bodies, with their masses and G.
        v: velocities, shape (bodies, dim, *batch); the centre of mass rests.
        y: places, likewise; the centre of mass is the origin.

    Example:
        >>> start = sw.orbits.system([1.0, 1e-3], a=1.0, G=1.0)
        >>> start.y.round(3)
        array([[-0.001,  0.   ],
               [ 0.999,  0.   ]])
    """

    system: NBody
    v: Array
    y: Array


#: What elements that are written by a letter are called here, as REBOUND and books have them.
HINTS = {
    "P": "the time of a revolution is period=",
    "M": "the mean anomaly is mean_anomaly=",
    "f": "the true anomaly is true_anomaly=",
    "E": "the eccentric anomaly is eccentric_anomaly=",
    "T": "the time of the periapsis is time_of_periapsis=",
    "l": "the mean longitude is mean_longitude=",
    "theta": "the true longitude is true_longitude=",
    "inc": "the inclination is inclination=",
    "Omega": "the longitude of the node is node=",
    "omega": "the argument of the periapsis is argument_of_periapsis=",
    "pomega": "the longitude of the periapsis is longitude_of_periapsis=",
    "m": "the masses stand first, those of all bodies",
}


@checks.with_hints(HINTS)
def system(
    masses: Any,
    *,
    a: Any = None,
    period: Any = None,
    periapsis: Any = None,
    e: Any = 0.0,
    inclination: Any = None,
    node: Any = None,
    argument_of_periapsis: Any = None,
    longitude_of_periapsis: Any = None,
    true_anomaly: Any = None,
    mean_anomaly: Any = None,
    eccentric_anomaly: Any = None,
    true_longitude: Any = None,
    mean_longitude: Any = None,
    time_of_periapsis: Any = None,
    t: Any = 0.0,
    around: Any = "jacobi",
    G: Any = 1.0,
    softening: Any = 0.0,
    dim: int | None = None,
) -> Start:
    """Bodies on orbits about those before them, ready to be stepped.

    Each element is one number for all orbiting bodies, or has one for each of them along its first axis, shape (bodies − 1,) or
    (bodies − 1, *batch). Angles are in rad.

    | what an orbit needs | elements |
    |---|---|
    | its size, one of these | ``a``, ``period``, ``periapsis``; of a parabola, e = 1, ``periapsis`` |
    | its shape | ``e`` |
    | its plane | ``inclination``, ``node``; without both, the bodies move in a plane |
    | the direction of its periapsis, at most one | ``argument_of_periapsis``, ``longitude_of_periapsis`` |
    | the body's place on it, at most one | anomalies, longitudes, ``time_of_periapsis``; none: at the periapsis |

    Args:
        masses: of all bodies, the one in the middle first, shape (bodies,) or (bodies, *batch); those of test particles are 0.
        a: semi-major axis; below zero of a hyperbola.
        period: the time of a revolution.
        periapsis: the least distance.
        e: eccentricity, zero or more.
        inclination: to the plane of the first two axes, 0 to π; above π/2 the motion is retrograde.
        node: longitude Ω of the ascending node, from the first axis.
        argument_of_periapsis: ω, from the node in the direction of motion.
        longitude_of_periapsis: ϖ = Ω + ω.
        true_anomaly: angle from the periapsis.
        mean_anomaly: M, which grows in proportion to the time.
        eccentric_anomaly: E of an ellipse, F of a hyperbola, the tangent of half the true anomaly of a parabola.
        true_longitude: Ω + ω and the true anomaly.
        mean_longitude: Ω + ω and the mean anomaly, as tables of planets have it.
        time_of_periapsis: a time at which the body is at its periapsis.
        t: the time of the start.
        around: what each body orbits: ``"jacobi"``, the centre of mass of all before it; ``"astrocentric"``, the first one; or a
            list with, for each orbiting body, the number of a body before it, or a list of numbers, for their centre of mass.
        G: constant of gravity, see ``orbits.gravity``; broadcasts over the batch.
        softening: as that of ``NBody``, for encounters; orbits are those without it.
        dim: 2 or 3; if None, 3 if there is an inclination or a node.

    Returns:
        ``system``, ``v``, ``y``; the centre of mass rests at the origin.

    Raises:
        ArgumentError: if an argument is wrong, or the elements are those of no orbit.

    Example:
        >>> bodies, v, y = sw.orbits.system([1.0, 9.5e-4, 2.9e-4], a=[5.2, 9.6], e=0.05, G=sw.orbits.gravity())
        >>> run = sw.integrate(bodies, "leapfrog", v=v, y=y, dt=0.05, steps=10_000, every=1000)
        >>> sw.orbits.elements(run).a[-1].round(2)
        array([5.2, 9.6])
    """
    masses = checks.not_negative("masses", masses)
    if masses.ndim == 0 or len(masses) < 2:
        raise ShapeError(f"masses: expected two or more along the first axis, the central body first, got shape {masses.shape}")
    orbits = len(masses) - 1
    centres = _centres(around, orbits)
    elements = {
        "a": a,
        "period": period,
        "periapsis": periapsis,
        "e": e,
        "inclination": inclination,
        "node": node,
        "argument_of_periapsis": argument_of_periapsis,
        "longitude_of_periapsis": longitude_of_periapsis,
        "true_anomaly": true_anomaly,
        "mean_anomaly": mean_anomaly,
        "eccentric_anomaly": eccentric_anomaly,
        "true_longitude": true_longitude,
        "mean_longitude": mean_longitude,
        "time_of_periapsis": time_of_periapsis,
    }
    dim, read = read_elements(elements, dim)
    t = checks.numbers("t", t, unit="units of time")
    bodies = NBody(masses, force="newton", G=G, softening=softening, dim=dim)
    shapes = {name: array.shape[1:] for name, array in read.items()}
    batch = checks.batch_shape(shapes | {"masses": masses.shape[1:], "G": bodies.G.shape, "t": t.shape})
    checks.fits("masses: the states", 60.0 * len(masses), batch, "ask for fewer")
    wide = np.broadcast_to(aligned(masses, 1, batch), (len(masses), *batch))
    mu = bodies.G * _strengths(wide, centres)
    if (wrong := ~(mu > 0.0)).any():
        k = int(np.argwhere(wrong)[0][0])
        raise ArgumentError(f"masses: expected a body or its centre to have a mass, but both have none: body {k + 1}")
    relative = placed(mu, t, dim, {name: spread(name, array, orbits, batch) for name, array in read.items()})
    v, y = (_gathered(wide, np.moveaxis(block, 0, 1), centres) for block in relative)
    return Start(bodies, v, y)


def elements(of: Any, v: Any = None, y: Any = None, *, t: Any = 0.0, around: Any = "jacobi") -> Elements:
    """The elements of the orbits that bodies are on: of a run at every saved time, or of one state.

    They are osculating: those of the orbits on which the bodies would go on if nothing else pulled them. A softening is left out.

    Args:
        of: a run of ``NBody`` under Newton's force, or the bodies alone.
        v: with bodies alone, their velocities, shape (bodies, dim, *batch).
        y: their places, likewise.
        t: with bodies alone, the time of the state.
        around: what each body orbits, as in ``orbits.system``.

    Returns:
        Elements of shape (bodies − 1, *batch), and of a run of shape (saved, bodies − 1, *batch). Of members that diverged they
        are NaN.

    Raises:
        UnsupportedError: if the force is another one, which has no such orbits.

    Example:
        >>> bodies, v, y = sw.orbits.system([1.0, 1e-3], period=1.0, e=0.3, G=sw.orbits.gravity())
        >>> run = sw.integrate(bodies, "dop853", v=v, y=y, tolerance=1e-12, at=[0.0, 0.25, 0.75])
        >>> sw.orbits.elements(run).mean_anomaly[:, 0].round(6)
        array([ 0.      ,  1.570796, -1.570796])
    """
    if isinstance(of, Run):
        if v is not None or y is not None:
            raise ArgumentError("v, y: expected none beside a run, which has its own")
        bodies, t = newtonian("of", of.system), np.asarray(of.t)
        saved = of.v.shape[0]
        # The saved states become the first axis of the batch.
        v, y = np.moveaxis(of.v, 0, 2), np.moveaxis(of.y, 0, 2)
        times = t.reshape(saved, *(1,) * (v.ndim - 3)) if t.ndim == 1 else t
        made = _elements(bodies, v, y, times, around)
        return made._replace(**{name: np.moveaxis(getattr(made, name), 1, 0) for name in made._fields})
    bodies = newtonian("of", of)
    if v is None or y is None:
        raise ArgumentError("v, y: expected the state of the bodies, got none; a run has its own")
    bodies = bodies.for_state_shapes(v, y)
    v, y = (checks.block(name, block, bodies.v_shape, "bodies, dim") for name, block in (("v", v), ("y", y)))
    return _elements(bodies, v, y, checks.numbers("t", t, unit="units of time"), around)


def jacobi(masses: Any, block: Any) -> Array:
    """Jacobi's coordinates: each body from the centre of mass of those before it, and first that of all.

    Velocities are converted alike.

    Args:
        masses: of the bodies, shape (bodies,) or (bodies, *batch).
        block: places or velocities, shape (bodies, dim, *batch).

    Returns:
        The block of the same shape.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> sw.orbits.jacobi([1.0, 1.0, 1.0], [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
        array([[1. , 0. ],
               [1. , 0. ],
               [1.5, 0. ]])
    """
    masses, block = _masses_and_block(masses, block)
    sums = _sums(masses)[:, np.newaxis]
    moment = masses[:, np.newaxis] * block
    total, rows = moment[0], []
    for k in range(1, len(block)):
        rows.append(block[k] - total / sums[k - 1])
        total = total + moment[k]
    return np.stack([total / sums[-1], *rows])


def inertial(masses: Any, block: Any) -> Array:
    """The coordinates of bodies from Jacobi's: the inverse of ``orbits.jacobi`` but for roundings.

    Args:
        masses: of the bodies, shape (bodies,) or (bodies, *batch).
        block: Jacobi's coordinates, shape (bodies, dim, *batch), the centre of mass first.

    Returns:
        The block of the same shape.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> sw.orbits.inertial([1.0, 1.0, 1.0], [[1.0, 0.0], [1.0, 0.0], [1.5, 0.0]])
        array([[0., 0.],
               [1., 0.],
               [2., 0.]])
    """
    masses, block = _masses_and_block(masses, block)
    sums = _sums(masses)[:, np.newaxis]
    centre, rows = block[0], []
    for k in range(len(block) - 1, 0, -1):
        # The body and the centre of those before it lie on both sides of the centre of them all.
        rows.append(centre + (sums[k - 1] / sums[k]) * block[k])
        centre = centre - (masses[k] / sums[k]) * block[k]
    return np.stack([centre, *reversed(rows)])


def newtonian(argument: str, of: Any) -> NBody:
    """The bodies, if Newton's force is between them."""
    if not isinstance(of, NBody):
        kind = of if isinstance(of, System) else type(of).__name__
        raise DTypeError(f"{argument}: expected a run of NBody or the bodies, got {kind}")
    if of.force != "newton":
        raise UnsupportedError(f"{argument}: expected bodies under Newton's force, which has such orbits, got force={of.force!r}")
    return of


def _elements(bodies: NBody, v: Array, y: Array, t: Array, around: Any) -> Elements:
    """The elements of checked states, shape (bodies, dim, …), whose other axes end in those of the batch."""
    n = len(bodies.masses)
    if n < 2:
        raise ShapeError("of: expected two bodies or more, got one")
    centres = _centres(around, n - 1)
    shapes = {"v": v.shape[2:], "y": y.shape[2:], "bodies": bodies.batch, "t": t.shape}
    batch = checks.batch_shape(shapes)
    checks.fits("of: the elements", 60.0 * n, batch, "select fewer saved states")
    masses = np.broadcast_to(aligned(bodies.masses, 1, batch), (n, *batch))
    v, y = (np.broadcast_to(aligned(block, 2, batch), (*block.shape[:2], *batch)) for block in (v, y))
    mu = bodies.G * _strengths(masses, centres)
    if not (mu > 0.0).all():
        raise ArgumentError("of: expected a body or its centre to have a mass, but both have none")
    v, y = (np.moveaxis(_apart(masses, block, centres), 1, 0) for block in (v, y))
    return of_pair(mu, v, y, np.broadcast_to(t, mu.shape))


def _centres(around: Any, orbits: int) -> list[Sequence[int]]:
    """The bodies whose centre of mass each orbiting body goes around."""
    if isinstance(around, str) or (isinstance(around, np.ndarray) and around.ndim == 0):
        word = checks.known("around", around, CENTRES)
        return [range(k) if word == "jacobi" else [0] for k in range(1, orbits + 1)]
    each = checks.several("around", around, "numbers of bodies, or lists of them")
    if len(each) != orbits:
        raise ShapeError(f"around: expected one entry for each of the {orbits} orbiting bodies, got {len(each)}")
    centres: list[Sequence[int]] = []
    for k, centre in enumerate(each, 1):
        some = list(centre) if isinstance(centre, (list, tuple, range)) else [centre]
        members = [checks.count(f"around[{k - 1}]", member, 0, k - 1) for member in some]
        if not members or len(set(members)) < len(members):
            raise ArgumentError(f"around[{k - 1}]: expected different bodies before body {k}, got {members}")
        centres.append(members)
    return centres


def _strengths(masses: Array, centres: list[Sequence[int]]) -> Array:
    """The mass of each orbiting body and its centre together."""
    before = np.cumsum(masses, axis=0)
    sums = (before[k - 1] if isinstance(of, range) else masses[of].sum(axis=0) for k, of in enumerate(centres, 1))
    return np.stack([mass + masses[k] for k, mass in enumerate(sums, 1)])


def _gathered(masses: Array, relative: Array, centres: list[Sequence[int]]) -> Array:
    """Places from those relative to centres, (orbits, dim, *batch), with the centre of mass of all at the origin."""
    rows = [np.zeros(relative.shape[1:])]
    before = _Before(masses[0], rows[0])
    for k, members in enumerate(centres, 1):
        rows.append((before.centre if isinstance(members, range) else _centre(masses, rows, members)) + relative[k - 1])
        before.add(masses[k], rows[k])
    return np.stack(rows) - before.centre


def _apart(masses: Array, block: Array, centres: list[Sequence[int]]) -> Array:
    """The inverse: places relative to centres."""
    rows, before = [], _Before(masses[0], block[0])
    for k, members in enumerate(centres, 1):
        rows.append(block[k] - (before.centre if isinstance(members, range) else _centre(masses, block, members)))
        before.add(masses[k], block[k])
    return np.stack(rows)


class _Before:
    """The bodies up to one, for their centre of mass, which the next one moves; without mass, their mean."""

    def __init__(self, mass: Array, row: Array) -> None:
        self.count, self.mass, self.centre = 1, mass, row

    def add(self, mass: Array, row: Array) -> None:
        self.count, self.mass = self.count + 1, self.mass + mass
        share = np.where(self.mass > 0.0, mass / np.where(self.mass > 0.0, self.mass, 1.0), 1.0 / self.count)
        self.centre = np.where(share == 1.0, row, self.centre + share * (row - self.centre))


def _centre(masses: Array, rows: Any, members: Sequence[int]) -> Array:
    if len(members) == 1:
        return np.asarray(rows[members[0]])
    total = masses[members].sum(axis=0)
    share = np.where(total > 0.0, masses[members] / np.where(total > 0.0, total, 1.0), 1.0 / len(members))
    return np.asarray(sum(share[i] * rows[member] for i, member in enumerate(members)))


def _sums(masses: Array) -> Array:
    """The mass of all bodies up to each one."""
    sums = np.cumsum(masses, axis=0)
    if not (sums[0] > 0.0).all():
        raise ArgumentError("masses: expected the first body to have a mass, got 0")
    return sums


def _masses_and_block(masses: Any, block: Any) -> tuple[Array, Array]:
    """Both checked and of one shape."""
    masses, block = checks.not_negative("masses", masses), checks.numbers("block", block)
    if block.ndim < 2 or 0 in block.shape:
        raise ShapeError(f"block: expected shape (bodies, dim, batch…), got {block.shape}")
    if masses.shape[:1] != block.shape[:1]:
        raise ShapeError(
            f"masses: expected one for each of the {len(block)} bodies along the first axis, got shape {masses.shape}"
        )
    batch: Shape = checks.batch_shape({"masses": masses.shape[1:], "block": block.shape[2:]})
    checks.fits("block: the coordinates", 4.0 * block.shape[0] * block.shape[1], batch, "ask for fewer")
    return (
        np.broadcast_to(aligned(masses, 1, batch), (len(masses), *batch)),
        np.broadcast_to(aligned(block, 2, batch), (*block.shape[:2], *batch)),
    )
