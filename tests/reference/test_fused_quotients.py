"""Quotients by numbers in fused steps: two operations, the bits of a division, and the same in both languages."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from hypothesis import given
from hypothesis import strategies as st
from stepwell import _core
from stepwell.reference.bits import DOUBLE, SINGLE
from stepwell.reference.fma import fma
from stepwell.reference.tape.fused import fused
from stepwell.reference.tape.lines import Operation, listed, needed
from stepwell.reference.tape.quotients import LARGEST, inverse
from support.ways import assert_equal_ways, kernels

NUMBERS = st.floats(2.0**-500, 2.0**500).flatmap(lambda c: st.sampled_from([c, -c]))
EDGES = [0.0, -0.0, math.inf, -math.inf, math.nan, 1.7e308, -1.7e308, 1.0, 3.0]


def parts_of(c: float, **options: Any) -> tuple[float, float]:
    parts = inverse(c, **options)
    assert parts is not None
    return parts


@given(NUMBERS)
def test_both_parts_have_one_sign_and_are_as_near_as_can_be(c: float) -> None:
    upper, lower = parts_of(c)
    exact = 1 / Fraction(c)
    assert abs(Fraction(upper)) <= abs(exact) < abs(Fraction(math.nextafter(upper, math.copysign(math.inf, c))))
    assert lower == float(exact - Fraction(upper))
    assert lower == 0.0 or math.copysign(1.0, lower) == math.copysign(1.0, c)


@given(st.floats(2.0**-60, 2.0**60, width=32))
def test_in_float32(c: float) -> None:
    upper, lower = parts_of(c, single=True)
    assert (upper, lower) == (np.float32(upper), np.float32(lower))
    rest = 1 / Fraction(c) - Fraction(upper)
    assert 0 <= rest < Fraction(np.nextafter(np.float32(upper), np.float32(np.inf)).item()) - Fraction(upper)
    assert abs(rest - Fraction(lower)) <= rest / 2**24


def quotient(x: Any, c: float) -> Any:
    upper, lower = parts_of(c)
    return fma(x, np.full_like(x, upper), x * lower)


def test_the_bits_are_those_of_the_quotient() -> None:
    rng = np.random.default_rng(11)
    for c in (3.0, 10.0, -18.0, 80.0, 0.1, 1.0 / 3.0, math.pi, -49.0, 1e150, 1e-150, 1.0 + 2.0**-52, 2.0 - 2.0**-52):
        x = rng.normal(size=20_000) * 2.0 ** rng.integers(-400, 400, 20_000)
        # Quotients next to the middle between two numbers: multiples of c and of a half, and their neighbours.
        near = (rng.integers(2**53, 2**54, 20_000) / 2.0**54) * c
        x = np.concatenate([x, near, np.nextafter(near, np.inf), np.nextafter(near, -np.inf), EDGES])
        with np.errstate(all="ignore"):
            exact, both = x / c, quotient(x, c)
        np.testing.assert_array_equal(both, exact, err_msg=str(c))
        np.testing.assert_array_equal(np.signbit(both[:-5]), np.signbit(exact[:-5]), err_msg=str(c))


def test_small_quotients_are_neighbours_at_most() -> None:
    x = np.random.default_rng(2).uniform(-1.0, 1.0, 20_000) * 2.0 ** -np.linspace(960.0, 1074.0, 20_000).round()
    for c in (3.0, 1e10, -0.7):
        with np.errstate(all="ignore"):
            exact, both = x / c, quotient(x, c)
        assert (np.abs(both - exact) <= np.spacing(np.abs(exact))).all()


def quotients(single: bool) -> tuple[Any, list[Any]]:
    """A tape with divisions of all sorts, and their quotients."""
    tape = _core.Tape(single=single) if single else _core.Tape()
    x, y, p, h = tape.state(0), tape.state(1), tape.param(0), tape.step()
    most = LARGEST.single if single else LARGEST.double
    ends = [math.ldexp(*each) for each in ((1.0, most), (1.5, most), (1.0, -most), (1.0, -most - 1))]
    by = [3.0, -10.0, 4.0, -0.5, 0.1, *ends]
    values = [x / tape.number(c) for c in by]
    values += [-x / tape.number(10.0), (x + y) / tape.number(7.0) + y, y - x / tape.number(3.0) * y, h * x / tape.number(6.0)]
    # What stays: quotients of what is known beforehand, by parameters, and by what changes.
    values += [p / tape.number(3.0) * x, x / p, tape.number(3.0) / x, x / y, x / tape.number(0.0) + y]
    return tape, values


@pytest.mark.parametrize("single", [False, True])
def test_both_languages_write_the_same(single: bool) -> None:
    tape, values = quotients(single)
    core = listed(*tape.fused(values))
    assert core == needed(*fused(*listed(tape, values), single=single))
    assert sum(operation.name == "divide" for operation in core[0]) == 7  # beyond the bounds 2, and the last five


def constants(lines: list[Operation], single: bool) -> list[float]:
    precision = SINGLE if single else DOUBLE
    return [precision.constant(operation.extra) for operation in lines if operation.name == "constant"]


def test_a_sign_is_the_numbers_and_a_power_of_two_one_product() -> None:
    tape = _core.Tape()
    x = tape.state(0)
    lines, _ = listed(*tape.fused([-x / tape.number(10.0)]))
    assert [operation.name for operation in lines].count("negate") == 0
    assert all(each < 0.0 for each in constants(lines, False))
    lines, _ = listed(*tape.fused([x / tape.number(8.0)]))
    assert sorted(operation.name for operation in lines) == ["constant", "multiply", "state"]
    lines, _ = listed(*tape.fused([x + x / tape.number(8.0)]))
    assert sorted(operation.name for operation in lines) == ["constant", "multiply add", "state"]


@sw.system(order=1)
def leaking(t: Any, y: Any, *, tau: float = 7.0) -> Any:
    return -(y + 0.3) / 10.0 + np.exp(-y / 18.0) / tau - y / 3.0


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_bad_member_touches_no_other(dtype: Any) -> None:
    y = np.linspace(-3.0, 3.0, 37)
    ask: dict[str, Any] = {"dt": 0.05, "steps": 30, "fused": True, "dtype": dtype}
    well = assert_equal_ways(leaking(), "rk4", ways=("by the reference", "at each level"), y=y, **ask)
    far = y.copy()
    far[5], far[20] = -1e30, 1e30
    rest = np.delete(np.arange(37), [5, 20])
    for level in sw.isa_levels():
        with kernels(level), pytest.warns(sw.DivergenceWarning):
            ill = sw.integrate(leaking(), "rk4", y=far, **ask)
        assert np.array_equal(ill.y[-1][rest], well.y[-1][rest]), level


def test_the_run_is_as_accurate_as_a_plain_one() -> None:
    y = np.linspace(-3.0, 3.0, 37)
    plain, quick = (sw.integrate(leaking(), "rk4", y=y, dt=0.05, steps=400, fused=each) for each in (False, True))
    assert np.abs(plain.y - quick.y).max() < 1e-14
