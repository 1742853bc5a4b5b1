"""Friction that sticks (§8): where blocks stop, that they stay, when they begin to slide, and what Verlet would do instead."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.reference import friction
from stepwell.views import charts
from stepwell.views.charts.verlet_friction import secant_verlet
from support.calls import assert_raises
from support.looped import looped
from support.mistakes import mistaken

ABLE = [method for method in sw.methods() if not method.needs_acceleration]
REFUSED = [method.name for method in sw.methods() if method.needs_acceleration]
EULER = {"standard_euler": 0.5, "damped_euler": 0.5, "false_euler": -0.5}


def block(friction: Any = 0.5 * 9.81, **more: Any) -> sw.Oscillator:
    return sw.Oscillator(0.0, friction=friction, form="physical", **more)


# ---- stopping distances (FACTS §5)


@looped("method, stop", [("false_euler", 0.8926), ("standard_euler", 0.9426)])
def test_where_a_block_stops_by_eulers_methods(method: str, stop: float) -> None:
    """v₀ = 3, μ = 0.5, h = 1/60; the exact place is 0.9174."""
    run = sw.integrate(block(), method, v=3.0, y=0.0, dt=1 / 60, steps=60, every=1)
    assert round(float(run.y[-1]), 4) == stop
    scene = sw.scenes.sliding_block()
    assert round(float(scene.exact(np.array([2.0]))[1][0]), 4) == 0.9174
    assert run.t[np.argmax(run.v == 0.0)] == pytest.approx(3.0 / 4.905, abs=1 / 60)


@looped("method, h", itertools.product(ABLE, [1 / 60, 0.01, 0.003]))
def test_where_a_block_stops_by_every_method(method: sw.Method, h: float) -> None:
    """Euler's methods err by ∓½hv₀ and less than the way of a step at a speed of l = hμg.

    Others, of second order at least, have the true v and y while they slide, for these are polynomials of second degree.
    That ends when a stage has a velocity below l, which none has while v > 2l: a stage is at most a step ahead. What is left then
    is a way of 2lh in truth, and of at most three steps of 2lh each in the run.
    """
    run = sw.integrate(block(), method, v=3.0, y=0.0, dt=h, steps=math.ceil(1.0 / h), every=1)
    wrong = float(run.y[-1]) - 9.0 / 9.81
    way = 4.905 * h * h
    if method.order == 1:
        side = EULER.get(method.name, -0.5)  # False Heun uses the new v for y, as False Euler does
        assert abs(wrong - side * 3.0 * h) < 2 * way
    else:
        assert abs(wrong) < 6 * way
    assert (run.v[run.t > 3.0 / 4.905 + 2 * h] == 0.0).all()


def test_where_drag_stops_a_block() -> None:
    """v₀/d by Standard Euler, a geometric series; False Euler has −hv₀ of it. Drag alone, and 2Dω₀ = d on a weak spring."""
    # After n = 6000 steps 0.99ⁿ is below 10⁻²⁶; what is left are some n roundings of a sum below 6.
    h, d, n = 0.02, 0.5, 6000
    system = sw.Oscillator(0.0, drag=d, form="physical")
    for method, stop in (("standard_euler", 3.0 / d), ("false_euler", 3.0 / d - h * 3.0)):
        run = sw.integrate(system, method, v=3.0, y=0.0, dt=h, steps=n)
        assert abs(run.y[-1] - stop) < n * 6 * 2.0**-53
    options: list[tuple[float, dict[str, Any]]] = [
        (0.3, {"damping": 0.2, "form": "physical"}),
        (0.3, {"drag": 0.6, "form": "physical"}),
        (0.3 / 1.5, {"drag": 0.6}),
    ]
    ends = [sw.integrate(sw.Oscillator(1.5, **each), "rk4", v=v, y=1.0, dt=0.1, steps=100).y[-1] for v, each in options]
    assert np.ptp(ends) < 100 * 40 * 2.0**-53


def test_a_block_on_a_spring_sticks_where_the_facts_say() -> None:
    run = sw.scenes.sticking_block().run("false_euler", 1e-3, every=1)
    assert round(float(run.y[-1]), 7) == -0.0399998
    moved = np.flatnonzero(run.v)[-1]
    assert round(float(run.t[moved + 1]), 3) == 12.568
    assert (run.v[moved + 1 :] == 0.0).all()


@looped("method, form", itertools.product(ABLE, ["canonical", "physical"]))
def test_each_half_swing_is_shorter_by_the_same_length(method: sw.Method, form: str) -> None:
    """By 2μN/k: 1, −0.74, 0.48, −0.22, −0.04. In units of Φ = ωh: a turn moves the velocity by at most 2Φ·0.13, which changes an
    amplitude of 0.09 or more by 2Φ² at most, and a sample is off the peak by Φ²/2 at most. A method of first order changes the
    amplitude by Φ²/2 of itself in a step (r₁ of Standard Euler), that is by ½πΦ in a half swing; others by far less than Φ²."""
    h, omega = 1e-3, 2.0
    system = sw.Oscillator(omega, friction=0.13 * omega**2, form=form)
    run = sw.integrate(system, method, v=0.0, y=1.0, dt=h, steps=9000, every=1)
    peaks = run.y[np.flatnonzero(run.v[1:-1] * run.v[2:] <= 0.0) + 1]
    peaks = peaks[np.append(True, np.abs(np.diff(peaks)) > 0.01)]
    expected = np.array([1.0, -0.74, 0.48, -0.22, -0.04])[-len(peaks) :]
    phi = omega * h
    bound = (4 * 0.5 * math.pi * phi if method.order == 1 else 0.0) + 4 * (2.0 + 0.5 + 1.0) * phi**2
    assert len(peaks) >= 4
    np.testing.assert_allclose(peaks, expected, rtol=0, atol=bound)
    assert run.v[-1] == 0.0


@looped("method", ABLE)
def test_the_order_while_it_slides(method: sw.Method) -> None:
    """Within a half swing friction is a constant force. From n to 2n steps the error is divided by 2 to the order."""
    scene = sw.scenes.sticking_block()
    if method.order > 5:
        return  # its error is rounding at any step that fits

    def error(steps: int) -> float:
        run = sw.integrate(scene.system, method, v=0.0, y=1.0, dt=2.3 / steps, steps=steps)
        return float(scene.state_error(run)[0])

    steps = {1: 1000, 2: 300, 3: 100, 4: 40, 5: 20}[method.order]
    order = math.log2(error(steps) / error(2 * steps))
    # Rodas5P is of a higher order where the force does not depend on y.
    assert order == pytest.approx(method.order, abs=0.3 if method.name == "tsit5" else 0.2) or (
        method.name == "rodas5p" and 5.0 < order < 6.3
    )


@looped("method", ABLE)
def test_the_order_after_a_turn_and_of_the_place_of_rest(method: sw.Method) -> None:
    """A turn falls into a step: an error of first order in the time of what follows, by any method, since none looks for it.

    The place of rest depends on the amplitude alone, which that changes in second order only; Euler's methods that keep the
    energy of an oscillator have such a place too. Slopes are over steps from h to h/8: an error depends on where a turn falls.
    """
    scene = sw.scenes.sticking_block()
    exact = scene.exact
    assert exact is not None
    counts = np.array([400, 566, 800, 1131, 1600, 2263, 3200])

    def slope(end: float, place_only: bool) -> float:
        errors = []
        for n in counts:
            run = sw.integrate(scene.system, method, v=0.0, y=1.0, dt=end / n, steps=int(n))
            v, y = exact(run.t)
            errors.append(max(abs(run.y[-1] - y[0]), 0.0 if place_only else abs(run.v[-1] - v[0])))
        return float(-np.polyfit(np.log(counts), np.log(errors), 1)[0])

    assert slope(5.0, False) == pytest.approx(1.0, abs=0.3)
    if method.order > 1:
        assert slope(14.0, True) == pytest.approx(2.0, abs=0.3)
    else:
        assert slope(14.0, True) > 0.8


@looped("method", ABLE)
def test_what_friction_holds_stays_for_ever(method: sw.Method) -> None:
    """Up to |F| = μN exactly, of both signs; a hair more, and it slides at last: v = (|F| − μN)·t."""
    force = np.array([0.0, 0.25, -0.25, 0.5, -0.5, 0.5 + 1e-12, -0.5 - 1e-12])
    y = np.linspace(-1.0, 1.0, 7)
    run = sw.integrate(block(0.5, a=force), method, v=0.0, y=y, dt=0.125, steps=20_000)
    np.testing.assert_array_equal(run.v[-1][:5], 0.0)
    np.testing.assert_array_equal(run.y[-1][:5], y[:5])
    np.testing.assert_allclose(run.v[-1][5:], [2.5e-9, -2.5e-9], rtol=1e-3)
    on_spring = sw.integrate(sw.Oscillator(friction=0.13), method, v=0.0, y=[0.13, -0.13, 0.1], dt=0.125, steps=20_000)
    np.testing.assert_array_equal(on_spring.y[-1], [0.13, -0.13, 0.1])
    np.testing.assert_array_equal(on_spring.v[-1], 0.0)


@looped("method, side", itertools.product(ABLE, [1.0, -1.0]))
def test_it_slides_when_the_drive_exceeds_friction(method: sw.Method, side: float) -> None:
    """a = 2·sin(0.1·t) passes 0.5 at t₁ = 10·asin(¼); the first step that begins after that moves the block."""
    drive, h = sw.Sinusoid(side * 2.0, 0.1), 0.01
    run = sw.integrate(block(0.5, a=drive), method, v=0.0, y=0.3, dt=h, steps=600, every=1)
    start = 10.0 * math.asin(0.25)
    before = run.t < start
    np.testing.assert_array_equal(run.v[before], 0.0)
    # A stage at the end of a step may slide where its start still sticks: by h times what the drive grows in it, 0.2h at most.
    np.testing.assert_allclose(run.y[before], 0.3, rtol=0, atol=0.2 * h * h * h)
    assert (side * run.v[run.t > start + 2 * h] > 0.0).all()
    t = run.t[-1]  # v = ∫ 2·sin(0.1·t) − 0.5, to the first order of a start that is late by a step, and of Euler's methods
    v = 20.0 * (math.cos(0.1 * start) - math.cos(0.1 * t)) - 0.5 * (t - start)
    assert side * run.v[-1] == pytest.approx(v, abs=2.0 * h)


@looped("method", ABLE)
def test_a_push_within_a_live_loop(method: sw.Method) -> None:
    """A block is kicked, slides, and rests exactly; the world goes on from there."""
    v, y = np.array([2.0, -2.0]), np.zeros(2)
    world = sw.World(block(), method, v=v, y=y, dt=0.01)
    world.step(100)
    assert (v == 0.0).all()
    place = y.copy()
    world.step(1000)
    np.testing.assert_array_equal(y, place)
    np.testing.assert_array_equal(y, [place[0], -place[0]])
    v[0] = 1.0
    world.step(100)
    assert y[0] > place[0]
    assert y[1] == place[1]


REST = "return friction.stopped(new_v, friction.stops(v, self.s.dv(t, v, y)))"
SCALED = "Separate(h * deceleration)"


class Chattering(mistaken(friction, REST, "return new_v").Rubbing):
    """Friction against v, whatever the step does."""

    def dv(self, t: Any, v: Any, y: Any) -> Any:
        return self.s.dv(t, v, y) - self.common.limit * np.sign(v)


WRONG = {
    "against v, whatever the step does": Chattering,
    "the increments alone": mistaken(friction, REST, "return new_v").Rubbing,
    "at rest whatever the force": mistaken(friction, REST, REST.replace("return", "return 0.0 * v if v == 0.0 else")).Rubbing,
    "without the step": mistaken(friction, SCALED, "Separate(deceleration)").Rubbing,
    "forward": mistaken(friction, SCALED, "Separate(-h * deceleration)").Rubbing,
}


def rests_at(method: str) -> tuple[float, bool]:
    """Where the block on the spring is by the reference at t = 15, and whether it has been there for a while."""
    run = sw.integrate(sw.scenes.sticking_block().system, method, v=0.0, y=1.0, dt=0.01, steps=1500, every=1, backend="numpy")
    return round(float(run.y[-1]), 2), bool((run.v[-200:] == 0.0).all())


def test_the_reference_is_right() -> None:
    assert rests_at("rk4") == rests_at("false_euler") == (-0.04, True)


@pytest.mark.mutant
@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_a_wrong_friction_does_not_rest_there(wrong: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(friction, "Rubbing", wrong)
    with np.errstate(all="ignore"):
        assert rests_at("rk4") != (-0.04, True)


@looped("method, named", itertools.product(REFUSED, ["friction", "drag"]))
def test_methods_for_accelerations_refuse_it_by_name(method: str, named: str) -> None:
    system, words = sw.Oscillator(1.0, **{named: 0.1}), rf"{method} needs .* has {named}; use false_euler, or leave {named}"
    assert_raises(
        (lambda: sw.integrate(system, method, v=0.0, y=1.0, dt=0.1, steps=1), words),
        (lambda: sw.World(system, method, v=np.zeros(1), y=np.ones(1), dt=0.1), words),
        (lambda: sw.explain(system, method), words),
        (lambda: sw.export(system, method, "c"), words),
        kind=UnsupportedError,
    )


def test_refusals() -> None:
    rubbed, start = sw.Oscillator(friction=0.1), {"v": 0.0, "y": 1.0}
    depends = "has friction that sticks; what it does depends on the step"
    assert_raises(
        (lambda: sw.integrate(rubbed, "merson", **start, tolerance=1e-3, at=[1.0]), f"tolerance: .* {depends}"),
        (lambda: sw.explain(rubbed, "merson", attempt=True), "attempt: adaptive steps do not work with friction that sticks"),
        (lambda: sw.integrate(rubbed, "rk4", **start, dt=0.1, steps=1, form="matrix"), "form: only linear systems have"),
        (lambda: sw.jacobian(rubbed, **start), f"rates: .* {depends}"),
        (lambda: sw.analyse(rubbed, "rk4", dt=0.1, **start), f"rates: .* {depends}"),
        kind=UnsupportedError,
    )
    assert_raises(
        (lambda: sw.Oscillator(1.0, 0.1, drag=0.2), "damping, drag: expected one of them, got both"),
        (lambda: sw.Oscillator(friction=[0.1, -1.0]), "friction: expected numbers of zero or more, got -1"),
        (lambda: sw.Oscillator(drag=-1.0), "drag: expected numbers of zero or more, got -1"),
        (lambda: sw.Oscillator(0.0), "omega: expected numbers above zero"),
        kind=ArgumentError,
    )


def test_charts_and_advice_take_what_can() -> None:
    chart = charts.work_precision(
        "sliding_block", ["rk4", "merson", "verlet"], [40, 80], peers=[charts.peers.scipy("RK45", [1e-3])]
    )
    assert chart.refused.keys() == {"verlet", "SciPy RK45"}
    assert all("friction" in reason for reason in chart.refused.values())
    assert [(curve.method.name, curve.by) for curve in chart.curves] == [("rk4", "step"), ("merson", "step")]
    advice = sw.advise("sliding_block", frame=None, tolerance=0.01)
    assert {row.method for row in advice.ranked} <= set(ABLE)
    assert advice.ranked
    assert all(row.by == "step" for row in advice.ranked)
    because = {rejected.method for rejected in advice.rejected if "friction" in rejected.reason}
    assert because >= {*REFUSED, "merson"}


# ---- Verlet, as it is not to be done


def test_verlet_by_its_secant_never_rests() -> None:
    """FACTS §5: it ends at 0.808, at t = 5; False Euler rests. The two differ by which velocity friction is told."""
    slides, on_spring = charts.verlet_friction(1 / 60).blocks
    assert slides.t[-1] == pytest.approx(5.0, abs=1e-12)
    assert 0.8075 < slides.verlet[-1] < 0.8085
    assert slides.false_euler[-1] == slides.false_euler[100]
    # Its d = y − y_prev goes on as d, d − c, d, … with c = h²μg, so it creeps by 2d − c in two steps for ever.
    tail = np.diff(slides.verlet[60:])
    c = 4.905 / 3600
    np.testing.assert_allclose(np.abs(np.diff(tail)), c, rtol=1e-9)
    np.testing.assert_allclose(tail[2:], tail[:-2], rtol=0, atol=1e-14)
    assert abs(slides.verlet[-1] - slides.verlet[60]) > 0.05
    assert abs(on_spring.false_euler[-1] - -0.04) < 1e-4
    assert on_spring.verlet[-1] > -0.03


def test_verlet_without_friction_is_verlet() -> None:
    """So it is friction alone that is wrong in the figure: without it, these steps are stepwell's to rounding."""
    run = sw.integrate(sw.Oscillator(form="physical"), "verlet", v=0.3, y=1.0, dt=0.1, steps=100, every=1)
    states = secant_verlet(lambda y, difference: -y, 0.3, 1.0, 0.1, 100)
    assert np.abs(states - run.y[:, ...]).max() < 100 * 100 * 2.0**-53


def test_the_limit_of_verlet_with_drag_by_the_secant() -> None:
    """2(√(1 + D²) − D), from both sides: half a per cent below it the steps stay, as much above they grow."""
    chart = charts.verlet_friction()
    np.testing.assert_allclose(chart.limits, 2.0 * (np.sqrt(1.0 + chart.damping**2) - chart.damping), rtol=0, atol=1e-8)
    for damping in (0.1, 0.5, 1.5):
        limit = 2.0 * (math.sqrt(1.0 + damping**2) - damping)
        for share, grows in ((0.995, False), (1.005, True)):
            phi = share * limit
            y = secant_verlet(lambda y, d, D=damping, phi=phi: -y - 2.0 * D * d / phi, 0.0, 1.0, phi, 6000)
            assert bool(abs(y[-1]) > 1e6) is grows


def test_the_figure_has_its_rows() -> None:
    chart = charts.verlet_friction(0.05)
    assert len(chart.rows()) == sum(len(block.t) for block in chart.blocks)
    assert [row["by"] for row in chart.summary()] == ["exact", "false_euler", "verlet"] * 2
    with pytest.raises(ArgumentError, match=r"dt: expected 0\.0004 to 0\.1 units of time, got 0.5"):
        charts.verlet_friction(0.5)
