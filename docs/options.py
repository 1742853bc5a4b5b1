"""Which options of a run go together, found by trying: every option with every kind of system, and every pair of options."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
import stepwell as sw
from stepwell import _core
from stepwell.device import adaptive, fixed, opencl

#: Members of each run, and its steps.
MEMBERS, STEPS, DT = 2, 4, 0.01

#: Options that are given again with each piece of a run; the others go on with it.
OF_A_PIECE = ("every", "record", "events", "form", "backend", "device")

Request = dict[str, Any]


class Kind(NamedTuple):
    """A kind of system: how to make one, its coordinates at the start, the control and the projection that it can be under."""

    name: str
    make: Callable[[], sw.System]
    y: Any
    control: Any = sw.EnergyControl(0.3)
    projection: Any = sw.Projection()


@sw.system
def swing(t: Any, v: Any, y: Any, *, omega: float = 1.0) -> Any:
    """A pendulum of own equations."""
    return -(omega**2) * np.sin(y)


@swing.invariant
def energy(v: Any, y: Any, *, omega: float = 1.0) -> Any:
    """Its energy."""
    return 0.5 * v**2 - omega**2 * np.cos(y)


@sw.system(order=1, shape=(3,))
def lorenz(t: Any, y: Any) -> Any:
    """Own equations of first order."""
    return np.array(
        [
            10.0 * (y[1] - y[0]),
            y[0] * (28.0 - y[2]) - y[1],
            y[0] * y[1] - 8.0 / 3.0 * y[2],
        ]
    )


def _blocks(*rows: Any) -> Any:
    return np.repeat(np.array(rows, dtype=float)[..., np.newaxis], MEMBERS, axis=-1)


KINDS = (
    Kind("oscillator", lambda: sw.Oscillator(form="physical"), np.ones(MEMBERS)),
    Kind(
        "sampled input",
        lambda: sw.Oscillator(
            a=sw.Sampled([0.0, 1.0, 0.5], interval=0.02), form="physical"
        ),
        np.ones(MEMBERS),
    ),
    Kind(
        "sticking friction",
        lambda: sw.Oscillator(friction=0.1, form="physical"),
        np.ones(MEMBERS),
    ),
    Kind("matrices", lambda: sw.LinearSystem([[0.0, -1.0], [1.0, 0.0]]), _blocks(1.0)),
    Kind("bodies", lambda: sw.NBody([1.0, 1.0]), _blocks([0.0, 0.0], [1.0, 0.0])),
    Kind(
        "rods",
        lambda: sw.Rods([1.0], [[[0.0, 0.0], 0]], [1.0]),
        _blocks([1.0, 0.0]),
        sw.LengthControl(0.5),
        sw.Projection("length"),
    ),
    Kind(
        "rigid body",
        lambda: sw.RigidBody([1.0, 2.0, 3.0]),
        _blocks(1.0, 0.0, 0.0, 0.0),
        sw.NormControl(1.0),
        sw.Projection("norm"),
    ),
    Kind(
        "springs",
        lambda: sw.Springs([[0, 1]], stiffness=1.0, rest=1.0, dim=2),
        _blocks([0.0, 0.0], [1.0, 0.0]),
    ),
    Kind(
        "points on a floor",
        lambda: sw.Particles(gravity=9.81, floor=sw.Floor(), dim=2),
        _blocks([0.0, 1.0]),
    ),
    Kind(
        "own equations",
        lambda: swing(),
        np.ones(MEMBERS),
        sw.Control("energy", 0.3),
        sw.Projection("energy"),
    ),
    Kind("own, first order", lambda: lorenz(), _blocks(1.0, 1.0, 1.0)),
)


def _event(kind: Kind, **options: Any) -> sw.Event:
    """Where a coordinate falls to ½, which it does not do in so short a run."""
    place = (0,) * (np.ndim(kind.y) - 1)
    if kind.name == "own, first order":
        return sw.Event(lambda t, y: y[place] - 0.5, name="half", **options)
    return sw.Event(
        lambda t, v, y: (y[place] if place else y) - 0.5, name="half", **options
    )


def _as_it_is(kind: Kind) -> Any:
    return (
        (lambda t, y: y)
        if kind.name == "own, first order"
        else (lambda t, v, y: (v, y))
    )


def _with(**options: Any) -> Callable[[Kind, Request], None]:
    return lambda kind, request: request.update(options)


#: What can be asked of a run, by the name in the tables. Options that set the same argument exclude each other.
OPTIONS: dict[str, Callable[[Kind, Request], None]] = {
    "tolerance": _with(tolerance=1e-3),
    "every": _with(every=2),
    "backward": _with(backward=True),
    "own t0": _with(t0=np.array([0.0, 0.5])),
    "resume": _with(resume=True),
    "leapfrog": _with(method="leapfrog"),
    "taylor": _with(method="taylor"),
    "matrix": _with(form="matrix"),
    "force": _with(force=0.1),
    "control": lambda kind, request: request.update(control=kind.control),
    "projection": lambda kind, request: request.update(control=kind.projection),
    "energy": _with(record="energy"),
    "sensitivity": _with(sensitivity="y"),
    "events": lambda kind, request: request.update(events=_event(kind)),
    "then": lambda kind, request: request.update(
        events=_event(kind, then=_as_it_is(kind))
    ),
    "fused": _with(fused=True),
    "float32": _with(dtype="float32"),
    "numpy": _with(backend="numpy"),
    "device": _with(device="opencl"),
}


def _request(kind: Kind, names: tuple[str, ...]) -> Request | None:
    """The request with these options; None if they exclude each other."""
    request: Request = {}
    for name in names:
        before = set(request)
        own: Request = {}
        OPTIONS[name](kind, own)
        if before & set(own):
            return None
        request |= own
    return request


def _run(kind: Kind, request: Request) -> None:
    """Make a short run, in two pieces where that is asked for."""
    options = {"method": "dop853" if "tolerance" in request else "rk4"} | request
    sign = -1.0 if options.pop("backward", False) else 1.0
    pieces, t0 = 2 if options.pop("resume", False) else 1, options.get("t0", 0.0)
    system, method = kind.make(), options.pop("method")
    start: Request = {"v": 0.0, "y": kind.y}
    for piece in range(pieces):
        if "tolerance" in request:
            steps: Request = {"at": np.array([t0 + sign * DT * STEPS * (piece + 1)])}
        else:
            steps = {"steps": STEPS} if piece else {"dt": sign * DT, "steps": STEPS}
        run = sw.integrate(system, method, **start | options | steps)
        start, options = (
            {"resume": run},
            {name: value for name, value in options.items() if name in OF_A_PIECE},
        )


def refusal(kind: Kind, names: tuple[str, ...]) -> str | None:
    """Why a run with these options is refused, or None if it is made; "" if they exclude each other by nature."""
    if (request := _request(kind, names)) is None:
        return ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            _run(kind, request)
        except sw.errors.StepwellError as error:
            return str(error)
    return None


#: What the tables say of what is made, and of options that set the same argument.
WORKS, EXCLUDES = "●", "·"


class Reasons:
    """The reasons of refusals, each with a number, in the order in which they come."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def number(self, kind: Kind, text: str) -> int:
        """The number of a reason, in which the system of a kind and its controls are called so."""
        system = repr(kind.make())
        for each, name in (
            (kind.control, "the control"),
            (kind.projection, "the projection"),
        ):
            text = text.replace(f"{system[:-1]}, {each!r})", "the system").replace(
                repr(each), name
            )
        return self._numbers.setdefault(
            text.replace(system, "the system"), len(self._numbers) + 1
        )

    def listed(self) -> Iterator[str]:
        """A line for each."""
        for text, number in self._numbers.items():
            plain = text.replace("*", "\\*").replace("|", "\\|")
            yield f"{number}. {plain}\n"


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |\n"


def _of_kinds(
    alone: dict[tuple[str, str], str | None], reasons: Reasons
) -> Iterator[str]:
    """The table of options and kinds of systems."""
    yield _row("", *(kind.name for kind in KINDS))
    yield _row(*["---"] * (len(KINDS) + 1))
    for option in OPTIONS:
        each = ((kind, alone[option, kind.name]) for kind in KINDS)
        yield _row(
            f"`{option}`",
            *(
                WORKS if why is None else str(reasons.number(kind, why))
                for kind, why in each
            ),
        )


def _of_pairs(
    alone: dict[tuple[str, str], str | None], reasons: Reasons
) -> Iterator[str]:
    """The table of pairs of options, with the kinds of systems that work with each of both."""
    names = list(OPTIONS)
    yield _row("", *(f"`{name}`" for name in names[:-1]))
    yield _row(*["---"] * len(names))
    for i, option in enumerate(names[1:], 1):
        cells = [""] * (len(names) - 1)
        for j, other in enumerate(names[:i]):
            able = [
                kind
                for kind in KINDS
                if alone[option, kind.name] is None and alone[other, kind.name] is None
            ]
            refused = [(kind, refusal(kind, (other, option))) for kind in able]
            if not able or any(why == "" for _, why in refused):
                cells[j] = EXCLUDES
                continue
            works = [WORKS] if any(why is None for _, why in refused) else []
            numbers = dict.fromkeys(
                str(reasons.number(kind, why)) for kind, why in refused if why
            )
            cells[j] = " ".join([*works, *numbers])
        yield _row(f"`{option}`", *cells)


class Anywhere:
    """In place of a device: kernels are printed, which refuses what cannot be, and the core makes the steps.

    So the tables are the same on a machine without any device.
    """

    described = sw.Device("opencl:0", "any device", "OpenCL", 1 << 34, 1)

    @staticmethod
    def run(_: Any, model: Any, plan: Any, arrays: Any) -> bool:
        """As ``device.fixed.run``."""
        fixed.text_of(model, plan.single, plan.choice)
        return bool(_core.run(model, plan, arrays))

    @staticmethod
    def adapt(_: Any, model: Any, plan: Any, pacing: Any, arrays: Any) -> bool:
        """As ``device.adaptive.adapt``."""
        adaptive.text_of(model, plan, len(arrays.paces))
        return bool(_core.adapt(model, plan, pacing, arrays))


@contextmanager
def anywhere() -> Iterator[None]:
    """Within this context there is a device, with or without one."""
    with (
        mock.patch.object(opencl, "machines", return_value=[Anywhere()]),
        mock.patch.object(fixed, "run", Anywhere.run),
        mock.patch.object(adaptive, "adapt", Anywhere.adapt),
    ):
        yield


def tables() -> str:
    """Both tables, and the reasons below them."""
    reasons = Reasons()
    with anywhere():
        return "".join(_all(reasons))


def _all(reasons: Reasons) -> list[str]:
    alone = {
        (option, kind.name): refusal(kind, (option,))
        for option in OPTIONS
        for kind in KINDS
    }
    return [
        *_of_kinds(alone, reasons),
        "\n",
        *_of_pairs(alone, reasons),
        "\n",
        *reasons.listed(),
    ]
