"""SciPy on own equations: ``solve_ivp``, member after member, rates in pure Python: for so few numbers NumPy is slower.

It chooses its steps: it gets the coarsest tolerance that makes it as exact as the others, by the faster of two methods.
"""

from __future__ import annotations

import functools
import math
import time

import numpy as np

from ..own.equations import NAMED, stacked
from ..own.tolerance import TRIAL, as_exact
from . import Contestant, MissingPeerError, Ready, Workload


def solve(method: str, work: Workload, tolerance: float):
    """All members."""
    from scipy.integrate import solve_ivp

    rates, (state, own) = work.equation.function(math), stacked(work.data, work.equation)
    out = np.empty_like(state)
    for k in range(work.members):
        p = own[:, k].tolist()

        def asked(t, s, p=p):
            return rates(t, s.tolist(), p)

        out[:, k] = solve_ivp(asked, (0.0, work.end), state[:, k], method, rtol=tolerance, atol=tolerance).y[:, -1]
    return work.blocks(out)


def ready(work: Workload, quick: bool) -> Ready:
    """As exact as the others."""
    try:
        import scipy.integrate  # noqa: F401
    except ImportError:
        raise MissingPeerError("SciPy is not installed") from None
    best = math.inf, ""
    few = work.cut(members=TRIAL)  # to choose the method by
    for method in ("RK45", "DOP853"):
        tolerance = as_exact(few, functools.partial(solve, method))
        start = time.perf_counter()
        solve(method, few, tolerance)
        best = min(best, (time.perf_counter() - start, method))
    _, method = best
    tolerance = as_exact(work, functools.partial(solve, method))
    return Ready(lambda: solve(method, work, tolerance), f"{method}, own steps, tolerance {tolerance:.0e}")


CONTESTANTS = [Contestant("SciPy", {f"own_{name}": ready for name in NAMED}, slow="members", alike=False)]
