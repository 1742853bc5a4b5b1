"""The prepared real-time loop."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, prod
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..base import checks, registry
from ..base.arrays import Array
from ..base.reprs import MAX_LINE, counted, facts, shortened
from ..errors import ArgumentError, FixedError, ShapeError, UnsupportedError
from ..model import setting
from ..model.inputs import Input
from ..model.methods import Method
from ..model.systems import System
from . import engine, float32
from .continuation import Continuation, bits_of_parameters
from .findings import warn_of
from .findings.watched import watched
from .live import LARGEST, PLAIN, Live, Parameters, members_at
from .options import named, with_options
from .request import Request
from .start import controlled

if TYPE_CHECKING:
    from typing import Unpack

    from .occurrences import Occurrences
    from .options.table import RunOptions

#: By this share of each number algebraic equations may be off in a state that was written, where those of other members are as
#: the steps left them.
MOST_WRITTEN = 1e-3
#: Whether algebraic equations hold takes as long as many short steps: it is asked after calls 1, 3, 7, …, and each of so many.
LOOKS = 64


@with_options("World")
class World:
    """A loop over the user's own arrays: everything is checked and prepared once, then ``step`` works in place.

    Args:
        system: the system to step. Its parameters are copied: changing an array of parameters later has no effect; ``set`` and
            ``parameters`` change them.
        method: its name, or what ``stepwell.method`` returns.
        **options: those that go with a world, of the table in ``stepwell.runs.options``; ``help(stepwell.World)`` shows them.

    Raises:
        ArgumentError: what was given and what was expected.
        UnsupportedError: if the method cannot step the system.

    ``step(n)`` makes n steps in place and allocates nothing: it is meant for the few microseconds of a frame, and holds the GIL
    for them. Events are evaluated after each step, which takes a tenth of a millisecond more, and one to three milliseconds where
    one happens. The carry of Verlet and leapfrog is kept inside; if you change ``v`` or ``y`` between steps, the method starts
    again from the new values. Ctrl-C leaves the world at the last complete step, or at the one before (leapfrog of many bodies,
    whose velocity there would take long to compute).
    A world warns once if its state is not finite after a call of ``step``, or within eight steps where it has more than 256
    numbers. It checks their size now and then after its first steps, and warns once if they grew a million times by steps that
    are beyond the stability limit. Arrays of another library are stepped in place, too, where NumPy may write to them (DLPack);
    ``v`` and ``y`` are then NumPy's views of them.

    Method, step and the operations of the system are fixed; ``World(system, method, resume=world)`` makes another world that
    continues from here. The numbers of the system live: ``set`` and ``parameters`` change them between steps, and ``reset`` gives
    members of a batch new states and parameters.
    ``copy.copy``, ``copy.deepcopy`` and ``pickle`` make an equal world with arrays of its own.

    Warns:
        DivergenceWarning: once, if the state is no longer finite.
        AccuracyWarning: once, if the state grew a million times by steps beyond the stability limit, if an amount became
            negative, which its equations do not reach, if algebraic equations do not hold any more, or if a net gained energy
            or a quaternion is short by steps alone.

    Example:
        >>> v, y = np.zeros(3), np.ones(3)
        >>> world = sw.World(sw.Oscillator(1.0), "leapfrog", v=v, y=y, dt=0.1)
        >>> world.step(10)
        >>> world.set(omega=1.1)
        >>> world.step(10)
        >>> finer = sw.World(world.system, "rk4", dt=0.01, v=v.copy(), y=y.copy(), t0=world.t)
    """

    __slots__ = ("_control", "_core", "_events", "_frames", "_live", "_options", "_plan", "_start", "_system", "_v", "_y", "step")

    def __init__(self, system: System, method: str | Method, **options: Unpack[RunOptions]) -> None:
        request = Request.in_place(system, method, named("World", options))
        plan = request.plan
        self._plan, self._system, self._start, self._events = plan, request.system, request.start, request.events
        self._v, self._y = v, y = request.v, request.y
        # Views: the core knows rows, not axes.
        force = None if plan.force is None else plan.force.reshape(-1)
        self._core = loop = _loop(plan, v.reshape(-1), y.reshape(-1), request.slot, force)
        if plan.memory is not None and request.slot is None:
            loop.remember(plan.memory.astype(y.dtype).reshape(-1))
        self._frames, self._options = None, request.going_on
        self._live: dict[str, Live] = {}
        #: The control as it was given, without a target of its own: members that are reset aim at that of their new state.
        control = options.get("control")
        self._control = control if getattr(control, "target", self) is None else None
        make: Callable[..., bool] = loop.step
        if request.events is not None:
            from .events import frames  # only such worlds need it

            self._frames = frames.Frames(plan, request.events, v, y, loop)
            make = self._frames.step
        # A state that an event changed says nothing about the growth by steps.
        grows = not any(each.then for each in request.events or ())
        if request.system.mass_matrix is not None:
            make = self._holding(make, y)
        #: ``step(n=1)`` makes n steps in place.
        step = watched(make, loop, request.system, plan.method, plan.dt, v, y, grows)
        object.__setattr__(self, "step", step)
        if request.system.keeper is not None:
            from .findings.strong_control import of_a_strong_control

            warn_of(of_a_strong_control(request.system, v, y, plan.dt))

    step: Any

    def _holding(self, make: Callable[..., bool], y: Array) -> Callable[..., bool]:
        """``make`` for a system with algebraic equations, which have to hold in a state that was written between its calls."""
        left, waits, pause = y.copy(), 0.0, 1

        def step(n: int = 1) -> bool:
            """Make n steps in place, and return whether the state is no longer finite."""
            nonlocal waits, pause
            if not np.array_equal(left, y, equal_nan=True):
                registry.task("algebraic_start")(self.system, y, self.t, MOST_WRITTEN, 0.0)
            before, waits = self.t, waits - 1
            diverged = make(n)
            if waits <= 0 and not diverged:
                from .findings.algebraic import lost_equations

                waits = pause = min(2 * pause, LOOKS)
                sizes = np.maximum(np.abs(left), np.abs(y))
                if found := lost_equations(self._plan, (left, before), (y, self.t), sizes, True):
                    waits = inf
                    warn_of(found, 3)
            left[...] = y
            return diverged

        return step

    def __setattr__(self, name: str, value: object) -> None:
        if not name.startswith("_"):
            raise FixedError(
                f"{name}: a world's {name} cannot be assigned; write into the arrays world.v and world.y, or make another world "
                f"that goes on from here, World(system, method, resume=world), with what is to change"
            )
        object.__setattr__(self, name, value)

    @property
    def system(self) -> System:
        """The system with its control and its parameters as they are now, which are read-only copies."""
        changes = {name: each.array.copy() for name, each in self._live.items() if each.differs()}
        if changes:
            self._took(setting.with_parameters(self._system, changes))
        return self._system

    @property
    def parameters(self) -> Parameters:
        """The parameters as arrays to write into, by name: each call of ``step`` takes what is in them.

        An array has the shape (*own, *batch), or that of a number where all members have it in common; it is of float64. Writing
        a number takes a tenth of a microsecond, and the next step sees it. A number that is not finite, or that the system would
        refuse, is an error of the next call of ``step``, which then makes no step. Parameters that are not here, since something
        is computed from them, are changed by ``set``.

        Example:
            >>> @sw.system
            ... def wheel(t, v, y, *, torque=0.0, inertia=2.0):
            ...     return torque / inertia
            >>> v, y = np.zeros(1), np.zeros(1)
            >>> world = sw.World(wheel(), "false_euler", v=v, y=y, dt=0.5)
            >>> torque = world.parameters["torque"]
            >>> torque[...] = 3.0
            >>> world.step(2)
            >>> v
            array([1.5])
        """
        self._has_parameters()
        return Parameters(self)

    def _has_parameters(self) -> None:
        """Raise if steps do not read parameters any more."""
        if self._plan.method.is_exact:
            raise UnsupportedError(
                "parameters: exact steps by matrices that were computed from them; make another world that goes on from here, "
                "World(system, method, resume=world)"
            )

    def set(self, **parameters: Any) -> None:
        """Give parameters other numbers, for the steps to come.

        Args:
            parameters: arguments of the system by name, and ``gain`` and ``target`` (``c``, ``k``) of its control. Numbers of the
                shapes that the system takes; an input for an input of the same kind; ``floor`` as for the system.

        Raises:
            ArgumentError: if a name or a number is wrong; nothing was changed then.
            UnsupportedError: if other operations would follow: of what was left out, or of another size or kind.

        Nothing is traced anew unless an array for each member takes the place of a number for all, which takes about a
        millisecond once. A method that carries something in place of v starts again from the state, as by
        ``World(system, method, resume=world)``, whose bits the steps have. The target of a control stays what it was.

        Example:
            >>> v, y = np.zeros(1), np.zeros(1)
            >>> world = sw.World(sw.Pendulum(a=0.0), "false_euler", v=v, y=y, dt=0.01)
            >>> world.set(a=3.0)
            >>> world.step()
            >>> v
            array([0.03])
        """
        live = self._live
        if not live:
            self._has_parameters()
        for name, value in parameters.items():
            each = live.get(name)
            if each is None or type(value) not in PLAIN or not each.least < value <= each.most:
                break
        else:
            for name, value in parameters.items():
                live[name].array.fill(value)
            return
        self._set(parameters)

    def _set(self, parameters: dict[str, Any]) -> None:
        before = self.system
        parameters = {name: self._spread(name, value) for name, value in parameters.items()}
        self._take(setting.with_parameters(before, parameters), parameters)
        known = setting.direct(self._system, self._plan.batch)
        for name in parameters:
            if name in known:
                self._live_array(name)  # so that the next time takes no more than writing it

    def _spread(self, name: str, value: Any) -> Any:
        """Numbers for all members over the array that the parameter has, so that this stays as wide as it is."""
        each, axes = self._live.get(name), len(self._plan.batch)
        if each is None or not axes or each.array.shape[-axes:] != self._plan.batch or isinstance(value, Input):
            return value
        numbers = checks.numbers(name, value)
        if numbers.ndim and numbers.shape == each.array.shape[:-axes]:
            numbers = numbers.reshape(*numbers.shape, *(1,) * axes)
        sizes = zip(numbers.shape, each.array.shape, strict=False)
        fits = numbers.ndim in (0, each.array.ndim) and all(one in (1, size) for one, size in sizes)
        return np.array(np.broadcast_to(numbers, each.array.shape)) if fits else numbers

    def _take(self, system: System, names: Any) -> None:
        """Go on with other parameters."""
        plan = self._plan
        batch = checks.batch_shape({"system": system.batch, "v and y": plan.batch})
        if batch != plan.batch:
            raise ShapeError(
                f"{', '.join(names)}: their batch {system.batch} does not broadcast to that of v and y, {plan.batch}"
            )
        if plan.single:
            float32.check_inputs(system, abs(plan.t0) + self.step_number * abs(plan.dt))
        system.check_time(abs(plan.t0) + self.step_number * abs(plan.dt))
        new = plan._replace(system=system.over_steps(plan.method, plan.t0, plan.dt))
        setting.same_operations(plan.system.parameters(batch), new.system.parameters(batch), names)
        carry, memory = None, None if plan.memory is None else self._core.memory()
        if plan.method.begins:
            one, other = (list(bits_of_parameters(each.system, batch)) for each in (plan, new))
            carry = self._core.carry() if one == other else None  # the same numbers, written otherwise
        self._core.take(engine.model(new), new)
        if memory is not None:
            self._core.remember(memory)
        if carry is not None:
            self._core.restart([], carry)
        for name, direct in setting.direct(system, batch).items():
            if (each := self._live.get(name)) is not None and each.array.shape == direct.numbers.shape:
                each.array[...] = direct.numbers
            elif each is not None:
                each.array.flags.writeable = False  # what is written into it would not be read
                del self._live[name]
        self._took(system)
        if self._live:
            self._watch()
        if system.keeper is not None:
            from .findings.strong_control import of_a_strong_control

            warn_of(of_a_strong_control(system, self._v, self._y, plan.dt), 4)

    def _took(self, system: System) -> None:
        """Remember the parameters with which the core steps, or will."""
        plan = self._plan
        self._plan = plan._replace(system=system.over_steps(plan.method, plan.t0, plan.dt))
        self._system = system
        for each in self._live.values():
            each.known[...] = each.array
        if self._frames is not None:
            self._frames.renew(self._plan)

    def _live_array(self, name: str) -> Array:
        """The array of a parameter, which is read before each call of ``step`` from now on."""
        if (each := self._live.get(name)) is None:
            system = self.system
            if (direct := setting.direct(system, self._plan.batch).get(name)) is None:
                setting.check_name(system, name)
                raise UnsupportedError(f"parameters[{name!r}]: other numbers are computed from it; use world.set({name}=…)")
            self._core.read()
            most = checks.LARGEST_SINGLE if self._plan.single else LARGEST
            each = self._live[name] = Live(np.array(direct.numbers), np.array(direct.numbers), direct.row, direct.least, most)
            self._watch()
        return each.array

    def _watch(self) -> None:
        """Let the core read the arrays of all parameters that live."""
        arrays = [(name, each.array.reshape(-1), each.row, each.least, each.most) for name, each in self._live.items()]
        self._core.watch(engine.model(self._plan), arrays)
        if self._frames is not None:
            self._frames.refresh = lambda: self.system

    def reset(self, members: Any, /, *, v: Any = None, y: Any = None, **parameters: Any) -> None:
        """Give members of the batch new states and parameters; all others go on as if nothing had happened, to the bit.

        Args:
            members: which: an index, a slice, a mask or an array of indices along the batch axes, or a tuple of these.
            v: their velocities, shape (*block, *members), or (*block,) for all of them; as they are if None.
            y: their coordinates, likewise.
            parameters: their parameters by name, shape (*own, *members) or (*own,). A parameter that all members had in common
                is one of each member from then on, which takes about a millisecond once.

        Raises:
            ArgumentError: if a name or a number is wrong; nothing was changed then.

        The time and the step number are those of all members. What a method carries in place of v, and the target of a control
        that was given none, start again from the new states. Bodies and particles do not see each other's members.

        Example:
            >>> v, y = np.zeros(4), np.ones(4)
            >>> world = sw.World(sw.Pendulum(np.ones(4)), "leapfrog", v=v, y=y, dt=0.1)
            >>> world.step(10)
            >>> world.reset(y < 0.7, v=0.0, y=0.5, omega=2.0)
            >>> world.reset(2, y=-1.0)
            >>> y
            array([ 0.5,  0.5, -1. ,  0.5])
        """
        plan = self._plan
        batch = plan.batch
        places = members_at(members, batch)
        over, index = places.shape, places.reshape(-1)
        if v is None and y is None and not parameters:
            raise ArgumentError("v, y, parameters: expected some of them, got none; reset(members, v=…, y=…)")
        if parameters:
            self._has_parameters()
        self._core.read()  # what was written to arrays before counts as set for all members
        system = self.system
        blocks = [(self._v, "v", v, system.v_shape), (self._y, "y", y, system.y_shape)]
        states = [
            (array, setting.of_some(name, value, own, over))
            for array, name, value, own in blocks
            if value is not None and array.size
        ]
        if plan.single:
            for name, (_, numbers) in zip("vy", states, strict=False):
                checks.fits_single(name, numbers)
        live: list[tuple[Array, Array]] = []
        wider: dict[str, Any] = {}
        for name, value in parameters.items():
            setting.check_name(system, name)
            each = self._live.get(name)
            own_axes = 0 if each is None else each.array.ndim - len(batch)
            if each is not None and own_axes >= 0 and each.array.shape[own_axes:] == batch:
                numbers = setting.of_some(name, value, each.array.shape[:own_axes], over, each.least)
                if plan.single:
                    checks.fits_single(name, numbers)
                live.append((each.array, numbers))
                continue
            whole = setting.of_each_member(system, name, batch)
            own = whole.shape[: whole.ndim - len(batch)]
            whole.reshape(*own, plan.members)[..., index] = setting.of_some(name, value, own, over)
            wider[name] = whole
        after = setting.with_parameters(system, wider) if wider else system
        carry = self._core.carry() if plan.method.begins else None
        for array, numbers in [*states, *live]:
            rows = array.reshape(*array.shape[: array.ndim - len(batch)], plan.members)
            rows[..., index] = numbers
        if wider:
            self._take(setting.with_parameters(self.system, wider), wider)
            known = setting.direct(after, batch)
            for name in wider:
                if name in known:
                    self._live_array(name)
        if self._control is not None:
            self._aim(index)
        self._core.read()
        if plan.memory is not None:
            memory = self._core.memory().reshape(plan.memory_numbers, plan.members)
            begun = self._plan.system.controller.at_start(self._plan.system, batch)
            memory[:, index] = begun.reshape(memory.shape)[:, index]
            self._core.remember(memory.reshape(-1))
        self._core.restart(index.tolist(), carry)

    def _aim(self, index: Any) -> None:
        """Let the control of members that were reset aim at their new state."""
        system, batch = self.system, self._plan.batch
        v, y = (np.asarray(each, np.float64) for each in (self._v, self._y))
        fresh = controlled(system.uncontrolled, self._plan.method, self._control, v, y, self._plan.dt).keeper
        values: dict[str, Any] = {}
        for name in ("gain", "target"):
            old, new = getattr(system.keeper, name, None), getattr(fresh, name, None)
            if old is None or new is None or np.array_equal(old, new):
                continue
            both = [np.array(np.broadcast_to(each, batch)) for each in (old, new)]
            both[0].reshape(-1)[index] = both[1].reshape(-1)[index]
            values[name] = both[0]
        if values:
            self._take(setting.with_parameters(system, values), values)

    @property
    def method(self) -> Method:
        """The method."""
        return self._plan.method

    @property
    def dt(self) -> float:
        """The step, in units of time."""
        return self._plan.dt

    def _standing(self) -> Continuation:
        """The state from which another world goes on; arrays are copies."""
        self._core.read()  # what a method carries does not hold with other parameters
        system, plan = self.system, self._plan
        options: dict[str, Any] = {"t0": plan.t0, "start_step": self.step_number, "dt": plan.dt, "start": self._start}
        options |= {"fused": plan.fused, "dtype": str(self._y.dtype), "control": system.keeper}
        options |= self._options
        options["force"] = None if plan.force is None else plan.force.copy()
        carry = self._core.carry() if plan.method.begins else None
        memory = None
        if plan.memory is not None:
            memory = self._core.memory().reshape(plan.memory_numbers, *plan.batch)
            carry = None if carry is None else carry[: plan.slot_numbers * plan.members]
        carry = None if carry is None else carry.reshape(-1, *plan.batch) if plan.method.kept else carry.reshape(plan.slot_shape)
        names = tuple(each.name for each in self._events or () if each.then)
        return Continuation(system, plan.method, self._v.copy(), self._y.copy(), options, carry, changed_by=names, memory=memory)

    def __repr__(self) -> str:
        members = self._y.shape[len(self._system.y_shape) :]
        many = f", {counted(prod(members), 'member')}" if members else ""
        where = f"dt = {self.dt:g}, step {self.step_number}, t = {self.t:g}{many}"
        return shortened(f"<world of {self._system!r} by {self.method.name}: {where}>", MAX_LINE)

    def _repr_html_(self) -> str:
        """A table for notebooks: system, method, time and step."""
        pairs = [
            ("system", repr(self._system)),
            ("method", self.method.title),
            ("dt", f"{self.dt:g}"),
            ("step", self.step_number),
        ]
        return facts("World", [*pairs, ("t", f"{self.t:g}"), ("shape of y", self._y.shape)])

    def __copy__(self) -> World:
        return _again(*self.__reduce__()[1])

    def __deepcopy__(self, memo: dict[int, Any]) -> World:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        machine = self._plan.device
        return _again, (self._standing(), self._events, self._control, "cpu" if machine is None else machine.described.name)

    @property
    def v(self) -> Array:
        """The velocities, the array that was given."""
        return self._v

    @property
    def y(self) -> Array:
        """The coordinates, the array that was given."""
        return self._y

    @property
    def force(self) -> Array | None:
        """The array that is added to v̇, or None."""
        return self._plan.force

    @property
    def events(self) -> dict[str, Occurrences]:
        """Where the quantities given as ``events=`` changed their signs in the last call of ``step``, by the name of the event.

        Example:
            >>> lowest = sw.Event(lambda t, v, y: y, name="lowest")
            >>> v, y = np.zeros(3), np.ones(3)
            >>> world = sw.World(sw.Pendulum([1.0, 2.0, 3.0]), "rk4", v=v, y=y, dt=0.01, events=lowest)
            >>> world.step(100)
            >>> world.events["lowest"].member, world.events["lowest"].t.round(6)
            (array([1, 2]), array([0.837497, 0.558331]))
        """
        return {} if self._frames is None else self._frames.last_occurrences

    @property
    def t(self) -> float:
        """The time at which the world stands: t0 + k·dt."""
        return self._core.t

    @property
    def step_number(self) -> int:
        """The number of the step at which the world stands."""
        return self._core.step_number


def _loop(plan: engine.Plan, v: Array, y: Array, slot: Array | None, force: Array | None) -> _core.World:
    """The loop of the core, or of a device."""
    model = engine.model(plan)
    if plan.device is None:
        return _core.World(model, plan, v, y, slot, force)
    from ..device.world import World as OnDevice  # only such worlds need it

    return OnDevice(plan.device, model, plan, v, y, slot, force)  # type: ignore[return-value]  # it has the same methods


def _again(standing: Continuation, events: Any, control: Any = None, device: str | None = None) -> World:
    world = World(standing.system, standing.method, events=events, resume=standing, device=device)  # type: ignore[arg-type]  # a world's state
    world._control = control
    return world
