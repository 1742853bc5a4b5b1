"""A run whose steps are held down by stability, and not by accuracy, says so; no other does."""

import itertools
import re
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from math import factorial, prod
from multiprocessing import get_context
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.model import methods as all_methods
from stepwell.model.methods import for_stiff
from stepwell.runs import engine
from stepwell.runs.adaptive import adaptive_run
from stepwell.runs.execution import quietly
from stepwell.runs.findings import stiffness
from stepwell.runs.options import Options
from stepwell.runs.request import Request
from stepwell.studies.sweeps import task
from support import heard
from support.commands import run_command
from support.stiff import EXPLICIT, PROBLEMS, follows, hires, lorenz, robertson, tame, van_der_pol
from support.stiff_problems import PROBLEMS as STIFF

TOLERANCES = [(1e-3, 1e-6), (1e-6, 1e-9)]
LIMIT = re.compile(r"the fastest rate (?:at t = (\S+)|there), 1/(\S+), lets no steps beyond (\S+) be stable")
RATIO = re.compile(r"tolerance allows (?:about (\d+)|more than 1000) times as long")


def told(**arguments: Any) -> tuple[sw.Run, list[str]]:
    """The run and what it warned of stiffness."""
    run, texts = heard.told(sw.integrate, arguments.pop("system"), arguments.pop("method"), **arguments)
    return run, [text for text in texts if "held" in text and "not held down" not in text]


@pytest.mark.parametrize("name", PROBLEMS)
def test_stiff_problems_say_so(name: str) -> None:
    """With the ratio, and with the limit that ``stability_limit`` has for the fastest rate at the state."""
    for method, tolerance in itertools.product(EXPLICIT, TOLERANCES if name != "net" else [(1e-3, 1e-4)]):
        says_so(name, method, tolerance)  # the net's springs have something to do below that tolerance


def says_so(name: str, method: str, tolerance: Any) -> None:
    run, texts = told(method=method, tolerance=tolerance, **{"max_steps": 60_000} | PROBLEMS[name])
    assert len(texts) == 1, (method, tolerance)
    (text,) = texts
    match, ratio = LIMIT.search(text), RATIO.search(text)
    assert ratio[1] is None or int(ratio[1]) >= 5
    assert "(stiff equations" in text
    stopped = bool(run.status == sw.Status.BUDGET)
    assert text.startswith(
        "the run stopped before" if stopped else "stability, and not the tolerance, held down the steps of the"
    )
    if stopped:
        assert f"60000 attempts, {int(run.paces.rejected)} of them rejected, steps of" in text
        assert f"at t = {float(run.paces.t):g}; out of max_steps" in text
    where = run.controller_state
    if match[1] in (None, f"{float(run.paces.t):g}"):
        values = sw.jacobian(run.system, v=where.v, y=where.y, t=float(run.paces.t)).eigenvalues
        fastest = values[np.abs(values).argmax()]
        assert match[2] == f"{1.0 / abs(fastest):.3g}"


@pytest.mark.parametrize(
    ("name", "method"), [("ROBER", "merson"), ("HIRES", "merson"), ("OREGO", "dop853"), ("linear", "dop853")]
)
def test_the_limit_is_that_of_stability_limit_at_the_state(name: str, method: str) -> None:
    run, (text,) = told(method=method, tolerance=(1e-5, 1e-9), **{"max_steps": 60_000} | PROBLEMS[name])
    where, match = run.controller_state, LIMIT.search(text)
    assert match[1] in (None, f"{float(run.paces.t):g}")
    limit = float(sw.stability_limit(run.system, method, v=where.v, y=where.y, t=float(run.paces.t)))
    assert float(match[3]) == pytest.approx(limit, rel=0.005)  # it is told with three digits


def test_the_limit_of_a_series_is_that_of_its_order() -> None:
    """The first terms of exp(z) up to the order that the tolerance takes, 10, are 1 at the limit of a rate that decays."""
    run, (text,) = told(method="taylor", tolerance=1e-6, **PROBLEMS["linear"])
    match = LIMIT.search(text)
    z = -float(match[3]) / float(match[2])
    assert abs(sum(z**k / factorial(k) for k in range(11))) == pytest.approx(1.0, abs=0.05)
    exact = stiffness.limit_of(run.method, 10, -1.0)
    assert -z == pytest.approx(exact, rel=0.01)
    assert exact != pytest.approx(float(sw.stability_limit(sw.LinearSystem([[-1.0]]), "taylor")), rel=0.1)


def test_members_that_are_stiff_are_counted_and_the_first_is_named() -> None:
    k = np.array([1.0, 2000.0, 1.5, 3000.0])
    run, (text,) = told(system=follows(k=k), method="merson", y=np.ones(4), tolerance=1e-4, at=[20.0])
    assert text.startswith("stability, and not the tolerance, held down the steps of 2 of 4 members; the first was member 1; ")
    (finding,) = (each for each in run.findings if each.category is sw.StiffnessWarning)
    assert finding.members.tolist() == [False, True, False, True]
    _, (same,) = told(system=follows(k=2000.0), method="merson", y=1.0, tolerance=1e-4, at=[20.0])
    assert LIMIT.search(text)[0] == LIMIT.search(same)[0]
    one, (text,) = told(system=follows(k=k[:3].reshape(1, 3)), method="merson", y=np.ones((1, 3)), tolerance=1e-4, at=[20.0])
    assert "of 1 of 3 members: member (0, 1); the fastest" in text
    assert one.findings[-1].members.tolist() == [[False, True, False]]


def test_of_many_members_the_same_are_stiff() -> None:
    """Those of a large batch are first looked at side by side: second-order equations, too, and tolerances of each component."""
    k = np.where(np.arange(20) % 7 == 3, 2000.0, 1.0)
    run, (text,) = told(system=follows(k=k), method="merson", y=np.ones(20), tolerance=1e-4, at=[20.0])
    assert "of 3 of 20 members; the first was member 3; " in text
    (finding,) = (each for each in run.findings if each.category is sw.StiffnessWarning)
    assert np.flatnonzero(finding.members).tolist() == [3, 10, 17]
    mu = np.where(np.arange(20) == 5, 1000.0, 1.0)
    _, (text,) = told(system=van_der_pol(mu=mu), method="merson", v=0.0, y=np.full(20, 2.0), tolerance=1e-4, at=[20.0])
    assert "of 1 of 20 members: member 5; " in text
    y = np.array([1.0, 0.0, 0.0])[:, np.newaxis] * np.ones(9)
    tolerance = np.array([1e-5, 1e-6, 1e-5])[:, np.newaxis], np.array([1e-8, 1e-12, 1e-8])[:, np.newaxis]
    _, (text,) = told(system=robertson(), method="merson", y=y, tolerance=tolerance, at=[20.0])
    assert "of 9 of 9 members; the first was member 0; " in text


def test_a_batch_of_stopped_and_of_finished_members_tells_of_each() -> None:
    run, texts = told(
        system=follows(k=np.array([1000.0, 10_000.0])), method="merson", y=np.ones(2), tolerance=1e-3, at=[20.0], max_steps=9000
    )
    stop, stiff = texts
    assert stop.startswith("1 of 2 members stopped before t = 20: member 1 at t = ")
    assert "held down by stability and not by accuracy: the fastest rate there, 1/0.0001, lets" in stop
    assert "of 1 of 2 members: member 0; the fastest" in stiff
    assert run.status.tolist() == [sw.Status.OK, sw.Status.BUDGET]


def test_states_of_many_numbers_are_seen_by_powers() -> None:
    """A rod of 300 places that conducts heat: the fastest rate is 4·300²·sin²(300π/602)."""

    @sw.system(order=1, shape=(300,))
    def heat(t: Any, y: Any) -> Any:
        left, right = np.concatenate([np.zeros(1), y[:-1]]), np.concatenate([y[1:], np.zeros(1)])
        return 301.0**2 * (left - 2.0 * y + right) + np.cos(0.1 * t)

    _, (text,) = told(system=heat(), method="merson", y=np.zeros(300), tolerance=(1e-4, 1e-7), at=[0.03])
    match = LIMIT.search(text)
    assert 1.0 / float(match[2]) == pytest.approx(4.0 * 301.0**2, rel=0.1)


TAME = list(tame())


def test_tame_runs_say_nothing() -> None:
    """More than a hundred, most of them long enough to be looked at."""
    assert len(TAME) >= 100
    talk, long_enough = {}, 0
    for name, arguments in TAME:
        run, texts = told(**arguments)
        long_enough += int(run.paces.accepted.max()) >= 2048
        talk |= {name: texts} if texts else {}
    assert talk == {}
    assert long_enough >= 0.6 * len(TAME)


def test_it_is_looked_for_only_if_it_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    monkeypatch.setattr(stiffness, "_verdicts", lambda *_: calls.append(None) or [])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.StiffnessWarning)
        assert sw.integrate(follows(), "merson", y=1.0, tolerance=1e-3, at=[20.0]).findings == ()
    assert calls == []


def test_broken_criteria_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Far below the limit a run warns without one of them; of another the bound of its steps alone keeps it silent."""
    far: dict[str, Any] = {"system": sw.Oscillator(2.0), "method": "taylor", "v": 0.0, "tolerance": (0.02, 0.05), "at": [3000.0]}
    bounded = {"system": follows(), "method": "merson", "tolerance": 1e-6, "at": [50.0], "max_step": 0.0026}
    for broken, run in (({"NEAR": 0.0}, far), ({"STIFF": 0.0, "FITTED": (4,)}, bounded)):
        assert told(y=1.0, **run)[1] == []
        with monkeypatch.context() as patch:
            for name, value in broken.items():
                patch.setattr(stiffness, name, value)
            assert len(told(y=1.0, **run)[1]) == ("NEAR" in broken)


def test_broken_criteria_silence_what_is_stiff(monkeypatch: pytest.MonkeyPatch) -> None:
    for broken in ({"MOVED": 0.0, "PART_OF_A_STEP": 0.0}, {"STIFF": 1e9}, {"BEYOND": 0.5}, {"SETTLED": 3.0}):
        with monkeypatch.context() as patch:
            for name, value in broken.items():
                patch.setattr(stiffness, name, value)
            assert told(method="merson", tolerance=(1e-6, 1e-9), **PROBLEMS["HIRES"])[1] == [], broken


def test_the_method_to_take_is_one_that_is_stable(monkeypatch: pytest.MonkeyPatch) -> None:
    """There may be none; of several it goes by the tolerance."""
    explicit = tuple(m for m in sw.methods() if not m.is_always_stable)
    monkeypatch.setattr(all_methods, "methods", lambda: explicit)
    assert all_methods.for_stiff(1e-6) is None
    (text,) = told(method="merson", tolerance=1e-4, **PROBLEMS["driven"])[1]
    assert text.endswith("(stiff equations); SciPy's Radau and LSODA are for them")
    common = {"error_order": 3, "is_always_stable": True} | dict.fromkeys(("needs_acceleration", "has_series", "is_exact"), False)
    common |= {"kept": ()}
    loose, tight = (SimpleNamespace(name=f"implicit_{order}", order=order, **common) for order in (2, 5))
    fixed = SimpleNamespace(**{**vars(tight), "error_order": None, "order": 6})
    monkeypatch.setattr(all_methods, "methods", lambda: (*explicit, loose, tight, fixed))
    assert all_methods.for_stiff(1e-6) is tight
    assert all_methods.for_stiff(1e-2) is loose
    (text,) = told(method="merson", tolerance=1e-4, **PROBLEMS["driven"])[1]
    assert text.endswith('(stiff equations); "implicit_5" is stable there')


def passed(system: Any, method: str, **options: Any) -> tuple[sw.Run, Any]:
    waypoints: list[Any] = []
    request = Request.of(system, method, Options(**options))
    run, n = adaptive_run(request, waypoints), prod(request.plan.system.v_shape) + prod(request.plan.system.y_shape)
    (rows,) = waypoints
    return run, np.where(rows[:, [2 * n + engine.COUNTS.start]] > 0.0, rows, 0.0)  # those that were reached


WAYS: list[tuple[str, dict[str, Any]]] = [
    *(("merson", {"at": at}) for at in ([60.0], np.linspace(0.5, 60.0, 37))),
    ("merson", {"at": [400.0], "dtype": "float32", "tolerance": 1e-4}),
    ("taylor", {"at": [300.0]}),
]


@pytest.mark.parametrize(("method", "options"), WAYS)
def test_waypoints_have_the_same_bits_by_both_backends(method: str, options: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {"v": 0.0, "y": np.array([0.5, 1.0, 2.5]), "tolerance": 1e-8} | options
    rust, numpy = (passed(sw.Pendulum(), method, backend=backend, **arguments)[1] for backend in ("rust", "numpy"))
    n = 2
    assert rust[:, 2 * n + engine.COUNTS.start].max() >= 256.0
    for rows in (rust, numpy):
        # What is asked of a run next is not where a member stands.
        rows[:, [2 * n + place for place in (engine.TARGET, engine.EXTRA, engine.HELD)]] = 0.0
    np.testing.assert_array_equal(rust, numpy)


def test_a_waypoint_is_where_the_steps_were() -> None:
    """The states of ``every=1`` at 256·2^k accepted steps, and before these."""
    arguments: dict[str, Any] = {"y": np.ones(3), "tolerance": 1e-6, "at": [60.0]}
    run, rows = passed(lorenz(), "merson", **arguments)
    every = quietly(lorenz(), "merson", every=1, **arguments)
    last = 1 << (int(run.paces.accepted).bit_length() - 1)
    counts = rows[:, 6 + engine.COUNTS.start, 0]
    assert sorted(counts) == [last // 2, last]
    for each, count in zip(rows[..., 0], counts.astype(int), strict=True):
        np.testing.assert_array_equal(each[:3], every.y[count - 1])
        np.testing.assert_array_equal(each[3:6], every.y[count])
        assert each[6 + engine.TIME] == every.t[count]


@pytest.mark.parametrize("method", ["merson", "taylor"])
def test_waypoints_of_a_batch_are_those_of_its_members(method: str) -> None:
    y = np.random.default_rng(3).normal(size=(3, 600))
    other = 6 + engine.TARGET
    for threads in (1, 3):
        _, rows = passed(lorenz(), method, y=y, tolerance=1e-6, at=[30.0], threads=threads)
        for member in (0, 17, 599):
            _, alone = passed(lorenz(), method, y=y[:, member], tolerance=1e-6, at=[30.0])
            np.testing.assert_array_equal(np.delete(rows[..., member], other, 1), np.delete(alone[..., 0], other, 1))


def test_states_do_not_depend_on_waypoints() -> None:
    for method in EXPLICIT:
        arguments: dict[str, Any] = {"y": PROBLEMS["HIRES"]["y"], "tolerance": 1e-6, "at": np.linspace(1.0, 321.8122, 11)}
        run, _ = told(system=hires(), method=method, **arguments)
        other = quietly(hires(), method, **arguments)
        np.testing.assert_array_equal(run.y, other.y)
        np.testing.assert_array_equal(run.controller_state.pace, other.controller_state.pace)


def test_large_batches_have_none() -> None:
    waypoints: list[Any] = []
    request = Request.of(sw.Oscillator(), "merson", Options(v=0.0, y=np.ones(50_000), tolerance=1e-2, at=[1.0]))
    adaptive_run(request, waypoints)
    assert waypoints == []


@pytest.mark.long
def test_both_backends_say_the_same() -> None:
    arguments: dict[str, Any] = {"y": 1.0, "tolerance": (1e-2, 1e-3), "at": [9.0]}
    rust, numpy = (told(system=follows(), method="merson", backend=each, **arguments)[1] for each in ("rust", "numpy"))
    assert rust == numpy
    assert len(rust) == 1


FAST: dict[str, Any] = {"system": follows(), "method": "merson", "y": 1.0, "tolerance": 1e-3, "at": [20.0]}
REACTION: dict[str, Any] = {"system": robertson(), "method": "merson", "y": np.array([1.0, 0.0, 0.0]), "at": [50.0]}
OWN = np.array([1e-5, 1e-6, 1e-5]), np.array([1e-8, 1e-12, 1e-8])
backward = sw.system(order=1)(lambda t, y: 1000.0 * (y - np.cos(t)))
#: With saved steps, backward, tolerances of components, positive ones, in float32, and at rest, where nothing is left to follow.
SAID_ALSO: list[tuple[dict[str, Any], str]] = [
    (FAST | {"every": 100}, ""),
    (FAST | {"max_step": 0.3}, ""),
    (
        FAST | {"system": backward(), "tolerance": 1e-4, "at": [-20.0]},
        r"at t = -[12].*1/0\.001, lets no steps beyond 0\.00355 be",
    ),
    (REACTION | {"tolerance": OWN}, ""),
    (REACTION | {"tolerance": (1e-5, 1e-9), "positive": True}, ""),
    (FAST | {"system": van_der_pol(), "v": 0.0, "y": 2.0, "tolerance": 1e-4, "at": [30.0], "dtype": "float32"}, ""),
    (FAST | {"system": sw.Oscillator(damping=0.2), "v": 0.0, "tolerance": 1e-5, "at": [2e4]}, "1/1, lets no steps beyond"),
]


def test_it_is_said_in_every_kind_of_run() -> None:
    for arguments, words in SAID_ALSO:
        _, (text,) = told(**arguments)
        assert re.search(words, text), (text, words)
    half, _ = told(**FAST)
    assert len(told(system=follows(), method="merson", resume=half, at=[100.0])[1]) == 1


def test_steps_that_are_short_for_another_reason_are_not_held_down_by_stability() -> None:
    """That the user bounds, at six sevenths of the limit; and that accuracy asks for, at 1e-9 a sixth of it."""
    assert told(**FAST | {"max_step": 0.003})[1] == []
    run, texts = told(**FAST | {"tolerance": 1e-9})
    assert int(run.paces.accepted) > 5 * 20.0 / 0.00355
    assert texts == []


# Said by sweeps, ``solve_ivp`` and the command line: once, with the limit and the method to take.
RATES = np.array([1.0, 1000.0, 1.5, 2000.0])
#: Rates of the error against the cosine, and its turn back in time.
FORWARD, BACK = (lambda t, y: -1000.0 * (y - np.cos(t))), (lambda t, y: 1000.0 * (y - np.cos(t)))


def said(make: Callable[[], Any], category: type[Warning] = sw.StiffnessWarning) -> list[str]:
    """The warnings of a class; each is said as of this file."""
    _, caught = heard.heard(make)
    assert all(each.filename == __file__ for each in caught)
    return [str(each.message) for each in caught if each.category is category]


def sweep(**options: Any) -> Any:
    arguments: dict[str, Any] = {"y": 1.0, "tolerance": 1e-4, "at": np.linspace(0.5, 10.0, 20)} | options
    return sw.sweep(follows, {"k": RATES}, arguments.pop("method", "merson"), **arguments)


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


def test_the_method_goes_by_the_tolerance() -> None:
    """What it names is implicit; explicit methods have a limit, by their records."""
    names = {digits: getattr(for_stiff(10.0**-digits), "name", "") for digits in range(1, 13)}
    assert names == {1: "rosenbrock23", 2: "rosenbrock23", 3: "rodas4", 4: "rodas4"} | dict.fromkeys(range(5, 13), "rodas5p")
    assert all(sw.method(name).is_implicit for name in names.values())
    assert [m.name for m in sw.methods() if m.is_always_stable] == [m.name for m in sw.methods() if m.is_implicit]
    assert not any(sw.method(name).is_always_stable for name in EXPLICIT)


def test_the_method_named_needs_few_evaluations() -> None:
    """No method for stiff equations takes less than four fifths of them on the three test problems together."""
    for digits in (2, 4, 6):
        cost: dict[str, int] = {}
        for method in ("rosenbrock23", "rodas4", "rodas5p"):
            for problem in map(STIFF.get, ("rober", "hires", "oregonator")):
                tolerance = 10.0**-digits, problem.least * 10.0**-digits
                run = sw.integrate(problem.system, method, y=problem.start, tolerance=tolerance, at=[max(problem.values)])
                cost[method] = cost.get(method, 0) + int(run.paces.evaluations)
        best = for_stiff(10.0**-digits)
        assert cost[best.name] <= 1.25 * min(cost.values()), (digits, cost)


# Members that stopped by themselves, or whose rates are not finite at the start.
CHOOSE = [m.name for m in sw.methods() if m.error_order is not None]
#: Those whose steps stability can hold down.
BOUND = [name for name in CHOOSE if not sw.method(name).is_always_stable]


pole = sw.system(order=1)(lambda t, y, *, k=1.0: np.array([0.1 * y[0], k * y[1] * y[1]]))

root = sw.system(order=1)(lambda t, y, *, below=0.0: np.array([y[0], np.sqrt(y[1] - below)]))


def stopped(system: Any, method: str, **options: Any) -> tuple[sw.Run, str]:
    """The run and its one warning, of which other kinds are ignored."""
    run, texts = heard.told(sw.integrate, system, method, **options)
    (text,) = (text for text in texts if "stopped before" in text)
    return run, text


def test_out_of_steps_tells_how_many_and_how_long() -> None:
    for method in BOUND:
        run, text = stopped(sw.Oscillator(), method, v=0.0, y=1.0, tolerance=1e-8, at=[1e6], max_steps=3000)
        paces = run.paces
        mean = float(paces.t) / int(paces.accepted)
        words = f"out of max_steps: 3000 attempts, {int(paces.rejected)} of them rejected, steps of {mean:.2g} on average"
        assert f"{words}, not held down by stability; max_steps=" in text, method
        assert run.stopped_at == paces.t


@pytest.mark.parametrize("method", BOUND)
def test_stiffness_is_named_by_its_rate(method: str) -> None:
    """The fastest rate of Robertson's reaction is there −(1e4·y₃ + 6e7·y₂ + 0.04) to within a part in a thousand."""
    members = (2,) if method == "merson" else ()
    y = np.array([1.0, 0.0, 0.0]).reshape(3, *(1,) * len(members)) * np.ones(members)
    run, text = stopped(robertson(), method, y=y, tolerance=(1e-6, 1e-9), at=[1e4], max_steps=20_000)
    state = run.controller_state.y[:, 0] if members else run.controller_state.y
    match = re.search(r"the fastest rate there, 1/([\d.e-]+), lets no steps beyond ([\d.e-]+) be stable \(stiff", text)
    # Both are told with three digits.
    assert float(match[1]) == pytest.approx(1.0 / (1e4 * state[2] + 6e7 * state[1]), rel=0.006)
    if method != "taylor":  # its order goes by the tolerance
        longest = float(sw.stability_limit(sw.LinearSystem([[-1.0 / float(match[1])]]), method))
        assert float(match[2]) == pytest.approx(longest, rel=0.01)


def test_what_turns_or_is_only_fast_is_not_called_stiff() -> None:
    for system, start in (
        (sw.Oscillator(40.0), {"v": 0.0, "y": 1.0}),
        (sw.Oscillator(1.0, damping=0.0005), {"v": 0.0, "y": 1.0}),
        (van_der_pol(mu=1.0), {"v": 0.0, "y": 2.0}),
    ):
        for method in CHOOSE:
            _, text = stopped(system, method, tolerance=1e-9, at=[1e7], max_steps=4000, **start)
            assert "stiff" not in text, (system, method)


def test_the_stop_of_a_batch_is_told_by_member() -> None:
    """ẏ = k·y² from 1 ends at 1/k; of three members the second is the first, and the third goes on."""
    k = np.array([1.0, 2.0, 0.1])
    for method in CHOOSE:
        run, text = stopped(pole(k=k), method, y=np.ones((2, 3)), tolerance=1e-9, at=[2.0])
        assert text.startswith("2 of 3 members stopped before t = 2; the first was member 1 at t = 0.5; "), method
        # A pole is passed or met where the relative error of 1/y, a tolerance a step over some hundred steps, allows.
        np.testing.assert_allclose(run.stopped_at[:2], [1.0, 0.5], rtol=1e-6)
        assert np.isnan(run.stopped_at[2])
        small = r"; the largest rate there is that of y\[1\], [\d.]+e\+\d\d$"
        infinite = r"no step, however small, gives finite numbers: the state reached [\d.]+e\+\d+$"
        assert re.search(small if "too small" in text else infinite, text), method


def test_a_rate_that_is_nan_at_the_start_is_named() -> None:
    """By steps of fixed length, too."""
    of_rate = "the rate of y[1] is NaN at the start"
    for method in CHOOSE:
        run, text = stopped(root(below=2.0), method, y=np.ones(2), t0=3.0, tolerance=1e-6, at=[4.0])
        assert text == f"the run stopped before t = 4, at t = 3; no step, however small, gives finite numbers: {of_rate}", method
        assert run.stopped_at == 3.0
    match = re.escape(f"{of_rate}, t = 3")
    for each in sw.methods():
        for below, words in ((2.0, match), (np.array([0.0, 2.0]), r"^1 of 2 members diverged: member 1 at step 1 .*" + match)):
            if not each.needs_acceleration:
                with pytest.warns(sw.DivergenceWarning, match=words):
                    sw.integrate(root(below=below), each, y=np.ones(2), t0=3.0, dt=0.1, steps=3)


def test_a_rate_that_becomes_nan_is_named() -> None:
    """√(1 − t) with the time."""
    late = sw.system(lambda t, v, y: -y + np.sqrt(1.0 - t))
    run, text = stopped(late(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[4.0])
    assert float(run.stopped_at) == pytest.approx(1.0, abs=1e-6)
    assert "no step, however small, gives finite numbers" in text


def test_an_event_and_a_stop_are_told_side_by_side() -> None:
    """The event stops the one member, and the pole the other."""
    event = sw.Event(lambda t, y: y[0] - 1.04, terminal=True, name="there")
    k = np.array([1.0, 4.0])
    run, _ = stopped(pole(k=k), "dop853", y=np.ones((2, 2)), tolerance=1e-9, at=[2.0], events=event)
    assert run.status.tolist() == [sw.Status.EVENT, sw.Status.UNDERFLOW]
    np.testing.assert_allclose(run.stopped_at, [np.log(1.04) / 0.1, 0.25], rtol=1e-6)


def message_of(system: Any, **options: Any) -> str:
    return stopped(system, "merson", **{"tolerance": 1e-6} | options)[1]


def test_what_positive_keeps_is_told_first() -> None:
    """Not that the solution blows up: it would be negative from there on. Two tanks: the one that is empty first is named."""
    tanks = sw.system(order=1, shape=(2,))(lambda t, y: np.array([-1.0, -0.3]))()
    message = message_of(tanks, y=np.array([1.0, 0.1]), at=[2.0], positive=True)
    assert re.search(r"at t = 0\.333333; y\[1\] becomes negative in every step, however short, which positive= does", message)
    assert "blows up" not in message
    message = message_of(tanks, y=np.array([1.0, 0.1]), at=[2.0], positive=[0])
    assert "at t = 1; y[0] becomes negative" in message
    assert "at t = 3; v becomes negative" in message_of(
        sw.system(lambda t, v, y: -1.0)(), v=3.0, y=0.0, at=[9.0], positive=[("v",)]
    )


def test_a_time_of_too_many_digits_is_no_collision() -> None:
    """An oscillator's step of about 0.1 to 1 at a time whose roundings are 16, or after some steps where the step shrinks."""
    message = message_of(sw.Oscillator(), v=0.0, y=1.0, t0=1e17, at=[1e17 + 1600.0])
    assert "too small to move the time, whose roundings there are 16: count times from a nearer origin" in message
    assert "collision" not in message
    message = message_of(sw.Oscillator(3e3), v=0.0, y=1.0, t0=1e12, at=[1e12 + 10.0])
    assert "whose roundings there are 0.00012" in message
    # A pole remains one, at t = 1 and at 1e9 + 1, where the time has 24 binary digits for a unit.
    pole = sw.system(order=1)(lambda t, y: y * y)()
    assert "the solution blows up there" in message_of(pole, y=1.0, at=[2.0])
    assert "the solution blows up there" in message_of(pole, y=1.0, t0=1e9, at=[1e9 + 2.0])


def test_a_jump_of_the_rates_that_the_state_decides_is_named() -> None:
    """A diode that stops conducting, a slide along y = 0 and a heater that switches at 0.5: where steps end or creep, and why.

    Coulomb's friction, which is crossed and left twice a turn, and what is only steep are not named.
    """

    @sw.system(order=1, shape=(2,))
    def buck(t: Any, y: Any) -> Any:
        current, voltage = y[0], y[1]
        at_coil = np.where((t % 1e-4) < 3e-5, 12.0, np.where(current > 0, -0.7, voltage))
        return np.array([(at_coil - voltage) / 1e-4, (current - voltage / 50.0) / 1e-5])

    slide = sw.system(order=1)(lambda t, y: 0.5 * np.sin(t) - np.sign(y))
    heater = sw.system(order=1)(lambda t, y: np.where(y < 0.5, 1.0, 0.0) - y)
    creeps = {"tolerance": (1e-6, 1e-9), "max_steps": 20_000}
    for system, method, start, end, options, words in (
        (buck(), "dop853", np.zeros(2), 5e-3, {"tolerance": 1e-6}, r"y\[0\] jumps from -1.08e\+05 to 0 at t = 6.39046e-05"),
        (buck(), "rodas5p", np.zeros(2), 5e-3, creeps, r"y\[0\] jumps from -1.06e\+05 to 0 at t = 0.000738"),
        (slide(), "merson", 1.0, 2.0, {"tolerance": 1e-4}, "y jumps from -0.505 to 1.5 at t = 1.4296"),
        (heater(), "rodas4", 0.0, 3.0, {"tolerance": (1e-4, 1e-7)}, "y jumps from -?0.5 to -?0.5 at t = "),
    ):
        _, texts = heard.told(sw.integrate, system, method, y=start, at=[end], **options)
        assert len(texts) == 1, texts
        assert re.search(f"the rate of {words}.*, where the state crosses a condition", texts[0]), (texts, words)
    for force in (np.sign, lambda v: np.tanh(1e9 * v)):
        system = sw.system(lambda t, v, y: np.cos(1.3 * t) - y - 0.1 * force(v))  # noqa: B023
        for method in ("rodas5p", "dop853", "merson"):
            run, texts = heard.told(sw.integrate, system(), method, v=0.0, y=2.0, tolerance=1e-6, at=[300.0])
            assert int(run.paces.accepted) > 2048
            assert texts == [], method


def test_oscillations_that_steps_amplify_are_named() -> None:
    """Schrödinger's equation in a box of 24 points as two real blocks, whose norm stays 1.

    The part of the end that is told is error, beside that of the phase, as the exact exponential has it. What damps, decays or
    comes back to a cycle is not named.
    """
    n = 24
    matrix = np.diag(np.full(n, 625.0)) - np.diag(np.full(n - 1, 312.5), 1) - np.diag(np.full(n - 1, 312.5), -1)
    psi = np.exp(-(((np.arange(n) + 1.0) / 25.0 - 0.5) ** 2) / 0.04)
    psi /= np.linalg.norm(psi)
    rates, vectors = np.linalg.eigh(matrix)
    end = vectors @ (np.exp(-20j * rates) * (vectors.T @ psi))
    wave = sw.LinearSystem(np.block([[np.zeros((n, n)), matrix], [-matrix, np.zeros((n, n))]]), velocities=0)
    for method, tolerance in (("fehlberg", 1e-4), ("fehlberg_5", 1e-3), ("dop853", 1e-3), ("merson", 1e-6)):
        run, texts = heard.told(sw.integrate, wave, method, y=np.append(psi, 0.0 * psi), tolerance=tolerance, at=[20.0])
        error = np.linalg.norm(run.y[-1] - np.append(end.real, end.imag)) / np.linalg.norm(run.y[-1])
        named = [text for text in texts if "amplify" in text]
        assert len(named) == method.startswith("fehlberg"), (method, tolerance, texts)
        for text in named:
            part = re.search(r"at the end they are ([\d.e-]+) of the state", text)
            assert float(part[1]) < 1.5 * error, (method, tolerance, text)
    for system, start in (
        (sw.Oscillator(), (0.0, 1.0)),
        (sw.Oscillator(damping=0.01), (0.0, 1.0)),
        (van_der_pol(mu=1.0), (0.0, 2.0)),
    ):
        run, texts = heard.told(sw.integrate, system, "fehlberg", v=start[0], y=start[1], tolerance=1e-5, at=[1000.0])
        assert int(run.paces.accepted) > 2048
        assert texts == [], system
