"""Steps that are too long to print are read by a kernel, operation by operation, with the bits of the core."""

from __future__ import annotations

import itertools
from collections import OrderedDict
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.device import adaptive, fixed, stages
from stepwell.device.reader import READ
from support.devices import SHORT, driven, lorenz, needs_device, of_recorded, same, start
from support.families import family
from support.graphs import model

pytestmark = needs_device


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> None:
    """However short a step is, it is read."""
    monkeypatch.setattr(stages, "MOST_OPERATIONS", 0)
    for module in (fixed, adaptive):
        monkeypatch.setattr(module, "_TEXTS", OrderedDict())


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("name", family(SHORT[4::27], lambda name: SHORT.index(name) % 108 == 4))
def test_recorded_runs(name: str, monkeypatch: Any) -> None:
    of_recorded(name, monkeypatch)


#: By one method all kinds of numbers, and a method that solves equations.
PRECISIONS = itertools.product(("standard_euler", "rk4", "dop853", "rodas4"), ("float64", "float32"), (False, True))


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize(
    ("method", "dtype", "fused"),
    family(PRECISIONS, lambda method, dtype, fused: method == "rk4" or (method, dtype, fused) == ("rodas4", "float64", False)),
)
def test_precisions(method: str, dtype: str, fused: bool) -> None:
    same(lorenz(), method, y=start(3), dt=0.01, steps=9, every=4, dtype=dtype, fused=fused)


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize(
    "method", family(["fehlberg", "dop853", "taylor", "rosenbrock23"], lambda method: method in ("fehlberg", "taylor"))
)
def test_adaptive_steps(method: str) -> None:
    same(lorenz(), method, y=start(3), tolerance=1e-6, at=[0.5, 1.0])


@sw.system
def stirred(t: Any, v: Any, y: Any, *, u: Any = 0.0) -> Any:
    """All kinds of operations."""
    turn = np.sin(y) + np.log(1.0 + y * y) * np.exp(-np.abs(v))
    return np.where(y > 0.2, turn, np.floor(3.0 * y)) - np.sqrt(y * y + 1.0) + u


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize(
    ("method", "dtype"),
    family(itertools.product(("false_euler", "rk4"), ("float64", "float32")), lambda method, _: method == "false_euler"),
)
def test_own_equations_with_samples(method: str, dtype: str) -> None:
    """Of both kinds of numbers, whose functions have other operations."""
    u = sw.Sampled(np.random.default_rng(1).normal(size=(40, 7)), 0.05)
    same(stirred(u=u), method, v=0.1, y=np.linspace(-2.0, 2.0, 7), dt=0.05, steps=20, every=6, dtype=dtype)


@pytest.mark.usefixtures("reads")
def test_numbers_that_are_not_finite_or_subnormal() -> None:
    y = np.array([np.pi, 1e200, 1e308, 5e-324, -0.0, 1e-310])
    same(stirred(), "rk4", v=0.0, y=y, dt=0.1, steps=12, every=5)


def test_every_operation_is_read() -> None:
    leaves = {"state", "parameter", "step", "time", "constant", "sample", "budget"}
    names = {name for name, *_ in _core.tape_operations()} - leaves
    assert names - set(READ) <= {"gather", "of the step", "held", "row", "uniform"}, names - set(READ)


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


@pytest.mark.usefixtures("reads")
def test_bodies_with_what_needs_the_whole_step() -> None:
    """Surfaces, and adaptive steps."""
    bodies, start = of_bodies(4)
    same(bodies(floor=FLOOR), "rk4", dt=0.01, steps=3, **start)
    same(bodies(), "fehlberg", tolerance=1e-6, at=[0.1], **start)


@pytest.mark.long
def test_many_bodies_with_what_needs_the_whole_step() -> None:
    bodies, start = of_bodies(22)
    same(bodies(floor=FLOOR), "dop853", dt=0.01, steps=3, **start)
    same(bodies(), "dop853", tolerance=1e-6, at=[0.1], **start)


@pytest.mark.usefixtures("reads")
def test_a_world() -> None:
    v, y = np.zeros(3), np.array([0.1, 0.2, 0.4])
    world = sw.World(sw.Pendulum(np.ones(3)), "rk4", v=v, y=y, dt=0.1, device="opencl")
    world.step(3)
    world.set(omega=np.array([1.0, 2.0, 3.0]))
    world.step(4)
    other = sw.World(sw.Pendulum(np.ones(3)), "rk4", v=np.zeros(3), y=np.array([0.1, 0.2, 0.4]), dt=0.1)
    other.step(3)
    other.set(omega=np.array([1.0, 2.0, 3.0]))
    other.step(4)
    np.testing.assert_array_equal(world.y, other.y)


@pytest.mark.usefixtures("reads")
def test_a_kernel_of_some_statements_too_many_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "MOST_STATEMENTS", 5)
    with pytest.raises(sw.errors.UnsupportedError, match="statements is too long for a compiler, which gets at most 5;"):
        sw.integrate(lorenz(), "rk4", y=start(3), dt=0.1, steps=1, device="opencl")


@pytest.mark.long
def test_a_kernel_of_too_many_statements_is_refused() -> None:
    system = sw.LinearSystem(np.random.default_rng(1).normal(size=(105, 105)))
    with pytest.raises(sw.errors.UnsupportedError, match="statements is too long for a compiler, which gets at most 12000"):
        sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=1, device="opencl")


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("interpolation", family(["hold", "linear"], lambda interpolation: interpolation == "linear"))
def test_samples_at_times_of_each_member(interpolation: Any) -> None:
    """The place of a sample is computed by lines that were read before."""
    u = sw.Sampled(np.random.default_rng(1).normal(size=(40, 7)), 0.05, interpolation=interpolation)
    y = np.linspace(-2.0, 2.0, 7)
    same(driven(u=u), "fehlberg", v=0.1, y=y, tolerance=10.0 ** -np.linspace(2.0, 7.0, 7), at=[0.3, 1.1])
