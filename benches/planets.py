"""Giant planets by Wisdom and Holman's method beside REBOUND's WHFast: ``python -m benches.planets``. On one thread.

Five bodies in space, 20 steps for each of Jupiter's years. The error is the largest of the energy over 2000 steps, at every
seventh; the time is that of a step of one system, the least of some runs in turn, and of a member of a batch.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import rebound
import stepwell as sw

G = sw.orbits.gravity("au", "solar", "year")
MASSES = [1.0, 1 / 1047.35, 1 / 3497.9, 1 / 22900, 1 / 19400]
DT = 5.2**1.5 / 20.0
STEPS, EVERY, TIMED, REPEATS, MEMBERS = 2000, 7, 50_000, 7, 1024


def planets() -> sw.orbits.Start:
    return sw.orbits.system(
        MASSES,
        a=[5.2, 9.55, 19.2, 30.1],
        e=[0.0485, 0.0555, 0.046, 0.009],
        inclination=[0.02, 0.04, 0.013, 0.03],
        node=[1.7, 1.9, 1.3, 2.3],
        argument_of_periapsis=[4.7, 5.9, 1.7, 4.8],
        mean_anomaly=[0.3, 5.0, 2.5, 4.5],
        G=G,
    )


def error_of(method: str, order: int) -> float:
    bodies, v, y = planets()
    start = sw.orbits.corrected(bodies, v, y, dt=DT, order=order) if order else (v, y)
    run = sw.integrate(bodies, method, v=start[0], y=start[1], dt=DT, steps=STEPS, every=EVERY)
    v, y = sw.orbits.uncorrected(run, order=order) if order else (run.v, run.y)
    energy = bodies.energy(np.moveaxis(v, 0, -1), np.moveaxis(y, 0, -1))
    return float(np.abs(energy / energy[0] - 1.0).max())


def simulation(order: int) -> Any:
    _, v, y = planets()
    made = rebound.Simulation()
    made.G = G
    for mass, place, velocity in zip(MASSES, y, v, strict=True):
        made.add(m=mass, **dict(zip("xyz", place, strict=True)), **dict(zip(("vx", "vy", "vz"), velocity, strict=True)))
    made.integrator, made.dt = "whfast", DT
    options = made.ri_whfast if hasattr(made, "ri_whfast") else made.integrator
    options.corrector, options.safe_mode = order, 0
    return made


def error_of_whfast(order: int) -> float:
    made = simulation(order)
    first, worst = made.energy(), 0.0
    for _ in range(STEPS // EVERY):
        made.steps(EVERY)
        made.synchronize()
        worst = max(worst, abs(made.energy() / first - 1.0))
    return worst


def ours(method: str, members: int, steps: int) -> Callable[[], Any]:
    bodies, v, y = planets()
    if members > 1:
        v, y = (np.repeat(block[..., np.newaxis], members, axis=-1) for block in (v, y))
    return lambda: sw.integrate(bodies, method, v=v, y=y, dt=DT, steps=steps, threads=1)


def main() -> None:
    """Prints the table."""
    theirs = {order: simulation(order) for order in (0, 7)}
    alone = {f"whfast {order}": partial(made.steps, TIMED) for order, made in theirs.items()}
    alone |= {method: ours(method, 1, TIMED) for method in ("wisdom_holman", "leapfrog")}
    took = dict.fromkeys(alone, np.inf)
    for _ in range(REPEATS):  # in turn, so that all meet the same machine
        for name, call in alone.items():
            begin = time.perf_counter()
            call()
            took[name] = min(took[name], (time.perf_counter() - begin) / TIMED * 1e9)
    many = {}
    for method in ("wisdom_holman", "leapfrog"):
        call, many[method] = ours(method, MEMBERS, 200), np.inf
        for _ in range(REPEATS):
            begin = time.perf_counter()
            call()
            many[method] = min(many[method], (time.perf_counter() - begin) / 200 / MEMBERS * 1e9)
    print(f"stepwell {sw.__version__}, {sw.isa()}; REBOUND {rebound.__version__}; a step in ns\n")
    print("| | energy error | one system | a member of 1024 |\n|---|---|---|---|")
    for order in (0, 7):
        name = f"corrector {order}" if order else "no corrector"
        print(f"| WHFast, {name} | {error_of_whfast(order):.1e} | {took[f'whfast {order}']:.0f} | |")
    for order in (0, 3, 5, 7):
        name, time_of = (f"corrector {order}" if order else "no corrector"), took["wisdom_holman"]
        error = error_of("wisdom_holman", order)
        print(f"| `wisdom_holman`, {name} | {error:.1e} | {time_of:.0f} | {many['wisdom_holman']:.0f} |")
    print(f"| `leapfrog` | {error_of('leapfrog', 0):.1e} | {took['leapfrog']:.0f} | {many['leapfrog']:.0f} |")


if __name__ == "__main__":
    main()
