"""Methods of one's own: of one step with and without an estimate, and of several steps."""

from __future__ import annotations

from typing import Any

import stepwell as sw


@sw.method
def halfway(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
    """The explicit midpoint rule."""
    dv, dy = s.dv(t, v, y), s.dy(t, v, y)
    half, v2, y2 = t + h / 2, v + dv / 2, y + dy / 2
    return v + s.dv(half, v2, y2), y + s.dy(half, v2, y2)


@sw.method
def heun_euler(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
    dv, dy = s.dv(t, v, y), s.dy(t, v, y)
    dv2, dy2 = s.dv(t + h, v + dv, y + dy), s.dy(t + h, v + dv, y + dy)
    return v + (dv + dv2) / 2, y + (dy + dy2) / 2, (dv2 - dv) / 2, (dy2 - dy) / 2


def a_step_back(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
    """Classical Runge-Kutta, by −h."""
    half = t - h / 2
    dv1, dy1 = s.dv(t, v, y), s.dy(t, v, y)
    dv2, dy2 = s.dv(half, v - dv1 / 2, y - dy1 / 2), s.dy(half, v - dv1 / 2, y - dy1 / 2)
    dv3, dy3 = s.dv(half, v - dv2 / 2, y - dy2 / 2), s.dy(half, v - dv2 / 2, y - dy2 / 2)
    dv4, dy4 = s.dv(t - h, v - dv3, y - dy3), s.dy(t - h, v - dv3, y - dy3)
    return v - (dv1 + 2 * dv2 + 2 * dv3 + dv4) / 6, y - (dy1 + 2 * dy2 + 2 * dy3 + dy4) / 6


def one_before(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
    v, y = a_step_back(s, t, h, v, y)
    return s.dv(t - h, v, y), s.dy(t - h, v, y)


def two_before(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
    v1, y1 = a_step_back(s, t, h, v, y)
    v2, y2 = a_step_back(s, t - h, h, v1, y1)
    return s.dv(t - h, v1, y1), s.dy(t - h, v1, y1), s.dv(t - 2 * h, v2, y2), s.dy(t - 2 * h, v2, y2)


@sw.method(start=one_before)
def adams_bashforth_2(s: Any, t: Any, h: Any, v: Any, y: Any, dv1: Any, dy1: Any) -> Any:
    dv, dy = s.dv(t, v, y), s.dy(t, v, y)
    return v + 1.5 * dv - 0.5 * dv1, y + 1.5 * dy - 0.5 * dy1, dv, dy


@sw.method(start=two_before)
def adams_bashforth_3(s: Any, t: Any, h: Any, v: Any, y: Any, dv1: Any, dy1: Any, dv2: Any, dy2: Any) -> Any:
    dv, dy = s.dv(t, v, y), s.dy(t, v, y)
    return (
        v + 23 / 12 * dv - 4 / 3 * dv1 + 5 / 12 * dv2,
        y + 23 / 12 * dy - 4 / 3 * dy1 + 5 / 12 * dy2,
        *(dv, dy, dv1, dy1),
    )
