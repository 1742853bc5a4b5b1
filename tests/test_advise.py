"""Advice, against brute force: what it says is true when run in full, and nothing that is tried is much cheaper."""

from __future__ import annotations

import copy
import functools
import json
import math
import pickle
import sys
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import cli
from stepwell.advice.candidates import Candidate
from stepwell.advice.search import Search
from stepwell.advice.trials import Trial
from stepwell.errors import ArgumentError, DivergenceWarning, DTypeError
from stepwell.scenes import Scene

sys.path.insert(0, str(Path(__file__).parents[1]))

from benches.advice import Brute

#: What is advised may cost this many times the cheapest that brute force finds.
WORTH = 1.5

#: Brute force tries numbers of steps this far apart; no rung of the search's own ladder of 2^(1/8) is meant.
RATIO = 1.0777


#: A built-in scene is made once, for some take long to know their true motion.
scene_of = functools.cache(sw.scenes.scene)


@functools.cache
def brute_of(name: str, frames: int | None = None) -> Brute:
    """All that can be tried on a built-in scene, with any steps or in so many frames."""
    scene = scene_of(name)
    return Brute(scene, None if frames is None else scene.horizon / frames, RATIO)


#: What was measured so far, by what was measured.
MEASURED: dict[tuple[str, ...], dict[str, float]] = {}


@pytest.fixture(autouse=True)
def _times_are_measured_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a step takes is measured once for each system and its methods: that is up to a second, and most tests only show it."""

    def once(name: str) -> Any:
        measure = getattr(sw.advice, name)

        def times(scene: Scene, methods: Any) -> dict[str, float]:
            key = (name, repr(scene.system), repr(scene.control), *(m.name for m in methods))
            if key not in MEASURED:
                MEASURED[key] = measure(scene, methods)
            return MEASURED[key]

        return times

    for name in ("step_times", "tried_times"):
        monkeypatch.setattr(f"stepwell.advice.{name}", once(name))


@pytest.fixture
def unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every step takes a nanosecond: for tests that rank by evaluations and look at no time."""
    for name in ("step_times", "tried_times"):
        monkeypatch.setattr(f"stepwell.advice.{name}", lambda scene, methods: {m.name: 1.0 for m in methods})


def assert_true(brute: Brute, advice: sw.advice.Advice) -> None:
    """Every ranked row, run in full, is as wrong as it says and no more than allowed.

    With a tolerance at whatever times it is asked, for it is one run. Brute force has the true motion from a table that is right
    to 1e-9, and so has the search.
    """
    frames = brute.frames
    for row in advice.ranked:
        error = float(advice.scene.state_error(advice.run(row)).max())
        assert error <= row.error * (1 + 1e-6) + 2e-9
        assert row.error <= advice.tolerance
        assert row.evaluations_per_time == row.method.evaluations / row.dt
        if row.tolerance is not None:
            assert brute.between(row.method.name, row.tolerance) <= advice.tolerance + 2e-9
        else:
            assert brute.advised(row) <= row.error * (1 + 1e-6) + 2e-9
            assert row.dt == (advice.scene.horizon / row.steps if frames is None else brute.frame / (row.substeps or 0))
        if frames is not None:
            assert row.evaluations_per_frame == row.method.evaluations * row.steps / frames
    costs = [row.method.evaluations * row.steps for row in advice.ranked]
    assert costs == sorted(costs)


def assert_cheap(brute: Brute, advice: sw.advice.Advice) -> None:
    """Nothing that brute force finds costs less than two thirds."""
    assert brute.best(advice.tolerance, brute.cost(advice) / WORTH) is None


def error_of(scene: Scene, method: str, dt: float, steps: int) -> float:
    """The largest state error of a run."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)
        return float(scene.state_error(scene.run(method, dt, steps=steps, every=1)).max())


# ---- built-in scenes

#: Of these scenes all six tolerances take a moment; of the others some are tried here, and all by ``python -m benches.advice``.
QUICK = ("oscillator", "forced_oscillator", "clover", "pendulum")
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
SLOW = {
    "arenstorf": (1e-2, 1e-5),
    "chain": (1e-3,),
    "energy_control": (),
    "figure_eight": (1e-2, 1e-4),
    "kepler": (1e-1, 1e-3, 1e-6),
    "plummer": (),
    "pythagorean": (1e-3,),
}
CASES = {scene.name: TOLERANCES if scene.name in QUICK else SLOW.get(scene.name, TOLERANCES) for scene in sw.scenes.scenes()}


def tried(cases: Mapping[str, Sequence[float]], long: Collection[str] = ()) -> list[Any]:
    """A scene and a tolerance: by default each scene but the ``long`` once, with one tolerance after the other."""
    return [
        pytest.param(name, each, marks=() if i == turn % len(of) and name not in long else pytest.mark.long)
        for turn, (name, of) in enumerate(cases.items())
        for i, each in enumerate(of)
    ]


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(("name", "tolerance"), tried(CASES, ["figure_eight", "pythagorean"]))
def test_the_advice_is_true_and_near_the_cheapest(name: str, tolerance: float) -> None:
    brute = brute_of(name)
    advice = sw.advise(brute.given, frame=None, tolerance=tolerance, cost="evaluations")
    assert advice.best is not None
    assert_true(brute, advice)
    assert_cheap(brute, advice)
    listed = [row.name for row in advice.ranked] + [each.name for each in advice.rejected]
    paced = [f"{m.name}, tolerance" for m in sw.methods() if m.error_order is not None]
    assert sorted(listed) == sorted([*(m.name for m in sw.methods()), *paced])


FRAMES = dict.fromkeys(QUICK, (1e-2, 1e-4)) | {"chain": (1e-2,), "figure_eight": (1e-4,), "kepler": (1e-3,)}


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(("name", "tolerance"), tried(FRAMES, ["chain", "figure_eight"]))
def test_the_advice_for_a_frame_is_true_and_near_the_cheapest(name: str, tolerance: float) -> None:
    brute = brute_of(name, 160)
    advice = sw.advise(brute.given, frame=brute.frame, tolerance=tolerance, cost="evaluations")
    assert advice.best is not None
    assert_true(brute, advice)
    assert_cheap(brute, advice)


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
        assert "is judged up to t = " in str(advice)
        far.append(advice.scene.horizon)
    assert far[0] > far[1] > far[2] > 30.0


@pytest.mark.parametrize("name", ["kepler", "arenstorf", pytest.param("pythagorean", marks=pytest.mark.long)])
def test_adaptive_steps_win_where_bodies_meet(name: str) -> None:
    advice = sw.advise(scene_of(name), frame=None, tolerance=1e-2)
    best = advice.best
    assert best is not None
    assert best.tolerance is not None
    assert best.substeps is None
    assert (best.margin, best.limit, best.limit_by) == (math.inf, None, "none")
    assert f"with adaptive steps to a tolerance of {best.tolerance:g}" in str(advice)
    assert "what is too long is rejected" in str(advice)


@pytest.mark.usefixtures("unmeasured")
def test_fixed_steps_only() -> None:
    both = sw.advise("kepler", frame=0.1, tolerance=1e-2, cost="evaluations").best
    advice = sw.advise("kepler", frame=0.1, tolerance=1e-2, cost="evaluations", fixed=True)
    assert both is not None
    assert advice.best is not None
    assert {row.by for row in advice.ranked} == {each.by for each in advice.rejected} == {"step"}
    assert advice.best.evaluations_per_time > 2.0 * both.evaluations_per_time


@pytest.mark.usefixtures("unmeasured")
def test_the_worst_frame_is_counted() -> None:
    """Against runs that end with each frame, whose steps are counted."""
    advice = sw.advise("kepler", frame=0.1, tolerance=1e-3, methods=["fehlberg_5"], cost="evaluations")
    (row,) = (row for row in advice.ranked if row.tolerance is not None)
    scene, times = advice.scene, advice.asked
    made = [0]
    for k in range(1, len(times) + 1):
        end = sw.integrate(scene.system, row.method, v=scene.v, y=scene.y, tolerance=row.tolerance, at=times[:k])
        assert end.paces is not None
        made.append(int(end.paces.evaluations))
    assert made[-1] == row.steps * row.method.evaluations
    assert row.worst_evaluations == max(np.diff(made))
    assert row.worst_evaluations > 5 * row.evaluations_per_frame  # type: ignore[operator]
    assert f"{row.worst_evaluations} in the worst frame" in str(advice)
    assert row.objects == int(0.1 / (1e-9 * row.ns_per_step * row.worst_evaluations / row.method.evaluations))


@pytest.mark.usefixtures("unmeasured")
def test_the_worst_frame_of_many_is_found_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    one = sw.advise("kepler", frame=0.1, tolerance=1e-3, methods=["merson"], cost="evaluations")
    monkeypatch.setattr("stepwell.advice.adaptive.MAX_PIECES", 30)
    other = sw.advise("kepler", frame=0.1, tolerance=1e-3, methods=["merson"], cost="evaluations")
    rows = [next(row for row in each.ranked if row.tolerance is not None) for each in (one, other)]
    assert rows[0].worst_evaluations == rows[1].worst_evaluations


def test_a_budget_must_hold_in_the_worst_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """What breaks it there makes room for fixed steps, though they cost more on the whole."""
    with_prices(monkeypatch, {m.name: 100.0 for m in sw.methods()})
    free = sw.advise("kepler", frame=0.1, tolerance=1e-2)
    assert free.best is not None
    assert free.best.tolerance is not None
    worst = [row for row in free.ranked if row.tolerance is not None]
    # Less than any such worst frame, more than the mean of the cheapest.
    budget = 0.9e-9 * min(100.0 * row.worst_evaluations / row.method.evaluations for row in worst)  # type: ignore[operator]
    assert free.best.seconds_per_frame is not None
    assert budget > 1.5 * free.best.seconds_per_frame
    tight = sw.advise("kepler", frame=0.1, tolerance=1e-2, budget=budget)
    assert {each.kind for each in tight.rejected if each.by == "tolerance"} == {"budget"}
    assert "in its worst frame of the" in str(tight)
    for row in tight.ranked:
        assert row.tolerance is None
        assert row.seconds_per_frame is not None
        assert row.seconds_per_frame <= budget
    if tight.best is None:
        assert tight.shortfall is not None
        assert tight.shortfall.least_error > 1e-2


def test_ranking_by_time_is_by_measured_time() -> None:
    advice = sw.advise("clover", frame=0.3, tolerance=1e-2)
    seconds = [row.seconds_per_frame for row in advice.ranked]
    assert advice.cost == "time"
    assert seconds == sorted(seconds)  # type: ignore[type-var]
    for row in advice.ranked:
        steps = row.steps / 100
        assert row.substeps == (steps if row.tolerance is None else None)
        assert row.seconds_per_frame == pytest.approx(1e-9 * row.ns_per_step * steps, rel=1e-12)
        assert row.seconds_per_time == 1e-9 * row.ns_per_step / row.dt
        worst = (row.worst_evaluations or 0) // row.method.evaluations
        assert row.objects == int(0.3 / (1e-9 * row.ns_per_step * worst))


def with_prices(monkeypatch: pytest.MonkeyPatch, prices: dict[str, float], chosen: float = 3.0) -> dict[str, float]:
    """Let a step cost what is given, and that many times as much with a tolerance; returns what rows cost by their name."""
    monkeypatch.setattr("stepwell.advice.step_times", lambda scene, methods: {m.name: prices[m.name] for m in methods})
    monkeypatch.setattr("stepwell.advice.tried_times", lambda scene, methods: {m.name: chosen * prices[m.name] for m in methods})
    return prices | {f"{name}, tolerance": chosen * price for name, price in prices.items()}


@pytest.mark.parametrize(
    ("name", "tolerance"), [("clover", 1e-2), ("kepler", 1e-3), ("forced_oscillator", 1e-4), ("arenstorf", 1e-3)]
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
    found = brute.best(tolerance, WORTH * brute.cost(advice))
    assert found is not None


class Made:
    """A candidate whose error is any function of k; the price of a step is 1."""

    by, share, first, name = "step", 1.0, 4, "made"

    def __init__(self, error: Any) -> None:
        self.error, self.method = error, sw.method("rk4")

    def look(self, k: int) -> Trial:
        return Trial(1.0 / k, k, self.error(k), False)

    confirm = look

    def possible(self, k: int) -> bool:
        return True

    def said(self, k: int) -> str:
        return str(k)


def searched(error: Any, tolerance: float) -> int:
    candidate: Candidate = Made(error)
    found, missed = Search(tolerance, 1, {"made": 1.0}, 1e7).run([candidate])
    assert not missed
    return found["made"].k


def test_the_search_finds_where_the_order_says() -> None:
    for n in (10, 77, 1000, 54_321):
        assert n <= searched(lambda k, n=n: (n / k) ** 4, 1.0) <= 1.02 * n + 1


def test_the_search_finds_dips() -> None:
    """Where the error changes its sign it is small for a few k only; the ladder's rungs, 9 % apart, step over them."""
    for n in (300, 457, 733):
        # Good from 3n on, and within half a per cent of n.
        k = searched(lambda k, n=n: abs(math.log(k / n)) / 0.005 if k < 1.6 * n else 8.0 * (3.0 * n / k) ** 4, 8.0)
        assert abs(k - n) <= 0.05 * n


# ---- scenes that this test makes


def driven(damping: float, drive: float) -> Scene:
    """A damped oscillator under a sinusoid, from rest: the steady swing and the dying one, in closed form."""
    omega, d = 2.0, damping
    system = sw.Oscillator(omega, d, a=sw.Sinusoid(1.0, drive), form="physical")
    s, fast = d * omega, omega * math.sqrt(1 - d * d)
    below = (omega**2 - drive**2) ** 2 + (2 * s * drive) ** 2
    p, q = (omega**2 - drive**2) / below, -2 * s * drive / below  # y = p·sin + q·cos for ever

    def exact(t: Any) -> Any:
        a, b = -q, (-p * drive - s * q) / fast  # the rest: e^(−st)·(a·cos + b·sin), so that y and v begin at 0
        swing, die = np.sin(drive * t), np.exp(-s * t)
        y = p * swing + q * np.cos(drive * t) + die * (a * np.cos(fast * t) + b * np.sin(fast * t))
        v = drive * (p * np.cos(drive * t) - q * swing)
        v = v + die * ((-s * a + b * fast) * np.cos(fast * t) + (-s * b - a * fast) * np.sin(fast * t))
        return v, y

    return Scene(system, 0.0, 0.0, 30.0, exact=exact, name="driven")


def soft_chain() -> Scene:
    """A chain of five unequal masses with no formula at all."""
    system = sw.Chain(5, stiffness=[1.0, 3.0, 2.0, 5.0, 1.0, 4.0], mass=[1.0, 2.0, 0.5, 1.0, 3.0])
    return Scene(system, v=[0.0, 0.0, 1.0, 0.0, 0.0], y=0.2, horizon=40.0)


def stiff_chain() -> Scene:
    """Springs that differ by ten thousand, so that what is fast is no part of what is seen."""
    system = sw.Chain(4, stiffness=[1.0, 100.0, 3.0, 1e4, 2.0], mass=[1.0, 0.1, 2.0, 1.0])
    return Scene(system, v=[0.0, 0.0, 1.0, 0.0], y=0.1, horizon=8.0)


def pendulum(v: float, y: float, horizon: float) -> Scene:
    return Scene(sw.Pendulum(1.0), v=v, y=y, horizon=horizon)


def overdamped() -> Scene:
    system = sw.Oscillator(50.0, 2.0, form="physical")
    return Scene(system, v=0.0, y=1.0, horizon=5.0)


def linear() -> Scene:
    """Three states, all in one block: one dies at once, two turn."""
    a = np.array([[-1.0, 5.0, 0.0], [-5.0, -1.0, 0.0], [0.0, 0.0, -20.0]])

    def exact(t: Any) -> Any:
        c, s, slow = np.cos(5.0 * t), np.sin(5.0 * t), np.exp(-t)
        return np.zeros((len(t), 0)), np.stack([slow * c, -slow * s, np.exp(-20.0 * t)], axis=-1)

    return Scene(sw.LinearSystem(a, velocities=0), v=np.zeros(0), y=[1.0, 0.0, 1.0], horizon=5.0, exact=exact)


def jolted() -> Scene:
    """An oscillator whose force jumps."""
    force = sw.Sampled(np.random.default_rng(3).normal(size=10), interval=0.7)
    system = sw.Oscillator(2.0, 0.1, a=force, form="physical")
    return Scene(system, v=0.0, y=0.5, horizon=7.0)


HELD_OUT = {
    "driven": lambda: driven(0.05, 1.3),
    "resonant": lambda: driven(0.02, 2.0),
    "chain of 3": lambda: sw.scenes.chain(3),
    "chain of 15": lambda: sw.scenes.chain(15),
    "unequal chain": soft_chain,
    "stiff chain": stiff_chain,
    "ellipse": lambda: sw.scenes.kepler(0.5),
    "uneven ellipse": lambda: sw.scenes.kepler(0.3, 0.1),
    "long ellipse": lambda: sw.scenes.kepler(0.95, 0.3),
    "over the top": lambda: pendulum(2.5, 0.0, 30.0),
    "nearly upright": lambda: pendulum(0.0, 3.1, 30.0),
    "overdamped": overdamped,
    "one block": linear,
    "jolted": jolted,
    "controlled": lambda: replace(sw.scenes.clover(), control=sw.EnergyControl(0.3)),
    "four stars": lambda: replace(sw.scenes.plummer(4), horizon=3.0),
}

#: Of scenes that take long one tolerance is tried.
LONG = {
    "chain of 3": 5e-2,
    "chain of 15": 2e-3,
    "unequal chain": 3e-5,
    "stiff chain": 5e-2,
    "uneven ellipse": 5e-2,
    "long ellipse": 3e-5,
    "over the top": 2e-3,
    "nearly upright": 5e-2,
    "one block": 2e-3,
    "jolted": 2e-3,
    "controlled": 3e-5,
    "four stars": 5e-2,
}
UNSEEN = {name: (LONG[name],) if name in LONG else (5e-2, 2e-3, 3e-5) for name in HELD_OUT}

#: Of these there is another of the same kind, which is quicker.
FURTHER = (
    "resonant",
    "chain of 3",
    "chain of 15",
    "unequal chain",
    "uneven ellipse",
    "long ellipse",
    "nearly upright",
    "four stars",
)


@functools.cache
def held_out(name: str) -> Brute:
    return Brute(HELD_OUT[name](), None, RATIO)


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(("name", "tolerance"), tried(UNSEEN, FURTHER))
def test_the_advice_for_scenes_never_seen_is_true_and_near_the_cheapest(name: str, tolerance: float) -> None:
    brute = held_out(name)
    advice = sw.advise(brute.given, frame=None, tolerance=tolerance, cost="evaluations")
    assert advice.best is not None
    assert_true(brute, advice)
    assert_cheap(brute, advice)


FRAMED = {"over the top": lambda: pendulum(2.5, 0.0, 30.0), "ellipse": lambda: sw.scenes.kepler(0.6)}


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(
    ("name", "frame"), [("over the top", 0.9), pytest.param("over the top", 100.0, marks=pytest.mark.long), ("ellipse", 7.3)]
)
def test_frames_that_do_not_divide_the_horizon(name: str, frame: float) -> None:
    """The last one ends beyond it, where the true motion is known too."""
    brute = Brute(FRAMED[name](), frame, RATIO)
    advice = sw.advise(brute.given, frame=frame, tolerance=1e-3, cost="evaluations")
    assert advice.best is not None
    assert not advice.cut
    assert_true(brute, advice)
    assert_cheap(brute, advice)


def test_a_motion_that_is_not_known_to_the_end_of_the_first_frame_is_no_scene_to_judge_by() -> None:
    chaos = replace(sw.scenes.energy_control(), horizon=200.0)
    with pytest.raises(ArgumentError, match=r"is not known beyond t = .*, within the first frame"):
        sw.advise(chaos, frame=100.0, tolerance=1e-2, methods=["rk4"])


# ---- motions of any size, scenes of one's own


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("known", [True, False])
def test_amplitudes_do_not_matter(known: bool) -> None:
    """From 1e-12 to 1e12 the advice is the same, by a formula or by a tight run; for powers of two to the bit."""

    def advised(size: float) -> sw.advice.Advice:
        exact = (lambda t: (-size * np.sin(t), size * np.cos(t))) if known else None
        scene = Scene(sw.Oscillator(1.0), v=0.0, y=size, horizon=40.0, exact=exact)
        return sw.advise(scene, frame=None, tolerance=1e-3, methods=["rk4", "dop853"], cost="evaluations")

    one = advised(1.0)
    assert {row.by for row in one.ranked} == {"step", "tolerance"}
    for size in (2.0**-40, 2.0**40):
        assert advised(size).ranked == one.ranked
    for size in (1e-12, 1e-9, 1e-7, 1e-6, 1e12):
        for ours, theirs in zip(advised(size).ranked, one.ranked, strict=True):
            assert (ours.name, ours.steps, ours.tolerance) == (theirs.name, theirs.steps, theirs.tolerance)
            assert ours.error == pytest.approx(theirs.error, rel=1e-6)


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("force", [1e-12, 1e-6, 1e9])
def test_from_rest_under_a_force(force: float) -> None:
    system = sw.Oscillator(1.0, a=sw.Sinusoid(force, 2.0), form="physical")
    scene = Scene(system, v=0, y=0, horizon=40.0)
    advice = sw.advise(scene, frame=None, tolerance=1e-3, methods=["rk4", "dop853"], cost="evaluations")
    t = np.linspace(0.0, 40.0, 4001)
    true = replace(
        scene, exact=lambda t: (force * (2 * np.cos(t) - 2 * np.cos(2 * t)) / 3, force * (2 * np.sin(t) - np.sin(2 * t)) / 3)
    )
    assert len(advice.ranked) >= 2
    for row in advice.ranked:
        if row.tolerance is None:
            run = true.run(row.method, row.dt, steps=row.steps, every=1)
        else:
            run = sw.integrate(system, row.method, v=0.0, y=0.0, tolerance=row.tolerance, at=t)
        assert true.state_error(run).max() <= 1e-3


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize(("scene", "exact"), [(lambda: sw.scenes.kepler(0.95), None), (lambda: sw.scenes.pendulum(179.0), None)])
def test_a_hard_part_does_not_end_what_is_known(scene: Any, exact: None) -> None:
    """A loose tolerance asks for a truth that is a tenth as loose, so it is judged to the end and true there."""
    given = scene()
    advice = sw.advise(replace(given, exact=exact), frame=None, tolerance=1e-1, methods=["dop853", "merson"], cost="evaluations")
    assert not advice.cut
    assert advice.scene.horizon == given.horizon
    for row in advice.ranked:
        run = advice.run(row)
        assert given.state_error(run).max() <= 1e-1


@pytest.mark.usefixtures("unmeasured")
def test_a_row_with_a_tolerance_is_true_whenever_it_is_asked() -> None:
    """Asked for the end alone, for a few times or for thousands: one run."""
    scene = sw.scenes.kepler(0.3)
    scene = replace(scene, horizon=20.0 * math.pi)
    rng = np.random.default_rng(11)
    for tolerance in (1e-2, 1e-4):
        advice = sw.advise(scene, frame=None, tolerance=tolerance, cost="evaluations")
        for row in (row for row in advice.ranked if row.tolerance is not None):
            for number in (0, 1, 3, 30, 3000):
                at = np.union1d(rng.uniform(0.0, scene.horizon, number), [scene.horizon])
                run = sw.integrate(scene.system, row.method, v=scene.v, y=scene.y, tolerance=row.tolerance, at=at)
                assert scene.state_error(run).max() <= tolerance


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        ({"system": 3}, DTypeError, "system: expected a stepwell system such as Oscillator(), got int"),
        ({"v": "fast"}, DTypeError, "v: expected real numbers"),
        ({"v": [0.0, 1.0]}, ArgumentError, "v: expected shape () of a scene's one member, got (2,)"),
        ({"y": math.nan}, ArgumentError, "y: expected finite numbers"),
        (
            {"system": sw.Pendulum([1.0, 2.0])},
            ArgumentError,
            "system: expected a system of one member, got parameters of shape (2,)",
        ),
        (
            {"horizon": None},
            ArgumentError,
            "horizon: expected the time over which errors are measured, in units of time, got None",
        ),
        ({"horizon": math.nan}, ArgumentError, "horizon: expected finite numbers in units of time"),
        ({"horizon": -1.0}, ArgumentError, "horizon: expected numbers above zero"),
        ({"dt": 0.0}, ArgumentError, "dt: expected numbers above zero"),
        ({"until": -1.0}, ArgumentError, "until: expected a time of zero or more"),
        ({"exact": 3.0}, DTypeError, "exact: expected a function of times, or None, got float"),
        ({"control": "on"}, DTypeError, "control: expected an EnergyControl or a Projection, got str"),
    ],
)
def test_what_is_no_scene(given: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error) as raised:
        Scene(**({"system": sw.Pendulum(), "v": 0.0, "y": 1.0, "horizon": 10.0} | given))
    assert said in str(raised.value)


@pytest.mark.parametrize(
    ("exact", "error", "said"),
    [
        (
            lambda t: (np.cos(t), np.where(t < 3.0, t, np.nan)),
            ArgumentError,
            "exact: expected finite numbers, got y = nan at t = 3",
        ),
        (lambda t: np.cos(t)[0], ArgumentError, "exact: expected the blocks v and y, arrays of real numbers, got float64"),
        (
            lambda t: (np.cos(t), np.zeros((len(t), 2))),
            ArgumentError,
            "exact: expected y of shape (1001,) for 1001 times, got (1001, 2)",
        ),
    ],
)
def test_what_is_no_exact_solution(exact: Any, error: type[Exception], said: str) -> None:
    scene = Scene(sw.Pendulum(), v=0.0, y=1.0, horizon=10.0, exact=exact)
    with pytest.raises(error) as raised:
        sw.advise(scene, frame=None)
    assert said in str(raised.value)


@pytest.mark.usefixtures("unmeasured")
def test_a_scene_needs_three_things_beside_its_system() -> None:
    """Numbers and lists for blocks, and all else by itself; ``until`` says how far if ``horizon`` does not."""
    scene = sw.Scene(sw.Chain(3), v=0, y=[0.0, 1, 0], until=20)
    assert (scene.v.shape, scene.y.shape, scene.horizon, scene.dt) == ((3,), (3,), 20.0, 0.02)
    assert scene == Scene(sw.Chain(3), v=np.zeros(3), y=np.array([0.0, 1.0, 0.0]), horizon=20.0, until=20.0)
    advice = sw.advise(scene, frame=None, tolerance=1e-2, methods=["leapfrog"], cost="evaluations")
    assert advice.best is not None
    assert not advice.cut
    at_rest = sw.advise(Scene(sw.Chain(3), v=0, y=0, horizon=20.0), frame=None, methods=["leapfrog", "merson"])
    assert at_rest.best is not None
    assert at_rest.best.error == 0.0


def test_what_is_too_large_or_too_long_is_refused_at_once() -> None:
    large = Scene(sw.NBody(np.ones(30_000), force="newton", dim=2), v=0.0, y=1.0, horizon=1.0)
    with pytest.raises(ArgumentError, match="scene: expected a state of at most 100000 numbers, got one of 120000"):
        sw.advise(large)
    with pytest.raises(ArgumentError, match=r"frame: expected at most 100 times the horizon of 62\.83.* got 1e\+09"):
        sw.advise("oscillator", frame=1e9)


@pytest.mark.usefixtures("unmeasured")
def test_scenes_and_advice_go_through_a_file() -> None:
    for scene in sw.scenes.scenes():
        for other in (pickle.loads(pickle.dumps(scene)), copy.copy(scene), copy.deepcopy(scene)):
            assert other == scene
            assert hash(other) == hash(scene)
    assert sw.scenes.kepler(0.5) == sw.scenes.kepler(0.5) != sw.scenes.kepler(0.6)
    assert replace(sw.scenes.clover(), dt=0.2) != sw.scenes.clover()
    for scene in ("clover", Scene(sw.Pendulum(), v=0.0, y=2.0, horizon=20.0)):
        advice = sw.advise(scene, frame=None, tolerance=1e-2, methods=["rk4", "merson", "verlet"], cost="evaluations")
        for other in (pickle.loads(pickle.dumps(advice)), copy.deepcopy(advice)):
            assert other == advice
            assert hash(other) == hash(advice)
            assert str(other) == str(advice)
            assert np.array_equal(other.run().y, advice.run().y)


# ---- prediction and margin


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("name", ["oscillator", "chain"])
def test_modes_predict_the_error(name: str) -> None:
    """A free linear system does what its modes say; some hundred roundings of each of a few thousand steps may differ."""
    advice = sw.advise(name, frame=None, tolerance=1e-3, cost="evaluations")
    for row in (row for row in advice.ranked if row.tolerance is None):
        assert row.predicted_by == "modes"
        assert row.predicted == pytest.approx(row.error, rel=0.01)


def test_frequency_and_damping_errors_are_those_of_the_series() -> None:
    advice = sw.advise("oscillator", frame=0.1, tolerance=0.9, methods=["false_euler", "semi_false_heun"])
    rows = {row.method.name: row for row in advice.ranked}
    # Φ²/24 + 3Φ⁴/640 and no damping; −Φ²/12 + 7Φ⁴/160 and r₁² = 1 − Φ⁴/4, so ln r₁/dt = −Φ⁴/8/dt.
    assert rows["false_euler"].frequency_error == pytest.approx(0.1**2 / 24 + 3 * 0.1**4 / 640, rel=1e-4)
    assert rows["false_euler"].damping_error == pytest.approx(0.0, abs=1e-12)
    assert rows["semi_false_heun"].frequency_error == pytest.approx(-(0.1**2) / 12 + 7 * 0.1**4 / 160, rel=1e-3)
    assert rows["semi_false_heun"].damping_error == pytest.approx(0.1**4 / 8 / 0.1, rel=1e-3)


def test_no_prediction_where_it_makes_no_sense() -> None:
    advice = sw.advise("forced_oscillator", frame=1 / 60, tolerance=0.1, methods=["rk4"])
    assert advice.best is not None
    assert (advice.best.predicted, advice.best.predicted_by, advice.best.frequency_error) == (None, None, None)


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.parametrize("name", ["oscillator", "chain"])
def test_the_margin_is_where_it_blows_up(name: str) -> None:
    """A run a thousandth inside the limit is bounded, one a thousandth outside grows."""
    scene = sw.scenes.scene(name)
    advice = sw.advise(scene, frame=None, tolerance=1e-1, cost="evaluations")
    tried = 0
    for row in (row for row in advice.ranked if row.tolerance is None):
        assert row.limit_by == "linear"
        if not row.limit or not math.isfinite(row.limit):
            continue
        assert row.margin == row.limit / row.dt
        assert row.limit == float(sw.stability_limit(scene.system, row.method))
        sizes = []
        for share in (0.999, 1.001):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DivergenceWarning)
                run = scene.run(row.method, share * row.limit, steps=20_000, every=20)
            sizes.append(float(scene.amplitude(run).max()))
        # Near the limit the axes of the ellipse are in the ratio √((2+Φ)/(2−Φ)) < 45; outside e⁷ and more.
        assert sizes[0] < 50
        assert not sizes[1] < 1e3
        tried += 1
    assert tried >= 3


@pytest.mark.usefixtures("unmeasured")
def test_the_observed_limit_is_where_runs_begin_to_grow() -> None:
    advice = sw.advise("clover", frame=None, tolerance=1e-2, cost="evaluations")
    scene = sw.scenes.clover()
    for row in [row for row in advice.ranked if row.tolerance is None][:3]:
        assert row.limit_by == "frozen"
        assert row.dt <= row.observed_limit
        assert row.margin == row.observed_limit / row.dt
        if math.isfinite(row.observed_limit):
            inside = round(scene.horizon / row.observed_limit)
            assert error_of(scene, row.method.name, scene.horizon / inside, inside) < math.inf


# ---- nothing fits, and what is refused


def test_nothing_fits_a_budget() -> None:
    advice = sw.advise("oscillator", frame=0.5, tolerance=1e-3, budget=1e-15)
    assert advice.best is None
    assert advice.ranked == ()
    gap = advice.shortfall
    assert gap is not None
    assert (gap.method, gap.substeps, gap.least_error) == (None, None, math.inf)
    assert gap.needed_budget is not None
    assert 1e-12 < gap.needed_budget < 1e-3
    assert {each.kind for each in advice.rejected} <= {"budget", "dominated", "inaccurate", "unstable"}
    text = str(advice)
    assert "Nothing fits." in text
    assert "does not suffice for one step" in text
    assert "The tolerance needs a budget of" in text
    # What is needed is enough, with some room for a measurement that does not repeat.
    assert sw.advise("oscillator", frame=0.5, tolerance=1e-3, budget=10 * gap.needed_budget).best is not None


@pytest.mark.usefixtures("unmeasured")
def test_nothing_meets_the_tolerance() -> None:
    """Rounding alone is worse than 1e-17; the least error that is told was reached."""
    advice = sw.advise("oscillator", frame=0.5, tolerance=1e-17, methods=["rk4", "pefrl"])
    gap = advice.shortfall
    assert advice.best is None
    assert gap is not None
    assert gap.needed_budget is None
    assert gap.method in ("rk4", "pefrl")
    assert gap.substeps is not None
    scene = sw.scenes.oscillator()
    steps = math.ceil(scene.horizon / 0.5 - 1e-9) * gap.substeps
    assert error_of(scene, gap.method, 0.5 / gap.substeps, steps) <= 2 * gap.least_error < 1e-9
    assert "Nothing that was tried meets the tolerance" in str(advice)


@pytest.mark.usefixtures("unmeasured")
def test_methods_that_the_system_refuses_are_named() -> None:
    advice = sw.advise("forced_oscillator", frame=0.1, tolerance=1e-1)
    refused = {each.method: each.reason for each in advice.rejected if each.kind == "refused"}
    assert set(refused) == {m.name for m in sw.methods() if m.needs_acceleration}
    assert "damping" in refused["verlet"]
    only = sw.advise("forced_oscillator", tolerance=1e-1, methods=["verlet"])
    assert only.best is None
    assert "Nothing fits" in str(only)


@pytest.mark.usefixtures("unmeasured")
def test_a_choice_whose_neighbours_fail_says_so() -> None:
    """Where errors dip, the row says from where on they stay below the tolerance; all that were tried there do."""
    advice = sw.advise("pendulum", frame=None, tolerance=0.03, cost="evaluations")
    scene = scene_of("pendulum")
    assert advice.best is not None
    assert not advice.best.is_robust
    assert "Errors are not even here" in str(advice)
    for row in advice.ranked:
        if row.tolerance is not None:
            assert row.robust is None or row.robust <= row.tolerance
        elif row.is_robust:
            assert brute_of("pendulum").error(row.method.name, scene.horizon / (row.steps + 1), row.steps + 1) <= 0.03
        elif row.robust is not None:
            assert row.robust > row.steps


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        ({"scene": 3}, DTypeError, "scene: expected a Scene or its name, got int"),
        ({"scene": "cloverr"}, ArgumentError, "did you mean 'clover'?"),
        ({"frame": 0.0}, ArgumentError, "frame: expected numbers above zero in units of time"),
        ({"frame": "1/60"}, DTypeError, "frame: expected real numbers in units of time"),
        ({"tolerance": -1.0}, ArgumentError, "tolerance: expected numbers above zero"),
        ({"tolerance": math.nan}, ArgumentError, "tolerance: expected finite numbers"),
        ({"budget": 0}, ArgumentError, "budget: expected numbers above zero in seconds"),
        ({"methods": "rk4"}, DTypeError, "methods: expected a list of names, got 'rk4'"),
        ({"methods": []}, ArgumentError, "methods: expected at least one, got none"),
        ({"methods": ["rk5"]}, ArgumentError, "did you mean 'rk4'?"),
        ({"cost": "energy"}, ArgumentError, "Known: time, evaluations"),
    ],
)
def test_what_is_wrong_is_said(arguments: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error) as raised:
        sw.advise(**({"scene": "clover"} | arguments))
    assert said in str(raised.value)


# ---- telling


@pytest.mark.usefixtures("unmeasured")
def test_the_text_fits_a_screen(tmp_path: Any) -> None:
    for name in ("oscillator", "clover"):
        advice = sw.advise(name, frame=None, tolerance=1e-2, cost="evaluations")
        lines = str(advice).splitlines()
        assert len(lines) <= 26
        assert lines[0].startswith(advice.scene.title)
        assert advice.best is not None
        assert lines[1].startswith(f"Use {advice.best.method.name} with {advice.best.steps} steps")
        assert advice.best.method.name in repr(advice)
    advice.to_json(tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8")) == json.loads(advice.to_json())
    assert json.loads(advice.to_json())["best"]["method"] == advice.best.method.name


def told(capsys: Any, *words: str) -> tuple[int, str, str]:
    code = cli.main(list(words))
    return code, *capsys.readouterr()


@pytest.mark.usefixtures("unmeasured")
def test_the_command_says_what_advise_says(capsys: Any, tmp_path: Any) -> None:
    words = ("advise", "clover", "--frame", "3/10", "--tolerance", "0.01", "--cost", "evaluations")
    code, out, err = told(capsys, *words, "--json")
    assert (code, err) == (0, "")
    found, direct = json.loads(out), json.loads(sw.advise("clover", 0.3, 0.01, cost="evaluations").to_json())
    for key in ("scene", "horizon", "frame", "tolerance", "cost"):
        assert found[key] == direct[key]
    kept = (
        "method",
        "substeps",
        "dt",
        "error",
        "predicted",
        "evaluations_per_frame",
        "limit",
        "observed_limit",
        "margin",
        "robust",
    )
    assert [[row[k] for k in kept] for row in found["ranked"]] == [[row[k] for k in kept] for row in direct["ranked"]]
    assert found["rejected"] == direct["rejected"]
    code, out, err = told(capsys, *words, "-o", str(tmp_path / "a.json"))
    assert (code, err) == (0, "")
    assert f"Use {found['best']['method']} with {found['best']['substeps']} step" in out
    assert "written:" in out
    assert (tmp_path / "a.json").exists()
    for row in found["ranked"]:
        assert row["method"] in out


def test_the_command_says_when_nothing_fits(capsys: Any) -> None:
    code, out, err = told(capsys, "advise", "oscillator", "--budget", "1e-15", "--methods", "rk4, leapfrog")
    assert (code, err) == (0, "")
    assert "Nothing fits." in out
    code, out, _ = told(capsys, "advise", "oscillator", "--budget", "1e-15", "--methods", "rk4", "--json")
    assert code == 0
    assert json.loads(out)["best"] is None


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["advise", "cloverr"], "did you mean 'clover'?"),
        (["advise", "clover", "--frame", "x"], "--frame: expected a time such as 0.02 or 1/60, or any, got 'x'"),
        (["advise", "clover", "--frame", "1/0"], "--frame: expected a time"),
        (["advise", "clover", "--tolerance", "0"], "tolerance: expected numbers above zero"),
        (["advise", "clover", "--methods", "rk5"], "did you mean 'rk4'?"),
        (["advise", "clover", "-o", "a.txt"], "-o: expected a file ending in .json"),
    ],
)
def test_the_command_says_what_is_wrong(capsys: Any, words: list[str], said: str) -> None:
    code, out, err = told(capsys, *words)
    assert (code, out) == (2, "")
    assert said in err
