"""Stiff problems, and tame runs whose steps are held down by accuracy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.scenes.stiff_equations import hires, oregonator, van_der_pol
from stepwell.scenes.stiff_equations import rober as robertson

#: The scenes on which explicit methods diverge with the usual step.
SCENES = ("hires", "oregonator", "rober", "van_der_pol")

#: Methods that choose their steps, and are stable with short ones only.
EXPLICIT = [m.name for m in sw.methods() if m.error_order is not None and not m.is_always_stable]


@sw.system(order=1)
def follows(t: Any, y: Any, *, k: Any = 1000.0) -> Any:
    """It follows the cosine at a distance of 1/k."""
    return -k * (y - np.cos(t))


def net(damping: float = 1000.0) -> dict[str, Any]:
    """A chain of four particles whose springs are so stiff and damped that it swings like rods."""
    y = np.stack([np.arange(4.0), np.zeros(4)], axis=1)
    pairs = [(0, 1), (1, 2), (2, 3)]
    system = sw.Springs(pairs, stiffness=1e5, layout=y, masses=1.0, fixed=[0], gravity=(0.0, -9.81), damping=damping)
    return {"system": system, "v": 0.0, "y": y}


#: Each problem with its start and its end, as arguments of ``integrate``.
PROBLEMS: dict[str, dict[str, Any]] = {
    "ROBER": {"system": robertson(), "y": np.array([1.0, 0.0, 0.0]), "at": [1e4]},
    "OREGO": {"system": oregonator(), "y": np.array([1.0, 2.0, 3.0]), "at": [360.0]},
    "HIRES": {"system": hires(), "y": np.array([1.0, 0, 0, 0, 0, 0, 0, 0.0057]), "at": [321.8122]},
    "Van der Pol": {"system": van_der_pol(), "v": 0.0, "y": 2.0, "at": [2000.0]},
    "linear": {"system": sw.LinearSystem([[-1.0, 0.5], [0.3, -1000.0]], velocities=0), "y": np.ones(2), "at": [20.0]},
    "driven": {"system": follows(), "y": 1.0, "at": [20.0]},
    "net": net() | {"at": [20.0]},
}

# ---- tame ones


@sw.system(order=1)
def lorenz(t: Any, y: Any) -> Any:
    return np.array([10.0 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])


@sw.system(order=1)
def rossler(t: Any, y: Any) -> Any:
    return np.array([-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - 5.7)])


@sw.system(order=1)
def hunters(t: Any, y: Any) -> Any:
    return np.array([y[0] * (1.0 - y[1]), y[1] * (y[0] - 1.0)])


@sw.system
def duffing(t: Any, v: Any, y: Any) -> Any:
    return 0.5 * np.cos(1.2 * t) - 0.3 * v + y - y**3


@sw.system(order=1)
def brusselator(t: Any, y: Any) -> Any:
    return np.array([1.0 + y[0] ** 2 * y[1] - 4.0 * y[0], 3.0 * y[0] - y[0] ** 2 * y[1]])


@sw.system(order=1)
def nerve(t: Any, y: Any) -> Any:
    return np.array([y[0] - y[0] ** 3 / 3 - y[1] + 0.5, 0.08 * (y[0] + 0.7 - 0.8 * y[1])])


@sw.system(order=1)
def slow(t: Any, y: Any) -> Any:
    return -0.01 * y + np.cos(t)


@sw.system
def pushed(t: Any, v: Any, y: Any) -> Any:
    """A square wave, whose jumps no step crosses."""
    return -y + np.sign(np.sin(t))


def tame() -> Iterator[tuple[str, dict[str, Any]]]:
    """Runs with the method and the tolerance of each, of which five of six make thousands of steps."""
    scenes = sw.scenes
    systems: list[tuple[Any, dict[str, Any], float]] = [
        (sw.Oscillator(), {"v": 0.0, "y": 1.0}, 2500.0),
        (sw.Oscillator(np.linspace(0.5, 2.0, 5)), {"v": 0.0, "y": 1.0}, 2500.0),
        (sw.Oscillator(damping=0.05, x=sw.Sinusoid(1.0, 1.3)), {"v": 0.0, "y": 1.0}, 2500.0),
        (sw.Pendulum(), {"v": 0.0, "y": 2.0}, 2500.0),
        (sw.Chain(6), {"v": 0.0, "y": np.arange(6.0)}, 1500.0),
        (van_der_pol(mu=1.0), {"v": 0.0, "y": 2.0}, 2500.0),
        (van_der_pol(mu=5.0), {"v": 0.0, "y": 2.0}, 1500.0),
        (lorenz(), {"y": np.ones(3)}, 400.0),
        (rossler(), {"y": np.ones(3)}, 1500.0),
        (hunters(), {"y": np.array([2.0, 1.0])}, 2500.0),
        (duffing(), {"v": 0.0, "y": 1.0}, 2500.0),
        (brusselator(), {"y": np.ones(2)}, 1500.0),
        (nerve(), {"y": np.array([1.0, 0.0])}, 6000.0),
        (slow(), {"y": 1.0}, 3000.0),
        (pushed(), {"v": 0.0, "y": 1.0}, 1500.0),
        *(
            (scene.system, {"v": scene.v, "y": scene.y}, end)
            for scene, end in (
                (scenes.kepler(), 1500.0),
                (scenes.figure_eight(), 500.0),
                (scenes.heavy_top(), 200.0),
                (scenes.double_pendulum(), 300.0),
                (scenes.triple_pendulum(), 100.0),
                (scenes.dzhanibekov(), 600.0),
                (scenes.conical_pendulum(), 400.0),
                (scenes.rope_bridge(), 60.0),
            )
        ),
    ]
    tolerances = [0.03, (1e-3, 1e-6), 1e-5, (1e-7, 1e-9), 1e-9]
    for k, (system, start, end) in enumerate(systems):
        for i, method in enumerate(EXPLICIT):
            if method == "taylor" and system in (systems[14][0], systems[-1][0]):
                continue  # it takes no square waves, and its series of many springs are long
            tolerance = tolerances[(k + i) % len(tolerances)]
            if system is systems[9][0] and tolerance == tolerances[0]:
                tolerance = tolerances[1]  # else errors feed the prey without end, and the equations become stiff
            arguments = {"system": system, "method": method, "tolerance": tolerance, "at": [end], "max_steps": 200_000}
            yield f"{type(system).__name__} {k} by {method}, {tolerance}", arguments | start
