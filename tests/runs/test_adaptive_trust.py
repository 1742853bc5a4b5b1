"""Adaptive steps where they were wrong without a word: pulses, jumps, small components, units, states that must stay positive."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, ShapeError, UnsupportedError
from stepwell.reference.acceptance import Acceptance
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from stepwell.runs.result import Status
from stepwell.scenes.stiff_equations import rober
from support.ways import assert_equal_ways

PAIRS = ["merson", "fehlberg", "fehlberg_5", "dop853"]
ONES, NOTHING = np.ones(3), sw.Sampled([0.0], interval=1.0)


@sw.system(order=1)
def gated(t: Any, n: Any, *, begin: float = 5.0, end: float = 6.0) -> Any:
    """A channel that opens for a while: ṅ = open·(1 − n) − n. Since 0·n is added, the times cannot be told from the equations."""
    t = t + 0 * n
    return np.where((t > begin) & (t < end), 1.0, 0.0) * (1 - n) - n


def opened(t: Any, begin: Any, end: Any) -> Any:
    """The solution from n(0) = 0: ½(1 − e^(−2(t − begin))) while open, then its decay."""
    inside = 0.5 * -np.expm1(-2.0 * np.clip(t - begin, 0.0, end - begin))
    return inside * np.exp(-np.maximum(t - end, 0.0))


@sw.system(order=1, shape=(3,))
def may_leonard(t: Any, n: Any, *, a: float = 0.8, b: float = 1.3) -> Any:
    """Three species, each of which suppresses the next."""
    return n * (1 - n - a * np.roll(n, -1) - b * np.roll(n, -2))


# ---- states within a step, and what happens within a step


def test_a_pulse_from_rest_is_seen() -> None:
    """At rest a step is no longer than a 32nd of the time since the start, so a pulse that lasts for longer is met by stages.

    The error at the end is that of some tens of steps at the jumps, each of which may err by the tolerance of n: 1e-7 is ample.
    """
    for method in PAIRS:
        run = sw.integrate(gated(), method, y=0.0, tolerance=1e-9, at=[6.0, 10.0])
        assert run.y == pytest.approx([0.43233236, 0.00791844], abs=1e-7), method
        late = sw.integrate(gated(begin=7.3, end=7.6), method, y=0.0, tolerance=1e-9, at=[7.5, 10.0])
        assert late.y == pytest.approx(opened(late.t, 7.3, 7.6), abs=1e-7), method


def test_random_pulses() -> None:
    """No saved state leaves [0, 1], and all are right, wherever the pulse begins and ends, and the state is asked for."""
    random = np.random.default_rng(7)
    begin = random.uniform(0.5, 8.0, 300)
    end = begin + random.uniform(0.3, 2.0, 300)
    at = np.sort(random.uniform(0.0, 10.0, 12))
    for method, dt in itertools.product(PAIRS, (None, 0.5)):
        run = sw.integrate(gated(begin=begin, end=end), method, y=0.0, dt=dt, tolerance=1e-7, at=at)
        assert (run.status == Status.OK).all(), (method, dt)
        assert run.y == pytest.approx(opened(at[:, np.newaxis], begin, end), abs=1e-5), (method, dt)


def test_a_state_within_a_step_is_as_good_as_the_tolerance() -> None:
    """The pulse lies within the first step, which is long: at its end its stages see nothing of it, the extra step does."""
    for method in PAIRS:
        run = sw.integrate(gated(begin=0.31, end=0.33), method, y=0.0, dt=1.0, tolerance=1e-9, at=[0.329, 0.7])
        assert run.y == pytest.approx(opened(run.t, 0.31, 0.33), abs=1e-6), method
        assert run.paces.rejected > 0, method


@pytest.mark.parametrize("method", PAIRS)
def test_jumps_are_exact(method: str) -> None:
    """No step crosses a jump, and what begins there is new: as good as without one, and cheaper than to feel for it."""
    begin, end = np.linspace(3.0, 7.0, 9), np.linspace(3.01, 7.5, 9)
    at = np.array([2.0, 3.005, 7.0, 7.2, 10.0])
    felt = sw.integrate(gated(begin=begin, end=end), method, y=0.0, tolerance=1e-10, at=at)
    run = sw.integrate(gated(begin=begin, end=end), method, y=0.0, tolerance=1e-10, at=at, jumps=np.array([begin, end]))
    assert run.y == pytest.approx(opened(at[:, np.newaxis], begin, end), abs=1e-9)
    assert run.paces.rejected.sum() < 0.5 * felt.paces.rejected.sum()
    if method == "merson":
        ask: dict[str, Any] = {"tolerance": 1e-10, "at": at[:2], "jumps": np.array([begin, end]), "backend": "numpy"}
        assert np.array_equal(run.y[:2], sw.integrate(gated(begin=begin, end=end), method, y=0.0, **ask).y)


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_jumps_of_all_and_of_each_member_with_times_of_each(backend: str) -> None:
    """Over two batch axes, of which the jumps and the starts may have the last alone; each member is as it would be alone."""
    ask: dict[str, Any] = {"tolerance": 1e-6, "at": [1.5], "backend": backend}
    of_some = np.array([[0.3, 0.31, 0.32], [0.5, 0.51, 0.52]])
    for jumps in (np.array([0.3, 0.5]), of_some, np.concatenate([of_some, of_some + 0.5])):
        for t0 in (0.1, np.array([0.0, 0.1, 0.2]), np.array([[0.0, 0.1, 0.2], [0.05, 0.1, 0.15]])):
            run = sw.integrate(sw.Oscillator(), "merson", v=np.zeros((2, 3)), y=1.0, t0=t0, jumps=jumps, **ask)
            for i, j in np.ndindex(2, 3):
                own = float(np.broadcast_to(t0, (2, 3))[i, j]), jumps if jumps.ndim == 1 else jumps[:, j]
                alone = sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, t0=own[0], jumps=own[1], **ask)
                assert alone.y[-1] == run.y[-1, i, j]


def test_a_jump_at_the_start_and_at_saved_times() -> None:
    """Both sides are on their sides, whether the jump counts to the left or to the right of its time."""
    for at in ([5.0, 6.0, 7.0], [7.0]):
        for jumps in ([5.0, 6.0], [6.0, 5.0, 9.0, -1.0]):
            run = sw.integrate(gated(), "dop853", y=0.0, tolerance=1e-11, at=at, t0=5.0, jumps=jumps)
            assert run.y == pytest.approx(opened(np.array(at), 5.0, 6.0), abs=1e-11)
            assert run.paces.rejected == 0


def test_a_largest_step() -> None:
    """No step is longer; of a decaying state that a pulse meets the steps would be some units long."""
    at, most = np.array([7.4, 9.0]), np.array([0.02, 0.01])
    for method in PAIRS:
        run = sw.integrate(gated(begin=7.3, end=7.33), method, y=0.0, tolerance=1e-8, at=at, max_step=most)
        assert run.y == pytest.approx(np.stack(2 * [opened(at, 7.3, 7.33)], -1), abs=1e-6), method
        assert (run.paces.accepted >= 9.0 / most).all(), method


def test_in_one_piece_or_in_several() -> None:
    """Jumps, the largest step and what must stay positive go on with the run."""
    options: dict[str, Any] = {"tolerance": 1e-6, "jumps": [5.0, 6.0], "max_step": 0.3, "positive": True}
    whole = sw.integrate(gated(), "merson", y=0.0, at=[4.9, 5.5, 8.0], **options)
    first = sw.integrate(gated(), "merson", y=0.0, at=[4.9, 5.5], **options)
    rest = sw.integrate(gated(), "merson", at=[8.0], resume=first)
    assert np.array_equal(whole.y[2:], rest.y)


# ---- the error of each component


#: Robertson's reaction at t = 0.4: FACTS, from three solvers.
AT_0_4 = np.array([0.98517211386, 3.386395379e-5, 0.01479402218522])


def test_a_small_component_is_as_good_as_a_large_one() -> None:
    """Robertson's y₂ is 3.6e-5 beside 1."""
    for method, tolerance in itertools.product(PAIRS, (1e-3, 1e-6)):
        run = sw.integrate(rober(), method, y=[1.0, 0.0, 0.0], tolerance=tolerance, at=[0.4])
        # The errors of steps die out with the fast mode, in which y₂ lives: what is left is of a few steps.
        assert run.y[-1] == pytest.approx(AT_0_4, rel=10.0 * tolerance), (method, tolerance)


@pytest.mark.parametrize("method", [*PAIRS, "taylor"])
def test_units_do_not_matter_component_by_component(method: str) -> None:
    """In other units, powers of two, every number of every step is that power times what it was: the same bits."""

    @sw.system(order=1, shape=(3,))
    def lorenz(t: Any, y: Any, *, k: Any = ONES) -> Any:
        x = y / k
        return k * np.array([10.0 * (x[1] - x[0]), x[0] * (28.0 - x[2]) - x[1], x[0] * x[1] - 8.0 / 3.0 * x[2]])

    units = 2.0 ** np.array([40.0, -13.0, -90.0])
    start = np.array([1.0, 2.0, 20.0])
    plain = sw.integrate(lorenz(), method, y=start, tolerance=1e-6, at=[1.0, 5.0])
    other = sw.integrate(lorenz(k=units), method, y=start * units, tolerance=1e-6, at=[1.0, 5.0])
    assert np.array_equal(other.y, plain.y * units)


def test_a_cascade_from_zero_goes_on() -> None:
    """Forty vessels, the first full: the last fills with the fortieth power of the time, in which no method has an order."""

    cascade = sw.system(order=1, shape=(40,))(lambda t, y: np.concatenate([[-y[0]], y[:-1] - y[1:]]))
    start = np.zeros(40)
    start[0] = 1.0
    from scipy.stats import poisson

    for method in PAIRS:
        run = sw.integrate(cascade(), method, y=start, tolerance=1e-6, at=[10.0], max_steps=5000)
        assert run.status == Status.OK
        assert run.y[-1] == pytest.approx(poisson.pmf(np.arange(40), 10.0), rel=1e-4, abs=1e-12)


def test_rows_and_blocks() -> None:
    """What is equivalent counts together: turned about, a run takes the same steps, but for roundings."""
    for scale in ("row", "block"):

        @sw.system(shape=(2, 2), scale=scale)
        def two(t: Any, v: Any, y: Any) -> Any:
            r = y[1] - y[0]
            pull = r / (r[0] ** 2 + r[1] ** 2) ** 1.5
            return np.array([pull, -pull])

        steps = []
        for angle in (0.0, 0.7):
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            v, y = np.array([[0.0, 0.5], [0.0, -0.5]]) @ turn, np.array([[1.0, 0.0], [-1.0, 0.0]]) @ turn
            run = sw.integrate(two(), "dop853", v=v, y=y, tolerance=1e-9, at=[5.0])
            steps.append(int(run.paces.accepted) + int(run.paces.rejected))
        assert steps[0] == steps[1], (scale, steps)


def test_tolerances_of_components() -> None:
    """As SciPy's: an absolute part for each, in its own units; one that is loose on one component is loose on that alone."""
    fine = sw.integrate(rober(), "dop853", y=[1.0, 0.0, 0.0], tolerance=(1e-9, np.array([1e-9, 1e-14, 1e-9])), at=[0.4])
    assert fine.y[-1] == pytest.approx(AT_0_4, rel=1e-8)
    loose = sw.integrate(rober(), "dop853", y=[1.0, 0.0, 0.0], tolerance=(1e-9, np.array([1e-9, 1e-3, 1e-9])), at=[0.4])
    assert loose.paces.accepted < fine.paces.accepted
    solution = sw.solve_ivp(rober().definition, (0.0, 0.4), [1.0, 0.0, 0.0], rtol=1e-9, atol=[1e-9, 1e-14, 1e-9])
    assert solution.y[:, -1] == pytest.approx(AT_0_4, rel=1e-8)
    of_each = np.array([[1e-9], [1e-14], [1e-9]])
    batch = sw.integrate(rober(), "dop853", y=np.tile([[1.0], [0.0], [0.0]], 2), tolerance=(1e-9, of_each), at=[0.4])
    assert np.array_equal(batch.y[-1], np.stack(2 * [fine.y[-1]], -1))
    with pytest.raises(ShapeError, match=r"may be meant for each component of y or for each member"):
        sw.integrate(rober(), "dop853", y=np.ones((3, 3)), tolerance=(1e-9, np.ones(3)), at=[0.4])


# ---- states that must stay positive


def test_three_species_stay_positive() -> None:
    for method, tolerance in itertools.product(PAIRS, (1e-3, 1e-9)):
        ask: dict[str, Any] = {"tolerance": tolerance, "at": np.linspace(10.0, 300.0, 30), "positive": True}
        run = sw.integrate(may_leonard(), method, y=[0.6, 0.6, 0.1], **ask)
        assert (run.status == Status.OK).all(), (method, tolerance)
        assert (run.y >= 0.0).all(), (method, tolerance)
        assert run.y.max() < 1.2, (method, tolerance)


def test_what_cannot_stay_positive_is_told() -> None:
    """ẏ = −1 is at zero at t = 1, and nothing keeps it there."""
    falls = sw.system(order=1)(lambda t, y: -1.0 + 0.0 * y)
    with pytest.warns(sw.ToleranceWarning):
        run = sw.integrate(falls(), "merson", y=1.0, tolerance=1e-6, at=[0.5, 2.0], positive=True)
    assert run.status == Status.UNDERFLOW
    assert run.paces.t == pytest.approx(1.0, abs=1e-9)
    assert run.y[0] == pytest.approx(0.5)


def test_some_components_alone() -> None:
    """An oscillation about zero goes on beside a concentration that must not become negative."""

    both = sw.system(order=1, shape=(3,))(lambda t, y: np.array([y[1], -y[0], -50.0 * y[2]]))
    for which in (2, [2], ("y", 2)):
        run = sw.integrate(both(), "merson", y=[1.0, 0.0, 1.0], tolerance=1e-2, at=np.linspace(0.1, 9.0, 20), positive=which)
        assert (run.y[:, 2] >= 0.0).all()
        assert (run.y[:, 0] < -0.5).any()
    for wrong in (3, ("x", 0), ("y", 0, 0), 1.5, "z"):
        with pytest.raises((ArgumentError, ShapeError), match="positive"):
            sw.integrate(both(), "merson", y=[1.0, 0.0, 1.0], tolerance=1e-2, at=[1.0], positive=wrong)
    with pytest.raises(ArgumentError, match=r"positive: expected a start at which y\[1\] is not negative, got -1"):
        sw.integrate(both(), "merson", y=[1.0, -1.0, 1.0], tolerance=1e-2, at=[1.0], positive=True)
    with pytest.raises(UnsupportedError, match="positive: taylor"):
        sw.integrate(both(), "taylor", y=[1.0, 0.0, 1.0], tolerance=1e-2, at=[1.0], positive=2)


# ---- backward, and spans of each member


@pytest.mark.parametrize("method", [*PAIRS, "taylor"])
def test_backward(method: str) -> None:
    """There and back; a run back is that of the reversed equations, to the bit."""

    driven = sw.system(order=1, shape=(2,))(lambda t, y: np.array([y[1], np.sin(3.0 * t) - 0.1 * y[1] - y[0] ** 3]))

    @sw.system(order=1, shape=(2,))
    def reversed_time(s: Any, y: Any) -> Any:
        t = -s
        return np.array([-y[1], -(np.sin(3.0 * t) - 0.1 * y[1] - y[0] ** 3)])

    there = sw.integrate(driven(), method, y=[1.0, 0.0], tolerance=1e-11, at=[5.0])
    back = sw.integrate(driven(), method, y=there.y[-1], t0=5.0, tolerance=1e-11, at=[2.5, 0.0, -1.0])
    assert np.array_equal(back.t, [2.5, 0.0, -1.0])
    # The damped motion is undamped going back: errors of some hundred steps grow by e^0.5.
    assert back.y[1] == pytest.approx([1.0, 0.0], abs=1e-8)
    again = sw.integrate(reversed_time(), method, y=there.y[-1], t0=-5.0, tolerance=1e-11, at=[-2.5, 0.0, 1.0])
    assert np.array_equal(back.y, again.y)


def test_backward_for_built_in_and_large_systems() -> None:
    """Back where they came from; large systems step by rows and not by a tape."""
    for scene in (sw.scenes.scene("figure_eight"), sw.scenes.scene("plummer")):
        there = sw.integrate(scene.system, "dop853", v=scene.v, y=scene.y, tolerance=1e-10, at=[0.2])
        back = sw.integrate(scene.system, "dop853", v=there.v[-1], y=there.y[-1], t0=0.2, tolerance=1e-10, at=[0.0])
        assert back.y[-1] == pytest.approx(scene.y, abs=1e-6)


def test_what_does_not_go_backward() -> None:
    bodies = sw.scenes.scene("figure_eight")
    with pytest.raises(UnsupportedError, match=r"at: .*leads a state back to its target"):
        sw.integrate(
            bodies.system, "dop853", v=bodies.v, y=bodies.y, tolerance=1e-6, at=[-1.0], control=sw.EnergyControl(gain=1.0)
        )
    with pytest.raises(ArgumentError, match="at: expected times that descend"):
        sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[-1.0, -0.5])
    with pytest.raises(ArgumentError, match="forward in time, or all backward"):
        sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-6, t0=np.array([0.0, 2.0]), at=[1.0])
    with pytest.raises(ArgumentError, match="dt: expected a step below zero"):
        sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[-1.0], dt=0.1)


# ---- the reference


ACCEPTANCES = [
    Acceptance(),
    Acceptance((0, 1, 2, 3, 4, 5)),
    Acceptance((0, 0, 1, 2, 3, 3), own=True),
    Acceptance((0, 0, 0, 1, 1, 2), positive=(1, 5)),
    Acceptance(own=True, positive=(0,)),
]


def test_attempts_are_one_graph() -> None:
    """The same graph of operations as the reference, so equal bits for every input."""

    springs = sw.system(shape=(3,))(lambda t, v, y, *, k=2.0: -k * np.roll(y, 1) + np.cos(t) * v)
    system = springs().for_state_shapes(np.zeros(3), np.zeros(3))
    for method, backward, acceptance in itertools.product([*PAIRS, "taylor"], (False, True), ACCEPTANCES):
        plan = engine.Plan(system, sw.method(method), (), 1.0, acceptance=acceptance, backward=backward)
        for what in ("attempt", "begin"):
            tape = _core.Tape()
            core = tape.trace(engine.model(plan), what)
            orders = [0] if what == "attempt" else []
            reference = getattr(Tracer(plan.system, tape), what)(plan.method, *orders, acceptance, backward=backward)
            assert [each.id for each in core] == [each.id for each in reference], (method, backward, acceptance, what)


def test_equal_bits_with_everything() -> None:
    """Jumps of each member, largest steps, positive states, tolerances of components; on every way through the core."""
    random = np.random.default_rng(11)
    start = random.uniform(0.05, 1.0, (3, 40))
    ask: dict[str, Any] = {
        "tolerance": (random.uniform(1e-7, 1e-5, (3, 1)), random.uniform(1e-9, 1e-7, 40)),
        "at": [0.5, 3.0, 9.0],
        "jumps": np.sort(random.uniform(0.0, 9.0, (3, 40)), axis=0),
        "max_step": random.uniform(0.1, 2.0, 40),
        "positive": [0, 2],
    }
    for method in ("merson", "dop853"):
        rust, numpy = (sw.integrate(may_leonard(), method, y=start, backend=backend, **ask) for backend in ("rust", "numpy"))
        assert np.array_equal(rust.y, numpy.y)
        for name in ("t", "h", "accepted", "rejected"):
            assert np.array_equal(getattr(rust.paces, name), getattr(numpy.paces, name)), (method, name)


# ---- where else the options go


def test_inputs_know_their_jumps() -> None:
    """Held samples are met at their times: as good as a closed form, and no step is rejected for them."""
    values = np.array([0.0, 1.0, -2.0, 0.5, 0.5, 3.0])

    follows = sw.system(order=1)(lambda t, y, *, u=NOTHING: u - y)
    y, at = 0.0, np.arange(1.0, 7.0)
    right = []
    for value in values:  # over each second, y goes to the value by 1 − 1/e
        y = value + (y - value) * np.exp(-1.0)
        right.append(y)
    for method in PAIRS:
        run = sw.integrate(follows(u=sw.Sampled(values, interval=1.0)), method, y=0.0, tolerance=1e-10, at=at)
        assert run.y == pytest.approx(right, abs=1e-8), method


def test_scenes_sweeps_and_solve_ivp() -> None:
    """The same options, and the same numbers."""
    options: dict[str, Any] = {"jumps": [7.3, 7.33], "max_step": 0.4, "positive": True}
    system, at = gated(begin=7.3, end=7.33), [7.32, 8.0]
    run = sw.integrate(system, "merson", y=0.1, tolerance=1e-8, at=at, **options)
    scene = sw.scenes.Scene(system, y=0.1, horizon=8.0, **options)
    assert np.array_equal(scene.run("merson", tolerance=1e-8, at=at).y, run.y)
    pytest.importorskip("xarray")
    swept = sw.sweep(gated, {"begin": ("run", [7.3]), "end": ("run", [7.33])}, "merson", y=0.1, tolerance=1e-8, at=at, **options)
    assert swept.y_last.values[0] == run.y[-1]
    with pytest.raises(ArgumentError, match="max_step: works with tolerance= and at= only"):
        sw.integrate(system, "merson", y=0.1, dt=0.1, steps=2, max_step=0.1)


def test_members_at_rest_do_not_count_as_one_of_the_block() -> None:
    """Each component of v and of y is one group: no number of the batch is one of the measure of another member."""
    hangs = sw.system(lambda t, v, y: -np.sin(y))
    v, y = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    for method, at in (("merson", [0.01, 4.0]), ("taylor", [0.01])):
        run = assert_equal_ways(hangs(), method, ways=("by the reference",), v=v, y=y, tolerance=1e-6, at=at)
        assert run.paces.accepted[0] < 100


@sw.system(order=1)
def adds(t: Any, y: Any, *, u: float = 0.0) -> Any:
    """ẏ = u."""
    return u + 0.0 * y


def test_steps_end_where_held_samples_change() -> None:
    """The integral of held samples, forward and back: no step sees two of them, and none is rejected.

    Bound: a sample begins some 2⁻⁴⁴ of the time since the first early (HOLD_SLACK), and within four roundings of a time of that.
    """
    values = np.array([0.0, 1.0, -2.0, 3.0, 4.0, -1.0])
    for method, interval, start in itertools.product(PAIRS, (1.0, 0.1, 1e-7, 3e5), (0.0, -2.5, 1e4)):
        if interval < 1e-9 * start:  # samples are shorter than the roundings of their times are allowed to be
            continue
        u, times = sw.Sampled(values, interval=interval, start=start), start + interval * np.arange(6)
        sums = interval * np.concatenate([[0.0], np.cumsum(values[:-1])])
        bound = 4.0 * 8.0 * (2.0**-44 * 5.0 * interval + 16.0 * np.spacing(abs(start) + 5.0 * interval))
        forward = sw.integrate(adds(u=u), method, y=0.0, t0=start, tolerance=1e-9, at=times)
        back = sw.integrate(adds(u=u), method, y=sums[-1], t0=times[-1], tolerance=1e-9, at=times[::-1])
        for run, right in ((forward, sums), (back, sums[::-1])):
            np.testing.assert_allclose(run.y, right, rtol=0, atol=bound, err_msg=f"{method}, {interval}, {start}")
            assert run.paces.rejected == 0, (method, interval, start)


with_pole = sw.system(order=1)(lambda t, y, *, pole=1.0: -y / (t - pole))


@pytest.mark.parametrize(
    ("pole", "first", "backend"), [(1.0, None, "rust"), (0.3, 0.01, "numpy"), (7.3, 0.4, "rust"), (-2.0, None, "rust")]
)
def test_a_pole_of_which_a_method_happens_to_be_exact_is_not_passed(pole: float, first: float | None, backend: Any) -> None:
    """Of ẏ = −y/(t − a) the solution y₀·a/(a − t) has a pole at t = a. Fehlberg's formulas continue it exactly behind the pole.

    Their estimate of the error is then rounding: such a step was accepted, and y(2a) was −y₀. It ends where the relative rounding
    of t − a, 2⁻⁵³·a/|t − a|, is what is tolerated, or nearer: within 10⁻⁹ of the pole, at 10⁻⁶.
    """
    system = with_pole(pole=pole)
    for method, tolerance in itertools.product(("fehlberg", "fehlberg_5"), (1e-3, 1e-6)):
        with pytest.warns(sw.ToleranceWarning, match=r"the run stopped before t = .*, at t = "):
            run = sw.integrate(system, method, y=1.5, tolerance=tolerance, at=[2.0 * pole], dt=first, backend=backend)
        assert run.status in (Status.UNDERFLOW, Status.NOT_FINITE)
        assert abs(run.stopped_at - pole) < 1e-9 * abs(pole)
        before = sw.integrate(system, method, y=1.5, tolerance=tolerance, at=[0.9 * pole])
        # Its relative error is that of t − a, and each of its steps errs by no more than is tolerated of what it has become.
        np.testing.assert_allclose(before.y[-1], 15.0, rtol=tolerance * float(before.paces.accepted + 1))
