"""Switching times: comparisons of a function with the time are solved, and no adaptive step crosses them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from scipy.special import beta, ive
from stepwell.errors import AccuracyWarning, ToleranceWarning
from stepwell.model.equations import switching
from support.looped import looped
from support.ways import WAYS, assert_equal_ways

PAIRS = ["merson", "fehlberg", "fehlberg_5", "dop853"]


def times_of(function: Callable[..., Any], end: float = 60.0, **parameters: Any) -> Any:
    """The switching times from 0 to ``end`` of a system of first order with one number for a state."""
    times = np.sort(sw.system(order=1)(function)(**parameters).for_state_shapes((0,), ()).switching_times(0.0, end), axis=0)
    return times[(times >= 0.0) & (times <= end)] if times.ndim == 1 else times


#: Rates of the time, and when they switch from 0 to 60.
SOLVED: dict[str, tuple[Callable[..., Any], list[float]]] = {
    "a comparison": (lambda t, y: np.where((t > 5) & (t <= 7.25), 1.0, 0.0) - y, [5.0, 7.25]),
    "of a line": (lambda t, y: np.where(3.0 - 0.5 * t < -2.0, 1.0, 0.0) - y, [10.0]),
    "of a quotient": (lambda t, y: np.where(8.0 / (t + 1.0) < 2.0, 1.0, 0.0) - y, [3.0]),
    "of a distance": (lambda t, y: np.where(abs(t - 50.0) < 0.25, 1.0, 0.0) - y, [49.75, 50.25]),
    "of a square": (lambda t, y: np.where((t - 50.0) ** 2 < 0.0625, 1.0, 0.0) - y, [49.75, 50.25]),
    "of a cube": (lambda t, y: np.where((t - 50.0) ** 3 < 8.0, 1.0, 0.0) - y, [52.0]),
    "of a product with zero": (lambda t, y: np.where((t - 1.0) * (t - 4.0) * t < 0, 1.0, 0.0) - y, [0.0, 1.0, 4.0]),
    "of a root": (lambda t, y: np.where(np.sqrt(t) > 3.0, 1.0, 0.0) - y, [9.0]),
    "of a logarithm": (lambda t, y: np.where(np.log2(t + 1.0) > 3.0, 1.0, 0.0) - y, [7.0]),
    "of an exponential": (lambda t, y: np.where(np.exp2(-t) < 0.125, 1.0, 0.0) - y, [3.0]),
    "of a remainder": (lambda t, y: np.where(t % 20 < 0.5, 1.0, 0.0) - y, [0.0, 0.5, 20.0, 20.5, 40.0, 40.5, 60.0]),
    "of a sine": (
        lambda t, y: np.where(np.sin(0.25 * t) > 0.5, 1.0, 0.0) - y,
        [4 * (x + 2 * np.pi * k) for k in range(3) for x in (np.pi / 6, 5 * np.pi / 6)][:5],
    ),
    "a tent": (lambda t, y: np.maximum(0, 1 - abs(t - 50.0) / 0.5) - y, [49.5, 50.0, 50.5]),
    "whole numbers": (lambda t, y: np.floor(t / 16) + np.round(t / 16) - y, [0.0, 8.0, 16.0, 24.0, 32.0, 40.0, 48.0, 56.0]),
    "a square wave": (lambda t, y: t // 25 % 2 - y, [0.0, 25.0, 50.0]),
    "a sign": (lambda t, y: np.sign(t - 3.0) - y, [3.0]),
    "a clip": (lambda t, y: np.clip(t, 2.0, 9.0) - y, [2.0, 9.0]),
    "a table": (lambda t, y: np.interp(t, [4.0, 5.0, 8.0], [0.0, 3.0, 0.0]) - y, [4.0, 5.0, 8.0]),
    "with roundings of its own": (lambda t, y: np.where(t + 1e8 > 1e8 + 50, 1.0, 0.0) - y, [50.0 + 2**-27]),
    "the middle of a bell": (lambda t, y: np.exp(-(((t - 7.0) / 0.25) ** 2)) - y, [7.0]),
    "the middle of a ramp": (lambda t, y: np.tanh((t - 7.0) / 0.25) - y, [7.0]),
    "bells without an end": (lambda t, y: np.exp(np.cos(t) ** 2) + np.cosh(np.sin(t)) - y, []),
    "nothing": (lambda t, y: np.cos(t) - y, []),
    "by the state": (lambda t, y: np.where(t + y > 3.0, 1.0, 0.0) * np.abs(y), []),
    "within a function": (lambda t, y: np.sin(7.0 * t) * np.exp2(-1.0 - t) * np.arctan2(t, 2.0) - y, []),
}


@looped("what", SOLVED)
def test_times_are_solved(what: str) -> None:
    """To the roundings of the time, and of what is computed of it on the way: the comparison itself switches there."""
    function, expected = SOLVED[what]
    assert np.unique(times_of(function)) == pytest.approx(expected, rel=1e-15, abs=1e-15)


@looped("what", [each for each, (_, times) in SOLVED.items() if times and "middle" not in each])
def test_rates_switch_there(what: str) -> None:
    """A time that is solved is one at which another piece is taken, or a kink: both one-sided slopes or values differ."""
    function = SOLVED[what][0]
    system = sw.system(order=1)(function)().for_state_shapes((0,), ())
    rates = system.reference_at_step(1.0, ())
    for time in times_of(function):
        h = 1e-6
        values = [rates.dy(np.float64(time + k * h), np.empty(0), np.float64(0.0)) for k in (-2, -1, 1, 2)]
        jump, bend = values[2] - values[1], (values[3] - values[2]) - (values[1] - values[0])
        assert abs(jump) > 0.1 or abs(bend) > 0.1 * h, (time, values)


def test_parameters_of_each_member() -> None:
    """Times have the axes of the batch; a member without one has NaN."""
    times = times_of(
        lambda t, y, *, a=1.0, w=0.5: np.where((t - a) ** 2 < w, 1.0, 0.0) - y, a=[3.0, 5.0], w=[[4.0], [-1.0], [9.0]]
    )
    assert times.shape == (2, 3, 2)
    assert times[:, 0] == pytest.approx(np.array([[1.0, 3.0], [5.0, 7.0]]), rel=1e-15)
    assert np.isnan(times[:, 1]).all()
    assert times[:, 2] == pytest.approx(np.array([[0.0, 2.0], [6.0, 8.0]]), rel=1e-15, abs=1e-15)


def test_too_many_switches_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all members together, with one period more at each side."""
    fast = lambda t, y, *, period=1.0: np.where(t % period < 0.5 * period, 1.0, 0.0) - y  # noqa: E731
    monkeypatch.setattr(switching, "MOST_TIMES", 3000)
    for period, most in ((0.125, 3000), ([0.125, 0.25], 1500)):
        assert len(times_of(fast, end=(most - 3.0) * 0.125, period=period)) > most
        with pytest.warns(AccuracyWarning, match=r"switch by the time more than 3000 times in this run, .* max_step="):
            assert len(times_of(fast, end=(most + 3.0) * 0.125, period=period)) == 0


#: Bells and pulses that repeat, which steps would miss, and their integrals over 500 units of time.
REPEATING: dict[str, tuple[Callable[[Any], Any], float]] = {
    "bell, by a remainder": (lambda t: np.exp(-((((t % 10.0) - 5.0) / 0.01) ** 2)), 50.0 * 0.01 * math.sqrt(math.pi)),
    "von Mises' bell": (lambda t: np.exp(2000.0 * (np.cos(0.2 * np.pi * t) - 1.0)), 500.0 * ive(0, 2000.0)),
    "bell of a sine": (lambda t: np.exp(-1000.0 * np.sin(0.1 * np.pi * t) ** 2), 500.0 * ive(0, 500.0)),
    "von Mises' bell in full": (lambda t: np.exp(700.0 * np.cos(0.2 * np.pi * t) - 200.0) / np.exp(500.0), 500.0 * ive(0, 700.0)),
    "power": (lambda t: np.sin(0.2 * np.pi * t) ** 2000, 500.0 * beta(1000.5, 0.5) / np.pi),
    "peak": (lambda t: 1.0 / (1.0 + (np.sin(0.1 * np.pi * t) / 1e-3) ** 2), 500.0 / math.sqrt(1.0 + 1e6)),
    "pulses": (lambda t: np.where(t % 0.05 < 1e-5, 1.0, 0.0), 0.1),
}


@looped("name", REPEATING)
def test_narrow_bells_and_pulses_that_repeat_are_not_missed(name: str) -> None:
    pulses, expected = REPEATING[name]
    for method in ("dop853", "rodas5p"):
        run = sw.integrate(sw.system(order=1)(lambda t, y: pulses(t) + 0.0 * y), method, y=0.0, tolerance=1e-6, at=[500.0])
        assert run.y[-1] == pytest.approx(expected, rel=1e-3), method


def test_steps_do_not_end_at_the_turns_of_waves() -> None:
    """Neither of waves themselves, nor of what has their width; where parameters make it narrow for some members, for these."""
    for wave in (lambda t, y: np.sin(t) ** 2, lambda t, y: np.exp(np.cos(t)), lambda t, y: np.tanh(np.sin(t)) - y):
        assert np.isnan(times_of(wave, end=100.0)).all()
    times = times_of(lambda t, y, *, k=1.0: np.exp(k * (np.cos(t) - 1.0)) - y, end=100.0, k=[1.0, 100.0])
    assert np.isnan(times[:, 0]).all()
    of_second = np.unique(np.round(times[:, 1] / (2.0 * np.pi), 9))
    assert np.array_equal(of_second, np.arange(of_second[0], of_second[-1] + 1.0))
    assert of_second[0] <= 0.0
    assert of_second[-1] >= 15.0


@pytest.mark.filterwarnings("ignore:method")
@looped("method", ["DOP853", "Radau", "LSODA"])
def test_solve_ivp_has_the_same_switches(method: str) -> None:
    """Forwards and backwards, and between the ends of its steps."""
    pulse = lambda t, y: [np.where((t > 5.0) & (t < 5.01), 1.0, 0.0)]  # noqa: E731
    for options in ({}, {"dense_output": True}, {"t_eval": [0.0, 5.004, 20.0]}):
        found = sw.solve_ivp(pulse, (0.0, 20.0), [0.0], method=method, **options)
        assert found.y[0, -1] == pytest.approx(0.01, rel=1e-9)
    assert found.y[0, 1] == pytest.approx(0.004, rel=1e-9)
    back = sw.solve_ivp(pulse, (20.0, 0.0), [0.01], method=method, dense_output=True)
    assert back.sol([5.02, 5.004, 0.0])[0] == pytest.approx([0.01, 0.004, 0.0], rel=1e-9, abs=1e-11)


@looped("method", ["rodas5p", "rosenbrock23", "dop853", "taylor"])
def test_a_pulse_of_two_ramps_is_met_from_rest(method: str) -> None:
    """Where both are rounded to 1 the rates are zero, and so are their derivatives; then they jump by roundings."""
    for w, end in ((0.01, 5.2), (0.1, 5.4)):
        ramps: Any = lambda t, w=w, end=end: np.tanh((t - 5.0) / w) - np.tanh((t - end) / w)  # noqa: E731
        options: dict[str, Any] = {"y": 0.0, "tolerance": 1e-4, "at": [10.0], "max_steps": 10_000}
        run = sw.integrate(sw.system(order=1)(lambda t, y: ramps(t) + 0.0 * y), method, **options)  # noqa: B023
        assert run.y[-1] == pytest.approx(2.0 * (end - 5.0), rel=1e-3)
        run = sw.integrate(sw.system(lambda t, v, y: ramps(t) + 0.0 * y), method, v=0.0, **options)  # noqa: B023
        assert run.y[-1] == pytest.approx((end - 5.0) * (15.0 - end), rel=1e-3)


@sw.system(order=1)
def pulsed(t: Any, y: Any, *, a: float = 50.0, w: float = 0.3) -> Any:
    """Decay with a push of 20 from a on, for a time of w."""
    return np.where((t > a) & (t < a + w), 20.0, 0.0) - y


def solution(t: Any, a: Any, w: Any) -> Any:
    """From y(0) = 1: e^−t, and 20·(1 − e^−(t − a)) of the push while it lasts, which decays then."""
    lasted = np.clip(t - a, 0.0, w)
    return np.exp(-t) + 20.0 * -np.expm1(-lasted) * np.exp(-np.maximum(t - a - w, 0.0))


@looped("method", PAIRS)
def test_no_pulse_is_missed(method: str) -> None:
    """However short, and however far a state that is nearly at rest lets steps go."""
    # Some tens of steps at the edges may each err by the tolerance of the largest that y has been, 20 at most.
    random = np.random.default_rng(5)
    a, w = random.uniform(5.0, 190.0, 100), 10.0 ** random.uniform(-4.0, 0.5, 100)
    at = np.array([100.0, 200.0])
    run = sw.integrate(pulsed(a=a, w=w), method, y=1.0, tolerance=1e-8, at=at)
    assert run.y == pytest.approx(solution(at[:, np.newaxis], a, w), rel=1e-5, abs=1e-5 * 1e-8 + 40 * 20e-8)
    peak = sw.integrate(pulsed(a=a, w=w), method, y=1.0, tolerance=1e-8, at=(a + w)[np.newaxis])
    assert peak.y[0] == pytest.approx(solution(a + w, a, w), rel=1e-6, abs=4e-8)  # y was 1 at the start, which a step may err by


#: Smooth pushes about a middle m that last for some times of w, and their integrals over the time in units of w.
SMOOTH: dict[str, tuple[Callable[..., Any], float]] = {
    "a bell": (lambda t, y, *, m=7.0, w=0.01: np.exp(-(((t - m) / w) ** 2)) - y, np.sqrt(np.pi)),
    "a bell of factors": (lambda t, y, *, m=7.0, w=0.01: np.exp(-(t - m) * (t - m) / (2 * w * w)) - y, np.sqrt(2 * np.pi)),
    "two flanks": (lambda t, y, *, m=7.0, w=0.01: np.exp(-abs(t - m) / w) - y, 2.0),
    "a hyperbolic secant": (lambda t, y, *, m=7.0, w=0.01: 1 / np.cosh((t - m) / w) ** 2 - y, 2.0),
    "a logistic switch, on and off": (
        lambda t, y, *, m=7.0, w=0.01: 1 / (1 + np.exp((m - t) / w)) - 1 / (1 + np.exp((m + 5 * w - t) / w)) - y,
        5.0,
    ),
    "a ramp up and down": (lambda t, y, *, m=7.0, w=0.01: 0.5 * (np.tanh((t - m) / w) - np.tanh((t - m - 5 * w) / w)) - y, 5.0),
}


@looped("what, method", itertools.product(SMOOTH, PAIRS[::3]), long=itertools.product(SMOOTH, PAIRS[1:3]))
def test_no_smooth_push_is_missed(what: str, method: str) -> None:
    """Of a width w, y becomes ∫f dt·(1 + O(w)) at its end, and decays by less than 1 % in the 40 w that pass until then."""
    # Without the middle as a wall nine of ten are passed over.
    function, integral = SMOOTH[what]
    m, w = np.linspace(5.0, 45.0, 100), 10.0 ** -np.linspace(2.0, 5.0, 4)[:, np.newaxis]
    run = sw.integrate(sw.system(order=1)(function)(m=m, w=w), method, y=0.0, tolerance=1e-6, at=(m + 30 * w)[np.newaxis])
    assert run.y[0] / (integral * w) == pytest.approx(np.exp(-30 * w) * np.ones(m.shape), rel=0.1)


@looped("method", PAIRS)
def test_a_state_that_grows_out_of_zero(method: str) -> None:
    """Through the smallest numbers there are, of few bits: it is not held up there by errors that are roundings."""
    # Of some 700 e-foldings from there on, up to a push of 1, a method of fourth order takes ten steps each at most.
    function = SMOOTH["a bell"][0]
    run = sw.integrate(sw.system(order=1)(function)(m=20.0, w=0.1), method, y=0.0, tolerance=1e-6, at=[23.0])
    assert run.y[-1] == pytest.approx(0.1 * np.sqrt(np.pi) * np.exp(-3.0 + 0.0025), rel=1e-3)
    assert run.paces.accepted < 7000
    assert run.paces.rejected < 50


def test_a_stop_at_the_smallest_numbers_is_told() -> None:
    """What holds the step down is looked for there, too, without a division by zero."""
    with pytest.warns(ToleranceWarning, match="max_steps"):
        sw.integrate(sw.system(order=1)(lambda t, y: -y)(), "merson", y=1e-318, tolerance=1e-6, at=[100.0], max_steps=3)


@looped("method", PAIRS)
def test_an_excitable_cell_is_pulsed_at_its_equilibrium(method: str) -> None:
    """FitzHugh and Nagumo's equations from where nothing moves, with a push from 60 to 66: as with its jumps given."""

    @sw.system(order=1, shape=(2,))
    def cell(t: Any, y: Any, *, begin: float = 60.0, lasts: float = 6.0) -> Any:
        push = 0.6 * ((t >= begin) & (t <= begin + lasts))
        return np.array([y[0] - y[0] ** 3 / 3 - y[1] + push, 0.08 * (y[0] + 0.7 - 0.8 * y[1])])

    rest = np.array([-1.1994080352440346, -0.6242600440550432])
    run = sw.integrate(cell(), method, y=rest, tolerance=1e-6, at=[66.0, 80.0])
    with_jumps = sw.integrate(cell(), method, y=rest, tolerance=1e-6, at=[66.0, 80.0], jumps=[60.0, 66.0])
    assert np.array_equal(run.y, with_jumps.y)
    assert run.y[0, 0] > -0.9


@looped("method", PAIRS[::3])
def test_the_same_bits_in_every_way(method: str) -> None:
    a, w = np.array([50.0, 51.9, 20.0, 20.0, 50.0]), np.array([0.3, 0.01, 0.01, 0.3, 0.01])
    start, ways = {"v": np.zeros((0, 5)), "y": np.ones(5)}, [way for way in WAYS if way != "in a world"]
    assert_equal_ways(pulsed(a=a, w=w), method, **start, tolerance=1e-7, at=np.array([10.0, 49.0, 50.1, 52.0]), ways=ways)


@looped("method", PAIRS)
def test_periodic_pulses_in_pieces(method: str) -> None:
    """A run that ends goes on to switches that lay beyond its end: the next of them was its wall already."""
    ticking = sw.system(order=1)(lambda t, y, *, period=7.0: np.where(t % period < 0.01, 30.0, 0.0) - 0.1 * y)
    at = np.linspace(3.0, 60.0, 20)
    whole = sw.integrate(ticking(), method, y=1.0, tolerance=1e-7, at=at)
    pushes = 7.0 * np.arange(9)[:, np.newaxis]
    right = np.exp(-0.1 * at) + (300 * np.expm1(0.001) * np.exp(-0.1 * (at - pushes)) * (at > pushes)).sum(axis=0)
    assert whole.y == pytest.approx(right, rel=1e-5)
    for cut in (1, 7, 19):
        first = sw.integrate(ticking(), method, y=1.0, tolerance=1e-7, at=at[:cut])
        assert np.array_equal(sw.integrate(ticking(), method, at=at[cut:], resume=first).y, whole.y[cut:])


def test_switches_are_looked_for_once_for_all_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """What follows from the operations of a function holds for each of its systems; the times are those of its own numbers."""
    built: list[int] = []
    begin = switching.Switches.__init__

    def counted(self: Any, *arguments: Any) -> None:
        built.append(1)
        begin(self, *arguments)

    monkeypatch.setattr(switching.Switches, "__init__", counted)

    @sw.system(order=1)
    def charged(t: Any, y: Any, *, begin: Any = 1.0, rate: Any = 1.0) -> Any:
        return np.where((t > begin) & (t < begin + 0.01), 100.0 * rate, 0.0)

    for begin_of_pulse in (0.5, 1.0, 2.0, 3.7):
        run = sw.integrate(charged(begin=begin_of_pulse, rate=0.3), "dop853", y=0.0, tolerance=1e-6, at=[begin_of_pulse, 4.0])
        assert run.y == pytest.approx(np.array([0.0, 0.3]), abs=1e-9)
        assert charged(begin=begin_of_pulse).switching_times(0.0, 4.0).reshape(-1) == pytest.approx(
            [begin_of_pulse, begin_of_pulse + 0.01]
        )
    assert len(built) == 1
