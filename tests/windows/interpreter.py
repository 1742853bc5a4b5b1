"""Makes an interpreter for Windows, which Wine runs: ``python interpreter.py FOLDER CORE``.

In the folder are CPython, NumPy, what tests import, and this package with the core that was built for Windows. All of it comes
from the package index.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
#: What tests import. pip would leave colorama out, which pytest needs on Windows: it reads conditions as of this machine.
PACKAGES = ("numpy", "pytest", "hypothesis", "colorama", "mpmath", "rich", "matplotlib", "xarray", "zarr")
#: Compilers and readers of programs for Windows.
MINGW = "x86_64-w64-mingw32"
#: The C library as NumPy names it, and ours that stands before it.
LIBRARY, OWN = "api-ms-win-crt-math-l1-1-0.dll", "complex.dll"


def run(*words: object) -> str:
    """The output of a program that must succeed."""
    return subprocess.run([str(word) for word in words], check=True, stdout=subprocess.PIPE, text=True).stdout


def pip(*words: object) -> None:
    """Installs something that this machine cannot run."""
    run(sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--upgrade", *words)


def install(folder: Path) -> Path:
    """CPython in a folder, and packages; returns where packages are."""
    site = folder / "site-packages"
    pip("--no-deps", "--require-hashes", "--target", folder, "-r", HERE / "python.txt")
    (folder / "python311._pth").write_text("python311.zip\n.\nsite-packages\nimport site\n", encoding="utf-8")
    target = ("--platform", "win_amd64", "--python-version", "3.11", "--only-binary", ":all:")
    pip(*target, "--constraint", ROOT / ".ci" / "constraints.txt", "--target", site, *PACKAGES)
    return site


def imported(library: Path) -> set[str]:
    """The functions that a library takes from ``LIBRARY``."""
    names: dict[str, set[str]] = {}
    for line in run(f"{MINGW}-objdump", "-p", library).splitlines():
        if begin := re.search(r"DLL Name: (\S+)", line):
            latest = names.setdefault(begin[1], set())
        elif line.startswith("There is an export table"):
            break
        elif names and (name := re.fullmatch(r"\t[0-9a-f]+\t +\d+  (\S+)", line)):
            latest.add(name[1])
    return names.get(LIBRARY, set())


def complete(folder: Path, numpy: Path) -> None:
    """Gives NumPy a C library that has what the one of Wine lacks; all else in it is Wine's."""
    libraries = {path: names for path in numpy.rglob("*.pyd") if (names := imported(path))}
    compiled, listed = folder / "complex.o", folder / "complex.def"
    run(f"{MINGW}-gcc", "-O2", "-c", HERE / "complex.c", "-o", compiled)
    own = set(re.findall(r"\bown_(\w+)", run(f"{MINGW}-nm", compiled)))
    names = sorted(set().union(*libraries.values()))
    exports = [f"{name} = {f'own_{name}' if name in own else f'ucrtbase.{name}'}" for name in names]
    listed.write_text("\n".join(["EXPORTS", *exports, ""]), encoding="utf-8")
    run(f"{MINGW}-gcc", "-shared", "-static-libgcc", compiled, listed, "-o", folder / OWN)
    for path in libraries:
        old = LIBRARY.encode()
        path.write_bytes(path.read_bytes().replace(old, OWN.encode().ljust(len(old), b"\0")))


def main() -> None:
    """Makes all of it."""
    folder, core = Path(sys.argv[1]), Path(sys.argv[2])
    site = install(folder)
    complete(folder, site / "numpy")
    shutil.copytree(ROOT / "python" / "stepwell", site / "stepwell", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    shutil.copy(core, site / "stepwell" / "_core.pyd")


if __name__ == "__main__":
    main()
