"""Every method × system × form that there is, with random parameters. Tests iterate over these and never list methods by hand."""

from __future__ import annotations

import hashlib
import itertools
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell._core import Tape
from stepwell.errors import ArgumentError, TraceError, UnsupportedError
from stepwell.reference.series import expanded
from stepwell.reference.traced import Tracer

from support import families
from support import own_systems as own
from support.families import family

Make = Callable[[np.random.Generator, int], sw.System]


def _omega(rng: np.random.Generator, b: int) -> Any:
    return rng.uniform(0.5, 2.0, b)


def _sine(rng: np.random.Generator, b: int) -> sw.Sinusoid:
    return sw.Sinusoid(rng.uniform(0.1, 1.0, b), rng.uniform(0.0, 9.0, b), rng.uniform(-3.0, 3.0, b))


def _held(rng: np.random.Generator, b: int) -> sw.Sampled:
    return sw.Sampled(rng.normal(size=(13, b)), interval=0.07, start=-0.1)


def _gentle(rng: np.random.Generator, n: int, b: int | None = None) -> Any:
    """Rates that mostly decay, so that no trajectory of the tests grows by much."""
    batch = () if b is None else (b,)
    return rng.normal(0.0, 0.5, (n, n, *batch)) - 1.2 * np.eye(n).reshape(n, n, *(1 for _ in batch))


def _masses(rng: np.random.Generator, b: int) -> sw.LinearSystem:
    """Three masses and springs with the velocities among the coordinates, driven, so that Verlet can step it."""
    half = rng.normal(0.0, 0.5, (3, 3))
    A, B = np.zeros((6, 6, b)), np.zeros((6, 1))
    v, y = [1, 2, 5], [0, 3, 4]
    A[np.ix_(v, y)] = -(half @ half.T + np.eye(3))[..., None]
    A[y, v] = rng.uniform(0.5, 2.0, b)
    B[v, 0] = rng.normal(size=3)
    return sw.LinearSystem(A, B, x=_sine(rng, b), velocities=v)


def _moments(rng: np.random.Generator, b: int) -> Any:
    """Principal moments of which none is above the sum of the others."""
    return rng.uniform(1.0, 2.0, (3, b))


def _hung(rng: np.random.Generator, dim: int, **options: Any) -> sw.Springs:
    """A net of three by three particles that hangs from two corners."""
    layout = np.stack(np.meshgrid(range(3), range(3), [0]), axis=-1).reshape(9, 3)[:, :dim] + 0.1 * rng.normal(size=(9, dim))
    pairs = [(i, j) for i in range(9) for j in range(i + 1, 9) if max(abs(i // 3 - j // 3), abs(i % 3 - j % 3)) == 1]
    return sw.Springs(pairs, stiffness=rng.uniform(0.5, 2.0, len(pairs)), layout=layout, fixed=[0, 2], **options)


#: One maker for each kernel variant of each system.
SYSTEMS: dict[str, Make] = {
    "block with friction": lambda r, b: sw.Oscillator(0.0, friction=r.uniform(0.0, 0.5, b), form="physical"),
    "block with drag": lambda r, b: sw.Oscillator(0.0, drag=r.uniform(0.0, 1.0, b), a=r.normal(size=b), form="physical"),
    "drag": lambda r, b: sw.Oscillator(_omega(r, b), drag=r.uniform(0.0, 1.0, b)),
    "friction": lambda r, b: sw.Oscillator(_omega(r, b), friction=r.uniform(0.0, 0.5, b)),
    "friction and damping, sampled x, physical": lambda r, b: sw.Oscillator(
        _omega(r, b), 0.1, x=_held(r, b), friction=0.2, form="physical"
    ),
    "friction, sinusoid a": lambda r, b: sw.Oscillator(1.25, a=_sine(r, b), friction=r.uniform(0.0, 1.0, b)),
    "free": lambda r, b: sw.Oscillator(_omega(r, b)),
    "free, physical": lambda r, b: sw.Oscillator(_omega(r, b), form="physical"),
    "one omega for all": lambda r, b: sw.Oscillator(1.25),
    "damped": lambda r, b: sw.Oscillator(_omega(r, b), r.uniform(0.0, 1.2, b)),
    "damped, physical": lambda r, b: sw.Oscillator(_omega(r, b), 0.3, form="physical"),
    "constant x": lambda r, b: sw.Oscillator(_omega(r, b), x=r.normal(size=b)),
    "constant x and a, physical": lambda r, b: sw.Oscillator(_omega(r, b), x=0.5, a=r.normal(size=b), form="physical"),
    "sinusoid x": lambda r, b: sw.Oscillator(_omega(r, b), x=_sine(r, b)),
    "sinusoid a, damped, physical": lambda r, b: sw.Oscillator(_omega(r, b), 0.1, a=_sine(r, b), form="physical"),
    "sinusoids x and a, damped": lambda r, b: sw.Oscillator(_omega(r, b), 0.1, x=_sine(r, b), a=sw.Sinusoid(1.0, 2.0)),
    "sampled x, sinusoid a": lambda r, b: sw.Oscillator(_omega(r, b), x=_held(r, b), a=_sine(r, b)),
    "sinusoid x, sampled a, damped": lambda r, b: sw.Oscillator(
        _omega(r, b), 0.2, x=_sine(r, b), a=sw.Sampled(r.normal(size=7), interval=0.11)
    ),
    "sampled x and a, physical": lambda r, b: sw.Oscillator(_omega(r, b), x=_held(r, b), a=_held(r, b), form="physical"),
    "aircraft": lambda r, b: sw.Aircraft(
        inertia=r.uniform(0.5, 1.5, (3, b)), gains=r.uniform(0.02, 0.1, (3, b)), roll=r.normal(0.0, 30.0, b), pitch=_sine(r, b)
    ),
    "aircraft without controllers": lambda r, b: sw.Aircraft(
        damping=r.uniform(0.0, 3.0, 3), roll_torque=_held(r, b), pitch_torque=r.normal(size=b), controllers=False
    ),
    "aircraft, quaternion": lambda r, b: sw.Aircraft("quaternion", damping=r.uniform(0.5, 3.0, (3, b)), roll=_held(r, b)),
    "aircraft, quaternion, without controllers": lambda r, b: sw.Aircraft(
        "quaternion", yaw_torque=_sine(r, b), controllers=False
    ),
    "pendulum": lambda r, b: sw.Pendulum(_omega(r, b)),
    "pendulum, damped": lambda r, b: sw.Pendulum(_omega(r, b), r.uniform(0.0, 0.5, b)),
    "pendulum, constant a": lambda r, b: sw.Pendulum(1.1, a=r.normal(size=b)),
    "pendulum, sampled a, damped": lambda r, b: sw.Pendulum(_omega(r, b), 0.1, a=_held(r, b)),
    "pendulum, sinusoid a": lambda r, b: sw.Pendulum(_omega(r, b), a=_sine(r, b)),
    "pendulum, sinusoid a, damped": lambda r, b: sw.Pendulum(_omega(r, b), 0.2, a=_sine(r, b)),
    "pendulum, sinusoids a of one frequency": lambda r, b: sw.Pendulum(
        _omega(r, b), 0.2, a=sw.Sinusoid(r.normal(size=b), 2.0, 0.3)
    ),
    "pendulum in space": lambda r, b: sw.Pendulum3D(r.uniform(0.5, 2.0, b), r.uniform(0.5, 2.0, b)),
    "pendulum in space, length control": lambda r, b: sw.Pendulum3D(_omega(r, b)).under(sw.LengthControl(0.5), (b,)),
    "pendulum in space, length projection": lambda r, b: sw.Pendulum3D(_omega(r, b)).under(sw.Projection("length"), (b,)),
    "pendulum in space, at a wall and a ball": lambda r, b: sw.Pendulum3D(
        r.uniform(0.7, 1.5, b),
        floor=[
            sw.Floor(restitution=r.uniform(0.3, 1.0, b), friction=0.2, normal=(1, 0, 0), offset=0.8),
            sw.Sphere((0, 0, -1), 0.3, friction=0.3),
        ],
    ).under(sw.Projection("length"), (b,)),
    "pendulum in space, over a slope": lambda r, b: sw.Pendulum3D(
        1.0, 2.0, floor=sw.Floor(restitution=0.5, normal=(0.2, 0.1, 1), offset=-0.7)
    ),
    "restricted three bodies": lambda r, b: sw.RestrictedThreeBody(r.uniform(0.01, 0.99, b)),
    "Arenstorf's moon": lambda r, b: sw.RestrictedThreeBody(),
    "springs: a triangle": lambda r, b: sw.Springs(
        [(0, 1), (1, 2), (2, 0)], stiffness=r.uniform(0.5, 2.0, (3, b)), rest=1.0, dim=2
    ),
    "springs: hung, damped": lambda r, b: _hung(r, 2, damping=r.uniform(0.1, 0.5, b)[np.newaxis], gravity=(0.0, -1.0)),
    "springs: hung in space": lambda r, b: _hung(r, 3, masses=r.uniform(0.5, 2.0, (9, b)), gravity=r.normal(size=(3, b))),
    "springs: hung in space, dragged": lambda r, b: _hung(r, 3, drag=r.uniform(0.1, 0.5, 9), damping=r.uniform(0.1, 0.5, 20)),
    "springs: on a floor": lambda r, b: _hung(
        r,
        2,
        gravity=(0.0, -1.0),
        floor=[sw.Floor(restitution=r.uniform(0.0, 1.0, b), offset=-0.3), sw.Floor(offset=0.2, way="spring", omega=2.0)],
    ),
    "springs: on a line": lambda r, b: sw.Springs(
        [(0, 1), (1, 2), (3, 2)], stiffness=r.uniform(0.5, 2.0, (3, b)), rest=0.5, fixed=[0, 3], dim=1
    ),
    "springs: over a ball": lambda r, b: sw.Springs(
        [(0, 1), (1, 2)],
        rest=0.5,
        damping=0.1,
        fixed=[0],
        gravity=r.normal(size=(3, b)),
        floor=sw.Sphere((0, 0, 0.1), 0.5, friction=0.3),
    ),
    "top, free": lambda r, b: sw.RigidBody(_moments(r, b)),
    "top, damped, torques of its own": lambda r, b: sw.RigidBody(
        _moments(r, b), [_sine(r, b), None, _held(r, b)], damping=r.uniform(0.0, 0.3, b) * np.ones((3, 1))
    ),
    "top, torques of space": lambda r, b: sw.RigidBody(
        _moments(r, b), r.normal(size=(3, b)), [None, _sine(r, b), 0.3], damping=0.1
    ),
    "top, heavy": lambda r, b: sw.RigidBody(_moments(r, b), weight=r.uniform(0.5, 2.0, b), centre=r.normal(size=(3, b))),
    "top, heavy, torque of space": lambda r, b: sw.RigidBody(
        _moments(r, b), space_torque=[_held(r, b), None, None], weight=1.3, centre=r.normal(size=(3, b))
    ),
    "three bodies": lambda r, b: sw.NBody(G=r.uniform(0.5, 2.0, b)),
    "three bodies in space, newton": lambda r, b: sw.NBody(
        [1.0, 0.0, 2.0], force="newton", softening=r.uniform(0.1, 0.2, b), dim=3
    ),
    "three bodies, newton": lambda r, b: sw.NBody(r.uniform(0.1, 1.0, (3, b)), force="newton", softening=0.3),
    "three bodies in space": lambda r, b: sw.NBody(r.uniform(0.1, 1.0, (3, b)), dim=3),
    "one body": lambda r, b: sw.NBody([1.0]),
    "two bodies": lambda r, b: sw.NBody(r.uniform(0.1, 1.0, (2, b)), force="newton", softening=0.3),
    "eight bodies": lambda r, b: sw.NBody(r.uniform(0.0, 1.0, 8), softening=0.2, G=r.uniform(0.5, 1.0, b)),
    "thirty-five bodies in space, newton": lambda r, b: sw.NBody(r.uniform(0.0, 0.2, 35), force="newton", softening=0.3, dim=3),
    "a pair and three without mass": lambda r, b: sw.NBody([0.0, 0.5, 0.0, 0.3, 0.0], softening=0.3, G=r.uniform(0.5, 1.0, b)),
    "three of thirty with mass, in space": lambda r, b: sw.NBody(
        np.where(np.arange(30) % 11 == 5, r.uniform(0.2, 1.0, 30), 0.0), softening=0.3, dim=3
    ),
    "a pair in a bowl on a floor": lambda r, b: sw.NBody(
        [1.0, 0.5],
        softening=0.3,
        floor=[sw.Sphere((0.1, 0.0), 1.2, inside=True, restitution=r.uniform(0.5, 1.0, b)), sw.Floor(offset=-0.4)],
    ),
    "a pair above a spring": lambda r, b: sw.NBody([1.0, 0.5], softening=0.3, floor=sw.Floor(way="spring", omega=_omega(r, b))),
    "particles": lambda r, b: sw.Particles([1.0, 2.0], gravity=r.normal(size=(3, b))),
    "particles, drag": lambda r, b: sw.Particles(r.uniform(0.5, 2.0, (2, b)), drag=r.uniform(0.0, 0.5, b), dim=2),
    "particles, a floor": lambda r, b: sw.Particles(
        gravity=r.uniform(0.5, 2.0), floor=sw.Floor(restitution=r.uniform(0.0, 1.0, b)), dim=2
    ),
    "particles, drag, a rough slope": lambda r, b: sw.Particles(
        [1.0, 2.0],
        drag=0.1,
        gravity=2.0,
        floor=sw.Floor(restitution=0.7, friction=0.2, normal=r.normal(size=(3, b)), offset=-0.5),
    ),
    "particles, a floor that turns them": lambda r, b: sw.Particles(
        floor=sw.Floor(restitution=0.5, friction=0.1, way="restitution"), dim=1
    ),
    "particles, round a ball": lambda r, b: sw.Particles(floor=sw.Sphere((0.0, 0.1), r.uniform(0.3, 0.6, b), friction=0.3)),
    "chain of one": lambda r, b: sw.Chain(1, stiffness=r.uniform(0.5, 2.0, (2, b))),
    "chain of five": lambda r, b: sw.Chain(5, stiffness=r.uniform(0.0, 2.0, (6, b)), mass=r.uniform(0.5, 2.0, 5)),
    "chain of nineteen": lambda r, b: sw.Chain(19, mass=r.uniform(0.5, 2.0, (1, b))),
    "linear, two states": lambda r, b: sw.LinearSystem(_gentle(r, 2)),
    "linear, five states, two inputs": lambda r, b: sw.LinearSystem(
        _gentle(r, 5, b), r.normal(size=(5, 3)), x=[_sine(r, b), None, _held(r, b)], velocities=[3, 0]
    ),
    "linear, one state, no velocity": lambda r, b: sw.LinearSystem(
        _gentle(r, 1, b), r.normal(size=(1, 1, b)), x=r.normal(size=b)
    ),
    "linear, no velocities": lambda r, b: sw.LinearSystem(_gentle(r, 3), np.ones((3, 1)), x=_held(r, b), velocities=0),
    "linear, velocities only": lambda r, b: sw.LinearSystem(_gentle(r, 4, b), velocities=4),
    "linear, masses": _masses,
    "rods, two hanging": lambda r, b: sw.Rods(
        [1.0, 2.0], [((0.0, 0.0), 0), (0, 1)], r.uniform(0.5, 2.0, b)[None] * [[1.0], [0.7]]
    ),
    "rods, three hanging in space, length control": lambda r, b: sw.Rods(
        r.uniform(0.5, 2.0, (3, b)), [((0.0, 0.0, 0.5), 0), (0, 1), (2, 1)], 1.0
    ).under(sw.LengthControl(0.4), (b,)),
    "rods, two between anchors, length projection": lambda r, b: sw.Rods(
        [1.0, 1.5], [(0, (-1.0, 0.0)), (0, 1), (1, (1.5, 0.5))], [1.0, 1.2, 0.8], gravity=r.uniform(0.5, 2.0, b)
    ).under(sw.Projection("length"), (b,)),
    "rods, a dumb-bell on a rough floor, length projection": lambda r, b: sw.Rods(
        r.uniform(0.5, 2.0, (2, b)),
        [(0, 1)],
        1.0,
        gravity=3.0,
        floor=sw.Floor(restitution=r.uniform(0.0, 1.0, b), friction=0.4, offset=-0.3),
        dim=3,
    ).under(sw.Projection("length"), (b,)),
    "rods, two hanging over a floor, length control": lambda r, b: sw.Rods(
        [1.0, 2.0],
        [((0.0, 0.5), 0), (0, 1)],
        1.0,
        gravity=r.uniform(1.0, 3.0, b),
        floor=[sw.Floor(restitution=0.5, friction=0.3), sw.Floor(normal=(1, 0))],
    ).under(sw.LengthControl(0.4), (b,)),
    "rods, two apart in a bowl": lambda r, b: sw.Rods(
        [1.0, 2.0, 0.5, 1.0], [(0, 1), (3, 2)], 1.0, gravity=2.0, floor=sw.Sphere((0.1, 0.0), r.uniform(1.0, 1.5, b), inside=True)
    ),
    "rods, a triangle": lambda r, b: sw.Rods(r.uniform(0.5, 2.0, (3, b)), [(0, 1), (1, 2), (2, 0)], 1.0, dim=3),
    "own: Duffing": lambda r, b: own.duffing(beta=r.uniform(0.1, 1.0, b), omega=_omega(r, b)).for_state_shapes(),
    "own: Lorenz": lambda r, b: own.lorenz(rho=r.uniform(0.5, 1.5, b)).for_state_shapes(),
    "own: pendulum": lambda r, b: own.pendulum(omega=_omega(r, b)).for_state_shapes(),
    "own: springs in space": lambda r, b: own.springs(k=r.uniform(0.5, 1.0, b)).for_state_shapes(None, np.zeros((5, 3))),
    "own: masses that attract": lambda r, b: own.attracted(masses=r.uniform(0.1, 1.0, (3, b))).for_state_shapes(
        None, np.zeros((3, 2))
    ),
    "own: top": lambda r, b: own.top(inertia=r.uniform(1.0, 3.0, (3, b))).for_state_shapes(np.zeros(3), np.zeros(4)),
    "own: sinusoid": lambda r, b: own.pushed(k=_omega(r, b), x=_sine(r, b)).for_state_shapes(),
    "own: samples": lambda r, b: own.pushed(x=_held(r, b)).for_state_shapes(),
    "own: a function of the time": lambda r, b: own.pushed(k=_omega(r, b), x=own.turning).for_state_shapes(),
    "own: a choice": lambda r, b: own.bouncing(gravity=r.uniform(0.5, 1.0, b)).for_state_shapes(),
    "own: a matrix": lambda r, b: own.network(weights=r.normal(size=(3, 3, b))).for_state_shapes(),
    "own: as SciPy has it": lambda r, b: own.scipys().for_state_shapes(),
    "own: friction, a slope": lambda r, b: own.sloping(mu=r.uniform(0.0, 0.5, b)).for_state_shapes(),
    "own: friction, pucks": lambda r, b: own.pucks(mu=r.uniform(0.0, 0.3, b)).for_state_shapes(),
    "own: friction, a cart": lambda r, b: own.cart(mu=r.uniform(0.0, 0.2, b)).for_state_shapes(np.zeros(2), np.zeros(2)),
    "linear, seventeen states": lambda r, b: sw.LinearSystem(0.5 * _gentle(r, 17), r.normal(size=17), x=_sine(r, b)),
}


def _adaptive(system: sw.System) -> bool:
    """Whether it works with adaptive steps: friction depends on the step, and a step that meets a surface is no estimate."""
    return not system.has_stick_friction and all(surface.way == "spring" for surface in system.contacts)


ADAPTIVE = [name for name, make in SYSTEMS.items() if _adaptive(make(np.random.default_rng(0), 1))]


def _apart(system: sw.System) -> Any:
    """Places for the points of rods, about as far from each other and from the origin as the rods are long."""
    i, *_ = np.ogrid[: system.y_shape[0], 0:1] if len(system.y_shape) > 1 else np.ogrid[0:1, 0:1]
    places = np.concatenate([np.cos(2.0 * i), np.sin(2.0 * i), 0.3 * i], axis=1)[:, : system.y_shape[-1]]
    return places.reshape(*system.y_shape, 1)


@dataclass(frozen=True)
class Case:
    """One method, one system, one form, one way to start."""

    method: str
    system: str
    form: str
    start: str | None

    def make(self, b: int, seed: int = 0) -> tuple[sw.System, dict[str, Any]]:
        """The system for a batch of b members, and the other arguments of a run."""
        rng = np.random.default_rng([seed, b])
        system = SYSTEMS[self.system](rng, b)
        v, y = (rng.normal(size=(*shape, b)) for shape in (system.v_shape, system.y_shape))
        # Springs of hardly any length turn so fast that their series do not converge within a step.
        if system.constraint == "length" or (sw.method(self.method).has_series and self.system.startswith("springs")):
            v, y = 0.02 * v, 0.15 * y + _apart(system)  # v along a rod would shorten it until it has no direction
        return system, {"method": self.method, "v": v, "y": y, "dt": 0.1, "form": self.form, "start": self.start}

    def refused_in_float32(self) -> str:
        """Why float32 does not work with it, or nothing."""
        try:
            self.run(1, steps=1, every=None, dtype="float32")
        except (UnsupportedError, ArgumentError, TraceError) as error:
            return str(error)
        return ""

    def run(self, b: int, seed: int = 0, **options: Any) -> sw.Run:
        """A run of b members."""
        system, arguments = self.make(b, seed)
        if self.method == "wisdom_holman" and getattr(system, "force", "") == "newton":
            arguments |= {"dt": 0.01}  # no step is longer than an orbit of these random bodies
        return sw.integrate(system, **({"steps": 23, "every": 5} | arguments | options))

    def __str__(self) -> str:
        return ", ".join(filter(None, [self.method, self.system, self.form, self.start]))


#: The most numbers of a state in a system of these tests whose series is not too long.
MOST_IN_SERIES = 60
#: The most velocities of bodies of which each pulls each other, for a method that solves equations; and the most numbers of a
#: state for one, but in the long run: its reference derives rates number by number. rust/core/tests/large.rs has larger ones.
MOST_TO_SOLVE, MOST_TO_DERIVE = 60, 24


def fits(system: sw.System, method: sw.Method) -> bool:
    """Whether the method can step the system."""
    if method.has_series and int(np.prod(system.y_shape)) > MOST_IN_SERIES:
        return False
    if method.is_implicit and isinstance(system, sw.NBody) and int(np.prod(system.v_shape)) > MOST_TO_SOLVE:
        return False  # a full matrix of so many rows; test_stiff.py has what is then said
    if method.is_implicit and not families.LONG and int(np.prod(system.v_shape) + np.prod(system.y_shape)) > MOST_TO_DERIVE:
        return False
    if method.has_series and (getattr(system, "push", None) or not getattr(system.control, "between", True)):
        return False  # a series of what a control pushes would not be that of the motion
    return not method.needs_acceleration or (system.second_order and system.velocity_term is None)


#: Systems that turn so fast in these cases that some members diverge by a series of order 8.
DIVERGE_IN_SERIES = ("aircraft, quaternion", "springs: hung, damped")


def cases(methods: Iterator[str] | None = None) -> Iterator[Case]:
    """Every case that is not refused."""
    rng = np.random.default_rng()
    one_member = {name: make(rng, 1) for name, make in SYSTEMS.items()}
    names = [m.name for m in sw.methods()] if methods is None else list(methods)
    for method, system in itertools.product(names, SYSTEMS):
        instance, record = one_member[system], sw.method(method)
        if not fits(instance, record) or (record.has_series and system in DIVERGE_IN_SERIES):
            continue
        waves = any(isinstance(x, sw.Sinusoid) for x in instance.given_inputs().values())
        forms = ["direct"] + ["matrix"] * (instance.linear and not (record.takes_derivatives_by_time and waves))
        for form in forms:
            for start in record.starts or (None,):
                yield Case(method, system, form, start)


def number(*words: Any) -> int:
    """A whole number that looks random and is always the same of the same words."""
    return int.from_bytes(hashlib.blake2b(repr(words).encode(), digest_size=8).digest(), "little")


#: Systems by which a step of an implicit method, whose equations are written out, has the most operations.
LARGEST = ("linear, seventeen states", "chain of nineteen")


def representative(every: Iterable[Case], several: Mapping[str, int], *salt: str) -> list[Case]:
    """Cases in which every system and every method occurs so many times in each of its forms, with all its starts.

    They are drawn by their names, so that a new system or method moves few others; another salt draws others.
    """
    # Those that take longest come last: they are drawn only where there is no other.
    drawn = {
        case: number(*salt, case.system, case.method, case.form)
        + (1 << 64) * (case.system in LARGEST and sw.method(case.method).is_implicit)
        for case in every
    }
    groups: dict[tuple[str, str], set[int]] = defaultdict(set)
    for case, lot in drawn.items():
        groups[case.system, case.form].add(lot)
        groups[case.method, case.form].add(lot)
    chosen = {lot for (_, form), lots in groups.items() for lot in sorted(lots)[: several.get(form, 0)]}
    return [case for case, lot in drawn.items() if lot in chosen]


#: How many methods a test tries with each system, which draws them; in the long run all.
SOME = pytest.mark.parametrize("some", family([2, None], lambda some: some is not None, lambda some: "some" if some else "all"))


def drawn(methods: Sequence[sw.Method], some: int | None, *salt: Any) -> list[sw.Method]:
    """So many of these methods, always the same of the same words."""
    return sorted(methods, key=lambda method: number(method.name, *salt))[:some]


def few_implicit(methods: Sequence[sw.Method], some: int, *salt: Any) -> list[sw.Method]:
    """All explicit ones, and so many of the implicit ones, which are made of the same parts; in the long run all."""
    implicit = [method for method in methods if method.is_implicit]
    return [m for m in methods if not m.is_implicit] + drawn(implicit, None if families.LONG else some, *salt)


def assert_same(a: sw.Run, b: sw.Run) -> None:
    """To the last bit: every kept number, and who diverged when."""
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.v, b.v)
    np.testing.assert_array_equal(a.y, b.y)
    np.testing.assert_array_equal(a.first_bad_step, b.first_bad_step)
    if a.carry is not None or b.carry is not None:
        np.testing.assert_array_equal(a.carry, b.carry)


def has_branches(system: Any) -> bool:
    """Whether functions in the rates have branches that a series must stay on."""
    tape = Tape()
    tracer = Tracer(system, tape)
    v, y, _ = tracer.state()
    one = tape.number(1.0)
    return bool(expanded(tracer.attempted().unit, 2, tape.time(), (one, one), v, y)[1])
