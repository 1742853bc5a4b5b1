"""Runs on a device of OpenCL have the bits of the core, by fixed and by adaptive steps; in CI the device is the CPU, by PoCL.

The comparison of graphs shows that core and reference are one graph; these runs show that what is printed of it and compiled
computes it, among them with infinite, subnormal and missing numbers. Of the thousands of runs of ``device_proof``, most of a
second, few are made that show every method, family of systems, control and record; by ``make test-long`` those that show each of
them with all kinds of numbers and steps, and the others. What else there is to a run is below.
"""

import importlib
import itertools
import os
import subprocess
import sys
import warnings
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.base import progress
from stepwell.device import adaptive, device_of, fixed, opencl, printer, promise, stages
from stepwell.device.reader import READ
from stepwell.errors import ArgumentError, TooLargeError, UnsupportedError
from stepwell.runs import engine
from stepwell.runs.result import Status
from support import ROOT, device_proof, families
from support.device_proof import Proof
from support.devices import NAMES, SHORT, B, assert_same, driven, lorenz, needs_device, of_recorded, same, start, velocity_verlet
from support.families import family
from support.graphs import model
from support.own_methods import adams_bashforth_2
from support.refusals import refused

pytestmark = needs_device


CHOSEN = device_proof.chosen()
#: Each method, family, control, record and kind of numbers once; the long run has the pairs of them.
FEW = device_proof.few(CHOSEN)


def assert_proven(proof: Proof) -> None:
    """The run of the device is that of the core; what the core refuses is refused in the same words."""
    if refusal := proof.refusal():
        assert proof.refusal("opencl") == refusal, proof
        return
    try:
        got, core = proof.runs()
    except ArgumentError as error:
        if "float32 works with steps of up to" not in str(error):  # which is found when the step is traced, by both
            raise
        return
    assert_same(got, core, "t", "v", "y", "first_bad_step", "status", "work", "carry")
    assert got.recorded.keys() == core.recorded.keys()
    pairs = [(name, got.recorded[name], each) for name, each in core.recorded.items()]
    if core.paces is not None and got.paces is not None:
        pairs += zip(core.paces._fields, got.paces, core.paces, strict=True)
    for name, one, other in pairs:
        wrong = (one != other) & ~(np.isnan(one) & np.isnan(other))
        assert not wrong.any(), (str(proof), name, np.argwhere(wrong)[:3].tolist(), one[wrong][:3], other[wrong][:3])


@pytest.mark.parametrize("proof", families.family([(each,) for each in sorted(CHOSEN, key=str)], FEW.__contains__, ids=str))
def test_some(proof: Proof) -> None:
    assert_proven(proof)


@pytest.mark.long
@pytest.mark.parametrize("name", device_proof.SYSTEMS if families.LONG else [])
def test_all(name: str) -> None:
    """Every run of a system whose step is short enough."""
    for proof in device_proof.every():
        if proof.system == name and proof not in CHOSEN and proof.operations() <= device_proof.MOST:
            assert_proven(proof)


def test_every_method_family_control_and_record_is_among_the_chosen() -> None:
    """What the others could show beside, those of long steps left out, is nothing."""
    shown = {each for proof in CHOSEN for each in proof.shows()}
    missing = {each for proof in device_proof.every() for each in proof.shows() if each not in shown}
    assert not missing
    assert {each for proof in FEW for each in proof.parts()} == {each for proof in CHOSEN for each in proof.parts()}


@pytest.mark.mutant
def test_a_wrong_statement_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(printer.ARITHMETIC, "subtract", "{} + -{} * (real)1.0000001")
    monkeypatch.setattr(fixed, "_TEXTS", OrderedDict())  # the text of that run may be there already
    proof = next(each for each in sorted(CHOSEN, key=str) if each.method == "rk4" and not each.single)
    with pytest.raises(AssertionError):
        assert_proven(proof)


@pytest.mark.long
@pytest.mark.parametrize(
    "option", ["device", "tolerance", "resume", "events", "force", "float32", "energy", "own t0", "projection"]
)
def test_the_page_of_options_is_that_of_a_device(option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is written without one: what a device refuses, and what it makes, is what the page says."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    options = importlib.import_module("options")
    names = ("device",) if option == "device" else (option, "device")
    for kind in options.KINDS:
        with options.anywhere():
            expected = options.refusal(kind, names)
        assert options.refusal(kind, names) == expected, kind.name


#: All kinds of batches, worlds, records and starts are among them; methods and systems are above.
SOME = (*SHORT[27::36], "pefrl, chain of five, direct, in pieces", "leapfrog, free, past some limits")


@pytest.mark.parametrize("name", family(SHORT, SOME.__contains__))
def test_recorded_runs(name: str, monkeypatch: Any) -> None:
    of_recorded(name, monkeypatch)


@sw.system
def everything(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
    return -np.exp(-y * y) * np.tanh(v) - k * np.sqrt(np.abs(y)) * np.where(y > 0, 1.0, -1.0) / (1.0 + v * v) + np.floor(y)


def test_functions_forces_and_numbers_of_all_kinds() -> None:
    system = everything(k=np.linspace(0.5, 2.0, B))
    for dtype, fused in (("float64", False), ("float32", True)):
        same(system, "false_euler", v=start(), y=start(), dt=0.01, steps=100, dtype=dtype, fused=fused)
    ask: dict[str, Any] = {"v": start(), "y": start(), "dt": 0.02}
    same(sw.Oscillator(omega=np.linspace(0.5, 2.0, B)), "leapfrog", force=start(), steps=100, **ask)
    same(driven(u=sw.Sinusoid(0.2, np.linspace(1, 2, B))), "rk4", steps=90, **ask)
    u = sw.Sampled(np.random.default_rng(3).normal(size=40), 0.05)
    same(driven(u=u), "rk4", steps=60, every=20, t0=np.linspace(-1.0, 1.0, B), **ask)
    same(driven(), "rk4", v=0.1, y=1.0, dt=0.02, steps=80, every=1)
    same(driven(k=[2.0]), "rk4", v=0.1, y=1.0, dt=0.02, steps=80)
    for dtype in ("float64", "float32"):
        kind = np.finfo(dtype)
        sizes = [0.0, -0.0, kind.smallest_subnormal, kind.tiny / 64, -kind.tiny / 1000, kind.max / 1e8, -kind.max / 2]
        y = np.resize(np.array(sizes, np.float64), (3, B))
        same(lorenz(), "rk4", y=y, dt=1e-3, steps=50, every=10, dtype=dtype)


INPUTS = [
    (kind, *ways, dtype)
    for kind in ("common", "own")
    for ways in (("hold", "leapfrog"), ("hold", "rk4"), ("linear", "false_heun"), ("linear", "rk4"))
    for dtype in ("float64", "float32")
]


FEW_INPUTS = [INPUTS[i] for i in (0, 5, 9, 14)]


@pytest.mark.parametrize(("kind", "interpolation", "method", "dtype"), family(INPUTS, lambda *each: each in FEW_INPUTS))
def test_sampled_inputs(kind: str, interpolation: Any, method: str, dtype: str) -> None:
    """Samples that all have in common, and samples of each member."""
    values = np.random.default_rng(2).normal(size=(40, B))
    u = sw.Sampled(values if kind == "own" else values[:, 0], 0.05, interpolation=interpolation)
    same(driven(u=u), method, v=start(), y=start(), dt=0.02, steps=90, every=7, dtype=dtype, start_step=3)


DIVERGING = [("rk4", "float64"), ("leapfrog", "float64"), ("verlet", "float64"), ("verlet", "float32")]
DIVERGING += [pytest.param(method, "float32", marks=pytest.mark.long) for method in ("rk4", "leapfrog")]
FEW_OPTIONS = ("own start", "jumps", "own jumps", "every", "first step and longest", "dense")


@pytest.mark.parametrize(("method", "dtype"), DIVERGING)
def test_divergence_of_each_member(method: str, dtype: str) -> None:
    """The first step that was not finite, also of velocities that are computed from a carry, and across launches."""
    omega = np.geomspace(0.5, 3000.0, B)
    run = same(sw.Oscillator(omega=omega), method, v=start(), y=start(), dt=0.01, steps=700, every=100, dtype=dtype)
    assert 0 < (run.first_bad_step >= 0).sum() < B
    assert len(np.unique(run.first_bad_step)) > 20


def test_it_goes_on_where_it_stopped() -> None:
    for method in ("rk4", "verlet"):
        whole = same(driven(), method, v=start(), y=start(), dt=0.02, steps=80)
        half = sw.integrate(driven(), method, v=start(), y=start(), dt=0.02, steps=33, device="opencl")
        for device in ("opencl", "cpu"):
            rest = sw.integrate(driven(), method, resume=half, steps=47, device=device)
            assert np.array_equal(rest.y, whole.y)
            assert np.array_equal(rest.v, whole.v)


@sw.controller
def pulls(t: Any, v: Any, y: Any, seen: Any = 0.0, *, gain: Any = 0.5) -> Any:
    return seen - gain * y, 0.5 * seen + v


def test_what_a_controller_puts_out() -> None:
    """Also of a method that keeps blocks, which stand before what it remembers."""
    loop = driven(u=0.2).surrounded(pulls(period=0.1, delay=0.14))
    for method, dtype in itertools.product(("rk4", velocity_verlet, adams_bashforth_2), ("float64", "float32")):
        run = same(loop, method, v=start(), y=start(), dt=0.02, steps=31, every=3, dtype=dtype, record="u")
        assert run.recorded["u"][0, 0] == pytest.approx(0.2, rel=1e-7) != run.recorded["u"][-1, 0]


def test_progress_and_pieces(monkeypatch: Any) -> None:
    """A run in many short launches has the same bits, and tells how far it is."""
    monkeypatch.setattr(fixed, "MOST_STEPS", 3)
    monkeypatch.setattr(fixed, "FIRST_LAUNCH", 1)
    for every in (None, 1, 2, 7):
        same(driven(u=0.1), "leapfrog", v=start(), y=start(), dt=0.02, steps=23, every=every)


ABLE = [m.name for m in sw.methods() if m.error_order is not None]


#: Members that have each their own parameter, in all tests: so a method is compiled once.
MEMBERS = 70
K = np.linspace(0.5, 2.0, MEMBERS)
of_each = partial(start, members=MEMBERS)


@sw.system
def damped(t: Any, v: Any, y: Any, *, k: Any = 1.0, c: Any = 0.1) -> Any:
    return -k * np.sin(y) - c * v + 0.3 * np.cos(0.7 * t)


@sw.system(order=1)
def bursting(t: Any, y: Any, *, k: Any = 1.0) -> Any:
    """It has a pole, at a time that is each member's own."""
    return k * y * y


def pendulums(**more: Any) -> dict[str, Any]:
    """Seventy driven pendulums, each with its own tolerance."""
    tolerance = 10.0 ** -np.linspace(2.0, 9.0, MEMBERS)
    return {"v": of_each(), "y": of_each(1)[0], "tolerance": tolerance, "at": [0.0, 0.1, 0.1 + 1e-12, 1.0, 7.0]} | more


def of_series(method: str, ask: dict[str, Any]) -> dict[str, Any]:
    """A series has one order for all members."""
    return ask | {"tolerance": 1e-6} if sw.method(method).has_series else ask


#: A pair, one of three estimates, one that solves equations, and a series; the others differ in their numbers.
@pytest.mark.parametrize("method", family(ABLE, ("merson", "dop853", "rosenbrock23", "taylor").__contains__))
def test_methods(method: str) -> None:
    """Every member has its own times, steps and tolerance; one comes to no end, one has no attempts left."""
    run = same(damped(k=K), method, **of_series(method, pendulums(max_steps=60)))
    assert Status.OK in run.status
    assert Status.BUDGET in run.status or method in ("dop853", "taylor")


@pytest.mark.parametrize("method", family(["merson", "rodas4", "taylor"], lambda method: method != "rodas4"))
def test_members_that_diverge(method: str) -> None:
    system = bursting(k=np.linspace(0.0, 2.0, MEMBERS))
    run = same(system, method, y=np.ones(MEMBERS), tolerance=1e-6, at=[0.3, 1.0, 3.0], max_steps=3000)
    assert set(run.status.tolist()) > {Status.OK}
    assert np.isnan(run.y).any()


OPTIONS: dict[str, dict[str, Any]] = {
    "own times": {"at": np.sort(np.random.default_rng(1).uniform(0.0, 5.0, (4, MEMBERS)), axis=0)},
    "own start": {"t0": np.linspace(-1.0, 0.0, MEMBERS)},
    "backward": {"t0": 1.0, "at": [1.0, 0.5, -2.0]},
    "jumps": {"jumps": [0.5, 0.7, 3.0]},
    "own jumps": {"jumps": np.sort(np.random.default_rng(2).uniform(0.0, 7.0, (3, MEMBERS)), axis=0)},
    "jumps backward": {"jumps": [0.5, -0.7], "t0": 1.0, "at": [-2.0]},
    "every": {"every": 3, "at": [7.0]},
    "first step and longest": {"dt": 0.01, "max_step": 0.05},
    "force": {"force": of_each(3)[0]},
    "absolute": {"tolerance": (1e-5, 1e-7)},
    "fused": {"fused": True},
    "fused, jumps": {"fused": True, "jumps": [0.5, 3.0]},
    "dense": {"at": np.linspace(0.0, 3.0, 400)},
    "float32": {"dtype": "float32", "tolerance": 1e-5},
    "float32, fused, every": {"dtype": "float32", "tolerance": 1e-4, "fused": True, "every": 2, "at": [3.0]},
    "float32, jumps, backward": {"dtype": "float32", "tolerance": 1e-4, "jumps": [0.5, -0.7], "t0": 1.0, "at": [-2.0]},
}


#: Options of the kernel that is compiled for each method, and every option but one that is of two others by a pair; a series
#: backward, whose held steps are other statements.
FEW_OPTIONS = ("own start", "jumps", "own jumps", "every", "first step and longest", "dense")


def is_everyday(option: str, method: str) -> bool:
    if method == "merson":
        return option != "float32, fused, every"
    return option in FEW_OPTIONS or (option, method) in (("jumps backward", "taylor"), ("fused, jumps", "taylor"))


@pytest.mark.parametrize("method", ["merson", "rosenbrock23", "taylor"])
def test_options(method: str) -> None:
    for option, options in OPTIONS.items():
        able = "float32" not in option or not sw.method(method).has_series
        if able and (families.LONG or is_everyday(option, method)):
            same(damped(k=K), method, **of_series(method, pendulums(**options)) | options)


@pytest.mark.parametrize(
    ("dtype", "backward"),
    family(itertools.product(("float64", "float32"), (False, True)), lambda dtype, backward: (dtype == "float32") == backward),
)
def test_sampled_inputs_of_adaptive_steps(dtype: str, backward: bool) -> None:
    """Samples of all members and of each, at times before the first and behind the last, too."""
    rng = np.random.default_rng(4)
    x = sw.Sampled(rng.normal(size=40), 0.05, start=0.5)
    a = sw.Sampled(rng.normal(size=(30, MEMBERS)), 0.1)
    system = sw.Oscillator(np.linspace(0.5, 3.0, MEMBERS), x=x, a=a, form="physical")
    times = {"t0": 2.5, "at": [2.0, 0.4, -0.3]} if backward else {"at": [0.0, 0.55, 2.9, 3.3]}
    same(system, "merson", v=of_each(), y=of_each(1)[0], tolerance=1e-5, dtype=dtype, **times)


@sw.system(order=1)
def decay(t: Any, y: Any, *, k: Any = 30.0) -> Any:
    return np.array([-k * y[0], k * y[0] - y[1] * y[2], y[1] * y[2]])


def test_tolerances_of_components_events_and_axes() -> None:
    ask: dict[str, Any] = {"y": np.abs(of_each(3)), "at": [0.1, 2.0]}
    same(decay(), "merson", **ask, tolerance=1e-3, positive=True)
    same(decay(), "merson", **ask, tolerance=(np.array([1e-4, 1e-6, 1e-5]), np.array([1e-9, 1e-8, 0.0])))
    # They are looked for by the core, and members that stop do so at the same time.
    event = sw.Event(lambda t, v, y: y - 0.2, name="there", terminal=True)
    run = same(damped(k=K), "merson", **pendulums(events=[event], at=[1.0, 3.0]))
    assert set(run.status.tolist()) == {Status.OK, Status.EVENT}
    same(damped(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0])
    same(damped(), "merson", v=of_each()[:6].reshape(2, 3), y=np.ones((2, 3)), tolerance=1e-6, at=[1.0, 2.0])


@pytest.mark.parametrize("method", ["merson", "taylor"])
def test_what_goes_on(method: str) -> None:
    """A run in pieces, by the device and the core in turn, is the run of the core; the last state of a piece takes a step."""
    ask, times = of_series(method, pendulums()), np.array([0.1, 0.3, 0.3 + 1e-9, 2.0, 5.0])
    whole = sw.integrate(damped(k=K), method, **ask | {"at": times})
    for cut in (1, 2, 4):
        first = sw.integrate(damped(k=K), method, **ask | {"at": times[:cut]}, device="opencl")
        rest = same(damped(k=K), method, at=times[cut:], resume=first)
        within = [i for i in range(len(times)) if i != cut - 1 or method == "taylor"]
        assert np.array_equal(np.concatenate([first.y, rest.y])[within], whole.y[within])
        assert np.array_equal(rest.paces.accepted, whole.paces.accepted)  # type: ignore[union-attr]


@pytest.mark.parametrize("method", ["merson", "taylor"])
def test_bits_do_not_depend_on_launches_and_shares(monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    """A launch for each attempt, and some members at a time: held steps and kept states go from launch to launch."""
    ask = of_series(method, pendulums(at=np.linspace(0.0, 2.0, 30)))
    monkeypatch.setattr(adaptive, "FIRST_LAUNCH", 1)
    monkeypatch.setattr(adaptive, "MOST_ATTEMPTS", 1)
    monkeypatch.setattr(adaptive, "MOST_SAVED", 1 << 14)
    same(damped(k=K), method, **ask)
    same(damped(k=K), method, **ask | {"every": 2, "at": [2.0], "jumps": [0.3]})


@pytest.mark.parametrize("method", ["bs32", "tsit5", "dop853", "rodas5p"])
def test_states_within_steps_are_those_of_the_core(method: str) -> None:
    """By the continuous extension, and by steps where a number changes much in one."""
    for tolerance in (1e-1, 1e-6):
        same(damped(k=K), method, **pendulums(at=np.linspace(0.0, 5.0, 60), tolerance=tolerance))


@pytest.mark.parametrize("method", ["rosenbrock23", "taylor"])
def test_waypoints_are_those_of_the_core(monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    """Where members stood at powers of two of their steps, from which stiffness is found"""
    seen: list[Any] = []
    adapt = engine.adapt

    def spy(*arguments: Any) -> engine.Adapted:
        out = adapt(*arguments)
        seen.append(out.waypoints)
        return out

    monkeypatch.setattr(engine, "adapt", spy)
    ask = pendulums(at=np.linspace(0.0, 40.0, 5), max_step=np.geomspace(0.02, 1.0, MEMBERS))
    same(damped(k=K), method, **of_series(method, ask))
    core, device = (np.moveaxis(each, 1, 0) for each in seen)
    for each in (core, device):
        # The next saved time, for which lanes with sums do not stop, and the extra steps, which they count after a step.
        each[[2 * 2 + engine.TARGET, 2 * 2 + engine.COUNTS.stop - 1]] = 0.0
    counts = core[2 * 2 + engine.COUNTS.start]
    assert np.array_equal(device[2 * 2 + engine.COUNTS.start], counts)
    assert np.array_equal(device[:, counts > 0.0], core[:, counts > 0.0])
    assert (counts > 0.0).any()


def test_progress_comes_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    shares: list[float] = []

    @contextmanager
    def bar(_: str) -> Iterator[Any]:
        yield shares.append

    monkeypatch.setattr(progress, "bar", bar)
    sw.integrate(damped(k=K), "merson", device="opencl", progress=True, **pendulums())
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


# ---- steps that are too long to print are read by a kernel, operation by operation
@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> None:
    """However short a step is, it is read."""
    monkeypatch.setattr(stages, "MOST_OPERATIONS", 0)
    for module in (fixed, adaptive):
        monkeypatch.setattr(module, "_TEXTS", OrderedDict())


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("name", family(SHORT[4::27], lambda name: SHORT.index(name) % 108 == 4))
def test_recorded_runs_are_read(name: str, monkeypatch: Any) -> None:
    of_recorded(name, monkeypatch)


@sw.system
def stirred(t: Any, v: Any, y: Any, *, u: Any = 0.0) -> Any:
    """All kinds of operations."""
    turn = np.sin(y) + np.log(1.0 + y * y) * np.exp(-np.abs(v))
    return np.where(y > 0.2, turn, np.floor(3.0 * y)) - np.sqrt(y * y + 1.0) + u


#: Methods by fixed steps with all kinds of numbers, and a method that solves equations.
PRECISIONS = itertools.product(("standard_euler", "rk4", "dop853", "rodas4"), ("float64", "float32"), (False, True))


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize(
    ("method", "dtype", "fused"),
    family(PRECISIONS, lambda *each: each in (("rk4", "float32", True), ("rodas4", "float64", False))),
)
def test_precisions(method: str, dtype: str, fused: bool) -> None:
    same(lorenz(), method, y=start(3), dt=0.01, steps=9, every=4, dtype=dtype, fused=fused)


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("method", family(["fehlberg", "dop853", "taylor", "rosenbrock23"], ("fehlberg", "taylor").__contains__))
def test_adaptive_steps(method: str) -> None:
    same(lorenz(), method, y=start(3), tolerance=1e-6, at=[0.5, 1.0])


def test_every_operation_of_a_tape_is_read_and_printed() -> None:
    leaves = {"state", "parameter", "step", "time", "constant", "sample", "budget"}
    names = {name for name, *_ in _core.tape_operations()} - leaves
    assert names - set(READ) <= {"gather", "of the step", "held", "row", "uniform"}, names - set(READ)
    known = {*printer.ARITHMETIC, *printer.COMPARISONS, *printer.OF_BITS, "choose", "shift up", "shift down"}
    assert {name for name, operands, *_ in _core.tape_operations() if operands} - known == {"sample", "copy", "gather"}


def of_bodies(n: int) -> tuple[Any, dict[str, Any]]:
    """What makes so many bodies, and two starts of them."""
    v, y = np.random.default_rng(1).normal(size=(2, n, 2, 2))
    return (lambda **more: sw.NBody(np.ones(n) / n, softening=0.1, **more)), {"v": v, "y": y}


FLOOR = sw.Floor(normal=[0.0, 1.0], offset=-0.5)


def test_bodies_of_more_operations_than_a_compiler_is_given() -> None:
    """Fused operations are among what needs the whole step."""
    bodies, start = of_bodies(22)
    assert _core.operations(model(bodies(), sw.method("dop853"))) > stages.MOST_OPERATIONS
    same(bodies(), "dop853", dt=0.01, steps=3, every=2, fused=True, **start)
    cpu, *others = sw.devices()
    assert cpu.name == "cpu"
    assert not cpu.float64
    assert [each.name for each in others] == [f"opencl:{i}" for i in range(len(others))]
    assert all(each.memory > 0 and each.units > 0 and each.title for each in others)


@pytest.mark.usefixtures("reads")
def test_bodies_worlds_and_own_equations_are_read() -> None:
    """Surfaces, and adaptive steps."""
    bodies, start = of_bodies(4)
    same(bodies(floor=FLOOR), "rk4", dt=0.01, steps=3, **start)
    same(bodies(), "fehlberg", tolerance=1e-6, at=[0.1], **start)
    states = []
    for device in ("cpu", "opencl"):
        y = np.array([0.1, 0.2, 0.4])
        world = sw.World(sw.Pendulum(np.ones(3)), "rk4", v=np.zeros(3), y=y, dt=0.1, device=device)
        world.step(3)
        world.set(omega=np.array([1.0, 2.0, 3.0]))
        world.step(4)
        states.append(y)
    np.testing.assert_array_equal(*states)
    # Of both kinds of numbers, whose functions have other operations; and at times of each member.
    samples, y = np.random.default_rng(1).normal(size=(40, 7)), np.linspace(-2.0, 2.0, 7)
    for dtype in ("float64", "float32"):
        system = stirred(u=sw.Sampled(samples, 0.05))
        same(system, "false_euler", v=0.1, y=y, dt=0.05, steps=20, every=6, dtype=dtype)
    # The place of a sample is computed by lines that were read before.
    for interpolation in ("hold", "linear") if families.LONG else ("linear",):
        own = driven(u=sw.Sampled(samples, 0.05, interpolation=interpolation))
        same(own, "fehlberg", v=0.1, y=y, tolerance=10.0 ** -np.linspace(2.0, 7.0, 7), at=[0.3, 1.1])
    same(stirred(), "rk4", v=0.0, y=np.array([np.pi, 1e200, 1e308, 5e-324, -0.0, 1e-310]), dt=0.1, steps=12, every=5)


@pytest.mark.long
def test_many_operations() -> None:
    bodies, state = of_bodies(22)
    same(bodies(floor=FLOOR), "dop853", dt=0.01, steps=3, **state)
    same(bodies(), "dop853", tolerance=1e-6, at=[0.1], **state)
    system = sw.LinearSystem(np.random.default_rng(1).normal(size=(105, 105)))
    with pytest.raises(UnsupportedError, match="statements is too long for a compiler, which gets at most 12000"):
        sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=1, device="opencl")

    @sw.system
    def chain(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        d = np.diff(y, axis=0)
        f = k * d + d * d * d
        return np.concatenate([f[:1], f[1:] - f[:-1], -f[-1:]])

    same(chain(), "rk4", v=start(75), y=start(75), dt=0.01, steps=20)


@pytest.mark.usefixtures("reads")
def test_a_kernel_of_some_statements_too_many_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "MOST_STATEMENTS", 5)
    with pytest.raises(UnsupportedError, match="statements is too long for a compiler, which gets at most 5;"):
        sw.integrate(lorenz(), "rk4", y=start(3), dt=0.1, steps=1, device="opencl")


@pytest.mark.parametrize("name", NAMES)
def test_the_kernel_of_a_step(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pendulum = sw.Pendulum(np.ones(4))
    plain, explained = sw.explain(pendulum, "rk4"), sw.explain(pendulum, "rk4", device=name)
    kernel = explained.kernel
    assert plain.kernel is None
    assert explained.listing == plain.listing
    assert (kernel.device, kernel.numbers) == (name, 2)
    assert kernel.member_bytes == 8 * (2 * 2 + 1) + 8  # twice the state, omega, and where it diverged
    assert "__kernel void steps(" in kernel.text
    assert kernel.lines == len(kernel.text.splitlines())
    assert str(kernel) in str(explained)
    assert explained.as_dict()["kernel"]["text"] == kernel.text
    assert sw.explain(sw.Pendulum(), "rk4", device=name, dtype="float32").kernel.member_bytes == 4 * 4 + 8  # type: ignore[union-attr]
    monkeypatch.setenv("STEPWELL_DEVICE", name)
    assert sw.explain(pendulum, "rk4").kernel == kernel
    assert sw.explain(pendulum, "rk4", device="cpu").kernel is None
    assert sw.explain(pendulum, "dop853", attempt=True).kernel is None


def test_wrong_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    n, options = 200, {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1}
    with pytest.raises(UnsupportedError, match="too long for a kernel, which has at most 100000"):
        sw.integrate(sw.LinearSystem(np.eye(n)), "rk4", device="opencl", **options)
    for name in ("gpu", "opencl:", "opencl:x", 3, "cuda"):
        with pytest.raises(ArgumentError, match=r"device: expected 'cpu', 'opencl', or 'opencl:1'"):
            sw.integrate(sw.Oscillator(), "rk4", device=name, **options)
    with pytest.raises(UnsupportedError, match=r"device: there is no opencl:77; there are opencl:0 \("):
        sw.integrate(sw.Oscillator(), "rk4", device="opencl:77", **options)
    with pytest.raises(ArgumentError, match="device: works with backend='rust' only"):
        sw.integrate(sw.Oscillator(), "rk4", device="opencl", backend="numpy", **options)
    refused(ArgumentError, "device: expected 'cpu'", sw.explain, sw.Pendulum(), "rk4", device="gpu")
    refused(UnsupportedError, "goes without attempt", sw.explain, sw.Pendulum(), "dop853", attempt=True, device=NAMES[0])
    monkeypatch.setenv("STEPWELL_DEVICE", "nothing")
    refused(ArgumentError, "STEPWELL_DEVICE: expected", sw.integrate, sw.Oscillator(), "rk4", **options)
    sw.integrate(sw.Oscillator(), "rk4", device="cpu", **options)


RUN = """
import sys
{before}
import stepwell as sw
try:
    sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, device="opencl")
except sw.errors.UnsupportedError as error:
    print(error)
print([each.name for each in sw.devices()])
"""


def test_without_pyopencl_and_without_a_device(tmp_path: Any) -> None:
    for before, environment, *texts in (
        ("sys.modules['pyopencl'] = None", {}, "device: needs pyopencl, which is not installed; pip install 'stepwell[gpu]'"),
        ("", {"OCL_ICD_VENDORS": str(tmp_path)}, "device: pyopencl finds no device", "pocl-opencl-icd"),
    ):
        words, env = [sys.executable, "-c", RUN.format(before=before)], os.environ | environment
        printed = subprocess.run(words, capture_output=True, text=True, check=True, env=env, timeout=120).stdout
        for text in (*texts, "['cpu']"):
            assert text in printed


_FLUSHED = "fabs(a) < (real)2.2250738585072014e-308"
MISTAKES = {
    "sums": ("a + b", "(real)((float)a + (float)b)", "sums are not rounded"),
    "subnormal numbers": ("a * (real)0.5", f"{_FLUSHED} ? 0 : a * (real)0.5", "subnormal numbers become"),
    "contraction": ("a * b + c", "fma(a, b, c)", "products are contracted with sums"),
    "quotients": ("a / b", "a * ((real)1 / b)", "quotients are not correctly rounded"),
    "fused": ("fma(a, b, c)", "a * b + c", "fused multiply-adds are not rounded once"),
}


def test_a_device_with_other_bits_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    machine, tried = device_of("opencl"), promise.TRIED
    for written, instead, reason in MISTAKES.values():
        monkeypatch.setattr(promise, "TRIED", [(instead if text == written else text, why) for text, why in tried])
        assert reason in promise.broken.__wrapped__(machine, False)
    monkeypatch.setattr(opencl.Machine, "rounds_single", False)
    assert "float32" in promise.broken.__wrapped__(device_of("opencl"), True)
    monkeypatch.setattr(opencl.Machine, "has_doubles", False)
    assert promise.broken.__wrapped__(device_of("opencl"), False) == "it has no float64"


@pytest.mark.parametrize("options", [{"dt": 0.02, "steps": 70}, {"tolerance": 1e-5, "at": [0.5]}], ids=["fixed", "adaptive"])
def test_groups_have_one_size(options: dict[str, Any], monkeypatch: Any) -> None:
    """Drivers of CPUs compile a kernel anew for each, which takes longer than many runs: not for other numbers of members."""
    machine = device_of("opencl")
    if not machine.is_cpu:
        pytest.skip("others choose a size for few members")
    sizes: set[Any] = set()
    begin = opencl.Machine.start

    def noted(self: Any, kernel: Any, size: int, group: int | None, *arguments: Any) -> None:
        if kernel.function_name != "prepare":
            sizes.add(group)
        begin(self, kernel, size, group, *arguments)

    monkeypatch.setattr(opencl.Machine, "start", noted)
    for members, expected in ((70, 64), (257, 64), (3, 1), (5, 1)):
        sizes.clear()
        sw.integrate(driven(u=0.1), "merson", v=start()[:members], y=start()[:members], device="opencl", **options)
        assert sizes == {expected}


def test_what_does_not_fit_and_what_does_not_compile_is_said(monkeypatch: Any) -> None:
    machine = device_of("opencl")
    with pytest.raises(UnsupportedError, match=r"device: the compiler of opencl:0 .* fails at a step of 1 statements"):
        machine.program("this is no C;")
    monkeypatch.setattr(opencl.Machine, "largest", 1000)
    with pytest.raises(TooLargeError, match=r"device: an array of the run takes .* has at most .* for one"):
        sw.integrate(lorenz(), "rk4", y=start(3), dt=0.1, steps=1, device="opencl")


def test_notes_of_a_compiler_are_not_passed_on() -> None:
    """NVIDIA's has one on every kernel."""
    import pyopencl

    machine, text = device_of("opencl"), "#warning a note\n__kernel void noted() {}"
    with pytest.warns(pyopencl.CompilerWarning):
        pyopencl.Program(machine.context, text).build()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        machine.program(text)


def failed(cl: Any, routine: str, code: int) -> Any:
    """An error as pyopencl raises it."""
    return cl.MemoryError(cl._cl._ErrorRecord(msg="no room", code=code, routine=routine))


class Full:
    """A device's module that stands for one with no room: what it does after some calls raises pyopencl's own error."""

    def __init__(self, cl: Any, code: int, after: int) -> None:
        self._cl, self._code, self._left = cl, code, after

    def __getattr__(self, name: str) -> Any:
        if name not in ("Buffer", "enqueue_copy"):
            return getattr(self._cl, name)
        self._left -= 1
        if self._left >= 0:
            return getattr(self._cl, name)

        def fails(*_: Any, **__: Any) -> Any:
            raise failed(self._cl, name, self._code)

        return fails


def test_a_device_that_is_full_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each array fits, all together do not: drivers say so when an array is made, or when it is used. Other errors stay."""
    machine = device_of("opencl")
    cl, ask = machine.cl, {"y": start(3), "dt": 0.1, "steps": 4, "every": 1, "device": "opencl"}
    sw.integrate(lorenz(), "rk4", **ask)
    for code, after in itertools.product((-4, -5, -6, -61), (0, 3, 9)):
        monkeypatch.setattr(machine, "cl", Full(cl, code, after))
        with pytest.raises(TooLargeError, match=r"device: opencl:0 .* has no room for all arrays of the run \(.*no room"):
            sw.integrate(lorenz(), "rk4", **ask)
    monkeypatch.setattr(machine, "cl", Full(cl, -38, 2))
    refused(cl.Error, "INVALID_MEM_OBJECT", sw.integrate, lorenz(), "rk4", **ask)

    def kernel(*_: Any) -> None:
        raise failed(cl, "clEnqueueNDRangeKernel", -4)

    refused(TooLargeError, "MEM_OBJECT_ALLOCATION_FAILURE", machine.start, kernel, 1, None)
