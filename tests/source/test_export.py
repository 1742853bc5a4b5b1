"""Exported steps: the bits of ``integrate`` in every language, and files that compile without a warning."""

from __future__ import annotations

import math
import re
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference import bits, log, trig
from stepwell.reference.tape.evaluate import Evaluation
from stepwell.reference.traced import Tracer
from stepwell.source.exports.functions import FUNCTIONS, argument
from stepwell.source.exports.head import STEPS
from support.abroad import Journey, run, same
from support.cases import SYSTEMS, fits, number
from support.export import LANGUAGES, assert_same, journey, journeys, languages, other_journeys, shown
from support.export_float32 import fused_singles, singles
from support.tracing import CONTROLS, METHODS

WRONG: Any = "yes"


def controlled(language: str, implicit: bool = False) -> list[Journey]:
    """Every control, with some methods; with implicit ones, which compilers take longest for, in the long run."""
    pairs = [(control, name) for control in CONTROLS for name in ("three bodies", "two bodies", "three bodies in space, newton")]
    able = [m for m in METHODS if not m.needs_acceleration and m.name != "dop853" and m.is_implicit is implicit]
    journeys = []
    for i, (control, name) in enumerate(pairs):
        method = able[(i + number(language)) % len(able)]
        journeys.append(journey(name, method, control=CONTROLS[control]))
    return journeys


def diverging() -> list[Journey]:
    """To infinities and NaN: what explodes, and two bodies at one place."""
    journeys = [Journey(sw.Oscillator(50.0), "rk4", 0.0, 1.0, steps=300)]
    journeys += [Journey(sw.NBody([1.0, 1.0]), name, np.zeros((2, 2)), np.zeros((2, 2)), steps=3) for name in ("rk4", "verlet")]
    journeys.append(Journey(sw.Pendulum(), "standard_euler", 1e300, 1.0, steps=1, dt=1e9))
    journeys.append(Journey(sw.Oscillator(1e160), "false_euler", 0.0, 1.0, steps=9, dt=1.0))
    return journeys


def changed() -> list[Journey]:
    """Parameters that are changed in the code that was exported."""
    driven = {"a": sw.Sinusoid(1.0, 2.0, 0.3)}
    return [
        Journey(sw.Oscillator(1.0), "rk4", 0.5, 1.0, changed={"omega": 1.7}, twin=sw.Oscillator(1.7)),
        Journey(
            sw.Pendulum(1.0, 0.1, **driven),
            "merson",
            0.5,
            1.0,
            changed={"omega": 1.3, "damping": 0.4, "a_amplitude": 0.3, "a_phase": -1.0},
            twin=sw.Pendulum(1.3, 0.4, a=sw.Sinusoid(0.3, 2.0, -1.0)),
        ),
        Journey(
            sw.Oscillator(1.0, x=sw.Sampled([1.0, 2.0, 3.0], 0.4)),
            "standard_heun",
            0.5,
            1.0,
            changed={"x_start": 0.9, "x_interval": 0.7},
            twin=sw.Oscillator(1.0, x=sw.Sampled([1.0, 2.0, 3.0], 0.7, 0.9)),
        ),
    ]


@languages
def test_every_bit_is_that_of_integrate(language: str, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        warnings.simplefilter("ignore", sw.ControlWarning)
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        every = [*journeys(language), *controlled(language), *diverging(), *changed(), *singles()]
    assert {each.method for each in every} == {method.name for method in METHODS}
    assert len({repr(each.system) for each in every}) > 40
    assert any(math.isnan(x) for each in every for x in each.expected)
    assert any(math.isinf(x) for each in every for x in each.expected)
    assert_same(every, run(language, every, tmp_path))


@pytest.mark.long
@languages
@pytest.mark.filterwarnings("ignore")
def test_every_bit_of_other_pairs(language: str, tmp_path: Path) -> None:
    every = [*other_journeys(language), *controlled(language, implicit=True)]
    assert len(every) > 40
    assert_same(every, run(language, every, tmp_path))


@languages
def test_every_bit_of_fused_steps(language: str, tmp_path: Path) -> None:
    if language in ("csharp", "javascript"):
        with pytest.raises(sw.errors.UnsupportedError, match=r"fused: (C#|JavaScript) has no fused multiply-add"):
            sw.export(sw.Oscillator(), "rk4", language, fused=True)
        return
    names = ["damped", "sinusoids x and a, damped", "sampled x and a, physical", "pendulum, damped", "Arenstorf's moon"]
    names += ["three bodies, newton", "linear, masses", "chain of one"]
    every = []
    for i, method in enumerate(METHODS):
        name = next(each for each in names[i % 8 :] + names if fits(SYSTEMS[each](np.random.default_rng(1), 1), method))
        every += [replace(journey(name, method, start, fused=True), steps=20) for start in method.starts or (None,)]
    every.append(replace(journey("two bodies", sw.method("rk4"), control=CONTROLS["limited"], fused=True), steps=20))
    every += fused_singles() if language != "python" else []
    plain = [replace(each, options=each.options | {"fused": False}) for each in every]
    assert all(a.expected != b.expected for a, b in zip(every, plain, strict=True) if a.single)
    assert sum(a.expected != b.expected for a, b in zip(every, plain, strict=True)) > len(every) // 2
    assert_same(every, run(language, every, tmp_path))


# ---- what is computed only if something holds

BALL: dict[str, Any] = {"v": [[0.5, 0.0]], "y": [[0.0, 1.0]], "dt": 1 / 60, "name": "ball"}


def step_of(source: str) -> str:
    """The step in the text of an export in C."""
    return source[source.index("\nvoid ball_step(") :].partition("\n}\n")[0]


@pytest.mark.parametrize("method", ["leapfrog", "rk4", "false_euler"])
@pytest.mark.parametrize("surface", [sw.Floor(restitution=0.8), sw.Floor(friction=0.3), sw.Sphere((0.0, -1.0), 1.0)])
def test_a_contact_is_computed_where_a_point_meets_the_surface(method: str, surface: Any) -> None:
    """In flight a step divides by nothing and takes no root; of a sphere it asks how far it is, and where the way would enter."""
    step = step_of(sw.export(sw.Particles(floor=surface), method, "c", **BALL).source)
    always = [line for line in step.splitlines() if re.match(r" {4}\S", line) and not line.lstrip().startswith("//")]
    is_sphere = isinstance(surface, sw.Sphere)
    assert sum(" / " in line for line in always) == is_sphere
    assert sum("sqrt" in line for line in always) == 2 * is_sphere
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


def random_rates(seed: int) -> Any:
    """Rates with choices within choices, by conditions of several, that share values."""

    def rates(t: Any, v: Any, y: Any) -> Any:
        rng = np.random.default_rng(seed)
        values, truths = [v, y, v * y, y * 0.5 + 0.25], [v < y, y < 0.3]
        for _ in range(25):
            a, b, c = (values[rng.integers(len(values))] for _ in range(3))
            p, q = (truths[rng.integers(len(truths))] for _ in range(2))
            match rng.integers(8):
                case 0 | 1:
                    values.append(np.sqrt(a * a + b * b + 0.125) / (1.0 + c * c))
                case 2:
                    values.append(np.where(p, a, b))
                case 3:
                    values.append(np.where(p & q, a / (1.0 + b * b), c))
                case 4:
                    values.append(np.where(p | q, np.abs(a), np.sin(b) * c))
                case 5:
                    truths.append(a < b)
                case 6:
                    truths.append(p & ~q)
                case _:
                    truths.append(p | (a <= c))
        return sum(values[-4:]) * 0.25 - y

    return sw.system(rates)()


#: How many random rates are exported; compilers take longest.
CHOICES = {"c": 8, "csharp": 8, "javascript": 12, "python": 24, "rust": 8}


@languages
def test_every_bit_of_choices_within_choices(language: str, tmp_path: Path) -> None:
    every = [Journey(random_rates(seed), "rk4", 0.3, 0.7, steps=20) for seed in range(CHOICES[language])]
    sources = [each.export(language, f"step_{i}").source for i, each in enumerate(every)]
    assert sum(bool(re.search(r"^ +if ", source, re.MULTILINE)) for source in sources) > len(every) // 2
    assert_same(every, run(language, every, tmp_path, sources))


# ---- a force from outside


@languages
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_every_bit_of_steps_with_a_force(language: str, tmp_path: Path) -> None:
    """By every method, of systems with and without surfaces, friction and fixed points, in both precisions."""
    names = ["damped", "pendulum, damped", "particles, a floor", "springs: on a floor", "particles, round a ball", "chain of one"]
    names += ["three bodies"]
    every = []
    for i, method in enumerate(METHODS):
        name = next(each for each in names[i % len(names) :] + names if fits(SYSTEMS[each](np.random.default_rng(1), 1), method))
        system = SYSTEMS[name](np.random.default_rng(i), 1)
        rng = np.random.default_rng(i)
        v, y, force = (0.5 * rng.normal(size=(*shape, 1)) for shape in (system.v_shape, system.y_shape, system.v_shape))
        for start in method.starts or (None,):
            options = {"force": force} | ({"start": start} if start else {})
            with_it, without = (
                Journey(system, method.name, v, y, 9, member=0, options=options | {"force": f * force}) for f in (1, 0)
            )
            assert with_it.expected != without.expected
            every.append(with_it)
    for name in ("leapfrog", "rk4"):
        options = {"force": np.array([[0.25, -0.5]]), "dtype": "float32"}
        every.append(Journey(sw.Particles(floor=sw.Floor()), name, np.zeros((1, 2)), np.ones((1, 2)), 9, options=options))
    assert_same(every, run(language, every, tmp_path))


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


@languages
def test_the_example_with_a_force_runs(language: str, tmp_path: Path) -> None:
    arguments: dict[str, Any] = {"v": [[0.25, 0.5]], "y": [[1.0, 2.0]], "dt": 1 / 60, "force": [[0.5, 9.0]]}
    for method in ("leapfrog", "rk4"):
        run = sw.integrate(sw.Particles(), method, steps=STEPS, **arguments)
        step = sw.export(sw.Particles(), method, language, name=f"push_{method}", **arguments)
        assert shown(step, tmp_path) == run.y[-1, 0, 0]


# ---- what is done with bits


class Tangled:
    """Rates with every operation on bits that NumPy has too; made of the pendulum's parameters."""

    def __init__(self, h: Any, omega: Any, damping: Any, a: Any) -> None:
        self.h, self.omega = h, omega

    def dv(self, t: Any, v: Any, y: Any) -> Any:
        """h·v̇."""
        near, slow = bits.less(y, 0.5), bits.at_most(v, 0.25)
        logarithm = log.log(1.0 + y * y)
        cut = bits.and_bits(v, 0xFFFF_FFFF_0000_0000)
        odd = bits.or_bits(y, 1)
        twice = v * 8388608.0 + 6755399441055744.0  # whose last bit turns two signs
        turned = bits.turn_sign(v, twice) + bits.turn_sign(y, twice) - bits.turn_sign(logarithm, y + v)
        chosen = bits.where(near & slow, cut, bits.where(near | slow, logarithm, odd))
        other = bits.where(~slow, turned, bits.clamp(chosen, -0.25, 0.5))
        mixed = bits.add_bits(bits.where(near, bits.add_bits(v, 3), y), 0xFFFF_FFFF_FFFF_FFFE)
        mixed = bits.sub_bits_from(bits.sub_bits_from(mixed, 0x7FFF_FFFF_FFFF_FFFF), 0x7FFF_FFFF_FFFF_FFFE)
        return -self.h * (chosen + other + mixed + trig.sin(t) * trig.cos(self.omega * v))

    def dy(self, t: Any, v: Any, y: Any) -> Any:
        """h·ẏ."""
        return self.h * v


class Knot(sw.Pendulum):
    """The pendulum's place in the core, and other rates, which only the reference and an export know."""

    reference = Tangled


class Masked(Tangled):
    """Operations that only a tape has: bits as a mask, bits of two unknown numbers together, whole numbers of bits."""

    def dv(self, t: Any, v: Any, y: Any) -> Any:
        """h·v̇."""

        def one(v: Any, y: Any) -> Any:
            mask = (v < y).choose(v.and_bits(0x000F_FFFF_FFFF_FFFF), y.shift_down(11))
            mixed = mask.choose(v, y)
            both = (v & y) | (v < 0.5).choose(y, v)
            floor = (v * 1000.0).floor() - (y * 1000.0).floor()
            is_same = (v.floor()).equals(y.floor())
            shifted = mask.shift_up(3).and_bits(0x000F_FFFF_FFFF_FFFF).or_bits(0x3FF0_0000_0000_0000)
            apart = (v < 0.0).xor_bits(y < 0.0).choose(0.125, 0.25)
            known = ((y < 0.0) & v).and_bits(0x800F_FFFF_FFFF_FFFF).or_bits(0x3FE0_0000_0000_0000)
            return mixed + both + floor * 1e-3 + is_same.choose(1.0, -0.5) + shifted + apart + known

        return -self.h * np.frompyfunc(one, 2, 1)(v, y)


class Masks(sw.Pendulum):
    """Likewise."""

    reference = Masked


def masks() -> list[Journey]:
    """A step each, of which the tape's own evaluation says what comes of it."""
    journeys = []
    for seed in range(20):
        v, y = np.random.default_rng(seed).normal(size=2).tolist()
        each = Journey(Masks(1.1), "rk4", v, y, steps=1, twin=sw.Pendulum(1.1))
        tape = _core.Tape()
        tracer = Tracer(each.system, tape)
        symbols = tracer.step(sw.method("rk4"))
        values = Evaluation(tape, symbols, dict(enumerate(tracer.numbers)))([v, y], each.t0, each.dt)
        each.expected = [float(x) for x in values]
        journeys.append(each)
    return journeys


def test_functions_are_called_by_name() -> None:
    for language in LANGUAGES:
        source = sw.export(Knot(1.1), "standard_euler", language, name="knot").source
        for function in FUNCTIONS:
            assert len(re.findall(rf"\b(?:knot_|_)?{function}\(", source)) == 2, (
                language,
                function,
            )  # where it is and where it is called
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
    for symbol, function in (
        (trig.sin(x), "sine"),
        (trig.cos(x), "cosine"),
        (log.log(x), "logarithm"),
        (rough, None),
        (other, None),
    ):
        listed, (root,) = tape.operations([symbol])
        operations = [(name, tuple(of), constant) for name, of, constant in listed]
        for each in FUNCTIONS:
            of = argument(each, operations, root)
            if each == function:
                assert of is not None
                assert operations[of][0] == "multiply"
            else:
                assert of is None


@languages
def test_bits_of_numbers(language: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    every = []
    for i, method in enumerate(METHODS):
        # Compilers take their time; and operations on bits have no derivatives.
        if not method.needs_acceleration and not method.has_derivatives and method.evaluations < 5:
            v, y = np.random.default_rng(i).normal(size=2).tolist()
            every.append(Journey(Knot(1.1), method.name, v, y, steps=40, options={"backend": "numpy"}))
    for each in every:
        each.options = {}
    monkeypatch.setattr("stepwell.reference.tape.evaluate.fused", lambda tape, roots, **_: (list(tape), list(roots)))
    every += masks()
    assert len({tuple(each.expected) for each in every}) == len(every)
    sources = [each.export(language, f"step_{i}").source for i, each in enumerate(every)]
    for helper in (
        "choose_bits",
        "mask_of",
        "and_bits",
        "or_bits",
        "xor_bits",
        "add_bits",
        "sub_bits",
        "shift_up",
        "shift_down",
        "turn_sign",
    ):
        assert any(re.search(rf"\w*{helper}\(", source) for source in sources), helper
    assert_same(every, run(language, every, tmp_path, sources))


# ---- what must fail


SIGN = re.compile(r"(?<=[\w)\]]) ([-+*/]) (?=[\w(])")


def mutants(source: str, begin: str, end: str) -> list[str]:
    """The same file with one operation of the step changed, for each operation."""
    start = source.index(begin)
    stop = source.index(end, start)
    changed = []
    for sign in SIGN.finditer(source, start, stop):
        line = source[source.rindex("\n", 0, sign.start()) : sign.start()]
        if "//" in line or "#" in line:
            continue  # in a comment
        other = {"+": "-", "-": "+", "*": "+", "/": "*"}[sign[1]]
        changed.append(source[: sign.start(1)] + other + source[sign.end(1) :])
    return changed


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


@pytest.mark.mutant
@languages
def test_a_wrong_operation_is_noticed_in_every_language(language: str, tmp_path: Path) -> None:
    each = Journey(sw.Pendulum(1.3), "merson", 4.0, 5.5, steps=90)
    source = each.export(language, "step_0").source
    begin = {
        "c": "double step_0_sine(",
        "csharp": "double _sine(",
        "javascript": "function sine(",
        "python": "def sine(",
        "rust": "fn sine(",
    }[language]
    changed = mutants(source, begin, "The state after the step")[:: 20 if language in ("c", "csharp", "rust") else 7]
    assert len(changed) > 3
    for mutant in changed:
        (numbers,) = run(language, [each], tmp_path, [mutant])
        assert not all(map(same, numbers, each.expected))
