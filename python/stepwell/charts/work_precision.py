"""The work-precision chart: what each method costs on a scene, how wrong it is, and where it falls off."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from .. import _checks, _core
from .._checks import Array
from ..errors import ArgumentError, DTypeError, UnsupportedError
from ..methods import Method
from ..methods import method as find_method
from ..methods import methods as every_method
from ..scenes import Scene
from ..scenes import scene as find_scene
from . import measure
from .data import Curve, WorkPrecision
from .known import chartable
from .peers import TOLERANCES, Peer, Solved
from .peers import peer as find_peer

#: The ladder goes from this many times the scene's step to this small a part of it.
LARGEST, SMALLEST = 16.0, 1 / 3000

#: And by so many rungs beyond, where even the method of the widest limit is unstable.
BELOW = 2

#: But no run of the ladder has more steps than this, for it would take minutes.
MOST = 2_000_000

#: With blocks of more numbers than this it is less, by the square, as there are pairs of bodies.
LIGHT = 16

#: Rungs of the ladder per factor of ten.
RUNGS = 10


def work_precision(
    scene: Scene | str,
    methods: Iterable[Method | str] | None = None,
    steps: Iterable[int] | None = None,
    *,
    tolerances: Iterable[float] | None = None,
    peers: Iterable[Peer | Callable[[Scene, Array, float], Solved]] = (),
    progress: Callable[[float], object] | None = None,
) -> WorkPrecision:
    """Run a scene by many methods with many steps and tolerances, and measure errors, stability and cost.

    Each point is a run over the scene's horizon; its errors are the largest of the run, that at the end, that of the phase at
    the end and that of the energy. Cost is counted, in rate evaluations per unit of simulated time, and measured, of a single
    run and on a batch of equal members, on one thread. Everything but the times is repeatable to the bit.

    A scene without an exact solution is compared with a run to a tight tolerance, as far as a less tight one agrees with
    it; the horizon is cut there. A scene's control is left out, for the true motion has none.

    Args:
        scene: a ``Scene``, or the name of one.
        methods: names, or what ``stepwell.method`` returns; all if None.
        steps: numbers of steps over the horizon, each 4 or more; if None, ten in each factor of ten, from steps of 24
            times the scene's down to a 3000th of it, or to two million steps.
        tolerances: of the methods that estimate their error, which get a second curve, "merson, tolerance"; if None, 1e-2 to
            1e-12, two in each factor of ten; none if empty. Such a run is looked at, and so ends a step, at ten times.
        peers: other programs, such as ``peers.scipy("DOP853")``; see ``stepwell.charts.peers``.
        progress: is called with the share that is done.

    Returns:
        A ``WorkPrecision``. Methods that cannot do the system are in its ``refused``, with the reason.

    Raises:
        ArgumentError: what was given and what was expected.
        UnsupportedError: if a peer is not installed.
    """
    if not isinstance(scene, (Scene, str)):
        raise DTypeError(f"scene: expected a Scene or its name, got {type(scene).__name__}")
    whole = find_scene(scene)
    if isinstance(methods, str):
        raise DTypeError(f"methods: expected a list of names, got the text {methods!r}")
    chosen = list(dict.fromkeys(every_method() if methods is None else map(find_method, methods)))
    numbers = None if steps is None else sorted({_checks.count("steps", n, 4) for n in steps})
    if not chosen or numbers == []:
        raise ArgumentError(f"{'steps' if chosen else 'methods'}: expected at least one, got none")
    given = TOLERANCES if tolerances is None else tolerances
    asked = sorted({_checks.number("tolerances", each, positive=True) for each in given}, reverse=True)
    others = [find_peer(each) for each in peers]
    scene, floor = chartable(whole)
    ladder = _ladder(scene) if numbers is None else numbers

    reasons = {method.name: measure.refusal(scene, method) for method in chosen}
    refused = {name: reason for name, reason in reasons.items() if reason is not None}
    able = [method for method in chosen if reasons[method.name] is None]
    paced = [method for method in able if method.error_order is not None and asked]
    batch, single = measure.step_times(scene, able), measure.step_times(scene, able, 0)
    paced_batch, paced_single = measure.tried_times(scene, paced), measure.tried_times(scene, paced, 0)
    curves: list[Curve] = []

    def done() -> None:
        if progress is not None:
            progress((len(curves) + len(refused) - len(chosen) + len(able)) / (len(able) + len(paced) + len(others)))

    for method in able:
        points = tuple(measure.assess(scene, method, scene.horizon / n, n) for n in ladder)
        edge = measure.largest_stable_step(scene, method, points)
        curves.append(Curve(method, points, edge, batch[method.name], single[method.name]))
        done()
    for method in paced:
        points = tuple(measure.assess_tolerance(scene, method, tolerance) for tolerance in asked)
        times = paced_batch[method.name], paced_single[method.name]
        curves.append(Curve(method, points, math.inf, *times, by="tolerance"))
        done()
    for peer in others:
        try:
            curves.append(measure.assess_peer(scene, peer))
        except UnsupportedError as error:
            refused[peer.name] = str(error)
        done()
    cut = scene.horizon < whole.horizon
    return WorkPrecision(scene, tuple(curves), refused, measure.members_of(scene), measure.REPEATS, _core.isa(), floor, cut)


def _ladder(scene: Scene) -> list[int]:
    """Numbers of steps, evenly spread on a logarithmic scale."""
    most = MOST * min(1.0, LIGHT / max(1, scene.y.size)) ** 2
    few, many = scene.horizon / (LARGEST * scene.dt), min(most, scene.horizon / (SMALLEST * scene.dt))
    few = max(4.0, few)
    gaps = round(RUNGS * np.log10(many / few))
    rungs = few * (many / few) ** (np.arange(-BELOW, gaps + 1) / gaps)
    return sorted({round(n) for n in rungs.tolist() if n >= 4.0})
