"""A stability map beside NumPy's own eigenvalues, in one run: ``python -m benches.maps``.

The peer is given P in closed form, as Runge-Kutta 4 makes it from the damped oscillator's matrix, and only has to find the
largest eigenvalue of each; stepwell finds P by stepping as well. The error is the largest difference of the radii.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import stepwell as sw

SIZE, REPEATS = 512, 5


def numpy_radius(phi: Any, damping: Any) -> Any:
    """The largest eigenvalue of 1 + A + A²/2 + A³/6 + A⁴/24 for A = [[−2DΦ, −Φ], [Φ, 0]] at every point."""
    d, f = np.meshgrid(damping, phi, indexing="ij")
    a = np.stack([np.stack([-2.0 * d * f, -f], axis=-1), np.stack([f, np.zeros_like(f)], axis=-1)], axis=-2)
    square = a @ a
    p = np.eye(2) + a + square / 2.0 + a @ square / 6.0 + square @ square / 24.0
    return np.abs(np.linalg.eigvals(p)).max(axis=-1)


def seconds(work: Callable[[], object]) -> float:
    """How long it takes once."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


if __name__ == "__main__":
    drawn = sw.charts.stability_map("rk4", size=SIZE)
    error = np.abs(numpy_radius(drawn.phi, drawn.damping) - drawn.radius).max()
    ours, theirs = [], []
    for _ in range(REPEATS):  # in turns, so that whatever else the machine does meets both
        ours.append(seconds(lambda: sw.charts.stability_map("rk4", size=SIZE)))
        theirs.append(seconds(lambda: numpy_radius(drawn.phi, drawn.damping)))
    a, b = statistics.median(ours), statistics.median(theirs)
    print(f"map of {SIZE} × {SIZE} points, Runge-Kutta 4: stepwell {a:.3f} s, NumPy {b:.3f} s, ratio {b / a:.2f}")
    print(
        f"spread {min(ours):.3f} … {max(ours):.3f} s and {min(theirs):.3f} … {max(theirs):.3f} s; largest difference {error:.1e}"
    )
