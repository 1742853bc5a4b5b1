"""The worked examples of own equations: each agrees with what is known, prints what it did, draws, and notices a mistake."""

import re
import runpy

import matplotlib.pyplot as plt
import pytest
from support import ROOT

EXAMPLES = ROOT / "examples" / "equations"
PICTURES = ROOT / "docs" / "images" / "equations"

#: Equal bits make the last line the same everywhere.
LAST_LINES = {
    "camera": "a spring of 20 rad/s is stable from 24.14 frames a second on",
    "cart_pole": "6106 of 10100 poles are caught, all those that the two formulas predict and no other",
    "double_pendulum": "energy after 120 s: -0.759 J alone, +0.00000 J with a projection",
    "epidemic": "at R0 = 2 79.68 % fall ill; the formula says 79.68 %",
    "luneburg_lens": "13 rays pass the focus within 2e-08 radii",
    "neuron": "fires from 6.5 µA/cm² on, with 55 Hz; rest is unstable beyond 9.78",
    "oscillator_circuit": "period 6.2871 at µ = 0.1, 34.608 at µ = 20; the two laws say 6.2871 and 34.784",
    "predators": "mean prey over 1000 years: 4.0056 thousand; in equilibrium 4.0000",
    "reaction": "one mixture: 819 steps of rodas5p, 158502 of dop853",
    "star_orbits": "5307 crossings at E = 1/8; stars escape beyond E = 0.166667",
    "turing": "8 stripes on a ring of 8 predicted wavelengths of 10.10",
}

#: A mistake in the equations of each, which what is known must refute.
MISTAKES = {
    "camera": ("- 2.0 * omega * v", "- 1.9 * omega * v"),
    "cart_pole": ("LENGTH * turning**2 - G * cosine", "LENGTH * turning**2 + G * cosine"),
    "double_pendulum": ("right = v[0] ** 2 * sine", "right = -(v[0] ** 2) * sine"),
    "epidemic": ("- ill / duration", "- 1.01 * ill / duration"),
    "luneburg_lens": ("np.where(inside, -y, 0.0)", "np.where(inside, -1.02 * y, 0.0)"),
    "neuron": ("/ (np.exp(3.0 - 0.1 * v) + 1.0)", "/ (np.exp(3.2 - 0.1 * v) + 1.0)"),
    "oscillator_circuit": ("(1.0 - y**2)", "(1.0 - 1.1 * y**2 * abs(y))"),
    "predators": ("births - hunted * np.exp(v)", "births - hunted * np.exp(v) + 0.001 * y"),
    "reaction": ("        x - z,", "        x - 1.1 * z,"),
    "star_orbits": ("- y[0] ** 2 + y[1] ** 2", "- y[0] ** 2 + 1.01 * y[1] ** 2"),
    "turing": ("b * u - made + dy", "b * u - made + 0.7 * dy"),
}


@pytest.fixture(autouse=True)
def _figures_are_closed():
    """Pyplot keeps every figure of the examples, and warns of the twenty-first."""
    yield
    plt.close("all")


def run(code, name, folder):
    """Runs ``main`` of an example's text."""
    names = {"__name__": name}
    exec(compile(code, str(EXAMPLES / f"{name}.py"), "exec"), names)
    names["main"](folder)


def test_every_example_is_pinned_shown_and_told_of():
    known = sorted(file.stem for file in EXAMPLES.glob("*.py"))
    assert known == sorted(LAST_LINES) == sorted(MISTAKES) == sorted(file.stem for file in PICTURES.glob("*.png"))
    page = (ROOT / "docs" / "howto" / "examples.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"\(\.\./images/equations/(\w+)\.png\)", page)) == known


@pytest.mark.parametrize("name", LAST_LINES)
def test_last_line_and_picture(name, capsys, tmp_path):
    runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"](tmp_path)
    assert capsys.readouterr().out.splitlines()[-1] == LAST_LINES[name]
    assert [file.name for file in tmp_path.iterdir()] == [f"{name}.png"]


@pytest.mark.mutant
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_noticed(name, tmp_path):
    right, wrong = MISTAKES[name]
    code = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    assert code.count(right) == 1
    with pytest.raises(AssertionError):
        run(code.replace(right, wrong), name, tmp_path)


def test_the_page_has_the_lines_of_the_file_and_small_pictures():
    """What the gallery shows is what runs."""
    page = (ROOT / "docs" / "howto" / "examples.md").read_text(encoding="utf-8")
    for name in LAST_LINES:
        code = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
        (shown,) = re.findall(rf"<!-- lines of examples/equations/{name}\.py -->\n```python\n(.*?)```\n", page, re.DOTALL)
        assert shown in code, name
        assert "@sw.system" in shown, name
        assert (PICTURES / f"{name}.png").stat().st_size <= 60 * 1024, name
