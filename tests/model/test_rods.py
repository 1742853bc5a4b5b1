"""Rods: the pendulum in space against known periods, chains of rods against equations in angles, control against resetting.

What cannot be is refused, what is doubtful is told, and deliberately wrong formulas are noticed.
"""

from __future__ import annotations

import itertools
import math
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, UnsupportedError
from stepwell.reference.systems import pendulum_3d, rods
from stepwell.scenes.elliptic import quarter
from support.calls import a_step, assert_raises, quiet
from support.cases import SYSTEMS, assert_same
from support.looped import looped
from support.mistakes import mistaken
from support.ways import assert_equal_ways, assert_same_run

STEPPED = [m.name for m in sw.methods() if not m.needs_acceleration]
CONTROL, RESETTING = sw.LengthControl(0.5), sw.Projection("length")
KEPT = {"free": None, "control": CONTROL, "resetting": RESETTING}


def chain(n: int, lengths: float = 1.0, gravity: float = 1.0) -> sw.Rods:
    """Rods with unit masses below the origin in a plane."""
    return sw.Rods(np.ones(n), [((0.0, 0.0), 0), *((i, i + 1) for i in range(n - 1))], lengths, gravity=gravity)


TWO, THREE = chain(2), chain(3)
HUNG, TRIANGLE = [((0, 0), 0)], [(0, 1), (1, 2), (2, 0)]
CORNERS = np.array([[0, 0], [1, 0], [0.5, 0.75**0.5]])


def hanging(*angles: float) -> Any:
    """Places of a chain of rods of length 1, each at an angle from straight down."""
    return np.cumsum([[math.sin(a), -math.cos(a)] for a in angles], axis=0)


def cone(degrees: float = 60.0) -> tuple[dict[str, Any], float]:
    """A start that circles at an angle from below, and its period 2π√(l·cosθ/g)."""
    angle = math.radians(degrees)
    omega = 1.0 / math.sqrt(math.cos(angle))
    y = [math.sin(angle), 0.0, -math.cos(angle)]
    return {"v": [0.0, omega * math.sin(angle), 0.0], "y": y}, 2.0 * math.pi / omega


@sw.system
def in_angles(t: Any, v: Any, y: Any, *, m: float = 2.0, long: float = 0.7) -> Any:
    """The double pendulum of rods 1 and ``long`` with masses 1 and m, gravity 1, by Lagrange's equations for its angles."""
    sine, cosine = np.sin(y[0] - y[1]), np.cos(y[0] - y[1])
    first = -m * long * v[1] ** 2 * sine - (1.0 + m) * np.sin(y[0])
    second = v[0] ** 2 * sine - np.sin(y[1])
    bottom = 1.0 + m * sine**2
    return np.array([(first - m * cosine * second) / bottom, ((1.0 + m) * second - cosine * first) / (long * bottom)])


def places(angles: Any, rates: Any, long: float = 0.7) -> tuple[Any, Any]:
    """v and y of the points, from angles and their rates."""
    lengths = np.array([1.0, long])
    y = np.stack([lengths * np.sin(angles), -lengths * np.cos(angles)], axis=-1)
    v = rates[..., None] * np.stack([lengths * np.cos(angles), lengths * np.sin(angles)], axis=-1)
    return np.cumsum(v, axis=-2), np.cumsum(y, axis=-2)


DOUBLE = sw.Rods([1.0, 2.0], [((0.0, 0.0), 0), (0, 1)], [1.0, 0.7])
ANGLES, RATES = np.array([1.5, -0.4]), np.array([0.3, 0.9])


def apart_from_angles(backend: str = "rust") -> float:
    """How far rods are from the same motion in angles, at t = 10, both to a tight tolerance."""
    v, y = places(ANGLES, RATES)
    options: dict[str, Any] = {"tolerance": 1e-13, "at": [10.0]}
    known = sw.integrate(in_angles(), "dop853", v=RATES, y=ANGLES, **options)
    try:
        run = quiet(DOUBLE, "dop853", v=v, y=y, backend=backend, max_steps=2000, **options)
    except ArgumentError:
        return math.inf
    apart = [np.abs(a - b).max() for a, b in zip((run.v[-1], run.y[-1]), places(known.y[-1], known.v[-1]), strict=True)]
    return float(np.nan_to_num(max(apart), nan=math.inf))


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


@looped("degrees, dt, facts", [(10, 0.01, 6.2951685), (90, 0.01, 7.416303), (170, 0.005, 15.327010)])
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


@looped("control", KEPT.values())
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


@looped(
    "method, left",
    [
        *((name, 2) for name in ("standard_heun", "fehlberg", "merson", "rk4")),
        *((name, 1) for name in ("false_euler", "semi_false_heun", "fehlberg_5")),
    ],
)
def test_control_leaves_coordinates_order_two_or_one(method: str, left: int) -> None:
    """And the velocity along the rod order one, whatever the method's own, which resetting leaves as it is."""
    # So the document's supposition can hold for methods of first order only.
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


@looped("control", KEPT.values())
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


def test_methods_and_controls_that_do_not_go_are_refused() -> None:
    one, two = (sw.Pendulum3D(), np.ones(3)), (TWO, hanging(1.0, 2.0))

    def run(system: sw.System, y: Any, method: str = "rk4", **options: Any) -> sw.Run:
        return a_step(system, method, y=y, **options)

    needs = "needs forces that do not depend on the velocity"
    accelerations = itertools.product(("verlet", "leapfrog", "pefrl"), (one, two))
    assert_raises(
        *((lambda method=method, of=of: run(*of, method), needs) for method, of in accelerations),
        (lambda: run(sw.Pendulum(), 1.0, control=CONTROL), "has no such constraint"),
        (lambda: run(*two, control=sw.NormControl(1.0)), "NormControl.* keeps a norm"),
        (lambda: run(*two, control=sw.EnergyControl(0.1)), "has no energy control"),
        (lambda: run(*two, control=sw.Projection("nacozy")), "has no energy control"),
        kind=UnsupportedError,
    )


# ---- the control and its limit


def limit(method: str) -> float:
    """Of a critically damped oscillator; Ċ̇ + 2αĊ + α²C = 0 is one, with Φ = αh = c."""
    return float(sw.stability_limit(sw.Oscillator(1.0, damping=1.0), method))


def stays(method: str, c: float, degrees: float, dt: float, steps: int = 7500) -> bool:
    """Whether the rod stays near its length."""
    options: dict[str, Any] = {"dt": dt, "steps": steps, "record": "length_error", "every": steps // 100}
    run = quiet(sw.Pendulum3D(), method, **swing(degrees), **options, control=sw.LengthControl(c))
    return not run.status and bool(run.recorded["length_error"].max() < 0.1)


@looped(
    "method, c, degrees, dt, stable",
    [
        ("false_euler", 0.82, 90.0, 0.01, True),
        ("false_euler", 0.84, 90.0, 0.01, False),
        ("rk4", 2.70, 10.0, 0.01, True),
        ("rk4", 2.78, 10.0, 0.01, False),
        ("rk4", 2.60, 90.0, 0.01, True),
        ("rk4", 2.70, 90.0, 0.01, False),
        ("rk4", 2.70, 90.0, 0.001, True),
    ],
)
def test_the_limits_of_the_facts(method: str, c: float, degrees: float, dt: float, stable: bool) -> None:
    """FACTS §5: False Euler to 2(√2 − 1), RK4 to 2.785.

    That is of small errors of the length. Those of RK4 at 90° are too large for it already at 0.01, near 1 in a thousand at 10°.
    """
    assert limit("false_euler") == pytest.approx(2.0 * (math.sqrt(2.0) - 1.0), rel=1e-12)
    assert limit("rk4") == pytest.approx(2.785, abs=5e-4)
    assert stays(method, c, degrees, dt) == stable


@looped("method", STEPPED)
def test_every_method_has_the_limit_of_its_damped_oscillator(method: str) -> None:
    """From both sides, for a swing so small and a step so short that the rod's error is that of a linear oscillator."""
    # 1 % above, an error grows by at least 1 % a step, to e⁷⁵ times itself; it is about 1e-12 and more at the start.
    if math.isinf(limit(method)):
        assert stays(method, 20.0, 1.0, 1e-3)
        return
    assert stays(method, 0.95 * limit(method), 1.0, 1e-3)
    assert not stays(method, 1.01 * limit(method), 1.0, 1e-3)


@looped("method", ["false_euler", "rk4"])
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


@looped("name", ["pendulum", "two", "three", "triangle"])
def test_resetting_is_exact(name: str) -> None:
    """Lengths and Ċ to rounding, from errors of the length of a step that is far too long."""
    system, y = {
        "pendulum": (sw.Pendulum3D(2.0), np.array([1.2, 0.0, -1.6])),
        "two": (TWO, hanging(1.0, 2.5)),
        "three": (THREE, hanging(1.0, 2.5, -0.3)),
        "triangle": (sw.Rods([1.0, 2.0, 0.5], TRIANGLE, 1.0), CORNERS),
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
        options: dict[str, Any] = {"dt": dt, "steps": 2000, "every": 1, "record": "length_error", "control": RESETTING}
        run = sw.integrate(TWO, method, v=0.0, y=hanging(2.0, 2.5), **options)
        assert run.recorded["length_error"].max() < 5 * 2.0**-52


def test_resetting_keeps_momentum_and_the_centre_of_mass() -> None:
    """Pulls of free rods are equal and opposite; the least change by masses has no net motion."""
    masses = np.array([1.0, 2.0, 0.5])
    triangle, y = sw.Rods(masses, TRIANGLE, 1.0, gravity=0.0), CORNERS
    v = np.array([[0.3, 0.1], [0.3, 0.9], [-0.4, 0.5]])
    run = sw.integrate(triangle, "rk4", v=v, y=y, dt=0.1, steps=1000, every=10, record="angular_momentum", control=RESETTING)
    np.testing.assert_allclose(masses @ run.v, np.broadcast_to(masses @ run.v[0], (101, 2)), rtol=0, atol=1e-12)
    drift = masses @ run.y - masses @ y - run.t[:, None] * (masses @ run.v[0])
    np.testing.assert_allclose(drift, 0.0, rtol=0, atol=1e-10)
    spin = run.recorded["angular_momentum"]
    assert abs(spin - spin[0]).max() < 1e-3 * abs(spin[0])


def test_two_rods_are_the_double_pendulum() -> None:
    """Independent equations. The motion is near chaos: in ten units of time it multiplies errors by less than 1000."""
    assert apart_from_angles() < 1e-9


@looped("n", [1, 2, 3, 5])
def test_small_swings_of_a_chain(n: int) -> None:
    """n equal rods and masses swing at √(g/l·x), x a zero of Laguerre's polynomial of degree n: for two 2 ± √2."""
    rest = np.stack([np.zeros(n), -0.5 * np.arange(1.0, n + 1.0)], axis=-1)
    eigenvalues = sw.jacobian(chain(n, 0.5, 2.0), v=0.0, y=rest).eigenvalues
    # n swings of two eigenvalues each, and as many zeros where a rod's length only stays what it is.
    frequencies = np.sort(eigenvalues.imag[eigenvalues.imag > 1e-3])
    known = np.sqrt(4.0 * np.sort(np.polynomial.laguerre.lagroots([0.0] * n + [1.0])))
    np.testing.assert_allclose(frequencies, known, rtol=1e-9)


@looped("control", KEPT.values())
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
    rng = np.random.default_rng(2)
    c, masses, lengths = rng.uniform(0.0, 0.7, 7), rng.uniform(0.5, 2.0, (2, 7)), rng.uniform(0.9, 1.1, (2, 7))
    gravity, y = rng.uniform(0.5, 2.0, 7), hanging(1.0, 2.0)
    options: dict[str, Any] = {"v": 0.0, "dt": 0.01, "steps": 60, "every": 20, "record": ["length_error", "energy"]}

    def run(y: Any, i: Any, **more: Any) -> sw.Run:
        rods = sw.Rods(masses[:, i], [((0.0, 0.0), 0), (0, 1)], lengths[:, i], gravity=gravity[i])
        return sw.integrate(rods, "rk4", y=y, **options, control=sw.LengthControl(c[i]), **more)

    whole = run(np.repeat(y[..., None], 7, axis=-1), slice(None), threads=2)
    for i, backend in itertools.product(range(7), ("rust", "numpy")):
        assert_same_run(run(y, i, backend=backend), whole, i)


def test_a_long_chain_has_no_term_too_many() -> None:
    """Neighbours only are coupled: a rod more costs as much each time, and a step too long for one tape is done in parts."""
    counts = [sum(sw.explain(chain(n), "false_euler").computed.values()) for n in (4, 5, 6)]
    assert counts[2] - counts[1] == counts[1] - counts[0] < 70
    y = np.stack([np.arange(1.0, 101.0), np.zeros(100)], axis=-1)[..., None]
    for control, bound in ((RESETTING, 1e-14), (CONTROL, 1e-3)):
        ask: dict[str, Any] = {"v": 0.0, "y": y, "dt": 0.01, "steps": 20, "record": "length_error", "control": control}
        run = assert_equal_ways(chain(100), "rk4", **ask, ways=("by the reference",))
        assert run.recorded["length_error"][-1] < bound


@looped(
    "masses, ends, lengths, error, message",
    [
        ([1.0], [], 1.0, ArgumentError, "rods: expected 1 to 100, got 0"),
        (np.ones(102), [(i, i + 1) for i in range(101)], 1.0, ArgumentError, "rods: expected 1 to 100, got 101"),
        ([1.0, 1.0], [(0, 2)], 1.0, ArgumentError, r"rods\[0\]\[1\]: expected a point, 0 to 1, .*, got 2"),
        ([1.0, 1.0], [(0, -1)], 1.0, ArgumentError, "expected a point, 0 to 1, .*, got -1"),
        ([1.0, 1.0], [(0, True)], 1.0, ArgumentError, "expected a point, 0 to 1, .*, got True"),
        ([1.0, 1.0], [(0, "b")], 1.0, DTypeError, "expected a point, 0 to 1, .*, got 'b'"),
        ([1.0, 1.0], [(0, 0)], 1.0, ArgumentError, "expected two different points, got 0 twice"),
        ([1.0, 1.0], [(0, 1), (1, 0)], 1.0, ArgumentError, r"rods\[1\]: expected each rod once"),
        ([1.0, 1.0], [(0, 1, 2)], 1.0, ShapeError, "expected two ends, got 3"),
        ([1.0, 1.0], [0, 1], 1.0, DTypeError, r"rods\[0\]: expected a list of two ends"),
        ([1.0, 1.0], 7, 1.0, DTypeError, "rods: expected a list of pairs of ends"),
        ([1.0], [((0, 0), (1, 1))], 1.0, ArgumentError, "expected a point at one end, got two anchors"),
        ([1.0], [((0, 0, 0, 0), 0)], 1.0, ShapeError, "expected an anchor of 2 or 3 coordinates"),
        ([1.0], [((0, math.nan), 0)], 1.0, NotFiniteError, r"rods\[0\]\[0\]: expected finite"),
        ([1.0, 1.0], HUNG, 1.0, ArgumentError, "every point at the end of one, got none for point 1"),
        ([1.0], HUNG, 0.0, ArgumentError, "lengths: expected numbers above zero"),
        ([1.0], HUNG, [1.0, 1.0], ShapeError, "lengths: expected one for each of 1 rods"),
        ([0.0], HUNG, 1.0, ArgumentError, "masses: expected numbers above zero"),
        (1.0, HUNG, 1.0, ShapeError, "masses: expected one for each point"),
        ([1.0], [*HUNG, ((1, 0), 0), ((0, 1), 0)], 1.0, ArgumentError, "rods: expected at most as many as coordinates, 2, got 3"),
    ],
)
def test_wrong_rods_are_refused(masses: Any, ends: Any, lengths: Any, error: type[Exception], message: str) -> None:
    assert_raises(
        (lambda: sw.Rods(masses, ends, lengths), error, message),
        (lambda: sw.Rods([1.0], HUNG, 1.0, dim=3), ShapeError, "rods, dim: expected one number of dimensions, got 2 and 3"),
        (lambda: sw.Pendulum3D(0.0), ArgumentError, "length: expected numbers above zero"),
        (lambda: sw.Pendulum3D(1.0, [math.inf]), NotFiniteError, "gravity"),
    )


@looped(
    "system, y, message",
    [
        (TWO, np.zeros((2, 2)), r"y: expected the ends of each rod apart, got those of the rod \(\(0.0, 0.0\), 0\)"),
        (TWO, np.ones((2, 2)), r"got those of the rod \(0, 1\) in one place"),
        (TWO, np.ones((2, 3)), r": expected shape \(2, 2, batch…\)"),
        (TWO, np.ones(2), r": expected shape \(2, 2, batch…\)"),
        (sw.Pendulum3D(), np.zeros(3), "y: expected the mass away from the origin"),
        (sw.Pendulum3D(), np.ones(2), r"y: expected shape \(3, batch…\)"),
        (
            sw.Rods(np.ones(4), [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)], 1.0),
            np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
            r"rods: expected each to restrict the motion, but at the start the rod \(1, 3\) adds nothing",
        ),
        (sw.Rods([1.0], [((-1.0, 0.0), 0), ((1.0, 0.0), 0)], 1.0), np.zeros((1, 2)), "restrict the motion"),
    ],
)
def test_starts_without_a_solution_are_refused_before_any_work(system: sw.System, y: Any, message: str) -> None:
    assert_raises(
        (lambda: a_step(system, y=y), ArgumentError, message),
        (lambda: sw.World(system, "rk4", v=np.zeros(y.shape), y=y.copy(), dt=0.1), ArgumentError, message),
    )


def test_a_rod_of_a_wrong_length_is_doubted() -> None:
    """Without control it stays as it started; control returns it, and then nothing is to be said."""
    start: dict[str, Any] = {"v": 0.0, "y": [0.0, 0.5, -1.2], "dt": 0.01, "steps": 1000}
    with pytest.warns(sw.AccuracyWarning, match=r"a rod is 30 % off its length in a saved state"):
        run = sw.integrate(sw.Pendulum3D(), "rk4", **start)
    assert np.sqrt((run.y[-1] ** 2).sum()) == pytest.approx(1.3, rel=1e-8)
    for control in (CONTROL, RESETTING):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sw.integrate(sw.Pendulum3D(), "rk4", **start, control=control)
    with pytest.warns(sw.AccuracyWarning, match=r"a rod is 50 % off"):
        sw.integrate(TWO, "rk4", v=0.0, y=[[0.0, -1.0], [0.0, -1.5]], dt=0.01, steps=2)


def test_they_say_what_they_are() -> None:
    assert repr(sw.Pendulum3D(2.0)) == "Pendulum3D(length=2.0, gravity=1.0)"
    assert repr(TWO) == "Rods([1.0, 1.0], [((0.0, 0.0), 0), (0, 1)], gravity=1.0)"
    assert repr(TWO.under(CONTROL, ())).endswith("LengthControl(0.5))")
    assert not TWO.has_loops
    assert sw.Rods([1.0], [(0, (1, 2))], 1.0).anchors == ((1.0, 2.0),)


#: Module, what to replace, by what, and what kind of mistake it is.
MUTANTS = [
    (rods, "self.fall * d[k][-1]", "self.fall * d[k][0]", "gravity along the wrong axis"),
    (rods, "pull = pull - self.fall", "pull = pull + self.fall", "a wrong sign of the weight"),
    (rods, "push[-1:] - self.fall", "push[-1:]", "no weight"),
    (rods, "self.minus[b] if b == first", "self.inverse[b] if b == first", "a wrong sign where rods meet"),
    (rods, "return self.minus[a]", "return self.inverse[a]", "a wrong sign where rods follow each other"),
    (rods, "self.inverse[b] + self.inverse[a] if", "self.inverse[b] if", "the mass of one end only"),
    (rods, "pull = self.h * dot(u[k], u[k])", "pull = self.h * dot(v[0], v[0])", "the wrong velocity"),
    (rods, "sums[a] - along", "sums[a] + along", "a pull the wrong way"),
    (rods, "2.0 * strength, 0.5 *", "strength, 0.5 *", "half the damping"),
    (rods, "0.5 * ((strength", "1.0 * ((strength", "twice the stiffness"),
    (rods, "off = [0.5 * (", "off = [1.0 * (", "corrections twice as large"),
    (rods, "for k, (first, _) in enumerate(self.rods):", "for k, first in enumerate([0] * len(self.rods)):", "no anchors"),
    (pendulum_3d, "- self.fall * y[2]", "+ self.fall * y[2]", "a wrong sign of the weight"),
    (pendulum_3d, "(pull / square) * y", "(pull / self.square) * y", "the length that it should have"),
    (pendulum_3d, "2.0 * strength, 0.5 *", "strength, 0.5 *", "half the damping"),
    (pendulum_3d, "0.5 * ((strength", "1.0 * ((strength", "twice the stiffness"),
    (pendulum_3d, "dot(y, v) / self.square", "dot(y, v)", "a length forgotten"),
]
IDS = [f"{module.__name__.rpartition('.')[2]}: {mistake}" for module, _, _, mistake in MUTANTS]


def equal_to_the_core() -> None:
    for make in SYSTEMS.values():
        system, rng = make(np.random.default_rng(1), 3), np.random.default_rng(2)
        v, y = (rng.normal(size=(*shape, 3)) for shape in (system.v_shape, system.y_shape))
        if system.constraint == "length":
            assert_same(*(quiet(system, "rk4", v=v, y=y, dt=0.01, steps=3, backend=each) for each in ("rust", "numpy")))


def true_by_the_reference() -> None:
    """The truths above, of the reference alone: angles, a free triangle, a control that decays, a cone, and lengths reset."""
    assert apart_from_angles("numpy") < 1e-9
    options: dict[str, Any] = {"dt": 0.01, "backend": "numpy"}
    triangle = sw.Rods([1.0, 2.0, 0.5], TRIANGLE, 1.0, gravity=0.0)
    v, y = np.array([[0.3, 0.1], [0.3, 0.9], [-0.4, 0.766]]), CORNERS
    run = quiet(triangle, "rk4", v=v, y=y, steps=100, **options)
    s = triangle.for_state_shapes(0.0, y).reference_at_step(0.01, ())
    begun, off = (
        np.array([abs(float(rods.dot(d, u))) for d, u in zip(s.spans(places), s.closing(velocities), strict=True)])
        for velocities, places in ((v, y), (run.v[-1], run.y[-1]))
    )
    assert not np.abs(off - begun).max() > 1e-6  # C̈ = 0 keeps every Ċ
    start, turn = cone()
    run = quiet(sw.Pendulum3D(), "rk4", **start, dt=turn / 400, steps=400, backend="numpy")
    assert np.abs(run.y[-1] - start["y"]).max() < 1e-6
    for system, y in (
        (sw.Pendulum3D(2.0), np.array([0.0, 0.0, -2.02])),
        (sw.Rods([2.0], [((0.0, 0.0), 0)], 2.0), np.array([[0.0, -2.02]])),
    ):
        sideways = np.zeros(y.shape)
        sideways[..., 0] = 0.7
        run = quiet(system, "rk4", v=sideways, y=y, steps=300, **options)
        assert not abs(np.sqrt((run.y[-1] ** 2).sum()) - 2.02) > 1e-6  # C̈ = 0, so a rod that begins too long stays so
        run = quiet(system, "rk4", v=0.0, y=y, dt=1e-3, steps=10, backend="numpy", control=sw.LengthControl(0.1))
        known = 0.5 * (2.02**2 - 4.0) * 2.0 * math.exp(-1.0)
        assert 0.5 * ((run.y[-1] ** 2).sum() - 4.0) == pytest.approx(known, rel=0.02)
        run = quiet(system, "rk4", v=np.full(y.shape, 0.3), y=y, dt=1e-9, steps=1, backend="numpy", control=RESETTING)
        assert not max(abs(np.sqrt((run.y[-1] ** 2).sum()) - 2.0), abs((run.y[-1] * run.v[-1]).sum())) > 1e-12


@pytest.mark.mutant
@pytest.mark.parametrize(("module", "old", "new", "mistake"), MUTANTS, ids=IDS)
def test_mistakes_are_noticed(module: Any, old: str, new: str, mistake: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the comparison with the core, and by truths even if both languages had the same mistake."""
    public = sw.Rods if module is rods else sw.Pendulum3D
    monkeypatch.setattr(public, "reference", getattr(mistaken(module, old, new), public.__name__))
    for check in (equal_to_the_core, true_by_the_reference):
        with pytest.raises(AssertionError):
            check()


@pytest.mark.mutant
def test_without_a_mistake_nothing_is_noticed() -> None:
    equal_to_the_core()
    true_by_the_reference()
