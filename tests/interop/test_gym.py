"""Environments of Gymnasium: what its checker says, the steps of its own environments, and the work of a motor."""

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
from support.refusals import refused

gymnasium = pytest.importorskip("gymnasium")

import stepwell.interop.gym  # noqa: E402
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from support.for_each import for_each  # noqa: E402

NAMES = ["CartPole", "DoubleRod", "Pendulum"]
EPS32 = np.finfo(np.float32).eps
F = np.float32

each_type = for_each("dtype", ["float64", "float32"])


def many(name: str, num_envs: int = 5, **options: Any) -> Any:
    return gymnasium.make_vec(f"stepwell/{name}-v0", num_envs=num_envs, **options).unwrapped


def begun(name: str, num_envs: int = 5, seed: int = 1, **options: Any) -> Any:
    """Environments at the start of an episode, that draw the same actions each time."""
    envs = many(name, num_envs, **options)
    envs.action_space.seed(1)
    envs.reset(seed=seed)
    return envs


def torque(envs: Any, size: float) -> Any:
    return np.full((envs.num_envs, 1), size, F)


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
    envs = begun(name, 7)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    seen, info = envs.reset(seed=5)
    assert info == {}
    earlier = []
    for _ in range(30):
        assert seen in envs.observation_space
        assert seen.dtype == np.float32
        earlier.append((seen, seen.copy()))
        seen, *rest, info = envs.step(envs.action_space.sample())
        assert [(each.shape, each.dtype) for each in rest] == [((7,), np.float64), ((7,), np.bool_), ((7,), np.bool_)]
        assert info == {}
    assert all((a == b).all() for a, b in earlier)


@each_type
@for_each("name", NAMES)
def test_the_same_seed_and_actions_give_the_same_bits(name: str, dtype: str) -> None:
    def observations(seed: int) -> bytes:
        envs = begun(name, dtype=dtype)
        seen = [envs.reset(seed=seed)[0]] + [envs.step(envs.action_space.sample())[0] for _ in range(50)]
        return np.stack(seen).tobytes()

    assert observations(1) == observations(1) != observations(2)


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
    """Its states are near those of float64, and not the same; rewards are float64.

    Both draw the same start, whose numbers are below 8 and are rounded by half a unit in their last place, 2⁻²². Each of twenty
    steps within a second rounds by some 2⁻²¹ what then grows by e⁵ at most: upside down a pendulum of these lengths falls like
    e⁴ᵗ. Rewards of pendulums are sums of squares, whose slopes are 2π at most.
    """
    half, whole = begun(name, dtype="float32"), many(name)
    np.testing.assert_allclose(half.reset(seed=3)[0], whole.reset(seed=3)[0], atol=2.0**-21)
    near = 20 * 2.0**-21 * np.exp(5.0)
    for _ in range(20):
        action = half.action_space.sample()
        mine, theirs = half.step(action), whole.step(action)
        assert (mine[0].dtype, mine[1].dtype) == (F, np.float64)
        np.testing.assert_allclose(mine[0], theirs[0], atol=near)
        np.testing.assert_allclose(mine[1], theirs[1], atol=2.0 * np.pi * near)
    assert half.world.v.dtype == half.world.y.dtype == F
    assert (half.world.v != whole.world.v.astype(F)).any()
    assert [each.dtype for each in half.states] == [np.float64] * 2
    assert np.shares_memory(whole.states[1], whole.world.y)


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
    refused(ShapeError, "reset_mask: expected 4 booleans", envs.reset, options={"reset_mask": [1, 0]})


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


def test_many_steps_an_action_are_one_tape() -> None:
    """Twenty of two rods by Runge-Kutta 4 have more than ten thousand operations."""
    options: Any = {"substeps": 20, "dt": 0.005, "method": "rk4"}
    one, other = many("DoubleRod", 3, **options), on_arrays("DoubleRod", 3, **options)
    assert one._play is not None
    action = one.action_space.sample()
    for envs in (one, other):
        envs.reset(seed=3)
    np.testing.assert_array_equal(one.step(action)[0], other.step(action)[0])


@for_each("method", ["leapfrog", "implicit_midpoint"])
def test_methods_that_are_not_on_that_tape(method: str) -> None:
    """Their rules are run on arrays; members that begin anew leave what others carry alone."""
    envs = begun("Pendulum", 6, method=method, dt=0.02)
    assert envs._play is None
    for _ in range(5):
        envs.step(torque(envs, 1.0))
    before = envs.world.y[3:].copy()
    envs.reset(options={"reset_mask": np.arange(6) < 3})
    np.testing.assert_array_equal(envs.world.y[3:], before)
    assert np.isfinite(envs.step(torque(envs, 1.0))[0]).all()


#: Parameters that each episode draws.
RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "CartPole": {"pole": (0.05, 0.2), "gravity": (9.0, 10.0)},
    "Pendulum": {"omega": (3.0, 4.0)},
    "DoubleRod": {"lengths": (0.9, 1.1), "gravity": (9.0, 10.0)},
}


@for_each("name", NAMES)
def test_copies_and_pickles_go_on_alike(name: str) -> None:
    envs = begun(name, 6, max_episode_steps=9, randomise=RANGES[name], render_mode="rgb_array")
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
    envs, drawn = begun(name, 50, randomise=RANGES[name], max_episode_steps=4), []
    assert envs._play is not None
    for _ in range(9):
        now = {each: np.array(envs.world.parameters[each]) for each in RANGES[name]}
        drawn.append(now)
        for each, (low, high) in RANGES[name].items():
            assert now[each].shape[-1] == 50
            assert ((low <= now[each]) & (now[each] <= high)).all()
            assert now[each].std() > 0.2 * (high - low) / np.sqrt(12.0)
        over, plan, system = envs._over != 0, envs.world._plan, envs.world.system
        ask = {"v": envs.world.v.copy(), "y": envs.world.y.copy(), "dt": plan.dt, "force": plan.force, "control": system.keeper}
        world = sw.World(system.uncontrolled, plan.method, **ask)
        seen = envs.step(np.zeros(envs.action_space.shape, envs.action_space.dtype))[0]
        if name == "CartPole":
            world.y[2] = -10.0
        world.step()
        np.testing.assert_array_equal(envs.world.y[..., ~over], world.y[..., ~over])
        assert np.isfinite(seen).all()
    first = next(iter(RANGES[name]))
    assert any((a[first] != b[first]).any() for a, b in pairwise(drawn))
    other = begun(name, 50, randomise=RANGES[name], max_episode_steps=4)
    np.testing.assert_array_equal(other.world.parameters[first], drawn[0][first])


def test_wrong_ranges_and_modes() -> None:
    for name, options, kind, text in (
        ("CartPole", {"randomise": {"pole": (0.2, 0.1)}}, ArgumentError, r"randomise\['pole'\]: expected bounds \(low, high\)"),
        (
            "CartPole",
            {"randomise": {"pole": (-1.0, 0.1)}},
            ArgumentError,
            r"randomise\['pole'\]: expected numbers above zero, got -1",
        ),
        ("CartPole", {"randomise": {"pole": 0.2}}, ShapeError, r"randomise\['pole'\]: expected bounds"),
        ("CartPole", {"randomise": {"polo": (0.1, 0.2)}}, UnknownNameError, "did you mean 'pole'"),
        ("CartPole", {"randomise": [("pole", 1)]}, DTypeError, "randomise: expected names with their bounds"),
        ("Pendulum", {"randomise": {"omega": (-1.0, 1.0)}}, ArgumentError, "omega: expected numbers above zero"),
        ("Pendulum", {"autoreset_mode": "next"}, UnknownNameError, "autoreset_mode: there is no"),
    ):
        refused(kind, text, many, name, 3, **options)


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


def test_the_steps_of_gymnasiums_cart_pole() -> None:
    """By Standard Euler: the same formulas, in another order here and there, so they differ by rounding alone.

    Pushes to and fro keep |x| small and the pole falls from 0.05 rad within some 25 steps, each of which multiplies differences
    by at most 1 + 0.02·√15 < 1.1: 25 steps of some 20 roundings of numbers below 10 stay below 25·20·10·2⁻⁵³·1.1²⁵ < 1e-11.
    """
    theirs = gymnasium.make("CartPole-v1").unwrapped

    def placed_as_theirs(envs: Any, seed: int) -> None:
        theirs.reset(seed=seed)
        x, speed, angle, turning = theirs.state
        envs.world.v[:, 0], envs.world.y[:2, 0] = (speed, turning), (x, angle)
        envs._over[:] = False

    envs = begun("CartPole", 1, method="standard_euler")
    for seed in range(5):
        placed_as_theirs(envs, seed)
        for k in range(25):
            action = (k // 3) % 2
            _, reward, terminated, _, _ = theirs.step(action)
            mine = envs.step(np.array([action]))
            now = [envs.world.y[0, 0], envs.world.v[0, 0], envs.world.y[1, 0], envs.world.v[1, 0]]
            assert np.abs(now - theirs.state).max() < 1e-11
            assert (bool(mine[2][0]), float(mine[1][0])) == (terminated, reward)
            if terminated:
                break
    envs = begun("CartPole", 1, method="rk4")  # another method is another motion
    placed_as_theirs(envs, 0)
    theirs.step(1)
    envs.step(np.array([1]))
    assert abs(envs.world.y[0, 0] - theirs.state[0]) > 1e-4


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
    ends = {}
    for substeps in (1, 16, 64):
        envs = begun("Pendulum", 1, seed=2, dt=0.05 / substeps, substeps=substeps)
        for _ in range(20):
            envs.step(torque(envs, 0.5))
        ends[substeps] = envs.world.y[0]
    assert 0 < abs(ends[16] - ends[64]) < abs(ends[1] - ends[64]) / 1000


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


def test_wrong_calls() -> None:
    for options, error, message in (
        ({"num_envs": 0}, ArgumentError, "num_envs: expected 1 or more, got 0"),
        ({"dt": 0.0}, ArgumentError, "dt: expected numbers above zero in seconds"),
        ({"method": "rk44"}, UnknownNameError, "there is no 'rk44'"),
        ({"render_mode": "ansi"}, UnknownNameError, "render_mode: there is no 'ansi'"),
        ({"dtype": "float16"}, DTypeError, "dtype: expected 'float64' or 'float32', got 'float16'"),
    ):
        refused(error, message, sw.gym.PendulumVectorEnv, **options)
    refused(UnsupportedError, "leapfrog needs a second-order system", sw.gym.CartPoleVectorEnv, method="leapfrog")
    envs = sw.gym.CartPoleVectorEnv(3)
    refused(ArgumentError, r"step: expected after reset\(\)", envs.step, np.zeros(3, dtype=int))
    envs.reset()
    refused(ShapeError, r"actions: expected shape \(3,\), got int64 of shape \(2,\)", envs.step, np.zeros(2, dtype=np.int64))


@pytest.mark.parametrize("make", [lambda n, **o: sw.gym.CartPoleVectorEnv(n, **o), lambda n, **o: on_arrays("CartPole", n, **o)])
def test_actions_outside_their_space(make: Any) -> None:
    """Those that are no actions are refused, but for environments that begin anew and read none; a ``Box`` is one to clip to."""
    envs = make(3)
    envs.reset(seed=1)
    for wrong in (7, -1, 0.5, 2, np.nan, np.inf):
        with pytest.raises(
            ArgumentError, match=rf"actions: expected finite numbers in Discrete\(2\), got {wrong} for environment 1"
        ):
            envs.step(np.array([0, wrong, 1]))
    envs.step(np.array([0.0, 1.0, True]))
    # A state that is not finite ends its episode, is told once, and begins anew.
    envs.world.y[0, 1] = np.nan
    words = "environment 1: the state is no longer finite, .* take a shorter dt", "1 of 3 members diverged: member 1,"
    with pytest.warns(sw.DivergenceWarning, match=f"^{words[envs._play is None]}") as caught:
        seen, _, ended, _, _ = envs.step(np.ones(3, int))
    assert ended.tolist() == np.isnan(seen[:, 0]).tolist() == [False, True, False]
    assert len(caught) == 1
    assert np.isfinite(envs.step(np.array([1.0, np.nan, 1.0]))[0]).all()
    with pytest.raises(ArgumentError, match="got nan for environment 1"):
        envs.step(np.array([1.0, np.nan, 1.0]))
    envs.world.v[1, 2] = np.inf
    assert envs.step(np.ones(3, int))[2].tolist() == [False, False, True]


@for_each("name", ["Pendulum", "DoubleRod"])
def test_actions_are_clipped_to_their_box(name: str) -> None:
    after, most = [], getattr(sw.gym, f"{name}VectorEnv").one_action.high
    for actions in (9.0 * most, most):
        envs = many(name, 2)
        envs.reset(seed=1)
        after.append(envs.step(np.stack([actions, -actions]))[0])
        with pytest.raises(ArgumentError, match="got inf for environment 1"):
            envs.step(np.array([[0.0], [np.inf]]))
    np.testing.assert_array_equal(*after)


def test_spaces_of_whole_numbers() -> None:
    """Each from both sides."""
    for space, right, wrong in (
        (Discrete(3, start=-1), (-1, 1), (-2, 2)),
        (MultiDiscrete([2, 4]), ([0, 3], [1, 0]), ([2, 0], [0, 4])),
        (MultiBinary(2), ([0, 1], [1, 1]), ([0, 2], [-1, 0])),
    ):
        envs = type("Pushed", (Stone,), {"one_action": space})(2, dt=0.1)
        envs.reset(seed=1)
        for each in right:
            envs.step(np.array([each, each]))
        for each in wrong:
            with pytest.raises(ArgumentError, match="for environment 0"):
                envs.step(np.array([each, each]))


def test_more_frames_than_a_memory_should_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["stepwell.interop.gym.base"], "MOST_FRAMES", 3)
    assert len(many("Pendulum", 3, render_mode="rgb_array").render()) == 3
    envs = many("Pendulum", 4, render_mode="rgb_array")
    with pytest.raises(TooLargeError, match=r"render: expected at most 3 environments, .* got 4; frames\(16\)"):
        envs.render()


class Rocket(stepwell.interop.gym.TracedVectorEnv):  # type: ignore[misc]
    """Lands by an engine."""

    usual_dt, episode_steps = 0.1, 7
    one_observation, one_action = Box(-100.0, 100.0, (2,), F), Box(0.0, 20.0, (1,), F)

    def make_world(self, method: Any, dt: float) -> Any:
        v, y, thrust = (np.zeros((1, 1, self.num_envs)) for _ in range(3))
        return sw.World(sw.Particles(gravity=9.8, dim=1), method, v=v, y=y, dt=dt, force=thrust)

    def draw(self, count: int) -> Any:
        return np.zeros((1, 1, count)), np.full((1, 1, count), 20.0)

    @staticmethod
    def push(v: Any, y: Any, action: Any) -> Any:
        return v, y, [[action[0]]]

    @staticmethod
    def look(v: Any, y: Any) -> Any:
        return [y[0, 0], v[0, 0]]

    @staticmethod
    def score(v: Any, y: Any, action: Any, before: Any) -> Any:
        return 0.0, y[0, 0] < 0.0


def played(kind: Any) -> Any:
    envs = kind(3)
    envs.reset(seed=1)
    return envs.step(np.ones((3, 1)))[0]


@sw.system(order=1)
def fading(t: Any, y: Any) -> Any:
    return [-y[0], -y[1]]


def without_force(self: Any, method: Any, dt: float) -> Any:
    v, y = np.zeros((2, 1, 1, self.num_envs))
    return sw.World(sw.Particles(gravity=9.8, dim=1), method, v=v, y=y, dt=dt)


def test_what_own_environments_have_by_default() -> None:
    envs = Rocket(2)
    assert (envs.world.dt, envs.world.method.name, envs.substeps, envs.max_episode_steps) == (0.1, "rk4", 1, 7)
    assert Rocket(2, max_episode_steps=None).max_episode_steps is None
    with pytest.raises(ArgumentError, match="dt: expected the step in seconds, since Stone has no usual_dt"):
        Stone(2)


@pytest.mark.parametrize("traced", [True, False])
def test_what_own_environments_return_is_checked(traced: bool) -> None:
    """Each rule is named, with what was expected of it and what it returned."""

    def kind(**changed: Any) -> Any:
        return type("Own", (Rocket,), changed if traced else changed | {"_fits": lambda self: False})

    none: Any = staticmethod(lambda *_: None)
    of_seven: Any = lambda self, method, dt: Rocket(7).world  # noqa: E731
    for changed, text in (
        ({"make_world": none}, "Own.make_world: expected a World of 3 members, self.num_envs, got None"),
        ({"make_world": of_seven}, r"Own.make_world: expected a World of 3 members, self.num_envs, got one of members \(7,\)"),
        ({"draw": none}, r"Own.draw: expected it to return \(v, y\), got None"),
        ({"draw": lambda _, n: (np.zeros((n, 1, 1)),) * 2}, r"Own.draw: v: expected shape \(1, 1, 3, .* got \(3, 1, 1\)"),
        ({"draw": lambda _, n: (np.full((1, 1, n), np.nan),) * 2}, "Own.draw: v: expected finite numbers, got nan"),
        (
            {"push": staticmethod(lambda v, y, a: (v, y))},
            r"Own.push: expected it to return \(v, y, a force or None\), got 2 values",
        ),
        ({"push": staticmethod(lambda v, y, a: (v, y, a))}, r"Own.push: expected a force of shape \(1, 1\), got shape \(1,\)"),
        ({"look": staticmethod(lambda v, y: [1.0])}, r"Own.look: expected an observation, .* of shape \(2,\), got shape \(1,\)"),
        ({"look": staticmethod(lambda v, y: ["a", 1.0])}, "Own.look: expected an observation, .* of numbers, got str"),
        ({"score": staticmethod(lambda *_: 1.0)}, r"Own.score: expected it to return \(a reward, an end\), got 1.0"),
        ({"score": staticmethod(lambda *_: (1.0, [True]))}, r"Own.score: expected an end of shape \(\), got shape \(1,\)"),
        ({"settle": staticmethod(lambda v, y: y)}, r"Own.settle: expected it to return \(v, y\), got 1 values"),
        ({"one_observation": None}, "Own.one_observation: expected Box of gymnasium.spaces, got None"),
        ({"one_action": Dict(a=Discrete(2))}, "Own.one_action: expected Box or Discrete or MultiDiscrete or MultiBinary"),
    ):
        with pytest.raises(ArgumentError, match=text):
            played(kind(**changed))
    first: dict[str, Any] = {
        "make_world": lambda self, method, dt: sw.World(fading, method, y=np.zeros((2, self.num_envs)), dt=dt),
        "draw": lambda self, n: (None, np.ones((2, n))),
        "push": staticmethod(lambda v, y, a: (v, y, None)),
        "look": staticmethod(lambda v, y: [y[0], y[1]]),
        "score": staticmethod(lambda v, y, a, before: (y[0], y[1] < 0.0)),
    }
    np.testing.assert_allclose(played(kind(**first)), np.exp(-0.1), rtol=1e-6)
    for changed, text in (({"observe": lambda _: np.zeros(3)}, "Own.observe"), ({"judge": lambda _, a: (0.0, 1.0)}, "Own.judge")):
        with pytest.raises(ShapeError, match=rf"{text}: expected it to return shape \(3"):
            played(type("Own", (Stone,), {"usual_dt": 0.1} | changed))


def test_own_environments_that_lack_something() -> None:
    kind: Any = type("Own", (stepwell.interop.gym.WorldVectorEnv,), {})
    with pytest.raises(UnsupportedError, match="Own: it needs act, draw, judge, make_world, observe"):
        kind(3)
    envs = type("Own", (Rocket,), {"make_world": without_force, "_fits": lambda self: False})
    with pytest.raises(ArgumentError, match=r"Own.push: expected no force, since the world has none; make a World\(…, force="):
        played(envs)


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
    refused(UnsupportedError, "Stone has no pictures", Stone, 2, **arguments, render_mode="rgb_array")
    with pytest.raises(UnsupportedError, match="dtype: Stone makes a world of float64, and float32 was asked for"):
        Stone(2, **arguments, dtype="float32")


def test_gymnasium_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("stepwell.interop.gym")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(UnsupportedError, match=r"needs gymnasium, which is not installed; pip install 'stepwell\[gym\]'"):
        _ = sw.gym


@for_each("name", NAMES)
def test_more_of_them_than_memory_has_room_for_are_refused(name: str) -> None:
    refused(TooLargeError, r"num_envs: states and observations of 100000000000 members need .* take fewer", many, name, 10**11)
