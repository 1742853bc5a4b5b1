"""The arguments with which a user's function is run, in place of the numbers and arrays of a state.

A ``Scalar`` holds one number: a symbol, which writes the tape of a step, or, for the NumPy reference, an array with that number
for every member of a batch. An ``Array`` holds scalars in a shape. Both behave like NumPy's arrays, with the operations in a
fixed order; for an operation that cannot be traced, the error says what to write instead.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from functools import partial, reduce
from typing import Any, NoReturn

import numpy as np

from ...base import checks
from ...errors import TraceError
from ...reference import bits, functions


def of_shape(text: str) -> TraceError:
    """The error of a function that was run with an array of a wrong shape; another shape may fit."""
    error = TraceError(text)
    error.of_shape = True
    return error


#: The functions of whole arrays, by name: ``arrays.py``, which builds on the classes below, puts them here.
ARRAY_FUNCTIONS: dict[str, Callable[..., Any]] = {}
#: Numbers that are known while a function is traced.
_KNOWN = (int, float, np.integer, np.floating)


def value_of(x: Any) -> Any:
    """The value of a scalar, or a known number as a float; None if it is neither."""
    if isinstance(x, Truth):
        return functions.where(x.value, 1.0, 0.0)
    if isinstance(x, Scalar):
        return x.value
    if isinstance(x, (bool, np.bool_)):
        return float(x)
    if isinstance(x, _KNOWN):
        return float(x)
    if isinstance(x, np.ndarray) and x.ndim == 0:
        return value_of(x.item())
    return None


def _mask(x: Any) -> Any:
    if isinstance(x, Truth):
        return x.value
    if isinstance(x, (bool, np.bool_)):
        return bool(x)
    raise TraceError("expected a comparison such as y > 0, got a number; write y != 0 to compare it with zero")


def _truth(x: Any) -> Truth:
    return x if isinstance(x, Truth) else Truth(_mask(x))


def elementwise(name: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """A function of numbers, applied to scalars and arrays element by element, as NumPy broadcasts them."""
    if not any(isinstance(each, (Array, np.ndarray, list, tuple)) and np.ndim(objects(each)) for each in arguments):
        values = [value_of(objects(each)[()] if isinstance(each, (Array, np.ndarray)) else each) for each in arguments]
        if any(value is None for value in values):
            wrong = next(each for each, value in zip(arguments, values, strict=True) if value is None)
            raise TraceError(f"{name}: expected numbers, got {type(wrong).__name__}")
        return Scalar(function(*values))

    def of_scalars(*scalars: Any) -> Any:
        return elementwise(name, function, *scalars)

    try:
        items = np.frompyfunc(of_scalars, len(arguments), 1)(*map(objects, arguments))
    except ValueError as error:
        raise of_shape(f"{name}: {error}") from None
    return wrapped(items)


def objects(x: Any) -> Any:
    """The elements of a value as an array of objects, without axes if the value has none."""
    if isinstance(x, Array):
        return x.items
    if isinstance(x, (list, tuple)):
        return array(x).items
    if isinstance(x, np.ndarray):
        return x.astype(object)
    item = np.empty((), dtype=object)
    item[()] = x
    return item


def wrapped(items: Any) -> Any:
    """An array of objects as an ``Array``; a single number as a ``Scalar``."""
    if not isinstance(items, np.ndarray):
        return items if isinstance(items, Scalar) or value_of(items) is None else Scalar(value_of(items))
    return Array(items) if items.ndim else wrapped(items[()])


def array(value: Any) -> Array:
    """The array of lists, tuples and arrays of numbers and scalars, as ``np.array`` makes it."""
    if isinstance(value, Array):
        return value
    if isinstance(value, (list, tuple)):
        parts = [objects(each) for each in value]
        shapes = {part.shape for part in parts}
        if len(shapes) > 1:
            raise of_shape(f"expected parts of one shape in an array, got shapes {', '.join(map(str, sorted(shapes)))}")
        items = np.empty((len(parts), *(shapes.pop() if shapes else ())), dtype=object)
        for i, part in enumerate(parts):
            items[i] = part if part.ndim else part[()]
        return Array(items)
    items = objects(value)
    for each in items.flat:
        if value_of(each) is None:
            remedy = f"; {checks.COMPLEX}" if isinstance(each, complex) else ""
            raise TraceError(f"expected numbers in an array, got {type(each).__name__}{remedy}")
    return Array(items)


class Operators:
    """Arithmetic, comparisons and NumPy's protocols, for scalars and arrays."""

    __slots__ = ()

    def __add__(self, other: Any) -> Any:
        return _operate("+", operator.add, self, other)

    def __radd__(self, other: Any) -> Any:
        return _operate("+", operator.add, other, self)

    def __sub__(self, other: Any) -> Any:
        return _operate("−", operator.sub, self, other)

    def __rsub__(self, other: Any) -> Any:
        return _operate("−", operator.sub, other, self)

    def __mul__(self, other: Any) -> Any:
        return _operate("·", operator.mul, self, other)

    def __rmul__(self, other: Any) -> Any:
        return _operate("·", operator.mul, other, self)

    def __truediv__(self, other: Any) -> Any:
        return _operate("/", _divided, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _operate("/", _divided, other, self)

    def __pow__(self, other: Any, modulus: None = None) -> Any:
        return _operate("**", functions.power, self, other)

    def __rpow__(self, other: Any) -> Any:
        return _operate("**", functions.power, other, self)

    def __mod__(self, other: Any) -> Any:
        return _operate("%", functions.mod, self, other)

    def __rmod__(self, other: Any) -> Any:
        return _operate("%", functions.mod, other, self)

    def __floordiv__(self, other: Any) -> Any:
        return _operate("//", _floored, self, other)

    def __rfloordiv__(self, other: Any) -> Any:
        return _operate("//", _floored, other, self)

    def __divmod__(self, other: Any) -> Any:
        return self // other, self % other

    def __matmul__(self, other: Any) -> Any:
        return ARRAY_FUNCTIONS["matmul"](self, other)

    def __rmatmul__(self, other: Any) -> Any:
        return ARRAY_FUNCTIONS["matmul"](other, self)

    def __neg__(self) -> Any:
        return elementwise("−", operator.neg, self)

    def __pos__(self) -> Any:
        return self

    def __abs__(self) -> Any:
        return elementwise("abs", functions.abs, self)

    def __round__(self, digits: int | None = None) -> Any:
        if digits:
            raise TraceError("round: expected no digits, so that numbers are rounded to whole ones")
        return elementwise("round", functions.round, self)

    def __floor__(self) -> Any:
        return elementwise("floor", functions.floor, self)

    def __ceil__(self) -> Any:
        return elementwise("ceil", functions.ceil, self)

    def __trunc__(self) -> Any:
        return elementwise("trunc", functions.trunc, self)

    def __lt__(self, other: Any) -> Any:
        return compared("less", self, other)

    def __le__(self, other: Any) -> Any:
        return compared("less_equal", self, other)

    def __gt__(self, other: Any) -> Any:
        return compared("greater", self, other)

    def __ge__(self, other: Any) -> Any:
        return compared("greater_equal", self, other)

    def __eq__(self, other: object) -> Any:
        return compared("equal", self, other)

    def __ne__(self, other: object) -> Any:
        return compared("not_equal", self, other)

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> NoReturn:
        raise TraceError(
            "a value that depends on the state, a parameter or the time has no truth value, because a step has no branches: "
            "in place of `if`, `and`, `or`, `not`, `while`, min() and max() write np.where(condition, a, b), &, |, ~, "
            "np.minimum and np.maximum"
        )

    def __float__(self) -> NoReturn:
        raise TraceError(
            "a value that depends on the state, a parameter or the time is no number yet, so it cannot become a float or be "
            "written into an array of numbers: leave float() out, and in place of out[i] = … write np.array([…]) or np.stack"
        )

    __int__ = __index__ = __complex__ = __float__

    def __getattr__(self, name: str) -> NoReturn:
        if not name.startswith("_") and hasattr(np.ndarray, name):
            known = ", ".join(each for each in dir(type(self)) if not each.startswith("_") and hasattr(np.ndarray, each))
            raise TraceError(f"own equations do not know .{name} of a value. Known: {known}")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __array_ufunc__(self, ufunc: Any, method: str, *arguments: Any, **options: Any) -> Any:
        return ARRAY_FUNCTIONS["ufunc_of"](ufunc, method, arguments, options)

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        return ARRAY_FUNCTIONS["function_of"](function, arguments, options)


def _operate(sign: str, function: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
    for each in (a, b):
        if not isinstance(each, (Operators, np.ndarray, list, tuple, bool, np.bool_, *_KNOWN)):
            return NotImplemented
    return elementwise(sign, function, a, b)


def _divided(a: Any, b: Any) -> Any:
    return np.float64(a) / b if isinstance(a, float) and isinstance(b, (float, np.ndarray)) else a / b


def _floored(a: Any, b: Any) -> Any:
    return functions.floor(_divided(a, b))


def _equal(a: Any, b: Any) -> Any:
    return bits.equal(b, a) if bits.is_symbol(b) else bits.equal(a, b)


def inverted(mask: Any) -> Any:
    """The negation of a mask."""
    return not mask if isinstance(mask, bool) else ~mask


#: Comparisons by NumPy's names. A NaN is unequal to everything, and neither below nor above anything.
COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    "less": lambda a, b: a < b,
    "less_equal": lambda a, b: a <= b,
    "greater": lambda a, b: a > b,
    "greater_equal": lambda a, b: a >= b,
    "equal": _equal,
    "not_equal": lambda a, b: inverted(_equal(a, b)),
}


def compared(name: str, a: Any, b: Any) -> Any:
    """A comparison of scalars and arrays, element by element."""
    for each in (a, b):
        if not isinstance(each, (Operators, np.ndarray, list, tuple, bool, np.bool_, *_KNOWN)):
            return NotImplemented
    if all(np.ndim(objects(each)) == 0 for each in (a, b)):
        a, b = (Scalar(value_of(objects(each)[()])) for each in (a, b))
        margin = {"l": lambda: b - a, "g": lambda: a - b}.get(name[0])
        return Truth(COMPARISONS[name](a.value, b.value), margin)
    return wrapped(np.frompyfunc(lambda a, b: compared(name, a, b), 2, 1)(objects(a), objects(b)))


class Scalar(Operators):
    """One number: of the state, a parameter, the time, or computed from them."""

    __slots__ = ("value",)
    shape: tuple[int, ...] = ()
    ndim = 0
    size = 1

    def __init__(self, value: Any) -> None:
        self.value = value

    def __repr__(self) -> str:
        return "<a value that is not known before the run>"

    @property
    def real(self) -> Scalar:
        """Itself."""
        return self

    def copy(self) -> Scalar:
        """Itself, for nothing can be written to it."""
        return self

    def item(self) -> Scalar:
        """Itself."""
        return self


class Truth(Scalar):
    """The truth of a comparison. In arithmetic it is 1 or 0, as in NumPy.

    ``margin()`` is a number that is above zero where it is true, and below where it is not; None for equalities.
    """

    __slots__ = ("margin",)

    def __init__(self, value: Any, margin: Callable[[], Any] | None = None) -> None:
        super().__init__(value)
        self.margin = margin

    def __and__(self, other: Any) -> Any:
        return self._with("&", operator.and_, other)

    def __or__(self, other: Any) -> Any:
        return self._with("|", operator.or_, other)

    def __xor__(self, other: Any) -> Any:
        return (self | other) & ~(self & other)

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__

    def __invert__(self) -> Truth:
        margin = self.margin
        return Truth(inverted(self.value), margin and (lambda: -margin()))

    def _with(self, sign: str, function: Callable[[Any, Any], Any], other: Any) -> Any:
        if isinstance(other, Array):
            return NotImplemented
        mask = _mask(other)
        if isinstance(mask, bool):  # a mask of symbols cannot be combined with booleans
            return self if mask == (sign == "&") else Truth(mask)
        if isinstance(self.value, bool):
            return other._with(sign, function, self)
        one, two = self.margin, other.margin
        less = functions.minimum if sign == "&" else functions.maximum
        margin = None if one is None or two is None else lambda: elementwise(sign, less, one(), two())
        return Truth(function(self.value, mask), margin)


class Array(Operators):
    """Scalars in a shape, as a NumPy array holds numbers. Nothing can be written to it."""

    __slots__ = ("items",)
    __array_priority__ = 1000

    def __init__(self, items: Any) -> None:
        self.items = items

    def __repr__(self) -> str:
        return f"<an array of shape {self.shape} whose values are not known before the run>"

    @property
    def shape(self) -> tuple[int, ...]:
        """The lengths of its axes."""
        shape: tuple[int, ...] = self.items.shape
        return shape

    @property
    def ndim(self) -> int:
        """How many axes it has."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """How many elements it has."""
        return int(self.items.size)

    @property
    def dtype(self) -> np.dtype[np.float64]:
        """The data type of its numbers, float64."""
        return np.dtype(np.float64)

    @property
    def T(self) -> Array:  # noqa: N802
        """Its axes in reverse order."""
        return Array(self.items.T)

    @property
    def real(self) -> Array:
        """Itself."""
        return self

    @property
    def flat(self) -> Iterator[Any]:
        """Its elements."""
        return iter(self.ravel())

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Any]:
        return (wrapped(each) for each in self.items)

    def __getitem__(self, index: Any) -> Any:
        if _symbolic(index):
            raise TraceError(
                "an index that depends on the state is not known before the run: choose by np.where, or multiply by a comparison"
            )
        return wrapped(self.items[index])

    def __setitem__(self, index: Any, value: Any) -> NoReturn:
        raise TraceError(
            "the state, and arrays computed from it, cannot be written to: write np.array([…]), np.stack or np.where"
        )

    def __and__(self, other: Any) -> Any:
        return self._truths(operator.and_, other)

    def __or__(self, other: Any) -> Any:
        return self._truths(operator.or_, other)

    def __xor__(self, other: Any) -> Any:
        return self._truths(operator.xor, other)

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__

    def __invert__(self) -> Any:
        return wrapped(np.frompyfunc(lambda each: ~_truth(each), 1, 1)(self.items))

    def _truths(self, function: Callable[[Any, Any], Any], other: Any) -> Any:
        return wrapped(np.frompyfunc(lambda a, b: function(_truth(a), b), 2, 1)(self.items, objects(other)))

    def copy(self) -> Array:
        """Itself, for nothing can be written to it."""
        return self

    def reshape(self, *shape: Any) -> Any:
        """Return the same elements in another shape."""
        return wrapped(self.items.reshape(*shape))

    def ravel(self) -> Array:
        """Its elements along one axis."""
        return Array(self.items.reshape(-1))

    flatten = ravel

    def transpose(self, *axes: Any) -> Array:
        """Its axes in another order."""
        return Array(self.items.transpose(*axes))

    def squeeze(self, axis: Any = None) -> Any:
        """Without axes of length one."""
        return wrapped(self.items.squeeze(axis))

    def tolist(self) -> Any:
        """Its elements as lists."""
        return [each.tolist() if isinstance(each, Array) else each for each in self]

    def sum(self, axis: Any = None, keepdims: bool = False) -> Any:
        """The sum, from the first element to the last."""
        return ARRAY_FUNCTIONS["reduced"]("sum", operator.add, self, axis, keepdims)

    def prod(self, axis: Any = None, keepdims: bool = False) -> Any:
        """The product, from the first element to the last."""
        return ARRAY_FUNCTIONS["reduced"]("prod", operator.mul, self, axis, keepdims)

    def mean(self, axis: Any = None, keepdims: bool = False) -> Any:
        """The sum divided by the number of elements."""
        count = self.size if axis is None else np.prod([self.shape[each] for each in np.atleast_1d(axis)])
        return self.sum(axis, keepdims) / float(count)

    def min(self, axis: Any = None, keepdims: bool = False) -> Any:
        """The smallest element; NaN if one is NaN."""
        return ARRAY_FUNCTIONS["reduced"]("min", partial(elementwise, "minimum", functions.minimum), self, axis, keepdims)

    def max(self, axis: Any = None, keepdims: bool = False) -> Any:
        """The largest element; NaN if one is NaN."""
        return ARRAY_FUNCTIONS["reduced"]("max", partial(elementwise, "maximum", functions.maximum), self, axis, keepdims)

    def all(self, axis: Any = None, keepdims: bool = False) -> Any:
        """True where all comparisons are true."""
        return ARRAY_FUNCTIONS["reduced"]("all", operator.and_, self, axis, keepdims)

    def any(self, axis: Any = None, keepdims: bool = False) -> Any:
        """True where some comparison is true."""
        return ARRAY_FUNCTIONS["reduced"]("any", operator.or_, self, axis, keepdims)

    def dot(self, other: Any) -> Any:
        """As ``np.dot``."""
        return ARRAY_FUNCTIONS["dot"](self, other)

    def clip(self, least: Any = None, most: Any = None) -> Any:
        """As ``np.clip``."""
        return ARRAY_FUNCTIONS["clip"](self, least, most)


def _symbolic(index: Any) -> bool:
    """True if an index is or contains a value that is not known yet."""
    if isinstance(index, (tuple, list)):
        return any(map(_symbolic, index))
    return isinstance(index, Operators)


def folded(function: Callable[[Any, Any], Any], parts: Any) -> Any:
    """The parts combined by a function of two, from the first to the last."""
    return reduce(function, parts)
