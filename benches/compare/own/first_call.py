"""How long equations take to become machine code: what is waited for once, before the first step."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import stepwell as sw
from stepwell import _core
from stepwell.runs import engine

from ...budget import Budget, StoppedError
from ..peers import MissingPeerError, heyoka_peer, numba_own, numba_peer
from ..report import Table, number
from .equations import EQUATIONS, NAMED, Equation

#: The works that it belongs to.
NAME = "W7"
MEMBERS = 100_000
#: A ring long enough for a step of a thousand operations and more.
POINTS = 100

READING = """\
Milliseconds until the first step of Runge-Kutta 4 of {members:,} members. stepwell: *Python* makes the system and runs its
function with symbols, twice; *trace* makes the tape of a step; *code* writes the machine code; each is the least of
{repeats}. numba compiles for one signature, in blocks of 64 members and as it is usually written. heyoka makes its symbols and
compiles its series, another method, for a batch of one vector at a tolerance of 1e-9. Both do so once, with nothing in a cache,
when they have compiled something before.
"""


@sw.system(order=1)
def fisher(t, y, *, spread=1.0, growth=0.5):
    """A gene that spreads along a ring of points."""
    return spread * (np.roll(y, 1) - 2.0 * y + np.roll(y, -1)) + growth * y * (1.0 - y)


def ring(points: int) -> Equation:
    """The same as assignments."""
    lines = []
    for i in range(points):
        left, right = f"y{i - 1 if i else points - 1}", f"y{(i + 1) % points}"
        lines.append(f"d_y{i} = spread * ({left} - 2.0 * y{i} + {right}) + growth * y{i} * (1.0 - y{i})")
    start = {f"y{i}": (0.0, 1.0) for i in range(points)}
    own = {"spread": (0.5, 1.0), "growth": (0.2, 1.0)}
    return Equation(f"Fisher's equation on {points} points", fisher, "\n".join(lines), start, own, 0.1, 100, {})


def looped(numba: Any) -> Any:
    """Fisher's equation as it is written for numba: loops over points, member after member."""

    @numba.njit
    def rates(y, spread, growth, out):
        n = y.size
        for i in range(n):
            out[i] = spread * (y[i - 1] - 2.0 * y[i] + y[(i + 1) % n]) + growth * y[i] * (1.0 - y[i])

    @numba.njit
    def run(dt, steps, state, own):
        end = np.empty_like(state)
        d1, d2, d3, d4 = (np.empty(len(state)), np.empty(len(state)), np.empty(len(state)), np.empty(len(state)))
        for k in range(state.shape[1]):
            y, spread, growth = state[:, k].copy(), own[0, k], own[1, k]
            for _ in range(steps):
                rates(y, spread, growth, d1)
                rates(y + 0.5 * dt * d1, spread, growth, d2)
                rates(y + 0.5 * dt * d2, spread, growth, d3)
                rates(y + dt * d3, spread, growth, d4)
                y += dt / 6.0 * (d1 + 2.0 * d2 + 2.0 * d3 + d4)
            end[:, k] = y
        return end

    return run


def seconds(call: Callable[[], object]) -> float:
    """How long a call takes."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def ours(equation: Equation, repeats: int) -> tuple[float, float, float]:
    """Python, trace and code."""
    own = {name: np.linspace(*bounds, MEMBERS) for name, bounds in equation.own.items()}
    half = len(equation.states) // 2
    order = equation.system.order
    block = (half if order == 2 else len(equation.states), MEMBERS)
    state = np.empty(block[1:] if block[0] == 1 else block)
    shapes = (state if order == 2 else None, state)

    def made() -> sw.System:
        return equation.system(**own).for_state_shapes(*shapes)

    python = min(seconds(made) for _ in range(repeats))
    model = engine.model(engine.Plan(made(), sw.method("rk4"), (MEMBERS,), equation.dt))
    told = [_core.compiled(model, MEMBERS) for _ in range(repeats)]
    if told[0] is None:
        raise RuntimeError(f"{equation.name} is no single tape")
    return python, min(each["trace"] for each in told), min(each["compile"] for each in told)


def numbas(equation: Equation) -> tuple[float, float]:
    """In blocks, and plain."""
    numba = numba_peer.module()
    if equation.name in NAMED:
        fresh = numba_own.compiled.__wrapped__
        return fresh(equation.name, (64, 1), numba_own.EXACT)[1], fresh(equation.name, None, numba_own.EXACT)[1]
    rows = numba.types.Array(numba.float64, 2, "C")
    run = looped(numba)
    return float("nan"), seconds(lambda: run.compile((numba.float64, numba.int64, rows, rows)))


def heyokas(equation: Equation) -> float:
    """A batch integrator."""
    hy = heyoka_peer.module()
    hy.llvm_state.clear_memcache()
    lanes = hy.recommended_simd_size()
    state, own = np.ones((len(equation.states), lanes)), np.ones((len(equation.own), lanes))
    return seconds(lambda: hy.taylor_adaptive_batch(heyoka_peer.equations(equation), state, tol=1e-9, pars=own))


def table(repeats: int, quick: bool, budget: Budget) -> Table:
    """A line for each of the equations, and one for a system of 100 states."""
    equations = [NAMED["lorenz"], ring(10)] if quick else [*EQUATIONS, ring(POINTS)]
    budget = budget.part(2 * len(equations) + 2)

    def tried(name: str, compiled: Callable[[Equation], Any], equation: Equation, missing: Any) -> Any:
        try:
            with budget.part().limit():
                return compiled(equation)
        except MissingPeerError as why:
            remarks.append(str(why))
        except StoppedError as why:
            remarks.append(f"{name} {why}")
        return missing

    def others(equation: Equation) -> list[float]:
        nothing = float("nan")
        return [*tried("numba", numbas, equation, (nothing, nothing)), tried("heyoka", heyokas, equation, nothing)]

    lines, remarks = [], list[str]()
    others(NAMED["duffing"])  # what is loaded once
    for equation in equations:
        remarks = [] if equation.name in NAMED else ["no blocks are written for it"]
        parts = ours(equation, repeats)
        shown = ["—" if np.isnan(each) else number(1e3 * each) for each in (*parts, sum(parts), *others(equation))]
        aim = {"lorenz": "≤ 5", "fisher": "≤ 100"}.get(equation.name, "")
        lines.append([equation.about, str(len(equation.states)), *shown, aim, "; ".join(remarks)])
    head = ["equations", "states", "Python", "trace", "code", "together", "numba, blocks", "numba, plain", "heyoka"]
    return "Own equations: tracing and compiling, ms", [*head, "aim", "remarks"], lines
