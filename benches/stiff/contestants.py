"""The contestants: each makes of a problem a function from parameters of members and a setting to their ends."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw

from ..compare.peers import jax_peer
from . import diffsl
from .problems import Array, Problem


class Setting(NamedTuple):
    """What a user chooses.

    Attributes:
        method: one of the contestant's.
        tolerance: relative; the absolute ones are this times a size.
        share: of the problem's sizes, which the absolute ones are relative to; the least of them where only one number goes.
    """

    method: str
    tolerance: float
    share: float = 1.0

    def absolute(self, problem: Problem) -> Array:
        """The absolute tolerances of the components."""
        return self.tolerance * self.share * np.array(problem.sizes)

    def least(self, problem: Problem) -> float:
        """Where only one number goes."""
        return float(self.absolute(problem).min())


Solve = Callable[[Array, Setting], Array]


class Contestant(NamedTuple):
    """A program.

    Attributes:
        name: in a table.
        package: whose version is told.
        make: makes what is compiled, for a problem.
        methods: that are tried.
        members: of a batch that is timed.
        trial: of a batch by which a setting is chosen.
        shares: of the absolute tolerances that are tried.
    """

    name: str
    package: str
    make: Callable[[Problem], Solve]
    methods: tuple[str, ...]
    members: int
    trial: int
    shares: tuple[float, ...] = (1.0,)


def stepwells(problem: Problem) -> Solve:
    """One call. The system of one member is made once, as what others compile; that of a batch is made in the call."""
    system, names = problem.system, tuple(problem.published)
    start, published = np.array(problem.start), system()

    def solve(parameters: Array, setting: Setting) -> Array:
        tolerance = setting.tolerance, setting.absolute(problem)
        told: Any = {"at": [problem.end], "threads": 1}
        if parameters.shape[1] == 1:
            return np.asarray(sw.integrate(published, setting.method, y=start, tolerance=tolerance, **told).y[-1])[:, np.newaxis]
        given = system(**dict(zip(names, parameters, strict=True)))
        y = np.repeat(start[:, np.newaxis], parameters.shape[1], axis=1)
        tolerance = setting.tolerance, setting.absolute(problem)[:, np.newaxis]
        return np.asarray(sw.integrate(given, setting.method, y=y, tolerance=tolerance, **told).y[-1])

    return solve


def scipys(problem: Problem) -> Solve:
    """Member after member, with rates in plain Python."""
    from scipy.integrate import solve_ivp

    def solve(parameters: Array, setting: Setting) -> Array:
        told = {"method": setting.method, "rtol": setting.tolerance, "atol": setting.absolute(problem)}

        def end(given: list[float]) -> Array:
            def rates(t: float, y: Array) -> Any:
                return problem.rates(t, y.tolist(), *given)

            return np.asarray(solve_ivp(rates, (0.0, problem.end), problem.start, t_eval=[problem.end], **told).y[:, -1])

        return np.stack([end(column) for column in parameters.T.tolist()], axis=-1)

    return solve


def compiled_rates(problem: Problem, signature: Any = None) -> Any:
    """The rates by numba, as ``f(t, y, out, parameters)``; for C if they get a signature."""
    import numba

    numbers, given = len(problem.start), len(problem.published)
    rates = numba.njit(problem.rates, error_model="numpy")
    fill = "\n    ".join(f"out[{i}] = found[{i}]" for i in range(numbers))
    parameters = ", ".join(f"p[{i}]" for i in range(given))
    scope = {"rates": rates}
    exec(f"def filled(t, y, out, p):\n    found = rates(t, y, {parameters})\n    {fill}", scope)
    filled = scope["filled"]
    return numba.njit(filled, error_model="numpy") if signature is None else numba.cfunc(signature)(filled)


def numbalsodas(problem: Problem) -> Solve:
    """A loop over members, compiled like the rates."""
    import numba
    from numbalsoda import lsoda, lsoda_sig

    rates = compiled_rates(problem, lsoda_sig)

    @numba.njit
    def run(address: int, start: Array, times: Array, parameters: Array, tolerance: float, absolute: float) -> Any:
        ends = np.empty((len(start), len(parameters)))
        for member in range(len(parameters)):
            found, right = lsoda(address, start, times, parameters[member], tolerance, absolute, 10_000_000)
            for i in range(len(start)):
                ends[i, member] = found[-1, i] if right else np.nan
        return ends

    start, times = np.array(problem.start), np.array([0.0, problem.end])

    def solve(parameters: Array, setting: Setting) -> Array:
        rows = np.ascontiguousarray(parameters.T)
        return np.asarray(run(rates.address, start, times, rows, setting.tolerance, setting.least(problem)))

    return solve


def sundials(problem: Problem) -> Solve:
    """CVODE, member after member; its rates are a Python call of what numba compiled."""
    from sksundae.cvode import CVODE

    rates, start, times = compiled_rates(problem), np.array(problem.start), np.array([0.0, problem.end])

    def solve(parameters: Array, setting: Setting) -> Array:
        told = {"rtol": setting.tolerance, "atol": setting.absolute(problem), "max_num_steps": 10_000_000}

        def end(given: Array) -> Array:
            return np.asarray(CVODE(rates, userdata=tuple(given), **told).solve(times, start).y[-1])

        return np.stack([end(given) for given in np.ascontiguousarray(parameters.T)], axis=-1)

    return solve


def casadis(problem: Problem) -> Solve:
    """CVODES with the rates and the Jacobian of CasADi's own instructions."""
    import casadi

    y, p, t = casadi.SX.sym("y", len(problem.start)), casadi.SX.sym("p", len(problem.published)), casadi.SX.sym("t")
    rates = casadi.vertcat(*problem.rates(t, casadi.vertsplit(y), *casadi.vertsplit(p)))

    @functools.cache
    def integrator(setting: Setting) -> Any:
        told = {"reltol": setting.tolerance, "abstol": setting.least(problem), "max_num_steps": 10_000_000}
        told |= {"newton_scheme": "direct", "show_eval_warnings": False}
        return casadi.integrator("solver", "cvodes", {"x": y, "p": p, "t": t, "ode": rates}, 0.0, problem.end, told)

    def solve(parameters: Array, setting: Setting) -> Array:
        run = integrator(setting)
        ends = [run(x0=problem.start, p=given)["xf"].toarray()[:, 0] for given in np.ascontiguousarray(parameters.T)]
        return np.stack(ends, axis=-1)

    return solve


def diffsols(problem: Problem) -> Solve:
    """Member after member, compiled by LLVM from its own language."""
    import pydiffsol

    solver = pydiffsol.Ode(diffsl.text(problem), matrix_type=pydiffsol.nalgebra_dense)
    methods = {name: getattr(pydiffsol, name) for name in ("bdf", "tr_bdf2", "esdirk34")}
    times = np.array([problem.end])

    def solve(parameters: Array, setting: Setting) -> Array:
        solver.ode_solver, solver.rtol, solver.atol = methods[setting.method], setting.tolerance, setting.least(problem)
        ends = [solver.solve_dense(given, times).ys[:, -1] for given in np.ascontiguousarray(parameters.T)]
        return np.stack(ends, axis=-1)

    return solve


def diffraxes(problem: Problem) -> Solve:
    """Kvaerno5 of members side by side, each of which has its own steps."""
    jax, diffrax = jax_peer.modules()
    jnp = jax.numpy
    term = diffrax.ODETerm(lambda t, y, p: jnp.stack(problem.rates(t, y, *p)))
    start = jnp.array(problem.start)

    def alone(parameters: Any, tolerance: Any, absolute: Any) -> Any:
        control = diffrax.PIDController(rtol=tolerance, atol=absolute, pcoeff=0.3, icoeff=0.4)
        told = {"saveat": diffrax.SaveAt(t1=True), "adjoint": diffrax.ForwardMode(), "max_steps": 4000, "throw": False}
        solver = diffrax.Kvaerno5(root_finder=diffrax.VeryChord(rtol=tolerance, atol=absolute, norm=diffrax_norm()))
        return diffrax.diffeqsolve(
            term, solver, 0.0, problem.end, None, start, tuple(parameters), stepsize_controller=control, **told
        ).ys[0]

    one, many = jax.jit(alone), jax.jit(jax.vmap(alone, in_axes=(1, None, None), out_axes=1))

    def solve(parameters: Array, setting: Setting) -> Array:
        told = setting.tolerance, setting.absolute(problem)
        if parameters.shape[1] == 1:
            return np.asarray(one(parameters[:, 0], *told))[:, np.newaxis]
        return np.asarray(many(parameters, *told))

    return solve


def diffrax_norm() -> Any:
    """The size of an error for Newton's method."""
    import optimistix

    return optimistix.rms_norm


#: Shares of the absolute tolerances where a program takes only one for all components.
SHARES = (1.0, 1e3)

OURS = Contestant("stepwell", "stepwell", stepwells, ("rosenbrock23", "rodas4", "rodas5p"), 10_000, 500)
PEERS = [
    Contestant("numbalsoda", "numbalsoda", numbalsodas, ("LSODA",), 100, 32, SHARES),
    Contestant("CVODE of scikit-sundae", "scikit-sundae", sundials, ("BDF",), 4, 4),
    Contestant("CVODES of CasADi", "casadi", casadis, ("BDF",), 10, 10, SHARES),
    Contestant("pydiffsol", "pydiffsol", diffsols, ("bdf", "tr_bdf2", "esdirk34"), 20, 20, SHARES),
    Contestant("diffrax", "diffrax", diffraxes, ("Kvaerno5",), 20, 20),
    Contestant("SciPy", "scipy", scipys, ("LSODA", "Radau"), 2, 2),
]
