"""``stepwell.method`` of a function: a user's method."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from typing import Any

from .. import _core
from ..base import checks, registry
from ..errors import ArgumentError, DTypeError, ShapeError
from ..reference.program import Program, Programs
from .method_order import order_of
from .methods import EXACT, Method, methods
from .recording import KINDS, recorded

#: The first arguments of a method's function; those that follow are the blocks that it keeps.
ARGUMENTS = ("s", "t", "h", "v", "y")


class OwnMethod(Method):
    """A method that a user defined by ``stepwell.method``: what a record says of a built-in one follows from its operations.

    Attributes:
        programs: its operations on blocks, which the reference executes.
        kept: the names of the blocks that it keeps between steps beside v and y.
    """

    programs: Programs
    kept: tuple[str, ...]

    def __init__(self, name: str, about: str, programs: Programs, source: str) -> None:
        self.programs, self.kept = programs, programs.kept
        self.kept_of_v = () if programs.begin is None else tuple(kinds(programs.begin))
        order, error_order, acceleration = order_of(name, programs)
        counted = programs.whole.first(2) if programs.estimates else programs.whole
        rates = {"dv"} if acceleration else {"dv", "dy"}
        super().__init__(
            {
                "name": name,
                "title": " ".join(word[:1].upper() + word[1:] for word in name.split("_")),
                "other_names": [],
                "false_friends": [],
                "order": order,
                "evaluations": evaluations(counted),
                "attempt_evaluations": evaluations(programs.whole) if programs.estimates else 0,
                "extension_evaluations": 0,
                "family": "of your own",
                "nodes": sorted({share for kind, _, share in counted.operations if kind in rates}),
                "needs_acceleration": acceleration,
                "is_implicit": False,
                "carry": None,
                "starts": [],
                "error_order": error_order,
                "section": "",
                "reference": source,
                "about": about,
            }
        )
        self.key = f"{name} {_digest(programs)}"
        whole, begin = programs.whole, programs.begin
        _core.define(
            self.key,
            name,
            _as_lists(counted),
            acceleration=acceleration,
            attempt=_as_lists(whole) if programs.estimates else None,
            error_order=error_order or 0,
            start=None if begin is None else _as_lists(Program(begin.operations, (0, *begin.results))),
            kept=list(self.kept_of_v),
        )

    @property
    def limit(self) -> float:  # type: ignore[override]  # of methods that are built in it is in the record
        """The undamped oscillator is stable for Φ = ω₀·dt below this limit; 0 means never. It is found when it is first read."""
        if "_limit" not in vars(self):
            object.__setattr__(self, "_limit", float(registry.task("oscillator_limit")(self)))
        limit: float = vars(self)["_limit"]
        return limit

    @property
    def steps(self) -> Any:
        """Its operations, executed over arrays."""
        return self.programs

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.name, self.about, self.programs, self.reference)


def _again(name: str, about: str, programs: Any, source: str) -> OwnMethod:
    """The method of these programs; the same object each time, since others compare methods by identity."""
    programs = Programs(*programs)
    key = name, about, programs, source
    if key not in _KNOWN:
        _KNOWN[key] = OwnMethod(name, about, programs, source)
    return _KNOWN[key]


def as_data(method: OwnMethod) -> dict[str, Any]:
    """A method as lists, words and numbers, for files."""
    whole, begin, kept = method.programs
    programs = [None if each is None else _as_lists(each) for each in (whole, begin)]
    return {"name": method.name, "about": method.about, "source": method.reference, "programs": programs, "kept": list(kept)}


def of_data(data: dict[str, Any]) -> OwnMethod:
    """The method that ``as_data`` described."""
    whole, begin = (None if each is None else _of_lists(*each) for each in data["programs"])
    if whole is None:
        raise ArgumentError("method: expected the operations of its step, got none")
    programs = Programs(whole, begin, tuple(map(str, data["kept"])))
    return _again(str(data["name"]), str(data["about"]), programs, str(data["source"]))


def _of_lists(operations: list[Any], results: list[Any]) -> Program:
    entries = ((str(name), tuple(map(int, of)), float(number)) for name, of, number in operations)
    return Program(tuple(entries), tuple(map(int, results)))


_KNOWN: dict[Any, OwnMethod] = {}


def evaluations(program: Program) -> int:
    """How often a program asks for the rate of v."""
    return sum(name == "dv" for name, _, _ in program.operations)


def kinds(program: Program) -> list[bool]:
    """A flag for each result of a program without kept blocks: True for one of velocities."""
    of_v: list[bool] = []
    for name, of, _ in program.operations:
        of_v.append(name in ("v", "dv", "velocity") or (name in ("add", "subtract", "scale") and of_v[of[0]]))
    return [of_v[place] for place in program.results]


def _as_lists(program: Program) -> tuple[list[tuple[str, list[int], float]], list[int]]:
    return [(name, list(of), number) for name, of, number in program.operations], list(program.results)


def _digest(programs: Programs) -> str:
    """Stands for the operations, with every bit of their numbers."""
    parts = [
        [] if program is None else [[(name, of, number.hex()) for name, of, number in program.operations], program.results]
        for program in (programs.whole, programs.begin)
    ]
    return hashlib.sha256(repr((parts, programs.kept)).encode()).hexdigest()[:16]


def own_method(function: Callable[..., Any], start: Callable[..., Any] | None = None) -> OwnMethod:
    """The method of a function: see ``stepwell.method``."""
    name = getattr(function, "__name__", "")
    if not name.isidentifier():
        raise ArgumentError(f"method: expected a function with a name, by def, got {checks.short(function)}")
    if name in {EXACT.name, *(each.name for each in methods())}:
        raise ArgumentError(f"method: {name!r} is built in; give your function another name")
    names = _arguments("method", function)
    kept, begin = names[len(ARGUMENTS) :], None
    of_kept: list[bool] = []
    if kept and start is None:
        raise ArgumentError(
            f"start: expected a function (s, t, h, v, y) that returns {', '.join(kept)} for the first step, since {name} has "
            f"{'it' if len(kept) == 1 else 'them'} from the step before"
        )
    if start is not None:
        if not kept:
            raise ArgumentError(f"start: expected none, since {name} keeps no blocks: its arguments are {', '.join(names)}")
        _arguments("start", start, kept=False)
        begin, of_kept = recorded(start, "start")
        if len(of_kept) != len(kept):
            raise ShapeError(f"start: expected {len(kept)} blocks to be returned, {', '.join(kept)}, got {len(of_kept)}")
    whole, of_results = recorded(function, name, of_kept)
    _check_results(name, of_results, kept, of_kept)
    code = getattr(function, "__code__", None)
    source = f"{code.co_filename.rsplit('/', 1)[-1]}, line {code.co_firstlineno}" if code is not None else name
    return _again(name, inspect.getdoc(function) or "", Programs(whole, begin, kept), source)


def _arguments(name: str, function: Callable[..., Any], kept: bool = True) -> tuple[str, ...]:
    """The names of a function's arguments; ``name`` is the argument that it was given as."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        raise DTypeError(f"{name}: expected a function of Python, got {checks.short(function)}") from None
    names = tuple(each.name for each in parameters)
    plain = all(each.kind is each.POSITIONAL_OR_KEYWORD and each.default is each.empty for each in parameters)
    if not plain or len(names) < len(ARGUMENTS) or (len(names) > len(ARGUMENTS) and not kept):
        more = ", and behind them the blocks that it keeps," if kept else ""
        raise ArgumentError(
            f"{name}: expected a function of ({', '.join(ARGUMENTS)}){more} without defaults, got "
            f"{function.__name__}({', '.join(names)})"
        )
    return names


def _check_results(name: str, results: list[bool], kept: tuple[str, ...], of_kept: list[bool]) -> None:
    """Raise unless a step returns the state and what is kept, or the state and estimates of its errors."""
    wanted = [True, False, *of_kept]
    if results == wanted or (not kept and results == [True, False, True, False]):
        return
    expected = f"v, y, {', '.join(kept)}" if kept else "v, y or v, y, error_v, error_y"
    raise ShapeError(
        f"{name}: expected to return {expected}, got {len(results)} blocks: {', '.join(KINDS[each] for each in results)}"
        + (f"; start returns {', '.join(KINDS[each] for each in of_kept)}" if kept else "")
    )
