"""A run as a page that plays it: one HTML file with a canvas and the saved states, which needs no network and no matplotlib."""

from __future__ import annotations

import base64
import html
import json
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Array
from . import attitude_picture, body_picture
from .orbits_picture import BODIES, links, view
from .runs import RunPicture
from .runs_finding import broke_off, steps_of
from .style import FAMILIES

WEB = Path(__file__).parent / "web"

#: The last of the codes of 16 bits stands for what is not known.
NONE = 2**16 - 1

#: Bytes of codes that states and links may take, most states, and points of an exact curve: the page stays below 200 KB, since
#: four letters hold three bytes, exact curves of five bodies take 24 KB, and the page itself 12 KB.
BYTES, STATES, EXACT_POINTS = 110_000, 4000, 1200

#: A trail is as long as this share of the run, or of the period if there is one.
TRAIL, TRAIL_OF_PERIOD = 0.1, 0.3

#: From where bodies that fall are seen: degrees from the first axis, and above the horizontal.
FALLING = attitude_picture.viewed(-60.0, 15.0)

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
    """What the page is filled with: titles, the times of the states that are shown, and panels."""
    good = np.flatnonzero(chart.finite)
    each = 2 * (2 * chart.places.shape[1] if chart.kind == "orbits" else 9 + int(np.prod(chart.run.y.shape[1:]))) + 12
    room = BYTES - (4 * len(links(chart)) if chart.kind == "orbits" else 0)
    number = max(2, min(len(good), STATES, room // each))
    shown = good[np.round(np.linspace(0, len(good) - 1, number)).astype(int)]
    run, t = chart.run, chart.run.t[shown]
    about = f"{steps_of(run)}; {textwrap.shorten(repr(run.system), 90, placeholder=' …')}"
    if run.status:
        about += f" {broke_off(run)}: shown as far as it is finite."
    between = number < len(good) and number < seconds * fps
    if between:
        about += f" {number} of {len(run.t)} saved states, and straight lines between them."
    make = {"orbits": _orbits, "swing": _swing, "rows": _rows, "attitude": _attitude, "body": _body}[chart.kind]
    span = abs(float(t[-1] - t[0]))
    return {
        "title": chart.title,
        "about": about,
        "seconds": seconds,
        "between": between,
        "digits": max(0, min(6, 2 - int(np.floor(np.log10(max(span / 100.0, 1e-300)))))),
        "t": encoded(t),
        "panels": make(chart, shown) + _errors(chart, shown),
    }


def encoded(values: Array) -> dict[str, Any]:
    """Numbers as 16 bits each, off by half of ``step`` at most; what is not finite is not known."""
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


def _orbits(chart: RunPicture, shown: Array) -> list[Panel]:
    """Points with trails, springs and rods as lines, and what is fixed."""
    places = chart.places[shown]
    count, dim = places.shape[1:]
    exact = chart.exact_places
    joined = links(chart)
    if dim == 3 and (len(joined) or chart.fixed_points):
        flat, name = FALLING.flat, "seen from the front, to the right and above"
        seen = flat(places)
        low, high = seen.reshape(-1, 2).min(axis=0), seen.reshape(-1, 2).max(axis=0)
        for _, point, _ in chart.fixed_points:
            low, high = np.minimum(low, flat(np.array(point))), np.maximum(high, flat(np.array(point)))
        centre, half = 0.5 * (low + high), 0.54 * float((high - low).max())
    else:

        def flat(points: Array) -> Array:
            return points[..., :2]

        seen, name = flat(places), "seen along z" if dim == 3 else ""
        centre, half = view(chart, (0, 1))
    half = max(half, 1e-12 * max(float(np.abs(centre).max()), 1.0))
    seen = np.clip(seen, centre - 4.0 * half, centre + 4.0 * half)  # far outside; the codes are for what is seen
    length = TRAIL * float(chart.elapsed[-1])
    if chart.scene.period is not None:
        length = min(length, TRAIL_OF_PERIOD * chart.scene.period)
    some: Any = [] if exact is None or count > len(BODIES) else np.linspace(0, len(exact) - 1, EXACT_POINTS).astype(int)
    held = [(k, i) for k, (_, _, ends) in enumerate(chart.fixed_points) for i in ends]
    panel = {
        "type": "points",
        "rect": (0.02, 0.06, 0.5, 0.92),
        "limits": _limits(centre, half),
        "equal": True,
        "name": name,
        "count": count,
        "colours": [body["color"] for body in BODIES[:count]] if count <= len(BODIES) else [BLUE],
        "radius": (0.0 if count > 200 else 3.0) if count > len(BODIES) else 8.0,
        "trail": 0.0 if len(joined) > len(BODIES) else length,
        "joined": {"low": 0, "step": 1, "codes": _letters(joined)},
        "held": held,
        "fixed": [
            {"at": flat(np.array(point)).tolist(), "name": name, "radius": 9.0 if not ends else 4.0, "colour": "#555"}
            for name, point, ends in chart.fixed_points
        ],
        "exact": [{"data": encoded(flat(exact[some, i]))} for i in range(count)] if len(some) and exact is not None else [],
        "data": encoded(seen),
    }
    return [panel]


def _limits(centre: Array, half: float) -> tuple[float, ...]:
    return tuple(float(x) for x in (centre[0] - half, centre[0] + half, centre[1] - half, centre[1] + half))


def _swing(chart: RunPicture, shown: Array) -> list[Panel]:
    """Coordinate and velocity as they grow."""
    t = chart.run.t[shown]
    known = chart.scene.exact(t) if chart.scene.exact is not None and t[-1] <= chart.scene.until else None
    panels = []
    blocks = (("y", chart.run.y[shown], BLUE), ("v", chart.run.v[shown], GREEN))
    given = [block for block in blocks if block[1][0].size]  # a system of first order has no v
    for k, (name, values, colour) in enumerate(given):
        lines = [] if known is None else [{"data": encoded(known[1 - k]), "exact": True}]
        size = float(np.abs(values if known is None else known[1 - k]).max()) or 1.0
        size = min(3.0 * size, max(size, float(np.abs(values).max())))
        lines.append({"data": encoded(np.clip(values, -4.0 * size, 4.0 * size)), "colour": colour})
        panels.append(
            _series(name, lines, t, (-1.1 * size, 1.1 * size), (0.07, 0.06 + 0.48 * k, 0.46, 0.4 if len(given) > 1 else 0.88))
        )
    return panels


def _rows(chart: RunPicture, shown: Array) -> list[Panel]:
    """The coordinates side by side."""
    y = chart.run.y[shown].reshape(len(shown), -1)
    t, n = chart.run.t[shown], y.shape[1]
    known = None
    if chart.scene.exact is not None and t[-1] <= chart.scene.until:
        known = chart.scene.exact(t)[1].reshape(len(t), -1)
    size = float(np.abs(y[:1] if known is None else known).max()) or 1.0
    size = min(3.0 * size, max(size, float(np.abs(y).max())))
    panel = {
        "type": "rows",
        "rect": (0.03, 0.08, 0.5, 0.84),
        "limits": (0.0, n + 1.0, -1.1 * size, 1.1 * size),
        "name": "the coordinates, side by side by their number",
        "count": n,
        "colours": [BLUE],
        "data": encoded(np.clip(y, -4.0 * size, 4.0 * size)),
    }
    return [panel | ({} if known is None else {"exact": {"data": encoded(known)}})]


def _attitude(chart: RunPicture, shown: Array) -> list[Panel]:
    """An aircraft in space, and its angles."""
    faces = [(corners, fill) for corners, fill in attitude_picture.PARTS.values()]
    matrices = np.moveaxis(attitude_picture.rotation(chart), -1, 0)[shown]
    panels = [_solid(faces, matrices, attitude_picture.viewed(), attitude_picture.HALF_SIDE)]
    t, angles = chart.run.t[shown], chart.run.y[shown]
    if chart.run.y.shape[1] != len(attitude_picture.ANGLES):
        system: Any = chart.run.system
        angles = system.angles(chart.run.y, axis=1)[shown]
    for k, name in enumerate(attitude_picture.ANGLES):
        values = np.clip(angles[:, k], -attitude_picture.LARGEST, attitude_picture.LARGEST)
        size = 1.1 * float(np.abs(values).max()) or 1.0
        line = [{"data": encoded(values), "colour": tuple(FAMILIES.values())[k + 1]}]
        panels.append(_series(f"{name}, degrees", line, t, (-size, size), (0.6, 0.06 + 0.32 * k, 0.38, 0.24)))
    return panels


def _body(chart: RunPicture, shown: Array) -> list[Panel]:
    """A rigid body as a box or a top, and the trail of its axis."""
    up, axis = body_picture.upright(chart), body_picture.main_axis(chart)
    matrices = np.einsum("ij,jkn->nik", up, attitude_picture.rotation(chart)[..., shown])
    shape, reach = body_picture.parts(chart.run.system, axis)
    panel = _solid(
        list(shape.values()), matrices, attitude_picture.viewed(elevation=body_picture.ELEVATION), attitude_picture.HALF_SIDE
    )
    tip = np.zeros(3)
    tip[axis] = np.copysign(body_picture.REACH, reach)
    length = body_picture.TRAIL * float(chart.elapsed[-1])
    return [panel | {"tip": tip.tolist(), "trail": length, "name": f"the tip of axis {axis + 1} leaves a trail"}]


def _solid(faces: list[Any], matrices: Array, screen: attitude_picture.Seen, reach: float) -> Panel:
    return {
        "type": "solid",
        "rect": (0.02, 0.06, 0.5, 0.92),
        "limits": (-reach, reach, -reach, reach),
        "equal": True,
        "name": "",
        "colours": [BLUE],
        "faces": faces,
        "screen": [axis.tolist() for axis in screen],
        "data": encoded(matrices),
    }


def _errors(chart: RunPicture, shown: Array) -> list[Panel]:
    """The errors that are known, on a scale of powers of ten."""
    panels = []
    if chart.kind == "attitude":
        return []
    for k, (name, error) in enumerate((("energy error", chart.energy_error), ("state error", chart.state_error))):
        if error is None:
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            powers = np.log10(error[shown])
        known = powers[np.isfinite(powers)]
        if not known.size:
            continue
        high = float(known.max()) + 0.3
        low = min(max(float(known.min()), float(known.max()) - 9.0) - 0.3, high - 2.0)
        line = {"data": encoded(np.where(powers >= low, powers, np.nan)), "colour": "#333"}
        rect = (0.64, 0.06 + 0.48 * k, 0.34, 0.4)
        panels.append(_series(f"{name}, relative", [line], chart.run.t[shown], (low, high), rect, log=True))
    return panels


def _series(
    name: str, lines: list[Panel], t: Array, limits: tuple[float, float], rect: tuple[float, ...], *, log: bool = False
) -> Panel:
    """Values over time."""
    low, high = limits
    if log:
        whole = np.arange(np.ceil(low), np.floor(high) + 1)
        ticks = [(float(p), f"1e{int(p)}") for p in whole[:: max(1, len(whole) // 4)]]
    else:
        ticks = [(value, f"{value:.3g}") for value in (0.9 * low, 0.0, 0.9 * high)]
    scale = (float(t[0]), float(t[-1]), low, high)
    return {"type": "series", "rect": rect, "limits": scale, "name": name, "lines": lines, "ticks": ticks}
