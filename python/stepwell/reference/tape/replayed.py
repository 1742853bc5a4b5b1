"""Operations of a tape, carried out once more: on numbers, arrays, or symbols of another tape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..functions.operations import is_symbol
from .fused import MEANING
from .rules import number

#: The operations of symbols; a constant of an operation on bits is given by its bits.
OF_SYMBOLS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negate": lambda a: -a,
    "square root": lambda a: a.sqrt(),
    "floor": lambda a: a.floor(),
    "less": lambda a, b: a < b,
    "at most": lambda a, b: a <= b,
    "equal": lambda a, b: a.equals(b),
    "choose": lambda m, a, b: m.choose(a, b),
    "and": lambda a, b: a & b,
    "or": lambda a, b: a | b,
    "exclusive or": lambda a, b: a.xor_bits(b),
}
WITH_BITS: dict[str, Callable[[Any, int], Any]] = {
    "and": lambda a, bits: a.and_bits(bits),
    "or": lambda a, bits: a.or_bits(bits),
    "add bits": lambda a, bits: a.add_bits(bits),
    "shift up": lambda a, places: a.shift_up(places),
    "shift down": lambda a, places: a.shift_down(places),
}


class Operations:
    """Values that these operations, in this order, compute from a state and parameters.

    Args:
        operations: for each line its name, the lines that it reads, and its other arguments; as ``_core.Tape.operations`` gives
            them.
        places: the lines of the values.
        single: whether they are of float32; then they are for symbols alone.
    """

    def __init__(
        self, operations: Sequence[tuple[str, Sequence[int], int]], places: Sequence[int], *, single: bool = False
    ) -> None:
        self.lines, self.places, self._single = list(operations), list(places), single
        #: For each line the lines that no later one reads: their memory is used again, which is still in the cache.
        self._done: list[list[int]] = [[] for _ in self.lines]
        seen = set(self.places)
        for line in range(len(self.lines) - 1, -1, -1):
            for each in self.lines[line][1]:
                if each not in seen:
                    seen.add(each)
                    self._done[line].append(each)

    def __call__(self, state: Sequence[Any], numbers: Sequence[Any]) -> list[Any]:
        """The values, for these numbers of the state and of the parameters: arrays that broadcast, or symbols."""
        symbol = next((each for each in (*state, *numbers) if is_symbol(each)), None)
        made: list[Any] = [None] * len(self.lines)
        for line, (name, of, given) in enumerate(self.lines):
            if name in ("state", "parameter"):
                made[line] = (state if name == "state" else numbers)[given]
            elif symbol is None:
                made[line] = MEANING[name](*(made[each] for each in of), given)
            else:
                made[line] = self._symbol(line, made, symbol)
            for each in self._done[line]:
                made[each] = None
        return [made[place] for place in self.places]

    def _symbol(self, line: int, made: list[Any], symbol: Any) -> Any:
        name, of, given = self.lines[line]
        if name == "constant":
            return symbol.number(number(given, single=self._single))
        if name.startswith("shift"):
            return WITH_BITS[name](made[of[0]], given)
        constant = next((each for each in reversed(of) if self.lines[each][0] == "constant"), None)
        if name in WITH_BITS and constant is not None:
            other = of[0] if constant == of[-1] else of[-1]
            return WITH_BITS[name](made[other], self.lines[constant][2])
        return OF_SYMBOLS[name](*(made[each] for each in of))
