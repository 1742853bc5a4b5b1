"""Luneburg's lens brings parallel rays to one point
=================================================

Optics: Luneburg's lens, a ball of glass that brings all parallel rays to one point of
its rim.

Its index of refraction is n = √(2 − r²) within the ball and 1 outside. A ray follows ÿ
= ½·∇n², with the speed n: within the ball that is a harmonic oscillation, whose quarter
period leads every ray to the far end of the axis (Luneburg 1944).
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

DT = 0.001


@sw.system
def ray(t, v, y):
    inside = np.dot(y, y) < 1.0
    return np.where(inside, -y, 0.0)


@ray.invariant
def speed(v, y):
    """|dy/dt|² − n², which is zero on a ray."""
    return np.dot(v, v) - np.where(np.dot(y, y) < 1.0, 2.0 - np.dot(y, y), 1.0)


def main(folder: Path) -> None:
    height = np.linspace(-0.9, 0.9, 13)
    v, y = (
        np.stack(np.broadcast_arrays(1.0, 0.0 * height)),
        np.stack(np.broadcast_arrays(-1.5, height)),
    )
    run = sw.integrate(
        ray(), "rk4", v=v, y=y, dt=DT, steps=3500, every=5, record="speed"
    )
    along, across = run.y[:, 0], run.y[:, 1]
    # a straight line, which passes the focus at a distance of |(y − focus) × v|
    outside = run.v[-1]
    miss = abs((along[-1] - 1.0) * outside[1] - across[-1] * outside[0])
    # The rim is met within a step, so the force comes and goes up to DT too late, and
    # the invariant is off by as much. A quarter
    # period after it came, the place is the velocity of before, late or not; going late
    # misses the focus by DT²/2 at most.
    assert abs(run.recorded["speed"]).max() < 2 * DT
    assert miss.max() < DT**2 / 2, miss

    figure = plt.figure(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    rim = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.fill(np.cos(rim), np.sin(rim), color="#e3eef5")
    axes.plot(
        along, np.where(along < 1.35, across, np.nan), color="#0072b2", linewidth=1
    )
    axes.plot(1.0, 0.0, "o", color="#d55e00")
    axes.annotate(
        "all meet\nat one point",
        (1.03, 0.0),
        (1.4, 0.0),
        color="#d55e00",
        va="center",
        arrowprops={"arrowstyle": "->"},
    )
    axes.text(0.0, -1.12, "n = √2 in the middle, 1 at the rim", ha="center")
    axes.set(
        xlabel="along the axis, in radii of the lens",
        ylabel="across, in radii",
        aspect="equal",
    )
    axes.set(xlim=(-1.5, 2.1), ylim=(-1.2, 1.1))
    axes.set_title("Luneburg's lens brings parallel rays to one point of its rim")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(folder / "luneburg_lens.png")
    print(f"{len(height)} rays pass the focus within {miss.max():.0e} radii")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
