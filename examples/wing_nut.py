"""Dzhanibekov's wing nut: a body that spins about its middle axis turns over and over.

With ``picture("wing_nut.png")`` it is drawn: ω along the body's axes over time, and the
nut below, seen from the side.
"""

import numpy as np
import stepwell as sw

DT = 0.05
# space's second axis, along which it spins, is up
FROM_THE_SIDE = np.array([[1.0, 0.0, -0.45], [0.0, 1.0, 0.25]])

#: The body's axes with a colour each, and where their names stand in the picture.
AXES = (
    ("ω₁, smallest moment", "#0072b2", (2.1, -0.62)),
    ("ω₂, middle moment", "#000000", (2.1, 1.08)),
    ("ω₃, largest moment", "#d55e00", (12.9, 0.38)),
)


def spin() -> sw.Run:
    """Two of its periods by RK4."""
    return sw.scenes.dzhanibekov().run("rk4", DT, every=1, record="angular_momentum")


def picture(path: str) -> None:
    """Draw ω over one period, and the nut every few units of time."""
    from matplotlib.figure import Figure

    run = spin()
    shown = run.t <= 40.5
    figure = Figure(figsize=(14.0, 7.0))
    above = figure.add_axes((0.06, 0.46, 0.92, 0.43))
    below = figure.add_axes((0.06, 0.02, 0.92, 0.33))
    for i, (name, color, at) in enumerate(AXES):
        above.plot(run.t[shown], run.v[shown, i], color=color, linewidth=2.2)
        above.text(*at, name, color=color, size=13)
    above.axhline(0.0, color="#cccccc", linewidth=0.8, zorder=0)
    above.set(
        xlim=(-1.3, 40.3),
        ylim=(-1.15, 1.35),
        xlabel="time, in the inverse of the spin at the start",
    )
    above.set_ylabel("ω along body axes, rad per unit of time")
    figure.text(
        0.012,
        0.94,
        "Spin about the middle axis is unstable: the wing nut turns over",
        size=18,
        weight="bold",
    )
    for t in np.arange(0.0, 40.0, 2.6):
        turn = sw.quaternion.matrix(run.y[round(t / DT)])
        wings, shaft = (FROM_THE_SIDE @ turn[:, axis] for axis in (0, 1))
        for start, end, color, width in (
            (-wings, wings, "#0072b2", 6.0),
            (0.0 * shaft, 1.7 * shaft, "#000000", 3.0),
        ):
            line = np.stack(
                [t + 0.62 * np.array([start[0], end[0]]), [start[1], end[1]]]
            )
            below.plot(*line, color=color, linewidth=width, solid_capstyle="round")
        below.text(t, -2.35, f"t = {t:.3g}", ha="center", size=11, color="#666666")
    below.set(xlim=above.get_xlim(), ylim=(-2.5, 2.0))
    below.set_axis_off()
    figure.savefig(path, dpi=100, facecolor="white")


def main() -> None:
    run = spin()
    for i in np.flatnonzero(np.diff(np.sign(run.v[:, 1]))):
        print(f"it turns over at t = {run.t[i]:.2f}")
    drift = abs(
        run.recorded["angular_momentum"] - run.recorded["angular_momentum"][0]
    ).max()
    print(
        f"the angular momentum stays within {drift:.1e}, the energy within "
        f"{np.ptp(run.energy):.1e}"
    )


if __name__ == "__main__":
    main()
