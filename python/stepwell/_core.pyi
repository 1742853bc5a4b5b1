"""The Rust core: arrays in, arrays out. Everything is checked before it gets here; use ``stepwell``, not this.

Arrays are C-contiguous. Rows are arrays of two axes: what is counted, and the members, or 1 where all members have it in common.
Plans, pacings and their arrays are read by the names of their attributes, which stand in ``engine.py``.
"""

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from .engine import Arrays, PacedArrays, Pacing, Plan

__all__ = ["ModelSpec", "World", "__version__", "adapt", "catalogue", "isa", "isa_levels", "run", "systems"]
__version__: str

@final
class ModelSpec:
    """What to step: a system, what is given for it, and a method.

    ``given`` is a list of names with words (str), whole numbers (int), rows of numbers (NDArray), or tables of samples: a tuple
    (start, interval, rows), a row for each sample. A sinusoid ``x`` is given as ``x.amplitude``, ``x.omega`` and ``x.phase``, a
    constant one as the one row ``x``, a sampled one as the table ``x``; a list ``inputs`` of them as the whole number ``inputs``
    and ``inputs[0]``, ``inputs[1]``, … What is not there is left out.

    ``control`` is "energy" (with ``control.form``, ``control.gain``, ``control.target``) or "projection" (``control.way``,
    ``control.target``).

    ``matrix`` is the nodes and the number of rows in the v slot, for the transition-matrix form of the system "matrix": ``n`` and
    ``n_v`` (whole), ``p`` (n·n rows, row by row), ``q`` (n rows for each node and, within it, each input), ``inputs``.
    """

    def __new__(
        cls,
        system: str,
        method: str,
        given: list[tuple[str, Any]],
        *,
        matrix: tuple[list[float], int] | None = None,
        record: list[str] = ...,
    ) -> ModelSpec: ...

@final
class World:
    """Of the plan it reads ``t0``, ``dt``, ``choice``, ``first`` and ``members``."""

    def __new__(cls, model: ModelSpec, plan: Plan, v: NDArray[np.float64], y: NDArray[np.float64]) -> World: ...
    def step(self, n: int = 1) -> None: ...
    @property
    def t(self) -> float: ...
    @property
    def step_number(self) -> int: ...

def catalogue() -> list[dict[str, Any]]: ...
def systems() -> list[str]: ...
def isa() -> str: ...
def isa_levels() -> list[str]: ...
def run(model: ModelSpec, plan: Plan, arrays: Arrays) -> None:
    """Of the plan it reads ``t0``, ``dt``, ``choice``, ``first``, ``steps``, ``every``, ``threads`` and ``progress``."""

def adapt(model: ModelSpec, plan: Plan, pacing: Pacing, arrays: PacedArrays) -> None:
    """Of the plan it reads ``t0``, ``threads`` and ``progress``; of the pacing everything."""
