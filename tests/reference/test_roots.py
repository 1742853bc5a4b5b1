"""1/r³ of r²: how right the core's root and division are, and the sequences without either that are kept for comparison."""

import decimal
from collections.abc import Iterator
from decimal import Decimal
from typing import Any

import numpy as np
import pytest

from benches.roots import SEQUENCES, A, Sequence, computed, operations

BY_NAME = {sequence.name: sequence for sequence in SEQUENCES}
U = 2.0**-53
#: The error of y³·(A − x·y²) is −½ of that of y², and 1.5 of that of x·y². This is above 1, so rounded by U at most, of which
#: what remains when it is taken from A, 0.784, feels 1.276; y³ and the last product are rounded by U; and A has 53 bits.
LAST_ROUNDINGS = (0.5 + 1.276 + 1.0 + 1.0 + 0.32) * U
#: The relative error of y before the last step, from the best polynomial on the range of s; 1/√x³ feels 7.5 times its square.
#: Newton's step makes 1.5·(2.7e-5)² of the one before it.
ERRORS_OF_Y = {"degree 2": 1.86e-5, "degree 3": 4.43e-7, "degree 5": 2.95e-10, "degree 2, Newton": 1.1e-9}
BOUNDS = {name: 7.5 * off**2 + LAST_ROUNDINGS for name, off in ERRORS_OF_Y.items()}
#: Degree 4 has a y that is off by 1.12e-8, which makes an error of one sign. A is raised by two units of 2⁻⁵², and the result by
#: 2.5/A of them, so that errors have both signs: the larger of what remains of one and of what was raised counts.
RAISED = 2.5 * 2 * 2.0**-52 / float(A)
BOUNDS["degree 4"] = max(7.5 * 1.12e-8**2 - RAISED, RAISED) + LAST_ROUNDINGS
#: Root, product and division are rounded by U each. In a step of Newton y² and ½x·y² ≈ ½ are rounded by U of ½, the difference
#: and the product with y by U: 3·U, thrice that in y³, and two more products.
BOUNDS |= {"root and division": 3 * U, "4 × Newton, y³": 11 * U}
#: The error of y² is in y³ and, with the other sign, 1.5 times in the correction; y³ and the sum are rounded by U, and 315/128·e⁴
#: is left out. Roundings within the correction are of its size.
BOUNDS["fused=True"] = (0.5 + 1.0 + 1.0 + 5.1e-5 * 4) * U + 315 / 128 * 5.1e-5**4


@pytest.fixture(autouse=True)
def fifty_digits() -> Iterator[None]:
    with decimal.localcontext(prec=50):
        yield


def arguments(many: int) -> Any:
    """From 1 to 4: of four times as much start and roundings are the same. Dense, at random, and at the ends."""
    rng = np.random.default_rng(8)
    ends = np.concatenate([edge + np.arange(-20, 21) * 2.0**-51 for edge in (1.0 + 20 * 2.0**-51, 2.0, 4.0 - 40 * 2.0**-51)])
    return np.concatenate([np.linspace(1.0, 4.0, many, endpoint=False), rng.uniform(1.0, 4.0, many), ends])


def worst(sequence: Sequence, x: Any) -> float:
    """The largest relative error of 1/√x³."""
    off = 0.0
    for f, a in zip(computed(sequence, x).tolist(), x.tolist(), strict=True):
        exact = Decimal(a) * Decimal(a).sqrt()
        off = max(off, abs(float(Decimal(f) * exact - 1)) if np.isfinite(f) else np.inf)
    return off


def test_the_constant_of_the_last_step() -> None:
    """A belongs to (3/2)^(1/5): there the derivative of y³·(A − x·y²) by y is zero, and its value is 1/√x³."""
    scale = Decimal("1.5") ** (Decimal(1) / 5)
    assert abs(float(Decimal(float(A)) - Decimal(5) / 3 * scale * scale)) * 1.276 <= 0.32 * U


@pytest.mark.parametrize("name", BY_NAME)
def test_errors_are_within_their_bounds_and_reach_them(name: str) -> None:
    assert 0.6 * BOUNDS[name] < worst(BY_NAME[name], arguments(5000)) <= BOUNDS[name]


def test_operations_are_counted() -> None:
    assert {name: operations(each) for name, each in BY_NAME.items()} == {
        "root and division": (3, 3), "4 × Newton, y³": (22, 15), "degree 2": (14, 8), "degree 3": (16, 9), "degree 4": (18, 9),
        "degree 2, Newton": (18, 11), "degree 5": (19, 10), "fused=True": (15, 12),
    }  # fmt: skip


MUTANTS = [
    ("0x5FE3DAB601F49400", "0x5FE6EB50C7B537A9", "the start of Newton's steps"),
    ("0x5FE3DAB601F49400", "0x5FF3DAB601F49400", "twice the start"),
    ("8.9473598635212482", "8.9473698635212482", "a digit of the first coefficient"),
    ("4.81009220396059078", "4.81009820396059078", "a digit of the second"),
    ("36.0957951249926805", "36.0957851249926805", "a digit of the third"),
    ("0.784830735739541551", "0.784831735739541551", "a digit of the fourth"),
    ("2.13644859736149098", "2.13645859736149098", "a digit of the fifth"),
    (A, "1.9601317042077897", "A two units too large"),
    ("y = y * (((u", "z = y * (((u", "the polynomial left out"),
    ("f = (q * y)", "f = 0.784 * (q * y) + 0.0 * (q * y)", "the last step left out"),
]


@pytest.mark.mutant
@pytest.mark.parametrize(("old", "new", "mistake"), MUTANTS, ids=[mistake for _, _, mistake in MUTANTS])
def test_mistakes_are_noticed(old: str, new: str, mistake: str) -> None:
    right = BY_NAME["degree 5"]
    assert right.text.count(old) == 1
    with np.errstate(all="ignore"):
        assert worst(Sequence(mistake, right.text.replace(old, new)), arguments(1000)) > BOUNDS["degree 5"]


def test_edges() -> None:
    """Root and division give ∞ of 0 and 0 of ∞. The others are not finite there, and nowhere finite and wrong."""
    least, most = 5e-324, np.finfo(float).max
    edges = np.array([0.0, least, 1e-310, 1e-300, 1e-206, 1e206, 1e250, most, np.inf, np.nan])
    with np.errstate(all="ignore"):
        for name, sequence in BY_NAME.items():
            f = computed(sequence, edges)
            assert not np.isfinite(f[:5]).any(), name
            assert np.all(np.abs(f[5:8]) <= 3e-309), name
            assert np.isnan(f[9]), name
        f = computed(BY_NAME["root and division"], edges)
        assert (f[0], f[8]) == (np.inf, 0.0)
        assert not np.isfinite(computed(BY_NAME["degree 5"], edges)[8])
