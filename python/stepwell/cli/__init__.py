"""The command ``stepwell``.

A command is one file here: its docstring is its help, ``arguments`` says what it takes, and ``command`` does it.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from .. import __version__
from ..errors import StepwellError

#: The commands, in the order of the help.
COMMANDS = (
    *("scenes", "methods", "run", "explore", "chart", "control", "criteria", "stability", "advise", "explain", "export"),
    *("figures", "paper"),
)

#: Exit codes: what was asked for cannot be done; Ctrl-C, by the custom of shells.
FAILED, INTERRUPTED = 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: the words after ``stepwell``; those of the process if None.

    Returns:
        0, 2 after an error, 130 after Ctrl-C.
    """
    args = _parser().parse_args(argv)
    try:
        args.command(args)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the pipe has seen enough. What is left goes nowhere, and Python's exit finds nothing to flush.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (StepwellError, OSError) as error:
        print(f"stepwell: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("stepwell: interrupted", file=sys.stderr)
        return INTERRUPTED
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="stepwell",
        description="Simple integration algorithms: the cost of each method, its error, and where it becomes unstable.",
    )
    parser.add_argument("--version", action="version", version=f"stepwell {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name in COMMANDS:
        module = importlib.import_module(f"{__name__}.{name}")
        text = (module.__doc__ or "").strip()
        sub = commands.add_parser(name, help=text.splitlines()[0], description=text)
        module.arguments(sub)
        sub.set_defaults(command=module.command)
    return parser
