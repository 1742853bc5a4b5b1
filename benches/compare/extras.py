"""What a user waits for besides steps: the import, one call that makes one step, the download."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
import stepwell as sw

from . import runner
from .workloads import w4_one_system

ROOT = Path(__file__).parents[2]

IMPORT = "import time, numpy; a = time.perf_counter(); import stepwell; print(time.perf_counter() - a)"


def import_time(repeats: int) -> str:
    """Importing stepwell when NumPy is there already, from byte code, as after an installation."""
    run = [sys.executable, "-c", IMPORT]
    with tempfile.TemporaryDirectory() as cache:
        env = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        env["PYTHONPYCACHEPREFIX"] = cache
        made = [subprocess.run(run, capture_output=True, text=True, check=True, env=env).stdout for _ in range(repeats + 1)]
    taken = [float(each) for each in made[1:]]  # the first writes the byte code
    return f"{1e3 * median(taken):.1f} ms ({1e3 * min(taken):.1f} … {1e3 * max(taken):.1f})"


def world_step(repeats: int) -> str:
    """``World.step(1)`` of one oscillator by False Euler, less the arithmetic of a step."""
    v, y, h = np.zeros(1), np.ones(1), 0.01
    world = sw.World(sw.Oscillator(), "false_euler", v=v, y=y, dt=h)
    for _ in range(1000):
        world.step(1)
    error = float(np.hypot(v + np.sin(1000 * h), y - np.cos(1000 * h))[0])

    def per_call(steps: int, calls: int = 10_000) -> float:
        step, start = world.step, time.perf_counter()
        for _ in range(calls):
            step(steps)
        return (time.perf_counter() - start) / calls

    calls = sorted(per_call(1) for _ in range(repeats))
    arithmetic = (per_call(1001, 100) - calls[0]) / 1000
    lowest, middle, highest = 1e6 * calls[0], 1e6 * median(calls), 1e6 * calls[-1]
    beyond = f"{middle - 1e6 * arithmetic:.3f} µs beyond arithmetic"
    return f"{middle:.3f} µs ({lowest:.3f} … {highest:.3f}), {beyond}; error {error:.1e} after 1000 steps"


def wheel() -> str:
    """The newest wheel in ``dist``."""
    wheels = sorted(ROOT.glob("dist/*.whl"), key=lambda path: path.stat().st_mtime)
    return f"{wheels[-1].stat().st_size / 1e6:.2f} MB ({wheels[-1].name})" if wheels else "none in dist/"


def control_cost(bodies: int, repeats: int, quick: bool) -> str:
    """Energy control beside the same method without it, in turns. By False Euler: leapfrog has no velocity to push.

    Worlds step, so that what is done once, the energy of the start, is not counted.
    """
    (work,) = (w for w in w4_one_system.ONE if w.bodies == bodies)
    work = work.quick() if quick else work
    data = {name: row[..., 0] for name, row in work.data.items()}
    system = sw.NBody(data["masses"], force="newton", softening=data["softening"])

    def world(control: sw.EnergyControl | None) -> sw.World:
        return sw.World(system, "false_euler", v=data["v"].copy(), y=data["y"].copy(), dt=work.dt, control=control)

    worlds, energy = [world(None), world(sw.EnergyControl(relative=0.1))], system.energy(data["v"], data["y"])
    calls = max(1, round(runner.SAMPLE / runner.sample(functools.partial(worlds[0].step, work.steps), 1)))
    ratios = []
    for _ in range(repeats):
        plain, controlled = (runner.sample(functools.partial(each.step, work.steps), calls) for each in worlds)
        ratios.append(controlled / plain)
    lowest, middle, highest = (100.0 * (each - 1.0) for each in (min(ratios), median(ratios), max(ratios)))
    without, off = (float(abs(system.energy(each.v, each.y) - energy)) for each in worlds)
    return f"{middle:+.0f} % ({lowest:+.0f} … {highest:+.0f}); energy error {off:.1e}, without {without:.1e}"


def table(repeats: int, quick: bool = False) -> list[tuple[str, str, str]]:
    """What, how much, and what was aimed at."""
    return [
        ("`import stepwell` after NumPy", import_time(repeats), "≤ 20 ms"),
        ("`World.step(1)`, one oscillator", world_step(repeats), "≤ 0.15 µs beyond arithmetic"),
        *(
            (f"energy control beyond the plain step, {n} bodies, False Euler", control_cost(n, repeats, quick), "≤ 5 %")
            for n in (64, 1024)
        ),
        ("wheel", wheel(), "≤ 2.5 MB"),
    ]
