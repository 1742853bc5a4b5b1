"""Linear systems by their matrices (§3): the same systems as those with kernels of their own, blocks as one likes, outputs."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnknownNameError, UnsupportedError
from support.calls import assert_raises
from support.cases import Case, cases
from support.for_each import for_each

EPS = np.finfo(float).eps
METHODS = [m.name for m in sw.methods()]
MATRIX = [case for case in cases() if case.form == "matrix"]
RUN: dict[str, Any] = {"dt": 0.05, "steps": 200, "every": 10}


def assert_close(linear: sw.Run, own: sw.Run, method: str) -> None:
    """To rounding: another formula for the same rates.

    With numerics.md: N·κ·2c·u·‖Ā‖·max‖s‖ for N steps, with at most c = 40 roundings one after another (four stages of up to ten),
    ‖Ā‖ < 2, and κ < 4, for Standard Euler grows by at most (1 + Φ²)^(N/2) < e here (Φ ≤ 0.1). Verlet's recursion has a double
    root near 1, so N²/2 instead of N, and its v divides by h·ω₀ > 0.02.
    """
    n = RUN["steps"]
    steps = n * n / 2 / 0.02 if method == "verlet" else n
    bound = steps * 4 * 2 * 40 * (EPS / 2) * 2 * max(np.abs(own.v).max(), np.abs(own.y).max())
    np.testing.assert_allclose(linear.v, own.v, rtol=0, atol=bound)
    np.testing.assert_allclose(linear.y, own.y, rtol=0, atol=bound)


def as_block(own: sw.Run) -> sw.Run:
    """A run of an oscillator with the shapes of one of a linear system."""
    own.v, own.y = own.v[:, np.newaxis], own.y[:, np.newaxis]
    return own


@for_each("method", METHODS)
def test_the_free_oscillator_to_the_bit(method: str) -> None:
    """A product with 0 adds nothing, so here even the roundings are those of the oscillator's own kernel."""
    omega = np.linspace(0.5, 2.0, 11)
    nothing = np.zeros(11)
    linear = sw.integrate(sw.LinearSystem([[nothing, -omega], [omega, nothing]]), method, v=0.3, y=1.0, **RUN)
    own = as_block(sw.integrate(sw.Oscillator(omega), method, v=0.3, y=np.ones(11), **RUN))
    if sw.method(method).is_implicit:  # by way of y only v is solved for, where a matrix might hold derivatives of ẏ by y
        assert_close(linear, own, method)
        return
    np.testing.assert_array_equal(linear.v, own.v)
    np.testing.assert_array_equal(linear.y, own.y)


@for_each("method", [m for m in METHODS if not sw.method(m).needs_acceleration])
def test_the_driven_oscillator(method: str) -> None:
    omega, damping = np.linspace(0.5, 2.0, 11), 0.2
    nothing = np.zeros(11)
    x, a = sw.Sampled(np.sin(np.arange(40.0)), 0.3), sw.Sinusoid(0.4, 1.5, 0.1)
    linear = sw.LinearSystem(
        [[-2 * damping * omega, -omega], [omega, nothing]], [[omega, 1 / omega], [nothing, nothing]], x=[x, a]
    )
    own = sw.Oscillator(omega, damping, x=x, a=a)
    one, other = (sw.integrate(system, method, v=0.3, y=1.0, **RUN) for system in (linear, own))
    assert_close(one, as_block(other), method)


@for_each("method", METHODS)
def test_the_chain(method: str) -> None:
    rng = np.random.default_rng(1)
    n, k, m = 4, rng.uniform(0.5, 1.5, (5, 3)), rng.uniform(0.8, 2.0, 4)
    A = np.zeros((2 * n, 2 * n, 3))
    for i in range(n):
        A[n + i, i] = 1.0
        A[i, n + i] = -(k[i] + k[i + 1]) / m[i]
        if i > 0:
            A[i, n + i - 1] = k[i] / m[i]
        if i < n - 1:
            A[i, n + i + 1] = k[i + 1] / m[i]
    y = rng.normal(size=(n, 3))
    linear = sw.integrate(sw.LinearSystem(A), method, v=0.1, y=y, **RUN)
    assert_close(linear, sw.integrate(sw.Chain(n, stiffness=k, mass=m), method, v=0.1, y=y, **RUN), method)


@for_each("method", ["false_euler", "semi_false_heun", "rk4"])
def test_the_order_of_the_states_is_the_users(method: str) -> None:
    """Renumbering the states renumbers the result and changes no bit, if the order in the blocks stays: that is summed in."""
    rng = np.random.default_rng(2)
    A, B = rng.normal(size=(5, 5)) - 2 * np.eye(5), rng.normal(size=(5, 2))
    s0, x = rng.normal(size=5), [0.7, sw.Sinusoid(1.0, 2.0)]
    new = [2, 1, 3, 4, 0]  # state i of the renumbered system is state new[i] of the plain one
    plain = sw.LinearSystem(A, B, x=x)
    renumbered = sw.LinearSystem(A[new][:, new], B[new], x=x, velocities=[new.index(0), new.index(1)])
    assert (plain.velocities, plain.coordinates) == ((0, 1), (2, 3, 4))
    assert (renumbered.velocities, renumbered.coordinates) == ((4, 1), (0, 2, 3))
    states = []
    for system, start in ((plain, s0), (renumbered, s0[new])):
        v, y = system.split(start)
        run = sw.integrate(system, method, v=v, y=y, **RUN)
        states.append(np.array([system.state(a, b) for a, b in zip(run.v, run.y, strict=True)]))
    np.testing.assert_array_equal(states[0][0], s0)
    np.testing.assert_array_equal(states[1], states[0][:, new])


def test_which_block_goes_first_matters() -> None:
    """False Euler advances v first: the same A with the blocks exchanged is Damped Euler, to the bit."""
    A = np.array([[0.0, -1.3], [1.3, 0.0]])
    false = sw.integrate(sw.LinearSystem(A), "false_euler", v=0.2, y=1.0, **RUN)
    exchanged = sw.integrate(sw.LinearSystem(A, velocities=[1]), "damped_euler", v=1.0, y=0.2, **RUN)
    np.testing.assert_array_equal(false.v, exchanged.y)
    np.testing.assert_array_equal(false.y, exchanged.v)
    standard = sw.integrate(sw.LinearSystem(A, velocities=0), "false_euler", v=0.0, y=[0.2, 1.0], **RUN)
    plain = sw.integrate(sw.LinearSystem(A), "standard_euler", v=0.2, y=1.0, **RUN)
    np.testing.assert_array_equal(standard.y, np.concatenate([plain.v, plain.y], axis=1))  # nothing to go first


@for_each("velocities", [None, 0, 3, [2, 0]])
@for_each("batch", [(), (4,), (2, 3)])
def test_split_and_state_undo_each_other(velocities: Any, batch: tuple[int, ...]) -> None:
    system = sw.LinearSystem(np.eye(3), velocities=velocities)
    state = np.random.default_rng(3).normal(size=(3, *batch))
    v, y = system.split(state)
    assert (v.shape, y.shape) == ((*system.v_shape, *batch), (*system.y_shape, *batch))
    np.testing.assert_array_equal(v, state[list(system.velocities)])
    np.testing.assert_array_equal(system.state(v, y), state)
    one = sw.LinearSystem(np.eye(3), velocities=[1])
    np.testing.assert_array_equal(one.state(7.0, [[1.0, 2.0], [3.0, 4.0]]), [[1.0, 2.0], [7.0, 7.0], [3.0, 4.0]])
    np.testing.assert_array_equal(one.split(2.0)[1], [2.0, 2.0])


@for_each("form", ["direct", "matrix"])
@for_each(("n", "velocities"), [(1, 0), (1, 1), (1, None), (3, 0), (3, 3)])
def test_an_empty_block(n: int, velocities: int | None, form: str) -> None:
    """Every method is then one that has no second block: the Eulers are one, and so is Heun."""
    system = sw.LinearSystem(-np.eye(n), np.ones((n, 1)), np.ones((1, n)), x=np.array([0.0, 0.5]), velocities=velocities)
    of_v = velocities or 0
    run = sw.integrate(system, "rk4", v=1.0, y=1.0, dt=0.1, steps=20, every=10, form=form)
    assert run.v.shape == (3, of_v, 2)
    assert run.y.shape == (3, n - of_v, 2)
    assert run.z.shape == (3, 1, 2)
    # ṡ = x − s; RK4's local error per step is h⁵/120 at most, 20 of them.
    np.testing.assert_allclose(run.z[:, 0, 0], n * np.exp(-run.t), rtol=0, atol=n * 20 * 0.1**5 / 120)
    np.testing.assert_allclose(run.z[:, 0, 1], n * 0.5 * (1 + np.exp(-run.t)), rtol=0, atol=n * 20 * 0.1**5 / 120)


@for_each(
    ("A", "B", "velocities", "second", "term"),
    [
        ([[0, -1], [1, 0]], None, None, True, False),
        ([[0, -1], [1, 0]], [1, 0], None, True, False),
        ([[0, -1], [1, 0]], [0, 1], None, False, False),  # an input of ẏ
        ([[0, -1], [1, 0]], None, [1], True, False),  # the other block first: ẏ is v times −1
        ([[-0.1, -1], [1, 0]], None, None, True, True),
        ([[0, -1], [1, 0.1]], None, None, False, False),
        ([[0, -1], [0, 0]], None, None, False, False),  # ẏ = 0
        ([[0, -1], [1, 0]], None, 2, False, True),
        ([[0, -1], [1, 0]], None, 0, False, False),
        ([[-1]], None, None, False, False),
        (np.kron([[0, -1], [1, 0]], np.eye(2)), None, None, True, False),
        (np.kron([[0, -1], [1, 0]], np.diag([1, 2])), None, None, False, False),  # two speeds
        (np.kron([[0, -1], [1, 0]], np.ones((2, 2))), None, None, False, False),  # ẏ mixes the velocities
        (np.kron([[0, -1], [1, 0]], np.eye(2)[::-1]), None, None, False, False),
        (np.kron([[0, -1], [1, 0]], np.eye(2)[::-1]), None, [1, 0], True, False),
        ([[[0, 0], [-1, -2]], [[1, 3], [0, 0]]], None, None, True, False),  # speeds differ by member
        ([[[0, 0], [-1, -2]], [[1, 0], [0, 0]]], None, None, False, False),  # a speed of zero
    ],
)
def test_who_is_of_second_order(A: Any, B: Any, velocities: Any, second: bool, term: bool) -> None:
    system = sw.LinearSystem(A, B, velocities=velocities)
    assert system.second_order == second
    assert (system.velocity_term is not None) == term
    options = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 3}
    if second and not term:
        sw.integrate(system, "verlet", **options)
        return
    why = "needs forces that do not depend on the velocity" if second else "needs a second-order system"
    with pytest.raises(UnsupportedError, match=why):
        sw.integrate(system, "verlet", **options)


def test_verlets_velocity_has_the_members_speed() -> None:
    """The velocity whose increment is d: canonical oscillators of three ω₀, and v must come back from y_prev at once."""
    omega = np.array([0.5, 1.0, 2.0])
    system = sw.LinearSystem([[0 * omega, -omega], [omega, 0 * omega]])
    run = sw.integrate(system, "verlet", v=0.7, y=1.0, dt=0.1, steps=1, every=1)
    np.testing.assert_allclose(run.v[0], 0.7, rtol=0, atol=8 * EPS / 0.05)  # a difference of y near 1, divided by h·ω₀


def test_outputs_are_their_formula() -> None:
    rng = np.random.default_rng(4)
    n, m, r, b = 5, 3, 4, 6
    A, B = rng.normal(size=(n, n)) - 3 * np.eye(n), rng.normal(size=(n, m, b))
    C, D = rng.normal(size=(r, n)), rng.normal(size=(r, m, b))
    sine, sampled = sw.Sinusoid(1.0, 2.0, rng.normal(size=b)), sw.Sampled(rng.normal(size=(9, b)), 0.1)
    system = sw.LinearSystem(A, B, C, D, x=[sine, sampled, rng.normal(size=b)], velocities=[4, 1])
    run = sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.03, steps=30, every=3)
    assert run.z.shape == (11, r, b)
    for i, t in enumerate(run.t):
        state = system.state(run.v[i], run.y[i])
        x = np.array([np.sin(2 * t + sine.phase), sampled.values[min(int(t / 0.1 + 1e-6), 8)], system.x[2].values[0]])  # type: ignore[union-attr]
        z = np.einsum("rn,nb->rb", C, state) + np.einsum("rmb,mb->rb", D, x)
        size = np.einsum("rn,nb->rb", abs(C), abs(state)) + np.einsum("rmb,mb->rb", abs(D), abs(x))
        # n + m products and as many sums in either order, and two sines that differ by 2 ulp.
        assert (abs(run.z[i] - z) <= (2 * (n + m) + 4) * EPS * size).all()
        np.testing.assert_array_equal(run.z[i], system.auxiliary(float(t), run.v[i], run.y[i]))


def test_outputs_without_inputs_and_with_zero_ones() -> None:
    C = [[1.0, 2.0], [0.0, 1.0]]
    bare = sw.LinearSystem(-np.eye(2), None, C)
    idle = sw.LinearSystem(-np.eye(2), np.ones((2, 2)), C, np.ones((2, 2)), x=[None, 0.0], velocities=1)
    for system in (bare, idle):
        run = sw.integrate(system, "rk4", v=1.0, y=2.0, dt=0.1, steps=2, every=1)
        np.testing.assert_array_equal(run.z, np.stack([run.v[:, 0] + 2 * run.y[:, 0], run.y[:, 0]], axis=1))


def test_the_batch_of_outputs_alone_is_a_batch() -> None:
    system = sw.LinearSystem([[-1.0]], None, np.ones((1, 1, 3)) * [1.0, 2.0, 3.0])
    run = sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
    assert run.y.shape == (1, 1, 3)
    np.testing.assert_array_equal(run.z[0, 0], run.y[0, 0] * [1.0, 2.0, 3.0])
    assert system.auxiliary(0.0, np.zeros(0), np.ones(1)).tolist() == [[1.0, 2.0, 3.0]]


def test_a_transfer_function_of_equal_degrees() -> None:
    """The lead-lag (1 + T₁s)/(1 + T₂s), for which §3 says that outputs are essential: it answers a step at once."""
    t1, t2 = 2.0, 0.5
    lead = {"A": [[-1 / t2]], "B": [1 / t2], "C": [1 - t1 / t2], "D": t1 / t2}
    step = sw.integrate(sw.LinearSystem(**lead, x=1.0), "rk4", v=0.0, y=0.0, dt=0.01, steps=1000, every=1)
    exact = 1 + (t1 / t2 - 1) * np.exp(-step.t / t2)
    # RK4 on ṡ = −λs: the error is at most t·e^(−λt)·λ⁵h⁴/120 ≤ λ⁴h⁴/(120·e) < 5e-10 times the factor of C, 3; and rounding.
    np.testing.assert_allclose(step.z[:, 0], exact, rtol=0, atol=3 * (0.01 / t2) ** 4 / 120)
    assert step.z[0, 0] == 4.0
    omega = np.array([0.3, 1.0, 5.0])
    response = (1 + 1j * omega * t1) / (1 + 1j * omega * t2)
    inside = 1 / (1 + 1j * omega * t2)  # the state answers as 1/(1 + T₂s): start on its steady oscillation
    wave = sw.LinearSystem(**lead, x=sw.Sinusoid(1.0, omega))
    run = sw.integrate(wave, "rk4", v=0.0, y=inside.imag[np.newaxis], dt=0.01, steps=2000, every=7)
    exact = (response * np.exp(1j * np.outer(run.t, omega))).imag
    # The local error is below h⁵/24·(λ + ω)⁵, and what was made before decays with λ: a sum below 1/(λh) of it, times C's 3.
    bound = 3 * (0.01 * (1 / t2 + omega)) ** 5 / 24 / (0.01 / t2)
    assert (abs(run.z[:, 0] - exact) < bound).all()


def test_what_a_linear_system_does_not_have() -> None:
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 2}
    run, other = (sw.integrate(system, "rk4", **options) for system in (sw.LinearSystem(-np.eye(2)), sw.Oscillator()))
    has = r"LinearSystem\(2 states, 1 of them velocities, 0 inputs, 0 outputs\) has no"
    fast = sw.LinearSystem(-np.eye(2), [1.0, 0.0], x=sw.Sinusoid(1.0, 1e9))
    assert_raises(
        (lambda: run.energy, UnsupportedError, f"energy: {has} energy of its own"),
        (lambda: run.z, UnsupportedError, f"z: {has} auxiliary outputs"),
        (lambda: other.z, UnsupportedError, r"z: Oscillator\(.*\) has no auxiliary outputs"),
        (lambda: sw.integrate(fast, "rk4", **options, t0=1e9), ArgumentError, "a sinusoid's angle may grow to"),
    )


def test_names_of_inputs() -> None:
    A = -np.eye(2)
    assert sw.LinearSystem(A).input_names == ()
    assert sw.LinearSystem(A, [1.0, 2.0]).input_names == ("x",)
    assert sw.LinearSystem(A, np.ones((2, 1)), x=2.0).given_inputs()["x"].batch == ()
    two = sw.LinearSystem(A, np.ones((2, 2)), x=(None, sw.Sinusoid(1.0, [2.0, 3.0])))
    assert two.input_names == ("x[0]", "x[1]")
    assert list(two.given_inputs()) == ["x[1]"]
    assert two.batch == (2,)
    assert two.without_inputs().given_inputs() == {}
    pulse = two.with_pulse("x[0]", np.array([0.0, 1.0]), 0.5)
    assert list(pulse.given_inputs()) == ["x[0]"]
    assert pulse.batch == ()
    with pytest.raises(KeyError):
        two.with_pulse("x", np.array([1.0]), 0.5)


def test_one_input_in_each_of_its_spellings() -> None:
    A, b = -np.eye(2), np.array([1.0, 2.0])
    for B, x in itertools.product((b, b[:, np.newaxis]), (0.5, [0.5], (0.5,), [sw.Sampled([0.5], 1.0)])):
        run = sw.integrate(sw.LinearSystem(A, B, x=x), "rk4", v=0.0, y=0.0, dt=0.1, steps=50)
        assert (run.v.shape, run.y.shape) == ((1, 1), (1, 1))
        # Towards B·x; RK4's error is far below this exponential's distance from its end at t = 5.
        np.testing.assert_allclose([run.v[0, 0], run.y[0, 0]], 0.5 * b * (1 - np.exp(-5.0)), rtol=1e-6)
    members = sw.integrate(sw.LinearSystem(A, b, x=np.array([0.5, 1.0, 2.0])), "rk4", v=0.0, y=0.0, dt=0.1, steps=50)
    assert members.y.shape == (1, 1, 3)


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


def test_many_steps_at_once_are_a_power_of_the_matrix() -> None:
    """What the error says is to be written in place of the form that there was."""
    system, dt, n = sw.Oscillator(), 0.1, 1000
    with pytest.raises(UnknownNameError, match="form: there is no 'power' any more") as raised:
        sw.integrate(system, "rk4", v=0.3, y=1.0, dt=dt, steps=n, form="power")  # type: ignore[arg-type]
    for method in ("false_euler", "rk4", "exact"):
        run, state = sw.integrate(system, method, v=0.3, y=1.0, dt=dt, steps=n), np.array([0.3, 1.0])
        places = {"np": np, "sw": sw, "system": system, "method": method, "dt": dt, "n": n, "state": state}
        power, matrix = str(raised.value).split("steps are ")[1].split(", with P = ")
        places["P"] = eval(matrix, places)
        np.testing.assert_allclose(eval(power, places), [run.v[-1], run.y[-1]], rtol=0.0, atol=1e-12)
