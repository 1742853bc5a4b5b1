"""A step as source code of another language, for use in an engine.

``tapes`` traces a step and splits it, ``names`` makes names that a language accepts, ``written`` writes both in a ``language``,
of which there is a file each; ``result`` holds the text.
"""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...errors import ArgumentError, ShapeError, UnsupportedError
from ...model.compatibility import fits_together, forced
from ...model.controls import AnyControl, ConstraintControl, EnergyControl, a_control
from ...model.methods import Method
from ...model.methods import method as find_method
from ...model.parameters import aligned
from ...model.systems import System
from ...model.systems.base import a_system
from ...runs import engine, float32
from .c import C
from .head import head
from .javascript import JavaScript
from .names import Names, prefix, snake
from .plain_python import Python
from .result import ExportedStep
from .rust import Rust
from .skeleton import Skeleton
from .tapes import Traced
from .written import MEMBERS, Written

if TYPE_CHECKING:
    from ...base.literals import LanguageName

__all__ = ["ExportedStep", "export"]

LANGUAGES: dict[str, type[Skeleton]] = {"c": C, "javascript": JavaScript, "python": Python, "rust": Rust}


def export(
    system: System,
    method: str | Method,
    language: LanguageName,
    *,
    dt: float = 0.01,
    t0: float = 0.0,
    v: Any = None,
    y: Any = None,
    member: int | tuple[int, ...] | None = None,
    start: str | None = None,
    control: AnyControl | None = None,
    force: Any = None,
    fused: bool = False,
    name: str | None = None,
    dtype: Any = "float64",
) -> ExportedStep:
    """A step of a system by a method as source code: one file without dependencies.

    The file has a structure of the parameters, which may be changed there, a structure of the state, and functions: preparation
    from the parameters, the state at the start, one step. Compiled and run it gives the numbers of ``integrate``,
    to the last bit.

    Args:
        system: what to step, one trajectory.
        method: its name, or what ``stepwell.method`` returns.
        language: ``"c"`` (C99), ``"javascript"`` (a module), ``"python"`` (without NumPy) or ``"rust"``.
        dt: the initial value of the step in the file, in units of time; it may be changed there, as the parameters may.
        t0: the time of step 0, likewise.
        v: velocities of the example at the head of the file, shape (*block); zero if None. A control without a target keeps the
            energy of v and y.
        y: coordinates of the example, likewise; 1, 2, 3, … if None.
        member: which trajectory of a batch, by its index, or a tuple of one index for each axis of the batch.
        start: how a method with a choice starts; see ``method(…).starts``.
        control: the control of the energy, as in ``integrate``.
        force: True for a step with an argument ``force``, which is added to v̇ in every stage and may be another in each step, as
            that of ``World``; an array of the shape of v is that of the example at the head of the file, and gives its shape
            in the batch. A method that carries something other than v needs it in its start and finish, too.
        fused: with fused multiply-adds, as ``integrate(fused=True)``. JavaScript has none, Python has them from 3.13 on.
        name: the name of functions and types, or its beginning; from the system and the method if None.
        dtype: ``"float64"`` or ``"float32"``, as ``integrate`` takes it. In float32 numbers are those of C's ``float`` and Rust's
            ``f32``; JavaScript rounds each operation by ``Math.fround``, and Python needs NumPy.

    Returns:
        An ``ExportedStep``: ``.source`` is its text, ``.save(path)`` writes it.

    Raises:
        ArgumentError: what was given and what was expected.
        UnsupportedError: if the method cannot do the system, if the language has no fused multiply-add, or if the step has
            too many operations to be written out one by one.

    Example:
        >>> sw.export(sw.Oscillator(omega=2.0), "rk4", "c", dt=1 / 60).save("step.c").name
        'step.c'
    """
    how = find_method(method)
    system = a_system(system)
    system = (
        system.for_state_shapes()
        if v is None and y is None
        else system.for_state_shapes(*(0.0 if each is None else each for each in (v, y)))
    )
    fits_together(system, how)
    kind = LANGUAGES[checks.known("language", language, tuple(LANGUAGES))]
    dt = checks.number("dt", dt, positive=True, unit="units of time")
    t0 = checks.number("t0", t0, unit="units of time")
    fused = checks.flag("fused", fused)
    single = checks.is_single(dtype)
    if fused and kind.fma is None:
        raise UnsupportedError(f"fused: {kind.title} has no fused multiply-add; export without, or to another language")
    if fused and single and kind.of_single.get("fma", kind.fma) is None:
        raise UnsupportedError(
            f"fused: {kind.title} has no fused multiply-add of float32; export without, or to another language"
        )
    if single:
        dt = float32.step(system, how, "direct", dt)
        float32.check_inputs(system, t0)
        float32.check_written(system, "an exported step")
    choice = how.start_choice(start)
    control = a_control(control)
    called = prefix(f"{snake(system.kind_name)}_{how.name}" if name is None else name)
    blocks = [
        None if block is None else checks.block(argument, block, shape, system.axes)
        for argument, block, shape in (("v", v, system.v_shape), ("y", y, system.y_shape))
    ]
    push = _force(force, system)
    shapes = {"system": system.batch, "control": () if control is None else control.batch}
    for argument, block, shape in (
        ("v", blocks[0], system.v_shape),
        ("y", blocks[1], system.y_shape),
        ("force", push, system.v_shape),
    ):
        if block is not None:
            shapes[argument] = block.shape[len(shape) :]
    if single:
        blocks = [None if each is None else _rounded(name, each) for name, each in zip("vy", blocks, strict=True)]
        push = None if push is None else _rounded("force", push)
    batch = checks.batch_shape(shapes)
    index = _member(member, batch)
    if control is not None:
        system = _under(system, control, blocks, batch, dt)
        fits_together(system, how)
        system = system.stepped_by(how)
    push = None if push is None else _wide(push, system.v_shape, batch)
    stepped = system.over_steps(how, t0, dt)
    plan = engine.Plan(stepped, how, batch, dt, t0, choice=choice, fused=fused, force=push, single=single)
    traced = Traced(plan, index)
    writer = kind(called, Names(MEMBERS), single)
    written = Written(traced, writer)
    text = writer.file(written, writer.remark(head(written, writer, *_example(system, blocks, batch, index))))
    of = "float32" if single else "float64"
    return ExportedStep(text, called, kind.title, kind.endings, system, how, index, fused, traced.count, of)


def _force(force: Any, system: System) -> Array | None:
    """The force of the example, or None without one."""
    if force is None or force is False:
        return None
    forced(system)
    return checks.block("force", 0.0 if force is True else force, system.v_shape, system.axes)


def _rounded(name: str, block: Array) -> Array:
    """A block in numbers of float32."""
    checks.fits_single(name, block)
    return np.asarray(np.asarray(block, np.float32), np.float64)


def _member(member: Any, batch: Shape) -> Shape:
    """The index of one trajectory of a batch."""
    if member is None:
        if prod(batch) != 1:
            last = tuple(n - 1 for n in batch)
            raise ArgumentError(
                f"member: expected one trajectory of the batch of shape {batch}, such as "
                f"member={last[0] if len(last) == 1 else last}; one step is exported, with the parameters of one"
            )
        return (0,) * len(batch)
    given = member if isinstance(member, (tuple, list)) else (member,)
    if len(given) != len(batch):
        raise ShapeError(f"member: expected {len(batch)} indices for the batch of shape {batch}, got {len(given)}")
    for each, n in zip(given, batch, strict=True):
        if n == 0:
            raise ShapeError(f"member: there is none in a batch of shape {batch}")
        checks.count("member", each, 0, n - 1)
    return tuple(checks.count("member", each, 0, n - 1) for each, n in zip(given, batch, strict=True))


def _under(system: System, control: AnyControl, blocks: list[Array | None], batch: Shape, dt: float) -> System:
    """The system under control; without a state it needs all numbers of the control."""
    v, y = blocks
    if v is not None and y is not None:
        v, y = (_wide(each, shape, batch) for each, shape in ((v, system.v_shape), (y, system.y_shape)))
        return system.controlled(control, v, y, dt)
    if not system.keeps(control) and not isinstance(control, ConstraintControl) and control.target is None:
        raise ArgumentError("control: expected one with a target, or v and y, of which it keeps the energy")
    if isinstance(control, EnergyControl) and control.gain is None:
        raise ArgumentError("control: expected one with a gain, or v and y, to which relative= relates it")
    return system.under(control, batch)


def _wide(block: Array, shape: Shape, batch: Shape) -> Array:
    """A block for every member."""
    axes = len(shape)
    return np.broadcast_to(aligned(block, axes, batch), (*shape, *batch))


def _example(system: System, blocks: list[Array | None], batch: Shape, index: Shape) -> tuple[list[float], list[float]]:
    """Velocities and coordinates with which the example begins."""
    out = []
    for block, shape, others in zip(blocks, (system.v_shape, system.y_shape), (0.0, 1.0), strict=True):
        if block is None:
            out.append([others * (i + 1.0) for i in range(prod(shape))])
        else:
            own = _wide(block, shape, batch)[(slice(None),) * len(shape) + index]
            out.append([float(each) for each in own.reshape(-1)])
    return out[0], out[1]
