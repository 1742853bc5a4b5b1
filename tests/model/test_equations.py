"""Own equations: what a function may be, what it is given, what cannot be traced and what the user then reads."""

from __future__ import annotations

import copy
import math
import pickle
import re
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, TraceError, UnknownNameError, UnsupportedError
from support import own_systems as own
from support.calls import assert_raises
from support.for_each import for_each
from support.ways import assert_equal_ways


def run(system: Any, method: str = "rk4", **options: Any) -> sw.Run:
    """Ten steps."""
    return sw.integrate(system, method, **{"dt": 0.05, "steps": 10, "every": 3, **options})


# ---- what it is


def test_an_own_pendulum_is_the_built_in_one() -> None:
    """ω² is multiplied with the step at another place, so by rounding alone."""
    mine = sw.integrate(own.pendulum(omega=1.3), "rk4", v=0.0, y=2.0, dt=0.01, steps=1000)
    theirs = sw.integrate(sw.Pendulum(1.3), "rk4", v=0.0, y=2.0, dt=0.01, steps=1000)
    # A thousand steps of some ten roundings each, of numbers up to 2; on such an orbit errors grow tenfold at most.
    assert abs(mine.y[-1] - theirs.y[-1]) < 1000 * 10 * 2.0 * 2**-53 * 10


def test_quick_sines_are_those_of_the_built_in_systems() -> None:
    """Then both pendulums are the same step but for where ω² is multiplied with the step: one operation more for each rate."""
    quick = sw.system(quick_sines=True)(lambda t, v, y, *, omega=1.0: -(omega * omega) * np.sin(y))
    y = np.linspace(-3.0, 3.0, 9)
    ours, theirs = (run(system, v=0.0, y=y) for system in (quick(omega=1.0), sw.Pendulum(1.0)))
    np.testing.assert_array_equal(ours.y[-1], theirs.y[-1])  # 1·1 is 1, whatever it is multiplied with next
    counted = [sw.explain(system, "rk4").computed for system in (quick(), sw.Pendulum())]
    assert sum(counted[0].values()) - sum(counted[1].values()) <= 4


def test_lorenz_against_many_digits() -> None:
    """At t = 1 from (1, 1, 1), as ``mpmath.odefun`` has it in 30 digits."""
    motion = sw.integrate(own.lorenz(), "dop853", y=np.ones(3), tolerance=1e-13, at=[1.0])
    # The flow stretches errors by less than exp(∫ λ) < 1e3 over this stretch, and 1e-13 is the error of a step.
    np.testing.assert_allclose(motion.y[-1], [-9.378570010925062, -8.357033788426644, 29.36232533736343], rtol=1e-9)


def test_a_first_order_system_has_no_velocities() -> None:
    motion = run(own.lorenz(rho=np.linspace(1.0, 30.0, 7)), y=np.ones(3))
    assert motion.y.shape == (5, 3, 7)
    assert motion.v.shape == (5, 0, 7)
    again = sw.integrate(own.lorenz(rho=np.linspace(1.0, 30.0, 7)), "rk4", resume=motion, dt=0.05, steps=1)
    assert again.start_step == 10
    with pytest.raises(ArgumentError, match=r"v: expected the velocities"):
        sw.integrate(own.duffing(), "rk4", y=1.0, dt=0.1, steps=1)


def test_the_state_has_as_few_axes_as_the_function_can_do_with() -> None:
    assert run(own.duffing(), v=0.0, y=np.ones(3)).system.y_shape == ()
    assert run(own.lorenz(), y=np.ones((3, 4))).system.y_shape == (3,)
    assert run(own.springs(), v=0.0, y=np.random.default_rng(0).normal(size=(5, 3, 2))).system.y_shape == (5, 3)
    motion = run(own.top(), v=np.ones((3, 2)), y=np.array([1.0, 0.0, 0.0, 0.0]))
    assert (motion.system.v_shape, motion.system.y_shape, motion.y.shape) == ((3,), (4,), (5, 4, 2))
    declared = sw.system(shape=(None, 2))(lambda t, v, y: -y)
    assert run(declared(), v=0.0, y=np.ones((3, 2))).system.y_shape == (3, 2)
    with pytest.raises(ShapeError, match=r"expected a state of the declared shape \(None, 2\), got .* y of shape \(3, 3\)"):
        sw.integrate(declared(), "rk4", v=0.0, y=np.ones((3, 3)), dt=0.1, steps=1)


def test_parameters_of_all_kinds() -> None:
    rng = np.random.default_rng(5)
    start = {"v": 0.0, "y": rng.normal(size=6)}
    sine = run(own.pushed(x=sw.Sinusoid(1.0, 2.0)), **start)
    function = run(own.pushed(x=lambda t: np.sin(2.0 * t)), **start)
    np.testing.assert_allclose(sine.y, function.y, rtol=1e-13)  # two sines, each right to a unit of the last place of 1
    run(own.pushed(x=sw.Sampled(rng.normal(size=(9, 6)), 0.1)), "verlet", **start)
    run(own.pushed(k=rng.uniform(size=6), x=2), **start)
    masses = run(own.attracted(masses=rng.uniform(size=(4, 5))), v=0.0, y=rng.normal(size=(4, 2, 5)))
    assert masses.y.shape == (5, 4, 2, 5)
    with pytest.raises(ShapeError, match=r"attracted: masses: expected 1 axes of its own"):
        own.attracted(masses=1.0)


def test_a_system_keeps_its_numbers_and_equal_systems_are_equal() -> None:
    beta = np.array([1.0, 2.0])
    system = own.duffing(beta=beta)
    before = run(system, v=0.0, y=1.0).y[-1].copy()
    beta[1] = 1.0
    after = run(system, v=0.0, y=1.0).y[-1]
    np.testing.assert_array_equal(after, before)
    assert own.duffing(beta=3.0) == own.duffing(beta=3.0) != own.duffing(beta=4.0)
    for again in (pickle.loads(pickle.dumps(system)), copy.deepcopy(system)):
        assert again == system
        np.testing.assert_array_equal(run(again, v=0.0, y=1.0).y[-1], after)
    bound = run(system, v=0.0, y=1.0).system
    assert pickle.loads(pickle.dumps(bound)) == bound
    run(pickle.loads(pickle.dumps(bound)), v=0.0, y=1.0)


def test_a_long_one_is_stepped_by_its_rates() -> None:
    """A ring of 1200 springs in space is past what becomes one tape for a step."""
    rng = np.random.default_rng(0)
    y = rng.normal(size=(1200, 3, 2))
    assert "not one tape" in str(sw.explain(own.springs().for_state_shapes(None, y[..., 0]), "rk4"))
    assert_equal_ways(own.springs(), "rk4", v=0.0 * y, y=y, dt=0.05, steps=2, ways=("by the reference",))


def test_functions_of_a_module_and_math_are_traced() -> None:
    """``network`` calls a function of its module, which calls ``math.sqrt``."""
    y = np.array([0.1, 0.2, 0.3])
    motion = run(own.network(weights=np.roll(np.eye(3), 1, axis=1)), "standard_euler", y=y, steps=1, every=None)
    x = np.roll(y, -1)
    np.testing.assert_allclose(motion.y[-1], y + 0.05 * (x / np.sqrt(1 + x * x) - y), rtol=1e-14)


def test_scipys_functions_are_taken_as_they_are() -> None:
    motion = sw.integrate(own.scipys(), "dop853", y=[0.0, 1.0], tolerance=1e-12, at=[1.0])
    np.testing.assert_allclose(motion.y[-1], [math.sin(1.0), math.cos(1.0)], rtol=1e-10)


ARRAYS = {
    "sum": lambda y: np.sum(y) * np.ones(3),
    "sum along an axis": lambda y: np.sum(np.outer(y, y), axis=1),
    "mean": lambda y: y - np.mean(y),
    "dot": lambda y: np.dot(y, y) * y,
    "matrix": lambda y: np.array([[1.0, 2.0, 3.0], [0.0, 1.0, 0.0], [2.0, 0.0, 1.0]]) @ y,
    "vector times matrix": lambda y: y @ np.arange(9.0).reshape(3, 3),
    "cross": lambda y: np.cross(y, [1.0, 2.0, 3.0]),
    "norm": lambda y: y / np.linalg.norm(y),
    "outer": lambda y: np.outer(y, y)[0],
    "stack": lambda y: np.stack([y[2], y[0], y[1]]),
    "concatenate": lambda y: np.concatenate([y[1:], y[:1]]),
    "roll": lambda y: np.roll(y, 1) - y,
    "slices": lambda y: y[::-1] * 2.0,
    "broadcasting": lambda y: (y[:, None] - y[None, :]).sum(axis=0),
    "where": lambda y: np.where(y > 0.2, y, -y),
    "minimum, maximum": lambda y: np.minimum(y, 0.1) + np.maximum(y, 0.2),
    "clip": lambda y: np.clip(y, -0.1, 0.25),
    "comparisons as numbers": lambda y: (y > 0.2) * y + (y == 0.5),
    "and, or, not": lambda y: np.where((y > 0.1) & ~(y > 0.4) | (y < -1.0), 1.0, y),
    "and, or of numbers": lambda y: np.where(
        (np.sqrt(0.2) < np.exp(1.1)) & (y > 0.1) | np.logical_or(np.False_, y < -1.0), 1.0, y
    ),
    "diff": lambda y: np.append(np.diff(y), 0.0) if not hasattr(y, "items") else np.concatenate([np.diff(y), [0.0]]),
    "cumsum": lambda y: np.cumsum(y),
    "prod, max, min": lambda y: y * np.prod(y) + np.max(y) - np.min(y),
    "powers": lambda y: y**2 + y**3 - 1.0 / (2.0 + y),
    "abs": lambda y: abs(y) + np.abs(y - 0.3),
    "floor": lambda y: np.floor(3.0 * y) + y // 0.25,
    "full": lambda y: np.full_like(y, 2.0) * y,
    "loops": lambda y: np.array([sum(y[j] * (j + 1) for j in range(i + 1)) for i in range(3)]),
    "linspace": lambda y: y * np.linspace(0.0, 1.0, 3) + np.zeros(3) + np.eye(3)[1],
    "reshape": lambda y: y.reshape(3, 1).T.ravel() + y.flatten(),
    "tile": lambda y: np.tile(y, 2)[1:4],
}


@for_each("name", ARRAYS)
def test_a_function_means_what_it_means_in_numpy(name: str) -> None:
    """Standard Euler with the step 1 from y gives y + f(y); NumPy gives f of the same numbers, but for the order of sums."""
    function, y = ARRAYS[name], np.array([0.5, -0.25, 0.125])
    last = run(sw.system(order=1)(lambda t, y: function(y))(), "standard_euler", y=y, dt=1.0, steps=1, every=None).y[-1]
    np.testing.assert_allclose(last, y + function(y), rtol=4e-16, atol=4e-16)


def branch(t: Any, v: Any, y: Any) -> Any:
    if y > 0.0:
        return -y
    return y


def writes(t: Any, v: Any, y: Any) -> Any:
    y[0] = 0.0
    return y


def fills(t: Any, v: Any, y: Any) -> Any:
    out = np.zeros(3)
    out[0] = y[1]
    return out


#: Functions that cannot be traced, and what is said of each.
REFUSED: list[tuple[Any, tuple[str, ...]]] = [
    (branch, ("line", "if y > 0.0:", "np.where")),
    (writes, ("line", "y[0] = 0.0", "np.stack")),
    (fills, ("line", "out[0] = y[1]", "np.stack")),
    (lambda t, v, y: -y * (0.0 < y < 1.0), ("line", "np.where", "&")),
    (lambda t, v, y: min(y, 0.0), ("line", "np.minimum")),
    (lambda t, v, y: float(y), ("line", "float()")),
    (lambda t, v, y: np.sinc(y), ("line", "np.sinc", "np.sin")),
    (lambda t, v, y: np.arange(3.0)[y], ("line", "index")),
    (lambda t, v, y: None, ("return",)),
    (lambda t, v, y: np.array([y, y]), ("shape ()", "(2,)")),
    (lambda t, v, y: undefined * y, ("line", "NameError", "undefined")),  # type: ignore[name-defined]  # noqa: F821
    (lambda t, v, y: np.random.default_rng().normal() * y, ("random",)),
    (lambda t, v, y: "y", ("str",)),
]


@for_each("function, words", REFUSED)
def test_what_cannot_be_traced_is_said_with_its_line(function: Any, words: tuple[str, ...]) -> None:
    with pytest.raises(ArgumentError) as raised:
        sw.integrate(sw.system(function)(), "rk4", v=0.0, y=np.ones(3) if function in (writes, fills) else 1.0, dt=0.1, steps=1)
    text = str(raised.value)
    assert function.__name__ in text
    for each in words:
        assert each in text, text
    if "line" in words:
        first = function.__code__.co_firstlineno
        (line,) = re.findall(r"test_equations\.py, line (\d+)", text)
        assert first <= int(line) <= first + 3


def caught(function: Any) -> Any:
    """Whatever it raises, some number."""

    def swallowing(y: Any) -> Any:
        try:
            return function(y)
        except BaseException:
            return 1.0

    return swallowing


def written(y: Any) -> Any:
    out = np.zeros(1)
    out[0] = y
    return out[0]


#: What is refused even if the function itself catches the error, or asks before.
SWALLOWED = [
    *map(caught, (float, lambda y: 1.0 if y > 0.0 else 2.0, np.sinc, written, lambda y: math.fsum([y, y]))),
    lambda y: getattr(y, "astype", lambda kind: 1.0)(float),
    lambda y: y if hasattr(y, "conj") else 1.0,
]


@for_each("function", SWALLOWED)
def test_in_rates_inputs_invariants_and_events(function: Any) -> None:
    @sw.system
    def own(t: Any, v: Any, y: Any) -> Any:
        return -function(y)

    start = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1}

    @sw.system
    def driven(t: Any, v: Any, y: Any, *, push: Any = 0.0) -> Any:
        return push - y

    low = sw.Event(lambda t, v, y: function(y), name="low")
    assert_raises(
        (lambda: sw.integrate(own, "rk4", **start), r"^own \(.*line \d+: .*\): .*(no number|no truth|own equations)"),
        (lambda: sw.integrate(driven(push=lambda t: function(t)), "rk4", **start), "driven: push"),
        (lambda: sw.integrate(driven, "rk4", **start, events=[low]), "events: low"),
        kind=TraceError,
    )

    @driven.invariant
    def energy(v: Any, y: Any) -> Any:
        return function(y)

    with pytest.raises(TraceError, match="driven: energy"):
        sw.integrate(driven, "rk4", **start, record="energy")


def test_an_error_of_ones_own_is_told_and_what_is_no_error_of_a_trace_may_be_caught() -> None:
    @sw.system
    def raising(t: Any, v: Any, y: Any) -> Any:
        try:
            return float(y)
        except ValueError as error:
            raise RuntimeError("not a number") from error

    with pytest.raises(TraceError, match="no number"):
        sw.integrate(raising, "rk4", v=0.0, y=1.0, dt=0.1, steps=1)

    @sw.system
    def looking(t: Any, v: Any, y: Any, *, table: Any = 2.0) -> Any:
        try:
            scale = {}["scale"]
        except KeyError:
            scale = table
        return -scale * y

    assert sw.integrate(looking, "standard_euler", v=0.0, y=1.0, dt=0.5, steps=1).v[-1] == -1.0


def test_parameters_may_have_any_name() -> None:
    @sw.system
    def spring(t: Any, v: Any, y: Any, *, name: Any = 1.0, function: Any = 1.0, quick_sines: Any = 1.0, values: Any = 1.0) -> Any:
        return -name * function * quick_sines * values * y

    runs = [sw.integrate(spring(**{name: 4.0}), "rk4", v=0.0, y=1.0, dt=0.1, steps=3) for name in spring.parameters]
    expected = sw.integrate(sw.Oscillator(2.0, form="physical"), "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
    for run in runs:
        np.testing.assert_allclose(run.y, expected.y, rtol=1e-12)


def lambda_of(name: str, arguments: str) -> Any:
    """A function with these arguments."""
    namespace: dict[str, Any] = {}
    exec(f"def {name}({arguments}):\n    return -y", namespace)
    return namespace[name]


@sw.system(order=1)
def turning(t: Any, y: Any) -> Any:
    return 1j * y


@sw.system(order=1)
def turned(t: Any, y: Any) -> Any:
    return np.array([[0.0, 1j], [-1j, 0.0]]) @ y


WRONG: list[tuple[Any, type[Exception], str]] = [
    (lambda: own.duffing(bta=1.0), UnknownNameError, r"duffing: there is no parameter 'bta'. Known: alpha, beta"),
    (lambda: own.duffing(beta=np.nan), NotFiniteError, r"duffing: beta: expected finite numbers, got nan"),
    (lambda: own.duffing(beta="x"), DTypeError, r"duffing: beta: expected real numbers"),
    (lambda: own.duffing(alpha=np.ones(2), beta=np.ones(3)), ShapeError, r"duffing: alpha .*duffing: beta"),
    (lambda: sw.system(lambda_of("f", "t, v, y, *, k")), ArgumentError, r"f: expected a default of the parameter k"),
    (lambda: sw.system(lambda_of("f", "t, y")), ArgumentError, r"f: expected a function \(t, v, y, \*, …\), got \(t, y\)"),
    (lambda: sw.system(lambda_of("f", "t, v, y, **rest")), ArgumentError, r"f: expected parameters with names"),
    (lambda: sw.system(3.0), DTypeError, r"function: expected a Python function"),  # type: ignore[call-overload]
    (lambda: sw.system(order=3), ArgumentError, r"order: expected 1"),
    (lambda: sw.system(order=1, blocks=2), ArgumentError, r"blocks: expected 1 with order=1"),
    (lambda: run(turning(), y=np.ones(2)), TraceError, r"turning .*: expected real .* a complex one; write the equations"),
    (lambda: run(sw.system(lambda t, y: [1j * y[0]], order=1), y=np.ones(1)), TraceError, "expected real .* a complex one;"),
    (lambda: run(sw.system(lambda t, y: [y[3]], order=1), y=np.ones(2)), TraceError, "index 3 is out of bounds .* with size 2"),
    (lambda: run(turned(), y=np.ones(2)), TraceError, "expected numbers in an array, got complex; write the equations"),
    (lambda: run(own.pushed(x=lambda t: np.sinc(t)), v=0.0, y=1.0), TraceError, r"pushed: x .*np\.sinc"),
]


def test_what_is_wrong_with_parameters() -> None:
    assert_raises(*WRONG)


def test_what_a_run_cannot_take() -> None:
    step: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1}
    wrapped, of_v = r"got the function branch; wrap it with sw.system\(branch\)", "forces that do not depend on the velocity, but"
    local = sw.system(lambda_of("local", "t, v, y"))
    assert_raises(
        (lambda: sw.integrate(branch, "rk4", **step), DTypeError, wrapped),  # type: ignore[arg-type]
        (lambda: sw.integrate(own.duffing(), "verlet", **step), UnsupportedError, f"verlet needs {of_v}"),
        (lambda: sw.integrate(own.lorenz(), "leapfrog", **step | {"y": np.ones(3)}), UnsupportedError, "needs a second-order"),
        (lambda: pickle.dumps(local()), ArgumentError, "local: .* pickled by the name of its f"),
    )
    sw.integrate(own.duffing, "rk4", **step)  # without parameters it need not be called


@pytest.mark.mutant
def test_a_wrong_rate_is_noticed() -> None:
    """The sign of one term."""
    wrong = sw.system(lambda t, v, y: 0.5 * np.cos(1.2 * t) - 0.3 * v + y + y**3)
    assert (run(wrong, v=0.0, y=1.0).y[1:] != run(own.duffing(), v=0.0, y=1.0, backend="numpy").y[1:]).all()


def test_a_scene_of_ones_own_in_three_lines() -> None:
    scene = sw.Scene(own.duffing(), v=0.0, y=1.0, until=10.0)
    advice = sw.advise(scene, frame=None, tolerance=1e-3)
    assert advice.best.error <= 1e-3
    first_order = sw.Scene(own.lorenz(), y=[1.0, 1.0, 1.0], until=2.0)
    assert sw.advise(first_order, frame=None, tolerance=1e-3).best.error <= 1e-3
