"""``stability_limit``: the largest step below which no mode grows that should not, and the mode that grows beyond it.

A linear system of more than two states is first decomposed (``parts``). Each part, or a system of two states, is then searched on
a ladder of steps, all members at once: the first rung on which a mode grows and the one before it enclose the limit. For two
states a narrow window between two rungs is found as well. Bisection makes the enclosure narrow, and where an eigenvalue crosses
the unit circle at an angle, the crossing itself is solved for. An eigenvalue that leaves the circle after a collision with
another (False Euler at Φ = 2) does so with the square root of the excess. There bisection alone is exact to rounding for two
states; for more, the square of the growth is extrapolated to zero. Where eigenvalues nearly meet, rounding would decide, so they
are computed in more digits (``exact``), on a ladder of wider rungs.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.reprs import share
from ...errors import AccuracyWarning, UnsupportedError
from ...model.compatibility import fits_together, one_state
from ...model.derivatives import traced
from ...model.methods import Method
from ...model.methods import method as find_method
from ...model.systems import LinearSystem, Springs, System
from ...model.systems.base import a_system
from ...model.systems.own import OwnSystem
from . import exact, maps
from .analysis import state, state_argument
from .eigen import EPS
from .limit_result import Mode, StabilityLimit, StabilityLimits, limits_of
from .limit_search import NUMBERS_OF_AN_ELEMENT, Search, members_at_once
from .parts import parts
from .some_members import Batch

#: A state is at rest if its rates are below so many roundings of the products that they are sums of.
RESTS = 32.0 * EPS

__all__ = ["Mode", "StabilityLimit", "StabilityLimits", "stability_limit"]


def stability_limit(system: System, method: str | Method, *, at: Any = None, t: float = 0.0, v: Any = None, y: Any = None) -> Any:
    """Find the largest step below which a method is stable for every mode of a system.

    Stable means that every eigenvalue of the transition matrix stays in or on the unit circle for all smaller steps. At the limit
    itself two eigenvalues may meet, as at Φ = 2 by False Euler, and the samples then grow linearly. A method whose samples grow
    at the smallest steps is never stable, even if larger steps damp (Fehlberg's); neither is a system whose exact solution grows.

    Limits of systems of one or two states are exact to some 1e-15, whatever the units. So are those of systems that decompose
    into such parts: filters in series, chains, and any linear system by a method that treats both blocks alike (Runge-Kutta). For
    others the accuracy depends on the condition of the mode that becomes unstable, some 1e-9 of the step at worst. Multiple or
    nearly multiple eigenvalues are computed in as many digits as needed. The result holds for the matrix exactly as it is: where
    n eigenvalues meet, a relative change ε of the matrix moves them by about the n-th root of ε. With more than 32 states that
    cannot be decomposed, or about a state that moves by nonlinear equations, the limit may stay undecided; see ``decided``.
    Damping of less than a millionth of critical damping counts as none. Where a method grows in a window of steps and is stable
    beyond it, the window is found for two states, however narrow; for others, a window narrower than 2 % of the step may be
    missed, or 17 % where many digits are needed.

    Args:
        system: a linear system; parameters may be arrays. Its inputs do not matter: their contribution to the samples is bounded.
        method: its name, or what ``stepwell.method`` returns.
        at: a state (v, y) at which a nonlinear system is linearised. For ``Springs`` the result is the limit of small motions of
            the particles that are not fixed; ``safe_step`` bounds it for every state and any number of springs.
        t: the time of that state.
        v: the velocities of the state, in place of ``at``.
        y: the coordinates of the state, in place of ``at``.

    Returns:
        A ``StabilityLimit``, which is a float with a ``mode``; an array of them for a batch (``StabilityLimits``). It is NaN, and
        its ``decided`` False, where rounding hides the limit between ``stable`` and ``grows``, in units of time, and where
        derivatives of the rates are not finite.

    Raises:
        UnsupportedError: if the method cannot step the system, or a nonlinear system comes without a state.

    Warns:
        AccuracyWarning: if a limit is not decided.

    Example:
        >>> sw.stability_limit(sw.LinearSystem([[-1, 0, 0], [1, -1, 0], [0, 1, -1]]), "rk4")
        2.785293563405282
    """
    method = find_method(method)
    at = state_argument(at, v, y)
    system = a_system(system).for_state_shapes(*(at if isinstance(at, (tuple, list)) else ()))
    fits_together(system, method)
    one_state("stability_limit", method)
    system.not_in_a_loop("stability_limit")
    t = checks.number("t", t)
    if at is None and not system.linear:
        bound = ", or ask its safe_step for a bound" if isinstance(system, Springs) else ""
        raise UnsupportedError(f"at: {system!r} is not linear; give at=(v, y) for the limit of small disturbances there{bound}")
    v, y = (None, None) if at is None else state("at", system, at)
    limit = limit_of(system, method, v, y, t)
    if not np.all(limit.decided):
        _warn(system, method, limit)
    return limit


def limit_of(system: System, method: Method, v: Array | None = None, y: Array | None = None, t: float = 0.0) -> Any:
    """``stability_limit`` for checked arguments, without a warning where the limit is not decided."""
    if method.is_exact:
        # Its steps stay bounded where the motion does; so do those of this method at every step, and nowhere else.
        method = find_method("implicit_midpoint")
    members = system.batch if v is None or y is None else maps.together(system, np.asarray(1.0), v, y)
    if v is None or y is None or system.linear:
        _fit(sum(maps.size(system)), members)
    elif isinstance(system, Springs) and all(part.kind == "surfaces" for part in system.around):
        _fit(2 * len(_free_numbers(system)), members, sum(maps.size(system)) ** 2)
        return _with_modes(limit_of(_small_motions(system, v, y), method), partial(_lifted, system))
    else:
        _fit(sum(maps.size(system)), members)
        if (motions := _linear_part(system, method, v, y, t, members)) is not None:
            return _with_modes(limit_of(motions, method), partial(_shaped, system))
    limits, grows, modes = _of_all(system, method, v, y, t, members)
    spread: list[Any] = [np.array(np.broadcast_to(each, members)) for each in (limits, grows, modes)]
    limits, grows, modes = spread
    if v is not None and y is not None and isinstance(system, OwnSystem) and not (system.linear or system.around):
        unknown = ~np.isfinite(traced.of_rates(system, members, t, v, y)).all(axis=(0, 1))
        limits[unknown], grows[unknown], modes[unknown] = 0.0, np.inf, None
    if not limits.shape:
        return StabilityLimit(float(limits), modes[()], float(grows))
    return limits_of(limits, modes, grows)


#: The numbers in memory for the limit of a member, besides the shape of its mode.
NUMBERS_OF_A_LIMIT = 250

#: How many copies of the matrix of small motions are in memory before the search: as computed, cut or joined, and in the system.
COPIES_OF_A_MATRIX = 4


def _fit(n: int, members: Shape, of_matrix: int = 0) -> None:
    """Raise if the limits of systems of n states do not fit in memory, with a matrix of ``of_matrix`` numbers for each member."""
    beside = 8.0 * NUMBERS_OF_AN_ELEMENT * n * n * min(prod(members), members_at_once(n))
    numbers = NUMBERS_OF_A_LIMIT + 4 * n + COPIES_OF_A_MATRIX * of_matrix
    checks.fits("the limits", numbers, members, "ask for fewer, or of fewer states", beside=beside)


def _of_all(
    system: System, method: Method, v: Array | None, y: Array | None, t: float, members: Shape
) -> tuple[Array, Array, Any]:
    """The limits of all members, the smallest steps known to grow, and the modes; as many members at once as memory allows."""
    if system.linear or v is None or y is None:
        system, v, y, t, members = system.without_inputs(), None, None, 0.0, system.batch
    n, count = sum(maps.size(system)), prod(members)
    at_once = members_at_once(n)
    if count <= at_once:
        return _of_some(Search(system, method, v, y, t))
    limits, grows, modes = np.empty(count), np.empty(count), np.empty(count, dtype=object)
    every = Batch(system, method, v, y, members)
    for k in range(0, count, at_once):
        some = np.arange(k, min(k + at_once, count))
        own, own_v, own_y = every.of(some)
        limits[some], grows[some], modes[some] = _of_some(Search(own, method, own_v, own_y, t))
    return tuple(each.reshape(members) for each in (limits, grows, modes))  # type: ignore[return-value]


@np.errstate(invalid="ignore")  # a stage may be infinite at the limit, as of a power below zero
def _of_some(search: Search) -> tuple[Array, Array, Any]:
    """The limits, the smallest steps known to grow, and the modes of the members of a search."""
    if search.v is None and len(search.rates) > 2:
        return _by_parts(search)
    limits, grows = search.limits()
    return limits, grows, search.modes(grows)[0]


def _linear_part(system: System, method: Method, v: Array, y: Array, t: float, members: Shape) -> LinearSystem | None:
    """A linear system whose steps are those of small disturbances of a state of own equations, or None.

    There is one where the derivative of the rates is the same in all stages of a step: for equations that are linear except for
    what drives them, and at rest. The eigenvalues of its steps are known even where they meet.
    """
    if not isinstance(system, OwnSystem) or system.around:
        return None
    reading = traced.reading(system)
    if not reading.linear and reading.time:
        return None
    n, count = sum(maps.size(system)), prod(members)
    if count <= members_at_once(n):
        matrix, rates = traced.matrix(system, "rates", None, members, v, y, t)
        if not reading.linear and not _is_at_rest(system, matrix, rates, v, y):
            return None
        return LinearSystem(matrix, velocities=maps.size(system)[0])
    every = Batch(system, method, v, y, members)
    matrices: list[Array] = []
    for k in range(0, count, members_at_once(n)):
        some = np.arange(k, min(k + members_at_once(n), count))
        own, own_v, own_y = every.of(some)
        assert own_v is not None
        assert own_y is not None
        matrix, rates = traced.matrix(own, "rates", None, some.shape, own_v, own_y, t)
        if not reading.linear and not _is_at_rest(own, matrix, rates, own_v, own_y):
            return None
        if not matrices:
            _fit(n, members, n * n)
        matrices.append(matrix)
    return LinearSystem(np.concatenate(matrices, axis=-1).reshape(n, n, *members), velocities=maps.size(system)[0])


def _is_at_rest(system: System, matrix: Array, rates: Array, v: Array, y: Array) -> bool:
    """True if the rates of all members are no more than the rounding of their terms."""
    members = rates.shape[1:]
    blocks = (checks.spread(block, shape, members) for block, shape in ((v, system.v_shape), (y, system.y_shape)))
    numbers = np.concatenate([block.reshape(-1, *members) for block in blocks])
    rounding = RESTS * np.einsum("ij...,j...->i...", np.abs(matrix), np.abs(numbers))
    return bool((np.abs(rates) <= rounding).all())


def _with_modes(limit: Any, change: Callable[[Mode | None], Mode | None]) -> Any:
    if isinstance(limit, StabilityLimit):
        return StabilityLimit(limit.stable, change(limit.mode), limit.grows)
    modes = np.empty(limit.shape, dtype=object)
    for index in np.ndindex(limit.shape):
        modes[index] = change(limit.modes[index])
    return limits_of(limit.stable, modes, limit.grows)


def _shaped(system: System, mode: Mode | None) -> Mode | None:
    """A mode whose blocks have the shapes of those of the system."""
    return None if mode is None else mode._replace(v=mode.v.reshape(system.v_shape), y=mode.y.reshape(system.y_shape))


def _warn(system: System, method: Method, limit: Any) -> None:
    doubtful = np.atleast_1d(~np.asarray(limit.decided))
    stable, grows = (np.atleast_1d(each)[doubtful][0] for each in (limit.stable, limit.grows))
    one = isinstance(limit, StabilityLimit)
    which = "" if one else f" of {share(int(doubtful.sum()), limit.shape, limit.size)}"
    if stable == 0.0 and grows == np.inf and not system.linear:
        warnings.warn(
            f"the limit{which} of {system!r} by {method.name} is NaN, because some derivatives of the rates at this state are "
            f"not finite, as that of a root at zero is not (sw.jacobian shows which); ask for a state beside it",
            AccuracyWarning,
            stacklevel=3,
        )
        return
    hint = (
        f"systems of more than {exact.MAX_ROWS} states that cannot be decomposed are not computed in more digits"
        if system.linear
        else "if it is linear, or at rest there, give it as LinearSystem(sw.jacobian(…).matrix, velocities=…)"
    )
    warnings.warn(
        f"the limit{which} of {system!r} by {method.name} is NaN: it is between dt = {stable:.6g} and {grows:.6g}, where "
        f"rounding hides what grows, for eigenvalues nearly meet; {hint}",
        AccuracyWarning,
        stacklevel=3,
    )


def _free_numbers(springs: Springs) -> Any:
    """The numbers of a block that belong to particles that are not fixed.

    A fixed particle keeps any velocity, and a net without one drifts. ``parts`` finds such motions of a linear system exactly and
    removes them; in the eigenvalues of a whole step their rounding would hide the limit.
    """
    numbers = np.arange(springs.n * springs.y_shape[1]).reshape(springs.y_shape)
    return np.delete(numbers, springs.fixed, axis=0).reshape(-1)


def _small_motions(springs: Springs, v: Array, y: Array) -> LinearSystem:
    """The linear system of small disturbances of a state, velocities first, with the batch of the state."""
    free = _free_numbers(springs)
    free_states = np.concatenate([free, springs.n * springs.y_shape[1] + free])
    return LinearSystem(maps.rates(springs, 0.0, v, y)[np.ix_(free_states, free_states)], velocities=len(free))


def _lifted(springs: Springs, mode: Mode | None) -> Mode | None:
    """A mode of the small motions as a mode of the whole net."""
    if mode is None:
        return None
    blocks = [np.zeros(springs.y_shape, dtype=np.complex128) for _ in range(2)]
    for block, shape in zip(blocks, (mode.v, mode.y), strict=True):
        block.reshape(-1)[_free_numbers(springs)] = shape
    return mode._replace(v=blocks[0], y=blocks[1])


def _by_parts(search: Search) -> tuple[Array, Array, Any]:
    """The limits of a linear system, the smallest steps known to grow, and the modes: those of the part that grows first."""
    n_v = maps.size(search.system)[0]
    alike: dict[tuple[int, int], list[tuple[Shape, Array]]] = {}
    for index in np.ndindex(search.members):
        for matrix, velocities in parts(checks.member(search.rates, index), n_v, search.method):
            alike.setdefault((len(matrix), velocities), []).append((index, matrix))
    limits, grows = np.full(search.members, np.inf), np.full(search.members, np.inf)
    modes, past = np.empty(search.members, dtype=object), np.ones(search.members, dtype=np.complex128)
    best: dict[Shape, Any] = {}
    for (_, velocities), each in alike.items():
        stacked = np.stack([matrix for _, matrix in each], axis=-1)
        part = Search(LinearSystem(stacked, velocities=velocities), search.method, None, None, 0.0)
        stable, above = part.limits()
        own, leaving = part.modes(above)
        for k, (index, _) in enumerate(each):
            # Among parts that are never stable, one whose exact solution grows comes first, else the fastest.
            rank = (above[k], not part.grows_by_itself[k], -part.fastest[k])
            if own[k] is not None and (index not in best or rank < best[index]):
                best[index], modes[index], past[index] = rank, own[k], leaving[k]
            limits[index], grows[index] = min(limits[index], stable[k]), min(grows[index], above[k])
    search.lift(modes, grows, past)
    return limits, grows, modes
