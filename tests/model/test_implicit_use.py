"""Implicit methods go where the others go: events, sweeps, controls, surfaces, large systems."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.for_each import for_each
from support.ways import assert_equal_ways

IMPLICIT = [m.name for m in sw.methods() if m.is_implicit]
ABLE = [name for name in IMPLICIT if sw.method(name).error_order is not None]
WAYS = [*((name, "fixed") for name in IMPLICIT), *((name, "adaptive") for name in ABLE)]


@sw.system
def van_der_pol(t: Any, v: Any, y: Any, mu: Any = 50.0) -> Any:
    return mu * (1.0 - y * y) * v - y


def until(way: str, end: float) -> dict[str, Any]:
    """A run to a time, by fixed or by adaptive steps."""
    return {"dt": 0.02, "steps": round(end / 0.02)} if way == "fixed" else {"tolerance": 1e-5, "at": [end]}


@for_each("method, way", WAYS)
def test_events_act_and_stop(method: str, way: str) -> None:
    """Of the true motion: the first time at which y falls to 1, and again from where an event puts it."""
    fall = sw.Event(lambda t, v, y: y - 1.0, name="fall", then=lambda t, v, y: (v, y + 1.0))
    stop = sw.Event(lambda t, v, y: y - 1.0, name="fall", terminal=True)
    system, start = van_der_pol(mu=5.0), {"v": 0.0, "y": 2.0}
    fine = {"tolerance": 1e-12, "at": [9.0]}
    (first, second) = sw.integrate(system, "dop853", **start, events=fall, **fine).events["fall"].t[:2]
    run = sw.integrate(system, method, **start, events=fall, **until(way, 9.0))
    near = 0.02 if "euler" in method else 2e-3
    assert run.events["fall"].t[:2] == pytest.approx([first, second], rel=near)
    stopped = sw.integrate(system, method, **start, events=stop, **until(way, 9.0))
    assert stopped.status == sw.Status.EVENT
    assert float(stopped.stopped_at) == run.events["fall"].t[0]  # type: ignore[arg-type]


@pytest.mark.parametrize(("method", "way"), [("backward_euler", "fixed"), ("rodas4", "adaptive")])
def test_a_sweep_has_the_bits_of_a_run(method: str, way: str, tmp_path: Any) -> None:
    """In chunks, too; and with a store, which is complete at the second call."""
    mu = np.linspace(1.0, 100.0, 10)
    run = sw.integrate(van_der_pol(mu=mu), method, v=0.0, y=np.full(10, 2.0), **until(way, 0.5))
    stored = {"chunk": 5, "store": tmp_path / "a.zarr"}
    for options in ({}, {"chunk": 3}, stored, stored):
        with sw.sweep(van_der_pol, {"mu": mu}, method, v=0.0, y=2.0, outcomes="last", **until(way, 0.5), **options) as swept:
            assert np.array_equal(swept.y_last, run.y[-1])
            assert np.array_equal(swept.v_last, run.v[-1])


@for_each("method", IMPLICIT)
def test_what_is_around_a_system_is_in_its_jacobian(method: str) -> None:
    """A strong drag, a force and a spring to a floor: steps that no explicit method bears stay near the true motion."""
    drag = sw.system(lambda t, v, y: -1e4 * v)()
    run = sw.integrate(drag, method, v=1.0, y=0.0, force=1.0, dt=0.1, steps=100)
    if sw.stability.function(method).l_stable:
        assert float(run.v[-1]) == pytest.approx(1e-4, rel=1e-6)  # where the drag carries the force
    else:
        assert abs(float(run.v[-1])) < 1.0  # it changes its sign at each step
    with pytest.warns(sw.DivergenceWarning):
        sw.integrate(drag, "rk4", v=1.0, y=0.0, force=1.0, dt=0.1, steps=100)
    block = sw.Oscillator(1.0, friction=0.2, form="physical")
    ends = [sw.integrate(block, name, v=0.0, y=1.0, dt=0.01, steps=1000) for name in (method, "rk4")]
    assert float(ends[0].y[-1]) == pytest.approx(float(ends[1].y[-1]), abs=0.02)
    layout = np.stack([np.arange(3.0) * 0.5, np.zeros(3), np.ones(3)], axis=1)
    net = sw.Springs(
        [(0, 1), (1, 2)], stiffness=1e4, layout=layout, masses=0.1, gravity=(0, 0, -9.81), damping=0.5, floor=sw.Floor()
    )
    fallen = sw.integrate(net, method, v=0.0, y=layout, dt=1 / 120, steps=120)
    true = sw.integrate(net, "rk4", v=0.0, y=layout, dt=1 / 6000, steps=6000)
    assert fallen.y[-1] == pytest.approx(true.y[-1], abs=0.06 if "euler" in method else 1e-6)


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")  # without a control Euler's methods change it
@for_each("method", IMPLICIT)
def test_controls_keep_the_energy(method: str) -> None:
    bodies = {"v": np.array([[0.0, -1e-3], [0.0, 1.0]]), "y": np.array([[0.0, 0.0], [1.0, 0.0]]), "dt": 0.05, "steps": 200}
    system = sw.NBody(np.array([1.0, 1e-3]))
    free, kept = (
        sw.integrate(system, method, control=control, every=200, **bodies) for control in (None, sw.Projection("nacozy"))
    )
    energy = [[float(system.energy(run.v[k], run.y[k])) for k in (0, -1)] for run in (free, kept)]
    assert abs(energy[0][1] - energy[0][0]) > 100.0 * abs(energy[1][1] - energy[1][0])


# ---- large systems, whose equations are solved row by row, for their steps would have more than 20 000 operations

N = 600
CHAIN: dict[str, Any] = {"v": np.zeros(N), "y": np.linspace(0.0, 1.0, N)}


def test_a_large_system_goes_the_same_ways() -> None:
    """Its members, of which one is much stiffer, have steps of their own."""
    chain = sw.Chain(N, stiffness=np.ones((N + 1, 1)) * np.array([1.0, 1e4]))
    batch = {name: block[:, np.newaxis] * np.ones(2) for name, block in CHAIN.items()}
    ways = ("in pieces", "from a file", "alone")
    for method in ("linearly_implicit_euler", "trapezoidal", "rodas4"):
        assert_equal_ways(chain, method, **batch, dt=0.05, steps=4, ways=(*ways, "in a world"))
    assert_equal_ways(chain, "rosenbrock23", **batch, tolerance=1e-3, at=[0.1, 0.2], ways=ways)


def test_events_of_a_large_system() -> None:
    event = sw.Event(lambda t, v, y: y[N - 1] - 0.9, name="back")
    run = sw.integrate(sw.Chain(N), "rosenbrock23", **CHAIN, events=event, dt=0.05, steps=16)
    true = sw.integrate(sw.Chain(N), "rk4", **CHAIN, events=event, dt=0.05, steps=16)
    assert run.events["back"].t.size == 1
    assert run.events["back"].t == pytest.approx(true.events["back"].t, rel=1e-3)


def test_an_equation_may_ask_whether_a_number_is_zero() -> None:
    """Where the comparison has the constant first, as equal operations may, the rates' series compare as numbers do."""

    def ratio(x: Any) -> Any:
        return np.where(x == 0.0, 1.0, x / np.expm1(np.where(x == 0.0, 1.0, x)))

    @sw.system(order=1)
    def gate(t: Any, y: Any) -> Any:
        return [ratio(2.5 - 0.1 * y[0]) + ratio(1.0 - 0.1 * y[0]) - y[0]]

    start = {"y": np.array([[0.0, 25.0]]), "dt": 0.1, "steps": 5}
    run = sw.integrate(gate(), "rodas4", **start)
    assert np.isfinite(run.y[-1]).all()
    assert np.array_equal(run.y, sw.integrate(gate(), "rodas4", **start, backend="numpy").y)
    crossed = sw.Event(lambda t, y: y[0] - 20.0, name="crossed")
    assert sw.integrate(gate(), "rodas4", **start, events=crossed).events["crossed"].count.tolist() == [0, 1]
