"""Tasks for other processes, pickled by cloudpickle. Own equations of a script or a notebook are pickled by their code."""

from __future__ import annotations

import io
import pickle
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from ...errors import ArgumentError
from ...model.equations.definition import Definition
from ...model.equations.invariants import Invariant
from .axes import Chunk
from .extras import need
from .task import Done, Task, run

#: The number of tasks that a process caches; all chunks of a sweep have the same task.
REMEMBERED_TASKS = 4


def packed(task: Task) -> bytes:
    """Pickle a task for other processes."""
    cloudpickle = need("cloudpickle")

    class Pickler(cloudpickle.Pickler):  # type: ignore[misc, name-defined]
        def reducer_override(self, obj: Any) -> Any:
            if isinstance(obj, Definition) and not _found_by_name(obj):
                options = (obj.order, obj.blocks, obj.shape, obj.quick_sines, obj.scale)
                return _defined, (obj.function, options, obj.__module__, obj.__qualname__, list(obj.invariants.values()))
            return super().reducer_override(obj)

    file = io.BytesIO()
    try:
        Pickler(file).dump(task)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise ArgumentError(
            f"engine: the system and the outcomes must be pickled for other processes, but one of them cannot be: {error}; "
            f"threads, the default, need no pickling"
        ) from None
    return file.getvalue()


def _found_by_name(definition: Definition) -> bool:
    """True if another process can import the definition by name; it cannot import the script that was started."""
    if definition.__module__ == "__main__":
        return False
    value: Any = sys.modules.get(definition.__module__)
    for part in definition.__qualname__.split("."):
        value = getattr(value, part, None)
    return value is definition


def _defined(
    function: Callable[..., Any], options: tuple[Any, ...], module: str, qualified: str, invariants: list[Invariant]
) -> Definition:
    """Create a definition again, in another process."""
    definition = Definition(function, *options)
    definition.__module__, definition.__qualname__ = module, qualified
    definition.invariants = {each.name: each for each in invariants}
    return definition


@lru_cache(REMEMBERED_TASKS)
def _task(package: bytes) -> Task:
    """Unpickle a task. Each process does so only once, so its system is traced and its kernels are compiled only once."""
    task = pickle.loads(package)
    assert isinstance(task, Task)
    return task


def sweep_chunk(package: bytes, values: dict[str, Any], chunk: Chunk) -> tuple[Chunk, Done]:
    """Compute a chunk of members in another process. Dask shows chunks under this name."""
    return chunk, run(_task(package), values, chunk.members)
