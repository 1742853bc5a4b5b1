"""``--set NAME=VALUE``: change an argument of the scene, a parameter of its system, or its start."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...base import checks
from ...errors import ArgumentError
from ...model.systems import System
from ...scenes import FILE, Scene, _arguments_of, scene

#: The blocks of the initial state.
BLOCKS = ("v", "y")


def scene_with(name: str, settings: Sequence[str]) -> Scene:
    """The scene of a name, changed by the settings.

    An argument of the scene is changed as by ``scene:NAME=VALUE``, so its exact solution changes with it. Other settings change
    the system or the start; the exact solution is then unknown.
    """
    pairs = [_pair(text) for text in settings]
    known = () if FILE.fullmatch(name) else _arguments_of(name.partition(":")[0])
    own = [f"{key}={value}" for key, value in pairs if key in known]
    changed = scene(name + ("," if ":" in name else ":") * bool(own) + ",".join(own))
    for key, value in pairs:
        if key not in known:
            changed = _changed(changed, key, value, known)
    return changed


def _pair(text: str) -> tuple[str, str]:
    key, equals, value = (part.strip() for part in text.partition("="))
    if not (key and equals and value):
        raise ArgumentError(f"--set: expected NAME=VALUE, such as omega=3, got {text!r}")
    return key, value


def _changed(scene: Scene, key: str, text: str, known: Sequence[str]) -> Scene:
    if key in BLOCKS:
        shape, value = getattr(scene, key).shape, np.array(_value(text))
        if value.dtype.kind != "f" or value.size not in (1, int(np.prod(shape))):
            raise ArgumentError(f"--set: expected {key} as one number, or as numbers of shape {shape}, got {text!r}")
        block = np.broadcast_to(value, shape) if value.ndim == 0 else value.reshape(shape)
        v, y = (block, scene.y) if key == "v" else (scene.v, block)
        return replace(scene, v=v, y=y, exact=None, until=np.inf, period=None)
    parameters = _parameters(scene.system)
    if key not in parameters:
        names = [*known, *parameters, *BLOCKS]
        raise ArgumentError(f"--set: {scene.name} has no {key!r}; known: {', '.join(dict.fromkeys(names))}")
    system = type(scene.system)(**(parameters | {key: _value(text)}))
    return replace(scene, system=system, exact=None, until=np.inf, period=None)


def _parameters(system: System) -> dict[str, Any]:
    """The arguments by which the class makes an equal system, by name; empty if attributes do not tell them."""
    names = inspect.signature(type(system)).parameters
    if not all(hasattr(system, name) for name in names):
        return {}
    parameters = {name: getattr(system, name) for name in names}
    try:
        again = type(system)(**parameters)
    except (ArgumentError, TypeError):
        return {}
    return parameters if again == system else {}


def _value(text: str) -> Any:
    """Parse a number, numbers separated by commas, or a word."""
    try:
        numbers = [float(word) for word in text.strip("[]").split(",")]
    except ValueError:
        return text
    return numbers if len(numbers) > 1 else checks.number("--set", numbers[0])
