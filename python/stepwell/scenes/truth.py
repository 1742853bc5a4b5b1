"""The reference solution of a scene without a formula: a run to a tight tolerance, as long as a less tight one agrees with it."""

from __future__ import annotations

import math
import warnings
from bisect import bisect_right
from dataclasses import replace
from typing import Any

import numpy as np

from .._checks import Array
from ..errors import AccuracyWarning, ArgumentError, ToleranceWarning
from ..integration import integrate
from ..result import Run
from .base import Scene

#: The method of the reference solution, its tolerance, and how many times that the run which checks it has. Where the reference
#: stops early, larger tolerances are tried: from rest no step is short enough for a tight one to meet the onset of a force.
METHOD, TIGHT_TOLERANCES, CHECK_RATIO = "dop853", (1e-14, 1e-12, 1e-10), 10.0

#: The two agree where their difference, relative to the blocks' largest lengths, is below this: a thousandth of the least error
#: that a chart of such a scene shows. Except for rounding, the reference is ten times as accurate as the run that checks it.
MAX_DIFFERENCE = 1e-8

#: Steps are held short, so that what acts for a moment is not stepped over: to a power of two of at most this share of the
#: horizon, so that a horizon that is a little longer leaves the run as it is, and of the check to this part of it. A step looks
#: at a dozen times within it, so both runs see what lasts for two steps of the reference. The two lengths are in no simple ratio,
#: so the runs do not check the same times: what only one of them sees is where they disagree, which ends what is known.
LONGEST_STEP, PART_OF_CHECK = 1e-3, 1.0 / 1.618

#: Times at which they are compared, and from how many of them the reference can be continued.
SAMPLES, RESTARTS = 400, 20

#: The most steps of such a run, including rejected ones. Beyond the time that they reach, the solution is unknown.
MAX_STEPS = 2_000_000


Mask = np.ndarray[Any, np.dtype[np.bool_]]


class Tight:
    """The run of a scene to a tight tolerance, as a function of time; it does not depend on the times of earlier calls.

    Args:
        scene: what moves; its control is left out.
        tolerance: of the run.
        part: its longest step, as a part of that of the reference.
    """

    def __init__(self, scene: Scene, tolerance: float = TIGHT_TOLERANCES[0], part: float = 1.0) -> None:
        self.scene, self.tolerance, self.part = replace(scene, control=None), tolerance, part
        longest = part * 2.0 ** math.floor(math.log2(LONGEST_STEP * scene.horizon))
        options = scene.adaptive_options | {"max_step": min(longest, scene.max_step or math.inf)}
        start = self._run(np.zeros(1), {"v": scene.v, "y": scene.y, "tolerance": tolerance, **options}).resume
        #: Arguments to continue the run, each with the time from which it continues.
        self._on: list[tuple[float, dict[str, Any]]] = [(0.0, start)]

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Both blocks at these times."""
        asked, place = np.unique(np.asarray(t, dtype=np.float64), return_inverse=True)
        since = bisect_right(self._on, float(asked[0]), key=lambda on: on[0]) - 1
        run = self._run(asked, self._on[max(0, since)][1])
        return run.v[place.reshape(-1)], run.y[place.reshape(-1)]

    def followed(self, times: Array) -> tuple[Array, Array]:
        """The states at these times, ascending; NaN from where it stopped. At some of them the run can be continued later."""
        runs = []
        for part in np.array_split(times, RESTARTS):
            runs.append(run := self._run(part, self._on[-1][1]))
            if run.status:
                break
            self._on.append((float(part[-1]), run.resume))
        missing = len(times) - sum(len(run.t) for run in runs)
        blocks = (np.concatenate([getattr(run, name) for run in runs]) for name in "vy")
        v, y = (np.concatenate([block, np.full((missing, *block.shape[1:]), np.nan)]) for block in blocks)
        return v, y

    def _run(self, at: Array, on: dict[str, Any]) -> Run:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ToleranceWarning)
            warnings.simplefilter("ignore", AccuracyWarning)
            return integrate(self.scene.system, METHOD, at=at, max_steps=MAX_STEPS, **on)

    def __reduce__(self) -> tuple[Any, ...]:
        return Tight, self._arguments

    @property
    def _arguments(self) -> tuple[Scene, float, float]:
        return self.scene, self.tolerance, self.part

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tight) and self._arguments == other._arguments

    def __hash__(self) -> int:
        return hash(self._arguments)


def with_truth(scene: Scene, agrees: float = MAX_DIFFERENCE) -> Scene:
    """The scene with an ``exact`` solution: its own, or else a tight run, known as long as a less tight one agrees.

    Args:
        scene: any.
        agrees: the largest difference of the two runs up to which the motion counts as known, in the blocks' largest lengths so
            far.

    Returns:
        A scene whose ``exact`` and ``until`` are set. A scene that has an exact solution is returned as it is. The true motion is
        that without a control.

    Raises:
        ArgumentError: if it has no exact solution, and adaptive steps do not go with its system.
    """
    if scene.exact is not None:
        return scene
    if scene.system.contacts or scene.system.rubbing is not None:
        what = "surfaces" if scene.system.contacts else "friction that sticks"
        raise ArgumentError(
            f"exact: needed by {scene.name}, whose system has {what}, got None: the reference solution of other scenes is a run "
            f"with adaptive steps, which do not go with {what}; give the solution as a function of times"
        )
    times = np.linspace(0.0, scene.horizon, SAMPLES + 1)
    exact, until = None, -1.0
    for tolerance in TIGHT_TOLERANCES:
        tight = Tight(scene, tolerance)
        states = tight.followed(times)
        known = _agreeing(states, Tight(scene, CHECK_RATIO * tolerance, PART_OF_CHECK).followed(times), agrees)
        first = len(times) if known.all() else int(np.argmin(known))
        if (last := float(times[max(first - 1, 0)])) > until:
            exact, until = tight, last
        if np.isfinite(states[1][-1]).all():
            break
    return replace(scene, exact=exact, until=until)


def _agreeing(run: tuple[Array, Array], check: tuple[Array, Array], agrees: float) -> Mask:
    """At which times the states of two runs differ by no more than this share of the blocks' largest lengths up to then."""
    known = np.ones(len(run[1]), dtype=bool)
    for a, b in zip(run, check, strict=True):
        axes = tuple(range(1, a.ndim))
        with np.errstate(all="ignore"):
            apart, length = (np.sqrt((x * x).sum(axis=axes)) for x in (a - b, a))
            # Up to the next time, for what sets in at one of them has no length there but roundings of that time.
            longest = np.fmax.accumulate(np.append(length, length[-1]))[1:]
            known &= apart <= agrees * longest
    return known
