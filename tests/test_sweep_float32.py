"""Sweeps in float32: the bits of ``integrate``, whatever the division, and what is found of states computed in float64."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, UnsupportedError
from support.sweeping import AXES, OUTCOMES, duffing, ends, power, small, unlike

F = np.float32
#: Those that go with float32.
ABLE = tuple(each for each in OUTCOMES if each != "lyapunov")
STATE: dict[str, Any] = {"v": 0.0, "dt": 0.05, "steps": 80}


def run_of(every: int | None = None, **options: Any) -> sw.Run:
    """The members of ``small``, in one run."""
    gamma, y = (values for _, values in AXES.values())
    return sw.integrate(
        duffing(delta=0.2, gamma=gamma[:, None]), "rk4", y=y, every=every, **STATE, **({"dtype": "float32"} | options)
    )


def test_states_are_those_of_integrate() -> None:
    found = small(dtype="float32", outcomes="history", every=8, transient=0)
    run = run_of(8)
    assert found.y.dtype == found.v.dtype == F
    np.testing.assert_array_equal(np.moveaxis(found.y.values, -1, 0), run.y)
    np.testing.assert_array_equal(np.moveaxis(found.v.values, -1, 0), run.v)
    np.testing.assert_array_equal(found.t, run.t)
    assert found.attrs["dtype"] == "float32"
    wide = small(outcomes="history", every=8, transient=0)
    assert wide.y.dtype == np.float64
    assert "dtype" not in wide.attrs
    # Further apart than one rounding: so they were not only rounded when they were saved.
    assert (found.y.values != wide.y.values.astype(F)).mean() > 0.5


def test_the_division_into_chunks_does_not_matter() -> None:
    whole = small(dtype="float32", outcomes=ABLE)
    for options in ({"chunk": 7}, {"chunk": 1, "threads": 1}, {"memory": 40_000}):
        assert unlike(whole, small(dtype=F, outcomes=ABLE, **options)) == []  # type: ignore[arg-type]
    assert whole.attrs["bits"] != small(outcomes=ABLE).attrs["bits"]


def mean_of(t: Any, values: Any) -> Any:
    """The trapezoidal rule, state after state."""
    total = np.zeros(values.shape[1:], values.dtype)
    for k in range(1, len(t)):
        total += 0.5 * (t[k] - t[k - 1]) * (values[k - 1] + values[k])
    return total / (t[-1] - t[0])


def test_what_is_found_of_states_is_computed_in_float64() -> None:
    outcomes = ["mean", "extremes", sw.sweeps.Mean(power), sw.sweeps.Extremes("energy"), ends]
    found = small(dtype="float32", outcomes=outcomes, transient=0)
    run = run_of(1)
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


def test_a_passage_is_found_between_the_states() -> None:
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


def test_each_of_several_steps_is_rounded() -> None:
    axes = {"dt": [0.1, 0.3], "y": ("y0", [1.0, 2.0])}
    found = sw.sweep(sw.Oscillator(), axes, "rk4", v=0.0, steps=20, every=5, dtype="float32")
    for i, dt in enumerate((0.1, 0.3)):
        run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=[1.0, 2.0], dt=dt, steps=20, every=5, dtype="float32")
        np.testing.assert_array_equal(found.t[i], run.t)
        np.testing.assert_array_equal(found.y[i].T, run.y)
        assert run.t[-1] != 20 * dt


def test_a_store_holds_float32_and_goes_on_with_no_other(tmp_path: Any) -> None:
    store = tmp_path / "sweep.zarr"
    given: dict[str, Any] = {"outcomes": ABLE[:-1], "chunk": 9}
    found = small(dtype="float32", store=store, **given)
    assert found.y_last.dtype == F
    assert unlike(found.compute(), small(dtype="float32", **given)) == []
    assert unlike(small(dtype="float32", store=store, **given).compute(), found.compute()) == []
    with pytest.raises(ArgumentError, match="is of another sweep and is not continued"):
        small(store=store, **given)


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
def test_what_does_not_go_is_said_before_any_work(options: dict[str, Any], error: type[Exception], said: str) -> None:
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
