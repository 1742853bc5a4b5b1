"""The command ``stepwell``.

A command is one file here: its docstring is its help, ``arguments`` says what it takes, and ``command`` does it.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import textwrap
from collections.abc import Sequence

from ... import __version__
from ...base import checks
from ...errors import StepwellError
from .parser import Parser
from .table import width_of_terminal

#: The commands, in the order of the help.
COMMANDS = (
    *("scenes", "methods", "run", "explore", "advise", "bench", "chart", "control", "criteria", "stability", "explain", "export"),
    *("figures", "paper"),
)

#: What a newcomer may type.
FIRST = "  stepwell run clover --method false_euler -o clover.png\n  stepwell explore"

#: Exit codes: what was asked for cannot be done; Ctrl-C, by the custom of shells.
FAILED, INTERRUPTED = 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: the words after ``stepwell``; those of the process if None.

    Returns:
        0, 2 after an error, 130 after Ctrl-C.

    Without a word it lists the commands.
    """
    parser = _parser()
    words = sys.argv[1:] if argv is None else list(argv)
    try:
        if not words:
            parser.print_help()
            return 0
        if not words[0].startswith("-"):
            checks.known("command", words[0], COMMANDS)
        args = parser.parse_args(words)
        args.command(args)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the pipe has seen enough. What is left goes nowhere, and Python's exit finds nothing to flush.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (StepwellError, OSError) as error:
        print(_wrapped(f"stepwell: {error}"), file=sys.stderr)
        return FAILED
    except MemoryError as error:  # of an allocation that no check has counted
        print(_wrapped(f"stepwell: there is not enough memory for this: {error}".rstrip(": ")), file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("stepwell: interrupted", file=sys.stderr)
        return INTERRUPTED
    return 0


def _wrapped(message: str) -> str:
    """A message in lines of the terminal, between words."""
    width = width_of_terminal(sys.stderr)
    if len(message) <= width:
        return message
    return "\n".join(textwrap.wrap(message, width, break_long_words=False, break_on_hyphens=False))


def _parser() -> argparse.ArgumentParser:
    modules = {name: importlib.import_module(f"{__name__}.{name}") for name in COMMANDS}
    texts = {name: (module.__doc__ or "").strip() for name, module in modules.items()}
    widest = max(map(len, COMMANDS))
    listed = "\n".join(f"  {name:{widest}}  {text.splitlines()[0].removesuffix('.')}" for name, text in texts.items())
    parser = Parser(
        prog="stepwell",
        usage="stepwell [--version] COMMAND …",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Simple integration algorithms: what each method costs, how wrong\nit is and where it becomes unstable.",
        epilog=f"commands:\n{listed}\n\nstepwell COMMAND --help says what a command takes. To begin with:\n{FIRST}",
    )
    parser.add_argument("--version", action="version", version=f"stepwell {__version__}")
    commands = parser.add_subparsers(prog="stepwell", required=True, metavar="COMMAND", help=argparse.SUPPRESS)
    for name, module in modules.items():
        sub = commands.add_parser(name, description=texts[name])
        module.arguments(sub)
        sub.set_defaults(command=module.command)
    return parser
