"""What ``fused=True`` does to a tape first of all: a sine that is written in many operations is written in fewer fused ones.

Without fused multiply-adds a sine takes the reduction by π/2 in four parts, and both sine and cosine of what remains. With them
x − nπ is exact in one operation, and so is what a square or a sum loses. So one polynomial on [−π/2, π/2] is enough: with
sin r = r·(1 + r²·P(r²)), the second factor to more digits than numbers have. The error is below that of the longer form.

A function is found by its operations, whatever their order, and replaced where it is of something that depends on the state and
where nothing else reads a value within it. So sine and cosine of one angle stay as they are: together they cost little more than
one of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from ..._core import Tape
from ..bits import DOUBLE, NOT_SIGN
from ..functions import trigonometric
from ..functions.pieces import NAN
from ..trig import CONSTANTS, PER_HALF_TURN
from .lines import Lines, Operation, listed, needed, of_any
from .operations import COMMUTE

#: π in three parts. The first has 53 bits, the second 29: n times it is exact for n < 2²⁴.
PI = (3.141592653589793, 1.224646798818428e-16, 3.2892513872648515e-26)
#: The derivative of (sin r)/r by r² about r² = 2, where the rest of r² is largest; and (cos r − 1)/r² at r = π/2.
SLOPE, COSINE = -0.135, -0.405


class Form(NamedTuple):
    """A function as lines, of which the first is its argument and the last its value; and with fused operations."""

    plain: tuple[Operation, ...]
    quick: tuple[Operation, ...]


def quick_sine() -> tuple[Operation, ...]:
    """Sin x, NaN beyond ``largest_angle``."""
    lines = Lines(DOUBLE)
    w, number = lines.write, lines.number
    s = CONSTANTS.double.sin
    x = w("state")
    size = w("and", x, w("constant", extra=NOT_SIGN))
    can = w("at most", size, number(trigonometric.CONSTANTS.double.largest_angle))
    x = w("choose", can, x, number(NAN))
    magic, one = number(DOUBLE.magic), number(1.0)
    turn = w("multiply add", x, number(PER_HALF_TURN), magic)
    n = w("subtract", turn, magic)
    first = w("subtract multiply", n, number(PI[0]), x)  # exact
    second = w("multiply", n, number(PI[1]))
    r = w("subtract", first, second)
    # By how much r is too large; not by how much it is too small, so that the sine of −0 is −0.
    excess = w("multiply add", n, number(PI[2]), w("add", w("subtract", r, first), second))
    z = w("multiply", r, r)
    z_rest = w("multiply subtract", r, r, z)
    factor = w("multiply add", z, number(s[0]), one)
    rest = w("multiply add", z, number(s[0]), w("subtract", one, factor))
    polynomial = number(s[-1])
    for c in s[-2:0:-1]:
        polynomial = w("multiply add", z, polynomial, number(c))
    rest = w("multiply add", w("multiply", z, z), polynomial, rest)
    rest = w("multiply add", z_rest, number(SLOPE), rest)
    lost = w("multiply", excess, w("multiply add", z, number(COSINE), one))
    sine = w("multiply add", r, factor, w("multiply subtract", r, rest, lost))
    w("exclusive or", sine, w("shift up", turn, extra=DOUBLE.sign_place))
    return tuple(lines.lines)


@cache
def forms() -> tuple[Form, ...]:
    """All there are."""
    tape = Tape()
    plain, _ = listed(tape, [trigonometric.sin(tape.state(0))])
    return (Form(tuple(plain), quick_sine()),)


def bound_lines(form: Form, tape: Sequence[Operation], line: int) -> dict[int, int] | None:
    """For each line of a form the one of the tape that it is, if this line is the function's value; else None."""
    bound: dict[int, int] = {}

    def fits(of_form: int, at: int) -> bool:
        if of_form in bound:
            return bound[of_form] == at
        name, of, extra = form.plain[of_form]
        other, operands, its_extra = tape[at]
        if name == "state":
            bound[of_form] = at
            return True
        if (name, extra) != (other, its_extra):
            return False
        for order in (operands, operands[::-1]) if name in COMMUTE else (operands,):
            before = dict(bound)
            bound[of_form] = at
            if all(fits(*pair) for pair in zip(of, order, strict=True)):
                return True
            bound.clear()
            bound.update(before)
        return False

    return bound if fits(len(form.plain) - 1, line) else None


def in_quick_forms(tape: Sequence[Operation], roots: Sequence[int]) -> tuple[list[Operation], list[int]]:
    """The same tape with functions in their quick forms, and the lines of the roots; all lines are needed for the roots."""
    of_state = of_any(tape, "state")
    reads = Counter([*roots, *(line for operation in tape for line in operation.of)])
    lines = Lines(DOUBLE)
    place: list[int] = []

    def is_apart(bound: dict[int, int], form: Form) -> bool:
        """Whether nothing else reads a value within the function."""
        within = Counter(bound[each] for operation in form.plain for each in operation.of)
        inner = [bound[line] for line, (name, _, _) in enumerate(form.plain[:-1]) if name not in ("state", "constant")]
        return all(within[line] == reads[line] for line in inner)

    def instead(line: int) -> int | None:
        for form in forms():
            if tape[line].name != form.plain[-1].name or (bound := bound_lines(form, tape, line)) is None:
                continue
            if of_state[bound[0]] and is_apart(bound, form):
                made = [place[bound[0]]]
                for name, of, extra in form.quick[1:]:
                    made.append(lines.write(name, *(made[each] for each in of), extra=extra))
                return made[-1]
        return None

    for line, (name, of, extra) in enumerate(tape):
        quick = instead(line)
        place.append(lines.write(name, *(place[each] for each in of), extra=extra) if quick is None else quick)
    return needed(lines.lines, [place[root] for root in roots])
