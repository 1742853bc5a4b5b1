"""The methods and their metadata, read from the records in the core."""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any, Protocol, cast, overload

from .. import _core
from ..base import checks, registry
from ..base.arrays import Array, Blocks, Scaled
from ..base.immutable import Immutable
from ..base.reprs import facts
from ..errors import ArgumentError, DTypeError, UnsupportedError


class Steps(Protocol):
    """The interface of a module in ``reference/steppers``. Only a method with a carry has ``start`` and ``finish``."""

    def step(self, s: Scaled, t: float, h: float, v: Array, y: Array, /) -> Blocks:
        """Make one step."""

    def start(self, s: Scaled, choice: int, t: float, v: Array, y: Array, /) -> Array:
        """Compute the carry, which replaces v, from the first state."""

    def finish(self, s: Scaled, choice: int, t: float, v: Array, y: Array, /) -> Array:
        """Compute v from the carry."""


class Method(Immutable):
    """A method with its metadata, read from its record in the core.

    Example:
        >>> rk4 = sw.method("rk4")
        >>> rk4
        <method rk4: Runge-Kutta 4, order 4, 4 function evaluations per step>
        >>> rk4.order, rk4.evaluations, round(rk4.limit, 4)
        (4, 4, 2.8284)
    """

    #: The name by which it is chosen.
    name: str
    #: The name by which the core knows it.
    key: str
    #: The names of the blocks that it keeps between steps beside v and y.
    kept: tuple[str, ...] = ()
    #: Of each whether it is one of velocities.
    kept_of_v: tuple[bool, ...] = ()
    #: Hoffmann's name.
    title: str
    #: Standard names of the same method.
    other_names: tuple[str, ...]
    #: Methods that are easily confused with it.
    false_friends: tuple[str, ...]
    #: Order of convergence.
    order: int
    #: Function evaluations per step of fixed length (of both rates: rate evaluations). For a series, those of a linear system;
    #: other systems may need more, see ``stepwell.stability.operations``.
    evaluations: int
    #: Function evaluations of an attempt at an adaptive step; 0 if it does not estimate its error.
    attempt_evaluations: int
    #: Evaluations of its continuous extension, by which states within a step of a run with a tolerance are found; 0 without one.
    extension_evaluations: int
    #: The family of methods to which it belongs.
    family: str
    #: True if its steps sum the Taylor series of the solution. With a tolerance it then chooses the order that costs least.
    has_series: bool
    #: True if a step is the exact solution of a linear system, by the exponential of its matrix.
    is_exact: bool
    #: True if a step solves equations, of any number of unknowns, with derivatives of the rates.
    is_implicit: bool
    #: The undamped oscillator is stable for Φ = ω₀·dt below this limit; 0 means never.
    limit: float
    #: Times within a step at which rates are evaluated, as fractions of the step.
    nodes: tuple[float, ...]
    #: True if it needs a second-order system whose forces do not depend on the velocity.
    needs_acceleration: bool
    #: The name of what it carries between steps in place of v, or None.
    carry: str | None
    #: Ways to start it, the default first.
    starts: tuple[str, ...]
    #: Order of h in which it estimates the error of a step, or None; with one it takes ``tolerance=``.
    error_order: int | None
    #: Section of Hoffmann (2002).
    section: str
    #: Publication.
    reference: str
    #: Description.
    about: str

    def __init__(self, record: dict[str, Any]) -> None:
        for key, value in record.items():
            setattr(self, key, tuple(value) if isinstance(value, list) else value)
        self.key = self.name
        self.has_series = self.family == "Taylor"
        self.is_exact = self.family == "exact"
        self.__doc__ = self._text()

    @property
    def _instead(self) -> str:
        return "it is that of the core; another method is chosen by its name, stepwell.method(name)"

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and unpickled methods are the one object of that name."""
        return method, (self.name,)

    @property
    def begins(self) -> bool:
        """True if a run begins with more than its state: with what the method carries in place of v, or keeps beside it."""
        return self.carry is not None or bool(self.kept)

    def kept_numbers(self, n_v: int, n_y: int) -> int:
        """How many numbers it keeps beside those of a member's blocks."""
        return sum(n_v if of_v else n_y for of_v in self.kept_of_v)

    @property
    def has_derivatives(self) -> bool:
        """True if a step takes derivatives of the rates, so that it goes over symbols only."""
        return self.has_series or self.is_implicit

    @property
    def splits(self) -> bool:
        """True if it moves bodies by Kepler's motions, so that a step of them is one tape."""
        return not self.is_exact and any(name == "drift of y" for name, _, _ in _core.program(self.key)[0])

    @property
    def takes_derivatives_by_time(self) -> bool:
        """True if a step takes the derivatives of rates by the time, and with them those of inputs."""
        return self.has_series or (not self.is_exact and any(name == "v by time" for name, _, _ in _core.program(self.key)[0]))

    @property
    def is_always_stable(self) -> bool:
        """True if steps of any length are stable where a motion does not grow."""
        return self.limit == math.inf

    @property
    def steps(self) -> Steps:
        """The NumPy reference: the module in ``stepwell.reference.steppers`` that is the method's specification."""
        if self.is_exact:
            raise UnsupportedError(NO_OPERATIONS)
        return cast(Steps, importlib.import_module(f"stepwell.reference.steppers.{self.name}"))

    def start_choice(self, start: str | None) -> int:
        """The number of a start in the core."""
        if start is None:
            return 0
        if not self.starts:
            raise ArgumentError(f"start: {self.name} starts in one way only, got {checks.short(start)}")
        return self.starts.index(checks.known("start", start, self.starts))

    def _text(self) -> str:
        limit = stable_for(self.limit, "Φ = ω₀·dt", 10)
        hoffmann = "Hoffmann’s " if self.section.startswith("§") else ""
        lines = [f"{self.title}: order {self.order}, {self._costs()} per step.", "", self.about, ""]
        if self.other_names:
            lines.append(f"Also called: {', '.join(self.other_names)}.")
        if self.false_friends:
            lines.append(f"Not to be taken for: {', '.join(self.false_friends)}.")
        source = "; ".join(filter(None, [hoffmann + self.section, self.reference]))
        lines += [f"Undamped oscillator stable: {limit}.", f"Source: {source}."]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<method {self.name}: {self.title}, order {self.order}, {self._costs()} per step>"

    def _costs(self) -> str:
        if self.is_exact:
            return "one product with a matrix"
        if self.has_series:
            return f"{self.evaluations} function evaluations (of a linear system)"
        return f"{self.evaluations} function evaluation{'s' * (self.evaluations != 1)}"

    def _repr_html_(self) -> str:
        return facts(
            f"{self.title} ({self.name})",
            [
                ("order", self.order),
                ("costs", f"{self._costs()} per step"),
                ("undamped oscillator stable", stable_for(self.limit, "Φ = ω₀·dt", 10)),
                ("adaptive steps", "no" if self.error_order is None else "yes (tolerance=)"),
                ("also called", "; ".join(self.other_names)),
                ("not to be taken for", "; ".join(self.false_friends)),
                ("source", "; ".join(filter(None, [self.section, self.reference]))),
            ],
            self.about,
        )


def stable_for(limit: float, angle: str = "Φ", digits: int = 6) -> str:
    """For which angles of a step the undamped oscillator is stable, in words."""
    if limit == math.inf:
        return f"every {angle}"
    return f"{angle} < {limit:.{digits}g}" if limit else f"no {angle}"


def _section(method: Method) -> int:
    """The number of Hoffmann's section; 99 for a method that is not in Hoffmann (2002)."""
    number = re.search(r"\d+", method.section)
    return int(number[0]) if number else 99


@cache
def _catalogue() -> dict[str, Method]:
    by_section = sorted(map(Method, _core.catalogue()), key=lambda m: (_section(m), m.order, m.name))
    return {m.name: m for m in by_section}


#: Why the exact step is not where others are.
NO_OPERATIONS = (
    "method: exact makes no operations of rates: its matrices are exponentials, of linear systems alone; take another method here"
)

#: The exact step of linear systems. It is not among ``methods()``, all of which step any system.
EXACT = Method(
    {
        "name": "exact",
        "title": "Exact",
        "other_names": ("matrix exponential", "zero-order hold"),
        "false_friends": (),
        "order": math.inf,
        "evaluations": 0,
        "attempt_evaluations": 0,
        "extension_evaluations": 0,
        "family": "exact",
        "is_implicit": False,
        "limit": math.inf,
        "nodes": (0.0,),
        "needs_acceleration": False,
        "carry": None,
        "starts": (),
        "error_order": None,
        "section": "§4",
        "reference": "C. Moler, C. Van Loan, Nineteen dubious ways to compute the exponential of a matrix, SIAM Rev. 45 (2003) 3",
        "about": "The solution itself at each step, for linear systems whose inputs are constant, sinusoidal, held or on "
        "straight lines from step to step: the transition matrix is the exponential of the system's matrix, computed with twice "
        "the digits.",
    }
)


def methods() -> tuple[Method, ...]:
    """Every method that steps any system, in the order of Hoffmann (2002); for linear systems there is ``exact`` as well.

    Example:
        >>> [method.name for method in sw.methods() if "Fehlberg" in method.title]
        ['fehlberg', 'fehlberg_5']
    """
    return tuple(_catalogue().values())


def for_stiff(tolerance: float) -> Method | None:
    """The method with adaptive steps that is stable with long ones where equations are stiff; None if there is none.

    Of several it is the one whose order is nearest to the digits that a relative tolerance asks for, of two the higher: it takes
    the fewest evaluations on the test problems, or as good as that.
    """
    able = [each for each in methods() if each.error_order is not None and each.is_always_stable]
    digits = round(-math.log10(tolerance), 6)
    return min(able, key=lambda each: (abs(each.order - digits), -each.order), default=None)


def choice(methods: Any) -> list[Method]:
    """The methods named by an argument ``methods``, each once; all if None."""
    chosen = list(_catalogue().values()) if methods is None else checks.several("methods", methods, "names")
    if not chosen:
        raise ArgumentError("methods: expected at least one, got none")
    return list(dict.fromkeys(map(of_operations, chosen)))


def of_operations(name: str | Method) -> Method:
    """The method of that name, where its step must consist of operations."""
    chosen = method(name)
    if chosen.is_exact:
        raise UnsupportedError(NO_OPERATIONS)
    return chosen


@overload
def method(name: str | Method) -> Method: ...


@overload
def method(name: Callable[..., Any], *, start: Callable[..., Any] | None = None) -> Method: ...


@overload
def method(*, start: Callable[..., Any]) -> Callable[[Callable[..., Any]], Method]: ...


def method(name: Any = None, *, start: Any = None) -> Any:
    """The method of that name; or, as a decorator, a method of your own.

    A function of ``(s, t, h, v, y)`` that returns the new ``v`` and ``y`` becomes a method. It is recorded once, over blocks:
    ``s.dv(t, v, y)`` and ``s.dy(t, v, y)`` are the increments h·v̇ and h·ẏ, ``s.velocity(d)`` is the velocity whose increment is
    d; blocks are added, and multiplied by numbers; times are ``t``, ``t + 0.5 * h`` and so on. (A division is a product with the
    reciprocal.) Order, cost and stability limit follow from what it does. It then steps every system as a built-in method does,
    with the same bits by the NumPy reference.

    - It returns four blocks, ``v, y, error_v, error_y``, if it estimates its error; then it takes adaptive steps.
    - Further arguments are blocks that it keeps between steps, as the rates of steps before: it returns them behind ``v, y``, and
      ``start=`` makes them for the first step.

    Args:
        name: its name or another name in its record, in any spelling: ``"false_euler"``, ``"symplectic Euler"`` or
            ``"Euler-Cromer"``; or ``"exact"``; or a function.
        start: a function of ``(s, t, h, v, y)`` that returns the blocks that your method keeps, as they are at the start.

    Returns:
        The ``Method``, with its record.

    Raises:
        UnknownNameError: if no method or more than one has that name. The message suggests the nearest; it explains the name of a
            method that is easily confused with one of these, such as ``"RK45"``.
        ArgumentError: if a function does something else with blocks; what, and what it can do.
        UnsupportedError: if a function's steps are wrong however short they are.

    Example:
        >>> sw.method("velocity Verlet").name
        'leapfrog'
        >>> @sw.method
        ... def ralston(s, t, h, v, y):
        ...     dv, dy = s.dv(t, v, y), s.dy(t, v, y)
        ...     later, v2, y2 = t + 2 / 3 * h, v + 2 / 3 * dv, y + 2 / 3 * dy
        ...     return v + 0.25 * dv + 0.75 * s.dv(later, v2, y2), y + 0.25 * dy + 0.75 * s.dy(later, v2, y2)
        >>> ralston
        <method ralston: Ralston, order 2, 2 function evaluations per step>
        >>> print(sw.integrate(sw.Pendulum(), ralston, v=0.0, y=1.0, dt=0.01, steps=100).y[-1].round(3))
        0.6
    """
    if isinstance(name, Method):
        return name
    if isinstance(name, FunctionType) or (name is None and start is not None):
        own_method = registry.task("own_method")
        return own_method(name, start) if name is not None else lambda function: own_method(function, start)
    if start is not None:
        raise ArgumentError(f"start: expected with a function, got the name {checks.short(name)}")
    if type(name) is str and (known := _catalogue().get(name)) is not None:
        return known
    if isinstance(name, str) and name == EXACT.name:
        return EXACT
    if isinstance(name, str):
        from .method_names import resolved  # not at the top: importing stepwell must be fast

        return resolved(str(name), _catalogue())
    if hasattr(name, "with_arguments"):
        raise DTypeError(f"method: expected the name of a method, got {checks.short(name)}; the system stands before the method")
    return _catalogue()[checks.known("method", name, _catalogue())]
