"""The base class of all systems."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from math import inf
from types import FunctionType
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import Immutable, ValueEquality, changed
from ...base.reprs import MAX_LINE, facts, shortened
from ...errors import ArgumentError, DTypeError, UnsupportedError
from ...reference.around import ORDER, Bound, wrapped
from ..around import FORCE, Force, Part
from ..inputs import Sampled
from ..parameters import CoreParameters, flat, of_shape

if TYPE_CHECKING:
    from ...reference.mass import Mass
    from ...reference.quantities import Quantity
    from ...reference.sampled import Loop
    from ..controls import AnyControl, ConstraintControl, EnergyControl, Projection
    from ..inputs import Input
    from ..methods import Method
    from ..surfaces import Surface

#: A step so short that no gain of a control is too large for it.
TINY = 1e-200


class System(Immutable, ValueEquality, ABC):
    """Two blocks, velocities ``v`` and coordinates ``y``, and a rate for each.

    Attributes:
        kernel: the name of its files in the core and in the reference.
        reference: its class in the reference.
        v_shape: shape of a member's velocity block.
        y_shape: shape of a member's coordinate block.
        axes: names of the blocks' axes, for messages.
        second_order: whether ẏ is v times a number, so that ÿ = a(t, y) if no force depends on v.
        velocity_term: the name of a term that depends on the velocity, or None.
        linear: whether the rates are linear in v, y and the inputs.
        complex_step: whether the reference is correct for numbers with an infinitesimal imaginary part, which is the fastest way
            to its derivatives; those of other systems come from their tape.
        input_names: the names of the inputs that it accepts, each a number.
        mass_matrix: the mass matrix M, if some equations of M·ẏ = f are algebraic; the rates are then f.
        batch: shape to which the parameters broadcast.
        around: the parts around its equations, from the inside out; see ``model/around.py``.
        constraint: the name of the constraint on its coordinates that a control or projection can keep; None without one.
        kept: the control or projection that keeps this constraint, or None; ``integrate`` sets it.

    Example:
        >>> system = sw.Oscillator(omega=[1.0, 2.0, 3.0])
        >>> isinstance(system, sw.System), system.batch, system.linear
        (True, (3,), True)
    """

    kernel: ClassVar[str]
    reference: ClassVar[type[Any]]
    axes: ClassVar[str] = ""
    linear: bool = False
    complex_step: bool = False
    second_order: bool = True
    v_shape: Shape = ()
    y_shape: Shape = ()
    velocity_term: str | None = None
    input_names: tuple[str, ...] = ()
    mass_matrix: Mass | None = None
    batch: Shape = ()
    around: tuple[Part, ...] = ()
    constraint: ClassVar[str | None] = None
    #: The arguments whose numbers reach the step as they are, and what each number is above.
    unchanged: ClassVar[dict[str, float]] = {}
    kept: ConstraintControl | Projection | None = None
    _free: System | None = None
    #: The parameters of some members of a batch, if the system is for these members: see ``of_members``.
    _members: tuple[dict[str, Any], list[Bound]] | None = None

    @property
    def kind_name(self) -> str:
        """The name of its kind of system."""
        return type(self).__name__

    @property
    def _instead(self) -> str:
        return (
            f"make another {self.kind_name}, with what is to change; in a World use world.set(…) or world.parameters, or make "
            f"another that goes on from here: World(system, method, resume=world)"
        )

    def part(self, kind: str) -> Any:
        """The part of that kind around its equations, or None."""
        for part in self.around:
            if part.kind == kind:
                return part
        return None

    @property
    def control(self) -> EnergyControl | Projection | None:
        """The control or projection of its energy, or None; ``integrate`` sets it."""
        if not self.around:
            return None  # the usual case, and a run needs it several times
        control: EnergyControl | Projection | None = self.part("control")
        return control

    @property
    def controller(self) -> Any:
        """The sampled controller around it, or None."""
        return self.part("controller") if self.around else None

    @property
    def has_stick_friction(self) -> bool:
        """True if friction that sticks acts on its velocities."""
        return self.part("friction") is not None

    @property
    def contacts(self) -> tuple[Surface, ...]:
        """The surfaces that its points meet, if the rows of its blocks are points."""
        surfaces = self.part("surfaces")
        return () if surfaces is None else surfaces.surfaces

    @property
    def keeper(self) -> AnyControl | None:
        """The control or projection that acts on it, or None: the argument of ``integrate``, with its target in numbers."""
        return self.control if self.kept is None else self.kept

    @property
    def uncontrolled(self) -> System:
        """This system without its control."""
        return self if self._free is None else self._free

    @abstractmethod
    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""

    def __repr__(self) -> str:
        control = [] if self.keeper is None else [repr(self.keeper)]
        return shortened(f"{type(self).__name__}({', '.join([*self._all_arguments(), *control])})", 2 * MAX_LINE)

    def _all_arguments(self) -> list[str]:
        return [*self.repr_arguments(), *(argument for part in self.around for argument in part.repr_arguments())]

    def _repr_html_(self) -> str:
        """The arguments as a table, for notebooks, with what its states are."""
        arguments = [
            (name, value) if equal else ("", name)
            for name, equal, value in (each.partition("=") for each in self._all_arguments())
        ]
        words = [value for name, value in arguments if not name]
        return facts(
            type(self).__name__,
            [
                ("", ", ".join(words)) if words else ("", ""),
                *((name, value) for name, value in arguments if name),
                ("control", "" if self.keeper is None else repr(self.keeper)),
                ("shape of v", str(self.v_shape)),
                ("shape of y", str(self.y_shape)),
                ("members", str(self.batch) if self.batch else "1, or as many as the states have"),
                ("linear", "yes" if self.linear else "no"),
            ],
        )

    def with_fused_rates(self) -> System | None:
        """The system with ``fused=True`` if it says itself which products of its rates are fused; None if a tape shows which."""
        return None

    @property
    def fuses_on_tape(self) -> bool:
        """True if products of a step that the rates do not fuse are fused on the tape of the step."""
        return True

    @abstractmethod
    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The parameters of its equations by name, for states of that batch shape: the arguments of its reference after the step.

        Each is a string, a whole number, a list of whole numbers as bytes (four for each, the lowest first), an array (its own
        axes first, then those of the batch), a signal, a list of signals, or None for a term that is left out. The core takes
        the same values under the same names.
        """

    @property
    def groups(self) -> tuple[int, ...]:
        """The group of each number of v, then of y, whose errors are judged together; see ``reference/acceptance.py``."""
        return ()

    def reference_at_step(self, h: float, batch: Shape) -> Any:
        """The NumPy reference of its equations, without the parts around them, scaled to the step h, for that batch shape."""
        return self.reference(h, **self.own_parameters(batch))

    def scaled(self, h: float, batch: Shape, force: Array | None = None) -> Any:
        """The NumPy reference of its equations and all parts around them, scaled to the step h, for that batch shape.

        ``force`` is added to v̇.

        Raises:
            UnsupportedError: if there is a sampled controller, which sets parameters from step to step.
        """
        self.not_in_a_loop("system")
        return wrapped(self.reference_at_step(h, batch), h, self.parts(batch, force))

    def not_in_a_loop(self, what: str) -> None:
        """Raise if there is a sampled controller."""
        if self.controller is not None:
            raise UnsupportedError(
                f"{what}: {self!r} has a sampled controller, which remembers, so that a step goes on from more than v and y, and "
                f"is another one at each sample. What is asked for is that of a map from one state to the next"
            )

    def out_of_the_loop(self) -> Self:
        """This system without its sampled controller."""
        if self.controller is None:
            return self
        return changed(self, **self.operations(), around=tuple(part for part in self.around if part.kind != "controller"))

    def looped(self, h: float, batch: Shape, force: Array | None = None) -> tuple[Loop, Callable[[list[Array]], Any]]:
        """The controller in the loop of the reference, and a function from what it sets to what ``scaled`` returns."""
        parts = self.parts(batch, force)
        own = next(parameters for part, parameters in parts if part.kind == "controller")
        loop = self.controller.loop(self, own)

        def scaled(numbers: list[Array]) -> Any:
            return wrapped(self.reference(h, **self.controller.put(self, self.own_parameters(batch), numbers)), h, parts)

        return loop, scaled

    def own_parameters(self, batch: Shape) -> dict[str, Any]:
        """The parameters of its equations by name; those of its members, if it is for some members of a batch."""
        return self.equation_parameters(batch) if self._members is None else of_shape(self._members[0], batch)

    def parts(self, batch: Shape, force: Array | None = None) -> list[Bound]:
        """Each part around its equations with its parameters by name; the force from outside, if there is one, is last."""
        if self._members is None:
            parts = [(part, part.parameters(self.y_shape, batch)) for part in self.around]
        else:
            parts = [(part, of_shape(parameters, batch)) for part, parameters in self._members[1]]
        if force is not None:
            parts.append((Force(len(self.v_shape)), {FORCE: force}))
        return parts

    def arguments(self) -> dict[str, Any]:
        """The arguments of which it was made, as they were checked; those that only help to find others are None."""
        code = type(self).__init__.__code__
        names = code.co_varnames[1 : code.co_argcount + code.co_kwonlyargcount]
        return {name: self.contacts or None if name == "floor" else getattr(self, name, None) for name in names}

    def with_arguments(self, arguments: dict[str, Any]) -> Self:
        """This system with other numbers, inputs or surfaces in place of some arguments."""
        fresh = type(self)(**(self.uncontrolled.arguments() | arguments))
        own = {} if self._free is None else {"_free": self._free.with_arguments(arguments)}
        return changed(self, **joined(self, fresh, arguments), **own)

    def operations(self) -> dict[str, Any]:
        """The attributes that hold its operations, which other numbers do not change."""
        return {}

    def direct(self) -> dict[str, tuple[str, float]]:
        """The arguments whose numbers reach the step as they are: the name in the core, and what each number is above."""
        return {name: (name, least) for name, least in self.unchanged.items()}

    def structure(self) -> Any:
        """A key of all but the numbers that reach the step as they are: systems of equal keys differ in these alone.

        None if that is more than numbers and words, which may change unseen.
        """
        return _contents(self, self.direct())

    def numbers_of_step(self, batch: Shape, *, series: bool) -> list[Array]:
        """The arrays of numbers that a step takes, in the order of the core; all else follows from the structure."""
        return [value for _, value in self.parameters(batch, series=series) if type(value) is np.ndarray]

    def with_numbers_of(self, other: System, v: Array, y: Array) -> System:
        """Another system of the same structure, known for the shapes of this state, as this one is."""
        return other.for_state_shapes(v, y)

    def own_axes(self, name: str) -> int:
        """How many axes of its own an argument has that does not reach the step as it is."""
        return 0

    def surrounded(self, part: Part) -> Self:
        """This system with a further part around its equations, which replaces one of the same kind; controllers go together.

        Args:
            part: something that acts on the system, such as a spring to a moving anchor; see docs/developing/adding.md.

        Raises:
            ArgumentError: if the batch of the part does not broadcast with that of the system.
            UnsupportedError: if the part does not work with the system.
        """
        if not isinstance(part, Part):
            raise DTypeError(f"part: expected something around a system, got {checks.short(part)} ({type(part).__name__})")
        part.check(self)
        part = part.beside(self.part(part.kind))
        return changed(
            self,
            around=self._around_with(part),
            batch=checks.batch_shape({"system": self.batch, part.kind: part.batch}),
            linear=False,
            complex_step=False,
            velocity_term=self.velocity_term if self.velocity_term is not None else part.velocity_term,
        )

    def with_operations(self, part: Part) -> Self:
        """This system with another part of the same kind and the same operations."""
        batch = checks.batch_shape({"system": self.batch, part.kind: part.batch})
        return changed(self, **self.operations(), around=self._around_with(part), batch=batch)

    def _around_with(self, part: Part) -> tuple[Part, ...]:
        parts = [each for each in self.around if each.kind != part.kind]
        return tuple(sorted([*parts, part], key=lambda each: ORDER.index(each.kind)))

    def of_members(self, batch: Shape, own: dict[str, Any], parts: list[Bound]) -> Self:
        """This system for some members of a batch, with the parameters of their equations and parts, along one batch axis."""
        return changed(self, batch=batch, _members=(own, parts))

    def all_parameters(self, batch: Shape) -> dict[str, Any]:
        """The parameters of its equations and of the parts around them, by name."""
        parameters = dict(self.own_parameters(batch))
        for _, of_part in self.parts(batch):
            parameters |= of_part
        return parameters

    @property
    def chooses(self) -> bool:
        """True if the rates are made of pieces between which the state or the time chooses."""
        return False

    def parameters(self, batch: Shape, *, series: bool = False, single: bool = False) -> CoreParameters:
        """The parameters of its equations and of the parts around them, in the form that the core takes.

        For a method that needs the ``series`` of a solution, a system of own equations adds derivatives. ``single`` is whether
        steps are computed in float32; parameters are then the same, and operations of own equations are not.
        """
        return flat(self.all_parameters(batch), batch)

    def named(self, name: str, index: Shape) -> str:
        """The name of a number among the parameters: an argument, and the index in it."""
        return f"{name}[{','.join(map(str, index))}]" if index else name

    @property
    def quantities(self) -> dict[str, Shape]:
        """The quantities that the core can record beside the states, with the shape of each; the reference defines them."""
        recorded: dict[str, Quantity] = getattr(self.reference, "quantities", {})
        return {name: each.shape(self.y_shape[-1] if self.y_shape else 1) for name, each in recorded.items()}

    def recorded_shapes(self) -> dict[str, Shape]:
        """The quantities, and what a sampled controller sets, which only a run can record while it steps."""
        held = {} if self.controller is None else {each.name: each.shape for each in self.controller.targets(self)}
        return held | self.quantities

    def energy(self, v: Array, y: Array) -> Array:
        """The energy of states with the blocks' axes first and axes of the batch last.

        Raises:
            UnsupportedError: if the system has none of its own.
        """
        if "energy" not in self.quantities:
            raise UnsupportedError(f"energy: {self!r} has no energy of its own; compute what you mean by it from v and y")
        v, y = (each if hasattr(each, "shape") else np.asarray(each) for each in (v, y))
        batch = np.broadcast_shapes(v.shape[len(self.v_shape) :], y.shape[len(self.y_shape) :])
        with np.errstate(all="ignore"):
            return self.recordable("energy", v, y, 1.0, batch)

    def recordable(self, name: str, v: Array, y: Array, dt: float, batch: Shape | None = None) -> Array:
        """A quantity, computed from the states of a run with that step to the bits that recording it gives.

        ``batch`` is the shape of the batch, by default that of y.
        """
        batch = y.shape[len(self.y_shape) :] if batch is None else batch
        quantity: Array = self.reference_at_step(dt, batch).record(name, v, y)
        return quantity

    def auxiliary(self, t: float, v: Array, y: Array) -> Array:
        """The auxiliary outputs z (§3) of states at time t, shape (outputs, *batch).

        Raises:
            UnsupportedError: if the system has none.
        """
        raise UnsupportedError(f"z: {self!r} has no auxiliary outputs")

    def check_time(self, last: float) -> None:
        """Raise if an input of the system is not defined up to a time."""
        for each in self.all_inputs().values():
            each.check(last)

    def doubt(self, y: Array) -> tuple[str, Any] | None:
        """A message if the rates are meaningless at some of these saved coordinates, with the members concerned; or None."""
        return None

    def for_state_shapes(self, *states: Any) -> System:
        """This system for states of these shapes; a system whose size is not fixed yet takes it from them."""
        return self

    def controlled(self, control: Any, v: Array, y: Array, dt: float) -> Self:
        """This system under a control; without a target of its own, the control keeps the value of this state.

        Raises:
            UnsupportedError: if the system has no energy that a control can keep.
        """
        if self.keeps(control):
            return self._with_constraint_control(control)
        self._controllable(control)
        with np.errstate(all="ignore"):
            _, kinetic, energy = self.reference_at_step(1.0, y.shape[len(self.y_shape) :]).energies(v, y)
        return self._with_control(control.aimed(kinetic, energy, dt))

    def under(self, control: Any, batch: Shape) -> Self:
        """This system under a control, for unknown states of that batch shape: with the operations of a step, and any target.

        Raises:
            UnsupportedError: if the system has no energy that a control can keep.
        """
        if self.keeps(control):
            return self._with_constraint_control(control)
        self._controllable(control)
        return self._with_control(control.aimed(np.ones(batch), np.zeros(batch), TINY))

    def keeps(self, control: Any) -> bool:
        """True if a control or projection is that of the system's own constraint."""
        constraint = getattr(control, "constraint", None) or getattr(control, "way", None)
        return constraint is not None and constraint == self.constraint

    def _with_constraint_control(self, control: Any) -> Self:
        if getattr(control, "target", None) is not None:
            raise ArgumentError(f"target: {control!r} keeps a constraint of {self!r}, which is its own target; leave it out")
        free = self.uncontrolled
        batch = checks.batch_shape({"system": free.batch, "control": control.batch})
        return cast("Self", changed(free, _free=free, kept=control, batch=batch))

    def constraint_parameters(self) -> dict[str, Any]:
        """The parameters of the constraint: ``keeps``, which is "control", "projection" or None, and ``strength``."""
        if self.kept is None:
            return {"keeps": None, "strength": None}
        strength = getattr(self.kept, "strength", None)
        return {"keeps": "projection" if strength is None else "control", "strength": strength}

    def _controllable(self, control: Any) -> None:
        if self.contacts:
            raise UnsupportedError(f"control: {self!r} meets surfaces, and a control of its energy would undo what they do")
        if (name := getattr(control, "constraint", None)) is not None:
            raise UnsupportedError(f"control: {control!r} keeps a {name}, and {self!r} has no such constraint")
        if getattr(control, "way", "scaling") not in ("scaling", "nacozy") or not isinstance(control, Part):
            raise UnsupportedError(f"control: {control!r} is for an invariant of an own system, and {self!r} has none")
        if not hasattr(self.reference, "energies"):
            raise UnsupportedError(f"control: {self!r} has no energy control")

    def _with_control(self, control: EnergyControl | Projection) -> Self:
        return changed(self, _free=self.uncontrolled, around=self._around_with(control), velocity_term="energy control")

    def stepped_by(self, method: Method) -> Self:
        """This system for a method: if what its stages use is of different times, a control acts between steps."""
        if self.control is None:
            return self
        between = method.needs_acceleration or method.has_series or bool(method.kept)
        if getattr(self.control, "between", between) == between:
            return self
        return changed(self, around=self._around_with(changed(self.control, between=between)))

    # ---- inputs, which the transition-matrix form and the analysis of a linear system need

    def given_inputs(self) -> dict[str, Input]:
        """The inputs of its equations by name, without those that are left out."""
        return {}

    def all_inputs(self) -> dict[str, Input]:
        """The inputs of its equations and of the parts around them, by name."""
        inputs = self.given_inputs()
        for part in self.around:
            inputs = inputs | part.inputs
        return inputs

    @property
    def samples(self) -> tuple[float, float]:
        """The shortest interval between samples of its inputs, and the time of the last sample; (∞, −∞) without samples."""
        sampled = [each for each in self.all_inputs().values() if isinstance(each, Sampled) and not each.constant]
        if not sampled:
            return inf, -inf
        last = max(each.start + each.interval * (len(each.values) - 1) for each in sampled)
        return min(each.interval for each in sampled), last

    def jumps(self, begin: float, end: float) -> Array:
        """The times from ``begin`` to ``end`` at which its inputs or their derivatives jump: ascending, each once."""
        return np.unique(np.concatenate([np.empty(0), *(each.jumps(begin, end) for each in self.all_inputs().values())]))

    @property
    def reads_time(self) -> bool:
        """True if its equations depend on the time otherwise than through inputs."""
        return False

    @property
    def switches_by_time(self) -> bool:
        """True if its rates are made of pieces between which the time alone chooses."""
        return False

    def switching_times(self, begin: float, end: float) -> Array:
        """The times from ``begin`` to ``end``, and some around, at which rates take another piece whatever the state is.

        Their shape is (times, *batch).
        """
        return np.empty(0)

    def over_steps(self, method: Method, t0: Any, dt: float) -> Self:
        """This system with the means over each step from ``t0`` in place of held samples that are shorter than a step."""
        sampled = [each for each in self.all_inputs().values() if isinstance(each, Sampled)]
        # Methods that carry something in place of v evaluate rates in the middle of the span of a step.
        first = t0 if method.carry is None else t0 - 0.5 * dt
        if self.controller is not None and self.controller.timing is None:
            timed = self.controller.over_steps(dt)
            whole = self.over_steps_of_inputs(first, dt, sampled)
            return changed(whole, **whole.operations(), around=whole._around_with(timed))
        return self.over_steps_of_inputs(first, dt, sampled)

    def over_steps_of_inputs(self, first: Any, dt: float, sampled: list[Sampled]) -> Self:
        """The means over each step from ``first``, without a controller."""
        if all(each.over_steps(first, dt) is each for each in sampled):
            return self

        def means(value: Any) -> Any:
            if isinstance(value, dict):
                return type(value)({name: means(each) for name, each in value.items()})
            if isinstance(value, tuple):
                return tuple(map(means, value))
            if isinstance(value, Part):
                return of(value)
            return value.over_steps(first, dt) if isinstance(value, Sampled) else value

        def of(value: Any) -> Any:
            return changed(value, **{name: means(each) for name, each in vars(value).items() if not name.startswith("_")})

        whole: Self = of(self)
        return whole

    @property
    def has_time(self) -> bool:
        """True if its rates may depend on the time."""
        return bool(self.all_inputs())

    def without_inputs(self) -> System:
        """This system without inputs."""
        return self

    def with_pulse(self, name: str, values: Array, interval: float, start: float = 0.0) -> System:
        """This system with these samples as its only input."""
        raise KeyError(name)


#: A system is known by its parameters if they have at most so many bytes, but for those of which the shapes alone count.
MOST_BYTES_OF_PARAMETERS = 1 << 14


def _contents(part: Immutable, direct: Iterable[str]) -> tuple[Any, ...] | None:
    """All that tells a system, or a part of it, from others, but for the numbers of direct arguments; None if that is unknown."""
    contents: list[Any] = [type(part)]
    size = 0
    for name, each in vars(part).items():
        kind = type(each)
        contents.append(name)
        if kind is np.ndarray:
            if name in direct:
                contents.append(each.shape)
                continue
            size += each.nbytes
            if size > MOST_BYTES_OF_PARAMETERS or each.dtype.hasobject:
                return None
            contents += (each.shape, each.dtype.char, each.tobytes())
        elif kind is float:
            contents.append(each.hex())  # zeros have signs
        elif each is None or kind is str or kind is bool or kind is int:
            contents += (kind, each)
        elif kind is tuple and all(type(length) is int for length in each):
            contents.append(each)
        elif isinstance(each, Immutable) and (of_part := _contents(each, ())) is not None:
            contents.append(of_part)
        else:
            return None
    return tuple(contents)


def joined(system: System, fresh: System, names: Iterable[str]) -> dict[str, Any]:
    """The attributes that a system takes from a new one with other arguments of these names."""
    kinds = {part.kind for part in fresh.around}
    around = [*fresh.around, *(part for part in system.around if part.kind not in kinds)]
    batches = {"system": fresh.batch, "control": () if system.keeper is None else system.keeper.batch}
    changes = {name: getattr(fresh, name) for name in names if name != "floor"}
    if around:
        changes["around"] = tuple(sorted(around, key=lambda part: ORDER.index(part.kind)))
    return changes | {"batch": checks.batch_shape(batches)}


def wrapping_hint(function: FunctionType) -> str:
    """The phrase of a message that says how a function of rates becomes a system."""
    name, taken = function.__name__, function.__code__.co_varnames[: function.__code__.co_argcount]
    if taken[:1] == ("t",) and len(taken) > 1 and "v" not in taken[1:2] and (len(taken) == 2 or taken[2:3] != ("y",)):
        return f"for ẏ = f(t, y) wrap it with sw.system(order=1)({name}), or @sw.system(order=1)"
    return f"wrap it with sw.system({name}), or @sw.system"


def a_system(value: Any) -> System:
    """Return the argument ``system`` if it is one."""
    if not isinstance(value, System):
        if type(value).__name__ == "Definition":
            return a_system(value())
        if isinstance(value, FunctionType):
            raise DTypeError(f"system: expected a system, got the function {value.__name__}; {wrapping_hint(value)}")
        raise DTypeError(f"system: expected a stepwell system such as Oscillator(), got {type(value).__name__}")
    return value


def shown(**arguments: Any) -> list[str]:
    """Arguments for a repr: without those that are None, and arrays by their shape."""
    short = {k: f"array{v.shape}" if isinstance(v, np.ndarray) and v.ndim else v for k, v in arguments.items() if v is not None}
    return [f"{k}={v}" for k, v in short.items()]
