"""``solve_ivp`` as SciPy has it: the same arguments and results, zeros of events where they are, and what is refused."""

import functools
import inspect
import math
import types
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, DTypeError, ShapeError, TraceError, UnknownNameError, UnsupportedError
from stepwell.interop import ivp_function, ivp_steps
from stepwell.interop.ivp_events import ROOT_TOLERANCE, Part, zero
from stepwell.reference.events import located, located_alone
from support.for_each import for_each
from support.refusals import refused

EPS = np.finfo(float).eps


def decay(t: Any, y: Any) -> Any:
    return -0.5 * y


def cannon(t: Any, y: Any) -> Any:
    return [y[1], -0.5]


def turning(t: Any, y: Any) -> Any:
    return [y[1], -y[0]]


def lotka_volterra(t: Any, z: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    x, y = z
    return [a * x - b * x * y, -c * y + d * x * y]


def event(function: Callable[..., Any], **attributes: Any) -> Any:
    """An event function with attributes of its own."""

    def copy(*arguments: Any) -> Any:
        return function(*arguments)

    for name, value in attributes.items():
        setattr(copy, name, value)
    return copy


def test_the_arguments_are_those_of_scipy() -> None:
    scipy = pytest.importorskip("scipy.integrate")
    theirs = [name for name in inspect.signature(scipy.solve_ivp).parameters if name != "options"]
    mine = inspect.signature(sw.solve_ivp).parameters
    assert [name for name, each in mine.items() if each.kind is each.POSITIONAL_OR_KEYWORD] == theirs
    options = {*inspect.signature(scipy.DOP853).parameters, *inspect.signature(scipy.LSODA).parameters}
    options |= {*inspect.signature(scipy.Radau).parameters} - {"extraneous"}
    assert {name for name, each in mine.items() if each.kind is each.KEYWORD_ONLY} == options - {
        "fun", "t0", "y0", "t_bound", "vectorized", "extraneous"
    }  # fmt: skip


#: The examples of SciPy's page, with the names of what they import left out.
DEFINED = """
import numpy as np
def exponential_decay(t, y): return -0.5 * y
def upward_cannon(t, y): return [y[1], -0.5]
def hit_ground(t, y): return y[0]
hit_ground.terminal = True
hit_ground.direction = -1
def apex(t, y): return y[1]
def lotkavolterra(t, z, a, b, c, d):
    x, y = z
    return [a*x - b*x*y, -c*y + d*x*y]
"""
SCRIPTS = {
    "decay": "exponential_decay, [0, 10], [2, 4, 8]",
    "decay at times": "exponential_decay, [0, 10], [2, 4, 8], t_eval=[0, 1, 2, 4, 10]",
    "cannon": "upward_cannon, [0, 100], [0, 10], events=hit_ground",
    "cannon, apex": "upward_cannon, [0, 100], [0, 10], events=(hit_ground, apex), dense_output=True",
    "Lotka-Volterra": "lotkavolterra, [0, 15], [10, 5], args=(1.5, 1, 3, 1), dense_output=True, t_eval=np.linspace(0, 15, 300)",
}


@for_each("which", SCRIPTS)
def test_scipys_examples_run_by_one_import(which: str) -> None:
    pytest.importorskip("scipy")
    results = {}
    for package in ("scipy.integrate", "stepwell"):
        namespace: dict[str, Any] = {}
        exec(f"from {package} import solve_ivp\n{DEFINED}\nsol = solve_ivp({SCRIPTS[which]})", namespace)
        results[package] = namespace["sol"]
    theirs, mine = results["scipy.integrate"], results["stepwell"]
    assert set(mine) == set(theirs)
    for name in ("status", "message", "success", "njev", "nlu"):
        assert mine[name] == theirs[name]
        assert type(mine[name]) is type(theirs[name])
    assert (mine.sol is None) == (theirs.sol is None)
    assert (mine.t_events is None) == (theirs.t_events is None)
    assert mine.y.shape == (len(theirs.y), len(mine.t))
    for one, other in zip(mine.t_events or [], theirs.t_events or [], strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    for one, other in zip(mine.y_events or [], theirs.y_events or [], strict=True):
        assert one.shape == other.shape
    if "at times" in which:
        np.testing.assert_array_equal(mine.t, theirs.t)
    assert mine.t[0] == theirs.t[0]
    assert mine.t[-1] == pytest.approx(theirs.t[-1], rel=1e-12)


def test_the_result_is_a_dictionary_with_attributes() -> None:
    result = sw.solve_ivp(decay, (0, 1), [1.0])
    assert result["t"] is result.t
    assert {"t", "y", "sol"} <= set(dir(result))
    with pytest.raises(AttributeError, match="nothing"):
        _ = result.nothing
    assert repr(result).splitlines()[0].split() == ["message:", *result.message.split()]
    assert max(map(len, repr(result).splitlines())) < 120


def test_backward_in_time() -> None:
    """And there and back again: each way adds at most its steps times the tolerance of one."""
    rtol, atol = 1e-11, 1e-14
    there = sw.solve_ivp(lambda t, y: -t * y, (2.0, -1.0), [1.0], rtol=rtol, atol=atol, dense_output=True)
    assert (np.diff(there.t) < 0).all()
    assert there.t[[0, -1]].tolist() == [2.0, -1.0]
    # y = exp((4 − t²)/2); an error made at s is multiplied by y(t)/y(s), so relative errors add up.
    bound = (len(there.t) + 1) * (rtol + atol)  # y is 1 or more
    for t, y in zip([*there.t, 0.5], [*there.y[0], there.sol(0.5)[0]], strict=True):
        assert abs(y / np.exp((4 - t * t) / 2) - 1) < bound
    back = sw.solve_ivp(lambda t, y: -t * y, (-1.0, 2.0), there.y[:, -1], rtol=rtol, atol=atol)
    assert abs(back.y[0, -1] - 1.0) < bound + (len(back.t) + 1) * (rtol + atol)
    for options in ({}, {"dense_output": True}):
        falling = sw.solve_ivp(turning, (0.0, -7.0), [1.0, 0.0], t_eval=[0.0, -1.0, -7.0], rtol=1e-9, **options)
        assert falling.t.tolist() == [0.0, -1.0, -7.0]
        assert falling.y[0] == pytest.approx(np.cos(falling.t), abs=1e-6)


def test_states_are_those_of_a_run_to_the_bit() -> None:
    """At times and from ``sol``, with steps one by one and all at once."""

    @sw.system(order=1, shape=(3,))
    def lorenz(t: Any, y: Any) -> Any:
        return [10.0 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]]

    times = np.linspace(0.0, 5.0, 41)
    run = sw.integrate(lorenz, "merson", y=[1.0, 2.0, 3.0], tolerance=(1e-6, 1e-8), at=times)
    options: dict[str, Any] = {"t_span": (0.0, 5.0), "y0": [1.0, 2.0, 3.0], "method": "merson", "rtol": 1e-6, "atol": 1e-8}
    once = sw.solve_ivp(lorenz, t_eval=times, **options)
    stepped = sw.solve_ivp(lorenz.function, t_eval=times, dense_output=True, **options)
    assert once.y.tobytes() == np.ascontiguousarray(run.y.T).tobytes()
    assert stepped.y.tobytes() == once.y.tobytes()
    shuffled = np.random.default_rng(1).permutation(np.append(times, times[3]))
    again = stepped.sol(shuffled)
    assert again.tobytes() == once.y[:, np.searchsorted(times, shuffled)].tobytes()
    assert run.paces is not None
    assert once.nfev == run.paces.evaluations
    steps = sw.solve_ivp(lorenz.function, **options)
    assert len(steps.t) == run.paces.accepted + 2  # the start, and the step that ends at the end
    assert steps.sol is None
    np.testing.assert_array_equal(stepped.sol(steps.t), steps.y)
    assert stepped.sol.n_segments == len(steps.t) - 1


def test_sol_is_refused_outside_its_steps() -> None:
    result = sw.solve_ivp(decay, (0, 1), [1.0, 2.0], dense_output=True)
    assert result.sol(0.5).shape == (2,)
    assert result.sol([0.5]).shape == (2, 1)
    assert result.sol([]).shape == (2, 0)
    assert (result.sol.t_min, result.sol.t_max) == (0.0, 1.0)
    for wrong in (-1e-9, 1.0 + 1e-9, [0.5, 2.0]):
        refused(ArgumentError, "t: expected times within the solution, from 0 to 1, got", result.sol, wrong)
    refused(ShapeError, "t: expected a time, or times along one axis", result.sol, [[0.5]])


@for_each("method", [m.name for m in sw.methods() if m.error_order is not None])
def test_a_state_within_a_step_is_as_good_as_at_its_end(method: str) -> None:
    """Turning keeps lengths, so errors only add up: N steps and an extra one err by no more than (N + 1) tolerances."""
    rtol, atol = 1e-8, 1e-12
    result = sw.solve_ivp(turning, (0, 10), [1.0, 0.0], method=method, dense_output=True, rtol=rtol, atol=atol)
    t = np.linspace(0, 10, 301)
    error = np.linalg.norm(result.sol(t) - [np.cos(t), -np.sin(t)], axis=0)
    # The estimate is of the result with which these methods go on, or of a lower order and so larger.
    assert error.max() < (len(result.t) + 1) * (rtol + np.sqrt(2) * atol)
    # A cubic polynomial through both ends and their rates, which would cost nothing, is not as good.
    i = np.clip(np.searchsorted(result.t, t, side="right") - 1, 0, len(result.t) - 2)
    h = result.t[i + 1] - result.t[i]
    s = (t - result.t[i]) / h
    a, b = result.y[:, i], result.y[:, i + 1]
    rates_a, rates_b = np.array([a[1], -a[0]]), np.array([b[1], -b[0]])
    cubic = (
        (1 + 2 * s) * (1 - s) ** 2 * a + s * (1 - s) ** 2 * h * rates_a + s * s * (3 - 2 * s) * b - s * s * (1 - s) * h * rates_b
    )
    if method == "dop853":
        assert np.linalg.norm(cubic - [np.cos(t), -np.sin(t)], axis=0).max() > 1000 * error.max()


def root(g: Callable[[float], float], a: float, b: float, g_a: float, g_b: float) -> float:
    """A zero of g in a step from a to b."""
    return zero(g, (a, b), Part(0.0, 1.0, g_a, g_b))


@for_each(
    ("g", "a", "b", "true"),
    [
        (lambda x: x**3 - 2.0, 0.0, 2.0, 2 ** (1 / 3)),
        (lambda x: np.cos(x), 1.0, 2.0, np.pi / 2),
        (lambda x: np.cos(x), 2.0, 1.0, np.pi / 2),
        (lambda x: np.exp(x) - 1e6, -10.0, 100.0, np.log(1e6)),
        (lambda x: x - 1e-9, -1.0, 1.0, 1e-9),
        (lambda x: (x - 1 / 3) ** 9, 0.0, 1.0, 1 / 3),
        (lambda x: np.sign(x - 0.7), 0.0, 1.0, 0.7),
        (lambda x: np.tanh(1e5 * (x - 1e5)), 0.0, 3e5, 1e5),
    ],
)
def test_a_zero_is_found_to_four_roundings(g: Callable[[float], float], a: float, b: float, true: float) -> None:
    calls = []

    def counted(x: float) -> float:
        calls.append(x)
        return float(g(x))

    solution = root(counted, a, b, counted(a), counted(b))
    if "** 9" in inspect.getsource(g) and true == 1 / 3:
        assert abs(solution - true) < 1e-5  # where the power underflows it is zero all around
    else:
        assert abs(solution - true) <= ROOT_TOLERANCE * (1.0 + abs(true)) + 2 * EPS * abs(true)
    assert len(calls) < 75


def test_one_event_is_located_as_several_are() -> None:
    """The rule is one: Python's numbers take the same trials as NumPy's arrays."""
    rng = np.random.default_rng(8)
    nothing = np.empty((0, 1))
    for _ in range(100):
        at, steepness = rng.uniform(1e-3, 1.0), 10.0 ** rng.uniform(-1, 2)
        trials: dict[str, list[float]] = {"one": [], "several": [], "ends": []}

        def g(share: float, who: str, at: float = at, steepness: float = steepness, trials: Any = trials) -> float:
            trials[who].append(share)
            return float(np.tanh(steepness * (share - at)) * (1.0 + share))

        def trial(_: Any, shares: Any, g: Any = g) -> Any:
            return np.array([g(each, "several") for each in shares.tolist()]), nothing, nothing

        ends = (0.0, 1.0, g(0.0, "ends"), g(1.0, "ends"))
        low, high = located_alone(lambda share, g=g: g(share, "one"), *ends)
        several = located(trial, *(np.array([each]) for each in ends), nothing, nothing)[0]
        assert trials["one"] == trials["several"]
        assert several == high
        assert g(high, "ends") == 0.0 or high - low <= 2.0**-52 * high


@for_each("true", [1e-13, 3e-30, 1e-200])
def test_a_zero_is_found_to_the_roundings_of_a_tiny_time(true: float) -> None:
    """Of a step from 0, to four roundings of the zero; of a step around 0, to four of the time since its start."""
    assert abs(root(lambda t: t / true * t - true, 0.0, 1.0, -true, 1.0 / true) / true - 1.0) <= 2 * ROOT_TOLERANCE
    assert abs(root(lambda t: t - true, -true, 1.0, -2.0 * true, 1.0 - true) / true - 1.0) <= 2 * ROOT_TOLERANCE


def test_a_zero_at_an_end() -> None:
    assert root(lambda x: x, 0.0, 1.0, 0.0, 1.0) == 0.0
    assert root(lambda x: x - 1, 0.0, 1.0, -1.0, 0.0) == 1.0


def height(t: Any, y: Any) -> Any:
    return y[0]


def test_events_lie_where_they_do() -> None:
    """The zeros of the cosine: at each the error is that of the state, at most a tolerance a step, over the slope, which is 1."""
    rtol, atol = 1e-10, 1e-13
    result = sw.solve_ivp(turning, (0, 20), [1.0, 0.0], events=height, rtol=rtol, atol=atol)
    true = np.pi * (np.arange(6) + 0.5)
    bound = (len(result.t) + 1) * (rtol + np.sqrt(2) * atol)
    assert result.t_events is not None
    assert result.t_events[0].shape == true.shape
    assert np.abs(result.t_events[0] - true).max() < bound
    assert result.y_events[0].shape == (6, 2)
    assert np.abs(result.y_events[0][:, 0]).max() < 100 * EPS
    # A straight line between the ends of the steps would not find them.
    i = np.flatnonzero(np.diff(np.sign(result.y[0])))
    line = result.t[i] - result.y[0, i] * np.diff(result.t)[i] / np.diff(result.y[0])[i]
    assert np.abs(line - true).max() > 1000 * bound
    # Events change no step.
    np.testing.assert_array_equal(result.y, sw.solve_ivp(turning, (0, 20), [1.0, 0.0], rtol=rtol, atol=atol).y)


@for_each("sign", [1, -1])
@for_each(("direction", "which"), [(0, [0, 1, 2, 3, 4, 5]), (1, [1, 3, 5]), (-1, [0, 2, 4])])
def test_directions_and_ends(direction: int, which: list[int], sign: int) -> None:
    """In the order of the run, forward or backward; SciPy's directions are those of the run as well."""
    options: dict[str, Any] = {"t_span": (0, 20 * sign), "y0": [1.0, 0.0], "rtol": 1e-9}
    result = sw.solve_ivp(turning, events=event(height, direction=direction), **options)
    true = sign * np.pi * (np.array(which) + 0.5)
    assert result.t_events[0] == pytest.approx(true, abs=1e-6)
    assert result.status == 0
    for terminal in (True, 1, 2):
        ended = sw.solve_ivp(turning, events=event(height, direction=direction, terminal=terminal), dense_output=True, **options)
        last = true[int(terminal) - 1]
        assert ended.status == 1
        assert ended.success
        assert ended.message == "A termination event occurred."
        assert ended.t[-1] == ended.t_events[0][-1] == pytest.approx(last, abs=1e-6)
        assert len(ended.t_events[0]) == int(terminal)
        np.testing.assert_array_equal(ended.y[:, -1], ended.y_events[0][-1])
        np.testing.assert_array_equal(ended.sol(ended.t[-1]), ended.y[:, -1])
    scipy = pytest.importorskip("scipy.integrate")
    # Older versions do not know numbers for ``terminal``.
    theirs = scipy.solve_ivp(turning, events=event(height, direction=direction, terminal=True), method="DOP853", **options)
    assert ended.t_events[0][:1] == pytest.approx(theirs.t_events[0], abs=1e-6)


def test_events_of_one_step_come_in_their_order() -> None:
    """Of three in a step, listed in another order, the second ends the run: the first is noted, the third is not."""
    events = [
        event(lambda t, y, at=at: y[0] - at, terminal=terminal) for at, terminal in ((3.0, True), (2.0, True), (1.0, False))
    ]
    result = sw.solve_ivp(lambda t, y: [1.0], (0, 10), [0.0], events=events, first_step=5.0)
    assert [len(each) for each in result.t_events] == [0, 1, 1]
    assert [each.shape for each in result.y_events] == [(0, 1), (1, 1), (1, 1)]
    assert result.t[-1] == pytest.approx(2.0, abs=1e-14)
    assert result.t_events[2] == pytest.approx([1.0], abs=1e-14)


def test_times_end_with_an_event() -> None:
    ground = event(height, terminal=True, direction=-1)
    result = sw.solve_ivp(cannon, (0, 100), [0.0, 10.0], t_eval=np.arange(0.0, 100.0, 15.0), events=ground)
    assert result.t.tolist() == [0.0, 15.0, 30.0]
    # y = 10·t − t²/4 is exact but for rounding: it errs by some roundings of 100 near the ground, where its slope is −10.
    # The weights of one power in the continuous extension, which has the states within the step, are together 3473 at most.
    assert result.y[0] == pytest.approx([0.0, 93.75, 75.0], abs=100 * 3473 * EPS)
    assert result.t_events[0] == pytest.approx([40.0], abs=100 * 30 * EPS / 10 + ROOT_TOLERANCE * 41)


def test_an_event_gets_the_arguments() -> None:
    def above(t: float, z: Any, a: float, b: float, c: float, d: float) -> float:
        return z[0] - c

    result = sw.solve_ivp(lotka_volterra, (0, 15), [10, 5], args=(1.5, 1, 3, 1), events=above, rtol=1e-8)
    assert len(result.t_events[0]) > 2
    assert np.abs(result.y_events[0][:, 0] - 3).max() < 1e-12


class Swing:
    """Equations of an object."""

    def __init__(self, k: float) -> None:
        self.k = k

    def rates(self, t: Any, y: Any) -> Any:
        return np.array([y[1], -self.k * np.sin(y[0])])

    def __call__(self, t: Any, y: Any) -> Any:
        return self.rates(t, y)


def swing(k: float, t: Any, y: Any) -> Any:
    return np.array([y[1], -k * np.sin(y[0])])


def swing_matrix(t: Any, y: Any, both: dict[str, Any]) -> Any:
    return both["turn"] @ y - np.array([0.0, both["k"] * (np.sin(y[0]) - y[0])])


def swing_column(t: Any, y: Any) -> Any:
    assert y.ndim == 2
    return np.array([y[1], -2.0 * np.sin(y[0])])


WAYS: dict[str, tuple[Any, dict[str, Any]]] = {
    "lambda": (lambda t, y: (y[1], -2.0 * np.sin(y[0])), {}),
    "method": (Swing(2.0).rates, {}),
    "object": (Swing(2.0), {}),
    "partial": (functools.partial(swing, 2.0), {}),
    "args": (lambda t, y, k: [y[1], -k * np.sin(y[0])], {"args": (2.0,)}),
    "args, a list": (lambda t, y, k: [y[1], -k * np.sin(y[0])], {"args": [2]}),
    "args, a dictionary": (swing_matrix, {"args": ({"turn": np.array([[0.0, 1.0], [-2.0, 0.0]]), "k": 2.0},)}),
    "column": (swing_column, {"vectorized": True}),
}


@for_each("way", WAYS)
def test_any_callable_is_traced(way: str) -> None:
    fun, options = WAYS[way]
    result = sw.solve_ivp(fun, (0, 5), [1.0, 0.0], rtol=1e-9, atol=1e-12, t_eval=[5.0], **options)
    run = sw.integrate(sw.Pendulum(np.sqrt(2.0)), "dop853", v=0.0, y=1.0, tolerance=1e-12, at=[5.0])
    assert result.y[:, 0] == pytest.approx([run.y[-1], run.v[-1]], abs=1e-6)


def test_a_single_number_may_be_returned() -> None:
    result = sw.solve_ivp(lambda t, y: -0.5 * y[0], (0, 1), [1.0], rtol=1e-9, atol=1e-12)
    assert result.y[0, -1] == pytest.approx(np.exp(-0.5), abs=1e-8)


def test_the_line_that_cannot_be_traced_is_named() -> None:
    def bouncing(t: Any, y: Any) -> Any:
        if y[0] < 0:
            return [y[1], 1.0]
        return [y[1], -1.0]

    with pytest.raises(TraceError, match=r"fun: bouncing \(test_solve_ivp.py, line \d+: if y\[0\] < 0:\): .* write\s+np.where"):
        sw.solve_ivp(bouncing, (0, 1), [1.0, 0.0])


def test_steps_can_be_limited() -> None:
    free = sw.solve_ivp(decay, (0, 10), [1.0])
    assert np.diff(free.t).max() > 1.0
    limited = sw.solve_ivp(decay, (0, 10), [1.0], max_step=0.25)
    assert np.diff(limited.t).max() <= 0.25 + np.spacing(10.0)  # each time is rounded by half of that
    first = sw.solve_ivp(decay, (0, 10), [1.0], first_step=0.3)
    assert first.t[1] == 0.3
    assert sw.solve_ivp(decay, (0, 10), [1.0], first_step=5.0, max_step=0.5).t[1] == 0.5


def test_two_zeros_within_a_step_are_found() -> None:
    """At t = 2 and 2.02, in steps of 1; three of a polynomial, of which SciPy sees one; in the direction that is asked for."""
    narrow = event(lambda t, y: (y[0] - np.exp(-1.0)) * (y[0] - np.exp(-1.01)))
    for method in ("merson", "dop853", "fehlberg_5"):
        run = sw.solve_ivp(decay, (0, 10), [1.0], events=narrow, rtol=1e-8, method=method)
        np.testing.assert_allclose(run.t_events[0], [2.0, 2.02], rtol=0, atol=1e-5)
        cubic = sw.solve_ivp(lambda t, y: [3 * t * t + 12 * t - 4], (-8, 4), [-120.0], method=method, events=lambda t, y: y[0])
        np.testing.assert_allclose(cubic.t_events[0], [-6.0, -2.0, 2.0], rtol=0, atol=1e-9)
        back = sw.solve_ivp(lambda t, y: [3 * t * t + 12 * t - 4], (4, -8), [120.0], method=method, events=lambda t, y: y[0])
        np.testing.assert_allclose(back.t_events[0], [2.0, -2.0, -6.0], rtol=0, atol=1e-9)
    falling = event(lambda t, y: y[0], direction=-1.0)
    run = sw.solve_ivp(lambda t, y: [3 * t * t + 12 * t - 4], (-8, 4), [-120.0], events=falling)
    np.testing.assert_allclose(run.t_events[0], [-2.0], rtol=0, atol=1e-9)


def test_a_state_that_ends_is_told() -> None:
    """y = 1/(1 − t) ends at t = 1; the states before it are returned."""
    for options in ({}, {"t_eval": [0.0, 0.5, 0.9, 1.5]}, {"dense_output": True}):
        result = sw.solve_ivp(lambda t, y: y * y, (0, 2), [1.0], rtol=1e-6, **options)  # type: ignore[arg-type]
        assert (result.status, result.success) == (-1, False)
        assert result.message in {
            "Required step size is less than spacing between numbers.",
            "No step, however short, gives a finite state.",
        }
        assert 0.9 <= result.t[-1] <= 1.01
        assert result.y.shape == (1, len(result.t))
        assert np.isfinite(result.y).all()
    assert result.sol(0.5) == pytest.approx([2.0], rel=1e-3)


def test_no_time_at_all() -> None:
    for options in ({}, {"t_eval": [1.0]}, {"dense_output": True}, {"events": height}):
        result = sw.solve_ivp(decay, (1.0, 1.0), [2.0], **options)  # type: ignore[arg-type]
        assert result.success
        assert result.t.tolist() == [1.0]
        assert result.y.tolist() == [[2.0]]


def test_the_absolute_tolerance_may_be_zero_or_several() -> None:
    result = sw.solve_ivp(decay, (0, 10), [1.0, 2.0], rtol=1e-9, atol=0.0)
    assert result.y[:, -1] == pytest.approx(np.exp(-5.0) * np.array([1.0, 2.0]), rel=1e-7)
    several = sw.solve_ivp(decay, (0, 10), [1.0, 2.0], rtol=[1e-3, 1e-6], atol=[1e-6, 1e-9])
    np.testing.assert_array_equal(several.y, sw.solve_ivp(decay, (0, 10), [1.0, 2.0], rtol=1e-6, atol=1e-9).y)
    with pytest.warns(sw.ToleranceWarning, match="rtol: 1e-20 is too small"):
        sw.solve_ivp(decay, (0, 1), [1.0], rtol=1e-20)


def test_methods_by_name() -> None:
    np.testing.assert_array_equal(sw.solve_ivp(decay, (0, 10), [1.0]).y, sw.solve_ivp(decay, (0, 10), [1.0], "dop853").y)
    scipy = pytest.importorskip("scipy.integrate")
    for name, method in (("DOP853", "dop853"), ("RK45", "dopri5"), ("RK23", "bs32")):
        ours = sw.solve_ivp(decay, (0, 10), [1.0], method)
        for same in (name, name.lower(), sw.method(method), getattr(scipy, name)):
            np.testing.assert_array_equal(sw.solve_ivp(decay, (0, 10), [1.0], same).y, ours.y)


@for_each("name", ["Radau", "bdf", "Rosenbrock"])
@for_each(("rtol", "taken"), [(1e-3, "rodas4"), (1e-6, "rodas5p")])
def test_methods_for_stiff_equations_are_replaced_by_the_one_for_the_tolerance(name: str, rtol: float, taken: str) -> None:
    with pytest.warns(UserWarning, match=rf"method: {name} is not here; {taken} is taken".replace("bdf", "BDF")):
        result = sw.solve_ivp(decay, (0, 10), [1.0], name, rtol=rtol)
    np.testing.assert_array_equal(result.y, sw.solve_ivp(decay, (0, 10), [1.0], taken, rtol=rtol).y)
    assert result.njev == result.nlu == result.nfev // sw.method(taken).attempt_evaluations
    assert sw.solve_ivp(decay, (0, 10), [1.0]).njev == 0
    if name == "Radau":
        scipy = pytest.importorskip("scipy.integrate")
        with pytest.warns(UserWarning, match=f"{taken} is taken"):
            sw.solve_ivp(decay, (0, 10), [1.0], scipy.Radau, rtol=rtol)


def kepler(t: Any, y: Any) -> Any:
    r = (y[0] ** 2 + y[1] ** 2) ** 1.5
    return [y[2], y[3], -y[0] / r, -y[1] / r]


#: An orbit of eccentricity 0.9, of some thousand attempts.
ORBIT: dict[str, Any] = {"fun": kepler, "t_span": (0.0, 300.0), "y0": [0.1, 0.0, 0.0, np.sqrt(19.0)], "rtol": 1e-6, "atol": 1e-9}


def lsoda(**arguments: Any) -> Any:
    with pytest.warns(UserWarning, match="method: LSODA is not here; dop853 is taken, and rodas"):
        return sw.solve_ivp(method="LSODA", **arguments)


@for_each("options", [{}, {"t_eval": np.linspace(0.0, 300.0, 50)}, {"dense_output": True}, {"events": lambda t, y: y[0]}])
def test_lsoda_is_dop853_where_equations_are_not_stiff(options: dict[str, Any]) -> None:
    """To the bit, though it is made in pieces, after each of which stiffness is looked for."""
    result, same = lsoda(**ORBIT, **options), sw.solve_ivp(method="DOP853", **ORBIT, **options)
    assert result.nfev == same.nfev > 12 * 2048
    for name in ("t", "y"):
        assert result[name].tobytes() == same[name].tobytes()
    if result.sol is not None:
        between = np.linspace(0.0, 300.0, 1001)
        assert result.sol(between).tobytes() == same.sol(between).tobytes()


def robertson(t: Any, y: Any) -> Any:
    slow, fast = 0.04 * y[0] - 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return [-slow, slow - fast, fast]


def van_der_pol(t: Any, y: Any) -> Any:
    return [y[1], 1000.0 * (1.0 - y[0] ** 2) * y[1] - y[0]]


def hires(t: Any, y: Any) -> Any:
    a, b, c, d, e, f, g, h = y
    joins = 280.0 * f * h
    return [
        -1.71 * a + 0.43 * b + 8.32 * c + 0.0007, 1.71 * a - 8.75 * b, -10.03 * c + 0.43 * d + 0.035 * e,
        8.32 * b + 1.71 * c - 1.12 * d, -1.745 * e + 0.43 * f + 0.43 * g, -joins + 0.69 * d + 1.71 * e - 0.43 * f + 0.69 * g,
        joins - 1.81 * g, -joins + 1.81 * g,
    ]  # fmt: skip


def oregonator(t: Any, y: Any) -> Any:
    a, b, c = y
    return [77.27 * (b + a * (1.0 - 8.375e-6 * a - b)), (c - (1.0 + a) * b) / 77.27, 0.161 * (a - c)]


#: Function, end, start, and the largest of the states at the end, by the Test Set for IVP Solvers and, of Robertson's at 40, by
#: SciPy's Radau to 1e-11.
STIFF: dict[str, tuple[Any, float, list[float], int, float]] = {
    "robertson": (robertson, 40.0, [1.0, 0.0, 0.0], 0, 0.71582707),
    "van der Pol": (van_der_pol, 2000.0, [2.0, 0.0], 0, 1.706167732170483),
    "hires": (hires, 321.8122, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057], 7, 0.2850001604814231e-2),
    "oregonator": (oregonator, 360.0, [1.0, 2.0, 3.0], 1, 0.1228178521549917e4),
}


@for_each("name", STIFF)
@for_each("rtol", [1e-3, 1e-6])
def test_lsoda_goes_over_where_equations_are_stiff(name: str, rtol: float) -> None:
    """To the run of the method for stiff equations, which errs by less than a hundred tolerances."""
    fun, end, start, place, wanted = STIFF[name]
    options: dict[str, Any] = {"fun": fun, "t_span": (0.0, end), "y0": start, "rtol": rtol, "atol": 1e-6 * rtol}
    result, stiff = lsoda(**options), sw.solve_ivp(method="rodas4" if rtol == 1e-3 else "rodas5p", **options)
    assert result.y.tobytes() == stiff.y.tobytes()
    assert result.njev > 0
    assert result.y[place, -1] == pytest.approx(wanted, rel=100.0 * rtol)
    again = lsoda(**options)  # which is known now
    assert (again.y.tobytes(), again.nfev) == (stiff.y.tobytes(), stiff.nfev)
    events = lsoda(**options, events=lambda t, y: y[place] - wanted)  # which begin anew
    assert events.y.tobytes() == stiff.y.tobytes()
    early = lsoda(**options, events=event(lambda t, y: t - 1e-6 * end, terminal=True))  # before it is seen
    assert early.njev == 0


def test_events_and_room_for_steps_change_no_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both divide the run into pieces."""
    whole = sw.solve_ivp(**ORBIT)
    assert sw.solve_ivp(**ORBIT, events=lambda t, y: y[0]).y.tobytes() == whole.y.tobytes()
    monkeypatch.setattr(ivp_steps, "NUMBERS_AT_ONCE", 50)
    narrow = sw.solve_ivp(**ORBIT)
    assert narrow.y.tobytes() == whole.y.tobytes()
    assert (narrow.t.tobytes(), narrow.nfev) == (whole.t.tobytes(), whole.nfev)


def test_each_call_is_one_of_the_core(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    adapt = _core.adapt
    monkeypatch.setattr(_core, "adapt", lambda *arguments: calls.append(arguments) or adapt(*arguments))
    for method in ("DOP853", "rodas5p", "merson", "taylor"):
        for options in (
            {}, {"t_eval": [1.0, 5.0]}, {"max_step": 0.1}, {"first_step": 0.1}, {"vectorized": True}, {"t_span": (10.0, 0.0)},
            {"dense_output": True}, {"rtol": [1e-3, 1e-6]},
        ):  # fmt: skip
            calls.clear()
            arguments: dict[str, Any] = {"t_span": (0.0, 10.0), "method": method} | options
            result = sw.solve_ivp(turning_column if "vectorized" in options else turning, y0=[1.0, 0.0], **arguments)
            assert result.success
            assert len(calls) == 1, (method, options)
            if result.sol is not None:
                result.sol(np.linspace(0.0, 10.0, 1000))
                assert len(calls) == 2


def test_what_max_step_holds_down_is_not_stiff(monkeypatch: pytest.MonkeyPatch) -> None:
    """No method comes as far with half of the attempts, so none is tried: 2500 steps are 1024, 1024 and the rest."""
    calls: list[Any] = []
    adapt = _core.adapt
    monkeypatch.setattr(_core, "adapt", lambda *arguments: calls.append(arguments) or adapt(*arguments))
    result = lsoda(fun=turning, t_span=(0.0, 10.0), y0=[1.0, 0.0], max_step=0.004)
    assert (len(calls), result.njev) == (3, 0)


def turning_column(t: Any, y: Any) -> Any:
    return np.array([y[1], -y[0]])


RATE, RATES = 1.0, types.SimpleNamespace(k=1.0)


class Decay:
    """Equations of an object."""

    def __init__(self) -> None:
        self.k = 1.0

    def rates(self, t: Any, y: Any) -> Any:
        return -self.k * y


def of_attribute(t: Any, y: Any) -> Any:
    return -of_attribute.k * y  # type: ignore[attr-defined]


def test_what_a_function_reads_may_change_between_calls() -> None:
    """Its trace is kept, but never its numbers: a global, a captured one, those in an array, of an object, of arguments."""
    global RATE
    number, table, listed, own = 1.0, np.array([1.0]), [1.0], Decay()
    of_attribute.k = 1.0  # type: ignore[attr-defined]
    functions: dict[str, Any] = {
        "global": lambda t, y: -RATE * y,
        "captured": lambda t, y: -number * y,
        "array": lambda t, y: -table[0] * y,
        "list": lambda t, y: -listed[0] * y,
        "object": lambda t, y: -RATES.k * y,
        "method": own.rates,
        "attribute": of_attribute,
        "partial": functools.partial(lambda k, t, y: -k[0] * y, listed),
    }
    by_args = lambda t, y, k: -k[0] * y  # noqa: E731

    def ends() -> list[float]:
        found = [sw.solve_ivp(each, (0.0, 1.0), [1.0], rtol=1e-8, atol=1e-12).y[0, -1] for each in functions.values()]
        return [*found, sw.solve_ivp(by_args, (0.0, 1.0), [1.0], rtol=1e-8, atol=1e-12, args=(listed,)).y[0, -1]]

    for value in (1.0, 1.0, 2.0, 1.0, 3.0):
        RATE = number = table[0] = listed[0] = RATES.k = own.k = of_attribute.k = value  # type: ignore[attr-defined]
        assert ends() == pytest.approx(len(functions) * [np.exp(-value)] + [np.exp(-value)], rel=1e-6)


def test_a_function_is_recognised_by_what_it_reads_now() -> None:
    """Derivatives for an implicit method are traced when they are first needed, and not of numbers that have changed since."""

    def decaying(k: Any) -> Any:
        return lambda t, y: -k[0] * y

    k = np.array([1.25])
    sw.solve_ivp(decaying(k), (0.0, 1.0), [1.0])
    k[0] = 7.0
    again = sw.solve_ivp(decaying(np.array([1.25])), (0.0, 1.0), [1.0], "rodas5p", rtol=1e-8, atol=1e-12)
    assert again.y[0, -1] == pytest.approx(np.exp(-1.25), rel=1e-6)


def test_methods_of_one_name_are_told_apart() -> None:
    def of_weight(weight: float) -> Any:
        @sw.method
        def euler_heun(s: Any, t: Any, h: Any, v: Any, y: Any) -> Any:
            dv, dy = s.dv(t, v, y), s.dy(t, v, y)
            dv1, dy1 = s.dv(t + h, v + dv, y + dy), s.dy(t + h, v + dv, y + dy)
            steps = [weight * first + (1.0 - weight) * second for first, second in ((dv, dv1), (dy, dy1))]
            return v + steps[0], y + steps[1], 0.5 * (dv1 - dv), 0.5 * (dy1 - dy)

        return euler_heun

    ends = [sw.solve_ivp(decay, (0, 1), [1.0], of_weight(weight)).y[0, -1] for weight in (0.5, 0.75)]
    assert ends[0] != ends[1]


def test_a_function_is_traced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    traced: list[Any] = []
    made = ivp_function.Definition
    monkeypatch.setattr(ivp_function, "Definition", lambda *arguments: traced.append(arguments) or made(*arguments))
    monkeypatch.setattr(ivp_function, "_KNOWN", {})

    def growing(k: float) -> Any:
        return lambda t, y: k * y

    for rtol in (1e-3, 1e-6):
        for start in (1.0, 2.0):
            for end in (1.0, -1.0):
                found = sw.solve_ivp(growing(0.5), (0.0, end), [start], rtol=rtol)
                assert found.y[0, -1] == pytest.approx(start * np.exp(0.5 * end), rel=1e-2)
    assert len(traced) == 1
    # Another captured number is another number of the same operations.
    others: tuple[dict[str, Any], ...] = ({}, {"vectorized": True}, {"y0": [1.0, 1.0]}, {"fun": growing(1)})
    for number, options in enumerate(others, 1):
        found = sw.solve_ivp(**{"fun": growing(0.25), "t_span": (0.0, 1.0), "y0": [1.0]} | options)
        assert found.y[0, -1] == pytest.approx(np.exp(1.0 if "fun" in options else 0.25), rel=1e-2)
        assert len(traced) == number
    monkeypatch.setattr(ivp_function, "MOST_KNOWN", len(ivp_function._KNOWN))
    sw.solve_ivp(growing(2), (0.0, 1.0), [1.0])
    assert len(ivp_function._KNOWN) == 1  # it was full


def test_other_args_are_other_numbers_of_the_same_operations(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fit calls with one tuple of numbers after the other: nothing is traced anew, and nothing of a call is in the next."""
    monkeypatch.setattr(ivp_function, "_KNOWN", {})

    def driven(t: Any, y: Any, stiffness: Any, damping: Any, n: Any) -> Any:
        return [y[1], -stiffness * y[0] ** n - damping * y[1] + np.cos(stiffness * t)]

    def switched(t: Any, y: Any, at: Any, rate: Any) -> Any:
        return [np.where(t < at, rate, -rate) - 0.1 * y[0]]

    def chosen(t: Any, y: Any, rate: Any) -> Any:
        return [rate * y[0] if rate > 0.0 else -(y[0] ** 2)]  # by the number: it is no parameter

    def raised(t: Any, y: Any, power: Any) -> Any:
        return [-(y[0] ** power)]  # nor is this one: a product takes less time

    def of_a_kind(t: Any, y: Any, rate: Any) -> Any:  # the same for either kind where the rate is −1
        return [rate * y[0] if isinstance(rate, float) else -y[0]]

    def relaxing(t: Any, y: Any, mu: Any) -> Any:
        return [y[1], mu * (1.0 - y[0] ** 2) * y[1] - y[0]]

    def passed(t: float, y: Any, *args: Any) -> Any:
        return y[0] - 0.5 * sum(args)

    def capturing(mu: float, k: float) -> Any:
        def helped(x: Any) -> Any:
            return -mu * x

        return lambda t, y, *args: [helped(y[0]) + k * np.sin(k * t) + sum(args)]

    cases: list[tuple[Any, list[tuple[Any, ...]], int]] = [
        (driven, [(1.0, 0.1, 3), (2.0, 0.2, 3), (1.5, 0.0, 3), (1.0, 0.1, 3)], 1),
        (switched, [(0.5, 1.0), (0.25, 2.0), (0.75, 1.0)], 1), (relaxing, [(1.0,), (3.0,), (300.0,), (2.0,), (400.0,)], 1),
        (chosen, [(1.0,), (-1.0,), (2.0,)], 3), (raised, [(2.0,), (3.0,), (2.5,)], 3), (relaxing, [(math.pi,), (math.tau,)], 1),
        (of_a_kind, [(-1.0,), (2.0,), (1.0,)], 3), (capturing, [(1.0,), (2.0,), (0.5, 0.25), (1.5, 0.5)], 2),
    ]  # fmt: skip
    for fun, every, entries in cases:
        start = [1.0, 0.5][: 1 if fun in (switched, chosen, raised, of_a_kind, capturing) else 2]
        for more in ({}, {"t_eval": [0.5, 1.0]}, {"events": passed}, {"method": "LSODA"}):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                results = []
                ivp_function._KNOWN.clear()
                functions = [capturing(1.5, args[0]) if fun is capturing else fun for args in every]
                for each, args in zip(functions, every, strict=True):
                    results.append(sw.solve_ivp(each, (0.0, 1.0), start, args=args, rtol=1e-6, **more))  # type: ignore[arg-type]
                assert len(ivp_function._KNOWN) == entries, fun
                for each, args, result in zip(functions, every, results, strict=True):
                    ivp_function._KNOWN.clear()
                    alone = sw.solve_ivp(each, (0.0, 1.0), start, args=args, rtol=1e-6, **more)  # type: ignore[arg-type]
                    assert result.y.tobytes() == alone.y.tobytes(), (fun, args)
                    assert (result.nfev, result.t.tolist(), result.message) == (alone.nfev, alone.t.tolist(), alone.message)
    # What LSODA found of a run is not what it finds of others.
    monkeypatch.setattr(ivp_function, "_KNOWN", {})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        options: dict[str, Any] = {"method": "LSODA", "rtol": 1e-4}
        counts = [sw.solve_ivp(relaxing, (0.0, 400.0), [2.0, 0.0], args=(mu,), **options).nfev for mu in (1.0, 200.0, 1.0)]
    assert counts[0] == counts[2] > counts[1]
    for args in ((math.inf, 0.1, 3), (np.float64(2.0), np.array(0.5), 3)):  # what is no finite number stands as it is
        assert sw.solve_ivp(driven, (0.0, 0.5), [0.0, 0.0], args=args).status in (0, -1)


RIGHT: dict[str, Any] = {"fun": decay, "t_span": (0, 1), "y0": [1.0, 2.0]}
WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"method": "rk4"}, UnsupportedError, "method: rk4 does not estimate its error.*write one of these: '.*'dop853'"),
    ({"method": "nonsense"}, UnknownNameError, "there is no 'nonsense'"),
    ({"method": 3}, DTypeError, r"method: expected a name, got 3 \(int\)"),
    ({"y0": 1.0}, ShapeError, r"y0: expected a state of shape \(n,\), got shape \(\)"),
    ({"y0": []}, ShapeError, r"y0: expected a state of shape \(n,\), got shape \(0,\)"),
    ({"y0": [[1.0]]}, ShapeError, r"y0: expected a state of shape \(n,\), got shape \(1, 1\)"),
    ({"y0": [1j]}, DTypeError, "y0: expected real numbers, got .* complex128; write the equations of real"),
    ({"y0": [np.nan]}, ArgumentError, "y0: expected finite numbers"),
    ({"t_span": 1.0}, ShapeError, r"t_span: expected the times \(t0, tf\)"),
    ({"t_span": (0.0, 1.0, 2.0)}, ShapeError, r"t_span: expected the times \(t0, tf\)"),
    ({"t_span": (0.0, np.inf)}, ArgumentError, "t_span: expected finite numbers"),
    ({"t_eval": [0.5, 2.0]}, ArgumentError, "t_eval: expected times within t_span, 0 to 1, got 0.5 to 2"),
    ({"t_eval": [0.5, 0.2]}, ArgumentError, "t_eval: expected times that go from 0 to 1"),
    ({"t_eval": [0.5, 0.5]}, ArgumentError, "t_eval: expected times that go from 0 to 1"),
    ({"t_eval": 0.5}, ShapeError, "t_eval: expected times along one axis"),
    ({"first_step": 0.0}, ArgumentError, "first_step: expected numbers above zero"),
    ({"first_step": 2.0}, ArgumentError, "first_step: expected at most the whole time, 1, got 2"),
    ({"max_step": 0.0}, ArgumentError, "max_step: expected numbers above zero"),
    ({"rtol": 0.0}, ArgumentError, "rtol: expected numbers above zero"),
    ({"atol": -1.0}, ArgumentError, "atol: expected numbers of zero or more"),
    ({"atol": [1e-6, 1e-6, 1e-6]}, ShapeError, "atol: expected a number, or one for each of the 2 of the state"),
    ({"args": (3.0,)}, ArgumentError, r"fun, args: decay\(t, y\) is called with t, y and 1 args"),
    ({"events": lambda t: t}, ArgumentError, r"events, args: <lambda>\(t\) is called with t, y and 0 args"),
    ({"events": dict}, DTypeError, r"events: expected functions event\(t, y\), got <class 'dict'>"),
    ({"args": 3}, ArgumentError, r"args: expected a tuple such as args=\(a,\), got 3"),
    ({"events": 3}, DTypeError, "events: expected a list of functions, got 3"),
    ({"events": [3]}, DTypeError, r"events: expected functions event\(t, y\), got 3 \(int\)"),
    ({"events": lambda t, y: y}, DTypeError, "events: expected a function that returns one real number"),
    ({"events": event(height, terminal=-1)}, ArgumentError, "terminal: expected 0 or more"),
    ({"dense_output": 1}, DTypeError, "dense_output: expected True or False"),
    ({"fun": 3}, DTypeError, r"fun: expected a function fun\(t, y\), got 3 \(int\)"),
    ({"fun": sw.system(lambda t, v, y: -y)}, DTypeError, "got the system <lambda> of second order; use integrate"),
    ({"fun": np.sin}, DTypeError, "fun: expected a function written in Python"),
    ({"fun": lambda t, y: [1.0]}, TraceError, r"expected ẏ of shape \(2,\)"),
    ({"fun": lambda t, y: 1j * y}, TraceError, "complex"),
]  # fmt: skip


@for_each(("arguments", "error", "match"), WRONG)
def test_wrong_calls(arguments: dict[str, Any], error: type[Exception], match: str) -> None:
    refused(error, match, sw.solve_ivp, **RIGHT | arguments)


def test_arguments_of_implicit_methods_are_of_no_use() -> None:
    with pytest.warns(UserWarning, match="jac, min_step: of no use"):
        sw.solve_ivp(decay, (0, 1), [1.0], jac=lambda t, y: [[-0.5]], min_step=1e-9)
    sw.solve_ivp(decay, (0, 1), [1.0], jac=None)  # no warning, which would be an error
