"""Adaptive steps: the reference's bits, every member at its own pace, errors that follow the tolerance."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, StepwellError, UnsupportedError
from stepwell.reference import series_pace
from stepwell.runs import engine
from stepwell.runs.result import Status
from support.cases import SYSTEMS

ABLE = [m.name for m in sw.methods() if m.error_order is not None]
MEMBERS = 21


def start(system: sw.System, rng: np.random.Generator, members: int = MEMBERS) -> dict[str, Any]:
    return {"v": 0.3 * rng.normal(size=(*system.v_shape, members)), "y": rng.normal(size=(*system.y_shape, members))}


def kepler(e: Any = 0.9) -> tuple[sw.NBody, dict[str, Any]]:
    """A body without mass round one of mass 1, from the point where they are nearest; a period is 2π."""
    e = np.asarray(e)
    v, y = np.zeros((2, 2, *e.shape)), np.zeros((2, 2, *e.shape))
    y[1, 0], v[1, 1] = 1.0 - e, np.sqrt((1.0 + e) / (1.0 - e))
    return sw.NBody([1.0, 0.0], force="newton"), {"v": v, "y": y}


@pytest.mark.parametrize("method", ABLE)
def test_a_hard_member_changes_nobody(method: str) -> None:
    """Alone, or beside an orbit that needs many more steps: the same states, the same steps."""
    e = np.where(np.arange(40) % 8 == 3, 0.995, 0.1)
    system, state = kepler(e)
    ask: dict[str, Any] = {"tolerance": 1e-7, "at": [3.0, 6.0]}
    whole = sw.integrate(system, method, **ask, **state)
    for member in (0, 3, 39):
        alone = sw.integrate(system, method, **ask, **kepler(e[member])[1])
        assert np.array_equal(alone.y, whole.y[..., member])
        assert alone.paces.accepted == whole.paces.accepted[member]
        assert alone.paces.h == whole.paces.h[member]
    # Of second order every member needs so many steps that the passage of the hard one is a small part of its own.
    assert whole.paces.evaluations[3] > (1.0 if sw.method(method).order == 2 else 1.5) * whole.paces.evaluations[0]
    # For each of the two asked times the step that passes it is made twice, and an extra one. A series has the coefficients
    # already, so it adds the last step alone, which is not taken. How many evaluations an order is, see test_taylor.py.
    again = 1 if sw.method(method).has_series else 2 * 2
    tried = whole.paces.accepted + whole.paces.rejected + again
    evaluations = engine.evaluations(sw.method(method), whole.system, order=series_pace.order_of(1e-7), paced=True)
    assert np.array_equal(whole.paces.evaluations, evaluations * tried)


@pytest.mark.parametrize(("orbit", "coarsest"), [("kepler", 5.0), ("arenstorf", 6.0)])
def test_the_error_follows_the_tolerance(orbit: str, coarsest: float) -> None:
    """Over six decades, after one period.

    The error of a step is of fifth order in it and is held at the tolerance, so steps shorten as its fifth root. The end error of
    a result of order p is then of p/5 in the tolerance: 4/5 for Fehlberg, 1 with local extrapolation. For Rosenbrock 2(3) it is
    2/3, second order by steps of third. Merson's estimate is too
    large off linear equations, by one power of the step: its end error falls as fast as the tolerance, or a little faster.
    """
    scene = sw.scenes.scene(orbit) if orbit == "arenstorf" else None
    system, state = (scene.system, {"v": scene.v, "y": scene.y}) if scene else kepler()
    end = scene.period if scene else 2.0 * np.pi
    tolerances = 10.0 ** -np.arange(coarsest, coarsest + 7.0)
    for method in ABLE:
        runs = [sw.integrate(system, method, tolerance=t, at=[end], **state) for t in tolerances]
        errors = np.array([np.linalg.norm(run.y[-1] - state["y"]) for run in runs])
        line = np.polyfit(np.log10(tolerances), np.log10(errors), 1)
        assert (0.55 if method == "rosenbrock23" else 0.7) < line[0] < 1.2, (method, errors)
        assert (np.abs(np.log10(errors) - np.polyval(line, np.log10(tolerances))) < 1.0).all(), (method, errors)


def test_each_state_is_that_of_its_time() -> None:
    """However close they lie, and whatever the step."""
    times = np.array([0.0, 1e-9, 0.1, 0.1 + 1e-12, 0.3, 7.0, 7.0 + 2e-15 * 7])
    run = sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1.0, tolerance=1e-12, at=times)
    assert np.array_equal(run.t, times)
    assert run.y[0] == 1.0
    # A step adds the tolerance times 1, the longest that a block may be, to both at most, and an extra one as much; an
    # oscillator keeps errors as they are.
    assert np.abs(run.y - np.cos(times)).max() < 1e-12 * np.sqrt(2) * (float(run.paces.accepted) + 1)
    assert run.paces.t <= times[-1] < run.paces.t + run.paces.h


@pytest.mark.filterwarnings("ignore:.*another energy per mass")  # at 1e-2
@pytest.mark.parametrize(("method", "backend"), [*((method, "rust") for method in ABLE), ("merson", "numpy")])
def test_a_state_does_not_depend_on_what_else_is_asked_for(method: str, backend: str) -> None:
    """Alone, among many, at the very end of a step, or as the last: the same bits, and the same steps."""
    system, state = kepler(np.array([0.3, 0.7, 0.0]))
    end = 20.0 if backend == "rust" else 3.0
    times = np.sort(np.random.default_rng(3).uniform(0.0, end, 40))
    tolerance = 1e-4 if sw.method(method).has_series else np.array([1e-2, 1e-4, 1e-9])  # a series has one order for all members
    ask: dict[str, Any] = {"tolerance": tolerance, "backend": backend} | state
    many = sw.integrate(system, method, at=times, **ask)
    for i in (0, 7, 21, 39):
        alone = sw.integrate(system, method, at=times[[i]], **ask)
        assert np.array_equal(alone.y[0], many.y[i])
        assert np.array_equal(alone.v[0], many.v[i])
    for name in ("t", "h", "accepted", "rejected"):
        assert np.array_equal(getattr(alone.paces, name), getattr(many.paces, name))
    if sw.method(method).has_series:  # whose coefficients make all saved states of a step
        assert np.array_equal(alone.paces.evaluations, many.paces.evaluations)
    else:
        assert (alone.paces.evaluations < many.paces.evaluations).all()
    # The step in which a run ends starts where the step before it ended: the state there is the one that is asked for there.
    for member, t in enumerate(alone.paces.t):
        there = sw.integrate(system, method, at=[t], **ask)
        assert np.array_equal(there.y[0][..., member], alone.controller_state.y[..., member])


def test_in_pieces() -> None:
    """A run that goes on is the run that was never interrupted, in all that it says, wherever the cuts are."""
    rng, bodies = np.random.default_rng(7), sw.NBody(np.ones(64) / 64, force="newton", softening=0.3, dim=2)
    sampled = SYSTEMS["sampled x and a, physical"](rng, MEMBERS)
    of_bodies = {"v": 0.1 * rng.normal(size=(64, 2)), "y": rng.normal(size=(64, 2)), "tolerance": 1e-4}
    of_sampled = start(sampled, rng) | {"tolerance": 10.0 ** rng.uniform(-7, -2, MEMBERS)}
    times = [0.0, 0.05, 0.11, 0.3, 0.3 + 1e-9, 0.5]
    for (system, ask), cut in itertools.product(((bodies, of_bodies), (sampled, of_sampled)), (1, 3, 5)):
        whole, first = (sw.integrate(system, "merson", at=at, **ask) for at in (times, times[:cut]))
        rest = sw.integrate(system, "merson", at=times[cut:], resume=first)
        for name in ("v", "y"):
            assert np.array_equal(np.concatenate([getattr(first, name), getattr(rest, name)]), getattr(whole, name))
        for ours, theirs in zip(rest.paces, whole.paces, strict=True):
            assert np.array_equal(ours, theirs)


def test_what_stopped_goes_on_with_more_steps() -> None:
    system, state = kepler(np.array([0.1, 0.99]))
    ask: dict[str, Any] = {"tolerance": 1e-6} | state
    whole = sw.integrate(system, "merson", at=[1.0, 6.0], **ask)
    with pytest.warns(sw.ToleranceWarning, match="out of max_steps"):
        first = sw.integrate(system, "merson", at=[1.0], max_steps=40, **ask)
    assert first.status.tolist() == [Status.OK, Status.BUDGET]
    rest = sw.integrate(system, "merson", at=[6.0], resume=first)
    assert np.array_equal(rest.y[-1], whole.y[-1])
    assert np.array_equal(rest.paces.accepted, whole.paces.accepted)


def test_what_does_not_go_on() -> None:
    run = sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1.0, tolerance=1e-3, at=[1.0])
    carries = "method: expected 'merson', the method of the run that goes on, which carries more than"
    steps = "steps: works with fixed steps only, and the run that goes on has adaptive steps"
    cases: list[tuple[dict[str, Any], str]] = [
        ({"tolerance": 1e-3}, "tolerance: the run that goes on has its own"),
        ({"dt": 0.1}, "dt: the run that goes on has its next step already"),
        ({"at": [0.5]}, "at: expected times that ascend from the last time of the run that goes on, 1, on"),
        ({"method": "dop853"}, carries),
        ({"v": np.zeros(2)}, "resume: expected a run of batch"),
        ({"resume": 3}, "resume: expected a Run or a World that goes on, got 3"),
        ({"t0": 1.0}, "t0: the run that goes on has its own, got 1.0"),
        ({"at": None, "dt": 0.1, "steps": 3}, steps),
    ]
    for more, message in cases:
        with pytest.raises(ArgumentError, match=message):
            sw.integrate(sw.Oscillator(1.0), **{"method": "merson", "at": [2.0], "resume": run} | more)


# ---- amplitudes and units


@pytest.mark.parametrize("method", ABLE)
def test_a_linear_run_scales_with_its_start_to_the_bit(method: str) -> None:
    """Multiplied by 2^k, everything is multiplied by 2^k: sums, products with constants, lengths and their quotients all are.

    Of squares of lengths times the square of a tolerance of 1e-6 the least here is 2^−160·1e-24 or so, far above 2^−1022.
    """
    chain = sw.Chain(3, stiffness=[1.0, 30.0, 2.0, 1.0])
    times = np.linspace(0.0, 30.0, 8)[1:]
    for v, y in (([0.0, 1.0, -0.3], [0.2, 0.0, 0.1]), ([0.0] * 3, [0.0, 1.0, 0.0]), ([0.1, 0.0, 0.0], [0.0] * 3)):
        ask: dict[str, Any] = {"tolerance": 1e-6, "at": times}
        one = sw.integrate(chain, method, v=np.array(v), y=np.array(y), **ask)
        for k in (-40, -3, 40):
            other = sw.integrate(chain, method, v=2.0**k * np.array(v), y=2.0**k * np.array(y), **ask)
            assert np.array_equal(other.y, 2.0**k * one.y)
            assert np.array_equal(other.v, 2.0**k * one.v)
            assert other.paces == one.paces


def test_a_run_does_not_depend_on_the_units() -> None:
    """An orbit in other lengths and times, powers of two: the same steps, and v and y as much larger, to the bit."""
    system, state = kepler(0.6)
    one = sw.integrate(system, "dop853", tolerance=1e-9, at=[1.0, 6.0], **state)
    for length, time in ((2.0**37, 1.0), (1.0, 2.0**24), (2.0**-30, 2.0**-11)):
        other = sw.NBody([1.0, 0.0], G=length**3 / time**2, force="newton")
        ask: dict[str, Any] = {"v": state["v"] * (length / time), "y": state["y"] * length}
        run = sw.integrate(other, "dop853", tolerance=1e-9, at=np.array([1.0, 6.0]) * time, **ask)
        assert np.array_equal(run.y, one.y * length)
        assert np.array_equal(run.v, one.v * (length / time))


def test_errors_are_relative_to_the_motion() -> None:
    """From a start of any length, and from rest under a force of any strength.

    A step errs by the tolerance of the longest in both blocks at most, which an oscillator keeps.
    """
    tolerance = 1e-4
    for method, amplitude in itertools.product(ABLE, (1e-12, 1e-9, 1.0, 1e12)):
        run = sw.integrate(sw.Oscillator(1.0), method, v=0.0, y=amplitude, tolerance=tolerance, at=[100.0])
        off = abs(run.y[-1] / amplitude - np.cos(100.0))
        assert off < np.sqrt(2) * tolerance * (run.paces.accepted + 1), (method, amplitude)
        driven = sw.Oscillator(1.0, a=sw.Sinusoid(amplitude, 2.0), form="physical")
        run = sw.integrate(driven, method, v=0.0, y=0.0, tolerance=tolerance, at=[20.0])
        longest = 1.5  # (2·sin t − sin 2t)/3 is shorter than 1, and its rate than 4/3
        off = abs(run.y[-1] / amplitude - (2 * np.sin(20.0) - np.sin(40.0)) / 3)
        assert off < longest * tolerance * (run.paces.accepted + 1) * 1.5, (method, amplitude)


def test_what_is_pushed_out_of_a_rest() -> None:
    """At zero, or where forces cancel but for rounding: no length tells what error is small, and neither stops the run.

    The push is seen though it comes late and is short, for no step passes over a sample. It is known to within a millionth of the
    interval (see ``Sampled``), and a step that ends on each of its sides errs by the tolerance; an oscillator of ω = 0.7 makes at
    most 1/0.7 of an error of v.
    """
    omega, methods = 0.7, [method for method in ABLE if not sw.method(method).has_series]  # it refuses samples
    for method, tolerance, rest in itertools.product(methods, (1e-3, 1e-6, 1e-9), (0.0, 0.25 / 0.49)):
        force = np.full(300, rest * 0.49)
        force[250] += 1.0
        system = sw.Oscillator(omega, a=sw.Sampled(force, 0.1), form="physical")
        run = sw.integrate(system, method, v=0.0, y=rest * (1 + 3e-16), tolerance=tolerance, at=[20.0, 40.0])
        assert run.status == Status.OK
        assert abs(run.y[0] - rest) < 1e-14
        pushed = (np.cos(omega * (40.0 - 25.1)) - np.cos(omega * (40.0 - 25.0))) / omega**2
        within = max(rest, 0.2) / omega * tolerance * (run.paces.accepted + 1) + 1e-6
        assert abs(run.y[-1] - rest - pushed) < within, (method, tolerance, rest)


def test_an_absolute_tolerance_in_which_the_motion_is_lost_is_warned_of() -> None:
    ask: dict[str, Any] = {"v": 0.0, "y": np.array([1.0, 1e-9, 0.0]), "at": [10.0]}
    with pytest.warns(sw.ToleranceWarning, match=r"for 1 of 3 members the absolute part lets a step err by more than 0.01"):
        sw.integrate(sw.Oscillator(1.0), "merson", tolerance=(1e-3, 1e-3), **ask)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sw.integrate(sw.Oscillator(1.0), "merson", tolerance=(1e-9, 1e-6), **ask | {"y": 1.0})
        sw.integrate(sw.Oscillator(1.0), "merson", tolerance=(1e-3, 1e-15), **ask)


def test_lengths_whose_squares_overflow_are_not_let_pass() -> None:
    """The length of a row is a root of squares; the size of a component alone is its absolute value, which has no such limit."""

    @sw.system(order=1, shape=(2,), scale="row")
    def turns(t: Any, y: Any) -> Any:
        return np.array([y[1], -y[0]])

    with pytest.warns(sw.ToleranceWarning, match="gives finite numbers"):
        run = sw.integrate(turns(), "merson", y=[1e160, 0.0], tolerance=1e-3, at=[10.0])
    assert run.status == Status.NOT_FINITE
    assert sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1e160, tolerance=1e-3, at=[10.0]).status == Status.OK


def test_the_first_step_is_that_of_the_start() -> None:
    """A hundredth of the time in which the start changes: |v|/|v̇|, |y|/|ẏ|, √(|y|/|v̇|); 2⁻²⁰ at rest."""
    blind = 2.0**-20  # from (1, 0), too: nothing pulls and nowhere is the measure
    for v, y, first in ((0.0, 1.0, 0.005), (1.0, 0.0, blind), (1.0, 1.0, 0.0025), (0.0, 0.0, blind)):
        run = sw.integrate(sw.Oscillator(2.0, form="physical"), "merson", v=v, y=y, tolerance=1e-3, at=[0.0])
        # In the looks ahead rates are other by h·ω, which is a hundredth.
        assert 0.99 * first <= run.paces.h <= first
    # At rest no step is longer than a 32nd of the time so far: 32 steps, and ln(2²⁰·s/32)/ln(1 + 1/32) more to s units of time.
    for span, least in ((1e-13, 340), (1.0, 340), (1e9, 1010)):
        run = sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=0.0, tolerance=1e-3, at=[span])
        assert least < run.paces.accepted < least + 60


def test_out_of_steps() -> None:
    """Who has no steps left stops where it is; what was reached before is there, and the neighbours go on."""
    system, state = kepler(np.array([0.1, 0.999, 0.1]))
    at = np.linspace(0.0, 6.0, 7)
    with pytest.warns(sw.ToleranceWarning, match=r"1 of 3 members stopped before t = 6: member 1 at t = .*; out of max_steps"):
        run = sw.integrate(system, "merson", tolerance=1e-6, at=at, max_steps=100, **state)
    assert run.status.tolist() == [Status.OK, Status.BUDGET, Status.OK]
    assert run.paces.accepted[1] + run.paces.rejected[1] == 100
    stopped = run.paces.t[1]
    for i, t in enumerate(at):
        assert np.isfinite(run.y[i, ..., 1]).all() == (t <= stopped)
    assert np.isfinite(run.y[..., [0, 2]]).all()


def test_a_collision_ends_in_too_small_a_step() -> None:
    """Two bodies at rest fall into each other: no step is small enough for the last moment, and the run says when that is."""
    y = np.array([[-0.5, 0.0], [0.5, 0.0]])
    with pytest.warns(sw.ToleranceWarning, match="too small to move the time|gives finite numbers"):
        run = sw.integrate(sw.NBody([1.0, 1.0], force="newton"), "fehlberg_5", v=0.0, y=y, tolerance=1e-8, at=[0.5, 2.0])
    assert run.status in (Status.UNDERFLOW, Status.NOT_FINITE)
    assert float(run.paces.t) == pytest.approx(np.pi / 4, abs=1e-5)  # free fall of distance 1 under mass 2: π/2·√(1/(2·2))
    assert np.isfinite(run.y[0]).all()
    assert np.isnan(run.y[1]).all()


def test_rates_that_are_not_finite() -> None:
    y = np.zeros((2, 2))
    with pytest.warns(sw.ToleranceWarning, match="gives finite numbers"):
        run = sw.integrate(sw.NBody([1.0, 1.0], force="newton"), "merson", v=0.0, y=y, tolerance=1e-8, at=[1.0])
    assert run.status == Status.NOT_FINITE


def test_fehlberg_pumps_and_merson_does_not() -> None:
    """FACTS of the undamped oscillator, with adaptive steps: Fehlberg's energy grows all the time, Merson's falls."""
    for method, sign in (("merson", -1), ("fehlberg", 1), ("fehlberg_5", 1)):
        run = sw.integrate(sw.Oscillator(1.0), method, v=0.0, y=1.0, tolerance=1e-5, at=np.linspace(0, 2000, 5))
        assert (sign * np.diff(run.energy) > 0).all()


def test_each_member_its_tolerance() -> None:
    for tolerance in (np.array([1e-4, 1e-8]), (1e-8, np.array([1e-4, 1e-8]))):
        run = sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1.0, tolerance=tolerance, at=[10.0])
        assert run.paces.accepted[1] > 4 * run.paces.accepted[0]
        assert "with a tolerance" in repr(run)


def test_bad_input_before_any_work() -> None:
    needed = "dt and steps: needed for fixed steps, got None; for adaptive steps give tolerance= and at="
    cases: list[tuple[dict[str, Any], type[StepwellError], str]] = [
        ({"method": "rk4"}, UnsupportedError, "rk4 does not estimate its error.*merson"),
        ({"tolerance": None}, ArgumentError, "tolerance: at= needs"),
        ({"tolerance": (np.ones(2), np.ones(3))}, ArgumentError, "do not broadcast"),
        ({"at": None}, ArgumentError, "at: tolerance= needs"),
        ({"at": None, "tolerance": None}, ArgumentError, needed),
        ({"tolerance": 0.0}, ArgumentError, "tolerance: expected numbers above zero"),
        ({"tolerance": (1e-3, 1e-3, 1e-3)}, ArgumentError, "expected a number or a pair"),
        ({"at": [1.0, 1.0]}, ArgumentError, "at: expected times that ascend"),
        ({"at": [-1.0, 1.0]}, ArgumentError, "ascend from t0 = 0"),
        ({"at": 3.0}, ArgumentError, "at: expected times along the first axis"),
        ({"at": []}, ArgumentError, "at: expected times along the first axis"),
        ({"steps": 3}, ArgumentError, "steps: works with fixed steps only"),
        ({"start": "first_order", "form": "matrix"}, ArgumentError, "start, form: works with fixed steps only"),
        ({"max_steps": 0}, ArgumentError, "max_steps: expected 1 or more"),
        ({"dt": -1.0}, ArgumentError, "dt: expected a step above zero"),
        ({"tolerance": np.ones(3), "y": np.ones(2)}, ArgumentError, "do not broadcast"),
    ]
    for more, error, message in cases:
        ask: dict[str, Any] = {"method": "merson", "v": 0.0, "y": 1.0, "tolerance": 1e-3, "at": [1.0]} | more
        with pytest.raises(error, match=message):
            sw.integrate(sw.Oscillator(1.0), **ask)
