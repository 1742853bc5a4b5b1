"""Systems, inputs, controls and methods cannot be changed, by assignment or by the arrays of which they were made."""

import copy
import inspect
import pickle
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base.immutable import FixedDict, Immutable, ValueEquality, changed, frozen, same
from stepwell.errors import FixedError
from support.cases import SYSTEMS
from support.for_each import for_each
from support.own_systems import duffing
from support.refusals import refused

MADE: dict[str, Callable[[], Any]] = {
    "a sinusoid": lambda: sw.Sinusoid([1.0, 2.0], 3.0),
    "samples": lambda: sw.Sampled(np.arange(6.0).reshape(3, 2), 0.1),
    "a control": lambda: sw.Control("energy", np.ones(2)),
    "a projection": lambda: sw.Projection(target=np.ones(2)),
    "a method": lambda: sw.method("rk4"),
    **{kind.__name__: partial(kind, np.ones(2)) for kind in (sw.EnergyControl, sw.LengthControl, sw.NormControl)},
    **{name: lambda make=make: make(np.random.default_rng(0), 2) for name, make in SYSTEMS.items()},
}
COPIES: dict[str, Callable[[Any], Any]] = {
    "itself": lambda one: one,
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
}


@for_each("copying", COPIES)
@for_each("name", MADE)
def test_nothing_of_it_is_assigned(name: str, copying: str) -> None:
    one = COPIES[copying](MADE[name]())
    before = pickle.dumps(one)
    for attribute in (*vars(one), "anything"):
        if attribute.startswith("_"):
            continue
        refused(FixedError, rf"^{attribute}: the {attribute} of \w+ cannot be assigned; .", setattr, one, attribute, 2.0)
        refused(FixedError, rf"^{attribute}: the {attribute} of \w+ cannot be deleted; .", delattr, one, attribute)
    for array in arrays(one, private=False):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 2.0
    assert pickle.dumps(one) == before


def test_the_message_says_how_a_world_goes_on() -> None:
    """And it does."""
    v, y = np.zeros(3), np.ones(3)
    world = sw.World(sw.Oscillator(1.0), "verlet", v=v, y=y, dt=0.1)
    world.step(7)
    with pytest.raises(FixedError, match=r"omega: .* World\(system, method, resume=world\)$"):
        world.system.omega = 2.0  # type: ignore[attr-defined]
    other = sw.World(sw.Oscillator(2.0), world.method, resume=world)
    other.step(5)
    expected = sw.integrate(sw.Oscillator(2.0), "verlet", v=v, y=y, dt=0.1, steps=5, start_step=7)
    np.testing.assert_array_equal(other.y, expected.y[-1])


def test_parameters_of_own_equations_are_not_changed() -> None:
    world = sw.World(SYSTEMS["own: Duffing"](np.random.default_rng(0), 2), "rk4", v=np.zeros(2), y=np.ones(2), dt=0.1)
    parameters = world.system.parameters_given  # type: ignore[attr-defined]
    calls = {"update": ({"beta": 2.0},), "__setitem__": ("beta", 2.0), "__ior__": ({"beta": 2.0},), "pop": ("beta",)}
    for change, arguments in (calls | {"clear": (), "setdefault": ("beta", 2.0)}).items():
        refused(FixedError, "parameters: those of a system cannot be assigned", getattr(parameters, change), *arguments)


def test_its_arguments_are_known() -> None:
    """To ``help`` and to editors, though objects are made in a way of their own."""
    assert list(inspect.signature(sw.Sinusoid).parameters) == ["amplitude", "omega", "phase"]
    assert list(inspect.signature(sw.Projection).parameters) == ["way", "target"]
    assert not inspect.signature(sw.System).parameters
    assert "friction" in inspect.signature(sw.Oscillator).parameters


def test_a_class_of_the_users_own_is_fixed_too_and_may_keep_what_is_private() -> None:
    class Twice(sw.Pendulum):
        def __init__(self) -> None:
            super().__init__(2.0)
            self.more = np.ones(2)
            self.omega = 2.0 * self.omega

    one = Twice()
    assert (one.omega, one.more.flags.writeable) == (4.0, False)
    one._known = 3
    with pytest.raises(FixedError, match="more: the more of Twice cannot be assigned; make another Twice"):
        one.more = np.zeros(2)
    other = changed(one, more=np.zeros(2))
    assert not other.more.flags.writeable
    assert one != other


TWO = np.ones(2)


@sw.system
def own(t: Any, v: Any, y: Any, *, stiffness: Any = 1.0, weights: Any = TWO, push: Any = 0.0) -> Any:
    return push - stiffness * weights[0] * y


def ones(*shape: int) -> Any:
    return np.ones(shape)


def sampled() -> Any:
    return sw.Sampled(ones(3, 2), 0.5)


#: Each public class, with arrays for all arguments that may be arrays: a list, since some exclude each other.
MAKERS: dict[Any, list[Callable[[], dict[str, Any]]]] = {
    sw.Aircraft: [
        lambda: {"inertia": np.array([0.6, 1.0, 1.5]), "damping": ones(3), "gains": ones(3), "roll": ones(2), "pitch": ones(2)},
        lambda: {"roll_torque": ones(2), "pitch_torque": ones(2), "yaw_torque": ones(2)},
    ],
    sw.Chain: [lambda: {"n": 3, "stiffness": ones(4), "mass": ones(3)}],
    sw.Control: [lambda: {"invariant": "energy", "gain": ones(2), "target": ones(2)}],
    sw.EnergyControl: [lambda: {"gain": ones(2), "target": ones(2)}, lambda: {"relative": ones(2)}],
    sw.Floor: [
        lambda: {"restitution": ones(2), "friction": ones(2), "normal": np.eye(2)[0], "offset": ones(2)},
        lambda: {"omega": ones(2), "way": "spring"},
    ],
    sw.LengthControl: [lambda: {"c": 0.5 * ones(2)}],
    sw.LinearSystem: [
        lambda: {"A": -np.eye(2), "B": ones(2, 1), "C": ones(1, 2), "D": ones(1, 1), "x": ones(2), "velocities": np.array([0])}
    ],
    sw.NBody: [lambda: {"masses": ones(3), "G": ones(2), "softening": ones(2), "floor": [sw.Floor(offset=-9.0 * ones(2))]}],
    sw.NormControl: [lambda: {"k": ones(2)}],
    sw.Oscillator: [
        lambda: {"omega": ones(2), "damping": ones(2), "x": ones(2), "a": sampled()},
        lambda: {"friction": ones(2), "drag": ones(2)},
    ],
    sw.Particles: [lambda: {"masses": ones(3), "gravity": ones(2), "drag": ones(2)}],
    sw.Pendulum: [lambda: {"omega": ones(2), "damping": ones(2), "a": sw.Sinusoid(ones(2), ones(2))}],
    sw.Pendulum3D: [lambda: {"length": ones(2), "gravity": ones(2)}],
    sw.Projection: [lambda: {"target": ones(2)}],
    sw.RestrictedThreeBody: [lambda: {"mu": 0.1 * ones(2)}],
    sw.RigidBody: [
        lambda: {"inertia": ones(3), "torque": [ones(2), None, sampled()], "damping": ones(3)},
        lambda: {"inertia": ones(3), "space_torque": ones(3), "weight": ones(2), "centre": ones(3)},
    ],
    sw.Rods: [
        lambda: {"masses": ones(2), "rods": np.array([[0, 1]]), "lengths": ones(1), "gravity": ones(2)},
        lambda: {"masses": ones(2), "rods": [(np.zeros(2), 0), (0, 1)], "lengths": ones(2)},
    ],
    sw.Sampled: [lambda: {"values": ones(3, 2), "interval": 0.5, "start": 0.0}],
    sw.Scene: [lambda: {"system": sw.NBody(ones(3)), "v": ones(3, 2), "y": np.arange(6.0).reshape(3, 2), "horizon": 1.0}],
    sw.Sinusoid: [lambda: {"amplitude": ones(2), "omega": ones(2), "phase": ones(2)}],
    sw.Sphere: [
        lambda: {"centre": ones(2), "radius": ones(2), "restitution": ones(2), "friction": ones(2)},
        lambda: {"centre": ones(2), "radius": ones(2), "omega": ones(2), "way": "spring"},
    ],
    sw.Springs: [
        lambda: {
            "pairs": np.array([[0, 1], [1, 2]]),
            "stiffness": ones(2),
            "rest": ones(2),
            "damping": ones(2),
            "fixed": np.array([0]),
        },
        lambda: {"pairs": [(0, 1), (1, 2)], "rest": ones(2), "masses": ones(3), "gravity": ones(2), "drag": 1.0},
        lambda: {"pairs": [(0, 1), (1, 2)], "layout": np.arange(6.0).reshape(3, 2), "fixed": [0]},
    ],
    sw.TransferFunction: [lambda: {"num": ones(2), "den": ones(3), "x": sampled()}],
    own: [lambda: {"stiffness": ones(2), "weights": ones(2), "push": sampled()}],
}


def arrays(what: Any, private: bool = True) -> list[Any]:
    """All arrays that an object holds, in whatever it holds; or in what is public."""
    if isinstance(what, np.ndarray):
        return [what]
    if isinstance(what, (list, tuple)):
        return [each for part in what for each in arrays(part, private)]
    if isinstance(what, dict):
        return arrays(list(what.values()), private)
    held = vars(what) if isinstance(what, ValueEquality) else {}
    return arrays([value for name, value in held.items() if private or not name.startswith("_")], private)


def of_caller(what: Any) -> list[Any]:
    """All arrays that a caller still has in hand; those within a system or an input are that one's own."""
    if isinstance(what, dict | list | tuple):
        return [each for part in (what.values() if isinstance(what, dict) else what) for each in of_caller(part)]
    return [what] if isinstance(what, np.ndarray) else []


def write(what: Any) -> None:
    """Into every array and list that a caller gave."""
    for array in of_caller(what):
        array[...] = 7 if array.dtype.kind in "iu" else np.nan
    for each in what.values():
        if isinstance(each, list):
            each.clear()


def test_no_public_class_is_left_out() -> None:
    public = {each for each in (*vars(sw).values(), *(getattr(sw, name) for name in dir(sw))) if inspect.isclass(each)}
    fixed = {each for each in public if issubclass(each, Immutable)}
    assert fixed - set(MAKERS) == {sw.System, sw.Method, sw.Event}  # an abstract one, a record, a function


@for_each("make, arguments", [(make, each) for make, all_of in MAKERS.items() for each in all_of])
def test_nothing_of_it_changes(make: Any, arguments: Callable[[], dict[str, Any]]) -> None:
    options = arguments()
    one = make(**options)
    assert not any(np.may_share_memory(a, b) for a in arrays(one) for b in of_caller(options))
    before, text = [each.copy() for each in arrays(one)], repr(one)
    write(options)
    assert repr(one) == text
    for was, each in zip(before, arrays(one), strict=True):
        np.testing.assert_array_equal(was, each)
        assert not each.flags.writeable


def test_however_the_array_is_given() -> None:
    for kind, view in {
        "an array": lambda mine: mine,
        "a view": lambda mine: mine[::2, 1],
        "a read-only view": read_only,
        "a broadcast": lambda mine: np.broadcast_to(mine[0], (3, 4)),
        "a memory view": memoryview,
        "another order": lambda mine: mine.T,
    }.items():
        mine = np.ones((3, 4))
        system = sw.Oscillator(view(mine))
        mine[...] = np.nan
        np.testing.assert_array_equal(system.omega, np.ones(system.omega.shape), err_msg=kind)


def read_only(array: Any) -> Any:
    seen = array.view()
    seen.flags.writeable = False
    return seen


def test_what_was_broadcast_stays_one_number_and_what_is_frozen_is_not_copied_again() -> None:
    system = sw.Oscillator(np.broadcast_to(np.array([2.0]), (10**7,)))
    assert system.omega.strides == (0,)
    assert frozen("omega", system.omega) is system.omega
    alone = np.ones(3)
    alone.flags.writeable = False
    assert sw.Oscillator(alone).omega is alone


def test_an_earlier_run_keeps_its_energy_and_is_saved_with_its_masses(tmp_path: Path) -> None:
    masses, v, y = np.array([1.0, 2.0, 3.0]), np.zeros((3, 2)), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    scene = sw.Scene(sw.NBody(masses), v=v, y=y, horizon=1.0)
    first = sw.integrate(sw.NBody(masses), "rk4", v=v, y=y, dt=0.01, steps=3, every=1)
    energy = first.energy.copy()
    masses[:], v[:], y[:] = 5.0, 1.0, np.nan
    np.testing.assert_array_equal(first.energy, energy)
    first.save(tmp_path / "run.npz")
    loaded = sw.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(loaded.system.masses, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(scene.run("rk4", 0.01, steps=3, every=1).y, first.y)


def test_states_of_a_run() -> None:
    start: dict[str, Any] = {"v": np.zeros(2), "y": np.ones(2)}
    ways = ("dop853", {"tolerance": 1e-6, "at": [1.0, 2.0]}), ("verlet", {"dt": 0.1, "steps": 3, "every": 1})
    for method, options in (*ways, ("rk4", {"dt": 0.1, "steps": 1})):
        run = sw.integrate(sw.Oscillator(), method, **start, **options)
        assert not any(np.may_share_memory(a, b) for a in arrays(run) for b in start.values())


def test_defaults_of_own_equations() -> None:
    weights = np.ones(2)

    @sw.system
    def weighted(t: Any, v: Any, y: Any, *, weights: Any = weights) -> Any:
        return -weights[0] * y

    weights[:] = 4.0
    np.testing.assert_array_equal(weighted().parameters_given["weights"], np.ones(2))
    assert isinstance(weighted().parameters_given, FixedDict)


def received(what: Any, *, first: int = 1, writeable: bool = False) -> Any:
    """As Dask sends it: arrays beside the pickle (protocol 5), in joined messages, so read-only and from an odd byte on."""
    buffers: list[pickle.PickleBuffer] = []
    data = pickle.dumps(what, protocol=5, buffer_callback=buffers.append)
    parts = []
    for each in buffers:
        message = bytes(first) + each.raw().tobytes()
        parts.append(memoryview(bytearray(message) if writeable else message)[first:])
    return pickle.loads(data, buffers=parts)


def test_such_an_array_is_what_it_says() -> None:
    there = received(np.arange(5.0))
    assert not there.flags.aligned
    assert not there.flags.writeable
    np.testing.assert_array_equal(there, np.arange(5.0))


@for_each("writeable", [False, True])
@for_each("name", SYSTEMS)
def test_systems_that_were_received(name: str, writeable: bool) -> None:
    make: Callable[..., sw.System] = partial(SYSTEMS[name], np.random.default_rng(1), 3)
    system = make()
    there = received(system, writeable=writeable)
    assert there == system
    assert same(there, system)
    rng = np.random.default_rng(2)
    v, y = (rng.uniform(0.5, 1.0, (*shape, 3)) for shape in (system.v_shape, system.y_shape))
    with np.errstate(all="ignore"):
        runs = [
            sw.integrate(each, "false_euler", v=received(v), y=received(y), dt=1e-3, steps=3, every=1) for each in (there, system)
        ]
    np.testing.assert_array_equal(runs[0].y, runs[1].y)
    np.testing.assert_array_equal(runs[0].v, runs[1].v)


@for_each("method", ["rk4", "verlet", "leapfrog"])
def test_worlds_that_were_received(method: str) -> None:
    y = np.linspace(0.5, 1.0, 7)
    world = sw.World(sw.Pendulum(np.linspace(1.0, 2.0, 7)), method, v=np.zeros(7), y=y, dt=0.1)
    world.step(3)
    there = received(world)
    for each in (world, there):
        each.step(10)
    np.testing.assert_array_equal(there.y, world.y)
    np.testing.assert_array_equal(there.v, world.v)


def test_runs_and_what_goes_on_from_them() -> None:
    gamma = np.linspace(0.1, 0.5, 5)
    run = sw.integrate(duffing(gamma=gamma), "rk4", v=0.0, y=1.0, dt=0.1, steps=20, every=3)
    there = received(run)
    assert there == run
    rest, same_rest = (sw.integrate(duffing(gamma=gamma), "rk4", steps=5, resume=received(each)) for each in (run, there))
    np.testing.assert_array_equal(rest.y, same_rest.y)
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(sw.Oscillator([1.0, 30.0]), "leapfrog", v=0.0, y=1.0, dt=0.1, steps=1000)
    rest = sw.integrate(sw.Oscillator([1.0, 30.0]), "leapfrog", steps=10, resume=received(run))
    np.testing.assert_array_equal(rest.first_bad_step, run.first_bad_step)
