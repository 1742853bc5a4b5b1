"""Builds the wheels that are released, on Linux or macOS: ``python .ci/build_wheels.py [NAME...]``; `make wheels` runs it.

zig links for every system: for a glibc of 2014, for musl, for macOS without Apple's files and for Windows without Microsoft's.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "dist" / "wheels"


@dataclass(frozen=True)
class Wheel:
    """A wheel: what Rust calls its machine, and what its name says of Python and of the machine."""

    target: str
    platform: str
    python: str = "cp311-abi3"

    @property
    def ending(self) -> str:
        """How its file is called, after name and version."""
        return f"-{self.python}-{self.platform}.whl"


#: One wheel serves every Python from 3.11 on. A Python without GIL has no stable interface before 3.15, and so has its own.
WHEELS = {
    "linux-x86_64": Wheel("x86_64-unknown-linux-gnu", "manylinux2014_x86_64.manylinux_2_17_x86_64"),
    "linux-aarch64": Wheel("aarch64-unknown-linux-gnu", "manylinux2014_aarch64.manylinux_2_17_aarch64"),
    "musl-x86_64": Wheel("x86_64-unknown-linux-musl", "musllinux_1_2_x86_64"),
    "musl-aarch64": Wheel("aarch64-unknown-linux-musl", "musllinux_1_2_aarch64"),
    "macos-x86_64": Wheel("x86_64-apple-darwin", "macosx_10_12_x86_64"),
    "macos-arm64": Wheel("aarch64-apple-darwin", "macosx_11_0_arm64"),
    "windows-x86_64": Wheel("x86_64-pc-windows-gnullvm", "win_amd64"),
    "windows-arm64": Wheel("aarch64-pc-windows-gnullvm", "win_arm64"),
    "linux-x86_64-3.14t": Wheel("x86_64-unknown-linux-gnu", "manylinux2014_x86_64.manylinux_2_17_x86_64", "cp314-cp314t"),
    "linux-aarch64-3.14t": Wheel("aarch64-unknown-linux-gnu", "manylinux2014_aarch64.manylinux_2_17_aarch64", "cp314-cp314t"),
}


def build(wheel: Wheel) -> Path:
    """Builds one; returns its file."""
    command = [
        "maturin",
        "build",
        "--profile=wheel",
        "--locked",
        "--quiet",
        "--zig",
        f"--target={wheel.target}",
        f"--out={FOLDER}",
    ]
    if wheel.python.endswith("t"):
        command.append(f"--interpreter=python3.{wheel.python.removesuffix('t')[-2:]}t")
    # maturin asks for zig as a module of the Python that it finds first.
    environment = os.environ | {"PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}
    if "windows" in wheel.target:
        linker = f"CARGO_TARGET_{wheel.target.upper().replace('-', '_')}_LINKER"
        environment[linker] = str(ROOT / ".ci" / "zig-windows")
    done = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    files = list(FOLDER.glob(f"*{wheel.ending}"))
    if done.returncode or len(files) != 1:
        names = ", ".join(sorted(file.name for file in FOLDER.glob("*.whl")))
        sys.exit(f"{done.stdout}no wheel that ends with {wheel.ending}; there is: {names or 'none'}")
    return files[0]


def main() -> None:
    """Builds those that are named, or all; says how long each took and how large it is."""
    unknown = [name for name in sys.argv[1:] if name not in WHEELS]
    if unknown:
        sys.exit(f"{', '.join(unknown)}: the wheels are {', '.join(WHEELS)}")
    if not shutil.which("rustup"):
        sys.exit("the standard library of Rust for other machines comes by rustup: https://rustup.rs")
    wheels = [WHEELS[name] for name in sys.argv[1:] or WHEELS]
    subprocess.run(["rustup", "--quiet", "target", "add", *sorted({wheel.target for wheel in wheels})], check=True)
    # Of another version there may be some.
    for old in FOLDER.glob("*.whl"):
        if not sys.argv[1:] or any(old.name.endswith(wheel.ending) for wheel in wheels):
            old.unlink()
    began = time.monotonic()
    for wheel in wheels:
        start = time.monotonic()
        file = build(wheel)
        print(f"{file.name}: {file.stat().st_size / 1e3:.0f} kB, {time.monotonic() - start:.0f} s", flush=True)
    print(f"{len(wheels)} wheels in {time.monotonic() - began:.0f} s: {FOLDER}")


if __name__ == "__main__":
    main()
