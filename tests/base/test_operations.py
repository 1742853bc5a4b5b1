"""One table of the tape's operations in Python, and the core's: nothing is missing in either."""

from typing import Any

import numpy as np
from stepwell import _core
from stepwell.reference.bits import DOUBLE, SINGLE
from stepwell.reference.tape.evaluate import Evaluation
from stepwell.reference.tape.operations import OPERATIONS, meaning, of_tape
from stepwell.reference.tape.replay import Replay
from stepwell.source.exports.c import C
from stepwell.source.exports.csharp import CSharp
from stepwell.source.exports.javascript import JavaScript
from stepwell.source.exports.plain_python import Python
from stepwell.source.exports.rust import Rust
from support.for_each import for_each

#: What the core has besides: leaves, lines that copy or look up, and what only a split tape has.
OTHERS = {"state", "parameter", "step", "time", "constant", "sample", "copy", "row", "uniform", "of the step", "held", "gather"}
CORE = {name: (operands, counted, commutes) for name, operands, counted, commutes in _core.tape_operations()}
#: Operations that a language writes in a way of its own.
OWN_WAY = {"add", "subtract", "multiply", "divide", "negate", "choose"}


def test_the_core_and_the_table_have_the_same_operations() -> None:
    assert set(CORE) - OTHERS == set(OPERATIONS)
    assert set(CORE) >= OTHERS
    for name, kind in OPERATIONS.items():
        _, counted, commutes = CORE[name]
        assert (kind.counted or "none", kind.commutes) == (counted, commutes), name


@for_each("single", [False, True])
@for_each("name", OPERATIONS)
def test_an_operation_is_the_same_everywhere(name: str, single: bool) -> None:
    """Its meaning for numbers; written to a tape, evaluated there and replayed; in the core, which folds constants."""
    count, kind = CORE[name][0], OPERATIONS[name]
    precision, is_fused = SINGLE if single else DOUBLE, kind.counted == "fused"
    rng = np.random.default_rng(len(name))
    rows = [precision.number_of(rng.integers(0, precision.all_bits, 200, precision.bits)) for _ in range(count)]
    rows = [np.where(np.arange(200) < 100, rng.normal(size=200).astype(row.dtype), row) for row in rows]
    if name == "choose":
        rows[0] = precision.mask(rows[0] < 0)
    tape, extra = _core.Tape(single=single), 5 if kind.has_extra else 0
    symbol = of_tape(tape, name, [tape.state(i) for i in range(count)], extra)
    with np.errstate(all="ignore"):
        want = meaning(name, single)(*rows, *[extra] * kind.has_extra)
        assert same(precision, Evaluation(tape, [symbol], {}, fuse=is_fused)(rows)[0], want)
        if not single and not is_fused:
            assert same(precision, Replay(*tape.operations([symbol]))(rows, [])[0], want)
    if is_fused:
        return  # symbols write it as two operations
    for i in range(200):
        constants = [tape.constant(int(precision.bits_of(row[i]))) for row in rows]
        lines, (place,) = tape.operations([of_tape(tape, name, constants, extra)])
        folded, bits = lines[place][0] == "constant", lines[place][2]
        assert folded == (kind.on_bits or kind.result == "truth" or name == "negate" or not np.isnan(want[i]))
        assert not folded or same(precision, precision.number_of(bits), want[i])


def same(precision: Any, a: Any, b: Any) -> bool:
    """Whether all bits are equal, but those of NaN."""
    a, b = np.broadcast_arrays(a, b)
    equal = precision.bits_of(np.ascontiguousarray(a)) == precision.bits_of(np.ascontiguousarray(b))
    return bool(np.all(equal | (np.isnan(a) & np.isnan(b))))


@for_each("language", [C, CSharp, JavaScript, Python, Rust])
def test_every_language_writes_every_operation(language: Any) -> None:
    """Comparisons have a sign, operations on bits a function of the file, others of one number a function of the language."""
    for name, kind in OPERATIONS.items():
        if kind.result == "bits":
            assert kind.sign in language.helpers, name
        elif kind.result == "number" and kind.counted != "fused" and name not in OWN_WAY:
            assert name in language.writes, name
            assert name in language.of_single.get("writes", language.writes), name
