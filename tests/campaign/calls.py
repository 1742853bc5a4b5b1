"""Every call that is fuzzed: those of test_wrong_calls.py, and some that are made of several steps.

Each is a function and right arguments for it.
"""

import contextlib
import io
import itertools
from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.views.cli import main
from support import own_systems as own
from support.cases import ADAPTIVE, SYSTEMS, fits
from support.wrong_calls import CALLS, OF_METHODS, passage

#: Where files are written, in the process that makes the calls.
FOLDER = Path(mkdtemp(prefix="stepwell-campaign-"))

METHODS = [method.name for method in sw.methods()]


class WrongBitsError(AssertionError):
    """Two ways to the same numbers gave different ones."""


def same(what: str, one: Any, other: Any) -> None:
    """Raise unless two arrays have the same numbers."""
    if not np.array_equal(one, other, equal_nan=True):
        raise WrongBitsError(f"{what}: {np.asarray(one).ravel()[:4]} and {np.asarray(other).ravel()[:4]}")


def whole(value: Any) -> int:
    """A whole number of anything, for what is no argument of the package."""
    try:
        return int(value)
    except (TypeError, ValueError, OverflowError, np.ma.MaskError):
        return len(str(type(value)))


def world_stepped(steps: Any = 3, again: Any = 2, force: Any = None, **arguments: Any) -> sw.World:
    """A world that makes some steps, which are those of a run."""
    for name in ("v", "y"):
        if isinstance(arguments.get(name), float):
            arguments[name] = np.full(3, arguments[name])
    begun = {name: np.array(arguments[name]) for name in ("v", "y") if isinstance(arguments.get(name), np.ndarray)}
    world = sw.World(**arguments, force=force)
    world.step(steps)
    if again is not None:
        world.step(again)
    total = (1 if steps is None else whole(steps)) + (0 if again is None else whole(again))
    if 0 < total < 100 and set(begun) == {"v", "y"} and np.isfinite(world.v).all() and np.isfinite(world.y).all():
        options = {name: each for name, each in arguments.items() if name not in ("v", "y")}
        run = sw.integrate(**options, **begun, force=force, steps=total)
        same("v of world and run", world.v, run.v[-1])
        same("y of world and run", world.y, run.y[-1])
    return world


def in_pieces(system: Any, method: Any, first: Any = 3, second: Any = 4, **options: Any) -> sw.Run:
    """A run in two pieces, which is the run in one."""
    half = sw.integrate(system, method, steps=first, **options)
    going_on = {name: options[name] for name in ("form", "backend", "threads") if name in options}
    rest = sw.integrate(half.system.uncontrolled, half.method, steps=second, resume=half, **going_on)
    entire = sw.integrate(system, method, steps=whole(first) + whole(second), **options)
    if rest.start_step + rest.steps == entire.start_step + entire.steps:
        same("v in pieces and at once", rest.v[-1], entire.v[-1])
        same("y in pieces and at once", rest.y[-1], entire.y[-1])
    return rest


def as_the_reference(instance: Any, record: Any, members: int, rng: Any, what: str, **options: Any) -> sw.Run:
    """A run from a random state, which has the bits of the reference."""
    state = {block: rng.normal(size=(*shape, members)) for block, shape in (("v", instance.v_shape), ("y", instance.y_shape))}
    run = sw.integrate(instance, record, **state, **options)
    reference = sw.integrate(instance, record, **state, **options, backend="numpy")
    for block in ("t", "v", "y", "first_bad_step"):
        same(f"{block} of the core and the reference, {what} by {record.name}", getattr(run, block), getattr(reference, block))
    return run


def right_run(system: Any = 0, method: Any = 0, members: Any = 3, seed: Any = 0, **options: Any) -> sw.Run:
    """A right run of a system and a method that are named by numbers."""
    name = list(SYSTEMS)[whole(system) % len(SYSTEMS)]
    rng, members = np.random.default_rng(whole(seed) % 2**32), whole(members) % 20 + 1
    instance, record = SYSTEMS[name](rng, members), sw.method(METHODS[whole(method) % len(METHODS)])
    record = record if fits(instance, record) else sw.method("rk4")
    return as_the_reference(instance, record, members, rng, name, **{"dt": 0.1} | options)


def right_adaptive_run(system: Any = 0, method: Any = 0, seed: Any = 0, tolerance: Any = 1e-3, until: Any = 0.5) -> sw.Run:
    """The same with adaptive steps."""
    name, rng = ADAPTIVE[whole(system) % len(ADAPTIVE)], np.random.default_rng(whole(seed) % 2**32)
    instance, record = SYSTEMS[name](rng, 2), sw.method(("merson", "fehlberg", "fehlberg_5", "dop853")[whole(method) % 4])
    return as_the_reference(instance, record, 2, rng, name, tolerance=tolerance, at=[0.1, until], max_steps=60)


SAVED = FOLDER / "whole.npz"
sw.integrate(sw.Oscillator(np.ones(3)), "verlet", v=0.0, y=1.0, dt=0.1, steps=3, every=1).save(SAVED)
WHOLE = SAVED.read_bytes()
NUMBERS = itertools.count()


def load_damaged(at: Any = 0, by: Any = 1, length: Any = -1) -> Any:
    """A file of a run in which a byte was changed, or the end is missing: refused, or the run that it was."""
    data = bytearray(WHOLE)
    data[whole(at) % len(data)] ^= whole(by) % 256
    path = FOLDER / f"damaged{next(NUMBERS)}.npz"
    path.write_bytes(data[: whole(length) % (len(data) + 1)] if whole(length) >= 0 else data)
    try:
        return sw.load(path)
    finally:
        path.unlink()


def command(*_: Any, **words: Any) -> str:
    """The command line: 0, or 2 and a line that begins with the name of the command."""
    printed, wrong = io.StringIO(), io.StringIO()
    arguments = [str(word) for word in words.values() if word is not None]
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(wrong), contextlib.chdir(FOLDER):
        try:
            code = main(arguments)
        except SystemExit as left:  # argparse leaves so
            code = int(left.code or 0)
    if code not in (0, 2) or "Traceback" in wrong.getvalue() or (code == 2 and not wrong.getvalue().strip()):
        raise WrongBitsError(f"stepwell {arguments} ended with {code}: {wrong.getvalue()[-300:]}")
    return printed.getvalue()


def own_step(kind: Any = 0, steps: Any = 3, y: Any = 1.0, dt: Any = 0.1, **parameters: Any) -> sw.Run:
    """Own equations with strange parameters."""
    several = (own.duffing, own.pendulum, own.bouncing, own.pushed)
    equations = several[whole(kind) % len(several)](**parameters)
    run = sw.integrate(equations, "rk4", v=0.0, y=y, dt=dt, steps=steps)
    reference = sw.integrate(equations, "rk4", v=0.0, y=y, dt=dt, steps=steps, backend="numpy")
    same("v of the core and the reference", run.v, reference.v)
    same("y of the core and the reference", run.y, reference.y)
    return run


FREE: dict[str, Any] = {"system": sw.Oscillator(), "method": "rk4", "v": 0.0, "y": 1.0, "dt": 0.1}
BODIES: dict[str, Any] = {"system": sw.NBody([1.0, 2.0], softening=0.3), "method": "verlet", "dt": 0.01}
BODIES |= {"v": np.zeros((2, 2)), "y": np.array([[0.0, 1.0], [1.0, 0.0]])}

MORE: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "World stepped": (
        world_stepped,
        FREE | {"steps": 3, "again": 2, "t0": 0.0, "start_step": 0, "control": None, "force": None, "fused": False},
    ),
    "World of bodies stepped": (world_stepped, BODIES | {"steps": 3, "again": 2, "start": "first_order", "resume": None}),
    "in pieces": (
        in_pieces,
        FREE | {"first": 3, "second": 4, "every": 2, "t0": 0.0, "form": "direct", "fused": False, "force": 0.1},
    ),
    "in pieces by Verlet": (in_pieces, BODIES | {"first": 3, "second": 4, "every": 1, "start": "second_order", "threads": 2}),
    "right run": (right_run, {"system": 0, "method": 0, "members": 3, "seed": 0, "dt": 0.1, "steps": 5, "every": None}),
    "right run at once": (right_run, {"system": 3, "method": 4, "members": 3, "seed": 0, "fused": True, "every": 1, "steps": 70}),
    "right adaptive run": (right_adaptive_run, {"system": 0, "method": 0, "seed": 0, "tolerance": 1e-3, "until": 0.5}),
    "load a damaged file": (load_damaged, {"at": 0, "by": 1, "length": -1}),
    "command": (command, {"a": "run", "b": "oscillator", "c": "--steps", "d": "3", "e": "--method", "f": "rk4", "g": "--json"}),
    "command methods": (command, {"a": "methods", "b": "--json"}),
    "command stability": (command, {"a": "stability", "b": "rk4", "c": "--json"}),
    "command explain": (command, {"a": "explain", "b": "oscillator", "c": "--method", "d": "rk4"}),
    "own equations": (own_step, {"kind": 0, "steps": 3, "y": 1.0, "dt": 0.1, "omega": 1.0}),
    "own pendulum": (own_step, {"kind": 1, "steps": 3, "y": 1.0, "dt": 0.1, "omega": 1.0}),
    "own choice": (own_step, {"kind": 2, "steps": 3, "y": 1.0, "dt": 0.1, "stiffness": 100.0, "gravity": 1.0}),
    "own push": (own_step, {"kind": 3, "steps": 3, "y": 1.0, "dt": 0.1, "k": 1.0, "x": 0.0}),
    "events of two": (
        sw.integrate,
        FREE | {"steps": 30, "events": [passage, sw.Event(passage, direction=-1, name="down")], "every": 7},
    ),
    "criteria of one": (sw.criteria, OF_METHODS | {"phi": 0.1}),
}

#: Nothing to do with this machine: peers may not be installed.
EVERY = {name: each for name, each in (CALLS | MORE).items() if not name.startswith("charts.peers.")}

WORK = frozenset({
    "steps", "first", "second", "again", "n", "every", "transient", "observe", "at", "tolerance", "dt", "max_steps", "until",
    "size", "t_span", "t_eval", "max_step", "first_step", "rtol", "atol", "y0", "phi", "periods", "horizon", "evaluations",
    "gains", "planks", "modes", "methods", "scenes", "scene", "tolerances", "settings", "exponents", "axes", "masses",
    "members", "system", "method", "v", "y", "fun", "events", "a", "b", "c", "d", "e", "f", "g", "relative", "t0", "near",
    "chunk", "threads", "frame", "amplitude", "share", "budget", "cost", "args", "most", "spin", "start_step", "backend",
})  # fmt: skip
