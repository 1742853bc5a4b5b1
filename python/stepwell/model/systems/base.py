"""The base class of all systems."""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import inf, prod
from types import FunctionType
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import Immutable, ValueEquality, changed
from ...base.reprs import MAX_LINE, facts, shortened
from ...errors import ArgumentError, DTypeError, UnsupportedError
from ...reference import contact
from ...reference.around import surrounded
from ...reference.signal import Constant, Curve, Held, Sine, Stepped
from ..inputs import Sampled
from ..surfaces import parameters

if TYPE_CHECKING:
    from ..controls import AnyControl, ConstraintControl, EnergyControl, Projection
    from ..inputs import Input
    from ..methods import Method
    from ..surfaces import Surface

#: A description as the core takes it: names with words, whole numbers, lists of whole numbers (as bytes, four for each), rows of
#: numbers for each member (or one for all), and tables of samples: start, interval, a row for each sample.
Given = list[tuple[str, Any]]


#: The strides of an array of floats along one axis, one after the other in memory.
CONTIGUOUS = (8,)

#: A step so short that no gain of a control is too large for it.
TINY = 1e-200


class System(Immutable, ValueEquality, ABC):
    """Two blocks, velocities ``v`` and coordinates ``y``, and a rate for each.

    Attributes:
        kernel: name of its files in the core and in the reference.
        reference: its class in the reference.
        v_shape: shape of a member's velocity block.
        y_shape: shape of a member's coordinate block.
        axes: names of the blocks' axes, for messages.
        second_order: whether ẏ is v times a number, so that ÿ = a(t, y) if no force depends on v.
        velocity_term: the term that depends on the velocity, or None.
        linear: whether the rates are linear in v, y and the inputs.
        complex_step: whether the reference is correct for numbers with an infinitesimal imaginary part, which is the fastest way
            to its derivatives; those of other systems come from their tape.
        input_names: the inputs that it can be given, each a number.
        batch: shape to which the parameters broadcast.
        control: the control or projection of its energy, or None; ``integrate`` sets it.
        stick_friction: how much friction that sticks slows each velocity in a unit of time, or None; broadcasts over the batch.
        constraint: the name of a constraint on its coordinates, which a control or projection of its own can keep; None without.
        kept: that control or projection, or None; ``integrate`` sets it.
        contacts: surfaces that its points meet, if the rows of its blocks are points.

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
    batch: Shape = ()
    control: EnergyControl | Projection | None = None
    stick_friction: Array | None = None
    constraint: ClassVar[str | None] = None
    kept: ConstraintControl | Projection | None = None
    contacts: tuple[Surface, ...] = ()
    _free: System | None = None

    @property
    def kind_name(self) -> str:
        """What systems of its kind are called."""
        return type(self).__name__

    @property
    def _instead(self) -> str:
        return (
            f"make another {self.kind_name}, with what is to change; for a number that changes each frame use force=, or a state "
            f"whose rate is zero. A World that goes on from here: World(system, method, dt=world.dt, **world.resume)"
        )

    @property
    def keeper(self) -> AnyControl | None:
        """The control or projection that it is under, as ``integrate`` was given it, with its target in numbers."""
        return self.control if self.kept is None else self.kept

    @property
    def uncontrolled(self) -> System:
        """The same system without its control."""
        return self if self._free is None else self._free

    @abstractmethod
    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""

    def __repr__(self) -> str:
        said = self.repr_arguments() + ([] if self.keeper is None else [repr(self.keeper)])
        return shortened(f"{type(self).__name__}({', '.join(said)})", 2 * MAX_LINE)

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks, with what its states are."""
        arguments = [
            (name, value) if equal else ("", name)
            for name, equal, value in (each.partition("=") for each in self.repr_arguments())
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

    @abstractmethod
    def given(self, batch: Shape) -> dict[str, Any]:
        """Its parameters by name, for states of that batch shape: the arguments of its reference class except the step.

        Each is a word, a whole number, a list of whole numbers as bytes (four for each, the lowest first), an array (its own axes
        first, then those of the batch), a signal, a list of signals, or None if it was not given. The core takes the same under
        the same names.
        """

    @property
    def groups(self) -> tuple[int, ...]:
        """The group of each number of v, then of y, whose errors count together; see ``reference/acceptance.py``."""
        return ()

    def reference_at_step(self, h: float, batch: Shape) -> Any:
        """The NumPy reference of this system, scaled to the step h, for states of that batch shape; control left out."""
        return self.reference(h, **self.given(batch))

    def scaled(self, h: float, batch: Shape, force: Array | None = None) -> Any:
        """The NumPy reference of this system with surfaces, control and friction, scaled to the step h, for states of that batch.

        ``force`` is added to v̇.
        """
        s = contact.around(self.reference_at_step(h, batch), h, self.given_contacts(batch))
        s = s if self.control is None else self.control.around(s, h)
        return s if force is None and self.stick_friction is None else surrounded(s, h, force, self.stick_friction)

    def given_contacts(self, batch: Shape) -> dict[str, Any]:
        """The parameters of the surfaces that its points meet, by name."""
        return parameters(self.contacts, self.y_shape[-1], batch) if self.contacts else {}

    def said_of_contacts(self) -> list[str]:
        """The surfaces as an argument, for its repr."""
        if not self.contacts:
            return []
        return [f"floor={self.contacts[0] if len(self.contacts) == 1 else list(self.contacts)}"]

    def given_around(self) -> dict[str, Any]:
        """Parameters of what is around its equations, by name: control and friction."""
        given = {} if self.control is None else self.control.given()
        return given if self.stick_friction is None else given | {"friction.limit": self.stick_friction}

    def all_given(self, batch: Shape) -> dict[str, Any]:
        """The parameters of this system, of its surfaces, its control and its friction, by name."""
        given = dict(self.given(batch))
        if self.contacts:
            given |= self.given_contacts(batch)
        if self.control is not None or self.stick_friction is not None:
            given |= self.given_around()
        return given

    @property
    def chooses(self) -> bool:
        """Whether the rates are made of pieces, one of which is chosen by the state or the time."""
        return False

    def parameters(self, batch: Shape, *, series: bool = False, single: bool = False) -> Given:
        """The parameters of this system, of its surfaces, its control and its friction, in the form that the core takes.

        A system of own equations tells more of them to a method that needs the ``series`` of a solution. ``single`` is whether
        steps are computed in float32; the parameters are the same, operations among them are not.
        """
        return flat(self.all_given(batch), batch)

    def named(self, name: str, index: Shape) -> str:
        """The name of a number among the parameters: that of an argument, and the index in it."""
        return f"{name}[{','.join(map(str, index))}]" if index else name

    @property
    def quantities(self) -> dict[str, Shape]:
        """The quantities that the core can record beside the states, with the shape of each."""
        return {}

    def energy(self, v: Array, y: Array) -> Array:
        """The energy of states with the blocks' axes first and axes of the batch last.

        Raises:
            UnsupportedError: if the system has none of its own.
        """
        raise UnsupportedError(f"energy: {self!r} has no energy of its own; compute what you mean by it from v and y")

    def recordable(self, name: str, v: Array, y: Array, dt: float) -> Array:
        """A quantity computed from the states of a run with that step, with the same bits as if it had been recorded."""
        if name not in self.quantities:
            return self.energy(v, y)
        return np.asarray(self.reference_at_step(dt, y.shape[len(self.y_shape) :]).record(name, v, y))

    def auxiliary(self, t: float, v: Array, y: Array) -> Array:
        """The auxiliary outputs z (§3) of states at time t, shape (outputs, *batch).

        Raises:
            UnsupportedError: if the system has none.
        """
        raise UnsupportedError(f"z: {self!r} has no auxiliary outputs")

    def check_time(self, last: float) -> None:
        """Raise if an input of the system is not defined up to a time."""
        for given in self.given_inputs().values():
            given.check(last)

    def doubt(self, y: Array) -> str | None:
        """A message if the rates are meaningless at some of these coordinates, or None."""
        return None

    def for_state_shapes(self, *states: Any) -> System:
        """The same system for states of these shapes; this matters only for a system whose size is not fixed yet."""
        return self

    def controlled(self, control: Any, v: Array, y: Array, dt: float) -> Self:
        """The same system under control, the target that of the state if the control has none.

        Raises:
            UnsupportedError: if the system has no energy that a control can keep.
        """
        if self.keeps(control):
            return self._kept_by(control)
        self._controllable(control)
        with np.errstate(all="ignore"):
            _, kinetic, energy = self.reference_at_step(1.0, y.shape[len(self.y_shape) :]).energies(v, y)
        return self._held_by(control.aimed(kinetic, energy, dt))

    def under(self, control: Any, batch: Shape) -> Self:
        """The same system under control, in what a step does and not in numbers, for unknown states of that batch shape.

        Raises:
            UnsupportedError: if the system has no energy that a control can keep.
        """
        if self.keeps(control):
            return self._kept_by(control)
        self._controllable(control)
        return self._held_by(control.aimed(np.ones(batch), np.zeros(batch), TINY))

    def keeps(self, control: Any) -> bool:
        """Whether it is the control or projection of the system's own constraint."""
        kept = getattr(control, "constraint", None) or getattr(control, "way", None)
        return kept is not None and kept == self.constraint

    def _kept_by(self, control: Any) -> Self:
        if getattr(control, "target", None) is not None:
            raise ArgumentError(f"target: {control!r} keeps a constraint of {self!r}, which is its own target; leave it out")
        free = self.uncontrolled
        batch = checks.batch_shape({"system": free.batch, "control": control.batch})
        return cast("Self", changed(free, _free=free, kept=control, batch=batch))

    def given_kept(self) -> dict[str, Any]:
        """What keeps the system's constraint, as parameters: ``keeps``, "control" or "projection", and its ``strength``."""
        if self.kept is None:
            return {"keeps": None, "strength": None}
        strength = getattr(self.kept, "strength", None)
        return {"keeps": "projection" if strength is None else "control", "strength": strength}

    def _controllable(self, control: Any) -> None:
        if self.contacts:
            raise UnsupportedError(f"control: {self!r} meets surfaces, and a control of its energy would undo what they do")
        if (name := getattr(control, "constraint", None)) is not None:
            raise UnsupportedError(f"control: {control!r} keeps a {name}, and {self!r} has no such constraint")
        if getattr(control, "way", "scaling") not in ("scaling", "nacozy") or not hasattr(control, "around"):
            raise UnsupportedError(f"control: {control!r} is for an invariant of an own system, and {self!r} has none")
        if not hasattr(self.reference, "energies"):
            raise UnsupportedError(f"control: {self!r} has no energy control")

    def _held_by(self, control: EnergyControl | Projection) -> Self:
        return changed(self, _free=self.uncontrolled, control=control, velocity_term="energy control")

    def stepped_by(self, method: Method) -> Self:
        """The same system, its control acting between steps where v and y of the method's stages belong to different times."""
        if self.control is None:
            return self
        between = method.needs_acceleration or method.has_series
        if getattr(self.control, "between", between) == between:
            return self
        return changed(self, control=changed(self.control, between=between))

    # What the transition-matrix form and the analysis ask of a linear system.

    def given_inputs(self) -> dict[str, Input]:
        """Its inputs by name, without those that were not given."""
        return {}

    @property
    def samples(self) -> tuple[float, float]:
        """The shortest time from one sample of an input to the next, and the time of the last; infinite if none changes so."""
        held = [each for each in self.given_inputs().values() if isinstance(each, Sampled) and not each.constant]
        if not held:
            return inf, -inf
        return min(each.interval for each in held), max(each.start + each.interval * (len(each.values) - 1) for each in held)

    def jumps(self, begin: float, end: float) -> Array:
        """When its inputs or their derivatives jump, from ``begin`` to ``end``: ascending, each time once."""
        return np.unique(np.concatenate([np.empty(0), *(each.jumps(begin, end) for each in self.given_inputs().values())]))

    @property
    def reads_time(self) -> bool:
        """Whether its equations, beside its inputs, depend on the time."""
        return False

    def switching_times(self, begin: float, end: float) -> Array:
        """When its rates take another piece by the time alone, from ``begin`` to ``end`` and some around: (times, *batch)."""
        return np.empty(0)

    def over_steps(self, method: Method, t0: Any, dt: float) -> Self:
        """The same system, whose held samples of less than a step are given by their means over the steps, of each ``t0``."""
        held = [each for each in self.given_inputs().values() if isinstance(each, Sampled)]
        # Rates of methods that carry something in place of v belong to the middle of what is stepped over.
        first = t0 if method.carry is None else t0 - 0.5 * dt
        if all(each.over_steps(first, dt) is each for each in held):
            return self

        def means(value: Any) -> Any:
            if isinstance(value, dict):
                return type(value)({name: means(each) for name, each in value.items()})
            if isinstance(value, tuple):
                return tuple(map(means, value))
            return value.over_steps(first, dt) if isinstance(value, Sampled) else value

        return changed(self, **{name: means(value) for name, value in vars(self).items() if not name.startswith("_")})

    @property
    def has_time(self) -> bool:
        """Whether its rates may depend on the time."""
        return bool(self.given_inputs())

    def without_inputs(self) -> System:
        """The same system without inputs."""
        return self

    def with_pulse(self, name: str, values: Array, interval: float, start: float = 0.0) -> System:
        """The same system with these samples as its only input."""
        raise KeyError(name)


def how_to_wrap(function: FunctionType) -> str:
    """How a function of rates becomes a system."""
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
            raise DTypeError(f"system: expected a system, got the function {value.__name__}; {how_to_wrap(value)}")
        raise DTypeError(f"system: expected a stepwell system such as Oscillator(), got {type(value).__name__}")
    return value


def shown(**given: Any) -> list[str]:
    """Arguments for a repr: those that are not None, arrays by their shape."""
    short = {k: f"array{v.shape}" if isinstance(v, np.ndarray) and v.ndim else v for k, v in given.items() if v is not None}
    return [f"{k}={v}" for k, v in short.items()]


def flat(given: dict[str, Any], batch: Shape) -> Given:
    """A description as the core takes it: what is not there is left out, a list is its length and its parts."""
    entries: Given = []
    for name, value in given.items():
        if value is None:
            continue
        if type(value) is np.ndarray:  # the most frequent case, first because the others take longer
            entries.append((name, rows(value, batch)))
            continue
        match value:
            case str() | int() | bytes():
                entries.append((name, value))
            case list():
                entries.append((name, len(value)))
                entries += flat({f"{name}[{i}]": each for i, each in enumerate(value)}, batch)
            case Sine():
                parts = {"amplitude": value.amplitude, "omega": value.omega, "phase": value.phase}
                entries += flat({f"{name}.{part}": each for part, each in parts.items()}, batch)
            case Constant():
                entries.append((name, rows(value.value, batch)))
            case Stepped() | Curve():
                entries += flat({name + behind: each for behind, each in value.parts().items()}, batch)
            case Held():
                entries.append((name, (value.start, value.interval, rows(value.values, batch, 1))))
            case _:
                entries.append((name, rows(value, batch)))
    return entries


def rows(values: Array, batch: Shape, own: int | None = None) -> Array:
    """Numbers as rows for the core, of one for each member or one for all.

    ``own`` is how many axes there are before those of the batch; if None, those that are more than the batch has.
    """
    if not batch:
        return np.ascontiguousarray(values).reshape(-1, 1)
    if not own and values.strides == CONTIGUOUS and values.shape == batch:
        return values.reshape(1, -1)  # what is given most often of a batch: one number for each member along one axis
    own = max(0, values.ndim - len(batch)) if own is None else own
    counted, over = values.shape[:own], values.shape[own:]
    if all(size == 1 or stride == 0 for size, stride in zip(over, values.strides[own:], strict=True)):
        for _ in over:
            values = values[..., 0]
        return np.ascontiguousarray(values.reshape(-1, 1))
    if over != batch:
        values = np.broadcast_to(aligned(values, own, batch), (*counted, *batch))
    return np.ascontiguousarray(values.reshape(prod(counted), prod(batch)))


def aligned(values: Array, own: int, batch: Shape) -> Array:
    """Numbers with so many axes of their own first, and then as many axes as the batch has."""
    return values.reshape((*values.shape[:own], *(1,) * (len(batch) - values.ndim + own), *values.shape[own:]))
