"""A force from outside: read by a world before its steps, to the bit as in the reference, and free where there is none."""

from __future__ import annotations

import copy
import itertools
import pickle
import re
import sys
from collections import Counter
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, DTypeError, FixedError, ShapeError, UnsupportedError
from stepwell.reference import around
from stepwell.runs import engine
from support.calls import assert_raises
from support.cases import ADAPTIVE, SOME, SYSTEMS, assert_same, drawn, fits
from support.graphs import assert_traced_alike, methods
from support.looped import looped
from support.mistakes import mistaken
from support.springs import lattice
from support.tracing import made
from support.ways import assert_equal_ways

PUSHED = [name for name, make in SYSTEMS.items() if make(np.random.default_rng(0), 1).v_shape != (0,)]
METHODS = [method.name for method in sw.methods()]
ABLE = [method.name for method in sw.methods() if method.error_order is not None]
#: A method of each structure: of one stage and more, carried in two ways, implicit, a series.
STRUCTURES = ["false_euler", "leapfrog", "verlet", "rk4", "implicit_midpoint", "rodas4", "pefrl", "taylor"]


def forced(name: str, members: int = 5, seed: int = 3) -> tuple[sw.System, Any, Any, Any]:
    """A system, a state and a force."""
    rng = np.random.default_rng(seed)
    system = SYSTEMS[name](rng, members)
    shapes = (system.v_shape, system.y_shape, system.v_shape)
    return (system, *(rng.normal(size=(*shape, members)) for shape in shapes))


# ---- the reference, and the core


def tried(system: sw.System, some: int | None, name: str) -> list[sw.Method]:
    """By default two methods of each system: without a force test_graphs.py compares all."""
    return drawn(list(methods(system)), some, "force", name)


@SOME
@looped("name", PUSHED)
def test_one_graph(name: str, some: int | None) -> None:
    """For every input: the core's step and the reference's are one graph of operations, and so is what a method carries."""
    system, v, _ = made(name)
    for method in tried(system, some, name):
        assert_traced_alike(system, method, "step", *("start 0", "finish 0") * bool(method.carry), force=np.ones_like(v))


#: Where sums with a force are no others but for it. Friction compares them; a body alone, particles and what is fixed have no
#: other force that changes, so that products and sums of it are done beforehand; and a step that meets a surface evaluates rates
#: again for what the method carries.
def plainly(name: str) -> bool:
    return name not in ("block with friction", "one body", "particles") and not re.search("floor|^friction|^springs: ", name)


@SOME
@looped("name", [name for name in PUSHED if plainly(name)])
def test_without_a_force_the_step_is_the_one_before(name: str, some: int | None) -> None:
    """With one, each rate evaluation takes an addition more for each number of v, and nothing else is done in a step."""
    system, _, _ = made(name)
    for method in tried(system, some, name):
        plan = engine.Plan(system, method, system.batch, 0.1)
        counts = []
        for force in (None, np.ones((*system.v_shape, *system.batch))):
            tape = _core.Tape()
            lines, _ = tape.operations(tape.trace(engine.model(plan._replace(force=force)), "step"))
            counts.append(Counter(line[0] for line in lines))
        without, pushed = counts
        numbers = int(np.prod(system.v_shape))
        # h·force once for each number of v, and a sum for each that is computed; equal ones are one.
        assert pushed["multiply"] - without["multiply"] == numbers
        sums = ("add", "subtract", "negate")  # of which one may be written as another
        # A rate −x with a force is force − x; series and derivatives have the sign of x in their sums then.
        # Likewise where friction takes a rate from v and from what v becomes, so that it stands in a sum twice.
        rubs = "friction" in name
        counted = sums[:2] if method.has_derivatives or rubs else sums
        assert 0 < sum(pushed[each] - without[each] for each in counted) <= (1 + rubs) * numbers * method.evaluations
        others = set(without) - {"multiply", "parameter", "step", *sums}
        assert {each: without[each] for each in others} == {each: pushed[each] for each in others}


def assert_a_world_goes_as_pieces(
    system: sw.System, method: str, v: Any, y: Any, force: Any, pieces: tuple[int, ...], backend: str = "rust", **options: Any
) -> None:
    """The force changes between the calls of step; the run is made in pieces, each with the force of its own."""
    rng = np.random.default_rng(1)
    world = sw.World(system, method, v=v.copy(), y=y.copy(), force=force, **options)
    state: dict[str, Any] = {"v": v, "y": y} | options
    for steps in pieces:
        world.step(steps)
        run = sw.integrate(system, method, steps=steps, backend=backend, force=force, **state)
        np.testing.assert_array_equal(world.y, run.y[-1])
        np.testing.assert_array_equal(world.v, run.v[-1])
        state = {"resume": run}
        force[...] = rng.normal(size=force.shape)


@looped("method", STRUCTURES)
def test_a_force_may_change_between_steps(method: str) -> None:
    names = ("free", "pendulum, damped", "friction", "three bodies", "chain of nineteen", "linear, masses", "own: Duffing")
    for name in names:
        for members in (5, 97) if method in ("leapfrog", "rk4") else (1,):
            system, *blocks = forced(name, members)
            if fits(system, sw.method(method)):
                assert_a_world_goes_as_pieces(system, method, *blocks, (3, 1, 7), dt=0.1, t0=0.3)


def springs_in_space(n: int) -> sw.System:
    return SYSTEMS["own: springs in space"](np.random.default_rng(0), 1).definition().for_state_shapes(None, np.zeros((n, 3)))


MATRIX = sw.LinearSystem(-np.eye(80) - np.ones((80, 80)) / 80)


@looped(
    "system, members, names",
    [
        (sw.NBody(np.full(60, 1 / 60), softening=0.1), 1, ("verlet", "rk4")),
        (sw.NBody(np.full(60, 1 / 60), softening=0.1, dim=3), 3, ("false_euler", "leapfrog")),
        (sw.NBody(np.full(40, 1 / 40), softening=0.1), 9, ("verlet", "rk4")),
        (sw.Chain(3000), 1, ("leapfrog", "rk4", "dop853")),
        (sw.Chain(1500), 2, ("false_euler", "verlet")),
        (MATRIX, 1, ("false_euler", "merson")),
        (MATRIX, 9, ("rk4",)),
        (springs_in_space(300), 2, ("leapfrog", "rk4")),
        (springs_in_space(100), 1, ("dop853",)),
    ],
)
def test_large_systems(system: sw.System, members: int, names: tuple[str, ...]) -> None:
    """By kernels written by hand and by tapes of the rates, with more numbers than are copied; adaptive steps back, too."""
    rng = np.random.default_rng(2)
    system = system.for_state_shapes(np.zeros(system.v_shape or 1), np.zeros(system.y_shape)) if system.v_shape else system
    shapes = [(*each, members) if members > 1 else each for each in (system.v_shape, system.y_shape, system.v_shape)]
    for method in names:
        blocks = v, y, force = [rng.normal(size=shape) for shape in shapes]
        if method not in ABLE:
            assert_a_world_goes_as_pieces(system, method, *blocks, (2, 1), "numpy", dt=0.01)
        for end in (0.02, -0.02) if method in ABLE else ():
            ask: dict[str, Any] = {"v": v, "y": y, "tolerance": 1e-3, "at": [end], "force": force}
            assert_same(*(sw.integrate(system, method, backend=backend, **ask) for backend in ("rust", "numpy")))


@looped("bodies, method", itertools.product([12, 30], ["false_euler", "rk4"]))
def test_a_rate_that_was_kept_is_not_used_with_another_force(bodies: int, method: str) -> None:
    """Whatever is kept from one step for the next, the next has the new force."""
    rng = np.random.default_rng(5)
    system = sw.NBody(np.full(bodies, 1.0), force="newton", softening=0.2)
    blocks = (rng.normal(size=(bodies, 2, 9)) for _ in range(3))
    assert_a_world_goes_as_pieces(system, method, *blocks, (1, 1, 1), "numpy", dt=0.01, control=sw.Projection())


@looped("control, bodies", itertools.product([sw.EnergyControl(0.3), sw.Projection(), sw.Projection("nacozy")], [3, 30, 60]))
def test_under_control(control: Any, bodies: int) -> None:
    """The force is no part of the energy that is kept: by each way of stepping, on one tape and over rows by a kernel."""
    rng = np.random.default_rng(5)
    system = sw.NBody(np.full(bodies, 1.0), softening=0.2)
    v, y, force = (rng.normal(size=(bodies, 2, 9)) for _ in range(3))
    options: dict[str, Any] = {"v": v, "y": y, "force": force, "control": control}
    steps: dict[str, Any] = {"dt": 0.01, "steps": 4, "record": ["energy", "momentum"]}
    ways = ("by the reference", "alone", "saved more often", "in a world")
    for method, ask in (("false_euler", steps), ("rk4", steps), ("merson", {"tolerance": 1e-4, "at": np.array([0.02, 0.05])})):
        run = assert_equal_ways(system, method, **options, **ask, ways=ways[:1] if method == "merson" else ways)
        reference = sw.integrate(system, method, **options, **ask, backend="numpy")
        np.testing.assert_array_equal(run.work, reference.work)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("np.asarray(dv + self.push)", "np.asarray(dv + self.push + self.push)"),
        ("pushed = np.asarray(dv + self.push)", "pushed, self.push = np.asarray(dv + self.push), 0.0 * self.push"),
        ("self.push = h * force", "self.push = force"),
        ("self.push = h * force", "self.push = -h * force"),
    ],
    ids=["twice", "in the first stage alone", "without the step", "against it"],
)
def test_wrong_forces_are_noticed(old: str, new: str, monkeypatch: pytest.MonkeyPatch) -> None:
    system, v, y, force = forced("pendulum, damped")
    arguments: dict[str, Any] = {"v": v, "y": y, "dt": 0.1, "steps": 3, "force": force}
    right = sw.integrate(system, "rk4", **arguments).y
    np.testing.assert_array_equal(sw.integrate(system, "rk4", backend="numpy", **arguments).y, right)
    monkeypatch.setattr(around, "Forced", mistaken(around, old, new).Forced)
    assert not np.array_equal(sw.integrate(system, "rk4", backend="numpy", **arguments).y, right)


@looped("method", METHODS)
def test_a_constant_force_moves_the_place_of_rest(method: str) -> None:
    """ÿ = −y + f is the free oscillator about y = f. Both runs make the same steps from v = 0, so they differ by rounding only:
    some ten operations a step of numbers below 4, over 200 steps whose map has powers below 3."""
    force, y = np.linspace(-1.0, 1.0, 7), np.linspace(0.0, 2.0, 7)
    run = sw.integrate(sw.Oscillator(), method, v=0.0, y=y, dt=0.05, steps=200, force=force)
    free = sw.integrate(sw.Oscillator(), method, v=0.0, y=y - force, dt=0.05, steps=200)
    assert np.abs(run.y[-1] - force - free.y[-1]).max() < 10 * 200 * 4 * 3 * 2.0**-53
    assert np.abs(run.v[-1] - free.v[-1]).max() < 10 * 200 * 4 * 3 * 2.0**-53


def test_friction_resists_it() -> None:
    """A block at rest stays, to the bit, up to μN, and is moved by more: v = (force − μN)·t, a sum of 100 equal terms."""
    force = np.array([0.0, 0.5, -0.5, 0.5 + 1e-9, -0.75, 2.0])
    v, y = np.zeros(6), np.full(6, 3.0)
    world = sw.World(sw.Oscillator(0.0, friction=0.5, form="physical"), "rk4", v=v, y=y, dt=0.01, force=force)
    world.step(100)
    np.testing.assert_array_equal(v[:3], 0.0)
    np.testing.assert_array_equal(y[:3], 3.0)
    np.testing.assert_allclose(v[3:], [1e-9, -0.25, 1.5], rtol=1e-6, atol=0)
    force[...] = 0.0
    world.step(2000)
    np.testing.assert_array_equal(v, 0.0)


@looped("members", [3, 700])
def test_it_allocates_nothing(members: int) -> None:
    system, v, y, force = forced("free", members)
    step = sw.World(system, "rk4", v=v, y=y, dt=1e-3, force=force).step
    step(3)
    before = sys.getallocatedblocks()
    for _ in range(1000):
        force[0] += 1e-3
        step(2)
    assert sys.getallocatedblocks() - before < 20  # as in test_world.py


COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda w: pickle.loads(pickle.dumps(w)),
    "resume": lambda w: sw.World(w.system, w.method, dt=w.dt, resume=w),
}


@looped("method, copying", itertools.product(["verlet", "rk4"], COPIES))
def test_a_copy_has_a_force_of_its_own(method: str, copying: str) -> None:
    system, v, y, force = forced("pendulum")
    world = sw.World(system, method, v=v, y=y, dt=0.1, force=force)
    world.step(3)
    other = COPIES[copying](world)
    np.testing.assert_array_equal(other.force, force)
    assert not np.shares_memory(other.force, force)
    world.step(4)
    other.step(4)
    np.testing.assert_array_equal(other.y, world.y)
    other.force[...] = 0.0
    assert force.all()


def test_a_run_goes_on_with_its_force() -> None:
    system, v, y, force = forced("pendulum")
    start: dict[str, Any] = {"v": v, "y": y, "dt": 0.1, "force": force}
    whole, half = (sw.integrate(system, "leapfrog", **start, steps=steps) for steps in (9, 5))
    world = sw.World(system, "leapfrog", **start)
    world.step(5)
    for first in (half, world):
        np.testing.assert_array_equal(sw.integrate(system, "leapfrog", dt=0.1, steps=4, resume=first).y, whole.y)


def test_which_bodies_collided_is_found_under_the_force_too() -> None:
    """Bodies of hardly any mass that a force brings together: by False Euler both are at −3 + ½ + 1 + 1½ = 0 after 3 steps."""
    y, force = np.array([[-3.0, 0.0], [3.0, 0.0]]), np.array([[0.5, 0.0], [-0.5, 0.0]])
    y, force = np.stack([y, y], axis=-1), np.stack([force, 0.0 * force], axis=-1)
    with pytest.warns(sw.DivergenceWarning, match="1 of 2 member"):
        run = sw.integrate(sw.NBody([1e-300, 1e-300]), "false_euler", v=0.0, y=y, dt=1.0, steps=20, force=force)
    assert run.first_bad_step.tolist() == [4, -1]
    assert [each.distance for each in run.collisions] == [0.0]


def test_it_cannot_be_assigned() -> None:
    world = sw.World(sw.Oscillator(), "rk4", v=np.zeros(2), y=np.ones(2), dt=0.1, force=np.zeros(2))
    with pytest.raises(FixedError, match="force: a world's force cannot be assigned; write into"):
        world.force = np.ones(2)
    assert sw.World(sw.Oscillator(), "rk4", v=np.zeros(2), y=np.ones(2), dt=0.1).force is None


BOTH = np.zeros((2, 3))


@looped(
    "force, error, message",
    [
        (1.0, DTypeError, "force: expected a NumPy array to read before the steps, got float"),
        (np.zeros(3, np.float32), DTypeError, "force: expected dtype float64 to read before the steps, got float32"),
        (np.zeros(2), ShapeError, r"force: expected shape \(3,\), got \(2,\)"),
        (np.zeros(6)[::2], ArgumentError, r"force: expected a C-contiguous array to .* the steps, got strides \(16,\)"),
        (np.full(3, np.nan), sw.errors.NotFiniteError, "force: expected finite numbers, got nan"),
        (BOTH[1], ArgumentError, "force: expected an array of its own, got one that shares memory with v or y"),
    ],
)
def test_wrong_arrays(force: Any, error: Any, message: str) -> None:
    assert_raises((lambda: sw.World(sw.Oscillator(), "rk4", v=BOTH[0], y=BOTH[1], dt=0.1, force=force), error, f"^{message}"))


def test_a_read_only_array_will_do() -> None:
    force = np.broadcast_to(0.5, (3,)).copy()
    force.flags.writeable = False
    world = sw.World(sw.Oscillator(), "rk4", v=np.zeros(3), y=np.ones(3), dt=0.1, force=force)
    world.step()
    assert world.v[0] != sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1).v[-1]


def test_what_does_not_go_with_a_force() -> None:
    lorenz, rates = SYSTEMS["own: Lorenz"](np.random.default_rng(0), 2), sw.LinearSystem(np.eye(2), velocities=0)
    y, step = np.ones((3, 2)), {"dt": 0.1, "steps": 1, "force": 1.0}
    no_v = r"force: it is added to the rates of v, and .* has no v; give it an input"
    assert_raises(
        (lambda: sw.World(lorenz, "rk4", y=y, dt=0.1, force=np.zeros((0, 2))), no_v),
        (lambda: sw.integrate(lorenz, "rk4", y=y, **step), no_v),
        (lambda: sw.integrate(rates, "rk4", v=0.0, y=np.ones(2), **step), no_v),
        (lambda: sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, **step, form="matrix"), "works with form='direct' only"),
        kind=UnsupportedError,
    )


PACED = [name for name in ADAPTIVE if name in PUSHED]


@SOME
@looped("name", PACED)
def test_one_graph_of_an_attempt(name: str, some: int | None) -> None:
    """Forward and backward in time, and where a member stands at the start."""
    system = SYSTEMS[name](np.random.default_rng(3), 1).uncontrolled
    force = np.ones((*system.v_shape, *system.batch))
    for method in drawn([each for each in map(sw.method, ABLE) if fits(system, each)], some, "attempt", name):
        # Derivatives have their signs elsewhere: the core takes those of −(a·b) on its tape, the reference those of (−a)·b.
        for backward in (False,) if method.has_derivatives else (False, True):
            assert_traced_alike(system, method, "attempt", "begin", force=force, backward=backward)


@looped("side", [4, 40])
def test_fixed_particles_feel_no_force(side: int) -> None:
    """On a tape and over rows, forward and backward: wind on all of it moves what is free, and not what holds it."""
    pairs, places = lattice(side, side, 2)
    corners, places = [0, side - 1], places / side
    net = sw.Springs(pairs, stiffness=50.0, rest=1.0 / side, fixed=corners)
    for method, ask in (
        ("leapfrog", {"dt": 0.01, "steps": 5}),
        ("merson", {"tolerance": 1e-4, "at": [0.05]}),
        ("merson", {"tolerance": 1e-4, "at": [-0.05]}),
    ):
        options: dict[str, Any] = {"v": 0.0, "y": places, "force": np.ones_like(places)} | ask
        run, reference = (sw.integrate(net, method, backend=backend, **options) for backend in ("rust", "numpy"))
        assert_same(run, reference)
        assert np.array_equal(run.y[-1][corners], places[corners])
        assert np.array_equal(run.v[-1][corners], np.zeros((2, 2)))
        assert (np.delete(run.y[-1], corners, axis=0) > np.delete(places, corners, axis=0)).all()


@looped("method", ABLE)
def test_adaptive_steps_are_as_right_as_without(method: str) -> None:
    """ÿ = −y + f is the free oscillator about y = f, of which the tolerance counts the size; forward and backward."""
    force, y = np.linspace(-1.0, 1.0, 7), np.linspace(1.5, 2.0, 7)
    for end in (7.0, -7.0):
        run = sw.integrate(sw.Oscillator(), method, v=0.0, y=y, tolerance=1e-9, at=[end], force=force)
        # Of a method of order 2 whose estimate is of the third order, h³ follows the tolerance, and the error h².
        most = 1e-5 if sw.method(method).order == 2 else 1e-7
        assert np.abs(run.y[-1] - force - (y - force) * np.cos(end)).max() < most
        assert np.abs(run.v[-1] + (y - force) * np.sin(end)).max() < most


def test_another_force_begins_anew() -> None:
    """The step that is held was made under the force of before, so a run with another one begins at the saved state."""
    ask: dict[str, Any] = {"tolerance": 1e-6, "max_steps": 100}
    first = sw.integrate(sw.Pendulum(), "dop853", v=0.0, y=1.0, at=[1.0], force=0.5, **ask)
    assert first.force == 0.5
    on = sw.integrate(sw.Pendulum(), "dop853", at=[2.0], resume=first, force=-0.5)
    anew = sw.integrate(sw.Pendulum(), "dop853", v=first.v[-1], y=first.y[-1], t0=1.0, at=[2.0], force=-0.5, **ask)
    assert abs(on.y[-1] - anew.y[-1]) < 1e-6
    assert abs(on.y[-1] - sw.integrate(sw.Pendulum(), "dop853", at=[2.0], resume=first).y[-1]) > 0.1


@looped("method", ABLE)
def test_events_of_adaptive_steps_under_a_force(method: str) -> None:
    """A throw, ÿ = f: it is back at 0 at t = −2v/f; the change is located in the run's own steps."""
    event = sw.Event(lambda t, v, y: y, name="back", direction=-1, terminal=True)
    force = np.array([-1.0, -2.0, -4.0])
    ask: dict[str, Any] = {"v": 3.0, "y": 0.0, "tolerance": 1e-9, "at": [10.0], "force": force, "events": event}
    run = sw.integrate(sw.Oscillator(0.0, form="physical"), method, **ask)
    np.testing.assert_allclose(run.stopped_at, -6.0 / force, rtol=1e-9)


def test_a_force_changes_the_energy_without_a_warning(recwarn: pytest.WarningsRecorder) -> None:
    start: dict[str, Any] = {"v": [[0.0, 0.0], [0.0, 1.0]], "y": [[0.0, 0.0], [1.0, 0.0]], "force": [[0.0, 0.0], [3.0, 0.0]]}
    sw.integrate(sw.NBody([1.0, 1e-3], force="newton"), "merson", **start, tolerance=1e-6, at=[20.0])
    assert not recwarn.list
