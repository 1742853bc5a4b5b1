"""A type checker finds words that an argument does not take, and nothing in right calls."""

import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest
from stepwell.base import literals
from stepwell.model import controls, surfaces
from stepwell.model.systems import aircraft, nbody, oscillator
from stepwell.runs.options import single as options
from stepwell.source import exports
from stepwell.studies.advice import COSTS

pytest.importorskip("mypy")

HEAD = "import stepwell as sw\n\n"

RIGHT = """
def right() -> None:
    system = sw.Oscillator(omega=1.0, form="physical")
    run: sw.Run = sw.integrate(system, "symplectic Euler", v=0.0, y=1.0, dt=0.1, steps=10, form="matrix", backend="numpy")
    print(run.y[-1], run.status == sw.Status.OK, sw.method("rk4").order)
    sw.NBody([1.0, 1.0], force="newton")
    sw.Aircraft("quaternion")
    sw.EnergyControl(0.3, "printed")
    sw.Floor(way="restitution")
    sw.explain(system, "rk4", form="matrix")
    sw.export(system, "rk4", "javascript")
    print(sw.advise("clover", cost="evaluations").best)
"""

#: What is written wrongly, and what the checker says of the argument.
WRONG = {
    'sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, form="matirx")': 'Argument "form" to "integrate"',
    'sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, backend="nunpy")': 'Argument "backend" to "integrate"',
    'sw.Oscillator(form="cannonical")': 'Argument "form" to "Oscillator"',
    'sw.NBody([1.0], force="Newton")': 'Argument "force" to "NBody"',
    'sw.Aircraft("angles")': 'Argument 1 to "Aircraft"',
    'sw.EnergyControl(0.3, "tight")': 'Argument 2 to "EnergyControl"',
    'sw.Floor(way="bounce")': 'Argument "way" to "Floor"',
    'sw.Sphere([0.0], 1.0, way="bounce")': 'Argument "way" to "Sphere"',
    'sw.advise("clover", cost="money")': 'Argument "cost" to "advise"',
    'sw.explain(sw.Oscillator(), "rk4", form="power")': 'Argument "form" to "explain"',
    'sw.export(sw.Oscillator(), "rk4", "cpp")': 'Argument 3 to "export"',
    'sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, step=1)': 'Unexpected keyword argument "step"',
    "sw.no_such_name": 'has no attribute "no_such_name"',
}


def test_mypy_finds_what_is_written_wrongly(tmp_path: Path) -> None:
    lines = "".join(f"    {call}\n" for call in WRONG)
    text = f"{HEAD}{RIGHT}\n\ndef wrong() -> None:\n{lines}"
    path = tmp_path / "calls.py"
    path.write_text(text, encoding="utf-8")
    package = Path(literals.__file__).parents[2]
    # A package that is not installed is found there; mypy finds an installed one by itself, and refuses to be told.
    env = {"PATH": ""} if package.name == "site-packages" else {"PATH": "", "MYPYPATH": str(package)}
    words = ["-m", "mypy", "--strict", "--no-error-summary", "--cache-dir", str(tmp_path / "cache"), str(path)]
    run = subprocess.run([sys.executable, *words], capture_output=True, text=True, env=env, cwd=tmp_path)
    first = text[: text.index("def wrong")].count("\n") + 2
    errors: dict[int, list[str]] = {}
    for line in run.stdout.splitlines():
        if (match := re.match(r"calls\.py:(\d+): error: (.*)", line)) is not None:
            errors.setdefault(int(match[1]), []).append(match[2])
    assert "calls.py" in run.stdout, run.stdout + run.stderr
    for number, (call, message) in enumerate(WRONG.items(), first):
        assert any(message in each for each in errors.pop(number, [])), f"{call}: {run.stdout}"
    assert errors == {}, "an error in a right call"


def test_the_types_have_the_words_that_are_checked() -> None:
    for words, known in (
        (literals.StepForm, options.FORMS),
        (literals.Backend, options.BACKENDS),
        (literals.OscillatorForm, oscillator.FORMS),
        (literals.AttitudeForm, aircraft.FORMS),
        (literals.BodyForce, nbody.FORCES),
        (literals.ContactWay, surfaces.WAYS),
        (literals.ControlForm, controls.FORMS),
        (literals.Cost, COSTS),
        (literals.LanguageName, exports.LANGUAGES),
    ):
        assert sorted(get_args(words)) == sorted(known)
