"""What bodies that attract each other keep, whatever the method or only by some: properties over random bodies."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from stepwell.reference.systems.nbody import partners
from support.cases import assert_same
from support.families import family
from support.for_each import for_each

EPS = float(np.finfo(float).eps)
METHODS = [m.name for m in sw.methods()]
#: The most bodies of which a series is not too long.
MOST_IN_SERIES = 15
FORCES = ("logarithmic", "newton")
#: Their P is a product of kicks along the lines between bodies and of drifts along v, each of which keeps angular momentum.
SYMPLECTIC = ["false_euler", "damped_euler", "leapfrog"]


def bodies(seed: int, n: int, dim: int, force: str) -> tuple[sw.NBody, Any, Any]:
    """Bodies some tenths apart or more (softened), with masses of up to 1."""
    rng = np.random.default_rng(seed)
    system = sw.NBody(rng.uniform(0.1, 1.0, n), force=force, softening=0.3)
    return system, rng.normal(size=(n, dim)), 2.0 * rng.normal(size=(n, dim))


def spin(masses: Any, v: Any, y: Any) -> Any:
    """Σ m·(yᵢvⱼ − yⱼvᵢ) over bodies, an antisymmetric matrix in the plane and in space."""
    return np.einsum("b,bi,bj->ij", masses, y, v) - np.einsum("b,bi,bj->ij", masses, v, y)


RANDOM = {
    "seed": st.integers(0, 10**6),
    "n": st.sampled_from([1, 2, 3, 4, 7, 8, 9, 33]),
    "dim": st.sampled_from([2, 3]),
    "force": st.sampled_from(FORCES),
}


@pytest.mark.filterwarnings("ignore:bodies .* of each other at step")
@settings(max_examples=60, deadline=None)
@given(**RANDOM, method=st.sampled_from(METHODS))
def test_momentum_is_kept_by_every_method(seed: int, n: int, dim: int, force: str, method: str) -> None:
    """The two pushes of a pair are G·m·m times the same numbers, so they cancel but for rounding."""
    if sw.method(method).has_series:
        n = min(n, 8)  # of more bodies a series is refused, see test_taylor.py
    system, v, y = bodies(seed, n, dim, force)
    run = sw.integrate(system, method, v=v, y=y, dt=0.01, steps=200)
    m = system.masses[:, np.newaxis]
    # A body gets n pushes of at most G·m/(2ε) a stage, each of some roundings; steps add up. Verlet's v divides by h what rounds.
    size = np.abs(m * v).sum() + n * n / 0.6
    bound = 200 * 20 * EPS * size * (100 if method == "verlet" else 1)
    np.testing.assert_allclose((m * run.v[-1]).sum(axis=0), (m * v).sum(axis=0), rtol=0, atol=bound)


@settings(max_examples=40, deadline=None)
@given(**RANDOM, method=st.sampled_from(SYMPLECTIC))
def test_angular_momentum_is_kept_by_symplectic_methods(seed: int, n: int, dim: int, force: str, method: str) -> None:
    system, v, y = bodies(seed, n, dim, force)
    run = sw.integrate(system, method, v=v, y=y, dt=0.01, steps=200)
    before, after = spin(system.masses, v, y), spin(system.masses, run.v[-1], run.y[-1])
    reach = np.abs(y).max() + 2.0 * np.abs(run.v[-1]).max() + np.abs(run.y[-1]).max()
    bound = 200 * 40 * EPS * n * n * reach * (1.0 + np.abs(v).max())
    np.testing.assert_allclose(after, before, rtol=0, atol=bound)
    euler = sw.integrate(system, "standard_euler", v=v, y=y, dt=0.01, steps=200)  # which does not keep it
    assert n == 1 or np.abs(spin(system.masses, euler.v[-1], euler.y[-1]) - before).max() > bound


@settings(max_examples=40, deadline=None)
@given(**RANDOM, method=st.sampled_from(METHODS))
def test_the_order_of_the_bodies_does_not_matter(seed: int, n: int, dim: int, force: str, method: str) -> None:
    """Sums are made in another order: equal to rounding, which close encounters multiply."""
    assume(not sw.method(method).has_series or n <= MOST_IN_SERIES)
    assume(method != "wisdom_holman" or force != "newton")  # each body goes around those before it
    system, v, y = bodies(seed, n, dim, force)
    order = np.random.default_rng(seed).permutation(n)
    run = sw.integrate(system, method, v=v, y=y, dt=0.01, steps=100)
    mixed = sw.integrate(
        sw.NBody(system.masses[order], force=force, softening=0.3), method, v=v[order], y=y[order], dt=0.01, steps=100
    )
    # One unit of time; neighbours part by at most e^(t·√(n·m/ε³)) ≲ e^35 for 33 bodies at one point, in practice below 1e4.
    np.testing.assert_allclose(mixed.y[-1], run.y[-1][order], rtol=0, atol=1e-8)


@settings(max_examples=40, deadline=None)
@given(**RANDOM, method=st.sampled_from(METHODS))
def test_scaling_by_powers_of_two_is_exact(seed: int, n: int, dim: int, force: str, method: str) -> None:
    """Lengths × 4: times × 8 and speeds × ½ under Newton's law, times × 4 and the same speeds under the 1/r law. To the bit."""
    assume(not sw.method(method).has_series or n <= MOST_IN_SERIES)
    system, v, y = bodies(seed, n, dim, force)
    times, speeds = (8.0, 0.5) if force == "newton" else (4.0, 1.0)
    wide = sw.NBody(system.masses, force=force, softening=4.0 * 0.3)
    run = sw.integrate(system, method, v=v, y=y, dt=0.01, steps=50)
    scaled = sw.integrate(wide, method, v=speeds * v, y=4.0 * y, dt=times * 0.01, steps=50)
    np.testing.assert_array_equal(scaled.y[-1], 4.0 * run.y[-1])
    np.testing.assert_array_equal(scaled.v[-1], speeds * run.v[-1])


@settings(max_examples=30, deadline=None)
@given(**RANDOM)
def test_leapfrog_goes_back(seed: int, n: int, dim: int, force: str) -> None:
    """With the velocities turned round it comes back to where it was, but for rounding."""
    system, v, y = bodies(seed, n, dim, force)
    there = sw.integrate(system, "leapfrog", v=v, y=y, dt=0.01, steps=100)
    back = sw.integrate(system, "leapfrog", v=-there.v[-1], y=there.y[-1], dt=0.01, steps=100)
    np.testing.assert_allclose(back.y[-1], y, rtol=0, atol=1e-8)
    np.testing.assert_allclose(back.v[-1], -v, rtol=0, atol=1e-8)
    euler = sw.integrate(system, "standard_euler", v=v, y=y, dt=0.01, steps=100)
    again = sw.integrate(system, "standard_euler", v=-euler.v[-1], y=euler.y[-1], dt=0.01, steps=100)
    assert n == 1 or np.abs(again.y[-1] - y).max() > 1e-5


def test_false_eulers_energy_stays_in_a_band_over_a_million_steps() -> None:
    """On the figure-eight with 1000 steps a period, a thousand periods: the band of the last tenth is that of the first."""
    eight = sw.scenes.figure_eight()
    run = eight.run("false_euler", dt=eight.period / 1000, steps=1_000_000, every=7)
    off = np.abs(run.energy - run.energy[0])
    tenth = len(off) // 10
    assert off[-tenth:].max() < 1.2 * off[:tenth].max() < 0.01
    standard = eight.run("standard_euler", dt=eight.period / 1000, steps=10_000, every=7)
    assert np.abs(standard.energy - standard.energy[0]).max() > 0.1  # no band at all


@for_each("force", FORCES)
@for_each("dim", [2, 3])
def test_force_is_minus_the_gradient_of_the_energy(force: str, dim: int) -> None:
    """h·v̇ of the reference against differences of the potential energy, with unequal masses and softening."""
    system, v, y = bodies(11, 5, dim, force)
    system = system.for_state_shapes(v, y)
    a = system.scaled(1.0, ()).dv(0.0, v, y)
    rest, d = np.zeros_like(v), 1e-5
    for i in range(5):
        for c in range(dim):
            moved = np.zeros_like(y)
            moved[i, c] = d
            slope = (system.energy(rest, y + moved) - system.energy(rest, y - moved)) / (2 * d)
            # Differences: d² times the third derivative (≲ 1/ε³) plus an eps over d.
            assert system.masses[i] * a[i, c] == pytest.approx(-slope, abs=1e-7)


def test_the_printed_pair_is_no_pair() -> None:
    """Its force is that of the 1/r law to the bit, its energy is not kept by an accurate motion (Appendix D)."""
    scene = sw.scenes.energy_control("printed")
    printed = scene.run("rk4", dt=1e-3, steps=1000, every=100, control=None)
    matching = sw.scenes.energy_control().run("rk4", dt=1e-3, steps=1000, every=100, control=None)
    np.testing.assert_array_equal(printed.y, matching.y)
    assert np.ptp(printed.energy) > 0.1
    assert np.ptp(matching.energy) < 1e-10


#: Bodies around every border: of chunks of eight, of the groups from 64 on, and of the slabs.
BORDERS = [1, 2, 7, 8, 9, 16, 17, 31, 32, 33, 48, 63, 64, 65, 66, 72, 127, 128, 130, 511, 512, 513, 514, 768]


@pytest.mark.parametrize("n", family(BORDERS, lambda n: n in (1, 8, 33, 65, 513)))
def test_one_system_equals_the_reference(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(n)
    v, y = rng.normal(size=(2, n, 3))
    for force, dim in (("newton", 3), ("logarithmic", 2), ("printed", 3)):
        system = sw.NBody(rng.uniform(0.5, 2.0, n) / n, force=force, softening=0.1, dim=dim)
        for control in (None, sw.EnergyControl(0.7, "limited", target=0.1), sw.Projection("nacozy"), sw.Projection()):
            arguments: dict[str, Any] = {"v": v[:, :dim], "y": y[:, :dim], "dt": 0.01, "steps": 2, "control": control}
            reference = sw.integrate(system, "false_euler", **arguments, backend="numpy")
            for level in sw.isa_levels():
                monkeypatch.setenv("STEPWELL_KERNELS", level)
                assert_same(sw.integrate(system, "false_euler", **arguments), reference)


@pytest.mark.parametrize("n", family([1023, 1024, 1100, 2050], lambda n: n in (1023, 1100)))
@for_each("control", [None, sw.EnergyControl(0.7, "limited", target=0.1), sw.Projection("nacozy")])
def test_threads_share_the_distances_of_one_system(n: int, control: sw.EnergyControl | sw.Projection | None) -> None:
    rng = np.random.default_rng(n)
    system = sw.NBody(rng.uniform(0.5, 2.0, n) / n, force="newton", softening=0.1, dim=3)
    v, y = rng.normal(size=(2, n, 3))
    arguments: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 2, "control": control}
    reference = sw.integrate(system, "false_euler", **arguments, backend="numpy")
    for threads in (None, 1, 2, 3, 40):
        assert_same(sw.integrate(system, "false_euler", **arguments, threads=threads), reference)
    if control is None:
        world = sw.World(system, "false_euler", v=v.copy(), y=y.copy(), dt=0.01)
        world.step(2)
        np.testing.assert_array_equal(world.y, reference.y[-1])


def test_every_pair_meets_once() -> None:
    for n in [*range(1, 1300), 4096, 8191, 8192, 70001]:
        distances = [k for slab in partners(n) for group in slab for k in group]
        assert sorted(distances) == list(range(1, n // 2 + 1))
        assert len(partners(n)) <= 16


def test_bodies_that_fill_no_vector_cost_little_more_than_their_pairs() -> None:
    """76 bodies have 1.42 times the pairs of 64. They took 3.6 times as long when the last, masked lanes were no vector code."""

    def world(n: int) -> sw.World:
        rng = np.random.default_rng(n)
        v, y = rng.normal(size=(2, n, 3))
        return sw.World(sw.NBody(np.full(n, 1 / n), force="newton", dim=3, softening=0.1), "leapfrog", v=v, y=y, dt=1e-4)

    def least(of: sw.World) -> float:
        begin = time.process_time()
        of.step(300)
        return time.process_time() - begin

    full, odd = world(64), world(76)
    pairs = [(least(full), least(odd)) for _ in range(15)]
    ratio = min(odd for _, odd in pairs) / min(full for full, _ in pairs)
    assert ratio < 2.4, ratio  # 1.5; coarse, for other programs take time too
