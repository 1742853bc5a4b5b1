"""Where files go is tried before any work, and a file that cannot be written in the end costs no result."""

import csv
import json
import math
import os
import sys
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base import paths
from stepwell.base.tables import Table, columns_of, stacked, write_csv, write_json
from stepwell.errors import ArgumentError, DTypeError
from stepwell.studies.measuring import timing
from stepwell.views import charts
from support.commands import run_command
from support.families import family
from support.refusals import refused

RUN = ["run", "clover", "--method", "rk4", "--steps", "5"]
CHART = ["chart", "oscillator", "--methods", "false_euler"]
ADVISE = ["advise", "oscillator", "--methods", "rk4", "--cost", "evaluations", "--tolerance", "0.1"]
CLI = "stepwell.views.cli"
#: Each command that writes: its words, what its work is done by, the name of a file, or one that it writes into a folder.
COMMANDS: dict[str, tuple[list[str], str, str, str | None]] = {
    "run": (RUN, "stepwell.scenes.Scene.run", "run.csv", None),
    "run npz": (RUN, "stepwell.scenes.Scene.run", "run.npz", None),
    "run picture": (RUN, "stepwell.scenes.Scene.run", "run.png", None),
    "run animation": (RUN, "stepwell.scenes.Scene.run", "run.gif", None),
    "advise": (ADVISE, f"{CLI}.advise.advise", "a.json", None),
    "explore": (["explore", "--scene", "oscillator", "--only"], f"{CLI}.explore.explore", "page.html", None),
    "criteria": (["criteria", "rk4"], f"{CLI}.criteria.criteria", "c.md", None),
    "criteria json": (["criteria", "rk4"], f"{CLI}.criteria.criteria", "c.json", None),
    "chart": (CHART, f"{CLI}.chart.work_precision", "", "oscillator.csv"),
    "chart panel": ([*CHART, "--panel"], f"{CLI}.chart.work_precision", "", "panel.json"),
    "figures": (["figures", "rk4"], f"{CLI}.figures.figures", "", None),
    "stability": (["stability", "rk4", "--charts", "loci"], f"{CLI}.stability.stability", "", "stability.csv"),
}

EACH = pytest.mark.parametrize("command", COMMANDS)


def places(tmp_path: Path, file: str) -> dict[str, Path]:
    """Where nothing can be written, even by root: each with a word of why."""
    (tmp_path / "a file").write_text("kept")
    (tmp_path / "folder" / (file or "x")).mkdir(parents=True)
    long = "x" * 300
    paths = {
        "Not a directory": tmp_path / "a file" / (file or "sub"),
        "File name too long": tmp_path / (f"{long}{Path(file).suffix}" if file else long) / ("" if file else "sub"),
    }
    if file:
        paths |= {"No such file": tmp_path / "no" / file, "Is a directory": tmp_path / "folder" / file}
    return paths


@EACH
def test_a_place_is_tried_before_any_work(command: str, capsys: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words, work, file, _ = COMMANDS[command]

    def worked(*_: Any, **__: Any) -> Any:
        raise AssertionError("it worked before it looked at -o")

    monkeypatch.setattr(work, worked)
    for why, path in places(tmp_path, file).items():
        before = sorted(tmp_path.rglob("*"))
        code, out, err = run_command(capsys, *words, "-o", str(path))
        assert (code, out) == (2, "")
        assert err.startswith("stepwell: -o: expected a f")
        assert why in err or sys.platform == "win32"  # which has other words
        assert err.count("\n") == 1
        assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "a file").read_text() == "kept"


@pytest.mark.parametrize(("words", "inside"), [(words, inside) for words, _, _, inside in COMMANDS.values() if inside])
def test_a_file_in_a_folder_is_tried_too(words: list[str], inside: str, capsys: Any, tmp_path: Path) -> None:
    (tmp_path / inside).mkdir()
    code, out, err = run_command(capsys, *words, "-o", str(tmp_path))
    assert (code, out) == (2, "")
    assert f"{inside}': Is a directory" in err


#: Whether the command prints JSON: both of some commands.
PRINTED = family(
    [(command, form) for command in COMMANDS for form in (["--json"], [])],
    lambda command, form: bool(form) or command in ("run", "criteria"),
)


@pytest.mark.parametrize(("command", "form"), PRINTED)
def test_what_was_found_is_printed_though_it_cannot_be_written(
    command: str, form: list[str], capsys: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when the disk is full in the end."""
    words, _, file, _ = COMMANDS[command]
    monkeypatch.setattr(timing, "CHARTS", timing.CHARTS._replace(repeats=1))

    def full(*_: Any, **__: Any) -> Any:
        raise OSError(28, "No space left on device")

    from matplotlib.figure import Figure

    monkeypatch.setattr(Figure, "savefig", full)
    monkeypatch.setattr(Path, "write_bytes", full)
    monkeypatch.setattr("numpy.savez", full)
    monkeypatch.setattr("csv.writer", full)
    monkeypatch.setattr(Path, "write_text", full)
    monkeypatch.setattr("os.replace", full)  # by which a text takes its place when it is whole
    code, out, err = run_command(capsys, *words, *form, "-o", str(tmp_path / file))
    assert code == 2
    assert err.strip() == "stepwell: [Errno 28] No space left on device"  # after the line of a bar
    if form:
        json.loads(out)
    else:
        assert "written" not in out
    assert len(out) > 100


def test_charts_try_their_place_before_they_draw(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = sw.scenes.clover()
    picture = charts.run_picture(scene, scene.run("rk4", steps=5, every=1))
    loci, map_, figures = charts.stability(["rk4"]), charts.stability_map("rk4", size=8), charts.figures(["rk4"])
    curves = charts.work_precision("oscillator", ["false_euler"], [100], tolerances=[])
    panel = charts.Panel((curves,))
    drawn = [figures.plot, partial(figures.plot, method="rk4"), loci.plot, map_.plot, picture.plot, curves.plot, panel.plot]
    tables = [getattr(chart, name) for chart in (picture, curves, panel) for name in ("to_csv", "to_json")]
    drawers = ("picture", "figures_picture", "zplane_picture", "map_picture", "runs_picture", "panel_picture", "runs_animation")
    for name in drawers:
        module = __import__(f"stepwell.views.charts.{name}", fromlist=["x"])
        for drawer in ("draw", "loci", "overview", "one", "write"):
            if hasattr(module, drawer):
                monkeypatch.setattr(module, drawer, lambda *_: pytest.fail("it drew before it looked at the path"))
    for write in (*drawn, *tables, sw.criteria(["rk4"]).to_json, picture.animate):
        ending = ".gif" if write == picture.animate else ".png"
        for wrong, error, why in (
            (tmp_path / "no" / f"x{ending}", ArgumentError, "No such file or directory"),
            (tmp_path, ArgumentError, "Is a directory"),
            (f"x\0{ending}", ArgumentError, "null"),
            (3, DTypeError, "expected the path of a file, got 3"),
        ):
            with pytest.raises(error, match="path: expected ") as caught:
                write(wrong)
            assert why in str(caught.value), write
    for wrong, error in ((tmp_path / "x" / "\0", ArgumentError), (None, DTypeError)):
        refused(error, "folder: expected ", figures.save, wrong)
    assert list(tmp_path.iterdir()) == []


def test_a_path_is_left_as_it_was(tmp_path: Path) -> None:
    old = tmp_path / "old"
    old.write_bytes(b"kept")
    os.utime(old, (1e9, 1e9))
    assert paths.file("path", str(old)) == old
    assert (old.read_bytes(), old.stat().st_mtime) == (b"kept", 1e9)
    paths.file("path", tmp_path / "new")
    link = tmp_path / "link"
    with suppress(OSError):  # Windows lets administrators make links, and Wine makes none
        link.symlink_to(tmp_path / "not yet")
    paths.file("path", link)
    link.unlink(missing_ok=not hasattr(os, "geteuid"))
    paths.folder("path", tmp_path / "new" / "and" / "deep")
    paths.folder("path", str(tmp_path), ["old", "new"])
    assert list(tmp_path.iterdir()) == [old]
    assert (old.read_bytes(), old.stat().st_mtime) == (b"kept", 1e9)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no such files here")
def test_what_is_no_file_is_not_opened_twice(tmp_path: Path) -> None:
    """A pipe would wait for its reader."""
    os.mkfifo(tmp_path / "pipe")
    begin = time.perf_counter()
    paths.file("path", tmp_path / "pipe")
    paths.file("path", os.devnull)
    assert time.perf_counter() - begin < 1.0


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_what_may_not_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch(0o400)
    (tmp_path / "folder").mkdir(0o500)
    for path in (tmp_path / "file", tmp_path / "folder" / "x"):
        refused(ArgumentError, "Permission denied", paths.file, "path", path)
    refused(ArgumentError, "Permission denied", paths.folder, "path", tmp_path / "folder" / "deep")


class Falls(Table):
    """Two falls, each with its heights."""

    def _columns(self) -> dict[str, list[Any]]:
        return stacked(
            {"name": name, "t": np.arange(2.0), "y": np.array(y), "low": np.array(y) < 0.5}
            for name, y in (("a", [1, 0]), ("b", [0.1, math.nan]))
        )

    def _head(self) -> dict[str, Any]:
        return {"dt": 1.0}

    def summary(self) -> list[dict[str, Any]]:
        return [{"lowest": -math.inf}]


ROWS = [{"name": name, "t": t, "y": y, "low": y < 0.5} for name, t, y in (("a", 0.0, 1), ("a", 1.0, 0), ("b", 0.0, 0.1))]


def test_rows_are_those_of_the_parts_one_below_the_other() -> None:
    rows = Falls().rows()
    assert rows[:3] == ROWS
    assert math.isnan(rows[3]["y"])
    assert len(rows) == 4


def test_csv_reads_back_as_the_rows(tmp_path: Path) -> None:
    Falls().to_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        read = list(csv.DictReader(file))
    assert [list(row) for row in read] == [list(ROWS[0])] * 4
    assert [[row["name"], float(row["t"]), float(row["y"]), row["low"] == "True"] for row in read[:3]] == [
        [*row.values()] for row in ROWS
    ]


def test_json_has_head_summary_and_rows_and_null_for_what_is_not_finite(tmp_path: Path) -> None:
    Falls().to_json(tmp_path / "t.json")
    read = json.loads((tmp_path / "t.json").read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert list(read) == ["dt", "summary", "rows"]
    assert read["summary"] == [{"lowest": None}]
    assert read["rows"] == [*ROWS, {"name": "b", "t": 1.0, "y": None, "low": False}]


def test_a_row_that_lacks_a_column_leaves_it_empty(tmp_path: Path) -> None:
    columns = columns_of([{"a": 1}, {"a": None, "b": 2}])
    write_csv(columns, tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_bytes() == b"a,b\n1,\n,2\n"


@pytest.mark.parametrize("write", [write_csv, write_json])
def test_columns_of_unequal_length_or_no_json_leave_no_file(tmp_path: Path, write: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        write({"a": [1, 2], "b": [object()]}, tmp_path / "t")
    assert list(tmp_path.iterdir()) == []
