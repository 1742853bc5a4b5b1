"""Ensembles: ``sweep``, samples for its axes, and the outcomes of each member."""

from .adaptive import Evaluations
from .crossings import Crossing, Period
from .ensemble import sweep
from .exponents import Exponents
from .outcomes import Extremes, Function, History, Last, Mean
from .samples import random, sobol

__all__ = [
    "Crossing", "Evaluations", "Exponents", "Extremes", "Function", "History", "Last", "Mean", "Period", "random", "sobol",
    "sweep",
]  # fmt: skip
