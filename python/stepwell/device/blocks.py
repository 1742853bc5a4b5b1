"""Operations of a method on blocks, as kernels: a work item for each number, a kernel between two evaluations of the rates.

A second-order system needs one evaluation, h·v̇ at some places; h·ẏ is h·v. So all that stands between two evaluations is
elementwise, and a kernel computes the places of the next one, or the new state, from the state and all h·v̇ up to there. What it
needs twice is computed twice, which is less than the memory would take.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .. import _core
from ..errors import UnsupportedError

#: The block of h·v̇ at the places of the state, which all stages share.
HERE = "here"
#: The operations of a method that are written here.
WRITTEN = frozenset({"v", "y", "kept v", "kept y", "dv", "dy", "velocity", "add", "subtract", "scale", "mass"})


class Pass(NamedTuple):
    """A kernel over all numbers of a block, with the blocks that it reads, and writes unless it computes places.

    ``asks`` is the block of h·v̇ at the places that it computes; "" if it computes none.
    """

    name: str
    reads: list[str]
    writes: list[str]
    asks: str


class Stage(NamedTuple):
    """A stage of a method: its kernels, in order, and their text.

    ``last`` is the block of h·v̇ at the places at the end, as the next step may begin with it; "" if it is not asked for, or
    depends on more than places.
    """

    passes: list[Pass]
    text: str
    last: str


def unwritten(method: str) -> str:
    """An operation of a method that is not written here, or ""."""
    return next((name for name, _, _ in _core.program(method)[0] if name not in WRITTEN), "")


def stage_of(method: str, stage: str, choice: int, results: list[str], *, pushed: bool) -> Stage:
    """The kernels of a stage, which writes these blocks.

    The blocks of the state are "v", which is what the method carries in its place, "y", and "kept0", "kept1", … What is
    ``pushed`` by a control has rates that depend on v, too: each evaluation is then one of its own, at places and velocities.
    """
    operations, places = _core.program(method, stage=stage, choice=choice)
    if any(name not in WRITTEN for name, _, _ in operations):
        raise UnsupportedError(f"device: many bodies make no steps by {method} there; use device='cpu'")
    # What an operation is: a block, or a text of what it computes from others.
    block: dict[int, str] = {}
    text: dict[int, tuple[str, list[int]]] = {}
    same = list(range(len(operations)))  # masses of these equations are units
    evaluations: dict[Any, str] = {}
    order: list[list[int]] = []
    for i, (name, operands, number) in enumerate(operations):
        of = [same[each] for each in operands]
        match name:
            case "v" | "y":
                block[i] = name
            case "kept v" | "kept y":
                block[i] = f"kept{int(number)}"
            case "dv":
                key = (i,) if pushed else of[1]  # a push counts what it takes away, evaluation by evaluation
                if key not in evaluations:
                    evaluations[key] = HERE if block.get(of[1]) == "y" and not pushed else f"{stage}{len(order)}"
                    order.append([of[1], of[0]] if pushed else [of[1]])
                block[i] = evaluations[key]
            case "dy":
                text[i] = "h * {}", of[:1]
            case "velocity":
                text[i] = "{} / h", of
            case "add":
                text[i] = "{} + {}", of
            case "subtract":
                text[i] = "{} - {}", of
            case "scale":
                text[i] = f"({float(number).hex()}) * {{}}", of
            case _:
                same[i] = of[0]

    def computed(targets: list[int]) -> tuple[list[str], list[str]]:
        """The blocks that these operations need, and the statements that compute them."""
        needed, open_ = set(), list(targets)
        while open_:
            i = open_.pop()
            if i not in needed:
                needed.add(i)
                open_ += text[i][1] if i in text else []
        blocks = list(dict.fromkeys(block[i] for i in sorted(needed) if i in block))
        lines = [f"const real {name} = of_{name}[g];" for name in blocks]
        for i in sorted(needed):
            if i in text:
                pattern, of = text[i]
                lines.append(f"const real x{i} = {pattern.format(*(value(each) for each in of))};")
        return blocks, lines

    def value(i: int) -> str:
        return block.get(i, f"x{i}")

    passes, texts, names = [], [], list(evaluations.values())
    for turn, where in enumerate(order):
        reads, lines = computed(where)
        made = Pass(f"{stage}_pass{turn}", reads, [], names[turn])
        passes.append(made)
        lines.append(f"put_place({value(where[0])}, g, all, n, ranks, places, round);")
        lines += [f"speeds[g] = {value(velocity)};" for velocity in where[1:]]
        texts.append(_kernel(made, lines, pushed))
    targets = [same[i] for i in places]
    reads, lines = computed(targets)
    last = Pass(f"{stage}_last", reads, results, "")
    to = [f"to_{name}[g] = {value(i)};" for name, i in zip(results, targets, strict=True)]
    at_end = evaluations.get(targets[results.index("y")], "") if "y" in results else ""
    return Stage([*passes, last], "\n".join([*texts, _kernel(last, [*lines, *to])]), "" if at_end == HERE else at_end)


def _kernel(made: Pass, body: list[str], pushed: bool = False) -> str:
    """The text of a kernel. Blocks that are written may be among those that are read: each work item has numbers of its own."""
    reads = [f"__global const real *of_{name}" for name in made.reads]
    writes = [f"__global real *to_{name}" for name in made.writes]
    if made.asks:
        writes = ["const int all", "const int n", "__global const int *ranks", "__global real *places", "__global real *round"]
        writes += ["__global real *speeds"] * pushed
    return "\n".join(
        [
            f"__kernel void {made.name}(const long count, const real h, {', '.join([*reads, *writes])}) {{",
            "const long g = get_global_id(0);",
            "if (g >= count) return;",
            *body,
            "}",
        ]
    )
