"""stepwell, called as a user calls it: from arrays to arrays, checks included."""

from __future__ import annotations

import functools
import os

import stepwell as sw

from . import Contestant, Ready, Workload


def threads() -> int:
    """How many threads this process may use at once."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def free(data) -> sw.System:
    """Undamped oscillators."""
    return sw.Oscillator(omega=data["omega"])


def forced(data) -> sw.System:
    """Damped oscillators with a sinusoidal acceleration."""
    push = sw.Sinusoid(data["amplitude"], data["frequency"], data["phase"])
    return sw.Oscillator(omega=data["omega"], damping=data["damping"], a=push)


def kernels(**how):
    """What makes each kind of workload ready, by ``stepwell.integrate`` with these further arguments."""

    def ready(system, method: str, work: Workload, quick: bool) -> Ready:
        def call():
            v, y = work.data["v"], work.data["y"]
            run = sw.integrate(system(work.data), method, v=v, y=y, dt=work.dt, steps=work.steps, **how)
            return run.v[-1], run.y[-1]

        return Ready(call)

    return {
        "free_false_euler": functools.partial(ready, free, "false_euler"),
        "forced_standard_heun": functools.partial(ready, forced, "standard_heun"),
    }


CONTESTANTS = [
    Contestant("stepwell, 1 thread", kernels(threads=1)),
    Contestant(f"stepwell, up to {threads()} threads", kernels(threads=None)),
]
