"""``every=`` with a tolerance: the state at every so manieth accepted step of each member, the same however the run is made."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ShapeError
from stepwell.runs import kept_steps
from support.cases import SYSTEMS, fits

ABLE = [method.name for method in sw.methods() if method.error_order is not None]


def same(one: sw.Run, other: sw.Run) -> None:
    for name in ("t", "v", "y", "status"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for ours, theirs in zip(one.paces, other.paces, strict=True):  # type: ignore[arg-type]
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("method", ABLE)
@pytest.mark.parametrize("every", [1, 3])
def test_equal_the_reference(every: int, method: str) -> None:
    """Of members with steps of their own, forward and backward in time."""
    rng = np.random.default_rng(4)
    for name in ("free", "three bodies", "own: Duffing", "linear, masses"):
        system = SYSTEMS[name](rng, 5).uncontrolled
        if not fits(system, sw.method(method)):
            continue
        v, y = 0.3 * rng.normal(size=(*system.v_shape, 5)), rng.normal(size=(*system.y_shape, 5))
        for end in (0.4, -0.4):
            ask: dict[str, Any] = {"v": v, "y": y, "tolerance": 1e-5, "at": [end], "every": every, "max_steps": 500}
            same(*(sw.integrate(system, method, backend=backend, **ask) for backend in ("rust", "numpy")))


@pytest.mark.parametrize("method", ABLE)
@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_each_state_is_that_of_its_time(method: str, backend: str) -> None:
    """A run that is asked for the states at the times of its steps has the same ones, to the bit, and makes the same steps."""
    ask: dict[str, Any] = {"v": 0.0, "y": 2.0, "tolerance": 1e-6, "backend": backend}
    run = sw.integrate(sw.Pendulum(), method, at=[6.0], every=1, **ask)
    at_steps = sw.integrate(sw.Pendulum(), method, at=run.t, **ask)
    np.testing.assert_array_equal(run.y, at_steps.y)
    np.testing.assert_array_equal(run.v, at_steps.v)
    assert (np.diff(run.t) > 0.0).all()
    assert run.paces is not None
    assert len(run.t) == run.paces.accepted + 2  # the start, the steps, and the end within the step that is held
    np.testing.assert_array_equal(sw.integrate(sw.Pendulum(), method, at=[6.0], every=4, **ask).t[1:-1], run.t[4:-1:4])


def ensemble(**options: Any) -> sw.Run:
    omega = np.linspace(0.3, 4.0, 300)
    ask: dict[str, Any] = {"v": 0.0, "y": 2.5, "tolerance": 1e-5, "at": [5.0], "every": 2, "max_steps": 400}
    return sw.integrate(sw.Pendulum(omega), "merson", **ask | options)


def test_members_have_rows_of_their_own() -> None:
    """NaN where a member has made fewer steps than another; the start and the end stand in the first and the last row of all."""
    run, omega = ensemble(), np.linspace(0.3, 4.0, 300)
    assert run.paces is not None
    assert run.t.shape == run.y.shape == (2 + run.paces.accepted.max() // 2, 300)
    np.testing.assert_array_equal(run.t[[0, -1]], [[0.0] * 300, [5.0] * 300])
    for i in (0, 150, 299):
        alone = sw.integrate(sw.Pendulum(float(omega[i])), "merson", v=0.0, y=2.5, tolerance=1e-5, at=[5.0], every=2)
        there = np.isfinite(run.t[:, i])
        np.testing.assert_array_equal(run.t[there, i], alone.t)
        np.testing.assert_array_equal(run.y[there, i], alone.y)
        assert np.isnan(run.y[~there, i]).all()


def test_neither_threads_nor_room_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    run = ensemble(threads=1)
    same(run, ensemble(threads=2))
    monkeypatch.setattr(kept_steps, "NUMBERS_AT_ONCE", 3 * 300 * 2)  # two steps of each member at a time
    same(run, ensemble(threads=2))
    same(ensemble(at=[-5.0]), ensemble(at=[-5.0], backend="numpy"))


def test_room_for_states_without_velocities(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a member has more steps than there is room for at once."""
    ask: dict[str, Any] = {"y": np.array([[0.5, 2.0]]), "tolerance": 1e-6, "at": [3.0], "every": 1}
    growth = sw.LinearSystem([[0.7]], velocities=0)
    whole = sw.integrate(growth, "merson", **ask)
    monkeypatch.setattr(kept_steps, "NUMBERS_AT_ONCE", 12)
    np.testing.assert_array_equal(sw.integrate(growth, "merson", **ask).y, whole.y)


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


def test_large_members() -> None:
    y = np.sin(np.arange(3000.0))
    ask: dict[str, Any] = {"v": 0.0, "y": y, "tolerance": 1e-4, "at": [0.5], "every": 1, "max_steps": 100}
    same(*(sw.integrate(sw.Chain(3000), "merson", backend=backend, **ask) for backend in ("rust", "numpy")))


def test_a_jump_is_the_end_of_a_step() -> None:
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-5, "at": [2.0], "jumps": [0.7], "every": 1}
    one, other = (sw.integrate(sw.Oscillator(), "dop853", backend=backend, **ask) for backend in ("rust", "numpy"))
    same(one, other)
    assert np.abs(one.t - 0.7).min() < 1e-14


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_with_events(backend: str) -> None:
    """A member that stops has the steps before; where a state is changed, those of all parts; the event is the last state."""
    falls = sw.Event(lambda t, v, y: y, name="falls", direction=-1, terminal=True)
    free = sw.Oscillator(np.array([1.0, 2.0, 3.0]))
    ask: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-6, "at": [4.0], "every": 1, "max_steps": 500, "backend": backend}
    run, whole = sw.integrate(free, "merson", events=falls, **ask), sw.integrate(free, "merson", **ask)
    assert run.stopped_at is not None
    for i in range(3):
        before = whole.t[:, i] < run.stopped_at[i]
        np.testing.assert_array_equal(run.t[: before.sum(), i], whole.t[before, i])
        assert np.isnan(run.t[before.sum() : -1, i]).all()
        assert abs(run.y[-1, i]) < 1e-12
    ball = sw.Particles(gravity=1.0, dim=1)
    run = sw.integrate(
        ball,
        "merson",
        **ask | {"v": 0.0, "y": [[1.0]]},
        events=sw.Event(lambda t, v, y: y[0, 0], name="ground", direction=-1, then=lambda t, v, y: (-0.8 * v, y)),
    )
    there = np.isfinite(run.t)
    assert (np.diff(run.t[there]) > 0.0).all()
    assert (run.y[there] >= -1e-12).all()
    assert (run.v[there][:, 0, 0] > 0.0).any()  # it rises after a bounce


def test_what_is_asked_for_is_clear() -> None:
    with pytest.raises(ShapeError, match="at: with every= expected one time, that of the end, got 2"):
        sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-3, at=[1.0, 2.0], every=1)
    with pytest.raises(
        sw.errors.TooLargeError, match=r"up to max_steps = 1000000 steps of 1000000 members need .* a smaller max_steps="
    ):
        sw.integrate(sw.Oscillator(), "merson", v=0.0, y=np.ones(1_000_000), tolerance=1e-3, at=[1.0], every=1)


def test_recorded_energy_and_a_saved_run(tmp_path: Any) -> None:
    run = ensemble(record="energy")
    assert run.recorded["energy"].shape == run.t.shape
    run.save(tmp_path / "run.npz")
    again = sw.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.t, run.t)
    np.testing.assert_array_equal(again.y, run.y)
