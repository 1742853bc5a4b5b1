"""Sweeps: axes, what is kept of each member, and that it does not depend on how members are divided."""

import multiprocessing
import pickle
import re
import subprocess
import sys
import tracemalloc
import warnings
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats
import stepwell as sw
import xarray
from stepwell.errors import ArgumentError, DTypeError, UnsupportedError
from stepwell.studies.sweeps import axes as of_axes
from stepwell.studies.sweeps import outcomes, portable
from stepwell.studies.sweeps.axes import Chunk
from stepwell.studies.sweeps.ensemble import _outcomes
from stepwell.studies.sweeps.task import Task
from support.looped import assert_refused, looped
from support.refusals import refused
from support.sweeping import AXES, OUTCOMES, Pickling, duffing, small, unlike

Oscillator = sw.Oscillator
#: Outcomes that work with float32.
WITH_FLOAT32 = tuple(each for each in OUTCOMES if each != "lyapunov")

each_type = looped("dtype", ["float64", "float32"])


def test_a_product_is_what_integrate_gives() -> None:
    dataset = small(outcomes="last", transient=0)
    assert dataset.y_last.dims == ("gamma", "y0")
    gamma, y = (values for _, values in AXES.values())
    run = sw.integrate(duffing(delta=0.2, gamma=gamma[:, None]), "rk4", v=0.0, y=y, dt=0.05, steps=80)
    np.testing.assert_array_equal(dataset.y_last, run.y[-1])
    np.testing.assert_array_equal(dataset.v_last, run.v[-1])
    np.testing.assert_array_equal(dataset.gamma, gamma)
    np.testing.assert_array_equal(dataset.y0, y)
    one = dataset.sel(gamma=gamma[3], y0=y[1])
    alone = sw.integrate(duffing(delta=0.2, gamma=gamma[3]), "rk4", v=0.0, y=y[1], dt=0.05, steps=80)
    assert float(one.y_last) == float(alone.y[-1])


def test_axes_of_one_and_of_two_dimensions() -> None:
    omega, y, d = np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.6, 0.7]), np.array([0.0, 0.1])
    axes = {"omega": ("run", omega), "y": ("run", y), "damping": d}
    dataset = sw.sweep(Oscillator, axes, "rk4", v=0.0, dt=0.1, steps=10)
    assert dict(dataset.sizes) == {"run": 3, "damping": 2}
    assert dataset.coords.keys() == {"omega", "y_start", "damping"}
    for i in range(3):
        for j in range(2):
            run = sw.integrate(Oscillator(omega[i], d[j]), "rk4", v=0.0, y=y[i], dt=0.1, steps=10)
            assert float(dataset.y_last[i, j]) == float(run.y[-1])
    values = xarray.DataArray([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], dims=("a", "b"), attrs={"units": "1/s"})
    dataset = sw.sweep(Oscillator, {"y": ("b", [0.1, 0.2, 0.3]), "omega": values}, "rk4", v=0.0, dt=0.1, steps=10, chunk=2)
    assert dataset.y_last.dims == ("b", "a")
    assert dataset.omega.attrs["units"] == "1/s"
    run = sw.integrate(Oscillator(values.values), "rk4", v=0.0, y=np.array([0.1, 0.2, 0.3]), dt=0.1, steps=10)
    np.testing.assert_array_equal(dataset.y_last.transpose("a", "b"), run.y[-1])


def test_blocks_and_forces_with_axes_of_their_own() -> None:
    """Batch axes come last, in axes as everywhere; results have them first, as labelled arrays have."""
    scene = sw.scenes.figure_eight()
    factor = np.array([0.9, 1.0, 1.1, 1.2])
    axes = {"v": ("speed", scene.v[..., None] * factor)}
    dataset = sw.sweep(scene.system, axes, "leapfrog", y=scene.y, dt=0.01, steps=50, every=20, chunk=3)
    assert dataset.y.dims[:2] == ("speed", "t")
    assert dataset.y.shape == (4, 4, *scene.y.shape)
    run = sw.integrate(scene.system, "leapfrog", v=scene.v[..., None] * factor, y=scene.y[..., None], dt=0.01, steps=50, every=20)
    np.testing.assert_array_equal(dataset.y, np.moveaxis(run.y, -1, 0))
    np.testing.assert_array_equal(dataset.t, run.t)
    np.testing.assert_array_equal(dataset.v_start, np.moveaxis(scene.v[..., None] * factor, -1, 0))
    force = np.array([0.0, 0.5, 1.0])
    dataset = sw.sweep(sw.Pendulum(), {"force": ("push", force)}, "rk4", v=0.0, y=1.0, dt=0.1, steps=30, chunk=2)
    run = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=30, force=force)
    np.testing.assert_array_equal(dataset.y_last, run.y[-1])


@each_type
@looped("method", ["leapfrog", "verlet", "merson"])
def test_a_step_as_an_axis(method: str, dtype: Any) -> None:
    """A run has one step, so those of one step are computed together; its dimension comes first."""
    dt, omega = np.array([0.01, 0.02, 0.05]), np.array([1.0, 2.0])
    axes = {"omega": ("omega", omega), "dt": ("dt", dt)}
    dataset = sw.sweep(Oscillator, axes, method, v=0.0, y=1.0, steps=40, transient=7, every=16, dtype=dtype)
    assert dataset.y.dims == ("dt", "omega", "saved")
    for i, h in enumerate(dt):
        run = sw.integrate(Oscillator(omega), method, v=0.0, y=1.0, dt=float(h), steps=47, every=1, dtype=dtype)
        assert (run.t[47] == 47 * h) == (dtype == "float64")  # a step of float32 is rounded
        np.testing.assert_array_equal(dataset.y[i], run.y[[7, 23, 39, 47]].T)
        np.testing.assert_array_equal(dataset.v[i], run.v[[7, 23, 39, 47]].T)
        np.testing.assert_array_equal(dataset.t[i], run.t[[7, 23, 39, 47]])


@looped("shape", [(7,), (3, 5), (2, 3, 4), (1, 6, 1)])
@looped("of_dt", [0, 1])
def test_chunks_are_all_members_in_their_order(shape: tuple[int, ...], of_dt: int) -> None:
    names = ["dt" if of_dt and i == 0 else f"p{i}" for i in range(len(shape))]
    grid = of_axes.grid({name: np.arange(1.0, n + 1.0) for name, n in zip(names, shape, strict=True)})
    for most in range(1, grid.members + 2):
        width = grid.chunk_shape(most)
        chunks = list(grid.chunks(width))
        members = np.arange(grid.members).reshape(shape)
        order = np.concatenate([members[chunk.slices].ravel() for chunk in chunks])
        np.testing.assert_array_equal(order, np.arange(grid.members))
        assert [chunk.first for chunk in chunks] == [members[chunk.slices].flat[0] for chunk in chunks]
        assert all(chunk.members <= most for chunk in chunks)
        if of_dt:
            assert all(chunk.shape[0] == 1 for chunk in chunks)


def test_random_samples_have_a_seed_and_sobol_fills_the_box_evenly() -> None:
    one, same, other = (sw.sweeps.random("sample", 4096, seed=s, omega=(1.0, 3.0), y=(-1.0, 1.0)) for s in (1, 1, 2))
    np.testing.assert_array_equal(one["omega"][1], same["omega"][1])
    assert (one["omega"][1] != other["omega"][1]).all()
    # The mean of n uniform numbers of width w errs by w/√(12 n); five times that is exceeded once in two million.
    assert abs(one["omega"][1].mean() - 2.0) < 5 * 2.0 / np.sqrt(12 * 4096)
    assert one["omega"][1].min() >= 1.0
    assert one["omega"][1].max() < 3.0
    dataset = sw.sweep(Oscillator, one, "rk4", v=0.0, dt=0.1, steps=10)
    assert dict(dataset.sizes) == {"sample": 4096}
    assert "seed 1" in dataset.omega.attrs["sampling"]
    run = sw.integrate(Oscillator(one["omega"][1]), "rk4", v=0.0, y=one["y"][1], dt=0.1, steps=10)
    np.testing.assert_array_equal(dataset.y_last, run.y[-1])
    # Each of 2ᵏ equal intervals of each argument has as many points; random samples do not.
    axes = sw.sweeps.sobol("sample", 256, seed=3, omega=(1.0, 3.0), y=scipy.stats.norm(0.0, 2.0))
    for name, unit in (("omega", (axes["omega"][1] - 1.0) / 2.0), ("y", scipy.stats.norm.cdf(axes["y"][1] / 2.0))):
        assert (np.histogram(unit, 16, (0.0, 1.0))[0] == 16).all(), name
    np.testing.assert_array_equal(
        axes["y"][1], sw.sweeps.sobol("s", 256, seed=3, omega=(1.0, 3.0), y=scipy.stats.norm(0.0, 2.0))["y"][1]
    )
    drawn = sw.sweeps.random("sample", 256, seed=3, omega=(1.0, 3.0))["omega"][1]
    assert (np.histogram(drawn, 16, (1.0, 3.0))[0] != 16).any()
    with pytest.raises(ArgumentError, match="count: expected a power of two for Sobol's sequence, got 100; 128 is one"):
        sw.sweeps.sobol("sample", 100, seed=3, omega=(1.0, 3.0))


@looped("dtype", ["float64", "float32"])
def test_every_division_gives_the_same_bits(dtype: Any) -> None:
    options: dict[str, Any] = {} if dtype == "float64" else {"dtype": dtype, "outcomes": WITH_FLOAT32}
    one = small(**options)
    assert len(one.attrs["bits"]) == 32
    assert options == {} or one.attrs["bits"] != small(outcomes=WITH_FLOAT32).attrs["bits"]
    for division in (
        {"chunk": 1},
        {"chunk": 2, "threads": 3},
        {"chunk": 7},
        {"chunk": 10_000},
        {"memory": 12_000.0},
        {"memory": 100_000.0, "chunk": 11},
    ):
        other = small(**options, **division)
        assert unlike(one, other) == [], division
        assert one.attrs == other.attrs, division


def test_samples_in_every_division() -> None:
    hashes = {
        small(outcomes="last", steps=3, y=y, axes={"gamma": [0.1, 0.2]}).attrs["bits"] for y in (1.0, np.nextafter(1.0, 2.0))
    }
    assert len(hashes) == 2
    for axes in (
        sw.sweeps.random("sample", 64, seed=1, gamma=(0.1, 0.6), y=(-1.0, 1.0)),
        sw.sweeps.sobol("sample", 64, seed=1, gamma=(0.1, 0.6), y=(-1.0, 1.0)),
        sw.sweeps.sobol("sample", 8, seed=1, gamma=(0.1, 0.6)) | {"y": ("y0", [0.1, 0.2, 0.3])},
        {"gamma": ("run", np.linspace(0.1, 0.6, 9)), "y": ("run", np.linspace(-1.0, 1.0, 9))},
    ):
        assert len({small(axes=axes, chunk=n).attrs["bits"] for n in (5, 64)}) == 1


@pytest.mark.mutant
def test_a_sum_in_another_order_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mean that adds the states of a piece first would depend on the piece."""

    def see(self: Any, piece: Any) -> None:
        self.run = piece.run
        all_of = [piece.of(what) for what in self.outcome.whats(piece.run)]
        sums = [each.sum(axis=0) for each in all_of]
        self.sums = [a + b for a, b in zip(self.sums, sums, strict=True)] if self.sums else sums
        self.begin, self.t = 0.0, 1.0

    monkeypatch.setattr(outcomes._Mean, "see", see)
    assert len({small(outcomes="mean", memory=m).attrs["bits"] for m in (64.0 * 2**20, 12_000.0)}) == 2


# ---- engines; those of other processes are in tests/outer/test_sweep_engines.py
def test_executors_give_the_same_bits() -> None:
    whole = small()
    with ThreadPoolExecutor(3) as pool:
        for engine, chunk in ((pool, 4), (pool, None), (Pickling(), 11)):
            dataset = small(engine=engine, chunk=chunk)
            assert unlike(whole, dataset) == [], engine
            assert dataset.attrs == whole.attrs, engine


def test_what_happens_in_another_process_or_cannot_travel_is_told_here() -> None:
    def wrong(run: sw.Run) -> Any:
        return run.y[-1, :1].reshape(1, 1, 1)[0, 0, 0]

    for engine in (Pickling(), None):
        with pytest.raises(
            ArgumentError, match="outcomes: wrong: expected an array whose last axis has one number for each member of the run, "
        ):
            small(engine=engine, outcomes=wrong)
    with pytest.warns(sw.DivergenceWarning, match=r"1 of 2 members diverged, that at omega = 30"):
        sw.sweep(sw.Oscillator, {"omega": [1.0, 30.0]}, "rk4", v=0.0, y=1.0, dt=0.2, steps=500, engine=Pickling())
    lock = multiprocessing.get_context("spawn").Lock()

    def locked(run: sw.Run) -> Any:
        with lock:
            return run.y[-1]

    with pytest.raises((ArgumentError, RuntimeError), match=r"engine: the system and the outcomes must be pickled|shared"):
        small(engine=Pickling(), outcomes=locked)


def test_equations_that_are_written_in_a_function() -> None:
    """``pickle`` finds equations by name; those of a notebook, a script or a function travel by their text."""
    gain = 0.5

    @sw.system
    def local(t: Any, v: Any, y: Any, *, gamma: Any = gain) -> Any:
        return gamma * np.cos(1.2 * t) - 0.2 * v + gain * 2.0 * y - y**3

    @local.invariant
    def energy(v: Any, y: Any) -> Any:
        return 0.5 * v**2 - 0.5 * y**2 + 0.25 * y**4

    refused(ArgumentError, "an own system is pickled by the name of its function", pickle.dumps, local)
    datasets = [
        sw.sweep(
            local, AXES, "rk4", v=0.0, dt=0.05, steps=100, outcomes=["last", sw.sweeps.Mean("energy")], engine=engine, chunk=5
        )
        for engine in (None, Pickling())
    ]
    assert unlike(*datasets) == []


def test_kernels_are_compiled_once_a_worker() -> None:
    """A worker unpacks the task once; the machine code of further chunks is that of the first."""
    if sw.isa() == "interpret" or not sys.platform.startswith("linux"):
        pytest.skip("everything is interpreted, or this system does not tell of mappings")

    def mapped() -> list[str]:
        """Executable mappings that are no file."""
        lines = Path("/proc/self/maps").read_text().splitlines()
        return [line for line in lines if re.match(r"\S+ ..x. \S+ \S+ 0\s*$", line)]

    arguments = {"v": 0.0, "y": 1.0, "dt": 0.05, "t0": 0.0, "fused": False, "threads": 1}
    task = Task(partial(duffing, delta=0.123), "rk4", arguments, 0, 2000, 1, None, _outcomes(["last", "extremes"], None), 2.0**26)
    package = portable.packed(task)
    before = mapped()
    kernels = []
    for k in range(6):
        chunk = Chunk((k,), (slice(64 * k, 64 * k + 64),), (64,), 64 * k)
        portable.sweep_chunk(package, {"gamma": np.linspace(0.1, 0.6, 64) + k}, chunk)
        kernels.append(mapped())
    # A step is interpreted until compiling it pays, which for one of the two kinds of pieces may be in the second chunk.
    assert kernels[1] != before
    assert all(each == kernels[1] for each in kernels[1:])
    assert portable._task(package) is portable._task(bytes(bytearray(package)))


def test_memory_is_bounded() -> None:
    """The trajectories are 64 MB; a chunk may take 2 MiB."""
    members, steps, memory = 2000, 2000, 2 * 2**20
    arguments: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.01, "outcomes": ["extremes", "mean", "period"], "threads": 1}
    axes = {"omega": np.linspace(0.5, 2.0, members)}
    sw.sweep(Oscillator, axes, "rk4", steps=10, **arguments)  # imports
    tracemalloc.start()
    try:
        sw.sweep(Oscillator, axes, "rk4", steps=steps, memory=memory, **arguments)
        peak = tracemalloc.get_traced_memory()[1]
        # Results are 9 numbers a member, axes and coordinates a few more; some hundred kilobytes are Python's own.
        assert peak < memory + 8 * 30 * members + 2**19
        sw.sweep(Oscillator, axes, "rk4", steps=steps, memory=64 * memory, **arguments)
        assert tracemalloc.get_traced_memory()[1] > 4 * peak  # so the bound above is one
    finally:
        tracemalloc.stop()


def test_attributes_tell_how_it_was_made_and_progress_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    data = small(units={"t": "s", "y": "m", "gamma": "m/s²", "y_period": "h"})
    attrs = data.attrs
    assert (attrs["stepwell_version"], attrs["numpy_version"]) == (sw.__version__, np.__version__)
    assert (attrs["method"], attrs["dt"], attrs["steps"], attrs["transient"], attrs["t0"]) == ("rk4", 0.05, 80, 10, 0.0)
    assert attrs["title"] == "duffing by Runge-Kutta 4: a sweep of 45 members"
    assert data.y_last.attrs["units"] == data.y0.attrs["units"] == "m"
    assert (data.y_crossing.attrs["units"], data.y_period.attrs["units"], data.gamma.attrs["units"]) == ("s", "h", "m/s²")
    assert "units" not in data.v_last.attrs
    assert data.y0.attrs["argument"] == "y"
    import contextlib

    from stepwell.base import progress

    shares: list[float] = []

    @contextlib.contextmanager
    def bar(title: str) -> Any:
        assert title == "sweep, 45 members"
        yield shares.append

    monkeypatch.setattr(progress, "bar", bar)
    small(progress=True, chunk=10, outcomes="last")
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) >= 4


GOOD: dict[str, Any] = {"system": Oscillator, "axes": {"omega": [1.0, 2.0]}, "method": "rk4", "v": 0.0, "y": 1.0}
GOOD |= {"dt": 0.1, "steps": 10}
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no axes": ({"axes": {}}, "axes: expected at least one, such as {'mu': ('mu', values)}, got none; for one run use integrate"),
    "axes as a list": ({"axes": [1.0]}, "axes: expected a dictionary of arguments by name"),
    "a wrong parameter": ({"axes": {"omege": [1.0]}}, "omege"),
    "words": ({"axes": {"omega": ("omega", ["a"])}}, "axes: omega: expected real numbers"),
    "not finite": ({"axes": {"omega": [1.0, np.nan]}}, "axes: omega: expected finite numbers, got nan"),
    "no values": ({"axes": {"omega": ("omega", [])}}, "axes: omega: expected at least one value"),
    "one number": ({"axes": {"omega": ("omega", 1.0)}}, "axes: omega: expected values along 'omega', the last of their axes"),
    "two lengths": (
        {"axes": {"omega": ("run", [1.0, 2.0]), "damping": ("run", [0.1])}},
        "axes: expected as many values of damping as of omega, since both vary along the dimension 'run', got 1 and 2",
    ),
    "twice": ({"axes": {"y": [1.0, 2.0]}}, "y: given twice, as an argument and in axes; leave one of them out"),
    "no state": ({"y": None}, "y: expected as an argument or in axes"),
    "no step": ({"dt": None}, "dt: expected as an argument or in axes"),
    "a parameter of a system": ({"system": Oscillator()}, "axes: omega would be a parameter, but Oscillator("),
    "no system": ({"system": 3}, "system: expected a system, or what makes one of parameters by name, got int"),
    "a batch beside": ({"y": np.ones(5)}, "batch"),
    "a batch of the same size": ({"axes": {"omega": [1.0, 2.0]}, "y": np.ones(2)}, "batch"),
    "no such outcome": ({"outcomes": "lasts"}, "outcomes: there is no 'lasts'; did you mean 'last'?"),
    "no outcome": ({"outcomes": []}, "outcomes: expected at least one of last, extremes"),
    "a number as an outcome": ({"outcomes": [3]}, "outcomes: expected words, outcomes or functions of a run, got 3"),
    "two of one name": ({"outcomes": ["crossing", sw.sweeps.Crossing("y", 0.5)]}, "outcomes: there are two results 'y_crossing'"),
    "a history without an interval": ({"outcomes": "history"}, "every: expected how many steps are between the states"),
    "an interval of nothing": ({"outcomes": "last", "every": 3}, "every: works with the outcome 'history' or a function"),
    "an unknown quantity": ({"outcomes": sw.sweeps.Mean("momentum")}, "of: there is no 'momentum'"),
    "a component of a number": ({"outcomes": sw.sweeps.Mean(("y", 0))}, "of: a component of y of shape () is (\"y\"), got"),
    "a store without an ending": ({"store": "somewhere"}, "store: expected a path that ends in .zarr or .nc, got 'somewhere'"),
    "an engine": ({"engine": "dask"}, "engine: expected None, an executor of concurrent.futures or a client of dask.distributed"),
    "no memory": ({"memory": 100.0}, "memory: one member takes some"),
    "no steps": ({"steps": 0}, "steps: expected 1 or more"),
    "units": ({"units": {"y": 3}}, "units: expected words by name"),
    "a dimension of a result": ({"axes": {"omega": ("y_last", [1.0, 2.0])}}, "axes: 'y_last' is the name of a result"),
    "a method that cannot": ({"system": partial(Oscillator, damping=0.1), "method": "verlet"}, "verlet needs forces that do not"),
}  # fmt: skip


@looped("what", REFUSED)
def test_what_is_refused(what: str) -> None:
    wrong, message = REFUSED[what]
    refused((sw.StepwellError, TypeError), re.escape(message), sw.sweep, **(GOOD | wrong))


def test_what_does_not_go_with_float32_is_said_before_any_work() -> None:
    adaptive: dict[str, Any] = {"tolerance": 1e-9, "at": [1.0], "method": "merson", "dt": None, "steps": None}
    steps: dict[str, Any] = {"system": Oscillator(), "axes": {"dt": [0.1, 1e-50, 0.1]}, "dt": None}
    assert_refused(
        (lambda options=options: sw.sweep(**GOOD | {"dtype": "float32"} | options), error, message)
        for options, error, message in (
            (adaptive, ArgumentError, "tolerance: in float32 a step rounds the state by up"),
            ({"outcomes": "lyapunov"}, ArgumentError, "dtype: goes without Lyapunov exponents"),
            ({"axes": {"omega": [1.0, 1e39, 1.0]}}, ArgumentError, "axes: omega: expected numbers up to 3.4e38"),
            (steps, ArgumentError, "dt: expected a number of size 1.4e-45 to 3.4e38 units of time in float32"),
            ({"y": 1e39}, ArgumentError, "y: expected numbers up to 3.4e38"),
            ({"method": "taylor"}, UnsupportedError, "dtype: float32 does not work with taylor"),
            ({"dtype": "float16"}, DTypeError, "dtype: expected 'float64' or 'float32', got 'float16'"),
        )
    )


def test_a_component_must_be_given_and_a_package_be_there(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = sw.scenes.figure_eight()
    axes = {"v": ("speed", scene.v[..., None] * np.ones(2))}
    with pytest.raises(ArgumentError, match=re.escape("of: expected one number for each member, such as ('y', 0, 0)")):
        sw.sweep(scene.system, axes, "leapfrog", y=scene.y, dt=0.01, steps=5, outcomes="crossing")
    dataset = sw.sweep(
        scene.system, axes, "leapfrog", y=scene.y, dt=0.01, steps=300, outcomes=sw.sweeps.Crossing(("y", 0, 0), 0.5, "both")
    )
    run = sw.integrate(scene.system, "leapfrog", v=scene.v, y=scene.y, dt=0.01, steps=300, every=1)
    k = int(np.flatnonzero(np.diff(np.sign(run.y[:, 0, 0] - 0.5)))[0])
    assert run.t[k] <= float(dataset.y_0_0_crossing[0]) <= run.t[k + 1]
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(UnsupportedError, match=re.escape("sweep: needs the package xarray, which is missing (")) as caught:
        sw.sweep(**GOOD)
    assert 'pip install "stepwell[sweep]"' in str(caught.value)


def test_importing_stepwell_imports_nothing_of_this_and_filters_of_warnings_stay() -> None:
    code = (
        "import sys, stepwell as sw; print(*[m for m in sys.modules if m.split('.')[0] in ('xarray', 'zarr', 'dask', 'pandas')], "
    )
    code += "*[m for m in sys.modules if m.startswith('stepwell.studies.sweeps')])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split() == []
    before = list(warnings.filters)
    small(chunk=4, threads=4, outcomes="last")
    assert list(warnings.filters) == before


@looped("name", sw.sweeps.__all__)
def test_everything_public_has_an_example_that_runs(name: str) -> None:
    import doctest

    thing, output = getattr(sw.sweeps, name), []
    examples = doctest.DocTestParser().get_doctest(thing.__doc__ or "", {"sw": sw, "np": np}, name, None, None)
    assert examples.examples
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE, verbose=False)
    runner.run(examples, out=output.append)
    assert runner.failures == 0, "".join(output)


def test_a_function_alone_makes_the_run_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside reductions, which go piece by piece, its run is one more."""
    from stepwell.studies.sweeps import task

    lengths: list[int] = []

    def counting(original: Any) -> Any:
        def counted(*args: Any, **options: Any) -> Any:
            lengths.append(options["steps"])
            return original(*args, **options)

        return counted

    monkeypatch.setattr(task, "quietly", counting(task.quietly))
    monkeypatch.setattr(task.Pieces, "make", counting(task.Pieces.make))

    def end(run: sw.Run) -> Any:
        return run.y[-1]

    arguments: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 50, "threads": 1}
    alone = sw.sweep(Oscillator, {"omega": [1.0, 2.0]}, "rk4", outcomes=end, **arguments)
    assert lengths.count(50) == 1
    both = sw.sweep(Oscillator, {"omega": [1.0, 2.0]}, "rk4", outcomes=[end, "last"], **arguments)
    assert lengths.count(50) == 3
    np.testing.assert_array_equal(alone.end, both.y_last)
    np.testing.assert_array_equal(alone.status, both.status)
