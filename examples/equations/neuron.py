"""An axon is silent, or fires fast
================================

Neurons: which current makes Hodgkin and Huxley's axon fire, and how often.

Firing is possible from 6.26 µA/cm² on, and rest loses its stability at 9.78 (Rinzel and
Miller 1980). A current that is switched on at rest makes the axon fire for good soon
beyond the first, and at once fifty times a second: there is no slow firing.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw


def ratio(x):
    return np.where(x == 0.0, 1.0, x / np.expm1(x))


@sw.system(order=1)
def axon(t, y, *, current=0.0):  # mV, ms, µA/cm², with rest at 0 mV, at 6.3 °C
    v, m, h, n = y
    ionic = (
        120.0 * m**3 * h * (v - 115.0) + 36.0 * n**4 * (v + 12.0) + 0.3 * (v - 10.613)
    )
    return np.array(
        [
            current - ionic,
            ratio(2.5 - 0.1 * v) * (1.0 - m) - 4.0 * np.exp(-v / 18.0) * m,
            0.07 * np.exp(-v / 20.0) * (1.0 - h) - h / (np.exp(3.0 - 0.1 * v) + 1.0),
            0.1 * ratio(1.0 - 0.1 * v) * (1.0 - n) - 0.125 * np.exp(-v / 80.0) * n,
        ]
    )


FIRING, UNSTABLE = 6.26, 9.78  # Rinzel and Miller (1980), in µA/cm²
REST = np.array([0.0, 0.053, 0.596, 0.318])
# in ms; 600 ms, of which the last 300 count
DT, STEPS, SETTLING = 0.025, 24_000, 12_000


def growth(current):
    """How fast the slowest to die of the disturbances of rest grows, per ms."""
    (rest,) = sw.equilibria(axon(current=current), near=(None, REST))
    return rest.eigenvalues.real.max()


def main(folder: Path) -> None:
    assert growth(UNSTABLE - 0.01) < 0.0 < growth(UNSTABLE + 0.01)

    current = np.linspace(0.0, 20.0, 81)
    run = sw.integrate(
        axon(current=current), "rk4", y=REST[:, None], dt=DT, steps=STEPS, every=4
    )
    v = run.y[SETTLING // 4 :, 0]
    spikes = (v[:-1] < 50.0) & (v[1:] >= 50.0)
    first_to_last = (
        len(spikes) - 1 - spikes[::-1].argmax(axis=0) - spikes.argmax(axis=0)
    )
    rate = np.maximum(spikes.sum(axis=0) - 1, 0) / (4e-3 * DT * first_to_last)  # in Hz
    onset, slowest = current[rate > 0.0].min(), rate[rate > 0.0].min()
    assert FIRING < onset < FIRING + 0.25, onset  # the next current of the sweep
    assert slowest > 50.0, slowest

    figure = plt.figure(figsize=(7.2, 4.0), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    axes.plot(current, rate, "o", color="#0072b2", markersize=4)
    axes.axvline(UNSTABLE, color="#666666", linestyle="--")
    axes.text(
        UNSTABLE + 0.2,
        8,
        f"rest is unstable beyond\n{UNSTABLE} µA/cm²",
        color="#444444",
    )
    axes.text(
        onset - 0.3,
        slowest,
        f"fires from {onset:g} µA/cm² on,\nat once with {slowest:.0f} Hz",
        color="#0072b2",
        ha="right",
    )
    axes.set(xlabel="current in µA/cm²", ylabel="spikes per second", xlim=(0, 20))
    axes.set_title("An axon is silent, or fires fast: 81 currents in one call")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(folder / "neuron.png")
    print(
        f"fires from {onset:g} µA/cm² on, with {slowest:.0f} Hz; rest is unstable "
        f"beyond {UNSTABLE}"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
