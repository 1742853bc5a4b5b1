"""Environments of Gymnasium whose steps are those of a ``World``: pendulum, cart-pole and double rod, thousands at once.

Importing this module registers them: ``gymnasium.make_vec("stepwell/CartPole-v0", num_envs=1000)`` then makes a thousand that are
stepped together, and ``gymnasium.make`` makes one. Method, step and number of steps for each action are arguments. The same seed
and the same actions give the same numbers on every machine.

Needs the package gymnasium: ``pip install 'stepwell[gym]'``.
"""

from __future__ import annotations

from ...base.optional import imported

gymnasium = imported("gymnasium", "stepwell.interop.gym")

from .base import WorldEnv, WorldVectorEnv  # noqa: E402  # the line above raises if gymnasium is missing
from .cart_pole import CartPoleEnv, CartPoleVectorEnv, cart_pole  # noqa: E402
from .double_rod import DoubleRodEnv, DoubleRodVectorEnv  # noqa: E402
from .pendulum import PendulumEnv, PendulumVectorEnv  # noqa: E402
from .traced import TracedVectorEnv  # noqa: E402

__all__ = [
    "CartPoleEnv", "CartPoleVectorEnv", "DoubleRodEnv", "DoubleRodVectorEnv", "PendulumEnv", "PendulumVectorEnv",
    "TracedVectorEnv", "WorldEnv", "WorldVectorEnv", "cart_pole",
]  # fmt: skip

for _name, _kind in (("CartPole", CartPoleEnv), ("DoubleRod", DoubleRodEnv), ("Pendulum", PendulumEnv)):
    gymnasium.register(
        id=f"stepwell/{_name}-v0",
        entry_point=f"{_kind.__module__}:{_kind.__name__}",
        vector_entry_point=f"{_kind.__module__}:{_kind.vector.__name__}",
        max_episode_steps=_kind.vector.episode_steps,
    )
