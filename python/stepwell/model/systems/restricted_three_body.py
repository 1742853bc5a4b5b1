"""The planar circular restricted three-body problem."""

from __future__ import annotations

from typing import Any

from ...base import checks
from ...base.arrays import Shape
from ...errors import ArgumentError
from ...reference.systems.restricted_three_body import RestrictedThreeBody as Reference
from .base import System, shown


class RestrictedThreeBody(System):
    """The planar circular restricted three-body problem: a body without mass near two that circle each other, in their frame.

    The unit of length is the distance of the two, that of mass their total mass, and a turn of the frame takes 2π. The heavy
    body, of mass 1 − μ, is at rest at (−μ, 0) and the light one, of mass μ, at (1 − μ, 0). Blocks have shape (2,).

    ẍ = x + 2ẏ − (1 − μ)(x + μ)/r₁³ − μ(x − 1 + μ)/r₂³, ÿ = y − 2ẋ − (1 − μ)y/r₁³ − μy/r₂³

    Its energy is Jacobi's integral, ½|v|² − ½(x² + y²) − (1 − μ)/r₁ − μ/r₂, the only one that the motion conserves in this frame.

    Args:
        mu: μ, the light body's fraction of the mass, above 0 and below 1; broadcasts over the batch. By default the moon's
            fraction of earth and moon, as Arenstorf used it.

    Raises:
        ArgumentError: what is wrong with ``mu``.

    Example:
        >>> moon = sw.scenes.arenstorf()
        >>> moon.system
        RestrictedThreeBody(mu=0.012277471)
        >>> run = sw.integrate(moon.system, "merson", v=moon.v, y=moon.y, tolerance=1e-9, at=[moon.period])
        >>> run.y[-1].round(3)
        array([0.994, 0.   ])
    """

    kernel = "restricted_three_body"
    reference = Reference
    complex_step = True
    axes = "x and y"
    v_shape = y_shape = (2,)
    velocity_term = "the Coriolis force"

    def __init__(self, mu: Any = 0.012277471) -> None:
        self.mu = checks.numbers("mu", mu)
        wrong = self.mu[~((self.mu > 0.0) & (self.mu < 1.0))]
        if wrong.size:
            raise ArgumentError(f"mu: expected shares of the mass above 0 and below 1, got {wrong.flat[0]:g}")
        self.batch = self.mu.shape

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        return shown(mu=self.mu)

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """μ."""
        return {"mu": self.mu}
