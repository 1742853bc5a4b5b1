"""A cart that balances a pole."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Discrete

from ...base.arrays import Array
from ...model.equations import system
from ...model.methods import Method
from ...runs.world import World
from .base import WorldEnv, WorldVectorEnv
from .pictures import CARRYING, FIXED, Line
from .traced import TracedVectorEnv

#: The push of an action, in newtons.
PUSH = 10.0
#: Where an episode ends: the place of the cart in metres, and the angle of the pole in rad.
END, TILT = 2.4, np.radians(12.0)
#: The largest observed velocities, in metres and rad per second; an episode ends long before.
MAX_SPEED = 100.0
#: Episodes begin with all four numbers between this and its negative.
NEAR_REST = 0.05


@system(blocks=2, shape=((2,), (3,)))
def cart_pole(
    t: Any, v: Any, y: Any, *, gravity: Any = 9.8, cart: Any = 1.0, pole: Any = 0.1, half_length: Any = 0.5
) -> tuple[Any, Any]:
    """A cart on a rail with a pole on a hinge (Barto, Sutton, Anderson 1983; without friction, with the force of Florian 2005).

    v is the velocity of the cart and the angular velocity of the pole, y the place of the cart, the angle of the pole from
    upright, and the force on the cart. The force is in the state because it changes from step to step and not within one.
    """
    speed, turning = v
    _, angle, force = y
    whole, moment = cart + pole, pole * half_length
    cosine, sine = np.cos(angle), np.sin(angle)
    pull = (force + moment * turning**2 * sine) / whole
    bending = (gravity * sine - cosine * pull) / (half_length * (4.0 / 3.0 - pole * cosine**2 / whole))
    return [pull - moment * bending * cosine / whole, bending], [speed, turning, 0.0]


class CartPoleVectorEnv(TracedVectorEnv):
    """Carts that balance poles. Task, numbers and rewards are those of ``CartPole-v1``.

    An observation has the position and velocity of the cart, and the angle and angular velocity of the pole; the actions are 0
    for a push to the left and 1 for a push to the right. The reward is 1 for each step. An episode ends when the cart is more
    than 2.4 m off, or the pole more than 12 degrees. ``method="standard_euler"`` makes the steps of Gymnasium's environment, up
    to rounding.

    Example:
        >>> import gymnasium, stepwell.interop.gym
        >>> envs = gymnasium.make_vec("stepwell/CartPole-v0", num_envs=1000, method="rk4")
        >>> seen, _ = envs.reset(seed=1)
        >>> seen, rewards, terminated, truncated, _ = envs.step((seen[:, 2] > 0).astype(int))
        >>> seen.shape, float(rewards.sum())
        ((1000, 4), 1000.0)
    """

    episode_steps = 500
    usual_dt = 0.02
    positive = "cart", "pole", "half_length"
    one_observation = Box(
        -np.array([2 * END, MAX_SPEED, 2 * TILT, MAX_SPEED], np.float32),
        np.array([2 * END, MAX_SPEED, 2 * TILT, MAX_SPEED], np.float32),
    )
    one_action = Discrete(2)

    def make_world(self, method: str | Method, dt: float) -> World:
        """Carts with poles."""
        v, y = np.zeros((2, self.num_envs), self.dtype), np.zeros((3, self.num_envs), self.dtype)
        return World(cart_pole(), method, v=v, y=y, dt=dt, dtype=self.dtype)

    def draw(self, count: int) -> tuple[Array, Array]:
        """Near rest."""
        drawn = self.np_random.random((4, count))  # as ``uniform`` draws, which takes longer for its bounds
        drawn *= 2.0 * NEAR_REST
        drawn -= NEAR_REST
        y = np.zeros((3, count))
        y[:2] = drawn[::2]
        return drawn[1::2], y

    @staticmethod
    def push(v: Any, y: Any, action: Any) -> tuple[Any, Any, Any]:
        """Push to the left or to the right."""
        return v, [y[0], y[1], PUSH * (2.0 * action - 1.0)], None

    @staticmethod
    def look(v: Any, y: Any) -> Any:
        """Position and velocity of the cart, angle and angular velocity of the pole."""
        return [y[0], v[0], y[1], v[1]]

    @staticmethod
    def score(v: Any, y: Any, action: Any, before: tuple[Any, Any]) -> tuple[Any, Any]:
        """1 for each step, until the cart is off or the pole has fallen."""
        return 1.0, (np.abs(y[0]) > END) | (np.abs(y[1]) > TILT)

    view = (-2.7, 2.7, -1.2, 2.4)

    def sketch(self, member: int) -> list[Line]:
        """The rail, the cart and the pole."""
        place, angle = (float(each) for each in self.world.y[:2, member])
        half_length = float(np.broadcast_to(self.world.system.arguments()["half_length"], (self.num_envs,))[member])
        tip = place + 2.0 * half_length * np.sin(angle), 2.0 * half_length * np.cos(angle)
        return [
            Line([(-END, 0.0), (END, 0.0)], 2.0, FIXED),
            Line([(place - 0.2, 0.0), (place + 0.2, 0.0)], 18.0, CARRYING),
            Line([(place, 0.0), tip], 7.0),
            Line([(place, 0.0)], 5.0, FIXED),
        ]


class CartPoleEnv(WorldEnv):
    """A single environment of ``CartPoleVectorEnv``."""

    vector: ClassVar[type[WorldVectorEnv]] = CartPoleVectorEnv
