"""Exported steps: the bits of ``integrate`` in every language, and files that compile without a warning."""

from __future__ import annotations

import math
import re
import subprocess
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
from stepwell.reference.tape.fused import Evaluated
from stepwell.reference.traced import Tracer
from stepwell.source.exports.functions import FUNCTIONS, argument
from stepwell.source.exports.head import STEPS
from stepwell.source.exports.names import camel, plain, prefix, snake
from support.abroad import C_FLAGS, PATIENCE, RUST_FLAGS, Journey, executed, missing, run, same
from support.cases import SYSTEMS, fits, number
from support.export import LANGUAGES, MEMBER, assert_same, journey, journeys, languages, shown
from support.tracing import CONTROLS, METHODS

WRONG: Any = "yes"


def controlled(language: str) -> list[Journey]:
    """Every control, with some methods."""
    pairs = [(control, name) for control in CONTROLS for name in ("three bodies", "two bodies", "three bodies in space, newton")]
    able = [method for method in METHODS if not method.needs_acceleration and method.name != "dop853"]
    made = []
    for i, (control, name) in enumerate(pairs):
        method = able[(i + number(language)) % len(able)]
        made.append(journey(name, method, control=CONTROLS[control]))
    return made


def diverging() -> list[Journey]:
    """To infinities and NaN: what explodes, and two bodies at one place."""
    made = [Journey(sw.Oscillator(50.0), "rk4", 0.0, 1.0, steps=300)]
    made += [Journey(sw.NBody([1.0, 1.0]), name, np.zeros((2, 2)), np.zeros((2, 2)), steps=3) for name in ("rk4", "verlet")]
    made.append(Journey(sw.Pendulum(), "standard_euler", 1e300, 1.0, steps=1, dt=1e9))
    made.append(Journey(sw.Oscillator(1e160), "false_euler", 0.0, 1.0, steps=9, dt=1.0))
    return made


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
        every = [*journeys(language), *controlled(language), *diverging(), *changed()]
    assert {each.method for each in every} == {method.name for method in METHODS}
    assert len({repr(each.system) for each in every}) > 40
    assert any(math.isnan(x) for each in every for x in each.expected)
    assert any(math.isinf(x) for each in every for x in each.expected)
    assert_same(every, run(language, every, tmp_path))


@languages
def test_every_bit_of_fused_steps(language: str, tmp_path: Path) -> None:
    if language == "javascript":
        with pytest.raises(sw.errors.UnsupportedError, match="fused: JavaScript has no fused multiply-add"):
            sw.export(sw.Oscillator(), "rk4", language, fused=True)
        return
    names = ["damped", "sinusoids x and a, damped", "sampled x and a, physical", "pendulum, damped", "Arenstorf's moon"]
    names += ["three bodies, newton", "linear, masses", "chain of one"]
    every = []
    for i, method in enumerate(METHODS):
        name = next(each for each in names[i % 8 :] + names if fits(SYSTEMS[each](np.random.default_rng(1), 1), method))
        every += [replace(journey(name, method, start, fused=True), steps=20) for start in method.starts or (None,)]
    every.append(replace(journey("two bodies", sw.method("rk4"), control=CONTROLS["limited"], fused=True), steps=20))
    plain = [Journey(e.system, e.method, e.v, e.y, 20, member=MEMBER, options=e.options | {"fused": False}) for e in every]
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


@languages
def test_every_bit_of_choices_within_choices(language: str, tmp_path: Path) -> None:
    every = [Journey(random_rates(seed), "rk4", 0.3, 0.7, steps=20) for seed in range(60 if language == "python" else 12)]
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
            given = {"force": force} | ({"start": start} if start else {})
            with_it, without = (
                Journey(system, method.name, v, y, 9, member=0, options=given | {"force": f * force}) for f in (1, 0)
            )
            assert with_it.expected != without.expected
            every.append(with_it)
    for name in ("leapfrog", "rk4"):
        given = {"force": np.array([[0.25, -0.5]]), "dtype": "float32"}
        every.append(Journey(sw.Particles(floor=sw.Floor()), name, np.zeros((1, 2)), np.ones((1, 2)), 9, options=given))
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
    given: dict[str, Any] = {"v": [[0.25, 0.5]], "y": [[1.0, 2.0]], "dt": 1 / 60, "force": [[0.5, 9.0]]}
    for method in ("leapfrog", "rk4"):
        run = sw.integrate(sw.Particles(), method, steps=STEPS, **given)
        step = sw.export(sw.Particles(), method, language, name=f"push_{method}", **given)
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
    made = []
    for seed in range(20):
        v, y = np.random.default_rng(seed).normal(size=2).tolist()
        each = Journey(Masks(1.1), "rk4", v, y, steps=1, twin=sw.Pendulum(1.1))
        tape = _core.Tape()
        tracer = Tracer(each.system, tape)
        symbols = tracer.step(sw.method("rk4"))
        values = Evaluated.traced(tape, symbols, dict(enumerate(tracer.numbers)), [], fuse=False)([v, y], each.t0, each.dt)
        each.expected = [float(x) for x in values]
        made.append(each)
    return made


def test_functions_are_called_by_name() -> None:
    for language in LANGUAGES:
        source = sw.export(Knot(1.1), "standard_euler", language, name="knot").source
        for function in FUNCTIONS:
            assert len(re.findall(rf"\b(?:knot_)?{function}\(", source)) == 2, (
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
    y = x * trig.PER_HALF_TURN + trig.MAGIC
    n = y - trig.MAGIC
    rough = trig._half_turn(x - n * trig.PI[0], y)  # a sine whose argument is reduced by the first part of π alone
    other = trig._half_turn((x - n * trig.PI[0]) - n * trig.PI[1], x * trig.PER_HALF_TURN)  # one whose sign is turned by another
    for made, function in (
        (trig.sin(x), "sine"),
        (trig.cos(x), "cosine"),
        (log.log(x), "logarithm"),
        (rough, None),
        (other, None),
    ):
        told, (root,) = tape.operations([made])
        operations = [(name, tuple(of), given) for name, of, given in told]
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
        # Compilers take their time; and operations on bits have no series.
        if not method.needs_acceleration and not method.has_series and method.evaluations < 9:
            v, y = np.random.default_rng(i).normal(size=2).tolist()
            every.append(Journey(Knot(1.1), method.name, v, y, steps=40, options={"backend": "numpy"}))
    for each in every:
        each.options = {}
    monkeypatch.setattr("stepwell.reference.tape.fused.fused", lambda tape, roots: (list(tape), list(roots)))
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
        "shift_up",
        "shift_down",
        "turn_sign",
    ):
        assert any(re.search(rf"\w*{helper}\(", source) for source in sources), helper
    assert_same(every, run(language, every, tmp_path, sources))


# ---- the head of a file


@languages
def test_the_example_at_the_head_runs(language: str, tmp_path: Path) -> None:
    given = {"v": 0.25, "y": -0.5, "dt": 1 / 60}
    run = sw.integrate(sw.Pendulum(2.0, a=sw.Sinusoid(1.0, 3.0)), "rk4", steps=STEPS, **given)
    step = sw.export(sw.Pendulum(2.0, a=sw.Sinusoid(1.0, 3.0)), "rk4", language, **given)
    assert shown(step, tmp_path) == run.y[-1]
    chain = sw.Chain(20)
    run = sw.integrate(chain, "verlet", v=0.0, y=np.arange(1.0, 21.0), dt=0.01, steps=STEPS)
    assert shown(sw.export(chain, "verlet", language), tmp_path) == run.y[-1, 0]
    velocities = sw.LinearSystem([[-1.0, 2.0], [0.5, -3.0]], velocities=2)
    run = sw.integrate(velocities, "merson", v=[3.0, 4.0], y=[], dt=0.01, steps=STEPS)
    assert shown(sw.export(velocities, "merson", language, v=[3.0, 4.0]), tmp_path) == run.v[-1, 0]


def test_the_head_says_what_it_is() -> None:
    source = sw.export(sw.NBody([1.0, 2.0], dim=3), "rk4", "c").source
    head = source.partition("\n\n#include")[0]
    for said in (
        "n_body_rk4: one step by Runge-Kutta 4.",
        "System:  NBody(masses=",
        "Runge-Kutta 4 (rk4), order 4, 4 rate evaluations per step",
        "undamped oscillators for omega*dt < 2.828427125",
        f"stepwell {sw.__version__}",
        "cc -O2 -ffp-contract=off",
        "number i, j of the block of shape (2, 3) at y[3*i + j]",
    ):
        assert said in head
    assert "no undamped oscillator" in sw.export(sw.Oscillator(), "standard_euler", "c").source
    assert "(..., fused=True)" in sw.export(sw.Oscillator(), "rk4", "rust", fused=True).source


def test_it_reads_as_explain_does() -> None:
    """Names, order and what is made before the steps are those of the listing."""
    source = sw.export(sw.Oscillator(), "false_euler", "c").source
    assert "    m->phi = m->dt * m->omega;\n" in source
    assert (
        "    const double next_v = v - m->phi * y;\n    const double dy1 = m->phi * next_v;\n    const double next_y = y + dy1;\n"
        in source
    )
    heun = sw.export(sw.Oscillator(), "standard_heun", "rust").source
    assert "        let a1 = self.phi * y; // -dv1\n        let dy1 = self.phi * v;\n" in heun


def test_what_a_page_needs_is_not_asked_for() -> None:
    """A module for browsers: nothing of Node, and no assignment to what is not declared, which modules refuse."""
    source = sw.export(sw.Oscillator(x=sw.Sampled([1.0, 2.0], 1.0)), "rk4", "javascript").source
    code = re.sub(r"//.*", "", source)
    assert not re.search(r"\b(import|require|process|Buffer|globalThis|module)\b", code)
    assert code.count("export ") == 1


# ---- what must fail


SIGN = re.compile(r"(?<=[\w)\]]) ([-+*/]) (?=[\w(])")


def mutants(source: str, begin: str, end: str) -> list[str]:
    """The same file with one operation of the step changed, for each operation."""
    start = source.index(begin)
    stop = source.index(end, start)
    made = []
    for found in SIGN.finditer(source, start, stop):
        line = source[source.rindex("\n", 0, found.start()) : found.start()]
        if "//" in line or "#" in line:
            continue  # in a comment
        other = {"+": "-", "-": "+", "*": "+", "/": "*"}[found[1]]
        made.append(source[: found.start(1)] + other + source[found.end(1) :])
    return made


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
        made = mutants(source, "def sine(x)" if "def sine(x)" in source else "def step(self, s)", "# The state after the step")
        assert len(made) > 15
        assert_same([each], run("python", [each], tmp_path))
        unnoticed = []
        for mutant in made:
            (found,) = run("python", [each], tmp_path, [mutant])
            if all(map(same, found, each.expected)):
                unnoticed.append(mutant)
        assert not unnoticed


@pytest.mark.mutant
@languages
def test_a_wrong_operation_is_noticed_in_every_language(language: str, tmp_path: Path) -> None:
    each = Journey(sw.Pendulum(1.3), "merson", 4.0, 5.5, steps=90)
    source = each.export(language, "step_0").source
    begin = {"c": "double step_0_sine(", "javascript": "function sine(", "python": "def sine(", "rust": "fn sine("}[language]
    made = mutants(source, begin, "The state after the step")[:: 20 if language in ("c", "rust") else 7]
    assert len(made) > 3
    for mutant in made:
        (found,) = run(language, [each], tmp_path, [mutant])
        assert not all(map(same, found, each.expected))


#: Options that compute other numbers, and what the file says of them.
OTHER_NUMBERS = {
    "-ffast-math": "compile without -ffast-math",
    "-Ofast": "compile without -ffast-math, -Ofast",
    "-funsafe-math-optimizations": "compile without -fassociative-math and -funsafe-math-optimizations",
    "-fassociative-math -fno-signed-zeros -fno-trapping-math": "compile without -fassociative-math",
    "-freciprocal-math": "compile without -freciprocal-math",
    "-fno-signed-zeros": "compile without -fno-signed-zeros",
    "-ffinite-math-only": "compile without -ffinite-math-only",
    "-fsingle-precision-constant": "needs_no_fsingle_precision_constant",
    "-mfpmath=387": "compile with -msse2 -mfpmath=sse",
    "-mfpmath=sse,387": "compile with -msse2 -mfpmath=sse",
}


def compiled(folder: Path, *flags: str) -> str:
    """What the compiler complains of in ``step.c``; "unknown" if it has no such option."""
    command = ["cc", *flags, "-S", "step.c", "-o", "step.s"]
    told = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE).stderr
    return "unknown" if re.search(r"(unrecognized|unknown|unsupported) .*|bad value|not valid for", told) else told


@pytest.mark.skipif(missing("c"), reason="there is no C compiler here")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_flags_that_make_other_numbers_are_refused_by_name(dtype: str, tmp_path: Path) -> None:
    sw.export(sw.Oscillator(), "rk4", "c", name="step", dtype=dtype).save(tmp_path / "step.c")  # type: ignore[arg-type]
    assert not compiled(tmp_path)
    for flags, said in OTHER_NUMBERS.items():
        assert (told := compiled(tmp_path, *flags.split())) == "unknown" or said in told, flags


@pytest.mark.skipif(missing("c"), reason="there is no C compiler here")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_every_way_of_evaluation_that_keeps_the_precision_is_taken(dtype: str, tmp_path: Path) -> None:
    """FLT_EVAL_METHOD of C23: N widens what is narrower than _FloatN, to it; GCC says 16 where a CPU has _Float16."""
    source = sw.export(sw.Oscillator(), "rk4", "c", name="step", dtype=dtype).source  # type: ignore[arg-type]
    (tmp_path / "step.c").write_text(source, encoding="utf-8")
    assert compiled(tmp_path, "-march=sapphirerapids") in ("", "unknown")
    for method, taken in ((-1, ()), (0, ("float64", "float32")), (1, ("float64",)), (2, ()), (16, ("float64", "float32"))):
        own = source.replace(
            "#include <string.h>", f"#include <string.h>\n#undef FLT_EVAL_METHOD\n#define FLT_EVAL_METHOD {method}"
        )
        (tmp_path / "step.c").write_text(own, encoding="utf-8")
        assert ("compile with -msse2" not in compiled(tmp_path)) == (dtype in taken), method


@pytest.mark.skipif(missing("c"), reason="there is no C compiler here")
def test_no_product_is_fused_whatever_the_flags_say(tmp_path: Path) -> None:
    """Compilers fuse products and sums by default where a CPU can; what stands behind the file is fused as the flags say."""
    source = sw.export(sw.Oscillator(1.0, 0.1, form="physical"), "rk4", "c", name="step").source
    (tmp_path / "step.c").write_text(source + "double fused(double x) { return x * x + 1.0; }\n", encoding="utf-8")
    for contract in ([], ["-ffp-contract=fast"]):
        if compiled(tmp_path, "-O2", "-mfma", *contract) == "unknown":
            pytest.skip("this CPU has no such instruction")
        step, user = (tmp_path / "step.s").read_text(encoding="utf-8").split("\nfused:")
        assert "vmulsd" in step
        assert "vfm" not in step
        assert "vfm" in user


def test_python_without_a_fused_multiply_add_says_so() -> None:
    source = sw.export(sw.Oscillator(), "rk4", "python", fused=True).source
    if hasattr(math, "fma"):
        exec(source, {})
        return
    with pytest.raises(ImportError, match=r"oscillator_rk4 needs Python 3\.13, which has a fused multiply-add"):
        exec(source, {})


def test_what_is_no_parameter_is_refused_in_python() -> None:
    space: dict[str, Any] = {}
    exec(sw.export(sw.Oscillator(), "rk4", "python").source, space)
    kind = space["OscillatorRk4"]
    with pytest.raises(TypeError, match="there is no parameter gain"):
        kind(gain=1.0)
    with pytest.raises(TypeError, match="there is no parameter step"):
        kind(step=1.0)
    with pytest.raises(ValueError, match="velocities: expected 1 number, got 2"):
        kind().start([0.0, 0.0], [1.0])


@pytest.mark.skipif(missing("javascript"), reason="there is no Node here")
def test_what_is_no_parameter_is_refused_in_javascript(tmp_path: Path) -> None:
    sw.export(sw.Oscillator(), "rk4", "javascript").save(tmp_path / "step.mjs")
    code = 'import { OscillatorRk4 } from "./step.mjs";\n'
    code += "const tell = (f) => { try { f(); } catch (e) { console.log(e.message); } };\n"
    code += "tell(() => new OscillatorRk4({ gain: 1 }));\ntell(() => new OscillatorRk4({ step: 1 }));\n"
    code += "tell(() => new OscillatorRk4().start([0, 0], [1]));\n"
    (tmp_path / "wrong.mjs").write_text(code, encoding="utf-8")
    said = ["there is no parameter gain", "there is no parameter step", "velocities: expected 1 number, got 2"]
    assert executed(["node", "wrong.mjs"], tmp_path).splitlines() == said


# ---- names


def test_names_that_languages_take() -> None:
    assert [plain(name) for name in ("v'[0,1]", "Φ", "x[1].amplitude", "a.omega", "y2[1]", "größe", "2x", "λ")] == [
        "next_v_0_1",
        "phi",
        "x1_amplitude",
        "a_omega",
        "y2_1",
        "groe",
        "x2x",
        "lambda",
    ]
    assert [snake(name) for name in ("NBody", "LinearSystem", "Chain")] == ["n_body", "linear_system", "chain"]
    assert camel("n_body_rk4") == "NBodyRk4"


@pytest.mark.parametrize(
    "name", ["while", "class", "double", "let", "fn", "lambda", "main", "Self", "math", "MATH", "string", "None"]
)
def test_reserved_words_are_no_names(name: str) -> None:
    with pytest.raises(sw.errors.ArgumentError, match=rf"name: '{name}' has a meaning of its own"):
        sw.export(sw.Oscillator(), "rk4", "c", name=name)


@pytest.mark.parametrize("name", ["", "2x", "a b", "a-b", "_a", "ä", "x" * 61, "a;b"])
def test_what_is_no_word_is_no_name(name: str) -> None:
    with pytest.raises(sw.errors.ArgumentError, match="name: expected at most 60 letters of English"):
        prefix(name)


class Reserved(sw.Oscillator):
    """An oscillator whose parameters are called what languages have for something else."""

    def named(self, name: str, index: Any) -> str:
        """Not as a file may call them."""
        return {"omega": "while", "damping": "M_PI", "a": "m", "x": "dt"}.get(name, name)


class Inward(Reserved):
    """Likewise."""

    def named(self, name: str, index: Any) -> str:
        """Not as a file may call them, either."""
        return {"omega": "phi", "damping": "prepare", "a": "λ", "x": "c1"}.get(name, name)


@languages
def test_parameters_may_be_called_anything(language: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stepwell.source.exports import tapes

    def renamed(plan: Any) -> Any:
        numbers, tables = parameters(plan)
        return [plan.system.named(name, ()) for name in numbers], tables

    parameters = tapes.parameters
    monkeypatch.setattr(tapes, "parameters", renamed)
    every = [
        Journey(kind(1.3, 0.2, x=0.5, a=0.25, form="physical"), method, 0.5, 1.0)
        for kind in (Reserved, Inward)
        for method in ("rk4", "false_euler")
    ]
    assert_same(every, run(language, every, tmp_path))
    source = sw.export(every[0].system, "rk4", language).source
    assert re.search(r"\bwhile_\b", source)
    assert re.search(r"\bdt_\b", source)


def test_a_text_in_a_comment_ends_nothing() -> None:
    class Named(sw.Oscillator):
        def __repr__(self) -> str:
            return "Named(*/ \n int x; // \\"

    for language in LANGUAGES:
        source = sw.export(Named(), "rk4", language).source
        assert "\n int x" not in source
        assert "*/" not in source
        assert not any(line.endswith("\\") for line in source.splitlines())


# ---- loops


def net(n: int) -> tuple[sw.Springs, Any]:
    """n by n particles in space, hung from two corners, with springs along the sides and diagonals of its meshes."""
    at = np.array([[i, j, 0.0] for i in range(n) for j in range(n)], float)
    pairs = [(n * i + j, n * (i + a) + j + b) for a, b in ((1, 0), (0, 1), (1, 1)) for i in range(n - a) for j in range(n - b)]
    return sw.Springs(pairs, stiffness=50.0, damping=0.1, gravity=[0.0, 0.0, -9.81], layout=at, fixed=[0, n - 1]), at


@languages
def test_every_bit_of_long_steps(language: str, tmp_path: Path) -> None:
    """Springs, chains, particles that meet surfaces and bodies, with more operations than are written one by one."""
    rng = np.random.default_rng(3)
    springs, at = net(20)
    floors = [sw.Floor(restitution=0.1, friction=0.3), sw.Sphere((0.0, 0.5), 0.4)]
    particles, places = sw.Particles(np.ones(150), floor=floors), rng.normal(size=(150, 2))
    bodies, apart = sw.NBody(np.ones(60), force="newton", softening=0.1), rng.normal(size=(60, 2))
    every = [
        Journey(springs, "false_euler", 0.1 * rng.normal(size=at.shape), at, 5, options={"force": rng.normal(size=at.shape)}),
        Journey(sw.Chain(700), "rk4", rng.normal(size=700), rng.normal(size=700), 5),
        Journey(particles, "false_heun", rng.normal(size=places.shape), places, 9),
        Journey(bodies, "verlet", rng.normal(size=apart.shape), apart, 3, dt=0.01),
        Journey(bodies, "false_euler", 0.0 * apart, apart, 3, dt=0.01, options={"control": sw.EnergyControl(0.3)}),
    ]
    sources = [each.export(language, f"step_{i}") for i, each in enumerate(every)]
    assert all(each.operations > 20_000 for each in sources)
    assert_same(every, run(language, every, tmp_path, [each.source for each in sources]))


@sw.system(shape=(800,))
def many_exponentials(t: Any, v: Any, y: Any) -> Any:
    """ÿ = −eʸ, with operations on bits, for which there are no loops."""
    return -np.exp(y)


# ---- errors


def test_what_cannot_be_exported_says_so(tmp_path: Path) -> None:
    free = sw.Oscillator()
    many = sw.Oscillator([[1.0, 2.0], [3.0, 4.0]])
    for call, error, text in (
        (lambda: sw.export(free, "rk4", "fortran"), sw.errors.UnknownNameError, "language: there is no 'fortran'"),
        (lambda: sw.export(many, "rk4", "c"), sw.errors.ArgumentError, r"member: expected one .* member=\(1, 1\)"),
        (lambda: sw.export(many, "rk4", "c", member=1), sw.errors.ShapeError, "member: expected 2 indices"),
        (
            lambda: sw.export(many, "rk4", "c", member=(0, 2)),
            sw.errors.ArgumentError,
            "member: expected 0 or more, up to 1, got 2",
        ),
        (lambda: sw.export(free, "rk4", "c", member=0), sw.errors.ShapeError, "member: expected 0 indices"),
        (lambda: sw.export(free, "rk4", "c", dt=0.0), sw.errors.ArgumentError, "dt: expected numbers above zero"),
        (lambda: sw.export(free, "rk4", "c", name=3), sw.errors.DTypeError, "name: expected a word, got 3"),
        (lambda: sw.export(free, "rk4", "c", fused=WRONG), sw.errors.DTypeError, "fused: expected True or False"),
        (lambda: sw.export(free, "rk4", "c", start="first_order"), sw.errors.ArgumentError, "start: rk4 starts in one way only"),
        (lambda: sw.export(free, "rk4", "c", control=sw.Projection(target=1.0)), sw.errors.UnsupportedError, "control: "),
        (
            lambda: sw.export(sw.NBody(), "rk4", "c", control=sw.Projection()),
            sw.errors.ArgumentError,
            "control: .* with a target",
        ),
        (
            lambda: sw.export(sw.NBody(), "rk4", "c", control=sw.EnergyControl(relative=0.1, target=1.0)),
            sw.errors.ArgumentError,
            "control: .* with a gain",
        ),
        (lambda: sw.export(sw.Oscillator(1.0, 0.1), "verlet", "c"), sw.errors.UnsupportedError, "verlet needs forces"),
        (
            lambda: sw.export(sw.NBody(np.ones(1000)), "rk4", "c"),
            sw.errors.UnsupportedError,
            r"has about \d+ operations, and at most",
        ),
        (
            lambda: sw.export(many_exponentials(), "rk4", "c"),
            sw.errors.UnsupportedError,
            r"and at most 20000 are written out one by one",
        ),
        (
            lambda: sw.export(sw.Chain(1000), "rk4", "c", fused=True),
            sw.errors.ArgumentError,
            r"fused: a step of about \d+ operations",
        ),
        (
            lambda: sw.export(free, "rk4", "c").save(tmp_path / "step.py"),
            sw.errors.ArgumentError,
            "path: expected a file ending in .c",
        ),
        (
            lambda: sw.export(free, "rk4", "c").save(tmp_path / "no" / "step.c"),
            sw.errors.ArgumentError,
            "path: .* can be written",
        ),
        (lambda: sw.export(free, "rk4", "c").save(3), sw.errors.DTypeError, "path: expected the path of a file"),  # type: ignore[arg-type]
    ):
        with pytest.raises(error, match=text):
            call()


def test_it_can_be_kept(tmp_path: Path) -> None:
    step = sw.export(sw.Oscillator([1.0, 2.0]), "rk4", "javascript", member=1)
    assert str(step) == step.source
    assert step.save(tmp_path / "step.mjs").read_text(encoding="utf-8") == step.source
    assert (step.name, step.language, step.member) == ("oscillator_rk4", "JavaScript", (1,))
    assert "this.omega = 2;" in step.source
    assert repr(step).startswith("<oscillator_rk4 in JavaScript: Runge-Kutta 4, Oscillator(")


# ---- the page

PAGE = Path(__file__).resolve().parent.parent / "docs" / "howto" / "export.md"


@pytest.mark.parametrize("fence", [pytest.param(each, id=each) for each in ("c", "javascript", "rust")])
def test_the_programs_of_the_page_run(fence: str, tmp_path: Path) -> None:
    """All print the number that the page prints in Python."""
    if missing(fence):
        pytest.skip(f"there is no compiler or interpreter of {fence} here")
    text = PAGE.read_text(encoding="utf-8")
    (code,) = re.findall(rf"^```{fence}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    (wanted,) = re.findall(r"print\(s\.y\[0\], .*\)  # → (\S+) True", text)
    ending = {"c": "c", "javascript": "mjs", "rust": "rs"}[fence]
    sw.export(sw.Pendulum(omega=2.0), "leapfrog", fence, dt=1 / 60, name="swing").save(tmp_path / f"swing.{ending}")
    (tmp_path / f"game.{ending}").write_text(code, encoding="utf-8")
    if fence == "c":
        executed(["cc", *C_FLAGS, "game.c", "-lm", "-o", "game"], tmp_path)
    elif fence == "rust":
        executed(["rustc", *RUST_FLAGS, "game.rs", "-o", "game"], tmp_path)
    command = ["node", "game.mjs"] if fence == "javascript" else [tmp_path / "game"]
    assert float(executed(command, tmp_path)) == float(wanted)


def test_how_much_the_page_says_is_written_out() -> None:
    assert 19_000 < sw.export(sw.NBody(np.ones(48)), "false_euler", "c").operations <= 20_000
