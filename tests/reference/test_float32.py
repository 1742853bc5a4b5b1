"""float32: every operation of a step rounded to 24 bits, the same bits by core and reference, and functions of its own."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, TraceError, UnsupportedError
from support.cases import Case, assert_same

F = np.float32

# ---- the same bits: test_bits.py and test_adaptive.py have every system and method


def test_it_does_not_depend_on_threads_company_or_pieces() -> None:
    case = Case("verlet", "pendulum, sinusoid a", "direct", "second_order")
    together = case.run(700, dtype="float32", threads=1, every=1)
    assert_same(case.run(700, dtype="float32", threads=7, every=1), together)
    system, arguments = case.make(700)
    run = sw.integrate(system, **arguments, dtype="float32", steps=9)
    run = sw.integrate(system, case.method, resume=run, steps=14, every=1)
    np.testing.assert_array_equal(run.y[-1], together.y[-1])
    np.testing.assert_array_equal(run.v[-1], together.v[-1])


@pytest.mark.parametrize("method", ["false_euler", "verlet", "rk4"])
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_members_diverge_where_the_range_of_float32_ends(method: str) -> None:
    system = sw.Oscillator(np.linspace(1.0, 60.0, 40))
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.2, "steps": 400, "dtype": "float32"}
    run = sw.integrate(system, method, **options)
    assert_same(run, sw.integrate(system, method, **options, backend="numpy"))
    wide = sw.integrate(system, method, **(options | {"dtype": "float64"}))
    bad = run.first_bad_step
    assert bad[0] == -1
    assert (bad > 0).any()
    assert (bad[wide.first_bad_step > 0] > 0).all()
    assert (bad[bad > 0] != wide.first_bad_step[bad > 0]).any()


@pytest.mark.filterwarnings("ignore:.*did not follow the motion")  # of 300 members that begin anywhere
@pytest.mark.parametrize("members", [3, 300])
@pytest.mark.parametrize("method", ["false_euler", "verlet", "rk4"])
def test_a_world_steps_arrays_of_float32_in_place(method: str, members: int) -> None:
    """A few numbers are copied, many are stepped where they are; a force changes between steps; another world goes on."""
    rng = np.random.default_rng(4)
    system = sw.Pendulum(rng.uniform(0.5, 2.0, members))
    v, y = (rng.normal(size=members).astype(F) for _ in range(2))
    options: dict[str, Any] = {"dt": 0.1, "dtype": "float32"}
    run = sw.integrate(system, method, v=v, y=y, steps=300, every=100, **options)
    world = sw.World(system, method, v=v, y=y, **options)
    for i in (1, 2):
        world.step(100)
        np.testing.assert_array_equal(y, run.y[i])
        np.testing.assert_array_equal(v, run.v[i])
    later = sw.World(system, method, dt=0.1, resume=world)
    assert later.y.dtype == F
    later.step(100)
    np.testing.assert_array_equal(later.y, run.y[3])
    on = sw.integrate(system, method, dt=0.1, steps=100, resume=world)
    np.testing.assert_array_equal(on.y[-1], run.y[3])
    # Pushed from outside, by numbers of float32.
    force = np.zeros(members, dtype=F)
    v, y = (rng.normal(size=members).astype(F) for _ in range(2))
    pushed = sw.integrate(system, "rk4", v=v, y=y, steps=50, force=0.1, **options)
    world = sw.World(system, "rk4", v=v, y=y, force=force, **options)
    force[:] = 0.1
    world.step(50)
    np.testing.assert_array_equal(y, pushed.y[-1])


def test_a_world_takes_arrays_of_its_dtype_only() -> None:
    for dtype, other in (("float32", np.float64), ("float64", np.float32)):
        with pytest.raises(DTypeError, match=rf"^v: expected dtype {dtype} to step in place, got {np.dtype(other)}"):
            sw.World(sw.Oscillator(), "rk4", v=np.zeros(3, other), y=np.zeros(3, dtype), dt=0.1, dtype=dtype)
    with pytest.raises(UnsupportedError, match=r"does not work with taylor"):
        sw.World(sw.Oscillator(), "taylor", v=np.zeros(1, F), y=np.zeros(1, F), dt=0.1, dtype="float32")


# ---- sampled inputs

METHODS = ["rk4", "false_euler", "verlet", "leapfrog", "dop853"]


def sampled(interpolation: Any, members: int = 9, samples: int = 40, **options: Any) -> sw.Oscillator:
    values = np.random.default_rng(6).normal(size=(samples, members) if members > 1 else samples)
    return sw.Oscillator(np.linspace(0.7, 1.3, 9), x=sw.Sampled(values, interpolation=interpolation, **options))


@pytest.mark.parametrize("members", [1, 9])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("interpolation", ["hold", "linear", "cubic"])
def test_samples(interpolation: str, method: str, members: int, monkeypatch: pytest.MonkeyPatch) -> None:
    system = sampled(interpolation, members, interval=0.17, start=0.3)
    options: dict[str, Any] = {"v": 0.0, "y": np.linspace(-1.0, 1.0, 9), "dt": 0.1, "dtype": "float32"}
    runs = []
    for level in sw.isa_levels():
        monkeypatch.setenv("STEPWELL_ISA", level)
        runs.append(sw.integrate(system, method, **options, steps=300, every=7))
    for fused in (False, True):
        run, again = (
            sw.integrate(system, method, **options, steps=60, every=7, fused=fused, backend=backend)
            for backend in ("rust", "numpy")
        )
        assert_same(run, again)
    for run in runs[1:]:
        assert_same(run, runs[0])
    head = sw.integrate(system, method, **options, steps=123)
    tail = sw.integrate(system, method, resume=head, steps=177)
    np.testing.assert_array_equal(tail.y[-1], runs[0].y[-1])
    v, y = np.zeros(9, F), options["y"].astype(F)
    world = sw.World(system, method, v=v, y=y, dt=0.1, dtype="float32")
    world.step(300)
    np.testing.assert_array_equal(y, runs[0].y[-1])
    wide = sw.integrate(system, method, **(options | {"dtype": "float64", "dt": F(0.1)}), steps=300, every=7)
    # Every operation of some thousand rounds to 2⁻²⁴ of numbers of the size of the samples, 3, or of the state.
    assert np.abs(runs[0].y - wide.y).max() < 3000 * 3.0 * 2.0**-24


@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_which_sample_holds_is_exact_however_late_it_is(interpolation: str) -> None:
    """After 2²² steps a time of float32 is 0.03 from its neighbours: a third of a step; and samples begin with steps."""
    values = np.random.default_rng(6).normal(size=64)
    t0 = 2.0**18
    start = t0 + 0.0625
    for dtype in ("float64", "float32"):
        system = sw.Oscillator(0.1, x=sw.Sampled(values, 0.0625, start=start, interpolation=interpolation))  # type: ignore[arg-type]
        run = sw.integrate(system, "rk4", v=0.0, y=0.0, dt=0.0625, steps=60, t0=t0, every=1, dtype=dtype)
        early = sw.Oscillator(0.1, x=sw.Sampled(values, 0.0625, start=0.0625, interpolation=interpolation))  # type: ignore[arg-type]
        soon = sw.integrate(early, "rk4", v=0.0, y=0.0, dt=0.0625, steps=60, every=1, dtype=dtype)
        np.testing.assert_array_equal(run.y, soon.y)


# ---- adaptive steps

ABLE = ["merson", "fehlberg", "fehlberg_5", "dop853"]


def paced(system: sw.System, method: str, v: Any, y: Any, **options: Any) -> sw.Run:
    arguments: dict[str, Any] = {"tolerance": 1e-5, "at": [0.7, 1.1, 5.0], "dtype": "float32"} | options
    return sw.integrate(system, method, v=v, y=y, **arguments)


def assert_same_paces(a: sw.Run, b: sw.Run) -> None:
    assert a.y.dtype == a.v.dtype == b.y.dtype == F
    assert_same(a, b)
    for mine, theirs in zip(a.paces, b.paces, strict=True):
        np.testing.assert_array_equal(mine, theirs)


PENDULA = sw.Pendulum(np.linspace(0.5, 2.0, 37))
START = np.linspace(-0.5, 0.5, 37), np.linspace(1.0, 2.5, 37)
OPTIONS: dict[str, dict[str, Any]] = {
    "plain": {},
    "fused": {"fused": True},
    "absolute": {"tolerance": (1e-5, 1e-6)},
    "backward": {"at": [-0.7, -1.1, -5.0]},
    "max_step": {"max_step": 0.05},
    "jumps": {"jumps": [0.33, 0.9]},
    "dt": {"dt": 0.01},
    "force": {"force": 0.1},
    "positive": {"positive": True},
    "event": {"events": sw.Event(lambda t, v, y: y - 0.2, name="low")},
    "stop": {"events": sw.Event(lambda t, v, y: y - 0.2, name="low", terminal=True)},
    "bounce": {"events": sw.Event(lambda t, v, y: y, name="low", direction=-1, then=lambda t, v, y: (-0.9 * v, y))},
}


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
@pytest.mark.parametrize("method", ["merson", "dop853"])
@pytest.mark.filterwarnings("ignore:.*stopped")
def test_adaptive_steps_with_options(method: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    run = paced(PENDULA, method, *START, **options)
    assert_same_paces(run, paced(PENDULA, method, *START, **options, backend="numpy"))
    for level in sw.isa_levels():
        monkeypatch.setenv("STEPWELL_ISA", level)
        assert_same_paces(run, paced(PENDULA, method, *START, **options, threads=2))
    for i in (0, 17, 36):
        force = options.get("force")
        alone = paced(sw.Pendulum(PENDULA.omega[i]), method, START[0][i], START[1][i], **options)
        assert (force is None) or alone.force is not None
        np.testing.assert_array_equal(alone.y, run.y[:, i])
        np.testing.assert_array_equal(alone.v, run.v[:, i])
    for name, each in run.events.items():
        assert each == paced(PENDULA, method, *START, **options, backend="numpy").events[name]
        assert len(each.t) > 0


@pytest.mark.parametrize("method", ABLE)
def test_adaptive_steps_in_pieces_are_those_of_the_whole(method: str) -> None:
    whole = paced(PENDULA, method, *START)
    head = paced(PENDULA, method, *START, at=[0.7, 1.1])
    tail = sw.integrate(PENDULA, method, resume=head, at=[5.0])
    assert tail.y.dtype == F
    np.testing.assert_array_equal(tail.y[-1], whole.y[-1])
    np.testing.assert_array_equal(tail.v[-1], whole.v[-1])
    np.testing.assert_array_equal(paced(PENDULA, method, *START, at=[5.0]).y[-1], whole.y[-1])


@pytest.mark.parametrize("interpolation", ["hold", "linear", "cubic"])
@pytest.mark.parametrize("members", [1, 9])
def test_adaptive_steps_with_samples(interpolation: str, members: int) -> None:
    system = sampled(interpolation, members, interval=0.17, start=0.3)
    state = 0.0, np.linspace(-1.0, 1.0, 9)
    for t0, at in ((0.5, [0.7, 1.1, 5.0]), (4.0, [3.3, 1.0])):
        run = paced(system, "dop853", *state, at=at, t0=t0)
        assert_same_paces(run, paced(system, "dop853", *state, at=at, t0=t0, backend="numpy"))
        wide = paced(system, "dop853", *state, at=at, t0=t0, dtype="float64", tolerance=1e-9)
        assert np.abs(run.y - wide.y).max() < 2e-3


@pytest.mark.parametrize("control", [sw.Control("energy", 2.0), sw.Projection("energy")])
def test_adaptive_steps_under_a_control(control: Any) -> None:
    system = swinging(k=np.linspace(0.5, 2.0, 9))
    run = paced(system, "merson", 0.3, 1.0, control=control)
    assert_same_paces(run, paced(system, "merson", 0.3, 1.0, control=control, backend="numpy"))
    rng = np.random.default_rng(5)
    v, y = 0.3 * rng.normal(size=(3, 2, 5)), rng.normal(size=(3, 2, 5))
    for each in (sw.EnergyControl(1.0), sw.Projection()):
        runs = [paced(sw.NBody(softening=0.3), "dop853", v, y, control=each, backend=backend) for backend in ("rust", "numpy")]
        assert_same_paces(*runs)
        np.testing.assert_array_equal(runs[0].work, runs[1].work)


@pytest.mark.parametrize("method", ABLE)
def test_errors_follow_the_tolerance_down_to_rounding(method: str) -> None:
    """And the time is not rounded: at t = 2¹⁴ a time of float32 is 0.001 from its neighbours."""
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "at": np.linspace(0.1, 10.0, 100)}
    errors = []
    for tolerance in (1e-2, 1e-4, 1e-6, 2.0**-23):
        run = sw.integrate(sw.Oscillator(), method, **options, tolerance=tolerance, dtype="float32")
        errors.append(np.abs(run.y - np.cos(run.t)).max())
        late = sw.integrate(
            sw.Oscillator(), method, v=0.0, y=1.0, t0=2.0**14, at=2.0**14 + options["at"], tolerance=tolerance, dtype="float32"
        )
        assert np.abs(late.y - run.y).max() <= 4 * errors[-1] + 20 * 2.0**-24
        assert run.paces.accepted.max() < 3000
    assert errors[0] > 3 * errors[1] > 3 * errors[2]
    assert errors[-1] < 200 * 2.0**-24


# ---- what is computed


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


def test_a_control_keeps_the_energy() -> None:
    rng = np.random.default_rng(5)
    v, y = 0.3 * rng.normal(size=(3, 2, 20)), rng.normal(size=(3, 2, 20))
    options: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 300, "every": 50, "dtype": "float32"}
    for control in (sw.EnergyControl(1.0), sw.Projection()):
        run = sw.integrate(sw.NBody(softening=0.3), "rk4", control=control, **options)
        again = sw.integrate(sw.NBody(softening=0.3), "rk4", control=control, backend="numpy", **options)
        assert_same(run, again)
        np.testing.assert_array_equal(run.work, again.work)
        # Each of some hundred operations of an energy is rounded to 2⁻²⁴ of numbers of its size or some times larger.
        assert np.abs(run.energy - run.energy[0]).max() < 500 * 2.0**-24 * (1.0 + np.abs(run.energy[0]).max())


@sw.system
def swinging(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
    return -k * np.sin(y)


@swinging.invariant
def energy(v: Any, y: Any, *, k: Any) -> Any:
    return 0.5 * v * v - k * np.cos(y)


@pytest.mark.parametrize("method", ["rk4", "false_euler"])
@pytest.mark.parametrize(
    "control", [sw.Control("energy", 5.0), sw.Control("energy", 1.0, form="printed"), sw.Projection("energy")]
)
def test_a_control_keeps_an_invariant_of_ones_own_equations(control: Any, method: str) -> None:
    system = swinging(k=np.linspace(0.5, 2.0, 9))
    options: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": 0.05, "steps": 400, "every": 50, "dtype": "float32"}
    run = sw.integrate(system, method, **options, control=control)
    assert_same(run, sw.integrate(system, method, **options, control=control, backend="numpy"))
    wide = sw.integrate(system, method, **(options | {"dtype": "float64"}), control=control)
    drift, drift_wide = (np.abs(each.energy - each.energy[0]).max() for each in (run, wide))
    # A dozen operations of an energy, each rounded to 2⁻²⁴ of its size, some times over.
    assert abs(drift - drift_wide) < 100 * 2.0**-24
    head = sw.integrate(system, method, **(options | {"steps": 150}), control=control)
    tail = sw.integrate(system, method, resume=head, steps=250)
    np.testing.assert_array_equal(tail.y[-1], run.y[-1])
    world = sw.World(system, method, v=np.full(9, 0.3, F), y=np.ones(9, F), dt=0.05, control=control, dtype="float32")
    world.step(400)
    np.testing.assert_array_equal(world.y, run.y[-1])


# ---- what is refused


@pytest.mark.parametrize("dtype", ["float16", np.int32, "double precision", 32, np.complex64, "", object()])
def test_other_types_are_refused(dtype: Any) -> None:
    with pytest.raises(DTypeError, match=r"^dtype: expected 'float64' or 'float32', got "):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, dtype=dtype)


@pytest.mark.parametrize("dtype", ["float32", np.float32, np.dtype("float32"), np.zeros(1, np.float32).dtype])
def test_it_is_asked_for_as_in_numpy(dtype: Any) -> None:
    assert sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, dtype=dtype).y.dtype == F


PACED: dict[str, Any] = {"dt": None, "steps": None, "method": "merson", "tolerance": 1e-3, "at": [1.0]}
REFUSED: list[tuple[Any, dict[str, Any], str]] = [
    (sw.Oscillator(), {"form": "power"}, "each squaring of a matrix doubles the error of the power"),
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


@pytest.mark.parametrize(("system", "options", "message"), REFUSED)
def test_what_does_not_go_with_float32(system: Any, options: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"method": "rk4", "v": 0.0, "y": 1.0, "dt": 0.1, "steps": 100, "dtype": "float32"} | options
    for backend in ("rust", "numpy"):
        with pytest.raises((UnsupportedError, ArgumentError, TraceError), match=message.replace("(", r"\(")):
            sw.integrate(system, **arguments, backend=backend)


def test_warnings_are_those_of_its_range() -> None:
    with pytest.warns(sw.AccuracyWarning, match=r"beyond 2\.1e\+06 rad"):
        sw.integrate(sw.Pendulum(), "rk4", v=1e6, y=0.0, dt=0.1, steps=100, dtype="float32")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sw.integrate(sw.Pendulum(), "rk4", v=1.0, y=0.0, dt=0.1, steps=100, dtype="float32")


# ---- what a digit costs


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
    with pytest.raises(ArgumentError, match="dtype"):
        sw.charts.work_precision("oscillator", ["rk4"], steps, dtype="half")
