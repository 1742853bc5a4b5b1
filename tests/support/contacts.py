"""What must hold of contact, as functions that raise: of the library, and not of a wrong version of it (test_contact.py).

In a uniform field every method makes y₁ = y₀ + h·(v₀ + v₁)/2 + h·c, where the lag c is 0 or ±½·h·g (of the Euler family). So the
velocity w = v + c lies on the parabola through y, and ½w² + g·y is constant in flight. A bounce "safe" leaves the surface with
e² of the energy of impact. For c = 0 that is e² of the energy itself.

Bounds: a step and a contact are at most 64 roundings of numbers that are no larger than the energies of the motion, or of those
that a Rosenbrock method subtracts from each other.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.model import surfaces
from stepwell.reference import contact
from stepwell.reference.rosenbrock import Rosenbrock
from stepwell.runs.engine import direct

from support.mistakes import mistaken

ROUNDING = 64 * 2.0**-53


def set_mistaken(patch: pytest.MonkeyPatch, old: str, new: str) -> None:
    """The reference has other text in one place."""
    wrong = mistaken(contact, old, new)
    for module in (surfaces, direct):
        patch.setattr(module, "contact", wrong)


#: Methods whose velocity is not at the same time as y, and by how much: c/(h·g).
LAG = {"standard_euler": 0.5, "damped_euler": 0.5} | dict.fromkeys(
    ("false_euler", "false_heun", "backward_euler", "linearly_implicit_euler"), -0.5
)


def rounding(method: str) -> float:
    """Of a step relative to the energies; a right-hand side of a Rosenbrock method is γ·(…) of Σ|cᵢⱼ| as large as a solution."""
    module = importlib.import_module(f"stepwell.reference.steppers.{method}")
    own = getattr(module, "METHOD", None)
    rows = own.of_solutions if isinstance(own, Rosenbrock) else []
    return ROUNDING * max([1.0, *(own.gamma * sum(map(abs, row)) for row in rows)])


PARABOLIC = [m.name for m in sw.methods() if m.name not in LAG]

G = 9.81

#: Of the spheres.
CENTRE = (0.1, -0.2)


def impacts(method: str, floor: Any, gravity: Any, backend: str, steps: int = 4) -> tuple[sw.Run, Any]:
    """Impacts at the speed 1 with h = 1 for every phase and every increment h·g up to 2, towards the last axis."""
    phase = np.linspace(0.0, 1.0, 101)[:, np.newaxis]
    kick = np.linspace(0.0, 2.0, 41) if gravity else np.zeros(1)
    travel = phase * (1.0 + kick)
    y = np.broadcast_to(travel, (1, 1, 101, len(kick)))
    ball = sw.Particles(gravity=-kick[np.newaxis, np.newaxis], floor=floor, dim=1)
    return sw.integrate(ball, method, v=-1.0, y=y, dt=1.0, steps=steps, every=1, backend=backend), kick


def energies(run: sw.Run, kick: Any, lag: float = 0.0) -> Any:
    """½v² + g·y, and the term with which a method of lag c·h·g keeps it in flight."""
    return (0.5 * run.v * run.v + kick * run.y + lag * kick * run.v)[:, 0, 0]


def no_energy_added(method: str, backend: str = "rust", restitution: float = 1.0, gravity: bool = True) -> None:
    """Not in any step in which a point met the floor; nor, but for the method's own invariant, in all of them."""
    run, kick = impacts(method, sw.Floor(restitution=restitution), gravity, backend)
    energy = energies(run, kick)
    met = run.v[1:, 0, 0] - (run.v[:-1, 0, 0] - kick) > ROUNDING
    assert met.any(axis=0).mean() > 0.9
    assert np.where(met, np.diff(energy, axis=0), -1.0).max() <= rounding(method) * energy.max()
    # False Euler loses ½·(h·g)² in each step of flight; what the two others keep has the lag's term.
    invariant = energies(run, kick, max(0.0, LAG.get(method, 0.0)))
    rests = (run.y[1:, 0, 0] == 0.0) & (run.v[1:, 0, 0] == 0.0)  # the least of the energy, though not of that with the term
    assert np.where(rests, -1.0, np.diff(invariant, axis=0)).max() <= rounding(method) * energy.max()
    assert run.y.min() >= -rounding(method) * run.y.max()


def squares(method: str, backend: str = "rust", restitution: float = 0.8) -> None:
    """Exactly e² of the energy of impact is left, by each of the methods on the parabola, unless the point rests."""
    run, kick = impacts(method, sw.Floor(restitution=restitution), True, backend, steps=1)
    before, after = energies(run, kick)
    met = run.v[1, 0, 0] - (run.v[0, 0, 0] - kick) > ROUNDING
    flies = met & (restitution * np.sqrt(2.0 * before) > kick + ROUNDING)
    rests = met & (restitution * np.sqrt(2.0 * before) < kick - ROUNDING)
    assert flies.mean() > 0.3
    assert rests.sum() > 50
    assert np.abs(after - restitution**2 * before)[flies].max() <= rounding(method) * before.max()
    assert not run.y[1, 0, 0][rests].any()
    assert not run.v[1, 0, 0][rests].any() or method == "verlet"


def bounces(method: str, backend: str = "rust") -> None:
    """The closed form, state by state, until a flight is shorter than two steps; then rest, for ever."""
    scene = sw.scenes.bouncing_ball()
    h = scene.dt * 0.93  # no impact is at the end of a step
    run = scene.run(method, h, every=1, backend=backend)
    true_v, true_y = scene.exact(run.t)  # type: ignore[misc]
    speed = np.sqrt(2.0 * G)
    flights = np.ceil(np.log(h * G / speed) / np.log(0.8)) - 1.0  # those with e^k·u > h·g
    last = speed / G * (1.0 + 2.0 * sum(0.8**k for k in range(1, int(flights) + 1)))
    flying = run.t < last - 2.0 * h
    # A rounding of an impact's time grows by 1/e with each impact, and there are fewer than 20: 0.8^-20 is 87.
    if method in PARABOLIC:
        assert np.abs(run.v - true_v)[flying].max() <= 100.0 * len(run.t) * ROUNDING * speed
        assert np.abs(run.y - true_y)[flying].max() <= 100.0 * len(run.t) * ROUNDING
    rest = run.t > speed / G * (1.0 + 2.0 * 4.0) + h  # Σ e^k = e/(1 − e) = 4
    assert rest.sum() > 20
    assert not run.y[rest, 0, 1].any()
    assert np.abs(run.v[rest, 0, 1]).max() <= (ROUNDING * G * h if method == "verlet" else 0.0)


def slides(method: str, backend: str = "rust") -> None:
    """A point that slides at v₀ stops at v₀²/(2·μ·g), whatever the step: it is slowed during all of each."""
    mu, v0 = np.array([0.1, 0.5, 2.0]), np.array([[1.0], [3.0], [0.01]])
    floor = sw.Floor(friction=mu)
    run = sw.integrate(
        sw.Particles(gravity=G, floor=floor),
        method,
        v=np.stack([np.broadcast_to(v0, (3, 3)), np.zeros((3, 3))])[np.newaxis],
        y=np.zeros((1, 2, 3, 3)),
        dt=1 / 60,
        steps=240,
        every=1,
        backend=backend,
    )
    np.testing.assert_allclose(run.y[-1, 0, 0], v0 * v0 / (2.0 * mu * G), rtol=len(run.t) * ROUNDING)
    assert np.abs(run.v[-1]).max() <= (ROUNDING if method == "verlet" else 0.0)
    moving = (run.v[:, 0, 0] > ROUNDING).sum(axis=0) * run.dt
    assert np.abs(moving - v0 / (mu * G)).max() <= run.dt * (1.0 + ROUNDING)


def sticks(method: str, backend: str = "rust") -> None:
    """On a slope whose tangent is below μ a point stays where it is; above, it slides down with g·(sin α − μ·cos α)."""
    mu, down = np.array([0.0, 0.3, 0.7]), np.array([np.cos(0.5), -np.sin(0.5)])
    floor = sw.Floor(restitution=0.0, friction=mu, normal=(np.sin(0.5), np.cos(0.5)))
    ball = sw.Particles(gravity=G, floor=floor)
    run = sw.integrate(ball, method, v=np.zeros((1, 2, 3)), y=0.0, dt=0.01, steps=200, every=1, backend=backend)
    along, speed = (np.einsum("c,tcb->tb", down, block[:, 0]) for block in (run.y, run.v))
    pull = np.maximum(0.0, G * (np.sin(0.5) - mu * np.cos(0.5)))
    t = run.t[:, np.newaxis]
    np.testing.assert_allclose(speed, pull * t, rtol=0, atol=len(t) * ROUNDING * G)
    # ½·a·t², and what the method adds of h·a·t.
    assert np.abs(along - 0.5 * pull * t * t).max() <= 0.5 * run.dt * (pull * t).max() * (1.0 + 1e-9)
    assert np.abs(along[:, 2]).max() <= len(t) * ROUNDING
    away = np.abs(np.einsum("c,tcb->tb", [np.sin(0.5), np.cos(0.5)], run.y[:, 0]))
    assert away.max() <= len(t) * ROUNDING * np.abs(run.y).max()


def reflects(method: str, backend: str = "rust") -> None:
    """Inside a circle of radius 1.5, without a force: a billiard keeps its angular momentum, its speed, and the point inside."""
    angle = np.linspace(0.1, 6.2, 25)
    v = np.stack([np.cos(angle), np.sin(angle)])[np.newaxis]
    y = np.array([0.4, 0.1])[np.newaxis, :, np.newaxis]
    ball = sw.Particles(gravity=0.0, floor=sw.Sphere(CENTRE, 1.5, inside=True))
    run = sw.integrate(ball, method, v=v, y=y, dt=0.03, steps=600, every=1, backend=backend)
    from_centre = run.y[:, 0] - np.array(CENTRE)[:, np.newaxis]
    spin = from_centre[:, 0] * run.v[:, 0, 1] - from_centre[:, 1] * run.v[:, 0, 0]
    square = (run.v**2).sum(axis=(1, 2))
    # Verlet finds v as a difference of y over h = 0.03, a rounding of 1/h.
    bound = len(run.t) * ROUNDING * (2.0 / run.dt if method == "verlet" else 1.0)
    assert np.abs(spin - spin[0]).max() <= bound
    assert np.abs(square - 1.0).max() <= bound
    assert np.sqrt((from_centre**2).sum(axis=1)).max() <= 1.5 * (1.0 + ROUNDING)
    assert (np.abs(np.diff(run.v, axis=0)) > 0.1).any(axis=2).sum(axis=0).min() > 4  # a way of 18, at most 3 from wall to wall


def passes(method: str, backend: str = "rust") -> None:
    """A step longer than a ball does not pass through it; a point behind a floor that comes out is left alone."""
    bullet = sw.Particles(gravity=0.0, floor=sw.Sphere((0.0, 0.0), 0.1))
    run = sw.integrate(bullet, method, v=[[5.0, 0.0]], y=[[-1.0, 0.0]], dt=0.5, steps=1, backend=backend)
    np.testing.assert_allclose(run.v[-1], [[-5.0, 0.0]], rtol=0, atol=5.0 * ROUNDING)
    np.testing.assert_allclose(run.y[-1], [[-0.1 - (2.5 - 0.9), 0.0]], rtol=0, atol=5.0 * ROUNDING)
    for floor in (sw.Floor(restitution=0.5), sw.Sphere((0.0, -10.0), 10.0, restitution=0.5)):
        out = sw.Particles(gravity=0.0, floor=floor)
        run = sw.integrate(out, method, v=[[0.0, 1.0]], y=[[0.0, -0.5]], dt=0.1, steps=3, backend=backend)
        np.testing.assert_allclose(run.v[-1], [[0.0, 1.0]], rtol=0, atol=16.0 * ROUNDING)
        np.testing.assert_allclose(run.y[-1], [[0.0, -0.2]], rtol=0, atol=16.0 * ROUNDING)


def rolls(method: str, backend: str = "rust") -> None:
    """A point slides off a ball, on its surface and without a gain but the method's own; in a rough bowl it comes to rest."""
    c, h = np.array(CENTRE), 0.01
    gain = 0.5 * (h * G) ** 2 * max(0.0, 2.0 * LAG.get(method, 0.0))
    off = sw.Particles(gravity=G, floor=sw.Sphere(CENTRE, 1.5, restitution=0.0))
    start = c + 1.5 * np.array([np.sin(0.1), np.cos(0.1)])
    run = sw.integrate(off, method, v=0.0, y=start[np.newaxis], dt=h, steps=60, every=1, backend=backend)
    assert np.diff(run.energy).max() <= gain + 4.0 * G * ROUNDING / h
    # A step along the old v, as by Standard Euler, leaves the ball along the tangent; only the next brings it back: (2·h·v)²/2R.
    hop = 2.0 * (h * h * (run.v**2).sum(axis=(1, 2))).max() / 1.5 if gain else 0.0
    assert np.abs(np.sqrt(((run.y[:, 0] - c) ** 2).sum(axis=1)) - 1.5).max() <= 1.5 * ROUNDING + hop
    assert run.y[-1, 0, 0] - start[0] > 0.05  # it does move
    bowl = sw.Particles(gravity=G, floor=sw.Sphere(CENTRE, 1.5, inside=True, restitution=0.5, friction=0.5))
    run = sw.integrate(bowl, method, v=0.0, y=(c + np.array([0.3, 0.0]))[np.newaxis], dt=h, steps=600, every=1, backend=backend)
    assert np.abs(run.v[-50:]).max() <= (64.0 * ROUNDING if method == "verlet" else 0.0)
    assert abs(np.sqrt(((run.y[-1, 0] - c) ** 2).sum()) - 1.5) <= 1.5 * ROUNDING


def slips(method: str, backend: str = "rust") -> None:
    """Points that slide over a ball do not sink into it, though rounding puts some of them within it at the start of a step."""
    rng, centre = np.random.default_rng(1), np.array([0.5, -0.5, -0.4])
    away = rng.normal(size=(60, 3))
    away[:, 2] = np.abs(away[:, 2])
    start = centre + 0.31 * away / np.sqrt((away * away).sum(axis=1, keepdims=True))
    points = sw.Particles(gravity=G, floor=sw.Sphere(centre, 0.3, restitution=0.0))
    v = rng.normal(0.0, 0.3, (60, 3))
    run = sw.integrate(points, method, v=v, y=start, dt=1 / 600, steps=200, every=1, backend=backend)
    assert np.sqrt(((run.y - centre) ** 2).sum(axis=-1)).min() >= 0.3 - ROUNDING * (0.3 + np.abs(centre).sum())


def corners(method: str, backend: str = "rust", seed: int = 4) -> None:
    """Several surfaces, spheres, friction: no more energy than before the step, or after it without contact."""
    rng, count = np.random.default_rng(seed), 0

    def normal() -> Any:
        v = rng.normal(size=2)
        return v / np.sqrt((v * v).sum())

    for trial in range(6):
        e, mu = float(rng.uniform(0.3, 1.0)), [None, 0.3][trial % 2]
        planes = [sw.Floor(restitution=e, friction=mu, normal=normal(), offset=-1.0) for _ in range(2)]
        spheres = [sw.Sphere((0.0, 0.0), r, inside=r > 0.9, restitution=e, friction=mu) for r in (1.0, 0.5)]
        floor: Any = [planes, spheres[:1], spheres[1:], [planes[0], spheres[1]], [planes[0], spheres[0]], planes[:1]][trial]
        g = 10.0 * rng.normal(size=2)
        turn, size = rng.uniform(0.0, 6.3, 60), rng.uniform(0.52, 0.98, 60)
        y, v = (np.stack([np.cos(turn), np.sin(turn)]) * size)[np.newaxis], 3.0 * rng.normal(size=(1, 2, 60))
        h = float(10.0 ** rng.uniform(-2.5, -1.0))
        run = sw.integrate(
            sw.Particles(gravity=g, floor=floor), method, v=v, y=y, dt=h, steps=int(1.0 / h), every=1, backend=backend
        )
        each = {"v": np.moveaxis(run.v[:-1], 0, -1), "y": np.moveaxis(run.y[:-1], 0, -1)}
        free = sw.integrate(sw.Particles(gravity=g), method, **each, dt=h, steps=1, backend=backend)
        apart = np.abs(free.y[-1] - np.moveaxis(run.y[1:], 0, -1)) + np.abs(free.v[-1] - np.moveaxis(run.v[1:], 0, -1))
        met = (apart > 1e-9).any(axis=(0, 1)).T
        count += met.sum()
        most = np.maximum(run.energy[:-1], free.energy[-1].T)
        scale = np.abs(run.y).max() * np.abs(g).sum() + (run.v**2).max() * (
            1.0 + np.abs(run.y).max() / h
        )  # of Verlet's difference
        assert np.where(met, run.energy[1:] - most, -1.0).max() <= ROUNDING * scale
    assert count > 500


ALL = {f.__name__: f for f in (no_energy_added, squares, bounces, slides, sticks, reflects, passes, rolls, slips, corners)}
