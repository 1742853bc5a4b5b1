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

METHODS = [m.name for m in sw.methods()]


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
    going_on = sw.integrate(chain(), "merson", v=0.0, y=0.0, tolerance=1e-3, at=[1.0]).resume
    with pytest.raises(ArgumentError, match=f"carry: expected that of a run by merson, got one by {method}"):
        sw.integrate(chain(), "merson", at=[2.0], **(going_on | {"carried_by": method}))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("way", ["at once", "file of arrays", "pickle"])
def test_the_step_need_not_be_given_again(method: str, way: str) -> None:
    whole, half = piece(method, 800, start="first_order" if method == "verlet" else None), None
    state: Any = piece(method, 400, start="first_order" if method == "verlet" else None).resume
    if way == "file of arrays":
        state = filed(state)
    elif way == "pickle":
        state = pickle.loads(pickle.dumps(state))
    half = piece(method, 400, **state)
    for name in ("v", "y", "t", "first_bad_step"):
        np.testing.assert_array_equal(getattr(half, name), getattr(whole, name))
    again = piece(method, 400, dt=0.1, **state)
    np.testing.assert_array_equal(again.y, whole.y)


def filed(state: dict[str, Any], *, pickles: bool = False) -> Any:
    """Written to a file of arrays, and read."""
    np.savez(file := io.BytesIO(), **state)
    file.seek(0)
    return np.load(file, allow_pickle=pickles)


@pytest.mark.parametrize("method", [m.name for m in sw.methods() if m.error_order is not None])
@pytest.mark.parametrize("members", [(), (3,)])
@pytest.mark.parametrize("fused", [False, True])
def test_adaptive_steps_go_on_from_a_file_of_arrays(method: str, members: tuple[int, ...], fused: bool) -> None:
    """The state of the step-size controller was an object, which such a file does not hold."""
    start: dict[str, Any] = {"v": np.full(members, 0.1), "y": 1.0, "tolerance": 1e-5, "fused": fused}
    whole = sw.integrate(sw.Pendulum(), method, at=[1.0, 2.0, 3.0], **start)
    first = sw.integrate(sw.Pendulum(), method, at=[1.0, 2.0], **start)
    rest = sw.integrate(sw.Pendulum(), method, at=[3.0], **filed(first.resume))
    assert rest.paces is not None
    assert whole.paces is not None
    np.testing.assert_array_equal(rest.y[-1], whole.y[-1])
    np.testing.assert_array_equal(rest.v[-1], whole.v[-1])
    np.testing.assert_array_equal(rest.paces.accepted, whole.paces.accepted)
    with pytest.raises(ArgumentError, match="at: expected times that ascend from the last time of the run that goes on, 2, on"):
        sw.integrate(sw.Pendulum(), method, at=[1.5], **filed(first.resume))


@pytest.mark.parametrize("control", [sw.EnergyControl(relative=0.1), sw.Projection("scaling")])
def test_a_control_goes_on_from_a_file_of_arrays(control: Any) -> None:
    scene = sw.scenes.figure_eight()
    whole = scene.run("rk4", steps=40, control=control)
    first = scene.run("rk4", steps=20, control=control)
    rest = sw.integrate(scene.system, "rk4", steps=20, **filed(first.resume, pickles=True))
    np.testing.assert_array_equal(rest.y[-1], whole.y[-1])


def test_a_bad_step_beyond_the_run() -> None:
    match = re.escape("first_bad_step: expected steps before the run, up to start_step = 5, or −1, got ")
    for wrong in (6, 10**9, -2):
        with pytest.raises(ArgumentError, match=match + str(wrong)):
            sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10, start_step=5, first_bad_step=wrong)
    for right in (-1, 0, 5):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10, start_step=5, first_bad_step=right)
