"""Machine code in a process: where none may be written, after a fork, from several threads, within its bound, in time."""

import itertools
import json
import multiprocessing
import os
import re
import subprocess
import sys
import threading
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.runs import engine
from support import ROOT
from support import own_systems as own

from benches import compile as compiling

MEMBERS = 300
COMPILED = pytest.mark.skipif(sw.isa() == "interpret", reason="everything is interpreted")
LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux about the process")

#: Runs of several kinds, long enough to be compiled.
RUNS: dict[str, tuple[sw.System, str]] = {
    "free": (sw.Oscillator(np.linspace(0.5, 2.0, MEMBERS)), "false_euler"),
    "held": (sw.Oscillator(1.3, 0.1, x=sw.Sampled(np.linspace(-1.0, 1.0, 16), 0.2)), "rk4"),
    "pendulum": (sw.Pendulum(np.linspace(0.5, 2.0, MEMBERS), 0.1, a=sw.Sinusoid(0.5, 1.1, 0.3)), "standard_heun"),
    "moon": (sw.RestrictedThreeBody(np.linspace(0.01, 0.3, MEMBERS)), "merson"),
}


def bits(name: str, steps: int = 300) -> bytes:
    """The last states of a run."""
    system, method = RUNS[name]
    v, y = (np.zeros((*shape, MEMBERS)) + start for shape, start in ((system.v_shape, 0.1), (system.y_shape, 0.6)))
    run = sw.integrate(system, method, v=v, y=y, dt=0.01, steps=steps, threads=1)
    return run.v.tobytes() + run.y.tobytes()


def code_bytes(name: str) -> int:
    """How long the machine code of a run is, if it is written now."""
    system, method = RUNS[name]
    kernel = _core.compiled(engine.model(engine.Plan(system, sw.method(method), (MEMBERS,), 0.01)), MEMBERS)
    assert kernel is not None
    return int(kernel["bytes"])


def executable() -> list[int]:
    """The sizes of executable mappings that are no file: kernels."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    maps = [re.match(r"([0-9a-f]+)-([0-9a-f]+) (\S+) \S+ \S+ \S+\s*(.*)", line) for line in lines]
    return [int(m[2], 16) - int(m[1], 16) for m in maps if m and "x" in m[3] and not m[4]]


def in_a_process(code: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Python text in a process of its own, which imports from where this one does."""
    command = [sys.executable, *options, "-c", code, json.dumps(sys.path)]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT / "tests" / "reference", check=False)


# ---- long steps


def compiled(system: sw.System, method: str, members: int) -> dict[str, Any]:
    """The step of so many members as machine code."""
    kernel = _core.compiled(engine.model(engine.Plan(system, sw.method(method), (), 0.01)), members)
    assert kernel is not None
    assert kernel["interpreted"] is None
    return kernel


@COMPILED
@pytest.mark.parametrize("members", [1, 1024])
def test_an_operation_of_a_longer_step_has_no_more_code(members: int) -> None:
    """Up to 100 000 operations: rings of springs, all of whose numbers would wait at once in the order of the arrays."""
    each = []
    for n in (30, 100, 300, 1150):
        kernel = compiled(own.springs().for_state_shapes(None, np.zeros((n, 3))), "rk4", members)
        each.append(kernel["bytes"] / (compiling.arithmetic(kernel["computed"]) * (kernel["block_vectors"])))
    assert max(each) < 1.25 * each[0], each


@COMPILED
def test_what_depends_on_the_time_alone_takes_no_operations_of_a_member() -> None:
    """Sines of the time, of which fifteen once made the step so long that each was interpreted for every stage."""

    def driven(sines: int) -> sw.System:
        @sw.system
        def pushed(t: Any, v: Any, y: Any) -> Any:
            return sum(np.sin(k * t) for k in range(1, 1 + sines)) - y

        return pushed().for_state_shapes(0.0, 0.0)

    few, many = (compiled(driven(sines), "rk4", 1) for sines in (3, 200))
    assert many["computed"] == few["computed"]
    assert many["per_step"] > 50 * few["per_step"]


# ---- where no page may become executable

HARDENED = """
import ctypes, json, sys
sys.path[:0] = json.loads(sys.argv[1])
import test_kernels
libc = ctypes.CDLL(None, use_errno=True)
PR_SET_MDWE, REFUSE_EXEC_GAIN = 65, 1
if libc.prctl(PR_SET_MDWE, REFUSE_EXEC_GAIN, 0, 0, 0):
    print(json.dumps({"refused": ctypes.get_errno()}))
else:
    runs = {name: test_kernels.bits(name).hex() for name in test_kernels.RUNS}
    code = {name: test_kernels.code_bytes(name) for name in test_kernels.RUNS}
    why = test_kernels.sw.explain(test_kernels.sw.Oscillator(), "false_euler").interpreted_because
    print(json.dumps({"runs": runs, "code": code, "level": test_kernels.sw.isa(), "why": why}))
"""


@LINUX
def test_where_no_code_may_be_written_steps_are_interpreted_without_a_word() -> None:
    out = in_a_process(HARDENED, "-W", "error")
    assert (out.returncode, out.stderr) == (0, "")
    report = json.loads(out.stdout)
    if "refused" in report:
        pytest.skip(f"the kernel has no PR_SET_MDWE: {os.strerror(report['refused'])}")
    assert report["code"] == dict.fromkeys(RUNS, 0)
    assert report["level"] == sw.isa()
    if len(sw.isa_levels()) > 1:
        assert report["why"] == "this system does not let a program execute code that it has written"
    for name in RUNS:
        assert report["runs"][name] == bits(name).hex(), name


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork here")
def test_a_child_runs_the_kernels_of_its_parent_and_writes_its_own() -> None:
    first = bits("free")
    fork = multiprocessing.get_context("fork")
    mine, its = fork.Pipe()

    def child() -> None:
        its.send([bits("free"), bits("moon"), bits("free")])  # one that the parent had, and one that it has not yet

    process = fork.Process(target=child)
    with warnings.catch_warnings():
        # Other tests may have left threads that wait, and programs that warn of a fork beside these, as JAX does.
        for kind in (DeprecationWarning, RuntimeWarning):
            warnings.simplefilter("ignore", kind)
        process.start()
    assert mine.poll(60), "the child says nothing"
    assert mine.recv() == [first, bits("moon"), first]
    process.join(60)
    assert process.exitcode == 0


def test_four_threads_run_the_same_and_different_systems() -> None:
    def linear(n: int) -> sw.LinearSystem:
        return sw.LinearSystem(np.cos(np.arange(float(n * n))).reshape(n, n) / n - np.eye(n))

    def run(system: sw.System) -> bytes:
        y = np.ones((*system.y_shape, MEMBERS))
        run = sw.integrate(system, "rk4", v=np.zeros((*system.v_shape, MEMBERS)), y=y, dt=0.01, steps=300, threads=1)
        return run.v.tobytes() + run.y.tobytes()

    # Sizes that nobody has asked for before: the threads trace and compile at the same time as well.
    systems = [linear(n) for n in (5, 7, 9, 11)]
    together = threading.Barrier(4)
    got: dict[int, Any] = {}

    def work(i: int) -> None:
        together.wait(60)
        got[i] = [run(system) for _ in range(3) for system in [*systems[:2], systems[2 + i % 2]]]

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120)
    want = [run(system) for system in systems]
    assert got == {i: [want[0], want[1], want[2 + i % 2]] * 3 for i in range(4)}


@LINUX
@COMPILED
def test_kernels_are_kept_within_a_bound() -> None:
    """Linear systems of many sizes by many methods, until more was written than is kept, three times: what is forgotten is given
    back.
    """
    sizes, most = [], 0
    methods = [m.name for m in sw.methods() if not m.needs_acceleration]
    for n in range(21, 3, -1):
        system = sw.LinearSystem(-np.eye(n) + np.cos(np.arange(float(n * n))).reshape(n, n) / (2 * n))
        for method in methods:
            y = np.ones((*system.y_shape, 100))
            sw.integrate(system, method, v=np.ones((*system.v_shape, 100)), y=y, dt=0.01, steps=100, threads=1)
            sizes.append(sum(executable()))
            most = max(most, sizes[-1])
        if sum(after < before for before, after in itertools.pairwise(sizes)) >= 3:
            break
    given_back = sum(after < before for before, after in itertools.pairwise(sizes))
    print(f"{len(sizes)} systems, at most {most / 1e6:.1f} MB of code, given back {given_back} times")
    assert given_back >= 1
    # 400 000 operations are kept at most, of about 8 bytes for each of up to 8 vectors abreast, and a page for each kernel.
    assert most < 400_000 * 8 * 8


def test_short_and_long_runs_have_the_same_bits_at_the_border(monkeypatch: pytest.MonkeyPatch) -> None:
    """Alone a step is compiled after some 360 steps, for 8 members after some 220, for more after some tens."""
    inputs = itertools.count(1)

    def run(system: sw.System, members: int, pieces: tuple[int, ...]) -> bytes:
        state: dict[str, Any] = {"v": np.full((1, members), 0.1), "y": np.linspace(0.5, 2.0, members)[None, :]}
        for steps in pieces:
            run = sw.integrate(system, "rk4", **state, dt=0.01, steps=steps, threads=1)
            state = {"resume": run}
        return run.v[-1].tobytes() + run.y[-1].tobytes()

    for members, around in ((1, range(355, 373, 2)), (8, range(212, 232, 2)), (100, range(10, 130, 8))):
        for steps in (1, *around, 1000):
            # A number of inputs of its own: a tape that nobody has stepped before, so that the count begins with this run.
            m = next(inputs)
            B, x = np.ones((2, m)) / m, [sw.Sinusoid(0.5, 1.1, 0.1 * i) for i in range(m)]
            system = sw.LinearSystem([[-0.1, -1.0], [1.0, 0.0]], B, x=x, velocities=1)
            runs = ((steps,), (steps,), (1, steps - 1))[: 2 if steps == 1 else 3]
            got = [run(system, members, pieces) for pieces in runs]
            monkeypatch.setenv("STEPWELL_KERNELS", "interpret")
            want = run(system, members, (steps,))
            monkeypatch.delenv("STEPWELL_KERNELS")
            assert all(each == want for each in got), (members, steps)


@LINUX
@COMPILED
def test_a_short_run_writes_no_code_and_a_long_one_does() -> None:
    """In a process of its own: there are no other kernels yet."""
    code = """
import json, sys
sys.path[:0] = json.loads(sys.argv[1])
import test_kernels
import stepwell as sw
def run(steps):
    sw.integrate(sw.Oscillator(), "false_euler", v=0.0, y=1.0, dt=0.1, steps=steps)
    return len(test_kernels.executable())
print(run(1), run(200), run(100_000), run(1))
"""
    out = in_a_process(code)
    one, short, long, after = (int(word) for word in out.stdout.split())
    assert one == short == long - 1 == after - 1


@pytest.mark.parametrize("name", compiling.SYSTEMS)
def test_a_step_is_traced_and_compiled_in_time(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """``python -m benches.compile`` shows the times: some tens to some hundreds of µs. A tenth of a frame is bearable."""
    monkeypatch.setattr(compiling, "SYSTEMS", {name: compiling.SYSTEMS[name]})
    rows = list(compiling.rows(repeats=2))
    assert len(rows) >= 9
    for row in rows:
        # A step that solves equations has ten times as many operations.
        assert row.trace + row.compile < (0.2 if sw.method(row.method).is_implicit else 0.020), row
        assert row.computed <= row.written, row
        assert (row.bytes > 0) == (sw.isa() != "interpret"), row
