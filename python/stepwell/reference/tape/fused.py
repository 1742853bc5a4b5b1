"""The second exact arithmetic: sums with a product in them are fused multiply-adds, a·b + c rounded once.

Which products are fused is decided on the tape of a step, so it is the same on every machine.
"""

from collections.abc import Sequence

from .forms import in_quick_forms
from .increments import increments_last
from .lines import Operation, of_any, ranks
from .quotients import without_quotients
from .terms import terms_apart


def fused(tape: Sequence[Operation], roots: Sequence[int], *, single: bool = False) -> tuple[list[Operation], list[int]]:
    """Rewrite a tape with fused multiply-adds; also the lines of the roots on it.

    ``roots`` are the lines of the next state, and all others are needed for them. First functions get their quick forms,
    increments are multiplied last, quotients by numbers become products, and sums of two products are taken apart. Then a product
    is fused into the sum or the difference of which it is a term if nothing else reads it and it depends on the state. Of two
    such products the one of the higher rank is fused.
    """
    tape, roots = in_quick_forms(tape, roots)
    tape, roots = increments_last(tape, roots, single=single)
    tape, roots = without_quotients(tape, roots, single=single)
    tape, roots = terms_apart(tape, roots)
    rank = ranks(tape)
    reads = [0] * len(tape)
    for line in [*roots, *(line for operation in tape for line in operation.of)]:
        reads[line] += 1
    of_state = of_any(tape, "state")

    def can(line: int) -> bool:
        return tape[line].name == "multiply" and reads[line] == 1 and of_state[line]

    out = []
    for operation in tape:
        if operation.name in ("add", "subtract"):
            a, b = operation.of
            product = max((line for line in {a, b} if can(line)), key=rank.__getitem__, default=None)
            if product is not None:
                other = b if product == a else a
                name = "multiply add" if operation.name == "add" else "multiply subtract" if product == a else "subtract multiply"
                operation = Operation(name, (*tape[product].of, other), 0)
        out.append(operation)
    return out, roots
