"""What the comparison of graphs covers, as runs of a device: every method, system, control and record in both precisions."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw
from stepwell import _core
from stepwell.device import device_of
from stepwell.errors import StepwellError
from stepwell.runs.execution import step
from stepwell.runs.options import Options
from stepwell.runs.request import Request

from support.cases import ADAPTIVE, SYSTEMS, fits, number
from support.devices import NAMES
from support.graphs import model
from support.tracing import ABLE, CONTROLS, METHODS

#: Members of a run: the first are ordinary, numbers of the others are often those of ``STRANGE``.
MEMBERS, ORDINARY = 24, 8
#: By the type of numbers: zeros, subnormal and tiny numbers, large ones whose squares are infinite, the largest, and none.
STRANGE = {
    kind.dtype.name: np.array(
        [
            0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, kind.smallest_subnormal, -5 * kind.smallest_subnormal, kind.tiny / 64,
            -kind.tiny, np.sqrt(kind.tiny), np.sqrt(kind.max) * 2, -np.sqrt(kind.max), kind.max / 4, -kind.max, kind.eps,
        ],
        np.float64,
    )
    for kind in map(np.finfo, (np.float64, np.float32))
}  # fmt: skip
#: Controls by what they are tried with: bodies, and an invariant of own equations.
CONTROLLED = {
    "bodies": CONTROLS,
    "own": {
        "own limited": sw.Control("energy", 0.3),
        "own printed": sw.Control("energy", 0.3, "printed"),
        "own projection": sw.Projection("energy"),
    },
}
#: The systems of which there are such controls.
PENDULUM = "own: pendulum"
BODIES = [name for name in SYSTEMS if "bod" in name and "restricted" not in name]
#: Operations of a step: a compiler takes longer than a second for more than the first, and minutes for more than the second.
SHORT, MOST = 1000, 5000


@cache
def made(name: str) -> sw.System:
    """A system with parameters of each member."""
    return SYSTEMS[name](np.random.default_rng(number(name)), MEMBERS)


class Proof(NamedTuple):
    """A run: by fixed or by adaptive steps, with a start of the method and a control, or None, in one arithmetic."""

    system: str
    method: str
    adaptive: bool = False
    start: str | None = None
    control: str | None = None
    single: bool = False
    fused: bool = False

    def __str__(self) -> str:
        kind = "adaptive" if self.adaptive else "fixed"
        words = (self.start, self.control, "float32" if self.single else None, "fused" if self.fused else None)
        return ", ".join([self.method, self.system, kind, *filter(None, words)])

    def operations(self) -> int:
        """About how many its step has, without those of a control."""
        return _core.operations(model(made(self.system), sw.method(self.method)))

    def runs(self) -> tuple[sw.Run, sw.Run]:
        """The run as the device of these tests makes it, and as the core does.

        It is asked for with ordinary numbers, and made with those that are refused to a user: a state of an earlier run has them.
        """
        rng = np.random.default_rng(number(self))
        request, kind = self.request(rng, None), np.finfo(np.float32 if self.single else np.float64)
        request = request._replace(v=_strange(rng, request.v, kind), y=_strange(rng, request.y, kind))
        machine = device_of(NAMES[0])
        device, core = (step(request._replace(plan=request.plan._replace(device=each))) for each in (machine, None))
        return device, core

    def request(self, rng: np.random.Generator, device: str | None) -> Request:
        """The run from an ordinary state, checked."""
        system = made(self.system)
        v, y = (rng.uniform(0.5, 1.0, (*shape, MEMBERS)) for shape in (system.v_shape, system.y_shape))
        control = next((each[self.control] for each in CONTROLLED.values() if self.control in each), None)
        dtype = "float32" if self.single else "float64"
        ask: dict[str, Any] = {"v": v, "y": y, "control": control, "fused": self.fused, "dtype": dtype, "device": device}
        if self.adaptive:
            ask |= {"tolerance": 1e-3, "at": [0.0, 0.07, 0.4], "max_steps": 12}
        else:
            ask |= {"dt": 0.1, "steps": 7, "every": 2, "start": self.start, "record": list(system.quantities)}
        return Request.of(system, sw.method(self.method), Options(**ask))

    def refusal(self, device: str | None = None) -> str:
        """Why the run is refused, or nothing."""
        try:
            self.request(np.random.default_rng(0), device)
        except StepwellError as error:
            return f"{type(error).__name__}: {error}"
        return ""

    def shows(self) -> set[Any]:
        """What it shows: that a method, a family of systems and a control go with its numbers and steps; and each record."""
        system = made(self.system)
        family = type(system).__name__
        words = ("method", self.method, self.start), ("family", family), ("control", self.control)
        ways = ("numbers", self.single, self.fused), ("steps", self.adaptive)
        return {*itertools.product(words, ways), *((family, each) for each in system.quantities)}

    def parts(self) -> set[Any]:
        """The same by itself: methods and families with each kind of steps, controls with each precision."""
        system = made(self.system)
        family = type(system).__name__
        words = {("method", self.method, self.start, self.adaptive), ("family", family, self.adaptive)}
        words |= {("control", self.control, self.single), ("numbers", self.single, self.fused, self.adaptive)}
        return words | {(family, each) for each in system.quantities}


def _strange(rng: np.random.Generator, block: Any, kind: Any) -> Any:
    """A block of a state with strange numbers among those of most members."""
    ordinary = rng.normal(size=block.shape) * rng.choice([0.1, 1.0, 10.0], MEMBERS)
    among = rng.uniform(size=block.shape) < np.where(np.arange(MEMBERS) < ORDINARY, 0.0, rng.uniform(0.1, 1.0, MEMBERS))
    return np.where(among, rng.choice(STRANGE[kind.dtype.name], block.shape), ordinary)


def every() -> Iterator[Proof]:
    """All of them; numbers are fused in every other one."""
    for single in (False, True):
        able = [method.name for method in METHODS if not (single and method.has_series)]
        for name in SYSTEMS:
            one = SYSTEMS[name](np.random.default_rng(0), 1)
            controls = [None, *(CONTROLLED["bodies"] if name in BODIES else CONTROLLED["own"] if name == PENDULUM else ())]
            for method, control in itertools.product(able, controls):
                record = sw.method(method)
                if not fits(one, record) or (control is not None and record.carry):
                    continue
                for start in record.starts or (None,):
                    yield _either(Proof(name, method, False, start, control, single))
                if name in ADAPTIVE and record in ABLE:
                    yield _either(Proof(name, method, True, None, control, single))


def _either(proof: Proof) -> Proof:
    """It, or it with numbers that are fused."""
    return proof._replace(fused=number(proof) % 2 == 0)


def chosen() -> set[Proof]:
    """Some that show all of it, those whose steps are long left out: first those that show much that is new, then the rest."""
    return _covering(sorted(every(), key=number), Proof.shows, lambda proof: not proof.refusal() and proof.operations() <= SHORT)


def few(among: set[Proof]) -> set[Proof]:
    """Those that show each method, family, control, record and kind of numbers, though not in each pair; short steps first."""
    return _covering(sorted(among, key=lambda proof: (proof.operations(), str(proof))), Proof.parts, lambda _: True)


def _covering(proofs: list[Proof], shows: Callable[[Proof], set[Any]], is_able: Callable[[Proof], bool]) -> set[Proof]:
    """Those that are able that show what all show, first those that show much that is new."""
    shown: set[Any] = set()
    taken = set()
    for least in (7, 5, 3, 1):
        for proof in proofs:
            if len(shows(proof) - shown) >= least and is_able(proof):
                shown |= shows(proof)
                taken.add(proof)
    return taken
