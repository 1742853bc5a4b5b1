"""What tests of export share."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.runs import engine
from stepwell.source.exports.head import EXAMPLE

from support.abroad import C_FLAGS, CSHARP_FLAGS, RUST_FLAGS, Journey, executed, missing, same
from support.cases import SYSTEMS, fits, number
from support.tracing import METHODS

LANGUAGES = ["c", "csharp", "javascript", "python", "rust"]


MEMBERS, MEMBER = 3, 1


#: Of a batch in which parameters differ, one member is exported.
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


#: Of all pairs of a system and a method each language is tried with one in so many, each with others. Compilers take longest.
SHARE = {"c": 29, "csharp": 23, "javascript": 18, "python": 16, "rust": 23}


#: Systems whose steps are long; they are tried with the methods whose steps are short.
LONG = ("eight bodies", "chain of nineteen", "linear, seventeen states")


#: One that compilers take half a minute for.
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


def drawn(language: str, pair: tuple[str, sw.Method, str | None]) -> int:
    """A random number below the share of a language, always the same for the same pair."""
    name, method, start = pair
    return number(language, name, method.name, start) % SHARE[language]


#: Languages whose compilers take longest, and which of so many systems each is tried with: what is written is of operations, of
#: which every system has some that others have too. In the long run each is tried with all.
OF_SYSTEMS = {"c": (0, 2), "rust": (1, 2)}


def journeys(language: str) -> list[Journey]:
    """Every method and every system, in as few pairs as there are systems: each language has others."""
    share, of = OF_SYSTEMS.get(language, (0, 1))
    wanted = {name for i, name in enumerate(SYSTEMS) if i % of == share and (name != LONGEST or language == "python")}
    every = sorted(
        (each for each in pairs(series=False) if each[0] in wanted),
        key=lambda each: number(language, each[0], each[1].name, each[2]),
    )
    chosen: list[tuple[str, sw.Method, str | None]] = []
    systems: set[str] = set()
    methods: set[str] = set()
    # First pairs of a new system and a new method, then what is left of either.
    for is_wanted in (lambda s, m: s and m, lambda s, m: s or m):
        for name, method, start in every:
            if is_wanted(name not in systems, method.name not in methods):
                chosen.append((name, method, start))
                systems.add(name)
                methods.add(method.name)
    chosen += [(name, sw.method("false_euler"), None) for name in sorted(wanted - systems)]
    return [journey(*each) for each in chosen]


def other_journeys(language: str) -> list[Journey]:
    """The systems that the language is not tried with by default, and three times as many other pairs, for the long run."""
    every = [each for each in pairs() if drawn(language, each) in (0, 1, 2)]
    names = {each[0] for each in every} | {LONGEST}
    return [
        journey(*each) for each in [*every, *((name, sw.method("false_euler"), None) for name in SYSTEMS if name not in names)]
    ]


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


def shown(step: sw.ExportedStep, folder: Path) -> float:
    """What it prints, run as the head of the file says."""
    match step.language:
        case "C":
            step.save(folder / f"{step.name}.c")
            (folder / "example.c").write_text(example(step), encoding="utf-8")
            executed(["cc", *C_FLAGS, "example.c", "-lm", "-o", "example"], folder)
            command: list[Any] = [folder / "example"]
        case "C#":
            step.save(folder / f"{step.name}.cs")
            (folder / "example.cs").write_text(example(step), encoding="utf-8")
            executed(["mcs", *CSHARP_FLAGS, "example.cs", f"{step.name}.cs"], folder)
            command = ["mono", "example.exe"]
        case "JavaScript":
            step.save(folder / f"{step.name}.mjs")
            (folder / "example.mjs").write_text(example(step), encoding="utf-8")
            command = ["node", "example.mjs"]
        case "Rust":
            step.save(folder / f"{step.name}.rs")
            (folder / "example.rs").write_text(example(step), encoding="utf-8")
            executed(["rustc", *RUST_FLAGS, "example.rs", "-o", "example_rust"], folder)
            command = [folder / "example_rust"]
        case _:
            step.save(folder / f"{step.name}.py")
            (folder / "example.py").write_text(example(step), encoding="utf-8")
            command = [sys.executable, "example.py"]
    return float(executed(command, folder))
