"""Runs that keep every step: the states are those of step after step, and what they cost does not grow with their number."""

import gc
import time
import weakref
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.base import buffer_pool
from support.cases import number

#: More steps than are made at once (64), by one run and after it, and some beside.
STEPS = 200


@pytest.fixture(autouse=True)
def _nothing_kept() -> Iterator[None]:
    buffer_pool._free.clear()
    yield
    buffer_pool._free.clear()


def systems() -> dict[str, tuple[sw.System, tuple[int, ...]]]:
    """Systems, with the shape of a batch: one member, some that fill no vector, more than one tile."""
    omega = np.linspace(0.5, 1.5, 300)
    return {
        "one": (sw.Oscillator(1.1), ()),
        "three": (sw.Oscillator(omega[:3]), (3,)),
        "300": (sw.Oscillator(omega), (300,)),
        # The time is a number of each step, and the force of the state after one belongs to the next.
        "driven": (sw.Oscillator(1.1, x=sw.Sinusoid(0.3, 0.7, 0.1)), ()),
        "driven, 300": (sw.Oscillator(omega, a=sw.Sinusoid(0.3, np.linspace(0.1, 0.9, 300)), form="physical"), (300,)),
        "samples": (sw.Oscillator(omega[:5], a=sw.Sampled(np.sin(np.arange(90.0)), 0.3)), (5,)),
        "samples of each": (sw.Oscillator(omega[:5], x=sw.Sampled(np.sin(np.arange(450.0)).reshape(90, 5), 0.3)), (5,)),
        "pendulum": (sw.Pendulum(), (20,)),
        "bodies": (sw.NBody([1.0, 0.5, 0.25]), (9,)),
    }


def begin(system: sw.System, batch: tuple[int, ...]) -> dict[str, Any]:
    random = np.random.default_rng(5)
    return {name: random.normal(size=(*shape, *batch)) for name, shape in (("v", system.v_shape), ("y", system.y_shape))}


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")  # bodies that do not follow their orbits have states, too
@pytest.mark.parametrize("which", list(systems()))
def test_every_state_is_that_of_a_run_that_ends_there(which: str) -> None:
    """The same steps without saving: there the velocity of the last state alone is made, by itself.

    Of long runs the steps that are made at once are machine code, which is written after some hundred calls.
    """
    system, batch = systems()[which]
    # Steps are numbered from 7: the first of those that are made at once is not the first of the run.
    options: dict[str, Any] = {"dt": 0.02, "start_step": 7, "t0": 0.3} | begin(system, batch)
    for method in sw.methods():
        if method.needs_acceleration and system.velocity_term is not None:
            continue
        fused = {"fused": number(which, method.name) % 2 == 1}
        run = sw.integrate(system, method, steps=STEPS, every=1, **options, **fused)
        for k in (1, 2, 57, 58, 63, 64, 65, 121, 122, 185, 186, 199, 200):
            assert_same_state(run, k, sw.integrate(system, method, steps=k, **options, **fused))
        if method.name in ("false_euler", "verlet", "leapfrog", "standard_heun"):
            steps = 64 * 60 if batch else 64 * 400
            for _ in range(4 if batch else 1):
                run = sw.integrate(system, method, steps=steps, every=1, **options)
            for k in (1, steps // 2, steps - 1, steps):
                assert_same_state(run, k, sw.integrate(system, method, steps=k, **options))


def assert_same_state(run: sw.Run, k: int, alone: sw.Run) -> None:
    """That of a run at step k is the last of the other."""
    for name in ("t", "v", "y"):
        assert getattr(run, name)[k].tobytes() == getattr(alone, name)[-1].tobytes(), (run, name, k)


def test_the_times_are_those_of_the_clock() -> None:
    """t0 + k·dt, in two roundings, as Python computes it."""
    for every in (1, 7, 64, 5000):
        run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, t0=0.7, start_step=3, steps=1000, every=every)
        assert run.t.tolist() == [0.7 + (3 + k) * 0.1 for k in [*range(0, 1000, every), 1000]], every


def many(**options: Any) -> sw.Run:
    steps = buffer_pool.LEAST_POOLED // 8
    return sw.integrate(sw.Oscillator(), "false_euler", v=0.0, y=1.0, steps=steps, every=1, **({"dt": 0.01} | options))


def place(array: Any) -> int:
    return int(array.__array_interface__["data"][0])


def test_memory_of_results_is_lent_again_when_nobody_uses_it() -> None:
    run = many()
    places = {place(run.t), place(run.v), place(run.y)}
    assert len(places) == 3
    del run
    gc.collect()
    again = many()
    assert {place(again.t), place(again.v), place(again.y)} == places


def test_memory_that_somebody_uses_is_not_lent() -> None:
    """A view, a view of a view and an export of its memory keep what they show."""
    views: list[tuple[Any, Any]] = []
    for keep in (lambda y: y, lambda y: y[5:][::2], lambda y: memoryview(y), lambda y: y.reshape(1, -1).T):
        run = many(dt=0.01 * (1 + len(views)))
        views.append((keep(run.y), np.array(keep(run.y))))
        del run
    gc.collect()
    for _ in range(3):
        many(dt=0.3)
    for view, copy in views:
        np.testing.assert_array_equal(np.asarray(view), copy)


def test_threads_are_lent_memory_of_their_own() -> None:
    """Four threads take and give back memory at once; each finds its own states in what it was lent."""
    expected = {dt: many(dt=dt).y.copy() for dt in (0.01, 0.02, 0.03, 0.04)}

    def right(dt: float) -> bool:
        runs = [many(dt=dt) for _ in range(3)]
        return all(np.array_equal(run.y, expected[dt]) for run in runs)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(right, [*expected] * 8))


def test_no_more_memory_is_kept_than_promised() -> None:
    runs = [many() for _ in range(buffer_pool.MOST_FREE // (2 * buffer_pool.LEAST_POOLED))]
    assert sum(run.y.nbytes for run in runs) > buffer_pool.MOST_FREE / 3
    del runs
    gc.collect()
    assert 0 < sum(each.nbytes for each in buffer_pool._free.values()) <= buffer_pool.MOST_FREE
    # Memory that is larger than that is given back to the system.
    gone = buffer_pool.empty((buffer_pool.MOST_FREE // 8 + 1,))
    before = list(buffer_pool._free)
    ends = weakref.ref(gone)
    del gone
    assert ends() is None
    assert list(buffer_pool._free) == before


def test_memory_is_not_lent_for_much_less() -> None:
    """What a run takes is counted before; so it is not to hold much more than that."""
    size = 4 * buffer_pool.LEAST_POOLED // 8
    first = buffer_pool.empty((size,))
    at = place(first)
    del first
    assert place(buffer_pool.empty((size // 2,))) != at
    assert place(buffer_pool.empty((size - size // 10,))) == at


@pytest.mark.skipif(_core.isa() == "interpret", reason="times are those of machine code")
@pytest.mark.parametrize("name", ["false_euler", "verlet", "leapfrog"])
def test_keeping_every_step_costs_a_small_multiple_of_the_steps(name: str) -> None:
    """Measured: 1.5 to 2.4 times. Where a velocity takes a call of its own it was 29 to 33 times; the bound is far from both."""
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.01, "steps": 200_000, "threads": 1}
    least = {}
    for _ in range(7):
        for every in (None, 1):
            began = time.thread_time_ns()
            sw.integrate(sw.Oscillator(), name, **options, every=every)
            took = time.thread_time_ns() - began
            least[every] = min(took, least.get(every, took))
    assert least[1] < 10 * least[None]
