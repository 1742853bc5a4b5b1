"""Findings of a run: members that diverged or stopped, and numbers that are finite but mean nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from math import prod
from typing import Any, NamedTuple

import numpy as np

from ..base import registry
from ..base.arrays import Array, Shape, Whole
from ..base.reprs import first_of, in_words, of_member, share
from ..errors import AccuracyWarning, ControlWarning, DivergenceWarning, StiffnessWarning, ToleranceWarning
from ..model.controls import EnergyControl
from ..model.methods import Method
from ..model.parameters import aligned
from ..model.systems import NBody, System
from . import encounters, engine, known_energy
from .findings import Finding, may_have_amounts
from .options.tolerance import MAX_ABSOLUTE_SHARE, lost_in_tolerance
from .request import Request
from .result import Run, Status

#: A member's energy is doubtful where it changed by more than this share of its own size and of the kinetic energy.
DOUBTFUL_CHANGE = 0.5
#: Around a body with so many times the mass of all others together, the share is less in steps of fixed length: planets whose
#: energy is a hundredth off are on other orbits, or these turn by steps alone.
STAR, DOUBTFUL_OF_PLANETS = 10.0, 0.01

#: The energy of one member of at most FEW_BODIES bodies is summed in floats. That takes some microseconds, little beside a run of
#: FEW_EVALUATIONS.
FEW_BODIES, FEW_EVALUATIONS = 8, 100

#: NumPy computes other energies, which is little beside a run of this many rate evaluations and pairs in all. States of more than
#: MOST_NUMBERS would take memory that was not counted.
EVALUATIONS, PAIRS, MOST_NUMBERS = 2000, 200_000, 1_000_000

#: From this many bodies on the core computes an energy faster than NumPy, although it makes a step too.
MIN_BODIES_BY_CORE = 24

#: Stiffness is looked for in runs of MANY steps: little work beside a run whose members have FEW_NUMBERS in all. A run of less
#: numbers makes a thousand steps in some tenths of a millisecond, so there it is MANY_OF_FEW.
MANY, MANY_OF_FEW, FEW_NUMBERS = 512, 2048, 64

#: In a run that was stopped it is looked for, after this many attempts.
STOPPED = 256

#: Pairs are checked in at most this many saved states.
STATES = 32

State = tuple[Array, Array]
Moment = tuple[Array, Any]
#: A message, and the members that it is about.
About = tuple[str, Any]


class Ends(NamedTuple):
    """Energies at the start and at the end of a run, and the larger of both kinetic energies; per member."""

    first: Array
    last: Array
    moved: Array


def findings_of(
    run: Run, request: Request, heard: Callable[[type[Warning]], bool], waypoints: Sequence[Array] = ()
) -> tuple[Finding, ...]:
    """Findings of a run: how it ended, and which numbers mean nothing, as far as that costs little.

    What takes longer than an evaluation of the last state is computed only if its warning is ``heard``. ``waypoints`` is where
    members with adaptive steps stood on the way, if it is known.
    """
    noticed = list(run.findings)  # of events that it came to rest at
    if run.paces is None:
        if run.system.keeper is not None:
            noticed += of_a_strong_control(run.system, _velocities(request), request.y, run.dt)
        if np.count_nonzero(run.status) and (diverged := _of_divergence(run, request)) is not None:
            noticed.append(diverged)
    else:
        from .stops import of_stops  # only runs with adaptive steps need it

        noticed += of_stops(run, partial(why_steps_are_short, run, request, waypoints))
        if (stiff := _of_stiffness(run, request, waypoints, heard)) is not None:
            noticed.append(stiff)
        least = MANY if run.y[-1].size + run.v[-1].size >= FEW_NUMBERS else MANY_OF_FEW
        many = waypoints and run.paces.accepted.max() >= min(least, MANY)  # asked here, since a short run is to be quick
        if many and heard(AccuracyWarning) and (grown := registry.task("amplified_of")(run, request, waypoints[0], least)):
            noticed.append(grown)
        if many and heard(ToleranceWarning) and (jump := registry.task("state_jump_of")(run, request, waypoints[0])):
            noticed.append(jump)
        if (lost := _of_a_lost_motion(run, request)) is not None:
            noticed.append(lost)
    if run.system.mass_matrix is not None and run.paces is None and heard(AccuracyWarning):
        noticed += _of_algebraic_equations(run, request)
    # The energy says nothing where events changed the state, nor where the run began from what a method carries.
    changes = request.events is not None and any(event.then for event in request.events)
    began = not request.carried and request.before is None and not changes
    start = (request.v, request.y) if began else None
    noticed += _of_nonsense(run, start, request, heard)
    if run.paces is None and start is not None and (growth := registry.task("growth_of")(run, start)) is not None:
        noticed.append(growth)
    if may_have_amounts(run.system) and (run.paces is not None or not noticed) and not changes:
        from .negative import of_a_run  # only such runs need it

        if (amounts := of_a_run(run, request.y, request.plan)) is not None:
            noticed.append(amounts.finding(run.status.shape))
    return tuple(noticed)


def _of_algebraic_equations(run: Run, request: Request) -> list[Finding]:
    """The members of a run of fixed steps that lost their algebraic equations."""
    start = np.broadcast_to(request.y, run.y.shape[1:])
    sizes = np.maximum(np.abs(run.y).max(axis=0), np.abs(start))
    return lost_equations(run, (start, run.t0), (run.y[-1], run.t[-1]), sizes, run.status == 0)


def lost_equations(of: Run | engine.Plan, start: Moment, end: Moment, sizes: Array, goes_on: Any) -> list[Finding]:
    """The members that lost their algebraic equations: fixed steps go on where these have no solution, or determine none."""
    broken, crossed = (each & goes_on for each in registry.task("algebraic_lost")(of.system, start, end, sizes))
    lost = broken.any()
    if not (wrong := broken if lost else crossed).any():
        return []
    some, first = int(wrong.sum()), tuple(np.argwhere(wrong)[0].tolist())
    who = f"{share(some, wrong.shape, wrong.size)}{first_of(some, first, wrong.size)}"
    steps = f"steps of {of.dt:g} by {of.method.name}"
    text = (
        f"at the end, t = {end[1]:g}, the algebraic equations do not hold for {who}; they have no solution there, or {steps} "
        f"lost it: take tolerance=, which stops there, or shorter steps"
    )
    if not lost:
        text = (
            f"at a time on the way, the algebraic equations determined nothing for {who}; there a solution ends, or is one of "
            f"several, and {steps} went on: take tolerance=, or other equations from there"
        )
    return [Finding(AccuracyWarning, text, wrong)]


def finds_growth_only(system: System, method: Method, steps: int) -> bool:
    """True if nothing but growth can be found of a run of fixed steps, from its start, of which all numbers are finite."""
    judged = known_energy.may_pass_barriers(system, method, steps) or known_energy.may_gain(system, method, steps)
    judged = judged or isinstance(system, NBody) or system.mass_matrix is not None or system.keeper is not None
    return type(system).doubt is System.doubt and not judged


def _of_nonsense(run: Run, start: State | None, request: Request, heard: Callable[[type[Warning]], bool]) -> list[Finding]:
    """Findings of numbers that are finite but mean nothing; ``start`` is None if it is not known."""
    system = run.system
    if not isinstance(system, NBody):
        about = system.doubt(run.y)
        if about is None and start is not None and run.paces is None and known_energy.may_gain(system, run.method, run.steps):
            about = known_energy.gain_of(run, start) if heard(AccuracyWarning) else None
        if about is None and start is not None:
            about = known_energy.doubt_of(run, start, None if request.step_control is None else partial(_visited, request), heard)
        return [] if about is None else [Finding(AccuracyWarning, *about)]
    noticed = []
    if run.force is None:
        ends = _ends(run, system, start) if system.keeps_energy else None
        energy = None if ends is None else _of_energy(run.method.name, ends, _doubtful(run, system))
        if energy is None and system.keeps_energy and start is not None:
            energy = _of_massless(run, system, start)
        met = None
        if run.encounter is not None and heard(AccuracyWarning):
            met = _of_encounters(run, system, start, None if energy is None else energy[2])
        if parts := [part for part in (energy, met) if part is not None]:
            members = np.logical_or.reduce([part[1] for part in parts])
            noticed.append(Finding(AccuracyWarning, "; ".join(part[0] for part in parts), members))
    if heard(ControlWarning) and (overshot := _of_a_control(run, system, start)) is not None:
        noticed.append(Finding(ControlWarning, *overshot))
    return noticed


def _visited(request: Request, index: Whole) -> tuple[Array, Array, Array]:
    """The least and the largest y of some members at the ends of their steps, and how many attempts were rejected."""
    from .events.attempts import extremes  # only runs beside a barrier need it

    assert request.step_control is not None
    return extremes(request.plan, request.step_control.pacing, request.step_control.paces, request.v, request.y, index)


def time_of(run: Run, step: int, index: Shape) -> float:
    """The time of a step of fixed length of a member: t0 + k·dt."""
    return float(np.broadcast_to(run.t0, run.status.shape)[index]) + step * run.dt


def _only(run: Run, index: Shape) -> Any:
    """One member alone."""
    members = np.zeros(run.status.shape, dtype=bool)
    members[index] = True
    return members


def _velocities(request: Request) -> Array:
    """The velocities at the start of a run; behind them stand the blocks that a method keeps, in one that goes on."""
    plan, v = request.plan, request.v
    if not (request.carried and plan.keeps):
        return v
    return v[: prod(plan.system.v_shape)].reshape(*plan.system.v_shape, *plan.batch)


def of_a_strong_control(system: System, v: Array, y: Array, dt: float) -> list[Finding]:
    """A control in the printed form that overshoots from the start on."""
    batch, overshoots = y.shape[len(system.y_shape) :], getattr(system.keeper, "overshoots", None)
    if overshoots is None:
        return []
    with np.errstate(all="ignore"):
        about = overshoots(dt, lambda: system.uncontrolled.reference_at_step(1.0, batch).energies(v, y)[1])
    return [] if about is None else [Finding(ControlWarning, about[0], np.broadcast_to(about[1], batch))]


def _of_divergence(run: Run, request: Request) -> Finding | None:
    """The members that diverged in this run."""
    before = request.before
    bad = run.first_bad_step >= 0 if before is None else (run.first_bad_step >= 0) & (before < 0)
    if not bad.any():
        return None
    step = int(run.first_bad_step[bad].min())
    first = tuple(np.argwhere(bad & (run.first_bad_step == step))[0].tolist())
    why = ""
    if run.collision is not None and (step - run.start_step) * run.v[-1].size // bad.size <= encounters.MAX_RERUN:
        pair = run.collision(first, step)
        if pair.distance < np.inf:
            why = f"; bodies {pair.bodies[0]} and {pair.bodies[1]} were {pair.distance:.3g} apart before it"
    if not request.carried and step == run.start_step + 1 and not why:
        start = request.v, request.y
        place = run.status.shape, run.t0 + run.start_step * run.dt, start, first
        from .stops import of_derivatives, of_the_start  # only runs that diverged at once need it

        if wrong := of_the_start(run.system, *place) or of_derivatives(run.system, run.method, *place):
            why = f"; {wrong} at the start, t = {time_of(run, run.start_step, first):g}"
    if run.method.splits and isinstance(run.system, NBody) and run.system.force == "newton":
        why += "; a step is too long for Kepler's motion on an orbit there, so take shorter steps, or dop853 with a tolerance"
    number = int(np.count_nonzero(bad))
    return Finding(
        DivergenceWarning,
        f"{share(number, bad.shape, bad.size)} diverged{first_of(number, first, bad.size)} at step {step} "
        f"(t = {time_of(run, step, first):g}), by {run.method.name} with dt = {run.dt:g}{why}",
        bad,
    )


def why_steps_are_short(run: Run, request: Request, waypoints: Sequence[Array], index: Shape) -> str:
    """Why the steps of a member that stopped are short, in words: a jump of the rates, or stability if it is out of attempts."""
    assert run.paces is not None
    if jump := registry.task("state_jump")(run, request, waypoints, index):
        return str(jump)
    if run.status[index] != Status.BUDGET or run.paces.accepted[index] + run.paces.rejected[index] < STOPPED:
        return ""
    return str(registry.task("held_by_stability")(run, request, waypoints, index))


def may_be_stiff(steps: int, numbers: int) -> bool:
    """True if a run of so many accepted steps, whose members have so many numbers in all, is looked at for stiffness."""
    return steps >= MANY_OF_FEW or (steps >= MANY and numbers >= FEW_NUMBERS)


def _of_stiffness(
    run: Run, request: Request, waypoints: Sequence[Array], heard: Callable[[type[Warning]], bool]
) -> Finding | None:
    """The members whose steps were held down by stability, of those that made enough steps for that to matter."""
    assert run.paces is not None
    accepted = run.paces.accepted
    steps = int(accepted) if not accepted.shape else int(accepted.max(initial=0))
    if not waypoints or not may_be_stiff(steps, run.y[-1].size + run.v[-1].size) or not heard(StiffnessWarning):
        return None
    found: Finding | None = registry.task("stiffness_of")(run, request, waypoints[0])
    return found


def _of_a_lost_motion(run: Run, request: Request) -> Finding | None:
    """Members whose absolute tolerance is most of the tolerated error of a step, and much of the motion."""
    assert run.controller_state is not None
    pace = run.controller_state.pace
    if request.plan.acceptance.own or not (pace[engine.ABSOLUTE] > engine.LEAST).any():
        return None
    lost = lost_in_tolerance(pace, engine.groups_of(request.plan))
    if not lost.any():
        return None
    return Finding(
        ToleranceWarning,
        f"tolerance: for {share(int(lost.sum()), lost.shape, lost.size)} the absolute part lets a step err by more "
        f"than {MAX_ABSOLUTE_SHARE:g} of the longest that v or y has been; give one number, which goes by these lengths, or "
        f"a smaller absolute part",
        lost,
    )


def _of_a_control(run: Run, bodies: NBody, start: State | None) -> About | None:
    """When h·C·K passed 1 under a control in the printed form, which overshoots from there on.

    ``of_a_strong_control`` reports it at the start. Here the saved states are checked, then every state of the first such member,
    or of the first that diverged.
    """
    control = bodies.control
    if not (isinstance(control, EnergyControl) and control.form == "printed"):
        return None
    if run.paces is not None or start is None or run.overshoots is None:
        return None
    with np.errstate(all="ignore"):
        gain = run.dt * np.asarray(control.gain)
        began = gain * bodies.kinetic(np.broadcast_to(start[0], run.y.shape[1:]))
        if (began >= 1.0).any():
            return None
        saved = (gain * bodies.kinetic(np.moveaxis(run.v, 0, 2)) >= 1.0).any(axis=0)
    over = saved | (run.status != 0)
    if not over.any():
        return None
    index = tuple(np.argwhere(over)[0].tolist())
    overshoot = run.overshoots(index, encounters.MAX_RERUN)
    if overshoot is None:
        return None
    step, strength = overshoot
    text = (
        f"gain: h·C·K = {strength:.3g} at step {step} (t = {time_of(run, step, index):g}){of_member(index)}, expected below 1: "
        f'from there on the printed form overshoots and may overflow; use a smaller gain or step, or form="limited"'
    )
    return text, _only(run, index)


def _of_encounters(run: Run, bodies: NBody, start: State | None, doubtful: Shape | None) -> About | None:
    """Two bodies that met within a step, if something suggests it and the search takes a moment.

    Args:
        run: the run.
        bodies: its system.
        start: its first state; None if that is not known.
        doubtful: a member whose energy is doubtful, or None.
    """
    drifts = run.method.splits and bodies.force == "newton"
    suspects = [doubtful] if doubtful is not None else [] if start is None else _suspects(run, bodies, start)
    left = float(encounters.MAX_RERUN)
    for index in suspects:
        assert run.encounter is not None
        if left <= 0.0:
            break
        if run.status[index]:
            continue  # it diverged, and that finding names the pair
        if (met := run.encounter(index, left)) is not None:
            i, j = met.bodies
            if drifts:
                text = (
                    f"bodies {i} and {j}{of_member(index)} came to {met.distance:.3g} of each other at step {met.step} "
                    f"(t = {time_of(run, met.step, index):g}), nearer than {encounters.HILL_RADII:g} Hill radii, and "
                    f'{run.method.name} does not follow close encounters; use "dop853" with tolerance='
                )
                return text, _only(run, index)
            text = (
                f"bodies {i} and {j}{of_member(index)} met within step {met.step} "
                f"(t = {time_of(run, met.step, index):g}), {met.distance:.3g} apart, which steps of {run.dt:g} do not follow"
            )
            return text, _only(run, index)
        left -= run.steps * float(np.prod(bodies.y_shape))
    return None


def _suspects(run: Run, bodies: NBody, start: State) -> list[tuple[int, ...]]:
    """Indices of members in which two bodies would pass each other within one step.

    The two are taken to move alone from the start, from a saved state, or backward from the end.
    """
    n, evaluations = bodies.y_shape[0], run.method.evaluations * run.steps
    numbers = _numbers_of_pairs(run, bodies)
    drifts, few = run.method.splits and bodies.force == "newton", run.status.ndim == 0 and n <= FEW_BODIES
    # Checked before any array is made, as that takes longer than the rest.
    if drifts:
        pays = evaluations >= FEW_EVALUATIONS and numbers <= MOST_NUMBERS
    elif few:
        pays = evaluations >= FEW_EVALUATIONS
    else:
        pays = evaluations >= EVALUATIONS and evaluations * numbers >= 2 * PAIRS and numbers <= MOST_NUMBERS
    if not pays:
        return []
    # Where time runs back, velocities are reversed.
    h, time, way = abs(run.dt), run.steps * abs(run.dt), 1.0 if run.dt > 0.0 else -1.0
    # As many states as are little work beside the run. From the last one time runs back.
    looked = min(STATES, len(run.t) - 1, evaluations // EVALUATIONS) if drifts or few else 0
    between = np.linspace(1, len(run.t) - 1, looked, endpoint=False, dtype=int).tolist() if len(run.t) > 2 else []
    states = [(way * v, y) for v, y in (start, *((run.v[i], run.y[i]) for i in between), (-run.v[-1], run.y[-1]))]
    if drifts:
        near = [encounters.may_come_near(bodies, np.broadcast_to(v, y.shape), y) for v, y in states]
        return [tuple(index) for index in np.argwhere(np.logical_or.reduce(near)).tolist()]
    if few:
        return (
            [()]
            if any(encounters.may_meet(bodies, h, time, *(_lists(block, bodies.y_shape) for block in state)) for state in states)
            else []
        )
    may = np.zeros(run.status.shape, dtype=bool)
    for v, y in states:
        may |= encounters.may_meet_each(bodies, h, time, np.broadcast_to(v, y.shape), y)
    return [tuple(index) for index in np.argwhere(may).tolist()]


def _numbers_of_pairs(run: Run, bodies: NBody) -> int:
    """How many numbers a search among all pairs of all members works on."""
    return run.status.size * (bodies.y_shape[0] + 2 * bodies.pair_count)


def _doubtful(run: Run, bodies: NBody) -> Any:
    """By which share the energy of each member may change at most."""
    heaviest = bodies.masses.max(axis=0)
    planets = (bodies.masses.sum(axis=0) <= (1.0 + 1.0 / STAR) * heaviest) & (bodies.force == "newton")
    return np.where(planets & (run.paces is None), DOUBTFUL_OF_PLANETS, DOUBTFUL_CHANGE)


def _of_energy(method: str, ends: Ends, share_of: Any) -> tuple[str, Any, Shape] | None:
    """A message, its members, and the first of them."""
    first, last, _ = ends
    wrong = _changed(ends, share_of)
    if not wrong.any():
        return None
    index = tuple(np.argwhere(wrong)[0].tolist())
    some = int(np.count_nonzero(wrong))
    text = (
        f"{share(some, wrong.shape, wrong.size)} {'has' if some == 1 else 'have'} another energy at the end: "
        f"{f'{in_words(index)} has ' if wrong.size > 1 else ''}{last[index]:.3g} instead of {first[index]:.3g}, "
        f"so {method} did not follow its orbit"
    )
    return text, wrong, index


def _changed(ends: Ends, share_of: Any = DOUBTFUL_CHANGE) -> Any:
    """Where the energy has another size at the end."""
    first, last, moved = ends
    with np.errstate(all="ignore"):
        wrong = np.abs(last - first) > share_of * np.maximum(moved, np.maximum(np.abs(first), np.abs(last)))
    return wrong & np.isfinite(last)  # members that diverged were named before


def _of_massless(run: Run, bodies: NBody, start: State) -> tuple[str, Any, Shape] | None:
    """A message about bodies without mass around a single body with mass, its members, and the first of them.

    The energy of all bodies does not depend on them. Relative to a single attractor each keeps its energy per unit of mass, which
    several attractors may change.
    """
    if bodies.masses.all():
        return None  # the usual case, checked in a microsecond
    alone = np.count_nonzero(bodies.masses, axis=0) == 1
    evaluations = run.method.evaluations * run.steps if run.paces is None else _least(run.paces.evaluations)
    if not alone.any() or evaluations < FEW_EVALUATIONS or run.y[-1].size > MOST_NUMBERS:
        return None
    (v, y), batch = (run.v[-1], run.y[-1]), run.status.shape
    masses = np.broadcast_to(aligned(bodies.masses, 1, batch), (len(y), *batch))
    attractor = masses.argmax(axis=0)[np.newaxis, np.newaxis]
    strength = bodies.G * masses.max(axis=0)

    def energies(v: Array, y: Array) -> tuple[Array, Array]:
        d, w = (each - np.take_along_axis(each, attractor, axis=0) for each in (y, v))
        r2 = (d * d).sum(axis=1) + bodies.softening * bodies.softening
        kinetic = 0.5 * (w * w).sum(axis=1)
        return kinetic + strength * (-1.0 / np.sqrt(r2) if bodies.force == "newton" else 0.5 * np.log(r2)), kinetic

    with np.errstate(all="ignore"):
        (first, began), (last, ended) = energies(np.broadcast_to(start[0], y.shape), start[1]), energies(v, y)
    wrong = _changed(Ends(first, last, np.maximum(began, ended))) & (masses == 0.0) & alone
    if not wrong.any():
        return None
    body, *index = np.argwhere(wrong)[0].tolist()
    some = int(np.count_nonzero(wrong))
    who, energies_at = f"body {body}{of_member(tuple(index))}", f"{last[body, *index]:.3g} instead of {first[body, *index]:.3g}"
    energy, followed = "another energy per mass at the end", f"so {run.method.name} did not follow"
    text = (
        f"{who}, which has no mass, has {energy}: {energies_at}, {followed} its orbit"
        if some == 1
        else f"{some} bodies without mass have {energy}: {who} has {energies_at}, {followed} their orbits"
    )
    return text, wrong.any(axis=0), tuple(index)


def _ends(run: Run, bodies: NBody, start: State | None) -> Ends | None:
    """The recorded energies, or energies computed now if that costs little beside the run, else None."""
    if "energy" in run.recorded and len(run.t) > 1:
        with np.errstate(all="ignore"):
            moved = np.maximum(bodies.kinetic(run.v[0]), bodies.kinetic(run.v[-1]))
        first, last = run.recorded["energy"][[0, -1]]
        return Ends(first, last, moved)
    if start is None:
        return None
    end = run.v[-1], run.y[-1]
    n, members = len(end[1]), run.status.size
    evaluations = run.method.evaluations * run.steps if run.paces is None else _least(run.paces.evaluations)
    if run.status.ndim == 0 and n <= FEW_BODIES:
        return _of_few(bodies, start, end) if evaluations >= FEW_EVALUATIONS else None
    numbers = _numbers_of_pairs(run, bodies)
    if evaluations < EVALUATIONS or evaluations * numbers < 2 * PAIRS or prod(end[1].shape) > MOST_NUMBERS or not members:
        return None
    start = np.broadcast_to(start[0], end[0].shape), start[1]  # one number may have been given for all
    with np.errstate(all="ignore"):
        moved = np.maximum(bodies.kinetic(start[0]), bodies.kinetic(end[0]))
        return Ends(_energies(run, bodies, *start), _energies(run, bodies, *end), moved)


def _energies(run: Run, bodies: NBody, v: Array, y: Array) -> Array:
    """The energies of a state, with the same bits by the core and by NumPy."""
    if len(y) < MIN_BODIES_BY_CORE:
        return bodies.energy(v, y)
    from .engine.recorded import recorded  # only bodies of some number need it

    v, y = np.broadcast_to(v, run.v.shape[1:]), np.broadcast_to(y, run.y.shape[1:])
    energies: Array = recorded(bodies, ("energy",), 1.0, v[np.newaxis], y[np.newaxis])["energy"][0]
    return energies


def _least(counts: Any) -> int:
    """The least count, huge without members."""
    return int(counts) if counts.ndim == 0 else int(counts.min(initial=2**62))


def _of_few(bodies: NBody, start: State, end: State) -> Ends | None:
    """The energies of one member; None if they are not doubtful, without making an array."""
    (first, moved_first), (last, moved_last) = (_summed(bodies, v.tolist(), y.tolist()) for v, y in (start, end))
    moved = max(moved_first, moved_last)
    if abs(last - first) <= DOUBTFUL_OF_PLANETS * max(moved, abs(first), abs(last)):
        return None
    return Ends(np.asarray(first), np.asarray(last), np.asarray(moved))


def _lists(block: Array, shape: Shape) -> Any:
    """A block of one member as lists; one number may have been given for all."""
    numbers = block.tolist()
    return numbers if isinstance(numbers, list) else [[numbers] * shape[1]] * shape[0]


def _summed(bodies: NBody, v: Any, y: Any) -> tuple[float, float]:
    """The energy of one state and its kinetic part, in floats, NaN if not finite; ``v`` may be one number for all."""
    if not isinstance(v, list):
        v = [[v] * len(row) for row in y]
    masses, soft = bodies.masses.tolist(), float(bodies.softening) ** 2
    strength = float(bodies.G)
    newton = bodies.force == "newton"
    try:
        kinetic = sum(0.5 * m * sum(x * x for x in row) for m, row in zip(masses, v, strict=True) if m)
        potential, massive = 0.0, [(m, place) for m, place in zip(masses, y, strict=True) if m]
        for i, (m, place) in enumerate(massive):
            for its, other in massive[:i]:
                square = sum((a - b) * (a - b) for a, b in zip(place, other, strict=True)) + soft
                potential += m * its * (-1.0 / math.sqrt(square) if newton else 0.5 * math.log(square))
    except (ValueError, ZeroDivisionError):  # two bodies in one place, or numbers that are not finite
        return math.nan, math.nan
    return kinetic + strength * potential, kinetic
