"""Ctrl-C ends a run within a tenth of a second and leaves the process usable."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import pytest
import stepwell as sw
from support.devices import NAMES

#: Runs that would take minutes: many members, one member, one large member, threads, and a world. A step is never cut in two, so
#: the large member's must be well below the tenth of a second on any machine.
RUNS = {
    "a batch": "sw.integrate(sw.Oscillator(np.ones(10**5)), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**7, threads=1)",
    "threads": "sw.integrate(sw.Oscillator(np.ones(10**5)), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**7, threads=2)",
    "one member": "sw.integrate(sw.Oscillator(1.0), 'false_euler', v=0.0, y=1.0, dt=0.1, steps=10**11)",
    "one large member": "sw.integrate(sw.Chain(2 * 10**5), 'rk4', v=0.0, y=np.ones(2 * 10**5), dt=0.1, steps=10**6)",
    "many bodies": "sw.integrate(sw.NBody(np.ones(1500)), 'leapfrog', v=0.0, y=np.random.rand(1500, 2), dt=1e-6, steps=10**6)",
    "a matrix": "sw.integrate(sw.Oscillator(np.ones(10**4)), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**8, form='matrix')",
    "a world": "sw.World(sw.Oscillator(1.0), 'rk4', v=np.zeros(1), y=np.ones(1), dt=0.1).step(10**11)",
    "with a bar": "sw.integrate(sw.Oscillator(1.0), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**11, progress=True)",
    "a limit of many states": "sw.stability_limit(sw.LinearSystem(np.random.rand(90, 90) - 60 * np.eye(90)), 'false_euler')",
    "limits of many members": "sw.stability_limit(sw.Oscillator(np.ones(10**6), 0.1), 'rk4')",
    "events with a tolerance": "sw.integrate(sw.Pendulum(np.ones(10**4)), 'merson', v=0.0, y=1.0, tolerance=1e-11, at=[10.0**4], "
    "events=sw.Event(lambda t, v, y: y, most=9))",
    "many digits": "sw.stability_limit(sw.LinearSystem(np.eye(30, k=1) - np.eye(30) + np.diag([1e-9], -29)), 'false_heun')",
    "exponents": "sw.lyapunov(sw.Pendulum(np.ones(3000)), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**7, every=10**4)",
    "exponents with a tolerance": "sw.lyapunov(sw.Pendulum(np.ones(3000)), 'dop853', v=0.0, y=1.0, tolerance=1e-10, "
    "at=np.linspace(1.0, 1e5, 3000))",
    "limits at many states": "sw.stability_limit(sw.system(shape=(20,))(lambda t, v, y: np.roll(y, 1) - 3.0 * np.sin(y)), 'rk4', "
    "v=np.zeros((20, 10**5)), y=np.ones((20, 10**5)))",
    "matrices of many rows": "sw.stability_limit(sw.Chain(400), 'rk4')",
    "a jacobian of many operations": "sw.jacobian(sw.system(lambda t, v, y: sum(1.0 / (k + y * y) for k in range(1, 600)))(), "
    "v=0.0, y=np.ones(10**6))",
    "a device": "sw.integrate(sw.Oscillator(np.ones(10**5)), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**7, device='opencl')",
    "the reference": "sw.integrate(sw.Oscillator(1.0), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**9, backend='numpy')",
}


def aside(code: str, env: dict[str, str] | None = None) -> str:
    """The output of a process of its own. On Windows ``os.kill`` would end it whatever the signal is."""
    code = textwrap.dedent(code)
    if sys.platform == "win32":
        code = code.replace("os.kill(os.getpid(), signal.SIGINT)", "signal.raise_signal(signal.SIGINT)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100, env=env)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("what", RUNS)
def test_ctrl_c(what: str) -> None:
    if what == "a device" and not NAMES:
        pytest.skip("there is no device of OpenCL here")
    code = f"""
        import copy, os, signal, threading, time
        import numpy as np, stepwell as sw
        sent = []
        def interrupt():
            time.sleep(0.5)
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)
        # A warm-up, so that nothing is imported or compiled for the first time while the clock runs.
        sw.integrate(sw.Oscillator(1.0), 'rk4', v=0.0, y=1.0, dt=0.1, steps=1)
        waits = []
        for _ in range(3):
            threading.Thread(target=interrupt).start()
            try:
                {RUNS[what]}
            except KeyboardInterrupt:
                waits.append(time.perf_counter() - sent[-1])
            else:
                raise SystemExit("not interrupted")
        after = sw.integrate(sw.Oscillator(1.0), 'false_euler', v=0.0, y=1.0, dt=0.3, steps=7)
        print(min(waits), after.y[-1].hex())
    """
    # One thread for LAPACK: several wait for each other in a loop, for a minute where the cores are busy.
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    wait, after = aside(code, env).splitlines()[-1].split()
    # The best of three, so that a busy machine does not fail the test; a run that never looks would wait for minutes.
    assert float(wait) < 0.1
    here = sw.integrate(sw.Oscillator(1.0), "false_euler", v=0.0, y=1.0, dt=0.3, steps=7)
    assert float.fromhex(after) == here.y[-1]


#: Where a single step, or the forces of one, take long: worlds and runs. All of them begin with ``made``, outside the clock, and
#: none would end by itself before it is interrupted, however quick the machine.
WITHIN_A_STEP = {
    "dop853 of 2000 bodies, a world": (
        "w = world(2000, 'dop853')",
        "w.step(10**6)",
    ),
    "leapfrog of 20 000 bodies, a world": (
        "w = world(20_000, 'leapfrog')",
        "w.step(10**6)",
    ),
    "leapfrog of 20 000 bodies, a run": (
        "y = places(20_000)",
        "sw.integrate(sw.NBody(np.ones(len(y))), 'leapfrog', v=0.0, y=y, dt=1e-6, steps=10**6, threads=1)",
    ),
    "rk4 of 20 000 bodies, a run on two threads": (
        "y = places(20_000)",
        "sw.integrate(sw.NBody(np.ones(len(y))), 'rk4', v=0.0, y=y, dt=1e-6, steps=10**6, threads=2)",
    ),
    "dop853 of 20 000 bodies with a tolerance": (
        "y = places(20_000)",
        "sw.integrate(sw.NBody(np.ones(len(y))), 'dop853', v=0.0, y=y, at=[1.0], tolerance=1e-6)",
    ),
    "many members, a world": (
        "y = np.ones(10**6); w = sw.World(sw.Pendulum(), 'rk4', v=np.zeros(10**6), y=y, dt=0.1)",
        "w.step(10**6)",
    ),
}


@pytest.mark.parametrize("what", WITHIN_A_STEP)
def test_ctrl_c_within_a_step(what: str) -> None:
    """A tenth of a second too; and a world stays where its last whole step left it, as if nobody had asked for more."""
    setup, run = WITHIN_A_STEP[what]
    code = f"""
        import copy, os, signal, threading, time
        import numpy as np, stepwell as sw
        def places(n):
            return np.random.default_rng(1).random((n, 2))
        def world(n, method):
            y = places(n)
            return sw.World(sw.NBody(np.ones(n)), method, v=np.zeros_like(y), y=y, dt=1e-6)
        sent, w = [], None
        def interrupt():
            time.sleep(0.3)
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)
        {setup}
        start = None if w is None else copy.copy(w)
        waits = []
        for _ in range(3):
            threading.Thread(target=interrupt).start()
            try:
                {run}
            except KeyboardInterrupt:
                waits.append(time.perf_counter() - sent[-1])
            else:
                raise SystemExit("not interrupted")
        if w is not None:
            again = sw.World(w.system, w.method, resume=start)
            again.step(w.step_number)
            assert w.t == again.t, (w.t, again.t)
            assert np.array_equal(w.v, again.v) and np.array_equal(w.y, again.y), w.step_number
        print(min(waits))
    """
    assert float(aside(code)) < 0.1


#: Sweeps, whose chunks are computed by threads that no signal reaches; each chunk would take minutes.
SWEEPS = {
    "with a tolerance": "sw.Pendulum, {'omega': np.linspace(1, 2, 4000)}, 'dop853', v=0.0, y=1.0, tolerance=1e-12, at=[1e6]",
    "with a tolerance, bodies": "bodies, {'G': np.linspace(1, 2, 40)}, 'dop853', v=0.0, y=y, tolerance=1e-12, at=[1e6]",
    "of a Taylor series": "sw.Pendulum, {'omega': np.linspace(1, 2, 4000)}, 'taylor', v=0.0, y=1.0, tolerance=1e-12, at=[1e6]",
    "of exponents": "sw.Pendulum, {'omega': np.linspace(1, 2, 9999)}, 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**6, "
    "outcomes='lyapunov'",
    "of a function": "sw.Pendulum, {'omega': np.linspace(1, 2, 999)}, 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**8, outcomes=f",
    "in threads of the caller's": "sw.Pendulum, {'omega': np.linspace(1, 2, 99)}, 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**9, "
    "engine=pool",
    "of histories": "sw.Pendulum, {'omega': np.linspace(1, 2, 4000)}, 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**6, every=100",
}


@pytest.mark.parametrize("what", SWEEPS)
def test_ctrl_c_in_a_sweep(what: str) -> None:
    """Its threads end within half a second, and afterwards nothing stops a run of the thread that was asked."""
    code = f"""
        import functools, os, signal, threading, time
        from concurrent.futures import ThreadPoolExecutor
        import numpy as np, stepwell as sw
        y = np.random.default_rng(1).random((40, 2))
        bodies = functools.partial(sw.NBody, np.ones(40), softening=0.1)
        def f(run):
            return run.y[-1]
        pool = ThreadPoolExecutor(2)
        # A warm-up, so that nothing is imported for the first time while the clock runs.
        sw.sweep(sw.Oscillator, {{"omega": [1.0]}}, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
        sent, waits = [], []
        def interrupt():
            time.sleep(0.5)
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)
        for _ in range(3):
            threading.Thread(target=interrupt).start()
            try:
                sw.sweep({SWEEPS[what]})
            except KeyboardInterrupt:
                waits.append(time.perf_counter() - sent[-1])
            else:
                raise SystemExit("not interrupted")
        assert not [each for each in threading.enumerate() if each.name.startswith("sweep")]
        sw.sweep(sw.Oscillator, {{"omega": [1.0]}}, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
        print(min(waits))
    """
    assert float(aside(code)) < 0.5


def test_a_function_that_goes_on_after_ctrl_c_is_awaited() -> None:
    """By the next computation and by the end of the process: a thread that is joined is taken for dead (CPython gh-90882)."""
    code = """
        import atexit, os, signal, threading, time
        from stepwell.base.interrupts import heard
        ends = []
        def function():
            time.sleep(1.0)
            ends.append(time.perf_counter())
        def interrupt():
            time.sleep(0.3)
            os.kill(os.getpid(), signal.SIGINT)
        threading.Thread(target=interrupt).start()
        try:
            heard(1e9, function)
        except KeyboardInterrupt:
            assert not ends
        heard(1e9, lambda: print("next", len(ends)))
        threading.Thread(target=interrupt).start()
        try:
            heard(1e9, function)
        except KeyboardInterrupt:
            pass
        atexit.register(lambda: print("end", len(ends)))
    """
    assert aside(code).split() == ["next", "1", "end", "2"]
