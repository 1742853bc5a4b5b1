"""What is said of operations of one member that are packed into vectors, and their bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core


def packing(system: sw.System, method: str, **options: Any) -> sw.explanation.Packing | None:
    code = sw.explain(system, method, **options).code
    return None if code is None else code.packing


@pytest.mark.skipif(_core.isa() not in ("avx2", "avx512"), reason="no vectors of one member's numbers are written here")
def test_why_operations_of_one_member_are_packed_or_not() -> None:
    """Three pairs in the plane are; a chain of operations is not; of several members and of too short a step nothing is said."""
    three = sw.NBody(np.ones(3), force="newton")
    packed = packing(three, "leapfrog")
    assert packed is not None
    assert packed.used
    # Of each of three pairs 2 differences, 2 squares, 2 sums, a root, its product, a quotient, and 2 and 4 products with masses
    # and differences; of each velocity a difference and a sum, of each place a product and a sum: 3 · 15 + 6 · 2 + 6 · 2.
    assert packed.operations == sum(sw.explain(three, "leapfrog").computed.values()) == 69
    assert packed.vectors < 69
    assert packed.cycles is not None
    assert packed.chain_cycles <= packed.cycles <= 0.96 * packed.single_cycles
    text = sw.explain(three, "leapfrog").machine
    assert f"Equal operations are lanes of one vector: {packed.vectors} vectors for 69 operations, {packed.moves} of them" in text
    chain = packing(sw.Oscillator(1.0), "rk4")
    assert chain is not None
    assert not chain.used
    assert chain.cycles is None
    # Each of four stages is a product and a sum or two, of 3 cycles each: no order of them takes fewer.
    assert chain.chain_cycles >= 4 * 2 * 3
    assert "not packed into vectors: nearly all of its" in sw.explain(sw.Oscillator(1.0), "rk4").machine
    assert packing(sw.Oscillator(1.0), "false_euler") is None
    assert packing(sw.NBody(np.ones((3, 5)), force="newton"), "leapfrog") is None


@pytest.mark.skipif(_core.isa() not in ("avx2", "avx512"), reason="no vectors of one member's numbers are written here")
def test_packed_steps_have_the_bits_of_the_reference() -> None:
    """A world is packed from its first step on; the reference does number by number what is on the tape."""
    random = np.random.default_rng(3)
    for bodies, dim, method in [(3, 2, "leapfrog"), (3, 3, "rk4"), (4, 3, "false_euler"), (6, 3, "pefrl")]:
        system = sw.NBody(random.uniform(0.5, 1.5, bodies), force="newton", softening=0.1)
        assert (packed := packing(system.__class__(np.ones(bodies), force="newton"), method)) is not None
        assert packed.used
        v, y = random.normal(size=(2, bodies, dim))
        world = sw.World(system, method, v=v.copy(), y=y.copy(), dt=0.01)
        world.step(50)
        run = sw.integrate(system, method, v=v, y=y, dt=0.01, steps=50, every=None, backend="numpy")
        assert np.array_equal(world.y, run.y[-1])
        assert np.array_equal(world.v, run.v[-1])


def test_a_run_that_changes_to_packed_code_keeps_its_bits() -> None:
    """After 30 000 steps of a kernel that no other test has; a world, made afterwards, has packed code from its first step on."""
    system = sw.NBody([1.0, 2.0, 3.0], force="printed", softening=1.0)
    start = np.array([[0.0, 1.0], [1.0, -0.2], [-1.0, 0.1]])
    run = sw.integrate(system, "damped_euler", v=np.zeros((3, 2)), y=start, dt=1e-4, steps=70_000)
    world = sw.World(system, "damped_euler", v=np.zeros((3, 2)), y=start.copy(), dt=1e-4)
    for _ in range(7):
        world.step(10_000)
    assert np.array_equal(run.y[-1], world.y)
    assert np.array_equal(run.v[-1], world.v)
