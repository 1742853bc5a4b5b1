"""The work-precision chart: what each method costs on a scene, how wrong it is, and where it falls off."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from .. import _checks, _core
from ..errors import ArgumentError, DTypeError
from ..methods import Method
from ..methods import method as find_method
from ..methods import methods as every_method
from ..scenes import Scene
from ..scenes import scene as find_scene
from . import measure
from .data import Curve, WorkPrecision

#: The ladder goes from this many times the scene's step, beyond every method's limit, to this small a part of it.
LARGEST, SMALLEST = 16.0, 1 / 3000

#: But no run of the ladder has more steps than this, for it would take minutes.
MOST = 2_000_000

#: Rungs of the ladder per factor of ten.
RUNGS = 10


def work_precision(
    scene: Scene | str,
    methods: Iterable[Method | str] | None = None,
    steps: Iterable[int] | None = None,
    *,
    progress: Callable[[float], object] | None = None,
) -> WorkPrecision:
    """Run a scene by many methods with many steps, and measure errors, stability and cost.

    Each point is a run over the scene's horizon; its error is the largest of the run. Cost is counted, in rate
    evaluations per unit of simulated time, and measured, on a batch of equal members on one thread. Everything but the
    times is repeatable to the bit.

    Args:
        scene: a ``Scene`` with an exact solution, or the name of one.
        methods: names, or what ``stepwell.method`` returns; all if None.
        steps: numbers of steps over the horizon, each 4 or more; if None, ten in each factor of ten, from steps of 16
            times the scene's down to a 3000th of it, or to two million steps.
        progress: is called with the share that is done.

    Returns:
        A ``WorkPrecision``. Methods that cannot do the system are in its ``refused``, with the reason.

    Raises:
        ArgumentError: what was given and what was expected; also if the scene has no exact solution.
    """
    if not isinstance(scene, (Scene, str)):
        raise DTypeError(f"scene: expected a Scene or its name, got {type(scene).__name__}")
    scene = chartable(find_scene(scene))
    if isinstance(methods, str):
        raise DTypeError(f"methods: expected a list of names, got the text {methods!r}")
    chosen = list(dict.fromkeys(every_method() if methods is None else map(find_method, methods)))
    ladder = _ladder(scene) if steps is None else sorted({_checks.count("steps", n, 4) for n in steps})
    if not chosen or not ladder:
        raise ArgumentError(f"{'steps' if chosen else 'methods'}: expected at least one, got none")

    reasons = {method.name: measure.refusal(scene, method) for method in chosen}
    able = [method for method in chosen if reasons[method.name] is None]
    times = measure.step_times(scene, able)
    curves = []
    for i, method in enumerate(able):
        points = tuple(measure.assess(scene, method, scene.horizon / n, n) for n in ladder)
        edge = measure.largest_stable_step(scene, method, points)
        curves.append(Curve(method, points, edge, times[method.name]))
        if progress is not None:
            progress((i + 1) / len(able))
    refused = {name: reason for name, reason in reasons.items() if reason is not None}
    return WorkPrecision(scene, tuple(curves), refused, measure.MEMBERS, measure.REPEATS, _core.isa())


def chartable(scene: Scene) -> Scene:
    """The scene, if there is anything to chart.

    Raises:
        ArgumentError: if it has no exact solution.
    """
    if scene.exact is None:
        raise ArgumentError(f"scene: {scene.name} has no exact solution, so there is no error to chart")
    return scene


def _ladder(scene: Scene) -> list[int]:
    """Numbers of steps, evenly spread on a logarithmic scale."""
    few, many = scene.horizon / (LARGEST * scene.dt), min(MOST, scene.horizon / (SMALLEST * scene.dt))
    rungs = np.geomspace(max(4.0, few), many, round(RUNGS * np.log10(many / few)) + 1)
    return sorted({round(n) for n in rungs.tolist()})
