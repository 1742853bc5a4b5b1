"""The real-time loop: in place, allocating nothing, the same to the bit as a run."""

import copy
import itertools
import pickle
import re
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, FixedError, NotFiniteError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.model import setting
from stepwell.runs.continuation import bits_of_parameters
from support import families
from support import own_systems as own
from support.cases import SYSTEMS, Case, drawn, fits, number
from support.families import family
from support.refusals import refused
from support.ways import kernels

#: A method of each kind of step, and of what it carries.
KINDS = ("false_euler", "rk4", "verlet", "leapfrog", "pefrl", "dop853", "taylor", "rodas4", "trapezoidal")


@pytest.mark.parametrize("method", KINDS)
def test_a_kick_is_seen(method: str) -> None:
    """What the user writes between steps counts, also for a method that keeps something else than v inside."""
    v, y = np.array([0.1]), np.array([1.0])
    w = sw.World(sw.Oscillator(1.3), method, v=v, y=y, dt=0.1, t0=0.4)
    w.step(7)
    assert (w.step_number, w.t) == (7, 0.4 + 7 * 0.1)
    v[0] += 0.5
    y[0] -= 0.1
    expected = sw.integrate(sw.Oscillator(1.3), method, v=v[0], y=y[0], dt=0.1, t0=0.4, steps=5, start_step=7)
    again = copy.copy(w)
    for each in (w, again):
        each.step(5)
        each.step(0)
        assert (each.v[0], each.y[0]) == (expected.v[-1], expected.y[-1])


@pytest.mark.parametrize("kind", ["free", "three bodies", "chain of nineteen", "sampled x, sinusoid a"])
@pytest.mark.parametrize("method", ["verlet", "rk4"])
def test_allocates_nothing(kind: str, method: str) -> None:
    rng = np.random.default_rng(0)
    system = SYSTEMS[kind](rng, 5)
    v, y = (rng.normal(size=(*s, 5)) for s in (system.v_shape, system.y_shape))
    w = sw.World(system, method, v=v, y=y, dt=1e-3)
    step = w.step
    step(3)
    before = sys.getallocatedblocks()
    for _ in range(1000):
        step(2)
    # Python's own counters may move by a few blocks; one block a step would be a thousand.
    assert sys.getallocatedblocks() - before < 20


def test_nothing_is_assigned() -> None:
    w = sw.World(sw.Oscillator(1.0), "verlet", v=np.zeros(3), y=np.ones(3), dt=0.1)
    for name in ("dt", "t", "method", "system", "v", "y", "step", "step_number", "anything"):
        match = rf"^{name}: a world's {name} cannot be assigned; .* World\(system, method, resume=world\), "
        refused(FixedError, match, setattr, w, name, 0.2)
    assert (w.dt, w.t, w.method.name) == (0.1, 0.0, "verlet")


COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda w: pickle.loads(pickle.dumps(w)),
    "resume": lambda w: sw.World(w.system, w.method, resume=w),
}


@pytest.mark.parametrize("method", KINDS)
def test_a_copy_goes_on_by_itself(method: str) -> None:
    """To the bit, also of what is carried; and neither sees what becomes of the other."""
    for members, steps, copying in itertools.product((3, 500), (0, 7), COPIES):
        case, y = (members, steps, copying), np.linspace(0.5, 1.5, members)
        w = sw.World(sw.Pendulum(), method, v=np.full(members, 0.1), y=y, dt=0.1, t0=0.3, start_step=4)
        w.step(steps)
        again = COPIES[copying](w)
        before = w.v.copy(), w.y.copy()
        again.step(20)
        np.testing.assert_array_equal((w.v, w.y), before, err_msg=str(case))
        assert (w.step_number, again.step_number) == (4 + steps, 24 + steps), case
        w.step(20)
        np.testing.assert_array_equal((again.v, again.y), (w.v, w.y), err_msg=str(case))
        assert again.t == w.t, case
        again.v[0] += 1.0
        assert w.v[0] != again.v[0], case


@pytest.mark.parametrize("method", ["verlet", "leapfrog", "rk4"])
def test_a_world_goes_on_from_a_run_and_a_run_from_a_world(method: str) -> None:
    system, options = sw.Oscillator(np.array([1.0, 1.3])), {"dt": 0.1}
    whole = sw.integrate(system, method, v=0.2, y=1.0, steps=60, **options)
    half = sw.integrate(system, method, v=0.2, y=1.0, steps=25, **options)
    w = sw.World(system, method, **options, resume=half)
    w.step(15)
    rest = sw.integrate(system, method, steps=20, **options, resume=w)
    np.testing.assert_array_equal((rest.v, rest.y), (whole.v, whole.y))


def test_a_controlled_world_keeps_its_energy_when_it_goes_on() -> None:
    """Its target is that of the start, not of where it was copied."""
    rng = np.random.default_rng(2)
    v, y = rng.normal(size=(2, 3, 2))
    for control in (sw.EnergyControl(0.3), sw.Projection()):
        w = sw.World(sw.NBody(), "false_euler", v=v.copy(), y=y.copy(), dt=0.01, control=control)
        w.step(9)
        again = pickle.loads(pickle.dumps(w))
        w.step(30)
        again.step(30)
        np.testing.assert_array_equal((again.v, again.y), (w.v, w.y))


def test_a_parameter_that_is_changed_later_changes_nothing() -> None:
    """The world has taken its numbers, and what it shows of them cannot be written to."""
    omega, samples = np.ones(3), np.zeros(5)
    w = sw.World(sw.Oscillator(omega, a=sw.Sampled(samples, 0.1)), "rk4", v=np.zeros(3), y=np.ones(3), dt=0.1, control=None)
    again = copy.copy(w)
    omega[:], samples[:] = 2.0, 9.0
    assert (w.system.omega == 1.0).all()  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="read-only"):
        w.system.omega[0] = 2.0  # type: ignore[attr-defined]
    w.step(5)
    again.step(5)
    np.testing.assert_array_equal(w.y, again.y)
    np.testing.assert_array_equal(copy.copy(w).system.omega, 1.0)  # type: ignore[attr-defined]


def test_how_many_steps() -> None:
    most = "n: expected 0 or more, up to 9007199254740990, got"
    wrong: list[tuple[Any, Any, str]] = [
        (1.5, sw.errors.DTypeError, "n: expected a whole number, got 1.5 (float)"),
        ("3", sw.errors.DTypeError, "n: expected a whole number, got '3' (str)"),
        (True, sw.errors.DTypeError, "n: expected a whole number, got True (bool)"),
        (2**63, sw.errors.ArgumentError, f"{most} 9223372036854775808"),
        (2**70, sw.errors.ArgumentError, f"{most} 1180591620717411303424"),
        (2**53, sw.errors.ArgumentError, f"{most} 9007199254740992"),
        (-1, sw.errors.ArgumentError, "n: expected 0 or more, got -1"),
    ]
    w = sw.World(sw.Oscillator(1.0), "rk4", v=np.zeros(3), y=np.ones(3), dt=0.1, start_step=2)
    for n, error, message in wrong:
        with pytest.raises(error) as caught:
            w.step(n)
        assert str(caught.value) == message
    assert w.step_number == 2
    np.testing.assert_array_equal(w.y, 1.0)
    for n, step_number in ((None, 3), (np.int64(3), 6), (np.array(3), 9)):
        w.step(n)  # type: ignore[arg-type]
        assert w.step_number == step_number


def test_steps_are_counted_up_to_what_is_exact() -> None:
    w = sw.World(sw.Oscillator(1.0), "rk4", v=np.zeros(3), y=np.ones(3), dt=1e-9, start_step=2**53 - 2)
    w.step(2)
    refused(sw.errors.ArgumentError, "n: expected 0 or more, up to 0, got 1", w.step)
    assert w.step_number == 2**53


def test_the_time_can_be_asked_for_while_it_is_stepped() -> None:
    """And who wants to step it meanwhile hears why not."""
    w = sw.World(sw.Pendulum(), "rk4", v=np.zeros(1000), y=np.ones(1000), dt=1e-3)
    thread = threading.Thread(target=w.step, args=(100_000,))
    thread.start()
    seen, busy = [], 0
    while thread.is_alive():
        seen.append((w.step_number, w.t))
        try:
            w.step(0)
        except sw.errors.BusyError as error:
            busy += "another thread" in str(error)
        time.sleep(1e-4)
    thread.join()
    assert busy
    assert seen == sorted(seen)
    assert len({k for k, _ in seen}) > 2
    assert all(t == k * 1e-3 for k, t in seen)
    assert w.step_number == 100_000


# Parameters that live: set, written to, and given to single members, to the bit of a new world that has them.
def able(name: str, most: int = 1) -> list[sw.Method]:
    """Methods that can step a system; among them one with a carry, if there is one. In the long run all."""
    system = SYSTEMS[name](np.random.default_rng(0), 1)
    every = [method for method in sw.methods() if fits(system, method) and not method.has_series]
    carries = [method for method in every if method.carry is not None and system.keeper is None]
    return every if families.LONG else [*drawn(every, most, "parameters", name), *drawn(carries, 1, name)]


#: By default a third of the systems in each test, others in each.
def some_systems(salt: str) -> Any:
    return pytest.mark.parametrize("name", family(SYSTEMS, lambda name: not families.LONG and number(name, salt) % 3 == 0))


def started(name: str, method: str, members: int, **options: Any) -> tuple[sw.World, sw.System]:
    """A world after some steps, and a system with other numbers."""
    system, arguments = Case(method, name, "direct", None).make(members, 1)
    dtype = options.get("dtype", "float64")
    v, y = (np.array(arguments[each], dtype) for each in "vy")
    world = sw.World(system, method, v=v, y=y, dt=0.05, t0=0.3, **options)
    world.step(3)
    return world, SYSTEMS[name](np.random.default_rng(7), members)


def numbers_of(system: sw.System) -> dict[str, Any]:
    """All parameters that can be set, without those of a control."""
    return {name: value for name, value in system.arguments().items() if name in setting.known_names(system)}


def assert_same_numbers(one: sw.System, other: sw.System, members: int) -> None:
    batch = (members,)
    assert list(bits_of_parameters(one, batch)) == list(bits_of_parameters(other, batch))


def assert_goes_on(world: sw.World, other: sw.World, steps: int = 4) -> None:
    for n in (1, steps):
        world.step(n)
        other.step(n)
        np.testing.assert_array_equal(world.v, other.v)
        np.testing.assert_array_equal(world.y, other.y)


@some_systems("set")
def test_set_is_a_new_world_that_goes_on(name: str) -> None:
    for method in able(name):
        for members in (1, 5):
            world, system = started(name, method.name, members)
            values = numbers_of(system)
            if not values:
                continue
            expected = setting.with_parameters(world.system, values)
            fresh = sw.World(expected, method, resume=world)
            world.set(**values)
            assert_same_numbers(world.system, expected, members)
            assert_goes_on(world, fresh)


@some_systems("arrays")
def test_arrays_are_a_new_world_that_goes_on(name: str) -> None:
    """Every parameter that reaches the step as it is, in batches of several shares, by each level of kernels in turn."""
    for i, members in enumerate((1, 5, 70)):
        method, levels = able(name)[-1], sw.isa_levels()
        with kernels(levels[(number(name) + i) % len(levels)]):
            world, system = started(name, method.name, members)
            into = setting.direct(system, (members,))
            for place in list(world.parameters):
                array = world.parameters[place]
                array[...] = into[place].numbers if place in into and array.shape == into[place].numbers.shape else 0.7 * array
                expected = setting.with_parameters(world._system, {place: array.copy()})
                assert_same_numbers(world.system, expected, members)
                assert_goes_on(world, sw.World(expected, method, resume=world), 2)


@pytest.mark.parametrize("name", ["free", "pendulum, damped", "three bodies, newton", "own: Duffing", "chain of nineteen"])
def test_float32_and_fused(name: str) -> None:
    for options in ({"dtype": "float32"}, {"fused": True}):
        world, system = started(name, "rk4", 5, **options)
        values = numbers_of(system)
        fresh = sw.World(setting.with_parameters(world.system, values), "rk4", resume=world)
        world.set(**values)
        assert_goes_on(world, fresh)
        for place in world.parameters:
            world.parameters[place][...] *= 0.9
        assert_goes_on(world, sw.World(world.system, "rk4", resume=world))


def large(members: int) -> dict[str, sw.System]:
    rng = np.random.default_rng(3)
    side = 30
    pairs = [(i * side + j, i * side + j + 1) for i in range(side) for j in range(side - 1)]
    pairs += [(i * side + j, i * side + side + j) for i in range(side - 1) for j in range(side)]
    places = np.stack(np.meshgrid(range(side), range(side)), axis=-1).reshape(-1, 2)
    batch = () if members == 1 else (members,)
    return {
        "bodies": sw.NBody(rng.uniform(0.1, 1.0, (40, *batch)), force="newton", softening=0.3),
        "chain": sw.Chain(400, stiffness=rng.uniform(0.5, 2.0, (401, *batch))),
        "net": sw.Springs(pairs, layout=places, masses=rng.uniform(0.5, 2.0, (side * side, *batch)), gravity=(0.0, -1.0)),
        "net on a floor": sw.Springs(pairs, layout=places, damping=0.1, gravity=(0.0, -1.0), floor=sw.Floor(restitution=0.3)),
        "matrix": sw.LinearSystem(
            0.1 * rng.normal(size=(60, 60, *batch)), rng.normal(size=(60, 1)), x=sw.Sampled(rng.normal(size=9), 0.2)
        ),
    }


@pytest.mark.parametrize("members", [1, 3])
@pytest.mark.parametrize("name", large(1))
def test_large_systems(name: str, members: int) -> None:
    """Rates by kernels of rows, and by tapes of their own; every parameter, and the force beside."""
    system = large(members)[name]
    batch = () if members == 1 else (members,)
    rng = np.random.default_rng(1)
    for method in ("false_euler", "leapfrog", "rk4"):
        if method == "leapfrog" and (system.velocity_term is not None or not system.second_order):
            continue
        v, y = 0.1 * rng.normal(size=(*system.v_shape, *batch)), rng.normal(size=(*system.y_shape, *batch))
        world = sw.World(system, method, v=v, y=y, dt=0.01, force=0.1 * np.ones_like(v))
        world.step(2)
        for place in world.parameters:
            world.parameters[place][...] *= 1.3
            assert_goes_on(world, sw.World(world.system, method, resume=world), 2)
        changes = {name: 0.9 * np.asarray(value) for name, value in numbers_of(system).items() if isinstance(value, np.ndarray)}
        for name_, value in changes.items():
            world.set(**{name_: value})
            assert_goes_on(world, sw.World(world.system, method, resume=world), 2)


RODS = sw.Rods([1.0, 2.0], [((0.0, 0.0), 0), (0, 1)], [1.0, 1.0])
BODIES = np.random.default_rng(0).normal(size=(3, 2, 4)), np.random.default_rng(1).normal(size=(3, 2, 4))


def assert_goes_on_anew(world: sw.World, control: Any = None) -> None:
    system = world.system.uncontrolled if control else world.system
    assert_goes_on(world, sw.World(system, "rk4", resume=world, control=control))


def test_the_gain_and_the_target_of_a_control() -> None:
    for control in (sw.EnergyControl(0.3), sw.EnergyControl(relative=0.1), sw.Projection("scaling")):
        v, y = (block.copy() for block in BODIES)
        world = sw.World(sw.NBody(softening=0.2), "rk4", v=v, y=y, dt=0.01, control=control)
        world.step(3)
        target = world.system.keeper.target
        if not isinstance(control, sw.Projection):
            world.set(gain=np.array([0.1, 0.2, 0.3, 0.4]))
            assert_goes_on_anew(world, world.system.keeper)
        world.set(target=target + 0.1, G=1.5)
        np.testing.assert_array_equal(world.system.keeper.target, target + 0.1)
        assert_goes_on_anew(world, world.system.keeper)


@sw.system
def swing(t: Any, v: Any, y: Any, *, omega: Any = 1.0) -> Any:
    return -omega * omega * np.sin(y)


@swing.invariant
def energy(v: Any, y: Any, *, omega: Any) -> Any:
    return 0.5 * v * v - omega * omega * np.cos(y)


def test_controls_of_an_invariant_and_of_lengths() -> None:
    for control in (sw.Control("energy", 0.3), sw.Projection("energy")):
        world = sw.World(swing(), "rk4", v=np.zeros(3), y=np.array([0.1, 1.0, 2.0]), dt=0.1, control=control)
        world.step(3)
        world.set(omega=1.2, **({"gain": 2.0} if isinstance(control, sw.Control) else {}))
        assert_goes_on_anew(world)
        world.parameters["omega"][...] = 1.1
        world.parameters["target"][...] = -0.5
        assert_goes_on_anew(world)
    for lengths, gain in ((sw.LengthControl(0.3), {"c": 0.5}), (sw.Projection("length"), {})):
        world = sw.World(RODS, "rk4", v=np.zeros((2, 2)), y=np.array([[1.0, 0.0], [2.0, 0.0]]), dt=0.01, control=lengths)
        world.step(3)
        world.set(gravity=9.81, **gain)
        assert_goes_on_anew(world)


@some_systems("reset")
def test_members_that_are_reset(name: str) -> None:
    """These have the bits of a fresh world of theirs, all others go on as if nothing had happened."""
    rng = np.random.default_rng(5)
    members, chosen = 7, [5, 1, 2]
    for method in able(name):
        world, _ = started(name, method.name, members)
        before = copy.copy(world)
        values = {}
        for place in list(world.parameters):
            array = setting.of_each_member(world.system, place, (members,))
            values[place] = 0.8 * array[..., chosen]
        v = rng.normal(size=(*world.system.v_shape, 3))
        y = 1.01 * world.y[..., chosen]
        v_before, y_before = world.v.copy(), world.y.copy()
        world.reset(chosen, v=v, y=y, **values)
        others = [i for i in range(members) if i not in chosen]
        np.testing.assert_array_equal(world.y[..., others], y_before[..., others])
        np.testing.assert_array_equal(world.v[..., others], v_before[..., others])
        fresh = sw.World(world.system, method, v=world.v.copy(), y=world.y.copy(), dt=0.05, t0=0.3, start_step=3, start=None)
        for n in (1, 3):
            for each in (world, before, fresh):
                each.step(n)
            for block, one, two in ((world.v, fresh.v, before.v), (world.y, fresh.y, before.y)):
                np.testing.assert_array_equal(block[..., chosen], one[..., chosen])
                np.testing.assert_array_equal(block[..., others], two[..., others])


def test_which_members() -> None:
    system = sw.Pendulum(np.ones((2, 3)))
    for members in ((0, 1), (slice(None), 2), np.array([[True, False, True], [False, False, True]]), 1):
        world = sw.World(system, "leapfrog", v=np.zeros((2, 3)), y=np.ones((2, 3)), dt=0.1)
        world.step(4)
        expected = world.y.copy()
        expected[members] = 0.3
        world.reset(members, y=0.3, omega=2.0)
        np.testing.assert_array_equal(world.y, expected)
        np.testing.assert_array_equal(world.system.omega, np.where(expected == 0.3, 2.0, 1.0))


def test_a_control_aims_at_the_new_state() -> None:
    new = np.random.default_rng(2).normal(size=(3, 2))
    for control in (sw.EnergyControl(0.3), sw.EnergyControl(relative=0.1), sw.Projection("nacozy")):
        ask: dict[str, Any] = {"dt": 0.01, "control": control}
        world = sw.World(sw.NBody(softening=0.2), "rk4", v=BODIES[0].copy(), y=BODIES[1].copy(), **ask)
        world.step(3)
        world = pickle.loads(pickle.dumps(world))
        world.reset(2, y=new)
        fresh = sw.World(sw.NBody(softening=0.2), "rk4", v=world.v[..., 2].copy(), y=new.copy(), start_step=3, **ask)
        for each in (world, fresh):
            each.step(5)
        np.testing.assert_array_equal(world.y[..., 2], fresh.y)


def test_copies_and_pickles_have_the_parameters() -> None:
    world = sw.World(sw.Pendulum(a=0.0), "leapfrog", v=np.zeros(2), y=np.ones(2), dt=0.1)
    world.parameters["a"][...] = 3.0
    world.step(2)
    for other in (copy.copy(world), copy.deepcopy(world), pickle.loads(pickle.dumps(world))):
        assert other.system == world.system == sw.Pendulum(a=3.0)
        expected = copy.copy(world)
        assert_goes_on(other, expected)
    world.parameters["a"][...] = 1.0  # not yet read by a step
    assert copy.copy(world).system == sw.Pendulum(a=1.0)


def test_an_array_for_each_member() -> None:
    world = sw.World(sw.Pendulum(), "false_euler", v=np.zeros(3), y=np.ones(3), dt=0.1)
    omega = world.parameters["omega"]
    assert omega.shape == ()
    world.set(omega=[1.0, 2.0, 3.0])
    assert world.parameters["omega"].shape == (3,)
    wide = world.parameters["omega"]
    for value in (2.0, np.array(3.0), [4.0]):  # the array stays as wide as it is
        world.set(omega=value)
        assert world.parameters["omega"] is wide
        np.testing.assert_array_equal(wide, np.full(3, np.max(value)))
        np.testing.assert_array_equal(world.system.omega, wide)
    with pytest.raises(ValueError, match="read-only"):
        omega[...] = 2.0
    assert_goes_on(world, sw.World(world.system, "false_euler", resume=world))
    refused(ShapeError, "omega: their batch", world.set, omega=np.ones((2, 3)))


def test_an_input() -> None:
    """Numbers of a sinusoid and samples are set by an input of the same kind."""
    for one, other in (
        (sw.Sinusoid(1.0, 2.0), sw.Sinusoid(0.5, 1.0, 0.2)),
        (sw.Sampled(np.arange(5.0), 0.1), sw.Sampled(np.arange(9.0), 0.2, start=0.1)),
    ):
        world = sw.World(sw.Pendulum(a=one), "rk4", v=np.zeros(3), y=np.ones(3), dt=0.1)
        world.step(3)
        world.set(a=other, omega=1.3)
        assert_goes_on(world, sw.World(sw.Pendulum(1.3, a=other), "rk4", resume=world))
        refused(UnsupportedError, "a: expected numbers, inputs and surfaces of the kinds", world.set, a=1.0)
        assert "a" not in world.parameters


def test_a_transfer_function() -> None:
    """Its matrices follow from its polynomials."""
    one, other = (sw.TransferFunction([2.0, 1.0], [0.5, a], x=1.0) for a in (1.0, 1.5))
    world = sw.World(one, "rk4", v=np.zeros((0, 2)), y=np.zeros((1, 2)), dt=0.1)
    world.step(3)
    world.set(den=[0.5, 1.5])
    assert_same_numbers(world.system, other, 2)
    assert_goes_on(world, sw.World(other, "rk4", resume=world))
    world.reset(0, y=0.0, den=[0.5, 2.0])
    np.testing.assert_array_equal(world.system.den, [[0.5, 0.5], [2.0, 1.5]])


def test_events_see_the_parameters() -> None:
    event = sw.Event(lambda t, v, y: y, name="zero")
    for write in (lambda w: w.set(omega=3.0), lambda w: w.parameters["omega"].fill(3.0)):
        world = sw.World(own.pendulum(omega=1.0), "rk4", v=np.zeros(2), y=np.ones(2), dt=0.01, events=event)
        world.step(10)
        write(world)
        fresh = sw.World(world.system, "rk4", v=world.v.copy(), y=world.y.copy(), dt=0.01, t0=0.0, start_step=10, events=event)
        for each in (world, fresh):
            each.step(200)
        np.testing.assert_array_equal(world.events["zero"].t, fresh.events["zero"].t)
        assert len(world.events["zero"].t)


@some_systems("refuses")
def test_what_the_core_refuses_is_what_the_system_refuses(name: str) -> None:
    """The bounds of numbers that are written are those of the arguments."""
    world, _ = started(name, able(name)[0].name, 1)
    for place in list(world.parameters):
        array = world.parameters[place]
        good = array.copy()
        for wrong in (-1.0, 0.0, 1e-9, np.nan, np.inf):
            array[...] = good
            array.reshape(-1)[0] = wrong
            try:
                setting.with_parameters(world._system, {place: array.copy()})
            except ArgumentError:
                refused(ArgumentError, place, world.step, 0)
                with pytest.raises(ArgumentError, match=place):
                    _ = world.system
            else:
                world.step(0)
        array[...] = good
        world.step(0)


def test_refusals() -> None:
    world = sw.World(sw.Pendulum(), "false_euler", v=np.zeros(2), y=np.ones(2), dt=0.1)
    before = world.system
    for values, kind, text in (
        ({"omega": -1.0}, ArgumentError, "omega: expected numbers above zero"),
        ({"omega": np.nan}, NotFiniteError, "omega: expected finite numbers"),
        ({"omga": 1.0}, UnknownNameError, "did you mean 'omega'"),
        ({"damping": 0.1}, UnsupportedError, "damping: it was left out, so it is no part of the step"),
        ({"omega": 2.0, "a": 1.0}, UnsupportedError, "a: it was left out"),
        ({"omega": "x"}, ArgumentError, "omega"),
    ):
        refused(kind, text, world.set, **values)
        refused(kind, text, world.reset, 0, **values)
        assert world.system == before
    bodies = sw.World(sw.NBody(), "false_euler", v=np.ones((3, 2)), y=np.arange(6.0).reshape(3, 2), dt=0.01)
    linear = sw.World(sw.LinearSystem([[0.0, -1.0], [1.0, 0.0]]), "rk4", v=np.zeros(1), y=np.ones(1), dt=0.1)
    calls: list[tuple[Callable[[], Any], Any, str]] = [
        (lambda: bodies.set(force="newton"), UnsupportedError, "force: it selects the operations"),
        (lambda: bodies.parameters["G"], UnsupportedError, "other numbers are computed from it; use world.set(G=…)"),
        (lambda: bodies.set(masses=[1.0, 1.0]), UnsupportedError, "masses: expected numbers, inputs and surfaces of the"),
        (lambda: bodies.reset(0, y=0.0), ArgumentError, "members: expected a world with a batch"),
        (lambda: world.reset(0), ArgumentError, "got none"),
        (lambda: world.reset(2, y=0.0), ArgumentError, "members: expected an index"),
        (lambda: world.reset([[0], [0, 1]], y=0.0), ArgumentError, "members: expected an index"),
        (lambda: world.reset([0, 0], y=0.0), ArgumentError, "each member once"),
        (lambda: world.reset([0, 1], y=[1.0, 2.0, 3.0]), ShapeError, "y: expected shape () or (2,), got (3,)"),
        (lambda: linear.set(A=[[-0.1, -1.0], [1.0, 0.0]]), UnsupportedError, "A: expected matrices of the structure"),
    ]
    for call, kind, text in calls:
        refused(kind, re.escape(text), call)
    single = sw.World(sw.Pendulum(), "rk4", v=np.zeros(1, "f4"), y=np.ones(1, "f4"), dt=0.1, dtype="float32")
    refused(ArgumentError, "largest of float32", single.set, omega=1e39)
    single.parameters["omega"][...] = 1e39
    refused(ArgumentError, "omega", single.step)


def test_a_refused_array_does_not_swallow_another() -> None:
    world = sw.World(sw.Pendulum(1.0, 0.1), "false_euler", v=np.zeros(1), y=np.ones(1), dt=0.1)
    omega, damping = world.parameters["omega"], world.parameters["damping"]
    omega[...], damping[...] = 2.0, np.nan
    refused(ArgumentError, "damping", world.step)
    damping[...] = 0.2
    assert_goes_on(world, sw.World(sw.Pendulum(2.0, 0.2), "false_euler", v=world.v.copy(), y=world.y.copy(), dt=0.1))


def test_parameters_are_a_mapping() -> None:
    world = sw.World(sw.Pendulum(a=0.0), "false_euler", v=np.zeros(1), y=np.ones(1), dt=0.1)
    assert list(world.parameters) == ["omega", "a"]
    assert len(world.parameters) == 2
    assert "damping" not in world.parameters
    world.parameters["a"] = 2.0
    assert world.parameters["a"] == 2.0
    assert repr(world.parameters) == "<parameters of a world: omega, a>"


def test_nothing_is_traced_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    world = sw.World(own.duffing(), "rk4", v=np.zeros(1), y=np.ones(1), dt=0.1)
    monkeypatch.setattr("stepwell.model.systems.own.Tracer", None)
    world.set(beta=0.3)
    world.set(beta=0.4, omega=1.5)
    world.parameters["gamma"][...] = 0.2
    world.step()
    assert world.system.parameters_given["gamma"] == 0.2
