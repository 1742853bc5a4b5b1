"""Names of values as names that every language accepts: ``v'[0,1]`` is ``next_v_0_1``, ``Φ`` is ``phi``."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

from ...base import checks
from ...base.arrays import Shape
from ...errors import ArgumentError, DTypeError

#: Words that cannot be names: keywords of the languages, names of C's headers, and those that a file uses.
WORDS = """
abstract and alignas alignof arguments as asm assert async auto await become bool boolean box break byte case catch char class
const constexpr continue crate debugger def default del delete do double dyn elif else enum eval except export extends extern
f64 false False final finally float fn for from function gen global goto if impl import in inline instanceof int interface is
lambda let long loop macro main match mod move mut native new None nonlocal not null nullptr override package pass priv private
protected pub public raise ref register restrict return self Self short signed sizeof static static_assert struct super switch
synchronized template this thread_local throw throws trait transient true True try type typedef typeof union unsafe unsigned
unsized use usize using var virtual void volatile where while with yield
base checked decimal delegate event explicit fixed foreach implicit internal lock namespace object operator out params readonly
sbyte sealed stackalloc string uint ulong unchecked ushort
i386 linux unix DOMAIN HUGE HUGE_VAL INFINITY MAXFLOAT NAN NULL OVERFLOW PLOSS SING TLOSS UNDERFLOW X_TLOSS
M_1_PI M_2_PI M_2_SQRTPI M_E M_LN10 M_LN2 M_LOG10E M_LOG2E M_PI M_PI_2 M_PI_4 M_SQRT1_2 M_SQRT2
abs acos asin atan ceil cos errno exp f floor fma fmod i inf isnan log m math memcpy nan pow printf s signal sin sqrt stdin
stdout stderr strlen struct tan time u64
"""

#: Names of types that a file uses, in languages whose types begin with a capital; other names must not hide them.
TYPES = """
Array ArrayBuffer BigInt BigInt64Array BigUint64Array Box Boolean Clone Copy Debug Default Error Float64Array Function Infinity
Math NaN Number Object Option Range RangeError Result Self String Symbol TypeError ImportError ValueError Vec None True False
ArgumentException BitConverter
"""

RESERVED, HIDING = frozenset(WORDS.split()), frozenset(TYPES.split())

#: Letters of other alphabets, spelled out.
LETTERS = {
    "Φ": "phi",
    "Ψ": "psi",
    "Ω": "omega",
    "ω": "omega",
    "μ": "mu",
    "λ": "lambda",
    "δ": "delta",
    "ε": "epsilon",
    "α": "alpha",
}
LETTERS |= {"β": "beta", "γ": "gamma", "κ": "kappa", "ν": "nu", "π": "pi", "ρ": "rho", "σ": "sigma", "τ": "tau", "θ": "theta"}

#: The longest prefix; compilers need not distinguish longer names.
MAX_PREFIX = 60

ELEMENT = re.compile(r"(.*)\[(\d+(?:,\d+)*)\]")


class Names:
    """Names of one scope, each different from the others."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._of: dict[str, str] = {}

    def __call__(self, name: str, key: str = "") -> str:
        """The name of a value, always the same for the same value; ``key`` distinguishes it from others of that name."""
        if (key := key or name) not in self._of:
            word = plain(name)
            while word in self._taken or word in RESERVED:
                word += "_"
            self._taken.add(word)
            self._of[key] = word
        return self._of[key]


@lru_cache(maxsize=4096)
def plain(name: str) -> str:
    """A name as English letters, digits and underscores."""
    if name.endswith("'") or "'[" in name:
        name = "next_" + name.replace("'", "", 1)
    name = re.sub(r"[\[,.]", "_", re.sub(r"\[(\d+)\]\.", r"\1_", name)).replace("]", "")
    name = "".join(LETTERS.get(letter, letter) for letter in name)
    name = unicodedata.normalize("NFKD", name)
    name = re.sub(r"\W", "", name, flags=re.ASCII) or "x"
    return f"x{name}" if name[0].isdigit() or name[0] == "_" else name


def snake(name: str) -> str:
    """``NBody`` as ``n_body``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", plain(name)).lower()


def camel(name: str) -> str:
    """``n_body`` as ``NBody``."""
    return "".join(word[:1].upper() + word[1:] for word in name.split("_"))


def prefix(name: object) -> str:
    """Return the argument ``name`` if functions and types can have that name."""
    if not isinstance(name, str):
        raise DTypeError(f"name: expected a word, got {checks.short(name)} ({type(name).__name__})")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name, re.ASCII) or len(name) > MAX_PREFIX:
        raise ArgumentError(
            f"name: expected at most {MAX_PREFIX} letters of English, digits and underscores, a letter first, got "
            f"{checks.short(name)}"
        )
    if name in RESERVED or name.lower() in RESERVED or camel(name) in HIDING:
        raise ArgumentError(
            f"name: {name!r} has a meaning of its own in one of the languages; add a word, as in 'my_{name.lower()}'"
        )
    return name


class Field(NamedTuple):
    """A parameter in the structure of a file: its name, its description, its default numbers in C order.

    The shape of a number is (). A ``wide`` one is float64 even in a file of float32.
    """

    name: str
    about: str
    values: list[float]
    shape: Shape = ()
    wide: bool = False


def fields(numbers: list[tuple[str, float]], used: set[int], names: Names) -> tuple[list[Field], dict[int, tuple[str, Shape]]]:
    """The fields of the parameters that are used, one for all elements of an array; and the field and place of each parameter."""
    matches = [ELEMENT.fullmatch(name) for name, _ in numbers]
    # If x[1].amplitude exists, x[0] is not an element of an array.
    alone = {name.partition("[")[0] for name, _ in numbers if "]." in name} | {name for name, _ in numbers if "[" not in name}
    groups: dict[str, list[int]] = {}
    for i, (name, _) in enumerate(numbers):
        match = matches[i]
        groups.setdefault(match[1] if match and match[1] not in alone else name, []).append(i)
    out: list[Field] = []
    where: dict[int, tuple[str, Shape]] = {}
    for name, members in groups.items():
        if not used & set(members):
            continue
        match = matches[members[0]]
        if match is None or match[1] != name:
            (i,) = members
            out.append(Field(names(name, f"parameter {name}"), name, [numbers[i][1]]))
            where[i] = out[-1].name, ()
            continue
        places = [tuple(map(int, matches[i][2].split(","))) for i in members]  # type: ignore[index]
        shape = tuple(1 + max(axis) for axis in zip(*places, strict=True))
        values = dict.fromkeys(indices(shape), 0.0) | {place: numbers[i][1] for i, place in zip(members, places, strict=True)}
        out.append(Field(names(name, f"parameter {name}"), name, list(values.values()), shape))
        where |= {i: (out[-1].name, place) for i, place in zip(members, places, strict=True)}
    return out, where


def indices(shape: Shape) -> list[Shape]:
    """Every index of an array, in C order."""
    places: list[Shape] = [()]
    for size in shape:
        places = [(*place, i) for place in places for i in range(size)]
    return places
