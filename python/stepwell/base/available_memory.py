"""How much memory this process may still use."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator


def in_bytes(n: float) -> str:
    """A number of bytes for a message."""
    return f"{n / 2**30:.3g} GiB" if n >= 2**30 else f"{n / 2**20:.3g} MiB"


def available_memory() -> tuple[float, str]:
    """How many bytes this process may still use, and what limits it: the machine, its control groups or its address space."""
    return min(_bounds(), default=(2.0**63, "nothing is known of this system's memory"))


def _bounds() -> Iterator[tuple[float, str]]:
    try:
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        if most != resource.RLIM_INFINITY:
            used = int(_read("/proc/self/statm").split()[0]) * resource.getpagesize()
            yield float(most - used), "limit of the address space, ulimit -v"
    except (ImportError, OSError, IndexError):  # not this kind of system
        pass
    try:
        yield 1024.0 * _fields("/proc/meminfo")["MemAvailable:"], "memory of this machine"
    except (OSError, KeyError):
        if sys.platform == "win32":
            yield _of_windows(), "memory of this machine"
        elif hasattr(os, "sysconf"):
            yield float(os.sysconf("SC_PAGE_SIZE")) * float(os.sysconf("SC_PHYS_PAGES")), "memory of this machine"
    for folder, names in _control_groups():
        try:
            most, used = (int(_read(f"{folder}/{name}")) for name in names)
        except (OSError, ValueError):  # there is no such group here, or "max", which is no limit
            continue
        try:
            fields = _fields(f"{folder}/memory.stat")
        except OSError:
            fields = {}
        # The page cache of inactive files is released when memory is needed.
        used -= fields.get("total_inactive_file", fields.get("inactive_file", 0))
        yield float(most - used), "memory limit of the control group"


def _of_windows() -> float:
    """The bytes that are free, in memory and in what may still be promised: Windows promises no page that has no place."""
    import ctypes

    # MEMORYSTATUSEX: its own length and the load in per cent, 32 bits each; then seven numbers of 64 bits, of which the second is
    # the free memory and the fourth what may still be promised.
    status = (ctypes.c_uint64 * 8)(64)
    if sys.platform == "win32":  # the types of other systems have no windll
        ctypes.windll.kernel32.GlobalMemoryStatusEx(status)
    return float(min(status[2], status[4]))


def _control_groups() -> Iterator[tuple[str, tuple[str, str]]]:
    """The folders of this process's control groups and of their parents, with the names of the files of limit and usage."""
    try:
        lines = _read("/proc/self/cgroup").splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        root, names = (
            ("/sys/fs/cgroup/memory", ("memory.limit_in_bytes", "memory.usage_in_bytes"))
            if controllers
            else ("/sys/fs/cgroup", ("memory.max", "memory.current"))
        )
        path = path.strip("/")
        while path:
            yield f"{root}/{path}", names
            path = path.rpartition("/")[0]
        yield root, names


def _read(path: str) -> str:
    with open(path) as file:
        return file.read()


def _fields(path: str) -> dict[str, int]:
    """A file of names and whole numbers, line by line."""
    return {line[0]: int(line[1]) for line in map(str.split, _read(path).splitlines()) if len(line) > 1}
