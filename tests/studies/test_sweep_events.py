"""Sweeps with events: how often, when first, when a member stopped; in any chunks and processes, from a store."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.sweeping import Pickling

pytest.importorskip("xarray")

GRAVITY = 9.81


@sw.system
def ball(t: Any, v: Any, y: Any, *, restitution: Any = 0.8) -> Any:
    return -GRAVITY + 0.0 * y


GROUND = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y, *, restitution: (-restitution * v, y), name="ground")
TOP = sw.Event(lambda t, v, y: v, direction=-1, name="top")
E, HEIGHT = np.linspace(0.5, 0.9, 9), np.array([0.5, 1.0, 2.0])
AXES = {"restitution": ("e", E), "y": ("height", HEIGHT)}
STEPS: list[dict[str, Any]] = [{"dt": 0.01, "steps": 300}, {"tolerance": 1e-9, "at": np.linspace(0.0, 3.0, 7)}]


@pytest.mark.parametrize("steps", STEPS, ids=["fixed", "tolerance"])
def test_counts_and_times_are_those_of_a_closed_form(steps: dict[str, Any]) -> None:
    """Bounce k is after fall·(1 + 2·(e + … + e^(k−1))); members whose series ends before t = 3 rest from there on."""
    dataset = sw.sweep(ball, AXES, "dop853", v=0.0, events=[GROUND, TOP], outcomes=["last", "extremes"], **steps)
    fall = np.sqrt(2.0 * HEIGHT / GRAVITY)
    np.testing.assert_allclose(dataset.ground_t, np.broadcast_to(fall, (9, 3)), rtol=1e-12)
    np.testing.assert_allclose(dataset.top_t, fall * (1.0 + E[:, np.newaxis]), rtol=1e-12)
    ends = fall * ((1.0 + E) / (1.0 - E))[:, np.newaxis]
    rests = ends < 3.0
    np.testing.assert_allclose(dataset.stopped_at, np.where(rests, ends, np.nan), rtol=1e-9)
    np.testing.assert_array_equal(dataset.status, np.where(rests, int(sw.Status.REST), 0))
    k = np.arange(200)
    bounces = fall[:, np.newaxis] * (1.0 + 2.0 * np.cumsum(np.where(k > 0, E[:, np.newaxis, np.newaxis] ** k, 0.0), axis=-1))
    counts = (bounces < 3.0).sum(axis=-1)
    np.testing.assert_array_equal(dataset.ground_count.values[~rests], counts[~rests])
    assert (dataset.ground_count.values[rests] > 5).all()
    assert (dataset.y_min > -1e-12).all()


@pytest.mark.parametrize("steps", STEPS, ids=["fixed", "tolerance"])
def test_chunks_processes_and_stores_have_the_same_bits(steps: dict[str, Any], tmp_path: Path) -> None:
    axes = AXES | {"restitution": ("e", E[:3])}  # 9 members, which neither 4 nor 5 divide

    def bits(**options: Any) -> str:
        outcomes = ["last", "mean", "history"] if "at" in steps else ["last", "mean"]
        dataset = sw.sweep(ball, axes, "merson", v=0.0, events=[GROUND, TOP], outcomes=outcomes, **steps, **options)
        return str(dataset.attrs["bits"])

    expected = bits()
    assert (bits(chunk=4, threads=2), bits(chunk=5, store=tmp_path / "sweep.zarr")) == (expected, expected)
    assert bits(chunk=5, engine=Pickling()) == expected


def test_what_does_not_go_is_refused_in_words(tmp_path: Path) -> None:
    """A store is not gone on with if an event has other instructions."""
    options: dict[str, Any] = {"v": 0.0, "dt": 0.01, "steps": 100, "store": tmp_path / "sweep.zarr"}
    sw.sweep(ball, AXES, "rk4", events=GROUND, **options)
    other = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-0.5 * v, y), name="ground")
    with pytest.raises(sw.errors.ArgumentError, match="store"):
        sw.sweep(ball, AXES, "rk4", events=other, **options)
    fixed: dict[str, Any] = {"v": 0.0, "dt": 0.01, "steps": 10}
    with pytest.raises(sw.errors.UnsupportedError, match="transient: goes without events="):
        sw.sweep(ball, AXES, "rk4", events=GROUND, transient=10, **fixed)
    with pytest.raises(sw.errors.UnsupportedError, match="outcomes: 'lyapunov' goes without events="):
        sw.sweep(ball, AXES, "rk4", events=GROUND, outcomes="lyapunov", **fixed)
    with pytest.raises(sw.errors.ArgumentError, match="events: expected names that results can have, got '<lambda>'"):
        sw.sweep(ball, AXES, "rk4", events=lambda t, v, y: y, **fixed)


def test_a_function_sees_the_events_of_its_run_and_status_tells_who_was_stopped() -> None:
    def second(run: sw.Run) -> Any:
        return np.array([run.events["ground"].of(i).t[1] for i in range(run.status.size)])

    dataset = sw.sweep(ball, AXES, "rk4", v=0.0, dt=0.01, steps=300, events=GROUND, outcomes=second)
    fall = np.sqrt(2.0 * HEIGHT / GRAVITY)
    np.testing.assert_allclose(dataset.second, fall * (1.0 + 2.0 * E[:, np.newaxis]), rtol=1e-12)
    # And those that diverge with one.
    stop = sw.Event(lambda t, v, y: y, direction=-1, terminal=True, name="ground")
    dataset = sw.sweep(ball, AXES, "rk4", v=0.0, dt=0.01, steps=300, events=stop)
    assert (dataset.status == int(sw.Status.EVENT)).all()
    np.testing.assert_allclose(dataset.stopped_at, np.broadcast_to(np.sqrt(2.0 * HEIGHT / GRAVITY), (9, 3)), rtol=1e-12)
