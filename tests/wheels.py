"""Whether the wheels in a folder are what they should be: ``python tests/wheels.py dist/wheels``.

The one for this machine is installed into a fresh environment, with NumPy from the package index and nothing else, and is used.
Of all it is checked that their library is for the machine that their name says.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

#: The machine of an ELF file, the number of 16 bits at byte 18.
ELF = {"x86_64": 62, "aarch64": 183}

USE = """
import os
import numpy as np
import stepwell as sw

assert "site-packages" in sw.__file__, sw.__file__
system = sw.Pendulum(np.linspace(0.5, 1.5, 200))
state = dict(v=0.0, y=1.0, dt=0.01, steps=2000, threads=1)
want = sw.integrate(system, "rk4", **state, backend="numpy")
levels = ["interpret", *sw.isa_levels()[1:]]
for kernels in levels:
    os.environ["STEPWELL_KERNELS"] = kernels
    run = sw.integrate(system, "rk4", **state)
    assert np.array_equal(run.v, want.v) and np.array_equal(run.y, want.y), kernels
print("the bits of the reference:", ", ".join(levels))
"""


def machine(wheel: Path) -> str:
    """What the name of a wheel says it is for."""
    return next(name for name in ELF if wheel.stem.endswith(name))


def check_library(wheel: Path) -> None:
    """Fails unless its library is for the machine of its name and can be imported as ``_core``."""
    with zipfile.ZipFile(wheel) as files:
        library = files.read("stepwell/_core.abi3.so")
    number = int.from_bytes(library[18:20], "little")
    assert library[:4] == b"\x7fELF", wheel
    assert number == ELF[machine(wheel)], (wheel, number)
    assert b"PyInit__core" in library, wheel
    assert "manylinux2014" in wheel.name, f"{wheel.name} asks for a newer system than it should"
    print(f"{wheel.name}: a library for {machine(wheel)}, {len(library) / 1e6:.1f} MB")


def use(wheel: Path) -> None:
    """Installs and uses it in an environment of its own."""
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "STEPWELL", "VIRTUAL_ENV"))}
    with tempfile.TemporaryDirectory() as folder:
        python = Path(folder, "clean", "bin", "python")
        subprocess.run([sys.executable, "-m", "venv", python.parent.parent], check=True, env=own)
        subprocess.run(
            [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel.resolve()], check=True, env=own
        )
        subprocess.run([python, "-c", USE], check=True, env=own, cwd=folder)
        subprocess.run([python.with_name("stepwell"), "--help"], check=True, env=own, cwd=folder, stdout=subprocess.DEVNULL)


def main() -> None:
    """Checks all, uses this machine's."""
    wheels = sorted(Path(sys.argv[1]).glob("*.whl"))
    here = [wheel for wheel in wheels if machine(wheel) == platform.machine()]
    assert here, f"no wheel for {platform.machine()} in {sys.argv[1]}"
    for wheel in wheels:
        check_library(wheel)
    for wheel in here:
        use(wheel)


if __name__ == "__main__":
    main()
