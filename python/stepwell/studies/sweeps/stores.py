"""The stores of results: arrays in memory, or a Zarr store to which every finished chunk is written."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from ...base import checks, files, paths
from ...base.arrays import Array, Shape
from ...errors import ArgumentError, ShapeError, TooLargeError
from .axes import Chunk
from .extras import need
from .layout import Layout, Planned, along_dims, hash_of_all, hash_of_chunk
from .outcomes import Results

#: The group and the array of a store with the hashes of finished chunks.
PROGRESS, HASHES = "progress", "hashes"
#: Attributes of a store: the description of its sweep, the shape of its chunks, and the hash of its results.
SWEEP, CHUNK_SHAPE, BITS = "sweep", "chunk_shape", "bits"
#: Attributes for xarray: the names of the coordinates, and the order of the results.
COORDINATES, RESULTS = "coordinates", "results"

#: The least numbers of a member, 8 bytes each: its status takes a byte, its first bad step eight, and there is at least one
#: result.
LEAST_NUMBERS = 17 / 8


class Memory:
    """Arrays of this process."""

    def __init__(self, layout: Layout, chunk_shape: Shape) -> None:
        self.layout, self.chunk_shape = layout, chunk_shape
        checks.fits("axes: status and results", LEAST_NUMBERS, layout.grid.shape, "give store=, a folder on disk")
        self.arrays: dict[str, Array] = {}
        self.about: dict[str, Planned] = {}

    def finished(self, chunk: Chunk) -> bool:
        """True if the results of a chunk are there already."""
        return False

    def write(self, chunk: Chunk, results: Results) -> None:
        """Store the results of a chunk."""
        if not self.arrays:
            self.about = self.layout.arrays(results)
            numbers = sum(each.dtype.itemsize * float(prod(each.shape)) for each in self.about.values()) / 8.0
            checks.fits("the results", numbers, (), "give store=, a folder on disk")
            self.arrays = {name: np.full(each.shape, each.fill, each.dtype) for name, each in self.about.items()}
        for name, values in along_dims(results, chunk).items():
            self.arrays[name][chunk.slices] = values

    def finish(self) -> Any:
        """The dataset of all results."""
        chunks = self.layout.grid.chunks(self.chunk_shape)
        bits = hash_of_all({name: each[chunk.slices] for name, each in self.arrays.items()} for chunk in chunks)
        xarray = need("xarray")
        return xarray.Dataset(
            {name: (each.dims, self.arrays[name], each.attrs) for name, each in self.about.items()},
            self.layout.coords,
            {**self.layout.attrs, BITS: bits},
        )


class Zarr:
    """A Zarr store. It appears at its path, with space for all results, when the first chunk is done; each chunk is written once.

    A chunk's hash is written after its results. A chunk whose results do not match its hash was interrupted or damaged, and is
    not finished.
    """

    def __init__(self, path: Path, layout: Layout, chunk_shape: Shape) -> None:
        self.path, self.layout, self.chunk_shape = path, layout, chunk_shape
        self.group: Any = None
        self._zarr = need("zarr")
        if path.exists():
            self.group = self._opened()
            self.chunk_shape = tuple(self.group.attrs[CHUNK_SHAPE])

    def _opened(self) -> Any:
        try:
            group = self._zarr.open_group(self.path, mode="r+", use_consolidated=False)
            there = json.loads(group.attrs[SWEEP])
        except Exception as error:  # zarr raises exceptions of many kinds for a folder or a file that is no store
            raise ArgumentError(
                f"store: expected a new path or that of a sweep, got {checks.short(str(self.path), paths.PATH)}, "
                f"which is something else ({type(error).__name__}: {error})"
            ) from None
        same_sweep(self.path, there, json.loads(self.layout.attrs[SWEEP]))
        self._check(group)
        return group

    def _check(self, group: Any) -> None:
        """Raise unless the store has every array, in its original shape."""
        sizes, attrs = self.layout.grid.shape, dict(group.attrs)
        try:
            shapes = {PROGRESS: (), f"{PROGRESS}/{HASHES}": _counts(sizes, attrs[CHUNK_SHAPE])} | dict.fromkeys(
                attrs[RESULTS], sizes
            )
            shapes |= {name: values.shape for name, (_, values, _) in self.layout.coords.items()}
        except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
            raise self._torn("the group", error) from None
        for name, shape in shapes.items():
            try:
                there = getattr(group[name], "shape", ())
                if there[: len(shape)] != shape:
                    raise ShapeError(f"expected {shape}, got {there}")
            except Exception as error:  # parts of zarr raise different exceptions for damaged metadata
                raise self._torn(name, error) from None

    def _torn(self, what: str, error: Exception) -> ArgumentError:
        return ArgumentError(
            f"store: {checks.short(str(self.path), paths.PATH)} is of this sweep, but the metadata of {what} is torn "
            f"({type(error).__name__}: {error}); remove it, or give another path"
        )

    def finished(self, chunk: Chunk) -> bool:
        """True if the results of a chunk are there and whole."""
        if self.group is None:
            return False
        try:
            written = int(self.group[f"{PROGRESS}/{HASHES}"][chunk.place])
            return written != 0 and hash_of_chunk(self._read(chunk)) == written
        except Exception:  # each codec raises its own exceptions for a damaged file
            return False

    def _read(self, chunk: Chunk) -> dict[str, Array]:
        return {name: self.group[name][chunk.slices] for name in self.group.attrs[RESULTS]}

    def write(self, chunk: Chunk, results: Results) -> None:
        """Write the results of a chunk, and then its hash."""
        with self._disk():
            if self.group is None:
                self._create(self.layout.arrays(results))
            arrays = along_dims(results, chunk)
            for name, values in arrays.items():
                self.group[name][chunk.slices] = values
            self.group[f"{PROGRESS}/{HASHES}"][chunk.place] = hash_of_chunk(arrays)

    @contextmanager
    def _disk(self) -> Iterator[None]:
        """Name the path in errors of the disk, and remove a store that could not be created."""
        try:
            yield
        except OSError as error:
            state = "there was nothing to keep" if self.group is None else "the chunks that are done are kept"
            raise ArgumentError(
                f"store: {checks.short(str(self.path), paths.PATH)} cannot be written: {error.strerror or error}; {state}: "
                f"make room and call again, or give another path"
            ) from error
        finally:
            if self.group is None:
                shutil.rmtree(self._beside, ignore_errors=True)

    @property
    def _beside(self) -> Path:
        return self.path.with_name(f".{self.path.name}.new")

    def _create(self, arrays: dict[str, Planned]) -> None:
        """Create the store in a folder beside its path and move it there when it is complete."""
        beside = self._beside
        if beside.exists():
            shutil.rmtree(beside)
        group = self._zarr.open_group(beside, mode="w", zarr_format=3)
        attributes = {CHUNK_SHAPE: list(self.chunk_shape), RESULTS: list(arrays), COORDINATES: " ".join(self.layout.coords)}
        group.attrs.update({**self.layout.attrs, **attributes})
        for name, (dims, values, attrs) in self.layout.coords.items():
            array = group.create_array(name, shape=values.shape, dtype=values.dtype, dimension_names=dims, attributes=attrs)
            array[...] = values
        for name, each in arrays.items():
            own = each.shape[len(self.chunk_shape) :]
            group.create_array(
                name,
                shape=each.shape,
                chunks=(*self.chunk_shape, *own),
                dtype=each.dtype,
                fill_value=each.fill,
                dimension_names=each.dims,
                attributes=each.attrs,
            )
        counts = _counts(self.layout.grid.shape, self.chunk_shape)
        progress = group.create_group(PROGRESS)
        progress.create_array(HASHES, shape=counts, chunks=(1,) * len(counts), dtype="uint64", fill_value=0, compressors=None)
        files.put(beside, self.path, "store")
        self.group = self._zarr.open_group(self.path, mode="r+", use_consolidated=False)

    def finish(self) -> Any:
        """The dataset of all results, which are read from the store when they are used."""
        if BITS not in self.group.attrs:
            with self._disk():
                self.group.attrs[BITS] = hash_of_all(self._read(chunk) for chunk in self.layout.grid.chunks(self.chunk_shape))
        return opened(self.path)


def _counts(sizes: Shape, widths: Shape) -> Shape:
    """The number of chunks of that shape along each dimension."""
    return tuple(-(-size // width) for size, width in zip(sizes, widths, strict=True))


class NetCDF(Zarr):
    """A NetCDF file, written when all chunks are finished; until then a Zarr store beside it has the results."""

    def __init__(self, path: Path, layout: Layout, chunk_shape: Shape) -> None:
        self.file = path
        need("h5netcdf")
        need("h5py")
        self.whole = path.exists()
        if self.whole:
            try:
                with need("xarray").open_dataset(path, engine="h5netcdf") as there:
                    sweep = json.loads(there.attrs[SWEEP])
            except Exception as error:  # exceptions of many kinds for a file that is no NetCDF file
                raise ArgumentError(
                    f"store: expected a new path or that of a sweep, got {checks.short(str(path), paths.PATH)}, which is "
                    f"something else ({type(error).__name__}: {error})"
                ) from None
            same_sweep(path, sweep, json.loads(layout.attrs[SWEEP]))
        else:
            _room(path, layout.grid.members * int(8 * LEAST_NUMBERS))
        unfinished = path.with_name(f"{path.name}.unfinished")
        if self.whole and unfinished.exists():  # its removal was interrupted
            shutil.rmtree(unfinished)
        super().__init__(unfinished, layout, chunk_shape)

    def finished(self, chunk: Chunk) -> bool:
        """True if the results of a chunk are there and whole."""
        return self.whole or super().finished(chunk)

    def finish(self) -> Any:
        """The dataset of all results, which are read from the file when they are used."""
        xarray = need("xarray")
        if not self.whole:
            super().finish().close()
            part = self.file.with_name(f".{self.file.name}.new")
            # Chunk after chunk, by Dask, so that it need not fit in memory.
            with opened(self.path, chunks={}) as dataset:
                _room(self.file, dataset.nbytes)  # HDF5 may crash where a file cannot grow
                dataset.drop_encoding().to_netcdf(part, engine="h5netcdf")
            files.put(part, self.file, "store")
        if self.path.exists():
            shutil.rmtree(self.path)
        return xarray.open_dataset(self.file, engine="h5netcdf")


def _room(path: Path, needed: int) -> None:
    """Raise unless the disk of a path has enough free bytes."""
    free = shutil.disk_usage(path.parent).free
    if needed > free:
        raise TooLargeError(
            f"store: {checks.short(str(path), paths.PATH)} needs {needed / 2**20:.3g} MiB, but its disk has "
            f"{free / 2**20:.3g} MiB left; what is done so far is kept beside it: make room and call again, or take a path that "
            f"ends in .zarr"
        )


def opened(path: Path, chunks: Any = None) -> Any:
    """The dataset of a store."""
    dataset = need("xarray").open_zarr(path, consolidated=False, chunks=chunks)
    attrs = {name: value for name, value in dataset.attrs.items() if name not in (CHUNK_SHAPE, RESULTS, COORDINATES)}
    ordered = dataset[dataset.attrs[RESULTS]]
    ordered.attrs = attrs
    return ordered


def _where_different(there: Any, wanted: Any) -> tuple[Any, Any]:
    """Both, or of dictionaries what differs: what is equal would take the place of that."""
    if not (isinstance(there, dict) and isinstance(wanted, dict)):
        return there, wanted
    names = [name for name in {**there, **wanted} if there.get(name) != wanted.get(name)]
    old, new = ({name: each[name] for name in names if name in each} for each in (there, wanted))
    return old, new


def same_sweep(path: Path, there: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Raise if a store has the results of another sweep."""
    names = [name for name in {**there, **wanted} if there.get(name) != wanted.get(name)]
    if names:
        differences = "; ".join(
            "the equations are others: their first steps have other bits"
            if name == "first steps"
            else f"{name}: {checks.short(old, 60)} there, {checks.short(new, 60)} asked for"
            for name in names
            for old, new in [_where_different(there.get(name), wanted.get(name))]
            if name != "first steps" or len(names) == 1
        )
        raise ArgumentError(
            f"store: {checks.short(str(path), paths.PATH)} is of another sweep and is not continued ({differences}); "
            f"give another path"
        )


def store_of(store: Any) -> tuple[type[Zarr], Path] | None:
    """The kind of store and its path, or None for memory."""
    if store is None:
        return None
    if isinstance(store, (str, os.PathLike)):
        path = Path(os.fsdecode(store))
        kind = {".zarr": Zarr, ".nc": NetCDF}.get(path.suffix)
        if kind is not None:
            paths.folder("store", path.parent)
            path.parent.mkdir(parents=True, exist_ok=True)
            return kind, path
    raise ArgumentError(f"store: expected a path that ends in .zarr or .nc, got {checks.short(store, paths.PATH)}")
