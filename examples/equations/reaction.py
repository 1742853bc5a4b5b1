"""A reaction that ticks, and when it does not
===========================================

The Belousov-Zhabotinsky reaction changes its colour again and again, for hours. The
Oregonator (Field and Noyes 1974, in Tyson's form) explains it by three amounts: the
reaction ticks where its rest is unstable. That depends on f, the bromide that is made
for each cerium ion spent: the limits tend to 1/2 and 1 + √2 as the other two amounts
get faster, and are 0.51 and 2.33 here.

It is stiff: in a tick, bromide is used up 50 000 times as fast as cerium. Rodas5P takes
800 steps for five ticks, Dormand-Prince 8(5,3) 158 000. Each of the 261 mixtures has
steps of its own.
"""

import sys
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

# for 0.06 mol/l bromide and 0.8 mol/l acid (Tyson 1985)
EPSILON, FASTER, Q = 9.9e-3, 1.98e-5, 7.62e-5


@sw.system(order=1)
def oregonator(t, y, *, f=1.0):
    """Bromous acid x, bromide b and cerium z, in Tyson's units."""
    x, b, z = y
    return [
        (Q * b - x * b + x * (1.0 - x)) / EPSILON,
        (-Q * b - x * b + f * z) / FASTER,
        x - z,
    ]


def rest(f):
    """The amounts that do not change."""
    x = 0.5 * (1.0 - f - Q + np.sqrt((1.0 - f - Q) ** 2 + 4.0 * Q * (1.0 + f)))
    return np.array([x, f * x / (Q + x), x])


END = 40.0


def main(folder: Path) -> None:
    f = np.linspace(0.3, 2.9, 261)
    growth = np.array(
        [
            sw.jacobian(oregonator(f=each), y=rest(each)).eigenvalues.real.max()
            for each in f
        ]
    )
    first, last = f[growth > 0.0][[0, -1]]  # the rest is unstable from here to there
    assert abs(first - 0.5) < 0.02, first
    assert abs(last - 1.0 - np.sqrt(2.0)) < 0.1, last

    times = np.linspace(0.0, END, 401)[1:]
    run = sw.integrate(
        oregonator(f=f), "rodas5p", y=1.01 * rest(f), tolerance=(1e-4, 1e-10), at=times
    )
    cerium = run.y[:, 2]
    late = cerium[len(times) // 2 :]
    ticking = f[late.max(axis=0) > 2.0 * late.min(axis=0)]
    assert abs(ticking[[0, -1]] - [first, last]).max() < 0.03, ticking

    one = {
        "y": 1.01 * rest(1.0),
        "tolerance": (1e-4, 1e-10),
        "at": [END],
        "max_steps": 10**6,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.StiffnessWarning)
        steps = [
            int(sw.integrate(oregonator(), method, **one).paces.accepted)
            for method in ("rodas5p", "dop853")
        ]
    assert steps[1] > 100 * steps[0]

    figure, axes = plt.subplots(figsize=(7.2, 4.4), dpi=120, layout="constrained")
    shown = axes.pcolormesh(f, times, np.log10(cerium), cmap="magma", rasterized=True)
    figure.colorbar(shown, label="cerium, powers of ten", ticks=[-4, -3, -2, -1])
    for bound in (first, last):
        axes.axvline(bound, color="#ffffff", linestyle="--")
    axes.text(last + 0.02, 1.0, "rest is\nstable here", color="#ffffff")
    axes.set(
        xlabel="f, bromide made for each cerium ion spent",
        ylabel="time in units of cerium's decay",
    )
    axes.set_title(
        "A reaction ticks where its rest is unstable, between the dashed lines"
    )
    figure.savefig(folder / "reaction.png")
    print(
        f"ticks from f = {ticking[0]:.2f} to {ticking[-1]:.2f}; rest is unstable from "
        f"{first:.2f} to {last:.2f}"
    )
    print(f"one mixture: {steps[0]} steps of rodas5p, {steps[1]} of dop853")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
