"""Advice for scenes that it never saw, of any size, and of one's own."""

import copy
import functools
import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError
from stepwell.scenes import Scene
from support.advised import RATIO, _times_are_measured_once, assert_cheap, assert_true, linear, pendulum, tried, unmeasured  # noqa: F401
from support.families import family
from support.looped import assert_refused
from support.refusals import refused

from benches.advice import Brute

pytestmark = pytest.mark.usefixtures("unmeasured")


def driven(damping: float, drive: float) -> Scene:
    """A damped oscillator under a sinusoid, from rest: the steady swing and the dying one, in closed form."""
    omega, d = 2.0, damping
    system = sw.Oscillator(omega, d, a=sw.Sinusoid(1.0, drive), form="physical")
    s, fast = d * omega, omega * math.sqrt(1 - d * d)
    below = (omega**2 - drive**2) ** 2 + (2 * s * drive) ** 2
    p, q = (omega**2 - drive**2) / below, -2 * s * drive / below  # y = p·sin + q·cos for ever

    def exact(t: Any) -> Any:
        a, b = -q, (-p * drive - s * q) / fast  # the rest: e^(−st)·(a·cos + b·sin), so that y and v begin at 0
        swing, die = np.sin(drive * t), np.exp(-s * t)
        y = p * swing + q * np.cos(drive * t) + die * (a * np.cos(fast * t) + b * np.sin(fast * t))
        v = drive * (p * np.cos(drive * t) - q * swing)
        v = v + die * ((-s * a + b * fast) * np.cos(fast * t) + (-s * b - a * fast) * np.sin(fast * t))
        return v, y

    return Scene(system, 0.0, 0.0, 30.0, exact=exact, name="driven")


def soft_chain() -> Scene:
    """A chain of five unequal masses with no formula at all."""
    system = sw.Chain(5, stiffness=[1.0, 3.0, 2.0, 5.0, 1.0, 4.0], mass=[1.0, 2.0, 0.5, 1.0, 3.0])
    return Scene(system, v=[0.0, 0.0, 1.0, 0.0, 0.0], y=0.2, horizon=40.0)


def stiff_chain() -> Scene:
    """Springs that differ by ten thousand, so that what is fast is no part of what is seen."""
    system = sw.Chain(4, stiffness=[1.0, 100.0, 3.0, 1e4, 2.0], mass=[1.0, 0.1, 2.0, 1.0])
    return Scene(system, v=[0.0, 0.0, 1.0, 0.0], y=0.1, horizon=8.0)


def jolted() -> Scene:
    """An oscillator whose force jumps."""
    force = sw.Sampled(np.random.default_rng(3).normal(size=10), interval=0.7)
    system = sw.Oscillator(2.0, 0.1, a=force, form="physical")
    return Scene(system, v=0.0, y=0.5, horizon=7.0)


HELD_OUT = {
    "driven": lambda: driven(0.05, 1.3),
    "resonant": lambda: driven(0.02, 2.0),
    "chain of 3": lambda: sw.scenes.chain(3),
    "chain of 15": lambda: sw.scenes.chain(15),
    "unequal chain": soft_chain,
    "stiff chain": stiff_chain,
    "ellipse": lambda: sw.scenes.kepler(0.5),
    "uneven ellipse": lambda: sw.scenes.kepler(0.3, 0.1),
    "long ellipse": lambda: sw.scenes.kepler(0.95, 0.3),
    "over the top": lambda: pendulum(2.5, 0.0, 30.0),
    "nearly upright": lambda: pendulum(0.0, 3.1, 30.0),
    "overdamped": lambda: Scene(sw.Oscillator(50.0, 2.0, form="physical"), v=0.0, y=1.0, horizon=5.0),
    "one block": linear,
    "jolted": jolted,
    "controlled": lambda: replace(sw.scenes.clover(), control=sw.EnergyControl(0.3)),
    "four stars": lambda: replace(sw.scenes.plummer(4), horizon=3.0),
}

TOLERANCES = (5e-2, 2e-3, 3e-5)
#: Of scenes that take long one tolerance is tried.
LONG = {
    5e-2: ("chain of 3", "stiff chain", "uneven ellipse", "nearly upright", "four stars"),
    2e-3: ("chain of 15", "over the top", "one block", "jolted"),
    3e-5: ("unequal chain", "long ellipse", "controlled"),
}
UNSEEN = {name: tuple(each for each in TOLERANCES if name in LONG[each]) or TOLERANCES for name in HELD_OUT}


@functools.cache
def held_out(name: str) -> Brute:
    return Brute(HELD_OUT[name](), None, RATIO)


@pytest.mark.parametrize(("name", "tolerance"), tried(UNSEEN, ("driven", "ellipse", "controlled")))
def test_the_advice_for_scenes_never_seen_is_true_and_near_the_cheapest(name: str, tolerance: float) -> None:
    brute = held_out(name)
    advice = sw.advise(brute.given, frame=None, tolerance=tolerance, cost="evaluations")
    assert advice.best is not None
    assert_true(brute, advice)
    assert_cheap(brute, advice)


FRAMED = {"over the top": HELD_OUT["over the top"], "ellipse": lambda: sw.scenes.kepler(0.6)}


@pytest.mark.parametrize(
    ("name", "frame"),
    family([("over the top", 0.9), ("over the top", 100.0), ("ellipse", 7.3)], lambda name, frame: frame == 0.9),
)
def test_frames_that_do_not_divide_the_horizon(name: str, frame: float) -> None:
    """The last one ends beyond it, where the true motion is known too."""
    brute = Brute(FRAMED[name](), frame, RATIO)
    advice = sw.advise(brute.given, frame=frame, tolerance=1e-3, cost="evaluations")
    assert advice.best is not None
    assert not advice.cut
    assert_true(brute, advice)
    assert_cheap(brute, advice)


@pytest.mark.parametrize("known", family([True, False], lambda known: known))
def test_amplitudes_do_not_matter(known: bool) -> None:
    """From 1e-12 to 1e12 the advice is the same, by a formula or by a tight run; for powers of two to the bit."""

    def advised(size: float) -> sw.advice.Advice:
        exact = (lambda t: (-size * np.sin(t), size * np.cos(t))) if known else None
        scene = Scene(sw.Oscillator(1.0), v=0.0, y=size, horizon=40.0, exact=exact)
        return sw.advise(scene, frame=None, tolerance=1e-3, methods=["rk4", "dop853"], cost="evaluations")

    one = advised(1.0)
    assert {row.by for row in one.ranked} == {"step", "tolerance"}
    for size in (2.0**-40, 2.0**40):
        assert advised(size).ranked == one.ranked
    for size in (1e-12, 1e-9, 1e-7, 1e-6, 1e12):
        for ours, theirs in zip(advised(size).ranked, one.ranked, strict=True):
            assert (ours.name, ours.steps, ours.tolerance) == (theirs.name, theirs.steps, theirs.tolerance)
            assert ours.error == pytest.approx(theirs.error, rel=1e-6)


@pytest.mark.parametrize("force", [1e-12, 1e-6, 1e9])
def test_from_rest_under_a_force(force: float) -> None:
    system = sw.Oscillator(1.0, a=sw.Sinusoid(force, 2.0), form="physical")
    scene = Scene(system, v=0, y=0, horizon=40.0)
    advice = sw.advise(scene, frame=None, tolerance=1e-3, methods=["rk4", "dop853"], cost="evaluations")
    t = np.linspace(0.0, 40.0, 4001)
    true = replace(
        scene, exact=lambda t: (force * (2 * np.cos(t) - 2 * np.cos(2 * t)) / 3, force * (2 * np.sin(t) - np.sin(2 * t)) / 3)
    )
    assert len(advice.ranked) >= 2
    for row in advice.ranked:
        if row.tolerance is None:
            run = true.run(row.method, row.dt, steps=row.steps, every=1)
        else:
            run = sw.integrate(system, row.method, v=0.0, y=0.0, tolerance=row.tolerance, at=t)
        assert true.state_error(run).max() <= 1e-3


@sw.system
def pushed(t, v, y, *, begin=1.0, end=2.0, push=1.0, omega=1.0):
    return np.where((t > begin) & (t < end), push, 0.0) - omega**2 * y


def pulsed(begin: float, width: float, horizon: float, v: float, y: float, push: float, omega: float) -> Scene:
    """An oscillator that is pushed for a moment, in closed form: from each edge on a step response is added or taken away."""
    system = pushed(begin=begin, end=begin + width, push=push, omega=omega)

    def exact(t: Any) -> Any:
        places = y * np.cos(omega * t) + v / omega * np.sin(omega * t)
        speeds = v * np.cos(omega * t) - y * omega * np.sin(omega * t)
        for edge, sign in ((begin, 1.0), (begin + width, -1.0)):
            since = omega * np.maximum(t - edge, 0.0)
            places = places + sign * push / omega**2 * (1.0 - np.cos(since))
            speeds = speeds + sign * push / omega * np.sin(since)
        return speeds, places

    return Scene(system, v, y, horizon, exact=exact, name="pulsed")


@pytest.mark.parametrize(
    "scene",
    [
        pulsed(7.3, 0.2, 20.0, 0.0, 0.0, 1.0, 1.0),
        pulsed(7.3, 0.2, 20.0, 0.1, 0.0, 1.0, 1e-3),
        pulsed(31.0, 0.4, 40.0, 0.0, 1e-2, -5.0, 0.5),
        pulsed(2.1e-6, 1.3e-7, 5e-6, 0.0, 0.0, 1e9, 3e5),
        pulsed(1.7e5, 4e3, 4e5, 1e-3, 0.0, 1e-6, 1e-4),
        pulsed(6.457835693660228e-4, 0.011481, 0.028513966597504523, 0.0, 0.0, 859449.876, 1379.57),
    ],
)
def test_a_push_for_a_moment_is_not_stepped_over(scene: Scene) -> None:
    """Its motion without a formula is that of the formula, so what is right is not rejected and what is advised is right."""
    methods = ["leapfrog", "rk4", "merson", "dop853"]
    advice = sw.advise(replace(scene, exact=None), frame=None, tolerance=1e-2, methods=methods, cost="evaluations")
    assert not advice.cut
    assert advice.ranked
    t = np.linspace(0.0, scene.horizon, 2001)
    for ours, true, scale in zip(advice.scene.exact(t), scene.exact(t), scene.scales, strict=True):
        # The reference agrees with its check to a tenth of the tolerance, and is much better; near an edge it is a state within a
        # step, which may be as wrong as the push over a thousandth of the horizon.
        assert np.abs(ours - true).max() <= 1e-3 * scale
    for row in advice.ranked:
        if row.tolerance is None:
            run = scene.run(row.method, row.dt, steps=row.steps, every=1)
            assert scene.state_error(run).max() <= 1e-2


@sw.system
def van_der_pol(t, v, y, *, mu=10.0):
    return mu * (1.0 - y * y) * v - y


@sw.system(order=1)
def reaction(t, y, *, fast=2000.0):
    """A fast reaction that is nearly in balance, and a slow one: eigenvalues 0, −2·fast and −1.5/fast."""
    return np.array([fast * y[1] - y[0], y[0] - (fast + 3.0) * y[1], 3.0 * y[1]])


def test_the_largest_length_of_a_peak_between_two_samples_is_found() -> None:
    """The velocity of Van der Pol's oscillator jumps to about 4μ/3 for 1/μ of a unit of time: a 40 000th of the horizon here."""
    mu = 200.0
    scene = Scene(van_der_pol(mu=mu), v=0.0, y=2.0, horizon=200.0)
    with pytest.warns(sw.StiffnessWarning):
        run = sw.integrate(scene.system, "dop853", v=0.0, y=2.0, tolerance=1e-10, at=np.linspace(1.0, 200.0, 4_000_00))
    known = replace(scene, exact=lambda t: tuple(np.interp(t, run.t, block) for block in (run.v, run.y)))
    # Largest where v̇ = 0, which is at y = −1 but for O(1/μ): 4μ/3. Even samples miss it; steps of a 15th of an interval over and
    # over find it to a part of what changes by a quarter there.
    assert known.scales[0] == pytest.approx(np.abs(run.v).max(), rel=0.25)
    assert known.scales[0] == pytest.approx(4.0 * mu / 3.0, rel=0.25)


def test_what_is_no_scene_and_no_exact_solution() -> None:
    good: dict[str, Any] = {"system": sw.Pendulum(), "v": 0.0, "y": 1.0, "horizon": 10.0}
    two, controls = sw.Pendulum([1.0, 2.0]), "an EnergyControl, a LengthControl, a NormControl, a Control or a Projection"
    assert_refused(
        (lambda wrong=wrong: Scene(**good | wrong), error, message)
        for wrong, error, message in (
            ({"system": 3}, DTypeError, "system: expected a stepwell system such as Oscillator(), got int"),
            ({"v": "fast"}, DTypeError, "v: expected real numbers"),
            ({"v": [0.0, 1.0]}, ArgumentError, "v: expected shape () of a scene's one member, got (2,)"),
            ({"y": math.nan}, ArgumentError, "y: expected finite numbers"),
            ({"system": two}, ArgumentError, "system: expected a system of one member, got parameters of shape (2,)"),
            ({"horizon": None}, ArgumentError, "horizon: expected the time over which errors are measured, in units of time"),
            ({"horizon": math.nan}, ArgumentError, "horizon: expected finite numbers in units of time"),
            ({"horizon": -1.0}, ArgumentError, "horizon: expected numbers above zero"),
            ({"dt": 0.0}, ArgumentError, "dt: expected numbers above zero"),
            ({"until": -1.0}, ArgumentError, "until: expected a time of zero or more"),
            ({"exact": 3.0}, DTypeError, "exact: expected a function of times, or None, got float"),
            ({"control": "on"}, DTypeError, f"control: expected {controls}, got str"),
        )
    )
    shapes = "exact: expected y of shape (1001,) for 1001 times, got (1001, 2)"
    assert_refused(
        (lambda exact=exact: sw.advise(Scene(sw.Pendulum(), 0.0, 1.0, 10.0, exact=exact), frame=None), ArgumentError, message)
        for exact, message in (
            (lambda t: (np.cos(t), np.where(t < 3.0, t, np.nan)), "exact: expected finite numbers, got y = nan at t = 3"),
            (lambda t: np.cos(t)[0], "exact: expected the blocks v and y, arrays of real numbers, got float64"),
            (lambda t: (np.cos(t), np.zeros((len(t), 2))), shapes),
        )
    )


def test_jumps_that_last_for_a_moment_are_no_reason_to_advise_nothing() -> None:
    """Errors are relative to the largest velocity, which the motion has between two samples only."""
    scene = Scene(van_der_pol(mu=300.0), v=0.0, y=2.0, horizon=300.0)
    advice = sw.advise(scene, frame=None, tolerance=1e-2, methods=["fehlberg_5", "dop853"], cost="evaluations")
    assert advice.best is not None
    assert advice.scene.scales[0] == pytest.approx(400.0, rel=0.05)


@pytest.mark.parametrize("scene", [Scene(reaction(), y=[1.0, 0.0, 0.0], horizon=10.0), Scene(van_der_pol(), 0.0, 2.0, 40.0)])
def test_an_advised_step_is_shorter_than_the_limit_that_is_told(scene: Scene) -> None:
    """By more than the 2.2 % between the steps at which the limit is looked for."""
    methods = ["standard_euler", "standard_heun", "rk4", "merson", "dop853"]
    advice = sw.advise(scene, frame=None, tolerance=1e-2, methods=methods, cost="evaluations", fixed=True)
    assert advice.ranked
    for row in advice.ranked:
        assert row.observed_limit > 1.02 * row.dt
        assert row.margin > 1.02


@pytest.mark.parametrize("frame", [None, 0.5])
def test_an_advised_step_is_shorter_than_the_limit_of_a_linear_system(frame: float | None) -> None:
    """A mode that no error shows: 600 times as fast as the other, and at rest."""
    scene = Scene(sw.LinearSystem([[-1.0, 0.0], [0.0, -600.0]], velocities=0), y=[1.0, 0.0], horizon=3.0)
    scene = replace(scene, exact=lambda t: (np.zeros((len(t), 0)), np.stack([np.exp(-t), 0.0 * t], axis=-1)))
    advice = sw.advise(scene, frame=frame, tolerance=1e-2, methods=["standard_euler", "rk4"], cost="evaluations")
    assert [row.method.name for row in advice.ranked] == ["standard_euler", "rk4"]
    for row in advice.ranked:
        assert row.limit == sw.stability_limit(scene.system, row.method).dt
        assert row.limit >= 1.05 * row.dt


@pytest.mark.parametrize("scene", [pulsed(7.3, 0.2, 20.0, 0.1, 0.0, 1.0, 1e-3), pulsed(5.1, 0.25, 16.0, 0.2, 0.0, 2.0, 1e-3)])
def test_what_is_advised_for_a_large_error_is_advised_for_a_small_one_if_it_is_as_good(scene: Scene) -> None:
    """Or what costs less by the same method; by luck as well, for errors do not fall evenly here."""
    scene = replace(scene, exact=None)
    methods = ["pefrl", "rk4", "fehlberg", "fehlberg_5", "dop853"]
    loose, tight = (sw.advise(scene, frame=None, tolerance=each, methods=methods, cost="evaluations") for each in (1e-2, 1e-4))
    costs = {row.name: row.evaluations_per_time for row in tight.ranked}
    dominated = {each.name for each in tight.rejected if each.kind == "dominated"}
    good = [row for row in loose.ranked if row.error <= 0.9e-4]
    assert good
    for row in good:
        assert row.name in dominated or costs[row.name] <= 1.01 * row.evaluations_per_time


@pytest.mark.parametrize("around", ["surfaces", "friction that sticks"])
def test_a_scene_that_adaptive_steps_do_not_go_with_needs_an_exact_solution(around: str) -> None:
    if around == "surfaces":
        system: sw.System = sw.Particles(1, floor=sw.Floor(restitution=0.5), gravity=[0.0, -1.0])
    else:
        system = sw.Oscillator(1.0, friction=0.1, form="physical")
    scene = Scene(system, v=0.0, y=1.0, horizon=3.0)
    refused(ArgumentError, f"exact: needed by unnamed, whose system has {around}, got None", sw.advise, scene, frame=None)


def test_neither_a_hard_part_nor_many_frames_end_what_is_known() -> None:
    """A loose tolerance asks for a truth that is a tenth as loose, so it is judged to the end and true there."""
    for scene in (sw.scenes.kepler(0.95), sw.scenes.pendulum(179.0)):
        unknown = replace(scene, exact=None)
        advice = sw.advise(unknown, frame=None, tolerance=1e-1, methods=["dop853", "merson"], cost="evaluations")
        assert not advice.cut
        assert advice.scene.horizon == scene.horizon
        for row in advice.ranked:
            assert scene.state_error(advice.run(row)).max() <= 1e-1, (scene, row)
    # Runs of all methods use up what a search may spend, and what was run already is no further run.
    advice = sw.advise("oscillator", frame=1e-4, tolerance=1e-2, cost="evaluations", fixed=True)
    assert advice.best.substeps == 1


def test_a_row_with_a_tolerance_is_true_whenever_it_is_asked() -> None:
    """Asked for the end alone, for a few times or for thousands: one run."""
    scene = sw.scenes.kepler(0.3)
    scene = replace(scene, horizon=20.0 * math.pi)
    rng = np.random.default_rng(11)
    for tolerance in (1e-2, 1e-4):
        methods = ["merson", "fehlberg_5", "dop853", "rosenbrock23"]
        advice = sw.advise(scene, frame=None, tolerance=tolerance, methods=methods, cost="evaluations")
        for row in (row for row in advice.ranked if row.tolerance is not None):
            for number in (0, 1, 3, 30, 3000):
                at = np.union1d(rng.uniform(0.0, scene.horizon, number), [scene.horizon])
                run = sw.integrate(scene.system, row.method, v=scene.v, y=scene.y, tolerance=row.tolerance, at=at)
                assert scene.state_error(run).max() <= tolerance


def test_a_scene_needs_three_things_and_goes_through_a_file() -> None:
    """Numbers and lists for blocks, and all else by itself; ``until`` says how far if ``horizon`` does not."""
    scene = sw.Scene(sw.Chain(3), v=0, y=[0.0, 1, 0], until=20)
    assert (scene.v.shape, scene.y.shape, scene.horizon, scene.dt) == ((3,), (3,), 20.0, 0.02)
    assert scene == Scene(sw.Chain(3), v=np.zeros(3), y=np.array([0.0, 1.0, 0.0]), horizon=20.0, until=20.0)
    advice = sw.advise(scene, frame=None, tolerance=1e-2, methods=["leapfrog"], cost="evaluations")
    assert advice.best is not None
    assert not advice.cut
    at_rest = sw.advise(Scene(sw.Chain(3), v=0, y=0, horizon=20.0), frame=None, methods=["leapfrog", "merson"])
    assert at_rest.best.error == 0.0
    for scene in sw.scenes.scenes():
        for other in (pickle.loads(pickle.dumps(scene)), copy.copy(scene), copy.deepcopy(scene)):
            assert other == scene
            assert hash(other) == hash(scene)
    assert sw.scenes.kepler(0.5) == sw.scenes.kepler(0.5) != sw.scenes.kepler(0.6)
    assert replace(sw.scenes.clover(), dt=0.2) != sw.scenes.clover()
    for scene in ("clover", Scene(sw.Pendulum(), v=0.0, y=2.0, horizon=20.0)):
        advice = sw.advise(scene, frame=None, tolerance=1e-2, methods=["rk4", "merson", "verlet"], cost="evaluations")
        for other in (pickle.loads(pickle.dumps(advice)), copy.deepcopy(advice)):
            assert other == advice
            assert hash(other) == hash(advice)
            assert str(other) == str(advice)
            assert np.array_equal(other.run().y, advice.run().y)


def test_what_is_too_large_too_long_or_not_known_is_refused_at_once() -> None:
    large = Scene(sw.NBody(np.ones(30_000), force="newton", dim=2), v=0.0, y=1.0, horizon=1.0)
    refused(ArgumentError, "scene: expected a state of at most 100000 numbers, got one of 120000", sw.advise, large)
    with pytest.raises(ArgumentError, match=r"frame: expected at most 100 times the horizon of 62\.83.* got 1e\+09"):
        sw.advise("oscillator", frame=1e9)
    for frame in (2e-5, 1e-9, 1e-300):
        with pytest.raises(sw.errors.TooLargeError, match=r"frame: expected at most 1000000 frames .* units of time"):
            sw.advise("oscillator", frame=frame)
    chaos = replace(sw.scenes.energy_control(), horizon=200.0)
    with pytest.raises(ArgumentError, match=r"is not known beyond t = .*, within the first frame"):
        sw.advise(chaos, frame=100.0, tolerance=1e-2, methods=["rk4"])
