"""Runs with events: the steps are those of runs without, and what is found depends neither on backend, batch nor pieces."""

from __future__ import annotations

import copy
import itertools
import pickle
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs import engine
from stepwell.runs.events import collected, driver, trials
from stepwell.runs.events.members import Members
from stepwell.runs.events.traced import Quantity
from stepwell.runs.events.trials import Trials, one_step
from support.cases import SYSTEMS, Case, assert_same, cases, number, representative, thinned
from support.events import assert_same_events, check_a_state_at_zero_counts_once_and_not_at_the_start, crossing, first
from support.families import family


def nearly_first(case: Case) -> Any:
    """An event of each system, of the number of arguments that it takes: the first coordinate is a tenth."""
    if SYSTEMS[case.system](np.random.default_rng(0), 1).v_shape == (0,):
        return sw.Event(lambda t, y: first(y) - 0.1, name="tenth")
    return sw.Event(lambda t, v, y: first(v, y) - 0.1, name="tenth")


DIRECT = [case for case in cases() if case.form == "direct"]
#: By default each system and each method once, in float64; half of them in float32 too, of which the next test has all.
CHOSEN = set(representative(DIRECT, {"direct": 1}, "events"))
DTYPES = pytest.mark.parametrize("dtype", ["float64", "float32"])


@pytest.mark.parametrize(
    ("case", "dtype"),
    family(
        itertools.product(DIRECT, ("float64", "float32")),
        lambda case, dtype: case in CHOSEN and (dtype == "float64" or number(case, dtype) % 2 == 0),
        lambda case, dtype: f"{case}, {dtype}",
    ),
)
@pytest.mark.filterwarnings("ignore")
def test_steps_are_those_of_a_run_without_and_both_backends_agree(
    case: Case, dtype: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    event = nearly_first(case)
    if dtype == "float32" and case.refused_in_float32():
        return
    plain, run = case.run(5, dtype=dtype), case.run(5, events=event, dtype=dtype)
    assert_same(plain, run)
    reference = case.run(5, events=event, backend="numpy", dtype=dtype)
    assert_same(reference, run)
    assert_same_events(reference, run)
    # Where few states are saved the core notices changes of sign, and only the steps of such members are looked at.
    monkeypatch.setattr(driver, "FEW_MEMBERS", 1)
    monkeypatch.setattr(driver, "WATCHED_STEPS", 8)
    noticed = case.run(5, every=None, events=event, dtype=dtype)
    assert_same_events(reference, noticed)
    np.testing.assert_array_equal(noticed.y[-1], plain.y[-1])
    np.testing.assert_array_equal(noticed.v[-1], plain.v[-1])


@pytest.mark.parametrize("case", thinned(DIRECT, {"direct": 1}, "events"))
@pytest.mark.filterwarnings("ignore")
def test_a_trial_of_float32_of_the_whole_length_is_the_step(case: Case) -> None:
    if case.refused_in_float32():
        return
    system, arguments = case.make(5)
    method, dt = sw.method(case.method), float(np.float32(0.1))
    plan = engine.Plan(
        system.stepped_by(method),
        method,
        (5,),
        dt,
        choice=method.start_choice(case.start),
        single=True,
        force=arguments.get("force"),
    )
    index = np.array([3, 0, 0, 4])
    v, y = (arguments[name].astype(np.float32).astype(np.float64) for name in ("v", "y"))
    trials = Trials(plan, Members(plan)).step(index, np.zeros(4), np.full(4, dt), v[..., index], y[..., index])
    out = engine.advance(plan, v, y)
    for trial, step in zip(trials, (out.v[-1], out.y[-1]), strict=True):
        np.testing.assert_array_equal(trial, step[..., index])


@pytest.mark.parametrize("case", thinned(DIRECT, {"direct": 1}, "events"))
@pytest.mark.filterwarnings("ignore")
def test_a_trial_of_the_whole_length_is_the_step_whatever_members_are_taken(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    system, arguments = case.make(5)
    method = sw.method(case.method)
    plan = engine.Plan(system.stepped_by(method), method, (5,), 0.1, choice=method.start_choice(case.start))
    members = Members(plan)
    index = np.array([3, 0, 0, 4])
    t, h = np.zeros(4), np.full(4, 0.1)
    v, y = (arguments[name][..., index] for name in ("v", "y"))
    by_reference = one_step(members.plan(index), t, h, v, y)
    by_core = Trials(plan, members).step(index, t, h, v, y)
    monkeypatch.setattr(trials, "MEMBERS_BY_CORE", 0)
    by_trial = Trials(plan, members).step(index, t, h, v, y)
    out = engine.advance(plan, arguments["v"], arguments["y"])
    for a, b, c, step in zip(by_reference, by_trial, by_core, (out.v[-1], out.y[-1]), strict=True):
        np.testing.assert_array_equal(a, step[..., index])
        np.testing.assert_array_equal(b, step[..., index])
        np.testing.assert_array_equal(c, step[..., index])
    # Of other lengths, by the core and by the reference.
    h = 0.1 * np.array([0.3, 0.01, 0.9, 0.5])
    by_trial = Trials(plan, members).step(index, t, h, v, y)
    monkeypatch.setattr(trials, "MEMBERS_BY_CORE", 4)
    for a, b in zip(Trials(plan, members).step(index, t, h, v, y), by_trial, strict=True):
        np.testing.assert_array_equal(a, b)


SWEEP: dict[str, Any] = {"v": np.linspace(-0.5, 0.5, 40), "y": 1.0, "dt": 0.1, "steps": 300}
#: The second comes in steps of its own, the third stops about half of the members, at different times.
THREE = [
    crossing,
    sw.Event(lambda t, v, y, omega: v - 0.2 * omega, direction=1, most=3, name="speed"),
    sw.Event(lambda t, v, y, omega: omega * t + 3.0 * y - 38.0, direction=1, terminal=True, name="end"),
]


def sweep(members: Any = slice(None), method: str = "rk4", **options: Any) -> sw.Run:
    arguments = SWEEP | {"v": SWEEP["v"][members], "every": 7} | options
    return sw.integrate(sw.Pendulum(np.linspace(0.5, 2.0, 40)[members]), method, events=THREE, **arguments)


def test_the_sweep_has_something_of_everything() -> None:
    run = sweep()
    stopped = ~np.isnan(run.stopped_at)
    assert 5 < stopped.sum() < 35
    assert (run.events["speed"].count > 3).any()
    assert len(run.events["speed"].t) == np.minimum(run.events["speed"].count, 3).sum()
    assert len(run.events["crossing"].t) == run.events["crossing"].count.sum() > 40
    np.testing.assert_array_equal(run.status == sw.Status.EVENT, stopped)


@DTYPES
@pytest.mark.parametrize("method", ["rk4", "verlet", "false_euler"])
def test_a_member_alone_is_the_same_as_in_a_batch(method: str, dtype: str) -> None:
    run = sweep(method=method, dtype=dtype)
    for i in (0, 1, 17, 39):
        alone = sweep(slice(i, i + 1), method=method, dtype=dtype)
        np.testing.assert_array_equal(alone.y[:, 0], run.y[:, i])
        assert alone.stopped_at is not None
        np.testing.assert_array_equal(alone.stopped_at[0], run.stopped_at[i])
        for name, mine in alone.events.items():
            theirs = run.events[name].of(i)
            assert mine.count[0] == theirs.count
            for a, b in zip((mine.t, mine.v, mine.y, mine.step), (theirs.t, theirs.v, theirs.y, theirs.step), strict=True):
                np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("method", "dtype"), [("rk4", "float32"), ("verlet", "float64")])
def test_how_many_are_looked_at_together_does_not_matter(method: str, dtype: str, monkeypatch: pytest.MonkeyPatch) -> None:
    few = slice(0, 40, 5)
    run = sweep(few, method=method, dtype=dtype)
    assert 2 <= (~np.isnan(run.stopped_at)).sum() <= 6
    for numbers, longest, located in ((1 << 6, 5, 1), (1 << 4, 1, 7), (1 << 20, 100_000, 1 << 20)):
        monkeypatch.setattr(driver, "NUMBERS_AT_ONCE", numbers)
        monkeypatch.setattr(driver, "MOST_STEPS", longest)
        monkeypatch.setattr(collected, "LOCATED_AT_ONCE", located)
        other = sweep(few, method=method, dtype=dtype)
        assert_same(run, other)
        assert_same_events(run, other)


@pytest.mark.parametrize("method", ["rk4", "verlet"])
@pytest.mark.parametrize("every", [None, 50])
def test_what_the_core_notices_is_all_that_there_is(method: str, every: int | None, monkeypatch: pytest.MonkeyPatch) -> None:
    every_state = sweep(method=method, every=every)  # 40 are few
    monkeypatch.setattr(driver, "FEW_MEMBERS", 1)
    for steps in (64, 3, 1000):
        monkeypatch.setattr(driver, "WATCHED_STEPS", steps)
        noticed = sweep(method=method, every=every)
        assert_same(every_state, noticed)
        assert_same_events(every_state, noticed)


@pytest.mark.mutant
def test_mistake_the_core_notices_another_quantity_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """So the core's part is not idle: of a quantity that never changes its sign it notices nothing within some steps. At their
    end the quantity itself is looked at, which finds more; here it does not.
    """
    run = sweep(every=None)
    monkeypatch.setattr(driver, "FEW_MEMBERS", 1)
    right = driver.watched
    never = sw.Event(lambda t, v, y: y * y + 1.0)
    monkeypatch.setattr(driver, "near", lambda g, before: np.zeros(g.shape, dtype=bool))

    def wrong(quantities: Any, plan: Any) -> Any:
        return right([Quantity(never, plan.system, {}) for _ in quantities], plan)

    monkeypatch.setattr(driver, "watched", wrong)
    assert sweep(every=None).events["crossing"].count.sum() < run.events["crossing"].count.sum()


def test_a_system_whose_step_is_too_long_for_one_tape(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 600 masses: there the core does not notice anything, and all states are looked at."""
    monkeypatch.setattr(driver, "FEW_MEMBERS", 1)
    y = np.zeros((600, 3))
    y[0] = 1.0, 1.1, 1.2
    event = sw.Event(lambda t, v, y: y[0] - 0.5, name="half")
    runs = [
        sw.integrate(sw.Chain(600), "rk4", v=0.0, y=y, dt=0.1, steps=40, events=event, backend=backend)
        for backend in ("rust", "numpy")
    ]
    assert runs[0].events["half"].count.all()
    assert_same_events(*runs)


@DTYPES
def test_threads_do_not_matter(dtype: str) -> None:
    one, two = sweep(threads=1, dtype=dtype), sweep(threads=2, dtype=dtype)
    assert_same(one, two)
    assert_same_events(one, two)


def test_neither_threads_nor_the_batch_matter_where_the_core_notices() -> None:
    """A hundred members are enough for that; one alone is not, and all of its states are looked at."""
    omega, arguments = np.linspace(0.5, 2.0, 100), {"v": 0.1, "y": 1.0, "dt": 0.1, "steps": 300}
    one, two = (sw.integrate(sw.Pendulum(omega), "rk4", **arguments, events=THREE, threads=threads) for threads in (1, 2))
    assert_same(one, two)
    assert_same_events(one, two)
    for i in (0, 63, 99):
        alone = sw.integrate(sw.Pendulum(omega[i]), "rk4", **arguments, events=THREE)
        for name, mine in alone.events.items():
            np.testing.assert_array_equal(mine.t, one.events[name].of(i).t)
            np.testing.assert_array_equal(mine.y, one.events[name].of(i).y)


def test_batch_axes_and_parameters_of_all_shapes() -> None:
    omega, damping = np.linspace(0.5, 2.0, 6).reshape(3, 2), np.array([0.0, 0.2])
    event = sw.Event(lambda t, v, y, omega, damping: y - 0.1 * omega - damping, name="zero")
    run = sw.integrate(sw.Pendulum(omega, damping), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, events=event)
    zeros = run.events["zero"]
    assert zeros.count.shape == (3, 2)
    for i, j in np.ndindex(3, 2):
        alone = sw.integrate(sw.Pendulum(omega[i, j], damping[j]), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, events=event)
        np.testing.assert_array_equal(alone.events["zero"].t, zeros.of((i, j)).t)
        np.testing.assert_array_equal(alone.events["zero"].y, zeros.of((i, j)).y)
    assert len(zeros.of((-1, -1)).t) == zeros.count[-1, -1]
    with pytest.raises(sw.errors.ArgumentError, match="index: expected 2 whole"):
        zeros.of(1)
    with pytest.raises(sw.errors.ArgumentError, match="index: expected -2"):
        zeros.of((0, 2))


@DTYPES
@pytest.mark.parametrize("method", ["rk4", "verlet", "leapfrog"])
def test_pieces_find_what_the_whole_finds(method: str, dtype: str) -> None:
    arguments: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": 0.1}
    whole = sw.integrate(sw.Oscillator(), method, **arguments, steps=200, events=crossing, dtype=dtype)
    head = sw.integrate(sw.Oscillator(), method, **arguments, steps=77, events=crossing, dtype=dtype)
    tail = sw.integrate(sw.Oscillator(), method, resume=head, steps=123, events=crossing)
    np.testing.assert_array_equal(tail.y[-1], whole.y[-1])
    for name in ("t", "v", "y", "step"):
        pieces = [getattr(each.events["crossing"], name) for each in (head, tail)]
        np.testing.assert_array_equal(np.concatenate(pieces), getattr(whole.events["crossing"], name))


def test_a_member_that_stopped_stays_where_it_was_and_cannot_go_on() -> None:
    run = sweep(every=1)
    ends = run.events["end"]
    assert run.stopped_at is not None
    for i in np.flatnonzero(run.status == sw.Status.EVENT).tolist():
        end = ends.of(i)
        assert end.count == len(end.t) == 1
        assert run.stopped_at[i] == end.t[0]
        k = int(end.step[0])
        assert run.t[k] < end.t[0] <= run.t[k + 1] + 1e-12
        np.testing.assert_array_equal(run.y[k + 1 :, i], end.y[0])
        np.testing.assert_array_equal(run.v[k + 1 :, i], end.v[0])
        for other in ("crossing", "speed"):
            assert (run.events[other].of(i).t <= end.t[0]).all()
    with pytest.raises(sw.errors.UnsupportedError, match="stopped at an event"):
        sw.integrate(run.system, run.method, resume=run, steps=1)
    assert "stopped at an event" in repr(run)


def test_what_comes_after_a_terminal_event_in_its_step_is_not_there() -> None:
    """Falling from 1 under gravity 1: y passes 0.5 at t = 1, and 0.48 at 1.02, in the same step of 0.25."""

    @sw.system
    def falling(t: Any, v: Any, y: Any, *, g: float = 1.0) -> Any:
        return -g

    half = sw.Event(lambda t, v, y: y - 0.5, terminal=True, name="half")
    later = sw.Event(lambda t, v, y: y - 0.48, name="later")
    earlier = sw.Event(lambda t, v, y: y - 0.52, name="earlier")
    run = sw.integrate(falling(), "rk4", v=0.0, y=1.0, dt=0.3, steps=10, events=[later, half, earlier])
    assert [run.events[name].count.item() for name in ("later", "half", "earlier")] == [0, 1, 1]
    assert run.stopped_at is not None
    # A parabola is exact by RK4 but for roundings, a few units of 1.
    assert abs(run.stopped_at - 1.0) < 1e-14
    # Of two terminal events the first counts, in whatever order they are given.
    both = [sw.Event(each.function, terminal=True, name=each.name) for each in (later, half, earlier)]
    run = sw.integrate(falling(), "rk4", v=0.0, y=1.0, dt=0.3, steps=10, events=both)
    assert [run.events[name].count.item() for name in ("later", "half", "earlier")] == [0, 0, 1]


def test_directions() -> None:
    def zeros(direction: int) -> Any:
        event = sw.Event(lambda t, v, y: y, direction=direction, name="zero")
        return sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=200, events=event).events["zero"]

    assert (zeros(-1).v < 0).all()
    assert (zeros(1).v > 0).all()
    np.testing.assert_array_equal(np.sort(np.concatenate([zeros(-1).t, zeros(1).t])), zeros(0).t)
    assert len(zeros(0).t) == 6  # zeros of the cosine up to t = 20


def test_a_state_at_zero_counts_once_and_not_at_the_start() -> None:
    check_a_state_at_zero_counts_once_and_not_at_the_start()


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_a_member_that_diverges_has_no_events_after_that() -> None:
    """Standard Euler of ω·h = 30 grows by a factor of 30 a step, its sign changing, until it overflows; its neighbour goes on."""
    arguments: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 400}
    event = sw.Event(lambda t, v, y: y, name="zero")
    run = sw.integrate(sw.Oscillator([300.0, 1.0]), "standard_euler", **arguments, events=event)
    plain = sw.integrate(sw.Oscillator([300.0, 1.0]), "standard_euler", **arguments, every=1)
    np.testing.assert_array_equal(run.first_bad_step, plain.first_bad_step)
    bad = int(run.first_bad_step[0])
    assert bad > 0 > run.first_bad_step[1]
    y = plain.y[:bad, 0]
    expected = ((y[:-1] < 0) & (y[1:] >= 0)) | ((y[:-1] > 0) & (y[1:] <= 0))
    assert run.events["zero"].count[0] == expected.sum() > 10
    assert (run.events["zero"].of(0).step < bad - 1).all()
    # A member that stopped before it would have diverged did not diverge.
    stopping = sw.Event(lambda t, v, y: y, terminal=True, name="zero")
    run = sw.integrate(sw.Oscillator([300.0, 1.0]), "standard_euler", **arguments, events=stopping)
    assert (run.first_bad_step < 0).all()
    assert (run.status == sw.Status.EVENT).all()


def test_recorded_quantities_are_those_of_the_saved_states() -> None:
    run = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=50, every=5, events=crossing, record="energy")
    plain = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=50, every=5, record="energy")
    np.testing.assert_array_equal(run.recorded["energy"], plain.recorded["energy"])


@pytest.mark.parametrize("options", [{"fused": True}, {"control": sw.Projection("nacozy")}, {"force": 0.1}])
def test_with_other_options(options: dict[str, Any]) -> None:
    bodies = sw.NBody([1.0, 2.0], force="newton")
    y, v = np.array([[1.0, 0.0], [-0.5, 0.0]]), np.array([[0.0, 0.8], [0.0, -0.4]])
    event = sw.Event(lambda t, v, y: y[0, 1] - y[1, 1], name="line")
    arguments: dict[str, Any] = {"v": v, "y": y, "dt": 0.02, "steps": 200, **options}
    plain = sw.integrate(bodies, "rk4", **arguments)
    run, reference = (sw.integrate(bodies, "rk4", **arguments, events=event, backend=which) for which in ("rust", "numpy"))
    np.testing.assert_array_equal(run.y, plain.y)
    assert_same_events(run, reference)
    assert run.events["line"].count > 0
    assert run.work is None


def test_progress_is_told_up_to_the_end() -> None:
    shares: list[float] = []
    plan = engine.Plan(sw.Oscillator(), sw.method("rk4"), (), 0.1, steps=1000, progress=shares.append)
    run = driver.Run([sw.Event(crossing)], np.array(0.0), np.array(1.0), None, False)
    run.advance(plan)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_results_are_values() -> None:
    run = sweep()
    again = pickle.loads(pickle.dumps(run.events))
    assert again == run.events
    assert copy.deepcopy(run.events["end"]) == run.events["end"]
    assert repr(run.events["end"]).startswith("<")
    assert run.events["end"] != run.events["speed"]
    assert sw.Event(crossing) == sw.Event(crossing) != sw.Event(crossing, direction=1)
    assert repr(sw.Event(crossing, terminal=True)) == "Event(crossing, terminal=True)"


def two(t: Any, v: Any, y: Any) -> Any:
    return [v, y]


def asks(t: Any, v: Any, y: Any) -> Any:
    return y if y > 0 else v


WRONG: dict[str, tuple[Any, str]] = {
    "a number": (3.0, "events: expected a list of events"),
    "a list of numbers": ([3.0], "events: expected functions"),
    "a class": (float, "events: expected functions"),
    "too few arguments": (lambda t, y: y, r"expected a function \(t, v, y"),
    "no such parameter": (lambda t, v, y, stiffness: y, "got stiffness. Known: omega"),
    "the same name twice": ([crossing, crossing], "got 'crossing' twice"),
    "two numbers": (two, "expected one number"),
    "no number": (lambda t, v, y: None, "expected one number"),
    "a branch": (asks, "asks"),
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_wrong_events(wrong: tuple[Any, str]) -> None:
    with pytest.raises(sw.errors.ArgumentError, match=wrong[1]):
        sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=5, events=wrong[0])


def test_what_does_not_go_with_events() -> None:
    start: dict[str, Any] = {"v": 0.0, "y": 1.0, "events": crossing}
    with pytest.raises(sw.errors.UnsupportedError, match="events: works with form='direct' only"):
        sw.integrate(sw.Oscillator(), "rk4", **start, dt=0.1, steps=5, form="power")
    many, system = sw.Event(crossing, most=10**6), sw.Oscillator(np.ones(10**6))
    with pytest.raises(sw.errors.TooLargeError, match="the events of 1000000 members need"):
        sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=10**6, events=many)


def test_an_event_of_chance_is_refused() -> None:
    chance = np.random.default_rng(0)
    with pytest.raises(sw.errors.ArgumentError, match="same operations at every call"):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=5, events=lambda t, v, y: y - chance.random())
