"""Sampled controllers around a system: what they compute, when, and with what they go."""

from __future__ import annotations

import copy
import itertools
import pickle
import shutil
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell._core import Tape
from stepwell.errors import ArgumentError, DTypeError, ShapeError, StepwellError, TraceError, UnknownNameError, UnsupportedError
from stepwell.model.controllers import Timing
from stepwell.reference import functions, sampled
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from stepwell.runs.options import Options
from stepwell.runs.request import Request
from support.abroad import Journey, run
from support.calls import assert_raises
from support.cases import assert_same
from support.export import assert_same as assert_same_bits
from support.export import example, languages, printed
from support.graphs import assert_one_graph, assert_plan_is_traced_alike
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


def energy(v: Any, y: Any, *, u: Any) -> Any:
    return 0.5 * v**2 + 0.5 * y**2 - u * y


@sw.controller
def of_output(t: Any, z: Any, *, gain: Any = 0.8) -> Any:
    return -gain * z[0]


GAINS = np.array([0.5, 1.0, 2.0])
PLANT = sw.LinearSystem([[-0.4, 0.0], [1.0, 0.0]], [[4.0], [0.0]], [[0.0, 1.0]], x=0.0)
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


@sw.controller
def other(t: Any, v: Any, y: Any, seen: Any = 0.5, *, gain: Any = 0.7) -> Any:
    return np.array([-gain * y[1], seen - v[0]]), 0.5 * seen + np.sin(t)


@sw.controller
def first(t: Any, v: Any, y: Any, total: Any = 0.0, *, gain: Any = 0.5, k: Any = 0.1) -> Any:
    return gain * y[0] + total, total - k * y[1]


def two(times: tuple[int, int, int, int] = (4, 7, 6, 3), gain: Any = GAINS) -> sw.System:
    """One with two controllers of these periods and delays in steps of 0.05."""
    p, d, q, e = (0.05 * each for each in times)
    return driven().surrounded(first(gain=gain, period=p, delay=d)).surrounded(other(sets="w", period=q, delay=e))


def clocked() -> sw.System:
    return sw.Oscillator(2.0, x=0.0).surrounded(clock(sets="x", period=0.04))


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


def by_both(*arguments: Any, **options: Any) -> sw.Run:
    """By the core, which is as by the reference."""
    runs = [run_of(*arguments, **options, backend=backend) for backend in ("rust", "numpy")]
    assert_same(*runs)
    return runs[0]


@looped("period, delay", TIMES)
def test_it_is_the_loop_that_users_write_over_a_world(period: int, delay: int) -> None:
    np.testing.assert_array_equal(by_both(loop(period, delay)).y[1:], by_hand(period, delay, 97))


@looped("times", [(1, 0, 1, 0), (1, 0, 3, 0), (4, 7, 6, 3), (7, 0, 5, 12), (10, 10, 3, 0)])
def test_two_controllers_are_the_loop_that_users_write_over_a_world(times: tuple[int, int, int, int]) -> None:
    """Each has its own period and delay, in whichever order they came; what they put out is recorded."""
    p, d, q, e = times
    v, y = (block.copy() for block in (STATE["v"], STATE["y"]))
    total, seen = np.zeros(3), np.full(3, 0.5)
    world = sw.World(driven(u=np.full(3, 0.1), w=np.array([[0.1] * 3, [0.2] * 3])), "rk4", v=v, y=y, dt=0.05)
    late: dict[str, dict[int, Any]] = {"u": {}, "w": {}}
    states, put_out = [y.copy()], [np.array([[0.1] * 3, [0.1] * 3, [0.2] * 3])]
    for k in range(47):
        if k % p == 0:
            late["u"][k + d], total = GAINS * y[0] + total, total - 0.1 * y[1]
        if k % q == 0:
            late["w"][k + e], seen = np.array([-0.7 * y[1], seen - v[0]]), 0.5 * seen + float(functions.sin(k * 0.05))
        for name, each in late.items():
            if k in each:
                world.parameters[name][...] = each[k]
        world.step()
        states.append(y.copy())
        put_out.append(np.array([world.parameters["u"], *world.parameters["w"]]))
    around = first(gain=GAINS, period=0.05 * p, delay=0.05 * d), other(sets="w", period=0.05 * q, delay=0.05 * e)
    for one, after in (around, around[::-1]):
        system = driven().surrounded(one).surrounded(after)
        run = by_both(system, 47, dt=0.05, **STATE, record=("w", "u"))
        np.testing.assert_array_equal(run.y, states)
        np.testing.assert_array_equal(run.recorded["u"], np.array(put_out)[:, 0])
        np.testing.assert_array_equal(run.recorded["w"], np.array(put_out)[:, 1:])
        every = by_both(system, 47, dt=0.05, **STATE, record="w", every=5)
        np.testing.assert_array_equal(every.recorded["w"][:-1], run.recorded["w"][::5])
        single = by_both(system, 47, dt=0.05, **STATE, record="u", dtype="float32")
        np.testing.assert_allclose(single.recorded["u"], run.recorded["u"], atol=1e-5)
        assert np.array_equal(single.recorded["u"], run.recorded["u"].astype(np.float32)) is False


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
    for system, record in ((loop_of_two(4, delay), ()), (two(), ("u", "w"))):
        run = assert_equal_ways(system, method, **STATE, dt=0.05, steps=21, every=3, record=record, **numbers)
        assert np.isfinite(run.y).all()
        assert list(run.recorded) == list(record)


@looped("method, delay", itertools.product([*METHODS, adams_bashforth_2], [0, 7]))
def test_a_step_is_one_graph(method: Any, delay: int) -> None:
    one = Options(v=np.zeros(2), y=np.ones(2), dt=0.05, steps=1, record=("w", "u"))
    for system in (loop_of_two(4, delay), two((4, delay, 6, 3))):
        plan = Request.of(system, method, one).plan
        assert_plan_is_traced_alike(plan, "step")
        tape = Tape()
        assert_one_graph(tape, tape.trace(engine.model(plan), "record w")[-2:], Tracer(plan.system, tape).record(["w"]))


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
    steps = sw.sampled_loop(PLANT, 0.8, 0.1, samples=samples)
    system = PLANT.surrounded(proportional(sets="x", period=0.1, delay=0.1 * samples))
    start = np.array([0.3, 0.25])
    run = sw.integrate(system, "taylor", y=start, dt=0.1, steps=50, every=1)
    plant = sw.TransferFunction(4.0, [1.0, 0.4, 0.0], x=0.0)  # its states are that output over 4, and its rate
    of_z = plant.surrounded(of_output(sets="x", period=0.1, delay=0.1 * samples))
    by_output = sw.integrate(of_z, "taylor", v=start[:1] / 4.0, y=start[1:] / 4.0, dt=0.1, steps=50, every=1)
    np.testing.assert_allclose(by_output.z[:, 0], run.y[:, 1], rtol=0.0, atol=2e-12)
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


def test_an_energy_that_reads_what_it_sets_is_refused() -> None:
    """It changes with what is set, so what a function of v and y alone says of it is wrong."""
    pulled = sw.system(lambda t, v, y, *, u=0.0: u - y)
    pulled.invariant(energy)
    run = run_of(pulled().surrounded(clock(period=0.1)), 20)
    for call in (lambda: run.energy, lambda: run_of(run.system, record="energy")):
        with pytest.raises(UnsupportedError, match=r"energy: that of .* reads a parameter that changes with the time"):
            call()


def test_outputs_that_a_controller_reads_are_part_of_the_step() -> None:
    world = sw.World(PLANT.surrounded(of_output(sets="x", period=0.1)), "rk4", y=np.zeros(2), dt=0.1)
    with pytest.raises(UnsupportedError, match="C: the sampled controller reads outputs by it"):
        world.set(C=[[0.0, 2.0]])


def test_friction_of_own_equations_sees_what_it_sets() -> None:
    @sw.system
    def sled(t: Any, v: Any, y: Any, *, u: Any = 0.0) -> Any:
        return u - 0.1 * v

    @sled.friction
    def grip(t: Any, v: Any, y: Any, *, u: Any) -> Any:
        return 0.1 + 0.2 * u * u

    push = sw.controller(lambda t, v, y: 1.0 - y)
    assert by_both(sled().surrounded(push(period=0.04)), 97).y[-1] > 0.0


def test_a_sweep_over_its_parameters_and_its_period() -> None:
    for period in (0.1, 0.2):

        def of_gain(gain: Any, period: float = period) -> Any:
            return mass().surrounded(limited(gain=gain, period=period, delay=0.1))

        dataset = sw.sweep(of_gain, {"gain": GAINS}, method="rk4", v=0.0, y=0.0, dt=0.01, steps=97)
        np.testing.assert_array_equal(dataset["y_last"].values.reshape(-1), run_of(of_gain(GAINS)).y[-1])


def test_its_times_are_those_of_the_steps() -> None:
    """Also where members have times of their own, and back in time."""
    system = mass().surrounded(clock(period=0.04))
    v = run_of(system, 9, t0=2.0).v
    expected, w = [], 0.0
    for k in range(9):
        u = 2.0 + (k - k % 4) * 0.01
        run = sw.integrate(mass(u=u), "rk4", v=w, y=0.0, dt=0.01, steps=1)
        w = float(run.v[-1])
        expected.append(w)
    np.testing.assert_array_equal(v[1:], expected)
    np.testing.assert_array_equal(by_both(system, 9, t0=np.array([0.0, 2.0])).v[:, 1], v)
    by_both(system, 9, dt=-0.01)


def test_inputs_of_built_in_systems_and_other_parts_beside_it() -> None:
    systems: list[tuple[sw.System, Any, dict[str, Any]]] = [
        (sw.Oscillator(2.0, 0.1, x=0.0), clock(sets="x", period=0.04), {"v": 0.0, "y": 1.0}),
        (sw.Oscillator(2.0, a=0.0, friction=0.1, form="physical"), clock(sets="a", period=0.04), {"v": 0.3, "y": 1.0}),
        (sw.Oscillator(2.0, x=0.0, a=sw.Sinusoid(1.0, 2.0)), clock(sets="x", period=0.04), {"v": 0.0, "y": 1.0}),
        (sw.Pendulum(2.0, a=0.0), clock(sets="a", period=0.04), {"v": 0.0, "y": 1.0}),
        (mass(), clock(period=0.04), {"v": 0.0, "y": 1.0, "force": np.array([0.1, 0.2])}),
    ]
    for system, controller, start in systems:
        run = by_both(system.surrounded(controller), 30, **start)
        assert not np.array_equal(run.y[-1], run_of(system, 30, **start).y[-1])


def test_a_long_step_is_one_tape() -> None:
    """Also of a system that is stepped row by row otherwise."""
    n = 70
    matrix = np.diag(-np.ones(n)) + np.diag(np.ones(n - 1), 1)
    plant = sw.LinearSystem(matrix, np.ones((n, 1)), x=0.0, velocities=0)
    push = sw.controller(lambda t, y: -0.1 * y[0])
    by_both(plant.surrounded(push(sets="x", period=0.04)), 12, v=np.zeros(0), y=np.linspace(0.0, 1.0, n))


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
    told, back = sw.system(lambda t, v, y: -y - 0.4 * v), sw.controller(lambda t, v, y: -y)
    held = run_of(mass().surrounded(back(period=0.01)), v=0.0, y=1.0)
    assert not np.array_equal(held.y, run_of(told(), v=0.0, y=1.0).y)
    np.testing.assert_allclose(held.y[1], 1.0 - 0.5e-4, atol=1e-6)


def test_its_period_is_found_by_the_nearest_whole_number_of_steps() -> None:
    part = limited(period=0.3, delay=0.7)
    assert part.over_steps(0.1).timing == Timing(3, 2, 1)
    assert part.over_steps(-0.1).timing == Timing(3, 2, 1)


@looped("dt, samples", itertools.product([0.1, 0.2, 0.3], [0, 1, 3]))
def test_near_a_state_it_is_the_loop_of_samples(dt: float, samples: int) -> None:
    system = PLANT.surrounded(proportional(sets="x", period=dt, delay=samples * dt))
    for steps in (1, 5):
        near = sw.linearised_loop(system, "taylor", dt=dt / steps, y=np.zeros(2))
        true = sw.sampled_loop(PLANT, 0.8, dt, samples=samples)
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
    cases = [("rk4", loop_of_two(4, 7), 4, 4 + 3 + 6 + 3), ("rodas4", loop_of_two(4, 7), 4, 4 + 3 + 6 + 3)]
    for method, system, steps, size in [*cases, ("rk4", two(), 12, 16)]:
        start = {"v": STATE["v"], "y": STATE["y"]}
        near = sw.linearised_loop(system, method, dt=0.05, **start)
        assert near.P.shape == (size, size, 3)
        assert near.period == pytest.approx(0.05 * steps)
        counters = system.over_steps(sw.method(method), 0.0, 0.05).controller.counters(system)
        for i, name in enumerate(("v", "v", "y", "y")):
            ends = []
            for sign in (1.0, -1.0):
                moved = {key: block.copy() for key, block in start.items()}
                moved[name][i % 2] += sign * 1e-5
                run = sw.integrate(system, method, **moved, dt=0.05, steps=steps)
                remembered = np.delete(run.carry[2:], counters, axis=0)
                ends.append(np.concatenate([run.v[-1], run.y[-1], remembered]))
            np.testing.assert_allclose(near.P[:, i], (ends[0] - ends[1]) / 2e-5, rtol=1e-7, atol=1e-9)


def exported(language: str) -> list[Journey]:
    """One whose results wait, two that set several parameters, with parameters that the code changes, a series, and float32."""
    start = {"v": STATE["v"], "y": STATE["y"], "dt": 0.05, "member": 1, "steps": 23}
    changed = {"changed": {"controller_gain": 2.0}, "twin": loop(10, 13, gain=2.0)}
    every = [
        Journey(loop(10, 13), "rk4", np.zeros(3), np.zeros(3), dt=0.01, member=2, steps=41),
        Journey(loop_of_two(4, 0), "rk4", **start),
        Journey(loop_of_two(4, 7), "rodas4", **start),
        Journey(loop_of_two(4, 4), "taylor", **start),
        Journey(two(), "rk4", **start),
        Journey(clocked(), "merson", 0.5, 1.0, dt=0.01, steps=23),
        Journey(loop(10, 13, gain=1.0), "rk4", 0.0, 0.0, **changed, dt=0.01, steps=41),
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


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C here")
def test_a_controller_alone_puts_out_what_it_does_in_the_loop(tmp_path: Any) -> None:
    """From the states of a run, as a program measures them; what it puts out stands where the head of the file says."""
    run = run_of(two(), 31, dt=0.05, **STATE, record=("u", "w"))
    step = sw.export(two(), "controller", "python", dt=0.05, member=1)
    assert "Set by the controller: u at memory[12], w at memory[13], memory[14]" in step.source
    made: dict[str, Any] = {"__name__": "made"}
    exec(step.source, made)
    box = made["DrivenController"]()
    s = box.start(run.v[0, :, 1], run.y[0, :, 1])
    for k in range(31):
        s.v, s.y = run.v[k, :, 1].tolist(), run.y[k, :, 1].tolist()
        box.step(s)
        assert s.memory[12:] == [run.recorded["u"][k + 1, 1], *run.recorded["w"][k + 1, :, 1]]
        assert (s.v, s.y) == (run.v[k, :, 1].tolist(), run.y[k, :, 1].tolist())
    s = box.start([0.0, 0.0], [1.0, 2.0])
    for _ in range(1000):
        box.step(s)
    in_c = sw.export(two(), "controller", "c", dt=0.05, member=1)
    assert printed(in_c, example(in_c).replace("s.y[0]", "s.memory[13]"), tmp_path) == s.memory[13]


def run_around(function: Any) -> sw.Run:
    return run_of(mass().surrounded(sw.controller(function)(period=0.1)))


REST: dict[str, Any] = {"v": np.zeros(3), "y": np.zeros(3)}
WRONG: list[tuple[Any, type[StepwellError], str]] = [
    (lambda: sw.controller(lambda t, x, total=0.0, *, gain=1.0: gain * x), ArgumentError,
     r"got \(t, x, total=0.0, \*, gain=1.0\): the state is called y here, got x"),
    (lambda: loop().surrounded(clock(period=0.2)), UnsupportedError, "part: the system has the controller .* sets u as well"),
    (lambda: two().surrounded(other(sets="w", period=1.0)), UnsupportedError,
     "first.* and other.* already, which sets w as well"),
    (lambda: mass().surrounded(sw.controller(lambda t, z: z[0])(period=0.1)), UnsupportedError,
     r"expected a linear system with outputs \(C\) for a controller of \(t, z"),
    (lambda: sw.TransferFunction([2.0, 1.0], [0.5, 1.0], x=0.0).surrounded(of_output(sets="x", period=0.1)), UnsupportedError,
     r"adds inputs to its outputs \(D\)"),
    (
        lambda: (
            driven()
            .surrounded(first(period=0.1))
            .surrounded(sw.controller(lambda t, v, y, *, gain=1.0, gain_u=1.0: y)(sets="w", period=0.1))
        ),
        ArgumentError,
        "part: expected parameters of .* that differ by name, got gain_u, k, gain_w",
    ),
    (lambda: run_of(loop(), record="w"), UnknownNameError, "record: there is no 'w'"),
    (lambda: run_of(loop(), record="u").quantity("u"), UnknownNameError, "u"),
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
    (lambda: PLANT.surrounded(clock(sets="x", period=0.1)), ArgumentError, "no velocities"),
    (lambda: run_of(mass().surrounded(limited(period=0.015))), ArgumentError, r"period: .* 1.5; take dt = 0.0075"),
    (lambda: run_of(mass().surrounded(limited(period=0.1, delay=0.015))), ArgumentError, "delay: expected a whole number"),
    (lambda: run_of(mass().surrounded(limited(period=0.001))), ArgumentError, "period"),
    (lambda: run_of(mass().surrounded(limited(period=1e9))), ArgumentError, "period: expected less than 16777216 steps"),
    (lambda: run_of(mass().surrounded(limited(period=0.01, delay=100.0))), ArgumentError, "at most 1000 periods"),
    (lambda: run_of(clocked(), method="leapfrog"), UnsupportedError, "leapfrog carries v_half"),
    (lambda: run_of(clocked(), method="verlet"), UnsupportedError, "verlet carries y_prev"),
    (lambda: run_of(loop(), method="exact"), UnsupportedError, "exact"),
    (lambda: run_of(loop(), form="matrix"), UnsupportedError, "form"),
    (lambda: run_of(loop(), method="dop853", dt=None, steps=None, every=None, tolerance=1e-6, at=[1.0]), UnsupportedError,
     "tolerance: does not go with a sampled controller: a controller samples at whole numbers of steps"),
    (lambda: run_of(loop(), events=lambda t, v, y: y - 0.5), UnsupportedError, "events: does not go with a sampled controller"),
    (lambda: sw.World(loop(), "rk4", **REST, dt=0.01, events=lambda t, v, y: y), UnsupportedError, "events: does not go with"),
    (lambda: run_around(lambda t, v, y, *, u=1.0: u * y), ArgumentError, "by other names than those of the system.*got u"),
    (lambda: sw.export(mass(), "controller", "c"), ArgumentError, "method: expected a sampled controller around the system"),
    (lambda: sw.export(loop(), "rk4", "c", dt=0.3), ArgumentError, "period: expected .* steps, got 0.1 with dt = 0.3"),
    (lambda: sw.linearised_loop(mass(), "rk4", dt=0.01, v=0.0, y=0.0), ArgumentError, "a sampled controller around it"),
    (lambda: sw.linearised_loop(loop(), adams_bashforth_2, dt=0.01, v=0.0, y=0.0), UnsupportedError, "more than v and y"),
    (lambda: sw.linearised_loop(loop(), "rk4", dt=0.03, v=0.0, y=0.0), ArgumentError, "period: expected a whole number"),
    (lambda: sw.linearised_loop(loop(), "rk4", dt=1e-7, v=0.0, y=0.0), ArgumentError, "at most 100000 steps in a period"),
    (lambda: run_around(lambda t, v, y: (y, v)), TraceError, "expected u of one number, got shape"),
    (lambda: run_around(lambda t, v, y: np.array([y, y])), TraceError, "expected u of one number"),
    (lambda: run_around(lambda t, v, y: 1.0 if y > 0.0 else 0.0), TraceError, "<lambda> .*if"),
    (lambda: run_around(lambda t, v, y: y + np.random.default_rng().uniform()), TraceError, "the same operations at every call"),
]  # fmt: skip

#: What takes no system with such a controller.
READING: list[Any] = [
    lambda: sw.stability_limit(loop(), "rk4"),
    lambda: sw.analyse(loop(), "rk4", dt=0.01),
    lambda: sw.jacobian(loop(), v=0.0, y=0.0),
    lambda: sw.lyapunov(loop(), "rk4", v=0.0, y=0.0, dt=0.01, steps=10),
    lambda: sw.discretise(linear_loop(), 0.1),
    lambda: sw.sampled_loop(linear_loop(), 0.8, 0.1),
    lambda: sw.LinearSystem.of(linear_loop()),
    lambda: sw.frequency_response(linear_loop(), 1.0),
    lambda: sw.margins(linear_loop()),
    lambda: 2.0 * linear_loop(),
    lambda: linear_loop() * linear_loop(),
    lambda: linear_loop().with_inputs(None),
    lambda: sw.charts.bode(linear_loop(), ["rk4"], dt=0.1),
    lambda: sw.equilibria(loop(gain=1.0), near=(0.0, 0.0)),
    lambda: sw.explain(loop(), "rk4"),
]


def test_what_is_wrong_is_refused_before_any_work() -> None:
    assert_raises(*WRONG)
    assert_raises(*((call, "sampled controller") for call in READING), kind=UnsupportedError)
