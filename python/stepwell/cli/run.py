"""Run a scene by a method, say where it ended and how wrong it was, and write numbers, a picture or a film."""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..charts import RunPicture, run_picture
from ..charts.runs_film import ENDINGS as FILMS
from ..charts.runs_film import need as need_for_film
from ..charts.style import new_figure
from ..control import WAYS, EnergyControl, Projection
from ..errors import ArgumentError, ControlWarning, DivergenceWarning
from ..scenes import scene
from . import show

#: Without --every, about so many states are kept; more for a picture, whose curves are to be smooth.
KEPT, KEPT_TO_DRAW = 1000, 20_000

NUMBERS, PICTURES = (".csv", ".npz"), (".png", ".svg", ".pdf")


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("scene", metavar="SCENE", help="a scene; see stepwell scenes")
    parser.add_argument("--method", required=True, metavar="NAME", help="a method; see stepwell methods")
    parser.add_argument("--dt", type=float, metavar="TIME", help="the step (default: the scene's)")
    parser.add_argument("--steps", type=int, metavar="N", help="how many steps (default: up to the scene's horizon)")
    parser.add_argument("--every", type=int, metavar="N", help=f"keep every Nth state (default: about {KEPT} in all)")
    parser.add_argument(
        "--control",
        metavar="CONTROL",
        help="what keeps the energy of bodies: a gain and a form, such as 0.3 or 0.3:printed; a projection, scaling or nacozy; "
        "off for none (default: the scene's)",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="write the kept states (.csv, .npz), a picture (.png, .svg, .pdf) or a film (.gif, .mp4, .html)",
    )
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="how long a film lasts (default: 10)")
    parser.add_argument("--fps", type=float, default=20.0, metavar="N", help="frames a second of a film (default: 20)")
    show.json_option(parser)


def command(args: argparse.Namespace) -> None:
    """Run, report, write."""
    chosen = scene(args.scene)
    ending = "" if args.output is None else args.output.suffix
    _ready(args.output, args.seconds, args.fps)
    dt = chosen.dt if args.dt is None else args.dt
    steps = chosen.steps_for(dt) if args.steps is None else args.steps
    kept = KEPT_TO_DRAW if ending in (*PICTURES, *FILMS) else KEPT
    every = max(1, steps // kept) if args.every is None else args.every
    control = {} if args.control is None else {"control": _control(args.control)}
    with warnings.catch_warnings(record=True) as told:
        for kind in (DivergenceWarning, ControlWarning):
            warnings.simplefilter("always", kind)
        run = chosen.run(args.method, dt, steps=steps, every=every, record=list(chosen.system.quantities)[:1], **control)
    for warning in told:
        print(f"stepwell: warning: {warning.message}", file=sys.stderr)

    picture = run_picture(chosen, run)
    columns: dict[str, Any] = picture.columns()
    if ending == ".npz":
        np.savez(args.output, **columns)
    elif ending == ".csv":
        picture.to_csv(args.output)
    elif ending in PICTURES:
        picture.plot(args.output)
    elif ending in FILMS:
        picture.animate(args.output, seconds=args.seconds, fps=args.fps)
    report = _report(picture, columns)
    if args.output is not None:
        report["written"] = str(args.output)
    if args.json:
        show.print_json(report)
        return
    for name, value in report.items():
        print(f"{name.replace('_', ' '):21} {value}")


def _ready(path: Path | None, seconds: float, fps: float) -> None:
    """Raise if the file cannot be written for want of a format or a program, before any work is done."""
    if path is None or path.suffix in NUMBERS:
        return
    if path.suffix in PICTURES:
        new_figure(1.0, 1.0)
    elif path.suffix in FILMS:
        need_for_film(path, seconds, fps)
    else:
        known = ", ".join((*NUMBERS, *PICTURES, *FILMS))
        raise ArgumentError(f"-o: expected a file ending in one of {known}, got {str(path)!r}")


def _control(given: str) -> EnergyControl | Projection | None:
    """The control that ``GAIN[:FORM]``, the way of a projection or ``off`` says."""
    if given == "off":
        return None
    if given in WAYS:
        return Projection(given)
    gain, _, form = given.partition(":")
    try:
        strength = float(gain)
    except ValueError:
        raise ArgumentError(
            f"--control: expected a gain and a form, such as 0.3:printed, {', '.join(WAYS)} or off, got {given!r}"
        ) from None
    return EnergyControl(strength, form) if form else EnergyControl(strength)


def _report(picture: RunPicture, columns: dict[str, Any]) -> dict[str, Any]:
    known = {name: value for name, value in picture.summary().items() if not name.startswith("largest") or value is not None}
    largest = {name: known.pop(name) for name in list(known) if name.startswith("largest")}
    return known | {f"last_{name}": columns[name][-1].tolist() for name in ("t", "v", "y", "energy") if name in columns} | largest
