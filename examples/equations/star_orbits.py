"""Stars go from order to chaos as their energy grows
==================================================

Celestial mechanics: orbits of stars in a galaxy, from order to chaos.

Hénon and Heiles (1964) asked whether a star has a further constant of motion beside its
energy. At low energy, the points where an orbit crosses the plane x = 0 lie on curves:
it has. At a higher one those of most orbits scatter over an area: they have not.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw


@sw.system
def star(t, v, y):
    return np.array([-y[0] - 2.0 * y[0] * y[1], -y[1] - y[0] ** 2 + y[1] ** 2])


@star.invariant
def energy(v, y):
    return 0.5 * (np.dot(v, v) + np.dot(y, y)) + y[0] ** 2 * y[1] - y[1] ** 3 / 3.0


def section(level, members=28, steps=24_000, dt=0.05):
    """Crossings of x = 0 with a positive ẋ, as (y, ẏ), of orbits with this energy.

    They begin at x = 0 and ẏ = 0.
    """
    # where all energy is potential
    ends = np.sort(np.roots([-1.0 / 3.0, 0.5, 0.0, -level]).real)[:2]
    y = np.linspace(*ends, members + 2)[1:-1]
    speed = np.sqrt(2.0 * level - y**2 + 2.0 / 3.0 * y**3)
    run = sw.integrate(
        star(),
        "leapfrog",
        v=[speed, 0 * y],
        y=[0 * y, y],
        dt=dt,
        steps=steps,
        every=1,
        record="energy",
    )
    # Leapfrog keeps another energy, which differs by h²/12·(…) − h²/24·(…) of numbers
    # below 1, and so does not drift.
    assert abs(run.recorded["energy"] - level).max() < dt**2 / 4
    before, after = run.y[:-1, 0], run.y[1:, 0]
    k = (before < 0.0) & (after >= 0.0)
    share = before[k] / (before[k] - after[k])
    return [
        block[:-1, 1][k] * (1 - share) + block[1:, 1][k] * share
        for block in (run.y, run.v)
    ]


def main(folder: Path) -> None:
    saddles = sw.equilibria(
        star(), near=(0.0, np.array([[0.0, 0.9, -0.9], [0.9, -0.5, -0.5]]))
    )
    escape = [float(energy(0.0 * each.y, each.y)) for each in saddles]
    assert np.allclose(escape, 1 / 6, rtol=1e-12), escape

    figure = plt.figure(figsize=(7.2, 4.0), dpi=120, layout="constrained")
    both = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, level, title in zip(
        both,
        (1 / 12, 1 / 8),
        ("E = 1/12: curves, so order", "E = 1/8: islands in a sea of chaos"),
        strict=True,
    ):
        y, v = section(level)
        assert (v**2 / 2 + y**2 / 2 - y**3 / 3 < level + 0.05**2).all()
        axes.plot(y, v, ".", color="#000000", markersize=0.8)
        axes.set(title=title, xlabel="y")
        axes.spines[["top", "right"]].set_visible(False)
    both[0].set(ylabel="ẏ where the orbit crosses x = 0")
    figure.savefig(folder / "star_orbits.png")
    print(f"{len(y)} crossings at E = 1/8; stars escape beyond E = {escape[0]:.6f}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
