"""numba, one thread, in its best configuration: fast-math, NumPy's error model, blocks of members in L1, and several
steps of each member at once, which saves loads and stores. The fastest of several shapes counts."""

from __future__ import annotations

import functools
import math
import time
from itertools import product

import numpy as np

from . import Contestant, MissingPeerError, Ready, Workload, fastest


def njit(function, **more):
    """Compiled when first called."""
    try:
        import numba
    except ImportError:
        raise MissingPeerError("numba is not installed") from None
    return numba.njit(fastmath=True, error_model="numpy", **more)(function)


def polynomial_sine(x):
    """Sine without a branch, as stepwell's; but rounded by floor, because fast-math would undo the magic constant."""
    n = math.floor(x * 0.636619772367581343 + 0.5)
    quadrant = np.int64(n)
    r = ((x - n * 1.5707963267341256) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21
    z = r * r
    s = 2.75573137070700676789e-6 + z * (-2.50507602534068634195e-8 + z * 1.58969099521155010221e-10)
    s = r + (r * z) * (-1.66666666666666324348e-1 + z * (8.33333333332248946124e-3 + z * (-1.98412698298579493134e-4 + z * s)))
    c = -2.75573143513906633035e-7 + z * (2.08757232129817482790e-9 + z * -1.13596475577881948265e-11)
    c = 4.16666666666666019037e-2 + z * (-1.38888888888741095749e-3 + z * (2.48015872894767294178e-5 + z * c))
    a = s if quadrant & 1 == 0 else (1.0 - 0.5 * z) + (z * z) * c
    return a if quadrant & 2 == 0 else -a


def free_false_euler(lanes: int, together: int):
    """A kernel of this shape."""

    def run(h, steps, v0, y0, omega):
        n = v0.size
        v_out, y_out = np.empty(n), np.empty(n)
        v, y, w = np.empty(lanes), np.empty(lanes), np.empty(lanes)
        for b in range(0, n, lanes):
            for i in range(lanes):
                m = min(b + i, n - 1)
                v[i], y[i], w[i] = v0[m], y0[m], h * omega[m]
            for _ in range(0, steps, together):
                for i in range(lanes):
                    vi, yi, wi = v[i], y[i], w[i]
                    for _ in range(together):
                        vi -= wi * yi
                        yi += wi * vi
                    v[i], y[i] = vi, yi
            for i in range(min(lanes, n - b)):
                v_out[b + i], y_out[b + i] = v[i], y[i]
        return v_out, y_out

    return njit(run)


def forced_standard_heun(lanes: int, together: int, sine: str = "polynomial"):
    """A kernel of this shape and this sine; the step is written in the loop, because a call there costs the vectors."""
    sin = math.sin if sine == "libm" else njit(polynomial_sine, inline="always")

    def run(h, steps, v0, y0, omega, damping, amplitude, frequency, phase):
        n = v0.size
        v_out, y_out = np.empty(n), np.empty(n)
        v, y, w, drag = np.empty(lanes), np.empty(lanes), np.empty(lanes), np.empty(lanes)
        force, f, p = np.empty(lanes), np.empty(lanes), np.empty(lanes)
        for b in range(0, n, lanes):
            for i in range(lanes):
                m = min(b + i, n - 1)
                v[i], y[i], w[i], drag[i] = v0[m], y0[m], h * omega[m], 2.0 * damping[m] * h * omega[m]
                force[i], f[i], p[i] = h / omega[m] * amplitude[m], frequency[m], phase[m]
            for k in range(0, steps, together):
                for i in range(lanes):
                    vi, yi, wi, di, ai, fi, pi = v[i], y[i], w[i], drag[i], force[i], f[i], p[i]
                    for j in range(together):
                        t = (k + j) * h
                        dv1 = ai * sin(fi * t + pi) - wi * yi - di * vi
                        dy1 = wi * vi
                        v1 = vi + dv1
                        y1 = yi + dy1
                        dv2 = ai * sin(fi * (t + h) + pi) - wi * y1 - di * v1
                        vi += 0.5 * (dv1 + dv2)
                        yi += 0.5 * (dy1 + wi * v1)
                    v[i], y[i] = vi, yi
            for i in range(min(lanes, n - b)):
                v_out[b + i], y_out[b + i] = v[i], y[i]
        return v_out, y_out

    return njit(run)


@functools.cache
def compiled(kernel, shape):
    """A kernel, and the seconds that it took to compile."""
    run = kernel(*shape)
    rows = [np.ones(1)] * (run.py_func.__code__.co_argcount - 2)
    start = time.perf_counter()
    run(0.01, 1, *rows)
    return run, time.perf_counter() - start


def best(kernel, *shapes):
    """The fastest of the shapes: (members, steps) at once, and what else the kernel takes."""

    def make(shape, work: Workload) -> Ready:
        run, seconds = compiled(kernel, shape)
        rows = [np.ascontiguousarray(row) for row in work.data.values()]
        note = "block {} × {} steps".format(*shape) + "".join(f", {sine} sine" for sine in shape[2:])
        return Ready(lambda: run(work.dt, work.steps, *rows), f"{note}; JIT {seconds:.1f} s")

    def ready(work: Workload, quick: bool) -> Ready:
        fit = [s for s in shapes if (s[0] == 1) == (work.members == 1) and work.steps % s[1] == 0]
        return fastest([functools.partial(make, shape) for shape in (fit[:1] if quick else fit)], work)

    return ready


KERNELS = {
    "free_false_euler": best(free_false_euler, *product((64, 128, 256, 512), (8, 4, 1)), *product((1,), (8, 64, 1))),
    "forced_standard_heun": best(
        forced_standard_heun,
        *product((64, 128, 512), (1, 2), ("polynomial",)),
        (64, 1, "libm"),
        *product((1,), (1, 8), ("polynomial", "libm")),
    ),
}
CONTESTANTS = [Contestant("numba", KERNELS)]
