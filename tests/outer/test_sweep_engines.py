"""Sweeps in other processes and on a cluster: the same bits, a worker that is lost, what travels, what is compiled once."""

import contextlib
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest
import stepwell as sw
import xarray
from stepwell.studies.sweeps import stores
from support import ROOT
from support.sweeping import AXES, chunk_files, duffing, small, unlike

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


@pytest.mark.parametrize("start", ["spawn", "forkserver"])
def test_processes(start: str) -> None:
    """With fixed steps and with a tolerance."""
    paced = partial(sw.sweep, partial(duffing, delta=0.2), AXES, "dop853", v=0.0, tolerance=1e-8, at=np.linspace(0.0, 6.0, 25))
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(start)) as pool:
        for sweep in (small, paced):
            whole, dataset = sweep(), sweep(engine=pool, chunk=11)
            assert unlike(whole, dataset) == []
            assert dataset.attrs == whole.attrs


def test_a_cluster(whole: Any, client: Any, tmp_path: Path) -> None:
    for options in ({}, {"store": tmp_path / "a.zarr", "chunk": 10}, {"store": tmp_path / "a.nc", "chunk": 15}):
        with small(engine=client, **options) as dataset:
            assert unlike(whole, dataset) == []
            assert dataset.attrs["bits"] == whole.attrs["bits"]


def test_samples_on_a_cluster(client: Any) -> None:
    for make in (sw.sweeps.random, sw.sweeps.sobol):
        axes = make("sample", 32, seed=1, gamma=(0.1, 0.6), y=(-1.0, 1.0))
        there, here = (small(axes=axes, outcomes="period", **more) for more in ({"engine": client, "chunk": 5}, {}))
        assert there.attrs["bits"] == here.attrs["bits"]


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


def test_integrate_within_dask(client: Any) -> None:
    import dask.array as da

    omega = np.linspace(1.0, 2.0, 100)
    states = da.map_blocks(last, da.from_array(omega, chunks=17), 1.0, dtype=float).compute()
    np.testing.assert_array_equal(states, sw.integrate(sw.Oscillator(omega), "rk4", v=0.0, y=1.0, dt=0.1, steps=50).y[-1])
    import dask

    runs = [dask.delayed(sw.integrate)(duffing(gamma=g), "rk4", v=0.0, y=1.0, dt=0.1, steps=20) for g in (0.1, 0.2)]
    for run, g in zip(dask.compute(*runs), (0.1, 0.2), strict=True):
        np.testing.assert_array_equal(run.y, sw.integrate(duffing(gamma=g), "rk4", v=0.0, y=1.0, dt=0.1, steps=20).y)


# ---- stores of a process that is killed
#: A sweep of some seconds in a process of its own.
SLOW = """
    import signal, sys, time
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what a shell starts in the background ignores Ctrl-C
    sys.path.insert(0, {tests!r})
    from functools import partial
    import stepwell as sw
    from support.sweeping import duffing, AXES

    def slow(run):
        time.sleep(0.15)
        return {{"end": run.y[-1]}}

    dataset = sw.sweep(
        partial(duffing, delta=0.2), AXES, "rk4", v=0.0, dt=0.05, steps=60, outcomes=["last", slow], chunk=2, threads=2,
        store={store!r},
    )
    print("finished", dataset.attrs["bits"])
"""


def slow_sweep(tmp_path: Path, ending: str) -> tuple[Path, list[str]]:
    script, store = tmp_path / "slow.py", tmp_path / f"a.{ending}"
    script.write_text(textwrap.dedent(SLOW.format(tests=str(ROOT / "tests"), store=str(store))))
    return store, [sys.executable, str(script)]


def finished_chunks(store: Path) -> int:
    """How many chunks have their hash."""
    at = store if store.exists() else store.with_name(f"{store.name}.unfinished")
    return len(chunk_files(at, "progress/hashes"))


@pytest.mark.parametrize(
    ("killed", "ending"),
    [
        (True, "zarr"),
        (True, "nc"),
        pytest.param(False, "zarr", marks=pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")),
    ],
)
def test_after_a_signal_in_the_middle(killed: bool, ending: str, tmp_path: Path) -> None:
    """Killed again and again at any moment; every finished chunk stays as it is, and the result is that of one sweep."""
    store, command = slow_sweep(tmp_path, ending)
    written: dict[Path, int] = {}
    chunks = 27  # three of two, two and one member for each of nine values
    for least in (3, 10):
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        until = time.monotonic() + 60
        while finished_chunks(store) < least and process.poll() is None and time.monotonic() < until:
            time.sleep(0.01)
        process.kill() if killed else process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
        assert "finished" not in out, error
        if killed:
            assert process.returncode in (-9, 1)  # the latter on Windows
        else:
            assert "KeyboardInterrupt" in error
        assert least <= finished_chunks(store) < chunks
        at = store if ending == "zarr" else store.with_name("a.nc.unfinished")
        for file, when in written.items():
            assert file.stat().st_mtime_ns == when, "a finished chunk was written again"
        hashes = chunk_files(at, "progress/hashes")
        written = {file: file.stat().st_mtime_ns for file in hashes}
    beside = shutil.copytree(at, tmp_path / "beside.zarr")
    with stores.opened(beside) as there:
        done = there.status.values != -1
        assert 10 <= done.sum() < done.size
        assert np.isfinite(there.y_last.values[done]).all()
    done_by = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done_by.returncode == 0, done_by.stderr
    if ending == "zarr":
        for file, when in written.items():
            assert file.stat().st_mtime_ns == when
    else:
        assert not at.exists()
    whole = small(outcomes=["last", lambda run: {"end": run.y[-1]}], steps=60, transient=0)
    assert done_by.stdout.split() == ["finished", whole.attrs["bits"]]
    options = {"engine": "zarr", "consolidated": False} if ending == "zarr" else {"engine": "h5netcdf"}
    with xarray.open_dataset(store, **options) as dataset:
        np.testing.assert_array_equal(dataset.y_last, whole.y_last)
        np.testing.assert_array_equal(dataset.end, whole.y_last)
