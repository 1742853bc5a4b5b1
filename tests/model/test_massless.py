"""Bodies without mass: what they cost, that no other body notices them, and the bits of their sums."""

from __future__ import annotations

import copy
import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnsupportedError
from support.calls import quiet
from support.cases import assert_same
from support.looped import looped
from support.ways import assert_equal_ways

QUANTITIES = ("energy", "momentum", "angular_momentum", "closest")
CONTROLS = (sw.EnergyControl(0.7, "limited", target=0.1), sw.Projection("nacozy", target=0.1), sw.Projection(target=0.1))
#: Where bodies with mass may stand among the others: which of so many.
PLACES = {
    "first": lambda n, massive: np.arange(massive),
    "last": lambda n, massive: np.arange(n - massive, n),
    "mixed": lambda n, massive: np.random.default_rng(n).permutation(n)[:massive],
}


def bodies(n: int, massive: int, place: str = "mixed", dim: int = 3, force: Any = "newton") -> tuple[sw.NBody, Any, Any]:
    """Bodies of which so many have mass, softened, with a state."""
    rng = np.random.default_rng(100 * n + massive)
    masses = np.zeros(n)
    masses[PLACES[place](n, massive)] = rng.uniform(0.2, 1.0, massive)
    system = sw.NBody(masses, force=force, softening=0.1, G=0.7, dim=dim)
    return system, 0.3 * rng.normal(size=(n, dim)), rng.normal(size=(n, dim))


NUMBERS = [(1, 0), (2, 1), (3, 2), (5, 0), (9, 1), (12, 9), (40, 3), (67, 0), (67, 1), (100, 66), (1300, 5)]
FORCES = [("newton", 3, "leapfrog"), ("logarithmic", 2, "rk4"), ("printed", 3, "verlet")]


@pytest.mark.parametrize("level", sw.isa_levels())
def test_equal_to_the_reference(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tapes and the kernel of many bodies, with all that can be recorded; forces and controls take turns."""
    monkeypatch.setenv("STEPWELL_KERNELS", level)
    for i, ((n, massive), place) in enumerate(itertools.product(NUMBERS, PLACES)):
        force, dim, method = FORCES[(i + i // 3) % 3]
        system, v, y = bodies(n, massive, place, dim, force)
        for control in (None, CONTROLS[i % 3]) if massive else (None,):
            ask: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 4, "every": 2, "control": control, "record": QUANTITIES}
            core, reference = (
                sw.integrate(system, method if control is None else "false_euler", **ask, backend=backend)
                for backend in ("rust", "numpy")
            )
            assert np.isfinite(reference.y).all()
            assert_same(core, reference)
            for name in QUANTITIES:
                np.testing.assert_array_equal(core.recorded[name], reference.recorded[name], err_msg=f"{n}, {massive}, {place}")


def test_the_same_bits_in_every_way() -> None:
    system, v, y = bodies(45, 3)
    rng = np.random.default_rng(45)
    many = {"v": np.repeat(v[..., np.newaxis], 5, axis=-1), "y": y[..., np.newaxis] + 0.1 * rng.normal(size=(45, 3, 5))}
    ways = ("by the reference", "alone", "in pieces", "in a world")
    for options in ({"force": rng.normal(size=(45, 3, 5))}, {"fused": True}, {"dtype": "float32"}):
        assert_equal_ways(system, "leapfrog", **many, dt=0.01, steps=6, **options, ways=ways)
    assert_equal_ways(system, "dop853", **many, tolerance=1e-6, at=np.array([0.1, 0.2]), ways=ways[:3])
    floored = sw.NBody(system.masses, force="newton", softening=0.1, floor=sw.Floor(offset=-1.0), dim=3)
    assert_equal_ways(floored, "false_euler", **many, dt=0.01, steps=6, ways=ways)


def test_threads_share_them() -> None:
    """Pairs enough for threads: with many of either kind, and of both."""
    for n, massive in [(70_000, 8), (1500, 1100)]:
        system, v, y = bodies(n, massive)
        ask: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 2}
        run = sw.integrate(system, "leapfrog", **ask, threads=1)
        for threads in (2, 3, 7):
            assert_same(run, sw.integrate(system, "leapfrog", **ask, threads=threads))
    assert_same(run, sw.integrate(system, "leapfrog", **ask, backend="numpy"))


@looped("numbers, place", itertools.product([(4, 2), (7, 3), (80, 5), (120, 70)], PLACES))
def test_no_body_notices_them(numbers: tuple[int, int], place: str) -> None:
    """To the bit: those with mass go as they do alone, with their energy, and each of the others as if alone with those."""
    n, massive = numbers
    system, v, y = bodies(n, massive, place)
    ask: dict[str, Any] = {"dt": 0.01, "steps": 20, "every": 5, "record": QUANTITIES[:3]}

    def of(which: Any) -> sw.Run:
        some = sw.NBody(system.masses[which], force="newton", softening=0.1, G=0.7)
        return sw.integrate(some, "leapfrog", v=v[which], y=y[which], **ask)

    run, has = of(slice(None)), system.masses > 0.0
    alone = of(has)
    np.testing.assert_array_equal(run.y[:, has], alone.y)
    np.testing.assert_array_equal(run.v[:, has], alone.v)
    for name in QUANTITIES[:3]:
        np.testing.assert_array_equal(run.recorded[name], alone.recorded[name])
    for i in np.flatnonzero(~has)[:: max(1, n // 10)]:
        np.testing.assert_array_equal(run.y[:, i], of(np.r_[np.flatnonzero(has), i]).y[:, -1])
    mixed = np.r_[np.flatnonzero(~has)[::-1], np.flatnonzero(has)]
    np.testing.assert_array_equal(of(mixed).y, run.y[:, mixed])


def test_a_little_mass_makes_a_little_difference() -> None:
    """So the tests above can fail, and the forces are those of the other rule but for rounding."""
    system, v, y = bodies(60, 4)
    little = sw.NBody(np.maximum(system.masses, 1e-30), force="newton", softening=0.1, G=0.7)
    ask: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 50}
    run, other = (sw.integrate(each, "leapfrog", **ask) for each in (system, little))
    assert not np.array_equal(run.y, other.y)
    np.testing.assert_allclose(run.y, other.y, rtol=0, atol=1e-11)


@looped("n", [4, 50])
def test_two_of_them_in_one_place(n: int) -> None:
    """Without softening, where a body with mass in the place of another makes numbers that are not finite."""
    rng = np.random.default_rng(n)
    y = rng.normal(size=(n, 2))
    y[2] = y[1]
    ask: dict[str, Any] = {"v": 0.0, "y": y, "dt": 1e-3, "steps": 3, "record": ("energy", "closest")}
    dust = sw.NBody(np.r_[1.0, np.zeros(n - 1)], force="newton")
    for backend in ("rust", "numpy"):
        run = sw.integrate(dust, "leapfrog", **ask, backend=backend)
        assert run.status == 0
        np.testing.assert_array_equal(run.y[-1, 1], run.y[-1, 2])
        assert run.recorded["closest"][-1] > 0.0
        assert not len(run.encounters)
    with pytest.warns(sw.DivergenceWarning, match="bodies 1 and 2 were 0 apart"):
        sw.integrate(sw.NBody(np.r_[1.0, np.full(n - 1, 1e-9)], force="newton"), "leapfrog", **ask)


def test_the_closest_two_are_those_that_attract() -> None:
    y = np.array([[0.0, 0.0], [0.1, 0.0], [5.0, 0.0], [5.0, 1.0]])
    for masses, least, pair in [
        ([0.0, 0.0, 1.0, 1.0], 1.0, (2, 3)),
        ([0.0, 0.0, 0.0, 1.0], 1.0, (2, 3)),
        ([0.0, 1.0, 0.0, 1.0], 0.1, (0, 1)),
        ([0.0, 0.0, 0.0, 0.0], np.inf, (0, 0)),
    ]:
        system = sw.NBody(masses, softening=0.1)
        run = sw.integrate(system, "leapfrog", v=0.0, y=y, dt=1e-9, steps=1, every=1, record="closest")
        assert run.recorded["closest"][0] == least
        assert system.closest(y) == (pair, least)


def test_encounters_are_of_those_that_attract() -> None:
    """Two bodies without mass pass through each other; one that passes the sun within a step is named."""
    y = np.array([[1.0, 0.0], [10.0, 0.0], [0.0, 0.0], [10.5, 0.0]])
    v = np.array([[0.0, 0.0], [50.0, 0.0], [0.0, 0.0], [-50.0, 0.0]])
    run = sw.integrate(sw.NBody([0.0, 0.0, 1.0, 0.0], force="newton"), "leapfrog", v=v, y=y, dt=0.01, steps=10)
    assert not len(run.encounters)
    v[:] = [-0.05, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
    run = quiet(sw.NBody([0.0, 0.0, 1.0, 0.0], force="newton"), "leapfrog", v=v, y=y, dt=0.01, steps=200)
    (met,) = run.encounters
    assert met.bodies == (0, 2)


def test_what_a_step_computes_grows_with_the_pairs_that_attract() -> None:
    """Of a sun, a planet and dust in the plane: as many more operations for each grain."""

    def operations(grains: int) -> int:
        explained = sw.explain(sw.NBody(np.r_[1.0, 0.1, np.zeros(grains)], force="newton"), "leapfrog")
        return sum(explained.computed.values())

    counts = [operations(grains) for grains in (1, 2, 3, 9)]
    grain = counts[1] - counts[0]
    assert counts[2] - counts[1] == grain
    assert counts[3] - counts[2] == 6 * grain
    assert grain < 45


def test_masses_of_each_member_decide_no_operations() -> None:
    """The bits of a member do not depend on the masses of others: a zero among them is a mass like any other."""
    masses = np.array([[1.0, 1.0, 1.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.0]])
    rng = np.random.default_rng(2)
    v, y = rng.normal(size=(2, 3, 2))
    system = sw.NBody(masses, force="newton", softening=0.1)
    assert not len(system.massless)
    run = sw.integrate(system, "leapfrog", v=v[..., np.newaxis], y=y[..., np.newaxis], dt=0.01, steps=50)
    for k in range(3):
        one, alone = (sw.NBody(masses[:, which], force="newton", softening=0.1) for which in (slice(k, k + 1), k))
        own = sw.integrate(one, "leapfrog", v=v[..., np.newaxis], y=y[..., np.newaxis], dt=0.01, steps=50)
        np.testing.assert_array_equal(run.y[..., k], own.y[..., 0])
        without = sw.integrate(alone, "leapfrog", v=v, y=y, dt=0.01, steps=50)
        np.testing.assert_allclose(without.y, own.y[..., 0], rtol=0, atol=1e-12)


def test_sweeps_over_masses_that_begin_at_zero() -> None:
    pytest.importorskip("xarray")
    y, v = [[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]], [[0.0, 0.0], [0.0, 1.0], [0.7, 0.0]]

    def of_mass(mass: Any) -> sw.NBody:
        return sw.NBody(np.stack(np.broadcast_arrays(1.0, mass, 0.0)), force="newton")

    ask: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 40}
    datasets = [sw.sweep(of_mass, {"mass": np.linspace(0.0, 0.1, 5)}, "leapfrog", **ask, chunk=chunk) for chunk in (1, 2, 5)]
    assert len({dataset.attrs["bits"] for dataset in datasets}) == 1
    assert all(dataset.equals(datasets[0]) for dataset in datasets[1:])


def test_masses_that_a_world_is_given() -> None:
    system, v, y = bodies(6, 2, "first")
    world = sw.World(system, "false_euler", v=v.copy(), y=y.copy(), dt=0.01)
    masses = np.array(system.masses)
    masses[4] = 1e-3
    with pytest.raises(UnsupportedError, match=r"masses: body 4 was without mass, .*; make another NBody with these masses"):
        world.set(masses=masses)
    world.step(3)
    run = sw.integrate(system, "false_euler", v=v, y=y, dt=0.01, steps=3)
    np.testing.assert_array_equal(world.y, run.y[-1])  # nothing changed
    masses[4], masses[0] = 0.0, 0.0  # one that loses its mass still meets all others
    world.set(masses=masses)
    world.step(3)
    other = sw.NBody(masses, force="newton", softening=0.1, G=0.7)
    rest = sw.integrate(other, "false_euler", v=run.v[-1], y=run.y[-1], dt=0.01, steps=3)
    np.testing.assert_allclose(world.y, rest.y[-1], rtol=0, atol=1e-14)
    again = copy.deepcopy(world)
    again.step(2)
    world.step(2)
    np.testing.assert_array_equal(again.y, world.y)


def test_which_they_are() -> None:
    assert sw.NBody([0.0, 1.0, 0.0]).massless.tolist() == [0, 2]
    assert sw.NBody([0.0, 1.0, 0.0]).massive.tolist() == [1]
    assert sw.NBody([1.0, 1.0]).massless.tolist() == []
    assert sw.NBody([1.0, 0.0]) != sw.NBody([1.0, 1.0])
    assert [each.tolist() for each in sw.NBody([0.0, 1.0, 0.0, 1.0]).pairs()] == [[1, 0, 1, 0, 2], [3, 1, 2, 3, 3]]
