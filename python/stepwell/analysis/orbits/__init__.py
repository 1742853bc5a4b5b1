"""Orbits: elements to states and back, bodies on orbits about each other, Jacobi's coordinates, Kepler's equation, units.

Angles are in rad. Arrays have one entry for each orbit along the first axis, and batch axes last.
"""

from .corrector import corrected, uncorrected
from .elements import Elements, of_state, state
from .hierarchy import Start, elements, inertial, jacobi, system
from .kepler import eccentric_anomaly
from .units import gravity

__all__ = [
    "Elements", "Start", "corrected", "eccentric_anomaly", "elements", "gravity", "inertial", "jacobi", "of_state", "state",
    "system", "uncorrected",
]  # fmt: skip
