"""A long run at rounding level: the outer solar system, by the series of stepwell and heyoka and by REBOUND's IAS15.

Where the error of a step is below rounding, that of the energy is a sum of roundings, which grows as the square root of the time
(Brouwer 1937). Who has a bias of the least kind is worse: it grows as the time.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw

from ...budget import Budget
from ..report import Table, number
from ..workloads import Array

#: The Sun with the inner planets, Jupiter, Saturn, Uranus, Neptune and Pluto on 5 September 1994, in solar masses, astronomical
#: units and days: E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration (Springer 2006), section I.2.4.
G = 2.95912208286e-4
MASSES = np.array([1.00000597682, 0.000954786104043, 0.000285583733151, 0.0000437273164546, 0.0000517759138449, 1.0 / 1.3e8])
PLACES = np.array(
    [
        [0.0, 0.0, 0.0],
        [-3.5023653, -3.8169847, -1.5507963],
        [9.0755314, -3.0458353, -1.6483708],
        [8.3101420, -16.2901086, -7.2521278],
        [11.4707666, -25.7294829, -10.8169456],
        [-15.5387357, -25.2225594, -3.1902382],
    ]
)
VELOCITIES = np.array(
    [
        [0.0, 0.0, 0.0],
        [0.00565429, -0.00412490, -0.00190589],
        [0.00168318, 0.00483525, 0.00192462],
        [0.00354178, 0.00137102, 0.00055029],
        [0.00288930, 0.00114527, 0.00039677],
        [0.00276725, -0.00170702, -0.00136504],
    ]
)
YEAR = 365.25
#: Saved states; the error of the energy is the root of the mean square over the last half of them, for a single one may be zero.
SAVED = 64
#: Seconds that a contestant has for all lengths together, with its imports: some times what it takes on a quiet machine.
BUDGET = 120.0
#: Where ``benches`` is.
ROOT = Path(__file__).parents[3]
#: A tolerance of a rounding. (REBOUND's epsilon is its default, 1e-9: the size of a term, not an error.)
ROUNDING = 2.0**-53

Solve = Callable[[Array], tuple[Array, Array]]


def at_rest() -> tuple[Array, Array]:
    """The start, v and y, where the centre of mass rests in the origin."""
    shares = MASSES / MASSES.sum()
    return VELOCITIES - shares @ VELOCITIES, PLACES - shares @ PLACES


def energy(v: Array, y: Array) -> Array:
    """Of states (times, bodies, 3), in extended precision: its own roundings must not be those that are looked for."""
    masses, v, y = (np.asarray(each, dtype=np.longdouble) for each in (MASSES, v, y))
    total = 0.5 * (masses * (v * v).sum(axis=-1)).sum(axis=-1)
    for i in range(len(masses)):
        for j in range(i):
            total -= G * masses[i] * masses[j] / np.sqrt(((y[:, i] - y[:, j]) ** 2).sum(axis=-1))
    return np.asarray(total)


def contestants() -> dict[str, Callable[[], Solve]]:
    """What makes each a function from times to states, by its name; what is not installed raises ``ImportError``."""
    return {"stepwell taylor": lambda: ours, "heyoka": heyokas, "REBOUND IAS15": rebounds}


def ours(times: Array) -> tuple[Array, Array]:
    """By stepwell."""
    v, y = at_rest()
    run = sw.integrate(sw.NBody(MASSES, force="newton", G=G), "taylor", v=v, y=y, tolerance=ROUNDING, at=times, threads=1)
    return run.v, run.y


def heyokas() -> Solve:
    """By heyoka, compiled before."""
    import heyoka as hy

    series: Any = hy.taylor_adaptive(hy.model.nbody(len(MASSES), masses=MASSES, Gconst=G), np.ones(36), tol=ROUNDING)

    def solve(times: Array) -> tuple[Array, Array]:
        v, y = at_rest()
        series.time = 0.0
        series.state[:] = np.concatenate([y, v], axis=1).ravel()
        states = series.propagate_grid(np.concatenate([[0.0], times]))[-1][1:].reshape(-1, len(MASSES), 6)
        return states[..., 3:], states[..., :3]

    return solve


def rebounds() -> Solve:
    """By REBOUND."""
    import rebound

    def solve(times: Array) -> tuple[Array, Array]:
        sim = rebound.Simulation()
        sim.G, sim.integrator = G, "ias15"
        for mass, v, y in zip(MASSES.tolist(), *(block.tolist() for block in at_rest()), strict=True):
            sim.add(m=mass, x=y[0], y=y[1], z=y[2], vx=v[0], vy=v[1], vz=v[2])
        states = np.empty((len(times), len(MASSES), 6))
        for i, t in enumerate(times.tolist()):
            sim.integrate(t, exact_finish_time=1)
            states[i] = [[*p.xyz, *p.vxyz] for p in sim.particles]
        return states[..., 3:], states[..., :3]

    return solve


def run(name: str, years: list[float]) -> None:
    """Error and seconds of each length of the run by one contestant, a line for each as soon as it is done."""
    start = energy(*(block[np.newaxis] for block in at_rest()))[0]
    solve = contestants()[name]()
    solve(YEAR * np.array([100.0]))  # whatever it compiles
    for length in years:
        times = YEAR * length * np.arange(1, SAVED + 1) / SAVED
        begin = time.perf_counter()
        v, y = solve(times)
        seconds = time.perf_counter() - begin
        off = (energy(v, y)[SAVED // 2 :] - start) / start
        print(json.dumps([float(np.sqrt(np.mean(off * off))), seconds]), flush=True)


def measured(name: str, years: tuple[float, ...], budget: float) -> list[tuple[float, float]] | None:
    """Error and seconds of the lengths that a contestant did within so many seconds, in a process that is ended then.

    None if it is not installed.
    """
    command = [sys.executable, "-m", __name__, name, *map(str, years)]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=budget, check=False)
    except subprocess.TimeoutExpired as late:
        lines = (late.stdout or b"").decode().splitlines(keepends=True)
        return [tuple(json.loads(line)) for line in lines if line.endswith("\n")]
    if "ModuleNotFoundError" in done.stderr:
        return None
    if done.returncode:
        raise RuntimeError(f"{name}: {done.stderr}")
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def table(years: tuple[float, ...], budget: Budget) -> Table:
    """A column for the error and the time of each length of the run."""
    lines = []
    budget = budget.part(len(contestants()))
    for name in contestants():
        seconds = min(BUDGET, budget.part().seconds)
        found = measured(name, years, seconds)
        cells = [[f"{error:.1e}", number(1e3 * each)] for error, each in found or ()]
        cells += [["—", "—"]] * (len(years) - len(cells))
        why = f"{name.split()[0]} is not installed" if found is None else f"stopped after {seconds:.3g} s"
        remark = "" if found and len(found) == len(years) else why
        lines.append([name, *(each for pair in cells for each in pair), remark])
    head = [each for length in years for each in (f"error after {length:,.0f} years", "ms")]
    title = "Adaptive steps: the outer solar system at rounding level, relative error of the energy"
    return title, ["contestant", *head, "remarks"], lines


if __name__ == "__main__":
    run(sys.argv[1], [float(each) for each in sys.argv[2:]])
