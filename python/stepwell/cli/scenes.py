"""List the scenes: a system, its start, a step and the exact solution."""

from __future__ import annotations

import argparse

from ..scenes import scenes
from . import show


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    show.json_option(parser)


def command(args: argparse.Namespace) -> None:
    """List the scenes."""
    if args.json:
        fields = ("name", "title", "section", "description", "error", "dt", "horizon")
        show.print_json(
            [
                {field: getattr(scene, field) for field in fields}
                | {"system": repr(scene.system), "exact": scene.exact is not None}
                for scene in scenes()
            ]
        )
        return
    show.table(
        "Scenes",
        ("scene", "section", "dt>", "horizon>", "exact", "what it is"),
        [
            (s.name, s.section, f"{s.dt:.4g}", f"{s.horizon:.4g}", "no" if s.exact is None else "yes", s.description)
            for s in scenes()
        ],
    )
