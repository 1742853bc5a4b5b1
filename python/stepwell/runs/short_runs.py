"""Short runs that ``integrate`` makes again: what does not depend on numbers is checked and prepared once."""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import ref

import numpy as np

from .. import _core
from ..base.arrays import Array, Shape
from ..model.methods import Method
from ..model.systems import NBody, System
from . import engine
from .findings import finds_growth_only, may_have_amounts
from .fixed import fixed_run
from .options import Options
from .options.checked import asked_for, fixed
from .request import Request
from .result import Run
from .short import NOT_MADE, TAME, ShortRun

#: The most bytes of what is kept for later runs: the parameters of a system, and start and saved states of a run.
MOST_BYTES = 1 << 17
#: So many are kept, of systems whose parameters have at most ``MOST_BYTES``.
MOST_KEPT = 32
#: At most so many numbers of an option, or of a start that is a list, are looked at.
MOST_NUMBERS = 128
#: The options that short runs, which the core makes with nothing around them, know.
DONE_BY_THE_CORE = {
    *("v", "y", "dt", "steps", "every", "t0", "start", "start_step", "fused", "dtype", "threads", "device"),
    *("tolerance", "at", "max_steps", "max_step", "jumps"),
}
#: Whole numbers up to this one are floats.
LARGEST_WHOLE = 1 << 53


class _Kept:
    """A run that ``integrate`` made."""

    __slots__ = ("method", "run", "system", "times")

    def __init__(self, system: System, method: str | Method) -> None:
        #: The numbers of both objects may be in its key, and may be those of others once these are gone.
        self.system, self.method = ref(system), method
        #: How many times it was asked for; it is prepared at the second time, since most runs are made once.
        self.times = 0
        self.run: ShortRun | None = None


#: Those made last.
_kept: dict[Any, _Kept] = {}


class _Numbers(NamedTuple):
    """The numbers of a list, a tuple or an array, to be looked up."""

    kind: type
    types: Any
    numbers: Any


#: Types of options that are compared by value.
_PLAIN = frozenset({type(None), bool, int, float, str, np.float64, _Numbers})


#: The types of all options of calls, none of which has options with numbers to look up; and the most of these.
_plain_kinds: set[tuple[type, ...]] = set()
MOST_KINDS = 1024


def _signed(option: Any) -> Any:
    """An option; zeros have signs, but are equal."""
    return option.hex() if isinstance(option, float) and option == 0.0 else option


def _numbers(option: Any) -> Any:
    """An option as its numbers, if it is a short list, tuple or array of them; else itself."""
    kind = type(option)
    if (kind is list or kind is tuple) and len(option) <= MOST_NUMBERS:
        types = tuple(map(type, option))
        return _Numbers(kind, types, tuple(map(_signed, option))) if _PLAIN.issuperset(types) else option
    if kind is np.ndarray and option.size <= MOST_NUMBERS and option.dtype == np.float64:
        return _Numbers(kind, option.shape, option.tobytes())
    return option


def _block(block: Any) -> Any:
    """A block of a start as the core reads it, if it is a whole number or a list of floats; else itself."""
    kind = type(block)
    if kind is int and abs(block) <= LARGEST_WHOLE:
        return float(block)
    if kind is list and len(block) <= MOST_NUMBERS and set(map(type, block)) == {float}:
        return np.array(block)
    return block


def short_run(system: System, method: str | Method, options: Options) -> Run | None:
    """The run, if ``integrate`` made one lately that differs in its start and in numbers of the system alone, and it is short.

    What it returns is what a run from its arguments is, to the bit, with its findings. Options are known by their numbers.
    """
    others: tuple[Any, ...] = options[2:]
    kinds = tuple(map(type, others))
    if kinds not in _plain_kinds:
        others = tuple(map(_numbers, others))
        if not _PLAIN.issuperset(map(type, others)):
            return None
        if _PLAIN.issuperset(kinds) and len(_plain_kinds) < MOST_KINDS:
            _plain_kinds.add(kinds)
    if not isinstance(system, System) or _core.names_device():
        return None
    if isinstance(options.t0, float) and options.t0 == 0.0:
        others = (*others, _signed(options.t0))
    structure = system.structure()
    v, y = start = _block(options.v), _block(options.y)
    shapes = tuple([each.shape if type(each) is np.ndarray else () if type(each) is float else None for each in start])
    # The level may be chosen anew between two calls. Equal numbers of different types, as 1 and True, are different options.
    by = method if isinstance(method, str) else id(method)
    key = (_core.isa(), id(system) if structure is None else structure, by, shapes, kinds, others)
    kept = _kept.get(key)
    if kept is not None and (structure is not None or kept.system() is system):
        if kept.times == 0:
            kept.times, kept.run = 1, _prepared(system, method, options)
        return None if kept.run is None else kept.run.run_of(system, v, y)
    if len(_kept) >= MOST_KEPT:
        # A list at once: another thread may change the dictionary between two steps of an iteration.
        for oldest in list(_kept)[: len(_kept) + 1 - MOST_KEPT]:
            _kept.pop(oldest, None)
    _kept[key] = _Kept(system, method)
    return None


def _prepared(system: System, method: str | Method, options: Options) -> ShortRun | None:
    attributes = list(vars(system).values())
    in_dictionaries = [each for attribute in attributes if isinstance(attribute, dict) for each in attribute.values()]
    size = sum(getattr(each, "nbytes", 0) for each in attributes + in_dictionaries)
    return None if size > MOST_BYTES else short_run_of(system, method, fixed_options(options))


def fixed_options(options: Options) -> Options:
    """Options that do not change any more."""
    return Options(*map(fixed, Options._fields, options))


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


def is_free(request: Request) -> bool:
    """True if nothing of a request depends on the start but the start, so that it holds for others of the same shapes."""
    plan, system = request.plan, request.system
    has_target = system.control is not None or system.keeper is not None or system.mass_matrix is not None
    goes_on = request.before is not None or request.carried
    return not (has_target or goes_on or plan.force is not None or plan.acceptance.positive)


def is_small(request: Request) -> bool:
    """True if its start and what it saves, which are kept with it, take little memory."""
    return 8 * (1 + request.plan.save_count) * (request.v.size + request.y.size) <= MOST_BYTES


def short_run_of(system: System, method: str | Method, options: Options) -> ShortRun | None:
    """The run without its start and the numbers of its system; None if it is not known to be short, or keeps more of a start."""
    request = Request.of(system, method, options)
    if not (is_free(request) and is_small(request)):
        return None
    return short_run_of_request(
        system, request, (request.v.shape if options.v is None else np.shape(options.v), np.shape(options.y))
    )


def short_run_of_request(system: System, request: Request, shapes: tuple[Shape, Shape]) -> ShortRun | None:
    """The run without its start; None if it is not known to be short."""
    plan = request.plan
    assert request.options is not None
    asks_for_more = not DONE_BY_THE_CORE.issuperset(asked_for(request.options.options))
    has_own = isinstance(plan.t0, np.ndarray) or plan.memory is not None
    if asks_for_more or has_own or plan.form != "direct" or plan.device is not None or not plan.members:
        return None
    # A block of another shape may mean another batch, or another system.
    if any(shape not in ((), whole.shape) for shape, whole in zip(shapes, (request.v, request.y), strict=True)):
        return None
    if request.step_control is not None:
        from .short_adaptive import short_adaptive_run  # only such runs need it

        return short_adaptive_run(system, request, shapes)
    if isinstance(request.system, NBody):
        return None
    core = _core.prepared(engine.model(plan), plan, plan.members, list(map(list, shapes)))
    return None if core is None else ShortFixedRun(system, request, core)
