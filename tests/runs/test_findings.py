"""What a run noticed is data on it; the public functions warn of it, and the package silences nothing of its own."""

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import limit
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.runs.execution import noticing, quietly
from stepwell.runs.findings import growth, negative
from stepwell.runs.options import Options
from stepwell.runs.request import Request
from stepwell.scenes.stiff_equations import rober
from support.advised import unmeasured  # noqa: F401
from support.cases import Case
from support.heard import quiet, told
from support.refusals import refused
from support.stiff import lorenz

PACKAGE = Path(sw.__file__).parent
SILENCED = re.compile(r"simplefilter|filterwarnings|catch_warnings")


def ball(steps: int) -> tuple[Any, ...]:
    falls = sw.system(lambda t, v, y: -1.0 + 0.0 * y)
    ground = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-0.5 * v, y), name="ground")
    return falls(), "rk4", {"v": 0.0, "y": 1.0, "dt": 0.01, "steps": steps, "events": ground}


STEPS: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1}
FEW: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-6, "at": [5.0], "max_steps": 100}
TURNS: dict[str, Any] = {"v": [0.0, 1e16], "y": 1.0, "dt": 1.0, "steps": 10}
CASES: dict[str, tuple[Any, str, dict[str, Any], type[Warning], list[bool] | bool]] = {
    "divergence": (sw.Oscillator([1.0, 30.0]), "leapfrog", STEPS | {"steps": 1000}, sw.DivergenceWarning, [False, True]),
    "a stop": (sw.Oscillator([1.0, 30.0]), "merson", FEW, sw.ToleranceWarning, [False, True]),
    "growth": (sw.Oscillator([1.0, 21.0]), "false_euler", STEPS | {"steps": 100}, sw.AccuracyWarning, [False, True]),
    "an angle": (sw.Pendulum(), "rk4", TURNS, sw.AccuracyWarning, [False, True]),
    "rest": (*ball(600), sw.EventWarning, True),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", CASES)
def test_a_finding_is_what_the_public_functions_warn_of(name: str, tmp_path: Path) -> None:
    system, method, options, category, members = CASES[name]
    with pytest.warns(category) as caught:
        run = sw.integrate(system, method, **options)
    assert [(each.category, str(each.message)) for each in caught] == [(each.category, each.message) for each in run.findings]
    assert {Path(each.filename).name for each in caught} == {Path(__file__).name}
    (finding,) = (each for each in run.findings if issubclass(each.category, category))
    np.testing.assert_array_equal(finding.members, members)
    assert finding.members.shape == run.status.shape
    if name != "rest":  # whose function has no name to be found by
        run.save(tmp_path / "run.npz")
        assert sw.load(tmp_path / "run.npz").findings == run.findings
    # Inner functions do not warn.
    silent = quietly(system, method, **options)
    noticed = noticing(Request.of(system, method, Options(**options)))
    assert noticed.findings
    np.testing.assert_array_equal(silent.y, noticed.y)


def test_the_package_silences_no_warning() -> None:
    """Those of ``errors.py`` are examples that catch them; and pyopencl tells of each kernel that its compiler said something."""
    files = [path for path in PACKAGE.rglob("*.py") if path.name != "errors.py"]
    assert len(files) > 100
    silenced = [str(path.relative_to(PACKAGE)) for path in files if SILENCED.search(path.read_text())]
    assert silenced == ["device/opencl.py"]
    text = (PACKAGE / silenced[0]).read_text()
    assert text.count("simplefilter") == text.count('simplefilter("ignore", self.cl.CompilerWarning)') == 1


def test_a_selection_has_these_states() -> None:
    run = sw.integrate(sw.Oscillator([1.0, 2.0]), "rk4", v=0.0, y=1.0, dt=0.1, steps=40, every=1, record="energy")
    for saved in (slice(3, None, 4), np.arange(41) % 3 == 0, [0, 5, 40], np.array([7])):
        part = run.select(saved)
        for name in ("t", "v", "y", "energy"):
            np.testing.assert_array_equal(getattr(part, name), getattr(run, name)[saved])
        assert part.steps == 40
    np.testing.assert_array_equal(run.select(-1).y, run.y[-1:])
    np.testing.assert_array_equal(run.select(slice(0, None, 2)).select(1).y, run.y[2:3])
    refused(ArgumentError, "saved: expected an index of the 41 saved states, got 41", run.select, 41)


@pytest.mark.parametrize("options", [{"dt": 0.1, "steps": 40, "every": 1}, {"tolerance": 1e-6, "at": np.linspace(0.1, 4.0, 40)}])
def test_a_part_goes_on_if_it_has_the_end(options: dict[str, Any]) -> None:
    more: dict[str, Any] = {"steps": 10} if "steps" in options else {"at": [5.0]}
    run = sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, **options)
    whole, part = (sw.integrate(run.system, "merson", resume=each, **more) for each in (run, run.select([0, -1])))
    assert whole.y[-1] == part.y[-1]
    with pytest.raises(ArgumentError, match=r"^resume: expected a run with its last state, got a part of one without it"):
        sw.integrate(run.system, "merson", resume=run.select(slice(0, -1)), **more)


# Growth by steps beyond their stability limit is told; growth of the motion itself is not.
spring = sw.system(lambda t, v, y, *, k=1e4, damping=0.1, push=1.0: -k * y - damping * v + push * np.sin(t))

inverted = sw.system(lambda t, v, y, *, rate=1.0: rate**2 * y)

lag = sw.system(order=1)(lambda t, y, *, rate=50.0: 1.0 - rate * y)

PAST = [
    (sw.Oscillator(3.0), "false_euler", {"v": 0.0, "y": 1.0, "dt": 0.7, "steps": 200}, "its stability limit is 0.666667"),
    (spring(), "rk4", {"v": 0.0, "y": 0.0, "dt": 0.03, "steps": 300}, "its stability limit is 0.0282"),
    (lag(), "standard_euler", {"y": 1.0, "dt": 0.05, "steps": 60}, "its stability limit is 0.04"),
    (sw.Oscillator(1.0), "standard_euler", {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 5000}, "is stable with no step"),
    (sw.Chain(20), "leapfrog", {"v": 0.0, "y": np.eye(20)[3], "dt": 1.05, "steps": 300}, "use a shorter step"),
    (sw.Oscillator(np.array([1.0, 4.0])), "rk4", {"v": 0.0, "y": 1.0, "dt": 0.9, "steps": 200}, "1 of 2 members .* member 1"),
]


def test_growth_past_the_limit_is_told_once() -> None:
    for system, method, arguments, message in PAST:
        with pytest.warns(sw.AccuracyWarning, match=message) as caught:
            run = sw.integrate(system, method, **arguments)
        assert len(caught) == 1, method
        assert np.isfinite(run.y).all(), method
        assert np.abs(run.y[-1]).max() > 1e5, method


def test_the_limit_of_a_system_is_sought_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes longer than most runs; the next run of an equal system has its own step in the same words."""
    sought = []
    limit_of = limit.limit_of
    monkeypatch.setattr(limit, "limit_of", lambda *arguments: sought.append(arguments) or limit_of(*arguments))
    for dt in (0.7, 0.8):
        with pytest.warns(sw.AccuracyWarning, match=f"each step of {dt} by false_euler .* its stability limit is 0.645161"):
            sw.integrate(sw.Oscillator(3.1), "false_euler", v=0.0, y=1.0, dt=dt, steps=200)
    assert len(sought) == 1


def test_a_system_stays_as_it_was() -> None:
    """Also one without inputs, of which no copy is needed to leave them out."""
    chain = sw.Chain(3)
    with pytest.warns(sw.AccuracyWarning, match="its stability limit is "):
        sw.integrate(chain, "false_euler", v=np.zeros(3), y=np.ones(3), dt=2.5, steps=100)
    assert chain == sw.Chain(3)


def frames(world: sw.World, number: int, steps: int) -> None:
    for _ in range(number):
        world.step(steps)


@pytest.mark.filterwarnings("error")
def test_a_world_tells_it_once() -> None:
    """1.877ⁿ is a million in 22 steps, looked for after 8, 24, 56 and 120 steps, and 10²⁷⁴ in 1000. Of few large calls it is
    told after the first.
    """
    system = sw.Oscillator(np.array([1.0, 2.0, 3.0]))
    for n in (1, 7):
        v, y = np.zeros(3), np.ones(3)
        world = sw.World(system, "false_euler", v=v, y=y, dt=0.7)
        words = r"1 of 3 members grew .* member 2: .* the motion itself does not grow"
        with pytest.warns(sw.AccuracyWarning, match=words) as caught:
            frames(world, 280 // n, n)
        assert len(caught) == 1
        assert np.abs(y[2]) > 1e6
    for n, events in ((22, None), (1000, None), (22, lambda t, v, y: y), (100, lambda t, v, y: y)):
        world = sw.World(system, "false_euler", v=np.zeros(3), y=np.ones(3), dt=0.7, events=events)
        words = f"1 of 3 members grew .*-fold in {n} steps: member 2: .* its stability limit is 0.66"
        with pytest.warns(sw.AccuracyWarning, match=words):
            world.step(n)
        world.step(1)


@pytest.mark.filterwarnings("error")
def test_a_world_that_ends_in_nan_within_a_call_tells_it_once() -> None:
    """y' = y² from 1 leaves the finite numbers soon after t = 1: with parameters that were set, events, and many members, too."""
    burst = sw.system(order=1)(lambda t, y, *, rate=1.0: rate * y * y)
    kick = sw.Event(lambda t, y: y - 0.5, then=lambda t, y: y, name="kick")
    for members, options, words in (
        ((), {}, r"the state diverged, before step 60 \(t = 6\), by rk4 with dt = 0.1"),
        ((), {"events": kick}, "the state diverged, before step 60"),
        ((), {"dtype": "float32"}, "the state diverged, before step 60"),
        ((3,), {}, "1 of 3 members diverged: member 2, before step 60"),
        ((400,), {}, "1 of 400 members diverged: member 399, before step 60"),
    ):
        y = np.zeros(members, options.get("dtype", "float64"))
        sw.World(burst(), "rk4", y=y, dt=0.1, **options).step(60)
        world = sw.World(burst(), "rk4", y=y, dt=0.1, **options)
        y[(*members[:-1], -1) if members else ...] = 1.0
        if not options:
            world.set(rate=1.0)
        with pytest.warns(sw.DivergenceWarning, match=words):
            world.step(60)
        assert not np.isfinite(y).all()
        frames(world, 20, 1)
    # Step by step it is told by the call that does it, of more than 256 numbers within eight steps.
    for members, until in ((256, 0), (257, 8)):
        y = np.ones(members)
        world, texts = sw.World(burst(), "rk4", y=y, dt=0.1), []
        while np.isfinite(y).all() or len(texts) <= until:
            caught = told(world.step)[1]
            if not np.isfinite(y).all():
                texts.append(caught)
        assert sum(map(len, texts)) == 1
        assert members > 256 or texts[0]


@pytest.mark.filterwarnings("error")
def test_what_an_event_makes_of_a_state_is_not_told_as_growth() -> None:
    v, y = np.zeros(()), np.ones(())
    kick = sw.Event(lambda t, v, y: y, then=lambda t, v, y: (10.0 * v, y), name="kick")
    world = sw.World(sw.Oscillator(1.0), "rk4", v=v, y=y, dt=0.1, events=kick)
    frames(world, 10, 30)
    assert np.abs(v) + np.abs(y) > 1e6


SWEEPS = [
    (sw.Oscillator, {"omega": [1.0, 3.0, 3.1]}, "false_euler", {"v": 0.0, "y": 1.0, "dt": 0.7}, 2, "omega = 3:"),
    (spring, {"k": [1.0, 1e4]}, "rk4", {"v": 0.0, "y": 0.0, "dt": 0.03}, 1, "k = 10000:"),
    (lag, {"rate": [50.0, 10.0]}, "standard_euler", {"y": 1.0, "dt": 0.05}, 1, "rate = 50:"),
    (lag, {"dt": [0.01, 0.05, 0.06]}, "standard_euler", {"y": 1.0}, 2, "dt = 0.05:"),
    (sw.Chain(20), {"y": ("start", np.eye(20)[:, :4])}, "leapfrog", {"v": 0.0, "dt": 1.05}, 4, "member 0:"),
]


@pytest.mark.parametrize(("system", "axes", "method", "arguments", "number", "first"), SWEEPS)
def test_a_sweep_tells_how_many_members_grew_and_which_first(
    system: Any, axes: dict[str, Any], method: str, arguments: dict[str, Any], number: int, first: str
) -> None:
    for options in ({}, {"transient": 150}, {"outcomes": "extremes"}, {"outcomes": lambda run: run.y[-1]}):
        steps = {"steps": 200 - options.get("transient", 0)}
        with pytest.warns(sw.AccuracyWarning, match=rf"{number} of \d members grew .*-fold in 200 steps") as caught:
            sw.sweep(system, axes, method, **arguments, **steps, chunk=2, **options)
        assert len(caught) == 1, options
        assert f" at {first} each step of" in str(caught[0].message), options


def test_a_sweep_passes_over_members_that_grow_by_themselves() -> None:
    """The first two grow as e²⁰ and e⁴⁰ do; the last is the spring that its steps make grow."""
    with pytest.warns(sw.AccuracyWarning, match=r"1 of 3 members grew .* at square = -30000:") as caught:
        sw.sweep(pushed_off, {"square": [100.0, 400.0, -3e4]}, "rk4", v=0.0, y=1.0, dt=0.02, steps=100)
    assert len(caught) == 1


pushed_off = sw.system(lambda t, v, y, *, square=1.0: square * y)


def test_a_small_member_beside_large_ones_is_told() -> None:
    """The second begins 10⁻¹² of the first and grows by 10⁷ in 40 steps: in the sum of squares it is nothing."""
    for steps, words in ((40, r"e\+07-fold in 40 steps: member 1"), (400, " member 1")):
        with pytest.warns(sw.AccuracyWarning, match=r"1 of 2 members grew .*" + words):
            sw.integrate(sw.Oscillator(np.array([1.0, 3.0])), "rk4", v=0.0, y=np.array([1e12, 1.0]), dt=1.0, steps=steps)


@pytest.mark.filterwarnings("error")
def test_growth_of_the_motion_backward_in_time_is_its_own() -> None:
    """Backward in time e⁻⁵⁰ᵗ is what grows, and e⁻ᵗ tells nothing of it."""
    system = sw.LinearSystem([[-50.0, 0.0], [0.0, -1.0]], velocities=0)
    run = sw.integrate(system, "rk4", y=[1.0, 1.0], dt=-0.01, steps=100)
    assert run.y[-1, 0] > 1e21


def test_members_of_times_of_their_own_are_told() -> None:
    with pytest.warns(sw.AccuracyWarning, match=r"2 of 2 members grew .* its stability limit is 0.02"):
        sw.integrate(spring(), "rk4", v=0.0, y=1.0, dt=0.03, steps=300, t0=np.array([0.0, 5.0]))


TAME = [
    (inverted(), {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 300}),  # e³⁰
    (inverted(rate=40.0), {"v": 1.0, "y": 0.0, "dt": 0.1, "steps": 20}),  # grows by itself, beyond any accuracy
    (sw.LinearSystem([[1.0]], velocities=0), {"y": [1.0], "dt": 0.1, "steps": 400}),
    (sw.LinearSystem([[0.2, 5.0], [-5.0, 0.2]], velocities=0), {"y": [1.0, 0.0], "dt": 0.1, "steps": 1500}),
    (sw.Particles(1, gravity=[0.0, -9.81]), {"v": 0.0, "y": 0.0, "dt": 0.1, "steps": 50_000}),  # from rest, 10⁸ down
    (sw.Oscillator(1e8, form="physical"), {"v": 0.0, "y": 1.0, "dt": 1e-9, "steps": 500}),  # v is 1e8 times y
    (spring(), {"v": 0.0, "y": 0.0, "dt": 0.01, "steps": 2000}),
    (spring(damping=0.0, push=0.0), {"v": 0.0, "y": 1e-9, "dt": 0.025, "steps": 2000}),
    (sw.Oscillator(1.0, a=sw.Sinusoid(1e7, 1.0), form="physical"), {"v": 0.0, "y": 1e-3, "dt": 0.1, "steps": 3000}),  # resonance
]


@pytest.mark.filterwarnings("error")
def test_what_grows_by_itself_or_not_at_all_is_not_told() -> None:
    for (system, arguments), method in itertools.product(TAME, ("rk4", "dop853", "merson")):
        sw.integrate(system, method, **arguments)
        sized = system.for_state_shapes(arguments.get("v"), arguments["y"])
        shapes = {"v": sized.v_shape, "y": sized.y_shape}
        blocks = {each: np.array(np.broadcast_to(arguments[each], shapes[each]), float) for each in shapes if each in arguments}
        world = sw.World(system, method, dt=arguments["dt"], **blocks)
        frames(world, min(300, arguments["steps"]), max(1, arguments["steps"] // 300))


def test_lengths_whose_squares_are_no_floats_are_told_too() -> None:
    """By Runge-Kutta 4 with hω = 3.2 a state grows 2.27-fold in a step: 10²⁴⁹ is a float64, and its square is none."""
    wide = [(start, steps, "float64") for start, steps in ((1.0, 700), (1e-200, 20), (1e-200, 700))]
    for start, steps, dtype in (*wide, (1.0, 60, "float32"), (1e-30, 150, "float32")):
        with pytest.warns(sw.AccuracyWarning, match=r"the run grew \de\+\d+-fold in \d+ steps"):
            run = sw.integrate(sw.Oscillator(1.0), "rk4", v=0.0, y=start, dt=3.2, steps=steps, dtype=dtype)
        assert run.status == sw.Status.OK, (start, steps, dtype)


def test_members_with_samples_of_their_own_are_told_too() -> None:
    """The limit of one member is sought with its own samples, at many steps at a time."""
    case = Case("merson", "top, damped, torques of its own", "direct", None)
    with pytest.warns(sw.AccuracyWarning, match="1 of 5 members grew"), pytest.warns(sw.DivergenceWarning):
        case.run(5, 0, dt=3.0, steps=9)


def test_findings_are_the_same_whether_the_warning_is_heard_or_not() -> None:
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 1.0, "steps": 100}
    (loud, _), silent = (call(sw.integrate, sw.Oscillator([1.0, 3.0]), "rk4", **ask) for call in (told, quiet))
    assert len(loud.findings) == 1
    assert loud.findings == silent.findings


def test_no_member_is_shorter_at_the_start_than_the_bound_of_all() -> None:
    """A member at rest counts as one unit long. The bound is sharp if one block is zero."""
    coordinates = 2.0, 0.0, np.linspace(-3.0, -1.0, 5), np.zeros(5), np.linspace(-1.0, 1.0, 5)
    for v, y in itertools.product((0.0, -4.0, np.linspace(0.5, 2.0, 5), np.zeros(5)), coordinates):
        start = np.broadcast_to(v, 5), np.broadcast_to(y, 5)
        run = sw.integrate(sw.Oscillator(np.linspace(0.5, 1.0, 5)), "rk4", v=v, y=y, dt=0.1, steps=10)
        lengths = np.hypot(*start)
        least = float(np.where(lengths > 0.0, lengths, 1.0).min())
        bound = max(growth._shortest(run, start))
        assert 0.0 < bound <= least, (v, y)
        assert bound == least or (np.any(v) and np.any(y)), (v, y)


#: A charge in a uniform magnetic field: its speed stays.
charge = sw.system(lambda t, v, y, *, turns=1.0: [turns * v[1], -turns * v[0]])


def test_what_turns_the_velocity_is_advised_a_method_that_keeps_the_speed() -> None:
    """|v| grows by √(1 + Φ²) in each step of False Euler, however short."""
    start: dict[str, Any] = {"v": [1.0, 0.0], "y": [0.0, 0.0], "dt": 0.1}
    words = "has forces that do; use rk4, or implicit_midpoint, which keeps what turns"
    refused(UnsupportedError, words, sw.integrate, charge, "leapfrog", **start, steps=1)
    kept = sw.integrate(charge, "implicit_midpoint", **start, steps=900)
    assert np.hypot(*kept.v[-1]) == pytest.approx(1.0, abs=1e-12)
    assert not kept.findings
    with pytest.warns(sw.AccuracyWarning, match=r"multiplies .* by 1.005, .* take rk4 with a short one, or implicit_midpoint"):
        grown = sw.integrate(charge, "false_euler", **start, steps=900)
    assert np.hypot(*grown.v[-1]) == pytest.approx(1.01**450, rel=1e-9)
    assert not sw.integrate(charge, "false_euler", **start, steps=300).findings  # up to tenfold it may be the motion's own
    world = sw.World(charge, "false_euler", v=np.array([1.0, 0.0]), y=np.zeros(2), dt=0.1)
    with pytest.warns(sw.AccuracyWarning, match="stable with no step"):
        frames(world, 100, 20)


# Amounts of reactions and populations stay positive, or the run says that one did not.
ABLE = [method.name for method in sw.methods() if method.error_order is not None and not method.has_series]
IMPLICIT = [name for name in ABLE if sw.method(name).is_implicit]
NEGATIVE = "which no solution reaches"


@sw.system(order=1)
def may_leonard(t: Any, y: Any, *, a: Any = 0.8, b: Any = 1.3) -> Any:
    """Three species, each of which is driven out by the next, over and over (May and Leonard, 1975)."""
    return [y[i] * (1.0 - y[i] - a * y[(i + 1) % 3] - b * y[(i + 2) % 3]) for i in range(3)]


@sw.system(order=1)
def predators(t: Any, y: Any) -> Any:
    """Lotka and Volterra's, in which the prey falls to 1e-13 of its largest number."""
    return [y[0] * (1.0 - y[1]), y[1] * (y[0] - 1.0)]


swing = sw.system(order=1)(lambda t, y: [y[1], -y[0]])


def run_of(system: Any, method: str, start: Any, end: float, tolerance: Any, **options: Any) -> tuple[sw.Run, list[str]]:
    """The run and what it warned of."""
    at = np.geomspace(1e-6 * end, end, 200)
    return told(sw.integrate, system, method, y=start, tolerance=tolerance, at=at, max_steps=300_000, **options)


@pytest.mark.parametrize("method", ABLE)
def test_no_negative_equilibrium_is_reached_without_a_word(method: str) -> None:
    """Of May and Leonard's species two reach −5 and 7.5 in many such runs; every one of them says so."""
    for tolerance, (a, b) in itertools.product((1e-2, 1e-4, 1e-6, (1e-6, 1e-9)), ((0.8, 1.3), (0.5, 1.8), (0.9, 0.9))):
        run, texts = run_of(may_leonard(a=a, b=b), method, [0.9, 0.05, 0.051], 2000.0, tolerance)
        if not run.status:
            assert (run.y >= -1e-24).all() or isinstance(tolerance, tuple)  # one number follows what is left of each
            negative = bool((run.y[-1] < -0.1).any())
            assert any(NEGATIVE in text for text in texts) is negative, (tolerance, a, b, run.y[-1], texts)
        run, texts = run_of(may_leonard(a=a, b=b), method, [0.9, 0.05, 0.051], 2000.0, tolerance, positive=True)
        assert run.status or (run.y >= 0.0).all()
        assert not any(NEGATIVE in text for text in texts)


@pytest.mark.parametrize("method", IMPLICIT)
def test_robertsons_reaction_stays_positive_to_1e11(method: str) -> None:
    for tolerance, end in itertools.product((1e-1, 1e-3, 1e-6, (1e-4, 1e-10)), (40.0, 1e5, 1e11)):
        run, texts = run_of(rober(), method, [1.0, 0.0, 0.0], end, tolerance)
        assert not run.status
        assert (run.y >= 0.0).all()
        assert run.y[-1].sum() == pytest.approx(1.0, rel=1e-9)
        assert not texts, (tolerance, end)


def test_the_warning_says_which_number_and_which_members() -> None:
    words = r"^y\[\d\] ends at -5 in 2 of 3 members; the first was member 0, which no .* positive=True$"
    system, start = may_leonard(a=np.array([0.8, 0.8, 0.5])), np.array([[0.9], [0.05], [0.051]])
    with pytest.warns(sw.AccuracyWarning, match=words):
        run = sw.integrate(system, "rodas4", y=start, tolerance=(1e-4, 1e-6), at=[2000.0])
    (found,) = run.findings
    assert np.array_equal(found.members, (run.y[-1] < -1.0).any(axis=0))


def test_numbers_that_may_become_negative_are_not_warned_of() -> None:
    """A swing; Lorenz's equations, whose rates are negative at large numbers only; amounts that began negative; rounding."""
    for start, system in (([1.0, 0.5], swing()), ([1.0, 1.0, 1.0], lorenz()), ([1.0, -0.5, 0.1], may_leonard(a=0.8, b=1.3))):
        _, texts = run_of(system, "rodas4", start, 2.0, 1e-3)
        assert not texts
    run, texts = run_of(predators(), "rodas4", [20.0, 20.0], 15.0, 1e-4)
    assert not run.status
    assert (run.y[-1] > -1e-4 * 20.0).all()
    assert not any(NEGATIVE in text for text in texts)


@pytest.mark.usefixtures("unmeasured")
def test_what_is_advised_stays_positive() -> None:
    for system, start, horizon in ((may_leonard(), [0.9, 0.05, 0.051], 200.0), (rober(), [1.0, 0.0, 0.0], 1e11)):
        scene = sw.Scene(system, y=start, horizon=horizon)
        advice = sw.advise(scene, frame=None, tolerance=1e-2, methods=[*IMPLICIT, "dop853"], cost="evaluations")
        assert advice.ranked
        for row in advice.ranked:
            assert (advice.run(row).y > -1e-2).all()


def test_equations_that_depend_on_the_time_are_left_alone() -> None:
    """The rate at zero is positive at the end, and was negative before."""
    driven = sw.system(order=1)(lambda t, y: np.cos(t) - 0.3 * y)
    run = sw.integrate(driven(), "merson", y=0.5, tolerance=1e-8, at=[1.5 * np.pi + 0.2])  # no warning, which would be an error
    assert run.y[-1] < -0.1


def test_members_are_looked_at_some_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which ones are told does not depend on how many are looked at together."""
    y = np.array([[0.5], [1.0], [2.0]]) * np.ones(7)
    wholes = []
    for at_once in (256, 2):
        monkeypatch.setattr(negative, "AT_ONCE", at_once)
        with pytest.warns(sw.AccuracyWarning, match="which no solution reaches"):
            run = sw.integrate(may_leonard(b=np.linspace(1.3, 1.31, 7)), "rodas5p", y=y, tolerance=1e-2, at=[1500.0])
        (finding,) = (each for each in run.findings if "no solution reaches" in each.message)
        wholes.append(finding.members)
    assert np.array_equal(*wholes)


def test_what_an_event_made_negative_is_no_error_of_the_method() -> None:
    decay = sw.system(order=1)(lambda t, y: [-y[0]])
    event = sw.Event(lambda t, y: y[0] - 0.5, then=lambda t, y: [-2.0])
    run = sw.integrate(decay, "dop853", y=[1.0], tolerance=1e-6, at=[3.0], events=event)
    assert run.y[-1, 0] == pytest.approx(-2.0 * np.exp(-(3.0 - np.log(2.0))), rel=1e-5)
    assert not run.findings


@sw.system(order=1)
def hunted(t: Any, y: Any, *, c: Any = 1.0) -> Any:
    """Lotka and Volterra's, of which Euler's steps of 0.3 from (5, 5) make −1, 2, −0.04, … of the prey."""
    return [y[0] * (1.0 - y[1]), y[1] * (y[0] - c)]


EULER: dict[str, Any] = {"y": np.array([5.0, 5.0]), "dt": 0.3}


def test_fixed_steps_that_make_an_amount_negative_say_so() -> None:
    """At the end of a run, short and prepared ones, too; and not where a solution reaches it, or an event put it there."""
    say = r"^y\[0\] ends at -1 in the run, which no solution reaches: .* wrong sign; take a shorter step$"
    prepared = sw.prepare(hunted(), "standard_euler", steps=1, **EULER)
    for make in [lambda: prepared(None, EULER["y"])] * 3 + [lambda: sw.integrate(hunted(), "standard_euler", steps=1, **EULER)]:
        with pytest.warns(sw.AccuracyWarning, match=say):
            make()
    put = sw.Event(lambda t, y: t - 0.1, then=lambda t, y: np.array([-2.0, 1.0]))
    sw.integrate(hunted(), "standard_euler", steps=2, **EULER)  # no warning, which would be an error
    sw.integrate(swing(), "rk4", y=np.array([1.0, 0.5]), dt=0.1, steps=20)
    sw.integrate(hunted(), "rk4", y=np.array([5.0, 5.0]), dt=0.01, steps=20, events=[put])


def test_a_world_says_once_that_an_amount_became_negative() -> None:
    world = sw.World(hunted(), "standard_euler", y=EULER["y"].copy(), dt=0.3)
    with pytest.warns(sw.AccuracyWarning, match=r"^y\[0\] ends at -1 in the run, which no solution reaches") as caught:
        world.step()
    assert caught[0].filename == __file__
    world.step(9)
    for system in (hunted(), swing()):
        frames(sw.World(system, "rk4", y=np.array([1.0, 0.5]), dt=0.1), 40, 1)
    world = sw.World(hunted(), "rk4", y=np.array([1.0, 0.5]), dt=0.1)
    world.y[0] = -1.0
    world.step()


def test_sweeps_say_how_many_members_became_negative() -> None:
    axes = {"c": ("c", np.linspace(0.1, 2.0, 9))}
    say = r"^y\[0\] ends at -2.84 in 4 of 9 members, the first of them at c = 0.1, which no solution reaches: .* a shorter step$"
    for chunk in (None, 2):
        with pytest.warns(sw.AccuracyWarning, match=say):
            sw.sweep(hunted, axes, "standard_euler", steps=3, chunk=chunk, **EULER)
    axes = {"a": ("a", [0.8, 0.8, 0.5])}
    say = r"^y\[1\] ends at -5 in 2 of 3 members, the first of them at a = 0.8, which .* tolerance, or give positive=True$"
    with pytest.warns(sw.AccuracyWarning, match=say):
        sw.sweep(may_leonard, axes, "rodas4", y=np.array([0.9, 0.05, 0.051]), tolerance=(1e-4, 1e-6), at=[1000.0, 2000.0])
