"""The free rigid body of three different moments: ω by Jacobi's functions, the attitude by a Fourier series."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..base.immutable import ValueEquality
from ..model import quaternion
from .elliptic import elliptic, quarter

#: The series of the turn about the angular momentum ends where its terms, relative to the first, are below this.
NEGLIGIBLE = 1e-18

#: The number of points of a period at which it is sampled, at first and at most.
SAMPLES, MOST_SAMPLES = 128, 1 << 16


class FreeTop(ValueEquality):
    """Both blocks of a free body as functions of time, from its start at t = 0, exact but for rounding.

    ω follows from Jacobi's functions (Landau and Lifshitz, Mechanics, § 37). The angular momentum is fixed in space, and its
    direction ℓ = J·ω/|L| in the body follows from ω, so all of the attitude is known but a turn χ about it. With B the shortest
    turn that takes ℓ to the third axis, χ̇ = ω₃ + (ℓ₁ω₁ + ℓ₂ω₂)/(1 + ℓ₃). That is periodic and smooth, so the integral of its
    Fourier series is exact but for rounding.

    Args:
        inertia: three different moments, ascending.
        v: ω at the start.
        q: the attitude at the start, of length 1.

    Raises:
        ValueError: if the start is on the separatrix, where the motion has no period.
    """

    def __init__(self, inertia: tuple[float, float, float], v: tuple[float, ...], q: tuple[float, ...]) -> None:
        self.inertia, self.v, self.q = inertia, v, q
        low, middle, high = inertia
        # ℓ goes about the axis of the largest moment if L² − 2E·J₂ is positive, else about that of the smallest.
        excess = low * v[0] ** 2 * (low - middle) + high * v[2] ** 2 * (high - middle)
        if excess == 0.0:
            raise ValueError("the motion has no period")
        self.turn = np.array([1.0, 0.0, 0.0, 0.0])  # from body axes to axes whose third is the one that ℓ goes about
        axes = np.eye(3)
        if excess < 0.0:  # the axes 1 and 3 change places, and all change their signs
            self.turn = np.array([0.0, math.sqrt(0.5), 0.0, -math.sqrt(0.5)])
            axes = -axes[::-1]
        if (axes @ v)[2] < 0.0:  # half a turn about axis 2
            self.turn = quaternion.product([0.0, 0.0, 1.0, 0.0], self.turn)
            axes = np.diag([-1.0, 1.0, -1.0]) @ axes
        self.axes = axes
        a, b, c = self.moments = np.abs(axes) @ np.array(inertia)
        w = axes @ v
        from_c = a * w[0] ** 2 * (c - a) + b * w[1] ** 2 * (c - b)  # 2E·c − L², as a sum of terms of one sign
        from_a = b * w[1] ** 2 * (b - a) + c * w[2] ** 2 * (c - a)  # L² − 2E·a
        self.sizes = np.sqrt([from_c / (a * (c - a)), from_c / (b * (c - b)), from_a / (c * (c - a))])
        self.sizes[1] *= math.copysign(1.0, c - a)  # with descending moments the motion runs the other way round
        self.rate = math.sqrt((c - b) * from_a / (a * b * c))
        self.complement = math.sqrt((c - a) * excess / ((c - b) * from_a))
        self.modulus = math.sqrt((b - a) * from_c / ((c - b) * from_a))
        self.quarter = quarter(self.complement)
        self.first = _integral(math.atan2(w[1] / self.sizes[1], w[0] / self.sizes[0]), self.complement)
        self.momentum = float(np.sqrt(np.sum((self.moments * w) ** 2)))
        self.series = self._series()
        start = quaternion.product(np.array(q), _inverse(self.turn))
        self.space = quaternion.product(start, _inverse(self._upright(self._velocity(np.zeros(1)))[:, 0]))

    @property
    def period(self) -> float:
        """The period of ω."""
        return 4.0 * self.quarter / self.rate

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Both blocks at these times."""
        w = self._velocity(t)
        half = 0.5 * self._turned(t)
        about = np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)])
        upright = quaternion.product(quaternion.product(about, self._upright(w)), self.turn)
        q = quaternion.product(self.space, upright)
        return (self.axes.T @ w).T, q.T

    def _velocity(self, t: Array) -> Array:
        """ω along axes whose third is the one about which ℓ precesses, shape (3, n)."""
        return self._of_phase(self.rate * np.asarray(t, dtype=np.float64) + self.first)

    def _of_phase(self, u: Array) -> Array:
        whole = 4.0 * self.quarter
        sn, cn, dn = elliptic(np.remainder(u + 0.5 * whole, whole) - 0.5 * whole, self.modulus, self.complement)
        along: Array = self.sizes[:, np.newaxis] * np.stack([cn, sn, dn])
        return along

    def _upright(self, w: Array) -> Array:
        """The shortest turn of ℓ to the third axis."""
        along = self.moments[:, np.newaxis] * w / self.momentum
        turn = np.stack([1.0 + along[2], along[1], -along[0], 0.0 * along[0]])
        return np.asarray(turn / np.sqrt(2.0 * (1.0 + along[2])))

    def _series(self) -> Any:
        """The Fourier series of χ̇ over half a period of ω."""
        n = SAMPLES
        while True:
            w = self._of_phase(2.0 * self.quarter * np.arange(n) / n)
            along = self.moments[:, np.newaxis] * w / self.momentum
            terms: Any = np.fft.rfft(w[2] + (along[0] * w[0] + along[1] * w[1]) / (1.0 + along[2])) / n
            small = np.abs(terms) > NEGLIGIBLE * np.abs(terms[0])
            if not small[3 * n // 8 :].any() or n >= MOST_SAMPLES or np.abs(terms[3 * n // 8 :]).max() < 1e-16:
                return np.asarray(terms[: n // 2])
            n *= 2

    def _turned(self, t: Array) -> Array:
        """χ at these times, the integral of its rate from 0."""
        t = np.asarray(t, dtype=np.float64)
        k = 2.0 * math.pi * np.arange(1, len(self.series)) / (2.0 * self.quarter)

        def waves(u: Any) -> Array:
            value: Array = (np.exp(1j * np.multiply.outer(u, k)) @ (self.series[1:] / (1j * k))).real
            return value

        return np.asarray(
            self.series[0].real * t + 2.0 / self.rate * (waves(self.rate * t + self.first) - waves(np.asarray(self.first)))
        )


def _inverse(q: Array) -> Array:
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def _integral(angle: float, complement: float) -> float:
    """Legendre's F of an angle within (−π, π], the u whose amplitude it is, by the arithmetic-geometric mean."""
    a, b, times = 1.0, complement, 1.0
    while abs(a - b) > 1e-16 * a:
        further = math.atan2(b * math.sin(angle), a * math.cos(angle))
        angle += further + 2.0 * math.pi * round((angle - further) / (2.0 * math.pi))
        a, b, times = 0.5 * (a + b), math.sqrt(a * b), 2.0 * times
        if times > 2.0**40:
            break
    return float(angle / (times * a))
