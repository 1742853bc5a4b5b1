"""A run in pieces: what ``resume`` carries, and what is refused."""

from __future__ import annotations

import io
import pickle
import re
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError

METHODS = ("verlet", "leapfrog", "false_euler")


def chain() -> sw.Chain:
    return sw.Chain(4, stiffness=np.array([1.0, 1e3])[np.newaxis] * np.ones((5, 1)))  # the second member diverges


def piece(method: str, steps: int, **options: Any) -> sw.Run:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        start = {} if "v" in options else {"v": 1.0, "y": np.ones((4, 2)), "dt": 0.1}
        return sw.integrate(chain(), method, steps=steps, **start, **options)


@pytest.mark.parametrize("method", METHODS)
def test_another_step_is_refused(method: str) -> None:
    half = piece(method, 400)
    for dt in (0.2, np.nextafter(0.1, 1.0)):
        match = re.escape("dt: expected the step of the run that goes on, dt_before = 0.1, got 0.")
        with pytest.raises(ArgumentError, match=match):
            piece(method, 400, dt=dt, **half.resume)
    anew = piece(method, 1, v=half.v[-1], y=half.y[-1], t0=half.t[-1], dt=0.2, first_bad_step=np.minimum(half.first_bad_step, 0))
    assert anew.t == pytest.approx(40.2)


@pytest.mark.parametrize(("method", "other"), [("verlet", "leapfrog"), ("leapfrog", "verlet"), ("verlet", "rk4")])
def test_what_one_method_carries_is_not_for_another(method: str, other: str) -> None:
    """Leapfrog took Verlet's last y for its v half a step on, without a word."""
    half = piece(method, 10)
    with pytest.raises(ArgumentError, match=f"method: expected '{method}', by which the run goes on"):
        piece(other, 10, **half.resume)
    with pytest.raises(ArgumentError, match="carried_by: goes with fixed steps only"):
        sw.integrate(chain(), "merson", v=0.0, y=0.0, tolerance=1e-3, at=[1.0], carried_by=method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("way", ["at once", "file of arrays", "pickle"])
def test_the_step_need_not_be_given_again(method: str, way: str) -> None:
    whole, half = piece(method, 800, start="first_order" if method == "verlet" else None), None
    state: Any = piece(method, 400, start="first_order" if method == "verlet" else None).resume
    if way == "file of arrays":
        np.savez(file := io.BytesIO(), **state)
        file.seek(0)
        state = np.load(file)
    elif way == "pickle":
        state = pickle.loads(pickle.dumps(state))
    half = piece(method, 400, **state)
    for name in ("v", "y", "t", "first_bad_step"):
        np.testing.assert_array_equal(getattr(half, name), getattr(whole, name))
    again = piece(method, 400, dt=0.1, **state)
    np.testing.assert_array_equal(again.y, whole.y)


def test_a_bad_step_beyond_the_run() -> None:
    match = re.escape("first_bad_step: expected steps before the run, up to start_step = 5, or −1, got ")
    for wrong in (6, 10**9, -2):
        with pytest.raises(ArgumentError, match=match + str(wrong)):
            sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10, start_step=5, first_bad_step=wrong)
    for right in (-1, 0, 5):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10, start_step=5, first_bad_step=right)
