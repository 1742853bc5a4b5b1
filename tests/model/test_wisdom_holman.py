"""Wisdom and Holman's method: Kepler's motion to rounding or NaN, errors of the masses squared, REBOUND's beside it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.reference import corrector, kepler
from support.calls import assert_raises
from support.looped import looped
from support.mistakes import mistaken

#: The unit roundoff.
U = 2.0**-53

G = sw.orbits.gravity("au", "solar", "year")

#: Jupiter, Saturn, Uranus and Neptune, more or less.
MASSES = np.array([1.0, 1 / 1047.35, 1 / 3497.9, 1 / 22900, 1 / 19400])
ELEMENTS: dict[str, Any] = {
    "a": [5.2, 9.55, 19.2, 30.1],
    "e": [0.0485, 0.0555, 0.046, 0.009],
    "inclination": [0.02, 0.04, 0.013, 0.03],
    "node": [1.7, 1.9, 1.3, 2.3],
    "argument_of_periapsis": [4.7, 5.9, 1.7, 4.8],
    "mean_anomaly": [0.3, 5.0, 2.5, 4.5],
}

#: Twenty steps for each of Jupiter's years.
DT = 5.2**1.5 / 20.0


def planets(masses: Any = MASSES, **elements: Any) -> sw.orbits.Start:
    return sw.orbits.system(masses, G=G, **(ELEMENTS | elements))


def energy_error(bodies: sw.NBody, v: Any, y: Any) -> float:
    """The largest relative error of the energy of saved states, whose times come first."""
    energy = bodies.energy(np.moveaxis(v, 0, -1), np.moveaxis(y, 0, -1))
    return float(np.abs(energy / energy[0] - 1.0).max())


# ---- Kepler's motion


def follows_kepler(moved: Any) -> None:
    """Each change is that of the orbit, to rounding, or NaN; and it is there where it should be.

    Of orbits of all kinds from all places, over steps of up to a revolution and many times the time of the periapsis.
    """
    rng = np.random.default_rng(7)
    n = 4000
    for low, high, most_steps, at_least in (
        (0.0, 0.6, 0.2, 1.0),  # five steps a revolution
        (0.6, 0.9, 0.01, 0.999),
        (0.9, 1.1, 0.01, 0.9),
        (1.1, 4.0, 0.02, 0.98),
        (0.0, 4.0, 3.0, 0.0),
    ):
        e, mu = rng.uniform(low, high, n), rng.uniform(0.5, 2.0, n)
        a = np.abs(1.0 / (1.0 - e))  # the periapsis is at 1
        h = rng.uniform(0.0, most_steps, n) * 2.0 * math.pi * np.sqrt(a**3 / mu) * rng.choice([-1.0, 1.0], n)
        before = rng.uniform(-0.5, 0.5, n) * 2.0 * math.pi * np.sqrt(a**3 / mu)
        shape = {"periapsis": 1.0, "e": e, "argument_of_periapsis": rng.uniform(-3.0, 3.0, n), "time_of_periapsis": 0.0}
        v, y = sw.orbits.state(mu, t=before, **shape)
        true_v, true_y = sw.orbits.state(mu, t=before + h, **shape)
        with np.errstate(all="ignore"):
            dv, dy = moved(mu, h, v.T, y.T)
        finite = np.isfinite(dy).all(axis=1) & np.isfinite(dv).all(axis=1)
        assert finite.mean() >= at_least
        # Roundings of the times are as those of the places, and grow as the orbit shears them, by the revolutions in h.
        scale = np.sqrt((y * y).sum(axis=0)) + np.abs(h) * np.sqrt((v * v).sum(axis=0)) + 1.0
        off_y = np.sqrt(((dy.T + y - true_y) ** 2).sum(axis=0)) / scale
        off_v = np.sqrt(((dv.T + v - true_v) ** 2).sum(axis=0)) / (np.sqrt((true_v**2).sum(axis=0)) + np.sqrt((v**2).sum(axis=0)))
        sheared = 1.0 + scale * np.sqrt((v * v).sum(axis=0)) * a
        assert ((off_y < 1e3 * U * sheared) & (off_v < 1e3 * U * sheared**2))[finite].all()


def test_keplers_motion_is_exact_or_nan() -> None:
    follows_kepler(kepler.moved)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("+ zeta * g3)) * per", "+ zeta * g2)) * per"),
        ("range(3, 18, 2)", "range(4, 19, 2)"),
        ("g3 = (g3 + change * g2) + half * g1", "g3 = g3"),
        ("TERMS = (4, 6, 8)", "TERMS = (3, 4, 5)"),
        ("SMALL = 2.0**-36", "SMALL = 1.0"),
        ("MOST = 12.0", "MOST = 1e9"),
        ("(inverse * per)", "(inverse * inverse)"),
    ],
)
def test_a_mistake_in_keplers_motion_is_noticed(old: str, new: str) -> None:
    with pytest.raises(AssertionError):
        follows_kepler(mistaken(kepler, old, new).moved)


def test_two_bodies_move_exactly() -> None:
    """Ten revolutions by any step, back and forth."""
    bodies, v, y = sw.orbits.system([1.0, 0.3], a=1.0, e=0.5, mean_anomaly=1.0)
    period = 2.0 * math.pi / math.sqrt(1.3)
    for steps in (70, 1000):
        run = sw.integrate(bodies, "wisdom_holman", v=v, y=y, dt=10.0 * period / steps, steps=steps)
        # Roundings of each step shear the phase by those of all later ones.
        assert np.abs(run.y[-1] - y).max() < 100.0 * steps * U * math.sqrt(steps)
        back = sw.integrate(bodies, "wisdom_holman", v=run.v[-1], y=run.y[-1], dt=-10.0 * period / steps, steps=steps)
        assert np.abs(back.y[-1] - y).max() < 100.0 * steps * U * math.sqrt(steps)


def test_the_error_falls_with_the_masses_and_the_step() -> None:
    """As the first power of both in units of the star's, with a corrector as the second, if the step is short."""
    errors, dt = {}, DT / 2.0
    for share in (1.0, 0.25):
        bodies, v, y = planets(MASSES * np.r_[1.0, np.full(4, share)])
        run = sw.integrate(bodies, "wisdom_holman", v=v, y=y, dt=dt, steps=2000, every=7)
        start = sw.orbits.corrected(bodies, v, y, dt=dt)
        better = sw.integrate(bodies, "wisdom_holman", v=start[0], y=start[1], dt=dt, steps=2000, every=7)
        errors[share] = energy_error(bodies, run.v, run.y), energy_error(bodies, *sw.orbits.uncorrected(better))
        orbit = sw.orbits.elements(bodies, *sw.orbits.uncorrected(bodies, *start, dt=dt))
        assert np.abs(orbit.a - ELEMENTS["a"]).max() < 1e-11
    assert errors[1.0][0] < 1.5e-6
    assert errors[1.0][1] < 1e-9
    assert 3.0 < errors[1.0][0] / errors[0.25][0] < 5.5
    assert 10.0 < errors[1.0][1] / errors[0.25][1] < 24.0


def test_the_error_is_a_hundredth_of_leapfrogs() -> None:
    bodies, v, y = planets()
    runs = [sw.integrate(bodies, method, v=v, y=y, dt=DT, steps=2000, every=7) for method in ("leapfrog", "wisdom_holman")]
    leapfrog, wisdom_holman = (energy_error(bodies, run.v, run.y) for run in runs)
    assert wisdom_holman < leapfrog / 500.0


@looped("order", corrector.KICKS)
def test_a_corrector_has_its_order(order: int) -> None:
    """Σ 2·b·sinh(a·x) is half of ((x/2)·coth(x/2) − 1)/x up to that power of x, since each term is applied twice."""
    mp = pytest.importorskip("mpmath")
    with mp.workdps(60):

        def off(x: Any) -> Any:
            total = sum(2 * mp.mpf(b) * mp.sinh(mp.mpf(a) * x) for a, b in corrector.terms(order))
            return abs(total - ((x / 2) * mp.coth(x / 2) - 1) / x / 2)

        # At these x the next power is above the rounding of the coefficients to floats, which is 1e-16·x.
        slope = mp.log(off(mp.mpf(1.2)) / off(mp.mpf(1.0))) / mp.log(mp.mpf(1.2))
        assert order - 0.5 < slope < order + 1.2


def test_a_wrong_step_is_nan_and_says_why() -> None:
    """Not a step ends somewhere else without a word."""
    bodies, v, y = sw.orbits.system([1.0, 1e-3], a=1.0, e=0.99)
    why = "too long for Kepler's motion on an orbit there, so take shorter steps, or dop853"
    with pytest.warns(sw.DivergenceWarning, match=why):
        run = sw.integrate(bodies, "wisdom_holman", v=v, y=y, dt=1.0, steps=20)
    assert run.status == sw.Status.DIVERGED
    with pytest.raises(ArgumentError, match="dt: expected a step over some of which"):
        sw.orbits.corrected(bodies, v, y, dt=1.0)


def test_what_it_is_not_for_is_refused() -> None:
    bodies, v, y = planets()
    step: dict[str, Any] = {"v": v, "y": y, "dt": DT, "steps": 1}
    many, places = sw.NBody(np.ones(200), force="newton", dim=2), np.random.default_rng(1).normal(size=(200, 2))
    run, push = sw.integrate(bodies, "leapfrog", **step), sw.EnergyControl(0.1)
    motions, not_its = "Kepler motions of so many bodies", "expected a run by wisdom_holman"
    assert_raises(
        (lambda: sw.integrate(bodies, "wisdom_holman", **step, control=push), UnsupportedError, "carries v_half"),
        (lambda: sw.integrate(many, "wisdom_holman", **step | {"v": 0.0, "y": places}), UnsupportedError, motions),
        (lambda: sw.orbits.uncorrected(run), UnsupportedError, not_its),
        (lambda: sw.orbits.uncorrected(bodies, v, y, dt=DT, order=11), ArgumentError, "order: expected one of 3, 5, 7, got 11"),
    )


def test_without_kepler_motions_it_is_leapfrog() -> None:
    for system in (sw.Oscillator(), sw.NBody()):
        state = {"v": 0.3, "y": 1.0} if isinstance(system, sw.Oscillator) else {"v": 0.0, "y": np.arange(6.0).reshape(3, 2) ** 2}
        runs = [sw.integrate(system, method, **state, dt=0.01, steps=9, every=1) for method in ("leapfrog", "wisdom_holman")]
        assert np.array_equal(runs[0].y, runs[1].y)
        assert np.array_equal(runs[0].v, runs[1].v)


def test_errors_are_those_of_rebound() -> None:
    """WHFast's, whose drifts are at the ends: half without a corrector, and about the same with one."""
    rebound = pytest.importorskip("rebound")
    bodies, v, y = planets()
    for order, low, high in ((0, 1.5, 2.5), (3, 1.0, 2.0), (7, 1.0, 2.0)):
        simulation = rebound.Simulation()
        simulation.G = G
        for mass, place, velocity in zip(MASSES, y, v, strict=True):
            simulation.add(m=mass, **dict(zip("xyz", place, strict=True)), **dict(zip(("vx", "vy", "vz"), velocity, strict=True)))
        simulation.integrator, simulation.dt = "whfast", DT
        options = simulation.ri_whfast if hasattr(simulation, "ri_whfast") else simulation.integrator
        options.corrector, options.safe_mode = order, 0
        first, theirs = simulation.energy(), 0.0
        for _ in range(2000 // 7):
            simulation.steps(7)
            simulation.synchronize()
            theirs = max(theirs, abs(simulation.energy() / first - 1.0))
        start = sw.orbits.corrected(bodies, v, y, dt=DT, order=order) if order else (v, y)
        run = sw.integrate(bodies, "wisdom_holman", v=start[0], y=start[1], dt=DT, steps=2000, every=7)
        ours = energy_error(bodies, *(sw.orbits.uncorrected(run, order=order) if order else (run.v, run.y)))
        assert low < ours / theirs < high


# ---- close encounters


def pair(a: Any, inclination: Any = 0.0, masses: Any = (1.0, 1e-3, 1e-3)) -> sw.orbits.Start:
    """Two planets, the inner one at 5.2."""
    second = {"a": a, "e": 0.1, "inclination": inclination, "node": 0.0, "argument_of_periapsis": 1.0, "mean_anomaly": 2.0}
    first = {"a": 5.2, "e": 0.05, "inclination": 0.0, "node": 0.0, "argument_of_periapsis": 0.0, "mean_anomaly": 0.0}
    return sw.orbits.system(masses, G=G, **{name: [first[name], second[name]] for name in first})


def close(run: sw.Run, masses: Any) -> int:
    """The first saved state in which the planets are within three Hill radii and came a tenth of their distance in the step.

    By a formula of its own; −1 if there is none.
    """
    line = run.y[:, 2] - run.y[:, 1]
    apart, way = np.linalg.norm(line, axis=1)[1:], np.linalg.norm(np.diff(line, axis=0), axis=1)
    size = (np.linalg.norm(run.y[:, 1] - run.y[:, 0], axis=1) + np.linalg.norm(run.y[:, 2] - run.y[:, 0], axis=1)) / 2
    radius = (size * ((masses[1] + masses[2]) / (3.0 * masses[0])) ** (1 / 3))[1:]
    near = (apart < 3.0 * radius) & (way > 0.1 * apart)
    return int(np.argmax(near)) + 1 if near.any() else -1


@looped("masses", [(1.0, 1e-3, 1e-3), (1.0, 1e-3, 0.0), (1.0, 1e-6, 1e-3)])
def test_a_close_encounter_is_named(masses: Any) -> None:
    """Also of a planet and a test particle, from a run that saves its end alone, and by ``run.encounters``."""
    bodies, v, y = pair(5.6, masses=masses)
    arguments: dict[str, Any] = {"v": v, "y": y, "dt": DT / 4.0, "steps": 1500}
    with pytest.warns(sw.errors.AccuracyWarning, match="nearer than 3 Hill radii, and wisdom_holman does not follow") as heard:
        run = sw.integrate(bodies, "wisdom_holman", **arguments)
    (met,) = run.encounters
    assert f"bodies 1 and 2 came to {met.distance:.3g} of each other at step {met.step} " in str(heard[0].message)
    with pytest.warns(sw.errors.AccuracyWarning):
        every = sw.integrate(bodies, "wisdom_holman", **arguments, every=1)
    step = close(every, masses)
    assert step - 1 <= met.step <= step + 1  # between two states they may be nearer than in both
    assert met.distance <= np.linalg.norm(every.y[met.step, 2] - every.y[met.step, 1])
    assert met.bodies == (1, 2)


@pytest.mark.filterwarnings("error")
def test_what_is_no_encounter_is_not_named() -> None:
    """Orbits far apart; crossing distances on inclined orbits; massless bodies that pass each other; any of leapfrog."""
    for bodies, v, y in (pair(9.0), pair(5.6, inclination=1.5), pair(5.6, masses=(1.0, 0.0, 0.0))):
        run = sw.integrate(bodies, "wisdom_holman", v=v, y=y, dt=DT / 4.0, steps=300, every=1)
        assert not bodies.masses[1] or close(run, bodies.masses) == -1
        assert run.encounters == ()
    bodies, v, y = pair(5.6)
    assert sw.integrate(bodies, "leapfrog", v=v, y=y, dt=DT / 4.0, steps=1500).encounters == ()


def test_the_member_with_the_encounter_is_named() -> None:
    apart, near = pair(9.0), pair(5.6)
    v, y = (np.stack([one, other], axis=-1) for one, other in ((apart[1], near[1]), (apart[2], near[2])))
    with pytest.warns(sw.errors.AccuracyWarning, match=r"bodies 1 and 2 of member 1 came to"):
        run = sw.integrate(near[0], "wisdom_holman", v=v, y=y, dt=DT / 4.0, steps=1500)
    (met,) = run.encounters
    assert met.member == (1,)


@pytest.mark.filterwarnings("error")
def test_steps_that_are_short_beside_an_encounter_follow_it() -> None:
    bodies, v, y = pair(5.6)
    ends = []
    for finer in (16, 64):
        run = sw.integrate(bodies, "wisdom_holman", v=v, y=y, dt=DT / 4.0 / finer, steps=400 * finer)
        assert run.encounters == ()
        ends.append(run.y[-1])
    true = sw.integrate(bodies, "dop853", v=v, y=y, at=[400 * DT / 4.0], tolerance=1e-12).y[-1]
    assert np.abs(ends[1] - true).max() < np.abs(ends[0] - true).max() < 0.05
