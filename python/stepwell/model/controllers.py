"""``stepwell.controller``: a user's function becomes a sampled controller, a part around a system.

Several around one system are one part: ``Controllers``, whose state is all that each of them remembers.
"""

from __future__ import annotations

import hashlib
import inspect
import re
from collections.abc import Callable
from itertools import count
from math import ceil, gcd, lcm, prod
from types import FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from .. import _core
from ..base import checks
from ..base.arrays import Array, Shape
from ..base.immutable import FixedDict, changed, frozen
from ..errors import ArgumentError, DTypeError, ShapeError, TraceError, UnknownNameError, UnsupportedError
from ..reference.sampled import Loop
from ..reference.signal import Constant
from .around import Part
from .equations.by_name import reduced
from .equations.namespace import rebound
from .equations.series import symbols
from .equations.trace import kind_of, run_function, scalars
from .equations.values import Scalar, array, objects
from .parameters import aligned

if TYPE_CHECKING:
    from .systems import System

#: By this share of a step a period or a delay may be off a whole number of steps: rounding of dt, to float32 too.
OFF_STEPS = 1e-7
#: The most steps of a period or a delay, and the most samples that results wait.
MOST_STEPS, MOST_WAITING = 1 << 24, 1000
#: The names of arguments of ``ControllerDefinition`` and of its timing, which no parameter can have.
RESERVED = ("sets", "period", "delay", "last", "later")
#: The name of what a controller computes, for the core.
CONTROLLER = "controller()"


class Timing(NamedTuple):
    """A period and a delay in steps.

    Attributes:
        steps: steps from one sample to the next.
        waiting: how many samples a result waits.
        later: how many steps after that it is put out.
    """

    steps: int
    waiting: int
    later: int


class Target(NamedTuple):
    """A parameter of a system that a controller sets, by its name among arguments, in the equations, and of rows in the core.

    ``place`` is its place if it stands in a list of inputs under that name, ``shape`` the shape of its numbers for a member.
    """

    name: str
    key: str
    place: int | None
    row: str
    shape: Shape

    def of(self, parameters: dict[str, Any]) -> Any:
        """Its numbers among the parameters of the system's equations."""
        value = parameters[self.key]
        value = value if self.place is None else value[self.place]
        return value.value if isinstance(value, Constant) else value

    def put(self, parameters: dict[str, Any], numbers: list[Any]) -> None:
        """Replace its numbers, each a symbol or an array over the batch."""
        kind = object if any(np.asarray(each).dtype == object for each in numbers) else np.result_type(*numbers)
        block = np.empty((len(numbers), *np.broadcast_shapes(*(np.shape(each) for each in numbers))), kind)
        for i, each in enumerate(numbers):
            block[i] = each
        value: Any = block.reshape((*self.shape, *block.shape[1:]))
        before = parameters[self.key]
        if self.place is None:
            parameters[self.key] = Constant(value) if isinstance(before, Constant) else value
        else:
            parameters[self.key] = [Constant(value) if i == self.place else each for i, each in enumerate(before)]


class ControllerDefinition:
    """A kind of sampled controller, defined by a function; ``stepwell.controller`` returns it.

    Attributes:
        function: the function.
        reads: what it takes beside the time: v and y, y, or the outputs z.
        memory: names and initial values of its state.
        parameters: names and defaults of its parameters.
    """

    def __init__(self, function: FunctionType) -> None:
        self.function = function
        self.__name__ = self.name = function.__name__
        self.__doc__, self.__module__, self.__qualname__ = function.__doc__, function.__module__, function.__qualname__
        self.__wrapped__ = function
        self.reads, self.memory, self.parameters = _arguments(function)

    def __call__(self, /, *, sets: Any = "u", period: Any, delay: Any = 0.0, **values: Any) -> Controller:
        """The controller with these parameters; the others have their defaults.

        Args:
            sets: the name of the system's parameter that it sets, or a tuple of names.
            period: the time from one sample to the next, a whole number of steps.
            delay: the time from a sample to the output of its result, a whole number of steps.
            **values: parameters and initial values of its state by name, each a number or an array over the batch (whose axes
                come after its own, if the default has some).
        """
        for name in values:
            if name not in self.parameters and name not in self.memory:
                known = ", ".join([*self.parameters, *self.memory]) or "none"
                raise UnknownNameError(f"{self.name}: there is no parameter {checks.short(name)}. Known: {known}.")
        names = [sets] if isinstance(sets, str) else checks.several("sets", sets, "names of parameters")
        if not names or not all(isinstance(each, str) for each in names) or len(set(names)) < len(names):
            raise ArgumentError(f"sets: expected the names of parameters, each once, got {checks.short(sets)}")
        period = checks.number("period", period, positive=True, unit="units of time")
        delay = checks.number("delay", delay, unit="units of time")
        if delay < 0.0:
            raise ArgumentError(f"delay: expected a time of zero or more, got {delay:g}")
        return Controller(self, tuple(names), period, delay, self.memory | self.parameters | values)

    def __repr__(self) -> str:
        return f"<controller {self.name}({', '.join([*self.memory, *self.parameters])})>"

    def __deepcopy__(self, memo: Any) -> ControllerDefinition:
        return self  # it is immutable

    def __copy__(self) -> ControllerDefinition:
        return self

    def __reduce__(self) -> Any:
        return reduced(self, "a controller")


def _arguments(function: FunctionType) -> tuple[tuple[str, ...], dict[str, Any], dict[str, Any]]:
    """The arguments of a function beside the time, and names and defaults of its state and of its parameters."""
    signature = inspect.signature(function)
    arguments = list(signature.parameters.values())
    names = [each.name for each in arguments]
    head = 3 if names[:3] == ["t", "v", "y"] else 2
    expected = (
        "(t, v, y, …) or (t, y, …), or (t, z, …) of the outputs, then its state and, behind *, its parameters, both with defaults"
    )
    named = f": the state is called y here, got {names[1]}" if names[1:2] and names[0] == "t" and names[1] not in "vyz" else ""
    got = f"{function.__name__}: expected a function {expected}, got {signature}{named}"
    if names[:head] not in (["t", "v", "y"], ["t", "y"], ["t", "z"]):
        raise ArgumentError(got)
    memory: dict[str, Any] = {}
    parameters: dict[str, Any] = {}
    for each in arguments[:head]:
        if each.kind not in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD) or each.default is not each.empty:
            raise ArgumentError(got)
    for each in arguments[head:]:
        if each.kind in (each.VAR_POSITIONAL, each.VAR_KEYWORD) or each.default is each.empty:
            raise ArgumentError(got)
        if each.name in RESERVED:
            raise ArgumentError(f"{function.__name__}: {each.name} has a meaning already; take another name")
        numbers = checks.numbers(f"{function.__name__}: default of {each.name}", each.default)
        kind = parameters if each.kind is each.KEYWORD_ONLY else memory
        kind[each.name] = frozen(each.name, numbers) if numbers.ndim else each.default
    return tuple(names[1:head]), memory, parameters


def controller(function: Callable[..., Any], /) -> ControllerDefinition:
    """Make a kind of sampled controller from a function; a decorator.

    Once a period it reads the state, and sets parameters of the system around which it is, which it holds in between. It is a
    part of the system, so it is stepped with it: in batches, sweeps and worlds, as machine code. The function is run once with
    symbols in place of numbers, as that of ``stepwell.system``; write it for one member.

    Args:
        function: ``f(t, v, y, state=0.0, *, parameter=1.0)``, for a system without velocities ``f(t, y, …)``; ``f(t, z, …)``
            takes the outputs C·s of a linear system in place of its states, shape (outputs,). It returns what it sets, and behind
            that the next values of its state, if it has one: ``u`` or ``(u, state)``. The defaults of its state are the values at
            the start. Defaults that are arrays have axes of their own.

    Returns:
        A ``ControllerDefinition``: called with ``sets``, ``period``, ``delay`` and parameters by name, it returns a
        ``Controller``, which ``system.surrounded`` puts around a system.

    Raises:
        TraceError: at the first use with a state, if the function does what cannot be traced; the message names the line.

    Example:
        >>> @sw.system
        ... def mass(t, v, y, *, u=0.0):
        ...     return u - 0.4 * v
        >>> @sw.controller
        ... def limited(t, v, y, total=0.0, *, gain=1.0):
        ...     error = 1.0 - y
        ...     wanted = gain * error - 1.5 * v + total
        ...     u = np.clip(wanted, -1.0, 1.0)
        ...     return u, np.where(wanted == u, total + 0.01 * error, total)
        >>> loop = mass().surrounded(limited(gain=[0.5, 1.0, 2.0], period=0.1, delay=0.1))
        >>> sw.integrate(loop, "rk4", v=0.0, y=0.0, dt=0.01, steps=4000).y[-1].round(3)
        array([1.006, 1.002, 1.003])
    """
    if isinstance(function, ControllerDefinition):
        raise DTypeError(f"function: {function.name} is a controller already")
    if not isinstance(function, FunctionType):
        raise DTypeError(f"function: expected a Python function such as f(t, v, y), got {type(function).__name__}")
    return ControllerDefinition(function)


class Controller(Part):
    """A sampled controller around a system; calling what ``stepwell.controller`` returns makes one.

    Attributes:
        definition: its function.
        sets: the names of the parameters that it sets.
        period: the time from one sample to the next.
        delay: the time from a sample to the output of its result.
        values: the initial values of its state, and its parameters, by name.
    """

    kind = "controller"
    acts_on_rates = False
    #: Period and delay in steps, once these are known.
    timing: Timing | None = None

    def __init__(
        self, definition: ControllerDefinition, sets: tuple[str, ...], period: float, delay: float, values: dict[str, Any]
    ) -> None:
        self.definition, self.sets, self.period, self.delay = definition, sets, period, delay
        self.values: Any = FixedDict(self._checked(values))

    def _checked(self, values: dict[str, Any]) -> dict[str, Array]:
        name = self.definition.name
        checked = {each: checks.numbers(f"{name}: {each}", value) for each, value in values.items()}
        for each, numbers in checked.items():
            if numbers.ndim < (own := self._own(each)):
                raise ShapeError(f"{name}: {each}: expected {own} axes of its own, like its default, got shape {numbers.shape}")
        return checked

    def _value(self, name: str) -> Array:
        numbers: Array = self.values[name]
        return numbers

    def _own(self, name: str) -> int:
        """How many axes of its own a value has: as many as its default."""
        return np.ndim((self.definition.memory | self.definition.parameters)[name])

    @property
    def each(self) -> tuple[Controller, ...]:
        """The controllers of which it is made: itself."""
        return (self,)

    @property
    def name(self) -> str:
        """The name of its function."""
        return self.definition.name

    @property
    def reads_outputs(self) -> bool:
        """True if one of them takes the outputs of a linear system."""
        return any(each.definition.reads == ("z",) for each in self.each)

    @property
    def tunable(self) -> dict[str, tuple[Controller, str]]:
        """Its parameters by name: whose they are, and what they are called there."""
        return {name: (self, name) for name in self.definition.parameters}

    @property
    def batch(self) -> Shape:
        """The shape to which its values broadcast."""
        return checks.batch_shape({name: value.shape[self._own(name) :] for name, value in self.values.items()})

    def repr_arguments(self) -> list[str]:
        """Its function, what it sets, and how often."""
        return [f"{self.definition.name} sets {', '.join(self.sets)} every {self.period:g}"]

    def __repr__(self) -> str:
        late = f", delay={self.delay:g}" if self.delay else ""
        return f"{self.definition.name}(sets={', '.join(self.sets)}, period={self.period:g}{late})"

    def beside(self, other: Controller | None) -> Controller:
        """This controller together with one that is around the system already."""
        return self if other is None else Controllers((*other.each, self))

    def check(self, system: System) -> None:
        """Raise if it could set nothing of these names, one does so already, or it reads what the system does not have."""
        other = system.controller
        if other is not None and (twice := [name for name in self.sets if name in other.sets]):
            raise UnsupportedError(
                f"part: the system has the controller {other!r} already, which sets {', '.join(twice)} as well; two controllers "
                f"set different parameters"
            )
        for name in self.sets:
            target(system, name)
        whole = self.beside(other)
        if twice := [name for name in whole.tunable if name in system.arguments()]:
            raise ArgumentError(
                f"part: expected parameters of the controller by other names than those of the system, since a world sets both "
                f"by name, got {', '.join(twice)}"
            )
        if len(whole.tunable) < sum(len(each.tunable) for each in whole.each):
            raise ArgumentError(f"part: expected parameters of {whole!r} that differ by name, got {', '.join(whole.tunable)}")
        definition, reads = getattr(system, "definition", None), self.definition.reads
        if reads == ("z",):
            _output_rows(system)
            return
        has_v = system.v_shape != (0,) if definition is None else definition.has_v
        if has_v is not (len(reads) == 2):
            expected = "(t, v, y, …)" if has_v else "(t, y, …), since the system has no velocities"
            raise ArgumentError(f"part: expected a controller of {expected}, got {self.name} of (t, {', '.join(reads)}, …)")

    def parameters(self, y_shape: Shape, batch: Shape) -> dict[str, Any]:
        """Its parameters, and its timing once that is known."""
        values = {f"controller.{name}": aligned(self._value(name), self._own(name), batch) for name in self.tunable}
        return values if self.timing is None else values | self._in_steps()

    def own_axes(self, name: str) -> int:
        """The axes of its own of a parameter."""
        name = name.removeprefix("controller.")
        return 0 if name in RESERVED else self._own(name)

    def with_values(self, values: dict[str, Any]) -> Controller:
        """This controller with other numbers for some parameters."""
        return changed(self, values=FixedDict(self._checked(dict(self.values) | values)))

    def member(self, one: Callable[..., Array]) -> Self:
        """The controller for one member of a batch."""
        return changed(self, values=FixedDict({name: one(value, self._own(name)) for name, value in self.values.items()}))

    def wrap(self, s: Any, h: Any, parameters: dict[str, Any]) -> Any:
        """The system: what the controller sets is set before the system is made."""
        return s

    def over_steps(self, dt: float) -> Controller:
        """This controller with its period and its delay in steps of this length."""
        steps, late = _whole("period", self.period, abs(dt)), _whole("delay", self.delay, abs(dt))
        if steps < 1:
            raise ArgumentError(f"period: expected a step of at most {self.period:g}, got dt = {dt:g}")
        waiting, later = divmod(late, steps)
        if waiting > MOST_WAITING:
            raise ArgumentError(f"delay: expected a delay of at most {MOST_WAITING} periods, got {self.delay / self.period:g}")
        return changed(self, timing=Timing(steps, waiting, later))

    # ---- in steps

    @property
    def loop_key(self) -> tuple[Any, ...]:
        """The key of the layout of its memory, equal for controllers that remember the same."""
        return tuple((each.definition, each.sets, each.timing) for each in self.each)

    @property
    def cycle(self) -> int:
        """After so many steps samples are where they were."""
        return self._timing().steps

    def counters(self, system: System) -> list[int]:
        """Where among what it remembers steps are counted."""
        return [0]

    def targets(self, system: System) -> list[Target]:
        """The parameters that it sets."""
        return [target(system, name) for name in self.sets]

    def _counts(self, system: System) -> tuple[int, int]:
        """How many numbers it sets, and how many its state has."""
        return sum(prod(each.shape) for each in self.targets(system)), self._states(system)

    def _states(self, system: System) -> int:
        return sum(prod(np.shape(self.values[name])[: self._own(name)]) for name in self.definition.memory)

    def _timing(self) -> Timing:
        if self.timing is None:
            raise UnsupportedError(f"{self!r}: its period is a number of steps, and there is no step yet; give dt=")
        return self.timing

    def loop(self, system: System, parameters: dict[str, Any]) -> Loop:
        """The controller in the loop of the reference, with numbers or symbols for its parameters and its timing."""
        own = {name.removeprefix("controller."): value for name, value in parameters.items()}
        last, later = (own.pop(name, None) for name in ("last", "later"))

        def control(t: Any, v: Any, y: Any, state: list[Any]) -> tuple[list[Any], list[Any]]:
            made = self._run(system, t, v, y, state, own)
            return made[:number], made[number:]

        number, known = self._counts(system)[0], self._timing()
        last, later = (each if each is None else np.asarray(each)[()] for each in (last, later))
        return Loop(control, number, known.waiting, last, later)

    def put(self, system: System, parameters: dict[str, Any], numbers: list[Any]) -> dict[str, Any]:
        """Parameters of the system's equations with these numbers for what it sets."""
        parameters, rest = dict(parameters), list(numbers)
        for each in self.targets(system):
            each.put(parameters, rest[: prod(each.shape)])
            del rest[: prod(each.shape)]
        return parameters

    def held_places(self, system: System) -> dict[str, list[int]]:
        """Where among what it remembers what it holds stands, by the name of what it sets."""
        places = iter(self.loop(system, self._in_steps()).held(list(range(self.remembers(system)))))
        return {each.name: [next(places) for _ in range(prod(each.shape))] for each in self.targets(system)}

    def held(self, system: System, name: str, memory: list[Any]) -> Any:
        """The value that it holds between two steps for a parameter that it sets: the axes of that, then the batch."""
        block = np.stack(np.broadcast_arrays(*(memory[i] for i in self.held_places(system)[name])))
        return block.reshape((*system.recorded_shapes()[name], *block.shape[1:]))

    def _in_steps(self) -> dict[str, Array]:
        """Its timing, as parameters."""
        steps, _, later = self._timing()
        return {"controller.last": np.asarray(steps - 1.0)} | ({"controller.later": np.asarray(float(later))} if later else {})

    def for_core(self, system: System, places: dict[str, int], *, single: bool = False) -> list[tuple[str, Any]]:
        """The values that the core takes beside its parameters; ``places`` has the number of each parameter's first row."""
        timing, tape = self._timing(), _core.Tape(single=single)
        made = [self._traced(system, tape, places) for _ in range(2)]
        if [each.id for each in made[0]] != [each.id for each in made[1]]:
            raise TraceError(
                f"{self.name}: expected the same operations at every call, got others: a function of a step may not "
                f"draw random numbers or count its calls"
            )
        sets = ",".join(each.row for each in self.targets(system))
        quantities = [(str(i), each) for i, each in enumerate(made[0])]
        more = [("controller.sets", sets), ("controller.waiting", timing.waiting)]
        return [*more, (CONTROLLER, tape.equations([], [], quantities))]

    def digest(self, system: System) -> str:
        """A hash of its operations, by which a saved run recognises it."""
        tape, places, rows = _core.Tape(), {}, 0
        for name in self.tunable:
            places[f"controller.{name}"], rows = rows, rows + prod(self._value(name).shape[: self._own(name)])
        made = self._traced(system, tape, places)
        return hashlib.sha256(repr(tape.operations(made)).encode()).hexdigest()

    def _traced(self, system: System, tape: _core.Tape, places: dict[str, int]) -> list[_core.Symbol]:
        """The results computed from symbols; its parameters begin at ``places``."""
        state = map(tape.state, count())
        blocks = [symbols(shape, state) for shape in (system.v_shape, system.y_shape)]
        memory = [next(state) for _ in range(self._counts(system)[1])]
        own = {
            name: symbols(self._value(name).shape[: self._own(name)], map(tape.param, count(places[f"controller.{name}"])))
            for name in self.tunable
        }
        v, y = blocks
        made = self._run(system, tape.time(), v, y, memory, own)
        return [each if isinstance(each, _core.Symbol) else tape.number(float(each)) for each in made]

    def _run(self, system: System, t: Any, v: Any, y: Any, state: list[Any], parameters: dict[str, Any]) -> list[Any]:
        """The numbers that it sets, and those of its next state."""
        definition, rest = self.definition, iter(state)
        with np.errstate(all="ignore"):
            if definition.reads == ("z",):
                blocks = [_outputs(system, v, y)]
            else:
                blocks = [scalars(v, len(system.v_shape)), scalars(y, len(system.y_shape))][-len(definition.reads) :]
            shapes = {name: self.values[name].shape[: self._own(name)] for name in definition.memory}
            memory = {name: _of_list(rest, shape) for name, shape in shapes.items()}
            own = {name: scalars(value, self._own(name)) for name, value in parameters.items()}
            quick = bool(getattr(getattr(system, "definition", None), "quick_sines", False))
            function: Any = rebound(definition.function)
            result = run_function(function, definition.name, quick, Scalar(t), *blocks, *memory.values(), **own)
        wanted = [(name, each.shape) for name, each in zip(self.sets, self.targets(system), strict=True)] + list(shapes.items())
        several = isinstance(result, (tuple, list)) and len(wanted) > 1
        parts = list(result) if several else [result]
        if len(parts) != len(wanted):
            raise TraceError(
                f"{definition.name}: expected to return {', '.join(name for name, _ in wanted)}, got "
                f"{f'{len(parts)} values' if several else kind_of(result)}"
            )
        numbers: list[Any] = []
        for (name, shape), part in zip(wanted, parts, strict=True):
            try:
                items = array(part).items if shape else objects(part)
            except TraceError as error:
                raise TraceError(f"{definition.name}: {name}: {error}") from None
            wrong = next((each for each in items.flat if not isinstance(each, (Scalar, int, float))), None)
            if items.shape != shape or wrong is not None:
                got = kind_of(wrong) if wrong is not None else f"shape {items.shape}" if items.shape else "one number"
                raise TraceError(
                    f"{definition.name}: expected {name} of {f'shape {shape}' if shape else 'one number'}, got {got}"
                )
            numbers += [each.value if isinstance(each, Scalar) else float(each) for each in items.flat]
        return numbers

    def at_start(self, system: System, batch: Shape) -> Array:
        """The memory at the start: rows of one number for each member."""
        rows = [np.zeros(()), *self._states_at_start(system, batch)]
        parameters, timing = system.own_parameters(batch), self._timing()
        before = []
        for each in self.targets(system):
            numbers = np.asarray(each.of(parameters))
            before += [numbers[index] for index in np.ndindex(*each.shape)]
        rows += before * (timing.waiting + 1 + (timing.later > 0))
        memory = np.empty((len(rows), *batch))
        for i, row in enumerate(rows):
            memory[i] = row
        return memory

    def _states_at_start(self, system: System, batch: Shape) -> list[Any]:
        rows: list[Any] = []
        for name in self.definition.memory:
            value = aligned(self.values[name], self._own(name), batch)
            rows += [value[index] for index in np.ndindex(*value.shape[: self._own(name)])]
        return rows

    def remembers(self, system: System) -> int:
        """How many numbers it remembers."""
        set_, states = self._counts(system)
        timing = self._timing()
        return 1 + states + set_ * (timing.waiting + 1 + (timing.later > 0))


class Controllers(Controller):
    """Several sampled controllers around a system, which set different parameters, each with its own period and delay.

    As one controller it has a sample wherever one of them may have one or put something out: its period is the greatest common
    divisor of their periods and delays in steps. Its state is all that each of them remembers, so nothing that steps a system
    knows of more than one.

    Attributes:
        each: the controllers, in the order in which they came.
    """

    each: tuple[Controller, ...] = ()

    def __init__(self, each: tuple[Controller, ...]) -> None:
        self.each = each

    @property
    def sets(self) -> tuple[str, ...]:  # type: ignore[override]
        """The names of the parameters that they set."""
        return tuple(name for each in self.each for name in each.sets)

    @property
    def name(self) -> str:
        """The names of their functions."""
        return ", ".join(each.name for each in self.each)

    @property
    def tunable(self) -> dict[str, tuple[Controller, str]]:
        """Their parameters by name; one that several have is named by what its controller sets first, too."""
        every = [(name, each) for each in self.each for name in each.tunable]
        names = [name for name, _ in every]

        def public(name: str, each: Controller) -> str:
            return name if names.count(name) == 1 else f"{name}_{re.sub(r'[^0-9A-Za-z_]', '', each.sets[0])}"

        return {public(name, each): (each, name) for name, each in every}

    @property
    def batch(self) -> Shape:
        """The shape to which the values of all broadcast."""
        return checks.batch_shape({f"controller {i}": each.batch for i, each in enumerate(self.each)})

    def repr_arguments(self) -> list[str]:
        """Each function, what it sets, and how often."""
        return [text for each in self.each for text in each.repr_arguments()]

    def __repr__(self) -> str:
        return " and ".join(map(repr, self.each))

    def _value(self, name: str) -> Array:
        each, own = self.tunable[name]
        return each._value(own)

    def _own(self, name: str) -> int:
        each, own = self.tunable[name]
        return each._own(own)

    def with_values(self, values: dict[str, Any]) -> Controller:
        """Return these controllers with other numbers for some parameters."""
        own = {
            id(each): {name: values[known] for known, (of, name) in self.tunable.items() if of is each and known in values}
            for each in self.each
        }
        return changed(self, each=tuple(each.with_values(own[id(each)]) for each in self.each))

    def member(self, one: Callable[..., Array]) -> Self:
        """The controllers for one member of a batch."""
        return changed(self, each=tuple(each.member(one) for each in self.each))

    def over_steps(self, dt: float) -> Controller:
        """Return these controllers with their times in steps of this length; within, those of each in samples of the whole."""
        each = [one.over_steps(dt) for one in self.each]
        tick = gcd(*(steps for one in each for steps in (one._timing().steps, one._timing().later)))
        inner = (Timing(one._timing().steps // tick, one._timing().waiting, one._timing().later // tick) for one in each)
        within = tuple(changed(one, timing=timing) for one, timing in zip(each, inner, strict=True))
        return changed(self, each=within, timing=Timing(tick, 0, 0))

    @property
    def loop_key(self) -> tuple[Any, ...]:
        """The key of the layout of its memory, equal for controllers that remember the same."""
        return (self.timing, *super().loop_key)

    @property
    def cycle(self) -> int:
        """After so many steps all samples are where they were."""
        return self._timing().steps * lcm(*(each.cycle for each in self.each))

    def _first(self, system: System) -> list[int]:
        """Where in its state begins what each of them remembers, and where that ends."""
        first = [0]
        for each in self.each:
            first.append(first[-1] + each.remembers(system))
        return first

    def counters(self, system: System) -> list[int]:
        """Where among what it remembers samples are counted."""
        return [0, *(1 + first for first in self._first(system)[:-1])]

    def _states(self, system: System) -> int:
        return self._first(system)[-1]

    def digest(self, system: System) -> str:
        """A hash of the operations of each."""
        return " ".join(each.digest(system) for each in self.each)

    def _run(self, system: System, t: Any, v: Any, y: Any, state: list[Any], parameters: dict[str, Any]) -> list[Any]:
        """The outputs of each controller at a sample of the whole, then the memory of each."""
        numbers: list[Any] = []
        following: list[Any] = []
        first = self._first(system)
        for i, each in enumerate(self.each):
            own = {f"controller.{name}": parameters[known] for known, (of, name) in self.tunable.items() if of is each}
            loop = each.loop(system, own | each._in_steps())
            out, memory = loop.step(t, v, y, state[first[i] : first[i + 1]])
            numbers, following = numbers + out, following + memory
        return numbers + following

    def _states_at_start(self, system: System, batch: Shape) -> list[Any]:
        return [row for each in self.each for row in each.at_start(system, batch)]


def _output_rows(system: System) -> Array:
    """The rows of C of a linear system whose outputs a controller reads."""
    C, D = (getattr(system, name, None) for name in "CD") if system.kernel == "linear" else (None, None)
    if C is None:
        raise UnsupportedError(
            f"part: expected a linear system with outputs (C) for a controller of (t, z, …), got {system!r}; a controller of its "
            f"state computes what it needs of that itself"
        )
    if D is not None and D.any():
        raise UnsupportedError(
            f"part: {system!r} adds inputs to its outputs (D), and a controller at a sample does not know the inputs of the step "
            f"after it; take the states, (t, y, …)"
        )
    if C.ndim > 2:
        raise UnsupportedError(f"part: expected one C for all members for a controller of (t, z, …), got shape {C.shape}")
    rows: Array = C
    return rows


def _outputs(system: System, v: Any, y: Any) -> Any:
    """C·s as an array of scalars; what is multiplied by zero is left out."""
    order = [*system.velocities, *system.coordinates]  # type: ignore[attr-defined]  # a linear system
    states = dict(zip(order, [Scalar(each) for block in (v, y) for each in block], strict=True))
    z = np.empty(len(rows := _output_rows(system)), dtype=object)
    for i, row in enumerate(rows):
        terms = [states[j] if row[j] == 1.0 else float(row[j]) * states[j] for j in np.flatnonzero(row)]
        z[i] = sum(terms[1:], terms[0]) if terms else 0.0 * states[0]
    return array(z)


def _whole(name: str, time: float, dt: float) -> int:
    """A time as a whole number of steps."""
    steps = round(time / dt) if time / dt < MOST_STEPS else MOST_STEPS
    if steps >= MOST_STEPS:
        raise ArgumentError(f"{name}: expected less than {MOST_STEPS} steps, got {time:g} with dt = {dt:g}")
    if abs(steps - time / dt) > OFF_STEPS * max(1.0, steps):
        raise ArgumentError(
            f"{name}: expected a whole number of steps, got {time:g} with dt = {dt:g}, which are {time / dt:.6g}; take "
            f"dt = {time / max(1, ceil(time / dt)):.6g}, or {name} = {dt * max(1, steps):.6g}"
        )
    return steps


def target(system: System, name: str) -> Target:
    """The parameter of a system that a controller sets."""
    inputs, parameters = system.given_inputs(), system.arguments()
    direct = {each: row for each, (row, least) in system.direct().items() if least == checks.ANY}
    if name in inputs:
        key, place = name, None
        if name in system.input_names and system.kernel == "linear":
            key, place = "inputs", list(inputs).index(name)
        if not isinstance(inputs[name].signal(), Constant):
            raise ArgumentError(f"sets: expected a parameter that is a number, got {name}, which changes with the time")
        return Target(name, key, place, name if place is None else f"inputs[{place}]", ())
    if name in system.input_names or (name in parameters and parameters[name] is None):
        raise ArgumentError(
            f"sets: {name} was left out, so it is no part of the step; give it the value that it has before the first output of "
            f"the controller, such as {name.partition('[')[0]}=0.0"
        )
    if name in direct:
        value = parameters[name]
        if not isinstance(value, np.ndarray):
            raise ArgumentError(f"sets: expected a parameter that is a number, got {name}, which changes with the time")
        definition = getattr(system, "definition", None)
        own = 0 if definition is None else definition.own_axes[name]
        return Target(name, direct[name], None, direct[name], value.shape[:own])
    known = ", ".join(dict.fromkeys([*direct, *inputs, *system.input_names])) or "none"
    raise UnknownNameError(f"sets: expected a parameter of the system that may have any value, got {name!r}. Known: {known}.")


def _of_list(numbers: Any, shape: Shape) -> Any:
    """The next numbers of a list as a scalar, or an array of scalars."""
    if shape == ():
        return Scalar(next(numbers))
    items = np.empty(shape, dtype=object)
    for index in np.ndindex(*shape):
        items[index] = Scalar(next(numbers))
    return array(items)
