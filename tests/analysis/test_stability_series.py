"""Series in Φ, counts of operations, and the four criteria."""

import json
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import eigen, maps, operations, series
from stepwell.analysis.stability.numbers import Polynomial
from stepwell.errors import ArgumentError, ShapeError, UnsupportedError
from stepwell.reference.systems.oscillator import Oscillator as Reference
from support import other_methods as other
from support.looped import looped
from support.refusals import refused
from support.stability_cases import EPS, METHODS
from support.truths import CLOSED_FORMS

RATIOS = {
    "standard_euler": ((2, "-1/3"),),
    "damped_euler": ((2, "1/24"), (4, "3/640")),
    "false_euler": ((2, "1/24"), (4, "3/640")),
    "verlet": ((2, "1/24"), (4, "3/640")),
    "leapfrog": ((2, "1/24"), (4, "3/640")),
    "standard_heun": ((2, "1/6"), (4, "-1/20")),
    "false_heun": ((2, "-11/96"),),
    "semi_false_heun": ((2, "-1/12"), (4, "7/160")),
    # The imaginary part of ln(R(z)·e⁻ᶻ), z = iΦ.
    "rk4": ((4, "-1/120"), (6, "1/336")),
    "merson": ((4, "-1/720"), (6, "-1/2016")),
    "fehlberg": ((4, "1/780"), (6, "-1/546")),
    "fehlberg_5": ((6, "-31/43680"), (8, "5/67392")),
    "bs32": ((4, "1/30"), (6, "-1/252")),
    "dopri5": ((6, "1/2100"), (8, "-1/8100")),
}
RADII = {
    "standard_euler": ((2, "1"),),
    "damped_euler": (),
    "false_euler": (),
    "verlet": (),
    "leapfrog": (),
    "standard_heun": ((4, "1/4"),),
    "false_heun": ((2, "-1/2"),),
    "semi_false_heun": ((4, "-1/4"),),
    "rk4": ((6, "-1/72"), (8, "1/576")),
    "merson": ((8, "-1/1728"), (10, "1/20736")),
    "fehlberg": ((6, "5/936"), (8, "-11/7488"), (10, "1/10816")),
    "bs32": ((4, "-1/12"), (6, "1/36")),
    "dopri5": ((6, "-1/1800"), (8, "1/1600"), (10, "-1/14400"), (12, "1/360000")),
    "fehlberg_5": ((6, "17/9360"), (8, "-7/12480"), (10, "11/374400"), (12, "1/4326400")),
}


@looped("method", sorted(RATIOS))
def test_series_are_those_of_computer_algebra(method: str) -> None:
    expansion = series(method)
    assert expansion.ratio_terms(len(RATIOS[method])) == [(k, Fraction(c)) for k, c in RATIOS[method]]
    assert expansion.radius_terms(9) == [(k, Fraction(c)) for k, c in RADII[method]]


@looped(
    "method, radius, ratio",
    [
        (other.MERSON_4, (8, -1 / 1728), (4, -1 / 720)),
        (other.FEHLBERG_4, (6, 5.342e-3), None),
        (other.FEHLBERG_5, (6, 1.816e-3), (6, -7.1e-4)),
        (other.FOREST_RUTH, None, (4, -6.614e-2)),
        (other.PEFRL, None, (4, -6.054e-5)),
    ],
)
def test_series_of_methods_that_are_not_in_the_catalogue(method: Any, radius: Any, ratio: Any) -> None:
    expansion = series(method)
    if radius is None:
        assert expansion.radius_terms() == []  # a product of shears: the determinant is 1, whatever the coefficients
    else:
        assert expansion.radius_terms(1)[0] == pytest.approx(radius, rel=1e-3)
    if ratio is not None:
        assert expansion.ratio_terms(1)[0] == pytest.approx(ratio, rel=1e-2)


@looped("method", METHODS)
def test_series_approach_the_exact_values(method: str) -> None:
    """With terms up to Φ¹² the rest is some Φ¹⁴ = 6e-8 at Φ = 0.3, and less for the exact r₁²."""
    expansion = series(method)
    a = sw.analyse(sw.Oscillator(), method, dt=0.3)
    assert a.frequency_ratio == pytest.approx(expansion.ratio(0.3), abs=1e-7)
    assert a.q == pytest.approx(expansion.q(0.3), abs=20 * EPS)
    assert a.p == pytest.approx(expansion.p(0.3), abs=20 * EPS)


@looped(
    "method, counts",
    [
        # Two products with Φ and two sums (§8: "two multiplications and two additions per step").
        ("standard_euler", (2, 2, 0, 0, 1, 1)),
        ("damped_euler", (2, 2, 0, 0, 1, 1)),
        ("false_euler", (2, 2, 0, 0, 1, 1)),
        # 2y − y_prev + Φ·(Φ·y): two sums, three products.
        ("verlet", (2, 3, 0, 0, 1, 1)),
        # Four increments, of a product each; two predictions, two means of two, two sums; two halves.
        ("standard_heun", (6, 6, 0, 0, 2, 2)),
        # Eight increments; six predictions, half of them of half an increment, two sums; each mean 3 sums and 3 products.
        ("rk4", (14, 18, 0, 0, 4, 4)),
    ],
)
def test_operations_counted_by_hand(method: str, counts: tuple[int, ...]) -> None:
    assert tuple(operations(method)) == counts


def test_operations_of_other_systems() -> None:
    """Three bodies: a pair has 2 differences, 2 squares, 2 sums, 1 quotient, 6 products, 4 sums; a body 6 sums and 2 products."""
    o = operations("false_euler", sw.NBody())
    assert (o.additions, o.multiplications, o.divisions) == (3 * (2 + 2 + 4) + 3 * 6 + 12, 3 * (2 + 6) + 6, 3)
    assert operations("rk4", sw.NBody()).rate_evaluations == sw.method("rk4").evaluations
    refused(ShapeError, "one member", operations, "rk4", sw.Oscillator([1.0, 2.0]))
    with pytest.raises(UnsupportedError):
        operations("verlet", sw.Oscillator(1.0, 0.1))


@looped("method", METHODS)
def test_the_record_has_the_evaluations(method: str) -> None:
    o, calls = operations(method), []

    class Noting(Reference):
        def dv(self, *of: Any) -> Any:
            calls.append("v")
            return super().dv(*of)

        def dy(self, *of: Any) -> Any:
            calls.append("y")
            return super().dy(*of)

    sw.method(method).steps.step(Noting(0.1, "canonical", 1.0, None, None, None, None), 0.0, 0.1, 0.5, 1.0)
    assert o.rate_evaluations == sw.method(method).evaluations
    # A step that begins and ends with a drift, as PEFRL's, has one more of the rate that costs nothing.
    drifts = calls[:1] == calls[-1:] == ["y"] and len(calls) > 1
    assert drifts == (method == "pefrl") or method not in CLOSED_FORMS
    assert o.rate_evaluations_y == sw.method(method).evaluations + drifts


def test_polynomials_and_maps() -> None:
    x = Polynomial(0, 1)
    p = (1 + x) * (2 - x) / 2 - x * 0.25
    assert p.coefficients == (Fraction(1), Fraction(1, 4), Fraction(-1, 2))
    assert p(Fraction(2)) == Fraction(-1, 2)
    assert p(2.0) == -0.5
    assert Polynomial(1 / 6)[0] == Fraction(1, 6)  # what a float stands for
    assert Polynomial(math.pi)[0] == Fraction(math.pi)  # where it stands for itself
    assert (x - x).coefficients == ()
    assert (x * x - 2).root_near(1.4) == math.sqrt(2)
    assert Polynomial(1).root_near(0.5) == math.inf
    # Verlet's slots (y_prev, y) to states: the velocity of the present instant.
    chain = sw.Chain(2)
    dt = np.asarray(0.3)
    to_state = maps.finish(chain, sw.method("verlet"), dt, ())
    run = sw.integrate(chain, "verlet", v=[0.1, 0.2], y=[1.0, -1.0], dt=0.3, steps=5)
    assert run.carry is not None
    state = to_state @ np.concatenate([run.carry, run.y[-1]])
    np.testing.assert_allclose(state, np.concatenate([run.v[-1], run.y[-1]]), rtol=0, atol=20 * EPS)


def test_eigenvalues_that_meet() -> None:
    """The elements of a double root are told apart by rounding alone: ((a − d)/2)² + bc is 0 to some eps, not its root."""
    a = sw.analyse(sw.Oscillator(), "false_euler", dt=np.nextafter(2.0, 1.0))
    assert np.abs(a.eigenvalues + 1).max() < 1e-7
    z = eigen.eigenvalues(np.array([[1.0, 1.0], [0.0, 1.0]]))
    assert z.tolist() == [1, 1]
    assert eigen.eigenvalues(np.array([[0.0, 0.0], [0.0, 0.0]])).tolist() == [0, 0]
    assert eigen.eigenvalues(np.array([[-0.5]])).tolist() == [-0.5]
    small = eigen.eigenvalues(np.array([[1e8, 1.0], [1.0, 2e-8]]))  # the small root keeps its digits: det/far = 1/1e8
    assert small[1].real == pytest.approx(1e-8, rel=1e-7)


def test_criteria(tmp_path: Any) -> None:
    criteria = sw.criteria(phi=[0.5, 1.0])
    assert [c.method for c in criteria] == list(sw.methods())
    by_name = {c.method.name: c for c in criteria}
    euler = by_name["false_euler"]
    assert euler.samples_per_period == pytest.approx(math.pi)
    assert euler.at[1].deviation == pytest.approx(math.pi / 3 - 1, abs=1e-12)  # Ψ = 2·asin(½) at Φ = 1
    assert euler.at[1].deviation_series == pytest.approx(1 / 24 + 3 / 640)
    assert by_name["standard_heun"].at[0].r1_squared == pytest.approx(1 + 0.5**4 / 4, abs=1e-14)
    assert by_name["standard_heun"].r1_squared == "Φ⁴/4"
    assert by_name["false_heun"].deviation == "−11Φ²/96 − 597Φ⁴/10240"
    assert by_name["standard_euler"].samples_per_period == math.inf
    rows = criteria.rows()
    assert json.loads(json.dumps(rows)) == rows
    assert rows[0]["samples_per_period"] is None
    text = criteria.markdown()
    assert text.count("\n") == 2 + len(criteria)
    for c in criteria:
        assert f"| {c.method.title} |" in text
    criteria = sw.criteria(["rk4"], phi=0.3)
    criteria.to_json(tmp_path / "c.json")
    assert json.loads((tmp_path / "c.json").read_text(encoding="utf-8")) == json.loads(json.dumps(criteria.rows()))


@looped(
    "arguments, message",
    [
        ({"methods": "rk4"}, "expected a list of names"),
        ({"methods": []}, "methods: expected at least one"),
        ({"methods": ["rk44"]}, "there is no 'rk44'"),
        ({"phi": 0.0}, "phi: expected numbers above zero"),
        ({"phi": [[1.0]]}, "phi: expected a list"),
    ],
)
def test_criteria_say_what_is_wrong(arguments: dict[str, Any], message: str) -> None:
    refused(ArgumentError, message, sw.criteria, **arguments)
