"""Adaptive runs that save the state at every n-th accepted step of each member."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ..base.arrays import Array, Whole
from . import engine
from .events.members import Members

#: The most numbers that the core fills with states of steps before they are copied.
NUMBERS_AT_ONCE = 1 << 21


class StepKeeper:
    """Makes runs as ``engine.adapt`` does, and saves the state at every n-th accepted step of each member."""

    def __init__(self, every: int) -> None:
        self._every = every
        self._parts: list[tuple[Whole, engine.KeptSteps, Any]] = []

    def adapt(
        self,
        plan: engine.Plan,
        pacing: engine.Pacing,
        paces: Array,
        v: Array,
        y: Array,
        index: Whole | None = None,
        until: Any = None,
    ) -> engine.Adapted:
        """Step these members of the whole run. Each may stop early, at its time in ``until`` (NaN for the end of the run)."""
        index = np.arange(plan.members) if index is None else index
        end = np.broadcast_to(pacing.at[-1], plan.batch).reshape(-1)
        until = end if until is None else np.where(np.isnan(until), end, until)
        pacing = pacing._replace(every=self._every, room=self._room(plan, pacing.budget))
        out = engine.adapt(plan, pacing, paces, v, y)
        self._take(index, out, until)
        left = np.flatnonzero(out.status == engine.FULL)
        if not len(left):
            return out
        shapes, numbers, members = (plan.system.v_shape, plan.system.y_shape), len(out.paces), Members(plan)
        times, blocks = len(pacing.at), zip((out.v, out.y), shapes, strict=True)
        states = [(block.reshape(times, *shape, plan.members), shape) for block, shape in blocks]
        ends = [block.reshape(*shape, plan.members) for block, shape in zip((out.last_v, out.last_y), shapes, strict=True)]
        rows, status = out.paces.reshape(numbers, -1), out.status.reshape(-1)
        while len(left):
            part = members.plan(left)
            at, jumps = (_of_members(times, plan, left) for times in (pacing.at, pacing.jumps))
            again = pacing._replace(waypoints=False, at=at, jumps=jumps, begins=False, room=self._room(part, pacing.budget))
            piece = engine.adapt(part, again, np.ascontiguousarray(rows[:, left]), *(end[..., left] for end in ends))
            self._take(index[left], piece, until[left])
            rows[:, left], status[left] = piece.paces, piece.status
            for (saved, _), block in zip(states, (piece.v, piece.y), strict=True):
                saved[..., left] = block
            for end, block in zip(ends, (piece.last_v, piece.last_y), strict=True):
                end[..., left] = block
            left = left[piece.status == engine.FULL]
        return out

    def saved(
        self, plan: engine.Plan, start: tuple[Array, Array, Array], last: tuple[Array, Array, Array]
    ) -> tuple[Array, Array, Array]:
        """The states at the start, at the steps and at the end, each as t, v and y; NaN where a member has no more.

        Times are those of the plan.
        """
        total, batch = plan.members, plan.batch
        count = np.zeros(total, np.int64)
        parts = [(index, steps, _within(steps, until)) for index, steps, until in self._parts]
        for index, _, there in parts:
            count[index] += there.sum(axis=0)
        rows = 2 + int(count.max(initial=0))
        blocks = []
        for first, end in zip(start, last, strict=True):
            own = end.shape[: end.ndim - len(batch)]
            block = np.full((rows, *own, *batch), np.nan)
            block[0], block[-1] = first, end
            blocks.append(block)
        flat = [block.reshape(rows, *block.shape[1 : block.ndim - len(batch)], total) for block in blocks]
        count[:] = 1
        for index, steps, there in parts:
            row, place = np.nonzero(there)
            to = count[index[place]] + row
            for block, values in zip(flat, steps[1:], strict=True):
                block[to, ..., index[place]] = values[row, ..., place]
            count[index] += there.sum(axis=0)
        return blocks[0], blocks[1], blocks[2]

    def _room(self, plan: engine.Plan, budget: int) -> int:
        """How many steps of each member the core saves before they are copied."""
        numbers = 1 + prod(plan.system.v_shape) + prod(plan.system.y_shape)
        return int(max(1, min(NUMBERS_AT_ONCE // (numbers * max(plan.members, 1)), budget // self._every)))

    def _take(self, index: Whole, out: engine.Adapted, until: Any) -> None:
        assert out.steps is not None
        count, *blocks = out.steps
        most = int(count.max(initial=0))
        self._parts.append((index, engine.KeptSteps(count, *(block[:most].copy() for block in blocks)), until))


def _of_members(times: Any, plan: engine.Plan, index: Whole) -> Any:
    """Times of these members, from times of each or of all."""
    if times is None or times.ndim == 1:
        return times
    wide = np.broadcast_to(times.reshape(len(times), *(times.shape[1:] or (1,))), (len(times), *plan.batch))
    return np.ascontiguousarray(wide.reshape(len(times), -1)[:, index])


def _within(steps: engine.KeptSteps, until: Any) -> Any:
    """Which entries are steps that end before their member does."""
    there = np.arange(len(steps.t))[:, np.newaxis] < steps.counts
    return there & (np.where(there, steps.t, np.inf) < until)
