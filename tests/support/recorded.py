"""Runs whose bits are written down in ``recorded_bits.json``, so that a core that is built anew can be held against the old one.

    python tests/support/recorded.py --write            # writes the JSON with the core that is installed
    python tests/support/recorded.py                    # says which runs are other than written
    python tests/support/recorded.py --backend numpy    # the same of the NumPy reference
    python tests/support/recorded.py --dump FILE [WORD] # the arrays of runs with WORD in their name, as .npz

Every number that goes into a run is made here by operations that round the same way everywhere: no library's random numbers, no
matrix product, no power, no sine.
"""

import argparse
import hashlib
import itertools
import json
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw

from support.cases import SYSTEMS, Case, cases, number, representative

PATH = Path(__file__).with_name("recorded_bits.json")

#: The arrays of a run by name, in order.
Arrays = dict[str, Any]


class Recorded(NamedTuple):
    """One entry: what it is called, and how it is made by a backend; ``worlds`` have no other backend."""

    name: str
    make: Callable[[str], Arrays]
    world: bool = False


class Numbers:
    """Numbers that look random and are the same with every version of NumPy: splitmix64, the part of a Generator used here."""

    def __init__(self, *seed: Any) -> None:
        self.state = np.uint64(number(*seed))

    def _bits(self, n: int) -> Any:
        golden = np.uint64(0x9E3779B97F4A7C15)
        with np.errstate(over="ignore"):
            z = self.state + golden * np.arange(1, n + 1, dtype=np.uint64)
            self.state = z[-1] if n else self.state
            z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            return z ^ (z >> np.uint64(31))

    def uniform(self, low: float = 0.0, high: float = 1.0, size: Any = ()) -> Any:
        unit = (self._bits(int(np.prod(size))) >> np.uint64(11)).astype(np.float64) * 2.0**-53
        return low + (high - low) * unit.reshape(size)

    def normal(self, mean: float = 0.0, deviation: float = 1.0, size: Any = ()) -> Any:
        """Nearly: the sum of twelve. Multiples of 2⁻²⁰, so that small matrices of them have exact products in any order."""
        twelve = self._bits(12 * int(np.prod(size))).reshape(12, -1) >> np.uint64(44)
        whole = twelve.astype(np.int64).sum(axis=0) - 6 * 2**20
        return mean + deviation * (whole * 2.0**-20).reshape(size)


# ---- what is written down of a run
def arrays(run: sw.Run) -> Arrays:
    """Everything that a run computed."""
    computed: Arrays = {name: getattr(run, name) for name in ("t", "v", "y", "first_bad_step", "status", "carry", "work")}
    computed |= {f"recorded {name}": run.recorded[name] for name in sorted(run.recorded)}
    if run.paces is not None:
        computed |= run.paces._asdict()
    return {name: np.asarray(array) for name, array in computed.items() if array is not None}


def hashes(computed: Arrays) -> list[str]:
    """Two: of the bits, and of the values, in which −0 is +0. A NaN is a NaN in both, whatever its bits."""
    bits, values = (hashlib.blake2b(digest_size=8) for _ in range(2))
    for name, array in computed.items():
        array = np.where(np.isnan(array), np.nan, array).astype("<f8") if array.dtype.kind == "f" else array.astype("<i8")
        for digest, each in ((bits, array), (values, array + 0)):  # −0 + 0 is +0, and nothing else changes
            digest.update(f"{name} {each.dtype.kind} {each.shape};".encode())
            digest.update(np.ascontiguousarray(each).tobytes())
    return [bits.hexdigest(), values.hexdigest()]


def made(recorded: Recorded, backend: str = "rust") -> Arrays:
    """The arrays; a warning of members that diverge, stop or go astray is no news here."""
    with warnings.catch_warnings():
        for kind in (sw.AccuracyWarning, sw.DivergenceWarning, sw.ToleranceWarning, sw.ControlWarning):
            warnings.simplefilter("ignore", kind)
        return recorded.make(backend)


# ---- the families
#: The methods that take turns; one that is new must not move the others.
METHODS = (
    *("standard_euler", "damped_euler", "false_euler", "leapfrog", "verlet", "standard_heun", "false_heun", "semi_false_heun"),
    *("fehlberg", "merson", "rk4", "fehlberg_5", "pefrl", "dop853"),
)
ABLE = [m for m in METHODS if sw.method(m).error_order is not None]
#: Those that a control or a projection works with.
HELD = [m for m in METHODS if not sw.method(m).needs_acceleration]
QUANTITIES = ("energy", "momentum", "angular_momentum", "closest")
FORCES = ("logarithmic", "newton", "printed")
#: A lone member without a batch axis, a lone one with it, part of a group of lanes, one more than a group, and several groups.
BATCHES = (None, 1, 3, 33, 257)


def _axes(members: int | None) -> tuple[int, ...]:
    return () if members is None else (members,)


def _called(members: int | None) -> str:
    return "lone" if members is None else f"batch of {members}"


def _fixed(name: str, ask: Callable[[], tuple[sw.System, dict[str, Any]]], **options: Any) -> Recorded:
    """A run; the system and the start are made when it is."""

    def make(backend: str) -> Arrays:
        system, arguments = ask()
        return arrays(sw.integrate(system, **(arguments | options), backend=backend))

    return Recorded(name, make)


def _case(case: Case, members: int) -> tuple[sw.System, dict[str, Any]]:
    """As ``Case.make``, with the numbers of this file."""
    rng: Any = Numbers(case.system, members)
    system = SYSTEMS[case.system](rng, members)
    v, y = (rng.normal(size=(*shape, members)) for shape in (system.v_shape, system.y_shape))
    return system, {"method": case.method, "v": v, "y": y, "dt": 0.1, "form": case.form, "start": case.start}


def drawn() -> list[Case]:
    """Every system and every method several times in each form, the free oscillator always, and all that was drawn before."""
    every = list(cases())
    chosen = set(representative(every, {"direct": 5, "matrix": 3}))
    before = written()
    return [case for case in every if case in chosen or case.system == "free" or _varied(case).name in before]


def plain() -> Iterator[Recorded]:
    """Every system by several methods, at sizes and times that vary."""
    yield from map(_varied, drawn())


def _varied(case: Case) -> Recorded:
    draw = number("varied", str(case))
    members = BATCHES[1:][draw % 4]
    t0, start_step = ((0.0, 0), (0.0, 0), (0.3, 0), (-7.25, 12), (2.5, 1_000_003))[draw // 4 % 5]
    every = (None, 1, 5)[draw // 20 % 3]
    name = f"{case}, {_called(members)}"
    name += f", from step {start_step} of t0 = {t0}" if start_step or t0 else ""
    name += f", every {every}" if every else ""
    options = {"steps": 23, "every": every, "t0": t0, "start_step": start_step}
    return _fixed(name, lambda: _case(case, members), **options)


def _bodies(n: int, dim: int, force: str, members: int | None, softening: float = 0.1) -> tuple[sw.NBody, dict[str, Any]]:
    rng = Numbers("bodies", n, dim, force, members)
    axes = _axes(members)
    system = sw.NBody(rng.uniform(0.5, 1.5, (n, *axes)) / n, force=force, softening=softening)
    return system, {"v": 0.3 * rng.normal(size=(n, dim, *axes)), "y": rng.normal(size=(n, dim, *axes))}


def _control(kind: str, members: int | None) -> sw.EnergyControl | sw.Projection:
    rng = Numbers("control", members)
    gain, target = rng.uniform(0.0, 3.0, _axes(members)), rng.uniform(-0.5, 0.5, _axes(members))
    return {
        "limited": lambda: sw.EnergyControl(gain, target=target),
        "printed": lambda: sw.EnergyControl(gain, "printed", target=target),
        "scaling": lambda: sw.Projection("scaling", target=target),
        "nacozy": lambda: sw.Projection("nacozy", target=target),
        "relative": lambda: sw.EnergyControl(relative=0.2),
    }[kind]()


def _held(kind: str, n: int, dim: int, force: str, members: int | None) -> tuple[sw.NBody, dict[str, Any]]:
    system, state = _bodies(n, dim, force, members)
    return system, state | {"control": _control(kind, members)}


def controlled() -> Iterator[Recorded]:
    """Both forms of the control and both projections, with 2 to 35 bodies, all forces; methods and sizes rotate."""
    turns = itertools.product(("limited", "printed", "scaling", "nacozy"), (2, 3, 8, 35), (2, 3), FORCES)
    for i, (kind, n, dim, force) in enumerate(turns):
        method, members = HELD[i % len(HELD)], BATCHES[i % (5 if n < 35 else 4)]
        record = QUANTITIES if i % 3 == 0 else ()
        name = f"{method}, {n} bodies in {dim}-D, {force}, {kind}, {_called(members)}" + ", recorded" * bool(record)
        ask = partial(_held, kind, n, dim, force, members)
        yield _fixed(name, ask, method=method, dt=0.01, steps=12, every=(None, 1, 5)[i % 3], record=record)
    ask = partial(_held, "relative", 3, 2, "logarithmic", 3)
    for method in ("standard_euler", "rk4"):
        name = f"{method}, 3 bodies in 2-D, logarithmic, relative gain, target of the start, batch of 3"
        yield _fixed(name, ask, method=method, dt=0.01, steps=40, every=8, t0=1.5, start_step=3)


def quantities() -> Iterator[Recorded]:
    """Everything that can be recorded of bodies left alone, by every method; and the energy of the other systems."""
    turns = itertools.product((1, 2, 3, 5, 9, 35), (2, 3))
    for (i, method), (n, dim) in zip(enumerate(METHODS * 2), itertools.cycle(turns), strict=False):
        members, force = BATCHES[i % 4], FORCES[i % 3]
        name = f"{method}, {n} bodies in {dim}-D, {force}, {_called(members)}, all recorded"
        ask = partial(_bodies, n, dim, force, members)
        yield _fixed(name, ask, method=method, dt=0.02, steps=20, every=3, record=QUANTITIES)
    others = ("free", "damped, physical", "sinusoid x", "pendulum", "restricted three bodies", "Arenstorf's moon")
    for i, system in enumerate(others):
        ask = partial(_case, Case(HELD[2 * i], system, "direct", None), 33)
        yield _fixed(f"{HELD[2 * i]}, {system}, energy recorded", ask, steps=20, every=4, record="energy")


#: Systems for adaptive steps.
PACED: dict[str, Callable[[Any, tuple[int, ...]], sw.System]] = {
    "oscillator": lambda r, b: sw.Oscillator(r.uniform(0.5, 2.0, b)),
    "oscillator, damped, physical": lambda r, b: sw.Oscillator(r.uniform(0.5, 2.0, b), 0.3, form="physical"),
    "oscillator, sinusoid x": lambda r, b: sw.Oscillator(1.1, x=sw.Sinusoid(r.uniform(0.1, 1.0, b), 3.0, r.normal(size=b))),
    "oscillator, sampled a": lambda r, b: sw.Oscillator(
        r.uniform(0.5, 2.0, b), a=sw.Sampled(r.normal(size=(13, *b)), 0.07, -0.1)
    ),
    "pendulum": lambda r, b: sw.Pendulum(r.uniform(0.5, 2.0, b)),
    "pendulum, damped, sinusoid a": lambda r, b: sw.Pendulum(1.3, 0.2, a=sw.Sinusoid(r.normal(size=b), 2.0, 0.3)),
    "restricted three bodies": lambda r, b: sw.RestrictedThreeBody(r.uniform(0.05, 0.5, b)),
    "two bodies in space, newton": lambda r, b: sw.NBody(r.uniform(0.1, 1.0, (2, *b)), force="newton", softening=0.3, dim=3),
    "three bodies": lambda r, b: sw.NBody(G=r.uniform(0.5, 2.0, b), softening=0.05, dim=2),
    "five bodies, newton": lambda r, b: sw.NBody(r.uniform(0.1, 1.0, 5), force="newton", softening=0.2, dim=2),
    "thirty-five bodies, printed": lambda r, b: sw.NBody(r.uniform(0.0, 0.1, 35), force="printed", softening=0.3, dim=2),
    "chain of four": lambda r, b: sw.Chain(4, stiffness=r.uniform(0.5, 2.0, (5, *b))),
    "linear, five states": lambda r, b: sw.LinearSystem(
        _decaying(r, 5), np.ones((5, 1)), x=sw.Sinusoid(r.uniform(0.1, 1.0, b), 2.0), velocities=2
    ),
}


def _decaying(rng: Any, n: int, scale: float = 0.5) -> Any:
    return rng.normal(0.0, scale, (n, n)) - 1.2 * np.eye(n)


def paced() -> Iterator[Recorded]:
    """Adaptive steps, each member with a tolerance of its own."""
    loose = np.array([1e-2, 1e-5, 1e-3, 1e-9, 1e-4, 1e-7, 1e-6])
    for i, (system, method) in enumerate(itertools.product(PACED, ABLE)):
        members = BATCHES[(i + i // len(ABLE)) % (5 if not system.startswith("thirty-five") else 3)]
        tolerance = 1e-6 if members is None else loose[np.arange(members) % len(loose)]

        def ask(system: str = system, members: int | None = members) -> Any:
            rng = Numbers("paced", system, members)
            instance = PACED[system](rng, _axes(members))
            v, y = (rng.normal(size=(*shape, *_axes(members))) for shape in (instance.v_shape, instance.y_shape))
            return instance, {"v": 0.3 * v, "y": y}

        if np.ndim(tolerance) and system.startswith("linear"):  # whose components have tolerances of their own, or could have
            tolerance = tolerance[np.newaxis]
        t0 = (0.0, 0.25)[i % 2]
        at = [t0 + t for t in ((0.0, 0.11, 0.5, 0.53), (1.0,), (0.3, 0.7, 1.1))[i % 3]]
        yield _fixed(f"{method}, {system}, tolerance, {_called(members)}", ask, method=method, tolerance=tolerance, at=at, t0=t0)

    def orbit(e: Any) -> Any:
        e = np.asarray(e)
        v, y = np.zeros((2, 2, *e.shape)), np.zeros((2, 2, *e.shape))
        y[1, 0], v[1, 1] = 1.0 - e, np.sqrt((1.0 + e) / (1.0 - e))
        return sw.NBody([1.0, 0.0], force="newton"), {"v": v, "y": y}

    hard = np.array([0.1, 0.99, 0.5, 0.1, 0.9])[np.arange(40) % 5]
    for method in ABLE:
        options: dict[str, Any] = {"method": method, "at": [1.0, 3.0, 6.0]}
        orbits, name = partial(orbit, hard), f"{method}, orbits, tolerance, "
        yield _fixed(name + "a pair", orbits, tolerance=(1e-6, 1e-9), dt=0.2, **options)
        yield _fixed(name + "out of steps", orbits, tolerance=1e-8, max_steps=70, **options)
        yield _fixed(name + "energy recorded", partial(orbit, 0.6), tolerance=1e-7, record="energy", **options)
        for name, x in (("free fall", [-0.5, 0.5]), ("two in one place", [0.0, 0.0])):
            pair = sw.NBody([1.0, 1.0], force="newton"), {"v": np.zeros((2, 2)), "y": np.stack([x, [0.0, 0.0]], axis=1)}
            yield _fixed(f"{method}, {name}, tolerance", lambda pair=pair: pair, tolerance=1e-8, **options)


def diverging() -> Iterator[Recorded]:
    """Steps far past every limit, by every method: which member leaves the finite range in which step, and what is left of it."""
    for i, method in enumerate(METHODS):
        free = partial(_case, Case(method, "free", "direct", None), 70)
        yield _fixed(f"{method}, free, dt = 60", free, dt=60.0, steps=400, every=100)
        spread = sw.Oscillator(np.arange(33) * 0.25 + 0.125), {"method": method, "v": 0.0, "y": 1.0}
        near = {"dt": 1.0, "steps": 3000, "every": (None, 1000, 1)[i % 3], "start_step": 5}
        yield _fixed(f"{method}, free, past some limits", lambda spread=spread: spread, **near)
    others = ("damped", "pendulum", "restricted three bodies", "three bodies", "eight bodies", "chain of nineteen")
    for i, system in enumerate((*others, "linear, two states", "sampled x, sinusoid a", "linear, seventeen states")):
        case = Case(HELD[(3 * i + 1) % len(HELD)], system, "direct", None)
        yield _fixed(f"{case.method}, {system}, dt = 60", partial(_case, case, 33), dt=60.0, steps=200, every=50)
    for method in ("false_euler", "verlet", "rk4"):
        free = partial(_case, Case(method, "free", "matrix", None), 33)
        yield _fixed(f"{method}, free, matrix, dt = 3", free, dt=3.0, steps=2000, every=500)

    def meeting(kind: str) -> Any:
        y = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])[..., np.newaxis] * np.ones(9)
        y[1, :, 4] = y[0, :, 4]  # two bodies in one place
        control = {"control": sw.EnergyControl(0.5, target=-4.0)} if kind == "held" else {}
        return sw.NBody([1.0, 1.0, 1.0, 1.0], force="newton"), {"v": 0.1, "y": y} | control

    for kind, method in itertools.product(("free", "held"), ("false_euler", "rk4")):
        options: dict[str, Any] = {"method": method, "dt": 0.01, "steps": 300, "every": 100, "record": QUANTITIES}
        yield _fixed(f"{method}, four bodies, two of them in one place, {kind}", partial(meeting, kind), **options)

    def overshooting() -> Any:
        system, state = _bodies(3, 2, "logarithmic", 6)
        return system, state | {"control": sw.EnergyControl(np.array([0.3, 1.0, 10.0, 100.0, 1e4, 1e6]), "printed", target=1.0)}

    name = "standard_euler, three bodies, a control that overshoots"
    yield _fixed(name, overshooting, method="standard_euler", dt=0.05, steps=300)


def pieces() -> Iterator[Recorded]:
    """Runs in pieces, by ``resume``."""
    systems = ("free", "sinusoid x", "sampled x, sinusoid a", "pendulum", "three bodies", "chain of five", "linear, masses")

    def make(case: Case, backend: str) -> Arrays:
        system, arguments = _case(case, 35)
        return _in_pieces(system, arguments | {"every": 4, "backend": backend}, {"t0": 0.3})

    for i, method in enumerate(METHODS):
        for start in sw.method(method).starts or (None,):
            case = Case(method, systems[i % len(systems)], "direct", start)
            yield Recorded(f"{case}, in pieces", partial(make, case))
    for method in ("verlet", "rk4"):
        case = Case(method, "sinusoid x", "matrix", None)
        yield Recorded(f"{method}, sinusoid x, matrix, in pieces", partial(make, case))

    def make_held(kind: str, method: str, backend: str) -> Arrays:
        system, state = _bodies(5, 3, "newton", 9)
        arguments = state | {"method": method, "dt": 0.01, "record": QUANTITIES, "every": 3, "backend": backend}
        return _in_pieces(system, arguments, {"control": _control(kind, 9)})

    methods = {"limited": "rk4", "printed": "false_euler", "scaling": "standard_heun", "nacozy": "standard_euler"}
    for kind, method in methods.items():
        yield Recorded(f"{method}, 5 bodies, {kind}, in pieces", partial(make_held, kind, method))

    def make_bad(backend: str) -> Arrays:
        omega = np.arange(70) / 14.0 + 0.03125
        arguments: dict[str, Any] = {"method": "verlet", "v": 0.0, "y": 1.0, "dt": 1.0, "every": 50, "backend": backend}
        return _in_pieces(sw.Oscillator(omega), arguments, {}, (300, 1, 599))

    yield Recorded("verlet, free, in pieces after some diverged", make_bad)


def _in_pieces(
    system: sw.System, arguments: dict[str, Any], first: dict[str, Any], steps: tuple[int, ...] = (7, 1, 16)
) -> Arrays:
    """``first`` is what only the first piece is given."""
    computed: Arrays = {}
    same = {k: arguments[k] for k in ("method", "dt", "form", "record", "every", "backend") if k in arguments}
    run = None
    for i, n in enumerate(steps):
        run = sw.integrate(system, **(arguments | first if run is None else same | {"resume": run}), steps=n)
        computed |= {f"{i} {name}": array for name, array in arrays(run).items()}
    return computed


def worlds() -> Iterator[Recorded]:
    """The real-time loop, with states that the user changes between steps."""
    systems = (
        *("free", "damped", "sinusoids x and a, damped", "pendulum", "three bodies in space", "chain of five", "linear, masses"),
        *("sampled x and a, physical", "eight bodies", "linear, five states, two inputs", "restricted three bodies"),
    )
    fitting = {(c.method, c.system) for c in cases() if c.form == "direct"}
    for i, method in enumerate(METHODS):
        system = next(s for s in systems[i % len(systems) :] + systems if (method, s) in fitting)
        for start in sw.method(method).starts or (None,):
            for members in (1, 5, 97):
                case = Case(method, system, "direct", start)
                yield Recorded(f"{case}, world of {members}", lambda _, case=case, members=members: _stepped(case, members), True)
    for method, system in itertools.product(("leapfrog", "verlet", "pefrl"), ("free", "three bodies", "chain of nineteen")):
        case = Case(method, system, "direct", None)
        yield Recorded(f"{case}, world of 40", lambda _, case=case: _stepped(case, 40), True)

    def make(kind: str, method: str, _: str) -> Arrays:
        system, state = _held(kind, 3, 2, "newton", 5)
        return _walk(sw.World(system, method, **state, dt=0.01))

    for kind, method in (("limited", "false_euler"), ("printed", "rk4"), ("scaling", "standard_euler"), ("nacozy", "rk4")):
        yield Recorded(f"{method}, 3 bodies, {kind}, world of 5", partial(make, kind, method), True)

    def lone(_: str) -> Arrays:
        return _walk(sw.World(sw.Oscillator(1.3), "verlet", v=np.full((), 0.1), y=np.ones(()), dt=0.1))

    yield Recorded("verlet, free, world without a batch", lone, True)


def _stepped(case: Case, members: int) -> Arrays:
    system, arguments = _case(case, members)
    state = {"v": arguments["v"], "y": arguments["y"]}
    return _walk(sw.World(system, case.method, **state, dt=0.1, t0=0.4, start_step=2, start=case.start))


def _walk(world: sw.World) -> Arrays:
    computed: Arrays = {}
    for i, steps in enumerate((1, 4, 1, 0, 9, 40, 2)):
        world.step(steps)
        computed |= {f"{i} v": world.v.copy(), f"{i} y": world.y.copy(), f"{i} t": np.asarray(world.t)}
        if i == 2:
            world.v[...] += 0.5
        if i == 4:
            world.y[...] -= 0.125
    return computed | {"step_number": np.asarray(world.step_number)}


def large() -> Iterator[Recorded]:
    """What is no straight line: many bodies, long chains, large matrices."""
    methods = ("standard_euler", "rk4", "leapfrog", "false_heun", "dop853", "verlet", "merson", "pefrl", "damped_euler")
    turn = itertools.count()
    for n, members, steps in ((64, None, 8), (64, 3, 8), (64, 33, 3), (100, None, 8), (100, 3, 5), (300, None, 4), (300, 3, 2)):
        for dim in (2, 3):
            i = next(turn)
            method, force = methods[i % len(methods)], FORCES[i % 3]
            record = QUANTITIES if i % 4 == 0 else ()
            name = f"{method}, {n} bodies in {dim}-D, {force}, {_called(members)}, large" + ", recorded" * bool(record)
            ask = partial(_bodies, n, dim, force, members)
            yield _fixed(name, ask, method=method, dt=0.01, steps=steps, every=2, record=record)
    for method, dim, force in (("leapfrog", 2, "newton"), ("standard_heun", 3, "logarithmic"), ("rk4", 3, "printed")):
        ask = partial(_bodies, 1100, dim, force, None)
        yield _fixed(f"{method}, 1100 bodies in {dim}-D, {force}, large", ask, method=method, dt=0.01, steps=2)
    held = ("limited", "rk4", 64), ("printed", "false_euler", 100), ("scaling", "rk4", 300), ("nacozy", "false_heun", 64)
    for kind, method, n in held:
        name, ask = f"{method}, {n} bodies in 3-D, {kind}, large", partial(_held, kind, n, 3, "newton", 2)
        yield _fixed(name, ask, method=method, dt=0.01, steps=3, every=1, record=QUANTITIES)
    for method, n, dim, members, tolerance, at in (("dop853", 64, 3, None, 1e-6, 0.2), ("merson", 100, 2, 2, 1e-5, 0.1)):
        name, ask = f"{method}, {n} bodies, tolerance, large", partial(_bodies, n, dim, "newton", members)
        yield _fixed(name, ask, method=method, tolerance=tolerance, at=[at])

    for i, (n, members) in enumerate(((30, None), (30, 5), (30, 33), (80, None), (80, 5))):

        def linear(n: int = n, members: int | None = members) -> Any:
            rng = Numbers("linear", n, members)
            x = sw.Sinusoid(rng.uniform(0.1, 1.0, _axes(members)), 2.0, 0.5)
            system = sw.LinearSystem(_decaying(rng, n, 0.1), rng.normal(size=n), x=x, velocities=n // 3)
            v, y = (rng.normal(size=(*shape, *_axes(members))) for shape in (system.v_shape, system.y_shape))
            return system, {"v": v, "y": y}

        for form, method in zip(("direct", "direct", "matrix"), (HELD * 3)[3 * i :], strict=False):
            name = f"{method}, linear of {n} states, {form}, {_called(members)}, large"
            yield _fixed(name, linear, method=method, dt=0.05, steps=20, every=7, form=form)
        name = f"merson, linear of {n} states, tolerance, {_called(members)}, large"
        yield _fixed(name, linear, method="merson", tolerance=1e-5, at=[0.3, 0.9])

    def chain(members: int | None) -> Any:
        rng = Numbers("chain", members)
        axes = _axes(members)
        system = sw.Chain(100, stiffness=rng.uniform(0.5, 2.0, (101, *axes)), mass=rng.uniform(0.5, 2.0, 100))
        return system, {"v": rng.normal(size=(100, *axes)), "y": rng.normal(size=(100, *axes))}

    for i, method in enumerate(METHODS):
        members = (None, 3, 33)[i % 3]
        name = f"{method}, chain of a hundred, {_called(members)}, large"
        yield _fixed(name, partial(chain, members), method=method, dt=0.1, steps=20, every=6)
    for method in ("leapfrog", "verlet"):
        name = f"{method}, chain of a hundred, matrix, large"
        yield _fixed(name, partial(chain, None), method=method, dt=0.1, steps=20, form="matrix")
    name = "fehlberg_5, chain of a hundred, tolerance, large"
    yield _fixed(name, partial(chain, 3), method="fehlberg_5", tolerance=1e-5, at=[1.0])


def runs() -> dict[str, Recorded]:
    """All of them, by name."""
    families = (plain, controlled, quantities, paced, diverging, pieces, worlds, large)
    every = list(itertools.chain.from_iterable(family() for family in families))
    by_name = {each.name: each for each in every}
    assert len(by_name) == len(every), "two runs of one name"
    return by_name


def written() -> dict[str, list[str]]:
    """The hashes that were written down, by name."""
    return dict(json.loads(PATH.read_text(encoding="utf-8"))) if PATH.exists() else {}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the JSON anew")
    parser.add_argument("--backend", default="rust", choices=("rust", "numpy"), help="who makes the runs")
    parser.add_argument("--dump", metavar="FILE", help="write the arrays as .npz")
    parser.add_argument("word", nargs="?", default="", help="only runs with this in their name")
    options = parser.parse_args()
    chosen = {
        name: each for name, each in runs().items() if options.word in name and not (options.backend == "numpy" and each.world)
    }
    computed = {name: made(each, options.backend) for name, each in chosen.items()}
    if options.dump:
        np.savez_compressed(
            options.dump, **{f"{run}: {name}": array for run, blocks in computed.items() for name, array in blocks.items()}
        )
        return 0
    now = {name: hashes(blocks) for name, blocks in computed.items()}
    if options.write:
        lines = ",\n".join(f"  {json.dumps(name, ensure_ascii=False)}: {json.dumps(pair)}" for name, pair in sorted(now.items()))
        PATH.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
        return 0
    was = written()
    for name, (bits, values) in now.items():
        if name not in was:
            print(f"not written yet: {name}")
        elif was[name] != [bits, values]:
            print(f"{'signs of zeros' if was[name][1] == values else 'values'}: {name}")
    return int(any(was.get(name) != pair for name, pair in now.items()))


if __name__ == "__main__":
    sys.exit(main())
