"""Short turns of each campaign (``make campaign`` runs them for longer), and what campaigns found before.

What was tried and how often is in docs/developing/reliability.md.
"""

import json
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from campaign import calls, disks, fuzz, memory, oracle, processes, threads
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stepwell.base import files
from stepwell.studies.sweeps import stores
from support import ROOT
from support.for_each import for_each

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="forks, limits and memory as Linux has them")
timer = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there is no timer here")

CORPUS: list[dict[str, Any]] = json.loads((ROOT / "tests" / "campaign" / "corpus.json").read_text())


def alone(expression: str) -> str:
    """What an expression over the campaigns comes to, in a process of its own."""
    # That of the tests may be large, which hides a leak, and may have threads that a fork does not survive, such as JAX's.
    words = [sys.executable, "-c", f"from campaign import memory, processes; print({expression})"]
    paths = os.pathsep.join([str(ROOT / "tests"), *sys.path])
    process = subprocess.run(words, env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True, timeout=300)
    assert process.returncode == 0, process.stderr
    return process.stdout.strip()


@pytest.fixture
def _quiet() -> Iterator[None]:
    digits = sys.get_int_max_str_digits()
    with warnings.catch_warnings():
        oracle.quiet()
        yield
    sys.set_int_max_str_digits(digits)  # other tests want Python's own


@timer
@pytest.mark.usefixtures("_quiet")
@settings(max_examples=60, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
@given(fuzz.examples(), st.data())
def test_fuzzed_calls_work_or_say_what_is_wrong(example: fuzz.Example, data: Any) -> None:
    with oracle.Timer() as watch:
        for call in data.draw(st.just(fuzz.variations(example)[:25])):
            outcome = fuzz.make(watch, call)
            assert outcome.kind != "failed", f"{json.dumps(call)}\n{fuzz.in_words(call)}: {outcome.text}"


@timer
@pytest.mark.usefixtures("_quiet")
@for_each("case", CORPUS)
def test_what_was_found_stays_mended(case: dict[str, Any]) -> None:
    """Each of these calls once ended otherwise."""
    outcome = fuzz.once(case["call"])
    assert outcome.kind in case["kinds"], f"{fuzz.in_words(case['call'])}: {outcome}"


@pytest.mark.mutant
@timer
@pytest.mark.usefixtures("_quiet")
def test_the_oracle_notices_what_it_is_to_notice() -> None:
    """Raw errors, messages without a name, results that are not what they say, and calls that do not end."""

    def raw(x: Any) -> Any:
        return np.ones(2) + np.ones(3)

    def nameless(x: Any) -> Any:
        raise sw.errors.ArgumentError("no")

    def not_finite(x: Any) -> Any:
        run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
        run.v = run.v * np.nan
        return run

    def other_bits(x: Any) -> Any:
        calls.same("a number", 1.0, np.nextafter(1.0, 2.0))

    def endless(x: Any) -> Any:
        while True:
            pass

    @settings(max_examples=1, deadline=None, database=None)
    @given(st.just(endless))
    def in_hypothesis(call: Any) -> None:
        assert oracle.judged(watch, call, {"x": 1}, ["x"], 0.05).kind == "stopped"

    with oracle.Timer() as watch:
        in_hypothesis()
        for call in (raw, nameless, not_finite, other_bits):
            assert oracle.judged(watch, call, {"x": 1}, ["argument"], 1.0).kind == "failed", call.__name__
        assert oracle.judged(watch, endless, {"x": 1}, ["x"], 0.05).kind == "stopped"
        assert oracle.judged(watch, lambda x: x, {"x": 1}, ["x"], 1.0).kind == "worked"


@timer
def test_a_call_that_ends_its_process_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A crash is reported with the call that made it; here the file of a campaign has a call that kills its process."""
    crash = tmp_path / "campaign_crash.py"
    crash.write_text(
        "import os\nfrom campaign import calls\n"
        "calls.EVERY['Sinusoid'] = lambda amplitude, omega, phase: omega == 7.0 and os.abort(), calls.EVERY['Sinusoid'][1]\n"
        "from campaign import fuzz\nfuzz.main()\n"
    )
    run = subprocess.run
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT / "tests"), *sys.path]))
    monkeypatch.setattr(fuzz.subprocess, "run", lambda words, **of: run([words[0], str(crash), *words[3:]], **of))
    example = ("Sinusoid", [["float", (1.0).hex()], ["float", (7.0).hex()]], 1)
    name, changed = fuzz._culprit(example)
    assert name == "Sinusoid"
    assert changed["omega"] == ["float", (7.0).hex()]


@LINUX
@pytest.mark.parametrize("kind", ["one member", "adaptive", "worlds", "new systems", "refused"])
def test_memory_is_steady(kind: str) -> None:
    count, before, after = memory.aside(kind, 3000)
    assert not memory.wrong(kind, before, after), f"after {count} runs"


@pytest.mark.mutant
@LINUX
def test_a_leak_is_noticed() -> None:
    """Eight kilobytes a run, and a file that stays open."""
    keeping = "(lambda kept: memory.wrong('', *memory.runs('', {}, lambda _: kept.append({}))[1:]))([])"
    assert "kB" in alone(keeping.format(3000, "bytearray(8192)"))
    assert "files" in alone(keeping.format(20, "open('/dev/null')"))


@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning", "ignore::stepwell.AccuracyWarning")
@pytest.mark.parametrize("check", threads.CHECKS, ids=lambda check: check.__name__)
def test_threads_that_share_things_get_the_bits_of_one(check: Any) -> None:
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        assert check(3) >= threads.THREADS
    finally:
        sys.setswitchinterval(interval)


@LINUX
@pytest.mark.parametrize("way", ["fork", "spawn"])
def test_other_processes_have_the_same_bits(way: str) -> None:
    assert alone(f"processes.pool('{way}', 4)") == "4"


@LINUX
def test_forks_while_threads_trace_compile_and_step() -> None:
    assert alone("processes.busy_forks(10)") == "10"
    assert alone("processes.forks_amid_compiling(30)") == "30"


@LINUX
@pytest.mark.parametrize("ending", [".npz", ".zarr"])
def test_a_writer_that_is_killed_leaves_a_whole_run(ending: str) -> None:
    if ending == ".zarr":
        pytest.importorskip("zarr")
    assert processes.killed_writers(3, ending) == 3


@LINUX
@pytest.mark.parametrize("way", disks.WAYS)
def test_a_full_disk_leaves_what_was_there(way: str, tmp_path: Path) -> None:
    """With less room than it takes there is an error, the old file is as it was, and nothing is left beside it."""
    if way == "a run in a folder":
        pytest.importorskip("zarr")
    name, write = disks.WAYS[way]
    write(tmp_path / name, 0.0)
    before = disks.contents(tmp_path)
    largest = max(map(len, before.values()))
    for limit in (0, 100, largest // 2):
        message = disks.aside(way, tmp_path, limit)
        assert message, f"{limit} bytes"
        assert disks.contents(tmp_path) == before, f"{limit} bytes: {message}"
    assert disks.aside(way, tmp_path, 10**9) == ""


@LINUX
@pytest.mark.parametrize("way", disks.SWEEPS)
def test_a_sweep_goes_on_when_there_is_room_again(way: str, tmp_path: Path) -> None:
    """It has the bits of a sweep that always had room."""
    pytest.importorskip("zarr")
    xarray = pytest.importorskip("xarray")
    name, write = disks.SWEEPS[way]
    write(tmp_path / f"whole-{name}", 1.0)
    for limit in (0, 300):  # more is enough for the Zarr store; HDF5 itself may crash where a file cannot grow
        assert disks.aside(way, tmp_path, limit), f"{limit} bytes"
    assert disks.aside(way, tmp_path, 10**9) == ""
    of = {"engine": "zarr", "consolidated": False} if name.endswith("zarr") else {"engine": "h5netcdf"}
    with xarray.open_dataset(tmp_path / f"whole-{name}", **of) as whole, xarray.open_dataset(tmp_path / name, **of) as resumed:
        assert resumed.attrs["bits"] == whole.attrs["bits"]
        xarray.testing.assert_identical(resumed[["v", "y"]].load(), whole[["v", "y"]].load())


def test_a_file_that_would_not_fit_on_its_disk_is_not_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HDF5 may crash where a file cannot grow. What was computed is kept, and goes into the file when there is room."""
    pytest.importorskip("h5netcdf")
    path = tmp_path / "sweep.nc"
    with monkeypatch.context() as patch:
        patch.setattr(stores.shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
        with pytest.raises(sw.errors.TooLargeError, match=r"but its disk has 0\.000954 MiB left"):
            disks.a_sweep(path, 1.0)
    assert [each.name for each in tmp_path.iterdir()] == ["sweep.nc.unfinished"]
    disks.a_sweep(path, 1.0)
    assert [each.name for each in tmp_path.iterdir()] == ["sweep.nc"]


@LINUX
@pytest.mark.parametrize("way", disks.WAYS)
def test_where_nothing_can_be_written_it_is_said(way: str) -> None:
    """/proc takes no files, not even those of the administrator."""
    name, write = disks.WAYS[way]
    with pytest.raises((sw.StepwellError, OSError)):
        write(Path("/proc") / name, 1.0)


def test_a_text_takes_its_place_when_it_is_whole(tmp_path: Path) -> None:
    """Its rights stay, a link goes on to point to it, and what is no file is written to directly."""
    path, link = tmp_path / "step.c", tmp_path / "link.c"
    step = sw.export(sw.Oscillator(), "rk4", "c")
    path.write_text("old")
    path.chmod(0o640)
    link.symlink_to(path)
    step.save(link)
    assert (path.read_text(), link.is_symlink(), path.stat().st_mode & 0o777) == (step.source, True, 0o640)
    assert sorted(tmp_path.iterdir()) == [link, path]
    with pytest.raises(UnicodeEncodeError):
        files.write_text(path, "half of it" * 10_000 + "\ud800")  # no text of a file
    assert (path.read_text(), sorted(tmp_path.iterdir())) == (step.source, [link, path])
    reader, writer = os.pipe()
    files.write_text(Path(f"/dev/fd/{writer}"), "through a pipe")
    os.close(writer)
    assert os.read(reader, 100) == b"through a pipe"
    os.close(reader)
