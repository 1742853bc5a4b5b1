"""Scenes: a system, its start, a step and, where there is one, the exact solution.

Each file in ``builtin/`` is a scene and has its name, as does the function in it that makes the scene:
``stepwell.scenes.clover()`` is that of ``builtin/clover.py``. A new file needs no entry elsewhere.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache, wraps
from pathlib import Path
from types import ModuleType
from typing import Any

from ..base import checks
from ..base.arrays import Array
from ..base.immutable import same
from ..errors import ArgumentError, DTypeError, StepwellError
from . import builtin, table
from .base import Scene

__all__ = ["Scene", "scene", "scenes"]


def scenes() -> tuple[Scene, ...]:
    """Every scene with its default arguments, sorted by name.

    Example:
        >>> sw.scenes.scenes()[0]
        <scene aircraft: Aircraft in turns, dt = 0.1, horizon 20>
    """
    return tuple(make() for make in _makers().values())


def scene(name: str | Scene) -> Scene:
    """The scene of that name, or the scene of a file of your own.

    Args:
        name: the name of a scene in ``scenes``, with its default arguments or with others, as in
            ``energy_control:pair=printed,eps=0``; or a Python file that defines a ``Scene``, ``my_scene.py``, which is run. If it
            defines several, the name of the variable follows: ``my_scene.py:fast``.

    Raises:
        DTypeError: if it is neither a scene nor a name.
        UnknownNameError: if there is none; the message names the nearest.
        ArgumentError: if the file defines none, or several.

    Example:
        >>> sw.scenes.scene("kepler:e=0.5")
        <scene kepler: Kepler's ellipse, e = 0.5, dt = 0.01, horizon 18.8496>
    """
    if isinstance(name, Scene):
        return name
    if not isinstance(name, str):
        raise DTypeError(f"scene: expected a Scene or its name, got {type(name).__name__}")
    if (file := FILE.fullmatch(name)) is not None:
        return _from_file(*file.groups())
    name, _, arguments = name.partition(":")
    make = _makers()[checks.known("scene", name, _makers())]
    return make(**_arguments(name, make, arguments)) if arguments else make()


def _arguments_of(name: str) -> tuple[str, ...]:
    """The names of the arguments of a built-in scene; none if there is no scene of that name."""
    return tuple(inspect.signature(_makers()[name]).parameters) if name in _makers() else ()


def _arguments(name: str, make: Callable[..., Scene], written: str) -> dict[str, Any]:
    """The keyword arguments in a text such as ``pair=printed,eps=0``: numbers where possible, else strings."""
    arguments: dict[str, Any] = {}
    for each in written.split(","):
        key, equals, value = (part.strip() for part in each.partition("="))
        if not equals:
            raise ArgumentError(f"scene: expected arguments as {name}:NAME=VALUE,NAME=VALUE, got {each!r}")
        key = checks.known(f"scene {name}", key, inspect.signature(make).parameters)
        for kind in (int, float, str):
            try:
                arguments[key] = kind(value)
                break
            except ValueError:
                continue
    return arguments


#: A user's file, and the name of a variable in it.
FILE = re.compile(r"(.+\.py)(?::(\w+))?")


#: Modules that were loaded from such files.
_LOADED: set[str] = set()


def _from_file(path: str, variable: str | None) -> Scene:
    """The scene that a file defines: the one of that variable, or the only one."""
    module = _loaded(path)
    scenes = {key: value for key, value in vars(module).items() if isinstance(value, Scene)}
    if variable is not None:
        chosen = scenes[checks.known("scene", variable, scenes)]
        return replace(chosen, name=variable, title="") if chosen.name == "unnamed" else chosen
    if len(scenes) != 1:
        if not scenes:
            raise ArgumentError(f"scene: {path} makes no Scene; write scene = sw.Scene(system, v=…, y=…, until=…)")
        raise ArgumentError(
            f"scene: expected one Scene in {path}, got {', '.join(scenes)}; name one: {path}:{next(iter(scenes))}"
        )
    ((key, only),) = scenes.items()
    return replace(only, name=module.__name__ if key == "scene" else key, title="") if only.name == "unnamed" else only


def _loaded(path: str) -> ModuleType:
    """A file, run as a module of its name."""
    name = re.sub(r"\W", "_", Path(path).stem)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    if name not in sys.modules or name in _LOADED:
        sys.modules[name] = module  # so that its systems can be pickled
        _LOADED.add(name)
    try:
        spec.loader.exec_module(module)
    except FileNotFoundError:
        raise ArgumentError(f"scene: there is no file {checks.short(path)}") from None
    except StepwellError:
        raise
    except Exception as error:
        raise ArgumentError(f"scene: the file {path} cannot be run: {type(error).__name__}: {error}") from error
    return module


@cache
def _makers() -> dict[str, Callable[..., Scene]]:
    names = sorted(module.name for module in pkgutil.iter_modules(builtin.__path__))
    return {name: _remembering(getattr(importlib.import_module(f"{builtin.__name__}.{name}"), name)) for name in names}


def _remembering(make: Callable[..., Scene]) -> Callable[..., Scene]:
    """Wrap ``make`` so that the ``exact`` of its scenes can be pickled, as the call that made the scene."""

    @wraps(make)
    def remembering(*args: Any, **kwargs: Any) -> Scene:
        scene = make(*args, **kwargs)
        return scene if scene.exact is None else replace(scene, exact=Exact(make.__name__, args, kwargs, scene.exact))

    return remembering


class Exact:
    """The exact solution of a built-in scene; it is pickled as the call that made the scene."""

    def __init__(self, name: str, args: tuple[Any, ...], kwargs: dict[str, Any], solution: table.Exact) -> None:
        self.call, self.solution = (name, args, kwargs), solution

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Both blocks at these times."""
        return self.solution(t)

    def __getattr__(self, name: str) -> Any:
        """Other attributes are those of the solution."""
        return getattr(self.solution, name)

    def __reduce__(self) -> tuple[Any, ...]:
        return _exact, self.call

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Exact) and same(self.call, other.call)

    def __hash__(self) -> int:
        return hash(self.call[0])


def _exact(name: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> table.Exact | None:
    return _makers()[name](*args, **kwargs).exact


def __getattr__(name: str) -> Callable[..., Scene]:
    if not name.startswith("_") and name in _makers():
        return _makers()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_makers()])
