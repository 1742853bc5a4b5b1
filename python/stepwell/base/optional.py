"""Packages that are needed for one thing only: imported when it is used, and named in the error where they are missing."""

from __future__ import annotations

import importlib
from typing import Any

from ..errors import UnsupportedError

#: Packages, and the extra that has them.
EXTRAS = {"xarray": "tables", "pandas": "tables", "zarr": "zarr", "gymnasium": "gym"}


def imported(package: str, what: str) -> Any:
    """A package that ``what`` needs.

    Raises:
        UnsupportedError: if it is not installed, with the command that installs it.
    """
    try:
        return importlib.import_module(package)
    except ImportError:
        raise UnsupportedError(
            f"{what}: needs {package}, which is not installed; pip install 'stepwell[{EXTRAS[package]}]'"
        ) from None
