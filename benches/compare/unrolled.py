"""A few bodies with every number in a variable of its own, as text of Python, made from the bodies and the dimensions.

Pure Python and numba are fastest so, and nobody writes it by hand for every size. A kernel takes the step, their number, and the
arrays of a workload.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import Any


def kick(bodies: int, dim: int) -> list[str]:
    """v += w·h·a, each pair once; ``m`` holds h·G·m, ``e`` the softening squared."""
    lines = []
    for i in range(bodies):
        for j in range(i + 1, bodies):
            lines += [f"d{c} = y{j}_{c} - y{i}_{c}" for c in range(dim)]
            lines += [f"r = {' + '.join(f'd{c} * d{c}' for c in range(dim))} + e", "f = w / (r * sqrt(r))"]
            lines += [f"to, back = f * m{j}, f * m{i}"]
            lines += [line for c in range(dim) for line in (f"v{i}_{c} += to * d{c}", f"v{j}_{c} -= back * d{c}")]
    return lines


def names(letter: str, bodies: int, dim: int) -> list[str]:
    """The variables of a block."""
    return [f"{letter}{i}_{c}" for i in range(bodies) for c in range(dim)]


class Text:
    """The parts that every kernel is put together from."""

    def __init__(self, bodies: int, dim: int, method: str) -> None:
        self.v, self.y = names("v", bodies, dim), names("y", bodies, dim)
        self.own = [*(f"m{i}" for i in range(bodies)), "e"]
        self.every = [*self.v, *self.y, *self.own]
        places = [f"[{i}, {c}, k]" for i in range(bodies) for c in range(dim)]
        self.load = [f"{name} = float(v_in{place})" for name, place in zip(self.v, places, strict=True)]
        self.load += [f"{name} = float(y_in{place})" for name, place in zip(self.y, places, strict=True)]
        self.load += [*(f"m{i} = h * float(masses[{i}, k])" for i in range(bodies)), "e = float(softening[k]) ** 2"]
        self.store = [f"v_out{place} = {name}" for name, place in zip(self.v, places, strict=True)]
        self.store += [f"y_out{place} = {name}" for name, place in zip(self.y, places, strict=True)]
        self.kick = kick(bodies, dim)
        drift = [f"{y} += h * {v}" for v, y in zip(self.v, self.y, strict=True)]
        # Leapfrog's last kick is a half one, as is the one before its first step.
        self.begin = ["w = 0.5", *self.kick] if method == "leapfrog" else []
        self.weight = "w = 0.5 if step == steps - 1 else 1.0" if method == "leapfrog" else "w = 1.0"
        self.step = [*drift, *self.kick] if method == "leapfrog" else [*self.kick, *drift]


def made(lines: str, given: dict[str, Any]) -> Callable[..., Any]:
    """The function ``run`` of a text."""
    exec(lines, given)
    function: Callable[..., Any] = given["run"]
    return function


def put(text: str, **parts: list[str]) -> str:
    """The text with lines in the place of a name in angle brackets, indented as that is."""
    out = []
    for line in textwrap.dedent(text).splitlines():
        bare = line.strip()
        inner = parts.get(bare.strip("<>")) if bare.startswith("<") else None
        out += [line] if inner is None else [line.replace(bare, each) for each in inner]
    return "\n".join(out)


ONE_BY_ONE = """
    def run(h, steps, v_in, y_in, masses, softening):
        v_out, y_out = empty(v_in.shape), empty(y_in.shape)
        for k in range(v_in.shape[2]):
            <load>
            <begin>
            for step in range(steps):
                <weight>
                <step>
            <store>
        return v_out, y_out
"""

SIDE_BY_SIDE = """
    def run(h, steps, v_in, y_in, masses, softening):
        n = v_in.shape[2]
        v_out, y_out = empty(v_in.shape), empty(y_in.shape)
        s = empty(SIZE)
        for b in range(0, n, LANES):
            for i in range(LANES):
                k = min(b + i, n - 1)
                <load>
                <begin>
                <keep_all>
            for step in range(steps):
                <weight>
                for i in range(LANES):
                    <fetch>
                    <step>
                    <keep>
            for i in range(min(LANES, n - b)):
                k = b + i
                <fetch>
                <store>
        return v_out, y_out
"""


def one_by_one(bodies: int, dim: int, method: str, given: dict[str, Any]) -> Callable[..., Any]:
    """Member after member; ``given`` has sqrt and empty."""
    t = Text(bodies, dim, method)
    return made(put(ONE_BY_ONE, load=t.load, begin=t.begin, weight=[t.weight], step=t.step, store=t.store), dict(given))


def side_by_side(bodies: int, dim: int, method: str, lanes: int, given: dict[str, Any]) -> Callable[..., Any]:
    """So many members at once. One array at constant distances holds all, or the compiler would fear that two overlap."""
    t = Text(bodies, dim, method)
    at = {name: f"s[{row} * LANES + i]" for row, name in enumerate(t.every)}
    parts = {
        "load": t.load,
        "begin": t.begin,
        "keep_all": [f"{place} = {name}" for name, place in at.items()],
        "weight": [t.weight],
        "fetch": [f"{name} = {place}" for name, place in at.items()],
        "step": t.step,
        "keep": [f"{at[name]} = {name}" for name in (*t.v, *t.y)],
        "store": t.store,
    }
    return made(put(SIDE_BY_SIDE, **parts), {**given, "LANES": lanes, "SIZE": lanes * len(t.every)})
