"""Pictures of runs that several tests look at."""

import random
from collections import defaultdict

import pytest
import stepwell as sw
from stepwell.views.charts.kinds import kind_of

from .covering import seed


def looked_at(scene, method="false_euler", dt=None, **options):
    return sw.charts.run_picture(scene, scene.run(method, dt, **({"every": 1} | options)))


@pytest.fixture(scope="module", name="pictures")
def the_pictures():
    """One of each kind of picture, and of what can go wrong in it."""
    scenes = sw.scenes
    with pytest.warns(sw.DivergenceWarning):
        crash = looked_at(scenes.oscillator(), "standard_euler", 100.0, steps=400)
    with pytest.warns(sw.AccuracyWarning, match="has another energy at the end"):
        gone = looked_at(scenes.pythagorean(), "leapfrog", every=5)
    with pytest.warns(sw.AccuracyWarning, match="bodies 1 and 2 met within step 349"):
        long = looked_at(scenes.energy_control(), "standard_euler", steps=5000)
    return {
        "attitude": looked_at(scenes.aircraft()),
        "body": looked_at(scenes.dzhanibekov(), "rk4"),
        "top": looked_at(scenes.heavy_top(), "rk4"),
        "trapped": looked_at(scenes.gimbal_trap()),
        "orbits": looked_at(scenes.figure_eight(), "leapfrog"),
        "long": long,
        "space": looked_at(scenes.plummer(), "leapfrog", steps=200),
        "two": looked_at(scenes.kepler()),
        "gone": gone,
        "swing": looked_at(scenes.oscillator()),
        "steady": looked_at(scenes.forced_oscillator(), "rk4"),
        "grown": looked_at(scenes.oscillator(), "standard_euler"),
        "crash": crash,
        "rows": looked_at(scenes.chain()),
        "many rows": looked_at(scenes.chain(100, {1: 1.0, 3: 0.4}), steps=900),
    }


KINDS = ("body", "top", "orbits", "long", "space", "two", "gone", "swing", "steady", "grown", "crash", "rows", "many rows")
#: Of an aircraft, whose pictures show angles in place of errors.
ATTITUDES = ("attitude", "trapped")
#: By default one of each way to lay out, and one that ends in what cannot be drawn.
SHOWN = ("attitude", "body", "orbits", "space", "swing", "rows", "crash")


#: A scene of each kind of picture, drawn by the seed; each has the choice of its kind.
_OF_A_KIND = defaultdict(list)
for _scene in sw.scenes.scenes():
    _OF_A_KIND[kind_of(_scene.system).picture].append(_scene.name)
DRAWN = [random.Random(seed()).choice(names) for names in _OF_A_KIND.values()]


def each_of(kinds):
    return pytest.mark.parametrize("kind", [pytest.param(k, marks=() if k in SHOWN else pytest.mark.long) for k in kinds])


every_kind, every_kind_with_errors = each_of((*ATTITUDES, *KINDS)), each_of(KINDS)


def said(figure):
    return " ".join(text.get_text() for text in figure.texts)
