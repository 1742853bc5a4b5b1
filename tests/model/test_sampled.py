"""Sampled inputs: what a step sees of samples that are held, and of the curves through them."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnknownNameError
from stepwell.reference import signal
from support.for_each import for_each
from support.ways import assert_equal_ways

METHODS = sw.methods()
#: At the shortest steps here DOP853 and the series are at rounding; these show their order before.
ORDERS = {each.name: min(each.order, 5) for each in METHODS}
INTERVAL, SAMPLES, OMEGA, V, Y = 0.1, 20, 2.0, 0.3, 1.0
VALUES = np.random.default_rng(1).normal(size=SAMPLES)
END = INTERVAL * SAMPLES
EPS = 2.0**-52


def true_end(values: Any, start: float, omega: float = OMEGA) -> tuple[Any, Any]:
    """The oscillator ÿ = −ω²y + a at ``END``, piece by piece: about a/ω² it turns by ω·t, without a spring it is a parabola."""
    v, y, t = V, Y, 0.0
    for value, until in zip(values, [*(start + INTERVAL * np.arange(1, len(values))), END], strict=True):
        until = min(max(until, t), END)
        h, t = until - t, until
        if omega:
            c, s, rest = np.cos(omega * h), np.sin(omega * h), value / omega**2
            v, y = v * c - omega * (y - rest) * s, rest + (y - rest) * c + v / omega * s
        else:
            v, y = v + value * h, y + v * h + 0.5 * value * h * h
    return v, y


def error(method: str, steps: int, start: float = 0.0, omega: float = OMEGA, **options: Any) -> float:
    """Of the state at ``END``."""
    system = sw.Oscillator(omega, a=sw.Sampled(VALUES, INTERVAL, start), form="physical")
    run = sw.integrate(system, method, v=V, y=Y, dt=END / steps, steps=steps, **options)
    v, y = true_end(VALUES, start, omega)
    return float(max(abs(run.v[-1] - v), abs(run.y[-1] - y)))


@for_each("name", ORDERS)
def test_a_method_has_its_order_where_samples_begin_with_steps(name: str) -> None:
    """Halving the step divides the error by 2^p up to the next order, a tenth of it here; one order less would halve that."""
    coarse, fine = error(name, 80), error(name, 160)
    assert fine < max(coarse / 2.0 ** (ORDERS[name] - 0.3), 1e-11)


@for_each("steps", [20, 40, 100])
@for_each("name", ORDERS)
def test_without_a_spring_the_velocity_is_the_sum_of_the_samples(name: str, steps: int) -> None:
    """Every method adds h times the mean of its rates, so nothing but rounding of some hundred additions is left."""
    system = sw.Oscillator(0.0, a=sw.Sampled(VALUES, INTERVAL), form="physical")
    run = sw.integrate(system, name, v=V, y=Y, dt=END / steps, steps=steps)
    assert abs(run.v[-1] - (V + INTERVAL * VALUES.sum())) < 1000 * EPS


@for_each("share", [1e-9, 1e-7, 1e-6, 1e-5, -1e-6])
@for_each("name", ["rk4", "merson", "fehlberg_5", "dop853", "pefrl", "leapfrog"])
def test_samples_that_begin_a_little_off_a_step(name: str, share: float) -> None:
    """The mean over a step is that of the true input, so v is right at its end; the place errs by (h/2)·δ·|a₂ − a₁| a sample."""
    # The errors turn with the oscillator, which also makes v of y by ω; two more for what the method itself makes of them.
    steps, shift = 200, share * INTERVAL
    own = error(name, steps)
    bound = 2.0 * OMEGA * 0.5 * (END / steps) * abs(shift) * abs(np.diff(VALUES)).sum()
    assert error(name, steps, shift) < own * (1.0 + 100 * abs(share)) + bound + 1e-12


@for_each("name", [name for name, order in ORDERS.items() if order >= 2])
def test_elsewhere_the_error_is_of_second_order(name: str) -> None:
    """An error of each of 20 samples of at most (h²/8)·|a₂ − a₁|, the most that a mean leaves of a place, times ω for v."""
    for steps in (90, 170, 310, 610):
        h = END / steps
        own = error(name, 2 * steps) * 5.0  # of the method itself, of at least second order
        assert error(name, steps, 0.0137) < own + OMEGA * h * h / 8.0 * abs(np.diff(VALUES)).sum()


@for_each("name", ["rk4", "leapfrog", "verlet", "false_euler"])
def test_a_step_over_several_samples_sees_their_mean(name: str) -> None:
    """Without a spring v is then the integral of the samples, but for what begins and ends with half a step."""
    values = np.random.default_rng(2).normal(size=(200, 3))
    system = sw.Oscillator(0.0, a=sw.Sampled(values, 0.01, 0.003), form="physical")
    run = sw.integrate(system, name, v=V, y=Y, dt=0.07, steps=20)
    time = 0.07 * 20
    until = 0.003 + 0.01 * np.arange(201)
    lengths = np.diff(np.clip(until, 0.003, time))
    true = V + 0.003 * values[0] + lengths @ values
    # What carries something in place of v sees, at either end, the mean of a step for that of half a one.
    slack = 0.07 * np.abs(values).max() if sw.method(name).carry else 1000 * EPS
    assert np.abs(run.v[-1] - true).max() < slack


KINDS: dict[str, Any] = {
    "hold": {"interval": 0.1},
    "hold, not with steps": {"interval": 0.083, "start": 0.017},
    "hold, within steps": {"interval": 0.013},
    "linear": {"interval": 0.083, "interpolation": "linear"},
    "cubic": {"interval": 0.083, "interpolation": "cubic"},
}


pushed = sw.system(lambda t, v, y, *, push=0.0: push - y - 0.1 * y**3)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_goes_every_way(kind: str) -> None:
    """Small systems and a large one, by what looks inputs up: at stages, as a mean, as a series."""
    r = np.random.default_rng(5)
    common, own = sw.Sampled(r.normal(size=31), **KINDS[kind]), sw.Sampled(r.normal(size=(31, 3)), **KINDS[kind])
    options: dict[str, Any] = {"dt": 0.05, "steps": 19, "every": 5, "t0": -0.2}
    small = {"v": np.full(3, 0.1), "y": np.ones(3)}
    ways = ("by the reference", "in pieces", "in a world", "alone")
    oscillator = sw.Oscillator([1.0, 2.0, 3.0], a=common, x=own)
    for method in ("rk4", "verlet", "taylor", "semi_false_heun"):
        direct = assert_equal_ways(oscillator, method, **small, **options, ways=ways)
        assert_equal_ways(pushed(push=own), method, **small, **options, ways=ways)
        if kind != "hold, within steps" and method != "taylor":
            matrix = assert_equal_ways(oscillator, method, **small, **options, form="matrix", ways=ways[:1])
            assert matrix.y == pytest.approx(direct.y, abs=1e-11)
    large = sw.LinearSystem(-np.eye(140) + 0.1 * r.normal(size=(140, 140)) / 140, r.normal(size=(140, 2)), x=[common, own])
    start = np.ones((70, 3))
    assert_equal_ways(large, "rk4", v=start, y=start, dt=0.05, steps=7, ways=("by the reference", "in pieces"))


def test_large_own_equations() -> None:
    """Past what becomes one tape for a step: rates are told the window of the step that asks."""
    ring = sw.system(lambda t, v, y, *, push=0.0: push * np.cos(y) - (2.0 * y - np.roll(y, 1) - np.roll(y, -1)) ** 3)
    r = np.random.default_rng(3)
    for method, values in (("dop853", r.normal(size=30)), ("verlet", r.normal(size=(30, 2)))):
        # Past three samples: NumPy computes each of the 60 rates on its own.
        start = {"v": np.zeros((60, 2)), "y": r.normal(size=(60, 2))}
        assert_equal_ways(ring(push=sw.Sampled(values, 0.035)), method, **start, dt=0.01, steps=9, ways=("by the reference",))


def test_a_line_is_what_numpy_interpolates() -> None:
    times = np.linspace(-0.5, 2.5, 301)
    for values in (VALUES, np.random.default_rng(4).normal(size=(20, 3))):
        sampled = sw.Sampled(values, INTERVAL, 0.05, "linear")
        interpolated = np.array([sampled.signal().at(t) for t in times])
        rows = values.reshape(20, -1).T
        expected = np.stack([np.interp(times, sampled.times, row) for row in rows], axis=-1).reshape(interpolated.shape)
        # A slope times a time, and a sum: some roundings of values of a few units.
        np.testing.assert_allclose(interpolated, expected, atol=100 * EPS)


def test_cubics_go_through_the_samples_and_are_exact_for_polynomials_of_third_degree() -> None:
    times, inside = np.linspace(-0.5, 2.5, 301), np.linspace(0.0, 1.9, 97)
    sampled = sw.Sampled(VALUES, INTERVAL, 0.0, "cubic")
    signal_of = sampled.signal()
    for t, value in zip(sampled.times, VALUES, strict=True):
        assert abs(signal_of.at(t) - value) < 100 * EPS
    assert all(signal_of.at(t) == VALUES[0] for t in times[times < 0.0])
    assert all(signal_of.at(t) == VALUES[-1] for t in times[times > 1.91])
    cubic = np.polynomial.Polynomial([0.3, -1.0, 0.5, 2.0])
    of_cubic = sw.Sampled(cubic(sampled.times), INTERVAL, 0.0, "cubic").signal()
    for t in inside:
        assert abs(of_cubic.at(t) - cubic(t)) < 1e-13  # derivatives are differences of values over an interval of 0.1


@for_each(("interpolation", "order"), [("linear", 2), ("cubic", 4)])
def test_errors_of_curves_by_the_interval(interpolation: Any, order: int) -> None:
    """Of sin 3t: halving the interval divides the largest error by 2^p, up to a tenth for higher orders."""
    errors = []
    for n in (64, 128):
        at = np.linspace(0.0, 2.0, n + 1)
        curve = sw.Sampled(np.sin(3.0 * at), 2.0 / n, 0.0, interpolation).signal()
        errors.append(max(abs(curve.at(t) - np.sin(3.0 * t)) for t in np.linspace(0.0, 2.0, 997)))
    assert errors[1] < errors[0] / 2.0 ** (order - 0.2)


@for_each("n", [1, 2, 3, 4])
@for_each("interpolation", ["hold", "linear", "cubic"])
def test_few_samples(interpolation: Any, n: int) -> None:
    """Cubics of few samples are the polynomial through them, of as low a degree."""
    at = 0.25 * np.arange(n)
    polynomial = np.polynomial.Polynomial([1.0, 2.0, -1.0, 0.5][:n])
    sampled = sw.Sampled(polynomial(at), 0.25, 0.0, interpolation)
    run = sw.integrate(sw.Oscillator(a=sampled), "rk4", v=0.0, y=0.0, dt=0.05, steps=15)
    assert np.isfinite(run.y).all()
    if interpolation == "cubic":
        assert all(abs(sampled.signal().at(t) - polynomial(t)) < 1e-14 for t in np.linspace(0.0, at[-1], 9))


def test_smooth_inputs_keep_the_order_of_a_method() -> None:
    """Cubics through sin 3t at intervals of 0.3 steps, of fourth order as the method is; halving both divides the error by 16."""
    exact = sw.integrate(sw.Oscillator(2.0, a=sw.Sinusoid(1.0, 3.0), form="physical"), "dop853", v=V, y=Y, dt=0.005, steps=400)
    errors = []
    for steps in (40, 80):
        h = END / steps
        at = np.arange(4 * steps) * (0.3 * h) - 0.1
        driven = sw.Oscillator(2.0, a=sw.Sampled(np.sin(3.0 * at), 0.3 * h, -0.1, "cubic"), form="physical")
        errors.append(abs(sw.integrate(driven, "rk4", v=V, y=Y, dt=h, steps=steps).y[-1] - exact.y[-1]))
    assert errors[1] < errors[0] / 2.0**3.7


def test_jumps() -> None:
    """Held samples begin early by 2⁻⁴⁴ of the time since the first, as where they are looked up (HOLD_SLACK)."""
    sampled = sw.Sampled([0.0, 0.0, 1.0, 1.0, -1.0], 0.5, 1.0)
    begin = [1.0 + 1.0 / signal.HOLD_SLACK, 1.0 + 2.0 / signal.HOLD_SLACK]
    np.testing.assert_array_equal(sampled.jumps(0.0, 9.0), begin)
    np.testing.assert_array_equal(sampled.jumps(2.0, 2.9), [])
    np.testing.assert_array_equal(sampled.jumps(*begin), begin)
    np.testing.assert_array_equal(sw.Sampled([0.0, 1.0, 4.0], 0.5, 1.0, "linear").jumps(0.0, 9.0), [1.0, 1.5, 2.0])
    assert not len(sw.Sampled([1.0, 1.0], 0.5, 0.0, "linear").jumps(-1.0, 9.0))
    assert not len(sw.Sinusoid(1.0, 2.0).jumps(0.0, 9.0))
    system = pushed(push=sampled)
    np.testing.assert_array_equal(system.jumps(0.0, 9.0), begin)
    two = sw.Oscillator(a=sampled, x=sw.Sampled([[0.0, 0.0], [0.0, 1.0]], 2.0, 0.0))
    np.testing.assert_array_equal(two.jumps(0.0, 9.0), [2.0 / signal.HOLD_SLACK, *begin])
    assert not len(sw.Pendulum().jumps(0.0, 9.0))


def test_the_window_of_a_step_back() -> None:
    """It is that of the same stretch of time, stepped forward."""
    for carries in (False, True):
        assert signal.of_step(1.0, -0.25, carries)[:2] == (
            signal.of_step(0.75, 0.25, False)[:2] if not carries else (0.875, 1.125)
        )
        assert signal.of_step(1.0, -0.25, carries)[2] == 0.25
    assert signal.of_slot(1.0, 0.5) == (0.75, 1.0, 0.25)
    assert signal.of_slot(1.0, -0.5) == (1.0, 1.25, 0.25)


def test_what_is_between_is_said() -> None:
    assert "linear" in repr(sw.Sampled([0.0, 1.0], 1.0, interpolation="linear"))
    with pytest.raises(UnknownNameError, match=r"interpolation: there is no 'lineer'; did you mean 'linear'\?"):
        sw.Sampled([0.0, 1.0], 1.0, interpolation="lineer")  # type: ignore[arg-type]
    assert sw.Sampled([0.0, 1.0], 1.0) != sw.Sampled([0.0, 1.0], 1.0, interpolation="linear")


class Interrupted(BaseException):
    """As Ctrl-C raises one."""


@for_each("method", ["standard_heun", "verlet"])
def test_ctrl_c_between_any_two_lines_leaves_no_trace(method: str) -> None:
    """A run is interrupted at each line, call and return of what computes its steps; the next one sees the samples of its times.

    As Ctrl-C does in a notebook: where a window was set by one line and reset by another, all later runs saw old samples.
    """
    system = sw.Oscillator(a=sw.Sampled([0.0, 1.0, -2.0, 0.5], 0.1))
    options: dict[str, Any] = {"v": 0.0, "y": 0.0, "dt": 0.1, "steps": 2, "backend": "numpy"}
    expected = sw.integrate(system, method, **options).y
    places = ("signal.py", "context.py", "contextlib.py", "contact.py", "trace.py")
    count = 0

    def run(stop: int) -> bool:
        """Whether it ended before so many events."""
        nonlocal count
        count = 0

        def traced(frame: Any, event: str, _: Any) -> Any:
            nonlocal count
            if not frame.f_code.co_filename.endswith(places):
                return None
            count += 1
            if count == stop:
                raise Interrupted
            return traced

        before = sys.gettrace()
        sys.settrace(traced)
        try:
            sw.integrate(system, method, **options)
        except Interrupted:
            return False
        finally:
            sys.settrace(before)
        return True

    stop = 1
    while not run(stop):
        np.testing.assert_array_equal(sw.integrate(system, method, **options).y, expected)
        assert signal._WINDOW.get() is None
        stop += 1
    assert stop > 100  # all of its events were tried
