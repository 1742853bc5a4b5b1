"""The devices of OpenCL on which tests run; in CI this is the CPU, by PoCL."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.device import devices

from support import recorded

#: Those that have the bits of the core in float64.
NAMES = [each.name for each in devices() if each.name != "cpu" and not each.float64]

needs_device = pytest.mark.skipif(not NAMES, reason="there is no device of OpenCL here")


def assert_alike(one: Any, other: Any) -> None:
    """Two sweeps have the same results, down to the sign of a zero."""
    assert list(one.data_vars) == list(other.data_vars)
    assert one.attrs["bits"] == other.attrs["bits"]
    for name in one.data_vars:
        a, b = one[name].values, other[name].values
        assert a.dtype == b.dtype, name
        if a.dtype.kind == "f":
            a, b = (np.where(np.isnan(each), np.nan, each).view(f"u{each.itemsize}") for each in (a, b))
        assert np.array_equal(a, b), (
            name,
            np.argwhere(a != b)[:5].tolist(),
            one[name].values[a != b][:5],
            other[name].values[a != b][:5],
        )


def assert_same(got: Any, core: Any, *names: str) -> None:
    """These arrays of two runs are the same to the last bit, but for the bits of a NaN."""
    for name in names:
        one, other = getattr(got, name), getattr(core, name)
        assert (one is None) == (other is None), name
        if one is None:
            continue
        one, other = np.asarray(one), np.asarray(other)
        assert one.dtype == other.dtype
        is_float = one.dtype.kind == "f"
        assert np.array_equal(one, other, equal_nan=is_float), name
        if is_float:
            assert np.array_equal(np.signbit(one) | np.isnan(one), np.signbit(other) | np.isnan(other)), name


def same(system: Any, method: str, **options: Any) -> Any:
    """The run on the device, held against that of the core."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        core = sw.integrate(system, method, device="cpu", **options)
        got = sw.integrate(system, method, device="opencl", **options)
    assert_same(got, core, "t", "v", "y", "status", "first_bad_step", "work", "carry")
    assert got.recorded.keys() == core.recorded.keys()
    pairs = [(got.recorded[name], numbers) for name, numbers in core.recorded.items()]
    pairs += zip(got.paces or (), core.paces or (), strict=True)
    for name in ("v", "y", "paces"):
        pairs.append(tuple(getattr(run.controller_state, name, None) for run in (got, core)))
    for one, other in pairs:
        assert one is other is None or np.array_equal(one, other, equal_nan=True)
    return got


#: Members of a run; one number for all tests, so that a step is compiled once.
B = 300


def start(*shape: int, members: int = B) -> Any:
    return np.random.default_rng(sum(shape)).normal(size=(*shape, members))


@sw.system(order=1)
def lorenz(t: Any, y: Any, *, sigma: Any = 10.0, rho: Any = 28.0, beta: Any = 8 / 3) -> Any:
    return np.array([sigma * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - beta * y[2]])


@sw.system
def driven(t: Any, v: Any, y: Any, *, k: Any = 1.0, u: Any = 0.0) -> Any:
    return -k * np.sin(y) + 0.3 * np.cos(0.7 * t) + u


@sw.method
def velocity_verlet(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
    """A step that begins where the last ended."""
    half = v + 0.5 * s.dv(t, v, y)
    moved = y + s.dy(t, half, y)
    return half + 0.5 * s.dv(t + h, half, moved), moved


#: Of the recorded runs those whose kernels are compiled in a second; a few of them here, all by `make test-long`.
SHORT = [name for name in recorded.written() if not any(word in name for word in ("large", "bodies", "tolerance", "fused"))]


def of_recorded(name: str, monkeypatch: Any) -> None:
    monkeypatch.setenv("STEPWELL_DEVICE", "opencl")
    assert recorded.hashes(recorded.made(recorded.runs()[name])) == recorded.written()[name], name
