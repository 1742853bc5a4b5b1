"""What is around a system: one list, in one order, in both languages."""

from __future__ import annotations

import re

import numpy as np
import pytest
import stepwell as sw
from stepwell.model.around import FORCE, StickFriction
from stepwell.reference.around import ORDER, Forced, wrapped
from stepwell.reference.contact import Touching
from stepwell.reference.friction import Rubbing
from support import ROOT

CORE = ROOT / "rust" / "core" / "src" / "model" / "around" / "mod.rs"


def test_parts_are_in_order_however_they_came() -> None:
    falling = sw.Particles(floor=sw.Floor(), dim=2).for_state_shapes(None, np.zeros((1, 2)))
    system = falling.surrounded(StickFriction(np.array(0.2))).surrounded(sw.EnergyControl(1.0, target=0.0))
    assert [part.kind for part in system.around] == ["surfaces", "control", "friction"]
    again = system.surrounded(StickFriction(np.array(0.3)))
    assert [part.kind for part in again.around] == ["surfaces", "control", "friction"]
    assert again.part("friction").limit == 0.3
    assert again.has_stick_friction
    assert not system.linear
    assert list(system.all_parameters(()))[-4:] == ["control.form", "control.gain", "control.target", "friction.limit"]


def test_friction_is_around_a_force_and_a_force_around_surfaces() -> None:
    system = sw.Particles(floor=sw.Floor(way="spring", omega=1.0), dim=2).surrounded(StickFriction(np.array(0.2)))
    parts = system.parts((), np.ones((1, 2)))
    assert [list(parameters)[-1] for _, parameters in parts][-2:] == ["friction.limit", FORCE]  # as the core has their numbers
    s = wrapped(system.reference_at_step(0.1, ()), 0.1, parts)
    assert [type(s), type(s.s), type(s.s.s)] == [Rubbing, Forced, Touching]


def test_the_core_has_the_same_order() -> None:
    listed = re.search(r"vec!\[(.*?)\]", CORE.read_text(encoding="utf-8"), re.DOTALL)
    assert listed is not None
    names = {"contact": "surfaces", "controls": "control", "sampled": "controller"}
    assert tuple(names.get(name, name) for name in re.findall(r"(\w+)::part", listed[1])) == ORDER


def test_what_is_no_part_is_refused() -> None:
    with pytest.raises(sw.errors.DTypeError, match=r"part: expected something around a system, got 0\.5 \(float\)"):
        sw.Pendulum().surrounded(0.5)
    with pytest.raises(sw.errors.ShapeError):
        sw.Pendulum(omega=[1.0, 2.0, 3.0]).surrounded(StickFriction(np.ones(2)))
