"""Many bodies on a device, whose step is too long for one kernel: their forces by a kernel of pairs, a method by its blocks."""

from __future__ import annotations

import time
from math import prod
from typing import Any

import numpy as np

from .. import _core
from ..base.arrays import Array
from ..errors import UnsupportedError
from ..model.around import FORCE
from ..model.parameters import rows
from ..reference.systems.nbody import LANES, partners
from . import blocks, forces, keeping, promise
from .blocks import HERE
from .opencl import Machine, Programs
from .stages import MOST_READ

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
#: The parameters of the equations, and of what keeps their energy.
KNOWN = frozenset({"masses", "strength", "softening", "dim", "force", "massless"})
KEEPING = frozenset({"control", "control.form", "control.when", "control.way", "control.gain", "control.target"})
#: Quantities that are sums over pairs, or are found among them.
OF_PAIRS = ("energy", "closest")
#: A method whose steps need nothing but the state; none are made by it.
PLAIN = "false_euler"


def takes(model: Any, plan: Any) -> bool:
    """True if a run is made here: of many bodies, or of so many that this is faster if it is possible."""
    if plan.system.kernel != "nbody":
        return False
    operations, bodies = _core.operations(model), len(plan.system.masses)
    return operations > MOST_READ if missing(plan) else operations > LEAST_OPERATIONS or bodies >= LEAST_BODIES


def missing(plan: Any) -> str:
    """The unsupported options of a run, in words; "" if there are none."""
    system, method = plan.system, plan.method
    others = [name for name, _ in system.parameters(plan.batch) if name not in KNOWN | KEEPING]
    asked = {
        "float32": plan.single,
        "fused=True": plan.fused,
        "this control=": system.control is not None and not keeping.is_known(system.control),
        "a controller": system.controller is not None,
        "steps of each member": plan.lengths is not None,
        "surfaces": bool(system.contacts),
        f"the parameter {others[0]}" if others else "": bool(others),
        f"the method {method.name}": bool(method.is_exact or blocks.unwritten(method.key)),
    }
    return next((name for name, is_there in asked.items() if is_there), "")


def run(machine: Machine, plan: Any, arrays: Any, bodies: Bodies | None = None) -> bool:
    """Make the run, and return whether some member has diverged, now or before: as ``_core.run``.

    ``bodies`` are those of the plan if they are on the device already, for a world.
    """
    if arrays.first_bad.size == 0:
        check(machine, plan)
        return False
    if plan.watched is not None:  # as of the core, whose steps of so many bodies notice nothing: the states are looked at
        check(machine, plan)
        return bool((arrays.first_bad >= 0).any())
    bodies = bodies or Bodies(machine, plan)
    with bodies.program.lock:
        return _Run(bodies, plan, arrays).make()


def check(machine: Machine, plan: Any) -> None:
    """Raise if a run asks for what is not there."""
    if reason := missing(plan):
        raise UnsupportedError(
            f"device: runs of many bodies have {reason} on device='cpu' only: their step has more than {MOST_READ} operations, "
            f"which is too long for one kernel"
        )
    promise.check(machine, single=False)


class Bodies:
    """The bodies of a run or a world on a device: their kernels, their numbers, and room for what a step computes.

    Blocks there have the axes (member, direction, body), what is summed up (member, slab, direction, body).

    Attributes:
        stages: the stages of the method, by name.
        program: their kernels; those of a method, of a control and of the forces are built apart, for runs have other ones.
        control: what keeps the energy, or None.
        sizes: how many numbers of a member v and y have, the method keeps, a controller remembers.
        carries: whether the method has a carry instead of v.
        blocks: blocks by name, each from its first use on.
        pace: how many pairs a launch has.
        known: the places for which a run has left the forces with which the next step begins, or None.
    """

    def __init__(self, machine: Machine, plan: Any) -> None:
        check(machine, plan)
        self.machine, self.plan, self.members = machine, plan, plan.members
        system = plan.system
        self.control = system.control
        self.pushes = self.control is not None and keeping.pushes(self.control)
        method = plan.method
        kept = [f"kept{i}" for i in range(len(method.kept_of_v) if method.kept else 0)]
        results = {"step": ["v", "y", *kept]}
        if method.begins:
            results["start"] = ["v", *kept]
        if method.carry is not None:
            results["finish"] = ["w"]
        self.stages = {
            name: blocks.stage_of(method.key, name, plan.choice, written, pushed=self.pushes) for name, written in results.items()
        }
        self.state = results["step"]
        self.all, self.dim = system.y_shape
        self.of_member = self.all * self.dim
        self.sizes = {"v": self.of_member, "y": self.of_member, "kept": plan.slot_numbers - self.of_member, "memory": 0}
        self.carries = method.carry is not None
        self.count = self.members * self.of_member
        with_energies = self.control is not None or "energy" in plan.record
        texts = forces.texts_of(self.dim, system.force, energies=with_energies, nearest="closest" in plan.record)
        if self.control is not None:
            texts.append(keeping.text_of(self.control, self.dim))
        texts.append("\n".join(stage.text for stage in self.stages.values()))
        self.program = Programs(machine, [f"{forces.BEFORE}{text}" for text in texts])
        self.massive = np.asarray(system.massive, np.int32)
        massless = np.asarray(system.massless, np.int32)
        self.n, self.alone = len(self.massive), len(massless)
        groups = [[(group[0], group[-1]) for group in slab if len(group)] for slab in partners(self.n)]
        self.slabs = len(groups)
        #: How many pairs a work item has at most.
        self.longest = max(1, *(2 * sum((last - first) // LANES + 1 for first, last in slab) for slab in groups))
        ranks = np.full(self.all, -1, np.int32)
        ranks[self.massive] = np.arange(self.n)
        put, room, each = machine.put, machine.room, 8 * self.members
        self.counts = [np.int32(self.all), np.int32(self.n)]
        self.ranks, self.of_massive = put(ranks), put(self.massive if self.n else np.zeros(1, np.int32))
        self.massless = put(massless if self.alone else np.zeros(1, np.int32))
        self.firsts = put(np.cumsum([0, *map(len, groups)]).astype(np.int32))
        self.groups = put(np.array([one for slab in groups for one in slab] or [(1, 0)], np.int32))
        self.places, self.round = room(each * self.of_member), room(each * self.dim * 2 * self.n)
        self.sums = room(each * self.slabs * self.dim * self.n)
        self.speeds = [room(each * self.of_member)] * self.pushes
        self.wells, self.shares, self.parts = (
            room(each * numbers if with_energies else 0)
            for numbers in (self.slabs * self.n, forces.SUMS * self.n, forces.SUMS * LANES)
        )
        self.energies, self.tallies = room(each * forces.SUMS), room(each)
        self.blocks: dict[str, Any] = {}
        self.pace = FIRST_LAUNCH
        self.known: Array | None = None
        named = {name: value for name, value in system.parameters(plan.batch) if isinstance(value, np.ndarray)}
        if plan.force is not None:
            named[FORCE] = rows(np.asarray(plan.force, np.float64), plan.batch, 2)
        self.take(named)

    def take(self, numbers: dict[str, Array]) -> None:
        """Take the rows of the parameters, and of a force, if there is one."""
        put, h, self.known = self.machine.put, self.plan.dt, None
        every = {name: self._wide(value) for name, value in numbers.items()}
        strengths = h * every["strength"][:, self.massive]
        self.strengths = put(np.ascontiguousarray(np.concatenate([strengths, strengths], axis=1)))
        self.softs = put(np.ascontiguousarray(every["softening"][:, 0] * every["softening"][:, 0]))
        self.masses = put(every["masses"])
        none = np.zeros((self.members, 1))
        self.gains, self.targets = (put(every.get(f"control.{name}", none)) for name in ("gain", "target"))
        self.push = put(h * self.block(numbers[FORCE])) if FORCE in numbers else None

    def _wide(self, values: Array) -> Array:
        """Rows of numbers as those of each member, with the members first."""
        return np.ascontiguousarray(np.broadcast_to(values, (len(values), self.members)).T, dtype=np.float64)

    def block(self, values: Array) -> Array:
        """Rows of a block, body after body, in the order of the device."""
        wide = np.broadcast_to(values, (self.of_member, self.members))
        return np.ascontiguousarray(wide.reshape(self.all, self.dim, self.members).transpose(2, 1, 0), dtype=np.float64)

    def room(self, name: str) -> Any:
        """A block, which is there from its first use on."""
        if name not in self.blocks:
            self.blocks[name] = self.machine.room(8 * self.count)
        return self.blocks[name]


class _Run:
    def __init__(self, bodies: Bodies, plan: Any, arrays: Any) -> None:
        self.bodies, self.machine, self.plan, self.arrays = bodies, bodies.machine, plan, arrays
        self.stages, self.blocks = bodies.stages, bodies.blocks
        of_member = bodies.of_member
        parts = [arrays.v[at : at + of_member] for at in range(0, len(arrays.v), of_member)]
        for name, part in zip(["v", *bodies.state[2:]], parts, strict=False):
            self.machine.set(bodies.room(name), bodies.block(part))
        places = bodies.block(arrays.y)
        self.machine.set(bodies.room("y"), places)
        self.machine.set(bodies.tallies, np.zeros(bodies.members))
        self.bad = self.machine.put(np.ascontiguousarray(arrays.first_bad, np.int64))
        self.doubt = self.machine.put(np.zeros(1, np.int32))
        #: True if h·v̇ at the places of the state is known, and True if its velocities and its potentials are.
        self.fresh = bodies.known is not None and bodies.known.tobytes() == places.tobytes()
        self.finished = self.has_wells = False
        self.looks = bool((arrays.first_bad < 0).any())
        self.pending, self.began, self.rested = 0, time.perf_counter(), False

    def call(self, name: str, size: int, *arguments: Any) -> None:
        """Start a kernel of so many work items, in whole groups: drivers of CPUs compile it anew for each size of groups."""
        self.machine.start(self.bodies.program.kernel(name), -(-size // GROUP) * GROUP, GROUP, *arguments)

    def make(self) -> bool:
        plan = self.plan
        if not self.arrays.carried and "start" in self.stages:
            if plan.every is not None:
                self.find_wells()
            self.stage("start")
        at = 0
        if plan.every is not None:
            at = self.save(0)
        done = 0
        while done < plan.steps:
            until = plan.steps if plan.every is None else min(plan.steps, (done // plan.every + 1) * plan.every)
            before = {name: self.copy(self.blocks[name]) for name in self.bodies.state if self.looks}
            tallies = self.copy(self.bodies.tallies)
            first, self.rested = done, False
            while done < until and not self.rested:
                self.step()
                done += 1
                if self.pending >= self.bodies.pace:
                    break
            self.check(first, done, before, tallies, saves=done == until)
            if done == until:
                at = self.save(at)
            self.rest()
            if plan.progress is not None:
                plan.progress(done / plan.steps)
        self.finish()
        return bool((self.arrays.first_bad >= 0).any())

    def copy(self, of: Any) -> Any:
        to = self.machine.room(of.size)
        self.machine.copy(to, of)
        return to

    def check(self, first: int, done: int, before: dict[str, Any], tallies: Any, *, saves: bool) -> None:
        """Find where members diverged in these steps, which are made again if some did."""
        if not self.looks:
            return
        carries = "finish" in self.stages
        most = HUGE * min(abs(self.plan.dt), 1.0) if carries else np.inf
        for name in ("v", "y"):
            self.doubted(name, most)
        if carries and saves:
            self.find_wells()
            self.stage("finish")
            self.doubted("w", np.inf)
        doubt = np.zeros(1, np.int32)
        self.machine.get(doubt, self.doubt)
        if not doubt[0]:
            return
        self.blocks.update(before)
        self.machine.copy(self.bodies.tallies, tallies)
        self.fresh = self.finished = self.has_wells = False
        if first and carries:  # those at the end of the steps before were not computed
            self.stage("finish")
            self.mark("w", first)
        for k in range(first, done):
            self.step()
            self.mark("v", k + 1)
            self.mark("y", k + 1)
            if carries:
                self.stage("finish")
                self.mark("w", k + 1)
        self.doubt = self.machine.put(np.zeros(1, np.int32))

    def doubted(self, name: str, most: float) -> None:
        """Notice whether a number is not below this."""
        count = self.bodies.count
        sizes = np.int64(count), np.int64(self.bodies.of_member)
        self.call("doubted", count, *sizes, self.blocks[name], np.float64(most), self.bad, self.doubt)

    def mark(self, name: str, done: int) -> None:
        """Members with a number that is not finite have diverged at this step, if not before."""
        count = self.bodies.count
        sizes = np.int64(count), np.int64(self.bodies.of_member)
        self.call("mark", count, *sizes, self.blocks[name], np.int64(self.plan.first + done), self.bad)

    def step(self) -> None:
        """Make a step, and keep the energy after it if that is asked for."""
        bodies, stage = self.bodies, self.stages["step"]
        keeps = bodies.control is not None and not bodies.pushes
        moves = keeps and keeping.moves_places(bodies.control)
        # The gradient is that of the energy alone, without a force from outside.
        ends_there = bool(stage.last) and not (moves and bodies.push is not None)
        self.stage("step", wells=stage.last if keeps and ends_there else "")
        at = stage.last if ends_there else HERE
        if keeps:
            if not ends_there:
                self.call("placed", bodies.count, np.int64(bodies.count), self.blocks["y"], *self.where())
                self.forces(bodies.room(at), wells=True)
            self.keep(bodies.room(at), self.blocks["v"], self.blocks["y"])
            if not ends_there:
                self.push(bodies.room(at))
        if (ends_there or keeps) and not moves:
            self.blocks[HERE], self.blocks[at] = bodies.room(at), bodies.room(HERE)
            self.fresh = True

    def where(self) -> list[Any]:
        """The arguments by which a kernel puts places where the forces read them."""
        bodies = self.bodies
        return [*bodies.counts, bodies.ranks, bodies.places, bodies.round]

    def stage(self, name: str, wells: str = "") -> None:
        """Make a stage; with the evaluation of this name potentials are found."""
        bodies, stage = self.bodies, self.stages[name]
        if name == "finish" and self.finished:
            return
        self.finished = name == "finish"
        of_all = np.int64(bodies.count), np.float64(self.plan.dt)
        for each in stage.passes:
            if each.asks == HERE and self.fresh:
                continue
            reads = [bodies.room(block) for block in each.reads]
            writes = [bodies.room(block) for block in each.writes]
            if each.asks:
                writes = [*self.where(), *bodies.speeds]
            self.call(each.name, bodies.count, *of_all, *reads, *writes)
            if each.asks:
                self.forces(bodies.room(each.asks), wells=bodies.pushes or each.asks == wells)
                if bodies.pushes:
                    self.keep(bodies.room(each.asks), bodies.speeds[0], bodies.places)
                self.push(bodies.room(each.asks))
            self.fresh |= each.asks == HERE
        if name == "step":
            self.fresh = self.has_wells = False

    def forces(self, out: Any, *, wells: bool = False) -> None:
        """h·v̇ at the places, with potentials or without."""
        bodies = self.bodies
        n, slabs, members = np.int32(bodies.n), np.int32(bodies.slabs), bodies.members
        if bodies.n:
            of_slabs = bodies.firsts, bodies.groups, bodies.round, bodies.strengths, bodies.softs, bodies.sums
            name, more = ("pairs_and_wells", [bodies.wells]) if wells else ("pairs", [])
            self.in_launches(name, members * bodies.slabs * bodies.n, bodies.longest, n, slabs, *of_slabs, *more)
            count = members * bodies.n
            self.call("gather", count, np.int64(count), *bodies.counts, slabs, bodies.of_massive, bodies.sums, out)
        if bodies.alone:
            of_round = bodies.places, bodies.round, bodies.strengths, bodies.softs, out
            counts = *bodies.counts, np.int32(bodies.alone)
            self.in_launches("pulled", members * bodies.alone, max(1, bodies.n), *counts, bodies.massless, *of_round)

    def push(self, out: Any) -> None:
        if self.bodies.push is not None:
            self.call("pushed", self.bodies.count, np.int64(self.bodies.count), self.bodies.push, out)

    def sum_up(self, v: Any, dv: Any) -> None:
        """The energies at the places of the last forces, with these velocities."""
        bodies = self.bodies
        count, n, slabs = bodies.members * bodies.n, np.int32(bodies.n), np.int32(bodies.slabs)
        if count:
            of_bodies = bodies.of_massive, bodies.masses, bodies.wells, v, dv, bodies.shares
            self.call("shares", count, np.int64(count), *bodies.counts, slabs, np.float64(self.plan.dt), *of_bodies)
        lanes = bodies.members * forces.SUMS * LANES
        self.call("parts", lanes, np.int64(lanes), n, bodies.shares, bodies.parts)
        self.call("totals", bodies.members, np.int64(bodies.members), n, bodies.parts, bodies.energies)

    def keep(self, dv: Any, v: Any, y: Any) -> None:
        """Apply the control to a rate, or to a state."""
        bodies, h = self.bodies, np.float64(self.plan.dt)
        self.sum_up(v, dv)
        numbers = bodies.energies, bodies.gains, bodies.targets
        count = np.int64(bodies.count)
        self.call("kept", bodies.count, count, bodies.counts[0], h, *numbers, bodies.masses, dv, v, y)
        self.call("tallied", bodies.members, np.int64(bodies.members), h, *numbers, bodies.tallies)

    def in_launches(self, name: str, items: int, pairs: int, *arguments: Any) -> None:
        """Start a kernel in as many launches as it takes for each to be short."""
        at = 0
        while at < items:
            count = min(items - at, max(1, self.bodies.pace // pairs))
            self.call(name, count, np.int64(at), np.int64(count), *arguments)
            at += count
            self.pending += count * pairs
            if at < items and self.pending >= self.bodies.pace:
                self.rest()

    def rest(self) -> None:
        """Wait until all is done, and see how long it took."""
        self.machine.finish()
        now = time.perf_counter()
        took, self.began = max(now - self.began, 1e-9), now
        if self.pending:
            self.bodies.pace = min(MOST_PAIRS, max(1, min(8 * self.pending, int(self.pending * LAUNCH / took))))
        self.pending, self.rested = 0, True
        _core.listen()

    def save(self, at: int) -> int:
        """Take the state from the device, as the ``at``-th; returns the number of the next."""
        arrays = self.arrays
        velocities = "v"
        if "finish" in self.stages:
            self.find_wells()
            self.stage("finish")
            velocities = "w"
        self.read(velocities, arrays.saved_v[at])
        self.read("y", arrays.saved_y[at])
        if arrays.recorded is not None:
            self.record(at, self.blocks[velocities])
        return at + 1

    def read(self, name: str, to: Array) -> None:
        bodies = self.bodies
        values = np.empty((bodies.members, bodies.dim, bodies.all))
        self.machine.get(values, self.blocks[name])
        to[...] = values.transpose(2, 1, 0).reshape(to.shape)

    def record(self, at: int, velocities: Any) -> None:
        """The quantities of the state that was saved: those of pairs on the device, sums over bodies by the core."""
        bodies, plan = self.bodies, self.plan
        sizes = {name: prod(plan.system.quantities[name]) for name in plan.record}
        rows = self.arrays.recorded[at].reshape(-1, bodies.members)
        found = self.of_bodies([name for name in plan.record if name not in OF_PAIRS], at)
        if "energy" in plan.record:
            found["energy"] = self.energy(velocities)
        if "closest" in plan.record:
            found["closest"] = self.closest()
        first = 0
        for name, size in sizes.items():
            rows[first : first + size] = found[name]
            first += size

    def find_wells(self) -> None:
        """If energies are recorded, the potentials at the places of the state, with the forces there, which stages then have."""
        if self.has_wells or "energy" not in self.plan.record:
            return
        bodies = self.bodies
        self.call("placed", bodies.count, np.int64(bodies.count), self.blocks["y"], *self.where())
        self.forces(bodies.room(HERE), wells=True)
        self.push(bodies.room(HERE))
        self.fresh = self.has_wells = True

    def energy(self, velocities: Any) -> Array:
        self.find_wells()
        self.sum_up(velocities, self.blocks[HERE])
        energies = np.empty((self.bodies.members, forces.SUMS))
        self.machine.get(energies, self.bodies.energies)
        return np.asarray(energies[:, 1] / self.plan.dt)

    def closest(self) -> Array:
        """The least distance of two bodies, of which one has mass, at the places of the state."""
        bodies = self.bodies
        items = bodies.members * bodies.all
        least = self.machine.room(8 * items)
        self.call("placed", bodies.count, np.int64(bodies.count), self.blocks["y"], *self.where())
        of_places = bodies.ranks, bodies.places, bodies.round, least
        self.in_launches("nearest", items, max(1, bodies.n), *bodies.counts, *of_places)
        found = np.empty((bodies.members, bodies.all))
        self.machine.get(found, least)
        return np.asarray(np.sqrt(found.min(axis=1)))

    def of_bodies(self, names: list[str], at: int) -> dict[str, Array]:
        """Quantities of the state that was saved, by the core."""
        if not names:
            return {}
        bodies, plan, arrays = self.bodies, self.plan, self.arrays
        system, of_member = plan.system, bodies.of_member
        sizes = [prod(system.quantities[name]) for name in names]
        model = _core.ModelSpec(system.kernel, PLAIN, system.parameters(plan.batch), record=names)
        v, y = (np.ascontiguousarray(each[at], np.float64).reshape(of_member, -1) for each in (arrays.saved_v, arrays.saved_y))
        one, recorded = slice(at, at + 1), np.empty((1, sum(sizes), bodies.members))
        beside = arrays._replace(
            v=v, y=y, carried=False, saved_v=np.empty_like(arrays.saved_v[one]), saved_y=np.empty_like(arrays.saved_y[one]),
            recorded=recorded, tally=None, carry=None, first_bad=np.full(bodies.members, -1, np.int64),
        )  # fmt: skip
        _core.run(model, plan._replace(steps=0, every=None, choice=0, progress=None, force=None), beside)
        return dict(zip(names, np.split(recorded[0], np.cumsum(sizes)[:-1]), strict=True))

    def finish(self) -> None:
        arrays = self.arrays
        bad = np.empty(self.bodies.members, np.int64)
        self.machine.get(bad, self.bad)
        arrays.first_bad[...] = bad
        if arrays.tally is not None:
            tallies = np.empty(self.bodies.members)
            self.machine.get(tallies, self.bodies.tallies)
            arrays.tally[...] = tallies
        last = arrays.saved_y[-1].reshape(self.bodies.of_member, self.bodies.members)
        self.bodies.known = self.bodies.block(last) if self.fresh else None
        if arrays.carry is None:
            return
        names = ["v", *self.bodies.state[2:]]
        parts = [np.empty((self.bodies.of_member, self.bodies.members)) for _ in names]
        for name, part in zip(names, parts, strict=True):
            self.read(name, part)
        arrays.carry[...] = np.concatenate(parts).reshape(arrays.carry.shape)
