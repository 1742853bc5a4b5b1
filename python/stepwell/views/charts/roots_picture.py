"""The picture of an analysis: the eigenvalues of a step and those of the exact solution."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from .labels import title
from .style import FAMILIES, GREY, Figure, family, page

if TYPE_CHECKING:
    from ...analysis.stability.analysis import Analysis

#: The largest and the smallest distance from 0 up to which the z-plane is shown.
FARTHEST, NEAREST = 3.0, 1.25

#: The most members for which the exact eigenvalues are drawn, too.
EXACT_UP_TO = 200


def draw(analysis: Analysis) -> Figure:
    """Draw the eigenvalues on a new figure: full where samples stay bounded, hollow where they grow."""
    colour = FAMILIES[family(analysis.method)]
    z = np.atleast_1d(analysis.eigenvalues).reshape(len(analysis.eigenvalues), -1)
    stable = np.broadcast_to(np.asarray(analysis.stable).reshape(1, -1), z.shape)
    with np.errstate(over="ignore", invalid="ignore"):
        exact = np.exp(np.asarray(analysis.rates * analysis.dt)).reshape(z.shape)
    known, single = np.isfinite(z), z.shape[1] == 1
    size = np.abs(z[known]).max(initial=0.0)
    reach = float(np.clip(1.12 * size, NEAREST, FARTHEST))
    with page(9.0, 8.2) as figure:
        from matplotlib.patches import Circle

        axes = figure.add_axes((0.1, 0.135, 0.86, 0.735))
        axes.add_patch(Circle((0.0, 0.0), 1.0, facecolor="#f0f0f0", edgecolor="#888888", linewidth=1.2, zorder=0))
        axes.axhline(0.0, color="#cccccc", linewidth=0.8, zorder=0.5)
        axes.axvline(0.0, color="#cccccc", linewidth=0.8, zorder=0.5)
        mark: dict[str, Any] = {"linestyle": "", "marker": "o", "markersize": 10.0 if single else 5.0, "zorder": 3}
        for chosen, face, label in ((stable, colour, "bounded samples"), (~stable, "white", "growing samples")):
            shown = z[chosen & known]
            if shown.size:
                axes.plot(shown.real, shown.imag, color=colour, markerfacecolor=face, markeredgewidth=1.8, label=label, **mark)
        if z.shape[1] <= EXACT_UP_TO and np.isfinite(exact).any():
            there = exact[np.isfinite(exact)]
            axes.plot(
                there.real,
                there.imag,
                linestyle="",
                marker="+",
                markersize=15 if single else 6,
                color="black",
                label="exact",
                zorder=4,
            )
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="Re z", ylabel="Im z")
        axes.legend(loc="upper left", frameon=False, handletextpad=0.2)
        title(figure, 0.02, 0.955, finding(analysis), 18)
        figure.text(0.02, 0.918, textwrap.shorten(repr(analysis.system), 95, placeholder=" …"), size=12, color=GREY)
        figure.text(0.02, 0.015, "\n".join(_notes(analysis, z, reach)), size=12, color=GREY, linespacing=1.3)
    return figure


def finding(analysis: Analysis) -> str:
    """The behaviour of the samples, as a title."""
    title = analysis.method.title
    stable = np.asarray(analysis.stable)
    if stable.ndim:
        return f"{title}: {np.count_nonzero(stable)} of {stable.size} stable"
    return f"{title}, dt = {analysis.dt:g}: {analysis.kind}"


def _notes(analysis: Analysis, z: np.ndarray[Any, Any], reach: float) -> list[str]:
    """The largest eigenvalue in numbers, and the number of eigenvalues outside the picture."""
    inside = "Eigenvalues z of a step. Inside the grey unit circle a mode decays, outside it grows."
    if np.asarray(analysis.stable).ndim:
        text = "Exact: e^(λ·dt)." if z.shape[1] <= EXACT_UP_TO else ""
    else:
        text = f"Exact: e^(λ·dt). Largest: r₁ = {analysis.radius:.9g}"
        text += f", angle Ψ = {analysis.angle:.5g}"
        if np.isfinite(analysis.frequency_ratio):
            text += f", Ψ/Φ = {analysis.frequency_ratio:.7g}"
        text += "."
    beyond = int((~np.isfinite(z) | (np.maximum(np.abs(z.real), np.abs(z.imag)) > reach)).sum())
    if beyond:
        text += f" Not in the picture: {beyond} of {z.size}."
    return [inside, text.strip()]
