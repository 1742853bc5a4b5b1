"""Sweeps: axes, what is kept of each member, and that it does not depend on how members are divided."""

from __future__ import annotations

import re
import subprocess
import sys
import tracemalloc
import warnings
from functools import partial
from typing import Any

import numpy as np
import pytest
import scipy.stats
import stepwell as sw
import xarray
from stepwell.errors import ArgumentError, DTypeError, UnsupportedError
from stepwell.studies.sweeps import axes as of_axes
from stepwell.studies.sweeps import crossings, observed, outcomes
from stepwell.studies.sweeps.task import Stopped
from support.sweeping import AXES, OUTCOMES, duffing, ends, power, small, unlike

Oscillator = sw.Oscillator
F = np.float32
#: Outcomes that go with float32.
WITH_FLOAT32 = tuple(each for each in OUTCOMES if each != "lyapunov")

each_type = pytest.mark.parametrize("dtype", ["float64", "float32"])


# ---- axes


def test_a_product_is_what_integrate_gives() -> None:
    found = small(outcomes="last", transient=0)
    assert found.y_last.dims == ("gamma", "y0")
    gamma, y = (values for _, values in AXES.values())
    run = sw.integrate(duffing(delta=0.2, gamma=gamma[:, None]), "rk4", v=0.0, y=y, dt=0.05, steps=80)
    np.testing.assert_array_equal(found.y_last, run.y[-1])
    np.testing.assert_array_equal(found.v_last, run.v[-1])
    np.testing.assert_array_equal(found.gamma, gamma)
    np.testing.assert_array_equal(found.y0, y)
    one = found.sel(gamma=gamma[3], y0=y[1])
    alone = sw.integrate(duffing(delta=0.2, gamma=gamma[3]), "rk4", v=0.0, y=y[1], dt=0.05, steps=80)
    assert float(one.y_last) == float(alone.y[-1])


def test_axes_of_one_dimension_vary_together() -> None:
    omega, y, d = np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.6, 0.7]), np.array([0.0, 0.1])
    axes = {"omega": ("run", omega), "y": ("run", y), "damping": d}
    found = sw.sweep(Oscillator, axes, "rk4", v=0.0, dt=0.1, steps=10)
    assert dict(found.sizes) == {"run": 3, "damping": 2}
    assert found.coords.keys() == {"omega", "y_start", "damping"}
    for i in range(3):
        for j in range(2):
            run = sw.integrate(Oscillator(omega[i], d[j]), "rk4", v=0.0, y=y[i], dt=0.1, steps=10)
            assert float(found.y_last[i, j]) == float(run.y[-1])


def test_axes_of_xarray_and_of_two_dimensions() -> None:
    values = xarray.DataArray([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], dims=("a", "b"), attrs={"units": "1/s"})
    found = sw.sweep(Oscillator, {"y": ("b", [0.1, 0.2, 0.3]), "omega": values}, "rk4", v=0.0, dt=0.1, steps=10, chunk=2)
    assert found.y_last.dims == ("b", "a")
    assert found.omega.attrs["units"] == "1/s"
    run = sw.integrate(Oscillator(values.values), "rk4", v=0.0, y=np.array([0.1, 0.2, 0.3]), dt=0.1, steps=10)
    np.testing.assert_array_equal(found.y_last.transpose("a", "b"), run.y[-1])


def test_blocks_with_axes_of_their_own() -> None:
    """Batch axes come last, in axes as everywhere; results have them first, as labelled arrays have."""
    scene = sw.scenes.figure_eight()
    factor = np.array([0.9, 1.0, 1.1, 1.2])
    axes = {"v": ("speed", scene.v[..., None] * factor)}
    found = sw.sweep(scene.system, axes, "leapfrog", y=scene.y, dt=0.01, steps=50, every=20, chunk=3)
    assert found.y.dims[:2] == ("speed", "t")
    assert found.y.shape == (4, 4, *scene.y.shape)
    run = sw.integrate(scene.system, "leapfrog", v=scene.v[..., None] * factor, y=scene.y[..., None], dt=0.01, steps=50, every=20)
    np.testing.assert_array_equal(found.y, np.moveaxis(run.y, -1, 0))
    np.testing.assert_array_equal(found.t, run.t)
    np.testing.assert_array_equal(found.v_start, np.moveaxis(scene.v[..., None] * factor, -1, 0))


@each_type
@pytest.mark.parametrize("method", ["leapfrog", "verlet", "merson"])
def test_a_step_as_an_axis(method: str, dtype: Any) -> None:
    """A run has one step, so those of one step are computed together; its dimension comes first."""
    dt, omega = np.array([0.01, 0.02, 0.05]), np.array([1.0, 2.0])
    axes = {"omega": ("omega", omega), "dt": ("dt", dt)}
    found = sw.sweep(Oscillator, axes, method, v=0.0, y=1.0, steps=40, transient=7, every=16, dtype=dtype)
    assert found.y.dims == ("dt", "omega", "saved")
    for i, h in enumerate(dt):
        run = sw.integrate(Oscillator(omega), method, v=0.0, y=1.0, dt=float(h), steps=47, every=1, dtype=dtype)
        assert (run.t[47] == 47 * h) == (dtype == "float64")  # a step of float32 is rounded
        np.testing.assert_array_equal(found.y[i], run.y[[7, 23, 39, 47]].T)
        np.testing.assert_array_equal(found.v[i], run.v[[7, 23, 39, 47]].T)
        np.testing.assert_array_equal(found.t[i], run.t[[7, 23, 39, 47]])


def test_a_step_that_varies_with_a_parameter() -> None:
    axes = {"omega": ("run", [1.0, 2.0]), "dt": ("run", [0.1, 0.05])}
    found = sw.sweep(Oscillator, axes, "rk4", v=0.0, y=1.0, steps=30)
    for i, (omega, h) in enumerate([(1.0, 0.1), (2.0, 0.05)]):
        assert float(found.y_last[i]) == float(sw.integrate(Oscillator(omega), "rk4", v=0.0, y=1.0, dt=h, steps=30).y[-1])


def test_a_force_as_an_axis() -> None:
    force = np.array([0.0, 0.5, 1.0])
    found = sw.sweep(sw.Pendulum(), {"force": ("push", force)}, "rk4", v=0.0, y=1.0, dt=0.1, steps=30, chunk=2)
    run = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=30, force=force)
    np.testing.assert_array_equal(found.y_last, run.y[-1])


@pytest.mark.parametrize("shape", [(7,), (3, 5), (2, 3, 4), (1, 6, 1)])
@pytest.mark.parametrize("of_dt", [0, 1])
def test_chunks_are_all_members_in_their_order(shape: tuple[int, ...], of_dt: int) -> None:
    names = ["dt" if of_dt and i == 0 else f"p{i}" for i in range(len(shape))]
    grid = of_axes.grid({name: np.arange(1.0, n + 1.0) for name, n in zip(names, shape, strict=True)})
    for most in range(1, grid.members + 2):
        width = grid.chunk_shape(most)
        chunks = list(grid.chunks(width))
        members = np.arange(grid.members).reshape(shape)
        order = np.concatenate([members[chunk.slices].ravel() for chunk in chunks])
        np.testing.assert_array_equal(order, np.arange(grid.members))
        assert [chunk.first for chunk in chunks] == [members[chunk.slices].flat[0] for chunk in chunks]
        assert all(chunk.members <= most for chunk in chunks)
        if of_dt:
            assert all(chunk.shape[0] == 1 for chunk in chunks)


def test_random_samples_have_a_seed() -> None:
    one, same, other = (sw.sweeps.random("sample", 4096, seed=s, omega=(1.0, 3.0), y=(-1.0, 1.0)) for s in (1, 1, 2))
    np.testing.assert_array_equal(one["omega"][1], same["omega"][1])
    assert (one["omega"][1] != other["omega"][1]).all()
    # The mean of n uniform numbers of width w errs by w/√(12 n); five times that is exceeded once in two million.
    assert abs(one["omega"][1].mean() - 2.0) < 5 * 2.0 / np.sqrt(12 * 4096)
    assert one["omega"][1].min() >= 1.0
    assert one["omega"][1].max() < 3.0
    found = sw.sweep(Oscillator, one, "rk4", v=0.0, dt=0.1, steps=10)
    assert dict(found.sizes) == {"sample": 4096}
    assert "seed 1" in found.omega.attrs["sampling"]
    run = sw.integrate(Oscillator(one["omega"][1]), "rk4", v=0.0, y=one["y"][1], dt=0.1, steps=10)
    np.testing.assert_array_equal(found.y_last, run.y[-1])


def test_sobol_fills_the_box_evenly() -> None:
    """Each of 2ᵏ equal intervals of each argument has as many points; random samples do not."""
    axes = sw.sweeps.sobol("sample", 256, seed=3, omega=(1.0, 3.0), y=scipy.stats.norm(0.0, 2.0))
    for name, unit in (("omega", (axes["omega"][1] - 1.0) / 2.0), ("y", scipy.stats.norm.cdf(axes["y"][1] / 2.0))):
        assert (np.histogram(unit, 16, (0.0, 1.0))[0] == 16).all(), name
    np.testing.assert_array_equal(
        axes["y"][1], sw.sweeps.sobol("s", 256, seed=3, omega=(1.0, 3.0), y=scipy.stats.norm(0.0, 2.0))["y"][1]
    )
    drawn = sw.sweeps.random("sample", 256, seed=3, omega=(1.0, 3.0))["omega"][1]
    assert (np.histogram(drawn, 16, (1.0, 3.0))[0] != 16).any()
    with pytest.raises(ArgumentError, match="count: expected a power of two for Sobol's sequence, got 100; 128 is one"):
        sw.sweeps.sobol("sample", 100, seed=3, omega=(1.0, 3.0))


# ---- what is kept of each member


def whole(**options: Any) -> tuple[Any, sw.Run]:
    """A sweep, and the run of the same members with every observed state."""
    gamma = np.linspace(0.1, 0.6, 40)
    given: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.05}
    found = sw.sweep(duffing, {"gamma": ("gamma", gamma)}, "rk4", steps=400, transient=30, chunk=7, **given, **options)
    start = sw.integrate(duffing(gamma=gamma), "rk4", steps=30, **given)
    return found, sw.integrate(duffing(gamma=gamma), "rk4", steps=400, every=1, resume=start)


def test_extremes() -> None:
    found, run = whole(outcomes=["extremes", sw.sweeps.Extremes("energy"), sw.sweeps.Extremes(power)])
    for name, values in {"v": run.v, "y": run.y, "energy": run.quantity("energy"), "power": run.v * run.y}.items():
        np.testing.assert_array_equal(found[f"{name}_min"], values.min(axis=0))
        np.testing.assert_array_equal(found[f"{name}_max"], values.max(axis=0))


@pytest.mark.parametrize("observe", [1, 7, 400])
def test_means(observe: int) -> None:
    """By the trapezoidal rule, the last interval shorter where the steps are no multiple of the interval."""
    found, run = whole(outcomes=["mean", sw.sweeps.Mean(power, name="p")], observe=observe)
    k = np.unique(np.append(np.arange(0, 401, observe), 400))
    for name, values in {"v": run.v, "y": run.y, "p": run.v * run.y}.items():
        t = run.t[k]
        sums = ((t[1:] - t[:-1])[:, None] / 2 * (values[k][1:] + values[k][:-1])).sum(axis=0) / (t[-1] - t[0])
        # n additions of numbers of size 1 err by n·2⁻⁵³ at most, on both sides.
        np.testing.assert_allclose(found[f"{name}_mean"], sums, atol=2 * 400 * 2**-53 * abs(values).max())


def mean_of(t: Any, values: Any) -> Any:
    """The trapezoidal rule, state after state."""
    total = np.zeros(values.shape[1:], values.dtype)
    for k in range(1, len(t)):
        total += 0.5 * (t[k] - t[k - 1]) * (values[k - 1] + values[k])
    return total / (t[-1] - t[0])


def test_what_is_found_of_states_of_float32_is_computed_in_float64() -> None:
    outcomes = ["mean", "extremes", sw.sweeps.Mean(power), sw.sweeps.Extremes("energy"), ends]
    found = small(dtype="float32", outcomes=outcomes, transient=0)
    gamma, y = (values for _, values in AXES.values())
    system = duffing(delta=0.2, gamma=gamma[:, None])
    run = sw.integrate(system, "rk4", v=0.0, y=y, dt=0.05, steps=80, every=1, dtype="float32")
    y, v = run.y.astype(np.float64), run.v.astype(np.float64)
    np.testing.assert_array_equal(found.y_mean, mean_of(run.t, y))
    np.testing.assert_array_equal(found.power_mean, mean_of(run.t, v * y))
    np.testing.assert_array_equal(found.energy_max, run.energy.max(axis=0))
    np.testing.assert_array_equal(found.y_max, run.y.max(axis=0))
    assert found.y_max.dtype == found.twice.dtype == F
    assert found.y_mean.dtype == found.power_mean.dtype == found.energy_max.dtype == np.float64
    # Sums and products of float32 are others.
    assert (mean_of(run.t.astype(F), run.y) != found.y_mean).any()
    assert (mean_of(run.t, (run.v * run.y).astype(np.float64)) != found.power_mean).any()


def test_means_of_a_closed_form() -> None:
    """The mean of cos² over a period is 1/2; the trapezoidal rule over whole periods has no error but RK4's."""
    steps = 200
    axes = {"y": ("y0", [1.0, 2.0])}
    of = sw.sweeps.Mean(lambda t, v, y: y * y, name="square")
    found = sw.sweep(Oscillator(1.0), axes, "rk4", v=0.0, dt=2 * np.pi / steps, steps=steps, outcomes=of)
    # RK4 errs by Φ⁵/120 a step, so y by 2π·Φ⁴/120 after a period, and y² by twice that, times the amplitude squared.
    bound = 2 * 2 * np.pi * (2 * np.pi / steps) ** 4 / 120
    np.testing.assert_allclose(found.square_mean, [0.5, 2.0], rtol=2 * bound)


def crossing_errors(steps: int, **options: Any) -> Any:
    """By how much the time errs at which cos(ωt) falls to 1/2, for some ω; and the bound."""
    omega = np.array([1.0, 1.3, 1.7])
    h = 2.0 / steps
    of = sw.sweeps.Crossing("y", 0.5, "falling", **options)
    found = sw.sweep(Oscillator, {"omega": omega}, "rk4", v=0.0, y=1.0, dt=h, steps=steps, outcomes=of)
    t, phi = np.pi / 3 / omega, omega * h
    # A cubic by values and slopes at both ends errs by h⁴/384 of the fourth derivative, which is ω⁴ at most. RK4's states err by
    # Φ⁵/120 a step. The slopes err as much, and a cubic takes 4/27 of an interval of them: 4/27·Φ < 3 % more. The speed there is
    # ω·sin 60°.
    bound = 1.1 * (phi**4 / 384 + t / h * phi**5 / 120) / (omega * np.sin(np.pi / 3)) + 1e-15
    return abs(found.y_crossing.values - t), bound


@pytest.mark.parametrize("steps", [20, 40, 80, 400])
def test_first_crossings_are_those_of_the_exact_motion(steps: int) -> None:
    errors, bound = crossing_errors(steps)
    assert (errors < bound).all()


@pytest.mark.mutant
def test_linear_crossings_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crossings, "rates", lambda *_: None)
    errors, bound = crossing_errors(40)
    assert (errors > 10 * bound).all()


@pytest.mark.mutant
def test_slopes_of_the_wrong_sign_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crossings, "rates", lambda *given: -np.asarray(observed.rates(*given)))
    errors, bound = crossing_errors(40)
    assert (errors > 10 * bound).any()


def test_crossings_of_other_quantities_are_linear() -> None:
    """Of a function: (interval)²/8 · largest curvature / speed."""
    omega, h = np.array([1.0, 1.7]), 0.02
    of = sw.sweeps.Crossing(lambda t, v, y: y, 0.5, "falling", name="first")
    found = sw.sweep(Oscillator, {"omega": omega}, "rk4", v=0.0, y=1.0, dt=h, steps=100, outcomes=of)
    errors = abs(found.first_crossing.values - np.pi / 3 / omega)
    assert (errors < 1.01 * h**2 / 8 * omega**2 / (omega * np.sin(np.pi / 3))).all()
    assert (errors > 1e-7).any()


def test_a_crossing_is_found_between_states_of_float32() -> None:
    """A quarter of a period. Each step rounds y by 2^-25 a few times, ten at most, and where it passes 0 its slope is 1.

    Between states the cubic is wrong by h⁴/384, 3e-7 with h = 0.1; in float32 numbers near 1.57 are 1.2e-7 apart.
    """
    steps, h = 20, 0.1
    crossing = sw.sweeps.Crossing("y", direction="falling")
    given: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": h, "steps": steps, "outcomes": crossing, "dtype": "float32"}
    found = sw.sweep(sw.Oscillator, {"omega": [1.0, 1.0]}, "dop853", **given)
    assert found.y_crossing.dtype == np.float64
    assert abs(found.y_crossing.values - np.pi / 2).max() < 10 * steps * 2.0**-25 + h**4 / 384
    run = sw.integrate(sw.Oscillator(1.0), "dop853", v=0.0, y=1.0, dt=h, steps=steps, every=1, dtype="float32")
    after = int(np.argmax(run.y <= 0.0))
    assert run.t[after - 1] < found.y_crossing.values[0] < run.t[after]


def test_directions_and_what_never_passes() -> None:
    outcomes = [sw.sweeps.Crossing("y", 0.5, d, name=d) for d in ("falling", "rising", "both")]
    found = sw.sweep(Oscillator(1.0), {"y": [1.0, 0.4]}, "rk4", v=0.0, dt=0.01, steps=600, outcomes=[*outcomes, "crossing"])
    third = np.pi / 3
    for name, time in {"falling": third, "rising": 5 * third, "both": third}.items():
        assert float(found[f"{name}_crossing"][0]) == pytest.approx(time, abs=1e-8)
        assert np.isnan(found[f"{name}_crossing"][1])
    np.testing.assert_allclose(found.y_crossing, 1.5 * np.pi, atol=1e-8)


@pytest.mark.parametrize(("number", "word"), [(1, "rising"), (-1, "falling"), (0, "both")])
def test_directions_are_those_of_events(number: int, word: Any) -> None:
    """As a number or as a word, in both; a crossing of both says it as an event does."""
    crossings = [sw.sweeps.Crossing("y", 0.5, each) for each in (number, word)]
    events = [sw.Event(power, direction=each) for each in (number, word)]
    assert [each.direction for each in crossings + events] == [number] * 4
    assert events[0] == events[1]
    assert repr(crossings[0]) == repr(crossings[1])
    with pytest.raises(ArgumentError, match=r"direction: there is no 'up'.* Known: rising, falling, both"):
        sw.sweeps.Crossing("y", direction="up")  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="direction: expected -1 or more, up to 1, got 2"):
        sw.Event(power, direction=2)


def test_a_crossing_at_a_state_counts_once() -> None:
    """A sampled level that is met exactly at a state: it is passed there, and not again in the next interval."""
    of = [
        sw.sweeps.Crossing(lambda t, v, y: t + 0.0 * y, 0.5, name="met"),
        sw.sweeps.Period(lambda t, v, y: t + 0.0 * y, 0.5, name="met"),
    ]
    found = sw.sweep(Oscillator(1.0), {"y": [1.0, 2.0]}, "rk4", v=0.0, dt=0.25, steps=8, outcomes=of)
    np.testing.assert_array_equal(found.met_crossing, 0.5)
    np.testing.assert_array_equal(found.met_passages, 1)
    assert np.isnan(found.met_period).all()


@pytest.mark.parametrize("memory", [64 * 2**20, 3000])
def test_periods(memory: float) -> None:
    """Of 2π/ω: RK4's own frequency is lower by Φ⁴/120; n intervals share the errors of two passages, of Φ⁴/384 each at most."""
    omega, h, steps = np.array([1.0, 1.5, 2.0]), 0.05, 1000
    of = sw.sweeps.Period("y", 0.2)
    found = sw.sweep(Oscillator, {"omega": omega}, "rk4", v=0.0, y=1.0, dt=h, steps=steps, outcomes=of, memory=memory)
    phi, period = omega * h, 2 * np.pi / omega
    expected = np.floor((steps * h - np.arccos(-0.2) / omega) / period)
    n = found.y_passages.values - 1
    assert (abs(n - expected) <= 1).all()
    speed = omega * np.sqrt(1 - 0.2**2)
    # The amplitude falls by Φ⁶/144 a step, which moves a passage of 0.2 by 0.2/speed times that.
    drift = 0.2 / speed * steps * phi**6 / 144 / n
    bound = 1.1 * (period * phi**4 / 120 + 2 * phi**4 / 384 / speed / n + drift)
    assert (abs(found.y_period.values - period) < bound).all()
    wrong = found.y_period.values * n / (n + 1)  # as many intervals as passages
    assert (abs(wrong - period) > bound).all()


def test_a_sweep_of_exponents_stops_between_two_orthonormalisations() -> None:
    """As at Ctrl-C: of a chunk that would take days, in a thread that no signal reaches."""
    start, calls = {"v": 0.0, "y": np.ones(1000), "dt": 0.1, "t0": 0.0}, []

    def look() -> None:
        calls.append(None)
        if len(calls) == 5:
            raise Stopped

    with pytest.raises(Stopped):
        sw.sweeps.Exponents(every=20).of_start(sw.Pendulum(), "rk4", start, 40, 10**12, look)


def test_lyapunov_exponents_are_those_of_lyapunov() -> None:
    gamma = np.array([0.2, 0.5])
    found = sw.sweep(
        duffing, {"gamma": gamma}, "rk4", v=0.0, y=1.0, dt=0.05, steps=300, transient=40, outcomes=sw.sweeps.Exponents("all", 5)
    )
    truth = sw.lyapunov(duffing(gamma=gamma), "rk4", v=0.0, y=1.0, dt=0.05, steps=300, transient=40, exponents="all", every=5)
    np.testing.assert_array_equal(found.lyapunov, truth.exponents.T)
    # The sum of both is minus the damping, up to the error of RK4.
    np.testing.assert_allclose(found.lyapunov.sum("exponent"), -0.3, atol=1e-5)


@each_type
@pytest.mark.parametrize(("every", "steps"), [(1, 10), (4, 10), (5, 10), (20, 10)])
def test_histories_are_those_of_integrate(every: int, steps: int, dtype: Any) -> None:
    omega = np.array([1.0, 2.0, 3.0])
    given: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": 0.1, "steps": steps, "every": every, "dtype": dtype}
    found = sw.sweep(Oscillator, {"omega": omega}, "verlet", **given, memory=1500, chunk=2)
    run = sw.integrate(Oscillator(omega), "verlet", **given)
    assert found.y.dtype == found.v.dtype == run.y.dtype == dtype
    assert found.attrs.get("dtype", "float64") == dtype
    np.testing.assert_array_equal(found.y, run.y.T)
    np.testing.assert_array_equal(found.v, run.v.T)
    np.testing.assert_array_equal(found.t, run.t)


def test_a_history_beside_reductions_that_see_other_states() -> None:
    found = sw.sweep(
        Oscillator, {"omega": [1.0, 2.0]}, "rk4", v=0.0, y=1.0, dt=0.1, steps=20, every=6, observe=4,
        outcomes=["history", "extremes", "last"], memory=1500,
    )  # fmt: skip
    run = sw.integrate(Oscillator([1.0, 2.0]), "rk4", v=0.0, y=1.0, dt=0.1, steps=20, every=1)
    np.testing.assert_array_equal(found.y, run.y[[0, 6, 12, 18, 20]].T)
    np.testing.assert_array_equal(found.y_min, run.y[[0, 4, 8, 12, 16, 20]].min(axis=0))
    np.testing.assert_array_equal(found.y_last, run.y[-1])


def test_functions_of_a_run() -> None:
    def seen(run: sw.Run) -> Any:
        return {"largest": abs(run.y).max(axis=0), "states": ("k", run.y), "number": np.full(run.status.size, len(run.t))}

    found, run = whole(outcomes=[seen, lambda run: run.y[-1] > 0], every=50)
    assert "y" not in found
    np.testing.assert_array_equal(found.states, run.y[::50].T)
    np.testing.assert_array_equal(found.largest, abs(run.y[::50]).max(axis=0))
    assert found.number.dtype.kind == "i"
    np.testing.assert_array_equal(found.function, run.y[-1] > 0)


def test_what_diverges_leaves_the_others_alone() -> None:
    omega = np.array([1.0, 30.0, 2.0, 40.0])
    given: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1000}
    message = r"2 of 4 members diverged, the first of them at omega = 30, at step 369; status and first_bad_step tell"
    with pytest.warns(sw.DivergenceWarning, match=message) as caught:
        found = sw.sweep(Oscillator, {"omega": omega}, "false_euler", outcomes=["last", "extremes", "period"], chunk=3, **given)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(Oscillator(omega), "false_euler", **given)
    np.testing.assert_array_equal(found.status, run.status)
    np.testing.assert_array_equal(found.first_bad_step, run.first_bad_step)
    alone = sw.sweep(Oscillator, {"omega": omega[::2]}, "false_euler", outcomes=["last", "extremes", "period"], **given)
    for name in alone.data_vars:
        np.testing.assert_array_equal(found[name][::2], alone[name])
    assert found.status.attrs["flag_meanings"].split()[:3] == ["not_computed", "ok", "diverged"]
    assert np.isnan(found.y_max[1])


def test_finite_numbers_that_mean_nothing_are_told() -> None:
    with pytest.warns(sw.AccuracyWarning, match=r"in 1 chunk, the first beginning at v = 1: "):
        sw.sweep(sw.Pendulum(), {"v": [1.0, 1e18]}, "rk4", y=0.0, dt=0.1, steps=10)


OBSERVED: dict[str, sw.System] = {
    "own equations, driven": duffing(gamma=np.array([0.1, 0.5, 0.9])),
    "sinusoid": sw.Pendulum(1.3, 0.1, a=sw.Sinusoid(np.array([0.5, 1.0, 1.5]), 1.1, 0.3)),
    "samples": sw.Oscillator(1.3, 0.1, x=sw.Sampled(np.linspace(-1.0, 1.0, 16), 0.5), form="physical"),
    "canonical": sw.Oscillator(np.array([1.0, 2.0, 3.0])),
    "bodies": sw.scenes.figure_eight().system,
}


@pytest.mark.parametrize("name", OBSERVED)
def test_rates_are_those_of_the_motion(name: str) -> None:
    """Each member at a time of its own, as at passages; compared with a short step of RK4 from there."""
    system, rng, t, h = OBSERVED[name], np.random.default_rng(1), np.array([0.1, 1.3, 2.6]), 1e-5
    v, y = (rng.uniform(0.5, 1.0, (*shape, 3)) for shape in (system.v_shape, system.y_shape))
    run = sw.integrate(system, "rk4", v=v, y=y, dt=0.1, steps=1)
    for block in ("v", "y"):
        found = observed.rates(run, block, t, v, y)
        assert found is not None
        for i in range(3):
            after = sw.integrate(system, "rk4", v=v, y=y, dt=h, steps=1, t0=float(t[i]))
            change = (getattr(after, block)[-1] - (v if block == "v" else y))[..., i] / h
            # Rates change by some units in a unit of time (bodies that are near: some hundred), and differences are rounded.
            np.testing.assert_allclose(found[..., i], change, atol=1e3 * h, rtol=1e-4)


# ---- the same bits


@pytest.mark.parametrize(
    "division",
    [
        {"chunk": 1},
        {"chunk": 2, "threads": 3},
        {"chunk": 7},
        {"chunk": 10_000},
        {"memory": 12_000.0},
        {"memory": 100_000.0, "chunk": 11},
    ],
    ids=str,
)
@each_type
def test_every_division_gives_the_same_bits(division: dict[str, Any], dtype: Any) -> None:
    given: dict[str, Any] = {} if dtype == "float64" else {"dtype": dtype, "outcomes": WITH_FLOAT32}
    one, other = small(**given), small(**given, **division)
    assert unlike(one, other) == []
    assert one.attrs == other.attrs
    assert len(one.attrs["bits"]) == 32
    assert given == {} or one.attrs["bits"] != small(outcomes=WITH_FLOAT32).attrs["bits"]


def test_a_bit_that_differs_has_another_hash() -> None:
    hashes = {
        small(outcomes="last", steps=3, y=y, axes={"gamma": [0.1, 0.2]}).attrs["bits"] for y in (1.0, np.nextafter(1.0, 2.0))
    }
    assert len(hashes) == 2


def test_samples_in_every_division() -> None:
    for axes in (
        sw.sweeps.random("sample", 64, seed=1, gamma=(0.1, 0.6), y=(-1.0, 1.0)),
        sw.sweeps.sobol("sample", 64, seed=1, gamma=(0.1, 0.6), y=(-1.0, 1.0)),
        sw.sweeps.sobol("sample", 8, seed=1, gamma=(0.1, 0.6)) | {"y": ("y0", [0.1, 0.2, 0.3])},
        {"gamma": ("run", np.linspace(0.1, 0.6, 9)), "y": ("run", np.linspace(-1.0, 1.0, 9))},
    ):
        assert len({small(axes=axes, chunk=n).attrs["bits"] for n in (5, 64)}) == 1


@pytest.mark.mutant
def test_a_sum_in_another_order_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mean that adds the states of a piece first would depend on the piece."""

    def see(self: Any, piece: Any) -> None:
        self.run = piece.run
        all_of = [piece.of(what) for what in self.outcome.whats(piece.run)]
        sums = [each.sum(axis=0) for each in all_of]
        self.sums = [a + b for a, b in zip(self.sums, sums, strict=True)] if self.sums else sums
        self.begin, self.t = 0.0, 1.0

    monkeypatch.setattr(outcomes._Mean, "see", see)
    assert len({small(outcomes="mean", memory=m).attrs["bits"] for m in (64.0 * 2**20, 12_000.0)}) == 2


def test_memory_is_bounded() -> None:
    """The trajectories are 64 MB; a chunk may take 2 MiB."""
    members, steps, memory = 2000, 2000, 2 * 2**20
    given: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.01, "outcomes": ["extremes", "mean", "period"], "threads": 1}
    axes = {"omega": np.linspace(0.5, 2.0, members)}
    sw.sweep(Oscillator, axes, "rk4", steps=10, **given)  # imports
    tracemalloc.start()
    try:
        sw.sweep(Oscillator, axes, "rk4", steps=steps, memory=memory, **given)
        peak = tracemalloc.get_traced_memory()[1]
        # Results are 9 numbers a member, axes and coordinates a few more; some hundred kilobytes are Python's own.
        assert peak < memory + 8 * 30 * members + 2**19
        sw.sweep(Oscillator, axes, "rk4", steps=steps, memory=64 * memory, **given)
        assert tracemalloc.get_traced_memory()[1] > 4 * peak  # so the bound above is one
    finally:
        tracemalloc.stop()


# ---- what is told of it


def test_attributes_tell_how_it_was_made() -> None:
    found = small(units={"t": "s", "y": "m", "gamma": "m/s²", "y_period": "h"})
    attrs = found.attrs
    assert attrs["stepwell_version"] == sw.__version__
    assert attrs["numpy_version"] == np.__version__
    assert (attrs["method"], attrs["dt"], attrs["steps"], attrs["transient"], attrs["t0"]) == ("rk4", 0.05, 80, 10, 0.0)
    assert attrs["title"] == "duffing by Runge-Kutta 4: a sweep of 45 members"
    assert found.y_last.attrs["units"] == found.y0.attrs["units"] == "m"
    assert (found.y_crossing.attrs["units"], found.y_period.attrs["units"], found.gamma.attrs["units"]) == ("s", "h", "m/s²")
    assert "units" not in found.v_last.attrs
    assert found.y0.attrs["argument"] == "y"


def test_progress_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    import contextlib

    from stepwell.base import progress

    shares: list[float] = []

    @contextlib.contextmanager
    def bar(title: str) -> Any:
        assert title == "sweep, 45 members"
        yield shares.append

    monkeypatch.setattr(progress, "bar", bar)
    small(progress=True, chunk=10, outcomes="last")
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) >= 4


# ---- what is refused


GOOD: dict[str, Any] = {
    "system": Oscillator,
    "axes": {"omega": [1.0, 2.0]},
    "method": "rk4",
    "v": 0.0,
    "y": 1.0,
    "dt": 0.1,
    "steps": 10,
}
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no axes": ({"axes": {}}, "axes: expected at least one, such as {'mu': ('mu', values)}, got none; for one run use integrate"),
    "axes as a list": ({"axes": [1.0]}, "axes: expected a dictionary of arguments by name"),
    "a wrong parameter": ({"axes": {"omege": [1.0]}}, "omege"),
    "words": ({"axes": {"omega": ("omega", ["a"])}}, "axes: omega: expected real numbers"),
    "not finite": ({"axes": {"omega": [1.0, np.nan]}}, "axes: omega: expected finite numbers, got nan"),
    "no values": ({"axes": {"omega": ("omega", [])}}, "axes: omega: expected at least one value"),
    "one number": ({"axes": {"omega": ("omega", 1.0)}}, "axes: omega: expected values along 'omega', the last of their axes"),
    "two lengths": (
        {"axes": {"omega": ("run", [1.0, 2.0]), "damping": ("run", [0.1])}},
        "axes: expected as many values of damping as of omega, since both vary along the dimension 'run', got 1 and 2",
    ),
    "twice": ({"axes": {"y": [1.0, 2.0]}}, "y: given twice, as an argument and in axes; leave one of them out"),
    "no state": ({"y": None}, "y: expected as an argument or in axes"),
    "no step": ({"dt": None}, "dt: expected as an argument or in axes"),
    "a parameter of a system": ({"system": Oscillator()}, "axes: omega would be a parameter, but Oscillator("),
    "no system": ({"system": 3}, "system: expected a system, or what makes one of parameters by name, got int"),
    "a batch beside": ({"y": np.ones(5)}, "batch"),
    "a batch of the same size": ({"axes": {"omega": [1.0, 2.0]}, "y": np.ones(2)}, "batch"),
    "no such outcome": ({"outcomes": "lasts"}, "outcomes: there is no 'lasts'; did you mean 'last'?"),
    "no outcome": ({"outcomes": []}, "outcomes: expected at least one of last, extremes"),
    "a number as an outcome": ({"outcomes": [3]}, "outcomes: expected words, outcomes or functions of a run, got 3"),
    "two of one name": ({"outcomes": ["crossing", sw.sweeps.Crossing("y", 0.5)]}, "outcomes: there are two results 'y_crossing'"),
    "a history without an interval": ({"outcomes": "history"}, "every: expected how many steps are between the states"),
    "an interval of nothing": ({"outcomes": "last", "every": 3}, "every: goes with the outcome 'history' or a function"),
    "an unknown quantity": ({"outcomes": sw.sweeps.Mean("momentum")}, "of: there is no 'momentum'"),
    "a component of a number": ({"outcomes": sw.sweeps.Mean(("y", 0))}, "of: a component of y of shape () is (\"y\"), got"),
    "a store without an ending": ({"store": "somewhere"}, "store: expected a path that ends in .zarr or .nc, got 'somewhere'"),
    "an engine": ({"engine": "dask"}, "engine: expected None, an executor of concurrent.futures or a client of dask.distributed"),
    "no memory": ({"memory": 100.0}, "memory: one member takes some"),
    "no steps": ({"steps": 0}, "steps: expected 1 or more"),
    "units": ({"units": {"y": 3}}, "units: expected words by name"),
    "a dimension of a result": ({"axes": {"omega": ("y_last", [1.0, 2.0])}}, "axes: 'y_last' is the name of a result"),
    "a method that cannot": ({"system": partial(Oscillator, damping=0.1), "method": "verlet"}, "verlet needs forces that do not"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_refused(what: str) -> None:
    wrong, message = REFUSED[what]
    with pytest.raises((sw.StepwellError, TypeError), match=re.escape(message)):
        sw.sweep(**(GOOD | wrong))


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"tolerance": 1e-3, "at": [1.0]}, UnsupportedError, "dtype: float32 goes with fixed steps only, and tolerance="),
        ({"outcomes": "lyapunov"}, ArgumentError, "dtype: goes without Lyapunov exponents"),
        ({"axes": {"omega": [1.0, 1e39, 1.0]}}, ArgumentError, "axes: omega: expected numbers up to 3.4e38"),
        (
            {"axes": {"dt": [0.1, 1e-50, 0.1]}, "dt": None},
            ArgumentError,
            "dt: expected a number of size 1.4e-45 to 3.4e38 units of time in float32",
        ),
        ({"y": 1e39}, ArgumentError, "y: expected numbers up to 3.4e38"),
        ({"method": "taylor"}, UnsupportedError, "dtype: float32 does not go with taylor"),
        ({"dtype": "float16"}, DTypeError, "dtype: expected 'float64' or 'float32', got 'float16'"),
    ],
)
def test_what_does_not_go_with_float32_is_said_before_any_work(
    options: dict[str, Any], error: type[Exception], said: str
) -> None:
    given = {
        "axes": {"omega": [1.0, 2.0, 3.0]},
        "method": "rk4",
        "v": 0.0,
        "y": 1.0,
        "dt": 0.1,
        "steps": 10,
        "dtype": "float32",
    } | options
    if "tolerance" in given:
        given |= {"dt": None, "steps": None}
    with pytest.raises(error, match=said):
        sw.sweep(sw.Oscillator(), **given) if "dt" in given["axes"] else sw.sweep(partial(sw.Oscillator), **given)  # type: ignore[arg-type]


def test_a_component_must_be_given_where_there_are_several() -> None:
    scene = sw.scenes.figure_eight()
    axes = {"v": ("speed", scene.v[..., None] * np.ones(2))}
    with pytest.raises(ArgumentError, match=re.escape("of: expected one number for each member, such as ('y', 0, 0)")):
        sw.sweep(scene.system, axes, "leapfrog", y=scene.y, dt=0.01, steps=5, outcomes="crossing")
    found = sw.sweep(
        scene.system, axes, "leapfrog", y=scene.y, dt=0.01, steps=300, outcomes=sw.sweeps.Crossing(("y", 0, 0), 0.5, "both")
    )
    run = sw.integrate(scene.system, "leapfrog", v=scene.v, y=scene.y, dt=0.01, steps=300, every=1)
    k = int(np.flatnonzero(np.diff(np.sign(run.y[:, 0, 0] - 0.5)))[0])
    assert run.t[k] <= float(found.y_0_0_crossing[0]) <= run.t[k + 1]


def test_a_package_that_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(UnsupportedError, match=re.escape("sweep: needs the package xarray, which is missing (")) as told:
        sw.sweep(**GOOD)
    assert 'pip install "stepwell[sweep]"' in str(told.value)


def test_importing_stepwell_imports_nothing_of_this() -> None:
    code = (
        "import sys, stepwell as sw; print(*[m for m in sys.modules if m.split('.')[0] in ('xarray', 'zarr', 'dask', 'pandas')], "
    )
    code += "*[m for m in sys.modules if m.startswith('stepwell.studies.sweeps')])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split() == []


def test_filters_of_warnings_are_as_before() -> None:
    before = list(warnings.filters)
    small(chunk=4, threads=4, outcomes="last")
    assert list(warnings.filters) == before


def test_every_kind_of_outcome_is_tried() -> None:
    tried = {type(each).__name__ if isinstance(each, outcomes.Outcome) else each for each in OUTCOMES if not callable(each)}
    assert {"last", "extremes", "mean", "crossing", "period", "lyapunov"} <= tried


@pytest.mark.parametrize("name", sw.sweeps.__all__)
def test_everything_public_has_an_example_that_runs(name: str) -> None:
    import doctest

    thing, told = getattr(sw.sweeps, name), []
    examples = doctest.DocTestParser().get_doctest(thing.__doc__ or "", {"sw": sw, "np": np}, name, None, None)
    assert examples.examples
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE, verbose=False)
    runner.run(examples, out=told.append)
    assert runner.failures == 0, "".join(told)


def test_a_function_alone_makes_the_run_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside reductions, which go piece by piece, its run is one more."""
    from stepwell.studies.sweeps import task

    made: list[int] = []
    original = task.integrate

    def counted(*args: Any, **options: Any) -> sw.Run:
        made.append(options["steps"])
        return original(*args, **options)

    monkeypatch.setattr(task, "integrate", counted)

    def end(run: sw.Run) -> Any:
        return run.y[-1]

    given: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 50, "threads": 1}
    alone = sw.sweep(Oscillator, {"omega": [1.0, 2.0]}, "rk4", outcomes=end, **given)
    assert made.count(50) == 1
    both = sw.sweep(Oscillator, {"omega": [1.0, 2.0]}, "rk4", outcomes=[end, "last"], **given)
    assert made.count(50) == 3
    np.testing.assert_array_equal(alone.end, both.y_last)
    np.testing.assert_array_equal(alone.status, both.status)
