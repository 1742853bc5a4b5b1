"""Newton's constant of gravity in the units of astronomers."""

from __future__ import annotations

from typing import Any

from ...base import checks

#: Metres of each unit of length (IAU 2012 B2 and 2015 B2, B3).
LENGTHS = {"m": 1.0, "km": 1e3, "earth": 6.3781e6, "solar": 6.957e8, "au": 1.495978707e11, "pc": 3.0856775814913674e16}

#: Seconds of each unit of time; a year is Julian.
TIMES = {"s": 1.0, "minute": 60.0, "hour": 3600.0, "day": 86400.0, "year": 31557600.0}

#: G·m of each unit of mass in m³/s². Those of bodies are known far better than their masses in kg (IAU 2015 B3; CODATA 2018).
STRENGTHS = {"kg": 6.67430e-11, "earth": 3.986004e14, "jupiter": 1.2668653e17, "solar": 1.3271244e20}


def gravity(length: Any = "au", mass: Any = "solar", time: Any = "year") -> float:
    """Return Newton's constant G in units of your choice, for ``NBody(…, G=…)`` and ``orbits.system(…, G=…)``.

    Args:
        length: ``"m"``, ``"km"``, ``"earth"`` (its radius), ``"solar"`` (the sun's radius), ``"au"`` or ``"pc"``.
        mass: ``"kg"``, ``"earth"``, ``"jupiter"`` or ``"solar"``. Of the last three G·m is the nominal one of the IAU (2015),
            which is known to ten digits, while G in kilograms is known to five.
        time: ``"s"``, ``"minute"``, ``"hour"``, ``"day"`` or ``"year"``, of 365.25 days.

    Returns:
        G in length³/(mass·time²).

    Raises:
        ArgumentError: if there is no such unit.

    Example:
        >>> round(sw.orbits.gravity("au", "solar", "year"), 9)
        39.476926409
        >>> sw.orbits.gravity("m", "kg", "s")
        6.6743e-11
    """
    metres = LENGTHS[checks.known("length", length, tuple(LENGTHS))]
    strength = STRENGTHS[checks.known("mass", mass, tuple(STRENGTHS))]
    seconds = TIMES[checks.known("time", time, tuple(TIMES))]
    return strength * seconds / metres * seconds / metres / metres
