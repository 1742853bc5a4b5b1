"""Implicit methods: the equations they solve, their orders and stability, and the problems on which explicit methods fail."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.model.systems import LinearSystem
from stepwell.reference import pivoting
from stepwell.reference.rosenbrock import Rosenbrock
from stepwell.scenes import stiff_equations
from support import stiff_problems as stiff
from support.families import family
from support.for_each import for_each
from support.pollution import AT_60, POLLU, START, of_function, rates, stiff_matrix
from support.trees import Tree, density, trees

IMPLICIT = [m.name for m in sw.methods() if m.is_implicit]
ABLE = [name for name in IMPLICIT if sw.method(name).error_order is not None]


# The linear equations.


@for_each("n", [1, 2, 3, 5, 8])
def test_elimination_has_the_backward_error_of_partial_pivoting(n: int) -> None:
    """With factors of at most 1 the backward error is some n·eps times the growth of the entries, which is small in practice."""
    rng = np.random.default_rng(n)
    for _ in range(40):
        matrix = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-8, 8, (n, 1))
        matrix[rng.random((n, n)) < 0.3] = 0.0
        np.fill_diagonal(matrix, np.where(rng.random(n) < 0.5, 0.0, np.diag(matrix)) if n > 1 else 1.0)
        if n > 1 and np.linalg.cond(matrix / np.abs(matrix).max(axis=1, keepdims=True, initial=1e-300)) > 1e8:
            continue
        right = rng.normal(size=n)
        entries = [[None if x == 0.0 else x for x in row] for row in matrix.tolist()]
        x = pivoting.solved(pivoting.factored(entries), right.tolist())
        scaled = np.linalg.norm(matrix @ np.array(x, float) - right)
        assert scaled <= 64 * n * np.finfo(float).eps * np.abs(matrix).max() * np.abs(np.array(x, float)).sum() + 1e-13


def test_without_pivoting_the_small_pivot_would_decide() -> None:
    x = pivoting.solved(pivoting.factored([[1e-20, 1.0], [1.0, 1.0]]), [1.0, 2.0])
    assert np.array(x, float) == pytest.approx([1.0, 1.0], rel=1e-15)
    assert pivoting.solved(pivoting.factored([[None, 2.0], [4.0, None]]), [6.0, 8.0]) == [2.0, 3.0]


@for_each("method", IMPLICIT)
def test_the_matrix_form_lacks_the_derivatives_of_inputs(method: str) -> None:
    """Rosenbrock methods take them; the form has values of inputs only, so what it would make is refused."""
    ramp = sw.Sampled([1.0, 2.0, 3.0, 2.5], 0.4, interpolation="linear")
    for x in (sw.Sinusoid(0.3, 2.0, 0.1), ramp, sw.Sampled([1.0, 2.0, 3.0], 0.4)):
        system, options = sw.Oscillator(1.0, x=x), {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 10}
        if sw.method(method).takes_derivatives_by_time and (isinstance(x, sw.Sinusoid) or x is ramp):
            with pytest.raises(sw.errors.UnsupportedError, match="takes the derivatives of inputs too"):
                sw.integrate(system, method, form="matrix", **options)
            continue
        ends = [sw.integrate(system, method, form=form, **options).y[-1] for form in ("direct", "matrix")]
        assert ends[0] == pytest.approx(ends[1], abs=1e-13)


# Stability.


@for_each("method", IMPLICIT)
def test_the_stability_function(method: str) -> None:
    R = sw.stability.function(method)
    assert R.a_stable
    assert R.l_stable == (method not in ("implicit_midpoint", "trapezoidal"))
    z = np.array([-1e-3, -1.0, -50.0])
    P = sw.analyse(LinearSystem([[-1.0]], velocities=0), method, dt=-z).P[0, 0]
    assert R(z) == pytest.approx(P, rel=1e-12, abs=1e-14)
    order = sw.method(method).order
    h = 2.0**-3
    leading = [abs(R(-x) - math.exp(-x)) for x in (h, h / 2)]
    assert math.log2(leading[0] / leading[1]) == pytest.approx(order + 1, abs=0.45 if order < 5 else 1.2)


def test_closed_forms_of_the_undamped_oscillator() -> None:
    phi = np.array([0.1, 1.0, 10.0, 1e4])
    radius = {m: sw.analyse(sw.Oscillator(), m, dt=phi).radius for m in IMPLICIT}
    for euler in ("backward_euler", "linearly_implicit_euler"):
        assert radius[euler] == pytest.approx(1 / np.sqrt(1 + phi**2), rel=1e-14)
    for kept in ("implicit_midpoint", "trapezoidal"):
        assert radius[kept] == pytest.approx(np.ones(4), rel=1e-14)
    assert all((radius[m] < 1.0).all() for m in ("rosenbrock23", "rodas4", "rodas5p"))
    assert all(radius[m][-1] < 2e-3 for m in ABLE)


@for_each("method", IMPLICIT)
def test_every_step_is_stable(method: str) -> None:
    for system in (sw.Oscillator(3.0), sw.Oscillator(3.0, 0.2), sw.Chain(5), LinearSystem(np.diag([-1.0, -1e9]), velocities=0)):
        assert sw.stability_limit(system, method) == math.inf
    assert sw.stability_limit(LinearSystem([[1.0]], velocities=0), method) == 0.0  # the exact solution grows
    assert sw.method(method).limit == math.inf


def test_methods_that_are_not_a_stable_are_known() -> None:
    assert not any(sw.stability.function(m).a_stable for m in ("standard_euler", "rk4", "dop853", "taylor"))
    with pytest.raises(sw.errors.UnsupportedError, match="false_euler treats velocities and coordinates differently"):
        sw.stability.function("false_euler")
    assert repr(sw.stability.function("backward_euler")) == "<R(z) = 1/(1 − z), L-stable>"
    assert repr(sw.stability.function("trapezoidal")) == "<R(z) = (1 + z/2)/(1 − z/2), A-stable>"


# Order conditions, of the coefficients as they are, in fractions.


class Conditions:
    """A Rosenbrock method by its αᵢⱼ and γᵢⱼ, from the transformed coefficients (Hairer and Wanner II, IV.7)."""

    def __init__(self, method: Rosenbrock) -> None:
        n = len(method.nodes)
        a, c = (
            [[Fraction(x) for x in (*row, *[0] * (n - len(row)))] for row in rows] for rows in (method.rows, method.of_solutions)
        )
        gamma = Fraction(method.gamma)
        # Γ⁻¹ = I/γ − C is lower triangular.
        self.gammas = [[Fraction(0)] * n for _ in range(n)]
        for j in range(n):
            for i in range(j, n):
                right = Fraction(int(i == j)) + sum((c[i][k] * self.gammas[k][j] for k in range(j, i)), Fraction(0))
                self.gammas[i][j] = right * gamma
        self.alphas = [[sum((a[i][k] * self.gammas[k][j] for k in range(n)), Fraction(0)) for j in range(n)] for i in range(n)]
        self.n = n

    def weights(self, of_solutions: Any) -> list[Fraction]:
        columns = zip(*self.gammas, strict=True)
        return [sum((Fraction(m) * each for m, each in zip(of_solutions, column, strict=True)), Fraction()) for column in columns]

    def stages(self, tree: Tree) -> list[Fraction]:
        """Σ over all stages for a tree: from a vertex with one branch goes α + γ, from others α (B-series of exact Jacobians)."""
        if not tree:
            return [Fraction(1)] * self.n
        branches = [self.stages(branch) for branch in tree]
        both = len(tree) == 1
        factor = [[self.alphas[i][j] + (self.gammas[i][j] if both else 0) for j in range(self.n)] for i in range(self.n)]
        sums = [[sum((f * b for f, b in zip(row, branch, strict=True)), Fraction(0)) for row in factor] for branch in branches]
        return [math.prod(each, start=Fraction(1)) for each in zip(*sums, strict=True)]

    def worst(self, of_solutions: Any, order: int) -> float:
        """The largest residual of all order conditions up to this order."""
        weights = self.weights(of_solutions)
        every = [tree for p in range(1, order + 1) for tree in trees(p)]
        sums = (sum((w * s for w, s in zip(weights, self.stages(tree), strict=True)), Fraction(0)) for tree in every)
        return max(float(abs(total - Fraction(1, density(tree)))) for total, tree in zip(sums, every, strict=True))


@for_each(("name", "embedded"), [("rosenbrock23", 3), ("rodas4", 3), ("rodas5p", 4)])
def test_order_conditions(name: str, embedded: int) -> None:
    """All trees up to the order, and the sums of rows that make a step right for ∂f/∂t; to the roundings of the coefficients."""
    assert [len(trees(p)) for p in range(1, 6)] == [1, 1, 2, 4, 9]
    steps: Any = sw.method(name).steps
    method, conditions = steps.METHOD, Conditions(steps.METHOD)
    order = sw.method(name).order
    assert conditions.worst(steps.WEIGHTS, order) < 4e-14
    other = [w + e if name == "rosenbrock23" else w - e for w, e in zip(steps.WEIGHTS, steps.ERROR, strict=True)]
    assert conditions.worst(other, embedded) < 4e-14
    assert conditions.worst(steps.WEIGHTS, order + 1) > 1e-5
    assert conditions.worst(other, embedded + 1) > 1e-5
    for rows, printed in ((conditions.alphas, method.nodes), (conditions.gammas, method.by_time)):
        assert [float(sum(row)) for row in rows] == pytest.approx(printed, abs=2e-14)


# Orders as they are measured.


@for_each(
    ("method", "order"),
    [("backward_euler", 1), ("linearly_implicit_euler", 1), ("implicit_midpoint", 2), ("trapezoidal", 2), ("rosenbrock23", 2),
     ("rodas4", 1), ("rodas5p", 3)],
)  # fmt: skip
def test_order_reduction(method: str, order: int) -> None:
    """Prothero and Robinson's problem, ẏ = λ(y − φ) + φ̇ at λ = −1e6: the order that is left where h·λ is large."""
    # Rodas4 falls to 1, as methods of its kind do; Rodas5P was made to keep 3.
    runs = (sw.integrate(stiff.prothero_robinson, method, y=math.sin(0.5), dt=1 / n, steps=n) for n in (20, 40))
    errors = [abs(run.y[-1] - math.sin(1.5)) for run in runs]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)
    if method == "rodas5p":
        assert errors[1] < 1e-12


@for_each("method", ["backward_euler", "implicit_midpoint", "trapezoidal"])
def test_newton_converges_in_its_passes(method: str) -> None:
    """The residual of the implicit equation after three passes, against that of one, for a nonlinear oscillator."""
    pendulum, h = sw.Pendulum(), 0.1
    run = sw.integrate(pendulum, method, v=0.7, y=1.0, dt=h, steps=1)
    v, y = run.v[-1], run.y[-1]
    share = {"backward_euler": (0.0, 1.0), "trapezoidal": (0.5, 0.5)}.get(method)
    if share:
        rates = [share[0] * a + share[1] * b for a, b in ((-math.sin(1.0), -math.sin(y)), (0.7, v))]
    else:
        rates = [-math.sin(0.5 * (1.0 + y)), 0.5 * (0.7 + v)]
    assert np.hypot(v - 0.7 - h * rates[0], y - 1.0 - h * rates[1]) < 2e-8


# Stiff problems.

TIME = 1.0


@cache
def drawn() -> list[tuple[Any, Any, float]]:
    """Two hundred matrices, each with a state and a step."""
    rng = np.random.default_rng(11)
    sizes = rng.integers(2, 6, 200).tolist()
    return [(stiff_matrix(rng, n), rng.normal(size=n), 10.0 ** rng.uniform(-6, 1)) for n in sizes]


@cache
def truths() -> list[Any]:
    """Their exponentials, in a hundred digits."""
    return [stiff.exponential(A, TIME) @ s for A, s, _ in drawn()]


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
    """Of the longest that the state has been at least; the condition of the eigenvectors bounds what an error may grow by."""
    shares = []
    few = 4 if method == "rosenbrock23" else 1  # whose steps are many
    for (A, s, _), true in list(zip(drawn(), truths(), strict=True))[::few]:
        run = sw.integrate(LinearSystem(A, velocities=0), method, y=s, tolerance=tolerance, at=[TIME], every=1)
        assert run.status == sw.Status.OK
        allowed = tolerance * np.linalg.norm(run.y, axis=1).max() * np.linalg.cond(np.linalg.eig(A)[1])
        shares.append(np.linalg.norm(run.y[-1] - true) / allowed)
    assert max(shares) < MOST[method]
    assert np.median(shares) < 0.01 * MOST[method]


@pytest.mark.filterwarnings("ignore:.*which no solution reaches")
@for_each("method", IMPLICIT)
def test_steps_are_those_of_the_stability_function(method: str) -> None:
    """To the rounding of the solution of the equations, which the condition of their matrix amplifies."""
    R, gamma = sw.stability.function(method), getattr(sw.method(method).steps, "METHOD", None)
    share = gamma.gamma if gamma else 0.5 if method in ("implicit_midpoint", "trapezoidal") else 1.0
    for A, s, h in drawn():
        stepped = sw.integrate(LinearSystem(A, velocities=0), method, y=s, dt=h, steps=1).y[-1]
        true, condition = of_function(R, h, A, s), np.linalg.cond(np.eye(len(s)) - share * h * A)
        assert np.linalg.norm(stepped - true) <= 1e-13 * condition * (np.linalg.norm(true) + np.linalg.norm(s))


@for_each("method", ABLE)
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


@pytest.mark.parametrize("name", stiff.PROBLEMS)
@pytest.mark.parametrize("method", ABLE)
def test_reference_values(name: str, method: str) -> None:
    """The error at the reference times follows the tolerance, on every problem."""
    problem = stiff.PROBLEMS[name]
    times, values = list(problem.values), np.array(list(problem.values.values()))
    tight = 1e-8 if method == "rosenbrock23" else 1e-10
    for tolerance in (1e-5, tight):
        options: dict[str, Any] = {"y": problem.start, "tolerance": (tolerance, tolerance * problem.least), "at": times}
        run = sw.integrate(problem.system, method, **options)
        error = np.abs(run.y / values - 1.0).max()
        # Of the error of a step, of third order, follows the tolerance; Rosenbrock 2(3) makes one of second order in all.
        share = tolerance ** (2 / 3 if method == "rosenbrock23" else 1.0)
        assert error < problem.allowed * share, (tolerance, error)


def test_second_order_systems_solve_for_velocities_alone() -> None:
    """Van der Pol's equation in two blocks has the values of its form of first order; its step has fewer operations."""
    second = sw.integrate(stiff_equations.van_der_pol, "rodas5p", v=0.0, y=2.0, tolerance=(1e-10, 1e-13), at=[2000.0])
    assert second.y[-1] == pytest.approx(1.706167732170469, rel=1e-7)
    assert second.v[-1] == pytest.approx(-8.928097010248125e-4, rel=1e-6)
    first = sw.integrate(stiff.van_der_pol_1, "rodas5p", y=[2.0, 0.0], tolerance=(1e-10, 1e-13), at=[2000.0])
    assert first.y[-1, 0] == pytest.approx(1.706167732170469, rel=1e-7)
    count = [sum(sw.stability.operations("rodas4", run.system)[:2]) for run in (second, first)]
    assert count[0] < count[1]


@pytest.mark.parametrize("method", family(IMPLICIT, lambda name: name in ("backward_euler", "rodas5p")))
def test_a_system_that_is_too_large_is_refused_before_work(method: str) -> None:
    """Bodies have a full matrix; that of a chain of masses has three diagonals."""
    rng = np.random.default_rng(1)

    def step(system: sw.System, *shape: int) -> sw.Run:
        return sw.integrate(system, method, v=np.zeros(shape), y=rng.normal(size=shape), dt=0.1, steps=1)

    for n in (200, 2000):
        assert np.isfinite(step(sw.Chain(n), n).y).all()
    assert np.isfinite(step(sw.NBody(np.ones(60)), 60, 2).y).all()
    with pytest.raises(sw.errors.UnsupportedError, match=r"method: the equations .* 800 unknowns .* 500000; take an explicit"):
        step(sw.NBody(np.ones(200)), 200, 2)
    with pytest.raises(sw.errors.UnsupportedError, match=r"have 4098 unknowns .* may have 4096 and"):
        step(sw.Chain(2049), 2049)
