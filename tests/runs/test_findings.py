"""What a run noticed is data on it; the public functions warn of it, and the package silences nothing of its own."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError
from stepwell.runs.making import noticing, quietly
from stepwell.runs.options import Options
from stepwell.runs.request import Request

PACKAGE = Path(sw.__file__).parent
SILENCED = re.compile(r"simplefilter|filterwarnings|catch_warnings")


def ball(steps: int) -> tuple[Any, ...]:
    falls = sw.system(lambda t, v, y: -1.0 + 0.0 * y)
    ground = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-0.5 * v, y), name="ground")
    return falls(), "rk4", {"v": 0.0, "y": 1.0, "dt": 0.01, "steps": steps, "events": ground}


STEPS: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1}
FEW: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-6, "at": [5.0], "max_steps": 100}
TURNS: dict[str, Any] = {"v": [0.0, 1e16], "y": 1.0, "dt": 1.0, "steps": 10}
CASES: dict[str, tuple[Any, str, dict[str, Any], type[Warning], list[bool] | bool]] = {
    "divergence": (sw.Oscillator([1.0, 30.0]), "leapfrog", STEPS | {"steps": 1000}, sw.DivergenceWarning, [False, True]),
    "a stop": (sw.Oscillator([1.0, 30.0]), "merson", FEW, sw.ToleranceWarning, [False, True]),
    "growth": (sw.Oscillator([1.0, 21.0]), "false_euler", STEPS | {"steps": 100}, sw.AccuracyWarning, [False, True]),
    "an angle": (sw.Pendulum(), "rk4", TURNS, sw.AccuracyWarning, [False, True]),
    "rest": (*ball(600), sw.EventWarning, True),
}


@pytest.mark.parametrize("name", CASES)
def test_a_finding_is_what_the_public_functions_warn_of(name: str, tmp_path: Path) -> None:
    system, method, options, category, members = CASES[name]
    with pytest.warns(category) as caught:
        run = sw.integrate(system, method, **options)
    assert [(each.category, str(each.message)) for each in caught] == [(each.category, each.message) for each in run.findings]
    assert {Path(each.filename).name for each in caught} == {Path(__file__).name}
    (finding,) = (each for each in run.findings if issubclass(each.category, category))
    np.testing.assert_array_equal(finding.members, members)
    assert finding.members.shape == run.status.shape
    if name != "rest":  # whose function has no name to be found by
        run.save(tmp_path / "run.npz")
        assert sw.load(tmp_path / "run.npz").findings == run.findings
    # Inner functions do not warn.
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        silent = quietly(system, method, **options)
        noticed = noticing(Request.of(system, method, Options(**options)))
    assert noticed.findings
    np.testing.assert_array_equal(silent.y, noticed.y)


def test_the_package_silences_no_warning() -> None:
    """Those of ``errors.py`` are examples that catch them; and pyopencl tells of each kernel that its compiler said something."""
    files = [path for path in PACKAGE.rglob("*.py") if path.name != "errors.py"]
    assert len(files) > 100
    silenced = [str(path.relative_to(PACKAGE)) for path in files if SILENCED.search(path.read_text())]
    assert silenced == ["device/opencl.py"]
    text = (PACKAGE / silenced[0]).read_text()
    assert text.count("simplefilter") == text.count('simplefilter("ignore", self.cl.CompilerWarning)') == 1


# ---- some of the saved states


def test_a_selection_has_these_states() -> None:
    run = sw.integrate(sw.Oscillator([1.0, 2.0]), "rk4", v=0.0, y=1.0, dt=0.1, steps=40, every=1, record="energy")
    for saved in (slice(3, None, 4), np.arange(41) % 3 == 0, [0, 5, 40], np.array([7])):
        part = run.select(saved)
        for name in ("t", "v", "y", "energy"):
            np.testing.assert_array_equal(getattr(part, name), getattr(run, name)[saved])
        assert part.steps == 40
    np.testing.assert_array_equal(run.select(-1).y, run.y[-1:])
    np.testing.assert_array_equal(run.select(slice(0, None, 2)).select(1).y, run.y[2:3])
    with pytest.raises(IndexError):
        run.select(41)


@pytest.mark.parametrize("options", [{"dt": 0.1, "steps": 40, "every": 1}, {"tolerance": 1e-6, "at": np.linspace(0.1, 4.0, 40)}])
def test_a_part_goes_on_if_it_has_the_end(options: dict[str, Any]) -> None:
    more: dict[str, Any] = {"steps": 10} if "steps" in options else {"at": [5.0]}
    run = sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, **options)
    whole, part = (sw.integrate(run.system, "merson", resume=each, **more) for each in (run, run.select([0, -1])))
    assert whole.y[-1] == part.y[-1]
    with pytest.raises(ArgumentError, match=r"^resume: expected a run with its last state, got a part of one without it"):
        sw.integrate(run.system, "merson", resume=run.select(slice(0, -1)), **more)
