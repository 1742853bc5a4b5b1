"""The plan of a run, its outcome, and both as the core takes them."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array, Shape, Whole
from ...model.around import FORCE
from ...model.controls import EnergyControl
from ...model.methods import Method
from ...model.parameters import rows
from ...model.systems import System
from ...reference.acceptance import Acceptance

#: Under this name the core takes the times of step 0 of members that have their own.
BEGINS = "time.begins"
#: And under this one the steps of members that have their own.
LENGTH = "time.step"


class Watched(NamedTuple):
    """Quantities whose changes of sign the core notices while it makes steps, as operations, and their number."""

    quantities: _core.Equations
    number: int


class Plan(NamedTuple):
    """A run to make. ``choice`` is the number of the method's start; ``force`` is added to v̇; ``threads`` 0 chooses their number.

    ``t0`` is the time of step 0, or that of each member, shape (*batch), which the core takes as a parameter: see ``of_core``.
    ``single`` is whether steps are computed in float32. With adaptive steps ``order`` is that of a series, ``acceptance`` what a
    step must satisfy, and ``backward`` whether the time of the system is the negated time of the run. ``memory`` is what a
    sampled controller remembers at the start, rows of one number for each member. ``lengths`` are the steps of members
    that have their own, shape (*batch), or None; ``dt`` is then 1: the clock of the core counts steps. ``device`` is the machine
    that makes the steps, of ``devices``, or None for the CPU. ``observer`` is what becomes of states on a device after so many
    steps, or at the times of ``at``, of ``device.reductions``, or None; only the last one is then saved.
    """

    system: System
    method: Method
    batch: Shape
    dt: float
    t0: Any = 0.0
    first: int = 0
    steps: int = 1
    every: int | None = None
    choice: int = 0
    threads: int = 0
    backend: str = "rust"
    form: str = "direct"
    progress: Callable[[float], object] | None = None
    record: tuple[str, ...] = ()
    fused: bool = False
    force: Array | None = None
    watched: Watched | None = None
    order: int = 0
    single: bool = False
    acceptance: Acceptance = Acceptance()  # it is immutable
    backward: bool = False
    memory: Array | None = None
    lengths: Array | None = None
    device: Any = None
    observer: Any = None

    def t0_of(self, members: Any) -> Any:
        """The time of step 0 of these members of one batch axis, or of all."""
        return self.t0[members] if isinstance(self.t0, np.ndarray) else self.t0

    def of_core(self) -> Plan:
        """The plan with one clock for all members, at 0 if each has a time of its own."""
        own = isinstance(self.t0, np.ndarray) or self.lengths is not None
        return self._replace(t0=0.0) if own else self

    @property
    def dtype(self) -> type[Any]:
        """The type of the states."""
        return np.float32 if self.single else np.float64

    @property
    def saves(self) -> Whole:
        """The steps, counted from the first, after which the state is saved: multiples of ``every`` and the last."""
        if self.every is None:
            return np.array([self.steps], dtype=np.int64)
        every = min(self.every, self.steps)
        steps = np.arange(0, self.steps + every, every, dtype=np.int64)  # an array, for there may be millions of them
        steps[-1] = self.steps
        return steps

    @property
    def save_count(self) -> int:
        """The number of saved states."""
        return 1 if self.every is None else -(-self.steps // min(self.every, self.steps)) + 1

    def scaled(self) -> Any:
        """The NumPy reference of the system, scaled to the step, with the force."""
        return self.stepped.scaled(self.dt, self.batch, self.force)

    @property
    def stepped(self) -> System:
        """The system whose rates make the steps: that of the plan, or with fused products where it says which these are."""
        return self._of_fused or self.system

    @property
    def fuses(self) -> bool:
        """True if products are fused on the tape of a step, which shows which these are, beside those that the rates fuse."""
        return self.fused and (self._of_fused is None or self.system.fuses_on_tape)

    @property
    def _of_fused(self) -> System | None:
        # Series and solutions of equations need the derivatives of rates, and Kepler's motions are no forces: on a tape as it is.
        of_rates = self.fused and not (self.method.has_derivatives or self.method.splits)
        return self.system.with_fused_rates() if of_rates else None

    @property
    def by_tape(self) -> bool:
        """True if the NumPy backend evaluates the tape of the reference: for steps that are fused there, float32 and series."""
        return self.fuses or self.single or self.method.has_derivatives

    @property
    def slot_shape(self) -> Shape:
        """The shape of the slot of v; behind the numbers of v, in one axis, stand those that are kept."""
        if not self.keeps:
            return (*self.system.v_shape, *self.batch)
        return (self.slot_numbers + self.memory_numbers, *self.batch)

    @property
    def keeps(self) -> bool:
        """True if more than the slot of v is kept beside y: blocks of the method, or what a sampled controller remembers."""
        return bool(self.method.kept) or self.system.controller is not None

    @property
    def begins(self) -> bool:
        """True if a run begins with more than its state."""
        return self.method.begins or self.keeps

    @property
    def slot_numbers(self) -> int:
        """How many numbers of a member the slot of v has, with those that the method keeps."""
        n_v, n_y = prod(self.system.v_shape), prod(self.system.y_shape)
        return n_v + self.method.kept_numbers(n_v, n_y)

    @property
    def memory_numbers(self) -> int:
        """How many a sampled controller remembers."""
        controller = self.system.controller
        return 0 if controller is None else int(controller.remembers(self.system))

    @property
    def slot_axes(self) -> int:
        """The number of axes of the slot of a member."""
        return 1 if self.keeps else len(self.system.v_shape)

    @property
    def members(self) -> int:
        """The number of trajectories."""
        return prod(self.batch)

    @property
    def block_axes(self) -> tuple[int, int]:
        """The numbers of axes of a block of v and of y."""
        return len(self.system.v_shape), len(self.system.y_shape)


class Arrays(NamedTuple):
    """The arrays of a run for the core: those it starts from and those it fills.

    Attributes:
        v: rows of the v slot, with one number for each member or one for all; behind them those that the method keeps, if
            ``carried``.
        y: rows of y, likewise.
        carried: whether the v slot holds the carry of the method instead of velocities, and what it keeps.
        saved_v: the saved velocities (in the matrix form: v slots), shape (saved, *block, *batch).
        saved_y: the saved coordinates.
        recorded: recorded quantities, shape (saved, numbers, *batch); None if there are none.
        tally: for each member the sum that a control or projection accumulates; None without one.
        carry: the last v slots, and what the method keeps; None if it carries v and keeps nothing.
        first_bad: for each member the first step that was not finite, −1 for none; read and written.
    """

    v: Array
    y: Array
    carried: bool
    saved_v: Array
    saved_y: Array
    recorded: Array | None
    tally: Array | None
    carry: Array | None
    first_bad: Whole


class Outcome(NamedTuple):
    """Saved states, last slots, each member's first step that was not finite, recorded quantities, and the sum of a control.

    ``diverged`` is False if it is known that no member has such a step.
    """

    v: Array
    y: Array
    slot: Array
    first_bad: Whole
    recorded: dict[str, Array] | None = None
    work: Array | None = None
    diverged: bool = True


def model(plan: Plan) -> _core.ModelSpec:
    """The model of a plan, as the core takes it."""
    series = plan.method.has_derivatives
    parameters = plan.stepped.parameters(plan.batch, series=series, single=plan.single)
    own = isinstance(plan.t0, np.ndarray) or plan.lengths is not None
    if own and plan.system.has_time and not plan.single:
        parameters.append((BEGINS, rows(np.asarray(plan.t0, np.float64), plan.batch, 0)))
    if plan.lengths is not None:
        parameters.append((LENGTH, rows(plan.lengths, plan.batch, 0)))
    if plan.force is not None:
        parameters.append((FORCE, rows(np.asarray(plan.force, np.float64), plan.batch, len(plan.system.v_shape))))
    if plan.system.controller is not None:
        if plan.memory is None:
            plan.system.scaled(plan.dt, plan.batch)  # raises
        parameters += plan.system.controller.for_core(plan.system, _places(parameters), single=plan.single)
    if plan.watched is not None:
        parameters.append(("watched()", plan.watched.quantities))
    options: Any = {}
    if plan.record or plan.fuses:
        targets = [] if plan.system.controller is None else plan.system.controller.targets(plan.system)
        held = {each.name: each.row for each in targets if each.name not in plan.system.quantities}
        options = {"record": [held.get(name, name) for name in plan.record], "fused": plan.fuses}
    if plan.order or plan.backward or plan.acceptance != Acceptance():
        options |= {"order": plan.order, "acceptance": tuple(plan.acceptance), "backward": plan.backward}
    if plan.single:
        for name, value in parameters:
            if isinstance(value, tuple) and not name.endswith(".times"):
                checks.fits_single(f"samples of {name}", value[2])
            if isinstance(value, np.ndarray):
                checks.fits_single(name, value)
        options["single"] = True
    return _core.ModelSpec(plan.system.kernel, plan.method.key, parameters, **options)


def _places(parameters: Any) -> dict[str, int]:
    """The number of the first row of each parameter among all."""
    places, rows = {}, 0
    for name, value in parameters:
        if isinstance(value, np.ndarray):
            places[name], rows = rows, rows + len(value)
    return places


def per_step(plan: Plan, work: Array | None) -> Array | None:
    """The work of a control in units of energy, from the core's sum over all evaluations, which has the factor h."""
    if work is None:
        return None
    with np.errstate(over="ignore"):  # infinite is what the energy itself is then
        return np.asarray(np.asarray(work, dtype=np.float64) / (pushes(plan.system.control, plan.method.evaluations) * plan.dt))


def pushes(control: Any, evaluations: int) -> int:
    """How many times a step with this many evaluations adds to the work of a control."""
    return evaluations if isinstance(control, EnergyControl) and not control.between else 1
