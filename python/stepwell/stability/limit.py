"""``stability_limit``: the largest step below which nothing grows that should not, and the mode that then does.

The step is sought on a ladder of steps for all members at once; the first rung on which a mode grows and the one before it
enclose the limit, bisection finds it, and where an eigenvalue crosses the unit circle at an angle, the crossing itself is
solved for. An eigenvalue that leaves the circle after a collision with another (False Euler at Φ = 2) does so with the square
root of the excess, so there bisection alone is exact to rounding.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .. import _checks
from .._checks import Array, Shape
from ..errors import DTypeError, UnsupportedError
from ..integrate import fits_together
from ..methods import Method
from ..methods import method as find_method
from ..systems import System
from . import eigen, maps
from .analysis import state
from .eigen import Complex
from .expansion import polynomials

#: The ladder of steps, as multiples of the fastest rate: from where the limits of light damping are (2D by Standard Euler) to
#: beyond the limit of a method of a hundred stages. It is fine from FINE on, where methods have limits of their own.
FINE, RUNG = 1e-2, 1.02
LADDER = np.concatenate([np.geomspace(1e-6, FINE, 97)[:-1], FINE * RUNG ** np.arange(466)])

#: Rungs that are looked at at once.
RUNGS = 64

#: An eigenvalue of the rates that is this small a part of the largest is zero: such a mode (a chain that floats freely) has an
#: eigenvalue 1 with every method at every step, and does not count.
ZERO = 1e-6

#: Growth that begins at the smallest steps, like a power of dt, is lost in rounding there and shows first with a small exponent
#: (Standard Heun: 4); a mode that begins to grow at a limit shows within a rung with a large one.
EXPONENT = 20.0

#: An eigenvalue whose magnitude changes by less than this for a relative change of the step is solved for exactly: rounding of
#: some eps would move its crossing by more than a hundred eps.
FLAT = 0.03

#: The mode that leaves is looked at this much past its limit; one that is never stable, at this multiple of the fastest rate.
PAST, NEVER = 1e-4, 0.1


class Mode(NamedTuple):
    """What begins to grow at a stability limit.

    Attributes:
        eigenvalue: z of P at the limit, on the unit circle.
        angle: Ψ in 0 … π, its angle per step.
        rate: λ of the mode in the exact solution, in 1 per unit of time; its imaginary part is its frequency.
        kind: what it does past the limit, in the document's words.
        v: its shape in the velocities, complex, shape (*block); its largest number in both blocks is 1.
        y: its shape in the coordinates.
    """

    eigenvalue: complex
    angle: float
    rate: complex
    kind: str
    v: Complex
    y: Complex


class StabilityLimit(float):
    """A stability limit: the largest stable step, in units of time, 0 for never and infinity for always.

    It is a number; ``mode`` says what begins to grow there, None if nothing does.
    """

    mode: Mode | None

    def __new__(cls, dt: float, mode: Mode | None) -> StabilityLimit:
        """The number, with the mode."""
        limit = super().__new__(cls, dt)
        limit.mode = mode
        return limit

    @property
    def dt(self) -> float:
        """The number alone."""
        return float(self)


class StabilityLimits(np.ndarray[Any, np.dtype[np.float64]]):
    """Stability limits of a batch: an array of numbers. ``modes``, of the same shape, has what begins to grow."""

    modes: Any = None

    def __array_finalize__(self, other: Any) -> None:
        """What is computed from limits is no longer a limit, and has no modes."""
        self.modes = None


def stability_limit(system: System, method: str | Method, *, at: Any = None, t: float = 0.0) -> Any:
    """The largest step below which a method is stable for every mode of a system.

    Stable means that what should not grow does not: every eigenvalue of the transition matrix stays in or on the unit circle for
    all smaller steps. At the limit itself two eigenvalues may meet, as at Φ = 2 by False Euler, and the samples then grow
    linearly. A method whose samples grow at the smallest steps is never stable, even if larger steps damp (Fehlberg's);
    neither is a system that grows by itself. Limits are exact to some 1e-15; damping of less than a millionth of critical
    damping counts as none.

    Args:
        system: a linear system; parameters may be arrays. Its inputs do not matter: they add to the samples what stays bounded.
        method: its name, or what ``stepwell.method`` returns.
        at: a state (v, y) at which a system that is not linear is taken for one.
        t: the time of that state.

    Returns:
        A ``StabilityLimit``, which is a float with a ``mode``; an array of them for a batch (``StabilityLimits``).

    Raises:
        ArgumentError: what was given and what was expected.
        UnsupportedError: if the method cannot do the system, or the system is not linear and no state is given.
    """
    if not isinstance(system, System):
        raise DTypeError(f"system: expected a stepwell system such as Oscillator(), got {type(system).__name__}")
    how = find_method(method)
    system = system.sized(*(at if isinstance(at, (tuple, list)) else ()))
    fits_together(system, how)
    if at is None:
        if not system.linear:
            raise UnsupportedError(f"at: {system!r} is not linear; give at=(v, y) for the limit of small disturbances there")
        search = _Search(system, how, None, None, 0.0)
    else:
        search = _Search(system, how, *state("at", system, at), _checks.number("t", t))
    limits = search.limits()
    modes = search.modes(limits)
    if not search.members:
        return StabilityLimit(float(limits), modes[()])
    found = limits.view(StabilityLimits)
    found.modes = modes
    return found


class _Search:
    """P as a function of the step, for every member at once."""

    def __init__(self, system: System, method: Method, v: Array | None, y: Array | None, t: float) -> None:
        self.system, self.method, self.v, self.y, self.t = system, method, v, y, t
        self.rates = maps.rates(system, t, v, y)
        self.members: Shape = self.rates.shape[2:]
        self.exact = eigen.eigenvalues(self.rates)
        size = np.abs(self.exact)
        self.fastest = np.where(size.max(axis=0) > 0.0, size.max(axis=0), np.abs(self.rates).max(axis=(0, 1)))
        zero = size <= ZERO * self.fastest
        self.zeros = zero.sum(axis=0)
        # A double zero (a chain that floats) comes out of rounding as ±√eps of the fastest, hence not what is zero.
        self.grows_by_itself = np.where(zero, -1.0, self.exact.real - 1e-9 * self.fastest).max(axis=0) > 0.0

    def matrix(self, dt: Array) -> Array:
        """P for steps of shape (…, *members)."""
        steps = dt[np.newaxis]  # an array of steps goes through the reference, which serves all at once
        if self.v is None or self.y is None:
            P = maps.transition(self.system, self.method, steps)
        else:
            P = maps.jacobian(self.system, self.method, steps, self.t, self.v, self.y)
        return P[:, :, 0]

    def eigenvalues(self, P: Array) -> Complex:
        """The eigenvalues that count, the others NaN."""
        z = eigen.eigenvalues(P)
        if self.zeros.any():
            rank = np.argsort(np.argsort(np.abs(z - 1.0), axis=0), axis=0)
            z = np.where(rank < self.zeros, np.nan, z)
        return z

    def growth(self, dt: Array) -> tuple[Array, Array]:
        """How far the largest eigenvalue is outside the unit circle, and how far it may seem so by rounding."""
        P = self.matrix(dt)
        with np.errstate(invalid="ignore"):
            size = np.abs(self.eigenvalues(P))
        beyond = np.where(np.isnan(size), -1.0, size).max(axis=0) - 1.0
        # Past the range of numbers everything grows.
        return np.where(np.isfinite(P).all(axis=(0, 1)), beyond, np.inf), eigen.tolerance(P)

    def limits(self) -> Array:
        """The limit of each member."""
        fastest = np.where(self.fastest > 0.0, self.fastest, 1.0)
        first = np.full(self.members, len(LADDER))
        before, after = np.full(self.members, np.nan), np.full(self.members, np.nan)
        previous = np.zeros(self.members)
        for start in range(0, len(LADDER), RUNGS):
            rungs = LADDER[start : start + RUNGS].reshape(-1, *(1,) * len(self.members)) / fastest
            beyond, tolerance = self.growth(rungs)
            for i in range(len(rungs)):
                new = (first == len(LADDER)) & (beyond[i] > tolerance[i])
                first = np.where(new, start + i, first)
                before = np.where(new, previous, before)
                after = np.where(new, beyond[i], after)
                previous = np.where(beyond[i] < -tolerance[i], -1.0, 0.0)
            if (first < len(LADDER)).all():
                break
        found = first < len(LADDER)
        high = LADDER[np.minimum(first, len(LADDER) - 1)] / fastest
        low = LADDER[np.maximum(np.minimum(first, len(LADDER) - 1) - 1, 0)] / fastest
        next_up = self.growth(high * RUNG)[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            exponent = np.log(next_up / after) / np.log(RUNG)
        # On the coarse rungs only what is damped before can begin to grow.
        from_the_start = (exponent < EXPONENT) | (LADDER[np.minimum(first, len(LADDER) - 1)] <= FINE)
        never = self.grows_by_itself | (found & ((first == 0) | ((before == 0.0) & from_the_start)))
        seek = found & ~never
        if seek.any():
            low, high = self.bisected(np.where(seek, low, 0.5 * high), high)
            high = self.crossing(low, high, seek)
        return np.where(never, 0.0, np.where(found & (self.fastest > 0.0), high, np.inf))

    def bisected(self, low: Array, high: Array) -> tuple[Array, Array]:
        """The same enclosure, as narrow as numbers allow."""
        for _ in range(60):
            middle = 0.5 * (low + high)
            beyond, tolerance = self.growth(middle)
            grows = beyond > tolerance
            low, high = np.where(grows, low, middle), np.where(grows, middle, high)
        return low, high

    def crossing(self, low: Array, high: Array, seek: Any) -> Array:
        """Where the eigenvalue that leaves the unit circle crosses it, if it does so at an angle; else ``high``.

        Bisection stops where growth shows above rounding. The secant through |z| − 1 a little on both sides finds the crossing
        itself, because its errors on both sides cancel to the rounding of one.
        """
        start = self.eigenvalues(self.matrix(high * (1.0 + 1e-6)))
        with np.errstate(invalid="ignore"):
            largest = np.where(np.isnan(start), 0.0, np.abs(start)).argmax(axis=0)
        leaving = np.take_along_axis(start, largest[np.newaxis], axis=0)[0]

        def beyond(dt: Array) -> Array:
            z = self.eigenvalues(self.matrix(dt))
            with np.errstate(invalid="ignore"):
                distance = np.where(np.isnan(z), np.inf, np.abs(z - leaving))
            return np.asarray(np.abs(np.take_along_axis(z, distance.argmin(axis=0)[np.newaxis], axis=0)[0]) - 1.0)

        a, b = high * (1.0 - 1e-5), high * (1.0 + 1e-5)
        below, above = beyond(a), beyond(b)
        slope = (above - below) / (b - a) * high
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = -below / above
        # At an angle: about as far inside below as outside above. After a collision: on the circle below, or far from it.
        at_an_angle = seek & (ratio > 0.5) & (ratio < 2.0)
        for _ in range(6):
            with np.errstate(divide="ignore", invalid="ignore"):
                c = a - below * (b - a) / (above - below)
            c = np.where(at_an_angle & np.isfinite(c), np.clip(c, np.minimum(a, b), np.maximum(a, b)), high)
            value = beyond(c)
            inside = value < 0.0
            a, below = np.where(inside, c, a), np.where(inside, value, below)
            b, above = np.where(inside, b, c), np.where(inside, above, value)
            if not at_an_angle.any():
                break
        flat = seek & (np.abs(slope) < FLAT)
        return self.exactly(np.where(at_an_angle, c, high), flat)

    def exactly(self, limits: Array, flat: Any) -> Array:
        """The limits of two states that leave the circle at so flat an angle that rounding moves them.

        Of z² − 2pz + q, whose p and q are exact polynomials in dt, a pair is on the circle where q = 1, and a single eigenvalue
        where 1 + q ∓ 2p = 0. Newton's steps from the crossing found go to the nearest of these.
        """
        if len(self.rates) != 2 or self.v is not None or not flat.any():
            return limits
        (a, b), (c, d) = polynomials(self.system, self.method)
        twice_p, q = (np.asarray(f, dtype=object) for f in (a + d, a * d - b * c))
        found = np.array(limits)
        for index in np.argwhere(flat).tolist():
            at = tuple(index)
            roots = [q[at] - 1, 1 + q[at] - twice_p[at], 1 + q[at] + twice_p[at]]
            steps = [f.root_near(float(limits[at])) for f in roots if f.coefficients]
            nearest = min(steps, key=lambda x: abs(x - limits[at]))
            found[at] = nearest if abs(nearest / limits[at] - 1.0) < RUNG - 1.0 else limits[at]
        return found

    def modes(self, limits: Array) -> Any:
        """The mode that begins to grow at each limit, of the shape of the members: a ``Mode``, or None."""
        # Two steps for each: at the limit, and past it, where the mode that leaves is told from those that stay.
        fastest = np.where(self.fastest > 0.0, self.fastest, 1.0)
        known = np.isfinite(limits) & (limits > 0.0)
        at = np.where(known, limits, NEVER / fastest)
        P = self.matrix(np.stack([at, np.where(known, at * (1.0 + PAST), at)]))
        z, vectors = eigen.eigen(P)
        counted = self.eigenvalues(P)
        finish = maps.finish(self.system, self.method, np.stack([at, at]), (2, *self.members), self.t, self.v, self.y)
        states = np.einsum("ij...,jk...->ik...", finish, vectors)[:, :, 1]
        exact = eigen.matched(z[:, 1], states / np.sqrt((np.abs(states) ** 2).sum(axis=0)), *eigen.eigen(self.rates))

        modes = np.empty(self.members, dtype=object)
        for index in np.ndindex(self.members):
            if limits[index] == np.inf:
                continue
            on, past = counted[(slice(None), 0, *index)], counted[(slice(None), 1, *index)]
            leaving = past[np.nanargmax(np.abs(past))]
            crossing = on[np.nanargmin(np.abs(on - leaving))] if known[index] else np.complex128(1.0)
            which = int(np.abs(z[(slice(None), 1, *index)] - leaving).argmin())
            rate, shape = exact[(which, *index)], states[(slice(None), which, *index)]
            if rate.imag < 0.0:  # of a pair, the one that turns forwards
                rate, shape, crossing = rate.conj(), shape.conj(), crossing.conj()
            modes[index] = self._mode(crossing, rate, shape, leaving, bool(self.grows_by_itself[index]))
        return modes

    def _mode(self, crossing: complex, rate: complex, shape: Complex, leaving: complex, by_itself: bool) -> Mode:
        n_v = maps.size(self.system)[0]
        shape = shape / shape[np.abs(shape).argmax()]
        crossing = crossing / abs(crossing)
        kind = "unstable oscillation" if leaving.imag != 0.0 or leaving.real < 0.0 else "monotonic unstable"
        return Mode(
            eigenvalue=complex(crossing),
            angle=float(abs(np.angle(crossing))),
            rate=complex(rate),
            kind=f"{kind} of the exact solution too" if by_itself else kind,
            v=shape[:n_v].reshape(self.system.v_shape),
            y=shape[n_v:].reshape(self.system.y_shape),
        )
