"""A driven spring doubles its period, again and again
===================================================

v̇ = γ·cos(ωt) − δ·v + y − y³ (Duffing), a spring with two wells. Each dot is a state,
once a period of the drive: one dot above γ if the motion has the period of the drive,
two if it has twice that, a cloud if it is chaotic. The largest Lyapunov exponent tells
which.

``bifurcation.py pictures --size 1000000`` makes a million runs; ``--store
diagram.zarr`` keeps them on disk.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

OMEGA, STEPS = 1.2, 200  # of the drive: its frequency, and the steps in a period
#: Drives whose motions are known, and their periods in those of the drive; 0 is chaos.
KNOWN = {0.20: 1, 0.28: 2, 0.29: 4, 0.37: 5, 0.50: 0, 0.65: 2}


@sw.system
def duffing(t, v, y, *, gamma=0.5, delta=0.3, omega=OMEGA):
    return gamma * np.cos(omega * t) - delta * v + y - y**3


def diagram(gamma, outcomes, steps=STEPS, transient=200, periods=120, **options):
    """A sweep over the drive, with so many steps in a period of it."""
    return sw.sweep(
        duffing,
        {"gamma": ("gamma", gamma)},
        "rk4",
        v=0.0,
        y=1.0,
        dt=2.0 * np.pi / OMEGA / steps,
        transient=transient * steps,
        steps=periods * steps,
        outcomes=outcomes,
        **options,
    )


def period(y):
    """After how many periods of the drive a motion repeats to 0.001; 0 for never."""
    return next((n for n in range(1, 17) if (abs(y[n:] - y[:-n]) < 1e-3).all()), 0)


def draw(found, path):
    figure, axes = plt.subplots(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    gamma, y = np.broadcast_arrays(found.gamma.values[:, np.newaxis], found.y.values)
    if y.size < 1_000_000:
        axes.plot(
            gamma.ravel(),
            y.ravel(),
            ".",
            color="#000000",
            markersize=0.8,
            markeredgewidth=0.0,
        )
    else:  # how often a state is seen, since dots would cover each other
        count, *edges = np.histogram2d(gamma.ravel(), y.ravel(), bins=(1400, 800))
        axes.pcolormesh(*edges, np.log1p(count.T), cmap="Greys", rasterized=True)
    axes.set(
        xlabel="strength of the drive γ",
        ylabel="y, once a period of the drive",
        title="A driven spring doubles its period",
    )
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def main(folder, size=451, store=None):
    large = {"periods": 16, "progress": True} if size > 10_000 else {}
    kept = {} if store is None else {"store": store}
    found = diagram(
        np.linspace(0.2, 0.65, size), "history", every=STEPS, **large, **kept
    )
    print(
        f"{found.sizes['gamma']} drives, {found.sizes['t']} states of each, bits "
        f"{found.attrs['bits']}"
    )
    draw(found, folder / "bifurcation.png")

    gamma = np.array(list(KNOWN))
    known = diagram(gamma, "history", every=STEPS).y
    # Above zero where neighbouring motions part. NumPy makes these steps, so they are
    # few.
    exponents = diagram(gamma, "lyapunov", steps=50, transient=50, periods=100).lyapunov
    for each in gamma:
        one = period(known.sel(gamma=each).values)
        print(
            f"γ = {each:.2f}: period {one or '—'}, Lyapunov exponent "
            f"{float(exponents.sel(gamma=each)[0]):+.3f}"
        )
    assert {
        each: period(known.sel(gamma=each).values) for each in gamma.tolist()
    } == KNOWN
    told = ", ".join(
        f"{period(known.sel(gamma=each).values) or 'chaos'}" for each in gamma
    )
    print(f"periods at γ = {', '.join(f'{each:.2f}' for each in gamma)}: {told}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description="The bifurcation diagram of a driven spring."
    )
    parser.add_argument(
        "folder", nargs="?", default=".", type=Path, help="where the picture is written"
    )
    parser.add_argument(
        "--size", default=451, type=int, help="how many strengths of the drive"
    )
    parser.add_argument("--store", help="a path ending in .zarr or .nc for the results")
    main(**vars(parser.parse_args()))
