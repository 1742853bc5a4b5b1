"""What states within steps cost beside the run without, and beside others: the tables of docs/howto/adaptive.md.

    python -m benches.within

Processor time of one thread, the least of some turns in which all are run one after the other: Duffing's oscillator to t = 40,
with one saved state and with 1000.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import stepwell as sw

from .events import duffing, least

TIMES = np.linspace(0.04, 40.0, 1000)
#: Methods with the tolerance at which they are run.
METHODS = {
    "bs32": 1e-5, "merson": 1e-8, "fehlberg": 1e-8, "fehlberg_5": 1e-8, "dopri5": 1e-8, "tsit5": 1e-8, "dop853": 1e-8,
    "vern7": 1e-8, "rosenbrock23": 1e-5, "rodas4": 1e-8, "rodas5p": 1e-8, "taylor": 1e-8, "vern9": 1e-8,
}  # fmt: skip


def of_method(method: str, tolerance: float, members: int) -> None:
    """A row of the table."""
    state = {"v": 0.0, "y": np.linspace(0.3, 0.8, members) if members > 1 else 0.3, "threads": 1, "tolerance": tolerance}
    one, all_of_them = ({**state, "at": at} for at in (TIMES[-1:], TIMES))
    ms = least(
        {
            "without": lambda: sw.integrate(duffing(), method, **one),
            "within": lambda: sw.integrate(duffing(), method, **all_of_them),
        }
    )
    numbers = 2 * members * len(TIMES)
    ratio, each = ms["within"] / ms["without"], 1e6 * (ms["within"] - ms["without"]) / numbers
    print(f"| `{method}` | {members} | {ms['without']:.2f} | {ratio:.1f} | {each:.0f} |")


def of_one() -> None:
    """One trajectory at 1000 times that are known before the run, and after it; beside SciPy's and heyoka's."""
    from scipy.integrate import solve_ivp

    def rates(t: float, z: Any) -> Any:
        return [z[1], z[0] - z[0] ** 3 + 0.01 * np.cos(1.2 * t)]

    for tolerance in (1e-3, 1e-8):
        ask: dict[str, Any] = {"method": "DOP853", "rtol": tolerance, "atol": tolerance}
        ours, theirs = (
            solve(rates, (0.0, 40.0), [0.3, 0.0], dense_output=True, **ask).sol for solve in (sw.solve_ivp, solve_ivp)
        )
        solved = {
            "ours": lambda ask=ask: sw.solve_ivp(rates, (0.0, 40.0), [0.3, 0.0], t_eval=TIMES, **ask),
            "SciPy's": lambda ask=ask: solve_ivp(rates, (0.0, 40.0), [0.3, 0.0], t_eval=TIMES, **ask),
            "our sol": lambda sol=ours: sol(TIMES),
            "SciPy's sol": lambda sol=theirs: sol(TIMES),
        }
        ms = least(solved, 20)
        print(f"{tolerance:g}: " + ", ".join(f"{name} {each:.2f} ms" for name, each in ms.items()))
    try:
        import heyoka as hy
    except ImportError:
        print("heyoka is left out: it is not installed")
        return
    y, v = hy.make_vars("y", "v")
    made = hy.taylor_adaptive([(y, v), (v, y - y * y * y + 0.01 * hy.cos(1.2 * hy.time))], [0.3, 0.0], tol=1e-8)

    def run(grid: bool) -> None:
        made.time, made.state[:] = 0.0, [0.3, 0.0]
        made.propagate_grid(np.append(0.0, TIMES)) if grid else made.propagate_until(40.0)

    ms = least({"without": lambda: run(False), "within": lambda: run(True)}, 30)
    print(
        f"| heyoka | 1 | {ms['without']:.3f} | {ms['within'] / ms['without']:.1f} | {500 * (ms['within'] - ms['without']):.0f} |"
    )


def main() -> None:
    """Print the tables."""
    for members in (1, 1000):
        for method, tolerance in METHODS.items():
            of_method(method, tolerance, members)
    of_one()


if __name__ == "__main__":
    main()
