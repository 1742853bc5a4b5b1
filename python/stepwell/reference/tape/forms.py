"""First change of a tape by ``fused=True``: a function that is written in many operations is written in fewer fused ones.

Without fused multiply-adds a sine takes the reduction by π/2 in four parts, and both sine and cosine of what remains. With them
x − nπ is exact in one operation, and so is what a square or a sum loses. So one polynomial on [−π/2, π/2] is enough: with
sin r = r·(1 + r²·P(r²)), the second factor to more digits than numbers have. The error is below that of the longer form.

With eʳ = 1 + r·(1 + r·Q(r)) the rest of an exponent, r = x − n·ln 2, needs no second number: its rounding error, those of both
sums and that of the last one stay below a unit in the last place together.

A function is found by its operations, whatever their order, and replaced where it is of something that depends on the state and
where nothing else reads a value within it. So sine and cosine of one angle stay as they are: together they cost little more than
one of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from math import ldexp
from typing import Any, NamedTuple

from ..._core import Tape
from ..bits import DOUBLE, NOT_SIGN
from ..functions import exponential, trigonometric
from ..functions.pieces import NAN
from ..trig import CONSTANTS, PER_HALF_TURN
from .lines import Lines, Operation, listed, needed, of_any
from .operations import COMMUTE

#: π in three parts. The first has 53 bits, the second 29: n times it is exact for n < 2²⁴.
PI = (3.141592653589793, 1.224646798818428e-16, 3.2892513872648515e-26)
#: (eʳ − 1 − r)/r²; ``docs/coefficients.py`` finds the coefficients.
EXP_QUICK = (
    0.5000000000000013,
    0.16666666666666685,
    0.04166666666651161,
    0.008333333333315955,
    0.0013888888947850466,
    0.00019841269898657093,
    2.4801489193658203e-05,
    2.7557232875898035e-06,
    2.7631517209714487e-07,
    2.511265401198411e-08,
)
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


def quick_exponential() -> tuple[Operation, ...]:
    """eˣ = 2ⁿ·eʳ, with eʳ = 1 + r·(1 + r·Q(r))."""
    lines = Lines(DOUBLE)
    w, number = lines.write, lines.number
    constants = exponential.CONSTANTS.double
    x = w("state")
    least, most = number(constants.underflow_until), number(constants.overflow_from)
    x = w("choose", w("less", x, least), least, x)
    x = w("choose", w("less", most, x), most, x)
    magic = number(DOUBLE.magic)
    n = w("subtract", w("multiply add", x, number(constants.log2_e), magic), magic)
    upper = w("subtract multiply", n, number(constants.ln2[0]), x)  # exact
    r = w("subtract multiply", n, number(constants.ln2[1]), upper)
    z = w("multiply", r, r)

    def polynomial(coefficients: Sequence[float]) -> int:
        value = number(coefficients[-1])
        for c in coefficients[-2::-1]:
            value = w("multiply add", z, value, number(c))
        return value

    q = w("multiply add", r, polynomial(EXP_QUICK[1::2]), polynomial(EXP_QUICK[::2]))
    one = number(1.0)
    e = w("multiply add", r, w("multiply add", r, q, one), one)
    low = w("less", x, number(0.0))
    raised, lowered = (number(exponential.magic(0.0, is_low)) for is_low in (True, False))
    power = w("shift up", w("add", n, w("choose", low, raised, lowered)), extra=DOUBLE.fraction_bits)
    factor = w("choose", low, number(ldexp(1.0, -exponential.RAISED.double)), number(2.0))
    w("multiply", w("multiply", e, power), factor)
    return tuple(lines.lines)


@cache
def forms() -> tuple[Form, ...]:
    """All there are."""

    def form(function: Callable[[Any], Any], quick: tuple[Operation, ...]) -> Form:
        tape = Tape()
        plain, _ = listed(tape, [function(tape.state(0))])
        return Form(tuple(plain), quick)

    return form(trigonometric.sin, quick_sine()), form(exponential.exp, quick_exponential())


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
    """Rewrite a tape with functions in their quick forms; also the lines of the roots; all lines are needed for the roots."""
    of_state = of_any(tape, "state")
    reads = Counter([*roots, *(line for operation in tape for line in operation.of)])
    lines = Lines(DOUBLE)
    place: list[int] = []

    def is_apart(bound: dict[int, int], form: Form) -> bool:
        """True if nothing else reads a value within the function."""
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
