"""The results of ``stability_limit``: numbers with the mode that grows beyond them."""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from ...base.immutable import by_value
from ...base.reprs import facts
from .eigen import Complex


@by_value
class Mode(NamedTuple):
    """The mode that begins to grow at a stability limit.

    Attributes:
        eigenvalue: z of P at the limit, on the unit circle.
        angle: Ψ in 0 … π, its angle per step.
        rate: λ of the mode in the exact solution, in 1 per unit of time; its imaginary part is its frequency.
        kind: what it does past the limit, in Hoffmann's words.
        v: its shape in the velocities, complex, shape (*block); the largest number of both blocks is 1.
        y: its shape in the coordinates.
    """

    eigenvalue: complex
    angle: float
    rate: complex
    kind: str
    v: Complex
    y: Complex


class StabilityLimit(float):
    """A stability limit: the largest stable step, in units of time; 0 if no step is stable, infinite if all are.

    It is a number, and NaN where rounding hides what happens between the two steps ``stable`` and ``grows``.

    Attributes:
        mode: what begins to grow there; None if nothing does.
        stable: the largest step that is known to be stable: the limit itself if it is ``decided``.
        grows: the smallest step that is known to grow, likewise.
    """

    mode: Mode | None
    stable: float
    grows: float

    def __new__(cls, stable: float, mode: Mode | None, grows: float | None = None) -> StabilityLimit:
        """The number, with the mode."""
        limit = super().__new__(cls, stable if grows is None or grows == stable else math.nan)
        limit.mode = mode
        limit.stable = float(stable)
        limit.grows = limit.stable if grows is None else grows
        return limit

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self.stable, self.mode, self.grows

    @property
    def decided(self) -> bool:
        """True if the limit is known. It is not where so many eigenvalues nearly meet that rounding hides what grows."""
        return self.grows == self.stable

    def __repr__(self) -> str:
        """The number, or the two between which it is."""
        return f"{self.stable!r}" if self.decided else f"<between {self.stable!r} and {self.grows!r}, not decided>"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        mode = self.mode
        return facts(
            "Stability limit",
            [
                ("largest stable step", repr(self)),
                ("then", None if mode is None else mode.kind),
                ("frequency of the mode", None if mode is None else f"{abs(mode.rate.imag):.6g}"),
                ("angle Ψ of a step", None if mode is None else f"{mode.angle:.6g} rad"),
            ],
        )

    @property
    def dt(self) -> float:
        """The limit as a plain float."""
        return float(self)


class StabilityLimits(np.ndarray[Any, np.dtype[np.float64]]):
    """Stability limits of a batch: an array of numbers.

    They are NaN where they are not decided.

    Attributes:
        modes: the modes that begin to grow, an array of the same shape of ``Mode`` or None; None after arithmetic on limits.
        stable: the largest steps that are known to be stable: the limits themselves where they are decided.
        grows: the smallest steps that are known to grow, likewise.
    """

    modes: Any = None
    stable: Any = None
    grows: Any = None

    def __array_finalize__(self, other: Any) -> None:
        """A result of arithmetic on limits is no longer a limit, and has no modes."""
        self.modes = self.stable = self.grows = None

    @property
    def decided(self) -> Any:
        """True where the limit is known, as ``StabilityLimit.decided``."""
        return np.asarray(self.grows == self.stable)

    def __reduce__(self) -> tuple[Any, ...]:
        return limits_of, (self.stable, self.modes, self.grows)

    def __copy__(self) -> StabilityLimits:
        return limits_of(self.stable, self.modes, self.grows)

    def __deepcopy__(self, memo: Any) -> StabilityLimits:
        return limits_of(self.stable.copy(), copy.deepcopy(self.modes, memo), copy.deepcopy(self.grows, memo))


def limits_of(stable: Array, modes: Any, grows: Any) -> StabilityLimits:
    """Limits between these steps, with these modes."""
    limits = np.where(stable == grows, stable, np.nan).view(StabilityLimits)
    limits.modes, limits.stable, limits.grows = modes, stable, grows
    return limits
