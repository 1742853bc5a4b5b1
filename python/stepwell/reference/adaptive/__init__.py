"""Adaptive steps: each member has steps of its own, as long as the estimate of their error stays within a tolerance.

The files are named as the core's in ``step/``: ``sizes`` of components, the ``controller``, ``attempts``, and ``pace``, which
decides after them. ``runs`` goes from one saved time to the next. What is tolerated is in ``reference/acceptance.py``.
"""

from .attempts import Attempted, Backward, Pair, Stretched, Tried, tried, within
from .controller import MAX_FACTOR, MIN_FACTOR, MOVES, SINGLE_MOVES, Outlook, Pace
from .pace import (
    LEAST_PART,
    ONSET,
    OUTSIDE,
    PUSHED,
    ROUNDING,
    SINGLE_ROUNDING,
    Extension,
    attempt,
    begin,
    decided,
    extension,
    judged,
    over,
    rounded,
    small_of,
    tolerated,
)
from .runs import BUDGET, NOT_FINITE, OK, UNDERFLOW, Jumps, Outcome, run, waiting
from .sizes import largest, longer, numbers_in, sizes, stacked, total

__all__ = [
    "BUDGET",
    "LEAST_PART",
    "MAX_FACTOR",
    "MIN_FACTOR",
    "MOVES",
    "NOT_FINITE",
    "OK",
    "ONSET",
    "OUTSIDE",
    "PUSHED",
    "ROUNDING",
    "SINGLE_MOVES",
    "SINGLE_ROUNDING",
    "UNDERFLOW",
    "Attempted",
    "Backward",
    "Extension",
    "Jumps",
    "Outcome",
    "Outlook",
    "Pace",
    "Pair",
    "Stretched",
    "Tried",
    "attempt",
    "begin",
    "decided",
    "extension",
    "judged",
    "largest",
    "longer",
    "numbers_in",
    "over",
    "rounded",
    "run",
    "sizes",
    "small_of",
    "stacked",
    "tolerated",
    "total",
    "tried",
    "waiting",
    "within",
]
