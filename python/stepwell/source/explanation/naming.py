"""Names of the values of a step: those of a method's text, by symbol, and those of parameters, inputs and states."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from ... import _core
from ...base.arrays import Shape
from ...reference import adaptive, pivoting
from ...reference.acceptance import Acceptance
from ...reference.series import among
from ...reference.signal import COMPOSED, Held
from ...reference.tape import increments
from ...reference.tape.lines import in_order, listed, needed
from ...reference.tape.operations import of_tape
from ...reference.traced import Tracer
from ...runs import engine
from ...runs.engine import Plan


class Named(Tracer):
    """Traces a step and records the names of its values, by their numbers on the tape.

    Attributes:
        names: the first name of each value.
        called: all values with their names, in the order of the evaluations.
    """

    def __init__(self, system: Any, tape: Any, force: Any = None) -> None:
        super().__init__(system, tape, force)
        self.names: dict[int, str] = {}
        self.called: list[tuple[Any, str]] = []
        self._taken: set[str] = set()
        self._length: Any = None
        self._solved = 0

    def step(self, method: Any, choice: int = 0) -> list[Any]:
        """The slots after a step, of which the parts of its elimination are named, too."""
        self._taken.update(method.kept)  # a user's names of these may be those of increments
        with pivoting.noting(self._note_part):
            return super().step(method, choice)

    def scaled(self, h: Any) -> Any:
        """The system, whose evaluations are recorded."""
        s, counts = super().scaled(h), Counter[str]()

        def noting(which: str, rate: Callable[[Any, Any, Any], Any]) -> Callable[[Any, Any, Any], Any]:
            def increment(t: Any, v: Any, y: Any) -> Any:
                if among((v, y)):
                    return rate(t, v, y)  # for derivatives
                counts[which] += 1
                rates = rate(t, v, y)
                for name, block in (("v", v), ("y", y)):
                    self._note(f"{name}{counts[which]}", block)
                self._note(f"d{which}{counts[which]}", rates if self._length is None else self._length * rates)
                return rates

            return increment

        s.dv, s.dy = noting("v", s.dv), noting("y", s.dy)
        return s

    def attempt(self, method: Any, order: int = 0, acceptance: Acceptance = Acceptance(), *, backward: bool = False) -> list[Any]:  # noqa: B008
        """The state and the pace after an attempt; its increments are the rates times the length of its step."""
        _, _, more = self.state()
        self._length = self.pace(acceptance, more).outlook(self.tape.budget()).step
        with pivoting.noting(self._note_part):
            return super().attempt(method, order, acceptance, backward=backward)

    def _note_part(self, word: str, numbers: dict[Shape, Any]) -> None:
        """Note a part of an elimination: its entries by two places, and solutions, of which there are several, by one."""
        if word == "solution":
            self._solved += 1
            word = f"{word}{self._solved}"
        for index, value in numbers.items():
            self._name(indexed(word, index), value)

    def _name(self, name: str, value: Any) -> None:
        """Note the name of one value, and of its negative."""
        if isinstance(value, _core.Symbol):
            self.names.setdefault(value.id, name)
            self.called.append((value, name))

    def _note(self, name: str, block: Any) -> None:
        block = np.asarray(block, dtype=object)
        if name in self._taken:
            return
        for index in np.ndindex(block.shape):
            if isinstance(block[index], _core.Symbol):
                called = indexed(name, index)
                self.names.setdefault(block[index].id, called)
                self.called.append((block[index], called))
                self.names.setdefault((-block[index]).id, f"−{called}")
        self._taken.add(name)


def indexed(name: str, index: Shape) -> str:
    """The name of an element of a block."""
    return f"{name}[{','.join(map(str, index))}]" if index else name


def parameters(plan: Plan) -> tuple[list[str], list[str]]:
    """The names of a system's parameters, number by number in the core's order, and of its sampled inputs."""
    system = plan.system
    if plan.form == "matrix":
        inputs = system.given_inputs()
        values = matrix_of(plan) | {name: each.signal() for name, each in inputs.items()}
    else:
        values = system.all_parameters(plan.batch)
    return named_numbers(plan, values)


def matrix_of(plan: Plan) -> dict[str, Any]:
    """Zeros of the shapes of the matrices of a step: P, (n, n, *batch), and Q, (nodes, inputs, n, *batch)."""
    n = prod(plan.system.v_shape) + prod(plan.system.y_shape)
    inputs = len(plan.system.given_inputs())
    return {"P": np.zeros((n, n, *plan.batch)), "Q": np.zeros((len(plan.method.nodes), inputs, n, *plan.batch))}


def named_numbers(plan: Plan, values: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """The names of all numbers in these values, and of the sampled inputs."""
    numbers: list[str] = []
    tables: list[str] = []
    named = indexed if plan.form == "matrix" else plan.system.named

    def add(name: str, value: Any, own: int | None = None) -> None:
        match value:
            case list():
                for i, each in enumerate(value):
                    add(f"{name}[{i}]", each)
            case Held():
                tables.append(named(name, ()))
            case _ if isinstance(value, COMPOSED):
                for behind, part in value.parts().items():
                    add(name + behind, part)
            case np.ndarray():
                axes = max(0, value.ndim - len(plan.batch))
                numbers.extend(named(name, index) for index in np.ndindex(value.shape[:axes]))

    for name, value in values.items():
        add(name, value)
    return numbers, tables


def kept(plan: Plan) -> list[tuple[str, Shape]]:
    """The blocks that the method keeps beside the state, with their shapes."""
    shapes = plan.system.y_shape, plan.system.v_shape
    return [(name, shapes[of_v]) for name, of_v in zip(plan.method.kept, plan.method.kept_of_v, strict=True)]


def states(plan: Plan, attempts: bool, mark: str = "") -> list[str]:
    """The names of the numbers of a state, with a mark behind them."""
    blocks = [(plan.method.carry or "v", plan.system.v_shape), ("y", plan.system.y_shape), *kept(plan)]
    names = [indexed(name + mark, index) for name, shape in blocks for index in np.ndindex(shape)]
    beside: list[str] = [] if plan.system.control is None else ["work"]
    if attempts:
        each = ("longest", "noise", "failed", *(("relative", "absolute") if plan.acceptance.own else ()))
        groups = range(engine.groups_of(plan))
        beside = [*adaptive.Pace._fields[: engine.PACE_NUMBERS], *(indexed(name, (group,)) for name in each for group in groups)]
        beside += [f"low_{name}" for name in names if plan.acceptance.compensated]
    return names + [name + mark for name in beside]


def coefficients(plan: Plan) -> list[str]:
    """The names of the coefficients that an attempt by a series returns after the state: ``y_3[0]`` is of order 3."""
    if not plan.method.has_series or plan.fused:
        return []
    blocks = [("v", plan.system.v_shape), ("y", plan.system.y_shape)]
    orders = range(1, (plan.order or plan.method.order) + 1)
    return [indexed(f"{name}_{k}", index) for k in orders for name, shape in blocks for index in np.ndindex(shape)]


def increments_last(tracer: Named, roots: Sequence[Any], single: bool = False) -> tuple[Any, dict[int, str], dict[int, str]]:
    """The tape of a step in which increments are multiplied last, the names of its values, and notes on increments without h."""
    lines, places = listed(tracer.tape, [*roots, *(symbol for symbol, _ in tracer.called)])
    lines, place = increments.negated_sums(lines)
    places = [place[each] for each in places]
    order = in_order(lines, places[: len(roots)])
    used, moved = needed(lines, places[: len(roots)])
    work = increments.Rewriting(used, moved, single)
    work.run()
    tape = _core.Tape(single=single)
    symbols: list[Any] = []
    for name, of, extra in work.lines:
        symbols.append(of_tape(tape, name, [symbols[each] for each in of], extra))
    names: dict[int, str] = {}
    left: dict[int, str] = {}
    for (_, name), at in zip(tracer.called, places[len(roots) :], strict=True):
        value = work.values[order[at]] if at in order else None
        if isinstance(value, increments.Increment):
            left.setdefault(symbols[value.x].id, f"{name} but for its factor")
        elif value is not None:
            names.setdefault(symbols[value].id, name)
    return tape, names, left
