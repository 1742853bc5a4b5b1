"""A system together with its variational equations: a motion, and disturbances of it that are infinitesimal."""

from __future__ import annotations

from ...errors import UnsupportedError
from ...model.derivatives.columns import Differentiated
from ...model.derivatives.traced import Traced
from ...model.systems import System
from ...reference.acceptance import NO_GROUP, Acceptance
from ..stability import maps

#: The most operations of the rates and of the rates of all disturbances together.
MAX_OPERATIONS = 100_000


class Variational(Differentiated):
    """A system with disturbances: its velocities are v, its coordinates are y followed by the disturbances.

    A disturbance is a vector like (v, y). The first numbers of all disturbances come first, then the second, and so on. The rate
    of a disturbance is the derivative of the system's rates along it. The method must treat both blocks alike.

    With a tolerance the errors of disturbances count as those of y if they are ``judged``. Else the steps are those of the system
    alone, to the bit; but to rounding for a ``second_order`` one by Rosenbrock's methods, which solve smaller equations for it.
    Disturbances are then the derivative of these steps, which may be far too long for them where the motion rests.
    """

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
        rates = traced.along(disturbances)
        self._take(traced, rates, rates[n_v:])

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
