"""Steps below zero: time runs back, by every method, in every form."""

import itertools
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from support.cases import SYSTEMS, Case, cases, representative
from support.families import family
from support.heard import quiet
from support.refusals import refused

#: Symmetric methods: the step of −h undoes that of h.
SYMMETRIC = ("leapfrog", "verlet", "pefrl")
#: Their step is a function of the matrix of the rates, so that of −h commutes with it.
RUNGE_KUTTA = ("standard_euler", "standard_heun", "rk4", "merson", "fehlberg", "fehlberg_5", "dop853", "taylor")


@sw.system
def swept(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
    return np.cos(0.7 * t) - k * y


def goes_back(system: sw.System) -> bool:
    """Whether it has a past: it has no friction that sticks, nothing bounces, and no control drives it."""
    control = system.keeper
    drives = control is not None and not isinstance(control, (sw.Projection, sw.LengthControl))
    return not system.has_stick_friction and all(each.way == "spring" for each in system.contacts) and not drives


def quietly(case: Case, **options: Any) -> sw.Run:
    """Backward damping pumps, so some members diverge, which is a part of what is compared."""
    return quiet(case.run, 3, dt=-0.1, t0=1.7, **options)


BACK = [case for case in cases() if goes_back(SYSTEMS[case.system](np.random.default_rng(), 1))]


@pytest.mark.parametrize("every", family((False, True), lambda every: not every))
def test_the_forms_agree(every: bool) -> None:
    """The inputs of a step back are taken where the direct form takes them. A step is a sum of some tens of products of numbers
    of order 1, in another order; 23 steps of damping or of a filter that run back multiply that by up to e^(0.1·23·20).
    """
    of_form = [case for case in BACK if case.form == "matrix"]
    for case in of_form if every else representative(of_form, {"matrix": 1}, "forms"):
        run, direct = quietly(case), quietly(Case(case.method, case.system, "direct", case.start))
        size = max(1.0, float(np.abs(direct.y).max(initial=0.0)), float(np.abs(direct.v).max(initial=0.0)))
        for one, other in ((run.v, direct.v), (run.y, direct.y)):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-11 * size, err_msg=str(case))


def there_and_back(system: Any, method: Any, start: tuple[float, float], h: float, steps: int) -> Any:
    """The state after so many steps and as many back."""
    there = sw.integrate(system, method, v=start[0], y=start[1], dt=h, steps=steps)
    back = sw.integrate(system, method, v=there.v[-1], y=there.y[-1], t0=there.t[-1], dt=-h, steps=steps)
    assert back.t[-1] == pytest.approx(0.0, abs=1e-14)
    return np.array([float(back.v[-1]), float(back.y[-1])])


@pytest.mark.parametrize("method", SYMMETRIC)
def test_symmetric_methods_return_to_roundings(method: str) -> None:
    """Each of 2·400 steps rounds some ten times by 2⁻⁵³ of numbers below 4, and the motion stretches that by its time, 20."""
    for system in (sw.Pendulum(2.0), sw.Oscillator(1.5), swept()):
        back = there_and_back(system, method, (0.4, 1.2), 0.05, 400)
        np.testing.assert_allclose(back, [0.4, 1.2], rtol=0.0, atol=800 * 10 * 2.0**-53 * 4 * 20, err_msg=str(system))


@pytest.mark.parametrize("method", RUNGE_KUTTA)
def test_runge_kutta_returns_damped_as_often_as_it_was_stepped(method: str) -> None:
    """R(iΦ)·R(−iΦ) = |R|²: after n steps there and n back the state is the start times |R|^(2n), with no error of phase."""
    for h in (0.05, 0.5):
        grown = float(sw.analyse(sw.Oscillator(), method, dt=h).radius) ** 100
        back = there_and_back(sw.Oscillator(), method, (0.3, 1.0), h, 50)
        # A hundred steps of some tens of roundings each, of numbers as large as they grow.
        np.testing.assert_allclose(back, np.multiply([0.3, 1.0], grown), rtol=0.0, atol=1e-12 * grown)


def test_there_and_back_errs_by_the_order() -> None:
    """C·h^(p+1) − C·h^(p+1) of a step there and one back leaves h^(p+2) of an even order; of an odd one twice the term stays.

    So after a given time half the step leaves 2^−(p+1), or 2^−p, of the error, but for rounding.
    """
    for method in sw.methods():
        expected = method.order + 1 - method.order % 2
        errors = [
            np.abs(there_and_back(sw.Pendulum(), method, (0.3, 1.0), 4.0 / steps, steps) - [0.3, 1.0]).max()
            for steps in (80, 160, 320)
        ]
        for coarse, fine in itertools.pairwise(errors):
            # Half an order below the expected, for the next term of the series is not small; 1e-13 is what 640 steps round.
            assert fine < max(coarse / 2.0 ** (expected - 0.5), 1e-13), method.name


def test_the_past_of_a_known_motion() -> None:
    """y = cos(0.7·t)/(1 − 0.49) solves the driven oscillator; followed from t = 2 back to −3 as well as forward."""
    exact = lambda t: np.array([-0.7 * np.sin(0.7 * t), np.cos(0.7 * t)]) / 0.51  # noqa: E731
    for method in sw.methods():
        errors = {}
        for h, t0 in ((0.01, -3.0), (-0.01, 2.0)):
            v, y = exact(t0)
            run = sw.integrate(swept(), method, v=v, y=y, t0=t0, dt=h, steps=500)
            errors[h] = np.abs(np.array([run.v[-1], run.y[-1]]) - exact(t0 + 500 * h)).max()
        # The equation reads alike with t and h reversed, where −v goes with y; the start is at another phase of the motion.
        assert errors[-0.01] < 4.0 * errors[0.01] + 1e-13, method.name


@pytest.mark.parametrize("method", ["rk4", "leapfrog", "dop853", "taylor"])
def test_events_are_found_on_the_way_back(method: str) -> None:
    """From t = 8 back y = cos t is −0.1455 and rises through 0 at 5π/2 = 7.854, falls at 3π/2, and rises at π/2."""
    start = {"v": -np.sin(8.0), "y": np.cos(8.0), "t0": 8.0, "dt": -0.01, "steps": 790}
    events = [sw.Event(lambda t, v, y: y, name="any"), sw.Event(lambda t, v, y: y, name="up", direction=1)]
    run = sw.integrate(sw.Oscillator(form="physical"), method, events=events, **start)
    # Of second order: 8/24·h² of the phase.
    np.testing.assert_allclose(
        run.events["any"].t, np.pi * np.array([2.5, 1.5, 0.5]), atol=1e-4 if method == "leapfrog" else 1e-9
    )
    np.testing.assert_array_equal(run.events["up"].t, run.events["any"].t[[0, 2]])
    last = sw.Event(lambda t, v, y: y - 0.5, name="last", terminal=True)
    ended = sw.integrate(sw.Oscillator(form="physical"), method, events=last, **start)
    assert ended.stopped_at is not None
    np.testing.assert_allclose(ended.stopped_at, 2.0 * np.pi + np.pi / 3.0, atol=1e-4)
    np.testing.assert_array_equal(ended.y[-1], ended.events["last"].y[0])


def test_bodies_that_meet_on_the_way_back_are_told() -> None:
    """A fall together with time as with −v forward; the same warning, at −t."""
    start = {"y": np.array([[1.0, 0.0], [-1.0, 0.0]]), "steps": 200}
    v, system = np.array([[0.0, 0.02], [0.0, -0.02]]), sw.NBody([1.0, 1.0], force="newton")
    texts = []
    for way in (1.0, -1.0):
        with pytest.warns(sw.AccuracyWarning) as caught:
            run = sw.integrate(system, "leapfrog", v=way * v, dt=way * 0.02, **start)
        texts.append(str(caught[0].message).replace("t = -", "t = ").replace("steps of -", "steps of "))
        assert len(run.encounters) == 1
    assert texts[0] == texts[1]


REFUSED: list[tuple[Any, dict[str, Any], str]] = [
    (sw.Oscillator(form="physical", friction=0.1), {"v": 0.0, "y": 1.0}, "friction that sticks has none"),
    (sw.Particles(floor=sw.Floor()), {"v": np.zeros((1, 2)), "y": np.ones((1, 2))}, "cannot undo a bounce"),
    (sw.NBody([1.0, 1.0]), {"v": np.zeros((2, 2)), "y": np.eye(2), "control": sw.EnergyControl(0.3)}, "away from its target"),
    (sw.RigidBody([1.0, 2.0, 3.0]), {"v": np.ones(3), "y": np.eye(4)[0], "control": sw.NormControl(1.0)}, "away from its target"),
]


def test_what_has_no_past_says_why() -> None:
    for system, start, why in REFUSED:
        arrays = {key: np.array(each) if key in ("v", "y") else each for key, each in start.items()}
        for call in (partial(sw.integrate, steps=3), sw.World):
            refused(UnsupportedError, f"^dt: .*a negative step .*{why}", call, system, "rk4", dt=-0.1, **arrays)


def test_a_step_of_nothing() -> None:
    for dt in (0, 0.0, -0.0, np.float64(0.0), np.array(0.0)):
        for call in (partial(sw.integrate, steps=3), sw.World):
            with pytest.raises(ArgumentError, match="dt: expected a number other than zero in units of time, got 0"):
                call(sw.Oscillator(), "rk4", v=np.zeros(1), y=np.ones(1), dt=dt)


def test_rods_keep_their_length_on_the_way_back() -> None:
    """``LengthControl(c)`` relates to the step, so the length decays to what it should be whichever way time runs."""
    scene = sw.scenes.double_pendulum()
    for way in (1.0, -1.0):
        ask: dict[str, Any] = {"v": scene.v, "y": scene.y, "dt": way * 0.01, "steps": 1000, "record": "length_error"}
        run = sw.integrate(scene.system, "rk4", **ask, control=sw.LengthControl(0.5))
        assert np.abs(run.recorded["length_error"]).max() < 1e-5


PROJECTED = [("fixed", 3, "nacozy"), ("fixed", 90, "scaling"), ("adaptive", 3, "scaling"), ("adaptive", 90, "nacozy")]
PROJECTED += [("adaptive with events", 3, way) for way in ("scaling", "nacozy")]


@pytest.mark.parametrize(("steps", "bodies", "way"), PROJECTED)
def test_a_projection_keeps_the_energy_backward(steps: str, bodies: int, way: str) -> None:
    """On one tape and row by row; the energy that it added is told with its sign.

    A projection leaves the square of what a step missed, relative to the energy, of Nacozy's; the bound is ten times what was
    seen. The same motion forward has the same bits: backward every operation has the other sign, or none.
    """
    v, y = 0.5 * np.random.default_rng(3).normal(size=(2, bodies, 2, 2))
    system = sw.NBody(np.ones(bodies) / bodies, force="newton", softening=0.3)
    ask: dict[str, Any] = {"y": y, "t0": 0.0, "record": "energy"}
    if "events" in steps:
        ask["events"] = sw.Event(lambda t, v, y: y[0, 0], name="there")

    def going(sign: float, control: Any) -> sw.Run:
        """Forward from −v, backward from v."""
        fixed, chosen = {"dt": sign * 0.05, "steps": 20, "every": 10}, {"tolerance": 1e-3, "at": [sign * 0.5, sign]}
        return sw.integrate(system, "merson", v=-sign * v, control=control, **ask, **(fixed if steps == "fixed" else chosen))

    run, forward, free = going(-1.0, sw.Projection(way)), going(1.0, sw.Projection(way)), going(-1.0, None)
    energy = system.energy(v, y)
    assert run.recorded["energy"][-1] == pytest.approx(energy, rel=1e-6)
    missed, without = (np.abs(each.recorded["energy"][-1] - energy) for each in (run, free))
    assert without.max() > 5.0 * missed.max()
    np.testing.assert_array_equal(forward.y[-1], run.y[-1])
    np.testing.assert_array_equal(forward.work, run.work)  # type: ignore[arg-type]
