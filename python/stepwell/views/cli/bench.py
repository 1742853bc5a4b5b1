"""Time the methods on this machine.

Times a step of one member of a batch, on one thread, and compares the methods. They take turns, and for each the least time of
several repeats counts: whatever else the machine does only adds to it.
"""

from __future__ import annotations

import argparse
from typing import Any

from ... import isa
from ...errors import UnsupportedError
from ...model.methods import Method, methods
from ...runs.engine import evaluations
from ...scenes import Scene, scene
from ...studies.measuring.measure import refusal
from ...studies.measuring.timing import CHARTS, step_times
from . import options, show

COLUMNS = ("method", "ns a step>", "±>", "ns an evaluation>", "times the least>", "share of all>", "steps a second>")


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "scene",
        nargs="?",
        default="oscillator",
        metavar="SCENE",
        help="a scene (see stepwell scenes), or a Python file that makes one (default: oscillator)",
    )
    options.methods(parser)
    parser.add_argument(
        "--members",
        type=int,
        metavar="N",
        help="members (trajectories) of the batch; 1 for a single one (default: some hundreds)",
    )
    options.fused(parser)
    options.file(parser, show.TABLE_TEXT)
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    one = scene(args.scene)
    chosen = options.chosen(args) or list(methods())
    options.check_file(args, show.TABLE_FILES)
    refused = {each.name: why for each in chosen if (why := refusal(one, each)) is not None}
    able = [each for each in chosen if each.name not in refused]
    if not able:
        raise UnsupportedError("; ".join(refused.values()))
    members = CHARTS.members_of(one) if args.members is None else args.members
    timed = rows(one, able, members, args.fused)
    show.listing(
        args,
        f"{one.title}: a step of {'a single member' if members == 1 else f'one of {members} members'} on one thread, {isa()}",
        COLUMNS,
        [
            (
                row["method"],
                f"{row['ns_per_step']:.3g}",
                f"{100 * row['error']:.0f} %",
                f"{row['ns_per_evaluation']:.3g}",
                f"{row['times_the_least']:.2f}",
                f"{100 * row['share']:.0f} %",
                f"{row['steps_per_second']:.2g}",
            )
            for row in timed
        ],
        timed,
        notes=[
            f"The times are the least of {CHARTS.repeats} repeats; ± is by how much their median is above it.",
            *(f"{name} is refused: {why}" for name, why in refused.items()),
        ],
        least=("share of all", "ns an evaluation", "steps a second"),
    )


def rows(one: Scene, chosen: list[Method], members: int, fused: bool) -> list[dict[str, Any]]:
    """A row for each method, the cheapest step first. ``share`` is relative to the sum of one step by every method."""
    times = step_times(one, chosen, 0 if members == 1 else members, fused)
    least = min(each.low for each in times.values())
    whole = sum(each.low for each in times.values())
    return [
        {
            "method": each.name,
            "ns_per_step": times[each.name].low,
            "median_ns_per_step": times[each.name].median,
            "error": times[each.name].median / times[each.name].low - 1.0,
            "ns_per_evaluation": times[each.name].low / evaluations(each, one.system),
            "times_the_least": times[each.name].low / least,
            "share": times[each.name].low / whole,
            "steps_per_second": 1e9 / times[each.name].low,
        }
        for each in sorted(chosen, key=lambda each: times[each.name].low)
    ]
