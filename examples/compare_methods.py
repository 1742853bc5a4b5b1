"""Every method on an undamped oscillator, from small steps to just past the limit.

The energy should stay at 0.5. Its mean over the last steps shows who gains, who loses
and who blows up; the error of y after one period shows that a good energy is not yet a
good solution.
"""

import math
import warnings

import numpy as np
import stepwell as sw

ANGLES = np.array([0.1, 0.5, 1.0, 1.5, 1.999, 2.001])  # Φ = ω₀·dt, one member each
STEPS, LAST = 2000, 200


def main() -> None:
    print(
        f"mean energy over the last {LAST} of {STEPS} steps, by Φ = ω₀·dt; error of y "
        "after a period at Φ = 0.1"
    )
    print(f"{'':16}" + "".join(f"{phi:>10g}" for phi in ANGLES) + f"{'error':>11}")
    false_euler = {}
    for method in sw.methods():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.DivergenceWarning)
            run = sw.integrate(
                sw.Oscillator(ANGLES),
                method,
                v=0.0,
                y=1.0,
                dt=1.0,
                steps=STEPS,
                every=1,
            )
        with np.errstate(invalid="ignore", over="ignore"):
            energy = np.where(
                run.status == sw.Status.OK, run.energy[-LAST:].mean(axis=0), np.inf
            )
        period = round(2 * math.pi / ANGLES[0])
        error = abs(run.y[period, 0] - math.cos(ANGLES[0] * period))
        print(
            f"{method.name:16}"
            + "".join(f"{e:>10.3g}" for e in energy)
            + f"{error:>11.1e}"
        )
        if method.name == "false_euler":
            false_euler = dict(zip(ANGLES.tolist(), energy.tolist(), strict=True))
    # Below the limit a symplectic method draws an ellipse, close to it a thin one with
    # energies up to 1/(2 − Φ) = 1000.
    print(
        f"false_euler at Φ = 1.999: {false_euler[1.999]:.4g}, at Φ = 2.001: "
        f"{false_euler[2.001]:.0e}"
    )


if __name__ == "__main__":
    main()
