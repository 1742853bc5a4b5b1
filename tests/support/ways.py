"""One run in each way in which it can be made: all have the same bits.

``assert_equal_ways(system, method, v=…, y=…, **options)`` makes the run once and then in each of ``WAYS``: by the reference, at
each CPU level, members alone and in other company, on threads, in pieces, from a file, prepared, in a world, saved more often.
Which combinations of options are tried is in ``test_ways.py``.
"""

from __future__ import annotations

import os
import pickle
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.base.immutable import changed
from stepwell.model.around import Part
from stepwell.runs.short_runs import _kept

#: Options of a run that a world has, too, and those that a piece of a run is given again.
OF_A_WORLD = ("dt", "t0", "start_step", "start", "control", "force", "fused", "dtype", "events")
OF_A_PIECE = ("every", "record", "events", "form")

#: What a member has an axis of its own for, among the options.
OF_MEMBERS = ("v", "y", "t0", "at", "force", "tolerance")


@contextmanager
def kernels(level: str) -> Iterator[None]:
    """In this context steps are made at this CPU level."""
    before = os.environ.get("STEPWELL_KERNELS")
    os.environ["STEPWELL_KERNELS"] = level
    try:
        yield
    finally:
        os.environ.pop("STEPWELL_KERNELS") if before is None else os.environ.update(STEPWELL_KERNELS=before)


def members(value: Any, which: Any, b: int) -> Any:
    """Of b members, these: of whatever holds arrays, those whose last axis is the members'."""

    def one(value: Any) -> Any:
        match value:
            case np.ndarray() if value.ndim and value.shape[-1] == b:
                return value[..., which]
            case list() | tuple() if not hasattr(value, "_fields"):
                return type(value)(map(one, value))
            case dict():
                return {name: one(each) for name, each in value.items()}
            case sw.System():
                batch = np.empty(b)[which].shape
                return changed(value, **{name: one(each) for name, each in vars(value).items()} | {"batch": batch})
            case Part() | sw.Sinusoid() | sw.Sampled() | sw.Floor() | sw.Sphere():
                return changed(value, **{name: one(each) for name, each in vars(value).items()})
        return value

    return one(value)


@dataclass(frozen=True)
class Asked:
    """A run of b members: what is asked, and what came out."""

    system: Any
    method: Any
    options: dict[str, Any]
    b: int
    run: Any = None

    def make(self, **more: Any) -> sw.Run:
        """The run with these options in place of its own; nothing that the package remembers of others is used."""
        _kept.clear()
        options = {name: each for name, each in (self.options | more).items() if each is not None}
        return sw.integrate(self.system, self.method, **options)

    def of(self, which: Any) -> Asked:
        """The same of these members."""
        options = {name: members(each, which, self.b) if name in OF_MEMBERS else each for name, each in self.options.items()}
        return replace(self, system=members(self.system, which, self.b), options=options)

    @property
    def adaptive(self) -> bool:
        return "tolerance" in self.options

    def piece(self, part: int) -> dict[str, Any]:
        """The first third of the steps or times, or the rest."""
        if self.adaptive:
            at = self.options["at"]
            cut = max(1, len(at) // 3)
            return {"at": at[:cut] if part == 0 else at[cut:]}
        steps = self.options["steps"]
        cut = max(1, steps // 3)
        return {"steps": cut if part == 0 else steps - cut}


def same_arrays(one: Any, other: Any, what: str) -> None:
    """To the bit, but for the bits of a NaN."""
    if one is None or other is None:
        assert one is other, what
        return
    one, other = np.asarray(one), np.asarray(other)
    assert one.dtype == other.dtype, what
    np.testing.assert_array_equal(one, other, err_msg=what)
    if one.dtype.kind == "f":
        np.testing.assert_array_equal(np.signbit(one) & ~np.isnan(one), np.signbit(other) & ~np.isnan(other), err_msg=what)


def assert_same_run(run: sw.Run, whole: sw.Run, which: Any = slice(None)) -> None:
    """A run is that of these members of the whole: states, times, quantities, events, how it ended and what it took."""
    times = whole.t if whole.t.ndim == 1 else whole.t[..., which]
    # Of steps that are saved as they are made some members have fewer; their rows end with NaN in company.
    saved = slice(None) if len(run.t) == len(times) else ~np.isnan(times)
    same_arrays(run.t, times[saved], "t")
    for name in ("v", "y"):
        same_arrays(getattr(run, name), getattr(whole, name)[..., which][saved], name)
    for name in ("first_bad_step", "status"):
        same_arrays(getattr(run, name), getattr(whole, name)[..., which], name)
    for name, each in whole.recorded.items():
        same_arrays(run.recorded[name], each[..., which][saved], name)
    for name, one, other in zip(*((run.paces._fields, run.paces, whole.paces) if whole.paces else ((), (), ())), strict=True):
        same_arrays(one, other[..., which] if other.ndim else other, name)
    for name, each in (whole.events or {}).items() if np.shape(run.status) == np.shape(whole.status) else ():
        for part in ("count", "member", "step", "t", "v", "y"):
            same_arrays(getattr(run.events[name], part), getattr(each, part), f"{name}: {part}")


def by_the_reference(asked: Asked) -> None:
    assert_same_run(asked.make(backend="numpy"), asked.run)


def at_each_level(asked: Asked) -> None:
    for level in sw.isa_levels():
        with kernels(level):
            assert_same_run(asked.make(), asked.run)


def alone(asked: Asked) -> None:
    """The first and the last, each without a batch axis."""
    for i in {0, asked.b - 1}:
        assert_same_run(asked.of(i).make(), asked.run, i)


def in_company(asked: Asked) -> None:
    """A lane group that has one member too many, with more threads than groups; and several groups for each of two threads."""
    for number, threads in ((33, 7), (131, 2)):
        which = np.arange(number) % asked.b
        assert_same_run(asked.of(which).make(threads=threads), asked.run, which)


def _pieces(asked: Asked, between: Callable[[sw.Run], sw.Run]) -> None:
    if asked.run.stopped_at is not None and np.isfinite(asked.run.stopped_at).any():
        return  # who was stopped within a step does not go on, and each piece has max_steps of its own
    again = {name: each for name, each in asked.options.items() if name in OF_A_PIECE}
    again |= {"force": asked.options["force"]} if "force" in asked.options else {}
    first = between(asked.make(**asked.piece(0)))
    rest = sw.integrate(first.system, asked.method, **again | asked.piece(1) | {"resume": first})
    same_arrays(rest.t[-1], asked.run.t[-1], "t")
    same_arrays(rest.v[-1], asked.run.v[-1], "v")
    same_arrays(rest.y[-1], asked.run.y[-1], "y")
    same_arrays(rest.status, asked.run.status, "status")


def in_pieces(asked: Asked) -> None:
    _pieces(asked, lambda run: run)


def from_a_pickle(asked: Asked) -> None:
    _pieces(asked, lambda run: pickle.loads(pickle.dumps(run)))


def from_a_file(asked: Asked) -> None:
    def filed(run: sw.Run) -> sw.Run:
        with tempfile.TemporaryDirectory() as folder:
            run.save(Path(folder) / "run.npz")
            return sw.load(Path(folder) / "run.npz", system=asked.system)

    _pieces(asked, filed)


def prepared(asked: Asked) -> None:
    """From two starts, the second that of the run."""
    v, y = (asked.options.get(name) for name in ("v", "y"))
    call = sw.prepare(asked.system, asked.method, **asked.options)
    call(None if v is None else 0.5 * v, 0.9 * y)
    assert_same_run(call(v, y), asked.run)


def saved_more_often(asked: Asked) -> None:
    """The last state does not depend on how many are kept, nor on what is recorded of them."""
    if asked.adaptive:
        run = asked.make(at=asked.options["at"][-1:], record=None)
    else:
        run = asked.make(every=None if asked.options.get("every") else 1, record=None)
    same_arrays(run.v[-1], asked.run.v[-1], "v")
    same_arrays(run.y[-1], asked.run.y[-1], "y")
    same_arrays(run.status, asked.run.status, "status")


def in_a_world(asked: Asked) -> None:
    """Step by step and by several."""
    options = {name: each for name, each in asked.options.items() if name in OF_A_WORLD}
    dtype = options.get("dtype", "float64")
    v, y = (np.array(asked.options[name], dtype) for name in ("v", "y"))
    options |= {"force": np.array(options["force"], dtype)} if "force" in options else {}
    world = sw.World(asked.system, asked.method, v=v, y=y, **options)
    for steps in (1, 2, asked.options["steps"] - 3):
        world.step(steps)
    same_arrays(world.v, asked.run.v[-1], "v")
    same_arrays(world.y, asked.run.y[-1], "y")


Way = Callable[[Asked], None]

#: All ways of the core by their names.
WAYS: dict[str, Way] = {
    way.__name__.replace("_", " "): way
    for way in (
        by_the_reference, at_each_level, alone, in_company, in_pieces, from_a_pickle, from_a_file, prepared, saved_more_often,
        in_a_world,
    )
}  # fmt: skip


def assert_equal_ways(system: Any, method: Any, *, ways: Iterable[str] = WAYS, **options: Any) -> sw.Run:
    """Make the run in all of these ways, and return it. The last axis of y is that of the members."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        asked = Asked(system, method, options, options["y"].shape[-1])
        asked = replace(asked, run=asked.make())
        for way in ways:
            try:
                WAYS[way](asked)
            except Exception as error:
                error.add_note(f"{way}: {system!r} by {method} with {', '.join(sorted(options))}")
                raise
    return asked.run
