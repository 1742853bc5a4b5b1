"""What events cost beside the run without, and beside others: the tables of docs/howto/events.md.

    python -m benches.events

Processor time of one thread, the least of some turns in which all are run one after the other. *Watching* is with an event that
never happens, *finding* with one at each passage upward, *changing* with one that takes a hundredth of the velocity there.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import stepwell as sw

Call = Callable[[], Any]

NEVER = sw.Event(lambda t, v, y: y - 1e3, name="never")
UP = sw.Event(lambda t, v, y: y - 1.0, direction=1, name="up")
SLOWED = sw.Event(lambda t, v, y: y - 1.0, direction=1, then=lambda t, v, y: (0.99 * v, y), name="slowed")
BOUNCE = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-0.8 * v, y), name="bounce")


@sw.system(order=2)
def duffing(t, v, y, *, beta=1.0):
    """Duffing's oscillator."""
    return y - beta * y * y * y + 0.01 * np.cos(1.2 * t)


@sw.system(order=2)
def falling(t, v, y, *, g=9.81):
    """A body in a uniform field."""
    return -g + 0.0 * y


def least(calls: dict[str, Call], turns: int = 5) -> dict[str, float]:
    """The processor time of each in milliseconds, after a first call of each that does not count."""
    times = dict.fromkeys(calls, np.inf)
    for turn in range(turns + 1):
        for name, call in calls.items():
            start = time.process_time()
            call()
            if turn:
                times[name] = min(times[name], 1e3 * (time.process_time() - start))
    return times


def of_duffing(method: str, members: int, **options: Any) -> None:
    """A row of the first table."""
    state = {"v": 0.0, "y": np.linspace(0.3, 0.8, members) if members > 1 else 0.3, "threads": 1}
    system = duffing()

    def run(event: sw.Event | None = None) -> sw.Run:
        return sw.integrate(system, method, events=event, **state, **options)

    events = {"without": None, "watching": NEVER, "finding": UP, "changing": SLOWED}
    ms = least({name: lambda event=event: run(event) for name, event in events.items()})
    number = int(run(UP).events["up"].count.sum())
    ratios = " | ".join(f"{ms[name] / ms['without']:.1f}" for name in list(events)[1:])
    print(f"| `{method}` | {members} | {ms['without']:.2f} | {ratios} | {number} |")


def of_balls(method: str, members: int, **options: Any) -> None:
    """Microseconds for each bounce of balls that fall from 1 to 1.4 m, with fewer than ten bounces each."""
    y = np.linspace(1.0, 1.4, members)
    made = {"bounce": lambda: sw.integrate(falling(), method, v=0.0, y=y, threads=1, events=BOUNCE, **options)}
    ms, number = least(made, 3)["bounce"], int(made["bounce"]().events["bounce"].count.sum())
    print(f"| `{method}` | {members} | {ms:.2f} | {1e3 * ms / number:.1f} |")


def of_heyoka() -> None:
    """heyoka's own ratio: one member of Duffing's oscillator to t = 40 at a tolerance of 1e-8."""
    try:
        import heyoka as hy
    except ImportError:
        print("heyoka is left out: it is not installed")
        return
    y, v = hy.make_vars("y", "v")
    rates = [(y, v), (v, y - y * y * y + 0.01 * hy.cos(1.2 * hy.time))]

    def slowed(made: Any, *_: Any) -> bool:
        made.state[1] *= 0.99
        return True

    up = {"direction": hy.event_direction.positive}
    noted: list[float] = []
    made = {
        "without": hy.taylor_adaptive(rates, [0.3, 0.0], tol=1e-8),
        "watching": hy.taylor_adaptive(rates, [0.3, 0.0], tol=1e-8, nt_events=[hy.nt_event(y - 1e3, lambda *_: None)]),
        "finding": hy.taylor_adaptive(
            rates, [0.3, 0.0], tol=1e-8, nt_events=[hy.nt_event(y - 1.0, lambda ta, t, *_: noted.append(t), **up)]
        ),
        "changing": hy.taylor_adaptive(rates, [0.3, 0.0], tol=1e-8, t_events=[hy.t_event(y - 1.0, callback=slowed, **up)]),
    }

    def run(each: Any) -> None:
        each.time, each.state[:] = 0.0, [0.3, 0.0]
        each.propagate_until(40.0)

    ms = least({name: lambda each=each: run(each) for name, each in made.items()}, 30)
    ratios = " | ".join(f"{ms[name] / ms['without']:.1f}" for name in list(made)[1:])
    print(f"| heyoka | 1 | {ms['without']:.3f} | {ratios} | {len(noted) // 31} |")


def of_scipy() -> None:
    """SciPy's: finding only, since its events change no state."""
    from scipy.integrate import solve_ivp

    def rates(t: float, z: Any) -> Any:
        return [z[1], z[0] - z[0] ** 3 + 0.01 * np.cos(1.2 * t)]

    def up(t: float, z: Any) -> Any:
        return z[0] - 1.0

    up.direction = 1.0  # type: ignore[attr-defined]
    options: Any = {"method": "DOP853", "rtol": 1e-8, "atol": 1e-8}
    ms = least(
        {name: lambda e=e: solve_ivp(rates, (0.0, 40.0), [0.3, 0.0], events=e, **options) for name, e in (("", None), ("up", up))}
    )
    print(f"| SciPy, `DOP853` | 1 | {ms['']:.2f} | | {ms['up'] / ms['']:.1f} | | |")


def of_numba() -> None:
    """The loop that one writes: RK4 with a comparison of signs, and a straight line between the states."""
    try:
        import numba
    except ImportError:
        print("numba is left out: it is not installed")
        return

    @numba.njit
    def rate(t, v, y):  # type: ignore[no-untyped-def]
        return y - y * y * y + 0.01 * np.cos(1.2 * t)

    @numba.njit
    def loop(n, steps, h, notes, change, at):  # type: ignore[no-untyped-def]
        count = 0
        for i in range(n):
            v, y = 0.0, 0.3 + 0.5 * i / max(1, n - 1)
            for k in range(steps):
                t, g = k * h, y - 1.0
                a1 = rate(t, v, y)
                v2 = v + 0.5 * h * a1
                a2 = rate(t + 0.5 * h, v2, y + 0.5 * h * v)
                v3 = v + 0.5 * h * a2
                a3 = rate(t + 0.5 * h, v3, y + 0.5 * h * v2)
                v4 = v + h * a3
                a4 = rate(t + h, v4, y + h * v3)
                y += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
                v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
                if notes and g < 0.0 and y - 1.0 >= 0.0:
                    at[count % 64] = t + h * g / (g - y + 1.0)
                    v = 0.99 * v if change else v
                    count += 1
        return count

    for members in (1, 1000):
        at = np.empty(64)
        kinds = {"without": (False, False), "finding": (True, False), "changing": (True, True)}
        ms = least({name: lambda kind=kind, n=members, at=at: loop(n, 4000, 0.01, *kind, at) for name, kind in kinds.items()})
        ratios = " | ".join(f"{ms[name] / ms['without']:.1f}" for name in ("finding", "changing"))
        print(f"| numba, `rk4` | {members} | {ms['without']:.2f} | | {ratios} | |")


def main() -> None:
    """Print the tables."""
    warnings.simplefilter("ignore", sw.EventWarning)
    print("| | trajectories | without, ms | watching, ratio | finding, ratio | changing, ratio | found |")
    print("|---|---|---|---|---|---|---|")
    for members in (1, 1000, 100_000):
        of_duffing("rk4", members, dt=0.01, steps=4000 if members < 1e5 else 400)
    for members in (1, 1000):
        for method in ("merson", "dop853", "taylor"):
            of_duffing(method, members, tolerance=1e-8, at=[40.0])
    of_numba()
    of_heyoka()
    of_scipy()
    print("\n| | balls | ms | µs for each bounce |\n|---|---|---|---|")
    for members in (1, 1000, 10_000):
        of_balls("rk4", members, dt=0.01, steps=400)
    of_balls("verlet", 100, dt=0.01, steps=400)
    for method in ("merson", "dop853", "taylor"):
        for members in (1, 1000):
            of_balls(method, members, tolerance=1e-8, at=[4.0])


if __name__ == "__main__":
    main()
