"""Stability maps: radius by closed forms, what is observed against what is predicted, files and the picture."""

import dataclasses
import itertools
import math
import time
from fractions import Fraction

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import series
from stepwell.errors import ArgumentError, DTypeError, ShapeError, TooLargeError, UnknownNameError, UnsupportedError
from stepwell.views.charts.maps import ROUNDING
from support import families
from support.charted import files_of
from support.families import family
from support.for_each import for_each
from support.looks import faults
from support.refusals import refused
from support.truths import CLOSED_FORMS

METHODS = [method for method in sw.methods() if not method.is_implicit]
IMPLICIT = [method for method in sw.methods() if method.is_implicit]
DAMPED = [method for method in METHODS if not method.needs_acceleration]
UNDAMPED = [method for method in METHODS if method.needs_acceleration]

#: By default one that is never stable undamped, one of one evaluation, and two of more stages.
SOME = ("standard_euler", "false_euler", "rk4", "merson")
some_damped = pytest.mark.parametrize("method", family(DAMPED, lambda method: method.name in SOME, lambda method: method.name))

#: R(x) of the methods that treat both blocks alike: they step e^x, and so e^(λ·dt) of each mode.
POLYNOMIALS = {
    "standard_euler": lambda x: 1 + x,
    "standard_heun": lambda x: 1 + x + x**2 / 2,
    "rk4": lambda x: 1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24,
}


@pytest.fixture(scope="module")
def false_euler():
    return sw.charts.stability_map("false_euler", phi=(0, 4), size=(200, 101))


def test_the_radius_is_that_of_the_stability_polynomial():
    """At D = 1 both modes meet, and the rounding of P's elements, below 1000 eps, is magnified to its root, 5e-7."""
    for name, polynomial in POLYNOMIALS.items():
        chart = sw.charts.stability_map(name, size=(80, 61))
        phi, damping = np.meshgrid(chart.phi, chart.damping)
        root = np.sqrt((damping**2 - 1).astype(complex))
        radius = np.max([np.abs(polynomial(phi * (-damping + sign * root))) for sign in (1, -1)], axis=0)
        assert chart.radius == pytest.approx(radius, rel=5e-7), name
        clear = np.abs(radius - 1) > 5e-7
        assert np.array_equal(chart.stable[clear], (radius < 1)[clear]), name


def test_false_euler_is_stable_up_to_the_documents_limit_with_damping(false_euler):
    """z² − (2 − 2DΦ − Φ²)z + 1 − 2DΦ has a root −1 at Φ = 2(√(1 + D²) − D), which is 2 without damping."""
    edge = 2 * (np.sqrt(1 + false_euler.damping**2) - false_euler.damping)
    assert np.array_equal(false_euler.stable, false_euler.phi < edge[:, np.newaxis] * (1 - 1e-9))
    phi, damping = np.meshgrid(false_euler.phi, false_euler.damping)
    p, q = 1 - damping * phi - phi**2 / 2, 1 - 2 * damping * phi
    real = p**2 > q
    with np.errstate(invalid="ignore"):
        radius = np.where(real, np.abs(p) + np.sqrt(p**2 - q), np.sqrt(q))
    assert false_euler.radius == pytest.approx(radius, rel=5e-7)


@some_damped
def test_every_row_ends_where_the_limit_is(method):
    chart = sw.charts.stability_map(method, size=(400, 5))
    for row in chart.summary():
        limit = float(sw.stability_limit(sw.Oscillator(damping=row["damping"]), method))
        if not limit:
            assert row["stable_up_to"] < 0.1  # where growth of a high order begins it is lost in rounding
            continue
        assert row["stable_up_to"] <= limit * (1 + 1e-9)
        # A series is stable beyond the largest Φ of the map.
        assert min(limit, chart.phi[-1]) <= row["stable_up_to"] + chart.phi[0] * (1 + 1e-9)


def test_the_grid(false_euler):
    assert false_euler.phi == pytest.approx(np.arange(1, 201) / 50, rel=1e-15)
    assert false_euler.damping.tolist() == np.linspace(0, 2, 101).tolist()
    assert false_euler.radius.shape == false_euler.stable.shape == (101, 200)
    chart = sw.charts.stability_map("rk4", phi=(1, 2), damping=(0.5, 0.7), size=3)
    assert (chart.phi[0], chart.phi[-1], chart.damping[0], chart.damping[-1]) == pytest.approx((4 / 3, 2, 0.5, 0.7))
    assert sw.charts.stability_map("rk4").radius.shape == (512, 512)
    chart = sw.charts.stability_map("false_euler", phi=(0, 4), damping=None, size=(4, 1))
    assert (chart.phi.tolist(), chart.stable.tolist()) == ([1, 2, 3, 4], [[True, False, False, False]])
    assert chart.radius[0, 1] == 1


def test_maps_of_implicit_methods_and_of_those_that_cannot_do_damping():
    for method in IMPLICIT:
        chart = sw.charts.stability_map(method, size=(40, 9))
        assert chart.stable.all(), method
        assert chart.observe(300).disagreements == 0, method
    for method in UNDAMPED:
        with pytest.raises(UnsupportedError, match=r"needs forces that do not depend on the velocity, but Oscillator\(omega=1.0"):
            sw.charts.stability_map(method)
        refused(ArgumentError, "plot: expected a map of 2 × 2 points or more", sw.charts.stability_map(method, damping=None).plot)


@some_damped
def test_a_map_is_fitted_to_the_limit(method):
    """It ends past the largest limit of its rows, and by no more than the quarter, a coarse point and the rounding up."""
    chart = sw.charts.stability_map(method, size=(8, 5))
    limits = [float(sw.stability_limit(sw.Oscillator(damping=d), method)) for d in np.linspace(0, 2, 33)]
    assert max(limits) < chart.phi[-1] <= 1.25 * (max(limits) + 0.06) + 0.05
    title = chart.plot().texts[0].get_text()
    assert title.startswith(f"{method.title}: ")
    assert ("never stable undamped" in title) == (limits[0] == 0.0)
    assert f"to Φ = {limits[16]:.3g} at D = 1" in title


def test_a_map_takes_less_than_a_second():
    """512 × 512 points, on one thread, the best of three, because a machine does other things too; 0.1 s when it was written."""
    seconds = []
    for _ in range(3):
        begin = time.process_time()
        sw.charts.stability_map("fehlberg_5")
        seconds.append(time.process_time() - begin)
    assert min(seconds) < 1.0


def test_what_cannot_be_mapped_is_said(false_euler):
    for arguments, error, message in (
        ({"method": "rk44"}, UnknownNameError, "did you mean 'rk4'"),
        ({"phi": (2, 1)}, ArgumentError, "phi: expected the lower end first, got 2 and 1"),
        ({"phi": (-1, 1)}, ArgumentError, "phi: expected angles of 0 rad or more, got -1"),
        ({"phi": 4}, ShapeError, "phi: expected two numbers"),
        ({"damping": (0, 1, 2)}, ShapeError, "damping: expected two numbers"),
        ({"damping": ("a", "b")}, DTypeError, "damping: expected real numbers"),
        ({"size": 0}, ArgumentError, "size: expected 1 or more"),
        ({"size": (3, 3, 3)}, ShapeError, "size: expected a number of points or a pair"),
        ({"size": 2.5}, DTypeError, "size: expected a whole number"),
        ({"size": 10**7}, TooLargeError, "ask for fewer points"),
    ):
        refused(error, message, sw.charts.stability_map, **({"method": "rk4"} | arguments))
    refused(ArgumentError, "steps: expected 1 or more, got 0", false_euler.observe, 0)


def agree(observation, undecided):
    """No disagreements, on both sides of the circle, and not because too little is decided."""
    assert observation.disagreements == 0
    assert np.mean(~observation.decided) < undecided
    assert (observation.decided & ~observation.bounded).any()
    assert np.array_equal(observation.bounded | observation.predicted, observation.bounded)


@some_damped
def test_every_point_does_what_its_eigenvalues_say(method):
    """Oscillators by the thousand for 2000 steps, in a band of half a percent, in which few points of the map are."""
    # And a prediction of steps that are a fiftieth shorter than those that are made is found out.
    chart = sw.charts.stability_map(method, size=(400, 256) if families.LONG else (100, 64))
    observation = chart.observe(2000)
    agree(observation, 0.02)
    assert (observation.decided & observation.bounded).any()
    assert observation.band < 0.008
    assert dataclasses.replace(chart, phi=1.02 * chart.phi).observe(2000).disagreements > 10


@for_each("method", METHODS)
def test_every_undamped_point_does_what_its_eigenvalues_say(method):
    """So many angles at D = 0, where the stable ones of the symplectic methods are on the circle itself."""
    chart = sw.charts.stability_map(method, damping=None, size=(10_000, 1))
    observation = chart.observe(1000)
    # Where growth begins with a power of Φ, r₁² = 1 + c·Φᵏ, it is seen by its area from 3δ on. Small steps are near to a rotation
    # by Φ, so the norm of P − z₁I is 2Φ, κ = 3 and δ = 2ρ·9, and not a tenth larger up to Φ = 0.05: Fehlberg's c are 5/936
    # and 17/9360, which is 0.7 % of the map. That of Verner's of order 7 is 7.5e-7 at Φ⁸, so that it begins at 0.2, where the
    # norm is not a tenth larger either. A real eigenvalue leaves the circle with a slope of 2 or more (False Heun: 3).
    begins = [(k, float(c)) for k, c in series(method).radius_terms(1) if c > 0]
    least = [(1.1 * 3 * 2 * ROUNDING * 9 / c) ** (1 / k) for k, c in begins]
    assert max(least, default=0.0) < (0.25 if method.name == "vern7" else 0.05)
    agree(observation, (sum(least) + observation.band / 2) / chart.phi[-1])
    below = np.count_nonzero(chart.phi < method.limit * (1 - 1e-12))
    assert observation.bounded[0, :below].all()
    # A growth like Φ⁶ is lost in rounding where it begins; a limit is not.
    assert not method.limit or not chart.stable[0, below + 1]


def test_a_wrong_prediction_is_counted_and_a_slow_growth_is_seen_by_the_area(false_euler):
    wrong = false_euler.stable.copy()
    wrong[:, :10] = False  # stable, but said to grow; with a radius that says so too
    radius = np.where(wrong == false_euler.stable, false_euler.radius, 2.0)
    observed = dataclasses.replace(false_euler, stable=wrong, radius=radius).observe(1000)
    assert observed.disagreements == 10 * 101
    assert "1010 disagreements" in repr(observed)
    # Fehlberg's fifth-order result at Φ = 0.1: r₁² = 1 + 1.8e-9, a growth of a millionth in 1000 steps. Reversed, it damps.
    chart = sw.charts.stability_map("fehlberg_5", phi=(0.1, 1), damping=None, size=(900, 1))
    observed = chart.observe(1000)
    assert not observed.bounded.any()
    assert observed.decided.all()
    wrong = dataclasses.replace(chart, stable=~chart.stable)
    assert wrong.observe(1000).disagreements == 900


def test_threshold_and_band_are_as_derived(false_euler):
    observed = false_euler.observe(500)
    P = sw.analyse(false_euler.system, "false_euler", dt=1.0)
    shifted = P.P - P.eigenvalues[0] * np.eye(2)[:, :, np.newaxis, np.newaxis]
    norms = np.linalg.norm(np.moveaxis(shifted, (0, 1), (-2, -1)), axis=(-2, -1))[false_euler.stable]
    assert observed.threshold == pytest.approx(2 * (1 + 500 * norms.max()))
    assert (1 + observed.band) ** 500 / math.sqrt(2) == pytest.approx(observed.threshold)
    assert observed.band > false_euler.observe(5000).band
    pair = P.eigenvalues[0].imag != 0
    with np.errstate(divide="ignore"):
        every = np.linalg.norm(np.moveaxis(shifted, (0, 1), (-2, -1)), axis=(-2, -1))
        kappa = 1 + every / np.abs(P.eigenvalues[0].imag)
    rounding = 2 * ROUNDING * kappa**2 * (P.radius + every) / P.radius**2
    assert observed.rounding[pair] == pytest.approx(rounding[pair])
    assert np.isinf(observed.rounding[~pair]).all()
    seen = (false_euler.radius >= 1 + observed.band) | (false_euler.radius**2 >= 1 + 3 * observed.rounding)
    assert np.array_equal(observed.decided, false_euler.stable | seen)


def area_of(run):
    """The determinant of two members' slots and coordinates at the end."""
    slot = run.v[-1] if run.carry is None else run.carry
    return Fraction(float(slot[0])) * Fraction(float(run.y[-1, 1])) - Fraction(float(slot[1])) * Fraction(float(run.y[-1, 0]))


def test_the_area_of_a_pair_changes_as_its_determinant_says():
    """Of the states after 1 and 1001 steps, against the closed form of q in fractions. It must be off by less than δ a step."""
    phi = [Fraction(k, 64) for k in (1, 3, 6, 19, 32, 64, 80)]
    rounding = {
        m: sw.charts.stability_map(m, phi=(0, 1.25), damping=None, size=(80, 1)).observe(1000).rounding[0]
        for m in METHODS
        if m.name in CLOSED_FORMS
    }
    for method, each in itertools.product(rounding, phi):
        (a, b), (c, d) = CLOSED_FORMS[method.name](each)
        q = a * d - b * c
        unit = {"v": np.array([1.0, 0.0]), "y": np.array([0.0, 1.0])}
        begin = sw.integrate(sw.Oscillator(float(each)), method, dt=1.0, steps=1, **unit)
        area = area_of(sw.integrate(begin.system, method, resume=begin, steps=1000)) / area_of(begin)
        grown = 1000 * math.log1p(float(q - 1))
        if abs(grown) > 500:  # states outside the range of numbers
            continue
        off = math.log(area.numerator) - math.log(area.denominator) - grown
        # Logarithms of whole numbers of a thousand digits and more are good to some 2⁻⁵³ of themselves.
        allowed = 1000 * rounding[method][round(each * 64) - 1] + 2**-50 * max(math.log(area.denominator), abs(grown))
        assert abs(off) <= allowed, (method, each)


def test_near_a_double_eigenvalue_the_transient_is_linear_and_stays_below_the_threshold():
    """At Φ = 2 − δ False Euler's states turn with a radius of about 1/√δ: large, bounded, and not to be called growing."""
    chart = sw.charts.stability_map("false_euler", phi=(1.999_999, 2.000_001), damping=None, size=(1000, 1))
    observed = chart.observe(4000)
    assert observed.disagreements == 0
    assert observed.bounded[observed.predicted].all()
    run = sw.integrate(sw.Oscillator(chart.phi[498]), "false_euler", v=0.0, y=1.0, dt=1.0, steps=4000, every=1)
    assert 1000 < np.abs(run.y).max() < observed.threshold


def test_the_files_hold_the_map(false_euler, tmp_path):
    rows, whole = files_of(false_euler, tmp_path)
    assert [float(row["radius"]) for row in rows] == false_euler.radius.ravel().tolist()
    assert [row["stable"] == "True" for row in rows] == false_euler.stable.ravel().tolist()
    assert [float(row["phi"]) for row in rows] == false_euler.phi.tolist() * 101
    assert [float(row["damping"]) for row in rows] == np.repeat(false_euler.damping, 200).tolist()
    assert whole["phi"] == {"first": 0.02, "last": 4.0, "points": 200}
    assert (whole["method"], whole["damping"]["points"], whole["summary"]) == ("false_euler", 101, false_euler.summary())
    assert [row["damping"] for row in whole["summary"]] == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert whole["summary"][0]["stable_up_to"] == pytest.approx(1.98)


@some_damped
def test_the_picture_has_lines_numbers_and_hatching(method, tmp_path):
    from matplotlib.image import imread

    chart = sw.charts.stability_map(method, size=64)
    figure = chart.plot(tmp_path / "map.png")
    image = imread(tmp_path / "map.png")
    assert image.shape[:2] == (700, 1000)
    assert image[..., :3].std() > 0.1
    axes, bar = figure.axes
    assert figure.texts[0].get_text().startswith(f"{method.title}: ")
    assert figure.texts[1].get_text().startswith(f"{method.section}. Damped oscillator")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Φ = ω₀·dt (rad)", "damping ratio D")
    assert "r₁" in bar.get_ylabel()
    assert any(hatch for collection in axes.collections for hatch in getattr(collection, "hatches", ()))
    assert len(axes.texts) >= 2
    assert faults(figure) == []


def test_the_picture_of_an_own_method_names_no_section():
    @sw.method
    def own(s, t, h, v, y):
        return v + s.dv(t, v, y), y + s.dy(t, v, y)

    assert sw.charts.stability_map(own, size=8).plot().texts[1].get_text().startswith("Damped oscillator")


def test_lines_of_maps_are_at_the_limits_and_may_be_missing(false_euler, tmp_path):
    thick = next(c for c in false_euler.plot().axes[0].collections if max(np.atleast_1d(c.get_linewidth())) > 2)
    for path in thick.get_paths():
        phi, damping = path.vertices.T
        assert phi == pytest.approx(2 * (np.sqrt(1 + damping**2) - damping), abs=0.02)
    stable = sw.charts.stability_map("rk4", phi=(0.1, 0.2), damping=(0.5, 0.6), size=8)
    growing = sw.charts.stability_map("standard_euler", phi=(3, 4), damping=(0, 0.1), size=8)
    assert (stable.stable.all(), growing.stable.any()) == (True, False)
    for i, chart in enumerate((stable, growing)):
        chart.plot(tmp_path / f"{i}.png")
    assert growing.summary()[0]["stable_up_to"] == 0
    assert stable.summary()[0]["stable_up_to"] == pytest.approx(0.2)
    refused(ArgumentError, "expected an ending of a picture", stable.plot, tmp_path / "map.docx")
