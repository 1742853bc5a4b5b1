"""``stepwell.system``: a user's function becomes a kind of system."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from math import prod
from types import FunctionType
from typing import Any, Literal, get_args, overload

import numpy as np

from ...base import checks, registry
from ...base.arrays import Shape
from ...base.immutable import frozen
from ...errors import ArgumentError, DTypeError, ShapeError, UnknownNameError
from ..inputs import Sampled, Sinusoid
from .by_name import reduced
from .friction import Friction, FrictionOf, friction, place_of
from .invariants import Invariant, invariant
from .mass import MassMatrix, mass_matrix
from .recognised import Reading, Unknown, reading

#: The numbers whose size the error of an adaptive step is relative to.
Scale = Literal["component", "row", "block"]
SCALES = get_args(Scale)


class Known:
    """Results that follow from the functions of a definition, as long as they compute the same.

    Attributes:
        readings: what the functions read.
        by_shapes: systems of which the operations are known, by the shapes of parameters and of states.
    """

    def __init__(self, readings: list[Reading]) -> None:
        self.readings, self.by_shapes = readings, {}  # type: list[Reading], dict[Any, Any]

    def holds(self, functions: list[Any]) -> bool:
        """True if these are the functions, and they read the same objects."""
        return len(self.readings) == len(functions) and all(map(Reading.holds, self.readings, functions))


class Definition:
    """A kind of system, defined by a function; ``stepwell.system`` returns it. Called with parameters, it returns a ``System``.

    Attributes:
        function: the function.
        order: 1 for ẏ, 2 for v̇ with ẏ = v.
        blocks: 2 if the function returns (v̇, ẏ).
        shape: the declared shapes of the blocks v and y; None for one that is taken from the state.
        quick_sines: whether sine and cosine are those of the built-in systems.
        scale: what the error of an adaptive step is relative to: each "component", "row" or "block".
        mass: the mass matrix, or None for that of units.
        parameters: names and defaults.
        own_axes: how many axes of its own each parameter has: as many as its default.
        invariants: the declared invariants, by name.
        stick_friction: the declared friction that sticks, or None.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        order: int,
        blocks: int,
        shape: tuple[Any, Any],
        quick_sines: bool = False,
        scale: str = "component",
        mass: MassMatrix | None = None,
    ) -> None:
        self.function, self.order, self.blocks, self.shape = function, order, blocks, shape
        self.quick_sines, self.scale, self.mass = quick_sines, scale, mass
        self.__name__ = self.name = function.__name__
        self.__doc__, self.__module__, self.__qualname__ = function.__doc__, function.__module__, function.__qualname__
        self.__wrapped__ = function
        self.parameters = _parameters(function, 3 if self.has_v else 2)
        self.own_axes = {name: 0 if _changes(default) else np.ndim(default) for name, default in self.parameters.items()}
        self.invariants: dict[str, Invariant] = {}
        self.stick_friction: Friction | None = None
        self._known = Known([])

    def known(self) -> Known | None:
        """The cache of its functions, the same object as long as these compute the same; None if that cannot be seen."""
        known, functions = self._known, [self.function, *(each.function for each in self.invariants.values())]
        if known.holds(functions):
            return known
        try:
            readings = [reading(each) for each in functions]
        except Unknown:
            return None
        if [each.identity for each in readings] == [each.identity for each in known.readings]:
            known.readings = readings
        else:
            self._known = Known(readings)
        return self._known

    @property
    def has_v(self) -> bool:
        """True if the function takes v."""
        return self.order == 2 or self.blocks == 2

    def __call__(self, /, **values: Any) -> Any:
        """The system with these parameters; the others have their defaults.

        Args:
            **values: parameters by name, each a number, an array over the batch (whose axes come after the parameter's own, if
                the default has some), a ``Sinusoid``, a ``Sampled``, or a function of the time in NumPy style.

        Raises:
            ArgumentError: if there is no such parameter, or a value is not a finite number.
        """
        for name in values:
            if name not in self.parameters:
                known = ", ".join(self.parameters) or "none"
                raise UnknownNameError(f"{self.name}: there is no parameter {checks.short(name)}. Known: {known}.")
        return registry.task("own_system")(self, {**self.parameters, **values})

    def invariant(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Declare a quantity that is constant in the exact solution; a decorator.

        By the name of the function it can then be recorded, charted, and kept constant by ``Control`` or ``Projection``. Its
        gradient is derived.

        Args:
            function: ``f(v, y, *, parameters)``, or ``f(y, *, parameters)`` for a first-order system, that returns one number;
                it may take the time before the state, as the rates do, but not depend on it. Parameters are those of the system,
                by name. ``run.energy`` is the invariant called ``energy``.

        Raises:
            ArgumentError: if the system has no such parameter.

        Example:
            >>> @sw.system
            ... def pendulum(t, v, y, *, omega=1.0):
            ...     return -omega**2 * np.sin(y)
            >>> @pendulum.invariant
            ... def energy(v, y, *, omega):
            ...     return 0.5 * v**2 + omega**2 * (1 - np.cos(y))
        """
        declared = invariant(self.name, ("v", "y") if self.has_v else ("y",), self.parameters, function)
        self.invariants[declared.name] = declared
        return function

    @overload
    def friction(self, function: Callable[..., Any], /) -> Callable[..., Any]: ...
    @overload
    def friction(
        self, function: None = None, /, *, of: FrictionOf = "component", component: int | tuple[int, ...] | None = None
    ) -> Callable[[Callable[..., Any]], Callable[..., Any]]: ...
    def friction(self, function: Any = None, /, *, of: FrictionOf = "component", component: Any = None) -> Any:
        """Declare Coulomb's friction that sticks, beside the forces in the rates; a decorator, above where systems are made.

        The function returns the deceleration of a sliding motion, μN/m, in the unit of v̇; the normal force N may depend on the
        time, the state and the parameters. A negative deceleration is none. What sticks stays until other forces exceed it.

        Args:
            function: ``f(t, v, y, *, parameters)``; parameters are those of the system, by name. It returns a number or an array
                of the shape of v; with ``of="row"`` one number for each row; with ``component`` one number, or the pair of it
                and an array of the shape of v that says by how much each velocity changes where that component changes by 1.
            of: ``"component"`` for friction on each number of v; ``"row"`` for friction against the direction of vectors, which
                are along the last axis of v, as of bodies on a table.
            component: the place of the only number of v that has friction: an index, or a tuple of them.

        Raises:
            ArgumentError: if the system is of first order, has friction already, or has no such parameter.

        Example:
            >>> @sw.system
            ... def block(t, v, y, *, slope=0.3, mu=0.5, g=9.81):
            ...     return -g * np.sin(slope)
            >>> @block.friction
            ... def sliding(t, v, y, *, slope, mu, g):
            ...     return mu * g * np.cos(slope)
        """
        if not self.has_v:
            raise ArgumentError(f"{self.name}: friction acts on velocities, and a system of first order has none")
        if self.stick_friction is not None:
            known = self.stick_friction.function.__name__
            raise ArgumentError(f"{self.name}: expected one function for friction, and {known} is declared already")

        place = place_of(of, component)

        def declare(function: Any) -> Any:
            self.stick_friction = friction(self.name, self.parameters, function, of, place)
            return function

        return declare if function is None else declare(function)

    def __repr__(self) -> str:
        return f"<system {self.name}({', '.join(f'{name}={value!r}' for name, value in self.parameters.items())})>"

    def __deepcopy__(self, memo: Any) -> Definition:
        return self  # it is immutable

    def __copy__(self) -> Definition:
        return self

    def __reduce__(self) -> Any:
        return reduced(self, "an own system")


def _changes(value: Any) -> bool:
    """True if a parameter changes with the time: an input or a function."""
    return isinstance(value, (Sinusoid, Sampled)) or callable(value)


#: A cache of the names of functions' parameters, and its most entries.
_NAMES: dict[Any, tuple[str, ...]] = {}
MOST_NAMES = 1024


def _parameters(function: Callable[..., Any], state: int) -> dict[str, Any]:
    """Names and defaults of the arguments after the time and the state."""
    # Attributes of a function, such as the ``__wrapped__`` of a decorated one, may change its signature.
    if isinstance(function, FunctionType) and not vars(function):
        parameters = _from_code(function, state)
    else:
        parameters = _from_signature(function, state)
    for parameter, default in parameters.items():
        if not _changes(default):
            numbers = checks.numbers(f"{function.__name__}: default of {parameter}", default)
            if numbers.ndim:
                parameters[parameter] = frozen(parameter, numbers)
    return parameters


def _from_code(function: FunctionType, state: int) -> dict[str, Any]:
    """The names and defaults of a function, read from its code. The names are cached."""
    code, positional, named = function.__code__, function.__defaults__ or (), function.__kwdefaults__ or {}
    key = code, len(positional), tuple(named), state
    if (names := _NAMES.get(key)) is None:
        if len(_NAMES) >= MOST_NAMES:
            _NAMES.clear()
        names = _NAMES[key] = tuple(_from_signature(function, state))
    last = dict(zip(code.co_varnames[code.co_argcount - len(positional) : code.co_argcount], positional, strict=True))
    return {name: named[name] if name in named else last[name] for name in names}


def _from_signature(function: Callable[..., Any], state: int) -> dict[str, Any]:
    """The names and defaults of a function by ``inspect``, which is slow. Raises an error if they are not those of rates."""
    name = function.__name__
    expected = "(t, v, y, *, …)" if state == 3 else "(t, y, *, …)"
    signature = inspect.signature(function)
    arguments = list(signature.parameters.values())
    positional = [each for each in arguments if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]
    if len(positional) < state or any(each.default is not each.empty for each in positional[:state]):
        first_order = "; for ẏ = f(t, y) write sw.system(order=1)" if state == 3 and len(positional) == 2 else ""
        raise ArgumentError(f"{name}: expected a function {expected}, got {signature}{first_order}")
    checks.argument_order(name, function, ("t", "v", "y") if state == 3 else ("t", "y"), signature)
    parameters = {}
    for each in arguments:
        if each in positional[:state]:
            continue
        if each.kind in (each.VAR_POSITIONAL, each.VAR_KEYWORD, each.POSITIONAL_ONLY):
            raise ArgumentError(f"{name}: expected parameters with names, {expected}, got {each}")
        if each.default is each.empty:
            raise ArgumentError(f"{name}: expected a default of the parameter {each.name}, such as {each.name}=1.0")
        parameters[each.name] = each.default
    return parameters


@overload
def system(function: Callable[..., Any], /) -> Definition: ...
@overload
def system(
    *, order: int = 2, blocks: int = 1, shape: Any = None, quick_sines: bool = False, scale: Scale = "component", mass: Any = None
) -> Callable[[Callable[..., Any]], Definition]: ...
def system(
    function: Any = None,
    /,
    *,
    order: int = 2,
    blocks: int = 1,
    shape: Any = None,
    quick_sines: bool = False,
    scale: Scale = "component",
    mass: Any = None,
) -> Any:
    """Make a kind of system from a function: your own equations, in NumPy style, as fast as built-in ones.

    The function is run once for a system, with symbols in place of numbers, and its operations are recorded; it is not called
    during a step. Write it for one member; parameters and states may still be batches.

    Args:
        function: ``f(t, v, y, *, parameters)`` that returns v̇, while ẏ is v; with ``order=1``, ``f(t, y, *, parameters)`` that
            returns ẏ, as SciPy's ``solve_ivp`` takes it; with ``blocks=2``, ``f(t, v, y, *, parameters)`` that returns the pair
            (v̇, ẏ). v̇ and ẏ have the shapes of v and y. Each parameter has a default. If that is an array, its axes are the
            parameter's own, and batch axes come after them.
        order: 1 or 2.
        blocks: 2 for a function that returns both rates.
        shape: the shape of the state of a member, with None for a length that is open; with ``blocks=2`` a pair of shapes. If it
            is not given, it is taken from the initial state of a run: its first axes, as few as the function accepts.
        quick_sines: whether sine and cosine take half the operations, as in built-in systems. Their error is then below a unit in
            the last place of 1, for angles up to 10⁶ rad; by default it is below a unit in the last place of the result.
        scale: the size to which the error of an adaptive step is relative: the largest value that each ``"component"`` has had,
            so that components may have different units; the length of each ``"row"`` along the last axis, for a state of shape
            (bodies, 3) whose directions are equivalent; or the length of each whole ``"block"``, v and y.
        mass: the mass matrix M of M·ẏ = f, with ``order=1``: constant numbers, shape (n, n) for a state of n numbers. It may be
            singular: a row of zeros is an algebraic equation, 0 = f. Such a system is stepped by implicit methods, from a state
            for which the algebraic equations hold; ``consistent_start`` finds one.

    Returns:
        A ``Definition``: called with parameters by name, it returns a ``System``.

    Raises:
        TraceError: at the first use with a state, if the function does what cannot be traced; the message names the line.

    Example:
        >>> import numpy as np, stepwell as sw
        >>> @sw.system
        ... def duffing(t, v, y, *, alpha=-1.0, beta=1.0, delta=0.3, gamma=0.5, omega=1.2):
        ...     return gamma * np.cos(omega * t) - delta * v - alpha * y - beta * y**3
        >>> run = sw.integrate(duffing(beta=[0.5, 1.0, 2.0]), "rk4", v=0.0, y=1.0, dt=0.01, steps=1000)
        >>> run.y.shape
        (1, 3)
    """
    order = checks.count("order", order, 1, 2)
    blocks = checks.count("blocks", blocks, 1, 2)
    if blocks == 2 and order == 1:
        raise ArgumentError("blocks: expected 1 with order=1, whose state is one block; for (v̇, ẏ) leave order out")
    shapes = _shapes(shape, order, blocks)
    quick_sines = checks.flag("quick_sines", quick_sines)
    scale = checks.known("scale", scale, SCALES)
    matrix = None if mass is None else mass_matrix("mass", mass)
    if matrix is not None and order == 2:
        raise ArgumentError("mass: expected order=1, M·ẏ = f; write a second-order equation as two of first order")
    shapes = _with_mass(shapes, matrix)

    def define(function: Any) -> Definition:
        if isinstance(function, Definition):
            raise DTypeError(f"function: {function.name} is a system already")
        if not isinstance(function, FunctionType):
            raise DTypeError(f"function: expected a Python function such as f(t, v, y), got {type(function).__name__}")
        return Definition(function, order, blocks, shapes, quick_sines, scale, matrix)

    return define if function is None else define(function)


def _shapes(shape: Any, order: int, blocks: int) -> tuple[Any, Any]:
    """The declared shapes of v and y, None where nothing was declared."""
    if blocks == 2:
        if shape is None:
            return None, None
        if not isinstance(shape, (tuple, list)) or len(shape) != 2 or any(not isinstance(each, (tuple, list)) for each in shape):
            raise ArgumentError(f"shape: expected a pair of shapes, of v and of y, since blocks=2, got {checks.short(shape)}")
        return _shape(shape[0]), _shape(shape[1])
    one = None if shape is None else _shape(shape)
    return (one if order == 2 else (0,)), one


def _with_mass(shapes: tuple[Any, Any], mass: MassMatrix | None) -> tuple[Any, Any]:
    """The declared shapes, of y that of the rows of a mass matrix if none was declared."""
    if mass is None:
        return shapes
    rows = len(mass.matrix)
    if shapes[1] is None:
        return shapes[0], (rows,)
    if None not in shapes[1] and prod(shapes[1]) != rows:
        raise ShapeError(f"mass: expected {prod(shapes[1])} rows and columns, one for each number of the state, got {rows}")
    return shapes


def _shape(shape: Any) -> tuple[int | None, ...]:
    if isinstance(shape, (int, np.integer)):
        shape = (shape,)
    if not isinstance(shape, (tuple, list)):
        raise ArgumentError(f"shape: expected lengths such as (3,) or (None, 2), got {checks.short(shape)}")
    return tuple(None if each is None else checks.count("shape", each, 1) for each in shape)


def fits(shape: Shape, declared: tuple[int | None, ...] | None) -> bool:
    """True if a shape is as declared."""
    return declared is None or (
        len(shape) == len(declared) and all(want in (None, got) for got, want in zip(shape, declared, strict=True))
    )
