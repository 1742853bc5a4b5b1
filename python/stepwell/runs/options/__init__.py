"""The options of runs: one table says what each is, and all that takes options reads it."""

from __future__ import annotations

import inspect
from collections import namedtuple
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from ...errors import UnknownNameError
from .option import Option, Way
from .table import RunOptions

F = TypeVar("F", bound=Callable[..., Any])

#: Each option by its name, in the order of the table.
OPTIONS: dict[str, Option] = {name: entry.__metadata__[0] for name, entry in RunOptions.__annotations__.items()}

make: Any = namedtuple  # a type checker wants the names of fields here, which are those of the table


class Options(make("Options", OPTIONS, defaults=len(OPTIONS) * (None,))):  # type: ignore[misc]
    """The options of a run by name, unchecked; None for those that were left out."""

    __slots__ = ()


#: What arguments of SciPy's and of other solvers are here.
HINTS = {
    "t_span": "its start is t0=, its end follows from dt= and steps=, or is the last of at= with tolerance=",
    "t_eval": "with tolerance= the times of saved states are at=, with fixed steps each every=-th is saved",
    "args": "parameters are those of the system, by their names, such as decay(rate=2.0)",
    "y0": "the state at the start is y=, and v= of second-order systems",
    "v0": "the velocity at the start is v=",
    "rtol": "tolerance=1e-6 is relative, tolerance=(rtol, atol) has both parts",
    "atol": "tolerance=(rtol, atol) has both parts",
    "first_step": "with tolerance= the first step to try is dt=",
    "save_every": "each so many steps are saved by every=",
    "saveat": "with tolerance= the times of saved states are at=, with fixed steps each every=-th is saved",
    "n_steps": "the number of steps is steps=",
    "dense_output": "every=1 keeps all steps, and run(t) is the state at any time; at= are times known before",
}


def named(function: str, options: Mapping[str, Any]) -> Options:
    """The options as a function got them.

    Raises:
        UnknownNameError: if one is called otherwise here than in other packages.
        TypeError: if there is none of that name.
    """
    try:
        return Options(**options)
    except TypeError:
        pass
    for name in options:
        if name in HINTS:
            raise UnknownNameError(f"{name}: {function} has no such argument; {HINTS[name]}")
    from difflib import get_close_matches  # a mistake may take its time; the import of stepwell may not

    unknown = next(name for name in options if name not in OPTIONS)
    near = get_close_matches(unknown, OPTIONS, n=1)
    raise TypeError(
        f"{function}() got an unexpected keyword argument {unknown!r}{f'; did you mean {near[0]!r}?' if near else ''}"
    )


def with_options(way: Way | None = None) -> Callable[[F], F]:
    """Write the options that go with a way into a signature and a documentation, in place of ``**options``."""
    texts = {name: text for name, option in OPTIONS.items() if (text := option.text_of(way)) is not None}

    def of(function: F) -> F:
        own = inspect.signature(function)
        kept = [each for each in own.parameters.values() if each.kind is not inspect.Parameter.VAR_KEYWORD]
        function.__signature__ = own.replace(parameters=kept + list(map(_parameter, texts)))  # type: ignore[attr-defined]
        before, mark, after = (function.__doc__ or "").partition("        **options:")  # there is none with -OO
        if mark:
            lines = [
                f"        {name}: " + "\n            ".join(map(str.strip, text.split("\n"))) for name, text in texts.items()
            ]
            function.__doc__ = before + "\n".join(lines) + "\n" + after.partition("\n")[2]
        return function

    return of


def _parameter(name: str) -> inspect.Parameter:
    kind, default = RunOptions.__annotations__[name].__origin__, OPTIONS[name].default
    kind = getattr(kind, "__forward_arg__", kind)  # of a type that is imported for type checkers only
    default = default if kind is bool or isinstance(default, str) else None
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
