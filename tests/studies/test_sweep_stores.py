"""Sweeps on disk: what is there after a kill, Ctrl-C, or with a torn file; and what is done again, and what is not."""

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
import xarray
from stepwell.errors import ArgumentError
from stepwell.studies.sweeps import engines, stores
from support.looped import in_turn
from support.refusals import refused
from support.sweeping import chunk_files, small, unlike

KINDS = pytest.mark.parametrize("ending", ["zarr", "nc"])


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The first members of the chunks that are computed, as they are."""
    firsts: list[int] = []
    original = engines.run

    def counted(task: Any, values: Any, members: int, stopped: Any = None) -> Any:
        firsts.append(members)
        return original(task, values, members, stopped)

    monkeypatch.setattr(engines, "run", counted)
    return firsts


@pytest.mark.parametrize(("ending", "every"), in_turn(["zarr", "nc"], [40, None]))
def test_a_store_holds_what_memory_would(ending: str, every: int | None, tmp_path: Path) -> None:
    options: dict[str, Any] = {
        "every": every,
        "outcomes": ["last", "period", *(["history"] if every else [])],
        "units": {"t": "s"},
    }
    there = small(**options)
    with small(**options, store=tmp_path / f"a.{ending}", chunk=7) as dataset:
        assert unlike(there, dataset) == []
        assert there.attrs == {name: value.item() if hasattr(value, "item") else value for name, value in dataset.attrs.items()}
        assert dataset.y_last.attrs == there.y_last.attrs
        assert set(dataset.coords) == set(there.coords)
        assert list(dataset.data_vars) == list(there.data_vars)
    assert os.listdir(tmp_path) == [f"a.{ending}"]


@KINDS
def test_a_finished_sweep_is_not_done_again(ending: str, tmp_path: Path, computed: list[int]) -> None:
    path = tmp_path / f"a.{ending}"
    first = small(store=path, outcomes="last", chunk=10).load()
    first.close()
    assert len(computed) == 5
    # Other chunks than those of the store are not asked for: it goes on with its own.
    again = small(store=path, outcomes="last", chunk=3).load()
    again.close()
    assert len(computed) == 5
    assert unlike(first, again) == []


class Enough(Exception):  # noqa: N818
    """Raised in the middle of a sweep."""


def interrupted(path: Path, after: int, monkeypatch: pytest.MonkeyPatch, error: type[BaseException] = Enough) -> None:
    """A sweep that stops after so many chunks."""
    original, left = stores.Zarr.write, [after]

    def write(self: Any, chunk: Any, results: Any) -> None:
        if left[0] == 0:
            raise error
        left[0] -= 1
        original(self, chunk, results)

    with monkeypatch.context() as patch:
        patch.setattr(stores.Zarr, "write", write)
        with pytest.raises(error):
            small(store=path, outcomes="last", chunk=10, threads=1)


@KINDS
def test_it_goes_on_where_it_stopped(ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, computed: list[int]) -> None:
    path = tmp_path / f"a.{ending}"
    interrupted(path, 3, monkeypatch)
    computed.clear()
    with small(store=path, outcomes="last") as dataset:
        assert len(computed) == 2
        assert unlike(small(outcomes="last"), dataset) == []
        assert dataset.attrs["bits"] == small(outcomes="last").attrs["bits"]


def test_ctrl_c_leaves_a_valid_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was finished is there, and what was not says so."""
    path = tmp_path / "a.zarr"
    interrupted(path, 2, monkeypatch, KeyboardInterrupt)
    with stores.opened(path) as there:
        done = there.status.values != -1
        assert done.sum() == 20
        whole = small(outcomes="last")
        np.testing.assert_array_equal(there.y_last.values[done], whole.y_last.values[done])
        assert np.isnan(there.y_last.values[~done]).all()
        assert "bits" not in there.attrs


@pytest.mark.parametrize(
    ("damage", "name"), in_turn(["empty", "half", "a bit", "gone", "another"], ["progress/hashes", "y_last", "status"])
)
def test_a_torn_chunk_is_done_again(damage: str, name: str, tmp_path: Path, computed: list[int]) -> None:
    """And no other one. Whole numbers are compressed, so a bit may be an error of the codec, or another number."""
    path = tmp_path / "a.zarr"
    whole = small(store=path, outcomes=["last"], chunk=10).load()
    assert len(computed) == 5
    files = chunk_files(path, name)
    assert len(files) == 5
    file, data = files[2], files[2].read_bytes()
    match damage:
        case "empty":
            file.write_bytes(b"")
        case "half":
            file.write_bytes(data[: len(data) // 2])
        case "a bit":
            file.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
        case "gone":
            file.unlink()
        case "another":
            file.write_bytes(files[3].read_bytes())
    same = name == "status" and damage == "another"  # since all members of all chunks ended well
    again = small(store=path, outcomes=["last"]).load()
    assert len(computed) == (5 if same else 6)
    assert unlike(whole, again) == []


@pytest.mark.mutant
def test_a_chunk_that_is_taken_as_finished_by_its_hash_alone_would_be_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.zarr"
    whole = small(store=path, outcomes="last", chunk=10).load()
    chunk_files(path, "y_last")[2].unlink()
    with monkeypatch.context() as patch:
        patch.setattr(stores.Zarr, "finished", lambda self, chunk: bool(self.group["progress/hashes"][chunk.place]))
        assert unlike(whole, small(store=path, outcomes="last")) == ["y_last"]
    assert unlike(whole, small(store=path, outcomes="last")) == []


def test_a_store_of_another_sweep_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.zarr"
    small(store=path, outcomes="last", steps=10).close()
    for wrong, name in (
        ({"steps": 11}, "steps: 10 there, 11 asked for"),
        ({"dt": 0.1}, "given: "),
        ({"outcomes": "extremes"}, "outcomes: "),
        ({"axes": {"gamma": [0.1, 0.2]}, "y": 1.0}, "axes: "),
        ({"dt": 0.1}, "given: {'dt': "),
        ({"fused": True}, "given: "),
        ({"v": 1.0}, "given: "),
    ):
        with pytest.raises(ArgumentError, match=re.escape("is of another sweep and is not continued (") + f".*{name}"):
            small(**({"outcomes": "last", "steps": 10, "store": path} | wrong))
    store = tmp_path / "sweep.zarr"
    options: dict[str, Any] = {"outcomes": ("last", "extremes", "mean"), "chunk": 9}
    dataset = small(dtype="float32", store=store, **options)
    assert (dataset.y_last.dtype, unlike(dataset.compute(), small(dtype="float32", **options))) == (np.float32, [])
    assert unlike(small(dtype="float32", store=store, **options).compute(), dataset.compute()) == []
    refused(ArgumentError, "is of another sweep and is not continued", small, store=store, **options)
    # The first steps of two members are compared to the bit.
    path, arguments = tmp_path / "spring.zarr", {"y": 1.0, "v": 0.0, "dt": 0.1, "steps": 10}

    def spring(factor: float) -> Any:
        @sw.system
        def spring(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
            return -k * y * factor

        return spring

    sw.sweep(spring(1.0), {"k": [1.0, 2.0]}, "rk4", **arguments, store=path).close()
    sw.sweep(spring(1.0), {"k": [1.0, 2.0]}, "rk4", **arguments, store=path).close()
    with pytest.raises(ArgumentError, match=r"is not continued \(the equations are others: their first steps have other bits"):
        sw.sweep(spring(1.0 + 2**-50), {"k": [1.0, 2.0]}, "rk4", **arguments, store=path)


@KINDS
def test_a_path_with_something_else(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{ending}"
    path.write_text("mine")
    with pytest.raises(ArgumentError, match=r"store: expected a new path or that of a sweep, got .*, which is something else"):
        small(store=path, outcomes="last")
    assert path.read_text() == "mine"


def test_a_removal_that_was_interrupted(tmp_path: Path) -> None:
    """Of the chunks of a NetCDF file, after the file was written."""
    small(store=tmp_path / "a.nc", outcomes="last").close()
    left = tmp_path / "a.nc.unfinished"
    left.mkdir()
    (left / "y_last").mkdir()
    small(store=tmp_path / "a.nc", outcomes="last").close()
    assert os.listdir(tmp_path) == ["a.nc"]


@KINDS
def test_xarray_reads_it_by_itself(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{ending}"
    small(store=path, outcomes=["last"]).close()
    opened = xarray.open_dataset(
        path, **({"engine": "zarr", "consolidated": False} if ending == "zarr" else {"engine": "h5netcdf"})
    )
    with opened as dataset:
        assert dataset.y_last.dims == ("gamma", "y0")
        assert float(dataset.y_last.sel(gamma=0.1, y0=1.0)) == float(small(outcomes="last").y_last.sel(gamma=0.1, y0=1.0))
        assert json.loads(dataset.attrs["sweep"])["method"] == "rk4"


TORN = {
    "empty": lambda whole: b"",
    "half": lambda whole: whole[: len(whole) // 2],
    "of another shape": lambda whole: json.dumps(json.loads(whole) | {"shape": [7]}).encode(),
}


@pytest.mark.parametrize(
    ("what", "damage", "ending"), in_turn(["y_last", "status", "gamma", "y0", "progress/hashes"], list(TORN), ["zarr", "nc"])
)
def test_torn_metadata_is_told(what: str, damage: str, ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before any work; nothing is written, so that what is whole can still be read."""
    path = tmp_path / f"a.{ending}"
    interrupted(path, 2, monkeypatch)
    store = path if ending == "zarr" else path.with_name(f"{path.name}.unfinished")
    file = store / what / "zarr.json"
    whole = file.read_bytes()
    torn = TORN[damage](whole)
    file.write_bytes(torn)
    with pytest.raises(ArgumentError, match=rf"^store: .* the metadata of {what} is torn \(.*remove it, or give another path"):
        small(store=path, outcomes="last")
    assert file.read_bytes() == torn
    file.write_bytes(whole)
    assert unlike(small(outcomes="last"), small(store=path, outcomes="last").load()) == []


@KINDS
def test_a_full_disk_leaves_nothing_that_is_none(ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a folder without a store, nor a half of one; and what is done stays where there is one."""
    import zarr

    path = tmp_path / f"a.{ending}"
    original = zarr.Group.create_array

    def full(*_: Any, **__: Any) -> Any:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(zarr.Group, "create_array", full)
        with pytest.raises(
            ArgumentError, match=r"^store: .* cannot be written: No space left on device; .* make room and call again"
        ):
            small(store=path, outcomes="last")
    assert os.listdir(tmp_path) == []
    assert original is zarr.Group.create_array
    interrupted(path, 2, monkeypatch)
    with monkeypatch.context() as patch:
        patch.setattr(zarr.Array, "__setitem__", full)
        refused(ArgumentError, "the chunks that are done are kept: make room and call again", small, store=path, outcomes="last")
    assert unlike(small(outcomes="last"), small(store=path, outcomes="last").load()) == []
