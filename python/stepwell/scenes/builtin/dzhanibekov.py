"""A free body that spins about its middle axis, and turns over."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.checks import numbers
from ...errors import ArgumentError
from ...model.systems import RigidBody
from ..base import Scene
from ..free_top import FreeTop
from ..ranges import within


def dzhanibekov(inertia: Any = (1.0, 2.0, 3.0), tilt: Any = 0.01, spin: Any = 1.0) -> Scene:
    """A free body spins about the axis of its middle moment of inertia, and turns over again and again; two of its periods.

    Spin about that axis is unstable, however small the ``tilt``: it grows by e in 1/σ, σ = ω·√((J₂ − J₁)(J₃ − J₂)/(J₁J₃)), until
    the body turns over, twice in a period. Spin about the other two axes is stable. Named after the cosmonaut who saw it on a
    wing nut (1985). ω is known by Jacobi's functions, and so is the attitude.

    Args:
        inertia: three principal moments that ascend, the largest not above the sum of the others.
        tilt: ω₁ and ω₃ at the start, as fractions of the spin, 1e-6 to 1.
        spin: ω₂ at the start, in rad per unit of time, 1e-6 to 1e6.
    """
    moments = numbers("inertia", inertia, positive=True)
    if moments.shape != (3,) or not moments[0] < moments[1] < moments[2]:
        raise ArgumentError("inertia: expected three moments that ascend, for one of them is the middle one")
    tilt = within("tilt", tilt, 1e-6, 1.0)
    spin = within("spin", spin, 1e-6, 1e6, "rad per unit of time")
    body = RigidBody(moments)
    v, q = spin * np.array([tilt, 1.0, tilt]), np.array([1.0, 0.0, 0.0, 0.0])
    try:
        exact = FreeTop(tuple(moments.tolist()), tuple(v.tolist()), tuple(q.tolist()))
    except ValueError:
        raise ArgumentError(
            "inertia: expected other moments: with these, a body tilted alike about both other axes turns over only once"
        ) from None
    return Scene(
        name="dzhanibekov",
        title="Dzhanibekov's wing nut",
        section="§12",
        description="A free body spins about its middle axis, which is unstable, and turns over again and again.",
        error="as far from the true angular velocity, or from the true quaternion, as the largest true one is long",
        system=body,
        v=v,
        y=q,
        dt=0.4 / spin,
        horizon=2.0 * exact.period,
        exact=exact,
    )
