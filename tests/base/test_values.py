"""Public objects are what they hold: equal by value, the same after a copy or a pickle, and they say what they are."""

import copy
import pickle
import re
import warnings
from collections.abc import Callable
from functools import cache, partial
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base import reprs
from stepwell.base.immutable import ValueEquality, same
from stepwell.base.reprs import counted, first_of, in_words, of_member, share
from stepwell.views import charts
from support import ROOT
from support.cases import SYSTEMS
from support.for_each import for_each
from support.refusals import refused

FREE = sw.Oscillator(omega=2.0)
BODIES = sw.NBody([3.0, 4.0, 5.0], force="newton", softening=0.1)
STATE: dict[str, Any] = {"v": 0.0, "y": np.array([[1.0, 3.0], [-2.0, -1.0], [1.0, -1.0]]), "dt": 0.01}


def quiet(make: Callable[[], Any]) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return make()


def diverged() -> sw.Run:
    y = np.stack([STATE["y"], np.zeros((3, 2))], axis=-1)  # the second member's bodies meet
    return quiet(
        lambda: sw.integrate(BODIES.__class__([3.0, 4.0, 5.0]), "verlet", **STATE | {"y": y}, steps=5, every=2, record="energy")
    )


@cache
def point() -> charts.WorkPrecision:
    return charts.work_precision("oscillator", ["false_euler"], [100])


def passage(t: Any, v: Any, y: Any) -> Any:
    return y


def exactly(scene: sw.Scene, times: Any, setting: float) -> charts.Solved:
    """A peer that knows the solution."""
    assert scene.exact is not None
    return charts.Solved(*scene.exact(times), 1, 1e-3)


def beside(*peers: Any) -> charts.WorkPrecision:
    """A chart of some peers alone: the one method is refused."""
    return charts.work_precision("forced_oscillator", ["verlet"], [4], tolerances=[], peers=peers)


def each(make: Callable[..., Any], *options: dict[str, Any] | Any) -> list[Callable[[], Any]]:
    """A call for each of these options, or for each of these first arguments."""
    return [partial(make, **one) if isinstance(one, dict) else partial(make, one) for one in options]


run_of = partial(sw.integrate, FREE, "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
paced = partial(sw.integrate, FREE, "merson", v=0.0, y=[1.0, 2.0], at=[1.0])
DAMPED = sw.Oscillator(damping=0.1)
FINER: tuple[dict[str, Any], ...] = {"tolerance": 1e-3}, {"tolerance": 1e-4}

#: How to make one of each, and others of the class that differ in one thing.
MAKERS: dict[str, list[Callable[[], Any]]] = {
    "NBody": [
        lambda: BODIES,
        *each(
            lambda control: quiet(lambda: sw.integrate(BODIES, "rk4", **STATE, steps=1, control=control)).system,
            sw.Projection(),
            sw.EnergyControl(0.1),
        ),
    ],
    "any system": [lambda make=make: make(np.random.default_rng(1), 2) for make in SYSTEMS.values()],
    "Floor": each(
        sw.Floor,
        {},
        {"restitution": 0.5},
        {"friction": 0.1},
        {"normal": (1.0, 1.0)},
        {"offset": 1.0},
        {"way": "spring", "omega": 1.0},
    ),
    "Sphere": each(partial(sw.Sphere, radius=1.0), (0.0, 0.0), (0.0, 1.0), {"centre": (0.0, 0.0), "inside": True}),
    "Sinusoid": each(partial(sw.Sinusoid, 1.0, 2.0), {}, 0.5),
    "Sampled": [partial(sw.Sampled, *each) for each in (([1.0], 0.1), ([1.0], 0.2), ([2.0], 0.1))],
    "LengthControl": each(sw.LengthControl, 0.5, [0.1, 0.5]),
    "NormControl": each(sw.NormControl, 0.5, [0.1, 0.5]),
    "EnergyControl": each(
        sw.EnergyControl, 0.1, {"relative": 0.1}, {"gain": 0.1, "form": "printed"}, {"gain": 0.1, "target": 1.0}
    ),
    "Control": [lambda: sw.Control("energy", 0.1), lambda: sw.Control("norm", [0.1, 0.2], "printed", target=1.0)],
    "Projection": each(sw.Projection, {}, "norm", "nacozy", {"target": [1.0, 2.0]}),
    "Event": [
        partial(sw.Event, quiet),
        *each(partial(sw.Event, passage), {}, {"direction": 1}, {"terminal": True}, {"most": 10}, {"name": "zero"}),
    ],
    "Occurrences": each(
        lambda **ask: run_of(events=passage, **ask).events["passage"],
        {"steps": 30},
        {"steps": 40},
        {"steps": 30, "y": [1.0, 2.0]},
    ),
    "Run": [*each(run_of, {"steps": 30, "events": passage}, {}, {"every": 1}, {"force": 0.0}), *each(paced, *FINER), diverged],
    "Device": each(partial(sw.Device, "opencl:0", "a GPU", "a driver", 1 << 30, 64), {}, {"float32": "it rounds otherwise"}),
    "Paces": each(lambda **ask: paced(**ask).paces, *FINER),
    "DiscreteSystem": [partial(sw.discretise, sw.Oscillator(), *each) for each in ((0.1,), (0.2,), (0.1, "rk4"))],
    "AdaptiveState": each(lambda **ask: paced(**ask).controller_state, *FINER),
    "Mode": each(lambda method: sw.stability_limit(FREE, method).mode, "false_euler", "rk4"),
    "At": each(lambda method: sw.criteria([method])[0].at[0], "rk4", "false_euler"),
    "Explanation": [
        *each(partial(sw.explain, FREE), "rk4", "verlet", {"method": "merson", "attempt": True}),
        *each(partial(sw.explain, FREE, "rk4"), {"members": 9}, {"fused": True}),
        lambda: sw.explain(sw.Chain(1000), "rk4"),
    ],
    "Explorer": [
        *each(partial(sw.explore, "oscillator"), {"methods": ["rk4"]}, {"methods": ["verlet"]}),
        lambda: sw.explore(["oscillator", "pendulum"], methods=["rk4"]),
    ],
    "ExportedStep": [
        *each(partial(sw.export, FREE, "rk4", "c"), {}, {"name": "another"}, {"fused": True}),
        *(partial(sw.export, FREE, *each) for each in (("rk4", "rust"), ("verlet", "c"))),
    ],
    "Method": each(sw.method, "rk4", "verlet"),
    "Scene": [lambda: sw.Scene(sw.Oscillator(), v=0.0, y=1.0, until=9.0), sw.scenes.kepler, sw.scenes.clover],
    "Status": [lambda: sw.Status.OK, lambda: sw.Status.UNDERFLOW],
    "WorkPrecision's curve": [lambda: point().curves[0]],
    "Peer": [
        *each(partial(charts.Peer, "known", exactly), {}, (0.1,)),
        *each(partial(charts.Peer, "known", exactly, (0.1,)), {"by": "step"}, {"order": 2}),
        *each(partial(charts.Peer, "SciPy"), charts.peers.ByScipy("RK45"), charts.peers.ByScipy("DOP853")),
        lambda: charts.Peer("REBOUND", charts.peers.ByRebound("bs")),
        lambda: charts.Peer("heyoka", charts.peers.ByHeyoka()),
    ],
    "Figures": [*each(partial(charts.figures, ["rk4"]), {}, {"phi": 0.4}), lambda: charts.figures(["verlet"])],
    "Bode": each(partial(charts.bode, DAMPED, ["rk4"], dt=0.1), {}, {"x": "hold"}),
    "MethodResponse": each(lambda method: charts.bode(DAMPED, [method], dt=0.1).curves[0], "rk4", "merson"),
    "Stability": each(charts.stability, ["rk4"], ["verlet"]),
    "StabilityMap": each(charts.stability_map, "rk4", "merson"),
    "NormSweep": each(partial(charts.norm, ["rk4"]), {"gains": [0.1]}, {"gains": [0.2]}),
    "Settled": each(lambda gain: charts.norm(["rk4"], gains=[gain]).lines[0], 0.1, 0.2),
    "VerletFriction": each(charts.verlet_friction, {}, 0.05),
    "Solved": each(lambda length: charts.Solved(np.ones(2), np.ones(length), None, 0.1), 2, 3),
}


@for_each("name, i, make", [(name, i, make) for name, makers in MAKERS.items() for i, make in enumerate(makers)])
def test_a_copy_is_the_same(name: str, i: int, make: Callable[[], Any]) -> None:
    one = make()
    pickled = (pickle.loads(pickle.dumps(one, protocol)) for protocol in (2, pickle.HIGHEST_PROTOCOL))
    for other in (copy.copy(one), copy.deepcopy(one), *pickled):
        assert type(other) is type(one)
        assert other == one
        assert (other != one) is False  # a named tuple has both apart
        assert hash(other) == hash(one)
        assert repr(other) == repr(one)
        assert name != "Run" or getattr(one.system, "kernel", "") != "nbody" or other.collisions == one.collisions != ()
    assert one != 1
    assert one != "one"


@for_each("name", [name for name, makers in MAKERS.items() if len(makers) > 1])
def test_others_are_not(name: str) -> None:
    ones, twos = ([make() for make in MAKERS[name]] for _ in range(2))
    for i, a in enumerate(ones):
        for k, b in enumerate(twos):
            assert (a == b) is (i == k), (i, k)


def test_every_public_class_is_here() -> None:
    """Exceptions are Python's own, a world and a prepared run are no values; advice and stability are elsewhere."""
    public = {name for module in (sw, charts) for name in module.__all__ if isinstance(getattr(module, name), type)}
    elsewhere = {name for name in public if issubclass(getattr(sw, name, int), (Exception, Warning))}
    elsewhere |= {"World", "PreparedRun", "System"}
    parts = {"Curve", "Held", "Locus", "Observation", "Panel", "Peer", "Point", "Samples", "Timing", "WorkPrecision"}
    parts |= {"ControlSweep"}
    elsewhere |= {name for name in public if issubclass(getattr(sw, name, int), sw.System)}  # each is among the cases
    assert public - elsewhere - parts - {"RunPicture"} <= set(MAKERS)
    for name in parts | {"RunPicture"}:
        assert issubclass(getattr(charts, name), ValueEquality)


def test_a_method_is_one_of_its_kind() -> None:
    for method in sw.methods():
        assert pickle.loads(pickle.dumps(method)) is copy.deepcopy(method) is copy.copy(method) is method


def test_a_chart_of_a_scene_without_a_formula_can_be_pickled() -> None:
    """Its reference solution is an interpolation, which only this kind of chart holds."""
    chart = charts.work_precision("energy_control", ["false_euler"], [400])
    for again in (pickle.loads(pickle.dumps(chart)), copy.deepcopy(chart)):
        assert again == chart
        t = np.linspace(0.0, 0.9 * chart.scene.horizon, 7)
        for block, other in zip(chart.scene.exact(t), again.scene.exact(t), strict=True):
            np.testing.assert_array_equal(block, other)


def test_a_run_under_a_bar_can_be_pickled() -> None:
    """The bar is gone by then, and what finds collisions must not hold it."""
    pytest.importorskip("rich")
    run = sw.integrate(BODIES, "rk4", **STATE, steps=5, progress=True)
    assert pickle.loads(pickle.dumps(run)) == run


def test_a_chart_with_peers_goes_through_a_pickle() -> None:
    """Its peers are functions and objects that are found again by name, and solve as before."""
    chart = beside(exactly, charts.Peer("in steps", exactly, (0.1,), by="step"))
    again = pickle.loads(pickle.dumps(chart))
    assert again == chart
    assert [curve.method.name for curve in again.curves] == ["exactly", "in steps"]
    assert again.curves[0].method.solve is exactly


def test_a_chart_with_a_peer_that_has_no_name_says_why_it_does_not() -> None:
    chart = beside(lambda scene, times, setting: exactly(scene, times, setting))
    assert copy.deepcopy(chart) == chart
    refused(pickle.PicklingError, "peer '<lambda>': pickle finds a function again by its name in a module", pickle.dumps, chart)


def test_a_peer_of_scipy_goes_through_a_pickle() -> None:
    pytest.importorskip("scipy")
    one = charts.peers.scipy("RK45", (1e-4,))
    two = pickle.loads(pickle.dumps(one))
    assert two == one
    scene = sw.scenes.oscillator()
    a, b = (each.solve(scene, np.array([1.0, scene.horizon]), 1e-4) for each in (one, two))
    assert np.array_equal(a.y, b.y)
    assert a.evaluations == b.evaluations


@for_each(
    ("a", "b", "equal"),
    [
        (np.array([1.0, np.nan]), np.array([1.0, np.nan]), True),
        (np.array([1.0]), np.array([1]), False),
        (np.array([1.0]), 1.0, False),
        (np.ones((2, 1)), np.ones(2), False),
        (np.nan, float("nan"), True),
        ({"a": (1, [np.nan])}, {"a": (1, [float("nan")])}, True),
        ({"a": 1}, {"b": 1}, False),
        ([1], (1,), False),
        ((1, 2), (1,), False),
        (np.array(["a"]), np.array(["a"]), True),
    ],
)
def test_same(a: Any, b: Any, equal: bool) -> None:
    assert same(a, b) is same(b, a) is equal


# Every object says in one line what it is, and in a notebook in a table; a terminal is never filled with arrays.
#: The longest line.
MOST = 200


def steps_of(**options: Any) -> sw.Run:
    return sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, **({"dt": 0.1, "steps": 100} | options))


def wide_run() -> sw.Run:
    omega = np.array([1.0, 30.0, 2.0])
    with pytest.warns(sw.DivergenceWarning):
        return sw.integrate(sw.Oscillator(omega), "false_euler", v=0.0, y=1.0, dt=0.1, steps=1000)


OBJECTS: dict[str, Callable[[], Any]] = {
    **{
        name: MAKERS[name][0]
        for name in (
            "At", "Device", "DiscreteSystem", "ExportedStep", "Explanation", "Explorer", "Figures", "Method", "Paces", "Run",
            "Scene", "Stability", "StabilityMap",
        )
    },
    "run with a tolerance": lambda: sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[1.0, 2.0]),
    "run of a batch that diverged": wide_run,
    "analysis": lambda: sw.analyse(sw.Oscillator(), "rk4", dt=0.1),
    "analysis of many": lambda: sw.analyse(sw.Oscillator(np.linspace(1.0, 30.0, 1000)), "rk4", dt=0.1),
    "criteria": sw.criteria,
    "criterion": lambda: sw.criteria(["rk4"])[0],
    "series": lambda: sw.criteria(["rk4"])[0].series,
    "stability limit": lambda: sw.stability_limit(sw.Oscillator(), "rk4"),
    "advice": lambda: sw.advise("oscillator", methods=["leapfrog", "rk4"], cost="evaluations"),
    "row of advice": lambda: sw.advise("oscillator", methods=["leapfrog"], cost="evaluations").best,
    "machine code": lambda: sw.explain(sw.Oscillator(), "rk4").code,
    "run picture": lambda: charts.run_picture(sw.scenes.clover(), sw.scenes.clover().run("rk4", steps=5, every=1)),
    "work precision": lambda: charts.work_precision("oscillator", ["false_euler"], [100], tolerances=[]),
    "jacobian": lambda: sw.jacobian(sw.Pendulum(), v=0.0, y=0.0),
    "equilibria": lambda: sw.equilibria(sw.Pendulum(), near=(0.0, 0.1)),
    "world": lambda: sw.World(sw.Oscillator(np.ones(1000)), "rk4", v=np.zeros(1000), y=np.ones(1000), dt=0.1),
    "own system": sw.system(lambda t, v, y, *, g=9.81: -g),
    "stability function": lambda: sw.stability.function("backward_euler"),
    "lyapunov exponents": lambda: sw.lyapunov(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=20),
    "stability along": lambda: sw.stability_along(steps_of(every=10)),
    "statement": lambda: sw.paper.entries("§5")[0],
    "checked statement": lambda: sw.paper.entries("§5")[0].run(),
}  # fmt: skip


#: Of these a notebook shows no table.
NO_TABLE = ["Paces", "criterion", "series", "row of advice", "machine code", "ExportedStep", "At", "Device", "DiscreteSystem"]
NO_TABLE += ["Explorer", "Stability", "StabilityMap", "Figures", "run picture"]


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
    assert "t = 0 to 10, 1 saved" in repr(steps_of())
    assert "t = 3 to 13, 11 saved" in repr(steps_of(t0=3.0, every=10))
    half = steps_of(steps=40)
    rest = sw.integrate(sw.Oscillator(), "rk4", steps=60, resume=half)
    assert "60 steps of 0.1, t = 4 to 10" in repr(rest)
    assert repr(steps_of(steps=1)).count("1 step of 0.1") == 1


def test_a_run_says_how_it_ended() -> None:
    assert repr(steps_of()).endswith("1 member: finite>")
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
    words = [first_of(some, (4,), size) for some, size in ((1, 1), (1, 9), (2, 9))]
    assert words == ["", ": member 4", "; the first was member 4"]


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
