"""The cost of a step on this machine, measured quickly: the shortest time of some repeats, since other load only adds to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ...model.methods import Method
from ...scenes import Scene
from ..measuring.timing import Batch, Effort, Timed, in_turns

#: Timings that rank methods need not be exact, but quick.
EFFORT = Effort(members=512, numbers=16_384, fewest=1, seconds=0.0005, repeats=5, slow=0.25)

#: Two timings that differ by less than the first fraction count as equal even if repeats agree better: the place of code and
#: arrays in memory makes such differences. The noise of repeats counts up to the second number, above which it says nothing.
MIN_COST_NOISE, MAX_COST_NOISE = 0.05, 0.25


class Times(dict[str, float]):
    """Measured nanoseconds by method.

    Attributes:
        noise: the relative difference of two times that means nothing, from the spread of the repeats.
    """

    noise: float = 0.0


def step_times(scene: Scene, methods: Sequence[Method], singles: Sequence[Method] = ()) -> Times:
    """Nanoseconds per step of one member of a batch, on one thread, by the method's name; all take turns.

    ``singles`` are the methods in float32, whose times have the names of ``single_name``.
    """
    batch = Batch(scene, EFFORT.members_of(scene))
    runs = {method.name: batch.steps(method, control=scene.control) for method in methods}
    runs |= {single_name(method): batch.steps(method, control=scene.control, dtype="float32") for method in singles}
    return _least(batch, runs)


def tried_times(scene: Scene, methods: Sequence[Method]) -> Times:
    """Nanoseconds per attempted step in a run with a tolerance, including rejected ones; otherwise as ``step_times``."""
    batch = Batch(scene, EFFORT.members_of(scene))
    return _least(batch, {method.name: batch.attempts(method) for method in methods})


def single_name(method: Method) -> str:
    """The name of a method in float32: ``"rk4, float32"``."""
    return f"{method.name}, float32"


def _least(batch: Batch, runs: Mapping[str, Timed]) -> Times:
    repeats = in_turns(runs, EFFORT, batch.members)
    times = Times({name: min(each) for name, each in repeats.items()})
    times.noise = cost_noise(repeats.values())
    return times


def cost_noise(repeats: Iterable[Sequence[float]]) -> float:
    """The relative error of the shortest of some repeats: the distance to the second shortest, of the worst method."""
    repeats = list(repeats)
    if not repeats:
        return 0.0
    spreads = [sorted(each)[1] / min(each) - 1.0 for each in repeats if len(each) > 1]
    return min(MAX_COST_NOISE, max(MIN_COST_NOISE, *spreads, 0.0))
