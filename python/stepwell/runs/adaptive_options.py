"""Checks of the options of runs with adaptive steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import checks
from ..base.arrays import Array, Shape
from ..base.reprs import of_member
from ..errors import ArgumentError, ShapeError, UnsupportedError
from ..model.compatibility import goes_with_series, not_of_a_step
from ..model.methods import Method
from ..model.methods import methods as every_method
from ..model.systems import System
from ..reference.acceptance import Acceptance
from . import continuation, engine
from .options import Options
from .result import AdaptiveState

if TYPE_CHECKING:
    from .continuation import Continuation


def check_times(has_tolerance: bool, at: Any) -> None:
    """Raise if ``tolerance`` or ``at`` is missing."""
    if at is None:
        raise ArgumentError("at: tolerance= needs the times at which to save states, too, such as at=[t1, t2]")
    if not has_tolerance:
        raise ArgumentError("tolerance: at= needs the error that a step may have, too, such as tolerance=1e-6")


def check_estimates(system: System, method: Method, control: Any, options: Options, before: Continuation | None) -> None:
    """Raise if the method cannot estimate the errors of its steps with this system, control and these options."""
    if method.error_order is None:
        able = ", ".join(m.name for m in every_method() if m.error_order is not None)
        raise UnsupportedError(f"tolerance: {method.name} does not estimate its error, so it cannot choose its steps; use {able}")
    if system.has_stick_friction:
        raise UnsupportedError(
            f"tolerance: {system!r} has friction that sticks; what it does depends on the step, so the error of a step cannot be "
            f"estimated; use dt= and steps="
        )
    if any(surface.way != "spring" for surface in system.contacts):
        raise UnsupportedError(
            f"tolerance: the estimated error of a step does not include a bounce within it, got {system!r}; use "
            f'dt= and steps=, or surfaces with way="spring"'
        )
    if options.max_step is None and any(getattr(surface, "inside", True) is False for surface in system.contacts):
        raise UnsupportedError(
            f"tolerance: a step may pass a ball between its stages, which then do not feel it, got {system!r}; give max_step=, "
            f"shorter than a point takes past the ball"
        )
    if method.has_series:
        goes_with_series(system, control)
        if options.positive is not None:
            raise UnsupportedError(
                f"positive: {method.name} rejects no step for the sign of a component; use a method that does, such as dop853"
            )
    not_of_a_step(system.keeper if control is None else control)
    if options.tolerance is not None and before is not None:
        raise ArgumentError("tolerance: the run that goes on has its own")


def is_backward(times: Array, t0: Array) -> bool:
    """True if the last times are before the start, the same for all members."""
    if times.ndim == 1 and not t0.ndim and times[-1] > t0:
        return False  # the most frequent case
    ahead = times[-1] - t0
    if (ahead > 0.0).any() and (ahead < 0.0).any():
        raise ArgumentError("at: expected all members to go forward in time, or all backward, got some of each")
    return bool((ahead < 0.0).any()) or (not (ahead > 0.0).any() and len(times) > 1 and bool((times[1] < times[0]).any()))


def times_of_run(t0: Array, times: Array, batch: Shape) -> tuple[Array, Array]:
    """Times of the start and of saved states for the run: copies, broadcast to the batch if members have their own."""
    if t0.ndim:
        t0 = checks.spread(t0, (), batch)
    if times.ndim > 1:
        times = checks.spread(times, times.shape[:1], batch)
    return t0.copy(), times.copy()


def check_ascending(times: Array, since: Array, sign: float, goes_on: bool) -> None:
    """Raise unless times go on from the times of the members, in the direction of the run."""
    if times.shape == (1,) and since.ndim == 0 and times[0] >= since:
        return  # the most frequent case
    ascends = (times[0] >= since) & (np.diff(times, axis=0) > 0.0).all(axis=0)
    if ascends.all():
        return
    index = tuple(np.argwhere(~ascends)[0].tolist())
    shown = (sign * (checks.member(times, index) if times.ndim > 1 else times)).tolist()
    start = sign * np.broadcast_to(since, ascends.shape)[index]
    word = "descend" if sign < 0.0 else "ascend"
    begin = f"the last time of the run that goes on, {start:g}, on" if goes_on else f"t0 = {start:g} on"
    raise ArgumentError(f"at: expected times that {word} from {begin}, got {shown[:5]}{'…' * (len(shown) > 5)}{of_member(index)}")


def jump_times(system: System, jumps: Any, t0: Array, times: Array) -> Array | None:
    """The times that no step crosses, ascending along the first axis: of the user, of inputs and of the equations."""
    parts = []
    has_inputs, reads_time = bool(system.all_inputs()), system.reads_time
    if not has_inputs and not reads_time and jumps is None:
        return None
    ahead = bool((times[-1] - t0).max() >= 0.0)
    if has_inputs:
        # Those after the last time count, too: the step that contains it goes on from there when the run is continued.
        parts.append(system.jumps(*((float(t0.min()), np.inf) if ahead else (-np.inf, float(t0.max())))))
    if reads_time:
        begin, end = min(float(times.min()), float(t0.min())), max(float(times.max()), float(t0.max()))
        parts.append(system.switching_times(begin, end))
    if jumps is not None:
        parts.append(jumps)
    if not any(len(part) for part in parts):
        return None
    together = checks.concatenated(parts)
    together[np.isnan(together)] = np.inf if ahead else -np.inf
    return np.unique(together) if together.ndim == 1 else np.sort(together, axis=0)


def pace_of(before: Continuation, method: Method, groups: int, low: int) -> Array:
    """The step-size controllers of the run that goes on, with so many numbers that a series keeps."""
    continuation.goes_on_alike(before, method)
    assert isinstance(before.carry, AdaptiveState)
    pace, expected = before.carry.pace, [engine.PACE_NUMBERS + each * groups for each in (engine.SCALES, engine.SCALES + 2)]
    if len(pace) - low not in expected:
        raise ShapeError(
            "resume: expected a run of a system whose errors are relative to as many lengths; start anew from its last state: "
            "v=run.v[-1], y=run.y[-1], t0=run.t[-1]"
        )
    return pace


def relative_tolerances(pace: Any, acceptance: Acceptance, groups: int, low: int) -> Array:
    """The relative tolerances of a run that goes on."""
    if not acceptance.own:
        return np.asarray(pace[engine.RELATIVE])
    return np.asarray(engine.own_tolerances(pace, groups, low)[:groups])
