"""An epidemic ends with the share that a formula foretells
========================================================

Epidemics: how many fall ill in all, for every reproduction number.

Where nobody is immune at first, the share z that falls ill in the end solves z = 1 −
exp(−R0·z) (Kermack and McKendrick 1927). At the peak 1 − (1 + ln R0)/R0 are ill at
once.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

FIRST = 1e-4  # the share that is ill at the start


@sw.system(order=1)
def epidemic(t, y, *, r0=2.0, duration=5.0):  # shares of the population; days
    healthy, ill = y
    infections = r0 / duration * healthy * ill
    return np.array([-infections, infections - ill / duration])


def main(folder: Path) -> None:
    r0 = np.linspace(0.5, 4.0, 71)
    start = np.array([[1.0 - FIRST], [FIRST]])
    run = sw.integrate(epidemic(r0=r0), "rk4", y=start, dt=0.5, steps=8000, every=1)
    in_all, at_once = 1.0 - run.y[-1, 0], run.y[:, 1].max(axis=0)
    true = np.ones_like(r0)
    for _ in range(2000):
        true = 1.0 - (1.0 - FIRST) * np.exp(-r0 * true)
    assert abs(in_all - true).max() < 1e-5
    above = np.maximum(r0, 1.0)
    peak = 1.0 - (1.0 + np.log(above)) / above
    # The formula is for very few at the start. Half a step from the peak
    # (dt/duration)²/8 of it is missing at most.
    assert abs(at_once - peak).max() < FIRST + 0.1**2 / 8

    figure = plt.figure(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    axes.plot(r0, 100 * true, color="#0072b2")
    axes.plot(r0, 100 * peak, color="#d55e00", linestyle="--")
    axes.plot(r0[::2], 100 * in_all[::2], "o", color="#0072b2", markersize=4)
    axes.plot(r0[::2], 100 * at_once[::2], "s", color="#d55e00", markersize=4)
    axes.text(
        2.05,
        72,
        "fall ill in all\n(line: z = 1 − exp(−R0·z))",
        color="#0072b2",
        va="top",
    )
    axes.text(
        2.35,
        12,
        "are ill at once, at the peak\n(line: 1 − (1 + ln R0)/R0)",
        color="#d55e00",
        va="top",
    )
    axes.set(
        xlabel="reproduction number R0",
        ylabel="% of the population",
        xlim=(0.5, 4),
        ylim=(-2, 102),
    )
    axes.set_title("An epidemic stops only after most have had it, unless R0 is near 1")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(folder / "epidemic.png")
    print(
        f"at R0 = {r0[30]:g} {100 * in_all[30]:.2f} % fall ill; the formula says "
        f"{100 * true[30]:.2f} %"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
