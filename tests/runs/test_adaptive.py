"""Adaptive steps: the reference's bits, every member at its own pace, errors that follow the tolerance."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, ShapeError, TooLargeError, UnsupportedError
from stepwell.reference import series_pace
from stepwell.reference.acceptance import NO_GROUP, Acceptance
from stepwell.reference.traced import Tracer
from stepwell.runs import accepted_steps, engine
from stepwell.runs.result import Status
from stepwell.scenes.stiff_equations import rober
from support.cases import SYSTEMS
from support.refusals import refused
from support.ways import assert_equal_ways, assert_same_run

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
def test_a_hard_member_takes_more_evaluations_and_nobody_else_does(method: str) -> None:
    """Beside orbits that need fewer steps, of which all are counted; ``test_ways.py`` has the bits of each alone."""
    e = np.where(np.arange(40) % 8 == 3, 0.995, 0.1)
    system, state = kepler(e)
    whole = sw.integrate(system, method, tolerance=1e-7, at=[3.0, 6.0], **state)
    # Of second order every member needs so many steps that the passage of the hard one is a small part of its own.
    assert whole.paces.evaluations[3] > (1.0 if sw.method(method).order == 2 else 1.5) * whole.paces.evaluations[0]
    # For the first time the step that passes it is extended; for the last one, or both without an extension, it is made twice,
    # and an extra one: each counts as the longer of both. A series has the coefficients already, so it adds the last step alone,
    # which is not taken. How many evaluations an order is, see test_taylor.py.
    able = sw.method(method)
    again = 1 if able.has_series else 3 if able.extension_evaluations else 4
    evaluations = engine.evaluations(able, whole.system, order=series_pace.order_of(1e-7), paced=True)
    made = evaluations * (whole.paces.accepted + whole.paces.rejected) + again * max(evaluations, able.extension_evaluations)
    assert np.array_equal(whole.paces.evaluations, made)


@pytest.mark.parametrize(("orbit", "coarsest"), [("kepler", 5.0), ("arenstorf", 6.0)])
def test_the_error_follows_the_tolerance(orbit: str, coarsest: float) -> None:
    """Over six decades, after one period. The error of a step is of fifth order in it and is held at the tolerance, so steps
    shorten as its fifth root. The end error of a result of order p is then of p/5 in the tolerance: 4/5 for Fehlberg, 1 with
    local extrapolation. For Rosenbrock 2(3) it is 2/3, second order by steps of third, of the power 3/2 of the tolerance: 1, with
    so many steps that the two finest are left out. Merson's estimate is too large off linear equations, by one power of the step:
    its end error falls as fast as the tolerance, or a little faster; that of Tsitouras' pair by 1.29. One error of Verner's of
    order 7 is next to zero, a decade below the line.
    """
    scene = sw.scenes.scene(orbit) if orbit == "arenstorf" else None
    system, state = (scene.system, {"v": scene.v, "y": scene.y}) if scene else kepler()
    end = scene.period if scene else 2.0 * np.pi
    for method in ABLE:
        tolerances = 10.0 ** -np.arange(coarsest, coarsest + (5.0 if method == "rosenbrock23" else 7.0))
        runs = [sw.integrate(system, method, tolerance=t, at=[end], **state) for t in tolerances]
        errors = np.array([np.linalg.norm(run.y[-1] - state["y"]) for run in runs])
        line = np.polyfit(np.log10(tolerances), np.log10(errors), 1)
        assert 0.7 < line[0] < (1.3 if (orbit, method) == ("arenstorf", "tsit5") else 1.2), (method, errors)
        off = np.abs(np.log10(errors) - np.polyval(line, np.log10(tolerances)))
        assert off.max() < (1.2 if (orbit, method) == ("kepler", "vern7") else 1.0), (method, errors)


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
    """With few others, among many, or at the very end of a step: the same bits, and the same steps; and so the last state."""
    system, state = kepler(np.array([0.3, 0.7, 0.0]))
    end = 20.0 if backend == "rust" else 3.0
    times = np.sort(np.random.default_rng(3).uniform(0.0, end, 40))
    tolerance = 1e-4 if sw.method(method).has_series else np.array([1e-2, 1e-4, 1e-9])  # a series has one order for all members
    ask: dict[str, Any] = {"tolerance": tolerance, "backend": backend} | state
    many = sw.integrate(system, method, at=times, **ask)
    for i in (0, 7, 21):
        few = sw.integrate(system, method, at=times[[i, 39]], **ask)
        assert np.array_equal(few.y[0], many.y[i])
        assert np.array_equal(few.v[0], many.v[i])
    alone = sw.integrate(system, method, at=times[[39]], **ask)
    assert np.array_equal(alone.y[0], few.y[1])
    assert np.array_equal(alone.y[0], many.y[39])
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
    """A run that goes on is the run that was never interrupted, in all that it says, wherever the cuts are.

    But the last state of a piece is made by a step, which counts, and not by the continuous extension.
    """
    rng, bodies = np.random.default_rng(7), sw.NBody(np.ones(64) / 64, force="newton", softening=0.3, dim=2)
    sampled = SYSTEMS["sampled x and a, physical"](rng, MEMBERS)
    of_bodies = {"v": 0.1 * rng.normal(size=(64, 2)), "y": rng.normal(size=(64, 2)), "tolerance": 1e-4}
    of_sampled = start(sampled, rng) | {"tolerance": 10.0 ** rng.uniform(-7, -2, MEMBERS)}
    times = [0.0, 0.05, 0.11, 0.3, 0.3 + 1e-9, 0.5]
    for (system, ask), cut in itertools.product(((bodies, of_bodies), (sampled, of_sampled)), (1, 3, 5)):
        whole, first = (sw.integrate(system, "merson", at=at, **ask) for at in (times, times[:cut]))
        rest = sw.integrate(system, "merson", at=times[cut:], resume=first)
        for name in ("v", "y"):
            pieces, expected = np.concatenate([getattr(first, name), getattr(rest, name)]), getattr(whole, name)
            assert np.array_equal(np.delete(pieces, cut - 1, axis=0), np.delete(expected, cut - 1, axis=0))
            assert np.abs(pieces[cut - 1] - expected[cut - 1]).max() < 1e-2 * np.abs(expected).max()
        for name, ours, theirs in zip(rest.paces._fields, rest.paces, whole.paces, strict=True):
            extra = rest.method.extension_evaluations if name == "evaluations" else 0
            assert (np.abs(ours - theirs) <= extra).all()


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
    # No warnings, which would be errors.
    sw.integrate(sw.Oscillator(1.0), "merson", tolerance=(1e-9, 1e-6), **ask | {"y": 1.0})
    sw.integrate(sw.Oscillator(1.0), "merson", tolerance=(1e-3, 1e-15), **ask)


def test_lengths_whose_squares_overflow_are_not_let_pass() -> None:
    """The length of a row is a root of squares; the size of a component alone is its absolute value, which has no such limit."""
    turns = sw.system(order=1, shape=(2,), scale="row")(lambda t, y: np.array([y[1], -y[0]]))
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


NEEDED = "dt and steps: needed for fixed steps, got None; for adaptive steps give tolerance= and at="
#: What is asked for beside or in place of a right run, and what is said of it.
WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"method": "rk4"}, UnsupportedError, "rk4 does not estimate its error.*merson"),
    ({"tolerance": None}, ArgumentError, "tolerance: at= needs"),
    ({"tolerance": (np.ones(2), np.ones(3))}, ArgumentError, "do not broadcast"),
    ({"at": None}, ArgumentError, "at: tolerance= needs"),
    ({"at": None, "tolerance": None}, ArgumentError, NEEDED),
    ({"tolerance": 0.0}, ArgumentError, "tolerance: expected numbers above zero"),
    ({"tolerance": (1e-3, 1e-3, 1e-3)}, ArgumentError, "expected a number or a pair"),
    ({"at": [1.0, 1.0]}, ArgumentError, "at: expected times that ascend"),
    ({"at": [-1.0, 1.0]}, ArgumentError, "ascend from t0 = 0"),
    ({"at": []}, ArgumentError, "at: expected times along the first axis"),
    ({"steps": 3}, ArgumentError, "steps: works with fixed steps only"),
    ({"start": "first_order", "form": "matrix"}, ArgumentError, "form, start: works with fixed steps only"),
    ({"max_steps": 0}, ArgumentError, "max_steps: expected 1 or more"),
    ({"dt": -1.0}, ArgumentError, "dt: expected a step above zero"),
    ({"tolerance": np.ones(3), "y": np.ones(2)}, ArgumentError, "do not broadcast"),
    ({"at": [1.0, 2.0], "every": 1}, ShapeError, "at: with every= expected one time, that of the end, got 2"),
    ({"y": np.ones(10**6), "every": 1}, TooLargeError, "up to max_steps = 1000000 steps of 1000000 .* a smaller max_steps="),
    ({"at": [-1.0, -0.5]}, ArgumentError, "at: expected times that descend"),
    ({"t0": np.array([0.0, 2.0])}, ArgumentError, "forward in time, or all backward"),
    ({"at": [-1.0], "dt": 0.1}, ArgumentError, "dt: expected a step below zero"),
    (
        {"system": sw.NBody(), "y": np.eye(3, 2), "at": [-1.0], "control": sw.EnergyControl(gain=1.0)},
        UnsupportedError,
        "at: .*leads a state back to its target",
    ),
]


def test_bad_input_before_any_work() -> None:
    right: dict[str, Any] = {"system": sw.Oscillator(1.0), "method": "merson", "v": 0.0, "y": 1.0, "tolerance": 1e-3, "at": [1.0]}
    for more, error, message in WRONG:
        refused(error, message, sw.integrate, **right | more)


# ``every=``: the state at every so manieth accepted step of each member, the same however the run is made.
@pytest.mark.parametrize("method", ABLE)
def test_each_kept_state_is_that_of_its_time(method: str) -> None:
    """A run that is asked for the states at the times of its steps has the same ones, to the bit, and makes the same steps."""
    ask: dict[str, Any] = {"v": 0.0, "y": 2.0, "tolerance": 1e-6}
    run = sw.integrate(sw.Pendulum(), method, at=[6.0], every=1, **ask)
    at_steps = sw.integrate(sw.Pendulum(), method, at=run.t, **ask)
    np.testing.assert_array_equal(run.y, at_steps.y)
    np.testing.assert_array_equal(run.v, at_steps.v)
    assert (np.diff(run.t) > 0.0).all()
    assert len(run.t) == run.paces.accepted + 2  # the start, the steps, and the end within the step that is held
    np.testing.assert_array_equal(sw.integrate(sw.Pendulum(), method, at=[6.0], every=4, **ask).t[1:-1], run.t[4:-1:4])


def ensemble(**options: Any) -> sw.Run:
    omega = np.linspace(0.3, 4.0, 300)
    ask: dict[str, Any] = {"v": 0.0, "y": 2.5, "tolerance": 1e-5, "at": [5.0], "every": 2, "max_steps": 400}
    return sw.integrate(sw.Pendulum(omega), "merson", **ask | options)


def test_members_have_rows_of_their_own() -> None:
    """The start and the end stand in the first and the last row of all; ``test_ways.py`` has each alone, without rows of NaN."""
    run = ensemble()
    assert run.t.shape == run.y.shape == (2 + run.paces.accepted.max() // 2, 300)
    np.testing.assert_array_equal(run.t[[0, -1]], [[0.0] * 300, [5.0] * 300])


@pytest.mark.parametrize("method", ["dop853", "merson", "rodas5p", "tsit5", "bs32"])
def test_a_run_with_every_step_has_the_state_at_any_time(method: str) -> None:
    """To the bit that of a run with ``at=`` these times: batches, options, stops, both directions, a run from a file."""
    times = np.random.default_rng(3).uniform(0.0, 6.0, 40)
    times[:3] = 0.0, 6.0, times[5]
    order, hard = np.argsort(times), sw.Pendulum(omega=np.array([[1.0, 3.0, 0.5], [2.0, 1.5, 0.1]]))
    driven = sw.Oscillator(a=sw.Sampled([0.0, 1.0, -1.0, 0.5], 1.7))
    pushed = {"force": np.array([0.1, -0.2]), "tolerance": (1e-4, 1e-6), "dtype": "float32"}
    event = sw.Event(lambda t, v, y: y, terminal=2, name="stop")
    cases: list[tuple[sw.System, dict[str, Any]]] = [
        (hard, {"v": 0.0, "y": 3.0}),
        (driven, {"v": 0.0, "y": np.array([1.0, 2.0]), "jumps": [2.3, 4.9]}),
        (sw.Oscillator(), {"v": 1.0, "y": 0.0, "jumps": np.array([[1.1, 2.2], [3.3, 4.4]])}),
        (sw.Pendulum(), {"v": 1.0, "y": 0.0, "max_step": 0.37}),
        (sw.Oscillator(), {"v": 0.0, "y": 1.0} | pushed),
        (sw.Pendulum(), {"v": np.array([0.0, 2.1]), "y": 2.0, "events": event}),
    ]
    if method == "rodas5p":
        cases = [each for each in cases if each[0] is hard]
    for sign in (1.0, -1.0):
        for system, options in cases:
            if sign < 0.0 and (system is driven or options.get("jumps") is not None):
                continue
            ask: Any = {"tolerance": 1e-6, "max_steps": 4000} | options
            whole = sw.integrate(system, method, at=sign * 6.0, every=1, **ask)
            asked = sw.integrate(system, method, at=sign * np.append(np.unique(times[times > 0.0]), 6.0)[:-1], **ask)
            v, y = whole(sign * times)
            for one, saved, first in ((v, asked.v, whole.v[0]), (y, asked.y, whole.y[0])):
                rows = np.searchsorted(sign * asked.t, times[order])
                expected = np.where((times[order] == 0.0).reshape(-1, *(1,) * first.ndim), first, saved[rows])
                if "events" in options:  # it is not known where the step ended in which one stopped a trajectory
                    np.testing.assert_allclose(one[order], expected, rtol=0.0, atol=1e-5, err_msg=f"{system!r} {options}")
                else:
                    np.testing.assert_array_equal(one[order], expected, err_msg=f"{system!r} {options}")
            np.testing.assert_array_equal(whole(sign * times.reshape(4, 10))[1], y.reshape(4, 10, *y.shape[1:]))
            np.testing.assert_array_equal(whole(sign * times[7])[0], v[7])


def test_states_between_steps_of_a_run_from_a_file_and_of_one_that_goes_on(tmp_path: Path) -> None:
    """Also first-order systems, for which it is y alone, members that stopped by themselves, and series."""
    blow = sw.system(order=1)(lambda t, y: y * y)()
    with pytest.warns(sw.ToleranceWarning):
        run = sw.integrate(blow, "dop853", y=np.array([0.5, 1.0, 2.0]), tolerance=1e-9, at=1.5, every=1, max_steps=500)
    y = run(np.array([0.1, 0.4, 0.9]))
    exact = 1.0 / (1.0 / run.y[0] - np.array([[0.1], [0.4], [0.9]]))
    np.testing.assert_allclose(y[:2], exact[:2], rtol=1e-8)
    np.testing.assert_allclose(y[2, :2], exact[2, :2], rtol=1e-7)
    assert np.isnan(y[2, 2])
    run.save(tmp_path / "run.npz")
    np.testing.assert_array_equal(sw.load(tmp_path / "run.npz", system=blow.definition)(0.4), y[1])
    for method in ("taylor", "dop853"):
        half = sw.integrate(sw.Oscillator(), method, v=0.0, y=1.0, tolerance=1e-10, at=3.0)
        rest = sw.integrate(half.system, method, resume=half, at=7.0, every=1)
        times = np.linspace(3.0, 7.0, 50)
        np.testing.assert_allclose(rest(times)[1], np.cos(times), rtol=0, atol=1e-9)


def test_states_between_steps_need_the_steps() -> None:
    run = sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=1e-6, at=[3.0, 5.0])
    whole = sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=1e-6, at=5.0, every=1)
    bounce = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-v, y), name="bounce")
    bounced = sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=1e-6, at=5.0, every=1, events=bounce)
    for one in (run, whole.select(slice(3)), sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=5, every=1)):
        refused(UnsupportedError, "t: .* those of all steps, .* give tolerance= and every=1", one, 1.0)
    refused(UnsupportedError, "not known after bounce changed the state; ask for the times by at=", bounced, 1.0)
    refused(ArgumentError, "t: expected times within the run, 0 to 5, got 5.1", whole, [1.0, 5.1])
    refused(ArgumentError, "t: expected times within the run, 0 to 5, got -0.1", whole, -0.1)
    assert whole([])[0].shape == (0,)


def test_room_does_not_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a member has more steps than there is room for at once, also of states without velocities."""
    ask: dict[str, Any] = {"y": np.array([[0.5, 2.0]]), "tolerance": 1e-6, "at": [3.0], "every": 1}
    growth = sw.LinearSystem([[0.7]], velocities=0)
    whole = ensemble(threads=1), sw.integrate(growth, "merson", **ask)
    for run, numbers in ((lambda: ensemble(threads=2), 3 * 300 * 2), (lambda: sw.integrate(growth, "merson", **ask), 12)):
        monkeypatch.setattr(accepted_steps, "NUMBERS_AT_ONCE", numbers)  # two steps of each member at a time
        assert_same_run(run(), whole[numbers == 12])


def test_pieces_make_the_whole() -> None:
    """The steps count from the start of the first piece, and a piece begins with the state at its start."""
    whole, first = ensemble(), ensemble(at=[2.0])
    rest = sw.integrate(sw.Pendulum(np.linspace(0.3, 4.0, 300)), "merson", at=[5.0], every=2, max_steps=400, resume=first)
    for i in (0, 299):
        (t, y), (t1, y1), (t2, y2) = (
            [each[np.isfinite(run.t[:, i]), i] for each in (run.t, run.y)] for run in (whole, first, rest)
        )
        assert t1[-1] == t2[0] == 2.0
        np.testing.assert_array_equal(np.concatenate([t1[:-1], t2[1:]]), t)
        np.testing.assert_array_equal(np.concatenate([y1[:-1], y2[1:]]), y)


def test_large_members_and_jumps_are_the_same_by_the_reference() -> None:
    """A jump is the end of a step."""
    large = {"v": np.zeros((300, 1)), "y": np.sin(np.arange(300.0))[:, np.newaxis], "max_steps": 100}
    assert_equal_ways(sw.Chain(300), "merson", ways=("by the reference",), tolerance=1e-4, at=[0.5], every=1, **large)
    jumps: dict[str, Any] = {"v": np.zeros(2), "y": np.ones(2), "at": [2.0], "jumps": [0.7]}
    for more in ({"method": "merson"}, {"method": "taylor"}, {"method": "taylor", "fused": True}):
        options = {"tolerance": 1e-5, "every": 1, **jumps, **more}
        run = assert_equal_ways(sw.Oscillator(), ways=("by the reference", "alone"), **options)
        assert np.abs(run.t - 0.7).min() < 1e-14


def test_kept_steps_with_events() -> None:
    """A member that stops has the steps before; where a state is changed, those of all parts; the event is the last state."""
    falls = sw.Event(lambda t, v, y: y, name="falls", direction=-1, terminal=True)
    free = sw.Oscillator(np.array([1.0, 2.0, 3.0]))
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-6, "at": [4.0], "every": 1, "max_steps": 500}
    run, whole = sw.integrate(free, "merson", events=falls, **ask), sw.integrate(free, "merson", **ask)
    for i in range(3):
        before = whole.t[:, i] < run.stopped_at[i]
        np.testing.assert_array_equal(run.t[: before.sum(), i], whole.t[before, i])
        assert np.isnan(run.t[before.sum() : -1, i]).all()
        assert abs(run.y[-1, i]) < 1e-12
    bounce = sw.Event(lambda t, v, y: y[0, 0], name="ground", direction=-1, then=lambda t, v, y: (-0.8 * v, y))
    run = sw.integrate(sw.Particles(gravity=1.0, dim=1), "merson", **ask | {"v": 0.0, "y": [[1.0]]}, events=bounce)
    there = np.isfinite(run.t)
    assert (np.diff(run.t[there]) > 0.0).all()
    assert (run.y[there] >= -1e-12).all()
    assert (run.v[there][:, 0, 0] > 0.0).any()  # it rises after a bounce


# Where steps were wrong without a word: pulses, jumps, small components, units, states that must stay positive.
PAIRS = ["merson", "fehlberg", "fehlberg_5", "dop853"]
ONES = np.ones(3)


@sw.system(order=1)
def gated(t: Any, n: Any, *, begin: float = 5.0, end: float = 6.0) -> Any:
    """A channel that opens for a while: ṅ = open·(1 − n) − n. Since 0·n is added, the times cannot be told from the equations."""
    t = t + 0 * n
    return np.where((t > begin) & (t < end), 1.0, 0.0) * (1 - n) - n


def opened(t: Any, begin: Any, end: Any) -> Any:
    """The solution from n(0) = 0: ½(1 − e^(−2(t − begin))) while open, then its decay."""
    inside = 0.5 * -np.expm1(-2.0 * np.clip(t - begin, 0.0, end - begin))
    return inside * np.exp(-np.maximum(t - end, 0.0))


@sw.system(order=1, shape=(3,))
def may_leonard(t: Any, n: Any, *, a: float = 0.8, b: float = 1.3) -> Any:
    """Three species, each of which suppresses the next."""
    return n * (1 - n - a * np.roll(n, -1) - b * np.roll(n, -2))


def test_random_pulses() -> None:
    """No saved state leaves [0, 1], and all are right, wherever the pulse begins and ends, and the state is asked for."""
    random = np.random.default_rng(7)
    begin = random.uniform(0.5, 8.0, 300)
    end = begin + random.uniform(0.3, 2.0, 300)
    at = np.sort(random.uniform(0.0, 10.0, 12))
    for method, dt in itertools.product(PAIRS, (None, 0.5)):
        run = sw.integrate(gated(begin=begin, end=end), method, y=0.0, dt=dt, tolerance=1e-7, at=at)
        assert (run.status == Status.OK).all(), (method, dt)
        assert run.y == pytest.approx(opened(at[:, np.newaxis], begin, end), abs=1e-5), (method, dt)


def test_a_state_within_a_step_sees_what_its_step_sees() -> None:
    """The pulse lies within the first step, which is long: its stages see nothing of it, and so no state but the last.

    That is made by a step of its own, whose stages do; where it is found out, the steps from there on are short, and the other
    states are theirs: the step to the last time comes before them.
    """
    for method in PAIRS:
        ask: dict[str, Any] = {"y": 0.0, "dt": 1.0, "tolerance": 1e-9}
        run = sw.integrate(gated(begin=0.31, end=0.33), method, at=[0.329], **ask)
        assert run.y == pytest.approx(opened(run.t, 0.31, 0.33), abs=1e-6), method
        assert run.paces.rejected > 0, method
        run = sw.integrate(gated(begin=0.31, end=0.33), method, at=[0.1, 0.315, 0.32, 0.329], **ask)
        assert run.y == pytest.approx(opened(run.t, 0.31, 0.33), abs=1e-6), method
        run = sw.integrate(gated(begin=0.31, end=0.33), method, at=[0.329, 0.7], **ask)
        assert run.y[0] == 0.0, method
        run = sw.integrate(gated(begin=0.31, end=0.33), method, at=[0.329, 0.7], max_step=0.01, **ask)
        assert run.y == pytest.approx(opened(run.t, 0.31, 0.33), abs=1e-6), method


@pytest.mark.parametrize("method", PAIRS)
def test_jumps_are_exact(method: str) -> None:
    """No step crosses a jump, and what begins there is new: as good as without one, and cheaper than to feel for it."""
    begin, end = np.linspace(3.0, 7.0, 9), np.linspace(3.01, 7.5, 9)
    at = np.array([2.0, 3.005, 7.0, 7.2, 10.0])
    felt = sw.integrate(gated(begin=begin, end=end), method, y=0.0, tolerance=1e-10, at=at)
    run = sw.integrate(gated(begin=begin, end=end), method, y=0.0, tolerance=1e-10, at=at, jumps=np.array([begin, end]))
    assert run.y == pytest.approx(opened(at[:, np.newaxis], begin, end), abs=1e-9)
    assert run.paces.rejected.sum() < 0.5 * felt.paces.rejected.sum()


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_jumps_of_all_and_of_each_member_with_times_of_each(backend: str) -> None:
    """Over two batch axes, of which the jumps and the starts may have the last alone; each member is as it would be alone."""
    ask: dict[str, Any] = {"tolerance": 1e-6, "at": [1.5], "backend": backend}
    of_some = np.array([[0.3, 0.31, 0.32], [0.5, 0.51, 0.52]])
    for jumps in (np.array([0.3, 0.5]), of_some, np.concatenate([of_some, of_some + 0.5])):
        for t0 in (0.1, np.array([0.0, 0.1, 0.2]), np.array([[0.0, 0.1, 0.2], [0.05, 0.1, 0.15]])):
            run = sw.integrate(sw.Oscillator(), "merson", v=np.zeros((2, 3)), y=1.0, t0=t0, jumps=jumps, **ask)
            for i, j in np.ndindex(2, 3):
                own = float(np.broadcast_to(t0, (2, 3))[i, j]), jumps if jumps.ndim == 1 else jumps[:, j]
                alone = sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, t0=own[0], jumps=own[1], **ask)
                assert alone.y[-1] == run.y[-1, i, j]


def test_a_jump_at_the_start_and_at_saved_times() -> None:
    """Both sides are on their sides, whether the jump counts to the left or to the right of its time."""
    for at in ([5.0, 6.0, 7.0], [7.0]):
        for jumps in ([5.0, 6.0], [6.0, 5.0, 9.0, -1.0]):
            run = sw.integrate(gated(), "dop853", y=0.0, tolerance=1e-11, at=at, t0=5.0, jumps=jumps)
            assert run.y == pytest.approx(opened(np.array(at), 5.0, 6.0), abs=1e-11)
            assert run.paces.rejected == 0


def test_a_largest_step() -> None:
    """No step is longer; of a decaying state that a pulse meets the steps would be some units long."""
    at, most = np.array([7.4, 9.0]), np.array([0.02, 0.01])
    for method in PAIRS:
        run = sw.integrate(gated(begin=7.3, end=7.33), method, y=0.0, tolerance=1e-8, at=at, max_step=most)
        assert run.y == pytest.approx(np.stack(2 * [opened(at, 7.3, 7.33)], -1), abs=1e-6), method
        assert (run.paces.accepted >= 9.0 / most).all(), method


def test_in_one_piece_or_in_several() -> None:
    """Jumps, the largest step and what must stay positive go on with the run."""
    options: dict[str, Any] = {"tolerance": 1e-6, "jumps": [5.0, 6.0], "max_step": 0.3, "positive": True}
    whole = sw.integrate(gated(), "merson", y=0.0, at=[4.9, 5.5, 8.0], **options)
    first = sw.integrate(gated(), "merson", y=0.0, at=[4.9, 5.5], **options)
    rest = sw.integrate(gated(), "merson", at=[8.0], resume=first)
    assert np.array_equal(whole.y[2:], rest.y)


#: Robertson's reaction at t = 0.4: FACTS, from three solvers.
AT_0_4 = np.array([0.98517211386, 3.386395379e-5, 0.01479402218522])


def test_a_small_component_is_as_good_as_a_large_one() -> None:
    """Robertson's y₂ is 3.6e-5 beside 1."""
    for method, tolerance in itertools.product(PAIRS, (1e-3, 1e-6)):
        run = sw.integrate(rober(), method, y=[1.0, 0.0, 0.0], tolerance=tolerance, at=[0.4])
        # The errors of steps die out with the fast mode, in which y₂ lives: what is left is of a few steps.
        assert run.y[-1] == pytest.approx(AT_0_4, rel=10.0 * tolerance), (method, tolerance)


@pytest.mark.parametrize("method", [*PAIRS, "taylor"])
def test_units_do_not_matter_component_by_component(method: str) -> None:
    """In other units, powers of two, every number of every step is that power times what it was: the same bits."""

    @sw.system(order=1, shape=(3,))
    def lorenz(t: Any, y: Any, *, k: Any = ONES) -> Any:
        x = y / k
        return k * np.array([10.0 * (x[1] - x[0]), x[0] * (28.0 - x[2]) - x[1], x[0] * x[1] - 8.0 / 3.0 * x[2]])

    units = 2.0 ** np.array([40.0, -13.0, -90.0])
    start = np.array([1.0, 2.0, 20.0])
    plain = sw.integrate(lorenz(), method, y=start, tolerance=1e-6, at=[1.0, 5.0])
    other = sw.integrate(lorenz(k=units), method, y=start * units, tolerance=1e-6, at=[1.0, 5.0])
    assert np.array_equal(other.y, plain.y * units)


def test_a_cascade_from_zero_goes_on() -> None:
    """Forty vessels, the first full: the last fills with the fortieth power of the time, in which no method has an order."""

    cascade = sw.system(order=1, shape=(40,))(lambda t, y: np.concatenate([[-y[0]], y[:-1] - y[1:]]))
    start = np.zeros(40)
    start[0] = 1.0
    from scipy.stats import poisson

    for method in PAIRS:
        run = sw.integrate(cascade(), method, y=start, tolerance=1e-6, at=[10.0], max_steps=5000)
        assert run.status == Status.OK
        assert run.y[-1] == pytest.approx(poisson.pmf(np.arange(40), 10.0), rel=1e-4, abs=1e-12)


def test_rows_and_blocks() -> None:
    """What is equivalent counts together: turned about, a run takes the same steps, but for roundings."""
    for scale in ("row", "block"):

        @sw.system(shape=(2, 2), scale=scale)
        def two(t: Any, v: Any, y: Any) -> Any:
            r = y[1] - y[0]
            pull = r / (r[0] ** 2 + r[1] ** 2) ** 1.5
            return np.array([pull, -pull])

        steps = []
        for angle in (0.0, 0.7):
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            v, y = np.array([[0.0, 0.5], [0.0, -0.5]]) @ turn, np.array([[1.0, 0.0], [-1.0, 0.0]]) @ turn
            run = sw.integrate(two(), "dop853", v=v, y=y, tolerance=1e-9, at=[5.0])
            steps.append(int(run.paces.accepted) + int(run.paces.rejected))
        assert steps[0] == steps[1], (scale, steps)


def test_tolerances_of_components() -> None:
    """As SciPy's: an absolute part for each, in its own units; one that is loose on one component is loose on that alone."""
    fine = sw.integrate(rober(), "dop853", y=[1.0, 0.0, 0.0], tolerance=(1e-9, np.array([1e-9, 1e-14, 1e-9])), at=[0.4])
    assert fine.y[-1] == pytest.approx(AT_0_4, rel=1e-8)
    loose = sw.integrate(rober(), "dop853", y=[1.0, 0.0, 0.0], tolerance=(1e-9, np.array([1e-9, 1e-3, 1e-9])), at=[0.4])
    assert loose.paces.accepted < fine.paces.accepted
    solution = sw.solve_ivp(rober().definition, (0.0, 0.4), [1.0, 0.0, 0.0], rtol=1e-9, atol=[1e-9, 1e-14, 1e-9])
    assert solution.y[:, -1] == pytest.approx(AT_0_4, rel=1e-8)
    of_each = np.array([[1e-9], [1e-14], [1e-9]])
    batch = sw.integrate(rober(), "dop853", y=np.tile([[1.0], [0.0], [0.0]], 2), tolerance=(1e-9, of_each), at=[0.4])
    assert np.array_equal(batch.y[-1], np.stack(2 * [fine.y[-1]], -1))
    with pytest.raises(ShapeError, match=r"may be meant for each component of y or for each member"):
        sw.integrate(rober(), "dop853", y=np.ones((3, 3)), tolerance=(1e-9, np.ones(3)), at=[0.4])


def test_three_species_stay_positive() -> None:
    for method, tolerance in itertools.product(PAIRS, (1e-3, 1e-9)):
        ask: dict[str, Any] = {"tolerance": tolerance, "at": np.linspace(10.0, 300.0, 30), "positive": True}
        run = sw.integrate(may_leonard(), method, y=[0.6, 0.6, 0.1], **ask)
        assert (run.status == Status.OK).all(), (method, tolerance)
        assert (run.y >= 0.0).all(), (method, tolerance)
        assert run.y.max() < 1.2, (method, tolerance)


def test_what_cannot_stay_positive_is_told() -> None:
    """ẏ = −1 is at zero at t = 1, and nothing keeps it there."""
    falls = sw.system(order=1)(lambda t, y: -1.0 + 0.0 * y)
    with pytest.warns(sw.ToleranceWarning):
        run = sw.integrate(falls(), "merson", y=1.0, tolerance=1e-6, at=[0.5, 2.0], positive=True)
    assert run.status == Status.UNDERFLOW
    assert run.paces.t == pytest.approx(1.0, abs=1e-9)
    assert run.y[0] == pytest.approx(0.5)


def test_some_components_alone() -> None:
    """An oscillation about zero goes on beside a concentration that must not become negative."""

    both = sw.system(order=1, shape=(3,))(lambda t, y: np.array([y[1], -y[0], -50.0 * y[2]]))
    for which in (2, [2], ("y", 2)):
        run = sw.integrate(both(), "merson", y=[1.0, 0.0, 1.0], tolerance=1e-2, at=np.linspace(0.1, 9.0, 20), positive=which)
        assert (run.y[:, 2] >= 0.0).all()
        assert (run.y[:, 0] < -0.5).any()
    for wrong in (3, ("x", 0), ("y", 0, 0), 1.5, "z"):
        with pytest.raises((ArgumentError, ShapeError), match="positive"):
            sw.integrate(both(), "merson", y=[1.0, 0.0, 1.0], tolerance=1e-2, at=[1.0], positive=wrong)
    with pytest.raises(ArgumentError, match=r"positive: expected a start at which y\[1\] is not negative, got -1"):
        sw.integrate(both(), "merson", y=[1.0, -1.0, 1.0], tolerance=1e-2, at=[1.0], positive=True)
    with pytest.raises(UnsupportedError, match="positive: taylor"):
        sw.integrate(both(), "taylor", y=[1.0, 0.0, 1.0], tolerance=1e-2, at=[1.0], positive=2)


@pytest.mark.parametrize("method", [*PAIRS, "taylor"])
def test_backward(method: str) -> None:
    """There and back; a run back is that of the reversed equations, to the bit."""

    driven = sw.system(order=1, shape=(2,))(lambda t, y: np.array([y[1], np.sin(3.0 * t) - 0.1 * y[1] - y[0] ** 3]))

    @sw.system(order=1, shape=(2,))
    def reversed_time(s: Any, y: Any) -> Any:
        t = -s
        return np.array([-y[1], -(np.sin(3.0 * t) - 0.1 * y[1] - y[0] ** 3)])

    there = sw.integrate(driven(), method, y=[1.0, 0.0], tolerance=1e-11, at=[5.0])
    back = sw.integrate(driven(), method, y=there.y[-1], t0=5.0, tolerance=1e-11, at=[2.5, 0.0, -1.0])
    assert np.array_equal(back.t, [2.5, 0.0, -1.0])
    # The damped motion is undamped going back: errors of some hundred steps grow by e^0.5.
    assert back.y[1] == pytest.approx([1.0, 0.0], abs=1e-8)
    again = sw.integrate(reversed_time(), method, y=there.y[-1], t0=-5.0, tolerance=1e-11, at=[-2.5, 0.0, 1.0])
    assert np.array_equal(back.y, again.y)


def test_backward_for_built_in_and_large_systems() -> None:
    """Back where they came from; large systems step by rows and not by a tape."""
    for scene in (sw.scenes.scene("figure_eight"), sw.scenes.scene("plummer")):
        there = sw.integrate(scene.system, "dop853", v=scene.v, y=scene.y, tolerance=1e-10, at=[0.2])
        back = sw.integrate(scene.system, "dop853", v=there.v[-1], y=there.y[-1], t0=0.2, tolerance=1e-10, at=[0.0])
        assert back.y[-1] == pytest.approx(scene.y, abs=1e-6)


ACCEPTANCES = [Acceptance(), Acceptance((0, 1, 2, 3, 4, 5)), Acceptance((0, 0, 1, 2, 3, 3), own=True)]
ACCEPTANCES += [Acceptance((0, 0, 0, 1, 1, 2), positive=(1, 5)), Acceptance(own=True, positive=(0,))]
ACCEPTANCES += [Acceptance((0, NO_GROUP, 0, 1, NO_GROUP, 2), own=True), Acceptance((*3 * (NO_GROUP,), 0, 0, 0))]


def test_attempts_are_one_graph() -> None:
    """The same graph of operations as the reference, so equal bits for every input."""

    springs = sw.system(shape=(3,))(lambda t, v, y, *, k=2.0: -k * np.roll(y, 1) + np.cos(t) * v)
    system = springs().for_state_shapes(np.zeros(3), np.zeros(3))
    for method, backward, acceptance in itertools.product([*PAIRS, "taylor"], (False, True), ACCEPTANCES):
        plan = engine.Plan(system, sw.method(method), (), 1.0, acceptance=acceptance, backward=backward)
        for what in ("attempt", "begin"):
            tape = _core.Tape()
            core = tape.trace(engine.model(plan), what)
            orders = [0] if what == "attempt" else []
            reference = getattr(Tracer(plan.system, tape), what)(plan.method, *orders, acceptance, backward=backward)
            assert [each.id for each in core] == [each.id for each in reference], (method, backward, acceptance, what)


def test_equal_bits_with_everything() -> None:
    """Jumps of each member, largest steps, positive states, tolerances of components; on every way through the core."""
    random = np.random.default_rng(11)
    ask: dict[str, Any] = {
        "y": random.uniform(0.05, 1.0, (3, 40)),
        "tolerance": (random.uniform(1e-7, 1e-5, (3, 1)), random.uniform(1e-9, 1e-7, 40)),
        "at": [0.5, 3.0, 9.0],
        "jumps": np.sort(random.uniform(0.0, 9.0, (3, 40)), axis=0),
        "max_step": random.uniform(0.1, 2.0, 40),
        "positive": [0, 2],
    }
    for method in ("merson", "dop853"):
        assert_equal_ways(may_leonard(), method, ways=("by the reference", "at each level"), **ask)


def test_scenes_sweeps_and_solve_ivp() -> None:
    """The same options, and the same numbers."""
    options: dict[str, Any] = {"jumps": [7.3, 7.33], "max_step": 0.4, "positive": True}
    system, at = gated(begin=7.3, end=7.33), [7.32, 8.0]
    run = sw.integrate(system, "merson", y=0.1, tolerance=1e-8, at=at, **options)
    scene = sw.scenes.Scene(system, y=0.1, horizon=8.0, **options)
    assert np.array_equal(scene.run("merson", tolerance=1e-8, at=at).y, run.y)
    pytest.importorskip("xarray")
    swept = sw.sweep(gated, {"begin": ("run", [7.3]), "end": ("run", [7.33])}, "merson", y=0.1, tolerance=1e-8, at=at, **options)
    assert swept.y_last.values[0] == run.y[-1]
    with pytest.raises(ArgumentError, match="max_step: works with tolerance= and at= only"):
        sw.integrate(system, "merson", y=0.1, dt=0.1, steps=2, max_step=0.1)


def test_members_at_rest_do_not_count_as_one_of_the_block() -> None:
    """Each component of v and of y is one group: no number of the batch is one of the measure of another member."""
    hangs = sw.system(lambda t, v, y: -np.sin(y))
    v, y = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    for method, at in (("merson", [0.01, 4.0]), ("taylor", [0.01])):
        run = assert_equal_ways(hangs(), method, ways=("by the reference",), v=v, y=y, tolerance=1e-6, at=at)
        assert run.paces.accepted[0] < 100


@sw.system(order=1)
def adds(t: Any, y: Any, *, u: float = 0.0) -> Any:
    """ẏ = u."""
    return u + 0.0 * y


def test_steps_end_where_held_samples_change() -> None:
    """The integral of held samples, forward and back: no step sees two of them, and none is rejected.

    Bound: a sample begins some 2⁻⁴⁴ of the time since the first early (HOLD_SLACK), and within four roundings of a time of that.
    """
    values = np.array([0.0, 1.0, -2.0, 3.0, 4.0, -1.0])
    for method, interval, start in itertools.product(PAIRS, (1.0, 0.1, 1e-7, 3e5), (0.0, -2.5, 1e4)):
        if interval < 1e-9 * start:  # samples are shorter than the roundings of their times are allowed to be
            continue
        u, times = sw.Sampled(values, interval=interval, start=start), start + interval * np.arange(6)
        sums = interval * np.concatenate([[0.0], np.cumsum(values[:-1])])
        bound = 4.0 * 8.0 * (2.0**-44 * 5.0 * interval + 16.0 * np.spacing(abs(start) + 5.0 * interval))
        forward = sw.integrate(adds(u=u), method, y=0.0, t0=start, tolerance=1e-9, at=times)
        back = sw.integrate(adds(u=u), method, y=sums[-1], t0=times[-1], tolerance=1e-9, at=times[::-1])
        for run, right in ((forward, sums), (back, sums[::-1])):
            np.testing.assert_allclose(run.y, right, rtol=0, atol=bound, err_msg=f"{method}, {interval}, {start}")
            assert run.paces.rejected == 0, (method, interval, start)


with_pole = sw.system(order=1)(lambda t, y, *, pole=1.0: -y / (t - pole))


@pytest.mark.parametrize(
    ("pole", "first", "backend"), [(1.0, None, "rust"), (0.3, 0.01, "numpy"), (7.3, 0.4, "rust"), (-2.0, None, "rust")]
)
def test_a_pole_of_which_a_method_happens_to_be_exact_is_not_passed(pole: float, first: float | None, backend: Any) -> None:
    """Of ẏ = −y/(t − a) the solution y₀·a/(a − t) has a pole at t = a. Fehlberg's formulas continue it exactly behind the pole.

    Their estimate of the error is then rounding: such a step was accepted, and y(2a) was −y₀. It ends where the relative rounding
    of t − a, 2⁻⁵³·a/|t − a|, is what is tolerated, or nearer: within 10⁻⁹ of the pole, at 10⁻⁶.
    """
    system = with_pole(pole=pole)
    for method, tolerance in itertools.product(("fehlberg", "fehlberg_5"), (1e-3, 1e-6)):
        with pytest.warns(sw.ToleranceWarning, match=r"the run stopped before t = .*, at t = "):
            run = sw.integrate(system, method, y=1.5, tolerance=tolerance, at=[2.0 * pole], dt=first, backend=backend)
        assert run.status in (Status.UNDERFLOW, Status.NOT_FINITE)
        assert abs(run.stopped_at - pole) < 1e-9 * abs(pole)
        before = sw.integrate(system, method, y=1.5, tolerance=tolerance, at=[0.9 * pole])
        # Its relative error is that of t − a, and each of its steps errs by no more than is tolerated of what it has become.
        np.testing.assert_allclose(before.y[-1], 15.0, rtol=tolerance * float(before.paces.accepted + 1))
