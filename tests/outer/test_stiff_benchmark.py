"""The benchmark of stiff systems: its truth is the published one, and all contestants solve the same problems."""

import dataclasses
import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.stiff_problems import PROBLEMS as PUBLISHED

from benches.stiff import __main__ as stiff
from benches.stiff import contestants, diffsl, measuring, page, problems
from benches.stiff.contestants import OURS, PEERS, Contestant, Setting
from benches.stiff.problems import PROBLEMS, Problem

ROBER, OREGO, HIRES, VAN_DER_POL = PROBLEMS
#: Of the test set for initial value problems. Its Van der Pol has a time of its own, in which y′ is a thousand times as large.
KNOWN = {
    "ROBER": (dataclasses.replace(ROBER, end=1e5), PUBLISHED["rober"].values[1e5]),
    "OREGO": (OREGO, [1.000814870318523, 1228.178521549917, 132.0554942846706]),
    "HIRES": (HIRES, PUBLISHED["hires"].values[321.8122]),
    "Van der Pol": (VAN_DER_POL, list(np.array(PUBLISHED["van der Pol"].values[2.0]) * [1.0, 1e-3])),
}


@pytest.mark.parametrize("name", KNOWN)
def test_true_ends_are_the_published_ones(name: str) -> None:
    problem, published = KNOWN[name]
    ends = contestants.stepwells(problem)(problem.parameters(1), Setting("rodas5p", problems.TRUTH))
    assert ends[:, 0] == pytest.approx(published, rel=2e-10)


#: One of them is no wheel: pip builds it, which takes a Fortran compiler.
BUILT = ("numbalsoda",)


@pytest.mark.parametrize(
    "contestant",
    [each for each in (OURS, *PEERS) if each.name not in BUILT or importlib.util.find_spec(each.name)],
    ids=lambda each: each.name,
)
def test_all_contestants_solve_the_same_problem(contestant: Contestant) -> None:
    if (missing := measuring.warmed_up(contestant)) is not None:
        pytest.skip(missing)
    problem = dataclasses.replace(HIRES, end=50.0)
    solve = contestant.make(problem)
    for method in contestant.methods:
        setting = Setting(method, 1e-5 if method in ("rosenbrock23", "tr_bdf2") else 1e-7)
        assert problem.error(solve(problem.parameters(3), setting)) < 1e-4, method
        assert solve(problem.parameters(1), setting).shape == (8, 1)


def test_members_are_the_same_in_every_batch_and_the_worst_component_counts() -> None:
    many, few = OREGO.parameters(100), OREGO.parameters(7)
    assert np.array_equal(many[:, :7], few)
    assert np.array_equal(OREGO.parameters(1)[:, 0], list(OREGO.published.values()))
    assert 0.0 < abs(many / OREGO.parameters(1) - 1.0).max() <= problems.SPREAD
    problem = dataclasses.replace(VAN_DER_POL, end=10.0)
    off = problem.truth.copy()
    assert problem.error(off) == 0.0
    off[1, :4] += 1e-3 * (abs(off[1, :4]) + problem.sizes[1])
    assert problem.error(off[:, :4]) == pytest.approx(1e-3)
    assert problem.error(off) == pytest.approx(1e-3 * (4 / problems.SAMPLED) ** 0.5)
    assert problem.error(np.full_like(off, np.nan)) == float("inf")


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda each: each.name)
def test_the_language_of_pydiffsol_has_the_same_rates(problem: Problem) -> None:
    text = diffsl.text(problem)
    state = np.random.default_rng(1).uniform(0.1, 2.0, len(problem.start)).tolist()
    scope = problem.published | {f"x{i}": number for i, number in enumerate(state)}
    found = [eval(line.strip(" ,"), scope) for line in text.split("F_i {\n")[1].splitlines()[:-1]]
    assert found == pytest.approx(problem.rates(0.0, state, **problem.published))


def point(method: str, error: float, seconds: float) -> measuring.Point:
    return measuring.Point(Setting(method, 1e-3), error, seconds)


def test_the_cheapest_that_is_exact_enough_is_chosen() -> None:
    tried = point("a", 1e-2, 1.0), point("b", 1e-4, 3.0), point("c", 9e-4, 2.0), point("d", 1e-8, 9.0)
    assert [each and each.method for each in (measuring.cheapest(tried, aim) for aim in (1e-3, 1e-6, 1e-9))] == ["c", "d", None]
    tolerances = []

    def solve(parameters: Any, setting: Setting) -> Any:
        tolerances.append(setting.tolerance)
        if setting.tolerance > 2e-3:
            raise RuntimeError("did not come to the end")
        return HIRES.truth[:, : parameters.shape[1]] * (1.0 + setting.tolerance)

    tried = list(measuring.points(Contestant("one", "one", lambda _: solve, ("only",), 4, 4), solve, HIRES, 1e-6))
    assert tried[0].setting.tolerance == pytest.approx(1e-3)
    assert [each.error > 1e-6 for each in tried] == [True] * (len(tried) - 1) + [False]
    assert min(tolerances) == tried[-1].setting.tolerance


def row(batch: list[list[float]], missing: str = "") -> dict[str, Any]:
    chosen = [["only", 1e-3, 1.0] if times else None for times in batch]
    points = [[["only", 1e-3, 1.0], 1e-4, 1.0]]
    return {"missing": missing, "first": 0.5, "members": 7, "points": points, "chosen": chosen, "batch": batch, "one": batch}


def test_the_page_compares_with_the_best_peer(tmp_path: Path) -> None:
    rows = {"stepwell": row([[1e-6, 2e-6], [1e-6]]), "slow": row([[9e-6, 9e-6], []]), "fast": row([[4e-6, 4e-6], []])}
    rows["absent"] = row([], "absent is not installed") | {"points": []}
    known = {"machine": "This one.", "aims": [1e-3, 1e-6], "problems": {"HIRES": rows}}
    assert (page.compared(rows, "batch", 0), page.compared(rows, "batch", 1)) == ("**3** (2 … 4), fast", "—")
    written = tmp_path / "page.md"
    written.write_text("# Stiff\n<!-- measured: stiff -->\nold\n<!-- end measured -->\nend\n", encoding="utf-8")
    page.write(known, written)
    text = written.read_text(encoding="utf-8")
    assert "| slow | 500 | 7 | 9 | — | 9 | — |" in text
    assert "| absent | — | — | — | — | — | absent is not installed |" in text
    assert "old" not in text
    assert text.endswith("<!-- end measured -->\nend\n")
    copy = tmp_path / "page.md"
    copy.write_text(page.PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    page.write(json.loads((stiff.HERE / "numbers.json").read_text(encoding="utf-8")), copy)
    assert copy.read_text(encoding="utf-8") == page.PAGE.read_text(encoding="utf-8")


def test_a_quick_run_writes_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("scipy")
    absent = Contestant("absent", "absent", lambda _: __import__("no_such_solver"), ("none",), 1, 1)
    scipy = next(each for each in PEERS if each.name == "SciPy")._replace(methods=("LSODA",))
    monkeypatch.setattr(measuring, "PEERS", [scipy, absent])
    monkeypatch.setattr(stiff, "PROBLEMS", [dataclasses.replace(HIRES, end=20.0)])
    monkeypatch.setattr(measuring.os, "sched_setaffinity", lambda *_: None, raising=False)
    written = tmp_path / "page.md"
    written.write_text("<!-- measured: stiff -->\n<!-- end measured -->", encoding="utf-8")
    files = ["--numbers", str(tmp_path / "a.json"), "--page", str(written), "--picture", str(tmp_path / "a.png")]
    stiff.main(["--quick", *files])
    rows = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["problems"]["HIRES"]
    for name in ("stepwell", "SciPy"):
        assert rows[name]["batch"][0][0] > 0.0
        assert min(error for setting, error, _ in rows[name]["points"] if setting == rows[name]["chosen"][0]) <= 1e-3
    assert rows["absent"]["missing"] == "no_such_solver is not installed"
    assert "a quick run" in written.read_text(encoding="utf-8")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    before = written.read_text(encoding="utf-8")
    stiff.main(["--quick", "--draw", *files])
    assert written.read_text(encoding="utf-8") == before
    stiff.main(["--quick", "--peers", "absent", *files])
    again = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["problems"]["HIRES"]
    assert again["SciPy"] == rows["SciPy"]
    assert again["stepwell"]["batch"] != rows["stepwell"]["batch"]
