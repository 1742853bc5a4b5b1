"""Mass matrices: M·ẏ = f, with algebraic equations where M is singular."""

from __future__ import annotations

import itertools
import math
import warnings
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis import consistency
from stepwell.errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from stepwell.model.equations.mass import mass_matrix
from support.calls import assert_raises
from support.graphs import assert_traced_alike
from support.looped import looped
from support.ways import WAYS, assert_equal_ways

IMPLICIT = [m.name for m in sw.methods() if m.is_implicit]
ABLE = [name for name in IMPLICIT if sw.method(name).error_order is not None]
EXPLICIT = [m.name for m in sw.methods() if not m.is_implicit and not m.needs_acceleration]


@sw.system(order=1, mass=np.diag([1.0, 1.0, 0.0]))
def robertson(t: Any, y: Any) -> Any:
    """Robertson's reaction, of which the third equation says that nothing is lost."""
    slow, fast = 0.04 * y[0] - 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return [-slow, slow - fast, y[0] + y[1] + y[2] - 1.0]


#: By the Test Set for IVP Solvers.
ROBERTSON = {
    0.4: (0.98517211386, 3.386395379e-5, 0.01479402218522),
    40.0: (0.71582706871941, 9.18553476456e-6, 0.28416374574583),
    1e2: (0.6172348823961, 6.15359127464e-6, 0.3827589640126),
    1e5: (0.0178659211423, 7.27475146852e-8, 0.9821340061102),
}


@sw.system(order=1, mass=np.diag([1.0, 1.0, 1.0, 1.0, 0.0]))
def pendulum(t: Any, s: Any, *, g: Any = 9.81) -> Any:
    """A rod of length 1: x, y, their velocities, and the pull of the rod, for which the length has no acceleration (index 1)."""
    x, y, u, v, pull = s
    return [u, v, -pull * x, -pull * y - g, u * u + v * v - pull * (x * x + y * y) - g * y]


#: The capacitances of the transistor amplifier join nodes, so its matrix is not diagonal: three of its rows depend on others.
CAPACITANCES = 1e-6 * np.arange(1.0, 6.0)
JOINED = np.zeros((8, 8))
for (node, other), capacitance in zip([(0, 1), (2, 2), (3, 4), (5, 5), (6, 7)], CAPACITANCES, strict=True):
    JOINED[node, node] -= capacitance
    if other != node:
        JOINED[other, other] -= capacitance
        JOINED[node, other] += capacitance
        JOINED[other, node] += capacitance


@sw.system(order=1, mass=JOINED)
def amplifier(t: Any, y: Any) -> Any:
    """Two transistors; problem ``transamp`` of the Test Set for IVP Solvers."""
    supply, voltage, gain = 6.0, 0.026, 0.99
    first, second = (1e-6 * (np.exp((y[i] - y[i + 1]) / voltage) - 1.0) for i in (1, 4))
    of_supply = supply / 9000.0
    return [
        (y[0] - 0.1 * np.sin(200.0 * np.pi * t)) / 1000.0,
        y[1] / 4500.0 - of_supply + (1.0 - gain) * first,
        y[2] / 9000.0 - first,
        y[3] / 9000.0 - of_supply + gain * first,
        y[4] / 4500.0 - of_supply + (1.0 - gain) * second,
        y[5] / 9000.0 - second,
        y[6] / 9000.0 - of_supply + gain * second,
        y[7] / 9000.0,
    ]


AMPLIFIER_START = [0.0, 3.0, 3.0, 6.0, 3.0, 3.0, 6.0, 0.0]
#: At t = 0.2, by the Test Set.
AMPLIFIER_END = [
    -0.55621450122627e-2, 0.30065224719030e1, 0.28499587886081e1, 0.29264225362062e1,
    0.27046178650105e1, 0.27618377783931e1, 0.47709276316167e1, 0.12369958680915e1,
]  # fmt: skip


@looped("method", ABLE)
def test_robertsons_reaction_with_its_sum_as_an_equation(method: str) -> None:
    tolerance = (1e-5, 1e-11) if method == "rosenbrock23" else (1e-7, 1e-13)
    run = sw.integrate(robertson, method, y=[1.0, 0.0, 0.0], tolerance=tolerance, at=list(ROBERTSON))
    assert np.abs(run.y / list(ROBERTSON.values()) - 1.0).max() < (3e-4 if method == "rosenbrock23" else 2e-6)
    assert np.abs(run.y.sum(axis=1) - 1.0).max() < 1e-14


@looped("method, error", [("rodas4", 5e-7), ("rodas5p", 1e-7)])
def test_an_amplifier_whose_matrix_is_not_diagonal(method: str, error: float) -> None:
    assert amplifier.mass.algebraic == [1, 4, 7]
    run = sw.integrate(amplifier, method, y=AMPLIFIER_START, tolerance=(1e-5, 1e-7), at=[0.2])
    assert np.abs(run.y[-1] - AMPLIFIER_END).max() < error


#: The orders of the state and of the pull of the rod by steps of fixed length, and the two numbers of steps.
ORDERS = {
    "backward_euler": (1, 1), "linearly_implicit_euler": (1, 1), "implicit_midpoint": (2, 2), "trapezoidal": (2, 2),
    "rosenbrock23": (2, 2), "rodas4": (4, 4), "rodas5p": (5, 5),
}  # fmt: skip


@looped("method", IMPLICIT)
def test_orders_of_the_state_and_of_what_algebraic_equations_determine(method: str) -> None:
    """A rod pendulum of index 1 from 60° off, against its angle by a method of order 8."""
    start = [math.sin(1.0), -math.cos(1.0), 0.0, 0.0, 0.0]
    start = sw.consistent_start(pendulum(), start)
    true = sw.integrate(sw.Pendulum(omega=math.sqrt(9.81)), "dop853", v=0.0, y=1.0, tolerance=1e-13, at=[1.0])
    angle, rate = float(true.y[-1]), float(true.v[-1])
    place, pull = np.array([math.sin(angle), -math.cos(angle)]), rate**2 + 9.81 * math.cos(angle)
    errors = []
    counts = {4: (320, 640), 5: (40, 80)}.get(ORDERS[method][0], (160, 320))
    for steps in counts:
        end = sw.integrate(pendulum, method, y=start, dt=1.0 / steps, steps=steps).y[-1]
        errors.append((np.abs(end[:2] - place).max(), abs(end[4] - pull)))
    assert np.log2(np.array(errors[0]) / np.array(errors[1])) == pytest.approx(ORDERS[method], abs=0.35)


@looped("method", [*EXPLICIT, *IMPLICIT])
def test_a_matrix_with_an_inverse_goes_with_every_method(method: str) -> None:
    """The rates are M⁻¹·f, to rounding those of a function that has multiplied already."""
    M = np.array([[2.0, 1.0, 0.0], [1.0, 3.0, 1.0], [0.0, 1.0, 2.0]])
    A = np.array([[-1.0, 0.0, 1.0], [0.0, -2.0, 0.5], [1.0, 0.0, -3.0]])
    inverse = np.linalg.inv(M)
    joined = sw.system(order=1, mass=M)(lambda t, y: A @ y + np.sin(t))
    multiplied = sw.system(order=1)(lambda t, y: inverse @ (A @ y + np.sin(t)))
    ends = [sw.integrate(each, method, y=[1.0, 2.0, 3.0], dt=0.01, steps=50).y[-1] for each in (joined, multiplied)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)
    matrices = [sw.jacobian(each(), y=[1.0, 2.0, 3.0]).matrix for each in (joined, multiplied)]
    assert matrices[0] == pytest.approx(matrices[1], rel=1e-12, abs=1e-14)


def test_the_matrix_of_units_changes_no_bit() -> None:
    def rates(t: Any, y: Any) -> Any:
        return [y[1] - 2.0 * y[0], y[2] * y[0], -(y[1] ** 2)]

    for method in ("rk4", "rodas4"):
        systems = (sw.system(order=1)(rates), sw.system(order=1, mass=np.eye(3))(rates))
        runs = [sw.integrate(each, method, y=[1.0, 0.5, 0.2], dt=1e-2, steps=20) for each in systems]
        assert np.array_equal(runs[0].y, runs[1].y)


@looped("system, method", itertools.product([robertson(), amplifier(), pendulum()], IMPLICIT))
def test_the_core_has_the_graph_of_the_reference(system: Any, method: str) -> None:
    assert_traced_alike(system.for_state_shapes(), method)


def test_the_same_bits_in_every_way() -> None:
    """But from another start, at which algebraic equations do not hold."""
    y = np.array([[1.0, 0.9, 0.8, 0.7], [0.0, 0.0, 0.0, 0.0], [0.0, 0.1, 0.2, 0.3]])
    of_robertson: dict[str, Any] = {"v": np.zeros((0, 4)), "y": y, "ways": [way for way in WAYS if way != "prepared"]}
    steps: dict[str, Any] = {"dt": 1e-3, "steps": 8}
    chosen: dict[str, Any] = {"tolerance": 1e-5, "ways": [way for way in WAYS if way not in ("prepared", "in a world")]}
    for method, options in (
        ("rodas4", steps),
        ("trapezoidal", steps | {"fused": True}),
        ("rosenbrock23", steps | {"dtype": "float32"}),
        ("rodas4", chosen | {"at": np.array([0.5, 1.0])}),
    ):
        assert_equal_ways(robertson(), method, **of_robertson | options)
    start = sw.consistent_start(pendulum(), [[0.6, 0.8], [-0.8, -0.6], [0.0, 0.1], [0.0, 0.0], [0.0, 0.0]])
    for sign in (1.0, -1.0):
        options = chosen | {"v": np.zeros((0, 2)), "y": start, "at": sign * np.array([0.1, 0.2, 0.3])}
        assert_equal_ways(pendulum(), "rodas5p", **options)


def test_a_run_of_another_matrix_is_not_gone_on_with(tmp_path: Any) -> None:
    other = sw.system(order=1, mass=np.diag([2.0, 1.0, 0.0]))(lambda t, y: robertson.function(t, y))
    assert robertson().digest != other().digest
    sw.integrate(robertson, "rodas4", y=[1.0, 0.0, 0.0], tolerance=1e-4, at=[1.0]).save(tmp_path / "run.npz")
    with pytest.raises(ArgumentError, match="makes other operations"):
        sw.load(tmp_path / "run.npz", system=other())


@sw.system(order=1, mass=np.diag([1.0, 1.0, 0.0]))
def shadow(t: Any, s: Any) -> Any:
    """A swing, and a number that depends on it and on the time: z = x·sin t."""
    x, u, z = s
    return [u, -x, z - x * np.sin(t)]


@looped("sign", [1.0, -1.0])
def test_events_of_numbers_that_algebraic_equations_determine(sign: float) -> None:
    """z = sin(2t)/2 has its maximum at ±π/4 + kπ, and is above 0.4999 for 0.02 around, much less than a step."""
    event = sw.Event(lambda t, y: y[2] - 0.4999, name="high")
    run = sw.integrate(shadow, "rodas5p", y=[1.0, 0.0, 0.0], tolerance=(1e-8, 1e-10), at=[sign * 10.0], events=[event])
    half = 0.5 * math.acos(0.9998)
    tops = (np.arange(3) + (0.25 if sign > 0 else 0.75)) * math.pi
    expected = np.concatenate([[top - half, top + half] for top in tops])
    assert np.abs(run.events["high"].t - sign * expected).max() < 2e-6


def test_rates_of_what_algebraic_equations_determine() -> None:
    t, x, u = 2.0, 0.3, 0.4
    y = np.array([x, u, x * math.sin(t)])
    rates = consistency.rates(shadow().for_state_shapes(0.0, y), y, t, 0.1)
    assert rates == pytest.approx([u, -x, u * math.sin(t) + x * math.cos(t)], abs=1e-8)


def test_a_start_is_made_consistent() -> None:
    """What has a rate keeps its value."""
    assert sw.consistent_start(robertson(), [0.5, 0.0, 9.0]).tolist() == [0.5, 0.0, 0.5]
    start = sw.consistent_start(pendulum(g=[9.81, 1.62]), [0.6, -0.8, 0.3, 0.4, 0.0])
    assert start.shape == (5, 2)
    assert start[4] == pytest.approx(0.25 + 0.8 * np.array([9.81, 1.62]), rel=1e-14)
    start = sw.consistent_start(amplifier(), AMPLIFIER_START, t0=0.0)
    changed = start - AMPLIFIER_START
    assert JOINED @ changed == pytest.approx(np.zeros(8), abs=1e-18)
    # The equations are combinations of rows that add up to zero by M.
    rates = np.array(amplifier.function(0.0, start))
    assert np.abs(rates[[0, 3, 6]] + rates[[1, 4, 7]]).max() < 1e-15
    with pytest.raises(UnsupportedError, match="expected one with algebraic equations"):
        sw.consistent_start(sw.Oscillator(), 1.0)
    never = sw.system(order=1, mass=np.diag([1.0, 0.0]))(lambda t, y: [-y[0], 1.0 + y[1] ** 2])
    with pytest.raises(ArgumentError, match="no state at which"):
        sw.consistent_start(never(), [1.0, 0.7])


def test_an_inconsistent_start_is_refused_before_work() -> None:
    y = np.array([[1.0, 0.5], [0.0, 0.0], [0.0, 0.5]])
    y[2, 1] += 1e-3
    for options in ({"dt": 1e-3, "steps": 2}, {"tolerance": 1e-4, "at": [1.0]}):
        with pytest.raises(ArgumentError, match=r"y\[2\] \(of member \(1,\)\) would be about 0.5, got 0.501; take"):
            sw.integrate(robertson, "rodas4", y=y, **options)
    with pytest.raises(ArgumentError, match=r"algebraic equations hold"):
        sw.World(robertson, "rodas4", y=np.array([1.0, 0.0, 0.5]), dt=1e-3)
    sw.integrate(robertson, "rodas4", y=y, tolerance=1e-2, at=[1.0])  # within what is tolerated


@looped("relation", [lambda x, y, u, v: x * x + y * y - 1.0, lambda x, y, u, v: x * u + y * v])
def test_an_index_above_one_is_refused(relation: Any) -> None:
    """The length of a rod, or the velocity along it, does not determine its pull."""

    @sw.system(order=1, mass=np.diag([1.0, 1.0, 1.0, 1.0, 0.0]))
    def rod(t: Any, s: Any) -> Any:
        x, y, u, v, pull = s
        return [u, v, -pull * x, -pull * y - 9.81, relation(x, y, u, v)]

    with pytest.raises(UnsupportedError, match="their index is above 1"):
        sw.integrate(rod, "rodas4", y=[1.0, 0.0, 0.0, 0.0, 0.0], dt=1e-3, steps=1)


@looped("seed", range(24))
@looped("index", [1, 2])
def test_an_index_above_one_behind_a_full_matrix_is_refused(index: int, seed: int) -> None:
    """x' = A·x + B·z, 0 = C·x + D·z in other numbers and other equations: of index 2 without D, of which rounding is left."""
    drawn = np.random.default_rng(seed)
    m, d = int(drawn.integers(1, 3)), int(drawn.integers(2, 5))
    n = m + d
    equations, numbers, blocks = drawn.normal(size=(3, n, n))
    equations *= 10.0 ** drawn.uniform(-3.0, 3.0, (n, 1))
    blocks[d:, d:] *= index == 1
    rates = (equations @ blocks @ numbers).tolist()

    @sw.system(order=1, mass=equations @ np.diag([1.0] * d + [0.0] * m) @ numbers)
    def joined(t: Any, y: Any) -> Any:
        return [sum(rate * each for rate, each in zip(row, y, strict=True)) for row in rates]

    if index == 1:
        start = sw.consistent_start(joined(), np.ones(n))
        assert np.isfinite(sw.integrate(joined, "rodas4", y=start, dt=0.01, steps=9).y).all()
    else:
        assert_raises(
            (lambda: sw.consistent_start(joined(), np.ones(n)), "their index is above 1"),
            (lambda: sw.integrate(joined, "rodas4", y=np.zeros(n), dt=0.01, steps=9), "their index is above 1"),
            (lambda: sw.World(joined, "rodas4", y=np.zeros(n), dt=0.01), "their index is above 1"),
            kind=UnsupportedError,
        )


def test_equations_that_determine_nothing_on_the_way_are_told() -> None:
    """Fixed steps pass the pole of y₁ = 1/y₀ at t = 1: of the member that gets there alone."""
    pole = sw.system(order=1, mass=np.diag([1.0, 0.0]))(lambda t, y, rate=1.0: [0.0 * y[1] - rate, y[0] * y[1] - 1.0])
    options: dict[str, Any] = {"y": np.ones((2, 2)), "dt": 0.01, "steps": 150}
    with pytest.warns(
        sw.AccuracyWarning, match="at a time on the way, .* determined nothing for 1 of 2 members: member 0; there"
    ):
        run = sw.integrate(pole(rate=[1.0, 0.5]), "rosenbrock23", **options)
    assert run.findings[0].members.tolist() == [True, False]
    ends, size = np.array([[0.0, 0.5], [7.0, 2.0]]), np.ones((2, 2))
    system = pole(rate=[1.0, 0.5]).for_state_shapes(0.0, ends)
    assert consistency.lost(system, (size, 0.0), (ends, 1.0), size)[0].tolist() == [True, False]


def test_what_needs_rates_says_so() -> None:
    kept, y = sw.system(order=1, mass=np.diag([1.0, 0.0]))(lambda t, y: [y[1], y[1]]), [1.0, 0.0, 0.0]

    @kept.invariant
    def energy(y: Any) -> Any:
        return y[0]

    step: dict[str, Any] = {"dt": 1e-3, "steps": 1}

    @kept.invariant
    def other(y: Any) -> Any:
        return y[0] + y[1]

    onto, run = sw.Projection("other"), partial(sw.integrate, kept, "rodas4", y=[1.0, 0.0], **step)
    assert_raises(
        (lambda: sw.jacobian(robertson(), y=y), "give no rate"),
        (lambda: sw.stability_limit(robertson(), "rodas4", y=y), "give no rate"),
        (lambda: sw.equilibria(robertson(), near=(None, y)), "give no rate"),
        (lambda: run(control=sw.Control("energy", 1.0)), r"control: .* use Projection\('energy'\), which moves the state"),
        (lambda: run(control=onto), r"control: .* numbers that have a rate, and other of .* depends on y\[1\]"),
        *((partial(sw.integrate, robertson, m, y=y, **step), "needs the rate of every number") for m in EXPLICIT),
        kind=UnsupportedError,
    )


def test_wrong_matrices() -> None:
    square, robertson_of_two = "mass: expected a square matrix.* got shape", {"y": [1.0, 0.0], "dt": 0.1, "steps": 1}
    assert_raises(
        (lambda: sw.system(order=1, mass=np.zeros((2, 3))), ShapeError, rf"{square} \(2, 3\)"),
        (lambda: sw.system(order=1, mass=np.zeros(3)), ShapeError, rf"{square} \(3,\)"),
        (lambda: sw.system(order=1, mass=np.zeros((2, 2))), ArgumentError, "mass: expected an entry that is not zero"),
        (lambda: sw.system(order=1, mass=[[np.nan]]), ArgumentError, "mass"),
        (lambda: sw.system(order=1, mass="M"), DTypeError, "mass: expected real numbers"),
        (lambda: sw.system(mass=np.eye(2)), ArgumentError, "mass: expected order=1"),
        (lambda: sw.system(order=1, mass=np.eye(2), shape=(3,)), ShapeError, "mass: expected 3 rows and columns, .*, got 2"),
        (lambda: sw.integrate(robertson, "rodas4", **robertson_of_two), ShapeError, r"declared shape \(3,\)"),
    )


@sw.system(order=1, mass=np.diag([1.0, 0.0]))
def folded(t: Any, y: Any, *, rate: Any = 1.0) -> Any:
    """y₁ = √y₀ until y₀ is below 0, at t = 1/rate: from there on no number is its root."""
    return [0.0 * y[0] - rate, y[1] * y[1] - y[0]]


@looped("method", IMPLICIT)
def test_fixed_steps_past_the_end_of_a_solution_are_told(method: str) -> None:
    start: dict[str, Any] = {"y": [1.0, 1.0], "dt": 0.01}
    before = sw.integrate(folded, method, **start, steps=90)
    assert before.y[-1, 1] == pytest.approx(math.sqrt(0.1), abs=0.03)
    assert not before.findings
    with pytest.warns((sw.AccuracyWarning, sw.DivergenceWarning)) as caught:
        sw.integrate(folded, method, **start, steps=150)
    assert "the algebraic equations do not hold for the run" in str(caught[0].message) or method == "rodas5p"  # NaN
    with pytest.warns(
        sw.AccuracyWarning, match="t = 1.2, the algebraic equations do not hold for 1 of 2 members: member 1; they"
    ):
        both = sw.integrate(folded(rate=[0.5, 1.0]), "backward_euler", **start, steps=120)
    assert both.findings[0].members.tolist() == [False, True]
    with pytest.warns(sw.AccuracyWarning, match="at rate = 0.5: at the end, .* do not hold for 1 of 2 members: member 1"):
        sw.sweep(folded, {"rate": [0.5, 1.0]}, "backward_euler", **start, transient=20, steps=100)
    world = sw.World(folded(rate=[0.5, 1.0]), method, y=np.ones((2, 2)), dt=0.01)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(150):
            world.step()
    assert sum("do not hold for 1 of 2 members: member 1" in str(each.message) for each in caught) == (method != "rodas5p")
    assert {each.filename for each in caught} == {__file__}


def test_a_state_that_is_written_into_a_world_has_to_be_consistent() -> None:
    fast = sw.system(order=1, mass=np.diag([1.0, 0.0]))(lambda t, y: [-y[0], y[1] - y[0]])
    y = np.array([1.0, 1.0])
    world = sw.World(fast, "trapezoidal", y=y, dt=0.1)
    world.step(3)
    was = y.copy()
    y[1] = 5.0
    with pytest.raises(ArgumentError, match=r"y: expected .* y\[1\] would be about 0.7.*, got 5; take .*consistent_start"):
        world.step()
    assert y[0] == was[0]  # no step was made
    y[0] = 2.0
    y[:] = sw.consistent_start(world.system, y)
    world.step(3)
    assert y == pytest.approx(2.0 * np.exp(-0.3), rel=1e-3)
    assert y[1] == pytest.approx(y[0], rel=1e-12)


@looped("seed", range(30))
def test_the_rows_are_combinations_of_those_of_the_matrix(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, rank = int(rng.integers(1, 8)), int(rng.integers(1, 8))
    M = rng.normal(size=(n, rank)) @ rng.normal(size=(rank, n)) if seed % 2 else rng.integers(-2, 3, (n, n)).astype(float)
    M *= 10.0 ** rng.integers(-9, 9, size=(n, 1))
    if not M.any():
        return
    reduced = mass_matrix("mass", M)
    L, rows = np.zeros((n, n)), np.zeros((n, n))
    for matrix, of in ((L, reduced.combinations), (rows, reduced.rows)):
        for i, row in enumerate(of):
            for column, entry in row:
                matrix[i, column] = entry
    scale = np.abs(M).max(axis=1)
    assert pytest.approx(rows, abs=1e-9) == L @ M
    assert n - len(reduced.algebraic) == np.linalg.matrix_rank(M / np.where(scale > 0.0, scale, 1.0)[:, np.newaxis], tol=1e-9)
    assert np.linalg.matrix_rank(L * np.where(scale > 0.0, scale, 1.0), tol=1e-12) == n
    determined = [i for i in range(n) if i not in reduced.algebraic]
    assert np.array_equal(rows[np.ix_(determined, determined)], np.eye(len(determined)))


@sw.system(order=1, mass=np.diag([1.0, 1.0, 1.0, 1.0, 0.0]))
def swing(t: Any, s: Any, *, g: Any = 9.81, drag: Any = 0.0) -> Any:
    """The rod again, with a drag and declared invariants: the length and the velocity along it, and an energy."""
    x, y, u, v, pull = s
    speed = u * u + v * v - pull * (x * x + y * y) - g * y - drag * (x * u + y * v)
    return [u, v, -pull * x - drag * u, -pull * y - g - drag * v, speed]


@swing.invariant
def energy(s: Any, *, g: Any) -> Any:
    return 0.5 * (s[2] ** 2 + s[3] ** 2) + g * s[1]


@swing.invariant
def length(s: Any) -> Any:
    return np.sqrt(s[0] ** 2 + s[1] ** 2)


@swing.invariant
def radial(s: Any) -> Any:
    return s[0] * s[2] + s[1] * s[3]


def test_what_algebraic_equations_keep_is_checked_and_projected_onto() -> None:
    """The length after 100 s is off by a fifth and more at a tolerance of 1e-3: that is told, and a projection keeps it."""
    options: dict[str, Any] = {"y": [1.0, 0.0, 0.0, 0.0, 0.0]}
    loose = options | {"tolerance": 1e-3, "at": [100.0]}
    for method in ABLE:
        with pytest.warns(sw.AccuracyWarning, match=f"has another .* at the end: .*so {method} did not follow the motion"):
            run = sw.integrate(swing, method, **loose)
        assert abs(np.hypot(*run.y[-1, :2]) - 1.0) > 0.2
        kept = sw.integrate(swing, method, **loose, control=sw.Projection("length"))
        assert abs(np.hypot(*kept.y[-1, :2]) - 1.0) < 1e-15
        assert not sw.integrate(swing, method, **loose, control=sw.Projection("radial")).findings
    with pytest.warns(sw.AccuracyWarning, match="another energy at the end"):
        sw.integrate(swing, "rodas4", **options, dt=0.3, steps=400)
    # What is right, and an energy that a drag takes, are no findings; a core has the bits of the reference.
    assert not sw.integrate(swing, "rodas5p", **options, tolerance=1e-7, at=[20.0]).findings
    assert not sw.integrate(swing(drag=0.3), "rodas5p", **options, tolerance=1e-7, at=[20.0]).findings
    both = [
        sw.integrate(swing, "rodas4", **options, dt=0.01, steps=99, control=sw.Projection("length"), backend=backend).y
        for backend in ("rust", "numpy")
    ]
    np.testing.assert_array_equal(*both)
    assert np.hypot(*both[0][-1, :2]) == pytest.approx(1.0, abs=1e-15)
