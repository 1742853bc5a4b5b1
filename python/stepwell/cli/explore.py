"""Show scenes in a browser: two methods side by side, with sliders; or write that page, which needs no server."""

from __future__ import annotations

import argparse
from pathlib import Path

from .. import _checks
from ..explorer import explore
from ..explorer.page import offered
from ..scenes import scene as find_scene
from . import show


def arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument(
        "--scene", metavar="SCENE", help="the scene that is shown first, or a Python file that makes one (default: clover)"
    )
    parser.add_argument("--only", action="store_true", help="leave out all other scenes")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the page there instead of opening it: .html")
    show.json_option(parser)


def command(args: argparse.Namespace) -> None:
    """Make the page, then write or open it, and report where it is."""
    if args.output is not None:
        _checks.file("-o", args.output, (".html", ".htm"))
    chosen = offered()
    if args.scene is not None:
        first = next((each for each in chosen if each.name == args.scene), None) or find_scene(args.scene)
        others = [] if args.only else [each for each in chosen if each.name != first.name]
        chosen = [first, *others]
    page = explore(chosen)
    written = show.Written()
    if args.output is not None:
        written.write(args.output, page.save)
    else:
        written.files.append(str(page.open()))
    if args.json:
        show.print_json({"written": written.files, "scenes": [each.name for each in page.scenes]})
    else:
        print("\n".join(written.notes()))
    written.close()
