"""Memory over many runs: ``python -m campaign.memory --runs 100000``, in the folder of tests.

Each kind of run is made so many times in a process of its own. After a tenth of them everything that is kept once (imports,
tapes, kernels, the allocator's own room) is there; what the process has at the end beyond that is a leak.
"""

import argparse
import gc
import json
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw

#: What may be more at the end, in kilobytes: pieces of free memory between used ones move about. A leak of 21 bytes a run passes
#: it in 100 000 runs, and the smallest piece that the allocator gives takes 32.
MOST_MORE = 2048

#: Where every run fills the caches of tapes and kernels: they are emptied at 200 000 operations, so memory goes up and down by
#: what so many take, about 60 bytes each.
FULL_CACHE = 12 * 1024


class State(NamedTuple):
    """What a process has: resident memory in kilobytes, executable mappings, threads, open files."""

    kilobytes: int
    executable: int
    threads: int
    files: int


def state() -> State:
    """Of this process, now."""
    gc.collect()
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    maps = Path("/proc/self/maps").read_text().splitlines()
    executable = sum("x" in line.split()[1] for line in maps)
    files = len(list(Path("/proc/self/fd").iterdir()))
    return State(int(status["VmRSS"].split()[0]), executable, int(status["Threads"]), files)


FREE: dict[str, Any] = {"system": sw.Oscillator(), "method": "rk4", "v": 0.0, "y": 1.0, "dt": 0.1}
MANY = sw.Oscillator(np.linspace(0.5, 1.5, 1000))
BODIES = sw.NBody(np.full(40, 0.1), force="newton", softening=0.3)
PLACES = np.random.default_rng(1).normal(size=(40, 2))
PENDULUM = sw.Pendulum()
FOLDER = mkdtemp(prefix="stepwell-memory-")


def passage(t: Any, v: Any, y: Any) -> Any:
    """When a pendulum is upright."""
    return y


def _refused(_: int) -> None:
    try:
        sw.integrate(**FREE | {"dt": float("nan")}, steps=3)
    except sw.StepwellError:
        return


def _world(_: int) -> None:
    world = sw.World(sw.Oscillator(), "rk4", v=np.zeros(3), y=np.ones(3), dt=0.1)
    world.step(3)


def _own(i: int) -> None:
    """A system that nobody has had yet, so that its tapes and its machine code are made."""

    def rates(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        for _ in range(i % 20):
            y = y * k
        return -y * (1.0 + i) - k * v

    sw.integrate(sw.system(rates)(k=np.ones(3)), "rk4", v=0.0, y=1.0, dt=1e-9, steps=2000)


def _files(i: int) -> None:
    path = Path(FOLDER) / "run.npz"
    sw.integrate(**FREE, steps=3, every=1).save(path)
    sw.load(path)


LOOP = sw.World(MANY, "verlet", v=np.zeros(1000), y=np.ones(1000), dt=0.1)

#: Each kind, and which share of the runs is made of it: the dearer ones have fewer.
KINDS: dict[str, tuple[Callable[[int], Any], float]] = {
    "one member": (lambda _: sw.integrate(**FREE, steps=3), 1.0),
    "every state": (lambda _: sw.integrate(**FREE, steps=70, every=1), 1.0),
    "1000 members, two threads": (lambda _: sw.integrate(MANY, "rk4", v=0.0, y=1.0, dt=0.1, steps=300, threads=2), 0.2),
    "large results": (lambda _: sw.integrate(MANY, "false_euler", v=0.0, y=1.0, dt=0.1, steps=200, every=2), 0.05),
    "by the matrix": (lambda _: sw.integrate(**FREE, steps=3, form="matrix"), 0.3),
    "fused, recorded, forced": (lambda _: sw.integrate(**FREE, steps=3, fused=True, record="energy", force=0.1), 1.0),
    "adaptive": (lambda _: sw.integrate(PENDULUM, "dop853", v=0.0, y=1.0, tolerance=1e-6, at=[1.0, 2.0]), 1.0),
    "a series": (lambda _: sw.integrate(PENDULUM, "taylor", v=0.0, y=1.0, tolerance=1e-9, at=[1.0, 2.0]), 0.3),
    "events": (lambda _: sw.integrate(PENDULUM, "rk4", v=0.0, y=1.0, dt=0.1, steps=30, events=passage), 0.05),
    "40 bodies": (lambda _: sw.integrate(BODIES, "verlet", v=0.0, y=PLACES, dt=0.001, steps=2), 0.3),
    "worlds": (_world, 1.0),
    "one world": (lambda _: LOOP.step(3), 1.0),
    "refused": (_refused, 1.0),
    "diverged": (lambda _: sw.integrate(sw.Oscillator(50.0), "rk4", v=0.0, y=1.0, dt=1.0, steps=200), 0.3),
    "new systems": (_own, 0.05),
    "files": (_files, 0.05),
    "a question about stability": (lambda _: sw.analyse(PENDULUM, "rk4", dt=0.1, at=(0.0, 1.0)), 0.02),
    "explanations": (lambda _: str(sw.explain(PENDULUM, "rk4")), 0.02),
}


def runs(kind: str, many: int, act: Callable[[int], Any] | None = None) -> tuple[int, State, State]:
    """How many runs were made, what the process had after a tenth (or a half) of them, and what it had at the end."""
    share = 1.0
    if act is None:
        act, share = KINDS[kind]
    count = max(int(many * share), 10)
    warnings.simplefilter("ignore")
    first = count // 2 if kind == "new systems" else count // 10
    for i in range(first):
        act(i)
    before = state()
    for i in range(first, count):
        act(i)
    return count, before, state()


def wrong(kind: str, before: State, after: State) -> str:
    """What there is more of; nothing if there is not."""
    more = []
    if after.kilobytes > before.kilobytes + (FULL_CACHE if kind == "new systems" else MOST_MORE):
        more.append(f"{after.kilobytes - before.kilobytes} kB")
    for name in ("threads", "files"):
        if getattr(after, name) > getattr(before, name):
            more.append(f"{getattr(after, name) - getattr(before, name)} {name}")
    return ", ".join(more)


def aside(kind: str, many: int) -> tuple[int, State, State]:
    """The same in a process of its own."""
    words = [sys.executable, "-m", "campaign.memory", "--kind", kind, "--runs", str(many)]
    done = subprocess.run(words, cwd=Path(__file__).parent.parent, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{kind}: ended with {done.returncode}: {done.stderr[-1000:]}")
    count, before, after = json.loads(done.stdout)
    return count, State(*before), State(*after)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100_000)
    parser.add_argument("--kind", choices=list(KINDS), help="this kind alone, in this process")
    args = parser.parse_args()
    if args.kind:
        print(json.dumps(runs(args.kind, args.runs)))
        return
    bad = 0
    print("| kind | runs | memory after a tenth, kB | at the end, kB | executable mappings | threads | files |")
    print("|---|---|---|---|---|---|---|")
    for kind in KINDS:
        count, before, after = aside(kind, args.runs)
        pairs = [f"{getattr(before, name)} → {getattr(after, name)}" for name in ("executable", "threads", "files")]
        print(f"| {kind} | {count} | {before.kilobytes} | {after.kilobytes} | {' | '.join(pairs)} |", flush=True)
        if text := wrong(kind, before, after):
            bad += 1
            print(f"MORE: {kind}: {text}")
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()
