"""Waypoints: where members stood when their accepted steps had doubled once more; steps are examined from there after a run."""

from math import prod
from typing import Any

import numpy as np

from ...base.arrays import Array
from .controller import Pace

#: The first waypoint is that of so many accepted steps.
FIRST = 256
#: The count of accepted steps of a waypoint of which the state before it is known so far.
ON_THE_WAY = -1.0


def keep(rows: Array, accepted: Any, pace: Pace, v: Array, y: Array) -> None:
    """Keep where members stand that came by this attempt to a waypoint, or to a step before one.

    Args:
        rows: what is kept of the last waypoints, shape (waypoints, numbers, members): the state before the step to a waypoint,
            the state after it, and the numbers of the pace there, whose count of accepted steps is zero where there is none.
        accepted: how many steps members had accepted before the attempt.
        pace: the paces after it.
        v: velocities after it.
        y: coordinates after it.
    """
    count, members = np.reshape(pace.accepted, -1).astype(np.int64), prod(pace.t.shape)
    new = count > np.reshape(accepted, -1)
    there, next_there = (new & (each >= FIRST) & (each & (each - 1) == 0) for each in (count, count + 1))
    if not (there | next_there).any():
        return
    state = np.concatenate([each.reshape(each.size // members, members) for each in (v, y)])
    numbers = np.concatenate([state, np.array(np.broadcast_arrays(*pace.numbers)).reshape(-1, members)])
    n = len(state)
    counted = 2 * n + list(Pace._fields).index("accepted")
    for index in np.flatnonzero(there | next_there):
        of_waypoint = rows[(int(count[index] + next_there[index]).bit_length() - 1) % len(rows), :, index]
        if next_there[index]:
            of_waypoint[:n] = state[:, index]
            of_waypoint[counted] = ON_THE_WAY
        elif of_waypoint[counted] == ON_THE_WAY:
            of_waypoint[n:] = numbers[:, index]
