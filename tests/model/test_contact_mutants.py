"""Each line of the way that contact is computed, wrong in one way: the checks of ``contacts.py`` notice it.

The reference is changed in its text and run in place of the right one; that the core computes the same is shown by
test_graphs.py.
"""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from stepwell.model import surfaces
from stepwell.runs.engine import direct
from support import contacts
from support.contact_mutants import changed

pytestmark = pytest.mark.mutant

#: What stands there, and what a mistake would make of it.
MISTAKES = [
    # where a point is
    (
        "distance = dot(y, self.normal) - self.offset\n        slack",
        "distance = dot(y0, self.normal) - self.offset\n        slack",
    ),
    ("c = square - self.radius * self.radius", "c = square - self.radius"),
    (
        "normal = self.outward([w / length for w in where])",
        "normal = self.outward([f / np.sqrt(dot(from1, from1)) for f in from1])",
    ),
    ("return [-each for each in vector] if self.is_inside else vector", "return vector"),
    ("return self.radius - length if self.is_inside else", "return self.radius + length if self.is_inside else"),
    ("near = hits | ", "near = "),
    ("bits.at_most(-(self.radius * (slack + slack)), c)", "bits.at_most(0.0, c)"),
    ("length = self.radius - distance if self.is_inside else self.radius + distance", "length = self.radius + 0.01"),
    # a bounce
    ("ahead = bits.where(bits.less(quarter, late), 0.5 * size, 0.0)", "ahead = 0.0 * size"),
    ("ahead = bits.where(bits.less(quarter, late), 0.5 * size, 0.0)", "ahead = 0.5 * size"),
    ("touches = place.near & bits.less(w, 0.0)\n", "touches = place.near\n"),
    ("square = (w * w + (pull + pull) * place.distance)", "square = (w * w)"),
    ("square = (w * w + (pull + pull) * place.distance)", "square = (w * w - (pull + pull) * place.distance)"),
    ("leaving = self.restitution * impact", "leaving = impact"),
    ("rests = bits.at_most(leaving, push) | bits.at_most(square, 0.0)", "rests = bits.at_most(square, 0.0)"),
    ("rests = bits.at_most(leaving, push) | bits.at_most(square, 0.0)", "rests = bits.at_most(leaving, 0.5 * push)"),
    ("since = (-(place.distance + place.distance)) / (impact - w)", "since = (-place.distance) / (impact - w)"),
    ("low = bits.where(", "low = place.before + 0.0 * bits.where("),
    ("height = since * (leaving - (0.5 * pull) * since)", "height = since * leaving"),
    ("height = since * (leaving - (0.5 * pull) * since)", "height = -self.restitution * place.distance"),
    ("rising = (leaving - pull * since) - ahead", "rising = leaving - ahead"),
    ("rising = (leaving - pull * since) - ahead", "rising = leaving - pull * since"),
    ("turn, lift = change.speed - speed, change.distance - place.distance", "turn, lift = change.speed - speed, change.distance"),
    ("turn, lift = change.speed - speed, change.distance", "turn, lift = -change.speed - speed, change.distance"),
    # friction
    ("self.friction * turn", "self.friction * change.speed"),
    ("remaining = bits.where(sticks, 0.0, 1.0 - grip / fast)", "remaining = 1.0 - grip / fast"),
    ("remaining = bits.where(sticks, 0.0, 1.0 - grip / fast)", "remaining = bits.where(sticks, 0.0, 1.0 + grip / fast)"),
    ("half = 0.5 * self.h", "half = self.h"),
    ("share = half * bits.where(bits.less(0.0, fast), fast / grip, 0.0)", "share = half"),
    ("shift = bits.where(sticks, way[i] - through * n, ", "shift = bits.where(sticks, 0.0 * n, "),
    ("new_y[i] = bits.where(change.rests, new_y[i] + shift, new_y[i])", "new_y[i] = new_y[i]"),
    # several surfaces
    ("            v, y = self.limit(step, touched, v, y)\n", "            pass\n"),
    ("return dot(v_from, v_from) + (work + work) / self.h", "return dot(v_from, v_from) + work / self.h"),
    ("most = bits.where(bits.less(most, raw), raw, most)\n        stays", "stays"),
    ("np.sqrt(most / square), 1.0)", "np.sqrt(square / most), 1.0)"),
    # what a method carries
    ("v0, v1 = steps.finish(s, choice, t, *before), steps.finish(s, choice, end, slot, y1)", "v0, v1 = before[0], slot"),
    ("started = steps.start(s, choice, end, v, y)", "started = v"),
]

#: One method of each kind: carried, on the parabola, the two kinds of the Euler family.
METHODS = ("standard_euler", "false_euler", "leapfrog", "rk4")


def is_noticed() -> bool:
    """Whether a check notices, all of them by one method and then by the next: most mistakes are noticed by any method."""
    for method, check in itertools.product(METHODS, contacts.ALL.values()):
        if check is contacts.squares and method in contacts.LAG:
            continue
        try:
            check(method, backend="numpy")
        except AssertionError:
            return True
    return False


@pytest.mark.parametrize(("old", "new"), MISTAKES, ids=[str(i) for i in range(len(MISTAKES))])
@pytest.mark.filterwarnings("ignore")
def test_a_mistake_is_noticed(old: str, new: str, monkeypatch: Any) -> None:
    wrong = changed(old, new)
    monkeypatch.setattr(surfaces, "contact", wrong)
    monkeypatch.setattr(direct, "contact", wrong)
    assert is_noticed()


def test_nothing_is_noticed_without_a_mistake() -> None:
    assert not is_noticed()
