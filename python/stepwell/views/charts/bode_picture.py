"""The picture of a Bode chart: gain and phase on the left, and on the right how far each method is from the exact response."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from .bode import RIGHT, Bode, MethodResponse, gain, phase
from .labels import Label, beside, title
from .style import DPI, EXACT, GREY, PALE, SIZE, Figure, apart, page

#: The methods that are drawn first; others follow in their order up to ``MOST``.
FIRST = ("standard_euler", "false_euler", "rk4", "backward_euler", "standard_heun", "leapfrog")
MOST = 5

#: The errors that are drawn.
LEAST, LARGEST = 1e-6, 10.0

INPUTS = {"sine": "a sinusoid that methods see at any time", "hold": "held from sample to sample", "linear": "straight lines"}


def draw(chart: Bode) -> Figure:
    """Draw the chart on a new figure."""
    curves = chosen(chart)
    methods = [curve.method for curve in curves]
    share = chart.omega / chart.nyquist
    with page(*SIZE, dpi=DPI) as figure:
        gains, phases = (figure.add_axes((0.075, low, 0.37, 0.29)) for low in (0.535, 0.185))
        errors = figure.add_axes((0.535, 0.185, 0.445, 0.64))
        for axes, of in ((gains, gain), (phases, phase)):
            truth = of(chart.exact)
            axes.plot(share, truth, **EXACT)
            if chart.x != "sine":
                axes.plot(share, of(chart.continuous), color=PALE, linewidth=1.4, linestyle=(0, (1, 1.4)))
            for curve in curves:
                axes.plot(share, of(curve.response), **_line(curve, methods, 1.8))
            low, high = float(np.nanmin(truth[np.isfinite(truth)])), float(np.nanmax(truth[np.isfinite(truth)]))
            room = 0.25 * max(high - low, 20.0)
            axes.set_ylim(low - room, high + room)
            axes.set(xscale="log", xlim=(_left(chart), 1.0))
            axes.grid(which="major", color="#dddddd", linewidth=0.8)
            axes.minorticks_off()
        gains.tick_params(labelbottom=False)
        gains.set_title("gain in dB", loc="left", size=13.5)
        phases.set_title("phase in degrees", loc="left", size=13.5)
        phases.set_xlabel("frequency as a share of π/dt")
        errors.set(xscale="log", yscale="log", xlim=(_left(chart), 1.0), ylim=(LEAST, LARGEST))
        errors.set_title("error of the response, relative", loc="left", size=13.5)
        errors.set_xlabel("frequency as a share of π/dt")
        errors.grid(which="major", color="#dddddd", linewidth=0.8)
        errors.minorticks_off()
        errors.axhline(RIGHT, color=GREY, linewidth=1.0)
        errors.annotate("1 %", (_left(chart), RIGHT), (5, 4), textcoords="offset points", color=GREY, size=12)
        names = []
        for curve in curves:
            errors.plot(share, np.maximum(curve.error, LEAST * 1e-3), **_line(curve, methods, 2.2))
            inside = (curve.error > 2.0 * LEAST) & (curve.error < 0.5 * LARGEST) & (share > _left(chart))
            style = {"color": apart(methods, curve.method)["color"], "weight": "bold", "size": 12.0}
            unstable = "" if curve.stable else " (unstable)"
            names.append(Label(curve.method.title + unstable, np.array([share[inside], curve.error[inside]]).T, style))
        unnamed = beside(errors, names)
        title(figure, 0.012, 0.945, finding(chart), 20)
        figure.text(0.012, 0.9, f"dt = {chart.dt:.4g}, the input is {INPUTS[chart.x]}. {margins(chart)}", size=13, color=GREY)
        notes = ["Grey: the exact response" + (" of samples; dotted: that of the system." if chart.x != "sine" else ".")]
        if any(not curve.stable for curve in curves):
            notes[0] += " Dashed: no run shows it, since steps grow."
        left = [curve.method.title for curve in chart.curves if curve not in curves] + unnamed
        notes += [f"Not shown: {', '.join(left)}."] * bool(left)
        lines = [textwrap.shorten(note, 150, placeholder=" …") for note in notes]
        figure.text(0.012, 0.02, "\n".join(lines), size=11.3, color=GREY, linespacing=1.3)
    return figure


def _left(chart: Bode) -> float:
    return float(chart.omega[0] / chart.nyquist)


def _line(curve: MethodResponse, methods: list[Any], width: float) -> dict[str, Any]:
    """Solid, or dashed where steps grow."""
    line = {"color": apart(methods, curve.method)["color"], "linewidth": width}
    return line | ({} if curve.stable else {"linestyle": (0, (3, 1.5))})


def chosen(chart: Bode) -> list[MethodResponse]:
    """The curves that are drawn, in the order of the chart."""
    names = [curve.method.name for curve in chart.curves]
    order = [*(name for name in FIRST if name in names), *(name for name in names if name not in FIRST)][:MOST]
    if len(names) <= MOST:
        order = names
    return [curve for curve in chart.curves if curve.method.name in order]


def margins(chart: Bode) -> str:
    """The margins of the exact response as an open loop, if it has any."""
    found = chart.margins
    words = []
    if np.isfinite(found.gain):
        words.append(f"gain {found.gain:.3g}")
    if np.isfinite(found.phase):
        words.append(f"phase {found.phase:.3g}°")
    return f"Margins as an open loop: {', '.join(words)}." if words else ""


def finding(chart: Bode) -> str:
    """Up to which share of half the samples' frequency the best and the worst of the drawn methods are right."""
    curves = chosen(chart)
    stable = [curve for curve in curves if curve.stable]
    grown = ", ".join(curve.method.title for curve in curves if not curve.stable)
    if not stable:
        return f"No run shows this response: {grown} unstable"
    ranked = sorted(stable, key=lambda curve: curve.right_up_to(chart.omega))
    best, worst = ranked[-1], ranked[0]
    words = f"Right to {RIGHT:.0%} up to {_share(best, chart)} by {best.method.title}".replace("%", " %")
    if worst is not best:
        words += f", {_share(worst, chart)} by {worst.method.title}"
    return words + (f"; {grown} unstable" if grown else "")


def _share(curve: MethodResponse, chart: Bode) -> str:
    share = curve.right_up_to(chart.omega) / chart.nyquist
    return "π/dt" if share > 0.999 else f"{share:.2g} π/dt" if share else "no frequency"
