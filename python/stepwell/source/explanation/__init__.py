"""Explains a step: every operation by name, how often it is computed, and the machine code.

``formula`` writes operations as text, ``naming`` names values, ``listing`` makes the lines of a tape, ``beside`` those of the
computations beside the steps, and ``result`` is the explanation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import prod
from typing import TYPE_CHECKING, Any

from ... import _core
from ...base import checks
from ...errors import ArgumentError, UnsupportedError
from ...model.compatibility import not_of_a_step
from ...model.controls import AnyControl, a_control
from ...model.methods import Method
from ...model.methods import methods as every_method
from ...model.methods import of_operations as find_method
from ...model.systems import System
from ...model.systems.base import a_system
from ...runs import engine, float32
from ...runs.engine.counted import written
from ...runs.engine.linear import matrix_model
from ...runs.options import Options
from ...runs.options.single import machine_of
from ...runs.request import Request
from .beside import lines_beside
from .listing import Line, Section, line_of_matrices, lines_of_program, lines_of_tape
from .naming import matrix_of
from .result import Explanation, Kernel, MachineCode, Packing

if TYPE_CHECKING:
    from ...base.literals import StepForm

__all__ = ["Explanation", "Kernel", "Line", "MachineCode", "Packing", "Section", "explain"]


def explain(
    system: System,
    method: str | Method,
    *,
    members: int | None = None,
    control: AnyControl | None = None,
    fused: bool = False,
    attempt: bool = False,
    form: StepForm = "direct",
    start: str | None = None,
    record: str | Sequence[str] | None = (),
    dtype: Any = "float64",
    device: str | None = None,
) -> Explanation:
    """Explain what a step of a system by a method computes, and its machine code on this machine.

    ``print`` the result for a listing: each value with its formula, grouped by how often it is computed; the numbers of
    operations; the machine code, or why the step is interpreted. In a notebook it is a table. The values of parameters and the
    length of the step do not matter, only which parameters all members share: those are used once a run instead of once a member.

    Args:
        system: the system. Parameters that are arrays over its batch differ from member to member.
        method: its name, or what ``stepwell.method`` returns.
        members: number of trajectories in the batch, a multiple of the size of the system's batch; if None that size, or one. The
            machine code for many differs from that for one.
        control: an ``EnergyControl`` or a ``Projection``, as in ``integrate``.
        fused: whether to use fused multiply-adds, fma(a, b, c) = a·b + c rounded once, as in ``integrate``.
        attempt: True for an attempt at an adaptive step, as in ``integrate`` with ``tolerance=``, with the operations that decide
            on the next one.
        form: ``"direct"``, or ``"matrix"`` for a step by the transition matrix of a linear system: P, and Q for the inputs at
            each node of the method.
        start: how a method with a choice starts, as in ``integrate``.
        record: quantities that the core can record, whose computation is listed, too: "energy", and others in the system's
            ``quantities``.
        dtype: ``"float64"`` or ``"float32"``, as in ``integrate``.
        device: as in ``integrate``: for a device, what it runs is in ``kernel``, with the text. Steps of fixed length only.

    Raises:
        UnsupportedError: if the method cannot step the system.

    Example:
        >>> print(sw.explain(sw.Oscillator(), "false_euler").listing)
        once a run
          Φ = h·omega
        in each step
          v' = v − Φ·y
          y' = y + Φ·v'
    """
    method, system = find_method(method), a_system(system).for_state_shapes()
    system.not_in_a_loop("explain")
    if attempt := checks.flag("attempt", attempt):
        _attempted(system, method, a_control(control), dtype, form)
    own = prod(system.batch)
    names = [record] if isinstance(record, str) else [] if record is None else checks.several("record", record, "quantities")
    if names and not system.quantities:
        raise UnsupportedError(f"record: nothing can be recorded of {system!r}; it has no energy of its own")
    if names and checks.is_single(dtype):
        raise UnsupportedError("record: float32 runs compute it of the saved states, in float64; explain it without dtype=")
    quantities = list(dict.fromkeys(checks.known("record", name, list(system.quantities)) for name in names))
    if checks.is_single(dtype):
        float32.check_written(system, "a listing")
    count = own if members is None else checks.count("members", members, 1)
    if count % own:
        raise ArgumentError(f"members: expected a multiple of the system's batch of {own}, got {count}")
    batch = system.batch if count == own else (count // own, *system.batch)
    if control is not None:
        checks.fits("members: the numbers of a control", 8, batch, "explain fewer")
    options = Options(control=control, fused=fused, form=form, start=start, dtype=dtype)
    plan = Request.one_step(system, method, options, batch).plan
    explained = _explained(plan, attempt)
    machine = machine_of(device, "rust")
    if machine is not None and attempt and device is not None:
        raise UnsupportedError("device: explains a step of fixed length, so it goes without attempt=True")
    if machine is not None and not attempt:
        explained = replace(explained, kernel=_kernel(machine, plan))
    if explained.parts is not None or attempt:
        return explained
    return replace(explained, beside=lines_beside(plan, plan.choice, quantities))


def _attempted(system: System, method: Method, control: AnyControl | None, dtype: Any, form: str) -> None:
    """Raise if there is no attempt at an adaptive step."""
    if checks.is_single(dtype):
        raise UnsupportedError(
            "attempt: in float32 an attempt is two lists, the stages in float32 and the decision in float64; explain it in "
            "float64"
        )
    if method.error_order is None:
        able = ", ".join(m.name for m in every_method() if m.error_order is not None)
        raise UnsupportedError(f"attempt: {method.name} does not estimate its error, so it cannot choose its steps; use {able}")
    if system.has_stick_friction:
        raise UnsupportedError(f"attempt: adaptive steps do not work with friction that sticks, which {system!r} has")
    if form != "direct":
        raise UnsupportedError("form: form='matrix' goes without fused=, attempt= and control=")
    not_of_a_step(system.keeper if control is None else control)


def _explained(plan: engine.Plan, attempt: bool) -> Explanation:
    model = matrix_model(plan, **matrix_of(plan)) if plan.form == "matrix" else engine.model(plan)
    what: dict[str, Any] = {"system": plan.system, "method": plan.method, "members": plan.members}
    what |= {"fused": plan.fused, "attempt": attempt, "form": plan.form, "dtype": "float32" if plan.single else "float64"}
    parts = _core.in_parts(model, plan.members, attempts=attempt)
    compiled = None if parts else _core.compiled(model, plan.members, attempts=attempt)
    if compiled is None:
        kind, about, lanes = parts or ("rates", 0, 1)
        sections = line_of_matrices(plan) if plan.form == "matrix" else lines_of_program(plan, attempt)
        return Explanation(**what, sections=sections, level=_core.isa(), lanes=lanes, parts=kind, about=about)
    sections = lines_of_tape(plan, compiled["split"], attempt)
    code = why = None
    if compiled["interpreted"] is None:
        names = {"vectors": "block_vectors", "turns": "blocks"} | {each: each for each in ("width", "resident", "registers")}
        packing = None if compiled["packing"] is None else Packing(**compiled["packing"])
        code = MachineCode(
            size=compiled["bytes"],
            spills=compiled["spills"],
            packing=packing,
            **{name: compiled[key] for name, key in names.items()},
        )
    else:
        why = _why(compiled["interpreted"])
    return Explanation(
        **what,
        sections=sections,
        level=compiled["level"],
        lanes=compiled["lanes"],
        written=written(plan, attempt),
        computed=compiled["computed"],
        hoisted={section.when: sum(sum(line.operations.values()) for line in section.lines) for section in sections[:-1]},
        code=code,
        interpreted_because=why,
    )


def _kernel(machine: Any, plan: engine.Plan) -> Kernel:
    from ...device import fixed, promise  # only such explanations need it

    promise.check(machine, single=plan.single)
    model = matrix_model(plan, **matrix_of(plan)) if plan.form == "matrix" else engine.model(plan)
    stages, text = fixed.text_of(model, plan.single, plan.choice)
    numbers = sum(stages.sizes[name] for name in ("v", "y", "kept", "tally"))
    size = 4 if plan.single else 8
    member_bytes = size * (2 * numbers + len(stages.params)) + 8
    return Kernel(machine.described.name, machine.described.title, numbers, member_bytes, text.count("\n"), text)


def _why(word: str) -> str:
    """Why a step is interpreted, in words."""
    if word == "level":
        better = _core.isa_levels()[1:]
        missing = "there is no machine code for this CPU, which has neither AVX2 nor AVX-512, nor NEON under Linux"
        return "STEPWELL_KERNELS asks for it" if better else missing
    if word == "pages":
        return "this system does not let a program execute code that it has written"
    return "there is no machine code for this step"
