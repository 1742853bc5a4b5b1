"""Events that change the state: the core follows each member by itself, as the reference follows all of them together."""

import itertools
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.reference import events as reference_events
from stepwell.runs.events import adaptive, driver
from support.own_methods import adams_bashforth_2
from support.ways import assert_same_run

#: Events of two coordinates: resets, a floor of an empty tank, an exchange, a kick, one that only is noted, one that stops.
OF_COORDINATES = {
    "spike": lambda: sw.Event(lambda t, y: y[0] - 0.5, direction=1, then=lambda t, y: [y[0] - 1.0, y[1]], name="spike"),
    "zero": lambda: sw.Event(lambda t, y: y[0], direction=-1, then=lambda t, y: [0.0 * y[0], y[1]], name="zero"),
    "tank": lambda: sw.Event(lambda t, y: y[0], direction=-1, then=lambda t, y: [np.maximum(y[0], 0.0), y[1]], name="tank"),
    "swap": lambda: sw.Event(lambda t, y: y[1] - y[0], then=lambda t, y: [y[1], y[0]], name="swap"),
    "flip": lambda: sw.Event(lambda t, y: y[1] + 0.3, then=lambda t, y: [y[0], -y[1]], name="flip"),
    "noted": lambda: sw.Event(lambda t, y: y[1] * y[0] - 0.2, name="noted"),
    "end": lambda: sw.Event(lambda t, y: y[1] - 0.8, terminal=2, name="end"),
    "often": lambda: sw.Event(
        lambda t, y: np.sin(2.0 * t) - 0.3 + 0.1 * y[0], direction=1, then=lambda t, y: [y[0] + 0.5, y[1] - 0.4], name="often"
    ),
    "kick": lambda: sw.Event(lambda t, y: y[0] - 0.5, direction=1, then=lambda t, y: [y[0], y[1] + 1.0], name="kick"),
    "box": lambda: sw.Event(lambda t, y: abs(y[0]) - 1.5, then=lambda t, y: [0.1 * y[0], y[1]], name="box"),
}
#: Events of a place and its velocity: bounces, stops at a wall, a kick where it turns.
OF_A_PLACE = {
    "bounce": lambda: sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-0.8 * v, y), name="bounce"),
    "soft": lambda: sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-0.3 * v, 0.0 * y), name="soft"),
    "stick": lambda: sw.Event(lambda t, v, y: y + 0.2, direction=-1, then=lambda t, v, y: (0.0 * v, y), name="stick"),
    "top": lambda: sw.Event(lambda t, v, y: y - 0.6, direction=1, then=lambda t, v, y: (-v, y), name="top"),
    "turn": lambda: sw.Event(lambda t, v, y: v, then=lambda t, v, y: (v + 0.2, y), name="turn"),
    "noted": lambda: sw.Event(lambda t, v, y: v - 0.1, name="noted"),
    "end": lambda: sw.Event(lambda t, v, y: y - 0.3, terminal=5, name="end"),
}
#: Events at known times: listed ones of all or of each member, with and without a change, some that stop.
KNOWN = {
    "dose": lambda then, n: sw.Event(times=0.3, period=0.4, then=then, name="dose"),
    "each": lambda then, n: sw.Event(times=np.linspace(-0.5, 1.1, 2 * n).reshape(2, n), then=then, name="each"),
    "look": lambda then, n: sw.Event(times=[0.25, 0.1, 1.0, -0.6], name="look"),
    "last": lambda then, n: sw.Event(times=[0.5, -0.5], period=np.linspace(0.1, 0.9, n), terminal=3, name="last"),
}
#: Zeros of the time alone, for a system of first and of second order.
SINES = (
    lambda: sw.Event(lambda t, y: np.sin(5.0 * t) - 0.2, direction=1, then=lambda t, y: [y[0], y[1] - 0.3], name="sine"),
    lambda: sw.Event(lambda t, v, y: np.sin(5.0 * t) - 0.2, direction=-1, then=lambda t, v, y: (v, y + 0.1), name="sine"),
)
#: In this run states are changed again and again in no time, for which the reference takes two minutes.
CHATTERING = (38,)
NONE = np.zeros((2, 2))
ADAPTIVE = ("dop853", "merson", "tsit5", "rodas5p", "taylor")
U = 2.0**-53
METHODS = ("rk4", "standard_heun", "false_euler", "standard_euler", "dop853", "rosenbrock23", "merson")


@sw.system(order=1, shape=(2,))
def linear(t: Any, y: Any, *, a: Any = NONE, b: Any = NONE[0], w: float = 1.0) -> Any:
    return [a[0, 0] * y[0] + a[0, 1] * y[1] + b[0] + 0.3 * np.sin(w * t), a[1, 0] * y[0] + a[1, 1] * y[1] + b[1]]


@sw.system(order=2)
def driven(t: Any, v: Any, y: Any, *, k: float = 1.0, f: float = 0.5, w: float = 1.0) -> Any:
    return -k * y - 0.1 * v + f * np.sin(w * t)


@sw.system(order=2)
def undamped(t: Any, v: Any, y: Any, *, k: float = 1.0, f: float = 0.5, w: float = 1.0) -> Any:
    return -k * y + f * np.sin(w * t)


#: Methods that carry something else than v between steps, or keep more.
CARRYING: tuple[Any, ...] = ("verlet", "leapfrog", adams_bashforth_2)
#: Ways to make such a run with a tolerance.
ADAPTIVE_WAYS: dict[str, dict[str, Any]] = {
    "three times": {"at": [0.7, 1.5, 2.0]},
    "many times": {"at": np.linspace(0.05, 2.0, 24)},
    "back": {"at": [-0.7, -2.0]},
    "two tolerances": {"at": [2.0], "tolerance": (1e-6, 1e-9)},
    "few attempts": {"at": [1.0, 2.0], "max_steps": 15},
    "jumps": {"at": [2.0], "jumps": [0.5, 1.1]},
}


def drawn(
    number: int, backend: str, way: str | None = None, known: bool = False, carrying: Any = None, held: bool = False, **more: Any
) -> sw.Run:
    """A run with one to three of these events, from starts with one decimal place, some of them at an event."""
    system, method, options = drawn_options(number, way, known, carrying, held=held)
    return sw.integrate(system, method, backend=backend, **options, **more)


def drawn_options(
    number: int, way: str | None, known: bool, carrying: Any, members: int | None = None, held: bool = False
) -> tuple[sw.System, str, dict[str, Any]]:
    """Its arguments: with events at known times, if ``known``; ``carrying`` is a method that carries something else than v.

    The drive of a place is an input of samples, the same for all or one of each member, if they are ``held``.
    """
    random = np.random.default_rng([13, number])
    pool = (OF_COORDINATES, OF_A_PLACE)[number % 2]
    events = [pool[name]() for name in random.choice(list(pool), size=random.integers(1, 4), replace=False)]
    n, dt, every = int(random.choice([1, 3, 9])), float(random.choice([0.01, 0.1, 0.3])), random.choice([None, 1, 5])
    n = members or n
    options: Any = {"dt": dt, "steps": int(random.choice([7, 30])), "every": None if every is None else int(every)}
    if known:
        thens = (lambda t, y: [y[0] + 0.5, y[1]]), (lambda t, v, y: (v + 0.5, y))
        more = [SINES[number % 2], *(lambda of=of: of(thens[number % 2], n) for of in KNOWN.values())]
        for each in np.random.default_rng([14, number]).choice(len(more), size=2, replace=False):
            events.insert(int(each) % 2, more[each]())
    w = float(random.choice([0.5, 3.0]))
    if number % 2:
        options |= {"v": np.round(random.normal(size=n), 1), "y": np.round(random.normal(size=n), 1) * (random.random() > 0.2)}
        k, f = float(random.choice([0.0, 1.0, 4.0])), random.choice([0.0, 0.5, 2.0], size=n)
        if held:
            samples = np.round(np.random.default_rng([16, number]).normal(size=(9, n) if number % 4 == 1 else 9), 1)
            f = sw.Sampled(samples, interval=(0.1, 0.37)[number // 4 % 2], start=(0.0, -0.2)[number // 8 % 2])
        system = (driven if carrying is None else undamped)(k=k, f=f, w=w)
    else:
        options |= {"y": np.round(random.normal(size=(2, n)), 1)}
        system = linear(a=np.round(random.normal(size=(2, 2)), 1), b=np.round(random.normal(size=2), 1), w=w)
    of_samples = ADAPTIVE[:-1] if held else ADAPTIVE  # a series has none
    method = str(random.choice(METHODS if way is None else of_samples))
    if way is not None:
        states = {name: options[name] for name in ("v", "y") if name in options}
        options = {**states, "tolerance": 1e-5, **ADAPTIVE_WAYS[way]}
    return system, carrying or method, options | {"events": events}


def check_the_core_follows_as_the_reference_does(
    numbers: Sequence[int], way: str | None = None, known: bool = False, **more: Any
) -> None:
    occurred, rested = 0, 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number in (each for each in numbers if each not in CHATTERING):
            run, reference = (drawn(number, backend, way, known, **more) for backend in ("rust", "numpy"))
            assert_same_run(run, reference)
            assert [str(each) for each in run.findings] == [str(each) for each in reference.findings], number
            occurred += sum(int(each.count.sum()) for each in run.events.values())
            rested += int(np.sum(run.status == sw.Status.REST))
    assert occurred > (3 if way is None else 1) * len(numbers)
    assert rested > 0 or way is not None


@pytest.mark.parametrize("part", range(4))
def test_the_core_follows_as_the_reference_does(part: int) -> None:
    check_the_core_follows_as_the_reference_does(range(16 * part, 16 * part + 16))


@pytest.mark.parametrize("way", [None, "three times", "many times", "back", "jumps"])
def test_with_known_times_too(way: str | None) -> None:
    check_the_core_follows_as_the_reference_does(
        range(100, 132 if way is None else 107) if way != "jumps" else range(140, 150), way, known=True
    )


@pytest.mark.parametrize("way", [None, "three times", "many times", "back", "jumps"])
@pytest.mark.parametrize("more", [{"fused": True}, {"held": True}, {"held": True, "fused": True}], ids=str)
def test_fused_steps_and_sampled_inputs_too(more: dict[str, Any], way: str | None) -> None:
    # Of an adaptive run the samples of each member or of all, at intervals of 0.1 or of 0.37.
    numbers = range(201, 225, 2 if "held" in more else 1) if way is None else (201, 207 if "held" in more else 203)
    check_the_core_follows_as_the_reference_does(numbers, way, **more)


@pytest.mark.parametrize("more", [{}, {"fused": True}, {"known": True}], ids=str)
def test_float32_too(more: dict[str, Any]) -> None:
    check_the_core_follows_as_the_reference_does(range(240, 253), dtype="float32", **more)


@pytest.mark.parametrize(("way", "fused"), [("many times", False), ("back", False), ("jumps", True)])
def test_runs_that_go_on_too(way: str, fused: bool) -> None:
    """From a held step, within which there may be events; and again, where no member has ended."""
    occurred = 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number in range(300, 302 if fused else 304):
            system, method, options = drawn_options(number, way, number % 3 == 0, None)
            state = {name: options.pop(name) for name in ("v", "y") if name in options}
            at, tolerance = options.pop("at"), options.pop("tolerance")
            both: list[list[sw.Run]] = [[], []]
            for backend, runs in zip(("rust", "numpy"), both, strict=True):
                first = {**options, **state, "tolerance": tolerance, "at": [0.013 * at[-1]], "events": None}
                before = sw.integrate(system, method, backend=backend, fused=fused, **first)
                runs += [sw.integrate(system, method, backend=backend, resume=before, at=at, **options)]
                if (runs[0].status == sw.Status.OK).all():
                    again = {name: each for name, each in options.items() if name != "jumps"}
                    runs += [sw.integrate(system, method, backend=backend, resume=runs[0], at=[1.3 * at[-1]], **again)]
            for run, reference in zip(*both, strict=True):
                assert_same_run(run, reference)
                occurred += sum(int(each.count.sum()) for each in run.events.values())
    assert occurred > 4


@pytest.mark.parametrize("method", CARRYING, ids=str)
def test_methods_that_carry_something_else_than_v_too(method: Any) -> None:
    """Drawn runs; and some that come to rest, wait for a push or a kick, and go on."""

    def assert_equal(made: Any) -> sw.Run:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run, reference = map(made, ("rust", "numpy"))
        assert_same_run(run, reference)
        assert [str(each) for each in run.findings] == [str(each) for each in reference.findings]
        return run

    for number, known in itertools.product(range(1, 30, 4 if method == "verlet" else 8), (False, True)):
        assert_equal(lambda backend, of=(number, known): drawn(of[0], backend, None, of[1], method))
    pushed = sw.system(order=2)(lambda t, v, y, *, f=1.0: f * np.sin(t) - 1.0)(f=np.linspace(0.0, 2.0, 5))
    floor = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (np.maximum(v, 0.0), np.maximum(y, 0.0)), name="floor")
    kick = sw.Event(times=1.3, period=1.1, then=lambda t, v, y: (v + 0.9, y), name="kick")
    rested = 0
    for events in ([OF_A_PLACE["bounce"]()], [OF_A_PLACE["soft"]()], [floor, kick], [floor, OF_A_PLACE["top"]()]):
        for dt, every in ((0.3, 1), (0.05, None), (0.1, 3))[: 2 if method == "verlet" else 1]:
            options: Any = {"v": np.zeros(5), "y": np.linspace(0.0, 1.0, 5), "dt": dt, "steps": round(9.0 / dt), "every": every}
            run = assert_equal(lambda backend, o=options, e=events: sw.integrate(pushed, method, events=e, backend=backend, **o))
            rested += int((run.status == sw.Status.REST).sum())
    assert rested > 10


@pytest.mark.parametrize("way", ADAPTIVE_WAYS)
def test_with_a_tolerance_too(way: str) -> None:
    check_the_core_follows_as_the_reference_does(range(20 if way == "three times" else 8), way)


def worlds(number: int, known: bool, carrying: Any) -> list[sw.World]:
    """Two worlds that are made alike, the first with events in the core; a fifth of them have several groups of members."""
    members = 300 if number % 5 == 4 else None
    system, method, options = drawn_options(number, None, known, carrying, members)
    events = [each for each in options["events"] if not each.terminal]
    y = options["y"]
    v = options["v"] if number % 2 else np.zeros((0, y.shape[-1]))
    both = [sw.World(system, method, v=v.copy(), y=y.copy(), dt=options["dt"], events=events) for _ in range(2)]
    both[1]._frames._by_core = False
    return both


def assert_same_state(world: sw.World, v: Any, y: Any) -> None:
    np.testing.assert_array_equal(world.v, v)
    np.testing.assert_array_equal(world.y, y)


@pytest.mark.parametrize("carrying", [None, *CARRYING], ids=str)
def test_worlds_are_runs_in_pieces(carrying: Any) -> None:
    """To the bit; and from a state that is written for all members, runs that begin there."""
    occurred, rested = 0, 0
    drawings = [each for each in range(40) if each not in CHATTERING and (carrying is None or each % 2)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number, known in itertools.product(drawings, (False, True)):
            world, begins, heard = worlds(number, known, carrying)[0], 0, 0
            for pieces in ((1, 2, 0, 1, 7, 1, 3, 7), (1, 1, 8)):
                options = {"dt": world.dt, "start_step": begins, "steps": sum(pieces), "events": world._events, "every": 1}
                run = sw.integrate(world.system, world.method, v=world.v, y=world.y, **options)
                for n in pieces:
                    world.step(n)
                    assert_same_state(world, *(each[world.step_number - begins] for each in (run.v, run.y)))
                    heard += sum(int(each.count.sum()) for each in world.events.values())
                begins, occurred = world.step_number, occurred + sum(int(each.count.sum()) for each in run.events.values())
                rested += int(np.sum(run.status == sw.Status.REST))
                world.y[...] += np.random.default_rng(number).normal(size=world.y.shape)
            assert world._frames._by_core or not world._events
    assert heard > 0
    assert occurred > 10 * len(drawings)
    assert rested > 0


def test_worlds_hear_what_is_written_between_calls() -> None:
    """A state of one member, or a parameter: the core goes on as Python does."""
    occurred = 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number, known in itertools.product((each for each in range(24) if each not in CHATTERING), (False, True)):
            random, both = np.random.default_rng([15, number]), worlds(number, known, None)
            for _ in range(12):
                n, moved, kind = int(random.choice([0, 1, 1, 2, 7])), int(random.integers(both[0].y.shape[-1])), random.random()
                for world in both:
                    if kind < 0.15:
                        world.y[..., moved] = np.round(world.y[..., moved], 1)
                    elif kind < 0.25:
                        world.v[..., moved] = 0.5
                    elif kind < 0.35:
                        world.set(w=float(moved) + 0.5)
                    world.step(n)
                assert_same_state(both[0], both[1].v, both[1].y)
                assert both[0].events == both[1].events, number
                occurred += sum(int(each.count.sum()) for each in both[0].events.values())
    assert occurred > 600


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_a_kick_at_the_end_of_a_step_wakes_what_is_at_rest(backend: Any) -> None:
    """9 · 0.3 is just below 2.7, where the tenth step begins, so that the kick is in it; 3.0 − 0.3 is 2.7."""
    kick = sw.Event(times=2.7, then=lambda t, v, y: (v + 1.0, y), name="kick")
    falls = sw.system(order=2)(lambda t, v, y: -1.0 + 0.0 * y)()
    floor = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (np.maximum(v, 0.0), np.maximum(y, 0.0)), name="floor")
    options: dict[str, Any] = {"v": 0.0, "y": 0.0, "dt": 0.3, "events": [floor, kick]}
    adaptive_steps = {name: each for name, each in options.items() if name != "dt"} | {"tolerance": 1e-9, "at": [3.6]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = sw.integrate(falls, "rk4", steps=12, backend=backend, **options)
        same = sw.integrate(falls, "merson", backend=backend, **adaptive_steps)
    for each in (run, same):
        assert each.events["kick"].t.tolist() == [2.7]
        assert each.y[-1] == pytest.approx(0.9 * (1.0 - 0.45), abs=1e-12)
    if backend == "rust":
        world = sw.World(falls, "rk4", **options | {"v": np.zeros(()), "y": np.zeros(())})
        for _ in range(12):
            world.step()
        assert_same_state(world, run.v[-1], run.y[-1])


def test_no_member_waits_for_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps with events that change the state are the core's, but in float32 by verlet, and of a series that goes on."""
    grouped: list[int] = []
    group = driver._Resetting._group
    monkeypatch.setattr(driver._Resetting, "_group", lambda self, *of: grouped.append(1) or group(self, *of))
    bounce = OF_A_PLACE["bounce"]()
    options: Any = {"v": 0.0, "y": np.linspace(0.1, 1.0, 5), "dt": 0.02, "steps": 100, "events": bounce}
    assert sw.integrate(driven(f=0.0), "rk4", **options).events["bounce"].count.sum() >= 5
    falling = sw.system(order=2)(lambda t, v, y: -1.0 + 0.0 * y)()
    for method in CARRYING:
        assert sw.integrate(falling, method, **options).events["bounce"].count.sum() >= 5
    held = sw.Sampled([0.0, 0.1], interval=0.5)
    of_fused, of_single = {"system": driven(f=0.0), "fused": True}, {"system": falling, "dtype": "float32"}
    for more in (of_fused, of_single, {"system": driven(f=held)}):
        assert sw.integrate(**{"method": "rk4", **options, **more}).events["bounce"].count.sum() >= 4
    assert not grouped
    assert sw.integrate(falling, "verlet", dtype="float32", **options).events["bounce"].count.sum() >= 5
    assert grouped
    looked: list[int] = []
    look = adaptive._Resetting.look
    monkeypatch.setattr(adaptive._Resetting, "look", lambda self, *of, **named: looked.append(1) or look(self, *of, **named))
    options = {"v": 0.0, "y": options["y"], "tolerance": 1e-6, "at": [2.0], "events": bounce}
    for method in ("merson", "taylor"):
        assert sw.integrate(driven(f=0.0), method, **options).events["bounce"].count.sum() >= 5
    for method in ("merson", "taylor"):
        half = sw.integrate(driven(f=0.0), method, **options | {"at": [0.1]})
        assert not looked
        assert sw.integrate(half.system, method, resume=half, at=[2.0], events=bounce).events["bounce"].count.sum() >= 5
    assert looked


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_known_times_within_a_rounding_of_the_ends_of_steps(backend: Any) -> None:
    """9 · 0.3 is below 2.7 and 3 · 0.1 above 0.3. Verlet's v is a difference divided by a length: not one of 4e-16.

    Bound: some 12 steps, whose roundings of y are divided by their length.
    """
    falls = sw.system(order=2)(lambda t, v, y: 0.0 * y - 0.3)()
    for method, (dt, time) in itertools.product(("verlet", "leapfrog", "rk4"), ((0.3, 2.7), (0.1, 0.3), (0.1, 0.6), (0.1, 0.7))):
        kick = sw.Event(times=time, then=lambda t, v, y: (v + 1.0, y), name="kick")
        look = sw.Event(times=time, name="look")
        turn = sw.Event(lambda t, v, y: v + 9.0, then=lambda t, v, y: (v + 0.2, y), name="turn")
        run = sw.integrate(falls, method, v=1.3, y=0.7, dt=dt, steps=12, events=[look, kick, turn], backend=backend)
        end = 12 * dt
        assert [run.events[name].count for name in ("look", "kick", "turn")] == [1, 1, 0]
        assert run.events["look"].v[0] == pytest.approx(1.3 - 0.3 * time, abs=12 * 8 * U / dt)
        assert run.v[-1] == pytest.approx(2.3 - 0.3 * end, abs=12 * 8 * U / dt)
        assert run.y[-1] == pytest.approx(0.7 + 1.3 * end - 0.15 * end**2 + end - time, abs=12 * 8 * U / dt)


def test_a_quantity_that_stays_at_zero_is_not_divided_for_ever() -> None:
    """A place that is set at rest stays through a step of Standard Euler, where its rate of change does not stay zero."""
    looks: list[int] = []
    looked = reference_events.joined

    def joined(several: Any) -> Any:
        together = looked(several)
        looks.append(len(together.of))
        return together

    stick = OF_A_PLACE["stick"]()
    options: Any = {"v": [0.4], "y": [0.0], "dt": 0.3, "steps": 7, "events": stick}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reference_events, "joined", joined)
        reference = sw.integrate(driven(k=4.0, f=0.0), "standard_euler", backend="numpy", **options)
    assert 0 < max(looks) < 100
    assert reference.y[-1, 0] == -0.2  # set at rest within this step, and moved by the next one
    run = sw.integrate(driven(k=4.0, f=0.0), "standard_euler", **options)
    assert np.array_equal(run.y, reference.y)
    assert run.events["stick"].count[0] == reference.events["stick"].count[0] == 1


@pytest.mark.parametrize("method", ["merson", "tsit5", "dop853"])
def test_trials_of_fused_attempts_fuse_what_attempts_do(method: str) -> None:
    """Bodies whose rates say which products are fused: the core's trial is traced, the reference's is not."""
    random = np.random.default_rng(3)
    v, y = random.normal(size=(2, 2, 2, 40))
    system = sw.NBody(masses=[1.0, 0.5], force="logarithmic", G=1.0, softening=0.3)
    event = sw.Event(lambda t, v, y: y[0, 0] - 0.2, terminal=True, name="passed")
    options: Any = {"v": v, "y": y, "tolerance": 1e-3, "at": [2.0], "events": event, "fused": True}
    run, reference = (sw.integrate(system, method, backend=backend, **options) for backend in ("rust", "numpy"))
    assert np.sum(run.events["passed"].count) > 10
    assert_same_run(run, reference)


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_a_series_of_bounces_that_ends_with_a_step_rests_there(backend: Any) -> None:
    """Bounces of a ball with restitution 1/2 that falls from 1/2 end at t = 1 + 2 = 3, where the tenth step of 0.3 ends."""
    falls = sw.system(lambda t, v, y: -1.0 + 0.0 * y)()
    ground = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-0.5 * v, y))
    for dt in (0.3, 0.6, 3.0 / 7.0, np.nextafter(0.3, 0.0), np.nextafter(0.3, 1.0), 0.37):
        with pytest.warns(sw.EventWarning, match="came to rest .* at t = 3:"):
            run = sw.integrate(falls, "rk4", v=0.0, y=0.5, dt=dt, steps=20, events=ground, backend=backend)
        assert abs(run.stopped_at - 3.0) < 1e-9
        assert run.status == sw.Status.REST
        assert abs(run.v[-1]) < 1e-12 > abs(run.y[-1])
        assert ": finite, came to rest at an event>" in repr(run)
    world = sw.World(falls, "rk4", v=np.zeros(2), y=np.array([0.5, 0.7]), dt=0.3, events=ground)
    world.step(20)
    assert (np.abs(world.y) < 1e-12).all()


@pytest.mark.parametrize("backend", ["rust", "numpy"])
@pytest.mark.parametrize("steps", [{"dt": 0.3, "steps": 20}, {"tolerance": 1e-6, "at": [6.0]}])
def test_what_begins_at_an_event_that_turns_nothing_back_goes_through(backend: Any, steps: dict[str, Any]) -> None:
    """At rest on the line and pushed across: a ball on the ground stays, what is damped there, or only counted, falls."""
    falls, method = sw.system(lambda t, v, y: -1.0 + 0.0 * y)(), "rk4" if "dt" in steps else "merson"
    for factor in (0.9, 1.0):
        line = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y, by=factor: (by * v, y), name="line")
        run = sw.integrate(falls, method, v=0.0, y=0.0, events=line, backend=backend, **steps)
        assert (run.status, run.events["line"].count) == (sw.Status.OK, 0)
        np.testing.assert_allclose((run.v[-1], run.y[-1]), (-6.0, -18.0), rtol=1e-12)
    for then in (
        lambda t, v, y: (-0.9 * v, y),
        lambda t, v, y: (np.maximum(v, 0.0), np.maximum(y, 0.0)),
        lambda t, v, y: (0.0 * v, y),
    ):
        ground = sw.Event(lambda t, v, y: y, direction=-1, then=then)
        with pytest.warns(sw.EventWarning, match="came to rest .* at t = 0"):
            run = sw.integrate(falls, method, v=0.0, y=0.0, events=ground, backend=backend, **steps)
        assert (run.v[-1], run.y[-1], run.status) == (0.0, 0.0, sw.Status.REST)
