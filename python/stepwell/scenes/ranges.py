"""Arguments of scenes whose squares and quotients must be numbers."""

from __future__ import annotations

from typing import Any

from .._checks import number
from ..errors import ArgumentError


def within(argument: str, value: Any, least: float, most: float, unit: str = "") -> float:
    """Return ``value`` as one float between two bounds."""
    found = number(argument, value, unit=unit)
    if not least <= found <= most:
        raise ArgumentError(f"{argument}: expected {least:g} to {most:g}{f' {unit}' if unit else ''}, got {found:g}")
    return found
