"""The names by which a method is found: its own, its title, and the other names of its record.

A name that means another method elsewhere (a false friend) is never suggested, but explained. All names come from the records, so
a new name needs no change of this file.
"""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable
from functools import cache
from typing import NamedTuple, Protocol, TypeVar

from ..base.checks import short
from ..errors import UnknownNameError


class Named(Protocol):
    """The names in a method's record."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def title(self) -> str: ...  # noqa: D102
    @property
    def other_names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def false_friends(self) -> tuple[str, ...]: ...  # noqa: D102


M = TypeVar("M", bound=Named)

#: The least similarity (``difflib``, 0 to 1) at which one name may be a misspelling of the other.
MIN_SIMILARITY = 0.5

#: If the similarities of two names differ by no more than this, both are suggested.
AS_NEAR = 0.2

#: A method's own name is suggested unless another of its names is closer by more than this.
OWN_NAME_FIRST = 0.1

#: The most characters of a text that are compared.
MAX_LENGTH = 200

#: Words that a name may have or lack.
OPTIONAL_WORDS = ("the", "method", "rule", "scheme", "integrator")


#: Kinds of methods that stepwell does not have, by patterns of their names in the form of ``spelling``; and the explanation.
NOT_HERE = {
    r"implicit_(?!euler|midpoint|trapezoidal).*|.*_implicit|i?bdf[2-6]?|.*radau.*|lsod[aei]?r?|l?vode|cvode|(esd|sd|d)irk.*|"
    r"tr_?bdf2|rosenbrock(?!_?2_?3$|_?euler$).*|ros[2-9].*|rodas(?!_?4(_3)?$|_?5_?p$).+|kvaerno\d?|kencarp\d+|lobatto.*|"
    r"gauss_legendre(_\d.*)?|newmark.*|hht.*|generali[sz]ed_alpha|ode(15s|15i|23t|23tb)|backward_differentiation.*|"
    r"exponential_euler|xpbd|imex.*": (
        "implicit, and not here; for stiff equations rosenbrock23, rodas4 and rodas5p choose their steps, with tolerance= and "
        "at=, and linearly_implicit_euler is for stiff springs in games."
    ),
    r"euler_maruyama|.*milstein.*|sri?w?\d?|sra\d?|sosri\d?|sosra\d?|langevin|baoab|.*stochastic.*": (
        "for equations with noise, and there is none here; noise that is held over a step is an input, sw.Sampled."
    ),
    r"vern(er)?_?[68].*|dverk|(bogacki_shampine|bs)_?5.*|cash_karp|rkck|(ode|rk)(78|89)|ode113|feagin.*": (
        "not here; dopri5, tsit5, vern7, dop853, vern9 and others choose their steps, with tolerance= and at=."
    ),
    r"kutta_?3|rk_?3_.*|ssp.*": ("not here; write it as a function, stepwell.method(function), which goes wherever a name does."),
    r"ias_?\d*|mercurius": (
        "REBOUND's, and not here; take taylor or dop853 with tolerance= and at=, or wisdom_holman for planets around a star."
    ),
    r"boris.*|.*higuera.*|numerov.*|symplectic": (
        "not here; leapfrog and pefrl are symplectic where forces do not depend on the velocity; implicit_midpoint keeps "
        "what turns, as in a magnetic field."
    ),
    r"gillespie.*|ssa|tau_leap.*|.*next_reaction.*": (
        "for stochastic simulation, which is not here; the methods step mean rates."
    ),
    r"adams.*|abm?_?\d?|.*multistep.*|gear.*|stormer_cowell": (
        "a method of several steps, and none of them is here; you can write one: stepwell.method(function, start=…)."
    ),
}


class Names(NamedTuple):
    """All names of the records, in the form of ``spelling``.

    Attributes:
        methods: the methods that have a name; more than one if it is ambiguous.
        qualified: for a name without its remark in parentheses, as RK2 of "RK2 (trapezoidal)", the methods and full names.
        friends: for the name of a method that stepwell does not have, the methods nearest to it.
        written: each name as the records write it.
    """

    methods: dict[str, list[str]]
    qualified: dict[str, list[tuple[str, str]]]
    friends: dict[str, list[str]]
    written: dict[str, str]


def spelling(name: str) -> str:
    """A name in a form that does not depend on case, accents, hyphens, spaces, apostrophes, "the" and "method"."""
    plain = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c)).casefold()
    words = re.sub(r"[^a-z0-9]+", " ", re.sub(r"['’]s(?![a-z])", "", plain)).split()
    return "_".join([word for word in words if word not in OPTIONAL_WORDS] or words)


def names_of(methods: Iterable[Named]) -> Names:
    """The names in the records of these methods."""
    names = Names({}, {}, {}, {})
    methods = list(methods)
    for method in methods:
        for name in (method.name, method.title, *method.other_names):
            holders = names.methods.setdefault(spelling(name), [])
            if method.name not in holders:
                holders.append(method.name)
            names.written.setdefault(spelling(name), name)
            if (short := spelling(_without_remark(name))) != spelling(name):
                names.qualified.setdefault(short, []).append((method.name, name))
    for method in methods:  # a method's own name is never ambiguous
        names.methods[spelling(method.name)] = [method.name]
    for holder, name in [(method.name, friend) for method in methods for friend in method.false_friends]:
        key = spelling(name)
        if key not in names.methods and spelling(_without_remark(name)) not in names.methods:
            names.friends.setdefault(key, []).append(holder)
            names.written.setdefault(key, name)
    return names


def resolved(name: str, methods: dict[str, M]) -> M:
    """The method of any name but its own."""
    names, key = _names(tuple(methods.values())), spelling(name[:MAX_LENGTH])
    shown = short(name)
    holders = names.methods.get(key, [])
    if len(holders) == 1:
        return methods[holders[0]]
    if holders:
        raise UnknownNameError(f"method: {shown} is the name of several methods: {', '.join(holders)}; give one of these.")
    if key in names.qualified:
        full_names = "; ".join(f"{full} is {holder!r}" for holder, full in names.qualified[key])
        raise UnknownNameError(f"method: {shown} does not say which: {full_names}. Known: {', '.join(methods)}.")
    if key in names.friends or _why_not_here(key):
        meaning = _explained(shown.strip("'"), key, names)
        raise UnknownNameError(f"method: {meaning} Known: {', '.join(methods)}.")
    raise UnknownNameError(f"method: there is no {shown}{_hint(key, names)} Known: {', '.join(methods)}.")


def _why_not_here(key: str) -> str | None:
    return next((why for pattern, why in NOT_HERE.items() if re.fullmatch(pattern, key)), None)


def _hint(key: str, names: Names) -> str:
    """The end of a message with the method of the nearest name, or why stepwell does not have the nearest, or both."""
    own = [each for each, holders in names.methods.items() if each in holders]
    like, name = max(_nearest(key, own), _nearest(key, names.methods, margin=OWN_NAME_FIRST))
    like_friend, friend = _nearest(key, names.friends)
    hints = []
    if name and like >= like_friend - AS_NEAR:
        hints.append(f"did you mean {' or '.join(repr(each) for each in names.methods[name])}?")
    if friend and like_friend >= like - AS_NEAR:
        hints.append(_explained(names.written[friend], friend, names))
    return f"; {' '.join(hints)}" if hints else "."


def _nearest(key: str, known: Iterable[str], margin: float = 0.0) -> tuple[float, str]:
    """The similarity of the nearest name, less a margin, and that name; 0 and an empty name if none is near."""
    near = difflib.get_close_matches(key, list(known), n=1, cutoff=MIN_SIMILARITY)
    return (difflib.SequenceMatcher(None, near[0], key).ratio() - margin, near[0]) if near else (0.0, "")


def _explained(name: str, key: str, names: Names) -> str:
    """The meaning of the name of a method that stepwell does not have, and the nearest methods."""
    if why := _why_not_here(key):
        return f"{name} is {why}"
    return f"{names.written[key]} is not here; nearest, but not the same: {', '.join(names.friends[key])}."


def _without_remark(name: str) -> str:
    """A name without words in parentheses at its end; numbers in parentheses are orders, and stay."""
    return re.sub(r"\s*\([^()]*[a-z]{2}[^()]*\)$", "", name)


@cache
def _names(methods: tuple[Named, ...]) -> Names:
    return names_of(methods)
