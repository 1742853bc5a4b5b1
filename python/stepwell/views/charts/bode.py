"""Bode charts: the frequency response of a linear system, and what methods make of it up to half the samples' frequency (§4)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, nan, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis.discrete import Margins, discretise, frequency_response
from ...analysis.discrete.driven import of_method
from ...analysis.discrete.margins import of_response
from ...analysis.stability import analyse
from ...analysis.stability.eigen import Complex
from ...base import checks
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.pictures import Drawn
from ...base.tables import Table, stacked
from ...errors import ArgumentError, ShapeError, UnsupportedError
from ...model.methods import Method, choice
from ...model.systems import LinearSystem

if TYPE_CHECKING:
    from ...base.literals import InputBetween

#: How the input runs within a step: as the sinusoid that it is, held, or on straight lines between samples.
INPUTS: tuple[InputBetween, ...] = ("sine", "hold", "linear")

#: Frequencies of the default grid, and how far below the slowest corner or π/dt it begins, as a factor.
FREQUENCIES, BELOW = 400, 1e-2

#: A response within this of the exact one is right, for the summary and the picture.
RIGHT = 0.01


@dataclass(frozen=True, eq=False)
class MethodResponse(ValueEquality):
    """The response with the steps of a method; arrays are of shape (n,).

    Attributes:
        method: the method.
        response: Z/X at the samples, complex.
        error: |Z/X over the exact one − 1|.
        stable: whether its steps stay bounded; else no run ever shows this response.
        damping: the damping ratio that its steps have in their slowest mode, the one that decides on stability.
        exact_damping: that of the same mode of the system.
        margins: those of the response as an open loop.
    """

    method: Method
    response: Complex
    error: Array
    stable: bool
    damping: float
    exact_damping: float
    margins: Margins

    def right_up_to(self, omega: Array) -> float:
        """The frequency up to which the response is right within ``RIGHT``; 0 if it is wrong at the first."""
        wrong = np.flatnonzero(~(self.error <= RIGHT))
        return float(omega[-1]) if not wrong.size else float(omega[wrong[0] - 1]) if wrong[0] else 0.0


@dataclass(frozen=True, eq=False)
class Bode(Drawn, Table, ValueEquality):
    """The frequency response of a system and of its steps: a row for each method and frequency, and for the exact response.

    Attributes:
        system: the linear system, with one input and one output.
        dt: the step, in units of time.
        x: how the input runs within a step: "sine", "hold" or "linear".
        omega: the frequencies ω in radians per unit of time, shape (n,), up to π/dt.
        continuous: Z/X of the system, complex, shape (n,).
        exact: that of its exact samples with this input; for "sine" the same.
        margins: those of the exact response as an open loop.
        curves: one for each method.
        refused: the methods that cannot step the system, with the reasons.
    """

    system: LinearSystem
    dt: float
    x: str
    omega: Array
    continuous: Complex
    exact: Complex
    margins: Margins
    curves: tuple[MethodResponse, ...]
    refused: dict[str, str]
    _painter = "draw_bode"

    @property
    def nyquist(self) -> float:
        """π/dt, half the frequency of the samples, in radians per unit of time."""
        return pi / self.dt

    def summary(self) -> list[dict[str, Any]]:
        """A row for each method: up to which frequency it is right to 1 %, the damping that it adds, and its margins."""
        return [
            {
                "method": curve.method.name,
                "title": curve.method.title,
                "stable": curve.stable,
                "right_up_to": curve.right_up_to(self.omega),
                "of_nyquist": curve.right_up_to(self.omega) / self.nyquist,
                "damping": curve.damping,
                "exact_damping": curve.exact_damping,
                **_margins(curve.margins),
            }
            for curve in self.curves
        ]

    def _head(self) -> dict[str, Any]:
        return {
            "system": repr(self.system),
            "dt": self.dt,
            "x": self.x,
            "right_within": RIGHT,
            "exact_margins": _margins(self.margins),
            "refused": self.refused,
        }

    def _columns(self) -> dict[str, list[Any]]:
        methods = [
            {"method": curve.method.name, "omega": self.omega, **_polar(curve.response), "error": curve.error}
            for curve in self.curves
        ]
        exact = {"method": "exact", "omega": self.omega, **_polar(self.exact), "error": np.zeros_like(self.omega)}
        return stacked([exact, *methods])


def gain(response: Complex) -> Array:
    """In decibels."""
    with np.errstate(divide="ignore"):
        return np.asarray(20.0 * np.log10(np.abs(response)), np.float64)


def phase(response: Complex) -> Array:
    """In degrees, without jumps."""
    angle = np.angle(response)
    finite = np.isfinite(angle)
    unwrapped = np.full(angle.shape, nan)
    unwrapped[finite] = np.unwrap(angle[finite])
    return np.degrees(unwrapped)


def _polar(response: Complex) -> dict[str, Array]:
    return {"gain_db": gain(response), "phase_degrees": phase(response)}


def _margins(margins: Margins) -> dict[str, float]:
    return {"gain_margin": margins.gain, "phase_margin": margins.phase}


def bode(
    system: Any,
    methods: Iterable[Method | str] | None = None,
    *,
    dt: float,
    x: InputBetween = "sine",
    omega: Any = None,
    of: tuple[int, int] = (0, 0),
) -> Bode:
    """The frequency response of a linear system, exactly and by methods, up to half the frequency of the samples (§4).

    Args:
        system: a linear system of stepwell, SciPy or python-control, of one member; its inputs x are left out.
        methods: names, or what ``stepwell.method`` returns; all that can step the system if None.
        dt: the step, in units of time, above zero.
        x: how the input runs within a step: ``"sine"``, a function of the time that the method evaluates where it likes, as in a
            simulation; ``"hold"``, a sample that is held, as behind a converter; ``"linear"``, a straight line between samples.
            The exact response is that of the same input.
        omega: frequencies in radians per unit of time, shape (n,), above zero, rising and at most π/dt; if None, 400 up to there.
        of: the output and the input, if there are several.

    Raises:
        UnsupportedError: if no method can step the system, or it is not linear.

    Example:
        >>> chart = sw.charts.bode(sw.Oscillator(1.0, 0.1), ["false_euler", "rk4"], dt=0.5)
        >>> [(row["method"], round(row["of_nyquist"], 2)) for row in chart.summary()]
        [('false_euler', 0.06), ('rk4', 0.46)]
    """
    dt = checks.number("dt", dt, positive=True, unit="units of time")
    x = checks.known("x", x, INPUTS)
    whole = LinearSystem.of(system)
    chosen = choice(methods)
    one = _one(whole, of)
    if whole.batch:
        raise ShapeError(f"system: expected one member, got a batch of shape {whole.batch}")
    frequencies = _frequencies(one, dt, omega)
    curves, refused = [], {}
    for method in chosen:
        try:
            curves.append(_curve(one, method, dt, x, frequencies))
        except UnsupportedError as error:
            if methods is not None:
                raise
            refused[method.name] = str(error)
    continuous = frequency_response(one, frequencies)
    way = {"hold": "zoh", "linear": "linear"}.get(x)
    exact = one if way is None else discretise(one, dt, way)

    def truth(at: Any) -> Any:
        return frequency_response(exact, at)

    return Bode(
        one,
        dt,
        x,
        frequencies,
        np.asarray(continuous),
        np.asarray(truth(frequencies)),
        of_response(truth, frequencies, inf if way is None else pi / dt),
        tuple(curves),
        refused,
    )


def _one(system: LinearSystem, of: Any) -> LinearSystem:
    """The system with one input and one output."""
    if system.B is None:
        raise ArgumentError(f"system: expected one with an input, got {system!r}")
    if not isinstance(of, (tuple, list)) or len(of) != 2:
        raise ArgumentError(f"of: expected a pair (output, input), got {checks.short(of)}")
    C = np.eye(len(system.A)) if system.C is None else system.C
    output, source = (checks.count(f"of[{i}]", of[i], 0, n - 1) for i, n in enumerate((len(C), system.B.shape[1])))
    D = None if system.D is None else system.D[[output]][:, [source]]
    return LinearSystem(system.A, system.B[:, [source]], C[[output]], D, velocities=system.velocities)


def _frequencies(system: LinearSystem, dt: float, omega: Any) -> Array:
    if omega is None:
        corners = np.abs(np.linalg.eigvals(system.A))
        slowest = min([pi / dt, *corners[corners > 0.0].tolist()])
        return np.geomspace(max(BELOW * slowest, BELOW**2 * pi / dt), pi / dt, FREQUENCIES)
    frequencies = checks.numbers("omega", omega, positive=True, unit="rad per unit of time")
    if frequencies.ndim != 1 or frequencies.size < 2:
        raise ShapeError(f"omega: expected a list of two or more frequencies, got an array of shape {frequencies.shape}")
    if (np.diff(frequencies) <= 0.0).any():
        raise ArgumentError("omega: expected frequencies that rise from one to the next")
    if frequencies[-1] > pi / dt * (1.0 + 1e-12):
        raise ArgumentError(f"omega: expected frequencies up to π/dt = {pi / dt:g}, where samples end, got {frequencies[-1]:g}")
    return frequencies


def _curve(system: LinearSystem, method: Method, dt: float, x: str, omega: Array) -> MethodResponse:
    step = analyse(system, method, dt=dt)
    exact: Any
    if x == "sine":
        exact = system

        def made(at: Any) -> Any:
            wide = np.atleast_1d(np.asarray(at, dtype=np.float64))
            return np.reshape(of_method(system, method, dt, wide), np.shape(at))[()]

    else:
        between: Any = x
        exact, by = discretise(system, dt, "exact", interpolation=between), discretise(system, dt, method, interpolation=between)

        def made(at: Any) -> Any:
            return by.frequency_response(at)

    with np.errstate(all="ignore"):
        response = np.asarray(made(omega))
        error = np.abs(response / np.asarray(frequency_response(exact, omega)) - 1.0)
        rate = np.log(step.eigenvalues[0]) / dt
        damping, true = (float(-each.real / abs(each)) if abs(each) > 0.0 else 0.0 for each in (rate, step.rates[0]))
    margins = of_response(made, omega, inf if x == "sine" else pi / dt)
    return MethodResponse(method, response, np.asarray(error, np.float64), bool(step.stable), damping, true, margins)
