"""Functions of one number, found again among the operations that became of them, so that a file may call them by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from .. import _core
from ..explanation.listing import Body
from ..reference import log, trig
from ..reference.fused import COMMUTE

#: What each is called in a file.
FUNCTIONS: dict[str, Callable[[Any], Any]] = {"sine": trig.sin, "cosine": trig.cos, "logarithm": log.log}

Operation = tuple[str, tuple[int, ...], int]


@cache
def operations_of(function: str) -> Body:
    """What a function of one number does to it, which is the state 0."""
    tape = _core.Tape()
    return tape.operations([FUNCTIONS[function](tape.state(0))])


def argument(function: str, operations: Sequence[Operation], line: int) -> int | None:
    """Of what this line is the function, or None if it is not."""
    pattern, (root,) = operations_of(function)
    found: dict[int, int] = {}

    def fits(place: int, line: int) -> bool:
        if place in found:
            return found[place] == line
        name, of, given = pattern[place]
        if name != "state":
            its_name, its_operands, its_given = operations[line]
            if (name, len(of), given) != (its_name, len(its_operands), its_given):
                return False
            before = dict(found)
            if not all(map(fits, of, its_operands)):
                found.clear()
                found.update(before)
                if name not in COMMUTE or not all(map(fits, of, reversed(its_operands))):
                    return False
        found[place] = line
        return True

    if not fits(root, line):
        return None
    return next(found[place] for place, (name, _, _) in enumerate(pattern) if name == "state")


def named(operations: list[Operation]) -> None:
    """Put names in the place of functions; what they were made of is left where it is."""
    roots = {function: operations_of(function) for function in FUNCTIONS}
    kinds = {function: body[0][body[1][0]][0] for function, body in roots.items()}
    for line in range(len(operations) - 1, -1, -1):
        for function, kind in kinds.items():
            if operations[line][0] == kind and (of := argument(function, operations, line)) is not None:
                operations[line] = function, (of,), 0
                break
