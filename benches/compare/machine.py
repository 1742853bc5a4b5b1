"""The machine and the versions, as the report names them."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
import time
from pathlib import Path

import stepwell as sw

from .peers import MissingPeerError, c_peer, threads


def cpu() -> str:
    """The CPU's model."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    fields = [[part.strip() for part in line.split(":", 1)] for line in lines if ":" in line]
    first = dict(reversed(fields))
    if "model name" not in first:
        return platform.processor() or platform.machine()
    return f"{first['model name']} (family {first.get('cpu family', '?')}, model {first.get('model', '?')})"


def compiler() -> str:
    """The C compiler's own words, and the flags."""
    try:
        told = subprocess.run([c_peer.compiler(), "--version"], capture_output=True, text=True).stdout
    except MissingPeerError as why:
        return str(why)
    return f"{told.splitlines()[0]}, `{' '.join(c_peer.flags())}`"


#: What is told of with its version.
PACKAGES = ("stepwell", "numpy", "numba", "llvmlite", "rebound", "heyoka", "scipy", "jax", "diffrax")


def version(package: str) -> str:
    """A package with its version."""
    try:
        return f"{package} {importlib.metadata.version(package)}"
    except importlib.metadata.PackageNotFoundError:
        return f"no {package}"


def load() -> str:
    """How many processes want to run; other people's work disturbs, most of all the runs on several threads."""
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"


def describe() -> list[tuple[str, str]]:
    """What there is to know."""
    return [
        ("date", time.strftime("%Y-%m-%d")),
        ("CPU", f"{cpu()}, {threads()} cores"),
        ("system", f"{platform.system()} {platform.machine()}"),
        ("CPU level of stepwell", f"{sw.isa()} of {', '.join(sw.isa_levels())}"),
        ("Python", ", ".join([platform.python_version(), *map(version, PACKAGES)])),
        ("C", compiler()),
    ]
