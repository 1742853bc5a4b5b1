"""What a release is made of: versions, licences, wheels, and the workflows that build and publish them."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import stepwell
import wheels
import yaml
from support import ROOT
from support.binaries import Library, read

sys.path.append(str(ROOT / ".ci"))
import build_wheels
import licences

CARGO = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def jobs(file: Path) -> dict[str, Any]:
    """The jobs of a workflow by name."""
    return yaml.safe_load(file.read_text(encoding="utf-8"))["jobs"]


def scripts() -> list[str]:
    """Every command line that a workflow runs."""
    steps = [step for file in WORKFLOWS for job in jobs(file).values() for step in job.get("steps", ())]
    return [step["run"] for step in steps if "run" in step]


def test_the_version_is_the_same_everywhere() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    headings = re.findall(r"^## (\S+) \((.+)\)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    version, date = headings[0]
    assert stepwell.__version__ == CARGO["version"] == cited["version"] == version
    assert date == str(cited["date-released"])


def test_the_versions_of_python_are_those_that_are_tested() -> None:
    classified = {name.rpartition(" ")[2] for name in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", name)}
    matrix = jobs(ROOT / ".github" / "workflows" / "test.yml")["test"]["strategy"]["matrix"]
    assert {*matrix["python"], *(each["python"] for each in matrix["include"])} == classified
    assert min(classified, key=lambda name: int(name[2:])) == PROJECT["requires-python"].removeprefix(">=")


def test_licences_are_of_the_crates_in_a_wheel() -> None:
    """Where this fails after a change of Cargo.lock, ``make licences`` writes them again."""
    text = (ROOT / "THIRD-PARTY.txt").read_text(encoding="utf-8")
    written = re.findall(r"^([\w-]+) (\d+\.\d+\.\d+\S*)$", text, re.MULTILINE)
    assert sorted(written) == licences.crates()
    assert {"LICENSE", "THIRD-PARTY.txt"} == set(PROJECT["license-files"])


def test_a_workflow_may_do_little_and_ends() -> None:
    for file in WORKFLOWS:
        text = file.read_text(encoding="utf-8")
        assert yaml.safe_load(text)["permissions"] == {"contents": "read"}, file
        assert "concurrency:" in text, file
        for job in jobs(file).values():
            assert "uses" in job or job["timeout-minutes"] <= 360, file
            assert set(job.get("permissions", ())) <= {"id-token", "pages"}, file


def test_actions_are_pinned_by_hash_and_alike() -> None:
    text = "".join(file.read_text(encoding="utf-8") for file in WORKFLOWS)
    pins = dict(re.findall(r"uses: ([\w./-]+)@([0-9a-f]{40}) # v\d+\.\d+\.\d+$", text, re.MULTILINE))
    used = re.findall(r"uses: (?!\./)(\S+)", text)
    assert {name.partition("@")[0]: name.partition("@")[2] for name in used} == pins
    assert {f"{name}@{pin}" for name, pin in pins.items()} == set(used)


def test_workflows_run_what_a_person_runs() -> None:
    run = {target for script in scripts() for target in re.findall(r"\bmake ([a-z-]+)", script)}
    run |= set(jobs(ROOT / ".github" / "workflows" / "weekly.yml")["long"]["strategy"]["matrix"]["target"])
    assert {"test", "test-oldest", "deny", "release", "docs", "test-long", "campaign", "gate"} == run
    assert run <= TARGETS
    files = {name for script in scripts() for name in re.findall(r"(?:tests|\.ci)/\w+(?:\.py)?", script)}
    assert files == {"tests/installed.py", ".ci/run"}


def test_shell_in_workflows_and_beside_them(tmp_path: Path) -> None:
    file = tmp_path / "steps.sh"
    file.write_text("\n".join(["#!/bin/bash", *scripts()]), encoding="utf-8")
    try:
        check = [Path(sys.executable).with_name("shellcheck"), file, ROOT / ".ci" / "run", ROOT / ".ci" / "zig-windows"]
        done = subprocess.run(check, capture_output=True, text=True)
    except FileNotFoundError:
        pytest.skip("there is no shellcheck here")
    assert not done.returncode, done.stdout


def test_a_library_says_what_it_exports_and_needs() -> None:
    (file,) = (each for each in Path(stepwell.__file__).parent.glob("_core*") if each.suffix in (".so", ".pyd"))
    data = file.read_bytes()
    library = read(data)
    system = {"linux": "linux", "darwin": "macos", "win32": "windows"}[sys.platform]
    assert (library.system, library.exports) == (system, {"PyInit__core"})
    assert library.needs
    with pytest.raises(ValueError, match="no library of a known system"):
        read(data[1:])


def test_wheels_have_the_names_that_pip_looks_for() -> None:
    """One for each machine and Python, and none twice."""
    endings = [wheel.ending for wheel in build_wheels.WHEELS.values()]
    assert len(set(endings)) == len(endings)
    assert all(re.fullmatch(r"-cp311-abi3-\S+\.whl|-cp314-cp314t-manylinux\S+\.whl", ending) for ending in endings)


def test_each_system_of_a_workflow_has_a_wheel() -> None:
    systems = {
        each["system"] for each in jobs(ROOT / ".github" / "workflows" / "wheels.yml")["try"]["strategy"]["matrix"]["include"]
    }
    assert len(systems) == len({wheel.platform for name, wheel in build_wheels.WHEELS.items() if "musl" not in name})


#: A core as it should be, and the files of a wheel around it.
CORE = Library("linux", "x86_64", frozenset({"PyInit__core"}), frozenset({"libc.so.6"}), (2, 17))
NOTES = f"stepwell-{CARGO['version']}.dist-info"
METADATA = f"Version: {CARGO['version']}\nLicense-File: LICENSE\nLicense-File: THIRD-PARTY.txt\n"
TAGS = "Tag: cp311-abi3-manylinux2014_x86_64\nTag: cp311-abi3-manylinux_2_17_x86_64\n"
FILES = {
    "stepwell/_core.abi3.so": "",
    "stepwell/py.typed": "",
    f"{NOTES}/METADATA": METADATA,
    f"{NOTES}/WHEEL": TAGS,
    f"{NOTES}/licenses/LICENSE": "",
    f"{NOTES}/licenses/THIRD-PARTY.txt": "",
    f"{NOTES}/sboms/stepwell-py.cyclonedx.json": '{"components": [{"name": "nalgebra"}, {"name": "pyo3"}]}',
}


#: What is wrong with the files of a wheel, or with its core.
FAULTS: list[dict[str, Any]] = [
    {f"{NOTES}/METADATA": METADATA.replace("0", "9")},
    {f"{NOTES}/METADATA": "Version: " + CARGO["version"]},
    {f"{NOTES}/WHEEL": "Tag: cp311-abi3-linux_x86_64"},
    {f"{NOTES}/sboms/stepwell-py.cyclonedx.json": '{"components": []}'},
    {"stepwell/_core.so": ""},
    {"system": "macos"},
    {"machine": "arm64"},
    {"exports": frozenset({"PyInit__core", "main"})},
    {"needs": frozenset({"libc.so.6", "libgcc_s.so.1"})},
    {"minimum": (2, 28)},
]


def test_a_wheel_with_a_fault_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def check(files: dict[str, str], core: Library) -> None:
        with zipfile.ZipFile(tmp_path / "wheel", "w") as wheel:
            for path, text in files.items():
                wheel.writestr(path, text)
        monkeypatch.setattr(wheels, "read", lambda _: core)
        wheels.check(tmp_path / "wheel", build_wheels.WHEELS["linux-x86_64"])

    check(FILES, CORE)
    for fault in FAULTS:
        of_core = hasattr(CORE, next(iter(fault)))
        with pytest.raises(AssertionError):
            check(FILES if of_core else FILES | fault, replace(CORE, **fault) if of_core else CORE)
