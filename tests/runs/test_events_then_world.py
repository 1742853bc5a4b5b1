"""Events that change the state of a world: its steps are those of a run, and none of many balls ends below the ground."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.events_then import GRAVITY, U, ball, ground
from support.families import family

METHODS = ["rk4", "leapfrog", "verlet", "false_euler", "standard_heun"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n", [1, 5])
def test_frames_have_the_states_of_a_run(method: str, n: int) -> None:
    """Of every member that does not rest, in every frame, to the bit: also of those whose neighbours bounce in it."""
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


@pytest.mark.parametrize("method", family(METHODS, lambda method: method in ("rk4", "leapfrog")))  # one carries v at another time
def test_none_of_many_balls_ends_below_the_ground(method: str) -> None:
    """After ten seconds of frames all lie at the ground, and stay there.

    Bound: a trial's step errs by the roundings of a height.
    """
    v, y = np.zeros(200), np.linspace(0.5, 3.0, 200)
    world = sw.World(ball(), method, v=v, y=y, dt=1 / 60, events=ground(0.7))
    for _ in range(60):
        world.step(10)
        assert (y > -8 * U * 3.0).all()
    assert (np.abs(y) < 1e-12).all()
    assert (np.abs(v) < 1e-6).all()
    there = y.copy()
    world.step(30)
    np.testing.assert_array_equal(y, there)


def test_a_ball_at_rest_that_is_kicked_flies_and_one_that_is_lifted_falls() -> None:
    v, y = np.zeros(3), np.array([0.0, 0.0, 0.0])
    world = sw.World(ball(), "rk4", v=v, y=y, dt=0.01, events=ground(0.5))
    world.step(100)
    assert (y == 0.0).all()
    v[1], y[2] = 2.0, 1.0
    world.step(20)
    assert y[0] == 0.0
    np.testing.assert_allclose(y[1:], [2.0 * 0.2 - 0.5 * GRAVITY * 0.04, 1.0 - 0.5 * GRAVITY * 0.04], rtol=1e-13)
    world.step(30)
    assert world.events["ground"].member.tolist() == [1, 2]


def test_a_copy_goes_on_alike() -> None:
    v, y = np.zeros(5), np.linspace(0.5, 3.0, 5)
    world = sw.World(ball(), "leapfrog", v=v, y=y, dt=0.01, events=ground(0.8))
    world.step(70)
    other = copy.deepcopy(world)
    world.step(80)
    other.step(80)
    np.testing.assert_allclose(other.y, world.y, rtol=0, atol=1e-12)


def test_backward_in_time_a_bounce_is_undone() -> None:
    """A ball that bounces without loss comes back to where it fell from."""
    v, y = np.zeros(2), np.array([1.0, 2.0])
    forward = sw.World(ball(), "rk4", v=v, y=y, dt=0.01, events=ground(1.0))
    forward.step(150)
    back = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-v, y), name="ground")
    world = sw.World(ball(), "rk4", v=v, y=y, dt=-0.01, t0=1.5, events=back)
    world.step(150)
    np.testing.assert_allclose(y, [1.0, 2.0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(v, 0.0, rtol=0, atol=1e-10)


def test_a_world_with_a_terminal_event_is_refused() -> None:
    stop: Any = sw.Event(lambda t, v, y: y, terminal=True, name="ground")
    with pytest.raises(sw.errors.UnsupportedError, match="no event stops a member of a world"):
        sw.World(ball(), "rk4", v=np.zeros(1), y=np.ones(1), dt=0.1, events=stop)


@pytest.mark.mutant
def test_mistake_neighbours_that_begin_anew_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without their carry members of a leapfrog world would have other bits where another bounces."""
    from stepwell.runs.events import frames

    def forgetful(self: Any, step: int, index: Any, v: Any, y: Any) -> None:
        for block, new in zip(self._blocks, (v, y), strict=True):
            block[..., index] = new

    monkeypatch.setattr(frames.Frames, "_write", forgetful)
    with pytest.raises(AssertionError):
        test_frames_have_the_states_of_a_run("leapfrog", 1)
