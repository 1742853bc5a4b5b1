"""What events mean where several occur together, where one sets off others, and where a change of the state leaves g at zero.

Each is the same by fixed steps, by adaptive steps, and in a world.
"""

import itertools
import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs.events import adaptive
from stepwell.runs.events import resets as resets_of_events
from support.events import GRAVITY, U

#: Ways to make a run to the time 4.
WAYS: list[tuple[str, dict[str, Any]]] = [
    ("rk4", {"dt": 0.3125, "steps": 16}),
    ("verlet", {"dt": 0.0625, "steps": 80}),
    ("dop853", {"tolerance": (1e-9, 1e-12), "at": [5.0]}),
    ("merson", {"tolerance": (1e-9, 1e-12), "at": [5.0]}),
    ("taylor", {"tolerance": (1e-9, 1e-12), "at": [5.0]}),
]
OF_FIRST_ORDER = [each for each in WAYS if each[0] != "verlet"]
BACKENDS = pytest.mark.parametrize("backend", ["rust", "numpy"])


def pair(function: Any) -> sw.System:
    return sw.system(order=1, shape=(2,))(function)()


def in_a_world(system: sw.System, y: Any, events: Any, batch: tuple[int, ...] = ()) -> tuple[Any, dict[str, Any]]:
    """The last state of a world after 16 steps of 0.3125, and how often each event occurred."""
    y = np.array(y, dtype=np.float64)
    world = sw.World(system, "rk4", v=np.zeros((0, *batch)), y=y, dt=0.3125, events=events)
    counts: dict[str, Any] = {each.name: 0 for each in events}
    for _ in range(16):
        world.step()
        for name, occurrences in world.events.items():
            counts[name] = counts[name] + occurrences.count
    return y, counts


def resets(i: int) -> sw.Event:
    """Sets the number i back to zero where it is one."""

    def then(t: Any, y: Any) -> Any:
        return np.array([0.0 if j == i else y[j] for j in range(2)])

    return sw.Event(lambda t, y: y[i] - 1.0, direction=1, then=then, name=f"r{i}")


@BACKENDS
def test_two_at_once_all_happen(backend: Any) -> None:
    """Both at rate 1, from 1/4 and so many units in the last place beside it: each has its own reset, five times to t = 5."""
    y = np.stack([np.full(41, 0.25), 0.25 + np.arange(-20, 21) * 2.0**-54])
    system, both = pair(lambda t, y: 1.0 + 0.0 * y), [resets(0), resets(1)]
    for method, steps in OF_FIRST_ORDER:
        run = sw.integrate(system, method, y=y, events=both, backend=backend, **steps)
        for event in both:
            np.testing.assert_array_equal(run.events[event.name].count, 5, err_msg=method)
        # Off by the roundings of 5 resets and of some 100 sums of numbers up to 5.
        np.testing.assert_allclose(run.y[-1], 0.25, rtol=0, atol=200 * 5 * U, err_msg=method)
    last, counts = in_a_world(system, y, both, (41,))
    np.testing.assert_array_equal(last, sw.integrate(system, "rk4", y=y, events=both, **WAYS[0][1]).y[-1])
    assert all((count == 5).all() for count in counts.values())


def bounces(i: int) -> sw.Event:
    return sw.Event(
        lambda t, v, y: y[i],
        direction=-1,
        then=lambda t, v, y: (np.array([-v[j] if j == i else v[j] for j in range(2)]), y),
        name=f"ground{i}",
    )


@pytest.mark.parametrize(("method", "steps"), WAYS)
def test_two_balls_bounce_together(method: str, steps: dict[str, Any]) -> None:
    """From 1 and one unit in the last place above: one of them fell through the ground. They bounce at √(2/g)·(2k + 1)."""
    balls = sw.system(shape=(2,))(lambda t, v, y: -GRAVITY + 0.0 * y)()
    run = sw.integrate(balls, method, v=np.zeros(2), y=np.array([1.0, 1.0 + 2.0 * U]), events=[bounces(0), bounces(1)], **steps)
    fall = (2.0 / GRAVITY) ** 0.5
    expected = fall * np.arange(1, 2 * int((5.0 / fall - 1.0) / 2.0) + 2, 2)
    for i in range(2):
        # y is off by the roundings of at most 100 steps a bounce, of numbers up to 5; it passes the ground at 4.4.
        np.testing.assert_allclose(run.events[f"ground{i}"].t, expected, rtol=0, atol=6 * 100 * 5 * U, err_msg=method)
    assert (run.y > -1e-12).all()


DRIFT = pair(lambda t, x: np.array([1.0, 0.1]) + 0.0 * x)
PUSHES = sw.Event(lambda t, x: x[0] - 1.0, direction=1, then=lambda t, x: np.array([x[0], x[1] + 5.0]), name="a")


def pushed(**options: Any) -> sw.Event:
    return sw.Event(lambda t, x: x[1] - 1.0, name="b", **options)


@BACKENDS
def test_an_event_that_another_pushes_over_zero_occurs(backend: Any) -> None:
    """At t = 1 the first adds 5 to x₁, which is at 1/10 then: past 1, where the second is."""
    sets = pushed(direction=1, then=lambda t, x: np.array([x[0], 0.0]))
    for method, steps in OF_FIRST_ORDER:
        for second, last, stops in (
            (pushed(), [5.0, 5.5], np.nan),
            (pushed(direction=1), [5.0, 5.5], np.nan),
            (sets, [5.0, 0.4], np.nan),
            (pushed(direction=1, terminal=True), [1.0, 5.1], 1.0),
        ):
            for events in ([PUSHES, second], [second, PUSHES]):
                run = sw.integrate(DRIFT, method, y=np.zeros(2), events=events, backend=backend, **steps)
                assert [each.count for each in run.events.values()] == [1, 1]
                # Some 100 roundings of numbers up to 5.
                np.testing.assert_allclose(run.events["b"].t, 1.0, rtol=0, atol=100 * 5 * U)
                np.testing.assert_allclose(run.events["b"].y, [[1.0, 5.1]], rtol=0, atol=100 * 5 * U)
                np.testing.assert_allclose(run.y[-1], last, rtol=0, atol=100 * 5 * U)
                np.testing.assert_allclose(run.stopped_at, stops, rtol=0, atol=100 * 5 * U)
        other_way = sw.integrate(DRIFT, method, y=np.zeros(2), events=[PUSHES, pushed(direction=-1)], backend=backend, **steps)
        assert other_way.events["b"].count == 0
    last, counts = in_a_world(DRIFT, np.zeros(2), [PUSHES, sets])
    assert counts == {"a": 1, "b": 1}
    np.testing.assert_allclose(last, [5.0, 0.4], rtol=0, atol=100 * 5 * U)


def test_what_lands_on_zero_occurs_and_what_comes_from_it_does_not() -> None:
    """The push ends exactly where the second event is; and then begins just there, so that it leaves it."""
    lands = sw.Event(PUSHES.function, direction=1, then=lambda t, x: np.array([x[0], 1.0]), name="a")
    for method, steps in OF_FIRST_ORDER:
        run = sw.integrate(DRIFT, method, y=np.zeros(2), events=[lands, pushed()], **steps)
        assert run.events["b"].count == 1
        leaves = sw.integrate(DRIFT, method, y=np.array([0.0, 1.0]), events=[PUSHES, pushed()], **steps)
        assert leaves.events["b"].count == 0


def spikes(i: int, strength: float) -> sw.Event:
    """A neuron that fires at 1 begins at 0 again, and pushes the other one."""

    def fire(t: Any, x: Any) -> Any:
        return np.array([0.0 if j == i else x[j] + strength for j in range(2)])

    return sw.Event(lambda t, x: x[i] - 1.0, direction=1, then=fire, name=f"spike{i}")


def neurons(x: list[float], strength: float, end: float) -> tuple[list[int], list[float]]:
    """How often two neurons of ẋ = 2 − x fire, and where they are, from one spike to the next by a closed form."""
    counts, t = [0, 0], 0.0
    while True:
        wait = min(math.log(2.0 - each) for each in x)
        decay = math.exp(-min(wait, end - t))
        x, t = [2.0 - (2.0 - each) * decay for each in x], t + wait
        if t > end:
            return counts, x
        fires = {max(range(2), key=lambda i: x[i])}
        while fires:
            i = min(fires)
            fires = {j for j in fires if j != i}
            counts[i] += 1
            below = x[1 - i] < 1.0
            x[i], x[1 - i] = 0.0, x[1 - i] + strength
            fires |= {1 - i} if below and x[1 - i] >= 1.0 else set()


def test_neurons_that_push_each_other_fire_together() -> None:
    """The first spike that takes the other along makes them one; before, the other stayed above 1 and never fired again."""
    system = pair(lambda t, x: 2.0 - x)
    counts, last = neurons([0.0, 0.5], 0.2, 5.0)
    assert min(counts) > 6
    for method, steps in OF_FIRST_ORDER:
        run = sw.integrate(system, method, y=np.array([0.0, 0.5]), events=[spikes(0, 0.2), spikes(1, 0.2)], **steps)
        assert [each.count for each in run.events.values()] == counts, method
        # RK4 errs by 0.3125⁵/120 < 3e-5 a step, the others by 1e-9; spikes are late by what those before are.
        np.testing.assert_allclose(run.y[-1], last, rtol=0, atol=2e-3 if method == "rk4" else 1e-6, err_msg=method)


@BACKENDS
def test_events_that_set_each_other_off_without_end_are_named(backend: Any) -> None:
    """A member that reaches them is at rest then; its neighbour, which does not, has the bits that it has alone."""
    circle = [
        sw.Event(lambda t, x: x[0] - 1.0, direction=1, then=lambda t, x: np.array([x[0] - 3.0, x[1] + 3.0]), name="a"),
        sw.Event(lambda t, x: x[1] - 1.0, direction=1, then=lambda t, x: np.array([x[0] + 3.0, x[1] - 3.0]), name="b"),
    ]
    for method, steps in OF_FIRST_ORDER:
        with pytest.warns(sw.EventWarning, match="1 of 2 members .* event b: member 0.*: events a, b set each other off"):
            run = sw.integrate(DRIFT, method, y=np.array([[0.0, -9.0], [0.0, 0.0]]), events=circle, backend=backend, **steps)
        assert run.status.tolist() == [sw.Status.REST, sw.Status.OK]
        np.testing.assert_allclose(run.stopped_at, [1.0, np.nan], rtol=0, atol=100 * U)
        alone = sw.integrate(DRIFT, method, y=np.array([-9.0, 0.0]), events=circle, backend=backend, **steps)
        np.testing.assert_array_equal(run.y[..., 1], alone.y)
    last, _ = in_a_world(DRIFT, [[0.0, -9.0], [0.0, 0.0]], circle, (2,))
    np.testing.assert_allclose(last[:, 0], [1.0, 0.1], rtol=0, atol=100 * 5 * U)
    np.testing.assert_allclose(last[:, 1], [-4.0, 0.5], rtol=0, atol=100 * 5 * U)


def test_terminal_events_at_an_instant_stop_in_the_order_of_the_list() -> None:
    """What stands before it in the list happens first; what stands behind it is counted, and changes nothing."""
    change = sw.Event(lambda t, x: x[0] - 1.0, direction=1, then=lambda t, x: np.array([0.0, x[1]]), name="change")
    stop = sw.Event(lambda t, x: x[0] - 1.0, direction=1, terminal=True, name="stop")
    for method, steps in OF_FIRST_ORDER:
        for events, last in (([change, stop], 0.0), ([stop, change], 1.0)):
            run = sw.integrate(DRIFT, method, y=np.zeros(2), events=events, **steps)
            assert run.status == sw.Status.EVENT
            assert [each.count for each in run.events.values()] == [1, 1]
            np.testing.assert_allclose(run.y[-1], [last, 0.1], rtol=0, atol=100 * U)


@pytest.mark.parametrize(("method", "steps"), OF_FIRST_ORDER)
def test_what_is_past_zero_where_a_terminal_event_stops_is_counted(method: str, steps: dict[str, Any]) -> None:
    """Two events of one number: whatever the roundings are by which one is located before the other."""
    y = np.stack([np.full(41, 0.25), 0.25 + np.arange(-20, 21) * 2.0**-54])
    stop = sw.Event(lambda t, y: y[0] - 1.0, terminal=True, name="stop")
    other = sw.Event(lambda t, y: y[1] - 1.0, name="other")
    run = sw.integrate(pair(lambda t, y: 1.0 + 0.0 * y), method, y=y, events=[other, stop], **steps)
    np.testing.assert_array_equal(run.events["other"].count, (run.y[-1][1] >= 1.0).astype(int))


# A change of the state that leaves g at zero.
def emptied(direction: int = -1) -> sw.Event:
    return sw.Event(lambda t, h: h, direction=direction, then=lambda t, h: np.maximum(h, 0.0), name="empty")


#: Without ``taylor``, whose series knows no choices between values.
CHOOSING = [each for each in OF_FIRST_ORDER if each[0] != "taylor"]


@BACKENDS
@pytest.mark.parametrize("direction", [-1, 0])
def test_a_tank_that_is_left_empty_does_not_empty_again(backend: Any, direction: int) -> None:
    """ḣ = −√h from 1 is empty at 2, and stays so without a rate; an inflow of 1 from 3 on fills it.

    The root is not smooth at zero: the step of RK4 that ends there errs by some hundredths, and so does the one that fills it.
    """
    tank = sw.system(order=1)(lambda t, h, *, begin=3.0: np.where(t >= begin, 1.0, 0.0) - np.sqrt(np.maximum(h, 0.0)))
    begin = np.array([9.0, 3.0])
    for method, steps in CHOOSING if backend == "rust" else CHOOSING[:2]:
        run = sw.integrate(tank(begin=begin), method, y=np.ones(2), events=emptied(direction), backend=backend, **steps)
        assert run.events["empty"].count.tolist() == [1, 1]
        np.testing.assert_allclose(run.events["empty"].t, 2.0, rtol=0, atol=0.1 if method == "rk4" else 1e-4)
        assert (run.status == sw.Status.OK).all()
        # From empty: 2·(−√h − ln(1 − √h)) is the time since; 2 of it are h = 0.707963.
        np.testing.assert_allclose(run.y[-1], [0.0, 0.7079634], rtol=0, atol=2e-2 if method == "rk4" else 1e-4)
    last, counts = in_a_world(tank(begin=begin), np.ones(2), [emptied(direction)], (2,))
    assert counts["empty"].tolist() == [1, 1]
    np.testing.assert_array_equal(
        last, sw.integrate(tank(begin=begin), "rk4", y=np.ones(2), events=emptied(), **WAYS[0][1]).y[-1]
    )


@pytest.mark.parametrize(
    ("method", "steps"),
    [("rk4", {"dt": 0.0625, "steps": 80}), ("dop853", WAYS[2][1]), ("merson", {"tolerance": 1e-6, "at": [5.0]})],
)
def test_a_sticky_wall_stops_a_point_once(method: str, steps: dict[str, Any]) -> None:
    wall = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (0.0 * v, 0.0 * y), name="wall")
    free = sw.system(lambda t, v, y: 0.0 * y)()
    run = sw.integrate(free, method, v=-1.0, y=1.0, events=wall, **steps)
    assert run.events["wall"].count == 1
    assert run.y[-1] == 0.0
    v, y = np.array([-1.0, -2.0]), np.array([1.0, 1.0])
    world, counts = sw.World(free, "rk4", v=v, y=y, dt=0.0625, events=wall), np.zeros(2)
    for _ in range(80):
        world.step()
        counts += world.events["wall"].count
    assert counts.tolist() == [1, 1]
    assert (y == 0.0).all()


#: Outflows begin, and inflows after them: within a step of each way, and at the end of one.
PUMPED = sw.system(order=1)(
    lambda t, h, *, out=1.0, into=3.0, end=9.0: np.where(t >= out, -1.0, 0.0) + np.where((t >= into) & (t < end), 2.0, 0.0)
)


@BACKENDS
def test_what_holds_a_member_lets_it_go_when_the_motion_leads_away(backend: Any) -> None:
    """Empty from the start or later, held while it flows out, and filled at a net rate of 1 from ``into`` to ``end``."""
    out, into, end, y = (
        np.array([0.0, 0.0, 1.0, 1.1, 0.0, 0.0, 2.5]),
        np.array([3.0, 3.125, 3.0, 3.3, 9.0, 2.5, 9.0]),
        np.array([9.0, 9.0, 9.0, 9.0, 9.0, 3.5, 9.0]),
        np.array([1.0, 0.0, 0.0, 0.0, 0.5, 0.7, 0.0]),
    )
    expected = [2.0, 1.875, 2.0, 1.7, 0.0, 0.0, 0.0]
    rests = [False, False, False, False, True, True, True]
    for method, steps in CHOOSING:
        ask: dict[str, Any] = {"y": y, "events": emptied(), "backend": backend, **steps}
        with pytest.warns(sw.EventWarning, match="3 of 7 members came to rest at event empty"):
            run = sw.integrate(PUMPED(out=out, into=into, end=end), method, **ask)
        # Rates are constant between switches: some 100 roundings of numbers up to 5; a step across a switch errs by 2/6 of RK4's.
        for i in range(7):
            one = PUMPED(out=out[i], into=into[i], end=end[i])
            assert abs(run.y[-1][i] - expected[i]) < (1e-12 if i in (4, 5, 6) else 1e-7), (method, i)
            if not rests[i] and backend == "rust":
                alone = sw.integrate(one, method, **ask | {"y": y[i]})
                np.testing.assert_array_equal(alone.y, run.y[..., i])
        np.testing.assert_array_equal(run.status == sw.Status.REST, rests)
    with pytest.warns(sw.EventWarning):
        run = sw.integrate(PUMPED(out=out, into=into, end=end), "rk4", y=y, events=emptied(), **WAYS[0][1])
    last, counts = in_a_world(PUMPED(out=out, into=into, end=end), y, [emptied()], (7,))
    np.testing.assert_array_equal(last, run.y[-1])
    np.testing.assert_array_equal(counts["empty"], run.events["empty"].count)


@pytest.mark.parametrize("method", ["fehlberg", "merson", "dop853", "rodas5p", "taylor"])
def test_two_zeros_in_a_step_of_a_quantity_that_bends_are_found(method: str) -> None:
    """At constant rates steps are as long as they may be: (x − a)(b − x) of random windows, and the distance of fly-bys."""
    rng = np.random.default_rng(0)
    a, width = rng.uniform(0.1, 9.0, 400), 10.0 ** rng.uniform(-4.0, -0.5, 400)
    way = sw.system(order=1)(lambda t, x, *, a=0.0, b=0.0: 1.0 + 0.0 * x)(a=a, b=a + width)
    window = sw.Event(lambda t, x, *, a, b: (x - a) * (b - x), name="window")
    adapted: dict[str, Any] = {"tolerance": 1e-6, "at": [10.0]}
    run = sw.integrate(way, method, y=np.zeros(400), events=window, **adapted)
    np.testing.assert_array_equal(run.events["window"].count, 2)
    # x is off by some 20 roundings of numbers up to 10; it passes both sides at a rate of the width or more.
    expected = np.stack([a, a + width], -1)
    assert (np.abs(run.events["window"].t.reshape(-1, 2) - expected) < 20 * 10 * U * 10.0 / width[:, np.newaxis]).all()
    passes = sw.Event(lambda t, v, y: np.sqrt(y[0] * y[0] + y[1] * y[1]) - 1.0, name="passes")
    by = np.linspace(-1.2, 1.2, 200)
    start = {"v": np.stack([np.ones(200), np.zeros(200)]), "y": np.stack([np.full(200, -4.3), by])}
    run = sw.integrate(sw.system(shape=(2,))(lambda t, v, y: 0.0 * y)(), method, **start, events=passes, **adapted)
    np.testing.assert_array_equal(run.events["passes"].count, np.where(np.abs(by) < 1.0, 2, 0))


# Events of the time alone.
EVERY_WAY = [*WAYS, ("rk4", {"dt": 5.0, "steps": 1})]
DECAY = sw.system(order=1)(lambda t, c, *, rate=0.3: -rate * c)


def above_a_half(t: Any, c: Any) -> Any:
    return np.sin(t) - 0.5


@BACKENDS
def test_zeros_of_the_time_alone_are_all_found(backend: Any) -> None:
    """sin t rises above 1/2 sixteen times to t = 100, whatever moves, and however long the steps are."""
    rises = sw.Event(above_a_half, direction=1, name="rises")
    expected = np.pi / 6.0 + 2.0 * np.pi * np.arange(16)
    fixed, adapted = {"dt": 6.25, "steps": 16}, {"tolerance": 1e-6, "at": [100.0]}
    for (method, steps), rate in itertools.product((("rk4", fixed), ("dop853", adapted), ("taylor", adapted)), (0.0, 0.01)):
        run = sw.integrate(DECAY(rate=rate), method, y=1.0, events=rises, backend=backend, **steps)
        # The time at which np.sin passes 1/2: a rounding of the sine, at a slope of 0.87, and one of the time.
        np.testing.assert_allclose(run.events["rises"].t, expected, rtol=0, atol=3 * 100 * U)
        np.testing.assert_allclose(run.events["rises"].y, np.exp(-rate * expected), rtol=1e-5)
        back = sw.integrate(DECAY(rate=rate), method, y=1.0, t0=100.0, events=rises, backend=backend, **backward(steps))
        np.testing.assert_allclose(back.events["rises"].t, (5.0 * np.pi / 6.0 + 2.0 * np.pi * np.arange(16))[::-1], rtol=1e-14)


def backward(steps: dict[str, Any]) -> dict[str, Any]:
    return steps | ({"dt": -steps["dt"]} if "dt" in steps else {"at": [0.0]})


def test_zeros_of_the_time_alone_are_those_of_each_member() -> None:
    """With parameters, two factors, a jump, and where they are not solved for: a sum of two waves is looked for in steps."""
    omega = np.array([1.0, 2.0, 3.0])
    waves = sw.system(order=1)(lambda t, c, *, omega=1.0: 0.0 * c * omega)(omega=omega)
    for g, expected in (
        (lambda t, c, *, omega: np.cos(omega * t), [np.pi * (np.arange(0.5, 5.0 * each / np.pi)) / each for each in omega]),
        (lambda t, c, *, omega: (t - omega) * (t - 4.5), [np.sort([each, 4.5]) for each in omega]),
        (lambda t, c, *, omega: t % omega - 0.5 * omega, [each * np.arange(1, 10.0 // each + 1) / 2.0 for each in omega]),
        (lambda t, c, *, omega: t * t - np.sqrt(t) + omega - 3.0, [[1.8311772], [1.4902161], [1.0]]),
    ):
        for method, steps in (("rk4", {"dt": 0.25, "steps": 20}), ("dop853", {"tolerance": 1e-6, "at": [5.0], "max_step": 0.25})):
            run = sw.integrate(waves, method, y=np.ones(3), events=sw.Event(g, name="g"), **steps)
            for i in range(3):
                times = run.events["g"].of(i).t
                right = np.asarray(expected[i])[: len(times)]
                np.testing.assert_allclose(times, right, rtol=0, atol=1e-6, err_msg=f"{method}, {i}")
                assert len(times) == len([each for each in expected[i] if each <= 5.0])


def doses(period: float, rate: float, end: float) -> float:
    """What is left at the end of doses of one from t = 1 on."""
    times = np.arange(1.0, end + 1e-9, period)
    return float(np.exp(-rate * (end - times)).sum())


@BACKENDS
@pytest.mark.parametrize(("method", "steps"), [each for each in EVERY_WAY if each[0] != "verlet"])
def test_doses_are_given_at_their_times(method: str, steps: dict[str, Any], backend: Any) -> None:
    """Every 0.7 or 1.25 from 1 on, for each member, exactly then; fixed steps are cut there, however long they are."""
    dose = sw.Event(times=1.0, period=[0.7, 1.25], then=lambda t, c: c + 1.0, name="dose")
    run = sw.integrate(DECAY(), method, y=np.zeros(2), events=dose, backend=backend, **steps)
    assert run.events["dose"].count.tolist() == [6, 4]
    np.testing.assert_array_equal(run.events["dose"].of(1).t, [1.0, 2.25, 3.5, 4.75])
    # RK4 errs by (0.3·h)⁵/120 of what is there, in pieces of 1.25 or less.
    np.testing.assert_allclose(
        run.y[-1], [doses(period, 0.3, 5.0) for period in (0.7, 1.25)], rtol=1e-3 if "dt" in steps else 1e-7
    )
    several = np.array([[0.5, 5.0], [2.0, np.nan], [4.0, 1.0]])
    once = sw.Event(times=several, terminal=2, name="second")
    run = sw.integrate(DECAY(), method, y=np.ones(2), events=[once], backend=backend, **steps)
    np.testing.assert_array_equal(run.stopped_at, [2.0, 5.0])
    np.testing.assert_array_equal(run.events["second"].of(1).t, [1.0, 5.0])
    # Nothing at the start, which is the state that is given.
    assert sw.integrate(DECAY(), method, y=0.0, events=sw.Event(times=[0.0, 5.0]), **steps).events["times"].t.tolist() == [5.0]


def test_doses_in_worlds_and_in_pieces_are_those_of_a_run() -> None:
    dose = sw.Event(times=0.3, period=0.9, then=lambda t, c: c + 1.0, name="dose")
    rises = sw.Event(lambda t, c: np.sin(7.0 * t), direction=1, name="rises")
    run = sw.integrate(DECAY(), "rk4", y=np.zeros(2), dt=0.25, steps=20, events=[dose, rises], every=1)
    y, times = np.zeros(2), []
    world = sw.World(DECAY(), "rk4", v=np.zeros((0, 2)), y=y, dt=0.25, events=[dose, rises])
    for k in range(20):
        world.step()
        np.testing.assert_array_equal(y, run.y[k + 1])
        times += world.events["rises"].of(0).t.tolist()
    assert times == run.events["rises"].of(0).t.tolist()
    # Times are known for some thousand steps, and then for the next.
    run = sw.integrate(DECAY(), "rk4", y=np.zeros(2), dt=0.25, steps=2500, events=[dose, rises])
    y[...], heard = 0.0, 0
    world = sw.World(DECAY(), "rk4", v=np.zeros((0, 2)), y=y, dt=0.25, events=[dose, rises])
    for n in (1000, 100, 1400):
        world.step(n)
        heard += world.events["dose"].count
    np.testing.assert_array_equal(y, run.y[-1])
    np.testing.assert_array_equal(heard, run.events["dose"].count)
    for method, first, second in (
        ("rk4", {"dt": 0.25, "steps": 6}, {"steps": 14}),
        ("merson", {"tolerance": 1e-6, "at": [1.2]}, {"at": [5.0]}),
    ):
        head = sw.integrate(DECAY(), method, y=1.0, events=rises, **first)
        tail = sw.integrate(DECAY(), method, resume=head, events=rises, **second)
        whole = sw.integrate(
            DECAY(), method, y=1.0, events=rises, **first | ({"steps": 20} if "steps" in first else {"at": [5.0]})
        )
        pieces = np.concatenate([each.events["rises"].t for each in (head, tail)])
        np.testing.assert_array_equal(pieces, whole.events["rises"].t)


def test_times_beside_other_events_and_many_members() -> None:
    """A dose at the time at which a neuron fires; and where the core notices changes of sign, of a hundred members."""
    charge = sw.system(order=1)(lambda t, y: 1.0 + 0.0 * y)()
    dose = sw.Event(times=2.0, then=lambda t, y: y + 0.25, name="dose")
    fires = sw.Event(lambda t, y: y - 1.0, direction=1, then=lambda t, y: 0.0 * y, name="fires")
    for method, steps in OF_FIRST_ORDER:
        for events in ([dose, fires], [fires, dose]):
            run = sw.integrate(charge, method, y=0.0, events=events, **steps)
            assert run.events["dose"].t.tolist() == [2.0]
            assert run.events["fires"].count in (4, 5)
            assert (run.y <= 1.0 + 100 * U).all()
    y = np.linspace(1.0, 2.0, 100)
    steps = {"dt": 0.1, "steps": 300}
    events = [sw.Event(times=[0.05, 17.0], name="times"), sw.Event(lambda t, c: c - 0.5, name="half")]
    run = sw.integrate(DECAY(), "rk4", y=y, events=events, **steps)
    assert (run.events["times"].count == 2).all()
    assert (run.events["half"].count == 1).all()
    np.testing.assert_array_equal(run.y, sw.integrate(DECAY(), "rk4", y=y, **steps).y)


def test_wrong_times() -> None:
    def never(t: Any, c: Any) -> Any:
        return c

    for options, message in (
        ({}, "expected either a function g.* or the times of the event, got neither"),
        ({"function": never, "times": 1.0}, "got both"),
        ({"function": never, "period": 1.0}, "period: goes with times="),
        ({"times": [1.0, np.inf]}, "times: expected finite times"),
        ({"times": np.nan}, "times: expected finite times"),
        ({"times": 1.0, "period": 0.0}, "period: expected numbers above zero"),
        ({"times": 1.0, "direction": 1}, "direction: listed times have none"),
        ({"times": "noon"}, "times: expected real numbers"),
    ):
        with pytest.raises(sw.errors.ArgumentError, match=message):
            sw.Event(**options)
    with pytest.raises(sw.errors.ArgumentError, match=r"events: times: times: expected axes .* batch \(2,\), got shape \(1, 3\)"):
        sw.integrate(DECAY(), "rk4", y=np.zeros(2), dt=0.1, steps=3, events=sw.Event(times=[[1.0, 2.0, 3.0]]))
    often = sw.Event(lambda t, c: np.sin(1e5 * t), name="often")
    with pytest.raises(sw.errors.TooLargeError, match="events: often: changes its sign too often"):
        sw.integrate(DECAY(), "rk4", y=0.0, dt=1.0, steps=200, events=often)


def test_changes_without_end_that_follow_no_series_end_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """A point between a floor and a ceiling that falls on it at t = 1: it meets each of them ever more often."""
    for module in (resets_of_events, adaptive):
        monkeypatch.setattr(module, "MOST_IN_A_STEP", 20)
    monkeypatch.setattr(adaptive, "RECENT", 2.0**-6)
    floor = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-v, y), name="floor")
    ceiling = sw.Event(lambda t, v, y: y - (1.0 - t), direction=1, then=lambda t, v, y: (-v - 2.0, y), name="ceiling")
    free = sw.system(lambda t, v, y: 0.0 * y)()
    for method, steps in (("rk4", {"dt": 0.05, "steps": 40}), ("dop853", {"tolerance": 1e-8, "at": [2.0]})):
        with pytest.warns(
            sw.EventWarning, match=r"(floor|ceiling), at t = 0\.\d*: its state was changed more than 20 times since"
        ):
            run = sw.integrate(free, method, v=1.0, y=0.5, events=[floor, ceiling], **steps)
        assert run.status == sw.Status.REST
        assert 0.0 <= run.y[-1] <= 1.0 - run.stopped_at + 1e-9


@BACKENDS
def test_what_is_held_meets_known_times(backend: Any) -> None:
    """Three tanks that drain at 1 are filled twice; a dose of nothing and a look change nothing."""
    drained = sw.system(order=1)(lambda t, h: -1.0 + 0.0 * h)()
    fill = sw.Event(times=[2.0, 3.1], then=lambda t, h: h + 0.5, name="fill")
    nothing = sw.Event(times=[1.5, 2.2], then=lambda t, h: h + 0.0, name="nothing")
    look = sw.Event(times=[1.7, 2.9], name="look")
    y, events = np.array([1.0, 0.3, 0.0]), [emptied(), fill, nothing, look]
    for method, steps in OF_FIRST_ORDER:
        with pytest.warns(sw.EventWarning, match="3 of 3 members came to rest at event empty"):
            run = sw.integrate(drained, method, y=y, events=events, backend=backend, **steps)
        np.testing.assert_allclose(run.stopped_at, 3.6, rtol=0, atol=100 * 5 * U)
        assert run.events["empty"].count.tolist() == [3, 3, 2]
        for name, count in (("fill", 2), ("nothing", 2), ("look", 2)):
            assert (run.events[name].count == count).all()
    last, counts = in_a_world(drained, y, events, (3,))
    assert (last == 0.0).all()
    for name, count in counts.items():
        np.testing.assert_array_equal(count, run.events[name].count)


def assert_times(run: sw.Run, name: str, times: Any) -> None:
    """Those up to the end of the run."""
    known = times[times < run.t[-1]]
    np.testing.assert_allclose(run.events[name].t, known, rtol=0, atol=2e-7 if run.paces is None else 3e-8)


@pytest.mark.parametrize(
    ("method", "backend", "end"),
    [*((method, "rust", 20.0) for method in ("rk4", "dop853", "merson")), ("rk4", "numpy", 8.0), ("dop853", "numpy", 8.0)],
)
def test_modes_are_numbers_without_a_rate(method: str, backend: Any, end: float) -> None:
    """A block that is pulled at 1/10 and sticks up to 3/10, slides against 1/5: it slides for 3π/2, and sticks for 2.

    A thermostat between 0.8 and 1.2, with −T + 2 while it heats: ln 1.5 each way; whose switch acts 1/4 later: the temperature
    goes on to 2 − 0.8·e^(−1/4), and 1.2·e^(−1/4) lower. A neuron that waits for 1/2 after a spike: 1/2 + ln 2 for a push of 2.
    """

    steps: dict[str, Any] = {"tolerance": 1e-10, "at": [end]}
    if method == "rk4":
        steps = {"dt": 0.03125, "steps": round(end / 0.03125)}

    def made(system: Any, y: Any, events: list[sw.Event]) -> sw.Run:
        return sw.integrate(system(), method, y=y, events=events, backend=backend, **steps)

    slides = sw.system(order=1)(lambda t, y: [y[1], np.where(y[2] > 0.5, 0.1 * t - y[0] - 0.2, 0.0), 0.0])
    breaks = sw.Event(
        lambda t, y: np.where(y[2] > 0.5, -1.0, 0.1 * t - y[0] - 0.3), direction=1, then=lambda t, y: [y[0], y[1], 1.0]
    )
    sticks = sw.Event(
        lambda t, y: np.where(y[2] > 0.5, y[1], -1.0), direction=-1, then=lambda t, y: [y[0], 0.0, 0.0], name="sticks"
    )
    assert_times(made(slides, np.zeros(3), [breaks, sticks]), "sticks", 3.0 + 1.5 * np.pi + (2.0 + 1.5 * np.pi) * np.arange(2))

    heats = sw.system(order=1)(lambda t, y: [np.where(y[1] > 0.5, 2.0, 0.0) - y[0], 0.0])
    on = sw.Event(lambda t, y: y[0] - 0.8, direction=-1, then=lambda t, y: [y[0], 1.0], name="on")
    off = sw.Event(lambda t, y: y[0] - 1.2, direction=1, then=lambda t, y: [y[0], 0.0], name="off")
    assert_times(made(heats, [0.8, 1.0], [on, off]), "off", np.log(1.5) * np.arange(1, 50, 2))

    heats = sw.system(order=1)(lambda t, y: [np.where(y[1] > 0.5, 2.0, 0.0) - y[0], 0.0, 0.0, 0.0])
    on = sw.Event(lambda t, y: y[0] - 0.8, direction=-1, then=lambda t, y: [y[0], y[1], t + 0.25, 1.0], name="on")
    off = sw.Event(lambda t, y: y[0] - 1.2, direction=1, then=lambda t, y: [y[0], y[1], t + 0.25, 0.0], name="off")
    acts = sw.Event(lambda t, y: t - y[2], direction=1, then=lambda t, y: [y[0], y[3], y[2], y[3]], name="acts")
    hottest, coldest = 2.0 - 0.8 * np.exp(-0.25), 0.8 * np.exp(-0.25)
    up, down = np.log((2.0 - coldest) / 0.8), np.log(hottest / 0.8)
    first = np.log(1.2 / 0.8)
    each = first + np.arange(13) * (up + down + 0.5)
    assert_times(made(heats, [0.8, 1.0, 1e3, 1.0], [on, off, acts]), "off", each)

    fires = sw.system(order=1)(lambda t, y: [np.where(y[1] > 0.5, 0.0, 2.0 - y[0]), 0.0, -y[1]])
    spike = sw.Event(lambda t, y: y[0] - 1.0, direction=1, then=lambda t, y: [0.0, 1.0, 0.5], name="spike")
    goes_on = sw.Event(lambda t, y: np.where(y[1] > 0.5, y[2], -1.0), direction=-1, then=lambda t, y: [y[0], 0.0, 0.0])
    assert_times(made(fires, np.zeros(3), [spike, goes_on]), "spike", np.log(2.0) + (0.5 + np.log(2.0)) * np.arange(17))


@BACKENDS
@pytest.mark.parametrize(("method", "steps"), [("rk4", {"dt": 0.5, "steps": 4}), ("dop853", {"tolerance": 1e-8, "at": [2.0]})])
def test_conditions_are_events_where_they_change(backend: Any, method: str, steps: dict[str, Any]) -> None:
    moves = sw.system(order=1, shape=(2,))(lambda t, y: [1.0, 0.1])()
    conditions: dict[str, tuple[Any, list[float]]] = {
        "window": (lambda t, y: (y[0] > 0.18) & (y[0] < 0.19), [0.18, 0.19]),
        "neither": (lambda t, y: ~((y[0] < 0.18) | (y[0] >= 0.19)), [0.18, 0.19]),
        "either": (lambda t, y: (y[0] < 0.3) | (y[1] >= 0.15), [0.3, 1.5]),
        "one": (lambda t, y: y[0] > 1.25, [1.25]),
        "one of two": (lambda t, y: (y[0] > 0.6) ^ (y[1] > 0.12), [0.6, 1.2]),
        "all": (lambda t, y: np.all(y > 0.1), [1.0]),
        "known": (lambda t, y: (y[0] > 0.4) & True & ((t < 9.0) | False), [0.4]),
    }
    for direction in (0, 1, -1):
        events = [sw.Event(function, direction=direction, name=name) for name, (function, _) in conditions.items()]
        run = sw.integrate(moves, method, y=np.zeros(2), events=events, backend=backend, **steps)
        for name, (_, times) in conditions.items():
            expected = times if direction == 0 else times[(direction == -1) != (name == "either") :: 2]
            np.testing.assert_allclose(run.events[name].t, expected, rtol=0, atol=1e-12, err_msg=f"{name} {direction}")
    for wrong in (lambda t, y: y[0] == 0.3, lambda t, y: (y[0] < 0.3) & (y[1] != 2.0)):
        with pytest.raises(sw.errors.TraceError, match=r"expected comparisons by <, <=, > and >=, joined by &, \| and ~"):
            sw.integrate(moves, method, y=np.zeros(2), events=wrong, **steps)
