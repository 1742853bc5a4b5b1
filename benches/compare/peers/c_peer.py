"""C, compiled on the spot for this machine, the fastest of several block sizes; with FMA, and exact as stepwell is."""

from __future__ import annotations

import atexit
import ctypes
import functools
import os
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from . import Contestant, MissingPeerError, Ready, Workload, fastest

SOURCE = Path(__file__).with_name("kernels.c")
FLAGS = ["-O3", "-fno-math-errno", "-shared", "-fPIC"]
BLOCKS = (32, 64, 80, 96, 128)
FEW = (1, 8)  # for a member or a few

numbers = ctypes.POINTER(ctypes.c_double)


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
def library(*options: str) -> ctypes.CDLL:
    """The kernels, compiled with these options."""
    out = folder() / ("kernels" + "".join(options).replace("=", "") + ".so")
    command = [compiler(), *flags(), *options, str(SOURCE), "-o", str(out), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise MissingPeerError(f"the C compiler failed: {done.stderr.strip().splitlines()[0]}")
    return ctypes.CDLL(str(out))


def made(options: tuple[str, ...], work: Workload) -> Ready:
    """The workload by the function of that name, in a library compiled with these options."""
    function = getattr(library(*options), work.kind)
    function.restype = None
    rows = [np.ascontiguousarray(row) for row in work.data.values()]
    pointers = (numbers * len(rows))(*(row.ctypes.data_as(numbers) for row in rows))

    def call():
        v, y = np.empty_like(rows[0]), np.empty_like(rows[1])
        out = v.ctypes.data_as(numbers), y.ctypes.data_as(numbers)
        function(ctypes.c_long(v.size), ctypes.c_long(work.steps), ctypes.c_double(work.dt), pointers, *out)
        return v, y

    defined = [o[2:].lower().replace("=", " ") for o in options if o.startswith("-D")]
    return Ready(call, ", ".join(defined))


def best(*options: str):
    """The fastest block size; of two sines where there is one."""

    def ready(work: Workload, quick: bool) -> Ready:
        blocks = FEW if work.members == 1 else BLOCKS[1:3] if quick else BLOCKS
        variants = [(f"-DBLOCK={block}", *options) for block in blocks]
        if "forced" in work.kind:
            variants.append(("-DBLOCK=1", "-DLIBM", *options))
        return fastest([functools.partial(made, variant) for variant in variants], work)

    return ready


def contestant(name: str, *options: str) -> Contestant:
    """C with these options."""
    return Contestant(name, {kind: best(*options) for kind in ("free_false_euler", "forced_standard_heun")})


CONTESTANTS = [contestant("C"), contestant("C, exact", "-ffp-contract=off")]
