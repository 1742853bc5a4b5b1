"""Optional packages: imported on first use; the error names the package where it is missing."""

from __future__ import annotations

import importlib
from typing import Any

from ..errors import UnsupportedError

#: Packages, and the extra that installs them.
EXTRAS = {"xarray": "tables", "pandas": "tables", "zarr": "zarr", "gymnasium": "gym", "pyopencl": "gpu"}


def imported(package: str, what: str) -> Any:
    """The module of a package that ``what`` needs.

    Raises:
        UnsupportedError: if the package is not installed; the message has the command that installs it.
    """
    try:
        return importlib.import_module(package)
    except ImportError:
        raise UnsupportedError(
            f"{what}: needs {package}, which is not installed; pip install 'stepwell[{EXTRAS[package]}]'"
        ) from None
