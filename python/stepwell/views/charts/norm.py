"""Is control better than resetting? The norm of a quaternion and the angle of a step, over the gain of its control (§12)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.pictures import Drawn
from ...base.tables import Table, stacked
from ...errors import ArgumentError, ShapeError
from ...model.compatibility import fits_together
from ...model.controls import NormControl, Projection
from ...model.methods import Method, choice
from ...model.systems import RigidBody
from ...runs.execution import quietly
from ...runs.result import Run

#: Default methods: of first, second and fourth order. False Euler steps a steady turn as Standard Euler does.
METHODS = ("standard_euler", "standard_heun", "rk4")

#: Default gains h·k: up to nearly 1, above which Euler's norm does not converge, and Heun's does to another value.
GAINS = tuple(float(gain) for gain in np.geomspace(0.01, 0.98, 101))

#: The default angle Φ = ½h|ω| by which a true step turns the quaternion, in rad; the body turns by twice that.
PHI = 0.1

#: Steps in which a deviation of the norm has decayed, if it does: it shrinks by 1 − 2hk in a step at a small gain.
STEPS = 2500

#: The norm has settled where its last two values differ by less than this.
SETTLED = 1e-12


@dataclass(frozen=True, eq=False)
class Settled(ValueEquality):
    """One method: the norm at which its quaternion settles under control, and the error of the angle of a step there.

    Attributes:
        method: the method.
        gains: h·k, shape (gains,).
        norm_error: q·q − 1 when it has settled, shape (gains,); NaN where it does not.
        angle_error: the error of the angle of a step, as a fraction of it, of the same shape; NaN likewise.
        growth: the relative growth of q·q in a step without control.
        angle_error_reset: the relative error of the angle if q is reset to the length 1 after every step; it is the same without
            resetting.
    """

    method: Method
    gains: Array
    norm_error: Array
    angle_error: Array
    growth: float
    angle_error_reset: float

    @property
    def largest_gain(self) -> float:
        """The largest gain at which the norm settled, or NaN if it did at none."""
        settled = self.gains[np.isfinite(self.norm_error)]
        return float(settled.max()) if settled.size else float("nan")


@dataclass(frozen=True, eq=False)
class NormSweep(Drawn, Table, ValueEquality):
    """A steady turn under control of the norm, over the gain, beside the same turn with the norm reset.

    A row for each method and gain.

    Attributes:
        phi: Φ = ½h|ω|, the angle of a true step of the quaternion, in rad.
        lines: one for each method.
    """

    phi: float
    lines: tuple[Settled, ...]
    _painter = "draw_norm"

    def summary(self) -> list[dict[str, Any]]:
        """A row for each method: what resetting does, the least error of the angle under control, and the largest gain."""
        rows = []
        for line in self.lines:
            known = np.isfinite(line.angle_error)
            best = int(np.argmin(np.where(known, np.abs(line.angle_error), np.inf))) if known.any() else None
            rows.append(
                {
                    "method": line.method.name,
                    "growth": line.growth,
                    "angle_error_reset": line.angle_error_reset,
                    "least_angle_error": float("nan") if best is None else float(line.angle_error[best]),
                    "at_gain": float("nan") if best is None else float(line.gains[best]),
                    "largest_gain": line.largest_gain,
                }
            )
        return rows

    def _head(self) -> dict[str, Any]:
        return {"phi": self.phi}

    def _columns(self) -> dict[str, list[Any]]:
        return stacked(
            {"method": line.method.name}
            | {name: getattr(line, name) for name in ("gains", "norm_error", "angle_error", "angle_error_reset")}
            for line in self.lines
        )


def norm(
    methods: Iterable[Method | str] = METHODS,
    *,
    phi: float = PHI,
    gains: Any = GAINS,
    progress: Callable[[float], object] | None = None,
) -> NormSweep:
    """Turn a body steadily by several methods, under control of its quaternion's norm with many gains, and with the norm reset.

    The rate is constant, so that all errors are those of the quaternion. All gains of a method are one batch.

    Args:
        methods: names, or what ``stepwell.method`` returns.
        phi: Φ = ½h|ω|, the angle of a true step of the quaternion, in rad, above 0 and below 1.
        gains: h·k of the control, shape (gains,), without a unit.
        progress: a function that is called with the fraction that is done.

    Raises:
        UnsupportedError: if a method cannot step a rigid body.

    Example:
        >>> chart = sw.charts.norm(["standard_euler"])
        >>> figure = chart.plot("norm.png")
    """
    chosen = choice(METHODS if methods is None else methods)
    phi = checks.number("phi", phi, positive=True, unit="rad")
    if not phi < 1.0:
        raise ArgumentError(f"phi: expected an angle above 0 and below 1 rad, got {phi:g}")
    strengths = np.atleast_1d(checks.numbers("gains", gains, positive=True))
    if strengths.ndim != 1 or not strengths.size:
        raise ShapeError(f"gains: expected gains of shape (gains,), got {strengths.shape}")
    progress = checks.callback("progress", progress)
    body = RigidBody([1.0, 1.0, 1.0])
    for method in chosen:
        fits_together(body, method)
    lines = []
    for i, method in enumerate(chosen):
        lines.append(_line(body, method, phi, np.sort(strengths)))
        if progress is not None:
            progress((i + 1) / len(chosen))
    return NormSweep(phi, tuple(lines))


def _line(body: RigidBody, method: Method, phi: float, gains: Array) -> Settled:
    """Steps of the length 1 at |ω| = 2Φ, so that a gain is its own k."""

    def run(steps: int, **options: Any) -> Run:
        # No warnings: the chart shows which gains are too large.
        return quietly(body, method, v=[0.0, 0.0, 2.0 * phi], y=[1.0, 0.0, 0.0, 0.0], dt=1.0, steps=steps, **options)

    once = run(1, record="norm_error")
    reset = run(1, control=Projection("norm"), every=1)
    controlled = run(STEPS, control=NormControl(gains), every=STEPS - 1)
    with np.errstate(all="ignore"):
        square = (controlled.y[-2:] ** 2).sum(axis=1)
        settled = np.abs(square[1] - square[0]) < SETTLED
        error = np.where(settled, square[1] - 1.0, np.nan)
        turned = np.where(settled, _angle(controlled.y[-2], controlled.y[-1]) / phi - 1.0, np.nan)
    without = float(_angle(reset.y[0], reset.y[1])) / phi - 1.0
    return Settled(method, gains, error, turned, float(once.recorded["norm_error"][-1]), without)


def _angle(p: Array, q: Array) -> Array:
    """The angle between two quaternions, by its half, which is exact where it is small."""
    p, q = (each / np.sqrt((each * each).sum(axis=0)) for each in (p, q))
    return np.asarray(2.0 * np.arcsin(np.minimum(1.0, 0.5 * np.sqrt(((p - q) ** 2).sum(axis=0)))))
