"""Packages that only sweeps need, imported on first use; the error for a missing one names the command that installs it."""

from __future__ import annotations

import importlib
from typing import Any

from ...errors import UnsupportedError

#: The command that installs them.
COMMAND = 'pip install "stepwell[sweep]"'


def need(module: str) -> Any:
    """The module of that name."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise UnsupportedError(f"sweep: needs the package {package}, which is missing ({error}); {COMMAND}") from None
