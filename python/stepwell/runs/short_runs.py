"""Short runs that ``integrate`` makes again: what does not depend on numbers is checked and prepared once."""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import ref

import numpy as np

from .. import _core
from ..model.methods import Method
from ..model.systems import System
from .options import Options
from .prepared import MOST_BYTES, fixed_options, short_run_of
from .result import Run
from .short import ShortRun

#: So many are kept, of systems whose parameters have at most ``MOST_BYTES``.
MOST_KEPT = 32
#: At most so many numbers of an option, or of a start that is a list, are looked at.
MOST_NUMBERS = 128
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


#: Options of these types are what they were.
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
