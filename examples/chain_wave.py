"""A kick runs along a chain of 400 masses between two walls.

Long waves run at √(k/m) masses per unit of time, short ones slower, so the front
arrives first and a wake follows. The fastest mode of a long chain has nearly ω =
2√(k/m), so Verlet and False Euler are stable for steps up to 1/√(k/m).
"""

import warnings

import numpy as np
import stepwell as sw

N = 400
STIFFNESS, MASS = 4.0, 1.0
SPEED = (STIFFNESS / MASS) ** 0.5  # masses per unit of time


def main() -> None:
    chain = sw.Chain(N, stiffness=STIFFNESS, mass=MASS)
    v = np.zeros(N)
    v[0] = 1.0

    run = sw.integrate(chain, "verlet", v=v, y=0.0, dt=0.1, steps=1500, every=5)
    for saved in (20, 100, 200):
        y = run.y[saved]
        front = np.flatnonzero(abs(y) > 0.25 * abs(y).max()).max()
        print(
            f"t = {run.t[saved]:5.1f}: front at mass {front:3d}, a wave of speed "
            f"√(k/m) at {SPEED * run.t[saved]:3.0f}"
        )
    wander = abs(run.energy - run.energy[0]).max() / run.energy[0]

    for dt in (0.999 / SPEED, 1.001 / SPEED):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.DivergenceWarning)
            end = sw.integrate(chain, "verlet", v=v, y=0.0, dt=dt, steps=20_000)
        print(f"dt·√(k/m) = {dt * SPEED:.3f}: {sw.Status(int(end.status)).name}")
    print(f"front at mass {front} of {N}, energy within {wander:.4f} of its start")


if __name__ == "__main__":
    main()
