"""Implicit methods go where the others go, and where a step of them has no Jacobian or no solution."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from scipy.special import exp1
from stepwell.model.systems import LinearSystem
from support.for_each import for_each
from support.ways import assert_equal_ways

IMPLICIT = [m.name for m in sw.methods() if m.is_implicit]
ABLE = [name for name in IMPLICIT if sw.method(name).error_order is not None]
WAYS = [*((name, "fixed") for name in IMPLICIT), *((name, "adaptive") for name in ABLE)]


@sw.system
def van_der_pol(t: Any, v: Any, y: Any, mu: Any = 50.0) -> Any:
    return mu * (1.0 - y * y) * v - y


def until(way: str, end: float) -> dict[str, Any]:
    """A run to a time, by fixed or by adaptive steps."""
    return {"dt": 0.02, "steps": round(end / 0.02)} if way == "fixed" else {"tolerance": 1e-5, "at": [end]}


@for_each("method, way", WAYS)
def test_events_act_and_stop(method: str, way: str) -> None:
    """Of the true motion: the first time at which y falls to 1, and again from where an event puts it."""
    fall = sw.Event(lambda t, v, y: y - 1.0, name="fall", then=lambda t, v, y: (v, y + 1.0))
    stop = sw.Event(lambda t, v, y: y - 1.0, name="fall", terminal=True)
    system, start = van_der_pol(mu=5.0), {"v": 0.0, "y": 2.0}
    fine = {"tolerance": 1e-12, "at": [9.0]}
    (first, second) = sw.integrate(system, "dop853", **start, events=fall, **fine).events["fall"].t[:2]
    run = sw.integrate(system, method, **start, events=fall, **until(way, 9.0))
    near = 0.02 if "euler" in method else 2e-3
    assert run.events["fall"].t[:2] == pytest.approx([first, second], rel=near)
    stopped = sw.integrate(system, method, **start, events=stop, **until(way, 9.0))
    assert stopped.status == sw.Status.EVENT
    assert float(stopped.stopped_at) == run.events["fall"].t[0]  # type: ignore[arg-type]


@for_each("method", IMPLICIT)
def test_what_is_around_a_system_is_in_its_jacobian(method: str) -> None:
    """A strong drag, a force and a spring to a floor: steps that no explicit method bears stay near the true motion."""
    drag = sw.system(lambda t, v, y: -1e4 * v)()
    run = sw.integrate(drag, method, v=1.0, y=0.0, force=1.0, dt=0.1, steps=100)
    if sw.stability.function(method).l_stable:
        assert float(run.v[-1]) == pytest.approx(1e-4, rel=1e-6)  # where the drag carries the force
    else:
        assert abs(float(run.v[-1])) < 1.0  # it changes its sign at each step
    with pytest.warns(sw.DivergenceWarning):
        sw.integrate(drag, "rk4", v=1.0, y=0.0, force=1.0, dt=0.1, steps=100)
    block = sw.Oscillator(1.0, friction=0.2, form="physical")
    ends = [sw.integrate(block, name, v=0.0, y=1.0, dt=0.01, steps=1000) for name in (method, "rk4")]
    assert float(ends[0].y[-1]) == pytest.approx(float(ends[1].y[-1]), abs=0.02)
    layout = np.stack([np.arange(3.0) * 0.5, np.zeros(3), np.ones(3)], axis=1)
    floor = sw.Floor(way="spring", omega=10.0)
    net = sw.Springs([(0, 1), (1, 2)], stiffness=1e4, layout=layout, masses=0.1, gravity=(0, 0, -9.81), damping=0.5, floor=floor)
    fallen = sw.integrate(net, method, v=0.0, y=layout, dt=1 / 120, steps=72)
    true = sw.integrate(net, "rk4", v=0.0, y=layout, dt=1 / 6000, steps=3600)
    assert fallen.y[-1] == pytest.approx(true.y[-1], abs=0.03 if "euler" in method else 5e-4)


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")  # without a control Euler's methods change it
@for_each("method", IMPLICIT)
def test_controls_keep_the_energy(method: str) -> None:
    bodies = {"v": np.array([[0.0, -1e-3], [0.0, 1.0]]), "y": np.array([[0.0, 0.0], [1.0, 0.0]]), "dt": 0.05, "steps": 200}
    system = sw.NBody(np.array([1.0, 1e-3]))
    free, kept = (
        sw.integrate(system, method, control=control, every=200, **bodies) for control in (None, sw.Projection("nacozy"))
    )
    energy = [[float(system.energy(run.v[k], run.y[k])) for k in (0, -1)] for run in (free, kept)]
    assert abs(energy[0][1] - energy[0][0]) > 100.0 * abs(energy[1][1] - energy[1][0])


# ---- large systems, whose equations are solved row by row, for their steps would have more than 20 000 operations

N = 600
CHAIN: dict[str, Any] = {"v": np.zeros(N), "y": np.linspace(0.0, 1.0, N)}


def test_a_large_system_goes_the_same_ways() -> None:
    """Its members, of which one is much stiffer, have steps of their own."""
    chain = sw.Chain(N, stiffness=np.ones((N + 1, 1)) * np.array([1.0, 1e4]))
    batch = {name: block[:, np.newaxis] * np.ones(2) for name, block in CHAIN.items()}
    ways = ("in pieces", "from a file", "alone")
    for method in ("linearly_implicit_euler", "trapezoidal", "rodas4"):
        assert_equal_ways(chain, method, **batch, dt=0.05, steps=4, ways=(*ways, "in a world"))
    assert_equal_ways(chain, "rosenbrock23", **batch, tolerance=1e-3, at=[0.1, 0.2], ways=ways)


def test_events_of_a_large_system() -> None:
    event = sw.Event(lambda t, v, y: y[N - 1] - 0.9, name="back")
    run, true = (
        sw.integrate(sw.Chain(N), method, **CHAIN, events=event, dt=0.05, steps=16).events["back"].t
        for method in ("rosenbrock23", "rk4")
    )
    assert run.size == 1
    assert run == pytest.approx(true, rel=1e-3)


def test_an_equation_may_ask_whether_a_number_is_zero() -> None:
    """Where the comparison has the constant first, as equal operations may, the rates' series compare as numbers do."""

    def ratio(x: Any) -> Any:
        return np.where(x == 0.0, 1.0, x / np.expm1(np.where(x == 0.0, 1.0, x)))

    @sw.system(order=1)
    def gate(t: Any, y: Any) -> Any:
        return [ratio(2.5 - 0.1 * y[0]) + ratio(1.0 - 0.1 * y[0]) - y[0]]

    start = {"y": np.array([[0.0, 25.0]]), "dt": 0.1, "steps": 5}
    run = sw.integrate(gate(), "rodas4", **start)
    assert np.isfinite(run.y[-1]).all()
    assert np.array_equal(run.y, sw.integrate(gate(), "rodas4", **start, backend="numpy").y)
    crossed = sw.Event(lambda t, y: y[0] - 20.0, name="crossed")
    assert sw.integrate(gate(), "rodas4", **start, events=crossed).events["crossed"].count.tolist() == [0, 1]


# ---- every function of own equations has its derivative

Rates = Callable[[Any], Any]


def words(*lines: str) -> list[str]:
    return " ".join(lines).split()


def row(*numbers: Any) -> Any:
    return np.stack(numbers)


OF_ONE = words(
    "abs absolute fabs acos arccos asin arcsin atan arctan cbrt ceil cos cosh deg2rad degrees exp exp2 expm1 floor log log10",
    "log1p log2 negative positive rad2deg radians real rint round sign sin sinh sqrt square tan tanh trunc",
)
OF_TWO = words(
    "add arctan2 atan2 copysign divide float_power fmax fmin hypot logaddexp maximum minimum mod multiply pow",
    "power remainder subtract",
)
COMPARE = words("equal greater greater_equal less less_equal not_equal logical_and logical_or")
OF_SEVERAL: dict[str, Rates] = {
    "all": lambda x: np.where(np.all(row(x > 0.0, x < 1.0)), x * x, x),
    "amax": lambda x: np.amax(row(x, x * x, 0.1)),
    "amin": lambda x: np.amin(row(x, x * x, 0.9)),
    "any": lambda x: np.where(np.any(row(x > 1.0, x < 0.5)), x * x, 3.0 * x),
    "clip": lambda x: np.clip(x, 0.0, 0.9) + np.clip(x, 0.9, 2.0) + np.clip(x, 0.0, x * x),
    "cross": lambda x: np.cross(row(x, 1.0, x * x), row(2.0, x, 1.0))[0],
    "cumsum": lambda x: np.cumsum(row(x, x * x, 1.0))[2],
    "diff": lambda x: np.diff(row(x, x * x * x))[0],
    "dot": lambda x: np.dot(row(x, 1.0), row(x, x * x)),
    "interp": lambda x: np.interp(x, [0.0, 0.5, 1.0, 2.0], [0.0, 1.0, 4.0, 5.0]),
    "inner": lambda x: np.inner(row(x, 1.0), row(x, x * x)),
    "logical_not": lambda x: np.where(np.logical_not(x < 0.5), x * x, x),
    "matmul": lambda x: np.matmul(row(row(x, 1.0), row(2.0, x)), row(x, x * x))[1],
    "max": lambda x: np.max(row(x, 0.2 * x)),
    "mean": lambda x: np.mean(row(x, x * x)),
    "min": lambda x: np.min(row(x, 0.2 * x)),
    "norm": lambda x: np.linalg.norm(row(x, 2.0 * x * x)),
    "outer": lambda x: np.outer(row(x, 1.0), row(x, x * x))[0, 1],
    "prod": lambda x: np.prod(row(x, x, 2.0)),
    "sum": lambda x: np.sum(row(x, x * x)),
    "trace": lambda x: np.trace(row(row(x, 1.0), row(2.0, x * x))),
    "vdot": lambda x: np.vdot(row(x, 1.0), row(x, x * x)),
    "where": lambda x: np.where(x < 0.5, x, -2.0 * x * x),
}
#: These arrange numbers and compute none.
ARRANGE = words(
    "array_split atleast_1d atleast_2d broadcast_to column_stack concatenate copy diag diagonal dstack empty_like expand_dims",
    "flip fliplr flipud full_like hstack moveaxis ndim ones_like ravel repeat reshape roll rollaxis rot90 shape size split",
    "squeeze stack swapaxes take tile transpose tril triu vstack zeros_like",
)


def comparing(name: str) -> Rates:
    function = getattr(np, name)
    return lambda x: np.where(function(x < 0.5, x > 0.2) if "logical" in name else function(x, 0.5), x * x, 3.0 * x)


def rates() -> dict[str, Rates]:
    """A rate for each function that own equations have; by each argument of those of two, and by both."""
    of = {name: lambda x, name=name: getattr(np, name)(x) for name in OF_ONE}
    of |= {name: lambda x, f=name: getattr(np, f)(x, 0.3 + x * x) + getattr(np, f)(1.5, x) for name in OF_TWO}
    return of | {name: comparing(name) for name in COMPARE} | OF_SEVERAL


def system_of(rate: Rates) -> sw.System:
    return sw.system(order=1)(lambda t, y: [rate(y[0]) + 0.125])()


def test_every_function_is_looked_at() -> None:
    assert sorted([*rates(), *ARRANGE]) == sw.equations.functions()


@pytest.mark.filterwarnings("ignore:y.0. ends at")  # Euler's step of 1 is taken for the rate alone
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_every_function_has_its_derivative_in_the_jacobian(dtype: str) -> None:
    """A linearly implicit step is f/(1 − h·f′) long; a rate without derivative would be taken for a constant without a word."""
    h, x, wrong = 2.0**-4, 0.77, []
    for name, rate in rates().items():
        system = system_of(rate)
        ends = [
            float(sw.integrate(system, "standard_euler", y=[x + d], dt=1.0, steps=1).y[-1, 0]) - x - d for d in (0.0, 1e-6, -1e-6)
        ]
        slope = (ends[1] - ends[2]) / 2e-6
        step = float(sw.integrate(system, "linearly_implicit_euler", y=[x], dt=h, steps=1, dtype=dtype).y[-1, 0]) - x
        expected = h * ends[0] / (1.0 - h * slope)
        if not abs(step - expected) <= (1e-8 if dtype == "float64" else 1e-6) * max(1.0, abs(expected)):
            wrong.append((name, step, expected))
    assert wrong == []


#: Functions at the ends of their domains: where that is, the way into the domain, and the integral over a distance from there.
ENDING: dict[str, tuple[Rates, float, float, Callable[[float], float]]] = {
    "root": (np.sqrt, 0.0, 1.0, lambda t: t**1.5 / 1.5),
    "power with a root": (lambda x: x**1.5, 0.0, 1.0, lambda t: t**2.5 / 2.5),
    "cube root": (np.cbrt, 0.0, 1.0, lambda t: 0.75 * t ** (4.0 / 3.0)),
    "angle": (np.arccos, 1.0, -1.0, lambda t: np.sqrt(2.0 * t - t * t) - (1.0 - t) * np.arccos(1.0 - t)),
    "other angle": (
        lambda x: np.pi / 2.0 + np.arcsin(x),
        -1.0,
        1.0,
        lambda t: np.sqrt(2.0 * t - t * t) - (1.0 - t) * np.arccos(1.0 - t),
    ),
    "drag": (lambda x: x * np.sqrt(x * x), 0.0, 1.0, lambda t: t**3 / 3.0),
    "length": (lambda x: x * np.hypot(x, x), 0.0, 1.0, lambda t: np.sqrt(2.0) * t**3 / 3.0),
    "end of a bump": (lambda x: np.exp(-1.0 / x), 0.0, 1.0, lambda t: t * np.exp(-1.0 / t) - exp1(1.0 / t)),
    "power by logarithm": (lambda x: np.exp(2.5 * np.log(x)), 0.0, 1.0, lambda t: t**3.5 / 3.5),
    # What saturates is constant far from its middle, where an exponential overflows.
    "sigmoid": (lambda x: 1.0 / (1.0 + np.exp(-x)), -1000.0, -1.0, lambda t: 0.0),
    "bell": (lambda x: x / x / np.cosh(x) ** 2 + 1.0, 1000.0, 1.0, lambda t: t),
    "square of a bell": (lambda x: (1.0 / np.cosh(x)) ** 2 + 1.0, -1000.0, 1.0, lambda t: t),
    "steep bell": (lambda x: 1.0 / np.cosh(900.0 * x) + 1.0, -0.784, 1.0, lambda t: t),  # whose slope alone overflows
    "Gompertz": (lambda x: np.exp(-np.exp(x)) + 1.0, 1000.0, 1.0, lambda t: t),
    "softplus": (
        lambda x: np.logaddexp(0.0, x) - x + np.logaddexp(x, -x) / 1000.0,
        1000.0,
        1.0,
        lambda t: t * (1.0 + t / 2000.0),
    ),
    "softplus below": (lambda x: np.logaddexp(x, 0.0) + 1.0, -1000.0, -1.0, lambda t: t),
    "limited": (lambda x: np.minimum(np.exp(x), 2.0), 1000.0, 1.0, lambda t: 2.0 * t),
}


@for_each("name", ENDING)
def test_a_step_may_begin_at_the_end_of_a_domain(name: str) -> None:
    """There a derivative that is not finite counts as zero, which the estimate of the error sees."""
    rate, at, way, integral = ENDING[name]
    system = sw.system(order=1)(lambda t, y: [way + 0.0 * y[0], rate(y[0]) + 0.0 * y[1]])()
    for method in [*ABLE, "taylor", *IMPLICIT]:
        if name == "limited" and method == "taylor":  # which refuses pieces
            continue
        pace = {"tolerance": 1e-7, "at": [0.5]} if method in [*ABLE, "taylor"] else {"dt": 2.0**-9, "steps": 256}
        run = sw.integrate(system, method, y=[at, 0.0], **pace)
        assert run.y[-1, 1] == pytest.approx(integral(0.5), rel=1e-5 if "tolerance" in pace else 1e-2, abs=1e-12), method
        few = {"y": [at, 0.0], "dt": 0.01, "steps": 2}
        assert np.array_equal(
            sw.integrate(system, method, **few).y, sw.integrate(system, method, **few, backend="numpy").y, equal_nan=True
        )


@for_each("n", [1.0, 1.5, 2.0, 2.5, 4.0, 6.0])
def test_a_power_at_zero_has_its_derivatives(n: float) -> None:
    """Where its exponent is a parameter, as in Hill's rates from rest: y' = 1, z' = yⁿ, w' = zⁿ."""

    @sw.system(order=1)
    def cascade(t: Any, y: Any, *, n: float = 2.0) -> Any:
        return [1.0 + 0.0 * y[0], y[0] ** n, y[1] ** n]

    m = n + 1.0
    expected = [0.5, 0.5**m / m, 0.5 ** (n * m + 1.0) / (m**n * (n * m + 1.0))]
    for method in [*ABLE, "taylor"]:
        run = sw.integrate(cascade(n=n), method, y=np.zeros(3), tolerance=1e-7, at=[0.5])
        assert run.y[-1] == pytest.approx(expected, rel=1e-5, abs=1e-10), method
    if n in (1.0, 2.0):  # of which every coefficient at zero is that of a product
        assert sw.integrate(cascade(n=n), "taylor", y=np.zeros(3), dt=0.125, steps=4).y[-1] == pytest.approx(expected, rel=1e-13)
    few = {"y": np.zeros(3), "dt": 0.01, "steps": 2}
    for method in ("rodas4", "taylor", "trapezoidal"):
        of_core, of_numpy = (sw.integrate(cascade(n=n), method, **few, backend=each).y for each in ("rust", "numpy"))
        assert np.array_equal(of_core, of_numpy)


@sw.system(order=1)
def filling(t: Any, y: Any) -> Any:
    """At y = (0, 1e-310) the rates are finite, and 1/y[1] is not."""
    return [y[0] / y[1] - y[0], 1.0 + 0.0 * y[0]]


@for_each("method", [*ABLE, "taylor"])
def test_a_derivative_that_is_not_finite_is_named(method: str) -> None:
    words = f"{method} needs the derivative of the rate of y\\[0\\] by y\\[0\\], which is infinite at the start"
    with pytest.warns(sw.ToleranceWarning, match=rf"the run stopped before t = 1, at t = 0; no step.*: {words}$"):
        run = sw.integrate(filling, method, y=[0.0, 1e-310], tolerance=1e-4, at=[1.0])
    assert run.status == sw.Status.NOT_FINITE
    sw.integrate(filling, "dop853", y=[0.0, 1e-310], tolerance=1e-4, at=[1.0])  # no warning, which would be an error


@for_each("method", IMPLICIT)
def test_its_neighbours_go_on(method: str) -> None:
    y = np.array([[0.0, 0.0, 0.5], [1.0, 1e-310, 2.0]])
    words = r"1 of 3 members diverged: member 1 at step 1 \(t = 0.1\), .*by y\[0\], which is inf"
    with pytest.warns(sw.DivergenceWarning, match=words):
        run = sw.integrate(filling, method, y=y, dt=0.1, steps=5)
    assert run.status.tolist() == [0, 1, 0]
    assert run.first_bad_step.tolist() == [-1, 1, -1]
    alone = [sw.integrate(filling, method, y=y[:, k], dt=0.1, steps=5).y[-1] for k in (0, 2)]
    assert np.array_equal(run.y[-1][:, [0, 2]], np.stack(alone, axis=1))


def test_a_large_system_is_not_searched() -> None:
    """Its derivatives would take more memory than the run."""
    n = 1200
    with pytest.warns(sw.DivergenceWarning, match=r"by linearly_implicit_euler with dt = 0.1$"):
        sw.integrate(sw.Chain(n, stiffness=1e308), "linearly_implicit_euler", v=np.zeros(n), y=np.ones(n), dt=0.1, steps=1)


@for_each("method", [*ABLE, "linearly_implicit_euler", "backward_euler"])
def test_a_singular_matrix_stops_its_member_alone(method: str) -> None:
    """With fixed steps: γ·h·λ = 1 in the one in the middle."""
    gamma = getattr(sw.method(method).steps, "METHOD", None)
    h = 0.25
    rate = 1.0 / ((gamma.gamma if gamma else 1.0) * h)
    system = LinearSystem(np.array([[[-1.0, rate, 0.5]]]), velocities=0)
    if 1.0 - (gamma.gamma if gamma else 1.0) * (h * rate) != 0.0:
        return  # rounding makes it a large number
    with pytest.warns(sw.DivergenceWarning, match=r"1 of 3 members diverged: member 1 at step 1 \(t = 0.25\)"):
        run = sw.integrate(system, method, y=np.ones((1, 3)), dt=h, steps=4)
    assert run.status.tolist() == [0, 1, 0]
    for k, each in ((0, -1.0), (2, 0.5)):
        assert run.y[-1, 0, k] == sw.integrate(LinearSystem([[each]], velocities=0), method, y=[1.0], dt=h, steps=4).y[-1, 0]
    v, y = np.empty((0, 3)), np.ones((1, 3))
    world = sw.World(system, method, v=v, y=y, dt=h)
    with pytest.warns(sw.DivergenceWarning, match="1 of 3 members diverged: member 1, before step 4"):
        world.step(4)
    assert np.array_equal(y[:, [0, 2]], run.y[-1][:, [0, 2]])
    assert not np.isfinite(y[0, 1])


@for_each("method", ABLE)
def test_with_a_tolerance_such_a_step_is_rejected(method: str) -> None:
    """And a shorter one goes on; the neighbours have the bits that they have alone."""
    gamma = sw.method(method).steps.METHOD.gamma  # type: ignore[attr-defined]
    rates = np.array([-1.0, 2.0, 0.5])
    first = 1.0 / (gamma * 2.0)
    system = LinearSystem(rates[np.newaxis, np.newaxis], velocities=0)
    ask: dict[str, Any] = {"dt": first, "tolerance": 1e-6, "at": [3.0], "ways": ("by the reference", "alone")}
    run = assert_equal_ways(system, method, v=np.zeros((0, 3)), y=np.ones((1, 3)), **ask)
    assert run.status.tolist() == [0, 0, 0]
    assert run.paces.rejected[1] > 0
    assert run.y[-1, 0] == pytest.approx(np.exp(3.0 * rates), rel=1e-3)


def test_a_singular_matrix_within_a_run_says_when() -> None:
    """ẏ = a(t)·y with a = 1/h from t = 0.9 on; a step has the Jacobian of its start."""
    system = sw.system(order=1)(lambda t, y: y * np.where(t < 0.9, -1.0, 8.0))()
    with pytest.warns(
        sw.DivergenceWarning, match=r"the run diverged at step 9 \(t = 1.125\), by linearly_implicit_euler with dt = 0.125"
    ):
        run = sw.integrate(system, "linearly_implicit_euler", y=1.0, dt=0.125, steps=10)
    assert int(run.first_bad_step) == 9
    assert math.isfinite(float(sw.integrate(system, "linearly_implicit_euler", y=1.0, dt=0.125, steps=8).y[-1]))
