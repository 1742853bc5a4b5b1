"""Methods of two files, systems of three, options of one entry: those of ``docs/developing/adding.md``, in a copy of the tree."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support import ROOT

FILES = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)
CHANGES = re.compile(r"<!-- change: (\S+) -->\n```diff\n(.*?)```", re.DOTALL)
LEFT_OUT = shutil.ignore_patterns("target*", ".venv*", ".git", "out", "dist", "*.so", "__pycache__", ".*_cache", ".hypothesis")
#: What is compiled anew; stepwell-base, which the page does not change, is not.
ADDED_TO = shutil.ignore_patterns("*stepwell[-_]core*", "*stepwell[-_]py*", "lib_core*", "_core-*")
#: A core that is compiled in a sixth of the time: bits do not depend on it, nor do kernels, which are written at run time.
NOT_OPTIMISED = """
[profile.release.package.stepwell-core]
opt-level = 0

[profile.release.package.stepwell-py]
opt-level = 0
"""

pytestmark = pytest.mark.skipif(shutil.which("cargo") is None, reason="there is no cargo here, which builds the core")


def changed(text: str, change: str) -> str:
    """The text with the lines behind + in the place of those behind −; the lines behind a space say where."""
    lines = change.splitlines(keepends=True)
    old, new = ("".join(line[1:] for line in lines if line[0] in signs) for signs in (" -", " +"))
    assert text.count(old) == 1, f"{old!r} is there {text.count(old)} times"
    return text.replace(old, new)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project with what the page adds, and its wheel unpacked into ``site``."""
    tree = tmp_path_factory.mktemp("tree") / "stepwell"
    shutil.copytree(ROOT, tree, ignore=LEFT_OUT)
    page = (tree / "docs" / "developing" / "adding.md").read_text(encoding="utf-8")
    added = FILES.findall(page)
    assert sorted(name for name, _ in added) == [
        "python/stepwell/model/systems/van_der_pol.py",
        "python/stepwell/model/tether.py",
        "python/stepwell/reference/steppers/midpoint.py",
        "python/stepwell/reference/systems/van_der_pol.py",
        "python/stepwell/reference/tether.py",
        "rust/core/src/model/around/tether.rs",
        "rust/core/src/model/steppers/midpoint.rs",
        "rust/core/src/model/systems/van_der_pol.rs",
    ]
    for name, text in added:
        (tree / name).write_text(text, encoding="utf-8")
    for name, change in CHANGES.findall(page):
        (tree / name).write_text(changed((tree / name).read_text(encoding="utf-8"), change), encoding="utf-8")
    # In a target folder of its own, which is kept: cargo takes the copy's core for the project's, and the lists of files that
    # build.rs has made for the one would be found by the other.
    built = Path(os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target")))
    target = str(built / "adding")
    for part in (".fingerprint", "build", "deps"):  # what was built of other crates serves here, too
        if (built / "release" / part).exists() and not (built / "adding" / "release" / part).exists():
            shutil.copytree(built / "release" / part, built / "adding" / "release" / part, ignore=ADDED_TO)
    with (tree / "Cargo.toml").open("a", encoding="utf-8") as manifest:
        manifest.write(NOT_OPTIMISED)
    build = [sys.executable, "-m", "maturin", "build", "--release", "--quiet", "--out", "dist"]
    subprocess.run(build, cwd=tree, env=os.environ | {"CARGO_TARGET_DIR": target}, check=True)
    (wheel,) = (tree / "dist").glob("*.whl")
    shutil.unpack_archive(wheel, tree / "site", "zip")
    return tree


def run(tree: Path, *arguments: str) -> str:
    """What a Python command prints in the copy."""
    environment = os.environ | {"PYTHONPATH": str(tree / "site")}
    done = subprocess.run([sys.executable, *arguments], cwd=tree, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def suite(tree: Path, named: str, *files: str) -> subprocess.CompletedProcess[str]:
    """The copy's tests of these files, of that name, in one process, for to collect them takes long."""
    paths = [str(*tree.glob(f"tests/*/test_{file}.py")) for file in files]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", named, *paths]
    environment = os.environ | {"PYTHONPATH": str(tree / "site")}
    return subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)


#: Of what is added a mistake in the reference, and the tests that iterate over the catalogue: they pass, and these files of them
#: notice the mistake.
MISTAKES = {
    "the method": (
        ("reference/steppers/midpoint.py", "y + 0.5 * dy1", "y + 0.25 * dy1"),
        "test_a_step and (damped or top) or test_stability",
        ("graphs", "stability"),
        {"graphs", "stability"},
    ),
    "the system": (
        ("reference/systems/van_der_pol.py", "(1.0 - y * y)", "(1.0 + y * y)"),
        "Pol",
        ("graphs", "tracing"),
        {"graphs"},
    ),
    "what is around a system": (
        ("reference/tether.py", "self.anchor.at(t) - y", "self.anchor.at(t) + y"),
        "tethered",
        ("graphs", "tracing"),
        {"graphs"},
    ),
    "the operation": (
        ("reference/tape/operations.py", '"ceiling": Kind(np.ceil', '"ceiling": Kind(np.floor'),
        "test",
        ("operations", "functions_traced"),
        {"functions_traced"},
    ),
}


@pytest.mark.parametrize("added", MISTAKES)
def test_the_suite_tests_what_is_added(tree: Path, added: str) -> None:
    """It has no list of methods, systems, parts and operations of its own."""
    (name, right, wrong), named, files, noticing = MISTAKES[added]
    done = suite(tree, named, *files)
    assert done.returncode == 0, done.stdout
    path = tree / "site" / "stepwell" / name
    text = path.read_text(encoding="utf-8")
    assert text.count(right) == 1
    path.write_text(text.replace(right, wrong), encoding="utf-8")
    try:
        done = suite(tree, named, *files)
    finally:
        path.write_text(text, encoding="utf-8")
    assert noticing <= set(re.findall(r"^FAILED tests/\w+/test_(\w+)\.py", done.stdout, re.MULTILINE)), done.stdout[-3000:]


def test_the_command_line_and_the_docs_show_it(tree: Path) -> None:
    assert "Midpoint" in run(tree, "-m", "stepwell", "methods", "midpoint")
    assert "midpoint" in run(tree, "-m", "stepwell", "methods", "--json")
    # All pages with tables of methods; what the document says of its own ones does not change.
    run(tree, "docs/generate.py", "docs/howto/methods.md", "docs/developing/naming.md", "docs/theory/stability.md")
    assert "| `midpoint` | Midpoint | explicit midpoint rule | 2 | 2 |" in (tree / "docs" / "howto" / "methods.md").read_text(
        encoding="utf-8"
    )
    run(tree, "-m", "stepwell", "chart", "oscillator", "-o", "out", "--methods", "midpoint,rk4")
    assert "midpoint" in (tree / "out" / "oscillator.csv").read_text(encoding="utf-8")


def test_it_is_the_method_of_that_name(tree: Path) -> None:
    """Against the formula, by hand: one step of y' = v, v' = −y."""
    code = (
        "import stepwell as sw\n"
        "r = sw.integrate(sw.Oscillator(1.0), 'midpoint', v=0.25, y=1.0, dt=0.5, steps=1)\n"
        "assert (r.v[-1], r.y[-1]) == (0.25 - 0.5 * (1.0 + 0.25 * 0.25), 1.0 + 0.5 * (0.25 - 0.25 * 1.0))\n"
    )
    run(tree, "-c", code)


def test_it_is_the_system_of_that_name(tree: Path) -> None:
    """Every start but rest ends on the limit cycle, whose amplitude at μ = 1 is 2.00862 and whose period 6.66329 (Urabe 1967)."""
    # Steps of 0.01 see a maximum up to 0.005² · |ÿ|/2 ≤ 5e-5 too low, and 50 periods to within 0.01/50.
    code = (
        "import numpy as np, stepwell as sw\n"
        "y = np.geomspace(0.01, 4.0, 1000)\n"
        "run = sw.integrate(sw.VanDerPol(1.0), 'rk4', v=0.0, y=y, dt=0.01, steps=40000, every=1)\n"
        "late = run.y[5000:]\n"
        "assert abs(late.max(axis=0) - 2.00862).max() < 6e-5\n"
        "rises = np.flatnonzero((late[:-1, 500] < 0) & (late[1:, 500] >= 0))\n"
        "assert abs(0.01 * (rises[50] - rises[0]) / 50 - 6.66329) < 2.1e-4\n"
        "chosen = sw.integrate(sw.VanDerPol(1.0), 'dop853', v=0.0, y=y, tolerance=1e-9, at=[5.0])\n"
        "steps = sw.integrate(sw.VanDerPol(1.0), 'dop853', v=0.0, y=y, dt=0.01, steps=500)\n"
        "assert abs(chosen.y[-1] - steps.y[-1]).max() < 1e-6\n"
    )
    run(tree, "-c", code)


def test_it_is_the_spring_of_that_name(tree: Path) -> None:
    """A free mass at a moving anchor is the driven oscillator, forward and backward in time, by fixed and adaptive steps."""
    code = (
        "import stepwell as sw\n"
        "anchor = sw.Sinusoid(0.3, 2.0, 0.5)\n"
        "tethered = sw.Oscillator(0.0, form='physical').surrounded(sw.Tether(1.5, anchor))\n"
        "driven = sw.Oscillator(1.5, x=anchor, form='physical')\n"
        "fixed, adaptive = {'dt': 0.01, 'steps': 500}, {'tolerance': 1e-10, 'at': [5.0]}\n"
        "crossing = sw.Event(lambda t, v, y: y, name='crossing')\n"
        "for options in (fixed, fixed | {'dt': -0.01}, adaptive, adaptive | {'at': [-5.0]}):\n"
        "    arguments = {'v': 0.0, 'y': 1.0, 'events': crossing} | options\n"
        "    runs = [sw.integrate(each, 'dop853', **arguments) for each in (tethered, driven)]\n"
        "    reference = sw.integrate(tethered, 'dop853', **arguments, backend='numpy')\n"
        "    assert reference.y.tobytes() == runs[0].y.tobytes()\n"
        "    assert abs(runs[0].y[-1] - runs[1].y[-1]) < 1e-8\n"
        "    assert abs(runs[0].events['crossing'].t - runs[1].events['crossing'].t).max() < 1e-8\n"
    )
    run(tree, "-c", code)


def test_it_is_the_option_of_that_name(tree: Path) -> None:
    """In signature and documentation, checked, kept by short runs and by runs that go on, refused where it means nothing."""
    code = (
        "import inspect, stepwell as sw\n"
        "assert 'label' in inspect.signature(sw.integrate).parameters and 'label: a name for the run' in sw.integrate.__doc__\n"
        "assert 'label' not in inspect.signature(sw.World).parameters and 'label:' not in sw.World.__doc__\n"
        "start, fixed, adaptive = {'v': 0.0, 'y': 1.0}, {'dt': 0.1, 'steps': 2}, {'tolerance': 1e-6, 'at': [1.0]}\n"
        "for steps, more in ((fixed, {'steps': 2}), (adaptive, {'at': [2.0]})):\n"
        "    run = [sw.integrate(sw.Oscillator(), 'dop853', **start, **steps, label='calm') for _ in range(4)][-1]\n"
        "    plain = sw.integrate(sw.Oscillator(), 'dop853', **start, **steps)\n"
        "    assert run.y.tobytes() == plain.y.tobytes() and 'calm' not in repr(plain)\n"
        "    for one in (run, sw.integrate(sw.Oscillator(), 'dop853', resume=run, **more)):\n"
        "        assert repr(one).startswith('<calm: run of Oscillator('), one\n"
        "    prepared = sw.prepare(sw.Oscillator(), 'dop853', **start, **steps, label='calm')\n"
        "    assert [repr(prepared(0.0, 2.0))[:6] for _ in range(3)] == 3 * ['<calm:']\n"
        "def refused(call, **options):\n"
        "    try:\n"
        "        call(**options)\n"
        "    except sw.StepwellError as error:\n"
        "        return str(error)\n"
        "oscillator = {'system': sw.Oscillator(), 'method': 'rk4', **start}\n"
        "assert refused(sw.integrate, **oscillator, **fixed, label=3) == 'label: expected text of one line, got 3'\n"
        "assert refused(sw.World, **oscillator, dt=0.1, label='a') == 'label: a world does not keep states; integrate does'\n"
        "axes = {'y': ('y', [1.0, 2.0])}\n"
        "swept = refused(sw.sweep, system=sw.Oscillator(), axes=axes, method='rk4', v=0.0, **fixed, label='a')\n"
        "assert swept == 'label: a sweep names its results by units='\n"
    )
    run(tree, "-c", code)


def test_it_is_the_operation_of_that_name(tree: Path) -> None:
    """One operation in place of three, the same bits by interpreter, machine code and reference, and no derivative by it."""
    code = (
        "import numpy as np, stepwell as sw\n"
        "from stepwell import _core\n"
        "@sw.system\n"
        "def steps(t, v, y):\n"
        "    return -np.ceil(3.0 * y) - 0.1 * v\n"
        "y = np.linspace(-2.0, 2.0, 64)\n"
        "runs = [sw.integrate(steps(), 'rk4', v=0.0, y=y, dt=0.01, steps=2000, backend=b) for b in ('rust', 'numpy')]\n"
        "assert np.array_equal(runs[0].y, runs[1].y)\n"
        "assert 'ceil(' in str(sw.explain(steps(), 'rk4'))\n"
        "assert 'Math.ceil(' in sw.export(steps(), 'rk4', 'javascript', v=0.0, y=1.0).source\n"
        "tape = _core.Tape()\n"
        "assert [line[0] for line in tape.operations([tape.state(0).ceil()])[0]] == ['state', 'ceiling']\n"
    )
    run(tree, "-c", code)
    level = {"STEPWELL_KERNELS": "interpret"}
    subprocess.run(
        [sys.executable, "-c", code], cwd=tree, env=os.environ | level | {"PYTHONPATH": str(tree / "site")}, check=True
    )


def test_what_is_added_is_formatted(tree: Path) -> None:
    page = (ROOT / "docs" / "developing" / "adding.md").read_text(encoding="utf-8")
    files = {name for name, _ in [*FILES.findall(page), *CHANGES.findall(page)]}
    python, rust = ([name for name in files if name.endswith(end)] for end in (".py", ".rs"))
    run(tree, "-m", "ruff", "format", "--check", "--quiet", *python)
    run(tree, "-m", "ruff", "check", "--quiet", *python)
    subprocess.run(["rustfmt", "--edition", "2024", "--check", *rust], cwd=tree, check=True)
