"""Pure Python: one member after the other, numbers in local variables."""

from __future__ import annotations

import math

import numpy as np

from .. import unrolled
from ..workloads import w2_pendulums
from . import Contestant, Ready, Workload


def free_false_euler(work: Workload, quick: bool) -> Ready:
    """v −= hω·y; y += hω·v."""
    rows = [row.tolist() for row in work.data.values()]

    def call():
        out = []
        for v, y, omega in zip(*rows, strict=True):
            w = work.dt * omega
            for _ in range(work.steps):
                v -= w * y
                y += w * v
            out.append((v, y))
        return tuple(np.array(out).T)

    return Ready(call)


def forced_standard_heun(work: Workload, quick: bool) -> Ready:
    """A predictor, then the mean of the increments at both ends."""
    rows = [row.tolist() for row in work.data.values()]

    def call():
        out, h, sin = [], work.dt, math.sin
        for v, y, omega, damping, amplitude, frequency, phase in zip(*rows, strict=True):
            w, drag, force = h * omega, 2.0 * damping * h * omega, h / omega * amplitude
            for k in range(work.steps):
                t = k * h
                dv1 = force * sin(frequency * t + phase) - w * y - drag * v
                dy1 = w * v
                v1, y1 = v + dv1, y + dy1
                dv2 = force * sin(frequency * (t + h) + phase) - w * y1 - drag * v1
                v += 0.5 * (dv1 + dv2)
                y += 0.5 * (dy1 + w * v1)
            out.append((v, y))
        return tuple(np.array(out).T)

    return Ready(call)


def pendulums_standard_heun(work: Workload, quick: bool) -> Ready:
    """A predictor, then the mean of the increments at both ends."""
    rows, drag, f = [row.tolist() for row in work.data.values()], 2.0 * w2_pendulums.DAMPING, w2_pendulums.FREQUENCY

    def call():
        out, h, sin = [], work.dt, math.sin
        for v, y, amplitude in zip(*rows, strict=True):
            for k in range(work.steps):
                t = k * h
                a1 = amplitude * sin(f * t) - sin(y) - drag * v
                v1, y1 = v + h * a1, y + h * v
                a2 = amplitude * sin(f * (t + h)) - sin(y1) - drag * v1
                v, y = v + 0.5 * h * (a1 + a2), y + 0.5 * h * (v + v1)
            out.append((v, y))
        return tuple(np.array(out).T)

    return Ready(call)


def bodies(work: Workload, quick: bool) -> Ready:
    """Each pair once, written out."""
    run = unrolled.one_by_one(work.bodies, work.dim, work.method, {"sqrt": math.sqrt, "empty": np.empty})
    rows = list(work.data.values())
    return Ready(lambda: run(work.dt, work.steps, *rows), more=int(work.method == "leapfrog"))


KERNELS = {
    "free_false_euler": free_false_euler,
    "forced_standard_heun": forced_standard_heun,
    "pendulums_standard_heun": pendulums_standard_heun,
    "bodies_false_euler": bodies,
    "bodies_leapfrog": bodies,
}
CONTESTANTS = [Contestant("pure Python", KERNELS, slow="members")]
