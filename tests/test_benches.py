"""The comparison with other languages: it runs, and no speed stands without its error."""

from __future__ import annotations

import functools
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import stepwell as sw

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from benches.compare import machine, peers, runner, workloads  # noqa: E402
from benches.compare.peers import c_peer, numba_peer, rebound_peer, stepwell_peer  # noqa: E402

WORKS = [work.quick().cut(members=200) for work in workloads.catalogue()]


def named(each: workloads.Workload | peers.Contestant) -> str:
    return each.name if isinstance(each, peers.Contestant) else f"{each.name}-{each.kind}-{each.size.split()[0]}"


#: The first work of each kind for everybody; works that differ from it in their size alone are for the long run.
FIRST = {work.kind: work for work in reversed(WORKS)}
ABLE = [
    pytest.param(contestant, work, marks=() if work is FIRST[work.kind] else pytest.mark.long)
    for contestant in peers.catalogue()
    for work in WORKS
    if work.kind in contestant.kernels
]


@pytest.mark.parametrize(("contestant", "work"), ABLE, ids=named)
def test_every_contestant_is_as_right_as_its_method(contestant: peers.Contestant, work: workloads.Workload) -> None:
    if contestant.slow == "steps":
        work = work.cut(steps=200)
    try:
        v, y = contestant.kernels[work.kind](work, True).call()
    except peers.MissingPeerError as why:
        pytest.skip(str(why))
    assert work.error(v, y) <= work.bound()
    if contestant.alike:
        # Same method, same work: what is left is rounding, a few thousand operations of 1e-16 each, and another sine.
        ours_v, ours_y = stepwell_peer.kernels()[work.kind](work, True).call()
        assert max(abs(v.ravel() - ours_v.ravel()).max(), abs(y.ravel() - ours_y.ravel()).max()) < 1e-11


@pytest.mark.parametrize("work", WORKS, ids=named)
def test_who_is_wrong_is_not_timed(work: workloads.Workload) -> None:
    system, _ = stepwell_peer.SYSTEMS[work.kind]
    another_method = functools.partial(stepwell_peer.made, system, "standard_euler", {})
    row, ready = runner.prepare(peers.Contestant("wrong", {work.kind: another_method}), work, quick=True)
    assert ready is None
    assert row.missing.startswith("not timed: error")


def test_a_missing_peer_is_a_row_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setitem(sys.modules, "numba", None)
    c_peer.library.cache_clear()
    numba_peer.compiled.cache_clear()
    c_peer.vectors_of_512.cache_clear()
    monkeypatch.setitem(sys.modules, "rebound", None)
    absent = {c_peer: "no C compiler", numba_peer: "numba is not installed", rebound_peer: "REBOUND is not installed"}
    for module, why in absent.items():
        contestant = module.CONTESTANTS[0]
        able = [work for work in WORKS if work.kind in contestant.kernels]
        assert able
        for work in able:
            row, ready = runner.prepare(contestant, work, quick=True)
            assert (row.missing, ready) == (why, None)
    assert ("C", "no C compiler") in machine.describe()


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


@pytest.mark.parametrize("only", [("W2", "chosen"), pytest.param(("",), marks=pytest.mark.long)], ids=["some", "all"])
def test_the_quick_run_writes_a_report(tmp_path: Path, only: tuple[str, ...]) -> None:
    out = tmp_path / "report.md"
    asked = [work for work in workloads.catalogue() if work.name.startswith(only)]
    command: list[Any] = [sys.executable, "-m", "benches.compare", "--quick", "--only", ",".join(only), "-o", out]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    report = out.read_text(encoding="utf-8")
    lines = [cells(line) for line in report.splitlines() if line.startswith("|")]
    first_chosen = next(i for i, line in enumerate(lines) if line[1] == "1e-03")
    tables = [i for i, line in enumerate(lines[:first_chosen]) if line[0] == "contestant"]
    assert len(tables) == len(asked) > 0
    units = {work.unit.name for work in asked}
    for row in lines[first_chosen : next(i for i, line in enumerate(lines) if line[0] == "what")]:
        if row[0].startswith("stepwell"):
            assert float(row[1]) > 0
            assert float(row[-1]) >= 1
    chosen = {row[0] for row in lines[first_chosen:]}
    assert {f"stepwell {m.name}" for m in sw.methods() if m.error_order is not None} <= chosen
    for row in lines[:first_chosen]:
        if row[0] == "contestant":
            assert row[1] in units
            assert row[2:4] == ["min … max", "error"]
        elif not row[0].startswith("---") and row[1] != "—":
            assert float(row[1]) > 0
            assert re.fullmatch(r"\d\.\de-\d\d", row[3]), row
    rows = {row[0] for row in lines}
    assert {c.name for c in peers.catalogue() if any(work.kind in c.kernels for work in asked)} <= rows
    assert {"wheel", "`import stepwell` after NumPy"} <= rows
    assert sw.isa() in report
