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
from stepwell.views.charts.runs import own_picture
from support import stiff
from support.families import family
from support.pictured import DRAWN


def data_of(page):
    """What the page is filled with."""
    (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(data)


def test_codes_are_off_by_half_a_step_and_a_page_shows_none():
    values = np.array([-1.0, math.nan, 0.123456, 2.0, math.inf])
    encoding = page_animation.encoded(values)
    assert (encoding["low"], encoding["step"]) == (-1.0, 3.0 / 65534)
    assert page_animation.encoded(np.array([5.0, 5.0]))["low"] == 5.0
    assert page_animation.encoded(np.array([math.nan])) == {"low": 0.0, "step": 1.0, "codes": "//8="}
    chart = run_picture("rope_bridge", sw.scenes.rope_bridge().run("leapfrog", every=1))
    page = page_animation.page(chart, 10.0, 20.0)
    assert ':root[data-theme="dark"]' in page
    assert 'matchMedia("(prefers-color-scheme: dark)")' in page
    assert re.fullmatch(
        r"720 steps of 0\.00416667\.( \d+ of 721 saved states, and straight lines between them\.)?", data_of(page)["about"]
    )


@pytest.mark.filterwarnings("ignore:y.1. ends at")  # by such steps of the Oregonator
@pytest.mark.parametrize("name", family([scene.name for scene in sw.scenes.scenes()], DRAWN.__contains__))
def test_every_scene_is_a_small_page_at_once(name, tmp_path):
    scene = sw.scenes.scene(name)
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


def test_the_largest_pages_are_small_and_a_diverged_run_is_shown_as_far_as_it_is_finite():
    """The most of everything: a net, five bodies with exact curves, and a run of more states than a page holds."""
    scene = sw.scenes.figure_eight()
    run = scene.run("leapfrog", dt=scene.dt / 10, every=1)
    assert len(page_animation.page(run_picture(scene, run), 10.0, 20.0).encode()) <= 200_000
    net = sw.scenes.cloth()
    page = page_animation.page(own_picture(net.run("leapfrog", every=2)), 10.0, 20.0)
    assert len(page.encode()) <= 200_000
    assert data_of(page)["between"]
    assert "saved states, and straight lines between them" in data_of(page)["about"]
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
