"""What a terminal shows beyond a pipe: colours, whole words, one table that fits, the answer first, and how long it takes."""

import io
import re
import sys
import time
from typing import Any

import pytest
import stepwell as sw
from stepwell.base import progress
from stepwell.errors import DTypeError
from stepwell.views import cli
from stepwell.views.cli.table import length, lines_of


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def on_a_terminal(monkeypatch: pytest.MonkeyPatch, *words: str, **environment: str) -> list[str]:
    """The lines that a command prints on a terminal of 80 columns."""
    terminal = Terminal()
    with monkeypatch.context() as patch:
        for name, value in ({"COLUMNS": "80", "TERM": "xterm"} | environment).items():
            patch.setenv(name, value)
        patch.setattr(sys, "stdout", terminal)
        assert cli.main(list(words)) == 0
    return terminal.getvalue().splitlines()


ADVISE = ("advise", "oscillator", "--cost", "evaluations", "--methods", "rk4,leapfrog,pefrl", "--frame", "0.5")


def test_colours_are_for_headings_answers_and_the_best_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    lines = on_a_terminal(monkeypatch, *ADVISE)
    assert lines[0].startswith("\033[1;32mUse ")
    assert lines[0].endswith("\033[0m")
    best = lines[0].removeprefix("\033[1;32mUse ").split()[0]
    row = next(i for i, line in enumerate(lines) if "─" in line) + 1
    assert lines[row].startswith(f"\033[1;32m{best} ")
    assert lines[row - 2].startswith("\033[1m")
    assert not lines[row + 1].startswith("\033")
    verdicts = {"rk4": "1;32", "standard_euler": "1;31"}
    for method, code in verdicts.items():
        (line,) = [each for each in on_a_terminal(monkeypatch, "run", "oscillator", "--method", method) if "verdict" in each]
        assert f"\033[{code}m" in line


def test_colours_can_be_turned_off_and_a_pipe_has_none(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert "\033" in "".join(on_a_terminal(monkeypatch, *ADVISE))
    assert "\033" not in "".join(on_a_terminal(monkeypatch, *ADVISE, NO_COLOR="1"))
    assert "\033" not in "".join(on_a_terminal(monkeypatch, *ADVISE, TERM="dumb"))
    assert cli.main(list(ADVISE)) == 0
    assert "\033" not in capsys.readouterr().out


#: Commands, and texts of them that broke inside words.
WRAPPED = {
    ("methods", "verlet"): "velocity",
    ("run", "kepler", "--method", "rk4"): "-0.16965978",
    ("explore", "-o", "page.html", "--only", "--scene", "clover"): "sliders beside dt",
    ("paper", "7"): "oscillation",
    ("explain", "oscillator", "rk4"): "registers",
}


def test_lines_break_between_words_and_a_table_fits_as_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    monkeypatch.chdir(tmp_path)
    for words, text in WRAPPED.items():
        lines = on_a_terminal(monkeypatch, *words, NO_COLOR="1")
        assert max(map(length, lines)) <= 80, words
        assert text in " ".join(lines), words
    few = ("standard_euler", "dop853", "semi_false_heun")
    tables = [("scenes",), ("methods",), *((command, *few) for command in ("criteria", "stability", "figures"))]
    for words in (*tables, ADVISE, ("bench", "--methods", "rk4,verlet")):
        lines = on_a_terminal(monkeypatch, *words, NO_COLOR="1")
        assert max(map(length, lines)) <= 80, words
        assert sum(line.startswith("──") for line in lines) == 1, words


def test_columns_are_left_out_in_their_order_and_named() -> None:
    columns, rows = ("name", "a>", "b>", "c>"), [("x", "1" * 20, "2" * 20, "3" * 20)]
    whole = lines_of("t", columns, rows, least=("b", "c"))
    assert "Left out" not in "".join(whole)
    narrow = lines_of("t", columns, rows, least=("b", "c"), width=55)
    assert "2" * 20 not in "".join(narrow)
    assert "3" * 20 in "".join(narrow)
    assert "Left out, as the terminal is narrow: b; a pipe and --json have" in " ".join(narrow)


def test_progress_says_how_long_the_rest_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    shares: list[float] = []
    advice = sw.advise("oscillator", 0.5, 1e-3, methods=["rk4", "leapfrog", "merson"], progress=shares.append)
    assert advice.ranked
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < 0.2
    assert shares[-1] == 1.0
    assert len(set(shares)) > 6
    with pytest.raises(DTypeError, match=re.escape("progress: expected a function or None, got 1 (int)")):
        sw.advise("oscillator", progress=1)  # type: ignore[arg-type]
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    left = progress._time_left()
    assert left(0.5) == "", "too early to say"
    now[0] = 10.0
    assert (left(0.01), left(0.25), left(0.02), left(1.0)) == ("", "30 s left", "8 min left", "")
