"""A new method is two files: add the one of ``docs/adding.md`` to a copy of the tree, and see it picked up everywhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)
LEFT_OUT = shutil.ignore_patterns("target", ".venv*", ".git", "out", "dist", "*.so", "__pycache__", ".*_cache", ".hypothesis")

pytestmark = pytest.mark.skipif(shutil.which("cargo") is None, reason="builds the core")


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project with the two files, and its wheel unpacked into ``site``."""
    tree = tmp_path_factory.mktemp("tree") / "stepwell"
    shutil.copytree(ROOT, tree, ignore=LEFT_OUT)
    added = FILES.findall((tree / "docs" / "adding.md").read_text(encoding="utf-8"))
    assert sorted(name for name, _ in added) == [
        "python/stepwell/reference/steppers/midpoint.py",
        "rust/core/src/steppers/midpoint.rs",
    ]
    for name, text in added:
        (tree / name).write_text(text, encoding="utf-8")
    # A target folder of its own: in the project's, the copy's core would take the place of the project's.
    # Hardly optimised, which takes a third of the time: the bits are the same, and only the canary is about speed.
    environment = os.environ | {"CARGO_TARGET_DIR": str(ROOT / "target" / "adding"), "CARGO_PROFILE_RELEASE_OPT_LEVEL": "1"}
    build = [sys.executable, "-m", "maturin", "build", "--release", "--quiet", "--out", "dist"]
    subprocess.run(build, cwd=tree, env=environment, check=True)
    (wheel,) = (tree / "dist").glob("*.whl")
    shutil.unpack_archive(wheel, tree / "site", "zip")
    return tree


def run(tree: Path, *arguments: str) -> str:
    """What a Python command prints in the copy."""
    environment = os.environ | {"PYTHONPATH": str(tree / "site")}
    done = subprocess.run([sys.executable, *arguments], cwd=tree, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_suite_tests_it(tree: Path) -> None:
    """Bits, order, stage times by its record, matrix form, world, charts: all by iterating over the catalogue."""
    printed = run(
        tree,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "tests",
        "--ignore=tests/test_adding.py",
        "--ignore=tests/test_canary.py",
        "-k",
        "midpoint",
    )
    passed = re.search(r"(\d+) passed", printed)
    assert passed is not None
    assert int(passed[1]) > 100
    assert "failed" not in printed


def test_the_command_line_and_the_docs_show_it(tree: Path) -> None:
    assert "Midpoint" in run(tree, "-m", "stepwell", "methods", "midpoint")
    assert "midpoint" in run(tree, "-m", "stepwell", "methods", "--json")
    run(tree, "docs/generate.py")
    assert "| `midpoint` | Midpoint | explicit midpoint rule | 2 | 2 |" in (tree / "README.md").read_text(encoding="utf-8")
    run(tree, "-m", "stepwell", "chart", "oscillator", "-o", "out", "--methods", "midpoint,rk4")
    assert "midpoint" in (tree / "out" / "oscillator.csv").read_text(encoding="utf-8")


def test_it_is_the_method_of_that_name(tree: Path) -> None:
    """Against the formula, by hand: one step of y' = v, v' = −y."""
    code = (
        "import stepwell as sw\n"
        "r = sw.integrate(sw.Oscillator(1.0), 'midpoint', v=0.25, y=1.0, dt=0.5, steps=1)\n"
        "assert (r.v[-1], r.y[-1]) == (0.25 - 0.5 * (1.0 + 0.25 * 0.25), 1.0 + 0.5 * (0.25 - 0.25 * 1.0))\n"
    )
    run(tree, "-c", code)
