"""The base classes of the environments: a vector of environments by a world of many members, and a single environment."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from typing import Any, ClassVar, Literal

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete, MultiBinary, MultiDiscrete
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError, DivergenceWarning, DTypeError, ShapeError, TooLargeError, UnsupportedError
from ...model import setting
from ...model.methods import Method
from ...runs.world import World
from .pictures import MOST_TILES, Camera, Frame, Line, Window, tiled

Observations = np.ndarray[Any, np.dtype[np.float32]]
Truths = np.ndarray[Any, np.dtype[np.bool_]]
#: No environments.
NONE = np.empty(0, np.intp)
#: ``render`` returns no more frames than these, 0.7 GB.
MOST_FRAMES = 1024


def _ends(space: Any) -> tuple[Any, Any, bool]:
    """The least and the largest action, and whether actions are whole numbers."""
    if isinstance(space, Box):
        return space.low, space.high, False
    if isinstance(space, MultiBinary):
        return 0, 1, True
    return space.start, space.start + (space.n if isinstance(space, Discrete) else space.nvec) - 1, True


def parts_of(returned: Any, rule: str, *names: str) -> Any:
    """The parts that a rule of an environment returned, which must be as many as these names."""
    several = isinstance(returned, (tuple, list)) or getattr(returned, "ndim", 0) > 0
    if not several or len(returned) != len(names):
        number = f"{len(returned)} values" if several else checks.short(returned)
        raise ShapeError(f"{rule}: expected it to return ({', '.join(names)}), got {number}")
    return returned


def _of_shape(returned: Any, rule: str, shape: tuple[int, ...]) -> Array:
    """Numbers that a rule of an environment returned."""
    if np.shape(returned) != shape:
        raise ShapeError(f"{rule}: expected it to return shape {shape}, got {np.shape(returned)}")
    return np.asarray(returned)


def _checked(world: World, randomise: Any, positive: tuple[str, ...]) -> dict[str, tuple[Any, Any]]:
    """The bounds of parameters that episodes draw anew. The parameters become ones of each member."""
    if not isinstance(randomise, dict):
        raise DTypeError(f"randomise: expected names with their bounds, got {checks.short(randomise)}")
    bounds = {}
    for name, pair in randomise.items():
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise ShapeError(f"randomise[{name!r}]: expected bounds (low, high), got {checks.short(pair)}")
        world.parameters[name]  # or an error that says why it cannot be drawn
        own = setting.of_each_member(world.system, name, world.y.shape[-1:]).shape[:-1]
        low, high = (checks.numbers(f"randomise[{name!r}]", each, positive=name in positive) for each in pair)
        if (low > high).any() or any(each.ndim and each.shape != own for each in (low, high)):
            raise ArgumentError(f"randomise[{name!r}]: expected bounds (low, high) of shape {own}, got {checks.short(pair)}")
        ends = [np.broadcast_to(np.broadcast_to(each, own)[..., np.newaxis], (*own, 1)) for each in (low, high)]
        for each in reversed(ends):  # the system checks both; what is between is right, too
            world.set(**{name: np.repeat(each, world.y.shape[-1], axis=-1)})
        bounds[name] = ends[0], ends[1]
    return bounds


class WorldVectorEnv(VectorEnv):  # type: ignore[misc]  # gymnasium's types are not needed to check this
    """Environments that are stepped together, as the members of one ``World``.

    A subclass is a kind of environment: it has the spaces of one environment, makes the world, draws states, applies actions, and
    computes observations and rewards; see docs/howto/interop.md.

    Args:
        num_envs: the number of environments.
        method: the method of the world: its name, or what ``stepwell.method`` returns.
        dt: the step of the method, in seconds; by default the class attribute ``usual_dt``, if there is one.
        substeps: the number of steps for each action.
        max_episode_steps: the number of actions after which an episode is truncated; None for never; by default the class
            attribute ``episode_steps``.
        render_mode: ``"rgb_array"``, so that ``render`` returns a frame of each environment; ``"human"``, so that a window shows
            the first 16 after each step; or None.
        dtype: ``"float64"`` or ``"float32"``, the precision of the world, and of what is computed from its states.
            Observations are always returned in float32.
        autoreset_mode: when an environment whose episode ended begins anew: Gymnasium's ``AutoresetMode`` or its value. At the
            next call of ``step``, which ignores the action for it (``NEXT_STEP``); within the call that ends it, which returns
            the last observation as ``info["final_obs"]`` (``SAME_STEP``); or by ``reset`` alone, until when the motion goes on
            (``DISABLED``).
        randomise: parameters of the system that each episode draws anew, by name with the bounds of a uniform distribution, such
            as ``{"pole": (0.05, 0.2)}``.

    Attributes:
        world: the ``World``; its arrays are the states.
        steps: the number of actions of each environment since its episode began.
        dtype: NumPy's type of the world's arrays, for ``make_world``.

    Raises:
        ArgumentError: if an argument, or what a method of the subclass returns, is wrong.
        UnsupportedError: if the subclass lacks a method, or its ``make_world`` makes arrays of another type than ``dtype``.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": ["human", "rgb_array"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    #: Left, right, bottom and top of what pictures show.
    view: ClassVar[tuple[float, float, float, float]] = (-1.0, 1.0, -1.0, 1.0)
    #: The usual length of an episode; None if it has no end.
    episode_steps: ClassVar[int | None] = None
    #: The usual step, in seconds.
    usual_dt: ClassVar[float | None] = None
    #: The parameters of the system that mean nothing at zero and below, such as masses.
    positive: ClassVar[tuple[str, ...]] = ()
    #: The spaces of one environment: a ``Box``, and a ``Box``, ``Discrete``, ``MultiDiscrete`` or ``MultiBinary``.
    one_observation: ClassVar[Any]
    one_action: ClassVar[Any]

    def __init__(
        self,
        num_envs: int = 1,
        *,
        method: str | Method = "rk4",
        dt: float | None = None,
        substeps: int = 1,
        max_episode_steps: int | Literal["usual"] | None = "usual",
        render_mode: str | None = None,
        dtype: Any = "float64",
        autoreset_mode: Any = AutoresetMode.NEXT_STEP,
        randomise: dict[str, tuple[Any, Any]] | None = None,
    ) -> None:
        kind = type(self)
        if missing := [name for name in dir(kind) if getattr(getattr(kind, name), "__isabstractmethod__", False)]:
            raise UnsupportedError(f"{kind.__name__}: it needs {', '.join(missing)}; see the class that it is made from")
        for name, kinds in (("one_observation", (Box,)), ("one_action", (Box, Discrete, MultiDiscrete, MultiBinary))):
            if not isinstance(space := getattr(kind, name, None), kinds):
                known = " or ".join(each.__name__ for each in kinds)
                raise DTypeError(f"{kind.__name__}.{name}: expected {known} of gymnasium.spaces, got {checks.short(space)}")
        if render_mode is not None:
            checks.known("render_mode", render_mode, tuple(self.metadata["render_modes"]))
            if kind.sketch is WorldVectorEnv.sketch:
                raise UnsupportedError(f"render_mode: {kind.__name__} has no pictures; it needs a method sketch(member)")
        self.num_envs = checks.count("num_envs", num_envs, 1)
        # Bounds of the observations, states, forces, draws, rewards, and the results of a step.
        seen = int(np.prod(self.one_observation.shape or (1,)))
        checks.fits("num_envs: states and observations", 8 * seen + 16, (self.num_envs,), "take fewer")
        self.substeps = checks.count("substeps", substeps, 1)
        most = self.episode_steps if max_episode_steps == "usual" else max_episode_steps
        self.max_episode_steps = None if most is None else checks.count("max_episode_steps", most, 1)
        self.render_mode = render_mode
        self.single_observation_space, self.single_action_space = self.one_observation, self.one_action
        self.observation_space = batch_space(self.one_observation, self.num_envs)
        self.action_space = batch_space(self.one_action, self.num_envs)
        self.dtype: np.dtype[Any] = np.dtype(np.float32 if checks.is_single(dtype) else np.float64)
        self._low, self._high, self._whole = _ends(self.one_action)
        if dt is None and (dt := self.usual_dt) is None:
            raise ArgumentError(f"dt: expected the step in seconds, since {kind.__name__} has no usual_dt")
        self.world = self.make_world(method, checks.number("dt", dt, positive=True, unit="seconds"))
        if not isinstance(self.world, World) or self.world._plan.batch != (self.num_envs,):
            made = f"one of members {self.world._plan.batch}" if isinstance(self.world, World) else checks.short(self.world)
            rule = f"{kind.__name__}.make_world"
            raise ShapeError(f"{rule}: expected a World of {self.num_envs} members, self.num_envs, got {made}")
        if self.world.y.dtype != self.dtype:
            raise UnsupportedError(
                f"dtype: {kind.__name__} makes a world of {self.world.y.dtype}, and {self.dtype} was asked for; let its "
                f"make_world make arrays of self.dtype, and World(…, dtype=self.dtype)"
            )
        if not isinstance(autoreset_mode, AutoresetMode):
            checks.known("autoreset_mode", autoreset_mode, [each.value for each in AutoresetMode])
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self._camera: Camera | None = None
        self._window: Window | None = None
        fps = max(1, round(1.0 / (self.world.dt * self.substeps)))
        self.metadata = {**kind.metadata, "autoreset_mode": self.autoreset_mode, "render_fps": fps}  # type: ignore[misc]  # Gymnasium reads it
        self._randomised = {} if randomise is None else _checked(self.world, randomise, self.positive)
        self.steps = np.zeros(self.num_envs, dtype=np.int64)
        self._begun, self._over = False, np.zeros(self.num_envs, dtype=np.bool_)
        self._has_warned = True  # the world does so itself, unless its steps are on a tape of their own
        self.prepare()

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_camera": None, "_window": None}

    def prepare(self) -> None:
        """Called last when an environment is made, once its world is there."""

    @property
    def begins_at_next_step(self) -> bool:
        """True if an environment whose episode ended begins anew at the next call of ``step``."""
        return self.autoreset_mode is AutoresetMode.NEXT_STEP

    @property
    def states(self) -> tuple[Array, Array]:
        """The blocks v and y in float64; they are the world's own arrays, not copies, if it is stepped in float64."""
        return np.asarray(self.world.v, np.float64), np.asarray(self.world.y, np.float64)

    @abstractmethod
    def make_world(self, method: str | Method, dt: float) -> World:
        """The world, in any state, with arrays of ``self.dtype``."""

    @abstractmethod
    def draw(self, count: int) -> tuple[Array, Array]:
        """Random initial states, v and y, of ``count`` members."""

    @abstractmethod
    def act(self, actions: Any) -> None:
        """Apply the actions; called before each step of the method."""

    @abstractmethod
    def observe(self) -> Array:
        """The observations of the states, shape (num_envs, numbers)."""

    def rewards_before(self, actions: Any) -> Array | None:
        """The rewards if they depend on the states before a step; else None."""
        return None

    @abstractmethod
    def judge(self, actions: Any) -> tuple[Array, Truths]:
        """The rewards of the states after a step (ignored with ``rewards_before``), and whether each state ends its episode."""

    def begin_action(self, actions: Any) -> None:
        """Called before the steps of an action, for what ``judge`` needs of the states before them."""

    def sketch(self, member: int) -> list[Line]:
        """The lines that show an environment, in the units of ``view``."""
        raise UnsupportedError(f"render: {type(self).__name__} has no pictures; it needs a method sketch(member)")

    def frames(self, count: int) -> tuple[Frame, ...]:
        """Pictures of the first environments, each of shape (height, width, 3)."""
        if self._camera is None:
            self._camera = Camera(self.view)
        return tuple(self._camera.frame(self.sketch(member)) for member in range(count))

    def render(self) -> tuple[Frame, ...] | None:
        """See Gymnasium: a frame of each environment, or a window that shows the first ones."""
        if self.render_mode == "rgb_array":
            if self.num_envs > MOST_FRAMES:
                raise TooLargeError(
                    f"render: expected at most {MOST_FRAMES} environments, since each frame takes 0.7 MB, got {self.num_envs}; "
                    "frames(16) returns those of the first 16"
                )
            return self.frames(self.num_envs)
        if self.render_mode == "human":
            self._window = self._window or Window()
            self._window.show(tiled(self.frames(min(self.num_envs, MOST_TILES))), 1.0 / self.metadata["render_fps"])
        return None

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observations, dict[str, Any]]:
        """Begin new episodes; see Gymnasium. ``options={"reset_mask": mask}`` does so for some environments only."""
        super().reset(seed=seed)
        mask = (options or {}).get("reset_mask")
        which = np.ones(self.num_envs, dtype=np.bool_) if mask is None else checks.as_array("reset_mask", mask)
        if which.shape != (self.num_envs,) or which.dtype != np.bool_:
            raise ShapeError(f"reset_mask: expected {self.num_envs} booleans, got {which.dtype} of shape {which.shape}")
        self._begin(np.flatnonzero(which))
        self._begun = True
        if self.render_mode == "human":
            self.render()
        return self.seen(), {}

    def step(self, actions: Any) -> tuple[Observations, Array, Truths, Truths, dict[str, Any]]:
        """Apply the actions, and make ``substeps`` steps; see Gymnasium."""
        if not self._begun:
            raise ArgumentError("step: expected after reset(), which draws the states to begin with")
        actions = checks.as_array("actions", actions)
        if actions.shape != self.action_space.shape or actions.dtype.kind not in "biuf":
            raise ShapeError(f"actions: expected shape {self.action_space.shape}, got {actions.dtype} of shape {actions.shape}")
        over = (self._over != 0).nonzero()[0] if self.begins_at_next_step else NONE
        seen, rewards, terminated, truncated = self.advance(self._allowed(actions, over), over)
        if not self._has_warned and terminated.any() and len(lost := np.flatnonzero(terminated & ~self._is_finite())):
            self._has_warned = True
            warnings.warn(
                f"environment {lost[0]}{f' and {len(lost) - 1} more' * (len(lost) > 1)}: the state is no longer finite, so the "
                "episode ends; take a shorter dt with more substeps, or another method",
                DivergenceWarning,
                stacklevel=2,
            )
        if self.render_mode == "human":
            self.render()
        if self.autoreset_mode is not AutoresetMode.SAME_STEP or not len(ended := np.flatnonzero(terminated | truncated)):
            return seen, rewards, terminated, truncated, {}
        last, which = np.zeros_like(seen), np.zeros(self.num_envs, np.bool_)
        last[ended], which[ended] = seen[ended], True
        self._begin(ended)
        return self.seen(), rewards, terminated, truncated, {"final_obs": last, "_final_obs": which}

    def _allowed(self, actions: Any, over: Any) -> Any:
        """The actions, those of a ``Box`` clipped to it; environments that begin anew may have any, which are not read."""
        right = (actions >= self._low) & (actions <= self._high) if self._whole else np.isfinite(actions)
        if self._whole and actions.dtype.kind == "f":
            right &= actions == np.floor(actions)
        if not right.all():
            right[over] = True
            for first in np.argwhere(~right)[:1]:
                wrong = f"{actions[tuple(first)]:g} for environment {first[0]}"
                raise ArgumentError(f"actions: expected finite numbers in {self.one_action}, got {wrong}")
        return actions if self._whole else np.clip(actions, self._low, self._high)

    def _is_finite(self) -> Truths:
        v, y = (np.isfinite(block).reshape(-1, self.num_envs).all(axis=0) for block in (self.world.v, self.world.y))
        finite: Truths = np.asarray(v & y)
        return finite

    def advance(self, actions: Any, over: Any) -> tuple[Observations, Array, Truths, Truths]:
        """Apply the actions, make the steps, and judge; members whose episode is over begin anew instead."""
        self.begin_action(actions)
        before = self.rewards_before(actions)
        for _ in range(self.substeps):
            self.act(actions)
            self.world.step()
        self.steps += 1
        name, each = type(self).__name__, (self.num_envs,)
        rewards, terminated = parts_of(self.judge(actions), f"{name}.judge", "rewards", "ends")
        rewards = _of_shape(rewards if before is None else before, f"{name}.judge", each)
        terminated = _of_shape(terminated, f"{name}.judge", each).astype(np.bool_) | ~self._is_finite()
        late = 2**62 if self.max_episode_steps is None else self.max_episode_steps
        truncated: Truths = self.steps >= late
        if len(over):
            self._begin(over)
            rewards[over] = 0.0
            terminated[over] = truncated[over] = False
        self._over[...] = terminated | truncated
        return self.seen(), rewards, terminated, truncated

    def _begin(self, places: Any) -> None:
        self._put(places)
        self._restart(places)

    def _put(self, places: Any) -> None:
        """Draw states and parameters."""
        world = self.world
        rule = f"{type(self).__name__}.draw"
        blocks = []
        for name, block, old in zip("vy", parts_of(self.draw(len(places)), rule, "v", "y"), (world.v, world.y), strict=True):
            some = 0.0 if block is None and not old.size else block
            blocks.append(checks.block(f"{rule}: {name}", some, (*old.shape[:-1], len(places)), "numbers of a state, count"))
        v, y = blocks
        for name, (low, high) in self._randomised.items():
            array = world.parameters[name]
            array[..., places] = self.np_random.uniform(low, high, (*array.shape[:-1], len(places)))
        if world.method.begins or world._control is not None:
            world.reset(places, v=v, y=y)
        else:
            world.v[..., places] = v
            world.y[..., places] = y

    def _restart(self, places: Any) -> None:
        self.steps[places] = 0
        self._over[places] = False

    def seen(self) -> Observations:
        """The observations of the states, in float32."""
        # Rounding to float32 may pass a bound by one unit of its last place.
        space = self.one_observation
        seen = _of_shape(self.observe(), f"{type(self).__name__}.observe", self.observation_space.shape)
        return np.clip(seen.astype(np.float32, copy=False), space.low, space.high)


class WorldEnv(gymnasium.Env):  # type: ignore[misc]
    """A single environment, with Gymnasium's interface for one; its states have the same bits as those of a vector of one.

    Args:
        options: the arguments of the vector environment, ``vector``, except ``num_envs``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}
    #: The vector environment of the same kind.
    vector: ClassVar[type[WorldVectorEnv]]

    def __init__(self, **options: Any) -> None:
        # Gymnasium's wrapper limits the length of an episode.
        self.many = self.vector(1, **{"max_episode_steps": None, "autoreset_mode": AutoresetMode.DISABLED} | options)
        self.observation_space, self.action_space = self.many.single_observation_space, self.many.single_action_space
        self.render_mode = self.many.render_mode
        self.metadata = {**type(self).metadata, "render_fps": self.many.metadata["render_fps"]}  # type: ignore[misc]  # likewise

    def render(self) -> Any:
        """See Gymnasium: a frame, of shape (height, width, 3), or a window."""
        frames = self.many.render()
        return None if frames is None else frames[0]

    def close(self) -> None:
        """Close the window."""
        self.many.close_extras()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observations, dict[str, Any]]:
        """Begin a new episode; see Gymnasium."""
        super().reset(seed=seed)
        self.many.np_random = self.np_random  # both draw from the same generator
        observations, information = self.many.reset(options=options)
        return observations[0], information

    def step(self, action: Any) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Apply the action; see Gymnasium. After the end of an episode the motion goes on until ``reset``."""
        observations, rewards, terminated, truncated, information = self.many.step(checks.as_array("action", action)[np.newaxis])
        return observations[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), information
