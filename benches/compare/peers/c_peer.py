"""C, compiled on the spot for this machine, the fastest of several forms; with FMA and more, and exact as stepwell is."""

from __future__ import annotations

import atexit
import ctypes
import functools
import os
import platform
import shutil
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..workloads import SINGLE_KIND
from . import Contestant, MissingPeerError, Ready, Workload, fastest, threads

OSCILLATORS, BODIES, SPRINGS = (Path(__file__).with_name(name) for name in ("kernels.c", "bodies.c", "springs.c"))
FLAGS = ["-O3", "-fno-math-errno", "-shared", "-fPIC"]
BLOCKS = (32, 64, 80, 96, 128)
FEW = (1, 8)  # for a member or a few
BODY_BLOCKS = (8, 16, 32)
EXACT = ("-ffp-contract=off",)
FAST = ("-ffast-math",)  # for bodies, where it is faster; it may also reorder

#: Kernels of float32.
SINGLE = "-DSINGLE"


def flags() -> list[str]:
    """Flags for this machine, or for the architecture that STEPWELL_BENCH_MARCH names."""
    march = f"-march={os.environ.get('STEPWELL_BENCH_MARCH', 'native')}"
    return [*FLAGS, march, *["-mprefer-vector-width=512"] * (platform.machine().lower() in ("x86_64", "amd64"))]


def compiler() -> str:
    """The C compiler."""
    found = shutil.which(os.environ.get("CC", "cc"))
    if found is None:
        raise MissingPeerError("no C compiler")
    return found


@functools.cache
def folder() -> Path:
    """Where libraries are put; removed when the run ends."""
    made = tempfile.mkdtemp(prefix="stepwell-bench-")
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return Path(made)


@functools.cache
def vectors_of_512() -> bool:
    """Whether these flags allow AVX-512, for the form that is written with it."""
    command = [compiler(), *flags(), "-dM", "-E", "-x", "c", "-"]
    return "__AVX512F__ " in subprocess.run(command, input="", capture_output=True, text=True).stdout


@functools.cache
def library(source: Path, *options: str) -> ctypes.CDLL:
    """The kernels of a file, compiled with these options."""
    out = folder() / (source.stem + "".join(options).replace("=", "") + ".so")
    compiled = out.with_suffix(".o")
    # Linked apart: a library linked with -ffast-math makes whoever loads it flush subnormal numbers to zero, us too.
    linked = [option for option in options if option == "-fopenmp"]
    for command in (
        [compiler(), *flags(), *options, "-c", str(source), "-o", str(compiled)],
        [compiler(), "-shared", *linked, str(compiled), "-o", str(out), "-lm"],
    ):
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise MissingPeerError(f"the C compiler failed: {done.stderr.strip().splitlines()[0]}")
    return ctypes.CDLL(str(out))


@dataclass(frozen=True)
class Form:
    """One of the ways to compile: the file, what the remarks say of it, and what they do not."""

    source: Path
    told: tuple[str, ...]
    options: tuple[str, ...]
    more: int = 0

    def made(self, work: Workload) -> Ready:
        """The workload by the function of that name."""
        defines = [f"-D{each.upper().replace(' ', '=')}" for each in self.told]
        function = getattr(library(self.source, *defines, *self.options), work.kind.removeprefix(SINGLE_KIND))
        function.restype = None
        dtype, number = (np.float32, ctypes.c_float) if SINGLE in self.options else (np.float64, ctypes.c_double)
        numbers = ctypes.POINTER(number)
        rows = [np.ascontiguousarray(row, dtype) for row in work.data.values()]
        pointers = (numbers * len(rows))(*(row.ctypes.data_as(numbers) for row in rows))

        def call():
            v, y = np.empty_like(rows[0]), np.empty_like(rows[1])
            out = v.ctypes.data_as(numbers), y.ctypes.data_as(numbers)
            function(ctypes.c_long(work.members), ctypes.c_long(work.steps), ctypes.c_double(work.dt), pointers, *out)
            return v, y

        return Ready(call, ", ".join(self.told), self.more)


def oscillators(work: Workload, quick: bool, exact: bool) -> list[Form]:
    """Block sizes; and two sines where there is one."""
    blocks = FEW if work.members == 1 else BLOCKS[1:3] if quick else BLOCKS
    told = [(f"block {block}",) for block in blocks] + [("block 1", "libm")] * ("forced" in work.kind)
    return [Form(OSCILLATORS, each, EXACT if exact else ()) for each in told]


def pendulums(work: Workload, quick: bool, exact: bool) -> list[Form]:
    """Block sizes; with the sine of the core, or the vector sine of the C library, for which the compiler wants fast-math."""
    told = [(f"block {block}",) for block in (BLOCKS[:1] if quick else (8, 16, *BLOCKS))]
    forms = [Form(OSCILLATORS, each, EXACT if exact else ()) for each in told]
    return forms + [Form(OSCILLATORS, (*each, "libm"), (*FAST, "-fopenmp-simd")) for each in told if not exact]


def body_blocks(quick: bool, exact: bool) -> list[tuple[str, ...]]:
    """Vectors side by side; with square root and division, or with an approximation that is made better."""
    blocks = [(f"block {block}",) for block in (BODY_BLOCKS[:1] if quick else BODY_BLOCKS)]
    return blocks + [(*each, "rsqrt") for each in blocks] * (not exact and vectors_of_512())


def bodies(work: Workload, quick: bool, exact: bool) -> list[Form]:
    """Members side by side; or the pairs of one member, if there are three."""
    told = body_blocks(quick, exact)
    if work.members == 1:
        told = [("block 1",)] + [("block 1", "packed")] * (work.bodies == 3)
    sizes = "-DFEW", f"-DBODIES={work.bodies}", f"-DDIM={work.dim}"
    hows = [EXACT] if exact else [FAST] if quick else [FAST, ()]
    return [Form(BODIES, each, (*sizes, *how), int(work.method == "leapfrog")) for each in told for how in hows]


def cluster(work: Workload, quick: bool, exact: bool) -> list[Form]:
    """Each pair once, or all directed pairs."""
    shared = work.family == "shared_cluster"
    told = [(form, *block) for form in ("once", "all") for block in body_blocks(quick, exact)]
    told += [("once", "block 8", "plain")] * (not exact)  # its sums are vectors only for a compiler that may reorder
    told = [(*each, f"threads {threads()}") for each in told] if shared else told
    options = f"-DBODIES={work.bodies}", f"-DDIM={work.dim}", *["-fopenmp"] * shared, *(EXACT if exact else FAST)
    return [Form(BODIES, each, options, 1) for each in told]


def cloth(work: Workload, quick: bool, exact: bool) -> list[Form]:
    """Forces added to both ends one after the other, or kept and summed particle by particle."""
    sizes = f"-DPARTICLES={len(work.data['v'])}", f"-DSPRINGS={len(work.data['pairs'])}"
    hows = [EXACT] if exact else [FAST, ()]
    return [Form(SPRINGS, (form,), (*sizes, *how)) for form in ("scatter", "kept") for how in hows]


def single(forms):
    """The same in float32."""

    def of_float32(work: Workload, quick: bool, exact: bool) -> list[Form]:
        found = [replace(form, options=(*form.options, SINGLE)) for form in forms(work, quick, exact)]
        # Blocks of as many numbers, and of as many vectors, which hold twice as many.
        longer = [replace(form, told=(twice(form.told[0]), *form.told[1:])) for form in found]
        return list(dict.fromkeys([*found, *longer]))

    def twice(block: str) -> str:
        return f"block {2 * int(block.removeprefix('block '))}"

    return of_float32


FORMS = {
    "free_false_euler": oscillators,
    "forced_standard_heun": oscillators,
    "pendulums_standard_heun": pendulums,
    "pendulums_rk4": pendulums,
    "bodies_false_euler": bodies,
    "bodies_leapfrog": bodies,
    "cluster_leapfrog": cluster,
    "shared_cluster_leapfrog": cluster,
    "cloth_leapfrog": cloth,
}
FORMS |= {SINGLE_KIND + kind: single(FORMS[kind]) for kind in ("free_false_euler", "pendulums_standard_heun", "pendulums_rk4")}


def contestant(name: str, exact: bool) -> Contestant:
    """C in its fastest form."""

    def ready(forms, work: Workload, quick: bool) -> Ready:
        return fastest([form.made for form in forms(work, quick, exact)], work, quick)

    return Contestant(name, {kind: functools.partial(ready, forms) for kind, forms in FORMS.items()})


CONTESTANTS = [contestant("C", exact=False), contestant("C, exact", exact=True)]
