"""Scenes: a system, its start, a step and, where there is one, the exact solution.

A file in ``builtin/`` is a scene: its name is the scene's name, and it holds a function of that name that makes the
scene. So ``stepwell.scenes.clover()`` is made by ``builtin/clover.py``, and nothing else needs to know of it.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from functools import cache

from .. import _checks
from . import builtin
from .base import Scene

__all__ = ["Scene", "scene", "scenes"]


def scenes() -> tuple[Scene, ...]:
    """Every scene as it is made without arguments, by name."""
    return tuple(make() for make in _makers().values())


def scene(name: str | Scene) -> Scene:
    """The scene of that name, as it is made without arguments.

    Raises:
        UnknownNameError: if there is none; the message names the nearest.
    """
    if isinstance(name, Scene):
        return name
    return _makers()[_checks.known("scene", name, _makers())]()


@cache
def _makers() -> dict[str, Callable[..., Scene]]:
    names = sorted(module.name for module in pkgutil.iter_modules(builtin.__path__))
    return {name: getattr(importlib.import_module(f"{builtin.__name__}.{name}"), name) for name in names}


def __getattr__(name: str) -> Callable[..., Scene]:
    if not name.startswith("_") and name in _makers():
        return _makers()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_makers()])
