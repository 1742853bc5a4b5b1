"""Arguments that several commands have in common, and the values that they stand for."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ...base import paths
from ...base.pictures import new_figure
from ...model.methods import Method
from ...model.methods import method as find_method

#: A scene with an argument, as the help shows it.
WITH_ARGUMENT = "energy_control:pair=printed"


def scene(parser: argparse.ArgumentParser, name: str = "scene", example: str = WITH_ARGUMENT, **options: Any) -> None:
    text = f"a scene (see stepwell scenes), with arguments as in {example}; or a Python file that makes one"
    parser.add_argument(name, metavar="SCENE", help=text, **options)


def system(parser: argparse.ArgumentParser) -> None:
    text = "a scene (see stepwell scenes), a Python file that makes one, or a system by its class, such as Pendulum"
    parser.add_argument("system", metavar="SYSTEM", help=text)


def method_words(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("methods", nargs="*", metavar="METHOD", help="a method; see stepwell methods (default: all)")


def methods(parser: argparse.ArgumentParser, default: str = "all") -> None:
    parser.add_argument("--methods", metavar="A,B,…", help=f"methods, separated by commas (default: {default})")


def chosen(args: argparse.Namespace) -> list[Method] | None:
    """The methods named on the command line; None for the default."""
    words = args.methods.split(",") if isinstance(args.methods, str) else args.methods
    return [find_method(word.strip()) for word in words] if words else None


def numbers(parser: argparse.ArgumentParser) -> None:
    fused(parser)
    parser.add_argument("--float32", action="store_true", help="compute in float32 instead of float64")


def fused(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--fused", action="store_true", help="use fused multiply-adds")


def dtype(args: argparse.Namespace) -> Any:
    return "float32" if args.float32 else "float64"


def start(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--start", metavar="HOW", help="how to start a method that has several starts; see stepwell methods NAME")


def json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


# ---- files


def file(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=text)


def check_file(args: argparse.Namespace, endings: Iterable[str]) -> None:
    """Raise an error before any work if the file cannot be written."""
    if args.output is not None:
        paths.file("-o", args.output, tuple(endings))


def folder(parser: argparse.ArgumentParser, text: str = "write pictures and tables into this folder") -> None:
    """Add the option of a folder; without it nothing is written."""
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help=text)


def check_folder(args: argparse.Namespace, names: Iterable[str] = ()) -> None:
    """Raise an error before any work if these files or pictures cannot be written there."""
    if args.output is not None:
        paths.folder("-o", args.output, list(names))
        new_figure(1.0, 1.0)  # raises an error without matplotlib
