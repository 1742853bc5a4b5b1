"""What is made of a caller's arrays keeps what they held: the caller may go on to write into them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.base.immutable import FixedDict, Immutable, ValueEquality, frozen
from support.for_each import for_each

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
            "masses": ones(3),
            "fixed": np.array([0]),
            "gravity": ones(2),
            "drag": 1.0,
        },
        lambda: {"pairs": [(0, 1), (1, 2)], "layout": np.arange(6.0).reshape(3, 2), "fixed": [0]},
    ],
    sw.TransferFunction: [lambda: {"num": ones(2), "den": ones(3), "x": sampled()}],
    own: [lambda: {"stiffness": ones(2), "weights": ones(2), "push": sampled()}],
}


def arrays(what: Any) -> list[Any]:
    """All arrays that an object holds, in whatever it holds."""
    if isinstance(what, np.ndarray):
        return [what]
    if isinstance(what, (list, tuple)):
        return [each for part in what for each in arrays(part)]
    if isinstance(what, dict):
        return arrays(list(what.values()))
    return arrays(vars(what)) if isinstance(what, ValueEquality) else []


def of_caller(what: Any) -> list[Any]:
    """All arrays that a caller still has in hand; those within a system or an input are that one's own."""
    if isinstance(what, dict):
        return of_caller(list(what.values()))
    if isinstance(what, (list, tuple)):
        return [each for part in what for each in of_caller(part)]
    return [what] if isinstance(what, np.ndarray) else []


def write(what: Any) -> None:
    """Into every array and list that a caller gave."""
    if isinstance(what, np.ndarray):
        what[...] = 7 if what.dtype.kind in "iu" else np.nan
    elif isinstance(what, dict):
        write(list(what.values()))
    elif isinstance(what, (list, tuple)):
        for each in what:
            write(each)
        if isinstance(what, list):
            what.clear()


def test_no_public_class_is_left_out() -> None:
    public = {each for each in vars(sw).values() if inspect.isclass(each) and issubclass(each, Immutable)} | {
        getattr(sw, name) for name in dir(sw) if inspect.isclass(getattr(sw, name)) and issubclass(getattr(sw, name), Immutable)
    }
    assert public - set(MAKERS) == {sw.System, sw.Method, sw.Event}  # an abstract one, a record, a function


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


@for_each("kind", ["an array", "a view", "a read-only view", "a broadcast", "a memory view", "another order"])
def test_however_the_array_is_given(kind: str) -> None:
    mine = np.ones((3, 4))
    seen = mine.view()
    seen.flags.writeable = False
    views: dict[str, tuple[Any, Any]] = {
        "an array": (mine, mine),
        "a view": (mine[::2, 1], mine),
        "a read-only view": (seen, mine),
        "a broadcast": (np.broadcast_to(mine[0], (3, 4)), mine),
        "a memory view": (memoryview(mine), mine),
        "another order": (mine.T, mine),
    }
    array, owner = views[kind]
    system = sw.Oscillator(array)
    shape = system.omega.shape
    owner[...] = np.nan
    np.testing.assert_array_equal(system.omega, np.ones(shape))


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
    v, y = np.zeros(2), np.ones(2)
    runs = [
        sw.integrate(sw.Oscillator(), "dop853", v=v, y=y, tolerance=1e-6, at=[1.0, 2.0]),
        sw.integrate(sw.Oscillator(), "verlet", v=v, y=y, dt=0.1, steps=3, every=1),
        sw.integrate(sw.Oscillator(), "rk4", v=v, y=y, dt=0.1, steps=1),
    ]
    for run in runs:
        assert not any(np.may_share_memory(a, b) for a in arrays(run) for b in (v, y))


def test_defaults_of_own_equations() -> None:
    weights = np.ones(2)

    @sw.system
    def weighted(t: Any, v: Any, y: Any, *, weights: Any = weights) -> Any:
        return -weights[0] * y

    weights[:] = 4.0
    np.testing.assert_array_equal(weighted().parameters_given["weights"], np.ones(2))
    assert isinstance(weighted().parameters_given, FixedDict)
