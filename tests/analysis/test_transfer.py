"""Transfer functions, other libraries' objects as linear systems, and systems joined to larger ones (§3)."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from support.looped import assert_refused, looped
from support.refusals import refused

signal = pytest.importorskip("scipy.signal")

#: Frequencies at which responses are compared: below, near and beyond all corners.
OMEGA = np.geomspace(1e-2, 1e3, 41)

#: Responses of some ten operations on numbers of size 1 to 10⁴, which the conditions of sI − A multiply by as much.
CLOSE = 1e-11


def response(system: sw.LinearSystem, member: tuple[int, ...] = ()) -> Any:
    """C(jωI − A)⁻¹B + D of one member, shape (outputs, inputs, frequencies)."""

    def of(matrix: Any) -> Any:
        wide = np.broadcast_to(matrix, (*matrix.shape[: 2 + max(0, matrix.ndim - 2)],))
        for i in reversed(member):
            wide = wide[..., i if wide.shape[-1] > 1 else 0] if wide.ndim > 2 else wide
        return wide

    assert system.B is not None
    assert system.C is not None
    A, B, C = of(system.A), of(system.B), of(system.C)
    D = np.zeros((len(C), B.shape[1])) if system.D is None else of(system.D)
    return np.stack([C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D for w in OMEGA], axis=-1)


def ratio(num: Any, den: Any) -> Any:
    """num/den along the imaginary axis."""
    return np.polyval(num, 1j * OMEGA) / np.polyval(den, 1j * OMEGA)


def near(one: Any, other: Any) -> None:
    scale = np.maximum(np.abs(other), 1e-9 * np.abs(other).max())
    assert (np.abs(one - other) <= CLOSE * scale).all()


G: Any = ([3.0, 1.0], [1.0, 0.4, 4.0])
H: Any = ([2.0, 5.0, 1.0], [1.0, 3.0, 0.5])  # equal degrees
K: Any = ([1.0], [0.2, 1.0])


@looped("num, den", [G, H, K, ([1.0], [1.0, 0.0]), ([0.0, 0.0, 2.0], [0.0, 4.0, 2.0]), ([7.0], [2.0, 1.0])])
def test_the_response_is_the_ratio_of_the_polynomials(num: Any, den: Any) -> None:
    near(response(sw.TransferFunction(num, den))[0, 0], ratio(num, den))


def test_the_matrices_are_those_of_scipy_and_of_hoffmann() -> None:
    """The same controllable form, so that states can be taken over; equal degrees go through D."""
    ours, theirs = sw.TransferFunction(*H), signal.tf2ss(*H)
    for name, matrix in zip("ABCD", theirs, strict=True):
        assert np.array_equal(getattr(ours, name), matrix), name
    assert ours.velocities == (0,)
    assert sw.TransferFunction(*G).D is None
    # Its states are velocity and coordinate, so that the step is Hoffmann's: z² − 2pz + q with q = 1 without damping.
    step = sw.analyse(sw.TransferFunction(4.0, [1.0, 0.0, 4.0]), "false_euler", dt=0.3)
    assert (step.p, step.q) == pytest.approx((1.0 - 0.5 * 0.36, 1.0), abs=1e-15)
    assert sw.TransferFunction(4.0, [1.0, 0.0, 4.0]).second_order


def test_a_batch_of_coefficients() -> None:
    num, den = np.array([[2.0, 3.0], [1.0, 0.5]]), np.array([1.0, 2.0, 4.0])
    system = sw.TransferFunction(num, den)
    assert system.batch == (2,)
    for k in range(2):
        near(response(system, (k,))[0, 0], ratio(num[:, k], den))
    dens = np.array([[1.0, 2.0], [0.3, 0.5], [4.0, 9.0]])
    assert sw.TransferFunction(1.0, dens).batch == (2,)
    run = sw.integrate(sw.TransferFunction(1.0, dens, x=1.0), "rk4", v=0.0, y=0.0, dt=0.01, steps=6000)
    assert run.z[-1, 0] == pytest.approx(1.0 / dens[-1], rel=1e-3)  # e^(−0.125·60) is 6e-4
    grid = sw.TransferFunction(np.ones((2, 3, 1)), np.ones((2, 1, 4)) * np.array([1.0, 5.0])[:, None, None])
    assert grid.batch == (3, 4)


OBJECTS: dict[str, tuple[Any, Any]] = {
    "TransferFunction": (signal.TransferFunction(*H), H),
    "lti": (signal.lti(*G), G),
    "StateSpace": (signal.StateSpace(*signal.tf2ss(*H)), H),
    "ZerosPolesGain": (signal.ZerosPolesGain(*signal.tf2zpk(*G)), G),
    "a gain over poles": (signal.ZerosPolesGain([], [-5.0], 5.0), ([5.0], [1.0, 5.0])),
    "python-control's table": (SimpleNamespace(num=[[np.array(H[0])]], den=[[np.array(H[1])]], dt=0), H),
    "python-control's matrices": (
        SimpleNamespace(**dict(zip("ABCD", signal.tf2ss(*G), strict=True)), dt=None, zeros=list, poles=list),
        G,
    ),
}


@looped("name", OBJECTS)
def test_objects_of_other_libraries(name: str) -> None:
    system, (num, den) = OBJECTS[name]
    near(response(sw.LinearSystem.of(system))[0, 0], ratio(num, den))


def test_several_inputs_and_outputs_of_other_libraries() -> None:
    table = [[G, K], [([2.0], [1.0]), H]]
    both = SimpleNamespace(
        num=[[np.array(each[0]) for each in row] for row in table],
        den=[[np.array(each[1]) for each in row] for row in table],
        dt=0,
    )
    whole = response(sw.LinearSystem.of(both))
    for i in range(2):
        for j in range(2):
            near(whole[i, j], ratio(*table[i][j]))
    rows = signal.TransferFunction([[1.0, 0.0], [0.0, 3.0]], [1.0, 2.0])
    both_rows = response(sw.LinearSystem.of(rows))
    near(both_rows[0, 0], ratio([1.0, 0.0], [1.0, 2.0]))
    near(both_rows[1, 0], ratio([3.0], [1.0, 2.0]))


@looped("form", ["canonical", "physical"])
def test_an_oscillator_as_a_linear_system(form: Any) -> None:
    """z = y, so the response to x is ω₀²/(s² + 2Dω₀s + ω₀²), to a 1 over the same."""
    oscillator = sw.Oscillator(np.array([2.0, 3.0]), 0.1, form=form, a=1.0)
    system = sw.LinearSystem.of(oscillator)
    assert system.x[0] is None
    assert system.velocities == (0,)
    for k, omega in enumerate((2.0, 3.0)):
        den = [1.0, 0.2 * omega, omega**2]
        near(response(system, (k,))[0, 0], ratio([omega**2], den))
        near(response(system, (k,))[0, 1], ratio([1.0], den))
    chain = sw.Chain(3, stiffness=np.array([[1.0, 2.0]]))
    free = sw.LinearSystem.of(chain)
    assert (free.B, free.velocities, len(free.C)) == (None, (0, 1, 2), 3)
    assert pytest.approx(sw.analyse(chain, "false_euler", dt=0.1).P, abs=1e-15) == sw.analyse(free, "false_euler", dt=0.1).P


def test_joined_systems() -> None:
    g, h, k = (sw.TransferFunction(*each) for each in (G, H, K))
    a, b, c = (ratio(*each) for each in (G, H, K))
    for system, expected in (
        (sw.series(g, h), a * b),
        (sw.series(2.0, g, 0.5, h, k), a * b * c),
        (h * g, a * b),
        (g * 3.0, 3.0 * a),
        (np.float64(3.0) * g, 3.0 * a),
        (sw.parallel(g, h, 1.5), a + b + 1.5),
        (g + h, a + b),
        (1.0 + g, 1.0 + a),
        (1.0 - g, 1.0 - a),
        (g - h, a - b),
        (-g, -a),
        (sw.feedback(g), a / (1.0 + a)),
        (sw.feedback(g, h), a / (1.0 + a * b)),
        (sw.feedback(h, k, sign=1), b / (1.0 - b * c)),
        (sw.feedback(h, h), b / (1.0 + b * b)),
        (sw.feedback(2.0, k), 2.0 / (1.0 + 2.0 * c)),
        (sw.feedback(k, 10.0), c / (1.0 + 10.0 * c)),
    ):
        near(response(system)[0, 0], expected)
    assert sw.series(g, h).velocities == (0, 2)
    rng = np.random.default_rng(0)
    A, B, C, D = (rng.normal(size=shape) for shape in ((3, 3), (3, 2), (3, 3), (3, 2)))
    E, F, P, Q = (rng.normal(size=shape) for shape in ((2, 2), (2, 3), (2, 2), (2, 3)))
    one, other = sw.LinearSystem(A, B, C, D), sw.LinearSystem(E, F, P, Q)
    a, b = response(one), response(other)
    assert response(sw.series(one, other)) == pytest.approx(np.einsum("ijw,jkw->ikw", b, a), rel=1e-9, abs=1e-9)
    loop = np.moveaxis(a, -1, 0)
    closed = np.linalg.solve(np.eye(3) + loop @ np.moveaxis(b, -1, 0), loop)
    assert response(sw.feedback(one, other)) == pytest.approx(np.moveaxis(closed, 0, -1), rel=1e-9, abs=1e-9)


def test_gains_over_a_batch_and_what_a_system_is_in_python() -> None:
    gains = np.array([1.0, 5.0, 20.0])
    loops = sw.feedback(gains * sw.TransferFunction(1.0, [1.0, 2.0, 0.0]))
    assert loops.batch == (3,)
    for k, gain in enumerate(gains):
        near(response(loops, (k,))[0, 0], ratio([gain], [1.0, 2.0, gain]))
    with pytest.raises(TypeError):
        sw.TransferFunction(*G) * "2"
    with pytest.raises(TypeError):
        "2" + sw.TransferFunction(*G)
    assert repr(sw.TransferFunction(*H)) == "TransferFunction(num=[2.0, 5.0, 1.0], den=[1.0, 3.0, 0.5])"
    assert sw.TransferFunction(*H) == sw.TransferFunction(*H)
    assert sw.TransferFunction(*H) != sw.TransferFunction(*G)


def test_inputs_of_joined_systems() -> None:
    push = sw.Sinusoid(1.0, 2.0)
    driven, free = sw.TransferFunction(*G, x=push), sw.TransferFunction(*H)
    for system in (
        sw.series(driven, free),
        free * driven,
        driven * 2.0,
        2.0 * driven,
        sw.parallel(free, driven),
        sw.feedback(driven),
    ):
        assert system.x == (push,)
    assert free.with_inputs(push).x == (push,)
    assert driven.with_inputs(None).x == (None,)
    for make in (lambda: sw.series(free, driven), lambda: sw.feedback(free, driven)):
        refused(ArgumentError, "expected x of the first system only", make)
    refused(ArgumentError, "expected one input for both systems", sw.parallel, driven, sw.TransferFunction(*H, x=1.0))


def test_the_run_of_a_loop_is_that_of_its_parts() -> None:
    """A PI controller around a lag, whose step response is known: 1 − e^(−t) for a gain that cancels the pole."""
    controller = sw.parallel(2.0, sw.TransferFunction(2.0, [1.0, 0.0]))
    loop = sw.feedback(sw.series(controller, sw.TransferFunction(0.5, [1.0, 1.0]))).with_inputs(1.0)
    run = sw.integrate(loop, "rk4", v=0.0, y=0.0, dt=0.01, steps=100, every=50)
    assert run.z[:, 0] == pytest.approx(1.0 - np.exp(-run.t), abs=1e-9)  # h⁴/120·t is 1e-10


WRONG: list[tuple[Any, type[Exception], str]] = [
    (lambda: sw.TransferFunction([1.0, 0.0, 0.0], [1.0, 1.0]), ArgumentError,
     "num: expected a degree of at most that of den, 1, got 2"),
    (lambda: sw.TransferFunction(1.0, 2.0), ArgumentError, "den: expected a degree of 1 or more, got 0: a gain alone"),
    (lambda: sw.TransferFunction(1.0, [0.0, 0.0]), ArgumentError,
     "den: expected a first coefficient other than zero, but all are"),
    (lambda: sw.TransferFunction(1.0, np.array([[0.0, 1.0], [1.0, 1.0]])), ArgumentError,
     "den: expected a first coefficient other than zero, but it is zero in 1 member and not in others"),
    (lambda: sw.TransferFunction([], [1.0, 1.0]), ShapeError, "num: expected the coefficients of a polynomial"),
    (lambda: sw.TransferFunction([1j], [1.0, 1.0]), DTypeError, "num: expected real numbers"),
    (lambda: sw.TransferFunction(np.ones((1, 2)), np.ones((2, 3))), ShapeError, "do not broadcast to one: num (2,), den (3,)"),
    (lambda: sw.LinearSystem.of(signal.dlti([1.0], [1.0, 0.5], dt=0.1)), UnsupportedError, "dt = 0.1, which is sampled already"),
    (lambda: sw.LinearSystem.of(SimpleNamespace(num=[[[1.0]]], den=[[[1.0]]], dt=True)), UnsupportedError, "sampled already"),
    (lambda: sw.LinearSystem.of(signal.ZerosPolesGain([], [-1.0 + 1j], 1.0)), ArgumentError, "poles: expected real numbers"),
    (lambda: sw.LinearSystem.of([1.0]), DTypeError, "system: expected a linear system of stepwell, or an object of SciPy"),
    (lambda: sw.LinearSystem.of(sw.Pendulum()), UnsupportedError, "system: expected a linear one"),
    (lambda: sw.LinearSystem.of(SimpleNamespace(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=[[2.0]], dt=0)),
     ArgumentError, "A: expected at least one state, got none: a gain alone"),
    (lambda: sw.feedback(sw.TransferFunction(*H), -0.5), ArgumentError, "an algebraic loop"),
    (lambda: sw.feedback(sw.TransferFunction(*H), 0.5, sign=1), ArgumentError, "an algebraic loop"),
    (lambda: sw.feedback(sw.TransferFunction(*H), sign=0), ArgumentError, "sign: expected -1 or 1, got 0"),
    (lambda: sw.series(1.0, 2.0), ArgumentError, "gains alone, which have no states"),
    (lambda: sw.parallel("G", 1.0), DTypeError, "first: expected a linear system of stepwell, or an object"),
    (lambda: sw.series(sw.LinearSystem([[1.0]]), 2.0), ArgumentError, "without inputs (B) and outputs (C)"),
    (lambda: sw.series(sw.TransferFunction(*G), sw.LinearSystem([[1.0]], [[1.0, 2.0]], [[1.0]])), ShapeError,
     "series: expected as many inputs of a system as the one before it has outputs, 1, got 2"),
]  # fmt: skip


def test_what_is_refused() -> None:
    assert_refused(WRONG)
