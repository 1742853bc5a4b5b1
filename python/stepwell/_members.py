"""Members of a batch in words, as warnings and tables name them."""

from __future__ import annotations


def counted(number: int, what: str) -> str:
    """A number and what is counted: "1 step", "2 steps"."""
    return f"{number} {what}{'s' * (number != 1)}"


def in_words(index: tuple[int, ...]) -> str:
    """A member by its place in the batch; without a batch it is the run."""
    return f"member {index if len(index) != 1 else index[0]}" if index else "the run"


def of_member(index: tuple[int, ...]) -> str:
    """Of which member, with a space before it; nothing where there is no batch."""
    return f" of {in_words(index)}" if index else ""


def share(some: int, shape: tuple[int, ...], size: int) -> str:
    """How many members of a batch of that shape: "2 of 3 members", "the only member"; without a batch "the run"."""
    if not shape:
        return "the run"
    return "the only member" if size == 1 else f"{some} of {counted(size, 'member')}"


def first_of(some: int, index: tuple[int, ...], size: int) -> str:
    """What goes between what befell ``some`` members and when: the one of them, or the first; nothing if there is no other."""
    if size == 1:
        return ""
    return f": {in_words(index)}" if some == 1 else f"; the first was {in_words(index)}"
