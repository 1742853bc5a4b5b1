"""The stability curves of many methods on two panels: how the energy and the frequency of the oscillator are wrong, over Φ."""

from __future__ import annotations

import numpy as np

from ...base.arrays import Array
from .labels import Label, beside, title
from .style import DPI, GREY, SIZE, Figure, apart, page
from .zplane import Locus, Stability

#: The methods that are shown first, so that each kind is there; others follow in their order up to ``MOST``.
FIRST = ("standard_euler", "false_euler", "standard_heun", "rk4", "pefrl", "dop853", "backward_euler", "implicit_midpoint")
MOST = 8

#: The least Φ, the least error that is drawn, and the largest.
LEAST_PHI, LEAST, LARGEST = 0.1, 1e-10, 3.0

#: Below this, the energy of the oscillator does not change but for rounding.
KEPT = 1e-12


def overview(chart: Stability, shared: list[tuple[Locus, ...]]) -> Figure:
    """Both errors, of up to eight methods that are not the same."""
    chosen = choose(shared)
    with page(*SIZE, dpi=DPI) as figure:
        energy, turns = (figure.add_axes((0.07 + 0.495 * i, 0.25, 0.42, 0.575)) for i in (0, 1))
        methods = [same[0].method for same in chosen]
        kept = []
        for axes, name in ((energy, "energy change in a step, |r₁² − 1|"), (turns, "frequency error, |Ψ/Φ − 1|")):
            axes.set(xscale="log", yscale="log", xlim=(LEAST_PHI, float(chart.phi[-1])), ylim=(LEAST, LARGEST))
            axes.set_title(name, loc="left", size=13.5)
            axes.set_xlabel("Φ = ω₀·dt (rad)")
            axes.set_xticks((0.1, 0.3, 1.0, 3.0), ("0.1", "0.3", "1", "3"))
            axes.set_yticks((1e-8, 1e-6, 1e-4, 1e-2, 1.0))
            axes.minorticks_off()
            axes.grid(which="major", color="#dddddd", linewidth=0.8)
            names = []
            for same in chosen:
                locus = same[0]
                colour = str(apart(methods, locus.method)["color"])
                error = _drawn(locus, np.abs((locus.r1_squared if axes is energy else locus.ratio) - 1.0), energy=axes is energy)
                if not np.isfinite(error).any():
                    kept += [locus.method.title] if axes is energy else []
                    continue
                axes.plot(locus.phi, error, color=colour, linewidth=2.0)
                inside = (error > 3.0 * LEAST) & (error < 0.5) & (locus.phi > LEAST_PHI)
                points = np.array([locus.phi[inside], error[inside]]).T
                names.append(Label(locus.method.title, points, {"color": colour, "weight": "bold", "size": 12.0}))
                if 0.0 < locus.limit <= locus.phi[-1]:
                    last = error[np.isfinite(error)][-1]
                    axes.plot([float(locus.limit)], [np.clip(last, LEAST, LARGEST)], "o", color=colour, markersize=8, zorder=4)
            beside(axes, names)
        title(figure, 0.012, 0.95, finding(chart), 20)
        figure.text(0.012, 0.908, "Undamped oscillator. Both errors are zero in the exact motion.", size=13, color=GREY)
        notes = ["Dot: the stability limit. Beyond it a curve ends, and so where samples no longer oscillate."]
        notes += [f"No change of energy up to the limit: {', '.join(kept)}."] * bool(kept)
        alike = [
            f"{same[0].method.title} = {', '.join(locus.method.title for locus in same[1:])}" for same in chosen if len(same) > 1
        ]
        notes += [f"The same curves: {'; '.join(alike)}."] * bool(alike)
        figure.text(0.012, 0.02, "\n".join(notes), size=11.3, color=GREY, linespacing=1.3)
    return figure


def choose(shared: list[tuple[Locus, ...]]) -> list[tuple[Locus, ...]]:
    """Up to eight groups of methods with the same eigenvalues, each led by the one of it that is named."""
    groups = [tuple(sorted(same, key=lambda locus: locus.method.name not in FIRST)) for same in shared]
    order = sorted(groups, key=lambda same: FIRST.index(same[0].method.name) if same[0].method.name in FIRST else len(FIRST))
    chosen = {same[0].method.name for same in order[:MOST]}
    return [same for same in groups if same[0].method.name in chosen]


def finding(chart: Stability) -> str:
    """Which methods drive the energy up at every step, and how many leave it as it is."""
    gain = [locus.method.title for locus in chart.loci if not locus.limit]
    kept = sum(_kept(locus) for locus in chart.loci)
    words = (
        f"{len(gain)} of {len(chart.loci)} methods gain energy at small steps"
        if gain
        else "No method gains energy at small steps"
    )
    return f"{words}, {kept} {'keeps' if kept == 1 else 'keep'} it exactly" if kept else words


def _kept(locus: Locus) -> bool:
    """True if the energy does not change below the limit."""
    below = locus.phi < (locus.limit or np.inf)
    return bool(locus.limit) and bool((np.abs(locus.r1_squared[below] - 1.0) < KEPT).all())


def _drawn(locus: Locus, error: Array, *, energy: bool) -> Array:
    """The error up to the limit, where samples oscillate; NaN elsewhere and where it is rounding."""
    shown = (locus.eigenvalues[0].imag != 0.0) & (locus.phi <= (locus.limit or np.inf)) & (error > (KEPT if energy else 0.0))
    return np.where(shown, error, np.nan)
