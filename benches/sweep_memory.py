"""``python -m benches.sweep_memory``: the peak memory of a sweep of ten million members, each in a process of its own.

Shown is the largest resident set (``ru_maxrss``) less that of the same process before the sweep, with everything imported and
compiled. "results" are the arrays of the data set, "axes" the values that the caller made.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw

MEMBERS, STEPS = 10_000_000, 100
#: What is kept, and how: outcomes, whether to a store, bytes for a chunk.
KINDS: dict[str, tuple[Any, bool, float]] = {
    "last state, in memory": ("last", False, 2.0**26),
    "last state, to a Zarr store": ("last", True, 2.0**26),
    "extremes of 101 states, in memory": ("extremes", False, 2.0**26),
    "extremes of 101 states, to a Zarr store": ("extremes", True, 2.0**26),
    "extremes, to a Zarr store, 8 MiB for a chunk": ("extremes", True, 2.0**23),
}


def peak() -> int:
    """Of this process so far, in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def swept(kind: str, members: int, folder: Path) -> Any:
    """The sweep: oscillators of many frequencies."""
    outcomes, stored, memory = KINDS[kind]
    store = {"store": folder / f"{members}.zarr"} if stored else {}
    omega = np.linspace(0.5, 2.0, members)
    return sw.sweep(
        sw.Oscillator, {"omega": omega}, "rk4", v=0.0, y=1.0, dt=0.01, steps=STEPS, outcomes=outcomes, memory=memory, **store
    )


def single(kind: str, members: int) -> dict[str, float]:
    """What one process took."""
    with tempfile.TemporaryDirectory() as folder:
        swept(kind, 100_000, Path(folder)).close()
        before, begin = peak(), time.perf_counter()
        found = swept(kind, members, Path(folder))
        taken = {"peak": peak() - before, "seconds": time.perf_counter() - begin, "axes": 8 * members}
        taken["results"] = sum(each.nbytes for each in found.data_vars.values())
        found.close()
    return taken


def main() -> None:
    """Measure each in a new process."""
    parser = argparse.ArgumentParser(prog="python -m benches.sweep_memory", description=__doc__)
    parser.add_argument("--members", type=int, default=MEMBERS, help="how many (default: ten million)")
    parser.add_argument("--single", help="one of them, in this process")
    given = parser.parse_args()
    if given.single:
        print(json.dumps(single(given.single, given.members)))
        return
    print("| kept | axes | results | peak of the sweep | seconds |\n| --- | ---: | ---: | ---: | ---: |")
    for kind in KINDS:
        asked = [sys.executable, "-m", "benches.sweep_memory", "--single", kind, "--members", str(given.members)]
        told = json.loads(subprocess.run(asked, capture_output=True, text=True, check=True).stdout)
        sizes = " | ".join(f"{told[name] / 2**20:.0f} MiB" for name in ("axes", "results", "peak"))
        print(f"| {kind} | {sizes} | {told['seconds']:.1f} |", flush=True)


if __name__ == "__main__":
    main()
