"""Events of a world: those of a run of the same steps, call by call."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, UnsupportedError
from stepwell.runs.events import Occurrences
from stepwell.runs.events.frames import Frames


def crossing(t: Any, v: Any, y: Any) -> Any:
    return y - 0.1 * v - 0.05 * t


TWO = [crossing, sw.Event(lambda t, v, y, omega: v - 0.2 * omega, direction=1, most=3, name="speed")]
FIELDS = ("member", "step", "t", "v", "y")


def together(pieces: list[dict[str, Occurrences]], name: str) -> list[Any]:
    """What several calls found of an event, by member and then by time."""
    order = np.argsort(np.concatenate([each[name].member for each in pieces]), kind="stable")
    return [np.concatenate([getattr(each[name], field) for each in pieces])[order] for field in FIELDS]


def frames(world: sw.World, *steps: int) -> list[dict[str, Occurrences]]:
    """What each of these calls of ``step`` found."""
    occurrences = []
    for n in steps:
        world.step(n)
        occurrences.append(world.events)
    return occurrences


def start(batch: tuple[int, ...] = (6,), dtype: str = "float64") -> dict[str, Any]:
    return {"v": np.linspace(-0.5, 0.5, int(np.prod(batch))).reshape(batch).astype(dtype), "y": np.ones(batch, dtype)}


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("method", [m.name for m in sw.methods()])
@pytest.mark.parametrize("batch", [(), (6,), (3, 2)])
def test_equals_a_run(method: str, batch: tuple[int, ...], dtype: str) -> None:
    if dtype == "float32" and sw.method(method).has_series:
        return
    system, options = (
        sw.Pendulum(np.linspace(0.5, 2.0, int(np.prod(batch))).reshape(batch)),
        {"dt": 0.1, "t0": 0.4, "dtype": dtype},
    )
    run = sw.integrate(system, method, **start(batch), **options, steps=60, events=TWO)
    plain = sw.World(system, method, **start(batch, dtype), **options)
    world = sw.World(system, method, **start(batch, dtype), **options, events=TWO)
    pieces = frames(world, 20, 1, 0, 1, 18, 20)
    plain.step(60)
    assert (world.t, world.step_number) == (plain.t, 60)
    np.testing.assert_array_equal(world.y, plain.y)
    np.testing.assert_array_equal(world.v, plain.v)
    assert pieces[2]["crossing"].count.sum() == 0
    for name, occurrences in run.events.items():
        np.testing.assert_array_equal(sum(each[name].count for each in pieces), occurrences.count)
        for mine, field in zip(together(pieces, name), FIELDS, strict=True):
            np.testing.assert_array_equal(mine, getattr(occurrences, field))
    assert len(run.events["crossing"].t) > 0


def test_so_many_of_a_call_are_kept() -> None:
    world = sw.World(sw.Pendulum(3.0), "rk4", **start(()), dt=0.1, events=sw.Event(crossing, most=2))
    world.step(100)
    assert world.events["crossing"].count > len(world.events["crossing"].t) == 2


@pytest.mark.parametrize("method", ["rk4", "verlet"])
def test_what_is_written_between_calls_is_no_event_and_counts(method: str) -> None:
    """A kick that changes the sign of g is none of the motion; what comes after it is that of a run from there."""
    world = sw.World(sw.Pendulum(), method, **start(()), dt=0.1, events=crossing)
    world.step(3)
    assert world.events["crossing"].count == 0
    world.y[...] = -world.y
    run = sw.integrate(sw.Pendulum(), method, v=world.v, y=world.y, dt=0.1, start_step=3, steps=30, events=crossing)
    pieces = frames(world, 1, 29)
    assert pieces[0]["crossing"].count == 0
    np.testing.assert_array_equal(world.y, run.y[-1])
    assert run.events["crossing"].count > 0
    np.testing.assert_array_equal(pieces[1]["crossing"].t, run.events["crossing"].t)


@pytest.mark.parametrize("method", ["rk4", "pefrl"])
def test_a_force_that_changes(method: str) -> None:
    """Each call is a run with the force of that call."""
    force = np.zeros(6)
    world = sw.World(sw.Pendulum(), method, **start(), dt=0.1, force=force, events=crossing)
    total = 0
    for k in range(4):
        force[:] = 0.5 * (-1) ** k
        run = sw.integrate(sw.Pendulum(), method, dt=0.1, resume=world, steps=10, events=crossing)
        world.step(10)
        np.testing.assert_array_equal(world.y, run.y[-1])
        assert world.events["crossing"] == run.events["crossing"]
        total += len(world.events["crossing"].t)
    assert total > 0


def test_own_equations_and_first_order() -> None:
    @sw.system(order=1)
    def falling(t: Any, y: Any, *, rate: Any = 1.0) -> Any:
        return -rate * y

    half = sw.Event(lambda t, y: y - 0.5, name="half")
    rate = np.array([1.0, 2.0, 0.1])
    run = sw.integrate(falling(rate=rate), "rk4", y=np.ones(3), dt=0.01, steps=100, events=half)
    world = sw.World(falling(rate=rate), "rk4", y=np.ones(3), dt=0.01, events=half)
    pieces = frames(world, 50, 50)
    np.testing.assert_array_equal(together(pieces, "half")[2], run.events["half"].t)
    assert together(pieces, "half")[0].tolist() == [0, 1]
    # 1/2 is passed at ln 2/rate. With z = rate·h a step multiplies y by e⁻ᶻ + z⁵/120 − z⁶/720 + …, so ln y changes by −z times
    # 1 − z⁴/120·(1 + 5z/6 + …), and times are longer by at most z⁴/120·(1 + z).
    np.testing.assert_allclose(together(pieces, "half")[2], np.log(2.0) / rate[:2], rtol=0.02**4 / 120 * 1.02 + 1e-14)


def test_a_member_that_diverged_has_none() -> None:
    world = sw.World(sw.Oscillator([300.0, 1.0]), "standard_euler", **start((2,)), dt=0.1, events=lambda t, v, y: y)
    world.step(400)
    assert not np.isfinite(world.y[0])
    name = next(iter(world.events))
    world.step(40)
    assert world.events[name].count[0] == 0
    assert world.events[name].count[1] > 0


def test_copies_have_the_same_events() -> None:
    world = sw.World(sw.Pendulum(), "verlet", **start(), dt=0.1, events=TWO)
    world.step(7)
    others = [copy.copy(world), copy.deepcopy(world)]
    world.step(40)
    for other in others:
        other.step(40)
        assert other.events == world.events


def test_what_does_not_go() -> None:
    with pytest.raises(
        UnsupportedError, match=r"events: no event stops a member of a world, got Event\(crossing, terminal=True\)"
    ):
        sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1, events=[TWO[1], sw.Event(crossing, terminal=True)])
    small = {name: each.astype(np.float32) for name, each in start().items()}
    with pytest.raises(UnsupportedError, match="float32"):
        sw.World(sw.Pendulum(), "taylor", **small, dt=0.1, dtype="float32", events=crossing)
    with pytest.raises(DTypeError, match="events: expected functions"):
        sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1, events=[3.0])
    with pytest.raises(ArgumentError, match=r"expected a function \(t, v, y"):
        sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1, events=lambda t, y: y)
    world = sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1, events=crossing)
    with pytest.raises(ArgumentError, match="n: expected"):
        world.step(-1)
    assert sw.World(sw.Pendulum(), "rk4", **start(), dt=0.1).events == {}


@pytest.mark.mutant
def test_mistake_the_quantity_of_the_last_call_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    right, quantities = Frames._quantities, {}

    def wrong(self: Frames, step: int) -> Any:
        return quantities.setdefault((id(self), step), right(self, step))

    monkeypatch.setattr(Frames, "_quantities", wrong)
    with pytest.raises(AssertionError):
        test_what_is_written_between_calls_is_no_event_and_counts("rk4")


@pytest.mark.mutant
def test_mistake_the_force_of_the_first_call_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    from stepwell.runs.events import frames as module

    first: list[Any] = []

    def wrong(plan: Any) -> Any:
        first.append(plan._replace(force=np.zeros(6)))
        return right(first[0])

    right = module.Members
    monkeypatch.setattr(module, "Members", wrong)
    with pytest.raises(AssertionError):
        test_a_force_that_changes("rk4")
