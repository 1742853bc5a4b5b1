"""Own systems that are made anew at each call are traced once, and never again from what has changed since."""

from __future__ import annotations

import functools
import gc
import inspect
import math
import pickle
import types
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError
from stepwell.model.equations import recognised
from stepwell.model.systems import own
from stepwell.studies.sweeps.portable import packed
from support.for_each import for_each

SCALE = 2.0
TABLE = np.array([1.0, 2.0])
LISTED = [1.0, 2.0]
NAMED = {"k": 1.0}


SETTINGS = types.SimpleNamespace(k=1.0)


def helper(y: Any) -> Any:
    return SCALE * np.sin(y)


CELL = types.SimpleNamespace(k=1.0)


def of_helper() -> Any:
    return lambda t, v, y: -helper(y)


def of_closure() -> Any:
    k = CELL.k
    return lambda t, v, y: -k * y


def of_inner() -> Any:
    def outer(t: Any, v: Any, y: Any) -> Any:
        def inner(x: Any) -> Any:
            return SCALE * x

        return -inner(y)

    return outer


def of_attribute() -> Any:
    def scaled(y: Any) -> Any:
        return scaled.k * y  # type: ignore[attr-defined]

    scaled.k = CELL.k  # type: ignore[attr-defined]
    return lambda t, v, y: -scaled(y)


def of_default() -> Any:
    def scaled(y: Any, k: float = CELL.k) -> Any:
        return k * y

    return lambda t, v, y: -scaled(y)


CHANGES: dict[str, tuple[Callable[[], Any], Callable[[pytest.MonkeyPatch], None]]] = {
    "a global": (lambda: lambda t, v, y: -SCALE * y, lambda patch: patch.setitem(globals(), "SCALE", 3.0)),
    "a global of a function that it calls": (of_helper, lambda patch: patch.setitem(globals(), "SCALE", 3.0)),
    "a function that it calls": (of_helper, lambda patch: patch.setitem(globals(), "helper", lambda y: 7.0 * y)),
    "an array in place": (lambda: lambda t, v, y: -TABLE[0] * y, lambda patch: TABLE.__setitem__(0, TABLE[0] + 1.0)),
    "a list": (lambda: lambda t, v, y: -LISTED[0] * y, lambda patch: LISTED.__setitem__(0, LISTED[0] + 1.0)),
    "a dictionary": (lambda: lambda t, v, y: -NAMED["k"] * y, lambda patch: patch.setitem(NAMED, "k", 5.0)),
    "an attribute of an object": (lambda: lambda t, v, y: -SETTINGS.k * y, lambda patch: patch.setattr(SETTINGS, "k", 5.0)),
    "a captured variable": (of_closure, lambda patch: patch.setattr(CELL, "k", 5.0)),
    "a global of a function within it": (of_inner, lambda patch: patch.setitem(globals(), "SCALE", 3.0)),
    "an attribute of a function": (of_attribute, lambda patch: patch.setattr(CELL, "k", 5.0)),
    "a default": (of_default, lambda patch: patch.setattr(CELL, "k", 5.0)),
}


def end(function: Any, **parameters: Any) -> float:
    system = sw.system(function)(**parameters)
    runs = [sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=3, backend=backend) for backend in ("rust", "numpy")]
    assert runs[0].y[-1] == runs[1].y[-1]  # the reference runs the function itself
    return float(runs[0].y[-1])


@pytest.mark.parametrize("change", CHANGES)
def test_what_has_changed_is_traced_anew(change: str, monkeypatch: pytest.MonkeyPatch) -> None:
    make, act = CHANGES[change]
    before = end(make())
    assert end(make()) == before
    act(monkeypatch)
    assert end(make()) != before


def test_the_same_is_traced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    traced: list[Any] = []
    trace = own.OwnSystem._trace

    def counted(self: Any) -> None:
        traced.append(self)
        trace(self)

    monkeypatch.setattr(own.OwnSystem, "_trace", counted)
    # The cache is emptied when it is full, which tests before this one may have left it close to.
    monkeypatch.setattr(own, "_TRACED", {})

    def definition(scale: float) -> Any:
        @sw.system
        def duffing(t: Any, v: Any, y: Any, *, beta: Any = 1.0, drive: Any = 0.0) -> Any:
            return drive * math.cos(1.0) - scale * y - beta * y**3 + np.dot(TABLE, TABLE)

        return duffing

    for beta in (1.0, 2.0, [1.0, 2.0]):
        for drive in (0.5, sw.Sinusoid(1.0, 2.0), sw.Sinusoid(0.5, 3.0), sw.Sampled([0.0, 1.0], 0.1)):
            sw.integrate(definition(1.0)(beta=beta, drive=drive), "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
    assert len(traced) == 3  # a number, a sinusoid, samples
    for scale in (2.0, -0.0, 0.0):
        sw.integrate(definition(scale)(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
    assert len(traced) == 6
    sw.integrate(definition(1.0)(), "rk4", v=np.zeros((2, 3)), y=np.ones((2, 3)), dt=0.1, steps=1)
    assert len(traced) == 6  # batches change nothing


def test_arguments_are_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What ``inspect`` takes as long for as all else of a short run, of functions that share their code."""
    looked: list[Any] = []
    signature = inspect.signature
    monkeypatch.setattr(inspect, "signature", lambda function: looked.append(function) or signature(function))

    def with_defaults(k: float, drive: Any) -> Any:
        def rates(t: Any, v: Any, y: Any, a: Any = k, *, drive: Any = drive) -> Any:
            return drive - a * y

        return rates

    for k in (1.0, 2.0, [1.0, 2.0]):
        for drive in (0.0, 0.5, sw.Sinusoid(1.0, 2.0)):
            definition = sw.system(with_defaults(k, drive))
            assert list(definition.parameters) == ["a", "drive"]
            np.testing.assert_array_equal(definition.parameters["a"], k)
            assert definition.parameters["drive"] is drive
            assert definition.own_axes == {"a": np.ndim(k), "drive": 0}
    assert len(looked) == 1


def test_other_arguments_are_looked_at_again() -> None:
    """Defaults that were added or taken away, and attributes of a function that tell other arguments."""

    def rates(t: Any, v: Any, y: Any, a: Any = 1.0, *, b: Any = 2.0) -> Any:
        return -a * b * y

    assert sw.system(rates).parameters == {"a": 1.0, "b": 2.0}
    rates.__defaults__, rates.__kwdefaults__ = (3.0,), {"b": 4.0}
    assert sw.system(rates).parameters == {"a": 3.0, "b": 4.0}
    for positional, named, words in (
        (None, {"b": 4.0}, "rates: expected a default of the parameter a"),
        ((3.0,), None, "rates: expected a default of the parameter b"),
        ((3.0,), {"b": np.inf}, "default of b"),
    ):
        rates.__defaults__, rates.__kwdefaults__ = positional, named
        with pytest.raises(ArgumentError, match=words):
            sw.system(rates)
    rates.__kwdefaults__ = {"b": 4.0}
    with pytest.raises(ArgumentError, match="expected a default of the parameter y"):
        sw.system(order=1)(lambda t, v, y: y)

    @functools.wraps(rates)
    def wrapped(*arguments: Any, **named: Any) -> Any:
        return rates(*arguments, **named)

    assert sw.system(wrapped).parameters == {"a": 3.0, "b": 4.0}

    def bare(*arguments: Any, **named: Any) -> Any:
        return rates(*arguments, **named)

    with pytest.raises(ArgumentError, match="bare: expected a function"):
        sw.system(bare)


def test_what_goes_to_other_processes_keeps_its_scale() -> None:
    pytest.importorskip("cloudpickle")
    task = sw.system(scale="block", shape=(2,))(lambda t, v, y: -y)
    assert pickle.loads(packed(task)).scale == "block"  # type: ignore[arg-type]  # it packs any object


def test_functions_of_the_time_and_invariants_count() -> None:
    def with_energy(k: float) -> Any:
        @sw.system
        def pushed(t: Any, v: Any, y: Any, *, push: Any = 0.0) -> Any:
            return push - y

        @pushed.invariant
        def energy(v: Any, y: Any) -> Any:
            return k * (v * v + y * y)

        return pushed

    start: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 2}
    ends = {sw.integrate(with_energy(0.5)(push=lambda t, a=a: a * t), "rk4", **start).y[-1].item() for a in (1.0, 2.0)}
    assert len(ends) == 2
    for k in (0.5, 1.5):
        run = sw.integrate(with_energy(k)(), "rk4", **start, record="energy")
        assert run.recorded["energy"][0] == pytest.approx(k, rel=1e-4)


@for_each(
    "function",
    [
        lambda: SETTINGS.k,
        lambda: __import__("time").time(),
        lambda: globals()["SCALE"],
        lambda: getattr(SETTINGS, "k"),  # noqa: B009
        types.SimpleNamespace,
        lambda: np.zeros(1) if not_there else 0,  # type: ignore[name-defined]  # noqa: F821
    ],
)
def test_what_may_change_unseen_is_like_nothing_else(function: Any) -> None:
    with pytest.raises(recognised.Unknown):
        recognised.identity(function)


def test_numbers_are_told_apart_by_their_bits() -> None:
    def of(value: Any) -> Any:
        return recognised.identity(lambda: value)

    different = [0.0, -0.0, 1.0, 1, True, "1", b"1", None, (1.0,), [1.0], np.array([1.0]), np.float32(1.0), np.array([1])]
    identities = [of(each) for each in different]
    assert len(set(identities)) == len(identities)
    assert of(math.nan) == of(math.nan)
    assert of(np.array([1.0, np.nan])) == of(np.array([1.0, np.nan]))


def test_what_is_known_of_a_function_goes_with_it() -> None:
    captured = np.float64(2.0)
    functions = [lambda x: captured * x, lambda x: captured + x]
    for each in functions:
        recognised.identity(each)
    gone = [weakref.ref(each) for each in functions]
    del each, functions
    gc.collect()
    assert [each() for each in gone] == [None, None]
