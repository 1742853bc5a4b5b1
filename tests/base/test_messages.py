"""What comes in a message from another process: arrays that are read-only and begin at any place in memory.

Dask sends the memory of arrays beside the pickle (protocol 5) and joins messages, so an array may begin at an odd byte.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base.immutable import same
from support.cases import SYSTEMS
from support.for_each import for_each
from support.own_systems import duffing


def received(what: Any, *, first: int = 1, writeable: bool = False) -> Any:
    """As it comes out of such a message."""
    buffers: list[pickle.PickleBuffer] = []
    data = pickle.dumps(what, protocol=5, buffer_callback=buffers.append)
    parts = []
    for each in buffers:
        message = bytes(first) + each.raw().tobytes()
        parts.append(memoryview(bytearray(message) if writeable else message)[first:])
    return pickle.loads(data, buffers=parts)


def test_such_an_array_is_what_it_says() -> None:
    there = received(np.arange(5.0))
    assert not there.flags.aligned
    assert not there.flags.writeable
    np.testing.assert_array_equal(there, np.arange(5.0))


@for_each("writeable", [False, True])
@for_each("name", SYSTEMS)
def test_systems(name: str, writeable: bool) -> None:
    make: Callable[..., sw.System] = partial(SYSTEMS[name], np.random.default_rng(1), 3)
    system = make()
    there = received(system, writeable=writeable)
    assert there == system
    assert same(there, system)
    rng = np.random.default_rng(2)
    v, y = (rng.uniform(0.5, 1.0, (*shape, 3)) for shape in (system.v_shape, system.y_shape))
    with np.errstate(all="ignore"):
        runs = [
            sw.integrate(each, "false_euler", v=received(v), y=received(y), dt=1e-3, steps=3, every=1) for each in (there, system)
        ]
    np.testing.assert_array_equal(runs[0].y, runs[1].y)
    np.testing.assert_array_equal(runs[0].v, runs[1].v)


@for_each("method", ["rk4", "verlet", "leapfrog"])
def test_worlds(method: str) -> None:
    y = np.linspace(0.5, 1.0, 7)
    world = sw.World(sw.Pendulum(np.linspace(1.0, 2.0, 7)), method, v=np.zeros(7), y=y, dt=0.1)
    world.step(3)
    there = received(world)
    for each in (world, there):
        each.step(10)
    np.testing.assert_array_equal(there.y, world.y)
    np.testing.assert_array_equal(there.v, world.v)


def test_runs_and_what_goes_on_from_them() -> None:
    gamma = np.linspace(0.1, 0.5, 5)
    run = sw.integrate(duffing(gamma=gamma), "rk4", v=0.0, y=1.0, dt=0.1, steps=20, every=3)
    there = received(run)
    assert there == run
    rest, same_rest = (sw.integrate(duffing(gamma=gamma), "rk4", steps=5, resume=received(each)) for each in (run, there))
    np.testing.assert_array_equal(rest.y, same_rest.y)
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(sw.Oscillator([1.0, 30.0]), "leapfrog", v=0.0, y=1.0, dt=0.1, steps=1000)
    rest = sw.integrate(sw.Oscillator([1.0, 30.0]), "leapfrog", steps=10, resume=received(run))
    np.testing.assert_array_equal(rest.first_bad_step, run.first_bad_step)
