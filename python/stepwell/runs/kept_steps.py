"""Adaptive runs that keep the state at every so manieth accepted step of each member."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ..base.arrays import Array, Whole
from . import engine
from .events.members import Members

#: How many numbers of steps the core fills before they are taken over.
NUMBERS_AT_ONCE = 1 << 21


class StepKeeper:
    """Makes runs as ``engine.adapt`` does, and keeps the state at every so manieth accepted step of each member."""

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
        """Make it, of these members of the whole run, each of which may stop before its end, ``until`` a time (NaN for none)."""
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
        states = [(block.reshape(-1, *shape, plan.members), shape) for block, shape in zip((out.v, out.y), shapes, strict=True)]
        ends = [block.reshape(*shape, plan.members) for block, shape in zip((out.last_v, out.last_y), shapes, strict=True)]
        rows, status = out.paces.reshape(numbers, -1), out.status.reshape(-1)
        while len(left):
            part = members.plan(left)
            at, jumps = (_of_members(times, plan, left) for times in (pacing.at, pacing.jumps))
            again = pacing._replace(at=at, jumps=jumps, begins=False, room=self._room(part, pacing.budget))
            made = engine.adapt(part, again, np.ascontiguousarray(rows[:, left]), *(end[..., left] for end in ends))
            self._take(index[left], made, until[left])
            rows[:, left], status[left] = made.paces, made.status
            for (saved, _), block in zip(states, (made.v, made.y), strict=True):
                saved[..., left] = block
            for end, block in zip(ends, (made.last_v, made.last_y), strict=True):
                end[..., left] = block
            left = left[made.status == engine.FULL]
        return out

    def saved(
        self, plan: engine.Plan, start: tuple[Array, Array, Array], last: tuple[Array, Array, Array]
    ) -> tuple[Array, Array, Array]:
        """The states at the start, those of the steps, and those at the end, each as t, v and y; NaN where a member has no more.

        The times are those of the plan.
        """
        total, batch = plan.members, plan.batch
        count = np.zeros(total, np.int64)
        kept = [(index, steps, _within(steps, until)) for index, steps, until in self._parts]
        for index, _, there in kept:
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
        for index, steps, there in kept:
            row, place = np.nonzero(there)
            to = count[index[place]] + row
            for block, values in zip(flat, steps[1:], strict=True):
                block[to, ..., index[place]] = values[row, ..., place]
            count[index] += there.sum(axis=0)
        return blocks[0], blocks[1], blocks[2]

    def _room(self, plan: engine.Plan, budget: int) -> int:
        """How many steps of each member the core keeps before they are taken over."""
        numbers = 1 + prod(plan.system.v_shape) + prod(plan.system.y_shape)
        return int(max(1, min(NUMBERS_AT_ONCE // (numbers * max(plan.members, 1)), budget // self._every)))

    def _take(self, index: Whole, out: engine.Adapted, until: Any) -> None:
        assert out.steps is not None
        count, *blocks = out.steps
        most = int(count.max(initial=0))
        self._parts.append((index, engine.KeptSteps(count, *(block[:most].copy() for block in blocks)), until))


def _of_members(times: Any, plan: engine.Plan, index: Whole) -> Any:
    """Times of these members, which may be those of all."""
    if times is None or times.ndim == 1:
        return times
    wide = np.broadcast_to(times.reshape(len(times), *(times.shape[1:] or (1,))), (len(times), *plan.batch))
    return np.ascontiguousarray(wide.reshape(len(times), -1)[:, index])


def _within(steps: engine.KeptSteps, until: Any) -> Any:
    """Which of the steps there are, and are before the end of their member."""
    there = np.arange(len(steps.t))[:, np.newaxis] < steps.counts
    return there & (np.where(there, steps.t, np.inf) < until)
