"""How rows and values are written to files."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .._checks import file
from .._files import replaced, write_text
from .data import finite


def write_csv(columns: Mapping[str, Iterable[Any]], path: str | Path) -> None:
    """Write columns of equal length under their names; every number reads back as itself."""
    with replaced(file("path", path)) as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def write_json(value: Any, path: str | Path) -> None:
    """Write a value; what is not finite is null."""
    write_text(file("path", path), json.dumps(finite(value), ensure_ascii=False, indent=1) + "\n")
