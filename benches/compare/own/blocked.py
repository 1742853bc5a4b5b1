"""Runge-Kutta 4 over assignments, as text of Python for numba: members side by side in blocks, or one after the other.

Every number has a variable of its own, and rates stand in the loop itself: a call there may cost the vectors. One array at
constant distances holds a block, or the compiler would fear that two arrays overlap.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..unrolled import made, put
from .equations import Equation

SIDE_BY_SIDE = """
    def run(dt, steps, state, own):
        members = state.shape[1]
        out, s = empty(state.shape), empty(SIZE)
        half, sixth = 0.5 * dt, dt / 6.0
        for b in range(0, members, LANES):
            for i in range(LANES):
                k = min(b + i, members - 1)
                <load>
            for step in range(0, steps, TOGETHER):
                <drives>
                for i in range(LANES):
                    <fetch>
                    <steps>
                    <keep>
            for i in range(min(LANES, members - b)):
                <store>
        return out
"""

ONE_BY_ONE = """
    def run(dt, steps, state, own):
        out = empty(state.shape)
        half, sixth = 0.5 * dt, dt / 6.0
        for k in range(state.shape[1]):
            <load>
            for step in range(steps):
                <drives>
                <steps>
            <store>
        return out
"""

#: Names of the times that a step asks for, and where they are in it.
TIMES = {"now": "", "middle": " + half", "later": " + dt"}


def drives(e: Equation, step: int) -> list[str]:
    """What depends on the time alone, at the times that this step asks for."""
    if not e.drive:
        return []
    name, formula = e.drive.split(" = ", 1)
    lines = []
    for when, offset in TIMES.items():
        lines += [f"t = (step + {step}) * dt{offset}", f"{name}_{when}_{step} = {formula}"]
    return lines


def one_step(e: Equation, step: int) -> list[str]:
    """From the numbers of a state to the next ones; ``o_x`` is the old x, ``a_x`` the sum of its rates."""
    lines = [f"o_{x} = {x}" for x in e.states]
    for when, weight, next_ in (("now", "", "half"), ("middle", "2.0 * ", "half"), ("middle", "2.0 * ", "dt"), ("later", "", "")):
        if e.drive:
            name = e.drive.split(" = ", 1)[0]
            lines.append(f"{name} = {name}_{when}_{step}")
        lines += e.lines
        if next_:
            lines += [f"a_{x} = {f'a_{x} + ' if weight else ''}{weight}d_{x}" for x in e.states]
            lines += [f"{x} = o_{x} + {next_} * d_{x}" for x in e.states]
    return lines + [f"{x} = o_{x} + sixth * (a_{x} + d_{x})" for x in e.states]


def given(e: Equation, functions: dict[str, Any]) -> dict[str, Any]:
    """What the text calls by name."""
    known = {"empty": np.empty, "exp": math.exp, "sin": math.sin, "cos": math.cos}
    return known | dict(e.shared) | functions


def side_by_side(e: Equation, lanes: int, together: int, functions: dict[str, Any]) -> Callable[..., Any]:
    """So many members, each so many steps at a visit."""
    names = [*e.states, *e.own]
    at = {name: f"s[{row} * LANES + i]" for row, name in enumerate(names)}
    source = {x: f"state[{row}, k]" for row, x in enumerate(e.states)} | {p: f"own[{row}, k]" for row, p in enumerate(e.own)}
    text = put(
        SIDE_BY_SIDE,
        load=[f"{place} = {source[name]}" for name, place in at.items()],
        drives=[line for step in range(together) for line in drives(e, step)],
        fetch=[f"{name} = {place}" for name, place in at.items()],
        steps=[line for step in range(together) for line in one_step(e, step)],
        keep=[f"{at[x]} = {x}" for x in e.states],
        store=[f"out[{row}, b + i] = {at[x]}" for row, x in enumerate(e.states)],
    )
    return made(text, given(e, functions) | {"LANES": lanes, "TOGETHER": together, "SIZE": lanes * len(names)})


def one_by_one(e: Equation, functions: dict[str, Any]) -> Callable[..., Any]:
    """Member after member."""
    load = [f"{x} = state[{row}, k]" for row, x in enumerate(e.states)] + [f"{p} = own[{row}, k]" for row, p in enumerate(e.own)]
    store = [f"out[{row}, k] = {x}" for row, x in enumerate(e.states)]
    return made(put(ONE_BY_ONE, load=load, drives=drives(e, 0), steps=one_step(e, 0), store=store), given(e, functions))
