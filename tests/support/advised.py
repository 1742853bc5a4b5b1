"""What the tests of advice have in common: brute force, and what must hold of advice beside it."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.scenes import Scene
from stepwell.studies.advice.costs import single_name

from benches.advice import Brute
from support import families

#: What is advised may cost this many times the cheapest that brute force finds.
WORTH = 1.5

#: Brute force tries numbers of steps this far apart, in the long run half as far; no rung of the search's own ladder of 2^(1/8)
#: is meant.
RATIO = 1.0777 if families.LONG else 1.0777**2


#: A built-in scene is made once, for some take long to know their true motion.
scene_of = functools.cache(sw.scenes.scene)


@functools.cache
def brute_of(name: str, frames: int | None = None) -> Brute:
    """All that can be tried on a built-in scene, with any steps or in so many frames."""
    scene = scene_of(name)
    return Brute(scene, None if frames is None else scene.horizon / frames, RATIO)


#: What was measured so far, by what was measured.
MEASURED: dict[tuple[str, ...], dict[str, float]] = {}


@pytest.fixture(autouse=True)
def _times_are_measured_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a step takes is measured once for each system and its methods: that is up to a second, and most tests only show it."""

    def once(name: str) -> Any:
        measure = getattr(sw.advice, name)

        def times(scene: Scene, methods: Any, singles: Any = ()) -> dict[str, float]:
            key = (name, repr(scene.system), repr(scene.control), *(m.name for m in methods), "", *(m.name for m in singles))
            if key not in MEASURED:
                MEASURED[key] = measure(scene, methods, singles) if singles else measure(scene, methods)
            return MEASURED[key]

        return times

    for name in ("step_times", "tried_times"):
        monkeypatch.setattr(f"stepwell.advice.{name}", once(name))


def equal_times(scene: Scene, methods: Any, singles: Any = ()) -> dict[str, float]:
    """A nanosecond each, in float32 as well."""
    return {m.name: 1.0 for m in methods} | {single_name(m): 1.0 for m in singles}


@pytest.fixture
def unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every step takes a nanosecond: for tests that rank by evaluations and look at no time."""
    for name in ("step_times", "tried_times"):
        monkeypatch.setattr(f"stepwell.advice.{name}", equal_times)


def evaluations_of(row: Any, system: sw.System) -> int:
    """Function evaluations of a step, or of an attempt at an adaptive one."""
    if row.tolerance is None:
        return sw.stability.operations(row.method, system).rate_evaluations
    return int(row.method.attempt_evaluations)


def assert_true(brute: Brute, advice: sw.advice.Advice) -> None:
    """Every ranked row, run in full, is as wrong as it says and no more than allowed.

    With a tolerance at whatever times it is asked, for it is one run. Brute force has the true motion from a table that is right
    to 1e-9, and so has the search.
    """
    frames = brute.frames
    for row in advice.ranked:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.AccuracyWarning)  # of bodies that meet: how wrong the run is, is what is compared
            error = float(advice.scene.state_error(advice.run(row)).max())
        assert error <= row.error * (1 + 1e-6) + 2e-9
        assert row.error <= advice.tolerance
        evaluations = evaluations_of(row, advice.scene.system)
        assert row.evaluations_per_time == evaluations / row.dt
        if row.tolerance is not None:
            assert brute.between(row.method.name, row.tolerance) <= advice.tolerance + 2e-9
        else:
            assert brute.advised(row) <= row.error * (1 + 1e-6) + 2e-9
            assert row.dt == (advice.scene.horizon / row.steps if frames is None else brute.frame / (row.substeps or 0))
        if frames is not None:
            assert row.evaluations_per_frame == evaluations * row.steps / frames
    costs = [evaluations_of(row, advice.scene.system) * row.steps for row in advice.ranked]
    assert costs == sorted(costs)


def assert_cheap(brute: Brute, advice: sw.advice.Advice) -> None:
    """Nothing that brute force finds costs less than two thirds, but steps that end where the system jumps, by luck.

    Their error is nearly nothing, and that of one step more or one step fewer a hundred times what is allowed. Nor does a
    tolerance of more than a tenth count, which rejects no step: the decay of a stiff system is right whatever the steps are.
    """
    cheaper = brute.best(advice.tolerance, brute.cost(advice) / WORTH)
    if cheaper is not None and cheaper.tolerance is not None and cheaper.tolerance > 0.1:
        return
    if cheaper is not None and cheaper.tolerance is None:
        beside = [brute.error(cheaper.method, brute.end / n, n) for n in (cheaper.steps - 1, cheaper.steps + 1)]
        # An implicit step stays bounded; it may be so long that it ends, turns too late, where the truth is by chance.
        luck = 10 if sw.method(cheaper.method).is_implicit else 100
        assert min(beside) > luck * advice.tolerance
    else:
        assert cheaper is None


def tried(cases: Mapping[str, Sequence[float]], some: Collection[str], *more: Any) -> list[Any]:
    """A scene and a tolerance: by default each of some scenes once, with one tolerance after the other."""
    turns = {name: of[i % len(of)] for i, (name, of) in enumerate((name, cases[name]) for name in some)}
    every = [(name, each, *more) for name, of in cases.items() for each in of]
    return families.family(every, lambda name, tolerance, *_: turns.get(name) == tolerance)


def pendulum(v: float, y: float, horizon: float) -> Scene:
    return Scene(sw.Pendulum(1.0), v=v, y=y, horizon=horizon)


def linear() -> Scene:
    """Three states, all in one block: one dies at once, two turn."""
    a = np.array([[-1.0, 5.0, 0.0], [-5.0, -1.0, 0.0], [0.0, 0.0, -20.0]])

    def exact(t: Any) -> Any:
        c, s, slow = np.cos(5.0 * t), np.sin(5.0 * t), np.exp(-t)
        return np.zeros((len(t), 0)), np.stack([slow * c, -slow * s, np.exp(-20.0 * t)], axis=-1)

    return Scene(sw.LinearSystem(a, velocities=0), v=np.zeros(0), y=[1.0, 0.0, 1.0], horizon=5.0, exact=exact)
