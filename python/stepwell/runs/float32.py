"""Checks of runs in float32."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import Array
from ..base.checks import LARGEST_SINGLE, fits_single
from ..errors import ArgumentError, UnsupportedError
from ..model.inputs import LAST_SINGLE_ANGLE
from ..model.systems import Sampled, Sinusoid

if TYPE_CHECKING:
    from ..model.methods import Method
    from ..model.systems import System


def check(system: System, method: Method) -> None:
    """Raise if this system or method does not work with float32."""
    if method.has_series:
        raise UnsupportedError(
            f"dtype: float32 does not work with {method.name}, whose series are computed in float64 only; use float64, or a "
            f"Runge-Kutta method such as rk4"
        )
    if system.contacts and _is_of_rods(system):
        raise UnsupportedError(
            f"dtype: float32 does not work with rods that meet surfaces, whose joints are decided by more digits than it has, "
            f"got {system!r}; use float64"
        )


def step(system: System, method: Method, dt: float) -> float:
    """The step rounded to float32; raise if it is out of range, or if this system or method does not work with float32."""
    check(system, method)
    return rounded_step(dt)


#: The least error of a step relative to the state that float32 can tell from rounding: the state is rounded by up to 2⁻²⁴ of its
#: size, and the sum of what is added to it by up to as much again.
LEAST_TOLERANCE = 2.0**-23


def check_tolerance(relative: Array, absolute: Array | None, sizes: Array) -> None:
    """Raise if the tolerance is less than the roundings of a step.

    Args:
        relative: of all groups of components of the state, or of each along the first axis.
        absolute: likewise; None if there is none.
        sizes: of each group along the first axis, at the start.
    """
    allowed = np.asarray(relative) * np.ones(sizes.shape)
    if absolute is not None:
        with np.errstate(all="ignore"):
            allowed = allowed + np.where(sizes > 0.0, absolute / sizes, np.inf)
    allowed = np.where((sizes > 0.0) & np.isfinite(sizes), allowed, np.inf)
    if not allowed.size or (least := float(allowed.min())) >= LEAST_TOLERANCE:
        return
    raise ArgumentError(
        f"tolerance: in float32 a step rounds the state by up to 2⁻²³ = {LEAST_TOLERANCE:.3g} of its size, whatever its length, "
        f"so no less can be asked for, got {least:.3g} of the size at the start; use {LEAST_TOLERANCE:.3g} or more, or float64"
    )


def _is_of_rods(system: System) -> bool:
    from ..model.systems import Pendulum3D, Rods  # only systems with surfaces need them

    return isinstance(system, (Pendulum3D, Rods))


def rounded_step(dt: float) -> float:
    """A step, rounded to float32; raise if it becomes zero or infinite."""
    rounded = float(np.float32(dt)) if abs(dt) <= LARGEST_SINGLE else np.inf
    if not 0.0 < abs(rounded) < np.inf:
        raise ArgumentError(f"dt: expected a number of size 1.4e-45 to 3.4e38 units of time in float32, got {dt!r}")
    return rounded


def rounded_state(*blocks: Array) -> tuple[Array, ...]:
    """A start, rounded to float32; raise if a number is out of range."""
    for name, block in zip("vy", blocks, strict=True):
        fits_single(name, block)
    return tuple(block.astype(np.float32).astype(np.float64) for block in blocks)


def check_written(system: System, what: str) -> None:
    """Raise if an exported step would need numbers of both widths."""
    for name, each in system.all_inputs().items():
        if isinstance(each, Sampled) and not each.constant:
            raise UnsupportedError(
                f"dtype: {what} has numbers of one width, but which sample of {name} holds is found at a time of float64; use "
                f"dtype='float64'"
            )


def check_inputs(system: System, last: float) -> None:
    """Raise if an input is not defined in float32 up to this time."""
    for name, each in system.all_inputs().items():
        if isinstance(each, Sinusoid):
            angle = float(np.abs(each.omega).max() * abs(last) + np.abs(each.phase).max())
            if angle > LAST_SINGLE_ANGLE:
                raise ArgumentError(
                    f"{name}: in float32 a sinusoid's angle may grow to {LAST_SINGLE_ANGLE:.3g} rad, but reaches {angle:.3g} rad "
                    f"by t = {last:g}"
                )
