"""The norm of a quaternion at a constant ω: its growth, where a control lets it settle, the angle of a step, and gains too large.

At a constant ω the quaternion moves in a plane, in which q̇ = ½|ω|·i·q + k(1 − |q|²)·q with a complex q; Φ = ½h|ω| is the angle
of a step. Without control a step is a multiplication by R(iΦ), R the stability polynomial of the method.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from contextlib import nullcontext
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability.expansion import polynomials
from support import tops
from support.for_each import for_each
from support.truths import CLOSED_FORMS

#: A series has no stages: what is said of them is not of it, and a test of its own has its growth.
METHODS = [m.name for m in sw.methods() if not (m.needs_acceleration or m.has_derivatives)]

#: Of the methods with two blocks, that which they are for one block alone: v stands still here.
ONE_BLOCK = {
    "damped_euler": "standard_euler",
    "false_euler": "standard_euler",
    "false_heun": "standard_heun",
    "semi_false_heun": "standard_heun",
}

#: The growth of |q|² in a step, as a function of Φ, of the methods that have a closed form here: the determinant of R(iΦ).
GROWTH: dict[str, Callable[[float], float]] = {
    "standard_euler": lambda f: 1 + f**2,
    "standard_heun": lambda f: 1 + f**4 / 4,
    "rk4": lambda f: 1 - f**6 / 72 + f**8 / 576,
} | {
    name: lambda f, matrix=CLOSED_FORMS[name]: float(np.linalg.det(matrix(f).astype(float)))
    for name in ("merson", "fehlberg", "fehlberg_5", "dop853")
}

BODY, OMEGA = sw.RigidBody([1.0, 1.4, 2.0]), 3.0
AIRCRAFT = sw.Aircraft("quaternion", damping=np.zeros(3), gains=np.zeros(3), controllers=False)
SPIN = np.array([0.0, 0.0, OMEGA])

#: Of these the growth is known in closed form; that of others follows from the step of the reference.
KNOWN = [name for name in METHODS if ONE_BLOCK.get(name, name) in GROWTH]


def determinant(method: str) -> Any:
    """|R(iΦ)|² as an exact polynomial: the determinant of a step of ẏ = Φ·(−y₂, y₁), a block of coordinates alone."""
    (a, b), (c, d) = polynomials(sw.LinearSystem([[0.0, -1.0], [1.0, 0.0]], velocities=0), sw.method(method))
    return a * d - b * c


def growth(method: str, phi: float) -> float:
    """How |q|² grows in a step."""
    if method in KNOWN:
        return GROWTH[ONE_BLOCK.get(method, method)](phi)
    return float(determinant(method)(Fraction(phi)))


def norms(method: str, h: float, steps: int, control: Any = None, body: sw.System = BODY) -> Any:
    """q·q of every state, and the angle between the last two, of a spin about the third axis."""
    run = sw.integrate(body, method, v=SPIN, y=tops.some_attitude(1), dt=h, steps=steps, every=1, control=control)
    square = (run.y**2).sum(axis=1)
    a, b = (quaternion / math.sqrt((quaternion**2).sum()) for quaternion in run.y[-2:])
    # By the sine and the cosine, which is exact for small angles too.
    return square, 2.0 * math.asin(min(1.0, 0.5 * math.sqrt(((a - b) ** 2).sum())))


@for_each("method", METHODS)
@for_each("phi", [0.01, 0.3, 1.1])
def test_the_norm_grows_by_the_closed_form(method: str, phi: float) -> None:
    """To the roundings of some twenty operations a stage, on numbers below 4."""
    for body in (BODY, AIRCRAFT):
        square, _ = norms(method, 2 * phi / OMEGA, 1, body=body)
        assert square[1] / square[0] == pytest.approx(growth(method, phi), rel=0, abs=6e-15), body


def test_the_methods_of_the_package_have_closed_forms() -> None:
    """Fewer would test less; a method that is added need not."""
    assert {*GROWTH, *ONE_BLOCK} <= set(KNOWN)


@for_each("method", KNOWN)
def test_the_closed_forms_are_those_of_the_reference(method: str) -> None:
    exact = determinant(method)
    for phi in (0.1, 0.7, 1.3):
        assert float(exact(Fraction(phi))) == pytest.approx(growth(method, phi), rel=0, abs=1e-14)
    leading = (exact - 1).coefficients
    power = next(k for k, each in enumerate(leading) if abs(each) > Fraction(1, 10**12))
    order = sw.method(ONE_BLOCK.get(method, method)).order
    assert power == {1: 2, 2: 4, 4: 6, 5: 6, 8: 10}[order] or method == "merson"


class Plane:
    """q in its plane, as a system for the reference's steps; the v of theirs is not used."""

    def __init__(self, h: float, k: float) -> None:
        self.h, self.k = h, k

    def dv(self, t: float, v: Any, y: Any) -> Any:
        return 0.0 * v

    def dy(self, t: float, v: Any, y: Any) -> Any:
        return self.h * (0.5j * OMEGA + self.k * (1.0 - abs(y) ** 2)) * y


@for_each("method", METHODS)
@for_each(("h", "k"), [(0.02, 5.0), (0.2, 2.0), (0.2, 0.5)])
def test_the_norm_settles_where_it_should(method: str, h: float, k: float) -> None:
    """Where the same step in complex numbers has its fixed point; the angle of a step is that of its last."""
    s, y, before = Plane(h, k), 1.0 + 0.0j, 1.0 + 0.0j
    steps = round(40 / (2 * h * k)) + 10  # the distance shrinks by about 1 − 2hk in a step: to e⁻⁴⁰
    for _ in range(steps):
        before = y
        _, y = sw.method(method).steps.step(s, 0.0, h, 0.0, y)  # type: ignore[arg-type]
    square, angle = norms(method, h, steps, sw.NormControl(k))
    assert square[-1] == pytest.approx(abs(y) ** 2, rel=0, abs=1e-14)
    assert angle == pytest.approx(cmath.phase(y / before), rel=0, abs=1e-14)


def test_standard_euler_settles_by_the_formula() -> None:
    """(1 − hk(r − 1))² = 1 − Φ²: to first order r − 1 = h|ω|²/(8k), 0.005625 for k = 2, h = 0.01, |ω| = 3."""
    for h, k, body in ((0.01, 2.0, BODY), (0.2, 2.0, AIRCRAFT), (0.4, 1.0, BODY), (0.01, 60.0, AIRCRAFT)):
        phi = 0.5 * h * OMEGA
        square, angle = norms("standard_euler", h, 4000, sw.NormControl(k), body)
        settled = (1 - math.sqrt(1 - phi**2)) / (h * k)
        assert square[-1] - 1 == pytest.approx(settled, rel=0, abs=1e-14)
        assert angle == pytest.approx(math.asin(phi), rel=0, abs=1e-14)
    assert norms("standard_euler", 0.01, 4000, sw.NormControl(2.0))[0][-1] - 1 == pytest.approx(0.005625, rel=1e-4)


@for_each(
    ("method", "reset", "controlled", "gains"),
    [
        ("standard_euler", -1 / 3, 1 / 6, (0.02, 0.3, 0.9)),
        ("false_euler", -1 / 3, 1 / 6, (0.02, 0.3, 0.9)),
        ("standard_heun", 1 / 6, 1 / 6, (0.02, 0.3)),  # near 1 the next order is large
    ],
)
def test_the_error_of_the_angle(method: str, reset: float, controlled: float, gains: Any) -> None:
    """In Φ², as a fraction of Φ, but for the next order, Φ²: for any gain, and half as large as without for the Euler methods."""
    phi = 0.03
    h = 2 * phi / OMEGA
    for control, wanted in ((sw.Projection("norm"), reset), *((sw.NormControl(k / h), controlled) for k in gains)):
        _, angle = norms(method, h, 2000, control)
        assert (angle / phi - 1) / phi**2 == pytest.approx(wanted, abs=phi**2)


def test_the_stages_of_heun_see_a_longer_quaternion_and_shorten_it() -> None:
    """The first stage lengthens q·q by Φ², which the control of the second takes back: it settles at 1 − Φ²/(2(1 − hk))."""
    phi = 0.01
    for gain in (0.1, 0.5, 0.8):
        square, _ = norms("standard_heun", 2 * phi / OMEGA, 2000, sw.NormControl(gain * OMEGA / (2 * phi)))
        # The growth of Φ⁴/4 a step adds Φ⁴/(8hk); the next order is below Φ⁴/(1 − hk)³.
        assert square[-1] - 1 == pytest.approx(-(phi**2) / (2 * (1 - gain)), abs=phi**4 / (8 * gain) + phi**4 / (1 - gain) ** 3)


def test_rk4_errs_by_its_own_order_with_a_small_gain() -> None:
    """−Φ⁴/120 of the angle with either; a larger gain changes that: eight times as much at hk = 0.9."""
    phi = 0.1
    h = 2 * phi / OMEGA
    errors = [norms("rk4", h, 2000, each)[1] / phi - 1 for each in (sw.Projection("norm"), sw.NormControl(0.02 / h))]
    np.testing.assert_allclose(np.array(errors) / phi**4, -1 / 120, rtol=phi**2)
    assert norms("rk4", h, 2000, sw.NormControl(0.9 / h))[1] / phi - 1 > 8 * phi**4 / 120


@for_each("method", METHODS)
def test_resetting_changes_no_attitude(method: str) -> None:
    """Rates that are linear in q, and torques that do not see its length: a step of a longer q is a longer step's q."""
    # Both runs round, some 1e-16 in each of 300 steps.
    body = sw.RigidBody([1.0, 1.4, 2.0], weight=1.3, centre=[0.1, 0.2, 0.5], space_torque=[0.1, None, 0.2])
    start: dict[str, Any] = {"v": [0.4, 1.0, -0.6], "y": tops.some_attitude(3), "dt": 0.02, "steps": 300}
    free, reset = (sw.integrate(body, method, **start, control=control) for control in (None, sw.Projection("norm")))
    assert reset.quantity("norm_error")[-1] == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(free.v[-1], reset.v[-1], rtol=0, atol=1e-12)
    length = math.sqrt((free.y[-1] ** 2).sum())
    np.testing.assert_allclose(free.y[-1] / length, reset.y[-1], rtol=0, atol=1e-12)
    if sw.method(method).order < 4:
        assert abs(length - 1.0) > 1e-7


@for_each("phi", [0.0, 0.3, 0.6])
def test_standard_euler_settles_up_to_a_gain(phi: float) -> None:
    """A deviation of q·q shrinks by 1 − 2hk·r·√(1 − Φ²), r where it settles: up to hk = 1/√(1 − Φ²) − 1 + √(1 − Φ²), 1 at rest.

    Just above, it goes to and fro between two values, farther apart the farther above.
    """
    h, cosine = (2 * phi / OMEGA if phi else 0.1), math.sqrt(1 - phi**2)
    limit = 1 / cosine - 1 + cosine
    spin = SPIN if phi else np.zeros(3)
    for factor, settles in ((0.99, True), (1.01, False)):
        start = {"v": spin, "y": 1.001 * tops.some_attitude(1), "dt": h, "steps": 4001, "every": 1}
        run = sw.integrate(BODY, "standard_euler", **start, control=sw.NormControl(factor * limit / h))
        one, two = (run.y[-2:] ** 2).sum(axis=1)
        assert bool(abs(one - two) < 1e-12) is settles
        assert one == pytest.approx(1.0, abs=0.4)


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_at_rest_it_diverges_from_a_gain_of_two_on() -> None:
    """n ← n·(1 + hk·(1 − n²)) maps [−a, a] to itself, a² = (2 + hk)/hk, as long as its largest value is below a: up to hk = 2."""
    gains = np.array([1.5, 1.95, 2.05, 3.0])
    run = sw.integrate(
        BODY, "false_euler", v=np.zeros(3), y=1.001 * tops.UNIT, dt=0.1, steps=5000, control=sw.NormControl(gains / 0.1)
    )
    assert run.status.tolist() == [0, 0, 1, 1]


@for_each("method", METHODS)
def test_at_rest_the_gain_is_limited_by_the_method(method: str) -> None:
    """|q| − 1 decays at 2k, so hk is below half the limit on the negative real axis: 1 for Euler and Heun, 1.393 for RK4."""
    decay = sw.stability_limit(sw.LinearSystem([[-1.0]], velocities=0), method)
    limit = 0.5 * float(decay)
    known = {1: 1.0, 2: 1.0}.get(sw.method(method).order)
    assert known is None or limit == pytest.approx(known, rel=1e-9)
    if method == "rk4":
        assert limit == pytest.approx(0.5 * 2.785293563405282, rel=1e-9)
    for factor, settles in ((0.99, True), (1.01, False)):
        start = {"v": np.zeros(3), "y": 1.0001 * tops.some_attitude(1), "dt": 0.1, "steps": 3000, "every": 1}
        gain = sw.NormControl(factor * limit / 0.1)
        with pytest.warns(sw.DivergenceWarning) if method == "vern7" and not settles else nullcontext():
            run = sw.integrate(BODY, method, **start, control=gain)
        off = abs((run.y[-20:] ** 2).sum(axis=1) - 1.0).max()
        assert bool(off < 1e-12) is settles, off


@for_each("phi", [0.01, 0.3, 1.1])
def test_the_norm_under_a_series_grows_as_the_series_ends(phi: float) -> None:
    """q̇ turns q by a right angle, so a step multiplies it by Σ (iΦ)ᵏ/k! up to the order; to a few roundings each."""
    order = sw.method("taylor").order
    square, _ = norms("taylor", 2 * phi / OMEGA, 1)
    factor = sum((1j * phi) ** k / math.factorial(k) for k in range(order + 1))
    wrong = sum((1j * phi) ** k / math.factorial(k) for k in range(order))
    assert square[1] / square[0] == pytest.approx(abs(factor) ** 2, abs=4 * order * 2.0**-52)
    if phi > 1.0:
        assert abs(abs(wrong) ** 2 - abs(factor) ** 2) > 1e-6
