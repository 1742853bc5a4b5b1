"""Nets that gained energy by fixed steps, which springs and surfaces never give."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...errors import AccuracyWarning
from ...model.methods import Method
from ..finding import Finding, named
from ..result import Run
from . import Case, State
from .invariants import CHANGED, MOST_NUMBERS

#: ``CHANGED`` of a world, over what moved at the start: what is written into its arrays may add energy, too, but not so much.
GAINED = 1e4


def of_run(case: Case) -> Finding | None:
    """The members of a run of a net that gained energy."""
    return None if case.start is None else gain_of(case.run, case.start)


def gain_of(run: Run, start: State) -> Finding | None:
    """The members that gained energy in a run, from this start on."""
    if run.force is not None or not run.status.size or run.y[-1].size > MOST_NUMBERS:
        return None
    saved = slice(-1, None) if run.y.size > MOST_NUMBERS else slice(None)
    blocks = [(np.broadcast_to(b, a.shape[1:]), *a[saved]) for a, b in zip((run.v, run.y), start, strict=True)]
    return gain(run.system, run.method, run.dt, blocks, CHANGED)


def gain(system: Any, method: Method, dt: float, blocks: Sequence[Sequence[Array]], least: float) -> Finding | None:
    """Members of a net that gained energy in fixed steps; surfaces, damping and drag only take it.

    ``blocks`` are v and y of some states, the first of them that of the start; ``least`` is the least gain that counts, over the
    energies that there were.
    """
    v, y = (np.stack(block, axis=2) for block in blocks)
    if system.given_inputs() or v[system.fixed, :, 0].any():
        return None
    with np.errstate(all="ignore"):
        alone = system.reference_at_step(1.0, y.shape[2:])
        kinetic, energy = alone.kinetic_and_whole(v, y)
        first, most = energy[0], energy.max(axis=0)
        known = kinetic.max(axis=0) if least < 1.0 else kinetic[0]
        if not (most - first > least * known).any():  # which spares the rest, for nearly all runs
            return None
        moved = (y.max(axis=(0, 2)) - y.min(axis=(0, 2))).max(axis=0)
        weight = np.broadcast_to(alone.masses, (system.n, *alone.masses.shape[1:])).sum(axis=0)
        pull = 0.0 if alone.fall is None else (weight * np.sqrt((alone.fall * alone.fall).sum(axis=0)))[0]
        stretched = (0.5 * alone.stiffness * alone.stretches(y[:, :, :1]) ** 2).sum(axis=0)[0]
        wrong = np.asarray((most - first > least * np.maximum(known, stretched + pull * moved)) & np.isfinite(most))
    if not wrong.any():
        return None
    who = named(wrong)
    text = (
        f"{who.share} gained energy, which springs and surfaces never give: {who.has}up to {most[who.place]:.3g} from "
        f"{first[who.place]:.3g}, so {method.name} with dt = {dt:g} did not follow the motion; take shorter steps"
    )
    return Finding(AccuracyWarning, text, wrong)
