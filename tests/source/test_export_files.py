"""The files of exported steps: their text, what a compiler says of them, names, and what is refused."""

import math
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.source.exports.names import camel, plain, prefix, snake
from stepwell.views import cli
from support.abroad import PATIENCE, missing
from support.export import LANGUAGES
from support.refusals import refused
from support.snapshots import Snapshots

#: A carry and a table of samples; a control, a force, functions of bits and float32.
FILES: dict[str, tuple[sw.System, str, dict[str, Any]]] = {
    "carried": (sw.Oscillator(x=sw.Sampled([1.0, 2.0, 3.0], 0.4)), "verlet", {"v": 0.5, "y": 1.0}),
    "controlled": (
        sw.NBody([1.0, 2.0]),
        "false_euler",
        {"v": np.eye(2), "y": [[1.0, 0.0], [-0.5, 0.0]], "control": sw.EnergyControl(0.3), "force": True, "dtype": "float32"},
    ),
    "sine": (sw.Pendulum(2.0, 0.1), "damped_euler", {"t0": 1.5}),
}


@pytest.mark.parametrize("name", FILES)
def test_files_are_what_they_were(name: str, snapshot: Snapshots) -> None:
    system, method, options = FILES[name]
    for language in LANGUAGES:
        step = sw.export(system, method, language, name=name, **options)
        snapshot(f"{name}{step.endings[0]}", step.source.replace(f"stepwell {sw.__version__}", "stepwell VERSION"))


def test_the_head_says_what_it_is() -> None:
    source = sw.export(sw.NBody([1.0, 2.0], dim=3), "rk4", "c").source
    head = source.partition("\n\n#include")[0]
    for text in (
        "n_body_rk4: one step by Runge-Kutta 4.",
        "System:  NBody(masses=",
        "Runge-Kutta 4 (rk4), order 4, 4 rate evaluations per step",
        "undamped oscillators for omega*dt < 2.828427125",
        f"stepwell {sw.__version__}",
        "cc -O2 -ffp-contract=off",
        "number i, j of the block of shape (2, 3) at y[3*i + j]",
    ):
        assert text in head
    assert "undamped oscillators for no omega*dt" in sw.export(sw.Oscillator(), "standard_euler", "c").source
    assert "(..., fused=True)" in sw.export(sw.Oscillator(), "rk4", "rust", fused=True).source


def test_what_a_page_needs_is_not_asked_for() -> None:
    """A module for browsers: nothing of Node, and no assignment to what is not declared, which modules refuse."""
    source = sw.export(sw.Oscillator(x=sw.Sampled([1.0, 2.0], 1.0)), "rk4", "javascript").source
    code = re.sub(r"//.*", "", source)
    assert not re.search(r"\b(import|require|process|Buffer|globalThis|module)\b", code)
    assert code.count("export ") == 1


#: Options that compute other numbers, and what the file says of them.
OTHER_NUMBERS = {
    "-ffast-math": "compile without -ffast-math",
    "-Ofast": "compile without -ffast-math, -Ofast",
    "-funsafe-math-optimizations": "compile without -fassociative-math and -funsafe-math-optimizations",
    "-fassociative-math -fno-signed-zeros -fno-trapping-math": "compile without -fassociative-math",
    "-freciprocal-math": "compile without -freciprocal-math",
    "-fno-signed-zeros": "compile without -fno-signed-zeros",
    "-ffinite-math-only": "compile without -ffinite-math-only",
    "-fsingle-precision-constant": "needs_no_fsingle_precision_constant",
    "-mfpmath=387": "compile with -msse2 -mfpmath=sse",
    "-mfpmath=sse,387": "compile with -msse2 -mfpmath=sse",
}


def compiled(folder: Path, *flags: str) -> str:
    """What the compiler complains of in ``step.c``; "unknown" if it has no such option."""
    command = ["cc", *flags, "-S", "step.c", "-o", "step.s"]
    complaint = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE).stderr
    return "unknown" if re.search(r"(unrecognized|unknown|unsupported) .*|bad value|not valid for", complaint) else complaint


@pytest.mark.skipif(missing("c"), reason="there is no C compiler here")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_flags_that_make_other_numbers_are_refused_by_name(dtype: str, tmp_path: Path) -> None:
    sw.export(sw.Oscillator(), "rk4", "c", name="step", dtype=dtype).save(tmp_path / "step.c")  # type: ignore[arg-type]
    assert not compiled(tmp_path)
    for flags, message in OTHER_NUMBERS.items():
        assert (complaint := compiled(tmp_path, *flags.split())) == "unknown" or message in complaint, flags


@pytest.mark.skipif(missing("c"), reason="there is no C compiler here")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_every_way_of_evaluation_that_keeps_the_precision_is_taken(dtype: str, tmp_path: Path) -> None:
    """FLT_EVAL_METHOD of C23: N widens what is narrower than _FloatN, to it; GCC says 16 where a CPU has _Float16."""
    source = sw.export(sw.Oscillator(), "rk4", "c", name="step", dtype=dtype).source  # type: ignore[arg-type]
    (tmp_path / "step.c").write_text(source, encoding="utf-8")
    assert compiled(tmp_path, "-march=sapphirerapids") in ("", "unknown")
    for method, taken in ((-1, ()), (0, ("float64", "float32")), (1, ("float64",)), (2, ()), (16, ("float64", "float32"))):
        own = source.replace(
            "#include <string.h>", f"#include <string.h>\n#undef FLT_EVAL_METHOD\n#define FLT_EVAL_METHOD {method}"
        )
        (tmp_path / "step.c").write_text(own, encoding="utf-8")
        assert ("compile with -msse2" not in compiled(tmp_path)) == (dtype in taken), method


@pytest.mark.skipif(missing("c"), reason="there is no C compiler here")
def test_no_product_is_fused_whatever_the_flags_say(tmp_path: Path) -> None:
    """Compilers fuse products and sums by default where a CPU can; what stands behind the file is fused as the flags say."""
    source = sw.export(sw.Oscillator(1.0, 0.1, form="physical"), "rk4", "c", name="step").source
    (tmp_path / "step.c").write_text(source + "double fused(double x) { return x * x + 1.0; }\n", encoding="utf-8")
    for contract in ([], ["-ffp-contract=fast"]):
        if compiled(tmp_path, "-O2", "-mfma", *contract) == "unknown":
            pytest.skip("this CPU has no such instruction")
        step, user = (tmp_path / "step.s").read_text(encoding="utf-8").split("\nfused:")
        assert "vmulsd" in step
        assert "vfm" not in step
        assert "vfm" in user


def test_python_without_a_fused_multiply_add_says_so() -> None:
    source = sw.export(sw.Oscillator(), "rk4", "python", fused=True).source
    if hasattr(math, "fma"):
        exec(source, {})
        return
    refused(ImportError, r"oscillator_rk4 needs Python 3\.13, which has a fused multiply-add", exec, source, {})


def test_what_is_no_parameter_is_refused_in_python() -> None:
    space: dict[str, Any] = {}
    exec(sw.export(sw.Oscillator(), "rk4", "python").source, space)
    kind = space["OscillatorRk4"]
    for name in ("gain", "step"):
        refused(TypeError, f"there is no parameter {name}", kind, **{name: 1.0})
    refused(ValueError, "velocities: expected 1 number, got 2", kind().start, [0.0, 0.0], [1.0])


def test_names_that_languages_take() -> None:
    names = "v'[0,1]", "Φ", "x[1].amplitude", "a.omega", "y2[1]", "größe", "2x", "λ"
    assert list(map(plain, names)) == ["next_v_0_1", "phi", "x1_amplitude", "a_omega", "y2_1", "groe", "x2x", "lambda"]
    assert [snake(name) for name in ("NBody", "LinearSystem", "Chain")] == ["n_body", "linear_system", "chain"]
    assert camel("n_body_rk4") == "NBodyRk4"


def test_what_is_no_name() -> None:
    for name in ("while", "class", "double", "let", "fn", "lambda", "main", "Self", "math", "MATH", "string", "None"):
        with pytest.raises(sw.errors.ArgumentError, match=rf"name: '{name}' has a meaning of its own"):
            sw.export(sw.Oscillator(), "rk4", "c", name=name)
    for name in ("", "2x", "a b", "a-b", "_a", "ä", "x" * 61, "a;b"):
        refused(sw.errors.ArgumentError, "name: expected at most 60 letters of English", prefix, name)


def test_a_text_in_a_comment_ends_nothing() -> None:
    class Named(sw.Oscillator):
        def __repr__(self) -> str:
            return "Named(*/ \n int x; // \\"

    for language in LANGUAGES:
        source = sw.export(Named(), "rk4", language).source
        assert "\n int x" not in source
        assert "*/" not in source
        assert not any(line.endswith("\\") for line in source.splitlines())


@sw.system(shape=(800,))
def many_exponentials(t: Any, v: Any, y: Any) -> Any:
    """ÿ = −eʸ where the first y is negative: a truth that all read, and operations on bits, for which there are no loops."""
    return np.where(y[0] < 0.0, -np.exp(y), -y)


def test_what_cannot_be_exported_says_so(tmp_path: Path) -> None:
    free, many, exported = sw.Oscillator(), sw.Oscillator([[1.0, 2.0], [3.0, 4.0]]), sw.export(sw.Oscillator(), "rk4", "c")
    relative, sampled = sw.EnergyControl(relative=0.1, target=1.0), sw.Oscillator(a=sw.Sampled([1.0, 2.0], 1.0))
    single: dict[str, Any] = {"dtype": "float32"}
    of_names, wrong, of_shapes, of_types, unsupported = (
        getattr(sw.errors, f"{name}Error") for name in ("UnknownName", "Argument", "Shape", "DType", "Unsupported")
    )
    cases: list[tuple[Any, str, dict[str, Any], type[Exception], str]] = [
        (free, "rk4", {"language": "fortran"}, of_names, "language: there is no 'fortran'"),
        (many, "rk4", {}, wrong, r"member: expected one .* member=\(1, 1\)"),
        (many, "rk4", {"member": 1}, of_shapes, "member: expected 2 indices"),
        (many, "rk4", {"member": (0, 2)}, wrong, "member: expected 0 or more, up to 1, got 2"),
        (free, "rk4", {"member": 0}, of_shapes, "member: expected 0 indices"),
        (free, "rk4", {"dt": 0.0}, wrong, "dt: expected numbers above zero"),
        (free, "rk4", {"name": 3}, of_types, "name: expected a word, got 3"),
        (free, "rk4", {"fused": "yes"}, of_types, "fused: expected True or False"),
        (free, "rk4", {"start": "first_order"}, wrong, "start: rk4 starts in one way only"),
        (free, "rk4", {"control": sw.Projection(target=1.0)}, unsupported, "control: "),
        (sw.NBody(), "rk4", {"control": sw.Projection()}, wrong, "control: .* with a target"),
        (sw.NBody(), "rk4", {"control": relative}, wrong, "control: .* with gain="),
        (sw.Oscillator(1.0, 0.1), "verlet", {}, unsupported, "verlet needs forces"),
        (sw.NBody(np.ones(1000)), "rk4", {}, unsupported, r"has about \d+ operations, and at most"),
        (many_exponentials(), "rk4", {}, unsupported, r"and at most 20000 are written out one by one"),
        (sw.Chain(10_000), "rk4", {"fused": True}, wrong, r"fused: a step of about \d+ operations"),
        (sampled, "rk4", single, unsupported, "dtype: an exported step has numbers of one width"),
        (free, "taylor", single, unsupported, "dtype: float32 does not work with taylor"),
        (free, "rk4", single | {"y": 1e39}, wrong, "y: expected numbers up to 3.4e38"),
        (free, "rk4", single | {"dt": 1e-50}, wrong, "dt: expected a number of size 1.4e-45 to 3.4e38 units of time in float32"),
    ]
    fused = {"csharp": ("C#", {}), "javascript": ("JavaScript", {}), "python": ("Python", single)}
    for language, (name, options) in fused.items():
        for more in ({}, single)[bool(options) :]:
            asked = {"language": language, "fused": True} | more
            cases.append((free, "rk4", asked, unsupported, f"fused: {name} has no fused multiply-add"))
    for system, method, options, error, text in cases:
        refused(error, text, sw.export, system, method, **{"language": "c"} | options)
    for path, error, text in (
        (tmp_path / "step.py", wrong, "path: expected a file ending in .c"),
        (tmp_path / "no" / "step.c", wrong, "path: .* can be written"),
        (3, of_types, "path: expected the path of a file"),
    ):
        with pytest.raises(error, match=text):
            exported.save(path)  # type: ignore[arg-type]


def test_it_can_be_kept(tmp_path: Path) -> None:
    step = sw.export(sw.Oscillator([1.0, 2.0]), "rk4", "javascript", member=1)
    assert str(step) == step.source
    assert step.save(tmp_path / "step.mjs").read_text(encoding="utf-8") == step.source
    assert (step.name, step.language, step.member) == ("oscillator_rk4", "JavaScript", (1,))
    assert "this.omega = 2;" in step.source
    assert repr(step).startswith("<oscillator_rk4 in JavaScript: Runge-Kutta 4, Oscillator(")


def test_how_much_the_page_says_is_loops() -> None:
    springs = [(i, i + 1) for i in range(19)]
    short, long = (sw.Springs(springs[:n], rest=1.0, stiffness=1.0) for n in (8, 19))
    for system, is_long in ((short, False), (long, True)):
        step = sw.export(system, "rk4", "c")
        assert (step.operations > 2000, "for (int i" in step.source) == (is_long, is_long)


def test_what_a_file_says() -> None:
    for language in LANGUAGES:
        step = sw.export(sw.Oscillator(0.1), "rk4", language, dt=0.1, t0=0.1, dtype=np.float32)  # type: ignore[arg-type]
        assert step.dtype == "float32"
        assert 'integrate(..., dtype="float32"), to the last bit' in step.source
        assert repr(step).endswith("operations, float32>")
        assert "t0 = 0.1" in step.source.replace(":", " =")  # the time is computed in float64
        assert step.as_dict()["dtype"] == "float32"
    source = sw.export(sw.Oscillator(0.1), "rk4", "c", dt=0.1, dtype="float32").source
    assert "m->omega = 0.1f;" in source
    assert "0.16666667f" in source


def test_the_command(capsys: Any) -> None:
    assert cli.main(["export", "pendulum", "--method", "leapfrog", "--language", "c", "--float32"]) == 0
    assert "const float" in capsys.readouterr().out
