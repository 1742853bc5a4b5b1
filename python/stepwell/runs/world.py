"""The prepared real-time loop."""

from __future__ import annotations

import copy
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..base import checks, registry
from ..base.arrays import Array
from ..base.reprs import MAX_LINE, counted, shortened
from ..errors import ArgumentError, FixedError, ShapeError
from ..model.compatibility import changes_on, fits_together, forced, goes_back, goes_on_alike, velocities
from ..model.controls import AnyControl, a_control
from ..model.methods import Method
from ..model.methods import method as find_method
from ..model.systems import System
from ..model.systems.base import a_system
from . import continuation, engine

if TYPE_CHECKING:
    from collections.abc import Callable

    from .events import Occurrences


class World:
    """A loop over the user's own arrays: everything is checked and prepared once, then ``step`` works in place.

    Args:
        system: the system to step. Its parameters are copied: changing an array of parameters later has no effect.
        method: its name, or what ``stepwell.method`` returns.
        v: velocity block, a writeable C-contiguous array of ``dtype`` and of shape (*block, *batch).
        y: coordinate block, likewise; it may share no memory with ``v``.
        dt: the step, in units of time, below zero to go back.
        t0: time of step 0.
        start_step: number of the first step.
        start: how to start a method that has several ways; see ``method(…).starts``.
        control: an ``EnergyControl`` or a ``Projection``, to keep the energy constant.
        force: what is added to v̇ in every stage: wind, or the push of a player. A C-contiguous array of the dtype and shape of v,
            yours to write to: each call of ``step`` reads it once and takes it as constant over its steps. In the units of v per
            unit of time: for bodies a force per mass, that is an acceleration.
        carry: what the method carries in place of v, from ``resume``, of the shape of ``v``; ``v`` and ``y`` are those of
            the same step.
        carried_by: the method of that carry, from the ``resume`` of a run or a world. Any other method is then refused.
        carried_for: for which system and state it holds, likewise. With another system or state the world begins anew.
        dt_before: the step so far, likewise. Another ``dt`` is then refused.
        fused: compute each step with fused multiply-adds; see ``integrate``.
        dtype: ``"float64"`` or ``"float32"``, of the arrays and of the arithmetic; see ``integrate``.
        events: quantities whose changes of sign are located, as of ``integrate``; those of the last call of ``step`` are in
            ``world.events``. No event stops a member of a world; one with ``then=`` changes its state within the step.
        changed_by: names of the events that changed the state so far, from ``resume``; ``events`` is then needed.

    Raises:
        ArgumentError: what was given and what was expected.
        UnsupportedError: if the method cannot step the system.

    ``step(n)`` makes n steps in place and allocates nothing: it is meant for the few microseconds of a frame, and holds the GIL
    for them. Events are evaluated after each step, which takes a tenth of a millisecond more, and one to three milliseconds where
    one happens. The carry of Verlet and leapfrog is kept inside; if you change ``v`` or ``y`` between steps, the method starts
    again from the new values. Ctrl-C leaves the world at the last complete step, or at the one before (leapfrog of many bodies,
    whose velocity there would take long to compute).
    A world does not check for divergence: use ``numpy.isfinite`` on your arrays. It checks their size now and then after its
    first steps, and warns once if they grew a million times by steps that are beyond the stability limit. Arrays of another
    library are stepped in place, too, where NumPy may write to them (DLPack); ``v`` and ``y`` are then NumPy's views of them.

    System, method and step are fixed; ``World(…, **world.resume)`` makes another world that continues from here.
    ``copy.copy``, ``copy.deepcopy`` and ``pickle`` make an equal world with arrays of its own.

    Warns:
        AccuracyWarning: once, if the state grew a million times by steps beyond the stability limit.

    Example:
        >>> v, y = np.zeros(3), np.ones(3)
        >>> world = sw.World(sw.Oscillator(1.0), "leapfrog", v=v, y=y, dt=0.1)
        >>> world.step(10)
        >>> finer = sw.World(world.system, "rk4", dt=0.01, v=v.copy(), y=y.copy(), t0=world.t)
    """

    __slots__ = (
        "_asked",
        "_core",
        "_dt",
        "_force",
        "_frames",
        "_fused",
        "_given",
        "_method",
        "_start",
        "_system",
        "_t0",
        "_v",
        "_y",
        "step",
    )

    def __init__(
        self,
        system: System,
        method: str | Method,
        *,
        v: Array | None = None,
        y: Array,
        dt: float,
        t0: float = 0.0,
        start_step: int = 0,
        start: str | None = None,
        control: AnyControl | None = None,
        force: Array | None = None,
        carry: Array | None = None,
        carried_by: str | None = None,
        carried_for: str | None = None,
        dt_before: float | None = None,
        fused: bool = False,
        dtype: Any = "float64",
        events: Any = None,
        changed_by: Any = None,
    ) -> None:
        how = find_method(method)
        changes_on(events, changed_by)
        system = copy.deepcopy(a_system(system).for_state_shapes(v, y))
        fits_together(system, how)
        dt = checks.step(dt)
        single = checks.is_single(dtype)
        kind: Any = np.float32 if single else np.float64
        if single:
            from . import float32  # only such worlds need it

            dt = float32.step(system, how, "direct", dt, events=events is not None)
        goes_on_alike(how, dt, carried_by, dt_before)
        t0 = checks.number("t0", t0, unit="units of time")
        batch = checks.shape_of("y", y)[len(system.y_shape) :]
        v = np.empty((0, *batch), np.dtype(kind)) if velocities(system, v) is not v else v
        v = checks.in_place("v", v, (*system.v_shape, *batch), dtype=kind)
        y = checks.in_place("y", y, (*system.y_shape, *batch), dtype=kind)
        if np.shares_memory(v, y):
            raise ArgumentError("v and y: expected two arrays to step in place, got arrays that share memory")
        if force is not None:
            forced(system)
            force = checks.in_place("force", force, v.shape, "to read before the steps", written=False, dtype=kind)
            if np.shares_memory(force, v) or np.shares_memory(force, y):
                raise ArgumentError("force: expected an array of its own, got one that shares memory with v or y")
        if checks.batch_shape({"system": system.batch, "v and y": batch}) != batch:
            raise ShapeError(f"v and y: the system's batch {system.batch} does not broadcast to theirs, {batch}")
        first = checks.count("start_step", start_step, 0)
        choice = how.start_choice(start)
        if carry is not None:
            if how.carry is None:
                raise ArgumentError(f"carry: {how.name} carries nothing but v between steps")
            carry = checks.numbers("carry", carry)
            if carry.shape != v.shape:
                raise ShapeError(f"carry: expected the shape of v, {v.shape}, got {carry.shape}")
            carry = np.ascontiguousarray(carry, dtype=kind).reshape(-1)
        stepped = system
        control = a_control(control)
        if dt < 0.0:
            goes_back(system, control)
        if control is not None:
            if checks.batch_shape({"control": control.batch, "v and y": batch}) != batch:
                raise ShapeError(f"control: its batch {control.batch} does not broadcast to that of v and y, {batch}")
            stepped = system.controlled(control, np.asarray(v, np.float64), np.asarray(y, np.float64), dt)
            fits_together(stepped, how)
            stepped = stepped.stepped_by(how)
        if carry is not None and not continuation.holds(carried_for, stepped, batch, v, y):
            carry = None
        if single:
            float32.check_control(stepped)
            float32.check_inputs(stepped, abs(t0) + first * abs(dt))
        stepped.check_time(abs(t0) + first * abs(dt))
        fused = checks.flag("fused", fused)
        seen = stepped.over_steps(how, t0, dt)
        plan = engine.Plan(seen, how, batch, dt, t0, first, choice=choice, fused=fused, force=force, single=single)
        # Views: the core knows rows, not axes.
        watched = None if force is None else force.reshape(-1)
        loop = _core.World(engine.model(plan), plan, v.reshape(-1), y.reshape(-1), carry, watched)
        self._core = loop
        self._given, self._system, self._method, self._dt = system, stepped, how, dt
        self._t0, self._start, self._v, self._y, self._force, self._fused = t0, start, v, y, force, plan.fused
        self._asked, self._frames = None, None
        make: Callable[..., None] = loop.step
        if events is not None:
            from .events import event, frames  # only such worlds need it

            self._asked = event.several(events)
            self._frames = frames.Frames(plan, self._asked, v, y, loop)
            make = self._frames.step
        # What an event makes of a state tells nothing of the steps.
        is_one_motion = not any(each.then for each in self._asked or ())
        #: ``step(n=1)`` makes n steps in place.
        object.__setattr__(
            self, "step", registry.task("watched_for_growth")(make, loop, stepped, how, dt, v, y) if is_one_motion else make
        )

    step: Any

    def __setattr__(self, name: str, value: object) -> None:
        if not name.startswith("_"):
            raise FixedError(
                f"{name}: a world's {name} cannot be assigned; write into the arrays world.v and world.y, or make another world "
                f"that goes on from here, World(system, method, dt=dt, **world.resume), with what is to change"
            )
        object.__setattr__(self, name, value)

    @property
    def system(self) -> System:
        """The system with its control; its parameters are read-only copies, made with the world."""
        return self._system

    @property
    def method(self) -> Method:
        """The method."""
        return self._method

    @property
    def dt(self) -> float:
        """The step, in units of time."""
        return self._dt

    @property
    def resume(self) -> dict[str, Any]:
        """Arguments with which another ``World``, or ``integrate``, continues from here to the bit; the arrays are copies.

        Give system, method and dt again. With another method leave ``carry`` and ``start`` out. With another dt give
        ``t0=world.t`` and ``start_step=0``, since time is t0 + k·dt, and leave ``carry`` out.
        """
        state: dict[str, Any] = {"v": self._v.copy(), "y": self._y.copy(), "t0": self._t0, "start_step": self.step_number}
        if self._start is not None:
            state["start"] = self._start
        if self._fused:
            state["fused"] = True
        if self._y.dtype == np.float32:
            state["dtype"] = "float32"
        if self._system.keeper is not None:
            state["control"] = self._system.keeper
        if self._force is not None:
            state["force"] = self._force.copy()
        if self._asked is not None:
            from .events.event import names_of_changing  # which they imported

            if names := names_of_changing(self._asked):
                state["changed_by"] = names
        carry = self._core.carry() if self._method.carry is not None else None
        if carry is None:
            return state
        members = self._y.shape[len(self._system.y_shape) :]
        carried_for = continuation.identity(self._system, members, self._v, self._y)
        return state | {"carry": carry.reshape(self._v.shape), "carried_for": carried_for}

    def __repr__(self) -> str:
        members = self._y.shape[len(self._system.y_shape) :]
        many = f", {counted(prod(members), 'member')}" if members else ""
        where = f"dt = {self._dt:g}, step {self.step_number}, t = {self.t:g}{many}"
        return shortened(f"<world of {self._system!r} by {self._method.name}: {where}>", MAX_LINE)

    def __copy__(self) -> World:
        return World(self._given, self._method, dt=self._dt, events=self._asked, **self.resume)

    def __deepcopy__(self, memo: dict[int, Any]) -> World:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self._given, self._method.name, self._dt, self._asked, self.resume)

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
        """What is added to v̇, the array that was given, or None."""
        return self._force

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
        return {} if self._frames is None else self._frames.told

    @property
    def t(self) -> float:
        """The time at which the world stands: t0 + k·dt."""
        return self._core.t

    @property
    def step_number(self) -> int:
        """The number of the step at which the world stands."""
        return self._core.step_number


def _restored(system: System, method: str, dt: float, events: Any, state: dict[str, Any]) -> World:
    # Arrays of a message from another process may be read-only, and begin at an odd place in memory.
    state = {name: np.array(value) if isinstance(value, np.ndarray) else value for name, value in state.items()}
    return World(system, method, dt=dt, events=events, **state)
