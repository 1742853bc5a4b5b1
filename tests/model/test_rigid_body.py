"""The rigid body: how it moves, its mistakes, its stability, its inputs, and the control of its norm."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, ShapeError, UnsupportedError
from stepwell.model import quaternion
from stepwell.reference.systems import rigid_body as reference
from stepwell.scenes.free_top import FreeTop
from support import tops
from support.calls import a_step, assert_raises
from support.for_each import for_each
from support.graphs import assert_traced_alike
from support.mistakes import mistaken

METHODS = [m for m in sw.methods() if not m.needs_acceleration]
BODY = sw.RigidBody([1.0, 2.0, 3.0])
KEEPERS = [sw.NormControl([1.0, 2.0, 0.5]), sw.NormControl(0.7), sw.Projection("norm")]

#: What to replace in the reference, by what, and a truth that then fails.
MUTANTS = [
    ("(inertia[1] - inertia[2], ", "(inertia[2] - inertia[1], ", tops.free_asymmetric_top),
    ("inertia[0] - inertia[1])", "inertia[0] + inertia[1])", tops.reset_norm),
    ("0.5 * np.asarray(h)", "np.asarray(h)", tops.reset_norm),
    ("self.by_inertia * damping", "h * damping", tops.damping_and_torques_of_the_body),
    ("each.scaled(by)", "each.scaled(h)", tops.damping_and_torques_of_the_body),
    ("(v[1] * v[2])", "(v[1] * v[0])", tops.free_asymmetric_top),
    ("each - drag * w", "each + drag * w", tops.damping_and_torques_of_the_body),
    ("each + by * turned", "each + self.half * turned", tops.torques_of_space),
    ("zip(axes, self.space_torque", "zip(zip(*axes), self.space_torque", tops.torques_of_space),
    ("(each / square for each", "(each for each", tops.torques_of_space),
    ("self.weight[0] * each for", "each for", tops.horizontal_top),
    ("(c * up[1] - b * up[2], ", "(b * up[2] - c * up[1], ", tops.horizontal_top),
    ("a * up[2] - c * up[0]", "c * up[0] - a * up[2]", tops.horizontal_top),
    ("up, (a, b, c) = axes[2]", "up, (a, b, c) = [row[2] for row in axes]", tops.horizontal_top),
    ("(b * v[0] + c * v[1]) + d * v[2]", "(b * v[0] + c * v[1]) - d * v[2]", tops.reset_norm),
    ("(a * v[0] + c * v[2]) - d * v[1]", "(a * v[0] - c * v[2]) + d * v[1]", tops.reset_norm),
    ("(a * v[1] + d * v[0]) - b * v[2]", "(a * v[1] + d * v[2]) - b * v[0]", tops.turn_at_a_constant_rate),
    ("(a * v[2] + b * v[1]) - c * v[0]", "(a * v[2] - b * v[1]) + c * v[0]", tops.reset_norm),
    ("self.gain * (1.0 - square(y))", "self.gain * (1.0 - np.sqrt(square(y)))", tops.settled_norm),
    ("else h * strength", "else strength", tops.settled_norm),
    ("y / np.sqrt(square(y))", "y / square(y)", tops.reset_norm),
    ("2.0 * (bc - ad)", "2.0 * (bc + ad)", tops.torques_of_space),
    ("(aa + cc) - (bb + dd)", "(aa + dd) - (bb + cc)", tops.torques_of_space),
    ("2.0 * (cd + ab)", "2.0 * (cd - ab)", tops.torques_of_space),
    (") / length for row in axes", ") for row in axes", tops.torques_of_space),
]


@for_each("truth", tops.TRUTHS)
def test_what_is_known(truth: Callable[[str], None]) -> None:
    truth("rust")


@pytest.mark.mutant
@pytest.mark.parametrize(("old", "new", "truth"), MUTANTS, ids=[f"{new} #{i}" for i, (_, new, _) in enumerate(MUTANTS)])
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_a_mistake_is_noticed(monkeypatch: pytest.MonkeyPatch, old: str, new: str, truth: Callable[[str], None]) -> None:
    monkeypatch.setattr(sw.RigidBody, "reference", mistaken(reference, old, new).RigidBody)
    with pytest.raises(AssertionError):
        truth("numpy")


def growth(inertia: Any, axis: int) -> Any:
    """Eigenvalues of ω̇ at a spin of 1.7 about one axis, but for the one that is zero."""
    v = np.zeros(3)
    v[axis] = 1.7
    eigenvalues = np.linalg.eigvals(sw.jacobian(sw.RigidBody(inertia), v=v, y=tops.UNIT).vv)
    return eigenvalues[np.argsort(np.abs(eigenvalues))][1:]


@for_each("inertia", [(1.0, 2.0, 3.0), (1.0, 1.001, 1.9), (1.3, 1.1, 0.9), (2.0, 1.2, 1.5)])
def test_only_the_middle_axis_is_unstable(inertia: Any) -> None:
    """λ² = ω²(Jₐ − Jᵢ)(Jᵢ − J_b)/(J_a·J_b) about axis i: positive for the middle moment alone."""
    for axis in range(3):
        i, a, b = inertia[axis], inertia[axis - 1], inertia[axis - 2]
        square = 1.7**2 * (a - i) * (i - b) / (a * b)
        assert (square > 0) == (axis == int(np.argsort(inertia)[1]))
        np.testing.assert_allclose(growth(inertia, axis) ** 2, square, rtol=1e-12)


def test_a_small_tilt_grows_or_does_not() -> None:
    """From 1e-6 by exp(σt) along the mode that grows; about the other axes it stays, for ten times as long."""
    inertia, t = np.array([1.0, 2.0, 3.0]), 12.0
    sigma = math.sqrt((2.0 - 1.0) * (3.0 - 2.0) / (1.0 * 3.0))
    # ω̇₁ = −ω₃ and ω̇₃ = −ω₁/3 there: the mode that grows is (1, −σ).
    run = sw.integrate(sw.RigidBody(inertia), "rk4", v=[1e-6, 1.0, -1e-6 * sigma], y=tops.UNIT, dt=0.01, steps=round(t / 0.01))
    assert run.v[-1, 0] == pytest.approx(1e-6 * math.exp(sigma * t), rel=1e-5)  # 1.02e-3 by then, squared 1e-6
    for axis in (0, 2):
        v = np.full(3, 1e-6)
        v[axis] = 1.0
        run = sw.integrate(sw.RigidBody(inertia), "rk4", v=v, y=tops.UNIT, dt=0.01, steps=round(10 * t / 0.01), every=50)
        # |λ| = √(2/6) or √(2/2): an ellipse of an aspect of at most √3 through (1, 1)·1e-6
        assert np.abs(np.delete(run.v, axis, axis=1)).max() < 2.5e-6


@for_each("method", METHODS)
def test_energy_and_momentum_are_constant_to_the_order(method: sw.Method) -> None:
    """Over a fixed time their errors fall at least as hᵖ: both functions of a state whose error is O(hᵖ)."""
    body, v, q, end = sw.RigidBody([1.0, 1.4, 2.0]), [0.7, 1.0, -0.4], tops.some_attitude(6), 2.0
    errors = []
    for n in (40, 80):
        n = n // 4 if method.order > 4 else n
        run = sw.integrate(body, method, v=v, y=q, dt=end / n, steps=n, every=n, record=["energy", "angular_momentum"])
        energy, momentum = run.recorded["energy"], run.recorded["angular_momentum"]
        length = np.sqrt((momentum**2).sum(axis=1))
        changes = (energy[-1] - energy[0], length[-1] - length[0], np.abs(momentum[-1] - momentum[0]).max())
        errors.append(np.abs(changes))
    for coarse, fine in zip(*errors, strict=True):
        # At finite steps the slope is not yet p, least of all by dopri5.
        assert fine < 1e-13 or math.log2(coarse / fine) > method.order - (0.5 if method.name == "dopri5" else 0.25)


@for_each("seed", range(6))
def test_free_tops_of_any_start(seed: int) -> None:
    """About either axis, in either sense; errors of a run to 1e-14 are some 1e-12 after 20 units of time."""
    rng = np.random.default_rng(seed)
    inertia, v, q = np.sort(rng.uniform(1.0, 2.0, 3)), rng.normal(size=3), tops.some_attitude(seed)
    truth = FreeTop(tuple(inertia.tolist()), tuple(v.tolist()), tuple(q.tolist()))
    times = np.array([0.0, 3.0, 20.0])
    run = sw.integrate(sw.RigidBody(inertia), "dop853", v=v, y=q, tolerance=1e-14, at=times)
    for exact, wanted in zip(truth(times), (run.v, run.y), strict=True):
        np.testing.assert_allclose(exact, wanted, rtol=0, atol=1e-12)


def test_the_wing_nut_is_that_of_the_facts() -> None:
    scene = sw.scenes.dzhanibekov()
    assert scene.horizon == pytest.approx(2 * 39.1057341972687209, rel=1e-14)
    v, q = scene.exact(np.array([10.0]))  # type: ignore[misc]
    np.testing.assert_allclose(v[0], [-0.874573437891093646, 0.48499618734104845, 0.505001220547913341], rtol=0, atol=1e-14)
    assert (q * q).sum() == pytest.approx(1.0, abs=1e-15)


@for_each(("spin", "lean"), [(10.0, 30.0), (6.0, 70.0)])
def test_the_heavy_top_nods_between_two_heights(spin: float, lean: float) -> None:
    """Let go at u = cos θ₀, it falls to u₁ = λ − √(λ² − 2λu + 1), λ = (C·s)²/(4A·W·l), and comes up again to u, at rest."""
    # From the energy and the momentum about both axes; ω₃ is constant. Between saved states a height is off by a share of (h·ω)².
    scene = sw.scenes.heavy_top(spin, lean)
    run = scene.run("dop853", scene.dt / 10, every=1)
    height = quaternion.matrix(run.y.T)[2, 2]
    up, strength = math.cos(math.radians(lean)), (0.5 * spin) ** 2 / 16.0
    low = strength - math.sqrt(strength**2 - 2 * strength * up + 1.0)
    assert height.max() == pytest.approx(up, abs=1e-12)
    assert height.min() == pytest.approx(low, abs=1e-5)
    assert height[int(np.argmax(height < low + 1e-5)) :].max() == pytest.approx(up, abs=1e-5)
    np.testing.assert_allclose(run.v[:, 2], spin, rtol=1e-12)
    momentum = run.quantity("angular_momentum")[:, 2]
    np.testing.assert_allclose(momentum, momentum[0], rtol=1e-12)


def test_a_batch_of_three_is_no_vector() -> None:
    """Three members of three axes each: the body's own numbers are along the first axis."""
    v, y, ends = np.eye(3), tops.UNIT[:, np.newaxis] + 0.1 * np.eye(4, 3), []
    for weight, which in ((np.arange(1.0, 4.0), slice(None)), (1.0, 0), (2.0, 1), (3.0, 2)):
        body = sw.RigidBody([1.0, 2.0, 3.0], weight=weight, centre=[0.0, 0.0, 1.0])
        ends.append(sw.integrate(body, "rk4", v=v[:, which], y=y[:, which], dt=0.1, steps=9).y[-1])
    np.testing.assert_array_equal(ends[0], np.stack(ends[1:], axis=1))


@for_each("keeper", KEEPERS)
@for_each("heavy", [False, True])
def test_the_graphs_under_control_are_one(keeper: Any, heavy: bool) -> None:
    more: dict[str, Any] = {"weight": 1.3, "centre": [0.1, 0.2, 0.3], "space_torque": [None, 0.2, sw.Sinusoid(1.0, 2.0)]}
    body = sw.RigidBody([1.0, 1.5, 2.0], **more if heavy else {}).under(keeper, keeper.batch)
    for method in METHODS:
        assert_traced_alike(body, method)


def test_controls_that_do_not_fit_are_refused() -> None:
    run = partial(a_step, BODY, v=np.ones(3), y=tops.UNIT)
    assert_raises(
        (lambda: run(control=sw.LengthControl(0.5)), "keeps a length"),
        (lambda: run(control=sw.EnergyControl(0.5)), "no energy control"),
        (lambda: run(control=sw.Projection("length")), "none"),
        (lambda: a_step(sw.NBody(), y=np.ones((3, 2)), control=sw.NormControl(1.0)), "keeps a norm"),
        *((lambda method=method: run(method=method), "second-order") for method in ("verlet", "leapfrog", "pefrl")),
        kind=UnsupportedError,
    )
    target = sw.Projection("norm", target=2.0)
    assert_raises((lambda: run(control=target), ArgumentError, "target: .* which is its own target"))


def test_wrong_arguments() -> None:
    """A plate is right: it has J₃ = J₁ + J₂, which rounding may exceed, 0.1 + 0.7 < 0.8 in floats."""
    assert 0.1 + 0.7 < 0.8
    sw.RigidBody([0.1, 0.7, 0.8])
    of_three = "expected a sequence of three torques, one for each axis, got"
    for arguments, error, message in (
        ({"inertia": [1.0, 2.0]}, ShapeError, "inertia: expected three numbers along the first axis"),
        ({"inertia": 1.0}, ShapeError, "inertia: expected three"),
        ({"inertia": [1.0, 2.0, 3.1]}, ArgumentError, "none is above the sum of the other two, got 3.1 above 3"),
        ({"inertia": [[1.0, 1.0], [1.0, 3.0], [1.0, 1.0]]}, ArgumentError, "got 3 above 2"),
        ({"inertia": [1.0, 0.0, 1.0]}, ArgumentError, "inertia: expected numbers above zero"),
        ({"torque": 1.0}, ShapeError, f"torque: {of_three} one float"),
        ({"torque": [1.0, 2.0]}, ShapeError, f"torque: {of_three} 2"),
        ({"space_torque": [1.0, np.nan, 2.0]}, ArgumentError, r"space_torque\[1\]: expected finite"),
        ({"damping": [0.1, 0.2]}, ShapeError, "damping: expected three"),
        ({"weight": 1.0}, ArgumentError, "weight, centre: expected both or neither, got weight alone"),
        ({"centre": [0.0, 0.0, 1.0]}, ArgumentError, "weight, centre: expected both or neither, got centre alone"),
        ({"weight": [1.0, 2.0], "centre": np.ones((3, 3))}, ShapeError, "weight .2,.|centre .3,."),
    ):
        assert_raises((partial(sw.RigidBody, **{"inertia": [1.0, 2.0, 3.0]} | arguments), error, message))


def test_a_zero_quaternion_is_told() -> None:
    with pytest.warns(sw.AccuracyWarning, match="a quaternion is zero"):
        a_step(sw.RigidBody([1.0, 1.0, 1.0]), v=np.ones(3), y=0.0)


def test_they_say_what_they_are() -> None:
    body = sw.RigidBody([1.0, 2.0, 3.0], [None, 0.1, None], damping=0.2, weight=2.0, centre=[0.0, 0.0, 1.0])
    text = "RigidBody([1.0, 2.0, 3.0], torque[1]=constant(0.1), damping=0.2, weight=2.0, "
    assert repr(body) == text + "centre=[0.0, 0.0, 1.0])"
    controlled = sw.RigidBody([1.0, 2.0, 3.0]).under(sw.NormControl(0.5), ())
    assert repr(controlled) == "RigidBody([1.0, 2.0, 3.0], NormControl(0.5))"


def test_quaternions() -> None:
    p, q, vector = tops.some(1, 4, 7), tops.some(2, 4, 7), tops.some(3, 3, 7)
    r = quaternion.matrix(q)
    np.testing.assert_allclose(
        np.einsum("ij...,j...->i...", r, vector), tops.rotated(q, vector) / (q * q).sum(axis=0), atol=1e-13
    )
    np.testing.assert_allclose(np.einsum("ki...,kj...->ij...", r, r), np.eye(3)[..., np.newaxis] * np.ones(7), atol=1e-14)
    np.testing.assert_allclose(quaternion.matrix(3.0 * q), r, rtol=0, atol=1e-14)
    both = np.einsum("ij...,jk...->ik...", quaternion.matrix(p), r)
    np.testing.assert_allclose(quaternion.matrix(quaternion.product(p, q)), both, rtol=0, atol=1e-14)
    quarter = quaternion.matrix(quaternion.from_axis_angle([0.0, 0.0, 5.0], 0.5 * math.pi))
    np.testing.assert_allclose(quarter, [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], atol=1e-15)
    assert quaternion.from_axis_angle([1e-200, 0.0, 0.0], np.zeros((2, 3))).shape == (4, 2, 3)
    assert_raises(
        (lambda: quaternion.from_axis_angle([0.0, 0.0, 0.0], 1.0), "axis: expected a direction"),
        (lambda: quaternion.from_axis_angle([0.0, 0.0, 1.0], 1e17), "angle: expected at most"),
        (lambda: quaternion.matrix(np.zeros(4)), "q: expected quaternions that are not zero"),
        (lambda: quaternion.product(np.ones(3), np.ones(4)), "p: expected 4 numbers"),
        kind=ArgumentError,
    )


@for_each("keeper", [sw.NormControl(0.7), sw.Projection("norm")])
def test_a_step_under_control_is_explained_and_exported(keeper: Any) -> None:
    """Without a state, which such a control does not need; the exported Python makes the same step."""
    body = sw.RigidBody([1.0, 1.5, 2.0], damping=0.1)
    assert sw.explain(body, "standard_euler", control=keeper) != sw.explain(body, "standard_euler")
    source = sw.export(body, "rk4", "python", dt=0.1, control=keeper).source
    assert source != sw.export(body, "rk4", "python", dt=0.1).source
    controlled = body.under(keeper, ())
    free, corrected = (
        sw.integrate(each, "merson", v=np.ones(3), y=1.01 * np.array(tops.UNIT), tolerance=1e-3, at=[3.0])
        for each in (body, controlled)
    )
    off = [abs(float(run.y[-1] @ run.y[-1]) - 1.0) for run in (free, corrected)]
    assert off[1] < 0.1 * off[0]  # the control decays as exp(−2·0.7·3) = 0.015


@for_each("keeper", [None, sw.NormControl(0.7), sw.Projection("norm")])
def test_the_derivative_of_a_step_under_control(keeper: Any) -> None:
    """By the complex step, as for every system here, against differences: their error is e² and a rounding by e."""
    free = sw.RigidBody([1.0, 1.5, 2.0], weight=1.2, centre=[0.1, 0.2, 0.3])
    body = free if keeper is None else free.under(keeper, ())
    v, q, e = np.array([0.4, -0.8, 1.1]), 1.1 * tops.some_attitude(8), 1e-5

    def after(state: Any) -> Any:
        run = sw.integrate(free, "rk4", v=state[:3], y=state[3:], dt=0.2, steps=1, control=keeper)
        return np.concatenate([run.v[-1], run.y[-1]])

    state = np.concatenate([v, q])
    columns = [(after(state + change) - after(state - change)) / (2 * e) for change in e * np.eye(7)]
    matrix = sw.analyse(body, "rk4", dt=0.2, at=(v, q)).P
    np.testing.assert_allclose(matrix, np.stack(columns, axis=1), rtol=0, atol=1e-9)


def test_a_quaternion_that_steps_have_damped_away_is_told() -> None:
    """Backward Euler divides |q|² by 1 + (½h|ω|)² in each step of a steady rotation, and the attitude stays what it is."""
    body, dt = sw.RigidBody([1.0, 1.0, 1.0]), 0.1
    start: dict[str, Any] = {"v": [0.0, 0.0, 1.0], "y": [1.0, 0.0, 0.0, 0.0], "dt": dt}
    for steps in (5400, 5600):
        length = (1.0 + (0.5 * dt) ** 2) ** (-0.5 * steps)
        run = None
        if length > 1e-3:
            run = sw.integrate(body, "backward_euler", **start, steps=steps)
            assert not run.findings
        else:
            with pytest.warns(sw.AccuracyWarning, match=f"a quaternion has the length {length:.3g} in place of 1, .*Projection"):
                run = sw.integrate(body, "backward_euler", **start, steps=steps)
        assert np.linalg.norm(run.y[-1]) == pytest.approx(length, rel=1e-9)
    kept = sw.integrate(body, "backward_euler", **start, steps=5600, control=sw.Projection("norm"))
    assert not kept.findings
    world = sw.World(body, "backward_euler", v=np.array([0.0, 0.0, 1.0]), y=np.array([1.0, 0.0, 0.0, 0.0]), dt=10.0 * dt)
    with pytest.warns(sw.AccuracyWarning, match="a quaternion has the length .* in place of 1"):
        world.step(1000)
