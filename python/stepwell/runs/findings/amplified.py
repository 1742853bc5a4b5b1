"""Fast oscillations that the steps of a run amplify, though they are within the stability limit of the method, or near it.

Some methods multiply an oscillation by a little more than 1 at every step, however short: Fehlberg's by 1 + 0.003·(hω)⁶ and
1 + 0.0009·(hω)⁶. The error of each step is tolerated, but where nothing decays, as in wave equations, steps held at hω ≈ 1 by
the fastest part make of its errors a part that is as large as the solution. It is looked for after the run, where members stood
at their last waypoints and at the end, by the eigenvalues of the derivative of the rates and the stability function.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np

from ...base import registry
from ...base.arrays import Array, Whole
from ...errors import AccuracyWarning, UnsupportedError
from ...model.methods import Method
from .. import engine
from ..finding import Finding, Found
from ..result import Status
from . import Case
from .stiffness import MOST_NUMBERS, MOST_RATES, Complex, Stand, course_of, derivatives_of, may_be_stiff, rates_of, stands_of

#: A part is told that was multiplied by AMPLIFIED in all and is more than MATTERS times what is tolerated of a step.
AMPLIFIED, MATTERS = 1.5, 16.0
#: Growth by less than that a step is not known beside the rounding of derivatives.
LEAST = 1e-6


def growth_of(method: Method, order: int, z: Complex) -> Array:
    """The logarithm of |R(z)|; of a series of that order."""
    terms = [1.0 / math.factorial(k) for k in range(order, -1, -1)]
    with np.errstate(all="ignore"):
        factor = np.polyval(terms, z) if method.has_series else registry.task("stability_function")(method)(z)
        grown: Array = np.log(np.abs(factor))
    return grown


def of_run(case: Case) -> Finding | None:
    """The members of a run whose fast oscillations the method amplified."""
    run, course = case.run, course_of(case.run, case.request)
    plan, numbers = course.plan, run.v[-1].size + run.y[-1].size
    assert run.paces is not None
    if plan.method.is_implicit:
        return None
    try:
        if growth_of(plan.method, plan.order, np.array(0.5j)) <= LEAST:
            return None  # it damps them
    except UnsupportedError:  # it treats v and y differently
        return None
    n = numbers // max(run.status.size, 1)
    members = np.flatnonzero((may_be_stiff(run.paces.accepted, numbers) & (run.status == Status.OK)).reshape(-1))
    members = members[: MOST_NUMBERS // (n * n)] if n <= MOST_RATES else members[:0]
    stands = stands_of(course, case.waypoints[0], members) if members.size else []
    if len(stands) < 3:
        return None
    counts = run.paces.accepted.reshape(-1)[members]
    elapsed = np.abs(run.paces.t - run.t0).reshape(-1)[members]
    end = Modes.at(plan, members, stands[0], elapsed, counts)
    amplified = end.amplified
    for stand in stands[1:] if (amplified >= AMPLIFIED).any() else ():
        amplified = np.minimum(amplified, Modes.at(plan, members, stand, elapsed, counts).amplified)
    part = end.part(plan, members, stands[0]) if (amplified >= AMPLIFIED).any() else np.zeros(members.size)
    found = np.flatnonzero((amplified >= AMPLIFIED) & (part > 0.0))
    if not found.size:
        return None
    k = int(found[0])
    t, before = run.paces.t.reshape(-1)[members[k]], f"steps of {plan.method.name} amplify the fastest oscillations of "
    why = (
        f"of rates up to {end.rate[k]:.3g} at t = {t:g}, by {amplified[k]:.2g} times in all; at the end they are {part[k]:.1g} "
        f'of the state, most of it errors: take "dop853", which damps them, or a smaller tolerance'
    )
    return Found(AccuracyWarning, members[found], run.status.shape, before, "", ",", why).finding()


class Modes(NamedTuple):
    """The modes of members where they stand."""

    values: Complex  # their eigenvalues, shape (members, modes)
    vectors: Complex
    grown: Array  # by which power of e the steps of the run multiply each; 0 of those that decay or grow by themselves

    @classmethod
    def at(cls, plan: engine.Plan, members: Whole, stand: Stand, elapsed: Array, counts: Whole) -> Self:
        """At a stand, for steps of the shortest length of that there and the mean."""
        values, vectors = np.linalg.eig(derivatives_of(plan, members, stand.paces[engine.TIME], stand.v, stand.y))
        step = np.minimum(stand.paces[engine.STEP], elapsed / counts)[:, np.newaxis]
        grown = growth_of(plan.method, plan.order, values * step)
        # What decays forgets its errors, and what grows by itself has others.
        grown = np.where((grown > LEAST) & (2.0 * np.abs(values.real) * step <= grown), grown / step, 0.0)
        return cls(values, vectors, grown * elapsed[:, np.newaxis])

    @property
    def amplified(self) -> Array:
        """By how much the steps multiply the mode that they amplify most."""
        most: Array = np.exp(np.minimum(self.grown.max(axis=1), 700.0))
        return most

    @property
    def rate(self) -> Array:
        """The size of its eigenvalue."""
        size: Array = np.abs(np.take_along_axis(self.values, self.grown.argmax(axis=1)[:, np.newaxis], 1)[:, 0])
        return size

    def part(self, plan: engine.Plan, members: Whole, stand: Stand) -> Array:
        """The size of the modes that are amplified, relative to the state; 0 if it is within what is tolerated."""
        count = len(members)
        state = np.concatenate([block.reshape(block.size // count, count) for block in (stand.v, stand.y)])
        rates = rates_of(plan, members, stand.paces[engine.TIME])(state).T
        with np.errstate(all="ignore"):
            shares = (np.linalg.pinv(self.vectors) @ rates[..., np.newaxis])[..., 0] / self.values
            shares = np.where(self.grown >= math.log(AMPLIFIED), shares, 0.0)
            part, size = np.linalg.norm((self.vectors @ shares[..., np.newaxis])[..., 0], axis=1), np.linalg.norm(state, axis=0)
            relative = stand.paces[engine.RELATIVE] + stand.paces[engine.ABSOLUTE] / size
            return np.where(part > MATTERS * relative * size, part / size, 0.0)
