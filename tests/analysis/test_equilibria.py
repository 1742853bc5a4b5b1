"""Equilibria that are known: of the pendulum, of the restricted three bodies, of linear systems; and what is none."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.looped import looped

EPS = np.finfo(float).eps


def test_without_velocities_near_is_an_array() -> None:
    """Lotka and Volterra's centre (1, 1), near a state alone or near a pair with none."""

    @sw.system(order=1)
    def prey(t: Any, y: Any) -> Any:
        return [y[0] * (1.0 - y[1]), y[1] * (y[0] - 1.0)]

    (one,), (other,) = (sw.equilibria(prey(), near=near) for near in (np.array([0.9, 1.2]), (None, [0.9, 1.2])))
    np.testing.assert_array_equal(one.y, other.y)
    np.testing.assert_allclose(one.y, 1.0, atol=1e-12)


def test_the_pendulum_hangs_or_stands() -> None:
    equilibria = sw.equilibria(sw.Pendulum(2.0), near=(0.0, [0.3, 3.0, -0.2, 9.0]), method="rk4", dt=0.1)
    assert [each.starts for each in equilibria] == [(0, 2), (1,), (3,)]
    below, above, beyond = equilibria
    # The sine near kπ is right to 10⁻²⁰ but its argument to half an eps of kπ, which is what Newton's method can find.
    for each, true in zip(equilibria, (0.0, np.pi, 3 * np.pi), strict=True):
        assert abs(each.y - true) <= EPS * true
        assert each.v == 0.0
        assert each.isolated
        assert each.residual <= 4.0 * 4 * EPS * max(true, 1.0)
    assert [each.kind for each in equilibria] == ["centre", "saddle", "saddle"]
    assert [each.stable for each in equilibria] == [None, False, False]
    np.testing.assert_allclose(below.eigenvalues, [2j, -2j], rtol=4 * EPS)
    np.testing.assert_allclose(above.eigenvalues, [2.0, -2.0], rtol=4 * EPS)
    # A step of RK4 turns a mode λ by 1 + λh + … + (λh)⁴/24.
    for each in (below, above):
        z = [sum((rate * 0.1) ** k / math.factorial(k) for k in range(5)) for rate in each.eigenvalues]
        np.testing.assert_allclose(np.sort_complex(each.analysis.eigenvalues), np.sort_complex(z), rtol=0, atol=40 * EPS)
    assert below.analysis.kind == "damped oscillation"
    assert above.analysis.kind == beyond.analysis.kind == "monotonic unstable"


@looped("damping, kinds", [(0.1, ["sink", "saddle"]), (3.0, ["sink", "saddle"]), (-0.1, ["source", "saddle"])])
def test_damping_decides(damping: float, kinds: list[str]) -> None:
    equilibria = sw.equilibria(sw.Pendulum(1.0, damping), near=(0.1, [0.3, 3.0]))
    assert [each.kind for each in equilibria] == kinds
    # λ² + 2Dλ ± 1 = 0
    for each, sign in zip(equilibria, (1.0, -1.0), strict=True):
        root = np.sqrt(complex(damping**2 - sign))
        true = np.sort_complex([-damping + root, -damping - root])
        np.testing.assert_allclose(np.sort_complex(each.eigenvalues), true, rtol=0, atol=16 * EPS * (1 + damping) ** 2)


def quintics(mu: float) -> list[float]:
    """The x of L1, L2 and L3, from Euler's quintics in the distance from the nearer body (Szebehely 1967, §4.4), by bisection."""
    # γ⁵ ∓ (3 − μ)γ⁴ + (3 − 2μ)γ³ − μγ² ± 2μγ − μ = 0 for L1 and L2, γ the distance from the light body; for L3, at the distance γ
    # from the heavy one, γ⁵ + (2 + μ)γ⁴ + (1 + 2μ)γ³ − (1 − μ)γ² − 2(1 − μ)γ − (1 − μ) = 0.
    polynomials = [
        [1, -(3 - mu), 3 - 2 * mu, -mu, 2 * mu, -mu],
        [1, 3 - mu, 3 - 2 * mu, -mu, -2 * mu, -mu],
        [1, 2 + mu, 1 + 2 * mu, -(1 - mu), -2 * (1 - mu), -(1 - mu)],
    ]
    roots = []
    for coefficients in polynomials:
        low, high = 0.0, 1.0 if coefficients is polynomials[0] else 2.0
        for _ in range(100):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if np.polyval(coefficients, middle) < 0 else (low, middle)
        roots.append(low)
    return [1 - mu - roots[0], 1 - mu + roots[1], -mu - roots[2]]


@looped("mu", [0.012277471, 0.2, 3e-6])
def test_the_five_points_of_lagrange(mu: float) -> None:
    hill = (mu / 3) ** (1 / 3)
    x = [1 - mu - hill, 1 - mu + hill, -1.0, 0.5, 0.5]
    y = [0.0, 0.0, 0.0, 0.8, -0.8]
    equilibria = sw.equilibria(sw.RestrictedThreeBody(mu), near=(np.zeros((2, 5)), np.array([x, y])))
    assert equilibria.lost == ()
    true = [*((each, 0.0) for each in quintics(mu)), (0.5 - mu, np.sqrt(0.75)), (0.5 - mu, -np.sqrt(0.75))]
    # Forces of size 1/γ² are right to some ten eps of themselves, γ the distance to the light body, and grow at least as fast as
    # the distance: the point is right to 10·eps/γ² over a slope of 1 at least. Of L4 and L5 the slope along the circle is as
    # small as 27μ/4. The quintic's own root is as uncertain, its values being sums of numbers up to 3. As ẏ = v, rounding leaves
    # some eps of the last step in v, which was below 10⁻⁷.
    for each, place in zip(equilibria, true, strict=True):
        gamma = min(1.0, np.hypot(place[0] - 1 + mu, place[1]))
        slope = min(1.0, 27 * mu / 4) if place[1] or place[0] < 0 else 1.0
        np.testing.assert_allclose(each.y, place, rtol=0, atol=100 * EPS / gamma**2 / slope)
        np.testing.assert_allclose(each.v, 0.0, rtol=0, atol=EPS * 1e-7)
    # Gascheau and Routh: L4 and L5 are centres if 27μ(1 − μ) < 1.
    of_triangle = "centre" if 27 * mu * (1 - mu) < 1 else "saddle"
    assert [each.kind for each in equilibria] == ["saddle"] * 3 + [of_triangle] * 2
    around = np.outer([1.0, 1.01, 0.995], [x, y]).reshape(3, 2, 5).swapaxes(0, 1)
    many = sw.equilibria(sw.RestrictedThreeBody(mu), near=(np.zeros((2, 3, 5)), around))
    assert len(many) == 5  # velocities of 1e-29 do not tell them apart
    # Their eigenvalues: λ⁴ + λ² + 27μ(1 − μ)/4 = 0.
    for each in equilibria[3], equilibria[4]:
        left = each.eigenvalues**4 + each.eigenvalues**2 + 27 * mu * (1 - mu) / 4
        np.testing.assert_allclose(np.abs(left), 0.0, atol=200 * EPS)


def test_a_wrong_quintic_would_be_seen() -> None:
    mu = 0.012277471
    equilibrium = sw.equilibria(sw.RestrictedThreeBody(mu), near=(np.zeros(2), np.array([0.8, 0.0])))[0]
    assert abs(equilibrium.y[0] - quintics(mu * (1 + 1e-9))[0]) > 100 * EPS / 0.15**2


def test_a_linear_system_is_solved_at_once() -> None:
    A = np.array([[-1.0, 2.0, 0.0], [0.0, -3.0, 1.0], [1.0, 0.0, -2.0]])
    system = sw.LinearSystem(A, [[1.0], [2.0], [3.0]], x=[2.0], velocities=1)
    (equilibrium,) = sw.equilibria(system, near=(np.full(1, 7.0), np.full(2, -5.0)), method="rk4", dt=0.1)
    true = np.linalg.solve(A, [-2.0, -4.0, -6.0])
    np.testing.assert_allclose(
        [*equilibrium.v, *equilibrium.y], true, rtol=0, atol=40 * EPS * np.abs(true).max() * np.linalg.cond(A)
    )
    np.testing.assert_allclose(
        np.sort_complex(equilibrium.eigenvalues), np.sort_complex(np.linalg.eigvals(A)), rtol=0, atol=1e-14
    )
    assert equilibrium.kind == "sink"
    assert equilibrium.stable
    assert equilibrium.analysis.stable


def test_none_and_a_line_of_equilibria() -> None:
    """Their forces fade, so a residual alone would call far enough an equilibrium."""
    for force in ("logarithmic", "newton"):
        equilibria = sw.equilibria(sw.NBody([1.0, 2.0], force=force), near=(np.zeros((2, 2)), np.array([[1.0, 0.0], [0.0, 1.0]])))
        assert len(equilibria) == 0
        assert equilibria.lost == (0,)
    # A mass that nothing holds stays anywhere.
    (equilibrium,) = sw.equilibria(sw.LinearSystem([[0.0, 0.0], [1.0, 0.0]]), near=(np.array([1.0]), np.array([5.0])))
    assert (equilibrium.y, equilibrium.v) == (5.0, 0.0)
    assert not equilibrium.isolated
    assert equilibrium.kind == "undecided to first order"
    assert equilibrium.stable is None


def test_units_do_not_matter_and_many_starts_are_found_once() -> None:
    """A pendulum in years: rates of 10⁸ beside velocities, and the same two places."""
    equilibria = sw.equilibria(sw.Pendulum(3e8), near=(1e8, [0.3, 3.0]))
    assert [each.kind for each in equilibria] == ["centre", "saddle"]
    assert equilibria[0].v == equilibria[1].v == 0.0
    starts = np.linspace(-4.0, 4.0, 60).reshape(3, 20)
    equilibria = sw.equilibria(sw.Pendulum(), near=(np.zeros(20), starts))
    places = np.array([each.y for each in equilibria])
    assert len(np.unique(np.round(places / np.pi))) == len(equilibria)
    np.testing.assert_allclose(np.sin(places), 0.0, atol=EPS * (1 + np.abs(places).max()))
    assert sum(len(each.starts) for each in equilibria) + len(equilibria.lost) == 60


@looped(
    "wrong, says",
    [
        ({"near": 1.0}, "near: expected a pair"),
        ({"system": sw.Pendulum([1.0, 2.0])}, "system: expected one member"),
        ({"dt": 0.1}, "method, dt: expected both"),
        ({"method": "rk4"}, "method, dt: expected both"),
        ({"method": "rk4", "dt": -1.0}, "dt"),
        ({"near": ([0.0, np.nan], 0.0)}, "near"),
        ({"near": (np.zeros(2), np.zeros(3))}, "near"),
    ],
)
def test_wrong_calls_say_what_is_wrong(wrong: dict[str, Any], says: str) -> None:
    with pytest.raises(sw.errors.ArgumentError, match=says):
        sw.equilibria(**{"system": sw.Pendulum(), "near": (0.0, 0.3)} | wrong)


@sw.system(order=1)
def expanded(t, y):
    """(y − 1)² as rounding sees it."""
    return y * y - 2.0 * y + 1.0


@sw.system(order=1)
def apart(t, y, *, gap=1e-4):
    return (y - 1.0) * (y - 1.0 - gap)


@sw.system
def floating(t, v, y, *, k=1.0):
    """Masses in a row with springs between them, held by nothing."""
    stretched = [k * (b - a) for a, b in itertools.pairwise(y)]
    return np.array([after - before for before, after in itertools.pairwise([0.0, *stretched, 0.0])])


@looped("at", [0.0, 1.0, -3e5])
@looped("p", [2, 3])
def test_a_multiple_root_is_undecided_from_every_side(p: int, at: float) -> None:
    """Each step of Newton's method leaves 1 − 1/p of the distance, and an eigenvalue of p·distance^(p − 1), of either sign."""
    # Alone it has nothing to be small beside.
    size = abs(at) or 1.0
    for start in (at + 0.5 * size, at - 0.5 * size, at + 1e-3 * size):
        equilibria = sw.equilibria(definition(p, at)(), near=(None, np.array(start)))
        assert [each.kind for each in equilibria] == ["undecided to first order"]
        assert not equilibria[0].isolated
        assert equilibria[0].stable is None


def definition(p: int, at: float) -> Any:
    @sw.system(order=1)
    def root(t, y):
        return math.prod([y - at] * p)

    return root


@looped("start", [2.0, 0.3, 1.001])
def test_a_double_root_that_rounding_hides_is_undecided(start: float) -> None:
    """It is found to about the root of a rounding, 1.5e-8, where the eigenvalue is as large."""
    for each in sw.equilibria(expanded(), near=(None, np.array(start))):
        assert each.kind == "undecided to first order"
        assert not each.isolated


def test_roots_that_are_apart_are_decided() -> None:
    """A ten-thousandth apart, with eigenvalues of ∓1e-4; and a slow rate of 1e-7 beside one of 1."""
    equilibria = sw.equilibria(apart(), near=(None, np.array([0.9, 1.2])))
    assert [each.kind for each in equilibria] == ["sink", "source"]
    assert all(each.isolated for each in equilibria)
    (slow,) = sw.equilibria(sw.LinearSystem([[-1e-7, 0.0], [1.0, -1.0]], velocities=0), near=(None, np.ones(2)))
    assert slow.kind == "sink"


@looped("n", [2, 3], long=[6])
def test_what_nothing_holds_is_undecided(n: int) -> None:
    """Its double eigenvalue zero comes out of rounding as ±1e-8."""
    (equilibrium,) = sw.equilibria(floating(k=3.7), near=(np.zeros(n), np.arange(n) + 0.1))
    assert equilibrium.kind == "undecided to first order"
    assert not equilibrium.isolated


#: Roots of several multiplicities, written as a product and as a sum whose roundings hide the place: the p-th root of ε from it.
MULTIPLE: list[Any] = [
    (lambda t, y: -(y**2), 0.0, [0.3, -0.3, 0.0, 1e-9, 50.0]),
    (lambda t, y: -(y**3), 0.0, [0.3, -0.3, 0.0, 1e-9, 50.0]),
    (lambda t, y: 2.0 * y**4, 0.0, [0.3, -0.3, 0.0, 1e-9, 50.0]),
    (lambda t, y: -(y**2 - 2.0 * y + 1.0), 1.0, [0.5, 1.7, 1.0, 30.0, -3.0, 0.99]),
    (lambda t, y: -(y**3 - 3.0 * y**2 + 3.0 * y - 1.0), 1.0, [0.5, 1.7, 1.0, 30.0, -3.0, 0.99]),
    (lambda t, y: y**4 - 4.0 * y**3 + 6.0 * y * y - 4.0 * y + 1.0, 1.0, [0.5, 1.7, 1.0, 30.0, -3.0, 0.99]),
    (lambda t, y: 1e-20 * (y**3 - 1.5 * y**2 + 0.75 * y - 0.125), 0.5, [0.2, 0.7, 0.5, -1.0]),
]


@looped("rate, root, starts", MULTIPLE)
def test_a_multiple_root_is_one_equilibrium(rate: Any, root: float, starts: list[float]) -> None:
    """From every start, and first order does not decide it; the place is known to ε^(1/4), 1.2·10⁻⁴, at worst."""
    equilibria = sw.equilibria(sw.system(order=1)(rate)(), near=(None, np.array(starts)))
    assert [each.starts for each in equilibria] == [tuple(range(len(starts)))]
    assert equilibria[0].kind == "undecided to first order"
    assert abs(float(equilibria[0].y) - root) <= 2.0 * (2.0**-52) ** 0.25 * max(root, 1e-6)


def test_a_multiple_root_across_the_axes() -> None:
    """Three equal roots along a direction between two axes, beside one that decays."""

    def rate(t: Any, y: Any) -> Any:
        a, b = 0.8 * y[0] - 0.6 * y[1], 0.6 * y[0] + 0.8 * y[1]
        return np.array([-0.8 * a**3 - 0.6 * b, 0.6 * a**3 - 0.8 * b])

    starts = np.array([[0.3, -0.3, 0.0, 1.0], [0.2, 0.5, 0.0, -2.0]])
    assert len(sw.equilibria(sw.system(order=1)(rate)(), near=(None, starts))) == 1


@looped(
    "rate, roots, starts",
    [
        (lambda t, y: (y - 1.0) * (y - 1.0 - 1e-6), [1.0, 1.0 + 1e-6], [0.0, 2.0]),
        (lambda t, y: (y - 1.0) ** 2 - 1e-12, [1.0 - 1e-6, 1.0 + 1e-6], [0.0, 2.0]),
        (lambda t, y: y * (y - 1e-12), [0.0, 1e-12], [0.0, 0.1, -0.1, 1.2e-12]),
        (lambda t, y: 1e-14 * y - y**3, [0.0, 1e-7, -1e-7], [0.0, 0.2, -0.2]),
    ],
)
def test_near_roots_stay_apart(rate: Any, roots: list[float], starts: list[float]) -> None:
    equilibria = sw.equilibria(sw.system(order=1)(rate)(), near=(None, np.array(starts)))
    # Rates are right to some roundings of their terms, and change by 1e-6 of these, so places to some 1e-9.
    np.testing.assert_allclose([float(each.y) for each in equilibria], roots, rtol=1e-9, atol=1e-22)
    assert "undecided to first order" not in {each.kind for each in equilibria}


@looped("least", [1.0, 1e-12])
def test_an_extreme_of_a_rate_is_no_equilibrium(least: float) -> None:
    """There Newton's step is zero, but the rate is not."""
    equilibria = sw.equilibria(sw.system(order=1)(lambda t, y: (y - 1.0) ** 2 + least)(), near=(None, np.array([1.0])))
    assert (len(equilibria), equilibria.lost) == (0, (0,))


@sw.system(order=1)
def isomers(t, y, *, k=1.0, back=3.0):
    """A turns into B, catalysed by it, and back: A + B is constant, and with sum S rests at B = S − back/k or B = 0."""
    turned = k * y[0] * y[1] - back * y[1]
    return [-turned, turned]


@sw.system
def gliding(t, v, y, *, c=2.0):
    """Drag alone: v + c·y is constant."""
    return -c * v


#: The 22 species of Huang and Ferrell's cascade (1996), bound ones as enzyme and substrate; and those of its start.
REACTIONS = [
    each.split() for each in ("a e1 x", "x e2 a", "b x c", "c x d", "c p b", "d p c", "k d l", "l d m", "l q k", "m q l")
]
AMOUNTS = {"a": 0.003, "e1": 3e-5, "e2": 3e-4, "b": 1.2, "p": 3e-4, "k": 1.2, "q": 0.12}
SPECIES = [*"abcdxklmpq", "e1", "e2", *(each[0] + each[1] for each in REACTIONS)]


@sw.system(order=1)
def cascade(t, y):
    amounts, rates = dict(zip(SPECIES, y, strict=True)), dict.fromkeys(SPECIES, 0.0)
    for substrate, enzyme, product in REACTIONS:
        bound = substrate + enzyme
        binds, turns = 1000.0 * amounts[substrate] * amounts[enzyme] - 150.0 * amounts[bound], 150.0 * amounts[bound]
        for name, rate in ((substrate, -binds), (enzyme, turns - binds), (bound, binds - turns), (product, turns)):
            rates[name] = rates[name] + rate
    return list(rates.values())


def test_constant_sums_are_kept_and_left_out_of_the_label() -> None:
    """From each start with its own sum, where Newton's shortest step changes it; seven sums of a cascade of kinases."""
    rests = sw.equilibria(isomers(), near=(None, np.array([[4.0, 4.1, 0.5], [1.0, 3.9, 0.1]])))
    np.testing.assert_allclose([each.y for each in rests], [[3.0, 2.0], [3.0, 5.0], [0.6, 0.0]], atol=1e-12)
    assert [(each.kind, each.isolated) for each in rests] == [("sink", True)] * 3
    np.testing.assert_allclose(rests.sums, [[1.0, 1.0]], atol=1e-15)
    np.testing.assert_allclose(rests[1].eigenvalues, [0.0, -5.0], atol=1e-12)
    (glided,) = sw.equilibria(gliding(), near=(3.0, 1.0))
    assert (glided.kind, glided.v, glided.y) == ("sink", 0.0, pytest.approx(2.5, rel=1e-15))
    start = np.array([AMOUNTS.get(name, 0.0) for name in SPECIES])
    (rest,) = found = sw.equilibria(cascade(), near=(None, start))
    assert (rest.kind, rest.isolated, found.sums.shape) == ("sink", True, (7, 22))
    run = sw.integrate(cascade(), "rodas5p", y=start, at=[2000.0], tolerance=1e-9)
    np.testing.assert_allclose(rest.y, run.y[-1], atol=1e-9)
    np.testing.assert_allclose(found.sums @ rest.y, found.sums @ start, atol=1e-14)
    assert set(found.sums.ravel()) == {-1.0, 0.0, 1.0}
