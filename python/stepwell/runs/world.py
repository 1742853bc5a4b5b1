"""The prepared real-time loop."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import TYPE_CHECKING, Any

from .. import _core
from ..base import registry
from ..base.arrays import Array
from ..base.reprs import MAX_LINE, counted, facts, shortened
from ..errors import FixedError
from ..model.controls import AnyControl
from ..model.methods import Method
from ..model.systems import System
from . import engine
from .continuation import Continuation
from .findings import warn_of
from .options import Options
from .request import Request
from .result import Run

if TYPE_CHECKING:
    from .occurrences import Occurrences


class World:
    """A loop over the user's own arrays: everything is checked and prepared once, then ``step`` works in place.

    Args:
        system: the system to step. Its parameters are copied: changing an array of parameters later has no effect.
        method: its name, or what ``stepwell.method`` returns.
        v: velocity block, a writeable C-contiguous array of ``dtype`` and of shape (*block, *batch).
        y: coordinate block, likewise; it may share no memory with ``v``.
        dt: the step, in units of time, below zero to go back.
        t0: time of step 0, 0 if None.
        start_step: number of the first step, 0 if None.
        start: how to start a method that has several ways; see ``method(…).starts``.
        control: an ``EnergyControl`` or a ``Projection``, to keep the energy constant.
        force: what is added to v̇ in every stage: wind, or the push of a player. A C-contiguous array of the dtype and shape of v,
            yours to write to: each call of ``step`` reads it once and takes it as constant over its steps. In the units of v per
            unit of time: for bodies a force per mass, that is an acceleration.
        fused: compute each step with fused multiply-adds; see ``integrate``.
        dtype: ``"float64"`` or ``"float32"``, of the arrays and of the arithmetic; see ``integrate``.
        events: quantities whose changes of sign are located, as of ``integrate``; those of the last call of ``step`` are in
            ``world.events``. No event stops a member of a world; one with ``then=`` changes its state within the step.
        resume: a world or a run with fixed steps that this one continues, to the bit: all of the above but ``events`` is then
            known, and may be given again, as for ``integrate``. Its arrays are copies; with ``v`` and ``y`` of your own it begins
            from these, in place.

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

    System, method and step are fixed; ``World(system, method, resume=world)`` makes another world that continues from here.
    ``copy.copy``, ``copy.deepcopy`` and ``pickle`` make an equal world with arrays of its own.

    Warns:
        AccuracyWarning: once, if the state grew a million times by steps beyond the stability limit.

    Example:
        >>> v, y = np.zeros(3), np.ones(3)
        >>> world = sw.World(sw.Oscillator(1.0), "leapfrog", v=v, y=y, dt=0.1)
        >>> world.step(10)
        >>> finer = sw.World(world.system, "rk4", dt=0.01, v=v.copy(), y=y.copy(), t0=world.t)
    """

    __slots__ = ("_core", "_events", "_frames", "_plan", "_start", "_system", "_v", "_y", "step")

    def __init__(
        self,
        system: System,
        method: str | Method,
        *,
        v: Array | None = None,
        y: Array | None = None,
        dt: float | None = None,
        t0: float | None = None,
        start_step: int | None = None,
        start: str | None = None,
        control: AnyControl | None = None,
        force: Array | None = None,
        fused: bool | None = None,
        dtype: Any = None,
        events: Any = None,
        resume: Run | World | None = None,
    ) -> None:
        options = Options(
            v=v, y=y, dt=dt, t0=t0, start_step=start_step, start=start, control=control, force=force, fused=fused, dtype=dtype,
            events=events, resume=resume,
        )  # fmt: skip
        request = Request.in_place(system, method, options)
        plan = request.plan
        self._plan, self._system, self._start, self._events = plan, request.system, request.start, request.events
        self._v, self._y = v, y = request.v, request.y
        # Views: the core knows rows, not axes.
        force = None if plan.force is None else plan.force.reshape(-1)
        self._core = loop = _core.World(engine.model(plan), plan, v.reshape(-1), y.reshape(-1), request.slot, force)
        self._frames = None
        make: Callable[..., None] = loop.step
        if request.events is not None:
            from .events import frames  # only such worlds need it

            self._frames = frames.Frames(plan, request.events, v, y, loop)
            make = self._frames.step
        # A state that an event changed says nothing about the growth by steps.
        if not any(each.then for each in request.events or ()):
            make = registry.task("watched_for_growth")(make, loop, request.system, plan.method, plan.dt, v, y)
        #: ``step(n=1)`` makes n steps in place.
        object.__setattr__(self, "step", make)
        if request.system.keeper is not None:
            from .diagnostics import of_a_strong_control

            warn_of(of_a_strong_control(request.system, v, y, plan.dt))

    step: Any

    def __setattr__(self, name: str, value: object) -> None:
        if not name.startswith("_"):
            raise FixedError(
                f"{name}: a world's {name} cannot be assigned; write into the arrays world.v and world.y, or make another world "
                f"that goes on from here, World(system, method, resume=world), with what is to change"
            )
        object.__setattr__(self, name, value)

    @property
    def system(self) -> System:
        """The system with its control; its parameters are read-only copies, made with the world."""
        return self._system

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
        plan = self._plan
        options: dict[str, Any] = {"t0": plan.t0, "start_step": self.step_number, "dt": plan.dt, "start": self._start}
        options |= {"fused": plan.fused, "dtype": str(self._y.dtype), "control": self._system.keeper}
        options["force"] = None if plan.force is None else plan.force.copy()
        carry = self._core.carry() if plan.method.carry is not None else None
        carry = None if carry is None else carry.reshape(self._v.shape)
        names = tuple(each.name for each in self._events or () if each.then)
        return Continuation(self._system, plan.method, self._v.copy(), self._y.copy(), options, carry, changed_by=names)

    def __repr__(self) -> str:
        members = self._y.shape[len(self._system.y_shape) :]
        many = f", {counted(prod(members), 'member')}" if members else ""
        where = f"dt = {self.dt:g}, step {self.step_number}, t = {self.t:g}{many}"
        return shortened(f"<world of {self._system!r} by {self.method.name}: {where}>", MAX_LINE)

    def _repr_html_(self) -> str:
        """What is stepped and how far it is, as a table for notebooks."""
        pairs = [
            ("system", repr(self._system)),
            ("method", self.method.title),
            ("dt", f"{self.dt:g}"),
            ("step", self.step_number),
        ]
        return facts("World", [*pairs, ("t", f"{self.t:g}"), ("shape of y", self._y.shape)])

    def __copy__(self) -> World:
        return _again(self._standing(), self._events)

    def __deepcopy__(self, memo: dict[int, Any]) -> World:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self._standing(), self._events)

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


def _again(standing: Continuation, events: Any) -> World:
    return World(standing.system, standing.method, events=events, resume=standing)  # type: ignore[arg-type]  # a world's state
