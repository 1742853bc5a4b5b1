"""Many bodies on a device, whose step is too long for one kernel: their forces by a kernel of pairs, a method by its blocks.

A work item has a body and a slab of distances, and meets the partners at these from both sides: what the core computes once for
both bodies of a pair is computed for each. So no work item waits for another, and every sum has the order of the specification:
see ``reference/systems/nbody.py``. The places of bodies with mass lie one after the other for two rounds, so that no index wraps
and that work items side by side read what lies side by side.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from .. import _core
from ..base.arrays import Array
from ..errors import UnsupportedError
from ..model.parameters import rows
from ..reference.systems.nbody import LANES, partners
from . import blocks, promise
from .opencl import Machine
from .printer import HEAD, TYPES
from .stages import MOST_OPERATIONS

#: From so many operations of a step on, or so many bodies, it is made so, if all that the run asks for is there: one kernel of
#: more takes a compiler longer than many runs take.
LEAST_OPERATIONS, LEAST_BODIES = 5_000, 64
#: A launch takes about so long, in seconds: a desktop's watchdog ends longer ones, and Ctrl-C waits for one.
LAUNCH = 0.05
#: How many pairs the first launch has, which shows how long they take, and the most of any.
FIRST_LAUNCH, MOST_PAIRS = 1 << 18, 1 << 40
#: Work items of a group.
GROUP = 64
#: Velocities that are computed from a carry may be infinite once its numbers are of this size, as in the core.
HUGE = 2.0**960
#: The parameters of the equations.
KNOWN = frozenset({"masses", "strength", "softening", "dim", "force", "massless"})
#: A method whose steps need nothing but the state; none are made by it.
PLAIN = "false_euler"


def takes(model: Any, plan: Any) -> bool:
    """Whether a run is made here: of many bodies, or of so many that this is faster if it is possible."""
    if plan.system.kernel != "nbody":
        return False
    operations, bodies = _core.operations(model), len(plan.system.masses)
    return operations > MOST_OPERATIONS or ((operations > LEAST_OPERATIONS or bodies >= LEAST_BODIES) and not missing(plan))


def missing(plan: Any) -> str:
    """What a run asks for that is not there, in words; "" if nothing."""
    system, method = plan.system, plan.method
    others = [name for name, _ in system.parameters(plan.batch) if name not in KNOWN]
    asked = {
        "float32": plan.single,
        "fused=True": plan.fused,
        "control=": system.control is not None,
        "a controller": system.controller is not None,
        "events=": plan.watched is not None,
        "steps of each member": plan.lengths is not None,
        "surfaces": bool(system.contacts),
        f"the parameter {others[0]}" if others else "": bool(others),
        f"the method {method.name}": bool(method.is_exact or blocks.unwritten(method.key)),
    }
    return next((name for name, is_there in asked.items() if is_there), "")


def run(machine: Machine, plan: Any, arrays: Any) -> bool:
    """Make the run, and return whether some member has diverged, now or before: as ``_core.run``."""
    if reason := missing(plan):
        raise UnsupportedError(
            f"device: runs of many bodies have {reason} on device='cpu' only: their step has more than {MOST_OPERATIONS} "
            f"operations, which is too long for one kernel"
        )
    promise.check(machine, single=False)
    if arrays.first_bad.size == 0:
        return False
    plans = {"step": _stage(plan, "step")}
    if plan.method.begins:
        plans["start"] = _stage(plan, "start")
    if plan.method.carry is not None:
        plans["finish"] = _stage(plan, "finish")
    words = plan.system.equation_parameters(plan.batch)
    text = "\n".join([_forces(int(words["dim"]), words["force"] == "newton"), *(stage.text for stage in plans.values())])
    program = machine.program(text)
    with program.lock:
        return _Run(machine, program, plans, plan, arrays).make()


def _stage(plan: Any, stage: str) -> blocks.Stage:
    kept = [f"kept{i}" for i in range(len(plan.method.kept_of_v) if plan.method.kept else 0)]
    results = {"step": ["v", "y", *kept], "start": ["v", *kept], "finish": ["w"]}
    return blocks.stage_of(plan.method.key, stage, plan.choice, results[stage])


class _Run:
    """A run as it is made.

    Blocks on the device have the axes (member, direction, body), what is summed up (member, slab, direction, body).
    """

    def __init__(self, machine: Machine, program: Any, stages: dict[str, blocks.Stage], plan: Any, arrays: Any) -> None:
        self.machine, self.program, self.stages, self.plan, self.arrays = machine, program, stages, plan, arrays
        system, h = plan.system, plan.dt
        self.members = arrays.first_bad.size
        self.all, self.dim = system.y_shape
        self.of_member = self.all * self.dim
        self.count = self.members * self.of_member
        massive, massless = np.asarray(system.massive, np.int32), np.asarray(system.massless, np.int32)
        self.n, self.alone = len(massive), len(massless)
        slabs = partners(self.n)
        groups = [[(group[0], group[-1]) for group in slab if len(group)] for slab in slabs]
        self.slabs = len(slabs)
        #: How many pairs a work item has at most.
        self.longest = max(1, *(2 * sum((last - first) // LANES + 1 for first, last in slab) for slab in groups))
        ranks = np.full(self.all, -1, np.int32)
        ranks[massive] = np.arange(self.n)
        largest = 8 * self.members * max(self.of_member, self.dim * 2 * self.n, self.slabs * self.dim * self.n)
        if largest > machine.largest:
            raise UnsupportedError(
                f"device: these bodies need an array of {largest} bytes, {machine.described.name} ({machine.described.title}) "
                f"has room for one of {machine.largest}; split the batch, or use device='cpu'"
            )
        every = {name: self.wide(value) for name, value in system.parameters(plan.batch) if isinstance(value, np.ndarray)}
        strengths = h * every["strength"][:, massive]
        put = machine.put
        self.strengths = put(np.ascontiguousarray(np.concatenate([strengths, strengths], axis=1)))
        self.softs = put(np.ascontiguousarray(every["softening"][:, 0] * every["softening"][:, 0]))
        self.numbers = [np.int32(self.all), np.int32(self.n)]
        self.ranks, self.massive = put(ranks), put(massive if self.n else np.zeros(1, np.int32))
        self.massless = put(massless if self.alone else np.zeros(1, np.int32))
        self.firsts = put(np.cumsum([0, *map(len, groups)]).astype(np.int32))
        self.groups = put(np.array([each for slab in groups for each in slab] or [(1, 0)], np.int32))
        self.push = None
        if plan.force is not None:
            force = self.wide(rows(np.asarray(plan.force, np.float64), plan.batch, 2))
            self.push = put(h * self.block(force.T))
        room = machine.room
        self.places, self.round = room(8 * self.count), room(8 * self.members * self.dim * 2 * self.n)
        self.sums = room(8 * self.members * self.slabs * self.dim * self.n)
        self.bad = put(np.ascontiguousarray(arrays.first_bad, np.int64))
        self.doubt = put(np.zeros(1, np.int32))
        self.blocks: dict[str, Any] = {}
        parts = [arrays.v[at : at + self.of_member] for at in range(0, len(arrays.v), self.of_member)]
        for name, part in zip(["v", *(f"kept{i}" for i in range(len(parts) - 1))], parts, strict=True):
            self.blocks[name] = put(self.block(part))
        self.blocks["y"] = put(self.block(arrays.y))
        self.state = ["v", "y", *(name for name in stages["step"].passes[-1].writes if name not in ("v", "y"))]
        self.fresh = False  # whether h·v̇ at the places of the state is known
        self.pace, self.pending, self.began, self.rested = FIRST_LAUNCH, 0, time.perf_counter(), False

    def wide(self, values: Array) -> Array:
        """Rows of numbers as those of each member, with the members first."""
        return np.ascontiguousarray(np.broadcast_to(values, (len(values), self.members)).T)

    def block(self, values: Array) -> Array:
        """Rows of a block, body after body, in the order of the device."""
        wide = np.broadcast_to(values, (self.of_member, self.members))
        return np.ascontiguousarray(wide.reshape(self.all, self.dim, self.members).transpose(2, 1, 0), dtype=np.float64)

    def room(self, name: str) -> Any:
        """A block, which is there from its first use on."""
        if name not in self.blocks:
            self.blocks[name] = self.machine.room(8 * self.count)
        return self.blocks[name]

    def call(self, name: str, size: int, *arguments: Any) -> None:
        """Start a kernel of so many work items, in whole groups: drivers of CPUs compile it anew for each size of groups."""
        self.program.kernel(name)(self.machine.queue, (-(-size // GROUP) * GROUP,), (GROUP,), *arguments)

    def make(self) -> bool:
        """Make it."""
        plan = self.plan
        if not self.arrays.carried and "start" in self.stages:
            self.stage("start")
        at = 0
        if plan.every is not None:
            at = self.save(0)
        done = 0
        while done < plan.steps:
            until = plan.steps if plan.every is None else min(plan.steps, (done // plan.every + 1) * plan.every)
            before = {name: self.copy(name) for name in self.state}
            first, self.rested = done, False
            while done < until and not self.rested:
                self.stage("step")
                done += 1
                if self.pending >= self.pace:
                    break
            self.check(first, done, before, saves=done == until)
            if done == until:
                at = self.save(at)
            self.rest()
            if plan.progress is not None:
                plan.progress(done / plan.steps)
        self.finish()
        return bool((self.arrays.first_bad >= 0).any())

    def copy(self, name: str) -> Any:
        """A copy of a block."""
        to = self.machine.room(8 * self.count)
        self.machine.cl.enqueue_copy(self.machine.queue, to, self.blocks[name])
        return to

    def check(self, first: int, done: int, before: dict[str, Any], *, saves: bool) -> None:
        """Find where members diverged in these steps, which are made again if some did."""
        carries = "finish" in self.stages
        most = HUGE * min(abs(self.plan.dt), 1.0) if carries else np.inf
        for name in ("v", "y"):
            self.doubted(name, most)
        if carries and saves:
            self.stage("finish")
            self.doubted("w", np.inf)
        doubt = np.zeros(1, np.int32)
        self.machine.get(doubt, self.doubt)
        if not doubt[0]:
            return
        self.blocks.update(before)
        self.fresh = False
        if first and carries:  # those at the end of the steps before were not computed
            self.stage("finish")
            self.mark("w", first)
        for k in range(first, done):
            self.stage("step")
            self.mark("v", k + 1)
            self.mark("y", k + 1)
            if carries:
                self.stage("finish")
                self.mark("w", k + 1)
        self.doubt = self.machine.put(np.zeros(1, np.int32))

    def doubted(self, name: str, most: float) -> None:
        """Notice whether a number is not below this."""
        sizes = np.int64(self.count), np.int64(self.of_member)
        self.call("doubted", self.count, *sizes, self.blocks[name], np.float64(most), self.bad, self.doubt)

    def mark(self, name: str, done: int) -> None:
        """Members with a number that is not finite have diverged at this step, if not before."""
        sizes = np.int64(self.count), np.int64(self.of_member)
        self.call("mark", self.count, *sizes, self.blocks[name], np.int64(self.plan.first + done), self.bad)

    def stage(self, name: str) -> None:
        """Make a stage."""
        stage = self.stages[name]
        for each in stage.passes:
            if each.asks and name == "step" and self.fresh and stage.again and each.asks == stage.again[0]:
                continue
            of_all = np.int64(self.count), np.float64(self.plan.dt)
            reads = [self.room(block) for block in each.reads]
            writes = [self.room(block) for block in each.writes]
            if each.asks:
                writes = [*self.numbers, self.ranks, self.places, self.round]
            self.call(each.name, self.count, *of_all, *reads, *writes)
            if each.asks:
                self.forces(self.room(each.asks))
        if name == "step" and stage.again:
            one, other = stage.again
            self.blocks[one], self.blocks[other] = self.blocks[other], self.room(one)
            self.fresh = True

    def forces(self, out: Any) -> None:
        """h·v̇ at the places."""
        n = np.int32(self.n)
        if self.n:
            of_slabs = self.firsts, self.groups, self.round, self.strengths, self.softs, self.sums
            self.in_launches("pairs", self.members * self.slabs * self.n, self.longest, n, np.int32(self.slabs), *of_slabs)
            count = self.members * self.n
            self.call("gather", count, np.int64(count), *self.numbers, np.int32(self.slabs), self.massive, self.sums, out)
        if self.alone:
            of_round = self.places, self.round, self.strengths, self.softs, out
            counts = *self.numbers, np.int32(self.alone)
            self.in_launches("pulled", self.members * self.alone, max(1, self.n), *counts, self.massless, *of_round)
        if self.push is not None:
            self.call("pushed", self.count, np.int64(self.count), self.push, out)

    def in_launches(self, name: str, items: int, pairs: int, *arguments: Any) -> None:
        """Start a kernel in as many launches as it takes for each to be short."""
        at = 0
        while at < items:
            count = min(items - at, max(1, self.pace // pairs))
            self.call(name, count, np.int64(at), np.int64(count), *arguments)
            at += count
            self.pending += count * pairs
            if at < items and self.pending >= self.pace:
                self.rest()

    def rest(self) -> None:
        """Wait until all is done, and see how long it took."""
        self.machine.finish()
        now = time.perf_counter()
        took, self.began = max(now - self.began, 1e-9), now
        if self.pending:
            self.pace = min(MOST_PAIRS, max(1, min(8 * self.pending, int(self.pending * LAUNCH / took))))
        self.pending, self.rested = 0, True
        _core.listen()

    def save(self, at: int) -> int:
        """Take the state from the device, as the ``at``-th; returns the number of the next."""
        arrays = self.arrays
        velocities = "v"
        if "finish" in self.stages:
            self.stage("finish")
            velocities = "w"
        self.read(velocities, arrays.saved_v[at])
        self.read("y", arrays.saved_y[at])
        if arrays.recorded is not None:
            self.record(at)
        return at + 1

    def read(self, name: str, to: Array) -> None:
        """Take a block from the device."""
        values = np.empty((self.members, self.dim, self.all))
        self.machine.get(values, self.blocks[name])
        to[...] = values.transpose(2, 1, 0).reshape(to.shape)

    def record(self, at: int) -> None:
        """The quantities of the state that was saved, by the core."""
        plan, arrays = self.plan, self.arrays
        system = plan.system
        model = _core.ModelSpec(system.kernel, PLAIN, system.parameters(plan.batch), record=list(plan.record))
        one = slice(at, at + 1)
        v, y = (
            np.ascontiguousarray(each[at], np.float64).reshape(self.of_member, -1) for each in (arrays.saved_v, arrays.saved_y)
        )
        beside = arrays._replace(
            v=v, y=y, carried=False, saved_v=np.empty_like(arrays.saved_v[one]), saved_y=np.empty_like(arrays.saved_y[one]),
            recorded=arrays.recorded[one], carry=None, first_bad=np.full(self.members, -1, np.int64),
        )  # fmt: skip
        _core.run(model, plan._replace(steps=0, every=None, choice=0, progress=None, force=None), beside)

    def finish(self) -> None:
        """Take from the device what is left there at the end."""
        arrays = self.arrays
        bad = np.empty(self.members, np.int64)
        self.machine.get(bad, self.bad)
        arrays.first_bad[...] = bad
        if arrays.carry is None:
            return
        names = ["v", *self.state[2:]]
        parts = [np.empty((self.of_member, self.members)) for _ in names]
        for name, part in zip(names, parts, strict=True):
            self.read(name, part)
        arrays.carry[...] = np.concatenate(parts).reshape(arrays.carry.shape)


def _forces(dim: int, is_newton: bool) -> str:
    """The text of the kernels of forces."""
    axes = range(dim)
    pull = "1.0 / (r2 * sqrt(r2))" if is_newton else "1.0 / r2"

    def meets(partner: str, forward: bool, sums: str) -> list[str]:
        """The statements by which a body meets a partner, and adds the pull of it to sums."""
        apart = "x[{c}][p] - own{c}" if forward else "own{c} - x[{c}][p]"
        apart = apart.replace("x[{c}][p]", "x[{c} * 2L * n + p]")
        return [
            f"const long p = {partner};",
            *(f"const real d{c} = {apart.format(c=c)};" for c in axes),
            f"const real r2 = {' + '.join(f'd{c} * d{c}' for c in axes)} + soft;",
            f"const real w = ({pull}) * strength[p];",
            *(f"{sums}{c} = {sums}{c} + d{c} * w;" for c in axes),
        ]

    def begun(*names: str) -> list[str]:
        return [f"real {name}{c} = -0.0;" for name in names for c in axes]

    return "\n".join(
        [
            HEAD + TYPES[False],
            # Puts a number of a place where the forces read it.
            "inline void put_place(real x, long g, int all, int n, __global const int *ranks, __global real *places, "
            "__global real *round) {",
            "const long row = g / all;",
            "const int rank = ranks[g % all];",
            "places[g] = x;",
            "if (rank >= 0) { round[row * 2 * n + rank] = x; round[row * 2 * n + n + rank] = x; }",
            "}",
            "__kernel void pairs(const long from, const long count, const int n, const int slabs, __global const int *firsts, "
            "__global const int *groups, __global const real *restrict round, __global const real *restrict strengths, "
            "__global const real *softs, __global real *restrict sums) {",
            "if ((long)get_global_id(0) >= count) return;",
            "const long g = from + get_global_id(0);",
            "const int j = g % n;",
            "const long slab = g / n, m = slab / slabs;",
            f"__global const real *x = round + m * {dim} * 2 * n;",
            "__global const real *strength = strengths + m * 2 * n;",
            "const real soft = softs[m];",
            *(f"const real own{c} = x[{c} * 2L * n + j];" for c in axes),
            *begun("after", "low", "high"),
            "for (int q = firsts[slab % slabs]; q < firsts[slab % slabs + 1]; q++) {",
            "const int first = groups[2 * q], last = groups[2 * q + 1];",
            # Opposite bodies meet once: the first half of the bodies meets those after them.
            "const int opposite = 2 * last == n;",
            f"const int end = opposite && j >= last ? last - {LANES} : last;",
            f"for (int k = first; k <= end; k += {LANES}) {{",
            *meets("j + k", True, "after"),
            "}",
            f"int k = opposite && j < last ? last - {LANES} : last;",
            f"for (; k >= first && k > j; k -= {LANES}) {{",
            *meets("j + n - k", False, "high"),
            "}",
            f"for (; k >= first; k -= {LANES}) {{",
            *meets("j + n - k", False, "low"),
            "}",
            "}",
            *(f"sums[(slab * {dim} + {c}) * n + j] = after{c} - (low{c} + high{c});" for c in axes),
            "}",
            "__kernel void gather(const long count, const int all, const int n, const int slabs, __global const int *massive, "
            "__global const real *restrict sums, __global real *restrict out) {",
            "const long g = get_global_id(0);",
            "if (g >= count) return;",
            "const long m = g / n;",
            "const int j = g % n;",
            *begun("sum"),
            "for (int s = 0; s < slabs; s++) {",
            *(f"sum{c} = sum{c} + sums[((m * slabs + s) * {dim} + {c}) * n + j];" for c in axes),
            "}",
            *(f"out[(m * {dim} + {c}) * all + massive[j]] = sum{c};" for c in axes),
            "}",
            "__kernel void pulled(const long from, const long count, const int all, const int n, const int alone, "
            "__global const int *massless, __global const real *restrict places, __global const real *restrict round, "
            "__global const real *restrict strengths, __global const real *softs, __global real *restrict out) {",
            "if ((long)get_global_id(0) >= count) return;",
            "const long g = from + get_global_id(0);",
            "const long m = g / alone;",
            "const int i = massless[g % alone];",
            f"__global const real *x = round + m * {dim} * 2 * n;",
            "__global const real *strength = strengths + m * 2 * n;",
            "const real soft = softs[m];",
            *(f"const real own{c} = places[(m * {dim} + {c}) * all + i];" for c in axes),
            *begun("sum"),
            "for (int j = 0; j < n; j++) {",
            *meets("j", True, "sum"),
            "}",
            *(f"out[(m * {dim} + {c}) * all + i] = sum{c};" for c in axes),
            "}",
            "__kernel void pushed(const long count, __global const real *restrict push, __global real *restrict out) {",
            "const long g = get_global_id(0);",
            "if (g < count) out[g] = out[g] + push[g];",
            "}",
            "__kernel void doubted(const long count, const long each, __global const real *x, const real most, "
            "__global const long *bad, __global int *doubt) {",
            "const long g = get_global_id(0);",
            "if (g < count && !(fabs(x[g]) < most) && bad[g / each] < 0) doubt[0] = 1;",
            "}",
            "__kernel void mark(const long count, const long each, __global const real *x, const long k, __global long *bad) {",
            "const long g = get_global_id(0);",
            "if (g < count && !(fabs(x[g]) < INFINITY) && bad[g / each] < 0) bad[g / each] = k;",
            "}",
        ]
    )
