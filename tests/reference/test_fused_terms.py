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

SIGNS = list(itertools.product((False, True), repeat=4))


def names(values: list[Any], tape: Any) -> list[str]:
    """The operations of a fused tape, in which leaves do not count; both languages write the same."""
    core = listed(*tape.fused(values))
    assert core == needed(*fused(*listed(tape, values)))
    return sorted(operation.name for operation in core[0] if operation.of)


@pytest.mark.parametrize("signs", SIGNS, ids=str)
@pytest.mark.parametrize("a_is_first", [False, True])
@pytest.mark.parametrize("a_is_of_state", [False, True])
def test_any_signs_take_two_fused_operations(signs: tuple[bool, ...], a_is_first: bool, a_is_of_state: bool) -> None:
    """±a ± (±p·q ± r·s); of small whole numbers, which round nowhere, it is the value of the plain tape."""
    minus_a, minus_sum, minus_second, negated = signs
    tape = _core.Tape()
    x, y, p, q = tape.state(0), tape.state(1), tape.param(0), tape.param(1)
    a: Any = tape.state(2) if a_is_of_state else tape.param(2)
    a = -a if minus_a else a
    both = p * x - q * y if minus_second else p * x + q * y
    both = -both if negated else both
    first, second = (a, both) if a_is_first else (both, a)
    whole = first - second if minus_sum else first + second
    of_state = [name for name in names([whole], tape) if name != "negate"]
    assert len(of_state) == 2
    assert all("multiply" in name for name in of_state), of_state
    numbers = [3.0, 5.0, 7.0] if a_is_of_state else [3.0, 5.0]
    parameters = [11.0, 13.0, 7.0]
    lines, roots = listed(*tape.fused([whole]))
    assert value(lines, roots[0], numbers, parameters) == value(*_plain(tape, whole), numbers, parameters)


def _plain(tape: Any, symbol: Any) -> tuple[list[Any], int]:
    lines, roots = listed(tape, [symbol])
    return lines, roots[0]


def value(lines: list[Any], root: int, state: list[float], parameters: list[float]) -> float:
    """A line's value, of numbers of which all sums and products are exact."""
    made: list[float] = []
    rules: dict[str, Any] = {
        "add": lambda a, b: a + b, "subtract": lambda a, b: a - b, "multiply": lambda a, b: a * b, "negate": lambda a: -a,
        "multiply add": lambda a, b, c: a * b + c, "multiply subtract": lambda a, b, c: a * b - c,
        "subtract multiply": lambda a, b, c: c - a * b,
    }  # fmt: skip
    for name, of, extra in lines:
        leaf = {"state": state, "parameter": parameters}.get(name)
        made.append(rules[name](*(made[each] for each in of)) if leaf is None else leaf[extra])
    return made[root]


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


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
@pytest.mark.parametrize("kernels", ["interpret", "avx2", "avx512"])
@pytest.mark.parametrize("method", ["standard_heun", "rk4", "dop853", "damped_euler"])
def test_every_level_has_the_bits_of_the_reference(method: str, kernels: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where one member overflows, too."""
    if kernels not in sw.isa_levels():
        pytest.skip(f"this CPU has no {kernels}")
    monkeypatch.setenv("STEPWELL_KERNELS", kernels)
    system = sw.Oscillator(np.linspace(0.5, 2.0, 19), damping=np.linspace(0.0, 0.3, 19), a=sw.Sinusoid(0.7, 0.9))
    y = np.linspace(-1.0, 1.0, 19)
    y[7] = 1e308
    options: dict[str, Any] = {"v": 1e308 * (y > 2.0), "y": y, "dt": 0.5, "steps": 40, "fused": True}
    runs = [sw.integrate(system, method, **options, backend=each) for each in ("rust", "numpy")]
    assert runs[0].y.tobytes() == runs[1].y.tobytes()
    assert np.isfinite(np.delete(runs[0].y[-1], 7)).all()
