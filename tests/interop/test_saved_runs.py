"""Runs in files: what is read is what was written, bit for bit, and goes on as it would have gone on."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, UnsupportedError
from support import own_systems as own
from support.cases import SYSTEMS, Case
from support.for_each import for_each


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        yield


def through(run: sw.Run, folder: Path, ending: str = ".npz", system: Any = None) -> sw.Run:
    """The run, written and read."""
    path = folder / f"run{ending}"
    run.save(path)
    return sw.load(path, system=system)


def assert_equal_bits(a: sw.Run, b: sw.Run) -> None:
    assert a == b
    for name in ("t", "v", "y", "carry", "work", "status", "first_bad_step"):
        one, other = getattr(a, name), getattr(b, name)
        assert (one is None) == (other is None)
        if one is not None:
            assert one.dtype == other.dtype
            assert one.tobytes() == other.tobytes(), name
    assert repr(a) == repr(b)


@for_each("name", SYSTEMS)
def test_every_system_is_read_as_it_was_written(name: str, tmp_path: Path) -> None:
    """That runs go on from a file, ``test_ways.py`` shows."""
    case = Case("rk4", name, "direct", None)
    system, _ = case.make(3)
    run = case.run(3, steps=2, every=1)
    assert_equal_bits(through(run, tmp_path, system=system if "function of the time" in name else None), run)


def controlled() -> dict[str, sw.Run]:
    """Runs under each control and projection."""
    eight, rods, top = sw.scenes.figure_eight(), sw.scenes.double_pendulum(), sw.scenes.dzhanibekov()

    def own_run(control: Any) -> sw.Run:
        return sw.integrate(own.pendulum(omega=1.5), "rk4", v=0.1, y=1.0, dt=0.01, steps=9, control=control)

    return {
        "energy": eight.run("rk4", steps=9, control=sw.EnergyControl(relative=0.1)),
        "energy, printed": eight.run("standard_euler", steps=9, control=sw.EnergyControl(0.1, "printed")),
        "energy, between steps": eight.run("pefrl", steps=9, control=sw.EnergyControl(0.1)),
        "scaling": eight.run("rk4", steps=9, control=sw.Projection("scaling")),
        "nacozy": eight.run("rk4", steps=9, control=sw.Projection("nacozy")),
        "length": rods.run("rk4", steps=9, control=sw.LengthControl(0.5)),
        "length projection": rods.run("rk4", steps=9, control=sw.Projection("length")),
        "norm": top.run("rk4", steps=9, control=sw.NormControl(0.5)),
        "norm projection": top.run("rk4", steps=9, control=sw.Projection("norm")),
        "invariant": own_run(sw.Control("energy", 1.0)),
        "invariant, printed": own_run(sw.Control("energy", 1.0, "printed")),
        "invariant projection": own_run(sw.Projection("energy")),
    }


def test_a_control_is_read_as_it_was_written(tmp_path: Path) -> None:
    for name, run in controlled().items():
        back = through(run, tmp_path)
        assert_equal_bits(back, run)
        assert back.system.keeper == run.system.keeper, name


@pytest.mark.parametrize("ending", [".npz", ".zarr"])
def test_numbers_that_are_easily_lost(ending: str, tmp_path: Path) -> None:
    """−0, which a chunk of zeros may lose, infinities, NaN and subnormal numbers; a force, recorded quantities, times."""
    if ending == ".zarr":
        pytest.importorskip("zarr")
    run = sw.integrate(sw.Oscillator(np.ones(6)), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, every=1, force=-0.0)
    run.y[...] = -0.0, 5e-324, 1e308, -np.nan, -np.inf, np.pi  # they are the caller's to change
    back = through(run, tmp_path, ending)
    assert_equal_bits(back, run)
    assert np.signbit(back.y[0, 0])
    assert back.force is not None
    assert run.force is not None
    assert back.force.tobytes() == run.force.tobytes()


def test_a_chunk_of_negative_zeros(tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    run = sw.integrate(sw.Oscillator(np.ones(1000)), "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
    run.y[...] = -0.0
    assert np.signbit(through(run, tmp_path, ".zarr").y).all()


def test_what_happened_on_the_way_is_in_the_file(tmp_path: Path) -> None:
    """Where bodies met in a run that diverged, recorded quantities, events."""
    y = np.stack([[[1.0, 3.0], [-2.0, -1.0], [1.0, -1.0]], np.zeros((3, 2))], axis=-1)
    run = sw.integrate(sw.NBody([3.0, 4.0, 5.0]), "rk4", v=0.0, y=y, dt=0.01, steps=20, every=2, record="energy")
    back = through(run, tmp_path)
    assert back == run
    assert back.collisions == run.collisions
    assert len(back.collisions) == 1
    assert back.encounters == run.encounters
    np.testing.assert_array_equal(back.recorded["energy"], run.recorded["energy"])
    ends = sw.Event(lambda t, v, y: y, direction=1, name="lowest")
    low = sw.Event(lambda t, v, y: y - 0.5, direction=-1, terminal=True, name="half")
    for events in (ends, [ends, low]):
        run = sw.integrate(sw.Pendulum(omega=[1.0, 2.0]), "rk4", v=0.0, y=1.0, dt=0.05, steps=400, events=events)
        back = through(run, tmp_path)
        assert back == run
        assert back.events == run.events
    assert np.isfinite(back.stopped_at).all()


def test_other_programs_find_the_arrays(tmp_path: Path) -> None:
    run = sw.integrate(sw.Oscillator(np.ones(3)), "leapfrog", v=0.0, y=1.0, dt=0.1, steps=10, every=5)
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz", allow_pickle=False) as file:
        np.testing.assert_array_equal(file["y"], run.y)
        np.testing.assert_array_equal(file["carry"], run.carry)
        np.testing.assert_array_equal(file["system.omega"], np.ones(3))


def test_a_state_that_many_members_share_takes_no_room(tmp_path: Path) -> None:
    run = sw.integrate(
        sw.NBody([1.0, 1.0], G=np.linspace(0.5, 1.0, 10_000)), "rk4", v=0.0, y=[[0.0, 0.0], [1.0, 0.0]], dt=0.1, steps=1
    )
    run.save(tmp_path / "run.npz")
    # v and y of 10 000 members, the shared start, G twice (it is reshaped for the core once), status and first bad step.
    assert (tmp_path / "run.npz").stat().st_size < 8 * 10_000 * (4 + 4 + 2 + 1) + 30_000
    assert sw.load(tmp_path / "run.npz") == run


# ---- own systems


def test_a_function_that_is_found_nowhere_must_be_given(tmp_path: Path) -> None:
    @sw.system
    def hidden(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        return -k * y

    run = sw.integrate(hidden(k=2.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    run.save(tmp_path / "run.npz")
    with pytest.raises(
        ArgumentError, match=r"equations of your own, .*hidden, which are not in the file.*give them, system=hidden"
    ):
        sw.load(tmp_path / "run.npz")
    for system in (hidden, hidden(k=3.0)):
        back = sw.load(tmp_path / "run.npz", system=system)
        assert_equal_bits(back, run)  # with the parameter of the file
    again = sw.integrate(back.system, back.method, steps=10, resume=back)
    assert again.y[-1] == sw.integrate(hidden(k=2.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=20).y[-1]


def test_another_function_is_noticed(tmp_path: Path) -> None:
    def kind(factor: float) -> Any:
        @sw.system
        def pull(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
            return -factor * k * y

        return pull

    sw.integrate(kind(1.5), "rk4", v=0.0, y=1.0, dt=0.1, steps=10).save(tmp_path / "run.npz")
    sw.load(tmp_path / "run.npz", system=kind(1.5))
    with pytest.raises(ArgumentError, match="system: pull makes other operations now than when the run was saved"):
        sw.load(tmp_path / "run.npz", system=kind(np.nextafter(1.5, 2.0)))


def test_another_invariant_is_noticed(tmp_path: Path) -> None:
    def kind(factor: float) -> Any:
        @sw.system
        def pull(t: Any, v: Any, y: Any) -> Any:
            return -y

        @pull.invariant
        def energy(v: Any, y: Any) -> Any:
            return factor * (v * v + y * y)

        return pull

    run = sw.integrate(kind(0.5), "rk4", v=0.0, y=1.0, dt=0.1, steps=10, control=sw.Projection("energy"))
    run.save(tmp_path / "run.npz")
    assert sw.load(tmp_path / "run.npz", system=kind(0.5)).y[-1] == run.y[-1]
    with pytest.raises(ArgumentError, match="makes other operations"):
        sw.load(tmp_path / "run.npz", system=kind(0.25))


def test_a_function_of_the_time_must_be_given(tmp_path: Path) -> None:
    system = own.pushed(x=own.turning)
    run = sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    run.save(tmp_path / "run.npz")
    with pytest.raises(ArgumentError, match="the parameter x of the run is a function of the time"):
        sw.load(tmp_path / "run.npz")
    with pytest.raises(ArgumentError, match="makes other operations"):
        sw.load(tmp_path / "run.npz", system=own.pushed(x=lambda t: 0.5 * t))
    assert sw.load(tmp_path / "run.npz", system=system) == run


# ---- what is refused


@for_each(
    ("path", "error", "match"),
    [
        (3, DTypeError, "path: expected the path of a file, got 3"),
        ("run.h5", ArgumentError, r"path: expected a file ending in \.npz or \.zarr, got 'run\.h5'"),
        ("missing/run.npz", ArgumentError, "path: expected a file that can be written"),
    ],
)
def test_where_a_run_cannot_be_saved(path: Any, error: type, match: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    with pytest.raises(error, match=match):
        run.save(path)
    assert not list(tmp_path.iterdir())


def test_what_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"path: expected a run that was saved, got .*: No such file"):
        sw.load(tmp_path / "none.npz")
    np.savez(tmp_path / "arrays.npz", y=np.ones(3))
    with pytest.raises(ArgumentError, match="it has arrays, and nothing that tells of a run"):
        sw.load(tmp_path / "arrays.npz")
    (tmp_path / "text.npz").write_text("a run")
    with pytest.raises(ArgumentError, match="path: expected a run that was saved"):
        sw.load(tmp_path / "text.npz")


def rewritten(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """The same file with another description or other arrays."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    change(arrays)
    np.savez(path, **arrays)


def test_a_file_of_another_version_or_a_damaged_one(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)

    def later(arrays: dict[str, Any]) -> None:
        arrays["stepwell_form"] = np.array([99])

    def without_an_array(arrays: dict[str, Any]) -> None:
        del arrays["system.omega"]

    def another_attribute(arrays: dict[str, Any]) -> None:
        parts = json.loads(arrays["stepwell"].item())
        del parts["t0"]
        arrays["stepwell"] = np.array(json.dumps(parts))

    def another_class(arrays: dict[str, Any]) -> None:
        arrays["stepwell"] = np.array(arrays["stepwell"].item().replace('"Oscillator"', '"os.system"'))

    for change, match in (
        (later, "its form is version 99, and this stepwell reads version 1"),
        (without_an_array, "which another version wrote or which is damaged"),
        (another_attribute, "which another version wrote or which is damaged"),
        (another_class, "which another version wrote or which is damaged"),
    ):
        run.save(path)
        rewritten(path, change)
        with pytest.raises(ArgumentError, match=match):
            sw.load(path)


def test_a_file_runs_no_code(tmp_path: Path) -> None:
    """A pickle in it is not opened, and nothing is imported because a file names it."""
    path = tmp_path / "run.npz"
    sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10).save(path)

    class Trap:
        def __reduce__(self) -> Any:
            return os.mkdir, (str(tmp_path / "sprung"),)

    trapped = np.empty((), dtype=object)
    trapped[()] = Trap()
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(path, **{**arrays, "y": trapped})
    assert b"mkdir" in zipfile.ZipFile(path).read("y.npy")
    with pytest.raises(ArgumentError, match="path: expected a run that was saved"):
        sw.load(path)
    assert not (tmp_path / "sprung").exists()
    pickle.loads(pickle.dumps(Trap()))  # which would have made it
    assert (tmp_path / "sprung").exists()

    (tmp_path / "sprung_too.py").write_text("raise SystemExit('imported')")

    @sw.system
    def plain(t: Any, v: Any, y: Any) -> Any:
        return -y

    sw.integrate(plain, "rk4", v=0.0, y=1.0, dt=0.1, steps=1).save(path)
    with np.load(path) as file:
        text = file["stepwell"].item().replace(__name__, "sprung_too")
        arrays = {**{name: file[name] for name in file.files}, "stepwell": np.array(text)}
    np.savez(path, **arrays)
    code = "import stepwell as sw\ntry:\n    sw.load('run.npz')\nexcept sw.StepwellError as error:\n    print(error)"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "sprung_too" in done.stdout
    assert "not imported" in done.stdout


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.npz"
    first = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    first.save(path)

    def full(*arguments: Any, **named: Any) -> None:
        arguments[0].write(b"half of it")
        raise OSError("no space left")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(OSError, match="no space left"):
        sw.integrate(sw.Oscillator(2.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=10).save(path)
    monkeypatch.undo()
    assert sw.load(path) == first
    assert [each.name for each in tmp_path.iterdir()] == ["run.npz"]


def test_a_folder_that_is_no_run_is_not_replaced(tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    run.save(tmp_path / "run.zarr")
    run.save(str(tmp_path / "run.zarr"))
    assert_equal_bits(sw.load(tmp_path / "run.zarr"), run)
    (tmp_path / "mine.zarr").mkdir()
    (tmp_path / "mine.zarr" / "thesis.txt").write_text("years of work")
    with pytest.raises(ArgumentError, match="path: expected a new folder, or one with a saved run"):
        run.save(tmp_path / "mine.zarr")
    assert (tmp_path / "mine.zarr" / "thesis.txt").exists()
    with pytest.raises(ArgumentError, match="path: expected a run that was saved"):
        sw.load(tmp_path / "mine.zarr")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["mine.zarr", "run.zarr"]


def test_zarr_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zarr", None)
    run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    for use in (lambda: run.save(tmp_path / "run.zarr"), lambda: sw.load(tmp_path / "run.zarr")):
        with pytest.raises(UnsupportedError, match=r"needs zarr, which is not installed; pip install 'stepwell\[zarr\]'"):
            use()
