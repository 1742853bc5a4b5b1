"""Members whose absolute tolerance is most of the tolerated error of a step, and much of the motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from ...errors import ToleranceWarning
from .. import engine
from ..finding import Finding, named
from . import Case

#: An absolute tolerance above this fraction of the largest length of a block so far gives a warning.
MAX_ABSOLUTE_SHARE = 0.01
#: The warning for ``who``.
LOST = (
    f"tolerance: for {{who}} the absolute part lets a step err by more than {MAX_ABSOLUTE_SHARE:g} of the longest that v or y "
    f"has been; give one number, which goes by these lengths, or a smaller absolute part"
)


def of_run(case: Case) -> Finding | None:
    """The members of a run whose motion is lost in the absolute tolerance."""
    assert case.run.controller_state is not None
    pace = case.run.controller_state.pace
    if not (pace[engine.ABSOLUTE] > engine.LEAST).any():
        return None
    lost = lost_in_tolerance(pace, engine.groups_of(case.request.plan))
    return Finding(ToleranceWarning, LOST.format(who=named(lost).share), lost) if lost.any() else None


def lost_in_tolerance(paces: Array, groups: int) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Members whose absolute tolerance is most of the tolerated error, and much of the motion itself, shape (*batch).

    ``paces`` are their step-size controllers. The motion is measured by the largest length of a group so far.
    """
    absolute, relative = paces[engine.ABSOLUTE], paces[engine.RELATIVE]
    longest = paces[engine.PACE_NUMBERS : engine.PACE_NUMBERS + groups].max(axis=0, initial=0.0)
    lost = (longest > 0.0) & (absolute > relative * longest) & (absolute > MAX_ABSOLUTE_SHARE * longest)
    return np.asarray(lost, dtype=bool)
