"""Steps of chosen length: the reference's bits, every member at its own pace, errors that follow the tolerance."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from cases import SYSTEMS
from stepwell.errors import ArgumentError, StepwellError, UnsupportedError
from stepwell.result import Status

ABLE = [m.name for m in sw.methods() if m.error_order is not None]
MEMBERS = 21


def start(system: sw.System, rng: np.random.Generator, members: int = MEMBERS) -> dict[str, Any]:
    system = system.sized(np.zeros(2), np.zeros(2)) if not isinstance(system, sw.NBody) else system
    return {"v": 0.3 * rng.normal(size=(*system.v_shape, members)), "y": rng.normal(size=(*system.y_shape, members))}


def kepler(e: Any = 0.9) -> tuple[sw.NBody, dict[str, Any]]:
    """A body without mass round one of mass 1, from the point where they are nearest; a period is 2π."""
    e = np.asarray(e)
    v, y = np.zeros((2, 2, *e.shape)), np.zeros((2, 2, *e.shape))
    y[1, 0], v[1, 1] = 1.0 - e, np.sqrt((1.0 + e) / (1.0 - e))
    return sw.NBody([1.0, 0.0], force="newton"), {"v": v, "y": y}


def same(a: sw.Run, b: sw.Run) -> None:
    assert np.array_equal(a.v, b.v, equal_nan=True)
    assert np.array_equal(a.y, b.y, equal_nan=True)
    assert np.array_equal(a.status, b.status)
    for ours, theirs in zip(a.paces, b.paces, strict=True):  # type: ignore[arg-type]
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("name", "method"),
    [
        pytest.param(name, method, marks=() if j == i % len(ABLE) else pytest.mark.long)
        for i, name in enumerate(SYSTEMS)
        for j, method in enumerate(ABLE)
    ],
)
def test_equals_the_reference(name: str, method: str) -> None:
    rng = np.random.default_rng(5)
    system = SYSTEMS[name](rng, MEMBERS)
    ask: dict[str, Any] = {"tolerance": 10.0 ** rng.uniform(-9, -2, MEMBERS), "at": [0.0, 0.11, 0.5, 0.53], "max_steps": 300}
    ask |= start(system, rng)
    if name.startswith("thirty-five"):
        ask["at"] = [0.0, 0.11]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.ToleranceWarning)  # a sample that jumps takes some members' last step
        same(*(sw.integrate(system, method, backend=backend, **ask) for backend in ("rust", "numpy")))


@pytest.mark.parametrize("level", sw._core.isa_levels())
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_every_level_and_number_of_threads(monkeypatch: pytest.MonkeyPatch, level: str, threads: int) -> None:
    system, state = kepler(np.linspace(0.0, 0.9, 300))
    ask: dict[str, Any] = {"tolerance": 1e-5, "at": [1.0, 2.0]} | state
    whole = sw.integrate(system, "merson", threads=1, **ask)
    monkeypatch.setenv("STEPWELL_ISA", level)
    same(whole, sw.integrate(system, "merson", threads=threads, **ask))


@pytest.mark.parametrize("method", ABLE)
def test_a_hard_member_changes_nobody(method: str) -> None:
    """Alone, or beside an orbit that needs more than twice the steps: the same states, the same steps."""
    e = np.where(np.arange(40) % 8 == 3, 0.995, 0.1)
    system, state = kepler(e)
    ask: dict[str, Any] = {"tolerance": 1e-7, "at": [3.0, 6.0]}
    whole = sw.integrate(system, method, **ask, **state)
    for member in (0, 3, 39):
        alone = sw.integrate(system, method, **ask, **kepler(e[member])[1])
        assert np.array_equal(alone.y, whole.y[..., member])
        assert alone.paces is not None
        assert whole.paces is not None
        assert alone.paces.accepted == whole.paces.accepted[member]
        assert alone.paces.h == whole.paces.h[member]
    assert whole.paces.evaluations[3] > 2 * whole.paces.evaluations[0]
    assert np.array_equal(whole.paces.evaluations, sw.method(method).evaluations * (whole.paces.accepted + whole.paces.rejected))


@pytest.mark.parametrize("method", ABLE)
@pytest.mark.parametrize(("orbit", "coarsest"), [("kepler", 4.0), ("arenstorf", 6.0)])
def test_the_error_follows_the_tolerance(orbit: str, coarsest: float, method: str) -> None:
    """Over six decades, after one period.

    The error of a step is of fifth order in it and is held at the tolerance, so steps shorten as its fifth root. The end error of
    a result of order p is then of p/5 in the tolerance: 4/5 for Fehlberg, 1 with local extrapolation. Merson's estimate is too
    large off linear equations, by one power of the step: its end error falls as fast as the tolerance, or a little faster.
    """
    scene = sw.scenes.scene(orbit) if orbit == "arenstorf" else None
    system, state = (scene.system, {"v": scene.v, "y": scene.y}) if scene else kepler()
    end = scene.period if scene else 2.0 * np.pi
    tolerances = 10.0 ** -np.arange(coarsest, coarsest + 7.0)
    runs = [sw.integrate(system, method, tolerance=t, at=[end], **state) for t in tolerances]
    errors = np.array([np.linalg.norm(run.y[-1] - state["y"]) for run in runs])
    line = np.polyfit(np.log10(tolerances), np.log10(errors), 1)
    assert 0.7 < line[0] < 1.2, errors
    assert (np.abs(np.log10(errors) - np.polyval(line, np.log10(tolerances))) < 1.0).all(), errors


def test_times_are_reached_exactly() -> None:
    """However close they lie, and whatever the step: each state is that of its very time."""
    times = np.array([0.0, 1e-9, 0.1, 0.1 + 1e-12, 0.3, 7.0, 7.0 + 2e-15 * 7])
    run = sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1.0, tolerance=1e-12, at=times)
    assert np.array_equal(run.t, times)
    assert run.y[0] == 1.0
    assert run.paces is not None
    # A step adds tolerance·(1 + length) to a block at most, lengths are 1 at most, and an oscillator keeps errors as they are.
    assert np.abs(run.y - np.cos(times)).max() < 1e-12 * 2 * np.sqrt(2) * float(run.paces.accepted)
    assert run.paces.t == times[-1]


def test_asking_more_often_costs_steps_and_keeps_the_accuracy() -> None:
    few, many = (
        sw.integrate(sw.Oscillator(1.0), "fehlberg_5", v=0.0, y=1.0, tolerance=1e-8, at=np.linspace(0, 10, n)) for n in (2, 101)
    )
    assert few.paces is not None
    assert many.paces is not None
    assert few.paces.accepted < many.paces.accepted
    for run in (few, many):
        assert abs(run.y[-1] - np.cos(10.0)) < 1e-6


def test_out_of_steps() -> None:
    """Who has no steps left stops where it is; what was reached before is there, and the neighbours go on."""
    system, state = kepler(np.array([0.1, 0.999, 0.1]))
    at = np.linspace(0.0, 6.0, 7)
    with pytest.warns(
        sw.ToleranceWarning, match=r"1 of 3 member\(s\) stopped before t = 6; first member 1 at t = .*out of max_steps"
    ):
        run = sw.integrate(system, "merson", tolerance=1e-6, at=at, max_steps=100, **state)
    assert run.status.tolist() == [Status.OK, Status.BUDGET, Status.OK]
    assert run.paces is not None
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
    assert run.paces is not None
    assert float(run.paces.t) == pytest.approx(np.pi / 4, abs=1e-5)  # free fall of distance 1 under mass 2: π/2·√(1/(2·2))
    assert np.isfinite(run.y[0]).all()
    assert np.isnan(run.y[1]).all()


def test_rates_that_are_not_finite() -> None:
    y = np.zeros((2, 2))
    with pytest.warns(sw.ToleranceWarning, match="gives finite numbers"):
        run = sw.integrate(sw.NBody([1.0, 1.0], force="newton"), "merson", v=0.0, y=y, tolerance=1e-8, at=[1.0])
    assert run.status == Status.NOT_FINITE


def test_fehlberg_pumps_and_merson_does_not() -> None:
    """FACTS of the undamped oscillator, with steps chosen: Fehlberg's energy grows all the time, Merson's falls."""
    energy = {}
    for method in ABLE:
        run = sw.integrate(sw.Oscillator(1.0), method, v=0.0, y=1.0, tolerance=1e-5, at=np.linspace(0, 2000, 5), record="energy")
        energy[method] = run.recorded["energy"]
    assert (np.diff(energy["merson"]) < 0).all()
    assert (np.diff(energy["fehlberg"]) > 0).all()
    assert (np.diff(energy["fehlberg_5"]) > 0).all()


def test_each_member_its_tolerance() -> None:
    run = sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1.0, tolerance=np.array([1e-4, 1e-8]), at=[10.0])
    assert run.paces is not None
    assert run.paces.accepted[1] > 4 * run.paces.accepted[0]
    pair = sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1.0, tolerance=(1e-4, np.array([1e-4, 1e-8])), at=[10.0])
    assert pair.paces is not None
    assert np.array_equal(pair.y[..., 0], run.y[..., 0])


@pytest.mark.parametrize(
    ("more", "error", "message"),
    [
        ({"method": "rk4"}, UnsupportedError, "rk4 does not estimate its error.*merson"),
        ({"tolerance": None}, ArgumentError, "tolerance: expected too"),
        ({"at": None}, ArgumentError, "at: expected too"),
        ({"tolerance": 0.0}, ArgumentError, "tolerance: expected numbers above zero"),
        ({"tolerance": (1e-3, 1e-3, 1e-3)}, ArgumentError, "expected a number or a pair"),
        ({"at": [1.0, 1.0]}, ArgumentError, "at: expected times that ascend"),
        ({"at": [-1.0]}, ArgumentError, "ascend from t0 = 0"),
        ({"at": 3.0}, ArgumentError, "at: expected times along one axis"),
        ({"at": []}, ArgumentError, "at: expected times along one axis"),
        ({"steps": 3}, ArgumentError, "steps: goes with fixed steps only"),
        ({"every": 3, "form": "matrix"}, ArgumentError, "every, form: goes with fixed steps only"),
        ({"max_steps": 0}, ArgumentError, "max_steps: expected 1 or more"),
        ({"dt": -1.0}, ArgumentError, "dt: expected numbers above zero"),
        ({"tolerance": np.ones(3), "y": np.ones(2)}, ArgumentError, "do not broadcast"),
    ],
)
def test_bad_input_before_any_work(more: dict[str, Any], error: type[StepwellError], message: str) -> None:
    given: dict[str, Any] = {"method": "merson", "v": 0.0, "y": 1.0, "tolerance": 1e-3, "at": [1.0]} | more
    with pytest.raises(error, match=message):
        sw.integrate(sw.Oscillator(1.0), given.pop("method"), **given)


def test_fixed_steps_need_dt_and_steps() -> None:
    with pytest.raises(ArgumentError, match="dt and steps: expected with fixed steps; or give tolerance= and at="):
        sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1.0)


def test_such_a_run_has_no_resume() -> None:
    run = sw.integrate(sw.Oscillator(1.0), "merson", v=0.0, y=1.0, tolerance=1e-3, at=[1.0])
    with pytest.raises(UnsupportedError, match="resume"):
        _ = run.resume
    assert "with a tolerance" in repr(run)
