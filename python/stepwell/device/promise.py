"""Test of a device's rounding, which takes some milliseconds at its first use in a process.

The bits of a run are those of the core if sums, products, quotients, roots and fused multiply-adds are rounded to the nearest
number, if subnormal numbers are kept, and if no product is contracted with a sum. OpenCL lets a device do otherwise.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ..base.arrays import Array
from ..errors import UnsupportedError
from ..reference.fma import fma
from .opencl import Machine
from .printer import HEAD, TYPES

#: The results of the test, in the order in which the kernel writes them, with what it says of a device where they differ.
TRIED = (
    ("a + b", "sums are not rounded as IEEE 754 asks"),
    ("a * b", "products are not rounded as IEEE 754 asks, or subnormal ones are zero"),
    ("a / b", "quotients are not correctly rounded"),
    ("sqrt(fabs(a))", "roots are not correctly rounded"),
    ("a * b + c", "products are contracted with sums"),
    ("floor(a)", "whole numbers are not exact"),
    ("a * (real)0.5", "subnormal numbers become zero"),
    ("fma(a, b, c)", "fused multiply-adds are not rounded once"),
    ("number_of(bits_of(a) ^ bits_of(b))", "bits change where they are moved"),
    ("a < b ? a : b", "comparisons differ"),
)

TEXT = """
__kernel void tried(__global const real *x, __global real *out, const int n) {
    const int g = get_global_id(0);
    const real a = x[3 * g], b = x[3 * g + 1], c = x[3 * g + 2];
RESULTS
}
"""


@cache
def broken(machine: Machine, single: bool) -> str:
    """Why the device does not have the bits of the core; "" if it has."""
    if not single and not machine.has_doubles:
        return "it has no float64"
    if single and not machine.rounds_single:
        return "it does not round quotients and roots of float32 correctly"
    if single and not machine.has_doubles:
        return "the times of steps are float64, which it does not have"
    numbers = _numbers(single)
    results = "\n".join(f"    out[{i} * n + g] = {text};" for i, (text, _) in enumerate(TRIED))
    try:
        program = machine.program(HEAD + TYPES[single] + TEXT.replace("RESULTS", results))
    except UnsupportedError as error:
        return str(error).removeprefix("device: ")
    n = len(numbers)
    out = np.empty((len(TRIED), n), numbers.dtype)
    room = machine.room(out.nbytes)
    machine.start(program.kernel("tried"), n, None, machine.put(numbers), room, np.int32(n))
    machine.get(out, room)
    for got, expected, (_, reason) in zip(out, _expected(numbers), TRIED, strict=True):
        if not np.array_equal(_bits(got), _bits(expected)):
            return reason
    return ""


def check(machine: Machine, *, single: bool) -> None:
    """Raise if runs of this precision would have other bits than those of the core."""
    if reason := broken(machine, single):
        of = "float32" if single else "float64"
        raise UnsupportedError(
            f"device: {machine.described.name} ({machine.described.title}) would give other bits in {of}: {reason}; use "
            f"device='cpu'{'' if single else ' or, if it can, another device'}"
        )


def _numbers(single: bool) -> Array:
    """Numbers of all sizes, subnormal, infinite and zero ones among them, rows of three."""
    rng = np.random.default_rng(20)
    kind: Any = np.float32 if single else np.float64
    size = 32 if single else 64
    of_bits = rng.integers(0, 1 << size, (2000, 3), dtype=np.uint32 if single else np.uint64).view(kind)
    near = rng.normal(size=(2000, 3)).astype(kind)
    tiny = np.finfo(kind).tiny
    small = (rng.normal(size=(500, 3)) * tiny).astype(kind)
    special = np.array([0.0, -0.0, 1.0, np.inf, -np.inf, tiny, -tiny, tiny / 8, np.finfo(kind).max], kind)
    mixed = special[rng.integers(0, len(special), (500, 3))]
    edge = np.stack([near[:, 0], (1.0 / near[:, 0]).astype(kind), -np.ones(len(near), kind)], axis=1)
    return np.ascontiguousarray(np.concatenate([of_bits, near, small, mixed, edge]), dtype=kind)


def _expected(numbers: Array) -> list[Array]:
    a, b, c = np.ascontiguousarray(numbers.T)
    kind: Any = numbers.dtype.type
    bits: Any = np.uint32 if kind is np.float32 else np.uint64
    with np.errstate(all="ignore"):
        return [
            a + b, a * b, a / b, np.sqrt(np.abs(a)), a * b + c, np.floor(a), a * kind(0.5), np.asarray(fma(a, b, c)),
            (a.view(bits) ^ b.view(bits)).view(kind), np.where(a < b, a, b),
        ]  # fmt: skip


def _bits(numbers: Array) -> Array:
    """The bits of numbers, with one NaN for all: which one an operation gives is not a promise."""
    numbers = np.where(np.isnan(numbers), numbers.dtype.type(np.nan), numbers)
    return np.ascontiguousarray(numbers).view(np.uint32 if numbers.dtype == np.float32 else np.uint64)
