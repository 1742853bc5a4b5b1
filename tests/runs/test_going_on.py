"""A run in pieces: what ``resume`` carries, and what is refused."""

import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base.immutable import changed
from stepwell.errors import ArgumentError
from stepwell.runs.continuation import Continuation
from support.cases import SYSTEMS, number
from support.families import LONG, family
from support.heard import quiet
from support.refusals import refused

#: A method of each kind of step, and of those with an estimate.
KINDS = ("false_euler", "rk4", "verlet", "leapfrog", "pefrl", "dop853", "taylor", "rodas4", "trapezoidal")
CHOOSE = ("merson", "dop853", "taylor", "rosenbrock23", "rodas5p")


def chain() -> sw.Chain:
    return sw.Chain(4, stiffness=np.array([1.0, 1e3])[np.newaxis] * np.ones((5, 1)))  # the second member diverges


def piece(method: str, steps: int, **options: Any) -> sw.Run:
    start = {} if {"v", "resume"} & set(options) else {"v": 1.0, "y": np.ones((4, 2)), "dt": 0.1}
    return quiet(sw.integrate, chain(), method, steps=steps, **start, **options)


def test_another_step_is_refused() -> None:
    for method in KINDS:
        half = piece(method, 400)
        for dt in (0.2, np.nextafter(0.1, 1.0)):
            with pytest.raises(ArgumentError, match=re.escape("dt: expected the step of the run that goes on, 0.1, got 0.")):
                piece(method, 400, dt=dt, resume=half)
        anew = piece(method, 1, v=half.v[-1, :, :1], y=half.y[-1, :, :1], t0=half.t[-1], dt=0.2)
        assert anew.t == pytest.approx(40.2)


def test_what_one_method_carries_is_not_for_another() -> None:
    """Leapfrog took Verlet's last y for its v half a step on, without a word."""
    for method, other in (("verlet", "leapfrog"), ("leapfrog", "verlet"), ("verlet", "rk4")):
        half = piece(method, 10)
        with pytest.raises(ArgumentError, match=f"method: expected '{method}', the method of the run that goes on, which"):
            piece(other, 10, resume=half)
    with pytest.raises(ArgumentError, match="resume: expected a run with adaptive steps, since tolerance= or at= was given"):
        sw.integrate(chain(), "merson", at=[2.0], resume=half)
    chosen = sw.integrate(chain(), "merson", v=0.0, y=0.0, tolerance=1e-3, at=[1.0])
    with pytest.raises(ArgumentError, match="resume: expected a run with fixed steps, or a world, got one with adaptive steps"):
        sw.World(chain(), "merson", resume=chosen)


@pytest.mark.parametrize("method", ["rk4", "verlet"])
def test_the_step_need_not_be_given_again(method: str, tmp_path: Path) -> None:
    """Where a member diverges within a piece, and with another start of Verlet's."""
    start = "first_order" if method == "verlet" else None
    whole, half = (piece(method, steps, start=start) for steps in (800, 400))
    assert whole.first_bad_step[1] > 0
    for resume, dt in ((half, None), (half, 0.1), (filed(half, tmp_path), None), (pickle.loads(pickle.dumps(half)), None)):
        rest = piece(method, 400, resume=resume, dt=dt)
        for name in ("v", "y", "t", "first_bad_step"):
            np.testing.assert_array_equal(getattr(rest, name), getattr(whole, name), err_msg=name)


def filed(run: sw.Run, folder: Path, **options: Any) -> sw.Run:
    """Written to a file, and read."""
    run.save(folder / "run.npz")
    return sw.load(folder / "run.npz", **options)


@sw.system
def spring(t: Any, v: Any, y: Any, *, k: Any = 1.0, other: Any = 4.0) -> Any:
    return -k * y


@sw.system
def other_spring(t: Any, v: Any, y: Any, *, k: Any = 1.0, other: Any = 4.0) -> Any:
    return -other * y


#: y of ÿ = −y from 1 at rest to t = 5, and of ÿ = −4y from there to t = 10.
THEN = np.cos(5.0) * np.cos(10.0) - np.sin(5.0) / 2.0 * np.sin(10.0)


@pytest.mark.parametrize(("method", "backend"), [*((method, "rust") for method in CHOOSE), ("dop853", "numpy")])
def test_another_system_acts_from_the_saved_state_on(method: str, backend: Any) -> None:
    """It acted from the start of a step that the old one had made beyond it: ÿ = −y to t = 5, then −4y, was wrong by 9 %.

    It is the run that begins with the saved state, so its bits are equal, and so is that of an equation of another spelling.
    """
    # Of a method of order 2 whose estimate is of the third order, h³ follows the tolerance, and the error h².
    tolerance, most = (1e-6, 1e-3) if sw.method(method).order == 2 else (1e-9, 1e-6)
    for y in (1.0, np.linspace(1.0, 2.0, 3)):
        first = sw.integrate(spring(), method, v=0.0, y=y, tolerance=tolerance, at=[2.5, 5.0], backend=backend)
        anew = {"v": first.v[-1], "y": first.y[-1], "t0": 5.0, "tolerance": tolerance, "at": [6.0, 10.0], "backend": backend}
        fresh = sw.integrate(spring(k=4.0), method, **anew)
        # Each of some hundred steps errs by 1e-9 of a length of at most 2·√5, and nothing grows.
        np.testing.assert_allclose(fresh.y[-1], y * THEN, atol=most)
        for system in (spring(k=4.0), other_spring(), spring(k=np.full(np.shape(y), 4.0))):
            rest = sw.integrate(system, method, at=[6.0, 10.0], backend=backend, resume=first)
            np.testing.assert_array_equal((rest.v, rest.y), (fresh.v, fresh.y))


@pytest.mark.parametrize("method", CHOOSE)
def test_the_same_system_goes_on_however_it_is_spelled(method: str) -> None:
    """One number for all members or one for each, made anew or unpickled: the pieces are one run."""
    start: dict[str, Any] = {"v": np.array([0.0, 0.1, 0.2]), "y": 1.0, "tolerance": 1e-7}
    whole = sw.integrate(spring(), method, at=[1.0, 2.0], **start)
    first = sw.integrate(spring(), method, at=[1.0], **start)
    for system in (spring(k=np.ones(3)), spring(), first.system, pickle.loads(pickle.dumps(spring()))):
        np.testing.assert_array_equal(sw.integrate(system, method, at=[2.0], resume=first).y[-1], whole.y[-1])


@pytest.mark.parametrize("method", CHOOSE)
def test_a_state_of_ones_own_counts(method: str) -> None:
    """A kick between two pieces was ignored by y and v of the carry, or acted before the saved time."""
    first = sw.integrate(spring(), method, v=0.0, y=1.0, tolerance=1e-9, at=[5.0])
    kicked = first.v[-1] + 1.0
    rest = sw.integrate(spring(), method, at=[6.0], resume=first, v=kicked)
    fresh = sw.integrate(spring(), method, v=kicked, y=first.y[-1], t0=5.0, tolerance=1e-9, at=[6.0])
    np.testing.assert_array_equal((rest.v, rest.y), (fresh.v, fresh.y))


@pytest.mark.parametrize("method", CHOOSE)
def test_members_that_stopped_go_on_from_where_they_stopped(method: str) -> None:
    """With the same system to the bit, with another from the state at the time at which each ran out of steps."""
    rate = np.array([1.0, 40.0])
    start: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-6}
    slow = sw.integrate(spring(), method, at=[5.0], **start).paces
    assert slow is not None
    with pytest.warns(sw.ToleranceWarning):
        first = sw.integrate(spring(k=rate**2), method, at=[5.0], max_steps=int(slow.accepted + slow.rejected) + 1, **start)
    assert first.paces is not None
    assert first.status.tolist() == [0, sw.Status.BUDGET]
    whole = sw.integrate(spring(k=rate**2), method, at=[5.0, 6.0], **start)
    rest = sw.integrate(spring(k=rate**2), method, at=[6.0], resume=first)
    np.testing.assert_array_equal(rest.y[-1], whole.y[-1])
    slower = sw.integrate(spring(k=4.0), method, at=[6.0], resume=first)
    assert first.controller_state is not None
    at = float(first.paces.t[1])
    alone = {"v": first.controller_state.v[1], "y": first.controller_state.y[1], "t0": at, "tolerance": 1e-6}
    np.testing.assert_array_equal(slower.y[-1, 1], sw.integrate(spring(k=4.0), method, at=[6.0], **alone).y[-1])


def test_a_control_of_another_gain_begins_anew() -> None:
    scene = sw.scenes.figure_eight()
    first = sw.integrate(scene.system, "dop853", v=scene.v, y=scene.y, tolerance=1e-6, at=[1.0], control=sw.EnergyControl(0.1))
    target = first.system.keeper.target  # type: ignore[union-attr]
    rest = sw.integrate(scene.system, "dop853", at=[2.0], resume=first, control=sw.EnergyControl(5.0, target=target))
    anew = {"v": first.v[-1], "y": first.y[-1], "t0": 1.0, "tolerance": 1e-6}
    fresh = sw.integrate(scene.system, "dop853", at=[2.0], control=sw.EnergyControl(5.0, target=target), **anew)
    np.testing.assert_array_equal(rest.y, fresh.y)


@pytest.mark.parametrize("method", ["verlet", "leapfrog"])
@pytest.mark.parametrize("world", [False, True])
def test_a_carry_of_fixed_steps_is_of_its_system_too(method: str, world: bool) -> None:
    """v half a step back by the force of before was taken half a step on by the new one: an error of first order in h."""
    errors = []
    for steps in (500, 1000, 2000):
        h = 5.0 / steps
        first = sw.integrate(spring(), method, v=0.0, y=1.0, dt=h, steps=steps)
        anew = {"v": first.v[-1], "y": first.y[-1], "dt": h, "t0": 0.0, "start_step": steps}
        fresh = sw.integrate(spring(k=4.0), method, steps=steps, **anew)
        if world:
            loop = sw.World(spring(k=4.0), method, resume=sw.World(spring(), method, resume=first))
            loop.step(steps)
            ended = float(loop.y)
        else:
            ended = float(sw.integrate(spring(k=4.0), method, steps=steps, resume=first).y[-1])
        assert ended == fresh.y[-1]
        errors.append(abs(ended - THEN))
    # The methods are of second order: half the step, a quarter of the error, to within what the fourth order adds.
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.01)


def test_a_kick_between_pieces_of_fixed_steps_counts() -> None:
    for method in ("verlet", "leapfrog"):
        first = sw.integrate(spring(), method, v=0.0, y=1.0, dt=0.1, steps=10)
        rest = sw.integrate(spring(), method, steps=10, resume=first, v=first.v[-1] + 1.0)
        fresh = sw.integrate(spring(), method, v=first.v[-1] + 1.0, y=first.y[-1], dt=0.1, start_step=10, steps=10)
        np.testing.assert_array_equal(rest.y, fresh.y, err_msg=method)


@pytest.mark.parametrize("name", family(SYSTEMS, lambda name: not LONG and number(name, "known") % 3 == 0))
def test_a_system_is_known_by_all_of_its_numbers(name: str) -> None:
    """The same made twice is the same; with another number in any of its parameters it is another."""
    make = SYSTEMS[name]
    system, again = (make(np.random.default_rng(1), 3) for _ in range(2))
    drawn = np.random.default_rng(2)
    state = [drawn.normal(size=(*shape, 3)) for shape in (system.v_shape, system.y_shape)]
    system, again = (each.for_state_shapes(*state) for each in (system, again))
    state = [drawn.normal(size=(*shape, 3)) for shape in (system.v_shape, system.y_shape)]
    known = Continuation(system, sw.method("rk4"), state[0], state[1], {})
    assert known.holds(again, (3,), state[0], state[1])
    numbers = [(name, value) for name, value in vars(system).items() if isinstance(value, np.ndarray) and value.dtype == float]
    numbers += [(name, value) for name, value in getattr(system, "parameters_given", {}).items() if isinstance(value, np.ndarray)]
    for name, value in numbers:
        changes = np.nextafter(value, np.inf)
        other = changed(system, **{name: changes})
        if hasattr(system, "parameters_given") and name in system.parameters_given:
            other = changed(system, parameters_given={**system.parameters_given, name: changes})
        sent = [each.tobytes() for _, each in other.parameters((3,)) if isinstance(each, np.ndarray)]
        if sent != [each.tobytes() for _, each in system.parameters((3,)) if isinstance(each, np.ndarray)]:
            assert not known.holds(other, (3,), state[0], state[1])
    for block in range(2):
        if state[block].size:
            moved = [each.copy() for each in state]
            moved[block].flat[-1] = 1e-300
            assert not known.holds(system, (3,), moved[0], moved[1])


drug = sw.system(order=1)(lambda t, c, *, k=0.3: -k * c)
dose = sw.Event(lambda t, c: np.sin(t), then=lambda t, c: c + 2.0, name="dose")
PIECES: list[tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = [
    ({"dt": 0.1, "steps": 50}, {"steps": 50}, {"dt": 0.1, "steps": 100}),
    ({"tolerance": 1e-8, "at": [5.0]}, {"at": [10.0]}, {"tolerance": 1e-8, "at": [5.0, 10.0]}),
]


@pytest.mark.parametrize(("first", "second", "whole"), PIECES)
def test_events_that_change_the_state_are_asked_for(first: Any, second: Any, whole: Any, tmp_path: Path) -> None:
    """Without them another motion would follow without a word; ``[]`` says that this is meant."""
    run = sw.integrate(drug(), "dop853", y=1.0, events=dose, **first)
    for resume in (run, filed(run, tmp_path, system=drug)):
        with pytest.raises(ArgumentError, match=r"events: .* whose state was changed by dose, got None; give them again"):
            sw.integrate(drug(), "dop853", **second, resume=resume)
        again = sw.integrate(drug(), "dop853", events=dose, **second, resume=resume)
        assert again.y[-1] == sw.integrate(drug(), "dop853", y=1.0, events=dose, **whole).y[-1]
        assert again.changed_by == ("dose",)
        assert not sw.integrate(drug(), "dop853", events=[], **second, resume=resume).changed_by
    seen = sw.Event(lambda t, c: np.sin(t), name="seen")
    sw.integrate(drug(), "dop853", **second, resume=sw.integrate(drug(), "dop853", y=1.0, events=seen, **first))


def test_a_world_asks_for_them_too() -> None:
    world = sw.World(drug(), "rk4", v=np.zeros((0, 2)), y=np.ones(2), dt=0.1, events=dose)
    world.step(40)
    refused(ArgumentError, r"events: .* whose state was changed by dose", sw.World, drug(), "rk4", resume=world)
