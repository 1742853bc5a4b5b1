"""Verlet with friction, a mistake: friction needs a velocity, and Verlet has none (§8).

The difference (y − y_prev)/h is the velocity of half a step ago. Stepwell refuses such systems for Verlet, so the steps of this
figure are written only here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.pictures import Drawn
from ...base.tables import Table, stacked
from ...errors import ArgumentError
from ...scenes.builtin.sliding_block import sliding_block
from ...scenes.builtin.sticking_block import sticking_block

#: More steps than this are a mistake, and no picture.
MAX_STEPS = 100_000

#: Damping ratios of the limits.
DAMPING = np.linspace(0.0, 1.5, 16)

#: Halvings of the bracket of a limit, which is of length 4 at first.
HALVINGS = 50


@dataclass(frozen=True, eq=False)
class Block(ValueEquality):
    """A block that friction stops; arrays are of shape (steps + 1,).

    Attributes:
        name: its name.
        t: times.
        exact: true coordinates.
        false_euler: coordinates by False Euler.
        verlet: coordinates by Verlet with the velocity of the secant.
    """

    name: str
    t: Array
    exact: Array
    false_euler: Array
    verlet: Array


@dataclass(frozen=True, eq=False)
class VerletFriction(Drawn, Table, ValueEquality):
    """Verlet with the velocity of the secant, beside False Euler and the exact motion.

    A row for each time of each block.

    Attributes:
        dt: the step of the blocks, in units of time.
        blocks: one that slides, and one on a spring.
        damping: damping ratios D of an oscillator, dimensionless, shape (ratios,).
        limits: for each the Φ = ω₀·h below which Verlet with drag by the secant is stable.
    """

    dt: float
    blocks: tuple[Block, ...]
    damping: Array
    limits: Array
    _painter = "draw_verlet_friction"

    def summary(self) -> list[dict[str, Any]]:
        """A row for each block: its coordinate at the end, and its mean speed over the last tenth."""
        rows = []
        for block in self.blocks:
            tenth = max(1, len(block.t) // 10)
            for name in ("exact", "false_euler", "verlet"):
                y = getattr(block, name)
                speed = float((y[-1] - y[-1 - tenth]) / (block.t[-1] - block.t[-1 - tenth]))
                rows.append({"block": block.name, "by": name, "last_y": float(y[-1]), "last_speed": speed})
        return rows

    def _head(self) -> dict[str, Any]:
        limits = [{"damping": float(d), "limit": float(limit)} for d, limit in zip(self.damping, self.limits, strict=True)]
        return {"dt": self.dt, "limits": limits}

    def _columns(self) -> dict[str, list[Any]]:
        names = ("t", "exact", "false_euler", "verlet")
        return stacked({"block": block.name} | {name: getattr(block, name) for name in names} for block in self.blocks)


def verlet_friction(dt: Any = 1 / 60) -> VerletFriction:
    """Step blocks with friction by Verlet and the velocity of its secant, a mistake: they never come to rest (§8).

    The blocks are those of the scenes ``sliding_block`` and ``sticking_block``. False Euler, which has a velocity, is compared.

    Args:
        dt: the step in units of time, above zero and at most 0.1.

    Returns:
        A ``VerletFriction``: ``.plot()`` draws it.

    Raises:
        ArgumentError: what was given and what was expected.

    Example:
        >>> chart = sw.charts.verlet_friction()
        >>> type(chart).__name__
        'VerletFriction'
    """
    dt = checks.number("dt", dt, positive=True, unit="units of time")
    if not 40.0 / MAX_STEPS <= dt <= 0.1:
        raise ArgumentError(f"dt: expected {40.0 / MAX_STEPS:g} to 0.1 units of time, got {dt:g}")
    blocks = (_block("slides", sliding_block(), 5.0, dt), _block("on a spring", sticking_block(), 40.0, dt))
    return VerletFriction(dt, blocks, DAMPING, np.array([_limit(float(damping)) for damping in DAMPING]))


def _block(name: str, scene: Any, until: float, dt: float) -> Block:
    steps = math.ceil(until / dt - 1e-9)
    right = scene.run("false_euler", dt, steps=steps, every=1)
    system = scene.system
    stiffness, friction = float(system.omega) ** 2, float(system.friction)

    def acceleration(y: float, difference: float) -> float:
        return -stiffness * y - friction * float(np.sign(difference))

    verlet = secant_verlet(acceleration, float(scene.v), float(scene.y), dt, steps)
    return Block(name, right.t, scene.exact(right.t)[1], right.y, verlet)


def secant_verlet(acceleration: Any, v: float, y: float, dt: float, steps: int) -> Array:
    """Coordinates by Verlet with an acceleration of y and y − y_prev, the mistake of this figure; shape (steps + 1,).

    It starts as Verlet does in second order, y_prev = y − h·v + ½h²·a, with the true velocity in a.
    """
    places = np.empty(steps + 1)
    places[0] = y
    previous = y - dt * v + 0.5 * dt * dt * acceleration(y, v)
    for k in range(steps):
        previous, y = y, 2.0 * y - previous + dt * dt * acceleration(y, y - previous)
        places[k + 1] = y
    return places


def _limit(damping: float) -> float:
    """The Φ at which Verlet with drag by the secant begins to grow: by bisection of the larger eigenvalue of its step."""

    def grows(phi: float) -> bool:
        # (y_prev, y) ← (y, 2y − y_prev − Φ²y − 2DΦ(y − y_prev))
        drag = 2.0 * damping * phi
        step = np.array([[0.0, 1.0], [drag - 1.0, 2.0 - phi * phi - drag]])
        return bool(np.abs(np.linalg.eigvals(step)).max() > 1.0 + 1e-9)

    stable, unstable = 0.0, 4.0
    for _ in range(HALVINGS):
        middle = 0.5 * (stable + unstable)
        stable, unstable = (stable, middle) if grows(middle) else (middle, unstable)
    return stable
