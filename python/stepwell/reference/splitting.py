"""A system in two parts: one whose motion is known, and the rest of its forces.

``drift`` is the motion of the first over a share of the step, ``kick`` the change of v by the second. A system has a splitting of
its own if it has ``central``, the forces of the first part; of any other one the first part is free flight.
"""

from typing import Any

from ..base.arrays import Array, Blocks


def kick(s: Any, t: float, v: Array, y: Array) -> Array:
    """h·v̇ without the forces of the part whose motion is known."""
    dv: Array = s.dv(t, v, y)
    central = _central(s, y)
    return dv if central is None else dv - central


def drift(s: Any, share: float, t: float, v: Array, y: Array) -> Blocks:
    """The state after a share of the step under the part whose motion is known."""
    if _central(s, y) is not None:
        moved: Blocks = s.drift(share, v, y)
        return moved
    dy = s.dy(t, v, y)
    return v, y + (dy if share == 1.0 else share * dy)


def _central(s: Any, y: Array) -> Array | None:
    """The acceleration by the part whose motion is known, times h; or None."""
    own = getattr(s, "central", None)
    return None if own is None else own(y)
