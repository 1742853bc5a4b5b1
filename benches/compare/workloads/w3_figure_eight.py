"""W3: one figure-eight, three bodies in the plane, step after step; only the final state is kept."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, Self

import numpy as np
import stepwell as sw

from ..bodies import Bodies
from . import Array, Unit

SCENE = sw.scenes.figure_eight()


class FigureEight(Bodies):
    """One member: a chain of a square root and a division, step after step."""

    family = "bodies"
    unit = Unit("ns/step", 1e9, time=True)
    coarse: ClassVar[int] = 20  # still 500 steps a period

    @property
    def about(self) -> str:  # type: ignore[override]
        """With the method."""
        return f"figure-eight of three bodies in the plane, {self.method.replace('_', ' ')}"

    @cached_property
    def truth(self) -> tuple[Array, Array]:
        """The orbit in 40 digits, folded into a period."""
        v, y = SCENE.exact(np.array([self.end]))
        return v[0][..., np.newaxis], y[0][..., np.newaxis]

    def quick(self) -> Self:
        """Two periods; in a part of one, a wrong method is not yet far off."""
        return self.cut(steps=20_000)


def make(method: str) -> FigureEight:
    """A hundred periods."""
    state = {"v": SCENE.v[..., np.newaxis], "y": SCENE.y[..., np.newaxis]}
    data = {**state, "masses": np.ones((3, 1)), "softening": np.zeros(1)}
    return FigureEight("W3", data, SCENE.period / 10_000, 1_000_000, method)


WORKLOADS = [make("false_euler"), make("leapfrog")]
