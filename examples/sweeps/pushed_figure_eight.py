"""Pushed off the figure-eight, most bodies stay together
======================================================

Three bodies go round a figure of eight if they start with just the right velocities.
Here each start is a little off: the first two have the velocity (a + Δa, b + Δb), the
third −2 times that, so that momentum and angular momentum stay zero. Leapfrog with 300
steps a turn throws most of them out. That is its own doing: it does not follow close
encounters, which adaptive steps do.

``pushed_figure_eight.py pictures --size 317`` makes a hundred thousand runs of each.
"""

import argparse
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw
from matplotlib.colors import ListedColormap, LogNorm

SCENE = sw.scenes.figure_eight()
# velocities are off by at most ±WIDTH; steps are those of a turn
WIDTH, TURNS, STEPS = 0.12, 30, 300
OBSERVED = 10  # states of a turn that are judged
# then a body is thrown out; in the figure-eight two are never more than 2.2 apart
APART = 4.0
MAX_STEPS = 600 * TURNS  # what needs more has met another body very closely


def separation(t, v, y):
    """The square of the largest distance of two bodies; y is of shape (3, 2, …)."""
    pairs = [
        (y[i, 0] - y[j, 0]) ** 2 + (y[i, 1] - y[j, 1]) ** 2
        for i, j in ((0, 1), (1, 2), (2, 0))
    ]
    return np.maximum(np.maximum(pairs[0], pairs[1]), pairs[2])


def thrown_out(size, method, **options):
    """A sweep over the velocities: the turn in which two bodies are first far apart.

    NaN if they never are.
    """
    off = np.linspace(-WIDTH, WIDTH, size)
    first = np.stack(
        np.broadcast_arrays(SCENE.v[0, 0] + off, (SCENE.v[0, 1] + off)[:, np.newaxis])
    )
    axes = {"v": (("up", "right"), np.stack([first, first, -2.0 * first]))}
    outcome = sw.sweeps.Crossing(separation, APART**2, name="apart")
    found = sw.sweep(
        SCENE.system,
        axes,
        method,
        y=SCENE.y,
        outcomes=["last", outcome],
        progress=size > 200,
        **options,
    )
    return found, found.apart_crossing.values / SCENE.period


def draw(maps):
    figure, both = plt.subplots(
        1, 2, figsize=(9.6, 4.6), dpi=110, layout="constrained", sharey=True
    )
    colours = ListedColormap(
        plt.get_cmap("YlOrBr")(np.linspace(0.1, 0.75, 256))
    ).with_extremes(bad="#10123a")
    for axes, (title, turns) in zip(both, maps.items(), strict=True):
        mapped = axes.imshow(
            turns,
            cmap=colours,
            norm=LogNorm(0.3, TURNS),
            origin="lower",
            extent=2 * (-WIDTH, WIDTH),
        )
        axes.plot(
            0.0,
            0.0,
            "o",
            markerfacecolor="none",
            markeredgecolor="#ffffff",
            markeredgewidth=1.5,
            markersize=10,
        )
        axes.set(
            xlabel="velocity off by Δa",
            title=f"{title}: {np.isnan(turns).mean():.0%} stay together",
        )
    both[0].set_ylabel("velocity off by Δb")
    figure.colorbar(
        mapped,
        ax=both,
        label="turns until one is thrown out",
        ticks=[0.3, 1, 3, 10, 30],
        format="%g",
    )
    figure.suptitle(
        f"Three bodies near the figure-eight (circle), {TURNS} turns; dark: together "
        "to the end"
    )
    return figure


def main(folder, size=35):
    fixed = {
        "dt": SCENE.period / STEPS,
        "steps": TURNS * STEPS,
        "observe": STEPS // OBSERVED,
    }
    by_leapfrog = thrown_out(size, "leapfrog", **fixed)[1]
    at = SCENE.period / OBSERVED * np.arange(TURNS * OBSERVED + 1)
    with warnings.catch_warnings():
        # of those that need more steps, or cannot be followed
        warnings.simplefilter("ignore", sw.ToleranceWarning)
        found, turns = thrown_out(
            size, "taylor", tolerance=1e-10, at=at, max_steps=MAX_STEPS
        )
    # Most of what needs more steps was thrown out before; a few end where two bodies
    # meet so closely that no step moves the time.
    unknown = np.isnan(turns[found.status.values > 0])
    assert np.count_nonzero(unknown) <= turns.size / 200
    if size % 2:
        itself = found.y_last.values[size // 2, size // 2]
        # the figure-eight ends where it began
        assert abs(itself - SCENE.y).max() < 1e-6
    draw({"Leapfrog": by_leapfrog, "Adaptive steps": turns}).savefig(
        folder / "pushed_figure_eight.png"
    )
    print(
        f"{turns.size} starts, {np.count_nonzero(found.status)} need more steps, bits "
        f"{found.attrs['bits']}"
    )
    told = (f"{np.isnan(each).mean():.1%}" for each in (by_leapfrog, turns))
    print(
        "together after {} turns: {} by leapfrog, {} with adaptive steps".format(
            TURNS, *told
        )
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description="Which velocities near the figure-eight keep three bodies together."
    )
    parser.add_argument(
        "folder", nargs="?", default=".", type=Path, help="where the picture is written"
    )
    parser.add_argument("--size", default=35, type=int, help="starts along a side")
    main(**vars(parser.parse_args()))
