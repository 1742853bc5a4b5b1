"""Stability in the z-plane (§4): the eigenvalues of the transition matrix of a step.

``maps`` computes the matrices, ``eigen`` their eigenvalues and modes, ``analysis`` puts them into Hoffmann's words, ``limit``
finds the step at which a mode begins to grow, ``along`` does so at every saved state of a run, ``expansion`` computes series in
Φ, ``counted`` counts operations, ``criterion`` answers Hoffmann's four criteria for every method.
"""

from .along import StabilityAlong, stability_along
from .analysis import KINDS, Analysis, analyse
from .counted import Operations, operations
from .criterion import Criteria, Criterion, criteria
from .expansion import Series, series
from .function import StabilityFunction, function
from .limit import Mode, StabilityLimit, StabilityLimits, stability_limit

__all__ = [
    "KINDS", "Analysis", "Criteria", "Criterion", "Mode", "Operations", "Series", "StabilityAlong", "StabilityFunction",
    "StabilityLimit", "StabilityLimits", "analyse", "criteria", "function", "operations", "series", "stability_along",
    "stability_limit",
]  # fmt: skip
