"""Packages that only sweeps need: imported on first use; one that is missing is an error that names the command."""

from __future__ import annotations

import importlib
from typing import Any

from ...errors import UnsupportedError

#: What to install.
COMMAND = 'pip install "stepwell[sweep]"'


def need(module: str) -> Any:
    """The module of that name.

    Raises:
        UnsupportedError: if its package is missing.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise UnsupportedError(f"sweep: needs the package {package}, which is missing ({error}); {COMMAND}") from None
