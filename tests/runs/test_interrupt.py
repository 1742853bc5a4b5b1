"""Ctrl-C ends a run within a tenth of a second and leaves the process usable."""

import os
import signal
import subprocess
import sys
import textwrap
import time

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
    "a world with events": "sw.World(sw.Pendulum(np.ones(1000)), 'rk4', v=np.zeros(1000), y=np.ones(1000), dt=0.01, "
    "events=sw.Event(lambda t, v, y: y, most=9)).step(10**9)",
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


#: One thread for LAPACK: several wait for each other in a loop, for a minute where the cores are busy.
ENVIRONMENT = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
THRICE = """
import copy, functools, os, signal, threading, time
from concurrent.futures import ThreadPoolExecutor
import numpy as np, stepwell as sw
def places(n):
    return np.random.default_rng(1).random((n, 2))
def world(n, method):
    y = places(n)
    return sw.World(sw.NBody(np.ones(n)), method, v=np.zeros_like(y), y=y, dt=1e-6)
sent, waits, w = [], [], None
def interrupt():
    time.sleep({after})
    sent.append(time.perf_counter())
    os.kill(os.getpid(), signal.SIGINT)
# A warm-up, so that nothing is imported or compiled for the first time while the clock runs.
sw.integrate(sw.Oscillator(1.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
{setup}
start = None if w is None else copy.copy(w)
for _ in range(3):
    threading.Thread(target=interrupt).start()
    try:
        {run}
    except KeyboardInterrupt:
        waits.append(time.perf_counter() - sent[-1])
    else:
        raise SystemExit("not interrupted")
{then}
print(min(waits))
"""


def aside(code: str) -> str:
    """The output of a process of its own. On Windows ``os.kill`` would end it whatever the signal is."""
    if sys.platform == "win32":
        code = code.replace("os.kill(os.getpid(), signal.SIGINT)", "signal.raise_signal(signal.SIGINT)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100, env=ENVIRONMENT)
    assert done.returncode == 0, done.stderr
    return done.stdout


def wait_of(run: str, setup: str = "", then: str = "", after: float = 0.5) -> float:
    """The best of three, so that a busy machine does not fail the test; a run that never looks would wait for minutes."""
    return float(aside(THRICE.format(run=run, setup=setup, then=then, after=after)))


#: It has the bits that it has here.
AFTERWARDS = """
after = sw.integrate(sw.Oscillator(1.0), 'false_euler', v=0.0, y=1.0, dt=0.3, steps=7)
assert after.y[-1].hex() == '{bits}', after.y[-1].hex()
"""


@pytest.mark.parametrize("what", RUNS)
def test_ctrl_c(what: str) -> None:
    if what == "a device" and not NAMES:
        pytest.skip("there is no device of OpenCL here")
    here = sw.integrate(sw.Oscillator(1.0), "false_euler", v=0.0, y=1.0, dt=0.3, steps=7)
    assert wait_of(RUNS[what], then=AFTERWARDS.format(bits=here.y[-1].hex())) < 0.1


#: Where a single step, or the forces of one, take long: what is made outside the clock, and worlds and runs of which none would
#: end by itself before it is interrupted, however quick the machine.
WITHIN_A_STEP = {
    "dop853 of 2000 bodies, a world": ("w = world(2000, 'dop853')", "w.step(10**6)"),
    "leapfrog of 20 000 bodies, a world": ("w = world(20_000, 'leapfrog')", "w.step(10**6)"),
    **{
        f"{method} of 20 000 bodies, {options}": (
            "y = places(20_000)",
            f"sw.integrate(sw.NBody(np.ones(len(y))), {method!r}, v=0.0, y=y, {options})",
        )
        for method, options in {
            "leapfrog": "dt=1e-6, steps=10**6, threads=1",
            "rk4": "dt=1e-6, steps=10**6, threads=2",
            "dop853": "at=[1.0], tolerance=1e-6",
        }.items()
    },
    "many members, a world": (
        "y = np.ones(10**6); w = sw.World(sw.Pendulum(), 'rk4', v=np.zeros(10**6), y=y, dt=0.1)",
        "w.step(10**6)",
    ),
}


AGAIN = """
if w is not None:
    again = sw.World(w.system, w.method, resume=start)
    again.step(w.step_number)
    assert w.t == again.t, (w.t, again.t)
    assert np.array_equal(w.v, again.v) and np.array_equal(w.y, again.y), w.step_number
"""


@pytest.mark.parametrize("what", WITHIN_A_STEP)
def test_ctrl_c_within_a_step(what: str) -> None:
    """A tenth of a second too; and a world stays where its last whole step left it, as if nobody had asked for more."""
    setup, run = WITHIN_A_STEP[what]
    assert wait_of(run, setup, AGAIN, after=0.3) < 0.1


#: Sweeps, whose chunks are computed by threads that no signal reaches; each chunk would take minutes.
SWEEPS = {
    "with a tolerance": "sw.Pendulum, {'omega': np.linspace(1, 2, 4000)}, 'dop853', v=0.0, y=1.0, tolerance=1e-12, at=[1e6]",
    "with a tolerance, bodies": "bodies, {'G': np.linspace(1, 2, 40)}, 'dop853', v=0.0, y=y, tolerance=1e-12, at=[1e6]",
    "of a Taylor series": "sw.Pendulum, {'omega': np.linspace(1, 2, 4000)}, 'taylor', v=0.0, y=1.0, tolerance=1e-12, at=[1e6]",
    **{
        what: f"sw.Pendulum, {{'omega': np.linspace(1, 2, {many})}}, 'rk4', v=0.0, y=1.0, dt=0.1, {options}"
        for what, many, options in (
            ("of exponents", 9999, "steps=10**6, outcomes='lyapunov'"),
            ("of a function", 999, "steps=10**8, outcomes=f"),
            ("in threads of the caller's", 99, "steps=10**9, engine=pool"),
            ("of histories", 4000, "steps=10**6, every=100"),
        )
    },
}


BODIES_AND_A_POOL = """
y = places(40)
bodies = functools.partial(sw.NBody, np.ones(40), softening=0.1)
def f(run):
    return run.y[-1]
pool = ThreadPoolExecutor(2)
def small():
    sw.sweep(sw.Oscillator, {"omega": [1.0]}, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
small()
"""
NO_THREAD = "assert not [each for each in threading.enumerate() if each.name.startswith('sweep')]\nsmall()"


@pytest.mark.parametrize("what", SWEEPS)
def test_ctrl_c_in_a_sweep(what: str) -> None:
    """Its threads end within half a second, and afterwards nothing stops a run of the thread that was asked."""
    assert wait_of(f"sw.sweep({SWEEPS[what]})", BODIES_AND_A_POOL, NO_THREAD) < 0.5


def test_a_function_that_goes_on_after_ctrl_c_is_awaited() -> None:
    """By the next computation and by the end of the process: a thread that is joined is taken for dead (CPython gh-90882)."""
    code = """
        import atexit, os, signal, threading, time
        ends = []
        atexit.register(lambda: print("end", len(ends)))
        from stepwell.base.interrupts import heard
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
    """
    assert aside(textwrap.dedent(code)).split() == ["next", "1", "end", "2"]


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is no signal there")
@pytest.mark.parametrize(("caught", "ends"), [(False, "by the signal"), (True, "after the function")])
def test_a_program_that_ctrl_c_ends_does_not_wait(caught: bool, ends: str) -> None:
    """It ends by SIGINT, as Python does, in less than a second; one that catches it goes on, and waits at its end."""
    code = f"""
        import os, signal, threading, time
        from stepwell.base.interrupts import heard
        def interrupt():
            time.sleep(0.3)
            os.kill(os.getpid(), signal.SIGINT)
        threading.Thread(target=interrupt).start()
        print("begin", time.time(), flush=True)
        try:
            heard(1e9, time.sleep, 4.0)
        except KeyboardInterrupt:
            if not {caught}:
                raise
    """
    run = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, env=ENVIRONMENT)
    took = time.time() - float(run.stdout.split()[1])
    assert (run.returncode, took < 2.0) == ((0, False) if caught else (-signal.SIGINT, True)), ends
