"""Predators and prey go round in a loop, if the method lets them
==============================================================

Ecology: predators and prey, whose numbers go round for ever.

In logarithms Lotka's and Volterra's equations are a pair of blocks, each of which
depends on the other alone. False Euler then stays on a closed curve at the cost of
Standard Euler, which spirals outward. Over time, mean numbers are those of the
equilibrium (Volterra 1926).
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

BIRTHS, HUNTED, EATEN, DEATHS = 1.0, 0.5, 0.2, 0.8  # per year; numbers in thousands


@sw.system(blocks=2)
def predators(t, v, y, *, births=BIRTHS, hunted=HUNTED, eaten=EATEN, deaths=DEATHS):
    # v: log of predators, y: log of prey
    return eaten * np.exp(y) - deaths, births - hunted * np.exp(v)


@predators.invariant
def orbit(v, y, *, births, hunted, eaten, deaths):
    return eaten * np.exp(y) - deaths * y + hunted * np.exp(v) - births * v


def main(folder: Path) -> None:
    start = {
        "v": np.log(1.0),
        "y": np.log(4.0),
        "dt": 0.05,
        "steps": 20_000,
        "every": 1,
        "record": "orbit",
    }
    closed = sw.integrate(predators(), "false_euler", **start)
    spiral = sw.integrate(predators(), "standard_euler", **start | {"steps": 600})
    # The difference to a neighbouring motion's invariant is of the order of the step,
    # and does not grow.
    kept = abs(closed.recorded["orbit"] - closed.recorded["orbit"][0]).max()
    assert kept < 0.05, kept
    assert spiral.recorded["orbit"][-1] - spiral.recorded["orbit"][0] > 5 * kept

    # Summed over all steps, v' − v = dt·(eaten·prey − deaths): the mean is the
    # equilibrium but for v's range over the time.
    prey = np.exp(closed.y[:-1]).mean()
    assert abs(prey - DEATHS / EATEN) <= np.ptp(closed.v) / EATEN / closed.t[-1]

    figure = plt.figure(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    axes.plot(
        np.exp(spiral.y),
        np.exp(spiral.v),
        color="#d55e00",
        linestyle="--",
        linewidth=1.2,
    )
    axes.plot(np.exp(closed.y), np.exp(closed.v), color="#0072b2", linewidth=2.5)
    axes.plot(
        prey, np.exp(closed.v[:-1]).mean(), "k+", markersize=12, markeredgewidth=2
    )
    axes.text(4.0, 1.8, "mean of 1000 years,\nand equilibrium", ha="center", va="top")
    axes.text(
        4.1, 3.1, "False Euler:\nin 1000 years", color="#0072b2", ha="center", va="top"
    )
    axes.text(8.9, 4.3, "Standard Euler:\nin 30 years", color="#d55e00")
    axes.set(
        xlabel="prey in thousands",
        ylabel="predators in thousands",
        xlim=(0, 12),
        ylim=(0, 5.2),
    )
    axes.set_title("Predators and prey go round in a loop, if the method lets them")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(folder / "predators.png")
    print(
        f"mean prey over 1000 years: {prey:.4f} thousand; in equilibrium "
        f"{DEATHS / EATEN:.4f}"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
