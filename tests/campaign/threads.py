"""Threads that share what users share: ``python -m campaign.threads --seconds 60``, in the folder of tests.

With the GIL, and with a Python that has none. Every number is compared with that of one thread alone; what may be refused is
refused by stepwell's own error, and what is refused was not done.
"""

import argparse
import copy
import pickle
import sys
import sysconfig
import threading
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import stepwell as sw

THREADS = 8


def together(act: Callable[[int], Any], threads: int = THREADS) -> list[Any]:
    """What each thread returns; they begin at once. What one raises is raised."""
    results: list[Any] = [None] * threads
    wrong: list[BaseException] = []
    begin = threading.Barrier(threads)

    def one(i: int) -> None:
        begin.wait()
        try:
            results[i] = act(i)
        except BaseException as error:
            wrong.append(error)

    every = [threading.Thread(target=one, args=(i,)) for i in range(threads)]
    for each in every:
        each.start()
    for each in every:
        each.join()
    if wrong:
        raise wrong[0]
    return results


def same(one: Any, other: Any) -> None:
    """Raise unless two arrays have the same bits."""
    if np.asarray(one).tobytes() != np.asarray(other).tobytes():
        raise AssertionError(f"{one} is not {other}")


def one_system(turn: int) -> int:
    """One system, and one array of starts, for all threads."""
    system, y = sw.Oscillator(np.linspace(0.5, 1.5, 300)), np.linspace(0.0, 1.0, 300)
    method = ("rk4", "verlet", "false_euler", "merson")[turn % 4]

    def run(i: int) -> Any:
        return sw.integrate(system, method, v=0.0, y=y, dt=0.1, steps=50 + 7 * turn, every=5, threads=1 + i % 3)

    alone = run(0)
    for result in together(run):
        same(result.v, alone.v)
        same(result.y, alone.y)
    return THREADS


def new_systems(turn: int) -> int:
    """Every thread brings own equations that were never traced, some of them the same: one cache takes them all."""

    def integrated(i: int) -> Any:
        shift, factor = float(i % 3), 1.0 + turn % 50

        @sw.system
        def rates(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
            return -k * np.sin(y + shift) * factor + shift

        return sw.integrate(rates(k=1.5), "rk4", v=0.0, y=[0.1, 0.2, 0.3], dt=0.01, steps=2000)

    runs = together(integrated)
    for i, run in enumerate(runs):
        same(run.y, integrated(i).y)
    return THREADS


def one_world(_: int) -> int:
    """All threads step one world: each call is made whole or refused, and none is lost."""
    v, y = np.zeros(50), np.linspace(0.0, 1.0, 50)
    world = sw.World(sw.Pendulum(), "verlet", v=v.copy(), y=y.copy(), dt=0.01)

    def step(i: int) -> int:
        done = 0
        for _ in range(200):
            try:
                world.step(1 + i)
                done += 1 + i
            except sw.errors.BusyError:
                pass
        return done

    done = sum(together(step))
    if done != world.step_number:
        raise AssertionError(f"{done} steps were made, and the world stands at {world.step_number}")
    alone = sw.World(sw.Pendulum(), "verlet", v=v, y=y, dt=0.01)
    alone.step(done)
    same(world.v, alone.v)
    same(world.y, alone.y)
    return 200 * THREADS


def long_world(_: int) -> int:
    """The same with a world whose steps release the GIL, and with others that read it meanwhile."""
    v, y = np.zeros(5000), np.linspace(0.0, 1.0, 5000)
    world = sw.World(sw.Pendulum(), "rk4", v=v.copy(), y=y.copy(), dt=0.01)

    def act(i: int) -> int:
        done = 0
        for _ in range(20):
            try:
                if i % 2:
                    world.step(300)
                    done += 300
                else:
                    repr(world), world.t, world.step_number
                    copied = copy.copy(world)
                    if copied.v.shape != v.shape:
                        raise AssertionError(f"a copy of shape {copied.v.shape}")
            except sw.errors.BusyError:
                pass
        return done

    done = sum(together(act))
    alone = sw.World(sw.Pendulum(), "rk4", v=v, y=y, dt=0.01)
    alone.step(done)
    same(world.y, alone.y)
    return 20 * THREADS


def one_run(_: int) -> int:
    """All threads ask one run."""
    run = sw.integrate(sw.NBody([1.0, 2.0, 3.0], softening=0.2), "rk4", v=0.0, y=np.eye(3, 2), dt=0.01, steps=30, every=3)
    energy, text, data = run.energy, repr(run), pickle.dumps(run)

    def ask(i: int) -> None:
        for _ in range(20):
            same(run.energy, energy)
            same(run.quantity("momentum"), run.quantity("momentum"))
            if repr(run) != text or pickle.loads(data) != run or hash(run) != hash(pickle.loads(data)):
                raise AssertionError("a run has changed")
            rest = sw.integrate(run.system, run.method, steps=i + 1, resume=run)
            if rest.start_step != 30:
                raise AssertionError(rest)

    together(ask)
    return 20 * THREADS


def large_results(_: int) -> int:
    """Memory of large results is lent from run to run: never to two at once."""

    def make(i: int) -> None:
        for k in range(10):
            run = sw.integrate(sw.Oscillator(1.0 + i), "false_euler", v=0.0, y=1.0, dt=0.01, steps=20_000 + k, every=1)
            copied = run.y.copy()
            other = sw.integrate(sw.Oscillator(2.0 + i), "false_euler", v=0.0, y=1.0, dt=0.01, steps=20_000 + k, every=1)
            same(run.y, copied)
            del other

    together(make)
    return 20 * THREADS


def adaptive_and_events(_: int) -> int:
    """Adaptive steps, series, events, exports, explanations and stability at once."""

    def crossing(t: Any, v: Any, y: Any) -> Any:
        return y

    acts: list[Callable[[], Any]] = [
        lambda: sw.integrate(sw.Pendulum(), "dop853", v=0.0, y=[1.0, 2.0], tolerance=1e-6, at=[1.0, 5.0]).y,
        lambda: sw.integrate(sw.Pendulum(), "taylor", v=0.0, y=[1.0, 2.0], tolerance=1e-9, at=[1.0, 5.0]).y,
        lambda: sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=60, events=crossing).events["crossing"].t,
        lambda: np.frombuffer(sw.export(sw.Pendulum(), "rk4", "c").source.encode(), np.uint8),
        lambda: np.frombuffer(str(sw.explain(sw.Pendulum(), "rk4")).encode(), np.uint8),
        lambda: np.array(sw.analyse(sw.Pendulum(), "rk4", dt=0.1, at=(0.0, 1.0)).radius),
        lambda: sw.jacobian(sw.Pendulum(), v=0.0, y=1.0).rates,
        lambda: sw.integrate(sw.Chain(50), "verlet", v=0.0, y=np.arange(50.0), dt=0.1, steps=30, form="matrix").y,
    ]
    alone = [act() for act in acts]
    for i, result in enumerate(together(lambda i: acts[i % len(acts)]())):
        same(result, alone[i % len(acts)])
    return THREADS


def shared_arrays(_: int) -> int:
    """Two worlds over the same arrays, and runs that begin with them: one at a time has them, and the others are told."""
    v, y = np.zeros(5000), np.linspace(0.0, 1.0, 5000)
    system = sw.Pendulum()
    worlds = [sw.World(system, name, v=v, y=y, dt=0.001) for name in ("rk4", "false_euler")]
    acts: tuple[Callable[[], Any], ...] = (
        lambda: worlds[0].step(300),
        lambda: worlds[1].step(300),
        lambda: sw.integrate(system, "rk4", v=v, y=y, dt=0.001, steps=200),
        lambda: sw.integrate(system, "merson", v=v, y=y, tolerance=1e-3, at=[0.01]),
        lambda: sw.World(system, "rk4", v=v, y=y, dt=0.001),
    )

    def act(i: int) -> int:
        refused = 0
        for _ in range(30):
            try:
                acts[i % len(acts)]()
            except sw.errors.BusyError:
                refused += 1
        return refused

    refused = sum(together(act))
    if not (np.isfinite(v).all() and np.isfinite(y).all() and abs(v).max() < 2.0):
        raise AssertionError("states that no thread made")
    if refused == 30 * THREADS:
        raise AssertionError("everything was refused")
    return 30 * THREADS


CHECKS = (shared_arrays, one_system, new_systems, one_world, long_world, one_run, large_results, adaptive_and_events)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    gil = getattr(sys, "_is_gil_enabled", lambda: True)()
    print(
        f"Python {sys.version.split()[0]}, built without GIL: {bool(sysconfig.get_config_var('Py_GIL_DISABLED'))}, GIL now: {gil}"
    )
    sys.setswitchinterval(1e-5)  # with the GIL: let others run as often as can be
    until, counts, turn = time.monotonic() + args.seconds, dict.fromkeys(CHECKS, 0), 0
    while time.monotonic() < until or turn == 0:
        for check in CHECKS:
            counts[check] += check(turn)
        turn += 1
    for check, count in counts.items():
        print(f"{check.__name__}: {count} calls by {THREADS} threads, every bit as by one")


if __name__ == "__main__":
    main()
