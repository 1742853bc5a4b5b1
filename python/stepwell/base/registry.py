"""Tasks that lower layers leave to higher ones, by name: a run is drawn, saved and explored by modules that it does not import.

The facade registers the functions, so that each layer imports from those below it only.
"""

from __future__ import annotations

import importlib
from typing import Any

_PLACES: dict[str, str] = {}
_LOADED: dict[str, Any] = {}


def register(**places: str) -> None:
    """Set the function of each task by its module and its name, such as "stepwell.views.charts.runs:own_picture"."""
    _PLACES.update(places)


def task(name: str) -> Any:
    """The function that does a task."""
    if name not in _LOADED:
        module, function = _PLACES[name].split(":")
        _LOADED[name] = getattr(importlib.import_module(module), function)
    return _LOADED[name]
