"""List the scenes.

A scene is a system with an initial state, a step and, where it is known, the exact solution.
"""

from __future__ import annotations

import argparse

from ...scenes import scenes
from . import options, show
from .show import HOFFMANN, section


def arguments(parser: argparse.ArgumentParser) -> None:
    options.file(parser, show.TABLE_TEXT)
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    fields = ("name", "title", "section", "description", "error", "dt", "horizon")
    listed = scenes()
    show.listing(
        args,
        "Scenes",
        ("scene", "dt>", "horizon>", "exact", HOFFMANN, "what it is"),
        [
            (s.name, f"{s.dt:.4g}", f"{s.horizon:.4g}", "no" if s.exact is None else "yes", section(s.section), s.description)
            for s in listed
        ],
        [
            {field: getattr(scene, field) for field in fields} | {"system": repr(scene.system), "exact": scene.exact is not None}
            for scene in listed
        ],
        ["exact: whether the exact solution is known."],
        least=(HOFFMANN, "exact", "dt", "horizon"),
    )
