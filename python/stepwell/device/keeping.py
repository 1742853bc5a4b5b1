"""Energy controls of many bodies on a device: the reference's controls and projections, with symbols, as kernels."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _core
from ..model.controls import EnergyControl, Projection
from .forces import SUMS
from .printer import Printer

#: Numbers that a control reads for a number of a member: its own and the member's.
NAMES = ("dv", "v", "y", "along_v", "along_y", "kinetic", "energy", "square", "tally", "h", "gain", "target")


class _Bodies:
    """The bodies as a control sees them."""

    def __init__(self, symbols: dict[str, Any]) -> None:
        self._symbols = symbols

    def energies(self, v: Any, y: Any) -> tuple[Any, ...]:
        """The rate, h times the kinetic energy, and h times the whole energy."""
        return tuple(self._symbols[name] for name in ("dv", "kinetic", "energy"))

    def gradient(self, v: Any, y: Any, dv: Any) -> tuple[Any, ...]:
        """The gradient of the energy, and the square of its length."""
        return tuple(self._symbols[name] for name in ("along_v", "along_y", "square"))


def is_known(control: Any) -> bool:
    """True for an energy control or a projection."""
    return isinstance(control, EnergyControl | Projection)


def pushes(control: Any) -> bool:
    """True if a control acts in the stages of a step; else it acts after the step."""
    return isinstance(control, EnergyControl) and not control.between


def moves_places(control: Any) -> bool:
    """True if a control changes coordinates."""
    return isinstance(control, Projection) and control.way != "scaling"


def text_of(control: Any, dim: int) -> str:
    """The kernel "kept", which changes a rate or a state, and "tallied", which counts what that adds to the energy."""
    tape = _core.Tape()
    symbols = {name: tape.state(i) for i, name in enumerate(NAMES)}
    parameters = {f"control.{name}": symbols[name] for name in ("gain", "target")}
    wrapped = control.wrap(_Bodies(symbols), symbols["h"], parameters)
    wrapped.work = symbols["tally"]
    v, y = symbols["v"], symbols["y"]
    results = {"dv": wrapped.dv(None, v, y)} if pushes(control) else dict(zip("vy", wrapped.project(v, y), strict=True))

    def printed(values: list[Any]) -> tuple[list[str], list[str]]:
        flat = [np.asarray(value, object).item() for value in values]
        return Printer(False).body(tape.operations(flat), lambda _, i, __: NAMES[i], "x")

    lines, texts = printed(list(results.values()))
    of_work, (work,) = printed([wrapped.work])
    of_member = [
        f"const real {name} = energies[{SUMS} * m + {i}]; (void){name};" for i, name in enumerate(("kinetic", "energy", "square"))
    ]
    of_member += [f"const real {name} = {name}s[m]; (void){name};" for name in ("gain", "target")]
    numbers = "__global const real *energies, __global const real *gains, __global const real *targets"
    return "\n".join(
        [
            f"__kernel void kept(const long count, const int all, const real h, {numbers}, __global const real *masses, "
            "__global real *of_dv, __global real *of_v, __global real *of_y) {",
            "const long g = get_global_id(0);",
            "if (g >= count) return;",
            f"const long m = g / ({dim}L * all);",
            *of_member,
            "const real dv = of_dv[g], v = of_v[g], y = of_y[g], mass = masses[m * all + g % all];",
            "const real along_v = mass * v, along_y = -(mass * (dv / h));",
            "(void)y; (void)along_v; (void)along_y;",
            *lines,
            *(f"of_{name}[g] = {text};" for name, text in zip(results, texts, strict=True)),
            "}",
            f"__kernel void tallied(const long count, const real h, {numbers}, __global real *tallies) {{",
            "const long m = get_global_id(0);",
            "if (m >= count) return;",
            *of_member,
            "const real tally = tallies[m];",
            *of_work,
            f"tallies[m] = {work};",
            "}",
        ]
    )
