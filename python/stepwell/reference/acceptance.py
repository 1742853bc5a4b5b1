"""Conditions for accepting a step."""

from typing import NamedTuple


class Acceptance(NamedTuple):
    """The conditions that a step must satisfy to be accepted.

    Attributes:
        groups: for each number of v, then of y, the group to which it belongs, counted from 0 without gaps, those of v first. The
            error of a group is the length of its numbers. Empty if v is one group and y is another.
        own: whether each group has tolerances of its own.
        positive: numbers of v, then of y, by their places, that must not become negative.
        compensated: whether what rounding leaves out of each number of the state is kept, for the next step to add.
    """

    groups: tuple[int, ...] = ()
    own: bool = False
    positive: tuple[int, ...] = ()
    compensated: bool = False

    def counts(self, n_v: int, n_y: int) -> tuple[int, int]:
        """How many groups v and y have, of so many numbers."""
        if not self.groups:
            return int(n_v > 0), int(n_y > 0)
        of_v = len(set(self.groups[:n_v]))
        return of_v, len(set(self.groups)) - of_v

    def numbers(self, n_v: int, n_y: int) -> int:
        """How many numbers stand behind those of a ``Pace`` that are of no group."""
        return sum(self.counts(n_v, n_y)) * (5 if self.own else 3) + self.compensated * (n_v + n_y)
