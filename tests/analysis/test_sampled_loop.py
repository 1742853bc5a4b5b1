"""Loops that a sampled controller closes: beside loops that are stepped by hand, and limits that are known."""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, ShapeError, UnknownNameError
from support.looped import assert_refused, in_turn, looped

MASS = sw.TransferFunction(4.0, [1.0, 0.4, 0.0])
PI = sw.parallel(0.4, sw.TransferFunction(0.1, [1.0, 0.0]))
INTEGRATOR = sw.TransferFunction(1.0, [1.0, 0.0])


@looped("late", [0, 1, 3])
def test_a_loop_is_what_its_controller_and_plant_do(late: int) -> None:
    """A PI controller by the trapezoidal rule, written out, with the exact plant run from sample to sample."""
    dt, steps, x = 0.1, 40, 1.0
    loop = sw.sampled_loop(MASS, PI, dt, samples=late).run(np.full(steps, x))
    v, y, total, before, waiting = np.zeros(1), np.zeros(1), 0.0, 0.0, [0.0] * late
    z = []
    for _ in range(steps):
        z.append(4.0 * y[0])  # the output of the controllable form
        error = x - z[-1]
        total += 0.5 * dt * (error + before)
        before = error
        waiting.append(0.4 * error + 0.1 * total)
        run = sw.integrate(MASS.with_inputs(waiting.pop(0)), "exact", v=v, y=y, dt=dt, steps=1)
        v, y = run.v[-1], run.y[-1]
    # The trapezoidal sum begins with half of the first error, as the controller does from rest before it.
    assert loop.z[:, 0] == pytest.approx(z, abs=1e-12)


def test_a_controller_in_z_and_batches_of_loops() -> None:
    """As polynomials, as a gain and as a discrete system: the same loop."""
    by_hand = sw.discretise(PI, 0.1, "tustin")
    loops = [sw.sampled_loop(MASS, each, 0.1) for each in (PI, by_hand, (by_hand.num, by_hand.den))]
    for loop in loops[1:]:
        assert loop.den == pytest.approx(loops[0].den, abs=1e-14)
        assert loop.num == pytest.approx(loops[0].num, abs=1e-14)
    assert sw.sampled_loop(MASS, 0.8, 0.1).den == pytest.approx(sw.sampled_loop(MASS, (1.6, 2.0), 0.1).den, abs=1e-15)
    plant = sw.discretise(MASS, 0.1)
    assert sw.sampled_loop(MASS, 0.8, 0.1).den == pytest.approx(plant.den + 0.8 * plant.num, abs=1e-14)
    gains = np.array([0.1, 0.8, 2.0])
    together = sw.sampled_loop(MASS, gains, 0.2).radius
    assert together.tolist() == [float(sw.sampled_loop(MASS, each, 0.2).radius) for each in gains]
    plants = sw.TransferFunction(1.0, np.array([[1.0, 1.0], [0.5, 1.0]]))
    assert sw.sampled_loop(plants, PI, 0.1, delay=0.05).radius.shape == (2,)


def test_limits_that_are_known_and_the_dead_time_that_a_loop_bears() -> None:
    """1 − K·dt = −1; with a sample of dead time z² − z + K·dt = 0 leaves at K·dt = 1; a lag has ln((K + 1)/(K − 1))."""
    assert sw.sampling_limit(INTEGRATOR, 4.0) == pytest.approx(0.5, rel=1e-13)
    assert sw.sampling_limit(INTEGRATOR, 4.0, samples=1) == pytest.approx(0.25, rel=1e-12)
    lag = sw.TransferFunction(1.0, [1.0, 1.0])
    assert sw.sampling_limit(lag, 3.0) == pytest.approx(np.log(2.0), rel=1e-12)
    assert (sw.sampling_limit(lag, 0.5), sw.sampling_limit(INTEGRATOR, -1.0)) == (np.inf, 0.0)
    # With dead time beyond the margin no sample is short enough.
    margin = sw.margins(0.8 * MASS).delay
    assert sw.sampling_limit(MASS, 0.8, delay=0.9 * margin) > 0.0
    assert sw.sampling_limit(MASS, 0.8, delay=1.1 * margin) == 0.0


@pytest.mark.parametrize(("delay", "samples", "name"), in_turn([0.0, 0.05, 0.03], [0, 1], ["P", "PI"]))
def test_a_limit_from_both_sides(delay: float, samples: int, name: str) -> None:
    """By the samples themselves: below they decay, beyond they grow."""
    controller, options = {"P": 0.8, "PI": PI}[name], {"delay": delay, "samples": samples}
    limit = sw.sampling_limit(MASS, controller, **options)
    for factor, stable in ((0.98, True), (1.02, False)):
        loop = sw.sampled_loop(MASS, controller, factor * limit, **options)
        z = loop.run(np.eye(1, 6000)[0]).z[:, 0]
        assert bool(np.abs(z[-200:]).max() < np.abs(z[800:1000]).max()) is stable


def test_dead_time_costs_no_large_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    """An integrator bears K·τ = π/2, a hold of h as dead time of h/2 more: 0.16 % of τ with the shortest samples of 0.003·τ."""
    from stepwell.analysis.stability import eigen

    sizes, eigenvalues = [0], eigen.eigenvalues
    monkeypatch.setattr(eigen, "eigenvalues", lambda matrix: (sizes.append(len(matrix)), eigenvalues(matrix))[1])
    for delay in (0.5, 0.997 * np.pi / 2.0, 1.0001 * np.pi / 2.0):
        limit = sw.sampling_limit(INTEGRATOR, 1.0, delay=delay)
        assert (limit > 0.0) is (delay < np.pi / 2.0)
    assert 1 < max(sizes) <= 27
    # A controller with states, and 30 and 40 samples of dead time: their limit has a pair on the circle.
    lead = sw.TransferFunction([0.5, 1.0], [0.05, 1.0])
    cases = ((INTEGRATOR, 1.0, {"samples": 30}), (MASS, lead, {"samples": 40}), (INTEGRATOR, 1.0, {"delay": 0.997 * np.pi / 2.0}))
    for plant, controller, late in cases:
        limit = sw.sampling_limit(plant, controller, **late)
        assert abs(float(sw.sampled_loop(plant, controller, limit, **late).radius) - 1.0) < 1e-12
        assert sw.sampled_loop(plant, controller, 0.99 * limit, **late).radius < 1.0


def test_a_limit_takes_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lengths of a sample are tried together: ten exponentials, where each of some 130 lengths had its own."""
    from stepwell.reference import exact

    calls, held = [], exact.held
    monkeypatch.setattr(exact, "held", lambda *arguments: (calls.append(1), held(*arguments))[1])
    for plant, controller in ((MASS, PI), (INTEGRATOR, 4.0), (sw.TransferFunction(1.0, [1.0, 1.0]), 3.0)):
        calls.clear()
        assert sw.sampling_limit(plant, controller) > 0.0
        assert len(calls) <= 14


WRONG: list[tuple[Any, type[Exception], str]] = [
    (lambda: sw.sampled_loop(sw.Oscillator(), 1.0, 0.1), ShapeError, "plant: expected one input and one output, got 2 inputs"),
    (lambda: sw.sampled_loop(MASS, sw.Oscillator(), 0.1), ShapeError, "controller: expected one input and one output"),
    (lambda: sw.sampled_loop(MASS, sw.discretise(PI, 0.2), 0.1), ArgumentError, "controller: expected one that was discretised"),
    (lambda: sw.sampled_loop(MASS, (1.0, 2.0, 3.0), 0.1), ArgumentError, "controller: expected a pair (num, den)"),
    (lambda: sw.sampled_loop(MASS, "PI", 0.1), ArgumentError, "controller: expected a linear system"),
    (lambda: sw.sampled_loop(MASS, PI, 0.1, how="tusting"), UnknownNameError, "how: there is no 'tusting'"),
    (lambda: sw.sampled_loop(MASS, PI, 0.1, samples=-1), ArgumentError, "samples: expected 0 or more"),
    (lambda: sw.sampling_limit(MASS, (1.0, 2.0)), ArgumentError, "controller: expected a gain or a system of continuous time"),
    (lambda: sw.sampling_limit(MASS, np.ones(2)), ShapeError, "plant, controller: expected one member"),
    (lambda: sw.sampled_loop(sw.TransferFunction([1.0, 1.0], [1.0, 2.0]), -1.0, 0.1), ArgumentError, "an algebraic loop"),
]


def test_what_is_refused() -> None:
    assert_refused(WRONG)
