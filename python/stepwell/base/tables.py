"""Results as tables: rows for programs, CSV and JSON."""

from __future__ import annotations

import csv
import json
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import reprs
from .files import replaced, write_text
from .paths import file

Columns = Mapping[str, Sequence[Any]]


class Table(ABC):
    """A result with rows and a summary, written as CSV and JSON."""

    @abstractmethod
    def _columns(self) -> Columns:
        """The columns by name, of equal length."""

    def _head(self) -> dict[str, Any]:
        """The entries of the JSON before the summary and the rows."""
        return {}

    @abstractmethod
    def summary(self) -> Any:
        """The result in a few numbers."""

    def rows(self) -> list[dict[str, Any]]:
        """The rows of the table, each by the names of its columns."""
        columns = self._columns()
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def _repr_html_(self) -> str:
        """The first rows as a table, for notebooks."""
        columns = self._columns()
        rows = [[reprs.cell(value) for value in row] for row in zip(*columns.values(), strict=True)]
        return reprs.table(type(self).__name__, list(columns), rows)

    def as_dict(self) -> Any:
        """All of it for programs: the head, the summary and the rows."""
        return self._head() | {"summary": self.summary(), "rows": self.rows()}

    def to_csv(self, path: str | Path) -> None:
        """Write ``rows()``, one line each. Every number reads back as itself, and None is empty."""
        write_csv(self._columns(), path)

    def to_json(self, path: str | Path) -> None:
        """Write ``as_dict()``; infinities and NaN become null."""
        write_json(self.as_dict(), path)


def stacked(parts: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """The columns of parts with equal names, one part below the other.

    The arrays of a part are columns of one length; any other value is repeated in each of the part's rows.
    """
    columns: dict[str, list[Any]] = {}
    for part in parts:
        length = next(len(value) for value in part.values() if isinstance(value, np.ndarray))
        for name, value in part.items():
            columns.setdefault(name, []).extend(value.tolist() if isinstance(value, np.ndarray) else [value] * length)
    return columns


def columns_of(rows: Sequence[Mapping[str, Any]]) -> Columns:
    """The columns of rows; where a row lacks a value, the column is empty."""
    return {name: [row.get(name, "") for row in rows] for name in max(rows, key=len)}


def write_csv(columns: Mapping[str, Iterable[Any]], path: str | Path) -> None:
    """Write columns of equal length under their names; every number reads back as itself."""
    with replaced(file("path", path)) as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def json_text(value: Any) -> str:
    """A value as JSON; infinities and NaN become null."""
    return json.dumps(finite(value), ensure_ascii=False, indent=1)


def write_json(value: Any, path: str | Path) -> None:
    """Write a value as JSON; infinities and NaN become null."""
    write_text(file("path", path), json_text(value) + "\n")


def finite(value: Any) -> Any:
    """The value with None in place of infinities and NaN, which JSON does not have."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
