"""The transition-matrix form (Appendix B) agrees with the direct form to rounding."""

from __future__ import annotations

import numpy as np
import pytest
import stepwell as sw
from support.cases import Case, cases
from support.for_each import for_each

MATRIX = [c for c in cases() if c.form == "matrix"]
EPS = np.finfo(float).eps


@for_each("case", MATRIX)
def test_direct_and_matrix_agree(case: Case) -> None:
    n = 200
    # Small steps, so that no method grows by more than 10 in 200 of them and errors are not amplified by more.
    matrix = case.run(20, steps=n, every=10, dt=0.05)
    direct = Case(case.method, case.system, "direct", case.start).run(20, steps=n, every=10, dt=0.05)
    same = np.array_equal(matrix.v, direct.v) and np.array_equal(matrix.y, direct.y)
    assert not same or case.method in ("standard_euler", "false_euler")
    size = max(np.abs(direct.y).max(initial=0.0), np.abs(direct.v).max(initial=0.0))
    # Each step of either form rounds some dozens of times (rows of P and the stages alike) relative to the largest number; n
    # steps add up n of those, times the growth. Verlet's recursion has a double root near 1: n²/2 of them, and its v divides by
    # h·ω₀ ≥ 0.025.
    steps = n * n / 2 / 0.025 if case.method == "verlet" else n
    bound = 40 * steps * EPS * 10 * size
    np.testing.assert_allclose(matrix.y, direct.y, rtol=0, atol=bound)
    np.testing.assert_allclose(matrix.v, direct.v, rtol=0, atol=bound)


def test_the_misprinted_matrix_of_false_heun_is_not_the_method() -> None:
    """§10 prints 1 − Φ²/2 in the corner; the program of Appendix B has 1 − Φ² + Φ⁴/2, and so has the method."""
    phi = 0.9
    printed = np.array([[1 - phi**2 / 2, -phi * (1 - phi**2 / 2)], [phi * (1 - phi**2 / 2), 1 - phi**2 / 2]])
    run = sw.integrate(
        sw.Oscillator(phi), "false_heun", v=np.array([1.0, 0.0]), y=np.array([0.0, 1.0]), dt=1.0, steps=1, form="matrix"
    )
    matrix = np.array([run.v[-1], run.y[-1]])
    assert matrix[1, 1] == pytest.approx(1 - phi**2 + phi**4 / 2, abs=4 * EPS)
    assert matrix[1, 1] - printed[1, 1] == pytest.approx(phi**4 / 2 - phi**2 / 2, abs=4 * EPS)
