"""What a sweep keeps of each member: extremes, means, crossings, periods, exponents, histories, functions."""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError
from stepwell.studies.sweeps import crossings, observed
from stepwell.studies.sweeps.task import Stopped
from support.looped import looped
from support.refusals import refused
from support.sweeping import AXES, duffing, ends, power, small

Oscillator = sw.Oscillator
F = np.float32

each_type = looped("dtype", ["float64", "float32"])


def whole(**options: Any) -> tuple[Any, sw.Run]:
    """A sweep, and the run of the same members with every observed state."""
    gamma = np.linspace(0.1, 0.6, 40)
    arguments: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.05}
    dataset = sw.sweep(duffing, {"gamma": ("gamma", gamma)}, "rk4", steps=400, transient=30, chunk=7, **arguments, **options)
    start = sw.integrate(duffing(gamma=gamma), "rk4", steps=30, **arguments)
    return dataset, sw.integrate(duffing(gamma=gamma), "rk4", steps=400, every=1, resume=start)


def test_extremes_and_means_of_a_closed_form() -> None:
    dataset, run = whole(outcomes=["extremes", sw.sweeps.Extremes("energy"), sw.sweeps.Extremes(power)])
    for name, values in {"v": run.v, "y": run.y, "energy": run.quantity("energy"), "power": run.v * run.y}.items():
        np.testing.assert_array_equal(dataset[f"{name}_min"], values.min(axis=0))
        np.testing.assert_array_equal(dataset[f"{name}_max"], values.max(axis=0))
    # The mean of cos² over a period is 1/2; the trapezoidal rule over whole periods has no error but RK4's.
    steps = 200
    axes = {"y": ("y0", [1.0, 2.0])}
    of = sw.sweeps.Mean(lambda t, v, y: y * y, name="square")
    dataset = sw.sweep(Oscillator(1.0), axes, "rk4", v=0.0, dt=2 * np.pi / steps, steps=steps, outcomes=of)
    # RK4 errs by Φ⁵/120 a step, so y by 2π·Φ⁴/120 after a period, and y² by twice that, times the amplitude squared.
    bound = 2 * 2 * np.pi * (2 * np.pi / steps) ** 4 / 120
    np.testing.assert_allclose(dataset.square_mean, [0.5, 2.0], rtol=2 * bound)


@looped("observe", [1, 7, 400])
def test_means(observe: int) -> None:
    """By the trapezoidal rule, the last interval shorter where the steps are no multiple of the interval."""
    dataset, run = whole(outcomes=["mean", sw.sweeps.Mean(power, name="p")], observe=observe)
    k = np.unique(np.append(np.arange(0, 401, observe), 400))
    for name, values in {"v": run.v, "y": run.y, "p": run.v * run.y}.items():
        t = run.t[k]
        sums = ((t[1:] - t[:-1])[:, None] / 2 * (values[k][1:] + values[k][:-1])).sum(axis=0) / (t[-1] - t[0])
        # n additions of numbers of size 1 err by n·2⁻⁵³ at most, on both sides.
        np.testing.assert_allclose(dataset[f"{name}_mean"], sums, atol=2 * 400 * 2**-53 * abs(values).max())


@looped("memory", [None, 2e4])
def test_a_first_passage_without_a_time_stays_the_first(memory: float | None) -> None:
    """From −∞ to ∞ there is no time of a passage, and a later one is not the first, wherever pieces end."""

    def jumps(t: Any, v: Any, y: Any) -> Any:
        return np.select([t < 1.0, t < 2.0, t < 3.0], [-np.inf, np.inf, -1.0], 1.0) + 0.0 * y

    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.01, "steps": 400, "memory": memory}
    found = sw.sweep(Oscillator, {"omega": [1.0, 2.0]}, "rk4", outcomes=sw.sweeps.Crossing(jumps), **options)
    assert np.isnan(found.jumps_crossing).all()


def mean_of(t: Any, values: Any) -> Any:
    """The trapezoidal rule, state after state."""
    total = np.zeros(values.shape[1:], values.dtype)
    for k in range(1, len(t)):
        total += 0.5 * (t[k] - t[k - 1]) * (values[k - 1] + values[k])
    return total / (t[-1] - t[0])


def test_what_is_found_of_states_of_float32_is_computed_in_float64() -> None:
    outcomes = ["mean", "extremes", sw.sweeps.Mean(power), sw.sweeps.Extremes("energy"), ends]
    dataset = small(dtype="float32", outcomes=outcomes, transient=0)
    gamma, y = (values for _, values in AXES.values())
    system = duffing(delta=0.2, gamma=gamma[:, None])
    run = sw.integrate(system, "rk4", v=0.0, y=y, dt=0.05, steps=80, every=1, dtype="float32")
    y, v = run.y.astype(np.float64), run.v.astype(np.float64)
    np.testing.assert_array_equal(dataset.y_mean, mean_of(run.t, y))
    np.testing.assert_array_equal(dataset.power_mean, mean_of(run.t, v * y))
    np.testing.assert_array_equal(dataset.energy_max, run.energy.max(axis=0))
    np.testing.assert_array_equal(dataset.y_max, run.y.max(axis=0))
    assert dataset.y_max.dtype == dataset.twice.dtype == F
    assert dataset.y_mean.dtype == dataset.power_mean.dtype == dataset.energy_max.dtype == np.float64
    # Sums and products of float32 are others.
    assert (mean_of(run.t.astype(F), run.y) != dataset.y_mean).any()
    assert (mean_of(run.t, (run.v * run.y).astype(np.float64)) != dataset.power_mean).any()


def crossing_errors(steps: int, **options: Any) -> Any:
    """By how much the time errs at which cos(ωt) falls to 1/2, for some ω; and the bound."""
    omega = np.array([1.0, 1.3, 1.7])
    h = 2.0 / steps
    of = sw.sweeps.Crossing("y", 0.5, "falling", **options)
    dataset = sw.sweep(Oscillator, {"omega": omega}, "rk4", v=0.0, y=1.0, dt=h, steps=steps, outcomes=of)
    t, phi = np.pi / 3 / omega, omega * h
    # A cubic by values and slopes at both ends errs by h⁴/384 of the fourth derivative, which is ω⁴ at most. RK4's states err by
    # Φ⁵/120 a step. The slopes err as much, and a cubic takes 4/27 of an interval of them: 4/27·Φ < 3 % more. The speed there is
    # ω·sin 60°.
    bound = 1.1 * (phi**4 / 384 + t / h * phi**5 / 120) / (omega * np.sin(np.pi / 3)) + 1e-15
    return abs(dataset.y_crossing.values - t), bound


@looped("steps", [20, 40, 80, 400])
def test_first_crossings_are_those_of_the_exact_motion(steps: int) -> None:
    errors, bound = crossing_errors(steps)
    assert (errors < bound).all()


@pytest.mark.mutant
def test_linear_crossings_and_slopes_of_the_wrong_sign_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crossings, "rates", lambda *_: None)
    errors, bound = crossing_errors(40)
    assert (errors > 10 * bound).all()
    monkeypatch.setattr(crossings, "rates", lambda *arguments: -np.asarray(observed.rates(*arguments)))
    errors, bound = crossing_errors(40)
    assert (errors > 10 * bound).any()


def test_crossings_of_other_quantities_are_linear_and_those_of_float32_between_states() -> None:
    """Of a function: (interval)²/8 · largest curvature / speed."""
    omega, h = np.array([1.0, 1.7]), 0.02
    of = sw.sweeps.Crossing(lambda t, v, y: y, 0.5, "falling", name="first")
    dataset = sw.sweep(Oscillator, {"omega": omega}, "rk4", v=0.0, y=1.0, dt=h, steps=100, outcomes=of)
    errors = abs(dataset.first_crossing.values - np.pi / 3 / omega)
    assert (errors < 1.01 * h**2 / 8 * omega**2 / (omega * np.sin(np.pi / 3))).all()
    assert (errors > 1e-7).any()
    # A quarter of a period. Each step rounds y by 2^-25 a few times, ten at most, and where it passes 0 its slope is 1.
    # Between states the cubic is wrong by h⁴/384, 3e-7 with h = 0.1; in float32 numbers near 1.57 are 1.2e-7 apart.
    steps, h = 20, 0.1
    crossing = sw.sweeps.Crossing("y", direction="falling")
    arguments: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": h, "steps": steps, "outcomes": crossing, "dtype": "float32"}
    dataset = sw.sweep(sw.Oscillator, {"omega": [1.0, 1.0]}, "dop853", **arguments)
    assert dataset.y_crossing.dtype == np.float64
    assert abs(dataset.y_crossing.values - np.pi / 2).max() < 10 * steps * 2.0**-25 + h**4 / 384
    run = sw.integrate(sw.Oscillator(1.0), "dop853", v=0.0, y=1.0, dt=h, steps=steps, every=1, dtype="float32")
    after = int(np.argmax(run.y <= 0.0))
    assert run.t[after - 1] < dataset.y_crossing.values[0] < run.t[after]


def test_directions_what_never_passes_and_what_passes_at_a_state() -> None:
    outcomes = [sw.sweeps.Crossing("y", 0.5, d, name=d) for d in ("falling", "rising", "both")]
    dataset = sw.sweep(Oscillator(1.0), {"y": [1.0, 0.4]}, "rk4", v=0.0, dt=0.01, steps=600, outcomes=[*outcomes, "crossing"])
    third = np.pi / 3
    for name, time in {"falling": third, "rising": 5 * third, "both": third}.items():
        assert float(dataset[f"{name}_crossing"][0]) == pytest.approx(time, abs=1e-8)
        assert np.isnan(dataset[f"{name}_crossing"][1])
    np.testing.assert_allclose(dataset.y_crossing, 1.5 * np.pi, atol=1e-8)
    # A sampled level that is met exactly at a state: it is passed there, and not again in the next interval.
    of = [
        sw.sweeps.Crossing(lambda t, v, y: t + 0.0 * y, 0.5, name="met"),
        sw.sweeps.Period(lambda t, v, y: t + 0.0 * y, 0.5, name="met"),
    ]
    dataset = sw.sweep(Oscillator(1.0), {"y": [1.0, 2.0]}, "rk4", v=0.0, dt=0.25, steps=8, outcomes=of)
    np.testing.assert_array_equal(dataset.met_crossing, 0.5)
    np.testing.assert_array_equal(dataset.met_passages, 1)
    assert np.isnan(dataset.met_period).all()


@looped("number, word", [(1, "rising"), (-1, "falling"), (0, "both")])
def test_directions_are_those_of_events(number: int, word: Any) -> None:
    """As a number or as a word, in both; a crossing of both says it as an event does."""
    crossings = [sw.sweeps.Crossing("y", 0.5, each) for each in (number, word)]
    events = [sw.Event(power, direction=each) for each in (number, word)]
    assert [each.direction for each in crossings + events] == [number] * 4
    assert events[0] == events[1]
    assert repr(crossings[0]) == repr(crossings[1])
    refused(ArgumentError, r"direction: there is no 'up'.* Known: rising, falling, both", sw.sweeps.Crossing, "y", direction="up")
    refused(ArgumentError, "direction: expected -1 or more, up to 1, got 2", sw.Event, power, direction=2)


@looped("memory", [64 * 2**20, 3000])
def test_periods(memory: float) -> None:
    """Of 2π/ω: RK4's own frequency is lower by Φ⁴/120; n intervals share the errors of two passages, of Φ⁴/384 each at most."""
    omega, h, steps = np.array([1.0, 1.5, 2.0]), 0.05, 1000
    of = sw.sweeps.Period("y", 0.2)
    dataset = sw.sweep(Oscillator, {"omega": omega}, "rk4", v=0.0, y=1.0, dt=h, steps=steps, outcomes=of, memory=memory)
    phi, period = omega * h, 2 * np.pi / omega
    expected = np.floor((steps * h - np.arccos(-0.2) / omega) / period)
    n = dataset.y_passages.values - 1
    assert (abs(n - expected) <= 1).all()
    speed = omega * np.sqrt(1 - 0.2**2)
    # The amplitude falls by Φ⁶/144 a step, which moves a passage of 0.2 by 0.2/speed times that.
    drift = 0.2 / speed * steps * phi**6 / 144 / n
    bound = 1.1 * (period * phi**4 / 120 + 2 * phi**4 / 384 / speed / n + drift)
    assert (abs(dataset.y_period.values - period) < bound).all()
    wrong = dataset.y_period.values * n / (n + 1)  # as many intervals as passages
    assert (abs(wrong - period) > bound).all()


def test_lyapunov_exponents_are_those_of_lyapunov_and_can_be_stopped() -> None:
    gamma = np.array([0.2, 0.5])
    dataset = sw.sweep(
        duffing, {"gamma": gamma}, "rk4", v=0.0, y=1.0, dt=0.05, steps=300, transient=40, outcomes=sw.sweeps.Exponents("all", 5)
    )
    truth = sw.lyapunov(duffing(gamma=gamma), "rk4", v=0.0, y=1.0, dt=0.05, steps=300, transient=40, exponents="all", every=5)
    np.testing.assert_array_equal(dataset.lyapunov, truth.exponents.T)
    # The sum of both is minus the damping, up to the error of RK4.
    np.testing.assert_allclose(dataset.lyapunov.sum("exponent"), -0.3, atol=1e-5)
    # As at Ctrl-C: of a chunk that would take days, in a thread that no signal reaches.
    start, calls = {"v": 0.0, "y": np.ones(1000), "dt": 0.1, "t0": 0.0}, []

    def look() -> None:
        calls.append(None)
        if len(calls) == 5:
            raise Stopped

    with pytest.raises(Stopped):
        sw.sweeps.Exponents(every=20).of_start(sw.Pendulum(), "rk4", start, 40, 10**12, look)


@each_type
@looped("every, steps", [(1, 10), (4, 10), (5, 10), (20, 10)])
def test_histories_are_those_of_integrate(every: int, steps: int, dtype: Any) -> None:
    omega = np.array([1.0, 2.0, 3.0])
    arguments: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": 0.1, "steps": steps, "every": every, "dtype": dtype}
    dataset = sw.sweep(Oscillator, {"omega": omega}, "verlet", **arguments, memory=1500, chunk=2)
    run = sw.integrate(Oscillator(omega), "verlet", **arguments)
    assert dataset.y.dtype == dataset.v.dtype == run.y.dtype == dtype
    assert dataset.attrs.get("dtype", "float64") == dtype
    np.testing.assert_array_equal(dataset.y, run.y.T)
    np.testing.assert_array_equal(dataset.v, run.v.T)
    np.testing.assert_array_equal(dataset.t, run.t)


def test_functions_of_a_run_and_a_history_beside_reductions() -> None:
    def seen(run: sw.Run) -> Any:
        return {"largest": abs(run.y).max(axis=0), "states": ("k", run.y), "number": np.full(run.status.size, len(run.t))}

    dataset, run = whole(outcomes=[seen, lambda run: run.y[-1] > 0], every=50)
    assert "y" not in dataset
    np.testing.assert_array_equal(dataset.states, run.y[::50].T)
    np.testing.assert_array_equal(dataset.largest, abs(run.y[::50]).max(axis=0))
    assert dataset.number.dtype.kind == "i"
    np.testing.assert_array_equal(dataset.function, run.y[-1] > 0)
    dataset = sw.sweep(
        Oscillator, {"omega": [1.0, 2.0]}, "rk4", v=0.0, y=1.0, dt=0.1, steps=20, every=6, observe=4,
        outcomes=["history", "extremes", "last"], memory=1500,
    )  # fmt: skip
    run = sw.integrate(Oscillator([1.0, 2.0]), "rk4", v=0.0, y=1.0, dt=0.1, steps=20, every=1)
    np.testing.assert_array_equal(dataset.y, run.y[[0, 6, 12, 18, 20]].T)
    np.testing.assert_array_equal(dataset.y_min, run.y[[0, 4, 8, 12, 16, 20]].min(axis=0))
    np.testing.assert_array_equal(dataset.y_last, run.y[-1])


def test_what_diverges_leaves_the_others_alone_and_what_means_nothing_is_told() -> None:
    omega = np.array([1.0, 30.0, 2.0, 40.0])
    arguments: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1000}
    message = r"2 of 4 members diverged, the first of them at omega = 30, at step 369; status and first_bad_step tell"
    with pytest.warns(sw.DivergenceWarning, match=message) as caught:
        dataset = sw.sweep(
            Oscillator, {"omega": omega}, "false_euler", outcomes=["last", "extremes", "period"], chunk=3, **arguments
        )
    assert (len(caught), caught[0].filename) == (1, __file__)
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(Oscillator(omega), "false_euler", **arguments)
    np.testing.assert_array_equal(dataset.status, run.status)
    np.testing.assert_array_equal(dataset.first_bad_step, run.first_bad_step)
    alone = sw.sweep(Oscillator, {"omega": omega[::2]}, "false_euler", outcomes=["last", "extremes", "period"], **arguments)
    for name in alone.data_vars:
        np.testing.assert_array_equal(dataset[name][::2], alone[name])
    assert dataset.status.attrs["flag_meanings"].split()[:3] == ["not_computed", "ok", "diverged"]
    assert np.isnan(dataset.y_max[1])
    with pytest.warns(sw.AccuracyWarning, match=r"in 1 chunk, the first beginning at v = 1: "):
        sw.sweep(sw.Pendulum(), {"v": [1.0, 1e18]}, "rk4", y=0.0, dt=0.1, steps=10)


OBSERVED: dict[str, sw.System] = {
    "own equations, driven": duffing(gamma=np.array([0.1, 0.5, 0.9])),
    "sinusoid": sw.Pendulum(1.3, 0.1, a=sw.Sinusoid(np.array([0.5, 1.0, 1.5]), 1.1, 0.3)),
    "samples": sw.Oscillator(1.3, 0.1, x=sw.Sampled(np.linspace(-1.0, 1.0, 16), 0.5), form="physical"),
    "canonical": sw.Oscillator(np.array([1.0, 2.0, 3.0])),
    "bodies": sw.scenes.figure_eight().system,
}


@looped("name", OBSERVED)
def test_rates_are_those_of_the_motion(name: str) -> None:
    """Each member at a time of its own, as at passages; compared with a short step of RK4 from there."""
    system, rng, t, h = OBSERVED[name], np.random.default_rng(1), np.array([0.1, 1.3, 2.6]), 1e-5
    v, y = (rng.uniform(0.5, 1.0, (*shape, 3)) for shape in (system.v_shape, system.y_shape))
    run = sw.integrate(system, "rk4", v=v, y=y, dt=0.1, steps=1)
    for block in ("v", "y"):
        rates = observed.rates(run, block, t, v, y)
        assert rates is not None
        for i in range(3):
            after = sw.integrate(system, "rk4", v=v, y=y, dt=h, steps=1, t0=float(t[i]))
            change = (getattr(after, block)[-1] - (v if block == "v" else y))[..., i] / h
            # Rates change by some units in a unit of time (bodies that are near: some hundred), and differences are rounded.
            np.testing.assert_allclose(rates[..., i], change, atol=1e3 * h, rtol=1e-4)
