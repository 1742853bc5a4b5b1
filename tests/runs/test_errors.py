"""Bad input, and what could be misread without a word: a clear error before any work, tested by its text."""

import re
import warnings
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core, errors
from stepwell.runs import engine
from support.refusals import refused

FREE = sw.Oscillator(1.0)
GOOD: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 10}


@sw.system
def turning(t: Any, v: Any, y: Any) -> Any:
    return -y


def run(system: Any = FREE, method: Any = "false_euler", **options: Any) -> sw.Run:
    return sw.integrate(system, method, **(GOOD | options))


def world(system: sw.System = FREE, method: str = "false_euler", **options: Any) -> sw.World:
    return sw.World(system, method, **({"v": np.zeros(3), "y": np.ones(3), "dt": 0.1} | options))


def linear(B: Any = None, C: Any = None, D: Any = None, **options: Any) -> sw.LinearSystem:
    return sw.LinearSystem([[0.0, -1.0], [1.0, 0.0]], B, C, D, **options)


#: More members than memory has room for, in an array that takes none.
MANY = np.broadcast_to(1.0, (10**11,))


def readonly() -> Any:
    array = np.zeros(3)
    array.flags.writeable = False
    return array


def _height(t: Any, v: Any, y: Any) -> Any:
    return y


def paced(**options: Any) -> sw.Run:
    return sw.integrate(FREE, "merson", **{"v": 0.0, "y": 1.0, "tolerance": 1e-3, "at": [1.0]} | options)


second = sw.system(lambda t, v, y, *, k=1.0: -k * y)
first = sw.system(order=1)(lambda t, y, *, k=1.0: -k * y)
MASKED = np.ma.masked_array([1.0, 2.0, 3.0], [False, True, False])

#: Arguments go by their place, so a swapped name would silently stand for another number.
SWAPPED: list[tuple[Any, str]] = [
    (lambda: sw.system(lambda t, y, v: -y), "f(t, v, y), got (t, y, v): y stands at the place of v"),
    (lambda: sw.system(lambda t, x, v: -x), "f(t, v, y), got (t, x, v): v stands at the place of y"),
    (lambda: sw.system(lambda v, y, t: -y), "f(t, v, y), got (v, y, t): v stands at the place of t"),
    (lambda: sw.system(blocks=2)(lambda t, y, v: (-y, v)), "f(t, v, y), got (t, y, v)"),
    (lambda: sw.system(order=1)(lambda y, t: -y), "f(t, y), got (y, t): y stands at the place of t"),
    (lambda: sw.system(order=1)(lambda x, t: -x), "f(t, y), got (x, t): t stands at the place of y"),
    (lambda: sw.system(order=1)(lambda v, y: -y), "f(t, y), got (v, y): v stands at the place of t"),
    (lambda: run(events=sw.Event(lambda t, y, v: y, name="e")), "events: e: expected a function f(t, v, y), got (t, y, v)"),
    (lambda: run(events=sw.Event(lambda t, v, y: y, then=lambda t, y, v: (v, y), name="e")),
     "events: e: then: expected a function f(t, v, y), got (t, y, v)"),
    (lambda: second.invariant(lambda y, v: v * v + y * y), "f(v, y), got (y, v): y stands at the place of v"),
    (lambda: second.invariant(lambda v, y, t: v * v + y * y), "f(t, v, y), got (v, y, t)"),
    (lambda: first.invariant(lambda y, t: y * y), "f(t, y), got (y, t)"),
    (lambda: second(k=lambda v: abs(v)), "k: expected a function f(t), got (v): v stands at the place of t"),
    (lambda: sw.sweeps.Crossing(lambda v, y, t: y), "of: expected a function f(t, v, y), got (v, y, t)"),
    (lambda: sw.solve_ivp(lambda y, t: -y, (0.0, 1.0), [1.0]), "fun: <lambda>: expected a function f(t, y), got (y, t)"),
    (lambda: sw.solve_ivp(lambda t, y: -y, (0.0, 1.0), [1.0], events=lambda y, t: y[0]),
     "events: <lambda>: expected a function f(t, y), got (y, t)"),
]  # fmt: skip

#: Calls, and what their errors say, by the kind of error.
BAD: dict[type[Exception], list[tuple[Callable[[], Any], str]]] = {
    errors.UnknownNameError: [
        (lambda: run(t_span=(0.0, 1.0)), "t_span: integrate has no such argument; its start is t0="),
        (lambda: run(args=(2.0,)), "args: integrate has no such argument; parameters are those of the system"),
        (lambda: run(save_every=3), "save_every: integrate has no such argument; each so many steps are saved by every="),
        (lambda: sw.orbits.system([1.0, 1e-3], P=1.0), "P: system has no such argument; the time of a revolution is period="),
        (lambda: run(method="fals_euler"), "method: there is no 'fals_euler'; did you mean 'false_euler'? Known: "),
        (lambda: run(method="gillespie"), "method: gillespie is for stochastic simulation, which is not here"),
        (lambda: run(method="Boris"), "method: Boris is not here; leapfrog and pefrl are symplectic where"),
        (lambda: run(method="IAS15"), "method: IAS15 is REBOUND's, and not here; take taylor or dop853 with tolerance="),
        (lambda: run(method="kutta3"), "method: kutta3 is not here; write it as a function, stepwell.method"),
        (lambda: sw.World(turning, "rk4", v=np.zeros(1), y=np.ones(1), dt=0.1).set(k=1.0), "there is no 'k'. Known: none."),
        (lambda: run(method=3), "method: there is no 3. Known: standard_euler, "),
        (lambda: sw.method("hune"), "did you mean 'standard_heun'?"),
        (lambda: sw.method("Yoshida 4"), "Yoshida 4 is not here; nearest, but not the same: pefrl."),
        (lambda: sw.method("Störmer-Verlet"), "is the name of several methods: leapfrog, verlet"),
        (lambda: run(backend="nunpy"), "backend: there is no 'nunpy'; did you mean 'numpy'?"),
        (lambda: run(form="matrx"), "form: there is no 'matrx'; did you mean 'matrix'?"),
        (lambda: sw.Oscillator(form="canonic"), "form: there is no 'canonic'; did you mean 'canonical'?"),
        (lambda: run(method="verlet", start="second"), "start: there is no 'second'; did you mean 'second_order'?"),
        (lambda: sw.NBody(force="newtn"), "force: there is no 'newtn'"),
        (lambda: sw.NBody(force="newtons"), "force: there is no 'newtons'; did you mean 'newton'?"),
        (lambda: run(record=["energy", 3]), "record: there is no 3. Known: energy."),
    ],
    errors.ArgumentError: [
        (lambda: run().select(None), "saved: expected an index of the saved states, got None"),
        *SWAPPED,
        *(
            (lambda call=call: call(MASKED), "got a masked array in which 1 are masked")
            for call in (sw.Oscillator, sw.NBody, lambda y: run(y=y), lambda y: world(y=y))
        ),
        (lambda: run(steps=np.ma.masked_array(3, True)), "steps: expected a whole number, got a masked one"),
        *(
            (lambda most=most: run(max_steps=most), "max_steps: works with tolerance= and at= only")
            for most in ("junk", 5, 1_000_000)
        ),
        *(
            (lambda wrong=wrong: run(**wrong), "dt, t0: expected a time that moves on and stays finite")
            for wrong in ({"t0": 1e300}, {"t0": 1e16, "dt": 1e-3}, {"dt": 1e308}, {"dt": 5e-324, "t0": 1.0})
        ),
        (lambda: paced(at=None), "at: tolerance= needs the times at which to save states, too, such as at=[t1, t2]"),
        (lambda: paced(tolerance=None), "tolerance: at= needs the error that a step may have, too, such as tolerance=1e-6"),
        (lambda: run(start="first_order"), "start: false_euler starts in one way only, got 'first_order'"),
        (lambda: run(resume=run(), t0=1.0), "t0: the run that goes on has its own, got 1.0; to begin elsewhere,"),
        (lambda: sw.NBody(masses=[1, -2]), "masses: expected numbers of zero or more, got -2"),
        (lambda: sw.NBody(softening=-1.0), "softening: expected lengths of zero or more, got -1"),
        (lambda: sw.NBody(G=0.0), "G: expected numbers above zero"),
        (lambda: sw.NBody(dim=4), "dim: expected 2 or more, up to 3, got 4"),
        (lambda: run(dt=0.0), "dt: expected a number other than zero in units of time, got 0"),
        (lambda: run(dt=None), "dt: needed for fixed steps, got None; for adaptive steps give tolerance= and at="),
        (lambda: run(steps=0), "steps: expected 1 or more, got 0"),
        (lambda: run(steps=-5), "steps: expected 1 or more, got -5"),
        (lambda: run(steps=2**60), "steps: expected 1 or more, up to 9007199254740992, got 1152921504606846976"),
        (lambda: run(every=0), "every: expected 1 or more, got 0"),
        (lambda: run(threads=0), "threads: expected 1 or more, got 0"),
        (lambda: run(threads=10**6), "threads: expected 1 or more, up to 4096, got 1000000"),
        (lambda: run(start_step=-1), "start_step: expected 0 or more, got -1"),
        (lambda: sw.Oscillator(0.0), "omega: expected numbers above zero in rad per unit of time, got 0"),
        (lambda: sw.Oscillator([1.0, -2.0]), "omega: expected numbers above zero in rad per unit of time, got -2 at index (1,)"),
        (lambda: sw.Sampled([1.0], 0.0), "interval: expected numbers above zero in units of time, got 0"),
        (lambda: run(sw.Oscillator(a=sw.Sinusoid(1.0, 1e9)), t0=1e9),
         "omega, phase: a sinusoid's angle may grow to 1.13e+15 rad, but reaches 1e+18 rad by t = 1e+09"),
        (lambda: sw.Chain(0), "n: expected 1 or more, got 0"),
        (lambda: sw.Chain(2, mass=[1.0, 0.0]), "mass: expected numbers above zero, got 0"),
        (lambda: sw.Chain(2, stiffness=-1.0), "stiffness: expected numbers of zero or more, got -1"),
        (lambda: linear(np.ones((2, 1)), D=1.0), "D: expected C too, without which there are no outputs to add inputs to"),
        (lambda: linear(C=np.ones((1, 2)), D=1.0), "D: expected B too, without which there are no inputs"),
        (lambda: linear(x=1.0), "x: expected B too, without which there are no inputs"),
        (lambda: linear(velocities=3), "velocities: expected 0 or more, up to 2, got 3"),
        (lambda: linear(velocities=-1), "velocities: expected 0 or more, got -1"),
        (lambda: linear(velocities=[0, 2]), "velocities[1]: expected 0 or more, up to 1, got 2"),
        (lambda: linear(velocities=[-1]), "velocities[0]: expected 0 or more, got -1"),
        (lambda: linear(velocities=[1, 0, 1]), "velocities: expected distinct states, got 1 twice"),
        (lambda: run(steps=10**5000), "up to 9007199254740992, got int too long to print"),
        (lambda: sw.scenes.clover().run("rk4", v=0.0), "v: expected the scene's own, which need not be given"),
        (lambda: world(v=np.zeros(6)[::2]), "v: expected a C-contiguous array to step in place, got strides (16,)"),
        (lambda: world(v=readonly()), "v: expected a writeable array to step in place, got a read-only one"),
        (lambda: world(dt=0.0), "dt: expected a number other than zero"),
        (lambda: world().step(-1), "n: expected 0 or more, got -1"),
    ],
    errors.UnsupportedError: [
        (lambda: run(resume=run(y=[1.0, 2.0], steps=50, events=sw.Event(_height, terminal=True))),
         "resume: 2 of 2 members stopped at an event, at times of their own; begin a new run for each member i: "
         "v=run.v[-1][..., i], y=run.y[-1][..., i], t0=float(run.stopped_at[i])"),
        (lambda: run(resume=run(steps=50, events=sw.Event(_height, terminal=True))),
         "resume: the run stopped at an event, at a time of its own; begin a new run from there: "
         "v=run.v[-1], y=run.y[-1], t0=float(run.stopped_at)"),
        (lambda: run(sw.Oscillator(damping=0.1), "verlet"),
         "verlet needs forces that do not depend on the velocity, but Oscillator(omega=1.0, damping=0.1, form='canonical') "
         "has damping; use false_euler, or leave damping out"),
        (lambda: world(sw.Oscillator(damping=0.1), "verlet"), "verlet needs forces that do not depend on"),
        (lambda: run(sw.NBody(), y=np.ones((3, 2)), form="matrix"), "only linear systems have a transition matrix"),
        (lambda: run(control=sw.EnergyControl(0.3)), "control: Oscillator(omega=1.0, form='canonical') has no energy control"),
        (lambda: run(sw.NBody(), "leapfrog", y=np.eye(3, 2), control=sw.Projection()),
         "control: leapfrog carries v_half in place of v, so it cannot be combined with Projection"),
        (lambda: run(linear([0.0, 1.0]), "verlet"),
         "verlet needs a second-order system, ÿ = a(t, y); LinearSystem(2 states, 1 of them velocities, 1 input, 0 outputs)"),
        (lambda: run(sw.LinearSystem([[-1.0, -1.0], [1.0, 0.0]]), "verlet"),
         "use rk4, or implicit_midpoint, which keeps what turns, or leave velocities in the rows of v out"),
        (lambda: sw.export(sw.Chain(10**7), "rk4", "c"), "at most 3000000 are written; export a smaller system"),
    ],
    errors.DTypeError: [
        (lambda: world(v=np.zeros(()), y=np.float64(1.0)),
         "y: expected a NumPy array to step in place, got float64; one number is np.array(1.0)"),
        (lambda: sw.stability_limit("rk4", sw.Oscillator()), "method: expected the name of a method, got Oscillator"),  # type: ignore[arg-type]
        (lambda: sw.sweep(sw.Oscillator, "rk4", {"omega": ("w", [1.0])}), "axes stand before the method"),  # type: ignore[arg-type]
        (lambda: sw.sweep({"omega": ("w", [1.0])}, sw.Oscillator, "rk4"), "axes stand behind the system"),  # type: ignore[arg-type]
        # As a list it was one for each member, as a tuple a pair.
        *(
            (lambda wrong=wrong: paced(tolerance=wrong), "tolerance: expected a number, an array, or a tuple (relative")
            for wrong in ([1e-3], [1e-3, 1e-6], [1e-3, 1e-6, 1e-9])
        ),
        (lambda: sw.Floor(0.2), "Floor: too many positional arguments; expected Floor(*, restitution=1.0, friction=None, normal"),  # type: ignore[misc]
        (lambda: sw.Floor(height=0.2), "Floor: got an unexpected keyword argument 'height'; expected Floor(*, restitution"),  # type: ignore[call-arg]
        (lambda: sw.Sphere(), "Sphere: missing a required argument: 'centre'; expected Sphere(centre, radius, *, inside"),  # type: ignore[call-arg]
        (lambda: sw.NBody([1.0], mass=2.0), "NBody: got an unexpected keyword argument 'mass'; expected NBody(masses="),  # type: ignore[call-arg]
        (lambda: run(system="oscillator"), "system: expected a stepwell system such as Oscillator(), got str"),
        (lambda: run(resume=1.0), "resume: expected a Run or a World that goes on, got 1.0"),
        (lambda: run(control=0.3),
         "control: expected an EnergyControl, a LengthControl, a NormControl, a Control or a Projection, got float"),
        (lambda: run(dt="fast"), "dt: expected real numbers in units of time, got 'fast'"),
        (lambda: run(steps=2.5), "steps: expected a whole number, got 2.5 (float)"),
        (lambda: run(steps=True), "steps: expected a whole number, got True (bool)"),
        (lambda: run(y=np.ones(3, complex)), "y: expected real numbers, got an array of dtype complex128; write the equations"),
        (lambda: run(y=1j), r"y: expected real numbers, got 1j; write the equations of real and imaginary parts: of dz/dt"),
        (lambda: run(y=[True, False]), "y: expected real numbers, got an array of dtype bool"),
        (lambda: sw.Oscillator(x="wave"), "x: expected real numbers, got 'wave'"),
        (lambda: sw.LinearSystem("A"), "A: expected real numbers, got 'A'"),
        (lambda: linear(np.eye(2), x=[1.0, "wave"]), "x[1]: expected real numbers, got 'wave'"),
        (lambda: linear([1.0, 2.0], x="wave"), "x: expected real numbers, got 'wave'"),
        (lambda: linear(velocities=1.5), "velocities: expected a whole number, got 1.5 (float)"),
        (lambda: linear(velocities="v"), "velocities: expected a whole number, got 'v' (str)"),
        (lambda: run(record=3), "record: expected a list of quantities, got 3 (int)"),
        (lambda: run(progress="no"), "progress: expected True or False, got 'no' (str)"),
        (lambda: run(y=np.array([1.0, None])), "y: expected real numbers, got an array of dtype object"),
        (lambda: sw.scenes.scene(3), "scene: expected a Scene or its name, got int"),
        (lambda: sw.advise("clover", methods=4), "methods: expected a list of names, got 4 (int)"),
        (lambda: sw.charts.work_precision("clover", peers=["x"]),
         "peers: expected a Peer, such as peers.scipy(), or a function, got 'x'"),
        (lambda: sw.charts.work_precision("clover", progress=True), "progress: expected a function or None, got True (bool)"),
        (lambda: world(v=[0.0] * 3), "v: expected a NumPy array to step in place, got list"),
        (lambda: world(v=np.zeros(3, np.float32)), "v: expected dtype float64 to step in place, got float32"),
        (lambda: world(y=np.ones(3, ">f8")), "y: expected dtype float64 to step in place, got >f8"),
    ],
    errors.ShapeError: [
        (lambda: sw.NBody(masses=1.0), "masses: expected one for each body along the first axis, got shape ()"),
        (lambda: sw.integrate(sw.NBody(), "rk4", v=np.zeros((3, 2)), y=np.ones((3, 3)), dt=0.1, steps=1),
         "v and y: expected as many dimensions in both, got shapes (3, 2) and (3, 3)"),
        (lambda: sw.integrate(sw.NBody(dim=3), "rk4", v=0.0, y=np.ones((3, 2)), dt=0.1, steps=1),
         "y: expected shape (3, 3, batch…) = (bodies, dim, batch…), got (3, 2); batch axes come last"),
        (lambda: run(dt=[0.1, 0.2]), "dt: expected one number in units of time, got an array of shape (2,)"),
        (lambda: run(y=[[1.0], [1.0, 2.0]]), "y: expected a number or a regular array, got list"),
        (lambda: sw.Sampled([], 1.0), "values: expected at least one sample along the first axis, got shape (0,)"),
        (lambda: sw.Sampled(1.0, 1.0), "values: expected at least one sample along the first axis, got shape ()"),
        (lambda: sw.Chain(2, stiffness=np.ones(5)), "stiffness: expected 3 springs (or 1) along the first axis, got shape (5,)"),
        (lambda: sw.LinearSystem(1.0), "A: expected shape (n, n, batch…) with at least one state, got ()"),
        (lambda: sw.LinearSystem(np.ones((2, 3))), "A: expected shape (n, n, batch…) with at least one state, got (2, 3)"),
        (lambda: sw.LinearSystem(np.ones((0, 0))), "A: expected shape (n, n, batch…) with at least one state, got (0, 0)"),
        (lambda: linear(np.ones((3, 1))), "B: expected shape (n = 2, m, batch…), got (3, 1)"),
        (lambda: linear(np.ones(3)), "B: expected shape (n = 2, m, batch…), got (3,)"),
        (lambda: linear(1.0), "B: expected shape (n = 2, m, batch…), got ()"),
        (lambda: linear(np.ones((2, 0))), "B: expected shape (n = 2, m, batch…), got (2, 0)"),
        (lambda: sw.LinearSystem(np.ones((2, 2, 2)), [1.0, 2.0]), "B: expected shape (n = 2, m, batch…), got (2,)"),
        (lambda: linear(C=np.ones((1, 3))), "C: expected shape (r, n = 2, batch…), got (1, 3)"),
        (lambda: linear(C=np.ones((0, 2))), "C: expected shape (r, n = 2, batch…), got (0, 2)"),
        (lambda: linear(np.ones((2, 3)), np.ones((4, 2)), np.ones((3, 4))),
         "D: expected shape (r = 4, m = 3, batch…), got (3, 4)"),
        (lambda: linear(np.eye(2), x=1.0), "x: expected a sequence of 2 inputs, one for each column of B, got one float"),
        (lambda: linear(np.eye(2), x=sw.Sinusoid(1.0, 1.0)),
         "x: expected a sequence of 2 inputs, one for each column of B, got one Sinusoid"),
        (lambda: linear(np.eye(2), x=[1.0, 2.0, 3.0]), "x: expected a sequence of 2 inputs, one for each column of B, got 3"),
        (lambda: sw.LinearSystem(np.ones((2, 2, 3)), np.ones((2, 1, 4)), x=np.ones(5)),
         "these batch shapes do not broadcast to one: A (3,), B (4,), x (5,)"),
        (lambda: run(linear(velocities=2), v=np.ones(3)), "v: expected shape (2, batch…) = (states, batch…), got (3,)"),
        (lambda: linear().split(np.ones(3)), "state: expected shape (2, batch…) = (states, batch…), got (3,)"),
        (lambda: linear().state(np.ones(2), 1.0), "v: expected shape (1, batch…) = (states, batch…), got (2,)"),
        (lambda: run(v=np.zeros(3), y=np.zeros(4)), "these batch shapes do not broadcast to one: v (3,), y (4,)"),
        (lambda: run(sw.Oscillator(np.ones(5)), y=np.ones(4)), "do not broadcast to one: system (5,), y (4,)"),
        (lambda: sw.Oscillator(np.ones(3), np.ones(4)), "do not broadcast to one: omega (3,), damping (4,)"),
        (lambda: run(y=np.zeros(0)), "y: expected at least one member, got an empty batch of shape (0,)"),
        (lambda: sw.Oscillator(np.zeros(0)), "omega: expected at least one member, got an empty batch of shape (0,)"),
        (lambda: run(sw.NBody(), y=np.zeros((2, 3))),
         "y: expected shape (3, 2 or 3, batch…) = (bodies, dim, batch…), got (2, 3); batch axes come last"),
        (lambda: run(sw.Chain(4), y=np.zeros(3)), "y: expected shape (4, batch…) = (masses, batch…), got (3,)"),
        (lambda: run(y=np.ones((1,) * 30)), "y: expected at most 24 batch axes, got 30"),
        (lambda: run(sw.NBody(), y=[[1.0], [1.0, 2.0]]), "y: expected a number or a regular array, got list"),
        (lambda: world(v=np.zeros(4)), "v: expected shape (3,), got (4,)"),
        (lambda: world(y=np.ones((0,)), v=np.ones((0,))), "expected at least one member, got an empty batch"),
        (lambda: world(sw.Oscillator(np.ones(2))), "these batch shapes do not broadcast to one: system (2,), v and y (3,)"),
        (lambda: world(sw.Oscillator(np.ones((2, 1)))), "v and y: the system's batch (2, 1) does not broadcast to theirs, (3,)"),
    ],
    errors.NotFiniteError: [
        (lambda: run(dt=np.nan), "dt: expected finite numbers in units of time, got nan"),
        (lambda: run(t0=np.inf), "t0: expected finite numbers in units of time, got inf"),
        (lambda: run(v=[0.0, np.nan, 1.0]), "v: expected finite numbers, got nan at index (1,)"),
        (lambda: run(y=-np.inf), "y: expected finite numbers, got -inf"),
        (lambda: sw.Oscillator(damping=np.nan), "damping: expected finite numbers, got nan"),
        (lambda: sw.Sinusoid(1.0, np.inf), "omega: expected finite numbers in rad per unit of time, got inf"),
        (lambda: sw.LinearSystem([[np.nan]]), "A: expected finite numbers, got nan at index (0, 0)"),
        (lambda: run(y=[1.0, np.nan], resume=run()), "y: expected finite numbers, got nan at index (1,)"),
        (lambda: run(y=10**400), "y: expected numbers of at most 1.8e+308, got a larger one"),
        (lambda: world(v=np.full(3, np.nan)), "v: expected finite numbers, got nan at index (0,)"),
    ],
    errors.TooLargeError: [
        (lambda: run(sw.Oscillator(np.ones((10**6, 1)), np.ones(10**6))),
         "the saved states of 1000000000000 members need 1.04e+05 GiB, but "),
        (lambda: run(y=MANY), "y: expected an array that fits in memory, got shape (100000000000,): 745 GiB as floats"),
        (lambda: run(y=range(10**11)), "y: expected an array that fits in memory, got shape (100000000000,)"),
        (lambda: run(v=[MANY, MANY]), "v: expected an array that fits in memory, got shape (2, 100000000000)"),
        (lambda: run(force=MANY), "force: expected an array that fits in memory"),
        (lambda: run(record=range(10**11)), "record: expected a list of at most 1000000 quantities, got more in"),
        (lambda: sw.Oscillator(MANY), "omega: expected an array that fits in memory"),
        (lambda: sw.quaternion.product(np.ones((4, 1)), np.broadcast_to(0.5, (4, 10**11))), "q: expected an array"),
        (lambda: sw.LinearSystem(np.broadcast_to(0.0, (10**6, 10**6))), "A: expected an array that fits in memory"),
        (
            lambda: sw.sweep(
                sw.Oscillator, {"omega": 1.0 + np.arange(1e6), "y": ("y0", np.arange(1e6))}, "rk4", v=0.0, dt=0.1, steps=9
            ),
            "axes: status and results of 1000000000000 members need 1.58e+04 GiB",
        ),
        (lambda: sw.sweeps.random("s", 10**11, seed=1, omega=(0.0, 1.0)), "count: the samples of 100000000000 members"),
        (lambda: sw.sweeps.sobol("s", 2**37, seed=1, omega=(0.0, 1.0)), "count: the samples of 137438953472 members"),
        (lambda: run(y=np.ones(1000), steps=10**12, every=1),
         " are available (memory of this machine); keep less with every= or split the batch"),
        (lambda: sw.Chain(10**14), "n: stiffnesses and masses need 1.49e+06 GiB"),
    ],
}  # fmt: skip


def said(call: Callable[[], Any], error: type[Exception]) -> str:
    """The message of the error that a call ends in."""
    try:
        call()
    except error as caught:
        return str(caught) if isinstance(caught, sw.StepwellError) else f"none of stepwell's: {caught!r}"
    return "nothing"


@pytest.mark.parametrize("error", BAD)
def test_a_clear_error(error: type[Exception]) -> None:
    others = [f"{text!r} is not in {message!r}" for call, text in BAD[error] if text not in (message := said(call, error))]
    assert not others, "\n" + "\n".join(others)


def test_numbers_in_other_clothes() -> None:
    """Whole numbers of any size, fractions, and arrays however they lie in memory are the same numbers."""
    plain = np.array([1.0, 2.0, 3.0])
    shifted = np.frombuffer(b"x" + plain.tobytes(), np.float64, offset=1)
    assert not shifted.flags.aligned
    want = run(sw.Oscillator(plain), y=plain).y
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PendingDeprecationWarning)
        matrix = np.asmatrix(plain)
    for numbers in (
        shifted, plain.astype(">f8"), plain[::-1].copy()[::-1], np.repeat(plain, 2)[::2], plain.astype(np.float16),
        plain.astype(np.longdouble), [1, 2, 3], (Fraction(1), 2, 3.0), plain.astype(object), matrix.A1,
        np.ma.masked_array(plain, False), range(1, 4),
    ):  # fmt: skip
        np.testing.assert_array_equal(run(sw.Oscillator(numbers), y=numbers).y, want)
    assert run(y=matrix).y.shape == (1, 1, 3)
    np.testing.assert_array_equal(run(y=2**70).y, run(y=2.0**70).y)


def test_aliased_arrays() -> None:
    both = np.zeros(6)
    for v, y in ((both[:3], both[:3]), (both[:4], both[2:])):
        refused(errors.ArgumentError, "got arrays that share memory", world, v=v, y=y)
    world(v=both[:3], y=both[3:])  # neighbours are fine


def test_kernels_that_are_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names are written small, and one is asked for."""
    for name in ("avx1024", "baseline", "AVX2", "NEON", "interpret,avx2", " "):
        monkeypatch.setenv("STEPWELL_KERNELS", name)
        for asks in (run, world, sw.isa):
            refused(errors.ArgumentError, f'STEPWELL_KERNELS="{name}" names no kernels of this machine; it has', asks)


def test_one_tree() -> None:
    """Whoever catches StepwellError catches all; whoever knows Python's own classes is served too."""
    tree = [e for e in vars(errors).values() if isinstance(e, type) and issubclass(e, Exception)]
    for error in tree:
        assert issubclass(error, sw.StepwellError) or issubclass(error, UserWarning)
    assert issubclass(errors.ArgumentError, ValueError)
    assert issubclass(errors.UnknownNameError, LookupError)
    assert issubclass(errors.DTypeError, TypeError)
    assert issubclass(errors.TooLargeError, MemoryError)
    assert issubclass(errors.FixedError, AttributeError)


def test_the_core_refuses_too() -> None:
    """Python checks first; whoever uses the core directly still gets an error and no panic."""
    one, system = np.ones((1, 1)), sw.Oscillator()
    free: dict[str, Any] = {"form": "canonical", "omega": one}

    def core(kernel: str = "oscillator", method: str = "rk4", parameters: dict[str, Any] = free, **arrays: Any) -> None:
        model = _core.ModelSpec(kernel, method, list(parameters.items()))
        plan = engine.Plan(system, sw.method("rk4"), (4,), 0.1, threads=1)
        blocks: dict[str, Any] = {"v": np.zeros((1, 4)), "y": np.zeros((1, 1))}
        blocks |= {"saved_v": np.zeros((1, 1, 4)), "saved_y": np.zeros((1, 1, 4)), "first_bad": np.full(4, -1)}
        none = {name: np.zeros(0) for name in ("recorded", "tally", "carry")}
        _core.run(model, plan, engine.Arrays(carried=False, **(blocks | none | arrays)))

    core()
    linear: dict[str, Any] = {"kernel": "linear", "parameters": {"kind": "", "n_v": 1, "rows": np.ones((4, 1)), "inputs": 0}}
    for options, text in (
        ({"kernel": "oscilator"}, 'there is no system "oscilator"'),
        ({"method": "rk44"}, 'there is no method "rk44"'),
        ({"parameters": free | {"form": "round"}}, "has no kernel for the options"),
        (
            {"parameters": free | {"damping": one}, "method": "verlet"},
            "verlet needs forces that do not depend on the velocity, but oscillator has damping",
        ),
        ({"parameters": {"form": "canonical"}}, "omega: expected 1, got 0"),
        ({"parameters": free | {"omega": np.ones((2, 1))}}, "omega: expected 1, got 2"),
        ({"parameters": free | {"control": "energy"}}, "has no kernel for the options"),
        ({"kernel": "chain", "parameters": {"stiffness": one, "mass": one}}, "stiffness: expected 2, got 1"),
        (linear | {"parameters": linear["parameters"] | {"kind": "noise"}}, "has no kernel for the options"),
        (linear | {"parameters": linear["parameters"] | {"rows": one}}, "y: expected 0, got 1"),
        (linear | {"parameters": linear["parameters"] | {"inputs": 1}}, "inputs: expected 1, got 0"),
        (
            linear | {"method": "verlet"},
            "verlet needs forces that do not depend on the velocity, but linear has rates of another kind",
        ),
        ({"v": np.zeros((2, 4))}, "v: expected 1, got 2"),
        ({"v": np.zeros((1, 3))}, "a row of v: expected 4, got 3"),
        ({"carry": np.zeros(3)}, "carry: expected 4, got 3"),
        ({"saved_y": np.zeros((3, 1, 4))}, "saved_y: expected 4, got 12"),
        ({"recorded": np.zeros((1, 1, 4))}, "recorded: expected 0, got 4"),
        ({"tally": np.zeros(3)}, "tally: expected 0, got 3"),
        ({"parameters": free | {"omega": np.ones((1, 3))}}, "a parameter: expected 4, got 3"),
    ):
        refused(ValueError, re.escape(text), core, **options)


def test_names_of_ones_own() -> None:
    """Other names may stand anywhere, and so may v for the state where there is no velocity, and any name as a parameter's."""
    sw.system(lambda t, x, y: -y)
    sw.system(lambda time, v, x: -x)
    sw.system(order=1)(lambda t, v: -v)
    sw.system(order=1)(lambda t, x, *, v=1.0, y=2.0: -v * x * y)
    sw.solve_ivp(lambda x, u: -u, (0.0, 1.0), [1.0])
    first.invariant(lambda t, v, *, k: k * v)
    first(k=np.cos)


def test_numbers_that_may_be_several() -> None:
    """An array of tolerances is one for each member, a tuple a pair; an array whose mask is empty is an array."""
    assert paced(tolerance=np.array([1e-3, 1e-6])).y.shape == paced(tolerance=(1e-3, [1e-6, 1e-9])).y.shape == (1, 2)
    assert run(y=np.ma.masked_array([1.0, 2.0, 3.0], False)).y.shape == (1, 3)


def test_errors_mean_something_only_beside_the_scenes_own_system() -> None:
    kepler, ask = sw.scenes.kepler(), {"dt": 0.001, "steps": 10}
    others = sw.NBody([1.0, 0.5], force="newton"), sw.NBody([1.0, 0.0], force="newton", G=2.0), sw.NBody([1.0, 0.0])
    runs = [sw.integrate(other, "rk4", v=kepler.v, y=kepler.y, **ask) for other in others]
    runs.append(sw.integrate(kepler.system, "rk4", v=kepler.v[..., None], y=kepler.y[..., None], **ask))
    for of in (kepler.state_error, kepler.energy_error, kepler.amplitude):
        for each in runs:
            refused(errors.ArgumentError, "run: expected a run of the scene kepler, one member of NBody", of, each)
        refused(errors.DTypeError, r"run: expected what scene\.run returns, got float", of, 1.0)
    for control in (None, sw.EnergyControl(0.1), sw.Projection()):
        assert kepler.state_error(kepler.run("rk4", 0.001, steps=10, control=control)).max() < 1e-3
