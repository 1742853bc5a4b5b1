"""Measurements of one method on one scene: its errors, and whether it is stable."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...errors import ArgumentError, UnsupportedError
from ...model.compatibility import fits_together
from ...model.methods import Method
from ...runs import engine
from ...runs.execution import quietly
from ...scenes import Scene
from ...scenes.base import quiet_run
from .data import Curve, Point, Timing
from .peers import Peer, Solved
from .timing import MOST_TRIED

#: Errors are measured in at least this many states of a run, or in all if it has fewer.
SAMPLES = 1000

#: The amplitude of a run grows if the largest of its second half is above the largest of its first half by this factor,
#: and above the exact solution's. A large but bounded amplitude, as near a stability limit, is as large in both halves.
MIN_GROWTH = 1.1

#: Number of output times of a run with a tolerance, evenly spread, the last at the horizon. Each costs an extra step,
#: so they are few; the errors of the run are those at these times.
SAVED_TIMES = 10

#: Extra steps for a saved state within a step: one that ends at it, and the step that passes it once more.
EXTRA_STEPS = 2

#: The search for the phase error begins at the best of COARSE_SHIFTS shifts in time, evenly spaced over a period, if the error of
#: the state at the end is above COARSE_SEARCH_ABOVE.
COARSE_SHIFTS, COARSE_SEARCH_ABOVE = 64, 0.05

#: How often a peer is run at each of its settings; the median counts.
PEER_REPEATS = 3


def refusal(scene: Scene, method: Method) -> str | None:
    """Why the method cannot step the scene, or None."""
    try:
        fits_together(scene.system, method)
        engine.evaluations(method, scene.system)
    except UnsupportedError as error:
        return str(error)
    return None


def assess(scene: Scene, method: Method, dt: float, steps: int, fused: bool = False, dtype: str = "float64") -> Point:
    """Run the scene with a fixed step and measure its errors."""
    run = quiet_run(scene, method, dt, steps=steps, every=max(1, steps // SAMPLES), fused=fused, dtype=dtype)
    state_error, end_error, energy_error = _errors(scene, run.t, run.v, run.y, lambda: run.energy)
    amplitude = scene.amplitude(run)
    return Point(
        steps=steps,
        dt=dt,
        cost=engine.evaluations(method, scene.system) / dt,
        state_error=state_error,
        energy_error=energy_error,
        unstable=state_error > 1.0 and grew(amplitude, len(amplitude) // 2),
        end_error=end_error,
        phase_error=_phase(scene, run.t, run.v, run.y, state_error),
    )


def grew(amplitude: Array, half: int) -> bool:
    """True if the amplitude of a run grows in its second half, which begins at state ``half``."""
    # An amplitude that is not above the exact one does not count, since a driven system may start small. NaN is above everything.
    return not amplitude[half:].max() <= MIN_GROWTH * max(1.0, float(amplitude[: max(1, half)].max()))


def output_times(scene: Scene) -> Array:
    """The times at which a run with a tolerance, or a peer's, saves its state."""
    return np.linspace(0.0, scene.horizon, SAVED_TIMES + 1)[1:]


def assess_tolerance(scene: Scene, method: Method, tolerance: float, fused: bool = False) -> Point:
    """Run the scene with a tolerance and measure its errors.

    Its cost includes rejected steps, and the extra steps for the state at the end, but not those for the other output times.
    """
    times = output_times(scene)
    motion: dict[str, Any] = {"v": scene.v, "y": scene.y, "tolerance": tolerance, "at": times} | scene.adaptive_options
    run = quietly(scene.system, method, **motion, dt=scene.dt, max_steps=MOST_TRIED, fused=fused)
    assert run.paces is not None
    state_error, end_error, energy_error = _errors(scene, run.t, run.v, run.y, lambda: run.energy)
    tried = int(run.paces.accepted + run.paces.rejected) + EXTRA_STEPS
    stopped = bool(run.status != 0)
    return Point(
        steps=tried,
        dt=scene.horizon / tried,
        cost=method.attempt_evaluations * tried / scene.horizon,
        state_error=math.inf if stopped else state_error,
        energy_error=math.inf if stopped else energy_error,
        unstable=stopped,
        end_error=math.inf if stopped else end_error,
        phase_error=None if stopped else _phase(scene, run.t, run.v, run.y, state_error),
        tolerance=tolerance,
    )


def assess_peer(scene: Scene, peer: Peer) -> Curve:
    """Run the scene by a peer at each of its settings."""
    times = output_times(scene)
    points, spent = [], []
    for setting in sorted(peer.settings, reverse=True):
        solved = [peer.solve(scene, times, setting) for _ in range(PEER_REPEATS)]
        ns = sorted(1e9 * each.seconds / scene.horizon for each in solved)
        points.append(_of_peer(scene, times, solved[0], peer.by, setting))
        spent.append(Timing(statistics.median(ns), ns[0], ns[-1]))
    return Curve(peer, tuple(points), math.inf, Timing.unknown(), by=peer.by, times=tuple(spent))


def _of_peer(scene: Scene, times: Array, solved: Solved, by: str, setting: float) -> Point:
    shape = (len(times), *scene.v.shape), (len(times), *scene.y.shape)
    v, y = (np.asarray(block, dtype=np.float64).reshape(s) for block, s in zip((solved.v, solved.y), shape, strict=True))
    state_error, end_error, energy_error = _errors(scene, times, v, y, lambda: scene.energies(v, y))
    return Point(
        steps=None if by == "tolerance" else round(scene.horizon / setting),
        dt=None if by == "tolerance" else setting,
        cost=math.nan if solved.evaluations is None else solved.evaluations / scene.horizon,
        state_error=state_error,
        energy_error=energy_error,
        unstable=not math.isfinite(state_error),
        end_error=end_error,
        phase_error=_phase(scene, times, v, y, state_error),
        tolerance=setting if by == "tolerance" else None,
    )


def _errors(scene: Scene, t: Array, v: Array, y: Array, energies: Callable[[], Array]) -> tuple[float, float, float]:
    """The largest state error that is known, that at the end, and the largest energy error."""
    state = scene.state_error_at(t, v, y)
    try:
        energy = float(scene.energy_error_at(t, energies()).max())
    except UnsupportedError:  # a system without an energy of its own
        energy = math.nan
    # A run that ends within a step after the horizon has a last state that may not be known.
    return float(np.nanmax(state)), float(state[-1]), energy


def _phase(scene: Scene, t: Array, v: Array, y: Array, state_error: float) -> float | None:
    """The phase error, where it is meaningful: for a motion with a period, and a state with a correct digit; else None."""
    if scene.period is None or not state_error <= 1.0:
        return None
    return phase_error(scene, v[-1], y[-1], float(t[-1]))


def phase_error(scene: Scene, v: Array, y: Array, t: float) -> float:
    """How far a state at time t is ahead of the exact motion, in periods; behind is negative.

    It is the shift s that brings exact(t + s) closest to the state, both blocks in the scene's scales, divided by the period. It
    is between −½ and ½, since a motion that is a whole period ahead looks right.

    Raises:
        ArgumentError: if the scene has no exact solution or no period.
    """
    if scene.exact is None or scene.period is None:
        raise ArgumentError(f"scene: {scene.name} has no exact solution that repeats itself, so it has no phase error")
    exact, period = scene.exact, scene.period

    def states(shifts: Array) -> Array:
        """Scaled states at these shifts, one each row."""
        blocks = zip(exact(t + shifts), scene.scales, strict=True)
        return np.concatenate([np.reshape(block, (len(shifts), -1)) / scale for block, scale in blocks], axis=1)

    state = np.concatenate([np.ravel(block) / scale for block, scale in zip((v, y), scene.scales, strict=True)])
    shift = 0.0
    if np.linalg.norm(state - states(np.zeros(1))[0]) > COARSE_SEARCH_ABOVE:
        shifts = period * (np.arange(COARSE_SHIFTS + 1) / COARSE_SHIFTS - 0.5)
        shift = float(shifts[np.argmin(np.linalg.norm(states(shifts) - state, axis=1))])
    # The slope has some eight digits, and Gauss-Newton's steps converge where the residue is orthogonal to it, whatever its
    # length. No step is longer than the distance of two shifts, since near a close encounter the orbit is no straight line.
    small, most = 1e-5 * period, period / COARSE_SHIFTS
    for _ in range(30):
        before, here, after = states(shift + small * np.array([-1.0, 0.0, 1.0]))
        slope = (after - before) / (2.0 * small)
        step = float((state - here) @ slope / (slope @ slope))
        shift += max(-most, min(most, step))
        if abs(step) <= 1e-15 * period:
            break
    return (shift / period + 0.5) % 1.0 - 0.5 if abs(shift) > 0.5 * period else shift / period


def largest_stable_step(
    scene: Scene, method: Method, points: Sequence[Point], fused: bool = False, dtype: str = "float64"
) -> float:
    """The step at which the method becomes unstable, within 0.1 %: below it every rung of ``points`` is stable.

    ``points`` go from the largest step to the smallest. Infinite if all are stable, 0 if not even the last one is.
    """
    ladder = [(point.dt, point.unstable) for point in points if point.dt is not None]
    unstable = [dt for dt, wrong in ladder if wrong]
    if not unstable:
        return math.inf
    high = min(unstable)
    low = max((dt for dt, _ in ladder if dt < high), default=0.0)
    while low > 0.0 and high > 1.001 * low:
        middle = math.sqrt(low * high)
        point = assess(scene, method, middle, scene.steps_for(middle), fused, dtype)
        low, high = (low, middle) if point.unstable else (middle, high)
    return low
