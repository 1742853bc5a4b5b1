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


def with_truth(scene: Scene) -> Scene:
    """The scene with an ``exact`` solution: its own, or else a tight run, known until a less tight one leaves it.

    Args:
        scene: any.

    Returns:
        A scene whose ``exact`` and ``until`` are set. A scene that has an exact solution is returned as it is. The true motion is
        that without a control.
    """
    if scene.exact is not None:
        return scene

    def run(times: Array, tolerance: float) -> tuple[Array, Array]:
        asked, place = np.unique(times, return_inverse=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ToleranceWarning)
            found = integrate(
                scene.system, "fehlberg_5", v=scene.v, y=scene.y, tolerance=tolerance, at=asked, max_steps=20_000_000
            )
        return found.v[place.reshape(-1)], found.y[place.reshape(-1)]

    times = np.linspace(0.0, scene.horizon, SAMPLES + 1)
    true, other = run(times, TIGHT), run(times, CHECK)
    known = np.ones(len(times), dtype=bool)
    for a, b in zip(true, other, strict=True):
        axes = tuple(range(1, a.ndim))
        with np.errstate(all="ignore"):
            apart, length = (np.sqrt((x * x).sum(axis=axes)) for x in (a - b, a))
            known &= apart <= AGREES * np.nanmax(length)
    first = len(times) if known.all() else int(np.argmin(known))
    return replace(scene, exact=lambda t: run(np.asarray(t), TIGHT), until=float(times[max(first - 1, 0)]))
