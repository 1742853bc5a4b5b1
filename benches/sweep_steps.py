"""Sweeps whose members have steps of their own beside one step for all: ``python -m benches.sweep_steps``. On one thread.

The frequency of a drive is an axis, and every period has 50 steps of Runge-Kutta 4; beside that the same with the step of the
middle frequency for all, and with members one by one. The error is the largest of the last y against dop853 with a tolerance of
1e-12; the time is that of a step of a member, the least of some sweeps in turn.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any
from unittest import mock

import numpy as np
import stepwell as sw
from stepwell.studies.sweeps import lengths

MEMBERS, PERIODS, STEPS, REPEATS = 2000, 40, 50, 5
OMEGA = np.linspace(0.5, 2.0, MEMBERS)


@sw.system
def duffing(t: Any, v: Any, y: Any, *, omega: Any = 1.0) -> Any:
    """A driven and damped spring that stiffens."""
    return 0.3 * np.cos(omega * t) - 0.2 * v - y - y**3


def oscillator(omega: Any) -> sw.Oscillator:
    return sw.Oscillator(1.0, damping=0.1, form="physical", a=sw.Sinusoid(0.3, omega))


def swept(make: Any, dt: Any) -> Any:
    axes = {"omega": ("run", OMEGA)} | ({} if np.ndim(dt) == 0 else {"dt": ("run", dt)})
    one = {"dt": dt} if np.ndim(dt) == 0 else {}
    return sw.sweep(make, axes, "rk4", v=0.0, y=0.5, steps=PERIODS * STEPS, threads=1, **one)


def alone(make: Any, dt: Any) -> Any:
    with mock.patch.object(lengths, "together", return_value=False):
        return swept(make, dt)


def error(make: Any, dt: Any) -> float:
    found, off = swept(make, dt).y_last.values, 0.0
    for k in range(0, MEMBERS, 97):
        at = [PERIODS * STEPS * float(np.broadcast_to(dt, MEMBERS)[k])]
        truth = sw.integrate(make(omega=OMEGA[k]), "dop853", v=0.0, y=0.5, tolerance=1e-12, at=at)
        off = max(off, abs(found[k] - truth.y[-1]))
    return off


def main() -> None:
    """Prints the table."""
    each, middle = 2.0 * np.pi / OMEGA / STEPS, 2.0 * np.pi / 1.25 / STEPS
    print(f"stepwell {sw.__version__}, {sw.isa()}; {MEMBERS} members, {PERIODS * STEPS} steps; a step of a member in ns\n")
    print("| | one step for all | error | steps of each | error | steps of each, one by one |\n|---|---|---|---|---|---|")
    for name, make in (("driven oscillator", oscillator), ("driven Duffing", duffing)):
        calls: list[Callable[[], Any]] = [partial(swept, make, middle), partial(swept, make, each), partial(alone, make, each)]
        assert calls[1]().equals(calls[2]())
        took = [np.inf] * len(calls)
        for _ in range(REPEATS):  # in turn, so that all meet the same machine
            for i, call in enumerate(calls):
                begin = time.perf_counter()
                call()
                took[i] = min(took[i], (time.perf_counter() - begin) / MEMBERS / PERIODS / STEPS * 1e9)
        one, own, slow = took
        print(f"| {name} | {one:.1f} | {error(make, middle):.1e} | {own:.1f} | {error(make, each):.1e} | {slow:.0f} |")


if __name__ == "__main__":
    main()
