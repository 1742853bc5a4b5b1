"""Other programs on the axes of a work-precision chart.

A peer is a function of a scene, times and a setting (a tolerance or a step), or a ``Peer`` with such a function. It returns the
states at these times, with its function (rate) evaluations and seconds. Peers for SciPy, heyoka and REBOUND are here; each
package is imported when its function is called, and need not be installed otherwise.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pickle import PicklingError
from typing import Any

import numpy as np

from ...base.arrays import Array
from ...base.checks import count, known, numbers, short
from ...base.immutable import ValueEquality
from ...errors import DTypeError, ShapeError, UnsupportedError
from ...model.methods import method
from ...model.systems import NBody
from ...runs import engine
from ...scenes import Scene

#: SciPy's methods that need no derivatives of the rates.
EXPLICIT = ("RK23", "RK45", "DOP853")

#: Tolerances of a peer, and of methods with adaptive steps: two in each factor of ten.
TOLERANCES = tuple(float(f"{10.0 ** (-k / 2):.3g}") for k in range(4, 25))


@dataclass(frozen=True, eq=False)
class Solved(ValueEquality):
    """The result of a peer.

    Attributes:
        v: velocity blocks at the output times, shape (times, *block).
        y: coordinate blocks, likewise.
        evaluations: function (rate) evaluations, or None if not reported; it is then charted by its time alone.
        seconds: computing time, without preparations that are needed only once.
    """

    v: Array
    y: Array
    evaluations: int | None
    seconds: float


@dataclass(frozen=True, eq=False)
class Peer(ValueEquality):
    """Another program.

    Attributes:
        name: its name in the table and the picture.
        solve: a callable that takes the scene, times of shape (n,) above 0 with the horizon as the last, and a setting, and
            returns a ``Solved``. It raises ``UnsupportedError`` for a scene that it cannot solve, which the chart then lists as
            refused.
        settings: the settings with which it is run.
        by: the kind of the settings, ``"tolerance"`` or ``"step"``.
        order: the order of convergence, or None.

    It is pickled by the name of its function, which must be at the top of a module and no lambda.
    """

    name: str
    solve: Callable[[Scene, Array, float], Solved]
    settings: Sequence[float] = TOLERANCES
    by: str = "tolerance"
    order: int | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise DTypeError(f"name: expected a text, got {short(self.name)}")
        if not callable(self.solve):
            raise DTypeError(f"solve: expected a function of scene, times and setting, got {short(self.solve)}")
        if numbers("settings", self.settings, positive=True).ndim != 1:
            raise ShapeError(f"settings: expected a list of numbers, got {short(self.settings)}")
        known("by", self.by, ("tolerance", "step"))
        if self.order is not None:
            count("order", self.order, 0)

    @property
    def title(self) -> str:
        """The name in a picture."""
        return self.name

    def __copy__(self) -> Peer:
        return self

    def __deepcopy__(self, memo: object) -> Peer:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        path = getattr(self.solve, "__qualname__", "")
        if "<" in path:  # <lambda>, or within a function's <locals>
            raise PicklingError(
                f"peer {self.name!r}: pickle finds a function again by its name in a module, and {path} has none; define the "
                f"function at the top of a module"
            )
        return Peer, (self.name, self.solve, self.settings, self.by, self.order)


def peer(function: Peer | Callable[[Scene, Array, float], Solved]) -> Peer:
    """A peer with this function and its name, whose settings are tolerances."""
    if not isinstance(function, Peer) and not callable(function):
        raise DTypeError(f"peers: expected a Peer, such as peers.scipy(), or a function, got {short(function)}")
    return function if isinstance(function, Peer) else Peer(getattr(function, "__name__", type(function).__name__), function)


def scipy(method: str = "RK45", settings: Sequence[float] = TOLERANCES) -> Peer:
    """SciPy's ``solve_ivp`` with ``rtol`` = ``atol`` = the tolerance; rates in NumPy, with a Python call for each.

    The states between its steps are interpolated by polynomials of lower order than its steps, so the errors of
    DOP853 and RK45 include those of the interpolation, except at the end.

    Args:
        method: ``"RK45"``, ``"DOP853"``, or another of its explicit methods.
        settings: tolerances; SciPy accepts none below 100 times the rounding of a float.

    Raises:
        UnsupportedError: if SciPy is not installed.
    """
    _need("scipy.integrate", "scipy")
    known("method", method, EXPLICIT)
    return Peer(f"SciPy {method}", ByScipy(method), settings)


class ByScipy(ValueEquality):
    """Solves a scene by one of SciPy's methods."""

    def __init__(self, method: str) -> None:
        self.method = method

    def __repr__(self) -> str:
        return f"ByScipy({self.method!r})"

    def __call__(self, scene: Scene, times: Array, tolerance: float) -> Solved:
        """The states at these times."""
        solver = _need("scipy.integrate", "scipy")
        if scene.system.has_stick_friction:
            raise UnsupportedError(
                f"SciPy is given rates, and {scene.system!r} has friction that sticks, which depends on the step"
            )
        system = scene.system.scaled(1.0, ())
        cut = scene.v.size

        def rates(t: float, s: Array) -> Array:
            v, y = s[:cut].reshape(scene.v.shape), s[cut:].reshape(scene.y.shape)
            return np.concatenate([np.ravel(system.dv(t, v, y)), np.ravel(system.dy(t, v, y))])

        start = np.concatenate([np.ravel(scene.v), np.ravel(scene.y)])
        begin = time.perf_counter()
        span = 0.0, float(times[-1])
        solution = solver.solve_ivp(rates, span, start, method=self.method, t_eval=times, rtol=tolerance, atol=tolerance)
        seconds = time.perf_counter() - begin
        states = np.full((len(times), len(start)), np.nan)
        states[: solution.y.shape[1]] = solution.y.T
        return Solved(*_blocks(scene, states), int(solution.nfev), seconds)


def heyoka(settings: Sequence[float] = TOLERANCES) -> Peer:
    """Taylor series by heyoka, compiled for the scene; bodies, and linear systems without inputs.

    The evaluations of a step are those of ``taylor`` with the same order (``Paces.evaluations``), or unknown where that would be
    too long. States between steps come from the series. Compilation before the run is not timed.
    """
    _need("heyoka", "heyoka")
    return Peer("heyoka", ByHeyoka(), settings)


@lru_cache(maxsize=1)
def _series(scene: Scene, tolerance: float) -> Any:
    hy = _need("heyoka", "heyoka")
    return hy.taylor_adaptive(_expressions(hy, scene), np.zeros(scene.v.size + scene.y.size), tol=tolerance)


class ByHeyoka(ValueEquality):
    """Solves a scene by heyoka."""

    def __repr__(self) -> str:
        return "ByHeyoka()"

    def __call__(self, scene: Scene, times: Array, tolerance: float) -> Solved:
        """The states at these times."""
        series = _series(scene, tolerance)
        series.time = 0.0
        series.state[:] = np.concatenate([np.ravel(scene.v), np.ravel(scene.y)])
        begin = time.perf_counter()
        solved = series.propagate_grid(np.concatenate([[0.0], times]))
        seconds = time.perf_counter() - begin
        try:
            each = engine.evaluations(method("taylor"), scene.system, order=series.order, paced=True)
        except UnsupportedError:
            each = None
        return Solved(*_blocks(scene, solved[-1][1:]), None if each is None else int(solved[3]) * each, seconds)


#: The integrators of REBOUND that can be peers, and whether a setting is a tolerance.
REBOUND = {"ias15": True, "bs": True, "leapfrog": False}


def rebound(integrator: str = "ias15", settings: Sequence[float] | None = None) -> Peer:
    """REBOUND; bodies under Newton's law only.

    Its function evaluations are counted in a separate run, which is not timed.

    Args:
        integrator: ``"ias15"`` or ``"bs"`` by tolerance (for ias15 its ``epsilon``, which is not an error but a power of one), or
            ``"leapfrog"`` by step.
        settings: tolerances, or steps; steps are needed for leapfrog.
    """
    _need("rebound", "rebound")
    known("integrator", integrator, REBOUND)
    if settings is None:
        if not REBOUND[integrator]:
            raise UnsupportedError(f"settings: expected the steps of {integrator}, got none")
        settings = TOLERANCES
    return Peer(f"REBOUND {integrator}", ByRebound(integrator), settings, "tolerance" if REBOUND[integrator] else "step")


class ByRebound(ValueEquality):
    """Solves a scene by one of REBOUND's integrators."""

    def __init__(self, integrator: str) -> None:
        self.integrator = integrator

    def __repr__(self) -> str:
        return f"ByRebound({self.integrator!r})"

    def _simulation(self, scene: Scene, setting: float) -> Any:
        rb, integrator, system = _need("rebound", "rebound"), self.integrator, scene.system
        if not isinstance(system, NBody) or system.force != "newton":
            raise UnsupportedError(f"REBOUND has bodies under Newton's law only; {system!r} is not that")
        sim = rb.Simulation()
        sim.G, sim.softening, sim.integrator = float(system.G), float(system.softening), integrator
        sim.dt = scene.dt if REBOUND[integrator] else setting
        for name in ("eps_rel", "eps_abs") if integrator == "bs" else ("epsilon",) if integrator == "ias15" else ():
            # Since version 5 an integrator has its options; before, the simulation had them.
            setattr(getattr(sim, f"ri_{integrator}", sim.integrator), name, setting)
        for m, v, y in zip(system.masses.tolist(), scene.v.tolist(), scene.y.tolist(), strict=True):
            x3, v3 = [*y, 0.0][:3], [*v, 0.0][:3]
            sim.add(m=m, x=x3[0], y=x3[1], z=x3[2], vx=v3[0], vy=v3[1], vz=v3[2])
        return sim

    def __call__(self, scene: Scene, times: Array, setting: float) -> Solved:
        """The states at these times."""
        count = 0

        def counted(_: Any) -> None:
            nonlocal count
            count += 1

        sim = self._simulation(scene, setting)
        sim.additional_forces = counted
        for t in times.tolist():
            sim.integrate(t)
        sim = self._simulation(scene, setting)
        dim = scene.y.shape[1]
        v, y = (np.empty((len(times), *scene.y.shape)) for _ in range(2))
        seconds = 0.0
        for i, t in enumerate(times.tolist()):
            begin = time.perf_counter()
            sim.integrate(t)
            seconds += time.perf_counter() - begin
            v[i], y[i] = ([getattr(p, block)[:dim] for p in sim.particles] for block in ("vxyz", "xyz"))
        return Solved(v, y, count, seconds)


def _need(module: str, package: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError:
        raise UnsupportedError(f"peers: {package} is not installed; pip install {package}") from None


def _blocks(scene: Scene, states: Array) -> tuple[Array, Array]:
    """Blocks of states in rows, v first."""
    cut = scene.v.size
    return states[:, :cut].reshape(-1, *scene.v.shape), states[:, cut:].reshape(-1, *scene.y.shape)


def _expressions(hy: Any, scene: Scene) -> list[Any]:
    """The scene's rates as heyoka's expressions."""
    system, cut = scene.system, scene.v.size
    size = cut + scene.y.size
    names = hy.make_vars(*(f"s{i}" for i in range(size)))
    if system.linear and not system.given_inputs():
        rates = system.scaled(1.0, ())
        columns = []
        for unit in np.eye(size):
            v, y = (block[0] for block in _blocks(scene, unit[np.newaxis]))
            columns.append(np.concatenate([np.ravel(rates.dv(0.0, v, y)), np.ravel(rates.dy(0.0, v, y))]))
        matrix = np.array(columns).T.tolist()
        return [
            (s, sum((a * x for a, x in zip(row, names, strict=True) if a), 0.0 * s)) for s, row in zip(names, matrix, strict=True)
        ]
    if not isinstance(system, NBody):
        raise UnsupportedError(f"heyoka is given bodies and linear systems without inputs only; {system!r} is neither")
    n, dim = scene.y.shape
    place = [names[cut + dim * i : cut + dim * (i + 1)] for i in range(n)]
    power = -1.5 if system.force == "newton" else -1.0
    pull: list[list[Any]] = [[0.0] * dim for _ in range(n)]
    strength, soft = (float(system.G) * system.masses).tolist(), float(system.softening) ** 2
    for i in range(n):
        for j in range(i + 1, n):
            way = [b - a for a, b in zip(place[i], place[j], strict=True)]
            over = (sum(d * d for d in way) + soft) ** power
            for k, d in enumerate(way):
                pull[i][k] += strength[j] * (d * over)
                pull[j][k] -= strength[i] * (d * over)
    return list(zip(names, [each for body in pull for each in body] + list(names[:cut]), strict=True))
