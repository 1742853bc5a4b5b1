"""Appendices C and D: three bodies, and the control of their energy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...model.controls import EnergyControl
from ...scenes import scene
from ...scenes.base import quiet_run
from ...scenes.builtin.energy_control import energy_control
from . import Finding, Section
from .pictures import motion, paths

section_c, section_d = Section("App. C"), Section("App. D")


@section_c(
    "figure",
    "Three bodies under gravity by False Euler with T = 0.3: the first 100 steps draw a clover leaf about the true orbit.",
    "`sw.scenes.clover()`; `stepwell run clover`",
    "The program divides by the squared distance: the force is 1/r, and the true orbit is the unit circle. Its first step reads "
    "positions before they are set; the old ones are meant.",
    draw=motion("clover", steps=100),
)
def clover() -> Finding:
    """The radii in the first 100 steps lie on both sides of 1."""
    run = scene("clover").run("false_euler", steps=100, every=1)
    radius = np.linalg.norm(run.y, axis=-1)
    return Finding(0.9 < radius.min() < 1 < radius.max() < 1.13, f"radii from {radius.min():.3f} to {radius.max():.3f}")


@section_c("advice", "The solution is not accurate but stable ad infinitum.", "`sw.scenes.clover()`")
def clover_stays() -> Finding:
    """The radii stay bounded over 100 000 steps."""
    run = quiet_run(scene("clover"), "false_euler", steps=100_000, every=10)
    radius = np.linalg.norm(run.y, axis=-1)
    return Finding(
        0.9 < radius.min() < radius.max() < 1.13, f"100 000 steps: radii from {radius.min():.3f} to {radius.max():.3f}"
    )


def _largest(**options: Any) -> float:
    scene = energy_control(pair="printed", form="printed")
    run = quiet_run(scene, "standard_euler", steps=100_000, every=100, **options)
    return float(np.abs(run.y).max())


def _draw_control(path: Path) -> object:
    scene = energy_control(pair="printed", form="printed")
    free, controlled = (
        quiet_run(scene, "standard_euler", steps=100_000, every=10, **options).y for options in ({"control": None}, {})
    )
    return paths(
        path,
        "Energy control keeps three bodies together",
        "Standard Euler, 100 000 steps of 0.01 (Appendix D): the printed force, energy and control, C = 0.3",
        [("without control: they leave", free), ("with control: they stay", controlled)],
        8.0,
    )


@section_d(
    "figure",
    "Three bodies by Standard Euler, 100 000 steps of 0.01: unstable, but stable with energy control, C = 0.3.",
    '`sw.scenes.energy_control(pair="printed", form="printed")`; `sw.EnergyControl`',
    "The printed energy −1/r is not the potential of the printed force 1/r, which is ln r: "
    '`pair="matching"` uses a force and its potential. A step with h·C·K above 1 overshoots; with `form="limited"` none does.',
    draw=_draw_control,
)
def energy_controlled() -> Finding:
    """The largest coordinate without and with control."""
    free, controlled = _largest(control=None), _largest()
    return Finding(free > 20 and controlled < 3.6, f"largest coordinate {free:.1f} without control, {controlled:.2f} with it")


@section_d(
    "advice",
    "For symmetric initial conditions we get a circle.",
    "`sw.scenes.energy_control(eps=0)`",
    "The velocities of Appendix D are radial: with ε = 0 the three bodies meet at the centre. The circle is that of Appendix C.",
)
def symmetric_start() -> Finding:
    """The least distance of the third body from the centre, up to t = 4."""
    run = quiet_run(energy_control(eps=0.0), "leapfrog", dt=1e-4, steps=40_000, every=1, control=None)
    radius = np.linalg.norm(run.y[:, 2], axis=-1)
    nearest = float(np.nanmin(radius))
    return Finding(nearest < 0.01, f"nearest to the centre: {nearest:.1e}")


@section_d(
    "formula", "The control adds −C·ΔE·∂E/∂v to each acceleration (Baumgarte 1972).", '`sw.EnergyControl(gain, form="printed")`'
)
def control_term() -> Finding:
    """One controlled step of Standard Euler, against an uncontrolled step and the formula."""
    scene = energy_control(pair="printed", form="printed")
    control = EnergyControl(0.3, "printed", target=-2.0)
    free = quiet_run(scene, "standard_euler", steps=1, control=None)
    controlled = quiet_run(scene, "standard_euler", steps=1, control=control)
    energy = float(scene.system.energy(scene.v, scene.y))
    wanted = free.v[-1] - scene.dt * 0.3 * (energy + 2.0) * scene.v
    off = float(np.abs(controlled.v[-1] - wanted).max())
    return Finding(off < 1e-15, "one step by the formula and by the control: the same, to rounding")
