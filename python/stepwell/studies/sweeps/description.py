"""The description of a sweep: the attributes of its result, and those by which two sweeps differ."""

from __future__ import annotations

import json
from functools import partial
from hashlib import blake2b
from typing import Any

import numpy as np

from ... import _core
from ...base.reprs import counted
from ...model.systems import System
from ...runs.events import Event
from .axes import Grid
from .layout import Layout, coordinates
from .outcomes import History, Outcome
from .stores import SWEEP
from .task import Task


def layout_of(task: Task, grid: Grid, system: System, bits: str, units: dict[str, str]) -> Layout:
    """The layout of the results of a task, and its description in attributes; ``bits`` is a hash of the first steps."""
    coords = coordinates(grid, units)
    renamed = {"t": "saved"} if grid.of_dt else {}
    if task.kinds(History):
        coords["t"] = _times(task, grid, renamed, units)
    identity: dict[str, Any] = {
        "stepwell": str(_core.__version__),
        "system": system.kind_name,
        "method": task.method.key,
        "steps": task.steps,
        "transient": task.transient,
        "observe": task.observe,
        "every": task.every,
        "outcomes": [_identity(each) for each in task.outcomes],
        "axes": {axis.argument: f"along {', '.join(axis.dims)}: {_digest(axis.values)}" for axis in grid.axes},
        "given": {name: _digest(value) for name, value in task.options.items() if name not in ("threads", "device")},
        "first steps": bits,
    }
    if "events" in task.options:
        identity["given"]["events"] = [_identity(each) for each in task.options["events"]]
    if task.at is not None:
        identity["at"] = _digest(task.at)
    attrs: dict[str, Any] = {
        "title": f"{system.kind_name} by {task.method.title}: a sweep of {counted(grid.members, 'member')}",
        "stepwell_version": str(_core.__version__),
        "numpy_version": np.__version__,
        "system": repr(task.system) if isinstance(task.system, System) else system.kind_name,
        "method": task.method.name,
        **_step_facts(task, grid),
        "t0": task.options["t0"],
        "fused": int(task.options["fused"]),
        **({"dtype": "float32"} if task.single else {}),
        **({} if task.every is None else {"every": task.every}),
        **({"control": repr(task.options["control"])} if "control" in task.options else {}),
        SWEEP: json.dumps(identity, ensure_ascii=False),
    }
    return Layout(grid, coords, attrs, units, renamed)


def _step_facts(task: Task, grid: Grid) -> dict[str, Any]:
    if task.at is None:
        dt = {} if grid.of_dt else {"dt": task.options["dt"]}
        return {**dt, "steps": task.steps, "transient": task.transient, "observe": task.observe}
    facts: dict[str, Any] = {name: task.options[name] for name in ("dt", "max_steps") if name in task.options}
    if (tolerance := task.options.get("tolerance")) is not None:
        facts["tolerance"] = repr(tolerance) if isinstance(tolerance, tuple) else float(tolerance)
    return facts | {"end": float(task.at[-1])}


def _times(
    task: Task, grid: Grid, renamed: dict[str, str], units: dict[str, str]
) -> tuple[tuple[str, ...], np.ndarray[Any, Any], dict[str, Any]]:
    """Times of the states of a history, by the formula of the core: t0 + k·dt."""
    attrs = {"long_name": "time", **({"units": units["t"]} if "t" in units else {})}
    if task.at is not None:
        return ("t",), task.at, attrs
    every = task.every or task.steps
    k = task.transient + np.append(np.arange(0, task.steps, every), task.steps).astype(np.float64)
    if not grid.of_dt:
        return ("t",), task.options["t0"] + k * task.rounded(np.asarray(task.options["dt"])), attrs
    axis = next(axis for axis in grid.axes if axis.argument == "dt")
    return (*axis.dims, renamed["t"]), task.options["t0"] + k * task.rounded(axis.values)[..., np.newaxis], attrs


def _digest(value: Any) -> str:
    """A value in words: a number itself, an array by its hash."""
    if isinstance(value, (str, bool, int, float, type(None))):
        return repr(value)
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return repr(value)
    return f"{array.shape} {blake2b(np.ascontiguousarray(array).tobytes(), digest_size=8).hexdigest()}"


def _identity(value: Any) -> Any:
    """An outcome in words that are the same in every process; a function by its name and its instructions."""
    if isinstance(value, Event):
        return {name: _identity(part) for name, part in vars(value).items()}
    if isinstance(value, Outcome):
        return {"kind": type(value).__name__, **{name: _identity(each) for name, each in vars(value).items()}}
    if isinstance(value, partial):
        return [_identity(value.func), repr(value.args), repr(value.keywords)]
    code = getattr(value, "__code__", None)
    if code is not None:
        plain = [each for each in code.co_consts if not hasattr(each, "co_code")]
        digest = blake2b(code.co_code + repr((code.co_names, plain)).encode(), digest_size=8)
        return f"{value.__qualname__} {digest.hexdigest()}"
    if callable(value):
        return getattr(value, "__qualname__", type(value).__qualname__)
    return [_identity(each) for each in value] if isinstance(value, tuple) else value
