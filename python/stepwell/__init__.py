"""Simple integration algorithms at the machine's speed.

``integrate`` steps one trajectory or a hundred thousand; ``World`` is the real-time loop. ``methods`` and ``method`` describe
the methods; ``analyse``, ``stability_limit`` and ``criteria`` their stability; ``explain`` what a step computes. ``jacobian``,
``equilibria`` and ``lyapunov`` describe a system near its states. ``scenes`` and ``charts`` show the cost and error of each
method and where it becomes unstable; ``advise`` recommends one. ``explore`` shows scenes in a browser. ``load`` reads saved
runs, and ``solve_ivp`` is called as SciPy's is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import _core, errors
from .errors import AccuracyWarning, ControlWarning, DivergenceWarning, EventWarning, StepwellError, ToleranceWarning

if TYPE_CHECKING:
    from . import (
        advice,
        charts,
        derivatives,
        dynamics,
        equations,
        explanation,
        explorer,
        exports,
        paper,
        quaternion,
        scenes,
        stability,
        sweeps,
    )
    from .advice import advise
    from .contact import Floor, Sphere
    from .control import Control, EnergyControl, LengthControl, NormControl, Projection
    from .dynamics import equilibria, jacobian, lyapunov
    from .equations import system
    from .events import Event
    from .explanation import Explanation, explain
    from .explorer import Explorer, explore
    from .exports import ExportedStep, export
    from .integration import integrate
    from .interop.saving import load
    from .interop.solve_ivp import solve_ivp
    from .method_records import Method, method, methods
    from .result import Run, Status
    from .scenes import Scene
    from .stability import analyse, criteria, stability_along, stability_limit
    from .sweeps import sweep
    from .systems import (
        Aircraft,
        Chain,
        LinearSystem,
        NBody,
        Oscillator,
        Particles,
        Pendulum,
        Pendulum3D,
        RestrictedThreeBody,
        RigidBody,
        Rods,
        Sampled,
        Sinusoid,
        Springs,
        System,
    )
    from .world import World

__version__: str = _core.__version__

__all__ = [
    "AccuracyWarning",
    "Aircraft",
    "Chain",
    "Control",
    "ControlWarning",
    "DivergenceWarning",
    "EnergyControl",
    "Event",
    "EventWarning",
    "Explanation",
    "Explorer",
    "ExportedStep",
    "Floor",
    "LengthControl",
    "LinearSystem",
    "Method",
    "NBody",
    "NormControl",
    "Oscillator",
    "Particles",
    "Pendulum",
    "Pendulum3D",
    "Projection",
    "RestrictedThreeBody",
    "RigidBody",
    "Rods",
    "Run",
    "Sampled",
    "Scene",
    "Sinusoid",
    "Sphere",
    "Springs",
    "Status",
    "StepwellError",
    "System",
    "ToleranceWarning",
    "World",
    "__version__",
    "advice",
    "advise",
    "analyse",
    "charts",
    "criteria",
    "derivatives",
    "dynamics",
    "equations",
    "equilibria",
    "errors",
    "explain",
    "explanation",
    "explore",
    "explorer",
    "export",
    "exports",
    "integrate",
    "isa",
    "isa_levels",
    "jacobian",
    "load",
    "lyapunov",
    "method",
    "methods",
    "paper",
    "quaternion",
    "scenes",
    "solve_ivp",
    "stability",
    "stability_along",
    "stability_limit",
    "sweep",
    "sweeps",
    "system",
]


def isa() -> str:
    """The CPU level in use: the best of this machine, or the one that ``STEPWELL_KERNELS`` names. All give the same bits.

    At ``interpret`` steps are interpreted; at the others they become machine code.

    Example:
        >>> sw.isa() in sw.isa_levels()
        True
    """
    return _core.isa()


def isa_levels() -> list[str]:
    """The CPU levels that this machine has.

    Example:
        >>> "interpret" in sw.isa_levels()
        True
    """
    return _core.isa_levels()


#: Modules that are attributes, and are imported on first use, so that importing stepwell stays fast. ``gym`` needs gymnasium, so
#: it is not among the names that are listed.
_MODULES = {
    "advice",
    "charts",
    "derivatives",
    "dynamics",
    "equations",
    "explanation",
    "explorer",
    "exports",
    "gym",
    "paper",
    "quaternion",
    "scenes",
    "stability",
    "sweeps",
}

#: The other names that are imported on first use, by the modules that define them; those that are not here are of ``systems``.
_NAMES = {
    "advice": "advise",
    "contact": "Floor Sphere",
    "control": "Control EnergyControl LengthControl NormControl Projection",
    "dynamics": "equilibria jacobian lyapunov",
    "equations": "system",
    "events": "Event",
    "explanation": "Explanation explain",
    "explorer": "Explorer explore",
    "exports": "ExportedStep export",
    "integration": "integrate",
    "interop.saving": "load",
    "interop.solve_ivp": "solve_ivp",
    "method_records": "Method method methods",
    "result": "Run Status",
    "scenes": "Scene",
    "stability": "analyse criteria stability_along stability_limit",
    "sweeps": "sweep",
    "world": "World",
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names.split()}


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:  # to which any name would else be one of the package

    def __getattr__(name: str) -> Any:
        import importlib

        if name in _MODULES:
            return importlib.import_module(f"stepwell.{name}")
        if name not in __all__:
            raise AttributeError(f"module 'stepwell' has no attribute {name!r}")
        module = importlib.import_module(f"stepwell.{_MODULE_OF.get(name, 'systems')}")
        # Kept, so that the next use is as quick as that of any attribute.
        found = globals()[name] = getattr(module, name)
        return found
