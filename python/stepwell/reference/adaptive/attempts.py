"""An attempt at a step, before it is decided whether it counts: how it uses a system, and the stages of a method."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from ...base.arrays import Array, Scaled
from .. import tableau
from ..around import Bound, wrapped
from ..tableau import Increments, Weights, polynomial


class Pair(Protocol):
    """A method that estimates its error: its file in ``steppers/``, which may have weights ``COARSE`` of a second estimate."""

    WEIGHTS: Weights
    ERROR: Weights

    def stages(self, s: Any, t: Any, h: Any, v: Array, y: Array, /) -> Increments:
        """The increments of all stages; time and step are each member's own."""

    def extension(self, s: Any, t: Any, h: Any, v: Array, y: Array, /) -> Increments:
        """The coefficients of the powers of θ in the state at the share θ of the step, of those methods that have one."""


class Stretched:
    """A system scaled to a step of 1, stretched to each member's step."""

    def __init__(self, s: Scaled, h: Array) -> None:
        self.s, self.h = s, h
        self.fixed = getattr(s, "fixed", ())
        self.mass_matrix = getattr(s, "mass_matrix", None)

    def dv(self, t: Array, v: Array, y: Array) -> Array:
        """h·v̇."""
        return self.h * self.s.dv(t, v, y)  # type: ignore[arg-type, operator]  # a time for each member

    def dy(self, t: Array, v: Array, y: Array) -> Array:
        """h·ẏ."""
        return self.h * self.s.dy(t, v, y)  # type: ignore[arg-type, operator]

    def energies(self, v: Array, y: Array) -> tuple[Array, Array, Array]:
        """h·v̇, h times the kinetic energy, and h times the whole energy."""
        dv, kinetic, whole = self.s.energies(v, y)  # type: ignore[attr-defined]
        return self.h * dv, self.h * kinetic, self.h * whole


class Attempted:
    """How an attempt uses a system: its rates for a step, with what acts on them, and the projection of the state after it.

    ``s`` is the system scaled to a step of 1. What is around it and acts on rates needs the step; a projection does not.

    Attributes:
        unit: the rates for a step of 1, with all that acts on them but a control.
    """

    def __init__(self, s: Any, parts: Sequence[Bound] = ()) -> None:
        scaled = [part for part in parts if part[0].is_scaled]
        s = Backward(wrapped(s.s, -1.0, scaled)) if isinstance(s, Backward) and scaled else wrapped(s, 1.0, scaled)
        self.s = s
        parts = [part for part in parts if not part[0].is_scaled]
        self.acting = [part for part in parts if part[0].acts_on_rates]
        # A projection asks for energies and gradients, which do not know that time runs backward: both have the step −1.
        state, step = (s.s, -1.0) if isinstance(s, Backward) else (s, 1.0)
        self.projected = wrapped(state, step, [part for part in parts if not part[0].acts_on_rates])
        self.unit = self._acting(s, 1.0, without="control")

    def rates(self, step: Any) -> Any:
        """The rates for a step, which may be another for each member."""
        stretched = self.s.stretched(step) if hasattr(self.s, "stretched") else Stretched(self.s, step)
        return self._acting(stretched, step)

    def _acting(self, rates: Any, step: Any, without: str = "") -> Any:
        """Rates with what acts on them; where time runs backward, that sees the step and the time of the system."""
        parts = [part for part in self.acting if part[0].kind != without]
        if not parts or not isinstance(self.s, Backward):
            return wrapped(rates, step, parts)
        return Backward(wrapped(Backward(rates), -step, parts))

    def project(self, v: Array, y: Array) -> tuple[Array, Array, Any]:
        """The state after the step, and the energy that this added; None without a projection."""
        if not hasattr(self.projected, "project"):
            return v, y, None
        if not hasattr(self.projected, "work"):
            return *self.projected.project(v, y), None
        self.projected.work = 0.0
        v, y = self.projected.project(v, y)
        work = self.projected.work
        return v, y, -work if isinstance(self.s, Backward) else work


class Backward:
    """A system whose time runs backward: ``s`` is scaled to a step of −1, and the time is that of the run, negated."""

    def __init__(self, s: Any) -> None:
        self.s = s
        if hasattr(s, "stretched"):
            self.stretched = lambda h: Backward(s.stretched(-h))
        if hasattr(s, "project"):
            self.project = s.project
        self.mass_matrix = getattr(s, "mass_matrix", None)
        self.fixed = getattr(s, "fixed", ())

    def dv(self, t: Any, v: Array, y: Array) -> Any:
        """−h·v̇."""
        return self.s.dv(-t, v, y)

    def dy(self, t: Any, v: Array, y: Array) -> Any:
        """−h·ẏ."""
        return self.s.dy(-t, v, y)


class Tried(NamedTuple):
    """The result of an attempt before it is decided whether it counts.

    Attributes:
        v: velocities after the step.
        y: coordinates after the step.
        errors: one or two estimates of their error.
        projected: the state after the step as a projection leaves it.
        work: the energy that a control or projection added, or None.
    """

    v: Array
    y: Array
    errors: list[tuple[Array, Array]]
    projected: tuple[Array, Array]
    work: Any


def tried(pair: Pair, system: Attempted, t: Any, step: Any, v: Array, y: Array, axes: tuple[int, int] | None = None) -> Tried:
    """The stages of an attempt, and what follows from them by their weights; ``axes`` is how many axes a member's blocks have."""
    s = system.rates(step)
    if axes is not None:
        s.axes = axes
    errors: list[tuple[Array, Array]]
    if hasattr(pair, "attempt"):  # a user's method, which is not a tableau
        v1, y1, *error = pair.attempt(s, t, step, v, y)
        errors = [(error[0], error[1])]
    else:
        increments = pair.stages(s, t, step, v, y)
        v1, y1 = tableau.plus(v, y, pair.WEIGHTS, increments)
        weights = [pair.ERROR, *([coarse] if (coarse := getattr(pair, "COARSE", None)) else [])]
        errors = [tableau.combined(each, increments) for each in weights]
    v2, y2, work = system.project(v1, y1)
    return Tried(v1, y1, errors, (v2, y2), s.work / step if hasattr(s, "work") else work)


def within(terms: Increments, v: Array, y: Array, share: Any) -> tuple[Array, Array]:
    """The state at that share of a step from v and y, by the coefficients of its powers."""
    of_v, of_y = ([term[i] for term in terms] for i in range(2))
    return v + polynomial(0.0, of_v, share), y + polynomial(0.0, of_y, share)
