"""What tests of tracing share."""

from __future__ import annotations

from typing import Any

import numpy as np
import stepwell as sw
from stepwell.base.immutable import changed

from support.cases import SYSTEMS

METHODS = sw.methods()


ABLE = [m for m in METHODS if m.error_order is not None]


MEMBERS, T, H = 3, 0.37, 0.1


CONTROLS: dict[str, Any] = {
    "limited": sw.EnergyControl(0.7, target=-0.3),
    "printed": sw.EnergyControl(0.3, "printed", target=-0.3),
    "scaling": sw.Projection("scaling", target=-0.3),
    "nacozy": sw.Projection("nacozy", target=-0.3),
}


def made(name: str) -> tuple[sw.System, Any, Any]:
    """A system of some members, and a state."""
    rng = np.random.default_rng(7)
    system = SYSTEMS[name](rng, MEMBERS)
    v, y = (0.5 * rng.normal(size=(*shape, MEMBERS)) for shape in (system.v_shape, system.y_shape))
    system = changed(system, batch=(MEMBERS,))
    return system, v, y


def assert_computes(computed: list[Any], *expected: Any) -> None:
    """To the bit, NaN but for its payload."""
    wanted = [row for each in expected for row in np.broadcast_to(each, np.shape(each) or MEMBERS).reshape(-1, MEMBERS)]
    assert len(computed) == len(wanted)
    for ours, theirs in zip(computed, wanted, strict=True):
        np.testing.assert_array_equal(ours, theirs)
        np.testing.assert_array_equal(np.signbit(ours), np.signbit(theirs))
