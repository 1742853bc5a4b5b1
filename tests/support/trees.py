"""Rooted trees: each stands for one condition of order of a Runge-Kutta method (Hairer, Nørsett, Wanner, §II.2)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import Any

Tree = tuple[Any, ...]


@cache
def trees(vertices: int) -> tuple[Tree, ...]:
    """All rooted trees with that many vertices; a tree is the sorted tuple of those that hang from its root."""

    def forests(left: int, largest: tuple[int, Tree] | None) -> Iterator[tuple[Tree, ...]]:
        if not left:
            yield ()
        for size in range(left, 0, -1):
            for tree in trees(size):
                if largest is None or (size, tree) <= largest:
                    yield from ((tree, *rest) for rest in forests(left - size, (size, tree)))

    return ((),) if vertices == 1 else tuple({tuple(sorted(forest)) for forest in forests(vertices - 1, None)})


def vertices(tree: Tree) -> int:
    return 1 + sum(map(vertices, tree))


def density(tree: Tree) -> int:
    return vertices(tree) * math.prod(map(density, tree))
