"""Implicit methods against truths of many digits: two hundred stiff linear systems, and a reaction of twenty species."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.model.systems import LinearSystem
from support.pollution import AT_60, POLLU, START, of_function, rates, stiff_matrix
from support.stiff_problems import exponential

IMPLICIT = [m.name for m in sw.methods() if m.is_implicit]
ABLE = [name for name in IMPLICIT if sw.method(name).error_order is not None]
MANY, TIME = 200, 1.0


@cache
def drawn() -> list[tuple[Any, Any, float]]:
    """Two hundred matrices, each with a state and a step."""
    rng = np.random.default_rng(11)
    sizes = rng.integers(2, 6, MANY).tolist()
    return [(stiff_matrix(rng, n), rng.normal(size=n), 10.0 ** rng.uniform(-6, 1)) for n in sizes]


@cache
def truths() -> list[Any]:
    """Their exponentials, in a hundred digits."""
    return [exponential(A, TIME) @ s for A, s, _ in drawn()]


def test_the_systems_are_stiff_and_far_from_normal() -> None:
    values = np.concatenate([np.linalg.eigvals(A).real for A, *_ in drawn()])
    assert values.min() < -5e7
    assert (values < 0.1).all()
    departure = [np.linalg.norm(A @ A.T - A.T @ A) / np.linalg.norm(A) ** 2 for A, *_ in drawn()]
    assert np.median(departure) > 0.3


#: The largest error at the end, over what is tolerated in a step and amplified: errors of steps add up, those of the second
#: order of more steps.
MOST = {"rosenbrock23": 10.0, "rodas4": 0.1, "rodas5p": 0.1}


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
@pytest.mark.parametrize("method", ABLE)
def test_adaptive_steps_keep_their_tolerance(method: str, tolerance: float) -> None:
    """It is of the longest that the state has been; the condition of the eigenvectors bounds what an error may grow by."""
    shares = []
    for (A, s, _), true in zip(drawn(), truths(), strict=True):
        run = sw.integrate(LinearSystem(A, velocities=0), method, y=s, tolerance=tolerance, at=[TIME], every=1)
        assert run.status == sw.Status.OK
        allowed = tolerance * np.linalg.norm(run.y, axis=1).max() * np.linalg.cond(np.linalg.eig(A)[1])
        shares.append(np.linalg.norm(run.y[-1] - true) / allowed)
    assert max(shares) < MOST[method]
    assert np.median(shares) < 0.01 * MOST[method]


@pytest.mark.parametrize("method", IMPLICIT)
def test_steps_are_those_of_the_stability_function(method: str) -> None:
    """To the rounding of the solution of the equations, which the condition of their matrix amplifies."""
    R, gamma = sw.stability.function(method), getattr(sw.method(method).steps, "METHOD", None)
    share = gamma.gamma if gamma else 0.5 if method in ("implicit_midpoint", "trapezoidal") else 1.0
    for A, s, h in drawn():
        stepped = sw.integrate(LinearSystem(A, velocities=0), method, y=s, dt=h, steps=1).y[-1]
        true, condition = of_function(R, h, A, s), np.linalg.cond(np.eye(len(s)) - share * h * A)
        assert np.linalg.norm(stepped - true) <= 1e-13 * condition * (np.linalg.norm(true) + np.linalg.norm(s))


@pytest.mark.parametrize("method", ABLE)
def test_twenty_species(method: str) -> None:
    """Each species by itself: the least of them is 4e-18."""
    for tolerance in (1e-4, 1e-6, 1e-8):
        run = sw.integrate(POLLU, method, y=START, tolerance=(tolerance, 1e-10 * tolerance), at=[60.0])
        assert np.abs(run.y[-1] / AT_60 - 1.0).max() < tolerance, tolerance


@pytest.mark.long
def test_the_twenty_species_of_another_program() -> None:
    from scipy.integrate import solve_ivp

    found = solve_ivp(rates, (0.0, 60.0), START, method="Radau", rtol=1e-12, atol=1e-22)
    assert found.y[:, -1] == pytest.approx(AT_60, rel=1e-12)
    run = sw.integrate(POLLU, "rodas5p", y=START, tolerance=(1e-10, 1e-20), at=[60.0])
    assert run.y[-1] == pytest.approx(found.y[:, -1], rel=1e-9)


def test_an_explicit_run_of_it_is_told_that_it_is_stiff() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sw.integrate(POLLU, "merson", y=START, tolerance=(1e-4, 1e-9), at=[60.0], max_steps=3000)
    (text,) = (str(each.message) for each in caught)
    assert "held down by stability and not by accuracy" in text
    assert '"rodas4" is stable there' in text
