"""Functions of one number, which are recognised by their operations so that a file can call them by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from ... import _core
from ...reference import log, trig
from ...reference.tape.operations import COMMUTE
from ..explanation.listing import Body

#: The functions by their names in a file.
FUNCTIONS: dict[str, Callable[[Any], Any]] = {"sine": trig.sin, "cosine": trig.cos, "logarithm": log.log}

Operation = tuple[str, tuple[int, ...], int]


@cache
def operations_of(function: str, single: bool = False) -> Body:
    """The operations of a function of one number, which is state 0; in float32 if ``single``."""
    tape = _core.Tape(single=single)
    return tape.operations([FUNCTIONS[function](tape.state(0))])


def argument(function: str, operations: Sequence[Operation], line: int, single: bool = False) -> int | None:
    """The number of the argument if this line is a value of the function, else None."""
    pattern, (root,) = operations_of(function, single)
    matched: dict[int, int] = {}

    def fits(place: int, line: int) -> bool:
        if place in matched:
            return matched[place] == line
        name, of, extra = pattern[place]
        if name != "state":
            its_name, its_operands, its_extra = operations[line]
            if (name, len(of), extra) != (its_name, len(its_operands), its_extra):
                return False
            before = dict(matched)
            if not all(map(fits, of, its_operands)):
                matched.clear()
                matched.update(before)
                if name not in COMMUTE or not all(map(fits, of, reversed(its_operands))):
                    return False
        matched[place] = line
        return True

    if not fits(root, line):
        return None
    return next(matched[place] for place, (name, _, _) in enumerate(pattern) if name == "state")


def named(operations: list[Operation], single: bool = False) -> None:
    """Replace functions by calls. The operations that are then unused stay in the list."""
    roots = {function: operations_of(function, single) for function in FUNCTIONS}
    kinds = {function: body[0][body[1][0]][0] for function, body in roots.items()}
    for line in range(len(operations) - 1, -1, -1):
        for function, kind in kinds.items():
            if operations[line][0] == kind and (of := argument(function, operations, line, single)) is not None:
                operations[line] = function, (of,), 0
                break
