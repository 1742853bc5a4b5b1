"""The reference runs over symbols: whatever a step executes can be written on a tape, and the tape computes the same bits."""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell._core import Tape
from stepwell.model.parameters import flat
from stepwell.reference import adaptive, contact
from stepwell.reference.signal import Held
from stepwell.reference.tape.evaluate import Evaluation
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from support import families
from support.cases import ADAPTIVE, SOME, SYSTEMS, drawn, few_implicit, fits, has_branches
from support.tracing import ABLE, CONTROLS, MEMBERS, METHODS, H, T, a_pace, assert_computes, made


def numbers(system: sw.System, tape: Tape, symbols: list[Any], *state: Any, budget: float = 0.0) -> list[Any]:
    """What the tape computes, one operation after the other, of arrays."""
    values = [value for _, value in system.parameters(system.batch)]
    rows = [row for value in values if isinstance(value, np.ndarray) for row in value]
    tables = [Held(value[2], value[1], value[0]) for value in values if isinstance(value, tuple)]
    [(_, _, of_budget)], _ = tape.operations([tape.budget()])
    computed = Evaluation(tape, symbols, dict(enumerate(rows)) | {of_budget: budget}, tables)
    flat_state = [row for block in state for row in np.asarray(block).reshape(-1, MEMBERS)]
    return [np.broadcast_to(value, MEMBERS) for value in computed(flat_state, T, H)]


def scaled(system: sw.System, v: Any, y: Any) -> Any:
    """The system of a step of H, whose last axis is the members'."""
    s = system.scaled(H, system.batch)
    s.axes = (v.ndim - 1, y.ndim - 1)
    return s


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_method_on_every_system(name: str) -> None:
    system, v, y = made(name)
    large = v.size + y.size > 150 * MEMBERS
    for method in METHODS[:3] if large else drawn(METHODS, None if families.LONG else 4, "step", name):
        if fits(system, method):
            tape = Tape()
            symbols = Tracer(system, tape).step(method)
            expected = contact.step(method.steps, scaled(system, v, y), 0, T, H, v, y)
            assert_computes(numbers(system, tape, symbols, v, y), *expected)


@pytest.mark.parametrize("name", ["free", "sinusoid x", "sampled x and a, physical", "three bodies, newton", "linear, masses"])
def test_what_a_method_carries(name: str) -> None:
    system, v, y = made(name)
    for method in METHODS:
        if method.carry is None or not fits(system, method):
            continue
        for choice in range(max(1, len(method.starts))):
            for which in ("start", "finish"):
                tape = Tape()
                symbols = Tracer(system, tape).slot(method, which, choice)
                s = system.scaled(H, system.batch)
                assert_computes(numbers(system, tape, symbols, v, y), getattr(method.steps, which)(s, choice, T, v, y), y)


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("name", ["three bodies", "three bodies in space, newton", "two bodies"])
def test_every_control_with_every_method(name: str, control: str) -> None:
    system, v, y = made(name)
    system = system.controlled(CONTROLS[control], v, y, H)
    for method in few_implicit(METHODS, 1, "control", name, control):
        if fits(system, method):
            tape = Tape()
            symbols = Tracer(system, tape).step(method)
            s = scaled(system, v, y)
            before = s.work = np.linspace(-1.0, 1.0, MEMBERS)
            after = s.project(*method.steps.step(s, T, H, v, y))
            assert_computes(numbers(system, tape, symbols, v, y, before), *after, s.work)


@pytest.mark.parametrize("name", [name for name in SYSTEMS if not name.startswith("thirty-five")])
def test_every_quantity(name: str) -> None:
    system, v, y = made(name)
    for quantity, shape in system.quantities.items():
        tape = Tape()
        symbols = Tracer(system, tape).record([quantity])
        expected = system.scaled(H, system.batch).record(quantity, v, y)
        assert np.shape(expected) == (*shape, MEMBERS)
        assert_computes(numbers(system, tape, symbols, v, y), expected)


@SOME
@pytest.mark.parametrize("name", [name for name in ADAPTIVE if not name.startswith("thirty-five")])
def test_every_attempt(name: str, some: int | None) -> None:
    """Steps that are accepted, rejected, held because they pass the target, extra, and none at all."""
    system, v, y = made(name)
    pace = a_pace(engine.groups_of(engine.Plan(system, ABLE[0], (MEMBERS,), H)))
    near, other = (
        {"target": np.array([9.0, T, 9.0]), "relative": np.array([9.0, 1.0, 9.0])},
        {"extra": np.array([0.01, 0.0, 0.02])},
    )
    paces = [pace, pace._replace(**near), pace._replace(**other)]
    for method in drawn([method for method in ABLE if fits(system, method)], some and 1, "attempt", name):
        tape = Tape()
        symbols = Tracer(system, tape).attempt(method)
        if method.has_series and has_branches(system):
            continue  # with numbers, which member a branch is of is not known; runs evaluate the tape
        s = adaptive.Attempted(system.reference_at_step(1.0, system.batch), system.parts(system.batch))
        with np.errstate(all="ignore"):
            attempt = engine.attempts(engine.Plan(system, method, (MEMBERS,), H), s)
            outcomes = [attempt(each, 9.0, v, y) for each in paces]
        for each, (after, v1, y1) in zip(paces, outcomes, strict=True):
            assert_computes(numbers(system, tape, symbols, v, y, *each.numbers, budget=9.0), v1, y1, *after.numbers)


def test_the_matrix_form() -> None:
    system, _, _ = made("linear, five states, two inputs")
    rng = np.random.default_rng(2)
    nodes, inputs = [0.0, 0.5, 1.0], system.equation_parameters(system.batch)["inputs"]
    tape = Tape()
    symbols = Tracer(system, tape).matrix(nodes, 5, inputs)
    p, q, s = rng.normal(size=(5, 5, MEMBERS)), rng.normal(size=(3, 2, 5, MEMBERS)), rng.normal(size=(5, MEMBERS))
    expected = sw.reference.run.linear_step(p, q.reshape(6, 5, MEMBERS), inputs, nodes, H)(T, s)

    class Matrix:
        batch = system.batch

        @staticmethod
        def parameters(batch: tuple[int, ...]) -> Any:
            return flat({"p": p, "q": q, "inputs": inputs}, batch)

    assert_computes(numbers(Matrix, tape, symbols, s), expected)  # type: ignore[arg-type]
