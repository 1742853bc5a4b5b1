"""W4: one large system with softened gravity in space, leapfrog; on one thread, and on all."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np
import stepwell as sw

from ..bodies import Bodies
from . import Unit


class Cluster(Bodies):
    """Stars in Plummer's sphere."""

    family = "cluster"
    about = "one star cluster in space, softened, leapfrog, one thread"
    unit = Unit("G pairs/s", 1e9)

    @property
    def size(self) -> str:
        """The bodies."""
        return f"{self.bodies:,} bodies"

    def amount(self, evaluations: int) -> float:
        """Directed pairs: how often a body is pulled by another, in all evaluations that were made."""
        return self.bodies * (self.bodies - 1) * evaluations

    def quick(self) -> Self:
        """Few bodies, and numbers of them that no vector divides."""
        few = {64: 64, 1024: 101}.get(self.bodies, 150)
        data = {name: row if name == "softening" else row[:few] for name, row in self.data.items()}
        return replace(self, data=data, steps=20)


class SharedCluster(Cluster):
    """The same, for those who share one system among threads."""

    family = "shared_cluster"
    about = "one star cluster in space, softened, leapfrog, all threads"


def make(kind: type[Cluster], n: int, steps: int) -> Cluster:
    """Spheres of 64 stars each on top of each other: a scene of thousands takes long to draw."""
    spheres = [sw.scenes.plummer(64, seed=seed) for seed in range(n // 64)]
    data = {name: np.concatenate([getattr(s, name) for s in spheres])[..., np.newaxis] for name in ("v", "y")}
    softening = np.array([float(spheres[0].system.softening)])
    return kind("W4", data | {"masses": np.full((n, 1), 1.0 / n), "softening": softening}, 1e-4, steps)


ONE = [make(Cluster, n, steps) for n, steps in ((64, 1000), (1024, 40), (8192, 8))]
WORKLOADS = [*ONE, *(SharedCluster(work.name, work.data, work.dt, work.steps) for work in (ONE[0], ONE[2]))]
