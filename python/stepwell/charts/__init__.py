"""Charts: data objects with ``.plot()``, ``.to_csv()``, ``.to_json()`` and ``.summary()``."""

from .data import Curve, Point, Timing, WorkPrecision
from .work_precision import work_precision

__all__ = ["Curve", "Point", "Timing", "WorkPrecision", "work_precision"]
