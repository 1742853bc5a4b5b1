"""Runs of adaptive steps on a device of OpenCL have the bits of the core; in CI the device is the CPU, by PoCL."""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base import progress
from stepwell.device import adaptive as on_device
from stepwell.errors import StepwellError, UnsupportedError
from stepwell.runs import engine
from stepwell.runs.result import Status
from support.cases import ADAPTIVE, SYSTEMS
from support.devices import needs_device, same
from support.families import family

pytestmark = needs_device

ABLE = [m.name for m in sw.methods() if m.error_order is not None]
#: Those whose numbers may be float32: a series is in float64 only.
IN_FLOAT32 = [name for name in ABLE if not sw.method(name).has_series]
MEMBERS = 70
#: Of each member its own, in all tests: so a method is compiled once.
K = np.linspace(0.5, 2.0, MEMBERS)


@sw.system
def driven(t: Any, v: Any, y: Any, *, k: Any = 1.0, c: Any = 0.1) -> Any:
    return -k * np.sin(y) - c * v + 0.3 * np.cos(0.7 * t)


@sw.system(order=1)
def bursting(t: Any, y: Any, *, k: Any = 1.0) -> Any:
    """It has a pole, at a time that is each member's own."""
    return k * y * y


def same_if_possible(system: Any, method: str, **options: Any) -> None:
    """``same`` where the core makes the run; what it refuses is refused in the same words."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            sw.integrate(system, method, **options)
        except StepwellError as error:
            with pytest.raises(type(error), match=re.escape(str(error))):
                sw.integrate(system, method, device="opencl", **options)
            return
    try:
        same(system, method, **options)
    except UnsupportedError as error:
        if "too long for a kernel" not in str(error):  # which the core makes
            raise


def start(*shape: int, members: int = MEMBERS) -> Any:
    return np.random.default_rng(sum(shape)).normal(size=(*shape, members))


def pendulums(**more: Any) -> dict[str, Any]:
    """Seventy driven pendulums, each with its own tolerance."""
    tolerance = 10.0 ** -np.linspace(2.0, 9.0, MEMBERS)
    return {"v": start(), "y": start(1)[0], "tolerance": tolerance, "at": [0.0, 0.1, 0.1 + 1e-12, 1.0, 7.0]} | more


def of_series(method: str, ask: dict[str, Any]) -> dict[str, Any]:
    """A series has one order for all members."""
    return ask | {"tolerance": 1e-6} if sw.method(method).has_series else ask


#: One with a clock, one that is projected, and one that is refused; all families are in ``test_device_proof.py``.
FEW = ("sinusoid a, damped, physical", "pendulum in space, length projection", "rods, three hanging in space, length control")
#: One whose samples are looked up between the decisions, and one that is refused.
FEW_IN_FLOAT32 = ("sampled x and a, physical", "pendulum in space, length control")


@pytest.mark.parametrize(
    ("name", "method"),
    family([(name, ABLE[i % len(ABLE)]) for i, name in enumerate(ADAPTIVE)], lambda name, _: name in FEW),
)
def test_systems(name: str, method: str) -> None:
    rng = np.random.default_rng(5)
    system = SYSTEMS[name](rng, 13)
    ask: dict[str, Any] = {"v": 0.3 * start(*system.v_shape, members=13), "y": start(*system.y_shape, members=13)}
    ask |= {"tolerance": 10.0 ** rng.uniform(-6, -2, 13), "at": [0.0, 0.11, 0.5, 0.53], "max_steps": 100}
    same_if_possible(system, method, **of_series(method, ask))


@pytest.mark.parametrize(
    ("name", "method"),
    family(
        [(name, IN_FLOAT32[i % len(IN_FLOAT32)]) for i, name in enumerate(ADAPTIVE)],
        lambda name, _: name in FEW_IN_FLOAT32,
    ),
)
def test_systems_in_float32(name: str, method: str) -> None:
    system = SYSTEMS[name](np.random.default_rng(3), 6)
    ask: dict[str, Any] = {"v": 0.3 * start(*system.v_shape, members=6), "y": start(*system.y_shape, members=6)}
    same_if_possible(system, method, tolerance=1e-5, at=[0.3, 0.5], max_steps=60, dtype="float32", **ask)


#: A pair, one of three estimates, one that solves equations, and a series; the others differ in their numbers.
@pytest.mark.parametrize("method", family(ABLE, ("merson", "dop853", "rosenbrock23", "taylor").__contains__))
def test_methods(method: str) -> None:
    """Every member has its own times, steps and tolerance; one comes to no end, one has no attempts left."""
    run = same(driven(k=K), method, **of_series(method, pendulums(max_steps=60)))
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
    "force": {"force": start(3)[0]},
    "absolute": {"tolerance": (1e-5, 1e-7)},
    "fused": {"fused": True},
    "dense": {"at": np.linspace(0.0, 3.0, 400)},
    "float32": {"dtype": "float32", "tolerance": 1e-5},
    "float32, fused, every": {"dtype": "float32", "tolerance": 1e-4, "fused": True, "every": 2, "at": [3.0]},
    "float32, jumps, backward": {"dtype": "float32", "tolerance": 1e-4, "jumps": [0.5, -0.7], "t0": 1.0, "at": [-2.0]},
}


#: Options of the kernel that is compiled for each method, and every option but one that is of two others by a pair; a series
#: backward, whose held steps are other statements.
FEW_OPTIONS = ("own start", "jumps", "own jumps", "every", "first step and longest", "dense")
ALL_OPTIONS = [
    (option, method)
    for option, method in itertools.product(OPTIONS, ("merson", "rosenbrock23", "taylor"))
    if "float32" not in option or not sw.method(method).has_series
]


def is_everyday(option: str, method: str) -> bool:
    if method == "merson":
        return option != "float32, fused, every"
    return option in FEW_OPTIONS or (option, method) == ("jumps backward", "taylor")


@pytest.mark.parametrize(("option", "method"), family(ALL_OPTIONS, is_everyday))
def test_options(option: str, method: str) -> None:
    same(driven(k=K), method, **of_series(method, pendulums(**OPTIONS[option])) | OPTIONS[option])


@pytest.mark.parametrize(
    ("dtype", "backward"),
    family(itertools.product(("float64", "float32"), (False, True)), lambda dtype, backward: (dtype == "float32") == backward),
)
def test_sampled_inputs(dtype: str, backward: bool) -> None:
    """Samples of all members and of each, at times before the first and behind the last, too."""
    rng = np.random.default_rng(4)
    x = sw.Sampled(rng.normal(size=40), 0.05, start=0.5)
    a = sw.Sampled(rng.normal(size=(30, MEMBERS)), 0.1)
    system = sw.Oscillator(np.linspace(0.5, 3.0, MEMBERS), x=x, a=a, form="physical")
    times = {"t0": 2.5, "at": [2.0, 0.4, -0.3]} if backward else {"at": [0.0, 0.55, 2.9, 3.3]}
    same(system, "merson", v=start(), y=start(1)[0], tolerance=1e-5, dtype=dtype, **times)


@sw.system(order=1)
def decay(t: Any, y: Any, *, k: Any = 30.0) -> Any:
    return np.array([-k * y[0], k * y[0] - y[1] * y[2], y[1] * y[2]])


def test_tolerances_of_components_and_numbers_that_stay_positive() -> None:
    ask: dict[str, Any] = {"y": np.abs(start(3)), "at": [0.1, 2.0]}
    same(decay(), "merson", **ask, tolerance=1e-3, positive=True)
    same(decay(), "merson", **ask, tolerance=(np.array([1e-4, 1e-6, 1e-5]), np.array([1e-9, 1e-8, 0.0])))


@pytest.mark.parametrize("method", ["merson", "taylor"])
def test_what_goes_on(method: str) -> None:
    """A run in pieces, by the device and the core in turn, is the run of the core."""
    ask, times = of_series(method, pendulums()), np.array([0.1, 0.3, 0.3 + 1e-9, 2.0, 5.0])
    whole = sw.integrate(driven(k=K), method, **ask | {"at": times})
    for cut in (1, 2, 4):
        first = sw.integrate(driven(k=K), method, **ask | {"at": times[:cut]}, device="opencl")
        rest = same(driven(k=K), method, at=times[cut:], resume=first)
        assert np.array_equal(np.concatenate([first.y, rest.y]), whole.y)
        assert np.array_equal(rest.paces.accepted, whole.paces.accepted)  # type: ignore[union-attr]


def test_events_are_those_of_the_core() -> None:
    """They are looked for by the core, and members that stop do so at the same time."""
    event = sw.Event(lambda t, v, y: y - 0.2, name="there", terminal=True)
    run = same(driven(k=K), "merson", **pendulums(events=[event], at=[1.0, 3.0]))
    assert set(run.status.tolist()) == {Status.OK, Status.EVENT}


@pytest.mark.parametrize("method", ["merson", "taylor"])
def test_bits_do_not_depend_on_launches_and_shares(monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    """A launch for each attempt, and some members at a time: held steps and kept states go from launch to launch."""
    ask = of_series(method, pendulums(at=np.linspace(0.0, 2.0, 30)))
    monkeypatch.setattr(on_device, "FIRST_LAUNCH", 1)
    monkeypatch.setattr(on_device, "MOST_ATTEMPTS", 1)
    monkeypatch.setattr(on_device, "MOST_SAVED", 1 << 14)
    same(driven(k=K), method, **ask)
    same(driven(k=K), method, **ask | {"every": 2, "at": [2.0], "jumps": [0.3]})


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
    same(driven(k=K), method, **of_series(method, ask))
    core, device = (np.moveaxis(each, 1, 0) for each in seen)
    counts = core[2 * 2 + engine.COUNTS.start]
    assert np.array_equal(device[2 * 2 + engine.COUNTS.start], counts)
    assert np.array_equal(device[:, counts > 0.0], core[:, counts > 0.0])
    assert (counts > 0.0).any()


def test_one_member_and_two_axes() -> None:
    same(driven(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0])
    same(driven(), "merson", v=start()[:6].reshape(2, 3), y=np.ones((2, 3)), tolerance=1e-6, at=[1.0, 2.0])


def test_progress_comes_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    shares: list[float] = []

    @contextmanager
    def bar(_: str) -> Iterator[Any]:
        yield shares.append

    monkeypatch.setattr(progress, "bar", bar)
    sw.integrate(driven(k=K), "merson", device="opencl", progress=True, **pendulums())
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
