"""Stability charts and the document's figures: data against closed forms, files and pictures."""

import dataclasses
import json
import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import stepwell as sw
from matplotlib.image import imread
from stepwell.errors import ArgumentError, DTypeError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.views.charts import curves_picture, figures_picture, style, zplane_picture
from stepwell.views.charts.zplane import ladder, largest
from support import ROOT
from support.charted import files_of, read
from support.families import family
from support.looks import faults
from support.refusals import refused
from support.truths import CLOSED_FORMS

METHODS = sw.methods()

#: p and q = r₁² of z² − 2pz + q, by Φ, worked out by hand (§5 to §11; of Runge-Kutta from its stability polynomial at iΦ).
CLOSED = {
    "standard_euler": (lambda f: 1 + 0 * f, lambda f: 1 + f**2),
    "damped_euler": (lambda f: 1 - f**2 / 2, lambda f: 1 + 0 * f),
    "false_euler": (lambda f: 1 - f**2 / 2, lambda f: 1 + 0 * f),
    "verlet": (lambda f: 1 - f**2 / 2, lambda f: 1 + 0 * f),
    "standard_heun": (lambda f: 1 - f**2 / 2, lambda f: 1 + f**4 / 4),
    "false_heun": (lambda f: 1 - 3 * f**2 / 4 + f**4 / 4, lambda f: 1 - f**2 / 2),
    "semi_false_heun": (lambda f: 1 - f**2 / 2, lambda f: 1 - f**4 / 4),
    "rk4": (lambda f: 1 - f**2 / 2 + f**4 / 24, lambda f: 1 - f**6 / 72 + f**8 / 576),
}

#: Where Ψ/Φ has which series, to two terms.
RATIOS = {
    "standard_euler": {2: -1 / 3, 4: 1 / 5},
    "damped_euler": {2: 1 / 24, 4: 3 / 640},
    "false_euler": {2: 1 / 24, 4: 3 / 640},
    "verlet": {2: 1 / 24, 4: 3 / 640},
    "standard_heun": {2: 1 / 6, 4: -1 / 20},
    "semi_false_heun": {2: -1 / 12, 4: 7 / 160},
}

LIMITS = {"standard_euler": 0.0, "damped_euler": 2.0, "false_euler": 2.0, "verlet": 2.0, "standard_heun": 0.0}
LIMITS |= {"false_heun": math.sqrt(2.0), "semi_false_heun": math.sqrt(2.0 * math.sqrt(5.0) - 2.0), "rk4": 2.0 * math.sqrt(2.0)}

EPS = np.finfo(float).eps


@pytest.fixture(scope="module")
def chart():
    return sw.charts.stability()


@pytest.fixture(scope="module")
def figures():
    return sw.charts.figures()


@pytest.fixture(scope="module")
def written(chart, figures, tmp_path_factory):
    """The pictures of all methods, each drawn once, and their files."""
    folder = tmp_path_factory.mktemp("pictures")
    draw = {kind: partial(chart.plot, kind=kind) for kind in ("loci", "curves")} | {"figures": figures.plot}
    return {name: (plot(folder / f"{name}.png"), folder / f"{name}.png") for name, plot in draw.items()}


def of(chart, name):
    return next(locus for locus in chart.loci if locus.method.name == name)


def lines(axes):
    """The lines of some axes that have points."""
    return [line.get_xydata() for line in axes.lines if len(line.get_xdata())]


def has_line(axes, x, y):
    """Whether one of the lines is just this, gaps included."""
    wanted = np.stack([x, y], axis=1)
    return any(line.shape == wanted.shape and np.array_equal(line, wanted, equal_nan=True) for line in lines(axes))


def check_page(figure, path):
    """The picture is written, and can be read."""
    height, width = imread(path).shape[:2]
    assert [width, height] == [round(figure.dpi * inches) for inches in figure.get_size_inches()]
    assert faults(figure) == []


def test_every_method_is_there_at_round_angles_or_those_that_are_given(chart, figures):
    assert [locus.method for locus in chart.loci] == [samples.method for samples in figures.samples] == list(METHODS)
    assert sorted(CLOSED) == sorted(set(CLOSED) & {method.name for method in METHODS})
    assert {0.5, 1.0, 1.5, 2.0, 2.5, 3.0} <= set(chart.phi.tolist())
    assert chart.phi[0] > 0
    assert chart.phi[-1] >= 1.1 * max(method.limit for method in METHODS if method.limit < math.inf)
    assert len(chart.phi) == 200 * chart.phi[-1]
    assert (largest([0.0]), largest([2.83, math.inf]), largest([3.4641])) == (2.5, 3.5, 4.0)
    assert ladder(0.001).tolist() == [0.001]
    few = sw.charts.stability(["rk4", "rk4"], phi=[0.5, 3.0])
    assert (len(few.loci), few.loci[0].stable.tolist()) == (1, [True, False])
    assert len(few.rows()) == 2


def test_the_eigenvalues_are_the_roots_of_the_documents_equation(chart):
    """Sum 2p and product q. An element of P is wrong by a few eps of its largest term, and the product by that times another."""
    # Ψ = atan2(√(q − p²), p), away from where both roots meet: there the root magnifies rounding.
    for name, closed in CLOSED.items():
        locus = of(chart, name)
        p, q = (f(locus.phi) for f in closed)
        z1, z2 = locus.eigenvalues
        rounding = 64 * EPS * np.maximum(1.0, locus.phi) ** 8
        assert (np.abs(z1 + z2 - 2 * p) <= rounding).all(), name
        assert (np.abs(z1 * z2 - q) <= rounding).all(), name
        assert (np.abs(z1) >= np.abs(z2) * (1 - 1e-9)).all(), name
        pair = z1.imag != 0
        assert pair.any(), name
        assert (np.abs(locus.r1_squared - q)[pair] <= rounding[pair]).all(), name
        assert np.array_equal(locus.r1_squared, np.abs(z1) ** 2), name
        pair = q - p**2 > 1e-3
        psi = np.arctan2(np.sqrt(q - p**2, where=pair, out=np.zeros_like(p)), p)
        assert pair.sum() > 100, name
        assert locus.ratio[pair] == pytest.approx(psi[pair] / locus.phi[pair], rel=1e-10), name
        assert set(np.round(locus.ratio * locus.phi, 12)[p**2 - q > 1e-3]) <= {0.0, round(math.pi, 12)}, name


def test_the_series_have_two_terms(chart):
    for name, terms in RATIOS.items():
        locus = of(chart, name)
        ratio = 1 + sum(c * locus.phi**k for k, c in terms.items())
        assert locus.ratio_series == pytest.approx(ratio, rel=1e-13), name
        # Here q has at most two powers of Φ besides 1, so the series of r₁² is q.
        assert locus.r1_squared_series == pytest.approx(CLOSED[name][1](locus.phi), rel=1e-13, abs=1e-13), name
        small = locus.phi <= 0.1
        # What is left out begins with Φ⁶, in no series with a coefficient above 1.
        assert (np.abs(locus.ratio - locus.ratio_series)[small] <= locus.phi[small] ** 6 + 1e-10).all(), name


def test_limits_and_what_happens_there(chart):
    for name, limit in LIMITS.items():
        locus = of(chart, name)
        assert locus.limit == pytest.approx(limit, abs=1e-12), name
        assert locus.samples_per_period == (pytest.approx(2 * math.pi / limit) if limit else math.inf), name
        assert np.array_equal(locus.stable, locus.phi < locus.limit * (1 - 1e-12)), name
        kind = "monotonic unstable" if name == "false_heun" else "unstable oscillation"
        row = next(row for row in chart.summary() if row["method"] == name)
        assert (locus.leaves, row["leaves_by"], row["limit"]) == (kind, kind, float(locus.limit)), name
    locus = of(chart, "false_euler")
    i = locus.phi.tolist().index(2.0)
    assert locus.eigenvalues[:, i].tolist() == [-1, -1]
    assert locus.kind[i] == "unstable oscillation (double eigenvalue -1)"
    assert not locus.stable[i]
    assert locus.stable[i - 1]


def test_what_cannot_be_charted_is_said(chart, tmp_path):
    for arguments, error, message in (
        ({"methods": ["rk44"]}, UnknownNameError, "did you mean 'rk4'"),
        ({"methods": "rk4"}, DTypeError, "methods: expected a list of names, got 'rk4'"),
        ({"methods": []}, ArgumentError, "methods: expected at least one, got none"),
        ({"phi": [0.0, 1.0]}, ArgumentError, "phi: expected numbers above zero in rad"),
        ({"phi": 1.0}, ShapeError, "phi: expected a list of angles in rad"),
        ({"phi": []}, (ShapeError, DTypeError), "phi: expected"),
        ({"phi": [1.0, 1.0]}, ArgumentError, "phi: expected angles that rise"),
    ):
        refused(error, message, sw.charts.stability, **arguments)
    for arguments, error, message in (
        ({"methods": ["rk44"]}, UnknownNameError, "did you mean 'rk4'"),
        ({"phi": -1.0}, ArgumentError, "phi: expected numbers above zero in rad"),
        ({"phi": [1.0]}, ShapeError, "phi: expected one number in rad"),
        ({"periods": 0}, ArgumentError, "periods: expected numbers above zero"),
        ({"phi": 1e-9}, ArgumentError, "periods: 4 periods with Φ = 1e-09 are 2.51e.10 steps, expected 100000 or fewer"),
    ):
        refused(error, message, sw.charts.figures, **arguments)
    with pytest.raises(ArgumentError, match="method: expected one of these figures, rk4, got 'verlet'"):
        sw.charts.figures(["rk4"]).plot(method="verlet")
    refused(UnknownNameError, "kind: there is no 'locus'; did you mean 'loci'", chart.plot, kind="locus")
    refused(ArgumentError, "expected an ending of a picture", chart.plot, tmp_path / "chart.docx")


def test_the_files_read_back_as_the_same_numbers(figures, tmp_path):
    chart = sw.charts.stability(phi=[0.5, 1.0, 3.0])
    chart.to_csv(tmp_path / "stability.csv")
    rows = read(tmp_path / "stability.csv")
    assert len(rows) == len(METHODS) * len(chart.phi)
    for locus in chart.loci:
        own = [row for row in rows if row["method"] == locus.method.name]
        columns = {"phi": locus.phi, "r1_squared": locus.r1_squared, "ratio": locus.ratio, "ratio_series": locus.ratio_series}
        columns |= {"z1_real": locus.eigenvalues[0].real, "z2_imag": locus.eigenvalues[1].imag}
        for name, values in (columns | {"r1_squared_series": locus.r1_squared_series}).items():
            assert [float(row[name]) for row in own] == values.tolist()
        assert [row["kind"] for row in own] == locus.kind.tolist()
        assert [row["stable"] == "True" for row in own] == locus.stable.tolist()
    figures.to_csv(tmp_path / "figures.csv")
    rows = read(tmp_path / "figures.csv")
    for samples in figures.samples:
        own = [row for row in rows if row["method"] == samples.method.name]
        for name, values in (("t", samples.t), ("v", samples.v), ("y", samples.y), ("exact", np.cos(samples.t))):
            assert [float(row[name]) for row in own] == values.tolist()
    for case in figures.harmonic:
        assert [float(row["y"]) for row in rows if row["method"] == case.name] == case.y.tolist()
    chart = sw.charts.stability(phi=[0.5, 1.0])
    _, whole = files_of(chart, tmp_path)
    assert len(whole["rows"]) == len(chart.rows())
    assert [row["method"] for row in whole["summary"]] == [method.name for method in METHODS]
    euler, rk4 = (next(row for row in whole["summary"] if row["method"] == name) for name in ("standard_euler", "rk4"))
    assert (euler["samples_per_period"], euler["r1_squared_minus_1"]) == (None, "Φ²")
    assert (rk4["r1_squared_minus_1"], rk4["frequency_deviation"]) == ("−Φ⁶/72 + Φ⁸/576", "−Φ⁴/120 + Φ⁶/336")
    _, whole = files_of(figures, tmp_path)
    assert (whole["phi"], len(whole["summary"]), len(whole["rows"])) == (0.5, len(METHODS), len(figures.rows()))


def panels(figure, chart):
    """The panel of each method, by name."""
    used = [axes for axes in figure.axes if axes.get_visible()]
    return {locus.method.name: axes for same, axes in zip(zplane_picture.groups(chart), used, strict=True) for locus in same}


@pytest.mark.parametrize("methods", [None, ["false_heun"], ["verlet", "rk4", "standard_euler"]], ids=str)
@pytest.mark.parametrize("kind", ["loci", "curves"])
def test_a_picture_is_whole(chart, written, kind, methods, tmp_path):
    figure, path = written[kind]
    if methods:
        chart, path = sw.charts.stability(methods), tmp_path / "chart.png"
        figure = chart.plot(path, kind=kind)
    check_page(figure, path)
    if not methods and kind == "curves":
        return  # of many methods, looked at below
    titles = [axes.get_title().splitlines() for axes in figure.axes if axes.get_visible() and axes.get_title()]
    shared = zplane_picture.groups(chart)
    names = [[c.method.title for c in same] if len(same) > 1 else [style.named(same[0].method)] for same in shared]
    assert [" ".join(title[:-1]) for title in titles] == [", ".join(each) for each in names]
    first = [same[0] for same in shared]
    limits = [(c.limit, c.method) for c in first]
    stable = ["every Φ" if method.is_implicit else f"Φ < {limit:.5g}" for limit, method in limits]
    assert [title[-1] for title in titles] == [
        f"stable for {each}" if limit else "never stable" for each, (limit, _) in zip(stable, limits, strict=True)
    ]


def test_what_is_the_same_shares_a_panel(chart):
    """Damped and False Euler, leapfrog and Verlet have p = 1 − Φ²/2 and q = 1 (§6 to §8); no two others are alike."""
    named = list(CLOSED_FORMS)
    chart = dataclasses.replace(chart, loci=tuple(locus for locus in chart.loci if locus.method.name in named))
    shared = [{locus.method.name for locus in same} for same in zplane_picture.groups(chart)]
    assert [same for same in shared if len(same) > 1] == [{"damped_euler", "false_euler", "leapfrog", "verlet"}]
    assert len(shared) == len(named) - 3
    never = sum(not LIMITS.get(locus.method.name, locus.limit) for locus in chart.loci)
    title = f"{never} of {len(named)} methods are never stable; 4 others have the same eigenvalues"
    assert zplane_picture.finding(chart) == title


def test_the_loci_are_the_eigenvalues_with_their_angles_and_where_they_leave(chart, written):
    figure, _ = written["loci"]
    assert zplane_picture.finding(chart) == figure.texts[0].get_text()
    first = {same[0].method.name for same in zplane_picture.groups(chart)}
    for name, axes in panels(figure, chart).items():
        locus = of(chart, name)
        drawn = np.concatenate(lines(axes)) @ [1, 1j]
        assert name not in first or np.isin(locus.eigenvalues.ravel(), drawn).all()
        circles = [patch for patch in axes.patches if getattr(patch, "radius", None) == 1.0]
        assert [circle.center for circle in circles] == [(0.0, 0.0)]
        assert axes.get_aspect() == 1.0
        texts = {text.get_text() for text in axes.texts}
        assert {"30°", "90°", "150°"} <= texts
        if name not in CLOSED:
            continue
        marks = np.concatenate([line.get_xydata() @ [1, 1j] for line in axes.lines if line.get_marker() == "D"])
        limit = LIMITS[name]
        p, q = (f(limit) for f in CLOSED[name])
        # A double root, as at Φ = 2, is moved by the root of the limit's rounding.
        for z in np.roots([1, -2 * p, q]) if limit else [1]:
            assert abs(abs(z) - 1) > 1e-6 or np.abs(marks - z).min() < 1e-6
        assert np.abs(np.abs(marks) - 1).max() < 1e-12
        dots = np.concatenate([line.get_xydata() @ [1, 1j] for line in axes.lines if line.get_marker() == "o"])
        for angle in (0.5, 1.0):
            p, q = (f(angle) for f in CLOSED[name])
            assert f"{angle:g}" in texts
            for z in (p + 1j * math.sqrt(q - p * p), p - 1j * math.sqrt(q - p * p)):
                assert np.abs(dots - z).min() < 1e-12


def test_branches_do_not_jump(chart):
    """Within a step of the ladder a line goes on by the locus' own speed, or by the root of a step where two roots part."""
    for locus in (of(chart, name) for name in CLOSED):
        short = np.searchsorted(locus.phi, 2.0)
        upper, lower = zplane_picture.branches(locus.eigenvalues[:, :short])
        assert np.array_equal(np.sort([upper, lower], axis=0), np.sort(locus.eigenvalues[:, :short], axis=0))
        assert (upper.imag >= lower.imag).all()
        for line in (upper, lower):
            assert np.abs(np.diff(line)).max() < 4 * math.sqrt(locus.phi[1] - locus.phi[0])


def test_the_curves_of_many_methods_share_two_panels(chart, written):
    """Of eight that are not the same; each ends at its limit, with a dot, and what keeps the energy is named below."""
    figure, _ = written["curves"]
    chosen = curves_picture.choose(zplane_picture.groups(chart))
    assert len(chosen) == curves_picture.MOST
    energy, turns = figure.axes
    drawn = {locus[0].method.name: locus[0] for locus in chosen}
    for name, locus in drawn.items():
        below = (locus.eigenvalues[0].imag != 0.0) & (locus.phi <= (locus.limit or np.inf))
        assert has_line(turns, locus.phi, np.where(below & (locus.ratio != 1.0), np.abs(locus.ratio - 1.0), np.nan)), name
        dots = [line.get_xdata()[0] for line in lines_of(turns) if len(line.get_xdata()) == 1]
        assert (float(locus.limit) in dots) is (0.0 < locus.limit <= locus.phi[-1])
    names = {text.get_text() for text in turns.texts}
    assert names == {locus.method.title for locus in drawn.values()}
    kept = {locus.method.title for locus in drawn.values()} - {text.get_text() for text in energy.texts}
    assert kept == {"False Euler", "PEFRL", "Implicit Midpoint"}
    assert all(name in figure.texts[-1].get_text() for name in kept)


def lines_of(axes):
    return [line for line in axes.lines if line.get_marker() == "o"]


def test_the_curves_of_few_methods_are_exact_and_series_with_the_limit():
    chart = sw.charts.stability(["standard_euler", "verlet", "false_heun", "rk4"])
    figure = chart.plot(kind="curves")
    for row, (locus, *_) in enumerate(zplane_picture.groups(chart)):
        radius, ratio = figure.axes[2 * row : 2 * row + 2]
        pair = locus.eigenvalues[0].imag != 0
        for axes, exact, series in (
            (radius, locus.r1_squared - 1, locus.r1_squared_series - 1),
            (ratio, locus.ratio, locus.ratio_series),
        ):
            assert has_line(axes, locus.phi, np.where(pair, exact, np.nan))
            assert has_line(axes, locus.phi, np.where(pair, np.nan, exact))
            assert has_line(axes, locus.phi, series)
            upright = [line[0, 0] for line in lines(axes) if len(line) == 2 and line[0, 0] == line[1, 0]]
            assert upright == ([float(locus.limit)] if 0.0 < locus.limit < math.inf else [])
        assert radius.get_yscale() == "symlog"
        assert any(patch.get_hatch() for patch in radius.patches)
    assert (figure.axes[0].get_ylabel(), figure.axes[1].get_ylabel()) == ("r₁² − 1", "Ψ/Φ")
    assert figure.axes[-1].get_xlabel() == "Φ = ω₀·dt (rad)"


def test_without_matplotlib_the_numbers_are_still_there(chart, figures, monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    for draw in (chart.plot, figures.plot, lambda: figures.plot(method="rk4"), lambda: figures.save(tmp_path / "no")):
        refused(UnsupportedError, r"pip install 'stepwell\[chart\]'", draw)
    assert not (tmp_path / "no").exists()
    chart.to_csv(tmp_path / "chart.csv")
    figures.to_csv(tmp_path / "figures.csv")


def test_the_samples_are_powers_of_the_transition_matrix_and_those_of_verlet_a_cosine(figures):
    for samples in figures.samples:
        if samples.method.carry:
            continue
        P = sw.analyse(sw.Oscillator(), samples.method, dt=0.5).P
        state = np.array([0.0, 1.0])
        for v, y in zip(samples.v, samples.y, strict=True):
            # Rounding of a step, carried on by a matrix whose powers stay below 300 in 51 steps.
            assert (v, y) == pytest.approx(tuple(state), abs=1e-11)
            state = P @ state
    samples = next(s for s in figures.samples if s.method.name == "verlet")
    psi = math.acos(1 - 0.5**2 / 2)
    assert samples.ratio == pytest.approx(psi / 0.5)
    # The document's start is y₋₁ = y₀ = 1, so the cosine is half a step late and as much larger. The other start gives cos kΨ.
    late = np.cos(psi * (np.arange(len(samples.y)) + 0.5)) / math.cos(psi / 2)
    assert samples.start == "first_order"
    assert samples.y == pytest.approx(late, abs=1e-12)
    assert np.abs(late - np.cos(psi * np.arange(len(late)))).max() > 0.2
    assert "y₋₁ = y₀" in figures.plot(method="verlet").texts[1].get_text()
    assert "y₋₁ = y₀" not in figures.plot(method="rk4").texts[1].get_text()


def test_the_harmonic_cases_of_section_4(figures, tmp_path):
    """12, 4 and 2.4 samples a period, of one amplitude: what is drawn of them are the numbers, and their cosine."""
    assert [(case.degrees, case.samples_per_period) for case in figures.harmonic] == [(30, 12.0), (90, 4.0), (150, 2.4)]
    for case in figures.harmonic:
        # Two periods, some ten to thirty steps of three roundings each.
        assert case.y == pytest.approx(np.cos(np.radians(case.degrees * np.arange(len(case.y)))), abs=1e-13)
        assert len(case.y) == 1 + math.ceil(2 * 360 / case.degrees)
    figure = figures.plot_harmonic(tmp_path / "harmonic.png")
    check_page(figure, tmp_path / "harmonic.png")
    for axes, case in zip(figure.axes, figures.harmonic, strict=True):
        dots = next(line for line in axes.lines if line.get_marker() == "o")
        assert np.array_equal(dots.get_ydata(), case.y)
        assert dots.get_xdata() == pytest.approx(np.arange(len(case.y)) * case.degrees / 360)
        assert f"{case.samples_per_period:g} samples per period" in axes.get_title(loc="left")
    assert sw.charts.figures(["rk4"]).harmonic == ()
    refused(ArgumentError, "harmonic cases of §4", sw.charts.figures(["rk4"]).plot_harmonic)


def test_the_figures_show_what_the_document_says(figures):
    """Standard Euler grows, the harmonic ones run ahead, Standard Heun grows slowly, the false Heuns are damped (§5 to §11)."""
    by = {samples.method.name: samples for samples in figures.samples}
    assert by["standard_euler"].r1_squared == pytest.approx(1.25)
    assert np.abs(by["standard_euler"].y).max() > 100
    for name in ("damped_euler", "false_euler", "verlet"):
        assert by[name].kind == "harmonic"
        assert by[name].ratio == pytest.approx(2 * math.asin(0.25) / 0.5)
        assert np.abs(by[name].y).max() < 1.04
    assert by["standard_heun"].r1_squared == pytest.approx(1 + 0.5**4 / 4)
    assert 1.3 < np.abs(by["standard_heun"].y).max() < 1.5
    for name, r1_squared in (("false_heun", 1 - 0.5**2 / 2), ("semi_false_heun", 1 - 0.5**4 / 4)):
        assert (by[name].kind, by[name].r1_squared) == ("damped oscillation", pytest.approx(r1_squared))
        assert np.abs(by[name].y[-13:]).max() < 0.85
    assert figures.samples[0].t[-1] >= 4 * 2 * math.pi > figures.samples[0].t[-2]


def test_files_of_the_figures_and_room_for_long_titles(figures, tmp_path):
    """One of each method and one of all, of a few methods."""
    few = sw.charts.figures(["standard_euler", "false_euler"])
    paths = few.save(tmp_path / "to" / "be")
    names = [path.name for path in paths]
    assert names == ["overview.png", "05-standard_euler.png", "07-false_euler.png", "figures.csv", "figures.json"]
    assert len(read(paths[-2])) == len(few.rows())
    assert len(json.loads(paths[-1].read_text(encoding="utf-8"))["rows"]) == len(few.rows())
    assert sorted(names) == sorted(path.name for path in (tmp_path / "to" / "be").iterdir())
    assert len({samples.file for samples in figures.samples}) == len(METHODS)
    method = SimpleNamespace(name="new_one", section="no section")
    assert dataclasses.replace(figures.samples[0], method=method).file == "99-new_one.png"
    figures = sw.charts.figures(["standard_euler", "false_euler", "verlet", "false_heun", "rk4"], phi=2.0)
    check_page(figures.plot(tmp_path / "overview.png"), tmp_path / "overview.png")
    text = figures.plot(method="false_euler").texts[2].get_text()
    assert "unstable oscillation (double eigenvalue -1)" in text


@pytest.mark.parametrize(
    "method", family(METHODS, lambda m: m.name in ("standard_euler", "false_heun", "verlet", "fehlberg"), lambda m: m.name)
)
def test_a_picture_of_one_method(figures, method, tmp_path):
    """Both curves are in it, and what grows is told."""
    samples = next(each for each in figures.samples if each.method is method)
    figure = figures.plot(tmp_path / "one.png", method=method.name)
    check_page(figure, tmp_path / "one.png")
    texts = [text.get_text() for text in figure.texts]
    assert f"{style.named(method)}: {figures_picture.in_words(samples)}" in texts
    sentence = next(text for text in texts if text.startswith("r₁² − 1 = "))
    change, turn = samples.r1_squared - 1, 100 * (samples.ratio - 1)
    change = "0" if abs(change) < 1e-13 else f"{change:+.3g}"
    assert sentence.startswith(f"r₁² − 1 = {change}, Ψ/Φ − 1 = {turn:+.3g} %: {samples.kind}".replace("-", "−"))
    # What grows does not look as if it stayed: Fehlberg's 8e-5 a step.
    assert ("unstable" in sentence) == change.startswith("+")
    axes = figure.axes[0]
    if np.abs(samples.y - np.cos(samples.t)).max() <= figures_picture.SEEN:  # what looks exact has the difference below
        assert np.array_equal(figure.axes[1].lines[1].get_ydata(), samples.y - np.cos(samples.t))
    else:
        assert len(figure.axes) == 1
    (dots,) = [line for line in axes.lines if line.get_marker() == "o"]
    assert np.array_equal(dots.get_xydata(), np.stack([samples.t / (2 * math.pi), samples.y], axis=1))
    assert any(np.allclose(line[:, 1], np.cos(2 * math.pi * line[:, 0])) for line in lines(axes) if len(line) > 100)
    assert axes.get_ylim() == (-2.2, 2.2)
    labels = [text.get_text() for text in axes.texts]
    assert labels == ([f"|y| up to {np.abs(samples.y).max():.3g}"] if np.abs(samples.y).max() > 2.2 else [])


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_a_figure_of_what_leaves_the_finite_numbers_is_still_drawn(tmp_path):
    figures = sw.charts.figures(["standard_euler", "false_heun"], phi=10.0, periods=500)
    assert not np.isfinite(figures.samples[0].y).all()
    figures.save(tmp_path)
    figures.to_json(tmp_path / "figures.json")


def test_the_pictures_of_the_docs_show_every_method(written):
    """A picture has as many rows of panels as its methods need: one that was drawn for fewer is not as high."""
    check_page(*written["figures"])
    for name, kind in (("stability-loci", "loci"), ("stability-curves", "curves"), ("figures", "figures")):
        size = imread(written[kind][1]).shape[:2]
        file = ROOT / "docs" / "images" / f"{name}.png"
        assert imread(file).shape[:2] == size, f"docs/images/{name}.png is older than the methods"
