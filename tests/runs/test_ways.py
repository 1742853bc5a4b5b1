"""Every pair of a method, a system and options of a run: the run has the same bits in each way in which it can be made.

That a step of the core is that of the reference is proven (``test_graphs.py``), and that a kernel computes what the interpreter
does (``rust/core/tests``). What remains is what drives the steps, and what options do between them.
"""

from __future__ import annotations

import random
import warnings
from collections import defaultdict
from functools import cache
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import StepwellError
from support import own_methods
from support.cases import SYSTEMS, _adaptive, _apart, fits, number
from support.covering import Row, covering, seed
from support.ways import WAYS, Asked, assert_equal_ways

#: No array of the systems here is so long but along the members' axis, by which members are chosen.
B = 6


@cache
def system_of(name: str) -> Any:
    return SYSTEMS[name](np.random.default_rng(0), B)


@cache
def methods() -> dict[str, Any]:
    """A method of each structure that a step can have, drawn by the seed."""
    structures: dict[tuple[bool, ...], list[Any]] = defaultdict(list)
    for method in (*sw.methods(), sw.method("exact"), own_methods.halfway, own_methods.adams_bashforth_2):
        structures[
            method.is_exact, method.has_series, method.is_implicit, method.needs_acceleration, bool(method.carry),
            bool(method.kept), method.splits, method.error_order is not None,
        ].append(method)  # fmt: skip
    draw = random.Random(seed())
    return {method.name: method for method in map(draw.choice, structures.values())}


@cache
def systems() -> list[str]:
    """A system of each kind that the core knows, drawn by the seed."""
    kinds: dict[tuple[Any, ...], list[str]] = defaultdict(list)
    for name in SYSTEMS:
        system = system_of(name)
        kinds[
            system.kernel, name.startswith("own"), bounces(system), bool(system.contacts), system.has_stick_friction,
            system.linear, system.second_order, system.reads_time, system.keeper is not None, bool(system.given_inputs()),
        ].append(name)  # fmt: skip
    draw = random.Random(seed())
    return [draw.choice(names) for names in kinds.values()]


def bounces(system: Any) -> bool:
    return any(surface.way != "spring" for surface in system.contacts)


def factors() -> dict[str, tuple[str, ...]]:
    return {
        "method": tuple(methods()),
        "system": tuple(systems()),
        "drive": ("steps", "steps back", "tolerance", "tolerance back", "matrix"),
        "numbers": ("float64", "float64 fused", "float32", "float32 fused"),
        "clock": ("zero", "later", "of each member"),
        "push": ("none", "force", "control", "projection"),
        "record": ("none", "energy"),
        "events": ("none", "seen", "stops", "changes"),
        "every": ("none", "one", "three"),
        "way": tuple(WAYS),
    }


def can_be_held(name: str) -> bool:
    """Whether the tests have a control for it: of an energy, a length or a norm."""
    system = system_of(name)
    return bool(system.constraint or "bodies" in name or (name.startswith("own") and "energy" in system.quantities))


def is_long(system: Any) -> bool:
    """Whether its step has so many operations that NumPy takes tenths of a second for one."""
    return bool(system.constraint) or np.prod(system.v_shape) + np.prod(system.y_shape) > 12


def goes(row: Row) -> bool:
    """Whether these options may go together: most of what docs/reference/options.md says of those that do not."""
    method = methods().get(row.get("method", ""))
    system = system_of(row["system"]) if "system" in row else None
    drive, numbers, push = (row.get(name, "") for name in ("drive", "numbers", "push"))
    matrix, tolerance, back, single = drive == "matrix", "tolerance" in drive, "back" in drive, "float32" in numbers
    events, energy, own = row.get("events", "none") != "none", row.get("record") == "energy", row.get("clock") == "of each member"
    way, every = row.get("way", ""), row.get("every")
    hard = method and (method.is_implicit or method.has_series)
    pieces = way in ("in pieces", "from a pickle", "from a file")
    return not (
        # A world has steps of one length from one time, and nothing ends it.
        (way == "in a world" and (tolerance or matrix or own or row.get("events") == "stops"))
        # Who was stopped within a step does not go on; of steps that are saved as they are made there is one time.
        or (pieces and (row.get("events") == "stops" or (tolerance and every not in (None, "none"))))
        or (matrix and (push not in ("", "none") or events))
        or (single and own and not tolerance)
        or (back and push == "control")
        or (method and tolerance and method.error_order is None)
        or (method and single and (method.has_series or method.splits))
        or (method and matrix and (method.kept or method.has_derivatives))
        or (method and method.is_exact and (push == "force" or events))
        or (system and matrix and not system.linear)
        or (system and tolerance and not _adaptive(system))
        or (system and back and (bounces(system) or system.has_stick_friction))
        or (system and energy and "energy" not in system.quantities)
        or (system and push == "force" and system.v_shape == (0,))
        # A change of v that a rod does not allow has no meaning.
        or (system and system.constraint == "length" and row.get("events") == "changes")
        # These go, and take the reference minutes.
        or (system and is_long(system) and events and ("fused" in numbers or (system.constraint and (tolerance or hard))))
        or (system and hard and ((is_long(system) and "fused" in numbers) or (bounces(system) and events)))
        or (system and push in ("control", "projection") and not can_be_held(row["system"]))
        or (method and system and (not fits(system, method) or (method.is_exact and not system.linear)))
    )


def works(row: Row) -> bool:
    """Whether two members can be stepped so."""
    system, method, options = built(row)
    asked = Asked(system, method, options, B).of(np.arange(2))
    shorter = {"steps": 1} if "steps" in options else {"max_steps": 3}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            asked.make(**shorter)
    except StepwellError:
        return False
    return True


def built(row: Row) -> tuple[Any, Any, dict[str, Any]]:
    """System, method and options of a row."""
    draw = np.random.default_rng(number(*sorted(row.items())))
    method, name = methods()[row["method"]], row["system"]
    system = system_of(name)
    v, y = (draw.normal(size=(*shape, B)) for shape in (system.v_shape, system.y_shape))
    if system.constraint == "length" or (method.has_series and name.startswith("springs")):
        v, y = 0.02 * v, 0.15 * y + _apart(system)
    h = (-1.0 if "back" in row["drive"] else 1.0) * (0.01 if name.endswith("newton") or method.splits else 0.05)
    options: dict[str, Any] = {"v": v, "y": y}
    if row["clock"] != "zero":
        options["t0"] = 0.3 if row["clock"] == "later" else np.linspace(-1.0, 2.0, B)
    every = {"none": None, "one": 1, "three": 3}[row["every"]]
    if "tolerance" in row["drive"]:
        at = options.get("t0", 0.0) + h * np.array([2.0, 3.5, 7.0, 9.0])[:, np.newaxis]
        at = at if row["clock"] == "of each member" else at[:, 0]
        options |= {"tolerance": 1e-3, "at": at if every is None else at[-1:], "every": every, "max_steps": 2000}
    else:
        options |= {"dt": h, "steps": 8, "every": every, "start_step": 12 if row["clock"] == "later" else None}
    if row["drive"] == "matrix":
        options["form"] = row["drive"]
    options |= {"fused": "fused" in row["numbers"], "dtype": row["numbers"].split()[0]}
    if row["push"] == "force":
        options["force"] = 0.1 * draw.normal(size=v.shape)
    if row["push"] in ("control", "projection"):
        kept = system.constraint or "energy"
        of_energy = sw.EnergyControl(0.3) if row["system"].count("bod") else sw.Control("energy", 0.3)
        control = {"length": sw.LengthControl(0.3), "norm": sw.NormControl(0.3)}.get(kept, of_energy)
        options["control"] = control if row["push"] == "control" else sw.Projection(kept)
    if row["record"] == "energy":
        options["record"] = "energy"
    if row["events"] != "none":
        options["events"] = event(system, row["events"])
    return system, method, {name: each for name, each in options.items() if each is not None}


def event(system: Any, kind: str) -> sw.Event:
    """Where a coordinate passes 0.2, which it does in some member: it is counted, ends the run, or changes the state.

    A change slows down what passes and does not turn it, else a force may bring it back in ever shorter times.
    """

    def height(y: Any) -> Any:
        return y[(0,) * len(system.y_shape)] - 0.2

    changes = kind == "changes"
    if system.v_shape == (0,):
        return sw.Event(lambda t, y: height(y), name="passed", terminal=kind == "stops" or None, then=_half if changes else None)
    then = (lambda t, v, y: (0.5 * v, y)) if changes else None
    if system.y_shape == (0,):
        return sw.Event(lambda t, v, y: v[0] - 0.2, name="passed", terminal=kind == "stops" or None, then=then)
    return sw.Event(lambda t, v, y: height(y), name="passed", terminal=kind == "stops" or None, then=then)


def _half(t: Any, y: Any) -> Any:
    return -0.5 * y


@cache
def rows() -> list[Row]:
    return covering(factors(), goes, works)


#: The rows are made in one process, and in so many parts of the test.
PARTS = 32


@pytest.mark.parametrize("part", range(PARTS))
def test_every_way_has_the_same_bits(part: int) -> None:
    for row in rows()[part::PARTS]:
        system, method, options = built(row)
        try:
            assert_equal_ways(system, method, ways=("by the reference", row["way"]), **options)
        except Exception as error:
            error.add_note(f"STEPWELL_SEED={seed()}: {row}")
            raise
