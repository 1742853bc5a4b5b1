"""Events that change the state, with steps chosen by a tolerance: closed forms, members that come to rest, the same bits."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs.events import adaptive
from support.events_then import GRAVITY, WALLS, U, ball, bumper, free, ground, times_of_bounces

METHODS = [method.name for method in sw.methods() if method.error_order is not None]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("height", "restitution"), [(1.0, 0.8), (3.0, 0.95), (0.02, 0.7), (1.0, 1.0)])
def test_bounces_are_where_a_closed_form_says(method: str, height: float, restitution: float) -> None:
    """No method errs in a parabola, so a bounce is late by roundings of a height, passed at its speed.

    After each bounce the ball is at the height that the parabola of its flight has.
    """
    n = 6
    expected = times_of_bounces(height, restitution, n)
    end = expected[-1] + 0.4 * (times_of_bounces(height, restitution, n + 1)[-1] - expected[-1])
    t = np.linspace(0.0, end, 57)
    run = sw.integrate(ball(), method, v=0.0, y=height, tolerance=1e-9, at=t, events=ground(restitution))
    speed = np.sqrt(2.0 * GRAVITY * height)
    bound = 2 * n * 1000 * U * height / (speed * restitution**n)
    bounces = run.events["ground"]
    np.testing.assert_allclose(bounces.t, expected, rtol=0, atol=bound)
    last = np.searchsorted(expected, t, "right") - 1
    begins, speeds = np.append(expected, 0.0)[last], np.append(speed * restitution ** np.arange(1, n + 1), 0.0)[last]
    heights, flight = np.append(np.zeros(n), height)[last], t - begins
    np.testing.assert_allclose(run.y, heights + (speeds - 0.5 * GRAVITY * flight) * flight, rtol=0, atol=2 * speed * bound)
    assert run.status == sw.Status.OK
    assert run.stopped_at is not None
    assert np.isnan(run.stopped_at)


@pytest.mark.parametrize("method", METHODS)
def test_a_hundred_balls_come_to_rest_where_their_series_ends_with_the_same_bits_however(method: str) -> None:
    """At fall·(1 + e)/(1 − e). Alone, by NumPy, with other saved times, and in pieces they have the bits of the batch.

    Bounds: the limit is off by what SETTLED and the share of it that is left to a series, 2⁻²⁰, make of it, and by roundings of
    some tens of bounces; no ball is further below the ground than a trial's step errs.
    """
    y, e = np.linspace(0.5, 3.0, 100), np.linspace(0.4, 0.8, 100)
    event = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y, *, restitution: (-restitution * v, y), name="ground")

    def run(which: Any, at: Any, **options: Any) -> sw.Run:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.EventWarning)
            system = bumper(restitution=e[which])
            return sw.integrate(system, method, v=0.0, y=y[which], tolerance=1e-9, at=at, events=event, **options)

    all_of = run(slice(None), [2.0, 10.0])
    assert (all_of.status == sw.Status.REST).all()
    np.testing.assert_allclose(all_of.stopped_at, np.sqrt(2.0 * y / GRAVITY) * (1.0 + e) / (1.0 - e), rtol=1e-11)
    assert (all_of.y > -8 * U * 3.0).all()
    assert (np.abs(all_of.v[-1]) < 1e-10).all()
    for other, which in (
        (run(slice(0, 7), [2.0, 10.0], backend="numpy"), slice(0, 7)),
        (run(slice(90, 97), [2.0, 10.0], threads=2), slice(90, 97)),
        (run(3, [2.0, 10.0]), 3),
    ):
        for name in ("v", "y", "status", "stopped_at"):
            np.testing.assert_array_equal(getattr(other, name), getattr(all_of, name)[..., which])
        np.testing.assert_array_equal(other.events["ground"].count, all_of.events["ground"].count[which])
    often = run(slice(None), np.linspace(0.0, 10.0, 101))
    np.testing.assert_array_equal(often.y[[20, 100]], all_of.y)
    np.testing.assert_array_equal(often.events["ground"].t, all_of.events["ground"].t)
    assert (often.y > -8 * U * 3.0).all()


def test_a_run_in_pieces_is_the_run_in_one() -> None:
    y = np.linspace(0.5, 3.0, 12)
    whole = sw.integrate(ball(), "merson", v=0.0, y=y, tolerance=1e-9, at=[1.0, 1.7, 2.5], events=ground(0.8))
    first = sw.integrate(ball(), "merson", v=0.0, y=y, tolerance=1e-9, at=[1.0, 1.7], events=ground(0.8))
    second = sw.integrate(ball(), "merson", resume=first, at=[2.5], events=ground(0.8))
    np.testing.assert_array_equal(whole.y, np.concatenate([first.y, second.y]))
    counts = [run.events["ground"].count for run in (first, second, whole)]
    np.testing.assert_array_equal(counts[0] + counts[1], counts[2])


@pytest.mark.parametrize("method", METHODS)
def test_a_neuron_fires_when_a_closed_form_says(method: str) -> None:
    """ẏ = I − y from 0 to 1 takes ln(I/(I − 1)), and begins at 0 again; what it fired for is added up beside it.

    Bound: a step errs by 1e-9 of 1, where ẏ is I − 1 or more; each of some 20 steps to a spike, and every spike is late by those
    before it.
    """

    @sw.system(order=1)
    def neuron(t: Any, y: Any, *, current: Any = 2.0) -> Any:
        return np.array([current - y[0], 0.0 * y[1]])

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


def test_backward_between_two_walls_over_jumps() -> None:
    """A point without forces between walls at 0 and 1 at speed 7, backward in time, with times that no step crosses."""
    t = -np.linspace(0.0, 3.0, 31)
    run = sw.integrate(free(), "dop853", v=7.0, y=0.5, tolerance=1e-9, at=t, jumps=[-0.3, -1.0, -2.5], max_step=0.9, events=WALLS)
    way = np.abs((0.5 + 7.0 * t) % 2.0)
    np.testing.assert_allclose(run.y, np.minimum(way, 2.0 - way), rtol=0, atol=200 * U * 21.0)
    assert run.events["left"].count + run.events["right"].count == 21
    both = np.sort(np.concatenate([run.events[name].t for name in ("left", "right")]))[::-1]
    np.testing.assert_allclose(both, -(0.5 + np.arange(21)) / 7.0, rtol=0, atol=200 * U * 3.0)


def test_a_terminal_event_ends_a_run_that_others_change() -> None:
    """The third top of a ball ends it; bounces before are counted, and a member of another batch index goes on."""
    top = sw.Event(lambda t, v, y: v, direction=-1, terminal=3, name="top")
    run = sw.integrate(ball(), "merson", v=0.0, y=[1.0, 3.0], tolerance=1e-9, at=[2.5], events=[ground(0.8), top])
    times = times_of_bounces(np.array([1.0, 3.0]), 0.8, 4)
    ends = 0.5 * (times[0, 2] + times[0, 3])
    assert run.stopped_at is not None
    np.testing.assert_allclose(run.stopped_at, [ends, np.nan], rtol=1e-13)
    np.testing.assert_array_equal(run.status, [sw.Status.EVENT, sw.Status.OK])
    assert list(run.events["ground"].count) == [3, 2]
    assert list(run.events["top"].count) == [3, 1]


def test_a_ball_that_begins_at_the_ground_lies_there_or_leaves_it() -> None:
    with pytest.warns(sw.EventWarning, match="came to rest at event ground, at t = 0"):
        lies = sw.integrate(ball(), "dop853", v=0.0, y=0.0, tolerance=1e-9, at=[0.5, 1.0], events=ground(0.8))
    assert (lies.y == 0.0).all()
    assert lies.stopped_at == 0.0
    assert lies.events["ground"].count == 0
    flies = sw.integrate(ball(), "dop853", v=3.0, y=0.0, tolerance=1e-9, at=[1.0], events=ground(0.8))
    np.testing.assert_allclose(flies.events["ground"].t[0], 2.0 * 3.0 / GRAVITY, rtol=0, atol=200 * U)


def test_what_other_members_do_does_not_matter_where_a_budget_ends() -> None:
    """Attempts of all parts are counted together: a member that bounces runs out of them, and says so."""
    with pytest.warns(sw.ToleranceWarning, match="1 of 2 members stopped before t = 3: member 0 .*out of max_steps"):
        run = sw.integrate(ball(), "merson", v=0.0, y=[1.0, 100.0], tolerance=1e-9, at=[3.0], events=ground(0.9), max_steps=40)
    np.testing.assert_array_equal(run.status, [sw.Status.BUDGET, sw.Status.OK])
    assert run.paces is not None
    assert run.paces.accepted[0] + run.paces.rejected[0] == 40


@pytest.mark.mutant
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
