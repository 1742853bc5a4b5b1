"""Bodies that meet within a step are told of, with the step and the pair, whatever the energy says."""

from __future__ import annotations

import itertools
import math
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnsupportedError
from stepwell.runs import diagnostics, encounters

#: Two unit masses at rest, two apart, under Newton's law: they fall together in π·√(2³/(8·2)), their relative distance obeying
#: r̈ = −2/r².
FALL: dict[str, Any] = {"v": np.zeros((2, 2)), "y": np.array([[-1.0, 0.0], [1.0, 0.0]])}
PAIR = sw.NBody([1.0, 1.0], force="newton")
TIME = math.pi * math.sqrt(2.0**3 / (8.0 * 2.0))


def integrated(*arguments: Any, **options: Any) -> tuple[sw.Run, str]:
    """A run, and all that it warns of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = sw.integrate(*arguments, **options)
    return run, "\n".join(f"{each.category.__name__}: {each.message}" for each in caught)


@pytest.mark.parametrize("dt", [0.01, 0.013, 0.001])
def test_head_on(dt: float) -> None:
    """Whatever comes after it, and whatever the energy; leapfrog's was 2585 at status OK.

    At the distance r they move at 2·√(1/r − 1/2); from 2r = h·2/√r on, r = h^(2/3), a step is too long. From there it takes less
    than r^(3/2) = h. The first methods of all are late by some steps.
    """
    for method in sw.methods():
        if method.splits:  # Wisdom and Holman's follows both exactly
            continue
        run, words = integrated(PAIR, method, **FALL, dt=dt, steps=round(4.0 / dt), every=round(1.0 / dt))
        (met,) = run.encounters
        assert met.bodies == (0, 1)
        # Methods of the first order are late by a fraction h of the fall, twice over, or early.
        assert met.step * dt == pytest.approx(TIME, abs=6 * dt), method
        # An implicit step that is too long for the encounter ends anywhere near.
        assert met.distance <= (4.0 if method.is_implicit else 2.0) * dt ** (2 / 3), method
        assert f"bodies 0 and 1 met within step {met.step} (t = {met.step * dt:g})" in words
        assert "AccuracyWarning" in words


def test_an_energy_that_recovers() -> None:
    """Through each other half a step after a state, 9.5 steps from the start: the pulls before and after cancel."""
    speed = 1.0 / (9.5 * 0.01)
    through = {"v": np.array([[speed, 0.0], [-speed, 0.0]]), "y": FALL["y"]}
    run, words = integrated(PAIR, "leapfrog", **through, dt=0.01, steps=200)
    changed = abs(run.energy[-1] - PAIR.energy(through["v"], through["y"]))
    assert changed < diagnostics.DOUBTFUL_CHANGE * speed**2
    assert "another energy" not in words
    assert "bodies 0 and 1 met within step" in words


def test_what_is_softened_enough_is_not_told_of() -> None:
    """Through the middle of a softened pair at 2·√(1/ε − 1/2) at most: h·w < 2ε at ε = 0.1, not at 0.001."""
    for softening, expected in ((0.1, ()), (0.001, ((0, 1),))):
        run, words = integrated(
            sw.NBody([1.0, 1.0], force="newton", softening=softening), "leapfrog", **FALL, dt=0.01, steps=1000
        )
        assert tuple(each.bodies for each in run.encounters) == expected
        assert bool(words) == bool(expected)


def test_the_documents_symmetric_start() -> None:
    """Appendix D with ε = 0: the three meet at t = √(πe/2)·(1 + erf √½) = 3.477, in silence once."""
    when = math.sqrt(math.pi * math.e / 2) * (1.0 + math.erf(math.sqrt(0.5)))
    for form, pair in (("limited", "matching"), ("limited", "printed"), ("printed", "matching")):
        scene = sw.scenes.energy_control(pair, 0.0, form)
        run, words = integrated(scene.system, "standard_euler", v=scene.v, y=scene.y, dt=0.01, steps=1000, control=scene.control)
        assert "met within step" in words
        # Standard Euler is of first order, and the printed potential pushes what needs no push: later by some tenths.
        assert run.encounters[0].step * 0.01 == pytest.approx(when, abs=0.05 if pair == "matching" else 0.5)


def test_the_pythagorean_run_past_its_encounter() -> None:
    """Masses 4 and 5 at t = 1.879, 0.0097 apart: at some 43 units of time a step of 0.001 goes four times that."""
    scene = sw.scenes.pythagorean()
    for method in ("leapfrog", "rk4", "dop853"):
        run, words = integrated(scene.system, method, v=scene.v, y=scene.y, dt=0.001, steps=10_000)
        (met,) = run.encounters
        assert (met.bodies, met.step * 0.001) == ((1, 2), pytest.approx(1.879, abs=0.002))
        assert f"bodies 1 and 2 met within step {met.step}" in words
    run, words = integrated(scene.system, "dop853", v=scene.v, y=scene.y, dt=0.00002, steps=100_000)
    assert (run.encounters, words) == ((), "")


def test_members_of_a_batch() -> None:
    """The second falls; the others circle each other. The member is named."""
    speed = np.array([0.5, 0.0, 0.5])
    v = np.zeros((2, 2, 3))
    v[0, 1], v[1, 1] = speed, -speed
    y = np.repeat(FALL["y"][..., np.newaxis], 3, axis=-1)
    run, words = integrated(PAIR, "leapfrog", v=v, y=y, dt=0.001, steps=40_000)
    assert [each.member for each in run.encounters] == [(1,)]
    alone, _ = integrated(PAIR, "leapfrog", **FALL, dt=0.001, steps=40_000)
    assert run.encounters[0]._replace(member=()) == alone.encounters[0]
    assert "met within step" in words
    assert "member 1" in words


def test_nothing_is_told_of_what_steps_follow() -> None:
    """In the tests a warning is an error, and the steps are looked at all the same."""
    for scene in (sw.scenes.figure_eight(), sw.scenes.clover(), sw.scenes.kepler()):
        assert scene.run("leapfrog").encounters == (), scene.name


def test_dust_that_passes_is_no_encounter() -> None:
    """Masses so small that the passage turns nobody by 0.01 rad: 2·G·m/(q·w²) = 2e-7. Without any mass nothing happens at all."""
    past = {"v": np.array([[100.0, 0.0], [-100.0, 0.0]]), "y": np.array([[-1.0, 0.1], [1.0, -0.1]])}
    for mass, met in ((1e-4, False), (0.0, False), (1e4, True)):
        run, _ = integrated(sw.NBody([mass, mass], force="newton"), "rk4", **past, dt=0.0083, steps=10)
        assert bool(run.encounters) == met


def test_who_does_not_listen_pays_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any, **__: Any) -> Any:
        raise AssertionError

    monkeypatch.setattr(encounters, "met_in", never)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        sw.integrate(PAIR, "leapfrog", **FALL, dt=0.001, steps=4000)
    with pytest.raises(AssertionError):
        integrated(PAIR, "leapfrog", **FALL, dt=0.001, steps=4000)


@pytest.mark.parametrize("force", ["newton", "logarithmic", "printed"])
def test_the_look_ahead_of_floats_and_of_arrays_agree(force: str) -> None:
    rng = np.random.default_rng(5)
    answers = []
    for softening in (0.0, 0.01):
        bodies = sw.NBody([1.0, 0.0, 2.0], force=force, softening=softening, G=1.5)
        v, y = rng.normal(size=(3, 2, 400)), rng.normal(size=(3, 2, 400))
        for h in (0.003, 0.03):
            each = encounters.may_meet_each(bodies, h, 3.0, v, y)
            one = [encounters.may_meet(bodies, h, 3.0, v[..., i].tolist(), y[..., i].tolist()) for i in range(400)]
            assert each.tolist() == one
            answers += one
    assert 0.02 < np.mean(answers) < 0.9


def test_the_look_at_many_bodies_is_little_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the others do to a pair is a sum over all bodies, so it is computed of those pairs only that would else be told of.

    For every pair it would be 2·64·2016 numbers for each state, which took three times as long as the run.
    """
    sizes = []

    def spread(square: Any, newton: bool, of: Any = encounters._spread) -> Any:
        sizes.append(np.size(square))
        return of(square, newton)

    monkeypatch.setattr(encounters, "_spread", spread)
    rng = np.random.default_rng(1)
    bodies = sw.NBody(np.full(64, 1 / 64), force="newton", dim=3, softening=0.05)
    v, y = 0.1 * rng.normal(size=(64, 3)), rng.normal(size=(64, 3))
    _, text = integrated(bodies, "false_euler", v=v, y=y, dt=1e-4, steps=2500)
    assert text == ""
    pairs, states = 64 * 63 // 2, 2
    assert 0 < sum(sizes) <= states * pairs


def test_energies_that_are_looked_at_are_those_of_the_system() -> None:
    forces = "newton", "logarithmic", "printed"
    for n, force, batch in itertools.product((diagnostics.MIN_BODIES_BY_CORE, 65), forces, ((), (3,), (2, 2))):
        rng = np.random.default_rng(n)
        bodies = sw.NBody(rng.uniform(0.1, 1.0, size=n), force=force, dim=3, softening=0.05)
        v, y = rng.normal(size=(2, n, 3, *batch))
        run = sw.integrate(bodies, "false_euler", v=v, y=y, dt=1e-3, steps=1)
        np.testing.assert_array_equal(diagnostics._energies(run, bodies, v, y), bodies.energy(v, y), str((n, force, batch)))


def test_the_look_ahead_is_right_of_two_bodies() -> None:
    """Kepler's ellipse of semi-axis 1 and pericentre q: a step h turns it by a right angle there at h·w = 2q."""
    bodies, h = sw.NBody([1.0, 0.0], force="newton"), 0.01
    for share, expected in ((0.9, True), (1.1, False)):
        # w = √((2 − q)/q) at the pericentre, so h·w = 2q/share there for this q, found by fixed point.
        q = 0.02
        for _ in range(60):
            q = share * 0.5 * h * math.sqrt((2.0 - q) / q)
        far = 2.0 - q
        v, y = [[0.0, 0.0], [0.0, math.sqrt(q / far)]], [[0.0, 0.0], [far, 0.0]]
        assert encounters.may_meet(bodies, h, 7.0, v, y) == expected
        assert not encounters.may_meet(bodies, h, 0.1, v, y)  # it takes half a period


def test_runs_without_bodies_or_with_a_tolerance_are_refused() -> None:
    with pytest.raises(UnsupportedError, match=r"encounters: .* has no bodies that meet"):
        _ = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=3).encounters
    run = sw.integrate(PAIR, "merson", **FALL, tolerance=1e-6, at=[1.0])
    with pytest.raises(UnsupportedError, match="encounters: expected a run with fixed steps"):
        _ = run.encounters


def test_arrays_that_change_later_do_not_matter() -> None:
    v, y = FALL["v"].copy(), FALL["y"].copy()
    run, _ = integrated(PAIR, "leapfrog", v=v, y=y, dt=0.01, steps=300)
    expected = run.encounters
    v[:], y[:] = 7.0, 8.0
    assert run.encounters == expected


def test_bodies_that_others_pull_apart_are_not_looked_for(monkeypatch):
    """At the start of the figure-eight bodies 0 and 1 are at rest against each other: alone they would fall together.

    The third, half way between them, pulls each towards itself by m/r², r half of their distance: the two pulls differ by 2m/r²,
    where they pull each other together by 2/(2r)², a quarter. Looking for their encounter takes 20 times as long as the run.
    """
    scene = sw.scenes.figure_eight()
    v, y, masses = (np.asarray(each) for each in (scene.v, scene.y, scene.system.masses))
    assert np.array_equal(v[0], v[1])
    assert np.array_equal(y[0], -y[1])
    assert not y[2].any()
    assert (masses == 1.0).all()
    assert not encounters.may_meet(scene.system, 1e-3, 100.0, v.tolist(), y.tolist())
    two = sw.NBody(masses[:2], force="newton")
    assert encounters.may_meet(two, 1e-3, 100.0, v[:2].tolist(), y[:2].tolist())
    light = sw.NBody([1.0, 1.0, 0.24], force="newton")  # 0.24·2/r² is less than 2/(2r)² = 0.25·2/r²
    heavy = sw.NBody([1.0, 1.0, 0.26], force="newton")
    for bodies, expected in ((light, True), (heavy, False)):
        assert encounters.may_meet(bodies, 1e-3, 100.0, v.tolist(), y.tolist()) == expected
    runs = []
    advance = encounters.engine.advance
    monkeypatch.setattr(
        encounters.engine, "advance", lambda *arguments, **options: runs.append(1) or advance(*arguments, **options)
    )
    sw.integrate(scene.system, "leapfrog", v=scene.v, y=scene.y, dt=6.3e-4, steps=20_000)
    assert len(runs) == 1
