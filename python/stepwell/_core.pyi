"""The Rust core: arrays in, arrays out. Everything is checked before it gets here; use ``stepwell``, not this."""

from collections.abc import Callable
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["ModelSpec", "World", "__version__", "adapt", "catalogue", "isa", "isa_levels", "run", "saves", "systems"]
__version__: str

@final
class ModelSpec:
    def __new__(
        cls,
        system: str,
        options: list[str],
        sizes: list[int],
        rows: list[NDArray[np.float64]],
        tables: list[tuple[float, float, NDArray[np.float64]]],
        method: str,
        matrix: tuple[list[float], int] | None = None,
        record: list[str] = ...,
    ) -> ModelSpec: ...

@final
class World:
    def __new__(
        cls,
        model: ModelSpec,
        *,
        t0: float,
        dt: float,
        start: int,
        first: int,
        members: int,
        v: NDArray[np.float64],
        y: NDArray[np.float64],
    ) -> World: ...
    def step(self, n: int = 1) -> None: ...
    @property
    def t(self) -> float: ...
    @property
    def step_number(self) -> int: ...

def catalogue() -> list[dict[str, Any]]: ...
def systems() -> list[str]: ...
def isa() -> str: ...
def isa_levels() -> list[str]: ...
def saves(steps: int, every: int | None) -> list[int]: ...
def run(
    model: ModelSpec,
    *,
    t0: float,
    dt: float,
    start: int,
    first: int,
    steps: int,
    every: int | None,
    threads: int,
    carried: bool,
    v: NDArray[np.float64],
    y: NDArray[np.float64],
    saved_v: NDArray[np.float64],
    saved_y: NDArray[np.float64],
    recorded: NDArray[np.float64],
    tally: NDArray[np.float64],
    carry: NDArray[np.float64],
    first_bad: NDArray[np.int64],
    progress: Callable[[float], object] | None,
) -> None: ...
def adapt(
    model: ModelSpec,
    *,
    t0: float,
    at: list[float],
    first: NDArray[np.float64],
    relative: NDArray[np.float64],
    absolute: NDArray[np.float64],
    budget: int,
    threads: int,
    v: NDArray[np.float64],
    y: NDArray[np.float64],
    saved_v: NDArray[np.float64],
    saved_y: NDArray[np.float64],
    reached: NDArray[np.float64],
    counts: NDArray[np.int64],
    progress: Callable[[float], object] | None,
) -> None: ...
