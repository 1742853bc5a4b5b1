"""Runs in files: ``Run.save`` and ``stepwell.load``."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from .. import _core
from ..base import checks, files, paths
from ..base.optional import imported
from ..errors import ArgumentError, DTypeError, StepwellError
from .parts import Arrays, Reader, Writer, is_whole

if TYPE_CHECKING:
    from ..runs.result import Run

#: Endings of files with a run.
ENDINGS = (".npz", ".zarr")

#: The names of the description of a run in a file, and of the version of the file format.
ABOUT, FORM = "stepwell", "stepwell_form"

#: The version of the file format; only files of this version are read.
VERSION = 1


def save(run: Run, path: str | Path) -> None:
    """Write a run to a file; see ``Run.save``."""
    place = _place(path)
    writer = Writer()
    text = writer.text(run)
    # A new file is written beside the old one and then replaces it, so that an interruption loses nothing.
    beside = place.with_name(f"{place.stem}.{uuid4().hex}{place.suffix}")
    if place.suffix == ".npz":
        paths.file("path", place)
        try:
            with beside.open("xb") as file:
                about = {ABOUT: np.array(text), FORM: np.array([VERSION]), "stepwell_version": np.array(_core.__version__)}
                np.savez(file, **about, **writer.arrays)  # type: ignore[arg-type]  # NumPy's stubs mean one of its options
            files.put(beside, place)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
        return
    zarr = imported("zarr", "save")
    paths.folder("path", place.parent)
    if (replaced := place.exists()) and not _is_ours(zarr, place):
        raise ArgumentError(f"path: expected a new folder, or one with a saved run, got {checks.short(str(path))}")
    try:
        group = zarr.open_group(str(beside), mode="w")
        for name, array in writer.arrays.items():
            # By default zarr omits a chunk of zeros, and then a −0 in it is lost.
            stored = group.create_array(name, shape=array.shape, dtype=array.dtype, config={"write_empty_chunks": True})
            stored[...] = array
        group.attrs.update({ABOUT: text, FORM: VERSION, "stepwell_version": _core.__version__})
        if replaced:
            files.put(place, old := place.with_name(f"{place.stem}.{uuid4().hex}.old"))
        files.put(beside, place)
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise
    if replaced:
        shutil.rmtree(old)


def load(path: str | Path, *, system: Any = None) -> Run:
    """Read a run from a file that ``Run.save`` wrote; it is equal to the saved run, bit for bit, and can be resumed like it.

    No code is read: not even a damaged or malicious file can run any. A run of your own equations needs their function besides
    the file.

    Args:
        path: the file, ending in .npz, or the folder, ending in .zarr.
        system: for a run of your own equations, what ``stepwell.system`` returned for their function; where a parameter is a
            function of time, the system with this parameter. Not needed if an imported module has the function by its name.

    Raises:
        ArgumentError: if there is no such file; if it has no run; if the function is missing, or makes other operations than when
            the run was saved.
        UnsupportedError: if the file ends in .zarr and zarr is not installed.

    Example:
        >>> chain = sw.Chain(10)
        >>> half = sw.integrate(chain, "verlet", v=1.0, y=0.0, dt=0.1, steps=40)
        >>> half.save("half.npz")
        >>> half = sw.load("half.npz")
        >>> rest = sw.integrate(half.system, half.method, resume=half, steps=60)
        >>> whole = sw.integrate(chain, "verlet", v=1.0, y=0.0, dt=0.1, steps=100)
        >>> np.array_equal(rest.y, whole.y)
        True
    """
    place = _place(path)
    arrays, text = _from_npz(place) if place.suffix == ".npz" else _from_zarr(place)
    try:
        run = Reader(arrays, system).run(text)
        is_whole(run)
    except StepwellError:
        raise
    except Exception as error:
        raise ArgumentError(
            f"path: expected a run that stepwell {_core.__version__} can read, got {checks.short(str(path))}, which another "
            f"version wrote or which is damaged ({type(error).__name__}: {error})"
        ) from None
    return run


def _place(path: Any) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise DTypeError(f"path: expected the path of a file, got {checks.short(path)} ({type(path).__name__})")
    place = Path(os.fsdecode(path))
    if place.suffix not in ENDINGS:
        raise ArgumentError(f"path: expected a file ending in {' or '.join(ENDINGS)}, got {checks.short(str(path))}")
    return place


def _no_run(place: Path, why: object) -> ArgumentError:
    return ArgumentError(f"path: expected a run that was saved, got {checks.short(str(place))}: {why}")


def _from_npz(place: Path) -> tuple[Arrays, str]:
    try:
        # Opened here, since NumPy does not close a damaged file that it opened itself.
        with place.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except Exception as error:  # NumPy and zipfile raise exceptions of many kinds for a damaged file
        raise _no_run(place, getattr(error, "strerror", None) or error) from None
    if ABOUT not in arrays or FORM not in arrays:
        raise _no_run(place, "it has arrays, and nothing that tells of a run")
    return arrays, _current(place, arrays[ABOUT].item(), int(arrays[FORM].reshape(-1)[0]))


def _from_zarr(place: Path) -> tuple[Arrays, str]:
    zarr = imported("zarr", "load")
    try:
        group = zarr.open_group(str(place), mode="r")
        arrays = {name: np.asarray(each[...]) for name, each in group.arrays()}
        about = dict(group.attrs)
    except Exception as error:
        raise _no_run(place, error) from None
    if ABOUT not in about or FORM not in about:
        raise _no_run(place, "it has arrays, and nothing that tells of a run")
    return arrays, _current(place, str(about[ABOUT]), int(about[FORM]))


def _current(place: Path, text: str, version: int) -> str:
    if version != VERSION:
        raise _no_run(place, f"its form is version {version}, and this stepwell reads version {VERSION}")
    return text


def _is_ours(zarr: Any, place: Path) -> bool:
    """True if a folder has a run, so that another run may replace it."""
    try:
        return ABOUT in zarr.open_group(str(place), mode="r").attrs
    except Exception:  # anything else is not replaced
        return False
