"""W6: many systems of three bodies in space, each with its own masses and start, leapfrog; only the final state is kept."""

from __future__ import annotations

import numpy as np
import stepwell as sw

from ..bodies import Bodies
from . import Unit


class ThreeBodies(Bodies):
    """Members side by side."""

    family = "bodies"
    about = "systems of three bodies in space, masses and start their own, leapfrog"
    unit = Unit("M system-steps/s", 1e6)


def make(members: int, steps: int) -> ThreeBodies:
    """Figure-eights that are a little off, turned anyhow in space, for a period of the true one: no two bodies come close."""
    rng, scene = np.random.default_rng(6), sw.scenes.figure_eight()
    turn = np.linalg.qr(rng.normal(size=(members, 3, 3)))[0]
    blocks = {}
    for name in ("v", "y"):
        flat = np.pad(getattr(scene, name), ((0, 0), (0, 1)))
        off = rng.uniform(-0.01, 0.01, (3, 3, members))
        blocks[name] = np.einsum("mcd,bd->bcm", turn, flat) + off
    masses = rng.uniform(0.99, 1.01, (3, members))
    return ThreeBodies("W6", {**blocks, "masses": masses, "softening": np.zeros(members)}, scene.period / 1000, steps)


WORKLOADS = [make(10_000, 1000)]
