"""float32: every operation of a step rounded to 24 bits, the same bits by core and reference, and functions of its own."""

import itertools
import re
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, TraceError, UnsupportedError
from support.refusals import refused
from support.ways import assert_equal_ways

F = np.float32


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_members_diverge_where_the_range_of_float32_ends() -> None:
    omega = np.linspace(1.0, 60.0, 40)
    options: dict[str, Any] = {"v": np.zeros(40), "y": np.ones(40), "dt": 0.2, "steps": 400}
    for method in ("false_euler", "verlet", "rk4"):
        run = assert_equal_ways(sw.Oscillator(omega), method, ways=("by the reference",), **options, dtype="float32")
        wide = sw.integrate(sw.Oscillator(omega), method, **options)
        bad = run.first_bad_step
        assert bad[0] == -1
        assert (bad > 0).any()
        assert (bad[wide.first_bad_step > 0] > 0).all()
        assert (bad[bad > 0] != wide.first_bad_step[bad > 0]).any()


@pytest.mark.filterwarnings("ignore:.*did not follow the motion")  # of 300 members that begin anywhere
@pytest.mark.parametrize("members", [3, 300])
def test_a_world_steps_arrays_of_float32_in_place(members: int) -> None:
    """A few numbers are copied, many are stepped where they are; pushed by numbers of float32 that are written between steps."""
    rng = np.random.default_rng(4)
    system, force = sw.Pendulum(rng.uniform(0.5, 2.0, members)), np.zeros(members, dtype=F)
    v, y = (rng.normal(size=members).astype(F) for _ in range(2))
    options: dict[str, Any] = {"dt": 0.1, "dtype": "float32"}
    pushed = sw.integrate(system, "rk4", v=v, y=y, steps=50, every=25, force=0.1, **options)
    world = sw.World(system, "rk4", v=v, y=y, force=force, **options)
    force[:] = 0.1
    world.step(25)
    np.testing.assert_array_equal((v, y), (pushed.v[1], pushed.y[1]))
    later = sw.World(system, "rk4", resume=world)
    assert later.y.dtype == F
    later.step(25)
    np.testing.assert_array_equal(later.y, pushed.y[-1])


def test_a_world_takes_arrays_of_its_dtype_only() -> None:
    for dtype, other in (("float32", np.float64), ("float64", np.float32)):
        with pytest.raises(DTypeError, match=rf"^v: expected dtype {dtype} to step in place, got {np.dtype(other)}"):
            sw.World(sw.Oscillator(), "rk4", v=np.zeros(3, other), y=np.zeros(3, dtype), dt=0.1, dtype=dtype)
    with pytest.raises(UnsupportedError, match=r"does not work with taylor"):
        sw.World(sw.Oscillator(), "taylor", v=np.zeros(1, F), y=np.zeros(1, F), dt=0.1, dtype="float32")


def sampled(interpolation: Any, members: int = 9, samples: int = 40, **options: Any) -> sw.Oscillator:
    values = np.random.default_rng(6).normal(size=(samples, members) if members > 1 else samples)
    return sw.Oscillator(np.linspace(0.7, 1.3, 9), x=sw.Sampled(values, interpolation=interpolation, **options))


@pytest.mark.parametrize("method", ["rk4", "leapfrog"])
@pytest.mark.parametrize("interpolation", ["hold", "linear", "cubic"])
def test_samples(interpolation: str, method: str) -> None:
    """For all members or of each; by many steps, of which machine code is written."""
    options: dict[str, Any] = {"v": np.zeros(9), "y": np.linspace(-1.0, 1.0, 9), "every": 7}
    for members in (1, 9):
        system = sampled(interpolation, members, interval=0.17, start=0.3)
        for fused in (False, True):
            ways = ("by the reference", "in company", "in pieces", "in a world")
            assert_equal_ways(system, method, ways=ways, **options, dt=0.1, steps=60, fused=fused, dtype="float32")
        run = assert_equal_ways(system, method, ways=("at each level",), **options, dt=0.1, steps=300, dtype="float32")
        wide = sw.integrate(system, method, **options, dt=F(0.1), steps=300)
        # Every operation of some thousand rounds to 2⁻²⁴ of numbers of the size of the samples, 3, or of the state.
        assert np.abs(run.y - wide.y).max() < 3000 * 3.0 * 2.0**-24


def test_which_sample_holds_is_exact_however_late_it_is() -> None:
    """After 2²² steps a time of float32 is 0.03 from its neighbours: a third of a step; and samples begin with steps."""
    values = np.random.default_rng(6).normal(size=64)
    for interpolation, dtype in itertools.product(("hold", "linear"), ("float64", "float32")):
        runs = []
        for t0 in (2.0**18, 0.0):
            inputs = sw.Sampled(values, 0.0625, start=t0 + 0.0625, interpolation=interpolation)  # type: ignore[arg-type]
            options: dict[str, Any] = {"v": 0.0, "y": 0.0, "dt": 0.0625, "steps": 60, "every": 1, "dtype": dtype}
            runs.append(sw.integrate(sw.Oscillator(0.1, x=inputs), "rk4", t0=t0, **options))
        np.testing.assert_array_equal(runs[0].y, runs[1].y)


PENDULA = sw.Pendulum(np.linspace(0.5, 2.0, 9))
START: dict[str, Any] = {"v": np.linspace(-0.5, 0.5, 9), "y": np.linspace(1.0, 2.5, 9)}
#: What the array of ways does not have.
OPTIONS: list[dict[str, Any]] = [
    {"tolerance": (1e-5, 1e-6)}, {"max_step": 0.05}, {"jumps": [0.33, 0.9]}, {"dt": 0.01, "positive": True},
]  # fmt: skip


def test_adaptive_steps_with_options() -> None:
    for options in OPTIONS:
        ask = {"tolerance": 1e-5, "at": [0.7, 1.1, 5.0], "dtype": "float32"} | START | options
        run = assert_equal_ways(PENDULA, "merson", ways=("by the reference", "at each level", "alone", "in company"), **ask)
        assert run.y.dtype == run.v.dtype == F


@pytest.mark.parametrize("interpolation", ["hold", "linear", "cubic"])
def test_adaptive_steps_with_samples(interpolation: str) -> None:
    state: dict[str, Any] = {"v": np.zeros(9), "y": np.linspace(-1.0, 1.0, 9)}
    for members, t0, at in ((9, 0.5, [0.7, 1.1, 5.0]), (1, 4.0, [3.3, 1.0])):
        system = sampled(interpolation, members, interval=0.17, start=0.3)
        ask = state | {"t0": t0, "at": at}
        run = assert_equal_ways(system, "dop853", ways=("by the reference",), **ask, tolerance=1e-5, dtype="float32")
        wide = sw.integrate(system, "dop853", **ask, tolerance=1e-9)
        assert np.abs(run.y - wide.y).max() < 2e-3


@pytest.mark.parametrize("method", ["merson", "fehlberg", "fehlberg_5", "dop853"])
def test_errors_follow_the_tolerance_down_to_rounding(method: str) -> None:
    """And the time is not rounded: at t = 2¹⁴ a time of float32 is 0.001 from its neighbours."""
    at, errors = np.linspace(0.1, 10.0, 100), []
    for tolerance in (1e-2, 1e-4, 1e-6, 2.0**-23):
        ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": tolerance, "dtype": "float32"}
        run, late = (sw.integrate(sw.Oscillator(), method, t0=t0, at=t0 + at, **ask) for t0 in (0.0, 2.0**14))
        errors.append(np.abs(run.y - np.cos(run.t)).max())
        assert np.abs(late.y - run.y).max() <= 4 * errors[-1] + 20 * 2.0**-24
        assert run.paces.accepted.max() < 3000
    assert errors[0] > 3 * errors[1] > 3 * errors[2]
    assert errors[-1] < 200 * 2.0**-24


def test_it_is_what_numpy_makes_of_numbers_of_float32() -> None:
    """Written out, without tapes: v ← v − Φ·y, y ← y + Φ·v with Φ = ω₀·h, and a drive whose time is rounded once."""
    omega, dt = F(1.7), F(0.1)
    v, y, phi = F(0.0), F(1.0), omega * dt
    seen = []
    for _ in range(200):
        v = v - phi * y
        y = y + phi * v
        seen.append(y)
    assert isinstance(y, F)
    run = sw.integrate(sw.Oscillator(1.7), "false_euler", v=0.0, y=1.0, dt=0.1, steps=200, every=1, dtype="float32")
    np.testing.assert_array_equal(run.y[1:], np.array(seen))
    assert run.dt == float(dt) != 0.1
    np.testing.assert_array_equal(run.t, np.arange(201) * float(dt))


def test_its_error_is_that_of_24_bits() -> None:
    """RK4 on an oscillator has 4 stages of 4 operations, each rounding to 2⁻²⁴ of numbers below 1.2: 20·2⁻²⁴ a step at most."""
    options: dict[str, Any] = {"v": 0.0, "y": np.linspace(0.5, 1.0, 64), "dt": F(0.1), "steps": 500, "every": 1}
    wide, run = (sw.integrate(sw.Oscillator(), "rk4", **options, dtype=dtype) for dtype in ("float64", "float32"))
    apart = np.abs(run.y - wide.y).max(axis=1)
    assert (apart <= 20 * 2.0**-24 * np.maximum(1, np.arange(501))).all()
    assert apart[-1] > 2.0**-26  # and it is not float64


def test_quantities_are_computed_in_float64_from_the_states() -> None:
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 50, "every": 1, "dtype": "float32", "record": "energy"}
    run = sw.integrate(sw.Oscillator(), "rk4", **options)
    assert run.energy.dtype == np.float64
    v, y = run.v.astype(float), run.y.astype(float)
    np.testing.assert_allclose(run.energy, 0.5 * (v * v + y * y), rtol=1e-15)
    assert "float32" in repr(run)
    assert run.dtype == "float32"


@sw.system
def swinging(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
    return -k * np.sin(y)


@swinging.invariant
def energy(v: Any, y: Any, *, k: Any) -> Any:
    return 0.5 * v * v - k * np.cos(y)


OF_BODIES, OF_OWN = (sw.EnergyControl(1.0), sw.Projection()), (sw.Control("energy", 5.0), sw.Control("energy", 1.0, "printed"))


@pytest.mark.parametrize("control", [*OF_BODIES, *OF_OWN, sw.Projection("energy")])
def test_a_control_keeps_the_energy_as_well_as_that_of_float64(control: Any) -> None:
    """Each of some hundred operations of an energy is rounded to 2⁻²⁴ of numbers of its size or some times larger."""
    rng = np.random.default_rng(5)
    system: Any = sw.NBody(softening=0.3) if control in OF_BODIES else swinging(k=np.linspace(0.5, 2.0, 20))
    start = (
        {"v": 0.3 * rng.normal(size=(3, 2, 20)), "y": rng.normal(size=(3, 2, 20))}
        if control in OF_BODIES
        else {"v": 0.3, "y": 1.0}
    )
    options: dict[str, Any] = start | {"dt": 0.01, "steps": 300, "every": 50, "control": control}
    for method in ("rk4", "false_euler"):
        run, wide = (sw.integrate(system, method, **options, dtype=dtype) for dtype in ("float32", "float64"))
        drift, drift_wide = (np.abs(each.energy - each.energy[0]).max() for each in (run, wide))
        assert abs(drift - drift_wide) < 500 * 2.0**-24 * (1.0 + np.abs(run.energy[0]).max())


def test_what_is_asked_for_as_in_numpy() -> None:
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1}
    for dtype in ("float32", np.float32, np.dtype("float32"), np.zeros(1, np.float32).dtype):
        assert sw.integrate(sw.Oscillator(), "rk4", **ask, dtype=dtype).y.dtype == F, dtype  # type: ignore[arg-type]
    for other in ("float16", np.int32, "double precision", 32, np.complex64, "", object()):
        with pytest.raises(DTypeError, match=r"^dtype: expected 'float64' or 'float32', got "):
            sw.integrate(sw.Oscillator(), "rk4", **ask, dtype=other)  # type: ignore[arg-type]


PACED: dict[str, Any] = {"dt": None, "steps": None, "method": "merson", "tolerance": 1e-3, "at": [1.0]}
REFUSED: list[tuple[Any, dict[str, Any], str]] = [
    (sw.Oscillator(), PACED | {"tolerance": 1e-7}, "tolerance: in float32 a step rounds the state by up to 2⁻²³"),
    (sw.Oscillator(), PACED | {"tolerance": (1e-9, 1e-8)}, "got 1.1e-08 of the size at the start"),
    (sw.Oscillator(), PACED | {"y": 1e39}, "y: expected numbers up to 3.4e38"),
    (sw.Oscillator(), PACED | {"method": "taylor"}, "does not work with taylor, whose series"),
    (sw.Oscillator(x=sw.Sampled([0.0, 1e39], 1.0)), {}, "samples of x: expected numbers up to 3.4e38"),
    (sw.Oscillator(x=sw.Sinusoid(1.0, 1e9)), {}, "a sinusoid's angle may grow to"),
    (sw.Oscillator(), {"dt": 1e-50}, "dt: expected a number of size 1.4e-45 to 3.4e38 units of time in float32"),
    (sw.Oscillator(), {"y": 1e39}, "y: expected numbers up to 3.4e38"),
    (sw.Oscillator(1e39), {"dt": 1e-30}, "omega: expected numbers up to 3.4e38"),
    (sw.NBody(np.ones(60)), {"v": np.zeros((60, 2)), "y": np.random.default_rng(0).normal(size=(60, 2))}, "is too long"),
    (sw.Oscillator(), {"method": "taylor"}, "does not work with taylor, whose series"),
]


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_what_does_not_go_with_float32(backend: Any) -> None:
    ask: dict[str, Any] = {"method": "rk4", "v": 0.0, "y": 1.0, "dt": 0.1, "steps": 100, "dtype": "float32", "backend": backend}
    for system, options, message in REFUSED:
        refused((UnsupportedError, ArgumentError, TraceError), re.escape(message), sw.integrate, system, **ask | options)


def test_warnings_are_those_of_its_range() -> None:
    ask: dict[str, Any] = {"y": 0.0, "dt": 0.1, "steps": 100, "dtype": "float32"}
    with pytest.warns(sw.AccuracyWarning, match=r"beyond 2\.1e\+06 rad"):
        sw.integrate(sw.Pendulum(), "rk4", v=1e6, **ask)
    sw.integrate(sw.Pendulum(), "rk4", v=1.0, **ask)  # no warning, which would be an error


def test_a_chart_has_a_curve_of_each() -> None:
    steps = [200, 400, 800, 12800]
    chart = sw.charts.work_precision("oscillator", ["rk4"], steps, tolerances=[], fused="both", dtype="both")
    names = ["rk4", "rk4, fused", "rk4, float32", "rk4, fused, float32"]
    assert [curve.name for curve in chart.curves] == names
    assert [curve.dtype for curve in chart.curves] == ["float64", "float64", "float32", "float32"]
    wide, _, half, _ = ([point.state_error for point in curve.points] for curve in chart.curves)
    # Where the method errs by more than float32 rounds, both err alike; then float32 stays where it is, or worse.
    scene = sw.scenes.scene("oscillator")
    rounded = 20 * 2.0**-24 * np.array(steps)
    assert (np.abs(np.subtract(wide, half)) <= rounded * np.abs(scene.exact(np.zeros(1))[1]).max()).all()
    assert half[-1] > 1e3 * wide[-1]
    chart.plot()
    refused(ArgumentError, "dtype", sw.charts.work_precision, "oscillator", ["rk4"], steps, dtype="half")
