"""Appendix E: the rotation of an aircraft."""

from __future__ import annotations

import numpy as np

from ...analysis.stability import stability_limit
from ...model.systems.aircraft import Aircraft
from ...runs.execution import quietly
from . import Finding, Section
from .pictures import motion

section = Section("App. E")


@section(
    "program",
    "A rigid aircraft with dampers and simplified controllers of roll and pitch, by False Euler with T = 0.1: angular velocities "
    "first, then the Euler angles from the new ones.",
    "`sw.Aircraft(roll=…, pitch=…)`; `stepwell run aircraft`",
    "Initial state, commands and duration are not printed, and the display shows −θ and −ψ. `While φ > 180` takes very long for "
    "large angles; here it is a remainder.",
    draw=motion("aircraft"),
)
def aircraft_turns() -> Finding:
    """The steady turn under a commanded roll of 30°, which is not reached: the controllers have no integral part."""
    run = quietly(Aircraft(roll=30.0), "false_euler", v=0.0, y=0.0, dt=0.1, steps=600, every=1)
    roll, pitch, _ = run.y[-1]
    turn = float(run.y[-1, 2] - run.y[-2, 2]) / 0.1
    holds = abs(roll - 27.17730) < 1e-4 and abs(pitch - 6.66655) < 1e-4 and abs(turn + 29.0658) < 1e-3
    return Finding(holds, f"roll 30° commanded: φ = {roll:.4f}°, θ = {pitch:.4f}°, ψ̇ = {turn:.3f}° a second")


@section("program", "The switch CO turns the controllers of roll and pitch on.", "`sw.Aircraft(controllers=False)`")
def aircraft_controllers() -> Finding:
    """The rest of a roll of 10° after 20 s, with and without controllers."""
    rolls = [
        float(quietly(Aircraft(controllers=on), "false_euler", v=0.0, y=[10.0, 0.0, 0.0], dt=0.1, steps=200).y[-1, 0])
        for on in (True, False)
    ]
    return Finding(
        abs(rolls[0]) < 0.1 < abs(rolls[1]), f"roll after 20 s from 10°: {rolls[0]:.3f}° with them, {rolls[1]:.2f}° without"
    )


@section(
    "program",
    "The step is 0.1 s.",
    '`sw.stability_limit(sw.Aircraft(), "false_euler", at=…)`',
    "False Euler would be stable up to 0.436 s (roll).",
)
def aircraft_limit() -> Finding:
    """The stability limit at level flight."""
    limit = float(stability_limit(Aircraft(), "false_euler", v=np.zeros(3), y=np.zeros(3)))
    return Finding(abs(limit - 0.436357) < 1e-6, f"stable for T < {limit:.6f} s")


@section(
    "warning",
    "The singularity of gimbal lock is trapped: |cos θ| is at least 10⁻⁵.",
    '`sw.Aircraft("quaternion")`, with `sw.NormControl` or `sw.Projection("norm")`; `sw.scenes.gimbal_trap()`',
    "That avoids a division by zero, but one step may jump by 10⁵·ω·T. The form with a quaternion has no singularity.",
)
def aircraft_trap() -> Finding:
    """A step at θ = 90° in both forms, without torques."""
    free = {"damping": np.zeros(3), "gains": np.zeros(3), "controllers": False}
    jumps = []
    for form in ("euler", "quaternion"):
        system = Aircraft(form, **free)  # type: ignore[arg-type]
        start = system.attitude(pitch=90.0)
        run = quietly(system, "false_euler", v=[0.0, 0.0, 1.0], y=start, dt=0.1, steps=1)
        jumps.append(float(np.abs(run.y[-1] - start).max()))
    holds = jumps[0] > 5e5 and jumps[1] < 0.06
    return Finding(
        holds, f"θ = 90°, ω_z = 1: a step changes an angle by {jumps[0]:.0f}°, a quaternion's number by {jumps[1]:.3f}"
    )


@section(
    "formula",
    "Without torques a rigid body keeps its energy.",
    "`run.energy`",
    "Hoffmann does not state it. False Euler does not keep the energy; so it is a test of any method.",
)
def aircraft_energy() -> Finding:
    """The energy over 100 s without torques."""
    free = Aircraft(damping=np.zeros(3), gains=np.zeros(3), controllers=False)
    run = quietly(free, "false_euler", v=[0.02, 0.5, 0.02], y=0.0, dt=0.1, steps=1000, every=1000)
    first, last = (float(energy) for energy in run.energy)
    return Finding(
        abs(first - 0.1254) < 1e-4 and abs(last - 0.1452) < 1e-4,
        f"False Euler, 100 s about the middle axis: {first:.4f} → {last:.4f}",
    )
