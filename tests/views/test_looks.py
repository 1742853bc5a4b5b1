"""The look of charts: colours that stay apart to every eye and in print, labels off each other, titles that are true."""

import functools
import itertools
import random
import sys

import numpy as np
import pytest
import stepwell as sw
from PIL import Image
from stepwell.base.pictures import new_figure
from stepwell.views.charts import cheapest_picture, labels, style
from stepwell.views.charts.figures_picture import finding as figures_finding
from stepwell.views.charts.figures_picture import groups
from stepwell.views.charts.panel import Panel
from stepwell.views.charts.panel_picture import leader
from stepwell.views.charts.picture import finding
from stepwell.views.charts.runs_finding import finding as finding_of_run
from support import ROOT, stiff
from support.charted import _hasty_times  # noqa: F401
from support.covering import seed
from support.families import family
from support.looks import faults
from support.pictured import DRAWN, looked_at
from support.refusals import refused

#: Linear RGB as it is seen without green cones (Machado, Oliveira and Fernandes, 2009, severity 1).
DEUTERANOPE = np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]])

#: What half of all people see as two colours (Stone, Szafir and Setlur, 2014), in L*, a*, b*, of marks of a quarter of a
#: degree: a marker of 7.5 points, 2.6 mm, from 60 cm away.
SIZE = 0.25
SEEN = 0.5 * np.array([10.16 + 1.50 / SIZE, 10.68 + 3.08 / SIZE, 10.70 + 5.74 / SIZE])


def linear(colour):
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(light):
    """CIELAB of linear sRGB, for daylight D65."""
    to_xyz = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    xyz = np.array(to_xyz) @ light / [0.95047, 1.0, 1.08883]
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


EYES = {
    "normal": lambda c: lab(linear(c)),
    "deuteranope": lambda c: lab(np.clip(DEUTERANOPE @ linear(c), 0.0, 1.0)),
    "grey": lambda c: lab(linear(c)) * [1.0, 0.0, 0.0],
}


def least(eye, colours):
    """The least distance of two colours, in those that half of all people see."""
    seen = [EYES[eye](colour) for colour in colours]
    return min(float(np.linalg.norm((a - b) / SEEN)) for a, b in itertools.combinations(seen, 2))


def test_families_and_the_methods_of_one_are_told_apart():
    """To each eye; beside which no names stand are the four methods of a control chart, two of which are Euler's."""
    methods = [sw.method(name) for name in ("standard_euler", "false_euler", "standard_heun", "rk4")]
    for eye in EYES:
        assert least(eye, style.FAMILIES.values()) > 1.0, eye
        assert least(eye, [style.apart(methods, method)["color"] for method in methods]) > 1.0, eye
    assert style.look(methods[0])["color"] == style.look(methods[1])["color"]  # which is what would merge them
    assert style.apart(methods[1:], methods[1])["color"] == style.FAMILIES["Euler"]


@pytest.mark.mutant
def test_colours_that_merge_are_noticed():
    """Red and green of one lightness are alike in grey, and nearly so without green cones."""
    assert lab(np.ones(3)) == pytest.approx([100.0, 0.0, 0.0], abs=0.02)
    assert least("normal", ["#c75a22", "#578a2c"]) > 1.0
    assert least("grey", ["#c75a22", "#578a2c"]) < 1.0
    assert least("deuteranope", ["#a08020", "#8f8a20"]) < 1.0


def test_every_method_has_the_colour_of_its_family_and_pale_text_is_darkened():
    of = {method.name: style.family(method) for method in sw.methods()}
    assert set(of.values()) == set(style.FAMILIES)
    assert of["false_euler"] == "Euler"
    assert of["verlet"] == of["leapfrog"] == "leapfrog"
    assert of["merson"] == of["rk4"] == "Runge-Kutta"
    assert of["semi_false_heun"] == "Heun"
    assert all(style.look(method)["color"] == style.FAMILIES[of[method.name]] for method in sw.methods())
    for name, colour in style.FAMILIES.items():
        rgb = tuple(int(style.ink(colour)[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
        assert style.contrast(rgb) >= style.CONTRAST, name
    assert style.ink(style.FAMILIES["Runge-Kutta"]) == style.FAMILIES["Runge-Kutta"]
    assert style.ink(style.FAMILIES["Euler"]) != style.FAMILIES["Euler"]
    assert style.contrast((0.0, 0.0, 0.0)) == pytest.approx(21.0)  # of black and white, by definition


def test_labels_lie_in_the_axes_and_not_on_each_other():
    figure = new_figure(6.0, 4.0)
    axes = figure.add_axes((0.1, 0.1, 0.85, 0.85))
    axes.set(xscale="log", yscale="log", xlim=(1.0, 1e4), ylim=(1e-8, 1.0))
    x = np.geomspace(1.0, 1e4, 30)
    curves = [labels.Label(f"a curve of order {p:.2f}", np.array([x, x**-p]).T, {"size": 11}) for p in np.linspace(1.0, 1.2, 9)]
    left = labels.beside(axes, curves)
    boxes = [text.get_window_extent() for text in axes.texts]
    assert len(boxes) + len(left) == 9
    assert len(boxes) > 4
    frame = axes.get_window_extent()
    for i, box in enumerate(boxes):
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1
        assert frame.y0 <= box.y0 < box.y1 <= frame.y1
        assert not any(box.overlaps(other) for other in boxes[:i])
    # Where there is room for none, all are returned.
    narrow = figure.add_axes((0.0, 0.0, 0.05, 0.05), xlim=(1.0, 1e4), ylim=(1e-8, 1.0), xscale="log", yscale="log")
    assert labels.beside(narrow, curves) == [label.text for label in curves]
    assert not narrow.texts
    figure = new_figure(6.0, 4.0)
    axes = figure.add_axes((0.1, 0.1, 0.6, 0.8))
    axes.set(yscale="log", ylim=(1e-3, 1.0), xlim=(0.0, 1.0))
    ends = [(1.0, y, f"curve {i}", "#000000") for i, y in enumerate((0.5, 0.51, 0.9, 0.95, 2e-3))]
    labels.at_ends(axes, ends, 10.0, 0.08)
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts}
    assert len(boxes) == 5
    heights = [boxes[f"curve {i}"].y0 for i in (4, 0, 1, 2, 3)]
    assert heights == sorted(heights)
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes.values(), 2))
    frame = axes.get_window_extent()
    assert all(frame.x1 <= box.x0 and frame.y0 <= box.y0 and box.y1 <= frame.y1 for box in boxes.values())


def test_the_title_is_what_the_front_says():
    chart = sw.charts.work_precision("oscillator", ["false_euler", "rk4"], [20, 100, 1000, 10_000], tolerances=[])
    best = [chart.best(10.0**-digits) for digits in range(1, 20)]
    names = [row["method"] for row in best if row is not None]
    digits = [i + 1 for i, name in enumerate(names) if name == "rk4"]
    assert len(digits) > len(names) / 2
    assert finding(chart) == f"Runge-Kutta 4 is the cheapest for {digits[0]} to {digits[-1]} digits"
    assert finding(chart) in chart.plot().texts[0].get_text()
    useless = sw.charts.work_precision("oscillator", ["standard_euler"], [20], tolerances=[])
    assert finding(useless) == "no method has a digit right"
    chart = sw.charts.work_precision("kepler", ["merson"], [200, 1000, 4000], tolerances=[1e-3, 1e-5, 1e-7])
    assert {row["method"] for row in chart.front()} == {"merson, tolerance"}  # by a factor of ten: the orbit has one near point
    assert finding(chart).startswith("RK-Merson with a tolerance is the cheapest for 1 to ")
    panel = sw.charts.panel(["kepler"], methods=["merson"], steps=[200, 1000, 4000], tolerances=[1e-3, 1e-5, 1e-7])
    assert leader(panel).startswith("RK-Merson with a tolerance is the cheapest in ")
    fixed = sw.charts.work_precision("kepler", ["merson"], [4000, 16_000], tolerances=[])
    assert finding(fixed).startswith("RK-Merson is the cheapest for ")


def test_the_title_is_of_the_error_that_is_drawn():
    """By state error PEFRL is not the cheapest in a case in which it is by energy error, so the two titles cannot be one."""
    chart = sw.charts.work_precision("oscillator", ["pefrl", "fehlberg_5"], [20, 100, 300, 1000, 10_000], tolerances=[])
    titles = {}
    for error in ("state_error", "energy_error"):
        front = chart.front(error)
        names = [next((row["method"] for row in front if row["error"] <= 10.0**-d), None) for d in range(1, 20)]
        names = [name for name in names if name is not None]
        winner = max(set(names), key=names.count)
        titles[error] = finding(chart, error)
        assert titles[error].startswith(sw.method(winner).title)
        assert titles[error] in chart.plot(error=error).texts[0].get_text()
    assert titles["energy_error"].endswith(" digits of the energy")
    assert titles["state_error"].endswith(" digits")
    panel = sw.charts.panel(["oscillator"], methods=["pefrl", "rk4"], steps=[20, 100, 1000], tolerances=[])
    assert leader(panel, "energy_error") + ": what an error of the energy costs, scene by scene" in [
        text.get_text() for text in panel.plot(error="energy_error").texts
    ]


@pytest.mark.parametrize("name", family([scene.name for scene in sw.scenes.scenes()], DRAWN.__contains__))
def test_a_run_is_drawn_in_one_line(name, tmp_path):
    scene = sw.scenes.scene(name)
    run = scene.run("rodas4", tolerance=1e-6, every=1) if name in stiff.SCENES else scene.run("rk4", steps=3, every=1)
    figure = run.plot(tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 10_000
    title = f"{scene.system.kind_name} by {run.method.title}: "
    (whole,) = [text.get_text() for text in figure.texts if text.get_text().startswith(title)]
    assert len(whole) > len(title) + 5


def drawn_points(axes, label):
    line = next(line for line in axes.lines if line.get_label() == label)
    return np.sort_complex(line.get_xdata() + 1j * line.get_ydata())


def test_an_analysis_is_drawn_in_one_line(tmp_path):
    """Standard Euler's roots are 1 ± iΦ, outside the circle; the exact ones are e^(±iΦ)."""
    one = sw.analyse(sw.Oscillator(), "standard_euler", dt=0.5)
    figure = one.plot(tmp_path / "roots.png")
    assert (tmp_path / "roots.png").stat().st_size > 10_000
    assert figure.texts[0].get_text() == "Standard Euler, dt = 0.5: unstable oscillation"
    np.testing.assert_array_equal(drawn_points(figure.axes[0], "growing samples"), [1.0 - 0.5j, 1.0 + 0.5j])
    # e^z of one rounding in z and a few of its own.
    np.testing.assert_allclose(drawn_points(figure.axes[0], "exact"), np.exp([-0.5j, 0.5j]), rtol=0, atol=1e-15)
    assert not any(line.get_label() == "bounded samples" for line in figure.axes[0].lines)
    # False Euler is stable below Φ = 2 and not above.
    figure = sw.analyse(sw.Oscillator(), "false_euler", dt=[0.5, 1.5, 2.5]).plot()
    assert figure.texts[0].get_text() == "False Euler: 2 of 3 stable"
    assert len(drawn_points(figure.axes[0], "bounded samples")) == 4
    far = sw.analyse(sw.Oscillator(), "false_euler", dt=30.0).plot()
    assert "Not in the picture: 1 of 2." in far.texts[-1].get_text()  # the other root is near 0: their product is 1
    refused(sw.errors.ArgumentError, "expected an ending of a picture", one.plot, "roots.doc")


def test_advice_is_drawn_in_one_line(tmp_path):
    methods = ["leapfrog", "pefrl", "rk4", "merson", "fehlberg_5", "dop853"]
    advice = sw.advise("oscillator", tolerance=1e-3, methods=methods, cost="evaluations")
    figure = advice.plot(tmp_path / "advice.png")
    assert (tmp_path / "advice.png").stat().st_size > 10_000
    (axes,) = figure.axes
    marks = [line for line in axes.lines if line.get_marker() not in ("None", "", None) and len(line.get_xdata()) == 1]
    points = {(float(line.get_xdata()[0]), float(line.get_ydata()[0])) for line in marks}
    assert points == {(row.evaluations_per_frame, row.error) for row in advice.ranked}
    assert all(error <= advice.tolerance for _, error in points)
    assert any(np.array_equal(line.get_ydata(), [1e-3, 1e-3]) for line in axes.lines)
    best = advice.ranked[0]
    assert best.method.title in figure.texts[0].get_text()
    # No name is on another, on the line, or outside.
    names = [text.get_window_extent() for text in axes.texts[1:]]
    assert len(names) >= 3
    frame, line = axes.get_window_extent(), axes.transData.transform((1.0, 1e-3))[1]
    for i, box in enumerate(names):
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1
        assert frame.y0 <= box.y0 < box.y1 < line
        assert not any(box.overlaps(other) for other in names[:i])
    nothing = sw.advise("oscillator", tolerance=1e-3, methods=["standard_euler"], cost="evaluations", budget=1e-12)
    refused(sw.errors.ArgumentError, r"plot: expected advice with a method that is good enough.*Nothing fits", nothing.plot)


def test_what_cannot_be_drawn_is_said(monkeypatch):
    batch = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=[1.0, 2.0], dt=0.1, steps=5, every=1)
    refused(sw.errors.ArgumentError, r"expected a run of one member, got a batch of shape \(2,\)", batch.plot)
    with pytest.raises(sw.errors.ArgumentError, match="expected two saved states or more, got 1; run with every="):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=5).plot()
    analysis = sw.analyse(sw.Oscillator(), "rk4", dt=0.5)
    advice = sw.advise("oscillator", tolerance=1e-3, methods=["rk4"], cost="evaluations")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for draw in (analysis.plot, advice.plot):
        refused(sw.errors.UnsupportedError, r"pip install 'stepwell\[chart\]'", draw)


#: The document's methods and those of professionals; a method that is added gains or loses what it does.
COUNTED = [
    "standard_euler", "damped_euler", "false_euler", "verlet", "leapfrog", "standard_heun", "false_heun", "semi_false_heun",
    "rk4", "pefrl", "merson", "fehlberg", "fehlberg_5", "dop853", "taylor",
]  # fmt: skip


def test_the_title_of_the_figures_counts_what_the_methods_do():
    """With Φ = 0.5 Standard Euler (§5) and Standard Heun (§9) grow, two Heuns decay (§10, §11); the §7 and §8 turn too fast."""
    chart = sw.charts.figures(COUNTED)
    apart, exact = groups(chart)
    assert [sorted(samples.method.name for samples in same) for same in apart if len(same) > 1] == [
        ["damped_euler", "false_euler", "leapfrog", "verlet"]
    ]
    assert all(samples.method.order >= 4 for samples in exact)
    assert all(abs(samples.y - np.cos(samples.t)).max() < 0.05 for samples in exact)
    title = f"Of {len(COUNTED)} methods 2 gain energy, 2 lose it, 4 keep the amplitude but not the time, {len(exact)} look exact"
    assert figures_finding(chart) == title
    assert title in [text.get_text() for text in chart.plot().texts]
    # At Φ = 2 the four have a double eigenvalue −1, and grow, although r₁ is 1.
    assert "keep the amplitude" not in figures_finding(sw.charts.figures(["false_euler", "leapfrog"], phi=2.0))


def seen(name, method, **options):
    return looked_at(sw.scenes.scene(name), method, **options).plot()


@functools.cache
def few_charts():
    options = {"methods": ["leapfrog", "rk4", "dop853"], "steps": [40, 200, 1000, 5000], "tolerances": [1e-6, 1e-10]}
    charts = [sw.charts.work_precision(name, **options) for name in ("oscillator", "clover", "forced_oscillator")]
    return Panel((*charts, *charts))


CUBE = sw.TransferFunction(4.0, [1.0, 3.0, 3.0, 1.0])


#: A picture of each kind, by a name; those of other runs are in tests/views/test_run_pictures.py.
PICTURES = {
    "run of rods": lambda: seen("double_pendulum", "rk4", steps=300),
    "run that hangs": lambda: seen("conical_pendulum", "rk4"),
    "run of a net": lambda: seen("rope_bridge", "leapfrog", every=20),
    "run under control": lambda: seen("clover", "standard_euler", control=sw.EnergyControl(1.0)),
    "chart": lambda: few_charts().charts[2].plot(),
    "panel": lambda: few_charts().plot(),
    "control": lambda: sw.charts.control("kepler", evaluations=600, relative=[1e-3, 1e-2, 0.1, 1.0, 10.0]).plot(),
    "control of rods": lambda: sw.charts.control("conical_pendulum", evaluations=[100, 400], relative=[0.01, 0.1, 1]).plot(),
    "norm": lambda: sw.charts.norm().plot(),
    "figures": lambda: sw.charts.figures().plot(),
    "figure of one that looks exact": lambda: sw.charts.figures(["rk4"]).plot(method="rk4"),
    "bode": lambda: sw.charts.bode(sw.Oscillator(1.0, 0.1), dt=0.5).plot(),
    "bode of samples": lambda: sw.charts.bode(CUBE, ["standard_euler", "rk4"], dt=0.3, x="hold").plot(),
    "friction": lambda: sw.charts.verlet_friction().plot(),
    "map": lambda: sw.charts.stability_map("merson").plot(),
    "loci": lambda: sw.charts.stability(COUNTED, phi=np.linspace(0.05, 3.0, 60)).plot(),
    "curves": lambda: sw.charts.stability(COUNTED, phi=np.linspace(0.05, 7.0, 200)).plot(kind="curves"),
    "curves of two": lambda: sw.charts.stability(["rk4", "verlet"], phi=np.linspace(0.05, 3.0, 60)).plot(kind="curves"),
}


#: Of those that differ in their system alone, one is drawn by the seed.
ALIKE = [
    ("run of rods", "run that hangs", "run of a net", "run under control"),
    ("control", "control of rods"),
    ("curves", "curves of two"),
]
LEFT = {name for names in ALIKE for name in names if name != random.Random(seed()).choice(names)}


@pytest.mark.parametrize("picture", family(PICTURES, lambda name: name not in LEFT))
def test_a_picture_is_read_where_pages_show_it(picture):
    """Its letters have 9 pixels at the width of a page and contrast, none is on another, no panel is empty, nothing is Python."""
    assert faults(PICTURES[picture]()) == []


def broken(break_it):
    """A picture that is right but for one thing."""
    figure = new_figure(8.0, 4.5)
    axes = figure.add_axes((0.1, 0.1, 0.85, 0.75))
    axes.plot(np.linspace(0.0, 1.0, 50), np.linspace(0.0, 1.0, 50) ** 2, label="curve")
    axes.grid()
    assert faults(figure) == []
    break_it(figure, axes)
    return faults(figure)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("break_it", "said"),
    [
        (lambda figure, axes: axes.text(0.1, 0.8, "small", size=6), "'small' has 7.7 pixels"),
        (lambda figure, axes: axes.text(0.1, 0.8, "pale", color="#efb02e"), "'pale' is too pale"),
        (lambda figure, axes: axes.text(0.9, 0.8, "a text that is too long"), "leaves the picture"),
        (lambda figure, axes: (axes.text(0.1, 0.8, "one"), axes.text(0.1, 0.81, "two")), "'two' is on 'one'"),
        (lambda figure, axes: figure.text(0.1, 0.9, "Rods([1.0, 1.0], gravity=1.0)"), "is Python"),
        (lambda figure, axes: figure.text(0.1, 0.9, "gravity=array(3,)"), "is Python"),
        (lambda figure, axes: figure.add_axes((0.4, 0.2, 0.2, 0.2)), "is empty"),
        (
            lambda figure, axes: (axes.grid(False), axes.set_position((0.1, 0.1, 0.2, 0.2)), axes.locator_params(nbins=2)),
            "are blank",
        ),
        (
            lambda figure, axes: ([axes.plot([0, 1], [0, i], label=i) for i in range(9)], axes.legend(ncols=9, labelspacing=0.1)),
            "10 names",
        ),
    ],
)
def test_a_picture_that_breaks_a_rule_is_noticed(break_it, said):
    assert any(said in fault for fault in broken(break_it)), broken(break_it)


def test_the_table_of_the_cheapest_is_the_front():
    panel = few_charts()
    figure = panel.plot()
    texts = [text.get_text() for text in figure.axes[0].texts]
    for chart in panel.charts[:3]:
        for cell in cheapest_picture.cells(chart, "state_error"):
            best = chart.best(10.0**-cell.digits)
            assert (cell.name, cell.cost) == (best["method"], best["cost"])
            assert cheapest_picture.number(cell.cost) in texts
    numbers = {2.104: "2.1", 36.9: "37", 1229.6: "1230", 12_345.0: "12k", 2.5e6: "2.5M"}
    assert {cost: cheapest_picture.number(cost) for cost in numbers} == numbers


def late(picture):
    """The share of a period by which the title says that a run is late; below zero of one that is early."""
    said = finding_of_run(picture)
    assert said.startswith("on the exact orbit, but ")
    share, word = said.removeprefix("on the exact orbit, but ").split(" % of a period ")
    return float(share) / 100.0 * {"late": 1.0, "early": -1.0}[word]


def test_a_run_that_stays_on_the_orbit_says_by_how_much_it_is_early_or_late():
    """Kepler's ellipse: the phase of the last state by its own position, from the mean anomaly E − e·sin E."""
    scene = sw.scenes.kepler()
    run = scene.run("rk4", every=1)
    e, r, far = 0.9, run.y[-1, 1] - run.y[-1, 0], scene.y[1] - scene.y[0]
    cosine, sine = r @ far / (far @ far), (far[0] * r[1] - far[1] * r[0]) / (far @ far)
    anomaly = np.arctan2(sine * (1 - e) / np.sqrt(1 - e * e), cosine * (1 - e) + e)
    turns = (anomaly - e * np.sin(anomaly)) / (2 * np.pi)  # since the perihelion, in the direction of the motion
    assert far[0] * (scene.v[1] - scene.v[0])[1] > 0.0
    ahead = turns - (run.t[-1] / scene.period - round(run.t[-1] / scene.period))
    assert late(sw.charts.run_picture(scene, run)) == pytest.approx(-ahead, rel=0.05)
    # Leapfrog is late by ω³h²/24 a unit of time on a circle: of 2π·N turns with ω = 1 by the share h²/24 of a period each.
    circle = sw.scenes.kepler(0.0)
    run = circle.run("leapfrog", 0.15, every=1)
    whole = sw.charts.run_picture(circle, run)
    near = np.linspace(-0.05, 0.05, 2001) * circle.period
    v, y = circle.exact(run.t[-1] - near)
    del v
    behind = near[np.argmin(((y - run.y[-1]) ** 2).sum(axis=(1, 2)))] / circle.period
    assert abs(behind) > 2e-3
    assert late(whole) == pytest.approx(behind, abs=3e-4)
    assert finding_of_run(sw.charts.run_picture(circle, circle.run("leapfrog", 0.02, every=1))).startswith("the exact motion to ")


def test_the_first_picture_begins_with_the_state_that_shows_its_finding():
    """Previews show the first frame, which is the last state; it moves for eight seconds, and is a small file."""
    for page in ("light", "dark"):
        path = ROOT / "docs" / "images" / f"energy-control-{page}.gif"
        assert path.stat().st_size <= 1.5e6
        frames, spent = {}, 0.0
        with Image.open(path) as moving:
            for i in range(moving.n_frames):
                moving.seek(i)
                spent += moving.info["duration"] / 1000.0
                if i in (0, 1, moving.n_frames - 1):
                    frames[i] = np.asarray(moving.convert("RGB"))
        first, second, last = frames.values()
        assert 7.0 <= spent <= 9.0
        np.testing.assert_array_equal(first, last)
        assert (first != second).any(axis=2).mean() > 0.01
        assert first.shape[1] == 736
