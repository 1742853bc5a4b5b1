"""The rows of an advice: methods with a step that is accurate enough, rejected methods, and the shortfall if none fits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...base.reprs import one_line
from ...model.methods import Method


@dataclass(frozen=True)
class Row:
    """A method with the largest step, or tolerance, that was found to be accurate enough in a run.

    Attributes:
        method: the method.
        substeps: steps in a frame; None without a frame and for adaptive steps.
        steps: steps over the horizon; for adaptive steps all attempts.
        dt: the step, in units of time; for adaptive steps the mean of all attempts.
        error: the largest state error of the run.
        predicted: the error predicted without that run, or None where no prediction is possible.
        predicted_by: ``"modes"``, the eigenvalues and modes of the step; ``"order"``, a run with longer steps and the order.
        frequency_error: Ψ/Φ − 1 of the mode that drifts most, or None.
        damping_error: damping that the method adds to that mode, in 1 per unit of time; below zero it grows. Or None.
        evaluations_per_frame: mean number of function (rate) evaluations in a frame; None without a frame.
        evaluations_per_time: function (rate) evaluations per unit of time.
        ns_per_step: measured nanoseconds per step of one member of a batch, on one thread. Not repeatable.
        seconds_per_frame: measured mean computing time of a frame; None without a frame.
        seconds_per_time: measured computing time per unit of time.
        objects: the number of such scenes that fit into the budget, in the most expensive frame; None without a budget.
        limit: the step beyond which a mode grows, by the eigenvalues: 0 for never stable, infinite for no limit, None if they
            do not decide, and for adaptive steps.
        limit_by: ``"linear"``, exact; ``"frozen"``, the fastest oscillation of the system linearised along the true motion;
            ``"none"``, for adaptive steps.
        mode: the kind of growth beyond the limit, in words, or None.
        mode_frequency: its frequency in the exact solution, in rad per unit of time, or None.
        observed_limit: the largest step whose run over the horizon does not grow; infinite if no tried run grows.
        robust: the number of steps (in a frame, or over the horizon) from which on, or the tolerance below which, all tried runs
            are accurate enough; None if errors are above the tolerance up to twice as many steps.
        tolerance: the tolerance of adaptive steps, as in ``integrate``; None for fixed steps.
        rejected_steps: the number of rejected steps among the steps.
        worst_evaluations: function (rate) evaluations in the most expensive frame; None without a frame.
        dtype: ``"float64"`` or ``"float32"``, the precision of its steps. In float32 the step is ``dt`` rounded to it.
        float64_error: for a row in float32, the largest state error of the same steps in float64; else None.
        float64_ns_per_step: for a row in float32, nanoseconds per step of the same method in float64; else None.
    """

    method: Method
    substeps: int | None
    steps: int
    dt: float
    error: float
    predicted: float | None
    predicted_by: str | None
    frequency_error: float | None
    damping_error: float | None
    evaluations_per_frame: float | None
    evaluations_per_time: float
    ns_per_step: float
    seconds_per_frame: float | None
    seconds_per_time: float
    objects: int | None
    limit: float | None
    limit_by: str
    mode: str | None
    mode_frequency: float | None
    observed_limit: float
    robust: float | None
    tolerance: float | None = None
    rejected_steps: int = 0
    worst_evaluations: int | None = None
    dtype: str = "float64"
    float64_error: float | None = None
    float64_ns_per_step: float | None = None

    __repr__ = one_line

    @property
    def by(self) -> str:
        """``"step"`` for fixed steps, ``"tolerance"`` for adaptive ones."""
        return "step" if self.tolerance is None else "tolerance"

    @property
    def name(self) -> str:
        """The method's name, followed by "tolerance" for adaptive steps or by "float32": ``"merson, tolerance"``."""
        return named(self.method.name, self.by, self.dtype)

    @property
    def margin(self) -> float:
        """By which factor the step may be longer up to the stability limit, the exact one or else the observed one.

        It is infinite for adaptive steps, which are shortened instead.
        """
        exact = self.limit_by == "linear" and self.limit
        return (self.limit if exact and self.limit else self.observed_limit) / self.dt

    @property
    def is_robust(self) -> bool:
        """True if slightly more steps are good enough too."""
        if self.tolerance is not None:
            return self.robust is not None and self.robust >= self.tolerance
        return self.robust is not None and self.robust <= (self.steps if self.substeps is None else self.substeps)

    def data(self) -> dict[str, Any]:
        """The row as a dictionary, with the method by its name."""
        names = [name for name in self.__dataclass_fields__ if name != "method"]
        first = {"method": self.method.name, "by": self.by}
        return first | {name: getattr(self, name) for name in names} | {"margin": self.margin}


@dataclass(frozen=True)
class Rejected:
    """Why a method is not advised.

    Attributes:
        method: its name.
        kind: ``"refused"`` by the system; ``"unstable"`` or ``"inaccurate"`` at the most steps that were tried; ``"dominated"``,
            more than ten times as expensive as the best; ``"budget"``, good enough but too expensive.
        reason: the reason in words and numbers.
        by: ``"step"`` for fixed steps, ``"tolerance"`` for adaptive ones.
        dtype: ``"float64"`` or ``"float32"``, the precision of its steps.
    """

    __repr__ = one_line

    method: str
    kind: str
    reason: str
    by: str = "step"
    dtype: str = "float64"

    @property
    def name(self) -> str:
        """The method's name, followed by "tolerance" for adaptive steps or by "float32": ``"merson, tolerance"``."""
        return named(self.method, self.by, self.dtype)


@dataclass(frozen=True)
class Shortfall:
    """The tolerance and the budget that would suffice if nothing fits.

    Attributes:
        least_error: the least state error within the budget, or infinity.
        method: the method with this error, or None.
        substeps: its steps in a frame (over the horizon without one), or None.
        needed_budget: seconds in a frame (in a unit of time without one) that the tolerance needs, or None if nothing meets it.
        needed_method: the method that needs them, ``"merson, tolerance"`` for adaptive steps, or None.
        tolerance: the tolerance of the adaptive steps with the least error, or None.
        dtype: the precision of these steps.
    """

    __repr__ = one_line

    least_error: float
    method: str | None
    substeps: int | None
    needed_budget: float | None
    needed_method: str | None
    tolerance: float | None = None
    dtype: str = "float64"


def named(method: str, by: str, dtype: str) -> str:
    """The method's name, followed by "tolerance" for adaptive steps, or by "float32"."""
    return f"{method}{'' if by == 'step' else ', tolerance'}{'' if dtype == 'float64' else ', float32'}"
