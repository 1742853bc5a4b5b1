"""Bodies whose energy at the end of a run shows that it did not follow their motion, and those that met within a step."""

from __future__ import annotations

import math
from math import prod
from typing import Any

import numpy as np

from ...base.arrays import Array, Shape
from ...base.reprs import of_member
from ...errors import AccuracyWarning
from ...model.parameters import aligned
from ...model.systems import NBody
from ..finding import Finding, named
from ..result import Run
from . import FEW_EVALUATIONS, Case, State, another, evaluations_of
from .encounters import FEW_BODIES, MOST_NUMBERS, is_long, lists, numbers_of_pairs, of_encounters

#: A member's energy is doubtful where it changed by more than this share of its own size and of the kinetic energy.
DOUBTFUL_CHANGE = 0.5
#: Around a body with so many times the mass of all others together, the share is less in steps of fixed length: planets whose
#: energy is a hundredth off are on other orbits, or these turn by steps alone.
STAR, DOUBTFUL_OF_PLANETS = 10.0, 0.01
#: From this many bodies on the core computes an energy faster than NumPy, although it makes a step too.
MIN_BODIES_BY_CORE = 24
#: Energies at the start and at the end of a run, and the larger of both kinetic energies; per member.
Ends = tuple[Array, Array, Array]
#: A message, the members that it is about, and the first of them.
About = tuple[str, Any, Shape]


def of_run(case: Case) -> Finding | None:
    """The bodies of a run whose energy is another at its end, or that met within a step."""
    run, start, bodies = case.run, case.start, case.run.system
    assert isinstance(bodies, NBody)
    energy = None
    if bodies.keeps_energy:
        energy = _of_all(run, bodies, start) or (None if start is None else _of_massless(run, bodies, start))
    met = None
    if run.encounter is not None and case.heard(AccuracyWarning):
        met = of_encounters(run, bodies, start, None if energy is None else energy[2])
    if not (parts := [part for part in (energy, met) if part is not None]):
        return None
    return Finding(AccuracyWarning, "; ".join(part[0] for part in parts), np.logical_or.reduce([part[1] for part in parts]))


def _of_all(run: Run, bodies: NBody, start: State | None) -> About | None:
    if (ends := _ends(run, bodies, start)) is None:
        return None
    heaviest = bodies.masses.max(axis=0)
    planets = (bodies.masses.sum(axis=0) <= (1.0 + 1.0 / STAR) * heaviest) & (bodies.force == "newton")
    wrong = _changed(ends, np.where(planets & (run.paces is None), DOUBTFUL_OF_PLANETS, DOUBTFUL_CHANGE))
    if not wrong.any():
        return None
    text = another(wrong, "energy", ends[0], ends[1], f"{run.method.name} did not follow its orbit")
    return text, wrong, named(wrong).place


def _changed(ends: Ends, share_of: Any = DOUBTFUL_CHANGE) -> Any:
    first, last, moved = ends
    with np.errstate(all="ignore"):
        wrong = np.abs(last - first) > share_of * np.maximum(moved, np.maximum(np.abs(first), np.abs(last)))
    return wrong & np.isfinite(last)  # members that diverged were named before


def _of_massless(run: Run, bodies: NBody, start: State) -> About | None:
    """A message about bodies without mass around a single body with mass, its members, and the first of them.

    The energy of all bodies does not depend on them. Relative to a single attractor each keeps its energy per unit of mass, which
    several attractors may change.
    """
    if bodies.masses.all():
        return None  # the usual case, checked in a microsecond
    alone = np.count_nonzero(bodies.masses, axis=0) == 1
    evaluations = evaluations_of(run)
    if not alone.any() or evaluations < FEW_EVALUATIONS or run.y[-1].size > MOST_NUMBERS:
        return None
    (v, y), batch = (run.v[-1], run.y[-1]), run.status.shape
    masses = np.broadcast_to(aligned(bodies.masses, 1, batch), (len(y), *batch))
    attractor = masses.argmax(axis=0)[np.newaxis, np.newaxis]
    strength = bodies.G * masses.max(axis=0)

    def energies(v: Array, y: Array) -> tuple[Array, Array]:
        d, w = (each - np.take_along_axis(each, attractor, axis=0) for each in (y, v))
        r2 = (d * d).sum(axis=1) + bodies.softening * bodies.softening
        kinetic = 0.5 * (w * w).sum(axis=1)
        return kinetic + strength * (-1.0 / np.sqrt(r2) if bodies.force == "newton" else 0.5 * np.log(r2)), kinetic

    with np.errstate(all="ignore"):
        (first, began), (last, ended) = energies(np.broadcast_to(start[0], y.shape), start[1]), energies(v, y)
    wrong = _changed((first, last, np.maximum(began, ended))) & (masses == 0.0) & alone
    if not wrong.any():
        return None
    body, *index = np.argwhere(wrong)[0].tolist()
    some = int(np.count_nonzero(wrong))
    who, energies_at = f"body {body}{of_member(tuple(index))}", f"{last[body, *index]:.3g} instead of {first[body, *index]:.3g}"
    energy, followed = "another energy per mass at the end", f"so {run.method.name} did not follow"
    text = (
        f"{who}, which has no mass, has {energy}: {energies_at}, {followed} its orbit"
        if some == 1
        else f"{some} bodies without mass have {energy}: {who} has {energies_at}, {followed} their orbits"
    )
    return text, wrong.any(axis=0), tuple(index)


def _ends(run: Run, bodies: NBody, start: State | None) -> Ends | None:
    """The recorded energies, or energies computed now if that costs little beside the run, else None."""
    if "energy" in run.recorded and len(run.t) > 1:
        with np.errstate(all="ignore"):
            moved = np.maximum(bodies.kinetic(run.v[0]), bodies.kinetic(run.v[-1]))
        first, last = run.recorded["energy"][[0, -1]]
        return first, last, moved
    if start is None:
        return None
    end = run.v[-1], run.y[-1]
    n, members = len(end[1]), run.status.size
    evaluations = evaluations_of(run)
    if run.status.ndim == 0 and n <= FEW_BODIES:
        return _of_few(bodies, start, end) if evaluations >= FEW_EVALUATIONS else None
    numbers = numbers_of_pairs(run, bodies)
    if not is_long(evaluations, numbers) or prod(end[1].shape) > MOST_NUMBERS or not members:
        return None
    start = np.broadcast_to(start[0], end[0].shape), start[1]  # one number may have been given for all
    with np.errstate(all="ignore"):
        moved = np.maximum(bodies.kinetic(start[0]), bodies.kinetic(end[0]))
        return _energies(run, bodies, *start), _energies(run, bodies, *end), moved


def _energies(run: Run, bodies: NBody, v: Array, y: Array) -> Array:
    """The energies of a state, with the same bits by the core and by NumPy."""
    if len(y) < MIN_BODIES_BY_CORE:
        return bodies.energy(v, y)
    from ..engine.recorded import recorded  # only bodies of some number need it

    v, y = np.broadcast_to(v, run.v.shape[1:]), np.broadcast_to(y, run.y.shape[1:])
    energies: Array = recorded(bodies, ("energy",), 1.0, v[np.newaxis], y[np.newaxis])["energy"][0]
    return energies


def _of_few(bodies: NBody, start: State, end: State) -> Ends | None:
    """The energies of one member; None if they are not doubtful, without making an array."""
    (first, moved_first), (last, moved_last) = (
        _summed(bodies, *(lists(block, bodies.y_shape) for block in state)) for state in (start, end)
    )
    moved = max(moved_first, moved_last)
    if abs(last - first) <= DOUBTFUL_OF_PLANETS * max(moved, abs(first), abs(last)):
        return None
    return np.asarray(first), np.asarray(last), np.asarray(moved)


def _summed(bodies: NBody, v: Any, y: Any) -> tuple[float, float]:
    """The energy of one state and its kinetic part, in floats, NaN if not finite."""
    masses, soft = bodies.masses.tolist(), float(bodies.softening) ** 2
    strength = float(bodies.G)
    newton = bodies.force == "newton"
    try:
        kinetic = sum(0.5 * m * sum(x * x for x in row) for m, row in zip(masses, v, strict=True) if m)
        potential, massive = 0.0, [(m, place) for m, place in zip(masses, y, strict=True) if m]
        for i, (m, place) in enumerate(massive):
            for its, other in massive[:i]:
                square = sum((a - b) * (a - b) for a, b in zip(place, other, strict=True)) + soft
                potential += m * its * (-1.0 / math.sqrt(square) if newton else 0.5 * math.log(square))
    except (ValueError, ZeroDivisionError):  # two bodies in one place, or numbers that are not finite
        return math.nan, math.nan
    return kinetic + strength * potential, kinetic
