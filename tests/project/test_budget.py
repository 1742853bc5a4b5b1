"""The budget of lines is kept, and a number too many is noticed."""

import sys
import tomllib

from support import ROOT

sys.path.append(str(ROOT / ".ci"))
import budget


def test_a_line_too_many_is_noticed() -> None:
    """In a layer, in all, and in a layer that has no number."""
    limits = tomllib.loads((ROOT / ".ci/budget.toml").read_text(encoding="utf-8"))
    measured = list(budget.lines())
    counts = {(table, name): number for table, name, number in measured}
    assert counts["lines.package", "runs"] > 1000
    assert counts["lines.tests", "in all"] > sum(1 for _ in (ROOT / "tests").rglob("test_*.py"))
    assert budget.above(limits, measured) == []
    for table, name in (("package", "runs"), ("rust", "core/src/tape"), ("tests", "in all")):
        number = counts[f"lines.{table}", name]
        limits["lines"][table][name] = number - 1
        expected = f".ci/budget.toml allows {number - 1} of lines.{table}, {name}, and there are {number}"
        assert budget.above(limits, measured) == [expected]
        del limits["lines"][table][name]
        assert budget.above(limits, measured) == [expected.replace(f"allows {number - 1}", "allows 0")]
        limits["lines"][table][name] = number
