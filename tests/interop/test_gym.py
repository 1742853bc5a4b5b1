"""Environments of Gymnasium: what its checker says, the steps of its own environments, and the work of a motor."""

from __future__ import annotations

import copy
import doctest
import inspect
import pickle
import sys
import warnings
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, ShapeError, TooLargeError, UnknownNameError, UnsupportedError

gymnasium = pytest.importorskip("gymnasium")

import stepwell.interop.gym  # noqa: E402
from gymnasium.spaces import Box  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from support.for_each import for_each  # noqa: E402

NAMES = ["CartPole", "DoubleRod", "Pendulum"]
EPS32 = np.finfo(np.float32).eps
F = np.float32

each_type = for_each("dtype", ["float64", "float32"])


def many(name: str, num_envs: int = 5, **options: Any) -> Any:
    return gymnasium.make_vec(f"stepwell/{name}-v0", num_envs=num_envs, **options).unwrapped


def one(name: str, **options: Any) -> Any:
    return gymnasium.make(f"stepwell/{name}-v0", **options)


@each_type
@for_each("name", NAMES)
def test_gymnasiums_checker_has_nothing_to_say(name: str, dtype: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # It recommends actions of −1 to 1, which those of the task are not.
        warnings.filterwarnings("ignore", ".*For Box action spaces, we recommend using a symmetric and normalized space.*")
        check_env(one(name, dtype=dtype, render_mode="rgb_array").unwrapped)


@for_each("name", NAMES)
def test_a_vector_is_what_it_says(name: str) -> None:
    """Shapes, types, spaces; that nothing that was returned is written to again."""
    envs = many(name, 7)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    envs.action_space.seed(3)
    seen, info = envs.reset(seed=5)
    assert info == {}
    earlier = []
    for _ in range(30):
        assert seen in envs.observation_space
        assert seen.dtype == np.float32
        earlier.append((seen, seen.copy()))
        seen, rewards, terminated, truncated, info = envs.step(envs.action_space.sample())
        assert (rewards.shape, rewards.dtype) == ((7,), np.float64)
        assert terminated.shape == truncated.shape == (7,)
        assert terminated.dtype == truncated.dtype == np.bool_
        assert info == {}
    assert all((a == b).all() for a, b in earlier)


@each_type
@for_each("name", NAMES)
def test_the_same_seed_and_actions_give_the_same_bits(name: str, dtype: str) -> None:
    def observations(seed: int) -> bytes:
        envs = many(name, dtype=dtype)
        envs.action_space.seed(1)
        seen = [envs.reset(seed=seed)[0]] + [envs.step(envs.action_space.sample())[0] for _ in range(50)]
        return np.stack(seen).tobytes()

    assert observations(1) == observations(1)
    assert observations(1) != observations(2)


@for_each("name", NAMES)
def test_one_is_a_vector_of_one(name: str) -> None:
    single, envs = one(name, max_episode_steps=20), many(name, 1, max_episode_steps=20)
    envs.action_space.seed(2)
    seen, _ = single.reset(seed=4)
    np.testing.assert_array_equal(seen, envs.reset(seed=4)[0][0])
    for _ in range(60):
        action = envs.action_space.sample()
        alone, together = single.step(action[0]), envs.step(action)
        for a, b in zip(alone[:4], together[:4], strict=True):
            np.testing.assert_array_equal(a, b[0])
        if alone[2] or alone[3]:
            # The vector ignores the next action, and draws from the same numbers.
            begun, _ = single.reset()
            np.testing.assert_array_equal(begun, envs.step(action)[0][0])


@for_each("name", NAMES)
def test_the_world_is_stepped_in_float32(name: str) -> None:
    """Its states are near those of float64, and not the same; rewards are float64, and what was seen is not written to again."""
    half, whole = many(name, dtype="float32"), many(name)
    half.action_space.seed(1)
    first = half.reset(seed=3)[0], whole.reset(seed=3)[0]
    # Both draw the same start, whose numbers are below 8 and are rounded by half a unit in their last place, 2⁻²².
    np.testing.assert_allclose(*first, atol=2.0**-21)
    before = first[0].copy()
    # Twenty steps within a second, each of which rounds by some 2⁻²¹ what then grows by e⁵ at most: upside down a pendulum of
    # these lengths falls like e⁴ᵗ. Rewards of pendulums are sums of squares, whose slopes are 2π at most.
    near = 20 * 2.0**-21 * np.exp(5.0)
    for _ in range(20):
        action = half.action_space.sample()
        mine, theirs = half.step(action), whole.step(action)
        assert (mine[0].dtype, mine[1].dtype) == (F, np.float64)
        np.testing.assert_allclose(mine[0], theirs[0], atol=near)
        np.testing.assert_allclose(mine[1], theirs[1], atol=2.0 * np.pi * near)
    np.testing.assert_array_equal(first[0], before)
    assert half.world.v.dtype == half.world.y.dtype == F
    assert (half.world.v != whole.world.v.astype(F)).any()
    assert [each.dtype for each in half.states] == [np.float64] * 2
    assert np.shares_memory(whole.states[1], whole.world.y)


@each_type
def test_the_steps_are_those_of_integrate(dtype: Any) -> None:
    """A pendulum without a torque, step by step and in one run."""
    envs = many("Pendulum", 4, dtype=dtype, method="false_euler", dt=0.01, substeps=5)
    envs.reset(seed=2)
    v, y = envs.world.v.copy(), envs.world.y.copy()
    for _ in range(10):
        envs.step(np.zeros((4, 1), F))
    run = sw.integrate(sw.Pendulum(np.sqrt(15.0)), "false_euler", v=v, y=y, dt=0.01, steps=50, force=np.zeros(4), dtype=dtype)
    np.testing.assert_array_equal(envs.world.y, run.y[-1])
    np.testing.assert_array_equal(envs.world.v, run.v[-1])


def test_episodes_end_and_begin_again() -> None:
    """With NEXT_STEP: the last state is returned, the next call begins anew with no reward, whatever its action."""
    envs = many("CartPole", 3, max_episode_steps=30)
    envs.reset(seed=0)
    ended = np.zeros(3, dtype=bool)
    length = np.zeros(3, dtype=int)
    lengths = []
    for _ in range(200):
        seen, rewards, terminated, truncated, _ = envs.step(np.array([1, 1, 0]) if lengths else np.array([1, 0, 0]))
        assert (rewards[ended] == 0.0).all()
        assert (rewards[~ended] == 1.0).all()
        assert (np.abs(seen[ended]) <= 0.05).all()
        assert not (terminated | truncated)[ended].any()
        length = np.where(ended, 0, length + 1)
        out = (np.abs(seen[:, 0]) > 2.4) | (np.abs(seen[:, 2]) > np.radians(12.0))
        np.testing.assert_array_equal(terminated, out & ~ended)
        np.testing.assert_array_equal(truncated, (length >= 30) & ~ended)
        ended = terminated | truncated
        lengths += length[ended].tolist()
    assert len(lengths) > 20
    assert max(lengths) <= 30


def test_some_can_be_reset() -> None:
    envs = many("Pendulum", 4)
    before, _ = envs.reset(seed=0)
    mask = np.array([True, False, True, False])
    after, _ = envs.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal(after[~mask], before[~mask])
    assert (after[mask] != before[mask]).any(axis=1).all()
    with pytest.raises(ShapeError, match="reset_mask: expected 4 booleans"):
        envs.reset(options={"reset_mask": [1, 0]})


# ---- one tape


def on_arrays(name: str, *arguments: Any, **options: Any) -> Any:
    """The same environments, whose rules are run on arrays."""
    kind = getattr(sw.gym, f"{name}VectorEnv")
    return type(name, (kind,), {"_fits": lambda self: False})(*arguments, **options)


MODES = ["NextStep", "SameStep", "Disabled"]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", NAMES)
def test_a_step_of_one_tape_has_the_bits_of_rules_on_arrays(name: str, mode: str) -> None:
    """Observations, rewards, ends, information, states and numbers of actions, with several steps an action as well."""
    for substeps, members in ((1, 70), (3, 5)):
        options: Any = {"substeps": substeps, "max_episode_steps": 12, "autoreset_mode": mode, "dt": 0.02}
        one, other = getattr(sw.gym, f"{name}VectorEnv")(members, **options), on_arrays(name, members, **options)
        assert one._play is not None
        assert other._play is None
        one.action_space.seed(1)
        np.testing.assert_array_equal(one.reset(seed=3)[0], other.reset(seed=3)[0])
        for k in range(40):
            action = one.action_space.sample()
            mine, theirs = one.step(action), other.step(action)
            for a, b in zip(mine[:4], theirs[:4], strict=True):
                np.testing.assert_array_equal(a, b)
                assert a.dtype == b.dtype
            assert mine[4].keys() == theirs[4].keys()
            for each in mine[4]:
                np.testing.assert_array_equal(mine[4][each], theirs[4][each])
            np.testing.assert_array_equal(one.world.v, other.world.v)
            np.testing.assert_array_equal(one.world.y[:2], other.world.y[:2])
            np.testing.assert_array_equal(one._over != 0, other._over)
            if k == 20:  # states that a user writes, and some that are reset
                for each in (one, other):
                    each.world.v[...] *= 0.5
                mask = np.arange(members) % 3 == 0
                again = [each.reset(options={"reset_mask": mask})[0] for each in (one, other)]
                np.testing.assert_array_equal(*again)
            np.testing.assert_array_equal(one.steps, other.steps)


@for_each("method", ["leapfrog", "implicit_midpoint"])
def test_methods_that_are_not_on_that_tape(method: str) -> None:
    """Their rules are run on arrays; members that begin anew leave what others carry alone."""
    envs = many("Pendulum", 6, method=method, dt=0.02)
    assert envs._play is None
    envs.reset(seed=1)
    for _ in range(5):
        envs.step(np.ones((6, 1), F))
    before = envs.world.y[3:].copy()
    envs.reset(options={"reset_mask": np.arange(6) < 3})
    np.testing.assert_array_equal(envs.world.y[3:], before)
    assert np.isfinite(envs.step(np.ones((6, 1), F))[0]).all()


@for_each("name", NAMES)
def test_copies_and_pickles_go_on_alike(name: str) -> None:
    ranges = {"CartPole": {"pole": (0.05, 0.2)}, "Pendulum": {"omega": (3.0, 4.0)}}.get(name, {"gravity": (9.0, 10.0)})
    envs = many(name, 6, max_episode_steps=9, randomise=ranges, render_mode="rgb_array")
    envs.action_space.seed(1)
    envs.reset(seed=1)
    for _ in range(5):
        envs.step(envs.action_space.sample())
    envs.render()
    others = [copy.deepcopy(envs), pickle.loads(pickle.dumps(envs))]
    assert all(other._play is not None for other in others)
    for _ in range(30):
        action = envs.action_space.sample()
        mine = envs.step(action)
        for other in others:
            for a, b in zip(mine[:4], other.step(action)[:4], strict=True):
                np.testing.assert_array_equal(a, b)
            np.testing.assert_array_equal(envs.steps, other.steps)
    assert len(others[0].render()) == 6


# ---- when an episode begins anew, and with which parameters


def test_same_step() -> None:
    """The call that ends an episode returns the first observation of the next one, and the last as information."""
    envs, other = many("CartPole", 5, autoreset_mode="SameStep"), many("CartPole", 5, autoreset_mode=AutoresetMode.DISABLED)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    envs.reset(seed=2)
    other.reset(seed=2)
    ends = 0
    for _ in range(60):
        other.world.v[...], other.world.y[...] = envs.world.v, envs.world.y
        action = np.array([1, 1, 0, 0, 1])
        seen, rewards, terminated, truncated, info = envs.step(action)
        last = other.step(action)
        assert (rewards == 1.0).all()
        np.testing.assert_array_equal(terminated, last[2])
        ended = terminated | truncated
        assert ("final_obs" in info) == ended.any()
        if ended.any():
            ends += 1
            np.testing.assert_array_equal(info["_final_obs"], ended)
            np.testing.assert_array_equal(info["final_obs"][ended], last[0][ended])
            assert not info["final_obs"][~ended].any()
            assert (np.abs(seen[ended]) <= 0.05).all()
            assert (envs.steps[ended] == 0).all()
        np.testing.assert_array_equal(seen[~ended], last[0][~ended])
    assert ends > 3


def test_disabled() -> None:
    envs = many("CartPole", 3, autoreset_mode="Disabled", max_episode_steps=5)
    envs.reset(seed=2)
    for k in range(8):
        _, rewards, _, truncated, _ = envs.step(np.array([1, 0, 1]))
        assert (truncated == (k >= 4)).all()
        assert (rewards == 1.0).all()
    assert (envs.steps == 8).all()
    envs.reset(options={"reset_mask": np.array([False, True, False])})
    assert envs.steps.tolist() == [8, 0, 8]


def test_a_training_loop_of_gymnasium_takes_each_mode() -> None:
    """Its wrapper that counts returns knows what each mode does."""
    from gymnasium.wrappers.vector import RecordEpisodeStatistics

    for mode in MODES[:2]:
        envs = RecordEpisodeStatistics(gymnasium.make_vec("stepwell/CartPole-v0", num_envs=4, autoreset_mode=mode))
        envs.reset(seed=1)
        lengths = []
        for k in range(120):
            *_, info = envs.step(np.full(4, (k // 2) % 2))
            if "episode" in info:
                lengths += info["episode"]["l"][info["_episode"]].tolist()
        assert len(lengths) > 4
        assert min(lengths) > 5


@for_each("name", NAMES)
def test_parameters_that_each_episode_draws(name: str) -> None:
    """Uniform in the bounds, by seed; steps have the bits of a world with these parameters."""
    parameters = {"CartPole": {"pole": (0.05, 0.2), "gravity": (9.0, 10.0)}, "Pendulum": {"omega": (3.0, 4.0)}}
    ranges = parameters.get(name, {"lengths": (0.9, 1.1), "gravity": (9.0, 10.0)})
    envs = many(name, 50, randomise=ranges, max_episode_steps=4)
    assert envs._play is not None
    drawn = []
    envs.reset(seed=1)
    for _ in range(9):
        now = {each: np.array(envs.world.parameters[each]) for each in ranges}
        drawn.append(now)
        for each, (low, high) in ranges.items():
            assert now[each].shape[-1] == 50
            assert ((low <= now[each]) & (now[each] <= high)).all()
            assert now[each].std() > 0.2 * (high - low) / np.sqrt(12.0)
        v, y = envs.world.v.copy(), envs.world.y.copy()
        over = envs._over != 0
        plan = envs.world._plan
        world = sw.World(
            envs.world.system.uncontrolled, plan.method, v=v, y=y, dt=plan.dt, force=plan.force, control=envs.world.system.keeper
        )
        seen = envs.step(np.zeros(envs.action_space.shape, envs.action_space.dtype))[0]
        if name == "CartPole":
            world.y[2] = -10.0
        world.step()
        np.testing.assert_array_equal(envs.world.y[..., ~over], world.y[..., ~over])
        assert np.isfinite(seen).all()
    first = next(iter(ranges))
    assert any((a[first] != b[first]).any() for a, b in pairwise(drawn))
    other = many(name, 50, randomise=ranges, max_episode_steps=4)
    other.reset(seed=1)
    np.testing.assert_array_equal(other.world.parameters[first], drawn[0][first])


def test_wrong_ranges() -> None:
    for wrong, kind, text in (
        ({"pole": (0.2, 0.1)}, ArgumentError, r"randomise\['pole'\]: expected bounds \(low, high\)"),
        ({"pole": 0.2}, ShapeError, r"randomise\['pole'\]: expected bounds"),
        ({"polo": (0.1, 0.2)}, UnknownNameError, "did you mean 'pole'"),
        ([("pole", 1)], DTypeError, "randomise: expected names with their bounds"),
    ):
        with pytest.raises(kind, match=text):
            many("CartPole", 3, randomise=wrong)
    with pytest.raises(ArgumentError, match="omega: expected numbers above zero"):
        many("Pendulum", 3, randomise={"omega": (-1.0, 1.0)})
    with pytest.raises(UnknownNameError, match="autoreset_mode: there is no"):
        many("Pendulum", 3, autoreset_mode="next")


# ---- pictures


@for_each("name", NAMES)
def test_pictures(name: str) -> None:
    """A frame of each environment shows its state: what moves is drawn where it is, in its colour."""
    from stepwell.interop.gym import pictures

    envs = many(name, 3, render_mode="rgb_array")
    envs.reset(seed=1)
    envs.world.y[..., 1] = envs.world.y[..., 0] + (0.3 if name == "CartPole" else 0.8)
    frames = envs.render()
    assert len(frames) == 3
    assert all(frame.shape == (400, 600, 3) and frame.dtype == np.uint8 for frame in frames)
    assert (frames[0] != frames[1]).any()
    np.testing.assert_array_equal(frames[0], envs.render()[0])
    moving = np.array([int(pictures.MOVING[i : i + 2], 16) for i in (1, 3, 5)])
    left, right, bottom, top = envs.view
    for member, frame in enumerate(frames):
        line = next(each for each in reversed(envs.sketch(member)) if each.colour == pictures.MOVING)
        (x1, y1), (x2, y2) = line.points
        # The scale is the same along both axes; the view is in the middle.
        scale = min(600 / (right - left), 400 / (top - bottom))
        x = 300 + (0.5 * (x1 + x2) - 0.5 * (left + right)) * scale
        y = 200 - (0.5 * (y1 + y2) - 0.5 * (bottom + top)) * scale
        np.testing.assert_allclose(frame[round(y), round(x)], moving, atol=2)
    assert pictures.tiled(frames).shape == (800, 1200, 3)
    single = one(name, render_mode="rgb_array")
    single.reset(seed=1)
    assert single.render().shape == (400, 600, 3)
    assert single.unwrapped.metadata["render_fps"] == round(1.0 / single.unwrapped.many.world.dt)


def test_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is shown after each step, and closed once; without a screen it is there, too."""
    import matplotlib

    monkeypatch.setattr(matplotlib, "rcParams", matplotlib.rcParams)
    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    shown: list[Any] = []
    monkeypatch.setattr(plt, "pause", shown.append)
    envs = many("CartPole", 20, render_mode="human")
    envs.reset(seed=1)
    assert envs.step(np.zeros(20, int))[0].shape == (20, 4)
    assert envs.render() is None
    assert shown == [0.02] * 3
    envs.close()
    assert not plt.get_fignums()


# ---- known truths


def test_the_steps_of_gymnasiums_cart_pole() -> None:
    """By Standard Euler: the same formulas, in another order here and there, so they differ by rounding alone.

    Pushes to and fro keep |x| small and the pole falls from 0.05 rad within some 25 steps, each of which multiplies differences
    by at most 1 + 0.02·√15 < 1.1: 25 steps of some 20 roundings of numbers below 10 stay below 25·20·10·2⁻⁵³·1.1²⁵ < 1e-11.
    """
    theirs = gymnasium.make("CartPole-v1").unwrapped
    envs = many("CartPole", 1, method="standard_euler")
    envs.reset(seed=0)
    for seed in range(5):
        theirs.reset(seed=seed)
        x, speed, angle, turning = theirs.state
        envs.world.v[:, 0], envs.world.y[:2, 0] = (speed, turning), (x, angle)
        envs._over[:] = False
        for k in range(25):
            action = (k // 3) % 2
            _, reward, terminated, _, _ = theirs.step(action)
            mine = envs.step(np.array([action]))
            now = [envs.world.y[0, 0], envs.world.v[0, 0], envs.world.y[1, 0], envs.world.v[1, 0]]
            assert np.abs(now - theirs.state).max() < 1e-11
            assert (bool(mine[2][0]), float(mine[1][0])) == (terminated, reward)
            if terminated:
                break
    # Another method is another motion.
    envs = many("CartPole", 1, method="rk4")
    envs.reset(seed=0)
    theirs.reset(seed=0)
    x, speed, angle, turning = theirs.state
    envs.world.v[:, 0], envs.world.y[:2, 0] = (speed, turning), (x, angle)
    theirs.step(1)
    envs.step(np.array([1]))
    assert abs(envs.world.y[0, 0] - theirs.state[0]) > 1e-4


@for_each("wrong", [("4.0 / 3.0", "1.3333"), ("pull - moment", "pull + moment"), ("cosine**2 / whole", "cosine**2")])
def test_a_wrong_formula_of_the_cart_would_be_seen(wrong: tuple[str, str]) -> None:
    """By far more than the bound above: one step of 0.02 s makes it so."""
    text = inspect.getsource(sw.gym.cart_pole.function)
    assert wrong[0] in text
    namespace: dict[str, Any] = {"np": np, "system": sw.system, "Any": Any}
    exec(text.replace(*wrong), namespace)
    after = []
    for kind in (sw.gym.cart_pole, namespace["cart_pole"]):
        world = sw.World(kind, "standard_euler", v=np.array([0.1, 0.2]), y=np.array([0.0, 0.1, 10.0]), dt=0.02)
        world.step()
        after.append(world.v)
    assert np.abs(after[0] - after[1]).max() > 1e-7


def test_the_steps_of_gymnasiums_pendulum() -> None:
    """By False Euler, from where it hangs, so that its speed stays below the bound: 40 steps of roundings of numbers below 20."""
    theirs = gymnasium.make("Pendulum-v1").unwrapped
    envs = many("Pendulum", 1, method="false_euler")
    envs.reset(seed=0)
    rng = np.random.default_rng(7)
    theirs.reset(seed=0)
    theirs.state = np.array([np.pi - 0.3, 0.5])
    envs.world.v[0], envs.world.y[0] = 0.5, np.pi - 0.3 + np.pi
    for _ in range(40):
        action = rng.uniform(-2.5, 2.5, 1).astype(np.float32)
        seen, reward, *_ = theirs.step(action.astype(np.float64))  # of a float32 it would compute in float32
        mine = envs.step(action[np.newaxis])
        # From below, √15·0.05 rad a step: differences of about 1e-15 a step grow by no more than the number of steps, squared.
        assert np.abs(mine[0][0] - seen).max() <= 8 * EPS32
        assert abs(envs.world.v[0] - theirs.state[1]) < 40 * 40 * 20 * 2.0**-52
        # The angle of the reward is reduced to ±π, where it is rounded like π.
        assert float(mine[1][0]) == pytest.approx(float(reward), abs=1e-9)


@for_each("torque", [1.0, -0.7])
def test_the_motor_of_the_double_rod_does_its_work(torque: float) -> None:
    """The energy grows by ∫ u·(ω₂ − ω₁) dt: by the trapezoidal rule over n = 4000 steps of h, which errs by h²/12·t·max|f″|.

    f = u·(ω₂ − ω₁) turns with some 8 rad/s at most: |f″| < 8³, so the error is below (0.5/4000)²/12·0.5·512 < 4e-7. A torque held
    over a step while the rods turn adds h/2·max|f′|·t = 0.5/8000·64·0.5 < 2.1e-3 at most. A torque of the wrong sign on one of
    the rods would be seen: the work of each is more than 0.01, and would be missing twice.
    """
    envs = many("DoubleRod", 1, dt=0.5 / 4000, max_episode_steps=None)
    envs.reset(seed=3)
    energy, work, of_each = [], 0.0, np.zeros(2)
    rate = None
    for _ in range(4001):
        v, y = envs.world.v[..., 0], envs.world.y[..., 0]
        energy.append(0.5 * (v**2).sum() + 9.8 * y[:, 1].sum())
        turning = sw.gym.DoubleRodVectorEnv.look(v, y)[4:]
        now = torque * np.array([-turning[0], turning[1]])
        if rate is not None:
            of_each += 0.5 * (rate + now) * (0.5 / 4000)
        rate = now
        envs.step(np.full((1, 1), torque, np.float32))
    work = of_each.sum()
    assert energy[-1] - energy[0] == pytest.approx(work, abs=2.1e-3)
    assert (np.abs(of_each) > 0.01).all()
    assert np.abs(np.linalg.norm(envs.world.y[0, :, 0]) - 1.0) < 1e-12


def test_what_is_seen_of_the_double_rod() -> None:
    envs = many("DoubleRod", 200)
    seen, _ = envs.reset(seed=1)
    assert (np.abs(np.arctan2(seen[:, 1], seen[:, 0])) <= 0.1 + EPS32).all()
    assert (np.abs(seen[:, 4:]) <= 0.1 * (1 + 4 * EPS32)).all()
    tip = -(seen[:, 0] + seen[:, 2])
    assert tip == pytest.approx(envs.world.y[1, 1], abs=4 * float(EPS32))
    envs.world.y[..., 0] = [[0.0, 1.0], [0.1, 1.99]]
    _, rewards, terminated, _, _ = envs.step(np.zeros((200, 1), np.float32))
    assert terminated.tolist() == [True] + [False] * 199
    assert rewards.tolist() == [0.0] + [-1.0] * 199


def test_shorter_steps_come_nearer_to_the_truth() -> None:
    """Method, step and number of steps are arguments: sixteen steps of RK4 for one err less by 16⁴, and are much nearer."""

    def end(substeps: int) -> Any:
        envs = many("Pendulum", 1, dt=0.05 / substeps, substeps=substeps)
        envs.reset(seed=2)
        for _ in range(20):
            envs.step(np.full((1, 1), 0.5, np.float32))
        return envs.world.y[0]

    finest = end(64)
    assert 0 < abs(end(16) - finest) < abs(end(1) - finest) / 1000


@for_each(
    "name", [name for name in sw.gym.__all__ if name.endswith("VectorEnv") and name not in ("WorldVectorEnv", "TracedVectorEnv")]
)
def test_examples_print_what_they_say(name: str) -> None:
    example = doctest.DocTestParser().get_doctest(inspect.getdoc(getattr(sw.gym, name)) or "", {}, name, None, None)
    assert example.examples
    output: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    runner.run(example, out=output.append)
    assert runner.failures == 0, "".join(output)


# ---- wrong calls


def test_wrong_calls() -> None:
    for options, error, message in (
        ({"num_envs": 0}, ArgumentError, "num_envs: expected 1 or more, got 0"),
        ({"dt": 0.0}, ArgumentError, "dt: expected numbers above zero in seconds"),
        ({"method": "rk5"}, UnknownNameError, "there is no 'rk5'"),
        ({"render_mode": "ansi"}, UnknownNameError, "render_mode: there is no 'ansi'"),
    ):
        with pytest.raises(error, match=message):
            sw.gym.PendulumVectorEnv(**options)
    with pytest.raises(UnsupportedError, match="leapfrog needs a second-order system"):
        sw.gym.CartPoleVectorEnv(method="leapfrog")
    envs = sw.gym.CartPoleVectorEnv(3)
    with pytest.raises(ArgumentError, match=r"step: expected after reset\(\)"):
        envs.step(np.zeros(3, dtype=int))
    envs.reset()
    with pytest.raises(ShapeError, match=r"actions: expected shape \(3,\), got int64 of shape \(2,\)"):
        envs.step(np.zeros(2, dtype=np.int64))


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


def test_a_world_of_another_type_is_refused() -> None:
    arguments: dict[str, Any] = {"method": "leapfrog", "dt": 0.1, "substeps": 1, "max_episode_steps": 5}
    assert Stone(2, **arguments).world.y.dtype == np.float64
    with pytest.raises(UnsupportedError, match="Stone has no pictures"):
        Stone(2, **arguments, render_mode="rgb_array")
    with pytest.raises(UnsupportedError, match="dtype: Stone makes a world of float64, and float32 was asked for"):
        Stone(2, **arguments, dtype="float32")
    with pytest.raises(DTypeError, match="dtype: expected 'float64' or 'float32', got 'float16'"):
        many("Pendulum", dtype="float16")


def test_gymnasium_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("stepwell.interop.gym")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(UnsupportedError, match=r"needs gymnasium, which is not installed; pip install 'stepwell\[gym\]'"):
        _ = sw.gym


@for_each("name", NAMES)
def test_more_of_them_than_memory_has_room_for_are_refused(name: str) -> None:
    with pytest.raises(TooLargeError, match=r"num_envs: states and observations of 100000000000 members need .* take fewer"):
        many(name, 10**11)
