"""The work-precision chart: cost and error of each method on a scene, and the step at which it becomes unstable."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable

import numpy as np

from ... import _core
from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError, UnsupportedError
from ...model.methods import Method, choice
from ...runs import engine
from ...scenes import Scene
from ...scenes import scene as find_scene
from . import measure, timing
from .data import Curve, WorkPrecision
from .known import chartable
from .peers import TOLERANCES, Peer, Solved
from .peers import peer as find_peer

#: The longest and the shortest step of the ladder (a geometric grid of steps), as multiples of the scene's step.
LARGEST, SMALLEST = 16.0, 1 / 3000

#: The number of additional longer steps, at which even the method with the largest stability limit is unstable.
EXTRA_RUNGS = 2

#: The most steps of a run of the ladder; more would take minutes.
MAX_STEPS = 2_000_000

#: The precisions of the curves of a chart.
DTYPES = ("float64", "float32", "both")

#: For blocks of more numbers than this, MAX_STEPS is divided by the square of the ratio, as the number of pairs of bodies grows.
SMALL_BLOCK = 16

#: But the most steps are at least this many times those of the scene: large nets are stable only near these.
TIMES_THE_SCENE = 10.0

#: A chart of all methods leaves implicit ones out for blocks of more numbers than this: the work of a step grows as the cube of
#: this number, and 100 bodies in space would take them most of an hour.
MOST_UNKNOWNS = 128

#: Seconds that are expected, for the progress: of a method's times, of a point, of a number in each of its rate evaluations, and
#: of a peer.
TIMING, POINT, NUMBER, PEER = 0.15, 0.004, 1e-9, 2.0

#: Steps of the ladder per factor of ten.
RUNGS_PER_DECADE = 10


def work_precision(
    scene: Scene | str,
    methods: Iterable[Method | str] | None = None,
    steps: Iterable[int] | None = None,
    *,
    tolerances: Iterable[float] | None = None,
    peers: Iterable[Peer | Callable[[Scene, Array, float], Solved]] = (),
    fused: bool | str = False,
    dtype: str = "float64",
    progress: Callable[[float], object] | None = None,
) -> WorkPrecision:
    """Run a scene by many methods with many steps and tolerances, and measure errors, stability and cost.

    Each point is a run over the scene's horizon. Its errors are the largest of the run, that at the end, the phase error at
    the end and the energy error. Cost is counted in function (rate) evaluations per unit of simulated time, which leaves out
    the linear algebra of implicit methods. It is also measured, for a single run and for a batch of equal members, on one
    thread. Everything but the times is repeatable to the bit.

    A scene without an exact solution is compared with a run to a tight tolerance, as long as a less tight one agrees with it; the
    horizon ends there. A scene's control is omitted, since the true motion has none.

    Args:
        scene: a ``Scene``, or the name of one.
        methods: names, or what ``stepwell.method`` returns; all if None, without implicit ones if the state has more than
            128 numbers.
        steps: numbers of steps over the horizon, each 4 or more; if None, ten in each factor of ten, from steps of 24
            times the scene's down to a 3000th of it, or to two million steps.
        tolerances: for a second curve, "merson, tolerance", of each method that estimates its error; if None, 1e-2 to
            1e-12, two in each factor of ten; no such curves if empty, or if the system has friction. Such a run saves its
            state at ten times.
        peers: other programs, such as ``peers.scipy("DOP853")``; see ``stepwell.charts.peers``.
        fused: compute with fused multiply-adds; ``"both"`` for a curve of each, "rk4" and "rk4, fused". A scene whose step is too
            long to be fused is refused.
        dtype: ``"float64"``, ``"float32"``, or ``"both"`` for a curve of each, "rk4" and "rk4, float32". Curves by tolerance are
            computed in float64. A scene that float32 does not support is refused.
        progress: a function that is called with the fraction that is done.

    Returns:
        A ``WorkPrecision``. Methods that cannot step the system are in its ``refused``, with the reason.

    Raises:
        UnsupportedError: if a peer is not installed.

    Example:
        >>> chart = sw.charts.work_precision("oscillator", ["leapfrog", "rk4"], [500, 1000, 2000], tolerances=[])
        >>> [curve.method.name for curve in chart.curves]
        ['leapfrog', 'rk4']
    """
    whole, chosen = find_scene(scene), choice(methods)
    numbers = None
    if steps is not None:
        numbers = sorted({checks.count("steps", n, 4) for n in checks.several("steps", steps, "numbers of steps")})
        if not numbers:
            raise ArgumentError("steps: expected at least one, got none")
    several = TOLERANCES if tolerances is None else checks.several("tolerances", tolerances, "tolerances")
    wanted = sorted({checks.number("tolerances", each, positive=True) for each in several}, reverse=True)
    others = [find_peer(each) for each in checks.several("peers", peers, "peers")]
    ways = (False, True) if isinstance(fused, str) and checks.known("fused", fused, ("both",)) else (checks.flag("fused", fused),)
    dtypes = [name for name in ("float64", "float32") if checks.known("dtype", dtype, DTYPES) in (name, "both")]
    progress = checks.callback("progress", progress)
    scene, floor = chartable(whole)
    ladder = _ladder(scene) if numbers is None else numbers

    reasons = {method.name: measure.refusal(scene, method) or _left_out(scene, method, methods) for method in chosen}
    refused = {name: reason for name, reason in reasons.items() if reason is not None}
    able = [method for method in chosen if reasons[method.name] is None]
    paced = wanted and not scene.system.has_stick_friction and not scene.system.contacts  # adaptive steps do not work with these
    adaptive = [method for method in able if method.error_order is not None and not method.has_series and paced]
    curves: list[Curve] = []

    sizes = {method.name: engine.evaluations(method, scene.system) * (scene.v.size + scene.y.size) for method in able}
    of_steps = [[POINT + NUMBER * n * sizes[method.name] for n in ladder] for method in able]
    of_tolerances = [[POINT * (wanted[0] / each) ** (1.0 / method.order) for each in wanted] for method in adaptive]
    timed = TIMING * (len(dtypes) * len(able) + len(adaptive))
    in_all = len(ways) * (timed + len(dtypes) * sum(map(sum, of_steps)) + sum(map(sum, of_tolerances))) + PEER * len(others)
    spent = 0.0

    def done(seconds: float) -> None:
        nonlocal spent
        spent += seconds
        if progress is not None:
            progress(min(1.0, spent / max(in_all, POINT)))

    for kind, way in itertools.product(dtypes, ways):
        batch, single = (timing.step_times(scene, able, members, way, kind) for members in (None, 0))
        done(TIMING * len(able))
        for method, seconds in zip(able, of_steps, strict=True):
            points = []
            for n, expected in zip(ladder, seconds, strict=True):
                points.append(measure.assess(scene, method, scene.horizon / n, n, way, kind))
                done(expected)
            edge = measure.largest_stable_step(scene, method, points, way, kind)
            curves.append(Curve(method, tuple(points), edge, batch[method.name], single[method.name], fused=way, dtype=kind))
    for way in ways:
        batch, single = timing.tried_times(scene, adaptive, None, way), timing.tried_times(scene, adaptive, 0, way)
        done(TIMING * len(adaptive))
        for method, seconds in zip(adaptive, of_tolerances, strict=True):
            points = []
            for tolerance, expected in zip(wanted, seconds, strict=True):
                points.append(measure.assess_tolerance(scene, method, tolerance, way))
                done(expected)
            times = batch[method.name], single[method.name]
            curves.append(Curve(method, tuple(points), math.inf, *times, by="tolerance", fused=way))
    for peer in others:
        try:
            curves.append(measure.assess_peer(scene, peer))
        except UnsupportedError as error:
            refused[peer.name] = str(error)
        done(PEER)
    if progress is not None:
        progress(1.0)
    cut = scene.horizon < whole.horizon
    return WorkPrecision(
        scene, tuple(curves), refused, timing.CHARTS.members_of(scene), timing.CHARTS.repeats, _core.isa(), floor, cut
    )


def _left_out(scene: Scene, method: Method, methods: object) -> str | None:
    """Why a chart of all methods has none of this one, or None."""
    unknowns = scene.v.size + scene.y.size
    if methods is not None or not method.is_implicit or unknowns <= MOST_UNKNOWNS:
        return None
    return f"each step solves equations in {unknowns} unknowns: name {method.name} in methods= to chart it"


def _ladder(scene: Scene) -> list[int]:
    """Numbers of steps, evenly spread on a logarithmic scale."""
    usual = scene.horizon / scene.dt
    most = MAX_STEPS * min(1.0, SMALL_BLOCK / max(1, scene.y.size)) ** 2
    few, many = usual / LARGEST, min(max(most, TIMES_THE_SCENE * usual), MAX_STEPS, usual / SMALLEST)
    few = max(4.0, few)
    gaps = round(RUNGS_PER_DECADE * np.log10(many / few))
    rungs = few * (many / few) ** (np.arange(-EXTRA_RUNGS, gaps + 1) / gaps)
    return sorted({round(n) for n in rungs.tolist() if n >= 4.0})
