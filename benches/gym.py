"""Cart-poles by the thousand, beside Gymnasium's own and gymnax on JAX, with the error of each method's motion.

    python -m benches.gym                 # prints the table
    python -m benches.gym --members 256

Each row is the median of turns that alternate between all, so that what else the machine does meets all alike; the range is that
of the middle half of the turns. A turn is some calls of ``step`` with random actions that were drawn before, episodes beginning
anew as they end. The error is that of the angle of a pole after a second of pushes to and fro, from near rest, against steps a
hundred times shorter: by Standard Euler Gymnasium's own steps, which are those of "standard_euler".

gymnax is timed if it is installed: its vmapped step, compiled, on the threads that XLA takes; ``XLA_FLAGS`` and ``taskset`` limit
them. It computes in float32.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import stepwell.interop.gym

#: Calls of a turn, and turns.
CALLS, TURNS = 20, 60


def _of_gymnasium(members: int, actions: Any) -> Callable[[int], object]:
    envs = gymnasium.make_vec("CartPole-v1", num_envs=members, vectorization_mode="vector_entry_point")
    envs.reset(seed=1)
    return lambda k: envs.step(actions[k % len(actions)])


def _of_stepwell(members: int, actions: Any, **options: Any) -> Callable[[int], object]:
    envs = gymnasium.make_vec("stepwell/CartPole-v0", num_envs=members, **options)
    envs.reset(seed=1)
    return lambda k: envs.step(actions[k % len(actions)])


def _of_gymnax(members: int, actions: Any) -> Callable[[int], object] | None:
    try:
        import gymnax
        import jax
    except ImportError:
        return None
    env, parameters = gymnax.make("CartPole-v1")
    key = jax.random.PRNGKey(1)
    _, state = jax.vmap(env.reset, in_axes=(0, None))(jax.random.split(key, members), parameters)
    moved = [jax.numpy.asarray(each) for each in actions]

    @jax.jit
    def step(key: Any, state: Any, action: Any) -> Any:
        key, own = jax.random.split(key)
        out = jax.vmap(env.step, in_axes=(0, 0, 0, None))(jax.random.split(own, members), state, action, parameters)
        return key, out

    held = [key, state]

    def call(k: int) -> None:
        held[0], out = step(held[0], held[1], moved[k % len(moved)])
        held[1] = out[1]
        jax.block_until_ready(out)

    return call


def error(method: str, dtype: str) -> float:
    """Of the angle in rad, after a second of pushes to and fro."""
    angles = []
    for finer in (1, 100):
        envs: Any = stepwell.interop.gym.CartPoleVectorEnv(
            1, method=method if finer == 1 else "rk4", dt=0.02 / finer, substeps=finer, dtype=dtype if finer == 1 else "float64"
        )
        envs.reset(seed=1)
        envs.world.v[...] = 0.0
        envs.world.y[...] = np.array([[0.0], [0.01], [0.0]])
        for k in range(50):
            envs._over[:] = False
            envs.step(np.array([k % 2]))
        angles.append(float(envs.world.y[1, 0]))
    return abs(angles[0] - angles[1])


def measured(members: int) -> list[tuple[str, float, float, float, float | None]]:
    """For each the name, the median time of a step in µs, the quarters of the turns, and the error."""
    actions = np.random.default_rng(0).integers(0, 2, (64, members))
    kinds: list[tuple[str, Any, float | None]] = [
        ("Gymnasium", _of_gymnasium(members, actions), error("standard_euler", "float64"))
    ]
    for method in ("standard_euler", "rk4"):
        for dtype in ("float64", "float32"):
            step = _of_stepwell(members, actions, method=method, dtype=dtype)
            kinds.append((f"stepwell, {method}, {dtype}", step, error(method, dtype)))
    if (jax := _of_gymnax(members, actions)) is not None:
        kinds.append(("gymnax, float32", jax, error("standard_euler", "float32")))
    times: list[list[float]] = [[] for _ in kinds]
    for turn in range(TURNS + 1):
        for (_, step, _), own in zip(kinds, times, strict=True):
            begin = time.perf_counter()
            for k in range(CALLS):
                step(turn * CALLS + k)
            if turn:  # the first warms up
                own.append((time.perf_counter() - begin) / CALLS * 1e6)
    quarters = [np.percentile(own, (50, 25, 75)) for own in times]
    return [(name, *map(float, three), off) for (name, _, off), three in zip(kinds, quarters, strict=True)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--members", type=int, default=4096)
    rows = measured(parser.parse_args().members)
    theirs = rows[0][1]
    print("| environments | µs a step (middle half of turns) | Gymnasium's time by it | error of the angle after 1 s, rad |")
    print("|---|---|---|---|")
    for name, median, low, high, off in rows:
        print(f"| {name} | {median:.0f} ({low:.0f}–{high:.0f}) | {theirs / median:.2f} | {off:.1e} |")


if __name__ == "__main__":
    main()
