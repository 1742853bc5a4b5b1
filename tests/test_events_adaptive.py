"""Events with adaptive steps: steps are those of runs without; what is found depends neither on backend, batch, pieces nor saves;
where it is, against closed forms; and mistakes that these tests must notice."""

from __future__ import annotations

import copy
import pickle
import warnings
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import stepwell as sw
from cases import ADAPTIVE, SYSTEMS, assert_same, fits
from stepwell import engine
from stepwell.events import adaptive, attempts, collected
from stepwell.events.members import Members
from stepwell.events.trials import AdaptiveTrials
from test_events import assert_same_events, crossing, first
from test_events_located import low_end, straight

ABLE = [m.name for m in sw.methods() if m.error_order is not None]
U = 2.0**-53


def same(a: sw.Run, b: sw.Run) -> None:
    """The same states and steps, to the last bit."""
    assert_same(a, b)
    assert a.paces == b.paces
    np.testing.assert_array_equal(a.status, b.status)


def goes(system: sw.System, method: sw.Method) -> bool:
    """Whether a method takes adaptive steps of a system."""
    series = method.has_series and (system.chooses or np.isfinite(system.samples[0]))
    return fits(system, method) and not series


@pytest.mark.parametrize(
    ("name", "method"),
    [
        pytest.param(name, method, marks=() if j == i % len(ABLE) else pytest.mark.long)
        for i, name in enumerate(ADAPTIVE)
        for j, method in enumerate(ABLE)
    ],
)
@pytest.mark.filterwarnings("ignore::stepwell.ToleranceWarning")
def test_steps_are_those_of_a_run_without_and_both_backends_agree(name: str, method: str) -> None:
    rng, how = np.random.default_rng(5), sw.method(method)
    system = SYSTEMS[name](rng, 3).uncontrolled
    if not goes(system, how):
        return
    v, y = 0.3 * rng.normal(size=(*system.v_shape, 3)), rng.normal(size=(*system.y_shape, 3))
    if how.has_series and system.constraint == "length":
        v = 0.0 * v
    start = float((y if y.size else v).ravel()[0])
    if system.v_shape == (0,):
        event = sw.Event(lambda t, y: first(y) - start - 0.01 * t + 1e-4, name="passage")
    else:
        event = sw.Event(lambda t, v, y: first(v, y) - start - 0.01 * t + 1e-4, name="passage")
    ask: dict[str, Any] = {"v": v, "y": y, "tolerance": 1e-4, "at": [0.0, 0.05, 0.2], "max_steps": 10 if how.has_series else 20}
    plain = sw.integrate(system, method, **ask)
    run = sw.integrate(system, method, **ask, events=event)
    same(plain, run)
    reference = sw.integrate(system, method, **ask, events=event, backend="numpy")
    same(reference, run)
    assert_same_events(reference, run)


@pytest.mark.parametrize("control", [sw.EnergyControl(gain=0.5), sw.Projection()], ids=["a control", "a projection"])
def test_controls_and_projections(control: Any) -> None:
    v, y = np.array([[0.0, 0.1], [0.0, 0.6]]), np.array([[0.0, 0.0], [1.5, 0.0]])
    event = sw.Event(lambda t, v, y: y[1, 1] - 0.2 * t, name="line")
    ask: dict[str, Any] = {"v": v, "y": y, "tolerance": 1e-6, "at": [5.0], "control": control}
    plain = sw.integrate(sw.NBody([1.0, 0.5]), "merson", **ask)
    runs = [sw.integrate(sw.NBody([1.0, 0.5]), "merson", **ask, events=event, backend=each) for each in ("rust", "numpy")]
    same(*runs)
    same(plain, runs[0])
    assert_same_events(*runs)
    assert runs[0].events["line"].count > 0
    np.testing.assert_array_equal(runs[0].work, plain.work)


@pytest.mark.parametrize("method", ABLE)
@pytest.mark.parametrize("name", ["pendulum", "own: top"])
def test_a_trial_is_the_state_that_is_saved_within_a_step(method: str, name: str) -> None:
    """At any time within a step, and at its end."""
    rng, how = np.random.default_rng(1), sw.method(method)
    system = SYSTEMS[name](rng, 4)
    v, y = 0.3 * rng.normal(size=(*system.v_shape, 4)), rng.normal(size=(*system.y_shape, 4))
    plan = engine.Plan(system, how, (4,), 1.0, order=10 if how.has_series else 0)
    paces = engine.paces(plan, None, np.array(1e-6), None)
    out = attempts.attempted(plan, np.inf, 12, 1000, True, paces, v, y)
    trials, who = AdaptiveTrials(plan, Members(plan)), np.arange(4)
    h = out.lengths(plan)[10]
    for block, end in zip(trials.step(who, out.t[10], h, out.v[10], out.y[10]), (out.v[11], out.y[11]), strict=True):
        np.testing.assert_array_equal(block, end)
    for share in (0.1, 0.7):
        at = out.t[10] + share * h
        made = trials.step(who, out.t[10], at - out.t[10], out.v[10], out.y[10])
        for i in who:
            saved = engine.adapt(plan, engine.Pacing(at[i : i + 1], 1000, True), paces, v, y)
            for block, kept in zip(made, (saved.v, saved.y), strict=True):
                np.testing.assert_array_equal(block[..., i], kept[0][..., i])


#: As of test_events: the first comes often, of the second three are kept, the third stops about half of the members.
THREE = [
    crossing,
    sw.Event(lambda t, v, y, omega: v - 0.2 * omega, direction=1, most=3, name="speed"),
    sw.Event(lambda t, v, y, omega: omega * t + 3.0 * y - 38.0, direction=1, terminal=True, name="end"),
]


def sweep(members: Any = slice(None), method: str = "merson", **options: Any) -> sw.Run:
    given = {"v": np.linspace(-0.5, 0.5, 40)[members], "y": 1.0, "tolerance": 1e-6, "at": np.linspace(0.0, 30.0, 20)} | options
    return sw.integrate(sw.Pendulum(np.linspace(0.5, 2.0, 40)[members]), method, **({"events": THREE} | given))


@pytest.mark.parametrize("method", ABLE)
def test_a_member_alone_is_the_same_as_in_a_batch_and_by_the_reference(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    run = sweep(method=method)
    assert run.stopped_at is not None
    assert 5 < (~np.isnan(run.stopped_at)).sum() < 35
    assert (run.events["speed"].count > 3).any()
    np.testing.assert_array_equal(run.status == sw.Status.EVENT, ~np.isnan(run.stopped_at))
    for i in (0, 1, 17, 39):
        alone = sweep(slice(i, i + 1), method=method)
        np.testing.assert_array_equal(alone.y[:, 0], run.y[:, i])
        assert alone.stopped_at is not None
        np.testing.assert_array_equal(alone.stopped_at[0], run.stopped_at[i])
        for mine, theirs in zip(alone.paces, run.paces, strict=True):  # type: ignore[arg-type]
            assert mine[0] == theirs[i]
        for name, mine in alone.events.items():
            theirs = run.events[name].of(i)
            assert mine.count[0] == theirs.count
            for a, b in zip((mine.t, mine.v, mine.y, mine.step), (theirs.t, theirs.v, theirs.y, theirs.step), strict=True):
                np.testing.assert_array_equal(a, b)
    for options in ({"backend": "numpy"}, {"threads": 2}):
        if not (sw.method(method).has_series and "backend" in options):  # whose reference goes number by number
            other = sweep(method=method, **options)
            same(run, other)
            assert_same_events(run, other)
    # How many are looked at together does not matter.
    settings = [(1 << 10, 5), (1 << 9, 1), (1 << 20, 1 << 12)]
    for numbers, most in settings if method == "merson" else settings[:1]:
        monkeypatch.setattr(adaptive, "NUMBERS_AT_ONCE", numbers)
        monkeypatch.setattr(adaptive, "MOST_ATTEMPTS", most)
        other = sweep(method=method)
        same(run, other)
        assert_same_events(run, other)


def test_neither_threads_nor_other_members_matter_in_a_large_batch() -> None:
    omega, given = np.linspace(0.5, 2.0, 600), {"v": 0.1, "y": 1.0, "tolerance": 1e-5, "at": [12.0]}
    one, two = (sw.integrate(sw.Pendulum(omega), "merson", **given, events=THREE, threads=threads) for threads in (1, 2))
    same(one, two)
    assert_same_events(one, two)
    for i in (0, 63, 299, 300, 599):
        alone = sw.integrate(sw.Pendulum(omega[i]), "merson", **given, events=THREE)
        for name, mine in alone.events.items():
            np.testing.assert_array_equal(mine.t, one.events[name].of(i).t)
            np.testing.assert_array_equal(mine.y, one.events[name].of(i).y)


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize("method", ABLE)
def test_pieces_find_what_the_whole_finds_and_saved_times_do_not_matter(method: str, fused: bool) -> None:
    """Wherever the cut is: many of them, some within steps that have an event before or after the cut."""
    ask: dict[str, Any] = {"method": method, "members": slice(0, 5), "events": THREE[:2], "fused": fused}
    whole = sweep(**ask, at=[12.0])
    assert_same_events(whole, sweep(**ask, at=np.linspace(0.0, 12.0, 200)))
    times = np.append(whole.events["crossing"].of(0).t[[0, 1, 1]], 12.0)
    times[:3] += [0.02, -0.02, 0.02]
    many: dict[str, Any] = {"speed": THREE[1].function}
    ask["events"] = [crossing, *(sw.Event(function, direction=1, name=name) for name, function in many.items())]
    whole = sweep(**ask, at=[12.0])
    run = sweep(**ask, at=times[:1])
    pieces = [run]
    for end in times[1:]:
        system, again = run.system, dict(run.resume)
        run = sw.integrate(system, method, **again, at=[end], events=ask["events"])
        pieces.append(run)
    np.testing.assert_array_equal(run.y[-1], whole.y[-1])
    for name, theirs in whole.events.items():
        for i in range(5):
            for what in ("t", "v", "y", "step"):
                mine = np.concatenate([getattr(piece.events[name].of(i), what) for piece in pieces])
                np.testing.assert_array_equal(mine, getattr(theirs.of(i), what))
        np.testing.assert_array_equal(sum(piece.events[name].count for piece in pieces), theirs.count)


def test_a_run_that_was_out_of_attempts_goes_on() -> None:
    whole = sweep(slice(0, 5), events=crossing, at=[12.0])
    assert whole.paces is not None
    with pytest.warns(sw.ToleranceWarning):
        head = sweep(slice(0, 5), events=crossing, at=[12.0], max_steps=int(whole.paces.accepted.max()) // 2)
    tail = sw.integrate(head.system, "merson", **head.resume, at=[12.0], events=crossing)
    np.testing.assert_array_equal(tail.y[-1], whole.y[-1])
    counts = [each.events["crossing"].count for each in (head, tail, whole)]
    assert counts[0].any()
    assert counts[1].any()
    np.testing.assert_array_equal(counts[0] + counts[1], counts[2])


def test_a_member_that_stopped_stays_where_it_was_and_cannot_go_on() -> None:
    run, free = sweep(), sweep(events=THREE[:2])
    found = run.events["end"]
    assert run.stopped_at is not None
    assert run.paces is not None
    for i in range(40):
        end = found.of(i)
        before = run.t < (run.stopped_at[i] if len(end.t) else np.inf)
        np.testing.assert_array_equal(run.y[before, i], free.y[before, i])  # to there it is the motion without an end
        if not len(end.t):
            continue
        assert end.count == 1
        assert run.stopped_at[i] == end.t[0] == run.paces.t[i]
        assert end.step[0] == run.paces.accepted[i] - 1
        np.testing.assert_array_equal(run.y[~before, i], np.broadcast_to(end.y[0], (~before).sum()))
        np.testing.assert_array_equal(run.v[~before, i], np.broadcast_to(end.v[0], (~before).sum()))
        for other in ("crossing", "speed"):
            assert (run.events[other].of(i).t <= end.t[0]).all()
            kept = free.events[other].of(i).t
            np.testing.assert_array_equal(run.events[other].of(i).t, kept[kept <= end.t[0]])
    with pytest.raises(sw.errors.UnsupportedError, match="stopped at an event"):
        _ = run.resume
    assert "stopped at an event" in repr(run)


@sw.system(order=1)
def growing(t: Any, y: Any, *, rate: float = 1.0) -> Any:
    return rate * y * y


@pytest.mark.parametrize("method", ABLE)
@pytest.mark.filterwarnings("error")
def test_what_comes_after_a_terminal_event_is_not_computed(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """ẏ = y² from 1 is 1/(1 − t): infinite at 1, where steps become too short; without a word if it stops at y = 10, t = 0.9."""
    made: list[Any] = []
    adapt = engine.adapt

    def noted(*given: Any) -> Any:
        made.append(adapt(*given))
        return made[-1]

    monkeypatch.setattr(engine, "adapt", noted)
    ten = sw.Event(lambda t, y: y - 10.0, terminal=True, name="ten")
    run = sw.integrate(growing(), method, y=1.0, tolerance=1e-8, at=[0.5, 2.0], events=ten)
    # The relative error of y is within some 100 tolerances, and y passes 10 at a speed of 100: δt = 0.1·δy/y.
    assert run.stopped_at is not None
    assert abs(run.stopped_at - 0.9) < 1e-7
    assert abs(run.y[-1] - 10.0) < 1e-9
    assert run.first_bad_step == -1
    assert len(made) == 1
    assert run.paces is not None
    assert made[0].paces[engine.COUNTS.start] == run.paces.accepted
    # A run to that time alone has one more state to save, and does not take its last step.
    near = sw.integrate(growing(), method, y=1.0, tolerance=1e-8, at=[0.5, float(run.stopped_at)])
    assert near.paces is not None
    assert run.paces.accepted - 1 == near.paces.accepted
    assert run.paces.rejected == near.paces.rejected
    assert run.paces.evaluations <= near.paces.evaluations


@pytest.mark.parametrize("method", ABLE)
def test_runs_that_end_early_have_the_events_up_to_there(method: str) -> None:
    """Out of attempts, or because steps become too short: as without events, and what was passed is found."""
    two = sw.Event(lambda t, y: y - 2.0, name="two")
    for options in ({"max_steps": 40}, {}):
        ask: dict[str, Any] = {"y": 1.0, "tolerance": 1e-8, "at": [0.1, 2.0], **options}
        with pytest.warns(sw.ToleranceWarning):
            plain = sw.integrate(growing(), method, **ask)
        with pytest.warns(sw.ToleranceWarning):
            run = sw.integrate(growing(), method, **ask, events=two)
        same(plain, run)
        assert run.events["two"].count == int(plain.paces is not None and plain.paces.t > 0.5)


def test_directions_and_how_many_are_kept() -> None:
    def found(**options: Any) -> Any:
        event = sw.Event(lambda t, v, y: y, name="zero", **options)
        return sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=1e-9, at=[20.0], events=event).events["zero"]

    assert (found(direction=-1).v < 0).all()
    assert (found(direction=1).v > 0).all()
    np.testing.assert_array_equal(np.sort(np.concatenate([found(direction=-1).t, found(direction=1).t])), found().t)
    assert len(found().t) == 6  # zeros of the cosine up to t = 20
    assert found(most=2).count == 6
    np.testing.assert_array_equal(found(most=2).t, found().t[:2])


@sw.system(order=1)
def ascending(t: Any, y: Any) -> Any:
    return 1.0 + 0.0 * y


def test_the_ends_of_a_run() -> None:
    """An event at the start does not count, one just before the end does, and one just after it does not.

    The last step is no longer than five times the way so far; a place is past its event by 2⁻⁴⁸ of that at most.
    """
    places = {"start": 0.0, "before": 2.0 - 2.0**-43, "after": 2.0 + 2.0**-43}
    events = [sw.Event(lambda t, y, at=at: t - at, name=name) for name, at in places.items()]
    run = sw.integrate(ascending(), "merson", y=0.0, tolerance=1e-6, at=[1.0, 2.0], events=events)
    assert [each.count.item() for each in run.events.values()] == [0, 1, 0]
    assert 0.0 <= run.events["before"].t[0] - places["before"] <= 10.0 * 2.0**-48


def test_batch_axes_and_a_tolerance_for_each() -> None:
    omega, tolerance = np.linspace(0.5, 2.0, 6).reshape(3, 2), np.array([1e-5, 1e-8])
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "at": [3.0, 9.0], "events": THREE[:1]}
    run = sw.integrate(sw.Pendulum(omega), "fehlberg_5", tolerance=tolerance, **ask)
    assert run.events["crossing"].count.shape == (3, 2)
    for i, j in np.ndindex(3, 2):
        alone = sw.integrate(sw.Pendulum(omega[i, j]), "fehlberg_5", tolerance=tolerance[j], **ask)
        np.testing.assert_array_equal(alone.events["crossing"].t, run.events["crossing"].of((i, j)).t)


def test_progress_and_values(tmp_path: Path) -> None:
    told: list[float] = []
    plan = engine.Plan(sw.Pendulum(), sw.method("merson"), (), 1.0, progress=told.append)
    run = adaptive.AdaptiveRun([sw.Event(crossing)])
    paces = engine.paces(plan, None, np.array(1e-9), None)
    run.adapt(plan, engine.Pacing(np.array([100.0]), 10**6, True), paces, np.array(0.0), np.array(1.0))
    assert told == sorted(told)
    assert len(told) > 3
    assert told[-1] == 1.0
    made = sweep()
    assert pickle.loads(pickle.dumps(made.events)) == made.events == copy.deepcopy(made.events)
    made.save(tmp_path / "run.npz")
    back = sw.load(tmp_path / "run.npz")
    assert back == made
    assert_same_events(back, made)


def test_what_does_not_go() -> None:
    many, system = sw.Event(crossing, most=10**6), sw.Pendulum(np.ones(10**6))
    with pytest.raises(sw.errors.TooLargeError, match="the events of 1000000 members need"):
        sw.integrate(system, "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0], events=many)
    with pytest.raises(sw.errors.ArgumentError, match=r"expected a function \(t, v, y"):
        sw.integrate(sw.Pendulum(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0], events=lambda t, y: y)
    with pytest.raises(sw.errors.ArgumentError, match="events: expected a list of events"):
        sw.integrate(sw.Pendulum(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0], events=3.0)


# ---- where they are

#: A quarter of the period of a pendulum that begins at 1 rad, at rest: π/2/agm(1, cos ½) (Gauss).
QUARTER = float(mpmath.pi / 2 / mpmath.agm(1, mpmath.cos(0.5)))
zero = sw.Event(lambda t, v, y: y, name="zero")


def passage(method: str, tolerance: float, number: int = 3) -> tuple[float, float]:
    """By how much a pendulum's fourth passage through its lowest point is late, and by how much it is so by the state then."""
    run = sw.integrate(sw.Pendulum(), method, v=0.0, y=1.0, tolerance=tolerance, at=[7.0 * QUARTER, 13.0], events=zero)
    return float(run.events["zero"].t[number]) - 7.0 * QUARTER, float(-run.y[0] / run.v[0])


#: From the coarsest tolerance at which the error is nearly a power of it to where roundings show.
TOLERANCES = 10.0 ** -np.arange(5.0, 10.0)


def slope(method: str) -> float:
    """By what power of the tolerance the error of the time falls."""
    errors = [abs(passage(method, tolerance)[0]) for tolerance in TOLERANCES]
    return float(np.polyfit(np.log10(TOLERANCES), np.log10(errors), 1)[0])


@pytest.mark.parametrize("method", ABLE)
def test_the_error_of_the_time_follows_the_tolerance_and_is_that_of_the_motion(method: str) -> None:
    """As that of states does (test_adaptive). And a motion that is off by δ at the time of the passage passes later by −δ/v, to
    first order: the second is δ²·|v̇|/(2v³), with v near 1 and v̇ near 0 there, less than δ². Both lie in one step, or in two
    whose errors differ: of each step's error a share at most, which the tolerance bounds, counted twice with the roundings.
    """
    assert 0.7 < slope(method) < 1.3
    for tolerance in TOLERANCES:
        late, by_state = passage(method, tolerance)
        assert abs(late - by_state) < by_state**2 + 1e-3 * abs(by_state) + 100 * U


def pericentre(method: str, tolerance: float) -> float:
    """By how much a planet of eccentricity 1/2 that begins at its apocentre is early or late at its pericentre, π later."""
    event = sw.Event(lambda t, v, y: y[1, 0] * v[1, 0] + y[1, 1] * v[1, 1], direction=1, name="pericentre")
    v, y = (np.array([[0.0, 0.0], each]) for each in ([0.0, (1 / 3) ** 0.5], [1.5, 0.0]))
    run = sw.integrate(sw.NBody([1.0, 0.0], force="newton"), method, v=v, y=y, tolerance=tolerance, at=[4.0], events=event)
    return abs(float(run.events["pericentre"].t[0]) - np.pi)


@pytest.mark.parametrize("method", ABLE)
def test_a_planet_is_at_its_pericentre_in_time(method: str) -> None:
    """The error falls by four decades or more over six of the tolerance, and ends within a thousand tolerances."""
    coarse, fine = pericentre(method, 1e-4), pericentre(method, 1e-10)
    assert fine < 1e-4 * coarse
    assert fine < 1e-7


@sw.system
def by_time(t: Any, v: Any, y: Any, *, amplitude: float = 1.0) -> Any:
    return -amplitude * np.cos(t)


@pytest.mark.parametrize("method", ABLE)
def test_a_driven_motion_passes_in_time(method: str) -> None:
    """y = cos t, driven by v̇ = −cos t alone, is ½ at π/3: so trials are made at their own times."""
    half = sw.Event(lambda t, v, y: y - 0.5, name="half")
    run = sw.integrate(by_time(), method, v=0.0, y=1.0, tolerance=1e-10, at=[2.0], events=half)
    # Some 100 steps at most, each off by 10⁻¹⁰ of numbers up to 1, and y passes at a speed of 0.87.
    assert abs(float(run.events["half"].t[0]) - np.pi / 3) < 100 * 1e-10


@pytest.mark.parametrize("method", ABLE)
def test_bounces(method: str) -> None:
    """Falling from 1 under gravity 1, bouncing with half of the speed: at √2·(1, 1 + 1, 1 + 1 + 1/2, …).

    All methods here are exact for a parabola; each flight adds some roundings of numbers up to 4 in each of some 30 steps.
    """

    @sw.system
    def ball(t: Any, v: Any, y: Any, *, gravity: float = 1.0) -> Any:
        return -gravity

    ground = sw.Event(lambda t, v, y: y, direction=-1, terminal=True, name="ground")
    v, y, t, times = 0.0, 1.0, 0.0, []
    for _ in range(6):
        run = sw.integrate(ball(), method, v=v, y=y, tolerance=1e-9, at=[t + 10.0], t0=t, events=ground)
        assert run.stopped_at is not None
        v, y, t = -0.5 * float(run.v[-1]), float(run.y[-1]), float(run.stopped_at)
        assert -1e-13 < y <= 0.0  # at or past the ground
        times.append(t)
    expected = 2**0.5 * (1.0 + 2.0 * np.concatenate([[0.0], np.cumsum(0.5 ** np.arange(1, 6))]))
    assert np.abs(np.array(times) - expected).max() < 6 * 30 * 4 * 4 * U


# ---- mistakes


def test_mistake_a_straight_line_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collected, "located", straight)
    with pytest.raises(AssertionError):
        test_the_error_of_the_time_follows_the_tolerance_and_is_that_of_the_motion("dop853")


def test_mistake_the_end_before_the_event_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collected, "located", low_end)
    with pytest.raises(AssertionError):
        test_bounces("merson")


def test_mistake_trials_at_another_time_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    step = AdaptiveTrials.step
    monkeypatch.setattr(AdaptiveTrials, "step", lambda self, index, t, h, v, y: step(self, index, 0.0 * t, h, v, y))
    with pytest.raises(AssertionError):
        test_a_driven_motion_passes_in_time("merson")


@pytest.mark.parametrize("method", ["merson", "taylor"])
def test_mistake_the_length_of_another_step_is_noticed(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The step to try next is not the one that was made; of a series the one before is not."""
    series = sw.method(method).has_series
    monkeypatch.setattr(attempts.Attempts, "lengths", lambda self, plan: self.h[:-1] if series else self.h[1:])
    with pytest.raises(AssertionError):
        test_a_trial_is_the_state_that_is_saved_within_a_step(method, "pendulum")


def test_mistake_what_comes_after_the_end_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    class Wrong(adaptive._Driver):
        def __init__(self, *given: Any) -> None:
            super().__init__(*given)
            self.far = self.end

        def _look(self, *given: Any) -> Any:
            self.end = np.inf
            try:
                return super()._look(*given)
            finally:
                self.end = self.far

    monkeypatch.setattr(adaptive, "_Driver", Wrong)
    with pytest.raises(AssertionError):
        test_the_ends_of_a_run()


def test_mistake_what_came_before_the_piece_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    look = adaptive._Driver._look
    monkeypatch.setattr(adaptive._Driver, "_look", lambda self, *given: look(self, *given[:-1], False))
    with pytest.raises(AssertionError):
        test_pieces_find_what_the_whole_finds_and_saved_times_do_not_matter("merson", False)


def test_mistake_attempts_after_the_end_of_a_member_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = adaptive._Driver.stepped

    def wrong(self: Any, *given: Any) -> Any:
        self.attempts += 1e6
        return right(self, *given)

    monkeypatch.setattr(adaptive._Driver, "stepped", wrong)
    with pytest.raises(AssertionError):
        test_what_comes_after_a_terminal_event_is_not_computed("merson", monkeypatch)


def test_mistake_one_attempt_too_few_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = adaptive._Driver.stepped

    def wrong(self: Any, *given: Any) -> Any:
        self.attempts -= 1.0
        return right(self, *given)

    monkeypatch.setattr(adaptive._Driver, "stepped", wrong)
    with pytest.raises(AssertionError):
        test_a_member_that_stopped_stays_where_it_was_and_cannot_go_on()


def test_no_warning_is_hidden_by_these_tests() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sweep()
