"""How hard may the figure-eight be pushed?
========================================

Three bodies go round a figure of eight if they start with just the right velocities. Here each start is a little off: the first
two have the velocity (a + Δa, b + Δb), the third −2 times that, so that momentum and angular momentum stay zero. Which are
together after a hundred turns? Leapfrog makes the runs; some are made again with adaptive steps, to see how much of the map is
the method's.

``pushed_figure_eight.py pictures --size 317`` makes a hundred thousand runs.
"""

import argparse
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw
from matplotlib.colors import LogNorm

SCENE = sw.scenes.figure_eight()
WIDTH, TURNS, STEPS = 0.06, 100, 300  # velocities are off by at most ±WIDTH; steps are those of a turn
APART = 4.0  # a body is thrown out; in the figure-eight two are never more than 2.2 apart


def separation(t, v, y):
    """The largest distance between two bodies; y has the shape (3, 2, …)."""
    pairs = [(y[i, 0] - y[j, 0]) ** 2 + (y[i, 1] - y[j, 1]) ** 2 for i, j in ((0, 1), (1, 2), (2, 0))]
    return np.sqrt(np.maximum(np.maximum(pairs[0], pairs[1]), pairs[2]))


def velocities(size):
    """Starts along Δb and Δa, shape (3, 2, size, size), and the Δ along one side."""
    off = np.linspace(-WIDTH, WIDTH, size)
    first = np.stack(np.broadcast_arrays(SCENE.v[0, 0] + off, (SCENE.v[0, 1] + off)[:, np.newaxis]))
    return np.stack([first, first, -2.0 * first]), off


def thrown_out(size, method, **options):
    """A sweep over the velocities: in which turn two bodies are first so far apart, NaN if they never are."""
    v, off = velocities(size)
    outcome = sw.sweeps.Crossing(separation, APART, name="apart")
    found = sw.sweep(SCENE.system, {"v": (("up", "right"), v)}, method, y=SCENE.y, outcomes=outcome, **options)
    return found.assign_coords(up=off, right=off), found.apart_crossing.values / SCENE.period


def draw(turns, share):
    figure, axes = plt.subplots(figsize=(7.2, 6.2), dpi=120, layout="constrained")
    colours = plt.get_cmap("cividis_r").copy()
    colours.set_bad("#111111")
    mapped = axes.imshow(turns, cmap=colours, norm=LogNorm(1, TURNS), origin="lower", extent=2 * (-WIDTH, WIDTH))
    axes.plot(0.0, 0.0, "o", markerfacecolor="none", markeredgecolor="#ffffff", markeredgewidth=2, markersize=12)
    arrow = {"arrowstyle": "->", "color": "#ffffff"}
    axes.annotate("the figure-eight", (0.0, 0.0025), (-0.045, 0.045), color="#ffffff", arrowprops=arrow)
    axes.set(xlabel="velocity off by Δa, to the right", ylabel="velocity off by Δb, upwards")
    together = f"along a ridge (black): {share:.0%} of starts, for {TURNS} turns"
    axes.set_title(f"Pushed off the figure-eight, three bodies stay together\n{together}")
    figure.colorbar(mapped, ax=axes, label="turns until one body is thrown out", ticks=[1, 3, 10, 30, 100], format="%d")
    return figure


def main(folder, size=81):
    found, turns = thrown_out(
        size, "leapfrog", dt=SCENE.period / STEPS, steps=TURNS * STEPS, observe=STEPS // 10, progress=size > 200
    )
    together = np.isnan(turns)
    if size % 2:
        assert together[size // 2, size // 2]  # the figure-eight itself
    draw(turns, together.mean()).savefig(folder / "pushed_figure_eight.png")

    # With adaptive steps. Who has come very close to another body uses up the steps, and was thrown out or soon will be.
    few, shorter = 11, 20
    at = SCENE.period * np.arange(0.0, shorter + 0.05, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.ToleranceWarning)
        again, exact = thrown_out(few, "dop853", tolerance=1e-10, at=at, max_steps=300 * shorter)
    done = again.status.values == sw.Status.OK
    _, by_leapfrog = thrown_out(few, "leapfrog", dt=SCENE.period / STEPS, steps=shorter * STEPS, observe=STEPS // 10)
    alike = (np.isnan(exact) == np.isnan(by_leapfrog))[done]
    print(f"{together.size} starts, bits {found.attrs['bits']}")
    agree = f"adaptive steps agree on {alike.sum()} of {alike.size} after {shorter}"
    print(f"{together.mean():.1%} are together after {TURNS} turns; {agree}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", default=".", type=Path, help="where the picture is written")
    parser.add_argument("--size", default=81, type=int, help="starts along a side")
    main(**vars(parser.parse_args()))
