"""What lower layers ask of higher ones, by name: a run is drawn, saved and explored by modules that it does not know.

The facade registers who does it, so that imports run down only.
"""

from __future__ import annotations

import importlib
from typing import Any

_PLACES: dict[str, str] = {}
_FOUND: dict[str, Any] = {}


def register(**places: str) -> None:
    """Say which function does a task: its module and its name, as "stepwell.views.charts.runs:own_picture"."""
    _PLACES.update(places)


def task(name: str) -> Any:
    """The function that does a task."""
    if name not in _FOUND:
        module, function = _PLACES[name].split(":")
        _FOUND[name] = getattr(importlib.import_module(module), function)
    return _FOUND[name]
