"""Results as tables: rows, CSV and JSON come from the same columns."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stepwell.base.tables import Table, columns_of, stacked, write_csv, write_json


class Falls(Table):
    """Two falls, each with its heights."""

    def _columns(self) -> dict[str, list[Any]]:
        return stacked(
            {"name": name, "t": np.arange(2.0), "y": np.array(y)} for name, y in (("a", [1, 0]), ("b", [0.1, math.nan]))
        )

    def _head(self) -> dict[str, Any]:
        return {"dt": 1.0}

    def summary(self) -> list[dict[str, Any]]:
        return [{"lowest": -math.inf}]


ROWS = [{"name": "a", "t": 0.0, "y": 1}, {"name": "a", "t": 1.0, "y": 0}, {"name": "b", "t": 0.0, "y": 0.1}]


def test_rows_are_those_of_the_parts_one_below_the_other() -> None:
    rows = Falls().rows()
    assert rows[:3] == ROWS
    assert math.isnan(rows[3]["y"])
    assert len(rows) == 4


def test_csv_reads_back_as_the_rows(tmp_path: Path) -> None:
    Falls().to_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        read = list(csv.DictReader(file))
    assert [{"name": row["name"], "t": float(row["t"]), "y": float(row["y"])} for row in read[:3]] == ROWS


def test_json_has_head_summary_and_rows_and_null_for_what_is_not_finite(tmp_path: Path) -> None:
    Falls().to_json(tmp_path / "t.json")
    read = json.loads((tmp_path / "t.json").read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert list(read) == ["dt", "summary", "rows"]
    assert read["summary"] == [{"lowest": None}]
    assert read["rows"] == [*ROWS, {"name": "b", "t": 1.0, "y": None}]


def test_a_row_that_lacks_a_column_leaves_it_empty(tmp_path: Path) -> None:
    columns = columns_of([{"a": 1}, {"a": None, "b": 2}])
    write_csv(columns, tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_bytes() == b"a,b\n1,\n,2\n"


@pytest.mark.parametrize("write", [write_csv, write_json])
def test_columns_of_unequal_length_or_no_json_leave_no_file(tmp_path: Path, write: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        write({"a": [1, 2], "b": [object()]}, tmp_path / "t")
    assert list(tmp_path.iterdir()) == []
