"""Events that change the state, of runs with steps of either kind and of worlds: closed forms, what comes to rest, refusals."""

from __future__ import annotations

import copy
import itertools
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs.events import adaptive, frames
from support.events import ABLE, GRAVITY, U
from support.families import family
from support.ways import assert_equal_ways

ball = sw.system(lambda t, v, y: -GRAVITY)

bumper = sw.system(lambda t, v, y, *, restitution=1.0: -GRAVITY)

free = sw.system(lambda t, v, y: 0.0 * y)

WALLS = [
    sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-v, 0.0 * y), name="left"),
    sw.Event(lambda t, v, y: y - 1.0, direction=1, then=lambda t, v, y: (-v, 0.0 * y + 1.0), name="right"),
]


def ground(restitution: float) -> sw.Event:
    return sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-restitution * v, y), name="ground")


#: The ground, of which each member has its own restitution.
GROUND = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y, *, restitution: (-restitution * v, y), name="ground")


def times_of_bounces(height: Any, restitution: float, n: int) -> Any:
    """The fall, and then twice its time by the restitution's power for each flight."""
    fall = np.sqrt(2.0 * height / GRAVITY)
    return np.stack([fall * (1.0 + 2.0 * sum(restitution**j for j in range(1, k + 1))) for k in range(n)], -1)


# ---- closed forms


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


def test_backward_between_two_walls_over_jumps() -> None:
    """The same with adaptive steps, backward in time, with times that no step crosses."""
    t = -np.linspace(0.0, 3.0, 31)
    run = sw.integrate(free(), "dop853", v=7.0, y=0.5, tolerance=1e-9, at=t, jumps=[-0.3, -1.0, -2.5], max_step=0.9, events=WALLS)
    way = np.abs((0.5 + 7.0 * t) % 2.0)
    np.testing.assert_allclose(run.y, np.minimum(way, 2.0 - way), rtol=0, atol=200 * U * 21.0)
    assert run.events["left"].count + run.events["right"].count == 21
    both = np.sort(np.concatenate([run.events[name].t for name in ("left", "right")]))[::-1]
    np.testing.assert_allclose(both, -(0.5 + np.arange(21)) / 7.0, rtol=0, atol=200 * U * 3.0)


def test_a_system_without_velocities_is_set_back() -> None:
    """A neuron that integrates and fires: ẏ = 1 from 0 to 1 and back to 0 fires at the whole numbers."""
    charge = sw.system(order=1)(lambda t, y: 1.0 + 0.0 * y)
    fires = sw.Event(lambda t, y: y - 1.0, direction=1, then=lambda t, y: 0.0 * y, name="fires")
    run = sw.integrate(charge(), "rk4", y=0.0, dt=0.3, steps=35, events=fires)
    np.testing.assert_allclose(run.events["fires"].t, np.arange(1, 11), rtol=0, atol=35 * 10 * U)
    np.testing.assert_allclose(run.y[-1], 0.5, rtol=0, atol=35 * 10 * U)


@pytest.mark.parametrize("method", ABLE)
def test_a_neuron_fires_when_a_closed_form_says(method: str) -> None:
    """ẏ = I − y from 0 to 1 takes ln(I/(I − 1)), and begins at 0 again; what it fired for is added up beside it.

    Bound: a step errs by 1e-9 of 1, where ẏ is I − 1 or more; each of some 20 steps to a spike, and every spike is late by those
    before it.
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


# ---- the same however it is made


@pytest.mark.parametrize(
    ("method", "steps"),
    [
        ("rk4", {"dt": 0.013, "steps": 90, "every": 9}),
        ("verlet", {"dt": 0.013, "steps": 90, "every": 9}),
        # A ball that bounces twice within a step has no speed at the second: y is then h times the speed there.
        ("false_euler", {"dt": 0.013, "steps": 90, "every": 9}),
        ("merson", {"tolerance": 1e-6, "at": [0.5, 1.0, 1.2]}),
        ("taylor", {"tolerance": 1e-6, "at": [0.5, 1.0, 1.2]}),
    ],
)
def test_bounces_are_the_same_in_all_ways(method: str, steps: dict[str, Any]) -> None:
    restitution, y = np.linspace(0.7, 1.1, 12), np.linspace(0.3, 2.0, 12)
    ways = ("by the reference", "alone", "in company", "in pieces", "saved more often")
    ask = {"v": np.zeros(12), "y": y, "events": GROUND, **steps}
    run = assert_equal_ways(bumper(restitution=restitution), method, ways=ways, **ask)
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


# ---- balls that lie


@pytest.mark.parametrize(
    ("method", "steps"), [("rk4", {"dt": 0.01, "steps": 100}), ("dop853", {"tolerance": 1e-9, "at": [0.5, 1.0]})]
)
def test_a_ball_that_begins_at_the_ground_lies_there_or_leaves_it(method: str, steps: dict[str, Any]) -> None:
    """At rest it stays; upwards it flies for 2v/g and bounces. Bound: the roundings of some 100 steps."""
    with pytest.warns(sw.EventWarning, match="came to rest at event ground, at t = 0"):
        lies = sw.integrate(ball(), method, v=0.0, y=0.0, events=ground(0.8), **steps)
    assert (lies.y == 0.0).all()
    assert lies.stopped_at == 0.0
    assert lies.events["ground"].count == 0
    flies = sw.integrate(ball(), method, v=3.0, y=0.0, events=ground(0.8), **steps)
    np.testing.assert_allclose(flies.events["ground"].t[0], 2.0 * 3.0 / GRAVITY, rtol=0, atol=62 * U)


@pytest.mark.parametrize("method", ["rk4", "leapfrog"])  # one carries v at another time
def test_none_of_many_balls_of_a_world_ends_below_the_ground(method: str) -> None:
    """After ten seconds of frames all lie at the ground, and stay there.

    Bound: a trial's step errs by the roundings of a height.
    """
    v, y = np.zeros(15), np.linspace(0.5, 3.0, 15)
    world = sw.World(ball(), method, v=v, y=y, dt=1 / 60, events=ground(0.7))
    for _ in range(60):
        world.step(10)
        assert (y > -8 * U * 3.0).all()
    assert (np.abs(y) < 1e-12).all()
    assert (np.abs(v) < 1e-6).all()
    there = y.copy()
    world.step(30)
    np.testing.assert_array_equal(y, there)


def test_a_ball_at_rest_in_a_world_that_is_kicked_flies_and_one_that_is_lifted_falls() -> None:
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


def test_a_copy_of_a_world_goes_on_alike() -> None:
    v, y = np.zeros(5), np.linspace(0.5, 3.0, 5)
    world = sw.World(ball(), "leapfrog", v=v, y=y, dt=0.01, events=ground(0.8))
    world.step(70)
    other = copy.deepcopy(world)
    world.step(80)
    other.step(80)
    np.testing.assert_allclose(other.y, world.y, rtol=0, atol=1e-12)


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


# ---- changes that lead back onto their event: what they hold comes to rest, and what only passes them goes on

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


@pytest.mark.parametrize(("method", "steps"), WAYS)
def test_an_empty_tank(method: str, steps: dict[str, Any]) -> None:
    """It is empty at (h − level)/0.7, that which begins empty at once, and stays so; before it went on below."""
    fillings = [(0.0, lambda t, h: np.maximum(h, 0.0)), (0.3, lambda t, h: np.maximum(h, 0.3))]
    fillings += [(0.0, lambda t, h: 0.0 * h), (0.0, abs_of)]
    for (level, then), direction in itertools.product(fillings, (-1, 0)):
        start = np.array([1.0, 0.5, level])
        ask = {"y": start, "events": lowest(level, then, direction), **steps}
        for backend in ("rust", "numpy") if then is abs_of else ("rust",):
            with pytest.warns(
                sw.EventWarning, match="3 of 3 members came to rest at event empty; the first was member 2 at t = 0: its"
            ):
                run = sw.integrate(tank(), method, backend=backend, **ask)
            assert (run.status == sw.Status.REST).all()
            # Rates are constant: states and times are right to the roundings of at most 400 sums of numbers up to 3, 3·2⁻⁵³ each.
            bound = 400 * 3 * U
            np.testing.assert_allclose(run.stopped_at, (start - level) / 0.7, atol=2 * bound, rtol=0)
            np.testing.assert_allclose(run.y[-1], level, atol=bound, rtol=0)
            assert run.events["empty"].count.tolist() == [1, 1, 0]


def abs_of(t: Any, h: Any) -> Any:
    return abs(h)


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
def test_a_tank_back_in_time(steps: dict[str, Any]) -> None:
    full = sw.Event(lambda t, h: h - 1.4, direction=1, then=lambda t, h: np.minimum(h, 1.4), name="full")
    with pytest.warns(sw.EventWarning, match=r"came to rest at event full, at t = -2: its change of the state leads back"):
        run = sw.integrate(tank(), "merson", y=0.0, events=full, **steps)
    assert run.y[-1] == 1.4


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


# ---- wrong calls, and mistakes


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


@pytest.mark.mutant
def test_mistake_neighbours_that_begin_anew_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without their carry members of a leapfrog world would have other bits where another bounces."""

    def forgetful(self: Any, step: int, index: Any, v: Any, y: Any) -> None:
        for block, new in zip(self._blocks, (v, y), strict=True):
            block[..., index] = new

    monkeypatch.setattr(frames.Frames, "_write", forgetful)
    with pytest.raises(AssertionError):
        frames_are_those_of_a_run("leapfrog", 1)
