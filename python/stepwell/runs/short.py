"""Runs so short that all but their steps takes longer: it is checked and prepared once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from ..base import checks
from ..base.arrays import Array
from ..model.systems import System
from .findings import findings_of, is_heard
from .request import Request
from .result import Run
from .start import block_like

#: Return codes of the core: the run was not made; or it was, and no member has grown.
NOT_MADE, TAME = 0, 2


class ShortRun(ABC):
    """A prepared run of few steps, beside which all else takes longer, without its start and the numbers of its system.

    Attributes:
        system: the system of which it was prepared.
        request: the run as it was requested.
        numbers: those of that system.
        is_free: whether the run holds for other numbers, too.
    """

    def __init__(self, system: System, request: Request) -> None:
        self.system, self.request = system, request
        self._series = request.plan.method.has_derivatives
        # Comparisons of the time with parameters end steps.
        self.is_free = system.structure() is not None and not request.system.switches_by_time
        self.numbers: list[Array] = []
        if self.is_free:
            known = system.for_state_shapes(request.v, request.y)
            self.numbers = known.numbers_of_step(request.plan.batch, series=self._series)

    def run(self, v: Any, y: Any) -> Run | None:
        """The run from this start; None if it is to be made as any other."""
        return self._made(v, y, self.request.system, None)

    def run_of(self, system: System, v: Any, y: Any) -> Run | None:
        """The run of a system of the same structure, likewise."""
        if not self.is_free:
            return self.run(v, y) if system is self.system else None
        request = self.request
        if system is self.system:
            return self._made(v, y, request.system, self.numbers)
        numbers = system.numbers_of_step(request.plan.batch, series=self._series)
        if request.plan.single and any(np.abs(each).max(initial=0.0) > checks.LARGEST_SINGLE for each in numbers):
            return None  # others say what is wrong with them
        return self._made(v, y, request.system.with_numbers_of(system, request.v, request.y), numbers)

    @abstractmethod
    def _made(self, v: Any, y: Any, system: System, numbers: list[Array] | None) -> Run | None:
        """``numbers`` are those of the system; None if the core has no others."""

    def _findings(self, run: Run, v: Any, y: Any, system: System) -> None:
        """Look for findings, which a short run rarely has."""
        request = self.request
        plan = request.plan._replace(system=system)
        asked = request._replace(system=system, plan=plan, v=block_like(v, request.v), y=block_like(y, request.y))
        if findings := findings_of(run, asked, is_heard):
            run.findings = findings
