"""Checks of scenes' arguments whose squares and quotients must be finite."""

from __future__ import annotations

from typing import Any

from ..base.checks import number
from ..errors import ArgumentError


def within(argument: str, value: Any, least: float, most: float, unit: str = "") -> float:
    """Return ``value`` as one float between two bounds."""
    checked = number(argument, value, unit=unit)
    if not least <= checked <= most:
        raise ArgumentError(f"{argument}: expected {least:g} to {most:g}{f' {unit}' if unit else ''}, got {checked:g}")
    return checked


#: The range of numbers whose squares, quotients and products are finite and above zero.
SMALLEST, LARGEST = 1e-100, 1e100


def moderate(argument: str, value: Any, unit: str = "") -> float:
    """Return ``value`` as one float above zero, such that squares and quotients are finite and not zero."""
    return within(argument, value, SMALLEST, LARGEST, unit)


def frequency(argument: str, value: Any) -> float:
    """Return ``value`` as one frequency, such that squares and periods of it are finite."""
    return moderate(argument, value, "rad per unit of time")
