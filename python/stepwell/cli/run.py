"""Run a scene by a method, and say where it ended and how wrong it was."""

from __future__ import annotations

import argparse
import csv
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from .._checks import Array
from ..errors import ArgumentError, DivergenceWarning
from ..result import Run
from ..scenes import Scene, scene
from . import show

#: Without --every, about so many states are kept.
KEPT = 1000


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("scene", metavar="SCENE", help="a scene; see stepwell scenes")
    parser.add_argument("--method", required=True, metavar="NAME", help="a method; see stepwell methods")
    parser.add_argument("--dt", type=float, metavar="TIME", help="the step (default: the scene's)")
    parser.add_argument("--steps", type=int, metavar="N", help="how many steps (default: up to the scene's horizon)")
    parser.add_argument("--every", type=int, metavar="N", help=f"keep every Nth state (default: about {KEPT} in all)")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the kept states: .csv or .npz")
    show.json_option(parser)


def command(args: argparse.Namespace) -> None:
    """Run, report, write."""
    chosen = scene(args.scene)
    if args.output is not None and args.output.suffix not in (".csv", ".npz"):
        raise ArgumentError(f"-o: expected a file ending in .csv or .npz, got {str(args.output)!r}")
    dt = chosen.dt if args.dt is None else args.dt
    steps = chosen.steps_for(dt) if args.steps is None else args.steps
    every = max(1, steps // KEPT) if args.every is None else args.every
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", DivergenceWarning)
        run = chosen.run(args.method, dt, steps=steps, every=every)
    for warning in told:
        print(f"stepwell: warning: {warning.message}", file=sys.stderr)

    errors = {} if chosen.exact is None else {"state_error": chosen.state_error(run), "energy_error": chosen.energy_error(run)}
    columns = {"t": run.t, "v": run.v, "y": run.y, "energy": run.energy} | errors
    if args.output is not None:
        _write(args.output, columns)
    report = _report(chosen, run, columns)
    if args.output is not None:
        report["written"] = str(args.output)
    if args.json:
        show.print_json(report)
        return
    for name, value in report.items():
        print(f"{name.replace('_', ' '):21} {value}")


def _report(chosen: Scene, run: Run, columns: dict[str, Array]) -> dict[str, Any]:
    report: dict[str, Any] = {
        "scene": chosen.name,
        "method": run.method.name,
        "dt": run.dt,
        "steps": run.steps,
        "kept": len(run.t),
        "diverged_at_step": int(run.first_bad_step) if run.status else None,
    }
    report |= {f"last_{name}": columns[name][-1].tolist() for name in ("t", "v", "y", "energy")}
    return report | {f"largest_{name}": float(columns[name].max()) for name in ("state_error", "energy_error") if name in columns}


def _write(path: Path, columns: dict[str, Any]) -> None:
    """The kept states: arrays as they are, or a table with a column for each number of a block."""
    if path.suffix == ".npz":
        np.savez(path, **columns)
        return
    table = {}
    for name, values in columns.items():
        for index in np.ndindex(values.shape[1:]):
            table[name + (str(list(index)) if index else "")] = values[(slice(None), *index)].tolist()
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*table.values(), strict=True))
