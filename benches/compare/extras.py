"""What a user waits for besides steps: the import, one call that makes one step, the download."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np
import stepwell as sw

ROOT = Path(__file__).parents[2]

IMPORT = "import time, numpy; a = time.perf_counter(); import stepwell; print(time.perf_counter() - a)"


def import_time(repeats: int) -> str:
    """Importing stepwell when NumPy is there already."""
    run = [sys.executable, "-c", IMPORT]
    taken = [float(subprocess.run(run, capture_output=True, text=True, check=True).stdout) for _ in range(repeats + 1)]
    del taken[0]  # writes byte code, fills the disk cache
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


def table(repeats: int) -> list[tuple[str, str, str]]:
    """What, how much, and what was aimed at."""
    return [
        ("`import stepwell` after NumPy", import_time(repeats), "≤ 20 ms"),
        ("`World.step(1)`, one oscillator", world_step(repeats), "≤ 0.2 µs beyond arithmetic"),
        ("wheel", wheel(), "≤ 3 MB"),
    ]
