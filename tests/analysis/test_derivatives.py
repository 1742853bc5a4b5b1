"""Derivatives of tapes: every rule against differences or closed forms, and what has no derivative."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from stepwell import _core
from stepwell.analysis.derivatives import Evaluation, directional, gradient, jacobian
from stepwell.errors import UnsupportedError
from stepwell.reference import bits, functions, marks, trig
from stepwell.reference.functions import logarithms
from stepwell.reference.log import log
from stepwell.reference.tape import rules
from support.differences import central
from support.looped import looped
from support.refusals import refused

EPS = np.finfo(float).eps
#: Long doubles where the machine has them, else doubles: the differences' bound knows which.
Long = np.longdouble
LONG_EPS = float(np.finfo(Long).eps)


def value(tape: Any, symbols: list[Any], *state: Any, numbers: Any = None) -> list[Any]:
    return Evaluation(tape, symbols, numbers or {})([np.asarray(each, dtype=float) for each in state])


OPERATIONS: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "sums and products": (lambda x, y: x * y + x - y * 3.0, lambda x, y: (y + 1, x - 3)),
    "quotient": (lambda x, y: x / (x + y), lambda x, y: (y / (x + y) ** 2, -x / (x + y) ** 2)),
    "constant over": (lambda x, y: 2.0 / x - y / 4.0, lambda x, y: (-2 / x**2, -0.25 + 0 * y)),
    "root": (lambda x, y: (x * x + y * y).sqrt(), lambda x, y: (x / np.hypot(x, y), y / np.hypot(x, y))),
    "negation": (lambda x, y: -(x * y) - -x, lambda x, y: (1 - y, -x)),
    "squares": (lambda x, y: x * x * x * y, lambda x, y: (3 * x * x * y, x**3)),
    "choice": (
        lambda x, y: (x < y).choose(x * y, x / y),
        lambda x, y: (np.where(x < y, y, 1 / y), np.where(x < y, x, -x / y**2)),
    ),
    "of one way": (lambda x, y: (x <= 1.0).choose(x, 5.0) + y, lambda x, y: (np.where(x <= 1, 1.0, 0.0), 1 + 0 * y)),
    "both masks": (
        lambda x, y: ((x < 1.0) & ~(y < 1.0)).choose(x, y),
        lambda x, y: (1.0 * ((x < 1) & (y >= 1)), 1.0 * ~((x < 1) & (y >= 1))),
    ),
}

X, Y = np.random.default_rng(1).uniform(0.2, 3.0, (2, 50))


@looped("name", OPERATIONS)
def test_operations_have_their_closed_forms(name: str) -> None:
    f, slopes = OPERATIONS[name]
    tape = _core.Tape()
    x, y = tape.state(0), tape.state(1)
    back = value(tape, gradient(tape, f(x, y), [x, y]), X, Y)
    (both,) = jacobian(tape, [f(x, y)], [x, y])
    one, zero = tape.number(1.0), tape.number(0.0)
    forth = [directional(tape, [f(x, y)], [(x, a), (y, b)])[0] for a, b in ((one, zero), (zero, one))]
    for derivatives in (back, value(tape, both, X, Y), value(tape, forth, X, Y)):
        for each, true in zip(derivatives, slopes(X, Y), strict=True):
            # Some ten roundings of numbers below 100, which is above x³y and all others, beside those of the closed form.
            np.testing.assert_allclose(np.broadcast_to(each, X.shape), true, rtol=0, atol=20 * EPS * 100)


def test_the_way_not_taken_does_not_count() -> None:
    """√x below 0 has no derivative: nothing of it comes through a choice, forwards or backwards, nested or shared."""
    tape = _core.Tape()
    x = tape.state(0)
    root = x.sqrt()
    both = (x < 0.0).choose(-x, root)
    shared = both + (x < 1.0).choose(0.0, root * root) + (x < 0.0).choose(x, (x < 2.0).choose(root, 1.0 / root))
    at = np.array([-4.0, 0.25, 1.44, 4.0])
    slope = np.array([-1 + 1, 0.5 / 0.5 + 0.5 / 0.5, 0.5 / 1.2 + 1 + 0.5 / 1.2, 0.25 + 1 - 0.5 / 8])
    seed = tape.number(1.0)
    for derivatives in (gradient(tape, shared, [x]), directional(tape, [shared], [(x, seed)])):
        np.testing.assert_allclose(value(tape, derivatives, at)[0], slope, rtol=8 * EPS)


def test_derivatives_of_derivatives() -> None:
    tape = _core.Tape()
    x, y = tape.state(0), tape.state(1)
    with marks.recording() as known:
        f = trig.sin(x * y) / (x + y)
    first = gradient(tape, f, [x, y], known)
    hessian = jacobian(tape, first, [x, y], known)
    second = np.array([value(tape, row, X, Y) for row in hessian])
    s, c, p, q = np.sin(X * Y), np.cos(X * Y), X * Y, X + Y
    of_xx = -Y * Y * s / q - 2 * Y * c / q**2 + 2 * s / q**3
    of_yy = -X * X * s / q - 2 * X * c / q**2 + 2 * s / q**3
    of_xy = (c - p * s) / q - X * c / q**2 - Y * c / q**2 + 2 * s / q**3
    # Twenty roundings and the sine's own ulp, of terms below 40: 2s/q³ at q = 0.4 is above all others.
    np.testing.assert_allclose(second, [[of_xx, of_xy], [of_xy, of_yy]], rtol=0, atol=30 * EPS * 40)
    np.testing.assert_allclose(second[0, 1], second[1, 0], rtol=0, atol=30 * EPS * 40)


def test_with_respect_to_anything_on_the_tape() -> None:
    """A parameter, the step, and a value in between, which is then a number of its own."""
    tape = _core.Tape()
    x, p, h = tape.state(0), tape.param(0), tape.step()
    inner = x * p
    f = inner * inner + h * x
    derivatives = Evaluation(tape, gradient(tape, f, [p, h, inner, x]), {0: np.array(3.0)})([np.array(2.0)], 0.0, 0.5)
    # Beside ``inner``, x counts only where it stands by itself.
    assert [float(each) for each in derivatives] == [0.0, 2.0, 12.0, 0.5]
    derivatives = Evaluation(tape, gradient(tape, f, [p, x]), {0: np.array(3.0)})([np.array(2.0)], 0.0, 0.5)
    assert [float(each) for each in derivatives] == [24.0, 36.5]


def test_the_shorter_way_is_taken() -> None:
    """One value of many numbers is differentiated backwards, many values of one number forwards: the tape tells by its length."""

    def added(many: bool) -> int:
        tape = _core.Tape()
        x = [tape.state(i) for i in range(30)]
        if many:
            roots = [x[0]]
            for i in range(1, 30):
                roots.append(roots[-1] * x[0] + float(i))
            before, wrt = len(tape), x[:1]
        else:
            roots = [x[0]]
            for each in x[1:]:
                roots = [roots[0] * each]
            before, wrt = len(tape), x
        jacobian(tape, roots, wrt)
        return len(tape) - before

    # Either way a product has two factors, and each is used once or twice a line: four operations a line, where the other way
    # takes one a line for each of thirty numbers or values.
    assert added(many=True) <= 4 * 30
    assert added(many=False) <= 4 * 30


def _sign(x: Any) -> Any:
    return np.where(x < 0, -1.0, 1.0)


#: Of each function what NumPy has for it, and where it is tried; none of the points is where it jumps or has a corner.
SPREAD = [-2.3, -0.7, -0.2, 0.3, 0.9, 2.6]
UNIT, ABOVE = [-0.9, -0.4, 0.1, 0.8], [0.1, 0.7, 1.4, 5.0]
PAIRS = [(0.3, 1.2), (-0.7, 0.6), (1.9, -0.8), (-1.5, -2.2)]
TRIED: dict[str, tuple[Callable[..., Any], Any]] = {
    **{
        name: (getattr(np, name), SPREAD)
        for name in ["sin", "cos", "tan", "arctan", "sinh", "cosh", "tanh", "exp", "exp2", "expm1", "cbrt", "square"]
    },
    **{name: (getattr(np, name), SPREAD) for name in ["abs", "sign", "floor", "ceil", "trunc"]},
    **{name: (getattr(np, name), UNIT) for name in ["arcsin", "arccos"]},
    **{name: (getattr(np, name), ABOVE) for name in ["log", "log2", "log10", "log1p", "sqrt"]},
    **{
        name: (getattr(np, name), PAIRS)
        for name in ["arctan2", "hypot", "logaddexp", "copysign", "minimum", "maximum", "mod", "remainder"]
    },
    "round": (np.rint, SPREAD),
    "power": (np.power, [(0.4, 1.7), (1.3, -2.2), (2.4, 0.5), (3.0, 3.0)]),
    "clip": (np.clip, [(0.3, -1.0, 1.0), (1.7, -1.0, 1.0), (-2.1, -1.0, 1.0)]),
}


class Standing:
    """Functions of symbols whose values NumPy finds at once: they stand on the tape as parameters, and are marked."""

    def __init__(self, tape: Any, state: list[Any]) -> None:
        self.tape, self.state, self.numbers = tape, state, {}

    def __call__(self, name: str) -> Callable[..., Any]:
        def function(*arguments: Any) -> Any:
            values = [
                value(self.tape, [each], *self.state, numbers=self.numbers)[0] if isinstance(each, _core.Symbol) else each
                for each in arguments
            ]
            k = len(self.numbers)
            self.numbers[k] = np.asarray(TRIED[name][0](*values), dtype=float)
            return marks.mark(name, self.tape.param(k), *arguments)

        return function


@looped("name", rules.PARTIALS)
def test_every_rule_is_that_of_its_function(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """First derivatives against differences of NumPy's function, whether stepwell has that function already or not."""
    assert_rule(name, monkeypatch)


def assert_rule(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    f, points = TRIED[name]
    at = np.array(points, dtype=float).reshape(len(points), -1).T
    tape = _core.Tape()
    standing = Standing(tape, list(at))
    for each in TRIED:
        monkeypatch.setitem(marks.FUNCTIONS, each, standing(each))
    x = [tape.state(i) for i in range(len(at))]
    with marks.recording() as known:
        result = standing(name)(*x)
    derivatives = value(tape, gradient(tape, result, x, known), *at, numbers=standing.numbers)
    for i in range(len(at)):

        def along(z: Any, i: int = i) -> Any:
            return f(*(z if k == i else each.astype(Long) for k, each in enumerate(at)))

        # NumPy's long functions are good to some ulps, and x ± δ to half of one: 8 eps of the value in all.
        step = Long(LONG_EPS ** (1 / 3)) * np.abs(at[i]).astype(Long)
        true, bound = central(along, at[i].astype(Long), step, 8 * LONG_EPS * (1.0 + np.abs(at[i])))
        # The rule itself is made of some five double operations on values that NumPy rounds to an ulp or two.
        bound = bound + 16 * EPS * (1.0 + np.abs(true)) * (1.0 + np.abs(np.broadcast_to(derivatives[i], true.shape)))
        assert (np.abs(derivatives[i] - true) <= bound).all(), (name, i, derivatives[i], true, bound)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("name", "wrong"),
    [("sin", (lambda f, y, x: -f("cos")(x),)), ("tanh", (lambda f, y, x: 1.0 - y,)), ("floor", (lambda f, y, x: 1.0,))],
)
def test_a_wrong_rule_is_found(name: str, wrong: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(rules.PARTIALS, name, wrong)
    with pytest.raises(AssertionError):
        assert_rule(name, monkeypatch)


@looped("name", rules.PARTIALS)
def test_elementary_functions_have_their_derivatives(name: str) -> None:
    """Those of ``reference.functions`` as they are traced, forwards and backwards, against NumPy's."""
    f, points = TRIED[name]
    at = np.array(points, dtype=float).reshape(len(points), -1).T
    tape = _core.Tape()
    x = [tape.state(i) for i in range(len(at))]
    with marks.recording() as known:
        result = (logarithms.logaddexp if name == "logaddexp" else getattr(functions, name))(*x)
    back = value(tape, gradient(tape, result, x, known), *at)
    one = tape.number(1.0)
    for i in range(len(at)):

        def along(z: Any, i: int = i) -> Any:
            return f(*(z if k == i else each.astype(Long) for k, each in enumerate(at)))

        step = Long(LONG_EPS ** (1 / 3)) * np.abs(at[i]).astype(Long)
        true, bound = central(along, at[i].astype(Long), step, 8 * LONG_EPS * (1.0 + np.abs(at[i])))
        bound = bound + 16 * EPS * (1.0 + np.abs(true)) ** 2  # as in ``assert_rule``
        (forth,) = value(tape, directional(tape, [result], [(x[i], one)], known), *at)
        for derivative in (back[i], forth):
            assert (np.abs(derivative - true) <= bound).all(), (name, i, derivative, true, bound)


def test_powers_with_known_exponents() -> None:
    """Also of 0, whose logarithm is infinite, and to the power 0, whose derivative is 0."""
    tape = _core.Tape()
    x = tape.state(0)
    at = np.array([0.0, 2.0])
    for p, true in ((0, [0.0, 0.0]), (1, [1.0, 1.0]), (2.0, [0.0, 4.0])):
        with marks.recording() as known:
            result = marks.mark("power", tape.param(p if isinstance(p, int) else 7), x, p)
        np.testing.assert_array_equal(np.broadcast_to(value(tape, gradient(tape, result, [x], known), at)[0], 2), true)


def test_functions_that_are_there_are_marked_in_a_recording() -> None:
    """Sine, cosine and logarithm as they are, on arrays of symbols too, and their derivatives to rounding."""
    tape = _core.Tape()
    x = tape.state(0)
    with marks.recording() as known:
        roots = [trig.sin(x), trig.cos(x), log(x)]
        (beside,) = trig.sin(np.array([x * 2.0], dtype=object))
    derivatives = value(tape, [row[0] for row in jacobian(tape, [*roots, beside], [x], known)], X)
    for each, true in zip(derivatives, (np.cos(X), -np.sin(X), 1 / X, 2 * np.cos(2 * X)), strict=True):
        np.testing.assert_allclose(each, true, rtol=0, atol=8 * EPS * 5)  # 1/x is 5 at most
    tape = _core.Tape()
    trig.sin(tape.state(0))
    assert marks.active() is None
    with marks.recording() as known:
        assert trig.sin(np.array(1.0)) == trig.sin(np.array(1.0))
    assert known == {}


def test_what_the_tape_takes_for_an_earlier_value_keeps_its_derivative() -> None:
    """As maximum(x, x) is x: the mark would say that x is a function of itself."""
    tape = _core.Tape()
    x = tape.state(0)
    with marks.recording() as known:
        marks.mark("maximum", x * x, x * x, x * x)
    assert known == {}
    assert value(tape, gradient(tape, x * x, [x], known), 3.0)[0] == 6.0


@looped(
    "what, says",
    [
        (lambda tape, x: trig.sin(x), "rounds|exclusive or"),
        (lambda tape, x: (x * 0.5 + bits.DOUBLE.magic) - bits.DOUBLE.magic, "rounds"),
        (lambda tape, x: (x - 2.0**52) + 2.0**52, "rounds"),
        (lambda tape, x: x.and_bits(2**63 - 1), "and"),
        (lambda tape, x: x.or_bits(2**63), "or"),
        (lambda tape, x: bits.turn_sign(x, x + 1.0), "exclusive or|shift up"),
        (lambda tape, x: x.add_bits(1), "add bits"),
        (lambda tape, x: x.shift_down(1), "shift down"),
        (lambda tape, x: tape.sample(0, x), "sampled"),
        (lambda tape, x: (x < 1.0) & x, "and"),
        (lambda tape, x: marks.mark("no such function", x * 7.0, x), "no such function"),
        (lambda tape, x: marks.mark("sin", (x + 1.0) * 7.0, x, x + 1.0), "2 argument"),
    ],
)
def test_what_has_none_says_so(what: Callable[..., Any], says: str) -> None:
    """Forwards and backwards: never a number that is silently wrong."""
    tape = _core.Tape()
    x = tape.state(0)
    marked = "function" in says or "argument" in says
    with marks.recording() as known:
        result = what(tape, x)
    recorded = known if marked else {}
    for differentiate in (
        lambda: gradient(tape, result, [x], recorded),
        lambda: jacobian(tape, [result], [x], recorded),
        lambda: directional(tape, [result], [(x, tape.number(1.0))], recorded),
    ):
        refused(UnsupportedError, says, differentiate)


def test_what_does_not_change_may_be_made_of_anything_but_a_fused_tape() -> None:
    """Of time, parameters and what only decides: no derivative passes there."""
    tape = _core.Tape()
    x, t = tape.state(0), tape.time()
    f = x * t.floor() + (x.floor() < 1.0).choose(x, 2.0 * x) + tape.sample(0, t) * 0.0
    tables = [type("Table", (), {"sample": staticmethod(lambda t: 5.0)})]
    derivatives = Evaluation(tape, gradient(tape, f, [x]), {}, tables)([np.array([0.5, 1.5])], 3.7)[0]
    np.testing.assert_array_equal(derivatives, [4.0, 5.0])
    # So that of ⌊x⌋·x is ⌊x⌋.
    tape = _core.Tape()
    x = tape.state(0)
    assert value(tape, gradient(tape, x.floor() * x, [x], {}), 2.5)[0] == 2.0
    tape = _core.Tape()
    x, y = tape.state(0), tape.state(1)
    fused, (root,) = tape.fused([x * y + x])
    refused(UnsupportedError, "fused", gradient, fused, root, [fused.state(0)])
