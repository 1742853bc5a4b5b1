"""The real-time loop: in place, allocating nothing, the same to the bit as a run."""

from __future__ import annotations

import copy
import itertools
import pickle
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import FixedError
from support.cases import SYSTEMS

#: A method of each kind of step, and of what it carries.
KINDS = ("false_euler", "rk4", "verlet", "leapfrog", "pefrl", "dop853", "taylor", "rodas4", "trapezoidal")


@pytest.mark.parametrize("method", KINDS)
def test_a_kick_is_seen(method: str) -> None:
    """What the user writes between steps counts, also for a method that keeps something else than v inside."""
    v, y = np.array([0.1]), np.array([1.0])
    w = sw.World(sw.Oscillator(1.3), method, v=v, y=y, dt=0.1, t0=0.4)
    w.step(7)
    assert (w.step_number, w.t) == (7, 0.4 + 7 * 0.1)
    v[0] += 0.5
    y[0] -= 0.1
    expected = sw.integrate(sw.Oscillator(1.3), method, v=v[0], y=y[0], dt=0.1, t0=0.4, steps=5, start_step=7)
    again = copy.copy(w)
    for each in (w, again):
        each.step(5)
        each.step(0)
        assert (each.v[0], each.y[0]) == (expected.v[-1], expected.y[-1])


@pytest.mark.parametrize("kind", ["free", "three bodies", "chain of nineteen", "sampled x, sinusoid a"])
@pytest.mark.parametrize("method", ["verlet", "rk4"])
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


def test_any_shape_of_batch() -> None:
    """From a lone number to more than are copied."""
    for shape in ((), (1,), (2, 3), (30, 20)):
        v, y = np.zeros(shape), np.ones(shape)
        w = sw.World(sw.Oscillator(1.3), "verlet", v=v, y=y, dt=0.1)
        w.step(3)
        expected = sw.integrate(sw.Oscillator(1.3), "verlet", v=0.0, y=np.ones(shape), dt=0.1, steps=3)
        np.testing.assert_array_equal((v, y), (expected.v[-1], expected.y[-1]))


def test_nothing_is_assigned() -> None:
    w = sw.World(sw.Oscillator(1.0), "verlet", v=np.zeros(3), y=np.ones(3), dt=0.1)
    for name in ("dt", "t", "method", "system", "v", "y", "step", "step_number", "anything"):
        match = rf"^{name}: a world's {name} cannot be assigned; .* World\(system, method, resume=world\), "
        with pytest.raises(FixedError, match=match):
            setattr(w, name, 0.2)
    assert (w.dt, w.t, w.method.name) == (0.1, 0.0, "verlet")


COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda w: pickle.loads(pickle.dumps(w)),
    "resume": lambda w: sw.World(w.system, w.method, resume=w),
}


@pytest.mark.parametrize("method", KINDS)
def test_a_copy_goes_on_by_itself(method: str) -> None:
    """To the bit, also of what is carried; and neither sees what becomes of the other."""
    for members, steps, copying in itertools.product((3, 500), (0, 7), COPIES):
        case, y = (members, steps, copying), np.linspace(0.5, 1.5, members)
        w = sw.World(sw.Pendulum(), method, v=np.full(members, 0.1), y=y, dt=0.1, t0=0.3, start_step=4)
        w.step(steps)
        again = COPIES[copying](w)
        before = w.v.copy(), w.y.copy()
        again.step(20)
        np.testing.assert_array_equal((w.v, w.y), before, err_msg=str(case))
        assert (w.step_number, again.step_number) == (4 + steps, 24 + steps), case
        w.step(20)
        np.testing.assert_array_equal((again.v, again.y), (w.v, w.y), err_msg=str(case))
        assert again.t == w.t, case
        again.v[0] += 1.0
        assert w.v[0] != again.v[0], case


@pytest.mark.parametrize("method", ["verlet", "leapfrog", "rk4"])
def test_a_world_goes_on_from_a_run_and_a_run_from_a_world(method: str) -> None:
    system, options = sw.Oscillator(np.array([1.0, 1.3])), {"dt": 0.1}
    whole = sw.integrate(system, method, v=0.2, y=1.0, steps=60, **options)
    half = sw.integrate(system, method, v=0.2, y=1.0, steps=25, **options)
    w = sw.World(system, method, **options, resume=half)
    w.step(15)
    rest = sw.integrate(system, method, steps=20, **options, resume=w)
    np.testing.assert_array_equal((rest.v, rest.y), (whole.v, whole.y))


def test_a_controlled_world_keeps_its_energy_when_it_goes_on() -> None:
    """Its target is that of the start, not of where it was copied."""
    rng = np.random.default_rng(2)
    v, y = rng.normal(size=(2, 3, 2))
    for control in (sw.EnergyControl(0.3), sw.Projection()):
        w = sw.World(sw.NBody(), "false_euler", v=v.copy(), y=y.copy(), dt=0.01, control=control)
        w.step(9)
        again = pickle.loads(pickle.dumps(w))
        w.step(30)
        again.step(30)
        np.testing.assert_array_equal((again.v, again.y), (w.v, w.y))


def test_a_parameter_that_is_changed_later_changes_nothing() -> None:
    """The world has taken its numbers, and what it shows of them cannot be written to."""
    omega, samples = np.ones(3), np.zeros(5)
    w = sw.World(sw.Oscillator(omega, a=sw.Sampled(samples, 0.1)), "rk4", v=np.zeros(3), y=np.ones(3), dt=0.1, control=None)
    again = copy.copy(w)
    omega[:], samples[:] = 2.0, 9.0
    assert (w.system.omega == 1.0).all()  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="read-only"):
        w.system.omega[0] = 2.0  # type: ignore[attr-defined]
    w.step(5)
    again.step(5)
    np.testing.assert_array_equal(w.y, again.y)
    np.testing.assert_array_equal(copy.copy(w).system.omega, 1.0)  # type: ignore[attr-defined]


def test_how_many_steps() -> None:
    most = "n: expected 0 or more, up to 9007199254740990, got"
    wrong: list[tuple[Any, Any, str]] = [
        (1.5, sw.errors.DTypeError, "n: expected a whole number, got 1.5 (float)"),
        ("3", sw.errors.DTypeError, "n: expected a whole number, got '3' (str)"),
        (True, sw.errors.DTypeError, "n: expected a whole number, got True (bool)"),
        (2**63, sw.errors.ArgumentError, f"{most} 9223372036854775808"),
        (2**70, sw.errors.ArgumentError, f"{most} 1180591620717411303424"),
        (2**53, sw.errors.ArgumentError, f"{most} 9007199254740992"),
        (-1, sw.errors.ArgumentError, "n: expected 0 or more, got -1"),
    ]
    w = sw.World(sw.Oscillator(1.0), "rk4", v=np.zeros(3), y=np.ones(3), dt=0.1, start_step=2)
    for n, error, message in wrong:
        with pytest.raises(error) as caught:
            w.step(n)
        assert str(caught.value) == message
    assert w.step_number == 2
    np.testing.assert_array_equal(w.y, 1.0)
    for n, step_number in ((None, 3), (np.int64(3), 6), (np.array(3), 9)):
        w.step(n)  # type: ignore[arg-type]
        assert w.step_number == step_number


def test_steps_are_counted_up_to_what_is_exact() -> None:
    w = sw.World(sw.Oscillator(1.0), "rk4", v=np.zeros(3), y=np.ones(3), dt=1e-9, start_step=2**53 - 2)
    w.step(2)
    with pytest.raises(sw.errors.ArgumentError, match="n: expected 0 or more, up to 0, got 1"):
        w.step()
    assert w.step_number == 2**53


def test_the_time_can_be_asked_for_while_it_is_stepped() -> None:
    """And who wants to step it meanwhile hears why not."""
    w = sw.World(sw.Pendulum(), "rk4", v=np.zeros(1000), y=np.ones(1000), dt=1e-3)
    thread = threading.Thread(target=w.step, args=(100_000,))
    thread.start()
    seen, busy = [], 0
    while thread.is_alive():
        seen.append((w.step_number, w.t))
        try:
            w.step(0)
        except sw.errors.BusyError as error:
            busy += "another thread" in str(error)
        time.sleep(1e-4)
    thread.join()
    assert busy
    assert seen == sorted(seen)
    assert len({k for k, _ in seen}) > 2
    assert all(t == k * 1e-3 for k, t in seen)
    assert w.step_number == 100_000
