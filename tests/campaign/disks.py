"""Disks that are full, that cannot be written, or that are taken away while something is saved.

Each way to write a file is tried with several limits of its size, from nothing to enough. What is there before stays as it was,
nothing is left beside it, and the error says what is wrong.
"""

import json
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw


def a_run(y: float) -> sw.Run:
    """A run whose file has some 20 kB."""
    return sw.integrate(sw.Oscillator(np.linspace(0.5, 1.5, 60)), "rk4", v=0.0, y=y, dt=0.1, steps=20, every=1)


def a_sweep(path: Path, y: float) -> None:
    """A sweep of four chunks into a store."""
    axes = {"omega": ("omega", [1.0, 2.0, 3.0, 4.0])}
    dataset = sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=y, dt=0.1, steps=40, every=1, store=path, chunk=1)
    dataset.close()


#: Ways to write: the name of the file or folder, and what writes it with a number in it.
WAYS: dict[str, tuple[str, Callable[[Path, float], Any]]] = {
    "a run": ("run.npz", lambda path, y: a_run(y).save(path)),
    "a run in a folder": ("run.zarr", lambda path, y: a_run(y).save(path)),
    "a step": ("step.c", lambda path, y: sw.export(sw.Oscillator(1.0 + y), "rk4", "c").save(path)),
    "a page": ("page.html", lambda path, y: sw.explore("oscillator", methods=["rk4"] if y else ["verlet"]).save(path)),
}

#: The same of what goes on where it was when there is room again.
SWEEPS = {"a sweep": ("sweep.zarr", a_sweep), "a sweep in one file": ("sweep.nc", a_sweep)}


def contents(folder: Path) -> dict[str, bytes]:
    """Every file in a folder, by its path."""
    return {str(each.relative_to(folder)): each.read_bytes() for each in sorted(folder.rglob("*")) if each.is_file()}


def tried(way: str, folder: Path, limit: int) -> str:
    """Write, where no file may have more bytes than that: an empty text, or what the error says."""
    name, write = (WAYS | SWEEPS)[way]
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        write(folder / name, 1.0)
    except (sw.StepwellError, OSError) as error:
        return f"{type(error).__name__}: {error}"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    return ""


def main() -> None:
    """In this process: write in one way, with one limit, and tell what was said."""
    way, folder, limit = sys.argv[1:]
    print(json.dumps(tried(way, Path(folder), int(limit))))


def aside(way: str, folder: Path, limit: int) -> str:
    """The same in a process of its own: other threads of this one, such as those of zarr, write files as well."""
    words = [sys.executable, "-W", "ignore", "-m", "campaign.disks", way, str(folder), str(limit)]
    done = subprocess.run(words, cwd=Path(__file__).parent.parent, capture_output=True, text=True, timeout=120)
    if done.returncode:
        raise RuntimeError(f"{way}, {limit} bytes: ended with {done.returncode}: {done.stderr[-1500:]}")
    return str(json.loads(done.stdout.splitlines()[-1]))


if __name__ == "__main__":
    main()
