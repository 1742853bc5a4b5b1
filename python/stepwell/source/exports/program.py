"""The contents of a file that all languages share: values, branches, loops, functions, and tables of samples."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

#: The block of a force from outside, and the argument.
FORCE = "force"


class Assignment(NamedTuple):
    """A value and its formula.

    Attributes:
        name: its name in the file.
        kind: "number", "truth" or "bits".
        text: its formula.
        note: its meaning in the method, if the name does not say it.
        evaluation: the rate evaluation to which it belongs, counted from 1; 0 if that is not known.
        role: "new" for a value; "variable" for the declaration of one that branches set, without a text if both sides do; "set"
            for its assignments there.
    """

    name: str
    kind: str
    text: str
    note: str = ""
    evaluation: int = 0
    role: str = "new"


class Conditional(NamedTuple):
    """The statements if a condition holds, and those if it does not."""

    condition: str
    then: list[Statement]
    other: list[Statement]


class Loop(NamedTuple):
    """Equal operations, repeated ``times``: element i of the target array becomes the value of a text.

    ``@y[i]`` is an element of the state before the step, ``#y[i]`` one after it.
    """

    times: int
    target: str
    text: str


class Lanes(NamedTuple):
    """Statements that are repeated ``times``; they read and write elements i of arrays, which are written as in a ``Loop``."""

    times: int
    lines: list[Statement]


Statement = Assignment | Conditional | Loop | Lanes


class Place(NamedTuple):
    """A number of a state, and its name in a function; ``at`` is −1 if its block is one number."""

    block: str
    at: int
    name: str


class Function(NamedTuple):
    """The contents of a function.

    Attributes:
        reads: the numbers of the state and of a force that it needs.
        needs_time: whether it needs the time.
        of_time: the values that depend on the time alone.
        lines: the values that depend on the state.
        writes: the numbers that it writes.
        work: the length of the array in which values of loops wait for other loops; None without loops.
    """

    reads: list[Place]
    needs_time: bool
    of_time: list[Assignment]
    lines: list[Statement]
    writes: list[Place]
    work: int | None = None


class Table(NamedTuple):
    """The samples of an input, with the field of the time of the first one, and the field of the interval between samples.

    A table of ``times`` has the numbers of the samples, from which their times follow.
    """

    name: str
    about: str
    values: list[float]
    start: str
    interval: str
    times: bool = False


def texts(statements: Iterable[Statement]) -> list[str]:
    """All formulas of these statements."""
    formulas: list[str] = []
    for each in statements:
        if isinstance(each, Conditional):
            formulas += [each.condition, *texts(each.then), *texts(each.other)]
        elif isinstance(each, Loop):
            formulas += [each.target, each.text]
        elif isinstance(each, Lanes):
            formulas += texts(each.lines)
        else:
            formulas.append(each.text)
    return formulas
