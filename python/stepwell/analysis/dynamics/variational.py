"""A system together with its variational equations: a motion, and disturbances of it that are infinitesimal."""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import _core
from ...base.arrays import Array, Shape
from ...errors import UnsupportedError
from ...model.derivatives.traced import Traced
from ...model.equations.series import derivatives_of_functions
from ...model.inputs import Input
from ...model.parameters import CoreParameters, flat
from ...model.systems import System
from ...model.systems.own import RATES
from ...reference.acceptance import NO_GROUP, Acceptance
from ...reference.tape.evaluate import Evaluation
from ...reference.traced import Tracer
from ..stability import maps

#: The most operations of the rates and of the rates of all disturbances together.
MAX_OPERATIONS = 100_000


class _Rates:
    """The rates by NumPy, scaled to a step."""

    def __init__(self, h: float, evaluation: Evaluation, n_v: int) -> None:
        self.h, self.evaluation, self.n_v = h, evaluation, n_v

    def dv(self, t: Any, v: Array, y: Array) -> Array:
        return self._rates(t, v, y)[: self.n_v]

    def dy(self, t: Any, v: Array, y: Array) -> Array:
        return self._rates(t, v, y)[self.n_v :]

    def _rates(self, t: Any, v: Array, y: Array) -> Array:
        rows = [*v, *y]
        rates = np.empty((len(rows), *np.broadcast_shapes(*map(np.shape, rows))))
        for i, rate in enumerate(self.evaluation(rows, t)):
            rates[i] = self.h * rate
        return rates


class Variational(System):
    """A system with disturbances: its velocities are v, its coordinates are y followed by the disturbances.

    A disturbance is a vector like (v, y). The first numbers of all disturbances come first, then the second, and so on. The rate
    of a disturbance is the derivative of the system's rates along it. The method must treat both blocks alike.

    With a tolerance the errors of disturbances count as those of y if they are ``judged``. Else the steps are those of the system
    alone, to the bit; but to rounding for a ``second_order`` one by Rosenbrock's methods, which solve smaller equations for it.
    Disturbances are then the derivative of these steps, which may be far too long for them where the motion rests.
    """

    kernel = "equations"
    reference = _Rates
    second_order = False

    def __init__(self, system: System, disturbances: int, *, judged: bool = True) -> None:
        if system.keeper is not None or system.around:
            raise UnsupportedError(
                f"tolerance: Lyapunov exponents of a system with a control, a surface or friction need fixed steps, got "
                f"{system!r}; give dt= and steps="
            )
        self.of, self.disturbances, self.judged = system, disturbances, judged
        n_v, n_y = maps.size(system)
        self.v_shape, self.y_shape = (n_v,), (n_y + (n_v + n_y) * disturbances,)
        self.batch = system.batch
        traced = Traced(system, "rates")
        operations = (1 + 3 * disturbances) * len(traced.tape)
        if operations > MAX_OPERATIONS:
            raise UnsupportedError(
                f"exponents: with a tolerance expected at most {MAX_OPERATIONS:,} operations for the rates of the system and of "
                f"its disturbances, got about {operations:,} for {disturbances} disturbances of {system!r}; ask for fewer"
            )
        self._tape, self._rates = traced.tape, traced.along(disturbances)
        functions = derivatives_of_functions(traced.tape, traced.marks)
        self._core = traced.tape.equations(self._rates[:n_v], self._rates[n_v:], [], None, functions)

    @property
    def groups(self) -> tuple[int, ...]:
        """The two blocks; or those of the system, and none for disturbances that are not judged."""
        if self.judged:
            return ()
        n_v, n_y = maps.size(self.of)
        return Acceptance(self.of.groups).of_numbers(n_v, n_y) + (NO_GROUP,) * ((n_v + n_y) * self.disturbances)

    def repr_arguments(self) -> list[str]:
        """The system, and the number of disturbances."""
        return [repr(self.of), str(self.disturbances)]

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The parameters of the system."""
        return self.of.own_parameters(batch)

    def parameters(self, batch: Shape, *, series: bool = False, single: bool = False) -> CoreParameters:
        """The operations of all rates, and the parameters of the system."""
        values = {name: value for name, value in self.own_parameters(batch).items() if name != RATES and not callable(value)}
        return [(RATES, self._core), *flat(values, batch)]

    def reference_at_step(self, h: float, batch: Shape) -> Any:
        """The rates by NumPy."""
        tracer = Tracer(self.of, _core.Tape())
        for value in self.own_parameters(batch).values():
            tracer.symbols(value, batch)  # which collects their numbers
        evaluation = Evaluation(self._tape, self._rates, dict(enumerate(tracer.numbers)), tracer.tables)
        return _Rates(h, evaluation, maps.size(self.of)[0])

    def given_inputs(self) -> dict[str, Input]:
        """The inputs of the system."""
        return self.of.given_inputs()
