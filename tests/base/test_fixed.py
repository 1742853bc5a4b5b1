"""Systems, inputs, controls and methods cannot be changed: what was made of them would not see it."""

from __future__ import annotations

import copy
import inspect
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base.immutable import Immutable, changed
from stepwell.errors import FixedError, StepwellError
from support.cases import SYSTEMS
from support.for_each import for_each

MADE: dict[str, Callable[[], Any]] = {
    "a sinusoid": lambda: sw.Sinusoid([1.0, 2.0], 3.0),
    "samples": lambda: sw.Sampled(np.arange(6.0).reshape(3, 2), 0.1),
    "a control of energy": lambda: sw.EnergyControl(np.ones(2)),
    "a control": lambda: sw.Control("energy", np.ones(2)),
    "a control of length": lambda: sw.LengthControl(np.ones(2)),
    "a control of norm": lambda: sw.NormControl(np.ones(2)),
    "a projection": lambda: sw.Projection(target=np.ones(2)),
    "a method": lambda: sw.method("rk4"),
    **{name: lambda make=make: make(np.random.default_rng(0), 2) for name, make in SYSTEMS.items()},
}
COPIES: dict[str, Callable[[Any], Any]] = {
    "itself": lambda one: one,
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
}


def arrays(what: Any) -> list[Any]:
    """All arrays that an object holds in what is public."""
    if isinstance(what, np.ndarray):
        return [what]
    if isinstance(what, (list, tuple)):
        return [each for part in what for each in arrays(part)]
    if isinstance(what, dict):
        return arrays(list(what.values()))
    if isinstance(what, Immutable):
        return arrays([value for name, value in vars(what).items() if not name.startswith("_")])
    return []


@for_each("copying", COPIES)
@for_each("name", MADE)
def test_nothing_of_it_is_assigned(name: str, copying: str) -> None:
    one = COPIES[copying](MADE[name]())
    before = pickle.dumps(one)
    for attribute in (*vars(one), "anything"):
        if attribute.startswith("_"):
            continue
        with pytest.raises(FixedError, match=rf"^{attribute}: the {attribute} of \w+ cannot be assigned; ."):
            setattr(one, attribute, 2.0)
        with pytest.raises(FixedError, match=rf"^{attribute}: the {attribute} of \w+ cannot be deleted; ."):
            delattr(one, attribute)
    for array in arrays(one):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 2.0
    assert pickle.dumps(one) == before


def test_there_are_arrays_to_look_at() -> None:
    assert sum(bool(arrays(make())) for make in MADE.values()) > len(SYSTEMS) - 5


def test_the_message_says_how_a_world_goes_on() -> None:
    """And it does."""
    v, y = np.zeros(3), np.ones(3)
    world = sw.World(sw.Oscillator(1.0), "verlet", v=v, y=y, dt=0.1)
    world.step(7)
    with pytest.raises(FixedError, match=r"omega: .* World\(system, method, resume=world\)$"):
        world.system.omega = 2.0  # type: ignore[attr-defined]
    other = sw.World(sw.Oscillator(2.0), world.method, resume=world)
    other.step(5)
    expected = sw.integrate(sw.Oscillator(2.0), "verlet", v=v, y=y, dt=0.1, steps=5, start_step=7)
    np.testing.assert_array_equal(other.y, expected.y[-1])


def test_parameters_of_own_equations_are_not_changed() -> None:
    world = sw.World(SYSTEMS["own: Duffing"](np.random.default_rng(0), 2), "rk4", v=np.zeros(2), y=np.ones(2), dt=0.1)
    parameters = world.system.parameters_given  # type: ignore[attr-defined]
    for change in (
        lambda: parameters.update(beta=2.0),
        lambda: parameters.__setitem__("beta", 2.0),
        lambda: parameters.__ior__({"beta": 2.0}),
        lambda: parameters.pop("beta"),
        lambda: parameters.clear(),
        lambda: parameters.setdefault("beta", 2.0),
    ):
        with pytest.raises(FixedError, match="parameters: those of a system cannot be assigned"):
            change()


def test_the_error_is_one_of_the_projects_and_pythons() -> None:
    assert issubclass(FixedError, StepwellError)
    assert issubclass(FixedError, AttributeError)


def test_its_arguments_are_known() -> None:
    """To ``help`` and to editors, though objects are made in a way of their own."""
    assert list(inspect.signature(sw.Sinusoid).parameters) == ["amplitude", "omega", "phase"]
    assert list(inspect.signature(sw.Projection).parameters) == ["way", "target"]
    assert not inspect.signature(sw.System).parameters
    assert "friction" in inspect.signature(sw.Oscillator).parameters


def test_the_users_own_array_stays_writeable() -> None:
    omega = np.ones(3)
    sw.Oscillator(omega)
    omega[0] = 2.0
    assert omega[0] == 2.0


def test_a_class_of_the_users_own_is_fixed_too_and_may_keep_what_is_private() -> None:
    class Twice(sw.Pendulum):
        def __init__(self) -> None:
            super().__init__(2.0)
            self.more = np.ones(2)
            self.omega = 2.0 * self.omega

    one = Twice()
    assert (one.omega, one.more.flags.writeable) == (4.0, False)
    one._known = 3
    with pytest.raises(FixedError, match="more: the more of Twice cannot be assigned; make another Twice"):
        one.more = np.zeros(2)
    other = changed(one, more=np.zeros(2))
    assert not other.more.flags.writeable
    assert one != other
