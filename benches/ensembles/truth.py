"""Outcomes of some members, by steps that err far less than those that are timed: what is right."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import stepwell as sw

from . import stepwell_basins, stepwell_bifurcation, stepwell_figure_eight, work
from .work import Array

#: Relative errors of a step. An outcome is known if both give it: chaos, and fractal borders, are left out.
TOLERANCES = (1e-13, 1e-11)
#: Members that are compared, at most.
SAMPLES = {"bifurcation": 400, "basins": 400, "figure_eight": 200}
#: Steps of a member near the figure-eight. What takes more has met a collision, after which nothing is known of it.
MAX_STEPS = 4 * work.MAX_STEPS
#: Two numbers are the same outcome if they differ by less: of y at the end of a period, and of turns.
ALIKE = {"bifurcation": 1e-3, "basins": 0.5, "figure_eight": 0.2}


def sampled(name: str, size: int) -> Array:
    """Numbers of the members that are compared."""
    return np.unique(np.linspace(0, work.members(name, size) - 1, SAMPLES[name]).round().astype(int))


def outcomes(name: str, size: int) -> tuple[Array, Array]:
    """What is right for these members, and for which of them it is known."""
    first, second = (_found(name, sampled(name, size), size, tolerance) for tolerance in TOLERANCES)
    return first, alike(name, first, second)


def _found(name: str, those: Array, size: int, tolerance: float) -> Array:
    if name == "bifurcation":
        at = work.PERIOD * (work.TRANSIENT + 1.0 + np.arange(work.PERIODS))
        axes: Any = {"gamma": work.strengths(size)[those]}
        found = sw.sweep(
            stepwell_bifurcation.duffing, axes, "dop853", v=0.0, y=1.0, at=at, outcomes="history", tolerance=tolerance
        )
        return np.asarray(found.y.values)
    if name == "basins":
        axes = {"y": ("start", work.bobs(size)[:, those])}
        magnet = stepwell_basins.magnet
        found = sw.sweep(stepwell_basins.pendulum, axes, "dop853", v=0.0, at=work.END, outcomes=magnet, tolerance=tolerance)
        return np.asarray(found.magnet.values)
    v = work.velocities(size)[:, those]
    axes = {"v": ("start", np.stack([v, v, -2.0 * v]))}
    at = work.TURN / work.OBSERVED_OF_A_TURN * np.arange(work.TURNS * work.OBSERVED_OF_A_TURN + 1)
    apart = sw.sweeps.Crossing(stepwell_figure_eight.separation, work.APART**2, name="apart")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.ToleranceWarning)
        found = sw.sweep(
            stepwell_figure_eight.BODIES,
            axes,
            "dop853",
            y=work.X,
            at=at,
            max_steps=MAX_STEPS,
            outcomes=apart,
            tolerance=tolerance,
            threads=2,
        )
    turns = found.apart_crossing.values / work.TURN
    return np.where((found.status.values > 0) & np.isnan(turns), np.inf, turns)  # unknown: inf is unlike anything


def alike(name: str, one: Array, other: Array) -> Array:
    """Members whose outcomes are the same."""
    with np.errstate(invalid="ignore"):
        same = (abs(one.astype(float) - other) < ALIKE[name]) | (np.isnan(one) & np.isnan(other))
    return np.asarray(same.reshape(len(same), -1).all(axis=1))


def right(name: str, found: Array, truth: Array, known: Array) -> float:
    """The share of members whose outcome is right, among those of which it is known."""
    return float(alike(name, found[known], truth[known]).mean())
