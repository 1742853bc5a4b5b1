"""Every example runs without a warning, prints what it did, and draws; those of equations and of sweeps notice a mistake.

Equal bits make the last line the same everywhere.
"""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import stepwell as sw
from support import ROOT
from support.families import family

EXAMPLES = ROOT / "examples"
PICTURES = ROOT / "docs" / "images" / "equations"

LAST_LINES = {
    "chain_wave": "front at mass 201 of 400, energy within 0.0188 of its start",
    "compare_methods": "false_euler at Φ = 1.999: 500.5, at Φ = 2.001: 8e+110",
    "game_loop": "t = 10 s after 2400 steps: y = -0.042682, -0.000932, 0.000000 m",
    "resonance": "peak 5.0252 at ω = 0.99; true 5.0252 there",
    "sweep": "54492 of 100000 diverged; the last good one has 19.1014 Hz",
    "wing_nut": "the angular momentum stays within 1.0e-07, the energy within 6.3e-09",
    "equations/camera": "a spring of 20 rad/s is stable from 24.14 frames a second on",
    "equations/cart_pole": "6106 of 10100 poles are caught, all those that the two formulas predict and no other",
    "equations/double_pendulum": "energy after 120 s: -0.759 J alone, +0.00000 J with a projection",
    "equations/epidemic": "at R0 = 2 79.68 % fall ill; the formula says 79.68 %",
    "equations/luneburg_lens": "13 rays pass the focus within 2e-08 radii",
    "equations/neuron": "fires from 6.5 µA/cm² on, with 55 Hz; rest is unstable beyond 9.78",
    "equations/oscillator_circuit": "period 6.2871 at µ = 0.1, 34.608 at µ = 20; the two laws say 6.2871 and 34.784",
    "equations/predators": "mean prey over 1000 years: 4.0056 thousand; in equilibrium 4.0000",
    "equations/reaction": "one mixture: 819 steps of rodas5p, 158502 of dop853",
    "equations/star_orbits": "5307 crossings at E = 1/8; stars escape beyond E = 0.166667",
    "equations/turing": "8 stripes on a ring of 8 predicted wavelengths of 10.10",
    "sweeps/axons": "fires from 8 µA/cm² on at 6.3 °C, up to 25.5 °C, 539 times a second at most",
    "sweeps/basins": "31.9% have a neighbour that ends elsewhere; with half the step 0.0% end elsewhere",
    "sweeps/bifurcation": "periods at γ = 0.20, 0.28, 0.29, 0.37, 0.50, 0.65: 1, 2, 4, 5, chaos, 2",
    "sweeps/pushed_figure_eight": "together after 30 turns: 11.8% by leapfrog, 58.4% with adaptive steps",
}

#: A mistake in the equations of each, or in the start, which what is known must refute.
MISTAKES = {
    "equations/camera": ("- 2.0 * omega * v", "- 1.9 * omega * v"),
    "equations/cart_pole": ("LENGTH * turning**2 - G * cosine", "LENGTH * turning**2 + G * cosine"),
    "equations/double_pendulum": ("right = v[0] ** 2 * sine", "right = -(v[0] ** 2) * sine"),
    "equations/epidemic": ("- ill / duration", "- 1.01 * ill / duration"),
    "equations/luneburg_lens": ("np.where(inside, -y, 0.0)", "np.where(inside, -1.02 * y, 0.0)"),
    "equations/neuron": ("/ (np.exp(3.0 - 0.1 * v) + 1.0)", "/ (np.exp(3.2 - 0.1 * v) + 1.0)"),
    "equations/oscillator_circuit": ("(1.0 - y**2)", "(1.0 - 1.1 * y**2 * abs(y))"),
    "equations/predators": ("births - hunted * np.exp(v)", "births - hunted * np.exp(v) + 0.001 * y"),
    "equations/reaction": ("        x - z,", "        x - 1.1 * z,"),
    "equations/star_orbits": ("- y[0] ** 2 + y[1] ** 2", "- y[0] ** 2 + 1.01 * y[1] ** 2"),
    "equations/turing": ("b * u - growth + dy", "b * u - growth + 0.7 * dy"),
    "sweeps/axons": ("/ (np.exp(3.0 - 0.1 * v) + 1.0)", "/ (np.exp(3.2 - 0.1 * v) + 1.0)"),
    "sweeps/basins": ("1.0 / (r2 * np.sqrt(r2)) * away", "1.0 / r2 * away"),
    "sweeps/bifurcation": ("- delta * v", "- 1.2 * delta * v"),
    "sweeps/pushed_figure_eight": ("-2.0 * first", "-2.05 * first"),
}

#: Sweeps that suffice for that.
SMALLER = {"sweeps/basins": {"size": 40}, "sweeps/bifurcation": {"size": 3}, "sweeps/pushed_figure_eight": {"size": 3}}

#: These take seconds.
LONG = ("sweeps/axons", "sweeps/pushed_figure_eight")


@pytest.fixture(autouse=True)
def _figures_are_closed() -> Any:
    """Pyplot keeps every figure of the examples, and warns of the twenty-first."""
    yield
    plt.close("all")


def code_of(name: str) -> str:
    return (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")


def changed(name: str, right: str, wrong: str) -> dict[str, Any]:
    """The names of an example in which one place is another."""
    assert code_of(name).count(right) == 1
    names: dict[str, Any] = {"__name__": Path(name).name}
    exec(compile(code_of(name).replace(right, wrong), name, "exec"), names)
    return names


def test_every_example_is_pinned_shown_and_told_of() -> None:
    """What the gallery shows is what runs."""
    folders = (EXAMPLES, EXAMPLES / "equations", EXAMPLES / "sweeps")  # the site runs the others
    files = sorted(f.relative_to(EXAMPLES).with_suffix("").as_posix() for folder in folders for f in folder.glob("*.py"))
    assert files == sorted(LAST_LINES)
    assert sorted(MISTAKES) == [name for name in files if "/" in name]
    page = (ROOT / "docs" / "howto" / "examples.md").read_text(encoding="utf-8")
    equations = [Path(name).name for name in files if name.startswith("equations/")]
    assert sorted(re.findall(r"\(\.\./images/equations/(\w+)\.png\)", page)) == equations
    assert sorted(file.stem for file in PICTURES.glob("*.png")) == equations
    for name in equations:
        (shown,) = re.findall(rf"<!-- lines of examples/equations/{name}\.py -->\n```python\n(.*?)```\n", page, re.DOTALL)
        assert shown in code_of(f"equations/{name}"), name
        assert "@sw.system" in shown, name
        assert (PICTURES / f"{name}.png").stat().st_size <= 60 * 1024, name


@pytest.mark.parametrize("name", family(LAST_LINES, lambda name: name not in LONG))
def test_last_line_and_picture(name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    names = runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__" if "/" not in name else name)
    if "/" in name:
        names["main"](tmp_path)
        assert [file.name for file in tmp_path.iterdir()] == [f"{Path(name).name}.png"]
    assert capsys.readouterr().out.splitlines()[-1] == LAST_LINES[name]


@pytest.mark.mutant
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_noticed(name: str, tmp_path: Path) -> None:
    names = changed(name, *MISTAKES[name])
    with pytest.raises(AssertionError):
        names["main"](tmp_path, **SMALLER.get(name, {}))


def test_a_map_is_its_mirror_image_to_the_last_bit_for_the_order_of_the_sum() -> None:
    """With the pulls of the magnets added in another order, mirrored starts have other last bits."""
    right = "(pulls[0] + pulls[1]) + pulls[2]"
    starts = np.array([[-1.3, 1.3], [0.7, 0.7]])
    for wrong, alike in ((right, True), ("pulls[0] + (pulls[1] + pulls[2])", False)):
        system = changed("sweeps/basins", right, wrong)["pendulum"]()
        run = sw.integrate(system, "rk4", v=0.0, y=starts, dt=0.04, steps=200)
        assert np.array_equal(run.y[-1, :, 0], [-1.0, 1.0] * run.y[-1, :, 1]) is alike


def test_larger_maps_go_to_a_store_and_have_the_same_bits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main = runpy.run_path(str(EXAMPLES / "sweeps" / "basins.py"))["main"]
    main(tmp_path, size=24, store=tmp_path / "basins.zarr")
    main(tmp_path, size=24)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == lines[2:]
    assert (tmp_path / "basins.zarr").exists()
