"""The promise: Rust equals the NumPy reference to the last bit, on every CPU level, thread count and batch."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from hypothesis import given, settings
from hypothesis import strategies as st
from stepwell.errors import UnsupportedError
from support import ROOT, families
from support.cases import SYSTEMS, Case, assert_same, cases, number, representative
from support.families import family
from support.ways import WAYS, assert_equal_ways

ALL = list(cases())

#: Systems of several kinds of kernels, of which the ordinary run takes one case of each, and one of each method.
FEW = ("free", "sampled x, sinusoid a", "pendulum, damped", "three bodies", "chain of five", "linear, two states", "own: Lorenz")


def sampled(salt: str, **several: int) -> Any:
    """Representative cases of few systems; the long run has all others."""
    chosen = set(representative((case for case in ALL if case.system in FEW), several, salt))
    return family((case for case in ALL if case.form in several), lambda case: case in chosen, str)


def ways_of(case: Case) -> list[str]:
    """A world has the direct form only."""
    return [way for way in WAYS if way != "in a world" or case.form == "direct"]


@pytest.mark.long
@pytest.mark.parametrize("case", ALL if families.LONG else [], ids=str)
def test_every_case_in_every_way(case: Case) -> None:
    """What test_ways.py samples, for all methods, systems, forms and starts, in both precisions."""
    for b, options in ((5, {}), (33, {}), (5, {"dtype": "float32", "fused": number(case) % 2 == 1})):
        if "dtype" in options and case.refused_in_float32():
            continue
        system, arguments = case.make(b)
        assert_equal_ways(system, ways=ways_of(case), **{"steps": 23, "every": 5, "t0": 0.3} | arguments | options)


@settings(max_examples=15, deadline=None)
@given(
    case=st.sampled_from(ALL),
    seed=st.integers(0, 2**32),
    b=st.integers(1, 300),
    dt=st.floats(1e-4, 3.0),
    t0=st.floats(-1e3, 1e6),
    start_step=st.integers(0, 10**9),
    every=st.sampled_from([None, 1, 2, 7]),
)
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning", "ignore::stepwell.AccuracyWarning")
def test_equals_the_reference_anywhere(case: Case, seed: int, b: int, **options: Any) -> None:
    options |= {"steps": 9}
    try:
        run = case.run(b, seed, **options)
    except UnsupportedError as refused:  # steps so long that a bounce adds energy, by either backend
        if "solves for the springs without the surfaces" not in str(refused):
            raise
        with pytest.raises(UnsupportedError, match=re.escape(str(refused))):
            case.run(b, seed, **options, backend="numpy")
        return
    assert_same(run, case.run(b, seed, **options, backend="numpy"))


@pytest.mark.parametrize("case", sampled("diverging members too", direct=1))
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning", "ignore::stepwell.AccuracyWarning")
def test_diverging_members_too(case: Case) -> None:
    """Steps far past every limit: the same overflow in the same step. In the long run in float32, too."""
    options: dict[str, Any] = {"dt": 60.0, "steps": 60, "every": 15}
    for dtype in ("float64", "float32") if families.LONG and not case.refused_in_float32() else ("float64",):
        run, again = (case.run(70, **options, dtype=dtype, backend=backend) for backend in ("rust", "numpy"))
        assert_same(run, again)


@pytest.mark.parametrize(
    ("dtype", "scales"), [("float64", (5e-324, 1e-308, 1e-160, 1e160, 1e300)), ("float32", (1e-45, 1e-38, 1e-30, 1e30, 3e37))]
)
def test_extremes_of_size(dtype: str, scales: tuple[float, ...]) -> None:
    """Denormal numbers and huge ones: no level flushes to zero."""
    for scale in scales:
        v, y = scale * np.linspace(-1, 1, 50), np.full(50, scale)
        ways = ("by the reference", "at each level")
        assert_equal_ways(sw.Oscillator(1.3, 0.1), "rk4", ways=ways, v=v, y=y, dt=0.1, steps=50, every=1, dtype=dtype)


def test_the_sine_is_the_same() -> None:
    """Through a system, because there is no other way in: v after one step from rest is the sine of each phase."""
    rng = np.random.default_rng(1)
    near = np.pi * rng.integers(-(10**6), 10**6, 5000) / 2.0
    sizes = rng.choice([-1.0, 1.0], 20_000) * 2.0 ** rng.uniform(-60.0, 49.0, 20_000)
    phases = np.concatenate([sizes, near, np.nextafter(near, 0.0), [0.0, -0.0, 5e-324, 2.0**49]])
    system = sw.Oscillator(1.0, a=sw.Sinusoid(1.0, 0.0, phases))
    options = {"v": np.zeros(phases.size), "y": np.zeros(phases.size), "dt": 1.0, "steps": 1}
    assert_equal_ways(system, "standard_euler", ways=("by the reference", "at each level"), **options)


def test_nothing_in_the_core_breaks_the_promise() -> None:
    """The grep gate: no contraction, no library power or trigonometry, no reordered sum, unsafe in four files only."""
    forbidden = (
        "mul_add", "powi(", "powf(", ".recip()", ".dot(", ".norm(", ".norm_squared(", ".normalize(", ".sum()", ".sin()", ".cos()",
        ".exp()", "fast-math",
    )  # fmt: skip
    core = ROOT / "rust"
    files = sorted(core.glob("*/src/**/*.rs"))
    assert len(files) > 20
    for path in files:
        code = path.read_text().split("#[cfg(test)]")[0]
        lines = [line.split("//")[0] for line in code.splitlines()]
        # What a fused multiply-add is stands where operations are; beside fused tapes the forces of bodies have some,
        # and the inverse of a number in two parts needs its exact remainder.
        known = ("eval.rs", "number.rs", "tape.rs", "bodies.rs", "quotients.rs")
        wrong = [word for word in forbidden if word != "mul_add" or path.name not in known]
        breaches = [f"{path.name}:{i}: {line}" for i, line in enumerate(lines, 1) for word in wrong if word in line]
        # What a CPU can do is asked, code is written and run, and one name is a C library's.
        if path.name not in ("isa.rs", "memory.rs", "pages.rs", "fused.rs"):
            breaches += [f"{path.name}:{i}: {line}" for i, line in enumerate(lines, 1) if "unsafe" in line]
        assert not breaches


def test_the_reference_sums_in_a_written_order() -> None:
    """NumPy's sum, dot and matmul reorder; ``**`` is not a product. The reference may use none of them."""
    forbidden = (".sum(", ".dot(", " @ ", "einsum", "np.sin", "np.cos", "math.sin", "math.cos", "fma")
    sought = {word: re.compile(rf"\b{word}\b" if word.isalpha() else re.escape(word)) for word in forbidden}
    folder = Path(sw.__file__).parent / "reference"
    for path in sorted(folder.rglob("*.py")):
        # What a fused multiply-add is stands in one file; the operations name it, and a product that is to be fused.
        # Its exact products are what the exponential of a matrix is computed with.
        # Constants may be powers of two.
        known = ("fma.py", "bits.py", "operations.py", "product.py", "exact.py")
        wrong = [word for word in forbidden if word != "fma" or path.name not in known]
        text = re.sub(r"2\.0\*\*-?\d+", "", path.read_text())
        assert not [word for word in wrong if sought[word].search(text)], path.name
        # A power is of a number: stars of arguments stand after a comma or a bracket.
        assert not re.search(r"[\w)\]] ?\*\*", text), path.name


def test_every_variant_is_tried() -> None:
    """A system without a case here would not be compared with the reference."""
    from stepwell import _core

    rng = np.random.default_rng()
    assert {make(rng, 1).kernel for make in SYSTEMS.values()} == set(_core.systems())
