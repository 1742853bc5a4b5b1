"""How much a step multiplies disturbances: for the finding that states grew by their steps alone."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ..base.arrays import Array, Shape, Whole
from ..model.methods import Method
from ..model.systems import System
from .stability import eigen, limit, maps
from .stability.some_members import Batch

#: The advice also says the stability limit if a state has no more numbers than this.
SMALL_SYSTEM = 8


class Factors:
    """The factors by which a step, and the motion itself, multiply disturbances of the start, for some members of a batch."""

    def __init__(self, system: System, method: Method, dt: Any, t: Any, start: tuple[Array, Array], batch: Shape) -> None:
        self._system, self._method, self._dt = system.without_inputs() if system.linear else system, method, dt
        self._each = None if np.ndim(dt) == 0 else np.broadcast_to(dt, batch).reshape(-1)
        v, y = (None, None) if system.linear else start
        self._batch = Batch(self._system, method, v, y, batch)
        self._t = np.broadcast_to(t, batch).reshape(-1) if np.ndim(t) else t

    def _own(self, members: Whole) -> tuple[System, Any, Array | None, Array | None]:
        """The system of some members, their time, and their start if the eigenvalues depend on it."""
        own, v, y = self._batch.of(members)
        return own, self._t if np.ndim(self._t) == 0 else self._t[members], v, y

    def radius(self, members: Whole) -> Array:
        """For each member the spectral radius of a step."""
        (own, t, v, y), dt = self._own(members), np.asarray(self._dt if self._each is None else self._each[members])
        step = maps.transition(own, self._method, dt) if v is None or y is None else maps.jacobian(own, self._method, dt, t, v, y)
        return np.broadcast_to(np.abs(eigen.eigenvalues(step)).max(axis=0), members.shape)

    def rate(self, members: Whole) -> Array:
        """For each member the largest growth exponent of its rates over a step."""
        (own, t, v, y), dt = self._own(members), self._dt if self._each is None else self._each[members]
        exponents = eigen.eigenvalues(maps.rates(own, t, v, y)).real
        return np.broadcast_to((dt * exponents).max(axis=0) if self._each is None else dt * exponents.max(axis=0), members.shape)

    def advice(self, member: int, dt: float) -> str:
        """The advice for a member, with its stability limit where that is quickly computed."""
        if sum(maps.size(self._system)) > SMALL_SYSTEM:
            return "use a shorter step; stability_limit says how short"
        if dt < 0.0 or self._method.is_implicit:  # whose growth is not that of a linear system
            return "use a shorter step"
        own, t, v, y = self._own(np.array([member]))
        kept = v is None and not self._system.batch
        stable = _limit_of_linear(self._system, self._method) if kept else _limit(own, self._method, v, y, t)
        if stable == 0.0:
            return f"{self._method.name} is stable with no step here: take rk4 with a short one, or implicit_midpoint"
        return f"its stability limit is {stable:.6g}" if stable < dt else "use a shorter step"


def _limit(system: System, method: Method, v: Array | None, y: Array | None, t: Any) -> float:
    return float(np.max(limit.limit_of(system, method, v, y, t).stable))


@lru_cache(maxsize=64)
def _limit_of_linear(system: System, method: Method) -> float:
    """Kept, since it takes longer to find than most runs, and often one system runs with one step after another."""
    return _limit(system, method, None, None, 0.0)
