"""Where events are: against closed forms, with the order of the method or with the tolerance; and mistakes that are noticed."""

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath
import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.base.arrays import Array
from stepwell.reference import events
from stepwell.runs.events import collected, trials
from stepwell.runs.events.evaluated import Evaluated
from stepwell.runs.events.trials import AdaptiveTrials, Trials
from support.events import ABLE, U, without_core  # noqa: F401
from support.stiff import lorenz

zero = sw.Event(lambda t, v, y: y, name="zero")


def shares_of(g: Callable[[Any], Any], n: int = 1) -> tuple[Any, int]:
    """The shares found for a function of the share that rises through zero, and how many trials that took."""
    trials = 0

    def trial(which: Any, share: Any) -> Any:
        nonlocal trials
        trials += 1
        assert trials < 10_000  # of a search that does not end
        return g(share), share[np.newaxis], -share[np.newaxis]

    ends = np.zeros(n), np.ones(n)
    share, v, y = events.located(trial, *ends, g(ends[0]), g(ends[1]), np.ones((1, n)), -np.ones((1, n)))
    np.testing.assert_array_equal(v[0], share)  # the state is that of the share
    np.testing.assert_array_equal(y[0], -share)
    return share, trials


#: Functions of a share that rise through zero at 0.3 alone, at which secants go astray.
HARD: dict[str, Callable[[Any], Any]] = {
    "a jump": lambda s: np.where(s < 0.3, -1.0, 1.0),
    "a high jump": lambda s: np.where(s < 0.3, -1e-300, 1e300),
    "flat": lambda s: (s - 0.3) ** 9,
    "steep at the end": lambda s: np.expm1(200.0 * (s - 0.3)),
    "a pole": lambda s: -1.0 / (0.3 - s),
    "infinite at both ends": lambda s: np.where(s <= 0.0, -np.inf, np.where(s >= 1.0, np.inf, s - 0.3)),
    "NaN before it": lambda s: np.where((s < 0.3) & (s > 0.0), np.nan, s - 0.3),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_no_function_takes_more_trials_than_bisection_and_eight() -> None:
    """Bisection of 1 down to 2⁻⁴⁸ takes 48, and from there to 2⁻⁵²·0.3 another 6. The first round may be eight trials behind it,
    and a later one two, since it reckons in powers of two. Ends of brackets are floating-point numbers: half of three spacings is
    two of them, which takes one more. What is returned is at or past the zero, by no more than the roundings of 0.3.
    """
    for name, g in HARD.items():
        (share,), trials = shares_of(g)
        assert trials <= (48 + 8) + (6 + 2) + 1, name
        # (s − 0.3)⁹ is 0 where it underflows, |s − 0.3| < 10⁻³⁶: not beside 0.3, whose neighbours are 5·10⁻¹⁷ away.
        assert 0.3 - U <= share <= 0.3 * (1.0 + events.SPACING) + U, name


def test_a_change_near_the_start_of_a_step_is_located_to_its_own_roundings() -> None:
    """However short a part of the step it is: a bracket that is a share of the whole step would have no digit of it. Bisection
    takes log₂(1/root) + 52 trials, and two more in each round of 48 halvings.
    """
    for root in (1e-3, 1e-9, 1e-20, 1e-100, 1e-250):
        (share,), trials = shares_of(lambda s, root=root: s - root)
        assert root <= share <= root * (1.0 + 2.0 * events.SPACING)
        (share,), all_trials = shares_of(lambda s, root=root: np.where(s < root, -1.0, 1.0))
        assert root <= share <= root * (1.0 + 2.0 * events.SPACING)
        halvings = np.log2(1.0 / root) + 53
        assert trials <= all_trials <= halvings + 2 * np.ceil(halvings / 48), root


def test_smooth_functions_take_few_trials_and_members_do_not_matter() -> None:
    """Nearly straight, as g is within a step: ten trials for a member, where bisection would take 48."""
    roots = np.linspace(0.001, 0.999, 97)

    def g(share: Any, root: Any = roots) -> Any:
        return (share - root) * (1.0 + 0.3 * share)

    trials = 0

    def trial(which: Any, share: Any) -> Any:
        nonlocal trials
        trials += len(which)
        return g(share, roots[which]), share[np.newaxis], share[np.newaxis]

    one, ends = np.ones((1, len(roots))), (np.zeros(97), np.ones(97))
    share = events.located(trial, *ends, g(ends[0]), g(ends[1]), one, one)[0]
    assert trials <= 10 * len(roots)
    assert (np.abs(share - roots) <= 2.0 * events.SPACING * roots).all()
    for i in (0, 50, 96):
        (alone,), _ = shares_of(lambda s, i=i: g(s, roots[i]))
        assert alone == share[i]


def polynomial(order: int) -> Callable[[Any], Any]:
    """The multiple of a mode in a step of a Runge-Kutta method of so many stages and that order, up to 4."""
    return lambda x: sum(x**j / mpmath.factorial(j) for j in range(order + 1))


@pytest.mark.parametrize(("method", "order"), [("standard_euler", 1), ("standard_heun", 2), ("rk4", 4)])
def test_the_place_is_that_of_a_step_of_the_method_from_the_start_of_its_step(method: str, order: int) -> None:
    """For ẏ = v, v̇ = −y, z = y + iv becomes R(−ih)·z in a step, so that the zero of y after k steps and a share s of one solves
    Re(R(−ish)·R(−ih)ᵏ) = 0, which is solved in 30 digits. Bound: a step makes at most 40 roundings of numbers of size up to 1.5
    (Standard Euler grows to 1.2 up to t = 4), which move y by at most 60·U; y moves at a speed of 0.9 or more at its zero, so t
    is off by at most 67·U·(k + 1), and by the width, and by the rounding of t.
    """
    h = 0.1
    down = sw.Event(lambda t, v, y: y, direction=-1, name="down")
    run = sw.integrate(sw.Oscillator(), method, v=0.0, y=1.0, dt=h, steps=40, events=down)
    place = run.events["down"]
    with mpmath.workdps(30):
        step, k = polynomial(order), int(place.step[0])
        z = step(mpmath.mpc(0, -mpmath.mpf(h))) ** k
        share = mpmath.findroot(lambda s: (step(mpmath.mpc(0, -s * mpmath.mpf(h))) * z).real, (0.0, 1.0), solver="anderson")
        t = k * mpmath.mpf(h) + share * mpmath.mpf(h)
        there = step(mpmath.mpc(0, -share * mpmath.mpf(h))) * z
        bound = 67 * U * (k + 1) + events.SPACING * h + 4 * U * float(t)
        assert abs(float(mpmath.mpf(float(place.t[0])) - t)) <= bound
        assert abs(place.v[0] - float(there.imag)) <= bound
    assert -2 * bound <= place.y[0] <= 2 * bound


# Against the true motion, with the order of the method or with the tolerance.
#: A quarter of the period of a pendulum that begins at 1 rad, at rest: π/2/agm(1, cos ½) (Gauss).
QUARTER = float(mpmath.pi / 2 / mpmath.agm(1, mpmath.cos(0.5)))
half = sw.Event(lambda t, v, y: y - 0.5, name="half")


by_time = sw.system(lambda t, v, y, *, amplitude=1.0: -amplitude * np.cos(t))


def fixed(dt: float, end: float) -> dict[str, Any]:
    return {"dt": dt, "steps": round(end / dt)}


def pendulum(method: str, dt: float) -> float:
    """By how much the fourth passage of a pendulum through its lowest point is off."""
    run = sw.integrate(sw.Pendulum(), method, v=0.0, y=1.0, **fixed(dt, 13.0), events=zero)
    return abs(float(run.events["zero"].t[3]) - 7.0 * QUARTER)


def passage(method: str, tolerance: float) -> tuple[float, float]:
    """By how much it is late, and by how much it is so by the state at the right time."""
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": tolerance}
    run = sw.integrate(sw.Pendulum(), method, **ask, at=[13.0], events=zero)
    there = sw.integrate(sw.Pendulum(), method, **ask, at=[7.0 * QUARTER])  # the last time has the order of the method
    return float(run.events["zero"].t[3]) - 7.0 * QUARTER, float(-there.y[0] / there.v[0])


def pericentre(method: str, **steps: Any) -> float:
    """By how much a planet of eccentricity 1/2 that begins at its apocentre is early or late at its pericentre, π later."""
    event = sw.Event(lambda t, v, y: y[1, 0] * v[1, 0] + y[1, 1] * v[1, 1], direction=1, name="pericentre")
    v, y = (np.array([[0.0, 0.0], each]) for each in ([0.0, (1 / 3) ** 0.5], [1.5, 0.0]))
    run = sw.integrate(sw.NBody([1.0, 0.0], force="newton"), method, v=v, y=y, events=event, **steps)
    return abs(float(run.events["pericentre"].t[0]) - np.pi)


def driven(method: str, **steps: Any) -> float:
    """The same of y = cos t, driven by v̇ = −cos t alone, at y = 1/2: the time counts."""
    run = sw.integrate(by_time(), method, v=0.0, y=1.0, events=half, **steps)
    return abs(float(run.events["half"].t[0]) - np.pi / 3)


#: The longest step, short enough that the error is nearly c·hᵖ, and long enough that it is far above the roundings.
STEP = {9: 0.8, 8: 0.8, 7: 0.3, 5: 0.1, 4: 0.1, 3: 0.05, 2: 0.02, 1: 0.005}


def order_of(error: Callable[[str, float], float], method: str, dt: float) -> float:
    """By what power of the step the error falls, from two halvings; the places of events within their steps make it uneven."""
    return float(np.log2(error(method, dt) / error(method, dt / 4)) / 2)


def order_of_driven(method: str) -> float:
    return order_of(lambda method, dt: driven(method, **fixed(dt, 2.0)), method, STEP[sw.method(method).order])


def test_events_of_fixed_steps_have_the_order_of_the_method() -> None:
    for method in sw.methods():
        assert order_of(pendulum, method.name, STEP[method.order]) > method.order - 0.3, method
    for name in ("leapfrog", "verlet", "standard_heun", "rk4", "pefrl", "fehlberg", "fehlberg_5"):
        order = sw.method(name).order
        # The error of Fehlberg's method changes its sign at a step of about 0.1.
        dt = (0.5 if order < 5 else 0.25) * STEP[order]
        assert order_of(lambda name, dt: pericentre(name, **fixed(dt, 4.0)), name, dt) > order - 0.3, name
    for name in ("false_euler", "leapfrog", "verlet", "standard_heun", "rk4", "pefrl"):
        assert order_of_driven(name) > sw.method(name).order - 0.3, name


#: From the coarsest tolerance at which the error is nearly a power of it to where roundings show.
TOLERANCES = 10.0 ** -np.arange(5.0, 10.0)


@pytest.mark.parametrize("method", ABLE)
def test_the_error_of_the_time_follows_the_tolerance_and_is_that_of_the_motion(method: str) -> None:
    """As that of states does (test_adaptive). And a motion that is off by δ at the time of the passage passes later by −δ/v, to
    first order: the second is δ²·|v̇|/(2v³), with v near 1 and v̇ near 0 there, less than δ². Both lie in one step, or in two
    whose errors differ: of each step's error a share at most, which the tolerance bounds, counted twice with the roundings.

    Of a method of order 2 with an estimate of the third order, h³ follows the tolerance, and the error h².
    """
    of_second = sw.method(method).order == 2
    passages = [passage(method, tolerance) for tolerance in TOLERANCES]
    slope = np.polyfit(np.log10(TOLERANCES), np.log10([abs(late) for late, _ in passages]), 1)[0]
    assert (0.6 if of_second else 0.7) < slope < 1.3
    for late, by_state in passages:
        assert abs(late - by_state) < by_state**2 + 1e-3 * abs(by_state) + 100 * U
    # The error of a planet falls by four decades or more over six of the tolerance, and ends within a thousand tolerances; by a
    # method of order 2 by less than four and within ten thousand.
    coarse, fine = (pericentre(method, tolerance=tolerance, at=[4.0]) for tolerance in (1e-4, 1e-10))
    falls, ends = (1e-3, 1e-6) if of_second else (1e-4, 1e-7)
    assert fine < falls * coarse
    assert fine < ends


def driven_to_a_tolerance(method: str) -> None:
    """Some 100 steps at most, each off by 10⁻¹⁰ of numbers up to 1, and y passes at a speed of 0.87."""
    assert driven(method, tolerance=1e-10, at=[2.0]) < 100 * 1e-10, method


def bounces_are_right(method: str) -> None:
    """All these methods are exact for a parabola; each flight adds some roundings of numbers up to 4 in each of some 30 steps,
    and those of the speed are halved.
    """
    assert error_of_bounces("rk4", dt=0.01, steps=400) < 1000 * 4 * U
    assert error_of_bounces(method, tolerance=1e-9, at=[10.0]) < 6 * 30 * 4 * 4 * U, method


def test_a_driven_motion_and_bounces_of_adaptive_steps() -> None:
    for method in ABLE:
        driven_to_a_tolerance(method)
        bounces_are_right(method)


def error_of_bounces(method: str, t: float = 0.0, **steps: Any) -> float:
    """Falling from 1 under gravity 1, bouncing with half of the speed: at √2·(1, 1 + 1, 1 + 1 + 1/2, …).

    Times asked for with ``at`` count from the bounce before.
    """
    ball = sw.system(lambda t, v, y, *, gravity=1.0: -gravity)
    ground = sw.Event(lambda t, v, y: y, direction=-1, terminal=True, name="ground")
    v, y, times = 0.0, 1.0, []
    for _ in range(6):
        ask = steps | ({"at": [t + each for each in steps["at"]]} if "at" in steps else {})
        run = sw.integrate(ball(), method, v=v, y=y, t0=t, events=ground, **ask)
        v, y, t = -0.5 * float(run.v[-1]), float(run.y[-1]), float(run.stopped_at)
        assert -1e-13 < y <= 0.0  # at or past the ground
        times.append(t)
    expected = 2**0.5 * (1.0 + 2.0 * np.concatenate([[0.0], np.cumsum(0.5 ** np.arange(1, 6))]))
    return float(np.abs(np.array(times) - expected).max())


@sw.system(order=1)
def integrated(t: Any, y: Any, *, a: float = 0.0, b: float = 0.0, c: float = 0.0) -> Any:
    """ẏ = p'(t) for the polynomial p with these roots, so that y = p(t)."""
    return (t - a) * (t - b) + (t - a) * (t - c) + (t - b) * (t - c)


def there(t: Any, y: Any) -> Any:
    return y


def roots_by(method: str, roots: Any, begin: float, **steps: Any) -> Any:
    """Where y is zero, from a time before."""
    y = float(np.prod(begin - np.array(roots)))
    run = sw.integrate(integrated(a=roots[0], b=roots[1], c=roots[2]), method, y=y, t0=begin, events=there, **steps)
    return run.events["there"].t


def two_changes_in_an_adaptive_step(method: str, tolerance: float, cubics: int = 12) -> None:
    """A method of third order or more makes no error in a cubic, so that its steps grow as long as they may: of twelve cubics the
    changes of sign come in pairs in one step, at any place of it. Bound: y is off by the roundings of a hundred numbers up to
    8.4³ < 600, and moves by 0.02² a unit of time or more at its zeros, which are 0.02 apart or more.
    """
    random = np.random.default_rng(5)
    for _ in range(cubics):
        roots = np.cumsum(0.02 + 0.1 * random.random(3))
        zeros = roots_by(method, roots, -8.0, tolerance=tolerance, at=[8.0])
        np.testing.assert_allclose(zeros, roots, rtol=0, atol=100 * 600 * U / 0.02**2, err_msg=method)


def test_two_changes_of_sign_in_an_adaptive_step_are_found() -> None:
    for method in ABLE:
        if sw.method(method).order >= 3:
            two_changes_in_an_adaptive_step(method, 1e-3, 6)
            two_changes_in_an_adaptive_step(method, 1e-9, 2)


def test_two_changes_of_sign_in_a_step_of_fixed_length_are_found() -> None:
    """ẏ = 3t² + 12t − 4 from y(−8) = −120 on; with steps of 6 and 12 a zero is at an end of a step, or all are in one."""
    for method in sw.methods():
        for dt in (0.7, 3.0, 6.0, 12.0) if method.order >= 3 and not method.needs_acceleration else ():
            zeros = roots_by(method.name, [-6.0, -2.0, 2.0], -8.0, dt=dt, steps=int(np.ceil(12.0 / dt)))
            np.testing.assert_allclose(zeros, [-6.0, -2.0, 2.0], rtol=0, atol=1e-12, err_msg=f"{method}, {dt}")


def test_the_core_notices_a_step_there_and_back() -> None:
    """Of a hundred members, each of which is below zero for a hundredth of a step: found as by looking at every state.

    y = (t − a)² − b² has its zeros at a ± b; Heun's method makes no error in it.
    """
    valley = sw.system(order=1)(lambda t, y, *, a=0.0: 2.0 * (t - a))
    a, b = np.linspace(3.0, 8.0, 100), 5e-4
    run = sw.integrate(valley(a=a), "standard_heun", y=a * a - b * b, dt=0.1, steps=100, events=there)
    assert (run.events["there"].count == 2).all()
    # y is off by the roundings of a hundred numbers up to 64, and moves at 2b = 1e-3.
    bound = 100 * 64 * U / 1e-3
    np.testing.assert_allclose(run.events["there"].t.reshape(-1, 2), np.stack([a - b, a + b], -1), rtol=0, atol=bound)


def test_a_touch_without_a_change_of_sign_is_no_event() -> None:
    """y = (t − 1)² + c for c = 10⁻⁶ and 0, seen by steps of 0.3; of the second only roundings could be found, and none of another
    size.
    """
    parabola = sw.system(order=1)(lambda t, y: 2.0 * (t - 1.0))
    above = sw.integrate(parabola(), "rk4", y=1.0 + 1e-6, dt=0.3, steps=8, events=there)
    assert above.events["there"].count == 0
    touches = sw.integrate(parabola(), "rk4", y=1.0, dt=0.3, steps=8, events=there).events["there"]
    assert (np.abs(touches.y) < 10 * U).all()
    assert (np.abs(touches.t - 1.0) < 10 * U**0.5).all()


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
def test_mistake_a_step_whose_ends_have_one_sign_is_not_looked_into(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "bends", lambda parts: np.zeros(len(parts.of), dtype=bool))
    with pytest.raises(AssertionError):
        two_changes_in_an_adaptive_step("merson", 1e-3)
    with pytest.raises(AssertionError):
        test_the_core_notices_a_step_there_and_back()


def test_a_way_from_rest_takes_its_time_in_any_unit() -> None:
    """y = t²/2 in some unit of time is at a length after √(2·length), also where that is a tiny share of the first step.

    RK4 and Merson are exact for a parabola from rest: y is off by some ten roundings of itself in the step of the event, and by
    the roundings of the steps before it, of numbers up to y: at most 3·k of them after k steps. Half of that counts for the time.
    """
    from_rest = sw.system(lambda t, v, y, *, a=1.0: a)
    every = {"dt": 1.0, "steps": 3}, {"dt": 1e-3, "steps": 3000}, {"tolerance": 1e-9, "at": [3.0]}
    for steps, unit, length in itertools.product(every, (1e-100, 1e-13, 1.0, 1e9), (1.0, 1e-20, 1e-100)):
        ask = {name: (np.array(each) * unit if name in ("dt", "at") else each) for name, each in steps.items()}
        there = sw.Event(lambda t, v, y, length=length: y - length, terminal=True, name="there")
        method = "rk4" if "dt" in ask else "merson"
        run = sw.integrate(from_rest(a=1.0 / unit / unit), method, v=0.0, y=0.0, events=there, **ask)
        right = (2.0 * length) ** 0.5 * unit
        k = right / ask["dt"] if "dt" in ask else 1000.0
        assert abs(float(run.stopped_at) / right - 1.0) < (20.0 + 3.0 * k) * U, (steps, unit, length)


def test_events_are_located_in_any_unit_of_time() -> None:
    """cos ωt passes zero at odd quarters of its period."""
    for method, omega in itertools.product(ABLE, (1.0, 1e13, 1e40, 1e-20)):
        run = sw.integrate(sw.Oscillator(omega), method, v=0.0, y=1.0, tolerance=1e-10, at=[10.0 / omega], events=zero)
        # Of a method of order 2 whose estimate is of the third order, h³ follows the tolerance, and the error h².
        within = 1e-6 if sw.method(method).order == 2 else 1e-8
        passed = run.events["zero"].t * omega / np.pi
        np.testing.assert_allclose(passed, [0.5, 1.5, 2.5], rtol=within, err_msg=f"{method}, {omega}")


def straight(trial: Any, low: Any, high: Any, before: Any, after: Any, v: Any, y: Any) -> Any:
    """Mistake: by a straight line between both ends of the step."""
    share = before / (before - after)
    return (share, *trial(np.arange(len(before)), share)[1:])


def low_end(trial: Any, low: Any, high: Any, before: Any, after: Any, v: Any, y: Any) -> Any:
    """Mistake: the end of the bracket that is before the event."""
    share, *_ = events.located(trial, low, high, before, after, v, y)
    share = share * (1.0 - 2.0 * events.SPACING)
    return (share, *trial(np.arange(len(before)), share)[1:])


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
def test_mistake_a_straight_line_has_order_two(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collected, "located", straight)
    assert order_of_driven("rk4") < 3.5
    with pytest.raises(AssertionError):
        test_the_error_of_the_time_follows_the_tolerance_and_is_that_of_the_motion("dop853")


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
def test_mistake_the_end_before_the_event_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collected, "located", low_end)
    with pytest.raises(AssertionError):
        error_of_bounces("rk4", dt=0.01, steps=400)
    with pytest.raises(AssertionError):
        error_of_bounces("merson", tolerance=1e-9, at=[10.0])


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
def test_mistake_trials_at_another_time_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    for each in (Trials, AdaptiveTrials):
        step = each.step
        monkeypatch.setattr(each, "step", lambda self, index, t, *rest, step=step: step(self, index, 0.0 * t, *rest))
    assert order_of_driven("rk4") < 3.5
    with pytest.raises(AssertionError):
        driven_to_a_tolerance("merson")


@pytest.mark.mutant
def test_mistake_trials_from_the_carry_of_the_full_step_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Verlet's previous y is one of h ago; with it, a step of another length is wrong by a share of the whole way."""

    def wrong(plan: Any, s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
        full = plan.system.scaled(plan.dt, plan.batch)
        slot = plan.method.steps.start(full, plan.choice, t, v, y)
        slot, y = plan.method.steps.step(s, t, h, slot, y)
        return plan.method.steps.finish(s, plan.choice, t + h, slot, y), y

    monkeypatch.setattr(trials, "stepped", wrong)
    monkeypatch.setattr(trials, "MEMBERS_BY_CORE", 0)
    assert order_of(pendulum, "verlet", STEP[2]) < 1.7


@pytest.mark.mutant
@pytest.mark.usefixtures("without_core")
def test_mistake_a_zero_that_counts_at_both_ends_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:

    def twice(look: Any, parts: Any) -> Any:
        changes, stuck = events.parted(look, parts)
        begins = parts.some(parts.g_low == 0.0)
        return events.joined([begins._replace(high=begins.low, g_low=-np.sign(begins.slope_low)), changes]), stuck

    monkeypatch.setattr(collected, "parted", twice)
    run = sw.integrate(integrated(), "standard_heun", y=0.0, dt=1.0, steps=8, events=there)
    assert run.events["there"].count > 0  # at the start


@pytest.mark.mutant
def test_mistake_a_secant_without_a_bound_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regula falsi alone: one end of the bracket stays where it is."""

    def secant(low: Any, high: Any, g_low: Any, g_high: Any, edge: Any, *_: Any) -> Any:
        return np.clip((g_high * low - g_low * high) / (g_high - g_low), low + 0.5 * edge, high - 0.5 * edge)

    monkeypatch.setattr(events, "next_trial", secant)
    with pytest.raises(AssertionError):
        shares_of(HARD["steep at the end"])


def test_a_step_beyond_stability_is_not_looked_into_without_end() -> None:
    """Slopes that say nothing of g would halve every part: 2²⁶ of them, in one step of a run that diverges."""
    evaluations = 0

    def look(of: Any, share: Array) -> tuple[Array, Array, Array, Array]:
        nonlocal evaluations
        evaluations += len(share)
        return share + 1.0, np.full(len(share), -1e30), share[None], share[None]

    one, ends = np.ones(1), np.zeros((1, 1))
    parts = events.Parts(np.zeros(1, dtype=int), 0.0 * one, one, one, 2.0 * one, -1e30 * one, -1e30 * one, ends, ends)
    brackets, stuck = events.parted(look, parts)
    assert not len(brackets.of)
    assert not len(stuck)
    assert evaluations <= 2 * events.MOST_PARTS


def test_events_of_a_run_that_diverges_end_and_leave_its_bits() -> None:
    run = partial(sw.integrate, lorenz(), "false_euler", y=[2.8, 3.1, 2.2], dt=0.05, steps=60, every=10)
    with pytest.warns(sw.DivergenceWarning):
        located = run(events=lambda t, y: y[1] - 1.0)
    with pytest.warns(sw.DivergenceWarning):
        assert np.array_equal(run().y, located.y, equal_nan=True)
    assert located.status == sw.Status.DIVERGED


def test_values_by_the_core_are_those_line_by_line():
    """Of any number of members, with numbers that they share, of two axes, and with values that are leaves or equal."""
    tape = _core.Tape()
    x, y, p = tape.state(0), tape.state(1), tape.param(0)
    values = [(x * y + p).sqrt() / (y - 0.25), x, x, p, (x < y).choose(x, p * 3.0), tape.number(2.0), x * y + p]
    core, lines = (Evaluated(tape, values, 2, by_core=by_core) for by_core in (True, False))
    rng = np.random.default_rng(3)
    for shape in [(), (1,), (7,), (64,), (3, 1001)]:
        own, shared = rng.normal(size=shape), rng.normal(size=shape[-1:])
        for numbers in [([own, shared], [0.5]), ([shared, own], [rng.normal(size=shape)]), ([0.25, own], [np.array(0.1)])]:
            for a, b in zip(core(*numbers), lines(*numbers), strict=True):
                np.testing.assert_array_equal(np.broadcast_to(a, shape), np.broadcast_to(b, shape))
    evaluation = tape.evaluation(values, 2)
    with pytest.raises(sw.errors.ArgumentError, match="expected one number or 3, got 2"):
        evaluation(3, [np.zeros(2), 1.0], [1.0])
    assert tape.evaluation([tape.time() * x], 2) is None


def test_steps_of_many_bodies_are_not_traced_for_their_events(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a tape 150 bodies are half a million operations, which Python writes in a second; the core has loops for them."""
    monkeypatch.setattr(trials, "Evaluated", None)  # would be called
    y = np.random.default_rng(1).normal(size=(150, 3))
    near = sw.Event(lambda t, v, y: y[0, 0] - 0.3 * y[1, 0], name="near")
    bodies, state = sw.NBody(np.full(150, 1 / 150), softening=0.1), {"v": np.zeros_like(y), "y": y}
    run = sw.integrate(bodies, "leapfrog", **state, dt=0.01, steps=300, events=near)
    assert run.events["near"].count == 1
    sw.integrate(bodies, "dop853", **state, tolerance=1e-6, at=[2.0], events=near)
