"""The operations of a cut tape as statements of OpenCL C, one each: the printed step does what the core does, in its order.

A value is a number, a truth (a comparison, for the core a mask of bits) or bits; it is turned into another of these where an
operation asks for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..reference.bits import DOUBLE, SINGLE

#: The operations of a body and the places of its results, as the core returns them.
Body = tuple[Sequence[tuple[str, Sequence[int], int]], Sequence[int]]

#: Text before all kernels: no product is contracted with a sum.
HEAD = """#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF
"""
#: In float32: the names of the types of numbers and of their bits.
TYPES = {
    False: "typedef double real;\ntypedef ulong bits;\n#define bits_of as_ulong\n#define number_of as_double\n",
    True: "typedef float real;\ntypedef uint bits;\n#define bits_of as_uint\n#define number_of as_float\n",
}

ARITHMETIC = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "multiply add": "fma({}, {}, {})",
    "multiply subtract": "fma({}, {}, -{})",
    "subtract multiply": "fma(-{}, {}, {})",
    "square root": "sqrt({})",
    "negate": "-{}",
    "floor": "floor({})",
}
COMPARISONS = {"less": "{} < {}", "at most": "{} <= {}", "equal": "{} == {}"}
OF_BITS = {"and": "{} & {}", "or": "{} | {}", "exclusive or": "{} ^ {}", "add bits": "{} + {}", "subtract bits": "{} - {}"}


class Printer:
    """Writes bodies, of float32 if ``single``; names begin with a prefix, so that several stand in one kernel."""

    def __init__(self, single: bool) -> None:
        self._precision = SINGLE if single else DOUBLE
        self._width = 32 if single else 64
        self._all = (1 << self._width) - 1
        self._suffix = "f" if single else ""
        self._ending = "U" if single else "UL"

    def constant(self, pattern: int) -> str:
        """A number by its bits, exactly."""
        pattern &= self._all
        x = float(self._precision.number_of(pattern))
        if x != x or x in (float("inf"), -float("inf")):
            return f"number_of({self._bits(pattern)})"
        text = f"{x.hex()}{self._suffix}"
        return f"({text})" if text[0] == "-" else text

    def _bits(self, pattern: int) -> str:
        return f"0x{pattern & self._all:x}{self._ending}"

    def body(self, body: Body, leaf: Callable[[str, int, str], str], prefix: str) -> tuple[list[str], list[str]]:
        """The statements of a body, and the texts of its results as numbers.

        ``leaf`` has the text of a leaf, by its name, its number and, of a "gather", the text of its operand.
        """
        operations, roots = body
        lines: list[str] = []
        texts: list[tuple[str, str]] = []  # the kind and the text of each value

        def number(i: int) -> str:
            kind, text = texts[i]
            name, _, extra = operations[i]
            if name == "constant":
                return self.constant(extra)
            return text if kind == "number" else f"number_of({pattern(i)})"

        def pattern(i: int) -> str:
            kind, text = texts[i]
            name, _, extra = operations[i]
            if name == "constant":
                return self._bits(extra)
            if kind == "truth":
                return f"({text} ? {self._bits(self._all)} : {self._bits(0)})"
            return text if kind == "bits" else f"bits_of({text})"

        def is_truth(i: int) -> bool:
            name, _, extra = operations[i]
            return texts[i][0] == "truth" or (name == "constant" and extra & self._all in (0, self._all))

        def truth(i: int) -> str:
            name, _, extra = operations[i]
            return ("1" if extra & self._all else "0") if name == "constant" else texts[i][1]

        def written(i: int) -> tuple[str, str]:
            name, of, extra = operations[i]
            if name in ARITHMETIC:
                return "number", ARITHMETIC[name].format(*map(number, of))
            if name in COMPARISONS:
                return "truth", COMPARISONS[name].format(*map(number, of))
            if name in OF_BITS:
                if (
                    name not in ("add bits", "subtract bits")
                    and all(map(is_truth, of))
                    and any(texts[each][0] == "truth" for each in of)
                ):
                    return "truth", OF_BITS[name].format(*map(truth, of))
                for one, other in (of, of[::-1]):
                    if name == "and" and operations[one][0] == "constant" and operations[one][2] == self._all >> 1:
                        return "number", f"fabs({number(other)})"
                return "bits", OF_BITS[name].format(*map(pattern, of))
            if name in ("shift up", "shift down"):
                sign = "<<" if name == "shift up" else ">>"
                return "bits", f"{pattern(of[0])} {sign} {extra}" if extra < self._width else self._bits(0)
            if name == "choose":
                mask, yes, no = of
                if not is_truth(mask):
                    return "bits", f"({pattern(mask)} & {pattern(yes)}) | (~{pattern(mask)} & {pattern(no)})"
                kinds = {texts[each][0] for each in (yes, no)}
                if (kinds <= {"number", "constant"} and "number" in kinds) or kinds == {"constant"}:
                    return "number", f"{truth(mask)} ? {number(yes)} : {number(no)}"
                if is_truth(yes) and is_truth(no):
                    return "truth", f"{truth(mask)} ? {truth(yes)} : {truth(no)}"
                return "bits", f"{truth(mask)} ? {pattern(yes)} : {pattern(no)}"
            if name == "copy":
                return texts[of[0]] if texts[of[0]][0] != "constant" else ("number", number(of[0]))
            return "number", leaf(name, extra, number(of[0]) if of else "")

        types = {"number": "real", "truth": "int", "bits": "bits"}
        for i, (name, of, _) in enumerate(operations):
            if name == "constant":
                texts.append(("constant", ""))
                continue
            kind, text = written(i)
            if of and name != "copy":
                lines.append(f"const {types[kind]} {prefix}{i} = {text};")
                text = f"{prefix}{i}"
            texts.append((kind, text))
        return lines, [number(root) for root in roots]
