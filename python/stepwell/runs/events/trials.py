"""Steps of any length from the start of a step: the trials that locate a change of sign."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ...base import registry
from ...base.arrays import Array
from ...model.systems.own import OwnSystem
from ...reference import contact, series_pace, tableau
from ...reference.adaptive import Attempted, longer
from ...reference.series import expanded
from ...reference.signal import of_slot, over
from ...reference.traced import Tracer
from .. import engine
from ..engine import by_tape
from .evaluated import Evaluated
from .members import Members

if TYPE_CHECKING:
    from ...reference.tape.single import Steps

#: A step of an own system with more operations than this is computed by calling its function where NumPy makes the steps.
MOST_OPERATIONS = 4000
#: Steps of up to this many members are made by the core, one after the other: NumPy's calls take as long for one member as for
#: some hundred.
MEMBERS_BY_CORE = 6
#: Shorter units of time have a reciprocal that is no float.
LEAST_UNIT = 2.0**-1000
#: At most this many plans of one member are kept.
MAX_PLANS = 256
#: What was traced, by the number of the tapes of the model, and how much of it is kept.
TRACED: dict[Any, Evaluated] = {}
MOST_TRACED = 256


class Trials:
    """Steps of any members of a plan, from any of their states.

    The function of an own system takes long to call, so its step is traced once for all members. With steps of one length the
    core makes those of a few members. The bits are the same.

    Args:
        plan: the plan of the run.
        members: its members.
    """

    #: Whether the plan has adaptive steps.
    _adaptive = False

    def __init__(self, plan: engine.Plan, members: Members) -> None:
        self._plan, self._members = plan, members
        self._step: tuple[Evaluated, list[Array]] | None = None
        #: Whether the step is replayed from its trace however long it is.
        self._always_traced = False
        self._by_core = plan.backend == "rust" and not plan.single
        #: Whether the core makes a step of one member that has no trace.
        self._steps_one = self._by_core
        self._is_traced = not self._by_core and not isinstance(plan.system, OwnSystem)
        #: In float32: the parts of a step.
        self._singles: list[Steps] = []
        self._plans: dict[int, engine.Plan] = {}
        self._rates: tuple[Evaluated, list[Array]] | None = None
        self._rates_traced = False
        #: Whether what is traced depends on samples. These are looked up by the core, where it locates events by itself.
        self.has_samples = False

    def step(self, index: Any, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
        """A step of these members from v and y, with a time and a length for each."""
        if self._plan.single:
            return self._in_single(index, t, h, v, y)
        if (traced := self._traced_step()) is None or self.has_samples:
            if self._steps_one and len(index) <= MEMBERS_BY_CORE:
                return self._one_by_one(index, t, h, v, y)
            return self._one(self._members.plan(index), t, h, v, y)
        state = [t, h, *_rows(v, self._plan.system.v_shape), *_rows(y, self._plan.system.y_shape)]
        operations, numbers = traced
        rows = operations(state, [each if each.shape[-1] == 1 else each[index] for each in numbers])
        n = len(rows) - y[..., 0].size
        return _block(rows[:n], v), _block(rows[n:], y)

    def of_core(self, what: str) -> tuple[Evaluated, list[Array]] | None:
        """A "step" or the "rates" as operations, with the values of their parameters, if they are traced."""
        if self._plan.single:
            return self._single_of_core(what)
        return self._traced_step() if what == "step" else self._traced_rates()

    @property
    def tables(self) -> list[Any]:
        """The sampled inputs of what is traced: of each the start, the interval, and a row for each sample."""
        return self._model.tables if self.has_samples else []

    def _single_of_core(self, what: str) -> tuple[Evaluated, list[Array]] | None:
        """The trials of float32, whose rates are those of float64; not of a method that carries or keeps something."""
        plan, control = self._everyone, self._plan.system.control
        if self._adaptive or plan.method.begins or control is not None or self._number is None:
            return None
        if what == "rates":
            return self._traced("rates", self._changes)
        tracer, tape, values = by_tape.traced(plan, "step")
        if plan.fuses:
            tape, values = tape.fused(values)
        return Evaluated(tape, values, 2 + len(values), by_core=False), [np.atleast_1d(each) for each in tracer.numbers]

    def _traced_step(self) -> tuple[Evaluated, list[Array]] | None:
        if not self._is_traced:
            self._step, self._is_traced = self._traced("step", self._on), True
        return self._step

    def _in_single(self, index: Any, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
        """A step of these members in float32."""
        if not self._singles:
            plan = self._members.plan(np.arange(self._plan.members))
            self._singles = [by_tape.steps_of_single(plan, part) for part in self._parts()]
        with np.errstate(all="ignore"):
            return self._single_step(self._singles, index, t, h.astype(np.float32).astype(np.float64), v, y)

    def _parts(self) -> list[str]:
        """The parts of a step; what a method carries or keeps is computed again for its length."""
        if self._plan.method.kept:
            return ["start", "step"]
        return ["step"] if self._plan.method.carry is None else ["start", "step", "finish"]

    def _single_step(self, steps: list[Steps], index: Any, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
        rows: list[Any] = [*_rows(v, self._plan.system.v_shape), *_rows(y, self._plan.system.y_shape)]
        works = [np.zeros(len(index))] if self._plan.system.control is not None else []
        n_v, n = len(_rows(v, self._plan.system.v_shape)), len(rows)
        numbers = n + self._plan.method.kept_numbers(n_v, n - n_v)
        for part, each in zip(self._parts(), steps, strict=True):
            at = t + h if part == "finish" else t
            rows = each([*rows, *works], at, h, *by_tape.some_of(each, index))[:numbers]
        return _block(rows[:n_v], v), _block(rows[n_v:n], y)

    def rates(self, index: Any, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
        """By how much v and y of these members would change in a step of this length at their rates here."""
        if self._plan.system.mass_matrix is not None:
            plan, sign = self._members.plan(index), -1.0 if self._plan.backward else 1.0
            return v, sign * h * registry.task("algebraic_rates")(plan.system, y, sign * t, h)  # v has no numbers
        if (traced := self._traced_rates()) is None or self.has_samples:
            s = self._scaled(self._members.plan(index), h)
            with np.errstate(all="ignore"):
                dv, dy = s.dv(t, v, y), s.dy(t, v, y)
            return np.broadcast_to(dv, v.shape), np.broadcast_to(dy, y.shape)
        operations, numbers = traced
        state = [t, h, *_rows(v, self._plan.system.v_shape), *_rows(y, self._plan.system.y_shape)]
        changes = operations(state, [each if each.shape[-1] == 1 else each[index] for each in numbers])
        n = len(changes) - y[..., 0].size
        return _block(changes[:n], v), _block(changes[n:], y)

    def _traced_rates(self) -> tuple[Evaluated, list[Array]] | None:
        if not self._rates_traced:
            self._rates, self._rates_traced = self._trace_rates(), True
        return self._rates

    def _trace_rates(self) -> tuple[Evaluated, list[Array]] | None:
        if not self._by_core and not isinstance(self._plan.system, OwnSystem):
            return None
        return self._traced("rates", self._changes)

    def _changes(self, tracer: Tracer, plan: engine.Plan, t: Any, h: Any, v: Any, y: Any) -> tuple[Any, Any]:
        """By how much v and y change at their rates, with symbols."""
        s = self._scaled_symbols(tracer, h)
        return np.broadcast_to(s.dv(t, v, y), v.shape), np.broadcast_to(s.dy(t, v, y), y.shape)

    def _traced(self, what: str, blocks: Callable[..., tuple[Any, Any]]) -> tuple[Evaluated, list[Array]] | None:
        """Blocks as operations, with the values of their parameters; None if they have samples, or too many operations.

        What has the same structure has the same operations, which are traced once. A step that the core does not make by one
        tape, as of many bodies, is not traced at all: that would take seconds.
        """
        key = None
        if self._by_core:
            if self._number is None:
                return None
            key = (self._number, what, self._plan.choice)
            if key in TRACED:
                return TRACED[key], self._numbers
        plan, tracer = self._everyone, self._tracer()
        leaves = map(tracer.tape.state, count())
        t, h = next(leaves), next(leaves)
        v, y = (_symbols(shape, leaves) for shape in (plan.system.v_shape, plan.system.y_shape))
        values = tracer.flat(*blocks(tracer, plan, t, h, v, y))
        self.has_samples = bool(tracer.tables)
        if self.has_samples and not self._by_core:
            return None
        evaluated = Evaluated(tracer.tape, values, 2 + v.size + y.size, by_core=self._by_core)
        if not (self._by_core or self._always_traced or evaluated.operations <= MOST_OPERATIONS):
            return None
        if key is not None:
            if len(TRACED) >= MOST_TRACED:
                TRACED.clear()
            TRACED[key] = evaluated
        return evaluated, [np.atleast_1d(each) for each in tracer.numbers]

    @cached_property
    def _everyone(self) -> engine.Plan:
        return self._members.plan(np.arange(self._plan.members))

    @cached_property
    def _number(self) -> int | None:
        """The number of the tape of a step, the same for all plans with it; None if it is not one tape."""
        plan, model = self._plan, self._model
        choice = 0 if self._adaptive else plan.choice
        if _core.in_parts(model, plan.members, choice=choice, attempts=self._adaptive) is not None:
            return None
        return _core.tape_number(model, choice=choice, attempts=self._adaptive)

    @cached_property
    def _model(self) -> _core.ModelSpec:
        return engine.model(self._plan)

    def _tracer(self) -> Tracer:
        # Attempts of fused steps fuse what the rates say; steps of one length are made again without.
        plan = self._everyone
        return Tracer(plan.stepped if self._adaptive else plan.system, _core.Tape(), plan.force)

    @cached_property
    def _numbers(self) -> list[Array]:
        """The values of the parameters of what was traced before, whose order is that of the rows of the model."""
        if not isinstance(self._plan.t0, np.ndarray) and self._plan.lengths is None:
            self.has_samples = bool(self._model.tables)
            return [row for rows in self._model.rows for row in rows]
        tracer = self._tracer()
        self._scaled_symbols(tracer, tracer.tape.state(1))
        self.has_samples = bool(tracer.tables)
        return [np.atleast_1d(each) for each in tracer.numbers]

    def _scaled(self, plan: engine.Plan, h: Any) -> Any:
        """The system of these members, scaled to a length for each."""
        return plan.system.scaled(h, plan.batch, plan.force)

    def _scaled_symbols(self, tracer: Tracer, h: Any) -> Any:
        """The system scaled to a length, with symbols."""
        return tracer.scaled(h)

    def _one_by_one(self, index: Any, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
        """A step of these members by the core."""
        end_v, end_y = np.empty(v.shape), np.empty(y.shape)
        for i, (member, begin, length) in enumerate(zip(index.tolist(), t.tolist(), h.tolist(), strict=True)):
            if member not in self._plans:
                if len(self._plans) >= MAX_PLANS:
                    self._plans.clear()
                self._plans[member] = self._members.plan(np.array([member]))._replace(
                    first=0, steps=1, every=None, threads=1, progress=None, record=(), fused=False
                )
            plan, one = self._plans[member]._replace(t0=begin, dt=length), slice(i, i + 1)
            out = engine.advance(plan, np.ascontiguousarray(v[..., one]), np.ascontiguousarray(y[..., one]))
            end_v[..., one], end_y[..., one] = out.v[-1], out.y[-1]
        return end_v, end_y

    def _one(self, plan: engine.Plan, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
        """A step of all members of a plan, with a time and a length for each."""
        return one_step(plan, t, h, v, y)

    def _on(self, tracer: Tracer, plan: engine.Plan, t: Any, h: Any, v: Any, y: Any) -> tuple[Any, Any]:
        """A step with symbols."""
        s = tracer.scaled(h)
        return (v, y) if tracer.tables and not self._by_core else stepped(plan, s, t, h, v, y)


class AdaptiveTrials(Trials):
    """Trials of a plan with adaptive steps, made as saved states within a step are."""

    _adaptive = True

    def __init__(self, plan: engine.Plan, members: Members) -> None:
        super().__init__(plan, members)
        self._steps_one = False  # the core does not make adaptive steps of a given length
        self._always_traced = plan.method.has_series
        self._is_traced = self._is_traced and not self._always_traced

    def _scaled(self, plan: engine.Plan, h: Any) -> Any:
        return engine.attempted_system(plan).rates(h)

    def _scaled_symbols(self, tracer: Tracer, h: Any) -> Any:
        return tracer.attempted(backward=self._plan.backward).rates(h)

    def _parts(self) -> list[str]:
        return ["tried"]

    def _single_step(self, steps: list[Steps], index: Any, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
        return by_tape.tried(self._plan, steps[0], t, h, v, y, by_tape.some_of(steps[0], index)).projected

    def _one(self, plan: engine.Plan, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
        with np.errstate(all="ignore"):
            v, y = within(plan, engine.attempted_system(plan), t, h, v, y)
        return np.asarray(v), np.asarray(y)

    def _on(self, tracer: Tracer, plan: engine.Plan, t: Any, h: Any, v: Any, y: Any) -> tuple[Any, Any]:
        return within(plan, tracer.attempted(backward=plan.backward), t, h, v, y)


def one_step(plan: engine.Plan, t: Array, h: Array, v: Array, y: Array) -> tuple[Array, Array]:
    """A step of all members of a plan, with a time and a length for each."""
    system: Any = plan.system  # elsewhere the step is one number
    with np.errstate(all="ignore"):
        v, y = stepped(plan, system.scaled(h, plan.batch, plan.force), t, h, v, y)
    return np.asarray(v), np.asarray(y)


def stepped(plan: engine.Plan, s: Any, t: Any, h: Any, v: Any, y: Any) -> tuple[Any, Any]:
    """A step of a method from v and y; what it carries in place of v is computed again for this length."""
    steps: Any = plan.method.steps
    s.axes = plan.block_axes  # behind these are those of members, each with a length of its own
    if plan.method.kept:
        kept = over(of_slot(t, h), steps.start, s, plan.choice, t, h, v, y)
        v, y, *_ = contact.step(steps, s, plan.choice, t, h, v, y, *kept)
        return v, y
    if plan.method.carry is None:
        return tuple(contact.step(steps, s, plan.choice, t, h, v, y))
    slot = over(of_slot(t, h), steps.start, s, plan.choice, t, v, y)
    slot, y = contact.step(steps, s, plan.choice, t, h, slot, y)
    return over(of_slot(t + h, h), steps.finish, s, plan.choice, t + h, slot, y), y


def within(plan: engine.Plan, system: Attempted, t: Any, h: Any, v: Any, y: Any) -> tuple[Any, Any]:
    """A step of this length of a method with adaptive steps."""
    steps: Any = plan.method.steps
    if plan.method.has_series:
        unit = longer(series_pace.unit_of(h), LEAST_UNIT)
        terms, share = expanded(system.unit, plan.order or steps.ORDER, t, (unit, unit), v, y)[0], h * (1.0 / unit)
        v, y = (tableau.polynomial(start, [term[i] for term in terms], share) for i, start in enumerate((v, y)))
    else:
        s = system.rates(h)
        s.axes = plan.block_axes
        if hasattr(steps, "attempt"):  # a user's method, which is not a tableau
            v, y = steps.step(s, t, h, v, y)
        else:
            v, y = tableau.plus(v, y, steps.WEIGHTS, steps.stages(s, t, h, v, y))
    v, y, _ = system.project(v, y)
    return v, y


def _symbols(shape: tuple[int, ...], leaves: Any) -> Any:
    block = np.empty(shape, dtype=object)
    for index in np.ndindex(shape):
        block[index] = next(leaves)
    return block


def _rows(block: Array, shape: tuple[int, ...]) -> list[Array]:
    return [block[index] for index in np.ndindex(shape)]


def _block(rows: list[Array], like: Array) -> Array:
    block = np.empty((len(rows), like.shape[-1]))
    for row, numbers in zip(block, rows, strict=True):
        row[:] = numbers
    return block.reshape(like.shape)
