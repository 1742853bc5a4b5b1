"""What tests of events adaptive share."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs import engine
from stepwell.runs.events import attempts
from stepwell.runs.events.members import Members
from stepwell.runs.events.trials import AdaptiveTrials

from support.cases import SYSTEMS
from support.events import assert_same_events, crossing

ABLE = [m.name for m in sw.methods() if m.error_order is not None]


U = 2.0**-53


def check_a_trial_is_the_state_that_is_saved_within_a_step(method: str, name: str) -> None:
    """At any time within a step, and at its end."""
    rng, record = np.random.default_rng(1), sw.method(method)
    system = SYSTEMS[name](rng, 4)
    v, y = 0.3 * rng.normal(size=(*system.v_shape, 4)), rng.normal(size=(*system.y_shape, 4))
    plan = engine.Plan(system, record, (4,), 1.0, order=10 if record.has_series else 0)
    paces = engine.paces(plan, None, engine.Tolerances(np.array(1e-6), None))
    out = attempts.attempted(plan, np.inf, 12, 1000, True, paces, v, y)
    trials, who = AdaptiveTrials(plan, Members(plan)), np.arange(4)
    h = out.lengths(plan)[10]
    for block, end in zip(trials.step(who, out.t[10], h, out.v[10], out.y[10]), (out.v[11], out.y[11]), strict=True):
        np.testing.assert_array_equal(block, end)
    for share in (0.1, 0.7):
        at = out.t[10] + share * h
        trial = trials.step(who, out.t[10], at - out.t[10], out.v[10], out.y[10])
        for i in who:
            saved = engine.adapt(plan, engine.Pacing(at[i : i + 1], 1000, True), paces, v, y)
            for block, states in zip(trial, (saved.v, saved.y), strict=True):
                np.testing.assert_array_equal(block[..., i], states[0][..., i])


#: As of test_events: the first comes often, of the second three are kept, the third stops about half of the members.
THREE = [
    crossing,
    sw.Event(lambda t, v, y, omega: v - 0.2 * omega, direction=1, most=3, name="speed"),
    sw.Event(lambda t, v, y, omega: omega * t + 3.0 * y - 38.0, direction=1, terminal=True, name="end"),
]


def sweep(members: Any = slice(None), method: str = "merson", **options: Any) -> sw.Run:
    arguments = {
        "v": np.linspace(-0.5, 0.5, 40)[members],
        "y": 1.0,
        "tolerance": 1e-6,
        "at": np.linspace(0.0, 30.0, 20),
    } | options
    return sw.integrate(sw.Pendulum(np.linspace(0.5, 2.0, 40)[members]), method, **({"events": THREE} | arguments))


def check_pieces_find_what_the_whole_finds_and_saved_times_do_not_matter(method: str, fused: bool) -> None:
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
        run = sw.integrate(run.system, method, resume=run, at=[end], events=ask["events"])
        pieces.append(run)
    np.testing.assert_array_equal(run.y[-1], whole.y[-1])
    for name, theirs in whole.events.items():
        for i in range(5):
            for what in ("t", "v", "y", "step"):
                mine = np.concatenate([getattr(piece.events[name].of(i), what) for piece in pieces])
                np.testing.assert_array_equal(mine, getattr(theirs.of(i), what))
        np.testing.assert_array_equal(sum(piece.events[name].count for piece in pieces), theirs.count)


def check_a_member_that_stopped_stays_where_it_was_and_cannot_go_on() -> None:
    run, free = sweep(), sweep(events=THREE[:2])
    ends = run.events["end"]
    assert run.stopped_at is not None
    assert run.paces is not None
    for i in range(40):
        end = ends.of(i)
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
            times = free.events[other].of(i).t
            np.testing.assert_array_equal(run.events[other].of(i).t, times[times <= end.t[0]])
    with pytest.raises(sw.errors.UnsupportedError, match="stopped at an event"):
        sw.integrate(run.system, run.method, resume=run, at=[99.0])
    assert "stopped at an event" in repr(run)


@sw.system(order=1)
def growing(t: Any, y: Any, *, rate: float = 1.0) -> Any:
    return rate * y * y


def check_what_comes_after_a_terminal_event_is_not_computed(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """ẏ = y² from 1 is 1/(1 − t): infinite at 1, where steps become too short; without a word if it stops at y = 10, t = 0.9."""
    results: list[Any] = []
    adapt = engine.adapt

    def noted(*arguments: Any) -> Any:
        results.append(adapt(*arguments))
        return results[-1]

    monkeypatch.setattr(engine, "adapt", noted)
    ten = sw.Event(lambda t, y: y - 10.0, terminal=True, name="ten")
    run = sw.integrate(growing(), method, y=1.0, tolerance=1e-8, at=[0.5, 2.0], events=ten)
    # The relative error of y is within some 100 tolerances, and y passes 10 at a speed of 100: δt = 0.1·δy/y.
    assert run.stopped_at is not None
    assert abs(run.stopped_at - 0.9) < (1e-5 if sw.method(method).order == 2 else 1e-7)
    assert abs(run.y[-1] - 10.0) < 1e-9
    assert run.first_bad_step == -1
    assert len(results) == 1
    assert run.paces is not None
    assert results[0].paces[engine.COUNTS.start] == run.paces.accepted
    # A run to that time alone has one more state to save, and does not take its last step.
    near = sw.integrate(growing(), method, y=1.0, tolerance=1e-8, at=[0.5, float(run.stopped_at)])
    assert near.paces is not None
    assert run.paces.accepted - 1 == near.paces.accepted
    assert run.paces.rejected == near.paces.rejected
    assert run.paces.evaluations <= near.paces.evaluations


@sw.system(order=1)
def ascending(t: Any, y: Any) -> Any:
    return 1.0 + 0.0 * y


def check_the_ends_of_a_run() -> None:
    """An event at the start does not count, one just before the end does, and one just after it does not.

    The last step is no longer than five times the way so far; a place is past its event by 2⁻⁴⁸ of that at most.
    """
    places = {"start": 0.0, "before": 2.0 - 2.0**-43, "after": 2.0 + 2.0**-43}
    events = [sw.Event(lambda t, y, at=at: t - at, name=name) for name, at in places.items()]
    run = sw.integrate(ascending(), "merson", y=0.0, tolerance=1e-6, at=[1.0, 2.0], events=events)
    assert [each.count.item() for each in run.events.values()] == [0, 1, 0]
    assert 0.0 <= run.events["before"].t[0] - places["before"] <= 10.0 * 2.0**-48
