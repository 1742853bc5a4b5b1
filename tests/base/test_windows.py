"""What Windows does otherwise; elsewhere by a stand-in. ``make test-windows`` runs this file by an interpreter for Windows."""

import ctypes
import errno
import os
import subprocess
import sys
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base import available_memory, files, paths, streams
from stepwell.errors import ArgumentError
from support.for_each import for_each
from support.refusals import refused

WINDOWS = sys.platform == "win32"


@pytest.fixture
def as_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")


def kernel32(**functions: Any) -> SimpleNamespace:
    """What is asked of the system, with these answers."""
    return SimpleNamespace(kernel32=SimpleNamespace(**functions))


def refuse(*_: Any) -> None:
    raise PermissionError(errno.EACCES, "Access is denied")


def write_text(path: Path) -> None:
    files.write_text(path, "new")


def save(path: Path) -> None:
    sw.integrate(sw.Oscillator(1.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=3).save(path)


@pytest.mark.parametrize(("write", "name"), [(write_text, "a.txt"), (save, "a.npz")])
def test_a_file_that_is_open_is_not_replaced(write: Any, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / name).write_bytes(b"old")
    if not WINDOWS:
        monkeypatch.setattr(os, "replace", refuse)
    with (tmp_path / name).open("rb"), pytest.raises(ArgumentError, match=r"^path: .*a\.\w+' cannot be replaced: .*has it open"):
        write(tmp_path / name)
    assert [(each.name, each.read_bytes()) for each in tmp_path.iterdir()] == [(name, b"old")]


def test_free_memory_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    if WINDOWS:
        free, what = available_memory.available_memory()
        assert what == "memory of this machine"
        assert 2**20 < free < 2**45
        return

    def answer(status: Any) -> int:
        assert status[0] == ctypes.sizeof(status) == 64
        status[2:5:2] = [5 << 30, 3 << 30]
        return 1

    def none(path: str) -> str:
        raise FileNotFoundError(path)

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(available_memory, "_read", none)
    monkeypatch.setitem(sys.modules, "resource", None)
    monkeypatch.setattr(ctypes, "windll", kernel32(GlobalMemoryStatusEx=answer), raising=False)
    assert available_memory.available_memory() == (float(3 << 30), "memory of this machine")
    with pytest.raises(sw.errors.TooLargeError, match="3 GiB"):
        sw.integrate(sw.Oscillator(np.ones(2**20)), "rk4", v=0.0, y=1.0, dt=0.1, steps=10**6, every=1000)


@pytest.mark.usefixtures("as_windows")
@for_each(
    ("name", "why"),
    [
        ("run:2.png", "a name has no colon"),
        ("b/run:2.png", "a name has no colon"),
        ("b" * 256, "a name has at most 255 characters"),
    ],
)
def test_a_name_that_windows_does_not_have_is_refused(name: str, why: str, tmp_path: Path) -> None:
    """With a colon it would write into a hidden part of the file ``run``."""
    refused(ArgumentError, f"{why} on Windows", paths.file, "path", tmp_path / name)
    refused(ArgumentError, f"{why} on Windows", paths.folder, "folder", tmp_path / name)
    assert list(tmp_path.iterdir()) == []
    paths.file("path", tmp_path / "run.png")


def test_what_is_piped_is_utf8() -> None:
    """Though the locale has letters of English only."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")} | {
        "LC_ALL": "C",
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    words = [sys.executable, "-m", "stepwell", "explain", "oscillator", "false_euler"]
    done = subprocess.run(words, capture_output=True, env=env, check=False)
    assert done.returncode == 0, done.stderr
    assert "Φ" in done.stdout.decode("utf-8")
    done = subprocess.run(words, capture_output=True, env=env | {"PYTHONIOENCODING": "utf-16-le"}, check=False)
    assert "Φ" in done.stdout.decode("utf-16-le")  # who asks for something else gets it


def test_an_invalid_argument_is_an_error_but_on_windows() -> None:
    assert streams.reader_is_gone(OSError(errno.EINVAL, "Invalid argument")) == WINDOWS


def test_a_pipe_whose_reader_has_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert streams.reader_is_gone(BrokenPipeError())
    with monkeypatch.context() as there:
        there.setattr(sys, "platform", "win32")
        assert streams.reader_is_gone(OSError(errno.EINVAL, "Invalid argument"))
        assert not streams.reader_is_gone(OSError(errno.EINVAL, "Invalid argument", "a file"))
        assert not streams.reader_is_gone(OSError(errno.ENOSPC, "No space left on device"))
    words = [sys.executable, "-m", "stepwell", "methods"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


class Console(StringIO):
    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return 7


@pytest.mark.skipif(WINDOWS, reason="a stand-in for its console")
@pytest.mark.parametrize(("mode", "obeys", "asked"), [(7, True, False), (3, True, True), (3, False, True), (None, True, False)])
def test_a_console_is_asked_to_obey_escapes(mode: int | None, obeys: bool, asked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    modes: list[int] = []

    def get(handle: Any, into: Any) -> int:
        assert handle.value == 70
        into._obj.value = mode or 0
        return mode is not None

    def put(handle: Any, wanted: int) -> int:
        modes.append(wanted)
        return obeys

    assert not streams.shows_escapes(StringIO())
    assert streams.shows_escapes(Console())
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(ctypes, "windll", kernel32(GetConsoleMode=get, SetConsoleMode=put), raising=False)
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(get_osfhandle=lambda number: 10 * number))
    assert not streams.shows_escapes(StringIO())
    assert streams.shows_escapes(Console()) is (obeys and mode is not None)
    assert modes == ([7] if asked else [])
