"""Switching times: when rates change from one piece to another by the time alone, whatever the state does.

A user's function that compares the time with a number, as ``np.where((t > 5) & (t < 6), 1.0, 0.0)`` does, jumps there or has a
kink. Adaptive steps evaluate rates at a few times only, and would miss a pulse between them. But the comparison is on the tape:
it is solved for the time by inverting the operations one after the other, from the outside in. So ``np.sin(omega * t) > 0.9``,
``t % period < 0.1``, ``abs(t - middle) < width`` and ``np.interp(t, …)`` are solved, for the parameters of each member. The time
must stand once in a comparison, or once in each of some factors whose product is compared with zero.

Steps would miss a narrow bell or ramp, too, though it is smooth. It has a middle, at which the argument of an even power, an
exponential or the like is zero, or a wave turns. A step that ends there does not miss it. Bells that repeat count if they are
narrow: steps that end at each turn of a wave would be for nothing.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...base.checks import concatenated
from ...errors import AccuracyWarning
from ...reference.bits import DOUBLE
from ...reference.marks import Mark
from ...reference.tape.lines import Operation, needed
from ...reference.tape.operations import COMPARISONS
from ...reference.tape.replay import Replay
from .series import Line

if TYPE_CHECKING:
    from .series import MarkedReplay, OnSeries

#: The most times of a condition, of all members together, that are searched.
MOST_TIMES = 1 << 21
#: Bells that repeat are narrow if less than this share of a period is further than that share of their height from what they are
#: for most of it, by so many samples.
NARROW, HEIGHT, SHAPE_SAMPLES = 0.5, 0.05, 129
#: The range of the argument of a periodic function is that of so many samples.
ARGUMENT_SAMPLES = 33
#: An inverted time is off by roundings on the way, and rates switch where their own roundings let them: the switch is searched
#: within so many roundings of the time, the fewest that contain it.
WIDER = (1.0, 2.0**6, 2.0**16, 2.0**28)


def numbers_of(parameters: dict[str, Any], own_axes: Callable[[str], int]) -> list[Array | None]:
    """The numbers of parameters one after the other, in the order of the rates' tape; None is an input."""
    numbers: list[Array | None] = []
    for name, value in parameters.items():
        if hasattr(value, "at"):
            numbers.append(None)
        elif not callable(value):
            numbers += [np.asarray(value[index]) for index in np.ndindex(np.shape(value)[: own_axes(name)])]
    return numbers


class Switch(NamedTuple):
    """Rates change where ``left`` equals ``right``, or with a period where they differ by whole periods.

    Each is a line or a number. ``smooth`` is whether that is the middle of a bell or a ramp, and ``shapes`` are the lines that
    have its shape if it repeats.
    """

    left: Any
    right: Any
    period: Any = None
    smooth: bool = False
    shapes: tuple[int, ...] = ()


#: Where functions jump, by their arguments.
JUMPS: dict[str, Callable[..., list[Switch]]] = {
    "sign": lambda x: [Switch(x, 0.0)],
    "copysign": lambda x, y: [Switch(y, 0.0)],
    "floor": lambda x: [Switch(x, 0.0, 1.0)],
    "ceil": lambda x: [Switch(x, 0.0, 1.0)],
    "trunc": lambda x: [Switch(x, 0.0, 1.0)],
    "round": lambda x: [Switch(x, 0.5, 1.0)],
    "mod": lambda x, y: [Switch(x, 0.0, y)],
    "remainder": lambda x, y: [Switch(x, 0.0, y)],
}
#: Where functions have a kink.
KINKS: dict[str, Callable[..., list[Switch]]] = {
    "abs": lambda x: [Switch(x, 0.0)],
    "minimum": lambda x, y: [Switch(x, y)],
    "maximum": lambda x, y: [Switch(x, y)],
    "clip": lambda x, low, high: [Switch(x, low), Switch(x, high)],
}
#: Functions that make a bell or a ramp whose middle is where their first argument is zero.
WITH_MIDDLE = {"exp", "exp2", "expm1", "tanh", "cosh", "arctan", "hypot", "power"}
#: Where functions that swing are largest and smallest, within a period of 2π: there a power or the like of them may be a bell.
EXTREMES = {"sin": (0.5 * np.pi, -0.5 * np.pi), "cos": (0.0, np.pi)}
#: Periodic functions, of which bells and ramps repeat.
REPEATING = {"sin", "cos", "tan", "mod", "remainder"}

#: The inverses of functions of one argument: the arguments within one period at which they have a value, and the period.
INVERSES: dict[str, tuple[Callable[[Any], Sequence[Any]], float | None]] = {
    "abs": (lambda y: (-y, y), None),
    "square root": (lambda y: (np.where(y < 0.0, np.nan, y * y),), None),
    "cbrt": (lambda y: (y * y * y,), None),
    "sin": (lambda y: (np.arcsin(y), np.pi - np.arcsin(y)), 2.0 * np.pi),
    "cos": (lambda y: (-np.arccos(y), np.arccos(y)), 2.0 * np.pi),
    "tan": (lambda y: (np.arctan(y),), np.pi),
    "arcsin": (lambda y: (np.sin(y),), None),
    "arccos": (lambda y: (np.cos(y),), None),
    "arctan": (lambda y: (np.tan(y),), None),
    "sinh": (lambda y: (np.arcsinh(y),), None),
    "cosh": (lambda y: (-np.arccosh(y), np.arccosh(y)), None),
    "tanh": (lambda y: (np.arctanh(y),), None),
    "exp": (lambda y: (np.log(y),), None),
    "exp2": (lambda y: (np.log2(y),), None),
    "expm1": (lambda y: (np.log1p(y),), None),
    "log": (lambda y: (np.exp(y),), None),
    "log2": (lambda y: (np.exp2(y),), None),
    "log10": (lambda y: (10.0**y,), None),
    "log1p": (lambda y: (np.expm1(y),), None),
}

#: The inverses of operations of two operands: the first operand by the value and the second, and the second by the value and the
#: first.
OPERANDS: dict[str, tuple[Callable[[Any, Any], Any], Callable[[Any, Any], Any]]] = {
    "add": (lambda value, other: value - other, lambda value, other: value - other),
    "subtract": (lambda value, other: value + other, lambda value, other: other - value),
    "multiply": (lambda value, other: value / other, lambda value, other: value / other),
    "divide": (lambda value, other: value * other, lambda value, other: other / value),
}


class Switches:
    """The switches of a function's rates.

    Args:
        rates: the operations of the rates, with the functions among them.
        numbers: the numbers of the parameters, one after the other; None is an input, which knows its own jumps.
    """

    def __init__(self, rates: OnSeries, numbers: Sequence[Array | None]) -> None:
        self.tape = [Operation(name, tuple(of), extra) for name, of, extra in rates.operations.lines]
        self.functions = rates.operations.functions
        #: For each line whether it depends on the time; None if it depends on the state or an input, too.
        self.changes: list[bool | None] = []
        #: For each line the base and the exponent of the whole power that it is.
        self.powers: list[tuple[Any, int]] = []
        #: For each line whether it depends on a periodic function.
        self.repeats: list[bool] = []
        for line, (name, of, extra) in enumerate(self.tape):
            mark = self.functions.get(line)
            self.repeats.append(any(self.repeats[each] for each in of) if mark is None else self._repeating(mark))
            factors = [self.powers[each] for each in of] if name == "multiply" and line not in self.functions else []
            alike = len(factors) == 2 and factors[0][0] == factors[1][0]
            self.powers.append((factors[0][0], factors[0][1] + factors[1][1]) if alike else (Line(line), 1))
            operands = [self.changes[line] for line in of]
            unknown = None in operands or name == "state" or (name == "parameter" and numbers[extra] is None)
            self.changes.append(None if unknown else name == "time" or any(operands))
        values = self._of_values(rates.operations.places)
        switches = [each for line in rates.operations.needed for each in self._jumps(line)]
        switches += [each for line in rates.operations.needed if line in values for each in self._bends(line)]
        #: True if there are pieces between which the time alone chooses.
        self.by_time = any(self._by_time(each) for each in switches if not each.smooth)
        shapes = self._shapes(rates.operations)
        switches = [each._replace(shapes=shapes.get(each.left, ())) if self._repeated(each) else each for each in switches]
        solvable = [each for each in switches if self._solvable(each)]
        #: True if some are not solved for.
        self.unsolvable = any(not (each.smooth or self._solvable(each)) for each in switches)
        #: The constants of the function with which the time itself is compared, and all other switches.
        self.constants = np.unique([time for each in solvable if (time := self._constant_time(each)) is not None])
        self.switches = [each for each in solvable if self._constant_time(each) is None]
        self._replays: dict[int, Replay] = {}

    def _repeating(self, mark: Mark) -> bool:
        return mark.name in REPEATING or any(isinstance(each, Line) and self.repeats[each] for each in mark.arguments)

    def _constant_time(self, switch: Switch) -> float | None:
        """The constant with which a switch compares the time itself; None for other switches."""
        sides = [self.tape[each] if isinstance(each, Line) else each for each in switch[:2]]
        for time, other in (sides, sides[::-1]):
            if switch.period is None and isinstance(time, Operation) and time.name == "time":
                if not isinstance(other, Operation):
                    return float(other)
                return DOUBLE.constant(other.extra) if other.name == "constant" else None
        return None

    def of_line(self, line: int) -> Replay:
        """The operations that compute a line."""
        if line not in self._replays:
            self._replays[line] = Replay(*needed(self.tape, [line]))
        return self._replays[line]

    def _of_values(self, roots: Sequence[int]) -> set[int]:
        """Lines whose values reach the rates otherwise than through a comparison."""
        reached, waiting = set(), list(roots)
        while waiting:
            line = waiting.pop()
            if line not in reached and self.tape[line].name not in COMPARISONS:
                reached.add(line)
                mark = self.functions.get(line)
                waiting += self.tape[line].of if mark is None else [each for each in mark.arguments if isinstance(each, Line)]
        return reached

    def _jumps(self, line: int) -> list[Switch]:
        """The switches at which a line jumps, or the truth of a comparison changes."""
        name, of, _ = self.tape[line]
        if (mark := self.functions.get(line)) is not None:
            return JUMPS[mark.name](*mark.arguments) if mark.name in JUMPS else []
        if name in COMPARISONS:
            return [Switch(Line(of[0]), Line(of[1]))]
        return JUMPS["floor"](Line(of[0])) if name == "floor" else []

    def _bends(self, line: int) -> list[Switch]:
        """The switches at which a line has a kink, or the middle of a bell or a ramp."""
        if (mark := self.functions.get(line)) is not None:
            middle = [Switch(mark.arguments[0], 0.0, smooth=True)] if mark.name in WITH_MIDDLE else []
            middle += [Switch(mark.arguments[0], each, 2.0 * np.pi, smooth=True) for each in EXTREMES.get(mark.name, ())]
            return KINKS[mark.name](*mark.arguments) if mark.name in KINKS else middle
        base, exponent = self.powers[line]
        return [Switch(base, 0.0, smooth=True)] if exponent % 2 == 0 else []

    def _by_time(self, switch: Switch) -> bool:
        changes = [self.changes[each] for each in switch[:3] if isinstance(each, Line)]
        return any(changes) and None not in changes

    def _solvable(self, switch: Switch) -> bool:
        once = self._by_time(switch) and not (isinstance(switch.period, Line) and self.changes[switch.period])
        return once and bool(switch.shapes or not self._repeated(switch))

    def _repeated(self, switch: Switch) -> bool:
        repeats = switch.period is not None or any(self.repeats[each] for each in switch[:2] if isinstance(each, Line))
        return switch.smooth and repeats

    def _shapes(self, rates: MarkedReplay) -> dict[int, tuple[int, ...]]:
        """By lines of the time, those that are the last ones of the time alone, behind a function with a middle or a quotient."""
        readers: dict[int, list[int]] = {}
        for line in rates.needed:
            mark = self.functions.get(line)
            of = self.tape[line].of if mark is None else [each for each in mark.arguments if isinstance(each, Line)]
            for each in of:
                readers.setdefault(each, []).append(line)
        shapes: dict[int, set[int]] = {}
        bends: dict[int, bool] = {}
        for line in reversed(rates.needed):
            if not self.changes[line] or self.tape[line].name in COMPARISONS:
                continue
            behind = [each for each in readers.get(line, []) if self.changes[each]]
            is_last = line in rates.places or any(self.changes[each] is None for each in readers.get(line, []))
            shapes[line] = {line} if is_last else set()
            shapes[line].update(*(shapes.get(each, ()) for each in behind))
            mark = self.functions.get(line)
            bends_alone = self.tape[line].name == "divide" or self.powers[line][1] > 2
            own = bends_alone if mark is None else mark.name in WITH_MIDDLE
            bends[line] = own or any(bends.get(each, False) for each in behind)
        bent = {line for line in shapes if any(bends.get(each, False) for each in (line, *readers.get(line, [])))}
        return {line: tuple(sorted(shapes[line])) for line in bent}

    def times(self, numbers: Sequence[Array | None], begin: float, end: float) -> Array:
        """The times at which members switch, from ``begin`` to ``end`` and some around, shape (times, *batch); NaN is no time.

        ``numbers`` are the numbers of the parameters, with axes that broadcast to those of the batch.
        """
        if not self.switches:
            return self.constants
        with np.errstate(all="ignore"):
            solving = Solving(self, numbers, begin, end)
            times = [self.constants, *(times for switch in self.switches for times in solving.of(switch))]
        if solving.too_many:
            warnings.warn(
                f"the rates switch by the time more than {MOST_TIMES} times in this run, so steps do not end at each, and pulses "
                f"may be missed; make several runs, one after the other, or give max_step= below the shortest pulse",
                AccuracyWarning,
                stacklevel=2,
            )
        return concatenated(times)


class Solving:
    """The switches solved for the time, for numbers of the parameters. Values have shape (values, *batch)."""

    def __init__(self, switches: Switches, numbers: Sequence[Array | None], begin: float, end: float) -> None:
        self.of_line, self.tape, self.functions = switches.of_line, switches.tape, switches.functions
        self.changes, self.powers = switches.changes, switches.powers
        self.numbers = numbers
        self.axes = max((each.ndim for each in numbers if each is not None), default=0)
        #: True if a condition switches too often to be searched, and True if one has no inverse here.
        self.too_many = self.unsolved = False
        self.samples = np.linspace(begin, end, ARGUMENT_SAMPLES).reshape(-1, *self.axes * (1,))

    def of(self, switch: Switch) -> Iterator[Array]:
        """The times of a switch."""
        left, right, period, smooth, shapes = switch
        if not self._changing(left):
            left, right = right, left
        if self._changing(right):
            self.unsolved |= not smooth
            return
        values = self._constant(right)[np.newaxis]
        if period is not None:
            values = self._periodic(left, values, self._constant(period))
        waiting = [(left, values)]
        while waiting:
            line, values = waiting.pop()
            if self.tape[line].name == "time":
                narrow = self._narrow(values, shapes, period is not None) if shapes else values
                yield narrow if smooth else self._exact(values, switch)
            else:
                operands = list(self._inverted(line, values))
                self.unsolved |= not (smooth or operands)
                waiting += operands

    def _inverted(self, line: Any, values: Array) -> Iterator[tuple[Any, Array]]:
        """The operands of a line that depend on the time, with the values that they have where the line has one of these."""
        name, of, _ = self.tape[line]
        operands: Sequence[Any] = [Line(each) for each in of]
        if (mark := self.functions.get(line)) is not None:
            name, operands = mark.name, mark.arguments
        changing = [each for each in operands if self._changing(each)]
        base, exponent = self.powers[line]
        if exponent > 1:
            yield from self._root(base, np.asarray(float(exponent)), values)
        elif len(changing) == 2 and name == "multiply" and not values.any():
            yield from ((factor, values) for factor in changing)
        if len(changing) != 1:
            return
        argument = changing[0]
        place = 0 if argument is operands[0] else 1
        if name in OPERANDS:
            yield argument, OPERANDS[name][place](values, self._constant(operands[1 - place]))
        elif name == "negate":
            yield argument, -values
        elif name in ("minimum", "maximum"):
            yield argument, values
        elif name in ("mod", "remainder") and place == 0:
            period = self._constant(operands[1])
            within = np.where(np.abs(values) < np.abs(period), values, np.nan)
            yield argument, self._periodic(argument, within, period)
        elif name == "power" and place == 0:
            yield from self._root(argument, self._constant(operands[1]), values)
        elif name in INVERSES:
            inverse, turn = INVERSES[name]
            for each in inverse(values):
                yield argument, each if turn is None else self._periodic(argument, each, np.asarray(turn))

    def _root(self, base: Any, exponent: Array, values: Array) -> Iterator[tuple[Any, Array]]:
        """The base of a power, with the values that it has where the power has one of these."""
        size, odd = np.abs(values) ** (1.0 / exponent), exponent % 2.0 == 1.0
        yield base, np.where(odd, np.copysign(size, values), np.where(values < 0.0, np.nan, size))
        if not odd.all():
            yield base, np.where(odd | (values < 0.0), np.nan, -size)

    def _periodic(self, line: Any, values: Array, period: Array) -> Array:
        """Values whole periods away from these, over the range of the line and one more; none if there are too many."""
        seen, period = self._at(line, self.samples), np.abs(period)
        places = [(edge - values) / period for edge in (seen.min(axis=0), seen.max(axis=0))]
        first, last = np.floor(np.nanmin(places)) - 1.0, np.ceil(np.nanmax(places)) + 1.0
        if not 0.0 <= (last - first) * max(np.size(values), np.size(period)) <= MOST_TIMES:
            self.too_many |= bool(last > first)
            return values[:0]
        every = np.arange(first, last + 1.0).reshape(-1, *np.ndim(values) * (1,))
        periodic = values + period * every
        return periodic.reshape(-1, *periodic.shape[2:])

    def _narrow(self, times: Array, shapes: Sequence[int], bells: bool) -> Array:
        """The middles of bells or ramps that repeat, or with ``bells`` of bells alone, where they are narrow, else NaN."""
        ordered = np.sort(times, axis=0)
        apart = np.diff(ordered, axis=0)
        apart[~(apart > HEIGHT * np.nanmax(apart, axis=0, initial=0.0))] = np.inf
        if not len(apart):
            return times
        period = apart.min(axis=0)
        middle = ordered[len(ordered) // 2]
        around = np.linspace(-0.5, 0.5, SHAPE_SAMPLES).reshape(-1, *(1,) * period.ndim)
        narrow = np.zeros(period.shape, bool)
        for line in shapes:
            values = self._at(line, middle + period * around)
            height = HEIGHT * (values.max(axis=0) - values.min(axis=0))
            away = np.abs(values - np.median(values, axis=0)) > height
            narrow = narrow | (away.mean(axis=0) < NARROW) & (height > 0.0) & (away[SHAPE_SAMPLES // 2] | (not bells))
        return np.where(narrow, times, np.nan) if narrow.any() else times[:0]

    def _exact(self, times: Array, switch: Switch) -> Array:
        """The times to the last bits: where the piece changes, if it changes once nearby."""
        rounding = np.spacing(np.maximum(np.abs(times), np.finfo(np.float64).eps))
        for roundings in WIDER:
            before, after = times - roundings * rounding, times + roundings * rounding
            first = self._piece(switch, before)
            changes = first != self._piece(switch, after)
            if (changes | np.isnan(times)).all():
                break
        if roundings == 1.0:
            return times
        for _ in range(int(np.log2(roundings)) + 1):
            middle = before + 0.5 * (after - before)
            same = self._piece(switch, middle) == first
            before, after = np.where(same, middle, before), np.where(same, after, middle)
        return np.where(changes, after, times)

    def _piece(self, switch: Switch, times: Array) -> Array:
        """The piece that the rates take: whether a comparison holds, or the number of the period."""
        left, right = (self._at(each, times) if isinstance(each, Line) else each for each in switch[:2])
        return np.asarray(left < right if switch.period is None else np.floor((left - right) / self._constant(switch.period)))

    def _changing(self, what: Any) -> bool:
        return isinstance(what, Line) and bool(self.changes[what])

    def _constant(self, what: Any) -> Array:
        """The value of a line that does not depend on the time, or a number, for each member, shape (*batch)."""
        each = np.asarray(self._at(what, 0.0) if isinstance(what, Line) else what, np.float64)
        return each.reshape((self.axes - each.ndim) * (1,) + each.shape)

    def _at(self, line: Any, t: Any) -> Array:
        return np.asarray(self.of_line(line)([], self.numbers, np.asarray(t))[0])
