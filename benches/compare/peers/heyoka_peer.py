"""heyoka's Taylor series on own equations, one thread, in batches of as many members as a vector holds.

It chooses its steps, and so does fewer of them: it gets the coarsest tolerance that makes it as exact as the others. Its speed is
shown as if it had made the others' steps. Compiling is not timed.
"""

from __future__ import annotations

import functools
import time

import numpy as np

from ..own.equations import NAMED, Equation, stacked
from ..own.tolerance import as_exact
from . import Contestant, MissingPeerError, Ready, Workload


def module():
    """heyoka, if there."""
    try:
        import heyoka
    except ImportError:
        raise MissingPeerError("heyoka is not installed") from None
    if hasattr(heyoka.llvm_state, "set_diskcache_enabled"):
        heyoka.llvm_state.set_diskcache_enabled(False)  # what an earlier run compiled would be told as this one's time
    return heyoka


def equations(equation: Equation):
    """(state, rate) in heyoka's symbols, whose functions have the names that others have, too."""
    hy = module()
    states = [hy.make_vars(each) for each in equation.states]
    own = [hy.par[k] for k in range(len(equation.own))]
    return list(zip(states, equation.function(hy)(hy.time, states, own), strict=True))


@functools.cache
def integrator(name: str, tolerance: float):
    """For a vector of members, and the seconds that it took to compile."""
    hy, equation = module(), NAMED[name]
    lanes = hy.recommended_simd_size()
    state, own = np.ones((len(equation.states), lanes)), np.ones((len(equation.own), lanes))
    start = time.perf_counter()
    made = hy.taylor_adaptive_batch(equations(equation), state, tol=tolerance, pars=own)
    return made, time.perf_counter() - start


def solve(work: Workload, tolerance: float):
    """All members, vector after vector; the last one is filled up."""
    several, _ = integrator(work.equation.name, tolerance)
    state, own = stacked(work.data, work.equation)
    lanes = several.batch_size
    filled = np.arange(-(-work.members // lanes) * lanes) % work.members
    state, own = state[:, filled], own[:, filled]
    out, end = np.empty_like(state), np.full(lanes, work.end)
    for first in range(0, len(filled), lanes):
        several.set_time(0.0)
        several.state[:] = state[:, first : first + lanes]
        several.pars[:] = own[:, first : first + lanes]
        several.propagate_until(end)
        out[:, first : first + lanes] = several.state
    return work.blocks(out[:, : work.members])


def ready(work: Workload, quick: bool) -> Ready:
    """As exact as the others."""
    module()
    tolerance = as_exact(work, solve)
    integ, seconds = integrator(work.equation.name, tolerance)
    note = f"own steps, tolerance {tolerance:.0e}, order {integ.order}, batch {integ.batch_size}; compiled in {seconds:.2f} s"
    return Ready(lambda: solve(work, tolerance), note)


CONTESTANTS = [Contestant("heyoka", {f"own_{name}": ready for name in NAMED}, alike=False)]
