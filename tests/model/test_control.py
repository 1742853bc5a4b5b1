"""Energy control and projections: their forms and limits, how energies decay, by fixed and chosen steps, and by PEFRL."""

from __future__ import annotations

import itertools
import math
import re
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.runs import engine
from stepwell.runs.engine.plan import per_step
from support import own_systems as own
from support.calls import a_step, assert_raises, quiet
from support.looped import looped
from support.ways import assert_equal_ways, assert_same_run

FORMS = ("limited", "printed")
FORCES = ("logarithmic", "newton", "printed")
STEPPED = [m.name for m in sw.methods() if m.carry is None]
ABLE = [m.name for m in sw.methods() if m.error_order is not None and not m.has_series]  # a series is not pushed within a step
CONTROLS: dict[str, Any] = {
    "limited": sw.EnergyControl(0.7),
    "printed": sw.EnergyControl(0.7, "printed", target=0.1),
    "scaling": sw.Projection(),
    "nacozy": sw.Projection("nacozy"),
}

#: Appendix D: places of the clover, thrown outward, the third a little aside.
CORNERS = np.radians([210.0, 330.0, 90.0])
OUT = np.stack([np.cos(CORNERS), np.sin(CORNERS)], axis=-1)
START: dict[str, Any] = {"v": OUT + np.array([[0.0, 0.0], [0.0, 0.0], [0.01, 0.0]]), "y": OUT}

#: The 36 runs: these gains, three forces, two methods.
GAINS = np.array([0.3, 1.0, 3.0, 10.0, 30.0, 100.0])


def spread(members: int, **blocks: Any) -> dict[str, Any]:
    """The same start for every member."""
    return {name: np.repeat(np.asarray(block)[..., np.newaxis], members, axis=-1) for name, block in blocks.items()}


def circle(off: float = 0.0) -> tuple[sw.NBody, dict[str, Any]]:
    """Two bodies of mass ½ on Kepler's circle of period 2π; ``off`` is how far E is above the circle's, as a share of K."""
    v = np.array([[0.0, -0.5], [0.0, 0.5]]) * math.sqrt(1.0 + off)
    return sw.NBody([0.5, 0.5], force="newton"), {"v": v, "y": np.array([[-0.5, 0.0], [0.5, 0.0]])}


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")  # no step of 0.01 follows the encounters
@looped("force, method", itertools.product(FORCES, ["standard_euler", "false_euler"]))
def test_the_limited_form_stays_finite_in_all_36_runs(force: str, method: str) -> None:
    """100 000 steps; the velocities are at most doubled in a step, and no gain makes the form overshoot."""
    control = sw.EnergyControl(GAINS)
    run = sw.integrate(sw.NBody(force=force), method, **spread(6, **START), dt=0.01, steps=100_000, control=control)
    assert (run.status == sw.Status.OK).all()
    assert np.isfinite(run.energy).all()


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")
def test_the_printed_form_overflows_in_some_of_them_and_says_which() -> None:
    """Which of the 36 is chaos, but with C = 100 h·C·K is above 1 from the start: 0.01·100·1.5."""
    control = sw.EnergyControl(GAINS, "printed")
    with pytest.warns(sw.DivergenceWarning) as warned, pytest.warns(sw.ControlWarning, match=r"h·C·K = 1\.5\d* at the start"):
        run = sw.integrate(sw.NBody(), "standard_euler", **spread(6, **START), dt=0.01, steps=100_000, control=control)
    bad = np.flatnonzero(run.status)
    assert 5 in bad
    assert run.status[0] == sw.Status.OK
    first = bad[np.argmin(run.first_bad_step[bad])]
    step = run.first_bad_step[first]
    message = next(str(w.message) for w in warned if issubclass(w.category, sw.DivergenceWarning))
    way = "; the first was" if len(bad) > 1 else ":"
    assert f"{len(bad)} of 6 members diverged{way} member {first} at step {step} (t = {step * 0.01:g})" in message


def test_the_printed_form_overshoots_from_one_on() -> None:
    """ΔE is multiplied by 1 − 2hCK in a step: at hCK = 0.9 it decays, at 1.2 it grows by 1.4 until K itself is another."""
    system, start = circle(1e-6)
    target = float(system.energy(*circle()[1].values()))
    ends = {}
    for relative in (0.9, 1.2):
        control = sw.EnergyControl(relative=relative, form="printed", target=target)
        run = quiet(system, "standard_euler", **start, dt=1e-6, steps=20, every=1, control=control)
        ends[relative] = abs(run.energy[-1] - target) / abs(run.energy[0] - target)
    # What the steps themselves add, about h²·K each, is 2e-11 in all of 1e-6·K; ΔE stays below a thousandth of K.
    assert ends[0.9] == pytest.approx(0.8**20, rel=0.05)
    assert ends[1.2] == pytest.approx(1.4**20, rel=0.05)


def test_a_gain_that_overshoots_is_warned_of_in_the_printed_form_only() -> None:
    with pytest.warns(sw.ControlWarning, match="h·C·K = 1 at the start, expected below 1"):
        sw.integrate(sw.NBody(), "rk4", **START, dt=1e-6, steps=1, control=sw.EnergyControl(relative=1.0, form="printed"))
    for right in (sw.EnergyControl(relative=0.99, form="printed"), sw.EnergyControl(relative=1e6)):
        sw.integrate(sw.NBody(), "rk4", **START, dt=1e-6, steps=1, control=right)  # no warning, which would be an error


# ---- what it does


@looped("form, method", itertools.product(FORMS, STEPPED))
def test_the_energy_decays_as_it_should(form: str, method: str) -> None:
    """dE/dt = −C·ΔE·Σmv² = −2CK·ΔE, with K the circle's to 1e-3: over a time with 2CKt = 1 to 1/e."""
    system, start = circle(1e-3)
    target = float(system.energy(*circle()[1].values()))
    kinetic, dt, steps = 0.125, 1e-5, 2000
    gain = 1.0 / (2.0 * kinetic * dt * steps)
    run = sw.integrate(system, method, **start, dt=dt, steps=steps, control=sw.EnergyControl(gain, form, target=target))
    left = (run.energy[-1] - target) / (system.energy(start["v"], start["y"]) - target)
    # Steps of 1/2000 of the time constant miss 1/e by 1/4000 of it, and what Euler adds to E, about h²·K in a step, is
    # 2000·1e-10 of ΔE/K = 1e-3; K falls by ΔE, a thousandth, on average by less. Together below 2e-3.
    assert left == pytest.approx(math.exp(-1.0), rel=2e-3)


@looped("method", STEPPED)
def test_both_forms_agree_to_first_order(method: str) -> None:
    """g = hC·ΔE in one, hC·ΔE·(1 + O(hCK) + O(hCΔE)) in the other: halving the gain takes three quarters of the difference."""
    target = float(sw.NBody().energy(START["v"], START["y"])) - 0.3
    apart = []
    for gain in (1e-2, 5e-3):
        controls = (sw.EnergyControl(gain, form, target=target) for form in FORMS)
        ends = [sw.integrate(sw.NBody(), method, **START, dt=0.01, steps=20, control=each).v[-1] for each in controls]
        apart.append(np.abs(ends[0] - ends[1]).max())
    assert apart[0] < 1e-5
    # 4, but for the next order, hCK ≈ 2e-4 of it, and rounding, 1e-16 of 1e-8.
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.01)


@looped("method, force, form", zip(STEPPED, itertools.cycle(FORCES), itertools.cycle(FORMS)))
def test_no_gain_no_change(form: str, force: str, method: str) -> None:
    """g is 0 then, and dv − 0·v is dv."""
    free, controlled = (
        sw.integrate(sw.NBody(force=force), method, **START, dt=0.01, steps=50, every=7, control=control)
        for control in (None, sw.EnergyControl(0.0, form))
    )
    np.testing.assert_array_equal(free.v, controlled.v)
    np.testing.assert_array_equal(free.y, controlled.y)


def test_a_target_is_approached_from_both_sides() -> None:
    """Limited, at hCK = 1 two thirds of ΔE go in a step of Euler; what is left after 50 is what a step adds, below h·3."""
    begin = float(sw.NBody().energy(START["v"], START["y"]))
    targets = begin + np.array([-0.5, 0.0, 0.5])
    control = sw.EnergyControl(relative=1.0, target=targets)
    run = sw.integrate(sw.NBody(), "standard_euler", **spread(3, **START), dt=1e-3, steps=50, control=control)
    np.testing.assert_allclose(run.energy[-1], targets, rtol=0, atol=3e-3)


def test_a_relative_gain_is_the_gain_over_the_step_and_the_kinetic_energy() -> None:
    kinetic = 0.5 * float((START["v"] ** 2).sum())
    runs = [
        sw.integrate(sw.NBody(), "rk4", **START, dt=0.01, steps=30, control=control)
        for control in (sw.EnergyControl(relative=0.25), sw.EnergyControl(0.25 / (0.01 * kinetic)))
    ]
    # The quotients may round differently, by 1e-16 of a push of 1e-3 or less.
    np.testing.assert_allclose(runs[0].y, runs[1].y, rtol=1e-13)


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")
def test_momentum_decays_with_the_velocities() -> None:
    """All velocities get one factor, so the momentum of the whole does too; without momentum the centre stays."""
    centred = START["v"] - START["v"].mean(axis=0)
    options: dict[str, Any] = {"dt": 0.01, "steps": 20_000, "every": 100, "control": sw.EnergyControl(relative=1.0)}
    drifting = sw.integrate(sw.NBody(), "false_euler", **START, **options)
    still = sw.integrate(sw.NBody(), "false_euler", v=centred, y=OUT, **options)
    # Uncontrolled it would keep its 0.01; the momentum of rounding, 20 000 times 1e-16, is magnified as any other.
    assert np.hypot(*still.v.sum(axis=1).T).max() < 1e-9
    assert np.abs(np.hypot(*drifting.v.sum(axis=1).T) - 0.01).max() > 1e-3


# ---- what every run promises


@looped("form, method", itertools.product(FORMS, ["false_euler", "rk4", "rodas4", "pefrl", "taylor"]))
def test_a_gain_for_each_member_equals_single_runs(form: str, method: str) -> None:
    gains, targets = np.geomspace(1e-3, 30.0, 11), np.linspace(2.5, 3.5, 11)
    batch, *ones = (
        quiet(sw.NBody(), method, **start, dt=0.01, steps=200, every=50, control=sw.EnergyControl(gain, form, target=target))
        for start, gain, target in [(spread(11, **START), gains, targets), *zip([START] * 11, gains, targets, strict=True)]
    )
    for i, one in enumerate(ones):
        assert_same_run(one, batch, i)


def bodies(n: int, members: int = 5, dim: int = 2, force: str = "newton") -> tuple[sw.NBody, dict[str, Any]]:
    rng = np.random.default_rng(n)
    v, y = rng.normal(size=(2, n, dim, members))
    return sw.NBody(np.ones(n) / n, force=force, softening=0.3), {"v": v, "y": y}


@pytest.mark.parametrize("control", CONTROLS)
def test_fixed_steps_have_the_same_bits_in_every_way(control: str) -> None:
    """On one tape and row by row; in pieces the target is the energy of the very first start, not that of the piece's."""
    for (n, dim, method), force in zip(
        [(2, 2, "taylor"), (3, 2, "rodas4"), (3, 3, "pefrl"), (9, 3, "rk4"), (40, 2, "false_euler"), (40, 3, "rk4")],
        itertools.cycle(FORCES),
        strict=False,
    ):
        system, start = bodies(n, dim=dim, force=force)
        options: dict[str, Any] = {"dt": 0.01, "steps": 12, "every": 5, "control": CONTROLS[control]}
        assert_equal_ways(system, method, **start, **options, ways=("by the reference", "alone", "in pieces", "in a world"))


@looped("form, share", itertools.product(FORMS, [0.3, np.linspace(0.1, 0.9, 5)]))
def test_the_gain_of_a_run_in_pieces_is_that_of_its_first_kinetic_energy(form: str, share: Any) -> None:
    """And neither the control that is given nor the system is changed."""
    control, system = sw.EnergyControl(relative=share, form=form), sw.NBody()
    options: dict[str, Any] = {"dt": 0.01, "steps": 100, "every": 10, "control": control}
    assert_equal_ways(system, "rk4", **spread(5, **START), **options, ways=("in pieces",))
    assert control.gain is control.target is system.control is None


@looped("method, force", zip(STEPPED, itertools.cycle(FORCES)))
def test_scaling_keeps_the_energy_to_rounding(force: str, method: str) -> None:
    """E is a sum of six terms below 10 in size: some roundings of 1e-15 each. Methods of order up to 5 leave it by more alone."""
    options: dict[str, Any] = {"dt": 0.01, "steps": 100, "every": 1}
    run = sw.integrate(sw.NBody(force=force), method, **START, **options, control=sw.Projection())
    assert np.ptp(run.energy) < 2e-14
    alone = np.ptp(sw.integrate(sw.NBody(force=force), method, **START, **options).energy)
    assert alone > (5e-14 if method == "dopri5" else 4e-13) or sw.method(method).order > 5


@looped("method", STEPPED)
def test_nacozys_way_is_one_step_of_newton(method: str) -> None:
    """What is left of a step's error ε is of second order in it: after every step below ε², with ε ≤ h²·|a|²·3 < 1e-3 here."""
    run = sw.integrate(sw.NBody(), method, **START, dt=0.01, steps=50, every=1, control=sw.Projection("nacozy"))
    assert np.ptp(run.energy) < 1e-6


@pytest.mark.parametrize("control", CONTROLS)
def test_chosen_steps_have_the_same_bits_in_every_way(control: str) -> None:
    """On one tape and row by row; the work is told, too, and that of two pieces is that of the whole."""
    for n, method in ((2, "rodas5p"), (3, "merson"), (6, "dop853"), (9, "fehlberg_5"), (20, "fehlberg")):
        system, start = bodies(n)
        ask: dict[str, Any] = {"tolerance": 1e-5, "control": CONTROLS[control]}
        ways = ("by the reference", "alone", "in pieces", "saved more often")
        whole = assert_equal_ways(system, method, **start, **ask, at=np.array([0.3, 0.7]), ways=ways)
        reference = sw.integrate(system, method, **start, at=[0.3, 0.7], **ask, backend="numpy")
        np.testing.assert_array_equal(whole.work, reference.work)
        first = sw.integrate(system, method, **start, at=[0.3], **ask)
        rest = sw.integrate(system, method, at=[0.7], resume=first)
        assert first.work + rest.work == pytest.approx(whole.work, rel=1e-12, abs=1e-15)
        if n < 4:
            assert_equal_ways(system, method, **start, **ask, at=np.array([0.7]), fused=True, ways=("by the reference",))


@looped("method, way", itertools.product(ABLE, ["scaling", "nacozy"]))
def test_a_projection_keeps_the_energy_of_every_saved_state(method: str, way: str) -> None:
    """Also at output times, which a step of their own reaches. Free the same tolerance lets it drift."""
    eight = sw.scenes.figure_eight()
    ask: dict[str, Any] = {"v": eight.v, "y": eight.y, "tolerance": 1e-4, "at": np.linspace(1.0, 30.0, 13)}
    run, free = (sw.integrate(eight.system, method, **ask, control=each) for each in (sw.Projection(way), None))
    # Scaling: a few roundings of sums of some ten numbers of size 1. Nacozy: the square of a step's energy error of some 1e-4.
    assert np.ptp(run.energy) < (1e-14 if way == "scaling" else 1e-7)
    assert np.ptp(free.energy) > 1e-5
    assert free.work is None
    # What the steps did to the energy the projections took back.
    assert abs(run.work) > 1e-6


@looped("method, form", itertools.product(ABLE, FORMS))
def test_the_energy_decays_as_it_should_with_a_tolerance(method: str, form: str) -> None:
    """dE/dt = −2CK·ΔE on a circle with K to 1e-3: over a time with 2CKt = 1 to 1/e.

    The limited form takes the step of the attempt: its rate is 1/(1 + 2hCK) of that, and 2CK = 1. With the step 1 to which
    systems are scaled for adaptive steps it would be half of it, e^−½.
    """
    system, start = circle(1e-3)
    target = -0.125
    control = sw.EnergyControl(1.0 / (2.0 * 0.125), form, target=target)
    run = sw.integrate(system, method, **start, tolerance=1e-9, at=[1.0], control=control)
    step = 1.2 * float(run.paces.h) if form == "limited" else 0.0  # steps hardly change on a circle
    left = (run.energy[-1] - target) / (system.energy(**start) - target)
    assert math.exp(-1.0) * (1.0 - 2e-3) < left < math.exp(-1.0 / (1.0 + step)) * (1.0 + 2e-3) < 0.55
    # The push counts alike in all stages, which have other weights in the result, and decays by a sixth within the longest steps.
    assert run.work == pytest.approx(run.energy[-1] - system.energy(**start), rel=0.1)


@looped("control", [sw.Control("energy", 0.5), sw.Control("energy", 0.5, "printed"), sw.Projection("energy")])
def test_invariants_of_own_systems_with_a_tolerance(control: Any) -> None:
    """The invariant of a pendulum, kept from where it starts, or approached."""
    ask: dict[str, Any] = {"v": 0.0, "y": [1.0, 2.0], "tolerance": 1e-4, "at": [20.0, 100.0]}
    run, free = (sw.integrate(own.pendulum(), "merson", **ask, control=each) for each in (control, None))
    start = own.pendulum().for_state_shapes(0.0, 0.0).energy(np.zeros(2), np.array([1.0, 2.0]))
    assert (abs(run.energy - start).max() < 0.2 * abs(free.energy - start).max()).all()


def test_a_constraint_is_kept_by_its_projection() -> None:
    """Accepted states are on it, though some were rejected; what it does is no work."""
    system, start = sw.Pendulum3D(), {"v": [0.0, 1.5, 0.0], "y": [1.0, 0.0, 0.0]}
    options: dict[str, Any] = {"tolerance": 1e-4, "at": np.linspace(0.1, 9.0, 90), "record": "length_error"}
    run, true = (
        sw.integrate(system, method, **start, **options | more)
        for method, more in (("merson", {"control": sw.Projection("length"), "dt": 5.0}), ("dop853", {"tolerance": 1e-12}))
    )
    assert run.paces.rejected > 0
    assert run.recorded["length_error"].max() < 1e-15
    assert np.abs(np.einsum("ij,ij->i", run.v, run.y)).max() < 1e-14
    assert np.abs(run.y - true.y).max() < 0.02


def test_pefrl_pushes_between_steps() -> None:
    """One step by hand: the free step, and then v less g·v, with g of the energies where it ends."""
    system, start = bodies(3, 1)
    v, y = start["v"][..., 0], start["y"][..., 0]
    target, h, gain = 0.3, 0.05, 0.9
    free = sw.integrate(system, "pefrl", v=v, y=y, dt=h, steps=1)
    energy, kinetic = system.energy(free.v[-1], free.y[-1]), system.kinetic(free.v[-1])
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
    assert "work" in str(sw.explain(system.for_state_shapes(v, y), "pefrl", control=control).listing)


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
    control = sw.EnergyControl(0.5, target=first.system.keeper.target)
    anew = sw.integrate(system, "rk4", v=first.v[-1], y=first.y[-1], dt=0.01, t0=0.0, start_step=5, steps=5, control=control)
    np.testing.assert_array_equal(rest.y, anew.y)


def test_a_control_that_begins_to_overshoot_is_told_of_when_it_does() -> None:
    """On an ellipse of e = 0.9 K is 9.5 where the bodies are nearest and 0.026 where they begin: h·C·K passes 1 on the way."""
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
        step = int(re.search(r"at step (\d+)", str(warned[0].message))[1])
        assert abs(step - first) <= 3
    sw.integrate(system, "rk4", **options | {"steps": first - 20}, every=10)  # no warning, which would be an error
    sw.integrate(system, "rk4", **options | {"control": sw.EnergyControl(gain)}, every=10)  # nor in the limited form


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


@looped("case, fixed", itertools.product(AT_REST, [True, False]))
def test_a_projection_leaves_a_state_at_rest_as_it_is(case: str, fixed: bool) -> None:
    """No velocity to scale and no gradient to go along: 0/0. Nothing is added, also where the target is out of reach."""
    # With a tolerance no step from rest is longer than a 32nd of the time so far: there are a hundred to 2e-4.
    system, start, way = AT_REST[case]
    ask: dict[str, Any] = {"dt": 0.1, "steps": 20} if fixed else {"tolerance": 1e-5, "at": [1e-4, 2e-4]}
    reach = float(np.asarray(sw.integrate(system, "rk4", **start, dt=0.1, steps=1, control=sw.Projection(way)).energy)[-1])
    for target in (None, reach + 1.0) if fixed else (reach + 1.0,):
        control = sw.Projection(way, target=target)
        for backend in ("rust", "numpy"):
            run = sw.integrate(system, "rk4" if fixed else "merson", **start, **ask, control=control, backend=backend)
            assert not np.any(run.status)
            assert np.array_equal(run.y[-1], start["y"])
            assert np.array_equal(run.v[-1], start["v"])
            assert run.work == 0.0


def test_members_at_rest_leave_the_others_as_they_are() -> None:
    options: dict[str, Any] = {"dt": 0.1, "steps": 50, "control": sw.Projection("energy")}
    alone = sw.integrate(own.pendulum(), "false_heun", v=0.0, y=1.0, **options)
    both = sw.integrate(own.pendulum(), "false_heun", v=0.0, y=[0.0, 1.0], **options)
    assert both.y[-1, 0] == 0.0
    assert both.y[-1, 1] == alone.y[-1]


def test_bad_arguments_are_named() -> None:
    for arguments, error, message in (
        ({}, ArgumentError, "expected one of them, got neither"),
        ({"gain": 1.0, "relative": 1.0}, ArgumentError, "expected one of them, got both"),
        ({"gain": -1.0}, ArgumentError, "gain: expected numbers of zero or more, got -1"),
        ({"gain": "much"}, DTypeError, "gain: expected real numbers"),
        ({"gain": math.nan}, NotFiniteError, "gain: expected finite numbers, got nan"),
        ({"relative": [0.1, -0.2]}, ArgumentError, r"relative: expected numbers of zero or more, got -0\.2"),
        ({"gain": 1.0, "target": math.inf}, NotFiniteError, "target: expected finite numbers"),
        ({"gain": 1.0, "form": "limitd"}, UnknownNameError, "form: there is no 'limitd'; did you mean 'limited'"),
    ):
        assert_raises((partial(sw.EnergyControl, **arguments), error, message))


def test_what_a_run_cannot_use_is_named() -> None:
    push, relative, pendulum, carries = sw.EnergyControl(0.3), sw.EnergyControl(relative=0.1), own.pendulum(), "(y_prev|v_half)"
    carrying = itertools.product((m.name for m in sw.methods() if m.carry), (push, CONTROLS["scaling"]))
    paced: dict[str, Any] = START | {"tolerance": 1e-3, "at": [1.0], "dt": None, "steps": None}
    assert_raises(
        *(
            (partial(a_step, sw.NBody(), m, **START, control=control), f"control: {m} carries {carries} in place of v.*use pefrl")
            for m, control in carrying
        ),
        (lambda: a_step(sw.Oscillator(), control=push), "control"),
        (lambda: a_step(sw.Chain(3), control=push), "control"),
        (lambda: a_step(sw.NBody(), "merson", **paced, control=relative), "EnergyControl.* give gain in place of relative"),
        (lambda: a_step(sw.NBody(), "merson", **paced, control=sw.LengthControl(0.5)), "LengthControl.* relative to steps of"),
        (lambda: a_step(pendulum, "pefrl", control=sw.Control("energy", 1.0)), "pefrl needs a second-order system"),
        kind=UnsupportedError,
    )
    assert_raises(
        (lambda: a_step(sw.NBody(), **START, control=0.3), DTypeError, "control: expected an EnergyControl.*got float"),
        (lambda: a_step(sw.NBody(), y=OUT, control=relative), ArgumentError, "relative: a start at rest has no kinetic energy"),
        (lambda: a_step(pendulum, control=sw.Projection("momentum")), ArgumentError, "control"),
    )
    onto = a_step(pendulum, "pefrl", dt=0.1, steps=300, every=1, control=sw.Projection("energy"))
    assert np.ptp(onto.energy) < 1e-9


@looped("argument", ["gain", "relative", "target"])
def test_what_is_given_per_member_makes_a_batch_or_must_fit_one(argument: str) -> None:
    values = np.array([0.1, 0.2, 0.3])
    control = sw.EnergyControl(**({"gain": 1.0} if argument == "target" else {}), **{argument: values})
    run = sw.integrate(sw.NBody(), "rk4", **START, dt=0.01, steps=3, control=control)
    assert run.y.shape == (1, 3, 2, 3)
    with pytest.raises(ShapeError, match="control"):
        sw.integrate(sw.NBody(G=[1.0, 2.0]), "rk4", **START, dt=0.01, steps=3, control=control)


def test_work_that_overflows_is_infinite_without_a_warning_of_numpy() -> None:
    """The core's sum has the factor h, so it may be finite where the work is not."""
    system = sw.NBody([1.0, 1.0]).under(sw.EnergyControl(0.5, target=1.0), ())
    plan = engine.Plan(system, sw.method("rk4"), (), 1e-3)
    assert per_step(plan, np.array(1e308)) == np.inf
