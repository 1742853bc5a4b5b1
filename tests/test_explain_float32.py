"""What a step in float32 is said to be: its listing, evaluated in float32, and the kernel that is written of it."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.reference.bits import SINGLE
from stepwell.reference.tape.fma import fma
from stepwell.runs import engine
from stepwell.source.explanation import naming
from stepwell.source.explanation.formula import number
from stepwell.views import cli
from support import explain
from support.cases import SYSTEMS, drawn, fits
from support.explain import evaluate, leaves, lines
from support.tracing import MEMBERS, METHODS, H, T, made

F = np.float32


def _as_bits(x: Any) -> Any:
    if isinstance(x, int):
        return np.uint32(x)
    x = np.asarray(x)
    return np.where(x, np.uint32(SINGLE.all_bits), np.uint32(0)) if x.dtype == bool else x.astype(F).view(np.uint32)


def _on_bits(f: Any) -> Any:
    return lambda *of: np.asarray(f(*map(_as_bits, of))).view(F)


FUNCTIONS = explain.FUNCTIONS | {"fma": fma} | {name: _on_bits(f) for name, f in explain.ON_BITS.items()}


@pytest.fixture(autouse=True)
def _in_float32(monkeypatch: pytest.MonkeyPatch) -> None:
    """Listings are evaluated so."""
    monkeypatch.setattr(explain, "NUMBER", F)
    monkeypatch.setattr(explain, "FUNCTIONS", FUNCTIONS)


def explained(system: sw.System, method: Any, **options: Any) -> sw.Explanation | None:
    """The explanation, if float32 goes with both."""
    try:
        return sw.explain(system, method, dtype="float32", **options)
    except (ArgumentError, UnsupportedError) as error:
        if re.search("dtype: |in float32 ", str(error)):
            return None
        raise


def after(step: sw.Explanation, plan: engine.Plan, v: Any, y: Any) -> list[Any]:
    """The next state by the listing."""
    known, tables = leaves(plan)
    rows = [*v.reshape(-1, MEMBERS), *y.reshape(-1, MEMBERS), np.zeros(MEMBERS)]
    known |= dict(zip(naming.states(plan, False), rows, strict=False))
    known = {name: value if callable(value) else np.asarray(value, F) for name, value in known.items()}
    values = evaluate(step, known, tables)
    return [np.broadcast_to(values[name], MEMBERS) for name in naming.states(plan, False, "'")]


@pytest.mark.parametrize("fused", [False, True], ids=["plain", "fused"])
@pytest.mark.parametrize("name", [name for name in SYSTEMS if made(name)[1].size <= 12 * MEMBERS])
def test_every_listing_is_a_step(name: str, fused: bool) -> None:
    system, v, y = made(name)
    v, y = v.astype(F).astype(float), y.astype(F).astype(float)
    for method in drawn([each for each in METHODS if fits(system, each)], 2, name, fused, "float32"):
        step = explained(system, method, fused=fused)
        if step is None:
            continue
        plan = engine.Plan(system, method, (MEMBERS,), float(F(H)), t0=T, fused=fused, single=True)
        out = engine.advance(plan, v, y, carried=True)
        wanted = [*out.slot.reshape(-1, MEMBERS), *out.y[-1].reshape(-1, MEMBERS)]
        computed = after(step, plan, v, y)
        for mine, theirs in zip(computed, wanted, strict=False):
            assert mine.dtype == theirs.dtype == F
            np.testing.assert_array_equal(mine, theirs)
        total = sum((Counter(line.operations) for line in step.sections[-1].lines), Counter[str]())
        assert total == +Counter(step.computed)


def test_numbers_are_the_shortest_that_are_read_as_them() -> None:
    assert "v'  = v + 0.16666667·(2·(−a1 − a3 − a4) − Φ·(y + dy3))" in lines(sw.explain(sw.Oscillator(), "rk4", dtype="float32"))
    assert number(0x3E2AAAAB, single=True).text == "0.16666667"
    assert number(0xCB400000, single=True).text == "−12582912"
    assert number(0x7F800000, single=True).text == "∞"
    assert number(0x7FC00000, single=True).text == "0x7fc00000"
    # A listing with the constants of float64 would be another step.
    assert float(F(1 / 6)) != 1 / 6
    for bits in np.random.default_rng(1).integers(0, 0x7F800000, 1000):
        text = number(int(bits), single=True).text
        assert F(text).view(np.uint32) == bits


def test_the_kernel_is_that_of_float32() -> None:
    """Vectors of as many bytes hold twice as many members."""
    wide, half = (sw.explain(sw.Oscillator(), "rk4", members=10_000, dtype=dtype) for dtype in ("float64", "float32"))
    assert (wide.dtype, half.dtype) == ("float64", "float32")
    assert half.title.endswith(", in float32")
    if wide.code is not None:
        assert half.code is not None
        assert half.code.width == 2 * wide.code.width
        assert half.code.size > 0
    assert half.as_dict()["dtype"] == "float32"
    assert wide.computed == half.computed
    pendulum = sw.explain(sw.Pendulum(), "rk4", dtype=F)
    assert pendulum.computed["additions"] < sw.explain(sw.Pendulum(), "rk4").computed["additions"]  # of shorter polynomials


def test_both_ends_of_what_is_carried() -> None:
    explanation = sw.explain(sw.Pendulum(), "verlet", dtype="float32")
    assert [each.when for each in explanation.beside] == ["start", "finish"]
    assert all("12582912" in " ".join(line.formula for line in each.lines) for each in explanation.beside)


def test_what_cannot_be_explained_says_so() -> None:
    bodies = sw.NBody([1.0, 1.0])
    for system, method, options, message in (
        (sw.Oscillator(), "merson", {"attempt": True}, "attempt: in float32 an attempt is two lists"),
        (sw.Oscillator(), "taylor", {}, "dtype: float32 does not go with taylor"),
        (bodies, "rk4", {"record": "energy"}, "record: float32 runs compute it of the saved states, in float64"),
        (sw.Oscillator(a=sw.Sampled([1.0, 2.0], 1.0)), "rk4", {}, "dtype: a listing has numbers of one width"),
    ):
        with pytest.raises(UnsupportedError, match=message):
            sw.explain(system, method, dtype="float32", **options)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="is too long; float32 goes with steps of up to 4000"):
        sw.explain(sw.NBody(np.ones(200)), "rk4", dtype="float32")
    assert _core.isa()


def test_the_command(capsys: Any) -> None:
    assert cli.main(["explain", "Pendulum", "false_euler", "--float32"]) == 0
    assert capsys.readouterr().out.startswith("False Euler: a step of Pendulum(omega=1.0), 1 member, in float32")
