"""stepwell, called as a user calls it: from arrays to arrays, checks included."""

from __future__ import annotations

import functools

import numpy as np
import stepwell as sw

from ..own.equations import EQUATIONS, Equation, pendulum
from ..workloads import SINGLE_KIND, w2_pendulums
from . import Contestant, Ready, Workload, threads


def free(data) -> sw.System:
    """Undamped oscillators."""
    return sw.Oscillator(omega=data["omega"])


def forced(data) -> sw.System:
    """Damped oscillators with a sinusoidal acceleration."""
    push = sw.Sinusoid(data["amplitude"], data["frequency"], data["phase"])
    return sw.Oscillator(omega=data["omega"], damping=data["damping"], a=push)


def pendulums(data) -> sw.System:
    """Damped pendulums under one drive."""
    drive = sw.Sinusoid(data["amplitude"], w2_pendulums.FREQUENCY)
    return sw.Pendulum(1.0, w2_pendulums.DAMPING, a=drive)


def bodies(data) -> sw.System:
    """Bodies under Newton's law."""
    return sw.NBody(data["masses"], force="newton", softening=data["softening"])


def cloth(data) -> sw.System:
    """Particles and springs; what has no 1/m is fixed."""
    by_mass = data["by_mass"]
    masses, fixed = 1.0 / np.where(by_mass > 0.0, by_mass, 1.0), np.flatnonzero(by_mass == 0.0)
    given = {name: data[name] for name in ("stiffness", "rest", "gravity")}
    return sw.Springs(data["pairs"].astype(int), masses=masses, fixed=fixed, **given)


def own(equation: Equation, data) -> sw.System:
    """Own equations with the members' parameters."""
    return equation.system(**{name: data[name] for name in equation.own})


def brief(data) -> sw.System:
    """Own pendulums with a short sine, as the blocks of numba have one."""
    return sw.system(quick_sines=True)(pendulum.function)(omega=data["omega"])


def built_in(data) -> sw.System:
    """The same pendulums, as stepwell has them."""
    return sw.Pendulum(data["omega"])


SYSTEMS = {
    "free_false_euler": (free, "false_euler"),
    "forced_standard_heun": (forced, "standard_heun"),
    "pendulums_standard_heun": (pendulums, "standard_heun"),
    "pendulums_rk4": (pendulums, "rk4"),
    "bodies_false_euler": (bodies, "false_euler"),
    "bodies_leapfrog": (bodies, "leapfrog"),
    "cluster_leapfrog": (bodies, "leapfrog"),
    "shared_cluster_leapfrog": (bodies, "leapfrog"),
    "cloth_leapfrog": (cloth, "leapfrog"),
    **{f"own_{each.name}": (functools.partial(own, each), "rk4") for each in EQUATIONS},
}
SYSTEMS |= {SINGLE_KIND + kind: SYSTEMS[kind] for kind in ("free_false_euler", "pendulums_standard_heun", "pendulums_rk4")}
OWN = tuple(kind for kind in SYSTEMS if kind.startswith("own_"))


def made(system, method: str, how, work: Workload, quick: bool) -> Ready:
    """A workload by ``stepwell.integrate`` with these further arguments."""
    data = work.data
    if work.members == 1 and data["v"].ndim > 1:  # one system has no axis of members
        data = {name: row[..., 0] for name, row in data.items()}

    if work.kind.startswith(SINGLE_KIND):
        how = how | {"dtype": "float32"}
        data = {name: row.astype(np.float32) for name, row in data.items()}

    start = {name: data[name] for name in ("v", "y") if data[name].size}  # a system of the first order has no v

    def call():
        run = sw.integrate(system(data), method, **start, dt=work.dt, steps=work.steps, **how)
        return run.v[-1], run.y[-1]

    # Leapfrog goes half a kick back before the first step, and half a kick forward after the last.
    return Ready(call, more=2 if method == "leapfrog" else 0)


def kernels(*without: str, **how):
    """What makes each kind of workload ready, but these, with these further arguments."""
    return {kind: functools.partial(made, *what, how) for kind, what in SYSTEMS.items() if kind not in without}


as_many_as_pay = kernels("cluster_leapfrog", "cloth_leapfrog", *OWN, threads=None)
#: Nets are no single tape, and so are not fused.
fused = kernels("shared_cluster_leapfrog", "cloth_leapfrog", threads=1, fused=True)
all_of_them = {"shared_cluster_leapfrog": kernels(threads=threads())["shared_cluster_leapfrog"]}
CONTESTANTS = [
    Contestant("stepwell, 1 thread", kernels(threads=1)),
    Contestant("stepwell, fused, 1 thread", fused),
    Contestant(
        "stepwell, fused, quick sines, 1 thread",
        {"own_pendulum": functools.partial(made, brief, "rk4", {"threads": 1, "fused": True})},
    ),
    Contestant("built-in pendulum", {"own_pendulum": functools.partial(made, built_in, "rk4", {"threads": 1})}, alike=False),
    Contestant(f"stepwell, up to {threads()} threads", as_many_as_pay | all_of_them),
]
