"""Ctrl-C ends a run within a tenth of a second and leaves the process usable."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import pytest
import stepwell as sw

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
    "the reference": "sw.integrate(sw.Oscillator(1.0), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10**9, backend='numpy')",
}


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("what", RUNS)
def test_ctrl_c(what: str) -> None:
    code = f"""
        import os, signal, threading, time
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
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=60, env=dict(os.environ)
    )
    assert done.returncode == 0, done.stderr
    wait, after = done.stdout.splitlines()[-1].split()
    # The best of three, so that a busy machine does not fail the test; a run that never looks would wait for minutes.
    assert float(wait) < 0.1
    here = sw.integrate(sw.Oscillator(1.0), "false_euler", v=0.0, y=1.0, dt=0.3, steps=7)
    assert float.fromhex(after) == here.y[-1]
