"""The files of exported steps: their text, what a compiler says of them, names, and what is refused."""

from __future__ import annotations

import math
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.source.exports.head import STEPS
from stepwell.source.exports.names import camel, plain, prefix, snake
from support import ROOT
from support.abroad import C_FLAGS, PATIENCE, RUST_FLAGS, Journey, executed, missing, run
from support.export import LANGUAGES, assert_same, languages, shown
from support.snapshots import Snapshots

WRONG: Any = "yes"


# ---- whole files

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


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", FILES)
def test_files_are_what_they_were(name: str, language: Any, snapshot: Snapshots) -> None:
    system, method, options = FILES[name]
    step = sw.export(system, method, language, name=name, **options)
    snapshot(f"{name}{step.endings[0]}", step.source.replace(f"stepwell {sw.__version__}", "stepwell VERSION"))


# ---- the head of a file


@languages
def test_the_example_at_the_head_runs(language: str, tmp_path: Path) -> None:
    arguments = {"v": 0.25, "y": -0.5, "dt": 1 / 60}
    run = sw.integrate(sw.Pendulum(2.0, a=sw.Sinusoid(1.0, 3.0)), "rk4", steps=STEPS, **arguments)
    step = sw.export(sw.Pendulum(2.0, a=sw.Sinusoid(1.0, 3.0)), "rk4", language, **arguments)
    assert shown(step, tmp_path) == run.y[-1]
    arguments = {"v": 0.1, "y": 0.7, "dt": 0.02, "t0": 0.3, "dtype": "float32"}
    run = sw.integrate(sw.Pendulum(1.1), "rk4", steps=STEPS, **arguments)
    step = sw.export(sw.Pendulum(1.1), "rk4", language, name="single", **arguments)
    assert np.float32(shown(step, tmp_path)) == run.y[-1]
    chain = sw.Chain(20)
    run = sw.integrate(chain, "verlet", v=0.0, y=np.arange(1.0, 21.0), dt=0.01, steps=STEPS)
    assert shown(sw.export(chain, "verlet", language), tmp_path) == run.y[-1, 0]
    velocities = sw.LinearSystem([[-1.0, 2.0], [0.5, -3.0]], velocities=2)
    run = sw.integrate(velocities, "merson", v=[3.0, 4.0], y=[], dt=0.01, steps=STEPS)
    assert shown(sw.export(velocities, "merson", language, v=[3.0, 4.0]), tmp_path) == run.v[-1, 0]


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


def test_it_reads_as_explain_does() -> None:
    """Names, order and what is made before the steps are those of the listing."""
    source = sw.export(sw.Oscillator(), "false_euler", "c").source
    assert "    m->phi = m->dt * m->omega;\n" in source
    assert (
        "    const double next_v = v - m->phi * y;\n    const double dy1 = m->phi * next_v;\n    const double next_y = y + dy1;\n"
        in source
    )
    heun = sw.export(sw.Oscillator(), "standard_heun", "rust").source
    assert "        let a1 = self.phi * y; // -dv1\n        let dy1 = self.phi * v;\n" in heun


def test_what_a_page_needs_is_not_asked_for() -> None:
    """A module for browsers: nothing of Node, and no assignment to what is not declared, which modules refuse."""
    source = sw.export(sw.Oscillator(x=sw.Sampled([1.0, 2.0], 1.0)), "rk4", "javascript").source
    code = re.sub(r"//.*", "", source)
    assert not re.search(r"\b(import|require|process|Buffer|globalThis|module)\b", code)
    assert code.count("export ") == 1


# ---- what a file refuses

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
    with pytest.raises(ImportError, match=r"oscillator_rk4 needs Python 3\.13, which has a fused multiply-add"):
        exec(source, {})


def test_what_is_no_parameter_is_refused_in_python() -> None:
    space: dict[str, Any] = {}
    exec(sw.export(sw.Oscillator(), "rk4", "python").source, space)
    kind = space["OscillatorRk4"]
    with pytest.raises(TypeError, match="there is no parameter gain"):
        kind(gain=1.0)
    with pytest.raises(TypeError, match="there is no parameter step"):
        kind(step=1.0)
    with pytest.raises(ValueError, match="velocities: expected 1 number, got 2"):
        kind().start([0.0, 0.0], [1.0])


@pytest.mark.skipif(missing("javascript"), reason="there is no Node here")
def test_what_is_no_parameter_is_refused_in_javascript(tmp_path: Path) -> None:
    sw.export(sw.Oscillator(), "rk4", "javascript").save(tmp_path / "step.mjs")
    code = 'import { OscillatorRk4 } from "./step.mjs";\n'
    code += "const tell = (f) => { try { f(); } catch (e) { console.log(e.message); } };\n"
    code += "tell(() => new OscillatorRk4({ gain: 1 }));\ntell(() => new OscillatorRk4({ step: 1 }));\n"
    code += "tell(() => new OscillatorRk4().start([0, 0], [1]));\n"
    (tmp_path / "wrong.mjs").write_text(code, encoding="utf-8")
    messages = ["there is no parameter gain", "there is no parameter step", "velocities: expected 1 number, got 2"]
    assert executed(["node", "wrong.mjs"], tmp_path).splitlines() == messages


# ---- names


def test_names_that_languages_take() -> None:
    assert [plain(name) for name in ("v'[0,1]", "Φ", "x[1].amplitude", "a.omega", "y2[1]", "größe", "2x", "λ")] == [
        "next_v_0_1",
        "phi",
        "x1_amplitude",
        "a_omega",
        "y2_1",
        "groe",
        "x2x",
        "lambda",
    ]
    assert [snake(name) for name in ("NBody", "LinearSystem", "Chain")] == ["n_body", "linear_system", "chain"]
    assert camel("n_body_rk4") == "NBodyRk4"


@pytest.mark.parametrize(
    "name", ["while", "class", "double", "let", "fn", "lambda", "main", "Self", "math", "MATH", "string", "None"]
)
def test_reserved_words_are_no_names(name: str) -> None:
    with pytest.raises(sw.errors.ArgumentError, match=rf"name: '{name}' has a meaning of its own"):
        sw.export(sw.Oscillator(), "rk4", "c", name=name)


@pytest.mark.parametrize("name", ["", "2x", "a b", "a-b", "_a", "ä", "x" * 61, "a;b"])
def test_what_is_no_word_is_no_name(name: str) -> None:
    with pytest.raises(sw.errors.ArgumentError, match="name: expected at most 60 letters of English"):
        prefix(name)


class Reserved(sw.Oscillator):
    """An oscillator whose parameters are called what languages have for something else."""

    def named(self, name: str, index: Any) -> str:
        """Not as a file may call them."""
        return {"omega": "while", "damping": "M_PI", "a": "m", "x": "dt"}.get(name, name)


class Inward(Reserved):
    """Likewise."""

    def named(self, name: str, index: Any) -> str:
        """Not as a file may call them, either."""
        return {"omega": "phi", "damping": "prepare", "a": "λ", "x": "c1"}.get(name, name)


@languages
def test_parameters_may_be_called_anything(language: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stepwell.source.exports import tapes

    def renamed(plan: Any) -> Any:
        numbers, tables = parameters(plan)
        return [plan.system.named(name, ()) for name in numbers], tables

    parameters = tapes.parameters
    monkeypatch.setattr(tapes, "parameters", renamed)
    every = [
        Journey(kind(1.3, 0.2, x=0.5, a=0.25, form="physical"), method, 0.5, 1.0)
        for kind in (Reserved, Inward)
        for method in ("rk4", "false_euler")
    ]
    assert_same(every, run(language, every, tmp_path))
    source = sw.export(every[0].system, "rk4", language).source
    assert re.search(r"\bwhile_\b", source)
    assert re.search(r"\bdt_\b", source)


def test_a_text_in_a_comment_ends_nothing() -> None:
    class Named(sw.Oscillator):
        def __repr__(self) -> str:
            return "Named(*/ \n int x; // \\"

    for language in LANGUAGES:
        source = sw.export(Named(), "rk4", language).source
        assert "\n int x" not in source
        assert "*/" not in source
        assert not any(line.endswith("\\") for line in source.splitlines())


# ---- errors


@sw.system(shape=(800,))
def many_exponentials(t: Any, v: Any, y: Any) -> Any:
    """ÿ = −eʸ where the first y is negative: a truth that all read, and operations on bits, for which there are no loops."""
    return np.where(y[0] < 0.0, -np.exp(y), -y)


def test_what_cannot_be_exported_says_so(tmp_path: Path) -> None:
    free = sw.Oscillator()
    many = sw.Oscillator([[1.0, 2.0], [3.0, 4.0]])
    for call, error, text in (
        (lambda: sw.export(free, "rk4", "fortran"), sw.errors.UnknownNameError, "language: there is no 'fortran'"),
        (lambda: sw.export(many, "rk4", "c"), sw.errors.ArgumentError, r"member: expected one .* member=\(1, 1\)"),
        (lambda: sw.export(many, "rk4", "c", member=1), sw.errors.ShapeError, "member: expected 2 indices"),
        (
            lambda: sw.export(many, "rk4", "c", member=(0, 2)),
            sw.errors.ArgumentError,
            "member: expected 0 or more, up to 1, got 2",
        ),
        (lambda: sw.export(free, "rk4", "c", member=0), sw.errors.ShapeError, "member: expected 0 indices"),
        (lambda: sw.export(free, "rk4", "c", dt=0.0), sw.errors.ArgumentError, "dt: expected numbers above zero"),
        (lambda: sw.export(free, "rk4", "c", name=3), sw.errors.DTypeError, "name: expected a word, got 3"),
        (lambda: sw.export(free, "rk4", "c", fused=WRONG), sw.errors.DTypeError, "fused: expected True or False"),
        (lambda: sw.export(free, "rk4", "c", start="first_order"), sw.errors.ArgumentError, "start: rk4 starts in one way only"),
        (lambda: sw.export(free, "rk4", "c", control=sw.Projection(target=1.0)), sw.errors.UnsupportedError, "control: "),
        (
            lambda: sw.export(sw.NBody(), "rk4", "c", control=sw.Projection()),
            sw.errors.ArgumentError,
            "control: .* with a target",
        ),
        (
            lambda: sw.export(sw.NBody(), "rk4", "c", control=sw.EnergyControl(relative=0.1, target=1.0)),
            sw.errors.ArgumentError,
            "control: .* with gain=",
        ),
        (lambda: sw.export(sw.Oscillator(1.0, 0.1), "verlet", "c"), sw.errors.UnsupportedError, "verlet needs forces"),
        (
            lambda: sw.export(sw.NBody(np.ones(1000)), "rk4", "c"),
            sw.errors.UnsupportedError,
            r"has about \d+ operations, and at most",
        ),
        (
            lambda: sw.export(many_exponentials(), "rk4", "c"),
            sw.errors.UnsupportedError,
            r"and at most 20000 are written out one by one",
        ),
        (
            lambda: sw.export(sw.Chain(10_000), "rk4", "c", fused=True),
            sw.errors.ArgumentError,
            r"fused: a step of about \d+ operations",
        ),
        (
            lambda: sw.export(free, "rk4", "c").save(tmp_path / "step.py"),
            sw.errors.ArgumentError,
            "path: expected a file ending in .c",
        ),
        (
            lambda: sw.export(free, "rk4", "c").save(tmp_path / "no" / "step.c"),
            sw.errors.ArgumentError,
            "path: .* can be written",
        ),
        (lambda: sw.export(free, "rk4", "c").save(3), sw.errors.DTypeError, "path: expected the path of a file"),  # type: ignore[arg-type]
    ):
        with pytest.raises(error, match=text):
            call()


def test_it_can_be_kept(tmp_path: Path) -> None:
    step = sw.export(sw.Oscillator([1.0, 2.0]), "rk4", "javascript", member=1)
    assert str(step) == step.source
    assert step.save(tmp_path / "step.mjs").read_text(encoding="utf-8") == step.source
    assert (step.name, step.language, step.member) == ("oscillator_rk4", "JavaScript", (1,))
    assert "this.omega = 2;" in step.source
    assert repr(step).startswith("<oscillator_rk4 in JavaScript: Runge-Kutta 4, Oscillator(")


# ---- the page

PAGE = ROOT / "docs" / "howto" / "export.md"


@pytest.mark.parametrize("fence", [pytest.param(each, id=each) for each in ("c", "csharp", "javascript", "rust")])
def test_the_programs_of_the_page_run(fence: str, tmp_path: Path) -> None:
    """All print the number that the page prints in Python."""
    if missing(fence):
        pytest.skip(f"there is no compiler or interpreter of {fence} here")
    text = PAGE.read_text(encoding="utf-8")
    (code,) = re.findall(rf"^```{fence}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    (wanted,) = re.findall(r"print\(s\.y\[0\], .*\)  # → (\S+) True", text)
    ending = {"c": "c", "csharp": "cs", "javascript": "mjs", "rust": "rs"}[fence]
    sw.export(sw.Pendulum(omega=2.0), "leapfrog", fence, dt=1 / 60, name="swing").save(tmp_path / f"swing.{ending}")
    (tmp_path / f"game.{ending}").write_text(code, encoding="utf-8")
    if fence == "c":
        executed(["cc", *C_FLAGS, "game.c", "-lm", "-o", "game"], tmp_path)
    elif fence == "rust":
        executed(["rustc", *RUST_FLAGS, "game.rs", "-o", "game"], tmp_path)
    elif fence == "csharp":
        executed(["mcs", "game.cs", "swing.cs"], tmp_path)
    commands: dict[str, list[Any]] = {"csharp": ["mono", "game.exe"], "javascript": ["node", "game.mjs"]}
    command = commands.get(fence, [tmp_path / "game"])
    assert float(executed(command, tmp_path)) == float(wanted)


def test_the_page_with_a_cloth_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In Node with a canvas that draws nothing: after a second it has the bits of ``World``, with wind from the start."""
    if missing("javascript"):
        pytest.skip("there is no interpreter of JavaScript here")
    text = PAGE.read_text(encoding="utf-8")
    (code,) = (each for each in re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE) if "<canvas" in each)
    monkeypatch.chdir(tmp_path)
    space: dict[str, Any] = {"sw": sw, "np": np}
    exec(code, space)
    (script,) = re.findall(r'<script type="module">\n(.*)</script>', Path("cloth.html").read_text(encoding="utf-8"), re.DOTALL)
    stand_in = """const nothing = () => {};
    const pen = { clearRect: nothing, beginPath: nothing, moveTo: nothing, lineTo: nothing, stroke: nothing };
    const canvas = { width: 1, height: 1, getContext: () => pen };
    globalThis.document = { getElementById: () => canvas };
    let frames = 0;
    globalThis.requestAnimationFrame = (next) => {
      if (frames++ === 0) canvas.onpointerdown();
      if (frames <= 60) next();
    };
    """
    (tmp_path / "stand_in.mjs").write_text(stand_in, encoding="utf-8")
    (tmp_path / "page.mjs").write_text(
        f'import "./stand_in.mjs";\n{script}\nconsole.log(Array.from(s.y).join(" "));', encoding="utf-8"
    )
    got = list(map(float, executed(["node", "page.mjs"], tmp_path).split()))
    wind = np.zeros(space["at"].shape)
    wind[:, 0] = 6.0
    world = sw.World(space["cloth"], "false_euler", v=0.0 * wind, y=space["at"], dt=1 / 600, force=wind)
    world.step(600)
    assert got == world.y.ravel().tolist()
    assert world.y[:, 1].min() < 0.05  # it has met the floor


def test_how_much_the_page_says_is_loops() -> None:
    springs = [(i, i + 1) for i in range(19)]
    short, long = (sw.Springs(springs[:n], rest=1.0, stiffness=1.0) for n in (8, 19))
    for system, is_long in ((short, False), (long, True)):
        step = sw.export(system, "rk4", "c")
        assert (step.operations > 2000, "for (int i" in step.source) == (is_long, is_long)
