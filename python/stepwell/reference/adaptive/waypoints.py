"""Waypoints: where members stood when their accepted steps had doubled once more; steps are examined from there after a run."""

from math import prod
from typing import Any

import numpy as np

from ...base.arrays import Array
from .controller import Pace

#: The first waypoint is that of so many accepted steps.
FIRST = 256


def keep(rows: Array, accepted: Any, before: tuple[Array, Array], pace: Pace, v: Array, y: Array) -> None:
    """Keep where members stand that came to a waypoint by this attempt, and where they stood before it.

    Args:
        rows: what is kept of the last waypoints, shape (waypoints, numbers, members): the state before the step to a waypoint,
            the state after it, and the numbers of the pace there.
        accepted: how many steps members had accepted before the attempt.
        before: v and y before it.
        pace: the paces after it.
        v: velocities after it.
        y: coordinates after it.
    """
    count, members = np.reshape(pace.accepted, -1).astype(np.int64), prod(pace.t.shape)
    there = (count > np.reshape(accepted, -1)) & (count >= FIRST) & (count & (count - 1) == 0)
    if not there.any():
        return
    numbers = np.concatenate([each.reshape(each.size // members, members) for each in (*before, v, y)])
    numbers = np.concatenate([numbers, np.array(np.broadcast_arrays(*pace.numbers)).reshape(-1, members)])
    for index in np.flatnonzero(there):
        rows[(int(count[index]).bit_length() - 1) % len(rows), :, index] = numbers[:, index]
