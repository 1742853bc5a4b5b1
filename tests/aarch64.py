"""The tests of a wheel for AArch64, under an emulator: ``python tests/aarch64.py FOLDER WHEEL TESTS``.

Everything is put into the folder: Python for AArch64, from Debian, without a change to this system and without root; NumPy and
pytest for AArch64, from the package index; and the wheel. Programs that a test would start are not emulated, so that the tests
are those that start none.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: What the tests import.
NEEDS = ("numpy", "pytest", "hypothesis")
#: What must be under test.
USED = """
import platform, stepwell as sw
print(platform.machine(), sw.__file__, *sw.isa_levels())
assert sw.isa_levels() == ["interpret", "neon"]
"""
TAGS = ("manylinux2014_aarch64", "manylinux_2_28_aarch64", "linux_aarch64")


def unpack_python(folder: Path) -> Path:
    """Debian's Python for AArch64 and what it needs, as files below a folder of their own. Returns that folder."""
    system, state = folder / "system", folder / "apt"
    if system.exists():
        return system
    for name in ("lists/partial", "archives/partial"):
        (state / name).mkdir(parents=True, exist_ok=True)
    (state / "status").touch()
    options = {
        "APT::Architecture": "arm64",
        "APT::Architectures": "arm64",
        "APT::Sandbox::User": "",
        "Debug::NoLocking": "1",
        "Dir::State": state,
        "Dir::State::status": state / "status",
        "Dir::Cache": state,
    }
    apt = ["apt-get", "-qq", *(f"-o{name}={value}" for name, value in options.items())]
    subprocess.run([*apt, "update"], check=True)
    needs = ["python3", "libstdc++6"]
    subprocess.run([*apt, "install", "--yes", "--no-install-recommends", "--download-only", *needs], check=True)
    whole = folder / "unpacked"
    for package in sorted((state / "archives").glob("*.deb")):
        subprocess.run(["dpkg", "-x", package, whole], check=True)
    shutil.rmtree(state)
    return whole.rename(system)


def python_of(system: Path) -> list[str]:
    """How its Python is started, without the arguments."""
    return ["qemu-aarch64", "-L", str(system), str((system / "usr/bin/python3").resolve())]


def install(folder: Path, wheel: Path, version: str) -> Path:
    """NumPy, pytest and the wheel. Returns the folder from which they are imported."""
    packages = folder / "packages"
    shutil.rmtree(packages, ignore_errors=True)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary=:all:"]
    of = [f"--python-version={version}", *(f"--platform={tag}" for tag in TAGS), f"--target={packages}"]
    pinned = f"--constraint={ROOT / '.ci/constraints.txt'}"
    subprocess.run([*pip, pinned, *of, *NEEDS, wheel], check=True)
    return packages


def main() -> int:
    """Returns the exit status of the tests."""
    folder, wheel, *tests = sys.argv[1:]
    place = Path(folder).resolve()
    python = python_of(unpack_python(place))
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "STEPWELL", "VIRTUAL_ENV"))}
    # Python for AArch64 is found by its own prefix.
    own |= {"PYTHONHOME": str(place / "system/usr"), "PYTHONDONTWRITEBYTECODE": "1"}
    say = "import sys; print('{}.{}'.format(*sys.version_info))"
    version = subprocess.run([*python, "-c", say], env=own, check=True, capture_output=True, text=True).stdout.strip()
    own["PYTHONPATH"] = str(install(place, Path(wheel), version))
    subprocess.run([*python, "-c", USED], env=own, check=True)
    return subprocess.run(
        [*python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests], env=own, cwd=ROOT, check=False
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
