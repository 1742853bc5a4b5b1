"""Processes that fork, are spawned, or are killed: ``python -m campaign.processes --seconds 60``, in the folder of tests."""

import argparse
import hashlib
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import stepwell as sw

#: A child that has not answered after so many seconds hangs. What it does takes some hundredths.
HANGS = 30.0

SYSTEM = sw.Oscillator(np.linspace(0.5, 1.5, 2000))


def digest(shift: float) -> str:
    """The bits of some runs: with threads, with adaptive steps, of a system that is traced anew, and of a world."""

    @sw.system
    def rates(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        return -k * np.sin(y + shift)

    world = sw.World(sw.Pendulum(), "verlet", v=np.zeros(5), y=np.linspace(0.1, 1.0, 5) + shift, dt=0.01)
    world.step(50)
    arrays = (
        sw.integrate(SYSTEM, "rk4", v=0.0, y=1.0 + shift, dt=0.1, steps=500, threads=2).y,
        sw.integrate(sw.Pendulum(), "dop853", v=0.0, y=1.0 + shift, tolerance=1e-8, at=[1.0, 3.0]).y,
        sw.integrate(rates(k=1.5), "rk4", v=0.0, y=[0.1, 0.2], dt=0.01, steps=2000).y,
        world.y,
    )
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def pool(way: str, tasks: int) -> int:
    """A pool of two processes, after this one has used threads: the bits of each task are those of this process."""
    shifts = [0.01 * i for i in range(tasks)]
    here = [digest(shift) for shift in shifts]
    with multiprocessing.get_context(way).Pool(2) as workers:
        there = workers.map_async(digest, shifts).get(timeout=HANGS + tasks)
    if here != there:
        raise AssertionError(f"{way}: other bits in other processes")
    return tasks


def forked(act: Callable[[], Any]) -> int:
    """The exit code of a forked child that does something; −1 if it hangs, and then it is killed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of forks while there are threads, which is what is tried
        child = os.fork()
    if child == 0:
        code = 1
        try:
            code = 3 if act() is False else 0
        finally:
            os._exit(code)
    until = time.monotonic() + HANGS
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.001)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -1


def busy_forks(times: int) -> int:
    """Forks while other threads trace systems, write machine code and step: the child can do all of that itself."""
    over = threading.Event()
    here = digest(0.5)

    def trace(i: int) -> None:
        k = 0
        while not over.is_set():
            k += 1

            @sw.system
            def rates(t: Any, v: Any, y: Any, shift: Any = float(10**6 * i + k)) -> Any:
                return -np.sin(y * shift)

            sw.integrate(rates, "rk4", v=0.0, y=[0.1, 0.2], dt=1e-9, steps=500)

    def run(_: int) -> None:
        while not over.is_set():
            sw.integrate(SYSTEM, "rk4", v=0.0, y=1.0, dt=0.1, steps=200, threads=2)

    workers = [threading.Thread(target=act, args=(i,), daemon=True) for i, act in enumerate((trace, trace, run))]
    for worker in workers:
        worker.start()
    try:
        codes = [forked(lambda: digest(0.5) == here) for _ in range(times)]
    finally:
        over.set()
        for worker in workers:
            worker.join()
    if any(codes):
        raise AssertionError(f"children of forks ended with {codes}; −1 is one that hung")
    return times


def forks_amid_compiling(times: int) -> int:
    """Forks while another thread traces and compiles the system that the child steps next: it does not wait for that thread."""
    codes = []
    digest(0.25)  # what is imported at first use is not what is tried: Python's own locks of imports do not survive a fork
    names = [method.name for method in sw.methods() if not method.has_series]
    draw = random.Random(times)
    for k in range(times):
        # Tapes of thousands of operations that were never asked for: n bodies, in the plane and in space, by each method.
        bodies = sw.NBody(np.ones(3 + k % 5), softening=0.3, dim=2 + k // 5 % 2, force=("newton", "logarithmic")[k // 10 % 2])
        method = names[k // 20 % len(names)]
        y = np.random.default_rng(k).normal(size=(3 + k % 5, 2 + k // 5 % 2))

        def run(bodies: Any = bodies, method: Any = method, y: Any = y) -> Any:
            return sw.integrate(bodies, method, v=0.0, y=y, dt=1e-6, steps=400)

        other = threading.Thread(target=run)
        other.start()
        time.sleep(0.003 * draw.random())
        codes.append(forked(run))
        other.join()
    if any(codes):
        raise AssertionError(f"children of forks ended with {codes}; −1 is one that hung")
    return times


#: Writes runs to one file, again and again, and says when it begins.
WRITER = """
import sys, numpy as np, stepwell as sw
print("begun", flush=True)
i = 0
while True:
    i += 1
    run = sw.integrate(sw.Oscillator(np.linspace(0.5, 1.5, 300)), "rk4", v=0.0, y=float(i % 7), dt=0.1, steps=60, every=1)
    run.save(sys.argv[1])
"""


def killed_writers(times: int, ending: str) -> int:
    """Processes that are killed while they save: afterwards there is a whole run, and it can be saved over."""
    known = {
        sw.integrate(sw.Oscillator(np.linspace(0.5, 1.5, 300)), "rk4", v=0.0, y=float(i), dt=0.1, steps=60, every=1).y.tobytes()
        for i in range(7)
    }
    draw = random.Random(1)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"run{ending}"
        for _ in range(times):
            writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE)
            writer.stdout.readline()
            time.sleep(0.05 + 0.2 * draw.random() if path.exists() else 1.0)
            writer.kill()
            writer.wait()
            writer.stdout.close()
            # A folder takes the place of another by two renames: killed between them, neither is at its place (see Run.save).
            if ending == ".zarr" and not path.exists():
                continue
            if sw.load(path).y.tobytes() not in known:
                raise AssertionError("a saved run is none of those that were saved")
    return times


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=100)
    args = parser.parse_args()
    print(f"spawned: {pool('spawn', 8)} tasks, every bit as here", flush=True)
    print(f"forked after threads: {pool('fork', args.times)} tasks, every bit as here", flush=True)
    print(f"forked while threads trace and step: {busy_forks(args.times)} children", flush=True)
    print(f"forked while the same system is compiled: {forks_amid_compiling(args.times)} children", flush=True)
    for ending in (".npz", ".zarr"):
        print(f"killed while saving {ending}: {killed_writers(args.times, ending)} times", flush=True)


if __name__ == "__main__":
    main()
