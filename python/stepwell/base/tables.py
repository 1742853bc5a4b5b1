"""How rows and values are written to files."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .checks import file
from .files import replaced, write_text


def write_csv(columns: Mapping[str, Iterable[Any]], path: str | Path) -> None:
    """Write columns of equal length under their names; every number reads back as itself."""
    with replaced(file("path", path)) as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def write_json(value: Any, path: str | Path) -> None:
    """Write a value; what is not finite is null."""
    write_text(file("path", path), json.dumps(finite(value), ensure_ascii=False, indent=1) + "\n")


def rows_to_csv(rows: list[dict[str, Any]], path: str | Path) -> None:
    """Write rows that share their columns."""
    columns = max(rows, key=len)
    with replaced(file("path", path)) as out:
        writer = csv.DictWriter(out, list(columns), restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def finite(value: Any) -> Any:
    """The same for JSON, which knows no infinity: None in its place."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
