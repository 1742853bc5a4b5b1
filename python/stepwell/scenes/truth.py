"""The true motion of a scene that has no formula: a run to a tight tolerance, as far as a less tight one agrees with it."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from .._checks import Array
from ..errors import ToleranceWarning
from ..integrate import integrate
from .base import Scene

#: The tolerance of the run that counts as true, and that of the one that checks it.
TIGHT, CHECK = 1e-13, 1e-12

#: The two agree where their distance is below this, in the blocks' largest lengths: a thousandth of the least error that a chart
#: of such a scene asks about.
AGREES = 1e-8

#: Times at which they are compared.
SAMPLES = 200


def with_truth(scene: Scene, agrees: float = AGREES) -> Scene:
    """The scene with an ``exact`` solution: its own, or else a tight run, known until a less tight one leaves it.

    Args:
        scene: any.
        agrees: how near to each other the two runs are where the motion counts as known, in the blocks' largest lengths.

    Returns:
        A scene whose ``exact`` and ``until`` are set. A scene that has an exact solution is returned as it is. The true motion is
        that without a control.
    """
    if scene.exact is not None:
        return scene

    def run(begin: float, v: Array, y: Array, times: Array, tolerance: float) -> tuple[Array, Array]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ToleranceWarning)
            found = integrate(scene.system, "fehlberg_5", v=v, y=y, t0=begin, tolerance=tolerance, at=times, max_steps=20_000_000)
        return found.v, found.y

    times = np.linspace(0.0, scene.horizon, SAMPLES + 1)
    true, other = (run(0.0, scene.v, scene.y, times, tolerance) for tolerance in (TIGHT, CHECK))
    known = np.ones(len(times), dtype=bool)
    for a, b in zip(true, other, strict=True):
        axes = tuple(range(1, a.ndim))
        with np.errstate(all="ignore"):
            apart, length = (np.sqrt((x * x).sum(axis=axes)) for x in (a - b, a))
            known &= apart <= agrees * np.nanmax(length)
    first = len(times) if known.all() else int(np.argmin(known))

    def exact(t: Array) -> tuple[Array, Array]:
        """From the sample before each time, so that the state at a time does not depend on what else is asked for."""
        asked, place = np.unique(np.asarray(t, dtype=np.float64), return_inverse=True)
        after = np.clip(np.searchsorted(times, asked, "right") - 1, 0, SAMPLES - 1)
        found = tuple(np.empty((len(asked), *block.shape[1:])) for block in true)
        for i in np.unique(after).tolist():
            here = after == i
            for whole, part in zip(found, run(times[i], true[0][i], true[1][i], asked[here], TIGHT), strict=True):
                whole[here] = part
        return found[0][place.reshape(-1)], found[1][place.reshape(-1)]

    return replace(scene, exact=exact, until=float(times[max(first - 1, 0)]))
