"""The chart of a quaternion's norm under control: its numbers against closed forms, its files, its picture, what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.views.charts import norm
from support.charted import drawn, files_of
from support.for_each import for_each
from support.refusals import refused

GAINS = (0.05, 0.3, 0.9)


@for_each("phi", [0.05, 0.3])
def test_standard_euler_by_its_formulas(phi: float) -> None:
    """Resetting turns by atan Φ, control by asin Φ at a norm of 1 + (1 − √(1 − Φ²))/(hk); alone the norm grows by Φ²."""
    line = norm(["standard_euler"], phi=phi, gains=GAINS).lines[0]
    assert line.growth == pytest.approx(phi**2, rel=1e-13)
    assert line.angle_error_reset == pytest.approx(math.atan(phi) / phi - 1, abs=1e-14)
    np.testing.assert_allclose(line.angle_error, math.asin(phi) / phi - 1, rtol=0, atol=1e-13)
    np.testing.assert_allclose(line.norm_error, (1 - math.sqrt(1 - phi**2)) / np.array(GAINS), rtol=0, atol=1e-13)


def test_the_others_by_their_first_orders_and_gains_that_are_too_large() -> None:
    """Heun +Φ²/6 with either, and a norm of −Φ²/(2(1 − hk)); RK4 −Φ⁴/120 where it is reset."""
    phi = 0.02
    chart = norm(["standard_heun", "rk4"], phi=phi, gains=(0.1, 0.5))
    heun, rk4 = chart.lines
    assert heun.angle_error_reset == pytest.approx(phi**2 / 6, rel=phi**2)
    np.testing.assert_allclose(heun.angle_error, phi**2 / 6, rtol=4 * phi**2)
    np.testing.assert_allclose(heun.norm_error, [-(phi**2) / 1.8, -(phi**2)], rtol=10 * phi**2)
    assert rk4.angle_error_reset == pytest.approx(-(phi**4) / 120, rel=phi**2)
    assert heun.growth == pytest.approx(phi**4 / 4, rel=1e-6)
    # The limit of Standard Euler at Φ = 0.1 is 1 + Φ⁴/4.
    line = norm(["standard_euler"], gains=(0.5, 0.98, 1.02, 1.3)).lines[0]
    assert np.isfinite(line.norm_error).tolist() == [True, True, False, False]
    assert line.largest_gain == 0.98
    nothing = norm(["standard_euler"], gains=[1.5])
    assert math.isnan(nothing.lines[0].largest_gain)
    assert math.isnan(nothing.summary()[0]["at_gain"])
    nothing.plot()


def test_files_and_picture(tmp_path: Path) -> None:
    shares: list[float] = []
    chart = norm(gains=np.geomspace(0.02, 0.9, 9), progress=shares.append)
    assert shares[-1] == 1.0
    rows, written = files_of(chart, tmp_path)
    assert len(rows) == len(chart.rows()) == 27
    assert [float(row["angle_error"]) for row in rows if row["method"] == "rk4"] == chart.lines[2].angle_error.tolist()
    assert written["summary"] == chart.summary()
    assert [row["method"] for row in written["summary"]] == ["standard_euler", "standard_heun", "rk4"]
    left, right = drawn(chart, tmp_path).axes
    assert [axes.get_xlabel() for axes in (left, right)] == ["gain h·k, without a unit"] * 2
    named = [text.get_text() for text in left.texts]
    assert any(text.startswith("Standard Euler (reset: −0.33 %)") for text in named)
    # Of the lines, that of Standard Euler lies at a half: Φ²/6 against Φ²/3.
    halves = next(line.get_ydata() for line in left.lines if len(line.get_ydata()) == 9)
    np.testing.assert_allclose(halves, 0.5, rtol=0.02)


def test_what_cannot_be_is_refused() -> None:
    refused(UnsupportedError, "second-order", norm, ["verlet"])
    refused(ArgumentError, r"phi: expected an angle above 0 and below 1 rad, got 1\.5", norm, phi=1.5)
    refused(ArgumentError, "gains", norm, gains=[])
    refused(ArgumentError, "gains", norm, gains=[-0.1])
    assert sw.charts.norm is norm
