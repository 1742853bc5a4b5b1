"""A rod that a weak motor swings up."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from ...base.arrays import Array
from ...model.methods import Method
from ...model.systems import Pendulum
from ...runs.world import World
from .base import WorldEnv, WorldVectorEnv
from .pictures import FIXED, Line
from .traced import TracedVectorEnv

#: Gravity, mass and length of the rod in Gymnasium's environment of this name, in SI units.
GRAVITY, MASS, LENGTH = 10.0, 1.0, 1.0
#: The largest torque of the motor; and the largest angular velocity, to which it is clipped after each action.
MAX_TORQUE, MAX_SPEED = 2.0, 8.0


class PendulumVectorEnv(TracedVectorEnv):
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
    usual_dt = 0.05
    one_observation = Box(-np.array([1.0, 1.0, MAX_SPEED], np.float32), np.array([1.0, 1.0, MAX_SPEED], np.float32))
    one_action = Box(-MAX_TORQUE, MAX_TORQUE, (1,), np.float32)

    def make_world(self, method: str | Method, dt: float) -> World:
        """Rods on hinges."""
        # A uniform rod on its end: its moment of inertia is m·l²/3.
        v, y, self._force = (np.zeros(self.num_envs, self.dtype) for _ in range(3))
        return World(Pendulum(np.sqrt(1.5 * GRAVITY / LENGTH)), method, v=v, y=y, dt=dt, force=self._force, dtype=self.dtype)

    def draw(self, count: int) -> tuple[Array, Array]:
        """Random angles, and angular velocities of at most 1."""
        above, speed = self.np_random.uniform(-np.pi, np.pi, count), self.np_random.uniform(-1.0, 1.0, count)
        return speed, above + np.pi

    @staticmethod
    def push(v: Any, y: Any, action: Any) -> tuple[Any, Any, Any]:
        """Turn the motor."""
        return v, y, action[0] * (3.0 / (MASS * LENGTH * LENGTH))

    @staticmethod
    def settle(v: Any, y: Any) -> tuple[Any, Any]:
        """The angular velocity is bounded."""
        return np.minimum(np.maximum(v, -MAX_SPEED), MAX_SPEED), y

    @staticmethod
    def look(v: Any, y: Any) -> Any:
        """Cosine and sine of the angle from upright, angular velocity."""
        return [-np.cos(y), -np.sin(y), v]  # y is the angle from below

    @staticmethod
    def score(v: Any, y: Any, action: Any, before: tuple[Any, Any]) -> tuple[Any, Any]:
        """Minus the squares of the angle from upright, the angular velocity and the torque, weighted; before the steps.

        No episode ends before its time.
        """
        speed, angle = before
        above = angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi)) - np.pi
        torque = action[0]
        return -(above * above + 0.1 * (speed * speed) + 0.001 * (torque * torque)), False

    view = (-1.8, 1.8, -1.2, 1.2)

    def sketch(self, member: int) -> list[Line]:
        """The rod on its hinge."""
        angle = float(self.world.y[member])
        tip = LENGTH * np.sin(angle), -LENGTH * np.cos(angle)
        return [Line([(0.0, 0.0), tip], 14.0), Line([(0.0, 0.0)], 8.0, FIXED)]


class PendulumEnv(WorldEnv):
    """A single environment of ``PendulumVectorEnv``."""

    vector: ClassVar[type[WorldVectorEnv]] = PendulumVectorEnv
