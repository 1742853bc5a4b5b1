"""What every step becomes, and how long that takes: ``python -m benches.compile``, or with names of methods behind it.

Operations are sums, products, quotients and roots of a member in a step: as the document writes them, and as they are computed;
then the machine code for very many members, what it keeps beside the registers, and the times of tracing and of writing the
code, each the best of several.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw
from stepwell import _core
from stepwell.runs import engine

MEMBERS, REPEATS = 100_000, 5
SINE, HELD = sw.Sinusoid(0.5, 1.1, 0.3), sw.Sampled(np.linspace(-1.0, 1.0, 16), 0.02)
OMEGA = np.linspace(0.5, 2.0, MEMBERS)

#: Each kind of system that is small enough to become one tape.
SYSTEMS: dict[str, sw.System] = {
    "oscillator": sw.Oscillator(OMEGA),
    "oscillator, damped, sine": sw.Oscillator(OMEGA, 0.1, a=SINE),
    "oscillator, held": sw.Oscillator(OMEGA, form="physical", x=HELD),
    "pendulum": sw.Pendulum(OMEGA),
    "pendulum, damped, sine": sw.Pendulum(1.3, 0.1, a=SINE),
    "restricted three bodies": sw.RestrictedThreeBody(),
    "two bodies": sw.NBody([1.0, 0.5], force="newton"),
    "three bodies": sw.NBody(),
    "three bodies in space": sw.NBody(force="newton", dim=3),
    "chain of 4": sw.Chain(4),
    "linear of 4": sw.LinearSystem(np.cos(np.arange(16.0)).reshape(4, 4) / 4 - np.eye(4), velocities=2),
}
# Under control, from the clover's start.
TURNING, TRIANGLE = np.array([[-1.0, 0.5], [-0.5, -0.9], [1.0, 0.0]]), np.array([[-0.5, -0.9], [0.9, -0.5], [0.0, 1.0]])
SYSTEMS["three bodies, controlled"] = sw.NBody().controlled(sw.EnergyControl(gain=0.3), TURNING, TRIANGLE, 1e-3)


class Row(NamedTuple):
    """A line of the table."""

    system: str
    method: str
    written: int
    computed: int
    bytes: int
    spills: int
    trace: float
    compile: float


def arithmetic(counts: dict[str, int]) -> int:
    """Sums, products, quotients and roots."""
    return sum(counts[kind] for kind in ("additions", "multiplications", "divisions", "square_roots"))


def compiled(system: sw.System, method: sw.Method, members: int = MEMBERS, repeats: int = REPEATS) -> dict[str, Any] | None:
    """What the core tells, with the shortest times of several."""
    model = engine.model(engine.Plan(system, method, (members,), 1e-3))
    told = [_core.compiled(model, members) for _ in range(repeats)]
    times = {key: min(each[key] for each in told if each) for key in ("trace", "compile") if told[0]}
    return told[0] and {**told[0], **times}


def rows(methods: list[str] | None = None, repeats: int = REPEATS) -> Iterator[Row]:
    """Every system with every method that can step it, as far as a step is one tape."""
    for name, system in SYSTEMS.items():
        for method in sw.methods():
            able = not method.needs_acceleration or (system.second_order and not system.velocity_term)
            if not able or (methods and method.name not in methods):
                continue
            told = compiled(system, method, repeats=repeats)
            if told:
                counts = arithmetic(told["written"]), arithmetic(told["computed"])
                yield Row(name, method.name, *counts, told["bytes"], told["spills"], told["trace"], told["compile"])


def main() -> None:
    """Print the table."""
    print(f"{sw.isa()}, {MEMBERS} members, best of {REPEATS}")
    print(
        f"{'system':<26}{'method':<17}{'written':>8}{'computed':>9}{'bytes':>8}{'spills':>7}{'trace, µs':>11}{'compile, µs':>13}"
    )
    for row in rows(sys.argv[1:]):
        print(
            f"{row.system:<26}{row.method:<17}{row.written:>8}{row.computed:>9}{row.bytes:>8}{row.spills:>7}"
            f"{row.trace * 1e6:>11.0f}{row.compile * 1e6:>13.0f}"
        )


if __name__ == "__main__":
    main()
