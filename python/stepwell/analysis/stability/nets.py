"""The safe step of a net of springs, from bounds of its frequencies: for any number of particles, in every position.

A spring between particles resists a displacement along itself with its stiffness k, and one across with k·(1 − ℓ₀/ℓ), which is
less, or negative if it is compressed. So the matrix of all forces is at most that of springs that resist all displacements with
k, K = B·diag(k)·Bᵀ, where B has a column for each spring with 1 and −1 at its ends. The eigenvalues of M⁻¹·K other than 0 are
those of Bᵀ·M⁻¹·B·diag(k), none of which is larger than the largest sum of the magnitudes in a row (Gershgorin). In the row of a
spring from i to j these sum to Wᵢ/mᵢ + Wⱼ/mⱼ, with W the stiffness of all springs at a particle. It is the bound of ω². Dampers
of the springs have the same form, and drag adds its largest drag/m.

For a mode x of a damped net v̇ = −C·v − K·y each eigenvalue λ solves λ² + c·λ + κ = 0 with c = x*C·x and κ = x*K·x, x*x = 1: real
numbers between 0 and the bounds. A Runge-Kutta method is stable if it is for every such oscillator; so is False Euler, whose
eigenvalues solve z² − (2 − h·c − h²·κ)·z + 1 − h·c = 0. As the step grows, new values of h·c and h²·κ appear at the upper bounds
of κ and c only, so those are tried. In an undamped net every method steps each mode by itself, with the limit Φ of an oscillator.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.compatibility import fits_together, one_state
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.parameters import aligned
from ...model.systems import LinearSystem, Springs
from .limit import stability_limit

#: The number of oscillators that are tried along each of the two upper bounds.
SAMPLES = 17


def safe_step(springs: Springs, method: str | Method) -> Any:
    """The step below which a method is stable on a net, from bounds: see ``Springs.safe_step``."""
    method = find_method(method)
    fits_together(springs, method)
    one_state("safe_step", method)
    by_mass = 1.0 / springs.masses
    by_mass = np.array(np.broadcast_to(by_mass, (springs.n, *by_mass.shape[1:])))
    by_mass[springs.fixed] = 0.0
    square = _bound(springs, springs.stiffness, by_mass)
    if springs.velocity_term is None:
        return _shaped(_undamped(square, method), springs)
    rate = np.zeros(()) if springs.damping is None else _bound(springs, springs.damping, by_mass)
    if springs.drag is not None:
        rate = rate + _share(springs.drag, by_mass).max(axis=0)
    square, rate = np.broadcast_arrays(square, rate)
    return _shaped(_damped(square, rate, method), springs)


def _share(numbers: Array, by_mass: Array) -> Array:
    """Numbers of the particles times 1/m."""
    return np.asarray(_wide(numbers, by_mass.ndim) * _wide(by_mass, numbers.ndim))


def _wide(numbers: Array, axes: int) -> Array:
    """Numbers of the particles with ``axes`` axes at least, those of the batch last."""
    return aligned(numbers, 1, (1,) * max(axes - 1, numbers.ndim - 1))


def _bound(springs: Springs, numbers: Array, by_mass: Array) -> Array:
    """The largest Wᵢ/mᵢ + Wⱼ/mⱼ over springs from i to j whose number is above zero; W sums the numbers at a particle."""
    numbers = np.broadcast_to(numbers, (len(springs.pairs), *numbers.shape[1:]))
    sums = np.zeros((springs.n, *numbers.shape[1:]))
    for ends in springs.pairs.T:
        np.add.at(sums, ends, numbers)
    share = _share(sums, by_mass)
    first, second = (share[ends] for ends in springs.pairs.T)
    largest: Array = np.where(_wide(numbers, share.ndim) > 0.0, first + second, 0.0).max(axis=0)
    return largest


def _damped(square: Array, rate: Array, method: Method) -> Array:
    """The least limit of oscillators with ω² and damping up to these bounds."""
    unit = np.maximum(np.sqrt(square), rate)  # of frequency
    still = unit == 0.0
    if not method.limit:
        return np.where(still, np.inf, 0.0)
    unit = np.where(still, 1.0, unit)
    square, rate = square / unit**2, rate / unit
    parts = np.linspace(0.0, 1.0, SAMPLES).reshape(SAMPLES, *(1,) * square.ndim)
    kappa = np.concatenate([np.broadcast_to(square, (SAMPLES, *square.shape)), parts * square])
    c = np.concatenate([parts * rate, np.broadcast_to(rate, (SAMPLES, *rate.shape))])
    one, none = np.ones(c.shape), np.zeros(c.shape)
    limits = stability_limit(LinearSystem(np.array([[-c, -kappa], [one, none]]), velocities=1), method)
    least = np.minimum(np.asarray(limits, dtype=np.float64).min(axis=0), _undamped(square, method))
    return np.where(still, np.inf, least / unit)


def _undamped(square: Array, method: Method) -> Array:
    """The limit of an undamped oscillator with this ω²; infinite for ω² = 0."""
    return np.where(square > 0.0, method.limit / np.sqrt(np.where(square > 0.0, square, 1.0)), np.inf)


def _shaped(step: Array, springs: Springs) -> Any:
    """A float, or an array of the shape of the batch."""
    return np.broadcast_to(step, springs.batch).copy() if springs.batch else float(step)
