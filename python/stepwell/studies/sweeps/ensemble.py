"""``sweep``: the outcomes of an ensemble of runs as a labelled array."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from hashlib import blake2b
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import checks
from ...base.reprs import counted
from ...errors import (
    AccuracyWarning,
    ArgumentError,
    DivergenceWarning,
    DTypeError,
    ShapeError,
    StiffnessWarning,
    ToleranceWarning,
)
from ...model.methods import Method
from ...model.methods import method as find_method
from ...model.systems import System
from ...runs import float32
from ...runs.finding import Found
from ...runs.findings import is_heard, warn_of
from ...runs.findings.lost_motion import LOST
from ...runs.options import OPTIONS, named, with_options
from ...runs.options.checked import Checked
from . import adaptive, event_counts, mixed_steps
from .adaptive import Evaluations
from .axes import OF_THE_RUN, Chunk, Grid
from .axes import grid as a_grid
from .crossings import Crossing, Period
from .description import layout_of
from .engines import Engine
from .exponents import Exponents
from .extras import need
from .layout import named_units
from .outcomes import Extremes, Function, History, Last, Mean, Outcome
from .stores import Memory, Zarr, store_of
from .task import Done, Task, probed

if TYPE_CHECKING:
    from typing import Unpack

    import xarray

    from ...runs.options.table import RunOptions

#: Outcomes by word.
WORDS: dict[str, type[Outcome]] = {
    "last": Last,
    "extremes": Extremes,
    "mean": Mean,
    "crossing": Crossing,
    "period": Period,
    "lyapunov": Exponents,
    "evaluations": Evaluations,
    "history": History,
}
#: Default of ``memory``, in bytes; and with a device, where one chunk at a time is computed.
MEMORY, MEMORY_OF_A_DEVICE = 64 * 2**20, 2**30
#: The most members of a chunk by default: enough that a call costs little beside their steps.
MAX_MEMBERS = 1 << 14
#: Likewise with a tolerance, where a chunk has pieces only between the times of ``at``, and Ctrl-C waits for a piece.
MAX_ADAPTIVE_MEMBERS = 1 << 11
#: And on a device, which is idle while a chunk is prepared and its results are written.
MAX_DEVICE_MEMBERS = 1 << 22
#: The least number of chunks for each worker, as long as each chunk has at least MIN_MEMBERS members.
CHUNKS_OF_A_WORKER, MIN_MEMBERS = 4, 256
#: The options of a run that the runs of chunks do not get as they are.
OF_A_SWEEP = {*OF_THE_RUN, "steps", "every", "at", "events", "fused", "dtype", "t0", "progress", "threads", "device"}


@with_options("sweep")
def sweep(
    system: System | Callable[..., System],
    axes: Mapping[str, Any],
    method: str | Method,
    *,
    transient: int | None = None,
    outcomes: Any = None,
    observe: int | None = None,
    units: Mapping[str, str] | None = None,
    store: Any = None,
    engine: Any = None,
    chunk: int | None = None,
    memory: float | None = None,
    **options: Unpack[RunOptions],
) -> xarray.Dataset:
    """Run an ensemble, and return the outcomes of its members in arrays with named dimensions.

    Members are computed in chunks, on all cores, in other processes or on a cluster. The outcomes of a member have the same bits
    on every engine and in every division into chunks. Trajectories are reduced while they are computed and are not stored, except
    for ``"history"``. Steps are fixed, by ``dt`` and ``steps``, or adaptive, by ``tolerance`` and ``at``. Options are
    the same for all members, and ``dt`` is above zero. In float32 outcomes are computed in float64. Needs ``pip install
    "stepwell[sweep]"``.

    Args:
        system: a system; or a callable that makes one from parameters by name: a class such as ``Oscillator``, your own
            equations, a function, or ``functools.partial`` of any of them.
        axes: what varies, by the name of the argument: a parameter of the system, or ``y``, ``v``, ``dt``, ``force`` or
            ``tolerance``. Each is (dimension, values) or (dimension, values, attributes), as in xarray, or values alone, whose
            dimension has the name of the argument. Those of one dimension vary together; different dimensions are multiplied.
            The dimension is the last axis of the values; axes before it are those of the argument. ``stepwell.sweeps.random``
            and ``sobol`` make samples.
        method: its name, or what ``stepwell.method`` returns.
        transient: number of steps before the observed ones; none if None.
        outcomes: the outcomes of each member, one or a list: "last", "extremes", "mean", "crossing", "period", "lyapunov",
            "evaluations", "history"; the classes of ``stepwell.sweeps`` with these names, with arguments; or a function of the
            ``Run`` of a chunk. None is "last", or with ``every``, "history". How a member ended, ``status`` and
            ``first_bad_step``, is always among the results.
        observe: steps between the states that reductions see; one if None. Reductions miss what happens in between.
        units: words for "t", "v", "y", parameters and results, by name; they become attributes.
        store: a path ending in .zarr or .nc, or None for memory. Every finished chunk is written there, and an interrupted sweep
            goes on where it stopped when it is called again. With a store the results need not fit in memory.
        engine: None for threads of this process, an ``Executor`` of ``concurrent.futures``, or a ``dask.distributed.Client``.
        chunk: the most members of a chunk; None for as many as ``memory`` allows, up to 16384, or 4194304 with a device.
        memory: the bytes that a chunk may take while it is computed; None for 64 MiB, or 1 GiB with a device, of whose memory it
            takes half at most. As many chunks are computed at once as there are workers.
        **options: those that go with a sweep, of the table in ``stepwell.runs.options``, which ``help(stepwell.sweep)`` shows.

    Returns:
        An ``xarray.Dataset``. Its attributes say how it was made; ``bits`` is a hash of all results.

    Raises:
        ArgumentError: before any work: what was given and what was expected.
        UnsupportedError: if the method cannot step the system, if an argument is not supported in float32, or if a package is
            missing.
        KeyboardInterrupt: at Ctrl-C. The store has all chunks that were finished.

    Warns:
        DivergenceWarning: how many members left the finite range, and which first. The others are not affected.
        ToleranceWarning: how many members stopped before the last time, which first, and why; or that an absolute tolerance is
            so large that the motion is lost in it.
        StiffnessWarning: how many members had steps that stability held down, and not the tolerance, which first, with the limit
            there, how much longer steps the tolerance allows, and the method to take.
        AccuracyWarning: if numbers are finite but meaningless: how many members ended at a negative amount, which their equations
            do not reach, or grew a millionfold by fixed steps beyond the stability limit, and which first; or a pendulum turned
            so far that its angle has no sine. Encounters of bodies are not searched for here.

    Example:
        >>> axes = {"omega": ("omega", [1.0, 2.0, 4.0]), "y": ("y0", [0.5, 1.0])}
        >>> found = sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, dt=0.01, steps=1000, outcomes=["extremes", "period"])
        >>> found.y_period.dims, found.y_period.sel(omega=2.0).values.round(6)
        (('omega', 'y0'), array([3.141593, 3.141593]))
    """
    need("xarray")
    grid, method, named_as = a_grid(axes), find_method(method), named_units(units)
    asked_for = named("sweep", options)
    varied = {axis.argument for axis in grid.axes}
    paced = asked_for.tolerance is not None or asked_for.at is not None or "tolerance" in varied
    asked = Checked(asked_for, "and tolerance= or at= was given" if paced else None, way="sweep", method=method)
    fixed = {name: getattr(asked_for, name) for name in OF_THE_RUN}
    _fits_axes(system, varied, fixed, ("y",) if paced else ("y", "dt"))
    if asked.given("dt"):
        fixed["dt"] = checks.number("dt", asked_for.dt, positive=True, unit="units of time")
    arguments = {name: value for name, value in fixed.items() if value is not None}
    arguments |= {"t0": asked["t0"], "fused": asked["fused"], "threads": 1} | _the_same_for_all(asked)
    if single := asked["dtype"]:
        for axis in grid.axes:  # raises for numbers that float32 does not have
            checks.fits_single(f"axes: {axis.argument}", axis.values)
            if axis.argument == "dt":
                float32.rounded_step(float(axis.values.min()))
        arguments["dtype"] = "float32"
    if (machine := asked["device"]) is not None:
        from ...device import promise  # only such sweeps need it

        promise.check(machine, single=single)
        arguments["device"] = machine.described.name
    elif asked.given("device"):
        arguments["device"] = asked_for.device  # "cpu", in other processes, too
    every, steps, threads = asked["every"], asked["steps"], asked["threads"] or None
    kept_of_each = _outcomes(outcomes, every)
    if (located := asked["events"]) is not None:
        located = event_counts.events_of(located, kept_of_each, transient)
        arguments["events"], kept_of_each = list(located), (*kept_of_each, event_counts.EventCounts(located))
    times = None
    if paced:
        adaptive.refuse({"transient": transient, "every": every, "observe": observe})
        more, times = adaptive.arguments(grid, method, asked, kept_of_each)
        arguments |= more
    else:
        adaptive.refuse_fixed(kept_of_each)
        if steps is None:
            raise ArgumentError("steps: expected with fixed steps; or give tolerance= and at= for adaptive steps")
    task = Task(
        system=system,
        method=method,
        options=arguments,
        transient=0 if transient is None else checks.count("transient", transient, 0),
        steps=steps or 0,
        observe=1 if observe is None else checks.count("observe", observe, 1),
        every=every,
        outcomes=kept_of_each,
        memory=_memory(memory, machine),
        at=times,
        looks=times is not None and not method.is_always_stable and is_heard(StiffnessWarning),
    )
    first, bits, names = _probe(task, grid)
    workers = Engine(engine, 1 if machine is not None and engine is None and threads is None else threads)
    mixed = times is None and mixed_steps.together(first, method, kept_of_each, arguments)
    shape = grid.chunk_shape(_members(task, first, grid, workers.workers, chunk), mixed=mixed)
    layout = layout_of(task, grid, first, bits, named_as)
    if taken := sorted(names & {*layout.coords, *grid.dims}):
        raise ArgumentError(
            f'axes: {taken[0]!r} is the name of a result; give the dimension another name, as ("run", values), or '
            f"the outcome one by name="
        )
    where = store_of(store)
    results = Memory(layout, shape) if where is None else where[0](where[1], layout, shape)
    _compute(task, grid, workers, results, asked["progress"])
    dataset: xarray.Dataset = results.finish()
    return dataset


def _the_same_for_all(asked: Checked) -> dict[str, Any]:
    """The options that the runs of all chunks get as they are."""
    passed: dict[str, Any] = {}
    for name, option in OPTIONS.items():
        if name in OF_A_SWEEP or not asked.given(name):
            continue
        checked = asked[name]
        if option.batch is not None and (axes := option.batch(checked, None)):
            raise ShapeError(f"{name}: expected the same for all members of a sweep, got one of batch {axes}")
        passed[name] = checked if option.plan is None else getattr(asked.options, name)
    return passed


def _memory(memory: float | None, machine: Any) -> float:
    """The bytes that a chunk may take; on a device at most half of its memory."""
    if memory is None:
        memory = MEMORY if machine is None else MEMORY_OF_A_DEVICE
    most: float = np.inf if machine is None else machine.described.memory / 2
    return min(checks.number("memory", memory, positive=True, unit="bytes"), most)


def _fits_axes(system: Any, varied: set[str], fixed: Mapping[str, Any], needed: tuple[str, ...]) -> None:
    """Raise if an argument is given twice or not at all, or the system has no such parameter."""
    if both := [name for name, value in fixed.items() if value is not None and name in varied]:
        raise ArgumentError(f"{both[0]}: given twice, as an argument and in axes; leave one of them out")
    if missing := [name for name in needed if fixed[name] is None and name not in varied]:
        raise ArgumentError(f"{' and '.join(missing)}: expected as an argument or in axes")
    if isinstance(system, System):
        if of_system := sorted(varied - set(OF_THE_RUN)):
            raise ArgumentError(
                f"axes: {of_system[0]} would be a parameter, but {system!r} has its parameters already; give what makes it, such "
                f"as the class {type(system).__name__}, or functools.partial of it"
            )
    elif not callable(system):
        raise DTypeError(f"system: expected a system, or what makes one of parameters by name, got {type(system).__name__}")
    elif not isinstance(system, type):  # a class checks its parameters itself
        _takes(system, sorted(varied - set(OF_THE_RUN)))


def _takes(maker: Callable[..., Any], parameters: Sequence[str]) -> None:
    """Raise if a function does not take the parameters that have axes, by their names."""
    try:
        signature = inspect.signature(maker)
    except (TypeError, ValueError):  # some callables have no signature
        return
    try:
        signature.bind_partial(**dict.fromkeys(parameters))
    except TypeError as error:
        names = ", ".join(parameters)
        raise DTypeError(f"system: expected a function of {names} by name, got one that cannot be called so: {error}") from None


def _outcomes(outcomes: Any, every: int | None) -> tuple[Outcome, ...]:
    if outcomes is None:
        outcomes = "last" if every is None else "history"
    is_one = isinstance(outcomes, (str, Outcome)) or callable(outcomes)
    several = [outcomes] if is_one else checks.several("outcomes", outcomes, "outcomes")
    chosen: list[Outcome] = []
    for each in several:
        if isinstance(each, str):
            chosen.append(WORDS[checks.known("outcomes", each, WORDS)]())
        elif isinstance(each, Outcome):
            chosen.append(each)
        elif isinstance(each, type) and issubclass(each, Outcome) and each is not Function:
            chosen.append(each())
        elif callable(each):
            chosen.append(Function(each))
        else:
            raise DTypeError(f"outcomes: expected words, outcomes or functions of a run, got {checks.short(each)}")
    if not chosen:
        raise ArgumentError(f"outcomes: expected at least one of {', '.join(WORDS)}, or a function of a run, got none")
    if every is not None and not any(isinstance(each, (History, Function)) for each in chosen):
        raise ArgumentError("every: works with the outcome 'history' or a function of a run; reductions see states by observe=")
    return tuple(chosen)


def _probe(task: Task, grid: Grid) -> tuple[System, str, set[str]]:
    """The system of the first member, a hash of the first steps of the first and the last member, and names of results."""
    digest = blake2b(digest_size=8)
    for member in dict.fromkeys((0, grid.members - 1)):
        index = np.unravel_index(member, grid.shape)
        one = Chunk(tuple(map(int, index)), tuple(slice(int(i), int(i) + 1) for i in index), (1,) * len(index), member)
        tested = probed(task, grid.values(one))
        warn_of(tested.findings, 3)
        for block in tested.state:
            digest.update(np.where(np.isnan(block), np.nan, block).tobytes())
        if member == 0:
            first = tested
    return first.system, digest.hexdigest(), first.names


def _members(task: Task, system: System, grid: Grid, workers: int, chunk: int | None) -> int:
    """The most members of a chunk."""
    most = task.most_members(system)
    if most < 1:
        needed = 8.0 * task.numbers(system) / 2**20
        raise ArgumentError(
            f"memory: one member takes some {needed:.3g} MiB while it is computed, got {task.memory / 2**20:.3g} MiB"
        )
    if chunk is not None:
        return min(checks.count("chunk", chunk, 1), most)
    if task.on_device:
        return min(most, MAX_DEVICE_MEMBERS)
    parts = CHUNKS_OF_A_WORKER * workers
    largest = MAX_MEMBERS if task.at is None else MAX_ADAPTIVE_MEMBERS
    return min(most, largest, max(MIN_MEMBERS, -(-grid.members // parts)))


def _compute(task: Task, grid: Grid, engine: Engine, results: Memory | Zarr, progress: bool) -> None:
    done, tally = 0, _Tally(grid, task)

    def unfinished() -> Iterator[Chunk]:  # one after the other, since there may be too many for memory
        nonlocal done
        for chunk in grid.chunks(results.chunk_shape):
            if results.finished(chunk):
                done += chunk.members
            else:
                yield chunk

    if progress:
        from ...base.progress import bar

        shown: Any = bar(f"sweep, {counted(grid.members, 'member')}")
    else:
        shown = nullcontext(None)
    with shown as report:
        chunks = engine.compute(task, grid, unfinished())
        try:
            for chunk, each in chunks:
                results.write(chunk, each.results)
                tally.add(chunk, each)
                done += chunk.members
                if report is not None:
                    report(done / grid.members)
        finally:
            chunks.close()  # type: ignore[attr-defined]
    tally.warn()


class _Tally:
    """The members to warn of."""

    def __init__(self, grid: Grid, task: Task) -> None:
        self.grid, self.task, self.bad, self.members, self.first, self.step = grid, task, 0, 0, grid.members, -1
        self.lost, self.why = 0, ""
        self.doubts: dict[int, str] = {}
        #: By the first members of their chunks.
        self.found: dict[str, dict[int, Found]] = {"stiff": {}, "growth": {}, "amounts": {}}

    def add(self, chunk: Chunk, done: Done) -> None:
        status = np.where(np.isin(done.results["status"].values, event_counts.EVENTS), 0, done.results["status"].values)
        self.members += chunk.members
        if status.any():
            self.bad += int(np.count_nonzero(status))
            member = int(np.flatnonzero(status)[0])
            if chunk.first + member < self.first:
                self.first, self.step = chunk.first + member, int(done.results["first_bad_step"].values[member])
                self.why = done.why_stopped
        self.lost += done.lost
        if done.doubt is not None:
            self.doubts[chunk.first] = done.doubt
        for name, found in done.found.items():
            if found is not None:
                self.found[name][chunk.first] = found

    def warn(self) -> None:
        for category, text in self._warnings():
            warnings.warn(text, category, stacklevel=4)

    def _warnings(self) -> Iterator[tuple[type[Warning], str]]:
        if self.bad and self.task.at is not None:
            stopped = f"{self._share(self.bad)} stopped before t = {self.task.at[-1]:g}{self._first(self.bad, self.first)}"
            yield ToleranceWarning, f"{stopped}: {self.why}; status tells which and why"
        elif self.bad:
            diverged = f"{self._share(self.bad)} diverged{self._first(self.bad, self.first)}, at step {self.step}"
            yield DivergenceWarning, f"{diverged}; status and first_bad_step tell which and when"
        yield from self._sentence("stiff")
        if self.lost:
            yield ToleranceWarning, LOST.format(who=self._share(self.lost))
        if self.doubts:
            chunk = min(self.doubts)
            where = f"in {counted(len(self.doubts), 'chunk')}, the first beginning at {self.grid.place(chunk)}"
            yield AccuracyWarning, f"{where}: {self.doubts[chunk]}"
        yield from self._sentence("growth")
        yield from self._sentence("amounts")

    def _sentence(self, name: str) -> Iterator[tuple[type[Warning], str]]:
        if found := self.found[name]:
            chunk, some = min(found), sum(len(each.members) for each in found.values())
            first = found[chunk]
            which = self._first(some, chunk + int(first.members[0]))
            yield first.category, first.sentence(self._share(some), which)

    def _share(self, some: int) -> str:
        return f"{some} of {counted(self.members, 'member')}"

    def _first(self, some: int, member: int) -> str:
        return f", {'the first of them' if some > 1 else 'that'} at {self.grid.place(member)}"
