"""The devices of this machine beside its CPU: ``python -m benches.devices [PART …] [--most MEMBERS] [--device NAME]``.

All runs have the bits of the CPU, which is checked. ``float64`` and ``float32`` are ensembles. For each system and number of
members: member-steps a second on the device, on all cores of the CPU and on one (steps alone, of runs so long that these decide),
the share of the device's arithmetic that this is (operations of a step × member-steps over what a kernel of sums and products
in registers reaches) and of its memory (states that launches load and store, over what a kernel that copies an array reaches),
the time to compile, and what a call takes beside the steps. Kepler's orbits have adaptive steps, which are as many as each
orbit needs: there a member-step is an attempt at one. ``published`` is a run of which others have published the time on their
machines. ``lengths`` are steps of more and more operations: how long they take to compile, and to make; those that are too long
to print are read from a list. ``bodies`` are many bodies, and ``calls`` what is done around steps: calls of a world, and
sweeps.
"""

from __future__ import annotations

import argparse
import os
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.device import adaptive, device_of, fixed, stages

STEPS, REVOLUTIONS = 1000, 10
#: Runs are made longer until their steps take so long, in seconds, or until so many steps or revolutions.
DECIDING, MOST_LENGTH = 0.2, 1e6
#: Calls of which the least time counts: so many, or as many as take so long in seconds.
REPEATS, ENOUGH = 3, 1.0
#: Members whose rate on one core is that of any number of them.
MEMBERS_OF_A_CORE = 1000
#: Springs of a chain, by their number about 1300, 4000, 10 000, 19 000 and 50 000 operations of a step; and the members.
CHAINS, OF_A_SPRING, MEMBERS_OF_A_CHAIN = (22, 69, 172, 330, 862), 57.9, 16_384
#: Many bodies.
CLUSTERS = 256, 1000, 4000, 16_000
#: Members of a world, and pixels along an edge of the map of a sweep.
WORLDS, SIDE = (1000, 100_000, 1_000_000), 3200
#: Lorenz in float32 from t = 0 to 1, 8 388 608 members on one Tesla V100, in seconds: 1000 steps of order 4 to 5, and adaptive
#: ones. Measured by Utkarsh et al. (2023, Automated translation and accelerated solving of differential equations on multiple GPU
#: platforms), whose raw data are in github.com/utkarsh530/GPUODEBenchmarks, folder paper_artifacts/data/Tesla_V100.
PUBLISHED = {"MPGOS": (94e-3, 49e-3), "DiffEqGPU": (145e-3, 69e-3), "JAX vmap": (10.0, None)}
MEMBERS_OF_PUBLISHED, STEPS_OF_PUBLISHED = 8_388_608, 1000

PEAK = """
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF
__kernel void peak(__global REAL *x, const int n) {
    const int g = get_global_id(0);
    REAL a = x[g], b = a + 1, c = a + 2, d = a + 3;
    const REAL p = (REAL)0.999, q = (REAL)0.001;
    for (int i = 0; i < n; i++) { a = a * p + q; b = b * p + q; c = c * p + q; d = d * p + q; }
    x[g] = a + b + c + d;
}
"""

COPY = """
__kernel void copied(__global const float4 *x, __global float4 *y) {
    const int g = get_global_id(0);
    y[g] = x[g];
}
"""
#: Bytes of the array that is copied, at most an eighth of the memory.
COPIED = 1 << 28

HEAD = """\
| system | members | 10⁹ member-steps a second | ns | of the arithmetic | of the memory | CPU, 10⁹ a second | ÷ CPU | ÷ one core \
| compiled, s | a call of one step, ms | CPU |
|---|---|---|---|---|---|---|---|---|---|---|---|"""


@sw.system(order=1)
def lorenz(t: Any, y: Any, *, rho: Any = 28.0) -> Any:
    """Lorenz's equations."""
    return np.array([10.0 * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])


@sw.system
def duffing(t: Any, v: Any, y: Any, *, beta: Any = 1.0) -> Any:
    """A driven and damped spring that stiffens."""
    return 0.3 * np.cos(1.2 * t) - 0.3 * v + y - beta * y * y * y


@sw.system(shape=(2,))
def kepler(t: Any, v: Any, y: Any) -> Any:
    """Around a mass of 1 in the plane."""
    r2 = y[0] * y[0] + y[1] * y[1]
    return -y / (r2 * np.sqrt(r2))


@sw.system
def wells(t: Any, v: Any, y: Any, *, damping: Any = 0.15) -> Any:
    """A damped ball between two wells."""
    return y - y**3 - damping * v


def chain(springs: int) -> Any:
    """Masses on springs that stiffen, from a wall."""

    @sw.system(shape=(springs,))
    def stiffening(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        longer = [y[0], *(y[i] - y[i - 1] for i in range(1, springs))]
        pull = [k * each + 0.3 * each * each * each for each in longer]
        return np.array([(pull[i + 1] if i + 1 < springs else 0.0) - pull[i] for i in range(springs)])

    return stiffening


@sw.system(order=1)
def hodgkin_huxley(t: Any, y: Any, *, i: Any = 10.0) -> Any:
    """A nerve cell: the voltage and three gates (Hodgkin and Huxley 1952)."""
    u, m, h, n = y
    a, b = 0.1 * (u + 40.0) / (1.0 - np.exp(-(u + 40.0) / 10.0)), 4.0 * np.exp(-(u + 65.0) / 18.0)
    c, d = 0.07 * np.exp(-(u + 65.0) / 20.0), 1.0 / (1.0 + np.exp(-(u + 35.0) / 10.0))
    e, f = 0.01 * (u + 55.0) / (1.0 - np.exp(-(u + 55.0) / 10.0)), 0.125 * np.exp(-(u + 65.0) / 80.0)
    current = i - 120.0 * m * m * m * h * (u - 50.0) - 36.0 * n * n * n * n * (u + 77.0) - 0.3 * (u + 54.387)
    return np.array([current, a * (1.0 - m) - b * m, c * (1.0 - h) - d * h, e * (1.0 - n) - f * n])


def of_lorenz(members: int) -> Any:
    return lorenz(rho=np.linspace(20, 30, members)), "rk4", {"y": 1.0, "dt": 1e-3}


def of_duffing(members: int) -> Any:
    return duffing(beta=np.linspace(0.5, 2, members)), "rk4", {"v": 0.0, "y": 1.0, "dt": 0.01}


def of_three_bodies(members: int) -> Any:
    y = np.array([[0.97, -0.24], [-0.97, 0.24], [0.0, 0.0]])[..., np.newaxis] * np.linspace(1.0, 1.1, members)
    v = np.array([[0.466, 0.432], [0.466, 0.432], [-0.932, -0.865]])[..., np.newaxis] + np.zeros(members)
    return sw.NBody([1.0, 1.0, 1.0], force="newton"), "leapfrog", {"v": v, "y": y, "dt": 1e-3}


def of_hodgkin_huxley(members: int) -> Any:
    start = np.array([-65.0, 0.053, 0.596, 0.317])[:, np.newaxis] + np.zeros(members)
    return hodgkin_huxley(i=np.linspace(5, 15, members)), "rk4", {"y": start, "dt": 0.01}


def of_kepler(members: int) -> Any:
    """Orbits from circles to an eccentricity of 0.9, each by steps of its own."""
    e = np.linspace(0.0, 0.9, members)
    v, y = np.array([0.0 * e, np.sqrt((1.0 + e) / (1.0 - e))]), np.array([1.0 - e, 0.0 * e])
    return kepler(), "dop853", {"v": v, "y": y, "tolerance": 1e-6}


SYSTEMS: dict[str, Callable[[int], Any]] = {
    "Lorenz": of_lorenz, "Duffing, driven": of_duffing, "three bodies": of_three_bodies, "Hodgkin-Huxley": of_hodgkin_huxley,
    "Kepler, adaptive": of_kepler,
}  # fmt: skip


def peak(machine: Any, single: bool) -> float:
    """Sums and products a second of the device, by a kernel that does nothing else."""
    program = machine.program(PEAK.replace("REAL", "float" if single else "double"))
    items, turns = 256 * 64 * machine.described.units, 2000
    x = machine.put(np.ones(items, np.float32 if single else np.float64))

    def call() -> None:
        program.kernel("peak")(machine.queue, (items,), None, x, np.int32(turns))
        machine.finish()

    return float(items * turns * 8 / least(call))


def least(call: Callable[[], Any]) -> float:
    """The least time of some calls; of long ones only the first counts."""
    took: list[float] = []
    while len(took) <= REPEATS and sum(took) < ENOUGH:
        took.append(timed(call)[0])
    return min(took[1:] or took)


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """How long a call takes, and what it returns."""
    begin = time.perf_counter()
    result = call()
    return time.perf_counter() - begin, result


def bandwidth(machine: Any) -> float:
    """Bytes a second that a kernel which copies an array reads and writes."""
    size = min(COPIED, machine.described.memory // 8) // 16 * 16
    program, x, y = machine.program(COPY), machine.put(np.ones(size // 8)), machine.room(size)

    def call() -> None:
        program.kernel("copied")(machine.queue, (size // 16,), None, x, y)
        machine.finish()

    return float(2 * size / least(call))


class Work:
    """A run of some length: so many steps, or so many revolutions of orbits by adaptive steps."""

    def __init__(self, name: str, members: int, dtype: str) -> None:
        self.system, self.method, options = SYSTEMS[name](members)
        self.members, self.adaptive, self.dtype = members, "tolerance" in options, dtype
        self.make = partial(sw.integrate, self.system, self.method, dtype=dtype, **options)

    def run(self, length: float, device: str, threads: int | None = None) -> sw.Run:
        """Make it; the shortest length is 0."""
        if self.adaptive:
            return self.make(at=[2.0 * np.pi * length + 1e-9], device=device, threads=threads)
        return self.make(steps=int(length) + 1, device=device, threads=threads)

    def rate(self, where: str, threads: int | None = None) -> tuple[float, float, float]:
        """Member-steps a second, the time of a call of one step, and the length of the run."""
        shortest = 0.1 if self.adaptive else 10
        return rate(lambda n: self.run(n, where, threads), shortest, lambda run: self.steps(run) - self.members)

    def steps(self, run: sw.Run) -> int:
        """Steps of all members, attempts that failed among them."""
        paces = run.paces
        return self.members * run.steps if paces is None else int((paces.accepted + paces.rejected).sum())

    def operations(self) -> int:
        """Operations of a step; of an attempt as many in both precisions, but for casts."""
        dtype = "float64" if self.adaptive else self.dtype
        return sum(sw.explain(self.system, self.method, dtype=dtype, attempt=self.adaptive).computed.values())

    def traffic(self, length: float, machine: Any) -> int:
        """The bytes that the launches of a run load and store: state, parameters and pace of each member."""
        plain, items = machine.start, []
        kernels = ("attempts",) if self.adaptive else ("steps",)

        def counted(kernel: Any, size: int, *rest: Any) -> None:
            if kernel.function_name in kernels:
                items.append(size)
            plain(kernel, size, *rest)

        machine.start = counted
        try:
            self.run(length, machine.described.name)
        finally:
            del machine.start
        return sum(items) * self.member_bytes()

    def member_bytes(self) -> int:
        """What a member loads and stores in a launch."""
        if not self.adaptive:
            kernel = sw.explain(self.system, self.method, dtype=self.dtype, device="opencl").kernel
            assert kernel is not None
            return kernel.member_bytes
        state = int(np.prod(self.system.v_shape) + np.prod(self.system.y_shape))
        own = state + len(adaptive.PACE) + len(adaptive.SEEN) + len(adaptive.MARKS)
        return 2 * 8 * own


def rate(call: Callable[[float], Any], length: float, done: Callable[[Any], float]) -> tuple[float, float, float]:
    """What is done in a second by calls so long that steps decide; how long a call of one step takes; and how long the call was.

    A call takes a length, 0 for one step, and makes ever longer ones from that length on; ``done`` counts what it has done.
    """
    call(0)
    begin = least(partial(call, 0))
    while True:
        took, run = timed(partial(call, length))
        if took - begin > max(DECIDING, begin) or length > MOST_LENGTH:
            break
        length *= 3
    took = min(took, timed(partial(call, length))[0])
    return done(run) / (took - begin), begin, length


def measured(name: str, members: int, dtype: str, machine: Any, one_core: float) -> str:
    """A line of the table; its limits are measured beside it, since other work of the machine changes both."""
    work, device = Work(name, members, dtype), machine.described.name
    compiled, _ = timed(partial(work.run, 0, device))
    length = max(10, min(STEPS, 100_000_000 // members)) if not work.adaptive else REVOLUTIONS if members < 1e6 else 1
    got, core = work.run(length, device), work.run(length, "cpu")
    assert np.array_equal(got.y, core.y, equal_nan=True)
    (on_device, call, length), (on_cpu, call_of_cpu, _) = (work.rate(where) for where in (device, "cpu"))
    limits = peak(machine, dtype == "float32"), bandwidth(machine)
    took, _ = timed(partial(work.run, length, device))
    of_sums, of_bytes = on_device * work.operations() / limits[0], work.traffic(length, machine) / took / limits[1]
    return (
        f"| {name} | {members:.0e} | {on_device / 1e9:.3g} | {1e9 / on_device:.3g} | {100 * of_sums:.0f} % | "
        f"{100 * of_bytes:.2g} % | {on_cpu / 1e9:.3g} | {on_device / on_cpu:.2g} | {on_device / one_core:.2g} | "
        f"{compiled:.2f} | {1e3 * call:.3g} | {1e3 * call_of_cpu:.3g} |"
    )


def of_ensembles(dtype: str, machine: Any, most: float) -> None:
    """Prints the table of ensembles."""
    limits = peak(machine, dtype == "float32"), bandwidth(machine)
    print(f"{dtype}: sums and products alone reach {limits[0] / 1e9:.0f}·10⁹ a second, copies {limits[1] / 1e9:.0f} GB/s\n")
    print(HEAD, flush=True)
    for name in SYSTEMS:
        one_core, members = Work(name, MEMBERS_OF_A_CORE, dtype).rate("cpu", 1)[0], 1000
        while members <= most:
            print(measured(name, members, dtype, machine, one_core), flush=True)
            members *= 10
    print()


def of_published(machine: Any) -> None:
    """Prints the times of a published run, here by Runge-Kutta 4 and by adaptive steps of order 5, and on others' machines."""
    print(f"Lorenz in float32, {MEMBERS_OF_PUBLISHED} members to t = 1, whole calls:")
    members = MEMBERS_OF_PUBLISHED // (64 if machine.is_cpu else 1)
    system = lorenz(rho=np.linspace(0, 21, members))
    ways: dict[str, Any] = {
        "rk4, 1000 steps": ("rk4", {"dt": 1e-3, "steps": STEPS_OF_PUBLISHED}),
        "fehlberg_5, 1000 steps": ("fehlberg_5", {"dt": 1e-3, "steps": STEPS_OF_PUBLISHED}),
        "fehlberg_5, adaptive, 1e-5": ("fehlberg_5", {"at": [1.0], "tolerance": 1e-5}),
    }
    for way, (method, options) in ways.items():
        run = partial(sw.integrate, system, method, y=1.0, dtype="float32", **options)
        run(device=machine.described.name)
        on_device, on_cpu = (least(partial(run, device=where)) for where in (machine.described.name, "cpu"))
        print(f"  {members} members, {way}: {1e3 * on_device:.0f} ms on the device, {1e3 * on_cpu:.0f} ms on the CPU", flush=True)
    print("Published, on one Tesla V100 (not measured here):")
    for name, (thousand, own) in PUBLISHED.items():
        step = 1e9 * thousand / (MEMBERS_OF_PUBLISHED * STEPS_OF_PUBLISHED)
        more = "" if own is None else f"; by adaptive steps {1e3 * own:.0f} ms"
        print(f"  {name}: {1e3 * thousand:.0f} ms for {STEPS_OF_PUBLISHED} steps, {step:.2g} ns a member-step{more}")
    print()


def of_lengths(machine: Any) -> None:
    """Prints how long steps of more and more operations take to compile and to make, printed and by a list."""
    print(
        "| operations of a step | compiled, s | list, s | ns a member-step | by the list | CPU |\n|---|---|---|---|---|---|",
        flush=True,
    )
    members, most = MEMBERS_OF_A_CHAIN // (16 if machine.is_cpu else 1), stages.MOST_OPERATIONS
    stiff = np.linspace(0.5, 2.0, members)
    machine.program("__kernel void nothing() {}")  # the driver starts
    for springs in CHAINS:
        run = partial(sw.integrate, chain(springs)(k=stiff), "rk4", v=0.0, y=0.01, dt=0.01)
        core, line = run(steps=3), [f"{OF_A_SPRING * springs:.0f}"]
        times, compiled = [], []
        for longest in (most, 0):
            if longest and OF_A_SPRING * springs > longest:
                times.append("—")
                compiled.append("—")
                continue
            stages.MOST_OPERATIONS = longest
            fixed._TEXTS.clear()
            took, got = timed(partial(run, steps=3, device=machine.described.name))
            assert np.array_equal(got.y, core.y)
            compiled.append(f"{took:.2f}")
            times.append(f"{of_a_chain(run, members, machine.described.name):.3g}")
        stages.MOST_OPERATIONS = most
        line += [*compiled, *times, f"{of_a_chain(run, members, 'cpu'):.3g}"]
        print(f"| {' | '.join(line)} |", flush=True)
    print()


def of_a_chain(run: Callable[..., sw.Run], members: int, where: str) -> float:
    """Nanoseconds of a member-step."""
    return 1e9 / rate(lambda n: run(steps=1 + int(n), device=where), 10, lambda made: members * (made.steps - 1))[0]


def of_bodies(machine: Any) -> None:
    """Prints the steps of many bodies."""
    print("| bodies, leapfrog | 10⁹ pairs a second | CPU | ÷ CPU | compiled, s |\n|---|---|---|---|---|", flush=True)
    for n in CLUSTERS[: 2 if machine.is_cpu else None]:
        v, y = np.random.default_rng(n).normal(size=(2, n, 3))
        run = partial(sw.integrate, sw.NBody(np.ones(n) / n, softening=0.1), "leapfrog", v=v, y=y, dt=1e-3)
        compiled, got = timed(partial(run, steps=2, device=machine.described.name))
        assert np.array_equal(got.y, run(steps=2).y)
        on_device, on_cpu = (of_a_cluster(run, n, where) for where in (machine.described.name, "cpu"))
        print(f"| {n} | {on_device / 1e9:.3g} | {on_cpu / 1e9:.3g} | {on_device / on_cpu:.2g} | {compiled:.2f} |", flush=True)
    print()


def of_a_cluster(run: Callable[..., sw.Run], n: int, where: str) -> float:
    """Pairs of bodies a second."""
    return rate(lambda steps: run(steps=1 + int(steps), device=where), 10, lambda made: (made.steps - 1) * n * (n - 1) / 2)[0]


def of_calls(machine: Any) -> None:
    """Prints what calls of worlds take, and a sweep."""
    device = machine.described.name
    print("| world of pendulums, members | a call of one step, ms | CPU | of 100 steps, ms | CPU |\n|---|---|---|---|---|")
    for members in WORLDS:
        took = []
        for steps in (1, 100):
            for where in (device, "cpu"):
                y = np.linspace(0.1, 1.0, members)
                world = sw.World(sw.Pendulum(np.linspace(0.5, 2.0, members)), "rk4", v=0.0 * y, y=y, dt=0.01, device=where)
                world.step(1)
                took.append(1e3 * least(partial(world.step, steps)))
        print(f"| {members} | " + " | ".join(f"{each:.3g}" for each in took) + " |", flush=True)
    side = SIDE // (32 if machine.is_cpu else 1)
    along = np.linspace(-2, 2, side)
    axes: Any = {"y": ("start", along), "v": ("push", along)}
    sweep = partial(sw.sweep, wells(), axes, "rk4", dt=0.02)
    sweep(steps=2, device=device)
    (on_device, got), (on_cpu, core) = (timed(partial(sweep, steps=2000, device=where)) for where in (device, "cpu"))
    assert np.array_equal(got.y_last, core.y_last)
    print(f"\na map of basins, {side}² members, 2000 steps: {on_device:.2f} s on the device, {on_cpu:.2f} s on the CPU")


def main() -> None:
    """Prints the tables."""
    parts: dict[str, Callable[[Any, float], None]] = {
        "float64": partial(of_ensembles, "float64"),
        "float32": partial(of_ensembles, "float32"),
        "published": lambda machine, _: of_published(machine),
        "bodies": lambda machine, _: of_bodies(machine),
        "calls": lambda machine, _: of_calls(machine),
        "lengths": lambda machine, _: of_lengths(machine),
    }
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(parts)}; all without one")
    parser.add_argument("--most", type=float, default=1e6, help="the most members")
    parser.add_argument("--device", default="opencl", help="the name of the device")
    arguments = parser.parse_args()
    if wrong := set(arguments.parts) - set(parts):
        parser.error(f"there is no part {', '.join(sorted(wrong))}")
    machine = device_of(arguments.device)
    assert machine is not None
    about, cores = machine.described, os.cpu_count()
    print(f"stepwell {sw.__version__}; {about.title} ({about.platform}); CPU: {sw.isa()}, {cores} cores\n")
    warnings.simplefilter("ignore")
    for part in arguments.parts or parts:
        parts[part](machine, arguments.most)


if __name__ == "__main__":
    main()
