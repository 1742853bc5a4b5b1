"""The command ``stepwell``.

Each command is a file here: its docstring is its help text, ``arguments`` adds its arguments to a parser, ``command`` runs it.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from ... import __version__
from ...base import checks, streams
from ...errors import StepwellError
from . import show
from .parser import Parser

#: The commands, in the order of the help.
COMMANDS = (
    *("scenes", "methods", "run", "explore", "advise", "bench", "chart", "control", "criteria", "stability", "explain", "export"),
    *("figures", "paper"),
)

#: The commands that the help shows to newcomers.
EXAMPLES = "  stepwell explore\n  stepwell run double_pendulum -o swing.html"

#: Exit codes: an error; Ctrl-C, as shells have it.
FAILED, INTERRUPTED = 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: the words after ``stepwell``; None for those of this process.

    Returns:
        0, 2 after an error, 130 after Ctrl-C.

    Without arguments it prints the list of commands.
    """
    streams.write_utf8()
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
    except (StepwellError, OSError) as error:
        if isinstance(error, OSError) and streams.reader_is_gone(error):
            # The rest of the output is discarded, or Python would fail to flush it at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        show.warn(f"stepwell: {error}")
        return FAILED
    except MemoryError as error:  # an allocation that no check foresaw
        show.warn(f"stepwell: there is not enough memory for this: {error}".rstrip(": "))
        return FAILED
    except KeyboardInterrupt:
        print("stepwell: interrupted", file=sys.stderr)
        return INTERRUPTED
    return 0


def _parser() -> argparse.ArgumentParser:
    modules = {name: importlib.import_module(f"{__name__}.{name}") for name in COMMANDS}
    texts = {name: (module.__doc__ or "").strip() for name, module in modules.items()}
    widest = max(map(len, COMMANDS))
    listed = "\n".join(f"  {name:{widest}}  {text.splitlines()[0].removesuffix('.')}" for name, text in texts.items())
    parser = Parser(
        prog="stepwell",
        usage="stepwell [--version] COMMAND …",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Integrate equations of motion, and see what each method costs and gets wrong.",
        epilog=f"commands:\n{listed}\n\nstepwell COMMAND --help lists the options of a command. To begin with:\n{EXAMPLES}",
    )
    parser.add_argument("--version", action="version", version=f"stepwell {__version__}")
    commands = parser.add_subparsers(prog="stepwell", required=True, metavar="COMMAND", help=argparse.SUPPRESS)
    for name, module in modules.items():
        sub = commands.add_parser(name, description=texts[name])
        module.arguments(sub)
        sub.set_defaults(command=module.command)
    return parser
