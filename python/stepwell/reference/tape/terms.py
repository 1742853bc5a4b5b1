"""Change of a tape by ``fused=True`` before products are fused: sums of two products are taken apart.

a + (p·q + r·s) is a product, a fused multiply-add and a sum. As (a + p·q) + r·s it is two fused multiply-adds, and the product
that is known last has one operation after it in place of three. So it is written, unless a depends on the state and is of a
higher rank than both products, and so known last itself. Each of the terms may have the other sign.
"""

from collections.abc import Sequence

from ..bits import DOUBLE
from .lines import Lines, Operation, needed, of_any, ranks

SUMS = ("add", "subtract")


def terms_apart(tape: Sequence[Operation], roots: Sequence[int]) -> tuple[list[Operation], list[int]]:
    """Rewrite a tape with the terms of such sums in this order; also the lines of the roots. All lines are needed for the roots.

    Both products and their sum depend on the state and are read once. Of two such sums the one of the higher rank is taken apart.
    """
    rank, of_state, written = ranks(tape), of_any(tape, "state"), Lines(DOUBLE)
    reads = [0] * len(tape)
    for line in [*roots, *(line for operation in tape for line in operation.of)]:
        reads[line] += 1
    place: list[int] = []

    def is_product(line: int) -> bool:
        return tape[line].name == "multiply" and reads[line] == 1 and of_state[line]

    def is_sum(line: int) -> bool:
        return tape[line].name in SUMS and reads[line] == 1 and all(map(is_product, tape[line].of))

    def positive(is_minus: bool, line: int) -> tuple[bool, int]:
        """A flag for a value that is subtracted, and its line, or that of what it is the negative of."""
        turned = tape[line].name == "negate" and reads[line] == 1
        return is_minus != turned, tape[line].of[0] if turned else line

    def added(terms: list[tuple[bool, int]]) -> tuple[bool, int]:
        """The sum of two values, each with whether it is subtracted; whether that is the sum's negative, and its line."""
        (is_minus, x), (other_is_minus, y) = terms
        if is_minus == other_is_minus:
            return is_minus, written.write("add", x, y)
        return False, written.write("subtract", y, x) if is_minus else written.write("subtract", x, y)

    def apart(line: int) -> int | None:
        name, of, _ = tape[line]
        if name not in SUMS:
            return None
        both = [positive(False, of[0]), positive(name == "subtract", of[1])]
        sums = [each for each in both if is_sum(each[1])]
        if not sums:
            return None
        inner = max(sums, key=lambda term: rank[term[1]])
        other = both[1 - both.index(inner)]
        is_minus, (p, q) = inner[0], tape[inner[1]].of
        products = [(is_minus, p), (is_minus != (tape[inner[1]].name == "subtract"), q)]
        first, last = sorted(products, key=lambda term: rank[term[1]])
        if of_state[other[1]] and rank[other[1]] > rank[last[1]]:
            return None
        terms = [(sign, place[value]) for sign, value in (other, first, last)]
        is_minus, sum_of_all = added([added(terms[:2]), terms[2]])
        return written.write("negate", sum_of_all) if is_minus else sum_of_all

    for line, (name, of, extra) in enumerate(tape):
        instead = apart(line)
        place.append(written.write(name, *(place[each] for each in of), extra=extra) if instead is None else instead)
    return needed(written.lines, [place[root] for root in roots])
