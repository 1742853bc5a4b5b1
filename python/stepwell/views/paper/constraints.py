"""§12: which method suits which system, and constraints as control terms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...model.controls import LengthControl, NormControl, Projection
from ...model.systems import NBody, Oscillator, Pendulum3D, RigidBody, Springs
from ...runs.execution import quietly
from ...scenes import scene
from ...studies.advice import advise
from ..charts import control as control_chart
from ..charts import norm as norm_chart
from . import Finding, Section
from .pictures import motion

section = Section("§12")


@section(
    "advice",
    "False Euler for fast calculations of particles, springs and celestial motions: low accuracy, guaranteed stability.",
    "`false_euler`; `sw.advise(scene, frame=…)`",
    "Below Φ = 2 of the fastest oscillation; close encounters have no bound.",
)
def use_false_euler() -> Finding:
    """An oscillator near the stability limit of 60 steps a second, for an hour."""
    limit = 2.0 * 60.0
    run = quietly(Oscillator(0.99 * limit), "false_euler", v=0.0, y=1.0, dt=1 / 60, steps=216_000, every=1)
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
        run = quietly(Oscillator(), "standard_heun", v=0.0, y=1.0, dt=phi, steps=steps)
        grown.append(math.hypot(float(run.v[-1]), float(run.y[-1])))
    return Finding(
        grown[0] > 1000 > 1.1 > grown[1], f"amplitude after 100 periods: {grown[0]:.3g} at Φ = 0.5, {grown[1]:.4f} at Φ = 0.1"
    )


@section(
    "advice",
    "Everything else by Runge-Kutta methods of higher order with adaptive steps: Merson, Fehlberg.",
    '`integrate(…, "merson", tolerance=…, at=…)`; `fehlberg`, `fehlberg_5`, `dop853`',
    "With small fixed steps Fehlberg adds energy to an undamped oscillator at every step; Merson does not.",
)
def use_runge_kutta() -> Finding:
    """The error of an eccentric orbit by Merson with a tolerance, and the growth by Merson and by Fehlberg in fixed steps."""
    kepler = scene("kepler")
    run = quietly(kepler.system, "merson", v=kepler.v, y=kepler.y, tolerance=1e-9, at=[kepler.horizon])
    error = float(kepler.state_error(run)[-1])
    grown = [
        math.hypot(float(r.v[-1]), float(r.y[-1])) - 1
        for r in (quietly(Oscillator(), name, v=0.0, y=1.0, dt=0.2, steps=10_000) for name in ("merson", "fehlberg"))
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
    "A symplectic method keeps the radius without control. A control of the energy keeps the radius, but corrects the phase only "
    "in part.",
)
def satellite() -> Finding:
    """Two bodies on a circle, 1000 turns of 30 steps: by RK4 without and with projection, and by leapfrog."""
    system = NBody([0.5, 0.5], force="newton")
    state: dict[str, Any] = {
        "v": np.array([[0.0, -0.5], [0.0, 0.5]]),
        "y": np.array([[-0.5, 0.0], [0.5, 0.0]]),
        "dt": 2 * math.pi / 30,
        "steps": 30_000,
    }
    runs = [
        quietly(system, "rk4", **state),
        quietly(system, "rk4", control=Projection("nacozy"), **state),
        quietly(system, "leapfrog", **state),
    ]
    radius = [float(np.linalg.norm(run.y[-1, 1] - run.y[-1, 0])) for run in runs]
    holds = abs(radius[0] - 1) > 0.05 and abs(radius[1] - 1) < 0.02 and abs(radius[2] - 1) < 0.02
    return Finding(
        holds, f"radius after 1000 turns: RK4 {radius[0]:.3f}, with projection {radius[1]:.4f}, leapfrog {radius[2]:.4f}"
    )


@section(
    "advice",
    "A pendulum in x, y and z: the length of the rod is a priori constant, and its deviation is the control term.",
    '`sw.Pendulum3D`, `sw.Rods`; `sw.LengthControl(c)`, `sw.Projection("length")`; `sw.charts.control`',
    "Control is better than resetting only for False and Damped Euler. For others resetting is better: control reduces them to "
    "second order or less.",
    draw=lambda path: control_chart("conical_pendulum").plot(path),
)
def pendulum_in_space() -> Finding:
    """The largest energy error of a 90° swing over 75 units of time with T = 0.01, by control and by resetting."""
    errors = {}
    for method in ("false_euler", "rk4"):
        for control in (LengthControl(0.5), Projection("length")):
            start: dict[str, Any] = {"v": 0.0, "y": [1.0, 0.0, 0.0], "dt": 0.01, "steps": 7500, "every": 5}
            run = quietly(Pendulum3D(), method, **start, control=control, record="energy")
            errors[method, type(control)] = float(np.abs(run.recorded["energy"] - run.recorded["energy"][0]).max())
    euler, rk4 = ([errors[name, kind] for kind in (LengthControl, Projection)] for name in ("false_euler", "rk4"))
    return Finding(
        euler[0] < 0.1 * euler[1] and rk4[1] < 0.1 * rk4[0],
        f"energy error by control and by resetting: False Euler {euler[0]:.1e} and {euler[1]:.1e}, RK4 {rk4[0]:.1e} and "
        f"{rk4[1]:.1e}",
    )


@section(
    "advice",
    "The norm of a quaternion can be stabilised; resetting it to one may work, but control is probably better.",
    '`sw.RigidBody`; `sw.NormControl(k)`, `sw.Projection("norm")`; `sw.charts.norm`',
    "It is better for Euler at a steady rate. Resetting does not change the attitude; control degrades methods of higher order.",
    draw=lambda path: norm_chart().plot(path),
)
def quaternion_norm() -> Finding:
    """The relative error of the angle of a step: Standard Euler at a steady rate, Φ = h|ω|/2 = 0.1."""
    wrong = []
    start: dict[str, Any] = {"v": [0.0, 0.0, 2.0], "y": [1.0, 0.0, 0.0, 0.0], "dt": 0.1, "steps": 2000, "every": 1}
    for control in (Projection("norm"), NormControl(5.0)):
        run = quietly(RigidBody([1.0, 1.0, 1.0]), "standard_euler", **start, control=control)
        angle = np.unwrap(np.arctan2(run.y[:, 3], run.y[:, 0]))
        wrong.append(float(angle[-1] - angle[-2]) / 0.1 - 1.0)
    phi = 0.1
    # Exactly: atan(Φ)/Φ − 1 with resetting, asin(Φ)/Φ − 1 under control.
    wanted = math.atan(phi) / phi - 1.0, math.asin(phi) / phi - 1.0
    holds = all(abs(error - exact) < 1e-9 for error, exact in zip(wrong, wanted, strict=True))
    return Finding(holds, f"Φ = 0.1: {wrong[0]:+.2e} a step with resetting (−Φ²/3), {wrong[1]:+.2e} under control (+Φ²/6)")


@section(
    "advice",
    "Mass and spring systems by False Euler.",
    "`sw.Springs`, `sw.Chain`; `Springs.safe_step(method)`; `sw.scenes.cloth()`, `rope_bridge()`, `jelly_cube()`",
    "The limit of a net is known before the run: h²·ω² < 4 for its fastest oscillation.",
    draw=motion("rope_bridge"),
)
def spring_nets() -> Finding:
    """Ten masses on a line, stepped by 99 % and by 150 % of the safe step."""
    net = Springs([(i, i + 1) for i in range(9)], stiffness=100.0, rest=1.0, dim=2)
    y = np.stack([np.arange(10.0), np.zeros(10)], axis=1) + 0.01 * np.random.default_rng(1).normal(size=(10, 2))
    safe = float(net.safe_step("false_euler"))
    runs = [quietly(net, "false_euler", v=0.0, y=y, dt=share * safe, steps=2000) for share in (0.99, 1.5)]
    largest, bad = float(np.abs(runs[0].y[-1]).max()), int(runs[1].first_bad_step)
    return Finding(
        largest < 20.0 and bad > 0,
        f"safe step {safe:.4f}; at 99 % of it |y| ≤ {largest:.3g} after 2000 steps, at 150 % the net diverges at step {bad}",
    )


@section(
    "advice",
    "Which method a scene needs is a question of cost and error.",
    "`sw.advise`; `stepwell advise`; `sw.charts.work_precision`",
)
def method_advice() -> Finding:
    """The best method for the clover leaf is accurate. Which method that is depends on the machine."""
    best = advise("clover", tolerance=1e-2).best
    return Finding(
        best is not None and best.error <= 1e-2,
        "the advised method and step have a state error of at most 1 % on the clover leaf",
    )
