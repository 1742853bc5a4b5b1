"""``python -m benches.adaptive``: steps of chosen length beside numba's DOPRI5, SciPy and heyoka, at equal errors at the end.

Each contestant goes over the same orbit with tolerances from coarse to fine. What is compared is the time that it takes to be as
exact as asked, between the two tolerances that enclose that error, on logarithmic scales. A batch is 10 000 orbits with starts of
their own.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw

#: Errors at the end, relative to the length of the orbit's axis, at which contestants are compared.
ERRORS = (1e-3, 1e-6, 1e-9)
TOLERANCES = tuple(10.0 ** -np.arange(2.0, 13.5, 0.5))


class Contestant(NamedTuple):
    """``solve(tolerance)`` gives the end of y of every member, shape (2, members)."""

    name: str
    solve: Callable[[float], Any]


class Orbit(NamedTuple):
    """The members' starts, shape (2, members), and where and when they are again where they began."""

    v: Any
    y: Any
    end: float


def kepler(members: int, periods: int) -> Orbit:
    """Ellipses of e = 0.9 with axes turned by different angles: all equally hard, none equal to another."""
    turn = np.linspace(0.0, 2.0 * np.pi, members, endpoint=False)
    speed = math.sqrt(19.0)
    return Orbit(
        np.stack([-speed * np.sin(turn), speed * np.cos(turn)]),
        np.stack([0.1 * np.cos(turn), 0.1 * np.sin(turn)]),
        2.0 * np.pi * periods,
    )


def ours(orbit: Orbit, method: str) -> Contestant:
    """stepwell, on one thread."""
    system = sw.NBody([1.0, 0.0], force="newton")
    v, y = (np.stack([np.zeros_like(block), block]) for block in (orbit.v, orbit.y))

    def solve(tolerance: float) -> Any:
        return sw.integrate(system, method, v=v, y=y, tolerance=tolerance, at=[orbit.end], threads=1).y[-1, 1]

    return Contestant(f"stepwell {method}", solve)


def scipys(orbit: Orbit, method: str) -> Contestant | None:
    """SciPy, one orbit after the other."""
    try:
        from scipy.integrate import solve_ivp
    except ImportError:
        return None

    def rates(t: float, s: Any) -> Any:
        r3 = (s[0] * s[0] + s[1] * s[1]) ** 1.5
        return [s[2], s[3], -s[0] / r3, -s[1] / r3]

    def solve(tolerance: float) -> Any:
        start = np.concatenate([orbit.y, orbit.v])
        ends = [solve_ivp(rates, (0.0, orbit.end), s, method, rtol=tolerance, atol=tolerance).y[:2, -1] for s in start.T]
        return np.stack(ends, axis=-1)

    return Contestant(f"SciPy {method}", solve)


def heyokas(orbit: Orbit) -> Contestant | None:
    """heyoka's Taylor method; its tolerance is part of what is compiled, which is not counted."""
    try:
        import heyoka as hy
    except ImportError:
        return None
    x, y, vx, vy = hy.make_vars("x", "y", "vx", "vy")
    r3 = (x * x + y * y) ** -1.5
    equations = [(x, vx), (y, vy), (vx, -x * r3), (vy, -y * r3)]
    made: dict[float, Any] = {}

    def solve(tolerance: float) -> Any:
        if tolerance not in made:
            made[tolerance] = hy.taylor_adaptive(equations, [1.0, 0.0, 0.0, 1.0], tol=tolerance)
        integrator, ends = made[tolerance], []
        for start in np.concatenate([orbit.y, orbit.v]).T:
            integrator.time = 0.0
            integrator.state[:] = start
            integrator.propagate_until(orbit.end)
            ends.append(integrator.state[:2].copy())
        return np.stack(ends, axis=-1)

    return Contestant("heyoka Taylor", solve)


def numbas(orbit: Orbit) -> Contestant | None:
    """DOPRI5 with the step control of its authors' program, compiled by numba in its best configuration."""
    try:
        import numba
    except ImportError:
        return None

    @numba.njit(fastmath=True, error_model="numpy", inline="always")
    def acceleration(x: float, y: float) -> Any:
        r2 = x * x + y * y
        f = -1.0 / (r2 * math.sqrt(r2))
        return f * x, f * y

    @numba.njit(fastmath=True, error_model="numpy")
    def run(starts: Any, end: float, tolerance: float, ends: Any) -> None:
        for m in range(starts.shape[1]):
            x, y, u, v = starts[0, m], starts[1, m], starts[2, m], starts[3, m]
            t, h, before, rejected = 0.0, 1e-3, 1e-4, False
            a1, b1 = acceleration(x, y)
            while t < end:
                h = min(h, end - t)
                u2, v2 = u + h * a1 / 5, v + h * b1 / 5
                a2, b2 = acceleration(x + h * u / 5, y + h * v / 5)
                u3, v3 = u + h * (3 / 40 * a1 + 9 / 40 * a2), v + h * (3 / 40 * b1 + 9 / 40 * b2)
                a3, b3 = acceleration(x + h * (3 / 40 * u + 9 / 40 * u2), y + h * (3 / 40 * v + 9 / 40 * v2))
                u4 = u + h * (44 / 45 * a1 - 56 / 15 * a2 + 32 / 9 * a3)
                v4 = v + h * (44 / 45 * b1 - 56 / 15 * b2 + 32 / 9 * b3)
                a4, b4 = acceleration(
                    x + h * (44 / 45 * u - 56 / 15 * u2 + 32 / 9 * u3), y + h * (44 / 45 * v - 56 / 15 * v2 + 32 / 9 * v3)
                )
                p, q, r, s = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
                u5, v5 = u + h * (p * a1 + q * a2 + r * a3 + s * a4), v + h * (p * b1 + q * b2 + r * b3 + s * b4)
                a5, b5 = acceleration(x + h * (p * u + q * u2 + r * u3 + s * u4), y + h * (p * v + q * v2 + r * v3 + s * v4))
                p, q, r, s, w = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
                u6 = u + h * (p * a1 + q * a2 + r * a3 + s * a4 + w * a5)
                v6 = v + h * (p * b1 + q * b2 + r * b3 + s * b4 + w * b5)
                a6, b6 = acceleration(
                    x + h * (p * u + q * u2 + r * u3 + s * u4 + w * u5), y + h * (p * v + q * v2 + r * v3 + s * v4 + w * v5)
                )
                p, q, r, s, w = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
                un = u + h * (p * a1 + q * a3 + r * a4 + s * a5 + w * a6)
                vn = v + h * (p * b1 + q * b3 + r * b4 + s * b5 + w * b6)
                xn = x + h * (p * u + q * u3 + r * u4 + s * u5 + w * u6)
                yn = y + h * (p * v + q * v3 + r * v4 + s * v5 + w * v6)
                a7, b7 = acceleration(xn, yn)
                p, q, r, s, w, z = 71 / 57600, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40
                eu = h * (p * a1 + q * a3 + r * a4 + s * a5 + w * a6 + z * a7)
                ev = h * (p * b1 + q * b3 + r * b4 + s * b5 + w * b6 + z * b7)
                ex = h * (p * u + q * u3 + r * u4 + s * u5 + w * u6 + z * un)
                ey = h * (p * v + q * v3 + r * v4 + s * v5 + w * v6 + z * vn)
                eu /= tolerance * (1 + max(abs(u), abs(un)))
                ev /= tolerance * (1 + max(abs(v), abs(vn)))
                ex /= tolerance * (1 + max(abs(x), abs(xn)))
                ey /= tolerance * (1 + max(abs(y), abs(yn)))
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

    def solve(tolerance: float) -> Any:
        ends = np.empty_like(orbit.y)
        run(np.concatenate([orbit.y, orbit.v]), orbit.end, tolerance, ends)
        return ends

    return Contestant("numba DOPRI5", solve)


def measured(contestant: Contestant, orbit: Orbit, repeats: int, patience: float) -> list[tuple[float, float, float]]:
    """Error, median and spread of the seconds, at each tolerance; ends when a run is longer than the patience."""
    rows = []
    contestant.solve(TOLERANCES[0])  # whatever it compiles
    for tolerance in TOLERANCES:
        begin = time.perf_counter()
        end = contestant.solve(tolerance)
        first = time.perf_counter() - begin
        error = float(np.sqrt(((end - orbit.y) ** 2).sum(axis=0)).max())
        times = []
        for _ in range(repeats):
            n = max(1, min(200, int(0.01 / max(first, 1e-6))))
            begin = time.perf_counter()
            for _ in range(n):
                contestant.solve(tolerance)
            times.append((time.perf_counter() - begin) / n)
        rows.append((error, statistics.median(times), max(times) / min(times)))
        if first > patience or error < 1e-11:
            break
    return rows


def at_error(rows: Sequence[tuple[float, float, float]], wanted: float) -> float:
    """Seconds for that error, between the two measurements that enclose it; NaN if none do."""
    for (e1, t1, _), (e2, t2, _) in itertools.pairwise(rows):
        if e1 >= wanted > e2 > 0.0:
            share = math.log(wanted / e1) / math.log(e2 / e1)
            return math.exp(math.log(t1) + share * (math.log(t2) - math.log(t1)))
    return math.nan


def main() -> None:
    """Time and show."""
    parser = argparse.ArgumentParser(prog="python -m benches.adaptive", description=__doc__)
    parser.add_argument("--members", type=int, default=10_000, help="orbits of the batch (default: 10 000)")
    parser.add_argument("--periods", type=int, default=10)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    for members in (1, given.members):
        orbit = kepler(members, given.periods)
        able = [ours(orbit, m.name) for m in sw.methods() if m.error_order is not None] + [numbas(orbit)]
        if members == 1:  # one after the other, they take as long as their number says
            able += [scipys(orbit, "RK45"), scipys(orbit, "DOP853")]
        able.append(heyokas(orbit))
        print(f"\nKepler, e = 0.9, {given.periods} periods, {members} orbit(s), one thread: ms for an error at the end of\n")
        print("| contestant | " + " | ".join(f"{e:.0e}" for e in ERRORS) + " | largest spread |")
        print("|---" * (len(ERRORS) + 2) + "|")
        for contestant in filter(None, able):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", sw.ToleranceWarning)
                rows = measured(contestant, orbit, given.repeats, 4.0)
            cells = [f"{1e3 * at_error(rows, e):.3g}" for e in ERRORS]
            print(f"| {contestant.name} | {' | '.join(cells)} | {max(r[2] for r in rows):.2f} |", flush=True)


if __name__ == "__main__":
    main()
