"""W1: undamped canonical oscillators, each with its own ω, by False Euler; only the final state is kept."""

from __future__ import annotations

import numpy as np

from . import Array, Workload


class Free(Workload):
    """v̇ = −ωy, ẏ = ωv."""

    kind = "free_false_euler"
    about = "undamped oscillators, own ω each, False Euler"

    def exact(self) -> tuple[Array, Array]:
        """The state turns by ω·t."""
        v, y, angle = self.data["v"], self.data["y"], self.data["omega"] * self.end
        return v * np.cos(angle) - y * np.sin(angle), y * np.cos(angle) + v * np.sin(angle)

    def bound(self) -> float:
        """The circle becomes an ellipse, off by at most Φ, and is run through faster by Φ²/24 + O(Φ⁴)."""
        phi = self.data["omega"] * self.dt
        drift = self.steps * phi**3 / 24
        return float((phi + 1.01 * drift).max())


def make(members: int, steps: int) -> Free:
    """Oscillators of amplitude 1 and ω between ½ and 2."""
    rng = np.random.default_rng(1)
    data = {"v": np.zeros(members), "y": np.ones(members), "omega": rng.uniform(0.5, 2.0, members)}
    return Free("W1", data, 0.01, steps)


WORKLOADS = [make(100_000, 1000), make(1000, 1000), make(1, 1_000_000)]
