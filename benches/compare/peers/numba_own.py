"""numba on own equations, one thread: in blocks of members, with and without the right to contract and reorder, and as it is
usually written: member after member, with the functions of ``math``.

In blocks, sine and exponential are polynomials without a branch: those of ``math`` are calls, which cost the vectors. They know
no infinities and no subnormal numbers, which favours numba.
"""

from __future__ import annotations

import functools
import math
import time
from itertools import product

import numpy as np

from ..own import blocked
from ..own.equations import NAMED, stacked
from . import Contestant, Ready, Workload, fastest
from .numba_peer import module, polynomial_sine

#: Members of a block, and steps at each visit of it.
SHAPES = [(16, 1), (32, 1), (64, 1), (128, 1), (256, 1), (64, 2)]
#: What numba may do: nothing; contract to FMA; and reorder, besides.
EXACT, CONTRACT, FAST = False, frozenset({"contract"}), True


def polynomial_exp(x):
    """2ⁿ·eʳ, |r| ≤ ½·ln 2, by Taylor's polynomial of degree 13, which misses 4e-18; odd and even powers apart."""
    n = math.floor(x * 1.4426950408889634 + 0.5)
    r = (x - n * 0.6931471803691238) - n * 1.9082149292705877e-10
    z = r * r
    w = z * z
    even = (1.0 + z * 0.5) + w * (
        (1.0 / 24 + z * (1.0 / 720)) + w * ((1.0 / 40320 + z * (1.0 / 3628800)) + w * (1.0 / 479001600))
    )
    odd = (1.0 + z * (1.0 / 6)) + w * (
        (1.0 / 120 + z * (1.0 / 5040)) + w * ((1.0 / 362880 + z * (1.0 / 39916800)) + w * (1.0 / 6227020800))
    )
    scale = np.int64((np.int64(n) + 1023) << 52).view(np.float64)
    return (even + r * odd) * scale


@functools.cache
def compiled(name: str, shape: tuple[int, int] | None, fast):
    """The steps of these equations in this shape, or one by one, and the seconds that it took to compile."""
    numba = module()
    fast = set(fast) if isinstance(fast, frozenset) else fast
    njit = functools.partial(numba.njit, fastmath=fast, error_model="numpy" if shape else "python")
    if shape:
        functions = {"sin": polynomial_sine, "exp": polynomial_exp}
        # The drive's cosine is made once for all members, by math.
        used = {key: njit(each, inline="always") for key, each in functions.items() if f"{key}(" in NAMED[name].text}
        run = njit(blocked.side_by_side(NAMED[name], *shape, used))
    else:
        run = njit(blocked.one_by_one(NAMED[name], {}))
    start = time.perf_counter()
    rows = numba.types.Array(numba.float64, 2, "C")
    run.compile((numba.float64, numba.int64, rows, rows))
    return run, time.perf_counter() - start


def made(shape, fast, work: Workload) -> Ready:
    """A workload in this shape."""
    module()
    state, own = stacked(work.data, work.equation)
    run, seconds = compiled(work.equation.name, shape, fast)
    allowed = "" if shape is None or fast is EXACT else ", reordered" if fast is FAST else ", contracted"
    told = "member after member" if shape is None else "block {} × {} steps".format(*shape) + allowed
    return Ready(lambda: work.blocks(run(work.dt, work.steps, state, own)), f"{told}; JIT {seconds:.1f} s")


def best(*allowed):
    """The fastest of all shapes with any of these rights."""

    def ready(work: Workload, quick: bool) -> Ready:
        shapes = [(SHAPES[2], allowed[-1])] if quick else [*product(SHAPES, allowed)]
        fit = [each for each in shapes if work.steps % each[0][1] == 0]
        return fastest([functools.partial(made, *each) for each in fit], work, quick)

    return ready


def plain(work: Workload, quick: bool) -> Ready:
    """As most people write it."""
    return made(None, EXACT, work)


KINDS = [f"own_{name}" for name in NAMED]
CONTESTANTS = [
    Contestant("numba", dict.fromkeys(KINDS, best(CONTRACT, FAST))),
    Contestant("numba, exact", dict.fromkeys(KINDS, best(EXACT))),
    Contestant("numba, plain", dict.fromkeys(KINDS, plain), slow="members"),
]
