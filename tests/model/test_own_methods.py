"""Methods of a user's own: recorded once, stepped as built-in ones are, and refused where they are wrong."""

from __future__ import annotations

import importlib
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, ShapeError, StepwellError, UnsupportedError
from support.abroad import Journey, run
from support.calls import assert_raises
from support.export import assert_same as assert_same_bits
from support.export import languages
from support.looped import looped
from support.own_methods import a_step_back, adams_bashforth_2, adams_bashforth_3, halfway, heun_euler, one_before
from support.ways import assert_equal_ways

RNG = np.random.default_rng(20)

ALL = [halfway, heun_euler, adams_bashforth_2, adams_bashforth_3]
KEEPING = ALL[2:]


@sw.system
def duffing(t: Any, v: Any, y: Any, *, beta: Any = 1.0) -> Any:
    return 0.5 * np.cos(1.2 * t) - 0.3 * v + y - beta * y**3


falling = sw.system(lambda t, v, y: -1.0 + 0.0 * y)


@sw.system(order=1)
def decay(t: Any, y: Any, *, rate: Any = 1.0) -> Any:
    return -rate * y


def bodies(n: int) -> tuple[sw.System, Any, Any]:
    masses = RNG.uniform(0.2, 1.0, n)
    return sw.NBody(masses, force="newton", softening=0.1), 0.4 * RNG.normal(size=(n, 3)), RNG.normal(size=(n, 3))


def points(count: int, **floor: float) -> tuple[sw.System, Any, Any]:
    system = sw.Particles(np.linspace(0.5, 2.0, count), gravity=9.81, floor=sw.Floor(**floor), dim=2)
    return system, RNG.normal(size=(count, 2)), np.abs(RNG.normal(size=(count, 2))) + 0.05


def test_the_record_follows_from_the_operations() -> None:
    assert [(m.name, m.order, m.evaluations, m.attempt_evaluations, m.error_order) for m in ALL] == [
        ("halfway", 2, 2, 0, None),
        ("heun_euler", 2, 2, 2, 2),
        ("adams_bashforth_2", 2, 1, 0, None),
        ("adams_bashforth_3", 3, 1, 0, None),
    ]
    assert halfway.nodes == (0.0, 0.5)
    assert adams_bashforth_3.kept == ("dv1", "dy1", "dv2", "dy2")
    assert "The explicit midpoint rule." in (halfway.__doc__ or "")


def test_limits_are_those_of_the_books() -> None:
    """Heun's and Adams-Bashforth's of second order grow with any step; that of third order is stable to 0.7236 on the axis."""
    assert [halfway.limit, heun_euler.limit, adams_bashforth_2.limit] == [0.0, 0.0, 0.0]
    # On the imaginary axis z³ = (1 + 23/12·iΦ)·z² − 4/3·iΦ·z + 5/12·iΦ reaches |z| = 1 at Φ = 0.72361…
    limit = adams_bashforth_3.limit
    phi = 1j * limit
    roots = np.roots([1.0, -(1.0 + 23 / 12 * phi), 4 / 3 * phi, -5 / 12 * phi])
    assert abs(abs(roots).max() - 1.0) < 1e-9
    assert 0.72 < limit < 0.73
    below, beyond = (
        abs(sw.integrate(sw.Oscillator(1.0), adams_bashforth_3, v=0.0, y=1.0, dt=share * limit, steps=20_000).y[-1])
        for share in (0.99, 1.01)
    )
    assert below < 1.0 < 1e3 < beyond


@looped("name", [m.name for m in sw.methods() if not m.has_derivatives and m.carry is None])
def test_a_built_in_method_written_again_has_its_bits(name: str) -> None:
    """The reference of a built-in method is a function over blocks: as a user's method it gives the same bits."""
    function = importlib.import_module(f"stepwell.reference.steppers.{name}").step

    def again(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
        return function(s, t, h, v, y)

    mine, theirs = sw.method(again), sw.method(name)
    assert (mine.order, mine.evaluations, mine.nodes) == (theirs.order, theirs.evaluations, theirs.nodes)
    assert mine.limit == pytest.approx(theirs.limit, abs=1e-12)
    for system, v, y in (bodies(3), bodies(80)):
        one, other = (sw.integrate(system, m, v=v, y=y, dt=0.01, steps=5) for m in (mine, theirs))
        assert np.array_equal(one.v, other.v)
        assert np.array_equal(one.y, other.y)


#: Steps that are one tape, of which test_ways.py has more, and steps row by row: the system, v, y, dt, methods and options.
STEPPED: list[tuple[Callable[[], tuple[Any, Any, Any, float]], list[sw.Method], dict[str, Any]]] = [
    (lambda: (duffing(beta=np.linspace(0.5, 2.0, 19)), 0.0, 1.0, 0.02), [heun_euler, adams_bashforth_3], {"dtype": "float32"}),
    (lambda: (decay(rate=np.linspace(0.5, 2.0, 5)), np.zeros((0, 5)), 1.0, 0.05), [adams_bashforth_3], {"fused": True}),
    (lambda: (*bodies(3), 0.01), [heun_euler, adams_bashforth_3], {"fused": True}),
    (lambda: (*bodies(90), 0.001), [halfway, adams_bashforth_3], {}),
    (lambda: (sw.Chain(400), np.ones(400), np.linspace(0.0, 1.0, 400), 0.02), [heun_euler, adams_bashforth_2], {}),
    (lambda: (sw.LinearSystem(RNG.normal(size=(80, 80)) / 10.0), np.ones(40), np.ones(40), 0.02), [halfway, adams_bashforth_2],
     {}),
    (lambda: (*points(3, restitution=0.6, friction=0.3), 0.02), [halfway, adams_bashforth_3], {}),
    (lambda: (*points(500, restitution=0.6), 0.03), ALL, {}),
]  # fmt: skip


@looped("make, methods, options", STEPPED)
def test_core_and_reference_have_the_same_bits(make: Any, methods: list[sw.Method], options: dict[str, Any]) -> None:
    """What is kept goes along: from run to run, into a world, its copy, and back."""
    system, v, y, dt = make()
    for method in methods:
        start: dict[str, Any] = {"v": v, "y": y, "dt": dt, **options}
        whole, reference = (sw.integrate(system, method, **start, steps=24, backend=each) for each in ("rust", "numpy"))
        assert np.isfinite(whole.y).all()
        part = sw.integrate(system, method, **start, steps=13)
        rest = [sw.integrate(system, method, resume=part, steps=11, backend=each) for each in ("rust", "numpy")]
        for each in (reference, *rest):
            assert np.array_equal(each.v[-1], whole.v[-1])
            assert np.array_equal(each.y[-1], whole.y[-1])
        world = sw.World(system, method, resume=part)
        world.step(6)
        for each in (world, pickle.loads(pickle.dumps(world))):
            each.step(5)
            assert np.array_equal(each.v, whole.v[-1])
            assert np.array_equal(each.y, whole.y[-1])


def test_what_begins_anew_has_another_first_step() -> None:
    """A run from where another ended, and a world whose state was changed."""
    for method in KEEPING:
        whole, part = (sw.integrate(duffing(), method, v=0.0, y=1.0, dt=0.02, steps=steps) for steps in (30, 13))
        anew = sw.integrate(duffing(), method, v=part.v[-1], y=part.y[-1], dt=0.02, steps=17, start_step=13)
        assert not np.array_equal(anew.y[-1], whole.y[-1])
    v, y = np.zeros(3), np.ones(3)
    world = sw.World(sw.Pendulum(), adams_bashforth_2, v=v, y=y, dt=0.02)
    world.step(10)
    y[1] = 0.5
    fresh = sw.integrate(sw.Pendulum(), adams_bashforth_2, v=v.copy(), y=y.copy(), dt=0.02, steps=10, start_step=10)
    world.step(10)
    assert np.array_equal(y, fresh.y[-1])


@looped("count", [4, 70])
def test_members_that_are_reset_begin_anew_alone(count: int) -> None:
    """As a world of these members would, and the others go on as if nothing had been."""
    system, v, y = bodies(count)
    v, y = (np.repeat(block[..., np.newaxis], 3, axis=-1) * [1.0, 1.1, 1.2] for block in (v, y))
    world, untouched = (sw.World(system, adams_bashforth_3, v=v.copy(), y=y.copy(), dt=0.001) for _ in range(2))
    for each in (world, untouched):
        each.step(5)
    world.reset(1, v=v[..., 0], y=y[..., 0])
    for each in (world, untouched):
        each.step(5)
    fresh = sw.integrate(system, adams_bashforth_3, v=v[..., 0], y=y[..., 0], dt=0.001, steps=5, start_step=5)
    assert np.array_equal(world.y[..., 1], fresh.y[-1])
    assert np.array_equal(world.y[..., [0, 2]], untouched.y[..., [0, 2]])


@looped("method", ALL)
def test_the_error_falls_with_the_order(method: sw.Method) -> None:
    ends = [sw.integrate(duffing(), method, v=0.1, y=1.0, dt=2.0 / n, steps=n).y[-1] for n in (200, 400, 800)]
    assert np.log2((ends[0] - ends[1]) / (ends[1] - ends[2])) == pytest.approx(method.order, abs=0.1)


def test_an_estimate_of_the_error_chooses_steps() -> None:
    system = duffing(beta=np.linspace(0.5, 2.0, 7))
    options: dict[str, Any] = {"v": np.zeros(7), "y": np.ones(7)}
    for numbers in ({}, {"fused": True}, {"dtype": "float32"}):
        assert_equal_ways(system, heun_euler, **options, at=np.array([0.1]), tolerance=1e-2, **numbers, ways=["by the reference"])
    options["at"] = np.linspace(0.5, 2.0, 4)
    run, looser, true = (
        sw.integrate(system, method, **options, tolerance=tolerance)
        for method, tolerance in ((heun_euler, 1e-4), (heun_euler, 1e-2), ("dop853", 1e-11))
    )
    assert np.abs(run.y - true.y).max() < 2e-3
    assert (np.asarray(looser.paces.accepted) < np.asarray(run.paces.accepted)).all()


def test_events_are_located_and_change_the_state() -> None:
    bounce = sw.Event(lambda t, v, y: y, name="bounce", direction=-1, then=lambda t, v, y: (-0.8 * v, y))
    start = np.linspace(0.5, 1.0, 7)
    exact = sw.integrate(falling(), "rk4", v=0.0, y=start, dt=0.02, steps=300, events=bounce)
    for method in KEEPING:
        run = sw.integrate(falling(), method, v=0.0, y=start, dt=0.02, steps=300, events=bounce)
        # Of a constant acceleration the steps are exact, through bounces too: what is kept begins anew.
        assert np.abs(run.y[-1] - exact.y[-1]).max() < 1e-13
        assert np.abs(run.events["bounce"].t - exact.events["bounce"].t).max() < 1e-13
        v, y = np.zeros(7), start.copy()
        world = sw.World(falling(), method, v=v, y=y, dt=0.02, events=bounce)
        for _ in range(10):
            world.step(30)
        assert np.abs(y - exact.y[-1]).max() < 1e-13


def test_controls_act_between_steps() -> None:
    """A strong one is told of, also where a run goes on: the velocities stand before what the method keeps."""
    scene = sw.scenes.clover()
    start: dict[str, Any] = {"v": scene.v, "y": scene.y, "dt": 0.01}
    strong = sw.EnergyControl(gain=1000.0, form="printed")
    for method in KEEPING:
        free, *controlled = (
            sw.integrate(scene.system, method, **start, steps=200, control=each)
            for each in (None, sw.EnergyControl(gain=0.3), sw.Projection())
        )
        begin = scene.system.energy(scene.v, scene.y)
        for kept in controlled:
            assert abs(kept.energy[-1] - begin) < abs(free.energy[-1] - begin)
        with pytest.warns(sw.ControlWarning, match="h·C·K"):
            first = sw.integrate(scene.system, method, **start, steps=1, control=strong)
        with pytest.warns(sw.ControlWarning, match="h·C·K"):
            sw.integrate(scene.system, method, resume=first, steps=1)


def test_a_member_that_diverges_is_named_with_its_step() -> None:
    options: dict[str, Any] = {"v": 0.0, "y": np.ones(2), "dt": 0.1, "steps": 400}
    run = assert_equal_ways(sw.Oscillator([1.0, 1e3]), adams_bashforth_2, **options, ways=("by the reference",))
    # A step multiplies by some 1.5·10⁴/√2 at most: 308 digits take more than 70 steps.
    assert run.first_bad_step[0] == -1
    assert 70 < run.first_bad_step[1] < 200


def test_methods_are_values() -> None:
    assert pickle.loads(pickle.dumps(adams_bashforth_3)) is adams_bashforth_3

    def twice(weight: float) -> Any:
        def euler(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
            return v + s.dv(t, v, y), y + s.dy(t, v + weight * s.dv(t, v, y), y)

        return sw.method(euler)

    standard, false = twice(0.0), twice(1.0)
    assert standard is not false
    assert standard is twice(0.0)
    system, options = sw.Oscillator(1.0), {"v": 0.3, "y": 1.0, "dt": 0.1, "steps": 10}
    assert np.array_equal(sw.integrate(system, false, **options).y, sw.integrate(system, "false_euler", **options).y)
    assert not np.array_equal(sw.integrate(system, standard, **options).y, sw.integrate(system, false, **options).y)


def test_saved_runs_and_processes_know_them(tmp_path: Any) -> None:
    """A file holds what the method does, so that another process goes on by it, which never saw the function."""
    half = sw.integrate(sw.Pendulum([1.0, 2.0]), adams_bashforth_2, v=0.0, y=1.0, dt=0.02, steps=20)
    half.save(tmp_path / "half.npz")
    code = (
        "import sys, stepwell as sw; half = sw.load(sys.argv[1]); "
        "rest = sw.integrate(half.system, half.method, resume=half, steps=20); print(*(y.hex() for y in rest.y[-1].tolist()))"
    )
    process = subprocess.run([sys.executable, "-c", code, tmp_path / "half.npz"], capture_output=True, text=True, check=True)
    whole = sw.integrate(sw.Pendulum([1.0, 2.0]), adams_bashforth_2, v=0.0, y=1.0, dt=0.02, steps=40)
    assert process.stdout.split() == [y.hex() for y in whole.y[-1].tolist()]


def test_a_bounce_on_rods_is_refused_since_it_ends_what_is_kept() -> None:
    """The core does not tell which points it changed."""
    rods = sw.Rods([1.0, 0.5], [(0, 1)], 1.0, floor=sw.Floor(normal=[0.0, 1.0]))
    options: dict[str, Any] = {"v": [[0.0, -1.0], [0.0, -1.0]], "y": [[0.0, 0.3], [0.8, 0.9]], "dt": 0.01, "steps": 60}
    sw.integrate(rods, halfway, **options)
    with pytest.raises(UnsupportedError, match="which do not hold after a bounce"):
        sw.integrate(rods, adams_bashforth_2, **options)


def test_charts_and_explanations_take_them(tmp_path: Any) -> None:
    text = str(sw.explain(sw.Pendulum(), adams_bashforth_2))
    assert "v'   = v − 1.5·a10 − 0.5·dv1\n" in text
    assert "at the start of a run, dv1, dy1 from v and y" in text
    chart = sw.charts.work_precision(sw.scenes.oscillator(), [halfway, adams_bashforth_3, "rk4"], [40, 80])
    assert {"halfway", "adams_bashforth_3", "rk4"} <= {row["method"] for row in chart.rows()}
    chart.plot(tmp_path / "chart.png")


def exported(language: str) -> list[Journey]:
    """On numbers, in a batch, in float32, under a control, beside a floor, in loops, with a sampled controller."""
    ball = sw.Particles(gravity=9.81, floor=sw.Floor(restitution=0.5))
    pairs = [(i, i + 1) for i in range(119)] + [(i, i + 2) for i in range(118)]
    rope = sw.Springs(pairs, masses=0.1, stiffness=20.0, rest=0.1, gravity=9.81, fixed=[0], dim=2)
    places = np.stack([0.1 * np.arange(120), np.zeros(120)], axis=1)

    @sw.controller
    def braked(t: Any, v: Any, y: Any, total: Any = 0.0) -> Any:
        return -y - v, total + y

    loop = sw.Oscillator(2.0, x=0.0).surrounded(braked(sets="x", period=0.2))
    kept = {"control": sw.EnergyControl(0.5)}
    every = [
        Journey(duffing(beta=np.array([0.5, 2.0])), method, np.zeros(2), np.ones(2), member=1)
        for method in (heun_euler, adams_bashforth_3)
    ]
    every += [
        Journey(decay(), adams_bashforth_3, np.zeros(0), 1.0),
        Journey(sw.Oscillator(2.0), adams_bashforth_3, 0.5, 1.0, options={"dtype": "float32"}),
        Journey(sw.NBody(np.ones(2), softening=0.1), adams_bashforth_2, np.eye(2), 2.0 * np.eye(2), options=kept),
        Journey(ball, adams_bashforth_2, np.array([[0.5, 0.0]]), np.array([[0.0, 0.3]]), steps=60, dt=0.02),
        Journey(rope, adams_bashforth_2, np.zeros((120, 2)), places, steps=20, dt=0.01),
        Journey(loop, adams_bashforth_3, 0.5, 1.0),
    ]
    return every


@languages
def test_every_bit_of_exported_steps(language: str, tmp_path: Any) -> None:
    every = exported(language)
    assert_same_bits(every, run(language, every, tmp_path))


def test_what_needs_a_map_from_state_to_state_is_refused_in_words() -> None:
    one, m = sw.Oscillator(), adams_bashforth_2
    calls: list[Callable[[], Any]] = [
        lambda: sw.analyse(one, m, dt=0.1),
        lambda: sw.stability_limit(one, m),
        lambda: sw.lyapunov(sw.Pendulum(), m, v=0.0, y=1.0, dt=0.1, steps=100),
        lambda: sw.integrate(one, m, v=0.0, y=1.0, dt=0.1, steps=3, form="matrix"),
        lambda: sw.explain(one, m, form="matrix"),
        lambda: sw.stability.series(m),
    ]
    assert_raises(*((call, "goes on from more than v and y: from dv1, dy1") for call in calls), kind=UnsupportedError)


def a_method(body: Callable[..., Any], name: str = "mine") -> Callable[[], Any]:
    def mine(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
        return body(s, t, h, v, y)

    mine.__name__ = name
    return lambda: sw.method(mine)


def keeping(step: Callable[..., Any], start: Callable[..., Any]) -> Callable[[], Any]:
    return lambda: sw.method(start=start)(step)


def growing(s: Any, t: Any, h: Any, v: Any, y: Any, v1: Any, y1: Any) -> Any:
    """Of third order, and not zero-stable: z² + 4z − 5 has the root −5."""
    dv, dy = s.dv(t, v, y), s.dy(t, v, y)
    return (-4 * v + 5 * v1 + 4 * dv + 2 * s.dv(t - h, v1, y1), -4 * y + 5 * y1 + 4 * dy + 2 * s.dy(t - h, v1, y1), v, y)


def without_start(s: Any, t: Any, h: Any, v: Any, y: Any, dv1: Any, dy1: Any) -> Any:
    return v + dv1, y + dy1, dv1, dy1


def of_two_arguments(v: Any, y: Any) -> Any:
    return v, y


def swapped(s: Any, t: Any, h: Any, v: Any, y: Any, dv1: Any, dy1: Any) -> Any:
    return v + dv1, y + dy1, dy1, dv1


def two_steps(s: Any, t: Any, h: Any, v: Any, y: Any, dv1: Any, dy1: Any) -> Any:
    dv, dy = s.dv(t, v, y), s.dy(t, v, y)
    return v + 1.5 * dv - 0.5 * dv1, y + 1.5 * dy - 0.5 * dy1, dv, dy


WRONG: list[tuple[Callable[[], Any], type[StepwellError], str]] = [
    (a_method(lambda s, t, h, v, y: (v + y, y)), ShapeError, r"\+: expected two blocks of velocities or two of coordinates"),
    (a_method(lambda s, t, h, v, y: (v + 1.0, y)), DTypeError, "a number can only multiply a block"),
    (a_method(lambda s, t, h, v, y: (v + h * s.dv(t, v, y), y)), DTypeError, "are increments already, which have the factor h"),
    (a_method(lambda s, t, h, v, y: (v + h, y)), DTypeError, "have the factor h"),
    (a_method(lambda s, t, h, v, y: (v * v, y)), DTypeError, r"\*: expected a number"),
    (a_method(lambda s, t, h, v, y: (np.sin(v), y)), DTypeError, "np.sin: a method adds blocks"),
    (a_method(lambda s, t, h, v, y: (v if v else y, y)), DTypeError, "if: a block has no truth value"),
    (a_method(lambda s, t, h, v, y: (v if v > 0 else y, y)), DTypeError, "<, >: got <a block of velocities> and 0 to compare"),
    (a_method(lambda s, t, h, v, y: (v[0], y)), DTypeError, "cannot look into a block"),
    (a_method(lambda s, t, h, v, y: (s.dv(0.5, v, y), y)), DTypeError, "s.dv: expected a time first"),
    (a_method(lambda s, t, h, v, y: (s.dv(t, y, v), y)), ShapeError, "s.dv: expected a block of velocities, got one of coord"),
    (a_method(lambda s, t, h, v, y: (s.dv(t + 1.0, v, y), y)), DTypeError, "t: expected a part of the step to add"),
    (a_method(lambda s, t, h, v, y: (s.acceleration(v), y)), ArgumentError, r"s.acceleration: a method has s.dv"),
    (a_method(lambda s, t, h, v, y: (v / 0.0, y)), ArgumentError, "expected a divisor other than 0"),
    (a_method(lambda s, t, h, v, y: (np.nan * v, y)), ArgumentError, "expected a finite number"),
    (a_method(lambda s, t, h, v, y: v), ShapeError, r"expected to return v, y or v, y, error_v, error_y, got 1 block"),
    (a_method(lambda s, t, h, v, y: (y, v)), ShapeError, "got 2 blocks: coordinates, velocities"),
    (a_method(lambda s, t, h, v, y: None), DTypeError, "expected blocks to be returned"),
    (a_method(lambda s, t, h, v, y: (v, y)), UnsupportedError, "got one of order 0"),
    (a_method(lambda s, t, h, v, y: (v + s.dv(t, v, y), y)), UnsupportedError, "got one of order 0"),
    (a_method(lambda s, t, h, v, y: (v, y), name="rk4"), ArgumentError, "'rk4' is built in"),
    (lambda: sw.method(lambda s, t, h, v, y: (v, y)), ArgumentError, "expected a function with a name"),
    (lambda: sw.method(of_two_arguments), ArgumentError, r"method: expected a function of \(s, t, h, v, y\), and behind them"),
    (lambda: sw.method(np.sin), StepwellError, "method: there is no <ufunc"),
    (lambda: sw.method(start=max)(without_start), DTypeError, "start: expected a function of Python"),
    (lambda: sw.method(without_start), ArgumentError, "start: expected a function .* that returns dv1, dy1"),
    (lambda: sw.method("rk4", start=one_before), ArgumentError, "start: expected with a function"),
    (keeping(halfway.programs.whole.run, one_before), ArgumentError, "expected a function"),
    (keeping(growing, lambda s, t, h, v, y: a_step_back(s, t, h, v, y)), UnsupportedError, "not zero-stable"),
    (keeping(without_start, lambda s, t, h, v, y: s.dv(t, v, y)), ShapeError, "start: expected 2 blocks"),
    (keeping(without_start, lambda s, t, h, v, y: (y, v)), ShapeError, "expected two blocks of velocities or two of coordinates"),
    (keeping(swapped, one_before), ShapeError, "start returns velocities, coordinates"),
    (keeping(two_steps, lambda s, t, h, v, y: (0 * v, 0 * y)), UnsupportedError, "start: .* an error of h to the power"),
]  # fmt: skip


def test_what_a_method_cannot_be_is_said_in_words() -> None:
    """A start that is too rough among them, and blocks of another step."""
    assert_raises(*WRONG)
    last: list[Any] = []

    def leaking(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
        last.append(v)
        return v + s.dv(t, last[0], y), y + s.dy(t, v, y)

    sw.method(leaking)
    with pytest.raises(ArgumentError, match="a block of another step"):
        sw.method(leaking)


def test_a_method_for_accelerations_refuses_forces_of_the_velocity() -> None:
    @sw.method
    def kick_drift_kick(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
        half = v + s.dv(t, v, y) / 2
        end = y + s.dy(t, half, y)
        return half + s.dv(t + h, half, end) / 2, end

    assert (kick_drift_kick.order, kick_drift_kick.needs_acceleration) == (2, True)
    assert kick_drift_kick.limit == pytest.approx(2.0)
    with pytest.raises(UnsupportedError, match="needs forces that do not depend on the velocity"):
        sw.integrate(sw.Oscillator(1.0, 0.1), kick_drift_kick, v=0.0, y=1.0, dt=0.1, steps=3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = sw.integrate(sw.Oscillator(1.0), kick_drift_kick, v=0.0, y=1.0, dt=0.1, steps=1000)
    assert abs(run.y[-1]) < 1.01
