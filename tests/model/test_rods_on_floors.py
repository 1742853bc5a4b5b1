"""Rods on floors and spheres: closed forms, energy over a dense grid, rest, large systems, mistakes that are noticed."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, ShapeError, UnsupportedError
from stepwell.reference import joined, rod_contact
from support import rod_contacts
from support.calls import assert_raises
from support.families import family
from support.looped import looped
from support.mistakes import mistaken
from support.rod_contacts import METHODS, RESETTING, ROUNDING, G, dumb_bell, tilted
from support.ways import assert_equal_ways

KEPT = {"free": None, "control": sw.LengthControl(0.5), "resetting": RESETTING}


@pytest.mark.parametrize("check", rod_contacts.ALL)
@looped("method", METHODS)
def test_it_holds(method: str, check: str) -> None:
    rod_contacts.ALL[check](method)


#: Each method with two of the controls and frictions, and Runge-Kutta 4 with all.
ALL_KEPT = list(itertools.product(KEPT.values(), [None, 0.4]))
TURNS = itertools.chain(
    zip(METHODS, itertools.cycle(ALL_KEPT), strict=False),
    zip(METHODS, itertools.cycle(ALL_KEPT[::-1]), strict=False),
    [("rk4", kept) for kept in ALL_KEPT],
)


@looped("method, kept", TURNS, long=itertools.product(METHODS, ALL_KEPT))
def test_no_contact_adds_energy(method: str, kept: tuple[Any, float | None]) -> None:
    control, friction = kept
    rod_contacts.adds_no_energy(method, control=control, friction=friction)


@pytest.mark.parametrize("method", family(METHODS, lambda method: method in ("standard_euler", "rk4", "linearly_implicit_euler")))
def test_bowls_and_balls_add_no_energy(method: str) -> None:
    """Over 300 steps in which points slide, stick and bounce, in a plane and in space; a contact of two points among them."""
    rng = np.random.default_rng(2)
    for dim, control in itertools.product((2, 3), KEPT.values()):
        y = rng.normal(0.0, 0.2, (3, dim, 40))
        apart = y[1:] - y[:-1]
        y[1] = y[0] + apart[0] / np.sqrt((apart[0] ** 2).sum(axis=0))
        y[2] = y[1] + 0.5 * apart[1] / np.sqrt((apart[1] ** 2).sum(axis=0))
        at = np.zeros(dim)
        floor = [sw.Sphere(at, 2.0, inside=True, restitution=0.6, friction=0.3), sw.Sphere(at - 1.2, 0.4, restitution=0.8)]
        options: dict[str, Any] = {"dt": 0.01, "control": control}
        v = np.broadcast_to(rng.normal(0.0, 1.0, (1, dim, 40)), y.shape)  # as one body
        make = [sw.Rods([1.0, 2.0, 0.5], [(0, 1), (1, 2)], [1.0, 0.5], gravity=G, dim=dim, floor=each) for each in (floor, None)]
        run = sw.integrate(make[0], method, v=v, y=y, steps=300, every=1, **options)
        each = {"v": np.moveaxis(run.v[:-1], 0, -1), "y": np.moveaxis(run.y[:-1], 0, -1)}
        bare = sw.integrate(make[1], method, **each, steps=1, **options)
        touched = (np.moveaxis(bare.v[-1], -1, 0) != run.v[1:]).any(axis=(1, 2))
        most = np.maximum(run.energy[:-1], np.moveaxis(bare.energy[-1], -1, 0))
        assert touched.sum() > 300
        assert np.where(touched, run.energy[1:] - most, -1.0).max() <= ROUNDING * (3.5 * G * 2.0 + (run.v**2).max())


def test_the_loss_of_an_elastic_impact_is_of_second_order() -> None:
    """The rod turns by at most h·θ̇ from an impact to the end of its step; velocity along it, (h·θ̇)² of the energy, is lost."""
    for h in (1 / 60, 1 / 240, 1 / 960):
        phase = np.linspace(0.02, 1.0, 50)
        v = np.broadcast_to(np.array([[0.0], [-3.0]]), (2, 2, 50))
        y = tilted(np.full(50, 0.5), 3.0 * phase * h)
        bell = dumb_bell(floor=sw.Floor())
        run = sw.integrate(bell, "rk4", v=v, y=y, dt=h, steps=4, every=1, control=RESETTING)
        rate = run.v[-1, 1] - run.v[-1, 0]
        turning = np.sqrt((rate * rate).sum(axis=0)).max()
        lost = run.energy[0] - run.energy[-1]
        assert turning > 4.0
        assert lost.min() >= -ROUNDING * run.energy.max()
        assert lost.max() <= (h * turning) ** 2 * run.energy.max()


@looped("method, order", [("false_euler", 1), ("standard_heun", 3), ("rk4", 4), ("dop853", 4)])
def test_an_end_that_slides_on_a_smooth_floor_leaves_the_order(method: str, order: int) -> None:
    """Up to 4: the energy that a toppling dumb-bell loses; Heun's is wrong by one order less than its places."""
    # Higher terms are smaller by h·θ̇, below 2 % here, and bend the exponent by less than twice that.
    lost = []
    for h in (1 / 240, 1 / 480):
        start: dict[str, Any] = {"v": 0.0, "y": tilted(0.3), "dt": h, "steps": round(0.5 / h), "every": 1}
        run = sw.integrate(dumb_bell(floor=sw.Floor(restitution=0.0)), method, **start, control=RESETTING)
        lost.append(np.ptp(run.energy))
    assert np.log2(lost[0] / lost[1]) == pytest.approx(order, rel=0.05)


def test_newtons_law_with_friction_would_add_energy() -> None:
    """Kane's paradox, with e = 1 and a rod at 45° that sticks: without the limit the energy would grow; with it, it stays."""
    mu, h = 2.0, 1e-7
    v0 = np.array([[0.7, -1.0], [0.7, -1.0]])
    bell = dumb_bell((1.0, 2.0), gravity=0.0, floor=sw.Floor(restitution=1.0, friction=mu))
    run = sw.integrate(bell, "rk4", v=v0, y=tilted(-0.25 * np.pi, 0.5 * h), dt=h, steps=1, every=1, control=RESETTING)
    assert run.energy[-1] <= run.energy[0] * (1.0 + ROUNDING)


def test_rods_apart_do_not_share_energy() -> None:
    """Two dumb-bells in one system are those of two systems, to the last bit."""
    y = np.concatenate([tilted(0.4, 0.1), tilted(1.1, 0.3) + np.array([3.0, 0.0])])
    arguments: dict[str, Any] = {"v": 0.0, "dt": 1 / 120, "steps": 150, "every": 1, "control": RESETTING}
    floor = sw.Floor(restitution=0.8, friction=0.3)
    both = sw.integrate(sw.Rods(np.ones(4), [(0, 1), (2, 3)], 1.0, gravity=G, floor=floor), "rk4", y=y, **arguments)
    for part in (slice(0, 2), slice(2, 4)):
        one = sw.integrate(dumb_bell(floor=floor), "rk4", y=y[part], **arguments)
        assert np.array_equal(both.y[:, part], one.y)


def test_one_rod_is_the_pendulum() -> None:
    floor = [sw.Floor(restitution=0.7, friction=0.2, normal=(1.0, 0.2, 0.0)), sw.Sphere((0.0, 0.5, -1.0), 0.3, restitution=0.5)]
    arguments: dict[str, Any] = {"dt": 0.01, "steps": 200, "every": 1}
    v, y = np.array([-0.5, 0.4, 0.0]), np.array([0.8, 0.0, -0.6])
    one = sw.integrate(sw.Pendulum3D(1.0, G, floor=floor), "rk4", v=v, y=y, **arguments)
    rod = sw.integrate(sw.Rods([1.0], [((0.0, 0.0, 0.0), 0)], 1.0, gravity=G, floor=floor), "rk4", v=[v], y=[y], **arguments)
    assert np.abs(rod.y[:, 0] - one.y).max() < 1e-9
    assert (np.abs(np.diff(one.v, axis=0)).max(axis=1) > 0.5).sum() >= 2


def rope(n: int, dim: int) -> tuple[sw.Rods, Any]:
    """A chain above a rough floor and a ball."""
    y = np.zeros((n, dim))
    y[:, 0], y[:, -1] = 0.5 * np.arange(n), 1.0
    y[:, 0] += 0.05 * np.sin(np.arange(n))
    lengths = np.sqrt((np.diff(y, axis=0) ** 2).sum(axis=1))
    ball = np.zeros(dim)
    ball[0] = 1.2
    floor = [sw.Floor(restitution=0.3, friction=0.4), sw.Sphere(ball, 0.5, restitution=0.3)]
    return sw.Rods(np.ones(n), [(i, i + 1) for i in range(n - 1)], lengths, gravity=G, floor=floor), y


@looped("method", ["false_euler", "rk4"])
def test_a_large_system_has_the_same_bits_in_every_way(method: str) -> None:
    """Seven points in space with friction are one, resolved member by member."""
    rods, y = rope(7, 3)
    v = np.random.default_rng(7).normal(0.0, 0.1, (3, 5)) + np.zeros((7, 1, 1))
    options: dict[str, Any] = {"dt": 1 / 60, "steps": 30, "every": 10, "control": RESETTING}
    ways = ("by the reference", "alone", "in company", "in pieces", "in a world")
    assert_equal_ways(rods, method, v=v, y=y[..., np.newaxis] + np.zeros(5), **options, ways=ways)


def test_a_rope_falls_on_a_ball_and_a_floor_and_rests() -> None:
    rods, y = rope(7, 2)
    run = sw.integrate(rods, "rk4", v=0.0, y=y, dt=1 / 120, steps=1200, every=10, control=RESETTING)
    assert np.abs(run.v[-1]).max() <= 1e-6
    assert run.y[-1, :, 1].min() >= -1e-9
    assert (np.diff(run.energy) <= ROUNDING * run.energy[0]).all()


def test_a_state_that_is_not_finite_stays_so() -> None:
    bell = dumb_bell(floor=[sw.Floor(restitution=0.5, friction=0.1), sw.Sphere((0.0, 0.0), 9.0, inside=True)])
    with pytest.warns((sw.DivergenceWarning, sw.AccuracyWarning)):
        run = sw.integrate(bell, "rk4", v=[[1e200, -1e200], [0.0, 0.0]], y=tilted(0.3, 0.1), dt=1.0, steps=5, every=1)
    first = int(run.first_bad_step)
    assert first >= 0
    assert not np.isfinite(np.concatenate([run.v, run.y], axis=1)[first:].reshape(6 - first, -1)).all(axis=1).any()


def test_what_does_not_go_together_is_refused() -> None:
    bell, start, push = dumb_bell(floor=sw.Floor()), {"v": 0.0, "y": tilted(0.3)}, sw.EnergyControl(0.1)
    in_space, in_plane = sw.Floor(normal=(0, 0, 1)), sw.Floor(normal=(0, 1))
    other_ways: list[dict[str, Any]] = [{"way": "flip"}, {"way": "restitution"}, {"way": "spring", "omega": 9.0}]
    assert_raises(
        *((lambda way=way: dumb_bell(floor=sw.Floor(**way)), 'floor 0: expected way="safe", got') for way in other_ways),
        (lambda: sw.integrate(bell, "dop853", **start, tolerance=1e-6, at=[1.0]), "the estimated error .* not include a bounce"),
        (lambda: sw.integrate(bell, "rk4", **start, dt=0.1, steps=1, control=push), "meets surfaces"),
        kind=UnsupportedError,
    )
    assert_raises(
        (lambda: dumb_bell(floor=in_space), "floor 0: expected vectors of 2 components, got 3"),
        (lambda: sw.Rods([1.0, 1.0], [(0, 1)], 1.0, floor=[in_space, in_plane]), "floor 1: expected vectors of 3 .*, got 2"),
        (lambda: sw.Rods([1.0, 1.0], [(0, 1)], 1.0, floor=sw.Floor(normal=(1,))), "floor 0: .* vectors of 2 or 3 .*, got 1"),
        (lambda: sw.Pendulum3D(floor=sw.Sphere((0.0, 0.0), 1.0)), "floor 0: expected vectors of 3 components, got 2"),
        kind=ShapeError,
    )
    with pytest.raises(ArgumentError, match="floor: expected at most 100 pairs of a point and a surface, got 60 points and 2"):
        sw.Rods(np.ones(60), [(i, i + 1) for i in range(59)], 1.0, floor=[sw.Floor()] * 2)


#: Checks that are made by methods whose velocity is not at the same time as y, too.
LAGGING = dict.fromkeys(("drops_as_a_ball", "adds_no_energy", "slides_to_rest"), ("standard_euler",))
LAGGING["topples"] = ("standard_euler", "false_euler")

MISTAKES = [
    # the columns
    ("column[i] = own if felt is None else [x + y for x, y in zip(own, felt, strict=True)]", "column[i] = own"),
    ("column = self.pushed(solved(factors, right), points)", "column = [None] * points"),
    ("self.rods.inverse[i] if b == i else self.rods.minus[i]", "self.rods.inverse[i]"),
    ("return [[-n[1], n[0]]]", "return [[n[0], n[1]]]"),
    ("of = [low if each == high else each for each in of]", "pass"),
    # where a point is, and what it aims at
    ("near=place.near | bits.at_most(place.distance, slack)", "near=place.near & bits.less(place.distance, -0.01)"),
    ("size = size + length", "size = -(2.0**40) * length"),
    ("aim = bits.where(touches, change.speed,", "aim = bits.where(touches, surface.restitution * change.speed,"),
    ("give = bits.where(place.near, yields, np.inf)", "give = yields"),
    ("weight = dot(place.normal, column[i])", "weight = inverse[i]"),
    # impulses
    ("bits.where(bits.less(impulse + more, 0.0), -impulse, more)", "more"),
    ("for _ in range(SWEEPS):", "for _ in range(1):"),
    ("each.surface.friction * impulses[k]", "each.surface.friction * each.change.speed"),
    ("share = bits.where(sticks[k], 1.0, most / size)", "share = 1.0"),
    ("share = bits.where(sticks[k], 1.0, most / size)", "share = bits.where(sticks[k], 0.0, most / size)"),
    ("v = added(v, slide, p - shears[k][r])", "v = added(v, slide, p)"),
    # places
    ("bits.where(at_rest, at + half * (a + b), to)", "to"),
    ("bits.where(each.change.rests, half, each.change.since)", "self.h"),
    ("y = added(y, slide, since * shear)", "pass"),
    ("for _ in range(ROUNDS):", "for _ in range(0):"),
    ("off = [0.5 * (now - square)", "off = [(now - square)"),
    ("y = joined.corrected(joined.factors(), y, off)", "pass"),
    # velocities
    ("bits.where(each.touches, bits.where(each.change.rests, each.give, np.inf), each.give)", "each.give"),
    ("return joined.corrected(factors, v, joined.closing(v))", "return v"),
    ("for _ in range(ROUNDS - 1):", "for _ in range(0):"),
    # energy
    ("bits.where(bits.less(most, square), np.sqrt(most / square), 1.0)", "1.0"),
    ("fall = self.rods.gravity + self.rods.gravity", "fall = self.rods.gravity"),
    ("most = bits.where(bits.less(most, free), free, most)", "pass"),
    ("rests = bits.at_most(square, REST * raw)", "rests = bits.less(square, 0.0 * raw)"),
    ("touched = each.touches if touched is None else touched | each.touches", "touched = each.place.near"),
]


def changed(old: str, new: str) -> dict[str, Any]:
    """The names of the module in which this stands once, with a change in its text."""
    for module in (rod_contact, joined):
        if Path(str(module.__file__)).read_text(encoding="utf-8").count(old) == 1:
            wrong = vars(mistaken(module, old, new))
            return {name: wrong[name] for name in ("RodContacts", "Joined", "added", "groups") if name in wrong}
    pytest.fail(f"the text is not there, or more than once: {old}")


def is_noticed() -> bool:
    """Whether a check notices, all of them by one method and then by the others: most mistakes are noticed by any method."""
    by_one = [(check, "rk4") for check in rod_contacts.ALL.values()]
    by_others = [(check, method) for name, check in rod_contacts.ALL.items() for method in LAGGING.get(name, ())]
    for check, method in by_one + by_others:
        try:
            check(method, backend="numpy")
        except AssertionError:
            return True
    return not equal_to_the_core()


def equal_to_the_core() -> bool:
    """Of two dumb-bells, one beside the other, whose energies must not be shared."""
    y = np.concatenate([tilted(0.4, 0.01), tilted(1.1, 0.02) + np.array([3.0, 0.0])])
    pair = sw.Rods(np.ones(4), [(0, 1), (2, 3)], 1.0, gravity=G, floor=sw.Floor(restitution=0.8, friction=0.3))
    runs = [
        sw.integrate(pair, "rk4", v=0.0, y=y, dt=1 / 60, steps=12, every=1, control=RESETTING, backend=backend)
        for backend in ("rust", "numpy")
    ]
    return np.array_equal(runs[0].y, runs[1].y)


@pytest.mark.mutant
@pytest.mark.parametrize(("old", "new"), MISTAKES, ids=[str(i) for i in range(len(MISTAKES))])
@pytest.mark.filterwarnings("ignore")
def test_a_mistake_is_noticed(old: str, new: str, monkeypatch: Any) -> None:
    for name, wrong in changed(old, new).items():
        monkeypatch.setattr(rod_contact, name, wrong)
    assert is_noticed()


@pytest.mark.mutant
def test_nothing_is_noticed_without_a_mistake() -> None:
    assert not is_noticed()
