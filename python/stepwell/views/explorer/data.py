"""The data of a scene for the page: numbers and texts, and its steps by every method, packed."""

from __future__ import annotations

import base64
import json
import math
import re
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...errors import StepwellError, UnsupportedError
from ...model.controls import AnyControl
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...runs.execution import quietly
from ...runs.options import Options
from ...runs.request import Request
from ...runs.result import Run
from ...scenes import Scene
from ...scenes import scene as find_scene
from ...scenes.taylor import Orbit
from ...scenes.truth import METHOD_IF_STIFF, method_for
from ...source.exports import export
from ...source.exports.tapes import about
from ..charts.style import look
from . import sliders, systems

#: The methods for the run with small steps that is the reference for errors; the first that can step the scene is used. Those of
#: a stiff scene stand before them: explicit ones would take steps that are far too short for a page.
TRUTH_METHODS, TRUTH_METHODS_IF_STIFF = ("dop853", "rk4", "standard_heun"), ("rodas5p", "rodas4")

#: The methods with which the page begins a scene of users' own; those of a stiff one.
PAIR, PAIR_IF_STIFF = ("false_euler", "rk4"), ("rk4", "rosenbrock23")

#: The methods whose step is two shears of the phase plane, and which block each changes first.
SHEARS = {"false_euler": "vy", "damped_euler": "yv"}

#: The class in an exported module; what the page needs from all of them.
CLASS = "step"

#: The number of states that give the size of a motion, the most steps of their run, and the fraction of extreme values on either
#: side that pictures leave out.
SAMPLES, MAX_SIZE_STEPS, SHARE_LEFT_OUT = 1000, 20_000, 0.005

#: The tolerance of that run of a stiff scene.
SIZE_TOLERANCE = 1e-6

#: Changes allowed to a step of the run that is the truth when its parts are halved, and of the run that checks it; by DOP853,
#: and by methods of lower order.
TIGHT, LOOSE = (1e-11, 1e-9), (1e-9, 1e-7)

#: The longest step that goes into a page, in characters; and in operations, which are counted before a step is written.
MAX_SOURCE, MAX_OPERATIONS = 400_000, 80_000
#: Limits of a step that solves equations: seven methods have such steps, and those of many unknowns would be most of a page.
MAX_SOLVING, MAX_UNKNOWNS = 14_000, 8


def of_method(method: Method) -> dict[str, Any]:
    """The record of a method for the page, with its colour in all pictures."""
    record = {name: getattr(method, name) for name in ("name", "title", "order", "evaluations", "limit", "carry", "section")}
    if math.isinf(method.limit):
        record["limit"] = None  # JSON has no infinity
    return record | {"colour": look(method)["color"], "shears": SHEARS.get(method.name)}


def of_scene(scene: Scene, methods: Sequence[Method]) -> dict[str, Any]:
    """The data of a scene for the page."""
    known = built_in(scene)
    offer = sliders.OFFERS[scene.name] if known else sliders.Offer()
    size, finite = sizes(scene)
    # Steps of a page have a fixed length: a scene on which those of Runge-Kutta blow up is stiff for it as well.
    stiff = offer.truth is None and (not finite or method_for(scene) == METHOD_IF_STIFF)
    sources, names, refused, truth_by = _sources(
        scene, methods, TRUTH_METHODS_IF_STIFF + TRUTH_METHODS if stiff else TRUTH_METHODS
    )
    parameters = parameters_of(sources[next(iter(names.values()))])
    own = offer.sliders if known else sliders.generic(scene.system, parameters, scene.control is not None)
    v, y = ([float(each) for each in block.reshape(-1)] for block in (scene.v, scene.y))
    energy = systems.energy(scene.system)
    values = {"m": parameters, "e": energy or {}, "v": v, "y": y}
    return {
        "name": scene.name,
        "title": scene.title,
        "section": scene.section,
        "description": scene.description,
        "dt": scene.dt,
        "horizon": scene.horizon,
        "pair": offer.pair or (PAIR_IF_STIFF if stiff else PAIR),
        "step": offer.dt or scene.dt,
        "finding": offer.finding,
        "rate": offer.rate or scene.horizon / 20.0,
        "v": v,
        "y": y,
        "motion": systems.motion(scene.system),
        "energy": energy,
        "phases": systems.phase_planes(scene.system),
        "phase": offer.phase,
        "linear": scene.system.linear,
        "limit": offer.limit,
        "truth": offer.truth,
        **size,
        "sliders": [record for each in own if (record := _slider(each, values)) is not None],
        "steps": names,
        "truth_by": truth_by,
        "truth_tolerances": TIGHT if truth_by == "dop853" else LOOSE,
        "refused": refused,
        "packed": packed(sources),
    }


def built_in(scene: Scene) -> bool:
    """True if it is a built-in scene made without arguments, for which the sliders are meant."""
    if scene.name not in sliders.OFFERS:
        return False
    return scene == (sliders.rope() if scene.name == "rope" else find_scene(scene.name))


def _sources(
    scene: Scene, methods: Sequence[Method], truth_methods: Sequence[str]
) -> tuple[list[str], dict[str, int], dict[str, str], str | None]:
    """The steps as JavaScript, the index of each method and of the "truth", why others are missing, what makes the truth."""
    sources: list[str] = []
    places: dict[str, int] = {}
    refused: dict[str, str] = {}
    for method in methods:
        try:
            source = _source(scene, method, scene.control)
        except StepwellError as error:
            refused[method.name] = str(error)
            continue
        places[method.name] = len(sources)
        sources.append(source)
    if not places:
        why = next(iter(refused.values()))
        raise UnsupportedError(f"scenes: no method steps {scene.name} in a page: {why}")
    truth_by = None
    for name in truth_methods:
        if scene.control is None and name in places:
            truth_by, places["truth"] = name, places[name]
            break
        try:
            source = _source(scene, find_method(name), None)
        except StepwellError:
            continue
        truth_by, places["truth"] = name, len(sources)
        sources.append(source)
        break
    return sources, places, refused, truth_by


def _source(scene: Scene, method: Method, control: AnyControl | None) -> str:
    options: dict[str, Any] = {"dt": scene.dt, "v": scene.v, "y": scene.y, "control": control}
    numbers = scene.v.size + scene.y.size
    if method.is_implicit and numbers > MAX_UNKNOWNS:
        raise UnsupportedError(f"equations of {numbers} numbers are too long for a page; at most {MAX_UNKNOWNS} fit")
    count = about(Request.one_step(scene.system, method, Options(**options)).plan)
    if count > MAX_OPERATIONS:
        raise UnsupportedError(f"a step of about {count} operations is too long for a page; at most {MAX_OPERATIONS} fit")
    source = export(scene.system, method, "javascript", **options, name=CLASS).source
    most = MAX_SOLVING if method.is_implicit else MAX_SOURCE
    if len(source) > most:
        raise UnsupportedError(f"a step of {len(source)} characters is too long for a page; at most {most} fit")
    return source


PARAMETER = re.compile(r"^    this\.(\w+) = (.*?);", re.MULTILINE | re.DOTALL)


def parameters_of(source: str) -> dict[str, Any]:
    """The parameters of an exported step, with their values in its text."""
    begin = source.index("  constructor(")
    text = source[begin : source.index("    for (const name of", begin)]
    numbers = [(name, value) for name, value in PARAMETER.findall(text) if not value.startswith("new ")]
    return {name: json.loads(re.sub(r",\s*\]", "]", value)) for name, value in numbers}


def packed(sources: list[str]) -> str:
    """Texts as the page unpacks them: JSON, deflated, in base 64."""
    text = json.dumps(sources, ensure_ascii=False, separators=(",", ":")).encode()
    return base64.b64encode(zlib.compress(text, 9)).decode()


def sizes(scene: Scene) -> tuple[dict[str, Any], bool]:
    """The size of the motion, and whether Runge-Kutta's steps follow it.

    It is that of the exact solution where there is a formula, else of a run by Runge-Kutta; and where that blows up, of one to a
    tolerance by an implicit method.

    ``scales`` are the largest lengths of v and y, in which errors are measured; ``ranges`` the least and largest value of each
    number of a block, for the axes of pictures.
    """
    finite = True
    if scene.exact is not None and scene.until >= scene.horizon and not isinstance(scene.exact, Orbit):
        lengths = list(scene.scales)
        blocks = scene.exact(np.linspace(0.0, scene.horizon, SAMPLES))
    else:
        steps = min(scene.steps_for(scene.dt), MAX_SIZE_STEPS)
        state: dict[str, Any] = {"v": scene.v, "y": scene.y, "dt": scene.dt, "steps": steps, "control": scene.control}
        with np.errstate(all="ignore"):  # a size need not be exact
            run = quietly(scene.system, "rk4", **state, every=max(1, steps // SAMPLES))
        finite = all(bool(np.isfinite(block).all()) for block in (run.v, run.y))
        if not finite:
            run = _implicit(scene) or run
        blocks = run.v, run.y
        rows = (block.reshape(len(block), -1) for block in blocks)
        lengths = [float(_finite(np.sqrt((row * row).sum(axis=1))).max(initial=0.0)) for row in rows]
    ranges = {}
    for name, block in zip("vy", blocks, strict=True):
        columns = block.reshape(len(block), -1).T
        ranges[name] = [np.quantile(_finite(each), [SHARE_LEFT_OUT, 1.0 - SHARE_LEFT_OUT]).tolist() for each in columns]
    return {"scales": lengths, "ranges": ranges}, finite


def _implicit(scene: Scene) -> Run | None:
    """The run of a stiff scene to a tolerance; None if no implicit method makes it."""
    motion: dict[str, Any] = {"v": scene.v, "y": scene.y, "at": np.linspace(0.0, scene.horizon, SAMPLES)}
    try:
        run = quietly(scene.system, METHOD_IF_STIFF, tolerance=SIZE_TOLERANCE, **motion, **scene.adaptive_options)
    except StepwellError:
        return None
    return None if run.status else run


def _finite(values: Array) -> Array:
    finite_values = values[np.isfinite(values)]
    return finite_values if len(finite_values) else np.zeros(1)


def _slider(slider: sliders.Slider, values: dict[str, Any]) -> dict[str, Any] | None:
    """A slider with its value at first; None if the scene has none of its numbers."""
    value = 1.0 if slider.relative else None
    if value is None:
        for path, factor in slider.targets.items():
            if (number := _at(values, path)) is not None:
                value = number / factor
                break
    if value is None or not math.isfinite(value):
        return None
    low, high = min(slider.low, value), max(slider.high, value)
    record = {"name": slider.name, "label": slider.label, "about": slider.about, "low": low, "high": high, "value": value}
    return record | {"relative": slider.relative, "targets": dict(slider.targets)}


def _at(values: dict[str, Any], path: str) -> float | None:
    """The number at a path, or None."""
    name, _, index = path.removesuffix("]").partition("[")
    value: Any = values
    for part in name.split("."):
        if not isinstance(value, dict) or part not in value:
            return None
        value = value[part]
    if isinstance(value, list):
        value = value[0 if index == "*" else int(index)]
    return float(value)
