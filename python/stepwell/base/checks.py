"""Checks of users' arguments, before any work. Each raises one clear error, or returns the argument in a form to compute with."""

from __future__ import annotations

import operator
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from functools import wraps
from itertools import islice
from math import isfinite, prod
from numbers import Real
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from .. import _core
from ..errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, TooLargeError, UnknownNameError
from . import buffer_pool
from .arrays import Array as Array
from .arrays import Shape, Whole
from .reprs import counted

if TYPE_CHECKING:
    from inspect import Signature


Word = TypeVar("Word", bound=str)
P = ParamSpec("P")
R = TypeVar("R")

#: Step numbers above this are no longer exact as floating-point numbers, so neither would be t = t0 + k·dt.
LAST_STEP = 2**53

#: The most batch axes. Older versions of NumPy have 32 axes in all; blocks, saved states, outputs, nodes and inputs need some.
MOST_AXES = 24

#: Arrays of fewer bytes are not checked to fit in memory: a check takes as long as filling some hundred kilobytes.
_FEW_BYTES = 1 << 24

#: The most elements of a list of names, functions or pairs; a range or a broadcast array takes memory only as a list.
MOST_OF_A_LIST = 1_000_000


def known(argument: str, name: object, names: Iterable[Word]) -> Word:
    """Return ``name`` if it is one of ``names``; the message of the error has the nearest one."""
    if type(name) is str and type(names) is tuple and name in names:
        return name  # type: ignore[return-value]
    names = tuple(names)
    if isinstance(name, np.ndarray) and name.ndim == 0 and name.dtype.kind == "U":
        name = name.item()  # a string that was read from a file of arrays
    if isinstance(name, str) and name in names:
        return str(name)  # type: ignore[return-value]
    import difflib  # a mistake may take its time; the import of stepwell may not

    near = difflib.get_close_matches(short(name).strip("'").lower().replace(" ", "_").replace("-", "_"), names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    raise UnknownNameError(f"{argument}: there is no {short(name)}{hint} Known: {', '.join(names) or 'none'}.")


def with_hints(hints: Mapping[str, str]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a function say by these hints what arguments of other packages, which it does not have, are called here."""

    def of(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def called(*args: P.args, **named: P.kwargs) -> R:
            if not hints.keys().isdisjoint(named):
                name = next(name for name in named if name in hints)
                raise UnknownNameError(f"{name}: {function.__name__} has no such argument; {hints[name]}")
            return function(*args, **named)

        return called

    return of


def numbers(argument: str, value: Any, *, positive: bool = False, finite: bool = True, unit: str = "") -> Array:
    """Return ``value`` as float64 if it is real, and as the options say finite and positive."""
    if type(value) is float and isfinite(value) and (not positive or value > 0.0):
        return np.array(value)  # the most frequent case: nothing more to check
    if type(value) is np.ndarray and _core.sound(value, finite, positive):
        return value  # likewise; the checks below find what is wrong with other arrays
    if type(value) is np.ndarray and value.nbytes > _FEW_BYTES and 0 in value.strides:
        _room(argument, value.shape)
        once = numbers(argument, once_of(value), positive=positive, finite=finite, unit=unit)
        return np.broadcast_to(once, value.shape)
    if type(value) is np.ndarray and value.dtype == np.float32 and _core.sound(wide := _widened(value), finite, positive):
        return wide
    array: Array = as_array(argument, value)
    if type(value) is not np.ndarray and (masked := _masked(value)):
        raise ArgumentError(f"{argument}: expected numbers{_in(unit)}, got a masked array in which {masked} are masked")
    if _core.sound(array, finite, positive):
        return array  # such as a list of floats
    if array.dtype.kind == "O":
        array = _exact(argument, array)
    if array.dtype.kind not in "iuf":
        parts = f"; {COMPLEX}" if array.dtype.kind == "c" else ""
        raise DTypeError(f"{argument}: expected real numbers{_in(unit)}, got {_kind(value, array)}{parts}")
    if array.dtype != np.float64 or not array.dtype.isnative:
        _room(argument, array.shape)
        with np.errstate(over="ignore"):  # numbers beyond the range become infinite, and are refused below
            array = array.astype(np.float64)
    if not array.flags.aligned:
        array = array.copy()
    # One check of the whole array; only if it fails, the wrong element is searched.
    if finite and not np.isfinite(array).all():
        wrong = ~np.isfinite(array)
        raise NotFiniteError(f"{argument}: expected finite numbers{_in(unit)}, got {array[wrong][0]}{_where(wrong)}")
    if positive and (wrong := array <= 0).any():
        raise ArgumentError(f"{argument}: expected numbers above zero{_in(unit)}, got {array[wrong][0]:g}{_where(wrong)}")
    return array


def as_array(argument: str, value: Any) -> Any:
    """The argument as an array of any dtype; for another library's array, NumPy's array over the same memory."""
    if hasattr(value, "__dlpack__") and not isinstance(value, np.ndarray):
        return shared(argument, value)
    if not isinstance(value, np.ndarray) or 0 in value.strides:
        _room(argument, _nested(value))
    try:
        return np.asarray(value)
    except RuntimeError as error:
        if isinstance(error, RecursionError):
            raise ShapeError(
                f"{argument}: expected a number or a regular array, got a {type(value).__name__} of itself"
            ) from None
        raise _foreign(argument, value, error) from None
    except (ValueError, TypeError, BufferError, UserWarning) as error:  # masked numbers in a list cause a warning
        raise ShapeError(f"{argument}: expected a number or a regular array, got {type(value).__name__} ({error})") from None


def once_of(array: Any) -> Any:
    """The part of an array that is repeated along its broadcast axes."""
    return array[tuple(slice(None) if stride else slice(0, 1) for stride in array.strides)] if array.size else array


def _nested(value: Any) -> Shape:
    """The shape of nested lists, by the first element of each, so that their memory is known before it is used."""
    shape: Shape = ()
    while len(shape) < MOST_AXES and isinstance(value, (list, tuple, range)) and len(value):
        shape, value = (*shape, len(value)), value[0]
    return (*shape, *value.shape) if isinstance(value, np.ndarray) else shape


def _room(argument: str, shape: Shape) -> None:
    """Raise if an array of floats of that shape does not fit in memory."""
    needed = 8.0 * prod(shape)
    if needed <= _FEW_BYTES:
        return
    from .available_memory import available_memory, in_bytes  # the import of stepwell does without

    available, bound = available_memory()
    if needed > available:
        raise TooLargeError(
            f"{argument}: expected an array that fits in memory, got shape {shape}: {in_bytes(needed)} as floats, but "
            f"{in_bytes(max(available, 0.0))} are available ({bound})"
        )


def _widened(value: Any) -> Array:
    """An array of float32 as float64, in pooled memory, since new pages take longer than filling them."""
    wide: Array = buffer_pool.empty(value.shape)
    wide[...] = value
    return wide


def shared(argument: str, value: Any) -> Any:
    """NumPy's array over the memory of an array of another library, such as PyTorch or JAX."""
    try:
        return np.from_dlpack(value)
    except Exception as error:  # each library raises another kind
        raise _foreign(argument, value, error) from None


def _foreign(argument: str, value: Any, error: Exception) -> DTypeError:
    """The error for an array of another library that NumPy cannot take, or for a list of them."""
    why = str(error).strip().splitlines() or [type(error).__name__]
    kind = type(value).__name__ if type(value).__module__ == "builtins" else f"{type(value).__module__}.{type(value).__name__}"
    return DTypeError(
        f"{argument}: expected an array in the memory of the CPU, of a type that NumPy has and without gradients, got "
        f"{kind} ({short(why[0])[1:-1]}); convert it first: PyTorch's by .detach().cpu().double(), JAX's by jax.device_get "
        f"outside of jax.jit"
    )


def _masked(value: Any) -> int:
    """How many numbers of an array are masked. ``numpy.ma`` is slow to import, and before its import no array is masked."""
    ma = sys.modules.get("numpy.ma")
    return int(ma.getmaskarray(value).sum()) if ma is not None and isinstance(value, ma.MaskedArray) else 0


def not_negative(argument: str, value: Any, what: str = "numbers") -> Array:
    """Return ``value`` as float64, if it is zero or more."""
    array = numbers(argument, value)
    if (wrong := array < 0).any():
        raise ArgumentError(f"{argument}: expected {what} of zero or more, got {array[wrong].min():g}")
    return array


def _exact(argument: str, array: Any) -> Any:
    """An array of Python objects as floats if all are real numbers, such as ints of more than 64 bits; else the array itself."""
    if not all(isinstance(each, Real) and not isinstance(each, bool) for each in array.flat):
        return array
    try:
        return array.astype(np.float64)
    except OverflowError:
        raise NotFiniteError(
            f"{argument}: expected numbers of at most {np.finfo(np.float64).max:.3g}, got a larger one"
        ) from None


def number(argument: str, value: Any, *, positive: bool = False, unit: str = "") -> float:
    """Return ``value`` as one float."""
    if type(value) is float and isfinite(value) and (not positive or value > 0.0):
        return value
    array = numbers(argument, value, positive=positive, unit=unit)
    if array.ndim:
        raise ShapeError(f"{argument}: expected one number{_in(unit)}, got an array of shape {array.shape}")
    return float(array)


def beginning(value: Any) -> Any:
    """Return ``t0`` as one float, or as a new array of the times of a batch; −0 becomes +0, as 0 + k·dt is."""
    if type(value) is float and isfinite(value):
        return value + 0.0
    times: Any = numbers("t0", value, unit="units of time") + 0.0
    return times if np.ndim(times) else float(times)


def step(value: Any) -> float:
    """Return ``dt`` as one float other than zero; with ``dt`` below zero time runs back."""
    if type(value) is float and isfinite(value) and value != 0.0:
        return value
    dt = number("dt", value, unit="units of time")
    if dt == 0.0:
        raise ArgumentError("dt: expected a number other than zero in units of time, got 0")
    return dt


def count(argument: str, value: Any, least: int, most: int = LAST_STEP) -> int:
    """Return ``value`` as a whole number in ``least … most``."""
    if type(value) is int and least <= value <= most:
        return value
    try:
        n = operator.index(value)
    except TypeError:
        raise DTypeError(f"{argument}: expected a whole number, got {short(value)} ({type(value).__name__})") from None
    if isinstance(value, (bool, np.bool_)):
        raise DTypeError(f"{argument}: expected a whole number, got {value!r} (bool)")
    if _masked(value):
        raise ArgumentError(f"{argument}: expected a whole number, got a masked one")
    if not least <= n <= most:
        raise ArgumentError(f"{argument}: expected {least} or more{'' if n < least else f', up to {most}'}, got {short(n)}")
    return n


#: The direction in which a quantity passes a level, as a word and as SciPy's number.
DIRECTIONS = {"rising": 1, "falling": -1, "both": 0}


def direction(argument: str, value: Any) -> int:
    """Return a direction, which may be a word, as 1, −1 or 0."""
    return DIRECTIONS[known(argument, value, DIRECTIONS)] if isinstance(value, str) else count(argument, value, -1, 1)


def several(argument: str, value: Any, what: str) -> list[Any]:
    """Return the elements of an iterable as a list; a string is not a list of its letters."""
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable) or getattr(value, "ndim", 1) == 0:
        raise DTypeError(f"{argument}: expected a list of {what}, got {short(value)} ({type(value).__name__})")
    try:
        too_many = isinstance(value, Sized) and len(value) > MOST_OF_A_LIST
        several = [] if too_many else list(islice(value, MOST_OF_A_LIST + 1))
    except NotImplementedError:  # a memoryview of several axes is iterable, and does not iterate
        raise DTypeError(f"{argument}: expected a list of {what}, got a {type(value).__name__} of several axes") from None
    if too_many or len(several) > MOST_OF_A_LIST:
        raise TooLargeError(f"{argument}: expected a list of at most {MOST_OF_A_LIST} {what}, got more in {short(value)}")
    return several


def callback(argument: str, value: Any) -> Any:
    """Return ``value`` if it is a function or None."""
    if value is not None and not callable(value):
        raise DTypeError(f"{argument}: expected a function or None, got {short(value)} ({type(value).__name__})")
    return value


def argument_order(argument: str, function: Any, places: Sequence[str], signature: Signature | None = None) -> None:
    """Raise if a function of time and state has them in another order, as its argument names show: it would get other numbers.

    Args:
        argument: the argument of the caller that is the function.
        function: a function that is called with the time and blocks of the state by position; one without a signature passes.
        places: the name of each position, such as ``("t", "v", "y")``. A state without velocities may be called v.
        signature: the signature of the function, if it is known.
    """
    import inspect  # slow to import, and only functions need it

    try:
        signature = signature or inspect.signature(function)
    except (TypeError, ValueError):  # a function that is not written in Python may have no signature
        return
    by_place = [each for each in signature.parameters.values() if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]
    names = [each.name for each in by_place[: len(places)]]
    for name, place in zip(names, places, strict=False):
        others = {"t", "v", "y"} if place == "t" or "v" in places else {"t", "y"}
        if name in others - {place}:
            raise ArgumentError(
                f"{argument}: expected a function f({', '.join(places)}), got ({', '.join(names)}): {name} stands "
                f"at the place of {place}; put the arguments in this order, or give {name} another name if it means {place}"
            )


def flag(argument: str, value: Any) -> bool:
    """Return ``value`` if it is True or False."""
    if value is False or value is True:
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind == "b":
        value = value.item()  # it was read from a file of arrays
    if not isinstance(value, (bool, np.bool_)):
        raise DTypeError(f"{argument}: expected True or False, got {short(value)} ({type(value).__name__})")
    return bool(value)


def block(argument: str, value: Any, shape: Shape, axes: str, *, finite: bool = True) -> Array:
    """Return a state block whose leading axes are ``shape``; a single number fills the whole block."""
    array = numbers(argument, value, finite=finite)
    if array.ndim == 0:
        return over(array, shape)
    if shape and array.shape[: len(shape)] != shape:
        raise ShapeError(f"{argument}: expected shape {_shape(shape, axes)}, got {array.shape}; batch axes come last")
    return array


def shape_of(argument: str, value: Any) -> Shape:
    """The shape of an argument that is checked as numbers."""
    return value.shape if isinstance(value, np.ndarray) else numbers(argument, value, finite=False).shape


def over(array: Array, shape: Shape) -> Array:
    """One number over a whole shape, as ``np.broadcast_to`` returns it, which takes ten times as long."""
    if not shape:
        return array
    wide = np.ndarray(shape, np.float64, np.ascontiguousarray(array), strides=(0,) * len(shape))
    wide.flags.writeable = False
    return wide


def spread(array: Array, block: Shape, batch: Shape) -> Array:
    """A block of this shape, with batch axes behind it that broadcast, over the whole batch."""
    axes = array.shape[len(block) :]
    if axes == batch:
        return array
    if not array.ndim:
        return over(array, batch)
    return np.broadcast_to(array.reshape((*block, *(1,) * (len(batch) - len(axes)), *axes)), (*block, *batch))


def concatenated(parts: Sequence[Array]) -> Array:
    """Arrays of shape (rows, *batch), joined along the rows; the batch axes broadcast."""
    axes = max(part.ndim for part in parts)
    aligned = [part.reshape(len(part), *(axes - part.ndim) * (1,), *part.shape[1:]) for part in parts]
    batch = np.broadcast_shapes(*(part.shape[1:] for part in aligned))
    return np.concatenate([np.broadcast_to(part, (len(part), *batch)) for part in aligned])


def batch_shape(shapes: dict[str, Shape]) -> Shape:
    """Return the shape to which the batch shapes of the named arguments broadcast."""
    one: Shape = ()
    for shape in shapes.values():
        if shape and shape != one:
            if one:
                break
            one = shape
    else:  # the most frequent case: all have one shape, or none
        if len(one) <= MOST_AXES and 0 not in one:
            return one
    different = set(shapes.values())
    if longest := ", ".join(name for name, shape in shapes.items() if len(shape) > MOST_AXES):
        raise ShapeError(f"{longest}: expected at most {MOST_AXES} batch axes, got {max(map(len, different))}")
    try:
        shape = np.broadcast_shapes(*different)
    except ValueError:
        shapes_by_name = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise ShapeError(f"these batch shapes do not broadcast to one: {shapes_by_name}") from None
    if 0 in shape:
        empty = ", ".join(name for name, shape in shapes.items() if 0 in shape)
        raise ShapeError(f"{empty}: expected at least one member, got an empty batch of shape {shape}")
    return shape


def diverged_before(steps: Whole, v: Array, y: Array, batch: Shape) -> Whole:
    """The step at which each member diverged, −1 for none; only states of members that did may be infinite or NaN."""
    steps = np.array(np.broadcast_to(steps, batch), dtype=np.int64)
    for argument, array in (("v", v), ("y", y)):
        if (wrong := ~np.isfinite(array) & (steps < 0)).any():
            raise NotFiniteError(f"{argument}: expected finite numbers, got {array[wrong][0]}{_where(wrong)}")
    return steps


def member(array: Array, index: Shape) -> Array:
    """The part of an array that belongs to one member; batch axes come last."""
    for i in reversed(index):
        array = array[..., i]
    return np.asarray(array)


def is_single(dtype: Any) -> bool:
    """True if float32 is asked for; raises if it is neither that nor float64."""
    if dtype is np.float64 or (type(dtype) is str and dtype == "float64"):
        return False  # the usual case: NumPy takes 3 µs to name a type
    if dtype is np.float32 or (type(dtype) is str and dtype == "float32"):
        return True
    try:
        name = np.dtype(dtype).name if dtype is not None else ""
    except (TypeError, ValueError):  # whole numbers that are too long to print raise the latter
        name = ""
    if name not in ("float64", "float32"):
        raise DTypeError(f"dtype: expected 'float64' or 'float32', got {short(dtype)}")
    return name == "float32"


def fits_single(name: str, numbers: Array | None) -> None:
    """Raise if finite numbers are beyond the range of float32."""
    if numbers is None or not numbers.size:
        return
    least, most = float(np.fmin.reduce(numbers, axis=None)), float(np.fmax.reduce(numbers, axis=None))
    if max(-least, most) <= LARGEST_SINGLE:
        return  # the usual case, found without another array
    large = np.abs(numbers[np.isfinite(numbers)])
    if large.size and float(large.max()) > LARGEST_SINGLE:
        raise ArgumentError(f"{name}: expected numbers up to 3.4e38, the largest of float32, got {large.max():g}")


#: Advice on complex numbers.
COMPLEX = "write the equations of real and imaginary parts: of dz/dt = −iωz with z = y[0] + 1j*y[1], [omega*y[1], -omega*y[0]]"

#: Lower bounds, excluded, of kinds of numbers: finite ones, those of zero or more, and those above zero.
ANY, NOT_NEGATIVE, POSITIVE = -float("inf"), -5e-324, 0.0

#: A number larger than this rounds to infinity in float32.
LARGEST_SINGLE = float(np.finfo(np.float32).max)


def fits(what: str, rows: float, batch: Shape, remedy: str, *, beside: float = 0.0) -> None:
    """Raise if ``rows`` numbers for each member of a batch, and ``beside`` bytes more, do not fit in the available memory."""
    members = prod(batch)
    needed = 8.0 * rows * members + beside
    if needed <= _FEW_BYTES:
        return
    from .available_memory import available_memory, in_bytes  # the import of stepwell does without

    available, bound = available_memory()
    if needed > available:
        left, of = in_bytes(max(available, 0.0)), f" of {counted(members, 'member')}" if batch else ""
        raise TooLargeError(f"{what}{of} need {in_bytes(needed)}, but {left} are available ({bound}); {remedy}")


def in_place(
    argument: str,
    array: Any,
    shape: Shape,
    what: str = "to step in place",
    *,
    written: bool = True,
    dtype: Any = np.float64,
) -> Array:
    """Return ``array`` if it can be stepped in place, or only read in place if not ``written``; it is never copied.

    For another library's array in the memory of the CPU, return NumPy's array over that memory.
    """
    if hasattr(array, "__dlpack__") and not isinstance(array, np.ndarray):
        array = shared(argument, array)
    if not isinstance(array, np.ndarray):
        is_number = isinstance(array, (int, float)) and abs(array) <= LAST_STEP  # a longer one cannot be printed
        instead = f"; one number is np.array({array})" if is_number else ""
        raise DTypeError(f"{argument}: expected a NumPy array {what}, got {type(array).__name__}{instead}")
    if array.dtype != dtype or not array.dtype.isnative:
        other = f', or dtype="{array.dtype}" as an argument' if array.dtype in (np.float32, np.float64) else ""
        remedy = COMPLEX if array.dtype.kind == "c" else f"give such an array{other}"
        raise DTypeError(f"{argument}: expected dtype {np.dtype(dtype)} {what}, got {array.dtype}; {remedy}")
    if array.shape != shape:
        raise ShapeError(f"{argument}: expected shape {shape}, got {array.shape}")
    if not array.flags.c_contiguous:
        raise ArgumentError(f"{argument}: expected a C-contiguous array {what}, got strides {array.strides}")
    if not array.flags.aligned:
        raise ArgumentError(f"{argument}: expected an aligned array {what}, got one at an address that is no multiple of 8 bytes")
    if written and not array.flags.writeable:
        raise ArgumentError(f"{argument}: expected a writeable array {what}, got a read-only one")
    numbers(argument, array)
    return array


def _in(unit: str) -> str:
    return f" in {unit}" if unit else ""


def short(value: object, most: int = 80) -> str:
    """The repr of a value for a message, cut where it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python prints no whole number of thousands of digits
        return f"{type(value).__name__} too long to print"
    return text if len(text) <= most else f"{text[: most - 3]}…"


def _kind(value: Any, array: np.ndarray[Any, Any]) -> str:
    return short(value) if array.ndim == 0 else f"an array of dtype {array.dtype}"


def _where(wrong: np.ndarray[Any, np.dtype[np.bool_]]) -> str:
    return f" at index {tuple(int(i) for i in np.argwhere(wrong)[0])}" if wrong.ndim else ""


def _shape(shape: Shape, axes: str) -> str:
    return f"({', '.join(str(n) for n in shape)}, batch…){f' = ({axes}, batch…)' if axes else ''}"
