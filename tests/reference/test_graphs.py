"""Equal bits for every input, proven and not sampled: what the core traces of a step and what the reference does are one graph.

Both write to one tape, on which equal operations stand once. So they are the same graph if they end in the same values of it.
"""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference.adaptive import pace
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from support import families, own_systems
from support.cases import ADAPTIVE, SYSTEMS, drawn, fits
from support.graphs import MANY, assert_one_graph, methods, model
from support.own_methods import adams_bashforth_2
from support.refusals import refused
from support.tracing import ABLE, CONTROLS, METHODS, made

#: Whether numbers are of float32, which does not work with series.
SINGLE = pytest.mark.parametrize("single", [False, True], ids=["float64", "float32"])


def assert_traced(system: sw.System, method: sw.Method, what: str = "step", single: bool = False) -> None:
    tape = _core.Tape(single=single)
    core = tape.trace(model(system, method, single=single), what)
    assert_one_graph(tape, core, getattr(Tracer(system, tape), what)(method))


def controlled(name: str, control: str) -> sw.System:
    system, v, y = made(name)
    with np.errstate(all="ignore"):
        return system.controlled(CONTROLS[control], v, y, 1e-3)


@SINGLE
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_step(name: str, single: bool) -> None:
    """In float32 four methods of each system, which compute its rates alike; in the long run all."""
    system, _, _ = made(name)
    able = [method for method in methods(system) if not (single and method.has_series)]
    for method in drawn(able, 4 if single and not families.LONG else None, "float32", name):
        assert_traced(system, method, single=single)


OF_BODIES = [name for name in SYSTEMS if "bod" in name and "restricted" not in name]


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("name", OF_BODIES)
def test_a_step_and_an_attempt_under_control(name: str, control: str) -> None:
    """A push needs the step of the attempt, a projection does not; by PEFRL the push comes after the step."""
    system, pefrl = controlled(name, control), sw.method("pefrl")
    for method in methods(system):
        assert_traced(system, method)
    for method in ABLE[:1] if int(np.prod(system.v_shape)) > MANY else ABLE:
        if fits(system, method):
            assert_traced(system, method, "attempt")
    assert_traced(system.stepped_by(pefrl), pefrl)


@pytest.mark.parametrize("projection", ["scaling", "nacozy", "energy"])
def test_an_attempt_backward_under_a_projection(projection: str) -> None:
    """It sees energies and gradients of a step of −1, and what it adds is told of a step of 1.

    Methods for stiff systems and the series negate elsewhere what they read of bodies, which changes no bit.
    """
    system, v, y = made("own: pendulum" if projection == "energy" else "three bodies")
    system = system.controlled(sw.Projection(projection), v, y, 1e-3)
    for method in ABLE:
        if not fits(system, method) or ((method.is_implicit or method.has_series) and projection != "energy"):
            continue
        tape = _core.Tape()
        plan = engine.Plan(system, method, system.batch, 0.1, backward=True)
        assert_one_graph(tape, tape.trace(engine.model(plan), "attempt"), Tracer(system, tape).attempt(method, backward=True))


@pytest.mark.parametrize("control", [sw.Control("energy", 0.3), sw.Control("energy", 0.3, "printed"), sw.Projection("energy")])
def test_an_attempt_and_the_start_under_a_control_of_an_invariant(control: Any) -> None:
    system = own_systems.pendulum().for_state_shapes().under(control, ())
    for method in ABLE:
        if fits(system, method):
            assert_traced(system, method, "attempt")
    assert_traced(system, ABLE[0], "begin")


@pytest.mark.parametrize("name", SYSTEMS)
def test_what_a_method_carries(name: str) -> None:
    """In place of v, or beside it, as an own method of two steps does."""
    system, _, _ = made(name)
    if not any(surface.way != "spring" for surface in system.contacts):  # after a bounce nothing holds that was kept
        tape = _core.Tape()
        core = tape.trace(model(system, adams_bashforth_2), "start 0")
        assert_one_graph(tape, core, Tracer(system, tape).slot(adams_bashforth_2, "start", 0))
    for method in methods(system):
        for choice in range(len(method.starts) or 1) if method.carry else ():
            for which in ("start", "finish"):
                tape = _core.Tape()
                core = tape.trace(model(system, method), f"{which} {choice}")
                assert_one_graph(tape, core, Tracer(system, tape).slot(method, which, choice))


@SINGLE
@pytest.mark.parametrize("name", ADAPTIVE)
def test_an_attempt(name: str, single: bool) -> None:
    """In float32 the tape ends with the state and its error: the length of the next step is computed in float64."""
    system, _, _ = made(name)
    for method in ABLE[:1] if int(np.prod(system.v_shape)) > MANY else ABLE:
        if single and method.has_series:
            continue
        tape = _core.Tape(single=single)
        core, tracer = tape.trace(model(system, method, single=single), "attempt"), Tracer(system, tape)
        assert_one_graph(tape, core, tracer.tried(method) if single else tracer.attempt(method))


@pytest.mark.parametrize("name", ADAPTIVE)
def test_the_start_of_a_run_with_a_tolerance(name: str) -> None:
    """A control does not change the first step, and a series has it as that of the step before, too."""
    for method in (ABLE[0], sw.method("taylor")):
        assert_traced(made(name)[0], method, "begin")


@pytest.mark.mutant
def test_another_start_is_noticed() -> None:
    """A first step that goes by another share of the time is another graph."""
    system, _, _ = made("pendulum")
    tape = _core.Tape()
    core = tape.trace(model(system, ABLE[0]), "begin")
    with pytest.MonkeyPatch.context() as wrong:
        wrong.setattr(pace, "FIRST", 0.02)
        with pytest.raises(pytest.fail.Exception, match=r"the core has .* where the reference has"):
            assert_one_graph(tape, core, Tracer(system, tape).begin(ABLE[0]))


@pytest.mark.parametrize("name", SYSTEMS)
def test_recorded_quantities(name: str) -> None:
    system, _, _ = made(name)
    for quantity in system.quantities:
        tape = _core.Tape()
        core = tape.trace(model(system, METHODS[0]), f"record {quantity}")
        numbers = int(np.prod(system.v_shape)) + int(np.prod(system.y_shape))
        assert_one_graph(tape, core[numbers:], Tracer(system, tape).record([quantity]))


def test_a_difference_is_shown() -> None:
    system, _, _ = made("pendulum")
    tape = _core.Tape()
    core = tape.trace(model(system, sw.method("false_euler")), "step")
    with pytest.raises(pytest.fail.Exception, match=r"the core has .* where the reference has"):
        assert_one_graph(tape, core, Tracer(system, tape).step(sw.method("damped_euler")))


def test_symbols_cannot_be_branched_on() -> None:
    symbol = _core.Tape().state(0)
    for wrong in (lambda: bool(symbol < 1.0), lambda: 1.0 if symbol else 0.0, lambda: symbol == symbol, lambda: float(symbol)):
        refused(TypeError, "no truth value", wrong)
