"""How cost grows with members, states, bodies, steps and operations: ``python -m benches.growth``.

With ``--quick`` it stops far earlier. It prints a table for each, writes all numbers to benches/growth.json and draws
docs/images/growth-*.png; with ``--draw`` it draws what was written before. Times are the least of several. Limits of the machine
are measured by a C program beside the kernels; a cycle is the time of an integer addition that waits for the one before.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw
from rich.console import Console
from rich.table import Table
from stepwell import _core
from stepwell.runs import engine

from .compare.machine import describe
from .compare.peers import c_peer
from .compile import SYSTEMS, arithmetic
from .export import Exported

HERE = Path(__file__).resolve().parent
NUMBERS, IMAGES = HERE / "growth.json", HERE.parent / "docs" / "images"

#: The largest of each sweep, in full and quickly, and the seconds after which a measurement is not repeated.
LARGEST = {"members": (10**7, 10**5), "states": (500, 200), "bodies": (20_000, 2000), "steps": (10**7, 10**6)}
LARGEST |= {"operations": (10**5, 10**5), "ring": (10**5, 10**4)}
ENOUGH, REPEATS = 2.0, 7

#: Steps of a member in the sweep of members, operations of a measurement of a limit, and members and steps of a kernel.
STEPS, REPEATED, KERNEL_MEMBERS, KERNEL_STEPS = 100, 1_200_000, 1024, 2000

#: About the operations of an oscillator of the ring, and steps of a member after which its code is packed.
OPERATIONS_OF_ONE, PACKING_STEPS = 60, 31_000

#: What is on the axes, and what the picture says.
AXES = {
    "members": (
        "members of a batch",
        "ns per member and step",
        "Below {even} members the call ({call}) costs more than the steps",
    ),
    "states": (
        "states of one member",
        "ns per state and step",
        "After the first few, every further state costs {low} to {high} ns",
    ),
    "bodies": (
        "bodies",
        "ns per pair and evaluation",
        "Above a few hundred bodies a pair costs {pair} ns, however many there are",
    ),
    "steps": ("steps of one member", "ns per step", "Short runs pay for the call, long ones for the step"),
    "operations": (
        "operations of a step",
        "ns per operation",
        "Tracing, compiling and stepping grow in proportion to the operations",
    ),
    "ring": (
        "operations of a step",
        "ns per operation",
        "A step costs in proportion to its operations, however long, and less than in C",
    ),
}


def least(work: Callable[[], object], repeats: int = REPEATS, *, alone: bool = True) -> float:
    """The shortest time of several, in seconds; once if that takes long.

    Of one thread ``alone`` it is processor time, which does not count what other programs take.
    """
    clock = time.process_time if alone else time.perf_counter
    best, begin = float("inf"), time.perf_counter()
    for _ in range(repeats):
        start = clock()
        work()
        best = min(best, clock() - start)
        if time.perf_counter() - begin > ENOUGH:
            break
    return best


def ladder(first: int, last: int, per_decade: int = 3) -> list[int]:
    """Whole numbers at about equal ratios, the ends among them."""
    count = max(2, round(per_decade * float(np.log10(last / first))) + 1)
    return sorted({round(n) for n in np.geomspace(first, last, count).tolist()})


def members(most: int) -> list[dict[str, Any]]:
    """Free oscillators by False Euler, by one thread and by all."""
    rows = []
    for n in ladder(1, most):
        omega = np.linspace(0.5, 1.5, n)
        row: dict[str, Any] = {"x": n}
        for name, threads in (("one thread", 1), ("all threads", None)):
            run = least(
                lambda omega=omega, threads=threads: sw.integrate(  # type: ignore[misc]
                    sw.Oscillator(omega), "false_euler", v=0.0, y=1.0, dt=0.01, steps=STEPS, threads=threads
                ),
                alone=threads == 1,
            )
            row[name] = 1e9 * run / (n * STEPS)
        rows.append(row)
    return rows


def form_of(system: sw.System, method: str, batch: tuple[int, ...] = ()) -> str:
    """How a step is made: one tape, or else by what."""
    model = engine.model(engine.Plan(system, sw.method(method), batch, 1e-3))
    parts = _core.in_parts(model, max(1, int(np.prod(batch))))
    return "one tape" if parts is None else parts[0]


def states(most: int) -> list[dict[str, Any]]:
    """A chain of masses by RK4, one member."""
    rows = []
    for half in ladder(1, most // 2, 6):
        chain: sw.System = sw.Chain(half)
        steps = max(20, 100_000 // half)
        y = np.linspace(0.0, 1.0, half)
        spent = least(lambda: sw.integrate(chain, "rk4", v=0.0 * y, y=y, dt=0.01, steps=steps, threads=1))
        rows.append({"x": 2 * half, "chain": 1e9 * spent / (2 * half * steps), "form": form_of(chain, "rk4")})
    return rows


def bodies(most: int) -> list[dict[str, Any]]:
    """A cluster in space by leapfrog, by one thread and by all."""
    rows = []
    for n in ladder(2, most):
        rng = np.random.default_rng(n)
        system = sw.NBody(np.full(n, 1.0 / n), force="newton", dim=3, softening=0.05)
        v, y = 0.1 * rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
        pairs = n * (n - 1) // 2
        steps = max(1, min(20_000, 20_000_000 // pairs))
        row: dict[str, Any] = {"x": n, "form": form_of(system, "leapfrog")}
        for name, threads in (("one thread", 1), ("all threads", None)):
            spent = least(
                lambda threads=threads: sw.integrate(system, "leapfrog", v=v, y=y, dt=1e-4, steps=steps, threads=threads),  # type: ignore[misc]
                alone=threads == 1,
            )
            row[name] = 1e9 * spent / (pairs * (steps + 1))  # the forces at the start are one evaluation more
        rows.append(row)
    return rows


def steps(most: int) -> list[dict[str, Any]]:
    """One free oscillator by False Euler and one pendulum by RK4, with the last state saved alone."""
    rows = []
    for n in ladder(1, most):
        row: dict[str, Any] = {"x": n}
        for name, system, method in (("oscillator", sw.Oscillator(), "false_euler"), ("pendulum", sw.Pendulum(), "rk4")):
            spent = least(
                lambda system=system, method=method: sw.integrate(system, method, v=0.0, y=1.0, dt=0.01, steps=n, threads=1)
            )  # type: ignore[misc]
            row[name] = 1e9 * spent / n
        rows.append(row)
    return rows


def of_length(operations: int) -> Any:
    """An equation of one's own of so many operations: half of them products."""
    factors = (1.0 + 1e-3 * np.arange(operations // 2) / operations).tolist()

    @sw.system
    def long(t: Any, v: Any, y: Any) -> Any:
        x = y
        for factor in factors:
            x = x * factor + v
        return -1e-3 * x

    return long


def operations(most: int) -> list[dict[str, Any]]:
    """Own equations of growing length by False Euler: the first run, tracing and compiling in it, and a later step."""
    rows = []
    for n in ladder(10, most):
        begin = time.process_time()
        system = of_length(n)()
        sw.integrate(system, "false_euler", v=0.0, y=1.0, dt=1e-6, steps=1)
        first = time.process_time() - begin
        model = engine.model(engine.Plan(system, sw.method("false_euler"), (), 1e-3))
        told = [_core.compiled(model, 1) for _ in range(3)]
        count = max(100, 4_000_000 // n)
        later = least(lambda: sw.integrate(system, "false_euler", v=0.0, y=1.0, dt=1e-6, steps=count), 3) / count
        row: dict[str, Any] = {
            "x": n,
            "first run": 1e9 * first / n,
            "a step": 1e9 * later / n,
            "form": form_of(system, "false_euler"),
        }
        for key in ("trace", "compile"):
            row[key] = min(1e9 * each[key] / n for each in told if each) if told[0] else None
        rows.append(row)
    return rows


def ring(most: int) -> list[dict[str, Any]]:
    """Own oscillators on a ring by Runge-Kutta 4: one member, beside its exported C program, and one of some, each of a batch."""

    @sw.system
    def coupled(t: Any, v: Any, y: Any) -> Any:
        d = np.roll(y, 1) - y
        pull = d + 0.1 * d * d * d
        return pull - np.roll(pull, -1) - 0.3 * v - 0.2 * y / (1.0 + y * y)

    rows = []
    for n in ladder(4, most // OPERATIONS_OF_ONE):
        y = np.sin(np.arange(float(n)))
        system: sw.System = coupled()
        model = engine.model(engine.Plan(system.for_state_shapes(y, y), sw.method("rk4"), (), 1e-3))
        about = _core.operations(model)
        row: dict[str, Any] = {"x": about, "form": form_of(system.for_state_shapes(y, y), "rk4")}
        for name, members in (("one member", 1), ("one of 64", 64)):
            count = max(50, 40_000_000 // (about * members))
            start = np.repeat(y[:, np.newaxis], members, axis=1) if members > 1 else y
            ask: dict[str, Any] = {"v": 0.0 * start, "y": start, "dt": 1e-3, "threads": 1}
            sw.integrate(system, "rk4", steps=PACKING_STEPS if members == 1 else count, **ask)
            spent = least(lambda ask=ask, count=count: sw.integrate(system, "rk4", steps=count, **ask))  # type: ignore[misc]
            row[name] = 1e9 * spent / (count * members * about)
        with tempfile.TemporaryDirectory() as folder:
            program = Exported(system, y, "rk4", "c", Path(folder), "CLOCK_PROCESS_CPUTIME_ID")
            row["exported C"] = 1e9 * min(program.seconds(count * members) for _ in range(REPEATS)) / (count * members * about)
            program.close()
        rows.append(row)
    return rows


def limits() -> dict[str, float]:
    """Cycles a vector of each kind of operation, by C, with the width and the clock; nothing without a compiler."""
    with tempfile.TemporaryDirectory() as folder:
        built = Path(folder) / "limits.so"
        flags = ["-O2", "-march=native", "-shared", "-fPIC"]
        subprocess.run([c_peer.compiler(), *flags, str(HERE / "limits.c"), "-o", str(built)], check=True)
        library = ctypes.CDLL(str(built))
        turn = ctypes.c_long(REPEATED)
        cycle = least(lambda: library.cycles(turn), 30) / REPEATED
        kinds = ("sums", "products", "quotients", "roots")
        found = {kind: least(lambda kind=kind: getattr(library, kind)(turn), 30) / REPEATED / cycle for kind in kinds}  # type: ignore[misc]
        return {"cycle": cycle, "width": float(library.width()), **found}


def kernels(quick: bool) -> list[dict[str, Any]]:
    """Operations a cycle of each kernel of the table of ``benches.compile``, and the share of what the machine can do at most.

    At most: sums beside products, each as fast as alone, or quotients and roots one after another.
    """
    limit = limits()
    rows = []
    for name, system in SYSTEMS.items():
        for method in ("false_euler", "rk4"):
            how = sw.method(method)
            small = smaller(name, system)
            if small is None:
                continue
            told = _core.compiled(engine.model(engine.Plan(small, how, (KERNEL_MEMBERS,), 1e-3)), KERNEL_MEMBERS)
            if told is None:
                continue
            start = {"v": np.full((*small.v_shape, KERNEL_MEMBERS), 0.1), "y": spread(small)}
            count = KERNEL_STEPS // (10 if quick else 1)
            spent = [
                least(lambda n=n: sw.integrate(small, how, **start, dt=1e-4, steps=n, threads=1), 15) for n in (count, 5 * count)
            ]  # type: ignore[misc]
            cycles = (spent[1] - spent[0]) / (4 * count * KERNEL_MEMBERS) / limit["cycle"]
            done = told["computed"]
            sums, products = done["additions"], done["multiplications"]
            bound = (
                max(
                    sums * limit["sums"],
                    products * limit["products"],
                    done["divisions"] * limit["quotients"] + done["square_roots"] * limit["roots"],
                )
                / limit["width"]
            )
            row = {"kernel": f"{name}, {how.title}", "operations": arithmetic(done), "cycles": cycles}
            rows.append(row | {"per cycle": arithmetic(done) / cycles, "share": bound / cycles})
    return rows


def smaller(name: str, system: sw.System) -> sw.System | None:
    """The system of the table with as many members as a kernel is timed with; None for one whose start is its own."""
    omega = np.linspace(0.5, 2.0, KERNEL_MEMBERS)
    several = {"oscillator": sw.Oscillator(omega), "pendulum": sw.Pendulum(omega)}
    if "controlled" in name or "sine" in name or "held" in name:
        return None
    return several.get(name, system)


def spread(system: sw.System) -> Any:
    """Places of bodies far from each other, and of what else there is near zero; the same for all members."""
    shape = system.y_shape
    far = np.arange(1.0, 1.0 + float(np.prod(shape))).reshape(shape) ** 1.5 * 0.3 if shape else np.array(0.5)
    return np.broadcast_to(far[..., np.newaxis], (*shape, KERNEL_MEMBERS)).copy()


def show(name: str, rows: list[dict[str, Any]], console: Console) -> None:
    """One table."""
    table = Table(title=name)
    for key in rows[0]:
        table.add_column(AXES[name][0] if key == "x" and name in AXES else key, justify="right")
    for row in rows:
        table.add_row(
            *(f"{value:.3g}" if isinstance(value, float) else "—" if value is None else str(value) for value in row.values())
        )
    console.print(table)


def draw(told: dict[str, Any]) -> None:
    """A picture of each sweep, and one of the kernels."""
    from matplotlib import rc_context
    from stepwell.base.pictures import png
    from stepwell.views.charts import style
    from stepwell.views.charts.labels import at_ends, title

    colours = [style.FAMILIES[each] for each in ("Runge-Kutta", "Heun", "leapfrog", "PEFRL")]
    for name, (x_name, y_name, said) in AXES.items():
        rows = told[name]
        with rc_context(style.FONT):
            figure: Any = style.new_figure(10.0, 5.6)
            axes = figure.add_axes((0.09, 0.13, 0.74, 0.71), xscale="log", yscale="log")
            ends = []
            for colour, key in zip(colours, (key for key in rows[0] if key not in ("x", "form")), strict=False):
                known = [(row["x"], row[key]) for row in rows if row[key] is not None]
                axes.plot(*np.array(known).T, color=colour, linewidth=2.2, marker="o", markersize=4.5)
                ends.append((*known[-1], key, colour))
            low, high = axes.get_ylim()
            axes.set_ylim(low, high * (high / low) ** ROOM)  # for the names of the forms
            changes = [(a["x"], b["x"], b["form"]) for a, b in pairwise(rows) if a.get("form") != b.get("form")]
            for before, after, form in changes:
                at = float(np.sqrt(before * after))
                axes.axvline(at, color=style.GREY, linewidth=0.9, linestyle=(0, (4, 2)))
                axes.text(
                    at,
                    0.98,
                    f" {FORMS.get(form, form)}",
                    transform=axes.get_xaxis_transform(),
                    va="top",
                    size=11.5,
                    color=style.GREY,
                )
            axes.set(xlabel=x_name, ylabel=y_name)
            axes.grid(color="#e6e6e6", linewidth=0.8)
            axes.minorticks_off()
            axes.spines[["top", "right"]].set_visible(False)
            low, high = axes.get_ylim()
            if high < 10.0 * low:
                axes.set_ylim(0.5 * low, 2.0 * high)
            at_ends(axes, ends, 12.0, 0.06)
            if name == "members":
                call_and_steps(axes, rows)
            title(figure, 0.012, 0.93, said.format(**numbers(told)), 17)
            about = "; all threads are two, which start where that is worth it" if name == "members" else ""
            figure.text(0.012, 0.885, f"{told['machine']}{about}", size=11.5, color=style.GREY)
            (IMAGES / f"growth-{name}.png").write_bytes(png(figure))


#: The names of forms stand above the curves, in this share of the height.
ROOM = 0.1


def numbers(told: dict[str, Any]) -> dict[str, str]:
    """The numbers of the titles."""
    call, step = call_of(told["members"])
    states = [row["chain"] for row in told["states"][len(told["states"]) // 4 :]]
    pairs = [row["one thread"] for row in told["bodies"] if row["x"] >= MANY_BODIES]
    return {
        "even": f"{float(f'{call / step:.1g}'):,.0f}".replace(",", " "),
        "call": f"{1e-3 * call * STEPS:.0f} µs",
        "low": f"{min(states):.1f}",
        "high": f"{max(states):.1f}",
        "pair": f"{float(np.median(pairs)):.1f}",
    }


def call_of(rows: list[dict[str, Any]]) -> tuple[float, float]:
    """What the call costs for a step, and what a member and step costs in a large batch, in ns by one thread."""
    large = [row["one thread"] for row in rows if row["x"] >= LARGE_BATCH]
    return rows[0]["one thread"], float(np.median(large))


def call_and_steps(axes: Any, rows: list[dict[str, Any]]) -> None:
    """The two parts of the time: the call, shared by the members, and the steps."""
    from stepwell.views.charts import style

    call, step = call_of(rows)
    x = np.array([row["x"] for row in rows], dtype=np.float64)
    low, high = axes.get_ylim()
    axes.plot(x, call / x, color=style.GREY, linewidth=1.2, linestyle=(0, (5, 3)), zorder=1)
    axes.axhline(step, color=style.GREY, linewidth=1.2, linestyle=(0, (5, 3)), zorder=1)
    axes.set_ylim(0.5 * low, high)
    axes.text(30.0, 1.6 * call / 30.0, f"cost of the call: {1e-3 * call * STEPS:.0f} µs", size=12, color=style.GREY)
    axes.text(1.2, 1.2 * step, f"a step in a large batch: {step:.2f} ns", size=12, color=style.GREY)


#: Batches of which a step has its own price, and bodies of which a pair has.
LARGE_BATCH, MANY_BODIES = 100_000, 200


#: What a form is called in a picture.
FORMS = {"rates": "rates as a tape", "hand": "loops over rows", "matrix": "products of matrices", "one tape": "one tape"}


def main() -> None:
    """Measure, print, write and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="end each sweep far earlier")
    parser.add_argument("--draw", action="store_true", help="only draw what was measured before")
    parser.add_argument("--only", help="sweeps, separated by commas; the others keep their numbers")
    asked = parser.parse_args()
    console = Console()
    told: dict[str, Any] = json.loads(NUMBERS.read_text(encoding="utf-8")) if NUMBERS.exists() else {}
    if not asked.draw:
        about = dict(describe())
        told["machine"] = f"{about['CPU'].split(' (')[0]}, {sw.isa()}, {about.get('date', '')}" + (
            ", quick" if asked.quick else ""
        )
        sweeps: dict[str, Any] = {
            "members": members,
            "states": states,
            "bodies": bodies,
            "steps": steps,
            "operations": operations,
            "ring": ring,
        }
        chosen = [*sweeps, "kernels"] if asked.only is None else asked.only.split(",")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for name in chosen:
                told[name] = kernels(asked.quick) if name == "kernels" else sweeps[name](LARGEST[name][asked.quick])
                show(name, told[name], console)
                NUMBERS.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    draw(told)


if __name__ == "__main__":
    main()
