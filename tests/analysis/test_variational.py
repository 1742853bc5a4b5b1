"""Disturbances that are not judged: the steps are those of the motion alone, whatever becomes of the disturbances."""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.dynamics.variational import Variational
from stepwell.runs import engine
from support.looped import looped
from support.ways import assert_equal_ways

ABLE = [method.name for method in sw.methods() if method.error_order is not None or method.name == "taylor"]
AT = [0.7, 0.701, 1.5, 4.0]


@sw.system(order=1)
def lorenz(t: Any, y: Any, *, sigma: Any = 10.0, rho: Any = 28.0, beta: Any = 8.0 / 3.0) -> Any:
    return [sigma * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - beta * y[2]]


@sw.system
def duffing(t: Any, v: Any, y: Any, *, damping: Any = 0.2) -> Any:
    return np.cos(1.2 * t) - damping * v + y - y**3


THREE = {"v": np.zeros((3, 2)), "y": np.array([[0.9, 0.1], [-0.5, 0.8], [-0.4, -0.9]])}
MOTIONS: dict[str, tuple[sw.System, dict[str, Any]]] = {
    "own equations": (lorenz(), {"y": np.array([1.0, 2.0, 20.0])}),
    "of second order": (duffing(), {"v": 0.1, "y": 0.5}),
    "blocks": (sw.NBody([1.0, 1.0, 1.0], softening=0.3), THREE),
}


def both(motion: str, method: str, size: float = 1.0, **options: Any) -> tuple[sw.Run, sw.Run, Any]:
    """A run of a motion, one with two disturbances beside it, and the numbers of y of the motion in this."""
    system, start = MOTIONS[motion]
    alone = sw.integrate(system, method, **start, **options)
    v, y = alone.system.v_shape, alone.system.y_shape
    n_v, n_y = int(np.prod(v)), int(np.prod(y))
    beside = size * np.cos(1.7 * np.arange(2 * (n_v + n_y)))
    blocks = np.ravel(start.get("v", np.zeros(0))), np.concatenate([np.ravel(start["y"]), beside])
    whole = Variational(alone.system, 2, judged=False)
    return alone, sw.integrate(whole, method, v=blocks[0], y=blocks[1], **options), n_y


def assert_same_steps(alone: sw.Run, beside: sw.Run, n_y: int) -> None:
    np.testing.assert_array_equal(beside.y[:, :n_y], alone.y.reshape(len(alone.t), -1))
    np.testing.assert_array_equal(beside.v, alone.v.reshape(len(alone.t), -1))
    paces = (each.controller_state.pace[: engine.PACE_NUMBERS] for each in (beside, alone))  # type: ignore[union-attr]
    np.testing.assert_array_equal(*paces)


@looped("method", ABLE)
@pytest.mark.parametrize("motion", MOTIONS)
def test_steps_are_those_of_the_motion_alone(motion: str, method: str) -> None:
    """To the bit, with the steps that are tried next; Rosenbrock's methods solve smaller equations for ÿ = a, which round alike
    only to the last bits.
    """
    for tolerance in (1e-4, (1e-7, 1e-8)):
        alone, beside, n_y = both(motion, method, tolerance=tolerance, at=AT)
        if motion != "own equations" and sw.method(method).is_implicit:
            np.testing.assert_allclose(beside.y[:, :n_y], alone.y.reshape(len(AT), -1), rtol=0, atol=1e-10)
            assert alone.paces is not None
            assert beside.paces is not None
            assert (alone.paces.accepted, alone.paces.rejected) == (beside.paces.accepted, beside.paces.rejected)
        else:
            assert_same_steps(alone, beside, n_y)


def test_judged_they_change_the_steps() -> None:
    """Which the test above would see."""
    system, start = MOTIONS["own equations"]
    beside = np.concatenate([start["y"], 100.0 * np.ones(3)])
    known = system.for_state_shapes(0.0, start["y"])
    runs = [sw.integrate(Variational(known, 1, judged=each), "dop853", y=beside, tolerance=1e-7, at=AT) for each in (True, False)]
    assert not np.array_equal(runs[0].y[:, :3], runs[1].y[:, :3])


@looped("method", ["merson", "dop853", "taylor", "rodas5p"])
def test_disturbances_that_overflow_stop_nothing(method: str) -> None:
    """They grow from 1e307 by more than 1e2, and the motion goes on as alone."""
    alone, beside, n_y = both("own equations", method, 1e307, tolerance=1e-7, at=[1.0, 12.0])
    assert not np.isfinite(beside.y[-1, n_y:]).all()
    assert beside.status == 0
    assert_same_steps(alone, beside, n_y)


def test_equal_bits_in_every_way() -> None:
    """Beside members of one batch, with tolerances of components, by the reference and at each level."""
    system = Variational(lorenz(rho=np.linspace(20.0, 28.0, 9)).for_state_shapes(0.0, np.ones((3, 9))), 2, judged=False)
    y = np.cos(np.arange(81.0)).reshape(9, 9)
    of_numbers = (10.0 ** -np.arange(5.0, 14.0))[:, np.newaxis]
    for method in ("merson", "dop853"):
        for tolerance in (1e-6, (1e-6, of_numbers)):
            assert_equal_ways(system, method, ways=("by the reference", "at each level"), y=y, tolerance=tolerance, at=AT)


def test_disturbances_are_the_derivative_of_the_steps() -> None:
    """Of two motions 1e-6 to both sides, with steps of the one between: the difference of second order, 1e-12, and roundings."""
    system, start = MOTIONS["own equations"]
    known = system.for_state_shapes(0.0, start["y"])
    options: dict[str, Any] = {"tolerance": 1e-12, "at": [1.0]}
    run = sw.integrate(Variational(known, 1, judged=False), "vern9", y=np.concatenate([start["y"], [1.0, 0.0, 0.0]]), **options)
    sides = [sw.integrate(known, "vern9", y=start["y"] + np.array([each, 0.0, 0.0]), **options).y[-1] for each in (1e-6, -1e-6)]
    np.testing.assert_allclose(run.y[-1, 3:], (sides[0] - sides[1]) / 2e-6, rtol=0, atol=1e-4)


def test_findings_look_at_the_motion() -> None:
    """The warning that steps are held by stability is that of the motion."""
    stiff = sw.system(order=1)(lambda t, y: [y[1], 1000.0 * (1.0 - y[0] ** 2) * y[1] - y[0]])().for_state_shapes(0.0, np.ones(2))
    y = np.array([2.0, 0.0])
    options: dict[str, Any] = {"tolerance": 1e-6, "at": [20.0]}
    with pytest.warns(sw.StiffnessWarning) as alone:
        sw.integrate(stiff, "dop853", y=y, **options)
    with pytest.warns(sw.StiffnessWarning) as beside:
        sw.integrate(Variational(stiff, 1, judged=False), "dop853", y=np.concatenate([y, [1.0, 0.5]]), **options)
    assert len(alone) == len(beside) == 1


def test_pieces_of_the_rates_are_those_of_the_system() -> None:
    """Steps end where the time switches, which they stepped over; and a series does not see a choice by the state."""

    @sw.system(order=1)
    def pulsed(t: Any, y: Any) -> Any:
        return np.where((t > 5.0) & (t < 5.001), 1000.0, 0.0) - 0.01 * y

    both = Variational(pulsed().for_state_shapes(None, 1.0), 1, judged=False)
    ask: dict[str, Any] = {"tolerance": 1e-6, "at": [10.0]}
    run = sw.integrate(both, "dop853", y=np.array([1.0, 1.0]), **ask)
    assert run.y[-1, 0] == sw.integrate(pulsed(), "dop853", y=1.0, **ask).y[-1]
    assert run.y[-1, 0] > 1.5

    @sw.system(order=1)
    def bent(t: Any, y: Any) -> Any:
        return np.where(y > 0.5, -y, -0.5)

    with pytest.raises(sw.errors.UnsupportedError, match="chooses between values"):
        sw.lyapunov(bent(), "taylor", y=1.0, tolerance=1e-6, at=[1.0])
