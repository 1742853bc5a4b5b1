"""What ``--set NAME=VALUE`` changes: an argument of the scene, a parameter of its system, or its start."""

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

#: The start of a scene.
BLOCKS = ("v", "y")


def scene_with(name: str, settings: Sequence[str]) -> Scene:
    """The scene of that name with what was set.

    An argument of the scene is set as by ``scene:NAME=VALUE``, so that its exact solution is that of the new value. Anything else
    is set in its system, or at its start; the exact solution is then not known.

    Raises:
        ArgumentError: if it is no setting, or the scene and the system have nothing of that name.
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
    """The arguments that make an equal system, by name; none if there are no such arguments."""
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
    """A number, numbers with commas between them, or a word."""
    try:
        numbers = [float(word) for word in text.strip("[]").split(",")]
    except ValueError:
        return text
    return numbers if len(numbers) > 1 else checks.number("--set", numbers[0])
