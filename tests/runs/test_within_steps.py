"""States at saved times within steps: by the continuous extension of the method, and by steps where that is not enough."""

import importlib
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.reference import adaptive
from stepwell.reference.steppers import taylor
from support.ways import assert_equal_ways

#: The order of each continuous extension: states at a share of a step err by this power of its length and one more.
ORDERS = {
    "merson": 4, "fehlberg": 4, "fehlberg_5": 4, "bs32": 3, "dopri5": 4, "tsit5": 4, "vern7": 7, "dop853": 7,
    "rosenbrock23": 2, "rodas4": 3, "rodas5p": 4,
}  # fmt: skip
STIFF = ("rosenbrock23", "rodas4", "rodas5p")


@sw.system
def duffing(t: Any, v: Any, y: Any, *, beta: Any = 0.3) -> Any:
    return y - y**3 - beta * v + 0.5 * np.cos(1.2 * t)


@sw.system
def pulled(t: Any, v: Any, y: Any, *, pull: Any = 0.0) -> Any:
    return pull - np.sin(y)


START = {"v": np.linspace(-0.5, 0.4, 5), "y": np.linspace(0.3, 1.4, 5)}


def test_every_pair_but_vern9_has_one() -> None:
    having = {each.name for each in sw.methods() if each.extension_evaluations}
    pairs = {each.name for each in sw.methods() if each.error_order is not None and not each.has_series}
    assert having == set(ORDERS) == pairs - {"vern9"}


def local(method: str, h: float, share: float) -> float:
    """The error of the state at a share of one step of a pendulum."""
    of_pendulum = sw.Pendulum()
    v, y = np.array([0.3]), np.array([1.1])
    steps = importlib.import_module(f"stepwell.reference.steppers.{method}")
    terms = steps.extension(of_pendulum.reference_at_step(h, ()), 0.0, h, v, y)
    made = adaptive.within(terms, v, y, share)
    v1, y1 = v, y
    for _ in range(4):
        v1, y1 = taylor.step(of_pendulum.reference_at_step(0.25 * share * h, ()), 0.0, 0.25 * share * h, v1, y1)
    return float(max(np.abs(made[0] - v1).max(), np.abs(made[1] - y1).max()))


@pytest.mark.parametrize("method", sorted(set(ORDERS) - set(STIFF)))
def test_the_order_of_each_extension(method: str) -> None:
    """Halving a step divides the error within it by 2^(order + 1); long enough steps that it is no rounding."""
    power, h = ORDERS[method] + 1, 0.8 if ORDERS[method] > 4 else 0.1
    for share in (0.2, 0.5, 0.77):
        falls = np.log2(local(method, h, share) / local(method, 0.5 * h, share))
        assert power - 0.35 < falls < power + 2.0, (share, falls)


@pytest.mark.parametrize("method", sorted(ORDERS))
def test_it_begins_and_ends_as_the_step_does(method: str) -> None:
    """At the end of the step it is its result, within rounding of its largest weight."""
    steps = importlib.import_module(f"stepwell.reference.steppers.{method}")
    weights = np.array(steps.EXTENSION)
    ends = np.zeros(weights.shape[1])
    ends[: len(steps.WEIGHTS)] = np.array(steps.WEIGHTS)[: len(ends)]
    assert np.abs(weights.sum(axis=0) - ends).max() < 8 * np.spacing(np.abs(weights).max())
    if method not in STIFF:  # whose stages are no rates
        begins = np.zeros(weights.shape[1])
        begins[0] = 1.0
        np.testing.assert_allclose(weights[0], begins, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("method", sorted(ORDERS))
def test_bits_are_those_of_the_reference(method: str) -> None:
    at = np.sort(np.random.default_rng(3).uniform(0.0, 3.0, 25))
    tolerance = 1e-5 if ORDERS[method] > 3 else 1e-3
    ways = ("by the reference", "alone", "in company", "in pieces", "prepared", "saved more often")
    assert_equal_ways(duffing(beta=np.linspace(0.1, 0.4, 5)), method, ways=ways, tolerance=tolerance, at=at, **START)
    assert_equal_ways(duffing(), method, ways=ways[:1], tolerance=tolerance, at=at, fused=True, **START)


@pytest.mark.parametrize("method", ["tsit5", "dop853", "rodas5p"])
def test_with_each_option_bits_are_those_of_the_reference(method: str) -> None:
    at, ways = np.sort(np.random.default_rng(3).uniform(0.0, 6.0, 40)), ("by the reference", "alone", "at each level")
    options: list[tuple[Any, dict[str, Any]]] = [
        (pulled(pull=sw.Sampled([0.0, 0.7, -0.2, 0.4], 1.5)), {}),
        (duffing(), {"at": np.sort(np.random.default_rng(4).uniform(0.0, 6.0, (30, 5)), axis=0)}),
        (duffing(), {"at": -at}),
        (pulled(), {"events": sw.Event(lambda t, v, y: y, then=lambda t, v, y: (1.1 * v, y))}),
        (pulled(), {"events": sw.Event(lambda t, v, y: v, terminal=2)}),
        (duffing(), {"jumps": [1.1, 4.2], "force": np.array(0.3)}),
    ]
    for system, more in options:
        assert_equal_ways(system, method, ways=ways, tolerance=1e-5, **({"at": at} | START | more))


def test_a_large_system_has_the_same_bits() -> None:
    """One whose step is no tape: its stages go over rows."""
    scene, at = sw.scenes.scene("cloth"), [0.05, 0.051, 0.11, 0.2]
    for method in ("dopri5", "dop853"):
        core, numpy = (
            sw.integrate(scene.system, method, v=scene.v, y=scene.y, tolerance=1e-5, at=at, backend=backend)
            for backend in ("rust", "numpy")
        )
        np.testing.assert_array_equal(core.y, numpy.y)
        np.testing.assert_array_equal(core.v, numpy.v)
        np.testing.assert_array_equal(core.paces.evaluations, numpy.paces.evaluations)


@pytest.mark.parametrize("method", sorted(ORDERS))
def test_a_state_does_not_depend_on_other_times_but_on_whether_it_is_the_last(method: str) -> None:
    at = np.linspace(0.1, 8.0, 100)
    tolerance = 1e-6 if ORDERS[method] > 3 else 1e-4
    many = sw.integrate(duffing(), method, tolerance=tolerance, at=at, **START)
    few = sw.integrate(duffing(), method, tolerance=tolerance, at=at[[3, 40, 41, 99]], **START)
    np.testing.assert_array_equal(few.y, many.y[[3, 40, 41, 99]])
    last = sw.integrate(duffing(), method, tolerance=tolerance, at=at[-1:], **START)
    np.testing.assert_array_equal(last.y[0], many.y[-1])
    np.testing.assert_array_equal(last.paces.accepted, many.paces.accepted)
    np.testing.assert_array_equal(last.paces.rejected, many.paces.rejected)
    early = sw.integrate(duffing(), method, tolerance=tolerance, at=at[40:41], **START)
    size = np.abs(many.y).max()
    assert 0.0 < np.abs(early.y[0] - many.y[40]).max() < 10.0 * tolerance * size


@sw.system(order=1, shape=(3,))
def cascade(t: Any, y: Any) -> Any:
    """Each decays into the next: the last grows with the square of the time, and the first falls."""
    return [-20.0 * y[0], 20.0 * y[0] - 3.0 * y[1], 3.0 * y[1]]


@pytest.mark.parametrize("method", ["bs32", "tsit5", "dop853", "rodas4", "rosenbrock23"])
def test_a_number_that_changes_by_orders_of_magnitude_in_a_step_is_followed_by_steps(method: str) -> None:
    """With one number of tolerance, which is relative to the present size: the last amount is 1e-17 and not an error of 1e-6."""
    start = np.array([[1.0, 1.0, 0.5], [0.0, 1e-3, 0.0], [0.0, 1e-9, 0.0]])
    at = np.append(np.geomspace(1e-9, 1.0, 30), [1.5, 2.0])
    for tolerance in (1e-1, 1e-3):
        run = assert_equal_ways(cascade, method, ways=("by the reference", "alone"), tolerance=tolerance, at=at, y=start)
        t = at[:, np.newaxis]
        a = np.exp(-20.0 * t)
        b = (20.0 / 17.0) * (np.exp(-3.0 * t) - a)
        exact = np.stack([a, b, 1.0 - a - b], axis=1)[..., 0]
        between = sw.integrate(cascade, method, tolerance=tolerance, at=at[-1:], y=start, every=1)(at)
        np.testing.assert_allclose(between, run.y, rtol=20.0 * tolerance, atol=0.0)
        seen = exact > 1e-12  # the closed form of the last cancels
        assert (np.abs(run.y[..., 0] / exact - 1.0)[seen] < 100.0 * tolerance).all()
        assert (run.y >= 0.0).all()


@sw.system(order=1)
def gated(t: Any, y: Any, *, begin: Any = 0.4, end: Any = 0.8) -> Any:
    """A pulse of 100, whose times cannot be told from the equations, since 0·y is added."""
    s = t + 0.0 * y
    return np.where((s > begin) & (s < end), 100.0, 0.0) - 2.0 * y


def test_where_a_step_between_is_rejected_there_are_shorter_ones() -> None:
    """As states of ``run(t)`` in steps in which a number changes much."""
    times = np.linspace(0.0, 3.0, 301)
    for method in ("dopri5", "tsit5", "merson", "dop853"):
        run = sw.integrate(gated, method, y=5e-4, tolerance=1e-2, at=[3.0], every=1)
        between = run(times)
        inside = np.clip(times - 0.4, 0.0, 0.4)
        exact = (5e-4 * np.exp(-2.0 * times)) - 50.0 * np.expm1(-2.0 * inside) * np.exp(-2.0 * np.maximum(times - 0.8, 0.0))
        assert np.abs(between - exact).max() < 0.1 * exact.max()


def test_states_that_owe_more_take_a_step_each() -> None:
    """Projected ones, amounts that do not become negative, and float32: they are those of a run that ends there."""
    at = [0.3, 0.9, 1.5]
    aircraft = sw.Aircraft("quaternion", roll=30.0)
    cases: list[tuple[Any, dict[str, Any], dict[str, Any]]] = [
        (aircraft, {"v": 0.0, "y": aircraft.attitude()}, {"control": sw.Projection("norm")}),
        (sw.Pendulum(), {"v": 0.2, "y": 1.0}, {"dtype": "float32"}),
        (sw.Oscillator(), {"v": 1.0, "y": 1.0}, {"positive": True}),
    ]
    for system, start, options in cases:
        for method in ("dopri5", "dop853"):
            run = sw.integrate(system, method, tolerance=1e-4, at=at, **start, **options)
            alone = sw.integrate(system, method, tolerance=1e-4, at=at[:1], **start, **options)
            np.testing.assert_array_equal(run.y[0], alone.y[0])


@pytest.mark.parametrize("method", ["dopri5", "dop853", "merson", "tsit5", "vern7"])
def test_errors_within_steps_are_those_of_the_tolerance(method: str) -> None:
    """From where a step begins: the state within it errs by the tolerance of the largest size so far, as its end does.

    An estimate may be small by chance, so that a step is longer than the others: ten times the tolerance is seen once in some
    thousand steps, in the mean a tenth of it.
    """
    for system, start, end in (
        (sw.Pendulum(), {"v": 0.0, "y": 3.1}, 40.0),
        (duffing(), {"v": 0.0, "y": 0.5}, 40.0),
        (sw.NBody(masses=[1.0, 1e-3]), {"v": [[0.0, 0.0, 0.0], [0.0, 1.3, 0.0]], "y": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]}, 30.0),
    ):
        for tolerance in (1e-4, 1e-7, 1e-10):
            shares = []
            steps = sw.integrate(system, method, tolerance=tolerance, at=[end], every=1, **start)
            for share in (0.3, 0.6, 0.9):
                at = np.append(steps.t[:-1] + share * np.diff(steps.t), end)
                within = sw.integrate(system, method, tolerance=tolerance, at=at, **start)
                exact = steps(at[:-1])  # by a step of the method from the step before
                size = np.abs(steps.y).max()
                shares.append(np.abs(within.y[:-1] - exact[1]).max(axis=tuple(range(1, within.y.ndim))) / (tolerance * size))
            assert np.max(shares) < 10.0, (system, tolerance, np.max(shares))
            assert np.median(shares) < 0.1, (system, tolerance, np.median(shares))
