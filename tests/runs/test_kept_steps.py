"""``every=`` with a tolerance: the state at every so manieth accepted step of each member, the same however the run is made."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ShapeError, TooLargeError
from stepwell.runs import kept_steps
from support.ways import assert_equal_ways, assert_same_run

ABLE = [method.name for method in sw.methods() if method.error_order is not None]


@pytest.mark.parametrize("method", ABLE)
def test_each_state_is_that_of_its_time(method: str) -> None:
    """A run that is asked for the states at the times of its steps has the same ones, to the bit, and makes the same steps."""
    ask: dict[str, Any] = {"v": 0.0, "y": 2.0, "tolerance": 1e-6}
    run = sw.integrate(sw.Pendulum(), method, at=[6.0], every=1, **ask)
    at_steps = sw.integrate(sw.Pendulum(), method, at=run.t, **ask)
    np.testing.assert_array_equal(run.y, at_steps.y)
    np.testing.assert_array_equal(run.v, at_steps.v)
    assert (np.diff(run.t) > 0.0).all()
    assert len(run.t) == run.paces.accepted + 2  # the start, the steps, and the end within the step that is held
    np.testing.assert_array_equal(sw.integrate(sw.Pendulum(), method, at=[6.0], every=4, **ask).t[1:-1], run.t[4:-1:4])


def ensemble(**options: Any) -> sw.Run:
    omega = np.linspace(0.3, 4.0, 300)
    ask: dict[str, Any] = {"v": 0.0, "y": 2.5, "tolerance": 1e-5, "at": [5.0], "every": 2, "max_steps": 400}
    return sw.integrate(sw.Pendulum(omega), "merson", **ask | options)


def test_members_have_rows_of_their_own() -> None:
    """NaN where a member has made fewer steps than another; the start and the end stand in the first and the last row of all."""
    run, omega = ensemble(), np.linspace(0.3, 4.0, 300)
    assert run.t.shape == run.y.shape == (2 + run.paces.accepted.max() // 2, 300)
    np.testing.assert_array_equal(run.t[[0, -1]], [[0.0] * 300, [5.0] * 300])
    for i in (0, 150, 299):
        alone = sw.integrate(sw.Pendulum(float(omega[i])), "merson", v=0.0, y=2.5, tolerance=1e-5, at=[5.0], every=2)
        there = np.isfinite(run.t[:, i])
        np.testing.assert_array_equal(run.t[there, i], alone.t)
        np.testing.assert_array_equal(run.y[there, i], alone.y)
        assert np.isnan(run.y[~there, i]).all()


def test_room_does_not_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a member has more steps than there is room for at once, also of states without velocities."""
    ask: dict[str, Any] = {"y": np.array([[0.5, 2.0]]), "tolerance": 1e-6, "at": [3.0], "every": 1}
    growth = sw.LinearSystem([[0.7]], velocities=0)
    whole = ensemble(threads=1), sw.integrate(growth, "merson", **ask)
    for run, numbers in ((lambda: ensemble(threads=2), 3 * 300 * 2), (lambda: sw.integrate(growth, "merson", **ask), 12)):
        monkeypatch.setattr(kept_steps, "NUMBERS_AT_ONCE", numbers)  # two steps of each member at a time
        assert_same_run(run(), whole[numbers == 12])


def test_pieces_make_the_whole() -> None:
    """The steps count from the start of the first piece, and a piece begins with the state at its start."""
    whole, first = ensemble(), ensemble(at=[2.0])
    rest = sw.integrate(sw.Pendulum(np.linspace(0.3, 4.0, 300)), "merson", at=[5.0], every=2, max_steps=400, resume=first)
    for i in (0, 299):
        (t, y), (t1, y1), (t2, y2) = (
            [each[np.isfinite(run.t[:, i]), i] for each in (run.t, run.y)] for run in (whole, first, rest)
        )
        assert t1[-1] == t2[0] == 2.0
        np.testing.assert_array_equal(np.concatenate([t1[:-1], t2[1:]]), t)
        np.testing.assert_array_equal(np.concatenate([y1[:-1], y2[1:]]), y)


def test_large_members_and_jumps_are_the_same_by_the_reference() -> None:
    """A jump is the end of a step."""
    large = {"v": np.zeros((300, 1)), "y": np.sin(np.arange(300.0))[:, np.newaxis], "max_steps": 100}
    assert_equal_ways(sw.Chain(300), "merson", ways=("by the reference",), tolerance=1e-4, at=[0.5], every=1, **large)
    jumps: dict[str, Any] = {"v": np.zeros(2), "y": np.ones(2), "at": [2.0], "jumps": [0.7]}
    run = assert_equal_ways(sw.Oscillator(), "merson", ways=("by the reference", "alone"), tolerance=1e-5, every=1, **jumps)
    assert np.abs(run.t - 0.7).min() < 1e-14


def test_with_events() -> None:
    """A member that stops has the steps before; where a state is changed, those of all parts; the event is the last state."""
    falls = sw.Event(lambda t, v, y: y, name="falls", direction=-1, terminal=True)
    free = sw.Oscillator(np.array([1.0, 2.0, 3.0]))
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-6, "at": [4.0], "every": 1, "max_steps": 500}
    run, whole = sw.integrate(free, "merson", events=falls, **ask), sw.integrate(free, "merson", **ask)
    for i in range(3):
        before = whole.t[:, i] < run.stopped_at[i]
        np.testing.assert_array_equal(run.t[: before.sum(), i], whole.t[before, i])
        assert np.isnan(run.t[before.sum() : -1, i]).all()
        assert abs(run.y[-1, i]) < 1e-12
    bounce = sw.Event(lambda t, v, y: y[0, 0], name="ground", direction=-1, then=lambda t, v, y: (-0.8 * v, y))
    run = sw.integrate(sw.Particles(gravity=1.0, dim=1), "merson", **ask | {"v": 0.0, "y": [[1.0]]}, events=bounce)
    there = np.isfinite(run.t)
    assert (np.diff(run.t[there]) > 0.0).all()
    assert (run.y[there] >= -1e-12).all()
    assert (run.v[there][:, 0, 0] > 0.0).any()  # it rises after a bounce


def test_what_is_asked_for_is_clear() -> None:
    with pytest.raises(ShapeError, match="at: with every= expected one time, that of the end, got 2"):
        sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-3, at=[1.0, 2.0], every=1)
    words = r"up to max_steps = 1000000 steps of 1000000 members need .* a smaller max_steps="
    with pytest.raises(TooLargeError, match=words):
        sw.integrate(sw.Oscillator(), "merson", v=0.0, y=np.ones(1_000_000), tolerance=1e-3, at=[1.0], every=1)
