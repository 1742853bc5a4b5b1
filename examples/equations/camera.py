"""A camera on a spring flies away below 24 frames a second
========================================================

Games: a camera on a spring, and the frame rate at which it flies away.

The camera follows its target by a critically damped spring, stepped once a frame by
False Euler, as games do. That is stable only for omega·dt < 2·√2 − 2: a spring of 20
rad/s wants 24.1 frames a second.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw


@sw.system
def camera(t, v, y, *, omega=20.0, target=1.0):
    return omega**2 * (target - y) - 2.0 * omega * v


def follows(t):
    """The true motion from rest towards a target at 1."""
    return 1.0 - (1.0 + 20.0 * t) * np.exp(-20.0 * t)


def main(folder: Path) -> None:
    limit = sw.stability_limit(camera(), "false_euler", v=0.0, y=1.0)
    assert abs(20.0 * limit / (2.0 * 2.0**0.5 - 2.0) - 1.0) < 1e-12, limit

    figure = plt.figure(figsize=(7.2, 3.6), dpi=120, layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    found = {23: "flies away", 30: "jerks, and arrives", 120: "is nearly right"}
    for axes, (rate, what) in zip(panels, found.items(), strict=True):
        run = sw.integrate(
            camera(),
            "false_euler",
            v=0.0,
            y=0.0,
            dt=1 / rate,
            steps=round(0.5 * rate),
            every=1,
        )
        error = abs(run.y - follows(run.t))
        # The error of a method of first order is a part of omega·dt, here 1/6 at 120
        # frames a second.
        assert (error.max() < 1 / 6) == (rate == 120)
        assert (error[-1] > error[: rate // 5].max()) == (1 / rate > limit)
        t = np.linspace(0.0, 0.5, 200)
        axes.plot(t, follows(t), color="#aaaaaa", linewidth=5)
        axes.plot(
            run.t,
            run.y,
            color="#d55e00" if 1 / rate > limit else "#0072b2",
            marker="o",
            markersize=3,
        )
        axes.set(
            title=f"{rate} frames a second:\n{what}", xlabel="s after the target jumped"
        )
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set(ylabel="place of the camera in m\n(grey: the true motion)")
    figure.savefig(folder / "camera.png")
    print(f"a spring of 20 rad/s is stable from {1 / limit:.2f} frames a second on")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) == 2 else "."))
