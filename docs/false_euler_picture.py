"""Draws the picture of docs/theory/why_false_euler_works.md.

Run ``.venv/bin/python docs/false_euler_picture.py``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

PICTURE = Path(__file__).resolve().parent / "images" / "why_false_euler_works.png"

#: The angle of a step, and the square of states that steps move: its corners as (y, v).
PHI = 0.5
SQUARE = np.array([[0.8, -0.2], [1.2, -0.2], [1.2, 0.2], [0.8, 0.2]])

#: Colours of False Euler, of Standard Euler, and of what is between two shears.
BLUE, ORANGE, GREY, INK = "#175ca6", "#b8520b", "#9aa4b0", "#1c2127"


def kicked(states: Any) -> Any:
    """The first line of a step: v changes, y stays."""
    return states @ np.array([[1.0, -PHI], [0.0, 1.0]])


def drifted(states: Any) -> Any:
    """The second line of False Euler: y changes by the new v."""
    return states @ np.array([[1.0, 0.0], [PHI, 1.0]])


def area(corners: Any) -> float:
    """The area of a polygon."""
    y, v = corners.T
    return 0.5 * abs(float(np.dot(y, np.roll(v, -1)) - np.dot(v, np.roll(y, -1))))


def fill(axes: Any, corners: Any, colour: str, alpha: float = 0.55) -> None:
    """Draw a polygon of states."""
    axes.fill(*corners.T, color=colour, alpha=alpha, linewidth=1.2, edgecolor=colour)


def draw() -> Any:
    """The figure: a square of states by both methods, and two ellipses."""
    figure, panels = plt.subplots(
        1, 3, figsize=(10.2, 4.0), dpi=160, layout="constrained"
    )
    figure.get_layout_engine().set(h_pad=0.08)
    shears, swells, ellipses = panels

    square = SQUARE
    fill(shears, square, GREY)
    for _ in range(2):
        fill(shears, kicked(square), GREY, 0.35)
        square = drifted(kicked(square))
        fill(shears, square, BLUE)
    assert abs(area(square) / area(SQUARE) - 1.0) < 1e-12
    note = {"color": INK, "fontsize": 10.5, "va": "center"}
    shears.text(1.24, -0.62, "1. v slides", **note)
    shears.text(0.22, -0.3, "2. y slides", **note)
    for end, begin in (((1.1, -0.52), (1.1, -0.05)), ((0.62, -0.36), (0.95, -0.36))):
        shears.annotate(
            "", end, begin, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.4}
        )
    shears.set_title("False Euler: two shears a step,\nthe area stays", color=BLUE)

    square, step = SQUARE, np.array([[1.0, -PHI], [PHI, 1.0]])
    fill(swells, square, GREY)
    for _ in range(3):
        square = square @ step
        fill(swells, square, ORANGE)
    assert abs(area(square) / area(SQUARE) / (1.0 + PHI**2) ** 3 - 1.0) < 1e-12
    growth = area(square) / area(SQUARE)
    swells.set_title(
        f"Standard Euler: turned and swollen,\n× {growth:.1f} in three steps",
        color=ORANGE,
    )

    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    circle = np.array([np.cos(angle), np.sin(angle)])
    ellipses.plot(*circle, color=GREY, linewidth=5.0, label="the motion: y² + v²")
    forms = {"false_euler": (-PHI, 1.0), "leapfrog": (0.0, 1.0 - PHI**2 / 4)}
    texts = "False Euler: v² − Φvy + y²", "Leapfrog: v² + (1 − Φ²/4)y²"
    for (name, (mixed, own)), colour, text in zip(
        forms.items(), (BLUE, INK), texts, strict=True
    ):
        run = sw.integrate(
            sw.Oscillator(), name, v=0.0, y=1.0, dt=PHI, steps=60, every=1
        )
        y, v = circle
        size = np.sqrt(own / (v * v + mixed * v * y + own * y * y))
        ellipses.plot(y * size, v * size, color=colour, linewidth=1.3, label=text)
        kept = run.v**2 + mixed * run.v * run.y + own * run.y**2
        assert np.ptp(kept) < 1e-12
        ellipses.plot(run.y, run.v, "o", color=colour, markersize=3.2)
    ellipses.set_title("Each method stays\non an ellipse of its own", color=INK)
    ellipses.legend(
        loc="center",
        fontsize=9.5,
        handlelength=1.2,
        edgecolor="none",
        framealpha=1.0,
        borderpad=0.6,
    )

    windows = (-0.1, 1.5, -1.25, 0.35), (-0.3, 1.9, -1.75, 0.45), (-1.2, 1.2, -1.2, 1.2)
    for axes, (left, right, low, high) in zip(panels, windows, strict=True):
        axes.axhline(0.0, color="#c3cad2", linewidth=0.8, zorder=0)
        axes.axvline(0.0, color="#c3cad2", linewidth=0.8, zorder=0)
        axes.set(xlim=(left, right), ylim=(low, high), aspect="equal")
        for side in axes.spines.values():
            side.set_visible(False)
        axes.set(xticks=[], yticks=[])
        axes.title.set_fontsize(12)
        axes.annotate(
            "y", (right, 0.0), (-4, 4), textcoords="offset points", ha="right"
        )
        axes.annotate("v", (0.0, high), (4, -4), textcoords="offset points", va="top")
    return figure


if __name__ == "__main__":
    draw().savefig(PICTURE, facecolor="white")
