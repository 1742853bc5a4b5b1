"""Change of a tape by ``fused=True`` before products are fused: quotients by numbers become products.

A division takes as long as some ten products. With a fused multiply-add x/c is x·u + x·l rounded once, where u is 1/c cut and l
what remains of it, rounded: two operations. The result is the quotient, correctly rounded, unless it is within 2⁻⁵¹ of a unit in
the last place of the middle between two numbers, or so small that x·l is subnormal; it is then the neighbour at most. Infinities
and zeros are those of the quotient, since u and l have one sign. Of a power of two l is 0, and x·u alone is the quotient.
"""

from collections.abc import Sequence
from fractions import Fraction
from math import ldexp

from ..bits import DOUBLE, SINGLE, PerPrecision, Precision
from .lines import Lines, Operation, needed, of_any

#: Beyond this power of two a number, or its inverse, is divided by as before: the lower part might be subnormal.
LARGEST = PerPrecision(double=500, single=60)


def inverse(c: float, single: bool = False) -> tuple[float, float] | None:
    """1/c in two parts of one sign, the first one cut; None if c is too large or too small.

    Example:
        >>> inverse(4.0), inverse(3.0)
        ((0.25, 0.0), (0.3333333333333333, 1.850371707708594e-17))
    """
    precision: Precision = SINGLE if single else DOUBLE
    largest = ldexp(1.0, LARGEST.single if single else LARGEST.double)
    if not 1.0 / largest <= abs(c) <= largest:
        return None
    bits = precision.pattern(1.0 / c)
    if Fraction(precision.constant(bits)) * Fraction(c) > 1:
        bits -= 1
    upper = precision.constant(bits)
    return upper, precision.constant(precision.pattern(float(1 / Fraction(c) - Fraction(upper))))


def without_quotients(
    tape: Sequence[Operation], roots: Sequence[int], *, single: bool = False
) -> tuple[list[Operation], list[int]]:
    """Rewrite a tape with products in place of quotients of state-dependent values by numbers; also the lines of the roots.

    ``single`` is whether numbers have 32 bits. All lines are needed for the roots. A sign that is changed before the division is
    the number's instead.
    """
    precision: Precision = SINGLE if single else DOUBLE
    of_state = of_any(tape, "state")
    lines = Lines(precision)
    place: list[int] = []
    write, number = lines.write, lines.number

    def quotient(line: int) -> int | None:
        name, of, _ = tape[line]
        if name != "divide" or tape[of[1]].name != "constant":
            return None
        x, c = of[0], precision.constant(tape[of[1]].extra)
        if tape[x].name == "negate":
            x, c = tape[x].of[0], -c
        parts = inverse(c, single)
        if parts is None or not of_state[x]:
            return None
        (upper, lower), x = parts, place[x]
        if not lower:
            return write("multiply", number(upper), x)
        rest = write("multiply", number(lower), x)
        return write("multiply add", *sorted((number(upper), x)), rest)

    for line, (name, of, extra) in enumerate(tape):
        instead = quotient(line)
        place.append(write(name, *(place[each] for each in of), extra=extra) if instead is None else instead)
    return needed(lines.lines, [place[root] for root in roots])
