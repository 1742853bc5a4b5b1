"""The pictures of a system on the page: its motion, its energy, and the pairs of numbers that span a phase plane."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ...model.surfaces import Floor
from ...model.systems import System

#: The axes of space, by their number.
AXES = "xyz"

#: The most points of which each coordinate is offered for the phase plane.
MAX_PHASE_POINTS = 6


def motion(system: System) -> dict[str, Any]:
    """The picture of the motion: its kind, and the data that this kind needs."""
    match system.kernel:
        case "oscillator" if not system.v_shape:
            return {"kind": "spring" if float(system.omega) else "block"}  # type: ignore[attr-defined]
        case "pendulum":
            return {"kind": "pendulum"}
        case "chain":
            return {"kind": "chain"}
        case "rigid_body":
            return {"kind": "body", "inertia": numbers(system.inertia)}  # type: ignore[attr-defined]
        case "restricted_three_body":
            mu = float(system.mu)  # type: ignore[attr-defined]
            return {"kind": "points", "dim": 2, "marks": [[-mu, 0.0], [1.0 - mu, 0.0]]}
        case "pendulum_3d":
            return {"kind": "points", "dim": 3, "anchors": [[0.0, 0.0, 0.0]], "links": [[-1, 0]]}
    if len(system.y_shape) == 2 and system.y_shape[1] in (2, 3) and system.v_shape == system.y_shape:
        return {"kind": "points", "dim": system.y_shape[1], **_around(system)}
    return {"kind": "curves"}


def _around(system: Any) -> dict[str, Any]:
    """Rods, springs and floors of points; an anchor i has the number −1 − i."""
    parts: dict[str, Any] = {}
    if system.kernel == "springs":
        parts["links"] = np.asarray(system.pairs).tolist()
    if system.kernel == "rods":
        anchors = [list(map(float, each)) for each in system.anchors]
        number = {tuple(each): -1 - i for i, each in enumerate(anchors)}
        parts["anchors"] = anchors
        parts["links"] = [[end if isinstance(end, int) else number[tuple(map(float, end))] for end in rod] for rod in system.rods]
    floors = [each for each in getattr(system, "contacts", ()) or () if isinstance(each, Floor)]
    if len(floors) == 1 and floors[0].normal is None:
        parts["floor"] = float(floors[0].offset)
    return parts


def energy(system: Any) -> dict[str, Any] | None:
    """The energy as the page computes it: a kind, and its parameters; None where the page has no formula."""
    match system.kernel:
        case "oscillator":
            return {"kind": "oscillator", "omega": 1.0 if system.form == "canonical" else float(system.omega)}
        case "pendulum":
            return {"kind": "pendulum", "omega": float(system.omega)}
        case "chain":
            k, m = (numbers(each) for each in system.equation_parameters(()).values())
            return {"kind": "chain", "stiffness": k, "mass": m}
        case "nbody" if not system.contacts:
            own = {"law": system.force, "softening": float(system.softening), "dim": system.y_shape[1]}
            return {"kind": "bodies", "masses": numbers(system.masses), "Gm": numbers(system.G * system.masses), **own}
        case "particles":
            parameters = system.equation_parameters(())
            return {"kind": "falling", "masses": numbers(parameters["masses"]), "gravity": numbers(parameters["gravity"])}
        case "restricted_three_body":
            return {"kind": "restricted", "mu": float(system.mu)}
        case "pendulum_3d":
            return {"kind": "falling", "masses": [1.0], "gravity": [0.0, 0.0, -float(system.gravity)]}
        case "rods":
            down = [0.0] * (system.y_shape[1] - 1) + [-float(system.gravity)]
            return {"kind": "falling", "masses": numbers(system.masses), "gravity": down}
        case "springs":
            free = [float(i not in set(np.asarray(system.fixed).tolist())) for i in range(system.n)]
            pull = {"gravity": np.zeros(system.y_shape[1]) if system.gravity is None else system.acceleration}
            springs = {"stiffness": _each(system.stiffness, len(system.pairs)), "rest": _each(system.rest, len(system.pairs))}
            return {
                "kind": "springs",
                "pairs": np.asarray(system.pairs).tolist(),
                "masses": _each(system.masses, system.n),
                "free": free,
                **springs,
                **{name: numbers(each) for name, each in pull.items()},
            }
        case "rigid_body":
            centre = None if system.centre is None else numbers(system.centre)
            weight = 0.0 if system.weight is None else float(system.weight)
            return {"kind": "body", "inertia": numbers(system.inertia), "weight": weight, "centre": centre or [0.0, 0.0, 0.0]}
    return None


#: The names of the points or numbers of a block, by the system's kernel.
OWNERS = {"nbody": "body", "chain": "mass"}

#: Systems of a single point whose blocks have no axis for points.
SINGLE_POINTS = ("pendulum_3d", "restricted_three_body")


def phase_planes(system: System) -> list[dict[str, Any]]:
    """The possible pairs of a phase plane: a label, and for each axis the block, the index and the symbol of its number."""
    v_shape, y_shape = system.v_shape, system.y_shape
    if system.kernel == "rigid_body":
        return [_plane(f"ω{a}", ("v", a - 1), f"ω{b}", ("v", b - 1)) for a, b in ((1, 2), (2, 3), (3, 1))]
    if v_shape == y_shape:
        most = MAX_PHASE_POINTS * (y_shape[1] if len(y_shape) == 2 else 1)
        return [_own_plane(system, i) for i in range(min(prod(y_shape), most))]
    block, shape = ("y", y_shape) if prod(y_shape) else ("v", v_shape)
    last = min(1, prod(shape) - 1)
    return [_plane(f"{block}[0]", (block, 0), f"{block}[{last}]", (block, last))]


def _own_plane(system: System, i: int) -> dict[str, Any]:
    """The velocity of a coordinate over that coordinate."""
    shape, axis = system.y_shape, None
    if len(shape) == 2:
        count, (which, axis) = shape[0], divmod(i, shape[1])
    elif system.kernel in SINGLE_POINTS:
        count, which, axis = 1, 0, i
    else:
        count, which = prod(shape), i
    symbol = "y" if axis is None else AXES[axis] if axis < len(AXES) else f"y[{axis}]"
    owner = OWNERS.get(system.kernel, "number" if axis is None else "point")
    return _plane(symbol, ("y", i), "v", ("v", i), f", {owner} {which + 1}" if count > 1 else "")


def _plane(right: str, of_right: tuple[str, int], up: str, of_up: tuple[str, int], whose: str = "") -> dict[str, Any]:
    sides = {"right": [*of_right, right], "up": [*of_up, up]}
    return {"label": f"{up} over {right}{whose}", **sides}


def numbers(values: Any) -> list[float]:
    """Floats of an array of one axis."""
    return [float(each) for each in np.ravel(values)]


def _each(values: Any, n: int) -> list[float]:
    return numbers(np.broadcast_to(np.ravel(values), (n,)) if np.size(values) == 1 else values)
