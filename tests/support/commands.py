"""Commands as a terminal runs them."""

from __future__ import annotations

from typing import Any

from stepwell.views import cli


def run_command(capsys: Any, *words: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of one command."""
    code = cli.main(list(words))
    return code, *capsys.readouterr()
