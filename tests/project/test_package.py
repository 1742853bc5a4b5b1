"""The package as a whole: records, import time, what it needs."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference.implicit import Implicit
from support import ROOT

REFERENCE = Path(sw.__file__).parent / "reference"


def test_every_method_has_both_files() -> None:
    """A method stands in one Rust file and one reference file of the same name."""
    rust = ROOT / "rust" / "core" / "src" / "model"
    names = {m.name for m in sw.methods()}
    assert names == {p.stem for p in (REFERENCE / "steppers").glob("*.py")} - {"__init__"}
    assert names == {p.stem for p in (rust / "steppers").glob("*.rs")} - {"mod"}
    assert set(_core.systems()) == {p.stem for p in (REFERENCE / "systems").glob("*.py")} - {"__init__"}


def test_every_record_is_complete() -> None:
    for method in sw.methods():
        assert method.title
        assert method.order >= 1
        assert method.evaluations >= 1
        assert method.limit >= 0
        assert method.section.startswith("§") or method.section == "not in Hoffmann (2002)", method
        assert method.nodes
        assert list(method.nodes) == sorted(set(method.nodes)), method
        assert all(0 <= c <= 1 for c in method.nodes), method
        assert len(method.about) > 40, method
        assert method.reference
        for text in (method.title, *method.other_names, *method.false_friends, method.reference, method.about):
            assert text in (method.__doc__ or ""), method
        assert sw.method(method.name) is method
        assert hasattr(method.steps, "start") == hasattr(method.steps, "finish") == (method.carry is not None), method


def test_the_recorded_evaluations_are_the_ones_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted on the reference: one evaluation is one of each block. Those for derivatives do not count."""
    monkeypatch.setattr(Implicit, "_derivatives", lambda *_: [[None, None]] * 3)  # by v, by y and by the time

    class Counting:
        def __init__(self) -> None:
            self.v = self.y = 0
            self.last, self.times = "", set[float]()

        def dv(self, t: float, v: float, y: float) -> float:
            self.v += 1
            self.last = "v"
            self.times.add(t)
            return 0.0

        def dy(self, t: float, v: float, y: float) -> float:
            self.y += 1
            self.last = "y"
            return 0.0

    for method in sw.methods():
        if method.has_series:  # the rates are run once, and each order of the series counts as an evaluation
            assert (method.evaluations, method.nodes) == (method.order, (0.0,))
            continue
        counting = Counting()
        method.steps.step(counting, 0.0, 0.25, 0.0, 1.0)
        assert all(any(t == pytest.approx(c * 0.25) for c in method.nodes) for t in counting.times), method
        # A method that begins and ends with a drift, as PEFRL, has one more of the rate that costs nothing.
        drifts = method.needs_acceleration and counting.last == "y" and counting.y > counting.v
        assert drifts or method.name != "pefrl"
        assert (counting.v, counting.y) == (method.evaluations, method.evaluations + drifts), method


#: Methods with a stage that counts only in the estimate of the error.
WITH_A_STAGE_FOR_THE_ESTIMATE = {"fehlberg", "rosenbrock23", "bs32", "dopri5", "tsit5", "vern7", "vern9"}


def test_a_stage_of_weight_zero_is_not_evaluated() -> None:
    """Of Fehlberg's six stages one counts only in the estimate, so a step of fixed length makes five, an attempt all six.

    A tolerance of 1e-5 is one of order 8, that of steps of fixed length by the series.
    """
    free = sw.Oscillator().scaled(0.1, ())
    assert (sw.method("fehlberg").evaluations, 0.5 in sw.method("fehlberg").nodes) == (5, False)
    for method in sw.methods():
        stages = getattr(method.steps, "stages", None)
        extra = 0 if stages is None else len(stages(free, 0.0, 0.1, 0.5, 1.0)) - method.evaluations
        assert extra == (method.name in WITH_A_STAGE_FOR_THE_ESTIMATE), method
        assert method.attempt_evaluations == (0 if method.error_order is None else method.evaluations + extra), method
        if method.error_order is not None:
            run = sw.integrate(sw.Oscillator(), method, v=0.0, y=1.0, tolerance=1e-5, at=[1.0])
            assert run.paces is not None
            # And twice for the output time; a series finds the coefficients of that step alone.
            attempts = int(run.paces.accepted + run.paces.rejected) + (1 if method.has_series else 2)
            assert run.paces.evaluations == method.attempt_evaluations * attempts, method


def test_methods_are_in_the_documents_order() -> None:
    sections = [int(m.section.strip("§")) if m.section.startswith("§") else 99 for m in sw.methods()]
    assert sections == sorted(sections)


def test_import_is_quick_and_small() -> None:
    """What is used later is imported later, so that importing takes as long with compiled byte code as without."""
    code = "import numpy, sys; before = set(sys.modules); import stepwell; print(*sorted(set(sys.modules) - before))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    # A coarse guard of the 20 ms promise, which the benchmarks measure: modules cost time.
    assert set(loaded) <= {"__future__", "stepwell", *(f"stepwell.{name}" for name in ("_core", "base", "base.registry"))}


def test_a_run_imports_no_more_than_it_needs() -> None:
    """No plotting, no terminal library, no reference steppers."""
    code = (
        "import numpy, sys; before = set(sys.modules); import stepwell as sw\n"
        "sw.integrate(sw.Oscillator(), 'rk4', v=0.0, y=1.0, dt=0.1, steps=10)\n"
        "print(*sorted(set(sys.modules) - before))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    packages = {module.split(".")[0] for module in loaded}
    heavy = ["matplotlib", "rich", "numba", "scipy", "hypothesis", "asyncio", "argparse", "gymnasium", "pandas", "xarray", "zarr"]
    assert not packages.intersection(heavy)
    assert not [m for m in loaded if m.startswith(("stepwell.reference.steppers.", "stepwell.interop", "stepwell.views"))]
    kinds = [module for module in loaded if module.startswith("stepwell.model.systems.")]  # of which there may be more
    assert len(loaded) - len(kinds) <= 75, loaded


def test_names_are_those_that_type_checkers_see() -> None:
    """They stand once, in ``__init__.pyi``, in the plain form that ``__init__.py`` reads: each imports what its line says."""
    tree = ast.parse(Path(sw.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    assert all(len(node.names) == 1 and node.names[0].asname == node.names[0].name for node in imports)
    aliases = [(node.module or "", node.names[0].name) for node in imports]
    own = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)} | {"__version__"}
    assert {name for _, name in aliases} | own == set(sw.__all__)
    assert len(imports) + len(own) == len(sw.__all__)
    for module, name in aliases:
        expected = importlib.import_module(f"stepwell.{module or name}")
        assert getattr(sw, name) is (getattr(expected, name) if module else expected)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = sw.nothing  # type: ignore[attr-defined]


def test_a_fork_can_still_use_threads() -> None:
    """No pool of threads that a forked child would wait for in vain: multiprocessing works."""
    if sys.platform == "win32":
        return
    code = (
        "import multiprocessing as mp, numpy as np, stepwell as sw\n"
        "def run(_):\n"
        "    r = sw.integrate(sw.Oscillator(np.ones(10000)), 'rk4', v=0.0, y=1.0, dt=0.1, steps=100, threads=2)\n"
        "    return r.y[-1, 0]\n"
        "if __name__ == '__main__':\n"
        "    here = run(0)\n"
        "    with mp.get_context('fork').Pool(2) as pool:\n"
        "        assert pool.map_async(run, range(4)).get(timeout=20) == [here] * 4\n"
        "    print('ok')\n"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "ok", done.stderr


def test_two_python_threads_at_once() -> None:
    """The GIL is released: runs in several Python threads do not disturb each other."""
    from concurrent.futures import ThreadPoolExecutor

    def run(i: int) -> float:
        r = sw.integrate(sw.Oscillator(1.0 + i / 10), "rk4", v=0.0, y=np.ones(200), dt=0.01, steps=5000)
        return float(r.y[-1, 0])

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(run, range(8))) == [run(i) for i in range(8)]
