"""The comment at the head of a file: a description, its usage, an example."""

from __future__ import annotations

from math import prod

from ... import _core
from ...base.arrays import Shape
from ...base.checks import short
from ...model.methods import stable_for
from ...runs import engine
from .lines import indented
from .skeleton import Skeleton
from .written import Written

#: The number of steps of the example.
STEPS = 1000

#: The most characters of the system's repr.
MAX_SYSTEM = 400

#: The first line of the example in the comment.
EXAMPLE = "Example:"


def head(w: Written, language: Skeleton, v: list[float], y: list[float]) -> list[str]:
    """The lines of the comment, without its marks."""
    plan = w.traced.plan
    method, system = plan.method, plan.system
    limit = f"undamped oscillators for {stable_for(method.limit, 'omega*dt', 10)}"
    count = engine.evaluations(method, system)
    evaluations = f"{count} rate evaluation{'s' * (count > 1)} per step"
    blocks = [("v", system.v_shape), ("y", system.y_shape)]
    layout = "; ".join(_layout(name if name == "y" else w.slot, shape) for name, shape in blocks)
    of_method = [
        f"Method:  {method.title} ({method.name}), order {method.order}, {evaluations}",
        f"Stable:  {limit}",
        f"Source:  {method.reference}",
    ]
    alone = w.traced.alone
    return [
        f"{language.prefix}: {'a sampled controller, without its system' if alone else f'one step by {method.title}'}.",
        "",
        f"System:  {short(system, MAX_SYSTEM)}",
        *(["Before each step set the state to what was measured; the step leaves it as it is."] if alone else of_method),
        f"State:   {layout}",
        *_outputs(plan),
        "Time:    t0 + k*dt at step k, which the state counts",
        f"Written by stepwell {_core.__version__}. The numbers are those of stepwell.integrate"
        f"{_options(plan.fused, plan.single)}, to the last bit.",
        "",
        *language.usage_of(w),
        "",
        EXAMPLE,
        "",
        *indented(language.example(w, v, y, STEPS)),
    ]


def _options(fused: bool, single: bool) -> str:
    """The arguments of integrate that decide on the bits."""
    options = [text for text, is_on in (("fused=True", fused), ('dtype="float32"', single)) if is_on]
    return f"(..., {', '.join(options)})" if options else ""


def _outputs(plan: engine.Plan) -> list[str]:
    """Where in the memory what a sampled controller puts out stands after a step."""
    if plan.system.controller is None:
        return []
    first = plan.method.kept_numbers(prod(plan.system.v_shape), prod(plan.system.y_shape))
    held = plan.system.controller.held_places(plan.system).items()
    texts = (f"{name} at {', '.join(f'memory[{first + i}]' for i in places)}" for name, places in held)
    return [f"Set by the controller: {', '.join(texts)}"]


def _layout(name: str, shape: Shape) -> str:
    """The order of the numbers of a block."""
    if not shape:
        return f"{name}[1]"
    size = 1
    for n in shape:
        size *= n
    if len(shape) == 1:
        return f"{name}[{size}]" if size else f"no {name}"
    letters = "ijkl"[: len(shape)]
    place = letters[0]
    for letter, n in zip(letters[1:], shape[1:], strict=True):
        place = f"{n}*{place if place.isalpha() else f'({place})'} + {letter}"
    return f"{name}[{size}], number {', '.join(letters)} of the block of shape {shape} at {name}[{place}]"
