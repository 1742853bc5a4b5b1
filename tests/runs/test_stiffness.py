"""A run whose steps are held down by stability, and not by accuracy, says so; no other does."""

from __future__ import annotations

import itertools
import re
import warnings
from math import factorial, prod
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis import stiffness
from stepwell.model import methods as all_methods
from stepwell.runs import engine
from stepwell.runs.adaptive import adaptive_run
from stepwell.runs.making import quietly
from stepwell.runs.options import Options
from stepwell.runs.request import Request
from support.stiff import EXPLICIT, PROBLEMS, follows, hires, lorenz, robertson, tame, van_der_pol

TOLERANCES = [(1e-3, 1e-6), (1e-6, 1e-9)]
LIMIT = re.compile(r"the fastest rate (?:at t = (\S+)|there), 1/(\S+), lets no steps beyond (\S+) be stable")
RATIO = re.compile(r"tolerance allows (?:about (\d+)|more than 1000) times as long")


def told(**arguments: Any) -> tuple[sw.Run, list[str]]:
    """The run and what it warned of stiffness."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = sw.integrate(arguments.pop("system"), arguments.pop("method"), **arguments)
    return run, [text for each in caught if "held" in (text := str(each.message)) and "not held down" not in text]


# ---- what is stiff says so


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


def test_a_method_that_is_stable_takes_fewer_steps() -> None:
    """SciPy's Radau does, with the same tolerances."""
    from scipy.integrate import solve_ivp

    for name, tolerance in itertools.product(("HIRES", "driven"), TOLERANCES):
        problem = PROBLEMS[name]
        run, (_,) = told(method="dop853", tolerance=tolerance, **problem)
        reference = run.system.reference_at_step(1.0, ())

        def rates(t: float, y: Any, reference: Any = reference, scalar: bool = np.ndim(problem["y"]) == 0) -> Any:
            return np.atleast_1d(reference.dy(t, np.empty(0), y[0] if scalar else y))

        start = np.atleast_1d(np.asarray(problem["y"], dtype=float))
        implicit = solve_ivp(rates, (0.0, problem["at"][0]), start, method="Radau", rtol=tolerance[0], atol=tolerance[1])
        assert 3 * len(implicit.t) < int(run.paces.accepted), (name, tolerance)


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


def test_a_motion_at_rest_is_held_down_by_stability_too() -> None:
    """A damped swing that has come to rest has nothing left to follow."""
    _, (text,) = told(system=sw.Oscillator(damping=0.2), method="merson", v=0.0, y=1.0, tolerance=1e-5, at=[2e4])
    assert "1/1, lets no steps beyond" in text


def test_backward_in_time_too() -> None:
    backward = sw.system(order=1)(lambda t, y: 1000.0 * (y - np.cos(t)))()
    _, (text,) = told(system=backward, method="merson", y=1.0, tolerance=1e-4, at=[-20.0])
    assert "at t = -1" in text or "at t = -2" in text
    assert "1/0.001, lets no steps beyond 0.00355 be stable" in text


def test_states_of_many_numbers_are_seen_by_powers() -> None:
    """A rod of 300 places that conducts heat: the fastest rate is 4·300²·sin²(300π/602)."""

    @sw.system(order=1, shape=(300,))
    def heat(t: Any, y: Any) -> Any:
        left, right = np.concatenate([np.zeros(1), y[:-1]]), np.concatenate([y[1:], np.zeros(1)])
        return 301.0**2 * (left - 2.0 * y + right) + np.cos(0.1 * t)

    _, (text,) = told(system=heat(), method="merson", y=np.zeros(300), tolerance=(1e-4, 1e-7), at=[0.03])
    match = LIMIT.search(text)
    assert 1.0 / float(match[2]) == pytest.approx(4.0 * 301.0**2, rel=0.1)


# ---- what is tame says nothing

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


def test_steps_that_the_user_bounds_are_not_held_down_by_stability() -> None:
    """They are at six sevenths of the limit, but for another reason."""
    _, texts = told(system=follows(), method="merson", y=1.0, tolerance=1e-3, at=[20.0], max_step=0.003)
    assert texts == []
    _, texts = told(system=follows(), method="merson", y=1.0, tolerance=1e-3, at=[20.0], max_step=0.3)
    assert len(texts) == 1


def test_steps_that_accuracy_asks_for_are_not_held_down_by_stability() -> None:
    """At a tolerance of 1e-9 they are a sixth of the limit."""
    run, texts = told(system=follows(), method="merson", y=1.0, tolerance=1e-9, at=[20.0])
    assert int(run.paces.accepted) > 5 * 20.0 / 0.00355
    assert texts == []


def test_out_of_steps_says_if_stability_is_not_the_reason() -> None:
    with pytest.warns(sw.ToleranceWarning, match=r"steps of 0\.\d+ on average, not held down by stability; max_steps= allows"):
        sw.integrate(lorenz(), "merson", y=np.ones(3), tolerance=1e-9, at=[1e4], max_steps=5000)


def test_it_is_looked_for_only_if_it_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    monkeypatch.setattr(stiffness, "_verdicts", lambda *_: calls.append(None) or [])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.StiffnessWarning)
        assert sw.integrate(follows(), "merson", y=1.0, tolerance=1e-3, at=[20.0]).findings == ()
    assert calls == []


# ---- broken criteria are noticed


@pytest.mark.parametrize(
    ("broken", "falsely"),
    [
        ({"NEAR": 0.0}, {"system": sw.Oscillator(2.0), "method": "taylor", "v": 0.0, "y": 1.0, "tolerance": 0.1, "at": [1500.0]}),
        (
            {"STIFF": 0.0, "FITTED": (4,)},
            {"system": follows(), "method": "merson", "y": 1.0, "tolerance": 1e-6, "at": [50.0], "max_step": 0.0026},
        ),
    ],
    ids=["far below the limit", "bounded"],
)
def test_broken_criteria_are_noticed(monkeypatch: pytest.MonkeyPatch, broken: dict[str, Any], falsely: dict[str, Any]) -> None:
    """With one criterion broken the one run warns; of the other the bound alone keeps it silent."""
    assert told(**dict(falsely))[1] == []
    for name, value in broken.items():
        monkeypatch.setattr(stiffness, name, value)
    assert len(told(**dict(falsely))[1]) == ("NEAR" in broken)


def test_broken_criteria_silence_what_is_stiff(monkeypatch: pytest.MonkeyPatch) -> None:
    for broken in ({"MOVED": 0.0, "PART_OF_A_STEP": 0.0}, {"STIFF": 1e9}, {"BEYOND": 0.5}, {"SETTLED": 3.0}):
        with monkeypatch.context() as patch:
            for name, value in broken.items():
                patch.setattr(stiffness, name, value)
            assert told(method="merson", tolerance=(1e-6, 1e-9), **PROBLEMS["HIRES"])[1] == [], broken


# ---- which method to take


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


# ---- where members stood on the way


def passed(system: Any, method: str, **options: Any) -> tuple[sw.Run, Any]:
    waypoints: list[Any] = []
    request = Request.of(system, method, Options(**options))
    run, n = adaptive_run(request, waypoints), prod(request.plan.system.v_shape) + prod(request.plan.system.y_shape)
    (rows,) = waypoints
    return run, np.where(rows[:, [2 * n + engine.COUNTS.start]] > 0.0, rows, 0.0)  # those that were reached


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("merson", {"at": [60.0]}),
        ("merson", {"at": np.linspace(0.5, 60.0, 37)}),
        ("merson", {"at": [400.0], "dtype": "float32", "tolerance": 1e-4}),
        ("taylor", {"at": [300.0]}),
    ],
)
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


def test_it_is_said_with_saved_steps_and_in_pieces_too() -> None:
    assert len(told(system=follows(), method="merson", y=1.0, tolerance=1e-3, at=[20.0], every=100)[1]) == 1
    half, (_,) = told(system=follows(), method="merson", y=1.0, tolerance=1e-3, at=[20.0])
    _, texts = told(system=follows(), method="merson", resume=half, at=[100.0])
    assert len(texts) == 1


def test_own_tolerances_and_positive_components() -> None:
    arguments: dict[str, Any] = {"system": robertson(), "method": "merson", "y": np.array([1.0, 0.0, 0.0]), "at": [50.0]}
    assert len(told(tolerance=(np.array([1e-5, 1e-6, 1e-5]), np.array([1e-8, 1e-12, 1e-8])), **arguments)[1]) == 1
    assert len(told(tolerance=(1e-5, 1e-9), positive=True, **arguments)[1]) == 1
    assert len(told(system=van_der_pol(), method="merson", v=0.0, y=2.0, tolerance=1e-4, at=[30.0], dtype="float32")[1]) == 1
