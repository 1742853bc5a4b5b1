"""Control charts: what a control of the energy does to the energy and to the state, over its gain (§12, Appendix D)."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _checks
from .. import control as controls
from .._checks import Array
from .._value import Value
from ..errors import AccuracyWarning, ArgumentError, ControlWarning, DivergenceWarning, DTypeError, ShapeError, UnsupportedError
from ..integrate import integrate
from ..methods import Method, choice
from ..methods import method as find_method
from ..result import Run
from ..scenes import Scene
from ..scenes import scene as find_scene
from ..systems import NBody
from .files import write_csv, write_json
from .style import Drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Default methods: one that adds energy, one that keeps it, and two more accurate ones.
METHODS = ("standard_euler", "false_euler", "standard_heun", "rk4")

#: Default gains h·C·K at the start: six decades.
RELATIVE = tuple(float(gain) for gain in 10.0 ** np.linspace(-4.0, 2.0, 25))

#: Ways of projection, the limit of a control with an infinite gain.
WAYS: tuple[str, ...] = controls.WAYS

#: States of a run, evenly spaced, that are saved to measure energy and coordinates.
SAVED_STATES = 1000

#: Number of times at which the exact solution is evaluated for its scale.
SCALE_SAMPLES = 1001

Whole = np.ndarray[Any, np.dtype[np.int64]]
Exact = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Held(Value):
    """One method under one kind of control, over the gains. Runs that diverged have infinite errors.

    Attributes:
        method: the method.
        kind: ``"none"``, a form of ``EnergyControl`` or a way of ``Projection``.
        dt: the step, in units of time.
        steps: how many steps were made.
        relative: h·C·K at the start, shape (gains,); one NaN if the kind has no gain.
        energy_error: the largest |E − E₀| of the saved states, divided by the kinetic energy at the start, shape (gains,).
        state_error: how far the last state is from the exact one, of the same shape; NaN if no exact one is known.
        largest: the largest coordinate of the saved states, of the same shape.
        first_bad_step: the first step that was not finite, or −1, of the same shape.
    """

    method: Method
    kind: str
    dt: float
    steps: int
    relative: Array
    energy_error: Array
    state_error: Array
    largest: Array
    first_bad_step: Whole

    @property
    def diverged(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """The gains at which a run diverged."""
        return self.first_bad_step >= 0


@dataclass(frozen=True, eq=False)
class ControlSweep(Drawn, Value):
    """Errors of energy and state against the gain of a control.

    Attributes:
        title: title of the picture.
        system: the system.
        horizon: the time of each run.
        evaluations: function (rate) evaluations of each run.
        lines: one for each method and kind that can be combined.
        refused: why others cannot, by method and kind.
        exact: whether the exact state at the end is known.
    """

    title: str
    system: NBody
    horizon: float
    evaluations: int
    lines: tuple[Held, ...]
    refused: dict[tuple[str, str], str]
    exact: bool

    def line(self, method: Method | str, kind: str) -> Held:
        """The line of that method and kind.

        Raises:
            UnknownNameError: if there is none.
        """
        name = find_method(method).name
        of_method = {line.kind: line for line in self.lines if line.method.name == name}
        return of_method[_checks.known("kind", kind, of_method)]

    def draw(self) -> Figure:
        """The picture, on a new figure."""
        from .control_picture import draw

        return draw(self)

    def rows(self) -> list[dict[str, Any]]:
        """A row for each method, kind and gain."""
        columns = self._columns()
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def summary(self) -> list[dict[str, Any]]:
        """A row for each method and kind: the gains with the least errors, and from which gain on some diverged."""
        rows = []
        for line in self.lines:
            least = [_least(line.relative, errors) for errors in (line.energy_error, line.state_error)]
            fell = line.relative[line.diverged]
            rows.append(
                {
                    "method": line.method.name,
                    "kind": line.kind,
                    "least_energy_error": least[0][1],
                    "at_relative": least[0][0],
                    "least_state_error": least[1][1],
                    "state_at_relative": least[1][0],
                    "diverged": int(line.diverged.sum()),
                    "diverged_from": float(fell[0]) if fell.size else float("nan"),
                }
            )
        return rows

    def to_csv(self, path: str | Path) -> None:
        """Write ``rows()``, one line each; every number reads back as itself."""
        write_csv(self._columns(), path)

    def to_json(self, path: str | Path) -> None:
        """Write system, horizon, summary, rows and refusals; what is not finite is null."""
        head = {"title": self.title, "system": repr(self.system), "horizon": self.horizon, "evaluations": self.evaluations}
        refused = [{"method": method, "kind": kind, "reason": why} for (method, kind), why in self.refused.items()]
        write_json(head | {"summary": self.summary(), "rows": self.rows(), "refused": refused}, path)

    def _columns(self) -> dict[str, list[Any]]:
        names = ("relative", "energy_error", "state_error", "largest", "first_bad_step")
        columns: dict[str, list[Any]] = {name: [] for name in ("method", "kind", "dt", "steps", *names)}
        for line in self.lines:
            for name in ("kind", "dt", "steps"):
                columns[name] += [getattr(line, name)] * len(line.relative)
            columns["method"] += [line.method.name] * len(line.relative)
            for name in names:
                columns[name] += getattr(line, name).tolist()
        return columns


def control(
    scene: Scene | NBody | str,
    methods: Iterable[Method | str] = METHODS,
    *,
    v: Any = None,
    y: Any = None,
    horizon: float | None = None,
    evaluations: int | None = None,
    exact: Exact | tuple[Any, Any] | None = None,
    relative: Any = RELATIVE,
    forms: Iterable[str] = controls.FORMS,
    ways: Iterable[str] = WAYS,
    title: str | None = None,
    progress: Callable[[float], object] | None = None,
) -> ControlSweep:
    """Run bodies by several methods without control, under control with many gains, and projected; measure energy and state.

    All methods make the same number of function evaluations, so a method with k evaluations a step makes a k-th of the steps,
    each k times as long. All gains of a method and a form are one batch.

    Args:
        scene: a scene of bodies or its name, or an ``NBody`` system for which ``v``, ``y``, ``horizon`` and ``evaluations``
            are given.
        methods: names, or what ``stepwell.method`` returns.
        v: velocities at the start, shape (bodies, dim); those of the scene if None.
        y: coordinates at the start, likewise.
        horizon: the time of each run, in units of time; the scene's if None.
        evaluations: function (rate) evaluations of each run; if None, one for each of the scene's steps.
        exact: the exact solution as a function of times of shape (n,), which returns blocks v and y of shape (n, bodies, dim),
            or the two blocks at the end; the scene's if None.
        relative: gains h·C·K at the start, shape (gains,), without a unit.
        forms: forms of ``EnergyControl``.
        ways: ways of ``Projection``.
        title: title of the picture; if None, the scene's title or the system.
        progress: is called with the fraction that is done.

    Returns:
        A ``ControlSweep``. Methods that cannot be controlled are in its ``refused``, with the reason.

    Raises:
        ArgumentError: what was given and what was expected.
    """
    if isinstance(scene, str):
        scene = find_scene(scene)
    if isinstance(scene, Scene):
        given: Any = scene.system
        v, y = (b if a is None else a for a, b in ((v, scene.v), (y, scene.y)))
        horizon = scene.horizon if horizon is None else _checks.number("horizon", horizon, positive=True, unit="units of time")
        evaluations = scene.steps_for(scene.dt) if evaluations is None else evaluations
        if exact is None and horizon is not None and horizon <= scene.until:
            exact = scene.exact
        title = scene.title if title is None else title
    else:
        given = scene
    if not isinstance(given, NBody):
        raise DTypeError(f"scene: expected a scene of bodies, its name, or an NBody system, got {type(given).__name__}")
    for name, argument in {"v": v, "y": y, "horizon": horizon, "evaluations": evaluations}.items():
        if argument is None:
            raise ArgumentError(f"{name}: expected it beside an NBody system, got None")
    chosen = choice(METHODS if methods is None else methods)
    kinds = [_checks.known("forms", form, controls.FORMS) for form in _checks.several("forms", forms, "forms")]
    kinds = ["none", *kinds, *(_checks.known("ways", way, controls.WAYS) for way in _checks.several("ways", ways, "ways"))]
    progress = _checks.callback("progress", progress)

    system = given.sized(v, y)
    v, y = (_checks.block(name, a, system.v_shape, system.axes) for name, a in (("v", v), ("y", y)))
    if system.batch or v.shape != system.v_shape or y.shape != system.y_shape:
        raise ShapeError(f"scene: expected one start of shape {system.v_shape}, got a batch; the gains are the batch here")
    setup = _Setup(
        system,
        np.asarray(v),
        np.asarray(y),
        _checks.number("horizon", horizon, positive=True, unit="units of time"),
        _checks.count("evaluations", evaluations, 1),
        exact,
    )
    gains = np.atleast_1d(_checks.numbers("relative", relative, positive=True))
    if gains.ndim != 1 or not gains.size:
        raise ShapeError(f"relative: expected gains of shape (gains,), got {gains.shape}")

    lines, refused = [], {}
    for i, method in enumerate(chosen):
        for kind in kinds:
            try:
                lines.append(setup.line(method, kind, np.sort(gains)))
            except UnsupportedError as why:
                refused[method.name, kind] = str(why)
        if progress is not None:
            progress((i + 1) / len(chosen))
    name = repr(system) if title is None else title
    return ControlSweep(name, system, setup.horizon, setup.evaluations, tuple(lines), refused, exact is not None)


class _Setup:
    """What is run, from where, and what is exact."""

    def __init__(
        self, system: NBody, v: Array, y: Array, horizon: float, evaluations: int, exact: Exact | tuple[Any, Any] | None
    ) -> None:
        self.system = system
        self.v = v
        self.y = y
        self.horizon = horizon
        self.evaluations = evaluations
        self.end: tuple[Array, Array] | None = None
        self.energy = float(system.energy(v, y))
        self.kinetic = self.energy - float(system.energy(np.zeros_like(v), y))
        if not self.kinetic > 0.0:
            raise ArgumentError("v: a start at rest has no kinetic energy, which is the scale of gains and of energies here")
        if exact is None:
            return
        if callable(exact):
            blocks = exact(np.linspace(0.0, horizon, SCALE_SAMPLES))
            if not (isinstance(blocks, tuple) and [np.shape(block) for block in blocks] == [(SCALE_SAMPLES, *v.shape)] * 2):
                raise ShapeError(f"exact: expected a function of n times that returns v and y of shape (n, {str(v.shape)[1:]}")
            self.end = blocks[0][-1], blocks[1][-1]
        else:
            given = _checks.several("exact", exact, "blocks, v and y at the end")
            if len(given) != 2:
                raise ShapeError(f"exact: expected a pair of blocks, v and y at the end, got {len(given)} of them")
            pair = [_checks.block("exact", block, system.v_shape, system.axes) for block in given]
            self.end = pair[0], pair[1]
            blocks = np.stack([v, pair[0]]), np.stack([y, pair[1]])
        self.scales = [float(_length(block, (1, 2)).max()) for block in blocks]

    def line(self, method: Method, kind: str, gains: Array) -> Held:
        """Run a method under one kind of control, all gains at once."""
        steps = max(1, round(self.evaluations / method.evaluations))
        dt = self.horizon / steps
        relative = np.array([np.nan])
        held: controls.EnergyControl | controls.Projection | None = None
        if kind in controls.FORMS:
            relative, held = gains, controls.EnergyControl(form=kind, relative=gains)
        elif kind != "none":
            held = controls.Projection(kind)
        shape = (*self.system.v_shape, len(relative))
        v, y = (np.broadcast_to(block[..., np.newaxis], shape) for block in (self.v, self.y))
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # That much gain is too much is what the chart shows.
            warnings.simplefilter("ignore", DivergenceWarning)
            warnings.simplefilter("ignore", AccuracyWarning)
            warnings.simplefilter("ignore", ControlWarning)
            run = integrate(self.system, method, v=v, y=y, dt=dt, steps=steps, every=max(1, steps // SAVED_STATES), control=held)
            energy = np.abs(run.energy - self.energy).max(axis=0) / self.kinetic
            largest = np.abs(run.y).max(axis=(0, 1, 2))
            state = self._state_error(run)
        fell = run.first_bad_step >= 0
        energy, largest, state = (np.where(fell, np.inf, a) for a in (energy, largest, state))
        return Held(method, kind, dt, steps, relative, energy, state, largest, run.first_bad_step)

    def _state_error(self, run: Run) -> Array:
        """The larger of the errors of the two blocks at the end, divided by the block's scale."""
        if self.end is None:
            return np.full(run.status.shape, np.nan)
        ends = zip((run.v[-1], run.y[-1]), self.end, self.scales, strict=True)
        return np.maximum(*(_length(block - true[..., np.newaxis], (0, 1)) / scale for block, true, scale in ends))


def _length(block: Array, axes: tuple[int, int]) -> Array:
    return np.asarray(np.sqrt((block * block).sum(axis=axes)))


def _least(relative: Array, errors: Array) -> tuple[float, float]:
    """The gain with the least error, and that error."""
    if not np.isfinite(errors).any():
        return float("nan"), float("nan")
    i = int(np.nanargmin(errors))
    return float(relative[i]), float(errors[i])
