"""Snapshots: what is compared, written, and noticed as unused."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.snapshots import SNAPSHOTS, Snapshots


def test_a_text_is_compared_with_its_file(tmp_path: Path) -> None:
    Snapshots(tmp_path, update=True)("a.txt", "one\ntwo\n")
    compare = Snapshots(tmp_path, update=False)
    compare("a.txt", "one\ntwo")
    for wrong in ("one\ntwo ", "one", "one\ntwo\n\n", "one\r\ntwo\n"):
        with pytest.raises(pytest.fail.Exception, match="not what the snapshot says"):
            compare("a.txt", wrong)
    with pytest.raises(pytest.fail.Exception, match=r"\+one"):
        compare("b.txt", "one")


def test_a_text_is_written_once(tmp_path: Path) -> None:
    """So two tests that expect different texts by one name are noticed."""
    update = Snapshots(tmp_path, update=True)
    update("folder/a.txt", "one")
    update("folder/a.txt", "one")
    with pytest.raises(pytest.fail.Exception, match="-one"):
        update("folder/a.txt", "two")


def test_what_no_test_compares_is_noticed_and_deleted(tmp_path: Path) -> None:
    Snapshots(tmp_path, update=True)("old.txt", "one")
    assert Snapshots(tmp_path, update=False).unused() == ["old.txt"]
    compare = Snapshots(tmp_path, update=False)
    compare("old.txt", "one")
    assert compare.unused() == []
    assert Snapshots(tmp_path, update=True).unused() == []
    assert list(tmp_path.iterdir()) == []


FILE = "def test_one(snapshot):\n    snapshot('a.txt', 'one')\n\ndef test_two(snapshot):\n    snapshot('b.txt', 'two')\n"


def test_files_fail_with_unused_snapshots_if_all_of_their_tests_were_run(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setattr("support.snapshots.SNAPSHOTS", pytester.path / "snapshots")
    pytester.makepyfile(test_file=FILE)
    run = lambda *options: pytester.runpytest_inprocess("-p", "support.snapshots", *options)  # noqa: E731
    run("--update-snapshots").assert_outcomes(passed=2)
    (pytester.path / "snapshots" / "test_file" / "c.txt").write_text("three")
    run().assert_outcomes(passed=2, errors=1)
    run("-k", "one").assert_outcomes(passed=1, deselected=1)
    run("test_file.py::test_one").assert_outcomes(passed=1)
    run("--update-snapshots").assert_outcomes(passed=2)
    run().assert_outcomes(passed=2)


def test_every_folder_of_snapshots_is_that_of_a_test_file() -> None:
    for folder in SNAPSHOTS.iterdir() if SNAPSHOTS.exists() else []:
        (file,) = SNAPSHOTS.parent.glob(f"*/{folder.name}.py")
        assert "snapshot" in file.read_text(encoding="utf-8"), folder
