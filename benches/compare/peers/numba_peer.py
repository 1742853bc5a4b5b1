"""numba, one thread, in its best configuration: fast-math, NumPy's error model, blocks of members in L1, and several
steps of each member at once, which saves loads and stores. The fastest of several shapes counts."""

from __future__ import annotations

import functools
import math
import time
from itertools import product

import numpy as np

from .. import unrolled
from ..workloads import w2_pendulums
from . import Contestant, MissingPeerError, Ready, Workload, fastest, threads


def module():
    """numba, if there."""
    try:
        import numba
    except ImportError:
        raise MissingPeerError("numba is not installed") from None
    return numba


def njit(function, **more):
    """Compiled when first called."""
    return module().njit(fastmath=True, error_model="numpy", **more)(function)


def polynomial_sine(x):
    """Sine without a branch, as stepwell's; but rounded by floor, because fast-math would undo the magic constant."""
    n = math.floor(x * 0.3183098861837907 + 0.5)
    r = (x - n * 3.1415926534682512) - n * 1.2154201013012384e-10
    z = r * r
    w = z * z
    odd = 0.008333333333333196 + w * (2.75573192107121e-6 + w * (1.6058937294753282e-10 + w * 2.7205082501769597e-15))
    even = -0.00019841269841207676 + w * (-2.505210682744121e-8 + w * -7.64292781535996e-13)
    s = r + (r * z) * (-0.16666666666666666 + z * (odd + z * even))
    return s if np.int64(n) & 1 == 0 else -s


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


def pendulums_standard_heun(lanes: int, together: int, sine: str = "polynomial"):
    """A kernel of this shape and this sine; the drive is the same for all members, so its sine is taken once in a step."""
    sin = math.sin if sine == "libm" else njit(polynomial_sine, inline="always")
    frequency, damping = w2_pendulums.FREQUENCY, w2_pendulums.DAMPING

    def run(h, steps, v0, y0, amplitude):
        n, drag = v0.size, 2.0 * damping * h
        v_out, y_out = np.empty(n), np.empty(n)
        v, y, force = np.empty(lanes), np.empty(lanes), np.empty(lanes)
        for b in range(0, n, lanes):
            for i in range(lanes):
                m = min(b + i, n - 1)
                v[i], y[i], force[i] = v0[m], y0[m], h * amplitude[m]
            for k in range(steps):
                now, later = math.sin(frequency * (k * h)), math.sin(frequency * (k * h + h))
                for i in range(lanes):
                    vi, yi, fi = v[i], y[i], force[i]
                    dv1 = fi * now - h * sin(yi) - drag * vi
                    v1 = vi + dv1
                    dv2 = fi * later - h * sin(yi + h * vi) - drag * v1
                    v[i] = vi + 0.5 * (dv1 + dv2)
                    y[i] = yi + 0.5 * (h * vi + h * v1)
            for i in range(min(lanes, n - b)):
                v_out[b + i], y_out[b + i] = v[i], y[i]
        return v_out, y_out

    return njit(run)


def pendulums_rk4(lanes: int, together: int, sine: str = "polynomial"):
    """Likewise."""
    sin = math.sin if sine == "libm" else njit(polynomial_sine, inline="always")
    frequency, damping = w2_pendulums.FREQUENCY, w2_pendulums.DAMPING

    def run(h, steps, v0, y0, amplitude):
        n, drag = v0.size, 2.0 * damping * h
        v_out, y_out = np.empty(n), np.empty(n)
        v, y, force = np.empty(lanes), np.empty(lanes), np.empty(lanes)
        for b in range(0, n, lanes):
            for i in range(lanes):
                m = min(b + i, n - 1)
                v[i], y[i], force[i] = v0[m], y0[m], h * amplitude[m]
            for k in range(steps):
                t = k * h
                now, half, later = math.sin(frequency * t), math.sin(frequency * (t + 0.5 * h)), math.sin(frequency * (t + h))
                for i in range(lanes):
                    vi, yi, fi = v[i], y[i], force[i]
                    dv1 = fi * now - h * sin(yi) - drag * vi
                    v2 = vi + 0.5 * dv1
                    dv2 = fi * half - h * sin(yi + 0.5 * h * vi) - drag * v2
                    v3 = vi + 0.5 * dv2
                    dv3 = fi * half - h * sin(yi + 0.5 * h * v2) - drag * v3
                    v4 = vi + dv3
                    dv4 = fi * later - h * sin(yi + h * v3) - drag * v4
                    v[i] = vi + (dv1 + 2.0 * (dv2 + dv3) + dv4) / 6.0
                    y[i] = yi + h * (vi + 2.0 * (v2 + v3) + v4) / 6.0
            for i in range(min(lanes, n - b)):
                v_out[b + i], y_out[b + i] = v[i], y[i]
        return v_out, y_out

    return njit(run)


def few_bodies(bodies: int, dim: int, method: str, lanes: int):
    """Members side by side, or one by one."""
    given = {"sqrt": math.sqrt, "empty": np.empty}
    if lanes == 1:
        return njit(unrolled.one_by_one(bodies, dim, method, given))
    return njit(unrolled.side_by_side(bodies, dim, method, lanes, given))


def each_pair_once(bodies: int, workers: int):
    """Adds w·a to v; every thread has sums of its own, and every so manyth body."""
    prange = module().prange

    def kick(w, v, y, m, e):
        part = np.zeros((workers, 3, bodies))
        for t in prange(workers):
            ax, ay, az, x, y_, z = part[t, 0], part[t, 1], part[t, 2], y[0], y[1], y[2]
            for i in range(t, bodies, workers):
                xi, yi, zi, mi = x[i], y_[i], z[i], m[i]
                sx = sy = sz = 0.0
                for j in range(i + 1, bodies):
                    dx, dy, dz = x[j] - xi, y_[j] - yi, z[j] - zi
                    r = dx * dx + dy * dy + dz * dz + e
                    f = 1.0 / (r * math.sqrt(r))
                    to, back = f * m[j], f * mi
                    sx += to * dx
                    sy += to * dy
                    sz += to * dz
                    ax[j] -= back * dx
                    ay[j] -= back * dy
                    az[j] -= back * dz
                ax[i] += sx
                ay[i] += sy
                az[i] += sz
        for c in range(3):
            for i in range(bodies):
                for t in range(workers):
                    v[c, i] += w * part[t, c, i]

    return kick


def all_directed_pairs(bodies: int, workers: int):
    """Adds w·a to v; a body does not pull itself, as its distance is 0."""
    prange = module().prange

    def kick(w, v, y, m, e):
        x, y_, z = y[0], y[1], y[2]
        for i in prange(bodies):
            xi, yi, zi = x[i], y_[i], z[i]
            sx = sy = sz = 0.0
            for j in range(bodies):
                dx, dy, dz = x[j] - xi, y_[j] - yi, z[j] - zi
                r = dx * dx + dy * dy + dz * dz + e
                f = m[j] / (r * math.sqrt(r))
                sx += f * dx
                sy += f * dy
                sz += f * dz
            v[0, i] += w * sx
            v[1, i] += w * sy
            v[2, i] += w * sz

    return kick


def cluster(bodies: int, form: str, workers: int):
    """One large system in space by leapfrog."""
    compile_ = functools.partial(njit, parallel=True) if workers > 1 else njit
    kick = compile_((each_pair_once if form == "once" else all_directed_pairs)(bodies, workers))

    def run(h, steps, v_in, y_in, masses, softening):
        v, y, m = np.empty((3, bodies)), np.empty((3, bodies)), h * masses[:, 0]
        e = softening[0] * softening[0]
        for i in range(bodies):
            for c in range(3):
                v[c, i], y[c, i] = v_in[i, c, 0], y_in[i, c, 0]
        kick(0.5, v, y, m, e)
        for step in range(steps):
            for c in range(3):
                for i in range(bodies):
                    y[c, i] += h * v[c, i]
            kick(0.5 if step == steps - 1 else 1.0, v, y, m, e)
        return v.T.copy(), y.T.copy()

    return njit(run)


@functools.cache
def compiled(kernel, shape, axes):
    """A kernel for arrays of so many axes, and the seconds that it took to compile."""
    numba, run = module(), kernel(*shape)
    start = time.perf_counter()
    run.compile((numba.float64, numba.int64, *(numba.types.Array(numba.float64, n, "C") for n in axes)))
    return run, time.perf_counter() - start


def best(kernel, shapes, told, more=lambda work: 0):
    """The fastest of the shapes that ``shapes`` finds for the work: what the kernel takes, and ``told`` puts into words."""

    def make(shape, work: Workload) -> Ready:
        rows = [np.ascontiguousarray(row) for row in work.data.values()]
        run, seconds = compiled(kernel, shape, tuple(row.ndim for row in rows))
        return Ready(lambda: run(work.dt, work.steps, *rows), f"{told(shape)}; JIT {seconds:.1f} s", more(work))

    def ready(work: Workload, quick: bool) -> Ready:
        return fastest([functools.partial(make, shape) for shape in shapes(work, quick)], work, quick)

    return ready


def oscillators(kernel, *shapes):
    """Of these, (members, steps) at once and what else the kernel takes, those that fit."""

    def fit(work: Workload, quick: bool):
        found = [s for s in shapes if (s[0] == 1) == (work.members == 1) and work.steps % s[1] == 0]
        return found[:1] if quick else found

    def told(shape) -> str:
        return "block {} × {} steps".format(*shape) + "".join(f", {sine} sine" for sine in shape[2:])

    return best(kernel, fit, told)


def lanes(work: Workload, quick: bool):
    """Members at once."""
    found = (1,) if work.members == 1 else (64,) if quick else (8, 16, 32, 64, 128)
    return [(work.bodies, work.dim, work.method, each) for each in found]


def forms(work: Workload, quick: bool):
    """Each pair once, or all directed pairs."""
    return [(work.bodies, form, threads() if work.family == "shared_cluster" else 1) for form in ("once", "all")]


PENDULUMS = list(product((16, 64, 128), (1,), ("polynomial",)))
BODIES = best(few_bodies, lanes, lambda shape: f"block {shape[3]}", lambda work: int(work.method == "leapfrog"))
CLUSTER = best(cluster, forms, lambda shape: f"{shape[1]}" + f", threads {shape[2]}" * (shape[2] > 1), lambda work: 1)
KERNELS = {
    "free_false_euler": oscillators(free_false_euler, *product((64, 128, 256, 512), (8, 4, 1)), *product((1,), (8, 64, 1))),
    "forced_standard_heun": oscillators(
        forced_standard_heun,
        *product((64, 128, 512), (1, 2), ("polynomial",)),
        (64, 1, "libm"),
        *product((1,), (1, 8), ("polynomial", "libm")),
    ),
    "pendulums_standard_heun": oscillators(pendulums_standard_heun, *PENDULUMS),
    "pendulums_rk4": oscillators(pendulums_rk4, *PENDULUMS),
    "bodies_false_euler": BODIES,
    "bodies_leapfrog": BODIES,
    "cluster_leapfrog": CLUSTER,
    "shared_cluster_leapfrog": CLUSTER,
}
#: As its users write it, with the sine of ``math``.
PLAIN = {
    "pendulums_standard_heun": oscillators(pendulums_standard_heun, (64, 1, "libm")),
    "pendulums_rk4": oscillators(pendulums_rk4, (64, 1, "libm")),
}
CONTESTANTS = [Contestant("numba", KERNELS), Contestant("numba, math.sin", PLAIN)]
