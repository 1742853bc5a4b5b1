"""Exported steps in every language: the bits of ``integrate``, the programs that heads and pages show, and what is refused."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.source.exports.head import STEPS
from support import ROOT
from support.abroad import Journey, executed, missing, run, same
from support.export import (
    METHODS,
    ON_BITS,
    SETS,
    assert_same,
    controlled,
    exported,
    languages,
    mutants,
    oddly_named,
    other_pairs,
    printed,
    shown,
)

pytestmark = pytest.mark.filterwarnings(
    "ignore::stepwell.DivergenceWarning", "ignore::stepwell.ControlWarning", "ignore::stepwell.AccuracyWarning"
)


@languages
@pytest.mark.parametrize("name", SETS)
def test_every_bit_is_that_of_integrate(name: str, language: str, tmp_path: Path) -> None:
    journeys = SETS[name](language)
    sources = exported(name, journeys, language)
    assert_same(journeys, run(language, journeys, tmp_path, sources) if journeys else [])
    if name == "of all methods and systems":
        assert {each.method for each in journeys} == {method.name for method in METHODS}
        assert len({repr(each.system) for each in journeys}) > 40
    if name == "diverging":
        assert all(any(f(x) for each in journeys for x in each.expected) for f in (math.isnan, math.isinf))
    if name == "of bits":
        assert [each for each in ON_BITS if not any(re.search(rf"\w*{each}\(", source) for source in sources)] == []


@pytest.mark.long
@languages
def test_every_bit_of_other_pairs(language: str, tmp_path: Path) -> None:
    every = [*other_pairs(language), *controlled(language, implicit=True)]
    assert len(every) > 40
    assert_same(every, run(language, every, tmp_path))


@pytest.mark.mutant
@languages
def test_a_wrong_operation_is_noticed(language: str, tmp_path: Path) -> None:
    each = Journey(sw.Pendulum(1.3), "merson", 4.0, 5.5, steps=90)
    source = each.export(language, "step_0").source
    begin = {"c": "double step_0_sine(", "csharp": "double _sine(", "javascript": "function sine(", "rust": "fn sine("}
    changed = mutants(source, begin.get(language, "def sine("), "The state after the step")
    changed = changed[:: 20 if language in ("c", "csharp", "rust") else 7]
    assert len(changed) > 3
    for mutant in changed:
        (numbers,) = run(language, [each], tmp_path, [mutant])
        assert not all(map(same, numbers, each.expected))


@languages
def test_parameters_may_be_called_anything(language: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    every = oddly_named(monkeypatch)
    assert_same(every, run(language, every, tmp_path))


@languages
def test_the_example_at_the_head_runs(language: str, tmp_path: Path) -> None:
    """In both precisions, of a block of many numbers, of velocities alone, and with a force."""
    chain = np.arange(1.0, 21.0)
    single: dict[str, Any] = {"v": 0.1, "y": 0.7, "dt": 0.02, "t0": 0.3, "dtype": "float32"}
    push: dict[str, Any] = {"v": [[0.25, 0.5]], "y": [[1.0, 2.0]], "dt": 1 / 60, "force": [[0.5, 9.0]]}
    velocities = sw.LinearSystem([[-1.0, 2.0], [0.5, -3.0]], velocities=2)
    for i, (system, method, options, block) in enumerate(
        (
            (sw.Pendulum(2.0, a=sw.Sinusoid(1.0, 3.0)), "rk4", {"v": 0.25, "y": -0.5, "dt": 1 / 60}, "y"),
            (sw.Pendulum(1.1), "rk4", single, "y"),
            (sw.Chain(20), "verlet", {"v": np.zeros(20), "y": chain, "dt": 0.01}, "y"),
            (velocities, "merson", {"v": [3.0, 4.0], "y": [], "dt": 0.01}, "v"),
            (sw.Particles(), "leapfrog", push, "y"),
            (sw.Particles(), "rk4", push, "y"),
        )
    ):
        end = getattr(sw.integrate(system, method, steps=STEPS, **options), block)[-1]
        step = sw.export(system, method, language, name=f"shown_{i}", **options)
        assert end.dtype.type(shown(step, tmp_path)) == np.ravel(end)[0], (system, method)


PAGE = (ROOT / "docs" / "howto" / "export.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("fence", [pytest.param(each, id=each) for each in ("c", "csharp", "javascript", "rust")])
def test_the_programs_of_the_page_run(fence: str, tmp_path: Path) -> None:
    """All print the number that the page prints in Python."""
    if missing(fence):
        pytest.skip(f"there is no compiler or interpreter of {fence} here")
    (code,) = re.findall(rf"^```{fence}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    (wanted,) = re.findall(r"print\(s\.y\[0\], .*\)  # → (\S+) True", PAGE)
    step = sw.export(sw.Pendulum(omega=2.0), "leapfrog", fence, dt=1 / 60, name="swing")
    assert printed(step, code, tmp_path) == float(wanted)


def test_the_page_with_a_cloth_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In Node with a canvas that draws nothing: after a second it has the bits of ``World``, with wind from the start."""
    if missing("javascript"):
        pytest.skip("there is no interpreter of JavaScript here")
    (code,) = (each for each in re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE) if "<canvas" in each)
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
