"""A run as named arrays and a description in JSON, and back: a file contains no code, and reading it runs none.

Only objects of the kinds listed here are created. A function is never stored: of an own system the name of its function and a
digest of its operations are saved, and the function must exist when the file is read.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from .. import errors
from ..base import checks
from ..base.immutable import FixedDict, Immutable
from ..errors import ArgumentError
from ..model.controllers import ControllerDefinition
from ..model.equations.definition import Definition
from ..model.equations.trace import Equations
from ..model.methods import Method
from ..model.methods import method as find_method
from ..model.own_methods import OwnMethod, as_data, of_data
from ..model.systems import System
from ..model.systems.digest import digest
from ..model.systems.own import OwnSystem
from ..runs import encounters, engine
from ..runs.occurrences import Occurrences
from ..runs.result import Run

Arrays = dict[str, Any]

#: Functions that repeat the steps of a run, by the names of its attributes; see ``Run``.
RERUNS: dict[str, Callable[..., Any]] = {
    "collision": encounters.collision,
    "encounter": encounters.of_member,
    "overshoots": encounters.overshoots,
}

#: The first key of an object of JSON; its value is the kind of the object.
KIND = "is"


def kinds(base: type[Any] = Immutable) -> dict[str, type[Any]]:
    """The subclasses of a class in stepwell, by name: those of ``Immutable`` are systems, controls, surfaces and inputs."""
    classes, todo = {}, [base]
    while todo:
        for each in todo.pop().__subclasses__():
            todo.append(each)
            if each.__module__.startswith("stepwell.") and not each.__module__.startswith("stepwell.views."):
                classes[each.__name__] = each
    return classes


class Writer:
    """Writes the description of a run, and collects its arrays in ``arrays``."""

    def __init__(self) -> None:
        self.arrays: Arrays = {}
        self._known: dict[tuple[Any, ...], tuple[str, Any]] = {}

    def text(self, run: Run) -> str:
        """The description of a run in JSON."""
        parts = {name: self._part(value, name) for name, value in vars(run).items()}
        return json.dumps(parts, ensure_ascii=False)

    def _part(self, value: Any, name: str) -> Any:
        if value is None or isinstance(value, (bool, str)) or type(value) in (int, float):
            return value
        match value:
            case np.ndarray():
                return self._array(value, name)
            case np.generic():
                return {KIND: "scalar", "array": self._array(value, name)}
            case type() if issubclass(value, Warning):
                return {KIND: "warning", "name": value.__name__}
            case np.dtype():
                return {KIND: "dtype", "name": value.str}
            case OwnMethod():
                return {KIND: "own method", "of": as_data(value)}
            case Method():
                return {KIND: "method", "name": value.name}
            case ControllerDefinition():
                return {KIND: "controller", "module": value.__module__, "name": value.__qualname__}
            case Definition():
                return {KIND: "function", "module": value.__module__, "name": value.__qualname__}
            case Equations():
                parts = {key: each for key, each in vars(value).items() if not key.startswith("_")}
                return {KIND: "equations", "parts": self._parts(parts, name)}
            case bytes():
                return {KIND: "bytes", "hex": value.hex()}
            case list():
                return {KIND: "list", "items": [self._part(each, f"{name}.{i}") for i, each in enumerate(value)]}
            case Occurrences():
                return {KIND: "occurrences", "parts": self._parts(vars(value), name)}
            case partial():
                (kind,) = (key for key, function in RERUNS.items() if function is value.func)
                return {
                    KIND: "rerun",
                    "of": kind,
                    "items": [self._part(each, f"{name}.{i}") for i, each in enumerate(value.args)],
                }
            case tuple() if type(value) is not tuple:
                fields = dict(zip(type(value)._fields, value, strict=True))  # type: ignore[attr-defined]  # a named tuple
                if isinstance(value, engine.Plan):
                    fields |= {"progress": None, "watched": None}  # they are of use during the run only
                return {KIND: type(value).__name__, "parts": self._parts(fields, name)}
            case tuple():
                return {KIND: "tuple", "items": [self._part(each, f"{name}.{i}") for i, each in enumerate(value)]}
            case dict():
                kind = "parameters" if isinstance(value, FixedDict) else "dict"
                return {KIND: kind, "parts": self._parts(value, name)}
            case Immutable():
                return self._fixed(value, name)
            case _ if callable(value):
                return {KIND: "of time", "name": name.rpartition(".")[2]}
        raise ArgumentError(f"run: expected one that can be saved, got {type(value).__name__} in {name}")

    def _parts(self, values: dict[str, Any], name: str) -> dict[str, Any]:
        return {key: self._part(each, f"{name}.{key}") for key, each in values.items()}

    def _fixed(self, value: Immutable, name: str) -> Any:
        state: Any = value.__getstate__()
        if type(value) not in kinds().values():
            raise ArgumentError(f"run: expected a system of stepwell, or of your own equations, got {type(value).__name__}")
        description = {KIND: type(value).__name__, "parts": self._parts(state, name)}
        if isinstance(value, OwnSystem) and not value.definition.__module__.startswith("stepwell."):
            description["operations"] = digest(value)
        if isinstance(value, System) and value.controller is not None:
            description["controller"] = value.controller.digest(value)
        return description

    def _array(self, value: Any, name: str) -> Any:
        """The description of an array, which is stored by its name once, and without repeated elements."""
        array = np.asarray(value)
        if array.dtype.kind not in "biuf":
            raise ArgumentError(f"run: expected numbers, got an array of dtype {array.dtype} in {name}")
        key = (array.__array_interface__["data"][0], array.shape, array.strides, array.dtype.str)
        if key not in self._known:
            self._known[key] = name, array  # the reference keeps the memory, so that no other array gets the address
            self.arrays[name] = checks.once_of(array)
        description: dict[str, Any] = {KIND: "array", "of": self._known[key][0]}
        if self.arrays[description["of"]].shape != array.shape:
            description["over"] = list(array.shape)
        return description


class Reader:
    """Reads a run from its description and arrays. ``system`` has the functions that are not found by name."""

    def __init__(self, arrays: Arrays, system: Any = None) -> None:
        self.arrays, self.system = arrays, system
        self._kinds, self._tuples = kinds(), kinds(tuple)

    def run(self, text: str) -> Run:
        """The run of a description."""
        run = Run.__new__(Run)
        vars(run).update({name: self._whole(part) for name, part in json.loads(text).items()})
        return run

    def _whole(self, part: Any) -> Any:
        if isinstance(part, list):
            return [self._whole(each) for each in part]
        if not isinstance(part, dict):
            return part
        parts = {key: self._whole(each) for key, each in part.get("parts", {}).items()}
        match part[KIND]:
            case "array":
                array = self.arrays[part["of"]]
                return np.broadcast_to(array, part["over"]) if "over" in part else array
            case "scalar":
                return self._whole(part["array"])[()]
            case "warning":
                return getattr(errors, part["name"])
            case "dtype":
                return np.dtype(part["name"])
            case "method":
                return find_method(part["name"])
            case "own method":
                return of_data(part["of"])
            case "function":
                return self._definition(part["module"], part["name"])
            case "controller":
                return self._definition(part["module"], part["name"], of_controller=True)
            case "of time":
                return self._of_time(part["name"])
            case "bytes":
                return bytes.fromhex(part["hex"])
            case "list":
                return self._whole(part["items"])
            case "tuple":
                return tuple(self._whole(part["items"]))
            case "dict":
                return parts
            case "parameters":
                return FixedDict(parts)
            case "occurrences":
                return Occurrences(**parts)
            case "rerun":
                return partial(RERUNS[part["of"]], *self._whole(part["items"]))
            case "equations":
                equations = Equations(*(parts.pop(key) for key in ("definition", "v_shape", "y_shape", "own_shapes")))
                vars(equations).update(parts)
                return equations
            case kind if kind in self._tuples:
                return self._tuples[kind](**parts)
            case kind:
                one = object.__new__(self._kinds[kind])
                one.__setstate__(parts)
                if "operations" in part:
                    self._check(one.definition.name, digest(one), part["operations"])
                if "controller" in part:
                    controller = one.controller
                    self._check(controller.name, controller.digest(one), part["controller"])
                return one

    def _definition(self, module: str, name: str, *, of_controller: bool = False) -> Definition | ControllerDefinition:
        """The definition of ``system``, or else the one of that name in a module that is imported already."""
        if of_controller and isinstance(self.system, System) and self.system.controller is not None:
            known: dict[str, ControllerDefinition] = {
                of.name: of for of in (each.definition for each in self.system.controller.each)
            }
            return known.get(name.rpartition(".")[2]) or next(iter(known.values()))
        if isinstance(self.system, Definition) and not of_controller:
            return self.system
        if isinstance(self.system, OwnSystem) and not of_controller:
            return self.system.definition
        if module.startswith("stepwell."):
            kinds()
        place: Any = sys.modules.get(module)
        for each in name.split("."):
            place = vars(place).get(each) if hasattr(place, "__dict__") else None
        if not isinstance(place, ControllerDefinition if of_controller else Definition):
            raise ArgumentError(
                f"system: the run is of equations of your own, {module}.{name}, which are not in the file and not imported; give "
                f"them, system={name.rpartition('.')[2]}"
            )
        return place

    def _of_time(self, name: str) -> Any:
        parameters = self.system.parameters_given if isinstance(self.system, OwnSystem) else {}
        if not callable(parameters.get(name)):
            raise ArgumentError(
                f"system: the parameter {name} of the run is a function of the time, which is not in the file; give the system "
                f"with it, system=…({name}=…)"
            )
        return parameters[name]

    def _check(self, name: str, now: str, then: str) -> None:
        if now != then:
            raise ArgumentError(
                f"system: {name} makes other operations now than when the run was saved, so it is another "
                f"system, or another version of stepwell; numpy.load or zarr.open read the numbers of the file by their names"
            )


def is_whole(run: Run) -> None:
    """Raise if parts of a run do not fit together, which may be so in a file of another version."""
    system: System = run.system
    repr(run)
    system.all_parameters(run.status.shape)
