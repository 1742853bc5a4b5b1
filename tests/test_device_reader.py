"""Steps that are too long to print are read by a kernel, operation by operation, with the bits of the core."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.device import adaptive, fixed, stages
from stepwell.device.reader import READ
from support.devices import needs_device
from test_device_adaptive import same as same_adaptive
from test_device_fixed import SHORT, driven, lorenz, of_recorded, same, start

pytestmark = needs_device


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> None:
    """However short a step is, it is read."""
    monkeypatch.setattr(stages, "MOST_OPERATIONS", 0)
    for module in (fixed, adaptive):
        monkeypatch.setattr(module, "_TEXTS", OrderedDict())


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("name", SHORT[4::27])
def test_recorded_runs(name: str, monkeypatch: Any) -> None:
    of_recorded(name, monkeypatch)


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("fused", [False, True])
def test_precisions(dtype: str, fused: bool) -> None:
    for method in ("standard_euler", "rk4", "dop853", "rodas4"):
        same(lorenz(), method, y=start(3), dt=0.01, steps=9, every=4, dtype=dtype, fused=fused)


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("method", ["fehlberg", "dop853", "taylor", "rosenbrock23"])
def test_adaptive_steps(method: str) -> None:
    same_adaptive(lorenz(), method, y=start(3), tolerance=1e-6, at=[0.5, 1.0])


@sw.system
def stirred(t: Any, v: Any, y: Any, *, u: Any = 0.0) -> Any:
    """All kinds of operations."""
    turn = np.sin(y) + np.log(1.0 + y * y) * np.exp(-np.abs(v))
    return np.where(y > 0.2, turn, np.floor(3.0 * y)) - np.sqrt(y * y + 1.0) + u


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_own_equations_with_samples(dtype: str) -> None:
    u = sw.Sampled(np.random.default_rng(1).normal(size=(40, 7)), 0.05)
    for method in ("false_euler", "rk4"):
        same(stirred(u=u), method, v=0.1, y=np.linspace(-2.0, 2.0, 7), dt=0.05, steps=20, every=6, dtype=dtype)


@pytest.mark.usefixtures("reads")
def test_numbers_that_are_not_finite_or_subnormal() -> None:
    y = np.array([np.pi, 1e200, 1e308, 5e-324, -0.0, 1e-310])
    same(stirred(), "rk4", v=0.0, y=y, dt=0.1, steps=12, every=5)


def test_every_operation_is_read() -> None:
    from stepwell import _core

    leaves = {"state", "parameter", "step", "time", "constant", "sample", "budget"}
    names = {name for name, *_ in _core.tape_operations()} - leaves
    assert names - set(READ) <= {"gather", "of the step", "held", "row", "uniform"}, names - set(READ)


def test_bodies_with_what_needs_the_whole_step() -> None:
    """Fused operations, surfaces, and adaptive steps, of more operations than a compiler is given."""
    n = 22
    v, y = np.random.default_rng(1).normal(size=(2, n, 2, 2))
    system = sw.NBody(np.ones(n) / n, softening=0.1)
    same(system, "dop853", v=v, y=y, dt=0.01, steps=3, every=2, fused=True)
    floor = sw.Floor(normal=[0.0, 1.0], offset=-0.5)
    same(sw.NBody(np.ones(n) / n, softening=0.1, floor=floor), "dop853", v=v, y=y, dt=0.01, steps=3)
    same_adaptive(system, "dop853", v=v, y=y, tolerance=1e-6, at=[0.1])


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


def test_a_kernel_of_too_many_statements_is_refused() -> None:
    system = sw.LinearSystem(np.random.default_rng(1).normal(size=(105, 105)))
    with pytest.raises(sw.errors.UnsupportedError, match="statements is too long for a compiler, which gets at most 12000"):
        sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=1, device="opencl")


@pytest.mark.usefixtures("reads")
@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_samples_at_times_of_each_member(interpolation: Any) -> None:
    """The place of a sample is computed by lines that were read before."""
    u = sw.Sampled(np.random.default_rng(1).normal(size=(40, 7)), 0.05, interpolation=interpolation)
    y = np.linspace(-2.0, 2.0, 7)
    same_adaptive(driven(u=u), "fehlberg", v=0.1, y=y, tolerance=10.0 ** -np.linspace(2.0, 7.0, 7), at=[0.3, 1.1])
