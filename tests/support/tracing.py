"""What tests of tracing share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.base.immutable import changed
from stepwell.reference import adaptive

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


def a_pace(groups: int) -> adaptive.Pace:
    """Of members that go on, that wait for a hard one, and that pass what they must not cross."""
    row: Callable[..., Any] = lambda *values: np.array(values)  # noqa: E731
    return adaptive.Pace(
        t=row(T, T, T), h=row(0.3, 1e-3, 0.3), target=row(T + 0.1, 2.0, T), extra=np.zeros(MEMBERS), held=np.zeros(MEMBERS),
        relative=row(1e-3, 1e-2, 1e-3), absolute=row(0.0, 1e-2, 0.0), lasts=row(1.0, 0.0, 1.0), begin=row(T - 2.0, T, T - 1.0),
        interval=row(np.inf, 1e-3, 0.1), until=row(-np.inf, T + 1.0, T + 1.0), most_step=row(np.inf, 1.0, 0.05),
        wall=row(np.inf, 1.9, T + 0.02), before=row(0.9, 0.6, 1.0), most=row(5.0, 1.0, 5.0), accepted=row(0.0, 3.0, 7.0),
        rejected=row(1.0, 0.0, 2.0), extra_steps=row(0.0, 2.0, 4.0), error=row(0.0, 2.0, 0.5), work=row(0.0, 0.3, -0.2),
        longest=np.array([row(0.7, 0.2, 0.0), row(0.4, 0.3, 0.0)][-groups:]),
        noise=np.array([row(0.0, 1e-3, 1.0), row(1e-9, 0.0, 0.0)][-groups:]),
        failed=np.array([row(1e-9, 1.0, 0.0), row(0.0, 1e-3, 1e-6)][-groups:]),
    )  # fmt: skip
