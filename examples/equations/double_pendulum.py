"""Runge-Kutta 4 drains a double pendulum; a projection prevents it
================================================================

Mechanics: a double pendulum, and its energy.

Runge-Kutta 4 with 50 steps a second loses energy whenever the swing is wild. A
projection after each step keeps it. Small swings have the frequencies √(g/l·(2 ± √2)),
which checks the equations.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

G, LENGTH, MASS = 9.81, 1.0, 1.0  # m/s², of each rod in m, of each bob in kg


@sw.system
def double_pendulum(t, v, y, *, g=G, rod=LENGTH):
    a, b = y  # angles from straight down, in rad
    sine, cosine = np.sin(a - b), np.cos(a - b)
    matrix = 2.0 - cosine**2
    left = -(v[1] ** 2) * sine - 2.0 * g / rod * np.sin(a)
    right = v[0] ** 2 * sine - g / rod * np.sin(b)
    return np.array(
        [(left - cosine * right) / matrix, (2.0 * right - cosine * left) / matrix]
    )


@double_pendulum.invariant
def energy(v, y, *, g, rod):
    kinetic = rod**2 * (v[0] ** 2 + 0.5 * v[1] ** 2 + v[0] * v[1] * np.cos(y[0] - y[1]))
    return MASS * (kinetic - g * rod * (2.0 * np.cos(y[0]) + np.cos(y[1])))


#: For the command line too: stepwell run double_pendulum.py --method rk4
scene = sw.Scene(double_pendulum(), v=0.0, y=[2.0, 2.5], until=120.0, dt=0.02)


def main(folder: Path) -> None:
    rest = sw.jacobian(double_pendulum(), v=0.0, y=np.zeros(2))
    found, true = (
        np.sort(rest.eigenvalues.imag)[2:],
        np.sqrt(G / LENGTH * np.array([2 - 2**0.5, 2 + 2**0.5])),
    )
    assert np.allclose(found, true, rtol=1e-10), found

    alone = scene.run("rk4", every=5, record="energy")
    projected = scene.run(
        "rk4", every=5, record="energy", control=sw.Projection("energy")
    )
    lost, kept = (
        run.recorded["energy"] - run.recorded["energy"][0] for run in (alone, projected)
    )
    assert abs(kept).max() < 0.01 * abs(lost).max()

    figure = plt.figure(figsize=(7.2, 4.0), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    axes.plot(alone.t, lost, color="#d55e00", linewidth=1.2)
    axes.plot(projected.t, kept, color="#0072b2", linewidth=2.5)
    axes.text(
        66,
        -0.36,
        "Runge-Kutta 4 alone, 50 steps a second",
        color="#d55e00",
        va="bottom",
    )
    axes.text(
        119,
        0.03,
        "with a projection after each step",
        color="#0072b2",
        ha="right",
        va="bottom",
    )
    axes.set(
        xlabel="time in s",
        ylabel="energy gained in J",
        xlim=(0, 120),
        ylim=(None, 0.15),
    )
    axes.set_title("Runge-Kutta 4 drains a double pendulum; a projection prevents it")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(folder / "double_pendulum.png")
    print(
        f"energy after 120 s: {lost[-1]:+.3f} J alone, {kept[-1]:+.5f} J with a "
        "projection"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
