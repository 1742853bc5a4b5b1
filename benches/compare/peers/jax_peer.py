"""JAX on own equations, one thread, on the CPU: by diffrax, told Runge-Kutta 4's tableau, and by a loop of one's own.

Both take members side by side in one array, as many at once as stay in the cache; and diffrax also all of them, as most people
write it, which is up to four times as slow. diffrax has no classical Runge-Kutta 4, so it gets its tableau: the same method, as
many steps, of which it keeps the last state alone. Compiling is not timed.
"""

from __future__ import annotations

import functools
import os
import time
from typing import ClassVar

import numpy as np

from ..own.equations import NAMED, stacked
from . import Contestant, MissingPeerError, Ready, Workload

#: So many stay in the cache.
MEMBERS = 4096


@functools.cache
def modules():
    """JAX in double precision, and diffrax. Its threads inherit the core that this one has while they are made: a single one."""
    if not hasattr(os, "sched_getaffinity"):
        raise MissingPeerError("JAX cannot be held to one thread here")
    try:
        import jax

        cores = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {min(cores)})
        try:
            jax.config.update("jax_platforms", "cpu")
            jax.config.update("jax_enable_x64", True)
            jax.numpy.zeros(1).block_until_ready()
        finally:
            os.sched_setaffinity(0, cores)
        import diffrax
    except ImportError as why:
        raise MissingPeerError(f"{why.name} is not installed") from None
    return jax, diffrax


def by_loop(rates, h, steps, state, own):
    """Runge-Kutta 4 by ``fori_loop``."""
    jax, _ = modules()
    stack = jax.numpy.stack

    def step(k, s):
        t = k * h
        d1 = stack(rates(t, s, own))
        d2 = stack(rates(t + h / 2, s + h / 2 * d1, own))
        d3 = stack(rates(t + h / 2, s + h / 2 * d2, own))
        d4 = stack(rates(t + h, s + h * d3, own))
        return s + h / 6 * (d1 + 2.0 * d2 + 2.0 * d3 + d4)

    return jax.lax.fori_loop(0, steps, step, state)


@functools.cache
def solver():
    """diffrax's solver of Runge-Kutta 4's tableau."""
    _, diffrax = modules()
    rows = (np.array([0.5]), np.array([0.0, 0.5]), np.array([0.0, 0.0, 1.0]))
    classical = diffrax.ButcherTableau(
        c=np.array([0.5, 0.5, 1.0]), b_sol=np.array([1, 2, 2, 1]) / 6, b_error=np.zeros(4), a_lower=rows
    )

    class RungeKutta4(diffrax.AbstractERK):
        """The classical one."""

        tableau: ClassVar = classical
        interpolation_cls: ClassVar = diffrax.ThirdOrderHermitePolynomialInterpolation.from_k

        def order(self, terms):
            """It is 4."""
            return 4

    return RungeKutta4()


def by_diffrax(rates, h, steps, state, own):
    """Steps of constant length; only the last state is kept."""
    jax, diffrax = modules()
    term = diffrax.ODETerm(lambda t, s, p: jax.numpy.stack(rates(t, s, p)))
    out = diffrax.diffeqsolve(
        term,
        solver(),
        t0=0.0,
        t1=steps * h,
        dt0=None,
        y0=state,
        args=own,
        stepsize_controller=diffrax.StepTo(h * np.arange(steps + 1)),
        saveat=diffrax.SaveAt(t1=True),
        adjoint=diffrax.ForwardMode(),
        max_steps=steps + 1,
    )
    return out.ys[0]


def ready(way, most: int | None, work: Workload, quick: bool) -> Ready:
    """Compiled for arrays of one size; the last one is filled up."""
    jax, _ = modules()
    at_once = min(most or work.members, work.members)
    filled = np.arange(-(-work.members // at_once) * at_once) % work.members
    state, own = (each[:, filled] for each in stacked(work.data, work.equation))
    rates = work.equation.function(jax.numpy)
    run = jax.jit(functools.partial(way, rates, work.dt, work.steps))
    start = time.perf_counter()
    run(state[:, :at_once], own[:, :at_once]).block_until_ready()
    seconds = time.perf_counter() - start

    def call():
        ends = [run(state[:, k : k + at_once], own[:, k : k + at_once]) for k in range(0, len(filled), at_once)]
        return work.blocks(np.concatenate(ends, axis=1)[:, : work.members])

    return Ready(call, f"{at_once:,} members at once; compiled and run first in {seconds:.1f} s")


KINDS = [f"own_{name}" for name in NAMED]
CONTESTANTS = [
    Contestant(name, dict.fromkeys(KINDS, functools.partial(ready, way, most)), slow="steps")
    for name, way, most in (
        ("diffrax", by_diffrax, MEMBERS),
        ("diffrax, all at once", by_diffrax, None),
        ("JAX, fori_loop", by_loop, MEMBERS),
    )
]
