"""The search for a stability limit: on a ladder of steps, by bisection, and by solving for crossings of the unit circle."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...model.methods import Method
from ...model.systems import System
from . import eigen, exact, maps
from .eigen import EPS, Complex, Truths
from .function import a_stable
from .limit_digits import LADDER, RUNG_RATIO, in_many_digits, passes_zero
from .limit_result import Mode
from .parts import rates
from .some_members import Batch

#: The most rungs computed at once, and the most elements of the matrices of all members in them, so that Ctrl-C is noticed in
#: between and the memory suffices.
RUNGS_AT_ONCE, ELEMENTS_AT_ONCE = 64, 1 << 18

#: The numbers that a search has in memory for each element of a matrix: steps, eigenvectors, their inverse, and temporary arrays.
NUMBERS_OF_AN_ELEMENT = 60

#: An eigenvalue of the rates below this fraction of the largest is zero: such a mode (a chain that floats freely) has an
#: eigenvalue 1 with every method at every step, and does not count.
ZERO_RATE = 1e-6

#: A rate whose real part is below this fraction of its magnitude is imaginary.
BY_ITSELF = 1e-9

#: The tolerance of an eigenvalue is a first-order estimate of its rounding; one outside the circle by this many tolerances is
#: surely outside.
SURE_FACTOR = 100.0

#: Growth that begins at the smallest steps, like a power of dt, is lost in rounding there. On the first rung where it shows, it
#: is above its tolerance by at most the ratio of two rungs to this power. A mode that begins to grow at a limit is far above at
#: once.
GROWTH_EXPONENT = 20.0

#: A crossing is solved for exactly if the magnitude of the eigenvalue changes by less than this over a relative change of the
#: step: rounding of some eps would move the crossing by more than a hundred eps.
MIN_SLOPE = 0.03

#: The crossing is solved for exactly, too, if two eigenvalues this close together leave the circle at an angle: critical damping
#: makes them double, and rounding moves a double eigenvalue by the square root of its own size.
NEARLY_DOUBLE = 1e-4

#: The search for a crossing begins this fraction below the limit: further than rounding separates two equal real eigenvalues.
SEARCH_BELOW = 1e-7

#: A crossing that rounding may move by more than this fraction of the step is computed in more digits.
MAX_CROSSING_ERROR = 1e-9

#: A limit extrapolated to where two eigenvalues meet is accepted if it is this close, relative to the length of the
#: extrapolation.
MEETING_TOLERANCE = 1e-3

#: The unstable mode is computed at this fraction past its limit; one that is never stable, at this step times the fastest rate.
PAST_LIMIT, NEVER_STABLE_STEP = 1e-4, 0.1


def members_at_once(n: int) -> int:
    """How many members of n states are searched at once."""
    return max(1, ELEMENTS_AT_ONCE // (n * n))


class Search:
    """P as a function of the step, for every member at once."""

    def __init__(
        self,
        system: System,
        method: Method,
        v: Array | None,
        y: Array | None,
        t: float,
        rates: Array | None = None,
        exact_rates: eigen.Eigen | None = None,
    ) -> None:
        self.system, self.method, self.v, self.y, self.t = system, method, v, y, t
        self.rates = maps.rates(system, t, v, y) if rates is None else rates
        self.members: Shape = self.rates.shape[2:]
        self.exact = eigen.eigen(self.rates) if exact_rates is None else exact_rates
        #: True if eigenvalues that nearly meet can be computed in more digits.
        self.exactable = v is None and 2 < len(self.rates) <= exact.MAX_ROWS

    @cached_property
    def _batch(self) -> Batch:
        return Batch(self.system, self.method, self.v, self.y, self.members)

    def of(self, members: Truths) -> tuple[Search, Any]:
        """The search of these members and their places among all, or that of all if these are most of them.

        A member has the same steps and rates alone as among others. A batch of members of two states is not split, since that
        takes more time than it saves; nor is one that may need more digits, whose members are all examined until none needs them.
        """
        if len(self.rates) <= 2 or self.exactable or 2 * np.count_nonzero(members) > members.size:
            return self, ...
        index = np.flatnonzero(members)

        def some(each: Any) -> Any:
            return each.reshape(*each.shape[: each.ndim - len(self.members)], -1)[..., index]

        system, v, y = self._batch.of(index)
        part = Search(system, self.method, v, y, self.t, some(self.rates), eigen.Eigen(*map(some, self.exact)))
        return part, np.nonzero(members)

    @cached_property
    def fastest(self) -> Array:
        """The magnitude of the fastest rate."""
        return self._speed[0]

    @cached_property
    def grows_by_itself(self) -> Truths:
        """True where the exact solution grows."""
        return self._speed[1]

    @cached_property
    def _speed(self) -> tuple[Array, Truths]:
        if self.exactable:
            rate = np.empty((len(self.rates), *self.members), dtype=np.complex128)
            for index in np.ndindex(self.members):
                rate[(slice(None), *index)] = rates(checks.member(self.rates, index)).values
            rounding: Any = 0.0
            zero: Any = rate == 0.0
            size = np.abs(rate)
        elif len(self.rates) <= 2:
            rate = eigen.eigenvalues(self.rates)
            size = np.abs(rate)
            terms = np.abs(self.rates[0, 0] * self.rates[-1, -1]) + np.abs(self.rates[0, -1] * self.rates[-1, 0])
            with np.errstate(divide="ignore", invalid="ignore"):  # the slow one is the determinant over the fast one
                rounding = np.nan_to_num(4.0 * EPS * terms / size.max(axis=0)) if len(self.rates) == 2 else 0.0
            zero = size <= rounding
        else:
            rate, rounding = self.exact.values, self.exact.tolerance(0.0)
            size = np.abs(rate)
            # Rounding turns zero into some root of eps, which must not count as growth.
            zero = size <= np.maximum(ZERO_RATE * size.max(axis=0), rounding)
            rounding = np.maximum(rounding, BY_ITSELF * size.max(axis=0))
        fastest = np.where(size.max(axis=0) > 0.0, size.max(axis=0), np.abs(self.rates).max(axis=(0, 1)))
        return fastest, np.where(zero, -1.0, rate.real - np.maximum(BY_ITSELF * size, rounding)).max(axis=0) > 0.0

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
        """The eigenvalues of P, and how far rounding may have moved them; infinite where P is not finite."""
        P = self.matrix(dt)
        if len(P) > 2:
            spectrum = self.modes_of(P, self.finish(dt))
            z, tolerance = spectrum.values, spectrum.tolerance()
        else:
            z = eigen.eigenvalues(P)
            tolerance = np.broadcast_to(eigen.tolerance(P), z.shape)
        finite = np.isfinite(P).all(axis=(0, 1))
        return np.where(finite, z, np.inf), np.where(finite, tolerance, 1.0)

    def growth(self, dt: Array) -> tuple[Array, Array, Any, Any]:
        """Which side of the unit circle the eigenvalues are on.

        Returns:
            For the eigenvalue that is farthest outside: the distance from the circle and its tolerance. Then the side: 1 if it is
            outside, −1 if all are inside, 0 if it is on the circle as far as rounding allows to see. Then whether this is in
            doubt, because rounding moves eigenvalues that nearly meet by too much.
        """
        z, tolerance = self.eigenvalues(dt)
        beyond = np.abs(z) - 1.0
        at = (beyond - tolerance).argmax(axis=0)[np.newaxis]
        damp = (beyond < -tolerance).all(axis=0)
        if len(z) > 2:
            wide = tolerance > (eigen.REFINE_ABOVE if self.exactable else eigen.UNDECIDED_ABOVE)
            grows = (beyond > np.where(wide, SURE_FACTOR * tolerance, tolerance)).any(axis=0)
            doubt = ~grows & (wide & (beyond > -SURE_FACTOR * tolerance)).any(axis=0)
        else:
            doubt = np.zeros_like(damp)
        beyond, tolerance = (np.take_along_axis(a, at, axis=0)[0] for a in (beyond, tolerance))
        return beyond, tolerance, np.where(beyond > tolerance, 1, np.where(damp, -1, 0)), doubt

    @property
    def rungs_at_once(self) -> int:
        """The number of rungs computed at once."""
        return max(1, min(RUNGS_AT_ONCE, ELEMENTS_AT_ONCE // max(1, self.rates.size)))

    def limits(self) -> tuple[Array, Array]:
        """The limit of each member, and the smallest step known to grow: a larger one where rounding hides what is between."""
        if self.v is None and a_stable(self.method):  # proven of all steps at once
            grows = np.where(self.grows_by_itself, 0.0, np.inf)
            return grows, grows.copy()
        fastest = np.where(self.fastest > 0.0, self.fastest, 1.0)
        none = len(LADDER)
        first = np.full(self.members, none)
        low, high = np.zeros(self.members), np.full(self.members, LADDER[-1]) / fastest
        crept, previous, before = np.zeros(self.members, dtype=bool), np.zeros(self.members), np.zeros(self.members, dtype=int)
        doubtful, sure = np.zeros(self.members, dtype=bool), np.zeros(self.members)
        sought, start = Sought(self), 0
        while start < none:
            settled = self.grows_by_itself | (first < none)
            if (settled | (doubtful & self.exactable)).all():
                break
            at_once = sought.keep(~settled).rungs_at_once
            rungs = LADDER[start : start + at_once].reshape(-1, *(1,) * len(self.members)) / fastest
            beyond, tolerance, side, doubt = sought.growth(rungs)
            for i in range(len(rungs)):
                k = start + i
                sure = np.where(~doubtful & doubt[i] & (first == none), previous, sure)
                doubtful |= doubt[i] & (first == none)
                new = (first == none) & (side[i] > 0) & ~doubt[i]
                first = np.where(new, k, first)
                low, high = np.where(new, previous, low), np.where(new, rungs[i], high)
                ratio = LADDER[k] / LADDER[k - 1] if k else np.inf
                crept = np.where(new, (before >= 0) & (beyond[i] <= tolerance[i] * ratio**GROWTH_EXPONENT), crept)
                previous, before = rungs[i], side[i]
            start += at_once
        crept &= ~doubtful
        never = self.grows_by_itself | crept
        if len(self.rates) == 2:
            low, high, first = self.valleys(fastest, low, high, first, never)
        seek = (first < none) & ~never & ~doubtful
        if seek.any():
            part, at = self.of((first < none) & ~never)
            narrow = part.bisected(np.where(seek, low, 0.5 * high)[at], high[at])
            high[at], blurred = part.crossing(*narrow, seek[at])
            doubtful[at] |= seek[at] & blurred & self.exactable
        grows = np.where(never, 0.0, np.where((first < none) & (self.fastest > 0.0), high, np.inf))
        limits = np.where(doubtful & ~never, sure, grows)
        for index in np.argwhere(doubtful & ~never & self.exactable).tolist():
            at = tuple(index)
            step = exact.Step(checks.member(self.rates, at), maps.size(self.system)[0], self.method)
            limits[at] = grows[at] = in_many_digits(step, fastest[at], grows[at] if np.isfinite(grows[at]) else 0.0)
        return limits, grows

    def margins(self, dt: Array) -> tuple[Array, Array]:
        """For two states, the margins 1 − q, 1 + q − 2p, 1 + q + 2p, negative if unstable, shape (3, …), and their rounding."""
        P = self.matrix(dt)
        (a, b), (c, d) = P
        with np.errstate(all="ignore"):
            twice_p, q = a + d, a * d - b * c
            return np.stack([1.0 - q, 1.0 + q - twice_p, 1.0 + q + twice_p]), eigen.tolerance(P)

    def valleys(self, fastest: Array, low: Array, high: Array, first: Any, never: Any) -> tuple[Array, Array, Any]:
        """The enclosure, or an earlier one between two rungs, where a method grows in a window that contains no rung.

        A step of two states is stable if three smooth margins are not negative. Where one has a valley between rungs that may be
        so deep, its lowest point is searched.
        """
        last = int(np.where(never, 0, np.minimum(first, len(LADDER) - 1)).max(initial=0))
        done = np.zeros(self.members, dtype=bool)
        at_once = self.rungs_at_once
        for start in range(0, last - 1, at_once):
            rungs = LADDER[start : min(start + at_once + 2, last + 1)].reshape(-1, *(1,) * len(self.members)) / fastest
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
        """The enclosure bisected until it is as narrow as numbers allow."""
        for _ in range(60):
            middle = 0.5 * (low + high)
            if ((middle == low) | (middle == high)).all():
                break
            grows = self.growth(middle)[2] > 0
            low, high = np.where(grows, low, middle), np.where(grows, middle, high)
        return low, high

    def crossing(self, low: Array, high: Array, seek: Any) -> tuple[Array, Truths]:
        """The step at which the eigenvalue that leaves the unit circle crosses it, if it does so at an angle; else ``high``.

        Bisection stops where growth shows above rounding. The secant through |z| − 1 a little on both sides finds the crossing
        itself, because its errors on both sides cancel to the rounding of one.

        Returns:
            The steps, and whether rounding of that eigenvalue moves them by more than ``MAX_CROSSING_ERROR`` of the step.
        """

        def modes(dt: Array) -> tuple[Complex, Array, Complex]:
            if len(self.rates) == 2:
                z, tolerance = self.eigenvalues(dt)
                return z, tolerance, np.ones((1, *z.shape), dtype=np.complex128)
            spectrum = self.modes_of(self.matrix(dt), self.finish(dt))
            return spectrum.values, spectrum.tolerance(), spectrum.vectors

        start, tolerance, vectors = modes(high * (1.0 + 1e-6))
        largest = (np.abs(start) - tolerance).argmax(axis=0)[np.newaxis]
        leaving = np.take_along_axis(start, largest, axis=0)[0]
        shape = np.take_along_axis(vectors, largest[np.newaxis], axis=1)[:, 0]

        def beyond(dt: Array) -> Array:
            """|z| − 1 of the same mode, recognised by z and shape: all slow modes have a z near 1."""
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
        limits = np.where(at_an_angle, c, high)
        if len(self.rates) > 2:
            # The logarithm of the growth of two eigenvalues that met goes like the root of the excess. Its square is smooth and
            # is extrapolated to zero, since bisection stops early, where rounding of eigenvalues that nearly meet hides growth.
            excess = 1e-5 * np.arange(1.0, 4.0)
            one, two, three = (np.log1p(beyond(high * (1.0 + x))) ** 2 for x in excess)
            bend = (one - 2.0 * two + three) / 2.0  # of the parabola through the three, over the number of the point, from 1 on
            rise = two - one - 3.0 * bend
            level = one - rise - bend
            with np.errstate(divide="ignore", invalid="ignore"):
                k = -level / rise
                k = k - (level + k * (rise + k * bend)) / (rise + 2.0 * k * bend)
            met = seek & ~at_an_angle & (np.abs(k) < MEETING_TOLERANCE)
            limits = np.where(met, high * (1.0 + excess[0] * k), limits)
        doubtful = seek & (np.abs(slope) < MIN_SLOPE)
        if len(self.rates) == 2:
            z, _ = self.eigenvalues(limits)
            with np.errstate(invalid="ignore"):  # infinite where P is not finite
                doubtful |= at_an_angle & (np.abs(z[0] - z[1]) < NEARLY_DOUBLE)
        with np.errstate(invalid="ignore"):
            blurred = ~(np.take_along_axis(tolerance, largest, axis=0)[0] <= MAX_CROSSING_ERROR * np.abs(slope))
        return self.exactly(limits, doubtful), blurred

    def exactly(self, limits: Array, flat: Any) -> Array:
        """The limits of two states, refined where eigenvalues leave the circle at a flat angle or close together (``flat``).

        There rounding moves the crossing. But p and q of z² − 2pz + q are exact polynomials in dt. A pair is on the circle where
        q = 1, and a single eigenvalue where 1 + q ∓ 2p = 0. Newton's method leads from the crossing to the nearest of these
        roots.
        """
        if len(self.rates) != 2 or self.v is not None or not flat.any():
            return limits
        refined = np.array(limits)
        for at in map(tuple, np.argwhere(flat).tolist()):
            ((a, b), (c, d)), clock = exact.unrounded(checks.member(self.rates, at), maps.size(self.system)[0], self.method)
            twice_p, q, near = a + d, a * d - b * c, np.ldexp(limits[at], -clock)
            # From a little below, so that the first of two roots that nearly meet is found (both eigenvalues, one after the
            # other).
            margins = [f.fraction[0] for f in (q - 1, 1 + q - twice_p, 1 + q + twice_p)]
            margins = [f for f in margins if f.coefficients]
            roots = [(f, f.root_near(float(near * (1.0 - SEARCH_BELOW)))) for f in margins]
            # A margin that only nearly reaches zero (for a pair that nearly meets on the real line) has no root there.
            passed = [x for f, x in roots if abs(x / near - 1.0) < 10.0 * SEARCH_BELOW and passes_zero(f, x)]
            nearest = min(passed, default=min((x for _, x in roots), key=lambda x: abs(x - near)))
            refined[at] = np.ldexp(nearest, clock) if abs(nearest / near - 1.0) < RUNG_RATIO - 1.0 else limits[at]
        return refined

    def modes(self, limits: Array) -> tuple[Any, Complex]:
        """The mode that begins to grow at each limit, a ``Mode`` or None, and its eigenvalue past the limit, shape (*members)."""
        # Two steps for each member: at the limit, and past it, where the mode that leaves the circle differs from those that
        # stay.
        fastest = np.where(self.fastest > 0.0, self.fastest, 1.0)
        known = np.isfinite(limits) & (limits > 0.0)
        at = np.where(known, limits, NEVER_STABLE_STEP / fastest)
        steps = np.stack([at, np.where(known, at * (1.0 + PAST_LIMIT), at)])
        z, tolerance = self.eigenvalues(steps)
        finish = self.finish(steps)
        spectrum = self.modes_of(self.matrix(steps), finish)
        states = eigen.product("ij...,jk...->ik...", finish, spectrum.own)[:, :, 1]
        exact = eigen.matched(spectrum.values[:, 1], states, self.exact)

        modes, left = np.empty(self.members, dtype=object), np.ones(self.members, dtype=np.complex128)
        for index in np.ndindex(self.members):
            if limits[index] == np.inf:
                continue
            on, past = z[(slice(None), 0, *index)], z[(slice(None), 1, *index)]
            leaving = past[np.argmax(np.abs(past) - tolerance[(slice(None), 1, *index)])]
            crossing = on[np.argmin(np.abs(on - leaving))] if known[index] else np.complex128(1.0)
            which = int(np.abs(spectrum.values[(slice(None), 1, *index)] - leaving).argmin())
            rate, shape = exact[(which, *index)], states[(slice(None), which, *index)]
            if rate.imag < 0.0:  # of a pair, the one that turns forwards
                rate, shape, crossing, leaving = rate.conj(), shape.conj(), crossing.conj(), leaving.conj()
            left[index] = leaving
            modes[index] = mode_of(self.system, crossing, rate, shape, leaving, by_itself=bool(self.grows_by_itself[index]))
        return modes, left

    def lift(self, modes: Any, steps: Array, past: Complex) -> None:
        """Replace the shapes of modes of parts by those in the whole system, a little past these steps.

        ``past`` has the eigenvalues of the modes there.
        """
        growing = np.isfinite(steps) & (steps > 0.0)
        dt = np.where(growing, steps * (1.0 + PAST_LIMIT), 1.0)
        P, finish = self.matrix(dt), self.finish(dt)
        n_v = maps.size(self.system)[0]
        for index in np.ndindex(self.members):
            if (mode := modes[index]) is None:
                continue
            matrix, z = (P, past[index]) if growing[index] else (self.rates, mode.rate)
            matrix = checks.member(matrix, index)
            shape = eigen.vector(matrix, complex(z))
            shape = checks.member(finish, index) @ shape if growing[index] else shape
            shape = shape / shape[np.abs(shape).argmax()]
            v, y = shape[:n_v].reshape(self.system.v_shape), shape[n_v:].reshape(self.system.y_shape)
            modes[index] = mode._replace(v=v, y=y)


def mode_of(
    system: System, crossing: complex, rate: complex, shape: Complex, leaving: complex, *, by_itself: bool = False
) -> Mode:
    """The mode with this rate and shape, whose eigenvalue crosses the unit circle there and is ``leaving`` a little past it."""
    n_v = maps.size(system)[0]
    shape = shape / shape[np.abs(shape).argmax()]
    crossing = crossing / abs(crossing)
    kind = "unstable oscillation" if leaving.imag != 0.0 or leaving.real < 0.0 else "monotonic unstable"
    return Mode(
        eigenvalue=complex(crossing),
        angle=float(abs(np.angle(crossing))),
        rate=complex(rate),
        kind=f"{kind} of the exact solution too" if by_itself else kind,
        v=shape[:n_v].reshape(system.v_shape),
        y=shape[n_v:].reshape(system.y_shape),
    )


#: The result of ``growth`` for members that are not sought: on the circle, with any tolerance, without doubt.
NOTHING = (0.0, 1.0, 0, False)


class Sought:
    """The members of a search whose limit is still sought; nothing is computed for the others."""

    def __init__(self, search: Search) -> None:
        self._search, self._part, self._at = search, search, ...  # the places of the part's members among all

    def keep(self, members: Truths) -> Search:
        """Drop the other members once these are at most half of the remaining ones; returns the search of those that remain."""
        if 2 * np.count_nonzero(members) <= self._part.rates[0, 0].size:
            self._part, self._at = self._search.of(members)
        return self._part

    def growth(self, dt: Array) -> Any:
        """``Search.growth`` of steps of shape (…, *members), with ``NOTHING`` for members that are not sought."""
        if self._at is ...:
            return self._search.growth(dt)
        of_part = self._part.growth(dt[(..., *self._at)])
        whole = tuple(np.full(dt.shape, nothing, dtype=each.dtype) for each, nothing in zip(of_part, NOTHING, strict=True))
        for each, some in zip(whole, of_part, strict=True):
            each[(..., *self._at)] = some
        return whole
