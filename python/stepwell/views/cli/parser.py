"""The parser of the command line. Its messages say what was expected."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

#: Exit code after a wrong argument.
WRONG = 2


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors say what was expected, and where the help is."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.register("type", float, number)
        self.register("type", int, whole)

    def error(self, message: str) -> NoReturn:
        """Print the message and how to get help, and exit."""
        text = message.removeprefix("argument ").replace("the following arguments are required", "missing")
        self.exit(WRONG, f"{self.prog}: {text}\n{self.prog} --help lists the options.\n")


def number(text: str) -> float:
    """Parse a number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}") from None


def whole(text: str) -> int:
    """Parse a whole number, such as 1000 or 1e3."""
    try:
        return int(text)
    except ValueError:
        value = number(text) if text.strip().lower().count("e") == 1 else 0.5
    if not value.is_integer():
        raise argparse.ArgumentTypeError(f"expected a whole number, got {text!r}")
    return int(value)
