"""The loop of a world on a device: as ``_core.World``, with arrays that stay in the memory of the host.

Each call of ``step`` takes the state to the device, makes its steps there, and brings the state back. What the system is made of
goes there again only after it has changed; many bodies keep the arrays of their steps there, too.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..errors import ArgumentError, BusyError, UnsupportedError
from ..model.around import FORCE
from . import bodies, fixed
from .opencl import Machine
from .stages import Numbers, Stages


class Live(NamedTuple):
    """An array of a parameter, which is read before steps; its numbers are above ``least`` and at most ``most``.

    ``last`` has its numbers as they were read last, ``place`` is the number of its rows among those of the model.
    """

    name: str
    array: Array
    last: Array
    place: int
    least: float
    most: float


class World:
    """A prepared loop. It holds both arrays."""

    def __init__(
        self, machine: Machine, model: Any, plan: Any, v: Array, y: Array, carry: Array | None = None, force: Array | None = None
    ) -> None:
        self._machine, self._v, self._y, self._force = machine, v, y, force
        self._rooms = fixed.Rooms(machine)
        self._t0, self._dt, self._step, self._changes = plan.t0, plan.dt, plan.first, 0
        self._alone = threading.Lock()
        self._model_is(model, plan)
        if carry is not None:
            self.carry_on(carry)

    def _model_is(self, model: Any, plan: Any) -> None:
        """Go on with these numbers of the system, from the state in the arrays."""
        self._model, self._plan, self._members = model, plan, plan.members
        self._rows = self._copied(model)
        self._names: list[str] | None = None
        self._live: list[Live] = []
        self._waits = False
        self._numbers: Numbers | bodies.Bodies | None = None
        if bodies.takes(model, plan):
            self._on_device: Stages | bodies.Bodies = bodies.Bodies(self._machine, plan)
        else:
            self._on_device = fixed.text_of(model, self._v.dtype == np.float32, plan.choice)[0]
        self._sizes = sizes = self._on_device.sizes
        self._carries = self._on_device.carries or sizes["kept"] > 0
        self._memory = sizes["memory"]
        #: The v slot and what is kept, by rows; and the arrays as last written, if they belong to it.
        self._held = np.zeros((sizes["v"] + sizes["kept"], self._members), self._v.dtype)
        self._written: tuple[Array, Array] | None = None

    @staticmethod
    def _copied(model: Any) -> list[Array]:
        """The rows of a model, which may be those of the caller's arrays."""
        return [np.array(each) for each in model.rows]

    def _of_rows(self) -> list[str]:
        """The names of the arrays of the model, in order."""
        if self._names is None:
            plan = self._plan
            parameters = plan.system.parameters(plan.batch, series=plan.method.has_derivatives, single=plan.single)
            self._names = [each for each, value in parameters if isinstance(value, np.ndarray)]
            self._names += [FORCE] * (self._force is not None)
        return self._names

    def _place(self, name: str) -> int:
        """The number of the array of this name among those of the model."""
        return self._of_rows().index(name)

    def _of_now(self) -> Numbers | bodies.Bodies:
        """The system's numbers on the device."""
        if self._numbers is None:
            if isinstance(self._on_device, bodies.Bodies):
                self._on_device.take(dict(zip(self._of_rows(), self._rows, strict=True)))
                self._numbers = self._on_device
            else:
                model = SimpleNamespace(rows=self._rows, tables=self._model.tables)
                self._numbers = Numbers(self._machine, self._on_device, model, self._members, self._dt)
        return self._numbers

    def step(self, n: int = 1) -> bool:
        """``n`` steps, in place. Whether a number of the state is not finite then."""
        n = checks.count("n", n, 0, checks.LAST_STEP - self._step)
        self._enter()
        try:
            self._read()
            if self._force is not None:
                self._replace(self._place(FORCE), self._force)
            saved_v, saved_y, held = self._made(n, carried=not self._is_moved())
            self._v[...], self._y[...] = saved_v, saved_y
            self._step += n
            if self._carries:
                self._held, self._written = held, (self._v.copy(), self._y.copy())
            return not (np.isfinite(saved_v).all() and np.isfinite(saved_y).all())
        finally:
            self._alone.release()

    def _made(self, n: int, *, carried: bool) -> tuple[Array, Array, Array]:
        """The state after n steps, and what is held then."""
        members, kind, numbers = self._members, self._v.dtype, self._of_now()
        n_v, n_y = self._sizes["v"], self._sizes["y"]
        kept = self._held[n_v:] if carried else self._held[len(self._held) - self._memory :]
        v = self._held[:n_v] if carried else self._v.reshape(n_v, members)
        saved_v, saved_y = np.empty((1, n_v, members), kind), np.empty((1, n_y, members), kind)
        held = np.empty_like(self._held)
        first_bad = np.zeros(members, np.int64)  # whether a member diverged is not looked for
        arrays = SimpleNamespace(
            v=np.concatenate([v, kept]), y=self._y.reshape(n_y, members), carried=carried, saved_v=saved_v, saved_y=saved_y,
            recorded=None, tally=None, carry=held if self._carries else None, first_bad=first_bad,
        )  # fmt: skip
        # Without steps the state is saved as it is at the start.
        plan = self._plan._replace(first=self._step, steps=n, every=None if n else 1, progress=None)
        if isinstance(numbers, bodies.Bodies):
            bodies.run(self._machine, plan, arrays, numbers)
        else:
            fixed.run(self._machine, self._model, plan, arrays, numbers, self._rooms)
        return saved_v.reshape(-1), saved_y.reshape(-1), held

    def _is_moved(self) -> bool:
        """True if the arrays differ from what was last written."""
        now = self._v, self._y
        return self._written is None or any(a.tobytes() != b.tobytes() for a, b in zip(now, self._written, strict=True))

    def _replace(self, place: int, numbers: Array) -> bool:
        """Take other rows of a parameter; returns whether they differ."""
        before = self._rows[place]
        now = np.array(numbers, np.float64).reshape(before.shape)
        if now.tobytes() == np.ascontiguousarray(before).tobytes():
            return False
        self._rows[place], self._numbers = now, None
        return True

    def _enter(self) -> None:
        if not self._alone.acquire(blocking=False):
            raise BusyError("the world is being stepped by another thread; one at a time may do that")

    def carry(self) -> Array | None:
        """The carry, by rows; None if the next step begins with ``v`` itself."""
        return None if not self._carries or self._is_moved() else self._held.reshape(-1).copy()

    def carry_on(self, carry: Array) -> None:
        """Go on with this carry, which belongs to what is in the arrays now."""
        if self._carries and carry.size == self._held.size:
            self._held = np.array(carry, self._v.dtype).reshape(self._held.shape)
            self._written = self._v.copy(), self._y.copy()

    def memory(self) -> Array:
        """The memory of a sampled controller, by rows."""
        return self._held[len(self._held) - self._memory :].reshape(-1).copy()

    def remember(self, memory: Array) -> None:
        """Let a sampled controller remember this, by rows."""
        if memory.size == self._memory * self._members:
            self._held[len(self._held) - self._memory :] = np.reshape(memory, (self._memory, self._members))

    def play(self, *_: Any) -> None:
        """Episodes are played by the CPU."""
        raise UnsupportedError("device: episodes are played by the CPU; use device='cpu'")

    def take(self, model: Any, plan: Any) -> None:
        """Go on with other parameters; arrays of parameters are not read any more."""
        self._model_is(model, plan)
        self._changes += 1

    def watch(self, model: Any, arrays: Sequence[tuple[str, Array, str, float, float]]) -> None:
        """Read these arrays before each call of ``step``: name, array, name of its rows, what numbers are above, and at most."""
        self._rows, self._numbers = self._copied(model), None
        self._live = [Live(name, array, array.copy(), self._place(row), least, most) for name, array, row, least, most in arrays]

    def read(self) -> None:
        """Read them now."""
        self._enter()
        try:
            self._read()
        finally:
            self._alone.release()

    def _read(self) -> None:
        for name, array, last, place, least, most in self._live:
            if array.tobytes() == last.tobytes():
                continue
            fits = (array > least) & (array <= most)
            if not fits.all():
                bounds = " above zero" if least == 0.0 else " of zero or more" if np.isfinite(least) else ""
                raise ArgumentError(
                    f'world.parameters["{name}"]: expected finite numbers{bounds}, got {array[~fits][0]:g}; no step was made'
                )
            last[...] = array
            self._replace(place, array)
            self._waits = True
        if self._waits:
            self._waits, self._written = False, None  # a method with a carry starts again from the state
            self._changes += 1

    def restart(self, members: Sequence[int], carry: Array | None) -> None:
        """Start these members again from their state in the arrays; all others go on with this carry, by rows."""
        self._changes += 1
        if carry is None or not self._carries or carry.size != self._held.size:
            return
        rows = np.array(carry, self._v.dtype).reshape(self._held.shape)
        if len(members):
            index = list(members)
            rows[:, index] = self._made(0, carried=False)[2][:, index]
        self.carry_on(rows)

    @property
    def changes(self) -> int:
        """How often parameters or members were set."""
        return self._changes

    @property
    def t(self) -> float:
        """The time at which the world stands."""
        return float(self._t0 + self._step * self._dt)

    @property
    def step_number(self) -> int:
        """The number of the step at which the world stands."""
        return int(self._step)
