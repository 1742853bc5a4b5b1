"""Runs in files: what is read is what was written, bit for bit, and goes on as it would have gone on."""

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
from support.refusals import refused


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


#: Each control and projection, with what it holds and the method.
HELD: list[tuple[str, str, Any]] = [
    *(
        ("figure_eight", "rk4", each)
        for each in (sw.EnergyControl(relative=0.1), sw.Projection("scaling"), sw.Projection("nacozy"))
    ),
    ("figure_eight", "standard_euler", sw.EnergyControl(0.1, "printed")),
    ("figure_eight", "pefrl", sw.EnergyControl(0.1)),  # between steps
    *(("double_pendulum", "rk4", each) for each in (sw.LengthControl(0.5), sw.Projection("length"))),
    *(("dzhanibekov", "rk4", each) for each in (sw.NormControl(0.5), sw.Projection("norm"))),
    *(
        ("own", "rk4", each)
        for each in (sw.Control("energy", 1.0), sw.Control("energy", 1.0, "printed"), sw.Projection("energy"))
    ),
]


def test_a_control_is_read_as_it_was_written(tmp_path: Path) -> None:
    pendulum = sw.Scene(own.pendulum(omega=1.5), v=0.1, y=1.0, horizon=1.0)
    for name, method, control in HELD:
        run = (pendulum if name == "own" else sw.scenes.scene(name)).run(method, 0.01, steps=9, control=control)
        back = through(run, tmp_path)
        assert_equal_bits(back, run)
        assert back.system.keeper == run.system.keeper, (name, control)


@pytest.mark.parametrize("ending", [".npz", ".zarr"])
def test_numbers_that_are_easily_lost(ending: str, tmp_path: Path) -> None:
    """−0, which a chunk of zeros may lose, infinities, NaN and subnormal numbers; a force."""
    if ending == ".zarr":
        pytest.importorskip("zarr")
    for special in ([-0.0, 5e-324, 1e308, -np.nan, -np.inf, np.pi], [-0.0] * 1000):
        run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=np.ones(len(special)), dt=0.1, steps=1, every=1, force=-0.0)
        run.y[...] = special  # they are the caller's to change
        back = through(run, tmp_path, ending)
        assert_equal_bits(back, run)
        assert np.signbit(back.y[0, 0])
        assert back.force.tobytes() == run.force.tobytes()  # type: ignore[union-attr]


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
    """v and y of 10 000 members, the shared start, G twice (it is reshaped for the core once), status and first bad step."""
    bodies, y = sw.NBody([1.0, 1.0], G=np.linspace(0.5, 1.0, 10_000)), [[0.0, 0.0], [1.0, 0.0]]
    run = sw.integrate(bodies, "rk4", v=0.0, y=y, dt=0.1, steps=1)
    assert through(run, tmp_path) == run
    assert (tmp_path / "run.npz").stat().st_size < 8 * 10_000 * (4 + 4 + 2 + 1) + 30_000


def test_a_function_that_is_found_nowhere_must_be_given(tmp_path: Path) -> None:
    @sw.system
    def hidden(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        return -k * y

    run = sw.integrate(hidden(k=2.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    run.save(tmp_path / "run.npz")
    words = r"equations of your own, .*hidden, which are not in the file.*give them, system=hidden"
    refused(ArgumentError, words, sw.load, tmp_path / "run.npz")
    for system in (hidden, hidden(k=3.0)):
        back = sw.load(tmp_path / "run.npz", system=system)
        assert_equal_bits(back, run)  # with the parameter of the file
    again = sw.integrate(back.system, back.method, steps=10, resume=back)
    assert again.y[-1] == sw.integrate(hidden(k=2.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=20).y[-1]


def test_another_function_or_invariant_is_noticed(tmp_path: Path) -> None:
    def kind(of_rate: float, of_energy: float) -> Any:
        @sw.system
        def pull(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
            return -of_rate * k * y

        @pull.invariant
        def energy(v: Any, y: Any, *, k: Any) -> Any:
            return of_energy * (v * v + y * y)

        return pull

    run = sw.integrate(kind(1.5, 0.5), "rk4", v=0.0, y=1.0, dt=0.1, steps=10, control=sw.Projection("energy"))
    assert through(run, tmp_path, system=kind(1.5, 0.5)).y[-1] == run.y[-1]
    for other in (kind(np.nextafter(1.5, 2.0), 0.5), kind(1.5, 0.25)):
        with pytest.raises(ArgumentError, match="system: pull makes other operations now than when the run was saved"):
            sw.load(tmp_path / "run.npz", system=other)


def test_a_function_of_the_time_must_be_given(tmp_path: Path) -> None:
    system = own.pushed(x=own.turning)
    run = sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    assert through(run, tmp_path, system=system) == run
    for other, match in (
        (None, "the parameter x of the run is a function of the time"),
        (own.pushed(x=lambda t: 0.5 * t), "makes other operations"),
    ):
        refused(ArgumentError, match, sw.load, tmp_path / "run.npz", system=other)


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
    refused(error, match, run.save, path)
    assert not list(tmp_path.iterdir())


def test_what_is_no_run(tmp_path: Path) -> None:
    np.savez(tmp_path / "arrays.npz", y=np.ones(3))
    (tmp_path / "text.npz").write_text("a run")
    for name, match in (
        ("none", r"path: expected a run that was saved, got .*: No such file"),
        ("arrays", "it has arrays, and nothing that tells of a run"),
        ("text", "path: expected a run that was saved"),
    ):
        refused(ArgumentError, match, sw.load, tmp_path / f"{name}.npz")


def rewritten(path: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """The same file with another description or other arrays."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    change(arrays)
    np.savez(path, **arrays)


def test_a_file_of_another_version_or_a_damaged_one(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)

    def described(change: Callable[[str], str]) -> Callable[[dict[str, Any]], Any]:
        return lambda arrays: arrays.update(stepwell=np.array(change(arrays["stepwell"].item())))

    damaged = "which another version wrote or which is damaged"
    for change, match in (
        (lambda arrays: arrays.update(stepwell_form=np.array([99])), "its form is version 99, and this stepwell reads version 1"),
        (lambda arrays: arrays.pop("system.omega"), damaged),
        (described(lambda text: json.dumps({name: each for name, each in json.loads(text).items() if name != "t0"})), damaged),
        (described(lambda text: text.replace('"Oscillator"', '"os.system"')), damaged),
    ):
        run.save(path)
        rewritten(path, change)
        refused(ArgumentError, match, sw.load, path)


def test_a_file_runs_no_code(tmp_path: Path) -> None:
    """A pickle in it is not opened, and nothing is imported because a file names it."""
    path = tmp_path / "run.npz"
    sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10).save(path)

    class Trap:
        def __reduce__(self) -> Any:
            return os.mkdir, (str(tmp_path / "sprung"),)

    trapped = np.empty((), dtype=object)
    trapped[()] = Trap()
    rewritten(path, lambda arrays: arrays.update(y=trapped))
    assert b"mkdir" in zipfile.ZipFile(path).read("y.npy")
    refused(ArgumentError, "path: expected a run that was saved", sw.load, path)
    assert not (tmp_path / "sprung").exists()
    pickle.loads(pickle.dumps(Trap()))  # which would have made it
    assert (tmp_path / "sprung").exists()

    (tmp_path / "sprung_too.py").write_text("raise SystemExit('imported')")

    @sw.system
    def plain(t: Any, v: Any, y: Any) -> Any:
        return -y

    sw.integrate(plain, "rk4", v=0.0, y=1.0, dt=0.1, steps=1).save(path)
    named = __name__, "sprung_too"
    rewritten(path, lambda arrays: arrays.update(stepwell=np.array(arrays["stepwell"].item().replace(*named))))
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
    refused(OSError, "no space left", sw.integrate(sw.Oscillator(2.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=10).save, path)
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
    refused(ArgumentError, "path: expected a new folder, or one with a saved run", run.save, tmp_path / "mine.zarr")
    assert (tmp_path / "mine.zarr" / "thesis.txt").exists()
    refused(ArgumentError, "path: expected a run that was saved", sw.load, tmp_path / "mine.zarr")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["mine.zarr", "run.zarr"]


def test_zarr_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zarr", None)
    run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    for use in (lambda: run.save(tmp_path / "run.zarr"), lambda: sw.load(tmp_path / "run.zarr")):
        refused(UnsupportedError, r"needs zarr, which is not installed; pip install 'stepwell\[zarr\]'", use)
