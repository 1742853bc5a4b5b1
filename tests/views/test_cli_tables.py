"""Tables cut no name, number or path, at any width; files and pipes are not wrapped; every table can be written."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest
import stepwell as sw
from stepwell.views.cli.table import UNLIMITED, length, lines_of, width_of_terminal
from support.commands import complaint, listed, printed

COLUMNS = ("method", "order>", "step>", "what it is", "file")
PATH = "/a/very/long/path/of/a/file"
ROWS = [
    ("standard_euler", "1", "1.4e-05", "Both blocks move by the rates at the start of the step.", f"{PATH}-1.png"),
    ("semi_false_heun", "2", "−0.0417 %", "", f"{PATH}-2.png"),
]


def test_every_word_is_whole_at_every_width() -> None:
    for width in (20, 40, 60, 79, 80, 81, 100, 120, UNLIMITED):
        lines = lines_of("A title of some words", COLUMNS, ROWS, ["written: /a/very/long/path/of/a/file-1.png"], width=width)
        words = " ".join(lines).split()
        for row in ROWS:
            assert all(set(cell.split()) <= set(words) for cell in row), width
            for cell in filter(None, row[:3]):  # names and numbers stay on one line, units with them
                assert any(cell in line for line in lines), (width, cell)
        assert "…" not in "".join(lines)
        longest = max(length(word) for word in words if "─" not in word)
        assert max(map(length, lines)) <= max(width, longest + len("semi_false_heun") + 3), width


def test_wide_and_narrow_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = lines_of("t", COLUMNS, ROWS)
    assert len(lines) == 2 + 2 + len(ROWS)
    starts = {line.index("/a/very") for line in lines if "/a/very" in line}
    assert len(starts) == 1
    assert all(line.index("1.4e-05") + 7 == other.index("%") + 1 for line, other in [lines[-2:]])
    lines = lines_of("t", COLUMNS, ROWS, width=40)
    assert sum(line.startswith("standard_euler") for line in lines) >= 2
    order = [line.split() for line in lines if line.startswith("method")]
    assert all(head[0] == "method" for head in order)
    assert width_of_terminal() == UNLIMITED  # a pipe, as pytest captures
    monkeypatch.setenv("COLUMNS", "80")
    assert width_of_terminal() == 80


#: Commands that print tables, quick ones.
TABLES = {
    "methods": ["methods"],
    "scenes": ["scenes"],
    "criteria": ["criteria", "dop853", "standard_euler"],
    "stability": ["stability", "dop853", "standard_euler"],
    "advise": ["advise", "oscillator", "--cost", "evaluations", "--methods", "semi_false_heun,standard_heun"],
    "paper": ["paper", "4"],
    "bench": ["bench", "--methods", "standard_euler,semi_false_heun"],
}


def test_commands_cut_nothing_at_80_columns_and_a_pipe_is_not_wrapped(capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for command, words in TABLES.items():
        for width in (80, 60):
            monkeypatch.setenv("COLUMNS", str(width))
            out = printed(capsys, *words)
            assert not re.search(r"\w…", out), command
            assert max(map(length, out.splitlines())) <= width, command
        monkeypatch.delenv("COLUMNS")
        if command not in ("methods", "scenes", "criteria", "advise"):
            continue
        lines = printed(capsys, *words).splitlines()
        for scene in sw.scenes.scenes() if command == "scenes" else ():
            assert any(line.startswith(scene.name) and line.endswith(scene.description) for line in lines)
        assert command != "methods" or sum(line.startswith("semi_false_heun") for line in lines) == 1
        assert max(map(length, lines)) > 80, command


def test_lists_are_written(capsys: Any, tmp_path: Path) -> None:
    names = {command: ["standard_euler", "semi_false_heun"] for command in ("methods", "bench")}
    for command, names_of in (names | {"scenes": [s.name for s in sw.scenes.scenes()]}).items():
        texts = {}
        for ending in (".json", ".csv", ".md"):
            path = tmp_path / f"list{ending}"
            assert f"written: {path}" in printed(capsys, *TABLES[command], "-o", str(path))
            texts[ending] = path.read_text(encoding="utf-8")
            assert all(name in texts[ending] for name in names_of), (command, ending)
        rows = json.loads(texts[".json"])
        assert len(list(csv.DictReader(texts[".csv"].splitlines()))) == len(rows) >= len(names_of)
        assert texts[".md"].startswith("| ")
        assert len({line.replace("\\|", "").count("|") for line in texts[".md"].splitlines()}) == 1
        said = complaint(capsys, *TABLES[command], "-o", str(tmp_path / "list.xls"))
        assert said.count("-o: expected a file ending in .csv, .json or .md") == 1


def test_bench_times_the_methods_of_a_scene_and_says_which_it_cannot(capsys: Any) -> None:
    rows = listed(capsys, "bench", "kepler", "--methods", "RK4,leapfrog,standard_heun", "--members", "16")
    assert {row["method"] for row in rows} == {"rk4", "leapfrog", "standard_heun"}
    times = [row["ns_per_step"] for row in rows]
    assert times == sorted(times)
    assert rows[0]["times_the_least"] == 1.0
    assert sum(row["share"] for row in rows) == pytest.approx(1.0)
    for row in rows:
        assert row["ns_per_evaluation"] * sw.method(row["method"]).evaluations == pytest.approx(row["ns_per_step"])
        assert row["error"] >= 0.0
        assert row["median_ns_per_step"] >= row["ns_per_step"] > 0.0
        assert row["steps_per_second"] == pytest.approx(1e9 / row["ns_per_step"])
    out = printed(capsys, "bench", "forced_oscillator", "--methods", "verlet,rk4")
    assert "verlet is refused: verlet needs forces that do not depend on the velocity" in out
    said = complaint(capsys, "bench", "forced_oscillator", "--methods", "verlet")
    assert said.startswith("stepwell: verlet needs forces")
