"""Ten speeds of stepwell beside C in a minute, and whether one has become less: ``python -m benches.gate``, or ``make gate``.

A ratio is the processor time of a yardstick by that of stepwell, sample by sample in turns, so what disturbs the machine disturbs
both. The yardstick is the same work by C that rounds as stepwell does; what C has no form of has other, fixed work beside it.
Ratios differ between CPUs, so ``gate.json`` holds what is expected for each CPU level, and of which machine; ``--keep`` writes
this one's.

A row fails if its spread, the middle half of its ratios, is all below 0.9 of what is expected.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw

from .compare import machine, peers, report, runner
from .compare.chosen import contestants, orbits
from .compare.peers import c_peer, stepwell_peer
from .compare.workloads import (
    Workload,
    w1_false_euler,
    w2_pendulums,
    w3_figure_eight,
    w4_one_system,
    w6_three_bodies,
    w7_own_equations,
    w8_cloth,
    w9_float32,
)
from .stiff.measuring import seconds

KEPT = Path(__file__).with_suffix(".json")
#: A ratio may be so much of what is expected; and how many samples there are, whose first is not counted.
LEAST, TURNS = 0.9, 31

Call = Callable[[], Any]


@sw.system
def driven(t, v, y, *, amplitude=1.0):
    """The pendulums of W2 as an own equation."""
    return amplitude * np.sin(w2_pendulums.FREQUENCY * t) - np.sin(y) - 2.0 * w2_pendulums.DAMPING * v


def own(data: Any) -> sw.System:
    """With the members' own drives."""
    return driven(amplitude=data["amplitude"])


def ready(contestant: peers.Contestant, work: Workload) -> Call:
    """What does a work, checked."""
    row, call = runner.prepare(contestant, work, quick=True)
    if call is None:
        raise peers.MissingPeerError(f"{contestant.name}: {row.missing}")
    return call.call


def by(name: str, work: Workload) -> Call:
    """That of a contestant of the comparison."""
    return ready(next(each for each in peers.catalogue() if each.name == name), work)


def c(work: Workload) -> Call:
    """C with the same arithmetic, in the form that takes the least processor time: other programs must not choose it."""
    forms = [form.made(work).call for form in c_peer.FORMS[work.kind](work, True, True)]
    return min(forms, key=lambda call: min(seconds(call) for _ in range(5)))


def beside_c(work: Workload) -> tuple[Call, Call]:
    """stepwell, and C with the same arithmetic."""
    return by("stepwell, 1 thread", work), c(work)


def own_equation() -> tuple[Call, Call]:
    """Pendulums of an own equation; C has them, too."""
    work = w2_pendulums.make("rk4").cut(members=2000)
    made = functools.partial(stepwell_peer.made, own, "rk4", {"threads": 1})
    return ready(peers.Contestant("own equation", {work.kind: made}), work), c(work)


def adaptive_steps() -> tuple[Call, Call]:
    """Orbits with steps of their own, beside oscillators by C."""
    solve = contestants.ours(orbits.kepler(1000, 1), "dop853")
    return lambda: solve(1e-6), c(w1_false_euler.make(20_000, 1000))


def prepared_run() -> tuple[Call, Call]:
    """A short run that is prepared, beside the same in pure Python."""
    run = sw.prepare(sw.Oscillator(), "false_euler", v=0.0, y=1.0, dt=0.01, steps=20)
    return lambda: run(0.0, 1.0), by("pure Python", w1_false_euler.make(1, 20))


def first_call() -> tuple[Call, Call]:
    """An equation that was never seen before, traced and compiled, beside NumPy's steps of another one."""
    count, start = itertools.count(), np.linspace(-1.0, 1.0, 64)

    def ours() -> None:
        stiffer = 1.0 + 1e-6 * next(count)  # a number of the machine code

        @sw.system
        def spring(t, v, y, *, damping=0.1):
            return -stiffer * y - damping * v * v * v - np.sin(y)

        sw.integrate(spring(), "rk4", v=start, y=start, dt=0.01, steps=500, threads=1)

    lorenz = next(work for work in w7_own_equations.WORKLOADS if work.kind == "own_lorenz").cut(members=64)
    return ours, lambda: lorenz.by_rk4(50)


#: What makes a row ready: stepwell's call, and that of the yardstick.
ROWS: dict[str, Callable[[], tuple[Call, Call]]] = {
    "20 000 oscillators, False Euler": lambda: beside_c(w1_false_euler.make(20_000, 1000)),
    "20 000 oscillators in float32": lambda: beside_c(w9_float32.WORKLOADS[0].cut(members=20_000)),
    "own equation: 2000 driven pendulums, Runge-Kutta 4": own_equation,
    "1000 systems of three bodies, leapfrog": lambda: beside_c(w6_three_bodies.WORKLOADS[0].cut(members=1000, steps=500)),
    "1024 bodies, leapfrog": lambda: beside_c(w4_one_system.ONE[1].cut(steps=20)),
    "a cloth of 1984 springs, leapfrog": lambda: beside_c(w8_cloth.WORKLOADS[0].cut(steps=200)),
    "one figure-eight, 100 000 steps of leapfrog": lambda: beside_c(w3_figure_eight.make("leapfrog").cut(steps=100_000)),
    "1000 orbits, adaptive steps, beside C's oscillators": adaptive_steps,
    "a prepared run of 20 steps, beside pure Python": prepared_run,
    "first call of an own equation, beside NumPy": first_call,
}


def ratios(ours: Call, yardstick: Call, turns: int = TURNS) -> list[float]:
    """The times of the yardstick by those of stepwell: processor time, of calls that last long enough."""
    calls = [(call, max(1, round(runner.SAMPLE / max(1e-6, seconds(call, 3))))) for call in (ours, yardstick)]
    times = [[seconds(call, number) for call, number in calls] for _ in range(turns)]
    return [theirs / own for own, theirs in times[1:]]


def judged(measured: dict[str, list[float]], expected: dict[str, float]) -> Iterator[tuple[list[str], bool]]:
    """A line for each row, and whether it fails."""
    for name, each in measured.items():
        low, middle, high = np.quantile(each, (0.25, 0.5, 0.75))
        wanted = expected.get(name, float("nan"))
        fails = high < LEAST * wanted
        shown = "—" if np.isnan(wanted) else f"{middle / wanted:.2f}"
        yield [name, f"{middle:.3g}", f"{low:.3g} … {high:.3g}", f"{wanted:.3g}", shown, "fails" if fails else ""], bool(fails)


def main(arguments: list[str] | None = None) -> int:
    """The exit status: 1 if a row fails."""
    parser = argparse.ArgumentParser(prog="python -m benches.gate", description=__doc__)
    parser.add_argument("--keep", action="store_true", help="expect from now on, at this CPU level, what is measured now")
    asked = parser.parse_args(arguments)
    kept, level = json.loads(KEPT.read_text(encoding="utf-8")), sw.isa()
    with runner.heard():
        measured = {name: ratios(*make()) for name, make in ROWS.items()}
    if asked.keep:
        medians = {name: round(float(np.median(each)), 3) for name, each in measured.items()}
        kept[level] = {"machine": f"{machine.cpu()}, {machine.describe()[0][1]}", "ratios": medians}
        KEPT.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    expected = kept.get(level, {"machine": "no machine yet: `--keep` writes this one's", "ratios": {}})
    lines, failures = zip(*judged(measured, expected["ratios"]), strict=True)
    title = f"Speed beside C, {level}, on {machine.cpu()}; expected: {expected['machine']}"
    text = report.markdown(title, ["", "ratio", "spread", "expected", "÷ expected", ""], list(lines))
    print(text)
    if summary := os.environ.get("GITHUB_STEP_SUMMARY"):
        with open(summary, "a", encoding="utf-8") as file:
            file.write(text)
    return int(any(failures))


if __name__ == "__main__":
    sys.exit(main())
