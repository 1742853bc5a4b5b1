"""One rule for all methods: a member has diverged at the first step after which a number of its v or y is not finite."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.families import family

METHODS = [m.name for m in sw.methods()]
#: Of the structures of a step: explicit, with a carried state, with stages, implicit, with a series.
FEW = ("false_euler", "leapfrog", "verlet", "rk4", "trapezoidal", "rodas4", "taylor")


def quiet(*arguments: Any, **options: Any) -> sw.Run:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        return sw.integrate(*arguments, **options)


def first_not_finite(run: sw.Run, axes: int = 0) -> Any:
    """From a run that kept every step."""
    blocks = tuple(range(1, 1 + axes))
    finite = np.isfinite(run.v).all(axis=blocks) & np.isfinite(run.y).all(axis=blocks)
    finite[0] = True  # the start is no step
    return np.where(finite.all(axis=0), -1, run.start_step + np.argmin(finite, axis=0))


def growing(method: str, dt: float) -> tuple[sw.Oscillator, int]:
    """Oscillators that steps of this length make grow, but for the second one, and in how many steps beyond all numbers.

    By an implicit method none does that does not grow by itself.
    """
    if sw.method(method).is_implicit:
        return sw.Oscillator(np.array([0.9, 1e-3, 0.95]) / dt, -1.0, form="physical"), 1000
    return sw.Oscillator(np.array([9.0, 1e-3, 12.0, 40.0]) / dt, form="physical"), 420


@pytest.mark.parametrize("method", METHODS)
def test_the_first_bad_step_is_that_of_the_states(method: str) -> None:
    """Whether all states are kept or the last alone, by both backends. 1e-5: a velocity overflows long before its coordinate."""
    for dt, form in ((3.0, "direct"), (1e-5, "direct"), (1e-5, "matrix")):
        if sw.method(method).is_implicit:
            system, steps = growing(method, dt)
        else:
            system, steps = sw.Oscillator(np.linspace(2.5, 40.0, 9) / dt, form="physical"), 700
        options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": dt, "steps": steps, "form": form}
        whole = quiet(system, method, every=1, **options)
        expected = first_not_finite(whole)
        assert (expected > 0).any()
        by_numpy = [{"every": 13, "backend": "numpy"}] if method in FEW else []
        for more in ({"every": 1}, {"every": None}, {"every": 13}, *by_numpy):
            np.testing.assert_array_equal(quiet(system, method, **options, **more).first_bad_step, expected)
        np.testing.assert_array_equal(whole.status, expected > 0)


@pytest.mark.parametrize(("form", "steps"), [("direct", 300), ("matrix", 3000)])
def test_a_velocity_that_is_finite_again(form: str, steps: int) -> None:
    """Verlet's coordinates go on though the greatest velocities are infinite: it has diverged when the first one is."""
    method = "verlet"
    system = sw.Oscillator(np.array([100.0, 1.0, 30.0]), form="physical")
    options: dict[str, Any] = {"v": 0.0, "y": [1e307, 1.0, 1e307], "dt": 1e-3, "steps": steps, "form": form}
    whole = quiet(system, method, every=1, **options)
    assert np.isfinite(whole.y).all()
    expected = first_not_finite(whole)
    assert expected[0] > 0
    assert expected[1] == -1
    for backend in ("rust", "numpy"):
        np.testing.assert_array_equal(quiet(system, method, **options, backend=backend).first_bad_step, expected)


@pytest.mark.parametrize("method", ["leapfrog", "verlet"])
def test_of_large_systems_too(method: str) -> None:
    """A chain that is stepped row by row, and bodies."""
    chain, y = sw.Chain(600), np.random.default_rng(1).normal(size=(600, 2))
    options: dict[str, Any] = {"v": 0.0, "y": y, "dt": 2.5, "steps": 600}
    whole = quiet(chain, method, every=1, **options)
    expected = first_not_finite(whole, 1)
    assert (expected > 0).all()
    for more in ({}, {"backend": "numpy"}, {"every": 7}):
        np.testing.assert_array_equal(quiet(chain, method, **options, **more).first_bad_step, expected)
    y = np.array([[0.0, 0.0], [0.0, 1e-160], [1.0, 0.0]])  # the square of the distance is less than any number
    for backend in ("rust", "numpy"):
        assert quiet(sw.NBody(), method, v=0.0, y=y, dt=0.1, steps=5, backend=backend).first_bad_step == 1


@pytest.mark.parametrize("form", ["direct", "matrix", "power"])
@pytest.mark.parametrize("method", family(METHODS, FEW.__contains__))
def test_every_run_can_be_resumed(method: str, form: str) -> None:
    """Wherever it stops: also where a velocity has just become infinite and nothing else has. And in pieces as in one piece."""
    system, many = growing(method, 1.0)
    options: dict[str, Any] = {"dt": 1.0, "form": form}
    whole = quiet(system, method, v=0.0, y=1.0, **options, steps=many)
    first = int(whole.first_bad_step[whole.first_bad_step > 0].min())
    for steps in range(max(1, first - 2), first + 2):
        half = quiet(system, method, v=0.0, y=1.0, **options, steps=steps)
        finite = np.isfinite(half.v[-1]) & np.isfinite(half.y[-1])
        np.testing.assert_array_equal(half.status == 0, finite)
        rest = quiet(system, method, **options, steps=many - steps, resume=half)
        if form != "power":
            for name in ("first_bad_step", "v", "y"):
                np.testing.assert_array_equal(getattr(rest, name), getattr(whole, name))
