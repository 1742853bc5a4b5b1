"""Charts: data objects with ``.plot()``, ``.to_csv()``, ``.to_json()`` and ``.summary()``."""

from .data import Curve, Point, Timing, WorkPrecision
from .figures import Figures, Samples, figures
from .maps import Observation, StabilityMap, stability_map
from .powers import Powers, powers
from .work_precision import work_precision
from .zplane import Locus, Stability, stability

__all__ = [
    "Curve",
    "Figures",
    "Locus",
    "Observation",
    "Point",
    "Powers",
    "Samples",
    "Stability",
    "StabilityMap",
    "Timing",
    "WorkPrecision",
    "figures",
    "powers",
    "stability",
    "stability_map",
    "work_precision",
]
