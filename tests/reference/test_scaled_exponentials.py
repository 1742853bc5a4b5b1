"""Where an instruction multiplies by a power of two: the bits of exponential functions at all their edges, on every level."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.ways import assert_equal_ways

#: Where e^x and its kind end, and where two factors take turns.
EDGES = [0.0, 709.78, 709.79, 710.0, 800.0, 1e300, 708.4, 708.3, 745.1, 745.2, 746.0, 744.4, 1022.0, 1024.0, 1074.0, 1075.0, 0.25]


def states() -> np.ndarray:
    rng = np.random.default_rng(6)
    near = np.concatenate([[each, np.nextafter(each, 9e99), np.nextafter(each, -9e99)] for each in EDGES])
    halves = (np.arange(-1080, 1030) + 0.5) * np.log(2.0)  # where n changes
    some = [rng.uniform(-760.0, 720.0, 500), rng.uniform(-1.0, 1.0, 200), halves, np.nextafter(halves, 0.0)]
    return np.concatenate([near, -near, *some])


FUNCTIONS: dict[str, Any] = {
    "exp": lambda y: np.exp(y),
    "expm1": lambda y: np.expm1(y),
    "exp2": lambda y: np.exp2(y),
    "both": lambda y: np.exp(y) * np.expm1(-y),
    "one of two": lambda y: np.where(y < 0.0, np.exp(y), -np.exp(y)),
    # Fused, the last product and the sum are one operation.
    "one more": lambda y: 1.0 + np.exp(y),
    "one less": lambda y: 1.0 - np.exp(y),
    "less one": lambda y: np.exp(y) - 1.0,
    "logistic": lambda y: 1.0 / (1.0 + np.exp(-y)),
    "next to what is subnormal": lambda y: np.exp(y) + 1e-320,
    "far from it": lambda y: 1e-270 - np.exp(y),
    "next to what is infinite": lambda y: np.exp(y) - 1.7e308,
    "beside zero": lambda y: np.exp(y) + 0.0 * y,
    "power": lambda y: 1.5**y,
    "tanh": lambda y: np.tanh(y) + np.exp(-y),
}


def pushed_by(function: Any) -> sw.System:
    return sw.system(lambda t, v, y: function(y))()


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
@pytest.mark.parametrize("fused", [False, True])
def test_all_levels_agree(fused: bool) -> None:
    y = states()
    for name, function in FUNCTIONS.items():
        own = pushed_by(function)
        ways = ("by the reference", "at each level")
        for at in (y, np.array([-720.0])):
            try:
                assert_equal_ways(own, "standard_euler", ways=ways, v=np.zeros(at.shape), y=at, dt=1.0, steps=1, fused=fused)
            except AssertionError as error:
                error.add_note(name)
                raise
