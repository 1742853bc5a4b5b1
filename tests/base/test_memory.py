"""Memory: what a run takes is counted before any work, is not more than was counted, and what is not there is not asked for."""

import os
import subprocess
import sys
import textwrap
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.analysis.stability import limit
from stepwell.base import available_memory
from stepwell.errors import TooLargeError
from stepwell.runs import engine
from stepwell.runs.engine import linear
from support.for_each import for_each
from support.refusals import refused

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="limits and peaks are asked of Linux")


PREAMBLE = """import resource, numpy as np, stepwell as sw
def leave(room):
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + room, resource.RLIM_INFINITY))
"""


def aside(code: str) -> str:
    """What the code prints, in a process of its own, in which ``leave`` limits the memory that it may still take."""
    code = PREAMBLE + textwrap.dedent(code)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@for_each("steps", [10**9, 10**15])
def test_more_kept_states_than_memory_are_refused_at_once(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(available_memory, "_bounds", lambda: iter([(20e9, "memory of this machine")]))
    monkeypatch.setattr(engine, "advance", None)  # no work is begun
    with pytest.raises(sw.StepwellError, match=r"the saved states need .* GiB, but 18\.6 GiB are available \(memory of"):
        sw.integrate(sw.Oscillator(1.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=steps, every=1)


@LINUX
@pytest.mark.parametrize("arguments", ["steps=20_000_000, every=1", "at=np.linspace(0, 1e6, 20_000_001), tolerance=1e-3"])
def test_a_limit_of_the_address_space_is_heard(arguments: str) -> None:
    """20 million states of 32 bytes do not fit where 400 MB are left; what does fit is made."""
    output = aside(f"""
        leave(400_000_000)
        try:
            sw.integrate(sw.Oscillator(1.0), "dop853", v=0.0, y=1.0, dt=0.1, {arguments})
        except MemoryError as error:
            print(type(error).__name__, error)
        print(len(sw.integrate(sw.Oscillator(1.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=5_000_000, every=1).t))
    """)
    if arguments.startswith("at"):
        assert "MemoryError" in output or "TooLargeError" in output  # NumPy may be the first to want more than there is
    else:
        assert output.startswith("TooLargeError the saved states need 610 MiB, but ")
        assert "MiB are available (limit of the address space, ulimit -v); keep less with every=" in output
    assert output.endswith("5000001\n")


def test_a_long_chain_is_made_without_its_numbers() -> None:
    """One stiffness and one mass serve for all; as arrays they would be 160 MB."""
    tracemalloc.start()
    try:
        chain = sw.Chain(10_000_000, mass=2.0)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 1_000_000
    assert (chain.stiffness.shape, chain.mass.shape) == ((10_000_001,), (10_000_000,))
    assert chain.mass[-1] == 2.0


@LINUX
def test_a_system_that_does_not_fit_is_an_error_and_no_abort() -> None:
    """A long chain: its stages would take 1.3 GB."""
    output = aside("""
        n = 4_000_000
        system, y = sw.Chain(n), np.zeros(n)
        v = np.zeros(n)
        leave(300_000_000)
        for make in (
            lambda: sw.integrate(system, "rk4", v=v, y=y, dt=0.1, steps=1),
            lambda: sw.World(system, "rk4", v=v, y=y, dt=0.1),
        ):
            try:
                make()
            except MemoryError as error:
                print("refused")
    """)
    assert output == "refused\nrefused\n"


@LINUX
def test_threads_that_cannot_be_had_are_done_without() -> None:
    """A stack for each of 64 threads is more than there is."""
    output = aside("""
        leave(60_000_000)
        run = sw.integrate(sw.Oscillator(np.linspace(1, 2, 5000)), "rk4", v=0.0, y=1.0, dt=0.1, steps=300, threads=64)
        print(run.y.shape)
    """)
    assert output == "(1, 5000)\n"


@LINUX
def test_no_thread_is_started_with_the_last_of_the_memory() -> None:
    """A second one while there are 60 MB, none where there are 8: it might find nothing to allocate, and end the process."""
    output = aside("""
        import contextlib, os
        from stepwell.base import progress
        threads = []
        @contextlib.contextmanager
        def bar(title):
            yield lambda done: threads.append(len(os.listdir("/proc/self/task")))
        progress.bar = bar
        system, arguments = sw.Oscillator(np.linspace(1, 2, 5000)), dict(v=0.0, y=1.0, dt=0.1, threads=2, progress=True)
        runs = []
        for left in (60_000_000, 8_000_000):
            leave(left)
            runs.append(sw.integrate(system, "rk4", steps=200_000, **arguments))
            print(max(threads))
            threads.clear()
        print(np.array_equal(runs[0].y, runs[1].y))
    """)
    assert output == "2\n1\nTrue\n"


@LINUX
@pytest.mark.parametrize(
    "run",
    [
        "sw.Oscillator(1.0), 'rk4', v=0.0, y=1.0, dt=0.1, steps=4_000_000, every=1",
        "sw.Oscillator(1.0), 'verlet', v=0.0, y=1.0, dt=0.1, steps=4_000_000, every=1",
        "sw.Oscillator(np.ones(1000)), 'rk4', v=0.0, y=1.0, dt=0.1, steps=4000, every=1, threads=2",
        "sw.Oscillator(1.0), 'rk4', v=0.0, y=1.0, dt=0.1, steps=4_000_000, every=1, form='matrix'",
        "sw.NBody(), 'rk4', v=0.0, y=np.eye(3, 2), dt=1e-6, steps=1_000_000, every=1, record=['energy']",
    ],
)
def test_the_peak_is_what_was_counted(run: str) -> None:
    """As it was counted, within a tenth, and 24 MB for what does not depend on the number of states: kernels, threads, imports.

    Of three bodies the energy is counted beside the states; of the matrix form the matrix is, before them.
    The peak without the run is that of a run of few states.
    """
    output = aside(f"""
        counted = []
        from stepwell.base import checks
        fits = checks.fits
        def count(what, rows, batch, remedy, beside=0.0):
            counted.append(8 * rows * int(np.prod(batch)) + beside)
            fits(what, rows, batch, remedy, beside=beside)
        checks.fits = count
        def go(*arguments, steps, **options):
            sw.integrate(*arguments, steps=min(steps, most), **options)
            # Not ru_maxrss, which begins with that of the process that started this one.
            return 1024 * int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
        most = 1000
        before = go({run})
        most = 10**9
        print(go({run}) - before, max(counted))
    """)
    peak, counted = map(float, output.split())
    assert peak < 1.1 * counted + 24e6
    assert peak > 0.5 * counted - 24e6  # nor is it counted at random


def test_the_least_bound_counts(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Control groups of both kinds, whatever this machine has; files that nobody reads are no usage."""
    files = {
        "/proc/self/cgroup": "4:cpu,memory:/box\n3:cpuset:/other\n0::/box/inner\n",
        "/proc/self/statm": "1000 1 1 1 1 1 1\n",
        "/proc/meminfo": "MemTotal: 99999999 kB\nMemAvailable:    8000000 kB\n",
        "/sys/fs/cgroup/memory/box/memory.limit_in_bytes": "9223372036854771712\n",
        "/sys/fs/cgroup/memory/box/memory.usage_in_bytes": "1000000\n",
        "/sys/fs/cgroup/box/inner/memory.max": "max\n",
        "/sys/fs/cgroup/box/inner/memory.current": "2000000\n",
        "/sys/fs/cgroup/box/memory.max": "5000000000\n",
        "/sys/fs/cgroup/box/memory.current": "3000000000\n",
        "/sys/fs/cgroup/box/memory.stat": "anon 100\ninactive_file 1000000000\n",
    }

    def read(path: str) -> str:
        try:
            return files[path]
        except KeyError:
            raise FileNotFoundError(path) from None

    monkeypatch.setattr(available_memory, "_read", read)
    assert available_memory.available_memory() == (3e9, "memory limit of the control group")
    del files["/proc/self/cgroup"]
    assert available_memory.available_memory() == (8e6 * 1024, "memory of this machine")


def test_what_is_kept_is_counted_as_it_is() -> None:
    for steps in (1, 2, 7, 9):
        for every in (None, 1, 2, 3, 9, 100):
            plan = engine.Plan(sw.Oscillator(), sw.method("rk4"), (), 0.1, steps=steps, every=every)
            assert plan.save_count == len(plan.saves)
            run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=steps, every=every)
            assert len(run.t) == plan.save_count
            np.testing.assert_array_equal(run.t, 0.1 * plan.saves)


def test_unit_vectors_take_the_matrices_of_their_members_some_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of n vectors takes an n × n matrix of its member along: all at once they were n³ numbers, and one long copy."""
    widths: list[int] = []
    one_step = linear.one_step
    monkeypatch.setattr(linear, "one_step", lambda plan, v, y: widths.append(plan.batch[0]) or one_step(plan, v, y))
    A = np.random.default_rng(5).normal(size=(6, 6, 50))
    plan = engine.Plan(sw.LinearSystem(A), sw.method("rk4"), (50,), 0.1)
    whole = linear.transition(plan)
    monkeypatch.setattr(linear, "NUMBERS_AT_ONCE", 4000)  # of two vectors: 2·6·6·50 = 3600
    np.testing.assert_array_equal(linear.transition(plan), whole)
    linear.transition(engine.Plan(sw.LinearSystem(A[..., 0]), sw.method("rk4"), (), 0.1))
    assert widths == [6, 2, 2, 2, 6]


@sw.system(shape=(60,))
def ring(t: Any, v: Any, y: Any) -> Any:
    return -np.sin(y) + 0.1 * np.roll(y, 1)


def of_springs(particles: int, fixed: Any = (), members: Any = ()) -> tuple[sw.Springs, Any]:
    """A row of particles at rest."""
    pairs = [(i, i + 1) for i in range(particles - 1)]
    y = np.stack([np.arange(float(particles)), np.zeros(particles)], axis=-1)
    return sw.Springs(pairs, stiffness=1.0, rest=1.0, fixed=fixed), np.broadcast_to(
        y.reshape(*y.shape, *(1 for _ in members)), (*y.shape, *members)
    )


AT_REST = np.broadcast_to(0.0, (60, 20_000))
straight = sw.system(shape=(60,))(lambda t, v, y: 0.1 * np.roll(y, 1) - y)


def limits(system: Any, y: Any = None) -> Callable[[], Any]:
    return lambda: sw.stability_limit(system, "rk4", **({} if y is None else {"v": 0.0, "y": y}))


def by_matrix() -> Any:
    return sw.integrate(sw.Chain(30_000), "rk4", v=0.0, y=0.0, dt=0.1, steps=10, form="matrix")


#: Free memory, what is asked for, and what it is said to need.
COUNTED: list[tuple[float, Callable[[], Any], str]] = [
    # Five copies of 1000² numbers, as many as a run was seen to hold of a matrix of 1500².
    (30 * 2.0**20, lambda: sw.LinearSystem(np.eye(1000)), r"A: the matrix and its copies need 38\.1 MiB, but 30 MiB"),
    # Eight numbers for an element of 60 000 × 60 000.
    (200e9, by_matrix, "the transition matrices of 60000 × 60000 numbers need 215 GiB.*'direct'"),
    # 60 numbers for an element of a matrix, of as many members as are searched at once, and 250 for a limit with its mode.
    (100e6, limits(sw.LinearSystem(-np.eye(613))), "the limits need 172 MiB.*of fewer states"),
    (100e6, limits(sw.Pendulum(), np.ones(100_000)), r"the limits of 100000 members need 31\d MiB"),
    # Of small motions four times the matrix of every member, n = 80 004, 40 and 120 states, and sixty numbers for an element in
    # the search: 64·80 004²·8 bytes; (250 + 4·40 + 4·40²)·8 and (250 + 4·120 + 4·120²)·8 of each member. 163 members of 40 states
    # and 18 of 120 are searched at once, in 0.12 GB.
    (1.5e9, limits(*of_springs(20_001)), r"the limits need 3\.05e\+03 GiB"),
    (1.5e9, limits(*of_springs(10, members=(200_000,))), r"the limits of 200000 members need 10\.3 GiB"),
    (1.5e9, limits(ring, AT_REST), r"the limits of 20000 members need 8\.81 GiB"),
    (1.5e9, limits(straight, AT_REST + 1.0), "the limits of 20000 members need"),
]


@for_each(("free", "ask", "words"), COUNTED)
def test_what_is_made_of_matrices_is_counted_before_it_is_made(
    free: float, ask: Callable[[], Any], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(available_memory, "_bounds", lambda: iter([(free, "memory of this machine")]))
    monkeypatch.setattr(linear, "transition", None)  # no work is begun
    monkeypatch.setattr(limit, "Search", None)
    refused(TooLargeError, words, ask)


def test_a_net_that_is_mostly_fixed_is_counted_by_what_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """4·(4·500)² numbers for the whole net, 0.13 GB; sixty numbers an element of all of it were 2 GB."""
    monkeypatch.setattr(available_memory, "_bounds", lambda: iter([(1e9, "memory of this machine")]))
    springs, y = of_springs(500, fixed=range(1, 500))
    assert sw.stability_limit(springs, "rk4", v=0.0, y=y) > 0.0


def test_members_that_move_are_searched_some_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their matrices are never all there: 18 members of 120 states at once, of some 4·120² numbers each."""
    searched: list[int] = []

    def some(search: limit.Search) -> Any:
        searched.append(len(search.rates[0, 0]))
        return np.zeros(searched[-1]), np.zeros(searched[-1]), np.full(searched[-1], None)

    monkeypatch.setattr(available_memory, "_bounds", lambda: iter([(0.15e9, "memory of this machine")]))
    monkeypatch.setattr(limit, "_of_some", some)
    limit.limit_of(ring().for_state_shapes(), sw.method("rk4"), np.zeros((60, 20)), np.ones((60, 20)))
    assert sum(searched) == 20
    assert max(searched) == 18


@LINUX
def test_limits_of_more_members_take_no_more_memory_than_their_results() -> None:
    """Of 12 numbers a state, 1820 members are searched at once, in 60 numbers for each element of their matrices: 126 MB."""
    output = aside("""
        from stepwell.analysis.stability import limit, limit_search
        def took(members):
            sw.stability_limit(sw.NBody([1.0, 1.0, 1.0]), "leapfrog", v=0.0, y=np.random.default_rng(1).random((3, 2, members)))
            return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        few = took(20)
        print((took(1500) - few) * 1024)
    """)
    counted = 8.0 * (60 * 144 + 250 + 4 * 12) * 1500
    assert int(output) < counted < 126e6


@for_each("system", ["batch of systems", "batch of states"])
def test_limits_in_parts_are_those_of_all_at_once(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the bit, and so are their modes."""
    random = np.random.default_rng(5)
    y = random.random((3, 2, 7))
    arguments: dict[str, Any] = {"v": 0.0, "y": y}
    of: list[Any] = [sw.NBody([1.0, 2.0, 3.0])] if system == "batch of states" else []
    if not of:
        of = [sw.Oscillator(np.linspace(1, 2, 7), 0.1, x=sw.Sinusoid(1.0, 2.0)), sw.Chain(4, stiffness=1 + random.random((5, 7)))]
        arguments = {}
    for each in of:
        whole = sw.stability_limit(each, "false_euler", **arguments)
        monkeypatch.setattr(limit, "members_at_once", lambda n: 3)
        parts = sw.stability_limit(each, "false_euler", **arguments)
        monkeypatch.undo()
        np.testing.assert_array_equal(parts, whole)
        np.testing.assert_array_equal(parts.grows, whole.grows)
        for one, other in zip(parts.modes, whole.modes, strict=True):
            assert one == other


@LINUX
def test_a_jacobian_takes_little_more_memory_than_it_has_numbers() -> None:
    """Directions of the complex step go some at a time: what they take is below 20 times a million complex numbers."""
    output = aside("""
        y = np.random.default_rng(1).random((33, 2, 300))
        sw.jacobian(sw.NBody(np.ones(33)), v=0.0, y=y[..., :1])
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        matrix = sw.jacobian(sw.NBody(np.ones(33)), v=0.0, y=y).matrix
        print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 - matrix.nbytes)
    """)
    assert int(output) < 20 * 16 * 2**20


@LINUX
def test_new_functions_take_no_more_memory_than_the_caches_hold() -> None:
    """A function takes 12 kB and more; of those before the last few hundred nothing is left."""
    output = aside("""
        def used():
            return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()
        def run(first):
            for k in range(first, first + 1200):
                system = sw.system(order=1)(lambda t, y: [y[1] * 1.0, -y[0] * (1.0 + k)])()
                sw.integrate(system, "rk4", y=[1.0, 0.0], dt=0.01, steps=2)
            return used()
        before = run(0)
        print(run(1200) - before)
    """)
    assert int(output) < 2e6
