"""Taylor series of the solution of a system, order after order: the specification of the core's ``series.rs``.

The rates are run once, with numbers that record their operations. From these and the coefficients of the state up to
order k follow those of the rates, and from these the coefficients k + 1 of the state, by the recurrences of Jorba and Zou
(Experimental Mathematics 14 (2005) 99). Sums over products begin with the terms that are known longest.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from .bits import equal, magnitude, where
from .marks import KINDS, Mark, mark
from .tape import rules
from .tape.operations import ON_BITS, of_numbers, of_symbols

#: A coefficient; None if it is known to be zero.
Term = Any


class Branch(NamedTuple):
    """A function with several branches, such as a root, and the bounds of the values of the one that the rates take."""

    value: Series
    least: float
    most: float


#: The values of functions that are one branch of several: beyond these their series goes on to the next. A root is not below 0.
BRANCHES = {
    "hypot": (0.0, np.inf),
    "arctan2": (-np.pi, np.pi),
    "arctan": (-np.pi / 2, np.pi / 2),
    "arcsin": (-np.pi / 2, np.pi / 2),
    "arccos": (0.0, np.pi),
}


#: Functions with derivatives that are not finite at the ends of their domains. There these count as zero, as a root's do at zero.
ENDS = frozenset(("cbrt", "arcsin", "arccos", "hypot", "arctan2"))
#: Functions that are made of pieces.
PIECES = frozenset(
    ("abs", "sign", "copysign", "floor", "ceil", "trunc", "round", "mod", "remainder", "minimum", "maximum", "clip")
)
#: The name of xᵖ⁻ʲ at x = 0, where the derivatives of xᵖ do not follow from xᵖ, as a function of x, p and j; and the largest j.
LOWERED, MOST_LOWERED = "lowered power", 4
#: A base up to this size is zero.
TINY = 2.0**-930


class Book:
    """The numbers that change with time, each after its operands, and the functions and branches among them.

    Attributes:
        ends: whether the rates are a user's, which may begin at the ends of domains and far from the middle of what saturates.
        divides: whether coefficients of order k are divided by k. The rounding of its reciprocal is in all of them alike, so
            that the energy of a long motion goes to one side. In steps of fixed length they are multiplied by it.
    """

    ends = False

    def __init__(self, *, divides: bool = False) -> None:
        self.divides = divides
        self.series: list[Series] = []
        self.functions: dict[Any, Series] = {}
        self.branches: list[Branch] = []

    def advance(self, k: int) -> None:
        """The coefficients of order k of all, from those of lower orders and that of the state. Derivatives of functions join."""
        i = 0
        while i < len(self.series):
            each = self.series[i]
            if k > 0 and each.rule is not None:
                each.terms.append(each.rule(k))
            i += 1


class Series:
    """A number that changes with time, by the coefficients of its Taylor series that are known so far.

    Attributes:
        book: the book that lists it.
        terms: the coefficients, in powers of the share of the step.
        rule: gives the coefficient of an order above 0; None for the state and the time, whose coefficients are appended.
        opposite: the series of which it is the negative.
    """

    __slots__ = ("book", "opposite", "rule", "terms")

    def __init__(self, book: Book, start: Any, rule: Callable[[int], Term] | None, opposite: Series | None = None) -> None:
        self.book, self.terms, self.rule, self.opposite = book, [start], rule, opposite
        book.series.append(self)

    def __add__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if not isinstance(other, Series):
            return self if _is(other, -0.0) else Series(self.book, self.terms[0] + other, self.terms.__getitem__)
        if other.opposite is not None:
            return self - other.opposite
        if self.opposite is not None:
            return other - self.opposite
        return Series(self.book, self.terms[0] + other.terms[0], lambda k: _sum(self.terms[k], other.terms[k]))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if not isinstance(other, Series):
            return self if _is(other, 0.0) else Series(self.book, self.terms[0] - other, self.terms.__getitem__)
        if other.opposite is not None:
            return self + other.opposite
        return Series(self.book, self.terms[0] - other.terms[0], lambda k: _difference(self.terms[k], other.terms[k]))

    def __rsub__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if self.opposite is not None:
            return self.opposite + other
        return -self if _is(other, -0.0) else Series(self.book, other - self.terms[0], lambda k: _difference(None, self.terms[k]))

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if self.opposite is not None:
            return -(self.opposite * other)
        if not isinstance(other, Series):
            if _is(other, 1.0):
                return self
            return (
                -self if _is(other, -1.0) else Series(self.book, self.terms[0] * other, lambda k: _product(self.terms[k], other))
            )
        if other.opposite is not None:
            return -(self * other.opposite)
        return Series(self.book, self.terms[0] * other.terms[0], lambda k: _convolved(self.terms, other.terms, k))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if isinstance(other, Series):
            return _quotient(self.terms[0] / other.terms[0], self.terms.__getitem__, other)
        if _is(other, 1.0):
            return self
        return Series(self.book, self.terms[0] / other, lambda k: None if self.terms[k] is None else self.terms[k] / other)

    def __rtruediv__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        sign = 1 if _is(other, 1.0) else -1 if _is(other, -1.0) else 0
        return _quotient(other / self.terms[0], lambda k: None, self, sign)

    def __neg__(self) -> Series:
        if self.opposite is not None:
            return self.opposite
        return Series(self.book, -self.terms[0], lambda k: _difference(None, self.terms[k]), self)

    def __pos__(self) -> Series:
        return self

    def sqrt(self) -> Series:
        """√x: from y² = x."""
        start = self.terms[0]
        root = start.sqrt() if hasattr(start, "sqrt") else np.sqrt(start)
        over: list[Any] = []

        def rule(k: int) -> Term:
            if not over:
                over.append(where(equal(root, 0.0), 0.0, 0.5 / root) if self.book.ends else 0.5 / root)
            pairs = None
            for j in range((k + 1) // 2 - 1, 0, -1):
                pairs = _sum(pairs, _product(series.terms[j], series.terms[k - j]))
            twice = _sum(pairs, pairs)
            middle = None if k % 2 else _product(series.terms[k // 2], series.terms[k // 2])
            rest = _difference(self.terms[k], _sum(middle, twice))
            return None if rest is None else rest * over[0]

        series = Series(self.book, root, rule)
        self.book.branches.append(Branch(series, 0.0, np.inf))
        return series

    def __lt__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else Truth(self.book, self.terms[0] < _start(other))

    def __le__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else Truth(self.book, self.terms[0] <= _start(other))

    def __gt__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else Truth(self.book, _start(other) < self.terms[0])

    def __ge__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else Truth(self.book, _start(other) <= self.terms[0])

    def equals(self, other: Any) -> Truth:
        """True where both are equal at the start of the step."""
        start, other = self.terms[0], _start(other)
        return Truth(self.book, start.equals(other) if hasattr(start, "equals") else np.equal(start, other))

    def __bool__(self) -> bool:
        raise TypeError("a series has no truth value")


class Truth:
    """The result of a comparison at the start of the step, which holds for all of it."""

    __slots__ = ("book", "value")

    def __init__(self, book: Book, value: Any) -> None:
        self.book, self.value = book, value

    def choose(self, yes: Any, no: Any) -> Any:
        """One of two numbers."""
        if yes is no:
            return yes

        def rule(k: int) -> Term:
            terms = [each.terms[k] if isinstance(each, Series) else None for each in (yes, no)]
            if terms[0] is None and terms[1] is None:
                return None
            return self._one_of(*(0.0 if term is None else term for term in terms))

        return Series(self.book, self._one_of(_start(yes), _start(no)), rule)

    def _one_of(self, yes: Any, no: Any) -> Any:
        return self.value.choose(yes, no) if hasattr(self.value, "xor_bits") else (yes if self.value else no)

    def __and__(self, other: Any) -> Truth:
        return Truth(self.book, self.value & _held(other))

    def __or__(self, other: Any) -> Truth:
        return Truth(self.book, self.value | _held(other))

    def __invert__(self) -> Truth:
        return Truth(self.book, ~self.value)

    __rand__, __ror__ = __and__, __or__


def _held(truth: Any) -> Any:
    return truth.value if isinstance(truth, Truth) else truth


def _start(x: Any) -> Any:
    """A number at the start of the step."""
    return x.terms[0] if isinstance(x, Series) else x


def at_start(x: Any) -> Any:
    """Numbers at the start of the step, in an array if they are in one."""
    if isinstance(x, Series):
        return x.terms[0]
    if not among((x,)):
        return x
    numbers = [_start(each) for each in x.flat]
    return in_array(numbers, x.shape)


def among(values: Sequence[Any]) -> bool:
    """True if any of these is a series, or an array with one."""
    return any(
        isinstance(each, Series)
        or (isinstance(each, np.ndarray) and each.dtype == object and any(isinstance(item, Series) for item in each.flat))
        for each in values
    )


def _is(x: Any, number: float) -> bool:
    """True if x is this number, its sign included."""
    return isinstance(x, (float, int)) and float(x).hex() == number.hex()


def _sum(a: Term, b: Term) -> Term:
    if a is None or b is None:
        return b if a is None else a
    return a + b


def _difference(a: Term, b: Term) -> Term:
    if a is None or b is None:
        return a if b is None else -b
    return a - b


def _product(a: Term, b: Term) -> Term:
    return None if a is None or b is None else a * b


def _convolved(a: Sequence[Term], b: Sequence[Term], k: int) -> Term:
    """Σ aⱼ·bₖ₋ⱼ. Those with the newest coefficients come last, since everything waits for these.

    The others are two sums: those with the older of a apart from those with the older of b. Of a square both are equal.
    """
    middle = None if k % 2 else _product(a[k // 2], b[k // 2])
    if k == 0:
        return middle
    older = range((k + 1) // 2 - 1, 0, -1)
    if a is b:
        return functools.reduce(lambda total, j: _sum(total, _product(_sum(a[j], a[j]), a[k - j])), [*older, 0], middle)
    of_a = functools.reduce(lambda total, j: _sum(total, _product(a[j], b[k - j])), older, None)
    of_b = functools.reduce(lambda total, j: _sum(total, _product(a[k - j], b[j])), older, None)
    newest = _sum(_product(a[0], b[k]), _product(a[k], b[0]))
    return _sum(_sum(_sum(of_a, of_b), middle), newest)


def _finite_term(x: Series, k: int) -> Term:
    """A coefficient above order 0 of a divisor, or of what a function depends on, where it is finite, else 0."""
    term = x.terms[k]
    return where(magnitude(term) < np.inf, term, 0.0) if x.book.ends and term is not None else term


def _quotient(start: Any, dividend: Callable[[int], Term], divisor: Series, sign: int = 0) -> Series:
    """C = a/b: from c·b = a. ``sign`` is that of a reciprocal ±1/b, which is its own factor, and else 0."""
    over: list[Any] = []

    def rule(k: int) -> Term:
        known = None
        for j in range(1, k + 1):
            known = _sum(known, _product(_finite_term(divisor, j), series.terms[k - j]))
        if sign:
            return None if known is None else -(known * start) if sign > 0 else known * start
        if not over:
            over.append(1.0 / divisor.terms[0])
        rest = _difference(dividend(k), known)
        return None if rest is None else rest * over[0]

    series = Series(divisor.book, start, rule)
    return series


def function(name: str, of_numbers: Callable[..., Any], plain: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """A marked function of series, number by number. ``plain`` is the function itself, ``of_numbers`` notes its marks."""
    if any(isinstance(each, np.ndarray) for each in arguments):
        return np.frompyfunc(lambda *each: function(name, of_numbers, plain, each), len(arguments), 1)(*arguments)
    book = next((each.book for each in arguments if isinstance(each, Series)), None)
    if book is None:
        return of_numbers(*arguments)
    key = name, *map(_identity, arguments)
    if key not in book.functions:
        start = np.asarray(of_numbers(*map(_start, arguments)))[()]
        book.functions[key] = of_function(Mark(name, tuple(arguments), plain), start, book)
        if name in BRANCHES:
            book.branches.append(Branch(book.functions[key], *BRANCHES[name]))
    return book.functions[key]


KINDS.append((among, function))


def _identity(x: Any) -> Any:
    """The key of an argument in a table: symbols cannot be hashed, and 0 and −0 are equal but not the same."""
    if hasattr(x, "xor_bits"):
        return "symbol", x.id
    return repr(x) if isinstance(x, (int, float, complex, np.number)) else id(x)


def has_rule(mark: Mark) -> bool:
    """True if a marked value is treated as a function. Roots and squares are operations like others."""
    return mark.name == LOWERED or (mark.name in rules.PARTIALS and mark.name not in ("sqrt", "square"))


def factors(mark: Mark, value: Any, wanted: list[bool]) -> tuple[Any, ...]:
    """The derivatives of a function by its arguments, as symbols or as series; None for those that are not wanted or zero.

    That of xᵖ by x is p·xᵖ/x here, which needs no further power, and at x = 0 what p·xᵖ⁻¹ is. That of y = tanh x is 1 − y², which
    needs no cosh, and is zero where y is rounded to 1: it must not tell of a motion that rates do not have.
    """
    if mark.name == "tanh":
        return (1.0 - value * value,)
    if mark.name not in ("power", LOWERED):
        by = rules.of_function(mark, value, wanted)
        return tuple(map(_finite, by)) if mark.name in ENDS else by
    x, p = mark.arguments[:2]
    by_exponent = _finite(value * rules.function("log", mark.function)(x)) if wanted[1] and mark.name == "power" else None
    if mark.name == LOWERED:
        j = mark.arguments[2]
        return ((p - float(j)) * _lowered(x, p, j + 1) if wanted[0] else None), by_exponent, None
    if not wanted[0]:
        return None, by_exponent
    at_zero = 0.0 if isinstance(p, (int, float)) else _lowered(x, p, 1)
    return p * _either(_is_zero(x), at_zero, value / x), by_exponent


def _finite(factor: Any) -> Any:
    """A derivative where it is finite, else zero."""
    if factor is None or isinstance(factor, float) or (isinstance(factor, Series) and not factor.book.ends):
        return factor
    return _either(magnitude(at_start(factor)) < np.inf, factor, 0.0)


def _either(truth: Any, yes: Any, no: Any) -> Any:
    """One of two numbers by a truth at the start of the step."""
    book = next((each.book for each in (yes, no) if isinstance(each, Series)), None)
    return where(truth, yes, no) if book is None else Truth(book, truth).choose(yes, no)


def _is_zero(x: Any) -> Any:
    """True where a base is zero, or so small that its reciprocal overflows; its powers are zero then."""
    return magnitude(at_start(x)) <= TINY


def _lowered(x: Any, p: Any, j: int) -> Any:
    """xᵖ⁻ʲ at x = 0, with the derivatives that it has there up to the largest j, and zero elsewhere."""
    value = where(_is_zero(x) & equal(at_start(p), float(j)), 1.0, 0.0)
    if j > MOST_LOWERED:
        return value
    return of_function(Mark(LOWERED, (x, p, j), None), value, x.book) if isinstance(x, Series) else mark(LOWERED, value, x, p, j)


def operation(book: Book, name: str, of: list[Any], extra: int) -> Any:
    """An operation of a tape, on series and numbers. Whole numbers and bits are taken as they are at the start of the step."""
    if name in ("floor", *ON_BITS) and not any(isinstance(each, Truth) for each in of):
        of = [_start(each) for each in of]
    if not any(isinstance(each, (Series, Truth)) for each in of):
        if any(hasattr(each, "xor_bits") for each in of):
            return of_symbols(name, of, extra)
        return np.asarray(of_numbers(name, of, extra))[()]
    if name == "choose" and not isinstance(of[0], Truth):
        return Truth(book, of[0]).choose(*of[1:])
    if name == "exclusive or":
        return ~of[0] if isinstance(of[0], Truth) else ~of[1]
    if name == "equal" and not isinstance(of[0], Series):
        of = of[::-1]
    return of_symbols(name, of, extra)


def of_function(mark: Mark, start: Any, book: Book) -> Series:
    """Y = f(a, b, …), from ẏ = f₁·ȧ + f₂·ḃ + …: k·yₖ = Σ j·aⱼ·f₁ₖ₋ⱼ + …. ``start`` is y at the start of the step."""
    by: list[Any] = []

    def rule(k: int) -> Term:
        if not by:
            by.extend(factors(mark, series, [isinstance(each, Series) for each in mark.arguments]))
        total = None
        for argument, factor in zip(mark.arguments, by, strict=True):
            for j in range(1, k + 1) if factor is not None else ():
                slope = _product(float(j), _finite_term(argument, j))
                of_factor = factor.terms[k - j] if isinstance(factor, Series) else (factor if j == k else None)
                total = _sum(total, _product(slope, of_factor))
        if total is None:
            return None
        return part_of(total, k) if book.divides else (1.0 / k) * total

    series = Series(book, start, rule)
    return series


def coefficients(s: Any, order: int, t: Any, h: Any, v: Any, y: Any) -> list[tuple[Any, Any]]:
    """The Taylor coefficients of v and y around t, from the first to that order, in powers of the share of the step h."""
    return expanded(s, order, t, (h, 1.0), v, y, divides=False)[0]


def part_of(number: Any, k: int) -> Any:
    """A number divided by k, without the rounding of 1/k, in a third of the time of a division."""
    reciprocal = 1.0 / k
    rest = float(Fraction(1, k) - Fraction(reciprocal))
    return reciprocal * number + rest * number if rest else reciprocal * number


def expanded(
    s: Any, order: int, t: Any, lengths: tuple[Any, Any], v: Any, y: Any, *, divides: bool = True
) -> tuple[list[tuple[Any, Any]], list[Branch]]:
    """The Taylor coefficients, and the branches of functions that the rates are on.

    ``lengths`` are the unit of time in powers of which the coefficients are, and this over the step to which ``s`` is scaled.
    """
    book, (h, unit) = Book(divides=divides), lengths
    v, y = np.asarray(v), np.asarray(y)
    blocks = [in_array([Series(book, each, None) for each in block.flat], block.shape) for block in (v, y)]
    # Where members have steps of their own, each needs a time of its own, though all are equal at the start.
    each_its_own = np.broadcast_arrays(t, h)[0] if np.ndim(h) else t
    times = np.frompyfunc(lambda t: Series(book, t, None), 1, 1)(each_its_own)
    clocks = [(each, length) for each, length in np.broadcast(times, h)]
    rates = s.dv(times, *blocks), s.dy(times, *blocks)
    seeds = [each for block in blocks for each in block.flat]
    slopes = [
        each for rate, block in zip(rates, blocks, strict=True) for each in np.broadcast_to(as_objects(rate), block.shape).flat
    ]
    zero = t.number(0.0) if hasattr(t, "number") else 0.0
    result = []
    for k in range(order):
        book.advance(k)
        over = k + 1 if divides and (k + 1) & k else None  # of a power of two the reciprocal is exact
        by = None if k == 0 and _is(unit, 1.0) else unit if over is not None else unit * (1.0 / (k + 1))
        by_each: list[Any] = len(seeds) * [by]
        if by is not None and np.ndim(by):
            by_each = [each for block in blocks for each in np.broadcast_to(by, block.shape).flat]
        terms = []
        for seed, rate, factor in zip(seeds, slopes, by_each, strict=True):
            known = rate.terms[k] if isinstance(rate, Series) else (None if k else rate)
            term = known if known is None or factor is None else factor * known
            terms.append(term if term is None or over is None else part_of(term, over))
            seed.terms.append(terms[-1])
        for time, length in clocks:
            time.terms.append(length if k == 0 else None)
        numbers = [zero if term is None else term for term in terms]
        result.append((in_array(numbers[: v.size], v.shape), in_array(numbers[v.size :], y.shape)))
    return result, book.branches


def as_objects(x: Any) -> Any:
    """An array of objects."""
    if isinstance(x, np.ndarray):
        return x
    array = np.empty((), dtype=object)
    array[()] = x
    return array


def in_array(numbers: list[Any], shape: tuple[int, ...]) -> Any:
    """An array of that shape: of objects, unless all are numbers."""
    if all(isinstance(each, (float, complex, np.number)) for each in numbers):
        return np.array(numbers, dtype=np.result_type(np.float64, *{type(each) for each in numbers})).reshape(shape)
    array = np.empty(len(numbers), dtype=object)
    array[:] = numbers
    return array.reshape(shape)
