"""Where the time of a call goes: ``python -m benches.stages``. On one thread.

Oscillators by False Euler, 1000 steps; and one Arenstorf orbit, once round, with a tolerance.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import stepwell as sw
from stepwell import _core
from stepwell.runs import engine, short_runs
from stepwell.scenes.builtin.arenstorf import MU

from .compare.chosen.orbits import arenstorf

#: The tolerance of a short orbit.
ROUGH = 1e-6

#: A short run, and how it can be made.
SHORT_TITLE, SHORT_STEPS = "A short run: one oscillator, False Euler, 20 steps", 20
HEAD = ["stage, µs", "one oscillator", "1000", "100 000"]
TITLE = "A call by stages: oscillators, False Euler, 1000 steps"
MEMBERS = (1, 1000, 100_000)
STEPS = 1000
#: Methods and the tolerance of adaptive steps.
ABLE, TOLERANCE = ("fehlberg", "dop853", "taylor"), 1e-9
#: Each time is the least of so many, each over calls that together last this long, in seconds.
REPEATS, SAMPLE = 7, 0.01


def least(call: Callable[[], Any]) -> float:
    """The least time of a call, in microseconds."""
    begin = time.perf_counter()
    call()
    calls = max(1, round(SAMPLE / (time.perf_counter() - begin)))
    taken = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        for _ in range(calls):
            call()
        taken.append((time.perf_counter() - begin) / calls)
    return 1e6 * min(taken)


def stages(members: int) -> dict[str, float]:
    """The times of all stages for so many members."""
    omega = np.linspace(0.5, 2.0, members) if members > 1 else 1.0
    v, y = (np.zeros(members), np.ones(members)) if members > 1 else (0.0, 1.0)
    system, method = sw.Oscillator(omega), sw.method("false_euler")
    inside: list[float] = []
    run = _core.run

    def timed(*given: Any) -> bool:
        begin = time.perf_counter()
        made = run(*given)
        inside.append(1e6 * (time.perf_counter() - begin))
        return made

    def call(steps: int) -> sw.Run:
        short_runs._kept.clear()  # as at the first call: later ones are in the table of short runs
        return sw.integrate(system, method, v=v, y=y, dt=0.01, steps=steps, threads=1)

    within: dict[int, float] = {}
    around = 1e12
    calls = REPEATS * max(1, round(1e6 * SAMPLE / least(lambda: call(STEPS))))
    try:
        engine._core.run = timed
        for _ in range(calls):  # in turns, so that what disturbs the machine disturbs both
            for steps in (STEPS, 2 * STEPS):
                begin = time.perf_counter()
                call(steps)
                around = min(around, 1e6 * (time.perf_counter() - begin) - inside[-1])
                within[steps] = min(within.get(steps, 1e12), inside[-1])
    finally:
        engine._core.run = run
    stepping = within[2 * STEPS] - within[STEPS]
    plan = engine.Plan(system, method, system.batch, 0.01, steps=STEPS)
    told = [_core.compiled(engine.model(plan), members) for _ in range(REPEATS)]
    return {
        "once for a system and method: tracing the step": 1e6 * min(each["trace"] for each in told if each),
        "once for a system and method: writing machine code": 1e6 * min(each["compile"] for each in told if each),
        "making the system: checks of its parameters": least(lambda: sw.Oscillator(omega)),
        "checks of arguments, plan, result object": around,
        "gathering parameters and states, storing results, threads": within[STEPS] - stepping,
        "steps": stepping,
    }


def adaptive_stages(name: str) -> dict[str, float]:
    """The times of all stages of a call with a tolerance."""
    one = arenstorf(1)
    v, y, system, method = one.v[:, 0], one.y[:, 0], sw.RestrictedThreeBody(MU), sw.method(name)
    inside: list[float] = []
    adapt = _core.adapt

    def timed(*given: Any) -> bool:
        begin = time.perf_counter()
        made = adapt(*given)
        inside.append(1e6 * (time.perf_counter() - begin))
        return made

    def call(end: float) -> sw.Run:
        short_runs._kept.clear()
        return sw.integrate(system, method, v=v, y=y, tolerance=TOLERANCE, at=[end], threads=1)

    within, around = {0.0: 1e12, one.end: 1e12}, 1e12
    calls = REPEATS * max(1, round(1e6 * SAMPLE / least(lambda: call(one.end))))
    try:
        engine._core.adapt = timed
        for _ in range(calls):  # in turns, as above
            for end in within:
                begin = time.perf_counter()
                call(end)
                around = min(around, 1e6 * (time.perf_counter() - begin) - inside[-1])
                within[end] = min(within[end], inside[-1])
    finally:
        engine._core.adapt = adapt
    return {
        "checks of arguments, plan, result object": around,
        "gathering parameters and states, first step, storing results": within[0.0],
        "steps": within[one.end] - within[0.0],
    }


def short_table() -> tuple[str, list[str], list[list[str]]]:
    """A short run by ``integrate``, for the first time and later, and by ``prepare``."""
    system, method = sw.Oscillator(), sw.method("false_euler")
    options: Any = {"v": 0.0, "y": 1.0, "dt": 0.01, "steps": SHORT_STEPS}
    again = sw.prepare(system, method, **options)
    ways: dict[str, Callable[[], Any]] = {
        "`integrate`, of a new system each time": lambda: sw.integrate(sw.Oscillator(), method, **options),
        "`integrate`, of the same system": lambda: sw.integrate(system, method, **options),
        "`prepare(…)(v, y)`": lambda: again(0.0, 1.0),
    }
    return SHORT_TITLE, ["way", "µs"], [[name, f"{least(call):.3g}"] for name, call in ways.items()]


def short_orbit_table() -> tuple[str, list[str], list[list[str]]]:
    """One Arenstorf orbit, for the first time and later, and by ``prepare``."""
    one = arenstorf(1)
    v, y, system, rows = one.v[:, 0].copy(), one.y[:, 0].copy(), sw.RestrictedThreeBody(MU), []
    for name in ABLE:
        options: Any = {"v": v, "y": y, "tolerance": ROUGH, "at": [one.end]}
        again = sw.prepare(system, name, **options)
        ways: list[Callable[[], Any]] = [
            lambda name=name, options=options: sw.integrate(sw.RestrictedThreeBody(MU), name, **options),
            partial(sw.integrate, system, name, **options),
            partial(again, v, y),
        ]
        rows.append([f"{least(call):.3g}" for call in ways])
    names = ["`integrate`, of a new system each time", "`integrate`, of the same system", "`prepare(…)(v, y)`"]
    title = f"A short run: one Arenstorf orbit, tolerance {ROUGH:g}"
    return title, ["way, µs", *ABLE], [[name, *row] for name, row in zip(names, zip(*rows, strict=True), strict=True)]


def adaptive_table() -> tuple[str, list[str], list[list[str]]]:
    """Those of a call with a tolerance, a column for each method."""
    found = [adaptive_stages(name) for name in ABLE]
    title = f"A call by stages: one Arenstorf orbit, tolerance {TOLERANCE:g}"
    return title, ["stage, µs", *ABLE], [[name, *(f"{each[name]:.3g}" for each in found)] for name in found[0]]


def table() -> tuple[str, list[str], list[list[str]]]:
    """All of it, a row for each stage."""
    found = [stages(members) for members in MEMBERS]
    return TITLE, HEAD, [[name, *(f"{each[name]:.3g}" for each in found)] for name in found[0]]


if __name__ == "__main__":
    from .compare import report

    report.show(*table())
    report.show(*short_table())
    report.show(*adaptive_table())
    report.show(*short_orbit_table())
