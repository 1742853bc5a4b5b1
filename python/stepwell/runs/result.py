"""The result of a run."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import checks, registry
from ..base.arrays import Array, Whole
from ..base.immutable import FixedDict, ValueEquality, by_value
from ..base.reprs import MAX_LINE, counted, facts, shortened
from ..errors import ArgumentError, UnsupportedError
from ..model.methods import Method
from ..model.systems import System
from .finding import Finding

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

    from .encounters import Collision, Encounter
    from .occurrences import Occurrences


class Status(IntEnum):
    """How a member ended.

    Example:
        >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
        >>> bool(run.status == sw.Status.OK)
        True
    """

    OK = 0
    #: It left the range of finite numbers.
    DIVERGED = 1
    #: With a tolerance: it used up ``max_steps``.
    BUDGET = 2
    #: With a tolerance: the step that the tolerance requires is too short to change the time.
    UNDERFLOW = 3
    #: With a tolerance: no step, however short, gave a finite state.
    NOT_FINITE = 4
    #: A terminal event stopped it; ``Run.stopped_at`` says when.
    EVENT = 5
    #: Changes of its state by an event follow each other within no time, as of a ball that came to rest, or lead it back onto the
    #: event, as the level of an empty tank; ``Run.stopped_at`` says when.
    REST = 6


@by_value
class Paces(NamedTuple):
    """The adaptive steps of a run with a tolerance, per member, shape (*batch).

    Attributes:
        t: the start of the step that contains the last output time, or the time at which the member stopped.
        h: the length of the next step to try.
        accepted: number of accepted steps, since the first piece of the run.
        rejected: number of steps whose error was above the tolerance, likewise.
        evaluations: function (rate) evaluations of both, and of the extra steps for the output times, likewise; of a series, the
            operations of its coefficients over those of one evaluation, and none for output times.
    """

    t: Array
    h: Array
    accepted: Whole
    rejected: Whole
    evaluations: Whole


@by_value
class AdaptiveState(NamedTuple):
    """The state from which ``integrate`` continues a run with a tolerance.

    Attributes:
        v: velocities of each member at its own time, shape (*block, *batch).
        y: coordinates, likewise.
        pace: the state of the step-size controller, shape (numbers, *batch), with the last output time in it.
        last: the last output time.
        method: name of the method.
    """

    v: Array
    y: Array
    pace: Array
    last: Any
    method: str


class Run(ValueEquality):
    """A run, with its saved states along the first axis.

    Attributes:
        t: times of the saved states, shape (saved,); (saved, *batch) where each member has a time of step 0 of its own.
        v: velocities, shape (saved, *block, *batch).
        y: coordinates, likewise.
        status: per member, ``Status.OK`` or why it ended, shape (*batch).
        first_bad_step: per member, the number of the first step after which the state was not finite, or at which a run with a
            tolerance stopped; −1 if there is none, shape (*batch).
        carry: what the method carries in place of v (Verlet: ``y_prev``, leapfrog: ``v_half``), or None; NaN for members that
            stopped at an event.
        system: the system that was stepped, with its control.
        method: the method.
        dt: the step.
        t0: time of step 0, or that of each member, shape (*batch).
        start_step: number of the first step.
        steps: number of steps.
        start: how the method was started, or None.
        recorded: the quantities named in ``record=``, by name, shapes (saved, *shape of it, *batch).
        sensitivity: the derivatives of y by what ``sensitivity=`` names, shapes (saved, *block, *own, *batch), with the axes of a
            parameter itself, or of the block for "v" and "y".
        sensitivity_of_v: the derivatives of v, likewise.
        events: where the quantities given as ``events=`` changed their signs, ``Occurrences`` by the name of the event.
        stopped_at: the time at which each member stopped, by a terminal event or, with a tolerance, by itself before the last
            output time; NaN for others, shape (*batch). Later saved states are that of the event, or NaN. None if none stopped by
            itself and there was no such event to look for.
        paces: the adaptive steps of a run with a tolerance, or None; ``dt`` and ``steps`` are not meaningful in such a run.
        fused: whether steps were computed with fused multiply-adds.
        force: what was added to v̇, or None, shape (*block, *batch).
        work: the energy that a control or a projection added to each member in this run, or None, shape (*batch). For a control
            it is the sum over the steps of ((1 − g)² − 1)·K, the change by its push −g·v alone, averaged over the evaluations.
            None in a run of fixed steps with events; with adaptive steps NaN for members that stopped at one.
        findings: what ``integrate`` warned of, each with the class of the warning, a message and the members.

    Example:
        >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, every=50)
        >>> run
        <run of Oscillator(omega=1.0, form='canonical') by rk4: 100 steps of 0.1, t = 0 to 10, 3 saved, 1 member: finite>
        >>> run.t
        array([ 0.,  5., 10.])
        >>> run.y.shape, run.energy.shape
        ((3,), (3,))
    """

    #: Names of the events that change the state, ``Event(…, then=…)``.
    changed_by: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    #: Whether it has the states after all accepted steps.
    has_each_step: bool = False
    #: Whether its last state is left out; see ``select``.
    is_part: bool = False

    def __init__(
        self,
        *,
        t: Array,
        v: Array,
        y: Array,
        status: np.ndarray[Any, np.dtype[np.int8]],
        first_bad_step: Whole,
        carry: Array | None,
        system: System,
        method: Method,
        dt: float,
        t0: Any,
        start_step: int,
        steps: int,
        start: str | None,
        collision: Callable[[tuple[int, ...], int], Collision] | None = None,
        encounter: Callable[..., Encounter | None] | None = None,
        overshoots: Callable[..., tuple[int, float] | None] | None = None,
        recorded: dict[str, Array] | None = None,
        work: Array | None = None,
        paces: Paces | None = None,
        controller_state: AdaptiveState | None = None,
        fused: bool = False,
        force: Array | None = None,
        options: dict[str, Any] | None = None,
    ) -> None:
        self.t = t
        self.v = v
        self.y = y
        self.status = status
        self.first_bad_step = first_bad_step
        self.carry = carry
        self.system = system
        self.method = method
        self.dt = dt
        self.t0 = t0
        self.start_step = start_step
        self.steps = steps
        self.start = start
        #: Finds the two nearest bodies when the member of that index diverged at that step; see ``collisions``.
        self.collision = collision
        #: Finds the first step in which two bodies of the member of that index met; see ``encounters``.
        self.encounter = encounter
        #: Finds the first step before which h·C·K of the member of that index was 1 or more, under a control in the printed form.
        self.overshoots = overshoots
        self.recorded = recorded or {}
        self.work = work
        self.paces = paces
        #: The state of a run with a tolerance at ``paces.t``; None for other runs.
        self.controller_state = controller_state
        self.fused = fused
        self.force = force
        #: The options that hold for a run that goes on, too, beside those that are attributes.
        self.options = FixedDict(options or {})
        #: The derivatives of the saved y, and of the saved v, by the names of ``sensitivity=``.
        self.sensitivity: dict[str, Array] = {}
        self.sensitivity_of_v: dict[str, Array] = {}
        self.events: dict[str, Occurrences] = {}
        self.stopped_at: Array | None = None

    @property
    def dtype(self) -> str:
        """The type of the states and of the arithmetic of the steps: "float64" or "float32"."""
        return str(self.y.dtype)

    def select(self, saved: Any) -> Run:
        """The run with some of its saved states; what is known of the whole run stays, such as how members ended, and its events.

        Without the last state it is not one from which another run goes on.

        Raises:
            ArgumentError: if there is no such saved state.

        Args:
            saved: which, by an index of the first axis: a number, which leaves that axis, a slice, numbers or truths.

        Example:
            >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, every=1)
            >>> run.select(slice(0, None, 50)).t
            array([ 0.,  5., 10.])
            >>> run.select(run.y < -0.99).t[[0, -1]].round(1)
            array([3. , 9.5])
            >>> run.select(-1).y.shape
            (1,)
        """
        if saved is None:  # which NumPy takes for another axis
            raise ArgumentError("saved: expected an index of the saved states, got None")
        try:
            places = np.atleast_1d(np.arange(len(self.t))[saved])
        except IndexError as error:
            raise ArgumentError(
                f"saved: expected an index of the {len(self.t)} saved states, got {checks.short(saved)} ({error})"
            ) from None
        part = copy.copy(self)
        part.t, part.v, part.y = self.t[places], self.v[places], self.y[places]
        for of_states in ("recorded", "sensitivity", "sensitivity_of_v"):
            setattr(part, of_states, {name: values[places] for name, values in getattr(self, of_states).items()})
        part.has_each_step = False
        part.is_part = self.is_part or not len(places) or bool(places[-1] != len(self.t) - 1)
        return part

    def __call__(self, t: Any) -> Any:
        """The states at times between the saved ones, of a run with a tolerance and ``every=1``.

        They are those at the times of ``at=``, of the continuous extension of the method; where it has none, and in a step in
        which an event stopped a member, each is computed by a step of the method from the end of the accepted step before it.
        Where an event stopped a member, its states after that are that of the event; where a member stopped by itself, NaN.

        Args:
            t: times within the run, units of time, of any shape; the same for all members.

        Returns:
            The coordinates, shape (*t, *block, *batch); of a system with velocities v and y, both of this shape.

        Raises:
            ArgumentError: if a time is outside the run.
            UnsupportedError: if the run does not have all of its steps, or an event changed its states.
            TooLargeError: if the states do not fit in memory.

        Example:
            >>> run = sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=1e-9, at=10.0, every=1)
            >>> v, y = run(np.linspace(0.0, 10.0, 1001))
            >>> y.shape, bool(np.abs(y - np.cos(np.linspace(0.0, 10.0, 1001))).max() < 1e-8)
            ((1001,), True)
        """
        v, y = registry.task("states_of_run")(self, t)
        return (v, y) if self.system.v_shape != (0,) else y

    def _contents(self) -> dict[str, Any]:
        """All attributes but the functions that go through the steps again, which follow from the others."""
        return {name: each for name, each in vars(self).items() if name not in ("collision", "encounter", "overshoots")}

    def quantity(self, name: str) -> Array:
        """A quantity that can be recorded, computed now for every saved state, shape (saved, *shape of it, *batch).

        It is computed in float64, whatever the states are.

        Raises:
            UnknownNameError: if the system has none of that name.
        """
        from .engine.recorded import recorded  # only quantities of saved states need it

        name = checks.known("name", name, ("energy", *self.system.quantities))
        if name not in self.system.quantities:
            self.system.energy(self.v[-1], self.y[-1])  # raises, since there is none
        return recorded(self.system, (name,), self.dt, self.v, self.y)[name]

    @property
    def energy(self) -> Array:
        """Energy of every saved state, shape (saved, *batch): what was recorded, or computed now, with the same bits."""
        if "energy" in self.recorded:
            return self.recorded["energy"]
        return self.quantity("energy")

    @property
    def z(self) -> Array:
        """Auxiliary outputs of every saved state, shape (saved, outputs, *batch), computed now; see the system's ``auxiliary``.

        Raises:
            UnsupportedError: if the system has none.
        """
        states: Any = zip(self.t.tolist() if self.t.ndim == 1 else self.t, self.v, self.y, strict=True)
        with np.errstate(all="ignore"):
            return np.stack([self.system.auxiliary(t, v, y) for t, v, y in states])

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """For bodies that attract each other: the two nearest bodies when a member diverged, one pair for each such member.

        They are found by repeating the run of these members up to that step, which takes as long as it took before. Members that
        had diverged before this run are left out.

        Raises:
            UnsupportedError: if the system has no bodies, or the run has a tolerance, which chooses steps that follow collisions.
        """
        if self.collision is None:
            why = f"{self.system!r} has no bodies that collide" if self.paces is None else "expected a run with fixed steps"
            raise UnsupportedError(f"collisions: {why}")
        diverged = np.argwhere(self.first_bad_step > self.start_step).tolist()
        return tuple(self.collision(tuple(index), int(self.first_bad_step[tuple(index)])) for index in diverged)

    @property
    def encounters(self) -> tuple[Encounter, ...]:
        """For bodies that attract each other: the first step in which two of them met, for each such member.

        In such a step the line from one body to the other turns by more than a right angle, or they move past each other by more
        than twice the distance at which they begin or end. So it did not follow the motion, whatever the energy says.
        Encounters that turn the bodies themselves by less than 0.01 rad are left out. With ``wisdom_holman`` it is the first step
        in which two bodies around the first one came within three of their Hill radii, where kicks do not follow them.

        They are found by repeating the run with all of its states, which takes some times as long as it took before.

        Raises:
            UnsupportedError: if the system has no bodies, or the run has a tolerance, which chooses steps that follow encounters.
        """
        if self.encounter is None:
            why = f"{self.system!r} has no bodies that meet" if self.paces is None else "expected a run with fixed steps"
            raise UnsupportedError(f"encounters: {why}")
        encounters = (self.encounter(index) for index in np.ndindex(self.status.shape))
        return tuple(each for each in encounters if each is not None)

    def save(self, path: str | Path) -> None:
        """Write the run to a file, from which ``stepwell.load`` reads it again, bit for bit, and from which it goes on.

        All arrays are there under their names, for any program that reads such files: ``np.load(path)["y"]``. The system, its
        control and what a method carries are there, too. Of a system of your own equations there are the name of its function and
        a digest of its operations, but not the function. A file that is there already is replaced when the new one is complete.

        Args:
            path: the file, ending in .npz, or in .zarr for a folder of compressed arrays, which needs the package zarr.

        Raises:
            ArgumentError: if the ending is another, or the file cannot be written.
            UnsupportedError: if the file ends in .zarr and zarr is not installed.
        """
        registry.task("save_run")(self, path)

    def to_xarray(self, dims: Sequence[str] | None = None, coords: Mapping[str, Any] | None = None) -> Dataset:
        """The run as an xarray ``Dataset``: the saved states, what was recorded, and how the members ended.

        The arrays are those of the run, not copies. They have the axis ``t``, those of a block, and those of the batch.

        Args:
            dims: names of the batch axes; "member", or "member_0", "member_1", … if None.
            coords: further coordinates, as ``Dataset`` takes them: ``{"omega": ("member", omega)}`` for the parameter of a sweep.

        Raises:
            ArgumentError: if there is not one name for each axis, or a name is given twice.
            UnsupportedError: if xarray is not installed.
        """
        dataset: Dataset = registry.task("run_to_xarray")(self, dims, coords)
        return dataset

    def to_dataframe(self, dims: Sequence[str] | None = None) -> DataFrame:
        """The run as a pandas ``DataFrame``: a row for each saved state of each member, a column for each of its numbers.

        The index is the time, and the member in a batch. The columns are v and y, or v_0, v_1, … of a block, and what was
        recorded.

        Args:
            dims: names of the batch axes in the index; "member", or "member_0", "member_1", … if None.

        Raises:
            ArgumentError: if there is not one name for each axis, or a name is given twice.
            UnsupportedError: if pandas is not installed.
        """
        frame: DataFrame = registry.task("run_to_dataframe")(self, dims)
        return frame

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the motion and its energy error, and write the picture to ``path`` if given.

        For errors of the state see ``stepwell.charts.run_picture``, which knows the exact solution of a scene.

        Args:
            path: the file; its ending says in which format.

        Returns:
            The figure; a notebook shows it.

        Raises:
            ArgumentError: if the run is of a batch, fewer than two states were saved, or there is no such format.
            UnsupportedError: if matplotlib is missing.

        Example:
            >>> import stepwell as sw
            >>> run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=100, every=1)
            >>> figure = run.plot()
        """
        figure: Figure = registry.task("picture_of_run")(self).plot(path)
        return figure

    def animate(
        self,
        path: str | Path,
        *,
        seconds: float = 10.0,
        fps: float = 20.0,
        progress: Callable[[float], object] | None = None,
    ) -> None:
        """Write an animation of the motion; its frames are the saved states.

        A page (.html) is small, is written at once, and has a button and a slider; it needs neither matplotlib nor a network.

        Args:
            path: the file, ending in .html, .gif or .mp4.
            seconds: how long it lasts, above zero.
            fps: frames a second, above zero; fewer if fewer states were saved. A page shows as many states as it has room for.
            progress: a function that is called with the share of the frames that are drawn, from 0 to 1; a page has none.

        Raises:
            ArgumentError: if the run is of a batch, fewer than two states were saved, or an argument is wrong.
            UnsupportedError: for .gif and .mp4, if matplotlib is missing; for .mp4, if ffmpeg is.
        """
        registry.task("picture_of_run")(self).animate(path, seconds=seconds, fps=fps, progress=progress)

    def __repr__(self) -> str:
        summary = dict(self._summary())
        tolerance = "" if self.paces is None else " with a tolerance"
        steps = f"{summary['steps']}, t = {summary['time']}"
        end = f"{summary['saved states']} saved, {summary['members']}: {summary['verdict']}"
        return shortened(f"<run of {self.system!r} by {self.method.name}{tolerance}: {steps}, {end}>", MAX_LINE)

    def _repr_html_(self) -> str:
        """The summary as a table, for notebooks."""
        return facts(f"{self.system.kind_name} by {self.method.title}", [("system", repr(self.system)), *self._summary()])

    def _summary(self) -> list[tuple[str, str]]:
        """Steps, time, saved states, members and how they ended, each with its name."""
        diverged = ~np.isin(self.status, (Status.OK, Status.EVENT, Status.REST))
        members, bad = self.status.size, int(np.count_nonzero(diverged))
        if self.paces is None:
            steps = f"{counted(self.steps, 'step')} of {self.dt:g}"
            begins, ends = self.t0 + self.start_step * self.dt, self.t0 + (self.start_step + self.steps) * self.dt
            ending, number = "diverged", int(self.first_bad_step[diverged].min()) if bad else None
        else:
            rejected = int(self.paces.rejected.sum())
            steps = f"{counted(int(self.paces.accepted.sum()), 'step')}, {rejected} rejected"
            begins, ends, ending, number = self.t0, self.t[-1], "stopped early", None
        backward = np.any(ends < begins)
        first, last = (np.max(begins), np.min(ends)) if backward else (np.min(begins), np.max(ends))
        when = "" if number is None or np.ndim(self.t0) else f" (t = {self.t0 + number * self.dt:g})"
        at = "" if number is None else f"{', the first' if bad > 1 else ''} at step {number}{when}"
        verdict = "finite" if not bad else f"{ending}{at}" if members == 1 else f"{bad} of {members} {ending}{at}"
        for status, what in ((Status.EVENT, "stopped at an event"), (Status.REST, "came to rest at an event")):
            if some := int(np.count_nonzero(self.status == status)):
                verdict += f", {some} of {members} {what}" if members > 1 else f", {what}"
        return [
            ("steps", steps + (", fused" if self.fused else "") + ("" if self.dtype == "float64" else f", {self.dtype}")),
            ("time", f"{first:g} to {last:g}"),
            ("saved states", str(len(self.t))),
            ("members", counted(members, "member")),
            ("verdict", verdict),
        ]
