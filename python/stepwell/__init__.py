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
from .base import registry
from .errors import AccuracyWarning, ControlWarning, DivergenceWarning, EventWarning, StepwellError, ToleranceWarning

if TYPE_CHECKING:
    from . import scenes
    from .analysis import derivatives, dynamics, stability
    from .analysis.dynamics import equilibria, jacobian, lyapunov
    from .analysis.stability import analyse, criteria, stability_along, stability_limit
    from .interop.saving import load
    from .interop.solve_ivp import solve_ivp
    from .model import equations, quaternion
    from .model.controls import Control, EnergyControl, LengthControl, NormControl, Projection
    from .model.equations import system
    from .model.methods import Method, method, methods
    from .model.surfaces import Floor, Sphere
    from .model.systems import (
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
    from .runs.events import Event
    from .runs.integration import integrate
    from .runs.result import Run, Status
    from .runs.world import World
    from .scenes import Scene
    from .source import explanation, exports
    from .source.explanation import Explanation, explain
    from .source.exports import ExportedStep, export
    from .studies import advice, sweeps
    from .studies.advice import advise
    from .studies.sweeps import sweep
    from .views import charts, explorer, paper
    from .views.explorer import Explorer, explore

registry.register(
    animate_run="stepwell.views.charts.runs_animation:animate",
    draw_advice="stepwell.views.charts.advice_picture:draw",
    draw_control="stepwell.views.charts.control_picture:draw",
    draw_curves="stepwell.views.charts.zplane_picture:curves",
    draw_eigenvalues="stepwell.views.charts.roots_picture:draw",
    draw_figure="stepwell.views.charts.figures_picture:one",
    draw_figures="stepwell.views.charts.figures_picture:overview",
    draw_harmonic_figures="stepwell.views.charts.figures_picture:harmonic",
    draw_lengths="stepwell.views.charts.length_picture:draw",
    draw_loci="stepwell.views.charts.zplane_picture:loci",
    draw_map="stepwell.views.charts.map_picture:draw",
    draw_norm="stepwell.views.charts.norm_picture:draw",
    draw_panel="stepwell.views.charts.panel_picture:draw",
    draw_powers="stepwell.views.charts.powers_picture:draw",
    draw_run="stepwell.views.charts.runs_picture:draw",
    draw_verlet_friction="stepwell.views.charts.verlet_friction_picture:draw",
    draw_work_precision="stepwell.views.charts.picture:draw",
    explore="stepwell.views.explorer.page:explore",
    growth_of="stepwell.analysis.growth:finding_of",
    held_by_stability="stepwell.analysis.stiffness:held_by_stability",
    own_system="stepwell.model.systems.own:OwnSystem",
    picture_of_run="stepwell.views.charts.runs:own_picture",
    run_to_dataframe="stepwell.interop.tables:to_dataframe",
    run_to_xarray="stepwell.interop.tables:to_xarray",
    safe_step="stepwell.analysis.stability.nets:safe_step",
    save_run="stepwell.interop.saving:save",
    watched_for_growth="stepwell.analysis.growth:watched",
)

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
    "advice": "studies.advice",
    "charts": "views.charts",
    "derivatives": "analysis.derivatives",
    "dynamics": "analysis.dynamics",
    "equations": "model.equations",
    "explanation": "source.explanation",
    "explorer": "views.explorer",
    "exports": "source.exports",
    "gym": "interop.gym",
    "paper": "views.paper",
    "quaternion": "model.quaternion",
    "scenes": "scenes",
    "stability": "analysis.stability",
    "sweeps": "studies.sweeps",
}

#: The other names that are imported on first use, by the modules that define them; those that are not here are of ``systems``.
_NAMES = {
    "studies.advice": "advise",
    "model.surfaces": "Floor Sphere",
    "model.controls": "Control EnergyControl LengthControl NormControl Projection",
    "analysis.dynamics": "equilibria jacobian lyapunov",
    "model.equations": "system",
    "runs.events": "Event",
    "source.explanation": "Explanation explain",
    "views.explorer": "Explorer explore",
    "source.exports": "ExportedStep export",
    "runs.integration": "integrate",
    "interop.saving": "load",
    "interop.solve_ivp": "solve_ivp",
    "model.methods": "Method method methods",
    "runs.result": "Run Status",
    "scenes": "Scene",
    "analysis.stability": "analyse criteria stability_along stability_limit",
    "studies.sweeps": "sweep",
    "runs.world": "World",
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names.split()}


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:  # to which any name would else be one of the package

    def __getattr__(name: str) -> Any:
        import importlib

        if name in _MODULES:
            return importlib.import_module(f"stepwell.{_MODULES[name]}")
        if name not in __all__:
            raise AttributeError(f"module 'stepwell' has no attribute {name!r}")
        module = importlib.import_module(f"stepwell.{_MODULE_OF.get(name, 'model.systems')}")
        # Kept, so that the next use is as quick as that of any attribute.
        found = globals()[name] = getattr(module, name)
        return found
