"""NumPy's functions for the scalars and arrays with which a user's function is run."""

from __future__ import annotations

import operator
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

import numpy as np

from ...errors import TraceError
from ...reference import functions, trig
from ...reference.functions.logarithms import logaddexp
from .values import (
    ARRAY_FUNCTIONS,
    COMPARISONS,
    Operators,
    Scalar,
    Truth,
    array,
    compared,
    elementwise,
    folded,
    objects,
    of_shape,
    value_of,
    wrapped,
)

#: Functions of numbers, which apply element by element, by NumPy's names.
_OWN = (
    "sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh exp exp2 expm1 log log2 "
    "log10 log1p sqrt cbrt hypot power square sign copysign floor ceil trunc round mod minimum maximum deg2rad rad2deg"
)
ELEMENTWISE: dict[str, Callable[..., Any]] = {name: getattr(functions, name) for name in _OWN.split()}
ELEMENTWISE |= {
    "logaddexp": logaddexp,
    "absolute": functions.abs,
    "abs": functions.abs,
    "fabs": functions.abs,
    "rint": functions.round,
    "remainder": functions.mod,
    "float_power": functions.power,
    "pow": functions.power,
    "radians": functions.deg2rad,
    "degrees": functions.rad2deg,
    "asin": functions.arcsin,
    "acos": functions.arccos,
    "atan": functions.arctan,
    "atan2": functions.arctan2,
    "fmin": functions.minimum,
    "fmax": functions.maximum,
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "negative": operator.neg,
    "positive": operator.pos,
}

#: Functions that only move elements: NumPy's own, on arrays of objects.
_MOVING = (
    "atleast_1d atleast_2d broadcast_to column_stack concatenate diag diagonal dstack expand_dims flip fliplr flipud "
    "hstack moveaxis ravel repeat reshape roll rollaxis rot90 split array_split "
    "squeeze stack swapaxes take tile transpose tril triu vstack"
)
MOVING = {getattr(np, name) for name in _MOVING.split()}


#: True if sine and cosine are those of the built-in systems: see ``stepwell.system``.
QUICK_SINES: ContextVar[bool] = ContextVar("quick_sines", default=False)
_QUICK = {"sin": trig.sin, "cos": trig.cos}


def elementwise_named(name: str, *arguments: Any) -> Any:
    """The result of a function of numbers, by NumPy's name."""
    if name in _QUICK and QUICK_SINES.get():
        return elementwise(name, _QUICK[name], *arguments)
    if name in COMPARISONS:
        return compared(name, *arguments)
    if name in ("divide", "true_divide"):
        return folded(operator.truediv, map(_as_operand, arguments))
    if name == "floor_divide":
        return folded(operator.floordiv, map(_as_operand, arguments))
    if name == "reciprocal":
        return 1.0 / _as_operand(arguments[0])
    if name in ("logical_and", "bitwise_and"):
        return folded(operator.and_, _values_first(arguments))
    if name in ("logical_or", "bitwise_or"):
        return folded(operator.or_, _values_first(arguments))
    if name in ("logical_not", "invert"):
        return ~arguments[0]
    if name == "matmul":
        return matmul(*arguments)
    if name not in ELEMENTWISE:
        raise unknown(name)
    return elementwise(name, ELEMENTWISE[name], *arguments)


def unknown(name: str) -> TraceError:
    """The error for a function that own equations do not have; its message names the nearest ones."""
    import difflib  # needed for errors only

    known = sorted({*ELEMENTWISE, *FUNCTIONS, *(each.__name__ for each in MOVING)})
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5) or ["sin", "exp", "where", "sum", "dot"]
    return TraceError(
        f"there is no np.{name} for own equations; near it: {', '.join(f'np.{each}' for each in near)}. "
        f"stepwell.equations.functions() lists all"
    )


def _as_operand(x: Any) -> Any:
    return x if isinstance(x, Operators) else array(x) if np.ndim(x) else Scalar(float(x))


def _values_first(arguments: Any) -> list[Any]:
    """Values before numbers and arrays of NumPy, which would ask the values again."""
    return sorted(arguments, key=lambda each: not isinstance(each, Operators))


def ufunc_of(ufunc: Any, method: str, arguments: Any, options: Any) -> Any:
    """The result of an element-by-element function of NumPy."""
    if options:
        raise TraceError(f"np.{ufunc.__name__}: own equations do not have {', '.join(options)}=, and no array can be written to")
    if method != "__call__":
        raise TraceError(f"own equations do not have np.{ufunc.__name__}.{method}; write np.sum, np.prod or a loop")
    return elementwise_named(ufunc.__name__, *arguments)


def function_of(function: Any, arguments: Any, options: Any) -> Any:
    """The result of another function of NumPy."""
    name = getattr(function, "__name__", str(function))
    if function in MOVING:
        return _moved(function, arguments, options)
    if name in ELEMENTWISE and not options:
        return elementwise_named(name, *arguments)
    if name not in FUNCTIONS:
        raise unknown(name)
    try:
        if name in _OF_ARRAYS and isinstance(arguments[0], Scalar):
            raise of_shape(f"np.{name}: expected an array, got one number")
        return FUNCTIONS[name](*arguments, **options)
    except TypeError as error:
        raise TraceError(f"np.{name}: {error}") from None


#: Functions of these that turn a number into an array.
_WIDENING = {np.atleast_1d, np.atleast_2d, np.broadcast_to, np.expand_dims, np.repeat, np.tile}


def _moved(function: Any, arguments: Any, options: Any) -> Any:
    if arguments and isinstance(arguments[0], Scalar) and function not in _WIDENING:
        raise of_shape(f"np.{function.__name__}: expected an array, got one number")

    def plain(x: Any) -> Any:
        if isinstance(x, Operators):
            return objects(x)
        if isinstance(x, (list, tuple)) and any(isinstance(each, (Operators, list, tuple)) for each in x):
            return type(x)(map(plain, x))
        return x

    result = function(*map(plain, arguments), **options)
    return [wrapped(each) for each in result] if isinstance(result, list) else wrapped(result)


def reduced(name: str, function: Callable[[Any, Any], Any], x: Any, axis: Any, keepdims: bool) -> Any:
    """The elements along an axis, several axes or all, combined by a function of two from the first to the last."""
    if isinstance(x, Scalar):
        raise of_shape(f"np.{name}: expected an array, got one number")
    items = array(x).items
    axes = tuple(range(items.ndim)) if axis is None else tuple(_axis(name, int(each), items.ndim) for each in np.atleast_1d(axis))
    rest = tuple(each for each in range(items.ndim) if each not in axes)
    shape = [items.shape[each] for each in rest]
    if 0 in items.shape:
        raise TraceError(f"np.{name}: expected at least one element, got shape {items.shape}")
    rows = items.transpose(*axes, *rest).reshape(-1, *shape)
    result = folded(function, (wrapped(row) for row in rows))
    if not keepdims:
        return result
    return wrapped(objects(result).reshape([1 if each in axes else items.shape[each] for each in range(items.ndim)]))


def _axis(name: str, axis: int, axes: int) -> int:
    if not -axes <= axis < axes:
        raise of_shape(f"np.{name}: axis {axis} is out of bounds for an array of {axes} axes")
    return axis % axes


def _reduction(name: str) -> Callable[..., Any]:
    def of_array(a: Any, axis: Any = None, *, keepdims: bool = False) -> Any:
        if isinstance(a, Scalar):
            raise of_shape(f"np.{name}: expected an array, got one number")
        return getattr(array(a), name)(axis=axis, keepdims=keepdims)

    return of_array


def where(condition: Any, a: Any = None, b: Any = None) -> Any:
    """One of two values, element by element, chosen by a comparison."""
    if a is None or b is None:
        raise TraceError("np.where: expected a condition and two values")
    items = [objects(each) for each in (condition, a, b)]
    if any(each.ndim for each in items):
        return wrapped(np.frompyfunc(where, 3, 1)(*items))
    truth, yes, no = (each[()] for each in items)
    if not isinstance(truth, (Truth, bool, np.bool_)):
        raise TraceError("np.where: expected a comparison such as y > 0 as the condition, got a number; write y != 0")
    if not isinstance(truth, Truth) or isinstance(truth.value, bool):
        chosen = yes if (truth.value if isinstance(truth, Truth) else truth) else no
        return wrapped(chosen)
    return elementwise("where", lambda yes, no: functions.where(truth.value, yes, no), yes, no)


def clip(a: Any, a_min: Any = None, a_max: Any = None, *, min: Any = None, max: Any = None) -> Any:
    """The values limited to a range; NaN stays NaN."""
    least, most = (a_min if min is None else min), (a_max if max is None else max)
    a = a if least is None else elementwise("maximum", functions.maximum, a, least)
    return a if most is None else elementwise("minimum", functions.minimum, a, most)


#: The most products of a matrix that are traced; so many take a second or two.
MOST_PRODUCTS = 1_000_000


def dot(a: Any, b: Any) -> Any:
    """As ``np.dot`` of arrays of one or two axes: sums of products, from the first to the last."""
    if np.ndim(objects(a)) == 0 or np.ndim(objects(b)) == 0:
        raise of_shape("np.dot: expected arrays, got one number; write a · b as a * b")
    return matmul(a, b)


def matmul(a: Any, b: Any) -> Any:
    """A @ b of arrays of one or two axes: sums of products, from the first to the last."""
    left, right = array(a).items, array(b).items
    if left.ndim not in (1, 2) or right.ndim not in (1, 2):
        raise of_shape(f"@: expected arrays of one or two axes, got shapes {left.shape} and {right.shape}")
    rows = left if left.ndim == 2 else left[np.newaxis]
    columns = right.T if right.ndim == 2 else right[np.newaxis]
    if rows.shape[1] != columns.shape[1]:
        raise of_shape(f"@: shapes {left.shape} and {right.shape} do not fit")
    if (products := len(rows) * len(columns) * rows.shape[1]) > MOST_PRODUCTS:
        raise TraceError(
            f"@: shapes {left.shape} and {right.shape} make {products} products, which are written out one by one; up to "
            f"{MOST_PRODUCTS} can be traced. A linear system as large as that is sw.LinearSystem"
        )
    sums = np.empty((len(rows), len(columns)), dtype=object)
    # Plain values take a tenth of the time of scalars.
    row_values, column_values = ([[value_of(each) for each in part] for part in parts] for parts in (rows, columns))
    for i, row in enumerate(row_values):
        for j, column in enumerate(column_values):
            sums[i, j] = Scalar(folded(operator.add, map(operator.mul, row, column)))
    return wrapped(sums.reshape([n for n, items in ((len(rows), left), (len(columns), right)) if items.ndim == 2]))


def cross(a: Any, b: Any) -> Any:
    """As ``np.cross`` of vectors along the last axis, in space or in the plane, where the product is one number."""
    a, b = array(a), array(b)
    sizes = a.shape[-1], b.shape[-1]
    if sizes == (2, 2):
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    if sizes != (3, 3):
        raise TraceError(
            f"np.cross: expected two or three coordinates along the last axis of both, got {sizes[0]} and {sizes[1]}"
        )
    parts = [a[..., i] * b[..., j] - a[..., j] * b[..., i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(parts, axis=-1)


def outer(a: Any, b: Any) -> Any:
    """The products of each element of one array with each of the other."""
    return array(a).ravel().reshape(-1, 1) * array(b).ravel().reshape(1, -1)


def norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    """The length: the root of the sum of squares."""
    if isinstance(x, Scalar):
        raise of_shape("np.linalg.norm: expected an array, got one number; write abs")
    x = array(x)
    if ord not in (None, 2) or (axis is None and x.ndim > 1 and ord is not None):
        raise TraceError("np.linalg.norm: own equations have only the length, the root of the sum of squares")
    return np.sqrt((x * x).sum(axis=axis, keepdims=keepdims))


def diff(a: Any, n: int = 1, axis: int = -1) -> Any:
    """Differences of neighbours along an axis."""
    items = array(a).items
    for _ in range(n):
        upper = wrapped(np.take(items, range(1, items.shape[axis]), axis))
        items = objects(upper - wrapped(np.take(items, range(items.shape[axis] - 1), axis)))
    return wrapped(items)


def cumsum(a: Any, axis: Any = None) -> Any:
    """The sums from the first element to each."""
    items = np.moveaxis(array(a).items, axis, 0) if axis is not None else array(a).items.reshape(-1)
    rows = [wrapped(items[0])]
    for row in items[1:]:
        rows.append(rows[-1] + wrapped(row))
    return np.moveaxis(np.stack(rows), 0, axis or 0) if array(rows[0] if rows else a).ndim else np.stack(rows)


#: The most points of a table; each makes four operations of a step.
MOST_POINTS = 256


def interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None) -> Any:
    """As ``np.interp``: straight lines between the points of a table whose ``xp`` are known numbers."""
    if period is not None:
        raise TraceError("np.interp: own equations do not have period=; write np.mod(x, period)")
    places = objects(xp)
    values = objects(fp)
    if any(value_of(each) is None or not isinstance(value_of(each), float) for each in places.flat):
        raise TraceError("np.interp: expected known numbers as the places xp, got some that depend on the state or parameters")
    at = np.array([value_of(each) for each in places.flat])
    if places.ndim != 1 or values.shape != places.shape or not len(at):
        raise of_shape(
            f"np.interp: expected xp and fp of one length along one axis, got shapes {places.shape} and {values.shape}"
        )
    if not (np.diff(at) > 0.0).all():
        raise TraceError("np.interp: expected places xp that ascend")
    if len(at) > MOST_POINTS:
        raise TraceError(
            f"np.interp: expected a table of at most {MOST_POINTS} points, each of which makes operations of a step, got "
            f"{len(at)}; a table of the time is a parameter: sw.Sampled(values, interval, start, interpolation='linear')"
        )
    return elementwise(
        "interp", lambda x: _on_lines(x, at, [value_of(each) for each in values], value_of(left), value_of(right)), x
    )


def _on_lines(x: Any, at: Any, values: list[Any], left: Any, right: Any) -> Any:
    place, value, slope = at[0], values[0] if left is None else left, 0.0
    for i in range(len(at) - 1):
        after = x >= at[i]
        place, value, slope = (
            functions.where(after, yes, no)
            for yes, no in ((at[i], place), (values[i], value), ((values[i + 1] - values[i]) / (at[i + 1] - at[i]), slope))
        )
    after = x > at[-1] if right is not None else x >= at[-1]
    place, value, slope = (
        functions.where(after, yes, no)
        for yes, no in ((at[-1], place), (values[-1] if right is None else right, value), (0.0, slope))
    )
    return slope * (x - place) + value


def zeros_like(a: Any, dtype: Any = None) -> Any:
    """An array of zeros of the same shape; nothing can be written to it."""
    return np.zeros(np.shape(objects(a)))


def ones_like(a: Any, dtype: Any = None) -> Any:
    """An array of ones of the same shape."""
    return np.ones(np.shape(objects(a)))


def full_like(a: Any, fill_value: Any, dtype: Any = None) -> Any:
    """An array of one value, of the same shape."""
    return wrapped(np.broadcast_to(objects(fill_value), np.shape(objects(a))))


#: Functions of arrays, by NumPy's names.
FUNCTIONS: dict[str, Any] = {
    "where": where,
    "clip": clip,
    "dot": dot,
    "vdot": dot,
    "inner": dot,
    "cross": cross,
    "outer": outer,
    "norm": norm,
    "diff": diff,
    "interp": interp,
    "cumsum": cumsum,
    "zeros_like": zeros_like,
    "empty_like": zeros_like,
    "ones_like": ones_like,
    "full_like": full_like,
    "shape": lambda a: np.shape(objects(a)),
    "ndim": lambda a: np.ndim(objects(a)),
    "size": lambda a: np.size(objects(a)),
    "copy": lambda a: a,
    "real": lambda a: a,
    "trace": lambda a: reduced("sum", operator.add, np.diagonal(a), None, False),
} | {name: _reduction(name) for name in ("sum", "prod", "mean", "min", "max", "all", "any")}
#: Functions that accept arrays only; NumPy's accept a number, too.
_OF_ARRAYS = {"inner", "vdot", "outer", "diff", "cumsum", "size", "trace", "amin", "amax"}
FUNCTIONS |= {"amin": FUNCTIONS["min"], "amax": FUNCTIONS["max"]}


def names() -> list[str]:
    """The names of NumPy's functions that own equations may use."""
    moving = {each.__name__ for each in MOVING}
    return sorted(
        {*ELEMENTWISE, *FUNCTIONS, *COMPARISONS, *moving, "divide", "matmul", "logical_and", "logical_or", "logical_not"}
    )


ARRAY_FUNCTIONS.update(clip=clip, dot=dot, function_of=function_of, matmul=matmul, reduced=reduced, ufunc_of=ufunc_of)
