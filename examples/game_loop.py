"""The loop of a game: 60 frames a second, four steps a frame, and a player who kicks.

The arrays belong to the game. The world steps them in place, and allocates and checks
nothing on the way. Between two frames they may be changed at will.
"""

import numpy as np
import stepwell as sw

FRAMES = 600
# 240 steps a second: the stiffest spring below has Φ = 0.2 and is far from the limit of
# 2
STEPS = 4


def main() -> None:
    omega = np.array([6.0, 12.0, 48.0])  # three lamps that hang on springs, rad/s
    v, y = np.zeros(3), np.zeros(3)
    # form: v is the velocity, in m/s
    lamps = sw.Oscillator(omega, damping=0.05, form="physical")
    world = sw.World(lamps, "false_euler", v=v, y=y, dt=1 / (60 * STEPS))

    for frame in range(FRAMES):
        if frame in (60, 300):
            v += 1.0  # the kick
            print(f"frame {frame}, t = {world.t:.3f} s: kicked")
        world.step(STEPS)
        if frame % 100 == 99:
            print(
                f"frame {frame + 1}: y = "
                f"{np.array2string(y, precision=4, suppress_small=True)}"
            )

    if not (np.isfinite(v).all() and np.isfinite(y).all()):
        # a World does not look for divergence; the game does
        raise SystemExit("a lamp has left the world")
    print(
        f"t = {world.t:g} s after {world.step_number} steps: y = {y[0]:.6f}, "
        f"{y[1]:.6f}, {y[2]:.6f} m"
    )


if __name__ == "__main__":
    main()
