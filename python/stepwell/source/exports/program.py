"""What a file computes, as the languages share it: values, branches, loops, functions, and tables of samples."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

#: The block of a force from outside, and the argument.
FORCE = "force"


class Assignment(NamedTuple):
    """A value and its formula.

    Attributes:
        name: as it is used.
        kind: "number", "truth" or "bits".
        text: its formula.
        note: its meaning in the method, if the name does not say it.
        evaluation: the rate evaluation to which it belongs, counted from 1; 0 if that is not known.
        role: "new"; "variable" if it is set again in a branch, without a text if in both; "set" there.
    """

    name: str
    kind: str
    text: str
    note: str = ""
    evaluation: int = 0
    role: str = "new"


class Conditional(NamedTuple):
    """What is computed if a condition holds, and if not."""

    condition: str
    then: list[Statement]
    other: list[Statement]


class Loop(NamedTuple):
    """So many equal operations: element i of the target array becomes the value of a text.

    Of the state, ``@y[i]`` is an element before the step, ``#y[i]`` one after it.
    """

    times: int
    target: str
    text: str


Statement = Assignment | Conditional | Loop


class Place(NamedTuple):
    """A number of a state, and its name in a function; ``at`` is −1 if its block is one number."""

    block: str
    at: int
    name: str


class Function(NamedTuple):
    """The contents of a function.

    Attributes:
        reads: the numbers of the state that it needs.
        needs_time: whether it needs the time.
        of_time: the values that depend on the time alone.
        lines: the values that depend on the state.
        writes: the numbers that it writes.
        work: the length of the array in which loops compute; 0 without loops.
    """

    reads: list[Place]
    needs_time: bool
    of_time: list[Assignment]
    lines: list[Statement]
    writes: list[Place]
    work: int = 0


class Table(NamedTuple):
    """The samples of an input: their name, the field of the time of the first, and the field of the interval to the next.

    If it is one of ``times``, it has the numbers of the samples, from which their times follow.
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
        else:
            formulas.append(each.text)
    return formulas
