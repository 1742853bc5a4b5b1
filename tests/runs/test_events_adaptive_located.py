"""Where events are with adaptive steps: against closed forms, with the tolerance; and mistakes that tests must notice."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
import stepwell as sw
from stepwell.runs.events import adaptive, attempts, collected
from stepwell.runs.events.trials import AdaptiveTrials
from support import events_adaptive as bits
from support.events_adaptive import ABLE, U
from support.events_located import error_of_bounces, low_end, straight

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
    # Of a method of order 2 with an estimate of the third order, h³ follows the tolerance, and the error h².
    assert (0.6 if sw.method(method).order == 2 else 0.7) < slope(method) < 1.3
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
    """The error falls by four decades or more over six of the tolerance, and ends within a thousand tolerances; by a method of
    order 2, whose error is that of h² while h³ follows the tolerance, by less than four and within ten thousand.
    """
    coarse, fine = pericentre(method, 1e-4), pericentre(method, 1e-10)
    falls, ends = (1e-3, 1e-6) if sw.method(method).order == 2 else (1e-4, 1e-7)
    assert fine < falls * coarse
    assert fine < ends


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
    """All methods here are exact for a parabola; each flight adds some roundings of numbers up to 4 in each of some 30 steps."""
    assert error_of_bounces(method, tolerance=1e-9, at=[10.0]) < 6 * 30 * 4 * 4 * U


# ---- mistakes


@pytest.mark.mutant
def test_mistake_a_straight_line_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collected, "located", straight)
    with pytest.raises(AssertionError):
        test_the_error_of_the_time_follows_the_tolerance_and_is_that_of_the_motion("dop853")


@pytest.mark.mutant
def test_mistake_the_end_before_the_event_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collected, "located", low_end)
    with pytest.raises(AssertionError):
        test_bounces("merson")


@pytest.mark.mutant
def test_mistake_trials_at_another_time_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    step = AdaptiveTrials.step
    monkeypatch.setattr(AdaptiveTrials, "step", lambda self, index, t, h, v, y: step(self, index, 0.0 * t, h, v, y))
    with pytest.raises(AssertionError):
        test_a_driven_motion_passes_in_time("merson")


@pytest.mark.mutant
@pytest.mark.parametrize("method", ["merson", "taylor"])
def test_mistake_the_length_of_another_step_is_noticed(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The step to try next is not the one that was made; of a series the one before is not."""
    series = sw.method(method).has_series
    monkeypatch.setattr(attempts.Attempts, "lengths", lambda self, plan: self.h[:-1] if series else self.h[1:])
    with pytest.raises(AssertionError):
        bits.check_a_trial_is_the_state_that_is_saved_within_a_step(method, "pendulum")


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
        bits.check_the_ends_of_a_run()


@pytest.mark.mutant
def test_mistake_what_came_before_the_piece_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    look = adaptive._Driver._look
    monkeypatch.setattr(adaptive._Driver, "_look", lambda self, *arguments: look(self, *arguments[:-1], False))
    with pytest.raises(AssertionError):
        bits.check_pieces_find_what_the_whole_finds_and_saved_times_do_not_matter("merson", False)


@pytest.mark.mutant
def test_mistake_attempts_after_the_end_of_a_member_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = adaptive._Driver.stepped

    def wrong(self: Any, *arguments: Any) -> Any:
        self.attempts += 1e6
        return right(self, *arguments)

    monkeypatch.setattr(adaptive._Driver, "stepped", wrong)
    with pytest.raises(AssertionError):
        bits.check_what_comes_after_a_terminal_event_is_not_computed("merson", monkeypatch)


@pytest.mark.mutant
def test_mistake_one_attempt_too_few_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right = adaptive._Driver.stepped

    def wrong(self: Any, *arguments: Any) -> Any:
        self.attempts -= 1.0
        return right(self, *arguments)

    monkeypatch.setattr(adaptive._Driver, "stepped", wrong)
    with pytest.raises(AssertionError):
        bits.check_a_member_that_stopped_stays_where_it_was_and_cannot_go_on()
