"""What only a step in float32 is said to be: shorter numbers, wider kernels, and what it does not work with."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.source.explanation.formula import number
from stepwell.views import cli
from support.explain import lines

F = np.float32


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
        (sw.Oscillator(), "taylor", {}, "dtype: float32 does not work with taylor"),
        (bodies, "rk4", {"record": "energy"}, "record: float32 runs compute it of the saved states, in float64"),
        (sw.Oscillator(a=sw.Sampled([1.0, 2.0], 1.0)), "rk4", {}, "dtype: a listing has numbers of one width"),
    ):
        with pytest.raises(UnsupportedError, match=message):
            sw.explain(system, method, dtype="float32", **options)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="is too long; float32 works with steps of up to 4000"):
        sw.explain(sw.NBody(np.ones(200)), "rk4", dtype="float32")
    assert _core.isa()


def test_the_command(capsys: Any) -> None:
    assert cli.main(["explain", "Pendulum", "false_euler", "--float32"]) == 0
    assert capsys.readouterr().out.startswith("False Euler: a step of Pendulum(omega=1.0), 1 member, in float32")
