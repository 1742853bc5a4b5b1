"""Diffusion makes stripes of the length that Turing predicts
==========================================================

Chemistry: stripes out of nothing, in the Brusselator on a ring.

Two substances react, and one diffuses faster. Where the uniform mixture is stable
without diffusion, diffusion makes it unstable to waves of one length, 2π·(Dx·Dy)^¼/√a,
and stripes of that length grow out of noise (Turing 1952).
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

A, B, DX, DY = 3.0, 9.0, 5.0, 12.0
WAVELENGTH = 2.0 * np.pi * (DX * DY) ** 0.25 / A**0.5  # 10.1 units of length
STRIPES, CELLS = 8, 96
SPACING = STRIPES * WAVELENGTH / CELLS


def spread(c):
    return (np.roll(c, 1) - 2.0 * c + np.roll(c, -1)) / SPACING**2


@sw.system(order=1, shape=(2, CELLS))
def brusselator(t, y, *, a=A, b=B, dx=DX, dy=DY):
    u, w = y
    growth = u * u * w
    return np.stack(
        [a + growth - (b + 1.0) * u + dx * spread(u), b * u - growth + dy * spread(w)]
    )


def main(folder: Path) -> None:
    uniform = np.stack([np.full(CELLS, A), np.full(CELLS, B / A)])
    noise = 0.01 * np.random.default_rng(7).normal(size=uniform.shape)
    run = sw.integrate(
        brusselator(), "rk4", y=uniform + noise, dt=0.02, steps=3000, every=10
    )
    waves = abs(np.fft.rfft(run.y[-1, 0] - A))
    assert waves.argmax() == STRIPES, waves.argmax()
    # Half the diffusion of the second substance, and no stripes: (1 + a·√(Dx/Dy))² is
    # then above b.
    dull = sw.integrate(
        brusselator(dy=0.5 * DY), "rk4", y=uniform + noise, dt=0.02, steps=3000
    )
    assert np.ptp(dull.y[-1, 0]) < 1e-3 < np.ptp(run.y[-1, 0])

    figure = plt.figure(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    shades = axes.pcolormesh(
        run.t,
        SPACING * np.arange(CELLS),
        run.y[:, 0].T,
        cmap="cividis",
        shading="nearest",
    )
    top = SPACING * (
        CELLS // 3 + run.y[-1, 0, CELLS // 3 : CELLS // 3 + CELLS // STRIPES].argmax()
    )
    axes.annotate(
        "",
        (3, top),
        (3, top + WAVELENGTH),
        arrowprops={"arrowstyle": "<->", "linewidth": 2},
    )
    axes.text(4, top + WAVELENGTH / 2, "predicted\nwavelength", va="center")
    axes.set(xlabel="time", ylabel="place on the ring, in units of length")
    axes.set_title("Diffusion makes stripes of the length that Turing predicts")
    figure.colorbar(shades, label="concentration")
    figure.savefig(folder / "turing.png")
    print(
        f"{waves.argmax()} stripes on a ring of {STRIPES} predicted wavelengths of "
        f"{WAVELENGTH:.2f}"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
