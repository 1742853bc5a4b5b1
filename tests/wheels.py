"""Whether the wheels in a folder are what they should be: ``python tests/wheels.py dist/wheels``. They are read, not run.

All that are released must be there, unless some are named: ``python tests/wheels.py dist/wheels linux-x86_64 ...``.
"""

from __future__ import annotations

import json
import sys
import tomllib
import zipfile
from email import message_from_string
from pathlib import Path

from support.binaries import read

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / ".ci"))
from build_wheels import WHEELS, Wheel  # noqa: E402

VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["version"]
#: How long a wheel may be, in bytes: a tenth above the longest.
LENGTH = 3_600_000
#: The name of the compiled core. Where one serves several versions of Python, it says so, or nothing on Windows.
CORES = {"linux": "_core.{}.so", "macos": "_core.abi3.so", "windows": "_core.pyd"}
#: What a core may load: what every system has. musl is libc.so.
NEEDS = {
    "linux": {
        "libc.so",
        "libc.so.6",
        "libm.so.6",
        "libpthread.so.0",
        "libdl.so.2",
        "ld-linux-x86-64.so.2",
        "ld-linux-aarch64.so.1",
    },
    "macos": {"/usr/lib/libSystem.B.dylib", "/usr/lib/libiconv.2.dylib", "/usr/lib/libcharset.1.dylib"},
    "windows": {"python3.dll", "kernel32.dll", "ntdll.dll", "bcryptprimitives.dll"},
}


def system(wheel: Wheel) -> str:
    """The operating system that it is for."""
    return "macos" if "apple" in wheel.target else "windows" if "windows" in wheel.target else "linux"


def core(wheel: Wheel) -> str:
    """Where its compiled core is."""
    machine, *_, libc = wheel.target.split("-")
    own = f"cpython-{wheel.python.removesuffix('t')[-3:]}t-{machine}-linux-{libc}"
    return "stepwell/" + CORES[system(wheel)].format(own if wheel.python.endswith("t") else "abi3")


def check(file: Path, wheel: Wheel) -> None:
    """Fails unless its name, its files and its core are those of that wheel."""
    with zipfile.ZipFile(file) as files:
        names = set(files.namelist())
        notes = f"stepwell-{VERSION}.dist-info"
        metadata = message_from_string(files.read(f"{notes}/METADATA").decode("utf-8"))
        tags = message_from_string(files.read(f"{notes}/WHEEL").decode("utf-8")).get_all("Tag") or []
        bill = json.loads(files.read(f"{notes}/sboms/stepwell-py.cyclonedx.json"))
        library = read(files.read(core(wheel)))
    assert set(tags) == {f"{wheel.python}-{platform}" for platform in wheel.platform.split(".")}, tags
    assert metadata["Version"] == VERSION
    assert set(metadata.get_all("License-File") or ()) == {"LICENSE", "THIRD-PARTY.txt"}
    assert {f"{notes}/licenses/LICENSE", f"{notes}/licenses/THIRD-PARTY.txt", "stepwell/py.typed"} <= names
    assert {"nalgebra", "pyo3"} <= {part["name"] for part in bill["components"]}
    assert len([name for name in names if "_core." in name and not name.endswith(".pyi")]) == 1, names
    assert library.system == system(wheel), library
    assert library.machine == wheel.target.split("-")[0].replace("aarch64", "arm64"), library
    # zig does not read the list of what is exported for macOS: there link-time optimisation leaves a few names more.
    # On Windows two functions take the place of MinGW's, and so have their names: rust/base/src/fused.rs.
    most = {"linux": 1, "macos": 20, "windows": 3}[library.system]
    assert "PyInit__core" in library.exports
    assert len(library.exports) <= most, sorted(library.exports)[:20]
    assert library.system != "windows" or library.exports <= {"PyInit__core", "fma", "fmaf"}, library.exports
    strangers = {name for name in library.needs - NEEDS[library.system] if not name.startswith("api-ms-win-")}
    assert not strangers, strangers
    if library.system == "windows":
        assert "python3.dll" in library.needs, library.needs
    if "manylinux2014" in wheel.platform:
        assert library.minimum <= (2, 17), library.minimum
    if "macosx" in wheel.platform:
        assert library.minimum == tuple(map(int, wheel.platform.split("_")[1:3])), library.minimum
    assert file.stat().st_size <= LENGTH, file.stat().st_size


def main() -> None:
    """Checks each."""
    folder, *names = sys.argv[1:]
    files = set(Path(folder).glob("*.whl"))
    for wheel in (WHEELS[name] for name in names or WHEELS):
        file = Path(folder, f"stepwell-{VERSION}{wheel.ending}")
        if file not in files:
            sys.exit(f"{file} is not there; {', '.join(sorted(each.name for each in files)) or 'nothing'} is")
        check(file, wheel)
        files.remove(file)
        print(f"{file.name}: {file.stat().st_size / 1e3:.0f} kB, as it should be")
    if files:
        sys.exit(f"of no use: {', '.join(sorted(each.name for each in files))}")


if __name__ == "__main__":
    main()
