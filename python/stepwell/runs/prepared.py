"""Runs that differ in their start alone: everything else is checked and prepared once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import checks
from ..base.arrays import Shape
from ..errors import ArgumentError
from ..model.methods import Method
from ..model.systems import System
from .execution import noticing
from .findings import is_heard, warn_of
from .options import Options, named
from .request import Request
from .result import Run
from .short import ShortRun
from .short_runs import fixed_options, is_free, is_small, short_run_of_request

if TYPE_CHECKING:
    from typing import Unpack

    from .options.table import RunOptions


class PreparedRun:
    """A run whose arguments were checked once, to be made from many starts: what ``stepwell.prepare`` returns.

    Example:
        >>> swing = sw.prepare(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=20)
        >>> swing(0.0, 2.0).y.round(6)
        array([-0.832291])
    """

    def __init__(self, system: System, method: str | Method, options: Options) -> None:
        self._system, self._method, self._options = system, method, fixed_options(options)
        #: The last small request that was checked as a whole, with the shapes of its blocks in the call; None if others would not
        #: be the same but for the start.
        self._request: tuple[Request, tuple[Shape, Shape]] | None = None
        self._short: ShortRun | None = None

    def __repr__(self) -> str:
        """Of one line."""
        name = self._method if isinstance(self._method, str) else self._method.name
        return f"<prepared run of {self._system!r} by {name}>"

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy, which may be in another process, is prepared at its first call."""
        return PreparedRun, (self._system, self._method, self._options)

    def __call__(self, v: Any = None, y: Any = None) -> Run:
        """The run from this start: to the bit, and with the errors and warnings, that ``integrate`` makes of it.

        Args:
            v: velocity block at the start, as for ``integrate``; None for a system of first order.
            y: coordinate block at the start, likewise.

        Raises:
            ArgumentError: as ``integrate`` does.

        Example:
            >>> orbit = sw.prepare(sw.Oscillator(2.0), "leapfrog", v=0.0, y=1.0, dt=0.1, steps=10)
            >>> orbit(1.0, 0.0).v.shape
            (1,)
        """
        run = self.run(v, y)
        if run.findings:
            warn_of(run.findings)
        return run

    def run(self, v: Any, y: Any) -> Run:
        """The run with its findings, without warnings."""
        short = self._short
        if short is not None and (run := short.run(v, y)) is not None:
            return run
        known = self._request
        if known is not None and (request := _from(*known, v, y)) is not None:
            return noticing(request, is_heard)
        return noticing(self.request(v, y), is_heard)

    def request(self, v: Any, y: Any) -> Request:
        """The request from this start, checked as a whole, after which others of these shapes are checked in less time."""
        request = Request.of(self._system, self._method, self._options._replace(v=v, y=y))
        if is_free(request) and is_small(request):
            shapes = (request.v.shape if v is None else np.shape(v)), np.shape(y)
            if self._request is None or self._request[1] != shapes:
                self._short = short_run_of_request(self._system, request, shapes)
            self._request = request, shapes
        return request


def prepare(system: System, method: str | Method, **options: Unpack[RunOptions]) -> PreparedRun:
    """Check and prepare a run once, to make it from many starts: ``prepare(…)(v, y)`` is ``integrate(…)`` in less time.

    The call takes a few microseconds beside the steps for short runs of fixed steps in the direct form, and of some hundred
    adaptive steps, without control, force, events and recorded quantities. Others save the checks of arguments; and nothing is
    saved where more than the state depends on the start: with a control, algebraic equations, ``force``, ``positive``, or in
    float32 if it is not short; nor for runs of more than 16 000 numbers, saved states and start together, beside which the
    checks are little.

    Args:
        system: the system to step.
        method: its name, or what ``stepwell.method`` returns.
        **options: those of ``integrate``, but ``resume``. ``v`` and ``y`` are a start like those to come.

    Returns:
        A ``PreparedRun``. Starts of another shape are taken too, and prepared anew.

    Raises:
        ArgumentError: if an argument is wrong, as ``integrate`` does.

    Example:
        >>> swing = sw.prepare(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=20)
        >>> swing
        <prepared run of Oscillator(omega=1.0, form='canonical') by rk4>
        >>> [float(swing(v, 0.0).y[-1].round(6)) for v in (0.5, 1.0, 2.0)]
        [0.454649, 0.909298, 1.818596]
    """
    asked = named("prepare", options)
    if asked.resume is not None:
        raise ArgumentError("resume: a prepared run begins at the start of its call; to go on with a run use integrate")
    prepared = PreparedRun(system, method, asked._replace(v=None, y=None))
    prepared.request(asked.v, asked.y)
    return prepared


def _from(request: Request, shapes: tuple[Shape, Shape], v: Any, y: Any) -> Request | None:
    """The request from another start; None if the blocks have other shapes, which may mean another batch or another system."""
    system, batch = request.system, request.plan.batch
    v = 0.0 if v is None and system.v_shape == (0,) else v
    is_known = not request.plan.single  # in which the start is rounded, and checked, in other places, too
    if not is_known or not all(isinstance(block, (float, np.ndarray)) for block in (v, y)):
        return None
    own = request.v.shape if shapes[0] == request.v.shape == (0, *batch) else np.shape(v)
    if (own, np.shape(y)) != shapes:
        return None
    v = checks.spread(checks.block("v", v, system.v_shape, system.axes), system.v_shape, batch)
    y = checks.spread(checks.block("y", y, system.y_shape, system.axes), system.y_shape, batch)
    control = request.step_control
    if control is not None:
        control = control._replace(start=(control.start[0], v, y))
    return request._replace(v=v, y=y, step_control=control)
