"""``analyse``: the stability of a step of any system by any method, in the words of Hoffmann's §4."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import checks, registry
from ...base.arrays import Array, Shape
from ...base.immutable import ValueEquality
from ...base.pictures import drawn
from ...base.reprs import facts
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...model.compatibility import fits_together, one_state
from ...model.methods import Method
from ...model.methods import method as find_method
from ...model.systems import System
from ...model.systems.base import a_system
from ...runs.result import Run
from . import eigen, maps
from .eigen import Complex
from .exact import MAX_ROWS
from .parts import spectra

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

#: How a sequence of samples behaves (§4), by the dominant eigenvalue. A single negative eigenvalue, which Hoffmann does not
#: list, changes the sign at every step: an oscillation with two samples per period. If so many eigenvalues nearly coincide that
#: rounding hides whether they are outside the unit circle, the kind is "not decided", which does not count as stable.
KINDS = (
    "monotonic stable",
    "constant",
    "monotonic unstable",
    "damped oscillation",
    "harmonic",
    "unstable oscillation",
    "monotonic unstable (double eigenvalue +1)",
    "unstable oscillation (double eigenvalue -1)",
    "unstable oscillation (double pair)",
    "not finite",
    "not decided",
)


class Analysis(ValueEquality):
    """A step as a linear map. ``members`` is the shape to which dt, the parameters and the states broadcast.

    Attributes:
        system: the system.
        method: the method.
        dt: the step, in units of time, of shape ``members``.
        P: transition matrix, shape (n, n, *members): rows and columns are the slots.
        Q: input matrix of a linear system, shape (n, inputs, *members): the state after a step from rest with an input held at 1.
        slots: names of the n numbers that a step maps; ``y_prev`` in place of ``v`` for Verlet.
        inputs: names of the inputs.
        polynomial: coefficients of det(Iz − P), highest power first, shape (n + 1, *members).
        p: half the trace of P, for two states; the polynomial is z² − 2pz + q. None for other numbers of states.
        q: the determinant of P, for two states, and r₁² of a conjugate pair; else None.
        eigenvalues: of P, shape (n, *members): the largest first, among equal ones the fastest first.
        rates: for each eigenvalue of P the eigenvalue λ of the same mode of the rates; e^(λ·dt) would be exact.
        radius: r₁, the largest magnitude of an eigenvalue.
        angle: Ψ in 0 … π, the angle per step of that eigenvalue, by atan2.
        true_angle: Φ, the angle per step of the same mode of the exact solution: ω₀·dt for the undamped oscillator.
        omega: Ω₀ = Ψ/dt, the frequency of the numerical solution, in radians per unit of time.
        frequency_ratio: Ψ/Φ; NaN where the exact solution does not oscillate.
        samples_per_period: 2π/Ψ; infinite where nothing oscillates.
        kind: one of ``KINDS``, Hoffmann's words for the behaviour of the samples.
        stable: whether the samples stay bounded.
    """

    def __init__(
        self, system: System, method: Method, dt: Array, P: Array, Q: Array, A: Array, finish: Array, run: Run | None = None
    ) -> None:
        self._run = run
        self.system = system
        self.method = method
        n, members = len(P), P.shape[2:]
        self.dt = _plain(np.broadcast_to(dt, members))
        self.P = P
        self.Q = Q
        self.slots = names_of(method.carry or "v", system.v_shape) + names_of("y", system.y_shape)
        self.inputs = system.input_names
        A = np.broadcast_to(_wide(A, members), P.shape)
        if n <= 2:
            z, exact = eigen.eigenvalues(P), eigen.eigenvalues(A)
            if n == 2:
                if system.linear and not method.is_exact:
                    with np.errstate(invalid="ignore"):
                        close = np.maximum(np.abs(z[0] - z[1]), np.abs(np.abs(z[0]) - 1.0)) < eigen.NEARLY_DOUBLE
                    self._in_more_digits(close & (z[0] != z[1]), A, z)
                exact = eigen.matched_of_two(P, z, A, exact, finish)
            tolerances = np.broadcast_to(eigen.tolerance(P), z.shape)
            single_vector = (z[0] == z[-1]) & ((P[0, -1] != 0) | (P[-1, 0] != 0)) & (n == 2)
            single_vector = np.broadcast_to(single_vector, z.shape)
        else:
            true = eigen.eigen(A)
            spectrum = eigen.eigen(P, eigen.slot_units(finish, true.units))
            exact = eigen.matched(spectrum.values, eigen.product("ij...,jk...->ik...", finish, spectrum.own), true)
            z, tolerances, single_vector = eigen.settled(spectrum)
            if system.linear and n <= MAX_ROWS and not method.is_exact:
                doubtful = (spectrum.tolerance() > eigen.REFINE_ABOVE).any(axis=0) & np.isfinite(z).all(axis=0)
                for index, values, own in self._in_more_digits(doubtful, A, z):
                    at: Any = (slice(None), *index)
                    exact[at], tolerances[at] = own, 16.0 * n * eigen.EPS * np.maximum(1.0, np.abs(values))
                    single_vector[at] = eigen.one_vector(checks.member(P, index), values)
        by_size = eigen.order(z, tolerances, single_vector)
        z, exact, tolerances, single_vector = (
            np.take_along_axis(a, by_size, axis=0) for a in (z, exact, tolerances, single_vector)
        )
        with np.errstate(over="ignore", invalid="ignore"):  # steps so long that products of elements leave the range
            self.polynomial = _polynomial(P, z)
            self.p: Any = _plain(0.5 * (P[0, 0] + P[1, 1])) if n == 2 else None
            self.q: Any = _plain(P[0, 0] * P[1, 1] - P[0, 1] * P[1, 0]) if n == 2 else None
        self.eigenvalues = z
        self.rates = exact
        self.radius = _plain(np.abs(z[0]))
        self.angle = _plain(np.abs(np.angle(z[0])))
        self.true_angle = _plain(np.abs(exact[0].imag) * self.dt)
        kind = _kind(z, single_vector[0], tolerances)
        self.kind: Any = np.array(KINDS)[kind] if members else KINDS[int(kind)]
        self.stable = _plain(np.isin(kind, (0, 1, 3, 4)))
        with np.errstate(divide="ignore", invalid="ignore"):
            self.omega = self.angle / self.dt
            self.frequency_ratio = _plain(np.where(self.true_angle > 0, self.angle / np.asarray(self.true_angle), np.nan))
            self.samples_per_period = _plain(np.asarray(2.0 * np.pi / np.asarray(self.angle)))

    def _in_more_digits(self, doubtful: Any, A: Array, z: Complex) -> list[tuple[Shape, Complex, Complex]]:
        """Replace in ``z`` the eigenvalues of a linear system that rounding moves by values from arithmetic with more digits.

        Returns:
            For each such member the index, the eigenvalues, and the rates that they continue.
        """
        dt = np.broadcast_to(self.dt, z.shape[1:])
        alike: dict[bytes, list[Shape]] = {}
        for index in map(tuple, np.argwhere(doubtful).tolist()):
            alike.setdefault(checks.member(A, index).tobytes(), []).append(index)
        refined = []
        for members in alike.values():
            steps = np.array([dt[index] for index in members])
            values, rates = spectra(checks.member(A, members[0]), maps.size(self.system)[0], self.method, steps)
            for k, index in enumerate(members):
                at: Any = (slice(None), *index)
                z[at] = values[:, k]
                refined.append((index, values[:, k], rates[:, k]))
        return refined

    @property
    def radii(self) -> Array:
        """The magnitude of each eigenvalue, shape (n, *members)."""
        return np.abs(self.eigenvalues)

    @property
    def angles(self) -> Array:
        """The angle of each eigenvalue in 0 … π, shape (n, *members)."""
        return np.abs(np.angle(self.eigenvalues))

    @property
    def frequency_ratios(self) -> Array:
        """Ψ/Φ of each mode, shape (n, *members); NaN where the exact solution does not oscillate."""
        true = np.abs(self.rates.imag) * self.dt
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(true > 0, self.angles / true, np.nan)

    @property
    def monodromy(self) -> Array:
        """The derivative of a run's end with respect to its start, in slots, shape (n, n, *batch): the product of its steps' P.

        The run must have saved every step. The eigenvalues decide whether a periodic orbit is stable; those of single steps do
        not.
        """
        if self._run is None:
            raise ArgumentError("monodromy: expected an analysis along a run (at=run), got that of single steps")
        if self.method is not self._run.method or not np.all(self.dt == self._run.dt):
            raise ArgumentError(
                f"monodromy: expected an analysis with the run's own method and step, {self._run.method.name} and "
                f"dt = {self._run.dt:g}, got {self.method.name} and {np.ravel(self.dt)[0]:g}"
            )
        if self._run.paces is not None or len(self._run.t) != self._run.steps + 1:
            raise ArgumentError(f"monodromy: expected a run of which every step was saved (every=1), got {self._run!r}")
        product = self.P[:, :, 0]
        for k in range(1, self._run.steps):  # no step of the run begins at the last saved state
            product = eigen.product("ij...,jk...->ik...", self.P[:, :, k], product)
        return product

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the eigenvalues of the step in the z-plane, with those of the exact solution.

        Args:
            path: the file to write, or None; its ending is that of the format.

        Returns:
            The figure; a notebook shows it.

        Raises:
            ArgumentError: if there is no such format.
            UnsupportedError: if matplotlib is missing.

        Example:
            >>> import stepwell as sw
            >>> figure = sw.analyse(sw.Oscillator(), "rk4", dt=0.5).plot()
        """
        return drawn(path, lambda: registry.task("draw_eigenvalues")(self))

    def _repr_html_(self) -> str:
        title = f"{type(self.system).__name__} by {self.method.title}"
        if self.P.ndim > 2:
            stable = np.asarray(self.stable)
            kinds, counts = np.unique(np.asarray(self.kind), return_counts=True)
            rows = [(str(kind), str(count)) for kind, count in zip(kinds, counts, strict=True)]
            return facts(title, [("stable", f"{np.count_nonzero(stable)} of {stable.size}"), *rows])
        return facts(
            title,
            [
                ("system", repr(self.system)),
                ("dt", f"{self.dt:g}"),
                ("kind", self.kind),
                ("stable", "yes" if self.stable else "no"),
                ("spectral radius r₁", f"{self.radius:.9g}"),
                ("angle Ψ of a step", f"{self.angle:.6g} rad"),
                ("frequency ratio Ψ/Φ", f"{self.frequency_ratio:.6g}"),
                ("steps a period", f"{self.samples_per_period:.4g}"),
            ],
        )

    def __repr__(self) -> str:
        head = f"<analysis of {self.system!r} by {self.method.name}: "
        if self.P.ndim > 2:
            stable = np.asarray(self.stable)
            return f"{head}{np.count_nonzero(stable)} of {stable.size} stable>"
        angle = f"Ψ = {self.angle:.6g}, Ψ/Φ = {self.frequency_ratio:.6g}"
        return f"{head}dt = {self.dt:g}, r₁ = {self.radius:.9g}, {angle}, {self.kind}>"


def analyse(
    system: System, method: str | Method, *, dt: Any = None, at: Any = None, t: float = 0.0, v: Any = None, y: Any = None
) -> Analysis:
    """Find the transition matrix of a step and its eigenvalues, and classify them (§4).

    The columns of P of a linear system are the unit vectors after a step. For a nonlinear system P is the Jacobian of a step at a
    state, exact to rounding: it maps a small disturbance before the step to the one after it. Verlet is analysed with its two
    positions as the state; at small steps its angle has a relative rounding error of up to 2⁻⁵²/Φ².

    Args:
        system: the system; its parameters may be arrays. For a run under control it is ``run.system``.
        method: its name, or what ``stepwell.method`` returns.
        dt: the step, in units of time, above zero; an array broadcasts with the parameters. With a run, None is the run's step.
        at: the state at which a nonlinear system is linearised: a pair ``(v, y)`` of shapes (*block, *batch), or a ``Run``, whose
            saved states then are the first axis of the members.
        t: the time of the linearisation; a run has its own times.
        v: the velocities of the state, in place of ``at``.
        y: the coordinates of the state, in place of ``at``.

    Returns:
        An ``Analysis``; numbers for one member, arrays of the shape of the members otherwise.

    Raises:
        UnsupportedError: if the method cannot step the system.

    Example:
        >>> step = sw.analyse(sw.Oscillator(), "rk4", dt=0.1)
        >>> bool(step.stable), step.kind
        (True, 'damped oscillation')
    """
    method = find_method(method)
    at = state_argument(at, v, y)
    system = a_system(system).for_state_shapes(*(at if isinstance(at, (tuple, list)) else ()))
    fits_together(system, method)
    one_state("analyse", method)
    system.not_in_a_loop("analyse")
    if isinstance(at, Run):
        if type(at.system) is not type(system):
            raise ShapeError(f"at: expected a run of {system!r}, got one of {at.system!r}")
        system = system.for_state_shapes(at.v[0], at.y[0])
        if dt is None and at.paces is not None:
            raise ArgumentError("dt: expected the step, in units of time, since the run has chosen its own, got None")
        dt = at.dt if dt is None else dt
    if dt is None:
        raise ArgumentError("dt: expected the step, in units of time, got None")
    step = checks.numbers("dt", dt, positive=True, unit="units of time")
    t = checks.number("t", t)
    members = checks.batch_shape({"dt": step.shape, "system": system.batch})
    n = sum(maps.size(system))
    checks.fits("the matrices", 4 * n * n, members, "ask for fewer")
    if at is None:
        if not system.linear:
            raise ArgumentError(
                f"at: {system!r} is not linear, so its transition matrix depends on the state; give at=(v, y), or a run"
            )
        return Analysis(
            system,
            method,
            step,
            np.broadcast_to(maps.transition(system, method, step), (n, n, *members)),
            maps.response(system, method, step, members),
            maps.rates(system),
            maps.finish(system, method, step, members),
        )
    if isinstance(at, Run):
        return _along(system, method, step, at)
    v, y = state("at", system, at, "or a run")
    batches = {"dt and system": members, "v": v.shape[len(system.v_shape) :], "y": y.shape[len(system.y_shape) :]}
    checks.fits("at: the matrices", 8 * n * n, checks.batch_shape(batches), "ask for fewer")
    P = maps.jacobian(system, method, step, t, v, y)
    none = np.zeros((n, 0, *P.shape[2:]))
    Q = none if not system.linear else maps.response(system, method, step, P.shape[2:])
    return Analysis(
        system, method, step, P, Q, maps.rates(system, t, v, y), maps.finish(system, method, step, P.shape[2:], t, v, y)
    )


def state_argument(at: Any, v: Any, y: Any) -> Any:
    """The state argument of a call: ``at``, or ``v`` and ``y``."""
    if v is None and y is None:
        return at
    if y is None:
        raise ArgumentError("v, y: expected both or neither, got v alone")
    if at is not None:
        raise ArgumentError("at, v, y: expected a state as at=(v, y) or as v= and y=, got both")
    return v, y


def state(argument: str, system: System, at: Any, or_what: str = "of blocks") -> tuple[Array, Array]:
    """The blocks of a state from an argument that should be a pair (v, y); without velocities an array is y."""
    if isinstance(at, np.ndarray) and system.v_shape == (0,):
        at = None, at
    if not isinstance(at, (tuple, list)) or len(at) != 2:
        got = f"{len(at)} of them" if isinstance(at, (tuple, list)) else type(at).__name__
        raise DTypeError(f"{argument}: expected a pair (v, y) {or_what}, got {got}")
    v = checks.block(f"{argument}[0], v", velocities(system, at[0]), system.v_shape, system.axes)
    y = checks.block(f"{argument}[1], y", at[1], system.y_shape, system.axes)
    return v, y


def velocities(system: System, v: Any) -> Any:
    """The velocities of an argument; None stands for none where the system has no velocities."""
    if v is not None:
        return v
    if system.v_shape != (0,):
        raise ArgumentError(f"v: expected the velocities of the state, since {system!r} has some, got None")
    return 0.0


def goes_forward(run: Run) -> None:
    """Raise if a run went back in time."""
    if run.dt < 0.0:
        raise UnsupportedError(
            f"run: expected steps forward in time, got dt = {run.dt:g}: what decays forward grows on the way back"
        )


def _along(system: System, method: Method, dt: Array, run: Run) -> Analysis:
    goes_forward(run)
    if run.t.ndim > 1:
        raise UnsupportedError("at: expected a run whose members have their times in common; analyse a run for each t0")
    expected = (*system.v_shape, *run.status.shape)
    if run.v.shape[1:] != expected:
        raise ShapeError(f"at: expected a run of {system!r}, states of v of shape {expected}, got {run.v.shape[1:]}")
    members = checks.batch_shape({"dt": dt.shape, "system": system.batch, "at": run.status.shape})
    n = sum(maps.size(system))
    matrices, exact, finish = (np.empty((n, n, len(run.t), *members)) for _ in range(3))
    for k, (t, v, y) in enumerate(zip(run.t.tolist(), run.v, run.y, strict=True)):
        matrices[:, :, k] = maps.jacobian(system, method, dt, t, v, y)
        exact[:, :, k] = _wide(maps.rates(system, t, v, y), members)
        finish[:, :, k] = _wide(maps.finish(system, method, dt, members, t, v, y), members)
    Q = maps.response(system, method, dt, (len(run.t), *members)) if system.linear else np.zeros((n, 0, len(run.t), *members))
    return Analysis(system, method, dt, matrices, Q, exact, finish, run)


def _wide(matrix: Array, members: Shape) -> Array:
    """A matrix with axes of length 1 in front of those of its members, so that it has as many as ``members``."""
    return matrix.reshape(*matrix.shape[:2], *(1,) * (len(members) - matrix.ndim + 2), *matrix.shape[2:])


def _polynomial(P: Array, z: Complex) -> Array:
    """Coefficients of det(Iz − P), highest power first: exact from the elements for two states, else from the eigenvalues."""
    n = len(P)
    coefficients = np.zeros((n + 1, *P.shape[2:]), dtype=np.complex128)
    coefficients[0] = 1.0
    if n == 2:
        coefficients[1] = -(P[0, 0] + P[1, 1])
        coefficients[2] = P[0, 0] * P[1, 1] - P[0, 1] * P[1, 0]
    else:
        for k in range(n):
            coefficients[1 : k + 2] -= z[k] * coefficients[: k + 1].copy()
    return np.ascontiguousarray(coefficients.real)


def _kind(z: Complex, single_vector: Any, tolerances: Array) -> Any:
    """The index in ``KINDS``: the first eigenvalue decides, unless another is too uncertain."""
    first = z[0]
    with np.errstate(invalid="ignore"):
        beyond = np.abs(z) - 1.0
        on = np.abs(beyond) <= tolerances
        size = np.where(on[0], 1, np.where(beyond[0] > 0.0, 2, 0))
        oscillates = (first.imag != 0.0) | (first.real < 0.0)
        vague = (
            (on & (tolerances > eigen.UNDECIDED_ABOVE)).any(axis=0) & (size != 2)
            if len(z) > 2
            else np.zeros(first.shape, dtype=bool)
        )
    double = single_vector & (size == 1)
    kind = np.where(oscillates, 3 + size, size)
    kind = np.where(double & (first.imag != 0.0), 8, np.where(double & (first.real < 0.0), 7, np.where(double, 6, kind)))
    return np.where(np.isfinite(first), np.where(vague, 10, kind), 9)


def names_of(block: str, shape: Shape) -> list[str]:
    """The names of the numbers of a block."""
    return [block + (str(list(map(int, index))) if index else "") for index in np.ndindex(shape)]


def _plain(array: Any) -> Any:
    """A number for one member, an array for several."""
    return np.asarray(array)[()]
