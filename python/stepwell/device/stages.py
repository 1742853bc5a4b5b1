"""The tapes of a run on a device: what is printed of them once, and the numbers that they read in a run.

A value changes once a run, once for each member, once a step, or in each step of each member. The first kind is computed by one
work item before all others ("uniforms"), the second by each member when it begins, the third by a work item for each step (the
table of steps). Only the fourth is in the loop.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .. import _core
from ..base.arrays import Array
from ..errors import UnsupportedError
from ..reference.signal import HOLD_SLACK
from .opencl import Machine
from .printer import HEAD, TYPES, Printer
from .reader import TEXT as READING
from .reader import Reader

#: The most operations of a stage that is written into a kernel, since a compiler takes minutes for more, and of a step of which
#: they are read by it; and the most statements that then stand around.
MOST_OPERATIONS, MOST_READ, MOST_STATEMENTS = 20_000, 100_000, 12_000


def check_length(model: Any) -> None:
    """Raise if a step of the model is too long for a kernel."""
    operations = _core.operations(model)
    if operations > MOST_READ:
        raise UnsupportedError(
            f"device: a step of about {operations} operations is too long for a kernel, which has at most {MOST_READ}; use "
            f"device='cpu'"
        )


class Text(NamedTuple):
    """The printed parts of a stage.

    Attributes:
        uniforms: statements that compute its uniforms, into ``uniforms``.
        member: statements that compute what is constant for a member.
        moment: statements that compute the entries of a step at the time ``t``, a double.
        body: the statements of the stage, and the texts of its results.
        entries: for each entry of a step its kind and the number of its table.
        results: the texts of the results.
    """

    uniforms: list[str]
    member: list[str]
    moment: list[str]
    body: list[str]
    entries: list[tuple[str, int]]
    results: list[str]


class Stages:
    """The stages of a model, each with its text.

    Attributes:
        sizes: how many numbers of a member v and y have, the method keeps, a controller remembers, are summed up, are recorded.
        carries: whether the method has a carry instead of v.
        is_series: whether attempts are those of a series.
        texts: by name, "step" and those around it.
    """

    def __init__(self, model: Any, *, single: bool, choice: int = 0, attempts: bool = False, extends: bool = False) -> None:
        check_length(model)
        made = _core.stages(model, choice=choice, attempts=attempts, extends=extends)
        self.single, self.tried = single, made["tried"]
        self.sizes = {name: int(made[name]) for name in ("v", "y", "kept", "memory", "tally", "recorded")}
        self.carries, self.is_series = bool(made["carries"]), bool(made["is_series"])
        self.sources: list[tuple[str, int]] = []
        self.params: list[int] = []
        self.uniforms = 0
        self.reader = Reader(self.single)
        self._reads = any(len(split["body"][0]) > MOST_OPERATIONS for split in made["splits"].values())
        self.texts = {name: self._text(name, split) for name, split in made["splits"].items()}
        if self.reader.lines:
            statements = sum(len(part) for text in self.texts.values() for part in text)
            if statements > MOST_STATEMENTS:
                raise UnsupportedError(
                    f"device: a kernel of {statements} statements is too long for a compiler, which gets at most "
                    f"{MOST_STATEMENTS}; use device='cpu'"
                )

    def _text(self, stage: str, split: Any) -> Text:
        own = stage == "judged"
        printer = Printer(self.single and not own)
        at = f"{stage.replace(' ', '_')}_"
        sources = [self._place(self.sources, tuple(each)) for each in split["given"]]
        params = [self._place(self.params, each) for each in split["params"]]
        first = self.uniforms

        def shared(number: int, cast: str = "(real)") -> str:
            return f"{cast}sources[{sources[number]}]"

        def of_member(name: str, number: int, _: str) -> str:
            return shared(number) if name == "uniform" else f"params[{params[number]} * members + g]"

        def of_step(name: str, number: int, _: str) -> str:
            return shared(number) if name == "uniform" else "(real)t"

        def of_clock(name: str, number: int, _: str) -> str:
            return shared(number, "") if name == "uniform" else "t"

        if own:
            return self._judged(split, printer, sources)
        uniforms, results = printer.body(split["run"], lambda name, number, _: shared(number), f"{at}u")
        uniforms += [f"uniforms[{first + i}] = {text};" for i, text in enumerate(results)]
        self.uniforms += len(results)
        member, results = printer.body(split["member"], of_member, f"{at}m")
        member += [f"const real {at}row{i} = {text};" for i, text in enumerate(results)]
        moment, values = printer.body(split["step"], of_step, f"{at}t")
        wide, of_wide = Printer(False).body(split["clock"], of_clock, f"{at}c")
        if wide or of_wide:
            # The clock of a step of float32 computes in float64.
            moment += [line.replace("const real ", "const double ").replace("const bits ", "const ulong ") for line in wide]
            moment = [in_double(line) if f" {at}c" in line else line for line in moment]
        values = values + of_wide
        entries = [tuple(each) for each in split["entries"]]
        for i, ((kind, table), value) in enumerate(zip(entries, values, strict=True)):
            if kind == "value":
                moment.append(f"const real {at}e{i} = (real)({value});")
            elif kind == "sample":
                moment.append(f"const real {at}e{i} = samples[offsets[firsts[{table}] + (long)({value})]];")
            else:
                moment.append(f"const long {at}e{i} = firsts[{table}] + (long)({value});")

        def of_lane(name: str, number: int, operand: str) -> str:
            match name:
                case "state":
                    return f"s{number}"
                case "row":
                    return f"{at}row{number}"
                case "uniform":
                    return f"uniforms[{first + number}]"
                case "of the step":
                    return f"{at}e{number}"
                case "held":
                    return f"sample_of(samples, offsets, widths, {at}e{number}, g)"
            # A place that is not among the samples comes from a NaN; its result is not used.
            return f"sample_of(samples, offsets, widths, sample_place({operand}, sample_rows), g)"

        if self._reads:
            body, results = self.reader.body(split["body"], of_lane)
        else:
            body, results = printer.body(split["body"], of_lane, f"{at}x")
        return Text(uniforms, member, moment, body, entries, results)

    @staticmethod
    def _judged(split: Any, printer: Printer, sources: list[int]) -> Text:
        """The text of the decision about an attempt of float32, all in float64: its state is d0, d1, …"""
        before, uniforms = printer.body(split["run"], lambda name, number, _: f"sources[{sources[number]}]", "judged_u")
        body, results = printer.body(
            split["body"], lambda name, number, _: f"d{number}" if name == "state" else uniforms[number], "judged_x"
        )
        before, body, results = ([in_double(line) for line in lines] for lines in (before, body, results))
        return Text([], before, [], body, [], results)

    @staticmethod
    def _place(every: list[Any], one: Any) -> int:
        if one not in every:
            every.append(one)
        return every.index(one)

    @property
    def head(self) -> str:
        """The text before the kernels."""
        return HEAD + TYPES[self.single] + SAMPLES + (READING if self.reader.lines else "")


def in_double(line: str) -> str:
    """A statement of float32 as one of float64."""
    for single, double in (("const real ", "const double "), ("const bits ", "const ulong ")):
        line = line.replace(single, double)
    return line.replace("number_of(", "as_double(").replace("bits_of(", "as_ulong(")


#: A sample of a member, by the number of its row among those of all tables.
SAMPLES = """
static inline real sample_of(__global const real *samples, __global const long *offsets, __global const int *widths, long row,
                             long g) {
    return samples[offsets[row] + g * widths[row]];
}
static inline long sample_place(real at, long rows) {
    const long row = at >= 0 ? (long)at : 0;
    return row < rows ? row : 0;
}
"""


class Numbers:
    """The numbers that the stages of a model read in a run, on a device.

    Attributes:
        uniforms: what is the same for all members, computed on the device.
        is_prepared: whether they are computed.
        arguments: the arrays that every kernel takes, in the order of ``ARGUMENTS``.
    """

    def __init__(self, machine: Machine, stages: Stages, model: Any, members: int, h: float, budget: float = np.inf) -> None:
        kind = np.float32 if stages.single else np.float64
        rows = [row for array in model.rows for row in array]
        tables = model.tables
        firsts = np.cumsum([0, *(len(samples) for _, _, samples in tables)])
        source: dict[str, Any] = {
            "step": lambda _: h,
            "parameter": lambda i: rows[i][0] if i < len(rows) else budget,
            "start": lambda i: tables[i][0],
            "interval": lambda i: tables[i][1],
            "last": lambda i: len(tables[i][2]) - 1.0,
            "first": lambda i: float(firsts[i]),
            "lanes": lambda _: 1.0,
            "slack": lambda _: HOLD_SLACK,
        }
        sources = np.array([source[name](i) for name, i in stages.sources] or [0.0], np.float64)
        params = np.empty((len(stages.params), members), kind)
        for to, i in zip(params, stages.params, strict=True):
            to[...] = rows[i]
        flat, offsets, widths = [], [], []
        at = 0
        for _, _, samples in tables:
            for row in samples:
                offsets.append(at)
                widths.append(int(len(row) > 1))
                flat.append(row.astype(kind))
                at += len(row)
        every = np.concatenate(flat) if flat else np.zeros(1, kind)
        put = machine.put
        self.is_prepared = False
        self.uniforms = machine.room(max(1, stages.uniforms) * np.dtype(kind).itemsize)
        self.sources = put(sources)
        self.sample_rows = np.int64(len(offsets))
        self.arguments = (
            np.int64(members),
            self.sources,
            self.uniforms,
            put(params),
            put(every),
            put(np.array(offsets or [0], np.int64)),
            put(np.array(widths or [0], np.int32)),
            put(firsts.astype(np.int64)),
            self.sample_rows,
            *self._of_reader(machine, stages.reader, members * np.dtype(kind).itemsize),
        )

    def _of_reader(self, machine: Machine, reader: Reader, size: int) -> list[Any]:
        """The arrays that are read, and room for the values of so many bytes each; any arrays where all is printed."""
        if not reader.lines:
            return [self.sources] * 3
        return [*map(machine.put, reader.arrays()), machine.room(reader.places * size)]


#: First arguments of every kernel.
ARGUMENTS = (
    "const long members, __global const double *restrict sources, __global const real *restrict uniforms, "
    "__global const real *restrict params, __global const real *restrict samples, __global const long *restrict offsets, "
    "__global const int *restrict widths, __global const long *restrict firsts, const long sample_rows, "
    "__global const int *restrict lines, __global const bits *restrict constants, __global bits *values"
)


def wide(block: Array, members: int, kind: type) -> Array:
    """Rows of a number for all or for each member, as rows of each member."""
    return np.ascontiguousarray(np.broadcast_to(block, (len(block), members)), dtype=kind)
