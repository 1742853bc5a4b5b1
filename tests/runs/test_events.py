"""Runs and worlds with events: steps are those of runs without, and what is found does not depend on how the run is made.

That a run has the same events by both backends, in any company and on threads is in ``test_ways.py``, too; where events are is in
``test_events_located.py``, and what changes the state in ``test_events_then.py``.
"""

from __future__ import annotations

import copy
import itertools
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, TooLargeError, TraceError, UnsupportedError
from stepwell.runs import engine
from stepwell.runs.events import Occurrences, adaptive, attempts, collected, driver, trials
from stepwell.runs.events import frames as frames_of_worlds
from stepwell.runs.events.frames import Frames
from stepwell.runs.events.members import Members
from stepwell.runs.events.traced import Quantity
from stepwell.runs.events.trials import AdaptiveTrials, Trials, one_step
from support.cases import ADAPTIVE, SYSTEMS, Case, assert_same, cases, fits, number, representative
from support.events import ABLE, FEW, assert_same_events, crossing, passing
from support.families import family
from support.ways import assert_equal_ways, assert_same_run

# ---- of many methods and systems

DIRECT = [case for case in cases() if case.form == "direct"]
#: Of a method of each structure the case with the lowest number.
OF_FEW = {min((case for case in DIRECT if case.method == name), key=number) for name in FEW}


@pytest.mark.parametrize("case", family(DIRECT, lambda case: case in OF_FEW, str))
@pytest.mark.filterwarnings("ignore")
def test_fixed_steps_are_those_of_a_run_without(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    event = passing(SYSTEMS[case.system](np.random.default_rng(0), 1), 0.1)
    for dtype in ("float64", "float32"):
        if dtype == "float32" and case.refused_in_float32():
            continue
        plain, run = case.run(5, dtype=dtype), case.run(5, events=event, dtype=dtype)
        assert_same(plain, run)
        reference = case.run(5, events=event, backend="numpy", dtype=dtype)
        assert_same(reference, run)
        assert_same_events(reference, run)
        # Where few states are saved the core notices changes of sign, and only the steps of such members are looked at.
        with monkeypatch.context() as patch:
            patch.setattr(driver, "FEW_MEMBERS", 1)
            patch.setattr(driver, "WATCHED_STEPS", 8)
            noticed = case.run(5, every=None, events=event, dtype=dtype)
        assert_same_events(reference, noticed)
        np.testing.assert_array_equal(noticed.y[-1], plain.y[-1])
        np.testing.assert_array_equal(noticed.v[-1], plain.v[-1])


def goes(name: str, method: str) -> bool:
    """Whether a method takes adaptive steps of a system."""
    system, record = SYSTEMS[name](np.random.default_rng(5), 1).uncontrolled, sw.method(method)
    series = record.has_series and (system.chooses or system.contacts or np.isfinite(system.samples[0]))
    return fits(system, record) and not series


ADAPTED = [(name, method) for name, method in itertools.product(ADAPTIVE, ABLE) if goes(name, method)]
ADAPTED_OF_FEW = {min((pair for pair in ADAPTED if pair[1] == name), key=number) for name in ABLE if name in FEW}


@pytest.mark.parametrize(("name", "method"), family(ADAPTED, lambda *pair: pair in ADAPTED_OF_FEW))
@pytest.mark.filterwarnings("ignore::stepwell.ToleranceWarning")
def test_adaptive_steps_are_those_of_a_run_without(name: str, method: str) -> None:
    rng, record = np.random.default_rng(5), sw.method(method)
    system = SYSTEMS[name](rng, 3).uncontrolled
    v, y = 0.3 * rng.normal(size=(*system.v_shape, 3)), rng.normal(size=(*system.y_shape, 3))
    if record.has_series and system.constraint == "length":
        v = 0.0 * v
    start = float((y if y.size else v).ravel()[0])
    event = passing(system, lambda t: start + 0.01 * t - 1e-4)
    most = 10 if record.has_series else 20
    ask: dict[str, Any] = {"v": v, "y": y, "tolerance": 1e-4, "at": [0.0, 0.05, 0.2], "max_steps": most}
    for ask["dtype"] in ("float64", "float32"):
        try:
            plain = sw.integrate(system, method, **ask)
        except (UnsupportedError, ArgumentError, TraceError):
            assert ask["dtype"] == "float32"
            continue
        run = sw.integrate(system, method, **ask, events=event)
        assert_same_run(run, plain)
        reference = sw.integrate(system, method, **ask, events=event, backend="numpy")
        assert_same_run(reference, run)
        assert_same_events(reference, run)


def test_steps_with_pushes_are_those_of_a_run_without() -> None:
    """With what a control or a projection does, too."""
    v, y = np.array([[0.0, 0.1], [0.0, 0.6]]), np.array([[0.0, 0.0], [1.5, 0.0]])
    event = sw.Event(lambda t, v, y: y[1, 1] - 0.3, name="line")
    fixed, adapted = {"dt": 0.02, "steps": 200}, {"tolerance": 1e-6, "at": [5.0]}
    for method, options in (
        ("rk4", fixed | {"fused": True}),
        ("rk4", fixed | {"control": sw.Projection("nacozy")}),
        ("rk4", fixed | {"force": 0.1}),
        ("merson", adapted | {"control": sw.EnergyControl(gain=0.5)}),
        ("merson", adapted | {"control": sw.Projection()}),
    ):
        bodies = sw.NBody([1.0, 0.5], force="newton" if "steps" in options else "logarithmic")
        plain, run = (sw.integrate(bodies, method, v=v, y=y, **options, **more) for more in ({}, {"events": event}))
        np.testing.assert_array_equal(run.y, plain.y, err_msg=str(options))
        assert run.events["line"].count > 0, options
        # Of steps of fixed length whose events are looked for nobody adds up the work.
        np.testing.assert_array_equal(run.work, plain.work if "tolerance" in options else None)


#: For trials each system and each method is taken once, and by default a fourth of these.
TRIED = representative(DIRECT, {"direct": 1}, "events")


@pytest.mark.parametrize("part", family(range(4), lambda part: part == 0))
@pytest.mark.filterwarnings("ignore")
def test_a_trial_of_the_whole_length_is_the_step_whatever_members_are_taken(part: int, monkeypatch: pytest.MonkeyPatch) -> None:
    index, t = np.array([3, 0, 0, 4]), np.zeros(4)
    for case, single in itertools.product((case for case in TRIED if number(str(case)) % 4 == part), (False, True)):
        if single and case.refused_in_float32():
            continue
        system, arguments = case.make(5)
        method, dt = sw.method(case.method), float(np.float32(0.1)) if single else 0.1
        choice, stepped = method.start_choice(case.start), system.stepped_by(method)
        plan = engine.Plan(stepped, method, (5,), dt, choice=choice, single=single)
        members, h = Members(plan), np.full(4, dt)
        whole = [arguments[name].astype(np.float32).astype(np.float64) if single else arguments[name] for name in ("v", "y")]
        v, y = (each[..., index] for each in whole)
        out = engine.advance(plan, *whole)
        by_core = Trials(plan, members).step(index, t, h, v, y)
        ways = [by_core] if single else [by_core, one_step(members.plan(index), t, h, v, y)]
        # Of other lengths, too, by the core and by the reference.
        shorter = h * np.array([3.0, 0.1, 9.0, 5.0]) / 10.0
        with monkeypatch.context() as patch:
            patch.setattr(trials, "MEMBERS_BY_CORE", 4)
            shorter_by_core = Trials(plan, members).step(index, t, shorter, v, y)
            patch.setattr(trials, "MEMBERS_BY_CORE", 0)
            ways += [] if single else [Trials(plan, members).step(index, t, h, v, y)]
            by_trial = Trials(plan, members).step(index, t, shorter, v, y)
        for trial in ways:
            for block, step in zip(trial, (out.v[-1], out.y[-1]), strict=True):
                np.testing.assert_array_equal(block, step[..., index], err_msg=f"{case}, {single}")
        for one, other in zip(shorter_by_core, by_trial, strict=True):
            np.testing.assert_array_equal(one, other, err_msg=f"{case}, {single}")


def check_trials_within_a_step(method: str, name: str) -> None:
    """A trial to any time within a step, and to its end, is the state that is saved there."""
    rng, record = np.random.default_rng(1), sw.method(method)
    system = SYSTEMS[name](rng, 4)
    v, y = 0.3 * rng.normal(size=(*system.v_shape, 4)), rng.normal(size=(*system.y_shape, 4))
    plan = engine.Plan(system, record, (4,), 1.0, order=10 if record.has_series else 0)
    paces = engine.paces(plan, None, engine.Tolerances(np.array(1e-6), None))
    out = attempts.attempted(plan, np.inf, 12, 1000, True, paces, v, y)
    of_members, who = AdaptiveTrials(plan, Members(plan)), np.arange(4)
    h = out.lengths(plan)[10]
    for block, end in zip(of_members.step(who, out.t[10], h, out.v[10], out.y[10]), (out.v[11], out.y[11]), strict=True):
        np.testing.assert_array_equal(block, end, err_msg=f"{method}, {name}")
    for share in (0.1, 0.7):
        at = out.t[10] + share * h
        trial = of_members.step(who, out.t[10], at - out.t[10], out.v[10], out.y[10])
        for i in who:
            saved = engine.adapt(plan, engine.Pacing(at[i : i + 1], 1000, True), paces, v, y)
            for block, states in zip(trial, (saved.v, saved.y), strict=True):
                np.testing.assert_array_equal(block[..., i], states[0][..., i], err_msg=f"{method}, {name}")


def test_a_trial_of_an_adaptive_step_is_the_state_that_is_saved_within_it() -> None:
    for method, name in itertools.product(ABLE, ("pendulum", "own: top")):
        check_trials_within_a_step(method, name)


# ---- a sweep that has something of everything

OMEGA = np.linspace(0.5, 2.0, 40)
#: The first comes often, the second in steps of its own and three are kept, the third stops about half of the members.
THREE = [
    crossing,
    sw.Event(lambda t, v, y, omega: v - 0.2 * omega, direction=1, most=3, name="speed"),
    sw.Event(lambda t, v, y, omega: omega * t + 3.0 * y - 38.0, direction=1, terminal=True, name="end"),
]
STEPS: dict[str, dict[str, Any]] = {
    "fixed": {"method": "rk4", "dt": 0.1, "steps": 300, "every": 7},
    "adaptive": {"method": "merson", "tolerance": 1e-6, "at": np.linspace(0.0, 30.0, 20)},
}
DRIVERS = pytest.mark.parametrize("steps", STEPS)


def asked(steps: str, members: Any = slice(None), **options: Any) -> dict[str, Any]:
    """What ``integrate`` is asked for."""
    v, omega = np.linspace(-0.5, 0.5, 40)[members], OMEGA[members]
    return {"system": sw.Pendulum(omega), "v": v, "y": np.ones_like(v), "events": THREE} | STEPS[steps] | options


def sweep(steps: str, members: Any = slice(None), **options: Any) -> sw.Run:
    ask = asked(steps, members, **options)
    return sw.integrate(ask.pop("system"), ask.pop("method"), **ask)


@DRIVERS
def test_the_sweep_has_something_of_everything(steps: str) -> None:
    run = sweep(steps)
    stopped = ~np.isnan(run.stopped_at)
    assert 5 < stopped.sum() < 35
    assert (run.events["speed"].count > 3).any()
    assert len(run.events["speed"].t) == np.minimum(run.events["speed"].count, 3).sum()
    assert len(run.events["crossing"].t) == run.events["crossing"].count.sum() > 40
    np.testing.assert_array_equal(run.status == sw.Status.EVENT, stopped)


@pytest.mark.parametrize(
    ("steps", "options"),
    [
        ("fixed", {}),
        ("fixed", {"method": "verlet"}),
        ("fixed", {"dtype": "float32"}),
        ("adaptive", {}),
        ("adaptive", {"method": "taylor", "tolerance": 1e-4}),
    ],
)
def test_the_sweep_is_the_same_in_all_ways(steps: str, options: dict[str, Any]) -> None:
    ways = ["at each level", "alone", "in company", "saved more often", "prepared"]
    if options.get("method") != "taylor":  # whose reference goes number by number
        ways.append("by the reference")
    assert_equal_ways(ways=ways, **asked(steps, slice(0, 40, 9), **options))
    if not options:  # of a hundred members and more the core notices changes of sign itself, if no states are saved on the way
        omega = np.linspace(0.5, 2.0, 131)
        more = {"system": sw.Pendulum(omega), "v": np.full(131, 0.1), "y": np.ones(131), "every": None}
        assert_equal_ways(ways=("alone", "in company"), **asked(steps, **options | more))


@pytest.mark.parametrize(("method", "dtype"), [("rk4", "float32"), ("verlet", "float64"), ("merson", "float64")])
def test_how_many_are_looked_at_together_does_not_matter(method: str, dtype: str, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = "adaptive" if method == "merson" else "fixed"
    run = sweep(steps, slice(3, 40, 12), method=method, dtype=dtype)
    assert 1 <= (~np.isnan(run.stopped_at)).sum() <= 3
    for numbers, longest, located in ((1 << 6, 5, 1), (1 << 4, 1, 7)):
        for module, name, most in (
            (driver, "NUMBERS_AT_ONCE", numbers),
            (driver, "MOST_STEPS", longest),
            (adaptive, "NUMBERS_AT_ONCE", numbers),
            (adaptive, "MOST_ATTEMPTS", longest),
            (collected, "LOCATED_AT_ONCE", located),
        ):
            monkeypatch.setattr(module, name, most)
        other = sweep(steps, slice(3, 40, 12), method=method, dtype=dtype)
        assert_same_run(run, other)
        assert_same_events(run, other)


@pytest.mark.parametrize("method", ["rk4", "verlet"])
def test_what_the_core_notices_is_all_that_there_is(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for every in (None, 50):
        every_state = sweep("fixed", method=method, every=every)  # 40 are few
        with monkeypatch.context() as patch:
            patch.setattr(driver, "FEW_MEMBERS", 1)
            for watched in (64, 3, 1000):
                patch.setattr(driver, "WATCHED_STEPS", watched)
                noticed = sweep("fixed", method=method, every=every)
                assert_same(every_state, noticed)
                assert_same_events(every_state, noticed)


@pytest.mark.mutant
def test_mistake_the_core_notices_another_quantity_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """So the core's part is not idle: of a quantity that never changes its sign it notices nothing within some steps. At their
    end the quantity itself is looked at, which finds more; here it does not.
    """
    run = sweep("fixed", every=None)
    monkeypatch.setattr(driver, "FEW_MEMBERS", 1)
    right = driver.watched
    never = sw.Event(lambda t, v, y: y * y + 1.0)
    monkeypatch.setattr(driver, "near", lambda g, before: np.zeros(g.shape, dtype=bool))

    def wrong(quantities: Any, plan: Any) -> Any:
        return right([Quantity(never, plan.system, {}) for _ in quantities], plan)

    monkeypatch.setattr(driver, "watched", wrong)
    assert sweep("fixed", every=None).events["crossing"].count.sum() < run.events["crossing"].count.sum()


def test_a_system_whose_step_is_too_long_for_one_tape(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 600 masses: there the core does not notice anything, and all states are looked at."""
    monkeypatch.setattr(driver, "FEW_MEMBERS", 1)
    y = np.zeros((600, 3))
    y[0] = 1.0, 1.1, 1.2
    event = sw.Event(lambda t, v, y: y[0] - 0.5, name="half")
    ask: dict[str, Any] = {"v": 0.0, "y": y, "dt": 0.1, "steps": 40, "events": event}
    rust, numpy = (sw.integrate(sw.Chain(600), "rk4", **ask, backend=backend) for backend in ("rust", "numpy"))
    assert rust.events["half"].count.all()
    assert_same_events(rust, numpy)


def test_batch_axes_and_parameters_of_all_shapes() -> None:
    omega, damping, tolerance = np.linspace(0.5, 2.0, 6).reshape(3, 2), np.array([0.0, 0.2]), np.array([1e-5, 1e-8])
    event = sw.Event(lambda t, v, y, omega, damping: y - 0.1 * omega - damping, name="zero")

    def zeros(method: str, i: Any = ..., j: Any = ...) -> Any:
        steps = {"dt": 0.1, "steps": 100} if method == "rk4" else {"tolerance": tolerance[j], "at": [3.0, 9.0]}
        system = sw.Pendulum(omega[i, j] if i is not ... else omega, damping[j])
        return sw.integrate(system, method, v=0.0, y=1.0, events=event, **steps).events["zero"]

    for method in ("rk4", "fehlberg_5"):
        of_all = zeros(method)
        assert of_all.count.shape == (3, 2)
        for i, j in np.ndindex(3, 2):
            np.testing.assert_array_equal(zeros(method, i, j).t, of_all.of((i, j)).t)
            np.testing.assert_array_equal(zeros(method, i, j).y, of_all.of((i, j)).y)
    assert len(of_all.of((-1, -1)).t) == of_all.count[-1, -1]
    with pytest.raises(ArgumentError, match="index: expected 2 whole"):
        of_all.of(1)
    with pytest.raises(ArgumentError, match="index: expected -2"):
        of_all.of((0, 2))


# ---- pieces


def test_pieces_of_fixed_steps_find_what_the_whole_finds() -> None:
    for method, dtype in itertools.product(("rk4", "verlet", "leapfrog"), ("float64", "float32")):
        ask: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": 0.1, "events": crossing, "dtype": dtype}
        whole, head = (sw.integrate(sw.Oscillator(), method, **ask, steps=steps) for steps in (200, 77))
        tail = sw.integrate(sw.Oscillator(), method, resume=head, steps=123, events=crossing)
        np.testing.assert_array_equal(tail.y[-1], whole.y[-1])
        for name in ("t", "v", "y", "step"):
            pieces = [getattr(each.events["crossing"], name) for each in (head, tail)]
            np.testing.assert_array_equal(np.concatenate(pieces), getattr(whole.events["crossing"], name))


def check_pieces_of_adaptive_steps(method: str, fused: bool) -> None:
    """Wherever the cut is: many of them, some within steps that have an event before or after the cut."""
    ask: dict[str, Any] = {"method": method, "members": slice(0, 5), "events": THREE[:2], "fused": fused}
    whole = sweep("adaptive", **ask, at=[12.0])
    assert_same_events(whole, sweep("adaptive", **ask, at=np.linspace(0.0, 12.0, 200)))
    times = np.append(whole.events["crossing"].of(0).t[[0, 1, 1]], 12.0)
    times[:3] += [0.02, -0.02, 0.02]
    ask["events"] = [crossing, sw.Event(THREE[1].function, direction=1, name="speed")]  # all of which are kept
    whole = sweep("adaptive", **ask, at=[12.0])
    run = sweep("adaptive", **ask, at=times[:1])
    pieces = [run]
    for end in times[1:]:
        run = sw.integrate(run.system, method, resume=run, at=[end], events=ask["events"])
        pieces.append(run)
    np.testing.assert_array_equal(run.y[-1], whole.y[-1])
    for name, theirs in whole.events.items():
        for i, what in itertools.product(range(5), ("t", "v", "y", "step")):
            mine = np.concatenate([getattr(piece.events[name].of(i), what) for piece in pieces])
            np.testing.assert_array_equal(mine, getattr(theirs.of(i), what))
        np.testing.assert_array_equal(sum(piece.events[name].count for piece in pieces), theirs.count)


@pytest.mark.parametrize(
    ("method", "fused"),
    family(
        itertools.product(ABLE, (False, True)), lambda *pair: pair in {("merson", False), ("rodas4", True), ("taylor", False)}
    ),
)
def test_pieces_of_adaptive_steps_find_what_the_whole_finds(method: str, fused: bool) -> None:
    check_pieces_of_adaptive_steps(method, fused)


def test_a_run_that_was_out_of_attempts_goes_on() -> None:
    whole = sweep("adaptive", slice(0, 5), events=crossing, at=[12.0])
    with pytest.warns(sw.ToleranceWarning):
        head = sweep("adaptive", slice(0, 5), events=crossing, at=[12.0], max_steps=int(whole.paces.accepted.max()) // 2)
    tail = sw.integrate(head.system, "merson", resume=head, at=[12.0], events=crossing)
    np.testing.assert_array_equal(tail.y[-1], whole.y[-1])
    counts = [each.events["crossing"].count for each in (head, tail, whole)]
    assert counts[0].any()
    assert counts[1].any()
    np.testing.assert_array_equal(counts[0] + counts[1], counts[2])


# ---- ends


@DRIVERS
def test_a_member_that_stopped_stays_where_it_was_and_cannot_go_on(steps: str) -> None:
    every = {"every": 1} if steps == "fixed" else {}
    run, free = sweep(steps, **every), sweep(steps, events=THREE[:2], **every)
    ends = run.events["end"]
    for i in range(40):
        end = ends.of(i)
        before = run.t < (run.stopped_at[i] if len(end.t) else np.inf)
        np.testing.assert_array_equal(run.y[before, i], free.y[before, i])  # to there it is the motion without an end
        if not len(end.t):
            continue
        assert end.count == len(end.t) == 1
        assert run.stopped_at[i] == end.t[0]
        if run.paces is None:
            assert run.t[end.step[0]] < end.t[0] <= run.t[end.step[0] + 1] + 1e-12
        else:
            assert (end.t[0], end.step[0]) == (run.paces.t[i], run.paces.accepted[i] - 1)
        for states, state in ((run.v, end.v), (run.y, end.y)):
            np.testing.assert_array_equal(states[~before, i], np.broadcast_to(state[0], (~before).sum()))
        for other in ("crossing", "speed"):
            times = free.events[other].of(i).t
            np.testing.assert_array_equal(run.events[other].of(i).t, times[times <= end.t[0]])
    more: dict[str, Any] = {"steps": 1} if steps == "fixed" else {"at": [99.0]}
    with pytest.raises(UnsupportedError, match="stopped at an event"):
        sw.integrate(run.system, run.method, resume=run, **more)
    assert "stopped at an event" in repr(run)


def test_what_comes_after_a_terminal_event_in_its_step_is_not_there() -> None:
    """Falling from 1 under gravity 1: y passes 0.5 at t = 1, and 0.48 at 1.02, in the same step of 0.3."""
    falling = sw.system(lambda t, v, y, *, g=1.0: -g)
    half = sw.Event(lambda t, v, y: y - 0.5, terminal=True, name="half")
    later = sw.Event(lambda t, v, y: y - 0.48, name="later")
    earlier = sw.Event(lambda t, v, y: y - 0.52, name="earlier")
    # Of two terminal events the first counts, in whatever order they are given.
    both = [sw.Event(each.function, terminal=True, name=each.name) for each in (later, half, earlier)]
    for events, counts in (([later, half, earlier], [0, 1, 1]), (both, [0, 0, 1])):
        run = sw.integrate(falling(), "rk4", v=0.0, y=1.0, dt=0.3, steps=10, events=events)
        assert [each.count.item() for each in run.events.values()] == counts
        # A parabola is exact by RK4 but for roundings, a few units of 1.
        assert events is both or abs(run.stopped_at - 1.0) < 1e-14


growing = sw.system(order=1)(lambda t, y, *, rate=1.0: rate * y * y)


def check_what_comes_after_a_terminal_event_is_not_computed(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """ẏ = y² from 1 is 1/(1 − t): infinite at 1, where steps become too short; without a word if it stops at y = 10, t = 0.9."""
    results: list[Any] = []
    adapt = engine.adapt
    ten = sw.Event(lambda t, y: y - 10.0, terminal=True, name="ten")
    with monkeypatch.context() as patch:
        patch.setattr(engine, "adapt", lambda *arguments: results.append(adapt(*arguments)) or results[-1])
        run = sw.integrate(growing(), method, y=1.0, tolerance=1e-8, at=[0.5, 2.0], events=ten)
    # The relative error of y is within some 100 tolerances, and y passes 10 at a speed of 100: δt = 0.1·δy/y.
    assert abs(run.stopped_at - 0.9) < (1e-5 if sw.method(method).order == 2 else 1e-7)
    assert abs(run.y[-1] - 10.0) < 1e-9
    assert run.first_bad_step == -1
    assert len(results) == 1
    assert results[0].paces[engine.COUNTS.start] == run.paces.accepted
    # A run to that time alone has one more state to save, and does not take its last step.
    near = sw.integrate(growing(), method, y=1.0, tolerance=1e-8, at=[0.5, float(run.stopped_at)])
    assert run.paces.accepted - 1 == near.paces.accepted
    assert run.paces.rejected == near.paces.rejected
    assert run.paces.evaluations <= near.paces.evaluations


@pytest.mark.parametrize("method", ABLE)
def test_what_comes_after_a_terminal_event_is_not_computed(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And runs that end early, out of attempts or as steps become too short, end as without events: what was passed is found."""
    check_what_comes_after_a_terminal_event_is_not_computed(method, monkeypatch)
    two = sw.Event(lambda t, y: y - 2.0, name="two")
    for options in ({"max_steps": 40}, {}):
        ask: dict[str, Any] = {"y": 1.0, "tolerance": 1e-8, "at": [0.1, 2.0], **options}
        with pytest.warns(sw.ToleranceWarning):
            plain, run = (sw.integrate(growing(), method, **ask, **more) for more in ({}, {"events": two}))
        assert_same(plain, run)
        assert (run.paces, run.status) == (plain.paces, plain.status)
        assert run.events["two"].count == int(plain.paces is not None and plain.paces.t > 0.5)


ascending = sw.system(order=1)(lambda t, y: 1.0 + 0.0 * y)


def test_a_state_at_zero_counts_once_and_not_at_the_start() -> None:
    """y = k exactly: at step 3 y − 3 is 0, at step 0 y is."""
    events = [sw.Event(lambda t, y: y - 3.0, name="three"), sw.Event(lambda t, y: y, name="start")]
    run = sw.integrate(ascending(), "standard_euler", y=0.0, dt=1.0, steps=8, events=events)
    assert run.events["three"].t.tolist() == [3.0]
    assert run.events["start"].count == 0


def test_the_ends_of_an_adaptive_run() -> None:
    """An event at the start does not count, one just before the end does, and one just after it does not.

    The last step is no longer than five times the way so far; a place is past its event by 2⁻⁴⁸ of that at most.
    """
    places = {"start": 0.0, "before": 2.0 - 2.0**-43, "after": 2.0 + 2.0**-43}
    events = [sw.Event(lambda t, y, at=at: t - at, name=name) for name, at in places.items()]
    run = sw.integrate(ascending(), "merson", y=0.0, tolerance=1e-6, at=[1.0, 2.0], events=events)
    assert [each.count.item() for each in run.events.values()] == [0, 1, 0]
    assert 0.0 <= run.events["before"].t[0] - places["before"] <= 10.0 * 2.0**-48


@DRIVERS
def test_directions_and_how_many_are_kept(steps: str) -> None:
    def zeros(**options: Any) -> Any:
        event = sw.Event(lambda t, v, y: y, name="zero", **options)
        more = {"dt": 0.1, "steps": 200} if steps == "fixed" else {"tolerance": 1e-9, "at": [20.0]}
        return sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, events=event, **more).events["zero"]

    assert (zeros(direction=-1).v < 0).all()
    assert (zeros(direction=1).v > 0).all()
    np.testing.assert_array_equal(np.sort(np.concatenate([zeros(direction=-1).t, zeros(direction=1).t])), zeros().t)
    assert len(zeros().t) == 6  # zeros of the cosine up to t = 20
    assert zeros(most=2).count == 6
    np.testing.assert_array_equal(zeros(most=2).t, zeros().t[:2])


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_a_member_that_diverges_has_no_events_after_that() -> None:
    """Standard Euler of ω·h = 30 grows by a factor of 30 a step, its sign changing, until it overflows; its neighbour goes on."""
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 400}
    event = sw.Event(lambda t, v, y: y, name="zero")
    run = sw.integrate(sw.Oscillator([300.0, 1.0]), "standard_euler", **ask, events=event)
    plain = sw.integrate(sw.Oscillator([300.0, 1.0]), "standard_euler", **ask, every=1)
    np.testing.assert_array_equal(run.first_bad_step, plain.first_bad_step)
    bad = int(run.first_bad_step[0])
    assert bad > 0 > run.first_bad_step[1]
    y = plain.y[:bad, 0]
    expected = ((y[:-1] < 0) & (y[1:] >= 0)) | ((y[:-1] > 0) & (y[1:] <= 0))
    assert run.events["zero"].count[0] == expected.sum() > 10
    assert (run.events["zero"].of(0).step < bad - 1).all()
    # A member that stopped before it would have diverged did not diverge.
    stopping = sw.Event(lambda t, v, y: y, terminal=True, name="zero")
    run = sw.integrate(sw.Oscillator([300.0, 1.0]), "standard_euler", **ask, events=stopping)
    assert (run.first_bad_step < 0).all()
    assert (run.status == sw.Status.EVENT).all()


# ---- worlds

TWO = [crossing, THREE[1]]
FIELDS = ("member", "step", "t", "v", "y")


def together(pieces: list[dict[str, Occurrences]], name: str) -> list[Any]:
    """What several calls found of an event, by member and then by time."""
    order = np.argsort(np.concatenate([each[name].member for each in pieces]), kind="stable")
    return [np.concatenate([getattr(each[name], field) for each in pieces])[order] for field in FIELDS]


def frames(world: sw.World, *steps: int) -> list[dict[str, Occurrences]]:
    """What each of these calls of ``step`` found."""
    occurrences = []
    for n in steps:
        world.step(n)
        occurrences.append(world.events)
    return occurrences


def start(batch: tuple[int, ...] = (6,), dtype: str = "float64") -> dict[str, Any]:
    return {"v": np.linspace(-0.5, 0.5, int(np.prod(batch))).reshape(batch).astype(dtype), "y": np.ones(batch, dtype)}


def drawn(method: str, batch: tuple[int, ...], dtype: str) -> bool:
    return (method in FEW and (batch, dtype) == ((3, 2), "float64")) or (method in ("rk4", "verlet") and batch != (3, 2))


@pytest.mark.parametrize(
    ("method", "batch", "dtype"),
    family(itertools.product([m.name for m in sw.methods()], [(), (6,), (3, 2)], ["float64", "float32"]), drawn),
)
def test_a_world_finds_what_a_run_finds(method: str, batch: tuple[int, ...], dtype: str) -> None:
    if dtype == "float32" and sw.method(method).has_series:
        return
    system = sw.Pendulum(np.linspace(0.5, 2.0, int(np.prod(batch))).reshape(batch))
    options = {"dt": 0.1, "t0": 0.4, "dtype": dtype}
    run = sw.integrate(system, method, **start(batch), **options, steps=60, events=TWO)
    plain = sw.World(system, method, **start(batch, dtype), **options)
    world = sw.World(system, method, **start(batch, dtype), **options, events=TWO)
    pieces = frames(world, 20, 1, 0, 1, 18, 20)
    plain.step(60)
    assert (world.t, world.step_number) == (plain.t, 60)
    np.testing.assert_array_equal(world.y, plain.y)
    np.testing.assert_array_equal(world.v, plain.v)
    assert pieces[2]["crossing"].count.sum() == 0
    for name, occurrences in run.events.items():
        np.testing.assert_array_equal(sum(each[name].count for each in pieces), occurrences.count)
        for mine, field in zip(together(pieces, name), FIELDS, strict=True):
            np.testing.assert_array_equal(mine, getattr(occurrences, field))
    assert len(run.events["crossing"].t) > 0


def test_so_many_of_a_call_are_kept() -> None:
    world = sw.World(sw.Pendulum(3.0), "rk4", **start(()), dt=0.1, events=sw.Event(crossing, most=2))
    world.step(100)
    assert world.events["crossing"].count > len(world.events["crossing"].t) == 2


@pytest.mark.parametrize("method", ["rk4", "verlet"])
def test_what_is_written_between_calls_is_no_event_and_counts(method: str) -> None:
    """A kick that changes the sign of g is none of the motion; what comes after it is that of a run from there."""
    world = sw.World(sw.Pendulum(), method, **start(()), dt=0.1, events=crossing)
    world.step(3)
    assert world.events["crossing"].count == 0
    world.y[...] = -world.y
    run = sw.integrate(sw.Pendulum(), method, v=world.v, y=world.y, dt=0.1, start_step=3, steps=30, events=crossing)
    pieces = frames(world, 1, 29)
    assert pieces[0]["crossing"].count == 0
    np.testing.assert_array_equal(world.y, run.y[-1])
    assert run.events["crossing"].count > 0
    np.testing.assert_array_equal(pieces[1]["crossing"].t, run.events["crossing"].t)


@pytest.mark.parametrize("method", ["rk4", "pefrl"])
def test_a_force_that_changes(method: str) -> None:
    """Each call is a run with the force of that call."""
    force = np.zeros(6)
    world = sw.World(sw.Pendulum(), method, **start(), dt=0.1, force=force, events=crossing)
    total = 0
    for k in range(4):
        force[:] = 0.5 * (-1) ** k
        run = sw.integrate(sw.Pendulum(), method, dt=0.1, resume=world, steps=10, events=crossing)
        world.step(10)
        np.testing.assert_array_equal(world.y, run.y[-1])
        assert world.events["crossing"] == run.events["crossing"]
        total += len(world.events["crossing"].t)
    assert total > 0


def test_a_member_of_a_world_that_diverged_has_none() -> None:
    world = sw.World(sw.Oscillator([300.0, 1.0]), "standard_euler", **start((2,)), dt=0.1, events=lambda t, v, y: y)
    world.step(400)
    assert not np.isfinite(world.y[0])
    name = next(iter(world.events))
    world.step(40)
    assert world.events[name].count[0] == 0
    assert world.events[name].count[1] > 0


def test_copies_of_a_world_have_the_same_events() -> None:
    world = sw.World(sw.Pendulum(), "verlet", **start(), dt=0.1, events=TWO)
    world.step(7)
    others = [copy.copy(world), copy.deepcopy(world)]
    world.step(40)
    for other in others:
        other.step(40)
        assert other.events == world.events


# ---- values, progress, wrong calls


def test_progress_is_told_up_to_the_end() -> None:
    start, of_each = (np.array(0.0), np.array(1.0)), {"fixed": [], "adaptive": []}
    plan = engine.Plan(sw.Oscillator(), sw.method("rk4"), (), 0.1, steps=1000, progress=of_each["fixed"].append)
    driver.Run([sw.Event(crossing)], *start, None, False).advance(plan)
    plan = engine.Plan(sw.Pendulum(), sw.method("merson"), (), 1.0, progress=of_each["adaptive"].append)
    paces = engine.paces(plan, None, engine.Tolerances(np.array(1e-9), None))
    adaptive.AdaptiveRun([sw.Event(crossing)]).adapt(plan, engine.Pacing(np.array([100.0]), 10**6, True), paces, *start)
    for name, shares in of_each.items():
        assert shares == sorted(shares), name
        assert shares[-1] == 1.0, name
    assert len(of_each["adaptive"]) > 3


@DRIVERS
def test_results_are_values(steps: str, tmp_path: Path) -> None:
    run = sweep(steps)
    assert pickle.loads(pickle.dumps(run.events)) == run.events == copy.deepcopy(run.events)
    assert repr(run.events["end"]).startswith("<")
    assert run.events["end"] != run.events["speed"]
    run.save(tmp_path / "run.npz")
    assert sw.load(tmp_path / "run.npz") == run
    assert_same_events(sw.load(tmp_path / "run.npz"), run)
    assert sw.Event(crossing) == sw.Event(crossing) != sw.Event(crossing, direction=1)
    assert repr(sw.Event(crossing, terminal=True)) == "Event(crossing, terminal=True)"


def two(t: Any, v: Any, y: Any) -> Any:
    return [v, y]


def asks(t: Any, v: Any, y: Any) -> Any:
    return y if y > 0 else v


def test_wrong_events() -> None:
    chance = np.random.default_rng(0)
    many = sw.Event(crossing, most=10**6)
    of_many: dict[str, Any] = {"y": np.ones(10**6)}
    fixed, adapted = {"dt": 0.1, "steps": 5}, {"tolerance": 1e-6, "at": [1.0]}
    for events, error, message, steps in (
        (3.0, ArgumentError, "events: expected a list of events", fixed),
        (3.0, ArgumentError, "events: expected a list of events", adapted),
        ([3.0], ArgumentError, "events: expected functions", fixed),
        (float, ArgumentError, "events: expected functions", fixed),
        (lambda t, y: y, ArgumentError, r"expected a function \(t, v, y", fixed),
        (lambda t, y: y, ArgumentError, r"expected a function \(t, v, y", adapted),
        (lambda t, v, y, stiffness: y, ArgumentError, "got stiffness. Known: omega", fixed),
        ([crossing, crossing], ArgumentError, "got 'crossing' twice", fixed),
        (two, ArgumentError, "expected one number", fixed),
        (lambda t, v, y: None, ArgumentError, "expected one number", fixed),
        (asks, ArgumentError, "asks", fixed),
        (lambda t, v, y: y - chance.random(), ArgumentError, "same operations at every call", fixed),
        (many, TooLargeError, "the events of 1000000 members need", fixed | of_many | {"steps": 10**6}),
        (many, TooLargeError, "the events of 1000000 members need", adapted | of_many),
    ):
        with pytest.raises(error, match=message):
            sw.integrate(sw.Pendulum(), "merson", **{"v": 0.0, "y": 1.0} | steps, events=events)
    with pytest.raises(UnsupportedError, match="events: works with form='direct' only"):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=5, form="power", events=crossing)


def test_wrong_events_of_worlds() -> None:
    stops = r"events: no event stops a member of a world, got Event\(crossing, terminal=True\)"
    single = start(dtype="float32") | {"dtype": "float32"}
    for method, events, error, message, options in (
        ("rk4", [TWO[1], sw.Event(crossing, terminal=True)], UnsupportedError, stops, start()),
        ("taylor", crossing, UnsupportedError, "float32", single),
        ("rk4", [3.0], DTypeError, "events: expected functions", start()),
        ("rk4", lambda t, y: y, ArgumentError, r"expected a function \(t, v, y", start()),
    ):
        with pytest.raises(error, match=message):
            sw.World(sw.Pendulum(), method, **options, dt=0.1, events=events)
    world = sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1, events=crossing)
    with pytest.raises(ArgumentError, match="n: expected"):
        world.step(-1)
    assert sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1).events == {}


# ---- mistakes


@pytest.mark.mutant
def test_mistake_the_quantity_of_the_last_call_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right, quantities = Frames._quantities, {}

    def wrong(self: Frames, step: int) -> Any:
        return quantities.setdefault((id(self), step), right(self, step))

    monkeypatch.setattr(Frames, "_quantities", wrong)
    with pytest.raises(AssertionError):
        test_what_is_written_between_calls_is_no_event_and_counts("rk4")


@pytest.mark.mutant
def test_mistake_the_force_of_the_first_call_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    first: list[Any] = []

    def wrong(plan: Any) -> Any:
        first.append(plan._replace(force=np.zeros(6)))
        return right(first[0])

    right = frames_of_worlds.Members
    monkeypatch.setattr(frames_of_worlds, "Members", wrong)
    with pytest.raises(AssertionError):
        test_a_force_that_changes("rk4")


@pytest.mark.mutant
@pytest.mark.parametrize("method", ["merson", "taylor"])
def test_mistake_the_length_of_another_step_is_noticed(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The step to try next is not the one that was made; of a series the one before is not."""
    series = sw.method(method).has_series
    monkeypatch.setattr(attempts.Attempts, "lengths", lambda self, plan: self.h[:-1] if series else self.h[1:])
    with pytest.raises(AssertionError):
        check_trials_within_a_step(method, "pendulum")


@pytest.mark.mutant
def test_mistake_what_comes_after_the_end_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    class Wrong(adaptive._Driver):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.far = self.end

        def _look(self, *arguments: Any) -> Any:
            self.end = np.full_like(self.far, np.inf)
            try:
                return super()._look(*arguments)
            finally:
                self.end = self.far

    monkeypatch.setattr(adaptive, "_Driver", Wrong)
    with pytest.raises(AssertionError):
        test_the_ends_of_an_adaptive_run()


@pytest.mark.mutant
def test_mistake_what_came_before_the_piece_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    look = adaptive._Driver._look
    monkeypatch.setattr(adaptive._Driver, "_look", lambda self, *arguments: look(self, *arguments[:-1], False))
    with pytest.raises(AssertionError):
        check_pieces_of_adaptive_steps("merson", False)


@pytest.mark.mutant
def test_mistake_attempts_after_the_end_or_one_too_few_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = adaptive._Driver.stepped

    def other_by(attempts: float) -> Any:
        def wrong(self: Any, *arguments: Any) -> Any:
            self.attempts += attempts
            return right(self, *arguments)

        return wrong

    monkeypatch.setattr(adaptive._Driver, "stepped", other_by(1e6))
    with pytest.raises(AssertionError):
        check_what_comes_after_a_terminal_event_is_not_computed("merson", monkeypatch)
    monkeypatch.setattr(adaptive._Driver, "stepped", other_by(-1.0))
    with pytest.raises(AssertionError):
        test_a_member_that_stopped_stays_where_it_was_and_cannot_go_on("adaptive")
