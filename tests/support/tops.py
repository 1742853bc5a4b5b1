"""What is known of rigid bodies from elsewhere: each function runs one by a backend and raises if it moves otherwise."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.model import quaternion

#: Dop853 with these steps errs by less than their roundings, which are together below 1e-13 of the largest number.
STEPS, ROUNDING = 160, 1e-13

UNIT = np.array([1.0, 0.0, 0.0, 0.0])


def some(seed: int, *shape: int) -> Any:
    return np.random.default_rng(seed).normal(size=shape)


def some_attitude(seed: int) -> Any:
    q = some(seed, 4)
    return q / np.sqrt((q * q).sum())


def run(body: sw.System, v: Any, q: Any, end: float, backend: str, **more: Any) -> sw.Run:
    """A run so exact that only rounding is left of its error."""
    arguments: dict[str, Any] = {"method": "dop853", "dt": end / STEPS, "steps": STEPS, "every": STEPS // 4} | more
    return sw.integrate(body, v=v, y=q, backend=backend, **arguments)


def rotated(q: Any, vector: Any) -> Any:
    """q ⊗ vector ⊗ q*, which is the vector along the axes of space; by products alone, not by the matrix."""
    turned = quaternion.product(q, np.concatenate([np.zeros((1, *np.shape(vector)[1:])), vector]))
    return quaternion.product(turned, (np.asarray(q).T * [1.0, -1.0, -1.0, -1.0]).T)[1:]


def close(actual: Any, wanted: Any, times: float = 1.0) -> None:
    np.testing.assert_allclose(actual, wanted, rtol=0, atol=times * ROUNDING * max(1.0, float(np.abs(wanted).max())))


def free_asymmetric_top(backend: str) -> None:
    """Moments 1, 2, 3 and ω(0) = (0.01, 1, 0.01): ω(10) in many digits; after the period of 39.1057 ω is back.

    A small change grows by e in 1/σ = √3, 300 times till t = 10; so do roundings.
    """
    body, v = sw.RigidBody([1.0, 2.0, 3.0]), np.array([0.01, 1.0, 0.01])
    known = [-0.874573437891093646, 0.48499618734104845, 0.505001220547913341]
    close(run(body, v, UNIT, 10.0, backend).v[-1], known, 300)
    close(run(body, v, UNIT, 39.1057341972687209, backend, dt=39.1057341972687209 / 800, steps=800, every=None).v[-1], v, 1e5)


def free_symmetric_top(backend: str) -> None:
    """ω₃ constant, ω₁ + iω₂ turns at (C − A)ω₃/A; the axis goes round L at |L|/A, at an angle of cosine C·ω₃/|L|."""
    for a, c in ((1.0, 1.6), (2.0, 0.7)):
        v, end = np.array([0.3, -0.8, 1.3]), 7.0
        q = some_attitude(1)
        motion = run(sw.RigidBody([a, a, c]), v, q, end, backend)
        turn = (c - a) * v[2] / a * motion.t
        close(motion.v[:, 2], v[2])
        close(motion.v[:, 0] + 1j * motion.v[:, 1], (v[0] + 1j * v[1]) * np.exp(1j * turn))
        momentum = rotated(q, [a * v[0], a * v[1], c * v[2]])
        length = math.sqrt((momentum**2).sum())
        axis = rotated(motion.y.T, np.tile([[0.0], [0.0], [1.0]], len(motion.t)))
        close(momentum @ axis / length, c * v[2] / length)
        steady = quaternion.from_axis_angle(momentum, length / a * motion.t)
        close(axis, rotated(steady, np.tile(axis[:, :1], len(motion.t))), 3)


def turn_at_a_constant_rate(backend: str) -> None:
    """A sphere: q(t) = q(0) ⊗ (cos ½|ω|t, n·sin ½|ω|t)."""
    v, q = np.array([0.4, -0.9, 0.5]), some_attitude(2)
    motion = run(sw.RigidBody([2.0, 2.0, 2.0]), v, q, 5.0, backend)
    close(motion.v, np.tile(v, (len(motion.t), 1)))
    close(motion.y.T, quaternion.product(q, quaternion.from_axis_angle(v, math.sqrt((v * v).sum()) * motion.t)), 3)


def damping_and_torques_of_the_body(backend: str) -> None:
    """A sphere, axis by axis: J·ω̇ = −d·ω, or τ, or a·sin(wt + p)."""
    v, j, damping = np.array([1.0, -0.5, 0.3]), 1.7, np.array([0.2, 0.5, 0.9])
    motion = run(sw.RigidBody([j] * 3, damping=damping), v, UNIT, 3.0, backend)
    close(motion.v, v * np.exp(-np.multiply.outer(motion.t, damping / j)))
    one = run(sw.RigidBody([j] * 3, damping=0.4), v, UNIT, 3.0, backend)
    close(one.v, v * np.exp(-0.4 / j * one.t)[:, np.newaxis])
    motion = run(sw.RigidBody([j] * 3, [0.4, sw.Sinusoid(0.8, 2.1, 0.3), None]), v, UNIT, 3.0, backend)
    waves = 0.8 / 2.1 * (math.cos(0.3) - np.cos(2.1 * motion.t + 0.3))
    close(motion.v, v + np.stack([0.4 * motion.t, waves, 0.0 * motion.t], axis=-1) / j)


def torques_of_space(backend: str) -> None:
    """L̇ = τ along the axes of space, for any body and any length of q; L by products of quaternions."""
    inertia, torque, v = np.array([1.0, 1.4, 2.0]), np.array([0.5, -0.3, 0.8]), np.array([0.4, 0.7, -0.2])
    for scale in (1.0, 1.3):
        q = scale * some_attitude(3)
        motion = run(sw.RigidBody(inertia, space_torque=torque), v, q, 4.0, backend, record="angular_momentum")
        momentum = rotated(motion.y.T, (inertia * motion.v).T) / (motion.y**2).sum(axis=1)
        close(momentum, momentum[:, :1] + np.multiply.outer(torque, motion.t), 10)
        close(motion.recorded["angular_momentum"], momentum.T, 10)


def horizontal_top(backend: str) -> None:
    """A heavy top whose axis is level goes round steadily at W·l/(C·s), in the sense of its spin s, whatever A is."""
    (a, c), weight, lever, spin = (1.2, 0.6), 1.5, 0.8, 3.0
    rate = weight * lever / (c * spin)
    q = quaternion.from_axis_angle([0.0, 1.0, 0.0], 0.5 * math.pi)  # the body's third axis is the first of space
    back = q * [1.0, -1.0, -1.0, -1.0]
    v = np.array([0.0, 0.0, spin]) + rotated(back, [0.0, 0.0, rate])
    motion = run(sw.RigidBody([a, a, c], weight=weight, centre=[0.0, 0.0, lever]), v, q, 5.0, backend)
    axis = rotated(motion.y.T, np.tile([[0.0], [0.0], [1.0]], len(motion.t)))
    close(axis, np.stack([np.cos(rate * motion.t), np.sin(rate * motion.t), 0.0 * motion.t]), 10)


def body_that_swings(backend: str) -> None:
    """Hung off its centre and turned about one axis, it is a pendulum of ω₀² = W·l/J, along each axis in turn."""
    inertia, weight, lever = [1.0, 1.3, 1.9], 2.0, 0.7
    for axis, towards in ((0, 1), (1, 0)):
        centre = np.array([0.0, 0.0, -lever])
        motion = run(
            sw.RigidBody(inertia, weight=weight, centre=centre),
            np.zeros(3),
            quaternion.from_axis_angle(np.eye(3)[axis], 2.0),
            6.0,
            backend,
        )
        swing = sw.Pendulum(math.sqrt(weight * lever / inertia[axis]))
        known = sw.integrate(swing, "dop853", v=0.0, y=2.0, dt=6.0 / STEPS, steps=STEPS, every=STEPS // 4)
        close(2.0 * np.arctan2(motion.y[:, 1 + axis], motion.y[:, 0]), known.y, 10)
        close(motion.v[:, axis], known.v, 10)
        close(motion.v[:, towards], 0.0 * known.v)


def heavy_body_keeps_energy(backend: str) -> None:
    """Of any shape: ½ω·Jω + W·(height) and L about the vertical are constant, for any length of q."""
    inertia, centre = np.array([1.0, 1.4, 2.0]), np.array([0.3, -0.2, 0.6])
    for scale in (1.0, 0.8):
        body = sw.RigidBody(inertia, weight=1.4, centre=centre)
        motion = run(body, [0.4, 0.7, -0.2], scale * some_attitude(4), 4.0, backend)
        square = (motion.y**2).sum(axis=1)
        height = rotated(motion.y.T, np.tile(centre[:, np.newaxis], len(motion.t)))[2] / square
        energy = 0.5 * (inertia * motion.v**2).sum(axis=1) + 1.4 * height
        close(energy, energy[0], 10)
        close(motion.energy, energy, 10)
        upright = rotated(motion.y.T, (inertia * motion.v).T)[2] / square
        close(upright, upright[0], 10)


def settled_norm(backend: str) -> None:
    """Under control Standard Euler settles where (1 − hk(r − 1))² = 1 − Φ², r = q·q, and turns by asin Φ; Φ = ½h|ω|.

    A step is q + ½h·q ⊗ ω + hk(1 − r)·q, and the second term, of length Φ|q|, is at a right angle to q.
    """
    v, h, k = np.array([2.0, -1.0, 2.0]), 0.1, 3.0
    phi = 0.5 * h * 3.0
    settled = 1.0 + (1.0 - math.sqrt(1.0 - phi * phi)) / (h * k)
    body, arguments = sw.RigidBody([1.0, 1.0, 1.0]), {"method": "standard_euler", "dt": h, "steps": 200, "every": 1}
    motion = run(body, v, some_attitude(5), 1.0, backend, control=sw.NormControl(k), record="norm_error", **arguments)
    close(motion.recorded["norm_error"][-1], settled - 1.0)
    cosine = (motion.y[-1] * motion.y[-2]).sum() / settled
    close(math.acos(cosine), math.asin(phi), 10)


def reset_norm(backend: str) -> None:
    """Reset, q has the length 1 after every step, and a step turns it by atan Φ."""
    v, h = np.array([2.0, -1.0, 2.0]), 0.1
    body, arguments = sw.RigidBody([1.0, 1.0, 1.0]), {"method": "standard_euler", "dt": h, "steps": 50, "every": 1}
    motion = run(body, v, 2.0 * some_attitude(5), 1.0, backend, control=sw.Projection("norm"), **arguments)
    close((motion.y[1:] ** 2).sum(axis=1), 1.0, 0.01)  # the root and the quotients round, by 2⁻⁵² together
    close(np.arccos((motion.y[-1] * motion.y[-2]).sum()), math.atan(0.15), 10)


TRUTHS: list[Callable[[str], None]] = [
    free_asymmetric_top,
    free_symmetric_top,
    turn_at_a_constant_rate,
    damping_and_torques_of_the_body,
    torques_of_space,
    horizontal_top,
    body_that_swings,
    heavy_body_keeps_energy,
    settled_norm,
    reset_norm,
]
