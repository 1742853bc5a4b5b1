"""Environments whose rules are traced: an action, its steps, the reward and what is seen are one tape, compiled as one step."""

from __future__ import annotations

from abc import abstractmethod
from itertools import islice
from math import prod
from typing import Any

import numpy as np

from ... import _core
from ...base.arrays import Array
from ...errors import ArgumentError, DTypeError, ShapeError
from ...model.around import FORCE, Force
from ...model.equations.namespace import rebound
from ...model.equations.trace import run_function, scalars
from ...model.equations.values import objects, value_of
from ...reference import bits, contact
from ...reference.around import wrapped
from ...reference.traced import Tracer
from ...runs.world import World
from .base import Observations, Truths, WorldVectorEnv, parts_of

#: Above so many operations a step is not one tape.
MOST_OPERATIONS = 100_000
#: Results of the rules.
PARTS = {"push": ("v", "y", "a force or None"), "settle": ("v", "y"), "score": ("a reward", "an end")}
#: Result of ``look``.
SEEN = "an observation, as one_observation is,"
#: The rows behind the state that go on, and those of reward and truths: see ``World.play`` of the core.
GO_ON, MADE = 2, 3
#: The attributes that a copy makes for itself.
OF_A_TAPE = ("_play", "_look", "_rows", "_actions")


class TracedVectorEnv(WorldVectorEnv):
    """A base class for environments whose rules are functions of numbers, as those of ``@sw.system`` are.

    A subclass makes the world and draws states, as of ``WorldVectorEnv``. In place of ``act``, ``observe`` and ``judge`` it has
    ``push``, ``look`` and ``score``: static methods that are written for one environment in NumPy's style, and traced. What they
    do and the steps of the world become one compiled step, which takes a fraction of the time and has the same bits.

    Where that is not possible the rules are run on the arrays of all environments: with a method that carries something in place
    of v, a system that depends on the time, has a control or friction that sticks, or a step of more than 100 000 operations.
    """

    @staticmethod
    @abstractmethod
    def push(v: Any, y: Any, action: Any) -> tuple[Any, Any, Any]:
        """The state v, y in which the action is at work, and the force that is added to v̇, or None; called before each step."""

    @staticmethod
    @abstractmethod
    def look(v: Any, y: Any) -> Any:
        """The observation of a state: a list of numbers."""

    @staticmethod
    @abstractmethod
    def score(v: Any, y: Any, action: Any, before: tuple[Any, Any]) -> tuple[Any, Any]:
        """The reward, and whether the state v, y after the steps ends the episode; ``before`` is the state before them."""

    @staticmethod
    def settle(v: Any, y: Any) -> tuple[Any, Any]:
        """The state after the steps of an action, such as one with a bounded velocity."""
        return v, y

    #: The step as one tape, and the same without a step, over ``_rows``; None where rules are run on arrays.
    _play: _core.World | None = None
    _look: _core.World | None = None
    #: The states, how many actions episodes have had, whether they ended; and room for what a step makes.
    _rows: Array
    _actions: Array

    def prepare(self) -> None:
        """Trace the rules, and compile them together with the steps of the world."""
        self._play = self._look = None
        world, plan = self.world, self.world._plan
        self._numbers = prod(world.system.v_shape) + prod(world.system.y_shape)
        if not self._fits():
            return
        traced = [_traced(self, makes_steps) for makes_steps in (True, False)]
        if any(len(tape) > MOST_OPERATIONS for tape, _ in traced):
            return
        self._kept = self._numbers + GO_ON
        seen = int(np.prod(self.one_observation.shape or (1,)))
        acted = int(np.prod(self.one_action.shape or (1,)))
        rows = np.zeros((self._kept + acted + MADE + seen, self.num_envs), self.dtype)
        # The world steps the rows of the state.
        v, y = np.split(rows[: self._numbers], [prod(world.system.v_shape)])
        v, y = (block.reshape(old.shape) for block, old in zip((v, y), (world.v, world.y), strict=True))
        v[...], y[...] = world.v, world.y
        force = plan.force
        rows[self._numbers] = self.steps
        rows[self._numbers + 1] = self._over
        self._rows, self._over = rows, rows[self._numbers + 1]
        self._actions = rows[self._kept :][:acted]
        for name in self._randomised:
            world.parameters[name]  # lives, so that the tape sees what episodes draw
        live = world._live
        self.world = World(world.system, plan.method, v=v, y=y, force=force, resume=world)
        if live:
            self.world._live.update(live)
            self.world._watch()
        parameters = plan.system.parameters(plan.batch, single=plan.single)
        made = []
        for tape, symbols in traced:
            step = tape.equations([], symbols)
            options: Any = {"single": True} if plan.single else {}
            model = _core.ModelSpec(plan.system.kernel, plan.method.key, [*parameters, ("step()", step)], **options)
            core = _core.World(model, plan, np.empty(0, self.dtype), rows.reshape(-1))
            arrays = [(name, each.array.reshape(-1), each.row, each.least, each.most) for name, each in live.items()]
            core.watch(model, arrays)
            made.append(core)
        (self._play, self._look), self._has_warned = made, False

    def __getstate__(self) -> dict[str, Any]:
        state = super().__getstate__() | {"_steps": np.array(self.steps), "_over": np.asarray(self._over, np.bool_)}
        return {name: value for name, value in state.items() if name not in OF_A_TAPE}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.prepare()

    def _fits(self) -> bool:
        """True if the world's steps can be on a tape of their own."""
        world = self.world
        system, method = world.system, world.method
        own_time = system.reads_time or bool(system.all_inputs())
        around = any(part.kind != "surfaces" for part in system.around)
        pushed = getattr(system, "push", None) is not None
        no_tape = method.begins or method.is_implicit or method.is_exact
        return not (no_tape or own_time or around or pushed or world._plan.fused)

    @property
    def steps(self) -> Any:
        """The number of actions of each environment since its episode began."""
        return self._rows[self._numbers].astype(np.int64) if self._play is not None else self._steps

    @steps.setter
    def steps(self, steps: Any) -> None:
        self._steps = steps

    # ---- as one tape

    def _made(self, core: _core.World) -> tuple[Observations, Array, Truths, Truths]:
        seen = np.empty(self.observation_space.shape, np.float32)
        rewards, truths = np.empty(self.num_envs), np.empty((2, self.num_envs), np.bool_)
        core.play((self._kept, self._kept + len(self._actions)), seen.reshape(self.num_envs, -1), rewards, truths)
        return seen, rewards, truths[0], truths[1]

    def advance(self, actions: Any, over: Any) -> tuple[Observations, Array, Truths, Truths]:
        """Apply the actions, make the steps, and judge; members whose episode is over begin anew instead."""
        if self._play is None:
            return super().advance(actions, over)
        if len(over):
            self._put(over)  # and the tape leaves them as they are, since their episode is over
        np.copyto(self._actions, actions.reshape(self.num_envs, -1).T, casting="unsafe")
        return self._made(self._play)

    def seen(self) -> Observations:
        """The observations of the states."""
        return super().seen() if self._look is None else self._made(self._look)[0]

    def _restart(self, places: Any) -> None:
        if self._play is None:
            super()._restart(places)
        else:
            self._rows[self._numbers : self._kept, places] = 0.0

    # ---- on arrays

    def _run(self, name: str, *arguments: Any) -> Any:
        """A rule, of numbers of all environments or of symbols."""
        function, rule = getattr(type(self), name), f"{type(self).__name__}.{name}"
        returned = run_function(rebound(function), rule, False, *arguments)
        return parts_of(returned, rule, *PARTS[name]) if name in PARTS else returned

    def _expected(self, rule: str, part: str) -> str:
        """The beginning of what is said of a rule that returned something else."""
        return f"{type(self).__name__}.{rule}: expected {part}"

    def _state(self, v: Any, y: Any) -> tuple[Any, Any]:
        system = self.world.system
        return scalars(v, len(system.v_shape)), scalars(y, len(system.y_shape))

    def _action(self, actions: Any) -> Any:
        """The actions of all as that of one."""
        numbers = np.asarray(actions, np.float64)
        return scalars(np.moveaxis(numbers, 0, -1), numbers.ndim - 1)

    def act(self, actions: Any) -> None:
        """Push all."""
        world = self.world
        v, y, force = self._run("push", *self._state(*self.states), self._action(actions))
        if force is not None and world.force is None:
            raise ArgumentError(f"{self._expected('push', 'no force')}, since the world has none; make a World(…, force=zeros)")
        for part, block, new in (("v", world.v, v), ("y", world.y, y), ("a force", world.force, force)):
            if block is not None and new is not None:
                block[...] = _values(new, block.shape, self._expected("push", part))

    def observe(self) -> Array:
        """Look at all."""
        seen = self._run("look", *self._state(*self.states))
        shape = (*self.one_observation.shape, self.num_envs)
        return np.moveaxis(_values(seen, shape, self._expected("look", SEEN)), -1, 0)

    def begin_action(self, actions: Any) -> None:
        """Keep the states before the steps."""
        self._before = tuple(np.array(each) for each in self.states)

    def judge(self, actions: Any) -> tuple[Array, Truths]:
        """Score all."""
        world = self.world
        state = self._run("settle", *self._state(*self.states))
        for part, block, new in zip("vy", (world.v, world.y), state, strict=True):
            block[...] = _values(new, block.shape, self._expected("settle", part))
        before = self._state(*self._before)
        score = self._run("score", *self._state(*self.states), self._action(actions), before)
        each = (self.num_envs,)
        reward, ended = (_values(x, each, self._expected("score", p)) for x, p in zip(score, PARTS["score"], strict=True))
        return reward, ended.astype(np.bool_)


def _items(value: Any, shape: Any, part: str) -> Any:
    """The result of a rule as an array of objects of this shape: numbers of all environments, or symbols."""
    items = objects(value)
    out = np.empty(items.size, dtype=object)
    for i, each in enumerate(items.flat):
        out[i] = value_of(each)
        if out[i] is None:
            raise DTypeError(f"{part} of numbers, got {type(each).__name__}")
    if items.shape != shape:
        raise ShapeError(f"{part} of shape {shape}, got shape {items.shape}")
    return out.reshape(shape)


def _values(value: Any, shape: Any, part: str) -> Array:
    """The result of a rule as an array whose last axis is that of the environments."""
    items = _items(value, shape[:-1], part)
    return np.array([np.broadcast_to(each, shape[-1:]) for each in items.flat], np.float64).reshape(shape)


def _traced(env: TracedVectorEnv, makes_steps: bool) -> tuple[_core.Tape, list[Any]]:
    """The tape of a step, or of what is seen of a state, and the next rows on it."""
    plan = env.world._plan
    system, method = plan.system, plan.method
    tape = _core.Tape(single=plan.single)
    tracer = Tracer(system, tape)
    v, y, more = tracer.state()
    count, over = islice(more, GO_ON)
    h, zero, one = tape.step(), tape.number(0.0), tape.number(1.0)
    own, parts = tracer._own(), tracer._parts()
    shape = env.one_action.shape
    action = np.empty(shape, dtype=object)
    for index in np.ndindex(shape):
        action[index] = next(more)
    start = v, y
    waits = bits.less(zero, over) if makes_steps and env.begins_at_next_step else None

    def symbols(value: Any, shape: Any, rule: str, part: str) -> Any:
        items = _items(value, shape, env._expected(rule, part))
        flat = [_symbol(tape, each, one, zero) for each in items.flat]
        out = np.empty(len(flat), dtype=object)
        out[:] = flat
        return out.reshape(shape)

    reward = ended = cut = zero
    if makes_steps:
        for _ in range(env.substeps):
            pushed_v, pushed_y, force = env._run("push", *env._state(v, y), scalars(action, len(shape)))
            v, y = symbols(pushed_v, system.v_shape, "push", "v"), symbols(pushed_y, system.y_shape, "push", "y")
            around = list(parts)
            if force is not None:
                around.append((Force(len(system.v_shape)), {FORCE: symbols(force, system.v_shape, "push", "a force")}))
            s = wrapped(system.reference(h, **own), h, around)
            v, y = contact.step(method.steps, s, 0, tape.time(), h, v, y)
        settled = env._run("settle", *env._state(v, y))
        v, y = symbols(settled[0], system.v_shape, "settle", "v"), symbols(settled[1], system.y_shape, "settle", "y")
        before = env._state(*start)
        score = env._run("score", *env._state(v, y), scalars(action, len(shape)), before)
        reward, ended = (symbols(each, (), "score", part)[()] for each, part in zip(score, PARTS["score"], strict=True))
        # x − x is NaN if x is not finite, and NaN is not less than 1.
        lost = sum((x - x for x in [*v.flat, *y.flat]), start=zero)
        ended = bits.where(bits.less(lost, one), ended, one)
        count = count + one
        if env.max_episode_steps is not None:
            cut = bits.where(bits.less(count, tape.number(float(env.max_episode_steps))), zero, one)
        if waits is not None:
            v, y = (_chosen(waits, old, new) for old, new in zip(start, (v, y), strict=True))
            count, reward, ended, cut = (bits.where(waits, zero, each) for each in (count, reward, ended, cut))
        over = bits.where(bits.less(zero, ended), one, cut)
    seen = symbols(env._run("look", *env._state(v, y)), env.one_observation.shape, "look", SEEN)
    space = env.one_observation
    bounded = [
        bits.where(bits.less(x, tape.number(float(low))), tape.number(float(low)), x) if np.isfinite(low) else x
        for x, low in zip(seen.flat, np.broadcast_to(space.low, seen.shape).flat, strict=True)
    ]
    bounded = [
        bits.where(bits.less(tape.number(float(high)), x), tape.number(float(high)), x) if np.isfinite(high) else x
        for x, high in zip(bounded, np.broadcast_to(space.high, seen.shape).flat, strict=True)
    ]
    return tape, tracer.flat(v, y, count, over, action, reward, ended, cut, np.array(bounded, dtype=object))


def _chosen(truth: Any, yes: Any, no: Any) -> Any:
    """Number by number, which of two blocks of symbols."""
    out = np.empty(yes.size, dtype=object)
    out[:] = [bits.where(truth, *both) for both in zip(yes.flat, no.flat, strict=True)]
    return out.reshape(yes.shape)


def _symbol(tape: _core.Tape, value: Any, one: Any, zero: Any) -> Any:
    """A number or a truth as a symbol that is a number."""
    if isinstance(value, (bool, np.bool_)):
        return one if value else zero
    if isinstance(value, (int, float, np.integer, np.floating)) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return tape.number(float(value))
    return value
