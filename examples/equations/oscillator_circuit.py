"""Weak and strong triodes follow two known laws
=============================================

Circuits: the period of Van der Pol's oscillator, from a gentle hum to relaxation.

With a weak triode (small µ) it swings like a coil and a capacitor, with the period
2π·(1 + µ²/16) (Lindstedt); with a strong one it charges and tips over, with the period
(3 − 2·ln 2)·µ + 7.0143·µ^(−1/3) (Haag, Dorodnitsyn).
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw


@sw.system
def van_der_pol(t, v, y, *, mu=1.0):
    return mu * (1.0 - y**2) * v - y


def periods(run):
    """The time between the last two passages of zero upwards, of each member.

    Within a step they lie on a straight line.
    """
    found = []
    for y in run.y.T:
        k = np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))[-2:]
        found.append(
            np.diff(run.t[k] - y[k] / (y[k + 1] - y[k]) * (run.t[1] - run.t[0]))[0]
        )
    return np.array(found)


def main(folder: Path) -> None:
    mu = 10.0 ** np.linspace(-1.0, 1.3, 47)
    period = periods(
        sw.integrate(
            van_der_pol(mu=mu), "rk4", v=0.0, y=2.0, dt=0.005, steps=30_000, every=2
        )
    )
    weak, strong = (
        2.0 * np.pi * (1.0 + mu**2 / 16.0),
        (3.0 - 2.0 * np.log(2.0)) * mu + 7.0143 * mu ** (-1.0 / 3.0),
    )
    # µ = 1, from many digits; a straight line is 0.01²/8 off
    assert abs(period[20] - 6.663286859) < 1e-4, period[20]
    # The next term of the first series is −2π·5·µ⁴/3072, and all others together are
    # less than a fifth of it where µ < 0.7.
    assert (abs(period - weak) < 1.2 * 2.0 * np.pi * 5.0 * mu**4 / 3072.0 + 1e-4)[
        mu < 0.7
    ].all()
    assert abs(period[-1] / strong[-1] - 1.0) < 0.01

    figure = plt.figure(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    axes.loglog(mu[mu < 6], weak[mu < 6], color="#0072b2", linewidth=2)
    axes.loglog(
        mu[mu > 0.3], strong[mu > 0.3], color="#d55e00", linestyle="--", linewidth=2
    )
    axes.loglog(mu, period, "o", color="#000000", markersize=4)
    axes.text(0.11, 6.9, "a hum: 2π·(1 + µ²/16)", color="#0072b2")
    axes.text(5.5, 9.0, "relaxation:\n1.614·µ + 7.014·µ$^{-1/3}$", color="#d55e00")
    axes.text(2.6, 7.0, "dots: 47 circuits in one call")
    axes.set_xticks([0.1, 1, 10], ["0.1", "1", "10"])
    axes.set_yticks([5, 10, 20, 40], ["5", "10", "20", "40"])
    axes.minorticks_off()
    axes.set(xlabel="strength of the triode µ", ylabel="period, in units of √(LC)")
    axes.set_title("Weak and strong triodes follow two known laws")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(folder / "oscillator_circuit.png")
    print(
        f"period {period[0]:.4f} at µ = 0.1, {period[-1]:.3f} at µ = 20; the two laws "
        f"say {weak[0]:.4f} and {strong[-1]:.3f}"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
