"""Simple integration algorithms at the machine's speed.

``integrate`` steps one trajectory or a hundred thousand, ``World`` is the real-time loop, ``methods`` and ``method`` answer what
there is to know of a method, ``scenes`` and ``charts`` show what each method costs, how wrong it is and where it blows up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import _core, errors
from .errors import DivergenceWarning, StepwellError
from .integrate import integrate
from .methods import Method, method, methods
from .result import Run, Status
from .systems import Chain, LinearSystem, NBody, Oscillator, Sampled, Sinusoid, System
from .world import World

if TYPE_CHECKING:
    from . import charts, scenes

__version__: str = _core.__version__

__all__ = [
    "Chain",
    "DivergenceWarning",
    "LinearSystem",
    "Method",
    "NBody",
    "Oscillator",
    "Run",
    "Sampled",
    "Sinusoid",
    "Status",
    "StepwellError",
    "System",
    "World",
    "charts",
    "errors",
    "integrate",
    "isa",
    "isa_levels",
    "method",
    "methods",
    "scenes",
]


def isa() -> str:
    """The CPU level in use: the best of this machine, or the one that ``STEPWELL_ISA`` names. All give the same bits."""
    return _core.isa()


def isa_levels() -> list[str]:
    """The CPU levels that this machine has."""
    return _core.isa_levels()


def __getattr__(name: str) -> Any:
    # Scenes and charts are imported when they are first used, so that importing stepwell stays quick.
    if name in ("charts", "scenes"):
        import importlib

        return importlib.import_module(f"stepwell.{name}")
    raise AttributeError(f"module 'stepwell' has no attribute {name!r}")
