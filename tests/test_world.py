"""The real-time loop: in place, allocating nothing, the same to the bit as a run."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import stepwell as sw
from cases import SYSTEMS, cases

DIRECT = [c for c in cases() if c.form == "direct"]


@pytest.mark.parametrize("case", DIRECT, ids=str)
def test_equals_a_run(case: object) -> None:
    for b in (1, 5, 97):
        system, arguments = case.make(b)  # type: ignore[attr-defined]
        whole = sw.integrate(system, **(arguments | {"steps": 20, "every": 1, "t0": 0.4}))
        v, y = arguments["v"].copy(), arguments["y"].copy()
        w = sw.World(system, arguments["method"], v=v, y=y, dt=0.1, t0=0.4, start=arguments["start"])
        for k, n in ((4, 4), (5, 1), (5, 0), (20, 15)):
            w.step(n)
            assert w.step_number == k
            assert w.t == whole.t[k]
            np.testing.assert_array_equal(y, whole.y[k])
            np.testing.assert_array_equal(v, whole.v[k])


@pytest.mark.parametrize("method", [m.name for m in sw.methods()])
def test_a_kick_is_seen(method: str) -> None:
    """What the user writes between steps counts, also for a method that keeps something else than v inside."""
    v, y = np.array([0.1]), np.array([1.0])
    w = sw.World(sw.Oscillator(1.3), method, v=v, y=y, dt=0.1)
    w.step(7)
    v[0] += 0.5
    y[0] -= 0.1
    expected = sw.integrate(sw.Oscillator(1.3), method, v=v[0], y=y[0], dt=0.1, steps=5, start_step=7)
    w.step(5)
    assert (v[0], y[0]) == (expected.v[-1], expected.y[-1])


@pytest.mark.parametrize("kind", ["free", "three bodies", "chain of nineteen", "sampled x, sinusoid a"])
@pytest.mark.parametrize("method", ["false_euler", "verlet", "rk4"])
def test_allocates_nothing(kind: str, method: str) -> None:
    rng = np.random.default_rng(0)
    system = SYSTEMS[kind](rng, 5)
    v, y = (rng.normal(size=(*s, 5)) for s in (system.v_shape, system.y_shape))
    w = sw.World(system, method, v=v, y=y, dt=1e-3)
    step = w.step
    step(3)
    before = sys.getallocatedblocks()
    for _ in range(1000):
        step(2)
    # Python's own counters may move by a few blocks; one block a step would be a thousand.
    assert sys.getallocatedblocks() - before < 20


def test_members_are_independent() -> None:
    omega = np.linspace(1.0, 2.5, 50)
    v, y = np.zeros(50), np.ones(50)
    w = sw.World(sw.Oscillator(omega), "false_euler", v=v, y=y, dt=1.0)
    w.step(5000)
    np.testing.assert_array_equal(np.isfinite(y), omega < 2)


def test_arrays_outlive_their_names() -> None:
    """The world holds its arrays: deleting every other reference is harmless."""
    w = sw.World(sw.Oscillator(1.0), "false_euler", v=np.zeros(3), y=np.ones(3), dt=0.1)
    y = w.y
    w.step(10)
    assert y[0] != 1.0


def test_another_thread_may_step() -> None:
    from concurrent.futures import ThreadPoolExecutor

    v, y = np.zeros(3), np.ones(3)
    w = sw.World(sw.Oscillator(1.0), "false_euler", v=v, y=y, dt=0.1)
    with ThreadPoolExecutor(1) as pool:
        pool.submit(w.step, 10).result()
    assert w.step_number == 10


def test_the_arrays_cannot_be_swapped() -> None:
    w = sw.World(sw.Oscillator(1.0), "false_euler", v=np.zeros(3), y=np.ones(3), dt=0.1)
    with pytest.raises(AttributeError):
        w.v = np.zeros(3)  # type: ignore[misc]


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (30, 20)])
def test_any_shape_of_batch(shape: tuple[int, ...]) -> None:
    """From a lone number to more than are copied."""
    v, y = np.zeros(shape), np.ones(shape)
    w = sw.World(sw.Oscillator(1.3), "verlet", v=v, y=y, dt=0.1)
    w.step(3)
    expected = sw.integrate(sw.Oscillator(1.3), "verlet", v=0.0, y=np.ones(shape), dt=0.1, steps=3)
    np.testing.assert_array_equal(y, expected.y[-1])
    np.testing.assert_array_equal(v, expected.v[-1])
