"""Sweeps, ``solve_ivp`` and the command line say that a run was stiff, too: once, with the limit and the method to take."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.model.methods import for_stiff
from stepwell.studies.sweeps import task
from support.commands import run_command
from support.stiff import EXPLICIT, follows

RATES = np.array([1.0, 1000.0, 1.5, 2000.0])
#: Rates of the error against the cosine, and its turn back in time.
FORWARD, BACK = (lambda t, y: -1000.0 * (y - np.cos(t))), (lambda t, y: 1000.0 * (y - np.cos(t)))


def said(make: Callable[[], Any], category: type[Warning] = sw.StiffnessWarning) -> list[str]:
    """The warnings of a class; each is said as of this file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make()
    assert all(each.filename == __file__ for each in caught)
    return [str(each.message) for each in caught if each.category is category]


def sweep(**options: Any) -> Any:
    arguments: dict[str, Any] = {"y": 1.0, "tolerance": 1e-4, "at": np.linspace(0.5, 10.0, 20)} | options
    return sw.sweep(follows, {"k": RATES}, arguments.pop("method", "merson"), **arguments)


# ---- sweeps


def test_a_sweep_says_it_once() -> None:
    """With what the run of the first stiff member says."""
    (alone,) = said(lambda: sw.integrate(follows(k=1000.0), "merson", y=1.0, tolerance=1e-4, at=[10.0]))
    why = alone.partition("the run: ")[2]
    for options in ({}, {"chunk": 1}, {"chunk": 3, "threads": 1}, {"outcomes": [lambda run: {"end": run.y[-1]}]}):
        (text,) = said(lambda options=options: sweep(**options))
        assert (
            text
            == f"stability, and not the tolerance, held down the steps of 2 of 4 members, the first of them at k = 1000: {why}"
        )
    (text,) = said(lambda: sw.sweep(follows, {"k": RATES[:2]}, "merson", y=1.0, tolerance=1e-4, at=[10.0]))
    assert "of 1 of 2 members, that at k = 1000: the fastest" in text


def test_a_sweep_in_pieces_knows_where_its_members_stood(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most pieces come to no number of steps that is a power of two."""
    whole = said(sweep)
    monkeypatch.setattr(task.Task, "states_at_once", lambda *_: 1)
    assert said(sweep) == whole
    assert len(whole) == 1


def test_a_sweep_in_other_processes_says_it(tmp_path: Any) -> None:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as engine:
        assert said(lambda: sweep(engine=engine, chunk=2, store=tmp_path / "stiff.nc")) == said(sweep)
    assert said(lambda: sweep(store=tmp_path / "stiff.nc", chunk=2)) == []  # all chunks are there already


def test_a_sweep_that_runs_out_of_steps_says_why() -> None:
    (text,) = said(lambda: sweep(max_steps=2500), sw.ToleranceWarning)
    (alone,) = said(
        lambda: sw.integrate(follows(k=1000.0), "merson", y=1.0, tolerance=1e-4, at=np.linspace(0.5, 10.0, 20), max_steps=2500),
        sw.ToleranceWarning,
    )
    assert text.startswith(
        "2 of 4 members stopped before t = 10, the first of them at k = 1000: out of max_steps: 2500 attempts, "
    )
    assert alone.partition("out of")[2] in text
    assert "held down by stability and not by accuracy: the fastest rate there, 1/0.001, lets no steps beyond 0.00355" in text
    (text,) = said(
        lambda: sw.sweep(
            sw.Oscillator, {"omega": [1.0, 14.0]}, "merson", v=0.0, y=1.0, tolerance=1e-9, at=[40.0], max_steps=2000
        ),
        sw.ToleranceWarning,
    )
    assert "on average, not held down by stability; max_steps= allows more; status tells" in text


def test_a_sweep_looks_only_if_it_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task.Pieces, "stiff", lambda _: pytest.fail("it looks"))
    with pytest.raises(pytest.fail.Exception):
        sweep()
    monkeypatch.undo()
    looks: list[bool] = []
    run = task.run
    monkeypatch.setattr("stepwell.studies.sweeps.engines.run", lambda each, *rest: looks.append(each.looks) or run(each, *rest))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.StiffnessWarning)
        sweep()
    sweep(method="rodas4")
    sw.sweep(follows, {"k": RATES[:1]}, "merson", y=1.0, dt=1e-3, steps=2)
    assert looks == [False] * len(looks)
    assert looks


# ---- solve_ivp


def test_solve_ivp_says_what_integrate_says() -> None:
    """With its own steps, at times, with dense output, with events, back in time, and with a tolerance of each component."""
    for end, options in (
        (14.0, {}),
        (14.0, {"t_eval": [1.0, 14.0]}),
        (14.0, {"dense_output": True}),
        (14.0, {"events": lambda t, y: y[0] - 0.5}),
        (-14.0, {}),
        (14.0, {"rtol": np.array([1e-4])}),
    ):
        rates = FORWARD if end > 0.0 else BACK
        (text,) = said(lambda: sw.solve_ivp(rates, (0.0, end), [1.0], **{"rtol": 1e-4, "atol": 1e-7} | options))  # noqa: B023
        system = sw.system(order=1)(rates)()
        (same,) = said(lambda: sw.integrate(system, "dop853", y=np.ones(1), tolerance=(1e-4, 1e-7), at=[end]))  # noqa: B023
        assert text == same.replace("the only member", "the run"), (end, options)


def test_solve_ivp_says_nothing_of_what_is_tame() -> None:
    assert said(lambda: sw.solve_ivp(FORWARD, (0.0, 14.0), [1.0], method="rodas4")) == []
    assert said(lambda: sw.solve_ivp(FORWARD, (0.0, 2.0), [1.0])) == []  # 500 steps
    assert said(lambda: sw.solve_ivp(lambda t, y: [y[1], -y[0]], (0.0, 2500.0), [1.0, 0.0], rtol=1e-6)) == []


# ---- the command line


def test_the_command_says_it_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("run", "oscillator", "--set", "damping=500", "--tolerance", "1e-5", "--method")
    code, _, err = run_command(capsys, *words, "merson")
    assert code == 0
    assert err.count("\n") == 1
    assert err.startswith(
        "stepwell: warning: stability, and not the tolerance, held down the steps of the run: the fastest rate at"
    )
    assert err.endswith('"rodas5p" is stable there\n')
    assert run_command(capsys, *words, "rodas5p")[2] == ""


# ---- which method to take


def test_the_method_goes_by_the_tolerance() -> None:
    """What it names is implicit; explicit methods have a limit, by their records."""
    names = {digits: getattr(for_stiff(10.0**-digits), "name", "") for digits in range(1, 13)}
    assert names == {1: "rosenbrock23", 2: "rosenbrock23", 3: "rodas4", 4: "rodas4"} | dict.fromkeys(range(5, 13), "rodas5p")
    assert all(sw.method(name).is_implicit for name in names.values())
    assert [m.name for m in sw.methods() if m.is_always_stable] == [m.name for m in sw.methods() if m.is_implicit]
    assert not any(sw.method(name).is_always_stable for name in EXPLICIT)


def test_the_method_named_needs_few_evaluations() -> None:
    """No method for stiff equations takes less than four fifths of them on the three test problems together."""
    from support.stiff_problems import PROBLEMS

    for digits in (2, 4, 6):
        cost: dict[str, int] = {}
        for method in ("rosenbrock23", "rodas4", "rodas5p"):
            for problem in (PROBLEMS["rober"], PROBLEMS["hires"], PROBLEMS["oregonator"]):
                tolerance = 10.0**-digits, problem.least * 10.0**-digits
                run = sw.integrate(problem.system, method, y=problem.start, tolerance=tolerance, at=[max(problem.values)])
                cost[method] = cost.get(method, 0) + int(run.paces.evaluations)
        best = for_stiff(10.0**-digits)
        assert cost[best.name] <= 1.25 * min(cost.values()), (digits, cost)
