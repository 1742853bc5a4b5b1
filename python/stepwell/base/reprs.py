"""How objects are shown: as one line in a terminal, as a small table in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

#: The most characters of such a line and of a word in it, and the most elements of a sequence that are shown.
MAX_LINE, MAX_WORD, MAX_PARTS = 200, 40, 4

#: A longer number is shown with six digits.
MAX_FLOAT = 8

#: Longer arrays are shown by their shape.
MAX_NUMBERS = 4

#: The most rows of a table in a notebook.
MAX_ROWS = 30


def one_line(thing: Any) -> str:
    """The class of an object and its fields, each in a few characters."""
    if hasattr(thing, "__dataclass_fields__"):
        names = [name for name, field in thing.__dataclass_fields__.items() if field.repr and not name.startswith("_")]
    elif hasattr(thing, "_fields"):
        names = list(thing._fields)
    else:
        names = [name for name in vars(thing) if not name.startswith("_")]
    text = ", ".join(f"{name}={brief(getattr(thing, name))}" for name in names)
    return shortened(f"{type(thing).__name__}({text})", MAX_LINE)


def brief(value: Any) -> str:
    """A value in a few characters: a method by its name, an array by its shape, a long container by its length."""
    if isinstance(value, np.ndarray):
        return (
            str(value.tolist())
            if value.ndim > 0 and value.size <= MAX_NUMBERS
            else brief(value.item())
            if value.size == 1
            else f"array{value.shape}".replace(",)", ")")
        )
    if isinstance(value, (float, np.floating)):
        exact = repr(float(value))
        return exact if len(exact) <= MAX_FLOAT else f"{value:.6g}"
    if isinstance(value, str):
        return repr(shortened(value, MAX_WORD))
    if isinstance(value, (bool, int, np.generic)) or value is None:
        return str(value)
    if isinstance(value, dict):
        return "{" + (", ".join(map(str, value)) if len(value) <= MAX_PARTS else f"{len(value)} entries") + "}"
    if type(value) in (tuple, list):
        if len(value) <= MAX_PARTS and all(isinstance(each, (str, int, float)) for each in value):
            return f"({', '.join(map(brief, value))})"
        kinds = {type(each).__name__ for each in value}
        return f"{len(value)} {kinds.pop() if len(kinds) == 1 else 'items'}"
    name = getattr(value, "name", None)
    if isinstance(name, str):
        return name
    return shortened(repr(value), MAX_WORD)


def shortened(text: str, most: int) -> str:
    """A text on one line, cut if it is too long."""
    text = " ".join(text.split())
    if len(text) <= most:
        return text
    return text[: most - 2] + "…" + (")" if text.endswith(")") else text[-1])


def facts(title: str, pairs: Iterable[tuple[str, Any]], note: str = "") -> str:
    """A title and a table of names and values for a notebook; values that are None or empty are left out."""
    rows = [(name, str(value)) for name, value in pairs if value is not None and value != ""]
    return table(title, (), rows, [note] if note else [])


def cell(value: Any) -> str:
    """A value of a table, with the digits that a reader takes in; a program reads all of them elsewhere."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, complex, np.floating, np.complexfloating)):
        return f"{value:.4g}"
    return "" if value is None else brief(value)


def table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], notes: Iterable[str] = ()) -> str:
    """A table for a notebook; columns whose name ends in ``>`` are flush right."""
    from html import escape  # needed in notebooks only

    side = ["right" if name.endswith(">") else "left" for name in head]

    def cells(tag: str, row: Sequence[str]) -> str:
        sides = side or ["left"] * len(row)
        return "".join(f'<{tag} style="text-align:{at}">{escape(str(cell))}</{tag}>' for cell, at in zip(row, sides, strict=True))

    shown = list(rows[:MAX_ROWS])
    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in shown)
    top = f"<thead><tr>{cells('th', [name.removesuffix('>') for name in head])}</tr></thead>" if head else ""
    more = [f"and {len(rows) - len(shown)} more"] if len(rows) > len(shown) else []
    below = "".join(f"<p>{escape(note)}</p>" for note in (*more, *notes) if note)
    return f"<div><p><b>{escape(title)}</b></p><table>{top}<tbody>{body}</tbody></table>{below}</div>"


# ---- members of a batch, as warnings and tables name them


def counted(number: int, what: str) -> str:
    """A number and its noun: "1 step", "2 steps"."""
    return f"{number} {what}{'s' * (number != 1)}"


def in_words(index: tuple[int, ...]) -> str:
    """A member by its index in the batch; without a batch "the run"."""
    return f"member {index if len(index) != 1 else index[0]}" if index else "the run"


def of_member(index: tuple[int, ...]) -> str:
    """The phrase " of member 3", with the space before it; empty without a batch."""
    return f" of {in_words(index)}" if index else ""


def share(some: int, shape: tuple[int, ...], size: int, alone: str = "the run") -> str:
    """The phrase for some members of a batch: "2 of 3 members", "the only member"; without a batch ``alone``."""
    if not shape:
        return alone
    return "the only member" if size == 1 else f"{some} of {counted(size, 'member')}"


def first_of(some: int, index: tuple[int, ...], size: int) -> str:
    """The phrase that names the member, or the first of several; empty for a single member."""
    if size == 1:
        return ""
    return f": {in_words(index)}" if some == 1 else f"; the first was {in_words(index)}"
