"""The Rust core: arrays in, arrays out. Everything is checked before it gets here; use ``stepwell``, not this.

Arrays are C-contiguous. Rows are arrays of two axes: what is counted, and the members, or 1 where all members have it in common.
Plans, pacings and their arrays are read by the names of their attributes, which stand in ``engine/``.
"""

from collections.abc import Callable, Sequence
from typing import Any, NoReturn, final

import numpy as np
from numpy.typing import NDArray

from .runs.engine import AdaptiveArrays, Arrays, CorePacing, Plan

__all__ = [
    "Equations",
    "Evaluation",
    "ModelSpec",
    "Prepared",
    "PreparedAdaptive",
    "Symbol",
    "Tape",
    "World",
    "__version__",
    "adapt",
    "adapt_and_look",
    "ask",
    "catalogue",
    "check",
    "compiled",
    "define",
    "forget",
    "in_parts",
    "isa",
    "isa_levels",
    "listen",
    "locate",
    "names_device",
    "operations",
    "prepared",
    "prepared_adaptive",
    "program",
    "recorded",
    "run",
    "run_and_look",
    "series_evaluations",
    "sound",
    "stages",
    "systems",
    "tape_number",
    "tape_operations",
    "times",
]
__version__: str

@final
class Equations:
    """The rates of a user's own system, as operations; given to a ``ModelSpec`` under any name. See ``Tape.equations``."""

    @property
    def reads_v(self) -> bool:
        """True if a rate of v depends on v."""

    @property
    def reads_time(self) -> bool:
        """True if anything depends on the time."""

    @property
    def chooses(self) -> bool:
        """True if the rates are made of pieces, one of which is chosen by the state or the time."""

@final
class ModelSpec:
    """The model that the core steps: a system, the values given for it, and a method.

    ``given`` is a list of names with words (str), whole numbers (int), rows of numbers (NDArray), or tables of samples: a tuple
    (start, interval, rows), a row for each sample. A sinusoid ``x`` is given as ``x.amplitude``, ``x.omega`` and ``x.phase``, a
    constant one as the one row ``x``, a sampled one as the table ``x``; a list ``inputs`` of them as the whole number ``inputs``
    and ``inputs[0]``, ``inputs[1]``, … What is not there is left out.

    ``control`` is "energy" (with ``control.form``, ``control.gain``, ``control.target``) or "projection" (``control.way``,
    ``control.target``).

    ``matrix`` is the nodes and the number of rows in the v slot, for the transition-matrix form of the system "matrix": ``n`` and
    ``n_v`` (whole), ``p`` (n·n rows, row by row), ``q`` (n rows for each node and, within it, each input), ``inputs``.

    ``order`` is that of a series with adaptive steps; 0 for that of its steps of fixed length. ``acceptance`` is the tuple of
    ``reference.acceptance.Acceptance``, and ``backward`` says that adaptive steps go back in time.

    Operations that are given as ``step()`` make the step in place of the method: their rates are the next numbers of the state,
    and their parameters are those of the system.
    """

    def __new__(
        cls,
        system: str,
        method: str,
        given: list[tuple[str, Any]],
        *,
        matrix: tuple[list[float], int] | None = None,
        record: list[str] = ...,
        fused: bool = False,
        order: int = 0,
        single: bool = False,
        acceptance: tuple[tuple[int, ...], bool, tuple[int, ...], bool] | None = None,
        backward: bool = False,
    ) -> ModelSpec: ...
    @property
    def rows(self) -> list[NDArray[np.float64]]:
        """The arrays of parameters in order, whose rows are the parameters of a tape."""

    @property
    def tables(self) -> list[tuple[float, float, NDArray[np.float64]]]:
        """The sampled inputs in order: start, interval, and a row for each sample."""

@final
class Prepared:
    """A run of fixed steps without its start."""

    def run(
        self,
        v: object,
        y: object,
        saved_v: NDArray[Any],
        saved_y: NDArray[Any],
        carry: NDArray[Any] | None,
        parameters: list[NDArray[np.float64]] | None = None,
    ) -> int:
        """Make the run from a start, fill the saved states and what the method carries, and say what is known of it.

        ``parameters`` are others of the same shapes, for this run and those to come.

        0: nothing was made, since the start is not of floats of the prepared shapes, or a number was not finite, or another
        thread makes the run now. 2: it is certain that no member has grown much. 1: neither.
        """

@final
class PreparedAdaptive:
    """A run of adaptive steps without its start."""

    def run(
        self,
        v: object,
        y: object,
        saved_v: NDArray[np.float64],
        saved_y: NDArray[np.float64],
        last_v: NDArray[np.float64],
        last_y: NDArray[np.float64],
        paces: NDArray[np.float64],
        parameters: list[NDArray[np.float64]] | None = None,
    ) -> int:
        """Make the run from a start and fill the saved states, and those at the end with their step-size controllers.

        ``parameters`` are others of the same shapes, for this run.

        0: nothing was made, since the start is not of floats of the prepared shapes, or a member did not come to its end, or it
        takes long, or another thread makes the run now. 2: what the motion keeps has not changed much, and no amount became
        negative. 1: one of both may be so.
        """

@final
class World:
    """Of the plan it reads ``t0``, ``dt``, ``choice``, ``first`` and ``members``.

    The arrays are of float32 if the model is single, else of float64.
    """

    def __new__(
        cls,
        model: ModelSpec,
        plan: Plan,
        v: NDArray[Any],
        y: NDArray[Any],
        carry: NDArray[Any] | None = None,
        force: NDArray[Any] | None = None,
    ) -> World: ...
    def step(self, n: int = 1) -> bool:
        """Make steps; whether a number of the state is not finite then, if that was looked at."""

    def step_and_look(self, n: int, events: object) -> tuple[bool, object]:
        """Make steps with events, of float64; also what was found, as by ``run_and_look``."""

    def carry(self) -> NDArray[Any] | None: ...
    def carry_on(self, carry: NDArray[Any]) -> None:
        """Go on with this carry, by rows, which belongs to what is in the arrays now."""

    def memory(self) -> NDArray[Any]:
        """The memory of a sampled controller, by rows."""

    def remember(self, memory: NDArray[Any]) -> None:
        """Let a sampled controller remember this, by rows."""

    def play(self, rows: tuple[int, int], seen: NDArray[Any], rewards: NDArray[Any], truths: NDArray[Any]) -> None:
        """One step of episodes, whose rows of y behind those that go on and those that are read go into the arrays.

        The numbers of rows are those that go on, and these with the actions, which are read only. Behind them are a reward, two
        truths and what is seen.
        """

    def take(self, model: ModelSpec, plan: Plan) -> None:
        """Go on with other parameters; arrays of parameters are not read any more."""

    def watch(self, model: ModelSpec, arrays: Sequence[tuple[str, NDArray[Any], str, float, float]]) -> None:
        """Read these arrays before each call of step: name, array, the name of its rows, what its numbers are above, at most."""

    def read(self) -> None:
        """Read them now."""

    def restart(self, members: Sequence[int], carry: NDArray[Any] | None) -> None:
        """Start these members again from their state in the arrays; all others go on with this carry, by rows."""

    @property
    def changes(self) -> int:
        """How often parameters or members were set."""

    @property
    def t(self) -> float: ...
    @property
    def step_number(self) -> int: ...

@final
class Symbol:
    """A value on a tape. It has no truth and is no number: ``==``, ``bool`` and ``float`` of it are errors."""

    @property
    def id(self) -> int:
        """The number of the operation that makes it."""

    @property
    def single(self) -> bool:
        """True if its numbers are float32."""

    def __add__(self, other: _Value, /) -> Symbol: ...
    def __radd__(self, other: _Value, /) -> Symbol: ...
    def __sub__(self, other: _Value, /) -> Symbol: ...
    def __rsub__(self, other: _Value, /) -> Symbol: ...
    def __mul__(self, other: _Value, /) -> Symbol: ...
    def __rmul__(self, other: _Value, /) -> Symbol: ...
    def __truediv__(self, other: _Value, /) -> Symbol: ...
    def __rtruediv__(self, other: _Value, /) -> Symbol: ...
    def __neg__(self) -> Symbol: ...
    def __pos__(self) -> Symbol: ...
    def __invert__(self) -> Symbol: ...
    def __and__(self, other: _Value, /) -> Symbol: ...
    def __rand__(self, other: _Value, /) -> Symbol: ...
    def __or__(self, other: _Value, /) -> Symbol: ...
    def __ror__(self, other: _Value, /) -> Symbol: ...
    def __lt__(self, other: _Value, /) -> Symbol: ...
    def __le__(self, other: _Value, /) -> Symbol: ...
    def __gt__(self, other: _Value, /) -> Symbol: ...
    def __ge__(self, other: _Value, /) -> Symbol: ...
    def __bool__(self) -> NoReturn: ...
    def __float__(self) -> NoReturn: ...
    def sqrt(self) -> Symbol: ...
    def mul_add(self, y: _Value, z: _Value) -> Symbol: ...
    def mul_sub_from(self, y: _Value, z: _Value) -> Symbol: ...
    def floor(self) -> Symbol: ...
    def equals(self, other: _Value) -> Symbol: ...
    def choose(self, yes: _Value, no: _Value) -> Symbol: ...
    def and_bits(self, bits: Symbol | int) -> Symbol: ...
    def or_bits(self, bits: Symbol | int) -> Symbol: ...
    def xor_bits(self, other: _Value) -> Symbol: ...
    def add_bits(self, bits: Symbol | int) -> Symbol: ...
    def sub_bits_from(self, bits: Symbol | int) -> Symbol: ...
    def shift_up(self, places: int) -> Symbol: ...
    def shift_down(self, places: int) -> Symbol: ...
    def number(self, x: float) -> Symbol:
        """A number on the tape of this symbol."""

    def constant(self, bits: int) -> Symbol:
        """A constant on the tape of this symbol, by its bits."""

#: A symbol, or a number that becomes one.
_Value = Symbol | float
#: One number for all members, or one for each.
_Row = NDArray[np.float64] | float

@final
class Evaluation:
    """Values of a tape for many members at once."""

    def __call__(self, members: int, state: list[_Row], parameters: list[_Row]) -> NDArray[np.float64]:
        """A row for each value, from rows of the state and of the parameters."""

@final
class Tape:
    """A list of operations, each once. Symbols write to it, and the core's steps are traced onto it.

    If it is ``single``, its numbers are those of float32: constants are rounded to it, and operations on bits are on 32 of them.
    """

    def __new__(cls, *, single: bool = False) -> Tape: ...
    def state(self, i: int) -> Symbol: ...
    def param(self, i: int) -> Symbol: ...
    def budget(self) -> Symbol: ...
    def step(self) -> Symbol: ...
    def time(self) -> Symbol: ...
    def number(self, x: float) -> Symbol: ...
    def constant(self, bits: int) -> Symbol:
        """A constant, by its bits."""

    @property
    def single(self) -> bool:
        """True if its numbers are float32."""

    def value(self, id: int) -> Symbol:
        """The value that the operation of that number makes."""

    def sample(self, table: int, t: _Value) -> Symbol: ...
    def trace(self, model: ModelSpec, what: str) -> list[Symbol]:
        """The values of a part of a model: "step", "attempt", "begin", "start 0", "finish 0", or "record" and a quantity."""

    def listing(self, of: Symbol) -> str:
        """The operations that a value is made of."""

    def operations(self, of: list[Symbol]) -> tuple[list[tuple[str, list[int], int]], list[int]]:
        """The operations that make these values, in order: names, operands, what else they take; and the places of the values."""

    def equations(
        self,
        dv: list[Symbol],
        dy: list[Symbol] | None = None,
        quantities: list[tuple[str, Symbol]] = ...,
        kept: tuple[Symbol, list[Symbol], list[Symbol], Symbol] | None = None,
        functions: list[tuple[Symbol, list[tuple[Symbol, Symbol]], tuple[float, float] | None, bool]] = ...,
        mass: list[list[tuple[int, float]]] | None = None,
        friction: tuple[list[Symbol], int, tuple[int, list[Symbol]] | None] | None = None,
    ) -> Equations:
        """The equations of a system with these values as its rates; without ``dy``, ẏ is v.

        ``functions`` are values with, for each that they depend on, the derivative by it; of one branch of several, its bounds;
        and whether they are made of pieces. ``mass`` is the mass matrix: of each row the columns and entries that are not zero.
        ``friction`` that sticks has its decelerations, the length of the vectors that it acts on, and, if it acts on one number,
        its place and by how much others change with it.

        ``kept`` is an invariant that a projection keeps: its value, its derivatives by v and by y, the square of their length.
        """

    def fused(self, of: list[Symbol]) -> tuple[Tape, list[Symbol]]:
        """A tape with fused multiply-adds in what these values need, and the values on it."""

    def evaluation(self, of: list[Symbol], states: int) -> Evaluation | None:
        """An evaluation of these values for many members at once, from so many numbers of a state and from parameters.

        None if they depend on a step or a time.
        """

    def written(self, of: list[Symbol]) -> dict[str, int]:
        """How often each kind of operation was asked for in a step, if these values are its next state.

        Of values that depend on the state before equal ones were merged; of inputs that change with the time after it.
        """

    def __len__(self) -> int: ...

def catalogue() -> list[dict[str, Any]]: ...
def tape_operations() -> list[tuple[str, int, str, bool]]:
    """Of each operation its name, its number of operands, among which it is counted, and whether they may be exchanged."""

def sound(value: object, finite: bool, positive: bool) -> bool:
    """True for a contiguous, aligned array of floats, if all are finite, and above zero, where that is asked."""

def systems() -> list[str]: ...
def isa() -> str: ...
def isa_levels() -> list[str]: ...
def names_device() -> bool:
    """True if the environment variable ``STEPWELL_DEVICE`` names a device."""

def ask(function: Callable[[], object] | None) -> None:
    """Let this thread ask a function at intervals while it steps, or none; what the function raises ends the run."""

def listen() -> None:
    """Raise if this thread is to stop: what the function says that it asks, and ``KeyboardInterrupt`` after Ctrl-C."""

def locate(
    events: object, of_all: int, e: int, members: NDArray[np.int64], numbers: NDArray[np.float64], states: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of events of ``runs.events.by_core``: the shares of steps at which one changes its sign, and the states there."""

def run_and_look(model: ModelSpec, plan: Plan, arrays: Arrays, events: object) -> tuple[bool, object]:
    """``run`` with events, of ``runs.events.by_core``: also what was found of them."""

def run(model: ModelSpec, plan: Plan, arrays: Arrays) -> bool:
    """Make the steps of a run; True if some member has diverged, now or before.

    Of the plan it reads ``t0``, ``dt``, ``choice``, ``first``, ``steps``, ``every``, ``threads`` and ``progress``.
    """

def adapt_and_look(
    model: ModelSpec, plan: Plan, pacing: CorePacing, arrays: AdaptiveArrays, events: object
) -> tuple[bool, object]:
    """``adapt`` with events, of ``runs.events.by_core``: also what was found of them."""

def adapt(model: ModelSpec, plan: Plan, pacing: CorePacing, arrays: AdaptiveArrays) -> bool:
    """Make a run with a tolerance. Of the plan it reads ``t0``, ``threads`` and ``progress``; of the pacing everything.

    False if nothing was done, since the start is to be found and an attempt is too long for one tape.
    """

def prepared(model: ModelSpec, plan: Plan, members: int, shapes: list[list[int]]) -> Prepared | None:
    """A run of so many members without its start; None if it is not a short one.

    Of the plan it reads what ``run`` does; ``shapes`` are those of v and y, with the batch.
    """

def prepared_adaptive(
    model: ModelSpec,
    plan: Plan,
    pacing: CorePacing,
    paces: NDArray[np.float64],
    shapes: list[list[int]],
    numbers: list[int],
    members: int,
    *,
    quantities: ModelSpec | None,
    has_amounts: bool,
    least_change: float,
    many: float,
) -> PreparedAdaptive | None:
    """A run with a tolerance of so many members, whose blocks have so many numbers, without its start.

    None if it cannot be prepared. ``shapes`` are those of v and y, with the batch; ``quantities`` is a model that records what
    the motion keeps, and ``least_change`` the part of its size by which one has changed; ``has_amounts`` says that it is looked
    for numbers that became negative. A run of ``many`` accepted steps is for others.
    """

def recorded(
    model: ModelSpec, dt: float, own: int, v: NDArray[np.float64], y: NDArray[np.float64], rows: NDArray[np.float64]
) -> None:
    """Fill rows with the recorded quantities of states, from the rows of v and y. The parameters of ``own`` members repeat."""

def times(plan: Plan, t: NDArray[np.float64]) -> None:
    """Fill the times of the saved states. Of the plan it reads what ``run`` does."""

def check(model: ModelSpec) -> None:
    """Raise if it cannot be stepped so."""

def compiled(model: ModelSpec, members: int, *, choice: int = 0, attempts: bool = False) -> dict[str, Any] | None:
    """The description of a step, traced and compiled anew for so many members; None if it is too long for one tape.

    ``level``; ``written`` and ``computed``, numbers of operations by kind: before equal ones were merged, but for those that a
    method does to blocks, and as every member makes them in every step; ``per_run``, ``per_member`` and ``per_step``, how many
    are made before; ``lanes``, how many members go together; ``bytes`` of machine code, 0 where it is interpreted; ``spills``,
    how many values are kept beside the registers at most; ``packing``, the fields of ``explanation.Packing``, or None where equal
    operations of one member were not considered; ``trace`` and ``compile``, how long both took, in seconds.
    ``attempts``: at adaptive steps.

    ``interpreted`` is None, and ``width`` (numbers in a vector), ``block_vectors`` (vectors in a turn of the loop), ``blocks``
    (turns for a tile), ``resident`` (whether the state stays in registers over all steps) and ``registers`` (of vectors, that
    there are) tell of the machine code; or it is "level" (none at this level), "pages" (the system lets no page be executed)
    or "writer".

    ``split`` holds the operations: "run", "member", "step" and "body", each the result of ``Tape.operations`` and the indices of
    its results. The results of the first three are, in order, the values "uniform", "row" and "of the step" of the body; "held"
    are numbered with the last. Their own leaves are "uniform", the number of a pair in ``given``, and "row", of the step the
    time and of the member the number of a parameter in ``params``. ``entries`` has a pair for each value of the step: "value",
    or "sample" or "row" with the number of a table, of which the value is the number of a sample.
    """

def in_parts(model: ModelSpec, members: int, *, choice: int = 0, attempts: bool = False) -> tuple[str, int, int] | None:
    """By what a step is made that is too long for one tape, about how many operations it has, how many members go together.

    "rates" is by tapes of the rates, "hand" by a kernel for one member, "matrix" by products of matrices. None if it is one tape.
    """

def stages(model: ModelSpec, *, choice: int = 0, attempts: bool = False, extends: bool = False) -> dict[str, Any]:
    """The cut tapes of a run, each stage as one tape, for a machine that the core does not write code for.

    ``v``, ``y``, ``kept``, ``memory``, ``tally`` and ``recorded`` are how many numbers of a member there are; ``carries`` is
    whether the method has a carry, ``is_series`` whether attempts are those of a series. ``splits`` has by name, "step" and
    "start", "finish", "record", "begin", "judged", "by terms" where they are, and "extension" where it ``extends``, what
    ``compiled`` has as ``split``. ``tried`` is None but for attempts of float32.
    """

def tape_number(model: ModelSpec, *, choice: int = 0, attempts: bool = False) -> int:
    """A number that stands for the tapes of a model in this process: what has the same number has the same tapes."""

def operations(model: ModelSpec) -> int:
    """About how many operations a step of fixed length has, before any is traced."""

def series_evaluations(model: ModelSpec, *, attempts: bool = False) -> int:
    """To how many evaluations of the rates the coefficients of a series are equal, by their operations; 0 without a series."""

def forget() -> None:
    """Begin with new caches of tapes and machine code: what another thread holds at a fork is never released in the child."""

def program(
    method: str, *, attempts: bool = False, stage: str = "step", choice: int = 0
) -> tuple[list[tuple[str, list[int], float]], list[int]]:
    """The operations of a method on blocks, and the places of the new blocks; of attempts also those of estimates of the error.

    The stages beside "step" are "start", which turns v into what stands in its place between steps, with the blocks that are
    kept behind it, and "finish", which turns that into v; ``choice`` is the number of the way to start.

    Names are "v", "y", "dv" and "dy" (with the time, as a share of the step; operands are v and y), "velocity", "add",
    "subtract", "scale" (with the factor), "series of v" and "series of y" (with the order of the coefficient), "kept v" and
    "kept y" (with the place among the blocks that the method keeps).
    """

def define(
    key: str,
    name: str,
    step: tuple[list[tuple[str, list[int], float]], list[int]],
    *,
    acceleration: bool,
    attempt: tuple[list[tuple[str, list[int], float]], list[int]] | None = None,
    error_order: int = 0,
    start: tuple[list[tuple[str, list[int], float]], list[int]] | None = None,
    kept: list[bool] = ...,
) -> None:
    """Make a user's method known by a key, which stands for its programs; what is known by it already stays.

    Programs are as ``program`` returns them: of a step, the new v and y and what is kept; of an attempt, the new v and y and the
    estimates of their errors; of a start, v and what is kept. ``kept`` has for each kept block whether it is one of velocities.
    """
