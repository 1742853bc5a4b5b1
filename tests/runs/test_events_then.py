"""Events that change the state: bounces against closed forms, members that come to rest, and what is refused."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.events_then import GRAVITY, WALLS, U, ball, bumper, free, ground, times_of_bounces
from support.families import family


@pytest.mark.parametrize("backend", ["rust", "numpy"])
@pytest.mark.parametrize("share", [0.02, 0.15, 0.9])
@pytest.mark.parametrize(("height", "restitution"), [(1.0, 0.8), (3.0, 0.95), (0.02, 0.7), (1.0, 1.0)])
def test_bounces_are_where_a_closed_form_says(height: float, restitution: float, share: float, backend: str) -> None:
    """RK4 makes no error in a parabola. After each bounce the ball is at the height that the parabola of its flight has.

    Bound: y is off by the roundings of at most 1000 steps of numbers up to the height, and passes the ground after n bounces at
    the first speed times the restitution's power; a bounce is late by what the one before is late, and by the same again.
    """
    n, dt = 6, share * np.sqrt(2.0 * height / GRAVITY)
    expected = times_of_bounces(height, restitution, n)
    end = expected[-1] + 0.4 * (times_of_bounces(height, restitution, n + 1)[-1] - expected[-1])
    steps = int(np.ceil(end / dt))
    run = sw.integrate(ball(), "rk4", v=0.0, y=height, dt=dt, steps=steps, every=1, events=ground(restitution), backend=backend)
    speed = np.sqrt(2.0 * GRAVITY * height)
    bound = 2 * n * 1000 * U * height / (speed * restitution**n)
    bounces = run.events["ground"]
    np.testing.assert_allclose(bounces.t[:n], expected, rtol=0, atol=bound)
    last = np.searchsorted(expected, run.t, "right") - 1  # the bounce before each saved state
    begins, speeds = np.append(expected, 0.0)[last], np.append(speed * restitution ** np.arange(1, n + 1), 0.0)[last]
    heights = np.append(np.zeros(n), height)[last]
    sure = np.abs(run.t[:, np.newaxis] - expected).min(-1) > bound
    within = sure & (run.t < times_of_bounces(height, restitution, n + 1)[-1])
    flight = run.t - begins
    right = heights + (speeds - 0.5 * GRAVITY * flight) * flight
    np.testing.assert_allclose(run.y[within], right[within], rtol=0, atol=2 * speed * bound)


@pytest.mark.parametrize("balls", family([100, 1000], lambda balls: balls == 100))
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


@pytest.mark.filterwarnings("ignore:1 of 12 members came to rest:stepwell.errors.EventWarning")
@pytest.mark.filterwarnings("ignore:the run came to rest:stepwell.errors.EventWarning")
def test_members_of_a_batch_have_the_bits_that_they_have_alone_and_by_numpy() -> None:
    """By False Euler a ball that bounces twice within a step has no speed at the second: y is then h times the speed there."""
    event = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y, *, restitution: (-restitution * v, y), name="ground")
    restitution, y = np.linspace(0.7, 1.1, 12), np.linspace(0.3, 2.0, 12)
    steps = {"dt": 0.013, "steps": 90, "every": 9, "events": event}
    for method in ("rk4", "verlet", "false_euler"):
        run = sw.integrate(bumper(restitution=restitution), method, v=0.0, y=y, **steps)
        assert (run.events["ground"].count > 0).all()
        by_numpy = sw.integrate(bumper(restitution=restitution), method, v=0.0, y=y, backend="numpy", **steps)
        for one in ("v", "y", "status"):
            np.testing.assert_array_equal(getattr(run, one), getattr(by_numpy, one))
        np.testing.assert_array_equal(run.events["ground"].t, by_numpy.events["ground"].t)
        for i in (0, 5, 11):
            alone = sw.integrate(bumper(restitution=restitution[i]), method, v=0.0, y=y[i], **steps)
            np.testing.assert_array_equal(run.y[:, i], alone.y)
            np.testing.assert_array_equal(run.v[:, i], alone.v)
            np.testing.assert_array_equal(run.events["ground"].of(i).t, alone.events["ground"].t)


@pytest.mark.parametrize("dt", [0.01, 0.3, -0.05])
def test_two_walls_and_several_bounces_within_a_step(dt: float) -> None:
    """A point without forces between walls at 0 and 1, at speed 7: it meets the walls every 1/7, from either side, forward and
    backward in time.

    Bound: positions are off by the roundings of as many numbers up to 7·0.3 as there are steps and bounces.
    """
    steps = int(3.0 / abs(dt))
    run = sw.integrate(free(), "rk4", v=7.0, y=0.5, dt=dt, steps=steps, every=1, events=WALLS)
    way = np.abs((0.5 + 7.0 * run.t) % 2.0)
    np.testing.assert_allclose(run.y, np.minimum(way, 2.0 - way), rtol=0, atol=10 * (steps + 21) * U * 21.0)
    turns = np.floor(0.5 + 7.0 * abs(dt) * steps)
    assert run.events["left"].count + run.events["right"].count == turns


def test_a_system_without_velocities_is_set_back() -> None:
    """A neuron that integrates and fires: ẏ = 1 from 0 to 1 and back to 0 fires at the whole numbers."""

    @sw.system(order=1)
    def charge(t: Any, y: Any) -> Any:
        return 1.0 + 0.0 * y

    fires = sw.Event(lambda t, y: y - 1.0, direction=1, then=lambda t, y: 0.0 * y, name="fires")
    run = sw.integrate(charge(), "rk4", y=0.0, dt=0.3, steps=35, events=fires)
    np.testing.assert_allclose(run.events["fires"].t, np.arange(1, 11), rtol=0, atol=35 * 10 * U)
    np.testing.assert_allclose(run.y[-1], 0.5, rtol=0, atol=35 * 10 * U)


def test_a_ball_that_begins_at_the_ground_lies_there_or_leaves_it() -> None:
    """At rest it stays; upwards it flies for 2v/g and bounces."""
    with pytest.warns(sw.EventWarning, match="came to rest at event ground, at t = 0"):
        lies = sw.integrate(ball(), "rk4", v=0.0, y=0.0, dt=0.01, steps=100, events=ground(0.8))
    assert (lies.y == 0.0).all()
    assert lies.stopped_at == 0.0
    flies = sw.integrate(ball(), "rk4", v=3.0, y=0.0, dt=0.01, steps=100, events=ground(0.8))
    np.testing.assert_allclose(flies.events["ground"].t[0], 2.0 * 3.0 / GRAVITY, rtol=0, atol=62 * U)


def test_no_warning_where_nothing_comes_to_rest() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = sw.integrate(ball(), "rk4", v=0.0, y=1.0, dt=0.01, steps=1000, events=ground(1.0))
    assert run.status == sw.Status.OK


def test_what_does_not_go_is_refused_in_words() -> None:
    with pytest.raises(sw.errors.DTypeError, match=r"then: expected a Python function such as then\(t, v, y\), got 3"):
        sw.Event(lambda t, v, y: y, then=3)
    with pytest.raises(sw.errors.ArgumentError, match="then, terminal: a member that stops"):
        sw.Event(lambda t, v, y: y, terminal=True, then=lambda t, v, y: (v, y))
    event = sw.Event(lambda t, v, y: y, then=lambda t, y: y, name="g")
    with pytest.raises(sw.errors.ArgumentError, match=r"events: g: then: expected a function \(t, v, y, \*, …\)"):
        sw.integrate(ball(), "rk4", v=0.0, y=1.0, dt=0.1, steps=3, events=event)


@pytest.mark.mutant
def test_mistake_an_event_that_leaves_the_state_as_it_is_is_noticed() -> None:
    """So the closed forms above see the change of the state."""
    run = sw.integrate(ball(), "rk4", v=0.0, y=1.0, dt=0.01, steps=100, events=sw.Event(lambda t, v, y: y, name="ground"))
    assert run.y[-1] < -1.0
