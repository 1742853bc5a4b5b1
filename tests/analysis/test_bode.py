"""Bode charts: the response of each method is what a run with a sinusoid shows, and what is said of it is true."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.discrete.driven import of_method
from stepwell.errors import ArgumentError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.views.charts.bode import phase
from stepwell.views.charts.bode_picture import finding
from support.charted import files_of
from support.looped import assert_refused, looped

OSCILLATOR = sw.Oscillator(1.0, 0.1)


@looped("method", [each.name for each in sw.methods()])
def test_the_response_is_what_a_run_shows(method: str) -> None:
    """A run that starts on the steady motion stays on it: at step k it is the real part of S·e^(jωk·dt), for every method."""
    # S is the response of all states. Verlet and leapfrog see the input in what they carry, too.
    system = sw.LinearSystem([[0.0, -4.0], [1.0, 0.0]], [[1.0], [0.0]])  # an undamped oscillator, which Verlet can step
    dt, omega = 0.2, np.array([0.5, 3.0, 12.0])
    states = of_method(system, sw.method(method), dt, omega)[:, :, 0]
    for w, s in zip(omega, states, strict=True):
        driven = system.with_inputs(sw.Sinusoid(1.0, w, 0.5 * np.pi))
        run = sw.integrate(driven, method, v=s[:1].real, y=s[1:].real, dt=dt, steps=12, every=1)
        truth = (s * np.exp(1j * w * run.t)[:, np.newaxis]).real
        # Thirteen states of some twenty roundings; Verlet's velocities are differences of positions, divided by dt.
        assert np.concatenate([run.v, run.y], axis=1) == pytest.approx(truth, abs=1e-12 * max(1.0, np.abs(s).max()))


@looped("method, order", [("standard_euler", 1), ("standard_heun", 2), ("rk4", 4), ("rodas4", 4)])
def test_the_error_falls_with_the_order(method: str, order: int) -> None:
    errors = [sw.charts.bode(OSCILLATOR, [method], dt=dt, omega=[0.3, 0.7]).curves[0].error for dt in (0.02, 0.01)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx([order] * 2, abs=0.2)


def test_the_exact_response_is_that_of_the_same_input_and_output() -> None:
    system, omega = sw.TransferFunction([1.0], [1.0, 0.3, 2.0]), [0.1, 0.5, 3.0]
    for x, how in (("hold", "zoh"), ("linear", "linear")):
        chart: Any = sw.charts.bode(system, ["rk4"], dt=0.4, x=x, omega=omega)  # type: ignore[arg-type]
        assert np.array_equal(chart.exact, sw.discretise(system, 0.4, how).frequency_response(omega))
        method = sw.discretise(system, 0.4, "rk4", interpolation=x).frequency_response(omega)  # type: ignore[arg-type]
        assert np.array_equal(chart.curves[0].response, method)
    chart = sw.charts.bode(system, ["rk4"], dt=0.4, omega=omega)
    assert np.array_equal(chart.exact, chart.continuous)
    assert chart.continuous == pytest.approx(np.polyval([1.0], omega) / np.polyval([1.0, 0.3, 2.0], 1j * np.array(omega)))
    both = sw.LinearSystem([[-1.0, 0.0], [0.0, -2.0]], np.eye(2), np.eye(2), velocities=0)
    chart = sw.charts.bode(both, ["rk4"], dt=0.1, of=(1, 1), omega=[1.0, 2.0])
    assert chart.continuous == pytest.approx(1.0 / (2.0 + 1j * np.array([1.0, 2.0])))


def test_what_the_summary_says() -> None:
    """The damping of backward Euler's steps is that of z = 1/(1 − λh); its error passes 1 % where it says."""
    chart = sw.charts.bode(OSCILLATOR, ["standard_euler", "backward_euler", "rk4"], dt=0.5)
    euler, backward, rk4 = chart.summary()
    assert (euler["stable"], backward["stable"], rk4["stable"]) == (False, True, True)
    rate = -0.1 + 1j * np.sqrt(0.99)
    for row, z in ((euler, 1.0 + 0.5 * rate), (backward, 1.0 / (1.0 - 0.5 * rate))):
        log = np.log(z)
        assert row["damping"] == pytest.approx(-log.real / abs(log), rel=1e-12)
        assert row["exact_damping"] == pytest.approx(0.1, rel=1e-12)
    at = rk4["right_up_to"]
    assert rk4["of_nyquist"] == pytest.approx(at * 0.5 / np.pi)
    for factor, right in ((0.99, True), (1.03, False)):
        (curve,) = sw.charts.bode(OSCILLATOR, ["rk4"], dt=0.5, omega=[0.01, factor * at]).curves
        assert bool(curve.error[-1] <= 0.01) is right
    assert (rk4["phase_margin"], chart.margins.phase) == pytest.approx((16.3, 16.26), abs=0.05)


def test_margins_are_those_of_the_loop_and_a_phase_runs_on() -> None:
    loop = sw.TransferFunction(4.0, [1.0, 3.0, 3.0, 1.0])
    chart = sw.charts.bode(loop, ["dop853"], dt=0.2, x="hold")
    margins = sw.margins(sw.discretise(loop, 0.2))
    # The search begins at other frequencies, and halves down to the last digit but one.
    assert (chart.margins.gain, chart.margins.phase) == pytest.approx((margins.gain, margins.phase), rel=1e-9)
    assert chart.summary()[0]["gain_margin"] == pytest.approx(margins.gain, rel=1e-6)
    # Without jumps of 360°, and past a pole on the axis, where there is none.
    cube = sw.charts.bode(sw.TransferFunction(1.0, [1.0, 3.0, 3.0, 1.0]), ["rk4"], dt=0.01)
    assert phase(cube.continuous)[-1] == pytest.approx(-270.0, abs=1.0)
    response = np.array([1.0 + 0j, complex(np.inf, np.nan), -1.0 + 0j])
    assert np.isnan(phase(response)[1])
    assert np.isfinite(phase(response)[[0, 2]]).all()


def test_tables(tmp_path: Path) -> None:
    chart = sw.charts.bode(OSCILLATOR, ["rk4", "false_euler"], dt=0.5, omega=[0.1, 1.0, 2.0])
    rows = chart.rows()
    assert [row["method"] for row in rows] == ["exact"] * 3 + ["rk4"] * 3 + ["false_euler"] * 3
    table, whole = files_of(chart, tmp_path)
    assert [float(row["gain_db"]) for row in table] == [row["gain_db"] for row in rows]
    assert (whole["x"], len(whole["rows"]), whole["summary"][0]["method"]) == ("sine", 9, "rk4")


def test_methods_that_cannot_step_it() -> None:
    chart = sw.charts.bode(OSCILLATOR, dt=0.1)
    assert set(chart.refused) == {"leapfrog", "verlet", "pefrl", "wisdom_holman"}
    assert len(chart.curves) + len(chart.refused) == len(sw.methods())
    with pytest.raises(UnsupportedError, match="verlet needs forces"):
        sw.charts.bode(OSCILLATOR, ["verlet"], dt=0.1)


def test_the_title_is_true() -> None:
    chart = sw.charts.bode(OSCILLATOR, ["standard_euler", "false_euler", "rk4"], dt=0.5)
    assert finding(chart) == "Right to 1 % up to 0.46 π/dt by Runge-Kutta 4, 0.063 π/dt by False Euler; Standard Euler unstable"
    exact = sw.charts.bode(OSCILLATOR, ["dop853"], dt=0.1)
    assert finding(exact) == "Right to 1 % up to π/dt by Dormand-Prince 8(5,3)"
    assert (
        finding(sw.charts.bode(OSCILLATOR, ["standard_euler"], dt=0.5)) == "No run shows this response: Standard Euler unstable"
    )


WRONG: list[tuple[Any, type[Exception], str]] = [
    (lambda: sw.charts.bode(OSCILLATOR, dt=-0.1), ArgumentError, "dt: expected numbers above zero"),
    (lambda: sw.charts.bode(OSCILLATOR, dt=0.1, x="cubic"), UnknownNameError, "x: there is no 'cubic'"),  # type: ignore[arg-type]
    (lambda: sw.charts.bode(OSCILLATOR, dt=0.1, omega=[1.0, 40.0]), ArgumentError, "omega: expected frequencies up to π/dt"),
    (lambda: sw.charts.bode(OSCILLATOR, dt=0.1, omega=[2.0, 1.0]), ArgumentError, "omega: expected frequencies that rise"),
    (lambda: sw.charts.bode(OSCILLATOR, dt=0.1, omega=1.0), ShapeError, "omega: expected a list of two or more frequencies"),
    (lambda: sw.charts.bode(sw.Oscillator([1.0, 2.0]), dt=0.1), ShapeError, "system: expected one member"),
    (lambda: sw.charts.bode(sw.LinearSystem([[1.0]]), dt=0.1), ArgumentError, "system: expected one with an input"),
    (lambda: sw.charts.bode(OSCILLATOR, dt=0.1, of=(1, 0)), ArgumentError, "of[0]: expected 0 or more, up to 0, got 1"),
    (lambda: sw.charts.bode(sw.Pendulum(), dt=0.1), UnsupportedError, "system: expected a linear one"),
]


def test_what_is_refused() -> None:
    assert_refused(WRONG)
