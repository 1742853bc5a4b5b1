"""Every object says in one line what it is, and in a notebook in a table; a terminal is never filled with arrays."""

from __future__ import annotations

import re
from collections.abc import Callable
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base import reprs
from stepwell.views import charts
from support.cases import SYSTEMS
from support.for_each import for_each

#: The longest line.
MOST = 200


def run_of(**options: Any) -> sw.Run:
    return sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, **({"dt": 0.1, "steps": 100} | options))


def wide_run() -> sw.Run:
    omega = np.array([1.0, 30.0, 2.0])
    with pytest.warns(sw.DivergenceWarning):
        return sw.integrate(sw.Oscillator(omega), "false_euler", v=0.0, y=1.0, dt=0.1, steps=1000)


#: What users get from the package, by name.
OBJECTS: dict[str, Callable[[], Any]] = {
    "run": run_of,
    "run with a tolerance": lambda: sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0, 2.0]),
    "run of a batch that diverged": wide_run,
    "paces": lambda: sw.integrate(sw.Oscillator(np.ones(1000)), "merson", v=0.0, y=1.0, tolerance=1e-3, at=[1.0]).paces,
    "method": lambda: sw.method("rk4"),
    "analysis": lambda: sw.analyse(sw.Oscillator(), "rk4", dt=0.1),
    "analysis of many": lambda: sw.analyse(sw.Oscillator(np.linspace(1.0, 30.0, 1000)), "rk4", dt=0.1),
    "criteria": sw.criteria,
    "criterion": lambda: sw.criteria(["rk4"])[0],
    "series": lambda: sw.criteria(["rk4"])[0].series,
    "stability limit": lambda: sw.stability_limit(sw.Oscillator(), "rk4"),
    "advice": lambda: sw.advise("oscillator", methods=["leapfrog", "rk4"], cost="evaluations"),
    "row of advice": lambda: sw.advise("oscillator", methods=["leapfrog"], cost="evaluations").best,
    "explanation": lambda: sw.explain(sw.NBody(), "rk4"),
    "machine code": lambda: sw.explain(sw.Oscillator(), "rk4").code,
    "exported step": lambda: sw.export(sw.Oscillator(), "rk4", "c"),
    "scene": sw.scenes.plummer,
    "chart of stability": lambda: charts.stability(["rk4", "leapfrog"]),
    "map of stability": lambda: charts.stability_map("rk4", size=8),
    "figures": lambda: charts.figures(["rk4"]),
    "run picture": lambda: charts.run_picture(sw.scenes.clover(), sw.scenes.clover().run("rk4", steps=5, every=1)),
    "work precision": lambda: charts.work_precision("oscillator", ["false_euler"], [100], tolerances=[]),
    "jacobian": lambda: sw.jacobian(sw.Pendulum(), v=0.0, y=0.0),
    "equilibria": lambda: sw.equilibria(sw.Pendulum(), near=(0.0, 0.1)),
    "world": lambda: sw.World(sw.Oscillator(np.ones(1000)), "rk4", v=np.zeros(1000), y=np.ones(1000), dt=0.1),
    "own system": lambda: own(),
    "stability function": lambda: sw.stability.function("backward_euler"),
    "lyapunov exponents": lambda: sw.lyapunov(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=20),
    "stability along": lambda: sw.stability_along(run_of(every=10)),
    "statement": lambda: sw.paper.entries("§5")[0],
    "checked statement": lambda: sw.paper.entries("§5")[0].run(),
}


def own() -> sw.System:
    @sw.system
    def falls(t: Any, v: Any, y: Any, g: Any = 9.81) -> Any:
        return -g

    return falls()


#: Of these a notebook shows no table.
NO_TABLE = ["paces", "criterion", "series", "row of advice", "machine code", "exported step"]
NO_TABLE += ["chart of stability", "map of stability", "figures", "run picture"]


@for_each("name", OBJECTS)
def test_a_repr_is_one_line_and_a_notebook_shows_a_table(name: str) -> None:
    thing = OBJECTS[name]()
    text = repr(thing)
    assert "\n" not in text
    assert 5 < len(text) <= MOST
    assert "(s)" not in text
    assert not re.search(r"0x[0-9a-f]{6,}", text), "an address says nothing"
    assert "array([" not in text
    if name not in NO_TABLE:
        assert_a_table(thing._repr_html_())


@for_each("name", SYSTEMS)
def test_a_system_says_itself_in_one_line_and_a_table(name: str) -> None:
    system = SYSTEMS[name](np.random.default_rng(1), 3)
    assert "\n" not in repr(system)
    assert len(repr(system)) <= 2 * MOST
    assert_a_table(system._repr_html_(), type(system).__name__, str(system.v_shape))


def test_a_net_counts_its_springs_and_particles() -> None:
    assert repr(sw.Springs([(0, 1)], rest=1.0, fixed=[0])) == "Springs(1 spring, 2 particles, fixed=1 particle)"
    assert repr(sw.Springs([(0, 1), (1, 2)], rest=1.0)) == "Springs(2 springs, 3 particles)"


class Tags(HTMLParser):
    """Every tag that is opened is closed, in order, and nothing but text and tables is in it."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.cells = 0

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.open.append(tag)
        self.seen.add(tag)
        self.cells += tag == "td"

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def assert_a_table(html: str, *texts: str) -> None:
    tags = Tags()
    tags.feed(html)
    assert tags.open == []
    assert tags.seen <= {"div", "p", "b", "table", "thead", "tbody", "tr", "th", "td"}
    assert tags.cells >= 4
    assert "np.float64" not in html
    assert "array([" not in html
    for each in texts:
        assert each in html


def test_what_a_user_wrote_is_no_html() -> None:
    html = reprs.table("<script>", ["a>", "b"], [["<b>", "&"]], ["1 < 2"])
    assert "<script>" not in html
    assert "&lt;b&gt;" in html
    assert 'style="text-align:right">a<' in html
    long = reprs.table("t", ["a"], [[str(i)] for i in range(100)])
    assert "and 70 more" in long


def test_a_run_says_when_it_began() -> None:
    """Not when the first saved state is, which is the last one where only that is saved."""
    assert "t = 0 to 10, 1 saved" in repr(run_of())
    assert "t = 3 to 13, 11 saved" in repr(run_of(t0=3.0, every=10))
    half = run_of(steps=40)
    rest = sw.integrate(sw.Oscillator(), "rk4", steps=60, resume=half)
    assert "60 steps of 0.1, t = 4 to 10" in repr(rest)
    assert repr(run_of(steps=1)).count("1 step of 0.1") == 1


def test_a_run_says_how_it_ended() -> None:
    assert repr(run_of()).endswith("1 member: finite>")
    bad = wide_run()
    assert repr(bad).endswith("3 members: 1 of 3 diverged at step 369 (t = 36.9)>")
    with pytest.warns(sw.ToleranceWarning):
        short = sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[100.0], max_steps=5)
    assert "stopped early" in repr(short)


def test_dir_lists_what_is_public_and_nothing_else() -> None:
    assert dir(sw) == sorted(sw.__all__)
    for name in dir(sw):
        assert getattr(sw, name) is not None
        assert not name.startswith("_") or name == "__version__"
