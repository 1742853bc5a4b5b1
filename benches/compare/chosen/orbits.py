"""The orbits: closed ones, which end where they began, so that the error needs no other solution."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import stepwell as sw
from stepwell.scenes.builtin import arenstorf as known

from ..workloads import Array


@dataclass(frozen=True)
class Orbits:
    """Starts v and y, shape (2, members), that are reached again at ``end``. ``kind`` is what contestants look up."""

    name: str
    kind: str
    v: Array
    y: Array
    end: float

    @property
    def members(self) -> int:
        """How many orbits."""
        return self.v.shape[1]

    def cut(self, members: int) -> Orbits:
        """Some of them, from all over."""
        some = np.linspace(0, self.members - 1, min(members, self.members)).round().astype(int)
        return Orbits(self.name, self.kind, self.v[:, some], self.y[:, some], self.end)

    def errors(self, y: Array) -> Array:
        """How far each is from where it should be."""
        return np.asarray(np.sqrt(((y - self.y) ** 2).sum(axis=0)))


def kepler(members: int, periods: int = 10) -> Orbits:
    """Ellipses of e = 0.9 and axis 1, turned by different angles: all equally hard, none equal to another."""
    turn, speed = np.linspace(0.0, 2.0 * np.pi, members, endpoint=False), math.sqrt(19.0)
    v = speed * np.stack([-np.sin(turn), np.cos(turn)])
    y = 0.1 * np.stack([np.cos(turn), np.sin(turn)])
    return Orbits(f"Kepler's ellipse, e = 0.9, {periods} periods", "kepler", v, y, 2.0 * np.pi * periods)


def arenstorf(members: int) -> Orbits:
    """Arenstorf's orbit, once round, from points all along it: they meet the moon at different times."""
    v, y = np.array(known.VELOCITY), np.array(known.PLACE)
    if members > 1:
        times = np.linspace(0.0, known.PERIOD, members, endpoint=False)
        run = sw.integrate(sw.RestrictedThreeBody(known.MU), "dop853", v=v, y=y, tolerance=1e-14, at=times, dt=1e-6)
        v, y = run.v.T, run.y.T
    return Orbits("Arenstorf's orbit, once round", "arenstorf", v.reshape(2, -1), y.reshape(2, -1), known.PERIOD)
