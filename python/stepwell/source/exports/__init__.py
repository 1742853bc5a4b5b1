"""A step as source code of another language, for games and other programs.

``tapes`` traces a step and splits it. ``names`` makes names that every language accepts. ``lanes`` finds what is alike in a long
step, such as its springs, and ``lane_writer`` writes loops of it. ``written`` writes the step in a ``language``, each of which
has a file. ``result`` is the exported text.
"""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING, Any

from ...base import checks
from ...base.arrays import Shape
from ...errors import ArgumentError, ShapeError, UnsupportedError
from ...model.controls import AnyControl
from ...model.methods import Method
from ...model.methods import of_operations as find_method
from ...model.systems import System
from ...model.systems.base import a_system
from ...runs import float32
from ...runs.findings import warn_of
from ...runs.findings.strong_control import of_a_strong_control
from ...runs.options import Options
from ...runs.request import Request
from .c import C
from .csharp import CSharp
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

#: The name in place of that of a method for the sampled controller alone.
CONTROLLER = "controller"

LANGUAGES: dict[str, type[Skeleton]] = {"c": C, "csharp": CSharp, "javascript": JavaScript, "python": Python, "rust": Rust}


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
    """Export a step of a system by a method as source code: one file without dependencies.

    The file has a structure of the parameters, which users may change, and a structure of the state. Its functions prepare the
    parameters, set the initial state and make a step. Compiled and run, it gives the numbers of ``integrate`` to the last bit.

    Args:
        system: the system; one trajectory of it.
        method: its name, or what ``stepwell.method`` returns; ``"controller"`` for the sampled controller alone: a step then
            reads the state, which the program sets to what it measured, and leaves it as it is.
        language: ``"c"`` (C99), ``"csharp"``, ``"javascript"`` (a module), ``"python"`` (without NumPy) or ``"rust"``.
        dt: the initial value of the step in the file, in units of time; users may change it there, like the parameters.
        t0: the time of step 0, likewise.
        v: velocities of the example at the head of the file, shape (*block); zero if None. A control without a target keeps the
            energy of v and y.
        y: coordinates of the example, likewise; 1, 2, 3, … if None.
        member: which trajectory of a batch, by its index, or by a tuple of one index for each axis of the batch.
        start: the start of a method that has several; see ``method(…).starts``.
        control: the control of the energy, as in ``integrate``.
        force: True for a step with an argument ``force``, which is added to v̇ in every stage and may differ from step to step, as
            in ``World``. An array of the shape of v, or of v with the batch, is the force of the example at the head of the file.
            A method that carries something other than v needs the force in its start and finish, too.
        fused: whether to use fused multiply-adds, as in ``integrate``. JavaScript and C# have none, Python has them from 3.13 on.
        name: the name or prefix of functions and types; None for one made from the system and the method.
        dtype: ``"float64"`` or ``"float32"``, as in ``integrate``. In float32 the numbers are C's ``float`` and Rust's ``f32``;
            JavaScript rounds each operation by ``Math.fround``, and Python needs NumPy.

    Returns:
        An ``ExportedStep``: ``.source`` is its text, ``.save(path)`` writes it.

    Raises:
        UnsupportedError: if the method cannot step the system, if the language has no fused multiply-add, or if the step has too
            many operations.

    Example:
        >>> sw.export(sw.Oscillator(omega=2.0), "rk4", "c", dt=1 / 60).save("step.c").name
        'step.c'
    """
    alone, system = isinstance(method, str) and method == CONTROLLER, a_system(system)
    if alone and system.controller is None:
        raise ArgumentError(f"method: expected a sampled controller around the system, to export it alone, got {system!r}")
    method = find_method("false_euler" if alone else method)
    kind = LANGUAGES[checks.known("language", language, tuple(LANGUAGES))]
    fused, single = checks.flag("fused", fused), checks.is_single(dtype)
    if fused and kind.fma is None:
        raise UnsupportedError(f"fused: {kind.title} has no fused multiply-add; export without, or to another language")
    if fused and single and kind.of_single.get("fma", kind.fma) is None:
        raise UnsupportedError(
            f"fused: {kind.title} has no fused multiply-add of float32; export without, or to another language"
        )
    called = prefix(f"{snake(system.kind_name)}_{CONTROLLER if alone else method.name}" if name is None else name)
    push = None if force is False else 0.0 if force is True else force
    options = Options(v=v, y=y, dt=dt, t0=t0, control=control, force=push, fused=fused, dtype=dtype, start=start)
    request = Request.one_step(system, method, options)
    system, plan, index = request.system, request.plan, _member(member, request.plan.batch)
    if single:
        float32.check_written(system, "an exported step")
    if control is not None and v is not None and y is not None:
        warn_of(of_a_strong_control(system, request.v, request.y, plan.dt))
    traced = Traced(plan, index, alone=alone)
    writer = kind(called, Names(MEMBERS), single)
    written = Written(traced, writer)
    v, y = (list(map(float, checks.member(block, index).flat)) for block in (request.v, request.y))
    text = writer.file(written, writer.remark(head(written, writer, v, y)))
    of = "float32" if single else "float64"
    return ExportedStep(text, called, kind.title, kind.endings, system, None if alone else method, index, fused, traced.count, of)


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
    indices = member if isinstance(member, (tuple, list)) else (member,)
    if len(indices) != len(batch):
        raise ShapeError(f"member: expected {len(batch)} indices for the batch of shape {batch}, got {len(indices)}")
    for each, n in zip(indices, batch, strict=True):
        if n == 0:
            raise ShapeError(f"member: the batch of shape {batch} has no members")
        checks.count("member", each, 0, n - 1)
    return tuple(checks.count("member", each, 0, n - 1) for each, n in zip(indices, batch, strict=True))
