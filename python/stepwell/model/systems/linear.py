"""Any linear system, by its matrices (§3)."""

from __future__ import annotations

from collections.abc import Iterable
from math import prod
from numbers import Real
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ...base import checks
from ...base.arrays import Array, Shape
from ...base.immutable import changed
from ...base.reprs import counted
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...reference.product import times
from ...reference.systems.linear import Linear as Reference
from ..inputs import Input, Pulse, as_input
from ..parameters import aligned
from .base import System

if TYPE_CHECKING:
    from .realisation import Realisation

#: The number of copies of A in memory during a run of many states: the argument, its rows, and the core's.
COPIES_OF_A = 5


class LinearSystem(System):
    """ṡ = A·s + B·x(t), with auxiliary outputs z = C·s + D·x(t): the state space equations of Hoffmann's §3.

    The state s has n numbers in the order that you choose. Some of them form the block v, which methods such as False Euler
    advance first, the others form the block y: see ``velocities``. The blocks have shapes (velocities,) and (n − velocities,);
    either may be empty.

    Args:
        A: state matrix, shape (n, n, *batch), in one per unit of time.
        B: input matrix, shape (n, m, *batch); None for no inputs. If A has two axes, a column (n,) is accepted for one input.
        C: output matrix, shape (r, n, *batch); None for no outputs. If A has two axes, a row (n,) is accepted for one output.
        D: feedthrough matrix, shape (r, m, *batch); None for zero. A number is accepted for one input and one output.
        x: the inputs, a sequence of m: each a number, an array over the batch, ``Sinusoid``, ``Sampled``, or None for zero. A
            single input need not be in a sequence. None if all are zero.
        velocities: the states in the block v: their number, if they come first, or a sequence of their indices in the order of
            the block. The other states, in their order, are the block y. By default the first n // 2 are v.

    ``a * b`` is the system in which the outputs of b are the inputs of a, ``a + b`` and ``a - b`` have common inputs and add or
    subtract outputs; either may be a number, a gain. See ``series``, ``parallel`` and ``feedback``.

    Attributes:
        second_order: whether ẏ is v times a number, so that Verlet can step it if no row of v depends on v.
        input_names: ``("x",)`` for one input, ``("x[0]", "x[1]", …)`` for several.

    Raises:
        ArgumentError: if an argument is wrong.

    Example:
        >>> mass = sw.LinearSystem([[-0.2, -4.0], [1.0, 0.0]], B=[1.0, 0.0], x=1.0)  # states: velocity, position
        >>> run = sw.integrate(mass, "rk4", v=0.0, y=0.0, dt=0.05, steps=2000)
        >>> run.y[-1].round(4)
        array([0.25])
    """

    kernel = "linear"
    reference = Reference
    complex_step = True
    axes = "states"
    linear = True

    def __init__(self, A: Any, B: Any = None, C: Any = None, D: Any = None, *, x: Any = None, velocities: Any = None) -> None:
        self.A = _square(A)
        n = len(self.A)
        checks.fits("A: the matrix and its copies", COPIES_OF_A * n * n, (), "take fewer states")
        single = self.A.ndim == 2  # else a single axis might be meant for the batch
        self.B = None if B is None else _matrix("B", B, ("n", n), ("m", None), (n, 1) if single else None)
        m = 0 if self.B is None else self.B.shape[1]
        self.C = None if C is None else _matrix("C", C, ("r", None), ("n", n), (1, n) if single else None)
        r = 0 if self.C is None else len(self.C)
        for argument, needed, why in (
            (D, C, "D: expected C too, without which there are no outputs to add inputs to"),
            (D, B, "D: expected B too, without which there are no inputs"),
            (x, B, "x: expected B too, without which there are no inputs"),
        ):
            if argument is not None and needed is None:
                raise ArgumentError(why)
        self.D = None if D is None else _matrix("D", D, ("r", r), ("m", m), (1, 1) if r == m == 1 else None)
        self.input_names = ("x",) if m == 1 else tuple(f"x[{i}]" for i in range(m))
        self.x = _inputs(x, self.input_names)
        if velocities is None and B is not None and C is not None:
            velocities = 0  # a model of inputs and outputs, whose states are neither velocities nor coordinates
        self.velocities = _velocities(velocities, n)
        self.coordinates = tuple(i for i in range(n) if i not in set(self.velocities))
        self.v_shape, self.y_shape = (len(self.velocities),), (len(self.coordinates),)
        matrices = {"A": self.A, "B": self.B, "C": self.C, "D": self.D}
        self.batch = checks.batch_shape(
            {name: matrix.shape[2:] for name, matrix in matrices.items() if matrix is not None}
            | {name: argument.batch for name, argument in self.given_inputs().items()}
        )
        self._find_order()

    def _find_order(self) -> None:
        """Find out from A and B whether ẏ is v times a number, and whether v̇ depends on v."""
        v, y = list(self.velocities), list(self.coordinates)
        speeds, n = self.A[y][:, v], len(v)
        unit = np.eye(n).reshape(n, n, *(1,) * (self.A.ndim - 2))
        self.second_order = (
            len(v) == len(y)
            and bool((speeds[0, 0] != 0).all() and (speeds == speeds[0, 0] * unit).all())
            and not self.A[y][:, y].any()
            and not (self.B is not None and self.B[y].any())
        )
        self.velocity_term = "velocities in the rows of v" if self.A[v][:, v].any() else None

    @classmethod
    def of(cls, system: Any, *, x: Any = None, velocities: Any = None) -> LinearSystem:
        """The linear system of an object of SciPy or python-control, or of another linear system of stepwell.

        Args:
            system: an object with A, B, C and D, with num and den, or with zeros, poles and gain, of continuous time; neither
                library is imported. Of a stepwell system the outputs are the coordinates y.
            x: the inputs, in place of the system's own.
            velocities: the states in the block v, as for ``LinearSystem``; None for none, or for the system's own.

        Raises:
            ArgumentError: if it is no such object.
            UnsupportedError: if it is sampled already, or not linear.

        Example:
            >>> from scipy.signal import lti
            >>> sw.LinearSystem.of(lti([1.0], [1.0, 0.4, 1.0])).A
            array([[-0.4, -1. ],
                   [ 1. ,  0. ]])
        """
        if isinstance(system, LinearSystem) and x is None and velocities is None:
            system.not_in_a_loop("system")
            return system
        part = part_of("system", system, of_states=True)
        has = bool(part.inputs)
        D = part.D if has and part.D.any() else None
        velocities = part.velocities if velocities is None else velocities
        inputs = (list(part.x) if has else None) if x is None else x
        return LinearSystem(part.A, part.B if has else None, part.C, D, x=inputs, velocities=velocities)

    def with_inputs(self, x: Any) -> LinearSystem:
        """The system with other inputs x, as for ``LinearSystem``; None for none."""
        self.not_in_a_loop("x")
        return LinearSystem(self.A, self.B, self.C, self.D, x=x, velocities=self.velocities)

    #: So that an array of NumPy times a system is a system with that gain, and not an array of systems.
    __array_ufunc__ = None

    def __mul__(self, before: Any) -> LinearSystem:
        """The outputs of ``before``, or the inputs times a number, are the inputs of this system."""
        from .realisation import of_gain, series  # only joined systems need it

        own = realised(self)
        if isinstance(before, LinearSystem):
            return joined(series(realised(before), own))
        if not is_gain(before):
            return NotImplemented
        gain = of_gain("gain", before, own.inputs, own.inputs)
        return joined(series(gain._replace(x=own.x), own._replace(x=gain.x)))

    def __rmul__(self, gain: Any) -> LinearSystem:
        if not is_gain(gain):
            return NotImplemented
        from .realisation import of_gain, series  # only joined systems need it

        own = realised(self)
        return joined(series(own, of_gain("gain", gain, own.outputs, own.outputs)))

    def __add__(self, other: Any) -> LinearSystem:
        """Common inputs, and the sum of the outputs."""
        from .realisation import of_gain, parallel  # only joined systems need it

        own = realised(self)
        if isinstance(other, LinearSystem):
            return joined(parallel(own, realised(other)))
        return joined(parallel(own, of_gain("gain", other, own.outputs, own.inputs))) if is_gain(other) else NotImplemented

    __radd__ = __add__

    def __sub__(self, other: Any) -> LinearSystem:
        return self + -1.0 * other if isinstance(other, LinearSystem) or is_gain(other) else NotImplemented

    def __rsub__(self, other: Any) -> LinearSystem:
        return -1.0 * self + other if is_gain(other) else NotImplemented

    def __neg__(self) -> LinearSystem:
        return -1.0 * self

    def repr_arguments(self) -> list[str]:
        """Its arguments, for its repr."""
        m, r = (0 if self.B is None else self.B.shape[1]), (0 if self.C is None else len(self.C))
        v = self.v_shape[0]
        states = f"{counted(len(self.A), 'state')}{f', {v} of them velocities' if v else ''}"
        return [states, counted(m, "input"), counted(r, "output")]

    @property
    def groups(self) -> tuple[int, ...]:
        """Each state is a group of its own, because units may differ."""
        return tuple(range(len(self.A)))

    def given_inputs(self) -> dict[str, Input]:
        """The inputs by name, without those that are None."""
        return {name: each for name, each in zip(self.input_names, self.x, strict=True) if each is not None}

    def without_inputs(self) -> LinearSystem:
        """The system without inputs."""
        return LinearSystem(self.A, self.B, self.C, self.D, velocities=self.velocities)

    def with_pulse(self, name: str, values: Array, interval: float, start: float = 0.0) -> LinearSystem:
        """The system with one input, these samples, and no others."""
        if name not in self.input_names:
            raise KeyError(name)
        x = [Pulse(values, interval, start) if name == each else None for each in self.input_names]
        return LinearSystem(self.A, self.B, self.C, self.D, x=x, velocities=self.velocities)

    def _parts(self) -> list[Array]:
        """A, and the columns of B whose inputs are not None, both in the order of the blocks."""
        order = [*self.velocities, *self.coordinates]
        return [self.A[order][:, order]] + ([] if self.B is None else [self.B[order][:, self._columns()]])

    def _columns(self) -> list[int]:
        """The columns of B whose inputs are not None; the others are zero and left out."""
        return [i for i, each in enumerate(self.x) if each is not None]

    def arguments(self) -> dict[str, Any]:
        """Its arguments; None if there are no inputs."""
        return super().arguments() | {"x": self.x or None}

    def with_arguments(self, arguments: dict[str, Any]) -> Self:
        """This system with other matrices or inputs of the same structure."""
        fresh, free = type(self)(**(self.uncontrolled.arguments() | arguments)), self.uncontrolled
        if (fresh.second_order, fresh.velocity_term) != (free.second_order, free.velocity_term):
            raise UnsupportedError(
                f"{', '.join(arguments)}: expected matrices of the structure that is there: whether ẏ is v times a number, and "
                f"whether v̇ depends on v; make another World that goes on from here, World(system, method, resume=world)"
            )
        matrices = {name: getattr(fresh, name) for name in "ABCD"}
        return changed(super().with_arguments(arguments), **matrices)

    def own_axes(self, name: str) -> int:
        """Two of a matrix, one of a polynomial."""
        return 1 if name in ("num", "den") else 2

    def equation_parameters(self, batch: Shape) -> dict[str, Any]:
        """The matrix [A B] in the order of the blocks, the inputs, and whether it is that of an acceleration."""
        return {
            "kind": "acceleration" if self.second_order and self.velocity_term is None else "",
            "n_v": self.v_shape[0],
            "rows": _side_by_side(self._parts(), batch),
            "inputs": [each.signal() for each in self.given_inputs().values()],
        }

    def named(self, name: str, index: Shape) -> str:
        """The name in A, B or an input; the core has rows and columns in the order of the blocks, and only the inputs in use."""
        if name != "rows":
            position, dot, rest = name.removeprefix("inputs[").partition("]")
            return (list(self.given_inputs())[int(position)] + rest) if dot else name
        order = [*self.velocities, *self.coordinates]
        row, column = index
        if column < len(order):
            return f"A[{order[row]},{order[column]}]"
        return f"B[{order[row]},{self._columns()[column - len(order)]}]"

    def split(self, state: Any) -> tuple[Array, Array]:
        """The blocks (v, y) of a state in the order of A, shape (n, *batch).

        Raises:
            ArgumentError: if the state is wrong.
        """
        array = checks.block("state", state, (len(self.A),), self.axes)
        return array[list(self.velocities)], array[list(self.coordinates)]

    def state(self, v: Any, y: Any) -> Array:
        """The state in the order of A, shape (n, *batch), of the blocks v and y: undoes ``split``.

        Raises:
            ArgumentError: if a block is wrong.
        """
        v = checks.block("v", v, self.v_shape, self.axes, finite=False)
        y = checks.block("y", y, self.y_shape, self.axes, finite=False)
        batch = checks.batch_shape({"v": v.shape[1:], "y": y.shape[1:]})
        state = np.empty((len(self.A), *batch))
        for order, block in ((self.velocities, v), (self.coordinates, y)):
            state[list(order)] = aligned(block, 1, batch)
        return state

    def auxiliary(self, t: float, v: Array, y: Array) -> Array:
        """The auxiliary outputs C·s + D·x(t) of states at time t, of shape (r, *batch).

        The sums run over the states in the order of A, then over the inputs, and do not depend on the machine.

        Raises:
            UnsupportedError: if the system has no C.
        """
        if self.C is None:
            return super().auxiliary(t, v, y)
        state = self.state(v, y)
        batch = np.broadcast_shapes(state.shape[1:], self.batch)
        parts, columns = [self.C], [*state]
        if self.D is not None:
            parts.append(self.D[:, self._columns()])
            columns += [each.signal().at(t) for each in self.given_inputs().values()]
        z = times(_side_by_side(parts, batch), columns)
        return np.array(np.broadcast_to(z, (len(self.C), *batch)))


def realised(system: LinearSystem, argument: str = "system", *, of_states: bool = False) -> Realisation:
    """The matrices of a system, with zeros for D; without C, if that is allowed, the outputs are the states."""
    from .realisation import Realisation

    system.not_in_a_loop(argument)
    n, C = len(system.A), system.C
    if system.B is None or (C is None and not of_states):
        missing = " and ".join(name for name, each in (("inputs (B)", system.B), ("outputs (C)", C)) if each is None)
        raise ArgumentError(f"{argument}: expected a linear system with inputs and outputs, got {system!r} without {missing}")
    C = np.eye(n).reshape(n, n, *(1,) * (system.A.ndim - 2)) if C is None else C
    D = np.zeros((len(C), system.B.shape[1])) if system.D is None else system.D
    return Realisation(system.A, system.B, C, D, system.velocities, system.x)


def joined(part: Realisation, arguments: str = "system") -> LinearSystem:
    """The system with these matrices."""
    if not part.size:
        raise ArgumentError(f"{arguments}: expected at least one linear system, got gains alone, which have no states")
    D = part.D if part.D.any() else None
    return LinearSystem(part.A, part.B, part.C, D, x=list(part.x), velocities=part.velocities)


def is_gain(value: Any) -> bool:
    """True if a value may be a gain: a number, or an array of them."""
    return (isinstance(value, Real) and not isinstance(value, bool)) or isinstance(value, (np.ndarray, np.generic))


def part_of(argument: str, system: Any, *, of_states: bool = False) -> Realisation:
    """The matrices of a linear system of stepwell, SciPy or python-control."""
    if isinstance(system, LinearSystem):
        return realised(system, argument, of_states=of_states)
    if isinstance(system, System):
        return of_rates(argument, system)
    from .realisation import of_object  # only other libraries' objects need it

    return of_object(argument, system)


def of_rates(argument: str, system: System) -> Realisation:
    """The matrices of any linear system, from its reference: the rates of unit states and of unit inputs; its outputs are y."""
    if not system.linear:
        raise UnsupportedError(
            f"{argument}: expected a linear one, got {system!r}; near a state it is LinearSystem(sw.jacobian(system, at).matrix)"
        )
    from .realisation import Realisation

    n_v, n_y = prod(system.v_shape), prod(system.y_shape)
    n, batch, names = n_v + n_y, system.batch, system.input_names

    def rates(of: System, several: int, v: Array, y: Array) -> Array:
        s = of.scaled(1.0, (several, *batch))
        rows = [s.dv(0.0, v, y), s.dy(0.0, v, y)]
        wide = [np.broadcast_to(row, (*shape, several, *batch)) for row, shape in zip(rows, shapes, strict=True)]
        return np.concatenate([each.reshape(-1, several, *batch) for each in wide])

    shapes = (system.v_shape, system.y_shape)
    unit = np.broadcast_to(np.eye(n).reshape(n, n, *(1,) * len(batch)), (n, n, *batch))
    blocks = [each.reshape(*shape, n, *batch) for each, shape in zip((unit[:n_v], unit[n_v:]), shapes, strict=True)]
    A = rates(system.without_inputs(), n, *blocks)
    B = np.zeros((n, len(names), *batch))
    for j, name in enumerate(names):
        rest = [np.zeros((*shape, 1, *batch)) for shape in shapes]
        B[:, j] = rates(system.with_pulse(name, np.ones(1), 1.0), 1, *rest)[:, 0]
    C = np.eye(n)[n_v:].reshape(n_y, n, *(1,) * len(batch))
    inputs = tuple(system.given_inputs().get(name) for name in names)
    return Realisation(A, B, C, np.zeros((n_y, len(names))), tuple(range(n_v)), inputs)


def _square(A: Any) -> Array:
    if any(all(hasattr(A, each) for each in names) for names in ("AB", ("num", "den"), ("zeros", "poles"))):
        raise DTypeError(
            f"A: expected a matrix, got a system, {type(A).__name__}; LinearSystem.of({type(A).__name__}(…)) takes it"
        )
    array = checks.numbers("A", A)
    if array.ndim < 2 or array.shape[0] != array.shape[1] or array.shape[0] == 0:
        raise ShapeError(f"A: expected shape (n, n, batch…) with at least one state, got {array.shape}")
    return array


def _matrix(
    argument: str, value: Any, rows: tuple[str, int | None], columns: tuple[str, int | None], single: tuple[int, int] | None
) -> Array:
    """A matrix of so many rows and columns, each with its name, None for any number.

    ``single`` is the shape of a single row, column or number that may be given without its other axes.
    """
    array = checks.numbers(argument, value)
    if single is not None and array.ndim < 2 and array.size == single[0] * single[1]:
        array = array.reshape(single)
    fits = array.ndim >= 2 and all(
        n in (None, got) and got > 0 for (_, n), got in zip((rows, columns), array.shape, strict=False)
    )
    if not fits:
        wanted = ", ".join(name if n is None else f"{name} = {n}" for name, n in (rows, columns))
        raise ShapeError(f"{argument}: expected shape ({wanted}, batch…), got {array.shape}")
    return array


def _side_by_side(parts: list[Array], batch: Shape) -> Array:
    """Matrices with the same number of rows, joined side by side, over the whole batch."""
    parts = [aligned(each, 2, batch) for each in parts]
    common = np.broadcast_shapes(*(each.shape[2:] for each in parts))
    return np.concatenate([np.broadcast_to(each, (*each.shape[:2], *common)) for each in parts], axis=1)


def _inputs(x: Any, names: tuple[str, ...]) -> tuple[Input | None, ...]:
    """The inputs of the argument x, one for each name."""
    if x is None:
        return (None,) * len(names)
    if len(names) == 1 and not (isinstance(x, (list, tuple)) and len(x) == 1):
        return (as_input("x", x),)
    several = isinstance(x, (list, tuple)) or (isinstance(x, np.ndarray) and x.ndim > 0)
    if not several or len(x) != len(names):
        got = f"{len(x)}" if several else f"one {type(x).__name__}"
        raise ShapeError(f"x: expected a sequence of {len(names)} inputs, one for each column of B, got {got}")
    return tuple(as_input(name, each) for name, each in zip(names, x, strict=True))


def _velocities(velocities: Any, n: int) -> tuple[int, ...]:
    """The indices of the states in the block v."""
    if velocities is None:
        return tuple(range(n // 2))
    if not isinstance(velocities, Iterable) or isinstance(velocities, str) or getattr(velocities, "ndim", 1) == 0:
        return tuple(range(checks.count("velocities", velocities, 0, n)))
    several = checks.several("velocities", velocities, "states")
    chosen = tuple(checks.count(f"velocities[{i}]", each, 0, n - 1) for i, each in enumerate(several))
    for each in chosen:
        if chosen.count(each) > 1:
            raise ArgumentError(f"velocities: expected distinct states, got {each} twice")
    return chosen
