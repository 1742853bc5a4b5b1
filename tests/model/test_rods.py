"""Rods: the pendulum in space against known periods, chains of rods against equations in angles, control against resetting."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnsupportedError
from stepwell.reference.systems import rods
from stepwell.scenes.elliptic import quarter
from support.cases import assert_same
from support.rods import CONTROL, RESETTING, TWO, apart_from_angles, cone, hanging, quiet

STEPPED = [m.name for m in sw.methods() if not m.needs_acceleration]
KEPT = {"free": None, "control": CONTROL, "resetting": RESETTING}

THREE = sw.Rods([1.0, 1.0, 1.0], [((0.0, 0.0), 0), (0, 1), (1, 2)], 1.0)


def swing(degrees: float) -> dict[str, Any]:
    """From rest at an angle from below."""
    angle = math.radians(degrees)
    return {"v": 0.0, "y": [math.sin(angle), 0.0, -math.cos(angle)]}


def period(run: sw.Run) -> float:
    """The mean time between passages through the lowest point to one side."""
    x = run.y[:, 0]
    i = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    t = run.t[i] - x[i] * run.dt / (x[i + 1] - x[i])
    return float(np.diff(t).mean())


# ---- the pendulum in space


@pytest.mark.parametrize(("degrees", "dt", "facts"), [(10, 0.01, 6.2951685), (90, 0.01, 7.416303), (170, 0.005, 15.327010)])
def test_planar_periods(degrees: float, dt: float, facts: float) -> None:
    """FACTS §4 and §5. Control makes RK4 a method of order 2 (see below), resetting leaves its own error, far smaller."""
    true = 4.0 * quarter(math.sin(math.radians(0.5 * (180.0 - degrees))))
    for control, bound in ((CONTROL, 5e-5), (RESETTING, 3e-7)):
        run = sw.integrate(sw.Pendulum3D(), "rk4", **swing(degrees), dt=dt, steps=round(75.0 / dt), every=1, control=control)
        # A passage is found by a straight line within a step, which errs by the third power of dt where y bends least.
        assert period(run) == pytest.approx(true, abs=bound)
        if control is CONTROL:  # at 170° each period is 1.25e-5 longer than the one before, and the fact is that of one of them
            assert period(run) == pytest.approx(facts, abs=2e-6 if degrees < 170 else 1e-5)


def test_periods_scale_with_length_and_gravity() -> None:
    """√(l/g), one member each."""
    length, gravity = np.array([1.0, 4.0, 0.5]), np.array([1.0, 9.81, 2.0])
    y = np.array([[1.0], [0.0], [0.0]]) * length
    scale = np.sqrt(length / gravity)
    for i, each in enumerate(scale):
        alone = sw.Pendulum3D(length[i], gravity[i])
        run = sw.integrate(alone, "rk4", v=0.0, y=y[:, i], dt=0.01 * each, steps=3000, every=1)
        assert period(run) / each == pytest.approx(7.4162987092054876737, rel=1e-6)
        batch = sw.integrate(sw.Pendulum3D(length, gravity), "rk4", v=0.0, y=y, dt=0.01 * each, steps=3000, every=1)
        np.testing.assert_array_equal(batch.y[..., i], run.y)


@pytest.mark.parametrize("control", KEPT.values(), ids=KEPT)
def test_the_conical_pendulum_returns(control: Any) -> None:
    start, turn = cone()
    assert turn == pytest.approx(4.442883, abs=1e-6)
    wrong = []
    for steps in (200, 400):
        run = sw.integrate(sw.Pendulum3D(), "rk4", **start, dt=turn / steps, steps=steps, control=control)
        wrong.append(np.abs(run.y[-1] - start["y"]).max())
    # The control's gains grow as 1/h and 1/h², and feed the errors of the stages back: what is left is order 2.
    assert wrong[0] / wrong[1] == pytest.approx(4.0 if control is CONTROL else 16.0, rel=0.03)
    assert wrong[1] < (4e-6 if control is CONTROL else 1e-8)


@pytest.mark.parametrize(
    ("method", "left"),
    [
        *((name, 2) for name in ("standard_heun", "fehlberg", "merson", "rk4")),
        *((name, 1) for name in ("false_euler", "semi_false_heun", "fehlberg_5")),
    ],
)
def test_control_leaves_coordinates_order_two_or_one(method: str, left: int) -> None:
    """And the velocity along the rod order one, whatever the method's own, which resetting leaves as it is.

    So the document's supposition can hold for methods of first order only.
    """
    start, turn = cone()
    wrong: dict[str, list[float]] = {"control": [], "resetting": []}
    along = []
    for steps in (400, 800):
        for name, errors in wrong.items():
            run = sw.integrate(sw.Pendulum3D(), method, **start, dt=turn / steps, steps=steps, control=KEPT[name])
            errors.append(np.abs(run.y[-1] - start["y"]).max())
            along += [abs(run.v[-1] @ run.y[-1])] * (name == "control")
    assert math.log2(along[0] / along[1]) == pytest.approx(1.0, abs=0.05)
    slopes = {name: math.log2(errors[0] / errors[1]) for name, errors in wrong.items()}
    # False Euler's error is one of order 2 yet at these steps; its order is 1 where the next is small.
    assert slopes["control"] == pytest.approx(left, abs=0.45 if method == "false_euler" else 0.07)
    assert slopes["resetting"] == pytest.approx(sw.method(method).order, abs=0.1)
    assert (wrong["control"][0] < wrong["resetting"][0]) == (method == "false_euler")


@pytest.mark.parametrize("control", KEPT.values(), ids=KEPT)
def test_energy_and_the_spin_about_the_vertical_stay(control: Any) -> None:
    """To the order of the method, or to that of the control, 2; the start is along the sphere, 0.8·0.15 = 0.6·0.2."""
    start: dict[str, Any] = {"v": [0.15, 0.6, 0.2], "y": [0.8, 0.0, -0.6]}
    names = ["energy", "angular_momentum", "length_error"]
    lost = []
    for steps in (500, 1000):
        run = sw.integrate(sw.Pendulum3D(), "rk4", **start, dt=10 / steps, steps=steps, every=1, control=control, record=names)
        energy, spin, length = (run.recorded[name] for name in names)
        assert spin[0, 2] == pytest.approx(0.8 * 0.6)
        lost.append([np.abs(energy - energy[0]).max(), np.abs(spin[:, 2] - spin[0, 2]).max(), length.max()])
    ratios = np.array(lost[0]) / np.array(lost[1])
    assert (ratios[:2] > (3.8 if control is CONTROL else 14.0)).all()
    if control is not RESETTING:
        assert ratios[2] > 3.8
    assert lost[1][2] < (1e-15 if control is RESETTING else 1e-6)


def test_one_rod_is_the_pendulum() -> None:
    """Rods with one rod, whatever its mass, moves like the pendulum in space, but for rounding."""
    start: dict[str, Any] = {"v": [0.15, 0.6, 0.2], "y": [0.8, 0.0, -0.6]}
    for control in KEPT.values():
        options: dict[str, Any] = {"dt": 0.01, "steps": 500, "control": control}
        one = sw.integrate(sw.Pendulum3D(), "rk4", **start, **options)
        for mass in (1.0, 0.3):
            rod = sw.Rods([mass], [((0.0, 0.0, 0.0), 0)], 1.0)
            run = sw.integrate(rod, "rk4", v=[start["v"]], y=[start["y"]], **options)
            # 500 steps of some 10 roundings each, which a regular motion sums up at most linearly.
            np.testing.assert_allclose(run.y[-1, 0], one.y[-1], rtol=0, atol=5e-13)
        far = np.array([3.0, -2.0, 7.0])
        moved = sw.integrate(sw.Rods([1.0], [(0, far)], 1.0), "rk4", v=[start["v"]], y=[start["y"] + far], **options)
        np.testing.assert_allclose(moved.y[-1, 0] - far, one.y[-1], rtol=0, atol=1e-11)


def test_what_needs_an_acceleration_is_refused() -> None:
    for name in ("verlet", "leapfrog", "pefrl"):
        for system, y in ((sw.Pendulum3D(), np.ones(3)), (TWO, hanging(1.0, 2.0))):
            with pytest.raises(UnsupportedError, match="needs forces that do not depend on the velocity"):
                sw.integrate(system, name, v=0.0, y=y, dt=0.1, steps=1)


# ---- the control and its limit


def limit(method: str) -> float:
    """Of a critically damped oscillator; Ċ̇ + 2αĊ + α²C = 0 is one, with Φ = αh = c."""
    return float(sw.stability_limit(sw.Oscillator(1.0, damping=1.0), method))


def stays(method: str, c: float, degrees: float, dt: float, steps: int = 7500) -> bool:
    """Whether the rod stays near its length."""
    options: dict[str, Any] = {"dt": dt, "steps": steps, "record": "length_error", "every": steps // 100}
    run = quiet(sw.Pendulum3D(), method, **swing(degrees), **options, control=sw.LengthControl(c))
    return not run.status and bool(run.recorded["length_error"].max() < 0.1)


def test_the_limits_of_the_facts() -> None:
    """FACTS §5: False Euler to 2(√2 − 1), RK4 to 2.785."""
    assert limit("false_euler") == pytest.approx(2.0 * (math.sqrt(2.0) - 1.0), rel=1e-12)
    assert limit("rk4") == pytest.approx(2.785, abs=5e-4)
    assert stays("false_euler", 0.82, 90.0, 0.01)
    assert not stays("false_euler", 0.84, 90.0, 0.01)
    assert stays("rk4", 2.70, 10.0, 0.01)
    assert not stays("rk4", 2.78, 10.0, 0.01)  # an error near 1 in a thousand is already too large for the linear limit


@pytest.mark.parametrize("method", STEPPED)
def test_every_method_has_the_limit_of_its_damped_oscillator(method: str) -> None:
    """From both sides, for a swing so small and a step so short that the rod's error is that of a linear oscillator.

    1 % above, an error grows by at least 1 % a step, to e⁷⁵ times itself; it is about 1e-12 and more at the start.
    """
    if math.isinf(limit(method)):
        assert stays(method, 20.0, 1.0, 1e-3)
        return
    assert stays(method, 0.95 * limit(method), 1.0, 1e-3)
    assert not stays(method, 1.01 * limit(method), 1.0, 1e-3)


def test_a_wide_swing_has_a_lower_limit() -> None:
    """The linear limit holds for small errors of the length. Those of RK4 at 90° are too large for it already at 0.01."""
    assert stays("rk4", 2.60, 90.0, 0.01)
    assert not stays("rk4", 2.70, 90.0, 0.01)
    assert stays("rk4", 2.70, 90.0, 0.001)


@pytest.mark.parametrize("method", ["false_euler", "rk4"])
def test_a_rod_of_a_wrong_length_returns(method: str) -> None:
    """From 1 % too long, at rest hanging: C = C₀(1 + αt)e^(−αt), with α = c/h; after 40 units of αt nothing is left."""
    for c in (0.1, 0.5):
        run = quiet(sw.Pendulum3D(), method, v=0.0, y=[0.0, 0.0, -1.01], dt=1e-3, steps=400, every=1, control=sw.LengthControl(c))
        error = 0.5 * (run.y[:, 2] ** 2 - 1.0)
        after = int(1.0 / c)
        known = error[0] * (1.0 + c * after) * math.exp(-c * after)
        # C is the oscillator's but for terms of the second order in C, and False Euler's own error, of the order c.
        assert error[after] == pytest.approx(known, rel=0.02 if method == "rk4" else c)
        assert abs(error[-1]) < 1e-13


def test_standard_euler_adds_energy_until_it_breaks_the_rod() -> None:
    """FACTS §5: under control it diverges near step 5776. Resetting goes on with an energy that is wrong by more than itself."""
    options: dict[str, Any] = {"dt": 0.01, "steps": 7500, "every": 1, "record": "length_error"}
    run = quiet(sw.Pendulum3D(), "standard_euler", **swing(90.0), **options, control=CONTROL)
    error = run.recorded["length_error"]
    assert 5700 < int(np.flatnonzero(~(error < 1.0))[0]) < 5850
    assert run.first_bad_step > 5800
    reset = sw.integrate(sw.Pendulum3D(), "standard_euler", **swing(90.0), **options, control=RESETTING)
    assert np.abs(reset.energy).max() > 1.0


def test_control_against_resetting() -> None:
    """FACTS §5: at 90°, T = 0.01, over 75 units. The document supposes that control is better: by False Euler it is."""
    results = {}
    for method in ("false_euler", "rk4"):
        for name, control in KEPT.items():
            run = quiet(sw.Pendulum3D(), method, **swing(90.0), dt=0.01, steps=7500, every=1, control=control)
            results[method, name] = period(run), float(np.abs(run.energy - run.energy[0]).max())
    assert results["false_euler", "control"] == pytest.approx((7.41611, 6.4e-3), rel=0.01)
    assert results["false_euler", "control"][0] == pytest.approx(7.41611, abs=5e-6)
    assert results["false_euler", "resetting"] == pytest.approx((8.266, 0.836), rel=1e-3)
    assert results["rk4", "resetting"][1] == pytest.approx(1.45e-9, rel=0.02)
    assert results["rk4", "control"][1] == pytest.approx(2.25e-6, rel=0.02)


# ---- resetting


@pytest.mark.parametrize("name", ["pendulum", "two", "three", "triangle"])
def test_resetting_is_exact(name: str) -> None:
    """Lengths and Ċ to rounding, from errors of the length of a step that is far too long."""
    system, y = {
        "pendulum": (sw.Pendulum3D(2.0), np.array([1.2, 0.0, -1.6])),
        "two": (TWO, hanging(1.0, 2.5)),
        "three": (THREE, hanging(1.0, 2.5, -0.3)),
        "triangle": (sw.Rods([1.0, 2.0, 0.5], [(0, 1), (1, 2), (2, 0)], 1.0), np.array([[0, 0], [1, 0], [0.5, 0.75**0.5]])),
    }[name]
    rng = np.random.default_rng(3)
    v, y = rng.normal(size=(20, *y.shape)), y + rng.normal(0.0, 0.004, (20, *y.shape))
    v, y = np.moveaxis(v, 0, -1), np.moveaxis(y, 0, -1)
    s = system.under(RESETTING, ()).reference_at_step(0.1, (20,))
    assert s.record("length_error", v, y).max() > 4e-3
    after_v, after_y = s.project(v, y)
    # |d|² is a sum of three products, each rounded, of coordinates of up to 3: some 10 roundings of a length.
    assert s.record("length_error", after_v, after_y).max() < 10 * 2.0**-52
    d, u = ([after_y], [after_v]) if name == "pendulum" else (s.spans(after_y), s.closing(after_v))
    for span, rate in zip(d, u, strict=True):
        np.testing.assert_allclose(rods.dot(span, rate), 0.0, rtol=0, atol=1e-14 * np.abs(v).max())
    again_v, again_y = s.project(after_v, after_y)
    np.testing.assert_allclose(again_y, after_y, rtol=0, atol=1e-14)
    np.testing.assert_allclose(again_v, after_v, rtol=0, atol=1e-13)


def test_three_corrections_take_two_per_cent_to_rounding_and_two_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """One rod: a correction of the length 1 + ε leaves ε²/2, so three of them ε⁸/128: 0.018⁸/128 = 2⁻⁵⁴, 0.04⁸/128 = 5e-14."""
    rod = sw.Rods([1.0], [((0.0, 0.0), 0)], 1.0).under(RESETTING, ()).reference_at_step(0.1, ())
    left = {}
    for corrections in (2, 3):
        monkeypatch.setattr(rods, "CORRECTIONS", corrections)
        for off in (0.018, 0.04):
            left[corrections, off] = float(np.hypot(*rod.project(np.zeros((1, 2)), np.array([[1.0 + off, 0.0]]))[1][0])) - 1.0
    assert abs(left[3, 0.018]) <= 2.0**-52
    assert left[3, 0.04] == pytest.approx(0.04**8 / 128, rel=0.3)
    assert left[2, 0.018] == pytest.approx(0.018**4 / 8, rel=0.1)


def test_three_corrections_suffice_for_usual_steps() -> None:
    """A wild double pendulum by False Euler, a hundred steps a unit of time, and by RK4 with ten: every state has its lengths."""
    for method, dt in (("false_euler", 0.01), ("rk4", 0.1)):
        run = sw.integrate(
            TWO, method, v=0.0, y=hanging(2.0, 2.5), dt=dt, steps=2000, every=1, record="length_error", control=RESETTING
        )
        assert run.recorded["length_error"].max() < 5 * 2.0**-52


def test_resetting_keeps_momentum_and_the_centre_of_mass() -> None:
    """Pulls of free rods are equal and opposite; the least change by masses has no net motion."""
    masses = np.array([1.0, 2.0, 0.5])
    triangle = sw.Rods(masses, [(0, 1), (1, 2), (2, 0)], 1.0, gravity=0.0)
    y = np.array([[0, 0], [1, 0], [0.5, 0.75**0.5]])
    v = np.array([[0.3, 0.1], [0.3, 0.9], [-0.4, 0.5]])
    run = sw.integrate(triangle, "rk4", v=v, y=y, dt=0.1, steps=1000, every=10, record="angular_momentum", control=RESETTING)
    np.testing.assert_allclose(masses @ run.v, np.broadcast_to(masses @ run.v[0], (101, 2)), rtol=0, atol=1e-12)
    drift = masses @ run.y - masses @ y - run.t[:, None] * (masses @ run.v[0])
    np.testing.assert_allclose(drift, 0.0, rtol=0, atol=1e-10)
    spin = run.recorded["angular_momentum"]
    assert abs(spin - spin[0]).max() < 1e-3 * abs(spin[0])


# ---- several rods


def test_two_rods_are_the_double_pendulum() -> None:
    """Independent equations. The motion is near chaos: in ten units of time it multiplies errors by less than 1000."""
    assert apart_from_angles() < 1e-9


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_small_swings_of_a_chain(n: int) -> None:
    """n equal rods and masses swing at √(g/l·x), x a zero of Laguerre's polynomial of degree n: for two 2 ± √2."""
    chain = sw.Rods(np.ones(n), [((0.0, 0.0), 0), *((i, i + 1) for i in range(n - 1))], 0.5, gravity=2.0)
    rest = np.stack([np.zeros(n), -0.5 * np.arange(1.0, n + 1.0)], axis=-1)
    eigenvalues = sw.jacobian(chain, v=0.0, y=rest).eigenvalues
    # n swings of two eigenvalues each, and as many zeros where a rod's length only stays what it is.
    frequencies = np.sort(eigenvalues.imag[eigenvalues.imag > 1e-3])
    known = np.sqrt(4.0 * np.sort(np.polynomial.laguerre.lagroots([0.0] * n + [1.0])))
    np.testing.assert_allclose(frequencies, known, rtol=1e-9)


@pytest.mark.parametrize("control", KEPT.values(), ids=KEPT)
def test_the_energy_of_a_triple_pendulum_stays_to_the_order(control: Any) -> None:
    lost = []
    for steps in (400, 800):
        run = sw.integrate(THREE, "rk4", v=0.0, y=hanging(1.0, 0.7, 1.4), dt=3 / steps, steps=steps, every=1, control=control)
        lost.append(np.abs(run.energy - run.energy[0]).max())
    assert lost[0] / lost[1] > (3.8 if control is CONTROL else 14.0)
    assert lost[1] < 1e-6


def test_a_dumb_bell_turns_and_flies() -> None:
    """Free: two masses about their centre at |u|/l, the centre on a parabola. The angular momentum about the centre stays."""
    masses = np.array([1.0, 3.0])
    u, centre = 2.0, np.array([0.5, 1.5])
    y, v = np.array([[-0.75, 0.0], [0.25, 0.0]]), np.array([[0.0, -0.75 * u], [0.0, 0.25 * u]]) + centre
    rod = sw.Rods(masses, [(0, 1)], 1.0)
    t = 1.7
    run = sw.integrate(rod, "dop853", v=v, y=y, dt=t / 200, steps=200)
    middle = masses @ run.y[-1] / 4.0
    np.testing.assert_allclose(middle, centre * t - [0.0, 0.5 * t * t], rtol=0, atol=1e-12)
    turned = np.array([math.cos(u * t), math.sin(u * t)])
    np.testing.assert_allclose(run.y[-1, 1] - run.y[-1, 0], turned, rtol=0, atol=1e-12)
    space = sw.Rods(masses, [(0, 1)], 1.0, gravity=0.0, dim=3)
    flat = [np.concatenate([each, np.zeros((2, 1))], axis=1) for each in (v, y)]
    run = sw.integrate(space, "rk4", v=flat[0], y=flat[1], dt=0.01, steps=100, every=100, record="angular_momentum")
    known = masses @ (y[:, 0] * v[:, 1] - y[:, 1] * v[:, 0])
    np.testing.assert_allclose(run.recorded["angular_momentum"], [[0.0, 0.0, known]] * 2, rtol=0, atol=1e-9)


def test_a_bob_between_two_anchors_stands_or_turns() -> None:
    """Two rods to two anchors leave a circle about the line through them: a pendulum of the length of the height, √(l² − a²)."""
    a, length = 0.6, 1.0
    swing_length = math.sqrt(length**2 - a**2)
    bob = sw.Rods([1.0], [((-a, 0.0, 0.0), 0), ((a, 0.0, 0.0), 0)], length)
    assert bob.has_loops
    y = [[0.0, swing_length, 0.0]]
    run = sw.integrate(bob, "rk4", v=0.0, y=y, dt=0.01, steps=3000, every=1)
    run.y = run.y[:, 0, 1:]
    assert period(run) == pytest.approx(7.4162987092054876737 * math.sqrt(swing_length), rel=1e-6)


def test_a_gain_and_masses_of_each_member_equal_single_runs() -> None:
    """c, masses, lengths and gravity over the batch, each member alone, with either backend."""
    rng = np.random.default_rng(2)
    c, masses, lengths = rng.uniform(0.0, 0.7, 7), rng.uniform(0.5, 2.0, (2, 7)), rng.uniform(0.9, 1.1, (2, 7))
    gravity = rng.uniform(0.5, 2.0, 7)
    ends = [((0.0, 0.0), 0), (0, 1)]
    options: dict[str, Any] = {"v": 0.0, "dt": 0.01, "steps": 60, "every": 20, "record": ["length_error", "energy"]}
    y = np.repeat(hanging(1.0, 2.0)[..., None], 7, axis=-1)
    whole = sw.integrate(
        sw.Rods(masses, ends, lengths, gravity=gravity), "rk4", y=y, **options, control=sw.LengthControl(c), threads=2
    )
    for i in range(7):
        alone = sw.Rods(masses[:, i], ends, lengths[:, i], gravity=gravity[i])
        for backend in ("rust", "numpy"):
            run = sw.integrate(alone, "rk4", y=y[..., i], **options, control=sw.LengthControl(c[i]), backend=backend)
            np.testing.assert_array_equal(run.y, whole.y[..., i])
            for name, values in run.recorded.items():
                np.testing.assert_array_equal(values, whole.recorded[name][..., i])
                np.testing.assert_array_equal(values, run.quantity(name))


@pytest.mark.parametrize("control", [CONTROL, RESETTING], ids=repr)
def test_a_world_and_pieces_are_the_run(control: Any) -> None:
    y = hanging(1.0, 2.0)
    whole = sw.integrate(TWO, "rk4", v=0.0, y=y, dt=0.01, steps=30, every=1, control=control, backend="numpy")
    first = sw.integrate(TWO, "rk4", v=0.0, y=y, dt=0.01, steps=12, control=control)
    rest = sw.integrate(TWO, "rk4", resume=first, steps=18)
    np.testing.assert_array_equal(rest.y[-1], whole.y[-1])
    world = sw.World(TWO, "rk4", v=np.zeros((2, 2)), y=y.copy(), dt=0.01, control=control)
    world.step(12)
    on = sw.World(TWO, "rk4", dt=0.01, resume=world)
    on.step(18)
    np.testing.assert_array_equal(on.y, whole.y[-1])
    assert repr(control) in repr(on.system)
    fused = [
        sw.integrate(TWO, "rk4", v=0.0, y=y, dt=0.01, steps=30, control=control, fused=True, backend=b) for b in ("rust", "numpy")
    ]
    assert_same(*fused)
    assert not np.array_equal(fused[0].y[-1], whole.y[-1])


@pytest.mark.parametrize("control", [CONTROL, RESETTING], ids=repr)
def test_an_exported_step_and_its_explanation_have_the_control(control: Any) -> None:
    """Without a state, which neither needs; the numbers of a step in plain Python are those of the run."""
    scope: dict[str, Any] = {}
    exec(sw.export(TWO, "rk4", "python", dt=0.01, control=control, name="swing").source, scope)
    swing = scope["Swing"]()
    state = swing.start([0.0] * 4, hanging(1.0, 2.0).reshape(-1).tolist())
    for _ in range(20):
        swing.step(state)
    run = sw.integrate(TWO, "rk4", v=0.0, y=hanging(1.0, 2.0), dt=0.01, steps=20, control=control)
    assert (state.v, state.y) == (run.v[-1].reshape(-1).tolist(), run.y[-1].reshape(-1).tolist())
    plain, controlled = (sw.explain(TWO, "rk4", control=each) for each in (None, control))
    assert sum(controlled.computed.values()) > sum(plain.computed.values())
    assert ("2·c" in str(controlled)) == (control is CONTROL)


def test_a_long_chain_has_no_term_too_many() -> None:
    """Neighbours only are coupled: a rod more costs as much each time, and a step too long for one tape is done in parts."""
    counts = []
    for n in (4, 5, 6):
        chain = sw.Rods(np.ones(n), [((0.0, 0.0), 0), *((i, i + 1) for i in range(n - 1))], 1.0)
        counts.append(sum(sw.explain(chain, "false_euler").computed.values()))
    assert counts[2] - counts[1] == counts[1] - counts[0] < 70
    n = 100
    chain = sw.Rods(np.ones(n), [((0.0, 0.0), 0), *((i, i + 1) for i in range(n - 1))], 1.0)
    y = np.stack([np.arange(1.0, n + 1.0), np.zeros(n)], axis=-1)
    for control in (RESETTING, CONTROL):
        runs = [
            sw.integrate(chain, "rk4", v=0.0, y=y, dt=0.01, steps=20, control=control, backend=b, record="length_error")
            for b in ("rust", "numpy")
        ]
        assert_same(*runs)
        assert runs[0].recorded["length_error"][-1] < (1e-14 if control is RESETTING else 1e-3)
