"""The limit of stability, against closed forms, chains and independent searches."""

import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import AccuracyWarning, DTypeError, ShapeError, UnsupportedError
from support import families
from support import other_methods as other
from support.looped import looped
from support.refusals import refused
from support.stability_cases import LIMITS, METHODS, known

DAMPABLE = [m for m in METHODS if not sw.method(m).needs_acceleration]


@known
def test_limits_of_the_undamped_oscillator(method: str) -> None:
    limit = sw.stability_limit(sw.Oscillator(), method)
    assert limit == pytest.approx(LIMITS[method], rel=1e-14)
    assert limit.dt == float(limit)
    assert sw.stability_limit(sw.Oscillator(7.3, form="physical"), method) == pytest.approx(LIMITS[method] / 7.3, rel=1e-13)


@looped("method", METHODS)
def test_the_record_has_the_limit(method: str) -> None:
    assert sw.stability_limit(sw.Oscillator(), method) == pytest.approx(sw.method(method).limit, rel=1e-12)


@looped(
    "method, limit",
    [
        (other.MERSON_4, 2 * math.sqrt(3)),
        (other.FEHLBERG_4, 0.0),
        (other.FEHLBERG_5, 0.0),
        (other.FOREST_RUTH, 1.573401947),
        (other.PEFRL, 2.989449546),
        (other.KUTTA_3, math.sqrt(3)),
    ],
)
def test_limits_of_methods_that_are_not_in_the_catalogue(method: Any, limit: float) -> None:
    """Known elsewhere to as many digits as are written here."""
    digits = 1e-12 if limit in (2 * math.sqrt(3), math.sqrt(3), 0.0) else 10.0 ** -len(str(limit).split(".")[1])
    assert sw.stability_limit(sw.Oscillator(), method) == pytest.approx(limit, abs=digits)


#: Blanes and Moan 2002, table 2, S₆ of order 4.
_A, _B = (0.0792036964311957, 0.353172906049774, -0.0420650803577195), (0.209515106613362, -0.143851773179818)


@looped(
    "kicks, drifts",
    [
        ((*_B, 0.5 - sum(_B), 0.5 - sum(_B), *_B[::-1]), (*_A, 1 - 2 * sum(_A), *_A[::-1])),
        ((0.49, 0.51), (0.245, 0.5, 0.255)),
        ((0.2, 0.199, 0.202, 0.199, 0.2), (0.1, 0.1995, 0.2005, 0.2005, 0.1995, 0.1)),
    ],
)
def test_growth_for_less_than_a_rung_is_found(kicks: Any, drifts: Any) -> None:
    """Compositions grow in a narrow window where ½·trace passes ±1 for a moment: of the third from 3.0898 to 3.0905 only.

    The first of these by the trace of a product of shears, on steps of Φ that are 500 times finer, and bisection.
    """

    def half_trace(phi: Any) -> Any:
        v = y = np.stack([np.ones_like(phi), np.zeros_like(phi)]), np.stack([np.zeros_like(phi), np.ones_like(phi)])
        v, y = v
        for i, drift in enumerate(drifts):
            y = y + drift * phi * v
            v = v - (kicks[i] if i < len(kicks) else 0.0) * phi * y
        return 0.5 * (v[0] + y[1])

    phi = np.arange(1, 200_001) * 4e-5
    high = phi[np.abs(half_trace(phi)) > 1 + 1e-12][0]
    low = high - 4e-5
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if abs(half_trace(middle)) > 1 else (middle, high)
    method = other.method(other.composed(kicks, drifts))
    # The trace has some roundings, and passes 1 with a slope of 0.1 or more where it has not turned yet.
    assert sw.stability_limit(sw.Oscillator(), method) == pytest.approx(high, rel=1e-13)
    batch = sw.stability_limit(sw.Oscillator(np.array([0.5, 1.0])), method)
    assert batch == pytest.approx([2 * high, high], rel=1e-13)


@looped("method", [m for m in METHODS if m != "taylor"], long=["taylor"])
@looped("seed", range(8 if families.LONG else 2))
def test_limits_of_chains_with_soft_and_stiff_springs(seed: int, method: str) -> None:
    """Eight decades of stiffness, four of mass, with walls and without: the fastest mode decides, by the matrix K/√mm."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    stiffness, mass = 10.0 ** (rng.uniform(-4, 4, n + 1) + rng.uniform(-3, 6)), 10.0 ** rng.uniform(-2, 2, n)
    if seed % 2:
        stiffness[0] = stiffness[-1] = 0.0  # it floats: a double eigenvalue 1
    k = np.diag(stiffness[:-1] + stiffness[1:]) - np.diag(stiffness[1:-1], 1) - np.diag(stiffness[1:-1], -1)
    fastest = math.sqrt(np.linalg.eigvalsh(k / np.sqrt(np.outer(mass, mass))).max())
    limit = sw.stability_limit(sw.Chain(n, stiffness=stiffness, mass=mass), method)
    # eigvalsh: some eps of the fastest, and the limit some 1e-14 of its own.
    assert limit == pytest.approx(sw.method(method).limit / fastest, rel=1e-12)


@looped(
    "method, limit",
    [
        ("standard_euler", 2.0),
        ("standard_heun", 2.0),
        ("rk4", 2.785293563405282),
        ("merson", 3.548322344234674),
        ("fehlberg", 3.0200175439705026),
        ("fehlberg_5", 3.6777066213218954),
        ("false_euler", 2 * math.sqrt(2) - 2),
    ],
)
def test_limits_at_critical_damping(method: str, limit: float) -> None:
    """A double rate −1: the limits of the real axis (of RK4, the root of z³ + 4z² + 12z + 24 = 0), by bisection in fractions."""
    assert sw.stability_limit(sw.Oscillator(1.0, 1.0), method) == pytest.approx(limit, rel=1e-12)


@looped("damping", [1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 0.5, 0.99])
def test_standard_euler_is_stable_up_to_twice_the_damping(damping: float) -> None:
    """r₁² = 1 − 2DΦ + Φ² (§6). However light the damping, the limit keeps its digits."""
    limit = sw.stability_limit(sw.Oscillator(1.0, damping), "standard_euler")
    assert limit == pytest.approx(2 * damping, rel=1e-12)
    assert limit.mode.kind == "unstable oscillation"
    assert limit.mode.angle == pytest.approx(math.atan2(2 * damping * math.sqrt(1 - damping**2), 1 - 2 * damping**2), abs=1e-8)


@looped("damping", [0.1, 0.5, 2.0])
def test_false_euler_damped_has_its_limit_where_an_eigenvalue_passes_minus_one(damping: float) -> None:
    """1 + 2p + q = 4 − 4DΦ − Φ² = 0."""
    limit = sw.stability_limit(sw.Oscillator(2.0, damping), "false_euler")
    assert limit == pytest.approx((2 * math.sqrt(1 + damping**2) - 2 * damping) / 2.0, rel=1e-13)
    assert limit.mode.eigenvalue == pytest.approx(-1.0, abs=1e-6)


@looped("method", ["false_euler", "verlet", "rk4"])
def test_limits_of_a_chain_are_those_of_its_fastest_mode(method: str) -> None:
    """And so is its shape; the limits of all methods are above."""
    n = 9
    fastest = 2 * math.sin(n * math.pi / (2 * (n + 1)))
    limit = sw.stability_limit(sw.Chain(n), method)
    assert limit == pytest.approx(sw.method(method).limit / fastest, rel=1e-12)
    mode = limit.mode
    assert mode.rate == pytest.approx(1j * fastest, abs=1e-12)
    shape = np.sin(n * np.pi * np.arange(1, n + 1) / (n + 1))
    np.testing.assert_allclose(mode.y / mode.y[0], shape / shape[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(mode.v / mode.v[0], shape / shape[0], rtol=0, atol=1e-6)


def test_a_chain_that_floats_is_limited_by_what_swings() -> None:
    limit = sw.stability_limit(sw.Chain(3, stiffness=[0.0, 1.0, 1.0, 0.0]), "false_euler")
    assert limit == pytest.approx(2 / math.sqrt(3), rel=1e-12)
    assert limit.mode.y == pytest.approx(limit.mode.y[1] * np.array([-0.5, 1, -0.5]), abs=1e-6)
    lone = sw.stability_limit(sw.Chain(1, stiffness=0.0), "rk4")
    assert (float(lone), lone.mode) == (math.inf, None)  # a free mass: no step is too large


def test_limits_of_a_batch_whatever_its_inputs() -> None:
    omega = np.linspace(0.5, 20.0, 50)
    limits = sw.stability_limit(sw.Oscillator(omega, 0.1), "rk4")
    assert limits.shape == limits.modes.shape == (50,)
    for i in (0, 20, 49):
        one = sw.stability_limit(sw.Oscillator(omega[i], 0.1), "rk4")
        assert (limits[i], limits.modes[i].rate) == (one, one.mode.rate)
    mixed = sw.stability_limit(sw.Oscillator(1.0, np.array([-0.1, 0.0, 0.1])), "standard_heun")
    assert mixed[0] == mixed[1] == 0.0 < mixed[2]
    assert mixed.modes[0].kind == "unstable oscillation of the exact solution too"
    assert mixed.modes[1].kind == "unstable oscillation"
    assert (2 * limits).modes is None
    driven = sw.Oscillator(1.3, 0.2, x=sw.Sinusoid(1.0, 3.0), a=0.5)
    assert sw.stability_limit(driven, "rk4") == sw.stability_limit(sw.Oscillator(1.3, 0.2), "rk4")


@looped("method", DAMPABLE)
@looped("damping", [0.02, 0.4])
def test_limits_from_both_sides(method: str, damping: float) -> None:
    """A thousandth below, samples die away; a thousandth above, they grow at the predicted rate."""
    limit = sw.stability_limit(sw.Oscillator(1.0, damping), method)
    assert limit > 0
    if limit == math.inf:
        assert (sw.analyse(sw.Oscillator(np.geomspace(1e-3, 1e6, 40), damping), method, dt=1.0).radius < 1.0).all()
        return
    phi = float(limit) * np.array([0.999, 1.001])
    a = sw.analyse(sw.Oscillator(phi, damping), method, dt=1.0)
    assert a.radius[0] < 1 < a.radius[1]
    steps = int(20 / abs(math.log(a.radius[1])))
    run = sw.integrate(sw.Oscillator(phi, damping), method, v=0.3, y=1.0, dt=1.0, steps=2 * steps, every=steps)
    size = np.hypot(run.v, run.y)
    assert size[2, 0] < 1 < size[2, 1]
    grown = np.log(size[2, 1] / size[1, 1])
    # e²⁰ of growth; the direction within the ellipse of the growing mode may change the length by its ratio of axes (≤ 50).
    assert grown == pytest.approx(steps * math.log(a.radius[1]), abs=math.log(50))


@looped("method", METHODS)
def test_limits_of_a_pendulum_and_of_a_libration_point(method: str) -> None:
    """Hanging, it is an oscillator; standing, it falls. At L4 two oscillations, of which the frame couples velocities."""
    pendulum = sw.Pendulum(3.0)
    undamped = sw.method(method).limit
    # Of tsit5 r₁² passes 1 with a slope of 4e-6, so that a few roundings of a step move the limit by 1e-10.
    near = 1e-9 if method == "tsit5" else 1e-13
    assert sw.stability_limit(pendulum, method, at=(0.0, 0.0)) == pytest.approx(undamped / 3, rel=near)
    if (
        sw.method(method).evaluations == 1 and sw.method(method).limit < math.inf
    ):  # others look at angles that the swing comes to within the step
        swung = sw.stability_limit(pendulum, method, at=(0.0, np.array([0.0, 1.0])))  # ω² = 9·cos y
        assert swung == pytest.approx(undamped / 3 / np.sqrt(np.cos([0.0, 1.0])), rel=1e-13)
    assert sw.stability_limit(pendulum, method, at=(0.0, math.pi)) == 0.0
    if method in ("rk4", "merson"):
        mu = 0.012277471
        at = np.zeros(2), np.array([0.5 - mu, math.sqrt(0.75)])
        # ω⁴ − ω² + 27μ(1 − μ)/4 = 0; all four rates are imaginary, and both methods are functions of the rates.
        fastest = math.sqrt(0.5 + math.sqrt(0.25 - 6.75 * mu * (1 - mu)))
        limit = sw.stability_limit(sw.RestrictedThreeBody(mu), method, at=at)
        assert limit == pytest.approx(undamped / fastest, rel=1e-12)


def test_a_limit_at_a_state() -> None:
    """A system that is not linear, taken for linear at a state; bodies that attract each other leave it by themselves."""
    refused(UnsupportedError, "is not linear; give", sw.stability_limit, sw.NBody(), "rk4")
    with pytest.raises(DTypeError, match=r"at: expected a pair \(v, y\) of blocks, got Run"):
        sw.stability_limit(sw.Pendulum(), "rk4", at=sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1))
    refused(ShapeError, r"v \(2,\), y \(3,\)", sw.stability_limit, sw.Pendulum(), "rk4", at=(np.zeros(2), np.zeros(3)))
    scene = sw.scenes.clover()
    limit = sw.stability_limit(scene.system, "false_euler", at=(scene.v, scene.y))
    assert limit == 0.0
    assert limit.mode.kind.endswith("of the exact solution too")
    same = sw.stability_limit(sw.Chain(2), "false_euler", at=(np.zeros(2), np.ones(2)))
    assert same == pytest.approx(float(sw.stability_limit(sw.Chain(2), "false_euler")), rel=1e-12)


SATURATING = {
    "sigmoid": lambda x: 1.0 / (1.0 + np.exp(-x)),
    "bell": lambda x: 1.0 / np.cosh(x) ** 2,
    "ramp": lambda x: x / (1.0 - np.exp(-x)) * np.exp(-np.abs(x)),
    "Gompertz": lambda x: np.exp(-np.exp(x)),
}


@looped("name", SATURATING)
@looped("x", [-1000.0, 1000.0])
def test_what_saturates_has_the_derivative_zero(name: str, x: float) -> None:
    """Where the exponential overflows: forwards of one number, and backwards of several."""
    for n in (1, 5):

        @sw.system(order=1)
        def relaxing(t: Any, y: Any) -> Any:
            return np.stack([SATURATING[name](sum(y[k] for k in range(len(y)))) - y[i] for i in range(len(y))])

        y = np.full(n, x / n)
        assert np.array_equal(sw.jacobian(relaxing(), y=y).matrix, -np.eye(n))
        assert sw.stability_limit(relaxing(), "rk4", y=y) == pytest.approx(2.785293563405282, rel=1e-12)


def test_a_limit_where_derivatives_are_not_finite_is_unknown() -> None:
    """Of the members at such a state alone."""

    @sw.system(order=1)
    def dragged(t: Any, y: Any) -> Any:
        return -np.sqrt(y * y) * y - y

    with pytest.warns(AccuracyWarning, match=r"the limit of 1 of 2 members of dragged.* is NaN, because some derivatives"):
        limits = sw.stability_limit(dragged(), "rk4", y=np.array([0.0, 1.0]))
    assert limits.decided.tolist() == [False, True]
    assert np.isnan(limits[0])
    with pytest.warns(AccuracyWarning, match=r"the limit of dragged\(\) by rk4 is NaN"):
        assert np.isnan(sw.stability_limit(dragged(), "rk4", y=0.0))
    with pytest.warns(AccuracyWarning, match=r"by rk4 is NaN"):  # the logarithm does not saturate, though its argument overflows
        assert np.isnan(sw.stability_limit(sw.system(order=1)(lambda t, y: -y - np.log(1.0 + np.exp(y))), "rk4", y=1000.0))


@pytest.mark.filterwarnings("error")
def test_a_limit_at_which_a_stage_is_not_finite_has_no_warning_of_numpy() -> None:
    """Beyond it a stage of Hill's rate is a power of what is below zero."""
    hill = sw.system(order=1)(lambda t, y, *, n=2.5: y**n / (1.0 + y**n) + 0.1 - y)
    assert sw.stability_limit(hill(), "rk4", y=0.0) == pytest.approx(2.0685708361032193, rel=1e-9)
