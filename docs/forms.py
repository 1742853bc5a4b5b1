"""Prints ``rust/core/src/tape/forms_table.rs``, the functions that fused steps have in quick forms.

The specification is ``python/stepwell/reference/tape/forms.py``.
"""

from collections.abc import Sequence

from stepwell.reference.tape.forms import forms
from stepwell.reference.tape.lines import Operation

HEAD = """//! Functions and their quick forms, which `docs/forms.py` prints: see `forms.rs`.

use super::Op;

/// A function as operations, the first its argument and the last its value; and with fused operations.
#[derive(Debug)]
pub(super) struct Form {
    pub plain: &'static [Op],
    pub quick: &'static [Op],
}

#[rustfmt::skip]
pub(super) static FORMS: &[Form] = &["""
#: The core's names of operations where they are others.
NAMES = {
    "subtract": "Sub",
    "multiply": "Mul",
    "divide": "Div",
    "multiply add": "MulAdd",
    "multiply subtract": "MulSub",
    "subtract multiply": "SubMul",
    "at most": "LessEqual",
    "choose": "Select",
    "exclusive or": "Xor",
}


def text(operation: Operation) -> str:
    """An operation as the core writes it."""
    name, of, extra = operation
    if name == "constant":
        return f"Op::Const(0x{extra:016X})"
    values = [str(each) for each in of]
    if name in ("state", "shift up", "shift down"):
        values.append(str(extra))
    return (
        f"Op::{NAMES.get(name) or name.title().replace(' ', '')}({', '.join(values)})"
    )


def lines(operations: Sequence[Operation]) -> str:
    """A list of operations, some to a line."""
    rows = [""]
    for operation in operations:
        word = f"{text(operation)}, "
        if len(rows[-1]) + len(word) > 112:
            rows.append("")
        rows[-1] += word
    return "".join(f"            {row.rstrip()}\n" for row in rows)


def table() -> str:
    """The file."""
    both = []
    for form in forms():
        parts = (
            f"        {name}: &[\n{lines(each)}        ],\n"
            for name, each in zip(form._fields, form, strict=True)
        )
        both.append(f"    Form {{\n{''.join(parts)}    }},\n")
    return f"{HEAD}\n{''.join(both)}];\n"


if __name__ == "__main__":
    print(table(), end="")
