"""§12: which method for what, and constraints as control terms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..advice import advise
from ..control import Projection
from ..integrate import integrate
from ..scenes import scene
from ..systems import NBody, Oscillator
from . import Finding, Section

section = Section("§12")


@section(
    "advice",
    "False Euler for fast calculations of particles, springs and celestial motions: low accuracy, guaranteed stability.",
    "`false_euler`; `sw.advise(scene, frame=…)`",
    "Below Φ = 2 of the fastest oscillation; close encounters have no bound.",
)
def use_false_euler() -> Finding:
    """One oscillator of 60 Hz frames, near the limit, for an hour."""
    limit = 2.0 * 60.0
    run = integrate(Oscillator(0.99 * limit), "false_euler", v=0.0, y=1.0, dt=1 / 60, steps=216_000, every=1)
    largest = float(np.abs(run.y).max())
    return Finding(largest < 10.0, f"ω₀ at 99 % of the limit of 60 frames a second, an hour: largest |y| = {largest:.2f}")


@section(
    "advice",
    "Standard Heun for general systems with medium accuracy, if the step can be kept small.",
    "`standard_heun`; `sw.advise`",
)
def use_heun() -> Finding:
    """The growth of an oscillation over 100 periods at two steps."""
    grown = []
    for phi in (0.5, 0.1):
        steps = round(100 * 2 * math.pi / phi)
        run = integrate(Oscillator(), "standard_heun", v=0.0, y=1.0, dt=phi, steps=steps)
        grown.append(math.hypot(float(run.v[-1]), float(run.y[-1])))
    return Finding(
        grown[0] > 1000 > 1.1 > grown[1], f"amplitude after 100 periods: {grown[0]:.3g} at Φ = 0.5, {grown[1]:.4f} at Φ = 0.1"
    )


@section(
    "advice",
    "Everything else by higher Runge-Kutta methods that choose their steps: Merson, Fehlberg.",
    '`integrate(…, "merson", tolerance=…, at=…)`; `fehlberg`, `fehlberg_5`, `dop853`',
    "With small fixed steps Fehlberg adds energy to an undamped oscillator at every step; Merson does not.",
)
def use_runge_kutta() -> Finding:
    """An eccentric orbit by Merson with a tolerance, and the growth of Fehlberg."""
    kepler = scene("kepler")
    run = integrate(kepler.system, "merson", v=kepler.v, y=kepler.y, tolerance=1e-9, at=[kepler.horizon])
    error = float(kepler.state_error(run)[-1])
    grown = [
        math.hypot(float(r.v[-1]), float(r.y[-1])) - 1
        for r in (integrate(Oscillator(), name, v=0.0, y=1.0, dt=0.2, steps=10_000) for name in ("merson", "fehlberg"))
    ]
    return Finding(
        error < 1e-3 and grown[0] < 0 < grown[1],
        f"{kepler.title}: error {error:.0e}; amplitude after 10 000 steps of Φ = 0.2: Merson {grown[0]:+.1e}, "
        f"Fehlberg {grown[1]:+.1e}",
    )


@section(
    "warning",
    "The motion of a satellite drifts away in radius and phase even by a good method: its energy needs a control.",
    "`sw.EnergyControl`, `sw.Projection`; `sw.charts.control`",
    "A symplectic method keeps the radius without control; a control of the energy keeps the radius, and only some of the phase.",
)
def satellite() -> Finding:
    """Two bodies on a circle, 1000 turns of 30 steps, by RK4 without and with control, and by leapfrog."""
    system = NBody([0.5, 0.5], force="newton")
    state: dict[str, Any] = {
        "v": np.array([[0.0, -0.5], [0.0, 0.5]]),
        "y": np.array([[-0.5, 0.0], [0.5, 0.0]]),
        "dt": 2 * math.pi / 30,
        "steps": 30_000,
    }
    runs = [
        integrate(system, "rk4", **state),
        integrate(system, "rk4", control=Projection("nacozy"), **state),
        integrate(system, "leapfrog", **state),
    ]
    radius = [float(np.linalg.norm(run.y[-1, 1] - run.y[-1, 0])) for run in runs]
    holds = abs(radius[0] - 1) > 0.05 and abs(radius[1] - 1) < 0.02 and abs(radius[2] - 1) < 0.02
    return Finding(
        holds, f"radius after 1000 turns: RK4 {radius[0]:.3f}, with projection {radius[1]:.4f}, leapfrog {radius[2]:.4f}"
    )


@section(
    "advice",
    "Which method a scene needs is a question of cost and error.",
    "`sw.advise`; `stepwell advise`; `sw.charts.work_precision`",
)
def asks() -> Finding:
    """Advice for the clover leaf; which method is fastest depends on the machine, that it is accurate does not."""
    best = advise("clover", tolerance=1e-2).best
    return Finding(best is not None and best.error <= 1e-2, "the method and the step that it names keep the clover leaf to 1 %")
