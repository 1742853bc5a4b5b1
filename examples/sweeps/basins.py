"""A magnetic pendulum: where it comes to rest
===========================================

An iron bob on a thread is let go at rest above three magnets. Over which of them does
it stop? Close to a magnet over that one; further out, starts that end over different
magnets lie side by side. Every picture element is a run, and is judged when its energy
is below that of the lowest pass between magnets: friction gives none, so it stays.

``basins.py pictures --size 2000`` makes four million runs in chunks; with ``--store
basins.zarr`` it goes on after Ctrl-C.
"""

import argparse
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw
from matplotlib.colors import ListedColormap

GRAVITY, FRICTION, HEIGHT = 0.5, 0.2, 0.3
# starts are within ±EXTENT; the time of each run, and its steps
EXTENT, END, STEPS = 2.4, 40.0, 1000
HALF = np.sqrt(0.75)
# of strength 1; the first two mirror each other
MAGNETS = np.array([(-HALF, -0.5), (HALF, -0.5), (0.0, 1.0)])
COLOURS = ("#f2d16b", "#2b8c96", "#3a0f4a")  # apart for every eye, and in grey


# Small swings, at a height above the magnets: v̇ = −g·y − δ·v + Σ (p − y)/(|p − y|² +
# h²)^(3/2). A mirrored start makes mirrored
# operations, so the map is its own mirror image to the last bit.
@sw.system(shape=(2,))
def pendulum(t, v, y, *, gravity=GRAVITY, friction=FRICTION, height=HEIGHT):
    pulls = []
    for east, north in MAGNETS.tolist():
        away = np.array([east - y[0], north - y[1]])
        r2 = away[0] ** 2 + away[1] ** 2 + height**2
        pulls.append(1.0 / (r2 * np.sqrt(r2)) * away)
    # p₀ + p₁ is the same in a mirror
    return ((pulls[0] + pulls[1]) + pulls[2]) - gravity * y - friction * v


def energy(v, y):
    """Of states of shape (2, …)."""
    r2 = [
        (y[0] - east) ** 2 + (y[1] - north) ** 2 + HEIGHT**2 for east, north in MAGNETS
    ]
    return (
        0.5 * (v * v).sum(axis=0)
        + 0.5 * GRAVITY * (y * y).sum(axis=0)
        - sum(1.0 / np.sqrt(each) for each in r2)
    )


def lowest_pass():
    """The energy that a bob needs to get from one magnet to another."""
    near = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 7)])).reshape(2, -1)
    found = sw.equilibria(pendulum(), near=(np.zeros(near.shape), near))
    return min(float(energy(each.v, each.y)) for each in found if "saddle" in each.kind)


def nearest(y):
    """The number of the magnet that is nearest, from 0 on."""
    return np.argmin(
        [np.hypot(y[0] - east, y[1] - north) for east, north in MAGNETS], axis=0
    )


def magnet(bound, run):
    """The number of the magnet that holds each bob in the end; −1 if none does yet."""
    v, y = run.v[-1], run.y[-1]
    return {"magnet": np.where(energy(v, y) < bound, nearest(y), -1).astype(np.int8)}


def side(size):
    """The starts along one side, mirrored at zero to the last bit."""
    return (np.arange(size) - 0.5 * (size - 1)) * (2.0 * EXTENT / size)


def basins(size, bound, finer=1, **options):
    """A sweep over the places at which the bob is let go."""
    starts = np.stack(np.broadcast_arrays(side(size), side(size)[:, np.newaxis]))
    return sw.sweep(
        pendulum,
        {"y": (("north", "east"), starts)},
        "rk4",
        v=0.0,
        dt=END / STEPS / finer,
        steps=STEPS * finer,
        outcomes=partial(magnet, bound),
        **options,
    )


def check(held, bound, size):
    """What is known of the map."""
    mirror = np.array([-1, 1, 0, 2])  # a mirrored start ends over the mirrored magnet
    np.testing.assert_array_equal(mirror[held[:, ::-1] + 1], held)
    starts = np.stack(np.broadcast_arrays(side(size), side(size)[:, np.newaxis]))
    # starts that can never leave
    below = energy(np.zeros(starts.shape), starts) < bound
    assert below.any()
    np.testing.assert_array_equal(held[below], nearest(starts)[below])


def draw(held, undecided):
    figure, axes = plt.subplots(figsize=(6.4, 6.6), dpi=120, layout="constrained")
    colours = ListedColormap(["#ffffff", *COLOURS])
    axes.imshow(
        held,
        cmap=colours,
        vmin=-1.5,
        vmax=2.5,
        origin="lower",
        extent=2 * (-EXTENT, EXTENT),
        interpolation="nearest",
    )
    for (east, north), colour in zip(MAGNETS, COLOURS, strict=True):
        axes.plot(
            east,
            north,
            "o",
            color=colour,
            markeredgecolor="#ffffff",
            markeredgewidth=2.5,
            markersize=14,
        )
    axes.set(xlabel="start, west to east", ylabel="start, south to north")
    axes.set_title(
        f"Near a magnet (circle) it is certain where the pendulum stops,\n"
        f"yet {undecided:.0%} of all starts have a neighbour that ends elsewhere"
    )
    return figure


def main(folder, size=120, store=None):
    bound = lowest_pass()
    found = basins(
        size, bound, progress=size > 500, **({} if store is None else {"store": store})
    )
    held = found.magnet.values
    check(held, bound, size)
    elsewhere = np.zeros(held.shape, dtype=bool)
    elsewhere[:-1] |= held[1:] != held[:-1]
    elsewhere[:, :-1] |= held[:, 1:] != held[:, :-1]
    draw(held, elsewhere.mean()).savefig(folder / "basins.png")

    few = 32
    same = basins(few, bound).magnet.values == basins(few, bound, finer=2).magnet.values
    print(
        f"{held.size} starts, {np.count_nonzero(held < 0)} not held yet, bits "
        f"{found.attrs['bits']}"
    )
    print(
        f"{elsewhere.mean():.1%} have a neighbour that ends elsewhere; with half the "
        f"step {1.0 - same.mean():.1%} end elsewhere"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="The basins of a magnetic pendulum.")
    parser.add_argument(
        "folder", nargs="?", default=".", type=Path, help="where the picture is written"
    )
    parser.add_argument("--size", default=120, type=int, help="starts along a side")
    parser.add_argument("--store", help="a path ending in .zarr or .nc for the results")
    main(**vars(parser.parse_args()))
