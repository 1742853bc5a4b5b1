"""Exported steps that are written as loops: the bits of ``integrate`` in every language, and texts that stay short."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.source.exports import lane_writer, lanes, written
from stepwell.source.exports.loops import NoLoopError
from stepwell.source.exports.tapes import MAX_OPERATIONS, MAX_SHORT
from support.abroad import Journey, run
from support.export import assert_same, languages


def refuse(*_: Any) -> None:
    raise NoLoopError


def net(n: int, **others: Any) -> tuple[sw.Springs, Any]:
    """n by n particles in space, hung from two corners, with springs along the sides and diagonals of its meshes."""
    at = np.array([[i, j, 0.0] for i in range(n) for j in range(n)], float)
    pairs = [(n * i + j, n * (i + a) + j + b) for a, b in ((1, 0), (0, 1), (1, 1)) for i in range(n - a) for j in range(n - b)]
    return sw.Springs(
        pairs, stiffness=50.0, gravity=[0.0, 0.0, -9.81], layout=at, fixed=[0, n - 1], **{"damping": 0.1} | others
    ), at


@languages
def test_every_bit_of_long_steps(language: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Springs, chains, particles that meet surfaces and bodies, with more operations than are written one by one.

    In Python with as many as that takes, in the others with a tenth of them: there loops begin at fewer operations. These are the
    loops of single operations, for steps whose lanes are not alike.
    """
    monkeypatch.setattr(written, "Lanes", refuse)
    rng = np.random.default_rng(3)
    share = 1 if language == "python" else 10
    most = MAX_OPERATIONS // share
    monkeypatch.setattr(written, "MAX_OPERATIONS", most)
    springs, at = net(20 if share == 1 else 7)
    floors = [sw.Floor(restitution=0.1, friction=0.3), sw.Sphere((0.0, 0.5), 0.4)]
    particles, places = sw.Particles(np.ones(150 // share), floor=floors), rng.normal(size=(150 // share, 2))
    bodies = sw.NBody(np.ones(60 if share == 1 else 20), force="newton", softening=0.1)
    apart = rng.normal(size=bodies.y_shape)
    masses = 700 // share
    every = [
        Journey(springs, "false_euler", 0.1 * rng.normal(size=at.shape), at, 5, options={"force": rng.normal(size=at.shape)}),
        Journey(sw.Chain(masses), "rk4", rng.normal(size=masses), rng.normal(size=masses), 5),
        Journey(particles, "false_heun", rng.normal(size=places.shape), places, 9),
        Journey(bodies, "verlet", rng.normal(size=apart.shape), apart, 3, dt=0.01),
        Journey(bodies, "false_euler", 0.0 * apart, apart, 3, dt=0.01, options={"control": sw.EnergyControl(0.3)}),
    ]
    sources = [each.export(language, f"step_{i}") for i, each in enumerate(every)]
    assert all(each.operations > most for each in sources)
    assert_same(every, run(language, every, tmp_path, [each.source for each in sources]))


@sw.system(shape=(60,))
def exponentials(t: Any, v: Any, y: Any) -> Any:
    """ÿ = −eʸ + the y before, with operations on bits within a lane."""
    return -np.exp(y) + np.roll(y, 1)


def lying(n: int, restitution: float = 0.3, friction: float | None = 0.2) -> tuple[sw.Springs, Any]:
    """A net just above a floor that is inclined."""
    springs, at = net(n, floor=sw.Floor(restitution=restitution, friction=friction, normal=(0.0, 0.6, 0.8), offset=-0.05))
    return springs, at


def journeys() -> list[Journey]:
    """Nets, ropes, particles, bodies and equations of one's own, by methods of one stage and of several."""
    rng = np.random.default_rng(7)
    (springs, at), (undamped, _) = net(6), net(6, damping=None)
    contacts, flat = lying(5)
    (few, near), (fewer, nearer) = net(5), lying(3)
    rope = sw.Springs(
        [(i, i + 1) for i in range(39)],
        rest=0.9,
        masses=np.linspace(1.0, 2.0, 40),
        stiffness=90.0,
        gravity=[0.0, -9.81],
        fixed=[0],
    )
    along = np.stack([np.arange(40.0), np.zeros(40)], axis=1)
    particles, places = sw.Particles(np.ones(30), gravity=9.81, floor=sw.Floor(restitution=0.5)), rng.uniform(0.0, 0.3, (30, 2))
    bodies, apart = sw.NBody(np.ones(12), force="newton", softening=0.1), rng.normal(size=(12, 3))
    push = {"force": rng.normal(size=at.shape)}
    return [
        Journey(springs, "false_euler", 0.1 * rng.normal(size=at.shape), at, 7, options=push),
        Journey(springs, "rk4", 0.1 * rng.normal(size=at.shape), at, 4, options=push),
        Journey(undamped, "leapfrog", 0.1 * rng.normal(size=at.shape), at, 5, options=push),
        Journey(contacts, "false_euler", 0.1 * rng.normal(size=flat.shape) - [0.0, 0.0, 3.0], flat, 12, dt=0.02),
        Journey(contacts, "false_heun", 0.1 * rng.normal(size=flat.shape) - [0.0, 0.0, 3.0], flat, 6, dt=0.02),
        Journey(rope, "verlet", 0.0 * along, along, 9, dt=0.01),
        Journey(rope, "rk4", 0.0 * along, along, 9, dt=0.01),
        Journey(particles, "leapfrog", rng.normal(size=places.shape), places, 9),
        Journey(bodies, "false_euler", 0.0 * apart, apart, 3, dt=0.01, options={"control": sw.EnergyControl(0.3)}),
        Journey(exponentials(), "rk4", rng.normal(size=60), rng.normal(size=60), 5),
        Journey(few, "false_euler", 0.0 * near, near, 9, options={"dtype": "float32", "force": np.ones(near.shape)}),
        Journey(fewer, "false_euler", 0.0 * nearer - [0.0, 0.0, 3.0], nearer, 9, dt=0.02, options={"dtype": "float32"}),
    ]


@languages
def test_every_bit_of_loops_over_lanes(language: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(written, "MAX_SHORT", 100)
    every = journeys()
    sources = [each.export(language, f"step_{i}") for i, each in enumerate(every)]
    begin = {"c": "for (int i", "csharp": "for (int i", "javascript": "for (let i", "rust": "for i in", "python": "for i in"}[
        language
    ]
    assert all(begin in each.source for each in sources)
    assert_same(every, run(language, every, tmp_path, [each.source for each in sources]))


def not_own(self: Any, lines: Any) -> bool:
    return len(self._to.get(lines[0], ())) == 1 and all(len(self._to.get(line, ())) == 1 for line in lines)


def too_early(self: Any, i: int, lines: Any) -> int:
    self._taken = []
    return space(self, i, lines)


space = lane_writer.LaneWriter._space


@pytest.mark.parametrize(
    ("of", "name", "mistake"),
    [
        (lanes, "COMMUTATIVE", ("add", "multiply", "subtract")),
        (lane_writer.LaneWriter, "_is_direct", not_own),
        (lane_writer.LaneWriter, "_space", too_early),
    ],
    ids=["differences turned round", "results too early", "places used twice"],
)
def test_a_mistake_in_lanes_is_noticed(of: Any, name: str, mistake: object, tmp_path: Path, monkeypatch: Any) -> None:
    """In Python, which compiles nothing: another value in some step."""
    monkeypatch.setattr(written, "MAX_SHORT", 100)
    every = [journeys()[i] for i in (1, 5, 9)]
    assert_same(every, run("python", every, tmp_path))
    monkeypatch.setattr(of, name, mistake)
    with pytest.raises(AssertionError):
        assert_same(every, run("python", every, tmp_path))


def test_a_text_grows_with_its_tables_alone() -> None:
    """Lines of the step of a net on a floor: as many for four times as many springs; so long a step is written as loops."""

    def lines_of(n: int) -> list[str]:
        springs, at = lying(n)
        step = sw.export(springs, "false_euler", "c", v=0.0 * at, y=at, name="net")
        assert step.operations > MAX_SHORT
        return step.source[step.source.index("void net_step(") :].splitlines()

    few, many = lines_of(8), lines_of(16)
    assert len(many) == len(few) < 200
    assert any("if (" in line for line in few)  # the contact is computed where a particle meets the floor


def test_a_cloth_of_many_springs_is_exported() -> None:
    """1600 springs and a floor: a hundred thousand operations, in a text that has some numbers for each spring."""
    springs, at = lying(24)
    step = sw.export(springs, "false_euler", "javascript", v=0.0 * at, y=at, name="net")
    assert step.operations > 100_000
    assert len(step.source) < 200 * len(springs.pairs)


def test_what_is_not_alike_is_written_out() -> None:
    """Equations that are all different have no loops, also where they are long."""

    rng = np.random.default_rng(5)
    of = [np.add, np.subtract, np.multiply, np.maximum]
    chosen = [
        [(of[k], other) for k, other in zip(rng.integers(4, size=60), rng.integers(60, size=60), strict=True)] for _ in range(60)
    ]

    @sw.system(shape=(60,))
    def unlike(t: Any, v: Any, y: Any) -> Any:
        rates = []
        for i, each in enumerate(chosen):
            x = y[i]
            for k, (operation, other) in enumerate(each):
                x = operation(x, y[other] if k % 2 else v[other])
            rates.append(x)
        return np.stack(rates)

    step = sw.export(unlike(), "false_euler", "c")
    assert step.operations > MAX_SHORT
    assert "for (" not in step.source[step.source.index("_step(const") :]
