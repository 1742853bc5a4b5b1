"""Stability where eigenvalues meet or nearly do: rounding moves n of them by the n-th root of eps, and limits must not follow."""

import copy
import itertools
import math
import pickle
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import KINDS, Mode, StabilityLimits, eigen, exact, operations, parts, series
from stepwell.base.immutable import same
from support import families
from support.families import family
from support.looped import in_turn, looped
from support.refusals import refused
from support.stability_cases import by_hand

#: Implicit ones are stable at every step here, which test_stiff.py shows.
METHODS = [m.name for m in sw.methods() if not m.is_implicit]
DAMPABLE = [m for m in METHODS if not sw.method(m).needs_acceleration]
ALIKE = [m for m in DAMPABLE if parts.function_of_rates(sw.method(m))]
APART = [m for m in DAMPABLE if m not in ALIKE]


def jordan(n: int, rate: float = -1.0) -> Any:
    return rate * np.eye(n) + np.eye(n, k=-1)


def companion(roots: list[int]) -> Any:
    """A matrix of whole numbers with these eigenvalues, each with one vector."""
    n, c = len(roots), np.array([1], dtype=object)
    for r in roots:
        c = np.convolve(c, [1, -r])
    a = np.eye(n, k=1)
    a[-1] = [-float(x) for x in c[:0:-1]]
    return a


def whole(n: int, seed: int) -> tuple[Any, Any]:
    """A full matrix of whole numbers and its inverse, of whole numbers too."""
    rng = np.random.default_rng(seed)
    s, inverse = np.eye(n, dtype=int), np.eye(n, dtype=int)
    for _ in range(2 * n if n > 1 else 0):
        i, j = rng.choice(n, 2, replace=False)
        k = int(rng.choice([-1, 1]))
        s[i] += k * s[j]
        inverse[:, j] -= k * inverse[:, i]
    assert (s @ inverse == np.eye(n)).all()
    return s, inverse


def test_methods_that_treat_both_blocks_alike() -> None:
    """Told by one matrix in fractions; those of the document's table 'newest value' are not, and Verlet is never asked."""
    assert set(APART) == {"false_euler", "damped_euler", "false_heun", "semi_false_heun"}
    assert not parts.function_of_rates(sw.method("verlet"))


@pytest.mark.parametrize(("method", "n"), in_turn(DAMPABLE, [3, 20, 2, 8]))
def test_a_jordan_block_has_the_limit_of_its_rate(method: str, n: int) -> None:
    """Eigenvalues of P are those of one state: R(−h), whatever the others do to it."""
    one = sw.stability_limit(sw.LinearSystem([[-1.0]]), method)
    limit = sw.stability_limit(sw.LinearSystem(jordan(n), velocities=0), method)
    assert limit.decided
    assert limit == pytest.approx(one, rel=1e-14)
    assert (limit.mode.rate, limit.mode.kind) == (-1.0, one.mode.kind)
    # Of the states only the last is the mode's own.
    np.testing.assert_allclose(np.abs(limit.mode.y), np.eye(n)[-1], rtol=0, atol=1e-6)
    near = sw.stability_limit(sw.LinearSystem(jordan(n) - 1e-6 * np.diag(np.arange(n) % 2), velocities=0), method)
    assert near == pytest.approx(one / (1.0 + 1e-6), rel=1e-14)


@pytest.mark.parametrize(("method", "n"), in_turn(ALIKE, [3, 8, 5, 16][: 3 + families.LONG]))
def test_a_row_of_filters_in_one_equation(method: str, n: int) -> None:
    """(1 + s)ⁿ, in whole numbers: no element is zero that would tell the states apart."""
    one = sw.stability_limit(sw.LinearSystem([[-1.0]]), method)
    for a in (companion([-1] * n), (s := whole(n, n))[0] @ jordan(n) @ s[1]):
        system = sw.LinearSystem(a)
        limit = sw.stability_limit(system, method)
        assert limit.decided
        assert limit == pytest.approx(one, rel=1e-14)
        assert limit.mode.rate == pytest.approx(-1.0, rel=1e-14)
        below, above = (sw.analyse(system, method, dt=f * one) for f in (1 - 1e-9, 1 + 1e-9))
        assert (below.stable, above.stable) == (True, False)
        assert below.radius == pytest.approx(sw.analyse(sw.LinearSystem([[-1.0]]), method, dt=(1 - 1e-9) * one).radius, rel=1e-13)


@pytest.mark.parametrize(
    ("method", "damping"),
    family(
        itertools.product(DAMPABLE, [0.3, 1.0]),
        lambda method, damping: method not in ("taylor", "damped_euler", "false_heun") and (method == "rk4") == (damping == 1.0),
    ),
)
def test_oscillators_in_a_row(method: str, damping: float) -> None:
    """Each drives the next: the limit is that of one, in the plain order and with states mixed within the blocks."""
    one = sw.stability_limit(sw.Oscillator(1.0, damping), method)
    for n in (2, 3) if damping == 1.0 and method in ("rk4", "false_euler") else (2,):
        a = np.kron(np.eye(n), [[-2 * damping, -1.0], [1.0, 0.0]]) + np.kron(np.eye(n, k=-1), [[0.0, 1.0], [0.0, 0.0]])
        v = list(range(0, 2 * n, 2))
        assert sw.stability_limit(sw.LinearSystem(a, velocities=v), method) == pytest.approx(one, rel=1e-12)
        order = v + [i + 1 for i in v]
        (s_v, i_v), (s_y, i_y) = whole(n, 1), whole(n, 2)
        zero = np.zeros((n, n))
        mixed = (
            np.block([[s_v, zero], [zero, s_y]]) @ (16.0 * a[np.ix_(order, order)]) @ np.block([[i_v, zero], [zero, i_y]]) / 16.0
        )
        limit = sw.stability_limit(sw.LinearSystem(mixed, velocities=n), method)
        # 2D is a number of 53 bits, of which the sums of whole multiples lose some: eps^(1/n) of a limit that n rates share.
        assert limit == pytest.approx(one, rel=20 * np.finfo(float).eps ** (1 / n) if damping == 0.3 else 1e-12)
        assert limit.decided


def test_the_row_of_oscillators_by_standard_euler() -> None:
    a = [[-2.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, -2.0, -1.0], [0.0, 0.0, 1.0, 0.0]]
    assert sw.stability_limit(sw.LinearSystem(a, velocities=[0, 2]), "standard_euler") == pytest.approx(2.0, rel=1e-14)


@pytest.mark.parametrize(("method", "n"), in_turn([m for m in METHODS if sw.method(m).limit], [2, 5]))
def test_undamped_oscillators_of_one_frequency_that_drive_each_other(method: str, n: int) -> None:
    """v̇ = −K·y with a K of one eigenvalue 4 and one vector: resonance, which grows as a power of time and has their limit."""
    s, inverse = whole(n, 3)
    k = s @ jordan(n, 4.0) @ inverse
    a = np.block([[np.zeros((n, n)), -k], [np.eye(n), np.zeros((n, n))]])
    limit = sw.stability_limit(sw.LinearSystem(a, velocities=n), method)
    assert limit == pytest.approx(sw.method(method).limit / 2.0, rel=1e-13)
    assert limit.mode.rate == pytest.approx(2j, rel=1e-14)
    resonant = sw.analyse(sw.LinearSystem(a, velocities=n), "false_euler", dt=0.25)
    assert (resonant.kind, resonant.stable) == ("unstable oscillation (double pair)", False)
    assert resonant.radius == pytest.approx(1.0, abs=1e-15)


def _damps(p: Any) -> bool:
    """Whether all eigenvalues of a matrix of fractions are inside the unit circle: Schur 1918 and Cohn 1922, without rounding."""
    n, power = len(p), p * 0 + np.array([[Fraction(int(i == j)) for j in range(len(p))] for i in range(len(p))], dtype=object)
    c, one = [Fraction(1)], power
    for k in range(1, n + 1):  # Faddeev and LeVerrier
        power = p @ power
        c.append(-power.trace() / k)
        power = power + c[-1] * one
    while len(c) > 1:
        if abs(c[-1]) >= abs(c[0]):
            return False
        c = [c[0] * a - c[-1] * b for a, b in zip(c[:-1], c[:0:-1], strict=True)]
        c = [x / c[0] for x in c]
    return True


@pytest.mark.parametrize("method", family(APART, lambda method: method in ("false_euler", "semi_false_heun")))
@looped(
    "a, n_v",
    [
        (companion([-1] * 3), 1),
        (companion([-1] * 5), 2),
        (companion([-1] * 6), 4),
        (companion([-1, -1, -1, -2, -2]), 3),
        (jordan(4) + 1e-9 * np.eye(4, k=3), 2),
        (whole(5, 4)[0] @ jordan(5) @ whole(5, 4)[1], 2),
        (companion([-1] * 4) * np.outer(10.0 ** np.arange(-12, 12, 6), 10.0 ** -np.arange(-12.0, 12, 6)), 2),
    ],
)
@pytest.mark.parametrize("clock", family([1.0, 1e12, 1e-12], lambda clock: clock == 1.0))
def test_limits_of_methods_that_use_the_newest_value(method: str, a: Any, n_v: int, clock: float) -> None:
    """On both sides of the limit, and far below it, by fractions."""
    a = a * clock
    limit = sw.stability_limit(sw.LinearSystem(a, velocities=n_v), method)
    assert limit.decided
    exactly = np.array([[Fraction(float(x)) for x in row] for row in a], dtype=object)
    for factor, damps in ((1 + 1e-12, False), (1 - 1e-12, True), (0.97, True), (0.5, True), (0.1, True)):
        assert _damps(by_hand(method, exactly * Fraction(float(limit) * factor), n_v)) == damps, factor


def test_eigenvalues_in_many_digits_and_of_many_sizes() -> None:
    """Whole numbers as roots; one of 1..12 moves by 1e-3 if the last digit of a coefficient changes."""
    for roots in (list(range(1, 13)), [-1] * 9, [-1, -1, -1, -2, -2, 3, 0, 0]):
        a = companion(roots)
        z = exact.eigenvalues(a, np.linalg.eigvals(a))
        np.testing.assert_allclose(np.sort(z.real), np.sort(roots), rtol=1e-15, atol=1e-15)
        assert not z.imag.any()
    a = np.kron(np.eye(3), [[0.0, -1.0], [1.0, 0.0]]) + np.kron(np.eye(3, k=1), np.eye(2))
    z = exact.eigenvalues(a, np.linalg.eigvals(a))
    np.testing.assert_allclose(z, [1j, -1j] * 3, rtol=0, atol=1e-20)
    # A rate that is fifteen decades smaller counts, if it grows; and if it damps, does not hide that nothing grows.
    for slow, limit in ((1e-3, 0.0), (-1e-3, 2e-12)):
        a = np.array([[-1e12, 1.0, 0.0], [1.0, slow, 1e-9], [0.0, 1e-9, -1.0]])
        assert sw.stability_limit(sw.LinearSystem(a, velocities=0), "standard_euler") == pytest.approx(limit, rel=1e-12)
        apart = np.diag([-1e12, slow, -1.0])
        assert sw.stability_limit(sw.LinearSystem(apart, velocities=1), "false_euler") == pytest.approx(limit, rel=1e-12)


def test_where_it_is_not_decided_it_says_so() -> None:
    """Forty rates that nearly meet are too many to look at in more digits: between two steps nothing is claimed."""
    n = 40
    s = np.random.default_rng(1).normal(size=(n, n))
    system = sw.LinearSystem(s @ jordan(n) @ np.linalg.inv(s), velocities=0)
    with pytest.warns(sw.AccuracyWarning, match="is NaN: it is between dt = .* and .*, where rounding hides what grows"):
        limit = sw.stability_limit(system, "rk4")
    assert not limit.decided
    assert math.isnan(limit)
    assert limit.stable < limit.grows
    assert "not decided" in repr(limit)
    again = pickle.loads(pickle.dumps(limit))
    assert (again.stable, again.grows) == (limit.stable, limit.grows)
    batch = sw.LinearSystem(np.stack([system.A, -np.eye(n)], axis=-1), velocities=0)
    with pytest.warns(sw.AccuracyWarning, match="1 of 2 members"):
        limits = sw.stability_limit(batch, "rk4")
    assert limits.decided.tolist() == [False, True]
    assert np.isnan(limits).tolist() == [True, False]
    again = pickle.loads(pickle.dumps(limits))
    np.testing.assert_array_equal(again.stable, limits.stable)
    a = sw.analyse(system, "rk4", dt=2.7)
    assert (a.kind, bool(a.stable)) == ("not decided", False)
    assert a.kind in KINDS


def test_a_long_chain_that_floats_is_decided() -> None:
    """Its double eigenvalue 1 is no reason for doubt, nor is a damping that does not split into modes."""
    n = 34
    k = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    k[0, 0] = k[-1, -1] = 1.0
    d = np.diag(0.2 + 0.1 * np.arange(n) / n)
    a = np.block([[-d, -k], [np.eye(n), np.zeros((n, n))]])
    limit = sw.stability_limit(sw.LinearSystem(a, velocities=n), "false_euler")
    assert limit.decided
    assert 0.5 < limit < 1.0


def test_components_and_vectors_of_multiple_eigenvalues() -> None:
    a = np.array([[1.0, 2.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0], [0.0, 5.0, 0.0, 7.0], [0.0, 0.0, 0.0, 2.0]])
    assert [c.tolist() for c in parts.components(a)] == [[0, 1], [2], [3]]
    assert [c.tolist() for c in parts.components(np.roll(np.eye(4), 1, axis=0))] == [[0, 1, 2, 3]]
    assert eigen.one_vector(jordan(3), np.array([-1, -1, -1 + 0j])).all()
    assert not eigen.one_vector(-np.eye(3), np.array([-1, -1, -1 + 0j])).any()
    x = eigen.vector(jordan(4), -1.0)
    np.testing.assert_allclose(np.abs(x) / np.abs(x).max(), [0, 0, 0, 1], rtol=0, atol=1e-9)


FOUND: dict[str, Any] = {
    "a limit": lambda: sw.stability_limit(sw.Oscillator(1.0, 0.1), "rk4"),
    "a limit of a chain": lambda: sw.stability_limit(sw.Chain(3), "rk4"),
    "an infinite limit": lambda: sw.stability_limit(sw.LinearSystem([[0.0]]), "rk4"),
    "limits": lambda: sw.stability_limit(sw.Oscillator(np.array([1.0, 2.0]), 0.1), "rk4"),
    "a mode": lambda: sw.stability_limit(sw.Chain(3), "rk4").mode,
    "criteria": lambda: sw.criteria(["rk4", "standard_euler"]),
    "a criterion": lambda: sw.criteria(["rk4"])[0],
    "at": lambda: sw.criteria(["rk4"])[0].at[0],
    "operations": lambda: operations("rk4"),
    "series": lambda: series("rk4"),
    "a polynomial": lambda: series("rk4").q,
}


@looped("what", FOUND)
def test_copies_are_equal(what: str) -> None:
    one, other = FOUND[what](), FOUND[what]()
    for each in (other, copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert type(each) is type(one)
        if isinstance(one, StabilityLimits):
            assert same(each, one)
            assert each.modes.tolist() == one.modes.tolist()
            assert each.decided.all()
        else:
            assert each == one
            assert not (each != one)  # noqa: SIM202
            assert hash(each) == hash(one)
        if isinstance(one, float):
            assert (each.mode, each.grows) == (one.mode, one.grows)
        elif isinstance(one, Mode):
            assert each != one._replace(y=2 * one.y)


@looped("dt", [0.1, [0.1, 3.0]])
def test_copies_of_an_analysis_are_equal(dt: Any) -> None:
    system = sw.Oscillator(1.0, 0.1)
    one, other = sw.analyse(system, "rk4", dt=dt), sw.analyse(system, "rk4", dt=dt)
    assert one == other == copy.copy(one)
    assert one != sw.analyse(system, "rk4", dt=0.2)
    for each in (copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        each.system = system  # which is equal by its own rule
        assert each == one
        assert hash(each) == hash(one)


@looped("value", [math.nan, math.inf, -1.0, 0.0, 101.0, "a", None, [[1.0]], 1j])
def test_bad_angles_are_refused(value: Any) -> None:
    """Pictures of angles far past every limit asked for terabytes."""
    from stepwell.views import charts

    for call in (lambda: charts.figures(["rk4"], phi=value), lambda: charts.stability_map("rk4", phi=(0.0, value))):
        refused(sw.errors.ArgumentError, "phi", call)
    if value is not None:
        refused(sw.errors.ArgumentError, "phi", charts.stability, ["rk4"], phi=[value] if np.ndim(value) == 0 else value)
    if value != 101.0:
        refused(sw.errors.ArgumentError, "phi", sw.criteria, ["rk4"], phi=value)


def test_what_is_as_large_as_numbers_can_be_is_answered() -> None:
    at = sw.criteria(["rk4"], phi=1e300)[0].at[0]
    assert at.kind == "not finite"
    # Nothing is said of it, and of the member beside it all.
    matrix = np.repeat(np.diag([1.0, 2.0, 3.0])[..., np.newaxis], 2, axis=-1)
    matrix[0, 1, 1] = 1e300
    values = eigen.eigen(matrix, np.array([[1.0, 1e-10], [1.0, 1e10], [1.0, 1.0]])).values
    np.testing.assert_array_equal(np.sort(values[:, 0].real), [1.0, 2.0, 3.0])
    assert np.isnan(values[:, 1]).all()
