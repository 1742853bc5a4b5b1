"""A hundred thousand springs in one call: which of them survive a step of 1/60 s?

False Euler is stable up to Φ = ω₀·dt = 2, that is k/m = 14400 s⁻² or 19.0986 Hz at 60
steps a second. A batch finds it by trial: the members past the limit diverge, are named
with their step, and leave the others alone.
"""

import math
import warnings

import numpy as np
import stepwell as sw

MEMBERS = 100_000


def main() -> None:
    frequency = 10.0 + 20.0 * np.arange(MEMBERS) / MEMBERS  # Hz
    springs = sw.Oscillator(omega=2.0 * math.pi * frequency)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = sw.integrate(
            springs, "false_euler", v=0.0, y=1.0, dt=1 / 60, steps=20_000
        )
    print(caught[0].message)

    bad = run.status == sw.Status.DIVERGED
    for number in (np.flatnonzero(bad)[0], MEMBERS - 1):
        print(
            f"{frequency[number]:.4f} Hz is past the largest number at step "
            f"{run.first_bad_step[number]}"
        )
    # Closer than this to the limit, 20 000 steps do not suffice to overflow.
    print(
        f"{np.count_nonzero(bad)} of {MEMBERS} diverged; the last good one has "
        f"{frequency[~bad].max():.4f} Hz"
    )


if __name__ == "__main__":
    main()
