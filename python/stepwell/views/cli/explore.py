"""Show scenes in the browser, by two methods side by side.

The page has sliders for the step and the parameters, and needs no server.
"""

from __future__ import annotations

import argparse
import sys

from ...scenes import scene as find_scene
from ..explorer import explore
from ..explorer.page import offered
from . import options, show


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--scene", metavar="SCENE", help="the scene to show first, or a Python file that makes one (default: clover)"
    )
    parser.add_argument("--only", action="store_true", help="leave out all other scenes")
    options.file(parser, "write the page to a file instead of opening it: .html")
    options.json(parser)


def command(args: argparse.Namespace) -> None:
    options.check_file(args, (".html", ".htm"))
    chosen = offered()
    if args.scene is not None:
        first = next((each for each in chosen if each.name == args.scene), None) or find_scene(args.scene)
        others = [] if args.only else [each for each in chosen if each.name != first.name]
        chosen = [first, *others]
    if sys.stderr.isatty() and not args.json:
        print("stepwell: making the page takes some seconds", file=sys.stderr)
    page = explore(chosen)
    written = show.Written()
    if args.output is not None:
        written.write(args.output, page.save)
    else:
        written.files.append(str(page.open()))
    scenes = [
        {
            "name": each["name"],
            "title": each["title"],
            "methods": [name for name in each["steps"] if name != "truth"],
            "sliders": [slider["name"] for slider in each["sliders"]],
        }
        for each in page.data["scenes"]
    ]
    if args.json:
        show.print_json({"written": written.files, "bytes": len(page.html.encode()), "scenes": scenes})
    else:
        size = f"{len(page.html.encode()) / 1000:.0f} kB"
        show.table(
            f"Scenes of the page, by {len(page.methods)} methods in all",
            ("scene", "methods>", "title", "sliders beside dt"),
            [(each["name"], str(len(each["methods"])), each["title"], ", ".join(each["sliders"]) or "none") for each in scenes],
            [f"A page of {size} for browsers since 2023; it needs no network."],
            answer=written.notes() if args.output is not None else [f"opened in the browser: {written.files[0]}"],
            least=("methods", "title"),
        )
    written.close()
