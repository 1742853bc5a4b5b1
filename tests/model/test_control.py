"""Energy control: its two forms, their limits, how they decay, and that they keep every promise that a run makes."""

from __future__ import annotations

import itertools
import math
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.runs import engine
from stepwell.runs.engine.plan import per_step
from support.cases import assert_same
from support.families import family

FORMS = ("limited", "printed")
FORCES = ("logarithmic", "newton", "printed")
STEPPED = [m.name for m in sw.methods() if m.carry is None]
#: More bodies than this make a series too long for one tape, which is refused.
MOST_IN_SERIES = 8

#: Appendix D: places of the clover, thrown outward, the third a little aside.
CORNERS = np.radians([210.0, 330.0, 90.0])
OUT = np.stack([np.cos(CORNERS), np.sin(CORNERS)], axis=-1)
START: dict[str, Any] = {"v": OUT + np.array([[0.0, 0.0], [0.0, 0.0], [0.01, 0.0]]), "y": OUT}

#: The 36 runs: these gains, three forces, two methods.
GAINS = np.array([0.3, 1.0, 3.0, 10.0, 30.0, 100.0])


def spread(members: int, **blocks: Any) -> dict[str, Any]:
    """The same start for every member."""
    return {name: np.repeat(np.asarray(block)[..., np.newaxis], members, axis=-1) for name, block in blocks.items()}


def quiet(*arguments: Any, **options: Any) -> sw.Run:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        warnings.simplefilter("ignore", sw.ControlWarning)
        return sw.integrate(*arguments, **options)


def circle(off: float = 0.0) -> tuple[sw.NBody, dict[str, Any]]:
    """Two bodies of mass ½ on Kepler's circle of period 2π; ``off`` is how far E is above the circle's, as a share of K."""
    v = np.array([[0.0, -0.5], [0.0, 0.5]]) * math.sqrt(1.0 + off)
    return sw.NBody([0.5, 0.5], force="newton"), {"v": v, "y": np.array([[-0.5, 0.0], [0.5, 0.0]])}


# ---- what is finite


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")  # no step of 0.01 follows the encounters
@pytest.mark.parametrize("method", ["standard_euler", "false_euler"])
@pytest.mark.parametrize("force", FORCES)
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
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sw.integrate(sw.NBody(), "rk4", **START, dt=1e-6, steps=1, control=sw.EnergyControl(relative=0.99, form="printed"))
        sw.integrate(sw.NBody(), "rk4", **START, dt=1e-6, steps=1, control=sw.EnergyControl(relative=1e6))


# ---- what it does


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("form", FORMS)
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


@pytest.mark.parametrize("method", STEPPED)
def test_both_forms_agree_to_first_order(method: str) -> None:
    """g = hC·ΔE in one, hC·ΔE·(1 + O(hCK) + O(hCΔE)) in the other: halving the gain takes three quarters of the difference."""
    target = float(sw.NBody().energy(START["v"], START["y"])) - 0.3
    apart = []
    for gain in (1e-2, 5e-3):
        ends = [
            sw.integrate(sw.NBody(), method, **START, dt=0.01, steps=20, control=sw.EnergyControl(gain, form, target=target)).v[
                -1
            ]
            for form in FORMS
        ]
        apart.append(np.abs(ends[0] - ends[1]).max())
    assert apart[0] < 1e-5
    # 4, but for the next order, hCK ≈ 2e-4 of it, and rounding, 1e-16 of 1e-8.
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("force", FORCES)
@pytest.mark.parametrize("form", FORMS)
def test_no_gain_no_change(form: str, force: str, method: str) -> None:
    """g is 0 then, and dv − 0·v is dv."""
    free = sw.integrate(sw.NBody(force=force), method, **START, dt=0.01, steps=50, every=7)
    controlled = sw.integrate(
        sw.NBody(force=force), method, **START, dt=0.01, steps=50, every=7, control=sw.EnergyControl(0.0, form)
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


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("form", FORMS)
def test_a_gain_for_each_member_equals_single_runs(form: str, method: str) -> None:
    gains, targets = np.geomspace(1e-3, 30.0, 11), np.linspace(2.5, 3.5, 11)
    control = sw.EnergyControl(gains, form, target=targets)
    batch = quiet(sw.NBody(), method, **spread(11, **START), dt=0.01, steps=200, every=50, control=control)
    for i, (gain, target) in enumerate(zip(gains, targets, strict=True)):
        one = quiet(
            sw.NBody(), method, **START, dt=0.01, steps=200, every=50, control=sw.EnergyControl(gain, form, target=target)
        )
        np.testing.assert_array_equal(one.v, batch.v[..., i])
        np.testing.assert_array_equal(one.y, batch.y[..., i])
        assert one.first_bad_step == batch.first_bad_step[i]


SIZES = [(3, 2, 1), (3, 2, 13), (2, 3, 5), (9, 3, 9), (40, 2, 1), (40, 3, 3)]
TURNS = {turn: i for i, turn in enumerate(itertools.product(SIZES, FORMS, FORCES))}


def takes_its_turn(size: tuple[int, int, int], form: str, force: str, method: str) -> bool:
    """By default two methods for each of the others, which take turns."""
    return (TURNS[size, form, force] - STEPPED.index(method)) % len(STEPPED) < 2


@pytest.mark.parametrize(
    ("size", "form", "force", "method"),
    family(itertools.product(SIZES, FORMS, FORCES, STEPPED), takes_its_turn),
)
def test_both_backends_agree_to_the_bit(size: tuple[int, int, int], form: str, force: str, method: str) -> None:
    """In batches of one and more, and alone."""
    bodies, dim, members = size
    if sw.method(method).has_derivatives and bodies > MOST_IN_SERIES:
        pytest.skip("a series of so many bodies is refused, and the reference of an implicit step goes number by number")
    rng = np.random.default_rng([bodies, dim, members])
    system = sw.NBody(rng.uniform(0.5, 2.0, bodies) / bodies, force=force, softening=0.1)
    v, y = rng.normal(size=(2, bodies, dim, members))
    control = sw.EnergyControl(rng.uniform(0.0, 3.0, members), form, target=rng.normal(size=members))
    options: dict[str, Any] = {"dt": 0.01, "steps": 12, "every": 5}
    runs = [quiet(system, method, v=v, y=y, **options, control=control, backend=name) for name in ("rust", "numpy")]
    assert_same(*runs)
    alone = sw.EnergyControl(0.7, form)
    runs = [quiet(system, method, v=v[..., 0], y=y[..., 0], **options, control=alone, backend=name) for name in ("rust", "numpy")]
    assert_same(*runs)


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("members", [None, 5])
def test_a_run_in_pieces_goes_on_to_the_bit(members: int | None, form: str, method: str) -> None:
    """The target is the energy of the very first start, and the gain that of its kinetic energy, not those of the piece's."""
    start = START if members is None else spread(members, **START)
    control = sw.EnergyControl(relative=0.3 if members is None else np.linspace(0.1, 0.9, members), form=form)
    whole = sw.integrate(sw.NBody(), method, **start, dt=0.01, steps=100, every=10, control=control)
    first = sw.integrate(sw.NBody(), method, **start, dt=0.01, steps=40, every=10, control=control)
    rest = sw.integrate(sw.NBody(), method, resume=first, dt=0.01, steps=60, every=10)
    np.testing.assert_array_equal(whole.v[4:], rest.v)
    np.testing.assert_array_equal(whole.y[4:], rest.y)
    np.testing.assert_array_equal(whole.t[4:], rest.t)


def test_the_control_that_is_given_is_not_changed() -> None:
    control = sw.EnergyControl(relative=0.3)
    sw.integrate(sw.NBody(), "rk4", **START, dt=0.01, steps=1, control=control)
    assert control.gain is None
    assert control.target is None
    bodies = sw.NBody()
    sw.integrate(bodies, "rk4", **START, dt=0.01, steps=1, control=control)
    assert bodies.control is None


# ---- projection


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("force", FORCES)
def test_scaling_keeps_the_energy_to_rounding(force: str, method: str) -> None:
    """E is a sum of six terms below 10 in size: some roundings of 1e-15 each. Methods of order up to 5 leave it by more alone."""
    options: dict[str, Any] = {"dt": 0.01, "steps": 100, "every": 1}
    run = sw.integrate(sw.NBody(force=force), method, **START, **options, control=sw.Projection())
    assert np.ptp(run.energy) < 2e-14
    alone = np.ptp(sw.integrate(sw.NBody(force=force), method, **START, **options).energy)
    assert alone > 4e-13 or sw.method(method).order > 5


@pytest.mark.parametrize("method", STEPPED)
def test_nacozys_way_is_one_step_of_newton(method: str) -> None:
    """What is left of a step's error ε is of second order in it: after every step below ε², with ε ≤ h²·|a|²·3 < 1e-3 here."""
    run = sw.integrate(sw.NBody(), method, **START, dt=0.01, steps=50, every=1, control=sw.Projection("nacozy"))
    assert np.ptp(run.energy) < 1e-6


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("way", ["scaling", "nacozy"])
@pytest.mark.parametrize("bodies", [2, 3, 20])
def test_projections_keep_the_promises(bodies: int, way: str, method: str) -> None:
    """The same by both backends, in a batch and alone, in one piece and in two."""
    if sw.method(method).has_derivatives and bodies > MOST_IN_SERIES:
        pytest.skip("a series of so many bodies is refused, and the reference of an implicit step goes number by number")
    rng = np.random.default_rng(bodies)
    system = sw.NBody(np.ones(bodies) / bodies, force="newton", softening=0.1)
    v, y = rng.normal(size=(2, bodies, 2, 5))
    options: dict[str, Any] = {"dt": 0.01, "every": 5}
    batch = sw.integrate(system, method, v=v, y=y, **options, steps=20, control=sw.Projection(way))
    assert_same(batch, sw.integrate(system, method, v=v, y=y, **options, steps=20, control=sw.Projection(way), backend="numpy"))
    one = {"v": v[..., 3], "y": y[..., 3]}
    alone = sw.integrate(system, method, **one, **options, steps=20, control=sw.Projection(way))
    np.testing.assert_array_equal(alone.y, batch.y[..., 3])
    first = sw.integrate(system, method, **one, **options, steps=10, control=sw.Projection(way))
    rest = sw.integrate(system, method, resume=first, **options, steps=10)
    np.testing.assert_array_equal(alone.y[2:], rest.y)


# ---- what is refused


@pytest.mark.parametrize("method", [m.name for m in sw.methods() if m.carry is not None])
@pytest.mark.parametrize("control", [sw.EnergyControl(0.3), sw.Projection(), sw.Projection("nacozy")])
def test_methods_that_go_on_without_a_velocity_are_refused(method: str, control: Any) -> None:
    with pytest.raises(UnsupportedError, match=rf"control: {method} carries (y_prev|v_half) in place of v.*use pefrl"):
        sw.integrate(sw.NBody(), method, **START, dt=0.01, steps=1, control=control)


@pytest.mark.parametrize("system", [sw.Oscillator(), sw.Chain(3)], ids=["oscillator", "chain"])
def test_other_systems_are_refused(system: sw.System) -> None:
    with pytest.raises(UnsupportedError, match="control"):
        sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.01, steps=1, control=sw.EnergyControl(0.3))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({}, ArgumentError, "expected one of them, got neither"),
        ({"gain": 1.0, "relative": 1.0}, ArgumentError, "expected one of them, got both"),
        ({"gain": -1.0}, ArgumentError, "gain: expected numbers of zero or more, got -1"),
        ({"gain": "much"}, DTypeError, "gain: expected real numbers"),
        ({"gain": math.nan}, NotFiniteError, "gain: expected finite numbers, got nan"),
        ({"relative": [0.1, -0.2]}, ArgumentError, r"relative: expected numbers of zero or more, got -0\.2"),
        ({"gain": 1.0, "target": math.inf}, NotFiniteError, "target: expected finite numbers"),
        ({"gain": 1.0, "form": "limitd"}, UnknownNameError, "form: there is no 'limitd'; did you mean 'limited'"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        sw.EnergyControl(**arguments)


def test_what_a_run_cannot_use_is_named() -> None:
    with pytest.raises(DTypeError, match=r"control: expected an EnergyControl.*got float"):
        sw.integrate(sw.NBody(), "rk4", **START, dt=0.01, steps=1, control=0.3)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="relative: a start at rest has no kinetic energy"):
        sw.integrate(sw.NBody(), "rk4", v=0.0, y=OUT, dt=0.01, steps=1, control=sw.EnergyControl(relative=0.1))


@pytest.mark.parametrize("argument", ["gain", "relative", "target"])
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
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert per_step(plan, np.array(1e308)) == np.inf
