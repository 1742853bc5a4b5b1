"""Particles joined by springs: what tests over all systems do not say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.reference.systems import springs as reference
from support.calls import assert_raises
from support.cases import assert_same
from support.looped import looped
from support.mistakes import mistaken
from support.springs import lattice, tangled
from support.ways import assert_equal_ways

EPS = 2.0**-52
SYMPLECTIC = ("false_euler", "leapfrog", "verlet", "pefrl")


def accelerations(system: sw.Springs, v: Any, y: Any, h: float = 1.0) -> Any:
    """h·v̇ once more, in Python's own floats and spring after spring, as the formula says: [k(ℓ − ℓ₀) + c·(v_ij·n)]·n."""
    dim = y.shape[1]
    sums = [[-0.0] * dim for _ in range(system.n)]
    damping = 0.0 if system.damping is None else system.damping
    wide = [np.broadcast_to(row, len(system.pairs)) for row in (system.stiffness, system.rest, damping)]
    for (i, j), *numbers in zip(system.pairs.tolist(), *wide, strict=True):
        k, rest, damping = map(float, numbers)
        d = [float(b - a) for a, b in zip(y[i], y[j], strict=True)]
        w = [float(b - a) for a, b in zip(v[i], v[j], strict=True)]
        square, along = d[0] * d[0], w[0] * d[0]
        for c in range(1, dim):
            square, along = square + d[c] * d[c], along + w[c] * d[c]
        inverse = 1.0 / math.sqrt(square)
        pull = k - (k * rest - (damping * along) * inverse) * inverse
        for c in range(dim):
            sums[i][c] += pull * d[c]
            sums[j][c] -= pull * d[c]
    by_mass = (h / np.broadcast_to(system.masses, system.n))[:, np.newaxis]
    rates = by_mass * sums
    if system.drag is not None:
        rates = rates - by_mass * np.broadcast_to(system.drag, system.n)[:, np.newaxis] * v
    rates = rates if system.gravity is None else rates + h * np.asarray(system.gravity)
    rates[system.fixed] = 0.0
    return rates


VARIANTS: list[dict[str, Any]] = [
    {},
    {"damping": 0.7},
    {"drag": 0.4, "fixed": [2, 5]},
    {"damping": 0.7, "drag": np.linspace(0.1, 0.5, 7), "gravity": (0.3, -1.0, 0.2), "fixed": [0]},
]


def off(system: sw.Springs, v: Any, y: Any) -> float:
    """How far the reference is from the formula, and the forces are from the energy's gradient if they have one."""
    system = system.for_state_shapes(v, y)
    s = system.reference_at_step(1.0, ())
    rates = s.dv(0.0, v, y)
    worst = float(np.abs(rates - accelerations(system, v, y)).max())
    if system.velocity_term is None:
        d, masses = 1e-5, np.broadcast_to(system.masses, system.n)
        for i, c in np.ndindex(*y.shape):
            if i not in system.fixed:
                moved = np.zeros_like(y)
                moved[i, c] = 1.0
                ends = [system.energy(v, y + sign * d * moved) for sign in (1, -1)]
                worst = max(worst, abs(float(ends[0] - ends[1]) / (2 * d) + masses[i] * rates[i, c]) / 1e3)
    return worst


@looped("options", VARIANTS)
def test_forces_are_those_of_the_formula_and_of_the_energy(options: dict[str, Any]) -> None:
    """To rounding: some 16 terms of at most 10; differences of the energy to 1e-10, and a thousandth of that counts."""
    system, state = tangled(1, 7, 3, 16, **options)
    assert off(system, **state) < 100 * 16 * 10 * EPS


#: What to replace in the reference, and by what.
MUTANTS = [
    ("places[self.j] - places[self.i]", "places[self.i] - places[self.j]"),
    ("push = self.force_at_rest / divisor", "push = self.rest / divisor"),
    ("push = (self.force_at_rest - (self.damping", "push = (self.force_at_rest + (self.damping"),
    ("(self.damping * along) * inverse) * inverse", "self.damping * along) * inverse"),
    ("(self.damping * along) * inverse) * inverse", "(self.damping * along) * inverse)"),
    ("self.force_at_rest = stiffness * rest", "self.force_at_rest = rest"),
    ("along = along + w[:, c] * d[:, c]", "along = along + w[:, c] * w[:, c]"),
    ("(self.stiffness - push)[:, np.newaxis] * d", "(self.stiffness + push)[:, np.newaxis] * d"),
    ("sums[pushed] - forces[back]", "sums[pushed] + forces[back]"),
    ("sums[pulled] + forces[by]", "sums[pulled] + forces[back]"),
    ("rates = rates + self.fall", "rates = rates - self.fall"),
    ("rates = rates - self.slowing[:, np.newaxis] * v", "rates = rates + self.slowing[:, np.newaxis] * v"),
    ("self.by_mass * drag", "h * drag"),
    ("self.by_mass = h / masses", "self.by_mass = h * masses"),
    ("dv[self.free] = rates[self.free]", "dv[:] = rates"),
    ("whole = kinetic + total(((half * self.stiffness)", "whole = kinetic + total(((self.h * self.stiffness)"),
    ("whole = whole - total(self.of_free(self.masses) * along)", "whole = whole + total(self.of_free(self.masses) * along)"),
]


@pytest.mark.mutant
@pytest.mark.parametrize(("old", "new"), MUTANTS)
def test_mistakes_are_noticed(monkeypatch: pytest.MonkeyPatch, old: str, new: str) -> None:
    variants = [*VARIANTS, {"gravity": (0.3, -1.0, 0.2)}]
    nets = [tangled(1, 7, 3, 16, **options) for options in variants]
    assert max(off(system, **state) for system, state in nets) < 1e-10
    monkeypatch.setattr(sw.Springs, "reference", mistaken(reference, old, new).Springs)
    worst = []
    for system, state in nets:
        try:
            worst.append(off(system, **state))
        except (ValueError, IndexError):
            worst.append(math.inf)
    assert max(worst) > 1e-7


@looped("dim", [1, 2, 3])
def test_the_order_of_sums_is_that_of_the_springs(dim: int) -> None:
    """Standard Euler from rest: y' = y, v' = v + h·v̇. To the bit, on a tape and by vectors; another order has other bits."""
    for n, springs in ((9, 30), (40, 500)):
        system, state = tangled(4, n, dim, springs, damping=np.linspace(0.1, 0.9, springs))
        run = sw.integrate(system, "standard_euler", **state, dt=0.1, steps=1)
        np.testing.assert_array_equal(run.v[-1], state["v"] + accelerations(system, **state, h=0.1))
        back = {name: getattr(system, name)[::-1] for name in ("stiffness", "rest", "damping")}
        turned = sw.Springs(system.pairs[::-1], **back, masses=system.masses)
        other = sw.integrate(turned, "standard_euler", **state, dt=0.1, steps=1)
        assert (other.v[-1] != run.v[-1]).any()
        np.testing.assert_allclose(other.v[-1], run.v[-1], rtol=0, atol=springs * EPS * 100)


@looped(
    "options, dim",
    [
        ({}, 2),
        ({"damping": 0.1}, 3),
        ({"damping": 0.1, "drag": 0.2, "gravity": (0.0, -1.0, 0.3), "masses": 0.5}, 3),
        ({"damping": 0.1, "drag": 0.2, "gravity": (0.0, -1.0), "masses": 0.5}, 2),
    ],
)
def test_a_large_net_has_the_bits_of_the_reference(options: dict[str, Any], dim: int) -> None:
    """One by vectors of springs, a batch by tapes of its rates; in rows of 13, so that runs end everywhere in a vector."""
    pairs, layout = lattice(17, 13, dim, diagonals=True)
    rng = np.random.default_rng(2)
    system = sw.Springs(pairs, stiffness=rng.uniform(5.0, 9.0, len(pairs)), layout=layout, fixed=[0, 12], **options)
    y = layout[..., np.newaxis] + 0.1 * rng.normal(size=(*layout.shape, 6))
    asked: dict[str, Any] = {"v": np.zeros(y.shape), "y": y, "dt": 0.01, "steps": 60, "every": 20}
    asked["record"] = ["energy", "momentum", "stretch"]
    batch = assert_equal_ways(system, "rk4", **asked, ways=("by the reference", "alone"))
    assert_same(batch, sw.integrate(system, "rk4", **asked, threads=2))
    assert (batch.y[:, [0, 12]] == y[[0, 12]]).all()  # fixed particles, exactly


def test_a_hundred_thousand_springs() -> None:
    pairs, layout = lattice(224, 224)
    system = sw.Springs(pairs, stiffness=100.0, layout=layout, fixed=[0, 223], gravity=(0.0, 0.0, -1.0), damping=0.1)
    assert len(pairs) == 99_904
    arguments: dict[str, Any] = {"v": 0.0, "y": layout, "dt": 0.5 * system.safe_step("false_euler"), "steps": 3}
    run = sw.integrate(system, "false_euler", **arguments, record="energy")
    assert_same(run, sw.integrate(system, "false_euler", **arguments, backend="numpy", record="energy"))
    # Three steps of falling by False Euler: ½·g·h²·(3·4), but for the few particles at the two that are fixed.
    fallen = 6.0 * arguments["dt"] ** 2
    assert np.median(layout[:, 2] - run.y[-1, :, 2]) == pytest.approx(fallen, rel=1e-12)


# ---- what is known of the motion


@looped("method", SYMPLECTIC)
def test_a_pair_swings_as_an_oscillator(method: str) -> None:
    """The extension of a pair on a line is an oscillator of ω² = k(1/m₁ + 1/m₂); the same method on both, to rounding."""
    k, masses, h, steps = 2.0, np.array([1.0, 3.0]), 0.1, 500
    omega = math.sqrt(k * (1 / masses[0] + 1 / masses[1]))
    pair = sw.Springs([(0, 1)], stiffness=k, rest=1.0, masses=masses, dim=2)
    run = sw.integrate(pair, method, v=0.0, y=[[0.0, 0.0], [1.2, 0.0]], dt=h, steps=steps, every=1)
    one = sw.integrate(sw.Oscillator(omega, form="physical"), method, v=0.0, y=0.2, dt=h, steps=steps, every=1)
    # A step rounds places of about 1; errors add up along the orbit: 10 roundings in each of 500 steps, each at most eps.
    np.testing.assert_allclose(run.y[:, 1, 0] - run.y[:, 0, 0] - 1.0, one.y, rtol=0, atol=10 * steps * EPS)
    assert (run.y[:, :, 1] == 0.0).all()


@looped("method", [m.name for m in sw.methods() if m.limit])
def test_the_limit_of_a_pair_is_that_of_its_oscillator(method: str) -> None:
    """h < Φ/√(k(1/m₁ + 1/m₂)); ``test_truth.py`` has an oscillator below it and above, which the extension is."""
    pair = sw.Springs([(0, 1)], stiffness=2.0, rest=1.0, masses=np.array([1.0, 3.0]), dim=1)
    assert pair.safe_step(method) == pytest.approx(sw.method(method).limit / math.sqrt(2.0 * (1 / 1.0 + 1 / 3.0)), rel=1e-14)


def test_a_damped_pair_decays_as_the_formula_says() -> None:
    """u'' = −k/μ·u − c/μ·u', 1/μ = 1/m₁ + 1/m₂: u = e^(−δt)·(cos ωt + δ/ω·sin ωt). RK4 errs by (Φ⁵/120)·(t/h) or less."""
    k, c, masses = 2.0, 0.3, np.array([1.0, 3.0])
    share = (1 / masses).sum()
    delta, h, steps = 0.5 * c * share, 0.01, 1000
    omega = math.sqrt(k * share - delta**2)
    pair = sw.Springs([(0, 1)], stiffness=k, rest=1.0, masses=masses, damping=c, dim=3)
    run = sw.integrate(pair, "rk4", v=0.0, y=[[0.0, 0, 0], [0.0, 1.2, 0]], dt=h, steps=steps, every=1)
    u = 0.2 * np.exp(-delta * run.t) * (np.cos(omega * run.t) + delta / omega * np.sin(omega * run.t))
    bound = 0.2 * steps * (math.sqrt(k * share) * h) ** 5 / 60 + 1e-12
    np.testing.assert_allclose(run.y[:, 1, 1] - run.y[:, 0, 1] - 1.0, u, rtol=0, atol=bound)


@looped("method", [m.name for m in sw.methods()])
def test_momentum_is_constant(method: str) -> None:
    """Both ends of a spring get the same force, but for rounding: springs × steps × stages roundings of forces up to 10·h."""
    # Verlet has velocities as differences of places, up to 10, whose roundings are divided by h.
    damped = not sw.method(method).needs_acceleration
    system, state = tangled(3, 12, 3, 40, damping=0.2 if damped else None)
    h, steps = 0.01, 300
    run = sw.integrate(system, method, **state, dt=h, steps=steps, every=steps, record="momentum")
    p = run.recorded["momentum"]
    carried = 12 * EPS * 10 / h if method == "verlet" else 0.0
    started = (system.masses[:, np.newaxis] * state["v"]).sum(axis=0)
    np.testing.assert_allclose(p[0], started, rtol=0, atol=12 * EPS * 10 + carried)
    np.testing.assert_allclose(p[-1], p[0], rtol=0, atol=steps * (40 * EPS * 10 * sw.method(method).evaluations + carried))
    fixed = sw.Springs(system.pairs, stiffness=system.stiffness, rest=system.rest, masses=system.masses, fixed=[0])
    other = sw.integrate(fixed, method, **state, dt=h, steps=steps, every=steps, record="momentum").recorded["momentum"]
    assert np.abs(other[-1] - other[0]).max() > 1e-3  # what holds a particle has the rest


@pytest.mark.filterwarnings("ignore:the run gained energy")  # that of Standard Euler
@looped("method", SYMPLECTIC)
def test_energy_stays_in_a_band(method: str) -> None:
    """Over 40 000 steps the band of the last quarter is that of the first, and shrinks with the order of the step."""
    pairs, layout = lattice(3, 3, diagonals=True)
    system = sw.Springs(pairs, stiffness=20.0, layout=layout, fixed=[0, 2], gravity=(0.0, 0.0, -1.0))
    h, order = 0.1 * system.safe_step("false_euler"), sw.method(method).order
    bands = []
    for part in (1, 2):
        run = sw.integrate(system, method, v=0.0, y=layout, dt=h / part, steps=40_000, every=7, record="energy")
        off = np.abs(run.recorded["energy"] - run.recorded["energy"][0])
        quarter = len(off) // 4
        assert off[-quarter:].max() < 2.0 * off[:quarter].max()
        bands.append(off.max())
    assert bands[0] / bands[1] > 2.0**order / 1.5
    standard = sw.integrate(system, "standard_euler", v=0.0, y=layout, dt=h, steps=2000, record="energy")
    assert abs(standard.recorded["energy"][-1]) > 10.0 * bands[0] or not np.isfinite(standard.recorded["energy"][-1])


def test_on_a_line_it_is_the_chain() -> None:
    """Displacements from rest of a chain between walls, to rounding: places go up to 8, differences of them have 8 eps, steps
    add."""
    n, h, steps = 7, 0.1, 400
    rng = np.random.default_rng(5)
    stiffness, mass, start = rng.uniform(0.5, 2.0, n + 1), rng.uniform(0.5, 2.0, n), 0.1 * rng.normal(size=n)
    rest = np.arange(n + 2.0)[:, np.newaxis]
    pairs = [(i, i + 1) for i in range(n + 1)]
    masses = np.concatenate([[1.0], mass, [1.0]])
    springs = sw.Springs(pairs, stiffness=stiffness, layout=rest, masses=masses, fixed=[0, n + 1])
    y = rest.copy()
    y[1:-1, 0] += start
    for method in ("false_euler", "rk4"):
        chain = sw.integrate(sw.Chain(n, stiffness=stiffness, mass=mass), method, v=0.0, y=start, dt=h, steps=steps, every=40)
        net = sw.integrate(springs, method, v=0.0, y=y, dt=h, steps=steps, every=40)
        np.testing.assert_allclose((net.y - rest)[:, 1:-1, 0], chain.y, rtol=0, atol=8 * EPS * 10 * steps)
        assert np.abs(chain.y[-1] - start).max() > 0.01


def hanging(springs: int, width: float, stiffness: float, rest: float, weight: float) -> Any:
    """Where a rope of equal springs and particles hangs between two points: each spring has the same horizontal force.

    The vertical one grows by the weight of a particle from spring to spring, so one number is unknown; it is bisected.
    """
    up = weight * (0.5 * (springs - 2) - np.arange(springs) + 0.5)  # from the middle

    def across(force: float) -> Any:
        pull = np.hypot(force, up)
        length = rest + pull / stiffness
        return np.stack([length * force / pull, -length * up / pull], axis=1)

    low, high = 1e-9, 10.0 * stiffness * width
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if across(middle)[:, 0].sum() > width else (middle, high)
    return np.concatenate([np.zeros((1, 2)), np.cumsum(across(low), axis=0)])


def test_a_rope_hangs_as_statics_say() -> None:
    """After 200 units of time under drag, which damps each mode by e^(−0.5·t) at least as far as it is not overdamped."""
    springs, width, mass, g = 12, 9.0, 0.1, 9.81
    wanted = hanging(springs, width, 50.0, 1.0, mass * g)
    np.testing.assert_allclose(wanted[-1], [width, 0.0], rtol=0, atol=1e-12)
    pairs = [(i, i + 1) for i in range(springs)]
    rope = sw.Springs(pairs, stiffness=50.0, rest=1.0, masses=mass, fixed=[0, springs], gravity=(0.0, -g), drag=0.1, damping=0.2)
    y = np.stack([np.linspace(0.0, width, springs + 1), np.zeros(springs + 1)], axis=1)
    run = sw.integrate(rope, "rk4", v=0.0, y=y, dt=0.5 * rope.safe_step("rk4"), steps=30_000, record="stretch")
    np.testing.assert_allclose(run.y[-1], wanted, rtol=0, atol=1e-11)
    assert np.abs(run.v[-1]).max() < 1e-11
    longest = np.linalg.norm(np.diff(wanted, axis=0), axis=1).max() - 1.0
    assert run.recorded["stretch"][-1] == pytest.approx(longest, abs=1e-11)


def test_what_is_fixed_is_led_at_its_velocity() -> None:
    net = sw.Springs([(0, 1), (1, 2)], rest=1.0, fixed=[0, 2], damping=0.1)
    v = np.array([[0.5, 0.0], [0.0, 0.0], [0.0, 0.0]])
    y = np.array([[0.0, 0.3], [1.0, 0.0], [2.0, -0.7]])
    for method in (m.name for m in sw.methods() if not m.needs_acceleration):
        run = sw.integrate(net, method, v=v, y=y, dt=0.25, steps=8)
        np.testing.assert_array_equal(run.v[-1][[0, 2]], v[[0, 2]])
        np.testing.assert_array_equal(run.y[-1][2], y[2])
        np.testing.assert_allclose(run.y[-1][0], [1.0, 0.3], rtol=0, atol=1e-13)


def test_particles_at_one_place_do_not_pull_each_other() -> None:
    """A spring of no length has no direction: no force, no NaN, by vectors as on a tape; a third particle moves them apart."""
    pairs, layout = lattice(20, 20)
    for net, n in ((sw.Springs([(0, 1)], rest=1.0, damping=0.5, dim=3), 2), (sw.Springs(pairs, layout=layout, damping=0.5), 400)):
        run = sw.integrate(net, "false_euler", v=0.0, y=np.ones((n, 3)), dt=0.1, steps=5)
        assert (run.y[-1] == 1.0).all()
        assert (run.v[-1] == 0.0).all()
    three = sw.Springs([(0, 1), (1, 2)], rest=1.0, dim=2)
    run = sw.integrate(three, "false_euler", v=0.0, y=[[0, 0], [0, 0], [3.0, 0]], dt=0.1, steps=5)
    assert np.isfinite(run.y).all()
    assert run.y[-1, 1, 0] > 0.1


def test_an_undamped_net_takes_energy_control_and_a_damped_one_does_not() -> None:
    for columns in (3, 20):  # on a tape, and by vectors
        pairs, layout = lattice(columns, columns, diagonals=True)
        options: dict[str, Any] = {"stiffness": 20.0, "layout": layout, "fixed": [0, columns - 1], "gravity": (0.0, 0.0, -1.0)}
        net = sw.Springs(pairs, **options)
        for way in ("scaling", "nacozy"):
            ask: dict[str, Any] = {"v": 0.0, "y": 1.01 * layout[..., None], "dt": 0.02, "steps": 50, "record": "energy"}
            run = assert_equal_ways(net, "standard_heun", **ask, control=sw.Projection(way), ways=("by the reference",))
            start = net.energy(np.zeros_like(layout), 1.01 * layout)
            assert run.recorded["energy"][-1] == pytest.approx(float(start), rel=1e-3)
    with pytest.raises(UnsupportedError, match="loses energy by its damping"):
        sw.integrate(sw.Springs(pairs, **options, damping=0.1), "rk4", v=0.0, y=layout, dt=0.1, steps=1, control=sw.Projection())


@looped(
    "arguments, error, message",
    [
        ({"pairs": []}, ShapeError, r"pairs: expected two whole numbers for each spring.*got shape \(0,\)"),
        ({"pairs": [(0, 1, 2)]}, ShapeError, r"pairs: .*got shape \(1, 3\)"),
        ({"pairs": [(0, 1.5)]}, DTypeError, "pairs: expected two whole numbers"),
        ({"pairs": [(0, -1)]}, ArgumentError, "pairs: .* from 0 on .* got -1"),
        ({"pairs": [(0, 1), (1, 1)]}, ArgumentError, "pairs: expected two different particles, got 1 twice in spring 1"),
        ({"pairs": [(0, 1), (1, 2), (1, 0)]}, ArgumentError, r"pairs: expected each pair of particles once, got \(0, 1\)"),
        ({"masses": [1.0, 1.0]}, ArgumentError, "pairs: expected particles below 2, .* got 2 in spring 1"),
        ({"layout": np.zeros((2, 3)), "rest": None}, ArgumentError, "pairs: expected particles below 2"),
        ({"layout": np.zeros((3, 2)), "masses": np.ones(4)}, ShapeError, r"masses: expected 3 particles \(or 1\)"),
        ({"masses": 0.0}, ArgumentError, "masses: expected numbers above zero"),
        ({"stiffness": -1.0}, ArgumentError, "stiffness: expected numbers of zero or more, got -1"),
        ({"stiffness": [1.0, 2.0, 3.0]}, ShapeError, r"stiffness: expected 2 springs \(or 1\) along the first axis, .* \(3,\)"),
        ({"rest": None}, ArgumentError, "rest: expected the lengths of the springs at rest, or layout="),
        ({"rest": -1.0}, ArgumentError, "rest: expected lengths of zero or more"),
        ({"rest": math.inf}, NotFiniteError, "rest: expected finite numbers"),
        ({"layout": np.zeros((3, 4)), "rest": None}, ShapeError, "layout: expected shape"),
        ({"layout": np.zeros((3, 3)), "dim": 2}, ShapeError, "expected one number of dimensions, got dim of 2, layout of 3"),
        ({"damping": -0.1}, ArgumentError, "damping: expected numbers of zero or more"),
        ({"drag": [0.1, 0.1]}, ShapeError, r"drag: expected 3 particles \(or 1\)"),
        ({"fixed": [3]}, ArgumentError, "fixed: expected particles below 3, .* got 3"),
        ({"fixed": [0, 1, 2]}, ArgumentError, "fixed: expected at least one particle that is free, got all 3"),
        ({"fixed": "0"}, DTypeError, "fixed: expected numbers of particles"),
        ({"gravity": [0.0, 0.0, 0.0, -9.81]}, ShapeError, "gravity: expected a number, or a vector of 1 to 3 numbers"),
        ({"dim": 4}, ArgumentError, "dim: expected 1 to 3|dim: expected"),
    ],
)
def test_wrong_arguments(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        sw.Springs(**{"pairs": [(0, 1), (1, 2)], "rest": 1.0} | arguments)


def test_wrong_states_and_uses() -> None:
    net, step = sw.Springs([(0, 1)], rest=1.0), {"v": 0.0, "y": np.eye(2), "dt": 0.1, "steps": 1}
    dragged = sw.Springs([(0, 1)], rest=1.0, drag=0.1)
    assert_raises(
        (lambda: sw.integrate(net, "rk4", **step | {"y": np.zeros((3, 2))}), ShapeError, r"y: .* shape \(2, 1 to 3, batch…\)"),
        (lambda: dragged.safe_step("leapfrog"), UnsupportedError, "leapfrog needs forces that .* the velocity.* has drag"),
        (lambda: net.safe_step("leapfrg"), UnknownNameError, "method: there is no 'leapfrg'"),
        (lambda: sw.integrate(net, "rk4", **step, form="matrix"), UnsupportedError, "matrix"),
    )
    assert sw.Springs([(0, 1)], rest=1.0, fixed=[0, 0]) == sw.Springs([(0, 1)], rest=1.0, fixed=[0])
