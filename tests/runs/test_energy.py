"""The energy of every system: recorded by the core in every kind of run, it has the bits of the reference's formula."""

from __future__ import annotations

import importlib
import inspect
import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import UnsupportedError
from stepwell.reference.traced import Tracer
from support import families
from support.cases import SYSTEMS, drawn, fits
from support.families import family
from support.graphs import assert_one_graph, model
from support.tracing import METHODS, made

pytestmark = pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning", "ignore::stepwell.DivergenceWarning")

#: Cases of systems with an energy, and the kinds that have one.
ENERGETIC = [name for name in SYSTEMS if "energy" in made(name)[0].quantities]
KINDS = {
    "Aircraft", "Chain", "NBody", "Oscillator", "Particles", "Pendulum", "Pendulum3D", "RestrictedThreeBody", "RigidBody", "Rods",
    "Springs",
}  # fmt: skip
#: Kinds whose energy is that of a step, divided by its length: at another length it may differ in its last bit.
OF_A_STEP = ("nbody", "springs")


def alternating(*values: Any) -> list[Any]:
    """Parameters: each system with one of the values, in turns; in the long run with the others."""
    pairs = itertools.product(ENERGETIC, values)
    return family(pairs, lambda name, value: values.index(value) == ENERGETIC.index(name) % len(values))


def of_state(system: sw.System, run: sw.Run) -> Any:
    """The energies of the saved states by the system's own function, one after the other."""
    states = zip(np.asarray(run.v, np.float64), np.asarray(run.y, np.float64), strict=True)
    return np.stack([system.energy(v, y) for v, y in states])


def assert_energy(system: sw.System, run: sw.Run, plain: sw.Run) -> None:
    """What was recorded is the energy of the saved states: as asked for later, and by the system."""
    recorded = run.recorded["energy"]
    assert recorded.dtype == np.float64
    assert recorded.shape == run.t.shape[:1] + run.status.shape
    np.testing.assert_array_equal(recorded, plain.energy)
    if system.kernel in OF_A_STEP:
        np.testing.assert_allclose(recorded, of_state(system, run), rtol=1e-13, atol=1e-13)
    else:
        np.testing.assert_array_equal(recorded, of_state(system, run))


def test_systems_have_an_energy_or_say_that_they_have_none() -> None:
    assert {type(made(name)[0]).__name__ for name in ENERGETIC} >= KINDS
    for name in SYSTEMS:
        system, v, y = made(name)
        if name not in ENERGETIC:
            with pytest.raises(UnsupportedError, match=r"^energy: .* has no (energy of its own|invariant of that name)"):
                system.energy(v, y)


@pytest.mark.parametrize("name", ENERGETIC)
def test_fixed_steps(name: str) -> None:
    system, v, y = made(name)
    options: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 4, "every": 3}
    explicit = [method for method in METHODS if fits(system, method) and (families.LONG or not method.is_implicit)]
    for method in drawn(explicit, 1, "energy", name):
        core = with_reference(system, method, **options)
        assert_energy(system, core, sw.integrate(system, method, **options))


def with_reference(system: sw.System, method: Any, **options: Any) -> sw.Run:
    """The run by the core, of the energies of the reference."""
    core, reference = (sw.integrate(system, method, record="energy", backend=by, **options) for by in ("rust", "numpy"))
    np.testing.assert_array_equal(core.recorded["energy"], reference.recorded["energy"])
    return core


OTHERS: dict[str, dict[str, Any]] = {
    "adaptive": {"tolerance": 1e-5, "at": [0.05, 0.1]},
    "float32": {"dt": 0.01, "steps": 4, "every": 2, "dtype": "float32"},
}


@pytest.mark.parametrize(("name", "other"), alternating(*OTHERS))
def test_adaptive_steps_and_float32(name: str, other: str) -> None:
    """It is the energy of the states as they were saved, in float64."""
    system, v, y = made(name)
    options = {"v": v, "y": y} | OTHERS[other]
    try:
        plain = sw.integrate(system, "merson", **options)
    except (UnsupportedError, sw.errors.ArgumentError):
        pytest.skip("not with adaptive steps, or not in float32")
    run = with_reference(system, "merson", **options)
    np.testing.assert_array_equal(run.recorded["energy"], plain.energy)
    if system.kernel not in OF_A_STEP:
        np.testing.assert_array_equal(run.recorded["energy"], of_state(system, run))


LARGE = {
    "chain": lambda batch: sw.Chain(2000, stiffness=np.linspace(1.0, 2.0, 2001).reshape(2001, *batch)),
    "chain of members": lambda batch: sw.Chain(1500, mass=np.linspace(1.0, 2.0, 7500).reshape(1500, 5)),
    "particles": lambda batch: sw.Particles(np.linspace(1.0, 2.0, 3000), drag=0.1, gravity=(0.1, -1.0)),
}


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("name", LARGE)
def test_systems_whose_step_is_too_long_for_a_tape(name: str, threads: int) -> None:
    system = LARGE[name](())
    rng = np.random.default_rng(3)
    v, y = (rng.normal(size=(*shape, *system.batch)) for shape in (system.v_shape, system.y_shape))
    options: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 4, "every": 2, "threads": threads}
    core = with_reference(system, "rk4", **options)
    plain = sw.integrate(system, "rk4", **options)
    assert_energy(system, core, plain)
    np.testing.assert_array_equal(core.y, plain.y)


@pytest.mark.parametrize("threads", [1, 2])
def test_members_of_many_groups(threads: int) -> None:
    """More members than a tile has, a number that fills none, over several threads."""
    rng = np.random.default_rng(5)
    system = sw.Oscillator(rng.uniform(0.5, 2.0, (7, 1501)), form="physical")
    options: dict[str, Any] = {"v": rng.normal(size=(7, 1501)), "y": 1.0, "dt": 0.01, "steps": 300, "every": 150}
    assert_energy(system, with_reference(system, "verlet", threads=threads, **options), sw.integrate(system, "verlet", **options))


def test_sweeps_reduce_the_same_energies() -> None:
    mu = np.array([0.1, 0.2, 0.3])
    options: dict[str, Any] = {"v": np.array([0.0, 0.5]), "y": np.array([0.5, 0.0]), "dt": 0.01, "steps": 50}
    reduced = [sw.sweeps.Extremes("energy")]
    swept = sw.sweep(sw.RestrictedThreeBody, {"mu": mu}, "rk4", outcomes=reduced, observe=10, **options)
    options |= {name: np.repeat(options[name][:, np.newaxis], 3, axis=1) for name in "vy"}
    run = sw.integrate(sw.RestrictedThreeBody(mu), "rk4", record="energy", every=10, **options)
    np.testing.assert_array_equal(swept["energy_max"], run.recorded["energy"].max(axis=0))
    np.testing.assert_array_equal(swept["energy_min"], run.recorded["energy"].min(axis=0))


#: kernel, case, what to replace in the reference's formula, and by what: another order of operations, or another formula.
MUTANTS = [
    ("oscillator", "free", "v * v + spring", "v * v - spring"),
    ("oscillator", "free, physical", "s.square * (y * y)", "(s.square * y) * y"),
    ("pendulum", "pendulum", "(2.0 * s.square) * (half * half)", "2.0 * (s.square * (half * half))"),
    ("pendulum", "pendulum", "0.5 * y", "y"),
    ("chain", "chain of nineteen", "s.stiffness * stretches * stretches", "stretches * stretches"),
    ("chain", "chain of nineteen", "total(s.mass * v * v)", "(s.mass * v * v).sum(axis=0)"),
    ("pendulum_3d", "pendulum in space", "s.gravity * y[2]", "s.gravity * y[1]"),
    ("restricted_three_body", "restricted three bodies", "(y[0] - 1.0) + s.mu", "y[0] - (1.0 - s.mu)"),
    ("restricted_three_body", "restricted three bodies", "- pull\n", "+ pull\n"),
    ("particles", "particles", "0.5 * square(v) - along", "0.5 * square(v) + along"),
    ("rods", "rods, two hanging", "s.gravity * place[-1]", "s.gravity * place[0]"),
    ("rigid_body", "top, free", "0.5 * (", "("),
    ("rigid_body", "top, heavy", "whole + weight * height", "whole - weight * height"),
    ("nbody", "three bodies", "[2] / s.h", "[1] / s.h"),
    ("springs", "springs: a triangle", "[2] / s.h", "[1] / s.h"),
]


@pytest.mark.mutant
@pytest.mark.parametrize(("kernel", "case", "old", "new"), MUTANTS)
def test_another_formula_is_noticed(kernel: str, case: str, old: str, new: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module: Any = importlib.import_module(f"stepwell.reference.systems.{kernel}")
    system, _, _ = made(case)
    assert system.kernel == kernel
    source = inspect.getsource(module.energy)
    assert source.count(old) == 1
    scope = dict(vars(module))
    exec(compile(source.replace(old, new), module.__file__, "exec"), scope)

    def compared() -> None:
        tape = _core.Tape()
        core = tape.trace(model(system, sw.method("false_euler")), "record energy")
        numbers = int(np.prod(system.v_shape)) + int(np.prod(system.y_shape))
        assert_one_graph(tape, core[numbers:], Tracer(system, tape).record(["energy"]))

    compared()
    quantities = system.reference.quantities
    monkeypatch.setitem(quantities, "energy", quantities["energy"]._replace(of=scope["energy"]))
    with pytest.raises(pytest.fail.Exception, match=r"the core has .* where the reference has"):
        compared()


def test_every_kind_with_an_energy_has_a_mutant() -> None:
    kernels = {made(name)[0].kernel for name in ENERGETIC} - {"equations"}
    assert {kernel for kernel, *_ in MUTANTS} == kernels


@pytest.mark.parametrize("where", ["together", "far", "nowhere"])
def test_bodies_without_a_distance_have_no_energy(where: str) -> None:
    """Two in one place, so far away that the square of a distance is infinite, or at no place: no number is recorded."""
    steps = 400 if where == "nowhere" else 1
    for n, force, backend in itertools.product((2, 3, 12, 100), ("logarithmic", "newton", "printed"), ("rust", "numpy")):
        if where == "nowhere" and backend == "numpy" and n > 3:
            continue  # it takes long
        v, y = np.zeros((n, 2)), np.random.default_rng(n).normal(size=(n, 2))
        y[1] = {"together": y[0], "far": 1e200, "nowhere": y[1]}[where]
        v[1] = 1e308 if where == "nowhere" else 0.0
        options: dict[str, Any] = {"v": v, "y": y, "dt": 1.0, "steps": steps, "every": steps, "record": "energy"}
        run = sw.integrate(sw.NBody(np.ones(n), force=force), "euler", **options, backend=backend)
        # The printed potential is −1/r, found from 1/r²: that is 0 where r² is infinite, as it should be.
        vanishes = where == "far" and force == "printed"
        assert np.isfinite(run.recorded["energy"][-1 if where == "nowhere" else 0]) == vanishes, (n, force, backend)
