"""Which poles a controller catches
================================

Control: which tilts a motor can catch, for every gain.

A pole stands on a cart of mass M with a bob of mass m on top; the motor pushes with F =
gain·tilt + damping·(its rate), at most LIMIT. A pole at rest comes back only if
F·cos(tilt) is above (M + m)·g·sin(tilt): gain > (M + m)·g·tan(tilt)/tilt, and tan(tilt)
< LIMIT/((M + m)·g).
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

CART, BOB, LENGTH, G, LIMIT = 1.0, 0.5, 0.8, 9.81, 10.0  # kg, kg, m, m/s², N
WEIGHT = (CART + BOB) * G


@sw.system
def cart_pole(t, v, y, *, gain=30.0, damping=8.0):
    turning = v[1]  # of the pole, in rad/s; v[0] is the speed of the cart, in m/s
    sine, cosine = np.sin(y[1]), np.cos(y[1])
    push = np.clip(gain * y[1] + damping * turning, -LIMIT, LIMIT)
    cart = (push + BOB * sine * (LENGTH * turning**2 - G * cosine)) / (
        CART + BOB * sine**2
    )
    return np.array([cart, (G * sine - cart * cosine) / LENGTH])


def main(folder: Path) -> None:
    gain, tilt = np.linspace(10.0, 60.0, 101), np.radians(np.linspace(0.5, 50.0, 100))
    start = np.stack(np.broadcast_arrays(0.0, tilt[:, None]))
    run = sw.integrate(
        cart_pole(gain=gain), "rk4", v=0.0, y=start, dt=0.01, steps=1000, every=100
    )
    caught = (abs(run.y[:, 1]) < np.pi / 2).all(axis=0) & (
        abs(run.y[-1, 1]) < tilt[:, None]
    )
    predicted = (gain > WEIGHT * np.tan(tilt[:, None]) / tilt[:, None]) & (
        np.tan(tilt[:, None]) < LIMIT / WEIGHT
    )
    assert (caught == predicted).all(), np.argwhere(caught != predicted)

    figure = plt.figure(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    axes.contourf(
        gain,
        np.degrees(tilt),
        caught,
        levels=[-0.5, 0.5, 1.5],
        colors=["#ffffff", "#b3d3e8"],
    )
    border = np.radians(np.linspace(0.5, np.degrees(np.arctan(LIMIT / WEIGHT)), 100))
    axes.plot(WEIGHT * np.tan(border) / border, np.degrees(border), "k--")
    axes.plot(
        [WEIGHT * np.tan(border[-1]) / border[-1], 60.0],
        np.degrees(border[[-1, -1]]),
        "k-",
    )
    axes.text(37, 15, "caught", ha="center", fontsize=14)
    axes.text(37, 43, "falls", ha="center", fontsize=14)
    axes.text(58, 35, "the motor's limit: tan(tilt) = 10 N/((M + m)·g)", ha="right")
    axes.text(
        14.2,
        5,
        "the gain's limit:\n(M + m)·g·tan(tilt)/tilt",
        ha="right",
        fontsize=9,
        rotation=90,
    )
    axes.set(
        xlabel="gain in N per rad of tilt",
        ylabel="tilt at the start, in degrees",
        xlim=(10, 60),
        ylim=(0.5, 50),
    )
    axes.set_title("Two formulas predict which of 10 100 poles a cart catches")
    figure.savefig(folder / "cart_pole.png")
    print(
        f"{caught.sum()} of {caught.size} poles are caught, all those that the two "
        "formulas predict and no other"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
