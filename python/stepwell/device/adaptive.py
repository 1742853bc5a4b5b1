"""Runs of adaptive steps on a device: a work item for each member, with a time and a step of its own, as the core has lanes.

A kernel does for its member what the driver of the core does for a lane: it saves what was asked for, chooses what comes next,
and makes an attempt, until the member has ended or the launch is over. Between launches all that a member is stands in rows, so
steps do not depend on where launches end.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from typing import Any, NamedTuple

import numpy as np

from .. import _core
from ..base.arrays import Array
from ..errors import UnsupportedError
from ..reference.adaptive.controller import MAX_FACTOR, MIN_FACTOR, MOVES, Pace
from ..reference.signal import HOLD_SLACK
from . import promise
from .bodies import LAUNCH
from .fixed import MOST_AT_FIRST, MOST_SAVED, MOST_TEXTS
from .opencl import Machine
from .reductions import ARGUMENTS as OF_AN_OBSERVER
from .reductions import Observer
from .stages import ARGUMENTS, Numbers, Stages

#: Attempts of the first launch, which shows how long one takes, and the most of any.
FIRST_LAUNCH, MOST_ATTEMPTS = 16, 1 << 16
#: The numbers of a pace before those of groups.
PACE = Pace._fields[: Pace._fields.index("longest")]
#: Further state of a member between launches: whole numbers, and numbers.
MARKS = ("next", "kept", "passed", "held_before", "has_origin", "is_known", "status")
SEEN = ("seen_accepted", "origin_rejected")
#: The status of a member that is not at its end.
RUNNING = -2
#: The first waypoint, and how many are kept.
FIRST_WAYPOINT, WAYPOINTS = 256, 2

_TEXTS: OrderedDict[Any, tuple[Stages, str]] = OrderedDict()

#: Text before the kernels: a time of many, by its number, of a member.
TIMES = """
static inline double time_of(__global const double *times, const long width, const long i, const long g) {
    return times[i * width + (width > 1 ? g : 0)];
}
static inline long passed_times(__global const double *times, const long width, const long count, const double t, const long g) {
    long first = 0, last = count;
    while (first < last) {
        const long middle = (first + last) / 2;
        if (time_of(times, width, middle, g) <= t) first = middle + 1; else last = middle;
    }
    return first;
}
static inline double next_time(__global const double *times, const long width, const long count, const double t, const long g) {
    const long i = passed_times(times, width, count, t, g);
    return i < count ? time_of(times, width, i, g) : INFINITY;
}
"""
#: Arguments of both kernels behind those of all: the first member of those of this call, their number, and what they are.
OF_CALL = (
    "const long first_member, const long width, __global const double *restrict jumps, const long jumps_width, const long walls, "
    "__global double *restrict rows, __global double *restrict seen, __global long *restrict marks"
)


def adapt(machine: Machine, model: Any, plan: Any, pacing: Any, arrays: Any) -> bool:
    """Make the run: as ``_core.adapt``. False if nothing was done, since the start is to be found by others."""
    promise.check(machine, single=plan.single)
    members = arrays.status.size
    stages, text = text_of(model, plan, len(arrays.paces), extends=pacing.extends, is_part=pacing.is_part)
    if pacing.begins and "begin" not in stages.texts:
        return False
    if members == 0:
        return True
    program = machine.program(text)
    with program.lock:
        _Run(machine, program, stages, model, plan, pacing, arrays).make()
    return True


def text_of(model: Any, plan: Any, numbers: int, *, extends: bool = False, is_part: bool = False) -> tuple[Stages, str]:
    """The stages of a model, and the kernels of a run of adaptive steps; a pace has so many numbers, with those of groups.

    ``extends`` is whether states before the last time are those of the continuous extension of the method; the last is, too,
    where the run ``is_part`` of another.
    """
    observer = plan.observer
    kind = plan.single, plan.backward, numbers, None if observer is None else observer.key, extends, is_part
    key = _core.tape_number(model, attempts=True), kind
    if key not in _TEXTS:
        stages = Stages(model, single=plan.single, attempts=True, extends=extends)
        _TEXTS[key] = stages, _Kernels(stages, numbers, len(model.tables), plan.backward, observer, until_last=not is_part).text()
        while len(_TEXTS) > MOST_TEXTS:
            _TEXTS.popitem(last=False)
    return _TEXTS[key]


class Share(NamedTuple):
    """Members from one to before another, which are on the device at a time."""

    first: int
    end: int

    def of(self, array: Array) -> Array:
        """The columns of these members of an array that has members along its last axis."""
        return np.ascontiguousarray(array[..., self.first : self.end])


class _Run:
    def __init__(self, machine: Machine, program: Any, stages: Stages, model: Any, plan: Any, pacing: Any, arrays: Any) -> None:
        self.machine, self.program, self.stages, self.plan, self.arrays = machine, program, stages, plan, arrays
        self.pacing = pacing
        self.members = members = arrays.status.size
        self.numbers = Numbers(machine, stages, model, members, 1.0, float(pacing.budget))
        self.n_v, self.n_y = stages.sizes["v"], stages.sizes["y"]
        self.state = self.n_v + self.n_y
        self.rows = rows_of(stages)
        self.at, self.jumps = (machine.put(np.ascontiguousarray(each)) for each in (pacing.at, pacing.jumps))
        of_inputs = [[start, interval, len(samples) - 1.0] for start, interval, samples in model.tables]
        self.inputs = machine.put(np.array(of_inputs or [[0.0, 1.0, 0.0]]))
        self.attempts = max(1, min(FIRST_LAUNCH, MOST_AT_FIRST // members))
        self.nothing = machine.room(1)
        #: Observer that reduces the states at the times; without one they are saved, with one only the last.
        self.observer: Observer | None = plan.observer
        self.times = len(pacing.at) if self.observer is None else 1
        self.reduced = self.nothing if self.observer is None else machine.room(8 * self.observer.size * members)

    def make(self) -> None:
        self.call("prepare", 1, 1, self.numbers.sources, self.numbers.uniforms)
        arrays, times = self.arrays, self.times
        room = 0 if arrays.steps is None else len(arrays.steps.t)
        waypoints = 0 if arrays.waypoints is None else WAYPOINTS * arrays.waypoints.shape[1]
        each = 8 * (times * self.state + room * (1 + self.state) + waypoints + self.rows + 2 * self.state)
        at_once = max(1, min(MOST_SAVED, self.machine.largest) // each)
        for first in range(0, self.members, at_once):
            self.share(Share(first, min(self.members, first + at_once)))
        if self.observer is not None:
            reduced = np.empty((self.observer.results, self.members))
            self.machine.get(reduced, self.reduced)
            self.observer.take(reduced)

    def call(self, name: str, items: int, group: int, *arguments: Any) -> None:
        """Start a kernel: drivers of CPUs compile it anew for each size of groups, others choose a good one for few items."""
        size = -(-items // group) * group
        local = group if self.machine.is_cpu or group > 1 else None
        self.machine.start(self.program.kernel(name), size, local, *arguments)

    def share(self, share: Share) -> None:
        machine, arrays, pacing, width = self.machine, self.arrays, self.pacing, share.end - share.first
        group = 64 if width >= 64 else 1
        before = np.zeros((self.rows, width))
        behind = 0
        for block in (arrays.v[: self.n_v], arrays.y, arrays.paces):
            before[behind : behind + len(block)] = block if block.shape[-1] == 1 else block[:, share.first : share.end]
            behind += len(block)
        rows, seen, marks = machine.put(before), machine.room(8 * len(SEEN) * width), machine.room(8 * len(MARKS) * width)
        jumps = (self.jumps, np.int64(pacing.jumps.shape[1]), np.int64(len(pacing.jumps) // 2))
        of_call = (np.int64(share.first), np.int64(width), *jumps, rows, seen, marks)
        self.call("begin", width, group, *self.numbers.arguments, *of_call, np.int32(pacing.begins))
        times = len(pacing.at)
        origin, count = machine.room(16 * self.state * width), machine.put(np.zeros(1, np.int32))
        saved = [machine.room(8 * self.times * n * width) for n in (self.n_v, self.n_y)]
        steps, room = [self.nothing] * 3, 0
        if arrays.steps is not None:
            room = len(arrays.steps.t)
            steps = [machine.room(8 * room * n * width) for n in (1, self.n_v, self.n_y)]
        waypoints = self.nothing if arrays.waypoints is None else machine.put(share.of(arrays.waypoints))
        asked = (
            self.inputs, self.at, np.int64(pacing.at.shape[1]), np.int64(times), np.float64(pacing.budget),
            np.int64(pacing.every), np.int64(room), np.int32(arrays.waypoints is not None), origin, *saved, *steps, waypoints,
            count,
        )  # fmt: skip
        live = np.arange(width, dtype=np.int64)
        list_of_live, done, began = machine.put(live), np.zeros(1, np.int32), time.perf_counter()
        while True:
            attempts = self.attempts
            now = (list_of_live, np.int64(len(live)), np.int64(attempts), *([] if self.observer is None else [self.reduced]))
            self.call("attempts", len(live), group, *self.numbers.arguments, *of_call, *asked, *now)
            machine.get(done, count)
            took, began = time.perf_counter() - began, time.perf_counter()
            self.attempts = min(MOST_ATTEMPTS, max(1, min(8 * attempts, int(attempts * LAUNCH / max(took, 1e-9)))))
            if self.plan.progress is not None:
                self.plan.progress((share.first + int(done[0])) / self.members)
            _core.listen()
            if done[0] == width:
                break
            if 2 * (width - done[0]) <= len(live):  # the others are in the way
                status = self.mark(marks, "status", width)
                live = np.flatnonzero(status == RUNNING).astype(np.int64)
                list_of_live = machine.put(live)
        self.read(share, rows, marks, saved, steps, waypoints)

    def mark(self, marks: Any, name: str, width: int) -> Array:
        numbers: Array = np.empty(width, np.int64)
        self.machine.get(numbers, marks, 8 * width * MARKS.index(name))
        return numbers

    def read(self, share: Share, rows: Any, marks: Any, saved: list[Any], steps: list[Any], waypoints: Any) -> None:
        arrays, width, machine = self.arrays, share.end - share.first, self.machine
        columns = slice(share.first, share.end)

        def take(to: Array, buffer: Any, offset: int = 0) -> None:
            """Fill the columns of these members of an array, whose last axes are the members."""
            whole = to.reshape(-1, self.members)  # a view, of arrays that the run has just made
            if width == self.members and whole.flags.c_contiguous:
                machine.get(whole, buffer, offset)
                return
            taken: Array = np.empty((len(whole), width), to.dtype)
            machine.get(taken, buffer, offset)
            whole[:, columns] = taken

        take(arrays.last_state, rows)
        take(arrays.last_paces, rows, 8 * width * self.state)
        arrays.status[columns] = self.mark(marks, "status", width)
        for to, buffer in zip((arrays.saved_v, arrays.saved_y), saved, strict=True):
            if to.size:
                take(to, buffer)
        if arrays.steps is not None:
            arrays.steps.counts[columns] = self.mark(marks, "kept", width)
            for to, buffer in zip((arrays.steps.t, arrays.steps.v, arrays.steps.y), steps, strict=True):
                if to.size:
                    take(to, buffer)
        if arrays.waypoints is not None and arrays.waypoints.size:
            take(arrays.waypoints, waypoints)


def rows_of(stages: Stages) -> int:
    """How many numbers a member has between attempts: the state, the pace, what is behind it, coefficients of a series."""
    return stages.tried[3] if stages.tried is not None else len(stages.texts["step"].results)


class _Kernels:
    """Writes the kernels of a run; a pace has so many numbers, and there are so many sampled inputs."""

    def __init__(
        self, stages: Stages, numbers: int, tables: int, backward: bool, observer: Observer | None, *, until_last: bool = True
    ) -> None:
        self.observer, self.until_last = observer, until_last
        self.stages, self.texts, self.numbers, self.tables = stages, stages.texts, numbers, tables
        self.sign = "-1.0" if backward else "1.0"
        if any(text.entries for text in self.texts.values()):
            raise UnsupportedError("device: an attempt that reads the clock of the run cannot be printed; use device='cpu'")
        self.n_v, self.n_y = stages.sizes["v"], stages.sizes["y"]
        self.state, self.rows = self.n_v + self.n_y, rows_of(stages)
        self.row = "d" if stages.single else "s"
        self.of = {name: f"{self.row}{self.state + i}" for i, name in enumerate(PACE)}

    def text(self) -> str:
        uniforms = [line for text in self.texts.values() for line in text.uniforms]
        out = [self.stages.head, TIMES]
        out += [
            "__kernel void prepare(__global const double *restrict sources, __global real *restrict uniforms) {",
            *uniforms,
            "}",
        ]
        return "\n".join([*out, *self.begin(), *self.attempts()]) + "\n"

    def load(self) -> list[str]:
        """The rows of a member, in variables."""
        lines = [f"double {self.row}{i} = rows[{i} * width + c];" for i in range(self.rows)]
        lines += [f"double {name} = seen[{i} * width + c];" for i, name in enumerate(SEEN)]
        return lines + [f"long {name} = marks[{i} * width + c];" for i, name in enumerate(MARKS)]

    def store(self) -> list[str]:
        """The variables of a member, in its rows."""
        lines = [f"rows[{i} * width + c] = {self.row}{i};" for i in range(self.rows)]
        lines += [f"seen[{i} * width + c] = {name};" for i, name in enumerate(SEEN)]
        return lines + [f"marks[{i} * width + c] = {name};" for i, name in enumerate(MARKS)]

    def begin(self) -> list[str]:
        of, begin = self.of, []
        if "begin" in self.texts and not self.stages.single:
            text = self.texts["begin"]
            results = text.results[: self.rows]
            begin = ["if (begins) {", *text.member, *text.body]
            begin += [f"const real n{i} = {result};" for i, result in enumerate(results)]
            begin += [*(f"s{i} = n{i};" for i in range(len(results))), "}"]
        return [
            f"__kernel void begin({ARGUMENTS}, {OF_CALL}, const int begins) {{",
            "const long c = get_global_id(0);",
            "if (c >= width) return;",
            "const long g = first_member + c; (void)g;",
            *self.load(),
            "next = kept = has_origin = is_known = 0;",
            f"status = {RUNNING};",
            f"seen_accepted = {of['accepted']};",
            "origin_rejected = 0.0;",
            f"passed = (long){of['accepted']};",
            f"held_before = {of['held']} > 0.0;",
            f"{of['target']} = {of['t']};",
            f"{of['wall']} = next_time(jumps, jumps_width, walls, {of['t']}, g);",
            *begin,
            *self.store(),
            "}",
        ]

    def save(self, v: str, y: str, at: str) -> list[str]:
        lines = [f"{v}[({at} * {self.n_v} + {i}) * width + c] = {self.row}{i};" for i in range(self.n_v)]
        return lines + [f"{y}[({at} * {self.n_y} + {i}) * width + c] = {self.row}{self.n_v + i};" for i in range(self.n_y)]

    def save_next(self) -> list[str]:
        """Statements that save the state at the next time, or observe it."""
        if self.observer is None:
            return [*self.save("saved_v", "saved_y", "next"), "next++;"]
        keep = ["if (next + 1 == times) {", *self.save("saved_v", "saved_y", "0"), "}"]  # the last one is taken from the device
        return [*self.observe([f"(real){self.row}{i}" for i in range(self.state)], "next"), *keep, "next++;"]

    def observe(self, state: list[str], at: str) -> list[str]:
        """Statements by which the observer takes a state into account, that at a time."""
        assert self.observer is not None
        names = [f"const real q{i} = {text};" for i, text in enumerate(state)]
        return ["{", *names, f"const double seen_t = {self.sign} * time_of(at, at_width, {at}, g);", *self.observer.see(), "}"]

    def save_the_rest(self) -> list[str]:
        """Statements for the times to which a member does not come: its states are NaN."""
        to = "k" if self.observer is None else "0"
        nothing = [f"saved_v[({to} * {self.n_v} + {i}) * width + c] = NAN;" for i in range(self.n_v)]
        nothing += [f"saved_y[({to} * {self.n_y} + {i}) * width + c] = NAN;" for i in range(self.n_y)]
        seen = [] if self.observer is None else self.observe(["NAN"] * self.state, "k")
        return ["for (long k = next; k < times; k++) {", *seen, *nothing, "}"]

    def waypoint(self) -> list[str]:
        """Statements that keep where a member stands if it has come to a waypoint, or to a step before one."""
        of, n = self.of, self.state
        block = 2 * n + self.numbers
        to = "waypoints[(place + {}) * width + c]"
        count = to.format(2 * n + PACE.index("accepted"))
        return [
            f"if (waits_for && (long){of['accepted']} != passed) {{",
            f"passed = (long){of['accepted']};",
            "const int is_before = ((passed + 1) & passed) == 0, is_there = passed > 0 && (passed & (passed - 1)) == 0;",
            "const long waypoint = is_before ? passed + 1 : passed;",
            f"if (waypoint >= {FIRST_WAYPOINT} && (is_before || is_there)) {{",
            f"const long place = (long)(popcount(waypoint - 1) % {WAYPOINTS}) * {block};",
            "if (is_before) {",
            *(f"{to.format(i)} = {self.row}{i};" for i in range(n)),
            f"{count} = -1.0;",
            f"}} else if ({count} == -1.0) {{",
            *(f"{to.format(n + i)} = {self.row}{i};" for i in range(n + self.numbers)),
            "}",
            "}",
            "}",
        ]

    def attempt(self) -> list[str]:
        texts, of, n = self.texts, self.of, self.state
        step = texts["step"]
        if not self.stages.single:
            lines = ["{", *step.body, *(f"const real n{i} = {result};" for i, result in enumerate(step.results))]
            return [*lines, *(f"s{i} = n{i};" for i in range(self.rows)), "}"]
        assert self.stages.tried is not None
        state, tables, results, judged = self.stages.tried
        t, h, wall, extra = (of[name] for name in ("t", "h", "wall", "extra"))
        lines = [
            "{",
            f"const double step = 0.0 < {extra} ? {extra} : {wall} < {t} + {h} ? {wall} - {t} : {h};",
            f"const double middle = {self.sign} * ({t} + 0.5 * step); (void)middle;",
            *(f"const real s{i} = (real)d{i};" for i in range(n)),
            f"const real s{state} = (real){t}, s{state + 1} = (real)step;",
        ]
        for i in range(tables):  # no step crosses the time of a sample, so that one holds all over it: that of its middle
            slack = HOLD_SLACK.hex()
            lines += [
                f"double at{i} = floor((middle - inputs[{3 * i}]) / inputs[{3 * i + 1}] * {slack});",
                f"at{i} = at{i} > 0.0 ? at{i} : 0.0;",
                f"at{i} = at{i} < inputs[{3 * i + 2}] ? at{i} : inputs[{3 * i + 2}];",
                f"const real s{state + 2 + i} = sample_of(samples, offsets, widths, firsts[{i}] + (long)at{i}, g);",
            ]
        lines += step.body
        first = state + 2 + tables
        lines += [f"const double d{judged + i} = (double)({step.results[first + i]});" for i in range(results)]
        lines += texts["judged"].body
        lines += [f"const double n{i} = {texts['judged'].results[i]};" for i in range(judged)]
        return [*lines, *(f"d{i} = n{i};" for i in range(judged)), "}"]

    def by_terms(self) -> list[str]:
        """Statements that go by a series of known coefficients: to the next saved time within a held step, or all of it."""
        of, text, n = self.of, self.texts["by terms"], self.state
        count = n + self.numbers
        return [
            f"const int within = {self.holds()};",
            "if (within) {",
            f"{of['extra']} = {of['target']} - {of['t']};",
            *(f"origin[{i} * width + c] = s{i};" for i in range(n)),
            f"}} else {of['held']} = 0.0;",
            "{",
            *text.body,
            *(f"const real n{i} = {text.results[i]};" for i in range(count)),
            *(f"s{i} = n{i};" for i in range(count)),
            "}",
            "if (within) {",
            *self.save_next(),
            *(f"s{i} = origin[{i} * width + c];" for i in range(n)),
            "} else {",
            *self.waypoint(),
            "}",
        ]

    def extension(self) -> list[str]:
        """Statements that save the states at the times within a held step that come before the last one.

        If that is within, the step to there comes first: it may show that the held one missed something. Its state then stands
        behind the origin until the others are saved.
        """
        of, n, text = self.of, self.state, self.texts["extension"]
        t, h, wall, target, extra = (of[name] for name in ("t", "h", "wall", "target", "extra"))
        *terms, span, changes = text.results[n + self.numbers :]
        order = len(terms) // max(n, 1)
        lines = [
            f"const double final = {'time_of(at, at_width, times - 1, g)' if self.until_last else 'INFINITY'};",
            "int comes_first = 0;",
            f"if ({self.holds()} && {target} < final) {{",
            *text.body,
            *(f"const real power{i} = {term};" for i, term in enumerate(terms)),
            f"const double reach = {wall} < {t} + {h} ? {wall} : {t} + {h}, per_step = 1.0 / {span};",
            f"comes_first = !({changes} > 0.0) && final < reach && !is_known;",
            f"if (comes_first) {{ {extra} = final - {t}; has_origin = 2; origin_rejected = {of['rejected']};",
            *(f"origin[{i} * width + c] = s{i};" for i in range(n)),
            "}",
            f"while (!comes_first && !({changes} > 0.0) && {target} < reach && {target} < final) {{",
            f"const double share = ({target} - {t}) * per_step, square = share * share;",
        ]
        for i in range(n):
            odd, even = (self.horner([f"power{j * n + i}" for j in range(first, order, 2)]) for first in (0, 1))
            lines.append(f"const real within{i} = s{i} + share * ({odd} + share * ({even}));")
        saved = ["{", *(f"const real s{i} = within{i};" for i in range(n)), *self.save_next(), "}"]
        following = ["if (next == times) break;", f"{target} = time_of(at, at_width, next, g);"]
        last = ["{", *(f"const real s{i} = origin[{n + i} * width + c];" for i in range(n)), *self.save_next(), "}"]
        known = ["if (is_known) {", "is_known = 0;", *last, f"if (next < times) {target} = time_of(at, at_width, next, g);", "}"]
        return [*lines, *saved, *following, "}", "}", *known]

    @staticmethod
    def horner(terms: list[str]) -> str:
        """The sum of terms times powers of a square, by Horner's rule."""
        *others, total = terms
        for term in reversed(others):
            total = f"({term} + square * {total})"
        return total

    def holds(self) -> str:
        """The condition, as text, that the next saved time is within the held step."""
        t, h, target, wall, held = (self.of[name] for name in ("t", "h", "target", "wall", "held"))
        return f"{held} > 0.0 && {target} < ({wall} < {t} + {h} ? {wall} : {t} + {h})"

    def cross(self) -> list[str]:
        """Statements that bring a member that has come to a wall behind it."""
        of = self.of
        t, h, wall, before = (of[name] for name in ("t", "h", "wall", "before"))
        factor = MIN_FACTOR.hex()
        chosen = [f"{before} = {factor} * {before};"]
        if not self.stages.is_series:
            chosen = [
                f"const double least = {MOVES.hex()} * fabs(after), shorter = {factor} * {h};",
                f"{h} = {longer('shorter', 'least')};",
                f"{before} = 1.0;",
            ]
        return [
            f"if (walls && {t} >= {wall}) {{",
            f"const long last = passed_times(jumps, jumps_width, walls, {t}, g) - 1;",
            "if (last >= 0) {",
            "const double after = time_of(jumps, jumps_width, walls + last, g);",
            f"{wall} = next_time(jumps, jumps_width, walls, after, g);",
            *chosen,
            f"{t} = after;",
            f"{of['most']} = {MAX_FACTOR};",
            "}",
            "}",
        ]

    def attempts(self) -> list[str]:
        of, n, texts = self.of, self.state, self.texts
        t, h, target, extra, held = (of[name] for name in ("t", "h", "target", "extra", "held"))
        accepted, rejected, wall = of["accepted"], of["rejected"], of["wall"]
        goes = [
            f"if ({self.holds()}) {{",
            f"{extra} = {target} - {t};",
            *(f"origin[{i} * width + c] = {self.row}{i};" for i in range(n)),
            f"has_origin = 1; origin_rejected = {rejected};",
            f"}} else {held} = 0.0;",
            f"const int waits = {t} < {target} && {t} < {wall}, moves = {t} < {t} + {h};",
            f"const int runs = waits && moves && {accepted} + {rejected} < budget && {held} <= 0.0;",
            f"ends = !({extra} > 0.0 || runs);",
        ]
        last_t = f"next > 0 ? {self.sign} * time_of(at, at_width, next - 1, g) : NAN"
        terms = []
        if "by terms" in texts:
            terms = [
                f"if (goes_on && {held} > 0.0) {{",
                "if (!held_before) {",
                *self.by_terms(),
                "continue;",
                "}",
                "held_before = ends = 0;",
                "} else",
            ]
        return [
            f"__kernel void attempts({ARGUMENTS}, {OF_CALL}, __global const double *restrict inputs, "
            "__global const double *restrict at, const long at_width, const long times, const double budget, const long every, "
            "const long room, const int waits_for, __global double *restrict origin, __global double *restrict saved_v, "
            "__global double *restrict saved_y, __global double *restrict steps_t, __global double *restrict steps_v, "
            "__global double *restrict steps_y, __global double *restrict waypoints, __global int *count, "
            "__global const long *restrict live, const long live_count, const long limit"
            f"{'' if self.observer is None else f', {OF_AN_OBSERVER}'}) {{",
            "if (get_global_id(0) >= live_count) return;",
            "const long c = live[get_global_id(0)];",
            f"if (marks[{MARKS.index('status')} * width + c] != {RUNNING}) return;",
            "const long g = first_member + c; (void)g;",
            *self.load(),
            *([] if self.observer is None else self.observer.begin("next > 0", last_t)),
            *(line for name in ("step", "judged", "by terms", "extension") if name in texts for line in texts[name].member),
            f"for (long i = 0; i < limit && status == {RUNNING}; i++) {{",
            "int is_full = 0, ends = 1;",
            # What the driver of the core does between attempts, in its order.
            "if (every > 0) {",
            f"if ({accepted} > seen_accepted && (long){accepted} % every == 0) {{",
            f"steps_t[kept * width + c] = {t};",
            *self.save("steps_v", "steps_y", "kept"),
            "kept++;",
            "}",
            f"seen_accepted = {accepted};",
            "is_full = kept == room;",
            "}",
            "if (has_origin) {",
            f"if ({rejected} <= origin_rejected) {{",
            "if (has_origin == 1) {",
            *self.save_next(),
            "} else {",
            "is_known = 1;",
            *(f"origin[{n + i} * width + c] = {self.row}{i};" for i in range(n)),
            "}",
            *(f"{self.row}{i} = origin[{i} * width + c];" for i in range(n)),
            "}",
            "has_origin = 0;",
            "}",
            *self.cross(),
            "while (next < times) {",
            f"{target} = time_of(at, at_width, next, g);",
            f"if ({t} < {target}) break;",
            *self.save_next(),
            "}",
            "const int goes_on = !is_full && next < times;",
            *terms,
            "if (goes_on) {",
            *(self.extension() if "extension" in texts else []),
            f"if ({'!comes_first && ' if 'extension' in texts else ''}next < times) {{",
            *goes,
            "} else ends = next == times;",
            "}",
            "if (ends) {",
            f"const int is_out = {accepted} + {rejected} >= budget, is_finite = {of['error']} < INFINITY;",
            "status = next == times ? 0 : is_full ? -1 : is_out ? 2 : is_finite ? 3 : 4;",
            "break;",
            "}",
            *self.attempt(),
            *self.waypoint(),
            "}",
            f"if (status != {RUNNING}) {{",
            *self.save_the_rest(),
            "atomic_inc(count);",
            "}",
            *([] if self.observer is None else self.observer.end()),
            *self.store(),
            "}",
        ]


def longer(a: str, b: str) -> str:
    """The larger of two sizes, as the core has it."""
    return f"{a} < {b} ? {b} : {a}"
