"""Running a user's function: with symbols, or with the numbers of every member of a batch."""

from __future__ import annotations

import copy
import linecache
import re
import sys
from traceback import walk_tb
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import checks
from ...base.arrays import Array as Numbers
from ...base.arrays import Shape
from ...base.context import within
from ...errors import REFUSED, TraceError
from ...reference.bits import less, where
from ...reference.mass import Mass, combined
from ...reference.series import among
from .arrays import QUICK_SINES
from .namespace import rebound
from .values import Array, Scalar, array, objects, of_shape

if TYPE_CHECKING:
    from collections.abc import Callable

    from .definition import Definition
    from .friction import Friction
    from .invariants import Invariant, Traced
    from .series import OnSeries
    from .switching import Switches

#: The most frames of a traceback that are searched for the user's function.
MOST_FRAMES = 200
#: The most characters of a line of the user's file in a message.
MOST_OF_A_LINE = 80


class Equations:
    """A user's function for blocks of known shapes.

    Attributes:
        definition: the function, of t, v, y (or t and y) and parameters by name, and which rates it returns.
        v_shape: shape of a member's velocity block.
        y_shape: shape of a member's coordinate block.
        own_shapes: the lengths of each parameter's own axes; None for a parameter that depends on time.
        kept: the name of the invariant that a control or a projection keeps, or None.
        limited: whether that is a control in the limited form.
        pushed: whether it is a control, which pushes, and not a projection.
        rubs: whether the friction that its definition declares is around it.
    """

    kept: str | None = None
    limited = False
    pushed = False
    rubs = False
    _series: OnSeries | None = None
    _friction_series: OnSeries | None = None
    _switches: Switches | None = None

    def __init__(self, definition: Definition, v_shape: Shape, y_shape: Shape, own_shapes: dict[str, Any]) -> None:
        self.definition = definition
        self.v_shape, self.y_shape = v_shape, y_shape
        self.own_shapes = own_shapes
        self._invariants: dict[str, Traced] = {}

    @property
    def shapes(self) -> tuple[Shape, Shape]:
        """Shapes of both blocks."""
        return self.v_shape, self.y_shape

    def batches(self, v: Any, y: Any) -> tuple[Shape, Shape]:
        """The batch axes of both blocks, which come after their own."""
        return np.shape(v)[len(self.v_shape) :], np.shape(y)[len(self.y_shape) :]

    def own_axes(self, name: str) -> int:
        """How many axes of its own a parameter has."""
        return len(self.own_shapes[name] or ())

    @property
    def invariants(self) -> dict[str, Traced]:
        """The declared invariants, by name."""
        from .invariants import Traced

        for name, each in self.definition.invariants.items():
            if name not in self._invariants or self._invariants[name].invariant is not each:
                self._invariants[name] = Traced(each, self)
        return self._invariants

    @property
    def mass_matrix(self) -> Mass | None:
        """The mass matrix if equations are algebraic. Of any other, the rates are multiplied by its inverse."""
        matrix = self.definition.mass
        return None if matrix is None or not matrix.algebraic else Mass(matrix.rows, self.y_shape)

    def keeping(self, name: str, *, limited: bool, pushed: bool) -> Equations:
        """Return these equations with an invariant that a control or a projection keeps."""
        equations = copy.copy(self)
        equations.kept, equations.limited, equations.pushed = name, limited, pushed
        return equations

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_invariants": {}, "_series": None, "_friction_series": None, "_switches": None}

    @property
    def name(self) -> str:
        """The name of the function."""
        return self.definition.name

    @property
    def second_order(self) -> bool:
        """True if ẏ is v."""
        return self.definition.order == 2 and self.definition.blocks == 1 and not self.pushed

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Equations) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple[Any, ...]:
        return self.definition, self.v_shape, self.y_shape, self.kept, self.limited, self.pushed, self.rubs

    def __deepcopy__(self, memo: Any) -> Equations:
        return self  # it is immutable

    def rates(self, t: Any, v: Numbers, y: Numbers, values: dict[str, Any]) -> tuple[Numbers, Numbers]:
        """v̇ and ẏ: symbols from symbols, arrays over all members from numbers. Where ẏ is v, it is not computed."""
        if among((t, v, y)):
            dv, dy = self._of_series(values)(t, v, y, values)
            return dv, dy
        batch = np.broadcast_shapes(*self.batches(v, y), np.shape(t))
        result = self._result(self.definition.function, self.name, t, v, y, values)
        dv, dy = self._checked(result)
        v_dot = np.empty((*self.v_shape, *batch)) if dv is None else _numbers(dv, self.v_shape, batch)
        return v_dot, v if dy is None else _numbers(dy, self.y_shape, batch)

    def friction(self, t: Any, v: Numbers, y: Numbers, values: dict[str, Any]) -> tuple[Numbers, Numbers | None]:
        """The decelerations by friction, and by how much others change with the one number that it acts on, or None.

        A negative deceleration is zero here.
        """
        on = self.friction_on
        assert on is not None
        values = {each: values[each] for each in on.parameters}
        if among((t, v, y)):
            limit, *others = self._friction_of_series(values)(t, v, y, values)
            return limit, others[0] if others else None
        name = f"{self.name}: {on.function.__name__}"
        batch = np.broadcast_shapes(*self.batches(v, y), np.shape(t))
        result = self._result(on.function, name, t, v, y, values)
        along = None
        if on.component is not None and isinstance(result, tuple):
            if len(result) != 2:
                raise TraceError(f"{name}: expected a deceleration, or a pair (deceleration, along), got {len(result)} values")
            result, along = result[0], _numbers(_items(name, "along", result[1], self.v_shape), self.v_shape, batch)
        shape = on.shape(name, self.v_shape)
        return _not_negative(_numbers(_items(name, "a deceleration", result, shape), shape, batch)), along

    @property
    def friction_on(self) -> Friction | None:
        """The friction that sticks, or None."""
        return self.definition.stick_friction if self.rubs else None

    def _result(self, function: Callable[..., Any], name: str, t: Any, v: Numbers, y: Numbers, values: dict[str, Any]) -> Any:
        batch = np.broadcast_shapes(*self.batches(v, y), np.shape(t))
        with np.errstate(all="ignore"):
            parameters = {each: self._parameter(each, value, t, batch) for each, value in values.items()}
            state = [scalars(y, len(self.y_shape))]
            if self.definition.has_v:
                state.insert(0, scalars(v, len(self.v_shape)))
            return self._run(rebound(function), name, Scalar(t), *state, **parameters)

    def _of_series(self, values: dict[str, Any]) -> OnSeries:
        """The rates of series, traced on first use."""
        from .series import OnSeries

        if self._series is None:
            self._series = OnSeries(self, self.rates, values)
        return self._series

    def _friction_of_series(self, values: dict[str, Any]) -> OnSeries:
        """The friction of series, traced on first use."""
        from .series import OnSeries

        if self._friction_series is None:
            self._friction_series = OnSeries(self, self.friction, values)
        return self._friction_series

    @property
    def constant_switching_times(self) -> Numbers | None:
        """The switching times that depend on nothing; None if they depend on parameters or the run, or were not computed yet."""
        return None if self._switches is None or self._switches.switches else self._switches.constants

    def switching(self, values: dict[str, Any]) -> tuple[Switches, Any]:
        """The switches of the rates, and the numbers of parameters for which they are solved."""
        from .switching import Switches, numbers_of

        numbers = numbers_of(values, self.own_axes)
        if self._switches is None:
            self._switches = Switches(self._of_series(values), numbers)
        return self._switches, numbers

    def switching_times(self, values: dict[str, Any], begin: float, end: float) -> Numbers:
        """The times at which the rates change from one piece to another whatever the state is, shape (times, *batch)."""
        switches, numbers = self.switching(values)
        return switches.times(numbers, begin, end)

    def of_state(self, invariant: Invariant, t: Any, v: Numbers, y: Numbers, values: dict[str, Any]) -> Any:
        """The value of an invariant for a state of symbols: one symbol, or a known number."""
        state = [scalars(y, len(self.y_shape))]
        if self.definition.has_v:
            state.insert(0, scalars(v, len(self.v_shape)))
        if invariant.takes_time:
            state.insert(0, Scalar(t))
        parameters = {name: scalars(value, self.own_axes(name)) for name, value in values.items()}
        name = f"{self.name}: {invariant.name}"
        result = objects(self._run(rebound(invariant.function), name, *state, **parameters))
        if result.ndim or not isinstance(result[()], Scalar):
            got = f"an array of shape {result.shape}" if result.ndim else kind_of(result[()])
            raise TraceError(f"{name}: expected one number of a state, got {got}")
        return result[()].value

    def _parameter(self, name: str, value: Any, t: Any, batch: Shape) -> Any:
        if callable(value):
            return self._run(rebound(value), f"{self.name}: {name}", Scalar(t))
        if hasattr(value, "at"):
            return Scalar(value.at(t))
        return scalars(value, self.own_axes(name))

    def _run(self, function: Callable[..., Any], name: str, /, *arguments: Any, **parameters: Any) -> Any:
        return run_function(function, name, self.definition.quick_sines, *arguments, **parameters)

    def _checked(self, result: Any) -> tuple[Any, Any]:
        """The rates of v and y as arrays of objects; None for one that the function does not return."""
        if self.definition.blocks == 2:
            if not isinstance(result, (tuple, list)) or len(result) != 2:
                raise TraceError(f"{self.name}: expected a pair (v̇, ẏ), since blocks=2, got {kind_of(result)}")
            return self._block("v̇", result[0], self.v_shape), self._block("ẏ", result[1], self.y_shape)
        if self.definition.order == 2:
            return self._block("v̇", result, self.v_shape), None
        return None, self._combined(self._block("ẏ", result, self.y_shape))

    def _combined(self, rates: Any) -> Any:
        """The rows of equations that are combinations of the function's, so that each but algebraic ones is for one number."""
        if self.definition.mass is None:
            return rates
        combinations = [combined(row, rates.ravel()) for row in self.definition.mass.combinations]
        return objects(combinations).reshape(rates.shape)

    def _block(self, what: str, value: Any, shape: Shape) -> Any:
        try:
            items = array(value).items
        except TraceError as error:
            raise TraceError(f"{self.name}: expected {what} of shape {shape}, got {kind_of(value)} ({error})") from None
        if items.shape != shape:
            raise of_shape(f"{self.name}: expected {what} of shape {shape}, that of its block, got shape {items.shape}")
        return items


def run_function(function: Callable[..., Any], name: str, quick_sines: bool, /, *arguments: Any, **parameters: Any) -> Any:
    """Call a user's function. An error is raised again with its name and the line, even if the function itself catches it."""
    refused: list[TraceError] = []
    try:
        result = within({QUICK_SINES: quick_sines, REFUSED: refused}, function, *arguments, **parameters)
    except RecursionError:
        raise
    except Exception as error:
        raise _located(error, function, name) from error
    if refused:
        raise _located(refused[0], function, name) from refused[0]
    return result


def _located(error: Exception, function: Any, name: str) -> TraceError:
    """The error of a user's function, with the function's name and the line in its message."""
    line = _line_of(error, getattr(function, "__code__", None))
    known = error if isinstance(error, TraceError) else error.__cause__  # NumPy wraps what a float() raises
    text = str(known) if isinstance(known, TraceError) else _in_words(error)
    if (package := _abroad(error, function)) and isinstance(known, TraceError):
        text += (
            f". It was used by {package}, whose functions take numbers only and cannot be traced; a table of the time is a "
            f"parameter: sw.Sampled(values, interval, interpolation='linear' or 'cubic')"
        )
    located = TraceError(f"{name}{line}: {text}")
    may_be = isinstance(error, (IndexError, TypeError, ValueError)) and not text.endswith(checks.COMPLEX)
    located.of_shape = known.of_shape if isinstance(known, TraceError) else may_be
    return located


def kind_of(value: Any) -> str:
    """A function's result in a word or two."""
    return "nothing: is there a return?" if value is None else type(value).__name__


def _items(name: str, what: str, value: Any, shape: Shape) -> Any:
    """The result of a function as an array of objects; one number serves all."""
    try:
        items = array(value).items
    except TraceError as error:
        raise TraceError(f"{name}: expected {what} of shape {shape}, got {kind_of(value)} ({error})") from None
    if items.shape not in ((), shape):
        raise of_shape(f"{name}: expected {what} of shape {shape}, or one number, got shape {items.shape}")
    return np.broadcast_to(items, shape)


def scalars(numbers: Any, axes: int) -> Any:
    """Numbers or symbols as scalars: the first axes are the array's own, the others those of a batch."""
    numbers = np.asarray(numbers)
    if axes == 0:
        return Scalar(numbers[()])
    items = np.empty(numbers.shape[:axes], dtype=object)
    for index in np.ndindex(items.shape):
        items[index] = Scalar(numbers[index])
    return Array(items)


def _numbers(items: Any, shape: Shape, batch: Shape) -> Numbers:
    """The values of scalars as one array, of objects if they are symbols."""
    values = [each.value if isinstance(each, Scalar) else each for each in (objects(each)[()] for each in items.flat)]
    if any(hasattr(value, "xor_bits") for value in values):
        block = np.empty(len(values), dtype=object)
        block[:] = values
        return block.reshape(shape)
    # Analysis steps numbers whose imaginary part is infinitesimal.
    numbers = np.empty((len(values), *batch), dtype=np.result_type(np.float64, *(np.asarray(value).dtype for value in values)))
    for i, value in enumerate(values):
        numbers[i] = value
    return numbers.reshape((*shape, *batch))


def _not_negative(numbers: Any) -> Any:
    """Numbers, or symbols and numbers, with zero in place of negative ones."""
    if numbers.dtype != object:
        return where(less(numbers, 0.0), 0.0, numbers)
    one = np.frompyfunc(lambda x: where(x < 0.0, 0.0, x) if hasattr(x, "xor_bits") else max(x, 0.0), 1, 1)
    return np.asarray(one(numbers), dtype=object)


def _in_words(error: BaseException) -> str:
    """Python's message, or a clearer one where the function uses a scalar or an array as something else."""
    if "'complex'" in str(error):
        return f"expected real numbers, got a complex one; {checks.COMPLEX}"
    if match := re.fullmatch(r"(cannot unpack non-iterable )?'?(Scalar|Array)'? object(.*)", str(error)):
        if "not callable" in match[3]:
            return "y is the state at t, and no function of the time: delays such as y(t − τ) are not here"
        if match[2] == "Scalar" and not match[3].startswith(" has no attribute"):
            return "expected an array, got one number"
    return f"{type(error).__name__}: {error}"


def _abroad(error: BaseException, function: Any) -> str:
    """The package other than the function's own, stepwell and NumPy whose code needed a number; empty if none did."""
    own = _package(getattr(function, "__globals__", {}))
    packages = [_package(frame.f_globals) for frame, _ in walk_tb(error.__traceback__)]
    inner = next((each for each in reversed(packages) if each not in ("stepwell", "numpy", own)), "")
    return inner if inner in sys.modules and hasattr(sys.modules[inner], "__path__") else ""


def _package(names: dict[str, Any]) -> str:
    return str(names.get("__name__", "")).partition(".")[0]


def _line_of(error: BaseException, code: Any) -> str:
    """The last line in the function's file that the error passed through, as part of a message."""
    last, frame = None, error.__traceback__
    for _ in range(MOST_FRAMES):
        if frame is None:
            break
        if code is not None and frame.tb_frame.f_code.co_filename == code.co_filename:
            last = frame
        frame = frame.tb_next
    if last is None:
        return ""
    file, line = last.tb_frame.f_code.co_filename, last.tb_lineno
    text = linecache.getline(file, line).strip()
    text = text if len(text) <= MOST_OF_A_LINE else f"{text[:MOST_OF_A_LINE]}…"
    return f" ({file.replace(chr(92), '/').rsplit('/', 1)[-1]}, line {line}{f': {text}' if text else ''})"
