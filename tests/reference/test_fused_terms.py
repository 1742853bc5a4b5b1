"""Sums of two products in fused steps are taken apart: fewer operations, fewer of them one after the other, in both languages."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference.tape.fused import fused
from stepwell.reference.tape.lines import listed, needed
from support.ways import assert_equal_ways


def names(values: list[Any], tape: Any) -> list[str]:
    """The operations of a fused tape, in which leaves do not count; both languages write the same."""
    core = listed(*tape.fused(values))
    assert core == needed(*fused(*listed(tape, values)))
    return sorted(operation.name for operation in core[0] if operation.of)


def test_any_signs_take_two_fused_operations() -> None:
    """±a ± (±p·q ± r·s); of small whole numbers, which round nowhere, it is the value of the plain tape."""
    for case in itertools.product((False, True), repeat=6):
        minus_a, minus_sum, minus_second, negated, a_is_first, a_is_of_state = case
        tape = _core.Tape()
        x, y, p, q = tape.state(0), tape.state(1), tape.param(0), tape.param(1)
        a: Any = tape.state(2) if a_is_of_state else tape.param(2)
        a = -a if minus_a else a
        both = p * x - q * y if minus_second else p * x + q * y
        both = -both if negated else both
        first, second = (a, both) if a_is_first else (both, a)
        whole = first - second if minus_sum else first + second
        of_state = [name for name in names([whole], tape) if name != "negate"]
        assert len(of_state) == 2, case
        assert all("multiply" in name for name in of_state), (case, of_state)
        numbers = [3.0, 5.0, 7.0] if a_is_of_state else [3.0, 5.0]
        values = [
            value(*tape_of, numbers, [11.0, 13.0, 7.0]) for tape_of in (listed(*tape.fused([whole])), listed(tape, [whole]))
        ]
        assert values[0] == values[1], case


def value(lines: list[Any], roots: list[int], state: list[float], parameters: list[float]) -> float:
    """A line's value, of numbers of which all sums and products are exact."""
    values: list[float] = []
    rules: dict[str, Any] = {
        "add": lambda a, b: a + b, "subtract": lambda a, b: a - b, "multiply": lambda a, b: a * b, "negate": lambda a: -a,
        "multiply add": lambda a, b, c: a * b + c, "multiply subtract": lambda a, b, c: a * b - c,
        "subtract multiply": lambda a, b, c: c - a * b,
    }  # fmt: skip
    for name, of, extra in lines:
        leaf = {"state": state, "parameter": parameters}.get(name)
        values.append(rules[name](*(values[each] for each in of)) if leaf is None else leaf[extra])
    return values[roots[0]]


def test_what_is_left_as_it_is() -> None:
    """A third value that is known last, products that are read again, and products of what is known before the step."""
    tape = _core.Tape()
    x, y, p, q = tape.state(0), tape.state(1), tape.param(0), tape.param(1)
    late = (x * y + p).sqrt().sqrt().sqrt()
    assert names([late + (p * x + q * y)], tape).count("add") == 1
    once = p * x
    assert "multiply" in names([late * q - (once + q * y), once], tape)
    assert names([x + (p * q + q * q)], tape).count("add") >= 1


def test_a_chain_is_shorter() -> None:
    """Two products, the later one with one operation behind it."""
    listing = str(sw.explain(sw.Oscillator(1.1, damping=0.1, a=sw.Sinusoid(0.7, 0.9)), "standard_heun", fused=True))
    in_each = listing.split("in each step")[1].split("operations of a step")[0]
    assert in_each.count("fma(") == 7
    assert in_each.count("·") == 0


@pytest.mark.parametrize("method", ["standard_heun", "dop853"])
def test_every_level_has_the_bits_of_the_reference(method: str) -> None:
    """Where one member overflows, too."""
    system = sw.Oscillator(np.linspace(0.5, 2.0, 19), damping=np.linspace(0.0, 0.3, 19), a=sw.Sinusoid(0.7, 0.9))
    y = np.linspace(-1.0, 1.0, 19)
    y[7] = 1e308
    ways = ("by the reference", "at each level")
    run = assert_equal_ways(system, method, ways=ways, v=1e308 * (y > 2.0), y=y, dt=0.5, steps=40, fused=True)
    assert np.isfinite(np.delete(run.y[-1], 7)).all()
