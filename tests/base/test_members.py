"""Members in words: how many, which, and without a bracket for the plural."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base.reprs import counted, first_of, in_words, of_member, share
from support import ROOT
from support.for_each import for_each

FAST: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1000}


def test_a_number_and_what_is_counted() -> None:
    assert [counted(number, "step") for number in (0, 1, 2)] == ["0 steps", "1 step", "2 steps"]


def test_a_member_is_named_by_its_place() -> None:
    assert [in_words(index) for index in ((), (3,), (1, 0))] == ["the run", "member 3", "member (1, 0)"]
    assert [of_member(index) for index in ((), (3,))] == ["", " of member 3"]


def test_how_many_of_how_many() -> None:
    assert share(1, (), 1) == "the run"
    assert share(1, (1,), 1) == "the only member"
    assert share(2, (3,), 3) == "2 of 3 members"
    assert [first_of(some, (4,), size) for some, size in ((1, 1), (1, 9), (2, 9))] == [
        "",
        ": member 4",
        "; the first was member 4",
    ]


@for_each(
    ("omega", "words"),
    [
        (30.0, "the run diverged at step 369 (t = 36.9), by false_euler with dt = 0.1"),
        ([30.0], "the only member diverged at step 369 (t = 36.9), by false_euler with dt = 0.1"),
        ([1.0, 30.0], "1 of 2 members diverged: member 1 at step 369 (t = 36.9), by false_euler with dt = 0.1"),
        ([30.0, 1.0, 40.0], "2 of 3 members diverged; the first was member 2 at step "),
    ],
)
def test_a_divergence_in_words(omega: Any, words: str) -> None:
    with pytest.warns(sw.DivergenceWarning, match=f"^{re.escape(words)}"):
        sw.integrate(sw.Oscillator(np.array(omega)), "false_euler", **FAST)


def test_an_early_stop_in_words() -> None:
    arguments: dict[str, Any] = {"v": 0.0, "tolerance": 1e-6, "at": [99.0], "max_steps": 9}
    with pytest.warns(
        sw.ToleranceWarning, match=r"^the run stopped before t = 99, at t = [\d.]+; out of max_steps: 9 attempts, "
    ):
        sw.integrate(sw.Oscillator(), "merson", y=1.0, **arguments)
    with pytest.warns(sw.ToleranceWarning, match=r"^2 of 2 members stopped before t = 99; the first was member [01] at t = "):
        sw.integrate(sw.Oscillator(), "merson", y=[1.0, 2.0], **arguments)


def test_lost_exponents_in_words() -> None:
    @sw.system(order=1)
    def explosive(t: Any, y: Any, *, rate: Any = 1.0) -> Any:
        return rate * y * y

    arguments: dict[str, Any] = {"y": 1.0, "dt": 0.5, "steps": 60}
    with pytest.warns(sw.DivergenceWarning, match="^1 of 2 members left the range of finite numbers; its exponents are NaN$"):
        sw.lyapunov(explosive(rate=[-1.0, 1.0]), "rk4", **arguments)


def test_a_stop_at_an_event_cannot_be_resumed_and_says_how_many() -> None:
    floor = sw.Event(lambda t, v, y: y, terminal=True, name="floor")
    arguments: dict[str, Any] = {"v": 0.0, "dt": 0.1, "steps": 100, "events": floor}
    one = sw.integrate(sw.Oscillator(), "rk4", y=1.0, **arguments)
    with pytest.raises(
        sw.StepwellError, match=r"^resume: the run stopped at an event, at a time of its own; begin a new run from there: v="
    ):
        sw.integrate(one.system, "rk4", resume=one, steps=1)
    two = sw.integrate(sw.Oscillator([1.0, 2.0]), "rk4", y=1.0, **arguments)
    with pytest.raises(
        sw.StepwellError, match=r"^resume: 2 of 2 members stopped at an event, at times of their own; begin a new"
    ):
        sw.integrate(two.system, "rk4", resume=two, steps=1)


def test_no_plural_in_brackets_anywhere() -> None:
    """Neither in messages nor on pages: "1 of 3 member(s)"."""
    word = re.compile(r"\b(member|step|chunk|number|state|value|method|axis|time)\(s\)")
    paths = [*(ROOT / "python").rglob("*.py"), ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    assert len(paths) > 250
    code = re.compile(r"\bm\.step\(s\)|\.(\w+)\(s\)")  # a call in a program that is shown
    lines = [
        f"{path.name}: {line.strip()}"
        for path in paths
        if path.parent.name != "exports"
        for line in path.read_text(encoding="utf-8").splitlines()
        if word.search(code.sub("", line))
    ]
    assert not lines
