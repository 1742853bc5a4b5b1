"""Ensembles on the devices of this machine beside its CPU: ``python -m benches.devices [--most MEMBERS] [--device NAME]``.

For each system and number of members: member-steps a second on the device and on all cores of the CPU (steps alone, the least of
some calls in turn; both have the same bits, which is checked), the share of the device's arithmetic that this is (operations of a
step × member-steps over what a kernel of sums and products in registers reaches), the time to compile, and what a call takes
beside the steps. The published figures are of others' machines and were not measured here.
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
from stepwell.device import device_of

STEPS, REPEATS = 1000, 3
#: Lorenz, float32, 8 388 608 members × 1000 steps of order 4 to 5, on one V100: ns of a member-step.
PUBLISHED = {"MPGOS": 94e-3, "DiffEqGPU": 145e-3, "JAX vmap": 10.0}
SIZE_OF_PUBLISHED = 8_388_608 * 1000

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


HEAD = """\
| system | members | 10⁹ member-steps a second | ns | of the arithmetic | CPU, 10⁹ a second | ÷ CPU | compiled, s | a step, ms |
|---|---|---|---|---|---|---|---|---|"""


@sw.system(order=1)
def lorenz(t: Any, y: Any, *, rho: Any = 28.0) -> Any:
    """Lorenz's equations."""
    return np.array([10.0 * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])


@sw.system
def duffing(t: Any, v: Any, y: Any, *, beta: Any = 1.0) -> Any:
    """A driven and damped spring that stiffens."""
    return 0.3 * np.cos(1.2 * t) - 0.3 * v + y - beta * y * y * y


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


SYSTEMS: dict[str, Callable[[int], Any]] = {
    "Lorenz": of_lorenz, "Duffing, driven": of_duffing, "three bodies": of_three_bodies, "Hodgkin-Huxley": of_hodgkin_huxley,
}  # fmt: skip


def peak(machine: Any, single: bool) -> float:
    """Sums and products a second of the device, by a kernel that does nothing else."""
    program = machine.program(PEAK.replace("REAL", "float" if single else "double"))
    items, turns = 256 * 64 * machine.described.units, 2000
    x = machine.put(np.ones(items, np.float32 if single else np.float64))

    def call() -> None:
        program.kernel("peak")(machine.queue, (items,), None, x, np.int32(turns))
        machine.finish()

    return items * turns * 8 / least(call)


def least(call: Callable[[], Any]) -> float:
    """The least time of some calls."""
    took = []
    for _ in range(REPEATS + 1):
        begin = time.perf_counter()
        call()
        took.append(time.perf_counter() - begin)
    return min(took[1:])


def measured(name: str, members: int, dtype: str, machine: Any, of_peak: float) -> str:
    """A line of the table."""
    system, method, options = SYSTEMS[name](members)
    options |= {"dtype": dtype}
    run = partial(sw.integrate, system, method, **options)
    device = machine.described.name
    begin = time.perf_counter()
    run(steps=1, device=device)
    compiled = time.perf_counter() - begin
    steps = max(10, min(STEPS, 200_000_000 // members)) if machine.is_cpu else STEPS
    got, core = run(steps=steps, device=device), run(steps=steps, device="cpu")
    assert np.array_equal(got.y, core.y, equal_nan=True)
    one = [least(partial(run, steps=1, device=where)) for where in (device, "cpu")]
    whole = [least(partial(run, steps=steps, device=where)) for where in (device, "cpu")]
    on_device, on_cpu = (members * (steps - 1) / max(w - o, 1e-9) for w, o in zip(whole, one, strict=True))
    operations = sum(sw.explain(system, method, dtype=dtype).computed.values())
    share = on_device * operations / of_peak
    return (
        f"| {name} | {members:.0e} | {on_device / 1e9:.3g} | {1e9 / on_device:.3g} | {100 * share:.0f} % | {on_cpu / 1e9:.3g} | "
        f"{on_device / on_cpu:.2f} | {compiled:.2f} | {1e3 * one[0]:.2f} |"
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
        of_peak = peak(machine, dtype == "float32")
        print(f"{dtype}: sums and products alone reach {of_peak / 1e9:.0f} thousand million a second\n")
        print(HEAD)
        for name in SYSTEMS:
            members = 1000
            while members <= arguments.most:
                print(measured(name, members, dtype, machine, of_peak), flush=True)
                members *= 10
        print()
    each = ", ".join(f"{name} {1e9 * took / SIZE_OF_PUBLISHED:.2g}" for name, took in PUBLISHED.items())
    print(f"Published, Lorenz in float32, 8 388 608 members, on one V100, ns of a member-step (not measured here): {each}")


if __name__ == "__main__":
    main()
