"""Contact: no impact adds energy, and where the simpler ways do (§1, FACTS §5)."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, ShapeError, UnsupportedError
from support import contacts
from support.calls import assert_raises
from support.cases import assert_same
from support.contacts import LAG, PARABOLIC, G
from support.looped import looped
from support.ways import assert_equal_ways

METHODS = [m.name for m in sw.methods()]


@looped("method, restitution, gravity", itertools.product(METHODS, [1.0, 0.8, 0.3, 0.0], [True, False]))
def test_no_contact_adds_energy(method: str, restitution: float, gravity: bool) -> None:
    contacts.no_energy_added(method, restitution=restitution, gravity=gravity)


@looped("method, restitution", itertools.product(PARABOLIC, [1.0, 0.8, 0.5]))
def test_exactly_the_square_of_e_is_left(method: str, restitution: float) -> None:
    contacts.squares(method, restitution=restitution)


@pytest.mark.parametrize("check", ["bounces", "slides", "sticks", "reflects", "passes", "rolls", "slips"])
@looped("method", METHODS)
def test_it_holds(method: str, check: str) -> None:
    contacts.ALL[check](method)


@looped("method, seed", itertools.product(METHODS, range(3)))
def test_corners_and_spheres_add_no_energy(method: str, seed: int) -> None:
    contacts.corners(method, seed=seed)


def test_a_ceiling_adds_no_energy() -> None:
    """The field pulls away from the surface; Standard Euler gains ½·(h·g)² in the step of the impact, and may not keep it."""
    phase, kick = np.linspace(0.01, 1.0, 50)[:, np.newaxis], np.linspace(0.01, 2.0, 40)
    y = np.broadcast_to(-phase, (1, 1, 50, 40))
    for method in METHODS:
        ball = sw.Particles(gravity=-kick[np.newaxis, np.newaxis], floor=sw.Floor(normal=[-1.0]))
        run = sw.integrate(ball, method, v=1.0, y=y, dt=1.0, steps=1, every=1)
        energy = contacts.energies(run, kick)
        met = run.v[1, 0, 0] - (run.v[0, 0, 0] - kick) < -contacts.ROUNDING
        assert met.sum() > 300
        assert np.where(met, energy[1] - energy[0], -1.0).max() <= contacts.rounding(method) * (0.5 + kick.max())


# ---- the simpler ways


def kicked(method: str, phi: float) -> Any:
    """v² after a one-sided spring over v² before it, for all phases of contact, with ω = 1 and without gravity."""
    floor = sw.Floor(way="spring", omega=1.0)
    y = phi * np.linspace(0.0, 1.0, 2001)[np.newaxis, np.newaxis]
    run = sw.integrate(sw.Particles(gravity=0.0, floor=floor), method, v=-1.0, y=y, dt=phi, steps=60)
    return (run.v[-1] ** 2).ravel()


@looped(
    "phi, least, most, digits",
    [(0.1, 0.998, 1.002, 3), (0.5, 0.957, 1.045, 3), (1.0, 1.0, 1.0, 9), (1.5, 0.64, 1.56, 2), (1.9, 0.15, 6.8, 2)],
)
def test_a_spring_may_add_energy(phi: float, least: float, most: float, digits: int) -> None:
    """The bands of FACTS §5, in as many decimals as it gives."""
    half = 0.5 * 10.0**-digits
    for method in ("false_euler", "leapfrog"):
        square = kicked(method, phi)
        assert square.min() == pytest.approx(least, abs=half)
        assert square.max() == pytest.approx(most, abs=half if most < 2.0 else 0.05)


def test_a_spring_by_standard_euler_adds_a_lot() -> None:
    """At Φ = 1 contact lasts until v has grown fourfold: v² by 16 (FACTS §5)."""
    assert kicked("standard_euler", 1.0).max() == pytest.approx(16.0, rel=1e-3)


@looped("phi, height", [(0.5, 2.0), (1.5, 50.0)])
def test_a_ball_on_a_spring_rises_above_its_start(phi: float, height: float) -> None:
    """Dropped from 1 with h = 1/60 it gets higher with every hundred steps; with the way "safe" never above its start."""
    for floor, gains in ((sw.Floor(way="spring", omega=60.0 * phi), True), (sw.Floor(), False)):
        top = dropped(floor, "false_euler", 20_000).y[:, 0, 1].max()
        assert top > height if gains else top == 1.0


def dropped(floor: sw.Floor, method: str, steps: int = 600) -> sw.Run:
    return sw.integrate(sw.Particles(gravity=G, floor=floor), method, v=0.0, y=[[0.0, 1.0]], dt=1 / 60, steps=steps, every=1)


def test_flipping_keeps_what_the_method_keeps_in_flight() -> None:
    """½v² + g·y by leapfrog, exactly; ½v² + g·y − ½·h·g·v by False Euler in flight, which loses 2·h·g/u at each bounce."""
    for method, lag in (("leapfrog", 0.0), ("false_euler", -0.5)):
        run = dropped(sw.Floor(way="flip"), method)
        v, y = run.v[:, 0, 1], run.y[:, 0, 1]
        invariant = 0.5 * v * v + G * y + lag * run.dt * G * v
        change, met = np.diff(invariant), np.diff(v) > 0.0
        assert met.sum() > 5
        assert np.abs(change[~met]).max() <= contacts.ROUNDING * G
        # A flip turns v from −u to u, so the term lag·h·g·v changes by 2·lag·h·g·u, which is 4·lag·h·g/u of ½u².
        speed = v[1:][met]
        np.testing.assert_allclose(change[met], 2.0 * lag * run.dt * G * speed, rtol=0, atol=contacts.ROUNDING * G)
        np.testing.assert_allclose(change[met] / (0.5 * speed**2), 4.0 * lag * run.dt * G / speed, rtol=1e-9, atol=1e-12)


def test_mirroring_adds_energy() -> None:
    """y → −y with the flip lifts the point by what it was behind the floor, which nobody pays for."""
    v, y, h, energy = 0.0, 1.0, 1 / 60, []
    for _ in range(600):  # leapfrog
        y = y + h * v - 0.5 * h * h * G
        v = v - h * G
        if y < 0.0:
            v, y = -v, -y
        energy.append(0.5 * v * v + G * y)
    assert energy[-1] > 1.05 * G


def test_turning_alone_lets_a_ball_sink() -> None:
    """With e < 1 the ways "restitution" and "flip" know no rest: a point that turns below the floor falls on."""
    assert dropped(sw.Floor(restitution=0.5, way="restitution"), "leapfrog").y[-1, 0, 1] < -0.01
    assert dropped(sw.Floor(restitution=0.5), "leapfrog").y[-1, 0, 1] == 0.0


@looped("method", ["leapfrog", "rk4"])
def test_the_height_lasts(method: str) -> None:
    """A ball with e = 1 rises to its start for ever, by methods on the parabola; by Standard Euler not above what it keeps."""
    assert dropped(sw.Floor(), method, 20_000).energy[-1] == pytest.approx(G, rel=20_000 * contacts.ROUNDING)


def test_in_a_field_that_is_not_uniform_the_error_of_an_impact_is_of_second_order() -> None:
    """The mean acceleration of a step is taken for that along the way behind the surface: wrong by h, over a way of h."""
    changes = []
    for h in (0.02, 0.01, 0.005):
        worst = 0.0
        for start in 0.5 + h * np.linspace(0.0, 3.0, 40):
            bodies = sw.NBody([1.0, 0.0], floor=sw.Floor(offset=-0.25), force="logarithmic")
            y = np.array([[0.0, 5.0], [0.0, start]])
            run = sw.integrate(bodies, "rk4", v=[[0.0, 0.0], [0.0, -2.0]], y=y, dt=h, steps=int(1.0 / h), every=1)
            # The potential of the body without mass, ln r to the heavy one, which stays: it is attracted by nothing.
            energy = 0.5 * run.v[:, 1, 1] ** 2 + np.log(5.0 - run.y[:, 1, 1])
            worst = max(worst, float(np.abs(energy - energy[0]).max()))
        changes.append(worst)
    assert 3.0 < changes[0] / changes[1] < 6.0
    assert 3.0 < changes[1] / changes[2] < 6.0


# ---- one member, many members, large systems


@looped("method", ["leapfrog", "verlet", "rk4"])
def test_a_large_system_has_the_same_bits_in_every_way(method: str) -> None:
    rng = np.random.default_rng(70)
    v, y = rng.normal(size=(70, 2, 3)), rng.normal(size=(70, 2, 3))
    floor = [
        sw.Floor(restitution=0.9, friction=0.1, offset=-1.0),
        sw.Sphere((0.0, 0.0), 3.0, inside=True),
        sw.Floor(offset=-0.9, way="spring", omega=9.0),
    ]
    bodies, free = (sw.NBody(np.full(70, 1.0 / 70), force="newton", softening=0.1, floor=each) for each in (floor, None))
    start: dict[str, Any] = {"v": v, "y": y, "dt": 0.02, "steps": 40, "every": 5}
    run = assert_equal_ways(bodies, method, **start, ways=("by the reference", "alone", "in pieces", "in a world"))
    assert (np.abs(run.y - sw.integrate(free, method, **start).y) > 0.1).any()


@looped("dim, members", [(1, 3), (2, 1), (2, 9), (3, 3)])
def test_no_point_that_meets_a_surface_is_overlooked(dim: int, members: int) -> None:
    """A large system is stepped in rows, and looks which points may have met a surface, many at once; the reference each point.

    Steps are so long that many points pass through the ball, or from one wall to the other, within one.
    """
    n = 1003  # whole vectors of points, and a part of one
    rng = np.random.default_rng(10 * dim + members)
    v, y = rng.normal(0.0, 6.0, (n, dim, members)), rng.uniform(-1.0, 1.0, (n, dim, members))
    place, radius = rng.uniform(-0.2, 0.2, (dim, members)), rng.uniform(0.2, 0.4, members)
    normal = np.eye(dim)[0] + 0.1
    walls: list[Any] = [sw.Sphere(place, radius, restitution=0.9), sw.Floor(normal=normal, offset=-1.2, friction=0.1)]
    walls.append(sw.Sphere(np.zeros(dim), 2.0 + radius, inside=True, friction=0.2))
    for floor in (walls, walls[:1], walls[1:2], walls[2:]):
        points = sw.Particles(gravity=0.1 * np.ones(dim), floor=floor)
        run = assert_equal_ways(points, "leapfrog", v=v, y=y, dt=0.1, steps=12, every=3, threads=1, ways=("by the reference",))
        free = sw.integrate(sw.Particles(gravity=0.1 * np.ones(dim)), "leapfrog", v=v, y=y, dt=0.1, steps=12)
        met = (run.y[-1] != free.y[-1]).any(axis=1)
        assert met.mean() > 0.02


def test_a_point_that_is_not_finite_stays_so() -> None:
    floor = [sw.Floor(restitution=0.5, friction=0.1), sw.Sphere((0.0, 0.0), 9.0, inside=True)]
    for start in ([[np.inf, 1.0]], [[0.0, -1e308]]):
        options: dict[str, Any] = {"v": [[0.0, -1.7e308]], "y": np.nan_to_num(start), "dt": 10.0, "steps": 5, "every": 1}
        with pytest.warns(sw.DivergenceWarning):
            run = sw.integrate(sw.Particles(floor=floor), "rk4", **options)
        first = int(run.first_bad_step)
        assert first >= 0
        assert not np.isfinite(np.concatenate([run.v, run.y], axis=1)[first:].reshape(6 - first, -1)).all(axis=1).any()


@looped("method, n, sign", itertools.product(["merson", "fehlberg", "fehlberg_5", "dop853"], [1, 70], [1.0, -1.0]))
def test_a_spring_goes_with_adaptive_steps(method: str, n: int, sign: float) -> None:
    """The closed form: half a period of the spring, between two flights.

    The estimate of a step that meets or leaves the spring is of a smooth motion, and may be too small by a lot: errors of up to
    3e4 tolerances were seen here, with the smallest tolerance. docs/howto/contact.md says so.
    """
    omega, height, tolerance = 30.0, np.linspace(0.5, 1.5, n)[:, np.newaxis], 1e-9
    ball = sw.Particles(gravity=[0.0], floor=sw.Floor(way="spring", omega=omega, normal=[1.0], offset=0.0))
    speed, end = -2.0, 2.0
    ask: dict[str, Any] = {"v": sign * speed, "y": height, "tolerance": tolerance, "at": [0.5 * sign, end * sign]}
    run = sw.integrate(ball, method, **ask)
    if (method, n, sign) in (("merson", 70, -1.0), ("dop853", 1, 1.0)):
        assert_same(run, sw.integrate(ball, method, **ask, backend="numpy"))
    touched = height / -speed
    np.testing.assert_allclose(run.v[-1], -sign * speed, rtol=1e5 * tolerance)
    expected = (end - touched - np.pi / omega) * -speed
    np.testing.assert_allclose(run.y[-1], expected, rtol=1e5 * tolerance)


def test_a_ball_that_a_step_might_pass_needs_a_longest_step() -> None:
    """Without forces a step has no error, however long; a chord of 2·√(0.5² − 0.1²) is passed in half a unit of time."""
    ball = sw.Particles(gravity=[0.0, 0.0], floor=sw.Sphere((0.0, 0.0), 0.5, way="spring", omega=50.0))
    start: dict[str, Any] = {"v": [[2.0, 0.0]], "y": [[-3.0, 0.1]], "tolerance": 1e-8, "at": [4.0]}
    run = sw.integrate(ball, "dop853", **start, max_step=0.1)
    exact = sw.integrate(ball, "rk4", v=start["v"], y=start["y"], dt=1e-4, steps=40_000)
    np.testing.assert_allclose(run.y[-1], exact.y[-1], atol=1e-5)
    assert run.v[-1, 0, 0] < 0.0


def test_what_does_not_go_together_is_refused() -> None:
    ball, sprung = sw.Particles(floor=sw.Floor()), sw.Particles(floor=sw.Floor(way="spring", omega=9.0))
    round_a_ball = sw.Particles(floor=sw.Sphere((0.0, 0.0), 0.5, way="spring", omega=9.0))
    plane, step = sw.Particles(floor=sw.Floor(normal=(0.0, 1.0))), {"v": 0.0, "dt": 0.1, "steps": 1}
    paced: dict[str, Any] = {"v": 0.0, "y": [[1.0, 0.0]], "tolerance": 1e-6, "at": [1.0]}
    onto = sw.Projection()
    assert_raises(
        (lambda: sw.integrate(ball, "dop853", **paced), "tolerance: the estimated error of a step does not include a bounce"),
        (lambda: sw.integrate(sprung, "taylor", **paced), "tolerance: a series does not see that a point meets a surface within"),
        (lambda: sw.integrate(round_a_ball, "dop853", **paced), "a step may pass a ball between its stages.* give max_step="),
        (lambda: sw.integrate(sw.NBody(floor=sw.Floor()), "rk4", **step, y=np.eye(3, 2), control=onto), "control: .* meets surf"),
        kind=UnsupportedError,
    )
    assert_raises(
        (lambda: sw.Floor(restitution=1.5), "restitution: expected numbers from 0 to 1, got 1.5"),
        (lambda: sw.Floor(way="spring"), "omega: expected the frequency of the spring, got None"),
        (lambda: sw.Floor(omega=1.0), 'omega: works with way="spring" only'),
        (lambda: sw.Floor(friction=0.1, way="spring", omega=1.0), "friction: works with ways other than"),
        (lambda: sw.Floor(restitution=0.5, way="flip"), "restitution: works with"),
        (lambda: sw.Floor(normal=(0.0, 0.0)), "normal: expected a vector with a direction"),
        kind=ArgumentError,
    )
    mixed = [sw.Floor(normal=(0.0, 1.0)), sw.Sphere((0.0, 0.0, 0.0), 1.0)]
    assert_raises(
        (lambda: sw.Particles(floor=mixed), "floor 1 3: expected vectors of 2 components"),
        (lambda: sw.integrate(plane, "rk4", **step, y=np.zeros((1, 3))), r"y: expected shape \(n, 2, batch…\)"),
        (lambda: sw.NBody(dim=3, floor=mixed[0]), "floor 0: expected a vector of 3 components"),
        kind=ShapeError,
    )


def test_lags_are_those_of_the_methods() -> None:
    """y₁ = y₀ + h·(v₀ + v₁)/2 + h·c in a uniform field: what the way "safe" relies on, method by method."""
    for method in METHODS:
        run = sw.integrate(sw.Particles(gravity=1.0, dim=1), method, v=0.5, y=0.25, dt=1.0, steps=1, every=1)
        lag = np.diff(run.y[:, 0, 0])[0] - run.v[:, 0, 0].mean()
        assert lag == pytest.approx(LAG.get(method, 0.0), abs=1e-14)


# ---- each line of the way that contact is computed, wrong in one way: the checks of contacts.py notice it

#: What stands there, and what a mistake would make of it.
MISTAKES = [
    # where a point is
    ("dot(y, self.normal) - self.offset\n        slack", "dot(y0, self.normal) - self.offset\n        slack"),
    ("c = square - self.radius * self.radius", "c = square - self.radius"),
    ("self.outward([w / length for w in where])", "self.outward([f / np.sqrt(dot(from1, from1)) for f in from1])"),
    ("return [-each for each in vector] if self.is_inside else vector", "return vector"),
    ("return self.radius - length if self.is_inside else", "return self.radius + length if self.is_inside else"),
    ("near = hits | ", "near = "),
    ("bits.at_most(-(self.radius * (slack + slack)), c)", "bits.at_most(0.0, c)"),
    ("length = self.radius - distance if self.is_inside else self.radius + distance", "length = self.radius + 0.01"),
    # a bounce
    ("ahead = bits.where(bits.less(quarter, late), 0.5 * size, 0.0)", "ahead = 0.0 * size"),
    ("ahead = bits.where(bits.less(quarter, late), 0.5 * size, 0.0)", "ahead = 0.5 * size"),
    ("touches = place.near & bits.less(w, 0.0)\n", "touches = place.near\n"),
    ("square = (w * w + (pull + pull) * place.distance)", "square = (w * w)"),
    ("square = (w * w + (pull + pull) * place.distance)", "square = (w * w - (pull + pull) * place.distance)"),
    ("leaving = self.restitution * impact", "leaving = impact"),
    ("rests = bits.at_most(leaving, push) | bits.at_most(square, 0.0)", "rests = bits.at_most(square, 0.0)"),
    ("rests = bits.at_most(leaving, push) | bits.at_most(square, 0.0)", "rests = bits.at_most(leaving, 0.5 * push)"),
    ("since = (-(place.distance + place.distance)) / (impact - w)", "since = (-place.distance) / (impact - w)"),
    ("low = bits.where(", "low = place.before + 0.0 * bits.where("),
    ("height = since * (leaving - (0.5 * pull) * since)", "height = since * leaving"),
    ("height = since * (leaving - (0.5 * pull) * since)", "height = -self.restitution * place.distance"),
    ("rising = (leaving - pull * since) - ahead", "rising = leaving - ahead"),
    ("rising = (leaving - pull * since) - ahead", "rising = leaving - pull * since"),
    ("turn, lift = change.speed - speed, change.distance - place.distance", "turn, lift = change.speed - speed, change.distance"),
    ("turn, lift = change.speed - speed, change.distance", "turn, lift = -change.speed - speed, change.distance"),
    # friction
    ("self.friction * turn", "self.friction * change.speed"),
    ("remaining = bits.where(sticks, 0.0, 1.0 - grip / fast)", "remaining = 1.0 - grip / fast"),
    ("remaining = bits.where(sticks, 0.0, 1.0 - grip / fast)", "remaining = bits.where(sticks, 0.0, 1.0 + grip / fast)"),
    ("half = 0.5 * self.h", "half = self.h"),
    ("share = half * bits.where(bits.less(0.0, fast), fast / grip, 0.0)", "share = half"),
    ("shift = bits.where(sticks, way[i] - through * n, ", "shift = bits.where(sticks, 0.0 * n, "),
    ("new_y[i] = bits.where(change.rests, new_y[i] + shift, new_y[i])", "new_y[i] = new_y[i]"),
    # several surfaces
    ("            v, y = self.limit(step, touched, v, y)\n", "            pass\n"),
    ("return dot(v_from, v_from) + (work + work) / self.h", "return dot(v_from, v_from) + work / self.h"),
    ("most = bits.where(bits.less(most, raw), raw, most)\n        stays", "stays"),
    ("np.sqrt(most / square), 1.0)", "np.sqrt(square / most), 1.0)"),
    # what a method carries
    ("v0, v1 = steps.finish(s, choice, t, *before), steps.finish(s, choice, end, slot, y1)", "v0, v1 = before[0], slot"),
    ("renewed(slot, steps.start(s, choice, end, v, y))", "renewed(slot, v)"),
]

#: One method of each kind: carried, on the parabola, the two kinds of the Euler family.
KINDS = ("standard_euler", "false_euler", "leapfrog", "rk4")


def is_noticed() -> bool:
    """Whether a check notices, all of them by one method and then by the next: most mistakes are noticed by any method."""
    for method, check in itertools.product(KINDS, contacts.ALL.values()):
        if check is contacts.squares and method in contacts.LAG:
            continue
        try:
            check(method, backend="numpy")
        except AssertionError:
            return True
    return False


@pytest.mark.mutant
@pytest.mark.parametrize(("old", "new"), MISTAKES, ids=[str(i) for i in range(len(MISTAKES))])
@pytest.mark.filterwarnings("ignore")
def test_a_mistake_is_noticed(old: str, new: str, monkeypatch: Any) -> None:
    """The reference is changed in its text; that the core computes the same as the right one is shown by test_graphs.py."""
    contacts.set_mistaken(monkeypatch, old, new)
    assert is_noticed()


@pytest.mark.mutant
def test_nothing_is_noticed_without_a_mistake() -> None:
    assert not is_noticed()
