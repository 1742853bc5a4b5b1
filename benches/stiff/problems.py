"""The problems: equations that all contestants read alike, and members that differ by their parameters."""

from __future__ import annotations

import functools
import inspect
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import stepwell as sw

Array = np.ndarray[Any, Any]

#: Parameters of members differ from the published ones by up to this share.
SPREAD = 0.03
#: Members whose errors are known, the first of a batch; and the tolerance of their true motions.
SAMPLED, TRUTH = 32, 1e-12


@dataclass(frozen=True)
class Problem:
    """A stiff problem.

    Attributes:
        name: in a table.
        rates: of t, y and the parameters by their names, which have the published values.
        start: y at t = 0.
        end: the time of its end.
        sizes: below which the error of a component is absolute, and counts relative to this.
    """

    name: str
    rates: Callable[..., Any]
    start: tuple[float, ...]
    end: float
    sizes: tuple[float, ...]

    @property
    def published(self) -> dict[str, float]:
        """The parameters."""
        every = inspect.signature(self.rates).parameters
        return {name: each.default for name, each in every.items() if each.default is not each.empty}

    @functools.cached_property
    def system(self) -> Any:
        """For stepwell."""
        return sw.system(order=1)(self.rates)

    def parameters(self, members: int) -> Array:
        """Of a batch, shape (parameters, members); more members begin with the same. One member has the published ones."""
        values = np.array(list(self.published.values()))[:, np.newaxis]
        if members == 1:
            return values
        rng = np.random.default_rng(zlib.crc32(self.name.encode()))
        return values * (1.0 + SPREAD * rng.uniform(-1.0, 1.0, (members, len(values))).T)

    @functools.cached_property
    def truth(self) -> Array:
        """The ends of the sampled members."""
        system = self.system(**dict(zip(self.published, self.parameters(SAMPLED), strict=True)))
        y = np.repeat(np.array(self.start)[:, np.newaxis], SAMPLED, axis=1)
        tolerance = TRUTH, TRUTH * np.array(self.sizes)[:, np.newaxis]
        return np.asarray(sw.integrate(system, "rodas5p", y=y, tolerance=tolerance, at=[self.end]).y[-1])

    def error(self, ends: Array) -> float:
        """Of members from the first on: the root mean square of the relative error of each one's worst component."""
        truth = self.truth[:, : ends.shape[1]]
        off = abs(ends[:, :SAMPLED] - truth) / (abs(truth) + np.array(self.sizes)[:, np.newaxis])
        error = float(np.sqrt(np.mean(off.max(axis=0) ** 2)))
        return error if np.isfinite(error) else float("inf")


def rober(t, y, k1=0.04, k2=3e7, k3=1e4):
    slow, fast = k1 * y[0] - k3 * y[1] * y[2], k2 * y[1] * y[1]
    return -slow, slow - fast, fast


def orego(t, y, s=77.27, q=8.375e-6, w=0.161):
    return s * (y[1] + y[0] * (1.0 - q * y[0] - y[1])), (y[2] - (1.0 + y[0]) * y[1]) / s, w * (y[0] - y[2])


def hires(t, y, binding=280.0, inflow=0.0007, release=1.81):
    bound = binding * y[5] * y[7]
    seventh = bound - release * y[6]
    return (
        -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + inflow,
        1.71 * y[0] - 8.75 * y[1],
        -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
        8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
        -1.745 * y[4] + 0.43 * (y[5] + y[6]),
        -bound + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
        seventh,
        -seventh,
    )


def van_der_pol(t, y, mu=1000.0):
    return y[1], mu * (1.0 - y[0] * y[0]) * y[1] - y[0]


PROBLEMS = [
    Problem("ROBER", rober, (1.0, 0.0, 0.0), 1e4, (1e-2, 1e-7, 1e-2)),
    Problem("OREGO", orego, (1.0, 2.0, 3.0), 360.0, (1e-2, 1e-2, 1e-2)),
    Problem("HIRES", hires, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057), 321.8122, (1e-5,) * 8),
    Problem("Van der Pol", van_der_pol, (2.0, 0.0), 2000.0, (1e-2, 1e-5)),
]
