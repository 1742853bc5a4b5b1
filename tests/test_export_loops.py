"""Exported steps that are written as loops: the bits of ``integrate`` in every language."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.source.exports import written
from stepwell.source.exports.tapes import MAX_OPERATIONS
from support.abroad import Journey, run
from support.export import assert_same, languages


def net(n: int) -> tuple[sw.Springs, Any]:
    """n by n particles in space, hung from two corners, with springs along the sides and diagonals of its meshes."""
    at = np.array([[i, j, 0.0] for i in range(n) for j in range(n)], float)
    pairs = [(n * i + j, n * (i + a) + j + b) for a, b in ((1, 0), (0, 1), (1, 1)) for i in range(n - a) for j in range(n - b)]
    return sw.Springs(pairs, stiffness=50.0, damping=0.1, gravity=[0.0, 0.0, -9.81], layout=at, fixed=[0, n - 1]), at


@languages
def test_every_bit_of_long_steps(language: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Springs, chains, particles that meet surfaces and bodies, with more operations than are written one by one.

    In Python with as many as that takes, in the others with a tenth of them: there loops begin at fewer operations.
    """
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
