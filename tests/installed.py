"""Installs a wheel or an sdist in an environment of its own, and tries what a new user would: ``python tests/installed.py FILE``.

Of a folder pip takes the wheel for this machine. Nothing of this folder is used there, no extra is installed, and no file of the
repository is in reach.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

#: What a new user does first; the numbers are those of the reference, so the core's machine code is tried, too.
TRIAL = """
import importlib.metadata, importlib.util, os, pathlib, sys
import numpy as np
import stepwell as sw

assert sw.__version__ == importlib.metadata.version("stepwell")
assert pathlib.Path(sw.__file__).is_relative_to(sys.prefix), sw.__file__
assert (pathlib.Path(sw.__file__).parent / "py.typed").exists()
assert all(importlib.util.find_spec(name) is None for name in ("matplotlib", "rich", "pytest")), "nothing but NumPy is needed"
for name in dir(sw):
    assert getattr(sw, name) is not None
options = dict(v=0.1, y=np.ones(50), dt=0.2, steps=300, every=7)
for method in sw.methods():
    fast = sw.integrate(sw.Oscillator(np.linspace(0.5, 2.0, 50)), method, **options)
    slow = sw.integrate(sw.Oscillator(np.linspace(0.5, 2.0, 50)), method, **options, backend="numpy")
    assert np.array_equal(fast.y, slow.y, equal_nan=True), method
for kernels in ("interpret", *sw.isa_levels()[1:]):
    os.environ["STEPWELL_KERNELS"] = kernels
    again = sw.integrate(sw.Oscillator(np.linspace(0.5, 2.0, 50)), method, **options)
    assert np.array_equal(again.y, slow.y, equal_nan=True), kernels
assert sw.method("symplectic Euler").name == "false_euler"
assert sw.advise("oscillator", methods=["leapfrog", "rk4"]).best is not None
try:
    sw.charts.stability(["rk4"]).plot()
except sw.StepwellError as error:
    assert "pip install 'stepwell[chart]'" in str(error)
else:
    raise AssertionError("a picture without matplotlib")
"""

#: Commands of a new user: words, and what is in the output.
COMMANDS = {
    (): "commands:",
    ("methods",): "false_euler",
    ("run", "clover", "--method", "RK4"): "verdict",
    ("criteria", "rk4"): "Runge-Kutta 4",
    ("bench", "--methods", "rk4,leapfrog"): "times the least",
}


def install(file: Path, folder: Path) -> Path:
    """A new environment with that file installed, or what pip takes of a folder; returns its programs' folder."""
    venv.create(folder, with_pip=True)
    programs = folder / ("Scripts" if sys.platform == "win32" else "bin")
    pip = [programs / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    if file.is_dir():
        run([*pip, "--no-index", "--no-deps", "--only-binary", ":all:", "--find-links", file.resolve(), "stepwell"], folder)
        run([*pip, "numpy"], folder)
    else:
        run([*pip, file.resolve()], folder)
    return programs


def run(words: list[object], folder: Path) -> str:
    """The output of a program that must succeed."""
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, encoding="utf-8", cwd=folder)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, words))}: {done.stdout}{done.stderr}")
    return done.stdout


def tried(file: Path) -> None:
    """Install it and try it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        programs = install(file, folder / "environment")
        run([programs / "python", "-I", "-c", TRIAL], folder)
        for words, text in COMMANDS.items():
            if text not in (out := run([programs / "stepwell", *words], folder)):
                raise SystemExit(f"stepwell {' '.join(words)}: {text!r} is not in {out}")
        run([programs / "python", "-m", "pip", "check"], folder)


if __name__ == "__main__":
    for each in sys.argv[1:]:
        tried(Path(each))
        print(f"{each}: installed and tried")
