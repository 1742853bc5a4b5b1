"""What could be misread without a word: it is refused, or warned of."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError
from stepwell.runs import diagnostics

START: dict[str, Any] = {"v": 0.0, "y": 1.0}
FIXED = START | {"dt": 0.1, "steps": 10}


def test_a_list_as_tolerance() -> None:
    """As a list it was one for each member, as a tuple a pair."""
    for wrong in ([1e-3], [1e-3, 1e-6], [1e-3, 1e-6, 1e-9]):
        with pytest.raises(DTypeError, match=re.escape("tolerance: expected a number, an array, or a tuple (relative")):
            sw.integrate(sw.Oscillator(), "merson", **START, at=[1.0], tolerance=wrong)
    members = sw.integrate(sw.Oscillator(), "merson", **START, at=[1.0], tolerance=np.array([1e-3, 1e-6]))
    pair = sw.integrate(sw.Oscillator(), "merson", **START, at=[1.0], tolerance=(1e-3, [1e-6, 1e-9]))
    assert members.y.shape == pair.y.shape == (1, 2)


second = sw.system(lambda t, v, y, *, k=1.0: -k * y)
first = sw.system(order=1)(lambda t, y, *, k=1.0: -k * y)


def located(event: Any) -> Any:
    return sw.integrate(second(), "rk4", **FIXED, events=event)


SWAPPED: list[tuple[Any, str]] = [
    (lambda: sw.system(lambda t, y, v: -y), "f(t, v, y), got (t, y, v): y stands at the place of v"),
    (lambda: sw.system(lambda t, x, v: -x), "f(t, v, y), got (t, x, v): v stands at the place of y"),
    (lambda: sw.system(lambda v, y, t: -y), "f(t, v, y), got (v, y, t): v stands at the place of t"),
    (lambda: sw.system(blocks=2)(lambda t, y, v: (-y, v)), "f(t, v, y), got (t, y, v)"),
    (lambda: sw.system(order=1)(lambda y, t: -y), "f(t, y), got (y, t): y stands at the place of t"),
    (lambda: sw.system(order=1)(lambda x, t: -x), "f(t, y), got (x, t): t stands at the place of y"),
    (lambda: sw.system(order=1)(lambda v, y: -y), "f(t, y), got (v, y): v stands at the place of t"),
    (lambda: located(sw.Event(lambda t, y, v: y, name="e")), "events: e: expected a function f(t, v, y), got (t, y, v)"),
    (
        lambda: located(sw.Event(lambda t, v, y: y, then=lambda t, y, v: (v, y), name="e")),
        "events: e: then: expected a function f(t, v, y), got (t, y, v)",
    ),
    (lambda: second.invariant(lambda y, v: v * v + y * y), "f(v, y), got (y, v): y stands at the place of v"),
    (lambda: second.invariant(lambda v, y, t: v * v + y * y), "f(t, v, y), got (v, y, t)"),
    (lambda: first.invariant(lambda y, t: y * y), "f(t, y), got (y, t)"),
    (lambda: second(k=lambda v: abs(v)), "k: expected a function f(t), got (v): v stands at the place of t"),
    (lambda: sw.sweeps.Crossing(lambda v, y, t: y), "of: expected a function f(t, v, y), got (v, y, t)"),
    (lambda: sw.solve_ivp(lambda y, t: -y, (0.0, 1.0), [1.0]), "fun: <lambda>: expected a function f(t, y), got (y, t)"),
    (
        lambda: sw.solve_ivp(lambda t, y: -y, (0.0, 1.0), [1.0], events=lambda y, t: y[0]),
        "events: <lambda>: expected a function f(t, y), got (y, t)",
    ),
]


def test_a_name_at_the_place_of_another() -> None:
    """Arguments go by their place, so a swapped name would silently stand for another number."""
    for call, message in SWAPPED:
        with pytest.raises(ArgumentError, match=re.escape(message)):
            call()


def test_names_of_ones_own() -> None:
    """Other names may stand anywhere, and so may v for the state where there is no velocity, and any name as a parameter's."""
    sw.system(lambda t, x, y: -y)
    sw.system(lambda time, v, x: -x)
    sw.system(order=1)(lambda t, v: -v)
    sw.system(order=1)(lambda t, x, *, v=1.0, y=2.0: -v * x * y)
    sw.solve_ivp(lambda x, u: -u, (0.0, 1.0), [1.0])
    first.invariant(lambda t, v, *, k: k * v)
    first(k=np.cos)


def test_arguments_that_a_class_does_not_take() -> None:
    """What it takes is told, for every class that is called with numbers: a floor has no height, but an offset."""
    for call, message in (
        (lambda: sw.Floor(0.2), "Floor: too many positional arguments; expected Floor(*, restitution=1.0, friction=None, normal"),  # type: ignore[misc]
        (lambda: sw.Floor(height=0.2), "Floor: got an unexpected keyword argument 'height'; expected Floor(*, restitution"),  # type: ignore[call-arg]
        (lambda: sw.Sphere(), "Sphere: missing a required argument: 'centre'; expected Sphere(centre, radius, *, inside"),  # type: ignore[call-arg]
        (lambda: sw.NBody([1.0], mass=2.0), "NBody: got an unexpected keyword argument 'mass'; expected NBody(masses="),  # type: ignore[call-arg]
    ):
        with pytest.raises(DTypeError, match=re.escape(message)):
            call()


def test_masks_are_not_lost() -> None:
    masked = np.ma.masked_array([1.0, 2.0, 3.0], [False, True, False])
    for call in (
        lambda: sw.Oscillator(masked),
        lambda: sw.integrate(sw.Oscillator(), "rk4", **FIXED | {"y": masked}),
        lambda: sw.NBody(masked),
        lambda: sw.World(sw.Oscillator(), "rk4", v=np.zeros(3), y=masked, dt=0.1),
    ):
        with pytest.raises(ArgumentError, match="got a masked array in which 1 are masked"):
            call()
    with pytest.raises(ArgumentError, match="steps: expected a whole number, got a masked one"):
        sw.integrate(sw.Oscillator(), "rk4", **FIXED | {"steps": np.ma.masked_array(3, True)})
    whole = np.ma.masked_array([1.0, 2.0, 3.0], False)
    assert sw.integrate(sw.Oscillator(), "rk4", **FIXED | {"y": whole}).y.shape == (1, 3)


def test_the_most_steps_of_a_run_of_fixed_ones() -> None:
    for most in ("junk", 5, 1_000_000):
        with pytest.raises(ArgumentError, match="max_steps: works with tolerance= and at= only"):
            sw.integrate(sw.Oscillator(), "rk4", **FIXED, max_steps=most)  # type: ignore[arg-type]


def test_a_time_that_does_not_move() -> None:
    for wrong in ({"t0": 1e300}, {"t0": 1e16, "dt": 1e-3}, {"dt": 1e308}, {"dt": 5e-324, "t0": 1.0}):
        with pytest.raises(ArgumentError, match="dt, t0: expected a time that moves on and stays finite"):
            sw.integrate(sw.Oscillator(), "rk4", **FIXED | wrong)


class TestAnotherSystemsRun:
    """The errors of a run mean something only beside the scene's own system."""

    scene = sw.scenes.kepler()

    def test_is_refused(self) -> None:
        kepler, ask = self.scene, {"dt": 0.001, "steps": 10}
        others = sw.NBody([1.0, 0.5], force="newton"), sw.NBody([1.0, 0.0], force="newton", G=2.0), sw.NBody([1.0, 0.0])
        runs = [sw.integrate(other, "rk4", v=kepler.v, y=kepler.y, **ask) for other in others]
        runs.append(sw.integrate(kepler.system, "rk4", v=kepler.v[..., None], y=kepler.y[..., None], **ask))
        for of in (kepler.state_error, kepler.energy_error, kepler.amplitude):
            for run in runs:
                with pytest.raises(ArgumentError, match="run: expected a run of the scene kepler, one member of NBody"):
                    of(run)
            with pytest.raises(DTypeError, match=r"run: expected what scene\.run returns, got float"):
                of(1.0)

    def test_its_own_and_a_controlled_one_are_not(self) -> None:
        for control in (None, sw.EnergyControl(0.1), sw.Projection()):
            run = self.scene.run("rk4", 0.001, steps=10, control=control)
            assert self.scene.state_error(run).max() < 1e-3


def test_an_angle_without_a_sine() -> None:
    with pytest.warns(
        sw.AccuracyWarning, match=r"an angle grew to 9\.01e\+15 rad, and beyond 1\.13e\+15 rad its sine means nothing"
    ):
        sw.integrate(sw.Pendulum(), "rk4", **FIXED | {"y": [1.0, 2.0**53]})
    with pytest.warns(sw.AccuracyWarning, match="an angle grew"):
        sw.integrate(sw.Pendulum(), "merson", v=1e15, y=1.0, at=[2.0], tolerance=1.0)
    sw.integrate(sw.Pendulum(), "rk4", **FIXED | {"y": 2.0**50 - 10})  # no warning, which would be an error


def test_bodies_whose_energy_the_method_made() -> None:
    scene = sw.scenes.pythagorean()
    for method, steps in (("rk4", 30_000), ("false_heun", 3000)):
        match = rf"^the run has another energy at the end: .* instead of -12\.8, so {method} did not"
        with pytest.warns(sw.AccuracyWarning, match=match):
            scene.run(method, scene.horizon / steps, every=100, record="energy")
    scene.run("dop853", scene.horizon / 30_000, every=100, record="energy")
    # Nothing need be recorded, nor any state kept; with a tolerance neither.
    for options in ({}, {"every": 10_000}, {"record": "momentum", "every": 10_000}):
        with pytest.warns(sw.AccuracyWarning, match="energy at the end: 5.69e\\+04 instead of -12.8, so rk4 did not"):
            scene.run("rk4", scene.horizon / 30_000, **options)
    scene.run("dop853", scene.horizon / 30_000)
    with pytest.warns(sw.AccuracyWarning, match="so dop853 did not"):
        sw.integrate(scene.system, "dop853", v=0.0, y=scene.y, tolerance=3e-2, at=[10.0])
    # Whoever diverges is named as that alone; what is no invariant of the motion is not looked at.
    with pytest.warns(sw.DivergenceWarning) as caught:
        sw.integrate(sw.NBody([1.0, 1.0]), "rk4", v=0.0, y=np.zeros((2, 2)), dt=0.1, steps=9, every=1, record="energy")
    assert len(caught) == 1
    printed = sw.NBody([3.0, 4.0, 5.0], force="printed")
    wild: dict[str, Any] = {"dt": 0.1, "steps": 100, "every": 10, "record": "energy"}
    with pytest.warns(sw.AccuracyWarning, match="^bodies 1 and 2 met within step 13 "):
        run = sw.integrate(printed, "standard_euler", v=scene.v, y=scene.y, **wild)
    assert abs(run.energy[-1] - run.energy[0]) > abs(run.energy[0])


def from_apocentre(e: float) -> dict[str, Any]:
    """Of an orbit of axis 1 around a unit of mass at rest."""
    v, y = np.zeros((2, 2)), np.zeros((2, 2))
    v[1, 1], y[1, 0] = math.sqrt((1.0 - e) / (1.0 + e)), 1.0 + e
    return {"v": v, "y": y}


#: The least distance is 1 − e = 0.01, passed at the speed √((1 + e)/(1 − e)) = 14: 0.5 in such a step.
THROWN: dict[str, Any] = from_apocentre(0.99) | {"dt": 0.0335593220338983, "steps": 1000}


@pytest.mark.parametrize("force", ["newton", "logarithmic"])
@pytest.mark.parametrize("at", [0, 1])
def test_a_body_without_mass_that_is_thrown_out(at: int, force: Any) -> None:
    """The energy of all bodies is blind to it; its own per unit of mass is kept, wherever the attractor is."""
    blocks = {name: block[:: 1 - 2 * at] + (name == "v") * 0.3 for name, block in from_apocentre(0.99).items()}
    system = sw.NBody([0.0, 1.0] if at else [1.0, 0.0], force=force)
    options: dict[str, Any] = {"dt": THROWN["dt"], "steps": 1000} if force == "newton" else {"dt": 0.5, "steps": 1000}
    with pytest.warns(sw.AccuracyWarning, match=f"^body {1 - at}, which has no mass, has another energy per mass at the end"):
        sw.integrate(system, "dop853" if force == "newton" else "standard_euler", **blocks, **options)
    # No warnings, which would be errors: of steps that follow it, of a small error, and of a run that goes on from a carry.
    sw.integrate(system, "dop853", **blocks, tolerance=1e-9, at=[10.0, 33.0])
    sw.integrate(system, "leapfrog", **from_apocentre(0.3), dt=0.01, steps=3000)


def test_bodies_without_mass_in_a_batch() -> None:
    v, y = (np.stack([block] * 3, axis=-1) for block in from_apocentre(0.99).values())
    v[1, 1, 0] = 1.0 / math.sqrt(1.99)  # a circle
    match = (
        "^2 bodies without mass have another energy per mass at the end: body 1 of member 1 has 6.35 instead of -0.5, so dop853"
    )
    with pytest.warns(sw.AccuracyWarning, match=match):
        sw.integrate(sw.NBody([1.0, 0.0], force="newton"), "dop853", **THROWN | {"v": v, "y": y})
    # Two attractors may throw out a third body in truth: nothing is said of its energy.
    with pytest.warns(sw.AccuracyWarning) as caught:
        sw.integrate(sw.NBody([[1.0, 1.0, 1e-3], [0.0, 0.0, 0.0]], force="newton"), "dop853", **THROWN | {"v": v, "y": y})
    assert len(caught) == 1
    heavy = sw.NBody([1.0, 1.0, 0.0], force="newton")
    apart = np.array([[-0.5, 0.0], [0.5, 0.0], [0.0, 3.0]])
    sw.integrate(heavy, "dop853", v=apart[:, ::-1] * [-1.4, 1.4] * [[1.0], [1.0], [0.0]], y=apart, tolerance=1e-10, at=[40.0])


def test_energies_at_both_ends_are_those_of_the_system() -> None:
    """Summed in floats they are the same but for rounding: some ten sums of numbers of that size."""
    rng = np.random.default_rng(4)
    for force in ("newton", "logarithmic"):
        for dim in (2, 3):
            bodies = sw.NBody(rng.uniform(0.5, 2.0, 5), force=force, G=1.5, softening=0.2, dim=dim)
            v, y = rng.normal(size=(2, 5, dim))
            energies = diagnostics._summed(bodies, v.tolist(), y.tolist())
            assert np.allclose(energies, (bodies.energy(v, y), bodies.kinetic(v)), rtol=1e-14, atol=1e-13)
    together = [[0.0, 0.0]] * 2
    assert np.isnan(diagnostics._summed(sw.NBody([1.0, 1.0], force="newton"), together, together)).all()


def test_bodies_in_a_batch_whose_energy_the_method_made() -> None:
    """The second member alone is started so that two bodies come near each other."""
    scene = sw.scenes.pythagorean()
    y = np.stack([10.0 * scene.y, scene.y], axis=-1)
    batch: dict[str, Any] = {"v": 0.0, "dt": 10.0 / 30_000, "steps": 30_000}
    with pytest.warns(sw.AccuracyWarning, match=r"1 of 2 members has another energy .* member 1 has 5.69e\+04 instead of -12.8"):
        sw.integrate(scene.system, "rk4", y=y, **batch)
    # A controlled energy is kept, or said to be missed by the control.
    sw.integrate(scene.system, "dop853", y=scene.y, control=sw.Projection(), **batch | {"steps": 3000})
