"""Methods that are not in the catalogue, with what is known of them from elsewhere: the analysis must know nothing by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import stepwell as sw
from stepwell.model.methods import Method

Step = Callable[..., Any]


def explicit(a: Sequence[Sequence[float]], b: Sequence[float]) -> Step:
    """The step of an explicit Runge-Kutta method with this tableau."""

    def step(s: Any, t: float, h: float, v: Any, y: Any) -> Any:
        stages: list[tuple[Any, Any]] = []
        for row in a:
            vi, yi = v, y
            for weight, (dv, dy) in zip(row, stages, strict=False):
                vi, yi = vi + weight * dv, yi + weight * dy
            stages.append((s.dv(t, vi, yi), s.dy(t, vi, yi)))
        for weight, (dv, dy) in zip(b, stages, strict=False):
            v, y = v + weight * dv, y + weight * dy
        return v, y

    return step


def composed(kicks: Sequence[float], drifts: Sequence[float]) -> Step:
    """The step of a composition of kicks of v and drifts of y, beginning with a drift."""

    def step(s: Any, t: float, h: float, v: Any, y: Any) -> Any:
        for i, drift in enumerate(drifts):
            y = y + drift * s.dy(t, v, y)
            if i < len(kicks):
                v = v + kicks[i] * s.dv(t, v, y)
        return v, y

    return step


def method(step: Step) -> Method:
    """A method of the reference alone, as false_euler's record says nothing that the analysis reads."""

    class Elsewhere(Method):
        steps = SimpleNamespace(step=step)  # type: ignore[assignment]

    one = Elsewhere.__new__(Elsewhere)
    one.__dict__.update(sw.method("false_euler").__dict__)
    return one


FEHLBERG = (
    (),
    (1 / 4,),
    (3 / 32, 9 / 32),
    (1932 / 2197, -7200 / 2197, 7296 / 2197),
    (439 / 216, -8.0, 3680 / 513, -845 / 4104),
    (-8 / 27, 2.0, -3544 / 2565, 1859 / 4104, -11 / 40),
)
MERSON = ((), (1 / 3,), (1 / 6, 1 / 6), (1 / 8, 0.0, 3 / 8), (1 / 2, 0.0, -3 / 2, 2.0))
_T = 1 / (2 - 2 ** (1 / 3))
_X, _L, _C = 0.1786178958448091, -0.2123418310626054, -0.06626458266981849

MERSON_4 = method(explicit(MERSON, (1 / 6, 0, 0, 2 / 3, 1 / 6)))
FEHLBERG_4 = method(explicit(FEHLBERG, (25 / 216, 0, 1408 / 2565, 2197 / 4104, -1 / 5)))
FEHLBERG_5 = method(explicit(FEHLBERG, (16 / 135, 0, 6656 / 12825, 28561 / 56430, -9 / 50, 2 / 55)))
FOREST_RUTH = method(composed((_T, 1 - 2 * _T, _T), (_T / 2, (1 - _T) / 2, (1 - _T) / 2, _T / 2)))
PEFRL = method(composed(((1 - 2 * _L) / 2, _L, _L, (1 - 2 * _L) / 2), (_X, _C, 1 - 2 * (_C + _X), _C, _X)))
KUTTA_3 = method(explicit(((), (1 / 2,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6)))
