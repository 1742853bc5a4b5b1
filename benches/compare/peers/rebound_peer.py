"""REBOUND with its leapfrog, whose form is drift, kick, drift: its errors are not those of kick, drift, kick, but from half to
twice as large. It works in space only, on one thread, with one simulation for each member.

The simulations are made before the timing: a call sets their states, steps, and reads them. That favours REBOUND.
"""

from __future__ import annotations

import numpy as np

from . import Contestant, MissingPeerError, Ready, Workload


def simulation(work: Workload, k: int):
    """Member k, still without its state."""
    import rebound

    sim = rebound.Simulation()
    sim.G, sim.integrator, sim.dt, sim.softening = 1.0, "leapfrog", work.dt, float(work.data["softening"][k])
    for mass in work.data["masses"][:, k].tolist():
        sim.add(m=mass)
    return sim


def leapfrog(work: Workload, quick: bool) -> Ready:
    """Exactly so many steps; the last one is not shortened."""
    try:
        import rebound  # noqa: F401
    except ImportError:
        raise MissingPeerError("REBOUND is not installed") from None
    sims = [simulation(work, k) for k in range(work.members)]
    wide = ((0, 0), (0, 0), (0, 3 - work.dim))
    v_in, y_in = (np.ascontiguousarray(np.pad(np.moveaxis(work.data[name], -1, 0), wide)) for name in ("v", "y"))

    def call():
        v, y = np.empty_like(v_in), np.empty_like(y_in)
        for k, sim in enumerate(sims):
            sim.set_serialized_particle_data(xyz=y_in[k], vxvyvz=v_in[k])
            sim.steps(work.steps)
            sim.serialize_particle_data(xyz=y[k], vxvyvz=v[k])
        return tuple(np.moveaxis(each[..., : work.dim], 0, -1) for each in (v, y))

    return Ready(call, "drift-kick-drift" + ", in space" * (work.dim == 2))


CONTESTANTS = [
    Contestant("REBOUND", dict.fromkeys(("bodies_leapfrog", "cluster_leapfrog"), leapfrog), slow="members", alike=False)
]
