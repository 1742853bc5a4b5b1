"""What is recorded beside the states, and what a control did: equal to the reference, true, and at hand when asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import DivergenceWarning, UnsupportedError

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
    run = sw.integrate(system, "standard_euler", dt=1e-3, steps=1, record="energy", every=1, control=sw.Projection(), **state)
    free = sw.integrate(system, "standard_euler", dt=1e-3, steps=1, record="energy", every=1, **state)
    gained = free.recorded["energy"][1] - free.recorded["energy"][0]
    assert run.work is not None
    assert float(run.work) == pytest.approx(-float(gained), rel=1e-9)
    assert run.recorded["energy"][1] == pytest.approx(run.recorded["energy"][0], rel=1e-14)


def test_what_is_not_there_is_refused_before_any_work() -> None:
    for system, record, message in (
        (sw.NBody(), "speed", "record: .*'speed'"),
        (sw.Oscillator(1.0), ("momentum",), "record: .*'momentum'"),
        (sw.LinearSystem([[0.0, -1.0], [1.0, 0.0]]), "energy", "has no energy"),
    ):
        with pytest.raises((ValueError, UnsupportedError), match=message):
            sw.integrate(system, "rk4", v=0.0, y=0.0, dt=0.1, steps=3, record=record)
