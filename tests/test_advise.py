"""Advice, against brute force: what it says is true when run in full, and nothing that is tried is much cheaper."""

from __future__ import annotations

import functools
import json
import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import cli
from stepwell.errors import ArgumentError, DivergenceWarning, DTypeError
from stepwell.result import Status
from stepwell.scenes import Scene
from stepwell.scenes.truth import with_truth

#: What is advised may cost this many times the cheapest that brute force finds.
WORTH = 1.5

#: Brute force tries numbers of steps this far apart; no rung of the search's own ladder of 2^(1/8) is meant.
RATIO = 1.0777

#: States of a run that are compared with the truth at first, which is enough to refuse it, and in full.
SOME, ALL = 200, 100_000


@functools.cache
def truth_of(name: str) -> Scene:
    """The built-in scene up to where its true motion is known; a last time past that by rounding is taken for it."""
    return known(sw.scenes.scene(name))


def known(scene: Scene) -> Scene:
    scene = with_truth(scene)
    exact, until = scene.exact, scene.until
    assert exact is not None
    kept: dict[bytes, Any] = {}

    def answer(t: Any) -> Any:
        key = np.asarray(t).tobytes()
        if key not in kept:
            if len(kept) > 300:
                kept.clear()
            kept[key] = exact(np.minimum(t, until))
        return kept[key]

    return replace(scene, exact=answer, until=math.inf, horizon=min(scene.horizon, until))


def error_of(scene: Scene, method: str, dt: float, steps: int, samples: int = ALL) -> float:
    """The largest state error of a run, of which so many states are compared."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)
        return float(scene.state_error(scene.run(method, dt, steps=steps, every=max(1, steps // samples))).max())


def good(scene: Scene, method: str, dt: float, steps: int, tolerance: float) -> bool:
    return all(error_of(scene, method, dt, steps, samples) <= tolerance for samples in (SOME, ALL))


def paced(scene: Scene, method: str, tolerance: float, at: Any, most: int) -> tuple[float, int]:
    """The largest state error of a run with a tolerance, infinite if it did not get there; and all steps that were tried."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.ToleranceWarning)
        run = sw.integrate(scene.system, method, v=scene.v, y=scene.y, tolerance=tolerance, at=at, max_steps=max(1, most))
    assert run.paces is not None
    tried = int(run.paces.accepted + run.paces.rejected)
    with np.errstate(invalid="ignore"):
        error = float(scene.state_error(run).max())
    return error if run.status == Status.OK else math.inf, tried


def cheaper(scene: Scene, advice: sw.advice.Advice, ratio: float = RATIO) -> list[tuple[float, str, int]]:
    """All that brute force finds good enough at less than the advised evaluations over ``WORTH``: cost, method and steps."""
    found = []
    best = advice.best
    for method in sw.methods():
        if any(each.method == method.name and each.kind == "refused" for each in advice.rejected):
            continue
        bound = math.inf if best is None else best.evaluations_per_time / WORTH
        if advice.frame is None:
            most = min(scene.horizon * bound / method.evaluations, 2e6)
            counts = sorted({round(4 * ratio**j) for j in range(int(math.log(max(most, 4) / 4) / math.log(ratio)) + 1)})
            tries = [(scene.horizon / n, n) for n in counts if n <= most]
        else:
            frames = math.ceil(scene.horizon / advice.frame - 1e-9)
            most = int(min(advice.frame * bound / method.evaluations * (1 - 1e-12), 2e6 / frames))
            tries = [(advice.frame / k, k * frames) for k in range(1, most + 1)]
        for dt, steps in tries:
            if good(scene, method.name, dt, steps, advice.tolerance):
                found.append((method.evaluations / dt, method.name, steps))
                break
        if method.error_order is None or scene.control is not None:
            continue
        end = advice.asked[-1]
        for j in range(100):  # six tolerances in each factor of ten, until a run is too dear
            tolerance = 10 ** (-j / 6)
            most = int(min(bound * end / method.evaluations, 1e6))
            error, tried = paced(scene, method.name, tolerance, advice.asked, most)
            if error <= advice.tolerance:
                found.append((method.evaluations * tried / end, f"{method.name}, tolerance {tolerance:.1e}", tried))
            if error <= advice.tolerance or (tried >= most and tolerance < advice.tolerance):
                break
    return sorted(found)


def assert_true(scene: Scene, advice: sw.advice.Advice) -> None:
    """Every ranked row, run in full, is as wrong as it says and no more than allowed."""
    for row in advice.ranked:
        if row.tolerance is not None:
            error, tried = paced(scene, row.method.name, row.tolerance, advice.asked, row.steps + 1)
            assert tried == row.steps
            assert row.evaluations_per_time == pytest.approx(row.method.evaluations * tried / advice.asked[-1], rel=1e-12)
        else:
            error = error_of(scene, row.method.name, row.dt, row.steps)
            assert row.evaluations_per_time == row.method.evaluations / row.dt
        assert error <= advice.tolerance
        assert error <= row.error * (1 + 1e-6) + 1e-9
        if row.tolerance is not None:
            continue
        if advice.frame is not None:
            assert row.substeps is not None
            assert row.dt == advice.frame / row.substeps
    costs = [row.method.evaluations * row.steps for row in advice.ranked]
    assert costs == sorted(costs)


# ---- built-in scenes

#: Scenes and tolerances of which every brute force takes a moment; those of the others take minutes in all, and a few are tried.
QUICK = ("oscillator", "forced_oscillator", "clover")
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
SLOW = {"pythagorean": (), "energy_control": (), "plummer": (), "kepler": (1e-1, 1e-5)}
CASES = [
    (scene.name, tolerance)
    for scene in sw.scenes.scenes()
    for tolerance in (TOLERANCES if scene.name in QUICK else SLOW.get(scene.name, (1e-1, 1e-3, 1e-6)))
]


@pytest.mark.parametrize(("name", "tolerance"), CASES)
def test_the_advice_is_true_and_near_the_cheapest(name: str, tolerance: float) -> None:
    advice = sw.advise(name, frame=None, tolerance=tolerance, cost="evaluations")
    scene = truth_of(name)
    assert advice.best is not None
    assert_true(scene, advice)
    assert cheaper(scene, advice) == []
    listed = [(row.method.name, row.by) for row in advice.ranked] + [(each.method, each.by) for each in advice.rejected]
    assert len(listed) == len(set(listed))
    assert {(m.name, "step") for m in sw.methods()} <= set(listed)
    if scene.control is None:
        assert {(m.name, "tolerance") for m in sw.methods() if m.error_order} <= set(listed)


@pytest.mark.parametrize("name", [*QUICK, "chain", "figure_eight"])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_the_advice_for_a_frame_is_true_and_near_the_cheapest(name: str, tolerance: float) -> None:
    frame = truth_of(name).horizon / 160
    advice = sw.advise(name, frame=frame, tolerance=tolerance, cost="evaluations")
    assert_true(truth_of(name), advice)
    assert cheaper(truth_of(name), advice) == []
    for row in advice.ranked:
        if row.tolerance is None:
            assert row.evaluations_per_frame == row.method.evaluations * (row.substeps or 0)


@pytest.mark.parametrize(("name", "tolerance"), [("pythagorean", 1e-1), ("energy_control", 1e-2), ("plummer", 1e-4)])
def test_the_advice_for_encounters_is_true(name: str, tolerance: float) -> None:
    """Their runs are long, so only few methods are asked for; an encounter lasts for less than a thousandth of the horizon."""
    methods = ("rk4",) if name == "energy_control" else ("pefrl",)
    advice = sw.advise(name, frame=None, tolerance=tolerance, methods=methods, cost="evaluations")
    assert advice.best is not None
    assert_true(truth_of(name), advice)


def test_ranking_by_time_is_by_measured_time() -> None:
    advice = sw.advise("clover", frame=0.3, tolerance=1e-2)
    seconds = [row.seconds_per_frame for row in advice.ranked]
    assert advice.cost == "time"
    assert seconds == sorted(seconds)  # type: ignore[type-var]
    for row in (row for row in advice.ranked if row.tolerance is None):
        assert row.substeps is not None
        assert row.seconds_per_frame == pytest.approx(1e-9 * row.ns_per_step * row.substeps, rel=1e-12)
        assert row.seconds_per_time == pytest.approx(1e-9 * row.ns_per_step / row.dt, rel=1e-12)
        assert row.objects == int(0.3 / row.seconds_per_frame)


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

    zero = np.zeros(())
    return Scene("driven", "Driven", "", "", "", system, zero, zero, 0.1, 30.0, exact)


def soft_chain() -> Scene:
    """A chain of five unequal masses with no formula at all."""
    system = sw.Chain(5, stiffness=[1.0, 3.0, 2.0, 5.0, 1.0, 4.0], mass=[1.0, 2.0, 0.5, 1.0, 3.0])
    return Scene("soft", "Soft chain", "", "", "", system, np.array([0.0, 0.0, 1.0, 0.0, 0.0]), np.full(5, 0.2), 0.1, 40.0)


HELD_OUT = {
    "driven": lambda: driven(0.05, 1.3),
    "resonant": lambda: driven(0.02, 2.0),
    "chain of 3": lambda: sw.scenes.chain(3),
    "chain of 15": lambda: sw.scenes.chain(15),
    "unequal chain": soft_chain,
    "ellipse": lambda: sw.scenes.kepler(0.5),
    "uneven ellipse": lambda: sw.scenes.kepler(0.3, 0.1),
}


@pytest.mark.parametrize("tolerance", [5e-2, 2e-3, 3e-5])
@pytest.mark.parametrize("name", HELD_OUT)
def test_the_advice_for_scenes_never_seen_is_true_and_near_the_cheapest(name: str, tolerance: float) -> None:
    scene = HELD_OUT[name]()
    advice = sw.advise(scene, frame=None, tolerance=tolerance, cost="evaluations")
    assert advice.best is not None
    assert_true(known(scene), advice)
    assert cheaper(known(scene), advice) == []


# ---- prediction and margin


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


@pytest.mark.parametrize("name", ["oscillator", "chain"])
def test_the_margin_is_where_it_blows_up(name: str) -> None:
    """A run a thousandth inside the limit is bounded, one a thousandth outside grows."""
    scene = sw.scenes.scene(name)
    advice = sw.advise(scene, frame=None, tolerance=1e-1, cost="evaluations")
    tried = 0
    for row in advice.ranked:
        if row.tolerance is not None:
            assert (row.limit, row.limit_by, row.margin) == (None, "none", math.inf)
            continue
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


def test_the_observed_limit_is_where_runs_begin_to_grow() -> None:
    advice = sw.advise("clover", frame=None, tolerance=1e-2, cost="evaluations")
    scene = truth_of("clover")
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


def test_nothing_meets_the_tolerance() -> None:
    """Rounding alone is worse than 1e-17; the least error that is told was reached."""
    advice = sw.advise("oscillator", frame=0.5, tolerance=1e-17, methods=["rk4", "pefrl"])
    gap = advice.shortfall
    assert advice.best is None
    assert gap is not None
    assert gap.needed_budget is None
    assert gap.method in ("rk4", "pefrl")
    assert gap.substeps is not None
    scene = truth_of("oscillator")
    steps = math.ceil(scene.horizon / 0.5 - 1e-9) * gap.substeps
    assert error_of(scene, gap.method, 0.5 / gap.substeps, steps, 1000) <= 2 * gap.least_error < 1e-9
    assert "Nothing that was tried meets the tolerance" in str(advice)


def test_methods_that_the_system_refuses_are_named() -> None:
    advice = sw.advise("forced_oscillator", frame=0.1, tolerance=1e-1)
    refused = {each.method: each.reason for each in advice.rejected if each.kind == "refused"}
    assert set(refused) == {m.name for m in sw.methods() if m.needs_acceleration}
    assert "damping" in refused["verlet"]
    only = sw.advise("forced_oscillator", tolerance=1e-1, methods=["verlet"])
    assert only.best is None
    assert "Nothing fits" in str(only)


def test_a_choice_whose_neighbours_fail_says_so() -> None:
    """Where errors dip, the row says from where on they stay below the tolerance; all that were tried there do."""
    advice = sw.advise("clover", frame=None, tolerance=1e-4, cost="evaluations")
    scene = truth_of("clover")
    for row in advice.ranked:
        if row.is_robust:
            assert error_of(scene, row.method.name, scene.horizon / (row.steps + 1), row.steps + 1) <= 1e-4
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
        ({"methods": "rk4"}, DTypeError, "methods: expected a list of names, got the text 'rk4'"),
        ({"methods": []}, ArgumentError, "methods: expected at least one, got none"),
        ({"methods": ["rk5"]}, ArgumentError, "did you mean 'rk4'?"),
        ({"cost": "energy"}, ArgumentError, "Known: time, evaluations"),
        (
            {"scene": replace(sw.scenes.oscillator(), system=sw.Oscillator([1.0, 2.0]))},
            ArgumentError,
            "expected a system of one member",
        ),
    ],
)
def test_what_is_wrong_is_said(arguments: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error) as raised:
        sw.advise(**({"scene": "clover"} | arguments))
    assert said in str(raised.value)


# ---- telling


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
