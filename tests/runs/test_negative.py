"""Amounts of reactions and populations stay positive, or the run says that one did not."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs import negative
from stepwell.scenes.stiff_equations import rober
from support.advised import unmeasured  # noqa: F401
from support.stiff import lorenz

ABLE = [method.name for method in sw.methods() if method.error_order is not None and not method.has_series]
IMPLICIT = [name for name in ABLE if sw.method(name).is_implicit]
NEGATIVE = "which no solution reaches"


@sw.system(order=1)
def may_leonard(t: Any, y: Any, *, a: Any = 0.8, b: Any = 1.3) -> Any:
    """Three species, each of which is driven out by the next, over and over (May and Leonard, 1975)."""
    return [y[i] * (1.0 - y[i] - a * y[(i + 1) % 3] - b * y[(i + 2) % 3]) for i in range(3)]


@sw.system(order=1)
def predators(t: Any, y: Any) -> Any:
    """Lotka and Volterra's, in which the prey falls to 1e-13 of its largest number."""
    return [y[0] * (1.0 - y[1]), y[1] * (y[0] - 1.0)]


swing = sw.system(order=1)(lambda t, y: [y[1], -y[0]])


def run_of(system: Any, method: str, start: Any, end: float, tolerance: Any, **options: Any) -> tuple[sw.Run, list[str]]:
    """The run and what it warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        at = np.geomspace(1e-6 * end, end, 200)
        run = sw.integrate(system, method, y=start, tolerance=tolerance, at=at, max_steps=300_000, **options)
    return run, [str(each.message) for each in caught]


@pytest.mark.parametrize("method", ABLE)
def test_no_negative_equilibrium_is_reached_without_a_word(method: str) -> None:
    """Of May and Leonard's species two reach −5 and 7.5 in many such runs; every one of them says so."""
    for tolerance, (a, b) in itertools.product((1e-2, 1e-4, 1e-6, (1e-6, 1e-9)), ((0.8, 1.3), (0.5, 1.8), (0.9, 0.9))):
        run, texts = run_of(may_leonard(a=a, b=b), method, [0.9, 0.05, 0.051], 2000.0, tolerance)
        if not run.status:
            negative = bool((run.y[-1] < -0.1).any())
            assert any(NEGATIVE in text for text in texts) is negative, (tolerance, a, b, run.y[-1], texts)
        run, texts = run_of(may_leonard(a=a, b=b), method, [0.9, 0.05, 0.051], 2000.0, tolerance, positive=True)
        assert run.status or (run.y >= 0.0).all()
        assert not any(NEGATIVE in text for text in texts)


@pytest.mark.parametrize("method", IMPLICIT)
def test_robertsons_reaction_stays_positive_to_1e11(method: str) -> None:
    for tolerance, end in itertools.product((1e-1, 1e-3, 1e-6, (1e-4, 1e-10)), (40.0, 1e5, 1e11)):
        run, texts = run_of(rober(), method, [1.0, 0.0, 0.0], end, tolerance)
        assert not run.status
        assert (run.y >= 0.0).all()
        assert run.y[-1].sum() == pytest.approx(1.0, rel=1e-9)
        assert not texts, (tolerance, end)


def test_the_warning_says_which_number_and_which_members() -> None:
    with pytest.warns(
        sw.AccuracyWarning, match=r"^y\[\d\] ends at -5 in 2 of 3 members; the first was member 0, which no .* positive=True$"
    ):
        run = sw.integrate(
            may_leonard(a=np.array([0.8, 0.8, 0.5])), "rodas4", y=np.array([[0.9], [0.05], [0.051]]), tolerance=1e-6, at=[2000.0]
        )
    (found,) = run.findings
    assert np.array_equal(found.members, (run.y[-1] < -1.0).any(axis=0))


def test_numbers_that_may_become_negative_are_not_warned_of() -> None:
    """A swing; Lorenz's equations, whose rates are negative at large numbers only; amounts that began negative; rounding."""
    for start, system in (([1.0, 0.5], swing()), ([1.0, 1.0, 1.0], lorenz()), ([1.0, -0.5, 0.1], may_leonard(a=0.8, b=1.3))):
        _, texts = run_of(system, "rodas4", start, 2.0, 1e-3)
        assert not texts
    run, texts = run_of(predators(), "rodas4", [20.0, 20.0], 15.0, 1e-4)
    assert not run.status
    assert (run.y[-1] > -1e-4 * 20.0).all()
    assert not any(NEGATIVE in text for text in texts)


@pytest.mark.usefixtures("unmeasured")
def test_what_is_advised_stays_positive() -> None:
    for system, start, horizon in ((may_leonard(), [0.9, 0.05, 0.051], 200.0), (rober(), [1.0, 0.0, 0.0], 1e11)):
        scene = sw.Scene(system, y=start, horizon=horizon)
        advice = sw.advise(scene, frame=None, tolerance=1e-2, methods=[*IMPLICIT, "dop853"], cost="evaluations")
        assert advice.ranked
        for row in advice.ranked:
            assert (advice.run(row).y > -1e-2).all()


def test_equations_that_depend_on_the_time_are_left_alone() -> None:
    """The rate at zero is positive at the end, and was negative before."""
    driven = sw.system(order=1)(lambda t, y: np.cos(t) - 0.3 * y)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = sw.integrate(driven(), "merson", y=0.5, tolerance=1e-8, at=[1.5 * np.pi + 0.2])
    assert run.y[-1] < -0.1


def test_members_are_looked_at_some_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which ones are told does not depend on how many are looked at together."""

    @sw.system(order=1)
    def species(t, y, *, a=0.8, b=1.3):
        p, q, r = y
        return [p * (1.0 - p - a * q - b * r), q * (1.0 - q - b * p - a * r), r * (1.0 - r - a * p - b * q)]

    y = np.array([[0.5], [1.0], [2.0]]) * np.ones(7)
    wholes = []
    for at_once in (256, 2):
        monkeypatch.setattr(negative, "AT_ONCE", at_once)
        with pytest.warns(sw.AccuracyWarning, match="which no solution reaches"):
            run = sw.integrate(species(b=np.linspace(1.3, 1.31, 7)), "rodas5p", y=y, tolerance=1e-2, at=[1500.0])
        (finding,) = (each for each in run.findings if "no solution reaches" in each.message)
        wholes.append(finding.members)
    assert np.array_equal(*wholes)
