"""What is installed: the metadata, the wheel if one is there, and a clean environment."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from email import message_from_string
from pathlib import Path

import pytest
from installed import tried
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from support import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: What ``make wheel`` or ``make release`` has built.
WHEELS = sorted((ROOT / "dist").glob("stepwell-*.whl"))

needs_wheel = pytest.mark.skipif(not WHEELS, reason="make wheel builds one")


def test_the_project_says_what_an_index_shows() -> None:
    assert {"chart", "notebook", "docs", "progress", "test", "bench"} <= set(PROJECT["optional-dependencies"])
    assert len(PROJECT["classifiers"]) > 10
    assert "Typing :: Typed" in PROJECT["classifiers"]
    assert PROJECT["dependencies"] == ["numpy>=1.26"]
    assert PROJECT["scripts"] == {"stepwell": "stepwell.views.cli:main"}
    assert (ROOT / PROJECT["readme"]).exists()
    assert PROJECT["license"] == "MIT"
    files = [*(ROOT / "python").rglob("*.py"), *(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    named = {name for file in files for name in re.findall(r"stepwell\[(\w+)\]", file.read_text(encoding="utf-8"))}
    assert "chart" in named
    assert named <= set(PROJECT["optional-dependencies"])


def test_tools_of_development_have_one_version_everywhere() -> None:
    lines = (ROOT / ".ci" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert set(pins) == {canonicalize_name(name) for name in pins}
    extras = {name: [Requirement(need) for need in needs] for name, needs in PROJECT["optional-dependencies"].items()}
    tools = [need for extra in ("test", "docs") for need in extras.pop(extra)]
    # A user may have any version of what the other extras install.
    users = {canonicalize_name(need.name) for needs in extras.values() for need in needs}
    assert {canonicalize_name(need.name) for need in tools} - users <= set(pins)
    for need in tools:
        version = pins.get(canonicalize_name(need.name))
        assert version is None or need.specifier.contains(version, prereleases=True), f"{need} and {version}"
    recipes = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert len(re.findall(r"(?<!uv )pip install", recipes)) == 1
    assert "pip install --quiet --disable-pip-version-check --constraint $(PINS)" in recipes


def test_a_release_is_one_command() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipe = text.partition("\nrelease:")[2].partition("\n\n")[0]
    for step in (".venv/wheels", "maturin sdist", "twine check --strict", "tests/wheels.py", "tests/installed.py"):
        assert step in recipe
    assert "twine upload" in recipe.rpartition("@echo")[2], "which a person does"
    assert "twine upload" not in recipe.rpartition("@echo")[0]


@needs_wheel
def test_a_wheel_has_what_it_should() -> None:
    with zipfile.ZipFile(WHEELS[-1]) as wheel:
        names = wheel.namelist()
        (head,) = (name for name in names if name.endswith("METADATA"))
        metadata = message_from_string(wheel.read(head).decode("utf-8"))
    assert "stepwell/py.typed" in names
    assert any(name.startswith("stepwell/_core") for name in names)
    assert not [name for name in names if name.startswith(("tests/", "benches/", "docs/")) or "__pycache__" in name]
    assert metadata["Name"] == "stepwell"
    assert {"chart"} <= set(metadata.get_all("Provides-Extra") or ())


@pytest.mark.long
@needs_wheel
def test_a_wheel_installs_in_a_clean_environment() -> None:
    tried(WHEELS[-1])


@pytest.mark.parametrize(("setting", "outcome"), [("", "2 skipped"), ("complete", "1 failed, 1 skipped")])
def test_what_is_missing_in_ci_fails(setting: str, outcome: str, tmp_path: Path) -> None:
    """A tool that is missing is a skip on a user's machine and a failure in CI; a combination that does not exist is a skip."""
    (tmp_path / "test_skips.py").write_text(
        "import pytest\nfrom support.complete import *\n"
        "def test_a_tool(): pytest.skip('there is no compiler or interpreter of c here')\n"
        "def test_a_combination(): pytest.skip('the method needs an acceleration')\n",
        encoding="utf-8",
    )
    (tmp_path / "conftest.py").write_text("from support.complete import *\n", encoding="utf-8")
    environment = os.environ | {"STEPWELL_TESTS": setting, "PYTHONPATH": str(ROOT / "tests")}
    command = [sys.executable, "-m", "pytest", "-q", "-c", os.devnull, "--rootdir", str(tmp_path), str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=tmp_path)
    assert outcome in done.stdout
