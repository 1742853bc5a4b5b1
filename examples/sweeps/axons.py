"""Warm axons fire faster, until they fall silent
==============================================

Hodgkin and Huxley's axon at 1 400 pairs of current and temperature in one call; each
has steps of its own. Its channels open and shut three times as fast with every 10 °C,
so a warm axon fires faster. The membrane must be charged as before, however: beyond 26
°C the channels shut before it is, and no current makes the axon fire. Too large a
current holds it away from rest, where it does not fire either.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

END, SETTLED = 300.0, 240.0  # ms
REST = np.array([0.0, 0.053, 0.596, 0.318])  # at 6.3 °C without a current


def ratio(x):
    return np.where(x == 0.0, 1.0, x / np.expm1(np.where(x == 0.0, 1.0, x)))


@sw.system(order=1)
def axon(t, y, *, current=0.0, celsius=6.3):  # mV, ms, µA/cm², with rest at 0 mV
    v, m, h, n = y
    ionic = (
        120.0 * m**3 * h * (v - 115.0) + 36.0 * n**4 * (v + 12.0) + 0.3 * (v - 10.613)
    )
    speed = 3.0 ** (0.1 * (celsius - 6.3))
    return [
        current - ionic,
        speed * (ratio(2.5 - 0.1 * v) * (1.0 - m) - 4.0 * np.exp(-v / 18.0) * m),
        speed
        * (0.07 * np.exp(-v / 20.0) * (1.0 - h) - h / (np.exp(3.0 - 0.1 * v) + 1.0)),
        speed
        * (0.1 * ratio(1.0 - 0.1 * v) * (1.0 - n) - 0.125 * np.exp(-v / 80.0) * n),
    ]


def rates(current, celsius):
    """Spikes per second of each axon, 0 if it stops; of shape (current, celsius)."""
    system = axon(current=current[:, None], celsius=celsius)
    spike = sw.Event(lambda t, y: y[0] - 50.0, direction=1, name="spike")
    start = np.broadcast_to(REST[:, None, None], (4, current.size, celsius.size))
    run = sw.integrate(
        system, "rosenbrock23", y=start, tolerance=1e-3, at=[END], events=spike
    )
    spikes = run.events["spike"]
    first, last = np.full(run.status.size, np.inf), np.zeros(run.status.size)
    np.minimum.at(first, spikes.member, spikes.t)
    np.maximum.at(last, spikes.member, spikes.t)
    count = spikes.count.ravel()
    rate = np.where(
        last > SETTLED, 1e3 * (count - 1) / np.maximum(last - first, 1.0), 0.0
    )
    return rate.reshape(run.status.shape)


def main(folder: Path) -> None:
    current, celsius = np.linspace(0.0, 102.0, 52), np.linspace(0.3, 30.3, 26)
    rate = rates(current, celsius)
    fires = rate > 0.0
    least = current[fires[:, 5]][0]  # at 6.3 °C; it is 6.26 (Rinzel and Miller 1980)
    assert 6.26 < least <= 8.0, least
    warmest = celsius[fires.any(axis=0)].max()
    assert 25.0 < warmest < 27.0, warmest
    assert (np.diff(rate[10][fires[10]]) > 0.0).all()  # at one current

    figure, axes = plt.subplots(figsize=(7.2, 4.4), dpi=120, layout="constrained")
    shown = axes.pcolormesh(
        current,
        celsius,
        np.where(fires, rate, np.nan).T,
        cmap="viridis",
        rasterized=True,
    )
    figure.colorbar(shown, label="spikes per second")
    axes.text(60.0, 28.0, "too warm", color="#444444")
    axes.text(92.0, 12.0, "too much\ncurrent", color="#444444", ha="center")
    axes.set(
        xlabel="current in µA/cm²", ylabel="temperature in °C", facecolor="#eeeeee"
    )
    axes.set_title("Warm axons fire faster, until they fall silent")
    figure.savefig(folder / "axons.png")
    print(
        f"fires from {least:g} µA/cm² on at 6.3 °C, up to {warmest:.1f} °C, "
        f"{rate.max():.0f} times a second at most"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
