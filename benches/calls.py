"""What a call with other numbers costs beside its steps, as in a fit or a scan: the table of docs/howto/runs.md.

    python -m benches.calls

Processor time of one thread in microseconds, the least of some turns. *Other numbers*: `integrate` of a system that is made anew
each call, with a number that it never had. *Steps*: what the core takes of it. Beside them a compiled function of numba, which
takes numbers as arguments and makes the same steps in a loop, and SciPy's solver.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.runs import short_runs

TURNS, CALLS = 9, 400


@sw.system
def duffing(t, v, y, *, beta=1.0, delta=0.1):
    """Duffing's oscillator."""
    return y - beta * y * y * y - delta * v + 0.3 * np.cos(1.2 * t)


@sw.system(order=1)
def robertson(t, y, *, slow=0.04, fast=1e4, fastest=3e7):
    """Robertson's three species."""
    a, b, c = slow * y[0], fast * y[1] * y[2], fastest * y[1] ** 2
    return np.stack([b - a, a - b - c, c])


THREE = np.array([1.0, 0.0, 0.0])
RUNS: dict[str, Callable[[float], sw.Run]] = {
    "own equation, 20 steps of `rk4`": lambda x: sw.integrate(duffing(beta=x), "rk4", v=0.0, y=1.0, dt=0.01, steps=20),
    "own equation, `dop853` at 1e-8": lambda x: sw.integrate(duffing(beta=x), "dop853", v=0.0, y=1.0, tolerance=1e-8, at=1.0),
    "three stiff species, `rodas5p` at 1e-6": lambda x: sw.integrate(
        robertson(slow=0.04 * x), "rodas5p", y=THREE, tolerance=1e-6, at=100.0
    ),
    "oscillator, 20 steps of `rk4`": lambda x: sw.integrate(sw.Oscillator(x), "rk4", v=0.0, y=1.0, dt=0.01, steps=20),
}


def least(call: Callable[[float], Any], numbers: Any) -> float:
    """Microseconds of a call with one number after the other, the least of all turns."""
    times = []
    for _ in range(TURNS):
        start = time.process_time()
        for _ in range(CALLS):
            call(next(numbers))
        times.append(1e6 * (time.process_time() - start) / CALLS)
    return min(times)


def steps_alone(call: Callable[[float], Any]) -> float:
    """Microseconds that the core takes for such a run."""
    run = next(each.run for each in reversed(short_runs._kept.values()) if each.run is not None)
    inside: list[float] = []
    core = run.core  # type: ignore[attr-defined]

    class Timed:
        """The core with a clock."""

        def run(self, *arguments: Any) -> int:
            """Make the run."""
            start = time.perf_counter()
            made: int = core.run(*arguments)
            inside.append(time.perf_counter() - start)
            return made

    run.core = Timed()  # type: ignore[attr-defined]
    for i in range(CALLS):
        call(1.5 + 1e-7 * i)
    run.core = core  # type: ignore[attr-defined]
    return 1e6 * min(inside)


def of_numba() -> float | None:
    """The loop that one compiles for the first row; None without numba."""
    try:
        import numba
    except ImportError:
        return None

    @numba.njit
    def rate(t, v, y, beta, delta):  # type: ignore[no-untyped-def]
        return y - beta * y * y * y - delta * v + 0.3 * np.cos(1.2 * t)

    @numba.njit
    def loop(v, y, h, n, beta, delta):  # type: ignore[no-untyped-def]
        for k in range(n):
            t = k * h
            a1 = rate(t, v, y, beta, delta)
            v2 = v + 0.5 * h * a1
            a2 = rate(t + 0.5 * h, v2, y + 0.5 * h * v, beta, delta)
            v3 = v + 0.5 * h * a2
            a3 = rate(t + 0.5 * h, v3, y + 0.5 * h * v2, beta, delta)
            v4 = v + h * a3
            a4 = rate(t + h, v4, y + h * v3, beta, delta)
            y += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        return v, y

    return least(lambda x: loop(0.0, 1.0, 0.01, 20, x, 0.1), (1.0 + 1e-7 * i for i in itertools.count()))


def of_scipy() -> float:
    """SciPy's solver for the second row."""
    from scipy.integrate import solve_ivp

    def rates(t: float, z: Any, beta: float) -> Any:
        return [z[1], z[0] - beta * z[0] ** 3 - 0.1 * z[1] + 0.3 * np.cos(1.2 * t)]

    def call(x: float) -> Any:
        return solve_ivp(rates, (0.0, 1.0), [1.0, 0.0], method="DOP853", rtol=1e-8, atol=1e-8, args=(x,))

    start = time.process_time()
    for i in range(20):
        call(1.0 + 1e-7 * i)
    return 1e6 * (time.process_time() - start) / 20


def main() -> None:
    """Print the table."""
    print("| | a call with other numbers, µs | the steps | beside them |\n|---|---|---|---|")
    for name, call in RUNS.items():
        whole, steps = least(call, (1.0 + 1e-7 * i for i in itertools.count())), steps_alone(call)
        print(f"| {name} | {whole:.1f} | {steps:.1f} | {whole - steps:.1f} |")
    made = least(lambda x: duffing(beta=x), (1.0 + 1e-7 * i for i in itertools.count()))
    print(f"| `duffing(beta=…)` itself | {made:.1f} | | |")
    compiled = of_numba()
    print("numba is left out: it is not installed" if compiled is None else f"| the first by numba | {compiled:.1f} | | |")
    print(f"| the second by SciPy's `DOP853` | {of_scipy():.1f} | | |")


if __name__ == "__main__":
    main()
