"""Every example runs without a warning, and its last line is what it was: equal bits make it the same everywhere."""

import runpy

import pytest
from support import ROOT

EXAMPLES = ROOT / "examples"

LAST_LINES = {
    "chain_wave": "front at mass 201 of 400, energy within 0.0188 of its start",
    "compare_methods": "false_euler at Φ = 1.999: 500.5, at Φ = 2.001: 8e+110",
    "game_loop": "t = 10 s after 2400 steps: y = -0.042682, -0.000932, 0.000000 m",
    "resonance": "peak 5.0252 at ω = 0.99; true 5.0252 there",
    "sweep": "54492 of 100000 diverged; the last good one has 19.1014 Hz",
    "wing_nut": "the angular momentum stays within 1.0e-07, the energy within 6.3e-09",
}


def test_every_example_is_pinned():
    assert sorted(LAST_LINES) == sorted(file.stem for file in EXAMPLES.glob("*.py"))


@pytest.mark.parametrize("name", LAST_LINES)
def test_last_line(name, capsys):
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert capsys.readouterr().out.splitlines()[-1] == LAST_LINES[name]
