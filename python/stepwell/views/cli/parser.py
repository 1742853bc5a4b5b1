"""The parser of the command line, whose messages say what was expected."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

#: Exit code of words that cannot be understood.
WRONG = 2


class Parser(argparse.ArgumentParser):
    """A parser whose errors say what it expected, and where to find help."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.register("type", float, number)
        self.register("type", int, whole)

    def error(self, message: str) -> NoReturn:
        """End with the message and a hint at the help."""
        text = message.removeprefix("argument ").replace("the following arguments are required", "still needed")
        self.exit(WRONG, f"{self.prog}: {text}\n{self.prog} --help says what it takes.\n")


def number(text: str) -> float:
    """A number.

    Raises:
        argparse.ArgumentTypeError: what was expected.
    """
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}") from None


def whole(text: str) -> int:
    """A whole number, as 1000 or 1e3.

    Raises:
        argparse.ArgumentTypeError: what was expected.
    """
    try:
        return int(text)
    except ValueError:
        value = number(text) if text.strip().lower().count("e") == 1 else 0.5
    if not value.is_integer():
        raise argparse.ArgumentTypeError(f"expected a whole number, got {text!r}")
    return int(value)
