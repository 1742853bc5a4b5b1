"""A linear system from sample to sample (§4): y = P·y·z⁻¹ + Q·x·z⁻¹, exactly or by a method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi, tan
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import ValueEquality, by_value
from ...base.reprs import counted, facts
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...model.compatibility import fits_together
from ...model.inputs import Sampled
from ...model.methods import Method, methods
from ...model.methods import method as find_method
from ...model.parameters import aligned
from ...model.systems import LinearSystem, System
from ...model.systems.linear import is_gain, realised
from ...model.systems.realisation import Realisation, of_gain, parallel, series, sum_of
from ...model.systems.realisation import times as product_of
from ...reference import exact
from ...reference.product import product, times
from ...reference.resolvent import polynomials
from ...runs import engine
from ...runs.engine.linear import one_step
from ..stability import eigen, maps
from .delay import divided, divided_by, not_of_tustin, samples_of, shifted
from .delay import joined as with_samples
from .response import Complex, response

if TYPE_CHECKING:
    from ...base.literals import SampleInterpolation

#: The ways to discretise that are no method, with other names of them.
WAYS = {"zoh": "zoh", "linear": "linear", "foh": "linear", "tustin": "tustin", "bilinear": "tustin", "impulse": "impulse"}

#: How an input runs between two samples.
BETWEEN: tuple[SampleInterpolation, ...] = ("hold", "linear")


@by_value
class SampledRun(NamedTuple):
    """The samples of a discrete system.

    Attributes:
        t: the times of the samples, shape (samples,).
        state: the states in the order of A, shape (samples, n, *batch).
        z: the outputs, shape (samples, outputs, *batch).
    """

    t: Array
    state: Array
    z: Array


@dataclass(frozen=True, eq=False)
class DiscreteSystem(ValueEquality):
    """A linear system from sample to sample: s₊ = P·s + Q·x + Q_next·x₊, z = C·s + D·x.

    x₊ and s₊ are those of the next sample. The states are those of the system, in the order of A.

    Attributes:
        system: the linear system, without inputs x.
        how: the way, or the name of the method.
        interpolation: how the input runs between samples, "hold" or "linear"; None for "impulse", where it does not.
        dt: the time between samples.
        P: transition matrix, shape (n, n, *batch).
        Q: input matrix, shape (n, inputs, *batch).
        Q_next: that of the next sample, zero for held inputs.
        C: output matrix, shape (outputs, n, *batch); without C of the system the outputs are the states.
        D: feedthrough matrix, shape (outputs, inputs, *batch).
        delay: the dead time of the inputs. Its samples under way are states behind those of the system, the newest first.

    ``a * b`` is the system in which the outputs of b are the inputs of a, ``a + b`` and ``a - b`` have common inputs and add or
    subtract outputs; either may be a number, a gain. Systems have the same dt, and join in the form of ``standard``.

    Example:
        >>> held = sw.discretise(sw.TransferFunction(1.0, [1.0, 0.0]), 0.5)  # an integrator
        >>> held.run([1.0, 2.0, 0.0]).z[:, 0]
        array([0. , 0.5, 1.5])
    """

    system: LinearSystem
    how: str
    interpolation: str | None
    dt: float
    P: Array
    Q: Array
    Q_next: Array
    C: Array
    D: Array
    delay: float = 0.0

    @property
    def batch(self) -> Shape:
        """The shape of the batch."""
        return np.broadcast_shapes(*(each.shape[2:] for each in (self.P, self.Q, self.Q_next, self.C, self.D)))

    @cached_property
    def eigenvalues(self) -> Complex:
        """The eigenvalues of P, shape (n, *batch), largest first; samples decay if all are within the unit circle."""
        z = eigen.eigenvalues(self.P)
        return np.take_along_axis(z, np.argsort(-np.abs(z), axis=0, kind="stable"), axis=0)

    @property
    def radius(self) -> Any:
        """r₁, the largest magnitude of an eigenvalue: a number, or an array over the batch."""
        return np.abs(self.eigenvalues[0])[()]

    @property
    def den(self) -> Array:
        """The coefficients of det(Iz − P), highest power first, shape (n + 1, *batch): the denominator in z."""
        return self._polynomials[1]

    @property
    def num(self) -> Array:
        """The numerator in z, highest power first, shape (n + 1, *batch); of several inputs or outputs (n + 1, r, m, *batch)."""
        num = self._polynomials[0]
        return num[:, 0, 0] if num.shape[1:3] == (1, 1) else num

    @cached_property
    def _polynomials(self) -> tuple[Array, Array]:
        return polynomials(*self.standard())

    def standard(self) -> tuple[Array, Array, Array, Array]:
        """The matrices A, B, C and D of the standard form s₊ = A·s + B·x, z = C·s + D·x, as other programs take them.

        Where Q_next is not zero, the states of that form are s − Q_next·x.
        """
        batch = self.batch
        P, Q, after, C, D = (aligned(each, 2, batch) for each in (self.P, self.Q, self.Q_next, self.C, self.D))
        if not self.Q_next.any():
            return self.P, self.Q, self.C, self.D
        return P, Q + product(P, after), C, D + product(C, after)

    #: So that an array of NumPy times a system is a system with that gain, and not an array of systems.
    __array_ufunc__ = None

    def __mul__(self, before: Any) -> Any:
        """The outputs of ``before``, or the inputs times a number, are the inputs of this system."""
        if not is_gain(before):
            return self._with(before, lambda own, other: series(other, own))
        gain = of_gain("gain", before, self.D.shape[1], self.D.shape[1]).D
        return replace(self, Q=product_of(self.Q, gain), Q_next=product_of(self.Q_next, gain), D=product_of(self.D, gain))

    def __rmul__(self, gain: Any) -> Any:
        if not is_gain(gain):
            return self._with(gain, series)
        gain = of_gain("gain", gain, len(self.D), len(self.D)).D
        return replace(self, C=product_of(gain, self.C), D=product_of(gain, self.D))

    def __add__(self, other: Any) -> Any:
        """Common inputs, and the sum of the outputs."""
        if not is_gain(other):
            return self._with(other, parallel)
        return replace(self, D=sum_of(self.D, of_gain("gain", other, *self.D.shape[:2]).D))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self + -1.0 * other if isinstance(other, DiscreteSystem) or is_gain(other) else self._with(other, parallel)

    def __rsub__(self, gain: Any) -> Any:
        return -1.0 * self + gain

    def __neg__(self) -> Any:
        return -1.0 * self

    def _with(self, other: Any, join: Callable[[Realisation, Realisation], Realisation]) -> Any:
        """This system and another one of samples, in the standard form."""
        if isinstance(other, System):
            raise DTypeError(
                f"system: expected another one of samples, got one of continuous time, {other!r}; discretise both "
                f"with the same dt, or discretise what they are together"
            )
        if not isinstance(other, DiscreteSystem):
            return NotImplemented
        if other.dt != self.dt:
            raise ArgumentError(f"dt: expected two systems with the same, got {self.dt:g} and {other.dt:g}")
        whole = join(*(Realisation(*each.standard(), (), (None,) * each.Q.shape[1]) for each in (self, other)))
        return DiscreteSystem(self.system, "joined", "hold", self.dt, whole.A, whole.B, np.zeros_like(whole.B), whole.C, whole.D)

    def frequency_response(self, omega: Any) -> Complex:
        """Z/X at z = e^(jω·dt).

        Args:
            omega: frequencies ω in radians per unit of time, shape (frequencies,) or a number.

        Returns:
            Complex numbers, shape (*frequencies, *batch); of several inputs or outputs (*frequencies, r, m, *batch).

        Raises:
            ArgumentError: if ``omega`` is no such array.
        """
        omega = checks.numbers("omega", omega, unit="rad per unit of time")
        z = np.exp(1j * self.dt * omega)
        return response(self.P, self.Q, self.C, self.D, z, self.Q_next)

    def run(self, x: Any, start: Any = None) -> SampledRun:
        """The states and outputs for samples of the input.

        Args:
            x: the samples, shape (samples, *batch), of several inputs (samples, inputs, *batch).
            start: the state at the first sample in the order of A, shape (n, *batch); zero if None. Samples under way are zero
                unless they are given behind it. For "impulse" it is that
                before the first impulse.

        Returns:
            A ``SampledRun`` of as many samples.

        Raises:
            ArgumentError: if an argument has a wrong shape.
        """
        samples, (n, m) = checks.numbers("x", x), self.Q.shape[:2]
        if m == 1 and samples.ndim:
            samples = samples[:, np.newaxis]
        if samples.ndim < 2 or samples.shape[1] != m or not len(samples):
            wanted = "(samples, batch…)" if m == 1 else f"(samples, {m}, batch…)"
            raise ShapeError(f"x: expected shape {wanted}, with at least one sample, got {np.shape(x)}")
        s = checks.numbers("start", 0.0 if start is None else start)
        if s.ndim and len(s) == len(self.system.A) < n and self.how != "joined":
            s = np.concatenate([s, np.zeros((n - len(s), *s.shape[1:]))])
        s = checks.block("start", s, (n,), "states")
        batch = checks.batch_shape({"x": samples.shape[2:], "start": s.shape[1:], "system": self.batch})
        checks.fits("x: the states and outputs", 1.0 * len(samples) * (n + len(self.C)), batch, "take fewer samples at a time")
        P, Q, after, C, D = (aligned(each, 2, batch) for each in (self.P, self.Q, self.Q_next, self.C, self.D))
        samples, s = aligned(samples, 2, batch), aligned(s, 1, batch)
        states, z = np.empty((len(samples), n, *batch)), np.empty((len(samples), len(C), *batch))
        with np.errstate(all="ignore"):
            if self.how == "impulse":
                s = s + times(after, [*samples[0]])
            for k, sample in enumerate(samples):
                if k:
                    s = times(P, [*s]) + times(Q, [*samples[k - 1]]) + times(after, [*sample])
                states[k] = s
                z[k] = times(C, [*s]) + times(D, [*sample])
        return SampledRun(np.asarray(self.dt * np.arange(len(samples)), np.float64), states, z)

    def _repr_html_(self) -> str:
        n, m = self.Q.shape[:2]
        return facts(
            f"{type(self.system).__name__}, sampled ({self.how})",
            [
                ("dt", f"{self.dt:g}"),
                ("states", n),
                ("inputs", m),
                ("outputs", len(self.C)),
                ("input between samples", self.interpolation),
                ("members", str(self.batch) if self.batch else None),
                ("largest radius of an eigenvalue", f"{np.max(self.radius):.9g}"),
            ],
        )

    def __repr__(self) -> str:
        n, m = self.Q.shape[:2]
        sizes = f"{counted(n, 'state')}, {counted(m, 'input')}, {counted(len(self.C), 'output')}"
        return f"<{sizes}, sampled by {self.how} with dt = {self.dt:g}{f', a batch {self.batch}' if self.batch else ''}>"


def discretise(
    system: Any,
    dt: float,
    how: str | Method = "zoh",
    *,
    interpolation: SampleInterpolation | None = None,
    prewarp: float | None = None,
    delay: float = 0.0,
) -> DiscreteSystem:
    """A linear system from sample to sample, exactly or by a method (§4).

    | ``how`` | what it is | equals at the samples |
    |---|---|---|
    | ``"zoh"`` | the exact solution for an input that is held from sample to sample | a plant behind a converter |
    | ``"linear"``, ``"foh"`` | the exact solution for an input on straight lines between samples | a smooth input |
    | ``"tustin"``, ``"bilinear"`` | s = 2(z − 1)/((z + 1)·dt): the trapezoidal rule | the frequency ``prewarp`` |
    | ``"impulse"`` | the exact solution for impulses x·dt at the samples | the impulse response, for D = 0 |
    | ``"exact"`` | the exact solution for the ``interpolation`` | |
    | a method | its step, for the ``interpolation`` | nothing: the step is wrong by what ``analyse`` says |

    The exact ones take the exponential of a matrix, with twice the digits of a number inside.

    Args:
        system: a linear system of stepwell, or of SciPy or python-control. Its inputs x are left out.
        dt: the time between samples, above zero.
        how: one of the table; a method by its name, or what ``stepwell.method`` returns.
        interpolation: how the input runs between samples, for a method or "exact": ``"hold"`` (if None) or ``"linear"``.
        prewarp: for "tustin", the frequency in radians per unit of time at which the response is that of the system.
        delay: dead time of the inputs, in units of time, zero or more: that of a computer, a bus, a valve. It need not be a
            multiple of dt: in an exact step the input then changes within the step, once. The samples that are under way are
            states behind those of the system, the newest first.

    Raises:
        UnsupportedError: if the system is not linear, or the method cannot step it.

    Example:
        >>> lag = sw.discretise(sw.TransferFunction(1.0, [1.0, 1.0]), 0.1)
        >>> lag.num.round(6), lag.den.round(6)
        (array([0.      , 0.095163]), array([ 1.      , -0.904837]))
    """
    system = LinearSystem.of(system)
    system = system.with_inputs(None)
    dt = checks.number("dt", dt, positive=True, unit="units of time")
    way, method = _way(how)
    if method is None and way != "exact":
        if interpolation is not None:
            raise ArgumentError(
                f"interpolation: expected None, as {way!r} says how the input runs, got {checks.short(interpolation)}"
            )
        between = {"zoh": "hold", "impulse": None}.get(way, "linear")
    else:
        between = checks.known("interpolation", "hold" if interpolation is None else interpolation, BETWEEN)
    if prewarp is not None and way != "tustin":
        raise ArgumentError(
            f'prewarp: expected None for {way!r}, since only "tustin" moves frequencies; got {checks.short(prewarp)}'
        )
    checks.fits("system: the matrices of a step", 60.0 * (len(system.A) + 2) ** 2, system.batch, "take fewer states")
    delay = float(checks.not_negative("delay", checks.number("delay", delay), "a dead time"))
    late = samples_of(delay, dt)
    not_of_tustin(prewarp, late[1])
    if way == "tustin":
        method = find_method("trapezoidal")
    if method is not None:
        try:
            fits_together(system, method)
        except UnsupportedError as error:
            raise UnsupportedError(f"how: {error}") from None
        with np.errstate(all="ignore"):  # a step may be so long that its states leave all numbers
            P, Q, after = of_method(system, method, _warped(dt, prewarp), cast("SampleInterpolation", between))
    else:
        P, Q, after = _exactly(system, dt, way, between)
    part = realised(system, of_states=True) if system.B is not None else None
    n = len(system.A)
    C = system.C if system.C is not None else np.eye(n).reshape(n, n, *(1,) * (system.A.ndim - 2))
    D = part.D if part is not None else np.zeros((len(C), 0))
    if late != (0, 0.0) and Q.shape[1]:
        if not late[1]:
            parts = shifted(P, Q, after, D, late[0])
        elif method is None:
            parts = divided(system, P, D, way, between, dt, late)
        else:
            parts = divided_by(system, method, P, D, between, dt, late)
        P, Q, after, C, D = with_samples(parts, C, Q.shape[1], system.batch)
    return DiscreteSystem(system, way, between, dt, P, Q, after, C, D, delay)


def _way(how: Any) -> tuple[str, Method | None]:
    """The way and, if it is one, the method."""
    if isinstance(how, Method):
        return how.name, None if how.is_exact else how
    if isinstance(how, str) and (how == "exact" or how in WAYS):
        return WAYS.get(how, "exact"), None
    try:
        method = find_method(how)
    except ArgumentError:
        checks.known("how", how, [*WAYS, "exact", *(each.name for each in methods())])
        raise
    return method.name, method


def _warped(dt: float, prewarp: float | None) -> float:
    """The step at which the trapezoidal rule has the right response at one frequency."""
    if prewarp is None:
        return dt
    omega = checks.number("prewarp", prewarp, positive=True, unit="rad per unit of time")
    if omega * dt >= pi:
        raise ArgumentError(f"prewarp: expected a frequency below that of half the samples, π/dt = {pi / dt:g}, got {omega:g}")
    return 2.0 * tan(0.5 * omega * dt) / omega


def _exactly(system: LinearSystem, dt: float, way: str, between: str | None) -> tuple[Array, Array, Array]:
    """P, Q and Q_next of the exact solution."""
    B = np.zeros((len(system.A), 0)) if system.B is None else system.B
    if way == "impulse":
        if system.D is not None and system.D.any():
            raise UnsupportedError("how: the samples of the output for an impulse are not numbers where D leads it there at once")
        return exact.held(system.A, B, dt)[0], np.zeros_like(B), B * dt
    if between == "linear":
        return exact.linear(system.A, B, dt)
    P, Q = exact.held(system.A, B, dt)
    return P, Q, np.zeros_like(Q)


def of_method(system: LinearSystem, method: Method, dt: float, between: SampleInterpolation) -> tuple[Array, Array, Array]:
    """P, Q and Q_next of a method's step, in the order of A."""
    members, names = system.batch, system.input_names
    P, finish = slots_of(system, method, dt)
    step = np.asarray(dt)
    Q = maps.response(system, method, step, members)
    after = np.zeros_like(Q)
    if between == "linear":
        rise = Sampled([0.0, 1.0, 2.0], dt, interpolation="linear")
        for j in range(len(names)):
            of_one = system.with_inputs([rise if i == j else None for i in range(len(names))])
            after[:, j] = one_step(engine.Plan(of_one, method, np.broadcast_shapes(of_one.batch, members), dt))  # from rest
        Q = Q - after
    P, Q, after = of_states(system, method, dt, P, Q, after, finish)
    # A run sees held samples by their mean over the stretch of time of a rate: all of a step have the sample of its start.
    return (P, Q, after) if between == "linear" else (P, Q + after, np.zeros_like(after))


def slots_of(system: LinearSystem, method: Method, dt: float) -> tuple[Array, Array]:
    """P of a method's slots, and the map from these to states, both over the batch."""
    fits_together(system, method)
    n, step = len(system.A), np.asarray(dt)
    P = np.broadcast_to(maps.transition(system, method, step), (n, n, *system.batch))
    return P, maps.finish(system, method, step, system.batch)


def of_states(
    system: LinearSystem, method: Method, dt: float, P: Array, Q: Any, after: Any, finish: Array
) -> tuple[Array, Any, Any]:
    """Transform matrices of slots into matrices of states, in the order of A.

    A state is F·(slots) + G·x: for methods that carry something in place of v, the velocity depends on the input of its time.
    """
    if method.carry is not None:
        names, members = system.input_names, system.batch
        G = np.zeros((len(P), len(names), *members))
        n_v = len(system.velocities)
        rest = [np.zeros((*shape, *members)) for shape in (system.v_shape, system.y_shape)]
        for j, name in enumerate(names):
            s = system.with_pulse(name, np.ones(1), 1.0).scaled(dt, members)
            G[:n_v, j] = method.steps.finish(s, 0, 0.0, *rest)
        F, of_slots = (np.asarray(np.moveaxis(each, (0, 1), (-2, -1))) for each in (finish, P))
        swapped = np.linalg.solve(np.swapaxes(F, -1, -2), np.swapaxes(F @ of_slots, -1, -2))  # of F·P·F⁻¹
        P = np.asarray(np.moveaxis(swapped, (-1, -2), (0, 1)), np.float64)
        G = G.reshape(*G.shape[:2], *(1,) * (np.ndim(Q) - G.ndim), *members)
        Q = eigen.product("ij...,jk...->ik...", finish, Q) - eigen.product("ij...,jk...->ik...", P, G)
        after = eigen.product("ij...,jk...->ik...", finish, after) + G
    place = np.argsort([*system.velocities, *system.coordinates])
    return P[place][:, place], Q[place], after[place]
