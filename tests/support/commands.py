"""Commands as a terminal runs them."""

from __future__ import annotations

import json
from typing import Any

from stepwell.views import cli


def run_command(capsys: Any, *words: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of one command."""
    code = cli.main(list(words))
    return code, *capsys.readouterr()


def printed(capsys: Any, *words: str) -> str:
    """What a command prints that has nothing to complain of."""
    code, out, err = run_command(capsys, *words)
    assert (code, err) == (0, ""), (words, err)
    return out


def listed(capsys: Any, *words: str) -> Any:
    """What a command prints as JSON, without a word beside it."""
    return json.loads(printed(capsys, *words, "--json"))


def complaint(capsys: Any, *words: str) -> str:
    """What a command says that fails, and prints nothing else."""
    code, out, err = run_command(capsys, *words)
    assert (code, out) == (2, ""), words
    return err
