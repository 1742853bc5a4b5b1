"""Scenes of one's own in a Python file: on the command line, and by ``scenes.scene``."""

import pickle
from pathlib import Path

import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnknownNameError
from support.commands import complaint, listed, printed
from support.refusals import refused

FILE = """
import numpy as np
import stepwell as sw

@sw.system
def duffing(t, v, y, *, alpha=-1.0, beta=1.0, delta=0.3, gamma=0.5, omega=1.2):
    return gamma * np.cos(omega * t) - delta * v - alpha * y - beta * y**3

scene = sw.Scene(duffing(), v=0.0, y=1.0, until=5.0)
"""


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "my_scene.py"
    path.write_text(FILE)
    return str(path)


def test_run_advise_explain_and_pickle(file: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    report = listed(capsys, "run", file, "--method", "rk4", "--dt", "0.01", "-o", str(tmp_path / "run.png"))
    scene = sw.scenes.scene(file)
    assert scene.name == report["scene"] == "my_scene"
    assert report["last_y"] == sw.integrate(scene.system, "rk4", v=0.0, y=1.0, dt=0.01, steps=500).y[-1]
    assert (tmp_path / "run.png").stat().st_size > 1000
    scene = sw.scenes.scene(file)
    assert pickle.loads(pickle.dumps(scene.system)) == scene.system
    assert listed(capsys, "advise", file, "--tolerance", "1e-3")["best"]["error"] <= 1e-3
    assert "gamma" in printed(capsys, "explain", file, "rk4")


def test_several_scenes_are_told_apart(tmp_path: Path, file: str) -> None:
    two = tmp_path / "two.py"
    two.write_text(FILE + "\nfast = sw.Scene(duffing(omega=3.0), v=0.0, y=1.0, until=5.0)\n")
    assert sw.scenes.scene(f"{two}:fast").name == "fast"
    with pytest.raises(ArgumentError, match=r"expected one Scene in .*two\.py, got scene, fast; name one: .*two\.py:scene"):
        sw.scenes.scene(str(two))
    refused(UnknownNameError, r"scene: there is no 'fst'; did you mean 'fast'", sw.scenes.scene, f"{two}:fst")


def test_what_is_wrong_with_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "wrong.py"
    for text, message in (
        ("x = 1\n", r"makes no Scene; write scene = sw\.Scene"),
        ("1 / 0\n", r"cannot be run: ZeroDivisionError: division by zero"),
        ("x = (\n", r"cannot be run: SyntaxError"),
        ("import stepwell as sw\nscene = sw.Scene(sw.Pendulum(), v=0.0)\n", r"y: expected the coordinates"),
    ):
        path.write_text(text)
        refused(ArgumentError, message, sw.scenes.scene, str(path))
        assert complaint(capsys, "run", str(path), "--method", "rk4").startswith("stepwell: ")
    assert "there is no file 'nowhere.py'" in complaint(capsys, "run", "nowhere.py", "--method", "rk4")
