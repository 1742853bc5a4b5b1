"""Scenes, and the errors of their runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base import checks, registry
from ..base.arrays import Array, Shape, Whole
from ..base.immutable import ValueEquality, frozen
from ..base.progress import in_notebook
from ..base.reprs import facts
from ..errors import ArgumentError, DTypeError, NotFiniteError, ShapeError
from ..model.compatibility import velocities
from ..model.controls import AnyControl, a_control
from ..model.methods import Method
from ..model.systems import System
from ..model.systems.base import a_system
from ..runs.execution import quietly
from ..runs.integration import integrate
from ..runs.result import Run

#: The scale of the exact solution is that of SCALE_SAMPLES times over the horizon. Where a group changes by more than STEEP of
#: its largest length from one time to the next, there may be a peak between them: MORE_SAMPLES are added there, and again between
#: those, down to an interval of SHORTEST of the horizon and up to MAX_SAMPLES in all.
SCALE_SAMPLES, STEEP, MORE_SAMPLES, SHORTEST, MAX_SAMPLES = 1001, 0.25, 15, 1e-12, 40_000

#: A component that is always smaller than this part of its block's largest length, and may be rounding, is measured by that part.
LEAST_SCALE = 1e-12

#: n steps of horizon/n end at the horizon up to two roundings, each of 2⁻⁵³ of the time.
TIME_ROUNDING = 2.0**-51


@dataclass(frozen=True, eq=False)
class Scene(ValueEquality):
    """A system with an initial state, a step and a time span over which methods are judged.

    ``Scene(system, v=0.0, y=1.0, horizon=30.0)`` suffices; all other arguments have defaults.

    Attributes:
        system: the system to step, of one member.
        v: velocity block at t = 0, of the system's ``v_shape``, or one number for all of it; a first-order system has none.
        y: coordinate block at t = 0, likewise of its ``y_shape``.
        horizon: time over which errors are measured, in units of time, above zero; that of ``until`` if None.
        dt: the usual step, in units of time; Hoffmann's where it gives one, a thousandth of the horizon if None.
        exact: the solution as a function of times of shape (n,), which returns blocks v and y of shape (n, *block): a formula, or
            an orbit computed in multi-precision. If None, there is no state error, and charts and advice use a run to a tight
            tolerance as the reference solution.
        until: the last time for which ``exact`` is valid, in units of time; errors after it are NaN, since they are not known.
        control: the control with which ``run`` steps, or None.
        period: the period of the exact solution, in units of time, or None.
        jumps: times at which rates jump, as ``integrate`` takes them, for adaptive steps; None if there are none.
        max_step: the longest adaptive step, in units of time, or None.
        positive: components that must not become negative in adaptive steps, as ``integrate`` takes them, or None.
        name: the name by which it is chosen.
        title: its title in a picture; the name if empty.
        section: section of Hoffmann (2002), or a note that the scene is stepwell's own.
        description: what moves, and what it shows.
        error: what an error of 1 means here.

    Two scenes are equal if all of these are. A scene can be pickled and copied if its ``exact`` can: those of the built-in scenes
    can, a lambda cannot.

    Raises:
        ArgumentError: what was given and what was expected.

    Example:
        >>> scene = Scene(sw.Pendulum(), v=0.0, y=2.0, horizon=20.0)
        >>> sw.advise(scene, frame=None, tolerance=1e-3, methods=["leapfrog", "rk4"], cost="evaluations")
        <advice for unnamed: rk4, dt = 0.30303, error 0.00089>
    """

    system: System
    v: Array = None  # type: ignore[assignment]  # never after __post_init__
    y: Array = None  # type: ignore[assignment]
    horizon: float = None  # type: ignore[assignment]  # never after __post_init__
    dt: float = None  # type: ignore[assignment]
    exact: Callable[[Array], tuple[Array, Array]] | None = None
    until: float = math.inf
    control: AnyControl | None = None
    period: float | None = None
    jumps: Any = None
    max_step: float | None = None
    positive: Any = None
    name: str = "unnamed"
    title: str = ""
    section: str = ""
    description: str = ""
    error: str = "as far from the true velocities or coordinates as the largest true ones"

    def __post_init__(self) -> None:
        """Check the arguments and fill in the defaults."""
        checked = self._checked_start() | self._checked_times()
        if self.exact is not None and not callable(self.exact):
            raise DTypeError(f"exact: expected a function of times, or None, got {type(self.exact).__name__}")
        a_control(self.control)
        for name, value in (checked | {"title": self.title or self.name}).items():
            object.__setattr__(self, name, value)

    def _checked_start(self) -> dict[str, Any]:
        """The system for its state, and the blocks, by name."""
        if self.y is None:
            raise ArgumentError("y: expected the coordinates at t = 0, got None")
        y = checks.numbers("y", self.y)
        system = a_system(self.system).for_state_shapes(None if self.v is None else checks.numbers("v", self.v), y)
        blocks = [checks.numbers("v", velocities(system, self.v)), y]
        if system.batch:
            raise ArgumentError(f"system: expected a system of one member, got parameters of shape {system.batch}")
        checked: dict[str, Any] = {"system": system}
        for name, block, shape in zip("vy", blocks, (system.v_shape, system.y_shape), strict=True):
            block = checks.block(name, block, shape, system.axes)
            if block.shape != shape:
                raise ShapeError(f"{name}: expected shape {shape} of a scene's one member, got {block.shape}")
            checked[name] = frozen(name, block)
        return checked

    def _checked_times(self) -> dict[str, Any]:
        """The horizon and all other times, by name."""
        until = math.inf if self.until is None else self.until
        forever = isinstance(until, float) and until == math.inf
        if not forever and (until := checks.number("until", until, unit="units of time")) < 0.0:
            raise ArgumentError(f"until: expected a time of zero or more in units of time, got {until:g}")
        horizon = until if self.horizon is None else self.horizon
        if self.horizon is None and until == math.inf:
            raise ArgumentError("horizon: expected the time over which errors are measured, in units of time, got None")
        horizon = checks.number("horizon", horizon, positive=True, unit="units of time")
        dt = checks.number("dt", 1e-3 * horizon if self.dt is None else self.dt, positive=True, unit="units of time")
        checked: dict[str, Any] = {"until": until, "horizon": horizon, "dt": dt}
        if self.jumps is not None:
            checked["jumps"] = tuple(np.atleast_1d(checks.numbers("jumps", self.jumps, unit="units of time")).ravel().tolist())
        if self.max_step is not None:
            checked["max_step"] = checks.number("max_step", self.max_step, positive=True, unit="units of time")
        return checked

    def run(self, method: str | Method, dt: float | None = None, *, steps: int | None = None, **options: Any) -> Run:
        """Step the scene from its start.

        Args:
            method: its name, or what ``stepwell.method`` returns.
            dt: the step, in units of time; the scene's if None.
            steps: number of steps; if None, the least number that reaches the horizon.
            **options: further arguments of ``stepwell.integrate``, such as ``every`` or ``backend``. ``control`` is the
                scene's own if it is not given; ``control=None`` leaves it out. With ``tolerance`` steps are adaptive, to ``at``,
                or to the horizon; ``dt`` is then the first step to try.

        Returns:
            A ``Run`` with blocks of shape (saved, *block).

        Raises:
            UnsupportedError: if the method cannot step the system.

        Warns:
            DivergenceWarning: if the state left the range of finite numbers.
        """
        if taken := [name for name in ("system", "v", "y") if name in options]:
            raise ArgumentError(
                f"{', '.join(taken)}: expected the scene's own, which need not be given; for others there is stepwell.integrate"
            )
        return integrate(self.system, method, **self.options_of_run(dt=dt, steps=steps, **options))

    def options_of_run(self, *, dt: float | None = None, steps: int | None = None, **options: Any) -> dict[str, Any]:
        """The arguments of ``integrate`` with which ``run`` calls it."""
        options = {"v": self.v, "y": self.y, "control": self.control} | options
        if "tolerance" in options or "at" in options:
            return {"at": [self.horizon], "dt": dt, "steps": steps} | self.adaptive_options | options
        dt = self.dt if dt is None else dt
        return options | {"dt": dt, "steps": self.steps_for(dt) if steps is None else steps}

    @property
    def adaptive_options(self) -> dict[str, Any]:
        """The arguments of ``integrate`` that the scene adds to adaptive steps."""
        options = {"jumps": self.jumps, "max_step": self.max_step, "positive": self.positive}
        return {name: value for name, value in options.items() if value is not None}

    def explore(self, *, methods: Any = None, show: bool = True) -> Any:
        """Show the scene in the browser: two methods side by side, with sliders for the step and the parameters.

        In a notebook the page is shown in the cell, if this is its last expression; no browser is opened then.

        Args:
            methods: names of the methods to choose from; all if None.
            show: whether to open the browser.

        Returns:
            The page, an ``Explorer``, which can also be saved; see ``stepwell.explore``.

        Raises:
            UnsupportedError: if no method steps the scene, or its steps are too long for a page.
        """
        show = checks.flag("show", show)
        page = registry.task("explore")(self, methods=methods)
        if show and not in_notebook():
            page.open()
        return page

    def steps_for(self, dt: float) -> int:
        """The least number of steps of ``dt`` that reach the horizon.

        Raises:
            ArgumentError: if ``dt`` is not a valid step, or needs more steps than can be counted.
        """
        dt = checks.number("dt", dt, positive=True, unit="units of time")
        quotient = self.horizon / dt
        if quotient > checks.LAST_STEP:
            raise ArgumentError(f"dt: {dt:g} needs more than {checks.LAST_STEP} steps to reach {self.horizon:g}")
        # A quotient that exceeds a whole number by rounding alone needs no further step.
        return max(1, math.ceil(quotient - 1e-9))

    def state_error(self, run: Run) -> Array:
        """The relative error of each saved state, shape (saved,); infinite if it is not finite, NaN if the true state is unknown.

        It is the larger of the errors of the two blocks; that of a block is the length of its difference from the exact one,
        divided by the block's largest length in the exact solution. Of own equations and linear systems, whose numbers may have
        units of their own, each component has an error, or each part that ``scale=`` says; the largest counts. At 1 the error is
        as large as the solution.

        Raises:
            ArgumentError: if the scene has no exact solution, or the run is of another system.
        """
        self._check(run)
        return self.state_error_at(run.t, run.v, run.y)

    def state_error_at(self, t: Array, v: Array, y: Array) -> Array:
        """The ``state_error`` of states at these times, from any source."""
        exact, known = self._solution(t)
        with np.errstate(all="ignore"):
            error = self.relative_lengths(v - exact[0], y - exact[1]).max(axis=0)
        return np.where(known, np.where(np.isfinite(error), error, np.inf), np.nan)

    def energy_error(self, run: Run) -> Array:
        """The error of the energy of each saved state, shape (saved,), relative to the largest kinetic energy.

        The kinetic energy is the scale because its zero is not a convention, as that of a potential is.
        States that are not finite or not known are treated as in ``state_error``.

        Raises:
            ArgumentError: if the scene has no exact solution, or the run is of another system.
        """
        self._check(run)
        return self.energy_error_at(run.t, run.energy)

    def energy_error_at(self, t: Array, energy: Array) -> Array:
        """The ``energy_error`` of energies at these times, from any source."""
        (true_v, true_y), known = self._solution(t)
        with np.errstate(all="ignore"):
            error = np.abs(energy - self.energies(true_v, true_y)) / self._kinetic_scale
        return np.where(known, np.where(np.isfinite(error), error, np.inf), np.nan)

    def amplitude(self, run: Run) -> Array:
        """The larger relative length of both blocks in each saved state, shape (saved,), as ``state_error`` measures lengths."""
        self._check(run)
        with np.errstate(all="ignore"):
            return np.asarray(self.relative_lengths(run.v, run.y).max(axis=0))

    def relative_lengths(self, v: Array, y: Array) -> Array:
        """The length of each group of numbers relative to its largest in the exact solution, shape (groups, times).

        Groups are the two blocks, or those of ``System.groups``.
        """
        lengths = self.lengths((v, y))
        return np.stack([_relative(*both) for both in zip(lengths, self.group_scales, strict=True)])

    def owns(self, run: Run) -> bool:
        """True if a run is of this scene's system, controlled or not, and of one member; its start does not matter."""
        return (
            run.system.uncontrolled.for_state_shapes(run.v[0], run.y[0]) == self.system.for_state_shapes(self.v, self.y)
            and run.status.ndim == 0
        )

    def _check(self, run: Run) -> None:
        if not isinstance(run, Run):
            raise DTypeError(f"run: expected what scene.run returns, got {type(run).__name__}")
        if not self.owns(run):
            raise ArgumentError(f"run: expected a run of the scene {self.name}, one member of {self.system!r}, got {run!r}")

    @cached_property
    def scales(self) -> tuple[float, float]:
        """The largest lengths of v and of y in the exact solution over the horizon."""
        v, y = (float(_length(block, shape).max()) for block, shape in zip(self._sampled, self._shapes, strict=True))
        return v, y

    @cached_property
    def scales_of_numbers(self) -> tuple[Array, Array]:
        """For each number of v and of y the scale of its group, of the shapes of the blocks."""
        if not self.system.groups:
            v, y = (np.full(shape, scale) for shape, scale in zip(self._shapes, self.scales, strict=True))
        else:
            scales, parts = np.asarray(self.group_scales), zip(self._groups, self._shapes, strict=True)
            v, y = (scales[part].reshape(shape) for part, shape in parts)
        return v, y

    @cached_property
    def group_scales(self) -> list[float]:
        """The largest length of each group in the exact solution, and at least a small part of the block's."""
        if not self.system.groups:
            return list(self.scales)
        largest = [float(length.max()) for length in self.lengths(self._sampled)]
        least = [LEAST_SCALE * scale for scale, part in zip(self.scales, self._groups, strict=True) for _ in np.unique(part)]
        return [max(both) for both in zip(largest, least, strict=True)]

    @cached_property
    def _groups(self) -> tuple[Whole, Whole]:
        groups = np.asarray(self.system.groups, dtype=np.int64)
        return groups[: self.v.size], groups[self.v.size :]

    def lengths(self, blocks: tuple[Array, Array]) -> list[Array]:
        """The length of each group of numbers at each time, those of v first."""
        if not self.system.groups:
            return [_length(block, shape) for block, shape in zip(blocks, self._shapes, strict=True)]
        rows = [block.reshape(len(block), -1) for block in blocks]
        return [
            np.abs(row[:, part == group][:, 0]) if (part == group).sum() == 1 else np.linalg.norm(row[:, part == group], axis=1)
            for row, part in zip(rows, self._groups, strict=True)
            for group in np.unique(part)
        ]

    @cached_property
    def _sampled(self) -> tuple[Array, Array]:
        """The exact blocks at evenly spaced times, and at more times where they change much in between."""
        t = np.linspace(0.0, self.horizon, SCALE_SAMPLES)
        states = self._solution(t)[0]
        between = np.arange(1, MORE_SAMPLES + 1) / (MORE_SAMPLES + 1)
        while True:
            steep = np.zeros(len(t) - 1, dtype=bool)
            changes = self.lengths((np.diff(states[0], axis=0), np.diff(states[1], axis=0)))
            for change, length in zip(changes, self.lengths(states), strict=True):
                steep |= change > STEEP * length.max(initial=0.0)
            steep &= np.diff(t) > SHORTEST * self.horizon
            more = (t[:-1][steep, np.newaxis] + np.diff(t)[steep, np.newaxis] * between).ravel()
            if not len(more) or len(t) + len(more) > MAX_SAMPLES:
                return states
            t = np.concatenate([t, more])
            order = np.argsort(t)
            t = t[order]
            further = self._solution(more)[0]
            v, y = (np.concatenate(both)[order] for both in zip(states, further, strict=True))
            states = v, y

    @cached_property
    def _kinetic_scale(self) -> float:
        v, y = self._sampled
        return float((self.energies(v, y) - self.energies(np.zeros_like(v), y)).max())

    @property
    def _shapes(self) -> tuple[Shape, Shape]:
        return self.system.v_shape, self.system.y_shape

    def _solution(self, t: Array) -> tuple[tuple[Array, Array], np.ndarray[Any, np.dtype[np.bool_]]]:
        """The exact blocks, and a mask of the times at which they are known; at later times they are the last known state."""
        if self.exact is None:
            raise ArgumentError(f"scene: {self.name} has no exact solution, so there is no error to measure")
        blocks = self.exact(np.minimum(t, self.until))
        try:
            v, y = (np.asarray(block, dtype=np.float64) for block in blocks)
        except (TypeError, ValueError):
            raise ArgumentError(
                f"exact: expected the blocks v and y, arrays of real numbers, got {type(blocks).__name__}"
            ) from None
        for name, block, shape in zip("vy", (v, y), self._shapes, strict=True):
            if block.shape != (len(t), *shape):
                raise ShapeError(f"exact: expected {name} of shape {(len(t), *shape)} for {len(t)} times, got {block.shape}")
            if not np.isfinite(block).all():
                wrong = t[~np.isfinite(block).reshape(len(t), -1).all(axis=1)][0]
                raise NotFiniteError(f"exact: expected finite numbers, got {name} = {block[t == wrong][0]} at t = {wrong:g}")
        return (v, y), t <= self.until * (1.0 + TIME_ROUNDING)

    def energies(self, v: Array, y: Array) -> Array:
        """The energies of several states, whose first axis is the time."""
        with np.errstate(all="ignore"):
            return self.system.energy(np.moveaxis(v, 0, -1), np.moveaxis(y, 0, -1))

    def _repr_html_(self) -> str:
        return facts(
            f"{self.title} ({self.name})",
            [
                ("system", repr(self.system)),
                ("usual step dt", f"{self.dt:g}"),
                ("horizon", f"{self.horizon:g}"),
                ("exact solution", "no" if self.exact is None else "yes"),
                ("control", None if self.control is None else repr(self.control)),
                ("section", self.section),
            ],
            self.description,
        )

    def __repr__(self) -> str:
        return f"<scene {self.name}: {self.title}, dt = {self.dt:g}, horizon {self.horizon:g}>"


def quiet_run(scene: Scene, method: str | Method, dt: float | None = None, **options: Any) -> Run:
    """A run as by ``scene.run``, without its diagnostics and warnings, for callers that judge the run themselves."""
    return quietly(scene.system, method, **scene.options_of_run(dt=dt, **options))


def _relative(length: Array, scale: float) -> Array:
    """Lengths divided by a scale. If that is zero, as for an empty block, zero stays zero and other lengths become infinite."""
    return length / scale if scale else np.where(length == 0.0, 0.0, np.inf)


def _length(block: Array, shape: Shape) -> Array:
    """The length of a block of that shape at each time."""
    return np.asarray(np.sqrt((block * block).sum(axis=tuple(range(1, 1 + len(shape))))))
