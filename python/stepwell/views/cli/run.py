"""Run a scene by a method.

Without --method it takes the advised method and step. Prints how the run ended, the last state and the errors; -o writes an
animation, a picture or the saved states.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...base import paths
from ...base.pictures import new_figure
from ...errors import ArgumentError
from ...model.controls import WAYS, AnyControl, EnergyControl, Projection
from ...runs.execution import noticing
from ...runs.options import Options
from ...runs.options.single import FORMS
from ...runs.request import Request
from ...runs.result import Run
from ...scenes import Scene
from ..charts import RunPicture, run_picture
from ..charts.runs_animation import ENDINGS as ANIMATIONS
from ..charts.runs_animation import need as need_for_animation
from . import options, show
from .advised import ADAPTIVE, USUAL, advised
from .settings import scene_with
from .verdict import UNKNOWN, verdict

#: The number of states that are saved without --every; more for a picture, whose curves should be smooth.
SAVED, SAVED_TO_DRAW = 1000, 20_000

#: The number of states that are saved with a tolerance; more for a picture.
SAVED_ADAPTIVE, SAVED_ADAPTIVE_TO_DRAW = 100, 2000

#: Digits of a number and of an error on the screen, and the most numbers of a block there.
DIGITS, DIGITS_OF_AN_ERROR, MOST_SHOWN = 8, 3, 12

#: Names on the screen of numbers of the report, where JSON has another name.
SCREEN_NAMES = {"kept": "saved states"}

NUMBERS, PICTURES = (".csv", ".npz"), (".png", ".svg", ".pdf")


def arguments(parser: argparse.ArgumentParser) -> None:
    options.scene(parser)
    parser.add_argument("--method", metavar="NAME", help="a method; see stepwell methods (default: the advised one)")
    parser.add_argument("--dt", type=float, metavar="TIME", help="the step (default: the scene's, or the advised one)")
    parser.add_argument("--steps", type=int, metavar="N", help="number of steps (default: up to the scene's horizon)")
    parser.add_argument("--every", type=int, metavar="N", help=f"save every Nth state (default: about {SAVED} in all)")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="set a parameter or the start, such as omega=3 or y=2"
    )
    parser.add_argument("--tolerance", type=float, metavar="E", help="take adaptive steps with an estimated error below this")
    options.start(parser)
    parser.add_argument(
        "--form", default="direct", choices=FORMS, help="step by the method's formulas (direct) or by the transition matrix"
    )
    parser.add_argument(
        "--control",
        metavar="CONTROL",
        help="control of the energy of bodies: a gain with or without a form (0.3:printed, 0.3), a projection (scaling, nacozy), "
        "or off (default: the scene's)",
    )
    options.numbers(parser)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="write an animation (.html, .gif, .mp4), a picture (.png, .svg, .pdf) or the saved states (.csv, .npz)",
    )
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="duration of an animation (default: 10)")
    parser.add_argument("--fps", type=float, default=20.0, metavar="N", help="frames per second of an animation (default: 20)")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    chosen = scene_with(args.scene, args.set)
    ending = "" if args.output is None else args.output.suffix
    _check_output(args.output, args.seconds, args.fps)
    to_draw = ending in (*PICTURES, *ANIMATIONS)
    options: dict[str, Any] = {"control": chosen.control if args.control is None else _control(args.control)}
    options |= {"record": list(chosen.system.quantities)[:1]}
    if args.fused:
        options["fused"] = True
    if args.float32:
        options["dtype"] = "float32"
    if args.start is not None:
        options["start"] = args.start
    if args.form != "direct":
        options |= {"form": args.form, "record": ()}
    why = None if args.method is not None else _advise(args, replace(chosen, control=options["control"]))
    run = _fixed(args, chosen, to_draw, options) if args.tolerance is None else _adaptive(args, chosen, to_draw, options)
    for finding in run.findings:
        show.warn(f"stepwell: warning: {finding.message}")

    picture = run_picture(chosen, run)
    columns: dict[str, Any] = picture.columns()
    written = show.Written()
    if ending == ".npz":
        written.write(args.output, lambda path: np.savez(path, **columns))
    elif ending == ".csv":
        written.write(args.output, picture.to_csv)
    elif ending in PICTURES:
        written.write(args.output, picture.plot)
    elif ending in ANIMATIONS:
        with show.progress(f"{args.output}", args) as progress:
            written.write(args.output, lambda path: picture.animate(path, seconds=args.seconds, fps=args.fps, progress=progress))
    report = _report(picture, columns) | ({"written": written.files[0]} if written.files else {})
    if why is not None:
        report = {"verdict": report["verdict"], "scene": report["scene"], "method": report["method"], "advised": why} | report
    if args.json:
        show.print_json(report)
    else:
        show.facts(
            (SCREEN_NAMES.get(name, name.replace("_", " ")), _shown(name, value), _colour(value) if name == "verdict" else "")
            for name, value in report.items()
            if value is not None
        )
    written.close()


def _advise(args: argparse.Namespace, chosen: Scene) -> str:
    """Set the advised method, and the advised step or tolerance unless there is a step; returns why, in words."""
    given = [args.dt, args.steps, args.every, args.start]
    fixed = any(value is not None for value in given) or args.form != "direct" or args.float32
    with show.progress(f"{chosen.title}: looking for a method", args) as progress:
        row, why = advised(chosen, progress, by="tolerance" if args.tolerance is not None else "step" if fixed else None)
    args.method = row.method.name if row is not None else USUAL if args.tolerance is None else ADAPTIVE
    if row is not None and args.tolerance is None and not fixed:
        if row.tolerance is None:
            args.dt = row.dt
        else:
            args.tolerance = row.tolerance
    return why


def _colour(verdict: str) -> str:
    if verdict.startswith("bounded; "):
        return show.GOOD
    return show.DOUBTFUL if verdict.startswith("bounded") else "" if verdict == UNKNOWN else show.BAD


def _fixed(args: argparse.Namespace, chosen: Scene, to_draw: bool, options: dict[str, Any]) -> Run:
    dt = chosen.dt if args.dt is None else args.dt
    steps = chosen.steps_for(dt) if args.steps is None else args.steps
    every = max(1, steps // (SAVED_TO_DRAW if to_draw else SAVED)) if args.every is None else args.every
    return _noticing(chosen, args, dt=dt, steps=steps, every=every, **options)


def _adaptive(args: argparse.Namespace, chosen: Scene, to_draw: bool, options: dict[str, Any]) -> Run:
    """Run with adaptive steps over the horizon; the states are saved at equidistant times."""
    for option in ("steps", "every"):
        if getattr(args, option) is not None:
            raise ArgumentError(f"--{option}: works with fixed steps only; with --tolerance the steps follow the error")
    at = np.linspace(0.0, chosen.horizon, 1 + (SAVED_ADAPTIVE_TO_DRAW if to_draw else SAVED_ADAPTIVE))
    return _noticing(chosen, args, dt=args.dt, tolerance=args.tolerance, at=at, **options)


def _noticing(chosen: Scene, args: argparse.Namespace, **options: Any) -> Run:
    return noticing(Request.of(chosen.system, args.method, Options(**chosen.options_of_run(**options))))


def _shown(name: str, value: Any) -> str:
    """The value as the screen shows it, in a few digits; --json and files have all."""
    if isinstance(value, float):
        return f"{value:.{DIGITS_OF_AN_ERROR if name.endswith('error') else DIGITS}g}"
    if isinstance(value, list):
        array = np.array(value)
        if array.size > MOST_SHOWN:
            return f"{' × '.join(map(str, array.shape))} numbers; -o FILE writes them, --json prints them"
        text = np.array2string(array, precision=DIGITS, floatmode="maxprec", separator=", ", max_line_width=1000)
        return re.sub(r"\[ +", "[", text.replace("\n", ""))
    return str(value)


def _check_output(path: Path | None, seconds: float, fps: float) -> None:
    """Raise an error before any work if the file cannot be written: an unknown format, a missing program or folder."""
    if path is None:
        return
    paths.file("-o", path, (*NUMBERS, *PICTURES, *ANIMATIONS))
    if path.suffix in PICTURES:
        new_figure(1.0, 1.0)
    elif path.suffix in ANIMATIONS:
        need_for_animation(path, seconds, fps)


def _control(text: str) -> AnyControl | None:
    """Parse ``GAIN[:FORM]``, the name of a projection, or ``off``: None."""
    if text == "off":
        return None
    if text in WAYS:
        return Projection(text)
    gain, _, form = text.partition(":")
    try:
        strength = float(gain)
    except ValueError:
        raise ArgumentError(
            f"--control: expected a gain and a form, such as 0.3:printed, {', '.join(WAYS)} or off, got {text!r}"
        ) from None
    return EnergyControl(strength, cast(Any, form)) if form else EnergyControl(strength)


def _report(picture: RunPicture, columns: dict[str, Any]) -> dict[str, Any]:
    known = {name: value for name, value in picture.summary().items() if not name.startswith("largest") or value is not None}
    if (paces := picture.run.paces) is not None:
        del known["dt"]
        known["steps"] = int(paces.accepted)
        known |= {"rejected_steps": int(paces.rejected), "function_evaluations": int(paces.evaluations)}
    known = {"verdict": verdict(picture), "scene": known.pop("scene"), "method": known.pop("method")} | known
    largest = {name: known.pop(name) for name in list(known) if name.startswith("largest")}
    return known | {f"last_{name}": columns[name][-1].tolist() for name in ("t", "v", "y", "energy") if name in columns} | largest
