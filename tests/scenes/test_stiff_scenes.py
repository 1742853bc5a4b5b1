"""The stiff scenes: their true motions, errors of components, and advice and charts that choose implicit methods and say why."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs.findings.stiffness import limit_of
from stepwell.scenes.base import LEAST_SCALE
from stepwell.scenes.truth import METHOD, METHOD_IF_STIFF, method_for, with_truth
from stepwell.views.charts.panel_picture import _blows_up
from support.advised import unmeasured  # noqa: F401
from support.charted import _hasty_times  # noqa: F401
from support.stiff_problems import PROBLEMS

STIFF = {name: sw.scenes.scene(name) for name in ("rober", "oregonator", "hires", "van_der_pol:mu=1000")}
METHODS = ["rk4", "fehlberg_5", "dop853", "rosenbrock23", "rodas4", "rodas5p"]


@pytest.mark.parametrize("name", ["rober", "oregonator", "hires"])
def test_the_true_motion_is_that_of_the_test_set(name: str) -> None:
    """By an implicit method to 1e-14, where an explicit one takes millions of steps; the published values have 11 digits."""
    problem = PROBLEMS[name]
    times = np.array(list(problem.values))
    scene = replace(STIFF[name], horizon=float(times.max()))
    known = with_truth(scene)
    assert known.until == scene.horizon
    assert known.exact is not None
    np.testing.assert_allclose(known.exact(times)[1], list(problem.values.values()), rtol=2e-10)
    assert np.array_equal(scene.y, problem.start)


def test_the_true_motion_of_van_der_pol_is_that_of_the_test_set_by_an_implicit_method() -> None:
    known = with_truth(STIFF["van_der_pol:mu=1000"])
    assert known.exact is not None
    v, y = known.exact(np.array([1000.0, 2000.0]))
    wanted = np.array([[-1.863646254808130, 0.7535430865435460], [1.706167732170456, -0.8928097010248257]])
    np.testing.assert_allclose(np.stack([y, 1000.0 * v], axis=1), wanted, rtol=1e-10)
    assert {method_for(scene) for scene in STIFF.values()} == {METHOD_IF_STIFF}
    for name in ("van_der_pol:mu=1", "pendulum", "kepler:e=0.9", "chain", "double_pendulum"):
        assert method_for(sw.scenes.scene(name)) == METHOD, name
    known = with_truth(STIFF["rober"])
    assert pickle.loads(pickle.dumps(known)) == known


# ---- errors of each component
def test_each_component_of_own_equations_has_an_error_and_each_block_of_others() -> None:
    """The second reactant of Robertson's is at most 3.65e-5: beside the others nobody would see that it is wrong."""
    scene = with_truth(STIFF["rober"])
    assert scene.exact is not None
    t = np.array([1.0, 10.0, 40.0])
    v, y = scene.exact(t)
    assert scene.scales_of_numbers[1] == pytest.approx([1.0, 3.65e-5, 0.284], rel=0.01)
    for part in range(3):
        wrong = y.copy()
        wrong[:, part] += 0.01 * scene.scales_of_numbers[1][part]
        assert scene.state_error_at(t, v, wrong) == pytest.approx(np.full(3, 0.01), rel=1e-6)
    scene = sw.scenes.clover()
    assert not scene.system.groups
    assert scene.relative_lengths(scene.v[np.newaxis], scene.y[np.newaxis]).shape == (2, 1)
    assert [np.unique(each).tolist() for each in scene.scales_of_numbers] == [[scale] for scale in scene.scales]
    rows = sw.Scene(
        by_row(), y=np.eye(3)[:2], horizon=1.0, exact=lambda t: (np.zeros((len(t), 0)), np.tile(np.eye(3)[:2], (len(t), 1, 1)))
    )
    assert rows.group_scales == [1.0, 1.0]


def test_a_linear_system_counts_by_state_and_what_is_rounding_counts_by_its_block() -> None:
    system = sw.LinearSystem([[-1.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 0.0]], velocities=0)

    def exact(t: Any) -> Any:
        return np.zeros((len(t), 0)), np.stack([np.exp(-t), 1e-5 * np.exp(-2.0 * t), np.zeros(len(t))], axis=1)

    scene = sw.Scene(system, y=[1.0, 1e-5, 0.0], horizon=1.0, exact=exact)
    t = np.array([0.5])
    v, y = exact(t)
    assert scene.state_error_at(t, v, y + np.array([0.0, 1e-6, 0.0])) == pytest.approx([0.1])
    assert scene.state_error_at(t, v, y + np.array([0.0, 0.0, 1e-16])) == pytest.approx([1e-16 / LEAST_SCALE])
    advice = sw.advise(scene, frame=None, tolerance=1e-4, methods=["rk4", "standard_heun"], cost="evaluations")
    best = advice.best
    run = advice.run()
    assert scene.state_error(run).max() == pytest.approx(best.error)
    assert best.predicted == pytest.approx(best.error, rel=0.02)


@sw.system(order=1, shape=(2, 3), scale="row")
def by_row(t: Any, y: Any) -> Any:
    return 0.0 * y


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(("name", "least"), [("rober", 100.0), ("hires", 50.0), ("van_der_pol", 10.0)])
def test_advice_is_implicit_where_that_is_the_cheapest_and_says_why(name: str, least: float) -> None:
    advice = sw.advise(sw.scenes.scene(name), frame=None, tolerance=1e-3, methods=METHODS, cost="evaluations")
    best, stiff = advice.best, advice.stiff
    assert best.method.is_implicit
    assert best.error <= 1e-3
    assert stiff.ratio == best.dt / stiff.limit > least
    assert not sw.method(stiff.method).is_implicit
    explicit = [name for name in METHODS if not sw.method(name).is_implicit]
    assert stiff.limit == pytest.approx(max(limit_of(sw.method(each), 0, -stiff.rate) for each in explicit))
    (line,) = [line for line in str(advice).splitlines() if line.startswith("It is stiff")]
    assert f"explicit steps are stable up to dt = {stiff.limit:.3g} ({stiff.method})" in line
    assert advice.data()["stiff"]["ratio"] == stiff.ratio
    assert "= inf" not in str(advice)


@pytest.mark.usefixtures("unmeasured")
def test_the_limit_that_advice_tells_is_where_an_explicit_method_blows_up() -> None:
    """Steps of nine tenths of it are stable to the end, and of eleven tenths are not."""
    scene = STIFF["rober"]
    stiff = sw.advise(scene, frame=None, tolerance=1e-2, methods=METHODS, cost="evaluations").stiff
    run = scene.run(stiff.method, 0.9 * stiff.limit)
    assert np.abs(run.y[-1] / PROBLEMS["rober"].values[40.0] - 1.0).max() < 1e-3
    with pytest.warns(sw.DivergenceWarning):
        scene.run(stiff.method, 1.1 * stiff.limit)


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("name", ["oscillator", "pendulum", "clover", "van_der_pol:mu=1"])
def test_advice_stays_explicit_on_what_is_not_stiff(name: str) -> None:
    advice = sw.advise(name, frame=None, tolerance=1e-3, methods=METHODS, cost="evaluations")
    assert not advice.best.method.is_implicit
    assert advice.stiff is None
    assert "stiff" not in str(advice)
    assert advice.data()["stiff"] is None


@pytest.fixture(scope="module", name="chart")
def the_chart() -> sw.charts.WorkPrecision:
    return sw.charts.work_precision(
        "rober", ["rk4", "fehlberg_5", "rosenbrock23", "rodas4"], [40, 400, 4000, 40_000, 200_000], tolerances=[1e-2, 1e-5]
    )


def test_charts_say_where_explicit_methods_blow_up_and_what_an_implicit_one_bears(chart: sw.charts.WorkPrecision) -> None:
    curves = {curve.name: curve for curve in chart.curves}
    stiff = chart.stiff
    assert stiff.limit == max(curves[name].largest_stable_step for name in ("rk4", "fehlberg_5"))
    assert 0.0 < stiff.limit < 0.002
    assert stiff.dt > 5.0 * stiff.limit
    assert chart.as_dict()["stiff"] == stiff._asdict()
    assert any(f"explicit methods blow up beyond dt = {stiff.limit:.2g}" in text.get_text() for text in chart.plot().texts)
    assert _blows_up(stiff) == f"; explicit: unstable beyond dt = {stiff.limit:.2g}"
    best = chart.best(1e-3)
    assert best["method"].startswith("ro")
    coarse = sw.charts.work_precision("rober", ["rk4", "rodas4"], [400, 4000], tolerances=[1e-3])
    stiff = coarse.stiff
    assert (stiff.explicit, stiff.limit) == ("", 0.01)
    assert str(stiff).startswith("explicit methods blow up with every step to dt = 0.01; Rodas4")
    tame = sw.charts.work_precision("oscillator", ["rk4", "rodas4"], [100, 1000, 10_000], tolerances=[1e-3])
    assert tame.stiff is None
    assert _blows_up(tame.stiff) == ""
    assert sw.charts.work_precision("rober", ["rk4"], [400], tolerances=[]).stiff is None
