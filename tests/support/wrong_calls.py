"""What tests of wrong calls share."""

from __future__ import annotations

import datetime
import inspect
import warnings
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.analysis import stability
from stepwell.views import charts

from support import own_systems as own


class Refuses:
    """Something that NumPy asks for an array, and that has none."""

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise TypeError("no array here")


class WithGradient:
    """As a tensor that a gradient is computed through: whatever asks for its numbers gets an error of its own kind."""

    def __init__(self, array: Any) -> None:
        self.array = np.asarray(array)

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.")

    def __dlpack__(self, **_: Any) -> Any:
        raise BufferError("Can't export tensors that require gradient")

    def __dlpack_device__(self) -> Any:
        return 1, 0

    def __len__(self) -> int:
        return len(self.array)

    def __getitem__(self, index: Any) -> WithGradient:
        return WithGradient(self.array[index])

    def __float__(self) -> float:
        return float(self.array)


def _misaligned(shape: tuple[int, ...]) -> Any:
    size = int(np.prod(shape))
    return np.frombuffer(b"x" + np.ones(size).tobytes(), np.float64, offset=1).reshape(shape)


def _recursive() -> Any:
    whole: list[Any] = []
    whole.append(whole)
    return whole


def _readonly() -> Any:
    array = np.ones(3)
    array.flags.writeable = False
    return array


def _matrix() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PendingDeprecationWarning)
        return np.asmatrix(np.ones((2, 2)))


RAGGED: Any = [[1.0], [1.0, 2.0]]


#: What is given in the place of each argument: Python text, which is evaluated for each call.
_JUNK = [
    "None", "True", "np.True_", "0", "-1", "10**12", "2**70", "10**400", "10**5000", "1.5", "0.0", "5e-324", "1.7e308",
    'float("nan")', 'float("inf")', "-np.inf", "1j", '"junk"', '"x" * 10**6', '""', '"1.0"', 'b"rk4"', "[]", "[[]]", "()", "{}",
    "{1.0}", '{"a": 1}', "object()", "sw.Oscillator", "lambda *_: None", "np", '(x for x in "ab")', "RAGGED", "_recursive()",
    "Refuses()", '["rk4", 3]', "[None]", '[float("nan")]', "range(3)", "Fraction(1, 3)", "Decimal(1)",
    "datetime.date(2002, 1, 1)", 'Path("x")', "np.zeros(0)", "np.zeros((2, 0))", "np.ones(3)", "np.full(7, 0.5)",
    "np.ones((2, 3))", "np.ones((1000, 1))", "np.ones((1,) * 26)", "np.ones((1,) * 32)", "np.array(0.5)",
    'np.array(["rk4", "x"])', 'np.array("rk4")', "np.array([1.0, None], dtype=object)", "np.array([1.0, 2**70], dtype=object)",
    "np.ones(3, complex)", "np.array([True, False])", 'np.array(["2002-01-01"], dtype="datetime64[D]")',
    'np.zeros(3, dtype=[("a", float)])', "np.ma.masked_array([1.0, 2.0, 3.0], [False, True, False])", "np.ma.masked", "_matrix()",
    'np.ones(3, ">f8")', "np.ones(3, np.float16)", "np.ones(3, np.longdouble)", "np.full(3, np.finfo(np.longdouble).max)",
    "np.ones(3, np.int8)", "np.full(3, 2**64 - 1, np.uint64)", "_readonly()", "np.ones(3)[::-1]", "np.ones(6)[::2]",
    "_misaligned((3,))", "_misaligned((3, 2))", "np.broadcast_to(np.float64(1.0), (3,))", "WithGradient(np.ones(3))",
    "[WithGradient(1.0), WithGradient(0.5)]", "np.broadcast_to(np.float64(1.0), (10**11,))",
    "np.broadcast_to(np.ones((3, 1)), (3, 10**11))", "np.broadcast_to(1, (10**11,))", "range(10**11)", "sw.Pendulum()",
    "sw.EnergyControl(0.1)", "sw.Sampled(np.ones((2, 5)), 0.1)", 'sw.method("verlet")',
    'sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=np.ones(2), dt=0.1, steps=2)', "sw.scenes.clover()",
]  # fmt: skip
_MAKERS = (Refuses, WithGradient, Fraction, Decimal, Path, _misaligned, _recursive, _readonly, _matrix)
_NAMES = {"np": np, "sw": sw, "datetime": datetime, "RAGGED": RAGGED} | {each.__name__: each for each in _MAKERS}
JUNK: dict[str, Callable[[], Any]] = {text: partial(eval, text, _NAMES) for text in _JUNK}

FREE: dict[str, Any] = {"system": sw.Oscillator(), "method": "rk4", "v": 0.0, "y": 1.0}
BODIES: dict[str, Any] = {"system": sw.NBody(), "method": "rk4", "v": 0.0, "y": np.arange(6.0).reshape(3, 2)}
PLANE = [[0.0, -1.0], [1.0, 0.0]]
OF_METHODS = {"methods": ["rk4"]}
KEPLER = sw.scenes.kepler()


def passage(t: Any, v: Any, y: Any) -> Any:
    return y


PASSAGES = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=[1.0, 2.0], dt=0.1, steps=30, events=passage).events["passage"]


def _world(**arguments: Any) -> sw.World:
    arrays = {name: np.full(3, arguments[name]) for name in ("v", "y") if isinstance(arguments.get(name), float)}
    return sw.World(**arguments | arrays)


def _set(**parameters: Any) -> sw.World:
    world = sw.World(sw.Pendulum(a=0.0), "leapfrog", v=np.zeros(3), y=np.ones(3), dt=0.1)
    world.step(2)
    world.set(**parameters)
    world.step(2)
    return world


def _reset(members: Any, **states: Any) -> sw.World:
    world = sw.World(sw.Pendulum(np.ones(3)), "leapfrog", v=np.zeros(3), y=np.ones(3), dt=0.1)
    world.step(2)
    world.reset(members, **states)
    world.step(2)
    return world


def _of_run(name: str) -> Callable[..., Any]:
    return getattr(sw.integrate(**FREE, dt=0.1, steps=3, every=1), name)


@sw.system(order=1, mass=[[1.0, 0.0], [0.0, 0.0]])
def divider(t: Any, y: Any) -> Any:
    """A charge, and the current that it drives."""
    return [-y[1], y[0] - 2.0 * y[1]]


FILES = TemporaryDirectory()
SAVED, SAVED_OWN = (Path(FILES.name) / f"{name}.npz" for name in ("run", "own"))
A_RUN = sw.integrate(sw.Oscillator(np.ones(3)), "rk4", v=0.0, y=1.0, dt=0.1, steps=3)


@sw.controller
def held(t: Any, v: Any, y: Any, total: Any = 0.0, *, gain: Any = 1.0) -> Any:
    """A controller that adds up what it sees."""
    return gain * (1.0 - y) + total, total + y


#: Every public function and class that users call, with arguments that are right and quick. Several entries of one name are
#: several ways to call it, told apart by what follows a blank.
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Oscillator": (sw.Oscillator, {"omega": 1.0, "damping": 0.1, "x": 0.0, "a": 0.0, "form": "physical"}),
    "Aircraft": (sw.Aircraft, {"form": "euler", "inertia": [0.6, 1.0, 1.5], "damping": np.ones(3), "gains": np.ones(3),
        "roll": 30.0, "pitch": 0.0, "roll_torque": None, "pitch_torque": 0.1, "yaw_torque": sw.Sinusoid(1.0, 1.0),
        "controllers": True}),
    "Aircraft without controllers": (sw.Aircraft, {"roll": 0.0, "controllers": False}),
    "Aircraft.attitude": (sw.Aircraft("quaternion").attitude, {"roll": 10.0, "pitch": 20.0, "yaw": 30.0}),
    "Aircraft.angles": (sw.Aircraft("quaternion").angles, {"y": np.ones((5, 4)), "axis": 1}),
    "Aircraft.rotation": (sw.Aircraft().rotation, {"y": np.ones((3, 2)), "axis": 0}),
    "Aircraft.commanded": (sw.Aircraft(roll=3.0).commanded, {"name": "roll", "t": [0.0, 1.0]}),
    "Pendulum": (sw.Pendulum, {"omega": 1.0, "damping": 0.1, "a": 0.0}),
    "Pendulum3D": (sw.Pendulum3D, {"length": 1.0, "gravity": 1.0, "floor": sw.Floor()}),
    "RestrictedThreeBody": (sw.RestrictedThreeBody, {"mu": 0.1}),
    "RigidBody": (sw.RigidBody, {"inertia": [1.0, 2.0, 3.0], "torque": [0.1, None, 0.2], "space_torque": [0.0, 0.1, 0.2],
        "damping": 0.1, "weight": 1.0, "centre": [0.0, 0.0, 1.0]}),
    "Rods": (sw.Rods, {"masses": [1.0, 1.0], "rods": [((0.0, 0.0), 0), (0, 1)], "lengths": [1.0, 1.0], "gravity": 1.0,
        "floor": [sw.Floor()], "dim": 2}),
    "Chain": (sw.Chain, {"n": 3, "stiffness": 1.0, "mass": 1.0}),
    "LinearSystem": (sw.LinearSystem, {"A": PLANE, "B": [[1.0], [0.0]], "C": [[1.0, 0.0]], "D": [[1.0]], "x": [1.0],
        "velocities": 1}),
    "LinearSystem.of": (sw.LinearSystem.of, {"system": sw.Oscillator(x=1.0), "x": [1.0, None], "velocities": 1}),
    "LinearSystem.with_inputs": (sw.TransferFunction(1.0, [1.0, 1.0]).with_inputs, {"x": 1.0}),
    "TransferFunction": (sw.TransferFunction, {"num": [1.0, 2.0], "den": [1.0, 0.1, 2.0], "x": 1.0, "velocities": 1}),
    "series": (sw.series, {"first": sw.TransferFunction(1.0, [1.0, 1.0]), "second": 2.0}),
    "parallel": (sw.parallel, {"first": sw.TransferFunction(1.0, [1.0, 1.0]), "second": 2.0}),
    "feedback": (sw.feedback, {"forward": sw.TransferFunction(1.0, [1.0, 1.0]), "back": 2.0, "sign": -1}),
    "LinearSystem.split": (sw.LinearSystem(PLANE).split, {"state": [1.0, 0.0]}),
    "LinearSystem.state": (sw.LinearSystem(PLANE).state, {"v": [1.0], "y": [0.0]}),
    "NBody": (sw.NBody, {"masses": [1.0, 1.0], "force": "newton", "G": 1.0, "softening": 0.1, "dim": 2}),
    "Springs": (sw.Springs, {"pairs": [(0, 1), (1, 2)], "stiffness": 1.0, "rest": 1.0, "layout": np.zeros((3, 2)), "damping": 0.1,
        "masses": 1.0, "fixed": [0], "gravity": (0.0, -1.0), "drag": 0.1, "floor": sw.Floor(), "dim": 2}),
    "Springs.safe_step": (sw.Springs([(0, 1)], rest=1.0).safe_step, {"method": "rk4"}),
    "NBody floor": (sw.NBody, {"masses": [1.0], "floor": sw.Floor()}),
    "Particles": (sw.Particles, {"masses": [1.0, 1.0], "gravity": 1.0, "drag": 0.1, "floor": [sw.Floor()], "dim": 2}),
    "Floor": (sw.Floor, {"restitution": 0.5, "friction": 0.1, "normal": (0.0, 1.0), "offset": 0.0, "way": "safe"}),
    "Floor spring": (sw.Floor, {"way": "spring", "omega": 1.0}),
    "Sphere": (sw.Sphere, {"centre": (0.0, 0.0), "radius": 1.0, "inside": True, "restitution": 0.5, "friction": 0.1,
        "way": "safe"}),
    "Sphere spring": (sw.Sphere, {"centre": (0.0, 0.0), "radius": 1.0, "way": "spring", "omega": 1.0}),
    "Sinusoid": (sw.Sinusoid, {"amplitude": 1.0, "omega": 1.0, "phase": 0.0}),
    "Sampled": (sw.Sampled, {"values": [1.0, 2.0], "interval": 0.1, "start": 0.0}),
    "LengthControl": (sw.LengthControl, {"c": 0.5}),
    "NormControl": (sw.NormControl, {"k": 0.5}),
    "EnergyControl": (sw.EnergyControl, {"gain": 0.1, "form": "limited", "target": 1.0}),
    "EnergyControl relative": (sw.EnergyControl, {"relative": 0.1}),
    "Event": (sw.Event, {"function": passage, "direction": 1, "terminal": False, "most": 10, "name": "passage"}),
    "Occurrences.of": (PASSAGES.of, {"index": 0}),
    "Projection": (sw.Projection, {"way": "scaling", "target": 1.0}),
    "method": (sw.method, {"name": "rk4"}),
    "integrate": (sw.integrate, {**FREE, "dt": 0.1, "steps": 10, "every": 2, "record": ["energy"], "t0": 0.0, "start_step": 0,
        "threads": 1, "backend": "rust", "form": "direct", "progress": False, "start": None, "resume": None, "control": None,
        "tolerance": None, "at": None, "max_steps": None}),
    "integrate events": (sw.integrate, {**FREE, "dt": 0.1, "steps": 10, "events": [sw.Event(passage, terminal=True)]}),
    "integrate events, adaptive": (sw.integrate, {**FREE, "method": "merson", "tolerance": 1e-6, "at": [1.0],
        "events": [passage]}),
    "integrate bodies": (sw.integrate, {**BODIES, "dt": 0.1, "steps": 10, "record": ["momentum"],
        "control": sw.EnergyControl(0.1)}),
    "integrate rods": (sw.integrate, {"system": sw.Rods([1.0, 1.0], [(0, 1)], 1.0), "method": "rk4", "v": 0.0,
        "y": [[0.0, 0.0], [1.0, 0.0]], "dt": 0.1, "steps": 10, "record": ["length_error"], "control": sw.LengthControl(0.5)}),
    "integrate Verlet": (sw.integrate, {**FREE, "method": "verlet", "dt": 0.1, "steps": 10, "start": "first_order",
        "backend": "numpy"}),
    "integrate matrix": (sw.integrate, {**FREE, "dt": 0.1, "steps": 10, "form": "matrix"}),
    "prepare": (sw.prepare, {**FREE, "dt": 0.1, "steps": 10, "every": 5, "record": ["energy"]}),
    "integrate tolerance": (sw.integrate, {**FREE, "method": "merson", "tolerance": (1e-3, 1e-3), "at": [0.5, 1.0],
        "max_steps": 100, "dt": 0.1, "threads": 1, "t0": 0.0, "record": ["energy"], "backend": "rust", "progress": False}),
    "Run.quantity": (_of_run("quantity"), {"name": "energy"}),
    "scenes.aircraft": (sw.scenes.aircraft, {"form": "euler", "roll": 40.0, "pitch": 0.0}),
    "scenes.gimbal_trap": (sw.scenes.gimbal_trap, {"form": "quaternion", "roll": 2.0, "torque": -1.5}),
    "World": (_world, {**FREE, "dt": 0.1, "t0": 0.0, "start_step": 0, "start": None, "control": None, "force": None}),
    "World.set": (_set, {"omega": 2.0, "a": 1.0}),
    "World.reset": (_reset, {"members": 1, "v": 0.5, "y": 0.2, "omega": 2.0}),
    "World events": (_world, {**FREE, "dt": 0.1, "events": [sw.Event(passage)]}),
    "scenes.rober": (sw.scenes.rober, {"horizon": 40.0}),
    "scenes.oregonator": (sw.scenes.oregonator, {"horizon": 360.0}),
    "scenes.van_der_pol": (sw.scenes.van_der_pol, {"mu": 10.0}),
    "scenes.scene": (sw.scenes.scene, {"name": "clover"}),
    "scenes.chain": (sw.scenes.chain, {"n": 4, "modes": {1: 1.0}}),
    "scenes.bouncing_ball": (sw.scenes.bouncing_ball, {"restitution": 0.8, "height": 1.0, "gravity": 9.81}),
    "scenes.conical_pendulum": (sw.scenes.conical_pendulum, {"angle": 60.0}),
    "scenes.double_pendulum": (sw.scenes.double_pendulum, {"angles": [120.0, 150.0]}),
    "scenes.triple_pendulum": (sw.scenes.triple_pendulum, {"angles": [90.0, 120.0, 150.0]}),
    "quaternion.from_axis_angle": (sw.quaternion.from_axis_angle, {"axis": [0.0, 1.0, 1.0], "angle": 0.5}),
    "quaternion.matrix": (sw.quaternion.matrix, {"q": [1.0, 0.0, 0.0, 0.5]}),
    "quaternion.product": (sw.quaternion.product, {"p": [1.0, 0.0, 0.0, 0.5], "q": np.ones((4, 2))}),
    "orbits.system": (sw.orbits.system, {"masses": [1.0, 1e-3, 1e-3], "a": [1.0, 2.0], "e": 0.1, "inclination": [0.1, 0.2],
        "node": 0.3, "mean_anomaly": 0.5, "argument_of_periapsis": 0.2, "around": [0, [0, 1]], "G": 1.0, "softening": 0.0,
        "dim": 3}),
    "orbits.system by time": (sw.orbits.system, {"masses": [1.0, 1e-3], "period": 2.0, "longitude_of_periapsis": 0.2,
        "time_of_periapsis": 0.5, "t": 1.0}),
    "orbits.system by angle": (sw.orbits.system, {"masses": [1.0, 1e-3], "periapsis": 1.0, "e": 1.0, "true_anomaly": 0.5}),
    "orbits.system by longitude": (sw.orbits.system, {"masses": [1.0, 1e-3], "periapsis": 1.0, "mean_longitude": 0.5}),
    "orbits.elements": (sw.orbits.elements, {"of": sw.NBody([1.0, 1.0], force="newton"), "v": [[0.0, 0.0], [0.0, 1.0]],
        "y": [[0.0, 0.0], [1.0, 0.0]], "t": 0.0, "around": "jacobi"}),
    "orbits.state": (sw.orbits.state, {"mu": 1.0, "t": 0.5, "dim": 3, "a": 1.0, "eccentric_anomaly": 0.5, "e": 0.1}),
    "orbits.state by longitude": (sw.orbits.state, {"mu": 1.0, "a": -1.0, "true_longitude": 0.5, "e": 1.1}),
    "orbits.of_state": (sw.orbits.of_state, {"mu": 1.0, "v": [0.0, 1.0], "y": [1.0, 0.0], "t": 0.5}),
    "orbits.corrected": (sw.orbits.corrected, {"system": sw.NBody([1.0, 0.1], force="newton"), "v": [[0.0, -0.1], [0.0, 1.0]],
        "y": [[-0.1, 0.0], [1.0, 0.0]], "dt": 0.1, "order": 5}),
    "orbits.uncorrected": (sw.orbits.uncorrected, {"of": sw.NBody([1.0, 0.1], force="newton"), "v": [[0.0, -0.1], [0.0, 1.0]],
        "y": [[-0.1, 0.0], [1.0, 0.0]], "dt": 0.1, "order": 3}),
    "orbits.jacobi": (sw.orbits.jacobi, {"masses": [1.0, 1.0], "block": [[0.0, 0.0], [1.0, 0.0]]}),
    "orbits.inertial": (sw.orbits.inertial, {"masses": [1.0, 1.0], "block": [[0.0, 0.0], [1.0, 0.0]]}),
    "orbits.eccentric_anomaly": (sw.orbits.eccentric_anomaly, {"mean_anomaly": 0.5, "e": 0.1}),
    "orbits.gravity": (sw.orbits.gravity, {"length": "au", "mass": "solar", "time": "day"}),
    "scenes.dzhanibekov": (sw.scenes.dzhanibekov, {"inertia": (1.0, 2.0, 3.0), "tilt": 0.01, "spin": 1.0}),
    "scenes.cloth": (sw.scenes.cloth, {"n": 4, "shear": 0.5, "damping": 0.1}),
    "scenes.energy_control": (sw.scenes.energy_control, {"pair": "matching", "eps": 0.01, "form": "limited"}),
    "scenes.forced_oscillator": (sw.scenes.forced_oscillator, {"omega": 1.0, "damping": 0.1, "amplitude": 1.0, "drive": 0.7,
        "phase": 0.5}),
    "scenes.heavy_top": (sw.scenes.heavy_top, {"spin": 10.0, "lean": 30.0}),
    "scenes.jelly_cube": (sw.scenes.jelly_cube, {"n": 3, "twist": 1.0}),
    "scenes.kepler": (sw.scenes.kepler, {"e": 0.9, "share": 0.5}),
    "scenes.oscillator": (sw.scenes.oscillator, {"omega": 1.0}),
    "scenes.pendulum": (sw.scenes.pendulum, {"amplitude": 90.0, "omega": 1.0}),
    "scenes.rope_bridge": (sw.scenes.rope_bridge, {"planks": 4, "load": 2.0}),
    "scenes.sliding_block": (sw.scenes.sliding_block, {"friction": 4.9, "speed": 3.0}),
    "scenes.sticking_block": (sw.scenes.sticking_block, {"friction": 0.13}),
    "scenes.plummer": (sw.scenes.plummer, {"n": 8, "seed": 1, "softening": 0.05}),
    "scenes.symmetric_top": (sw.scenes.symmetric_top, {"axial": 1.6, "spin": 2.0, "wobble": 1.0}),
    "Scene": (sw.Scene, {"system": sw.Oscillator(), "v": 0.0, "y": 1.0, "until": 10.0}),
    "Scene.run": (KEPLER.run, {"method": "rk4", "dt": 0.1, "steps": 10, "every": None, "control": None}),
    "Scene.steps_for": (KEPLER.steps_for, {"dt": 0.1}),
    "Scene.state_error": (KEPLER.state_error, {"run": KEPLER.run("rk4", 0.1, steps=3)}),
    "Scene.energy_error": (KEPLER.energy_error, {"run": KEPLER.run("rk4", 0.1, steps=3)}),
    "Scene.amplitude": (KEPLER.amplitude, {"run": KEPLER.run("rk4", 0.1, steps=3)}),
    "analyse": (sw.analyse, {"system": sw.Oscillator(), "method": "rk4", "dt": 0.1, "at": None, "t": 0.0}),
    "analyse at": (sw.analyse, {"system": sw.Pendulum(), "method": "rk4", "dt": 0.1, "at": (0.0, 1.0), "t": 0.0}),
    "stability_limit": (sw.stability_limit, {"system": sw.Oscillator(), "method": "rk4", "at": None, "t": 0.0}),
    "discretise": (sw.discretise, {"system": sw.TransferFunction(1.0, [1.0, 1.0]), "dt": 0.1, "how": "exact",
        "interpolation": "linear", "prewarp": None, "delay": 0.03}),
    "DiscreteSystem.run": (sw.discretise(sw.TransferFunction(1.0, [1.0, 1.0]), 0.1).run, {"x": [1.0, 2.0], "start": [0.5]}),
    "DiscreteSystem.frequency_response": (sw.discretise(sw.TransferFunction(1.0, [1.0, 1.0]), 0.1).frequency_response,
        {"omega": [1.0, 2.0]}),
    "frequency_response": (sw.frequency_response, {"system": sw.TransferFunction(1.0, [1.0, 1.0]), "omega": [1.0, 2.0]}),
    "sampled_loop": (sw.sampled_loop, {"plant": sw.TransferFunction(1.0, [1.0, 1.0]),
        "controller": sw.TransferFunction(1.0, [1.0, 0.0]), "dt": 0.1, "delay": 0.03, "samples": 1, "how": "tustin"}),
    "sampling_limit": (sw.sampling_limit, {"plant": sw.TransferFunction(1.0, [1.0, 0.0]), "controller": 4.0, "delay": 0.0,
        "samples": 1, "how": "tustin"}),
    "linearised_loop": (sw.linearised_loop, {"system": own.duffing().surrounded(held(sets="delta", period=0.2)), "method": "rk4",
        "dt": 0.1, "v": 0.0, "y": 1.0, "t0": 0.0}),
    "a controller": (held, {"sets": "delta", "period": 0.2, "delay": 0.1, "gain": 2.0, "total": 0.0}),
    "margins": (sw.margins, {"loop": sw.TransferFunction(9.0, [1.0, 3.0, 3.0, 1.0])}),
    "stability_limit at": (sw.stability_limit, {"system": sw.Pendulum(), "method": "rk4", "at": (0.0, 1.0), "t": 0.0}),
    "analyse v y": (sw.analyse, {"system": sw.Pendulum(), "method": "rk4", "dt": 0.1, "v": 0.0, "y": 1.0}),
    "stability_limit v y": (sw.stability_limit, {"system": sw.Pendulum(), "method": "rk4", "v": 0.0, "y": 1.0}),
    "stability_along": (sw.stability_along, {"run": sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=4, every=2),
        "method": "false_euler"}),
    "consistent_start": (sw.consistent_start, {"system": divider(), "y": [1.0, 0.0], "t0": 0.0}),
    "stability function": (sw.stability.function, {"method": "rodas4"}),
    "jacobian": (sw.jacobian, {"system": sw.Pendulum(), "v": 0.0, "y": 1.0, "t": 0.0}),
    "equilibria": (sw.equilibria, {"system": sw.Pendulum(), "near": (0.0, [0.3, 3.0]), "t": 0.0, "method": "rk4", "dt": 0.1}),
    "lyapunov": (sw.lyapunov, {"system": sw.Pendulum(), "method": "rk4", "v": 0.0, "y": 1.0, "dt": 0.1, "steps": 4,
        "exponents": "all", "transient": 2, "every": 2, "t0": 0.0, "threads": 1}),
    "lyapunov with a tolerance": (sw.lyapunov, {"system": sw.Pendulum(), "method": "merson", "v": 0.0, "y": 1.0,
        "tolerance": 1e-6, "at": [1.0, 2.0], "exponents": 1, "transient": 1, "t0": 0.0, "dt": 0.1}),
    "load": (sw.load, {"path": SAVED, "system": None}),
    "load own": (sw.load, {"path": SAVED_OWN, "system": own.pendulum}),
    "Run.save": (A_RUN.save, {"path": SAVED}),
    "solve_ivp": (sw.solve_ivp, {"fun": own.lorenz, "t_span": (0.0, 0.1), "y0": [1.0, 2.0, 3.0], "method": None, "t_eval": None,
        "dense_output": False, "events": None, "args": None, "first_step": None, "max_step": np.inf, "rtol": 1e-3, "atol": 1e-6}),
    "solve_ivp at times": (sw.solve_ivp, {"fun": lambda t, y, k: -k * y, "t_span": (0.1, 0.0), "y0": [1.0], "method": "merson",
        "t_eval": [0.05, 0.0], "events": [lambda t, y, k: y[0]], "args": (2.0,), "vectorized": False}),
    "sweep": (sw.sweep, {"system": sw.Oscillator, "axes": {"omega": ("omega", [1.0, 2.0])}, "method": "rk4", "v": 0.0, "y": 1.0,
        "dt": 0.1, "steps": 4, "outcomes": None, "transient": 0, "observe": 1, "control": None, "force": None, "fused": False,
        "dtype": "float32", "t0": 0.0, "start": None, "units": None, "store": None, "engine": None, "threads": 1, "chunk": None,
        "memory": 1e8, "progress": False}),
    "sweep of histories": (sw.sweep, {"system": sw.Oscillator, "axes": {"omega": ("omega", [1.0, 2.0])}, "method": "rk4",
        "v": 0.0, "y": 1.0, "dt": 0.1, "steps": 4, "every": 2}),
    "sweep with a tolerance": (sw.sweep, {"system": sw.Oscillator, "axes": {"omega": ("omega", [1.0, 2.0])}, "method": "dop853",
        "v": 0.0, "y": 1.0, "tolerance": 1e-6, "at": [0.5, 1.0], "max_steps": 100, "outcomes": "evaluations"}),
    "criteria": (sw.criteria, {**OF_METHODS, "phi": (0.1, 0.5)}),
    "explain": (sw.explain, {"system": sw.Oscillator(), "method": "merson", "members": 2, "control": None, "fused": False,
        "attempt": False, "dtype": "float64"}),
    "explain bodies": (sw.explain, {"system": sw.NBody(), "method": "rk4", "members": 2, "control": sw.EnergyControl(0.1)}),
    "explore": (sw.explore, {"scenes": "oscillator", "methods": ["rk4"]}),
    "export": (sw.export, {"system": sw.Oscillator([1.0, 2.0]), "method": "rk4", "language": "c", "dt": 0.1, "t0": 0.0, "v": 0.0,
        "y": 1.0, "member": 1, "start": None, "control": None, "fused": False, "name": "step", "dtype": "float32"}),
    "export Verlet": (sw.export, {"system": sw.Oscillator(), "method": "verlet", "language": "rust", "start": "first_order"}),
    "export bodies": (sw.export, {"system": sw.NBody(), "method": "rk4", "language": "python", "v": 0.0, "y": BODIES["y"],
        "control": sw.Projection()}),
    "stability.operations": (stability.operations, {"method": "rk4", "system": sw.Oscillator()}),
    "stability.series": (stability.series, {"method": "rk4"}),
    "advise": (sw.advise, {"scene": "oscillator", "frame": 0.1, "tolerance": 0.1, "budget": None, "methods": ["rk4"],
        "cost": "evaluations", "fixed": True, "dtype": "both"}),
    "charts.figures": (charts.figures, {**OF_METHODS, "phi": 0.5, "periods": 2.0}),
    "charts.stability": (charts.stability, {**OF_METHODS, "phi": [0.1, 0.2]}),
    "charts.stability_map": (charts.stability_map, {"method": "rk4", "phi": (0.0, 3.0), "damping": (0.0, 1.0), "size": 16}),
    "charts.norm": (charts.norm, {"methods": ["rk4"], "phi": 0.1, "gains": [0.1, 0.2], "progress": None}),
    "charts.bode": (charts.bode, {"system": sw.Oscillator(1.0, 0.1), "methods": ["rk4"], "dt": 0.1, "x": "hold",
        "omega": [0.1, 1.0], "of": (0, 0)}),
    "charts.verlet_friction": (charts.verlet_friction, {"dt": 0.05}),
    "charts.run_picture": (charts.run_picture, {"scene": KEPLER, "run": KEPLER.run("rk4", 0.1, steps=9, every=3)}),
    "charts.control": (charts.control, {"scene": KEPLER, "methods": ["rk4"], "v": None, "y": None, "horizon": 1.0,
        "evaluations": 100, "relative": [0.1], "exact": None, "forms": ["limited"], "ways": ["scaling"], "title": None,
        "progress": None}),
    "charts.work_precision": (charts.work_precision, {"scene": "oscillator", "methods": ["false_euler"], "steps": [100],
        "tolerances": [], "peers": [], "progress": None}),
    "charts.panel": (charts.panel, {"scenes": ["oscillator"], "methods": ["false_euler"], "steps": [100], "progress": None}),
    "charts.Peer": (charts.Peer, {"name": "a", "solve": len, "settings": [0.1], "by": "step", "order": 1}),
    "charts.peers.peer": (charts.peers.peer, {"function": len}),
    "charts.peers.scipy": (charts.peers.scipy, {"method": "RK45", "settings": [1e-3]}),
    "charts.peers.rebound": (charts.peers.rebound, {"integrator": "ias15", "settings": [1e-3]}),
    "charts.peers.heyoka": (charts.peers.heyoka, {"settings": [1e-3]}),
}  # fmt: skip


if find_spec("pandas") and find_spec("xarray"):
    CALLS["Run.to_dataframe"] = A_RUN.to_dataframe, {"dims": None}
    CALLS["Run.to_xarray"] = A_RUN.to_xarray, {"dims": None, "coords": None}


#: A system that is not there has arguments with defaults.
for _name in sw.__all__:
    _each = getattr(sw, _name)
    if isinstance(_each, type) and issubclass(_each, sw.System) and _each is not sw.System and _name not in CALLS:
        CALLS[_name] = _each, {name: each.default for name, each in inspect.signature(_each).parameters.items()}
