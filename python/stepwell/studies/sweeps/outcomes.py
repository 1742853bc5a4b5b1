"""The outcomes of a member: its last state, extremes, means, the history at intervals, or the result of a function.

Reductions see the states of a run piece by piece and store a few numbers for each member. They do not depend on where pieces end.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from math import prod
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...errors import ArgumentError, ShapeError
from ...model.systems import System
from ...runs.result import Run
from .observed import Observed, Of, Piece, Rows, block_dims, checked, dtype_of, name_of, possible, shape_of


class Variable(NamedTuple):
    """A result of the members of a chunk, shape (*own axes, members), with names and coordinates of its own axes.

    ``unit`` is the quantity whose unit it has, "v", "y" or "t"; None for others.
    """

    dims: tuple[str, ...]
    values: Array
    about: str
    unit: str | None = None
    coords: Mapping[str, Array] = {}


Results = dict[str, Variable]


def together(parts: Iterable[Results]) -> Results:
    """The results of several outcomes in one dictionary."""
    results: Results = {}
    for part in parts:
        if twice := sorted(set(results) & set(part)):
            raise ArgumentError(f"outcomes: there are two results {twice[0]!r}; give one another name by name=, or leave it out")
        results |= part
    return results


class Reduction(ABC):
    """Reduces the pieces of a run, in their order, to a few numbers of each member."""

    def __init__(self, outcome: Any) -> None:
        self.outcome = outcome

    @abstractmethod
    def see(self, piece: Piece) -> None:
        """Take the new states of a piece into account."""

    def take(self, observed: Observed) -> None:
        """Take what a device has made of all states, in place of pieces; it did if the outcome has an ``on_device``."""
        self.see(Piece(observed.run, 0))

    @abstractmethod
    def results(self) -> Results:
        """The results, by name."""


class Outcome(ValueEquality):
    """A result for each member, for ``outcomes`` of ``stepwell.sweep``.

    Attributes:
        observes: whether it needs the states in between, and not only the last one.
        numbers: about how many numbers it stores for each member, besides those of a state.
    """

    observes: ClassVar[bool] = True
    numbers: int = 4

    def check(self, system: System) -> None:
        """Raise if it cannot be computed for a system, before any work."""


class ReducedOutcome(Outcome, ABC):
    """An outcome that a reduction computes piece by piece, so that the run is never in memory as a whole."""

    reduction: ClassVar[type[Reduction]]

    def begin(self) -> Reduction:
        """A new reduction."""
        return self.reduction(self)

    def on_device(self, rows: Rows) -> Any:
        """The device's form of the reduction, of ``device.reductions``; None if it needs the states here."""
        return None


class _AtEnd(Reduction):
    def see(self, piece: Piece) -> None:
        self.run = piece.run

    def results(self) -> Results:
        return self.outcome.of_end(self.run)  # type: ignore[no-any-return]


class OfEnd(ReducedOutcome):
    """An outcome of the end of a run alone."""

    observes = False
    reduction = _AtEnd

    @abstractmethod
    def of_end(self, run: Run) -> Results:
        """The results of a run, of which the last state is there."""


def _blocks(system: System) -> tuple[str, ...]:
    return ("y",) if system.v_shape == (0,) else ("v", "y")


def _dims(run: Run, what: Of, values: Array) -> tuple[str, ...]:
    """Names of the own axes of values of shape (*own, members)."""
    if what in ("v", "y"):
        return block_dims(run.system, str(what))
    return tuple(f"{name_of(what)}_{i}" for i in range(values.ndim - 1))


def _unit(what: Of) -> str | None:
    block = what[0] if isinstance(what, tuple) else what
    return block if isinstance(block, str) else None


class Last(OfEnd):
    """The state at the end: ``v_last`` and ``y_last``.

    Example:
        >>> axes = {"omega": ("omega", [1.0, 2.0])}
        >>> found = sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, dt=0.01, steps=100, outcomes=sw.sweeps.Last())
        >>> found.y_last.values.round(6)
        array([ 0.540302, -0.416147])
    """

    def of_end(self, run: Run) -> Results:
        """The last blocks."""
        return {
            f"{block}_last": Variable(
                block_dims(run.system, block), np.array(getattr(run, block)[-1]), f"{block} at the end", block
            )
            for block in _blocks(run.system)
        }


class _Several(ReducedOutcome):
    """An outcome of v and of y, or of the quantity ``of``."""

    def __init__(self, of: Any = None, *, name: str | None = None) -> None:
        self.of = None if of is None else checked(of)
        self.name = called(name, self.of)

    def check(self, system: System) -> None:
        if self.of is not None:
            possible(self.of, system)

    def whats(self, system: System) -> list[Of]:
        return [*_blocks(system)] if self.of is None else [self.of]

    def rows(self, rows: Rows) -> tuple[int, ...] | None:
        """Their rows on a device, or None if it does not have all of them."""
        of_each = [rows.of(what) for what in self.whats(rows.system)]
        return None if None in of_each else tuple(row for each in of_each if each is not None for row in each)

    def split(self, observed: Observed, first: int) -> list[Array]:
        """Results of a device, from the ``first`` on, as one array for each quantity."""
        arrays, system = [], observed.run.system
        for what in self.whats(system):
            shape = shape_of(what, system)
            arrays.append(observed.numbers[first : first + prod(shape)].reshape(*shape, observed.numbers.shape[1]))
            first += prod(shape)
        return arrays


class _Extremes(Reduction):
    def __init__(self, outcome: Extremes) -> None:
        super().__init__(outcome)
        self.least: list[Array] = []
        self.largest: list[Array] = []

    def see(self, piece: Piece) -> None:
        self.run = piece.run
        if len(piece.t) == 0:
            return
        all_of = [piece.of(what) for what in self.outcome.whats(piece.run.system)]
        least, largest = [each.min(axis=0) for each in all_of], [each.max(axis=0) for each in all_of]
        if self.least:
            least = list(map(np.minimum, least, self.least))
            largest = list(map(np.maximum, largest, self.largest))
        self.least, self.largest = least, largest

    def take(self, observed: Observed) -> None:
        self.run = observed.run
        each, whats = len(observed.numbers) // 2, self.outcome.whats(observed.run.system)
        for all_of, first in ((self.least, 0), (self.largest, each)):
            of_each = zip(whats, self.outcome.split(observed, first), strict=True)
            all_of += [numbers.astype(dtype_of(what, observed.run)) for what, numbers in of_each]

    def results(self) -> Results:
        results = {}
        for what, least, largest in zip(self.outcome.whats(self.run.system), self.least, self.largest, strict=True):
            name, dims = self.outcome.name or name_of(what), _dims(self.run, what, least)
            # Which of −0 and +0 is the least depends on the order of comparisons; adding +0 makes both +0.
            results[f"{name}_min"] = Variable(dims, least + 0.0, f"least {name} of the observed states", _unit(what))
            results[f"{name}_max"] = Variable(dims, largest + 0.0, f"largest {name} of the observed states", _unit(what))
        return results


class Extremes(_Several):
    """The least and the largest value among the observed states, ``y_min`` and ``y_max``; NaN if a state was NaN.

    Between observed states the motion may go beyond: at a smooth extreme by (interval)²·|ÿ|/8 at most.

    Args:
        of: as for ``Crossing``; both blocks if None.
        name: the name of the results, in place of that of the quantity.

    Example:
        >>> outcome = sw.sweeps.Extremes("energy")
        >>> found = sw.sweep(sw.Oscillator, {"omega": [1.0, 2.0]}, "rk4", v=0.0, y=1.0, dt=0.1, steps=100, outcomes=outcome)
        >>> sorted(found.data_vars)
        ['energy_max', 'energy_min', 'first_bad_step', 'status']
    """

    reduction = _Extremes

    def on_device(self, rows: Rows) -> Any:
        """The device's form of the reduction."""
        from ...device.reductions import Extremes as OnDevice

        of = self.rows(rows)
        return None if of is None else OnDevice(of)


class _Mean(Reduction):
    def __init__(self, outcome: Mean) -> None:
        super().__init__(outcome)
        self.sums: list[Array] = []
        self.before: list[Array] = []
        self.begin = self.t = np.nan

    def see(self, piece: Piece) -> None:
        self.run = piece.run
        all_of = [piece.of(what) for what in self.outcome.whats(piece.run.system)]
        first = 0 if self.before else 1
        if first:
            now = [np.asarray(each[0], np.float64) for each in all_of]
            self.sums, self.before, self.begin = [np.zeros(each.shape) for each in now], now, float(piece.t[0])
            self.t = self.begin
        # Several states at once, since a chunk of few members has many of them.
        at_once = max(1, NUMBERS_AT_ONCE // max(1, *(each[:1].size for each in all_of)))
        for k in range(first, len(piece.t), at_once):
            self._add(piece.t[k : k + at_once], [each[k : k + at_once] for each in all_of])

    def _add(self, t: Array, all_of: list[Array]) -> None:
        half = 0.5 * np.diff(t, prepend=self.t)
        for i, states in enumerate(all_of):
            now = np.concatenate([self.before[i][np.newaxis], states], dtype=np.float64)
            terms = half.reshape(-1, *(1,) * (now.ndim - 1)) * (now[:-1] + now[1:])
            # State after state, so that the order of the sum does not depend on the piece.
            self.sums[i] = np.add.accumulate(np.concatenate([self.sums[i][np.newaxis], terms]), axis=0)[-1].copy()
            self.before[i] = now[-1].copy()
        self.t = float(t[-1])

    def take(self, observed: Observed) -> None:
        self.run, self.begin, self.t = observed.run, float(observed.begin), float(observed.end)
        self.sums = self.outcome.split(observed, 0)

    def results(self) -> Results:
        time, results = self.t - self.begin, {}
        for what, total in zip(self.outcome.whats(self.run.system), self.sums, strict=True):
            name = self.outcome.name or name_of(what)
            results[f"{name}_mean"] = Variable(
                _dims(self.run, what, total), total / time, f"mean {name} over the time", _unit(what)
            )
        return results


class Mean(_Several):
    """The mean over the observed time, ``y_mean``, by the trapezoidal rule over the observed states.

    Its error is at most (interval)²/12 times the largest second derivative of a smooth motion.

    Args:
        of: as for ``Crossing``; both blocks if None.
        name: the name of the results, in place of that of the quantity.

    Example:
        >>> square = sw.sweeps.Mean(lambda t, v, y: y * y, name="square")
        >>> axes = {"y": ("y0", [1.0, 2.0])}
        >>> found = sw.sweep(sw.Oscillator(), axes, "rk4", v=0.0, dt=np.pi / 100, steps=200, outcomes=square)
        >>> found.square_mean.values.round(6)
        array([0.5, 2. ])
    """

    reduction = _Mean

    def on_device(self, rows: Rows) -> Any:
        """The device's form of the reduction."""
        from ...device.reductions import Sums

        of = self.rows(rows)
        return None if of is None else Sums(of)


#: The most numbers of states that are summed in one call.
NUMBERS_AT_ONCE = 1 << 16


def called(name: Any, of: Of | None) -> str | None:
    """The user's name of results, or None."""
    if name is None:
        return None
    if of is None:
        raise ArgumentError(f"name: works with of=, since there are results of v and of y, got {checks.short(name)}")
    if not isinstance(name, str) or not name.isidentifier():
        raise ArgumentError(f"name: expected the name of a variable, got {checks.short(name)}")
    return name


class _History(Reduction):
    def __init__(self, outcome: History) -> None:
        super().__init__(outcome)
        self.pieces: list[Piece] = []

    def see(self, piece: Piece) -> None:
        self.pieces.append(piece)

    def results(self) -> Results:
        system = self.pieces[0].run.system
        t = np.concatenate([piece.t for piece in self.pieces])
        return {
            block: Variable(
                ("t", *block_dims(system, block)),
                np.concatenate([piece.of(block) for piece in self.pieces]),
                f"{block} at intervals",
                block,
                {"t": t},
            )
            for block in _blocks(system)
        }


class History(ReducedOutcome):
    """The states at intervals: ``v`` and ``y`` along the dimension ``t``; the interval is ``every`` of ``stepwell.sweep``.

    With a tolerance, they are the states at the times of ``at``.

    Where ``dt`` is an axis the dimension is ``saved``, and ``t`` a coordinate that depends on both.

    Example:
        >>> axes = {"omega": ("omega", [1.0, 2.0])}
        >>> found = sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, dt=0.1, steps=10, every=5)
        >>> found.y.dims, found.t.values
        (('omega', 't'), array([0. , 0.5, 1. ]))
    """

    observes = False
    reduction = _History


class Function(Outcome):
    """The results of a function of the run of a chunk of members.

    It is called with a ``Run`` whose batch is the chunk, one axis of members. The run has the states after the transient at the
    interval ``every``; without it only the last one; with a tolerance those at the times of ``at``. A member may be in a chunk
    with any others, so the result of one must not depend on the others.

    Args:
        function: returns an array whose last axis is that of the members, or a dictionary of them by name; in place of an array,
            (names of the axes before the last, array).

    Example:
        >>> def amplitude(run):
        ...     return abs(run.y).max(axis=0)
        >>> axes = {"omega": ("omega", [1.0, 2.0])}
        >>> found = sw.sweep(
        ...     sw.Oscillator, axes, "rk4", v=0.0, y=1.0, dt=0.01, steps=1000, every=1, outcomes=sw.sweeps.Function(amplitude)
        ... )
        >>> found.amplitude.dims
        ('omega',)
    """

    observes = False

    def __init__(self, function: Callable[[Run], Any]) -> None:
        if not callable(function):
            raise ArgumentError(f"outcomes: expected a function of a run, got {checks.short(function)}")
        self.function = function

    def of_run(self, run: Run) -> Results:
        """The variables that the function returns for this run."""
        returned = self.function(run)
        named = returned if isinstance(returned, Mapping) else {name_of(self.function): returned}
        results = {}
        for name, values in named.items():
            if not isinstance(name, str) or not name:
                raise ArgumentError(f"outcomes: expected names of variables, got {checks.short(name)}")
            dims: Any = None
            if isinstance(values, tuple):
                dims, values = values
                dims = (dims,) if isinstance(dims, str) else tuple(dims)
            values = checks.as_array(f"outcomes: {name}", values)
            if values.dtype.kind not in "biuf":
                raise ArgumentError(f"outcomes: {name}: expected numbers, got an array of dtype {values.dtype}")
            if values.ndim == 0 or values.shape[-1] != run.status.size:
                raise ShapeError(
                    f"outcomes: {name}: expected an array whose last axis has one number for each member of the run, "
                    f"{run.status.size}, got shape {values.shape}"
                )
            dims = tuple(f"{name}_{i}" for i in range(values.ndim - 1)) if dims is None else dims
            if len(dims) != values.ndim - 1:
                raise ShapeError(f"outcomes: {name}: expected {values.ndim - 1} names of axes before the last, got {dims}")
            results[name] = Variable(dims, values, f"by the function {name_of(self.function)}")
        return results
