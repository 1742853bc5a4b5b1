"""Animations as node and ffmpeg make them: what a page's script decodes is what was computed."""

import json
import math

import numpy as np
import pytest
import stepwell as sw
from matplotlib import animation
from stepwell.views.charts import page_animation, run_picture
from stepwell.views.charts.run_panels import FALLING
from stepwell.views.charts.runs import own_picture
from stepwell.views.charts.solids import solid_of
from support.abroad import executed
from support.explored import needs_node
from support.pictured import looked_at

DECODING = """
const { readFileSync } = require("node:fs");
const unpacked = unpack(JSON.parse(readFileSync("animation.json", "utf8")));
const plain = (key, value) => value instanceof Float64Array ? Array.from(value, (x) => Number.isNaN(x) ? null : x) : value;
console.log(JSON.stringify(unpacked, plain));
"""


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


@needs_node
def test_places_in_a_page_are_the_states_and_on_a_phone_panels_are_below_each_other(tmp_path):
    for name in ("figure_eight", "arenstorf", "double_pendulum", "jelly_cube", "plummer", "conical_pendulum"):
        scene = sw.scenes.scene(name)
        chart = own_picture(scene.run("rk4", steps=60, every=1))
        data = page_animation.data(chart, 3.0, 20.0)
        unpacked = in_node(data, tmp_path)
        panel, coded = unpacked["panels"][0], data["panels"][0]
        places = chart.places[shown(chart, unpacked)]
        expected = FALLING.flat(places) if panel["name"].startswith("seen from the front") else places[..., :2]
        decoded = numbers(panel["values"]).reshape(expected.shape)
        assert np.abs(decoded - expected).max() <= off(expected, coded["data"]), name
        assert coded["data"]["step"] <= 1e-4 * np.ptp(expected), name  # four digits of what is seen
        springs = getattr(scene.system, "pairs", None)
        if springs is not None:
            np.testing.assert_array_equal(np.array(panel["links"]), springs)
    # Each as wide as the page, in units of about a pixel, so that a text of 13 to 15 of them is read.
    script = (page_animation.WEB / "animation.js").read_text(encoding="utf-8")
    (tmp_path / "run.js").write_text(script + ARRANGING, encoding="utf-8")
    for name in ("clover", "rope_bridge", "aircraft", "chain", "oscillator"):
        scene = sw.scenes.scene(name)
        panels = page_animation.data(run_picture(scene, scene.run("rk4", steps=30, every=1)), 3.0, 20.0)["panels"]
        (tmp_path / "panels.json").write_text(json.dumps(panels), encoding="utf-8")
        phone, wide = json.loads(executed(["node", "run.js"], tmp_path))
        assert phone["size"]["width"] == 400
        bottom = 0.0
        for left, top, width, height in phone["places"]:
            assert top > bottom, name
            assert width > 0.8, name
            assert left + width <= 1.0, name
            bottom = top + height
        assert bottom <= 1.0, name
        assert wide["places"] == [list(panel["rect"]) for panel in panels]


ARRANGING = """
const panels = JSON.parse(require("node:fs").readFileSync("panels.json", "utf8"));
console.log(JSON.stringify([390, 1000].map((width) => ({ size: arranged(panels, width), places: panels.map((p) => p.place) }))));
"""


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


def test_with_ffmpeg_an_mp4_is_written(tmp_path):
    if not animation.FFMpegWriter.isAvailable():
        pytest.skip("there is no ffmpeg here")
    looked_at(sw.scenes.clover(), every=50).animate(tmp_path / "run.mp4", seconds=1, fps=2)
    assert (tmp_path / "run.mp4").read_bytes()[4:8] == b"ftyp"
