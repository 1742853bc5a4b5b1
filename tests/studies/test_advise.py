"""Advice, against brute force: what it says is true when run in full, and nothing that is tried is much cheaper."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.studies.advice import by_cost_and_error, knows_motion
from stepwell.studies.advice.costs import Times, cost_noise
from stepwell.studies.advice.result import about
from stepwell.studies.advice.search import Search
from stepwell.studies.advice.trials import Trial
from support import stiff
from support.advised import (  # noqa: F401
    RATIO,
    WORTH,
    _times_are_measured_once,
    assert_cheap,
    assert_true,
    brute_of,
    evaluations_of,
    pendulum,
    scene_of,
    tried,
    unmeasured,
)
from support.families import family
from support.looped import looped

from benches.advice import Brute

#: Of these scenes all six tolerances take a moment; of the others some are tried here, and all by ``python -m benches.advice``.
QUICK = ("oscillator", "forced_oscillator", "clover", "pendulum")
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
SLOW = {
    "aircraft": (1e-2, 1e-4),
    "arenstorf": (1e-2, 1e-5),
    "figure_eight": (1e-2, 1e-4),
    "kepler": (1e-1, 1e-3, 1e-6),
    "symmetric_top": (1e-2, 1e-5),
    **dict.fromkeys(("dzhanibekov", "gimbal_trap"), (1e-1, 1e-3)),
    **dict.fromkeys(("double_pendulum", "triple_pendulum"), (1e-2,)),
    **dict.fromkeys(("chain", "heavy_top", "pythagorean", "rope_bridge"), (1e-3,)),
    **dict.fromkeys(("cloth", "energy_control", "jelly_cube", "plummer"), ()),
    "bouncing_ball": (),  # its error is no power of the step
    **dict.fromkeys(stiff.SCENES, ()),  # explicit methods take millions of steps: test_stiff_scenes.py
    # No adaptive steps to compare with, and errors that jump from step to step: test_friction.py has the advice for one.
    **dict.fromkeys(("sliding_block", "sticking_block"), ()),
}
CASES = {scene.name: TOLERANCES if scene.name in QUICK else SLOW.get(scene.name, TOLERANCES) for scene in sw.scenes.scenes()}


FRAMES = dict.fromkeys(QUICK, (1e-2, 1e-4)) | {"chain": (1e-2,), "figure_eight": (1e-4,), "kepler": (1e-3,)}


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(
    ("name", "tolerance", "frames"),
    [*tried(CASES, ("pendulum", "kepler", "symmetric_top"), None), *tried(FRAMES, ("clover",), 160)],
)
def test_the_advice_is_true_and_near_the_cheapest(name: str, tolerance: float, frames: int | None) -> None:
    """Of any steps, and of steps within frames."""
    brute = brute_of(name, frames)
    advice = sw.advise(brute.given, frame=frames and brute.frame, tolerance=tolerance, cost="evaluations")
    assert advice.best is not None
    assert_true(brute, advice)
    assert_cheap(brute, advice)
    if frames is None:
        listed = [row.name for row in advice.ranked] + [each.name for each in advice.rejected]
        paced = [f"{m.name}, tolerance" for m in sw.methods() if m.error_order is not None and not m.has_series]
        tried_all = (m.name for m in sw.methods() if not knows_motion(m, brute.scene.system))
        assert sorted(listed) == sorted([*tried_all, *paced])


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(("name", "tolerance"), [("energy_control", 1e-1), pytest.param("plummer", 1e-3, marks=pytest.mark.long)])
def test_the_advice_for_what_takes_long_is_true(name: str, tolerance: float) -> None:
    """Their runs are long, so only few methods are asked for, and chaos is judged for a while only."""
    methods = ("rk4",) if name == "energy_control" else ("pefrl", "fehlberg_5")
    brute = Brute(replace(scene_of(name), horizon=25.0 if name == "energy_control" else 10.0), None, RATIO)
    advice = sw.advise(brute.given, frame=None, tolerance=tolerance, methods=methods, cost="evaluations")
    assert advice.best is not None
    assert_true(brute, advice)


@pytest.mark.usefixtures("unmeasured")
def test_what_is_not_known_to_the_end_is_judged_as_far_as_it_is() -> None:
    """And that is the farther, the less is asked for: the true motion must be known a tenth of the tolerance well."""
    far = []
    for tolerance in (1e-1, 1e-3, 1e-6):
        advice = sw.advise("energy_control", frame=None, tolerance=tolerance, methods=["standard_euler"], cost="evaluations")
        assert advice.cut
        assert "judged up to t = " in str(advice)
        far.append(advice.scene.horizon)
    assert far[0] > far[1] > far[2] > 30.0


@pytest.mark.parametrize("name", family(["kepler", "arenstorf", "pythagorean"], lambda name: name == "kepler"))
def test_adaptive_steps_win_where_bodies_meet(name: str) -> None:
    advice = sw.advise(scene_of(name), frame=None, tolerance=1e-2)
    best = advice.best
    assert best.tolerance is not None
    assert best.substeps is None
    assert (best.margin, best.limit, best.limit_by) == (math.inf, None, "none")
    assert f"with adaptive steps to a tolerance of {best.tolerance:g}" in str(advice)
    assert "what is too long is rejected" in str(advice)


@pytest.mark.usefixtures("unmeasured")
def test_fixed_steps_only() -> None:
    methods = ["leapfrog", "pefrl", "rk4", "fehlberg_5", "dop853"]
    both = sw.advise("kepler", frame=0.1, tolerance=1e-2, cost="evaluations", methods=methods).best
    advice = sw.advise("kepler", frame=0.1, tolerance=1e-2, cost="evaluations", methods=methods, fixed=True)
    assert {row.by for row in advice.ranked} == {each.by for each in advice.rejected} == {"step"}
    assert advice.best.evaluations_per_time > 2.0 * both.evaluations_per_time


@pytest.mark.usefixtures("unmeasured")
def test_the_worst_frame_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against runs that end with each frame, whose steps are counted."""
    advice = sw.advise("kepler", frame=0.1, tolerance=1e-3, methods=["fehlberg_5"], cost="evaluations")
    (row,) = (row for row in advice.ranked if row.tolerance is not None)
    scene, times = advice.scene, advice.asked
    counts = [0]
    for k in range(1, len(times) + 1):
        end = sw.integrate(scene.system, row.method, v=scene.v, y=scene.y, tolerance=row.tolerance, at=times[:k])
        counts.append(int(end.paces.evaluations))
    assert counts[-1] // row.method.evaluations == row.steps
    assert abs(row.worst_evaluations - max(np.diff(counts))) < row.method.evaluations  # it counts whole attempts
    assert row.worst_evaluations > 5 * row.evaluations_per_frame  # type: ignore[operator]
    assert f"{row.worst_evaluations} in the worst frame" in str(advice)
    assert row.objects == int(0.1 / (1e-9 * row.ns_per_step * row.worst_evaluations / row.method.evaluations))
    one = sw.advise("kepler", frame=0.1, tolerance=1e-3, methods=["merson"], cost="evaluations")
    monkeypatch.setattr("stepwell.studies.advice.adaptive.MAX_PIECES", 30)
    other = sw.advise("kepler", frame=0.1, tolerance=1e-3, methods=["merson"], cost="evaluations")
    rows = [next(row for row in each.ranked if row.tolerance is not None) for each in (one, other)]
    assert rows[0].worst_evaluations == rows[1].worst_evaluations


def test_a_budget_must_hold_in_the_worst_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """What breaks it there makes room for fixed steps, though they cost more on the whole."""
    with_prices(monkeypatch, {m.name: 100.0 for m in sw.methods()})
    methods = ["leapfrog", "rk4", "dop853"]
    free = sw.advise("kepler", frame=0.1, tolerance=1e-2, methods=methods)
    assert free.best.tolerance is not None
    worst = [row for row in free.ranked if row.tolerance is not None]
    # Less than any such worst frame, more than the mean of the cheapest.
    budget = 0.9e-9 * min(100.0 * row.worst_evaluations / row.method.evaluations for row in worst)  # type: ignore[operator]
    assert budget > 1.5 * free.best.seconds_per_frame
    tight = sw.advise("kepler", frame=0.1, tolerance=1e-2, budget=budget, methods=methods)
    # What costs more than another way at any accuracy is out already.
    assert {each.kind for each in tight.rejected if each.by == "tolerance"} - {"dominated"} == {"budget"}
    assert "in its worst frame of the" in str(tight)
    for row in tight.ranked:
        assert row.tolerance is None
        assert row.seconds_per_frame is not None
        assert row.seconds_per_frame <= budget
    if tight.best is None:
        assert tight.shortfall.least_error > 1e-2


def test_ranking_by_time_is_by_measured_time() -> None:
    advice = sw.advise("clover", frame=0.3, tolerance=1e-2)
    seconds = [row.seconds_per_frame for row in advice.ranked]
    assert advice.cost == "time"
    assert 0.05 <= advice.cost_noise <= 0.25
    # None costs more than one that comes later, but for what cannot be measured.
    assert all(a <= (1.0 + advice.cost_noise) * min(seconds[i:]) for i, a in enumerate(seconds))  # type: ignore[type-var]
    for row in advice.ranked:
        steps = row.steps / 100
        assert row.substeps == (steps if row.tolerance is None else None)
        assert row.seconds_per_frame == pytest.approx(1e-9 * row.ns_per_step * steps, rel=1e-12)
        assert row.seconds_per_time == 1e-9 * row.ns_per_step / row.dt
        worst = (row.worst_evaluations or 0) // evaluations_of(row, advice.scene.system)
        assert row.objects == int(0.3 / (1e-9 * row.ns_per_step * worst))


def with_prices(monkeypatch: pytest.MonkeyPatch, prices: dict[str, float], chosen: float = 3.0) -> dict[str, float]:
    """Let a step cost what is given, and that many times as much with a tolerance; returns what rows cost by their name."""
    monkeypatch.setattr("stepwell.advice.step_times", lambda scene, methods, singles: {m.name: prices[m.name] for m in methods})
    monkeypatch.setattr("stepwell.advice.tried_times", lambda scene, methods: {m.name: chosen * prices[m.name] for m in methods})
    return prices | {f"{name}, tolerance": chosen * price for name, price in prices.items()}


@pytest.mark.parametrize(
    ("name", "tolerance"),
    family(
        [("clover", 1e-2), ("kepler", 1e-3), ("forced_oscillator", 1e-4), ("arenstorf", 1e-3)],
        lambda name, tolerance: name == "clover",
    ),
)
def test_the_cheapest_by_price_is_the_cheapest(name: str, tolerance: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Times are noisy, so the ranking by time is tried with prices that are not, and have another order than evaluations."""
    random = np.random.default_rng(len(name))
    prices = with_prices(monkeypatch, {m.name: float(random.uniform(1.0, 50.0)) for m in sw.methods()})
    advice = sw.advise(scene_of(name), frame=None, tolerance=tolerance)
    costs = [row.seconds_per_time for row in advice.ranked]
    assert costs == sorted(costs)
    for row in advice.ranked:
        assert row.ns_per_step == prices[row.name]
    brute = Brute(scene_of(name), None, RATIO, prices)
    assert brute.best(tolerance, brute.cost(advice) / WORTH) is None
    choice = brute.best(tolerance, WORTH * brute.cost(advice))
    assert choice is not None


class Made:
    """A candidate whose error is any function of k; the price of a step is 1."""

    by, share, first, name, evaluations = "step", 1.0, 4, "made", 4

    def __init__(self, error: Any) -> None:
        self.error, self.method = error, sw.method("rk4")

    def look(self, k: int) -> Trial:
        return Trial(1.0 / k, k, self.error(k), False)

    confirm = look

    def possible(self, k: int) -> bool:
        return True

    keeps_margin = possible

    def within_limit(self, k: int) -> int:
        return k

    def described(self, k: int) -> str:
        return str(k)


def searched(error: Any, tolerance: float) -> int:
    candidate: Any = Made(error)
    choices, missed = Search(tolerance, 1, {"made": 1.0}, 1e7).run([candidate])
    assert not missed
    return choices["made"].k


def test_the_search_finds_where_the_order_says_and_dips() -> None:
    for n in (10, 77, 1000, 54_321):
        assert n <= searched(lambda k, n=n: (n / k) ** 4, 1.0) <= 1.02 * n + 1
    # Where the error changes its sign it is small for a few k only; the ladder's rungs, 9 % apart, step over them.
    for n in (300, 457, 733):
        # Good from 3n on, and within half a per cent of n.
        k = searched(lambda k, n=n: abs(math.log(k / n)) / 0.005 if k < 1.6 * n else 8.0 * (3.0 * n / k) ** 4, 8.0)
        assert abs(k - n) <= 0.05 * n


def test_of_equal_costs_the_smaller_error_comes_first_and_noise_makes_them_equal() -> None:
    """Costs that differ by less than the noise of their measurement say nothing; errors do."""
    names = ["damped_euler", "leapfrog", "false_euler", "verlet", "rk4"]
    costs, errors = [7.70, 7.74, 7.91, 11.8, 74.9], [8.3e-3, 7.3e-4, 9e-3, 7.3e-4, 4e-8]
    assert by_cost_and_error(names, costs, errors, 0.05) == ["leapfrog", "damped_euler", "false_euler", "verlet", "rk4"]
    assert by_cost_and_error(names, costs, errors, 0.0) == names
    assert by_cost_and_error(names, [1.0] * 5, errors, 0.0) == ["rk4", "leapfrog", "verlet", "damped_euler", "false_euler"]
    # A chain of small differences is not one group: what is much more expensive than the first does not come before it.
    chain = by_cost_and_error(["a", "b", "c"], [1.00, 1.04, 1.08], [3.0, 2.0, 1.0], 0.05)
    assert chain == ["b", "a", "c"]
    assert cost_noise([[1.0, 1.1, 9.0], [2.0, 5.0, 2.06]]) == pytest.approx(0.1)
    assert cost_noise([[1.0, 1.0]]) == cost_noise([[1.0]]) == 0.05
    assert cost_noise([]) == 0.0
    assert cost_noise([[1.0, 3.0]]) == 0.25


@pytest.mark.parametrize(("noise", "best"), [(0.05, "leapfrog"), (0.0, "damped_euler")])
def test_advise_takes_the_better_of_equal_costs(noise: float, best: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As measured once: costs of 3 % between them, errors of a factor of 12; the worse was named for the noise of a day."""
    prices = {"damped_euler": 7.70, "leapfrog": 7.74, "false_euler": 7.91}

    def times(scene: sw.Scene, methods: Sequence[sw.Method], singles: Sequence[sw.Method]) -> Times:
        measured = Times({m.name: prices[m.name] for m in methods})
        measured.noise = noise
        return measured

    monkeypatch.setattr("stepwell.advice.step_times", times)
    advice = sw.advise("oscillator", methods=list(prices))
    assert (advice.best.method.name, advice.cost_noise) == (best, noise)
    if noise:
        assert re.search(r"damped_euler and false_euler cost the same within .*, with a larger error", str(advice))
        assert "about 2·10⁶ such objects" in str(advice)
    else:
        assert "cost the same" not in str(advice)


@looped(
    "number, text",
    [(216563143, "about 2·10⁸"), (70_123_456, "about 7·10⁷"), (9_999, "about 10000"), (1234, "about 1000"), (99, "99"), (1, "1")],
)
def test_a_number_of_objects_is_told_to_the_digits_that_mean_something(number: int, text: str) -> None:
    assert about(number) == text
