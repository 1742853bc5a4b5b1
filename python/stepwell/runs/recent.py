"""The runs that ``integrate`` made last: it prepares one that it makes again."""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import ref

import numpy as np

from .. import _core
from ..base.immutable import Immutable
from ..model.methods import Method
from ..model.systems import System
from .options import Options
from .prepared import MOST_BYTES, PreparedRun

#: So many are kept, of systems whose parameters have at most ``MOST_BYTES``.
MOST_RECENT = 32
#: A system is known by its parameters if they have at most so many bytes, else, or if it has functions, as this object.
MOST_BYTES_OF_PARAMETERS = 1 << 14
#: At most so many numbers of an option are looked up.
MOST_NUMBERS = 128


class _Recent:
    """A run that ``integrate`` made."""

    __slots__ = ("is_large", "kinds", "method", "run", "system")

    def __init__(self, system: System, method: str | Method, kinds: tuple[type, ...]) -> None:
        #: The numbers of both objects may be in its key, and may be those of others once these are gone.
        self.system, self.method = ref(system), method
        #: The types of its options: 1, 1.0 and True are equal.
        self.kinds = kinds
        #: Made at the second time, unless it would keep much memory.
        self.run: PreparedRun | None = None
        self.is_large = False


#: Those made last.
_recent: dict[Any, _Recent] = {}


class _Numbers(NamedTuple):
    """The numbers of a list, a tuple or an array, to be looked up."""

    kind: type
    types: Any
    numbers: Any


#: Options of these types are what they were.
_PLAIN = frozenset({type(None), bool, int, float, str, np.float64, _Numbers})


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


def _contents(part: Immutable) -> tuple[Any, ...] | None:
    """All that tells a system, or a part of it, from others, to be looked up; None if that is more than numbers and words."""
    contents: list[Any] = [type(part)]
    size = 0
    for name, each in vars(part).items():
        kind = type(each)
        contents.append(name)
        if kind is np.ndarray:
            size += each.nbytes
            if size > MOST_BYTES_OF_PARAMETERS or each.dtype.hasobject:
                return None
            contents += (each.shape, each.dtype.char, each.tobytes())
        elif kind is float:
            contents.append(each.hex())  # zeros have signs
        elif each is None or kind is str or kind is bool or kind is int:
            contents += (kind, each)
        elif kind is tuple and all(type(length) is int for length in each):
            contents.append(each)
        elif isinstance(each, Immutable) and (of_part := _contents(each)) is not None:
            contents.append(of_part)
        else:
            return None
    return tuple(contents)


#: The system whose contents were asked for last, and these: often it is the next one, too.
_last: list[tuple[System | None, tuple[Any, ...] | None]] = [(None, None)]


def _contents_again(system: System) -> tuple[Any, ...] | None:
    """The contents of a system, which is kept if they are few."""
    last, contents = _last[0]
    if last is not system and (contents := _contents(system)) is not None:
        _last[0] = system, contents
    return contents


def _bytes(system: System) -> int:
    """The memory of the arrays of a system."""
    attributes = list(vars(system).values())
    in_dictionaries = [each for attribute in attributes if isinstance(attribute, dict) for each in attribute.values()]
    return sum(getattr(each, "nbytes", 0) for each in attributes + in_dictionaries)


def recent(system: System, method: str | Method, options: Options) -> PreparedRun | None:
    """The run of this system, or an equal one, with all these options but the start, if ``integrate`` made it lately.

    It is prepared at the second time, since most runs are made once.
    """
    others = tuple(map(_signed, (*options[2:5], _numbers(options.tolerance), _numbers(options.at), *options[7:])))
    kinds = tuple(map(type, others))
    if not _PLAIN.issuperset(kinds) or not isinstance(system, System) or _core.names_device():
        return None
    contents = _contents_again(system)
    # The level may be chosen anew between two calls.
    key = (_core.isa(), contents or id(system), method if isinstance(method, str) else id(method), *others)
    known = _recent.get(key)
    if known is not None and known.kinds == kinds and (contents or known.system() is system):
        if known.run is None and not known.is_large:
            known.is_large = _bytes(system) > MOST_BYTES
            known.run = None if known.is_large else PreparedRun(system, method, options._replace(v=None, y=None))
        return known.run
    if len(_recent) >= MOST_RECENT:
        # A list at once: another thread may change the dictionary between two steps of an iteration.
        for oldest in list(_recent)[: len(_recent) + 1 - MOST_RECENT]:
            _recent.pop(oldest, None)
    _recent[key] = _Recent(system, method, kinds)
    return None
