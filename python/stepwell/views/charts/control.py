"""Control charts: the errors of the controlled quantity and of the state over the gain, and with projection (§12)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import checks, registry
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.pictures import Drawn
from ...base.tables import Table, stacked
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...model import controls
from ...model.methods import Method, choice
from ...model.methods import of_operations as find_method
from ...model.systems import NBody, System
from ...scenes import Scene
from ...scenes import scene as find_scene
from ...studies.measuring.known import chartable
from .control_runs import LENGTH_KINDS, Exact, Held, Runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Default methods: one that adds energy, one that conserves it, and two more accurate ones.
METHODS = ("standard_euler", "false_euler", "standard_heun", "rk4")

#: Default gains: h·C·K at the start of bodies, six decades; c of rods, from 0.01 to 4, past the limits of most methods.
RELATIVE = tuple(float(gain) for gain in 10.0 ** np.linspace(-4.0, 2.0, 25))
LENGTH_GAINS = tuple(float(gain) for gain in np.geomspace(0.01, 4.0, 27))

#: Function evaluations of each run of rods, for each of the scene's steps.
LENGTH_EVALUATIONS = (4, 16, 64)

#: Ways of projection, the limit of a control with an infinite gain.
WAYS: tuple[str, ...] = controls.WAYS


@dataclass(frozen=True, eq=False)
class ControlSweep(Drawn, Table, ValueEquality):
    """Errors of the controlled quantity and of the state against the gain: a row for each method, kind and gain.

    Attributes:
        title: title of the picture.
        system: the system: bodies with a control of the energy, or rods with a control of the lengths.
        horizon: the time of each run.
        evaluations: function (rate) evaluations of a run, one or several numbers; each is another step.
        lines: one for each method and kind that can be combined, and each number of evaluations.
        refused: why others cannot, by method and kind.
        exact: whether the exact state at the end is known.
    """

    title: str
    system: System
    horizon: float
    evaluations: tuple[int, ...]
    lines: tuple[Held, ...]
    refused: dict[tuple[str, str], str]
    exact: bool

    @property
    def keeps_lengths(self) -> bool:
        """True if the lengths of rods are controlled, and not an energy."""
        return self.system.constraint == "length"

    def line(self, method: Method | str, kind: str, evaluations: int | None = None) -> Held:
        """The line of that method and kind, with this number of evaluations; the first number if None.

        Raises:
            ArgumentError: if there are no runs with this number of evaluations.
        """
        name = find_method(method).name
        count = self.evaluations[0] if evaluations is None else evaluations
        if count not in self.evaluations:
            raise ArgumentError(f"evaluations: expected one of {list(self.evaluations)}, got {checks.short(count)}")
        at = self.evaluations.index(count)
        of_method: dict[str, list[Held]] = {}
        for line in self.lines:
            if line.method.name == name:
                of_method.setdefault(line.kind, []).append(line)
        return of_method[checks.known("kind", kind, of_method)][at]

    @property
    def better(self) -> dict[str, tuple[bool, ...]]:
        """For rods: for each method and each number of evaluations, whether control is better than resetting at most gains.

        Better means a smaller error of the last state; gains at which the run diverged do not count.
        """
        by_method: dict[str, tuple[bool, ...]] = {}
        for name in dict.fromkeys(line.method.name for line in self.lines if line.kind == LENGTH_KINDS[1] and self.exact):
            pairs = [[self.line(name, kind, count) for kind in LENGTH_KINDS] for count in self.evaluations]
            by_method[name] = tuple(
                bool(np.median([*limited.state_error[~limited.diverged], np.inf][:-1] or [np.inf]) < reset.state_error[0])
                for limited, reset in pairs
            )
        return by_method

    @property
    def answer(self) -> str:
        """For rods, in a sentence: the methods for which control is better than resetting, as Hoffmann supposes (§12)."""
        titles: dict[str, list[str]] = {"control": [], "resetting": [], "depends": []}
        for name, better in self.better.items():
            titles["control" if all(better) else "depends" if any(better) else "resetting"].append(find_method(name).title)
        parts = [f"{each} is better for {_listed(names)}" for each, names in titles.items() if names and each != "depends"]
        parts += [f"for {_listed(titles['depends'])} it depends on the step"] * bool(titles["depends"])
        return f"Rods under control, or reset after every step: {'; '.join(parts)}" if parts else ""

    def draw(self) -> Figure:
        """The picture, on a new figure."""
        figure: Figure = registry.task("draw_lengths" if self.keeps_lengths else "draw_control")(self)
        return figure

    def summary(self) -> list[dict[str, Any]]:
        """A row for each method, kind and step: the gains with the least errors, and the least gain at which a run diverged."""
        rows = []
        for line in self.lines:
            least = [_least(line.relative, errors) for errors in (line.energy_error, line.state_error)]
            fell = line.relative[line.diverged]
            rows.append(
                {
                    "method": line.method.name,
                    "kind": line.kind,
                    "dt": line.dt,
                    "least_energy_error": least[0][1],
                    "at_relative": least[0][0],
                    "least_state_error": least[1][1],
                    "state_at_relative": least[1][0],
                    "diverged": int(line.diverged.sum()),
                    "diverged_from": float(fell[0]) if fell.size else float("nan"),
                }
            )
        return rows

    def _head(self) -> dict[str, Any]:
        head: dict[str, Any] = {"title": self.title, "system": repr(self.system), "horizon": self.horizon}
        head["evaluations"] = list(self.evaluations)
        if self.keeps_lengths:
            head |= {"answer": self.answer, "better": {name: list(each) for name, each in self.better.items()}}
        refused = [{"method": method, "kind": kind, "reason": why} for (method, kind), why in self.refused.items()]
        return head | {"refused": refused}

    def _columns(self) -> dict[str, list[Any]]:
        lengths = ("length_error",) if self.keeps_lengths else ()
        names = ("kind", "dt", "steps", "relative", "energy_error", "state_error", *lengths, "largest", "first_bad_step")
        return stacked({"method": line.method.name} | {name: getattr(line, name) for name in names} for line in self.lines)


def control(
    scene: Scene | System | str,
    methods: Iterable[Method | str] = METHODS,
    *,
    v: Any = None,
    y: Any = None,
    horizon: float | None = None,
    evaluations: int | Iterable[int] | None = None,
    exact: Exact | tuple[Any, Any] | None = None,
    relative: Any = None,
    forms: Iterable[str] | None = None,
    ways: Iterable[str] | None = None,
    title: str | None = None,
    progress: Callable[[float], object] | None = None,
) -> ControlSweep:
    """Run bodies or rods by several methods without control, under control with many gains, and projected; measure the errors.

    The energy of bodies or the lengths of rods are controlled. All methods make the same number of function evaluations, so a
    method with k evaluations a step makes a k-th of the steps, each k times as long. All gains of a method and a form are one
    batch.

    Args:
        scene: a scene of bodies or of rods or its name, or a system ``NBody``, ``Rods`` or ``Pendulum3D``, which needs ``v``,
            ``y``, ``horizon`` and ``evaluations``.
        methods: names, or what ``stepwell.method`` returns.
        v: velocities at the start, of the shape of the block; those of the scene if None.
        y: coordinates at the start, likewise.
        horizon: the time of each run, in units of time; the scene's if None.
        evaluations: function (rate) evaluations of each run, one number or several; if None, one for each of the scene's steps,
            and for rods 4, 16 and 64.
        exact: the exact solution as a function of times of shape (n,), which returns blocks v and y of shape (n, *block), or the
            two blocks at the end; the scene's if None. For a scene of rods without one it is a run to a tight tolerance.
        relative: gains, shape (gains,), without a unit: h·C·K at the start for bodies, c for rods.
        forms: forms of the control: those of ``EnergyControl``, or ``"control"`` for ``LengthControl``; all if None.
        ways: ways of ``Projection``: ``"scaling"`` and ``"nacozy"``, or ``"length"``; all if None.
        title: title of the picture; if None, the scene's title or the system.
        progress: a function that is called with the fraction that is done.

    Returns:
        A ``ControlSweep``. Methods that cannot be controlled are in its ``refused``, with the reason.

    Raises:
        ArgumentError: what was given and what was expected.

    Example:
        >>> chart = sw.charts.control("energy_control", ["standard_euler"], relative=[0.1, 0.3], evaluations=[500], horizon=5.0)
        >>> [row["kind"] for row in chart.summary()]
        ['none', 'limited', 'printed', 'scaling', 'nacozy']
    """
    if isinstance(scene, str):
        scene = find_scene(scene)
    if isinstance(scene, Scene):
        if horizon is not None:
            scene = replace(scene, horizon=checks.number("horizon", horizon, positive=True, unit="units of time"))
        rods = scene.system.constraint == "length"
        if rods and exact is None:
            scene = chartable(scene)[0]
        bare: Any = scene.system
        v, y = (b if a is None else a for a, b in ((v, scene.v), (y, scene.y)))
        horizon = scene.horizon
        if evaluations is None:
            evaluations = [factor * scene.steps_for(scene.dt) for factor in (LENGTH_EVALUATIONS if rods else (1,))]
        if exact is None and horizon <= scene.until:
            exact = scene.exact
        title = scene.title if title is None else title
    else:
        bare = scene
    if not isinstance(bare, NBody) and not (isinstance(bare, System) and bare.constraint == "length"):
        raise DTypeError(f"scene: expected a scene of bodies or rods, its name, or such a system, got {type(bare).__name__}")
    for name, argument in {"v": v, "y": y, "horizon": horizon, "evaluations": evaluations}.items():
        if argument is None:
            raise ArgumentError(
                f"{name}: expected it beside {'an' if isinstance(bare, NBody) else 'a'} {bare.kind_name} system, got None"
            )
    chosen = choice(METHODS if methods is None else methods)
    kinds = _kinds(bare, forms, ways)
    progress = checks.callback("progress", progress)

    system = bare.for_state_shapes(v, y)
    v, y = (checks.block(name, a, system.v_shape, system.axes) for name, a in (("v", v), ("y", y)))
    if system.batch or v.shape != system.v_shape or y.shape != system.y_shape:
        raise ShapeError(f"scene: expected one start of shape {system.v_shape}, got a batch; the gains are the batch here")
    horizon = checks.number("horizon", horizon, positive=True, unit="units of time")
    counts = _counts(evaluations)
    setup = Runs(system, np.asarray(v), np.asarray(y), horizon, exact)
    if relative is None:
        relative = LENGTH_GAINS if system.constraint == "length" else RELATIVE
    gains = np.atleast_1d(checks.numbers("relative", relative, positive=True))
    if gains.ndim != 1 or not gains.size:
        raise ShapeError(f"relative: expected gains of shape (gains,), got {gains.shape}")

    lines, refused = [], {}
    for i, method in enumerate(chosen):
        for kind in kinds:
            try:
                lines += [setup.line(method, kind, np.sort(gains), count) for count in counts]
            except UnsupportedError as why:
                refused[method.name, kind] = str(why)
        if progress is not None:
            progress((i + 1) / len(chosen))
    name = repr(system) if title is None else title
    return ControlSweep(name, system, horizon, counts, tuple(lines), refused, exact is not None)


def _kinds(system: System, forms: Any, ways: Any) -> list[str]:
    """The kinds of runs: without control, with each form of it, and with each way of projection."""
    known = ((LENGTH_KINDS[0],), (LENGTH_KINDS[1],)) if system.constraint == "length" else (controls.FORMS, WAYS)
    kinds = ["none"]
    for argument, wanted, names in zip(("forms", "ways"), (forms, ways), known, strict=True):
        kinds += [
            checks.known(argument, each, names)
            for each in checks.several(argument, names if wanted is None else wanted, argument)
        ]
    return kinds


def _counts(evaluations: Any) -> tuple[int, ...]:
    """The numbers of evaluations, each once, ascending."""
    one = isinstance(evaluations, str) or not isinstance(evaluations, Iterable) or getattr(evaluations, "ndim", 1) == 0
    several = [evaluations] if one else checks.several("evaluations", evaluations, "numbers")
    counts = sorted({checks.count("evaluations", each, 1) for each in several})
    if not counts:
        raise ShapeError("evaluations: expected one number or several, got none")
    return tuple(counts)


def _listed(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _least(relative: Array, errors: Array) -> tuple[float, float]:
    """The gain with the least error, and that error."""
    if not np.isfinite(errors).any():
        return float("nan"), float("nan")
    i = int(np.nanargmin(errors))
    return float(relative[i]), float(errors[i])
