"""Linear systems from sample to sample: the exact step, every way and method, transfer functions in z, frequency responses."""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.reference import exact
from stepwell.reference.resolvent import polynomials
from support.looped import assert_refused, looped

signal = pytest.importorskip("scipy.signal")
mp = pytest.importorskip("mpmath")

EPS = 2.0**-52
G: Any = ([3.0, 1.0], [1.0, 0.4, 4.0])
H: Any = ([2.0, 5.0, 1.0], [1.0, 3.0, 0.5])  # equal degrees
THIRD: Any = ([1.0], [1.0, 2.0, 3.0, 4.0])


def many_digits(A: Any) -> Any:
    """exp(A), each element rounded once."""
    with mp.workdps(120):
        return np.array([[float(each) for each in row] for row in mp.expm(mp.matrix(A.tolist()), method="taylor").tolist()])


def units(one: Any, truth: Any) -> float:
    """The largest error in units in the last place of each element."""
    return float((np.abs(one - truth) / np.spacing(np.abs(truth))).max())


@looped("n, size", [(1, 0.3), (2, 1.0), (3, 10.0), (4, 300.0), (5, 1e-3), (6, 50.0), (9, 3.0)])
def test_the_exponential_is_rounded_once(n: int, size: float) -> None:
    """Within one unit of each element: the squarings have twice the digits, so a norm of 300 costs none."""
    A = np.random.default_rng(n).normal(size=(n, n)) * size - size * np.eye(n)
    assert units(exact.exponential(A), many_digits(A)) <= 1.0


@looped("omega", [1.0, 1e3, 1e6, 1e-6])
def test_badly_scaled_matrices(omega: float) -> None:
    """The controllable form of an oscillator has elements of 1 and ω²: scaled in powers of two it is as exact as any."""
    A = np.array([[-0.2 * omega, -(omega**2)], [1.0, 0.0]]) * (0.3 / omega)
    assert units(exact.exponential(A), many_digits(A)) <= 1.0


def test_nilpotent_and_defective_matrices_and_batches() -> None:
    """No eigenvalues are computed, so equal ones do no harm: exp of a Jordan block is e^λ times 1/k!."""
    n = 6
    block = np.eye(n, k=1) - 0.5 * np.eye(n)
    assert units(exact.exponential(block)[0], many_digits(block)[0]) <= 1.0
    assert np.array_equal(exact.exponential(np.zeros((3, 3))), np.eye(3))
    # Each has its own number of squarings.
    rng = np.random.default_rng(1)
    A = (rng.normal(size=(3, 3, 7)) - 3.0 * np.eye(3)[..., np.newaxis]) * np.geomspace(1e-3, 1e2, 7)
    together = exact.exponential(A)
    for k in range(7):
        assert np.array_equal(together[..., k], exact.exponential(A[..., k]))


def test_the_step_with_a_sinusoid() -> None:
    """ṡ = −s + sin(ωt + φ), whose solution is known: the particular one (sin − ω·cos)/(1 + ω²), and e^(−t) of the rest."""
    omega, h = np.array([[0.0, 1.0, 30.0]]), 0.7
    P, Q, R = exact.sinusoidal(np.array([[-1.0]]), np.array([[1.0]]), h, omega)
    w = omega[0]

    def particular(angle: Any) -> Any:
        return (np.sin(angle) - w * np.cos(angle)) / (1.0 + w * w)

    for phase in (0.0, 0.4, 2.0):
        s = P[0, 0] * 0.5 + Q[0, 0] * np.sin(phase) + R[0, 0] * np.cos(phase)
        truth = particular(w * h + phase) + np.exp(-h) * (0.5 - particular(phase))
        assert s == pytest.approx(truth, abs=8 * EPS)


@looped("system", [G, H, THIRD])
@looped(
    "how, options, theirs",
    [
        ("zoh", {}, "zoh"),
        ("linear", {}, "foh"),
        ("foh", {}, "foh"),
        ("tustin", {}, "bilinear"),
        ("impulse", {}, "impulse"),
        ("standard_euler", {}, "euler"),
        ("backward_euler", {"interpolation": "linear"}, "backward_diff"),
    ],
)
def test_transfer_functions_are_those_of_scipy(system: Any, how: str, options: Any, theirs: str) -> None:
    """The coefficients are sums of a few numbers of size 1 to 50 in both programs; SciPy's has the larger rounding."""
    if (how, system) == ("impulse", H):
        with pytest.raises(UnsupportedError, match="the samples of the output for an impulse are not numbers"):
            sw.discretise(sw.TransferFunction(*system), 0.3, how)
        return
    discrete = sw.discretise(sw.TransferFunction(*system), 0.3, how, **options)
    num, den, _ = signal.cont2discrete(system, 0.3, theirs)
    assert discrete.den == pytest.approx(den, abs=200 * EPS)
    assert discrete.num == pytest.approx(num.ravel(), abs=200 * EPS)


@looped("how", ["zoh", "linear", "impulse", "tustin"])
def test_runs_are_those_of_scipy(how: str) -> None:
    """From rest before the first sample; SciPy's states are s − Q_next·x, as those of the standard form."""
    x = np.random.default_rng(2).normal(size=50)
    discrete = sw.discretise(sw.TransferFunction(*G), 0.3, how)
    run = discrete.run(x, None if how == "impulse" else discrete.Q_next[:, 0] * x[0])
    _, z, _ = signal.dlsim((*discrete.standard(), 0.3), x)
    assert run.z == pytest.approx(z, abs=1e-13)
    assert run.t[-1] == pytest.approx(49 * 0.3)


def test_an_exact_step_is_exact() -> None:
    """P, Q and Q_next of an input on straight lines against many digits: (e^(Ah) − I − Ah)·A⁻²·B/h is Q_next."""
    A, B = np.array([[-0.4, -400.0], [1.0, 0.0]]), np.array([[1.0], [0.0]])
    discrete = sw.discretise(sw.LinearSystem(A, B), 0.01, "linear")
    with mp.workdps(60):
        a, b, h = mp.matrix(A.tolist()), mp.matrix(B.tolist()), mp.mpf(0.01)
        e, one = mp.expm(a * h, method="taylor"), mp.eye(2)
        inverse = a**-1
        after = inverse * inverse * (e - one - a * h) * b / h
        before = inverse * (e - one) * b - after
        truth = [np.array(each.tolist(), dtype=float) for each in (e, before, after)]
    for matrix, expected in zip((discrete.P, discrete.Q, discrete.Q_next), truth, strict=True):
        assert units(matrix, expected) <= 4.0  # Q is a difference of two


@looped("interpolation", ["hold", "linear"])
@looped("method", [each.name for each in sw.methods()])
def test_a_method_makes_the_steps_of_integrate(method: str, interpolation: Any) -> None:
    """With sampled inputs, two of them, from any state: for what is carried in place of v, too."""
    rng = np.random.default_rng(3)
    A = np.array([[0, 0, -2.0, 0.5], [0, 0, 0.3, -1.0], [1, 0, 0, 0], [0, 1, 0, 0.0]])
    system = sw.LinearSystem(A, [[1.0, 0.2], [0, 1.0], [0, 0], [0, 0]], velocities=2)
    x, start, dt = rng.normal(size=(30, 2)), rng.normal(size=4), 0.1
    driven = system.with_inputs([sw.Sampled(x[:, j], dt, interpolation=interpolation) for j in range(2)])
    run = sw.integrate(driven, method, v=start[:2], y=start[2:], dt=dt, steps=28, every=1)
    sampled = sw.discretise(system, dt, method, interpolation=interpolation).run(x, start)
    # 28 steps of some 30 roundings each; Verlet's velocities are differences of positions, divided by dt.
    assert sampled.state[:29] == pytest.approx(np.concatenate([run.v, run.y], axis=1), abs=1e-12)


def test_states_are_in_the_order_of_a_and_false_euler_has_its_transfer_function() -> None:
    system = sw.LinearSystem([[0, 1.0], [-4.0, -0.3]], [[0.0], [1.0]], [[1.0, 0.0]], velocities=[1])
    for how in ("zoh", "false_euler", "rk4"):
        steps = sw.discretise(system, 1e-3, how)
        assert pytest.approx(np.eye(2) + 1e-3 * system.A, abs=1e-5) == steps.P
        assert steps.Q[:, 0] == pytest.approx([0.0, 1e-3], abs=1e-5)
    # z² − 2pz + q with p = 1 − Φ²/2 and q = 1 (§7), and Φ²·z over it for a held input.
    discrete = sw.discretise(sw.Oscillator(2.0), 0.1, "false_euler")
    assert discrete.den == pytest.approx([1.0, -2.0 + 0.04, 1.0], abs=4 * EPS)
    x_of = sw.discretise(sw.LinearSystem.of(sw.Oscillator(2.0)), 0.1, "false_euler").num[:, 0, 0]
    assert x_of == pytest.approx([0.0, 0.04, 0.0], abs=4 * EPS)


def test_tustin_is_right_at_one_frequency_and_polynomials_have_digits_for_many_states() -> None:
    system, omega = sw.TransferFunction(*G), 1.7
    truth = sw.frequency_response(system, omega)
    warped = sw.discretise(system, 0.5, "tustin", prewarp=omega).frequency_response(omega)
    assert warped == pytest.approx(truth, rel=1e-13)
    assert abs(sw.discretise(system, 0.5, "tustin").frequency_response(omega) / truth - 1.0) > 0.1
    # Of 14 states, whose recursion loses six digits: to the rounding of the coefficients themselves.
    rng = np.random.default_rng(4)
    n = 14
    A, B, C, D = (rng.normal(size=shape) for shape in ((n, n), (n, 1), (1, n), (1, 1)))
    num, den = polynomials(A, B, C, D)
    with mp.workdps(80):
        a, b, c = (mp.matrix(each.tolist()) for each in (A, B, C))
        for z in (0.3, -1.4, 2.0):
            less = mp.eye(n) * z - a
            det = mp.det(less)
            value = (c * mp.lu_solve(less, b))[0] * det + D[0, 0] * det
            for polynomial, truth in ((den, det), (num[:, 0, 0], value)):
                at = sum(mp.mpf(float(x)) * mp.mpf(z) ** (n - i) for i, x in enumerate(polynomial))
                size = sum(abs(float(x)) * abs(z) ** (n - i) for i, x in enumerate(polynomial))
                assert abs(at - truth) < 4 * EPS * size


def test_batches_and_systems_without_inputs() -> None:
    omega = np.array([1.0, 2.0, 5.0])
    batch = sw.discretise(sw.Oscillator(omega, 0.1), 0.1)
    assert batch.batch == (3,)
    assert batch.num.shape == (3, 1, 2, 3)
    assert batch.run(np.zeros((4, 2)), [1.0, 0.0]).state.shape == (4, 2, 3)
    for k, each in enumerate(omega):
        alone = sw.discretise(sw.Oscillator(each, 0.1), 0.1)
        for name in ("P", "Q", "den", "num", "radius"):
            assert np.array_equal(np.asarray(getattr(batch, name))[..., k], getattr(alone, name)), name
    free = sw.discretise(sw.LinearSystem([[-1.0]]), 0.1)
    assert (free.Q.shape, free.num.shape) == ((1, 0), (2, 1, 0))
    assert free.P[0, 0] == np.exp(-0.1)
    assert free.eigenvalues == pytest.approx([np.exp(-0.1)])


@looped("delay", [0.0, 0.11, 0.3, 0.41, 0.9, 0.6 + 1e-13])
@looped("interpolation", ["hold", "linear"])
def test_a_dead_time_of_any_length_is_exact(interpolation: Any, delay: float) -> None:
    """Beside a step of a thirtieth of dt, of which the delay is a whole number, and whose input is the same."""
    dt, fine = 0.3, 30
    system = sw.LinearSystem([[-0.4, -4.0], [1.0, 0.0]], [[1.0, 0.3], [0.0, 0.5]], [[0.0, 1.0]], [[0.2, 0.0]])
    x = np.random.default_rng(5).normal(size=(6, 2))
    x[0] = 0.0  # as before it
    coarse = sw.discretise(system, dt, "exact", interpolation=interpolation, delay=delay).run(x, [0.3, 0.7])
    times = np.arange(5 * fine + 1) / fine
    between = np.stack([np.interp(times, np.arange(6), x[:, j]) for j in range(2)], axis=1)
    between = x[(times + 1e-9).astype(int)] if interpolation == "hold" else between
    whole = round(delay / dt * fine) * dt / fine
    run = sw.discretise(system, dt / fine, "exact", interpolation=interpolation, delay=whole).run(between, [0.3, 0.7])
    assert coarse.state[:, :2] == pytest.approx(run.state[::fine, :2], abs=1e-12)  # 150 steps of some roundings
    assert coarse.z == pytest.approx(run.z[::fine], abs=1e-12)


@looped("interpolation", ["hold", "linear"])
@looped("method", ["standard_euler", "false_euler", "leapfrog", "verlet", "rk4", "rodas4", "trapezoidal", "dop853"])
def test_a_method_sees_what_it_sees_in_a_run(method: str, interpolation: Any) -> None:
    """Late samples of a run: the mean over a step where a held one begins within it."""
    dt, delay = 0.2, 0.27
    rng = np.random.default_rng(6)
    x = np.concatenate([[0.0, 0.0], rng.normal(size=10)])
    system = sw.LinearSystem([[0.0, -4.0], [1.0, 0.0]], [[1.0], [0.0]])
    late = system.with_inputs(sw.Sampled(x, dt, delay, interpolation))
    run = sw.integrate(late, method, v=0.0, y=0.0, dt=dt, steps=10, every=1)
    samples = sw.discretise(system, dt, method, interpolation=interpolation, delay=delay).run(x)
    assert samples.state[:11, :2] == pytest.approx(np.concatenate([run.v, run.y], axis=1), abs=1e-12)


def test_whole_samples_are_powers_of_z_and_a_late_impulse_begins_late() -> None:
    omega = np.linspace(0.1, 9.0, 12)
    for how in ("zoh", "linear", "tustin", "rk4", "impulse"):
        plain, late = (sw.discretise(sw.TransferFunction(*G), 0.3, how, delay=delay) for delay in (0.0, 0.9))
        shift = np.exp(-0.9j * omega)
        assert late.frequency_response(omega) == pytest.approx(plain.frequency_response(omega) * shift, rel=1e-11)
        assert (late.delay, len(late.P) >= 4) == (0.9, True)
    padded = np.concatenate([[0.0, 0.0], sw.discretise(sw.TransferFunction(*G), 0.3).num])
    assert sw.discretise(sw.TransferFunction(*G), 0.3, delay=0.6).num == pytest.approx(padded, abs=1e-14)
    # Of 1/(s + 2): dt·e^(−2(t − τ)) from τ on.
    run = sw.discretise(sw.TransferFunction(1.0, [1.0, 2.0]), 0.25, "impulse", delay=0.35).run([1.0, 0.0, 0.0, 0.0, 0.0])
    t = 0.25 * np.arange(5)
    assert run.z[:, 0] == pytest.approx(np.where(t >= 0.35, 0.25 * np.exp(-2.0 * (t - 0.35)), 0.0), abs=1e-15)


def test_responses_are_those_of_the_polynomials() -> None:
    omega = np.linspace(0.1, 10.0, 20)
    for how in ("zoh", "linear", "tustin", "rk4", "backward_euler"):
        discrete = sw.discretise(sw.TransferFunction(*H), 0.3, how)
        z = np.exp(0.3j * omega)
        ratio = np.polyval(discrete.num, z) / np.polyval(discrete.den, z)
        assert discrete.frequency_response(omega) == pytest.approx(ratio, rel=1e-12)
        assert sw.frequency_response(discrete, omega) == pytest.approx(ratio, rel=1e-12)
    omega = np.geomspace(1e-2, 1e2, 30)
    _, theirs = signal.freqresp(signal.TransferFunction(*G), omega)
    assert sw.frequency_response(sw.TransferFunction(*G), omega) == pytest.approx(theirs, rel=1e-12)
    assert sw.frequency_response(signal.TransferFunction(*G), omega) == pytest.approx(theirs, rel=1e-12)
    assert sw.frequency_response(sw.Oscillator([1.0, 2.0]), omega).shape == (30, 1, 2, 2)
    undamped = sw.LinearSystem([[0.0, -1.0], [1.0, 0.0]], [1.0, 0.0], [0.0, 1.0])
    assert np.isinf(abs(sw.frequency_response(undamped, [0.5, 1.0, 2.0])[1]))
    assert np.isfinite(abs(sw.frequency_response(undamped, [0.5, 1.0, 2.0])[[0, 2]])).all()


def test_margins_that_are_known_and_say_when_the_closed_loop_oscillates() -> None:
    """K/(1 + s)³ oscillates at √3 for K = 8. |L| = 1 where 1 + ω² = K^(2/3), with a phase of −3·atan(ω)."""
    cube = sw.TransferFunction(4.0, [1.0, 3.0, 3.0, 1.0])
    found, omega = sw.margins(cube), np.sqrt(4.0 ** (2 / 3) - 1.0)
    assert (found.gain, found.gain_frequency) == pytest.approx((2.0, np.sqrt(3.0)), rel=1e-12)
    assert (found.phase, found.phase_frequency) == pytest.approx((180.0 - np.degrees(3 * np.arctan(omega)), omega), rel=1e-12)
    assert found.delay == pytest.approx(np.radians(found.phase) / omega, rel=1e-12)
    integrator = sw.margins(sw.TransferFunction(2.0, [1.0, 0.0]))
    assert (integrator.gain, integrator.phase, integrator.phase_frequency) == pytest.approx((np.inf, 90.0, 2.0))
    small = sw.margins(sw.TransferFunction(0.5, [1.0, 1.0]))
    assert (small.gain, small.phase, small.delay) == (np.inf, np.inf, np.inf)
    # Both from either side: the radius of the sampled closed loop passes 1 at the margin of its gain.
    plant = sw.TransferFunction(4.0, [1.0, 3.0, 3.0, 1.0])
    open_loop = sw.discretise(plant, 0.2)
    gain = sw.margins(open_loop).gain
    assert gain < sw.margins(plant).gain  # the hold delays by half a sample
    for factor, stable in ((0.999, True), (1.001, False)):
        closed = open_loop.P - factor * gain * open_loop.Q @ open_loop.C
        assert bool(np.abs(np.linalg.eigvals(closed)).max() < 1.0) is stable
    # A gain of an integrator, held: 1 − K·h leaves the circle at −1, that is at π/dt.
    sampled = sw.margins(sw.discretise(sw.TransferFunction(1.0, [1.0, 0.0]), 0.1))
    assert (sampled.gain, sampled.gain_frequency) == pytest.approx((20.0, np.pi / 0.1), rel=1e-9)
    # From both sides, of the continuous loop: with short samples the hold adds half of one to the dead time.
    plant, dt = sw.TransferFunction(4.0, [1.0, 3.0, 3.0, 1.0]), 0.01
    margin = sw.margins(plant).delay
    for factor, stable in ((0.98, True), (1.02, False)):
        late = sw.discretise(plant, dt, delay=factor * margin - 0.5 * dt)
        closed = late.P - late.Q @ late.C
        assert bool(np.abs(np.linalg.eigvals(closed)).max() < 1.0) is stable


SYSTEM = sw.TransferFunction(*G)


def test_systems_of_samples_join_as_their_responses_do() -> None:
    """Also where a step sees the next sample, over a batch, and with more than one input."""
    plant, lag = sw.TransferFunction(4.0, [1.0, 0.4, 0.0]), sw.TransferFunction(1.0, [0.5, 1.0])
    omega, gains = np.array([0.1, 1.0, 10.0]), np.array([0.5, 2.0])
    for how in ("zoh", "linear", "tustin"):
        a, b = (sw.discretise(each, 0.1, how, delay=0.03 if how == "zoh" else 0.0) for each in (plant, lag))
        A, B = (each.frequency_response(omega) for each in (a, b))
        joined = ((4.0 * a, 4.0 * A), (a * 4.0, 4.0 * A), (a * b, A * B), (a + b, A + B), (a - b, A - B), (-a, -A))
        for system, wanted in (*joined, (1.0 - a, 1.0 - A), (a + 2.0, A + 2.0), (a - 2.0, A - 2.0)):
            np.testing.assert_allclose(system.frequency_response(omega), wanted, rtol=1e-10)
        for system in (gains * a, a * gains):
            np.testing.assert_allclose(system.frequency_response(omega), gains * A[:, np.newaxis], rtol=1e-12)
        x = np.sin(np.arange(9.0))
        np.testing.assert_array_equal((4.0 * a).run(x).z, 4.0 * a.run(x).z)
        np.testing.assert_allclose((4.0 * a).num, 4.0 * a.num, rtol=1e-12)
    held = sw.discretise(plant, 0.1)
    np.testing.assert_allclose((held * held).run(x).z, held.run(held.run(x).z[:, 0]).z, atol=1e-14)
    two = sw.discretise(sw.LinearSystem([[-1.0]], [[1.0, 2.0]], [[1.0], [3.0]]), 0.1)
    np.testing.assert_allclose((2.0 * two).frequency_response(1.0), (two * 2.0).frequency_response(1.0), rtol=1e-14)
    assert sw.margins(0.8 * held) == sw.margins(sw.discretise(0.8 * plant, 0.1))


@looped("delay", [0.001, 0.1, 1.0, 3.0, 30.0])
def test_margins_with_a_dead_time(delay: float) -> None:
    """Of 1/s: −90° − ω·τ is −180° at ω = π/(2τ), where the gain is 2τ/π; at ω = 1 the phase is −90° − τ."""
    margins = sw.margins(sw.TransferFunction(1.0, [1.0, 0.0]), delay=delay)
    assert margins.gain == pytest.approx(np.pi / (2.0 * delay), rel=1e-9) or delay > np.pi / 2.0
    assert margins.phase == pytest.approx(90.0 - np.degrees(delay), rel=1e-9)
    plant = sw.TransferFunction(4.0, [1.0, 0.4, 0.0])
    assert bool(sw.margins(plant, delay=delay).phase > 0.0) is bool(delay < sw.margins(plant).delay)


WRONG: list[tuple[Any, type[Exception], str]] = [
    (lambda: sw.discretise(SYSTEM, 0.1, "tusting"), UnknownNameError, "how: there is no 'tusting'; did you mean 'tustin'"),
    (lambda: sw.discretise(SYSTEM, 0.0), ArgumentError, "dt: expected numbers above zero"),
    (lambda: sw.discretise(SYSTEM, [0.1, 0.2]), ShapeError, "dt: expected one number"),
    (lambda: sw.discretise(sw.Pendulum(), 0.1), UnsupportedError, "system: expected a linear one"),
    (lambda: sw.discretise(SYSTEM, 0.1, "verlet"), UnsupportedError, "verlet needs"),
    (lambda: sw.discretise(SYSTEM, 0.1, "zoh", interpolation="linear"), ArgumentError, "'zoh' says how the input runs"),
    (lambda: sw.discretise(SYSTEM, 0.1, "rk4", interpolation="cubic"), UnknownNameError, "interpolation: there is no 'cubic'"),
    (lambda: sw.discretise(SYSTEM, 0.1, prewarp=1.0), ArgumentError, "prewarp: expected None for 'zoh'"),
    (lambda: sw.discretise(SYSTEM, 0.1, "tustin", prewarp=40.0), ArgumentError,
     "prewarp: expected a frequency below that of half"),
    (lambda: sw.discretise(SYSTEM, 0.1, delay=-0.1), ArgumentError, "delay: expected a dead time of zero or more, got -0.1"),
    (lambda: sw.discretise(SYSTEM, 0.1, delay=[0.1, 0.2]), ShapeError, "delay: expected one number"),
    (lambda: sw.discretise(SYSTEM, 0.1, delay=1e9), ArgumentError, "delay, dt: expected a dead time of at most 10000 samples"),
    (lambda: sw.discretise(SYSTEM, 0.1, "tustin", prewarp=1.0, delay=0.13), UnsupportedError, "delay: with prewarp="),
    (lambda: sw.discretise(SYSTEM, 0.1).run(1.0), ShapeError, "x: expected shape (samples, batch…)"),
    (lambda: sw.discretise(sw.Oscillator(), 0.1).run([1.0]), ShapeError, "x: expected shape (samples, 2, batch…)"),
    (lambda: sw.discretise(SYSTEM, 0.1).run([1.0], [1.0]), ShapeError, "start: expected shape"),
    (lambda: sw.frequency_response(SYSTEM, "omega"), ArgumentError, "omega: expected real numbers"),
    (lambda: sw.frequency_response(sw.LinearSystem([[1.0]]), 1.0), ArgumentError, "without inputs (B)"),
    (lambda: sw.margins(SYSTEM, delay=-1.0), ArgumentError, "delay: expected a time of zero or more, got -1"),
    (lambda: sw.margins(sw.discretise(SYSTEM, 0.1), delay=0.1), ArgumentError,
     "delay: a DiscreteSystem has its dead time within"),
    (lambda: sw.discretise(SYSTEM, 0.1) * sw.discretise(SYSTEM, 0.2), ArgumentError,
     "dt: expected two systems with the same, got"),
    (lambda: SYSTEM * sw.discretise(SYSTEM, 0.1), DTypeError, "expected another one of samples, got one of continuous time"),
    (lambda: sw.discretise(SYSTEM, 0.1) - SYSTEM, DTypeError, "expected another one of samples"),
    (lambda: sw.LinearSystem(sw.TransferFunction(1.0, [1.0, 1.0])), DTypeError,
     "A: expected a matrix, got a system, TransferFunc"),
    (lambda: sw.LinearSystem(signal.lti([1.0], [1.0, 1.0])), DTypeError,
     "LinearSystem.of(TransferFunctionContinuous(…)) takes it"),
    (lambda: sw.margins(sw.Oscillator()), ShapeError, "loop: expected one input, one output and one member, got 2 inputs"),
    (lambda: sw.margins(np.ones(2) * SYSTEM), ShapeError, "got a batch (2,)"),
]  # fmt: skip


def test_what_is_refused() -> None:
    assert_refused(WRONG)


def test_reprs() -> None:
    assert repr(sw.discretise(SYSTEM, 0.1)) == "<2 states, 1 input, 1 output, sampled by zoh with dt = 0.1>"
    assert "zoh" in sw.discretise(SYSTEM, 0.1)._repr_html_()
    assert sw.discretise(SYSTEM, 0.1) == sw.discretise(SYSTEM, 0.1)
    assert sw.discretise(SYSTEM, 0.1) != sw.discretise(SYSTEM, 0.2)
