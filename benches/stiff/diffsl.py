"""The language of pydiffsol: a problem is written in it by running its rates with names in place of numbers."""

from __future__ import annotations

from typing import Any

from .problems import Problem


class Text:
    """An expression."""

    def __init__(self, text: str) -> None:
        self.text = text

    def joined(self, sign: str, other: Any, turned: bool = False) -> Text:
        """Two expressions and a sign."""
        other = other.text if isinstance(other, Text) else repr(float(other))
        first, second = (other, self.text) if turned else (self.text, other)
        return Text(f"({first} {sign} {second})")

    def __neg__(self) -> Text:
        return Text(f"(0.0 - {self.text})")

    def __add__(self, other: Any) -> Text:
        return self.joined("+", other)

    def __radd__(self, other: Any) -> Text:
        return self.joined("+", other, True)

    def __sub__(self, other: Any) -> Text:
        return self.joined("-", other)

    def __rsub__(self, other: Any) -> Text:
        return self.joined("-", other, True)

    def __mul__(self, other: Any) -> Text:
        return self.joined("*", other)

    def __rmul__(self, other: Any) -> Text:
        return self.joined("*", other, True)

    def __truediv__(self, other: Any) -> Text:
        return self.joined("/", other)


def text(problem: Problem) -> str:
    """A problem with its parameters as inputs."""
    names = list(problem.published)
    states = [f"x{i}" for i in range(len(problem.start))]
    rates = problem.rates(Text("t"), [Text(each) for each in states], *map(Text, names))
    lines = ["in_i {", *(f"  {name} = {value!r}," for name, value in problem.published.items()), "}", "u_i {"]
    lines += [f"  {name} = {value!r}," for name, value in zip(states, problem.start, strict=True)]
    return "\n".join([*lines, "}", "F_i {", *(f"  {each.text}," for each in rates), "}", ""])
