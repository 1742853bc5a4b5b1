"""Sweeps in other processes and on a cluster: the same bits, a worker that is lost, what travels, what is compiled once."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest
import stepwell as sw
import xarray
from stepwell.errors import ArgumentError
from stepwell.studies.sweeps import portable
from stepwell.studies.sweeps.axes import Chunk
from stepwell.studies.sweeps.ensemble import _outcomes
from stepwell.studies.sweeps.task import Task
from support.sweeping import AXES, OUTCOMES, duffing, ends, small, unlike

#: Of Dask and its loops, at their own end.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")


@pytest.fixture(scope="module")
def whole() -> Any:
    return small()


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local_cluster:
        yield local_cluster


@pytest.fixture
def client(cluster: Any) -> Iterator[Any]:
    with distributed.Client(cluster) as dask_client:
        yield dask_client


# ---- the same bits everywhere


@pytest.mark.parametrize("chunk", [4, None])
def test_threads_of_an_executor(whole: Any, chunk: int | None) -> None:
    with ThreadPoolExecutor(3) as pool:
        assert unlike(whole, small(engine=pool, chunk=chunk)) == []


@pytest.mark.parametrize("start", ["spawn", "forkserver"])
def test_processes(whole: Any, start: str) -> None:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(start)) as pool:
        dataset = small(engine=pool, chunk=11)
        assert unlike(whole, dataset) == []
        assert dataset.attrs == whole.attrs


def test_a_cluster(whole: Any, client: Any, tmp_path: Path) -> None:
    for options in ({}, {"store": tmp_path / "a.zarr", "chunk": 10}, {"store": tmp_path / "a.nc", "chunk": 15}):
        with small(engine=client, **options) as dataset:
            assert unlike(whole, dataset) == []
            assert dataset.attrs["bits"] == whole.attrs["bits"]


def test_samples_on_a_cluster(client: Any) -> None:
    for axes in (
        sw.sweeps.random("sample", 32, seed=1, gamma=(0.1, 0.6), y=(-1.0, 1.0)),
        sw.sweeps.sobol("sample", 32, seed=1, gamma=(0.1, 0.6), y=(-1.0, 1.0)),
        {"gamma": ("run", np.linspace(0.1, 0.6, 9)), "y": ("run", np.linspace(-1.0, 1.0, 9))},
    ):
        assert (
            small(axes=axes, outcomes="period", engine=client, chunk=5).attrs["bits"]
            == small(axes=axes, outcomes="period").attrs["bits"]
        )


def test_progress_on_a_cluster(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask's own, which its dashboard draws, has every chunk by name; the bar here goes on with them."""
    from stepwell.base import progress

    shares: list[float] = []

    @contextlib.contextmanager
    def bar(title: str) -> Any:
        yield shares.append

    monkeypatch.setattr(progress, "bar", bar)
    with distributed.get_task_stream(client=client) as stream:
        dataset = small(engine=client, chunk=5, outcomes="last", progress=True)
    chunks = len(stream.data)
    assert chunks == dataset.sizes["gamma"] * dataset.sizes["y0"] // 5
    assert {each["key"].rsplit("-", 5)[0] for each in stream.data} == {"sweep_chunk"}
    assert {each["status"] for each in stream.data} == {"OK"}
    assert shares == sorted(shares)
    assert (len(shares), shares[-1]) == (chunks, 1.0)

    def counted(dask_scheduler: Any) -> Any:
        return dict(dask_scheduler.task_prefixes["sweep_chunk"].state_counts)

    assert client.run_on_scheduler(counted)["memory"] >= chunks


# ---- a worker is lost


def dying(mark: str, run: sw.Run) -> Any:
    """Kills its worker at the first call of all."""
    try:
        os.close(os.open(mark, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return {"end": run.y[-1]}
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("not reached")


@pytest.mark.parametrize("stored", [False, True])
def test_a_worker_that_is_lost(tmp_path: Path, stored: bool) -> None:
    """Its chunks are computed by others."""
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        before = set(client.scheduler_info(n_workers=-1)["workers"])
        lost = partial(dying, str(tmp_path / "mark"))
        store = {"store": tmp_path / "a.zarr"} if stored else {}
        dataset = small(engine=client, chunk=5, outcomes=["last", lost], **store)
        assert (tmp_path / "mark").exists()
        for _ in range(100):
            if set(client.scheduler_info(n_workers=-1)["workers"]) != before:
                break
            time.sleep(0.05)
        assert set(client.scheduler_info(n_workers=-1)["workers"]) != before
        whole = small(outcomes="last")
        np.testing.assert_array_equal(dataset.y_last, whole.y_last)
        np.testing.assert_array_equal(dataset.end, whole.y_last)


def test_a_process_that_is_lost_leaves_a_store_that_goes_on(tmp_path: Path) -> None:
    """An executor of processes is broken then; another one goes on."""
    from concurrent.futures.process import BrokenProcessPool

    lost, context = partial(dying, str(tmp_path / "mark")), multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool, pytest.raises(BrokenProcessPool):
        small(engine=pool, chunk=5, outcomes=["last", lost], store=tmp_path / "a.zarr")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        dataset = small(engine=pool, chunk=5, outcomes=["last", lost], store=tmp_path / "a.zarr")
    np.testing.assert_array_equal(dataset.end, small(outcomes="last").y_last)


# ---- what travels


def test_what_happens_in_another_process_is_told_here(client: Any) -> None:
    def wrong(run: sw.Run) -> Any:
        return run.y[-1, :1].reshape(1, 1, 1)[0, 0, 0]

    for engine in (client, None):
        with pytest.raises(
            ArgumentError, match="outcomes: wrong: expected an array whose last axis has one number for each member of the run, "
        ):
            small(engine=engine, outcomes=wrong)
    with pytest.warns(sw.DivergenceWarning, match=r"1 of 2 members diverged, that at omega = 30"):
        sw.sweep(sw.Oscillator, {"omega": [1.0, 30.0]}, "rk4", v=0.0, y=1.0, dt=0.2, steps=500, engine=client)


def test_equations_that_are_written_in_a_function(client: Any, whole: Any) -> None:
    """``pickle`` finds equations by name; those of a notebook, a script or a function travel by their text."""
    gain = 0.5

    @sw.system
    def local(t: Any, v: Any, y: Any, *, gamma: Any = gain) -> Any:
        return gamma * np.cos(1.2 * t) - 0.2 * v + gain * 2.0 * y - y**3

    @local.invariant
    def energy(v: Any, y: Any) -> Any:
        return 0.5 * v**2 - 0.5 * y**2 + 0.25 * y**4

    with pytest.raises(ArgumentError, match="an own system is pickled by the name of its function"):
        pickle.dumps(local)
    datasets = [
        sw.sweep(
            local, AXES, "rk4", v=0.0, dt=0.05, steps=100, outcomes=["last", sw.sweeps.Mean("energy")], engine=engine, chunk=5
        )
        for engine in (None, client)
    ]
    assert unlike(*datasets) == []


#: As a user writes it: equations in the script that is started, or in a notebook.
SCRIPT = """
    import numpy as np, stepwell as sw

    @sw.system
    def spring(t, v, y, *, k=1.0):
        return -k * y + 0.1 * np.sin(t)

    def half(run):
        return run.y[-1] / 2

    if __name__ == "__main__":
        from distributed import Client, LocalCluster
        arguments = dict(v=0.0, y=1.0, dt=0.1, steps=50, outcomes=["last", half])
        here = sw.sweep(spring, {"k": np.linspace(1.0, 2.0, 9)}, "rk4", **arguments)
        with LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=":0") as cluster, Client(cluster) as client:
            there = sw.sweep(spring, {"k": np.linspace(1.0, 2.0, 9)}, "rk4", **arguments, engine=client, chunk=2)
        assert here.attrs["bits"] == there.attrs["bits"]
        print("equal", (here.half == here.y_last / 2).all().item())
"""


@pytest.mark.parametrize("source", ["script", "standard input"])
def test_equations_of_a_script(source: str, tmp_path: Path) -> None:
    text = textwrap.dedent(SCRIPT)
    if source == "script":
        (tmp_path / "script.py").write_text(text)
        done = subprocess.run([sys.executable, str(tmp_path / "script.py")], capture_output=True, text=True, timeout=120)
    else:
        # As in a notebook, there is no file; workers are threads, and packed all the same.
        text = text.replace("threads_per_worker=2", "threads_per_worker=2, processes=False")
        done = subprocess.run([sys.executable], input=text, capture_output=True, text=True, timeout=120)
    assert done.stdout.split() == ["equal", "True"], done.stderr


def test_systems_methods_scenes_and_worlds_travel(client: Any) -> None:
    scene = sw.scenes.figure_eight()
    v, y = np.zeros(3), np.ones(3)
    world = sw.World(duffing(gamma=np.array([0.1, 0.2, 0.3])), "rk4", v=v, y=y, dt=0.1)

    def used(what: Any) -> Any:
        if isinstance(what, sw.World):
            what.step(10)
            return what.y
        if isinstance(what, sw.Method):
            return sw.integrate(sw.Oscillator(), what, v=0.0, y=1.0, dt=0.1, steps=10).y
        if isinstance(what, sw.System):
            return sw.integrate(what, "rk4", v=0.0, y=1.0, dt=0.1, steps=10).y
        return what.run("rk4", steps=10).y

    for what in (world, sw.method("leapfrog"), duffing(gamma=0.3), sw.Pendulum(1.0, 0.1), scene):
        there = client.submit(used, what, pure=False).result()
        np.testing.assert_array_equal(there, used(what))


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


def test_what_cannot_travel_is_told() -> None:
    lock = multiprocessing.get_context("spawn").Lock()

    def locked(run: sw.Run) -> Any:
        with lock:
            return run.y[-1]

    with (
        ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool,
        pytest.raises((ArgumentError, RuntimeError), match=r"engine: the system and the outcomes must be pickled|shared"),
    ):
        small(engine=pool, outcomes=locked)


# ---- xarray and Dask by themselves


def last(omega: Any, y: Any) -> Any:

    return sw.integrate(sw.Oscillator(omega), "rk4", v=0.0, y=y, dt=0.1, steps=50).y[-1]


@pytest.mark.parametrize("chunks", [None, {"omega": 3}, {"omega": 4, "y0": 2}])
def test_integrate_within_apply_ufunc(chunks: Any, client: Any) -> None:
    omega = xarray.DataArray(np.linspace(1.0, 2.0, 11), dims="omega")
    y = xarray.DataArray(np.linspace(0.1, 1.0, 5), dims="y0")
    truth = sw.integrate(sw.Oscillator(omega.values[:, None]), "rk4", v=0.0, y=y.values, dt=0.1, steps=50).y[-1]
    inputs = (omega, y) if chunks is None else xarray.broadcast(omega, y)
    if chunks is not None:
        inputs = tuple(each.chunk(chunks) for each in inputs)
    states = xarray.apply_ufunc(last, *inputs, dask="parallelized", output_dtypes=[float])
    np.testing.assert_array_equal(states.transpose("omega", "y0"), truth)


def test_integrate_within_dask_arrays(client: Any) -> None:
    import dask.array as da

    omega = np.linspace(1.0, 2.0, 100)
    states = da.map_blocks(last, da.from_array(omega, chunks=17), 1.0, dtype=float).compute()
    np.testing.assert_array_equal(states, sw.integrate(sw.Oscillator(omega), "rk4", v=0.0, y=1.0, dt=0.1, steps=50).y[-1])


def test_a_graph_of_dask_delayed(client: Any) -> None:
    import dask

    runs = [dask.delayed(sw.integrate)(duffing(gamma=g), "rk4", v=0.0, y=1.0, dt=0.1, steps=20) for g in (0.1, 0.2)]
    for run, g in zip(dask.compute(*runs), (0.1, 0.2), strict=True):
        np.testing.assert_array_equal(run.y, sw.integrate(duffing(gamma=g), "rk4", v=0.0, y=1.0, dt=0.1, steps=20).y)


def test_every_kind_of_outcome_travels() -> None:
    """What the tests above compare."""
    assert ends in OUTCOMES
    assert len(OUTCOMES) >= 10
