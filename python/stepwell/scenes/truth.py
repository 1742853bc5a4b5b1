"""The reference solution of a scene without a formula: a run to a tight tolerance, valid while a check run agrees with it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..errors import ArgumentError, UnsupportedError
from ..runs.execution import quietly
from ..runs.result import Run, Status
from .base import Scene

#: The tolerance of the reference solution, and that of the check run. A part that stops early is repeated with these multiples of
#: its tolerance: from rest, no step is short enough to meet a tight one at the onset of a force.
TIGHT_TOLERANCE, CHECK_TOLERANCE, LOOSER = 1e-14, 1e-13, (1e2, 1e4)

#: The method of the reference solution, and that where the equations are stiff: where of two runs to a loose tolerance the first
#: takes MANY attempts, and more than STIFF times those of the second. To a tight tolerance the second, of a lower order, takes
#: some STIFF times as many; the first takes as many to any tolerance where stability holds down its steps.
METHOD, METHOD_IF_STIFF, LOOSE_TOLERANCE, MANY, STIFF = "dop853", "rodas5p", 1e-6, 5_000, 10.0

#: The most numbers of a state for which the second is tried: it solves equations in each step.
MOST_STIFF_NUMBERS = 256

#: The two runs agree where their difference, relative to the blocks' largest lengths, is below this: a thousandth of the least
#: error that a chart of such a scene shows. Except for rounding, the reference is ten times as accurate as the check run.
MAX_DIFFERENCE = 1e-8

#: The longest step of the reference is a power of two of at most this share of the horizon, so that no short pulse is missed, and
#: that a slightly longer horizon does not change the run; that of the check run is this part of it. A step evaluates rates at a
#: dozen times, so both runs see a pulse that lasts for two steps of the reference. The two lengths are in no simple ratio, so the
#: runs evaluate different times: where only one sees a shorter pulse, they disagree, and the solution is unknown from there on.
LONGEST_STEP, PART_OF_CHECK = 1e-3, 1.0 / 1.618

#: The number of times at which the runs are compared, and of those from which the reference can be continued.
SAMPLES, RESTARTS = 400, 20

#: The most steps of such a run, including rejected ones. After the time that they reach, the solution is unknown.
MAX_STEPS = 2_000_000


Mask = np.ndarray[Any, np.dtype[np.bool_]]


class Tight:
    """The run of a scene to a tight tolerance, as a function of time; it does not depend on the times of earlier calls.

    The scene's control is left out; the longest step is this ``part`` of that of the reference.
    """

    def __init__(self, scene: Scene, tolerance: float = TIGHT_TOLERANCE, part: float = 1.0, method: str = METHOD) -> None:
        self.scene, self.tolerance, self.part, self.method = replace(scene, control=None), tolerance, part, method
        longest = part * 2.0 ** math.floor(math.log2(LONGEST_STEP * scene.horizon))
        self._options = scene.adaptive_options | {"max_step": min(longest, scene.max_step or math.inf)}
        #: Places from which a run can continue: the time, the state, and the arguments of the continuation.
        self._places: list[tuple[float, tuple[Array, Array], dict[str, Any]]] = []
        self._place(0.0, (scene.v, scene.y), None)

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Both blocks at these times."""
        times, place = np.unique(np.asarray(t, dtype=np.float64), return_inverse=True)
        since = np.maximum(np.searchsorted([begin for begin, _, _ in self._places], times, side="right") - 1, 0)
        runs = [self._part(times[since == i], i)[0] for i in np.unique(since).tolist()]
        v, y = (np.concatenate([getattr(run, name) for run in runs]) for name in "vy")
        return v[place.reshape(-1)], y[place.reshape(-1)]

    def followed(self, times: Array) -> tuple[Array, Array]:
        """The states at ascending times; NaN after the run stopped. Later calls continue from some of these."""
        runs = []
        for part in np.array_split(times, RESTARTS):
            run, tight = self._part(part, -1)
            runs.append(run)
            if run.status:
                break
            self._place(float(part[-1]), (run.v[-1], run.y[-1]), {"resume": run} if tight else None)
        missing = len(times) - sum(len(run.t) for run in runs)
        blocks = (np.concatenate([getattr(run, name) for run in runs]) for name in "vy")
        v, y = (np.concatenate([block, np.full((missing, *block.shape[1:]), np.nan)]) for block in blocks)
        return v, y

    def _place(self, time: float, state: tuple[Array, Array], on: dict[str, Any] | None) -> None:
        """Add a place from which to continue: by resuming the run, or from the state alone."""
        if on is None:
            on = {"resume": self._run(np.array([time]), self._fresh(time, state, self.tolerance))}
        self._places.append((time, state, on))

    def _fresh(self, time: float, state: tuple[Array, Array], tolerance: float) -> dict[str, Any]:
        return {"v": state[0], "y": state[1], "t0": time, "tolerance": tolerance} | self._options

    def _part(self, at: Array, i: int) -> tuple[Run, bool]:
        """The run from a place to these times, and whether it met the tolerance."""
        time, state, on = self._places[i]
        run = self._run(at, on)
        if not run.status:
            return run, True
        for ratio in LOOSER:
            run = self._run(at, self._fresh(time, state, ratio * self.tolerance))
            if not run.status:
                break
        return run, False

    def _run(self, at: Array, on: dict[str, Any]) -> Run:
        return quietly(self.scene.system, self.method, at=at, max_steps=MAX_STEPS, **on)

    def __reduce__(self) -> tuple[Any, ...]:
        return Tight, self._arguments

    @property
    def _arguments(self) -> tuple[Scene, float, float, str]:
        return self.scene, self.tolerance, self.part, self.method

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tight) and self._arguments == other._arguments

    def __hash__(self) -> int:
        return hash(self._arguments)


def with_truth(scene: Scene, agrees: float = MAX_DIFFERENCE) -> Scene:
    """The scene with an ``exact`` solution: its own, or else a tight run, valid while a check run agrees.

    Args:
        scene: a scene.
        agrees: the largest difference of the two runs with which the motion counts as known, relative to the blocks' largest
            lengths so far.

    Returns:
        A scene whose ``exact`` and ``until`` are set. A scene that has an exact solution is returned as it is. The solution is
        that without a control.

    Raises:
        ArgumentError: if the scene has no exact solution, and its system does not work with adaptive steps.
    """
    if scene.exact is not None:
        return scene
    if scene.system.contacts or scene.system.has_stick_friction:
        what = "surfaces" if scene.system.contacts else "friction that sticks"
        raise ArgumentError(
            f"exact: needed by {scene.name}, whose system has {what}, got None: the reference solution of other scenes is a run "
            f"with adaptive steps, which do not work with {what}; give the solution as a function of times"
        )
    times = np.linspace(0.0, scene.horizon, SAMPLES + 1)
    method = method_for(scene)
    tight = Tight(scene, method=method)
    states = tight.followed(times)
    known = _agreeing(scene, states, Tight(scene, CHECK_TOLERANCE, PART_OF_CHECK, method).followed(times), agrees)
    first = len(times) if known.all() else int(np.argmin(known))
    return replace(scene, exact=tight, until=float(times[max(first - 1, 0)]))


def method_for(scene: Scene) -> str:
    """The method of the reference solution: an implicit one where an explicit one would take far more steps."""
    if scene.v.size + scene.y.size > MOST_STIFF_NUMBERS or scene.system.contacts or scene.system.has_stick_friction:
        return METHOD
    explicit = _attempts(scene, METHOD, math.inf)
    if explicit < MANY or _attempts(scene, METHOD_IF_STIFF, explicit / STIFF) * STIFF > explicit:
        return METHOD
    return METHOD_IF_STIFF


def _attempts(scene: Scene, method: str, most: float) -> float:
    """How many attempts a run to a loose tolerance takes, extrapolated after ``MANY``; infinite if it takes ``most`` or stops."""
    limit = int(min(MANY, most))
    motion: dict[str, Any] = {"v": scene.v, "y": scene.y, "tolerance": LOOSE_TOLERANCE, "at": [scene.horizon]}
    try:
        run = quietly(scene.system, method, max_steps=limit, **motion, **scene.adaptive_options)
    except UnsupportedError:
        return math.inf
    assert run.paces is not None
    attempts = float(run.paces.accepted + run.paces.rejected)
    if not run.status:
        return attempts
    if limit < MANY or run.status != Status.BUDGET or not float(run.paces.t) > 0.0:
        return math.inf
    return attempts * scene.horizon / float(run.paces.t)


def _agreeing(scene: Scene, run: tuple[Array, Array], check: tuple[Array, Array], agrees: float) -> Mask:
    """The times at which two runs differ by at most this share of the largest lengths so far, of blocks or of components."""
    known = np.ones(len(run[1]), dtype=bool)
    with np.errstate(all="ignore"):
        differences = scene.lengths((run[0] - check[0], run[1] - check[1]))
    for apart, length in zip(differences, scene.lengths(run), strict=True):
        with np.errstate(all="ignore"):
            # The largest length up to the next time: a motion that sets in at a time has only the length of roundings there.
            longest = np.fmax.accumulate(np.append(length, length[-1]))[1:]
            known &= apart <= agrees * longest
    return known
