"""Events with adaptive steps: steps are those of runs without; what is found depends neither on backend, batch, pieces nor saves.

Where it is, and mistakes that these tests must notice, are in test_events_adaptive_located.py.
"""

from __future__ import annotations

import copy
import itertools
import pickle
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs import engine
from stepwell.runs.events import adaptive
from support.cases import ADAPTIVE, SYSTEMS, assert_same, fits
from support.events import assert_same_events, crossing, first
from support.events_adaptive import (
    ABLE,
    THREE,
    check_a_member_that_stopped_stays_where_it_was_and_cannot_go_on,
    check_a_trial_is_the_state_that_is_saved_within_a_step,
    check_pieces_find_what_the_whole_finds_and_saved_times_do_not_matter,
    check_the_ends_of_a_run,
    check_what_comes_after_a_terminal_event_is_not_computed,
    growing,
    sweep,
)
from support.families import family


def same(a: sw.Run, b: sw.Run) -> None:
    """The same states and steps, to the last bit."""
    assert_same(a, b)
    assert a.paces == b.paces
    np.testing.assert_array_equal(a.status, b.status)


def goes(system: sw.System, method: sw.Method) -> bool:
    """Whether a method takes adaptive steps of a system."""
    series = method.has_series and (system.chooses or system.contacts or np.isfinite(system.samples[0]))
    return fits(system, method) and not series


@pytest.mark.parametrize(
    ("name", "method"),
    family(itertools.product(ADAPTIVE, ABLE), lambda name, method: ABLE.index(method) == ADAPTIVE.index(name) % len(ABLE)),
)
@pytest.mark.filterwarnings("ignore::stepwell.ToleranceWarning")
def test_steps_are_those_of_a_run_without_and_both_backends_agree(name: str, method: str) -> None:
    rng, record = np.random.default_rng(5), sw.method(method)
    system = SYSTEMS[name](rng, 3).uncontrolled
    if not goes(system, record):
        return
    v, y = 0.3 * rng.normal(size=(*system.v_shape, 3)), rng.normal(size=(*system.y_shape, 3))
    if record.has_series and system.constraint == "length":
        v = 0.0 * v
    start = float((y if y.size else v).ravel()[0])
    if system.v_shape == (0,):
        event = sw.Event(lambda t, y: first(y) - start - 0.01 * t + 1e-4, name="passage")
    else:
        event = sw.Event(lambda t, v, y: first(v, y) - start - 0.01 * t + 1e-4, name="passage")
    ask: dict[str, Any] = {
        "v": v,
        "y": y,
        "tolerance": 1e-4,
        "at": [0.0, 0.05, 0.2],
        "max_steps": 10 if record.has_series else 20,
    }
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
    check_a_trial_is_the_state_that_is_saved_within_a_step(method, name)


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
    omega, arguments = np.linspace(0.5, 2.0, 600), {"v": 0.1, "y": 1.0, "tolerance": 1e-5, "at": [12.0]}
    one, two = (sw.integrate(sw.Pendulum(omega), "merson", **arguments, events=THREE, threads=threads) for threads in (1, 2))
    same(one, two)
    assert_same_events(one, two)
    for i in (0, 63, 299, 300, 599):
        alone = sw.integrate(sw.Pendulum(omega[i]), "merson", **arguments, events=THREE)
        for name, mine in alone.events.items():
            np.testing.assert_array_equal(mine.t, one.events[name].of(i).t)
            np.testing.assert_array_equal(mine.y, one.events[name].of(i).y)


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize("method", ABLE)
def test_pieces_find_what_the_whole_finds_and_saved_times_do_not_matter(method: str, fused: bool) -> None:
    check_pieces_find_what_the_whole_finds_and_saved_times_do_not_matter(method, fused)


def test_a_run_that_was_out_of_attempts_goes_on() -> None:
    whole = sweep(slice(0, 5), events=crossing, at=[12.0])
    assert whole.paces is not None
    with pytest.warns(sw.ToleranceWarning):
        head = sweep(slice(0, 5), events=crossing, at=[12.0], max_steps=int(whole.paces.accepted.max()) // 2)
    tail = sw.integrate(head.system, "merson", resume=head, at=[12.0], events=crossing)
    np.testing.assert_array_equal(tail.y[-1], whole.y[-1])
    counts = [each.events["crossing"].count for each in (head, tail, whole)]
    assert counts[0].any()
    assert counts[1].any()
    np.testing.assert_array_equal(counts[0] + counts[1], counts[2])


def test_a_member_that_stopped_stays_where_it_was_and_cannot_go_on() -> None:
    check_a_member_that_stopped_stays_where_it_was_and_cannot_go_on()


@pytest.mark.parametrize("method", ABLE)
@pytest.mark.filterwarnings("error")
def test_what_comes_after_a_terminal_event_is_not_computed(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    check_what_comes_after_a_terminal_event_is_not_computed(method, monkeypatch)


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
    def zeros(**options: Any) -> Any:
        event = sw.Event(lambda t, v, y: y, name="zero", **options)
        return sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=1e-9, at=[20.0], events=event).events["zero"]

    assert (zeros(direction=-1).v < 0).all()
    assert (zeros(direction=1).v > 0).all()
    np.testing.assert_array_equal(np.sort(np.concatenate([zeros(direction=-1).t, zeros(direction=1).t])), zeros().t)
    assert len(zeros().t) == 6  # zeros of the cosine up to t = 20
    assert zeros(most=2).count == 6
    np.testing.assert_array_equal(zeros(most=2).t, zeros().t[:2])


def test_the_ends_of_a_run() -> None:
    check_the_ends_of_a_run()


def test_batch_axes_and_a_tolerance_for_each() -> None:
    omega, tolerance = np.linspace(0.5, 2.0, 6).reshape(3, 2), np.array([1e-5, 1e-8])
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "at": [3.0, 9.0], "events": THREE[:1]}
    run = sw.integrate(sw.Pendulum(omega), "fehlberg_5", tolerance=tolerance, **ask)
    assert run.events["crossing"].count.shape == (3, 2)
    for i, j in np.ndindex(3, 2):
        alone = sw.integrate(sw.Pendulum(omega[i, j]), "fehlberg_5", tolerance=tolerance[j], **ask)
        np.testing.assert_array_equal(alone.events["crossing"].t, run.events["crossing"].of((i, j)).t)


def test_progress_and_values(tmp_path: Path) -> None:
    shares: list[float] = []
    plan = engine.Plan(sw.Pendulum(), sw.method("merson"), (), 1.0, progress=shares.append)
    run = adaptive.AdaptiveRun([sw.Event(crossing)])
    paces = engine.paces(plan, None, engine.Tolerances(np.array(1e-9), None))
    run.adapt(plan, engine.Pacing(np.array([100.0]), 10**6, True), paces, np.array(0.0), np.array(1.0))
    assert shares == sorted(shares)
    assert len(shares) > 3
    assert shares[-1] == 1.0
    swept = sweep()
    assert pickle.loads(pickle.dumps(swept.events)) == swept.events == copy.deepcopy(swept.events)
    swept.save(tmp_path / "run.npz")
    back = sw.load(tmp_path / "run.npz")
    assert back == swept
    assert_same_events(back, swept)


def test_what_does_not_go() -> None:
    many, system = sw.Event(crossing, most=10**6), sw.Pendulum(np.ones(10**6))
    with pytest.raises(sw.errors.TooLargeError, match="the events of 1000000 members need"):
        sw.integrate(system, "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0], events=many)
    with pytest.raises(sw.errors.ArgumentError, match=r"expected a function \(t, v, y"):
        sw.integrate(sw.Pendulum(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0], events=lambda t, y: y)
    with pytest.raises(sw.errors.ArgumentError, match="events: expected a list of events"):
        sw.integrate(sw.Pendulum(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0], events=3.0)


def test_no_warning_is_hidden_by_these_tests() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sweep()


@pytest.mark.parametrize("omega", [1.0, 1e13, 1e40, 1e-20])
@pytest.mark.parametrize("method", [method.name for method in sw.methods() if method.error_order is not None])
def test_events_are_located_in_any_unit_of_time(method: str, omega: float) -> None:
    """cos ωt passes zero at odd quarters of its period."""
    zero = sw.Event(lambda t, v, y: y, name="zero")
    run = sw.integrate(sw.Oscillator(omega), method, v=0.0, y=1.0, tolerance=1e-10, at=[10.0 / omega], events=zero)
    # Of a method of order 2 whose estimate is of the third order, h³ follows the tolerance, and the error h².
    within = 1e-6 if sw.method(method).order == 2 else 1e-8
    np.testing.assert_allclose(run.events["zero"].t * omega / np.pi, [0.5, 1.5, 2.5], rtol=within)
