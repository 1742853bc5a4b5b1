"""A run as a page that plays it: one HTML file with a canvas and the saved states, which needs no network and no matplotlib."""

from __future__ import annotations

import base64
import html
import json
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Array
from .orbits_picture import BODIES
from .run_panels import Series, angles, errors, side_by_side, swings, view_of
from .runs import RunPicture
from .runs_finding import broke_off, steps_of
from .solids import BODY_TRAIL, HALF_SIDE, REACH, solid_of
from .style import FAMILIES

WEB = Path(__file__).parent / "web"

#: The last of the codes of 16 bits stands for an unknown number.
NONE = 2**16 - 1

#: Bytes of codes that states and links may take, most states, and points of an exact curve: the page stays below 200 KB, since
#: four letters hold three bytes, exact curves of five bodies take 24 KB, and the page itself 12 KB.
BYTES, STATES, EXACT_POINTS = 110_000, 4000, 1200

BLUE, GREEN = FAMILIES["Runge-Kutta"], FAMILIES["leapfrog"]
Panel = dict[str, Any]


def write(chart: RunPicture, path: str | Path, seconds: float, fps: float) -> None:
    """Write the page."""
    Path(path).write_text(page(chart, seconds, fps), encoding="utf-8", newline="\n")


def page(chart: RunPicture, seconds: float, fps: float) -> str:
    """The page as text."""
    text_of_data = json.dumps(data(chart, seconds, fps), ensure_ascii=False, separators=(",", ":")).replace("</", "<\\/")
    text = (WEB / "animation.html").read_text(encoding="utf-8")
    parts = {
        "SCRIPT": (WEB / "animation.js").read_text(encoding="utf-8"),
        "TITLE": html.escape(chart.title),
        "DATA": text_of_data,
    }
    for name, part in parts.items():
        text = text.replace(name, part)
    return text


def data(chart: RunPicture, seconds: float, fps: float) -> dict[str, Any]:
    """The data of the page: titles, the times of the shown states, and panels."""
    good = np.flatnonzero(chart.finite)
    each = 2 * (2 * chart.places.shape[1] if chart.kind == "orbits" else 9 + int(np.prod(chart.run.y.shape[1:]))) + 12
    room = BYTES - (4 * len(chart.links) if chart.kind == "orbits" else 0)
    number = max(2, min(len(good), STATES, room // each))
    shown = good[np.round(np.linspace(0, len(good) - 1, number)).astype(int)]
    run, t = chart.run, chart.run.t[shown]
    sentences = [f"{steps_of(run)}."]
    if run.status:
        sentences.append(f"{broke_off(run)}: shown as far as it is finite.")
    between = number < len(good) and number < seconds * fps
    if between:
        sentences.append(f"{number} of {len(run.t)} saved states, and straight lines between them.")
    motions = {"orbits": _orbits, "swing": _swing, "rows": _rows, "attitude": _aircraft, "body": _body}
    return {
        "title": chart.title,
        "about": " ".join(sentences),
        "seconds": seconds,
        "between": between,
        "digits": chart.digits,
        "t": encoded(t),
        "panels": _beside(motions[chart.kind](chart, shown), _errors(chart, shown)),
    }


def encoded(values: Array) -> dict[str, Any]:
    """Numbers as codes of 16 bits, with an error of at most half of ``step``; numbers that are not finite are unknown."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    finite = np.isfinite(flat)
    low, high = (float(flat[finite].min()), float(flat[finite].max())) if finite.any() else (0.0, 0.0)
    step = (high - low) / (NONE - 1) or 1.0
    codes = np.full(flat.shape, NONE)
    codes[finite] = np.clip(np.rint((flat[finite] - low) / step), 0, NONE - 1)
    return {"low": low, "step": step, "codes": _letters(codes)}


def _letters(codes: Any) -> str:
    """Whole numbers of 16 bits, the lower byte first, as letters."""
    return base64.b64encode(np.ravel(codes).astype("<u2").tobytes()).decode("ascii")


# ---- panels


def _beside(motion: list[Panel], errors: list[Panel]) -> list[Panel]:
    """The motion and the errors; a motion of one panel without errors has the whole page."""
    if errors or len(motion) > 1:
        return [*motion, *errors]
    left, top, _, height = motion[0]["rect"]
    return [motion[0] | {"rect": (left, top, 0.98 - left, height)}]


def _orbits(chart: RunPicture, shown: Array) -> list[Panel]:
    """Points with trails, springs and rods as lines, and fixed points."""
    links, count = chart.links, chart.places.shape[1]
    view = view_of(chart)
    few = count <= len(BODIES)
    centre, half = view.centre, max(view.half, 1e-12 * max(float(np.abs(view.centre).max()), 1.0))
    seen = np.clip(view.places[shown], centre - 4.0 * half, centre + 4.0 * half)  # far outside; the codes are for what is seen
    curves = []
    if view.exact is not None and few:
        at = np.linspace(0, len(view.exact) - 1, EXACT_POINTS).astype(int)
        curves = [{"data": encoded(view.exact[at, i])} for i in range(count)]
    panel = {
        "type": "points",
        "rect": (0.02, 0.06, 0.5, 0.92),
        "limits": [float(x) for x in (centre[0] - half, centre[0] + half, centre[1] - half, centre[1] + half)],
        "equal": True,
        "name": view.name,
        "count": count,
        "colours": [body["color"] for body in BODIES[:count]] if few else [BLUE],
        "radius": 8.0 if few else 3.0 if count <= 200 else 0.0,
        "trail": 0.0 if len(links) > len(BODIES) else chart.trail,
        "joined": {"low": 0, "step": 1, "codes": _letters(links)},
        "held": [(k, i) for k, point in enumerate(view.fixed) for i in point.joined],
        "fixed": [
            {"at": point.place, "name": point.name, "radius": 4.0 if point.joined else 9.0, "colour": "#555"}
            for point in view.fixed
        ],
        "exact": curves,
        "data": encoded(seen),
    }
    return [panel]


def _swing(chart: RunPicture, shown: Array) -> list[Panel]:
    panels, exact = swings(chart), chart.exact_at(shown)
    height = 0.4 if len(panels) > 1 else 0.88
    return [
        _series(chart, series, shown, (0.07, 0.06 + 0.48 * k, 0.46, height), colour, None if exact is None else exact[1 - k])
        for k, (series, colour) in enumerate(zip(panels, (BLUE, GREEN), strict=False))
    ]


def _rows(chart: RunPicture, shown: Array) -> list[Panel]:
    values, size = side_by_side(chart)
    exact = chart.exact_at(shown)
    panel = {
        "type": "rows",
        "rect": (0.03, 0.08, 0.5, 0.84),
        "limits": (0.0, values.shape[1] + 1.0, -1.1 * size, 1.1 * size),
        "name": "the coordinates, side by side by their number",
        "count": values.shape[1],
        "colours": [BLUE],
        "data": encoded(np.clip(values[shown], -4.0 * size, 4.0 * size)),
    }
    return [panel | ({} if exact is None else {"exact": {"data": encoded(exact[1])}})]


def _aircraft(chart: RunPicture, shown: Array) -> list[Panel]:
    places = [(0.6, 0.06 + 0.32 * k, 0.38, 0.24) for k in range(3)]
    panels = zip(angles(chart), places, tuple(FAMILIES.values())[1:], strict=False)
    return [_solid(chart, shown), *(_series(chart, series, shown, place, colour) for series, place, colour in panels)]


def _body(chart: RunPicture, shown: Array) -> list[Panel]:
    """A rigid body as a box or a top, and the trail of its axis."""
    solid = solid_of(chart)
    assert solid.axis is not None
    tip = np.zeros(3)
    tip[solid.axis] = np.copysign(REACH, solid.reach)
    trail = {"tip": tip.tolist(), "trail": BODY_TRAIL * float(chart.elapsed[-1])}
    return [_solid(chart, shown) | trail | {"name": f"the tip of axis {solid.axis + 1} leaves a trail"}]


def _solid(chart: RunPicture, shown: Array) -> Panel:
    solid = solid_of(chart)
    return {
        "type": "solid",
        "rect": (0.02, 0.06, 0.5, 0.92),
        "limits": (-HALF_SIDE, HALF_SIDE, -HALF_SIDE, HALF_SIDE),
        "equal": True,
        "name": "",
        "colours": [BLUE],
        "faces": list(solid.parts.values()),
        "screen": [axis.tolist() for axis in solid.screen],
        "data": encoded(np.moveaxis(solid.matrices, -1, 0)[shown]),
    }


def _errors(chart: RunPicture, shown: Array) -> list[Panel]:
    """The known errors; for an aircraft its angles."""
    if chart.kind == "attitude":
        return []
    return [
        _series(chart, series, shown, (0.64, 0.06 + 0.48 * k, 0.34, 0.4), "#333")
        for k, series in enumerate(errors(chart))
        if series.log and np.isfinite(series.lines[0].values[shown]).any()
    ]


def _series(
    chart: RunPicture, series: Series, shown: Array, rect: tuple[float, ...], colour: str, exact: Array | None = None
) -> Panel:
    """The main curve of a panel over time, above the exact one; an error by its power of ten."""
    assert series.limits is not None
    low, high = series.limits
    values, t = series.lines[0].values[shown], chart.run.t[shown]
    if series.log:
        low, high = np.log10(series.limits).tolist()
        low = min(low, high - 2.0)
        powers = np.log10(values)
        values = np.where(powers >= low, powers, np.nan)
        whole = np.arange(np.ceil(low), np.floor(high) + 1)
        ticks = [(float(p), f"1e{int(p)}") for p in whole[:: max(1, len(whole) // 4)]]
    else:
        if series.angles:  # a gap where an angle jumps by more than half a turn
            values = np.where(np.abs(np.diff(values, append=values[-1])) > 180.0, np.nan, values)
        values = np.clip(values, 4.0 * low, 4.0 * high)
        apart = 0.1 * (high - low)
        ticks = [(x, f"{x:.3g}") for x in (0.9 * low, 0.0, 0.9 * high) if x == 0.0 or abs(x) > apart]
    lines: list[Panel] = [] if exact is None else [{"data": encoded(exact), "exact": True}]
    lines.append({"data": encoded(values), "colour": colour})
    limits = (float(t[0]), float(t[-1]), low, high)
    return {
        "type": "series",
        "rect": rect,
        "limits": limits,
        "name": series.title or series.label,
        "lines": lines,
        "ticks": ticks,
    }
