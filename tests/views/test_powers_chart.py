"""The chart of powers against steps: errors in exact arithmetic, times, and what is refused."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, ShapeError, UnsupportedError
from stepwell.views.charts import powers
from stepwell.views.charts.powers import FORMS
from support.charted import drawn, files_of
from support.for_each import for_each
from support.refusals import refused
from support.truths import CLOSED_FORMS


def of_tableau(steps: Any, phi: Fraction) -> Any:
    """Σ zᵏ·bᵀAᵏ⁻¹1 of the floats of a tableau, z = iΦ: its real part twice on the diagonal, its imaginary part beside it."""
    rows = [[Fraction(a) for a in row] for row in steps.ROWS]
    stages, coefficients = [Fraction(1)] * len(rows), [Fraction(1)]
    for _ in rows:
        coefficients.append(sum((Fraction(b) * x for b, x in zip(steps.WEIGHTS, stages, strict=True)), Fraction(0)))
        stages = [sum((a * x for a, x in zip(row, stages, strict=False)), Fraction(0)) for row in rows]
    terms = [c * phi**k for k, c in enumerate(coefficients)]
    real, imaginary = (sum(term * (-1) ** m for m, term in enumerate(terms[first::2])) for first in (0, 1))
    return np.array([[real, -imaginary], [imaginary, real]], dtype=object)


@for_each("method", sorted(CLOSED_FORMS))
def test_errors_are_those_of_exact_arithmetic(method: str) -> None:
    """The closed form of P in fractions, applied seven times by hand."""
    chart = powers(method, v=0.25, y=1.0, dt=0.5, steps=[1, 7])
    half = Fraction(1, 2)
    matrix: Any = CLOSED_FORMS[method](half)  # type: ignore[arg-type]
    if method == "dop853":  # whose weights are no fractions: what it does is done by the floats that are nearest to them
        matrix = of_tableau(sw.method(method).steps, half)
    # The chart takes each of those for a simple fraction that rounds to it: half a rounding of each, and some of them cancel.
    unsure = 1e-16 if method == "dop853" else 1e-30
    state = np.array([Fraction(1, 4), Fraction(1)], dtype=object)
    if method == "verlet":  # in its slots: y₋₁ = y₀ − Φ·v₀ − ½Φ²·y₀
        matrix = np.array([[0, 1], [-1, 2 - half**2]], dtype=object)
        state[0] = 1 - half / 4 - half**2 / 2
    if method == "leapfrog":  # in its slots False Euler, v half a step ago
        matrix = np.array([[1, -half], [half, 1 - half**2]], dtype=object)
        state[0] = Fraction(1, 4) + half / 2
    sizes = [float(np.hypot(*map(float, state)))]
    for k in range(1, 8):
        state = np.array([sum(a * b for a, b in zip(row, state, strict=True)) for row in matrix], dtype=object)
        if k in (1, 7):
            sizes.append(float(np.hypot(*map(float, state))))
    run = sw.integrate(sw.Oscillator(), method, v=0.25, y=1.0, dt=0.5, steps=7)
    slot = run.v[-1] if run.carry is None else run.carry
    distance = np.hypot(float(Fraction(float(slot)) - state[0]), float(Fraction(float(run.y[-1])) - state[1]))
    assert chart.errors["direct"][1] == pytest.approx(distance / max(sizes), rel=1e-6, abs=unsure)
    for form in FORMS:
        assert chart.errors[form].max() < 1e-14
        assert (chart.seconds[form] > 0).all()


def test_a_power_costs_little_and_errs_like_steps() -> None:
    """24 squarings for ten million steps. Each rounds P by about 2⁻⁵³ of its size, n of them add up: errors below 8·n·2⁻⁵³."""
    chart = powers(steps=[10, 10**7])
    assert (chart.errors["power"] < 8 * chart.steps * 2.0**-53).all()
    assert chart.errors["power"][1] > 0
    # A coarse ratio: 40 when measured. Of a million steps it is 3 to 10 since the matrix form is machine code, 3 ns a step.
    assert chart.seconds["matrix"][1] > 3 * chart.seconds["power"][1]


def test_files_and_picture(tmp_path: Path) -> None:
    chart = powers("rk4", system=sw.Chain(3), y=[1.0, 0.0, 0.0], steps=[1, 100, 1000])
    rows, written = files_of(chart, tmp_path)
    assert [float(row["error"]) for row in rows if row["form"] == "power"] == chart.errors["power"].tolist()
    assert len(rows) == len(chart.rows()) == 9
    assert written["summary"] == chart.summary()
    figure = drawn(chart, tmp_path)
    assert [axes.get_xlabel() for axes in figure.axes] == ["steps n", "steps n"]
    assert len(figure.axes[0].lines) == len(FORMS)


def test_what_has_no_powers_is_refused() -> None:
    refused(UnsupportedError, "only linear systems have powers", powers, system=sw.NBody())
    refused(ShapeError, "one member", powers, system=sw.Oscillator([1.0, 2.0]))
    refused(ArgumentError, "steps", powers, steps=[])
    refused(ArgumentError, "dt", powers, dt=0.0)
    with pytest.raises(UnsupportedError):
        powers("verlet", system=sw.Oscillator(1.0, 0.1))
