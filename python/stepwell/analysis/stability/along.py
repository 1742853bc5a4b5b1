"""``stability_along``: the stability limit at every saved state of a run, and the state that sets it.

At each state the rates are linearised, and each mode that does not grow in the exact solution has a limit of its own. If a
method treats both blocks alike, the growth of a mode depends on λ·dt alone. For ÿ = K·y it depends on κ·dt² by any method, κ
being an eigenvalue of K. In both cases the limit is found once for each direction of λ, and scaled. Otherwise a geometric grid of
steps is tried, and the eigenvalues of each step are matched with the rates.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.reprs import cell, facts
from ...errors import ArgumentError, DTypeError
from ...model.compatibility import fits_together, one_state
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import LinearSystem, Oscillator, System
from ...runs.result import Run
from . import eigen, maps
from .analysis import goes_forward
from .eigen import Complex
from .limit import Mode, stability_limit
from .limit_digits import LADDER
from .limit_search import ELEMENTS_AT_ONCE, GROWTH_EXPONENT, NEVER_STABLE_STEP, PAST_LIMIT, Search, mode_of
from .parts import function_of_rates

#: A real part below the first fraction of a state's fastest rate counts as zero, and a rate below the second does, too.
REAL_ZERO, RATE_ZERO = 1e-9, 1e-6

#: The steps that are tried: every other one of the geometric grid of ``stability_limit``.
STRIDE = 2

#: Halvings of the interval between two rungs, to the last digit.
HALVINGS = 48


class StabilityAlong(ValueEquality):
    """Stability limits along a run.

    Attributes:
        method: the method.
        run_dt: the step of the run, or None for a run with a tolerance.
        t: times of the saved states, shape (saved,), or (saved, *batch) where members have times of their own.
        limits: for each saved state the largest step below which no mode grows that does not grow in the exact solution, shape
            (saved, *batch): 0 if there is no such step, infinite if there is no such mode, NaN if the state is not finite.
        rates: for each saved state λ of the mode that sets the limit, complex, likewise; NaN where none does.
        growth: for each saved state the largest real part of its rates, likewise: above zero where neighbouring motions separate
            at any step.
        dt: the smallest of the limits, shape (*batch), a number for one member.
        index: which saved state sets it, likewise.
        when: the time of that state, likewise.
        mode: the mode that becomes unstable there, a ``Mode``, or None; an array of them for a batch. Its shape is in v and y.
    """

    def __init__(
        self, method: Method, run_dt: float | None, t: Array, limits: Array, rates: Complex, growth: Array, index: Any, modes: Any
    ) -> None:
        self.method = method
        self.run_dt = run_dt
        self.t = t
        self.limits = limits
        self.rates = rates
        self.growth = growth
        self.index: Any = np.asarray(index)[()]
        self.dt: Any = np.take_along_axis(limits, np.asarray(index)[np.newaxis], axis=0)[0][()]
        self.when: Any = t[index] if t.ndim == 1 else np.take_along_axis(t, np.asarray(index)[np.newaxis], axis=0)[0]
        self.mode: Any = modes if np.ndim(index) else modes[()]

    @property
    def exceeded(self) -> Any:
        """At which saved states the step of the run is above the limit, shape (saved, *batch).

        Raises:
            ArgumentError: for a run with a tolerance, whose steps are adaptive.
        """
        if self.run_dt is None:
            raise ArgumentError("exceeded: expected a run with a fixed step, got one with a tolerance")
        return self.run_dt > self.limits

    def _repr_html_(self) -> str:
        pairs: list[tuple[str, Any]] = [("method", self.method.title), ("step of the run", cell(self.run_dt))]
        if self.limits.ndim > 1:
            return facts(
                "Stability limits along runs",
                [*pairs, ("runs", self.limits[0].size), ("smallest limit", cell(float(np.nanmin(self.dt))))],
            )
        above = None if self.run_dt is None else f"{np.count_nonzero(self.exceeded)} of {len(self.limits)} states"
        grows = None if self.mode is None else self.mode.kind
        pairs += [
            ("smallest limit", cell(float(self.dt))),
            ("set at t", cell(float(self.when))),
            ("then", grows),
            ("the step is above it at", above),
        ]
        return facts("Stability limit along a run", pairs)

    def __repr__(self) -> str:
        if self.limits.ndim > 1:
            return (
                f"<stability limits of {self.method.name} along {self.limits[0].size} runs: the smallest {np.nanmin(self.dt):g}>"
            )
        return f"<stability limit of {self.method.name} along a run: dt = {self.dt:.6g}, set at t = {self.when:g}>"


def stability_along(run: Run, method: str | Method | None = None) -> StabilityAlong:
    """Find the saved state of a run that sets the stability limit, its time, and the mode that becomes unstable.

    At each saved state the rates are linearised. Modes that grow in the exact solution, such as the distance of two bodies that
    fall past a third, are left out. The limit is the largest step below which no other mode grows. At an equilibrium where no
    mode grows in the exact solution, that equals ``stability_limit``. At other states they differ: here the linearised rates are
    kept fixed, while ``stability_limit`` uses the derivative of a whole step, within which the state changes.

    Args:
        run: a run with saved states (``every=`` or ``at=``).
        method: the method to judge; that of the run if None.

    Returns:
        A ``StabilityAlong``: ``dt``, ``index``, ``when`` and ``mode``, and ``limits`` of every state.

    Raises:
        UnsupportedError: if the method cannot do the system, or its rates have no derivative.

    Example:
        >>> run = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.01, steps=300, every=1)
        >>> when = sw.stability_along(run).when  # when it hangs straight down, where it is stiffest
        >>> round(float(when), 1)
        1.7
    """
    if not isinstance(run, Run):
        raise DTypeError(f"run: expected what integrate returns, got {type(run).__name__}")
    goes_forward(run)
    method = run.method if method is None else find_method(method)
    system = run.system.uncontrolled
    fits_together(system, method)
    one_state("stability_along", method)
    system.not_in_a_loop("stability_along")
    n = sum(maps.size(system))
    checks.fits("the matrices", 8 * n * n * len(run.t), run.status.shape, "save fewer states")
    A = _linearised(system, run)
    shape = A.shape[2:]
    flat = A.reshape(n, n, -1)
    finite = np.isfinite(flat).all(axis=(0, 1))
    flat = np.where(finite, flat, 0.0)
    each = _limits(system, method, flat)
    growth = np.where(finite, eigen.eigenvalues(flat).real.max(axis=0), np.nan).reshape(shape)
    limits = np.where(finite, each.limits, np.nan).reshape(shape)
    rates = np.where(each.rates.imag < 0.0, each.rates.conj(), each.rates)  # of a pair, the one with the positive angle
    rates = np.where(finite, rates, np.nan).reshape(shape)
    index = np.where(np.isnan(limits), np.inf, limits).argmin(axis=0)
    modes = np.empty(shape[1:], dtype=object)
    for member in np.ndindex(shape[1:]):
        at = (int(index[member]), *member)
        if np.isfinite(limits[at]):
            modes[member] = _mode(system, method, A[(slice(None), slice(None), *at)], float(limits[at]), complex(rates[at]))
    dt = None if run.paces is not None else run.dt
    return StabilityAlong(method, dt, run.t, limits, rates, growth, index, modes)


def _linearised(system: System, run: Run) -> Array:
    """The matrix of the rates at every saved state, shape (n, n, saved, *batch)."""
    members = run.status.shape
    if system.linear:
        A = maps.rates(system)
        A = A.reshape(*A.shape[:2], *(1,) * (len(members) + 3 - A.ndim), *A.shape[2:])
        return np.broadcast_to(A, (*A.shape[:2], len(run.t), *members))
    v, y = (np.moveaxis(a, 0, len(s)) for a, s in ((run.v, system.v_shape), (run.y, system.y_shape)))
    t: Any = run.t if run.t.ndim > 1 else run.t.reshape(-1, *(1,) * len(members))
    # Built-in systems only add inputs, which do not change the derivative: one time suffices.
    A = maps.rates(system, float(run.t.flat[0]) if system.complex_step else t, v, y)
    return np.broadcast_to(A, (*A.shape[:2], len(run.t), *members))


class _StateLimits(NamedTuple):
    """For each state the limit and the rate of the mode that sets it, shape (states,)."""

    limits: Array
    rates: Complex


def _limits(system: System, method: Method, A: Array) -> _StateLimits:
    """The limits of states with these matrices, shape (n, n, states)."""
    n_v = maps.size(system)[0]
    n = len(A)
    if function_of_rates(method) or n_v in (0, n):
        return _smallest(_clean(eigen.eigenvalues(A)), lambda rates: _of_rates(method, rates, n_v))
    stiffness = _stiffness(A, n_v)
    if stiffness is not None:
        squares = eigen.eigenvalues(stiffness)
        size = np.abs(squares).max(axis=0)
        turning = np.abs(squares.imag) > REAL_ZERO * size
        squares = np.where(np.abs(squares) <= RATE_ZERO**2 * size, np.nan, squares.real)
        oscillating = _smallest(-np.sqrt(squares + 0j), lambda rates: _of_second_order(method, rates))
        if (other := turning.any(axis=0)).any():  # forces without a potential energy
            tried = _by_trying(method, A[:, :, other], n_v)
            oscillating.limits[other], oscillating.rates[other] = tried
        return oscillating
    return _by_trying(method, A, n_v)


def _of_second_order(method: Method, rates: Complex) -> Array:
    """The limits of modes of ÿ = λ²·y: modes that oscillate, and decaying modes, each paired with one that grows."""
    swings = rates.imag != 0.0
    limits = np.full(rates.shape, float(stability_limit(Oscillator(1.0), method)))
    if not swings.all():
        limits[~swings] = _by_trying(method, np.array([[[0.0], [1.0]], [[1.0], [0.0]]]), 1).limits
    return np.asarray(limits / np.abs(rates))


def _smallest(rates: Complex, limit_of: Any) -> _StateLimits:
    """The smallest limit of each state, from the rates of its modes, shape (modes, states); rates of NaN have no limit."""
    limits = np.full(rates.shape, np.inf)
    counts = np.isfinite(rates)
    limits[counts] = limit_of(rates[counts])
    first = limits.argmin(axis=0)[np.newaxis]
    smallest, rate = (np.take_along_axis(a, first, axis=0)[0] for a in (limits, rates))
    return _StateLimits(smallest, np.where(np.isfinite(smallest), rate, np.nan))


def _clean(rates: Complex) -> Complex:
    """Rates whose real parts are zero where they are rounding; NaN for rates that are zero or grow in the exact solution."""
    size = np.abs(rates).max(axis=0)
    rates = np.where(np.abs(rates.real) <= REAL_ZERO * size, 1j * rates.imag, rates)
    return np.where((rates.real > 0.0) | (np.abs(rates) <= RATE_ZERO * size), np.nan, rates)


def _stiffness(A: Array, n_v: int) -> Array | None:
    """K of ÿ = K·y if every matrix is that of v̇ = K·y/c, ẏ = c·v; else None."""
    if 2 * n_v != len(A):
        return None
    speed = A[n_v, 0]
    one = np.eye(n_v)[:, :, np.newaxis]
    alike = not A[:n_v, :n_v].any() and not A[n_v:, n_v:].any() and np.array_equal(A[n_v:, :n_v], speed * one)
    return A[:n_v, n_v:] * speed if alike else None


def _of_rates(method: Method, rates: Complex, n_v: int) -> Array:
    """The limits of modes of a method whose growth factors depend on λ·dt alone."""
    size = np.abs(rates)
    directions, which = np.unique(np.where(rates.imag < 0.0, rates.conj(), rates) / size, return_inverse=True)
    limits = np.empty(directions.shape)
    turns = directions.imag != 0.0
    if not turns.all():
        limits[~turns] = stability_limit(LinearSystem([[-1.0]], velocities=1 if n_v else 0), method)
    if turns.any():
        some = directions[turns]
        turning = np.array([[some.real, -some.imag], [some.imag, some.real]])
        # A method that treats both blocks alike has the same limits however the numbers are divided among the blocks.
        velocities = 1 if function_of_rates(method) else 2 if n_v else 0
        limits[turns] = Search(LinearSystem(turning, velocities=velocities), method, None, None, 0.0).limits()[0]
    return np.asarray(limits[which.reshape(-1)] / size)


def _by_trying(method: Method, A: Array, n_v: int) -> _StateLimits:
    """The limits found on a grid of steps: the first step with which a mode grows that does not grow in the exact solution."""
    true = eigen.eigen(A)
    fastest = np.nan_to_num(np.abs(_clean(true.values)), nan=0.0).max(axis=0)
    states = np.flatnonzero(fastest > 0.0)
    limits, rates = np.full(A.shape[2], np.inf), np.full(A.shape[2], np.nan, dtype=np.complex128)
    if not states.size:
        return _StateLimits(limits, rates)
    at_once = max(1, ELEMENTS_AT_ONCE // len(A) ** 2)
    for k in range(0, len(states), at_once):
        some = states[k : k + at_once]
        limits[some], rates[some] = _Trials(method, A[:, :, some], n_v).limits(fastest[some])
    return _StateLimits(limits, rates)


class _Trials:
    """Steps of linear systems with these matrices, shape (n, n, states)."""

    def __init__(self, method: Method, A: Array, n_v: int) -> None:
        self.system, self.method = LinearSystem(A, velocities=n_v), method
        self.true = eigen.eigen(A)

    def growth(self, dt: Array) -> tuple[Array, Array, Complex]:
        """Of steps of shape (states,): how far the fastest-growing mode is outside the unit circle, its tolerance, its rate."""
        P = maps.transition(self.system, self.method, dt)
        finish = maps.finish(self.system, self.method, dt, dt.shape)
        spectrum = eigen.eigen(P, eigen.slot_units(finish, self.true.units))
        rates = eigen.matched(spectrum.values, eigen.product("ij...,jk...->ik...", finish, spectrum.own), self.true)
        size = np.abs(self.true.values).max(axis=0)
        grows = rates.real > REAL_ZERO * size
        still = np.abs(rates) <= RATE_ZERO * size
        tolerance = spectrum.tolerance()
        beyond = np.where(grows | still, -np.inf, np.abs(spectrum.values) - 1.0)
        first = (beyond - tolerance).argmax(axis=0)[np.newaxis]
        beyond, tolerance, rates = (np.take_along_axis(a, first, axis=0)[0] for a in (beyond, tolerance, rates))
        finite = np.isfinite(P).all(axis=(0, 1))
        return np.where(finite, beyond, np.inf), np.where(finite, tolerance, 1.0), rates

    def limits(self, fastest: Array) -> tuple[Array, Complex]:
        """The limit of each state, and the rate of the mode that sets it."""
        low, high = np.zeros(fastest.shape), np.full(fastest.shape, np.inf)
        which = np.full(fastest.shape, np.nan, dtype=np.complex128)
        begins, before = np.zeros(fastest.shape), None
        crept = np.zeros(fastest.shape, dtype=np.bool_)
        last_rung = 0.0
        for rung in LADDER[::STRIDE].tolist():
            dt = rung / fastest
            beyond, tolerance, rates = self.growth(dt)
            new = np.isinf(high) & (beyond > tolerance)
            ratio = rung / last_rung if last_rung else np.inf
            slowly = beyond <= tolerance * ratio**GROWTH_EXPONENT
            crept |= new & slowly & (True if before is None else before)
            low, high, which = np.where(new, begins, low), np.where(new, dt, high), np.where(new, rates, which)
            if np.isfinite(high).all():
                break
            begins, before, last_rung = dt, np.abs(beyond) <= tolerance, rung
        never = np.isfinite(high) & (crept | (low == 0.0))
        search = np.isfinite(high) & ~never
        for _ in range(HALVINGS if search.any() else 0):
            middle = np.where(search, 0.5 * (low + high), 1.0 / fastest)
            beyond, tolerance, rates = self.growth(middle)
            out = beyond > tolerance
            low, high = np.where(search & ~out, middle, low), np.where(search & out, middle, high)
            which = np.where(search & out, rates, which)
        return np.where(never, 0.0, high), which


def _mode(system: System, method: Method, A: Array, limit: float, rate: complex) -> Mode:
    """The mode that becomes unstable at the limit of a state, from the matrix of its linearised rates."""
    linear = LinearSystem(A, velocities=maps.size(system)[0])
    past = limit * (1.0 + PAST_LIMIT) if limit else NEVER_STABLE_STEP / abs(rate)
    true = eigen.eigen(A)
    dt = np.array([past])
    P, finish = maps.transition(linear, method, dt)[:, :, 0], maps.finish(linear, method, dt, (1,))[:, :, 0]
    spectrum = eigen.eigen(P, eigen.slot_units(finish, true.units))
    shapes = eigen.product("ij,jk->ik", finish, spectrum.own)
    continues = eigen.matched(spectrum.values, shapes, true)
    near = np.minimum(np.abs(continues - rate), np.abs(continues - rate.conjugate()))
    ours = near <= near.min() + RATE_ZERO * np.abs(true.values).max()
    which = int(np.where(ours, np.abs(spectrum.values), -np.inf).argmax())
    leaving, shape, own = spectrum.values[which], shapes[:, which], continues[which]
    on = eigen.eigenvalues(maps.transition(linear, method, np.array([limit]))[:, :, 0]) if limit else np.ones(1, dtype=complex)
    crossing = on[np.abs(on - leaving).argmin()]
    if own.imag < 0.0:
        leaving, shape, own, crossing = leaving.conj(), shape.conj(), own.conj(), crossing.conj()
    return mode_of(system, crossing, own, shape, leaving)
