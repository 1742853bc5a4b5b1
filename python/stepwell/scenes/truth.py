"""The reference solution of a scene without a formula: a run to a tight tolerance, as long as a less tight one agrees with it."""

from __future__ import annotations

import warnings
from bisect import bisect_right
from dataclasses import replace
from typing import Any

import numpy as np

from .._checks import Array
from ..errors import AccuracyWarning, ToleranceWarning
from ..integration import integrate
from ..result import Run
from .base import Scene

#: The method of the reference solution, its tolerance, and the tolerance of the run that checks it.
METHOD, TIGHT_TOLERANCE, CHECK_TOLERANCE = "dop853", 1e-14, 1e-13

#: The two agree where their difference, relative to the blocks' largest lengths, is below this: a thousandth of the least error
#: that a chart of such a scene shows. Except for rounding, the reference is ten times as accurate as the run that checks it.
MAX_DIFFERENCE = 1e-8

#: Times at which they are compared, and from how many of them the reference can be continued.
SAMPLES, RESTARTS = 400, 20

#: The most steps of such a run, including rejected ones. Beyond the time that they reach, the solution is unknown.
MAX_STEPS = 2_000_000


class Tight:
    """The run of a scene to a tight tolerance, as a function of time; it does not depend on the times of earlier calls."""

    def __init__(self, scene: Scene, tolerance: float = TIGHT_TOLERANCE) -> None:
        self.scene, self.tolerance = replace(scene, control=None), tolerance
        #: Arguments to continue the run, each with the time from which it continues.
        self._on: list[tuple[float, dict[str, Any]]] = [(0.0, {"v": scene.v, "y": scene.y, "tolerance": tolerance})]

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
        return Tight, (self.scene, self.tolerance)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tight) and (self.scene, self.tolerance) == (other.scene, other.tolerance)

    def __hash__(self) -> int:
        return hash((self.scene, self.tolerance))


def with_truth(scene: Scene, agrees: float = MAX_DIFFERENCE) -> Scene:
    """The scene with an ``exact`` solution: its own, or else a tight run, known as long as a less tight one agrees.

    Args:
        scene: any.
        agrees: the largest difference of the two runs up to which the motion counts as known, in the blocks' largest lengths so
            far.

    Returns:
        A scene whose ``exact`` and ``until`` are set. A scene that has an exact solution is returned as it is. The true motion is
        that without a control.
    """
    if scene.exact is not None:
        return scene
    times = np.linspace(0.0, scene.horizon, SAMPLES + 1)
    tight = Tight(scene)
    known = np.ones(len(times), dtype=bool)
    for a, b in zip(tight.followed(times), Tight(scene, CHECK_TOLERANCE).followed(times), strict=True):
        axes = tuple(range(1, a.ndim))
        with np.errstate(all="ignore"):
            apart, length = (np.sqrt((x * x).sum(axis=axes)) for x in (a - b, a))
            known &= apart <= agrees * np.maximum.accumulate(length)
    first = len(times) if known.all() else int(np.argmin(known))
    return replace(scene, exact=tight, until=float(times[max(first - 1, 0)]))
