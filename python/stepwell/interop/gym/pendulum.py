"""A rod that a weak motor swings up."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from ...base.arrays import Array
from ...model.methods import Method
from ...model.systems import Pendulum
from ...reference.functions import cos, sin
from ...runs.world import World
from .base import Truths, WorldEnv, WorldVectorEnv

#: Gravity, mass and length of the rod in Gymnasium's environment of this name, in SI units.
GRAVITY, MASS, LENGTH = 10.0, 1.0, 1.0
#: The largest torque of the motor; and the largest angular velocity, to which it is clipped after each action.
MAX_TORQUE, MAX_SPEED = 2.0, 8.0


class PendulumVectorEnv(WorldVectorEnv):
    """Pendulums: a rod on a hinge, with a motor too weak to lift it at once. Task and rewards are those of ``Pendulum-v1``.

    An observation has the cosine and sine of the angle from upright, and the angular velocity; the action is a torque of −2 to 2.
    The reward is −(θ² + 0.1·θ̇² + 0.001·u²), before the step. ``method="false_euler"`` makes the steps of Gymnasium's environment,
    up to rounding, except that Gymnasium clips the angular velocity to ±8 before it steps the angle.

    Example:
        >>> import gymnasium, stepwell.interop.gym
        >>> envs = gymnasium.make_vec("stepwell/Pendulum-v0", num_envs=1000)
        >>> seen, _ = envs.reset(seed=1)
        >>> seen, rewards, terminated, truncated, _ = envs.step(envs.action_space.sample())
        >>> seen.shape, rewards.shape
        ((1000, 3), (1000,))
    """

    episode_steps = 200
    one_observation = Box(-np.array([1.0, 1.0, MAX_SPEED], np.float32), np.array([1.0, 1.0, MAX_SPEED], np.float32))
    one_action = Box(-MAX_TORQUE, MAX_TORQUE, (1,), np.float32)

    def __init__(
        self,
        num_envs: int = 1,
        *,
        method: str | Method = "rk4",
        dt: float = 0.05,
        substeps: int = 1,
        max_episode_steps: int | None = episode_steps,
        render_mode: None = None,
        dtype: Any = "float64",
    ) -> None:
        settings: Any = {"method": method, "dt": dt, "substeps": substeps, "max_episode_steps": max_episode_steps}
        super().__init__(num_envs, **settings, render_mode=render_mode, dtype=dtype)

    def make_world(self, method: str | Method, dt: float) -> World:
        """Rods on hinges."""
        # A uniform rod on its end: its moment of inertia is m·l²/3.
        v, y, self._force = (np.zeros(self.num_envs, self.dtype) for _ in range(3))
        return World(Pendulum(np.sqrt(1.5 * GRAVITY / LENGTH)), method, v=v, y=y, dt=dt, force=self._force, dtype=self.dtype)

    def draw(self, count: int) -> tuple[Array, Array]:
        """Random angles, and angular velocities of at most 1."""
        above, speed = self.np_random.uniform(-np.pi, np.pi, count), self.np_random.uniform(-1.0, 1.0, count)
        return speed, above + np.pi

    def _torque(self, actions: Any) -> Array:
        torque: Array = np.clip(actions[:, 0].astype(np.float64), -MAX_TORQUE, MAX_TORQUE)
        return torque

    def act(self, actions: Any) -> None:
        """Turn the motors."""
        self._force[...] = self._torque(actions) * (3.0 / (MASS * LENGTH * LENGTH))

    def observe(self) -> Array:
        """Cosine and sine of the angle from upright, angular velocity."""
        v, y = self.states  # y is the angle from below
        return np.stack([-cos(y), -sin(y), v], axis=-1)

    def rewards_before(self, actions: Any) -> Array:
        """Minus the squares of the angle from upright, the angular velocity and the torque, weighted."""
        speed, y = self.states
        turns = np.floor(y / (2.0 * np.pi))
        above = y - 2.0 * np.pi * turns - np.pi
        torque = self._torque(actions)
        return -(above * above + 0.1 * (speed * speed) + 0.001 * (torque * torque))

    def judge(self, actions: Any) -> tuple[Array, Truths]:
        """No episode ends before its time."""
        np.clip(self.world.v, -MAX_SPEED, MAX_SPEED, out=self.world.v)
        return np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=np.bool_)


class PendulumEnv(WorldEnv):
    """A single environment of ``PendulumVectorEnv``."""

    vector: ClassVar[type[WorldVectorEnv]] = PendulumVectorEnv
