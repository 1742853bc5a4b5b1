"""Nets of springs on floors and spheres: energy, rest, fixed particles, and bits of small and large nets.

A step of False Euler of an undamped net is v₁ = v₀ + h·F(y₀)/m, y₁ = y₀ + h·v₁: to each particle by itself, a step in the uniform
field Fᵢ(y₀)/mᵢ. In such a field no contact "safe" leaves a particle with more energy than before the step, and False Euler loses
½·m·(h·F/m)² in a step without contact. Summed over the particles, with Δ = y' − y₀ of the state after contact,
K' − K₀ ≤ F(y₀)·Δ = −∇V(y₀)·Δ. A spring's ½k(ℓ − ℓ₀)² = ½k|d|² − kℓ₀|d| + ½kℓ₀² is ½k|d|² and a concave function of d, so
V(y₀ + Δ) − V(y₀) − ∇V(y₀)·Δ ≤ ½ Σ k·|Δⱼ − Δᵢ|², for Δ of any size. So in every step, with contacts or without,

E' ≤ E₀ + ½ Σ k·|Δⱼ − Δᵢ|².

The right side is of order h². Gravity is uniform and adds nothing to it.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import DTypeError, ShapeError, UnsupportedError
from stepwell.model import surfaces
from stepwell.reference import contact
from stepwell.runs.engine import direct
from support.calls import assert_raises
from support.contacts import G, set_mistaken
from support.looped import looped
from support.ways import assert_equal_ways

#: Energies are sums of some hundred terms, each with some roundings.
ROUNDING = 1000 * 2.0**-53


def jelly(damping: float | None = None, floor: Any = None) -> tuple[sw.Springs, Any]:
    """A cube of 3 × 3 × 3 particles, 0.2 wide, its lowest corner at height 0, turned so that no face is level."""
    at = np.stack(np.meshgrid(range(3), range(3), range(3), indexing="ij"), axis=-1).reshape(-1, 3)
    pairs = [(i, j) for i, j in itertools.combinations(range(27), 2) if np.abs(at[i] - at[j]).max() == 1]
    turn, _ = np.linalg.qr(np.array([[1.0, 0.4, 0.2], [0.3, 1.0, -0.5], [-0.1, 0.6, 1.0]]))
    y = 0.1 * (at @ turn)
    y[:, 2] -= y[:, 2].min()
    options: dict[str, Any] = {"stiffness": 100.0, "layout": y, "damping": damping, "masses": 0.02}
    return sw.Springs(pairs, **options, gravity=(0.0, 0.0, -G), floor=floor), y


def cloth(n: int, **options: Any) -> tuple[sw.Springs, Any]:
    """n × n particles, level, 1 wide."""
    at = np.arange(n * n).reshape(n, n)
    ends = [(at[:, :-1], at[:, 1:]), (at[:-1], at[1:]), (at[:-1, :-1], at[1:, 1:]), (at[:-1, 1:], at[1:, :-1])]
    pairs = np.concatenate([np.stack([i.ravel(), j.ravel()], axis=1) for i, j in ends])
    y = np.stack([(at % n) / (n - 1) - 0.5, (at // n) / (n - 1) - 0.5, 0.0 * at], axis=-1).reshape(-1, 3)
    return sw.Springs(pairs, layout=y, masses=0.25 / n**2, gravity=(0.0, 0.0, -G), **options), y


FLOORS = {
    "elastic": sw.Floor(),
    "e = 0.5": sw.Floor(restitution=0.5),
    "e = 0, rough": sw.Floor(restitution=0.0, friction=0.5),
    "a ball": sw.Sphere((0.1, 0.1, -0.3), 0.3, restitution=0.7, friction=0.2),
    "a trough": [
        sw.Floor(restitution=0.8, normal=(0.5, 0.0, 1.0)),
        sw.Floor(restitution=0.8, friction=0.3, normal=(-0.5, 0.2, 1.0), offset=-0.1),
    ],
}


def no_energy_beyond_the_bound(floor: Any, backend: str = "rust", heights: Any = (0.02, 0.3, 1.1)) -> None:
    """In each step, of drops from several heights with steps of up to the safe one."""
    net, layout = jelly(floor=floor)
    spring = net.pairs.T
    for share, height in itertools.product((0.1, 0.37, 0.7, 0.99), heights):
        h = share * float(net.safe_step("false_euler"))
        steps = int(np.ceil((np.sqrt(2.0 * height / G) + 0.2) / h))
        start: dict[str, Any] = {"v": 0.0, "y": np.add(layout, [0.0, 0.0, height])}
        run = sw.integrate(net, "false_euler", **start, dt=h, steps=steps, every=1, backend=backend)
        energy = run.energy
        moved = np.diff(run.y, axis=0)
        apart = moved[:, spring[1]] - moved[:, spring[0]]
        bound = 0.5 * 100.0 * (apart * apart).sum(axis=(1, 2))
        kinetic = 0.5 * 0.02 * (run.v * run.v).sum(axis=(1, 2))
        scale = kinetic.max() + 27 * 0.02 * G * np.abs(run.y).max()
        assert (np.diff(energy) <= bound + ROUNDING * scale).all()
        free = sw.integrate(jelly()[0], "false_euler", **start, dt=h, steps=steps)
        assert (run.y[-1] != free.y[-1]).any()  # it met the floor


@looped("floor", FLOORS)
def test_no_step_adds_more_energy_than_springs_can_take(floor: str) -> None:
    no_energy_beyond_the_bound(FLOORS[floor])


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("leaving = self.restitution * impact", "leaving = 1.1 * impact"),
        ("rising = (leaving - pull * since) - ahead", "rising = leaving - ahead"),
        ("square = (w * w + (pull + pull) * place.distance)", "square = (w * w - (pull + pull) * place.distance)"),
    ],
)
def test_a_mistake_in_a_net_is_noticed(old: str, new: str, monkeypatch: Any) -> None:
    set_mistaken(monkeypatch, old, new)
    with pytest.raises(AssertionError):
        no_energy_beyond_the_bound(sw.Floor(), backend="numpy", heights=(0.3,))


@looped("share, height", itertools.product([0.2, 0.5, 0.9], [0.05, 0.6]))
def test_damped_jelly_comes_to_rest_on_the_floor(share: float, height: float) -> None:
    """At rest the floor carries it: no particle is below it, three or more are on it, and the springs carry the others."""
    net, layout = jelly(damping=0.5, floor=sw.Floor(restitution=0.0, friction=0.5))
    h = share * float(net.safe_step("false_euler"))
    y = np.add(layout, [0.0, 0.0, height])
    run = sw.integrate(net, "false_euler", v=0.0, y=y, dt=h, steps=int(8.0 / h), every=int(0.5 / h))
    assert run.energy.max() <= run.energy[0] * (1.0 + ROUNDING)  # once a picture of a game
    assert np.abs(run.v[-1]).max() < 1e-6
    assert run.y[..., 2].min() >= 0.0  # at rest they lie at 0 exactly, and none of them starts behind the floor
    assert (run.y[-1, :, 2] == 0.0).sum() >= 3
    loose = sw.Springs(net.pairs, stiffness=100.0, rest=net.rest, masses=0.02, gravity=(0.0, 0.0, -G))
    force = 0.02 * loose.reference_at_step(1.0, ()).dv(0.0, run.v[-1], run.y[-1])
    lies = run.y[-1, :, 2] == 0.0
    assert np.abs(force[~lies]).max() < 1e-4 * 0.02 * G
    assert -force[lies, 2].sum() == pytest.approx(27 * 0.02 * G, rel=1e-4)  # its weight


def test_a_cloth_falls_on_a_ball_and_lies_on_it() -> None:
    ball = sw.Sphere((0.0, 0.0, -0.5), 0.4, restitution=0.0, friction=0.8)
    net, y = cloth(16, stiffness=40.0, damping=0.02, drag=2e-4, floor=ball)
    h = 0.5 * float(net.safe_step("false_euler"))
    run = sw.integrate(net, "false_euler", v=0.0, y=np.add(y, [0.02, 0.01, 0.0]), dt=h, steps=int(6.0 / h), every=int(0.5 / h))
    energy = run.energy
    away = np.sqrt(((run.y - [0.0, 0.0, -0.5]) ** 2).sum(axis=-1))
    assert away.min() >= 0.4 * (1.0 - 4 * 2.0**-53)
    assert ((away[-1] - 0.4) < 1e-12).sum() > 30  # it lies on the ball
    assert run.y[-1, :, 2].max() < -0.05
    assert np.abs(run.v[-1]).max() < 0.05
    assert (energy[1:] < energy[0]).all()
    smooth, _ = cloth(16, stiffness=40.0, damping=0.02, drag=2e-4, floor=sw.Sphere((0.0, 0.0, -0.5), 0.4, restitution=0.0))
    slides = sw.integrate(smooth, "false_euler", v=0.0, y=np.add(y, [0.1, 0.05, 0.0]), dt=h, steps=int(6.0 / h))
    assert slides.y[-1, :, 2].max() < -1.0  # without friction it slides off


WAYS: list[dict[str, Any]] = [{}, {"way": "restitution"}, {"way": "flip"}, {"way": "spring", "omega": 9.0}]


def fixed_particles_pass_through(way: dict[str, Any], n: int, backend: str) -> None:
    """Led along at its velocity through a floor, a fixed particle is where it would be without; the others are not."""
    fixed = [0, n * n - 1]
    net, y = cloth(n, stiffness=5.0, fixed=fixed, floor=sw.Floor(offset=-0.05, **way))
    v = np.zeros_like(y)
    v[fixed] = (0.1, 0.0, -1.0)
    for method in ("false_euler", "leapfrog", "rk4"):
        dt = 0.3 * float(net.safe_step(method))
        run = sw.integrate(net, method, v=v, y=y, dt=dt, steps=60, every=1, backend=backend)
        free = sw.integrate(cloth(n, stiffness=5.0, fixed=fixed)[0], method, v=v, y=y, dt=dt, steps=60, every=1)
        assert run.y[-1, 0, 2] < -0.05
        assert np.array_equal(run.v[:, fixed], free.v[:, fixed])
        assert np.array_equal(run.y[:, fixed], free.y[:, fixed])
        assert (run.y[-1, 1] != free.y[-1, 1]).any()


@looped("way, n, backend", itertools.product(WAYS, [2, 12], ["rust", "numpy"]))
def test_fixed_particles_pass_through_surfaces(way: dict[str, Any], n: int, backend: str) -> None:
    fixed_particles_pass_through(way, n, backend)


@pytest.mark.mutant
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('self.free = getattr(s, "free", slice(None))', "self.free = slice(None)"),
        ("whole[self.free] = of_free", "whole[: len(of_free)] = of_free"),
    ],
)
def test_a_mistake_about_fixed_particles_is_noticed(way: dict[str, Any], old: str, new: str, monkeypatch: Any) -> None:
    set_mistaken(monkeypatch, old, new)
    with pytest.raises(AssertionError):
        fixed_particles_pass_through(way, 2, "numpy")


@looped("method", ["verlet", "leapfrog", "rk4"])
def test_a_large_net_has_the_same_bits_in_every_way(method: str) -> None:
    """It is stepped in rows."""
    floor = [
        sw.Sphere((0.0, 0.0, -0.2), 0.15, friction=0.3),
        sw.Floor(restitution=np.array([0.5, 0.0, 1.0, 0.7]), offset=-0.3),
        sw.Floor(offset=-0.25, way="spring", omega=9.0),
    ]
    net, y = cloth(16, stiffness=10.0, fixed=[0], floor=floor)
    v = np.random.default_rng(16).normal(0.0, 0.1, (*y.shape, 4))
    start: dict[str, Any] = {"v": v, "y": y[..., np.newaxis] + np.zeros(4), "dt": 0.004, "steps": 90, "every": 30}
    ways = ("by the reference", "alone", "in pieces", "in a world")
    assert_equal_ways(net, method, **start, ways=ways)
    run = sw.integrate(net, method, **start, threads=2)
    np.testing.assert_array_equal(run.y, sw.integrate(net, method, **start, threads=1).y)


def test_what_does_not_go_together_is_refused() -> None:
    net, onto = sw.Springs([(0, 1)], rest=1.0, floor=sw.Floor()), sw.Projection()
    ball = sw.Sphere((0.0, 0.0, 0.0), 1.0)
    step: dict[str, Any] = {"v": 0.0, "y": np.eye(2), "dt": 0.1, "steps": 1}
    one_number = "gravity and floor 0: expected one number of dimensions"
    assert_raises(
        (lambda: sw.Springs([(0, 1)], rest=1.0, floor=1), DTypeError, "floor: expected a Floor, .* or None, got int"),
        (lambda: sw.Springs([(0, 1)], rest=1.0, gravity=(0.0, -1.0), floor=ball), ShapeError, one_number),
        (lambda: sw.integrate(net, "rk4", **step, control=onto), UnsupportedError, "control: .* meets surfaces"),
    )
    assert "floor=Floor(offset=0.0" in repr(net)
    assert sw.Springs([(0, 1)], rest=1.0, floor=ball).dim == 3
    assert jelly(floor=sw.Floor())[0].safe_step("rk4") == jelly()[0].safe_step("rk4")


def test_the_module_that_is_changed_is_the_one_that_runs() -> None:
    assert surfaces.contact is direct.contact is contact


def rope(stiffness: float, floor: Any = None) -> tuple[sw.Springs, Any]:
    """5 m in 20 points of 1 kg, level at a height of 2.5 m; the first point is fixed."""
    y = np.stack([np.linspace(0.0, 5.0, 20), np.full(20, 2.5)], axis=1)
    pairs = [(i, i + 1) for i in range(19)]
    return sw.Springs(pairs, stiffness=stiffness, layout=y, fixed=[0], gravity=(0.0, -G), floor=floor), y


IMPLICIT = [m.name for m in sw.methods() if m.is_implicit]


@looped("method", IMPLICIT)
def test_an_implicit_step_with_bounces_is_no_longer_than_explicit_ones_may_be(method: str) -> None:
    net, y = rope(1e4, sw.Floor(restitution=0.0))
    longest = float(net.safe_step("false_euler"))
    run = sw.integrate(net, method, v=0.0, y=y, dt=longest, steps=300, every=1)
    assert run.energy.max() <= run.energy[0] * (1.0 + 1e-3)
    assert not run.findings
    with pytest.raises(UnsupportedError, match=rf"dt: expected at most 0.01, got 0.0101: {method} solves for .*Floor\(way="):
        sw.integrate(net, method, v=0.0, y=y, dt=1.01 * longest, steps=1)
    with pytest.raises(UnsupportedError, match="dt: expected at most"):
        sw.World(net, method, v=np.zeros_like(y), y=y.copy(), dt=1.01 * longest)
    soft, y = rope(1e4, sw.Floor(way="spring", omega=100.0))
    assert np.isfinite(sw.integrate(soft, method, v=0.0, y=y, dt=1.01 * longest, steps=10).y).all()


@looped("stiffness", [1e3, 1e4, 1e7])
def test_passes_that_lead_away_are_not_made(stiffness: float) -> None:
    """The rope swings down and its energy decays; three passes of Newton's method lead away in some of its steps."""
    net, y = rope(stiffness)
    for method in ("backward_euler", "linearly_implicit_euler"):
        run = sw.integrate(net, method, v=0.0, y=y, dt=1 / 60, steps=600, every=1)
        assert run.energy.max() <= run.energy[0] * (1.0 + 1e-12), method
        assert not run.findings, method


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_a_net_that_gained_energy_is_named(backend: Any) -> None:
    net, y = rope(1e6)
    start: dict[str, Any] = {"v": 0.0, "y": y, "dt": 1 / 60, "every": 5, "backend": backend}
    words = "the run gained energy, .* never give: up to .* from .*, so implicit_midpoint with dt"
    with pytest.warns(sw.AccuracyWarning, match=words):
        sw.integrate(net, "implicit_midpoint", **start, steps=100)
    calm, wild = (sw.World(net, m, v=0.0 * y, y=y.copy(), dt=1 / 60) for m in ("backward_euler", "implicit_midpoint"))
    calm.y[-1] += 0.3  # by hand, which adds energy
    calm.step(300)
    with pytest.warns(sw.AccuracyWarning, match=words):
        wild.step(300)
    heights = np.stack([y, y], axis=-1)
    two = sw.Springs(net.pairs, stiffness=[[1e2, 1e6]], rest=net.rest, fixed=[0], gravity=(0.0, -G))
    with pytest.warns(sw.AccuracyWarning, match=r"1 of 2 members gained energy, .*: member 1 has up to"):
        sw.integrate(two, "implicit_midpoint", **start | {"y": heights}, steps=100)
    made = lambda k=1.0: sw.Springs(net.pairs, stiffness=k * np.ones((1, 1)), rest=net.rest, fixed=[0], gravity=(0.0, -G))  # noqa: E731
    with pytest.warns(sw.AccuracyWarning, match=r"at k = 100: 1 of 2 members gained energy, .*: member 1 has up to"):
        sw.sweep(made, {"k": [1e2, 1e6]}, "implicit_midpoint", v=0.0, y=y, dt=1 / 60, steps=100)
