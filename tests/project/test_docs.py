"""README and docs: every Python block runs and prints what it says, tables are current, files that are named exist."""

import contextlib
import importlib.util
import io
import re
import runpy
import sys
import types
import warnings
from pathlib import Path

import pytest
import stepwell as sw
from support import ROOT, stiff
from support.devices import NAMES

AT_THE_ROOT = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md")
PAGES = [ROOT / name for name in AT_THE_ROOT] + sorted((ROOT / "docs").rglob("*.md"))
#: Where a page may find the files that it names, by their last parts.
FOLDERS = ["benches", "docs", "examples", "python", "rust", "tests"]

FENCE = re.compile(r"(?:<!-- file: python/(\S+)\.py -->\n)?^```([^`\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
SAID = re.compile(r"#\s*→ (.*(?:\n\s*#   \S.*)*)$", re.MULTILINE)
#: A line of output that is too long for the page goes on behind ``#`` and three spaces.
GOES_ON = re.compile(r"\n\s*#   ")
#: The columns of a page.
COLUMNS = 88
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
NAMED = re.compile(r"`([\w.*{},/-]+(?:/|\.(?:rs|py|pyi|md|toml|txt|png)))`")
INTRODUCED = re.compile(r"<!-- file: (\S+) -->")

#: What a page needs beside what every page may use. The extra ``test`` has it.
NEEDS = {"interop.md": ("gymnasium", "pandas", "xarray"), "gpu.md": ("pyopencl", "xarray")}


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def prose(page: Path) -> str:
    return FENCE.sub("", text(page))


def anchors(page: Path) -> set[str]:
    titles = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def blocks(page: Path) -> list[tuple[int, str, str]]:
    """Line number and code of every Python block, and the module that it says it is, if it does."""
    whole = text(page)
    matches = [m for m in FENCE.finditer(whole) if m[2] == "python"]
    return [(whole[: m.start(3)].count("\n"), m[3], (m[1] or "").replace("/", ".")) for m in matches]


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=lambda page: page.relative_to(ROOT).as_posix())
def test_python_blocks_run_and_print_what_they_say(page, tmp_path, monkeypatch):
    for package in NEEDS.get(page.name, ()):
        pytest.importorskip(package)
    if page.name == "gpu.md" and not NAMES:
        pytest.skip("there is no device of OpenCL here")
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": page.stem}
    for line, code, module in blocks(page):
        namespace["__package__"] = module.rpartition(".")[0]
        printed = io.StringIO()
        # A block that changes the filters must not change them for the next one.
        with contextlib.redirect_stdout(printed), warnings.catch_warnings():
            exec(compile("\n" * line + code, str(page), "exec"), namespace)
        if module:  # later blocks may import it
            monkeypatch.setitem(sys.modules, module, types.SimpleNamespace(**namespace))
        expected = [GOES_ON.sub(" ", said) for said in SAID.findall(code)]
        assert printed.getvalue().splitlines() == expected, f"{page.name}, block at line {line}"


def test_code_is_as_wide_as_the_page():
    """Wider code scrolls sideways, on the site and on a screen of a laptop."""
    for page in PAGES:
        if page.name == "CHANGELOG.md":
            continue
        # A file to be added is as wide as those beside it.
        cells = [m[3] for m in FENCE.finditer(text(page)) if not m[1] and (m[2] == "python" or m[2].startswith("{code-cell}"))]
        shown = [re.sub(r"\A---\n.*?^---\n", "", code, flags=re.DOTALL | re.MULTILINE) for code in cells]
        assert [line for code in shown for line in code.splitlines() if len(line) > COLUMNS] == [], page


def test_blocks_are_found_and_compared():
    # Guards the two expressions above: a fence that is not seen would be a test that cannot fail.
    assert len(blocks(ROOT / "README.md")) >= 1
    assert sum(len(SAID.findall(code)) for page in PAGES for _, code, _ in blocks(page)) >= 20


def test_generated_tables_are_current():
    spec = importlib.util.spec_from_file_location("generate", ROOT / "docs" / "generate.py")
    generate = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(generate)
    places = [place for page in generate.pages() for place in generate.PLACE.findall(text(page))]
    assert {name for _, name, _ in places} == set(generate.TABLES)
    for page in generate.pages():
        assert generate.current(text(page)) == text(page), f"{page.name} is stale: run docs/generate.py"


def test_links_lead_somewhere_and_have_words_as_texts():
    files = re.compile(r"\[`?[\w/.-]+\.(?:md|rst)`?\]\(")
    for page in PAGES:
        assert files.findall(prose(page)) == [], page
        for target in LINK.findall(prose(page)):
            if re.match(r"\w+:", target):
                continue
            path, _, anchor = target.partition("#")
            file = (page.parent / path).resolve() if path else page
            assert file.exists(), f"{page.name} links to {target}"
            assert not anchor or anchor in anchors(file), f"{page.name} links to {target}"


def test_named_files_exist():
    for page in PAGES:
        introduced = INTRODUCED.findall(text(page))
        for name in NAMED.findall(prose(page)):
            if any(file.endswith(name) for file in introduced):
                continue
            head, brace, rest = name.partition("{")
            choices, _, tail = rest.partition("}")
            for each in (head + choice + tail for choice in choices.split(",")) if brace else [name]:
                files = list(ROOT.glob(each)) or [f for folder in FOLDERS for f in (ROOT / folder).rglob(each)]
                assert files, f"{page.name} names {each}"


def test_no_page_names_a_place_of_one_machine():
    # Written in two parts, so that this file does not name one either.
    place = re.compile(r"(?<![\w.])/(?:tmp" + r"|work|root|home)/")
    assert [page for page in PAGES if place.search(text(page))] == []


def test_every_scene_is_in_a_picture_of_errors_against_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    """In one, and in the table unless luck decides there; the cloth and stiff ones are in none, and the page says why."""
    monkeypatch.syspath_prepend(ROOT / "docs")  # it imports what stands beside it
    drawn = runpy.run_path(str(ROOT / "docs" / "pictures.py"))
    names = [name for scenes in drawn["FAMILIES"].values() for name in scenes]
    assert sorted([*names, "cloth", *stiff.SCENES]) == [scene.name for scene in sw.scenes.scenes()]
    page = (ROOT / "docs" / "benchmarks" / "work-precision.md").read_text(encoding="utf-8")
    assert "The scene `cloth` is missing" in page
    assert all(f"`{name}`" in page for name in stiff.SCENES)
    for picture, scenes in drawn["FAMILIES"].items():
        assert f"](../images/{picture})" in page
        for scene in scenes:
            assert (f"| `{scene}` |" in page) is (picture not in drawn["NO_ROWS"])
