"""Runs of fixed steps on a device: a work item for each member, its state in private variables over all steps of a launch."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .. import _core
from ..base.arrays import Array
from . import bodies, promise
from .bodies import HUGE, LAUNCH
from .opencl import Machine
from .reductions import ARGUMENTS as OF_AN_OBSERVER
from .reductions import Observer
from .stages import ARGUMENTS, Numbers, Stages, wide

#: Steps of the first launch, which shows how long one takes, and the most of any.
FIRST_LAUNCH, MOST_STEPS = 32, 1 << 16
#: Steps of members in the first launch, at most.
MOST_AT_FIRST = 1 << 21
#: The most bytes of saved states and of tables of steps on the device at a time.
MOST_SAVED, MOST_TABLE = 1 << 28, 1 << 26
#: ``HUGE`` in float32.
HUGE_SINGLE = 2.0**64
#: How many texts a process keeps.
MOST_TEXTS = 256

#: The names of the arrays of saved states.
SAVED = ("saved v", "saved y", "recorded")

_TEXTS: OrderedDict[Any, tuple[Stages, str]] = OrderedDict()


class Launch(NamedTuple):
    """Some intervals of steps, after each of which the state is saved, or observed, or not."""

    intervals: int
    length: int
    saves: bool


def text_of(model: Any, single: bool, choice: int, observer: Observer | None = None) -> tuple[Stages, str]:
    """The stages of a model, and the kernels of a run of fixed steps."""
    key = _core.tape_number(model, choice=choice), single, None if observer is None else observer.key
    if key not in _TEXTS:
        stages = Stages(model, single=single, choice=choice)
        _TEXTS[key] = stages, _kernels(stages, observer)
        while len(_TEXTS) > MOST_TEXTS:
            _TEXTS.popitem(last=False)
    return _TEXTS[key]


class Rooms:
    """The arrays of runs on a device, by name; those of a world stay there from one call of it to the next."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._buffers: dict[str, Any] = {}

    def room(self, name: str, size: int) -> Any:
        """Room for so many bytes."""
        if name not in self._buffers or self._buffers[name].size < size:
            self._buffers[name] = self._machine.room(size)
        return self._buffers[name]

    def put(self, name: str, array: Array) -> Any:
        """A copy of an array."""
        if name in self._buffers and self._buffers[name].size >= array.nbytes > 0:
            self._machine.write(self._buffers[name], array)
        else:
            self._buffers[name] = self._machine.put(array)
        return self._buffers[name]


def run(machine: Machine, model: Any, plan: Any, arrays: Any, numbers: Numbers | None = None, rooms: Rooms | None = None) -> bool:
    """Make the run, and return whether some member has diverged, now or before: as ``_core.run``.

    ``numbers`` are those of the model if they are on the device already, and ``rooms`` the arrays, for a world.
    """
    if numbers is None and bodies.takes(model, plan):
        return bodies.run(machine, plan, arrays)
    single = arrays.saved_y.dtype == np.float32
    promise.check(machine, single=single)
    members = arrays.first_bad.size
    if members == 0:
        return False
    stages, text = text_of(model, single, plan.choice, plan.observer)
    program = machine.program(text)
    with program.lock:
        numbers = numbers or Numbers(machine, stages, model, members, plan.dt)
        return _Run(machine, program, stages, plan, arrays, numbers, rooms or Rooms(machine)).make()


class _Run:
    def __init__(
        self, machine: Machine, program: Any, stages: Stages, plan: Any, arrays: Any, numbers: Numbers, rooms: Rooms
    ) -> None:
        self.machine, self.program, self.stages, self.plan, self.arrays = machine, program, stages, plan, arrays
        self.members = members = arrays.first_bad.size
        self.kind = np.float32 if stages.single else np.float64
        self.bytes = np.dtype(self.kind).itemsize
        self.numbers, self.rooms = numbers, rooms
        sizes = stages.sizes
        self.state = sizes["v"] + sizes["y"] + sizes["kept"] + sizes["tally"]
        before = np.zeros((self.state, members), self.kind)
        n_v, n_y = sizes["v"], sizes["y"]
        before[:n_v], before[n_v : n_v + n_y] = (wide(each, members, self.kind) for each in (arrays.v[:n_v], arrays.y))
        rest = arrays.v[n_v:]  # what is kept, or what a controller remembers at the start, which stands last
        end = n_v + n_y + sizes["kept"]
        before[end - len(rest) : end] = rest
        self.now, self.next = rooms.put("now", before), rooms.room("next", before.nbytes)
        self.bad = rooms.put("bad", np.ascontiguousarray(arrays.first_bad, np.int64))
        self.saved = [rooms.room(name, 0) for name in SAVED]
        #: Observer that reduces the states after every so many steps; without one they are saved.
        self.observer: Observer | None = plan.observer
        self.every, self.reduced, self.last_t = plan.every, None, np.nan
        if self.observer is not None:
            self.every, self.reduced = self.observer.every, machine.room(8 * self.observer.size * members)
        self.group = 64 if members >= 64 else 1
        self.table = rooms.room("table", 0)
        entries = len(stages.texts["step"].entries)
        #: The steps of the next launch, and the most of any: their table must fit.
        self.pace = max(1, min(FIRST_LAUNCH, MOST_AT_FIRST // members))
        self.most_steps = min(MOST_STEPS, max(1, MOST_TABLE // max(1, 8 * entries)))

    def call(self, name: str, size: int, *arguments: Any) -> None:
        """Start a kernel of so many work items, in whole groups: drivers of CPUs compile it anew for each size of groups."""
        self.machine.start(self.program.kernel(name), -(-size // self.group) * self.group, self.group, *arguments)

    def make(self) -> bool:
        plan, arrays, of_time = self.plan, self.arrays, (np.float64(self.plan.t0), np.float64(self.plan.dt))
        if not self.numbers.is_prepared:  # those of a world are, from its first call on
            self.call("prepare", 1, self.numbers.sources, self.numbers.uniforms)
            self.numbers.is_prepared = True
        if not arrays.carried and "start" in self.stages.texts:
            self.call("start", self.members, *self.numbers.arguments, np.int64(plan.first), *of_time, self.now)
        at = 0
        if self.every is not None:
            self.steps(Launch(1, 0, True), 0)
            at = self.read(0, 1)
        done, began = 0, time.perf_counter()
        for launch in self.launches():
            self.steps(launch, done)
            done += launch.intervals * launch.length
            if launch.saves:
                at = self.read(at, launch.intervals)
            self.machine.finish()
            now = time.perf_counter()
            took, began = now - began, now
            made = launch.intervals * launch.length
            self.pace = min(self.most_steps, max(1, min(8 * made, int(made * LAUNCH / max(took, 1e-9)))))
            if plan.progress is not None:
                plan.progress(done / plan.steps)
            _core.listen()
        self.finish()
        return bool((arrays.first_bad >= 0).any())

    def launches(self) -> Iterator[Launch]:
        plan, sizes = self.plan, self.stages.sizes
        each = (sizes["v"] + sizes["y"] + sizes["recorded"]) * self.members * self.bytes
        at_once = max(1, min(MOST_SAVED, self.machine.largest) // max(1, each)) if self.observer is None else plan.steps
        left = plan.steps
        while left:
            every = min(left, self.every or plan.steps)
            if every <= self.pace:
                intervals = max(1, min(self.pace // every, at_once, left // every))
                yield Launch(intervals, every, True)
                left -= intervals * every
                continue
            through = every
            while through:
                length = min(through, self.pace)
                through -= length
                yield Launch(1, length, through == 0)
            left -= every

    def steps(self, launch: Launch, done: int) -> None:
        plan, sizes, count = self.plan, self.stages.sizes, launch.intervals * launch.length
        first, entries = plan.first + done, len(self.stages.texts["step"].entries)
        of_time = np.float64(plan.t0), np.float64(plan.dt)
        if entries and count:
            self.table = self.rooms.room("table", count * entries * max(self.bytes, 8))
            self.call("table", count, *self.numbers.arguments, np.int64(count), np.int64(first), *of_time, self.table)
        if launch.saves:
            rows = (sizes["v"], sizes["y"], sizes["recorded"])
            self.saved = [
                self.rooms.room(name, (launch.intervals if self.observer is None else 1) * n * self.members * self.bytes)
                for name, n in zip(SAVED, rows, strict=True)
            ]
        most = (HUGE_SINGLE if self.stages.single else HUGE) * min(abs(plan.dt), 1.0)
        counts = (np.int64(first), np.int64(launch.intervals), np.int64(launch.length), np.int32(launch.saves))
        since, seen = np.int32(done > 0), (np.int32(not np.isnan(self.last_t)), np.float64(self.last_t), self.reduced)
        self.call(
            "steps", self.members, *self.numbers.arguments, *counts, *of_time, since, self.kind(most), self.table,
            self.now, self.next, *self.saved, self.bad, *(() if self.observer is None else seen),
        )  # fmt: skip
        if launch.saves:
            self.last_t = plan.t0 + (first + count) * plan.dt
        self.now, self.next = self.next, self.now

    def read(self, at: int, count: int) -> int:
        """Take saved states from the device, from the ``at``-th on; returns the number of the next.

        Of observed states only the last one is taken, at the end.
        """
        if self.observer is not None:
            return 0
        self.take(at, count)
        return at + count

    def take(self, at: int, count: int) -> None:
        arrays = self.arrays
        n_v = self.stages.sizes["v"]
        for to, buffer, n in zip(
            (arrays.saved_v, arrays.saved_y, arrays.recorded), self.saved,
            (n_v, self.stages.sizes["y"], self.stages.sizes["recorded"]), strict=True,
        ):  # fmt: skip
            if n == 0 or to is None:
                continue
            rows = to.reshape(len(to), n, self.members)[at : at + count]
            if rows.dtype == self.kind and rows.flags.c_contiguous:
                self.machine.get(rows, buffer)
            else:
                taken: Array = np.empty(rows.shape, self.kind)
                self.machine.get(taken, buffer)
                rows[...] = taken

    def finish(self) -> None:
        arrays, sizes = self.arrays, self.stages.sizes
        bad = np.empty(self.members, np.int64)
        self.machine.get(bad, self.bad)
        arrays.first_bad[...] = bad
        if self.observer is not None:
            self.take(0, 1)
            reduced = np.empty((self.observer.results, self.members))
            self.machine.get(reduced, self.reduced)
            self.observer.take(reduced)
        if arrays.carry is None and arrays.tally is None:
            return
        last = np.empty((self.state, self.members), self.kind)
        self.machine.get(last, self.now)
        n_v, behind = sizes["v"], sizes["v"] + sizes["y"]
        if arrays.carry is not None:
            carry = np.concatenate([last[:n_v], last[behind : behind + sizes["kept"]]])
            arrays.carry[...] = carry.reshape(arrays.carry.shape)
        if arrays.tally is not None and arrays.tally.size:
            arrays.tally[...] = last[behind + sizes["kept"] :].reshape(arrays.tally.shape)


def _kernels(stages: Stages, observer: Observer | None) -> str:
    sizes, texts = stages.sizes, stages.texts
    n_v, n_y = sizes["v"], sizes["y"]
    slots = n_v + n_y
    n = slots + sizes["kept"] + sizes["tally"]
    step, finish = texts["step"], texts.get("finish")
    entries = len(step.entries)
    out = [stages.head]
    uniforms = [line for text in texts.values() for line in text.uniforms]
    out += [
        "__kernel void prepare(__global const double *restrict sources, __global real *restrict uniforms) {",
        "if (get_global_id(0) > 0) return;",
        *uniforms,
        "}",
    ]
    if entries:
        out += [
            f"__kernel void table({ARGUMENTS}, const long count, const long first, const double t0, const double h, "
            "__global bits *table) {",
            "const long g = get_global_id(0);",
            "if (g >= count) return;",
            "const double t = t0 + (double)(first + g) * h;",
            *step.moment,
            *(
                f"table[g * {entries} + {i}] = {f'(bits)step_e{i}' if kind == 'row' else f'bits_of(step_e{i})'};"
                for i, (kind, _) in enumerate(step.entries)
            ),
            "}",
        ]
    load = [f"s{i} = state[{i} * members + g];" for i in range(n)]

    def beside(name: str, k: str) -> list[str]:
        """The statements that a stage beside the steps needs at step k, and its body."""
        text = texts[name]
        return [f"const double t = t0 + (double)({k}) * h; (void)t;", *text.member, *text.moment, *text.body]

    if "start" in texts:
        to = [*range(n_v), *range(slots, slots + sizes["kept"] - sizes["memory"])]
        out += [
            f"__kernel void start({ARGUMENTS}, const long first, const double t0, const double h, __global real *state) {{",
            "const long g = get_global_id(0);",
            "if (g >= members) return;",
            *(f"real s{i};" for i in range(n)),
            *load,
            *beside("start", "first"),
            *(f"state[{i} * members + g] = {texts['start'].results[i]};" for i in to),
            "}",
        ]
    finite = " && ".join(f"fabs(s{i}) < INFINITY" for i in range(slots)) or "1"
    small = " && ".join(f"fabs(s{i}) < {'most' if stages.carries else 'INFINITY'}" for i in range(slots)) or "1"
    velocities, shown = [], [f"s{i}" for i in range(slots)]
    if finish is not None and stages.carries:
        velocities = beside("finish", "k")
        shown[:n_v] = [f"w{i}" for i in range(n_v)]
    in_words = " && ".join(f"fabs({text}) < INFINITY" for text in (finish.results[:n_v] if velocities and finish else [])) or "1"
    seen = ["{", *velocities, f"if (!({in_words})) {{ bad[g] = k; return; }}", "}"] if velocities else []
    save = []
    if velocities and finish:
        save += [*(f"real w{i};" for i in range(n_v)), "{", *velocities]
        save += [*(f"w{i} = {finish.results[i]};" for i in range(n_v)), "}"]
        words = " && ".join(f"fabs(w{i}) < INFINITY" for i in range(n_v)) or "1"
        save += [f"if (k > first - since && !({words})) doubt = 1;"]
    keep = [f"saved_v[(at * {n_v} + {i}) * members + g] = {shown[i]};" for i in range(n_v)]
    keep += [f"saved_y[(at * {n_y} + {i}) * members + g] = {shown[n_v + i]};" for i in range(n_y)]
    if "record" in texts or observer is not None:
        save += [f"const real q{i} = {text};" for i, text in enumerate(shown)]
    if "record" in texts:
        # The quantities of what is saved, and of what a controller remembers, which stands last of what is kept.
        memory = sizes["memory"]
        results = texts["record"].results[slots + memory :]
        save += [f"const real q{slots + i} = s{slots + sizes['kept'] - memory + i};" for i in range(memory)]
        inner = [f"const real s{i} = q{i};" for i in range(slots + memory)]
        save += [*(f"real r{i};" for i in range(len(results))), "{", *inner, *beside("record", "0")]
        save += [*(f"r{i} = {text};" for i, text in enumerate(results)), "}"]
        keep += [f"recorded[(at * {len(results)} + {i}) * members + g] = r{i};" for i in range(len(results))]
    if observer is None:
        save += ["const long at = i;", *keep]
    else:
        save += ["const double seen_t = t0 + (double)k * h;", *observer.see()]
        save += ["if (i + 1 == intervals) {", "const long at = 0;", *keep, "}"]  # the last one is taken from the device
    look_up = []
    for i, (kind, _) in enumerate(step.entries):
        value = f"table[(k - first) * {entries} + {i}]"
        look_up.append(
            f"const long step_e{i} = (long){value};" if kind == "row" else f"const real step_e{i} = number_of({value});"
        )
    out += [
        f"__kernel void steps({ARGUMENTS}, const long first, const long intervals, const long length, const int saves, "
        "const double t0, const double h, const int since, const real most, __global const bits *restrict table, "
        "__global const real *restrict state, __global real *restrict next, __global real *restrict saved_v, "
        "__global real *restrict saved_y, __global real *restrict recorded, __global long *restrict bad"
        f"{'' if observer is None else f', const int begun, const double last_t, {OF_AN_OBSERVER}'}) {{",
        "const long g = get_global_id(0);",
        "if (g >= members) return;",
        *(f"real s{i};" for i in range(n)),
        *step.member,
        "int doubt = 0;",
        *([] if observer is None else observer.begin("begun", "last_t")),
        # A second time only where a member diverged, to find at which step.
        "for (int again = 0; again < 2; again++) {",
        *load,
        "long k = first;",
        *(["if (again && since) {", *seen, "}"] if seen else []),
        "for (long i = 0; i < intervals; i++) {",
        "for (long j = 0; j < length; j++) {",
        *look_up,
        *step.body,
        *(f"const real n{i} = {text};" for i, text in enumerate(step.results[:n])),
        *(f"s{i} = n{i};" for i in range(n)),
        "k++;",
        "if (again) {",
        f"if (!({finite})) {{ bad[g] = k; return; }}",
        *seen,
        "}",
        "}",
        "if (saves && !again) {",
        *save,
        "}",
        "}",
        "if (!again) {",
        *(f"next[{i} * members + g] = s{i};" for i in range(n)),
        *([] if observer is None else observer.end()),
        f"if (bad[g] >= 0 || (!doubt && {small})) return;",
        "}",
        "}",
        "}",
    ]
    return "\n".join(out) + "\n"
