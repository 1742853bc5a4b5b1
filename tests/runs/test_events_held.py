"""Events whose change of the state leads back onto them: what they hold comes to rest, and what only passes them goes on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw

tank = sw.system(order=1)(lambda t, h, *, rate=-0.7: rate)

WAYS: list[tuple[str, dict[str, Any]]] = [
    ("rk4", {"dt": 0.01, "steps": 400}),
    ("standard_euler", {"dt": 0.013, "steps": 400}),
    ("merson", {"tolerance": 1e-8, "at": [1.0, 4.0]}),
    ("dop853", {"tolerance": 1e-8, "at": [1.0, 4.0]}),
    ("taylor", {"tolerance": 1e-8, "at": [1.0, 4.0]}),
]


def lowest(level: float, then: Any, direction: int = -1) -> sw.Event:
    return sw.Event(lambda t, h: h - level, direction=direction, then=then, name="empty")


@pytest.mark.parametrize("backend", ["rust", "numpy"])
@pytest.mark.parametrize(("method", "steps"), WAYS)
@pytest.mark.parametrize(
    ("level", "then"),
    [
        (0.0, lambda t, h: np.maximum(h, 0.0)),
        (0.3, lambda t, h: np.maximum(h, 0.3)),
        (0.0, lambda t, h: 0.0 * h),
        (0.0, lambda t, h: abs(h)),
    ],
)
@pytest.mark.parametrize("direction", [-1, 0])
def test_an_empty_tank(method: str, steps: dict[str, Any], backend: Any, level: float, then: Any, direction: int) -> None:
    """It is empty at (h − level)/0.7, that which begins empty at once, and stays so; before it went on below."""
    start = np.array([1.0, 0.5, level])
    event = lowest(level, then, direction)
    with pytest.warns(sw.EventWarning, match="3 of 3 members came to rest at event empty; the first was member 2 at t = 0: its"):
        run = sw.integrate(tank(), method, y=start, events=event, backend=backend, **steps)
    assert (run.status == sw.Status.REST).all()
    # Rates are constant: states and times are right to the roundings of at most 400 sums of numbers up to 3, 3·2⁻⁵³ each.
    bound = 400 * 3 * 2.0**-53
    assert run.stopped_at is not None
    np.testing.assert_allclose(run.stopped_at, (start - level) / 0.7, atol=2 * bound, rtol=0)
    np.testing.assert_allclose(run.y[-1], level, atol=bound, rtol=0)
    assert run.events["empty"].count.tolist() == [1, 1, 0]


def test_a_world_keeps_it_empty_until_it_is_filled() -> None:
    y = np.array([1.0, 0.0, 0.5])
    world = sw.World(tank(), "rk4", v=np.zeros((0, 3)), y=y, dt=0.01, events=lowest(0.0, lambda t, h: np.maximum(h, 0.0)))
    world.step(50)
    np.testing.assert_allclose(y, [0.65, 0.0, 0.15], atol=1e-14)
    world.step(150)
    assert (y == 0.0).all()
    y[1] = 0.7
    world.step(50)
    np.testing.assert_allclose(y, [0.0, 0.35, 0.0], atol=1e-14)
    world.step(100)
    assert (y == 0.0).all()


@pytest.mark.parametrize("steps", [{"dt": -0.01, "steps": 400}, {"tolerance": 1e-8, "at": [-4.0]}])
def test_back_in_time(steps: dict[str, Any]) -> None:
    full = sw.Event(lambda t, h: h - 1.4, direction=1, then=lambda t, h: np.minimum(h, 1.4), name="full")
    with pytest.warns(sw.EventWarning, match=r"came to rest at event full, at t = -2: its change of the state leads back"):
        run = sw.integrate(tank(), "merson", y=0.0, events=full, **steps)
    assert run.y[-1] == 1.4


@pytest.mark.parametrize(("method", "steps"), WAYS)
def test_a_ball_that_keeps_its_speed(method: str, steps: dict[str, Any]) -> None:
    """Who sets the place alone holds it there."""
    ball = sw.system(lambda t, v, y: -9.81)
    ground = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (v, np.maximum(y, 0.0)), name="ground")
    with pytest.warns(sw.EventWarning, match="came to rest at event ground"):
        run = sw.integrate(ball(), method, v=-1.0, y=1.0, events=ground, **steps)
    assert run.y[-1] == 0.0


PASSING: list[tuple[Any, sw.Event, dict[str, Any]]] = [
    # A dose of zero at a time, and a kick of zero where a member passes: the state stays as it is, but nothing leads back.
    (
        sw.system(order=1)(lambda t, c, *, dose=0.0: -0.3 * c),
        sw.Event(lambda t, c: np.sin(t), then=lambda t, c, *, dose: c + dose, name="event"),
        {"y": 1.0},
    ),
    (
        sw.system(lambda t, v, y, *, kick=0.0: -y),
        sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y, *, kick: (v - kick, y), name="event"),
        {"v": 0.0, "y": 1.0},
    ),
    # A clock whose amplitude is set anew where it turns, and a heater that is too weak: the state is another one there.
    (
        sw.system(lambda t, v, y: -9.0 * y - 0.1 * v),
        sw.Event(lambda t, v, y: v, direction=-1, then=lambda t, v, y: (0.0 * v, 1.0 + 0.0 * y), name="event"),
        {"v": 1.0, "y": 0.0},
    ),
    (
        sw.system(order=1, shape=(2,))(lambda t, y: np.array([10.0 - y[0] + y[1], 0.0])),
        sw.Event(lambda t, y: y[0] - 20.0, direction=-1, then=lambda t, y: np.array([20.0, 1.0]), name="event"),
        {"y": np.array([25.0, 0.0])},
    ),
]


@pytest.mark.parametrize(("method", "steps"), WAYS)
@pytest.mark.parametrize(("system", "event", "start"), PASSING)
def test_what_passes_its_event(method: str, steps: dict[str, Any], system: Any, event: sw.Event, start: dict[str, Any]) -> None:
    run = sw.integrate(system(), method, events=event, **start, **steps)
    assert run.status == sw.Status.OK
    assert run.events["event"].count >= 1


@pytest.mark.parametrize("steps", [{"dt": 0.01, "steps": 800}, {"tolerance": 1e-8, "at": [8.0]}])
@pytest.mark.parametrize("turned", [False, True])
def test_a_tank_that_is_filled_when_it_is_empty(steps: dict[str, Any], turned: bool) -> None:
    """Of two events at one time the state that both leave counts: it is at none of them, and empty again a unit of time later."""
    filled = sw.Event(lambda t, h: t - 6.0, then=lambda t, h: h + 1.0, name="filled")
    events = [lowest(0.0, lambda t, h: np.maximum(h, 0.0)), filled]
    with pytest.warns(sw.EventWarning, match="came to rest at event empty, at t = 7: its change"):
        run = sw.integrate(tank(rate=-1.0), "merson", y=6.0, events=events[::-1] if turned else events, **steps)
    assert run.y[-1] == 0.0
