"""Members that have steps of their own and are stepped together: the step is a number of each, and the clock counts steps."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...model.inputs import Sampled
from ...model.methods import Method
from ...model.systems import System
from ...runs import engine
from ...runs.options import Options
from ...runs.request import Request
from ...runs.result import Run
from ...runs.start import last_time
from .outcomes import Extremes, Last, Outcome

#: The most numbers of a state: the step is one tape, whatever it would be with one length.
MOST_NUMBERS = 32

#: Options that change operations by the length of a step, or are computed in Python from it.
WITH_ONE_LENGTH = ("control", "force", "events", "dtype")


def together(system: System, method: Method, outcomes: tuple[Outcome, ...], options: dict[str, Any]) -> bool:
    """True if members that have fixed steps of their own are stepped together, with the bits that each has alone."""
    simple = not options["fused"] and not any(name in options for name in WITH_ONE_LENGTH)
    bare = not system.around and system.mass_matrix is None and not method.is_exact
    held = any(isinstance(each, Sampled) for each in system.all_inputs().values())
    small = prod(system.v_shape) + prod(system.y_shape) <= MOST_NUMBERS
    return simple and bare and not held and small and all(map(_sees_states_alone, outcomes))


def _sees_states_alone(outcome: Outcome) -> bool:
    """True if an outcome needs neither times nor the length of a step."""
    if isinstance(outcome, Extremes):
        return outcome.of is None or isinstance(outcome.of, tuple) or outcome.of in ("v", "y")
    return isinstance(outcome, Last)


class Lengths:
    """The run of such members in pieces, each from where the one before ended."""

    def __init__(self, system: System, method: Method, options: dict[str, Any], lengths: Array, steps: int) -> None:
        for each in (lengths.min(), lengths.max()):
            last_time(options["t0"], float(each), 0, steps)
        request = Request.of(system, method, Options(steps=1, **(options | {"dt": float(lengths[0])})))
        self._system, self._start = request.system, request.start
        self._plan = request.plan._replace(dt=1.0, lengths=lengths)
        self._v, self._y, self._carried = request.v, request.y, request.carried
        self._before: Any = None

    def make(self, steps: int, every: int | None, observer: Any = None, **_: Any) -> Run:
        """The next piece."""
        plan = self._plan._replace(steps=steps, every=every, observer=observer)
        assert plan.lengths is not None
        out = engine.advance(plan, self._v, self._y, self._before, carried=self._carried)
        lengths: Any = plan.lengths
        run = Run(
            t=plan.t0 + (plan.first + plan.saves)[:, np.newaxis] * lengths,
            v=out.v,
            y=out.y,
            status=np.asarray(out.first_bad >= 0).view(np.int8),
            first_bad_step=out.first_bad,
            carry=out.slot if plan.method.begins else None,
            system=self._system,
            method=plan.method,
            dt=lengths,
            t0=plan.t0,
            start_step=plan.first,
            steps=steps,
            start=self._start,
        )
        self._v, self._y, self._carried, self._before = out.slot, out.y[-1], True, out.first_bad
        self._plan = plan._replace(first=plan.first + steps)
        return run
