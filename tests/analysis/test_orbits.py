"""Orbits: Kepler's equation in 50 digits, elements to states and back, hierarchies beside closed forms and REBOUND."""

import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.orbits import hierarchy, kepler
from support.looped import looped
from support.mistakes import mistaken
from support.refusals import refused

#: The unit roundoff.
U = 2.0**-53

RNG = np.random.default_rng(5)

ECCENTRICITIES = [0.0, 1e-8, 0.1, 0.9, 0.999999, 1 - 1e-12, 1 - U, 1.0, 1 + 2 * U, 1 + 1e-12, 1.0001, 1.1, 2.0, 1e4]
MEANS = [*10.0 ** np.arange(-20.0, 0.4, 0.7), 3.14159, math.pi, 3.2, 6.2, 6.2831853, 6.3, 100.0, 1e6, 1e10]


def solves_kepler(solve: Any) -> bool:
    """Whether the anomalies are true to some roundings: ten of E, which is that of a sum of three terms in E by its slope."""
    mp = pytest.importorskip("mpmath")
    with mp.workdps(60):
        for e in ECCENTRICITIES:
            for mean in MEANS:
                x = float(solve(mean, e))
                big_e, big_m, true = mp.mpf(e), mp.mpf(mean), mp.mpf(x)
                for _ in range(8):
                    if e < 1.0:
                        value, slope = true - big_e * mp.sin(true) - big_m, 1 - big_e * mp.cos(true)
                    elif e > 1.0:
                        value, slope = big_e * mp.sinh(true) - true - big_m, big_e * mp.cosh(true) - 1
                    else:
                        value, slope = true + true**3 / 3 - big_m, 1 + true**2
                    true -= value / slope
                if abs(value) > mp.mpf(10) ** -40 * big_m or not abs(x - true) <= 10 * U * abs(true):
                    return False
    return True


def test_keplers_equation_is_solved_to_rounding() -> None:
    assert solves_kepler(sw.orbits.eccentric_anomaly)
    e = np.array(ECCENTRICITIES)
    assert np.array_equal(sw.orbits.eccentric_anomaly(-0.3, e), -sw.orbits.eccentric_anomaly(0.3, e))
    assert not sw.orbits.eccentric_anomaly(0.0, e).any()
    turned = sw.orbits.eccentric_anomaly(0.3 + 2.0 * math.pi * np.arange(-3, 4), 0.5)
    # The mean anomalies are rounded to 4 ulp at 6π, which the slope 1/(1 − e) doubles.
    assert np.abs(turned - (sw.orbits.eccentric_anomaly(0.3, 0.5) + 2.0 * math.pi * np.arange(-3, 4))).max() < 64 * U


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("(1.0 - e) * x + e * short_of_sine(x) - wanted", "x - e * f.sin(x) - wanted"),
        ("(e - 1.0) * x + e * beyond_sinh(x) - wanted", "(e - 1.0) * x + e * beyond_sinh(x) - 1.0001 * wanted"),
        ("- turns * TURN_REST", "+ turns * TURN_REST"),
        ("1.5 * np.abs(mean)", "np.abs(mean)"),
        ("range(3, 24, 2)", "range(3, 16, 2)"),
    ],
)
def test_a_mistake_in_keplers_equation_is_noticed(old: str, new: str) -> None:
    wrong = mistaken(kepler, old, new)
    assert not solves_kepler(wrong.eccentric_anomaly)


def apart(a: Any, b: Any) -> float:
    """The largest difference of two angles."""
    return float(np.abs(np.remainder(a - b + math.pi, 2.0 * math.pi) - math.pi).max())


@looped("between", [(0.0, 1e-3), (0.0, 0.99), (0.99, 1 - 1e-9), (1 + 1e-9, 1.01), (1.01, 5.0)])
def test_elements_return_through_states(between: tuple[float, float]) -> None:
    n = 2000
    e, q, mu = RNG.uniform(*between, n), RNG.uniform(0.1, 3.0, n), RNG.uniform(0.1, 50.0, n)
    inclination, node, argument = RNG.uniform(0.01, 3.1, n), RNG.uniform(-3.1, 3.1, n), RNG.uniform(-3.1, 3.1, n)
    true = RNG.uniform(-1.0, 1.0, n) * np.where(e < 1.0, 3.1, 0.95 * np.arccos(-1.0 / np.maximum(e, 1.0)))
    plane = {"inclination": inclination, "node": node, "argument_of_periapsis": argument}
    v, y = sw.orbits.state(mu, periapsis=q, e=e, true_anomaly=true, **plane)
    orbit = sw.orbits.of_state(mu, v, y)
    # Some tens of roundings; the direction of the periapsis and the anomaly divide by e, the node by sin 0.01.
    assert np.abs(orbit.e - e).max() < 100 * U
    assert np.abs(orbit.periapsis / q - 1.0).max() < 100 * U
    assert apart(orbit.inclination, inclination) < 100 * U
    assert apart(orbit.node, node) < 100 * U / math.sin(0.01)
    assert apart(orbit.true_longitude, node + argument + true) < 200 * U / math.sin(0.01)
    assert (np.abs(orbit.true_anomaly - true) * e).max() < 1000 * U
    names = ("periapsis", "e", "true_anomaly", *plane)
    again = sw.orbits.state(mu, **{name: getattr(orbit, name) for name in names})
    for back, block in zip(again, (v, y), strict=True):
        assert (np.abs(back - block).max(axis=0) / np.abs(block).max(axis=0)).max() < 2000 * U


@looped("e", [0.0, 0.3, 0.999, 1.0, 1.001, 2.0])
def test_anomalies_and_sizes_are_of_one_orbit(e: float) -> None:
    """Each way to say where the body is gives the same state; energy and angular momentum are those of the closed forms."""
    mu, q = 2.0, 0.7
    v, y = sw.orbits.state(mu, periapsis=q, e=e, true_anomaly=1.1, argument_of_periapsis=0.4)
    orbit = sw.orbits.of_state(mu, v, y, t=5.0)
    if e >= 1.0:  # the mean anomaly is no angle: far out the longitude is more than a turn
        far = sw.orbits.of_state(mu, *sw.orbits.state(mu, periapsis=q, e=e, mean_anomaly=40.0, argument_of_periapsis=0.4))
        assert abs(far.mean_longitude - 40.4) < 1e-8
    assert orbit.apoapsis == (pytest.approx(q * (1.0 + e) / (1.0 - e), rel=1e-10) if e < 1.0 else math.inf)
    ways = {
        "mean_anomaly": orbit.mean_anomaly,
        "eccentric_anomaly": orbit.eccentric_anomaly,
        "true_longitude": orbit.true_longitude,
        "mean_longitude": orbit.mean_longitude,
        "time_of_periapsis": orbit.time_of_periapsis,
    }
    for name, value in ways.items():
        if name == "mean_longitude" and abs(e - 1.0) < 0.01:
            continue  # the mean anomaly is so small there that a sum with another angle loses it
        shape = {each: getattr(orbit, each) for each in ("periapsis", "e", "argument_of_periapsis")}
        again = sw.orbits.state(mu, **shape, t=5.0, **{name: value})
        assert np.abs(np.array(again) - np.array([v, y])).max() < 1e-13, name
    if e != 1.0:
        again = sw.orbits.state(mu, a=q / (1.0 - e), e=e, true_anomaly=1.1, argument_of_periapsis=0.4)
        assert np.abs(np.array(again) - np.array([v, y])).max() < 1e-13
        assert abs(0.5 * (v @ v) - mu / math.hypot(*y) + 0.5 * mu * (1.0 - e) / q) < 1e-14
    assert abs(y[0] * v[1] - y[1] * v[0] - math.sqrt(mu * q * (1.0 + e))) < 1e-14
    assert abs(math.hypot(*y) - q * (1.0 + e) / (1.0 + e * math.cos(1.1))) < 1e-14


def test_a_run_is_at_the_place_that_the_anomaly_says() -> None:
    """Kepler's third law and equation, by a run of two bodies to 1e-13: an ellipse, a parabola and a hyperbola."""
    for e in (0.6, 1.0, 1.4):
        bodies, v, y = sw.orbits.system([1.0, 0.2], periapsis=0.8, e=e, argument_of_periapsis=0.3, time_of_periapsis=1.5, G=3.0)
        at = np.linspace(0.0, 4.0, 9)
        run = sw.integrate(bodies, "dop853", v=v, y=y, tolerance=1e-13, at=at)
        orbit = sw.orbits.elements(run)
        period = orbit.period[0, 0]
        off = orbit.time_of_periapsis[:, 0] - 1.5
        off = off - np.rint(off / period) * period if math.isfinite(period) else off
        assert np.abs(off).max() < 1e-11
        assert np.abs(orbit.periapsis - 0.8).max() < 1e-11
        assert np.abs(orbit.argument_of_periapsis - 0.3).max() < 1e-11
        _, place = sw.orbits.state(3.6, periapsis=0.8, e=e, argument_of_periapsis=0.3, time_of_periapsis=1.5, t=at)
        assert np.abs(run.y[:, 1] - run.y[:, 0] - place.T).max() < 1e-11


def test_the_year_has_365_days() -> None:
    """Kepler's third law in the units of astronomers: Gauss' year of a body without mass, 365.2568983 days at 1 au."""
    G = sw.orbits.gravity("au", "solar", "day")
    orbit = sw.orbits.of_state(G, v=[0.0, math.sqrt(G)], y=[1.0, 0.0])
    assert abs(float(orbit.period) - 365.2568983) < 2e-7  # the nominal G·m of the sun differs from Gauss' in the tenth digit
    assert sw.orbits.gravity("m", "kg", "s") == 6.67430e-11
    seconds, metres = 365.25 * 86400.0, 1.495978707e11
    assert abs(sw.orbits.gravity("au", "solar", "year") / (1.3271244e20 * seconds**2 / metres**3) - 1.0) < 4 * U


def test_what_a_circle_a_level_orbit_and_a_fall_count_from() -> None:
    v, y = sw.orbits.state(1.0, a=1.0, inclination=0.5, node=0.7, true_anomaly=0.2)
    circle = sw.orbits.of_state(1.0, v, y)
    assert circle.argument_of_periapsis == 0.0
    assert abs(circle.true_anomaly - 0.2) < 20 * U
    for inclination in (0.0, math.pi):
        v, y = sw.orbits.state(1.0, a=1.0, e=0.5, inclination=inclination, argument_of_periapsis=0.3, true_anomaly=0.2)
        level = sw.orbits.of_state(1.0, v, y)
        assert (level.node, level.inclination) == (0.0, inclination)
        assert abs(level.argument_of_periapsis - 0.3) < 40 * U
        flat = sw.orbits.of_state(1.0, v[:2], y[:2])
        assert flat == level
    fall = sw.orbits.of_state(1.0, v=[1.0, 0.0], y=[1.0, 0.0])
    assert (fall.e, fall.periapsis, fall.a) == (1.0, 0.0, 1.0)
    assert np.isnan([fall.inclination, fall.node, fall.argument_of_periapsis, fall.true_anomaly, fall.mean_anomaly]).all()


def test_jacobis_coordinates_and_back() -> None:
    masses = RNG.uniform(0.0, 1.0, (5, 7))
    block = RNG.normal(size=(5, 3, 7))
    relative = sw.orbits.jacobi(masses, block)
    for k in range(1, 5):
        centre = (masses[:k, np.newaxis] * block[:k]).sum(axis=0) / masses[:k].sum(axis=0)
        assert np.abs(relative[k] - (block[k] - centre)).max() < 20 * U * 4
    whole = (masses[:, np.newaxis] * block).sum(axis=0) / masses.sum(axis=0)
    assert np.abs(relative[0] - whole).max() < 80 * U
    assert np.abs(sw.orbits.inertial(masses, relative) - block).max() < 80 * U


@looped("around", ["jacobi", "astrocentric", [0, 1, [0, 1]]])
def test_a_system_has_the_elements_that_it_was_made_of(around: Any) -> None:
    """In a batch of masses and sizes; its centre of mass rests at the origin."""
    masses = np.array([1.0, 1e-2, 1e-4, 0.0])[:, np.newaxis] * np.array([1.0, 2.0])
    asked = {
        "a": np.array([[1.0, 1.5], [0.01, 0.02], [5.0, 7.0]]),
        "e": [0.1, 0.3, 0.6],
        "inclination": [0.1, 0.2, 2.0],
        "node": 0.4,
        "longitude_of_periapsis": [0.5, 1.0, -2.0],
        "mean_longitude": [2.0, 0.1, 0.7],
    }
    bodies, v, y = sw.orbits.system(masses, around=around, G=2.0, **asked)
    assert v.shape == y.shape == (4, 3, 2)
    assert np.abs((masses[:, np.newaxis] * v).sum(axis=0)).max() < 1e-16 * 50
    assert np.abs((masses[:, np.newaxis] * y).sum(axis=0)).max() < 1e-16 * 50
    orbit = sw.orbits.elements(bodies, v, y, around=around)
    for name, value in asked.items():
        wanted = np.broadcast_to(np.reshape(value, (-1, 1)) if np.ndim(value) < 2 else value, (3, 2))
        got = getattr(orbit, name)
        # The moon's orbit is a hundredth of the distances from which it is computed.
        assert np.abs(got - wanted).max() < 1e-12, name
    run = sw.integrate(bodies, "rk4", v=v, y=y, dt=1e-4, steps=4, every=2)
    assert sw.orbits.elements(run, around=around).a.shape == (3, 3, 2)
    assert np.array_equal(sw.orbits.elements(run, around=around).a[0], orbit.a)


def test_elements_of_members_that_diverged_are_nan() -> None:
    bodies, v, y = sw.orbits.system([1.0, 0.1], a=1.0)
    v, y = np.stack([v, 1e200 * v], -1), np.stack([y, y], -1)
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(bodies, "rk4", v=v, y=y, dt=1e200, steps=2, every=1)
    orbit = sw.orbits.elements(run)
    assert orbit.a.shape == (3, 1, 2)
    assert np.isfinite(orbit.a[0, 0, 0])
    assert np.isnan(orbit.a[-1]).all()


def test_the_states_are_those_of_rebound() -> None:
    rebound = pytest.importorskip("rebound")
    simulation = rebound.Simulation()
    simulation.G = 1.5
    simulation.add(m=1.0)
    planets = [
        {"m": 1e-3, "a": 1.0, "e": 0.1, "inc": 0.3, "Omega": 0.5, "omega": 0.7, "M": 1.0},
        {"m": 5e-2, "a": 2.5, "e": 0.5, "inc": 1.2, "Omega": -1.0, "omega": 2.0, "M": -2.0},
        {"m": 0.0, "a": -4.0, "e": 1.5, "inc": 0.1, "Omega": 2.0, "omega": 0.1, "M": 0.3},
    ]
    for planet in planets:
        simulation.add(**planet)
    simulation.move_to_com()
    names = {"a": "a", "e": "e", "inclination": "inc", "node": "Omega", "argument_of_periapsis": "omega", "mean_anomaly": "M"}
    elements = {name: [planet[theirs] for planet in planets] for name, theirs in names.items()}
    bodies, v, y = sw.orbits.system([1.0, *(planet["m"] for planet in planets)], G=1.5, **elements)
    for i, particle in enumerate(simulation.particles):
        assert np.abs(y[i] - particle.xyz).max() < 1e-13
        assert np.abs(v[i] - particle.vxyz).max() < 1e-13
    orbits, ours = simulation.orbits(), sw.orbits.elements(bodies, v, y)
    for i, theirs in enumerate(orbits):
        for name, of_theirs in (names | {"period": "P", "mean_motion": "n", "true_anomaly": "f"}).items():
            wanted = getattr(theirs, of_theirs)
            if name == "period" and theirs.e > 1.0:
                continue  # REBOUND says minus the period of an ellipse of that size
            if name == "mean_motion":
                wanted = abs(wanted)
            off = getattr(ours, name)[i] - wanted
            off = off if name in ("a", "e", "period", "mean_motion") else (off + math.pi) % (2.0 * math.pi) - math.pi
            assert abs(off) < 1e-12, name


WRONG: list[tuple[dict[str, Any], str]] = [
    ({}, "the size of an orbit: expected one of a, period, periapsis, got none"),
    ({"a": 1.0, "period": 1.0}, "got a and period"),
    ({"a": 1.0, "e": 1.0}, "a: a parabola, e = 1, has no semi-major axis; give periapsis"),
    ({"a": 1.0, "e": 1.5}, "got a = 1 with e = 1.5"),
    ({"a": -1.0, "e": 0.5}, "got a = -1 with e = 0.5"),
    ({"a": 1.0, "e": -0.1}, "e: expected an eccentricity of zero or more, got -0.1"),
    ({"period": 1.0, "e": 1.2}, "period: expected an ellipse"),
    ({"a": -1.0, "e": 2.0, "true_anomaly": 2.2}, "true_anomaly: expected a true anomaly at which the orbit has a place"),
    ({"periapsis": 1.0, "e": 1.0, "true_anomaly": math.pi}, "true_anomaly: expected"),
    ({"a": 1.0, "mean_anomaly": 1.0, "true_anomaly": 1.0}, "the place on an orbit: expected at most one of"),
    ({"a": 1.0, "argument_of_periapsis": 1.0, "longitude_of_periapsis": 1.0}, "the direction of the periapsis: expected at most"),
    ({"a": 1.0, "inclination": 4.0}, "inclination: expected angles of 0 to π in rad, got 4"),
    ({"a": 1.0, "inclination": 1.0, "dim": 2}, "inclination: expected 0 or π in the plane"),
    ({"a": [1.0, 2.0]}, "a: expected one number, or one for each of the 1 orbiting bodies"),
    ({"a": 1.0, "around": [1]}, r"around\[0\]: expected 0 or more, up to 0, got 1"),
    ({"a": 1.0, "around": "jacoby"}, "did you mean 'jacobi'"),
    ({"a": 1.0, "mean_anomaly": 1e15}, "mean_anomaly: expected an angle of at most"),
    ({"a": -1.0, "e": 2.0, "eccentric_anomaly": 400.0}, "eccentric_anomaly: expected at most 350"),
]


@looped("elements, message", WRONG)
def test_elements_that_are_no_orbit_are_refused(elements: dict[str, Any], message: str) -> None:
    refused(sw.errors.ArgumentError, message, sw.orbits.system, [1.0, 0.1], **elements)


def test_bodies_that_have_no_orbits_are_refused() -> None:
    with pytest.raises(sw.errors.UnsupportedError, match="Newton's force"):
        sw.orbits.elements(sw.NBody([1.0, 1.0]), np.zeros((2, 2)), np.ones((2, 2)))
    refused(sw.errors.DTypeError, "expected a run of NBody", sw.orbits.elements, sw.Oscillator(), 0.0, 1.0)
    refused(sw.errors.ArgumentError, "both have none: body 1", sw.orbits.system, [0.0, 0.0, 1.0], a=[1.0, 2.0])
    with pytest.raises(sw.errors.ArgumentError, match="masses: expected the first body to have a mass"):
        sw.orbits.jacobi([0.0, 1.0], np.ones((2, 2)))
    refused(sw.errors.ArgumentError, "y: expected a place other than", sw.orbits.of_state, 1.0, [0.0, 1.0], [0.0, 0.0])


def test_a_thousand_bodies_take_a_thousand_centres(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jacobi's centre of mass moves on by each body; a sum over all before it took 15 s for 3000."""
    a = np.linspace(1.0, 5.0, 1000)
    monkeypatch.setattr(hierarchy, "_centre", None)  # which sums
    for masses in (np.r_[1.0, 1e-3, np.zeros(999)], np.r_[1.0, np.full(1000, 1e-5)]):
        bodies, v, y = sw.orbits.system(masses, a=a, e=0.05)
        np.testing.assert_allclose(sw.orbits.elements(bodies, v, y).a, a, rtol=1e-13)
        np.testing.assert_allclose(sw.orbits.inertial(masses, sw.orbits.jacobi(masses, y)), y, atol=1e-13)
        assert np.abs(masses @ y).max() < 1e-13
    light = sw.orbits.system([1.0, 0.0, 0.0], a=[1.0, 2.0]).y
    assert light[0].tolist() == [0.0, 0.0]  # what has no mass moves no centre, to the bit
