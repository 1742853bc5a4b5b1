"""Arguments that several commands take, and the values that they stand for."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ...base import checks
from ...base.pictures import new_figure
from ...model.methods import Method
from ...model.methods import method as find_method

PRINTED = "energy_control:pair=printed"


def scene(parser: argparse.ArgumentParser, name: str = "scene", example: str = PRINTED, **options: Any) -> None:
    text = f"a scene (see stepwell scenes), with arguments as in {example}, or a Python file that makes one"
    parser.add_argument(name, metavar="SCENE", help=text, **options)


def system(parser: argparse.ArgumentParser) -> None:
    text = "a scene (see stepwell scenes), a Python file that makes one, or a system by its class, such as Pendulum"
    parser.add_argument("system", metavar="SYSTEM", help=text)


def method_words(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("methods", nargs="*", metavar="METHOD", help="a method; see stepwell methods (default: all)")


def methods(parser: argparse.ArgumentParser, default: str = "all") -> None:
    parser.add_argument("--methods", metavar="A,B,…", help=f"which methods (default: {default})")


def chosen(args: argparse.Namespace) -> list[Method] | None:
    """The methods of ``method_words`` or ``methods``, or None.

    Raises:
        UnknownNameError: if there is none of such a name.
    """
    words = args.methods.split(",") if isinstance(args.methods, str) else args.methods
    return [find_method(word.strip()) for word in words] if words else None


def numbers(parser: argparse.ArgumentParser) -> None:
    fused(parser)
    parser.add_argument("--float32", action="store_true", help="in float32, with half the digits")


def fused(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--fused", action="store_true", help="with fused multiply-adds")


def dtype(args: argparse.Namespace) -> Any:
    return "float32" if args.float32 else "float64"


def start(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--start", metavar="HOW", help="how a method with a choice starts; see stepwell methods NAME")


def json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


# ---- files


def file(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=text)


def check_file(args: argparse.Namespace, endings: Iterable[str]) -> None:
    """Raise if the file cannot be written, before any work is done."""
    if args.output is not None:
        checks.file("-o", args.output, tuple(endings))


def folder(parser: argparse.ArgumentParser, text: str = "", *, here: bool = False) -> None:
    """A folder for pictures and numbers; the one where the command runs by default, or none."""
    text = text or "a folder for what is drawn and written (default: this one)"
    parser.add_argument("-o", "--output", type=Path, default=Path() if here else None, metavar="DIR", help=text)


def check_folder(args: argparse.Namespace, names: Iterable[str] = ()) -> None:
    """Raise if these files or no pictures can be made there, before any work is done."""
    if args.output is not None:
        checks.folder("-o", args.output, list(names))
        new_figure(1.0, 1.0)  # raises if there can be no picture
