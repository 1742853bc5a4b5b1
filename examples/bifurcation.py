"""The bifurcation diagram of a driven spring with two wells: a sweep over the drive, seen once a period.

v̇ = γ·cos(ωt) − δ·v + y − y³ (Duffing). The state is saved once a period of the drive, after a transient: one point if the motion
has the period of the drive, two if it has twice that, a cloud if it is chaotic. The largest Lyapunov exponent tells which.

    python examples/bifurcation.py bifurcation.png
"""

import sys

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
    """After how many periods of the drive a motion is where it was, within 0.001; 0 if it never is."""
    return next((n for n in range(1, 17) if (abs(y[n:] - y[:-n]) < 1e-3).all()), 0)


def draw(found, path):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    found.y.plot.line(".", x="gamma", add_legend=False, ax=axes, color="#000000", markersize=0.6)
    axes.set(
        xlabel="strength of the drive γ", ylabel="y, once a period of the drive", title="Period doublings of a driven spring"
    )
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def main(picture=None):
    found = diagram(np.linspace(0.2, 0.65, 451), "history", every=STEPS)
    print(f"{found.sizes['gamma']} drives, {found.sizes['t']} states of each, bits {found.attrs['bits']}")
    if picture is not None:
        draw(found, picture)

    gamma = np.array(list(KNOWN))
    known = diagram(gamma, "history", every=STEPS).y
    # Above zero where neighbouring motions part. NumPy makes these steps, so they are few.
    exponents = diagram(gamma, "lyapunov", steps=50, transient=50, periods=100).lyapunov
    for each in gamma:
        one = period(known.sel(gamma=each).values)
        print(f"γ = {each:.2f}: period {one or '—'}, Lyapunov exponent {float(exponents.sel(gamma=each)[0]):+.3f}")
    told = ", ".join(f"{period(known.sel(gamma=each).values) or 'chaos'}" for each in gamma)
    print(f"periods at γ = {', '.join(f'{each:.2f}' for each in gamma)}: {told}")


if __name__ == "__main__":
    main(next((each for each in sys.argv[1:] if each.endswith(".png")), None))
