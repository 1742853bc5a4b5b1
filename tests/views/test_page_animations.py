"""Animations as pages: what is in them is what was computed, they are small, and need nothing from elsewhere."""

import json
import math
import re
import sys
import time

import numpy as np
import pytest
import stepwell as sw
from stepwell.views.charts import page_animation, run_picture
from stepwell.views.charts.run_panels import FALLING
from stepwell.views.charts.runs import own_picture
from stepwell.views.charts.solids import solid_of
from support import stiff
from support.abroad import executed
from support.explored import needs_node

DECODING = """
const { readFileSync } = require("node:fs");
const unpacked = unpack(JSON.parse(readFileSync("animation.json", "utf8")));
const plain = (key, value) => value instanceof Float64Array ? Array.from(value, (x) => Number.isNaN(x) ? null : x) : value;
console.log(JSON.stringify(unpacked, plain));
"""


def data_of(page):
    """What the page is filled with."""
    (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(data)


def in_node(data, folder, change=("", "")):
    """The data as the page's own script decodes them."""
    script = (page_animation.WEB / "animation.js").read_text(encoding="utf-8")
    assert change[0] in script
    (folder / "run.js").write_text(script.replace(*change) + DECODING, encoding="utf-8")
    (folder / "animation.json").write_text(json.dumps(data), encoding="utf-8")
    return json.loads(executed(["node", "run.js"], folder))


def numbers(values):
    return np.array([math.nan if value is None else value for value in values])


def shown(chart, unpacked):
    """The saved states that are in an animation: those nearest to its times."""
    t = numbers(unpacked["t"])
    at = np.abs(chart.run.t[:, np.newaxis] - t).argmin(axis=0)
    assert len(set(at.tolist())) == len(at)
    return at


def off(values, encoding):
    """How far decoded numbers may be off: half a step of the codes, and three roundings of the numbers themselves."""
    return 0.5 * encoding["step"] + 3.0 * np.abs(values).max() * 2.0**-53


def test_codes_are_off_by_half_a_step():
    values = np.array([-1.0, math.nan, 0.123456, 2.0, math.inf])
    encoding = page_animation.encoded(values)
    assert (encoding["low"], encoding["step"]) == (-1.0, 3.0 / 65534)
    assert page_animation.encoded(np.array([5.0, 5.0]))["low"] == 5.0
    assert page_animation.encoded(np.array([math.nan])) == {"low": 0.0, "step": 1.0, "codes": "//8="}


@needs_node
@pytest.mark.parametrize("name", ["figure_eight", "arenstorf", "double_pendulum", "jelly_cube", "plummer", "conical_pendulum"])
def test_places_in_a_page_are_the_states(name, tmp_path):
    scene = sw.scenes.scene(name)
    chart = own_picture(scene.run("rk4", steps=60, every=1))
    data = page_animation.data(chart, 3.0, 20.0)
    unpacked = in_node(data, tmp_path)
    at = shown(chart, unpacked)
    (panel, coded) = (unpacked["panels"][0], data["panels"][0])
    places = chart.places[at]
    expected = FALLING.flat(places) if panel["name"].startswith("seen from the front") else places[..., :2]
    decoded = numbers(panel["values"]).reshape(expected.shape)
    assert np.abs(decoded - expected).max() <= off(expected, coded["data"])
    assert coded["data"]["step"] <= 1e-4 * np.ptp(expected)  # four digits of what is seen
    springs = getattr(scene.system, "pairs", None)
    if springs is not None:
        np.testing.assert_array_equal(np.array(panel["links"]), springs)


ARRANGING = """
const panels = JSON.parse(require("node:fs").readFileSync("panels.json", "utf8"));
console.log(JSON.stringify([390, 1000].map((width) => ({ size: arranged(panels, width), places: panels.map((p) => p.place) }))));
"""


@needs_node
@pytest.mark.parametrize("name", ["clover", "rope_bridge", "aircraft", "chain", "oscillator"])
def test_on_a_phone_panels_are_below_each_other(name, tmp_path):
    """Each as wide as the page, in units of about a pixel, so that a text of 13 to 15 of them is read."""
    scene = sw.scenes.scene(name)
    panels = page_animation.data(run_picture(scene, scene.run("rk4", steps=30, every=1)), 3.0, 20.0)["panels"]
    script = (page_animation.WEB / "animation.js").read_text(encoding="utf-8")
    (tmp_path / "run.js").write_text(script + ARRANGING, encoding="utf-8")
    (tmp_path / "panels.json").write_text(json.dumps(panels), encoding="utf-8")
    phone, wide = json.loads(executed(["node", "run.js"], tmp_path))
    assert phone["size"]["width"] == 400
    bottom = 0.0
    for left, top, width, height in phone["places"]:
        assert top > bottom
        assert width > 0.8
        assert left + width <= 1.0
        bottom = top + height
    assert bottom <= 1.0
    assert wide["places"] == [list(panel["rect"]) for panel in panels]


def test_a_page_is_light_and_dark_and_says_no_code():
    chart = run_picture("rope_bridge", sw.scenes.rope_bridge().run("leapfrog", every=1))
    page = page_animation.page(chart, 10.0, 20.0)
    assert ':root[data-theme="dark"]' in page
    assert 'matchMedia("(prefers-color-scheme: dark)")' in page
    assert re.fullmatch(
        r"720 steps of 0\.00416667\.( \d+ of 721 saved states, and straight lines between them\.)?", data_of(page)["about"]
    )


@pytest.mark.mutant
@needs_node
def test_a_page_that_decodes_wrongly_is_noticed(tmp_path):
    chart = own_picture(sw.scenes.figure_eight().run("rk4", steps=60, every=1))
    data = page_animation.data(chart, 3.0, 20.0)
    wrong = in_node(data, tmp_path, ("256 * bytes", "255 * bytes"))
    decoded = numbers(wrong["panels"][0]["values"]).reshape(61, 3, 2)
    assert np.abs(decoded - chart.places).max() > 2.0 * off(chart.places, data["panels"][0]["data"])


@needs_node
@pytest.mark.parametrize("name", ["oscillator", "chain", "dzhanibekov", "aircraft"])
def test_other_views_hold_the_states_and_errors(name, tmp_path):
    scene = sw.scenes.scene(name)
    chart = run_picture(scene, scene.run("rk4", steps=50, every=1))
    data = page_animation.data(chart, 3.0, 20.0)
    unpacked = in_node(data, tmp_path)
    at = shown(chart, unpacked)
    first, coded = unpacked["panels"][0], data["panels"][0]
    if name == "oscillator":
        line = first["lines"][-1]
        expected, decoded, codes = chart.run.y[at], numbers(line["values"]), coded["lines"][-1]["data"]
    elif name == "chain":
        expected, decoded, codes = chart.run.y[at].ravel(), numbers(first["values"]), coded["data"]
    else:
        turned = solid_of(chart).matrices[..., at]
        expected, decoded, codes = np.moveaxis(turned, -1, 0).ravel(), numbers(first["values"]), coded["data"]
    assert np.abs(decoded - expected).max() <= off(expected, codes)
    if chart.state_error is not None:
        line = unpacked["panels"][-1]["lines"][0]
        known = numbers(line["values"])
        with np.errstate(divide="ignore"):
            powers = np.log10(chart.state_error[at])
        assert np.isfinite(known).sum() > 40
        good = np.isfinite(known)
        assert np.abs(known - powers)[good].max() <= off(known[good], data["panels"][-1]["lines"][0]["data"])


@pytest.mark.parametrize("scene", sw.scenes.scenes(), ids=lambda scene: scene.name)
def test_every_scene_is_a_small_page_at_once(scene, tmp_path):
    steps = min(300, round(scene.horizon / scene.dt))
    run = scene.run("rosenbrock23" if scene.name in stiff.SCENES else "rk4", steps=steps, every=1)
    began = time.process_time()
    run.animate(tmp_path / "run.html")
    assert time.process_time() - began < 2.0
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert len(page.encode()) <= 200_000
    assert "http" not in page
    assert "src=" not in page
    data = data_of(page)
    assert data["seconds"] == 10.0
    assert {panel["type"] for panel in data["panels"]} <= {"points", "series", "rows", "solid"}


def test_the_largest_pages_are_small():
    """The most of everything: a net, five bodies with exact curves, and a run of more states than a page holds."""
    scene = sw.scenes.figure_eight()
    run = scene.run("leapfrog", dt=scene.dt / 10, every=1)
    assert len(page_animation.page(run_picture(scene, run), 10.0, 20.0).encode()) <= 200_000
    net = sw.scenes.cloth()
    page = page_animation.page(own_picture(net.run("leapfrog", every=2)), 10.0, 20.0)
    assert len(page.encode()) <= 200_000
    assert data_of(page)["between"]
    assert "saved states, and straight lines between them" in data_of(page)["about"]


def test_a_diverged_run_is_shown_as_far_as_it_is_finite():
    scene = sw.scenes.oscillator()
    with pytest.warns(sw.DivergenceWarning):
        run = scene.run("standard_euler", 100.0, steps=400, every=1)
    data = page_animation.data(own_picture(run), 10.0, 20.0)
    assert f"Diverged at step {int(run.first_bad_step)}" in data["about"]
    assert len(data["t"]["codes"]) < 400 * 2 * 4 / 3


def test_a_page_needs_no_matplotlib_and_no_other_text_becomes_script(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    run = sw.scenes.clover().run("leapfrog", every=5)
    run.animate(tmp_path / "run.html", seconds=2)
    own = sw.Scene(sw.Oscillator(), v=0.0, y=1.0, dt=0.1, horizon=3.0, title="</script><b>DATA")
    page = page_animation.page(run_picture(own, own.run("rk4", every=1)), 10.0, 20.0)
    assert "</script><b>" not in page
    assert data_of(page)["title"].startswith("</script><b>DATA")
