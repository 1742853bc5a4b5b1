"""Deliberately wrong methods: each must be caught by the comparison of backends, and by the truths.

A mutant is a reference stepper with one thing changed. The first test shows that equality with the core notices; the second that
the truths would notice even if both languages had the same mistake. So no mutant survives the suite.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.cases import assert_same, cases, number
from support.mistakes import mistaken
from support.truths import CLOSED_FORMS, forced_error, matrix_of, quadrature_error, slope

pytestmark = pytest.mark.mutant

#: method: what to replace, by what, and what kind of mistake it is.
MUTANTS = [
    ("false_euler", "return v, y + s.dy(t, v, y)", "return v, y + s.dy(t, v - s.dv(t, v, y), y)", "old v for new v"),
    ("standard_euler", "dy = s.dy(t, v, y)", "dy = s.dy(t, v + dv, y)", "new v for old v"),
    ("damped_euler", "return v + s.dv(t, v, y), y", "return v + s.dv(t, v, y - s.dy(t, v, y)), y", "old y for new y"),
    ("standard_heun", "dv2 = s.dv(t + h, v1, y1)", "dv2 = s.dv(t, v1, y1)", "wrong stage time"),
    ("standard_heun", "dy2 = s.dy(t + h, v1, y1)", "dy2 = s.dy(t + h, v, y1)", "old v for new v"),
    ("standard_heun", "v + 0.5 * (dv1 + dv2)", "v + (dv1 + dv2)", "a lost half"),
    ("false_heun", "dy1 = s.dy(t, v1, y)", "dy1 = s.dy(t, v, y)", "old v for new v"),
    ("false_heun", "dv2 = s.dv(t + h, v1, y1)", "dv2 = s.dv(t, v1, y1)", "wrong stage time"),
    ("false_heun", "y + 0.5 * (dy1 + dy2)", "y + (dy1 + dy2)", "a lost half"),
    ("semi_false_heun", "dy2 = s.dy(t + h, v2, y1)", "dy2 = s.dy(t + h, v1, y1)", "old v for new v"),
    ("semi_false_heun", "dv2 = s.dv(t + h, v1, y1)", "dv2 = s.dv(t, v1, y1)", "wrong stage time"),
    ("semi_false_heun", "y + 0.5 * (dy1 + dy2)", "y + (dy1 + dy2)", "a lost half"),
    ("rk4", "middle = t + 0.5 * h", "middle = t + h", "wrong stage time"),
    ("rk4", "dv4, dy4 = s.dv(t + h, v4, y4)", "dv4, dy4 = s.dv(t, v4, y4)", "wrong stage time"),
    ("rk4", "v3, y3 = v + 0.5 * dv2, y + 0.5 * dy2", "v3, y3 = v + dv2, y + dy2", "a lost half"),
    ("rk4", "v2, y2 = v + 0.5 * dv1, y + 0.5 * dy1", "v2, y2 = v + 0.5 * dv1, y", "old y for new y"),
    ("verlet", "(2.0 * y - y_prev) + d", "(2.0 * y - y_prev) + 0.5 * d", "a half too much"),
    ("verlet", "y_prev = y_prev + 0.5 * s.dy", "y_prev = y_prev + s.dy", "a lost half at the start"),
    ("verlet", "v = v + 0.5 * s.dv", "v = v + s.dv", "a lost half at the end"),
    ("leapfrog", "v_half = v_half + s.dv(t, v_half, y)", "v_half = v_half + 0.5 * s.dv(t, v_half, y)", "a half too much"),
    ("leapfrog", "v + -0.5 * s.dv(t, v, y)", "v - s.dv(t, v, y)", "a lost half at the start"),
    ("leapfrog", "v_half + 0.5 * s.dv(t, v_half, y)\n", "v_half\n", "a lost half kick at the end"),
    ("merson", "NODES = (0.0, 1 / 3, 1 / 3,", "NODES = (0.0, 1 / 3, 0.5,", "wrong stage time"),
    ("merson", "    (1 / 6, 1 / 6),", "    (1 / 3, 0.0),", "an increment not used"),
    ("merson", "WEIGHTS = (1 / 6, 0.0, 0.0, 2 / 3, 1 / 6)", "WEIGHTS = (1 / 6, 0.0, 2 / 3, 0.0, 1 / 6)", "the wrong increment"),
    ("fehlberg", "0.375, 12 / 13, 1.0", "0.375, 1.0, 1.0", "wrong stage time"),
    ("fehlberg", "-845 / 4104", "845 / 4104", "a wrong sign"),
    ("fehlberg", "2197 / 4104, -1 / 5, 0.0)", "2197 / 4104, 0.0, -1 / 5)", "the wrong increment"),
    ("dop853", "    6 / 7,\n", "    0.8,\n", "wrong stage time"),
    ("dop853", "0.6433927460157636", "-0.6433927460157636", "a wrong sign"),
    ("dop853", "0.04471061572777259", "0.0447106", "a weight cut short"),
    ("bs32", "(0.0, 0.75)", "(0.75, 0.0)", "the wrong increment"),
    ("dopri5", "0.8, 8 / 9, 1.0", "0.8, 0.9, 1.0", "wrong stage time"),
    ("dopri5", "-2187 / 6784, 11 / 84, 0.0)", "2187 / 6784, 11 / 84, 0.0)", "a wrong sign"),
    ("fehlberg_5", "-9 / 50, 2 / 55)", "2 / 55, -9 / 50)", "two weights exchanged"),
    ("pefrl", "v = v + LAMBDA * s.dv(t + (XI + CHI) * h, v, y)", "v = v + LAMBDA * s.dv(t, v, y)", "wrong stage time"),
    ("pefrl", "(1.0 - 2.0 * (CHI + XI))", "(1.0 - 2.0 * CHI)", "a drift too long"),
    ("taylor", "ORDER = 8", "ORDER = 7", "a lost order"),
    ("taylor", "reversed(terms))", "reversed(terms[1:]))", "a lost first term"),
    ("taylor", "term[1] + total[1]", "term[0] + total[1]", "the wrong block"),
    ("verlet", "y_prev = y - s.dy(t, v, y)", "y_prev = y + s.dy(t, v, y)", "a wrong sign at the start"),
]
IDS = [f"{method}: {mistake} #{i}" for i, (method, _, _, mistake) in enumerate(MUTANTS)]


Mutate = Callable[[str, str, str], None]


@pytest.fixture
def mutate(monkeypatch: pytest.MonkeyPatch) -> Mutate:
    def replace(name: str, old: str, new: str) -> None:
        original: Any = sw.method(name).steps
        wrong = mistaken(original, old, new)
        for function in {"step", "start", "finish"} & vars(wrong).keys():
            monkeypatch.setattr(original, function, getattr(wrong, function))

    return replace


#: With so many systems and forms a method is compared with the core, drawn by their names.
COMPARED = 24


def _equal_to_the_core(method: str) -> bool:
    try:
        for case in sorted(cases(iter([method])), key=lambda case: number("mutants", case))[:COMPARED]:
            assert_same(case.run(5), case.run(5, backend="numpy"))
    except AssertionError:
        return False
    return True


def _true(method: str) -> bool:
    closed = all(
        np.allclose(matrix_of(method, phi, "canonical", "numpy"), CLOSED_FORMS[method](phi), rtol=0, atol=1e-11)
        for phi in (0.1, 0.7, 1.9)
    )
    if sw.method(method).has_series:  # its error vanishes at some steps; of its order and its times, see ``test_taylor.py``
        return closed
    slopes = (slope(lambda dt: forced_error(method, dt, block, "numpy")) for block in ("v", "y"))  # noqa: B023
    return closed and quadrature_error(method, "numpy") < 1e-12 and all(abs(s - sw.method(method).order) <= 0.1 for s in slopes)


@functools.cache
def _unchanged(holds: Callable[[str], bool], method: str) -> bool:
    """What holds of a method that is as it should be, found once for all its mutants."""
    return holds(method)


@pytest.mark.parametrize(("method", "old", "new", "mistake"), MUTANTS, ids=IDS)
def test_equality_notices(mutate: Mutate, method: str, old: str, new: str, mistake: str) -> None:
    assert _unchanged(_equal_to_the_core, method)
    mutate(method, old, new)
    assert not _equal_to_the_core(method)


@pytest.mark.parametrize(("method", "old", "new", "mistake"), MUTANTS, ids=IDS)
def test_the_truths_notice(mutate: Mutate, method: str, old: str, new: str, mistake: str) -> None:
    assert _unchanged(_true, method)
    mutate(method, old, new)
    assert not _true(method)


def test_every_method_with_truths_has_a_mutant() -> None:
    assert {m[0] for m in MUTANTS} == set(CLOSED_FORMS)
