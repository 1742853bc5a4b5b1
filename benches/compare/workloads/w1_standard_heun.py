"""Damped canonical oscillators driven by a sinusoidal acceleration, each with its own numbers, by Standard Heun."""

from __future__ import annotations

import numpy as np

from . import Array, Workload


class Forced(Workload):
    """v̇ = −ω(y + 2Dv) + a/ω, ẏ = ωv, a = amplitude·sin(frequency·t + phase)."""

    kind = "forced_standard_heun"
    about = "damped oscillators with a sinusoidal acceleration, all parameters their own, Standard Heun"

    def parts(self, t: float) -> tuple[Array, Array, Array]:
        """v and y at t, and a bound of the size of the state from 0 to t."""
        d = self.data
        w, damping, f = d["omega"], d["damping"], d["frequency"]
        drive = d["amplitude"] * np.exp(1j * d["phase"]) / (w * w - f * f + 2j * damping * w * f)
        # What is left after the driven motion decays and turns: s = decay ± i·turn.
        y0, v0 = d["y"] - drive.imag, d["v"] * w - (1j * f * drive).imag  # here v0 is ẏ
        decay, turn = damping * w, w * np.sqrt(1 - damping * damping)
        free = (y0 - 1j * (v0 + decay * y0) / turn) * np.exp((1j * turn - decay) * t)
        driven = drive * np.exp(1j * f * t)
        v = ((1j * turn - decay) * free).real + (1j * f * driven).imag
        size = np.abs(drive) * np.hypot(1, f / w) + np.abs(free) * np.exp(decay * t) * np.sqrt(2)
        return v / w, free.real + driven.imag, size

    def exact(self) -> tuple[Array, Array]:
        """Driven motion and what decays, by the formula of every textbook."""
        v, y, _ = self.parts(self.end)
        return v, y

    def bound(self) -> float:
        """Heun's step on s' = A·s + g misses h³(A·s''/6 − g''/12); what is missed decays with the motion."""
        d = self.data
        w, damping, f = d["omega"], d["damping"], d["frequency"]
        norm, force = w * (1 + 2 * damping), d["amplitude"] / w  # of A and of g
        second = norm * (norm * self.parts(self.end)[2] + force) + f * force
        missed = self.dt**2 * (norm * second / 6 + f * f * force / 12)  # per unit of time
        lasts = np.minimum(self.end, np.sqrt((1 + damping) / (1 - damping)) / (damping * w))
        return float((1.01 * lasts * missed).max())


def make(members: int, steps: int) -> Forced:
    """Oscillators of amplitude about 1."""
    rng = np.random.default_rng(2)
    data = {
        "v": np.zeros(members),
        "y": np.ones(members),
        "omega": rng.uniform(0.5, 2.0, members),
        "damping": rng.uniform(0.05, 0.2, members),
        "amplitude": rng.uniform(0.5, 1.0, members),
        "frequency": rng.uniform(0.5, 2.0, members),
        "phase": rng.uniform(-np.pi, np.pi, members),
    }
    return Forced("W1 forced", data, 0.01, steps)


WORKLOADS = [make(100_000, 1000), make(1, 100_000)]
