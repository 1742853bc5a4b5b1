"""Sampled loops: a plant behind a hold, closed by a controller that sees it once a sample, and the longest sample it bears."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...base.reprs import counted
from ...errors import ArgumentError, ShapeError
from ...model.systems import LinearSystem
from ...model.systems.linear import is_gain, part_of
from ...model.systems.realisation import Realisation, coefficients, feedback, of_gain, of_polynomials, series
from ..stability import eigen
from .delay import MOST_SAMPLES
from .many_samples import MOST_AS_MATRIX, grow, scaled
from .systems import DiscreteSystem, discretise

#: Samples that are tried in each decade, and how far they reach beyond the corners of plant and controller, as factors.
IN_DECADE, SHORTER, LONGER = 30, 1e-3, 1e3

#: Samples that are tried together, and parts into which the interval is divided in which the loop begins to grow; fewer where
#: each one takes as long as a call.
TOGETHER, FEW = 128, 4

#: The shortest samples that are tried are these shares of a dead time, the second only if the loop is not stable with the first.
OF_DELAY = 1e-2, 3e-3

#: A slower corner than this share of the fastest counts as one at 0, which a sample of any length sees so.
LEAST = 1e-12

#: Rounding of the radius of a loop's eigenvalues: a loop that is larger by less is no loop that grows.
ROUNDING = 1e-9


def sampled_loop(
    plant: Any, controller: Any, dt: float, *, delay: float = 0.0, samples: int = 0, how: str = "tustin"
) -> DiscreteSystem:
    """A loop that a sampled controller closes: u = controller·(x − z) once a sample, held in between; z is the plant's output.

    The plant is exact between samples, so whether the loop is stable does not depend on a method.

    Args:
        plant: a linear system with one input and one output, of stepwell, SciPy or python-control.
        controller: a gain; a linear system of continuous time, which ``how`` discretises; a pair (num, den) of polynomials in z,
            highest power first; or a ``DiscreteSystem`` of this dt.
        dt: the time between samples, above zero.
        delay: dead time between controller and plant, in units of time.
        samples: further dead time as a number of samples, such as 1 for a controller whose result is put out at the next sample.
        how: how to discretise a controller of continuous time, as for ``discretise``: "tustin", "zoh", "linear" or a method.

    Returns:
        The closed loop from x to z: a ``DiscreteSystem``, whose states are those of the plant, the samples under way, and those
        of the controller. Its ``radius`` is below 1 if the loop is stable.

    Raises:
        ArgumentError: if an argument is wrong, or the output is not determined.

    Example:
        >>> mass = sw.TransferFunction(4.0, [1.0, 0.4, 0.0])
        >>> for dt in (0.1, 0.3):
        ...     print(round(float(sw.sampled_loop(mass, 0.8, dt).radius), 4))
        0.9881
        1.0099
    """
    dt = checks.number("dt", dt, positive=True, unit="units of time")
    samples = checks.count("samples", samples, 0, MOST_SAMPLES)
    delay = checks.number("delay", delay)
    part_of("plant", plant, of_states=True)
    behind = discretise(plant, dt, "zoh", delay=delay + samples * dt)
    of_plant = _standard(behind)
    if (of_plant.inputs, of_plant.outputs) != (1, 1):
        raise ShapeError(
            f"plant: expected one input and one output, got {counted(of_plant.inputs, 'input')} and "
            f"{counted(of_plant.outputs, 'output')}"
        )
    of_controller = _controller(controller, dt, how)
    with np.errstate(all="ignore"):  # a sample may be so long that a plant that grows leaves all numbers
        whole = feedback(series(of_controller, of_plant), of_gain("controller", 1.0, 1, 1), -1)
    n = of_controller.size
    order = [*range(n, whole.size), *range(n)]  # the plant's states first
    A, B, C = whole.A[order][:, order], whole.B[order], whole.C[:, order]
    return DiscreteSystem(behind.system, "loop", "hold", dt, A, B, np.zeros_like(B), C, whole.D, behind.delay)


def _standard(system: DiscreteSystem) -> Realisation:
    """The matrices of the standard form, which join as those of continuous time do."""
    A, B, C, D = system.standard()
    return Realisation(A, B, C, D, (), (None,) * B.shape[1])


def _controller(controller: Any, dt: float, how: str) -> Realisation:
    if is_gain(controller):
        return of_gain("controller", controller, 1, 1)
    if isinstance(controller, DiscreteSystem):
        if controller.dt != dt:
            raise ArgumentError(f"controller: expected one that was discretised with dt = {dt:g}, got {controller.dt:g}")
        part = _standard(controller)
    elif isinstance(controller, tuple):
        if len(controller) != 2:
            raise ArgumentError(f"controller: expected a pair (num, den) of polynomials in z, got {len(controller)} of them")
        num, den = (coefficients("controller", each) for each in controller)
        is_number = len(num) == len(den) == 1
        part = of_gain("controller", num[0] / den[0], 1, 1) if is_number else of_polynomials(num[:, np.newaxis], den)
    else:
        part_of("controller", controller, of_states=True)
        part = _standard(discretise(controller, dt, how))
    if (part.inputs, part.outputs) != (1, 1):
        raise ShapeError(
            f"controller: expected one input and one output, got {counted(part.inputs, 'input')} and "
            f"{counted(part.outputs, 'output')}"
        )
    return part


def sampling_limit(plant: Any, controller: Any, *, delay: float = 0.0, samples: int = 0, how: str = "tustin") -> float:
    """The longest sample for which a loop is stable, and is so for all shorter ones.

    It is a limit of the loop itself, however exactly it is computed; ``stability_limit`` is that of a method. Samples are tried
    at intervals of 8 %, so a loop that grows for a narrower window of them counts as stable there.

    Args:
        plant: as for ``sampled_loop``, of one member.
        controller: a gain or a linear system of continuous time, as for ``sampled_loop``.
        delay: dead time between controller and plant, in units of time, which stays as it is.
        samples: dead time as a number of samples, which grows with them.
        how: as for ``sampled_loop``.

    Returns:
        The limit in units of time: 0 if the loop is not stable with the shortest samples, a thousandth of the shortest time
        constant and 0.003 of the dead time; infinity if it is with samples of a thousand times the longest time constant.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> integrator = sw.TransferFunction(1.0, [1.0, 0.0])
        >>> round(sw.sampling_limit(integrator, 4.0), 9)  # 1 − 4·dt leaves the circle at −1
        0.5
    """
    if isinstance(controller, (DiscreteSystem, tuple)):
        raise ArgumentError(
            "controller: expected a gain or a system of continuous time, whose samples change with dt; one in z belongs to one dt"
        )
    delay = float(checks.not_negative("delay", checks.number("delay", delay), "a dead time"))
    samples = checks.count("samples", samples, 0, MOST_SAMPLES)
    one = part_of("plant", plant, of_states=True)
    system = LinearSystem.of(plant)
    if system.batch or (is_gain(controller) and np.ndim(controller)):
        raise ShapeError("plant, controller: expected one member, got a batch; ask for each of them")
    corners = [np.abs(eigen.eigenvalues(one.A)).ravel()]
    if not is_gain(controller):
        corners.append(np.abs(eigen.eigenvalues(part_of("controller", controller, of_states=True).A)).ravel())
    # Closed with the shortest hold, the loop has further corners: those of its gain.
    closed = _corners(system, controller)
    every = np.concatenate([*corners, closed])
    every = every[np.isfinite(every) & (every > 0.0)]
    fast, slow = (float(every.max()), float(every.min())) if every.size else (1.0, 1.0)
    slow = max(slow, LEAST * fast)

    shortest = SHORTER / fast
    longest = LONGER / slow
    if not 0.0 < shortest < longest < inf:
        raise ArgumentError(f"plant, controller: expected corners of sizes that can be computed with, got {fast:g} and {slow:g}")

    of_controller = controller if is_gain(controller) else LinearSystem.of(controller)

    def controlled(dts: Array) -> Realisation:
        return _controller(controller if is_gain(controller) else scaled(of_controller, dts), 1.0, how)

    def grown(dts: Array, share: float) -> Any:
        slack = share * np.minimum(1.0, dts * fast)  # with short samples all eigenvalues are near 1
        return grow(system, controlled, dts, delay, samples, slack)

    first = [max(shortest, share * delay) for share in OF_DELAY]
    sampled_loop(system, controller, first[0], delay=delay, samples=samples, how=how)  # checks it all
    before = next((dt for dt in first if not grown(np.array([dt]), ROUNDING)[0]), 0.0)
    if before == 0.0:
        return 0.0
    tried = np.geomspace(before, max(longest, 2.0 * before), max(2, round(IN_DECADE * np.log10(longest / before))))
    for k in range(1, len(tried), TOGETHER):
        some = grown(tried[k : k + TOGETHER], ROUNDING)
        if some.any():
            break
    else:
        return inf
    low, high = tried[k + some.argmax() - 1 : k + some.argmax() + 1].tolist()
    parts = TOGETHER if delay + samples * low <= MOST_AS_MATRIX * low else FEW
    while (within := low + (high - low) * np.arange(1, parts) / parts)[0] > low:
        places = [low, *within.tolist(), high]
        at = int(np.append(grown(within, 0.0), True).argmax())
        if (low, high) == (places[at], places[at + 1]):
            break
        low, high = places[at], places[at + 1]
    return float(low)


def _corners(plant: LinearSystem, controller: Any) -> Any:
    part = part_of("plant", plant, of_states=True)
    other = of_gain("controller", controller, 1, 1) if is_gain(controller) else part_of("controller", controller, of_states=True)
    try:
        loop = feedback(series(other._replace(x=(None,)), part._replace(x=(None,))), of_gain("controller", 1.0, 1, 1), -1)
    except ArgumentError:  # of continuous time it may be algebraic
        return np.empty(0)
    return np.abs(eigen.eigenvalues(loop.A)).ravel()
