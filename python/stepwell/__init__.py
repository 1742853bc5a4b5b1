"""Simple integration algorithms at the machine's speed.

``integrate`` steps one trajectory or a hundred thousand; ``World`` is the real-time loop. ``methods`` and ``method`` describe
the methods; ``analyse``, ``stability_limit`` and ``criteria`` their stability; ``explain`` what a step computes. ``jacobian``,
``equilibria`` and ``lyapunov`` describe a system near its states. ``scenes`` and ``charts`` show the cost and error of each
method and where it becomes unstable; ``advise`` recommends one. ``explore`` shows scenes in a browser. ``load`` reads saved
runs, and ``solve_ivp`` is called as SciPy's is.
"""

from __future__ import annotations

from typing import Any

from . import _core
from .base import registry

registry.register(
    algebraic_lost="stepwell.analysis.consistency:lost",
    algebraic_rates="stepwell.analysis.consistency:rates",
    algebraic_start="stepwell.analysis.consistency:check_start",
    animate_run="stepwell.views.charts.runs_animation:animate",
    draw_advice="stepwell.views.charts.advice_picture:draw",
    derivatives_of_rates="stepwell.model.derivatives.traced:of_rates",
    draw_bode="stepwell.views.charts.bode_picture:draw",
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
    draw_run="stepwell.views.charts.runs_picture:draw",
    draw_verlet_friction="stepwell.views.charts.verlet_friction_picture:draw",
    draw_work_precision="stepwell.views.charts.picture:draw",
    explore="stepwell.views.explorer.page:explore",
    growth_factors="stepwell.analysis.growth:Factors",
    oscillator_limit="stepwell.analysis.stability.kept:oscillator_limit",
    own_method="stepwell.model.own_methods:own_method",
    own_system="stepwell.model.systems.own:OwnSystem",
    picture_of_run="stepwell.views.charts.runs:own_picture",
    run_to_dataframe="stepwell.interop.tables:to_dataframe",
    run_to_xarray="stepwell.interop.tables:to_xarray",
    safe_step="stepwell.analysis.stability.nets:safe_step",
    save_run="stepwell.interop.saving:save",
    stability_function="stepwell.analysis.stability:function",
    stability_limit="stepwell.analysis.stability:stability_limit",
    states_of_run="stepwell.runs.between:states",
)

__version__: str = _core.__version__


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


with open(f"{__path__[0]}/__init__.pyi", encoding="utf-8") as _stub:
    #: Of each public name the module from which the stub beside this file imports it.
    _SOURCES = {words[3]: words[1][1:] for words in map(str.split, _stub) if words[:1] == ["from"]}

__all__ = sorted([*_SOURCES, "__version__", "isa", "isa_levels"])


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    """A public name, imported when it is first used, so that importing stepwell stays fast."""
    import importlib

    if name == "gym":  # not among the names that are listed, since it needs gymnasium
        return importlib.import_module("stepwell.interop.gym")
    if name not in _SOURCES:
        raise AttributeError(f"module 'stepwell' has no attribute {name!r}")
    source = _SOURCES[name]
    module = importlib.import_module(f"stepwell.{source}") if source else None
    if module is None or not hasattr(module, name):  # a module itself
        value = importlib.import_module(".".join(filter(None, ["stepwell", source, name])))
    else:
        value = getattr(module, name)
    globals()[name] = value  # so that the next use is as quick as that of any attribute
    return value
