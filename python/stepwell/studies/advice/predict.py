"""Predictions from the eigenvalues of a step, without a run: the error over the horizon, and the stability limit."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...analysis.stability import Mode, analyse, maps
from ...base.arrays import Array
from ...errors import UnsupportedError
from ...model.methods import Method
from ...scenes import Scene
from .trials import Trials

Complex = np.ndarray[Any, np.dtype[np.complex128]]

#: Times at which a prediction is compared with the exact modes.
SAMPLES = 10_000

#: Modes that are too close to each other to be distinguished by this give no prediction.
MAX_CONDITION = 1e8

#: The number of states of the true motion at which a nonlinear system is linearised; and the most numbers of a state for that,
#: since eigenvalues take long.
LINEARIZED_STATES, MAX_NUMBERS = 400, 128

#: A rate that is so many times the fastest oscillation holds down steps before that does.
MUCH_FASTER = 5.0

#: A step that is this many times as long as an advised one must not blow up either. The margin is more than twice the distance
#: between the steps at which the observed limit is searched.
MARGIN = 1.05

#: The observed limit is searched on a geometric grid of this many steps in a factor of two: 2.2 % apart.
RUNGS_PER_OCTAVE = 32


class Prediction(NamedTuple):
    """The prediction for a step of a linear system from its eigenvalues.

    Attributes:
        error: the largest state error over the horizon, all modes of the start together.
        frequency: relative frequency error Ψ/Φ − 1 of the mode of the start that drifts most; None if it does not oscillate.
        damping: the damping that the method adds to that mode, in 1 per unit of time; below zero the mode grows.
    """

    error: float
    frequency: float | None
    damping: float


class Rates(NamedTuple):
    """Eigenvalues of the rates at states of the true motion, shape (times, numbers of a state), and the times of these."""

    times: Array
    values: Complex

    @property
    def fastest(self) -> tuple[complex, float] | None:
        """The largest of those that do not grow, and its time; None if all are zero or grow."""
        sizes = np.where(self.values.real <= 0.0, np.abs(self.values), 0.0)
        i, k = np.unravel_index(int(sizes.argmax()), sizes.shape)
        return (complex(self.values[i, k]), float(self.times[i])) if sizes[i, k] > 0.0 else None

    @property
    def oscillation(self) -> float | None:
        """The largest frequency, in rad per unit of time; None if nothing oscillates, or if what decays is much faster.

        Eigenvalues at fixed states do not bound the motion between them, but a method blows up at the fastest oscillation if that
        lasts for some steps.
        """
        largest = float(np.abs(self.values.imag).max())
        fastest = self.fastest
        return None if not largest or (fastest is not None and abs(fastest[0]) > MUCH_FASTER * largest) else largest


class Limit(NamedTuple):
    """The stability limit of a method on a scene.

    Attributes:
        dt: the step beyond which a mode grows, in units of time; 0 for never stable, infinite for always; None if unknown. Where
            rounding hides what grows, the largest step that is known to be stable; ``mode`` then says so.
        by: ``"linear"``, or ``"frozen"`` for the fastest oscillation of the system linearised along the true motion; ``"none"``
            for adaptive steps.
        mode: the kind of growth beyond the limit, in words; None if there is none or it is unknown.
        frequency: the frequency of that mode, in rad per unit of time, or None.
    """

    dt: float | None
    by: str
    mode: str | None
    frequency: float | None


def predicted(scene: Scene, method: Method, dt: float, steps: int) -> Prediction | None:
    """The prediction, or None where it makes no sense: not linear, driven, controlled, or with modes too alike."""
    system = scene.system
    if not system.linear or system.given_inputs() or scene.control is not None:
        return None
    analysis = analyse(system, method, dt=dt)
    v, y = (np.asarray(block, dtype=float) for block in (scene.v, scene.y))
    slot = method.steps.start(system.scaled(dt, ()), 0, 0.0, v, y) if method.carry else v
    z, vectors = np.linalg.eig(analysis.P)
    rates, shapes = np.linalg.eig(maps.rates(system))
    if not max(np.linalg.cond(vectors), np.linalg.cond(shapes)) < MAX_CONDITION:
        return None
    start = np.concatenate([np.ravel(v), np.ravel(y)])
    share, true_share = np.linalg.solve(vectors, np.concatenate([np.ravel(slot), np.ravel(y)])), np.linalg.solve(shapes, start)
    finish = maps.finish(system, method, np.asarray(dt), ())
    k = np.unique(np.linspace(0, steps, min(steps, SAMPLES) + 1).astype(np.int64))
    with np.errstate(all="ignore"):
        x = np.real(finish @ vectors @ (share[:, np.newaxis] * z[:, np.newaxis] ** k))
        true = np.real(shapes @ (true_share[:, np.newaxis] * np.exp(rates[:, np.newaxis] * (k * dt))))
        difference = np.nan_to_num(x - true, nan=np.inf, posinf=np.inf, neginf=-np.inf)
        n_v = maps.size(system)[0]
        blocks = difference[:n_v].T.reshape(len(k), *system.v_shape), difference[n_v:].T.reshape(len(k), *system.y_shape)
        lengths = zip(scene.lengths(blocks), scene.group_scales, strict=True)
        errors = [length.max() / scale for length, scale in lengths if scale]
        # The mode that drifts most, weighted by its share of the start.
        weight = np.abs(true_share) * np.sqrt((np.abs(shapes) ** 2).sum(axis=0))
        own = np.array([np.sqrt(weight[np.abs(rates - rate).argmin()]) for rate in analysis.rates])
        drift = np.log(analysis.eigenvalues) / dt - analysis.rates
        worst = int(np.nanargmax(own * np.abs(drift)))
    ratio = float(analysis.frequency_ratios[worst])
    frequency = ratio - 1.0 if math.isfinite(ratio) else None
    return Prediction(float(max(errors, default=math.inf)), frequency, float(-drift[worst].real))


def limit(trials: Trials, method: Method, fastest: float | None) -> Limit:
    """The limit of a method on a scene; ``fastest`` is the frequency of ``Rates.oscillation`` for a nonlinear one."""
    scene = trials.scene
    if scene.system.linear and scene.control is None:
        limits = trials.stability_limit(method)
        mode: Mode | None = limits.mode
        if mode is None:
            return Limit(limits.stable, "linear", None, None)
        kind = mode.kind if limits.decided else f"{mode.kind}; not decided between {limits.stable:.6g} and {limits.grows:.6g}"
        return Limit(limits.stable, "linear", kind, abs(mode.rate.imag))
    if not fastest:
        return Limit(None, "frozen", None, None)
    return Limit(method.limit / fastest, "frozen", "the fastest oscillation along the motion", fastest)


def longest_step(trials: Trials, method: Method) -> float:
    """The longest step that keeps a margin to the limit of a linear system; infinite where there is none.

    A method that grows slowly with every step has no limit to keep away from.
    """
    scene = trials.scene
    if not scene.system.linear or scene.control is not None:
        return math.inf
    return trials.stability_limit(method).stable / MARGIN or math.inf


def keeps_margin(trials: Trials, method: Method, dt: float) -> bool:
    """True if runs with steps up to ``MARGIN`` times as long do not blow up either; for a linear system, by its limit."""
    horizon = trials.scene.horizon
    steps = (math.floor(horizon / (dt * ratio)) for ratio in (MARGIN, math.sqrt(MARGIN)))
    return trials.scene.system.linear or not any(trials.unstable(method, horizon / n, n) for n in steps if n)


def rates_along(trials: Trials) -> Rates | None:
    """The eigenvalues of the rates along the true motion, of a linear system at its start; None if they are not known."""
    scene = trials.scene
    system = scene.system
    if sum(maps.size(system)) > MAX_NUMBERS:
        return None
    assert scene.exact is not None
    t = trials.marks[:1] if system.linear else trials.marks[:: max(1, len(trials.marks) // LINEARIZED_STATES)]
    v, y = (np.asarray(block) for block in scene.exact(t))
    times, values = [], []
    try:
        for i in range(len(t)):
            matrix = maps.rates(system.for_state_shapes(v[i], y[i]), float(t[i]), v[i], y[i])
            if np.isfinite(matrix).all():
                times.append(t[i])
                values.append(np.linalg.eigvals(matrix))
    except UnsupportedError:
        return None
    return Rates(np.array(times), np.array(values)) if times else None


def observed_limit(trials: Trials, method: Method, stable: int) -> float:
    """The largest step whose run over the horizon does not grow, within 2 %: infinite if four steps do not, 0 if none is stable.

    The method is stable with ``stable`` steps over the horizon, and with ``MARGIN`` times fewer.
    """
    horizon = trials.scene.horizon

    def grows(j: int) -> bool:
        n = round(float(2.0 ** (j / RUNGS_PER_OCTAVE)))
        return trials.unstable(method, horizon / n, n)

    low = 2 * RUNGS_PER_OCTAVE
    high = max(low, math.ceil(RUNGS_PER_OCTAVE * math.log2(stable / MARGIN)))
    # From the fine end, which is known to be stable, since coarse steps may be stable again by chance.
    last = high
    for j in range(high - RUNGS_PER_OCTAVE, low - 1, -RUNGS_PER_OCTAVE):
        if grows(j):
            low, high = j, last
            break
        last = j
    else:
        if not grows(low):
            return math.inf
        high = last
    if low == high:
        return 0.0
    while high > low + 1:
        middle = (low + high) // 2
        low, high = (middle, high) if grows(middle) else (low, middle)
    return float(horizon / round(2.0 ** (high / RUNGS_PER_OCTAVE)))
