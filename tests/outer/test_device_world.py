"""Worlds whose steps a device makes: the bits of the core, whatever is set, reset, pushed or copied in between."""

import copy
import itertools
import pickle
import threading
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.device import bodies, fixed, opencl
from stepwell.device import world as on_device
from stepwell.errors import ArgumentError, BusyError, UnsupportedError
from support.devices import needs_device, velocity_verlet
from support.families import family
from support.for_each import for_each
from support.own_methods import adams_bashforth_2
from support.refusals import refused

pytestmark = needs_device

N = 5


def start(v: Any = 0.0, y: Any = None, kind: Any = np.float64) -> tuple[Any, Any]:
    """Velocities and coordinates of N members."""
    y = np.linspace(0.1, 1.0, N) if y is None else y
    return np.full(np.shape(y), v, kind), np.array(y, kind)


def three_bodies() -> Any:
    """Of N members."""
    at = np.array([[0.0, 0.0], [1.0, 0.2], [-1.1, 0.5]])
    return np.repeat(at[..., np.newaxis], N, axis=-1) * np.linspace(1.0, 1.2, N)


Moves = Callable[[sw.World], None]


def stepping(world: sw.World) -> None:
    """Calls of several lengths."""
    for n in (1, 10, 0, 3, 200):
        world.step(n)


def setting(world: sw.World) -> None:
    """Parameters by ``set``, then by their arrays."""
    world.step(4)
    world.set(omega=1.1)
    world.step(3)
    world.parameters["omega"][...] = 1.2
    world.step(2)
    world.step(2)
    world.set(omega=np.linspace(1.0, 2.0, N))
    world.step(3)


def resetting(world: sw.World) -> None:
    """Members that start again, with parameters of their own and without."""
    world.step(7)
    world.reset([1, 3], y=0.5, omega=1.7)
    world.step(2)
    world.reset(0, v=0.1)
    world.step(5)
    world.reset(world.y > 0.2, omega=0.9)
    world.step(5)


def writing(world: sw.World) -> None:
    """The user writes to the state between steps."""
    world.step(6)
    world.v[2] = 0.25
    world.step(6)
    world.y[...] *= 0.5
    world.step(6)


METHODS = ("false_euler", "rk4", "leapfrog", adams_bashforth_2)


@sw.controller
def holds(t: Any, v: Any, y: Any, total: Any = 0.0, *, gain: Any = 1.0) -> Any:
    """One that samples, and adds up."""
    return gain * (0.5 - y) - v + total, total + 0.05 * (0.5 - y)


@sw.system
def mass(t: Any, v: Any, y: Any, *, u: float = 0.0) -> Any:
    """Moved by the controller."""
    return u - 0.1 * y


def loop() -> Any:
    """Both."""
    return mass().surrounded(holds(sets="u", gain=np.linspace(0.5, 2.0, N), period=0.15, delay=0.1))


def controlled(world: sw.World) -> None:
    """Calls of several lengths, and members that start again."""
    for n in (1, 4, 8):
        world.step(n)
    world.reset([1, 2], y=0.3)
    world.step(5)
    world.set(gain=1.5)
    world.step(9)


def both(make: Callable[[str], sw.World], moves: Moves) -> None:
    """Compare a world of the CPU and one of a device after the same moves."""
    one, other = make("cpu"), make("opencl")
    assert isinstance(other._core, on_device.World)
    for world in (one, other):
        moves(world)
    np.testing.assert_array_equal(one.v, other.v)
    np.testing.assert_array_equal(one.y, other.y)
    assert (one.t, one.step_number) == (other.t, other.step_number)


@pytest.mark.parametrize(
    ("method", "kind"),
    family(itertools.product(METHODS, ("float64", "float32")), lambda method, kind: kind == "float64" or method == "leapfrog"),
)
def test_a_device_has_the_bits_of_the_core(method: str, kind: str) -> None:
    """By every kind of method, and float32 by one whose velocities are computed."""

    def make(device: str) -> sw.World:
        v, y = start(kind=kind)
        return sw.World(sw.Pendulum(np.ones(N)), method, v=v, y=y, dt=0.1, dtype=kind, t0=0.5, device=device)

    for moves in (stepping, setting, resetting, writing):
        both(make, moves)


def pushed(world: sw.World) -> None:
    """By a force that changes."""
    for i in range(4):
        world.force[...] = 0.1 * i
        world.step(3)
        world.set(omega=1.0 + 0.1 * i)
        world.step(2)


def turned(world: sw.World) -> None:
    """Members start again under a control, whose target is then theirs."""
    world.step(5)
    world.reset([0, 2], y=0.9 * three_bodies()[..., :2], v=0.1)
    world.step(5)


@sw.system(order=1)
def decay(t: Any, y: Any, *, rate: float = 0.3) -> Any:
    """Of first order."""
    return -rate * y * (1.0 + y)


def writing_y(world: sw.World) -> None:
    """Coordinates and parameters are written."""
    world.step(3)
    world.y[1] = 0.7
    world.parameters["rate"][...] = 0.6
    world.step(4)


KINDS: dict[str, tuple[Callable[[], dict[str, Any]], Moves]] = {
    "a force": (lambda: {"system": sw.Pendulum(), "force": np.zeros(N)}, pushed),
    "a force of a leapfrog": (lambda: {"system": sw.Pendulum(), "force": np.zeros(N), "method": "leapfrog"}, pushed),
    "fused": (lambda: {"system": sw.Pendulum(), "fused": True}, resetting),
    "a control": (lambda: {"system": sw.NBody(), "y": three_bodies(), "control": sw.EnergyControl(0.3)}, turned),
    "a projection": (lambda: {"system": sw.NBody(), "y": three_bodies(), "control": sw.Projection()}, turned),
    "driven": (lambda: {"system": sw.Oscillator(1.0, 0.1, a=sw.Sinusoid(1.0, 2.0), form="physical")}, stepping),
    "a sampled input": (lambda: {"system": sw.Pendulum(a=sw.Sampled(np.sin(np.arange(4000.0)), 0.1))}, stepping),
    "three bodies": (lambda: {"system": sw.NBody(), "y": three_bodies(), "method": "leapfrog"}, stepping),
    "backward": (lambda: {"system": sw.Pendulum(), "dt": -0.05}, writing),
    "first order": (lambda: {"system": decay(), "v": None, "dt": 0.1}, writing_y),
    "a controller": (lambda: {"system": loop()}, controlled),
    "a controller and what is kept": (lambda: {"system": loop(), "method": adams_bashforth_2}, controlled),
    "exactly": (lambda: {"system": sw.Oscillator(1.0, 0.1, form="physical"), "method": "exact"}, writing),
}


@for_each("kind", KINDS)
def test_kinds_of_worlds(kind: str) -> None:
    def make(device: str) -> sw.World:
        options = {"method": "rk4", "dt": 0.05} | KINDS[kind][0]()
        v, y = start(y=options.pop("y", None))
        blocks = {"v": options.pop("v", v), "y": y}
        return sw.World(options.pop("system"), options.pop("method"), **blocks, **options, device=device)

    both(make, KINDS[kind][1])


def test_of_one_member_and_of_several_axes() -> None:
    for shape in ((), (1,), (2, 3)):

        def make(device: str, shape: Any = shape) -> sw.World:
            return sw.World(sw.Pendulum(), "leapfrog", v=np.zeros(shape), y=np.ones(shape), dt=0.1, device=device)

        both(make, stepping)


@pytest.mark.parametrize(
    ("system", "method"), [(sw.Pendulum(), "rk4"), (sw.Pendulum(), "leapfrog"), (sw.NBody(np.ones(64) / 64), "verlet")]
)
def test_copies_and_worlds_that_go_on(system: sw.System, method: str) -> None:
    def finals(device: str, goes_on: str) -> list[Any]:
        v, y = start(0.2) if isinstance(system, sw.Pendulum) else many_bodies(64, 3)
        world = sw.World(system, method, v=v, y=y, dt=0.01, device=device)
        world.step(3)
        several = [copy.copy(world), copy.deepcopy(world), pickle.loads(pickle.dumps(world))]
        assert all(type(each._core) is type(world._core) for each in several)
        several.append(sw.World(world.system, method, resume=world, device=goes_on))
        for each in several:
            each.step(4)
        run = sw.integrate(world.system, method, resume=world, steps=4, device=goes_on)
        return [*((each.v, each.y) for each in several), (run.v[-1], run.y[-1])]

    expected = finals("cpu", "cpu")
    for device, goes_on in (("opencl", "opencl"), ("opencl", "cpu"), ("cpu", "opencl")):
        np.testing.assert_array_equal(finals(device, goes_on), expected)


def test_events_and_growth_are_those_of_the_cpu() -> None:
    def fall(device: str) -> tuple[Any, ...]:
        v, y = start()
        lowest = sw.Event(lambda t, v, y: y, name="lowest")
        world = sw.World(sw.Pendulum(), "rk4", v=v, y=y, dt=0.05, events=lowest, device=device)
        world.step(100)
        found = world.events["lowest"]
        return v, y, found.t, found.member

    for one, other in zip(fall("cpu"), fall("opencl"), strict=True):
        np.testing.assert_array_equal(one, other)
    said = []
    for device in ("cpu", "opencl"):
        v, y = start()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            world = sw.World(sw.Oscillator(1.0), "rk4", v=v, y=y, dt=3.5, device=device)
            for _ in range(40):
                world.step(10)
        said.append([str(each.message) for each in caught])
    assert said[0] == said[1] != []


def test_parameters_that_are_refused() -> None:
    messages, states = [], []
    for device in ("cpu", "opencl"):
        v, y = start()
        world = sw.World(sw.Pendulum(), "leapfrog", v=v, y=y, dt=0.1, device=device)
        omega = world.parameters["omega"]
        world.step(2)
        omega[...] = np.inf
        with pytest.raises(ArgumentError, match="expected finite numbers") as caught:
            world.step(2)
        messages.append(str(caught.value).partition("got")[0])
        omega[...] = 1.5
        world.step(2)
        states.append((v, y))
    assert messages[0] == messages[1]
    np.testing.assert_array_equal(states[0], states[1])


def test_numbers_go_to_the_device_when_they_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    uploads = []
    numbers = on_device.Numbers

    def counted(*arguments: Any) -> Any:
        uploads.append(1)
        return numbers(*arguments)

    monkeypatch.setattr(on_device, "Numbers", counted)
    v, y = start()
    force = np.zeros(N)
    world = sw.World(sw.Pendulum(), "rk4", v=v, y=y, dt=0.1, force=force, device="opencl")
    omega = world.parameters["omega"]
    for _ in range(3):
        world.step(2)
    assert len(uploads) == 1
    omega[...] = 2.0
    world.step()
    force[...] = 1.0
    world.step()
    world.step()
    assert len(uploads) == 3


def test_the_variable_names_the_device_and_wrong_calls_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STEPWELL_DEVICE", "opencl")
    v, y = start()
    assert isinstance(sw.World(sw.Pendulum(), "rk4", v=v, y=y, dt=0.1)._core, on_device.World)
    assert not isinstance(sw.World(sw.Pendulum(), "rk4", v=v, y=y, dt=0.1, device="cpu")._core, on_device.World)
    v, y = start()
    refused(ArgumentError, "device: expected 'cpu'", sw.World, sw.Pendulum(), "rk4", v=v, y=y, dt=0.1, device="gpu")
    world = sw.World(sw.Pendulum(), "rk4", v=v, y=y, dt=0.1, device="opencl")
    for n in (-1, 1.5, "2"):
        refused((ArgumentError, TypeError), "n: expected", world.step, n)
    refused(UnsupportedError, "episodes", world._core.play, (0, 0), *[np.empty(0)] * 3)
    v, y = many_bodies(100, 2)
    system = sw.NBody(np.ones(100), floor=sw.Floor(normal=[0.0, 1.0], offset=-9.0))
    message = "device: runs of many bodies have surfaces on device='cpu' only"
    refused(UnsupportedError, message, sw.World, system, "leapfrog", v=v, y=y, dt=0.01, device="opencl")


def test_one_thread_at_a_time_and_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    v, y = start()
    world = sw.World(sw.Pendulum(), "leapfrog", v=v, y=y, dt=0.1, device="opencl")
    world.step(3)
    before = v.copy(), y.copy()
    inside, go_on = threading.Event(), threading.Event()

    def waits(*_: Any) -> None:
        inside.set()
        go_on.wait(60.0)
        raise KeyboardInterrupt

    monkeypatch.setattr(on_device.fixed, "run", waits)
    raised: list[type[BaseException]] = []

    def steps() -> None:
        try:
            world.step(5)
        except KeyboardInterrupt as error:
            raised.append(type(error))

    thread = threading.Thread(target=steps)
    thread.start()
    assert inside.wait(60.0)
    refused(BusyError, "another thread", world.step)
    go_on.set()
    thread.join()
    monkeypatch.undo()
    assert raised == [KeyboardInterrupt]
    np.testing.assert_array_equal((v, y), before)
    world.step(5)
    assert world.step_number == 8


def steps_of_many(world: sw.World) -> None:
    """Calls of several lengths, with other masses and softening, and bodies that are moved."""
    for n in (1, 2, 0, 1):
        world.step(n)
    world.set(masses=1.5 * world.system.masses)
    world.step(2)
    world.parameters["softening"][...] = 0.25
    world.step(1)
    world.step(1)
    world.y[3] += 0.125
    world.step(2)
    world.v[...] *= 0.5
    world.step(2)


def members_of_many(world: sw.World) -> None:
    """Members that start again, with parameters of their own."""
    world.step(2)
    world.reset([1], y=1.5 * many_bodies(world.y.shape[0], world.y.shape[1])[1][..., None], v=0.125)
    world.step(2)
    world.reset([0, 2], softening=0.3)
    world.step(2)
    if world.force is not None:
        world.force[...] *= -2.0
    world.step(2)


def many_bodies(n: int, dim: int, *batch: int) -> Any:
    """Their velocities and coordinates."""
    v, y = np.random.default_rng(n).normal(size=(2, n, dim, *batch))
    return v, y


#: Methods that carry v, that carry something else, that keep blocks, and one whose step begins where the last ended.
OF_MANY = ("leapfrog", "rk4", "verlet", "pefrl", adams_bashforth_2, velocity_verlet)


def of_many(n: int, method: Any, masses: Any, control: Any = None, **system: Any) -> Callable[[str], sw.World]:
    """Makes a world of n bodies, in the plane or in space."""

    def make(device: str) -> sw.World:
        v, y = many_bodies(n, 2 + n % 2)
        return sw.World(sw.NBody(masses, softening=0.125, **system), method, v=v, y=y, dt=0.01, control=control, device=device)

    return make


def test_many_bodies() -> None:
    """Of several numbers, by several methods, under controls."""
    for n, force in zip((64, 65, 100, 500), ("newton", "logarithmic") * 2, strict=True):
        some = np.random.default_rng(n).uniform(0.5, 2.0, n) / n
        some[5:20] = 0.0
        both(of_many(n, "leapfrog", some, force=force), steps_of_many)
    for method in OF_MANY:
        both(of_many(70, method, np.ones(70) / 70), steps_of_many)
    controls = (sw.EnergyControl(0.5), sw.Projection("scaling"), sw.Projection("nacozy"))
    for method, control in itertools.product(("rk4", "pefrl", velocity_verlet), controls):
        both(of_many(64, method, np.ones(64) / 64, control=control), steps_of_many)


def test_members_of_many_bodies_that_start_again() -> None:
    system = sw.NBody(np.ones(66) / 66, force="newton", softening=np.array([0.1, 0.2, 0.4]))
    for i, method in enumerate(OF_MANY):

        def make(device: str, method: Any = method, is_pushed: bool = i % 2 == 1) -> sw.World:
            v, y = many_bodies(66, 3, 3)
            force = np.random.default_rng(1).normal(size=(66, 3, 3)) if is_pushed else None
            return sw.World(system, method, v=v, y=y, dt=0.01, force=force, device=device)

        both(make, members_of_many)


@pytest.fixture
def traffic(monkeypatch: pytest.MonkeyPatch) -> tuple[list[int], list[str]]:
    """The sizes of arrays that are made on a device, and the kernels that are started there."""
    sizes: list[int] = []
    kernels: list[str] = []
    room, put = opencl.Machine.room, opencl.Machine.put
    monkeypatch.setattr(opencl.Machine, "room", lambda self, size: sizes.append(size) or room(self, size))
    monkeypatch.setattr(opencl.Machine, "put", lambda self, array: sizes.append(array.nbytes) or put(self, array))
    for module in (bodies, fixed):
        call = module._Run.call
        noted = lambda self, name, *rest, call=call: kernels.append(name) or call(self, name, *rest)  # noqa: E731
        monkeypatch.setattr(module._Run, "call", noted)
    return sizes, kernels


def test_many_bodies_keep_their_arrays_on_the_device(traffic: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A call of step makes no arrays of bodies there, and asks for no force that is known."""
    monkeypatch.setattr(bodies, "LAUNCH", 1e6)  # however busy the machine is, no launch is cut
    v, y = many_bodies(70, 2)
    world = sw.World(sw.NBody(np.ones(70) / 70), velocity_verlet, v=v, y=y, dt=0.01, device="opencl")
    world.step(2)
    sizes, kernels = traffic
    sizes.clear(), kernels.clear()
    world.step(1)
    assert kernels.count("pairs") == 1
    assert all(size <= 8 for size in sizes)
    world.y[0] += 0.5
    world.step(1)
    assert kernels.count("pairs") == 3


def test_arrays_stay_on_the_device_between_calls(traffic: Any) -> None:
    """From the second call on nothing is made there; what depends on parameters is, once they have changed."""
    v, y = start(0.2)
    omega = np.linspace(1.0, 2.0, N)
    world = sw.World(sw.Oscillator(omega=omega), "leapfrog", v=v, y=y, dt=0.05, device="opencl")
    world.step(5)
    sizes, kernels = traffic
    sizes.clear(), kernels.clear()
    for _ in range(2):
        world.step(5)
    assert (sizes, set(kernels)) == ([], {"steps"})
    world.set(omega=2.0)
    world.step(3)
    assert {"prepare", "start"} <= set(kernels)
    run = sw.integrate(sw.Oscillator(omega=omega), "leapfrog", v=0.2, y=start()[1], dt=0.05, steps=15)
    rest = sw.integrate(sw.Oscillator(omega=2.0), "leapfrog", v=run.v[-1], y=run.y[-1], dt=0.05, steps=3, start_step=15)
    np.testing.assert_array_equal(world.y, rest.y[-1])
    np.testing.assert_array_equal(world.v, rest.v[-1])
