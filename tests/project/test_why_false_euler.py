"""What docs/theory/why_false_euler_works.md states, beyond what its code prints."""

from __future__ import annotations

import importlib.util
import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from PIL import Image
from support import ROOT

DOCS = ROOT / "docs"
PHI = 0.5


def run_of(method: str, phi: float = PHI, steps: int = 20_000) -> Any:
    return sw.integrate(sw.Oscillator(), method, v=0.0, y=1.0, dt=phi, steps=steps, every=1)


def test_areas_stay_by_false_euler_and_swell_by_standard_euler() -> None:
    assert float(np.linalg.det(sw.analyse(sw.Oscillator(), "false_euler", dt=PHI).P)) == pytest.approx(1.0, abs=1e-15)
    assert float(np.linalg.det(sw.analyse(sw.Oscillator(), "standard_euler", dt=PHI).P)) == pytest.approx(1.0 + PHI**2)
    run = run_of("standard_euler", steps=10)
    assert run.v**2 + run.y**2 == pytest.approx((1.0 + PHI**2) ** np.arange(11))


def test_the_half_axes_bound_the_energy() -> None:
    """From Q = 1: v² + y² reaches both squares of the half axes, to the distance of some thousand states on the ellipse."""
    run = run_of("false_euler")
    square = run.v**2 + run.y**2
    assert (square.min(), square.max()) == pytest.approx((1.0 / (1.0 + PHI / 2), 1.0 / (1.0 - PHI / 2)), rel=1e-5)
    assert float(sw.stability_limit(sw.Oscillator(), "false_euler")) == pytest.approx(2.0, rel=1e-12)


def test_the_neighbour_swings_faster() -> None:
    for method in ("false_euler", "leapfrog"):
        for phi in (0.1, 0.5, 1.5):
            turn = float(sw.analyse(sw.Oscillator(), method, dt=phi).angle)
            assert 2.0 * math.sin(turn / 2.0) == pytest.approx(phi, rel=1e-12)
        turn = float(sw.analyse(sw.Oscillator(), method, dt=0.01).angle)
        assert turn / 0.01 - 1.0 == pytest.approx(0.01**2 / 24.0, rel=1e-4)


def test_leapfrog_is_off_by_a_part_of_the_square() -> None:
    for phi in (0.05, 0.1):
        run = run_of("leapfrog", phi)
        assert np.ptp(run.v**2 + run.y**2) == pytest.approx(phi**2 / 4.0, rel=1e-3)
        other = run_of("false_euler", phi)
        assert np.ptp(other.v**2 + other.y**2) == pytest.approx(phi, rel=0.01)


def test_leapfrog_is_false_euler_half_a_kick_later() -> None:
    kick = 0.5 * PHI
    one, other = run_of("leapfrog", steps=100), run_of("false_euler", steps=100)
    # Half a kick on, leapfrog has the velocity with which False Euler came to the same place, if both begin so.
    begun = sw.integrate(sw.Oscillator(), "false_euler", v=kick, y=1.0, dt=PHI, steps=100, every=1)
    assert one.y == pytest.approx(begun.y, abs=1e-12)
    assert one.v + kick * one.y == pytest.approx(begun.v, abs=1e-12)
    assert np.abs(one.y - other.y).max() > 0.1


def test_runge_kutta_loses_a_share_in_each_step() -> None:
    radius = float(sw.analyse(sw.Oscillator(), "rk4", dt=0.1).radius)
    assert 1.0 - radius**2 == pytest.approx(0.1**6 / 72.0, rel=1e-2)


def test_the_picture_is_that_of_its_script() -> None:
    pytest.importorskip("matplotlib")
    spec = importlib.util.spec_from_file_location("false_euler_picture", DOCS / "false_euler_picture.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    figure = script.draw()  # its assertions: areas, and states on their ellipses
    size = figure.get_size_inches() * figure.dpi
    with Image.open(script.PICTURE) as picture:
        assert picture.size == tuple(int(each) for each in size)
