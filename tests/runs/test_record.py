"""What is recorded beside the states, and what a control did: equal to the reference, true, and at hand when asked for."""

import contextlib
import importlib
import inspect
import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, DivergenceWarning, UnsupportedError
from stepwell.reference.traced import Tracer
from support import families
from support.cases import SYSTEMS, drawn, fits
from support.graphs import assert_one_graph, model
from support.refusals import refused
from support.tracing import METHODS, made

NAMES = ("energy", "momentum", "angular_momentum", "closest")
FORCES = ("logarithmic", "newton", "printed")


def bodies(n: int, dim: int, force: str, batch: int | None) -> tuple[sw.NBody, dict[str, Any]]:
    """Bodies that do not meet in the time of these tests."""
    rng = np.random.default_rng(n * dim)
    shape = (n, dim) if batch is None else (n, dim, batch)
    masses = rng.uniform(0.5, 1.5, shape[:1] + shape[2:]) / n
    return sw.NBody(masses, force=force, softening=0.1), {"v": 0.3 * rng.normal(size=shape), "y": rng.normal(size=shape)}


CONTROLS = {
    "free": None,
    "limited": sw.EnergyControl(0.7, target=-0.3),
    "printed": sw.EnergyControl(0.3, "printed", target=-0.3),
    "scaling": sw.Projection("scaling", target=-0.3),
    "nacozy": sw.Projection("nacozy", target=-0.3),
}


SIZES = [(1, 2, None), (2, 3, 5), (3, 2, None), (3, 3, 9), (5, 2, 11), (20, 3, None), (37, 2, 3)]


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize(("n", "dim", "batch"), SIZES)
def test_equals_the_reference(n: int, dim: int, batch: int | None, control: str) -> None:
    """Under every force in turns; and recording changes no bit: forces kept from a recorded state are those of the step."""
    force = FORCES[(SIZES.index((n, dim, batch)) + list(CONTROLS).index(control)) % 3]
    system, state = bodies(n, dim, force, batch)
    ask: dict[str, Any] = {"dt": 0.01, "steps": 7, "every": 2, "control": CONTROLS[control]} | state
    for method in ("standard_euler", "rk4") if control != "free" else ("standard_heun", "leapfrog", "verlet"):
        core, reference = (sw.integrate(system, method, backend=backend, record=NAMES, **ask) for backend in ("rust", "numpy"))
        plain = sw.integrate(system, method, **ask)
        assert set(core.recorded) == set(NAMES)
        for name in NAMES:
            assert np.array_equal(core.recorded[name], reference.recorded[name]), (method, name)
        assert (core.v.tobytes(), core.y.tobytes()) == (plain.v.tobytes(), plain.y.tobytes()), method
        for run in (core, reference, plain):
            assert (run.work is None) == (control == "free")
            assert control == "free" or np.array_equal(run.work, core.work), method


@pytest.mark.parametrize("dim", [2, 3])
def test_they_are_what_they_are_called(dim: int) -> None:
    """Against sums spelled out here."""
    system, state = bodies(6, dim, "newton", None)
    run = sw.integrate(system, "rk4", dt=0.01, steps=10, every=5, record=NAMES, **state)
    m = system.masses
    for i in range(len(run.t)):
        v, y = run.v[i], run.y[i]
        pairs = [(a, b) for a in range(6) for b in range(a)]
        distance = {(a, b): np.linalg.norm(y[a] - y[b]) for a, b in pairs}
        energy = 0.5 * (m * (v**2).sum(axis=1)).sum() - sum(m[a] * m[b] / np.sqrt(distance[a, b] ** 2 + 0.01) for a, b in pairs)
        assert run.recorded["energy"][i] == pytest.approx(energy, rel=1e-13)
        assert run.recorded["momentum"][i] == pytest.approx((m[:, None] * v).sum(axis=0), rel=1e-13, abs=1e-15)
        spin = (m[:, None] * np.cross(np.pad(y, ((0, 0), (0, 3 - dim))), np.pad(v, ((0, 0), (0, 3 - dim))))).sum(axis=0)
        assert run.recorded["angular_momentum"][i] == pytest.approx(spin if dim == 3 else spin[2], rel=1e-13, abs=1e-15)
        assert run.recorded["closest"][i] == pytest.approx(min(distance.values()), rel=1e-14)
    assert run.energy is run.recorded["energy"]
    later = sw.integrate(system, "rk4", dt=0.01, steps=10, every=5, **state)
    assert np.array_equal(later.energy, run.energy)  # computed when asked for, or recorded: the same bits


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")  # alone the others do meet
def test_a_diverged_member_keeps_to_itself() -> None:
    """Its numbers are not finite from some saved state on; those of its neighbours, and what their control did, are as alone."""
    system = sw.NBody([1.0, 1.0, 1.0, 1.0], force="newton")
    y = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])[..., np.newaxis] * np.ones(9)
    y[1, :, 4] = y[0, :, 4]  # two bodies in one place
    ask: dict[str, Any] = {"v": 0.1, "dt": 0.01, "steps": 2000, "every": 500, "record": NAMES}
    ask["control"] = sw.EnergyControl(0.5, target=-4.0)
    with pytest.warns(DivergenceWarning):
        run = sw.integrate(system, "false_euler", y=y, **ask)
    alone = sw.integrate(system, "false_euler", y=y[..., 0], **ask)
    assert run.work is not None
    assert np.isnan(run.work[4])
    for member in (0, 3, 5, 8):
        assert run.work[member] == alone.work
        assert np.array_equal(run.recorded["energy"][..., member], alone.recorded["energy"])
    assert np.isnan(run.recorded["energy"][-1, 4])


def test_work_is_the_energy_that_the_control_gave() -> None:
    """Energy at the end = at the start + what the method makes of it (seen from the free run's drift) + work of the control.

    With small steps the method's own drift is O(h) in Standard Euler and as much with control as without: the orbits are the
    same to O(h). What is left is of second order, so halving the step quarters it.
    """
    scene = sw.scenes.energy_control()

    def left(dt: float) -> float:
        steps = round(2.0 / dt)
        ask: dict[str, Any] = {"v": scene.v, "y": scene.y, "dt": dt, "steps": steps, "every": steps, "record": ["energy"]}
        controlled = sw.integrate(scene.system, "standard_euler", control=sw.EnergyControl(0.2), **ask)
        free = sw.integrate(scene.system, "standard_euler", **ask)
        drift = free.recorded["energy"][-1] - free.recorded["energy"][0]
        assert controlled.work is not None
        assert controlled.work < 0 < drift  # Standard Euler gains energy, and the control takes it
        return abs(float(controlled.recorded["energy"][-1] - controlled.recorded["energy"][0] - drift - controlled.work))

    coarse, fine = left(1e-3), left(5e-4)
    assert coarse < 0.05
    assert 3.0 < coarse / fine < 5.0


def test_projection_works_against_the_drift() -> None:
    """All of it: the energy at the end is that of the start, so the work is minus the sum of what every step added."""
    system, state = bodies(5, 2, "newton", None)
    ask: dict[str, Any] = {"dt": 1e-3, "steps": 1, "record": "energy", "every": 1} | state
    run, free = (sw.integrate(system, "standard_euler", control=control, **ask) for control in (sw.Projection(), None))
    gained = np.diff(free.recorded["energy"]).item()
    assert float(run.work) == pytest.approx(-gained, rel=1e-9)  # type: ignore[arg-type]
    assert run.recorded["energy"][1] == pytest.approx(run.recorded["energy"][0], rel=1e-14)


def test_what_is_not_there_is_refused_before_any_work() -> None:
    for system, record, message in (
        (sw.NBody(), "speed", "record: .*'speed'"),
        (sw.Oscillator(1.0), ("momentum",), "record: .*'momentum'"),
        (sw.LinearSystem([[0.0, -1.0], [1.0, 0.0]]), "energy", "has no energy"),
    ):
        with pytest.raises((ValueError, UnsupportedError), match=message):
            sw.integrate(system, "rk4", v=0.0, y=0.0, dt=0.1, steps=3, record=record)


pytestmark = pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning", "ignore::stepwell.DivergenceWarning")

#: Cases of systems with an energy, and the kinds that have one.
ENERGETIC = [name for name in SYSTEMS if "energy" in made(name)[0].quantities]
KINDS = {
    "Aircraft", "Chain", "NBody", "Oscillator", "Particles", "Pendulum", "Pendulum3D", "RestrictedThreeBody", "RigidBody", "Rods",
    "Springs",
}  # fmt: skip


def of_state(system: sw.System, run: sw.Run) -> Any:
    """The energies of the saved states by the system's own function, one after the other."""
    states = zip(np.asarray(run.v, np.float64), np.asarray(run.y, np.float64), strict=True)
    return np.stack([system.energy(v, y) for v, y in states])


def test_systems_have_an_energy_or_say_that_they_have_none() -> None:
    assert {type(made(name)[0]).__name__ for name in ENERGETIC} >= KINDS
    for name in SYSTEMS:
        system, v, y = made(name)
        if name not in ENERGETIC:
            refused(UnsupportedError, r"^energy: .* has no (energy of its own|invariant of that name)", system.energy, v, y)


#: Kinds whose energy is that of a step, divided by its length: at another length it may differ in its last bit.
OF_A_STEP = ("nbody", "springs")


def assert_energy(system: sw.System, method: Any, **options: Any) -> None:
    """What is recorded is the energy of the states as they were saved, in float64: as asked for later, and by the system."""
    run, plain = (sw.integrate(system, method, record=record, **options) for record in ("energy", None))
    recorded = run.recorded["energy"]
    assert (recorded.dtype, recorded.shape) == (np.float64, run.t.shape[:1] + run.status.shape)
    np.testing.assert_array_equal(recorded, plain.energy)
    np.testing.assert_array_equal(run.y, plain.y)
    if system.kernel in OF_A_STEP:
        np.testing.assert_allclose(recorded, of_state(system, run), rtol=1e-13, atol=1e-13)
    else:
        np.testing.assert_array_equal(recorded, of_state(system, run))


@pytest.mark.parametrize("name", ENERGETIC)
def test_it_is_the_energy_of_the_saved_states(name: str) -> None:
    system, v, y = made(name)
    fixed: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 4, "every": 3}
    explicit = [method for method in METHODS if fits(system, method) and (families.LONG or not method.is_implicit)]
    for method in drawn(explicit, 1, "energy", name):
        assert_energy(system, method, **fixed)
    paced: dict[str, Any] = {"v": v, "y": y, "tolerance": 1e-5, "at": [0.05, 0.1]}
    for options in (paced, fixed | {"dtype": "float32"}):
        with contextlib.suppress(UnsupportedError, ArgumentError):  # not with adaptive steps, or not in float32
            assert_energy(system, "merson", **options)


LARGE = {
    "chain": lambda batch: sw.Chain(2000, stiffness=np.linspace(1.0, 2.0, 2001).reshape(2001, *batch)),
    "chain of members": lambda batch: sw.Chain(1500, mass=np.linspace(1.0, 2.0, 7500).reshape(1500, 5)),
    "particles": lambda batch: sw.Particles(np.linspace(1.0, 2.0, 3000), drag=0.1, gravity=(0.1, -1.0)),
}


@pytest.mark.parametrize("name", LARGE)
def test_systems_whose_step_is_too_long_for_a_tape(name: str) -> None:
    system = LARGE[name](())
    v, y = (np.random.default_rng(3).normal(size=(*shape, *system.batch)) for shape in (system.v_shape, system.y_shape))
    options: dict[str, Any] = {"v": v, "y": y, "dt": 0.01, "steps": 4, "every": 2}
    for threads in (1, 2):
        assert_energy(system, "rk4", threads=threads, **options)
    runs = [sw.integrate(system, "rk4", record="energy", backend=backend, **options) for backend in ("rust", "numpy")]
    np.testing.assert_array_equal(*(run.recorded["energy"] for run in runs))


def test_sweeps_reduce_the_same_energies() -> None:
    mu, options = np.array([0.1, 0.2, 0.3]), {"dt": 0.01, "steps": 50}
    start = {"v": np.array([[0.0], [0.5]]), "y": np.array([[0.5], [0.0]])}
    one = {name: each[:, 0] for name, each in start.items()}
    swept = sw.sweep(
        sw.RestrictedThreeBody, {"mu": mu}, "rk4", outcomes=[sw.sweeps.Extremes("energy")], observe=10, **one, **options
    )
    run = sw.integrate(sw.RestrictedThreeBody(mu), "rk4", record="energy", every=10, **start, **options)
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
    ("springs", "springs: a triangle", "[1] / s.h", "[0] / s.h"),
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
    refused(pytest.fail.Exception, r"the core has .* where the reference has", compared)


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
