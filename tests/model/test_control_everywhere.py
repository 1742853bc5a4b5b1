"""Controls and projections beyond fixed steps of methods with stages: with a tolerance, by PEFRL, and when they overshoot."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.reference import adaptive
from stepwell.reference.acceptance import Acceptance
from support import own_systems as own
from support.cases import assert_same

ABLE = [m.name for m in sw.methods() if m.error_order is not None and not m.has_series]  # a series is not pushed within a step
CONTROLS: dict[str, Any] = {
    "limited": sw.EnergyControl(0.7),
    "printed": sw.EnergyControl(0.7, "printed", target=0.1),
    "scaling": sw.Projection(),
    "nacozy": sw.Projection("nacozy"),
}


def bodies(n: int, members: int = 3) -> tuple[sw.NBody, dict[str, Any]]:
    rng = np.random.default_rng(n)
    v, y = rng.normal(size=(2, n, 2, members))
    return sw.NBody(np.ones(n) / n, force="newton", softening=0.3), {"v": v, "y": y}


# ---- with a tolerance


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize(
    ("method", "n"),
    # The reference of an implicit step goes number by number.
    [(m, n) for m in ABLE for n in (2, 3, 6, 9, 20) if n < (3 if sw.method(m).is_implicit else 99)],
)
def test_adaptive_steps_keep_the_promises(method: str, n: int, control: str) -> None:
    """The same by both backends, alone and in a batch, in one piece and in two, on one tape and row by row; the work is told."""
    system, start = bodies(n)
    ask: dict[str, Any] = {"tolerance": 1e-5, "control": CONTROLS[control]}
    whole = sw.integrate(system, method, **start, at=[0.3, 0.7], **ask)
    reference = sw.integrate(system, method, **start, at=[0.3, 0.7], **ask, backend="numpy")
    assert_same(whole, reference)
    np.testing.assert_array_equal(whole.work, reference.work)  # type: ignore[arg-type]
    alone = sw.integrate(system, method, **{name: block[..., 1] for name, block in start.items()}, at=[0.3, 0.7], **ask)
    np.testing.assert_array_equal(alone.y, whole.y[..., 1])
    first = sw.integrate(system, method, **start, at=[0.3], **ask)
    rest = sw.integrate(system, method, at=[0.7], resume=first)
    np.testing.assert_array_equal(rest.y[-1], whole.y[-1])
    assert first.work is not None
    assert rest.work is not None
    # Sums of the same numbers in two pieces.
    assert first.work + rest.work == pytest.approx(whole.work, rel=1e-12, abs=1e-15)
    between = sw.integrate(system, method, **start, at=[0.1, 0.3, 0.31, 0.69, 0.7], **ask)
    np.testing.assert_array_equal(between.y[-1], whole.y[-1])
    if n < 6:
        fused = [sw.integrate(system, method, **start, at=[0.7], **ask, fused=True, backend=b) for b in ("rust", "numpy")]
        assert_same(*fused)


@pytest.mark.parametrize("method", ABLE)
@pytest.mark.parametrize("way", ["scaling", "nacozy"])
def test_a_projection_keeps_the_energy_of_every_saved_state(way: str, method: str) -> None:
    """Also at output times, which a step of their own reaches. Free the same tolerance lets it drift."""
    eight = sw.scenes.figure_eight()
    ask: dict[str, Any] = {"v": eight.v, "y": eight.y, "tolerance": 1e-4, "at": np.linspace(1.0, 30.0, 13)}
    run, free = (sw.integrate(eight.system, method, **ask, control=each) for each in (sw.Projection(way), None))
    # Scaling: a few roundings of sums of some ten numbers of size 1. Nacozy: the square of a step's energy error of some 1e-4.
    assert np.ptp(run.energy) < (1e-14 if way == "scaling" else 1e-7)
    assert np.ptp(free.energy) > 1e-5
    assert free.work is None
    # What the steps did to the energy the projections took back.
    assert run.work is not None
    assert abs(run.work) > 1e-6


@pytest.mark.parametrize("method", ABLE)
@pytest.mark.parametrize("form", ["limited", "printed"])
def test_the_energy_decays_as_it_should_with_a_tolerance(form: str, method: str) -> None:
    """dE/dt = −2CK·ΔE on a circle with K to 1e-3: over a time with 2CKt = 1 to 1/e.

    The limited form takes the step of the attempt: its rate is 1/(1 + 2hCK) of that, and 2CK = 1. With the step 1 to which
    systems are scaled for adaptive steps it would be half of it, e^−½.
    """
    v = np.array([[0.0, -0.5], [0.0, 0.5]]) * math.sqrt(1.001)
    y = np.array([[-0.5, 0.0], [0.5, 0.0]])
    system = sw.NBody([0.5, 0.5], force="newton")
    target = -0.125
    control = sw.EnergyControl(1.0 / (2.0 * 0.125), form, target=target)
    run = sw.integrate(system, method, v=v, y=y, tolerance=1e-9, at=[1.0], control=control)
    assert run.paces is not None
    step = 1.2 * float(run.paces.h) if form == "limited" else 0.0  # steps hardly change on a circle
    left = (run.energy[-1] - target) / (system.energy(v, y) - target)
    assert math.exp(-1.0) * (1.0 - 2e-3) < left < math.exp(-1.0 / (1.0 + step)) * (1.0 + 2e-3) < 0.55
    # The push counts alike in all stages, which have other weights in the result, and decays by a sixth within the longest steps.
    assert run.work == pytest.approx(run.energy[-1] - system.energy(v, y), rel=0.1)


@pytest.mark.parametrize("control", [sw.Control("energy", 0.5), sw.Control("energy", 0.5, "printed"), sw.Projection("energy")])
def test_invariants_of_own_systems_with_a_tolerance(control: Any) -> None:
    """The invariant of a pendulum, kept from where it starts, or approached; by both backends."""
    runs = [
        sw.integrate(
            own.pendulum(), "merson", v=0.0, y=[1.0, 2.0], tolerance=1e-4, at=[5.0, 20.0], control=control, backend=backend
        )
        for backend in ("rust", "numpy")
    ]
    assert_same(*runs)
    free = sw.integrate(own.pendulum(), "merson", v=0.0, y=[1.0, 2.0], tolerance=1e-4, at=[5.0, 20.0])
    start = own.pendulum().for_state_shapes(0.0, 0.0).energy(np.zeros(2), np.array([1.0, 2.0]))
    assert (abs(runs[0].energy - start).max() < 0.2 * abs(free.energy - start).max()).all()


def test_a_relative_gain_needs_a_step() -> None:
    system, start = bodies(3)
    with pytest.raises(UnsupportedError, match=r"tolerance: EnergyControl\(relative=.* give gain in place of relative"):
        sw.integrate(system, "merson", **start, tolerance=1e-3, at=[1.0], control=sw.EnergyControl(relative=0.1))
    with pytest.raises(UnsupportedError, match=r"tolerance: LengthControl.* relative to steps of fixed length"):
        sw.integrate(system, "merson", **start, tolerance=1e-3, at=[1.0], control=sw.LengthControl(0.5))


def test_a_constraint_of_its_own_is_kept_by_the_same_projection() -> None:
    """The reference of a system that projects onto its own constraint: accepted states are on it, rejected ones are not taken."""

    class Wheel:
        def dv(self, t: Any, v: Any, y: Any) -> Any:
            return -(v * v).sum(axis=0) * y

        def dy(self, t: Any, v: Any, y: Any) -> Any:
            return v

        def project(self, v: Any, y: Any) -> Any:
            y = y / np.sqrt((y * y).sum(axis=0))
            return v - (v * y).sum(axis=0) * y, y

    merson: Any = sw.method("merson").steps
    v, y = np.array([0.0, 1.0]), np.array([1.0, 0.0])
    samples = math.inf, -math.inf
    pace = adaptive.begin(Wheel(), adaptive.waiting(0.0, 0.5, (1e-3, 0.0, 1.0), samples), v, y, (1, 1))
    pace = pace._replace(target=np.array(10.0))
    system = adaptive.Attempted(Wheel())
    tried = 0
    while pace.t < 9.0:
        before = y
        pace, v, y = adaptive.attempt(merson, system, 5, (1, 1), Acceptance(), pace, 1000, v, y)
        tried += 1
        assert np.hypot(*y) == pytest.approx(1.0, abs=1e-15)
        assert v @ y == pytest.approx(0.0, abs=1e-15)
        assert (before == y).all() == (float(pace.accepted + pace.rejected) == tried and float(pace.error) > 1.0)
    assert pace.work == 0.0
    assert math.atan2(y[1], y[0]) == pytest.approx(math.remainder(float(pace.t), 2 * math.pi), abs=0.02)


# ---- PEFRL


def test_pefrl_pushes_between_steps() -> None:
    """One step by hand: the free step, and then v less g·v, with g of the energies where it ends."""
    system, start = bodies(3, 1)
    v, y = start["v"][..., 0], start["y"][..., 0]
    target, h, gain = 0.3, 0.05, 0.9
    free = sw.integrate(system, "pefrl", v=v, y=y, dt=h, steps=1)
    energy, kinetic = system.energy(free.v[-1], free.y[-1]), system.kinetic(free.v[-1])
    control = sw.EnergyControl(gain, target=target)
    for form, g in (
        ("printed", h * gain * (energy - target)),
        ("limited", 1.0 - math.sqrt(1.0 - 2 * h * gain * (energy - target) / (1.0 + 2 * h * gain * kinetic))),
    ):
        control = sw.EnergyControl(gain, form, target=target)
        run = sw.integrate(system, "pefrl", v=v, y=y, dt=h, steps=1, control=control)
        np.testing.assert_array_equal(run.y, free.y)
        np.testing.assert_allclose(run.v, (1.0 - g) * free.v, rtol=1e-14)
        assert run.work == pytest.approx(((1.0 - g) ** 2 - 1.0) * kinetic, rel=1e-12)
    assert not control.between  # the control that was given is not changed


def test_pefrl_keeps_its_order_under_control() -> None:
    """A control at the energy of the start pushes by what the step erred, h⁵, and not by the h of stages with v and y apart."""
    eight = sw.scenes.figure_eight()
    errors = []
    for steps in (200, 400):
        run = eight.run("pefrl", eight.period / steps, steps=steps, control=sw.EnergyControl(1.0))
        errors.append(eight.state_error(run)[-1])
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.4)


def test_a_control_is_that_of_the_method_that_goes_on() -> None:
    """By PEFRL between steps, by Runge-Kutta 4 in its stages, also where one goes on from the other."""
    system, start = bodies(3)
    first = sw.integrate(system, "pefrl", **start, dt=0.01, steps=5, control=sw.EnergyControl(0.5))
    rest = sw.integrate(system, "rk4", steps=5, resume=first)
    control = sw.EnergyControl(0.5, target=first.system.keeper.target)  # type: ignore[union-attr]
    anew = sw.integrate(system, "rk4", v=first.v[-1], y=first.y[-1], dt=0.01, t0=0.0, start_step=5, steps=5, control=control)
    np.testing.assert_array_equal(rest.y, anew.y)


def test_a_world_and_an_explanation_of_pefrl_under_control() -> None:
    system, start = bodies(3)
    control = sw.EnergyControl(0.5, target=0.2)
    run = sw.integrate(system, "pefrl", **start, dt=0.01, steps=7, control=control)
    world = sw.World(system, "pefrl", v=start["v"].copy(), y=start["y"].copy(), dt=0.01, control=control)
    world.step(7)
    np.testing.assert_array_equal(world.y, run.y[-1])
    assert "work" in str(sw.explain(system.for_state_shapes(start["v"], start["y"]), "pefrl", control=control).listing)


# ---- when h·C·K passes 1


def test_a_control_that_begins_to_overshoot_is_told_of_when_it_does() -> None:
    """On an ellipse of e = 0.9 K is 9.5 where the bodies are nearest and 0.026 where they begin: h·C·K passes 1 on the way."""
    system = sw.NBody([1.0, 0.0], force="newton")
    v, y = np.array([[0.0, 0.0], [0.0, math.sqrt(1.0 / 19.0)]]), np.array([[0.0, 0.0], [1.9, 0.0]])
    system = sw.NBody([1.0, 1e-9], force="newton")
    kinetic = 0.5e-9 * v[1, 1] ** 2
    gain = 0.02 / (0.001 * kinetic)
    options: dict[str, Any] = {"v": v, "y": y, "dt": 0.001, "steps": 3300, "control": sw.EnergyControl(gain, "printed")}
    whole = sw.integrate(system, "rk4", **options | {"control": sw.EnergyControl(0.0)}, every=1)
    strength = 0.001 * gain * np.array([system.kinetic(state) for state in whole.v])
    first = int(np.argmax(strength >= 1.0))
    assert 0 < first < 3200
    options["steps"] = first + 20
    for every in (None, 10):
        with pytest.warns(sw.ControlWarning, match=re.escape("gain: h·C·K = 1")) as warned:
            sw.integrate(system, "rk4", **options, every=every)
        # The control has hardly changed the orbit by then.
        step = int(re.search(r"at step (\d+)", str(warned[0].message))[1])  # type: ignore[index]
        assert abs(step - first) <= 3
    sw.integrate(system, "rk4", **options | {"steps": first - 20}, every=10)  # no warning, which would be an error
    sw.integrate(system, "rk4", **options | {"control": sw.EnergyControl(gain)}, every=10)  # nor in the limited form


def test_what_is_refused_names_what_to_do() -> None:
    system, start = bodies(3)
    with pytest.raises(UnsupportedError, match="control: leapfrog carries v_half in place of v"):
        sw.integrate(system, "leapfrog", **start, dt=0.1, steps=1, control=sw.Projection())
    with pytest.raises(UnsupportedError, match="pefrl needs a second-order system"):
        sw.integrate(own.pendulum(), "pefrl", v=0.0, y=1.0, dt=0.1, steps=1, control=sw.Control("energy", 1.0))
    run = sw.integrate(own.pendulum(), "pefrl", v=0.0, y=1.0, dt=0.1, steps=300, every=1, control=sw.Projection("energy"))
    assert np.ptp(run.energy) < 1e-9
    with pytest.raises(ArgumentError, match="control"):
        sw.integrate(own.pendulum(), "merson", v=0.0, y=1.0, tolerance=1e-3, at=[1.0], control=sw.Projection("momentum"))


# ---- at rest


def _one_place(n: int) -> tuple[sw.NBody, dict[str, Any]]:
    return sw.NBody(np.ones(n), force="newton", softening=0.1), {"v": np.zeros((n, 2)), "y": np.ones((n, 2))}


AT_REST: dict[str, tuple[Any, dict[str, Any], str]] = {
    "own pendulum": (own.pendulum(), {"v": 0.0, "y": 0.0}, "energy"),
    "aircraft": (sw.Aircraft(), {"v": np.zeros(3), "y": np.zeros(3)}, "energy"),
    "springs": (sw.Springs([(0, 1)], rest=1.0), {"v": np.zeros((2, 2)), "y": np.array([[0.0, 0.0], [1.0, 0.0]])}, "nacozy"),
    "bodies, scaled": (*_one_place(3), "scaling"),
    "bodies": (*_one_place(3), "nacozy"),
    "bodies, row by row, scaled": (*_one_place(40), "scaling"),
    "bodies, row by row": (*_one_place(40), "nacozy"),
}


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("case", AT_REST)
def test_a_projection_leaves_a_state_at_rest_as_it_is(case: str, fixed: bool) -> None:
    """No velocity to scale and no gradient to go along: 0/0. Nothing is added, also where the target is out of reach.

    With a tolerance no step from rest is longer than a 32nd of the time so far: there are a hundred to 2e-4.
    """
    system, start, way = AT_REST[case]
    ask: dict[str, Any] = {"dt": 0.1, "steps": 20} if fixed else {"tolerance": 1e-5, "at": [1e-4, 2e-4]}
    reach = float(np.asarray(sw.integrate(system, "rk4", **start, dt=0.1, steps=1, control=sw.Projection(way)).energy)[-1])
    for target in (None, reach + 1.0):
        control = sw.Projection(way, target=target)
        for backend in ("rust", "numpy"):
            run = sw.integrate(system, "rk4" if fixed else "merson", **start, **ask, control=control, backend=backend)
            assert not np.any(run.status)
            np.testing.assert_array_equal(run.y[-1], start["y"])
            np.testing.assert_array_equal(run.v[-1], start["v"])
            assert run.work == 0.0


def test_members_at_rest_leave_the_others_as_they_are() -> None:
    options: dict[str, Any] = {"dt": 0.1, "steps": 50, "control": sw.Projection("energy")}
    alone = sw.integrate(own.pendulum(), "false_heun", v=0.0, y=1.0, **options)
    both = sw.integrate(own.pendulum(), "false_heun", v=0.0, y=[0.0, 1.0], **options)
    assert both.y[-1, 0] == 0.0
    assert both.y[-1, 1] == alone.y[-1]
