"""Runs: one trajectory or a hundred thousand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..model.methods import Method
from ..model.systems import System
from .execution import noticing
from .findings import is_heard, warn_of
from .options import named, with_options
from .request import Request
from .result import Run
from .short_runs import short_run

if TYPE_CHECKING:
    from typing import Unpack

    from .options.table import RunOptions


@with_options()
def integrate(system: System, method: str | Method, **options: Unpack[RunOptions]) -> Run:
    """Step a system, or a batch of it.

    Every parameter of the system and both blocks broadcast; batch axes come last. A member that diverges does not affect the
    others. The result is the same to the last bit on every CPU, for every number of threads, with either backend, alone or
    in a batch, in one piece or in several.

    Most runs need ``v``, ``y``, ``dt``, ``steps`` and ``every``, or ``tolerance`` and ``at``. A run that continues another needs
    ``resume`` and ``steps``, or ``resume`` and ``at``.

    Args:
        system: the system to step.
        method: its name, or what ``stepwell.method`` returns.
        **options: those of the table in ``stepwell.runs.options``, which ``help(stepwell.integrate)`` shows.

    Returns:
        A ``Run``.

    Raises:
        ArgumentError: before any work, if an argument is wrong; the message says what was expected.
        UnsupportedError: if the method cannot step the system, or options do not go together.
        KeyboardInterrupt: within a tenth of a second of Ctrl-C.

    Warns:
        DivergenceWarning: how many members left the finite range, which first, and when. Nothing computed is lost.
        ToleranceWarning: how many members stopped before the last time of ``at``, and why; or that an absolute tolerance is so
            large that the motion is lost in it.
        StiffnessWarning: how many members had steps that stability held down, and not the tolerance, with the limit and how much
            longer steps the tolerance allows.
        AccuracyWarning: if the numbers of a run are finite but mean nothing: a pendulum turned so far that its angle has no sine;
            a state grew a million times by fixed steps that are beyond the stability limit at the start; bodies without control,
            or with a tolerance any system whose energy or declared invariant is constant, ended with another energy; a motion
            along a line passed a barrier that is higher than its energy; bodies met within one step, which is then named. This is
            checked if it is little work beside the run, or if something suggests it (docs/howto/nbody.md); not in the pieces of a
            run that carries something. ``Run.encounters`` checks every step.

    Example:
        >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, every=50)
        >>> run.y.round(6)
        array([ 1.      ,  0.283658, -0.839075])
    """
    asked = named("integrate", options)
    run = short_run(system, method, asked)
    if run is None:
        run = noticing(Request.of(system, method, asked), is_heard)
    if run.findings:
        warn_of(run.findings)
    return run
