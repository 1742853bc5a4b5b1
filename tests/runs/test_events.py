"""Runs and worlds with events: steps are those of runs without, and what is found does not depend on how the run is made.

That a run has the same events by both backends is in ``test_ways.py``, too; where events are is in ``test_events_located.py``.
"""

import copy
import itertools
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, TooLargeError, UnsupportedError
from stepwell.runs import engine
from stepwell.runs.events import Occurrences, adaptive, attempts, by_core, collected, driver, trials
from stepwell.runs.events import frames as frames_of_worlds
from stepwell.runs.events.frames import Frames
from stepwell.runs.events.members import Members
from stepwell.runs.events.traced import Quantity
from stepwell.runs.events.trials import AdaptiveTrials, Trials, one_step
from support.cases import SYSTEMS, Case, assert_same, cases, number, representative
from support.events import ABLE, FEW, GRAVITY, U, assert_same_events, crossing, passing, without_core  # noqa: F401
from support.families import family
from support.refusals import refused
from support.ways import assert_equal_ways, assert_same_run

DIRECT = [case for case in cases() if case.form == "direct"]
#: Of a method of each structure the case with the lowest number.
OF_FEW = {min((case for case in DIRECT if case.method == name), key=number) for name in FEW}


@pytest.mark.parametrize("case", family(DIRECT, lambda case: case in OF_FEW, str))
@pytest.mark.filterwarnings("ignore")
def test_fixed_steps_are_those_of_a_run_without(case: Case) -> None:
    event = passing(SYSTEMS[case.system](np.random.default_rng(0), 1), 0.1)
    for dtype in ("float64",) if case.refused_in_float32() else ("float64", "float32"):
        plain, run = case.run(5, dtype=dtype), case.run(5, events=event, dtype=dtype)
        assert_same(plain, run)
        # Where few states are saved steps notice changes of sign, and only those of such members are looked at.
        noticed = case.run(5, every=None, events=event, dtype=dtype)
        assert_same_events(run, noticed)
        assert_same(run.select(-1), noticed.select(-1))


def test_adaptive_steps_are_those_of_a_run_without() -> None:
    rng = np.random.default_rng(5)
    for method, name, dtype in itertools.product(ABLE, ("pendulum, damped", "own: top"), ("float64", "float32")):
        if dtype == "float32" and sw.method(method).has_series:
            continue
        system = SYSTEMS[name](rng, 3)
        v, y = 0.3 * rng.normal(size=(*system.v_shape, 3)), rng.normal(size=(*system.y_shape, 3))
        start = float(y.ravel()[0])
        event = passing(system, lambda t, start=start: start + 0.01 * t - 1e-4)
        ask: dict[str, Any] = {"v": v, "y": y, "tolerance": 1e-4, "at": [0.0, 0.05, 0.2], "dtype": dtype}
        plain, run = (sw.integrate(system, method, **ask, **more) for more in ({}, {"events": event}))
        assert_same_run(run, plain)


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


SWEEPS: list[tuple[str, dict[str, Any]]] = [
    *(("fixed", options) for options in ({}, {"method": "verlet"}, {"dtype": "float32"})),
    *(("adaptive", options) for options in ({}, {"method": "taylor", "tolerance": 1e-4})),
]


@pytest.mark.parametrize(("steps", "options"), SWEEPS)
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


@pytest.mark.parametrize("method", ["rk4", "verlet", "leapfrog", "merson", "rosenbrock23"])
def test_what_the_core_finds_is_all_that_there_is(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It notices changes of sign in its steps, or looks at the states after them; without it all states are looked at here."""
    steps = "fixed" if sw.method(method).error_order is None else "adaptive"
    for every in (None, 50, 1) if steps == "fixed" else (None,):
        by_the_core = sweep(steps, method=method, every=every)
        with monkeypatch.context() as patch:
            patch.setattr(by_core, "sought", lambda search: None)
            every_state = sweep(steps, method=method, every=every)
        assert_same(every_state, by_the_core)
        assert_same_events(every_state, by_the_core)


def test_events_are_those_of_the_steps_without_saved_times() -> None:
    """A saved time beside a jump may shorten the next steps, as its extra step is rejected; events do not see that."""
    grown = sw.system(order=1)(lambda t, y, *, beta=1.0: y * (beta * np.cos(1.2 * t) - 0.1 * y))
    for events in (sw.Event(lambda t, y: y - 1.0), sw.Event(lambda t, y: y - 1.0, terminal=3)):
        ask: dict[str, Any] = {"y": 0.5, "tolerance": 1e-8, "jumps": [3.3, 7.1], "positive": True, "events": events}
        few, many, reference = (
            sw.integrate(grown(beta=np.linspace(0.8, 1.2, 11)), "dop853", **ask, at=at, backend=backend)
            for at, backend in (([15.0], "rust"), (np.linspace(0.5, 15.0, 40), "rust"), (np.linspace(0.5, 15.0, 40), "numpy"))
        )
        assert (many.paces.rejected > few.paces.rejected).any()
        assert_same_events(few, many)
        assert_same_events(many, reference)
        assert_same_run(many, reference)


@pytest.mark.mutant
def test_mistake_the_core_notices_another_quantity_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """So its part is not idle: of a quantity that never changes its sign it notices nothing."""
    run = sweep("fixed", every=None)
    right = driver.watched
    never = sw.Event(lambda t, v, y: y * y + 1.0)

    def wrong(quantities: Any, plan: Any) -> Any:
        return right([Quantity(never, plan.system, {}, by_core=True) for _ in quantities], plan)

    monkeypatch.setattr(driver, "watched", wrong)
    assert sweep("fixed", every=None).events["crossing"].count.sum() < run.events["crossing"].count.sum()


def test_a_system_whose_step_is_too_long_for_one_tape() -> None:
    """Of 600 masses: there the core does not look for anything, and all states are looked at here."""
    v, y = np.zeros((2, 600, 3))
    y[0] = 1.0, 1.1, 1.2
    ask: dict[str, Any] = {"v": v, "y": y, "dt": 0.1, "steps": 40, "events": sw.Event(lambda t, v, y: y[0] - 0.5, name="half")}
    assert assert_equal_ways(sw.Chain(600), "rk4", ways=("by the reference",), **ask).events["half"].count.all()


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
    refused(ArgumentError, "index: expected 2 whole", of_all.of, 1)
    refused(ArgumentError, "index: expected -2", of_all.of, (0, 2))


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


CUT = family(
    itertools.product(ABLE, (False, True)), lambda *pair: pair in {("merson", False), ("rodas4", True), ("taylor", False)}
)


@pytest.mark.parametrize(("method", "fused"), CUT)
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
    refused(UnsupportedError, "stopped at an event", sw.integrate, run.system, run.method, resume=run, **more)
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
        patch.setattr(engine, "adapt", lambda *arguments, **named: results.append(adapt(*arguments, **named)) or results[-1])
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
    world = sw.World(sw.Pendulum(3.0), "rk4", **start(()), dt=0.1, events=sw.Event(crossing, most=2))
    world.step(100)
    assert world.events["crossing"].count > len(world.events["crossing"].t) == 2  # so many of a call
    assert repr(zeros()).startswith("<")
    assert repr(sw.Event(crossing, terminal=True)) == "Event(crossing, terminal=True)"


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
    # A member that stopped before it would have diverged, among the same steps, did not diverge.
    stopping = sw.Event(lambda t, v, y: y - 1e200, terminal=True, name="far")
    run = sw.integrate(sw.Oscillator([300.0, 310.0]), "standard_euler", **ask, events=stopping)
    assert (run.first_bad_step < 0).all()
    assert (run.status == sw.Status.EVENT).all()


TWO = [crossing, THREE[1]]
FIELDS = ("member", "step", "t", "v", "y")


def together(pieces: list[dict[str, Occurrences]], name: str) -> list[Any]:
    """What several calls found of an event, by member and then by time."""
    order = np.argsort(np.concatenate([each[name].member for each in pieces]), kind="stable")
    return [np.concatenate([getattr(each[name], field) for each in pieces])[order] for field in FIELDS]


def frames(world: sw.World, *steps: int) -> list[dict[str, Occurrences]]:
    """What each of these calls of ``step`` found."""
    return [world.step(n) or world.events for n in steps]


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
    with pytest.warns(sw.DivergenceWarning, match="1 of 2 members diverged: member 0, before step 400"):
        world.step(400)
    assert not np.isfinite(world.y[0])
    name = next(iter(world.events))
    world.step(40)
    assert world.events[name].count[0] == 0
    assert world.events[name].count[1] > 0


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
        refused(error, message, sw.integrate, sw.Pendulum(), "merson", **{"v": 0.0, "y": 1.0} | steps, events=events)
    with pytest.raises(UnsupportedError, match="events: works with form='direct' only"):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=5, form="matrix", events=crossing)


def test_wrong_events_of_worlds() -> None:
    stops = r"events: no event stops a member of a world, got Event\(crossing, terminal=True\)"
    single = start(dtype="float32") | {"dtype": "float32"}
    for method, events, error, message, options in (
        ("rk4", [TWO[1], sw.Event(crossing, terminal=True)], UnsupportedError, stops, start()),
        ("taylor", crossing, UnsupportedError, "float32", single),
        ("rk4", [3.0], DTypeError, "events: expected functions", start()),
        ("rk4", lambda t, y: y, ArgumentError, r"expected a function \(t, v, y", start()),
    ):
        refused(error, message, sw.World, sw.Pendulum(), method, **options, dt=0.1, events=events)
    world = sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1, events=crossing)
    refused(ArgumentError, "n: expected", world.step, -1)
    assert sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1).events == {}


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
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
@pytest.mark.usefixtures("without_core")
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
@pytest.mark.usefixtures("without_core")
def test_mistake_what_came_before_the_piece_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    look = adaptive._Driver._look
    monkeypatch.setattr(adaptive._Driver, "_look", lambda self, *arguments: look(self, *arguments[:-1], False))
    with pytest.raises(AssertionError):
        check_pieces_of_adaptive_steps("merson", False)


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
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


# Events that change the state: closed forms, what comes to rest, refusals.
ball = sw.system(lambda t, v, y: -GRAVITY)

bumper = sw.system(lambda t, v, y, *, restitution=1.0: -GRAVITY)

free = sw.system(lambda t, v, y: 0.0 * y)


WALLS = [
    sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-v, 0.0 * y), name="left"),
    sw.Event(lambda t, v, y: y - 1.0, direction=1, then=lambda t, v, y: (-v, 0.0 * y + 1.0), name="right"),
]


def between_the_walls(t: Any) -> Any:
    """Of a point without forces that begins at 1/2, at speed 7: it meets the walls at 0 and 1 every 1/7, from either side."""
    way = np.abs((0.5 + 7.0 * t) % 2.0)
    return np.minimum(way, 2.0 - way)


def ground(restitution: float) -> sw.Event:
    return sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-restitution * v, y), name="ground")


#: The ground, of which each member has its own restitution.
GROUND = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y, *, restitution: (-restitution * v, y), name="ground")


def times_of_bounces(height: Any, restitution: float, n: int) -> Any:
    """The fall, and then twice its time by the restitution's power for each flight."""
    fall = np.sqrt(2.0 * height / GRAVITY)
    return np.stack([fall * (1.0 + 2.0 * sum(restitution**j for j in range(1, k + 1))) for k in range(n)], -1)


def bounces_are_right(method: str, height: float, restitution: float, share: float | None = None, backend: Any = "rust") -> None:
    """No method errs in a parabola. After each bounce the ball is at the height that the parabola of its flight has.

    Bound: y is off by the roundings of at most 1000 steps of numbers up to the height, and passes the ground after n bounces at
    the first speed times the restitution's power; a bounce is late by what the one before is late, and by the same again.

    Args:
        share: the length of a step, as a share of the time of the fall; None for adaptive steps.
    """
    n = 6
    expected = times_of_bounces(height, restitution, n)
    next_bounce = times_of_bounces(height, restitution, n + 1)[-1]
    end = expected[-1] + 0.4 * (next_bounce - expected[-1])
    if share is None:
        steps: dict[str, Any] = {"tolerance": 1e-9, "at": np.linspace(0.0, end, 57)}
    else:
        dt = share * np.sqrt(2.0 * height / GRAVITY)
        steps = {"dt": dt, "steps": int(np.ceil(end / dt)), "every": 1}
    run = sw.integrate(ball(), method, v=0.0, y=height, events=ground(restitution), backend=backend, **steps)
    assert run.status == sw.Status.OK
    assert np.isnan(run.stopped_at)
    speed = np.sqrt(2.0 * GRAVITY * height)
    bound = 2 * n * 1000 * U * height / (speed * restitution**n)
    np.testing.assert_allclose(run.events["ground"].t[:n], expected, rtol=0, atol=bound)
    last = np.searchsorted(expected, run.t, "right") - 1  # the bounce before each saved state
    begins, speeds = np.append(expected, 0.0)[last], np.append(speed * restitution ** np.arange(1, n + 1), 0.0)[last]
    heights, flight = np.append(np.zeros(n), height)[last], run.t - begins
    sure = (np.abs(run.t[:, np.newaxis] - expected).min(-1) > bound) & (run.t < next_bounce)
    right = heights + (speeds - 0.5 * GRAVITY * flight) * flight
    np.testing.assert_allclose(run.y[sure], right[sure], rtol=0, atol=2 * speed * bound)


BALLS = [(1.0, 0.8), (3.0, 0.95), (0.02, 0.7), (1.0, 1.0)]


def test_bounces_are_where_a_closed_form_says() -> None:
    for (height, restitution), share in itertools.product(BALLS, (0.02, 0.15, 0.9)):
        for backend in ("rust", "numpy") if share > 0.1 else ("rust",):
            bounces_are_right("rk4", height, restitution, share, backend)


@pytest.mark.parametrize("method", ABLE)
def test_bounces_of_adaptive_steps_are_where_a_closed_form_says(method: str) -> None:
    for height, restitution in BALLS[:2] if method in ("rodas4", "rodas5p", "taylor") else BALLS:
        bounces_are_right(method, height, restitution)


@pytest.mark.parametrize("balls", family([40, 1000], lambda balls: balls == 40))
def test_no_ball_ends_below_the_ground(balls: int) -> None:
    """Each of many heights comes to rest at fall·(1 + e)/(1 − e), the end of a geometric series, within ten seconds.

    Bound: y is at most by the roundings of a trial's step below the ground, which are those of the height.
    """
    y = np.linspace(0.5, 3.0, balls)
    with pytest.warns(sw.EventWarning, match=f"{balls} of {balls} members came to rest at event ground"):
        run = sw.integrate(ball(), "rk4", v=0.0, y=y, dt=0.1, steps=100, every=10, events=ground(0.8))
    assert (run.y > -8 * U * 3.0).all()
    assert (run.status == sw.Status.REST).all()
    np.testing.assert_allclose(run.stopped_at, np.sqrt(2.0 * y / GRAVITY) * 1.8 / 0.2, rtol=1e-9)
    assert (np.abs(run.v[-1]) < 1e-6).all()
    assert (np.abs(run.y[-1]) < 1e-12).all()


@pytest.mark.parametrize("method", family(ABLE, lambda method: method in ("merson", "dop853", "rodas5p")))
def test_balls_of_adaptive_steps_come_to_rest_where_their_series_ends(method: str) -> None:
    """At fall·(1 + e)/(1 − e), whatever other times are saved.

    Bounds: the limit is off by what SETTLED and the share of it that is left to a series, 2⁻²⁰, make of it, and by roundings of
    some tens of bounces; no ball is further below the ground than a trial's step errs.
    """
    y, e = np.linspace(0.5, 3.0, 16), np.linspace(0.4, 0.8, 16)
    ask: dict[str, Any] = {"v": 0.0, "y": y, "tolerance": 1e-9, "events": GROUND}
    with pytest.warns(sw.EventWarning, match="16 of 16 members"):
        run, often = (
            sw.integrate(bumper(restitution=e), method, at=at, **ask) for at in ([2.0, 10.0], np.linspace(0.0, 10.0, 41))
        )
    assert (run.status == sw.Status.REST).all()
    np.testing.assert_allclose(run.stopped_at, np.sqrt(2.0 * y / GRAVITY) * (1.0 + e) / (1.0 - e), rtol=1e-11)
    assert (np.abs(run.v[-1]) < 1e-10).all()
    np.testing.assert_array_equal(often.y[[8, 40]], run.y)
    np.testing.assert_array_equal(often.events["ground"].t, run.events["ground"].t)
    assert (often.y > -8 * U * 3.0).all()


@pytest.mark.parametrize("dt", [0.01, 0.3, -0.05])
def test_two_walls_and_several_bounces_within_a_step(dt: float) -> None:
    """Positions are off by the roundings of as many numbers up to 7·0.3 as there are steps and bounces."""
    steps = int(3.0 / abs(dt))
    run = sw.integrate(free(), "rk4", v=7.0, y=0.5, dt=dt, steps=steps, every=1, events=WALLS)
    np.testing.assert_allclose(run.y, between_the_walls(run.t), rtol=0, atol=10 * (steps + 21) * U * 21.0)
    assert run.events["left"].count + run.events["right"].count == np.floor(0.5 + 7.0 * abs(dt) * steps)


def test_backward_between_two_walls_over_jumps() -> None:
    """The same with adaptive steps, backward in time, with times that no step crosses."""
    ask: dict[str, Any] = {"v": 7.0, "y": 0.5, "tolerance": 1e-9, "jumps": [-0.3, -1.0, -2.5], "max_step": 0.9}
    run = sw.integrate(free(), "dop853", at=-np.linspace(0.0, 3.0, 31), events=WALLS, **ask)
    np.testing.assert_allclose(run.y, between_the_walls(run.t), rtol=0, atol=200 * U * 21.0)
    both = np.sort(np.concatenate([run.events[name].t for name in ("left", "right")]))[::-1]
    np.testing.assert_allclose(both, -(0.5 + np.arange(21)) / 7.0, rtol=0, atol=200 * U * 3.0)


@pytest.mark.parametrize("method", ABLE)
def test_a_neuron_fires_when_a_closed_form_says(method: str) -> None:
    """ẏ = I − y from 0 to 1 takes ln(I/(I − 1)), and begins at 0 again; what it fired for is added up beside it. Bound: a step
    errs by 1e-9 of 1, where ẏ is I − 1 or more; each of some 20 steps to a spike, and every spike is late by those before it.
    """

    neuron = sw.system(order=1)(lambda t, y, *, current=2.0: np.array([current - y[0], 0.0 * y[1]]))
    fires = sw.Event(lambda t, y: y[0] - 1.0, direction=1, then=lambda t, y: np.array([0.0, y[1] + 1.0]), name="fires")
    current, end = np.array([1.5, 2.0, 4.0]), 10.0
    run = sw.integrate(neuron(current=current), method, y=np.zeros((2, 3)), tolerance=1e-9, at=[end], events=fires)
    period = np.log(current / (current - 1.0))
    spikes = np.floor(end / period)
    np.testing.assert_array_equal(run.events["fires"].count, spikes)
    np.testing.assert_array_equal(run.y[-1][1], spikes)
    bound = 40 * 1e-9 / (current - 1.0) * spikes
    if sw.method(method).order == 2:  # whose estimate is of the third order: h³ follows the tolerance, and the error h²
        bound *= 10
    for i in range(3):
        times = run.events["fires"].of(i).t
        np.testing.assert_allclose(times, period[i] * np.arange(1, len(times) + 1), rtol=0, atol=bound[i])
    potential = current * (1.0 - np.exp(-(end - spikes * period)))
    assert (np.abs(run.y[-1][0] - potential) <= current * bound).all()  # late by the bound, at a rate of up to I


@pytest.mark.parametrize("method", ["rk4", "verlet", "false_euler", "merson", "taylor"])
def test_bounces_are_the_same_in_all_ways(method: str) -> None:
    """By false Euler a ball that bounces twice within a step has no speed at the second: y is then h times the speed there."""
    ways = ("by the reference", "alone", "in company", "in pieces", "saved more often")
    paced: dict[str, Any] = {"tolerance": 1e-6, "at": [0.5, 1.0, 1.2]}
    steps = paced if method in ABLE else {"dt": 0.013, "steps": 90, "every": 9}
    ask = {"v": np.zeros(12), "y": np.linspace(0.3, 2.0, 12), "events": GROUND} | steps
    run = assert_equal_ways(bumper(restitution=np.linspace(0.7, 1.1, 12)), method, ways=ways, **ask)
    assert (run.events["ground"].count > 0).all()


@pytest.mark.parametrize("jumps", [[0.2, 0.4, 0.6], [0.2, 0.3, 0.4, 0.5, 0.6]])
def test_members_that_an_event_changes_have_common_jumps(jumps: list[float]) -> None:
    """Those that begin anew have a start each, beside the jumps of all, three or five: it ended in NumPy's ValueError."""
    ask: dict[str, Any] = {"v": np.zeros(5), "y": np.linspace(0.2, 1.0, 5), "tolerance": 1e-6, "at": [0.5, 1.0]}
    run = assert_equal_ways(ball(), "merson", ways=("by the reference", "alone"), jumps=jumps, events=ground(0.9), **ask)
    assert (run.events["ground"].count > 0).all()


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_an_event_at_the_end_of_a_step_leaves_nothing_of_it(backend: str) -> None:
    """Verlet divided by what was left of the step: v was NaN. Its motion is leapfrog's, to some roundings in each of 16 steps."""
    kick = sw.Event(lambda t, v, y: t - 1.0, then=lambda t, v, y: (v + 0.1, y), name="kick")
    ask: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": 0.125, "steps": 16, "every": 1, "events": kick, "backend": backend}
    verlet, leapfrog = (sw.integrate(sw.Pendulum(), method, **ask) for method in ("verlet", "leapfrog"))
    np.testing.assert_allclose(verlet.y, leapfrog.y, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(verlet.v, leapfrog.v, rtol=0.0, atol=1e-12)  # a difference of y by dt


@pytest.mark.parametrize(
    "method", family(["rk4", "leapfrog", "verlet", "false_euler", "standard_heun"], "rk4 verlet".__contains__)
)
def test_frames_have_the_states_of_a_run(method: str) -> None:
    """Of every member that does not rest, in every frame, to the bit: also of those whose neighbours bounce in it."""
    frames_are_those_of_a_run(method, 1)
    frames_are_those_of_a_run(method, 5)


def frames_are_those_of_a_run(method: str, n: int) -> None:
    v, y = np.zeros(20), np.linspace(0.5, 3.0, 20)
    run = sw.integrate(ball(), method, v=v, y=y, dt=1 / 60, steps=100, every=n, events=ground(0.8))
    world = sw.World(ball(), method, v=v, y=y, dt=1 / 60, events=ground(0.8))
    heard = np.zeros(20, dtype=int)
    for k in range(1, 100 // n + 1):
        world.step(n)
        np.testing.assert_array_equal(world.y, run.y[k])
        np.testing.assert_array_equal(world.v, run.v[k])
        heard += world.events["ground"].count
    np.testing.assert_array_equal(heard, run.events["ground"].count)


@pytest.mark.parametrize(
    ("method", "steps"), [("rk4", {"dt": 0.01, "steps": 100}), ("dop853", {"tolerance": 1e-9, "at": [0.5, 1.0]})]
)
def test_a_ball_that_is_thrown_from_the_ground_leaves_it(method: str, steps: dict[str, Any]) -> None:
    """It flies for 2v/g and bounces. Bound: the roundings of some 100 steps. At rest it stays: ``test_events_followed.py``."""
    flies = sw.integrate(ball(), method, v=3.0, y=0.0, events=ground(0.8), **steps)
    np.testing.assert_allclose(flies.events["ground"].t[0], 2.0 * 3.0 / GRAVITY, rtol=0, atol=62 * U)


def test_copies_of_a_world_have_the_same_events() -> None:
    """Such as are only counted, and bounces."""
    for system, events in ((sw.Pendulum(), TWO), (ball(), ground(0.8))):
        world = sw.World(system, "verlet", **start(), dt=0.1, events=events)
        world.step(7)
        others = [copy.copy(world), copy.deepcopy(world)]
        world.step(30)
        assert any(each.count.any() for each in world.events.values())
        for other in others:
            other.step(30)
            assert other.events == world.events
            np.testing.assert_array_equal(other.y, world.y)


def test_backward_in_time_a_bounce_of_a_world_is_undone() -> None:
    """A ball that bounces without loss comes back to where it fell from."""
    v, y = np.zeros(2), np.array([1.0, 2.0])
    for dt, t0 in ((0.01, 0.0), (-0.01, 1.5)):
        sw.World(ball(), "rk4", v=v, y=y, dt=dt, t0=t0, events=ground(1.0)).step(150)
    np.testing.assert_allclose(y, [1.0, 2.0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(v, 0.0, rtol=0, atol=1e-10)


def test_a_terminal_event_ends_a_run_that_others_change() -> None:
    """The third top of a ball ends it; bounces before are counted, and a member of another batch index goes on."""
    top = sw.Event(lambda t, v, y: v, direction=-1, terminal=3, name="top")
    run = sw.integrate(ball(), "merson", v=0.0, y=[1.0, 3.0], tolerance=1e-9, at=[2.5], events=[ground(0.8), top])
    times = times_of_bounces(np.array([1.0, 3.0]), 0.8, 4)
    ends = 0.5 * (times[0, 2] + times[0, 3])
    np.testing.assert_allclose(run.stopped_at, [ends, np.nan], rtol=1e-13)
    np.testing.assert_array_equal(run.status, [sw.Status.EVENT, sw.Status.OK])
    assert list(run.events["ground"].count) == [3, 2]
    assert list(run.events["top"].count) == [3, 1]


def test_what_other_members_do_does_not_matter_where_a_budget_ends() -> None:
    """Attempts of all parts are counted together: a member that bounces runs out of them, and says so."""
    with pytest.warns(sw.ToleranceWarning, match="1 of 2 members stopped before t = 3: member 0 .*out of max_steps"):
        run = sw.integrate(ball(), "merson", v=0.0, y=[1.0, 100.0], tolerance=1e-9, at=[3.0], events=ground(0.9), max_steps=40)
    np.testing.assert_array_equal(run.status, [sw.Status.BUDGET, sw.Status.OK])
    assert run.paces.accepted[0] + run.paces.rejected[0] == 40


# Changes that lead back onto their event: what they hold comes to rest, and what only passes them goes on.
tank = sw.system(order=1)(lambda t, h, *, rate=-0.7: rate)

CHOSEN = {"tolerance": 1e-8, "at": [1.0, 4.0]}
DRIVES: list[tuple[str, dict[str, Any]]] = [
    ("rk4", {"dt": 0.01, "steps": 400}),
    ("standard_euler", {"dt": 0.013, "steps": 400}),
    *((method, CHOSEN) for method in ("merson", "dop853", "taylor")),
]


def lowest(level: float, then: Any, direction: int = -1) -> sw.Event:
    return sw.Event(lambda t, h: h - level, direction=direction, then=then, name="empty")


@pytest.mark.parametrize(("method", "steps"), DRIVES)
def test_an_empty_tank(method: str, steps: dict[str, Any]) -> None:
    """It is empty at (h − level)/0.7, that which begins empty at once, and stays so; before it went on below."""
    fillings = [(0.0, lambda t, h: np.maximum(h, 0.0)), (0.3, lambda t, h: np.maximum(h, 0.3))]
    fillings += [(0.0, lambda t, h: 0.0 * h), (0.0, abs_of)]
    for (level, then), direction in itertools.product(fillings, (-1, 0)):
        start = np.array([1.0, 0.5, level])
        ask = {"y": start, "events": lowest(level, then, direction), **steps}
        for backend in ("rust", "numpy") if then is abs_of else ("rust",):
            with pytest.warns(sw.EventWarning, match="3 of 3 members .* event empty; the first was member 2 at t = 0: its"):
                run = sw.integrate(tank(), method, backend=backend, **ask)
            assert (run.status == sw.Status.REST).all()
            # Rates are constant: states and times are right to the roundings of at most 400 sums of numbers up to 3, 3·2⁻⁵³ each.
            bound = 400 * 3 * U
            np.testing.assert_allclose(run.stopped_at, (start - level) / 0.7, atol=2 * bound, rtol=0)
            np.testing.assert_allclose(run.y[-1], level, atol=bound, rtol=0)
            assert run.events["empty"].count.tolist() == [1, 1, 0]


def abs_of(t: Any, h: Any) -> Any:
    return abs(h)


@pytest.mark.parametrize("steps", [{"dt": -0.01, "steps": 400}, {"tolerance": 1e-8, "at": [-4.0]}])
def test_a_tank_back_in_time(steps: dict[str, Any]) -> None:
    full = sw.Event(lambda t, h: h - 1.4, direction=1, then=lambda t, h: np.minimum(h, 1.4), name="full")
    with pytest.warns(sw.EventWarning, match=r"came to rest at event full, at t = -2: its change of the state leads back"):
        run = sw.integrate(tank(), "merson", y=0.0, events=full, **steps)
    assert run.y[-1] == 1.4


PASSING: list[tuple[Any, sw.Event, dict[str, Any]]] = [
    # A dose of zero at a time, and a kick of zero where a member passes: the state stays as it is, but nothing leads back.
    (sw.system(order=1)(lambda t, c, *, dose=0.0: -0.3 * c),
     sw.Event(lambda t, c: np.sin(t), then=lambda t, c, *, dose: c + dose, name="event"), {"y": 1.0}),
    (sw.system(lambda t, v, y, *, kick=0.0: -y),
     sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y, *, kick: (v - kick, y), name="event"), {"v": 0.0, "y": 1.0}),
    # A clock whose amplitude is set anew where it turns, and a heater that is too weak: the state is another one there.
    (sw.system(lambda t, v, y: -9.0 * y - 0.1 * v),
     sw.Event(lambda t, v, y: v, direction=-1, then=lambda t, v, y: (0.0 * v, 1.0 + 0.0 * y), name="event"),
     {"v": 1.0, "y": 0.0}),
    (sw.system(order=1, shape=(2,))(lambda t, y: np.array([10.0 - y[0] + y[1], 0.0])),
     sw.Event(lambda t, y: y[0] - 20.0, direction=-1, then=lambda t, y: np.array([20.0, 1.0]), name="event"),
     {"y": np.array([25.0, 0.0])}),
]  # fmt: skip


@pytest.mark.parametrize(("method", "steps"), DRIVES)
def test_what_is_held_and_what_passes(method: str, steps: dict[str, Any]) -> None:
    """Who sets the place of a ball alone, and keeps its speed, holds it there."""
    hold = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (v, np.maximum(y, 0.0)), name="ground")
    with pytest.warns(sw.EventWarning, match="came to rest at event ground"):
        run = sw.integrate(ball(), method, v=-1.0, y=1.0, events=hold, **steps)
    assert run.y[-1] == 0.0
    for system, event, start in PASSING:
        run = sw.integrate(system(), method, events=event, **start, **steps)
        assert run.status == sw.Status.OK, start
        assert run.events["event"].count >= 1, start


@pytest.mark.parametrize("steps", [{"dt": 0.01, "steps": 800}, {"tolerance": 1e-8, "at": [8.0]}])
def test_a_tank_that_is_filled_when_it_is_empty(steps: dict[str, Any]) -> None:
    """Of two events at one time the state that both leave counts: it is at none of them, and empty again a unit of time later."""
    filled = sw.Event(lambda t, h: t - 6.0, then=lambda t, h: h + 1.0, name="filled")
    events = [lowest(0.0, lambda t, h: np.maximum(h, 0.0)), filled]
    for each in (events, events[::-1]):
        with pytest.warns(sw.EventWarning, match="came to rest at event empty, at t = 7: its change"):
            run = sw.integrate(tank(rate=-1.0), "merson", y=6.0, events=each, **steps)
        assert run.y[-1] == 0.0


def test_what_does_not_go_is_refused_in_words() -> None:
    for options, message in (
        ({"then": 3}, r"then: expected a Python function such as then\(t, v, y\), got 3"),
        ({"terminal": True, "then": lambda t, v, y: (v, y)}, "then, terminal: a member that stops"),
    ):
        with pytest.raises(sw.errors.ArgumentError, match=message):
            sw.Event(lambda t, v, y: y, **options)  # type: ignore[arg-type]
    event = sw.Event(lambda t, v, y: y, then=lambda t, y: y, name="g")
    with pytest.raises(sw.errors.ArgumentError, match=r"events: g: then: expected a function \(t, v, y, \*, …\)"):
        sw.integrate(ball(), "rk4", v=0.0, y=1.0, dt=0.1, steps=3, events=event)


@pytest.mark.mutant
def test_mistake_an_event_that_leaves_the_state_as_it_is_is_noticed() -> None:
    """So the closed forms above see the change of the state."""
    run = sw.integrate(ball(), "rk4", v=0.0, y=1.0, dt=0.01, steps=100, events=sw.Event(lambda t, v, y: y, name="ground"))
    assert run.y[-1] < -1.0


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
def test_mistake_a_member_that_forgets_from_which_side_it_came_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then a ball at the ground, whose height is a rounding below it, falls through, or bounces again at once."""
    right = adaptive._Resetting.parts

    def forgetful(self: Any, e: int, steps: Any) -> Any:
        self._resets.at[:] = 0.0
        return right(self, e, steps)

    monkeypatch.setattr(adaptive._Resetting, "parts", forgetful)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = sw.integrate(ball(), "merson", v=0.0, y=np.linspace(0.5, 3.0, 100), tolerance=1e-9, at=[10.0], events=ground(0.8))
    assert (run.y[-1] < -1.0).any()


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
def test_mistake_neighbours_that_begin_anew_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without their carry members of a leapfrog world would have other bits where another bounces."""

    def forgetful(self: Any, step: int, index: Any, v: Any, y: Any) -> None:
        for block, new in zip(self._blocks, (v, y), strict=True):
            block[..., index] = new

    monkeypatch.setattr(Frames, "_write", forgetful)
    with pytest.raises(AssertionError):
        frames_are_those_of_a_run("leapfrog", 1)
