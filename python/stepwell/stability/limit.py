"""``stability_limit``: the largest step below which nothing grows that should not, and the mode that then does.

The step is sought on a ladder of steps for all members at once; the first rung on which a mode grows and the one before it
enclose the limit, of two states also a narrow window between rungs. Bisection finds it, and where an eigenvalue crosses the unit
circle at an angle, the crossing itself is solved for. An eigenvalue that leaves the circle after a collision with another (False
Euler at Φ = 2) does so with the square root of the excess, so there bisection alone is exact to rounding for two states; for
more, the square of the growth is followed back to where it began.
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

#: Growth that begins at the smallest steps, like a power of dt, is lost in rounding there: where it first shows it is above its
#: tolerance by no more than a rung with this exponent makes of it. A mode that begins to grow at a limit is far above at once.
EXPONENT = 20.0

#: An eigenvalue whose magnitude changes by less than this for a relative change of the step is solved for exactly: rounding of
#: some eps would move its crossing by more than a hundred eps.
FLAT = 0.03

#: Two eigenvalues that leave the circle at an angle and as close together as this are solved for exactly too: critical damping
#: makes them double, and rounding moves a double eigenvalue by the square root of its own size.
CLOSE = 1e-4

#: What is found by going back to where two eigenvalues meet is believed if it is this near, in parts of the step gone back.
MET = 1e-3

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
    neither is a system that grows by itself. Limits of two states are exact to some 1e-15, of more to some 1e-14 times the
    condition of the mode that leaves, whatever the units; damping of less than a millionth of critical damping counts as none.
    Where a method grows in a window of steps and is stable beyond, the window is found for two states, however narrow; for more,
    one that is less than 2 % of the step wide may be missed.

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
    t = _checks.number("t", t)
    if at is None:
        if not system.linear:
            raise UnsupportedError(f"at: {system!r} is not linear; give at=(v, y) for the limit of small disturbances there")
        search = _Search(system, how, None, None, 0.0)
    else:
        search = _Search(system, how, *state("at", system, at), t)
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
        self.exact = eigen.eigen(self.rates)
        rate = self.exact.values if len(self.rates) > 2 else eigen.eigenvalues(self.rates)
        size = np.abs(rate)
        self.fastest = np.where(size.max(axis=0) > 0.0, size.max(axis=0), np.abs(self.rates).max(axis=(0, 1)))
        # What is zero comes out of rounding as some root of eps, and is not what grows.
        rounding = self.exact.tolerance(0.0)
        zero = size <= np.maximum(ZERO * self.fastest, rounding)
        self.grows_by_itself = np.where(zero, -1.0, rate.real - np.maximum(1e-9 * self.fastest, rounding)).max(axis=0) > 0.0

    def matrix(self, dt: Array) -> Array:
        """P for steps of shape (…, *members)."""
        steps = dt[np.newaxis]  # an array of steps goes through the reference, which serves all at once
        if self.v is None or self.y is None:
            P = maps.transition(self.system, self.method, steps)
        else:
            P = maps.jacobian(self.system, self.method, steps, self.t, self.v, self.y)
        return P[:, :, 0]

    def finish(self, dt: Array) -> Array:
        """The map from slots to states, for the same steps."""
        return maps.finish(self.system, self.method, dt, dt.shape, self.t, self.v, self.y)

    def modes_of(self, P: Array, finish: Array) -> eigen.Eigen:
        """Eigenvalues and eigenvectors of P, in the units of the rates."""
        units = self.exact.units.reshape(len(P), *(1,) * (finish.ndim - self.exact.units.ndim - 1), *self.members)
        return eigen.eigen(P, eigen.slot_units(finish, units))

    def eigenvalues(self, dt: Array) -> tuple[Complex, Array]:
        """Those of P, and how far rounding may have moved them. Past the range of numbers, they are infinite."""
        P = self.matrix(dt)
        if len(P) > 2:
            found = self.modes_of(P, self.finish(dt))
            z, tolerance = found.values, found.tolerance()
        else:
            z = eigen.eigenvalues(P)
            tolerance = np.broadcast_to(eigen.tolerance(P), z.shape)
        finite = np.isfinite(P).all(axis=(0, 1))
        return np.where(finite, z, np.inf), np.where(finite, tolerance, 1.0)

    def growth(self, dt: Array) -> tuple[Array, Array, Array]:
        """Of the eigenvalue that is farthest outside the unit circle: how far it is, how far it may seem so by rounding.

        And where all are: 1 if that one grows, −1 if all damp, 0 if it is on the circle, for all one can see.
        """
        z, tolerance = self.eigenvalues(dt)
        beyond = np.abs(z) - 1.0
        at = (beyond - tolerance).argmax(axis=0)[np.newaxis]
        damp = (beyond < -tolerance).all(axis=0)
        beyond, tolerance = (np.take_along_axis(a, at, axis=0)[0] for a in (beyond, tolerance))
        return beyond, tolerance, np.where(beyond > tolerance, 1, np.where(damp, -1, 0))

    def limits(self) -> Array:
        """The limit of each member."""
        fastest = np.where(self.fastest > 0.0, self.fastest, 1.0)
        none = len(LADDER)
        first = np.full(self.members, none)
        low, high = np.zeros(self.members), np.full(self.members, LADDER[-1]) / fastest
        crept, previous, before = np.zeros(self.members, dtype=bool), np.zeros(self.members), np.zeros(self.members, dtype=int)
        for start in range(0, none, RUNGS):
            rungs = LADDER[start : start + RUNGS].reshape(-1, *(1,) * len(self.members)) / fastest
            beyond, tolerance, side = self.growth(rungs)
            for i in range(len(rungs)):
                k = start + i
                new = (first == none) & (side[i] > 0)
                first = np.where(new, k, first)
                low, high = np.where(new, previous, low), np.where(new, rungs[i], high)
                ratio = LADDER[k] / LADDER[k - 1] if k else np.inf
                crept = np.where(new, (before >= 0) & (beyond[i] <= tolerance[i] * ratio**EXPONENT), crept)
                previous, before = rungs[i], side[i]
            if (first < none).all():
                break
        never = self.grows_by_itself | crept
        if len(self.rates) == 2:
            low, high, first = self.valleys(fastest, low, high, first, never)
        seek = (first < none) & ~never
        if seek.any():
            low, high = self.bisected(np.where(seek, low, 0.5 * high), high)
            high = self.crossing(low, high, seek)
        return np.where(never, 0.0, np.where((first < none) & (self.fastest > 0.0), high, np.inf))

    def margins(self, dt: Array) -> tuple[Array, Array]:
        """Of two states, what must not be below zero (1 − q, 1 + q − 2p, 1 + q + 2p), shape (3, …), and their rounding."""
        P = self.matrix(dt)
        (a, b), (c, d) = P
        with np.errstate(all="ignore"):
            twice_p, q = a + d, a * d - b * c
            return np.stack([1.0 - q, 1.0 + q - twice_p, 1.0 + q + twice_p]), eigen.tolerance(P)

    def valleys(self, fastest: Array, low: Array, high: Array, first: Any, never: Any) -> tuple[Array, Array, Any]:
        """The same enclosure, or an earlier one between two rungs, where a method grows for less than a rung's length.

        Of two states stability is three smooth functions that must not be below zero. Where one has a valley on the ladder that
        may go so deep, its lowest point is looked up.
        """
        last = int(np.where(never, 0, np.minimum(first, len(LADDER) - 1)).max(initial=0))
        done = np.zeros(self.members, dtype=bool)
        for start in range(0, last - 1, RUNGS):
            rungs = LADDER[start : min(start + RUNGS + 2, last + 1)].reshape(-1, *(1,) * len(self.members)) / fastest
            margins, tolerance = self.margins(rungs)
            left, here, right = margins[:, :-2], margins[:, 1:-1], margins[:, 2:]
            with np.errstate(invalid="ignore"):
                bend = (left - here) + (right - here)
                valley = (here <= left) & (here < right) & (here < bend) & (bend > 16.0 * tolerance[1:-1])
            for k in np.flatnonzero(valley.any(axis=tuple(a for a in range(valley.ndim) if a != 1))).tolist():
                for j in range(3):
                    open_ = valley[j, k] & ~done & ~never & (start + k + 1 < first)
                    if not open_.any():
                        continue
                    a, b = rungs[k], rungs[k + 2]
                    for _ in range(60):
                        c, d = a + (b - a) / 3.0, b - (b - a) / 3.0
                        at_c, at_d = self.margins(c)[0][j], self.margins(d)[0][j]
                        a, b = np.where(at_c < at_d, a, c), np.where(at_c < at_d, d, b)
                    lowest = 0.5 * (a + b)
                    grows = open_ & (self.growth(lowest)[2] > 0)
                    low, high = np.where(grows, rungs[k], low), np.where(grows, lowest, high)
                    first = np.where(grows, start + k + 1, first)
                    done |= grows
        return low, high, first

    def bisected(self, low: Array, high: Array) -> tuple[Array, Array]:
        """The same enclosure, as narrow as numbers allow."""
        for _ in range(60):
            middle = 0.5 * (low + high)
            grows = self.growth(middle)[2] > 0
            low, high = np.where(grows, low, middle), np.where(grows, middle, high)
        return low, high

    def crossing(self, low: Array, high: Array, seek: Any) -> Array:
        """Where the eigenvalue that leaves the unit circle crosses it, if it does so at an angle; else ``high``.

        Bisection stops where growth shows above rounding. The secant through |z| − 1 a little on both sides finds the crossing
        itself, because its errors on both sides cancel to the rounding of one.
        """

        def modes(dt: Array) -> tuple[Complex, Array, Complex]:
            if len(self.rates) == 2:
                z, tolerance = self.eigenvalues(dt)
                return z, tolerance, np.ones((1, *z.shape), dtype=np.complex128)
            found = self.modes_of(self.matrix(dt), self.finish(dt))
            return found.values, found.tolerance(), found.vectors

        start, tolerance, vectors = modes(high * (1.0 + 1e-6))
        largest = (np.abs(start) - tolerance).argmax(axis=0)[np.newaxis]
        leaving = np.take_along_axis(start, largest, axis=0)[0]
        shape = np.take_along_axis(vectors, largest[np.newaxis], axis=1)[:, 0]

        def beyond(dt: Array) -> Array:
            """Of the same mode. Another of any shape may be as near to z, as all slow ones are at 1."""
            z, _, vectors = modes(dt)
            other = 1.0 - np.abs((shape.conj()[:, np.newaxis] * vectors).sum(axis=0))
            distance = np.abs(z - leaving) + other
            nearest = np.where(np.isnan(distance), np.inf, distance).argmin(axis=0)
            return np.asarray(np.abs(np.take_along_axis(z, nearest[np.newaxis], axis=0)[0]) - 1.0)

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
        found = np.where(at_an_angle, c, high)
        if len(self.rates) > 2:
            # The logarithm of the growth of two eigenvalues that met goes like the root of the excess; its square, a smooth
            # function, is followed back to zero. Bisection stops early, where rounding of what nearly meets hides growth.
            excess = 1e-5 * np.arange(1.0, 4.0)
            one, two, three = (np.log1p(beyond(high * (1.0 + x))) ** 2 for x in excess)
            bend = (one - 2.0 * two + three) / 2.0  # of the parabola through the three, over the number of the point, from 1 on
            rise = two - one - 3.0 * bend
            level = one - rise - bend
            with np.errstate(divide="ignore", invalid="ignore"):
                k = -level / rise
                k = k - (level + k * (rise + k * bend)) / (rise + 2.0 * k * bend)
            met = seek & ~at_an_angle & (np.abs(k) < MET)
            found = np.where(met, high * (1.0 + excess[0] * k), found)
        doubtful = seek & (np.abs(slope) < FLAT)
        if len(self.rates) == 2:
            z, _ = self.eigenvalues(found)
            doubtful |= at_an_angle & (np.abs(z[0] - z[1]) < CLOSE)
        return self.exactly(found, doubtful)

    def exactly(self, limits: Array, flat: Any) -> Array:
        """The limits of two states that leave the circle at so flat an angle, or so close together, that rounding moves them.

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
        steps = np.stack([at, np.where(known, at * (1.0 + PAST), at)])
        z, tolerance = self.eigenvalues(steps)
        finish = self.finish(steps)
        found = self.modes_of(self.matrix(steps), finish)
        states = np.einsum("ij...,jk...->ik...", finish, found.own)[:, :, 1]
        exact = eigen.matched(found.values[:, 1], states, self.exact)

        modes = np.empty(self.members, dtype=object)
        for index in np.ndindex(self.members):
            if limits[index] == np.inf:
                continue
            on, past = z[(slice(None), 0, *index)], z[(slice(None), 1, *index)]
            leaving = past[np.argmax(np.abs(past) - tolerance[(slice(None), 1, *index)])]
            crossing = on[np.argmin(np.abs(on - leaving))] if known[index] else np.complex128(1.0)
            which = int(np.abs(found.values[(slice(None), 1, *index)] - leaving).argmin())
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
