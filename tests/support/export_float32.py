"""Steps that are exported in float32."""

from __future__ import annotations

from typing import Any

import numpy as np
import stepwell as sw

from support.abroad import Journey

BODIES: dict[str, Any] = {"v": np.array([[0.0, 0.5], [0.0, -0.5]]), "y": np.array([[1.0, 0.1], [-1.0, 0.0]])}


@sw.system
def chosen(t: Any, v: Any, y: Any, *, a: Any = 0.3) -> Any:
    """Functions of float32, a choice, and operations on bits."""
    return np.where(y < a, -np.sin(y), np.exp(-a * y) * np.cos(t)) - 0.1 * v * np.abs(v) + np.log(1.0 + y * y)


def single(system: sw.System, method: str, v: Any = 0.3, y: Any = 1.1, steps: int = 30, **options: Any) -> Journey:
    return Journey(system, method, v, y, steps=steps, options={"dtype": "float32", **options})


def singles() -> list[Journey]:
    """Every kind of rates and of methods: what carries something, controls, inputs, what diverges, what is changed."""
    rng = np.random.default_rng(5)
    drive = {"a": sw.Sinusoid(1.0, 2.0, 0.3)}
    masses = sw.LinearSystem([[-0.1, 0.0, -1.0, 0.0], [0.0, -0.2, 0.0, -2.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    every = [
        single(sw.Oscillator(1.3, 0.1, **drive, form="physical"), "rk4"),
        single(sw.Pendulum(1.1, 0.2, **drive), "merson"),
        single(sw.Pendulum(1.1), "verlet", start="second_order"),
        single(sw.Oscillator(0.7), "leapfrog"),
        single(sw.Chain(4), "semi_false_heun", rng.normal(size=4), rng.normal(size=4)),
        single(masses, "fehlberg", rng.normal(size=2), rng.normal(size=2)),
        single(sw.NBody([1.0, 2.0], force="newton"), "pefrl", **BODIES),
        single(sw.NBody([1.0, 2.0]), "rk4", **BODIES, control=sw.EnergyControl(0.3)),
        single(sw.NBody([1.0, 2.0]), "false_heun", **BODIES, control=sw.Projection()),
        single(chosen(), "standard_heun"),
        single(sw.Oscillator(50.0), "rk4", 0.0, 1.0, steps=40),
        single(sw.NBody([1.0, 1.0]), "damped_euler", np.zeros((2, 2)), np.zeros((2, 2)), steps=3),
        # The smallest numbers, which have fewer digits.
        single(sw.Pendulum(1.0), "false_euler", 1e-42, 3e-41),
    ]
    every.append(
        Journey(
            sw.Pendulum(1.0, 0.1, **drive),
            "standard_euler",
            0.5,
            1.0,
            options={"dtype": "float32"},
            changed={"omega": 1.3, "damping": 0.4, "a_amplitude": 0.3},
            twin=sw.Pendulum(1.3, 0.4, a=sw.Sinusoid(0.3, 2.0, 0.3)),
        )
    )
    return every


def fused_singles() -> list[Journey]:
    """Likewise by fused multiply-adds."""
    return [
        single(sw.Oscillator(1.3, 0.1, form="physical"), "rk4", fused=True),
        single(sw.Pendulum(1.1), "verlet", fused=True),
        single(sw.NBody([1.0, 2.0], force="newton"), "leapfrog", **BODIES, fused=True),
        single(chosen(), "merson", fused=True),
    ]
