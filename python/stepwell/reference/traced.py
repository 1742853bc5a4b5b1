"""The NumPy reference, run with symbols in place of numbers: its tape.

Any tape will do that gives symbols for ``number``, ``state``, ``param``, ``step``, ``time``, ``budget`` and ``sample``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count, tee
from math import prod
from typing import Any

import numpy as np

from . import adaptive, contact, series_pace
from .acceptance import Acceptance
from .around import Bound, wrapped
from .bits import where
from .run import linear_step
from .signal import Held, converted, of_slot, over


def _array(shape: tuple[int, ...], symbols: Any) -> Any:
    """An array of the next symbols."""
    array = np.empty(shape, dtype=object)
    for index in np.ndindex(shape):
        array[index] = next(symbols)
    return array


class Sampled(Held):
    """A sampled input whose samples are the tape's."""

    def __init__(self, tape: Any, table: int) -> None:
        self.tape, self.table = tape, table

    def sample(self, t: Any) -> Any:
        """The sample that holds at time t."""
        return self.tape.sample(self.table, np.asarray(t)[()])


class HeldAll(Held):
    """A sampled input whose value is known: a symbol."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def sample(self, t: Any) -> Any:
        """The value, which is the same at all times."""
        return self.value


class Tracer:
    """A system of symbols, for one member, and what can be traced of it; a force from outside is of shape (*block, *batch).

    Attributes:
        numbers: the values of the parameters: of each symbol its number for every member.
        tables: the sampled inputs themselves.
        times: the numbers of those whose values are the times at which samples begin.
    """

    def __init__(self, system: Any, tape: Any, force: Any = None) -> None:
        self.system, self.tape, self.force = system, tape, force
        self._params, self._tables = map(tape.param, count()), count()
        self.numbers: list[Any] = []
        self.tables: list[Held] = []
        self.times: set[int] = set()
        #: The values of sampled inputs, where these are known and do not depend on a time.
        self._values: Iterator[Any] | None = None

    def state(self) -> tuple[Any, Any, Any]:
        """Both blocks, and the symbols of the state that come after them."""
        symbols = map(self.tape.state, count())
        return _array(self.system.v_shape, symbols), _array(self.system.y_shape, symbols), symbols

    def symbols(self, value: Any, batch: tuple[int, ...]) -> Any:
        """A parameter with symbols for its numbers; behind the axes of their own these have as many axes as the batch."""
        return converted(value, lambda numbers: self._numbers(numbers, max(0, numbers.ndim - len(batch))), self._table)

    def _numbers(self, numbers: Any, own: int) -> Any:
        shape = numbers.shape[:own]
        self.numbers += [numbers[index] for index in np.ndindex(shape)]
        return _array(shape, self._params)

    def _table(self, table: Held) -> Held:
        if table.is_times:
            self.times.add(len(self.tables))
        self.tables.append(table)
        if self._values is not None:
            return HeldAll(next(self._values))
        return Sampled(self.tape, next(self._tables))

    def _own(self) -> dict[str, Any]:
        """The parameters of the system's own equations, with symbols."""
        batch = self.system.batch
        return {name: self.symbols(value, batch) for name, value in self.system.own_parameters(batch).items()}

    def _parts(self) -> list[Bound]:
        """The parts around the system, with symbols for their parameters, which come behind the system's own."""

        def of(part: Any, name: str, value: Any) -> Any:
            return converted(value, lambda numbers: self._numbers(numbers, part.own_axes(name)), self._table)

        parts = self.system.parts(self.system.batch, self.force)
        return [(part, {name: of(part, name, value) for name, value in parameters.items()}) for part, parameters in parts]

    def scaled(self, h: Any) -> Any:
        """The system and all that is around it, scaled to the step h."""
        self.system.not_in_a_loop("system")
        return self._wrapped(h)

    def _wrapped(self, h: Any) -> Any:
        return wrapped(self.system.reference(h, **self._own()), h, self._parts())

    def _looped(self, h: Any, memory: list[Any], *state: Any) -> tuple[Any, list[Any]]:
        """The system with what a sampled controller sets, and what that remembers after a step from a time and a state.

        Without a state it is what the controller holds between two steps.
        """
        own, parts, controller = self._own(), self._parts(), self.system.controller
        of_part = next(parameters for part, parameters in parts if part is controller)
        loop = controller.loop(self.system, of_part)
        out, remembered = loop.step(*state, memory) if state else (loop.held(memory), memory)
        return wrapped(self.system.reference(h, **controller.put(self.system, own, out)), h, parts), remembered

    def _memory(self, more: Any) -> list[Any]:
        """The symbols of what a sampled controller remembers."""
        controller = self.system.controller
        return [next(more) for _ in range(controller.remembers(self.system))] if controller is not None else []

    def step(self, method: Any, choice: int = 0) -> list[Any]:
        """The state after a step, what the method keeps, what a controller remembers, and what a control has added up by then."""
        h = self.tape.step()
        v, y, more = self.state()
        shapes = self.system.y_shape, self.system.v_shape
        kept = [_array(shapes[of_v], more) for of_v in method.kept_of_v]
        memory = self._memory(more)
        s, memory = self._looped(h, memory, self.tape.time(), v, y) if memory else (self.scaled(h), memory)
        if hasattr(s, "work"):
            s.work = next(more)
        blocks = contact.step(method.steps, s, choice, self.tape.time(), h, v, y, *kept)
        return self.flat(*blocks, *memory) + ([s.work] if hasattr(s, "work") else [])

    def slot(self, method: Any, which: str, choice: int) -> list[Any]:
        """The state after a method's ``start`` or ``finish``."""
        h, t = self.tape.step(), self.tape.time()
        v, y, more = self.state()
        shapes = self.system.y_shape, self.system.v_shape
        for of_v in method.kept_of_v:
            _array(shapes[of_v], more)
        memory = self._memory(more)
        s = self._looped(h, memory)[0] if memory else self.scaled(h)
        window, compute = of_slot(t, h), getattr(method.steps, which)
        if method.kept:
            return self.flat(v, y, *over(window, compute, s, choice, t, h, v, y), *memory)
        return self.flat(over(window, compute, s, choice, t, v, y), y)

    def attempted(self, *, backward: bool = False) -> adaptive.Attempted:
        """How an attempt at an adaptive step uses the system."""
        own = self._own()
        s = adaptive.Backward(self.system.reference(-1.0, **own)) if backward else self.system.reference(1.0, **own)
        return adaptive.Attempted(s, self._parts())

    def pace(self, acceptance: Acceptance, more: Iterator[Any]) -> adaptive.Pace:
        """The pace as a part of the state."""
        n = prod(self.system.v_shape), prod(self.system.y_shape)
        numbers = len(adaptive.Pace._fields) - 5 + acceptance.numbers(*n)
        return adaptive.Pace.of([next(more) for _ in range(numbers)], sum(acceptance.counts(*n)), acceptance.compensated * sum(n))

    def attempt(self, method: Any, order: int = 0, acceptance: Acceptance = Acceptance(), *, backward: bool = False) -> list[Any]:  # noqa: B008
        """The state and the pace after an attempt at an adaptive step, by a series of that order if it is one."""
        system = self.attempted(backward=backward)
        v, y, more = self.state()
        pace = self.pace(acceptance, more)
        axes = len(self.system.v_shape), len(self.system.y_shape)
        steps: Any = method.steps
        if method.has_series:
            order = order or steps.ORDER
            following, v, y = series_pace.attempt(order, system, axes, acceptance, pace, self.tape.budget(), v, y)
        else:
            order = method.error_order
            following, v, y = adaptive.attempt(steps, system, order, axes, acceptance, pace, self.tape.budget(), v, y)
        return self.flat(v, y, *following.numbers)

    def extension(self, method: Any, acceptance: Acceptance = Acceptance(), *, backward: bool = False) -> list[Any]:  # noqa: B008
        """The continuous extension of the next step, behind the state and the pace: see ``adaptive.Extension``."""
        v, y, more = self.state()
        pace = self.pace(acceptance, more)
        axes = len(self.system.v_shape), len(self.system.y_shape)
        made = adaptive.extension(method.steps, self.attempted(backward=backward), axes, acceptance, pace, v, y)
        changes = where(made.changes, 1.0, 0.0)
        return self.flat(v, y, *pace.numbers, *(block for pair in made.terms for block in pair), made.step, changes)

    def tried(self, method: Any, *, backward: bool = False) -> list[Any]:
        """The first part of an attempt of float32, before the decision: see ``adaptive.Tried``.

        Its state is v, y, the time, the step, and the value of each sampled input in the step; the results come behind these.
        """
        v, y, more = self.state()
        t, step, (self._values, more) = next(more), next(more), tee(more)
        trial = adaptive.tried(method.steps, self.attempted(backward=backward), t, step, v, y)
        values = [next(more) for _ in self.tables]
        results = [block for pair in ((trial.v, trial.y), *trial.errors, trial.projected) for block in pair]
        return self.flat(v, y, t, step, *values, *results, 0.0 if trial.work is None else trial.work)

    def begin(self, method: Any, acceptance: Acceptance = Acceptance(), *, backward: bool = False) -> list[Any]:  # noqa: B008
        """The state, and the pace at the start of a run with a tolerance."""
        system = self.attempted(backward=backward)
        v, y, more = self.state()
        pace = self.pace(acceptance, more)
        axes = len(self.system.v_shape), len(self.system.y_shape)
        begun = adaptive.begin(system.unit, pace, v, y, axes, acceptance.groups, series=method.has_series)
        return self.flat(v, y, *begun.numbers)

    def record(self, names: Sequence[str]) -> list[Any]:
        """Quantities of a state, and what a sampled controller holds."""
        s, (v, y, more), system = self._wrapped(self.tape.step()), self.state(), self.system
        memory = self._memory(more)
        known = system.quantities
        return self.flat(*(s.record(n, v, y) if n in known else system.controller.held(system, n, memory) for n in names))

    def matrix(self, nodes: Sequence[float], n: int, inputs: list[Any], carries: bool = False) -> list[Any]:
        """The state after a step in transition-matrix form, with these inputs."""
        p, q = (_array(shape, self._params) for shape in ((n, n), (len(nodes), len(inputs), n)))
        inputs = self.symbols(inputs, self.system.batch)
        s = _array((n,), map(self.tape.state, count()))
        step = linear_step(p, q.reshape(prod(q.shape[:2]), n), inputs, nodes, self.tape.step(), carries)
        return self.flat(step(self.tape.time(), s))

    def flat(self, *blocks: Any) -> list[Any]:
        """The symbols of blocks, one after the other; what is known beforehand is one as well."""
        numbers = [number for block in blocks for number in np.asarray(block, dtype=object).reshape(-1).tolist()]
        return [self.tape.number(number) if isinstance(number, float) else number for number in numbers]
