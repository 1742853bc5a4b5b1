"""Exported steps: the bits of ``integrate`` in C, and what is computed and called. tests/outer has the other languages."""

import math
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference import bits, log, trig
from stepwell.source.exports import lane_writer, lanes, written
from stepwell.source.exports.functions import FUNCTIONS, argument
from stepwell.source.exports.head import STEPS
from stepwell.source.exports.tapes import MAX_SHORT
from support.abroad import Journey, missing, run, same
from support.export import (
    LANGUAGES,
    ON_BITS,
    SETS,
    Knot,
    assert_same,
    exported,
    mutants,
    net,
    oddly_named,
    shown,
    single,
    singles,
    with_lanes,
)

EVERY = dict.fromkeys(("with choices", "of bits", "long steps", "with lanes"), 4)
EVERY |= {"of all methods and systems": 9, "pushed": 7, "fused": 7}


@pytest.mark.skipif(missing("c"), reason="there is no C compiler here")
@pytest.mark.filterwarnings(
    "ignore::stepwell.DivergenceWarning", "ignore::stepwell.ControlWarning", "ignore::stepwell.AccuracyWarning"
)
def test_every_bit_in_c_is_that_of_integrate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    every: list[Journey] = []
    sources: list[str] = []
    for name, make in SETS.items():
        journeys = make("c", EVERY.get(name, 3))
        sources += exported(name, journeys, "c", len(sources))
        every += journeys
        if name == "of bits":
            assert [each for each in ON_BITS if not any(f"{each}(" in source for source in sources)] == []
    assert len(every) > 30
    assert {f(x) for each in every for x in each.expected for f in (math.isnan, math.isinf)} == {False, True}
    assert_same(every, run("c", every, tmp_path, sources))
    step = sw.export(sw.Chain(20), "verlet", "c", dt=0.01, y=np.ones(20))
    assert shown(step, tmp_path) == sw.integrate(sw.Chain(20), "verlet", v=0.0, y=np.ones(20), dt=0.01, steps=STEPS).y[-1, 0]
    odd = oddly_named(monkeypatch)[::3]
    assert_same(odd, run("c", odd, tmp_path))
    assert re.search(r"\bwhile_\b[^$]*\bdt_\b", sw.export(odd[0].system, "rk4", "c").source)


@pytest.mark.filterwarnings(
    "ignore::stepwell.DivergenceWarning", "ignore::stepwell.ControlWarning", "ignore::stepwell.AccuracyWarning"
)
def test_the_steps_that_are_exported_have_something_of_everything() -> None:
    """Those in float32: NaN and the smallest numbers, and never the bits of float64."""
    every = singles()
    # All are numbers of float32 but what controls added up, which is told in float64; and those of float64 are others.
    assert all(float(np.float32(x)) == x or x != x for each in every for x in each.expected[: None if not each.works else -1])
    wide = [Journey(e.system, e.method, e.v, e.y, 30, options=e.options | {"dtype": "float64"}) for e in every[:10]]
    assert not any(a.expected == b.expected for a, b in zip(every, wide, strict=False))
    assert any(math.isnan(x) for each in every for x in each.expected)
    assert any(0.0 < abs(x) < 2.0**-126 for each in every for x in each.expected)


@pytest.mark.mutant
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_a_step_that_rounds_less_is_noticed(tmp_path: Path) -> None:
    """The same text with numbers of float64 in their place is another step."""
    each = single(sw.Pendulum(1.1), "rk4")
    source = each.export("python", "step_0").source
    assert_same([each], run("python", [each], tmp_path, [source]))
    wrong = source.replace("numpy.float32", "numpy.float64").replace("uint32", "uint64")
    assert each.expected != run("python", [each], tmp_path, [wrong])[0]


BALL: dict[str, Any] = {"v": [[0.5, 0.0]], "y": [[0.0, 1.0]], "dt": 1 / 60, "name": "ball"}


def step_of(source: str) -> str:
    """The step in the text of an export in C."""
    return source[source.index("\nvoid ball_step(") :].partition("\n}\n")[0]


@pytest.mark.parametrize("surface", [sw.Floor(restitution=0.8), sw.Floor(friction=0.3), sw.Sphere((0.0, -1.0), 1.0)])
def test_a_contact_is_computed_where_a_point_meets_the_surface(surface: Any) -> None:
    """In flight a step divides by nothing and takes no root; of a sphere it asks how far it is, and where the way would enter."""
    is_sphere = isinstance(surface, sw.Sphere)
    for method in ("leapfrog", "rk4", "false_euler"):
        step = step_of(sw.export(sw.Particles(floor=surface), method, "c", **BALL).source)
        always = [line for line in step.splitlines() if re.match(r" {4}\S", line) and not line.lstrip().startswith("//")]
        assert sum(" / " in line for line in always) == is_sphere, method
        assert sum("sqrt" in line for line in always) == 2 * is_sphere, method
        assert step.count("sqrt") >= 1  # in a branch
        assert "    if (" in step
        assert "bits" not in sw.export(sw.Particles(floor=surface), method, "javascript", **BALL).source  # BigInts are slow


def executed_lines(space: dict[str, Any], steps: int) -> list[int]:
    """How many lines of Python each step runs."""
    m = space["Ball"]()
    s, counts = m.start([0.5, 0.0], [0.0, 1.0]), []

    def trace(frame: Any, event: str, _: Any) -> Any:
        counts[-1] += event == "line" and frame.f_code.co_name == "step"
        return trace

    for _ in range(steps):
        counts.append(0)
        sys.settrace(trace)
        try:
            m.step(s)
        finally:
            sys.settrace(None)
    return counts


def test_a_ball_in_flight_costs_little_more_than_without_a_floor() -> None:
    """Beside its own lines the distance from the floor, whether it is met, and what v and y are if not."""
    free: dict[str, Any] = {}
    floored: dict[str, Any] = {}
    exec(sw.export(sw.Particles(), "leapfrog", "python", **BALL).source, free)
    exec(sw.export(sw.Particles(floor=sw.Floor()), "leapfrog", "python", **BALL).source, floored)
    (alone,) = set(executed_lines(free, 60))
    counts = executed_lines(floored, 60)
    assert min(counts) <= alone + 12
    assert counts.count(min(counts)) > 50  # the ball falls for 0.45 s, and then again for twice that
    assert max(counts) > 2 * alone


def test_a_force_may_be_another_in_every_step() -> None:
    """As that of World, whose array is read before each step."""
    ball = sw.Particles(gravity=9.81, floor=sw.Floor(restitution=0.5))
    space: dict[str, Any] = {}
    exec(sw.export(ball, "leapfrog", "python", v=[[0.0, 0.0]], y=[[0.0, 1.0]], dt=0.05, force=True, name="ball").source, space)
    v, y, force = np.zeros((1, 2)), np.array([[0.0, 1.0]]), np.zeros((1, 2))
    world = sw.World(ball, "leapfrog", v=v, y=y, dt=0.05, force=force)
    m = space["Ball"]()
    s = m.start([0.0, 0.0], [0.0, 1.0], [1.0, 2.0])  # as World starts: by the force of the first step
    for k in range(60):
        force[...] = [[math.cos(k), 2.0 + 0.1 * k]]
        world.step()
        m.step(s, force.ravel().tolist())
        assert (s.y, m.finish(s, force.ravel().tolist())) == (y.ravel().tolist(), v.ravel().tolist()), k


def test_functions_are_called_by_name() -> None:
    for language in LANGUAGES:
        source = sw.export(Knot(1.1), "standard_euler", language, name="knot").source
        for function in FUNCTIONS:
            # Where it is and where it is called.
            assert len(re.findall(rf"\b(?:knot_|_)?{function}\(", source)) == 2, (language, function)
    plain = sw.export(sw.Oscillator(), "rk4", "c").source
    assert "turn_sign" not in plain
    assert not any(function in plain for function in FUNCTIONS)
    assert "sine" not in sw.export(sw.Pendulum(), "rk4", "c", fused=True).source  # its products went into other sums


def test_what_only_looks_like_a_function_is_none() -> None:
    tape = _core.Tape()
    x = 0.5 * tape.state(0)
    turn = x * trig.PER_HALF_TURN + bits.DOUBLE.magic
    n = turn - bits.DOUBLE.magic
    with pytest.MonkeyPatch.context() as patch:
        of_double = trig.CONSTANTS.double._replace(pi=trig.CONSTANTS.double.pi[:1])
        patch.setattr(trig, "CONSTANTS", trig.CONSTANTS._replace(double=of_double))
        rough = trig.sin(x)  # a sine whose argument is reduced by the first part of π alone
    other = trig._half_turn(x, n, x * trig.PER_HALF_TURN)  # one whose sign is turned by another
    right = (trig.sin(x), "sine"), (trig.cos(x), "cosine"), (log.log(x), "logarithm")
    for symbol, function in (*right, (rough, None), (other, None)):
        listed, (root,) = tape.operations([symbol])
        operations = [(name, tuple(of), constant) for name, of, constant in listed]
        for each in FUNCTIONS:
            of = argument(each, operations, root)
            if each == function:
                assert of is not None
                assert operations[of][0] == "multiply"
            else:
                assert of is None


#: Without a softening, or of two bodies, some sums add a zero.
BODIES = Journey(
    sw.NBody([1.0, 2.0, 3.0], softening=0.3), "standard_heun", np.full((3, 2), 0.1), np.arange(6.0).reshape(3, 2) ** 2, 9
)


def test_each_operation_counts(tmp_path: Path) -> None:
    """Changed, it changes the bits: nothing in a step is without effect, and nothing escapes the comparison."""
    for each in (
        Journey(sw.Oscillator(1.3), "rk4", 0.5, 1.0, steps=3),
        Journey(sw.Oscillator(1.3, 0.1, x=sw.Sinusoid(1.0, 2.0, 0.1)), "semi_false_heun", 0.5, 1.0, steps=40),
        Journey(sw.Pendulum(1.3), "merson", 4.0, 5.5, steps=90),
        BODIES,
    ):
        source = each.export("python", "step_0").source
        changed = mutants(source, "def sine(x)" if "def sine(x)" in source else "def step(self, s)", "# The state after the step")
        assert len(changed) > 15
        assert_same([each], run("python", [each], tmp_path))
        unnoticed = []
        for mutant in changed:
            (numbers,) = run("python", [each], tmp_path, [mutant])
            if all(map(same, numbers, each.expected)):
                unnoticed.append(mutant)
        assert not unnoticed


def not_own(self: Any, lines: Any) -> bool:
    return len(self._to.get(lines[0], ())) == 1 and all(len(self._to.get(line, ())) == 1 for line in lines)


def too_early(self: Any, i: int, lines: Any) -> int:
    self._taken = []
    return space(self, i, lines)


def lying(n: int) -> tuple[sw.Springs, Any]:
    """A net just above a floor that is inclined."""
    return net(n, floor=sw.Floor(restitution=0.3, friction=0.2, normal=(0.0, 0.6, 0.8), offset=-0.05))


space = lane_writer.LaneWriter._space
MISTAKES = [
    (lanes, "COMMUTATIVE", ("add", "multiply", "subtract")),
    *((lane_writer.LaneWriter, name, mistake) for name, mistake in (("_is_direct", not_own), ("_space", too_early))),
]


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("of", "name", "mistake"), MISTAKES, ids=["differences turned round", "results too early", "places used twice"]
)
def test_a_mistake_in_lanes_is_noticed(of: Any, name: str, mistake: object, tmp_path: Path, monkeypatch: Any) -> None:
    """In Python, which compiles nothing: another value in some step."""
    monkeypatch.setattr(written, "MAX_SHORT", 100)
    every = [with_lanes()[i] for i in (1, 5, 9)]
    assert_same(every, run("python", every, tmp_path))
    monkeypatch.setattr(of, name, mistake)
    with pytest.raises(AssertionError):
        assert_same(every, run("python", every, tmp_path))


def test_a_text_grows_with_its_tables_alone() -> None:
    """Lines of the step of a net on a floor: as many for four times as many springs; so long a step is written as loops."""

    def lines_of(n: int) -> list[str]:
        springs, at = lying(n)
        step = sw.export(springs, "false_euler", "c", v=0.0 * at, y=at, name="net")
        assert step.operations > MAX_SHORT
        return step.source[step.source.index("void net_step(") :].splitlines()

    few, many = lines_of(6), lines_of(12)
    assert len(many) == len(few) < 200
    assert any("if (" in line for line in few)  # the contact is computed where a particle meets the floor


@pytest.mark.long
def test_a_cloth_of_many_springs_is_exported() -> None:
    """1600 springs and a floor: a hundred thousand operations, in a text that has some numbers for each spring."""
    springs, at = lying(24)
    step = sw.export(springs, "false_euler", "javascript", v=0.0 * at, y=at, name="net")
    assert step.operations > 100_000
    assert len(step.source) < 200 * len(springs.pairs)


def test_what_is_not_alike_is_written_out() -> None:
    """Equations that are all different have no loops, also where they are long."""

    rng = np.random.default_rng(5)
    of = [np.add, np.subtract, np.multiply, np.maximum]
    chosen = [
        [(of[k], other) for k, other in zip(rng.integers(4, size=60), rng.integers(60, size=60), strict=True)] for _ in range(60)
    ]

    @sw.system(shape=(60,))
    def unlike(t: Any, v: Any, y: Any) -> Any:
        rates = []
        for i, each in enumerate(chosen):
            x = y[i]
            for k, (operation, other) in enumerate(each):
                x = operation(x, y[other] if k % 2 else v[other])
            rates.append(x)
        return np.stack(rates)

    step = sw.export(unlike(), "false_euler", "c")
    assert step.operations > MAX_SHORT
    assert "for (" not in step.source[step.source.index("_step(const") :]
