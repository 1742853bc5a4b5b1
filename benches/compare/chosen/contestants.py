"""The contestants. Each makes of orbits a function from a tolerance to y at the end, shape (2, members)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.scenes.builtin.arenstorf import MU

from ..workloads import Array
from .orbits import Orbits

Solve = Callable[[float], Array]


@dataclass(frozen=True)
class Contestant:
    """A program. It may be timed on ``some`` of the orbits, if it takes one after the other. ``missing``: why it is not timed."""

    name: str
    make: Callable[[Orbits], Solve]
    some: int | None = None
    missing: str = ""


def contestants() -> Iterator[Contestant]:
    """All, those that are not installed too."""
    for method in sw.methods():
        if method.error_order is not None:
            yield Contestant(f"stepwell {method.name}", lambda orbits, name=method.name: ours(orbits, name))
    yield Contestant("stepwell taylor, own equations", our_equations)
    yield Contestant("stepwell taylor, own equations, fused", lambda orbits: our_equations(orbits, fused=True))
    for name, maker in {"numba": numbas, "heyoka": heyokas, "SciPy": scipys}.items():
        try:
            yield from maker()
        except ImportError:
            yield Contestant(name, our_equations, missing=f"{name} is not installed")


def ours(orbits: Orbits, method: str) -> Solve:
    """stepwell on one thread, from arguments to results."""
    v, y, system = orbits.v, orbits.y, sw.RestrictedThreeBody(MU)
    if orbits.kind == "kepler":  # a body without mass round one that rests
        v, y = (np.stack([np.zeros_like(block), block]) for block in (v, y))
        system = sw.NBody([1.0, 0.0], force="newton")  # type: ignore[assignment]

    def solve(tolerance: float) -> Array:
        end = sw.integrate(system, method, v=v, y=y, tolerance=tolerance, at=[orbits.end], threads=1).y[-1]
        return np.asarray(end[1] if orbits.kind == "kepler" else end)

    return solve


def our_equations(orbits: Orbits, fused: bool = False) -> Solve:
    """The equations that heyoka gets: one body that moves, where ``NBody`` moves both.

    The system is made once, as heyoka's integrator is: a function that is given in place of it is traced in every call.
    """

    @sw.system
    def kepler(t: Any, v: Any, y: Any) -> Any:
        r2 = y[0] * y[0] + y[1] * y[1]
        f = -1.0 / (r2 * np.sqrt(r2))
        return np.array([f * y[0], f * y[1]])

    @sw.system
    def arenstorf(t: Any, v: Any, y: Any) -> Any:
        from_heavy, from_light = y[0] + MU, y[0] - (1.0 - MU)
        square = from_heavy * from_heavy + y[1] * y[1]
        heavy = (1.0 - MU) / (square * np.sqrt(square))
        square = from_light * from_light + y[1] * y[1]
        light = MU / (square * np.sqrt(square))
        return np.array(
            [
                y[0] + 2.0 * v[1] - heavy * from_heavy - light * from_light,
                y[1] - 2.0 * v[0] - heavy * y[1] - light * y[1],
            ]
        )

    system = {"kepler": kepler, "arenstorf": arenstorf}[orbits.kind]()
    v, y = (block[:, 0] if orbits.members == 1 else block for block in (orbits.v, orbits.y))

    def solve(tolerance: float) -> Array:
        run = sw.integrate(system, "taylor", v=v, y=y, tolerance=tolerance, at=[orbits.end], threads=1, fused=fused)
        return np.asarray(run.y[-1].reshape(2, -1))

    return solve


def scipys() -> Iterator[Contestant]:
    """SciPy, one orbit after the other, rates in pure Python, which is faster than NumPy for so few numbers."""
    from scipy.integrate import solve_ivp

    def kepler(t: float, s: Any) -> Any:
        x, y, u, v = s.tolist()
        f = -1.0 / (x * x + y * y) ** 1.5
        return [u, v, f * x, f * y]

    def arenstorf(t: float, s: Any) -> Any:
        x, y, u, v = s.tolist()
        heavy, light = (1.0 - MU) / ((x + MU) ** 2 + y * y) ** 1.5, MU / ((x - 1.0 + MU) ** 2 + y * y) ** 1.5
        return [u, v, x + 2.0 * v - heavy * (x + MU) - light * (x - 1.0 + MU), y - 2.0 * u - heavy * y - light * y]

    def made(orbits: Orbits, method: str) -> Solve:
        rates = {"kepler": kepler, "arenstorf": arenstorf}[orbits.kind]

        def solve(tolerance: float) -> Array:
            starts = np.concatenate([orbits.y, orbits.v]).T
            ends = [solve_ivp(rates, (0.0, orbits.end), s, method, rtol=tolerance, atol=tolerance).y[:2, -1] for s in starts]
            return np.stack(ends, axis=-1)

        return solve

    for method in ("RK45", "DOP853"):
        yield Contestant(f"SciPy {method}", lambda orbits, method=method: made(orbits, method), some=5)


def heyokas() -> Iterator[Contestant]:
    """heyoka's Taylor series: one orbit, or as many as a vector holds. What it compiles for each tolerance is not timed."""
    import heyoka as hy

    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    f = -((x * x + y * y) ** -1.5)
    heavy, light = (1.0 - MU) * ((x + MU) ** 2 + y * y) ** -1.5, MU * ((x - 1.0 + MU) ** 2 + y * y) ** -1.5
    equations = {
        "kepler": [(x, u), (y, v), (u, f * x), (v, f * y)],
        "arenstorf": [
            (x, u),
            (y, v),
            (u, x + 2.0 * v - heavy * (x + MU) - light * (x - 1.0 + MU)),
            (v, y - 2.0 * u - heavy * y - light * y),
        ],
    }
    made: dict[tuple[str, float, int], Any] = {}

    def integrator(kind: str, tolerance: float, lanes: int) -> Any:
        key = kind, tolerance, lanes
        if key not in made:
            start = np.ones(4) if lanes == 1 else np.ones((4, lanes))
            maker = hy.taylor_adaptive if lanes == 1 else hy.taylor_adaptive_batch
            made[key] = maker(equations[kind], start, tol=tolerance)
        return made[key]

    def alone(orbits: Orbits) -> Solve:
        def solve(tolerance: float) -> Array:
            one, starts, ends = integrator(orbits.kind, tolerance, 1), np.concatenate([orbits.y, orbits.v]).T, []
            for start in starts:
                one.time = 0.0
                one.state[:] = start
                one.propagate_until(orbits.end)
                ends.append(one.state[:2].copy())
            return np.stack(ends, axis=-1)

        return solve

    def together(orbits: Orbits) -> Solve:
        lanes = hy.recommended_simd_size()
        starts = np.concatenate([orbits.y, orbits.v])
        starts = starts[:, np.arange(-(-orbits.members // lanes) * lanes) % orbits.members]

        def solve(tolerance: float) -> Array:
            several, ends = integrator(orbits.kind, tolerance, lanes), np.empty((2, starts.shape[1]))
            for first in range(0, starts.shape[1], lanes):
                several.set_time(0.0)
                several.state[:] = starts[:, first : first + lanes]
                several.propagate_until(np.full(lanes, orbits.end))
                ends[:, first : first + lanes] = several.state[:2]
            return ends[:, : orbits.members]

        return solve

    yield Contestant("heyoka", lambda orbits: (alone if orbits.members == 1 else together)(orbits))


def numbas() -> Iterator[Contestant]:
    """DOPRI5 with the step control of its authors' program, compiled by numba in its best configuration."""
    import numba

    @numba.njit(fastmath=True, error_model="numpy", inline="always")
    def kepler(x: float, y: float, u: float, v: float) -> Any:
        r2 = x * x + y * y
        f = -1.0 / (r2 * math.sqrt(r2))
        return f * x, f * y

    @numba.njit(fastmath=True, error_model="numpy", inline="always")
    def arenstorf(x: float, y: float, u: float, v: float) -> Any:
        from_heavy, from_light = x + MU, x - 1.0 + MU
        square = from_heavy * from_heavy + y * y
        heavy = (1.0 - MU) / (square * math.sqrt(square))
        square = from_light * from_light + y * y
        light = MU / (square * math.sqrt(square))
        return x + 2.0 * v - heavy * from_heavy - light * from_light, y - 2.0 * u - heavy * y - light * y

    kernels = {"kepler": dopri5(numba, kepler), "arenstorf": dopri5(numba, arenstorf)}

    def made(orbits: Orbits) -> Solve:
        def solve(tolerance: float) -> Array:
            ends = np.empty_like(orbits.y)
            kernels[orbits.kind](np.concatenate([orbits.y, orbits.v]), orbits.end, tolerance, ends)
            return ends

        return solve

    yield Contestant("numba DOPRI5", made)


def dopri5(numba: Any, acceleration: Any) -> Any:
    """The method for this acceleration of (x, y, u, v)."""

    @numba.njit(fastmath=True, error_model="numpy")
    def run(starts: Any, end: float, tolerance: float, ends: Any) -> None:
        for m in range(starts.shape[1]):
            x, y, u, v = starts[0, m], starts[1, m], starts[2, m], starts[3, m]
            t, h, before, rejected = 0.0, 1e-4, 1e-4, False
            a1, b1 = acceleration(x, y, u, v)
            while t < end:
                h = min(h, end - t)
                u2, v2 = u + h * a1 / 5, v + h * b1 / 5
                a2, b2 = acceleration(x + h * u / 5, y + h * v / 5, u2, v2)
                u3, v3 = u + h * (3 / 40 * a1 + 9 / 40 * a2), v + h * (3 / 40 * b1 + 9 / 40 * b2)
                a3, b3 = acceleration(x + h * (3 / 40 * u + 9 / 40 * u2), y + h * (3 / 40 * v + 9 / 40 * v2), u3, v3)
                p, q, r = 44 / 45, -56 / 15, 32 / 9
                u4, v4 = u + h * (p * a1 + q * a2 + r * a3), v + h * (p * b1 + q * b2 + r * b3)
                a4, b4 = acceleration(x + h * (p * u + q * u2 + r * u3), y + h * (p * v + q * v2 + r * v3), u4, v4)
                p, q, r, s = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
                u5, v5 = u + h * (p * a1 + q * a2 + r * a3 + s * a4), v + h * (p * b1 + q * b2 + r * b3 + s * b4)
                x5, y5 = x + h * (p * u + q * u2 + r * u3 + s * u4), y + h * (p * v + q * v2 + r * v3 + s * v4)
                a5, b5 = acceleration(x5, y5, u5, v5)
                p, q, r, s, w = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
                u6 = u + h * (p * a1 + q * a2 + r * a3 + s * a4 + w * a5)
                v6 = v + h * (p * b1 + q * b2 + r * b3 + s * b4 + w * b5)
                x6 = x + h * (p * u + q * u2 + r * u3 + s * u4 + w * u5)
                y6 = y + h * (p * v + q * v2 + r * v3 + s * v4 + w * v5)
                a6, b6 = acceleration(x6, y6, u6, v6)
                p, q, r, s, w = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
                un = u + h * (p * a1 + q * a3 + r * a4 + s * a5 + w * a6)
                vn = v + h * (p * b1 + q * b3 + r * b4 + s * b5 + w * b6)
                xn = x + h * (p * u + q * u3 + r * u4 + s * u5 + w * u6)
                yn = y + h * (p * v + q * v3 + r * v4 + s * v5 + w * v6)
                a7, b7 = acceleration(xn, yn, un, vn)
                p, q, r, s, w, z = 71 / 57600, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40
                eu = h * (p * a1 + q * a3 + r * a4 + s * a5 + w * a6 + z * a7) / (tolerance * (1 + max(abs(u), abs(un))))
                ev = h * (p * b1 + q * b3 + r * b4 + s * b5 + w * b6 + z * b7) / (tolerance * (1 + max(abs(v), abs(vn))))
                ex = h * (p * u + q * u3 + r * u4 + s * u5 + w * u6 + z * un) / (tolerance * (1 + max(abs(x), abs(xn))))
                ey = h * (p * v + q * v3 + r * v4 + s * v5 + w * v6 + z * vn) / (tolerance * (1 + max(abs(y), abs(yn))))
                error = math.sqrt((eu * eu + ev * ev + ex * ex + ey * ey) / 4)
                factor = error**0.17
                if error <= 1.0:
                    grow = max(0.1, min(5.0, factor / before**0.04 / 0.9))
                    before = max(error, 1e-4)
                    t += h
                    x, y, u, v, a1, b1 = xn, yn, un, vn, a7, b7
                    new = h / grow
                    h, rejected = (min(h, new) if rejected else new), False
                else:
                    h, rejected = h / min(5.0, factor / 0.9), True
            ends[0, m], ends[1, m] = x, y

    return run
