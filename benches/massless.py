"""Bodies without mass around some with mass, beside REBOUND's test particles: ``python -m benches.massless``. On one thread.

A sun, some planets and 3000 bodies without mass between them, in space, by leapfrog. The error is the largest of all places after
1000 steps against the run by dop853 with a tolerance of 1e-13; REBOUND's leapfrog drifts, kicks and drifts, stepwell's kicks,
drifts and kicks. The time is that of a step, the least of some runs in turn.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import rebound
import stepwell as sw

PARTICLES, DT, STEPS, REPEATS = 3000, 0.01, 1000, 9
PLANETS = (0, 2, 5)


def start(planets: int) -> tuple[sw.NBody, Any, Any]:
    """The bodies, those with mass first, on orbits around the sun that are nearly circles."""
    rng = np.random.default_rng(1)
    masses = np.r_[1.0, np.full(planets, 1e-4), np.zeros(PARTICLES)]
    radius = np.r_[0.0, np.linspace(5.0, 9.0, planets), rng.uniform(1.0, 3.0, PARTICLES)]
    angle = rng.uniform(0.0, 2.0 * np.pi, len(masses))
    speed = np.r_[0.0, 1.0 / np.sqrt(radius[1:])]
    y = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.01 * radius * np.sin(3.0 * angle)], -1)
    v = np.stack([-speed * np.sin(angle), speed * np.cos(angle), 0.0 * angle], -1)
    return sw.NBody(masses, force="newton"), v, y


def simulation(bodies: sw.NBody, v: Any, y: Any) -> Any:
    made = rebound.Simulation()
    made.integrator, made.dt = "leapfrog", DT
    for mass, place, velocity in zip(bodies.masses, y, v, strict=True):
        made.add(m=mass, **dict(zip("xyz", place, strict=True)), **dict(zip(("vx", "vy", "vz"), velocity, strict=True)))
    made.N_active, made.testparticle_type = np.count_nonzero(bodies.masses), 0
    return made


def main() -> None:
    """Prints the table."""
    print(f"stepwell {sw.__version__}, {sw.isa()}; REBOUND {rebound.__version__}; {PARTICLES} without mass; a step in µs\n")
    print("| with mass | REBOUND | its error | stepwell | its error | REBOUND ÷ stepwell | with every state and energy |")
    print("|---|---|---|---|---|---|---|")
    for planets in PLANETS:
        bodies, v, y = start(planets)
        ours = partial(sw.integrate, bodies, "leapfrog", v=v, y=y, dt=DT, steps=STEPS, threads=1)
        truth = sw.integrate(bodies, "dop853", v=v, y=y, tolerance=1e-13, at=[DT * STEPS]).y[-1]
        theirs = simulation(bodies, v, y)
        theirs.steps(STEPS)
        theirs.synchronize()
        places = np.array([[body.x, body.y, body.z] for body in theirs.particles])
        errors = [float(np.abs(each - truth).max()) for each in (places, ours().y[-1])]
        calls: list[Callable[[], Any]] = [partial(theirs.steps, STEPS), ours, partial(ours, every=1, record="energy")]
        took = [np.inf] * len(calls)
        for _ in range(REPEATS):  # in turn, so that all meet the same machine
            for i, call in enumerate(calls):
                begin = time.perf_counter()
                call()
                took[i] = min(took[i], (time.perf_counter() - begin) / STEPS * 1e6)
        their, own, recorded = took
        beside = f"{their:.1f} | {errors[0]:.1e} | {own:.1f} | {errors[1]:.1e} | {their / own:.1f}"
        print(f"| {planets + 1} | {beside} | {recorded:.1f} |")


if __name__ == "__main__":
    main()
