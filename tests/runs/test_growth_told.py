"""Growth by steps beyond their stability limit is told; growth of the motion itself is not."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis import growth
from stepwell.analysis.stability import limit
from support.cases import Case

spring = sw.system(lambda t, v, y, *, k=1e4, damping=0.1, push=1.0: -k * y - damping * v + push * np.sin(t))

inverted = sw.system(lambda t, v, y, *, rate=1.0: rate**2 * y)

lag = sw.system(order=1)(lambda t, y, *, rate=50.0: 1.0 - rate * y)

PAST = [
    (sw.Oscillator(3.0), "false_euler", {"v": 0.0, "y": 1.0, "dt": 0.7, "steps": 200}, "its stability limit is 0.666667"),
    (spring(), "rk4", {"v": 0.0, "y": 0.0, "dt": 0.03, "steps": 300}, "its stability limit is 0.0282"),
    (lag(), "standard_euler", {"y": 1.0, "dt": 0.05, "steps": 60}, "its stability limit is 0.04"),
    (sw.Oscillator(1.0), "standard_euler", {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 5000}, "is stable with no step"),
    (sw.Chain(20), "leapfrog", {"v": 0.0, "y": np.eye(20)[3], "dt": 1.05, "steps": 300}, "use a shorter step"),
    (sw.Oscillator(np.array([1.0, 4.0])), "rk4", {"v": 0.0, "y": 1.0, "dt": 0.9, "steps": 200}, "1 of 2 members .* member 1"),
]


def test_growth_past_the_limit_is_told_once() -> None:
    for system, method, arguments, message in PAST:
        with pytest.warns(sw.AccuracyWarning, match=message) as caught:
            run = sw.integrate(system, method, **arguments)
        assert len(caught) == 1, method
        assert np.isfinite(run.y).all(), method
        assert np.abs(run.y[-1]).max() > 1e5, method


def test_the_limit_of_a_system_is_sought_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes longer than most runs; the next run of an equal system has its own step in the same words."""
    sought = []
    limit_of = limit.limit_of
    monkeypatch.setattr(limit, "limit_of", lambda *arguments: sought.append(arguments) or limit_of(*arguments))
    for dt in (0.7, 0.8):
        with pytest.warns(sw.AccuracyWarning, match=f"each step of {dt} by false_euler .* its stability limit is 0.645161"):
            sw.integrate(sw.Oscillator(3.1), "false_euler", v=0.0, y=1.0, dt=dt, steps=200)
    assert len(sought) == 1


def test_a_system_stays_as_it_was() -> None:
    """Also one without inputs, of which no copy is needed to leave them out."""
    chain = sw.Chain(3)
    with pytest.warns(sw.AccuracyWarning, match="its stability limit is "):
        sw.integrate(chain, "false_euler", v=np.zeros(3), y=np.ones(3), dt=2.5, steps=100)
    assert chain == sw.Chain(3)


def frames(world: sw.World, number: int, steps: int) -> None:
    for _ in range(number):
        world.step(steps)


def test_a_world_tells_it_once() -> None:
    """1.877ⁿ is a million in 22 steps, looked for after 8, 24, 56 and 120 steps, and 10²⁷⁴ in 1000. Of few large calls it is
    told after the first.
    """
    system = sw.Oscillator(np.array([1.0, 2.0, 3.0]))
    for n in (1, 7):
        v, y = np.zeros(3), np.ones(3)
        world = sw.World(system, "false_euler", v=v, y=y, dt=0.7)
        words = r"1 of 3 members grew .* member 2: .* the motion itself does not grow"
        with pytest.warns(sw.AccuracyWarning, match=words) as caught:
            frames(world, 280 // n, n)
        assert len(caught) == 1
        assert np.abs(y[2]) > 1e6
    for n, events in ((22, None), (1000, None), (22, lambda t, v, y: y), (100, lambda t, v, y: y)):
        world = sw.World(system, "false_euler", v=np.zeros(3), y=np.ones(3), dt=0.7, events=events)
        words = f"1 of 3 members grew .*-fold in {n} steps: member 2: .* its stability limit is 0.66"
        with pytest.warns(sw.AccuracyWarning, match=words):
            world.step(n)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            world.step(1)


def test_what_an_event_makes_of_a_state_is_not_told_as_growth() -> None:
    v, y = np.zeros(()), np.ones(())
    kick = sw.Event(lambda t, v, y: y, then=lambda t, v, y: (10.0 * v, y), name="kick")
    world = sw.World(sw.Oscillator(1.0), "rk4", v=v, y=y, dt=0.1, events=kick)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frames(world, 10, 30)
    assert np.abs(v) + np.abs(y) > 1e6


SWEEPS = [
    (sw.Oscillator, {"omega": [1.0, 3.0, 3.1]}, "false_euler", {"v": 0.0, "y": 1.0, "dt": 0.7}, 2, "omega = 3:"),
    (spring, {"k": [1.0, 1e4]}, "rk4", {"v": 0.0, "y": 0.0, "dt": 0.03}, 1, "k = 10000:"),
    (lag, {"rate": [50.0, 10.0]}, "standard_euler", {"y": 1.0, "dt": 0.05}, 1, "rate = 50:"),
    (lag, {"dt": [0.01, 0.05, 0.06]}, "standard_euler", {"y": 1.0}, 2, "dt = 0.05:"),
    (sw.Chain(20), {"y": ("start", np.eye(20)[:, :4])}, "leapfrog", {"v": 0.0, "dt": 1.05}, 4, "member 0:"),
]


@pytest.mark.parametrize(("system", "axes", "method", "arguments", "number", "first"), SWEEPS)
def test_a_sweep_tells_how_many_members_grew_and_which_first(
    system: Any, axes: dict[str, Any], method: str, arguments: dict[str, Any], number: int, first: str
) -> None:
    for options in ({}, {"transient": 150}, {"outcomes": "extremes"}, {"outcomes": lambda run: run.y[-1]}):
        steps = {"steps": 200 - options.get("transient", 0)}
        with pytest.warns(sw.AccuracyWarning, match=rf"{number} of \d members grew .*-fold in 200 steps") as caught:
            sw.sweep(system, axes, method, **arguments, **steps, chunk=2, **options)
        assert len(caught) == 1, options
        assert f" at {first} each step of" in str(caught[0].message), options


def test_a_sweep_passes_over_members_that_grow_by_themselves() -> None:
    """The first two grow as e²⁰ and e⁴⁰ do; the last is the spring that its steps make grow."""
    with pytest.warns(sw.AccuracyWarning, match=r"1 of 3 members grew .* at square = -30000:") as caught:
        sw.sweep(pushed_off, {"square": [100.0, 400.0, -3e4]}, "rk4", v=0.0, y=1.0, dt=0.02, steps=100)
    assert len(caught) == 1


pushed_off = sw.system(lambda t, v, y, *, square=1.0: square * y)


def test_a_small_member_beside_large_ones_is_told() -> None:
    """The second begins 10⁻¹² of the first and grows by 10⁷ in 40 steps: in the sum of squares it is nothing."""
    for steps, words in ((40, r"e\+07-fold in 40 steps: member 1"), (400, " member 1")):
        with pytest.warns(sw.AccuracyWarning, match=r"1 of 2 members grew .*" + words):
            sw.integrate(sw.Oscillator(np.array([1.0, 3.0])), "rk4", v=0.0, y=np.array([1e12, 1.0]), dt=1.0, steps=steps)


def test_growth_of_the_motion_backward_in_time_is_its_own() -> None:
    """Backward in time e⁻⁵⁰ᵗ is what grows, and e⁻ᵗ tells nothing of it."""
    system = sw.LinearSystem([[-50.0, 0.0], [0.0, -1.0]], velocities=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = sw.integrate(system, "rk4", y=[1.0, 1.0], dt=-0.01, steps=100)
    assert run.y[-1, 0] > 1e21


def test_members_of_times_of_their_own_are_told() -> None:
    with pytest.warns(sw.AccuracyWarning, match=r"2 of 2 members grew .* its stability limit is 0.02"):
        sw.integrate(spring(), "rk4", v=0.0, y=1.0, dt=0.03, steps=300, t0=np.array([0.0, 5.0]))


TAME = [
    (inverted(), {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 300}),  # e³⁰
    (inverted(rate=40.0), {"v": 1.0, "y": 0.0, "dt": 0.1, "steps": 20}),  # grows by itself, beyond any accuracy
    (sw.LinearSystem([[1.0]], velocities=0), {"y": [1.0], "dt": 0.1, "steps": 400}),
    (sw.LinearSystem([[0.2, 5.0], [-5.0, 0.2]], velocities=0), {"y": [1.0, 0.0], "dt": 0.1, "steps": 1500}),
    (sw.Particles(1, gravity=[0.0, -9.81]), {"v": 0.0, "y": 0.0, "dt": 0.1, "steps": 50_000}),  # from rest, 10⁸ down
    (sw.Oscillator(1e8, form="physical"), {"v": 0.0, "y": 1.0, "dt": 1e-9, "steps": 500}),  # v is 1e8 times y
    (spring(), {"v": 0.0, "y": 0.0, "dt": 0.01, "steps": 2000}),
    (spring(damping=0.0, push=0.0), {"v": 0.0, "y": 1e-9, "dt": 0.025, "steps": 2000}),
    (sw.Oscillator(1.0, a=sw.Sinusoid(1e7, 1.0), form="physical"), {"v": 0.0, "y": 1e-3, "dt": 0.1, "steps": 3000}),  # resonance
]


def test_what_grows_by_itself_or_not_at_all_is_not_told() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for (system, arguments), method in itertools.product(TAME, ("rk4", "dop853", "merson")):
            sw.integrate(system, method, **arguments)
            sized = system.for_state_shapes(arguments.get("v"), arguments["y"])
            shapes = {"v": sized.v_shape, "y": sized.y_shape}
            blocks = {
                each: np.array(np.broadcast_to(arguments[each], shapes[each]), float) for each in shapes if each in arguments
            }
            world = sw.World(system, method, dt=arguments["dt"], **blocks)
            frames(world, 300, max(1, arguments["steps"] // 300))


def test_lengths_whose_squares_are_no_floats_are_told_too() -> None:
    """By Runge-Kutta 4 with hω = 3.2 a state grows 2.27-fold in a step: 10²⁴⁹ is a float64, and its square is none."""
    for start, steps, dtype in (
        (1.0, 700, "float64"),
        (1e-200, 20, "float64"),
        (1e-200, 700, "float64"),
        (1.0, 60, "float32"),
        (1e-30, 150, "float32"),
    ):
        with pytest.warns(sw.AccuracyWarning, match=r"the run grew \de\+\d+-fold in \d+ steps"):
            run = sw.integrate(sw.Oscillator(1.0), "rk4", v=0.0, y=start, dt=3.2, steps=steps, dtype=dtype)
        assert run.status == sw.Status.OK, (start, steps, dtype)


def test_members_with_samples_of_their_own_are_told_too() -> None:
    """The limit of one member is sought with its own samples, at many steps at a time."""
    case = Case("merson", "top, damped, torques of its own", "direct", None)
    with pytest.warns(sw.AccuracyWarning, match="1 of 5 members grew"), pytest.warns(sw.DivergenceWarning):
        case.run(5, 0, dt=3.0, steps=9)


def test_findings_are_the_same_whether_the_warning_is_heard_or_not() -> None:
    runs = []
    for action in ("always", "ignore"):
        with warnings.catch_warnings(record=True):
            warnings.simplefilter(action)
            runs.append(sw.integrate(sw.Oscillator([1.0, 3.0]), "rk4", v=0.0, y=1.0, dt=1.0, steps=100))
    assert len(runs[0].findings) == 1
    assert runs[0].findings == runs[1].findings


def test_no_member_is_shorter_at_the_start_than_the_bound_of_all() -> None:
    """A member at rest counts as one unit long. The bound is sharp if one block is zero."""
    coordinates = 2.0, 0.0, np.linspace(-3.0, -1.0, 5), np.zeros(5), np.linspace(-1.0, 1.0, 5)
    for v, y in itertools.product((0.0, -4.0, np.linspace(0.5, 2.0, 5), np.zeros(5)), coordinates):
        start = np.broadcast_to(v, 5), np.broadcast_to(y, 5)
        run = sw.integrate(sw.Oscillator(np.linspace(0.5, 1.0, 5)), "rk4", v=v, y=y, dt=0.1, steps=10)
        lengths = np.hypot(*start)
        least = float(np.where(lengths > 0.0, lengths, 1.0).min())
        bound = max(growth._shortest(run, start))
        assert 0.0 < bound <= least, (v, y)
        assert bound == least or (np.any(v) and np.any(y)), (v, y)
