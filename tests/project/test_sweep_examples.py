"""The examples of sweeps: each prints what it did, draws, and notices a mistake."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from support import ROOT

EXAMPLES = ROOT / "examples" / "sweeps"

#: Equal bits make the last line the same everywhere.
LAST_LINES: dict[str, str] = {
    "axons": "fires from 8 µA/cm² on at 6.3 °C, up to 25.5 °C, 539 times a second at most",
    "basins": "31.9% have a neighbour that ends elsewhere; with half the step 0.0% end elsewhere",
    "bifurcation": "periods at γ = 0.20, 0.28, 0.29, 0.37, 0.50, 0.65: 1, 2, 4, 5, chaos, 2",
    "pushed_figure_eight": "together after 30 turns: 11.8% by leapfrog, 58.4% with adaptive steps",
}
#: A mistake in the equations of each, or in the start, which what is known must refute.
MISTAKES: dict[str, tuple[str, str]] = {
    "axons": ("/ (np.exp(3.0 - 0.1 * v) + 1.0)", "/ (np.exp(3.2 - 0.1 * v) + 1.0)"),
    "basins": ("1.0 / (r2 * np.sqrt(r2)) * away", "1.0 / r2 * away"),
    "bifurcation": ("- delta * v", "- 1.2 * delta * v"),
    "pushed_figure_eight": ("-2.0 * first", "-2.05 * first"),
}
SMALLER: dict[str, dict[str, Any]] = {
    "axons": {},
    "basins": {"size": 40},
    "bifurcation": {"size": 3},
    "pushed_figure_eight": {"size": 3},
}


@pytest.fixture(autouse=True)
def _figures_are_closed() -> Any:
    """Pyplot keeps every figure of the examples."""
    yield
    plt.close("all")


def test_every_example_is_pinned() -> None:
    assert sorted(LAST_LINES) == sorted(MISTAKES) == sorted(SMALLER) == sorted(file.stem for file in EXAMPLES.glob("*.py"))


@pytest.mark.parametrize("name", LAST_LINES)
def test_last_line_and_picture(name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"](tmp_path)
    assert capsys.readouterr().out.splitlines()[-1] == LAST_LINES[name]
    assert [file.name for file in tmp_path.iterdir()] == [f"{name}.png"]


@pytest.mark.mutant
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_noticed(name: str, tmp_path: Path) -> None:
    right, wrong = MISTAKES[name]
    code = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    assert code.count(right) == 1
    names: dict[str, Any] = {"__name__": name}
    exec(compile(code.replace(right, wrong), name, "exec"), names)
    with pytest.raises(AssertionError):
        names["main"](tmp_path, **SMALLER[name])


def test_a_map_is_its_mirror_image_to_the_last_bit_for_the_order_of_the_sum(tmp_path: Path) -> None:
    """With the pulls of the magnets added in another order, mirrored starts have other last bits."""
    names = runpy.run_path(str(EXAMPLES / "basins.py"))
    code = (EXAMPLES / "basins.py").read_text(encoding="utf-8")
    right = "(pulls[0] + pulls[1]) + pulls[2]"
    assert code.count(right) == 1
    other: dict[str, Any] = {"__name__": "other"}
    exec(compile(code.replace(right, "pulls[0] + (pulls[1] + pulls[2])"), "other", "exec"), other)
    starts = np.array([[-1.3, 1.3], [0.7, 0.7]])
    for namespace, alike in ((names, True), (other, False)):
        import stepwell as sw

        run = sw.integrate(namespace["pendulum"](), "rk4", v=0.0, y=starts, dt=0.04, steps=200)
        assert np.array_equal(run.y[-1, :, 0], [-1.0, 1.0] * run.y[-1, :, 1]) is alike


def test_larger_maps_go_to_a_store_and_have_the_same_bits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main = runpy.run_path(str(EXAMPLES / "basins.py"))["main"]
    main(tmp_path, size=24, store=tmp_path / "basins.zarr")
    main(tmp_path, size=24)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == lines[2:]
    assert (tmp_path / "basins.zarr").exists()
