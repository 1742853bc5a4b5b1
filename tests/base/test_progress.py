"""The progress of a long run is shown in a terminal, with rich or without, and in a notebook; in a pipe it is not."""

import io
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base import progress
from support.devices import NAMES, needs_device

OPTIONS: dict[str, Any] = {"v": 0.0, "y": np.ones(200), "dt": 0.1, "steps": 3000, "progress": True, "backend": "numpy"}


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def without_rich(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [name for name in sys.modules if name.split(".")[0] == "rich"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "rich", None)
    monkeypatch.setitem(sys.modules, "rich.console", None)


def test_without_rich_a_terminal_shows_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    without_rich(monkeypatch)
    monkeypatch.setattr(progress, "MIN_SECONDS_BETWEEN", 0.0)
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    run = sw.integrate(sw.Oscillator(), "rk4", **OPTIONS)
    lines = terminal.getvalue().split("\r")
    assert "Runge-Kutta 4, 3000 steps" in lines[1]
    shares = [int(line.split()[-2]) for line in lines if line.endswith("%")]
    assert shares[0] == 0
    assert shares == sorted(shares)
    assert shares[-1] > 50
    assert lines[-1] == "\033[K", "the line is removed at the end"
    assert np.array_equal(run.y, sw.integrate(sw.Oscillator(), "rk4", **(OPTIONS | {"progress": False})).y)


def test_without_rich_a_pipe_shows_nothing(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    without_rich(monkeypatch)
    sw.integrate(sw.Oscillator(), "rk4", **OPTIONS)
    assert capsys.readouterr() == ("", "")


class Handle:
    """What ``display`` returns, and all that it showed."""

    def __init__(self) -> None:
        self.shown: list[str] = []

    def update(self, element: str) -> None:
        self.shown.append(element)


def in_a_notebook(monkeypatch: pytest.MonkeyPatch) -> Handle:
    handle = Handle()

    def display(element: str, *, display_id: bool) -> Handle:
        assert display_id
        handle.shown.append(element)
        return handle

    shell = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()))
    monkeypatch.setitem(sys.modules, "IPython", shell)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(HTML=str, display=display))
    return handle


def test_a_notebook_shows_an_element_of_its_page(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    handle = in_a_notebook(monkeypatch)
    monkeypatch.setattr(progress, "MIN_SECONDS_BETWEEN", 0.0)
    sw.integrate(sw.Oscillator(), "rk4", **OPTIONS)
    assert capsys.readouterr() == ("", "")
    assert handle.shown[0] == 'Runge-Kutta 4, 3000 steps <progress value="0.000" max="1"></progress> 0 %'
    values = [float(text.split('"')[1]) for text in handle.shown[:-1]]
    assert values == sorted(values)
    assert values[-1] > 0.5
    assert handle.shown[-1] == "", "it is removed at the end"


def test_a_notebook_is_not_written_anew_for_every_share(monkeypatch: pytest.MonkeyPatch) -> None:
    handle = in_a_notebook(monkeypatch)
    with progress.bar("much") as report:
        for i in range(10_000):
            report(i / 10_000)
    assert len(handle.shown) < 100


def test_ipython_in_a_terminal_is_no_notebook(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not progress.in_notebook()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: SimpleNamespace()))
    assert not progress.in_notebook()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    assert not progress.in_notebook()


def test_what_is_waited_for_stands_beside_the_title(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a notebook, in a line and with rich; and no longer when the work goes on, or the bar is gone."""
    monkeypatch.setattr(progress, "MIN_SECONDS_BETWEEN", 0.0)

    def work() -> None:
        with progress.bar("a run") as report:
            progress.waits_for("compiling")
            progress.waits_for("compiling")
            progress.waits_for("")
            report(0.5)
        progress.waits_for("nothing")

    with monkeypatch.context() as page:
        handle = in_a_notebook(page)
        work()
    titles = [text.split(" <")[0] for text in handle.shown]
    assert titles == ["a run", "a run, compiling", "a run", "a run", ""]
    pytest.importorskip("rich")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    work()
    assert "a run, compiling" in terminal.getvalue()
    assert "nothing" not in terminal.getvalue()
    without_rich(monkeypatch)
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    work()
    assert [line.count("compiling") for line in terminal.getvalue().split("\r")] == [0, 0, 1, 0, 0, 0]


@needs_device
def test_a_kernel_that_is_compiled_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    handle = in_a_notebook(monkeypatch)
    system = sw.Oscillator(np.linspace(1.0, 2.0, 5), drag=0.1)
    for more in ({"dt": 0.1, "steps": 10}, {"tolerance": 1e-3, "at": [1.0]}):
        handle.shown.clear()
        sw.integrate(system, "fehlberg_5", v=0.0, y=1.0, device=NAMES[0], progress=True, **more)
        assert ["compiling for opencl:0" in text for text in handle.shown[:3]] == [False, True, False]
