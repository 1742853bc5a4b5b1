"""Sampled controllers around a system: what they compute, when, and with what they go."""

from __future__ import annotations

import copy
import itertools
import pickle
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, DTypeError, ShapeError, StepwellError, TraceError, UnknownNameError, UnsupportedError
from stepwell.model.controllers import Timing
from stepwell.reference import sampled
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from stepwell.runs.options import Options
from stepwell.runs.request import Request
from support.abroad import Journey, run
from support.export import assert_same as assert_same_bits
from support.export import languages
from support.graphs import assert_one_graph
from support.looped import looped
from support.mistakes import mistaken
from support.own_methods import adams_bashforth_2
from support.ways import assert_equal_ways


@sw.system
def mass(t: Any, v: Any, y: Any, *, u: Any = 0.0) -> Any:
    return u - 0.4 * v


@sw.controller
def limited(t: Any, v: Any, y: Any, total: Any = 0.0, *, gain: Any = 1.0) -> Any:
    error = 1.0 - y
    wanted = gain * error - 1.5 * v + total
    u = np.clip(wanted, -1.0, 1.0)
    return u, np.where(wanted == u, total + 0.01 * error, total)


@sw.controller
def clock(t: Any, v: Any, y: Any, *, factor: Any = 1.0) -> Any:
    return factor * t


@sw.controller
def proportional(t: Any, y: Any, *, gain: Any = 0.8) -> Any:
    return -gain * y[1]


@sw.system
def driven(t: Any, v: Any, y: Any, *, u: Any = 0.1, w: Any = (0.1, 0.2)) -> Any:
    return np.array([u + w[1] - y[0] ** 3, w[0] - 0.1 * v[1] - np.sin(y[1])])


@sw.controller
def several(t: Any, v: Any, y: Any, seen: Any = (0.0, 0.0), k: Any = 1.0, *, gain: Any = 0.5) -> Any:
    return gain * y[0] + seen[1], np.array([k, -k]), y + 0.5 * seen, 0.9 * k + np.sin(t)


GAINS = np.array([0.5, 1.0, 2.0])
#: Periods and delays in steps: results are put out at the sample itself, at later ones, and between two.
TIMES = [(1, 0), (1, 1), (1, 3), (10, 0), (10, 10), (10, 30), (10, 3), (10, 13), (4, 7)]
#: Methods of all kinds that carry v.
METHODS = ["false_euler", "standard_heun", "rk4", "dop853", "taylor", "implicit_midpoint", "rodas4", "rosenbrock23"]
STATE: dict[str, Any] = {"v": np.zeros((2, 3)), "y": np.array([[1.0, 0.5, 0.2], [0.1, 1.0, 2.0]])}


def loop(period: int = 10, delay: int = 0, *, gain: Any = GAINS, system: Any = None) -> sw.System:
    """The mass with its controller, for steps of 0.01."""
    around = limited(gain=gain, period=0.01 * period, delay=0.01 * delay)
    return (mass() if system is None else system).surrounded(around)


def loop_of_two(period: int, delay: int) -> sw.System:
    """One whose controller sets two parameters and has a state of three numbers, for steps of 0.05."""
    return driven().surrounded(several(sets=("u", "w"), gain=GAINS, period=0.05 * period, delay=0.05 * delay))


def linear_loop() -> Any:
    plant = sw.LinearSystem([[-1.0, 0.5], [0.0, -2.0]], [[1.0], [1.0]], [[1.0, 0.0]], x=0.0, velocities=0)
    return plant.surrounded(proportional(sets="x", period=0.1))


def by_hand(period: int, delay: int, steps: int) -> Any:
    """The loop as users write it over a world, with all that is under way; y after each step."""
    v, y, total = (np.zeros(3) for _ in range(3))
    world = sw.World(mass(u=np.zeros(3)), "rk4", v=v, y=y, dt=0.01)
    u = world.parameters["u"]
    late, states = {}, []
    for k in range(steps):
        if k % period == 0:
            error = 1.0 - y
            wanted = GAINS * error - 1.5 * v + total
            late[k + delay] = np.clip(wanted, -1.0, 1.0)
            total += np.where(wanted == late[k + delay], 0.01 * error, 0.0)
        if k in late:
            u[:] = late[k]
        world.step()
        states.append(y.copy())
    return np.array(states)


def run_of(system: sw.System, steps: int = 97, method: Any = "rk4", **options: Any) -> sw.Run:
    return sw.integrate(system, method, **({"v": 0.0, "y": 0.0, "dt": 0.01, "steps": steps, "every": 1} | options))


def assert_same(one: sw.Run, other: sw.Run) -> None:
    for name in ("v", "y", "carry"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), strict=True)


@looped("period, delay", TIMES)
def test_it_is_the_loop_that_users_write_over_a_world(period: int, delay: int) -> None:
    for backend in ("rust", "numpy"):
        np.testing.assert_array_equal(run_of(loop(period, delay), backend=backend).y[1:], by_hand(period, delay, 97))


@looped("period, delay", [(11, 13), (9, 13), (10, 12), (10, 14)])
def test_a_period_or_delay_that_is_off_by_a_step_is_another_motion(period: int, delay: int) -> None:
    assert not np.array_equal(run_of(loop(period, delay)).y[1:], by_hand(10, 13, 97))


@looped(
    "method, delay, numbers",
    [
        ("false_euler", 4, {"fused": True, "dtype": "float32"}),
        ("standard_heun", 7, {}),
        ("rk4", 0, {"fused": True}),
        ("dop853", 7, {"dtype": "float32"}),
        ("taylor", 4, {}),
        ("implicit_midpoint", 0, {"dtype": "float32"}),
        ("rodas4", 7, {}),
        ("rosenbrock23", 4, {"fused": True}),
        (adams_bashforth_2, 7, {}),
        (adams_bashforth_2, 0, {"dtype": "float32"}),
    ],
)
def test_it_has_the_same_bits_in_every_way(method: Any, delay: int, numbers: dict[str, Any]) -> None:
    """What it remembers goes along with a run, its file and its world; a method may keep blocks beside it."""
    run = assert_equal_ways(loop_of_two(4, delay), method, **STATE, dt=0.05, steps=21, every=3, **numbers)
    assert np.isfinite(run.y).all()


@looped("method, delay", itertools.product([*METHODS, adams_bashforth_2], [0, 7]))
def test_a_step_is_one_graph(method: Any, delay: int) -> None:
    single: dict[str, Any] = {"v": np.zeros(2), "y": np.ones(2), "dt": 0.05, "steps": 1}
    plan = Request.of(loop_of_two(4, delay), method, Options(**single)).plan
    tape = _core.Tape()
    core = tape.trace(engine.model(plan), "step")
    assert_one_graph(tape, core, Tracer(plan.system, tape).step(plan.method))


def test_what_it_sets_has_no_derivative_in_a_step() -> None:
    """Of an implicit method, or a series: it is held, whatever it was computed from. So both agree with RK4 at short steps."""
    ends = [
        sw.integrate(loop(40, 40), method, v=0.0, y=0.0, dt=0.01, steps=2000).y[-1] for method in ("taylor", "rodas5p", "rk4")
    ]
    np.testing.assert_allclose(ends[0], ends[2], rtol=1e-10)
    np.testing.assert_allclose(ends[1], ends[2], rtol=1e-9)


@looped("samples", [0, 1, 3])
def test_without_saturation_it_is_the_loop_of_samples(samples: int) -> None:
    """``sampled_loop`` has the exact solution of the plant between samples; a series of order 25 is exact but for rounding."""
    plant = sw.LinearSystem([[-0.4, 0.0], [1.0, 0.0]], [[4.0], [0.0]], [[0.0, 1.0]], x=0.0)
    steps = sw.sampled_loop(plant, 0.8, 0.1, samples=samples)
    system = plant.surrounded(proportional(sets="x", period=0.1, delay=0.1 * samples))
    start = np.array([0.3, 0.25])
    run = sw.integrate(system, "taylor", y=start, dt=0.1, steps=50, every=1)
    state = np.zeros(len(steps.P))
    state[:2] = start
    for k in range(51):
        np.testing.assert_allclose(run.y[k], state[:2], rtol=0.0, atol=2e-12)
        state = steps.P @ state


def world_of_23_steps() -> tuple[sw.World, Any, Any]:
    v, y = np.zeros(3), np.zeros(3)
    world = sw.World(loop(10, 13), "rk4", v=v, y=y, dt=0.01)
    world.step(23)
    return world, v, y


def test_with_other_parameters_it_goes_on_with_what_it_remembers() -> None:
    """As one would who turns a knob, also in a world; with another period, or another controller, it begins anew."""
    before = run_of(loop(10, 13), 23)
    turned = sw.integrate(loop(10, 13, gain=2.0 * GAINS), "rk4", resume=before, steps=37, every=1)
    assert not np.array_equal(turned.y[-1], run_of(loop(10, 13), 60).y[-1])
    for turn in (lambda world: world.set(gain=2.0 * GAINS), lambda world: np.copyto(world.parameters["gain"], 2.0 * GAINS)):
        world, _, y = world_of_23_steps()
        turn(world)
        world.step(37)
        np.testing.assert_array_equal(turned.y[-1], y)
        np.testing.assert_array_equal(world.system.controller.values["gain"], 2.0 * GAINS)
    anew = sw.integrate(loop(9, 13), "rk4", resume=before, steps=37)
    fresh = sw.integrate(loop(9, 13), "rk4", v=before.v[-1], y=before.y[-1], dt=0.01, steps=37, start_step=23)
    np.testing.assert_array_equal(anew.y, fresh.y)


@looped("period, delay, method", [(1, 0, "rk4"), (10, 13, "rk4"), (10, 13, adams_bashforth_2)])
def test_a_world_that_is_copied_or_goes_on_from_a_run_is_the_same(period: int, delay: int, method: Any) -> None:
    system = loop(period, delay)
    worlds = [
        sw.World(system, method, v=np.zeros(3), y=np.zeros(3), dt=0.01),
        sw.World(system, method, resume=run_of(system, 23, method)),
    ]
    worlds[0].step(23)
    for copied in (copy.copy, copy.deepcopy, lambda world: pickle.loads(pickle.dumps(world))):
        worlds = [copied(world) for world in worlds]
        for world, steps in itertools.product(worlds, (1, 13)):
            world.step(steps)
    for world in worlds:
        np.testing.assert_array_equal(world.y, run_of(system, 65, method).y[-1])


def test_a_push_in_a_world_is_seen_at_the_next_sample_and_forgets_nothing() -> None:
    """A user who writes to v or y changes the state, not the time of the controller, nor what it has computed."""
    world, v, _ = world_of_23_steps()
    v += 0.5
    world = copy.deepcopy(world)
    world.step(37)
    pushed = run_of(loop(10, 13), 23)
    again = sw.integrate(loop(10, 13), "rk4", resume=pushed, v=pushed.v[-1] + 0.5, y=pushed.y[-1], steps=37)
    np.testing.assert_array_equal(world.y, again.y[-1])
    fresh = run_of(loop(10, 13), 37, v=pushed.v[-1] + 0.5, y=pushed.y[-1])
    assert not np.array_equal(again.y[-1], fresh.y[-1])


def test_members_that_are_reset_begin_with_a_sample() -> None:
    world, _, y = world_of_23_steps()
    world.reset([1], v=0.0, y=0.0)
    world.step(37)
    np.testing.assert_array_equal(y[[0, 2]], run_of(loop(10, 13), 60).y[-1, [0, 2]])
    assert y[1] == run_of(loop(10, 13), 37).y[-1, 1]


def test_what_the_controller_sets_cannot_be_set() -> None:
    world, _, _ = world_of_23_steps()
    assert "u" not in list(world.parameters)
    for call in (lambda: world.set(u=1.0), lambda: world.parameters["u"], lambda: world.reset([0], y=0.0, u=1.0)):
        with pytest.raises(UnsupportedError, match="u: the sampled controller sets it"):
            call()


def test_friction_of_own_equations_sees_what_it_sets() -> None:
    @sw.system
    def sled(t: Any, v: Any, y: Any, *, u: Any = 0.0) -> Any:
        return u - 0.1 * v

    @sled.friction
    def grip(t: Any, v: Any, y: Any, *, u: Any) -> Any:
        return 0.1 + 0.2 * u * u

    @sw.controller
    def push(t: Any, v: Any, y: Any) -> Any:
        return 1.0 - y

    runs = [run_of(sled().surrounded(push(period=0.04)), 97, backend=backend) for backend in ("rust", "numpy")]
    assert_same(*runs)
    assert runs[0].y[-1] > 0.0


def test_a_sweep_over_its_parameters_and_its_period() -> None:
    for period in (0.1, 0.2):

        def of_gain(gain: Any, period: float = period) -> Any:
            return mass().surrounded(limited(gain=gain, period=period, delay=0.1))

        dataset = sw.sweep(of_gain, {"gain": GAINS}, method="rk4", v=0.0, y=0.0, dt=0.01, steps=97)
        np.testing.assert_array_equal(dataset["y_last"].values.reshape(-1), run_of(of_gain(GAINS)).y[-1])


def test_its_times_are_those_of_the_steps() -> None:
    """Also where members have times of their own, and back in time."""
    v = run_of(mass().surrounded(clock(period=0.04)), 9, t0=2.0).v
    expected, w = [], 0.0
    for k in range(9):
        u = 2.0 + (k - k % 4) * 0.01
        run = sw.integrate(mass(u=u), "rk4", v=w, y=0.0, dt=0.01, steps=1)
        w = float(run.v[-1])
        expected.append(w)
    np.testing.assert_array_equal(v[1:], expected)
    own = run_of(mass().surrounded(clock(period=0.04)), 9, t0=np.array([0.0, 2.0]))
    np.testing.assert_array_equal(own.v[:, 1], v)
    numpy = run_of(mass().surrounded(clock(period=0.04)), 9, t0=np.array([0.0, 2.0]), backend="numpy")
    assert_same(own, numpy)
    back = run_of(mass().surrounded(clock(period=0.04)), 9, dt=-0.01)
    assert_same(back, run_of(mass().surrounded(clock(period=0.04)), 9, dt=-0.01, backend="numpy"))


def test_inputs_of_built_in_systems_and_other_parts_beside_it() -> None:
    systems: list[tuple[sw.System, Any, dict[str, Any]]] = [
        (sw.Oscillator(2.0, 0.1, x=0.0), clock(sets="x", period=0.04), {"v": 0.0, "y": 1.0}),
        (sw.Oscillator(2.0, a=0.0, friction=0.1, form="physical"), clock(sets="a", period=0.04), {"v": 0.3, "y": 1.0}),
        (sw.Oscillator(2.0, x=0.0, a=sw.Sinusoid(1.0, 2.0)), clock(sets="x", period=0.04), {"v": 0.0, "y": 1.0}),
        (sw.Pendulum(2.0, a=0.0), clock(sets="a", period=0.04), {"v": 0.0, "y": 1.0}),
        (mass(), clock(period=0.04), {"v": 0.0, "y": 1.0, "force": np.array([0.1, 0.2])}),
    ]
    for system, controller, start in systems:
        runs = [run_of(system.surrounded(controller), 30, **start, backend=backend) for backend in ("rust", "numpy")]
        assert_same(*runs)
        assert not np.array_equal(runs[0].y[-1], run_of(system, 30, **start).y[-1])


def test_a_long_step_is_one_tape() -> None:
    """Also of a system that is stepped row by row otherwise."""
    n = 70
    matrix = np.diag(-np.ones(n)) + np.diag(np.ones(n - 1), 1)
    plant = sw.LinearSystem(matrix, np.ones((n, 1)), x=0.0, velocities=0)

    @sw.controller
    def push(t: Any, y: Any) -> Any:
        return -0.1 * y[0]

    start = {"v": np.zeros((0,)), "y": np.linspace(0.0, 1.0, n)}
    runs = [run_of(plant.surrounded(push(sets="x", period=0.04)), 12, **start, backend=each) for each in ("rust", "numpy")]
    assert_same(*runs)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("bits.at_most(self.last, steps)", "bits.at_most(self.last + 1.0, steps)"),
        ("held = out = queue[: self.sets]", "held = out = queue[self.sets : 2 * self.sets]"),
        ("at_most(steps, self.later) & bits.at_most(self.later, steps)", "at_most(steps, self.later) & True"),
    ],
    ids=["a period that is a step too long", "a result that waits a sample less", "one that is put out too soon"],
)
def test_a_reference_with_a_mistake_is_noticed(old: str, new: str, monkeypatch: pytest.MonkeyPatch) -> None:
    system = loop(10, 13)
    monkeypatch.setattr(sampled.Loop, "step", mistaken(sampled, old, new).Loop.step)
    assert not np.array_equal(run_of(system, backend="numpy").y, run_of(system).y)


def test_what_it_sets_is_held_in_all_stages_of_a_step() -> None:
    """A plant that is told its state in each stage moves otherwise."""

    @sw.system
    def told(t: Any, v: Any, y: Any, *, gain: Any = 1.0) -> Any:
        return -gain * y - 0.4 * v

    @sw.controller
    def back(t: Any, v: Any, y: Any) -> Any:
        return -y

    held = run_of(mass().surrounded(back(period=0.01)), v=0.0, y=1.0)
    assert not np.array_equal(held.y, run_of(told(), v=0.0, y=1.0).y)
    np.testing.assert_allclose(held.y[1], 1.0 - 0.5e-4, atol=1e-6)


def test_its_period_is_found_by_the_nearest_whole_number_of_steps() -> None:
    part = limited(period=0.3, delay=0.7)
    assert part.over_steps(0.1).timing == Timing(3, 2, 1)
    assert part.over_steps(-0.1).timing == Timing(3, 2, 1)


@looped("dt, samples", itertools.product([0.1, 0.2, 0.3], [0, 1, 3]))
def test_near_a_state_it_is_the_loop_of_samples(dt: float, samples: int) -> None:
    plant = sw.LinearSystem([[-0.4, 0.0], [1.0, 0.0]], [[4.0], [0.0]], [[0.0, 1.0]], x=0.0)
    system = plant.surrounded(proportional(sets="x", period=dt, delay=samples * dt))
    for steps in (1, 5):
        near = sw.linearised_loop(system, "taylor", dt=dt / steps, y=np.zeros(2))
        true = sw.sampled_loop(plant, 0.8, dt, samples=samples)
        assert near.radius == pytest.approx(true.radius, rel=1e-11)
        assert near.period == pytest.approx(dt)


@looped("gain, grows", [(10.0, False), (14.0, False), (15.5, True), (20.0, True)])
def test_a_loop_grows_where_its_radius_is_above_one(gain: float, grows: bool) -> None:
    """From both sides, by a controller with a delay between samples and a state; at rest it does not saturate."""
    system = mass().surrounded(limited(gain=gain, period=0.12, delay=0.06))
    near = sw.linearised_loop(system, "rk4", dt=0.02, v=0.0, y=1.0)
    run = sw.integrate(system, "rk4", v=0.0, y=1.0 + 1e-8, dt=0.02, steps=6 * 400, every=6)
    size = np.abs(run.y - 1.0)
    assert bool(near.radius > 1.0) is grows
    assert bool(size[300:].max() > size[:100].max()) is grows


def test_the_derivative_over_a_period_is_that_of_runs() -> None:
    """By differences, of all that is remembered, for each member, for an explicit and an implicit method."""
    for method in ("rk4", "rodas4"):
        system, start = loop_of_two(4, 7), {"v": STATE["v"], "y": STATE["y"]}
        near = sw.linearised_loop(system, method, dt=0.05, **start)
        assert near.P.shape == (4 + 3 + 6 + 3, 4 + 3 + 6 + 3, 3)
        for i, name in enumerate(("v", "v", "y", "y")):
            ends = []
            for sign in (1.0, -1.0):
                moved = {key: block.copy() for key, block in start.items()}
                moved[name][i % 2] += sign * 1e-5
                run = sw.integrate(system, method, **moved, dt=0.05, steps=4)
                ends.append(np.concatenate([run.v[-1], run.y[-1], run.carry[3:]]))
            np.testing.assert_allclose(near.P[:, i], (ends[0] - ends[1]) / 2e-5, rtol=1e-7, atol=1e-9)


def exported(language: str) -> list[Journey]:
    """One whose results wait, two that set several parameters, with parameters that the code changes, a series, and float32."""
    start = {"v": STATE["v"], "y": STATE["y"], "dt": 0.05, "member": 1, "steps": 23}
    every = [
        Journey(loop(10, 13), "rk4", np.zeros(3), np.zeros(3), dt=0.01, member=2, steps=41),
        Journey(loop_of_two(4, 0), "rk4", **start),
        Journey(loop_of_two(4, 7), "rodas4", **start),
        Journey(loop_of_two(4, 4), "taylor", **start),
        Journey(sw.Oscillator(2.0, x=0.0).surrounded(clock(sets="x", period=0.04)), "merson", 0.5, 1.0, dt=0.01, steps=23),
        Journey(
            loop(10, 13, gain=1.0),
            "rk4",
            0.0,
            0.0,
            dt=0.01,
            steps=41,
            changed={"controller_gain": 2.0},
            twin=loop(10, 13, gain=2.0),
        ),
        Journey(loop(10, 13), "rk4", np.zeros(3), np.zeros(3), dt=0.01, member=2, steps=41, options={"dtype": "float32"}),
    ]
    if language not in ("csharp", "javascript"):
        every.append(Journey(loop_of_two(4, 7), "rk4", **start, options={"fused": True}))
    return every


@languages
def test_every_bit_of_an_exported_loop(language: str, tmp_path: Any) -> None:
    every = exported(language)
    assert_same_bits(every, run(language, every, tmp_path))


def test_an_exported_controller_computes_at_samples_only() -> None:
    text = sw.export(loop(10, 13, gain=1.0), "rk4", "python").source
    before, within = text.partition("        if a1:\n")[::2]
    assert "controller_gain * a2" not in before
    assert "            a3 = memory_1 + (self.controller_gain * a2 - 1.5 * v)\n" in within


WRONG: list[tuple[Any, type[StepwellError], str]] = [
    (lambda: sw.controller(3), DTypeError, "expected a Python function"),
    (lambda: sw.controller(limited), DTypeError, "limited is a controller already"),
    (lambda: sw.controller(lambda y, t: y), ArgumentError, r"expected a function \(t, v, y"),
    (lambda: sw.controller(lambda t, v, y, x: y), ArgumentError, "both with defaults"),
    (lambda: sw.controller(lambda t, v, y, *x: y), ArgumentError, "both with defaults"),
    (lambda: sw.controller(lambda t, v, y, *, period=1.0: y), ArgumentError, "period has a meaning already"),
    (lambda: sw.controller(lambda t, v, y, x="a": y), DTypeError, "default of x"),
    (lambda: limited(period=0.1, speed=1.0), UnknownNameError, "there is no parameter 'speed'. Known: gain, total"),
    (lambda: limited(period=0.0), ArgumentError, "period: expected .* above zero"),
    (lambda: limited(period=0.1, delay=-0.1), ArgumentError, "delay: expected a time of zero or more"),
    (lambda: limited(period=0.1, gain=np.nan), ArgumentError, "gain"),
    (lambda: limited(period=0.1, sets=()), ArgumentError, "sets: expected the names of parameters"),
    (lambda: limited(period=0.1, sets=("u", "u")), ArgumentError, "each once"),
    (lambda: several(period=0.1, seen=1.0), ShapeError, "seen: expected 1 axes of its own"),
    (lambda: mass().surrounded(limited(period=0.1, sets="w")), UnknownNameError, "Known: u"),
    (lambda: mass(u=sw.Sinusoid(1.0, 1.0)).surrounded(limited(period=0.1)), ArgumentError, "changes with the time"),
    (lambda: sw.Oscillator().surrounded(clock(period=0.1, sets="x")), ArgumentError, "give it the value .* x=0.0"),
    (lambda: sw.Oscillator(x=0.0).surrounded(clock(period=0.1, sets="omega")), UnknownNameError, "may have any value"),
    (lambda: mass().surrounded(proportional(period=0.1)), ArgumentError, r"expected a controller of \(t, v, y"),
    (
        lambda: sw.LinearSystem(-np.eye(2), np.ones(2), np.ones(2), x=0.0).surrounded(clock(sets="x", period=0.1)),
        ArgumentError,
        "no velocities",
    ),
    (lambda: run_of(mass().surrounded(limited(period=0.015))), ArgumentError, r"period: .* 1.5; take dt = 0.0075"),
    (
        lambda: run_of(mass().surrounded(limited(period=0.1, delay=0.015))),
        ArgumentError,
        "delay: expected a whole number of steps",
    ),
    (lambda: run_of(mass().surrounded(limited(period=0.001))), ArgumentError, "period"),
    (lambda: run_of(mass().surrounded(limited(period=1e9))), ArgumentError, "period: expected less than 16777216 steps"),
    (lambda: run_of(mass().surrounded(limited(period=0.01, delay=100.0))), ArgumentError, "at most 1000 periods"),
    (
        lambda: run_of(sw.Oscillator(x=0.0).surrounded(clock(sets="x", period=0.1)), method="leapfrog"),
        UnsupportedError,
        "leapfrog carries v_half",
    ),
    (
        lambda: run_of(sw.Oscillator(x=0.0).surrounded(clock(sets="x", period=0.1)), method="verlet"),
        UnsupportedError,
        "verlet carries y_prev",
    ),
    (lambda: run_of(loop(), method="exact"), UnsupportedError, "exact"),
    (lambda: run_of(loop(), form="matrix"), UnsupportedError, "form"),
    (
        lambda: sw.integrate(loop(), "dop853", v=0.0, y=0.0, tolerance=1e-6, at=[1.0]),
        UnsupportedError,
        "tolerance: does not go with a sampled controller: a controller samples at whole numbers of steps",
    ),
    (lambda: run_of(loop(), events=lambda t, v, y: y - 0.5), UnsupportedError, "events: does not go with a sampled controller"),
    (
        lambda: sw.World(loop(), "rk4", v=np.zeros(3), y=np.zeros(3), dt=0.01, events=lambda t, v, y: y),
        UnsupportedError,
        "events: does not go with a sampled controller",
    ),
    (lambda: mass().surrounded(named_alike(period=0.1)), ArgumentError, "by other names than those of the system.*got u"),
    (lambda: sw.stability_limit(loop(), "rk4"), UnsupportedError, "sampled controller"),
    (lambda: sw.analyse(loop(), "rk4", dt=0.01), UnsupportedError, "sampled controller"),
    (lambda: sw.jacobian(loop(), v=0.0, y=0.0), UnsupportedError, "sampled controller"),
    (lambda: sw.lyapunov(loop(), "rk4", v=0.0, y=0.0, dt=0.01, steps=10), UnsupportedError, "sampled controller"),
    (
        lambda: sw.export(loop(), "rk4", "c", dt=0.3),
        ArgumentError,
        "period: expected a whole number of steps, got 0.1 with dt = 0.3",
    ),
    (lambda: sw.linearised_loop(mass(), "rk4", dt=0.01, v=0.0, y=0.0), ArgumentError, "a sampled controller around it"),
    (lambda: sw.linearised_loop(loop(), adams_bashforth_2, dt=0.01, v=0.0, y=0.0), UnsupportedError, "more than v and y"),
    (lambda: sw.linearised_loop(loop(), "rk4", dt=0.03, v=0.0, y=0.0), ArgumentError, "period: expected a whole number"),
    (lambda: sw.linearised_loop(loop(), "rk4", dt=1e-7, v=0.0, y=0.0), ArgumentError, "at most 100000 steps in a period"),
    (lambda: sw.discretise(linear_loop(), 0.1), UnsupportedError, "sampled controller"),
    (lambda: sw.sampled_loop(linear_loop(), 0.8, 0.1), UnsupportedError, "sampled controller"),
    (lambda: sw.LinearSystem.of(linear_loop()), UnsupportedError, "sampled controller"),
    (lambda: sw.frequency_response(linear_loop(), 1.0), UnsupportedError, "sampled controller"),
    (lambda: sw.margins(linear_loop()), UnsupportedError, "sampled controller"),
    (lambda: 2.0 * linear_loop(), UnsupportedError, "sampled controller"),
    (lambda: linear_loop() * linear_loop(), UnsupportedError, "sampled controller"),
    (lambda: linear_loop().with_inputs(None), UnsupportedError, "sampled controller"),
    (lambda: sw.charts.bode(linear_loop(), ["rk4"], dt=0.1), UnsupportedError, "sampled controller"),
    (lambda: sw.equilibria(loop(gain=1.0), near=(0.0, 0.0)), UnsupportedError, "sampled controller"),
    (lambda: sw.explain(loop(), "rk4"), UnsupportedError, "sampled controller"),
    (lambda: run_of(mass().surrounded(bad_count(period=0.1))), TraceError, "expected u of one number, got shape"),
    (lambda: run_of(mass().surrounded(bad_shape(period=0.1))), TraceError, "expected u of one number"),
    (lambda: run_of(mass().surrounded(bad_branch(period=0.1))), TraceError, "bad_branch .*if"),
    (lambda: run_of(mass().surrounded(bad_random(period=0.1))), TraceError, "the same operations at every call"),
]


@sw.controller
def named_alike(t: Any, v: Any, y: Any, *, u: Any = 1.0) -> Any:
    return u * y


@sw.controller
def bad_count(t: Any, v: Any, y: Any) -> Any:
    return y, v


@sw.controller
def bad_shape(t: Any, v: Any, y: Any) -> Any:
    return np.array([y, y])


@sw.controller
def bad_branch(t: Any, v: Any, y: Any) -> Any:
    return 1.0 if y > 0.0 else 0.0


@sw.controller
def bad_random(t: Any, v: Any, y: Any) -> Any:
    return y + np.random.default_rng().uniform()


@looped("call, error, words", WRONG)
def test_what_is_wrong_is_refused_before_any_work(call: Any, error: type[StepwellError], words: str) -> None:
    with pytest.raises(error, match=words):
        call()
