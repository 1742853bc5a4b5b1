"""The comparison with other languages: it runs, and no speed stands without its error."""

import functools
import itertools
import json
import re
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support import ROOT
from support.cases import number

from benches import budget, gate, growth, roots
from benches.budget import Budget
from benches.compare import machine, peers, report, runner, workloads
from benches.compare.chosen import orbits, solar, tables
from benches.compare.chosen.contestants import Contestant as Adaptive
from benches.compare.own import first_call, tolerance
from benches.compare.own.equations import EQUATIONS, Equation
from benches.compare.peers import c_peer, heyoka_peer, jax_peer, numba_own, numba_peer, rebound_peer, scipy_peer, stepwell_peer

WORKS = [work.quick().cut(members=200) for work in workloads.catalogue()]


def named(each: workloads.Workload | peers.Contestant) -> str:
    return each.name if isinstance(each, peers.Contestant) else f"{each.name}-{each.kind}-{each.size.split()[0]}"


#: The first work of each kind; those that differ from it in their size alone are for the long run.
FIRST = {work.kind: work for work in reversed(WORKS)}
#: By default every contestant does so many works, and so many contestants every kind of work: most is for their compilers.
SEVERAL = 2


def able() -> Iterator[Any]:
    """Every contestant with every work that it can do."""
    pairs = [(each, work) for each in peers.catalogue() for work in WORKS if work.kind in each.kernels]
    chosen, times = set(), Counter[str]()
    for each, work in sorted(pairs, key=lambda pair: number(pair[0].name, pair[1].kind)):
        if work is FIRST[work.kind] and min(times[each.name], times[work.kind]) < SEVERAL:
            chosen.add((each.name, work.kind))
            times.update((each.name, work.kind))
    for each, work in pairs:
        quick = work is FIRST[work.kind] and (each.name, work.kind) in chosen
        yield pytest.param(each, work, marks=() if quick else pytest.mark.long)


@pytest.mark.parametrize(("contestant", "work"), list(able()), ids=named)
def test_every_contestant_is_as_right_as_its_method(contestant: peers.Contestant, work: workloads.Workload) -> None:
    if contestant.slow == "steps":
        work = work.cut(steps=200)
    if contestant.slow == "members" and not contestant.alike:
        work = work.cut(members=20)
    try:
        v, y = contestant.kernels[work.kind](work, True).call()
    except peers.MissingPeerError as why:
        pytest.skip(str(why))
    assert work.error(v, y) <= work.bound()
    if contestant.alike:
        # Same method, same work: what is left is rounding, and another sine.
        ours_v, ours_y = stepwell_peer.kernels()[work.kind](work, True).call()
        off = [abs(a.ravel() - b.ravel()).max(initial=0.0) for a, b in ((v, ours_v), (y, ours_y))]
        assert max(off) < work.rounding


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
    numba_own.compiled.cache_clear()
    jax_peer.modules.cache_clear()
    for name in ("rebound", "heyoka", "scipy", "scipy.integrate", "jax"):
        monkeypatch.setitem(sys.modules, name, None)
    absent = {
        c_peer: "no C compiler",
        numba_peer: "numba is not installed",
        rebound_peer: "REBOUND is not installed",
        numba_own: "numba is not installed",
        heyoka_peer: "heyoka is not installed",
        scipy_peer: "SciPy is not installed",
        jax_peer: "jax is not installed",
    }
    for module, why in absent.items():
        contestant = module.CONTESTANTS[0]
        able = [work for work in WORKS if work.kind in contestant.kernels]
        assert able
        for work in able:
            row, ready = runner.prepare(contestant, work, quick=True)
            assert (row.missing, ready) == (why, None)
    assert ("C", "no C compiler") in machine.describe()


OWN = [*EQUATIONS, first_call.ring(5)]


@pytest.mark.parametrize("equation", OWN, ids=[each.name for each in OWN])
def test_own_equations_are_the_same_for_stepwell_as_for_all_others(equation: Equation) -> None:
    rng = np.random.default_rng(3)
    state = np.array([rng.uniform(*bounds, 50) for bounds in equation.start.values()])
    own = [rng.uniform(*bounds, 50) for bounds in equation.own.values()]
    ours, t = equation.system.function, 0.7
    fixed = equation.system.parameters | dict(equation.shared)
    expected = np.empty_like(state)
    for k, s in enumerate(state.T):
        parameters = fixed | {name: row[k] for name, row in zip(equation.own, own, strict=True)}
        expected[:, k] = ours(t, s, **parameters) if equation.system.order == 1 else (ours(t, *s, **parameters), s[0])
    rates = np.array(equation.function(np)(t, state, own))
    # Up to 25 roundings of 1.1e-16 of terms up to 120·50 (the neuron's currents), otherwise of the size of the sums.
    largest = 6000.0 if equation.name == "hodgkin_huxley" else 100.0
    assert abs(rates - expected).max() <= 25 * 1.2e-16 * largest
    assert all(equation.system.parameters[name] == value for name, value in equation.shared.items())


def test_a_tolerance_is_the_coarsest_that_is_exact_enough() -> None:
    work = next(work for work in WORKS if work.kind == "own_lorenz")
    tolerances = []

    def off_by_the_tolerance(part: workloads.Workload, wanted: float) -> Any:
        tolerances.append(wanted)
        v, y = (block.copy() for block in part.exact())
        y[0] += wanted
        return v, y

    coarsest = tolerance.as_exact(work, off_by_the_tolerance)
    assert coarsest <= min(work.expected, work.cut(members=tolerance.TRIAL).expected)
    assert coarsest == next(each for each in tolerance.TOLERANCES if each <= work.cut(members=tolerance.TRIAL).expected)
    assert tolerances == sorted(tolerances, reverse=True)
    with pytest.raises(peers.WrongResultError):
        tolerance.as_exact(work, lambda part, wanted: off_by_the_tolerance(part, 1.0))


def test_own_equations_have_a_line_for_each_system_and_way_of_numba() -> None:
    work = next(work for work in WORKS if work.kind == "own_lorenz")
    names = [contestant.name for contestant in numba_own.CONTESTANTS]
    assert list(work.beside) == names
    rows = [runner.Row(name, amount=1.0, seconds=[seconds]) for name, seconds in zip(names, (1.0, 2.0, 4.0), strict=True)]
    _, head, lines = report.table(work, [*rows, runner.Row("other", amount=1.0, seconds=[0.5])])
    assert head[4:-1] == [f"÷ {name}" for name in names]
    assert lines[0][4:-1] == ["2.00", "4.00", "8.00"]
    title, head, lines = first_call.table(2, True, Budget(600.0))
    assert "Own equations" in title
    assert [(line[1], line[-2]) for line in lines] == [("3", "≤ 5"), ("10", "≤ 100")]
    for line in lines:
        assert len(line) == len(head)
        python, trace, code, together = map(float, line[2:6])
        assert together == pytest.approx(python + trace + code, rel=0.01)  # three digits of each
        assert min(python, trace, code) > 0


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


@pytest.mark.parametrize("only", [("W2", "chosen"), pytest.param(("",), marks=pytest.mark.long)], ids=["some", "all"])
def test_the_quick_run_writes_a_report(tmp_path: Path, only: tuple[str, ...]) -> None:
    out = tmp_path / "report.md"
    works = {type(work): work for work in reversed(workloads.catalogue()) if work.name.startswith(only)}.values()
    command: list[Any] = [sys.executable, "-m", "benches.compare", "--quick", "--only", ",".join(only), "-o", out]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    report = out.read_text(encoding="utf-8")
    lines = [cells(line) for line in report.splitlines() if line.startswith("|")]
    first_chosen = next(i for i, line in enumerate(lines) if line[1] == "1e-03")
    tables = [i for i, line in enumerate(lines[:first_chosen]) if line[0] == "contestant"]
    assert len(tables) == len(works) > 0
    units = {work.unit.name for work in works}
    head: list[str] = []
    for row in lines[first_chosen : next(i for i, line in enumerate(lines) if line[0] == "what")]:
        head = row if row[0] == "contestant" else head
        if "—" in row:
            assert row[-1]
        elif row[0].startswith("stepwell") and head[1].startswith("error after"):
            assert 0 < float(row[1]) < 1e-12  # a hundred years of the outer solar system, at rounding level
            assert float(row[2]) > 0
        elif row[0].startswith("stepwell"):
            assert float(row[1]) > 0
            assert float(row[-2]) >= 1
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
    assert {c.name for c in peers.catalogue() if any(work.kind in c.kernels for work in works)} <= rows
    assert {"wheel", "`import stepwell` after NumPy"} <= rows
    assert sw.isa() in report
    assert "\n## Left out\n\n- of a quick run, all but the first work of a class" in report


def test_who_does_not_end_is_ended_and_who_is_not_installed_is_not_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred million years take hours; a process of its own has some seconds, most of which its imports may need."""
    begin = time.perf_counter()
    measured = solar.measured("stepwell taylor", (10.0, 1e8), 3.0)
    assert time.perf_counter() - begin < 20.0
    assert len(measured) <= 1
    monkeypatch.setattr(solar, "BUDGET", 3.0)
    _, head, lines = solar.table((1.0, 1e8), Budget(600.0))
    row = next(line for line in lines if line[0] == "stepwell taylor")
    assert row[-3:] == ["—", "—", "stopped after 3 s"]
    assert len(row) == len(head)
    # And what fails is not taken for missing.
    monkeypatch.setattr(solar, "contestants", lambda: {"heyoka": None, "nobody": None})
    if find_spec("heyoka") is None:
        assert solar.measured("heyoka", (1.0,), 60.0) is None
    with pytest.raises(RuntimeError, match="nobody"):
        solar.measured("nobody", (1.0,), 60.0)


def forever(*_: Any) -> Any:
    """Runs away, and would not be stopped by an exception."""
    while True:
        try:
            time.sleep(0.001)
        except Exception:
            continue


def finds(*_: Any) -> peers.Ready:
    """Does its work, and warns of it."""
    work = WORKS[0]

    def call() -> Any:
        warnings.warn("as it stands", sw.StiffnessWarning, stacklevel=1)
        return work.exact()

    return peers.Ready(call)


def test_who_runs_away_from_a_work_is_stopped_and_the_others_are_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "AGAIN", 0.01)
    work = WORKS[0]
    away = [peers.Contestant(name, {work.kind: forever}) for name in ("away", "away, too")]
    calls = itertools.count()
    late = peers.Contestant("late", {work.kind: lambda *_: peers.Ready(lambda: work.exact() if next(calls) < 2 else forever())})
    contestants = [away[0], peers.Contestant("finds", {work.kind: finds}), away[1]]
    rows = {row.name: row for row in runner.measure(contestants, work, 2, True, Budget(2.0, 3))}
    assert rows["finds"].seconds
    assert rows["finds"].note == "1 finding: stiffness"
    text = report.markdown(*report.table(work, list(rows.values())))
    for name in ("away", "away, too"):
        assert rows[name].missing.startswith("stopped after ")
        assert re.search(rf"^\| {name} \| — .* \| stopped after \S+ s \|$", text, re.MULTILINE)
    (row,) = runner.measure([late], work, 2, True, Budget(0.3))
    assert row.missing.startswith("stopped after ")


def test_other_warnings_are_errors() -> None:
    work = WORKS[0]

    def warns(*_: Any) -> Any:
        warnings.warn("a mistake", RuntimeWarning, stacklevel=1)

    with pytest.raises(RuntimeWarning, match="a mistake"):
        runner.measure([peers.Contestant("warns", {work.kind: warns})], work, 1, True, Budget(60.0))


def test_who_runs_away_from_orbits_is_stopped_and_findings_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    def until(tolerance: float) -> Any:
        return lambda some: lambda wanted: some.y + wanted if wanted > tolerance else forever()

    def finding(some: orbits.Orbits) -> Any:
        def solve(tolerance: float) -> Any:
            if tolerance == tables.TOLERANCES[0]:
                warnings.warn("as it stands", sw.StiffnessWarning, stacklevel=1)
            return some.y + tolerance

        return solve

    three = [Adaptive("away", until(1.0)), Adaptive("half", until(1e-6)), Adaptive("finds", finding)]
    absent = Adaptive("absent", until(1.0), missing="absent is not installed")
    monkeypatch.setattr(tables, "contestants", lambda: iter([*three, absent]))
    made = tables.table(orbits.kepler(2, 1), 3, (1e-3, 1e-6), True, Budget(2.0))
    lines = {line[0]: line[1:] for line in made[2]}
    assert lines["finds"][-1] == "1 finding: stiffness"
    assert "—" not in lines["finds"]
    for name, dashes in (("away", 3), ("half", 1), ("absent", 3)):
        assert lines[name].count("—") == dashes
    assert lines["away"][-1].startswith("stopped after ")
    assert lines["half"][-1].startswith("stopped after ")
    left_out = report.left_out(report.markdown(*made))
    assert re.findall(r"^- ([^:]+): ([a-z ]+)", left_out, re.MULTILINE) == [
        ("away", "stopped after "),
        ("half, 1e-06", "stopped after "),
        ("absent", "absent is not installed "),
    ]


def test_all_that_was_left_out_is_listed_and_what_is_done_again_replaced() -> None:
    head = ["contestant", "G steps/s", "min … max", "error", "÷ C", "remarks"]
    right = ["stepwell", "1", "1 … 1", "1e-03", "—", ""]
    absent, wrong = (["C", *["—"] * 4, "no C compiler"], ["numba", *["—"] * 4, "not timed: error 1"])
    parts = [report.markdown("W1", head, [right, absent, wrong]), report.markdown("W2", head, [right, absent])]
    parts.append(report.markdown("Chosen", ["contestant", "1e-03", "1e-06", "remarks"], [["merson", "1", "—", ""]]))
    text = "\n".join(["- left out: what is not quick", "", *parts])
    assert report.left_out(text).splitlines()[2:] == [
        "- what is not quick",
        "- C: no C compiler (W1; W2)",
        "- numba: not timed: error 1 (W1)",
        "- merson, 1e-06: not as exact, or not in time (Chosen)",
    ]
    assert report.left_out(report.markdown("W1", head, [right])).splitlines()[2:] == ["Nothing."]
    before = "# Title\n\n- date: 1999-01-01\n\n## How to read\n\nText.\n\n## W1: old\n\n| 1 |\n\n## W2: kept\n\n| 2 |\n"
    now = "# Title\n\n- date: 2000-01-01\n\n## How to read\n\nText.\n\n## W1: old\n\n| 3 |\n\n## W3: new\n\n| 4 |\n"
    text = report.renewed(before, now, "W1,W3")
    assert text == (
        "# Title\n\n- date: 1999-01-01\n- done again in a run of their own, 2000-01-01: W1,W3\n\n## How to read\n\nText.\n\n"
        "## W1: old\n\n| 3 |\n\n## W2: kept\n\n| 2 |\n\n## W3: new\n\n| 4 |\n"
    )
    assert report.renewed(text, now, "W1,W3") == text


def test_the_gate_fails_where_all_of_the_spread_is_too_low_and_a_part_leaves_what_it_does_not_need() -> None:
    whole = Budget(100.0, 10)
    assert whole.part().seconds == pytest.approx(10.0 * budget.SHARES, abs=1.0)
    for _ in range(8):
        assert whole.part().seconds <= 51.0
    assert whole.part().seconds == pytest.approx(100.0, abs=1.0)
    assert Budget(0.0).part().seconds == 0.0
    expected = {"level": 1.0, "slower": 1.0, "unsure": 2.0}
    measured = {"level": [0.91, 0.95, 1.2], "slower": [0.8, 0.85, 0.89], "unsure": [1.0, 1.1, 2.9], "new": [0.1]}
    lines = {line[0]: (line[-1], failed) for line, failed in gate.judged(measured, expected)}
    assert lines == {"level": ("", False), "slower": ("fails", True), "unsure": ("", False), "new": ("", False)}
    kept = json.loads(gate.KEPT.read_text(encoding="utf-8"))
    assert len(gate.ROWS) == 10
    assert all(list(level["ratios"]) == list(gate.ROWS) for level in kept.values())


@pytest.mark.parametrize("slower", [1, 3])
def test_the_gate_ends_with_what_it_found(slower: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def work() -> None:
        sum(range(20_000))

    def ours() -> None:
        for _ in range(slower):
            work()

    monkeypatch.setattr(gate, "ROWS", {"a row": lambda: (ours, work)})
    monkeypatch.setattr(gate, "KEPT", tmp_path / "gate.json")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    gate.KEPT.write_text(json.dumps({sw.isa(): {"machine": "this one", "ratios": {"a row": 0.8}}}), encoding="utf-8")
    assert gate.main([]) == (slower > 1)
    assert "| a row | " in (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert gate.main(["--keep"]) == 0


def test_pictures_are_drawn_of_what_was_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "IMAGES", tmp_path)
    growth.draw(json.loads(growth.NUMBERS.read_text(encoding="utf-8")))
    roots.draw(tmp_path / "inverse-cube.png")
    assert {path.name for path in tmp_path.iterdir()} == {"inverse-cube.png", *(f"growth-{name}.png" for name in growth.AXES)}
