"""Conditions for accepting a step."""

from typing import NamedTuple

#: In place of the group of a number that is of none.
NO_GROUP = -1


class Acceptance(NamedTuple):
    """The conditions that a step must satisfy to be accepted.

    Attributes:
        groups: for each number of v, then of y, the group to which it belongs, counted from 0 without gaps, those of v first. The
            error of a group is the length of its numbers. Numbers of none, ``NO_GROUP``, are carried along: steps do not depend
            on them. Empty if v is one group and y is another.
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
        groups = self.of_numbers(n_v, n_y)
        of_v = len(set(groups[:n_v]) - {NO_GROUP})
        return of_v, len(set(groups) - {NO_GROUP}) - of_v

    def of_numbers(self, n_v: int, n_y: int) -> tuple[int, ...]:
        """The group of each of so many numbers of v, then of y."""
        return self.groups or (0,) * n_v + (int(n_v > 0),) * n_y

    def numbers(self, n_v: int, n_y: int) -> int:
        """How many numbers stand behind those of a ``Pace`` that are of no group."""
        return sum(self.counts(n_v, n_y)) * (5 if self.own else 3) + self.compensated * (n_v + n_y)
