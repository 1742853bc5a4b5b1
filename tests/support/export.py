"""What tests of export share: sets of steps that go abroad, which every language brings home with the bits of ``integrate``."""

import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.reference import bits, log, trig
from stepwell.reference.tape.evaluate import Evaluation
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from stepwell.source.exports import tapes, written
from stepwell.source.exports.head import EXAMPLE
from stepwell.source.exports.loops import NoLoopError
from stepwell.source.exports.tapes import MAX_OPERATIONS

from support.abroad import C_FLAGS, CSHARP_FLAGS, RUST_FLAGS, Journey, executed, missing, same
from support.cases import SYSTEMS, fits, number
from support.tracing import CONTROLS, METHODS

LANGUAGES = ["c", "csharp", "javascript", "python", "rust"]

#: Of a batch in which parameters differ, one member is exported.
MEMBERS, MEMBER = 3, 1

languages = pytest.mark.parametrize(
    "language",
    [
        pytest.param(each, marks=pytest.mark.skipif(missing(each), reason=f"there is no compiler or interpreter of {each} here"))
        for each in LANGUAGES
    ],
)


def journey(name: str, method: sw.Method, start: str | None = None, control: Any = None, **more: Any) -> Journey:
    """Some steps of a member of a batch, from a random state."""
    rng = np.random.default_rng(number(name, method.name))
    system = SYSTEMS[name](rng, MEMBERS)
    v, y = (0.5 * rng.normal(size=(*shape, MEMBERS)) for shape in (system.v_shape, system.y_shape))
    options = {key: value for key, value in {"start": start, "control": control, **more}.items() if value is not None}
    return Journey(system, method.name, v, y, member=MEMBER, options=options)


#: Systems whose steps are long are tried with the methods whose steps are short; compilers take half a minute for the longest.
LONG = ("eight bodies", "chain of nineteen", "linear, seventeen states")
LONGEST = "thirty-five bodies in space, newton"
SHORT = ("false_euler", "verlet", "leapfrog", "standard_heun")

#: The most operations of an implicit step that is exported, and by default of one of a series: compilers take long for more.
MOST_TO_COMPILE = 1500


def pairs(series: bool = True) -> Iterator[tuple[str, sw.Method, str | None]]:
    """All pairs of a system and a method that fit, with each way to start; or without long steps of ``series``."""
    for name, make in SYSTEMS.items():
        system = make(np.random.default_rng(1), 1)
        for method in METHODS:
            if name != LONGEST and fits(system, method) and (name not in LONG or method.name in SHORT):
                if (method.is_implicit or (method.has_series and not series)) and _core.operations(
                    engine.model(engine.Plan(system, method, (1,), 0.1))
                ) > MOST_TO_COMPILE:
                    continue
                yield from ((name, method, start) for start in method.starts or (None,))


def assert_same(journeys: list[Journey], results: list[list[float]]) -> None:
    """To the bit."""
    assert len(journeys) == len(results)
    for each, numbers in zip(journeys, results, strict=True):
        assert len(numbers) == len(each.expected), (each.system, each.method)
        assert all(map(same, numbers, each.expected)), (each.system, each.method, each.options, numbers, each.expected)


def example(step: sw.ExportedStep) -> str:
    """The program that the head of a file shows."""
    comment = "#" if step.language == "Python" else "//"
    lines = step.source.splitlines()
    begin = lines.index(f"{comment} {EXAMPLE}") + 2
    end = next(i for i, line in enumerate(lines) if not line.startswith(comment))
    shown = [line.removeprefix(comment) for line in lines[begin:end]]
    assert all(not line or line.startswith(" " * 5) for line in shown)
    return "\n".join(line[5:] for line in shown) + "\n"


def printed(step: sw.ExportedStep, program: str, folder: Path) -> float:
    """The number that a program prints which uses the step, run as the head of the file says."""
    ending = {"JavaScript": ".mjs"}.get(step.language, step.endings[0])
    step.save(folder / f"{step.name}{ending}")
    (folder / f"program{ending}").write_text(program, encoding="utf-8")
    compiler, command = {
        "C": (["cc", *C_FLAGS, "program.c", "-lm", "-o", "program"], [folder / "program"]),
        "C#": (["mcs", *CSHARP_FLAGS, "program.cs", f"{step.name}.cs"], ["mono", "program.exe"]),
        "JavaScript": ([], ["node", "program.mjs"]),
        "Rust": (["rustc", *RUST_FLAGS, "program.rs", "-o", "program"], [folder / "program"]),
        "Python": ([], [sys.executable, "program.py"]),
    }[step.language]
    if compiler:
        executed(compiler, folder)
    return float(executed(command, folder))


def shown(step: sw.ExportedStep, folder: Path) -> float:
    """What the example at the head prints."""
    return printed(step, example(step), folder)


# ---- sets of journeys; ``every`` takes every so many-th of each
def of_all_methods_and_systems(language: str, every: int = 1) -> list[Journey]:
    """In as few pairs as there are systems: each language has others."""
    wanted = {name for name in SYSTEMS if name != LONGEST or language == "python"}
    able = sorted(
        (each for each in pairs(series=False) if each[0] in wanted),
        key=lambda each: number(language, each[0], each[1].name, each[2]),
    )
    chosen, seen = [], set[str]()
    # First pairs of a new system and a new method, then what is left of either.
    for news in (2, 1):
        for name, method, start in able:
            if len({name, method.name} - seen) >= news:
                chosen.append((name, method, start))
                seen |= {name, method.name}
    chosen += [(name, sw.method("false_euler"), None) for name in sorted(wanted - seen)]
    return [journey(*each) for each in chosen[::every]]


def other_pairs(language: str) -> list[Journey]:
    """Three in twenty of all pairs, others for each language."""
    return [journey(*each) for each in pairs() if number(language, each[0], each[1].name, each[2]) % 20 < 3]


def controlled(language: str, every: int = 1, implicit: bool = False) -> list[Journey]:
    """Every control, with some methods; with implicit ones, which compilers take longest for, in the long run."""
    cases = [(control, name) for control in CONTROLS for name in ("three bodies", "two bodies", "three bodies in space, newton")]
    able = [m for m in METHODS if not m.needs_acceleration and m.name != "dop853" and m.is_implicit is implicit]
    return [
        journey(name, able[(i + number(language)) % len(able)], control=CONTROLS[control])
        for i, (control, name) in list(enumerate(cases))[::every]
    ]


def diverging(language: str, every: int = 1) -> list[Journey]:
    """To infinities and NaN: what explodes, and two bodies at one place."""
    journeys = [Journey(sw.Oscillator(50.0), "rk4", 0.0, 1.0, steps=300)]
    journeys += [Journey(sw.NBody([1.0, 1.0]), name, np.zeros((2, 2)), np.zeros((2, 2)), steps=3) for name in ("rk4", "verlet")]
    journeys.append(Journey(sw.Pendulum(), "standard_euler", 1e300, 1.0, steps=1, dt=1e9))
    journeys.append(Journey(sw.Oscillator(1e160), "false_euler", 0.0, 1.0, steps=9, dt=1.0))
    return journeys[::every]


def changed(language: str, every: int = 1) -> list[Journey]:
    """Parameters that are changed in the code that was exported."""
    driven, held = sw.Pendulum(1.0, 0.1, a=sw.Sinusoid(1.0, 2.0, 0.3)), sw.Oscillator(x=sw.Sampled([1.0, 2.0, 3.0], 0.4))
    others = sw.Pendulum(1.3, 0.4, a=sw.Sinusoid(0.3, 2.0, -1.0)), sw.Oscillator(x=sw.Sampled([1.0, 2.0, 3.0], 0.7, 0.9))
    of_drive = {"omega": 1.3, "damping": 0.4, "a_amplitude": 0.3, "a_phase": -1.0}
    single: dict[str, Any] = {"dtype": "float32"}
    return [
        Journey(sw.Oscillator(1.0), "rk4", 0.5, 1.0, changed={"omega": 1.7}, twin=sw.Oscillator(1.7)),
        Journey(driven, "merson", 0.5, 1.0, changed=of_drive, twin=others[0]),
        Journey(held, "standard_heun", 0.5, 1.0, changed={"x_start": 0.9, "x_interval": 0.7}, twin=others[1]),
        Journey(driven, "standard_euler", 0.5, 1.0, options=single, changed=of_drive, twin=others[0]),
    ][::every]


BODIES: dict[str, Any] = {"v": np.array([[0.0, 0.5], [0.0, -0.5]]), "y": np.array([[1.0, 0.1], [-1.0, 0.0]])}


@sw.system
def chosen(t: Any, v: Any, y: Any, *, a: Any = 0.3) -> Any:
    """Functions of float32, a choice, and operations on bits."""
    return np.where(y < a, -np.sin(y), np.exp(-a * y) * np.cos(t)) - 0.1 * v * np.abs(v) + np.log(1.0 + y * y)


def single(system: sw.System, method: str, v: Any = 0.3, y: Any = 1.1, steps: int = 30, **options: Any) -> Journey:
    return Journey(system, method, v, y, steps=steps, options={"dtype": "float32", **options})


def singles(language: str = "c", every: int = 1) -> list[Journey]:
    """Every kind of rates and of methods: what carries something, controls, inputs, what diverges."""
    rng = np.random.default_rng(5)
    drive = {"a": sw.Sinusoid(1.0, 2.0, 0.3)}
    masses = sw.LinearSystem([[-0.1, 0.0, -1.0, 0.0], [0.0, -0.2, 0.0, -2.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    journeys = [
        single(sw.Oscillator(1.3, 0.1, **drive, form="physical"), "rk4"),
        single(sw.Pendulum(1.1, 0.2, **drive), "merson"),
        single(sw.Pendulum(1.1), "verlet", start="second_order"),
        single(sw.Oscillator(0.7), "leapfrog"),
        single(sw.Chain(4), "semi_false_heun", rng.normal(size=4), rng.normal(size=4)),
        single(masses, "fehlberg", rng.normal(size=2), rng.normal(size=2)),
        single(sw.NBody([1.0, 2.0], force="newton"), "pefrl", **BODIES),
        single(sw.NBody([1.0, 2.0]), "rk4", **BODIES, control=sw.EnergyControl(0.3)),
        single(sw.NBody([1.0, 2.0]), "false_heun", **BODIES, control=sw.Projection()),
        single(chosen(), "standard_heun"),
        single(sw.Oscillator(50.0), "rk4", 0.0, 1.0, steps=40),
        single(sw.NBody([1.0, 1.0]), "damped_euler", np.zeros((2, 2)), np.zeros((2, 2)), steps=3),
        # The smallest numbers, which have fewer digits.
        single(sw.Pendulum(1.0), "false_euler", 1e-42, 3e-41),
    ]
    return journeys[::every]


def fused(language: str, every: int = 1) -> list[Journey]:
    """By fused multiply-adds, in float32 too, where the language has them."""
    if language in ("csharp", "javascript"):
        return []
    names = ["damped", "sinusoids x and a, damped", "sampled x and a, physical", "pendulum, damped", "Arenstorf's moon"]
    names += ["three bodies, newton", "linear, masses", "chain of one"]
    journeys = []
    for i, method in list(enumerate(METHODS))[::every]:
        name = next(each for each in names[i % 8 :] + names if fits(SYSTEMS[each](np.random.default_rng(1), 1), method))
        journeys += [replace(journey(name, method, start, fused=True), steps=20) for start in method.starts or (None,)]
    journeys.append(replace(journey("two bodies", sw.method("rk4"), control=CONTROLS["limited"], fused=True), steps=20))
    if language != "python":
        journeys += [
            single(sw.Oscillator(1.3, 0.1, form="physical"), "rk4", fused=True),
            single(sw.Pendulum(1.1), "verlet", fused=True),
            single(sw.NBody([1.0, 2.0], force="newton"), "leapfrog", **BODIES, fused=True),
            single(chosen(), "merson", fused=True),
        ]
    plain = [replace(each, options=each.options | {"fused": False}) for each in journeys]
    assert all(a.expected != b.expected for a, b in zip(journeys, plain, strict=True) if a.single)
    assert sum(a.expected != b.expected for a, b in zip(journeys, plain, strict=True)) > len(journeys) // 2
    return journeys


def pushed(language: str, every: int = 1) -> list[Journey]:
    """A force from outside, by every method, on systems with and without surfaces, friction and fixed points."""
    names = ["damped", "pendulum, damped", "particles, a floor", "springs: on a floor", "particles, round a ball", "chain of one"]
    names += ["three bodies"]
    journeys = []
    for i, method in list(enumerate(METHODS))[::every]:
        name = next(each for each in names[i % len(names) :] + names if fits(SYSTEMS[each](np.random.default_rng(1), 1), method))
        rng = np.random.default_rng(i)
        system = SYSTEMS[name](np.random.default_rng(i), 1)
        v, y, force = (0.5 * rng.normal(size=(*shape, 1)) for shape in (system.v_shape, system.y_shape, system.v_shape))
        for start in method.starts or (None,):
            options = {"force": force} | ({"start": start} if start else {})
            with_it, without = (
                Journey(system, method.name, v, y, 9, member=0, options=options | {"force": f * force}) for f in (1, 0)
            )
            assert with_it.expected != without.expected
            journeys.append(with_it)
    for name in ("leapfrog", "rk4"):
        options = {"force": np.array([[0.25, -0.5]]), "dtype": "float32"}
        journeys.append(Journey(sw.Particles(floor=sw.Floor()), name, np.zeros((1, 2)), np.ones((1, 2)), 9, options=options))
    return journeys


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


def with_choices(language: str, every: int = 1) -> list[Journey]:
    """Of random rates; compilers take longest."""
    seeds = range({"javascript": 12, "python": 24}.get(language, 8))[::every]
    journeys = [Journey(random_rates(seed), "rk4", 0.3, 0.7, steps=20) for seed in seeds]
    sources = [each.export("python", "choices").source for each in journeys]
    assert sum(bool(re.search(r"^ +if ", source, re.MULTILINE)) for source in sources) > len(journeys) // 2
    return journeys


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


def of_bits(language: str, every: int = 1) -> list[Journey]:
    """What is done with bits: by ``integrate`` what NumPy has too, and one step each of what the tape's own evaluation says."""
    journeys = []
    # Compilers take their time; and operations on bits have no derivatives.
    able = [m for m in METHODS if not m.needs_acceleration and not m.has_derivatives and m.evaluations < 5]
    for i, method in list(enumerate(able))[::every]:
        v, y = np.random.default_rng(i).normal(size=2).tolist()
        journeys.append(Journey(Knot(1.1), method.name, v, y, steps=40, options={"backend": "numpy"}))
        journeys[-1].options = {}
    for seed in range(20)[::every]:
        v, y = np.random.default_rng(seed).normal(size=2).tolist()
        each = Journey(Masks(1.1), "rk4", v, y, steps=1, twin=sw.Pendulum(1.1))
        tape = _core.Tape()
        tracer = Tracer(each.system, tape)
        symbols = tracer.step(sw.method("rk4"))
        with pytest.MonkeyPatch.context() as patch:  # operation by operation
            patch.setattr("stepwell.reference.tape.evaluate.fused", lambda tape, roots, **_: (list(tape), list(roots)))
            values = Evaluation(tape, symbols, dict(enumerate(tracer.numbers)))([v, y], each.t0, each.dt)
        each.expected = [float(x) for x in values]
        journeys.append(each)
    assert len({tuple(each.expected) for each in journeys}) == len(journeys)
    return journeys


ON_BITS = tuple(f"{each}_bits" for each in ("choose", "and", "or", "xor", "add", "sub"))
ON_BITS += ("mask_of", "shift_up", "shift_down", "turn_sign")


def net(n: int, **others: Any) -> tuple[sw.Springs, Any]:
    """n by n particles in space, hung from two corners, with springs along the sides and diagonals of its meshes."""
    at = np.array([[i, j, 0.0] for i in range(n) for j in range(n)], float)
    pairs = [(n * i + j, n * (i + a) + j + b) for a, b in ((1, 0), (0, 1), (1, 1)) for i in range(n - a) for j in range(n - b)]
    return sw.Springs(
        pairs, stiffness=50.0, gravity=[0.0, 0.0, -9.81], layout=at, fixed=[0, n - 1], **{"damping": 0.1} | others
    ), at


def long_steps(language: str, every: int = 1) -> list[Journey]:
    """Springs, chains, particles that meet surfaces and bodies, with more operations than are written one by one.

    In Python with as many as that takes, in the others with a tenth of them: there loops begin at fewer operations.
    """
    share = 1 if language == "python" else 10
    rng = np.random.default_rng(3)
    springs, at = net(20 if share == 1 else 7)
    floors = [sw.Floor(restitution=0.1, friction=0.3), sw.Sphere((0.0, 0.5), 0.4)]
    particles, places = sw.Particles(np.ones(150 // share), floor=floors), rng.normal(size=(150 // share, 2))
    bodies = sw.NBody(np.ones(60 if share == 1 else 20), force="newton", softening=0.1)
    apart = rng.normal(size=bodies.y_shape)
    masses = 700 // share
    return [
        Journey(springs, "false_euler", 0.1 * rng.normal(size=at.shape), at, 5, options={"force": rng.normal(size=at.shape)}),
        Journey(sw.Chain(masses), "rk4", rng.normal(size=masses), rng.normal(size=masses), 5),
        Journey(particles, "false_heun", rng.normal(size=places.shape), places, 9),
        Journey(bodies, "verlet", rng.normal(size=apart.shape), apart, 3, dt=0.01),
        Journey(bodies, "false_euler", 0.0 * apart, apart, 3, dt=0.01, options={"control": sw.EnergyControl(0.3)}),
    ][::every]


@sw.system(shape=(60,))
def exponentials(t: Any, v: Any, y: Any) -> Any:
    """ÿ = −eʸ + the y before, with operations on bits within a lane."""
    return -np.exp(y) + np.roll(y, 1)


def with_lanes(language: str = "c", every: int = 1) -> list[Journey]:
    """Nets, ropes, particles, bodies and equations of one's own, by methods of one stage and of several."""
    rng = np.random.default_rng(7)
    (springs, at), (undamped, _) = net(6), net(6, damping=None)
    # Just above a floor that is inclined.
    floor = sw.Floor(restitution=0.3, friction=0.2, normal=(0.0, 0.6, 0.8), offset=-0.05)
    (contacts, flat), (few, near), (fewer, nearer) = net(5, floor=floor), net(5), net(3, floor=floor)
    hung = {"rest": 0.9, "masses": np.linspace(1.0, 2.0, 40), "stiffness": 90.0, "gravity": [0.0, -9.81], "fixed": [0]}
    rope = sw.Springs([(i, i + 1) for i in range(39)], **hung)
    along = np.stack([np.arange(40.0), np.zeros(40)], axis=1)
    particles, places = sw.Particles(np.ones(30), gravity=9.81, floor=sw.Floor(restitution=0.5)), rng.uniform(0.0, 0.3, (30, 2))
    bodies, apart = sw.NBody(np.ones(12), force="newton", softening=0.1), rng.normal(size=(12, 3))
    push = {"force": rng.normal(size=at.shape)}
    return [
        Journey(springs, "false_euler", 0.1 * rng.normal(size=at.shape), at, 7, options=push),
        Journey(springs, "rk4", 0.1 * rng.normal(size=at.shape), at, 4, options=push),
        Journey(undamped, "leapfrog", 0.1 * rng.normal(size=at.shape), at, 5, options=push),
        Journey(contacts, "false_euler", 0.1 * rng.normal(size=flat.shape) - [0.0, 0.0, 3.0], flat, 12, dt=0.02),
        Journey(contacts, "false_heun", 0.1 * rng.normal(size=flat.shape) - [0.0, 0.0, 3.0], flat, 6, dt=0.02),
        Journey(rope, "verlet", 0.0 * along, along, 9, dt=0.01),
        Journey(rope, "rk4", 0.0 * along, along, 9, dt=0.01),
        Journey(particles, "leapfrog", rng.normal(size=places.shape), places, 9),
        Journey(bodies, "false_euler", 0.0 * apart, apart, 3, dt=0.01, options={"control": sw.EnergyControl(0.3)}),
        Journey(exponentials(), "rk4", rng.normal(size=60), rng.normal(size=60), 5),
        Journey(few, "false_euler", 0.0 * near, near, 9, options={"dtype": "float32", "force": np.ones(near.shape)}),
        Journey(fewer, "false_euler", 0.0 * nearer - [0.0, 0.0, 3.0], nearer, 9, dt=0.02, options={"dtype": "float32"}),
    ][::every]


@sw.system(order=1)
def pair(t: Any, y: Any, k: Any = 100.0) -> Any:
    a, b = y
    return [-k * a + b * b, k * a - b]


@sw.system
def swing(t: Any, v: Any, y: Any, k: Any = 30.0) -> Any:
    """Two masses with a spring that becomes soft, so that rows are exchanged in some steps and not in others."""
    a, b = y
    pull = k * (b - a) / (1.0 + (b - a) ** 2)
    return [pull - 3.0 * v[0] * v[1] + np.cos(t), -pull - a]


def implicit(language: str, every: int = 1) -> list[Journey]:
    start = np.array([0.3, -0.2]), np.array([1.0, -0.5])
    methods = (("rodas5p", 0.3), ("trapezoidal", 0.01), ("backward_euler", 1.0))
    return [
        *(Journey(pair(), method, np.empty(0), np.array([1.0, 0.5]), dt=dt, steps=20) for method, dt in methods),
        *(Journey(swing(), method, *start, dt=0.4) for method in ("rosenbrock23", "implicit_midpoint")),
        Journey(swing(), "rodas4", *start, options={"dtype": "float32"}),
    ][::every]


SETS: dict[str, Callable[..., list[Journey]]] = {
    make.__name__.replace("_", " "): make
    for make in (
        of_all_methods_and_systems, controlled, diverging, changed, singles, fused, pushed, with_choices, of_bits, long_steps,
        with_lanes, implicit,
    )
}  # fmt: skip


def _no_lanes(*_: Any) -> None:
    raise NoLoopError


def exported(name: str, journeys: list[Journey], language: str, first: int = 0) -> list[str]:
    """The sources of a set, numbered from ``first``; long steps are written as loops sooner than elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        if name == "long steps":  # loops of single operations, for steps whose lanes are not alike
            patch.setattr(written, "Lanes", _no_lanes)
            patch.setattr(written, "MAX_OPERATIONS", MAX_OPERATIONS if language == "python" else MAX_OPERATIONS // 10)
        if name == "with lanes":
            patch.setattr(written, "MAX_SHORT", 100)
        steps = [each.export(language, f"step_{first + i}") for i, each in enumerate(journeys)]
        assert name != "long steps" or all(each.operations > written.MAX_OPERATIONS for each in steps)
    sources = [each.source for each in steps]
    assert name != "with lanes" or all(re.search(r"\bfor \(?(int|let|i)\b", each) for each in sources)
    return sources


# ---- what is changed in what is exported
class Reserved(sw.Oscillator):
    """An oscillator whose parameters are called what languages have for something else."""

    NAMES: ClassVar = {"omega": "while", "damping": "M_PI", "a": "m", "x": "dt"}


class Inward(Reserved):
    """Or what a file has for something else."""

    NAMES: ClassVar = {"omega": "phi", "damping": "prepare", "a": "λ", "x": "c1"}


def oddly_named(monkeypatch: pytest.MonkeyPatch) -> list[Journey]:
    """Steps of parameters with names that a file may not take as they are, which is so while the patch lasts."""

    def renamed(plan: Any) -> Any:
        numbers, tables = parameters(plan)
        return [getattr(plan.system, "NAMES", {}).get(name, name) for name in numbers], tables

    parameters = tapes.parameters
    monkeypatch.setattr(tapes, "parameters", renamed)
    return [
        Journey(kind(1.3, 0.2, x=0.5, a=0.25, form="physical"), method, 0.5, 1.0)
        for kind in (Reserved, Inward)
        for method in ("rk4", "false_euler")
    ]


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
