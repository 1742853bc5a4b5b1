"""Runs that differ in their start alone: everything else is checked and prepared once."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _core
from ..base import checks
from ..base.arrays import Array, Shape
from ..base.immutable import frozen
from ..errors import ArgumentError
from ..model.methods import Method
from ..model.systems import NBody, System
from . import engine
from .diagnostics import finds_growth_only
from .findings import is_heard, may_have_amounts, warn_of
from .fixed import fixed_run
from .making import noticing
from .options import Options, spread
from .request import Request
from .result import Run
from .short import NOT_MADE, TAME, ShortRun

#: The most bytes of what is kept for later runs: the parameters of a system, and start and saved states of a run.
MOST_BYTES = 1 << 17


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
        if _is_free(request) and _is_small(request):
            shapes = (request.v.shape if v is None else np.shape(v)), np.shape(y)
            if self._request is None or self._request[1] != shapes:
                self._short = _short_run(self._system, request, shapes)
            self._request = request, shapes
        return request


def prepare(system: System, method: str | Method, *, v: Any = None, y: Any = None, **options: Any) -> PreparedRun:
    """Check and prepare a run once, to make it from many starts: ``prepare(…)(v, y)`` is ``integrate(…)`` in less time.

    The call takes a few microseconds beside the steps for short runs of fixed steps in the direct form, and of some hundred
    adaptive steps, without control, force, events and recorded quantities. Others save the checks of arguments; and nothing is
    saved where more than the state depends on the start: with a control, algebraic equations, ``force``, ``positive``, or in
    float32 if it is not short; nor for runs of more than 16 000 numbers, saved states and start together, beside which the
    checks are little.

    Args:
        system: the system to step.
        method: its name, or what ``stepwell.method`` returns.
        v: velocity block of a start like those to come, shape (*block, *batch), or one number for all; a first-order system has
            none.
        y: coordinate block, likewise.
        **options: all others of ``integrate``, but ``resume``.

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
    if unknown := [name for name in options if name not in Options._fields]:
        raise ArgumentError(f"prepare: expected arguments of integrate, got {unknown[0]}=")
    if options.get("resume") is not None:
        raise ArgumentError("resume: a prepared run begins at the start of its call; to go on with a run use integrate")
    prepared = PreparedRun(system, method, Options(**options))
    prepared.request(v, y)
    return prepared


def fixed_options(options: Options) -> Options:
    """Options that do not change any more."""
    return Options(*map(_own, Options._fields, options))


def _own(name: str, option: Any) -> Any:
    if isinstance(option, np.ndarray):
        return frozen(name, option)
    if type(option) in (list, tuple):
        return type(option)(frozen(name, each) if isinstance(each, np.ndarray) else each for each in option)
    return option


class ShortFixedRun(ShortRun):
    """One with fixed steps."""

    def __init__(self, system: System, request: Request, core: _core.Prepared) -> None:
        super().__init__(system, request)
        self.core, plan = core, request.plan
        run = fixed_run(request)
        #: All attributes of a run that do not depend on the start.
        self.attributes = vars(run)
        self.t, self.status = run.t, np.zeros(plan.batch, np.int8)
        self.first_bad: Any = np.full(plan.batch, -1)
        self.shapes = run.v.shape, run.y.shape
        self.shape_of_carry = None if run.carry is None else run.carry.shape
        self.dtype = plan.dtype
        self.is_plain = finds_growth_only(request.system, plan.method, plan.steps)
        self.has_amounts = may_have_amounts(request.system)

    def _made(self, v: Any, y: Any, system: System, numbers: list[Array] | None) -> Run | None:
        dtype = self.dtype
        saved_v, saved_y = np.empty(self.shapes[0], dtype), np.empty(self.shapes[1], dtype)
        carry = None if self.shape_of_carry is None else np.empty(self.shape_of_carry, dtype)
        outcome = self.core.run(v, y, saved_v, saved_y, carry, numbers)
        if outcome == NOT_MADE:
            return None
        run = object.__new__(Run)
        attributes = run.__dict__
        attributes.update(self.attributes)
        attributes.update(
            t=self.t.copy(), v=saved_v, y=saved_y, status=self.status.copy(), first_bad_step=self.first_bad.copy(), carry=carry,
            recorded={}, events={}, system=system,
        )  # fmt: skip
        if outcome != TAME or not self.is_plain or (self.has_amounts and (saved_y[-1] < 0.0).any()):
            self._findings(run, v, y, system)
        return run


def _is_free(request: Request) -> bool:
    """Whether nothing of a request depends on the start but the start, so that it holds for others of the same shapes."""
    plan, system = request.plan, request.system
    has_target = system.control is not None or system.keeper is not None or system.mass_matrix is not None
    goes_on = request.before is not None or request.carried
    return not (has_target or goes_on or plan.force is not None or plan.acceptance.positive)


def _is_small(request: Request) -> bool:
    """Whether its start and what it saves, which are kept with it, take little memory."""
    return 8 * (1 + request.plan.save_count) * (request.v.size + request.y.size) <= MOST_BYTES


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
    v = spread(checks.block("v", v, system.v_shape, system.axes), system.v_shape, batch)
    y = spread(checks.block("y", y, system.y_shape, system.axes), system.y_shape, batch)
    control = request.step_control
    if control is not None:
        control = control._replace(start=(control.start[0], v, y))
    return request._replace(v=v, y=y, step_control=control)


def short_run_of(system: System, method: str | Method, options: Options) -> ShortRun | None:
    """The run without its start and the numbers of its system; None if it is not known to be short, or keeps more of a start."""
    request = Request.of(system, method, options)
    if not (_is_free(request) and _is_small(request)):
        return None
    return _short_run(system, request, (request.v.shape if options.v is None else np.shape(options.v), np.shape(options.y)))


def _short_run(system: System, request: Request, shapes: tuple[Shape, Shape]) -> ShortRun | None:
    """What the run is without its start; None if that is not known to be short."""
    plan = request.plan
    asks_for_more = plan.record or request.record or request.events is not None or request.progress
    is_other = plan.form != "direct" or plan.backend != "rust" or plan.device is not None
    has_own = isinstance(plan.t0, np.ndarray) or plan.memory is not None
    if asks_for_more or is_other or has_own or not plan.members:
        return None
    # A block of another shape may mean another batch, or another system.
    if any(shape not in ((), whole.shape) for shape, whole in zip(shapes, (request.v, request.y), strict=True)):
        return None
    if request.step_control is not None:
        from .prepared_adaptive import short_adaptive_run  # only such runs need it

        return short_adaptive_run(system, request, shapes)
    if isinstance(request.system, NBody):
        return None
    core = _core.prepared(engine.model(plan), plan, plan.members, list(map(list, shapes)))
    return None if core is None else ShortFixedRun(system, request, core)
