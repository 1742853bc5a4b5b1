"""Growth of a sampled loop, for many sampling intervals at once."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import numpy as np

from ...base.arrays import Array, Whole
from ...model.parameters import aligned
from ...model.systems import LinearSystem
from ...model.systems.linear import part_of
from ...model.systems.realisation import Realisation, feedback, of_gain, series
from ...reference import exact
from ...reference.resolvent import polynomials
from ..stability import eigen
from .delay import Parts, divided, samples_of
from .delay import joined as with_samples

Truths = np.ndarray[Any, np.dtype[np.bool_]]

#: Loops with at most this many samples of dead time are matrices whose eigenvalues are computed; of others, whose matrices have
#: as many rows, the argument of the polynomial is followed.
MOST_AS_MATRIX = 24

#: A polynomial is followed from places so far apart: EVEN ones for each degree, NEAR_ONE from FIRST on in equal ratios, and
#: BESIDE at either side of each root of the open loop. Where it turns by more than TURN, or grows e^TURN-fold, further places
#: are put between, in at most ROUNDS rounds.
EVEN, NEAR_ONE, FIRST, BESIDE, TURN, ROUNDS = 4, 240, 1e-14, 30, 0.5, 60


def scaled(system: LinearSystem, dts: Array) -> LinearSystem:
    """A system in units of time of these lengths, one for each member."""
    B = None if system.B is None else system.B[..., np.newaxis] * dts
    C, D = (None if each is None else each[..., np.newaxis] for each in (system.C, system.D))
    return LinearSystem(system.A[..., np.newaxis] * dts, B, C, D, velocities=system.velocities)


def grow(
    plant: LinearSystem, controller: Callable[[Array], Realisation], dts: Array, delay: float, samples: int, slack: Array
) -> Truths:
    """True for each loop, shape (members,), that has an eigenvalue larger than 1 by more than its slack.

    The plant is as for ``sampled_loop``; ``controller`` leads from lengths of a sample to what is done in each. ``delay`` is dead
    time in units of time, ``samples`` further dead time in samples.
    """
    late = [samples_of(delay + samples * dt, dt) for dt in dts.tolist()]
    wholes, rests = np.array([each[0] for each in late]), np.array([each[1] for each in late])
    of_plant, step, grown = part_of("plant", plant, of_states=True), scaled(plant, dts), np.zeros(dts.shape, dtype=np.bool_)
    assert step.B is not None  # a plant has an input

    def wide(matrix: Array) -> Array:
        return np.broadcast_to(aligned(matrix, 2, dts.shape), (*matrix.shape[:2], *dts.shape))

    with np.errstate(all="ignore"):  # a sample may be so long that a plant that grows leaves all numbers
        P, Q = exact.held(step.A, step.B, 1.0)
        C, D, before = wide(of_plant.C), wide(of_plant.D), [wide(each) for each in controller(dts)[:4]]
        parts = divided(step, P, D, "zoh", "hold", 1.0, (0, rests / dts)) if delay else Parts(P, {0: Q}, {0: D})
        if (large := np.flatnonzero(wholes > MOST_AS_MATRIX)).size:
            grown[large] = _outside(parts, C, before, wholes, 1.0 + slack, large)
        for whole in np.unique(wholes[wholes <= MOST_AS_MATRIX]).tolist():
            own = np.flatnonzero(wholes == whole)
            later = ({whole + lag: each[..., own] for lag, each in of.items()} for of in (parts.of_state, parts.of_output))
            A, B, _, of_states, through = with_samples(Parts(P[..., own], *later), C[..., own], 1, own.shape)
            behind = Realisation(A, B, of_states, through, (), (None,))
            of_a, of_b, of_c, of_d = (each[..., own] for each in before)
            loop = feedback(
                series(Realisation(of_a, of_b, of_c, of_d, (), (None,)), behind), of_gain("controller", 1.0, 1, 1), -1
            )
            grown[own] = np.abs(eigen.eigenvalues(loop.A)).max(axis=0) > 1.0 + slack[own]
    return grown


def _outside(parts: Parts, C: Array, controller: list[Array], wholes: Whole, radii: Array, places: Whole) -> list[bool]:
    """True for each loop with much dead time that has an eigenvalue outside its circle.

    The argument of a polynomial of degree n rises by n·π along the upper half of a circle round all its roots (Cremer 1947,
    Leonhard 1944, Mikhailov 1938). The power of z that stands for the samples under way is put aside, and the others are powers
    of z − 1, since the roots of short samples are near 1.
    """
    lags = sorted({*parts.of_state, *parts.of_output})
    zeros = np.zeros_like(parts.of_state[0]), np.zeros_like(parts.of_output[lags[-1]])
    Q, D = (
        np.concatenate([of.get(lag, zero) for lag in lags], axis=1)
        for of, zero in zip((parts.of_state, parts.of_output), zeros, strict=True)
    )
    num, den = polynomials(parts.P - np.eye(len(parts.P))[..., np.newaxis], Q, C, D)
    A, *rest = controller  # a gain alone has no states
    of_num, of_den = (
        polynomials(A - np.eye(len(A))[..., np.newaxis], *rest)
        if len(A)
        else (rest[2][np.newaxis], 0.0 * radii[np.newaxis] + 1.0)
    )
    grown = []
    for k in places.tolist():
        late = {int(wholes[k]) + lag: np.convolve(of_num[:, 0, 0, k], num[:, 0, i, k]) for i, lag in enumerate(lags)}
        whole = np.convolve(of_den[:, k], den[:, k])
        finite = all(np.isfinite(each).all() for each in (whole, *late.values()))
        grown.append(finite and _roots_beyond(whole, late, float(radii[k])) > 0.5)
    return grown


def _roots_beyond(den: Array, late: dict[int, Array], radius: float) -> float:
    """How many roots den(z) + Σ z^−lag·num(z) has outside a circle; polynomials are in z − 1."""

    def value(theta: Array) -> Any:
        log = np.log(radius) + 1j * theta
        s = np.expm1(log)
        return np.polyval(den, s) + sum(np.polyval(num, s) * np.exp(-lag * log) for lag, num in late.items())

    roots = np.abs(np.angle(1.0 + np.roots(den)))
    beside = np.geomspace(1e-9, 1.0, BESIDE)
    theta = np.concatenate(
        [
            np.linspace(0.0, pi, EVEN * (max(late) + len(den)))[1:],
            np.geomspace(FIRST, pi, NEAR_ONE),
            *(roots * (1.0 + sign * each) for each in beside for sign in (1.0, -1.0)),
        ]
    )
    theta = np.unique(theta[(theta > 0.0) & (theta <= pi)])
    values, turns = value(theta), 0.0
    ends = np.stack([theta[:-1], theta[1:], values[:-1], values[1:]])
    for _ in range(ROUNDS):
        turned = np.log(ends[3] / ends[2])
        rough = np.abs(turned) > TURN
        turns += turned.imag[~rough].sum()
        if not rough.any():
            break
        begin, end, first, last = ends[:, rough]
        middle = 0.5 * (begin.real + end.real)
        between = value(middle)
        ends = np.concatenate([[begin, middle, first, between], [middle, end, between, last]], axis=1)
    return float(len(den) - 1 - turns / pi)
