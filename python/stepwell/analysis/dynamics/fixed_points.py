"""``equilibria``: the states at which a system rests, and their stability."""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.reprs import MAX_LINE, brief, shortened, table
from ...errors import ArgumentError, ShapeError
from ...model.compatibility import fits_together
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import System
from ...model.systems.base import a_system
from ..stability import eigen, exact, maps, parts
from ..stability.analysis import Analysis, analyse, state
from ..stability.eigen import EPS, Complex
from .at_state import by_growth, linearised, rates_at
from .sums import Sums, constant_sums

#: The most Newton steps from one start, and the most halvings of a step.
MAX_ITERATIONS, MAX_HALVINGS = 100, 30
#: A start is lost whose rates have not fallen to this share after so many steps: at a p-fold root they fall to (1 − 1/p)^p each.
SLOWER, LOOK = 0.95, 20
#: The shares of a step that are tried, at once where their number is small beside the first.
SHARES = np.split(0.5 ** np.arange(MAX_HALVINGS), (1, 4, 12))

#: Steps of backward Euler are accepted if a second pass of Newton's method changes less than the share ``CLOSE`` of both; then
#: they grow by the factor ``LONGER``, else they shrink so.
CLOSE, LONGER = 0.25, 4.0

#: A start has converged when a whole Newton step changes the state by less than this fraction of its size.
ARRIVED = 1e-12

#: A start whose Newton step is between ``ARRIVED`` and this fraction has converged too if no fraction of the step makes the rates
#: smaller: only rounding is left.
NEARLY_ARRIVED = 1e-7

#: A rate counts as zero below this fraction of its terms: it is their rounding.
RATES_ARE_ZERO = 64.0 * EPS

#: Two equilibria closer than this fraction of their size are one: far more than rounding, far less than users distinguish.
SAME = 1e-8

#: A singular value of the Jacobian below this fraction of the largest counts as zero: the equilibrium is part of a line or
#: surface of equilibria, or a double root.
SINGULAR = 1e-10

#: The place of a root is uncertain by ``MULTIPLE`` times the remaining Newton step, which at a p-fold root is the p-th part of
#: the distance. Rounding makes the rates there uncertain as well: by their deviation from a straight line over the fractions
#: ``BESIDE`` of the place. The uncertainty is at most the fraction ``LEAST_CERTAIN`` of the size: rounding of ε moves a p-fold
#: root by ε^(1/p), 7·10⁻⁴ for p = 5.
MULTIPLE, BESIDE, LEAST_CERTAIN = 16.0, 2.0**-33 * np.array([-7.0, -5.0, -3.0, -1.0, 1.0, 3.0, 5.0, 7.0]), 2.0**-10
#: A singular value below this fraction of the largest is rounding: the place along its direction is unknown, as on a line of
#: equilibria.
ROUNDING = 16.0 * EPS

#: A real part counts as zero below the fraction ``ZERO_RATE`` of the fastest rate, plus the rounding error; and if the eigenvalue
#: changes by half of it within ``SAME`` of the place, or over ``LEFT`` further Newton steps. Newton's method reaches a multiple
#: root only to a root of the rounding, or stops at a part of the distance, and there the eigenvalue is as large as that distance,
#: with either sign. At a p-fold root two further steps multiply the eigenvalue by (1 − 2/p)^(p − 1) ≤ 0.14.
ZERO_RATE, LEFT = 1e-9, 2.0


#: The kind where the eigenvalues do not decide the motion nearby.
UNDECIDED = "undecided to first order"


class Equilibrium(ValueEquality):
    """A state at which both rates are zero.

    Attributes:
        v: its velocities, shape (*block).
        y: its coordinates, likewise.
        residual: the largest rate there, which is rounding.
        eigenvalues: λ of the Jacobian there, shape (n,), the largest real part first: small disturbances grow as e^(λt). One for
            each constant sum is 0.
        kind: the motion nearby with the same sums, by the other eigenvalues: "sink" (all disturbances decay), "source" (all
            grow), "saddle" (some grow, some do not), "centre" (all rotate, and to first order neither grow nor decay), or
            "undecided to first order" (an eigenvalue is zero, as far as the place is known, or some rotate while others decay:
            higher orders decide).
        isolated: whether some neighbourhood has no other equilibrium with the same sums; False where the Jacobian is singular,
            so that first order does not decide.
        analysis: the result of ``analyse`` for a step of the method there; None if no method was given.
        starts: numbers of the starts from which it was reached.
    """

    def __init__(
        self,
        v: Array,
        y: Array,
        residual: float,
        eigenvalues: Complex,
        kind: str,
        isolated: bool,
        analysis: Analysis | None,
        starts: tuple[int, ...],
    ) -> None:
        self.v, self.y = v, y
        self.residual = residual
        self.eigenvalues = eigenvalues
        self.kind = kind
        self.isolated = isolated
        self.analysis = analysis
        self.starts = starts

    @property
    def stable(self) -> bool | None:
        """True if small disturbances decay; None where first order does not decide it."""
        return {"sink": True, "source": False, "saddle": False}.get(self.kind)

    def __repr__(self) -> str:
        step = "" if self.analysis is None else f", step: {self.analysis.kind}"
        return f"<equilibrium at v = {brief(self.v)}, y = {brief(self.y)}: {self.kind}{step}>"


class Equilibria(ValueEquality):
    """Equilibria that were found, in the order of the starts; a sequence of ``Equilibrium``.

    Attributes:
        system: the system.
        found: each equilibrium once.
        lost: numbers of the starts from which none was reached.
        sums: weights of the linear sums that every motion keeps, such as all of an enzyme, free and bound; shape (sums, n).
    """

    def __init__(self, system: System, found: tuple[Equilibrium, ...], lost: tuple[int, ...], sums: Array) -> None:
        self.system = system
        self.found = found
        self.lost = lost
        self.sums = sums

    def __len__(self) -> int:
        return len(self.found)

    def __getitem__(self, k: int) -> Equilibrium:
        return self.found[k]

    def __iter__(self) -> Iterator[Equilibrium]:
        return iter(self.found)

    def __repr__(self) -> str:
        kinds = ", ".join(each.kind for each in self.found)
        lost = f"; {len(self.lost)} start{'s' * (len(self.lost) != 1)} led nowhere" if self.lost else ""
        what = "equilibrium" if len(self.found) == 1 else "equilibria"
        return shortened(f"<{len(self.found)} {what} of {self.system!r}{': ' * bool(kinds)}{kinds}{lost}>", MAX_LINE)

    def __str__(self) -> str:
        return "\n  ".join([repr(self), *map(repr, self.found)])

    def _repr_html_(self) -> str:
        rows = [
            (brief(each.v), brief(each.y), each.kind, "" if each.analysis is None else each.analysis.kind) for each in self.found
        ]
        return table(repr(self)[1:-1], ("v", "y", "kind", "step"), rows)


def equilibria(
    system: System, *, near: Any, t: float = 0.0, method: str | Method | None = None, dt: float | None = None
) -> Equilibria:
    """Find the equilibria that Newton's method reaches from given states, each once, with their stability.

    The Jacobian is exact, and a step that would make the rates larger is halved until it does not. Where the Jacobian is
    singular, the shortest step is taken. Linear sums that every motion keeps have the values of the start. Rates that vanish
    only at infinity (bodies that separate for ever) are no equilibrium.

    Args:
        system: of one member.
        near: states (v, y) to start from, shapes (*block, *starts); v is None for a system without velocities.
        t: the time; inputs keep their values at that time.
        method: a method to analyse at each equilibrium, or None.
        dt: its step, in units of time.

    Returns:
        ``Equilibria``: a sequence. It lacks equilibria that no start reaches, and their number is unknown.

    Raises:
        UnsupportedError: if the rates depend on the state through an operation that has no derivative, or the method cannot step
            the system.

    Example:
        >>> [each.kind for each in sw.equilibria(sw.Pendulum(), near=(0.0, [0.3, 3.0]))]
        ['centre', 'saddle']
    """
    system = a_system(system).for_state_shapes(*(near if isinstance(near, (tuple, list)) else ()))
    system.not_in_a_loop("equilibria")
    if system.batch:
        raise ShapeError(f"system: expected one member to find the equilibria of, got a batch of shape {system.batch}")
    v, y = state("near", system, near)
    t = checks.number("t", t, unit="units of time")
    if (method is None) != (dt is None):
        raise ArgumentError("method, dt: expected both or neither, got " + ("dt" if method is None else "method") + " alone")
    method = None if method is None else find_method(method)
    step = None if dt is None else checks.number("dt", dt, positive=True, unit="units of time")
    if method is not None:
        fits_together(system, method)
    starts = _starts(system, v, y)
    n = sum(maps.size(system))
    checks.fits("the Jacobians", 8 * n * n, starts.shape[1:], "give fewer starts")
    sums = constant_sums(system, starts, t)
    states, arrived = _newton(system, sums, starts, t)
    if not arrived.all():
        lost = ~arrived
        states[:, lost], arrived[lost] = _newton(system, sums, _later(system, sums, starts[:, lost], t), t)
    distinct = _distinct(system, sums, states, starts, np.flatnonzero(arrived), t)
    each = tuple(_equilibrium(system, sums, at, uncertain, t, method, step, own) for at, uncertain, own in distinct)
    return Equilibria(system, each, tuple(np.flatnonzero(~arrived).tolist()), sums.weights)


def _distinct(
    system: System, sums: Sums, states: Array, starts: Array, arrived: Any, t: float
) -> list[tuple[Array, Array, tuple[int, ...]]]:
    """Each equilibrium once: its place, the uncertainty of the place, and the starts that reached it."""
    sizes, begun = _size(system, states), _size(system, starts)
    alike: list[list[int]] = []
    for k in arrived.tolist():
        for own in alike:
            # The size of a coordinate that is 0 up to rounding is that of the coordinates at the start.
            size = np.maximum(np.maximum(sizes[:, k], sizes[:, own[0]]), np.minimum(begun[:, k], begun[:, own[0]]))
            if (np.abs(states[:, k] - states[:, own[0]]) <= SAME * size)[sums.first :].all():
                own.append(k)
                break
        else:
            alike.append([k])
    firsts = [own[0] for own in alike]
    uncertain, residuals = _uncertain(system, sums, states[:, firsts], np.maximum(sizes, begun)[:, firsts], t)
    distinct: list[tuple[int, list[int]]] = []
    for i, own in enumerate(alike):
        for place, (j, others) in enumerate(distinct):
            apart = np.abs(states[:, firsts[i]] - states[:, firsts[j]])
            if (apart <= uncertain[:, i] + uncertain[:, j])[sums.first :].all():
                distinct[place] = i if residuals[i] < residuals[j] else j, sorted(others + own)
                break
        else:
            distinct.append((i, own))
    return [(states[:, firsts[i]], uncertain[:, i], tuple(own)) for i, own in distinct]


def _uncertain(system: System, sums: Sums, states: Array, sizes: Array, t: float) -> tuple[Array, Array]:
    """The uncertainty of each number of the places of equilibria, and the largest rate at each place."""
    if not states.size:
        return np.zeros(states.shape), np.zeros(states.shape[1])
    matrix, rates = linearised(system, *maps.blocks(system, states), t)
    left = np.abs(_solved(sums, matrix, rates, ROUNDING))
    for share in BESIDE:
        change = share * states
        near = linearised(system, *maps.blocks(system, states + change), t)[1]
        bent = near - np.einsum("ijk,jk->ik", matrix, change)
        left = np.maximum(left, np.abs(_solved(sums, matrix, np.where(np.isfinite(bent), bent, rates), ROUNDING)))
    return np.minimum(MULTIPLE * left, LEAST_CERTAIN * sizes), np.abs(rates).max(axis=0)


def _starts(system: System, v: Array, y: Array) -> Array:
    """The starts as columns, shape (n, starts)."""
    batch = checks.batch_shape({"near, v": v.shape[len(system.v_shape) :], "near, y": y.shape[len(system.y_shape) :]})

    def wide(block: Array, shape: tuple[int, ...]) -> Array:
        own = block.shape[len(shape) :]
        aligned = block.reshape((*shape, *(1,) * (len(batch) - len(own)), *own))
        return np.broadcast_to(aligned, (*shape, *batch)).reshape(prod(shape), prod(batch))

    return np.concatenate([wide(v, system.v_shape), wide(y, system.y_shape)])


def _size(system: System, states: Array) -> Array:
    """For each number of the states the largest magnitude in its block, shape (n, starts): each block has its own units."""
    n_v = maps.size(system)[0]
    size = np.abs(states)
    for rows in (slice(0, n_v), slice(n_v, None)):
        if size[rows].size:
            size[rows] = size[rows].max(axis=0)
    return size


def _newton(system: System, sums: Sums, states: Array, t: float) -> tuple[Array, Any]:
    """The states that Newton's method reaches from each column, and whether it converged."""
    states = states.copy()
    arrived = np.zeros(states.shape[1], dtype=np.bool_)
    alive = np.ones(states.shape[1], dtype=np.bool_)
    least = _size(system, states)
    least = np.where(least > 0.0, least, 1.0)
    # For each rate, the largest sum so far of the magnitudes of its derivatives times the state: its terms are about that large.
    terms = np.zeros_like(states)
    before = np.full(states.shape[1], np.inf)
    for iteration in range(MAX_ITERATIONS):
        which = np.flatnonzero(alive)
        if not which.size:
            break
        at = states[:, which]
        matrix, rates = linearised(system, *maps.blocks(system, at), t)
        usable = np.isfinite(matrix).all(axis=(0, 1)) & np.isfinite(rates).all(axis=0)
        alive[which[~usable]] = False
        which, at, matrix, rates = which[usable], at[:, usable], matrix[:, :, usable], rates[:, usable]
        if not which.size:
            break
        if iteration % LOOK == 0:
            largest = np.abs(rates).max(axis=0)
            moving, before[which] = largest < SLOWER * before[which], largest
            alive[which[~moving]] = False
        change = -_solved(sums, matrix, rates)
        terms[:, which] = np.maximum(
            terms[:, which], np.einsum("ijk,jk->ik", np.abs(matrix), np.maximum(_size(system, at), least[:, which]))
        )
        # Where the Jacobian is singular, a step of zero may leave the rates as they are: an extreme of a rate is no zero.
        remainder = np.abs(np.einsum("ijk,jk->ik", matrix, change) + rates)
        vanishes = (remainder <= RATES_ARE_ZERO * terms[:, which]).all(axis=0)
        relative = (np.abs(change) / np.maximum(_size(system, at), least[:, which])).max(axis=0)
        there = vanishes & (relative <= ARRIVED)
        best, better = _damped(system, at, change, rates, t)
        stuck = vanishes & ~better & (relative <= NEARLY_ARRIVED)
        states[:, which] = np.where(better, best, at)
        arrived[which] = there | stuck
        alive[which] &= better & ~there
    return states, arrived


def _later(system: System, sums: Sums, states: Array, t: float) -> Array:
    """States to which motions from these lead after long times, by steps of backward Euler that grow as the motion permits.

    Newton's method alone is lost where rates are far from linear, as from mixtures that have not begun to react.
    """
    states = states.copy()
    matrix, rates = linearised(system, *maps.blocks(system, states), t)
    with np.errstate(all="ignore"):
        h = np.nan_to_num(1.0 / np.abs(matrix).sum(axis=1).max(axis=0), nan=1.0, posinf=1.0)
        for _ in range(MAX_ITERATIONS):
            stepped = sums.reduced(matrix) - np.eye(len(sums.free))[:, :, np.newaxis] / h
            which = np.flatnonzero(np.isfinite(stepped).all(axis=(0, 1)) & np.isfinite(rates).all(axis=0))
            if not which.size:
                break
            change = np.zeros(states.shape)
            change[:, which] = _of_reduced(sums, -stepped[:, :, which], rates[:, which])
            left = np.array(change)
            after = rates_at(system, *maps.blocks(system, states + change), t) - change / h
            left[:, which] = _of_reduced(sums, -stepped[:, :, which], after[:, which])
            change += left
            new_matrix, new_rates = linearised(system, *maps.blocks(system, states + change), t)
            good = np.abs(left).max(axis=0) <= CLOSE * np.abs(change).max(axis=0)
            if (good & (np.abs(change) <= SAME * _size(system, states)).all(axis=0)).all():
                break
            states, rates = np.where(good, states + change, states), np.where(good, new_rates, rates)
            matrix, h = np.where(good, new_matrix, matrix), h * np.where(good, LONGER, 1.0 / LONGER)
    return states


def _solved(sums: Sums, matrix: Array, rates: Array, zero: float = SINGULAR) -> Array:
    """The least-squares solution x of matrix·x = rates that keeps all sums, the shortest of several, for each column.

    A singular value below the fraction ``zero`` of the largest counts as zero.
    """
    return _of_reduced(sums, sums.reduced(matrix), rates, zero)


def _of_reduced(sums: Sums, matrix: Array, rates: Array, zero: float = SINGULAR) -> Array:
    """The least-squares solution for the matrix of the numbers that no sum determines."""
    rates = rates[sums.free]
    of_rows, of_columns = _units(matrix)
    stacked, right = np.moveaxis(matrix / of_rows[:, np.newaxis] / of_columns, 2, 0), (rates / of_rows).T[:, :, np.newaxis]
    singular = np.linalg.svd(stacked, compute_uv=False)
    regular = singular[:, -1] > zero * singular[:, 0]
    solution = np.empty(right.shape)
    solution[regular] = np.linalg.solve(stacked[regular], right[regular])
    solution[~regular] = np.linalg.pinv(stacked[~regular], rcond=zero) @ right[~regular]
    return sums.whole(solution[:, :, 0].T / of_columns)


def _units(matrix: Array) -> tuple[Array, Array]:
    """Divisors of the rows, and then of the columns, that make the largest element of each 1, so that units do not matter.

    Weak forces at a large distance are small numbers beside the 1 of ẏ = v, but they are not zero.
    """
    of_rows = np.abs(matrix).max(axis=1)
    of_rows = np.where(of_rows > 0.0, of_rows, 1.0)
    of_columns = np.abs(matrix / of_rows[:, np.newaxis]).max(axis=0)
    return of_rows, np.where(of_columns > 0.0, of_columns, 1.0)


def _damped(system: System, at: Array, change: Array, rates: Array, t: float) -> tuple[Array, Any]:
    """The states after the largest of the step, its half, its quarter, … that makes the rates smaller; and whether any does."""
    before = np.abs(rates).max(axis=0)
    best, better = at.copy(), np.zeros(at.shape[1], dtype=np.bool_)
    for shares in SHARES:
        left = np.flatnonzero(~better)
        if not left.size:
            break
        tried = at[:, left, np.newaxis] + change[:, left, np.newaxis] * shares
        after = np.abs(rates_at(system, *maps.blocks(system, tried), t)).max(axis=0)
        good = after < before[left, np.newaxis] * (1.0 - 1e-4 * shares)
        some, first = good.any(axis=1), good.argmax(axis=1)
        best[:, left[some]], better[left[some]] = tried[:, some, first[some]], True
    return best, better


def _equilibrium(
    system: System,
    sums: Sums,
    at: Array,
    uncertain: Array,
    t: float,
    method: Method | None,
    dt: float | None,
    starts: tuple[int, ...],
) -> Equilibrium:
    v, y = maps.blocks(system, at)
    matrix, rates = linearised(system, v, y, t)
    analysis = None
    if method is not None:
        linear = system.linear  # of such a system the step is the same at every state
        with np.errstate(all="ignore"):  # a step of any length may be asked for
            analysis = analyse(system, method, dt=dt, at=None if linear else (v, y), t=t)
    sums = sums.at(matrix)
    left = -LEFT * _solved(sums, matrix[:, :, np.newaxis], rates[:, np.newaxis])[:, 0]
    matrix = sums.reduced(matrix)
    of_rows, of_columns = _units(matrix)
    _, singular, across = np.linalg.svd(matrix / of_rows[:, np.newaxis] / of_columns)
    exactly, least = _known(system, sums, at, uncertain, matrix, left, sums.whole(across[-1] / of_columns), t)
    isolated = bool(singular[-1] > SINGULAR * singular[0]) and bool((np.abs(exactly) > least).all())
    values = by_growth(matrix, zeros=len(sums.kept))
    return Equilibrium(v, y, float(np.abs(rates).max()), values, _kind(exactly, least), isolated, analysis, starts)


def _known(
    system: System, sums: Sums, at: Array, uncertain: Array, matrix: Array, left: Array, weakest: Array, t: float
) -> tuple[Complex, Array]:
    """Eigenvalues, and the magnitude below which each may be zero, since the place of the equilibrium is uncertain.

    ``left`` is what further Newton steps may change, ``weakest`` the direction that changes the rates least.
    """
    size = np.maximum(SAME * _size(system, at[:, np.newaxis])[:, 0], uncertain)
    along = weakest / np.abs(weakest).max() * np.min(size, where=size > 0.0, initial=np.inf) if size.any() else size
    places = np.stack([at + size, at - size, at + along, at - along, at + left], axis=1)
    beside = sums.reduced(linearised(system, *maps.blocks(system, places), t)[0])
    beside = np.where(np.isfinite(beside), beside, matrix[:, :, np.newaxis])
    own, others = eigen.eigenvalues(matrix), eigen.eigenvalues(beside)
    moved = np.abs(own[:, np.newaxis, np.newaxis] - others[np.newaxis]).min(axis=1).max(axis=1)
    # Where all are zero, as for a free mass, the computed values are rounding of the elements, in many digits.
    least = np.maximum(2.0 * moved, np.maximum(ZERO_RATE * np.abs(own).max(), EPS * EPS * np.abs(matrix).max()))
    rounding = eigen.eigen(matrix).tolerance(0.0) if len(matrix) > 2 else np.full(len(matrix), np.inf)
    if (np.abs(own.real) > least + rounding).all():
        return own, least  # more digits would decide the same
    if len(matrix) > exact.MAX_ROWS:
        return own, np.maximum(least, np.minimum(rounding.max(), eigen.REFINE_ABOVE * np.abs(own).max()))
    exactly = parts.rates(matrix).values  # in as many digits as needed where they nearly coincide
    return exactly, least[np.abs(exactly[:, np.newaxis] - own).argmin(axis=1)]


def _kind(values: Complex, least: Array) -> str:
    if (np.abs(values) <= least).any():
        return UNDECIDED
    grows, dies = values.real > least, values.real < -least
    if grows.any():
        return "source" if grows.all() else "saddle"
    return "sink" if dies.all() else UNDECIDED if dies.any() else "centre"
