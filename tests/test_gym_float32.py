"""Environments whose worlds are stepped in float32."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import DTypeError, UnsupportedError

gymnasium = pytest.importorskip("gymnasium")

import stepwell.interop.gym  # noqa: E402
from gymnasium.spaces import Box  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

NAMES = ["CartPole", "DoubleRod", "Pendulum"]
F = np.float32


def many(name: str, num_envs: int = 5, **options: Any) -> Any:
    return gymnasium.make_vec(f"stepwell/{name}-v0", num_envs=num_envs, **options).unwrapped


@pytest.mark.parametrize("name", NAMES)
def test_gymnasiums_checker_has_nothing_to_say(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", ".*For Box action spaces, we recommend using a symmetric and normalized space.*")
        check_env(gymnasium.make(f"stepwell/{name}-v0", dtype="float32").unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", NAMES)
def test_the_world_is_stepped_in_float32(name: str) -> None:
    """Its states are near those of float64, and not the same; rewards are float64, and what was seen is not written to again."""
    half, whole = many(name, dtype="float32"), many(name)
    half.action_space.seed(1)
    first = half.reset(seed=3)[0], whole.reset(seed=3)[0]
    # Both draw the same start, whose numbers are below 8 and are rounded by half a unit in their last place, 2⁻²².
    np.testing.assert_allclose(*first, atol=2.0**-21)
    kept = first[0].copy()
    for _ in range(20):
        action = half.action_space.sample()
        mine, theirs = half.step(action), whole.step(action)
        assert mine[0].dtype == F
        assert mine[1].dtype == np.float64
        # Twenty steps within a second, each of which rounds by some 2⁻²¹ what then grows by e⁵ at most: upside down a pendulum
        # of these lengths falls like e⁴ᵗ. Rewards of pendulums are sums of squares, whose slopes are 2π at most.
        near = 20 * 2.0**-21 * np.exp(5.0)
        np.testing.assert_allclose(mine[0], theirs[0], atol=near)
        np.testing.assert_allclose(mine[1], theirs[1], atol=2.0 * np.pi * near)
    np.testing.assert_array_equal(first[0], kept)
    assert half.world.v.dtype == half.world.y.dtype == F
    assert whole.world.y.dtype == np.float64
    assert (half.world.v != whole.world.v.astype(F)).any()
    assert [each.dtype for each in half.states] == [np.float64] * 2
    assert whole.states[1] is whole.world.y


def test_the_steps_are_those_of_integrate() -> None:
    """A pendulum without a torque, step by step and in one run."""
    envs = many("Pendulum", 4, dtype=F, method="false_euler", dt=0.01, substeps=5)
    envs.reset(seed=2)
    v, y = envs.world.v.copy(), envs.world.y.copy()
    for _ in range(10):
        envs.step(np.zeros((4, 1), F))
    run = sw.integrate(sw.Pendulum(np.sqrt(15.0)), "false_euler", v=v, y=y, dt=0.01, steps=50, force=np.zeros(4), dtype="float32")
    np.testing.assert_array_equal(envs.world.y, run.y[-1])
    np.testing.assert_array_equal(envs.world.v, run.v[-1])


class Stone(stepwell.interop.gym.WorldVectorEnv):  # type: ignore[misc]
    """Falls, in float64 whatever is asked for."""

    episode_steps = 5
    one_observation = Box(-100.0, 100.0, (1,), F)
    one_action = Box(-1.0, 1.0, (1,), F)

    def make_world(self, method: Any, dt: float) -> sw.World:
        v, y = np.zeros((1, 1, self.num_envs)), np.zeros((1, 1, self.num_envs))
        return sw.World(sw.Particles(gravity=9.8, dim=1), method, v=v, y=y, dt=dt)

    def draw(self, count: int) -> Any:
        return np.zeros((1, 1, count)), np.zeros((1, 1, count))

    def act(self, actions: Any) -> None:
        pass

    def observe(self) -> Any:
        return self.world.y[0, 0, :, np.newaxis]

    def judge(self, actions: Any) -> Any:
        return np.zeros(self.num_envs), np.zeros(self.num_envs, bool)


def test_what_is_wrong_is_said() -> None:
    given: dict[str, Any] = {"method": "leapfrog", "dt": 0.1, "substeps": 1, "max_episode_steps": 5}
    assert Stone(2, **given).world.y.dtype == np.float64
    with pytest.raises(UnsupportedError, match="dtype: Stone makes a world of float64, and float32 was asked for"):
        Stone(2, **given, dtype="float32")
    with pytest.raises(DTypeError, match="dtype: expected 'float64' or 'float32', got 'float16'"):
        many("Pendulum", dtype="float16")
