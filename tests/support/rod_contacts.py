"""What must hold of rods on surfaces, as functions that raise: of the library, and not of a wrong version of it.

A dumb-bell is two points on a rod of length 1, with the angle θ between the rod and the normal of the floor. Impulses act at its
lower end, of mass m; the other mass is M. The rod's direction is r, and cos θ = n·r. An impulse J·n changes the velocities by
J·P·M⁻¹·n: those of the lower end by J·(n − cos θ·M/(m + M)·r)/m, those of the other by J·cos θ·r/(m + M). Along the normal the
lower end yields by 1/m* = (m + M·sin²θ)/(m·(m + M)). With the speed of impact u and the coefficient e, J = (1 + e)·m*·u.

Bounds: a step and a contact are some thousand roundings of numbers no larger than the energies of the motion, with ten sweeps.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import stepwell as sw

ROUNDING = 1000 * 2.0**-53
G = 9.81
RESETTING = sw.Projection("length")
METHODS = [m.name for m in sw.methods() if not m.needs_acceleration]

#: Methods whose velocity is not at the same time as y (tests/support/contacts.py).
LAGGING = ("standard_euler", "damped_euler", "false_euler", "false_heun", "backward_euler", "linearly_implicit_euler")


def dumb_bell(masses: Any = (1.0, 1.0), gravity: float = G, **options: Any) -> sw.Rods:
    """Two points on a rod of length 1, in a plane."""
    return sw.Rods(masses, [(0, 1)], 1.0, gravity=gravity, dim=2, **options)


def tilted(angle: Any, height: Any = 0.0) -> Any:
    """Its places: the lower end on the vertical axis at a height, the rod at an angle from the normal."""
    angle, height = np.broadcast_arrays(angle, height)
    zero = np.zeros_like(angle)
    return np.stack([np.stack([zero, height]), np.stack([np.sin(angle), height + np.cos(angle)])])


def drops_as_a_ball(method: str, backend: str = "rust") -> None:
    """Upright or lying, it has the flight of a point, whatever the phase: with e = 1 both ends return, with e = 0 both stop."""
    e = np.array([1.0, 0.8, 0.3, 0.0])[:, np.newaxis]
    height = np.linspace(0.3, 0.45, 12)
    for angle, masses in ((0.0, (1.0, 2.0)), (0.5 * np.pi, (1.0, 2.0))):
        y = tilted(np.full((4, 12), angle), height)
        bell = dumb_bell(masses, floor=sw.Floor(restitution=e))
        options: dict[str, Any] = {"dt": 1 / 60, "steps": 40, "every": 1, "backend": backend}
        run = sw.integrate(bell, method, v=0.0, y=y, **options, control=RESETTING)
        ball = sw.Particles(gravity=G, floor=sw.Floor(restitution=e), dim=2)
        one = sw.integrate(ball, method, v=0.0, y=y[:1], **options)
        # cos(½π) is not 0 but 6e-17, so the lying one turns by that.
        bound = len(run.t) * ROUNDING * 10.0
        assert np.abs(run.v[:, :, 1] - one.v[:, :1, 1]).max() <= bound
        assert np.abs(run.y[:, :, 1] - (one.y[:, :1, 1] + (y[:, 1] - y[:1, 1]))).max() <= bound
        assert (run.v[-1, :, 1, 3] == 0.0).all()


def strikes(method: str, backend: str = "rust") -> None:
    """The closed form above, without gravity; also with friction that slips or sticks, by the three cases of Coulomb's law.

    With h = 10⁻⁷ the rod turns by at most h·|Δv| < 10⁻⁶ since the impact; so far are the velocities from those at the impact.
    """
    h, angle, phase = 1e-7, np.linspace(-1.4, 1.4, 15), np.linspace(0.05, 1.0, 6)[:, np.newaxis]
    for (m, other), e, mu, along in itertools.product([(1.0, 1.0), (0.5, 2.0)], [1.0, 0.5, 0.0], [None, 0.2, 2.0], [0.0, -0.7]):
        u = 1.3
        bell = dumb_bell((m, other), gravity=0.0, floor=sw.Floor(restitution=e, friction=mu))
        v0 = np.array([[along, -u], [along, -u]])
        y = tilted(np.broadcast_to(angle, (6, 15)), phase * h * u)
        run = sw.integrate(bell, method, v=v0, y=y, dt=h, steps=1, backend=backend, control=RESETTING)
        r = np.stack([np.sin(angle), np.cos(angle)])

        def changed(p: Any, r: Any = r, m: float = m, other: float = other) -> Any:
            """Velocities by an impulse p at the lower end."""
            through = (p * r).sum(axis=0)
            return np.stack([(p - through * (other / (m + other)) * r) / m, through * r / (m + other)])

        normal, slide = (np.broadcast_to(np.array(x)[:, np.newaxis], (2, 15)) for x in ([0.0, 1.0], [1.0, 0.0]))
        n, t = changed(normal), changed(slide)
        np.testing.assert_allclose(n[0, 1], (m + other * np.sin(angle) ** 2) / (m * (m + other)), rtol=1e-14)
        impulse, rub = (1.0 + e) * u / n[0, 1], np.zeros(15)
        if mu is not None:
            for k in range(15):
                impulse[k], rub[k] = coulomb(n[0, :, k], t[0, :, k], (1.0 + e) * u, along, mu)
        expected = v0[:, :, np.newaxis] + impulse * n + rub * t
        # Newton's e with friction may add energy (Kane's paradox): then all velocities are reduced to the energy before.
        before, after = (np.einsum("i,ic...->...", (m, other), v * v) for v in (v0, expected))
        expected = expected * np.sqrt(np.minimum(1.0, before / np.maximum(after, 1e-300)))
        # One sweep leaves the square of the coupling of friction and normal; W is [[n₁, n₀], [n₀, t₀]] of the lower end.
        left = (n[0, 0] ** 2 / (n[0, 1] * t[0, 0])).max() ** 10 if mu is not None else 0.0
        wrong = np.abs(run.v[-1] - expected[:, :, np.newaxis]).max()
        assert wrong <= 3.0 * u * (left + 20.0 * h), (m, other, e, mu, along, wrong, left)


def coulomb(n: Any, t: Any, gain: float, along: float, mu: float) -> tuple[float, float]:
    """Impulses along the normal and the tangent with which the normal velocity gains so much, by Coulomb's law."""
    answers = []
    stuck = np.linalg.solve(np.array([[n[1], t[1]], [n[0], t[0]]]), [gain, -along])
    if stuck[0] >= 0.0 and abs(stuck[1]) <= mu * stuck[0]:
        answers.append((float(stuck[0]), float(stuck[1])))
    for sign in (-1.0, 1.0):
        impulse = gain / (n[1] + sign * mu * t[1])
        slip = along + impulse * (n[0] + sign * mu * t[0])
        if impulse > 0.0 and sign * slip < 0.0:
            answers.append((impulse, sign * mu * impulse))
    assert len(answers) == 1, "Coulomb's law has one answer here"
    return answers[0]


def impulses_by_enumeration(yields: Any, gains: Any) -> Any:
    """λ ≥ 0 with W·λ ≥ gains, and = where λ > 0: the one solution, by trying all sets of contacts that act."""
    solutions = []
    for acts in itertools.product([False, True], repeat=len(gains)):
        on, impulses = np.flatnonzero(acts), np.zeros(len(gains))
        impulses[on] = np.linalg.solve(yields[np.ix_(on, on)], gains[on])
        if (impulses >= 0.0).all() and (yields @ impulses >= gains - 1e-12).all():
            solutions.append(impulses)
    assert all(np.allclose(each, solutions[0]) for each in solutions), "the matrix is positive definite, so there is one"
    return solutions[0]


def strikes_together(method: str, backend: str = "rust") -> None:
    """Points that hit surfaces at once, on rods that couple them: against equations solved by dense matrices, without gravity."""
    h, rng = 1e-8, np.random.default_rng(5)
    floor, wall = sw.Floor(restitution=0.6), sw.Floor(restitution=0.6, normal=(1.0, 0.0))
    corner = np.array([[0.0, 0.8], [0.6, 0.0]])
    places = {
        "ladder": ([(0, 1)], corner, [floor, wall], [(1, [0.0, 1.0]), (0, [1.0, 0.0])]),
        "triangle": (
            [(0, 1), (1, 2), (2, 0)],
            np.array([[0.0, 0.0], [1.0, 0.0], [0.4, 0.7]]),
            [floor],
            [(0, [0.0, 1.0]), (1, [0.0, 1.0])],
        ),
        "tower": (
            [(0, 1), (1, 2), (2, 0)],
            np.array([[0.0, 0.0], [0.3, 0.0], [0.1, 0.8]]),
            [floor],
            [(0, [0.0, 1.0]), (1, [0.0, 1.0])],
        ),
        "arch": ([(0, 1), (1, 2)], np.array([[0.0, 0.0], [0.5, 0.6], [1.0, 0.0]]), [floor], [(0, [0.0, 1.0]), (2, [0.0, 1.0])]),
        "hung": ([((-0.6, 0.4), 0), (0, 1)], np.array([[0.0, 0.0], [0.9, 0.0]]), [floor], [(0, [0.0, 1.0]), (1, [0.0, 1.0])]),
    }
    for (name, (rods, at, surfaces, contacts)), _ in itertools.product(places.items(), range(4)):
        n = len(at)
        masses = rng.uniform(0.5, 2.0, n)
        ends = [[np.array(end) if isinstance(end, tuple) else at[end] for end in rod] for rod in rods]
        lengths = [np.hypot(*(b - a)) for a, b in ends]
        jacobian = np.zeros((len(rods), n, 2))
        for k, (rod, (a, b)) in enumerate(zip(rods, ends, strict=True)):
            for end, sign in zip(rod, (-1.0, 1.0), strict=True):
                if not isinstance(end, tuple):
                    jacobian[k, end] = sign * (b - a)
        jacobian = jacobian.reshape(len(rods), -1)
        normals = np.zeros((len(contacts), n, 2))
        for c, (point, normal) in enumerate(contacts):
            normals[c, point] = normal
        normals = normals.reshape(len(contacts), -1)
        free = np.diag(np.repeat(1.0 / masses, 2))
        mobility = free - free @ jacobian.T @ np.linalg.solve(jacobian @ free @ jacobian.T, jacobian @ free)
        v0 = mobility @ np.diag(np.repeat(masses, 2)) @ (rng.normal(0.0, 1.0, 2 * n) - 2.0 * normals.sum(axis=0))
        speeds = normals @ v0
        # Points that leave are not pushed out, and not let in.
        gains = np.where(speeds < 0.0, -(1.0 + 0.6) * speeds, -speeds)
        yields = normals @ mobility @ normals.T
        expected = v0 + mobility @ normals.T @ impulses_by_enumeration(yields, gains)
        # Ends that leave one of these would gain from the others by Newton's law; then all velocities are reduced.
        before, after = (np.repeat(masses, 2) @ (v * v) for v in (v0, expected))
        expected *= np.sqrt(min(1.0, before / after))
        system = sw.Rods(masses, rods, lengths, gravity=0.0, floor=surfaces)
        start = at + h * 0.5 * np.einsum("cn,c->n", normals, np.maximum(-speeds, 0.0)).reshape(n, 2)  # they hit within the step
        run = sw.integrate(system, method, v=v0.reshape(n, 2), y=start, dt=h, steps=1, backend=backend, control=RESETTING)
        coupling = yields[0, 1] ** 2 / (yields[0, 0] * yields[1, 1])
        wrong = np.abs(run.v[-1].ravel() - expected).max()
        assert wrong <= np.abs(v0).max() * (2.0 * coupling**10 + 1e-6), (name, wrong, coupling)


def returns_from_a_wall(method: str, backend: str = "rust") -> None:
    """A pendulum that meets a wall below its anchor at the speed u leaves with e·u, so it rises to e² of its height."""
    e = np.array([1.0, 0.7, 0.3, 0.0])
    h, start = 0.004, np.array([np.sin(1.0), 0.0, -np.cos(1.0)])
    pendulum = sw.Pendulum3D(1.0, G, floor=sw.Floor(restitution=e, normal=(1.0, 0.0, 0.0)))
    v = np.zeros((3, 4))
    run = sw.integrate(
        pendulum, method, v=v, y=start[:, np.newaxis] + v, dt=h, steps=350, every=1, backend=backend, control=RESETTING
    )
    fall = 1.0 - np.cos(1.0)
    i = int(np.flatnonzero(run.v[:, 0, 0] > 1e-3)[0])  # the first step after the impact
    assert run.y[:, 0].min() >= -2.0 * h * h * G
    top = run.y[i : i + 200, 2].max(axis=0) + 1.0
    # False Euler's own energy along the swing is wrong by about ½·h·g·v; the impact by (h·ω)², and the top is met to ⅛·g·h².
    speed = np.sqrt(2.0 * G * fall)
    own = 8.0 * h * speed if method in LAGGING else 2.0 * (h * speed) ** 2
    np.testing.assert_allclose(top, e * e * fall, rtol=0, atol=own * fall + 2.0 * G * h * h)
    # At rest against the wall it hangs.
    assert np.abs(run.y[-1, :, 3] - [0.0, 0.0, -1.0]).max() <= 2.0 * G * h * h


def adds_no_energy(method: str, backend: str = "rust", control: Any = RESETTING, friction: Any = None, e: Any = None) -> None:
    """In a step with contact: at most the larger of the energies before it, and after it without contact. For every phase,
    angle, speed of turning and step; impacts at speeds of 0.3 to 3 with steps up to h·g = 2·u.
    """
    rng = np.random.default_rng(7)
    shape = (14, 13, 11)
    angle, phase, kick = (
        x.ravel() for x in np.meshgrid(np.linspace(-1.57, 1.57, 14), np.linspace(0.0, 1.0, 13), np.geomspace(0.01, 2.0, 11))
    )
    count = int(np.prod(shape))
    u, turning = rng.uniform(0.3, 3.0, count), rng.normal(0.0, 3.0, count)
    e = rng.choice([0.0, 0.5, 1.0], count) if e is None else np.full(count, e)
    h = 0.02  # one for all members; gravity is what differs
    gravity = kick * u / h
    masses = rng.uniform(0.5, 2.0, (2, count))
    across = np.stack([np.cos(angle), -np.sin(angle)])
    v = np.stack([np.stack([rng.normal(0.0, 1.0, count), -u]), np.zeros((2, count))])
    v[1] = v[0] + turning * across
    y = tilted(angle, phase * h * (u + 0.5 * h * gravity))
    options: dict[str, Any] = {"dt": h, "backend": backend, "control": control}
    floor = sw.Floor(restitution=e, friction=friction)
    run = sw.integrate(dumb_bell(masses, gravity, floor=floor), method, v=v, y=y, steps=3, every=1, **options)
    met = 0
    for k in range(3):
        bare = sw.integrate(dumb_bell(masses, gravity), method, v=run.v[k], y=run.y[k], steps=1, **options)
        touched = (bare.v[-1] != run.v[k + 1]).any(axis=(0, 1))
        most = np.maximum(run.energy[k], bare.energy[-1])
        scale = (
            masses.sum(axis=0) * (gravity * np.abs(run.y[k : k + 2]).max(axis=(0, 1, 2)) + (bare.v[-1] ** 2).max(axis=(0, 1)))
        ).max()
        assert np.where(touched, run.energy[k + 1] - most, -1.0).max() <= ROUNDING * scale
        met += touched.sum()
    assert met > count


def topples(method: str, backend: str = "rust") -> None:
    """A dumb-bell that begins to fall at an angle of 0.3. On a smooth floor its centre falls straight down and its energy stays:
    ½(1 + sin²θ)·θ̇² = 2g(cos θ₀ − cos θ). On a rough one a heavy lower end stays where it is: θ̇² = 2g(cos θ₀ − cos θ).

    Methods of first order are wrong by h times the largest rate, θ̇ < √(2g), of what they keep; the others by less than that
    times h·θ̇. Standard Euler and Damped Euler leave a velocity of h·g at a point that a surface and a rod hold.
    """
    h, steps = 1 / 240, 140
    arguments: dict[str, Any] = {"v": 0.0, "y": tilted(0.3), "dt": h, "steps": steps, "every": 1, "backend": backend}
    smooth = sw.integrate(dumb_bell(floor=sw.Floor(restitution=0.0)), method, **arguments, control=RESETTING)
    rough = sw.integrate(
        dumb_bell((20.0, 1.0), floor=sw.Floor(restitution=0.0, friction=5.0)), method, **arguments, control=RESETTING
    )
    leaves = method in ("standard_euler", "damped_euler")
    first = h * np.sqrt(2.0 * G)
    for run, slides in ((smooth, True), (rough, False)):
        rod, rate = run.y[:, 1] - run.y[:, 0], run.v[:, 1] - run.v[:, 0]
        turning = rate[:, 0] * rod[:, 1] - rate[:, 1] * rod[:, 0]
        known = 2.0 * G * (np.cos(0.3) - rod[:, 1]) / (0.5 * (1.0 + rod[:, 0] ** 2) if slides else 1.0)
        falls = rod[:, 1] > 0.1
        assert falls.sum() > 100
        assert turning[falls][-1] > 2.0
        assert (
            np.abs(turning * turning - known)[falls].max() <= (first if method in LAGGING else first * first) * known[falls][-1]
        )
        assert np.abs(run.y[falls, 0, 1]).max() <= (h * h * G if leaves else steps * ROUNDING)
        if slides:
            assert np.abs(run.y[:, :, 0].sum(axis=1) - run.y[0, :, 0].sum()).max() <= steps * ROUNDING
        else:
            assert np.abs(run.y[falls, 0, 0]).max() <= h * G * (run.t[-1] if leaves else h)


def slides_to_rest(method: str, backend: str = "rust") -> None:
    """Lying along its way, it stops after v₀²/(2·μ·g), but for the last step, in which it moves by less than ½·μ·g·h²."""
    h, mu, v0 = 1 / 120, np.array([0.2, 0.5, 2.0]), 2.0
    v = np.zeros((2, 2, 3))
    v[:, 0] = v0
    y = tilted(np.full(3, 0.5 * np.pi))
    y[:, 1] = 0.0
    bell = dumb_bell((1.0, 2.0), floor=sw.Floor(restitution=0.3, friction=mu))
    run = sw.integrate(bell, method, v=v, y=y, dt=h, steps=150, every=1, backend=backend, control=RESETTING)
    way = run.y[-1, 0, 0]
    assert np.abs(way - v0 * v0 / (2.0 * mu * G)).max() <= 0.5 * (mu * G * h * h).max() + h * h * G  # and the lag of a method
    assert not run.v[-1].any()
    assert np.abs(run.y[:, :, 1]).max() <= 150 * ROUNDING


def comes_to_rest(method: str, backend: str = "rust") -> None:
    """From a drop at an angle, lying and then at rest: velocities of 0, and not a bit of the places changes."""
    angle = np.array([0.2, 0.9, 1.4, -0.6])
    bell = dumb_bell((1.0, 2.0), floor=sw.Floor(restitution=np.array([0.0, 0.5, 0.3, 0.2]), friction=0.4))
    run = sw.integrate(
        bell, method, v=0.0, y=tilted(angle, 0.2), dt=1 / 120, steps=360, every=1, backend=backend, control=RESETTING
    )
    assert not run.v[-20:].any()
    assert (run.y[-20:] == run.y[-1]).all()
    assert np.abs(run.y[-1, :, 1]).max() <= ROUNDING
    length = np.sqrt(((run.y[:, 1] - run.y[:, 0]) ** 2).sum(axis=1))
    assert np.abs(length - 1.0).max() <= 16 * 2.0**-53 * 4
    assert run.y[:, :, 1].min() >= -1e-9


CHECKS = (
    drops_as_a_ball, strikes, strikes_together, returns_from_a_wall, adds_no_energy, topples, slides_to_rest, comes_to_rest,
)  # fmt: skip
ALL = {check.__name__: check for check in CHECKS}
