"""The aircraft of Appendix E: the printed program, its motion in two forms, its limits, its turns, and its trap."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, ShapeError, UnknownNameError, UnsupportedError
from stepwell.model.systems import aircraft_equations, attitude
from support.calls import assert_raises, quiet
from support.for_each import for_each
from support.graphs import assert_traced_alike
from support.mistakes import mistaken

ZERO = np.zeros(3)
TORQUES = ("roll_torque", "pitch_torque", "yaw_torque")
FREE: dict[str, Any] = {"damping": ZERO, "gains": ZERO, "controllers": False}
#: Half a unit in the last place of 1.
U = 2.0**-53


# ---- the printed program


def by_loops(angle: float) -> float:
    while angle > 180:
        angle -= 360
    while angle < -180:
        angle += 360
    return angle


def printed(
    steps: int,
    v: Any,
    y: Any,
    *,
    damping: Any = (2.0, 3.0, 1.0),
    gains: Any = (0.06, 0.10, 1.0),
    commands: Any = (0.0, 0.0),
    torques: Any = (0.0, 0.0, 0.0),
    on: bool = True,
    step: float = 0.1,
) -> tuple[Any, Any]:
    """Procedure Integ of Appendix E, line by line in Python's floats: the angular velocities and the angles after each step."""
    j_x, j_y, j_z = 0.6, 1.0, 1.5
    eps = 1e-5
    w_rad = math.pi / 180
    d_t1 = step / w_rad
    (wxo, wyo, wzo), (phi, the, psi) = map(float, v), map(float, y)
    rows = [(wxo, wyo, wzo, phi, the, psi)]
    for _ in range(steps):
        s_phi, c_phi = math.sin(w_rad * phi), math.cos(w_rad * phi)
        s_the, c_the = math.sin(w_rad * the), math.cos(w_rad * the)
        tx = -damping[0] * wxo + torques[0]
        ty = -damping[1] * wyo + torques[1]
        tz = -damping[2] * wzo - gains[2] * s_phi * c_the + torques[2]
        if on:
            phi, the = by_loops(phi), by_loops(the)
            tx -= gains[0] * (phi - commands[0])
            ty -= gains[1] * (the - commands[1])
        wx = wxo + step * (wyo * wzo * (j_y - j_z) + tx) / j_x
        wy = wyo + step * (wzo * wxo * (j_z - j_x) + ty) / j_y
        wz = wzo + step * (wxo * wyo * (j_x - j_y) + tz) / j_z
        wxo, wyo, wzo = wx, wy, wz
        if abs(c_the) < eps:
            c_the = eps if c_the > 0 else -eps
        ic_the = 1 / c_the
        phi += d_t1 * (wx + wy * s_phi * s_the * ic_the + wz * c_phi * s_the * ic_the)
        the += d_t1 * (wy * c_phi - wz * s_phi)
        psi += d_t1 * (wy * s_phi * ic_the + wz * c_phi * ic_the)
        rows.append((wxo, wyo, wzo, phi, the, psi))
    states = np.array(rows)
    return states[:, :3], states[:, 3:]


#: What the printed program is compared on: a commanded turn, one in which the angles begin some turns away, torques without
#: controllers, and the trap from both sides, which is left at once.
PRINTED: dict[str, dict[str, Any]] = {
    "a turn": {"steps": 1000, "v": (0.1, -0.2, 0.3), "y": (5.0, -3.0, 100.0), "commands": (30.0, 10.0)},
    "turns away": {"steps": 1000, "v": (0.0, 0.1, 0.0), "y": (1000.0, -700.0, 0.0), "commands": (-20.0, 5.0)},
    "torques": {"steps": 100, "v": (0.1, 0.2, 0.3), "y": (10.0, 20.0, 30.0), "torques": (0.1, 0.3, -0.2), "on": False},
    "the trap": {"steps": 1, "v": (0.3, 0.1, 0.2), "y": (20.0, 90.0, 0.0)},
    "the trap from above": {"steps": 1, "v": (0.3, 0.1, 0.2), "y": (20.0, 90.0 + 4e-4, 0.0)},
}


def like_printed(kind: Any, case: dict[str, Any]) -> bool:
    """Whether False Euler with a step of 0.1 is the printed program.

    Both are the same formulas with other roundings. A number of a step is reached through no more than 40 roundings, sines and
    cosines among them, of at most 2u each, relative to the largest number of its sum: 80·u·size, an angle in degrees being the
    largest, and 1/57 of it in rad. In "the trap" both divide by the same 10⁻⁵. Under the controllers errors decay, by 0.89 a
    step: 10 steps' errors are left. ψ, and without controllers all, adds up.
    """
    options = {name: case[name] for name in ("commands", "torques", "on") if name in case}
    v, y = printed(case["steps"], case["v"], case["y"], **options)
    command, torque = case.get("commands", (0.0, 0.0)), case.get("torques", (0.0, 0.0, 0.0))
    system = kind(command, torque, case.get("on", True))
    start = {"v": np.array(case["v"]), "y": np.array(case["y"])}
    run = quiet(system, "false_euler", **start, dt=0.1, steps=case["steps"], every=1)
    # The printed program displays roll and pitch before they are wrapped, and then goes on with the wrapped ones.
    apart = run.y - y
    apart = apart - 360.0 * np.round(apart / 360.0) if case.get("on", True) else apart
    once = 80 * U * (np.abs(y).max() + 180.0)
    left = 10 if case.get("on", True) else case["steps"]
    bounds = once * np.array([left, left, case["steps"]])
    return bool(np.abs(run.v - v).max() <= left * once / 57.0 and (np.abs(apart).max(axis=0) <= bounds).all())


def public(command: Any, torque: Any, on: bool) -> sw.System:
    names = dict(zip(TORQUES, torque, strict=True))
    commands = {"roll": command[0], "pitch": command[1]} if on else {}
    return sw.Aircraft(**commands, **names, controllers=on)


@for_each("case", PRINTED)
def test_false_euler_is_the_printed_program(case: str) -> None:
    assert like_printed(public, PRINTED[case])


#: Mistakes in the rates: what is replaced, and by what.
MUTANTS = [
    ("y * z * (j_y - j_z)", "y * z * (j_z - j_y)"),
    ("z * x * (j_z - j_x)", "z * x * (j_x - j_z)"),
    ("x * y * (j_x - j_y)", "x * y * (j_y - j_x)"),
    ("-damping[axis] * v[axis]", "damping[axis] * v[axis]"),
    ("along[2] - gains[2] * bank", "along[2] + gains[2] * bank"),
    ("(angles[axis] - commands[axis])", "(angles[axis] + commands[axis])"),
    ("torque + command if", "torque - command if"),
    ("sin_roll * cos_pitch, damping", "sin_roll, damping"),
    ("(wrapped(y[0]), wrapped(y[1]))", "(y[0], wrapped(y[1]))"),
    ("(wrapped(y[0]), wrapped(y[1]))", "(wrapped(y[0]), y[1])"),
    ("360.0 * turns, angle)", "180.0 * turns, angle)"),
    ("np.abs(angle)) / 360.0", "np.abs(angle)) / 720.0"),
    ("v[1] * sin_roll + v[2] * cos_roll", "v[1] * cos_roll + v[2] * sin_roll"),
    ("v[0] + yaw * sin_pitch", "v[0] - yaw * sin_pitch"),
    ("v[1] * cos_roll - v[2] * sin_roll", "v[1] * cos_roll + v[2] * sin_roll"),
    ("SMALLEST_COSINE = 1e-5", "SMALLEST_COSINE = 1e-6"),
    ("SMALLEST_COSINE, -SMALLEST_COSINE)", "SMALLEST_COSINE, SMALLEST_COSINE)"),
    ("np.sin(np.radians(y[1]))", "np.sin(y[1])"),
]


@pytest.mark.mutant
@pytest.mark.parametrize(("old", "new"), MUTANTS)
def test_a_mistake_in_the_rates_is_noticed(old: str, new: str) -> None:
    wrong = mistaken(aircraft_equations, old, new)

    def kind(command: Any, torque: Any, on: bool) -> Any:
        gains = np.array([0.06, 0.10, 1.0]) * (1.0 if on else np.array([0.0, 0.0, 1.0]))
        return wrong.euler(gains=gains, roll=command[0], pitch=command[1], **dict(zip(TORQUES, torque, strict=True)))

    assert not all(like_printed(kind, case) for case in PRINTED.values())


def test_angles_are_wrapped_as_by_the_loops() -> None:
    """To the last bit, also at ±180° and beside it; the loops of the document take as long as there are turns."""

    rng = np.random.default_rng(2)
    edges = np.array([0.0, 180.0, 540.0, 900.0, 360.0, 720.0, 1e-300, 179.0])
    angles = np.concatenate(
        [rng.uniform(-1e4, 1e4, 2000), edges, np.nextafter(180.0, [0.0, 999.0]), np.nextafter(360.0, [0.0, 999.0])]
    )
    angles = np.concatenate([angles, -angles])
    for wrapped in (attitude.wrapped, aircraft_equations.wrapped):
        np.testing.assert_array_equal(wrapped(angles), [by_loops(angle) for angle in angles.tolist()])


def test_huge_angles_do_not_hang() -> None:
    """The document's loops would subtract 360 from 1e300 for ever. The sine ends at 2⁵⁰ rad, and the run says so."""
    far, near = (
        sw.integrate(sw.Aircraft(roll=10.0), "false_euler", v=0.0, y=[turns + 20.0, 0.0, 0.0], dt=0.1, steps=100)
        for turns in (3.6e8, 0.0)
    )
    # An angle of 4e8° is known to 2^-25°, and in rad to 2^-31; errors decay, as in the bound above.
    np.testing.assert_allclose(far.y[-1] - [3.6e8, 0.0, 0.0], near.y[-1], rtol=0, atol=100 * 60 * 2.0**-25)
    for angle in (1e17, 1e300, -1.7e308):
        with pytest.warns(sw.DivergenceWarning, match="the run diverged at step 1"):
            assert sw.integrate(sw.Aircraft(), "false_euler", v=0.0, y=np.array([angle, 0.0, 0.0]), dt=0.1, steps=100).status


@for_each(
    ("axis", "omega_damping", "limit", "sides"),
    [(0, (2.393654, 0.696286), 0.436357, (0.43, 0.44)), (1, (2.393654, 0.626657), 0.462448, (0.46, 0.47))],
)
def test_the_controllers_are_oscillators_with_their_limits(axis: int, omega_damping: Any, limit: float, sides: Any) -> None:
    """Near rest roll and pitch are ÿ + 2Dω₀ẏ + ω₀²y = 0: ω₀² is the gain per rad over J, 2Dω₀ the damper over J."""
    inertia, damping, gain = ((0.6, 2.0, 0.06), (1.0, 3.0, 0.10))[axis]
    omega = math.sqrt(gain * (180.0 / math.pi) / inertia)
    ratio = damping / inertia / (2.0 * omega)
    assert (omega, ratio) == (pytest.approx(omega_damping[0], abs=5e-7), pytest.approx(omega_damping[1], abs=5e-7))
    exact = 2.0 * (math.sqrt(1.0 + ratio * ratio) - ratio) / omega
    assert exact == pytest.approx(limit, abs=5e-7)
    gains = np.array([0.06, 0.10, 1.0])
    gains[1 - axis] = 0.01  # the other controller, so weak that it ends later
    computed = sw.stability_limit(sw.Aircraft(gains=gains), "false_euler", at=(ZERO, ZERO))
    assert float(computed) == pytest.approx(exact, rel=1e-9)
    start = 1e-6 * np.eye(3)[axis]
    for step, stable in zip(sides, (True, False), strict=True):
        run = sw.integrate(sw.Aircraft(), "false_euler", v=0.0, y=start, dt=step, steps=400, every=1)
        assert (np.abs(run.y[300:]).max() < 1e-6) == stable
        assert (np.abs(run.y[300:]).max() > 1e-5) == (not stable)


@for_each("form", ["euler", "quaternion"])
@for_each(
    ("command", "turn"),
    [
        ((30.0, 0.0), (27.17730, 6.66655, -29.0658)),
        ((30.0, 10.0), (25.30223, 15.27419, -26.4768)),
        ((60.0, 0.0), (46.83069, 18.07465, -54.2770)),
    ],
)
def test_steady_turns(form: str, command: Any, turn: Any) -> None:
    """A commanded roll ends in a turn, which does not depend on the step: the rates of ω, φ and θ are zero."""
    system = sw.Aircraft(form, roll=command[0], pitch=command[1])
    run = sw.integrate(system, "rk4", v=0.0, y=system.attitude(), dt=0.05, steps=1200, every=1, control=projection(form))
    roll, pitch, yaw = system.angles(run.y, axis=1).T
    assert (roll[-1], pitch[-1]) == (pytest.approx(turn[0], abs=5.1e-6), pytest.approx(turn[1], abs=5.1e-6))
    rate = (np.diff(yaw)[-1] + 180.0) % 360.0 - 180.0
    # In one step the angle turns by a degree; RK4's error of a turn by 0.05 rad is 1e-9 of it, and 17-digit angles leave 1e-12.
    assert rate / 0.05 == pytest.approx(turn[2], abs=5.1e-5)
    rates = system.scaled(1.0, ())
    np.testing.assert_allclose(rates.dv(0.0, run.v[-1], run.y[-1]), 0.0, rtol=0, atol=1e-9)


def test_a_commanded_pitch_is_reached_with_the_overshoot_of_the_facts() -> None:
    run = sw.integrate(sw.Aircraft(pitch=20.0), "false_euler", v=0.0, y=0.0, dt=0.1, steps=300, every=1)
    assert run.y[:, 1].max() == pytest.approx(21.083, abs=5e-4)
    np.testing.assert_allclose(run.y[-1], [0.0, 20.0, 0.0], rtol=0, atol=1e-12)


# ---- attitudes: Euler angles, quaternions and matrices, there and back

RNG = np.random.default_rng(3)
#: Roll, pitch and yaw in degrees.
ANGLES = np.stack([RNG.uniform(-180.0, 180.0, 99), RNG.uniform(-89.0, 89.0, 99), RNG.uniform(-180.0, 180.0, 99)])


def printed_matrix(angles: Any) -> Any:
    """The matrix of Appendix E, o11 to o33, in Python's floats."""
    phi, theta, psi = (math.radians(float(angle)) for angle in angles)
    (sf, st, sp), (cf, ct, cp) = map(math.sin, (phi, theta, psi)), map(math.cos, (phi, theta, psi))
    return np.array(
        [
            [cp * ct, -sp * cf + cp * st * sf, sp * sf + cp * st * cf],
            [sp * ct, cp * cf + sp * st * sf, -cp * sf + sp * st * cf],
            [-st, ct * sf, ct * cf],
        ]
    )


def agrees(module: Any) -> bool:
    """Whether all are the same rotations. Some twenty roundings of numbers up to 1; the angles divide by cos 89°, 1/57, twice."""
    matrices = np.stack([printed_matrix(angles) for angles in ANGLES.T], axis=-1)
    q = module.quaternion_of_angles(ANGLES)
    return (
        np.abs(module.rotation_of_angles(ANGLES) - matrices).max() < 40 * U
        and np.abs((q * q).sum(axis=0) - 1.0).max() < 40 * U
        and np.abs(module.rotation_of_quaternion(q) - matrices).max() < 40 * U
        and np.abs(module.rotation_of_quaternion(3.0 * q) - matrices).max() < 40 * U
        and np.abs(module.angles_of_rotation(matrices) - ANGLES).max() < 57.3 * 57.3 * 40 * U
    )


def test_angles_matrices_and_quaternions_are_the_same_rotations() -> None:
    assert agrees(attitude)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("cx * cy * cz + sx * sy * sz", "cx * cy * cz - sx * sy * sz"),
        ("sx * cy * cz - cx * sy * sz", "sx * cy * cz + cx * sy * sz"),
        ("cx * sy * cz + sx * cy * sz", "cx * sy * cz - sx * cy * sz"),
        ("cx * cy * sz - sx * sy * cz", "cx * cy * sz + sx * sy * cz"),
        ("2.0 * (x * y - w * z)", "2.0 * (x * y + w * z)"),
        ("2.0 * (y * z - w * x)", "2.0 * (y * z + w * x)"),
        ("(w * w + y * y) - (x * x + z * z)", "(w * w + x * x) - (y * y + z * z)"),
        ("each / square for each", "each for each"),
        ("cz * sy * sx - sz * cx", "cz * sy * sx + sz * cx"),
        ("sz * sy * cx - cz * sx", "sz * sy * cx + cz * sx"),
        ("[-sy, cy * sx", "[sy, cy * sx"),
        ("arctan2(-rotation[2, 0], level)", "arctan2(rotation[2, 0], level)"),
        ("arctan2(rotation[1, 0], rotation[0, 0])", "arctan2(rotation[0, 1], rotation[0, 0])"),
        ("arctan2(rotation[2, 1], rotation[2, 2])", "arctan2(rotation[1, 2], rotation[2, 2])"),
    ],
)
def test_a_mistake_in_attitudes_is_noticed(old: str, new: str) -> None:
    wrong = mistaken(attitude, old, new)
    assert not agrees(wrong)


def test_an_aircraft_has_them_in_its_own_coordinates() -> None:
    one, two = sw.Aircraft(), sw.Aircraft("quaternion")
    angles, q = one.attitude(*ANGLES), two.attitude(*ANGLES)
    np.testing.assert_array_equal(angles, ANGLES)
    np.testing.assert_array_equal(one.angles(angles + 720.0), attitude.wrapped(angles + 720.0))
    np.testing.assert_array_equal(two.angles(q), attitude.angles_of_rotation(attitude.rotation_of_quaternion(q)))
    np.testing.assert_array_equal(one.rotation(angles), attitude.rotation_of_angles(angles))
    # Saved states have the time first.
    np.testing.assert_array_equal(two.angles(q.T, axis=1), two.angles(q).T)
    np.testing.assert_array_equal(two.rotation(q.T, axis=1), two.rotation(q))
    np.testing.assert_array_equal(two.attitude(10.0, [20.0, 30.0])[:, 1], two.attitude(10.0, 30.0))
    # A whole turn more is the same attitude, to the rounding of the angle.
    np.testing.assert_allclose(two.attitude(730.0, -340.0), two.attitude(10.0, 20.0), rtol=0, atol=4 * U)


def projection(form: str) -> Any:
    return sw.Projection("norm") if form == "quaternion" else None


@for_each("form", ["euler", "quaternion"])
@for_each(("v", "first", "last"), [((0.5, 0.02, 0.02), 0.0755, 0.07601), ((0.02, 0.5, 0.02), 0.1254, 0.1452)])
def test_false_euler_does_not_keep_the_energy_of_a_free_aircraft(form: str, v: Any, first: float, last: float) -> None:
    """ω by Standard Euler gains energy, more about the middle axis, where the rotation tumbles, whatever the attitude."""
    system = sw.Aircraft(form, **FREE)
    arguments = {"v": np.array(v), "y": system.attitude(), "dt": 0.1, "steps": 1000, "every": 1, "record": "energy"}
    run = sw.integrate(system, "false_euler", **arguments)
    assert run.energy[0] == pytest.approx(0.5 * np.dot([0.6, 1.0, 1.5], np.square(v)), rel=4 * U)
    assert (run.energy[0], run.energy[-1]) == (pytest.approx(first, abs=5e-5), pytest.approx(last, abs=5e-5))
    np.testing.assert_array_equal(run.recorded["energy"], run.energy)
    onto = sw.integrate(system, "false_euler", **arguments, control=sw.Projection("energy"))
    assert np.ptp(onto.energy) < 1e-3 * np.ptp(run.energy)


def test_a_free_aircraft_keeps_its_angular_momentum_in_space() -> None:
    for form in ("euler", "quaternion"):
        system = sw.Aircraft(form, **FREE)
        times = np.linspace(0.5, 20.0, 40)
        run = sw.integrate(
            system, "dop853", v=np.array([0.1, 0.3, 0.2]), y=system.attitude(10.0, 20.0), tolerance=1e-12, at=times
        )
        momentum = np.einsum("ijk,j,kj->ik", system.rotation(run.y, axis=1), [0.6, 1.0, 1.5], run.v)
        np.testing.assert_allclose(momentum, momentum[:, :1] * np.ones(len(times)), rtol=0, atol=1e-10)
        np.testing.assert_allclose(run.energy, run.energy[0], rtol=1e-10)


def test_whether_torques_act() -> None:
    for acts, options in (
        (False, FREE),
        (False, FREE | {"gains": [0.1, 0.1, 0.0]}),
        (True, {}),
        (True, FREE | {"controllers": True, "gains": [0.1, 0.0, 0.0]}),
        (True, FREE | {"yaw_torque": 0.1}),
        (True, {"controllers": False}),
    ):
        assert sw.Aircraft(**options).torques_act is acts, options


# ---- the quaternion


QUATERNION_MUTANTS = [
    ("2.0 * (x * z - w * y)", "2.0 * (x * z + w * y)"),
    ("2.0 * (y * z + w * x)", "2.0 * (y * z - w * x)"),
    ("(w * w + z * z) - (x * x + y * y)", "(w * w + x * x) - (z * z + y * y)"),
    ("np.arctan2(-down,", "np.arctan2(down,"),
    ("across * across + up * up", "across * across"),
    ("across / square", "across / (2.0 * square)"),
    ("-(x * a + y * b + z * c)", "x * a + y * b + z * c"),
    ("w * a + (y * c - z * b)", "w * a - (y * c - z * b)"),
    ("w * b + (z * a - x * c)", "w * b - (z * a - x * c)"),
    ("w * c + (x * b - y * a)", "w * c - (x * b - y * a)"),
    ("rate = 0.5 * np.array", "rate = np.array"),
]


def test_both_forms_are_the_same_motion_and_mistakes_are_noticed() -> None:
    """By adaptive steps, each right to 1e-11 or so; a mistake is noticed where it moves an axis by 1e-6."""
    one = sw.Aircraft(roll=25.0, pitch=20.0, yaw_torque=0.1)
    start, at = np.array([0.1, -0.2, 0.3]), np.linspace(0.5, 5.0, 10)
    run = sw.integrate(one, "dop853", v=start, y=one.attitude(20.0, -10.0, 130.0), tolerance=1e-12, at=at)
    form = sw.Aircraft("quaternion", roll=25.0, pitch=20.0, yaw_torque=0.1)

    def apart(system: sw.System) -> float:
        other = sw.integrate(system, "dop853", v=start, y=form.attitude(20.0, -10.0, 130.0), tolerance=1e-12, at=at)
        matrices = one.rotation(run.y, axis=1) - form.rotation(other.y, axis=1)
        return float(max(np.abs(matrices).max(), np.abs(run.v - other.v).max()))

    assert apart(form) < 1e-10
    for mistake in QUATERNION_MUTANTS:
        wrong = mistaken(aircraft_equations, *mistake).quaternion(roll=25.0, pitch=20.0, yaw_torque=0.1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert not apart(wrong) < 1e-6, mistake


def test_a_control_keeps_the_length_near_one_and_a_projection_at_one() -> None:
    """Where it settles is in test_quaternion_norm.py. A projection is q/|q| with some twenty roundings."""
    system, v = sw.Aircraft("quaternion", **FREE), np.array([0.0, 3.0, 0.0])
    arguments: dict[str, Any] = {"v": v, "y": 0.9 * system.attitude(roll=20.0), "dt": 0.01, "record": "norm"}
    onto = sw.integrate(system, "standard_euler", **arguments, steps=2000, control=sw.Projection("norm"))
    assert abs(onto.recorded["norm"][0] - 1.0) <= 20 * U
    once, free, controlled = (
        sw.integrate(system, "standard_euler", **arguments, steps=1, control=control)
        for control in (sw.Projection("norm"), None, sw.NormControl([2.0, 4.0]))
    )
    np.testing.assert_allclose(once.y[-1], free.y[-1] / free.recorded["norm"][0], rtol=0, atol=20 * U)
    assert controlled.system.keeper == sw.NormControl([2.0, 4.0])
    assert "NormControl" in repr(controlled.system)
    run = sw.integrate(controlled.system, "merson", v=v, y=system.attitude(), tolerance=1e-6, at=[1.0])
    np.testing.assert_allclose(np.linalg.norm(run.y[-1], axis=0), 1.0, rtol=0, atol=1e-5)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("(strength * (1.0 - square)) * q", "(strength * (square - 1.0)) * q"),
        ("(strength * (1.0 - square)) * q", "(2.0 * strength * (1.0 - square)) * q"),
        ("return np.sqrt(q[0] * q[0]", "return np.sqrt(0.9 * q[0] * q[0]"),
        ("inertia[2] * (v[2] * v[2])", "inertia[2] * (v[0] * v[2])"),
    ],
)
def test_mistakes_in_what_is_kept_and_recorded_are_noticed(old: str, new: str) -> None:
    def right(kind: Any) -> bool:
        start: dict[str, Any] = {"v": np.array([0.3, 0.4, 3.0]), "y": np.array([0.5, 0.1, -0.7, 0.6])}
        system = kind(damping=ZERO, gains=ZERO, strength=2.0, inertia=np.full(3, 2.0))
        run = quiet(system, "standard_euler", **start, dt=0.01, steps=1000, record=["norm", "energy"])
        # As above: h|ω|²/(8k), to the next order in hk.
        square, rate = (run.y[-1] ** 2).sum(), 0.3**2 + 0.4**2 + 3.0**2
        return bool(
            abs((square - 1.0) / (0.01 * rate / 16.0) - 1.0) < 0.03
            and abs(run.recorded["norm"][0] - math.sqrt(square)) < 20 * U
            and abs(run.recorded["energy"][0] - rate) < 20 * U * rate
        )

    assert right(aircraft_equations.quaternion)
    assert not right(mistaken(aircraft_equations, old, new).quaternion)


CONTROLS = [sw.NormControl(2.0), sw.Projection("norm"), sw.Control("norm", 3.0, target=1.0), sw.Projection("energy")]


@for_each("control", CONTROLS)
@for_each("method", ["standard_euler", "false_euler", "rk4"])
def test_core_and_reference_are_one_graph_under_control(control: Any, method: str) -> None:
    system = sw.Aircraft("quaternion", roll=np.array([10.0, 30.0]))
    start = np.array([0.1, 0.2, 0.3]), 1.1 * system.attitude()
    assert_traced_alike(system.controlled(control, *(np.stack([block] * 2, axis=1) for block in start), 0.05), method)
    assert sw.explain(system, method, control=control).computed


@for_each("form", ["euler", "quaternion"])
def test_derivatives_are_those_of_the_rates(form: str) -> None:
    """Central differences: e²/6 of the third derivative and a rounding of u/e, each 1e-10 for e = 1e-5, times some hundred."""
    system, v, e = sw.Aircraft(form, roll=10.0), np.array([0.1, -0.2, 0.3]), 1e-5
    y, rates = system.attitude(200.0 if form == "euler" else 20.0, 30.0, 40.0), system.scaled(1.0, ())

    def rate(state: Any) -> Any:
        return np.concatenate([np.ravel(each(0.0, state[:3], state[3:])) for each in (rates.dv, rates.dy)])

    state = np.concatenate([v, y])
    columns = [(rate(state + d) - rate(state - d)) / (2 * e) for d in e * np.eye(len(state))]
    np.testing.assert_allclose(sw.jacobian(system, v=v, y=y).matrix, np.stack(columns, axis=1), rtol=0, atol=1e-7)


def test_in_the_trap_a_step_jumps_by_a_hundred_thousand_times_the_rate() -> None:
    """θ = 90°: the cosine, 6e-17, is replaced by 1e-5, so ω₃ = 1 for 0.1 turns ψ by 1e4 rad; and φ, by as much."""
    system = sw.Aircraft(**FREE)
    start: dict[str, Any] = {"v": [0.0, 0.0, 1.0], "dt": 0.1, "steps": 1}
    jumped, beyond = (sw.integrate(system, "false_euler", **start, y=[0.0, pitch, 0.0]) for pitch in (90.0, 90.0001))
    np.testing.assert_allclose(jumped.y[-1], [1e4 * 180.0 / math.pi, 90.0, 1e4 * 180.0 / math.pi], rtol=1e-14)
    assert beyond.y[-1][2] == pytest.approx(-1e4 * 180.0 / math.pi, rel=1e-14)
    # The quaternion turns about the aircraft's third axis by 0.1 rad, to the order of the step.
    smooth = sw.Aircraft("quaternion", **FREE)
    run = sw.integrate(smooth, "rk4", **start, y=smooth.attitude(pitch=90.0))
    c, s = math.cos(0.1), math.sin(0.1)
    expected = smooth.rotation(smooth.attitude(pitch=90.0)) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(smooth.rotation(run.y[-1]), expected, rtol=0, atol=0.1**5 / 120.0)


def turned_apart(a: Any, b: Any) -> Any:
    """The angles in degrees between rotations."""
    return np.degrees(np.arccos(np.clip(0.5 * (np.einsum("ijk,ijk->k", a, b) - 1.0), -1.0, 1.0)))


def test_the_loop_past_the_vertical_is_lost_in_euler_angles_and_not_as_a_quaternion() -> None:
    errors = {}
    for form in ("euler", "quaternion"):
        scene = sw.scenes.gimbal_trap(form)
        run = scene.run("false_euler", every=1)
        true = sw.integrate(scene.system, "dop853", v=scene.v, y=scene.y, tolerance=1e-12, at=run.t[1:])
        rotations, exact = (scene.system.rotation(y, axis=1) for y in (run.y[1:], true.y))
        errors[form] = turned_apart(rotations, exact)
        lowest = np.abs(np.cos(np.radians(scene.system.angles(true.y, axis=1)[:, 1]))).min()
        assert 0.001 < lowest < 0.05  # near the vertical, but not in the trap
    # The first order of the method leaves the quaternion some degrees; in Euler angles the steps past the vertical add tens.
    assert errors["quaternion"].max() < 6.0
    assert errors["euler"].max() > 30.0
    before = slice(0, 25)  # up to there both are alike
    assert np.abs(errors["euler"][before] - errors["quaternion"][before]).max() < 0.2


def test_commands_over_time() -> None:
    system = sw.Aircraft(roll=sw.Sampled([0.0, 30.0, -30.0], interval=2.0), pitch=sw.Sinusoid(10.0, 1.0))
    t = np.array([0.0, 1.9, 2.0, 5.0, 9.0])
    np.testing.assert_array_equal(system.commanded("roll", t), [0.0, 0.0, 30.0, -30.0, -30.0])
    np.testing.assert_allclose(system.commanded("pitch", t), 10.0 * np.sin(t), rtol=0, atol=1e-13)
    np.testing.assert_array_equal(sw.Aircraft(roll=[3.0, 4.0]).commanded("roll", t), [[3.0, 4.0]] * 5)
    assert np.isnan(sw.Aircraft(controllers=False).commanded("roll", t)).all()
    # A sampled command is the run of one number, up to the next sample, then of the next.
    run = sw.integrate(system, "false_euler", v=0.0, y=0.0, dt=0.1, steps=60, every=20)
    state: dict[str, Any] = {"v": 0.0, "y": 0.0, "dt": 0.1, "steps": 20}
    for i, roll in enumerate((0.0, 30.0, -30.0)):
        part = sw.integrate(sw.Aircraft(roll=roll, pitch=sw.Sinusoid(10.0, 1.0)), "false_euler", **state, start_step=20 * i)
        np.testing.assert_array_equal(part.y[-1], run.y[i + 1])
        state |= {"v": part.v[-1], "y": part.y[-1]}


START: dict[str, Any] = {"v": 0.0, "y": 0.0, "dt": 0.1, "steps": 1}
THREE = "expected three numbers along the first axis, got shape"
REFUSED: list[tuple[Any, type[Exception], str]] = [
    (lambda: sw.Aircraft("angles"), UnknownNameError, "form: there is no 'angles'"),
    (lambda: sw.Aircraft(inertia=[1.0, 2.0]), ShapeError, rf"inertia: {THREE} \(2,\)"),
    (lambda: sw.Aircraft(inertia=[1.0, 0.0, 1.0]), ArgumentError, "inertia: expected numbers above zero"),
    (lambda: sw.Aircraft(gains=1.0), ShapeError, rf"gains: {THREE} \(\)"),
    (lambda: sw.Aircraft(roll="left"), ArgumentError, "roll: expected real numbers in degrees"),
    (lambda: sw.Aircraft(yaw_torque=np.nan), ArgumentError, "yaw_torque: expected finite numbers in units of torque"),
    (lambda: sw.Aircraft(pitch=5.0, controllers=False), ArgumentError,
     "pitch: expected no commanded angle with controllers=False"),
    (lambda: sw.Aircraft(controllers=1), ArgumentError, "controllers: expected True or False, got 1"),
    (lambda: sw.Aircraft(roll=[1.0, 2.0], gains=np.ones((3, 3))), ShapeError, r"gains \(3,\), roll \(2,\)"),
    (lambda: sw.Aircraft().angles(np.ones((4, 2))), ShapeError, r"y: expected 3 numbers along axis 0, got shape \(4, 2\)"),
    (lambda: sw.Aircraft("quaternion").rotation(np.ones(4), axis=1), ShapeError,
     r"y: expected 4 numbers along axis 1, got shape \(4,\)"),
    (lambda: sw.Aircraft().commanded("yaw", [0.0]), UnknownNameError, "name: there is no 'yaw'"),
    (lambda: sw.integrate(sw.Aircraft(), "rk4", **START | {"y": np.ones(4)}), ShapeError,
     r"y: expected shape \(3, batch…\) = \(components, batch…\), got \(4,\)"),
    (lambda: sw.integrate(sw.Aircraft(), "verlet", **START), UnsupportedError, "verlet needs a second-order"),
    (lambda: sw.integrate(sw.Aircraft(), "rk4", **START, control=sw.EnergyControl(1.0)), UnsupportedError,
     "control: EnergyControl pushes velocities"),
    (lambda: sw.integrate(sw.Aircraft(), "rk4", **START, control=sw.NormControl(2.0)), UnsupportedError,
     r"NormControl\(2.0\) keeps a norm, and Aircraft\(form='euler'\) has no such"),
    (lambda: sw.integrate(sw.Aircraft(), "rk4", **START, control=sw.Projection("norm")), UnknownNameError,
     "control: there is no 'norm'"),
]  # fmt: skip


def test_what_cannot_be_is_refused() -> None:
    assert_raises(*REFUSED)


def test_a_repr_tells_what_is_not_the_documents() -> None:
    assert repr(sw.Aircraft()) == "Aircraft(form='euler')"
    assert repr(sw.Aircraft(roll=30.0, damping=[1, 2, 3])) == "Aircraft(form='euler', damping=(1.0, 2.0, 3.0), roll=30.0)"
    free = "Aircraft(form='quaternion', damping=(0.0, 0.0, 0.0), gains=(0.0, 0.0, 0.0), controllers=False)"
    assert repr(sw.Aircraft("quaternion", **FREE)) == free


def test_what_is_not_given_is_no_operation() -> None:
    """A torque that is not given, and the controllers that are off, leave nothing on the tape."""

    def operations(**options: Any) -> int:
        return sum(sw.explain(sw.Aircraft(**options), "false_euler").computed.values())

    full = operations(roll=10.0)
    assert operations(roll=10.0, yaw_torque=0.0) == full + 1
    # Per controller: a wrapped angle, a difference, a product, a difference.
    assert operations(controllers=False) < full - 6
