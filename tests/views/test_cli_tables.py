"""Tables cut no name, number or path, at any width; files and pipes are not wrapped; every table can be written."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest
import stepwell as sw
from stepwell.views import cli
from stepwell.views.cli.table import UNLIMITED, length, lines_of, width_of_terminal

COLUMNS = ("method", "order>", "step>", "what it is", "file")
ROWS = [
    (
        "standard_euler",
        "1",
        "1.4e-05",
        "Both blocks move by the rates at the start of the step.",
        "/a/very/long/path/of/a/file-1.png",
    ),
    ("semi_false_heun", "2", "−0.0417 %", "", "/a/very/long/path/of/a/file-2.png"),
]


def words_of(lines: list[str]) -> list[str]:
    return " ".join(lines).split()


@pytest.mark.parametrize("width", [20, 40, 60, 79, 80, 81, 100, 120, UNLIMITED])
def test_every_word_is_whole_at_every_width(width: int) -> None:
    lines = lines_of("A title of some words", COLUMNS, ROWS, ["written: /a/very/long/path/of/a/file-1.png"], width=width)
    words = words_of(lines)
    for row in ROWS:
        for i, cell in enumerate(row):
            assert set(cell.split()) <= set(words)
            if i in (0, 1, 2) and cell:  # names and numbers stay on one line, units with them
                assert any(cell in line for line in lines)
    assert "…" not in "".join(lines)
    longest = max(length(word) for word in words if "─" not in word)
    assert max(map(length, lines)) <= max(width, longest + len("semi_false_heun") + 3)


def test_a_wide_table_is_one_line_a_row() -> None:
    lines = lines_of("t", COLUMNS, ROWS)
    assert len(lines) == 2 + 2 + len(ROWS)
    starts = {line.index("/a/very") for line in lines if "/a/very" in line}
    assert len(starts) == 1
    assert all(line.index("1.4e-05") + 7 == other.index("%") + 1 for line, other in [lines[-2:]])


def test_a_narrow_table_repeats_the_first_column() -> None:
    lines = lines_of("t", COLUMNS, ROWS, width=40)
    assert sum(line.startswith("standard_euler") for line in lines) >= 2
    order = [line.split() for line in lines if line.startswith("method")]
    assert all(head[0] == "method" for head in order)


def test_width_is_that_of_the_terminal_or_none(monkeypatch: pytest.MonkeyPatch) -> None:
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


@pytest.mark.parametrize("command", TABLES)
def test_commands_cut_nothing_at_80_columns(command: str, capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for width in ("80", "60"):
        monkeypatch.setenv("COLUMNS", width)
        assert cli.main(TABLES[command]) == 0
        out = capsys.readouterr().out
        assert not re.search(r"\w…", out)
        assert max(map(length, out.splitlines())) <= int(width)


@pytest.mark.parametrize("command", ["methods", "scenes", "criteria", "advise"])
def test_a_pipe_is_not_wrapped(command: str, capsys: Any) -> None:
    assert cli.main(TABLES[command]) == 0
    lines = capsys.readouterr().out.splitlines()
    if command == "scenes":
        for scene in sw.scenes.scenes():
            assert any(line.startswith(scene.name) and line.endswith(scene.description) for line in lines)
    if command == "methods":
        assert sum(line.startswith("semi_false_heun") for line in lines) == 1
    assert max(map(length, lines)) > 80


@pytest.mark.parametrize("command", ["methods", "scenes", "bench"])
def test_lists_are_written(command: str, capsys: Any, tmp_path: Path) -> None:
    words = TABLES[command]
    for ending in (".json", ".csv", ".md"):
        path = tmp_path / f"list{ending}"
        assert cli.main([*words, "-o", str(path)]) == 0
        out = capsys.readouterr().out
        assert f"written: {path}" in out
        text = path.read_text(encoding="utf-8")
        names = [s.name for s in sw.scenes.scenes()] if command == "scenes" else ["standard_euler", "semi_false_heun"]
        assert all(name in text for name in names)
        if ending == ".json":
            assert len(json.loads(text)) >= len(names)
        elif ending == ".csv":
            assert len(list(csv.DictReader(text.splitlines()))) == len(json.loads((tmp_path / "list.json").read_text("utf-8")))
        else:
            assert text.startswith("| ")
            assert len({line.replace("\\|", "").count("|") for line in text.splitlines()}) == 1
    code = cli.main([*words, "-o", str(tmp_path / "list.xls")])
    assert (code, capsys.readouterr().err.count("-o: expected a file ending in .csv, .json or .md")) == (2, 1)


def test_bench_times_the_methods_of_a_scene(capsys: Any) -> None:
    assert cli.main(["bench", "kepler", "--methods", "RK4,leapfrog,standard_heun", "--members", "16", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
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


def test_bench_says_what_it_cannot_time(capsys: Any) -> None:
    assert cli.main(["bench", "forced_oscillator", "--methods", "verlet,rk4"]) == 0
    assert "verlet is refused: verlet needs forces that do not depend on the velocity" in capsys.readouterr().out
    assert cli.main(["bench", "forced_oscillator", "--methods", "verlet"]) == 2
    assert capsys.readouterr().err.startswith("stepwell: verlet needs forces")
