"""The explanation of a step, as text, as a table of a notebook, and as JSON."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from ... import _core
from ...base.immutable import ValueEquality
from ...base.reprs import counted
from ...base.tables import write_json
from ...model.methods import Method
from ...model.systems import System
from .listing import Section

#: How often, in words; the part about members is used if there are several.
WHEN = {
    "run": "once a run",
    "member": "once a run, for each member",
    "step": "once a step, for all members",
    "member step": "in each step, for each member",
}

#: The computations beside the steps of a method with a carry.
BESIDE = {"start": "at the start of a run, {carry} from v", "finish": "where a state is kept, v from {carry}"}

#: How the rates of a step are computed that is no single tape.
PARTS = {
    "rates": "the rates are a tape of their own, {lanes} at a time",
    "matrix": "its products of matrices are made by a loop that was compiled beforehand, one member after the other",
    "hand": "the rates are computed by a loop that was compiled beforehand, one member after the other",
}


#: Names whose meaning begins with them, as several have one.
MEANINGS = ("fma", "v2", "P", "s", "solve_v", "square", "dv_by_t")


@dataclass(frozen=True)
class MachineCode(ValueEquality):
    """The machine code of a step.

    Attributes:
        size: its length in bytes.
        width: numbers in a vector, one for each member.
        vectors: vectors that one iteration of the loop steps.
        turns: iterations for a tile, the members that are stepped together.
        resident: whether the state stays in registers over all steps of an iteration; else it is loaded and stored in each step.
        registers: vector registers of the CPU.
        spills: the most values that are in memory at once because there are not enough registers.
        packing: for a single member, whether one vector makes several of its equal operations; None if that was not considered.
    """

    size: int
    width: int
    vectors: int
    turns: int
    resident: bool
    registers: int
    spills: int
    packing: Packing | None = None


@dataclass(frozen=True)
class Packing(ValueEquality):
    """The packing of equal operations of a single member into vectors, and its gain. Cycles are those of a model of the CPU.

    Attributes:
        used: whether operations are packed into vectors, which they are if that saves 4 % of the cycles.
        cycles: cycles of a step with the best packing; None if none was found, or if the step is a chain already.
        single_cycles: cycles of a step number by number.
        chain_cycles: cycles of the longest chain of operations that wait for each other; no packing is faster.
        operations: operations of a step.
        vectors: vectors that take their place, ``moves`` among them.
        moves: how many of these vectors only move numbers between lanes.
    """

    used: bool
    cycles: float | None
    single_cycles: float
    chain_cycles: float
    operations: int
    vectors: int
    moves: int

    def __str__(self) -> str:
        if self.cycles is None:
            why = f"a step takes about {self.single_cycles:.0f} cycles, and no vectors were found that would take fewer"
            if self.chain_cycles >= 0.96 * self.single_cycles:
                cycles = f"nearly all of its {self.single_cycles:.0f} cycles"
                why = f"{cycles} are a chain of operations, each waiting for the one before"
            return f"Its operations are not packed into vectors: {why}."
        if not self.used:
            return (
                f"Its operations are not packed into vectors: a step would take about {self.cycles:.0f} cycles, "
                f"and number by number it takes {self.single_cycles:.0f}."
            )
        return (
            f"Equal operations are lanes of one vector: {self.vectors} vectors for {self.operations} operations, {self.moves} of "
            f"them only move numbers between lanes. A step takes about {self.cycles:.0f} cycles, "
            f"number by number {self.single_cycles:.0f}."
        )


@dataclass(frozen=True)
class Kernel(ValueEquality):
    """The kernels that a device runs.

    Attributes:
        device: the name of the device, such as "opencl:0".
        title: its own name.
        numbers: numbers of a member that stay in private memory over all steps of a launch: its state, and what the method keeps.
        member_bytes: bytes of a member in the memory of the device: its state, before and after a launch, its own parameters, and
            the step at which it diverged.
        lines: the lines of the text.
        text: the kernels, in OpenCL C.
    """

    device: str
    title: str
    numbers: int
    member_bytes: int
    lines: int
    text: str

    def __str__(self) -> str:
        return (
            f"On {self.device} ({self.title}) a work item makes the steps of a member, with {self.numbers} numbers in private "
            f"memory; a member takes {self.member_bytes} bytes in the memory of the device; the kernels have {self.lines} lines."
        )


@dataclass(frozen=True, eq=False)
class Explanation(ValueEquality):
    """The operations of a step and its machine code on this machine. ``print`` it.

    Attributes:
        system: the system, with its control.
        method: the method.
        members: number of trajectories.
        fused: whether it uses fused multiply-adds.
        attempt: whether it is an attempt at an adaptive step.
        dtype: ``"float64"`` or ``"float32"``, of its numbers.
        form: ``"direct"`` or ``"matrix"``.
        sections: the values, by how often they are computed. For a step that is too long for one tape, the operations of the
            method on blocks.
        level: the CPU level in use.
        lanes: how many members are stepped together.
        written: operations of a step, by kind, as the method and the system are written down. Operations on values that do not
            change from step to step are not counted, since they are done before; nor are changes of sign. Empty if the step is
            too long for one tape. They are counted on the reference, which runs a method as it is written; the core counts less
            on its own tape, where equal sums or products of whole blocks are merged already.
        computed: operations of a step, by kind, that each member makes: without those that are equal to others or needless.
            ``fused`` counts fused multiply-adds.
        hoisted: how many operations are made once a run, once for each member, and once a step for all members, instead of for
            each member in each step: ``"run"``, ``"member"``, ``"step"``.
        code: the machine code, or None.
        interpreted_because: why there is none, in words, or None. Runs too short to be worth machine code are interpreted anyway.
        parts: for a step that is too long for one tape: ``"rates"`` if its rates are tapes of their own, ``"hand"`` if they are a
            loop that was compiled beforehand, ``"matrix"`` if it is products of large matrices. None if it is one tape.
        about: about how many operations such a step has; 0 if it is one tape, whose operations are counted.
        kernel: what a device runs, by ``device=``, with its text; None without one.
        beside: the computations beside the steps, by ``when``: for a method with a carry, ``"start"``, which computes the carry
            from v at the start of a run, and ``"finish"``, which computes v from it where a state is saved; and the quantities of
            ``record=``, such as ``"record energy"``. A sampled input is written as a function, a(t).

    Example:
        >>> step = sw.explain(sw.Oscillator(), "false_euler")
        >>> print(step.listing)
        once a run
          Φ = h·omega
        in each step
          v' = v − Φ·y
          y' = y + Φ·v'
        >>> step.computed["additions"], step.computed["multiplications"]
        (2, 2)
    """

    system: System
    method: Method
    members: int
    fused: bool
    attempt: bool
    sections: tuple[Section, ...]
    level: str
    lanes: int
    written: dict[str, int] = field(default_factory=dict)
    computed: dict[str, int] = field(default_factory=dict)
    hoisted: dict[str, int] = field(default_factory=dict)
    code: MachineCode | None = None
    interpreted_because: str | None = None
    parts: str | None = None
    about: int = 0
    form: str = "direct"
    beside: tuple[Section, ...] = ()
    dtype: str = "float64"
    kernel: Kernel | None = None

    @property
    def listing(self) -> str:
        """Only the values, a line for each."""
        return self._listed(self.sections)

    def _listed(self, sections: Sequence[Section]) -> str:
        out = []
        for section in sections:
            if section.lines:
                out.append(self._when(section))
                width = max(len(line.name) for line in section.lines)
                for line in section.lines:
                    note = f"    ({line.note})" if line.note else ""
                    out.append(f"  {line.name:<{width}} = {line.formula}{note}")
        return "\n".join(out)

    @property
    def title(self) -> str:
        """The method, the system and the number of members, in a line."""
        what = "an attempt at a step" if self.attempt else "a step"
        fused = ", with fused multiply-adds" if self.fused else ""
        fused += ", by its transition matrix" if self.form == "matrix" else ""
        fused += "" if self.dtype == "float64" else f", in {self.dtype}"
        return f"{self.method.title}: {what} of {self.system!r}, {counted(self.members, 'member')}{fused}"

    @property
    def machine(self) -> str:
        """How the step is executed, in words."""
        if self.parts is not None:
            rates = PARTS[self.parts].format(lanes=_members(self.lanes))
            if self.parts == "matrix":
                return f"A step of about {self.about} operations is not one tape: {rates}."
            between = "is interpreted" if self.level == "interpret" else f"is machine code for {self.level}"
            return (
                f"A step of about {self.about} operations is not one tape: {rates}; what the method does between them {between}."
            )
        if self.code is None:
            return f"It is interpreted, {_members(self.lanes)} at a time: {self.interpreted_because}."
        code = self.code
        vectors = (
            f"vectors of {code.width} numbers, {code.vectors} in a turn of the loop" if code.width > 1 else "number by number"
        )
        place = "in registers over all steps" if code.resident else "in the cache, read and written in each step"
        spilled = f"{code.spills} value{'s' * (code.spills != 1)} beside them" if code.spills else "which suffice"
        packed = ""
        if code.packing is not None:
            packed = f" {code.packing}"
            if code.packing.used:
                vectors = f"{code.packing.vectors} vectors of one to four numbers of the member"
        return (
            f"Machine code for {self.level}, {code.size} bytes: {vectors}, {_members(self.lanes)} in a tile; the state is "
            f"{place}; {code.registers} vector registers, {spilled}.{packed}"
        )

    def _when(self, section: Section) -> str:
        """How often a section is computed, in words; for one member without the members."""
        if section.when in BESIDE:
            if self.method.kept:
                return f"at the start of a run, {', '.join(self.method.kept)} from v and y"
            return BESIDE[section.when].format(carry=self.method.carry)
        if section.when.startswith("record "):
            return "recorded of a state that is kept"
        text = WHEN[section.when]
        return text if self.members > 1 else text.partition(",")[0]

    def counts(self) -> list[tuple[str, int, int]]:
        """Operations of a step: kind, as written, as computed; kinds that do not occur are left out."""
        kinds = [(kind.replace("_", " "), self.written[kind], self.computed[kind]) for kind in self.computed]
        return [each for each in kinds if any(each[1:])]

    def __str__(self) -> str:
        out = [self.title, "", self.listing, ""]
        if self.parts is None:
            out.append(f"{'operations of a step':<24}{'written':>8}{'computed':>10}")
            out += [f"  {name:<22}{written:>8}{computed:>10}" for name, written, computed in self.counts()]
            out.append(self._hoisted())
        if self.beside:
            out += ["", self._listed(self.beside), ""]
        return "\n".join([*out, *self._machines(), *self.words()])

    def _machines(self) -> list[str]:
        """How the step is executed, on the CPU and on a device."""
        return [self.machine, *([] if self.kernel is None else [str(self.kernel)])]

    def _hoisted(self) -> str:
        counts = [f"{n} {self._when(Section(when, ()))}" for when, n in self.hoisted.items() if n]
        return f"Operations computed beforehand: {'; '.join(counts) if counts else 'none'}."

    def _gamma(self) -> str:
        """The factor of h·J in the equations of an implicit step."""
        gammas = [share for name, _, share in _core.program(self.method.key)[0] if name == "implicit v"]
        return "" if gammas in ([], [1.0]) else f"{gammas[0]:.6g}·"

    def words(self) -> list[str]:
        """The meanings of names in the listing that are no arguments."""
        text = [f"{line.name} {line.formula}" for section in (*self.sections, *self.beside) for line in section.lines]
        known = {
            "h": "the step dt",
            "Φ": "h·omega, the true angle of a step",
            "Gm": "G·masses",
            "fma": "fma(a, b, c) = a·b + c, rounded once",
            "v2": "v2, y2: the state at which rates are asked for the second time",
            "s": "s: the numbers of v and then those of y",
            "P": "P, Q: the transition matrix of a step, and what the inputs add at each node",
            "solve_v": f"solve_v, solve_y: x of (I − {self._gamma()}hJ)·x = (a, b), with the derivatives J of the rates at the "
            f"start of the step; a loop that was compiled beforehand eliminates rows",
            "square": "square(a, b) = the sum of the squares of all numbers of both",
            "dv_by_t": "dv_by_t, dy_by_t: h times the derivatives of h·v̇ and h·ẏ by the time",
            "dv": "h times the rate of v" if self.parts is None else "dv(t, v, y) = h times the rate of v",
        }
        shown = []
        for name, meaning in known.items():
            if any(_names(name, each) for each in text):
                shown.append(meaning if name in MEANINGS else f"{name}: {meaning}")
        if self.method.kept:
            shown.append(f"{', '.join(self.method.kept)}: what is kept between steps beside v and y")
        if self.method.carry:
            shown.append(f"{self.method.carry}: what is carried in place of v between steps")
        return [f"Names: {'; '.join(shown)}."] if shown else []

    def as_dict(self) -> dict[str, Any]:
        """The explanation as numbers and texts."""
        sections, beside = (
            [{"when": s.when, "lines": [line._asdict() for line in s.lines]} for s in each]
            for each in (self.sections, self.beside)
        )
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        code = None if self.code is None else asdict(self.code)
        return values | {
            "system": repr(self.system),
            "method": self.method.name,
            "sections": sections,
            "beside": beside,
            "code": code,
            "kernel": None if self.kernel is None else asdict(self.kernel),
        }

    def to_json(self, path: str | Path) -> None:
        """Write ``as_dict()``."""
        write_json(self.as_dict(), path)

    def _repr_html_(self) -> str:
        rows = []
        for section in (*self.sections, *self.beside):
            if section.lines:
                rows.append(f'<tr><th colspan="3" style="text-align:left">{self._when(section)}</th></tr>')
            rows += [
                f'<tr><td style="text-align:left">{escape(line.name)}</td><td style="text-align:left">{escape(line.formula)}</td>'
                f'<td style="text-align:left">{escape(line.note)}</td></tr>'
                for line in section.lines
            ]
        html = f"<p><b>{escape(self.title)}</b></p><table>{''.join(rows)}</table>"
        if self.parts is None:
            counts = [
                f"<tr><td>{name}</td><td>{written}</td><td>{computed}</td></tr>" for name, written, computed in self.counts()
            ]
            head = "<tr><th>operations of a step</th><th>written</th><th>computed</th></tr>"
            html += f"<table>{head}{''.join(counts)}</table><p>{self._hoisted()}</p>"
        return html + "".join(f"<p>{escape(each)}</p>" for each in (*self._machines(), *self.words()))


def _members(count: int) -> str:
    return "one member" if count == 1 else f"{count} members"


def _names(name: str, text: str) -> bool:
    """True if a name occurs in a text: by itself, or with a number or a place behind it."""
    return re.search(rf"(?<![\w.]){name}(?:\d+|\[|\(|(?![\w.']))", text) is not None
