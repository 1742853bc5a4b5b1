"""Two rods, one hanging from the other, and a motor between them."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from ...base.arrays import Array
from ...model.controls import Projection
from ...model.methods import Method
from ...model.systems import Rods
from ...reference.functions import cos, sin
from ...runs.world import World
from .base import WorldEnv, WorldVectorEnv
from .pictures import CARRYING, FIXED, Line
from .traced import TracedVectorEnv

#: Gravity, in SI units; masses and lengths of the rods are 1.
GRAVITY = 9.8
#: The largest torque of the motor, in newton metres, and the largest observed angular velocity, in rad per second.
MAX_TORQUE, MAX_SPEED = 1.0, 50.0
#: The tip is to be lifted above the anchor by this, in metres.
GOAL = 1.0
#: Episodes begin with angles, and angular velocities, between this and its negative.
NEAR_REST = 0.1


class DoubleRodVectorEnv(TracedVectorEnv):
    """Double pendulums with a motor at the joint between the rods, which is to lift the tip. The task is that of ``Acrobot-v1``.

    Each rod has its mass at its lower end. An observation has the cosines and sines of the angles of both rods from straight
    down, and their angular velocities (clipped to ±50 in the observation only); the action is a torque of −1 to 1 on the second
    rod and its opposite on the first. The reward is −1 for each step until the tip is 1 m above the anchor, which ends the
    episode.

    Example:
        >>> import gymnasium, stepwell.interop.gym
        >>> envs = gymnasium.make_vec("stepwell/DoubleRod-v0", num_envs=100, substeps=4)
        >>> seen, _ = envs.reset(seed=1)
        >>> seen, rewards, terminated, truncated, _ = envs.step(envs.action_space.sample())
        >>> seen.shape, float(rewards.sum())
        ((100, 6), -100.0)
    """

    episode_steps = 500
    usual_dt = 0.05
    one_observation = Box(-np.array([1.0] * 4 + [MAX_SPEED] * 2, np.float32), np.array([1.0] * 4 + [MAX_SPEED] * 2, np.float32))
    one_action = Box(-MAX_TORQUE, MAX_TORQUE, (1,), np.float32)

    def make_world(self, method: str | Method, dt: float) -> World:
        """Two rods that hang from an anchor."""
        v, self._force = (np.zeros((2, 2, self.num_envs), self.dtype) for _ in range(2))
        y = np.zeros_like(v)
        y[:, 1] = [[-1.0], [-2.0]]
        rods = Rods([1.0, 1.0], [((0.0, 0.0), 0), (0, 1)], 1.0, gravity=GRAVITY)
        acting: Any = {"force": self._force, "control": Projection("length")}
        return World(rods, method, v=v, y=y, dt=dt, dtype=self.dtype, **acting)

    def draw(self, count: int) -> tuple[Array, Array]:
        """Near rest."""
        angles, turning = self.np_random.uniform(-NEAR_REST, NEAR_REST, (2, 2, count))
        # Rows of both are the rods, then x and height.
        along = np.stack([sin(angles), -cos(angles)], axis=1)
        across = np.stack([cos(angles), sin(angles)], axis=1) * turning[:, np.newaxis]
        return np.stack([across[0], across[0] + across[1]]), np.stack([along[0], along[0] + along[1]])

    @staticmethod
    def push(v: Any, y: Any, action: Any) -> tuple[Any, Any, Any]:
        """Turn the rods against each other."""
        (first, second), _ = _rods(v, y)
        torque = action[0]
        # A torque on a rod of length 1 is a pair of forces at its ends, across it. One end of the first rod is the anchor.
        on_tip = [torque * -second[1], torque * second[0]]
        on_joint = [-on_tip[0] - torque * -first[1], -on_tip[1] - torque * first[0]]
        return v, y, [on_joint, on_tip]

    @staticmethod
    def look(v: Any, y: Any) -> Any:
        """Cosines and sines of the angles, and angular velocities."""
        (first, second), turning = _rods(v, y)
        return [-first[1], first[0], -second[1], second[0], *turning]

    @staticmethod
    def score(v: Any, y: Any, action: Any, before: tuple[Any, Any]) -> tuple[Any, Any]:
        """The rewards, and True where the tip is up."""
        up = y[1][1] > GOAL
        return np.where(up, 0.0, -1.0), up

    view = (-3.3, 3.3, -2.2, 2.2)

    def sketch(self, member: int) -> list[Line]:
        """The rods, and the height to be reached."""
        joint, tip = ((float(x), float(y)) for x, y in self.world.y[..., member])
        return [
            Line([(-3.0, GOAL), (3.0, GOAL)], 2.0, FIXED),
            Line([(0.0, 0.0), joint], 9.0, CARRYING),
            Line([joint, tip], 9.0),
            Line([(0.0, 0.0)], 6.0, FIXED),
        ]


def _rods(v: Any, y: Any) -> tuple[Any, Any]:
    """Where the rods point, and how fast they turn."""
    directions, turning = [], []
    for along, across in ((y[0], v[0]), ([y[1][0] - y[0][0], y[1][1] - y[0][1]], [v[1][0] - v[0][0], v[1][1] - v[0][1]])):
        square = along[0] * along[0] + along[1] * along[1]
        length = np.sqrt(square)
        directions.append([along[0] / length, along[1] / length])
        turning.append((along[0] * across[1] - along[1] * across[0]) / square)
    return directions, turning


class DoubleRodEnv(WorldEnv):
    """A single environment of ``DoubleRodVectorEnv``."""

    vector: ClassVar[type[WorldVectorEnv]] = DoubleRodVectorEnv
