"""Outcomes of some members, by steps that err far less than those that are timed: what is right."""

from __future__ import annotations

import warnings

import numpy as np
import stepwell as sw

from . import stepwell_basins, stepwell_bifurcation, stepwell_figure_eight, work
from .work import Array

#: The relative error of a step.
TOLERANCE = 1e-13
#: Members that are compared, at most.
SAMPLES = {"bifurcation": 400, "basins": 400, "figure_eight": 200}
#: Steps of a member near the figure-eight. What takes more has met a collision, after which nothing is known of it.
MAX_STEPS = 600 * work.TURNS
#: Two numbers are the same outcome if they differ by less: of y at the end of a period, and of turns.
ALIKE = {"bifurcation": 1e-3, "figure_eight": 0.1}


def sampled(name: str, size: int) -> Array:
    """Numbers of the members that are compared."""
    return np.unique(np.linspace(0, work.members(name, size) - 1, SAMPLES[name]).round().astype(int))


def outcomes(name: str, size: int) -> tuple[Array, Array]:
    """What is right for these members, and for which of them it is known."""
    those = sampled(name, size)
    how = {"tolerance": TOLERANCE}
    if name == "bifurcation":
        at = work.PERIOD * (work.TRANSIENT + 1.0 + np.arange(work.PERIODS))
        axes = {"gamma": work.strengths(size)[those]}
        found = sw.sweep(stepwell_bifurcation.duffing, axes, "dop853", v=0.0, y=1.0, at=at, outcomes="history", **how)
        return found.y.values, np.ones(those.size, dtype=bool)
    if name == "basins":
        axes = {"y": ("start", work.bobs(size)[:, those])}
        found = sw.sweep(stepwell_basins.pendulum, axes, "dop853", v=0.0, at=work.END, outcomes=stepwell_basins.magnet, **how)
        return found.magnet.values, np.ones(those.size, dtype=bool)
    v = work.velocities(size)[:, those]
    axes = {"v": ("start", np.stack([v, v, -2.0 * v]))}
    at = work.TURN / work.OBSERVED_OF_A_TURN * np.arange(work.TURNS * work.OBSERVED_OF_A_TURN + 1)
    apart = sw.sweeps.Crossing(stepwell_figure_eight.separation, work.APART**2, name="apart")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.ToleranceWarning)
        bodies = sw.NBody([1.0, 1.0, 1.0])
        found = sw.sweep(bodies, axes, "dop853", y=work.X, at=at, max_steps=MAX_STEPS, outcomes=apart, **how)
    turns = found.apart_crossing.values / work.TURN
    return turns, (found.status.values == 0) | ~np.isnan(turns)


def right(name: str, found: Array, truth: Array, known: Array) -> float:
    """The share of members whose outcome is right, among those of which it is known."""
    found, truth = found[known], truth[known]
    if name == "basins":
        return float((found == truth).mean())
    off = abs(found - truth)
    alike = (off < ALIKE[name]) | (np.isnan(found) & np.isnan(truth))
    return float(alike.reshape(len(alike), -1).all(axis=1).mean())
