"""Pictures of runs that several tests look at."""

import functools
import random
from collections import defaultdict

import pytest
import stepwell as sw
from stepwell.views.charts.kinds import kind_of

from .covering import seed


def looked_at(scene, method="false_euler", dt=None, **options):
    return sw.charts.run_picture(scene, scene.run(method, dt, **({"every": 1} | options)))


#: One of each kind of picture, and of what can go wrong in it: a scene, a method if it is not the usual one, and options.
_LOOKED_AT = {
    "attitude": ("aircraft", {}),
    "body": ("dzhanibekov", {"method": "rk4"}),
    "top": ("heavy_top", {"method": "rk4"}),
    "trapped": ("gimbal_trap", {}),
    "orbits": ("figure_eight", {"method": "leapfrog"}),
    "long": ("energy_control", {"method": "standard_euler", "steps": 5000}),
    "space": ("plummer", {"method": "leapfrog", "steps": 200}),
    "two": ("kepler", {}),
    "gone": ("pythagorean", {"method": "leapfrog", "every": 5}),
    "swing": ("oscillator", {}),
    "steady": ("forced_oscillator", {"method": "rk4"}),
    "grown": ("oscillator", {"method": "standard_euler"}),
    "crash": ("oscillator", {"method": "standard_euler", "dt": 100.0, "steps": 400}),
    "rows": ("chain", {}),
    "many rows": ("chain", {"steps": 900}),
}
#: What a run is warned of.
_WARNED = {
    "crash": (sw.DivergenceWarning, "diverged at step"),
    "gone": (sw.AccuracyWarning, "has another energy at the end"),
    "long": (sw.AccuracyWarning, "bodies 1 and 2 met within step 349"),
}


@functools.cache
def picture_of(kind):
    name, options = _LOOKED_AT[kind]
    scene = sw.scenes.chain(100, {1: 1.0, 3: 0.4}) if kind == "many rows" else sw.scenes.scene(name)
    if kind not in _WARNED:
        return looked_at(scene, **options)
    with pytest.warns(_WARNED[kind][0], match=_WARNED[kind][1]):
        return looked_at(scene, **options)


@functools.cache
def figure_of(kind):
    """Drawn once, for tests that look at it."""
    return picture_of(kind).plot()


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
