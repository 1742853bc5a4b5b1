"""The document's statements, run: each entry holds, each section is there, and the page lists them all."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import stepwell as sw
from stepwell.views import paper
from stepwell.views.cli import main
from support import ROOT
from support.refusals import refused

ENTRIES = paper.entries()
SECTIONS = [*(f"§{n}" for n in range(1, 13)), *(f"App. {letter}" for letter in "ABCDE")]
PAGE = ROOT / "docs" / "theory" / "paper.md"


@pytest.mark.parametrize("section", SECTIONS)
def test_each_statement_is_reproduced_and_each_figure_drawn(section, tmp_path):
    entries = paper.entries(section)
    for entry in entries:
        finding = entry.run()
        assert finding.holds, (entry.name, finding.numbers)
    figures = {entry.picture for entry in entries if entry.draw}
    if not figures:
        refused(sw.errors.ArgumentError, f"{section} has no figure", paper.draw, tmp_path, section)
        return
    paths = paper.draw(tmp_path, section)
    assert {path.name for path in paths} == figures
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


def test_sections_names_and_pictures_are_there_once():
    assert list(dict.fromkeys(entry.section for entry in ENTRIES)) == SECTIONS
    names = [entry.name for entry in ENTRIES]
    pictures = [entry.picture for entry in ENTRIES if entry.picture]
    assert len(set(names)) == len(names)
    assert len(set(pictures)) == len(pictures)
    # What an entry says is here can be found under that name.
    for entry in ENTRIES:
        for name in re.findall(r"sw\.([A-Za-z_.]+)", entry.here):
            at = sw
            for part in name.split("."):
                at = getattr(at, part)
    refused(sw.errors.UnknownNameError, "§99", paper.entries, "§99")


def test_every_misprint_of_the_errata_is_named():
    """The table of docs/theory/errata.md and the entries with a correction are about the same sections."""
    table = (PAGE.parent / "errata.md").read_text(encoding="utf-8")
    rows = [line for line in table.splitlines() if re.match(r"\| \[(§|App)", line)]
    named = {part for row in rows for part in re.findall(r"§\d+|[B-E](?=[,\]])", row.split("|")[1])}
    corrected = {entry.section.removeprefix("App. ") for entry in ENTRIES if entry.corrected}
    assert named <= corrected, named - corrected


def test_the_command_fails_where_a_statement_does(tmp_path, capsys, monkeypatch):
    assert main(["paper", "7", "-o", str(tmp_path), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in report["statements"]] == [entry.name for entry in paper.entries("§7")]
    assert all(each["holds"] for each in report["statements"])
    assert [Path(file).name for file in report["files"]] == [path.name for path in tmp_path.iterdir()]
    entry = paper.entries("§2")[0]
    monkeypatch.setattr(paper, "entries", lambda section=None: (entry._replace(check=lambda: paper.Finding(False, "0")),))
    assert main(["paper", "2"]) == 2
    output = capsys.readouterr()
    assert "not reproduced" in output.out
    assert "not reproduced" in output.err


def test_import_costs_nothing_until_asked():
    """``import stepwell`` does not run the document."""
    code = "import sys, stepwell; assert not [name for name in sys.modules if name.startswith('stepwell.paper.')]"
    subprocess.run([sys.executable, "-c", code], check=True)
