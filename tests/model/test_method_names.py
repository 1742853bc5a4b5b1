"""Every name in the records finds its method, or says why not; the name of another method is explained and never suggested."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import pytest
import stepwell as sw
from stepwell.errors import UnknownNameError
from stepwell.model.method_names import _why_not_here, names_of, spelling
from support.for_each import for_each

ALL = {m.name: m for m in sw.methods()}
NAMES = [(m.name, name) for m in sw.methods() for name in (m.name, m.title, *m.other_names)]
FRIENDS = [(m.name, friend) for m in sw.methods() for friend in m.false_friends]


def holders(name: str) -> list[str]:
    """Which records have that name, by the records alone; the name of a method is that method."""
    exact = [m.name for m in sw.methods() if spelling(m.name) == spelling(name)]
    every = [m.name for m in sw.methods() if spelling(name) in {spelling(each) for each in (m.title, *m.other_names)}]
    return exact or every


def message_of(name: str) -> str:
    """What is said of a name that is none, but for the list of those that are."""
    with pytest.raises(UnknownNameError) as caught:
        sw.method(name)
    return str(caught.value).partition(" Known:")[0]


@for_each(("method", "name"), NAMES)
def test_every_name_of_a_record_finds_its_method(method: str, name: str) -> None:
    expected = holders(name)
    assert method in expected or expected == [m for m in ALL if m == spelling(name)]
    for written in {name, name.lower(), name.upper(), spelling(name), name.replace("-", " "), name.replace(" ", "_")}:
        if len(expected) == 1:
            assert sw.method(written) is ALL[expected[0]]
        else:
            with pytest.raises(UnknownNameError, match=re.escape(", ".join(expected))):
                sw.method(written)


@for_each(
    ("name", "method"),
    {
        "euler": "standard_euler",
        "symplectic_euler": "false_euler",
        "velocity_verlet": "leapfrog",
        "RKF45": "fehlberg",
        "heun": "standard_heun",
        "Heun’s method": "standard_heun",
        "RK4": "rk4",
        "Classical Runge-Kutta": "rk4",
        "False Euler": "false_euler",
        "position-extended Forest-Ruth-like": "pefrl",
        "DOP853": "dop853",
        "RK45": "dopri5",
        "ode45": "dopri5",
        "RK23": "bs32",
        "Bogacki–Shampine 2(3)": "bs32",
        "Tsit5": "tsit5",
        "Vern7": "vern7",
        "Verner 9(8)": "vern9",
    }.items(),
)
def test_names_that_people_type(name: str, method: str) -> None:
    assert sw.method(name).name == method
    assert sw.integrate(sw.Oscillator(), name, v=0.0, y=1.0, dt=0.1, steps=1).method.name == method


@for_each(("method", "friend"), FRIENDS)
def test_a_false_friend_is_another_method_or_explained(method: str, friend: str) -> None:
    own = holders(friend)
    if len(own) == 1:
        assert own != [method]
        assert sw.method(friend).name == own[0]
        return
    message = message_of(friend)
    if holders(re.sub(r"( \(| with ).*", "", friend)):  # a method with a remark, of which the name alone is known
        return
    assert "did you mean" not in message
    if why := _why_not_here(spelling(friend)):
        assert message.endswith(why)
        return
    assert "is not here; nearest, but not the same: " in message
    assert method in message


@for_each(("wrong", "meant"), [("backwards Radau", None), ("yoshida", None), ("Dormand Prince 7(8)", "dop853")])
def test_a_typing_error_in_a_false_friend_is_explained_too(wrong: str, meant: str | None) -> None:
    message = message_of(wrong)
    assert ("implicit, and not here" if "Radau" in wrong else "not here; nearest, but not the same: ") in message
    assert ("did you mean" in message) == (meant is not None)
    assert meant is None or f"did you mean {meant!r}?" in message


def test_a_name_without_its_remark_says_what_there_is() -> None:
    assert "'RK2' does not say which: RK2 (trapezoidal) is 'standard_heun'" in message_of("RK2")
    assert sw.method("RK2 (trapezoidal)").name == "standard_heun"
    for nothing in ("", "  ", "…", "qqqq"):
        assert "method: there is no " in message_of(nothing)


def test_a_new_record_needs_nothing_else() -> None:
    """What resolves and what is ambiguous follows from the records alone."""

    def record(name: str, *others: str, friends: tuple[str, ...] = ()) -> Any:
        return SimpleNamespace(name=name, title=name.title(), other_names=others, false_friends=friends)

    names = names_of([record("one", "Common name", "Own name"), record("two", "common-name", friends=("Third 4(3)", "own name"))])
    assert names.methods[spelling("Own name")] == ["one"]
    assert names.methods[spelling("COMMON name")] == ["one", "two"]
    assert names.friends == {"third_4_3": ["two"]}


@for_each(
    ("names", "why"),
    [
        ("implicit Adams|Rosenbrock32|Rodas4P|Rodas5|ROS3P|Radau|BDF|BDF2|LSODA|SDIRK2|ode15s", "implicit, and"),
        (
            "TR-BDF2|Newmark-beta|Kvaerno5|KenCarp4|IMEX|Gauss-Legendre 4|generalized alpha",
            "implicit, and not here; for stiff equations rosenbrock23, rodas4 and rodas5p choose their steps",
        ),
        ("euler_maruyama|Euler–Maruyama|Milstein|SRIW1|BAOAB", "for equations with noise, .* sw.Sampled"),
        ("Vern6|Verner 8|BS5|Cash-Karp|ode113", "not here; dopri5, tsit5, vern7, dop853, vern9 and others choose"),
        ("Adams-Bashforth|AB2|ABM4|Gear's method|linear multistep method", "a method of several steps, and none of them is here"),
    ],
)
def test_methods_of_a_kind_that_is_not_here(names: str, why: str) -> None:
    """They are said to be what they are, and no method that has a similar name is suggested."""
    for name in names.split("|"):
        message = message_of(name)
        assert re.search(rf"^method: ['\"]?{re.escape(name)}['\"]? is {why}", message)
        assert not re.search("did you mean|nearest", message)


def test_no_name_of_a_record_is_of_a_kind_that_is_not_here() -> None:
    for _, name in NAMES:
        assert _why_not_here(spelling(name)) is None
