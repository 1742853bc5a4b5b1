"""A user's method, run once over blocks that only record what is done with them.

A block is all numbers of v, or all of y. A method adds blocks, multiplies them by numbers and asks the system for increments; it
cannot look into a block, so it holds for every system.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import isfinite
from numbers import Real
from typing import Any, NoReturn

import numpy as np

from ..base.checks import short
from ..errors import ArgumentError, DTypeError, ShapeError
from ..reference.program import Operation, Program

#: Names of the blocks in messages.
KINDS = {True: "velocities", False: "coordinates"}


class Recorder:
    """The operations so far; equal ones are one."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self._places: dict[tuple[str, tuple[int, ...], str], int] = {}

    def write(self, name: str, of: Sequence[Block], number: float, of_v: bool) -> Block:
        """The block that an operation makes."""
        for each in of:
            if each.recorder is not self:
                raise ArgumentError(f"{name}: a block of another step; a method keeps blocks only by returning them")
        places = tuple(each.place for each in of)
        # By the digits of the number: 0.0 and −0.0 are equal, and not the same.
        place = self._places.setdefault((name, places, number.hex()), len(self.operations))
        if place == len(self.operations):
            self.operations.append((name, places, number))
        return Block(self, place, of_v)


class Block:
    """All velocities or all coordinates of a system, at some time within the step."""

    __slots__ = ("of_v", "place", "recorder")

    def __init__(self, recorder: Recorder, place: int, of_v: bool) -> None:
        self.recorder, self.place, self.of_v = recorder, place, of_v

    def __repr__(self) -> str:
        return f"<a block of {KINDS[self.of_v]}>"

    def _with(self, name: str, sign: str, other: Any) -> Block:
        if isinstance(other, (Time, Length)):
            raise DTypeError(
                f"{sign}: expected two blocks, got {self!r} and {other!r}; s.dv and s.dy are increments, which have the factor h"
            )
        if not isinstance(other, Block):
            raise DTypeError(f"{sign}: expected two blocks, got {self!r} and {short(other)}; a number can only multiply a block")
        if other.of_v is not self.of_v:
            raise ShapeError(f"{sign}: expected two blocks of velocities or two of coordinates, got one of each")
        return self.recorder.write(name, (self, other), 0.0, self.of_v)

    def __add__(self, other: Any) -> Block:
        return self._with("add", "+", other)

    def __radd__(self, other: Any) -> Block:
        if type(other) is int and other == 0:  # sum() begins with it
            return self
        return self._with("add", "+", other)

    def __sub__(self, other: Any) -> Block:
        return self._with("subtract", "−", other)

    def __rsub__(self, other: Any) -> Block:
        return self._with("subtract", "−", other)

    def __mul__(self, factor: Any) -> Block:
        return self.recorder.write("scale", (self,), number("*", factor), self.of_v)

    __rmul__ = __mul__

    def __truediv__(self, divisor: Any) -> Block:
        return self * (1.0 / divided("/", divisor))

    def __neg__(self) -> Block:
        return -1.0 * self

    def __pos__(self) -> Block:
        return self

    def __bool__(self) -> NoReturn:
        raise DTypeError("if: a block has no truth value, since a method is recorded once for all systems and states")

    def _compared(self, other: Any) -> NoReturn:
        raise DTypeError(
            f"<, >: got {self!r} and {short(other)} to compare; a method is recorded once for all systems and states, and "
            f"chooses nothing by their numbers; a choice between rates belongs to a system, as np.where"
        )

    __lt__ = __le__ = __gt__ = __ge__ = _compared

    def __getitem__(self, index: Any) -> NoReturn:
        raise DTypeError("[]: a method cannot look into a block, since it holds for systems of any size")

    def __array_ufunc__(self, ufunc: Any, way: str, *inputs: Any, **options: Any) -> Any:
        known = {np.add: "__add__", np.subtract: "__sub__", np.multiply: "__mul__", np.divide: "__truediv__"}
        if way == "__call__" and len(inputs) == 2 and not options and ufunc in known:
            a, b = inputs
            if isinstance(a, Block):
                return getattr(a, known[ufunc])(b)
            if ufunc is np.multiply:
                return b * a
        raise DTypeError(
            f"np.{ufunc.__name__}: a method adds blocks and multiplies them by numbers; functions of the state belong to a system"
        )


class Length:
    """A length of time, as a share of the step."""

    __slots__ = ("share",)

    def __init__(self, share: float) -> None:
        self.share = share

    def __repr__(self) -> str:
        return "h" if self.share == 1.0 else f"{self.share:g}·h"

    def __mul__(self, factor: Any) -> Length:
        if isinstance(factor, Block):
            raise DTypeError("*: h times a block; s.dv and s.dy are increments already, which have the factor h")
        return Length(self.share * number("*", factor))

    __rmul__ = __mul__

    def __truediv__(self, divisor: Any) -> Length:
        return Length(self.share / divided("/", divisor))

    def __neg__(self) -> Length:
        return Length(-self.share)

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Length):
            return Length(self.share + other.share)
        return NotImplemented

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, Length):
            return Length(self.share - other.share)
        return NotImplemented


class Time:
    """A time within the step, by its distance from the start as a share of the step."""

    __slots__ = ("share",)

    def __init__(self, share: float) -> None:
        self.share = share

    def __repr__(self) -> str:
        return "t" if self.share == 0.0 else f"t + {self.share:g}·h"

    def _after(self, length: Any, sign: float) -> Time:
        if not isinstance(length, Length):
            raise DTypeError(f"t: expected a part of the step to add, such as t + 0.5 * h, got {short(length)}")
        return Time(self.share + sign * length.share)

    def __add__(self, length: Any) -> Time:
        return self._after(length, 1.0)

    __radd__ = __add__

    def __sub__(self, length: Any) -> Time:
        return self._after(length, -1.0)


class Rates:
    """The system as a method sees it."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def _rate(self, name: str, t: Any, v: Any, y: Any) -> Block:
        if not isinstance(t, Time):
            raise DTypeError(f"s.{name}: expected a time first, such as t or t + 0.5 * h, got {short(t)}")
        return self._recorder.write(name, (of_kind(f"s.{name}", v, True), of_kind(f"s.{name}", y, False)), t.share, name == "dv")

    def dv(self, t: Any, v: Any, y: Any) -> Block:
        """h·v̇(t, v, y), the increment of v."""
        return self._rate("dv", t, v, y)

    def dy(self, t: Any, v: Any, y: Any) -> Block:
        """h·ẏ(t, v, y), the increment of y."""
        return self._rate("dy", t, v, y)

    def velocity(self, d: Any) -> Block:
        """The velocity whose increment of y is d, in a second-order system."""
        return self._recorder.write("velocity", (of_kind("s.velocity", d, False),), 0.0, True)

    def __getattr__(self, name: str) -> NoReturn:
        raise ArgumentError(f"s.{name}: a method has s.dv(t, v, y), s.dy(t, v, y) and s.velocity(d)")


def of_kind(where: str, block: Any, of_v: bool) -> Block:
    """An argument that must be a block of velocities, or one of coordinates."""
    if not isinstance(block, Block):
        raise DTypeError(f"{where}: expected a block of {KINDS[of_v]}, got {short(block)}")
    if block.of_v is not of_v:
        raise ShapeError(f"{where}: expected a block of {KINDS[of_v]}, got one of {KINDS[not of_v]}")
    return block


def number(where: str, factor: Any) -> float:
    """A factor of a block or of the step."""
    if isinstance(factor, (bool, np.bool_)) or not isinstance(factor, (Real, Fraction)):
        raise DTypeError(f"{where}: expected a number, got {short(factor)}")
    if not isfinite(factor):
        raise ArgumentError(f"{where}: expected a finite number, got {factor!r}")
    return float(factor)


def divided(where: str, divisor: Any) -> float:
    """A divisor."""
    if (value := number(where, divisor)) == 0.0:
        raise ArgumentError(f"{where}: expected a divisor other than 0")
    return value


def recorded(function: Callable[..., Any], name: str, kept: Sequence[bool] = ()) -> tuple[Program, list[bool]]:
    """The program of a method's function, with the kinds of its results: whether each is a block of velocities.

    ``kept`` are the kinds of the blocks that it has from the step before.
    """
    recorder = Recorder()
    v, y = recorder.write("v", (), 0.0, True), recorder.write("y", (), 0.0, False)
    before = [recorder.write(f"kept {'v' if of_v else 'y'}", (), float(i), of_v) for i, of_v in enumerate(kept)]
    results = function(Rates(recorder), Time(0.0), Length(1.0), v, y, *before)
    results = [results] if isinstance(results, Block) else results
    if not isinstance(results, (tuple, list)) or not all(isinstance(each, Block) for each in results):
        raise DTypeError(f"{name}: expected blocks to be returned, as in return v, y, got {short(results)}")
    for each in results:
        if each.recorder is not recorder:
            raise ArgumentError(f"{name}: returned a block of another step; a method keeps blocks only by returning them")
    program = Program(tuple(recorder.operations), tuple(each.place for each in results))
    return program.first(len(results)), [each.of_v for each in results]
