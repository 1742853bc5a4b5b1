"""The promise: Rust equals the NumPy reference to the last bit, on every CPU level, thread count and batch."""

from __future__ import annotations

import itertools
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from hypothesis import given, settings
from hypothesis import strategies as st
from stepwell.base.immutable import changed
from stepwell.model.around import Part
from support import ROOT, families
from support.cases import SYSTEMS, Case, assert_same, by_both_backends, cases, number, representative, thinned

ALL = list(cases())
DIRECT = [c for c in ALL if c.form == "direct"]

#: By default every system and every method so many times in each form, each test with cases of its own; all in the long run.
SOME = {"direct": 1, "matrix": 1, "power": 1}


#: By default in float32 one case of each in each form, half of them fused; the power of a matrix is in float64 only.
IN_FLOAT32 = set(representative((case for case in ALL if case.form != "power"), SOME, "float32 equals the reference"))


@pytest.mark.parametrize("case", thinned(ALL, SOME | {"direct": 2}, "equals the reference"))
def test_equals_the_reference(case: Case) -> None:
    # A single member; a lane group with one idle lane, a full one or one member too many; several groups.
    for b in (1, 31, 32, 33, 257) if families.LONG else ((1, 31, 32, 33)[number(case) % 4], 257):
        assert_same(case.run(b), case.run(b, backend="numpy"))


@pytest.mark.parametrize(
    ("case", "fused"),
    families.family(
        itertools.product((case for case in ALL if case.form != "power"), (False, True)),
        lambda case, fused: case in IN_FLOAT32 and fused is bool(number(case, "fused") % 2),
        lambda case, fused: f"{case}{', fused' * fused}",
    ),
)
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning", "ignore::stepwell.AccuracyWarning")
def test_equals_the_reference_in_float32(case: Case, fused: bool) -> None:
    if why := case.refused_in_float32():
        assert "dtype: " in why
        return
    for b in (1, 33) if families.LONG else (33 if number(case) % 2 else 1,):
        run, again = (case.run(b, dtype="float32", fused=fused, backend=backend) for backend in ("rust", "numpy"))
        assert run.y.dtype == run.v.dtype == again.y.dtype == again.v.dtype == np.float32
        assert_same(run, again)


@pytest.mark.parametrize("case", thinned(ALL, SOME, "does not depend on the cpu level"))
def test_does_not_depend_on_the_cpu_level(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    best = case.run(161)
    for level in sw.isa_levels():
        monkeypatch.setenv("STEPWELL_KERNELS", level)
        assert sw.isa() == level
        assert_same(case.run(161), best)
        assert_same(case.run(3), case.run(3, backend="numpy"))


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning", "ignore::stepwell.AccuracyWarning")
@pytest.mark.parametrize(
    "case", thinned((case for case in ALL if case.form != "power"), SOME, "float32 does not depend on the kernels")
)
def test_machine_code_equals_the_interpreter_in_float32(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """By so many steps that machine code is written; saved at every step and at some."""
    if case.refused_in_float32():
        return
    for b, every in ((1, 7), (37, 1), (300, 7)):
        options = {"steps": 410, "every": every, "dtype": "float32", "dt": 0.02}
        runs = []
        for level in sw.isa_levels():
            monkeypatch.setenv("STEPWELL_KERNELS", level)
            runs.append(case.run(b, **options))
        for run in runs[1:]:
            assert_same(run, runs[0])


@pytest.mark.parametrize("case", thinned(ALL, SOME, "does not depend on threads"))
def test_does_not_depend_on_threads(case: Case) -> None:
    one = case.run(700, threads=1)
    for threads in (2, 7):
        assert_same(case.run(700, threads=threads), one)


@pytest.mark.parametrize("case", thinned(ALL, SOME, "does not depend on company"))
def test_does_not_depend_on_company(case: Case) -> None:
    together = case.run(90)
    system, arguments = case.make(90)
    for i in (0, 7, 63, 89):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.AccuracyWarning)  # of bodies that met, which is told of a single member
            alone = sw.integrate(
                _member(system, i, 90),
                **(arguments | {"v": arguments["v"][..., i], "y": arguments["y"][..., i]}),
                steps=23,
                every=5,
            )
        np.testing.assert_array_equal(alone.y, together.y[..., i])
        np.testing.assert_array_equal(alone.v, together.v[..., i])


@pytest.mark.parametrize(("case", "backend"), by_both_backends(ALL, SOME, "whole equals pieces"))
def test_whole_equals_pieces(case: Case, backend: str) -> None:
    whole = case.run(40, steps=60, every=1, t0=0.3, backend=backend)
    system, arguments = case.make(40)
    same = {k: arguments[k] for k in ("method", "dt", "form")} | {"every": 1, "backend": backend}
    run = sw.integrate(system, **(arguments | same), t0=0.3, steps=17)
    for steps in (1, 30, 12):
        before = run.start_step + run.steps
        run = sw.integrate(system, **same, resume=run, steps=steps)
        np.testing.assert_array_equal(run.t, whole.t[before : before + steps + 1])
        np.testing.assert_array_equal(run.y, whole.y[before : before + steps + 1])
        np.testing.assert_array_equal(run.v, whole.v[before : before + steps + 1])


@settings(max_examples=60, deadline=None)
@given(
    case=st.sampled_from(ALL),
    seed=st.integers(0, 2**32),
    b=st.integers(1, 300),
    dt=st.floats(1e-4, 3.0),
    t0=st.floats(-1e3, 1e6),
    start_step=st.integers(0, 10**9),
    every=st.sampled_from([None, 1, 2, 7]),
)
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_equals_the_reference_anywhere(case: Case, seed: int, b: int, dt: float, **options: Any) -> None:
    options |= {"dt": dt, "steps": 9}
    assert_same(case.run(b, seed, **options), case.run(b, seed, **options, backend="numpy"))


@pytest.mark.parametrize("case", thinned(DIRECT, SOME, "diverging members too"))
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning", "ignore::stepwell.AccuracyWarning")
def test_diverging_members_too(case: Case) -> None:
    # Steps far past every limit: the same overflow in the same step. In float32 in the long run only: test_float32.py has a few.
    options: dict[str, Any] = {"dt": 60.0, "steps": 60, "every": 15}
    for dtype in ("float64", "float32") if families.LONG and not case.refused_in_float32() else ("float64",):
        rust = case.run(70, **options, dtype=dtype)
        assert_same(rust, case.run(70, **options, dtype=dtype, backend="numpy"))


@pytest.mark.parametrize(
    ("dtype", "scales"),
    [("float64", (5e-324, 1e-308, 1e-160, 1e160, 1e300)), ("float32", (1e-45, 1e-38, 1e-30, 1e30, 3e37))],
)
def test_extremes_of_size(dtype: str, scales: tuple[float, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    # Denormal numbers and huge ones: no level flushes to zero.
    for level in sw.isa_levels():
        monkeypatch.setenv("STEPWELL_KERNELS", level)
        for scale in scales:
            arguments = {"v": scale * np.linspace(-1, 1, 50), "y": scale, "dt": 0.1, "steps": 50, "every": 1, "dtype": dtype}
            rust = sw.integrate(sw.Oscillator(1.3, 0.1), "rk4", **arguments)
            assert_same(rust, sw.integrate(sw.Oscillator(1.3, 0.1), "rk4", **arguments, backend="numpy"))


@settings(max_examples=200, deadline=None)
@given(st.lists(st.floats(-(2.0**49), 2.0**49), min_size=1, max_size=40))
def test_the_sine_is_the_same(phases: list[float]) -> None:
    # Through a system, because there is no other way in: v after one step from rest is the sine.
    system = sw.Oscillator(1.0, a=sw.Sinusoid(1.0, 0.0, np.array(phases)))
    arguments = {"v": 0.0, "y": 0.0, "dt": 1.0, "steps": 1}
    rust = sw.integrate(system, "standard_euler", **arguments)
    assert_same(rust, sw.integrate(system, "standard_euler", **arguments, backend="numpy"))


def test_nothing_in_the_core_breaks_the_promise() -> None:
    """The grep gate: no contraction, no library power or trigonometry, no reordered sum, unsafe in four files only."""
    forbidden = (
        "mul_add",
        "powi(",
        "powf(",
        ".recip()",
        ".dot(",
        ".norm(",
        ".norm_squared(",
        ".normalize(",
        ".sum()",
        ".sin()",
        ".cos()",
        ".exp()",
        "fast-math",
    )
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
        assert not re.search(r"[\w)\]] ?\*\*", text), (
            path.name
        )  # of a number: that of arguments stands after a comma or a bracket


def test_every_variant_is_tried() -> None:
    """A system without a case here would not be compared with the reference."""
    from stepwell import _core

    rng = np.random.default_rng()
    assert {make(rng, 1).kernel for make in SYSTEMS.values()} == set(_core.systems())


def _member(system: sw.System, i: int, b: int) -> sw.System:
    """The i-th of b systems, alone: of what it holds, the arrays whose last axis is that of the members."""

    def one(value: Any) -> Any:
        match value:
            case np.ndarray() if value.ndim and value.shape[-1] == b:
                return value[..., i]
            case list() | tuple():
                return type(value)(map(one, value))
            case dict():
                return {name: one(each) for name, each in value.items()}
            case sw.System() | Part() | sw.Sinusoid() | sw.Sampled() | sw.Floor() | sw.Sphere():
                return changed(value, **{name: one(each) for name, each in vars(value).items()})
        return value

    alone: sw.System = changed(one(system), batch=())
    return alone
