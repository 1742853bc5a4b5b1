"""Ensembles on the devices of this machine beside its CPU: ``python -m benches.devices [--most MEMBERS] [--device NAME]``.

For each system and number of members: member-steps a second on the device and on all cores of the CPU (steps alone, the least of
some calls in turn; both have the same bits, which is checked), the share of the device's arithmetic that this is (operations of a
step × member-steps over what a kernel of sums and products in registers reaches) and of its memory (states that launches load and
store, over what a kernel that copies an array reaches), the time to compile, and what a call takes beside the steps. Kepler's
orbits have adaptive steps, which are as many as each orbit needs: there a member-step is an attempt at one. The published figures
are of others' machines and were not measured here.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.device import adaptive, device_of

STEPS, REVOLUTIONS, REPEATS = 1000, 10, 3
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
| system | members | 10⁹ member-steps a second | ns | of the arithmetic | of the memory | CPU, 10⁹ a second | ÷ CPU | \
compiled, s | a step, ms |
|---|---|---|---|---|---|---|---|---|---|"""


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
    """The least time of some calls."""
    took = []
    for _ in range(REPEATS + 1):
        begin = time.perf_counter()
        call()
        took.append(time.perf_counter() - begin)
    return min(took[1:])


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

    def run(self, length: float, device: str) -> sw.Run:
        """Make it; the shortest length is 0."""
        if self.adaptive:
            return self.make(at=[2.0 * np.pi * length + 1e-9], device=device)
        return self.make(steps=int(length) + 1, device=device)

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


def measured(name: str, members: int, dtype: str, machine: Any) -> str:
    """A line of the table; its limits are measured beside it, since other work of the machine changes both."""
    work, device = Work(name, members, dtype), machine.described.name
    begin = time.perf_counter()
    work.run(0, device)
    compiled = time.perf_counter() - begin
    length = max(10, min(STEPS, 200_000_000 // members)) if machine.is_cpu else STEPS
    length = REVOLUTIONS if work.adaptive else length
    got, core = work.run(length, device), work.run(length, "cpu")
    assert np.array_equal(got.y, core.y, equal_nan=True)
    one = [least(partial(work.run, 0, where)) for where in (device, "cpu")]
    whole = [least(partial(work.run, length, where)) for where in (device, "cpu")]
    limits = peak(machine, dtype == "float32"), bandwidth(machine)
    steps = work.steps(got) - work.steps(work.run(0, "cpu"))
    on_device, on_cpu = (steps / max(w - o, 1e-9) for w, o in zip(whole, one, strict=True))
    of_sums, of_bytes = on_device * work.operations() / limits[0], work.traffic(length, machine) / whole[0] / limits[1]
    return (
        f"| {name} | {members:.0e} | {on_device / 1e9:.3g} | {1e9 / on_device:.3g} | {100 * of_sums:.0f} % | "
        f"{100 * of_bytes:.2g} % | {on_cpu / 1e9:.3g} | {on_device / on_cpu:.2f} | {compiled:.2f} | {1e3 * one[0]:.2f} |"
    )


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--most", type=float, default=1e6, help="the most members")
    parser.add_argument("--device", default="opencl", help="the name of the device")
    arguments = parser.parse_args()
    machine = device_of(arguments.device)
    assert machine is not None
    about = machine.described
    print(f"stepwell {sw.__version__}; {about.title} ({about.platform}); CPU: {sw.isa()}, all cores\n")
    warnings.simplefilter("ignore", sw.AccuracyWarning)
    for dtype in ("float64", "float32"):
        limits = peak(machine, dtype == "float32"), bandwidth(machine)
        print(f"{dtype}: sums and products alone reach {limits[0] / 1e9:.0f}·10⁹ a second, copies {limits[1] / 1e9:.0f} GB/s\n")
        print(HEAD)
        for name in SYSTEMS:
            members = 1000
            while members <= arguments.most:
                print(measured(name, members, dtype, machine), flush=True)
                members *= 10
        print()
    print(f"Published, Lorenz in float32, {MEMBERS_OF_PUBLISHED} members to t = 1 on one Tesla V100 (not measured here):")
    for name, (fixed, own) in PUBLISHED.items():
        step = 1e9 * fixed / (MEMBERS_OF_PUBLISHED * STEPS_OF_PUBLISHED)
        more = "" if own is None else f"; by adaptive steps {1e3 * own:.0f} ms"
        print(f"  {name}: {1e3 * fixed:.0f} ms for {STEPS_OF_PUBLISHED} steps, {step:.2g} ns a member-step{more}")


if __name__ == "__main__":
    main()
