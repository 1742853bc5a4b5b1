"""Sweeps whose members have steps of their own, and names that clash in a sweep."""

from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError
from stepwell.studies.sweeps import mixed_steps, outcomes, task
from support.cases import SYSTEMS, fits
from support.looped import in_turn, looped

STEPS = [0.1, 0.05, 0.025]


@looped(
    "system, v, y",
    [
        (sw.Oscillator(), 0.0, 1.0),
        (sw.NBody(), 0.0, np.arange(6.0).reshape(3, 2) ** 2),
        (sw.NBody(), np.ones((3, 2)), np.arange(6.0).reshape(3, 2) ** 2),
        (sw.Pendulum3D(), 0.1, [1.0, 0.0, 0.0]),
        (sw.RigidBody([1.0, 2.0, 3.0]), 1.0, [1.0, 0.0, 0.0, 0.0]),
    ],
)
def test_the_step_alone_is_varied(system: sw.System, v: Any, y: Any) -> None:
    for axes in ({"dt": STEPS}, {"dt": ("run", STEPS)}, {"dt": (("a", "b"), np.array([STEPS, STEPS[::-1]]))}):
        dataset = sw.sweep(system, axes, "rk4", v=v, y=y, steps=10, outcomes=["last", "extremes", "mean"])
        for i, dt in enumerate(STEPS):
            run = sw.integrate(system, "rk4", v=v, y=y, dt=dt, steps=10)
            for name, block in (("v_last", run.v[-1]), ("y_last", run.y[-1])):
                values = dataset[name].values
                np.testing.assert_array_equal(values[0, i] if len(dataset["status"].dims) == 2 else values[i], block)


def test_means_are_summed_state_after_state_whatever_the_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """And many states in one go: state by state took 50 times as long as the run of a member with a step of its own."""
    omega = np.linspace(0.5, 2.0, 3)
    axes = {"omega": ("run", omega), "dt": ("run", 0.1 / omega)}
    calls: list[int] = []
    whole = outcomes._Mean._add

    def counted(self: Any, t: Any, all_of: Any) -> None:
        calls.append(len(t))
        whole(self, t, all_of)

    monkeypatch.setattr(outcomes._Mean, "_add", counted)
    dataset = sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, steps=2000, outcomes="mean")
    assert len(calls) <= 6  # one for each member, and one for each of two that are tried
    monkeypatch.setattr(outcomes, "NUMBERS_AT_ONCE", 7)
    np.testing.assert_array_equal(
        sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, steps=2000, outcomes="mean").y_mean, dataset.y_mean
    )
    for i, each in enumerate(omega):
        run = sw.integrate(sw.Oscillator(each), "rk4", v=0.0, y=1.0, dt=0.1 / each, steps=2000, every=1)
        total = 0.0
        for k in range(2000):
            total += 0.5 * (run.t[k + 1] - run.t[k]) * (run.y[k] + run.y[k + 1])
        assert dataset.y_mean.values[i] == total / (run.t[-1] - run.t[0])


@looped(
    "options, message",
    [
        ({"outcomes": ["mean", sw.sweeps.Mean("y", name="y")]}, "two results 'y_mean'"),
        ({"outcomes": ["last", "last"]}, "two results"),
        ({"axes": {"omega": ("status", [1.0, 2.0])}}, "'status' is the name of a result"),
        ({"axes": {"omega": ("y_mean", [1.0, 2.0])}, "outcomes": "mean"}, "'y_mean' is the name of a result"),
    ],
)
def test_names_that_clash_are_refused_before_any_chunk(options: Any, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from stepwell.studies.sweeps import engines

    def never(*_: Any) -> Any:
        raise AssertionError("a chunk was computed")

    monkeypatch.setattr(engines, "run", never)
    arguments = {"axes": {"omega": [1.0, 2.0]}, "v": 0.0, "y": 1.0, "dt": 0.1, "steps": 10} | options
    with pytest.raises(ArgumentError, match=message):
        sw.sweep(sw.Oscillator, method="rk4", **arguments)


@sw.system
def driven(t: Any, v: Any, y: Any, *, omega: Any = 1.0, push: Any = 0.3) -> Any:
    """Duffing's equation, driven, with a force that grows with the time."""
    return push * np.cos(omega * t) + 1e-3 * t + y - y**3


@pytest.fixture
def pieces(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many members were in each piece of those that are stepped together."""
    sizes: list[int] = []
    make = mixed_steps.Lengths.make

    def counted(self: mixed_steps.Lengths, **options: Any) -> sw.Run:
        run = make(self, **options)
        sizes.append(run.status.size)
        return run

    monkeypatch.setattr(mixed_steps.Lengths, "make", counted)
    return sizes


OMEGA = np.linspace(0.5, 2.0, 21)
EACH = 2.0 * np.pi / OMEGA / 40.0
MAKERS = {
    "own": (driven, 0.1, 0.5),
    "drive": (lambda omega: sw.Oscillator(1.0, damping=0.1, form="physical", a=sw.Sinusoid(0.3, omega, 0.2)), 0.0, 0.5),
    "free": (sw.Oscillator, 0.1, 1.0),
    "bodies": (lambda omega: sw.NBody([1.0, 0.1, 0.0], force="newton", softening=0.3, G=omega), 0.1, [[0.0, 0], [1, 0], [0, 2]]),
    "attitude": (lambda omega: sw.RigidBody([1.0, 2.0, 3.0], weight=omega, centre=[0.0, 0.1, 0.2]), 0.4, [1.0, 0.0, 0.0, 0.0]),
}


@pytest.mark.filterwarnings("ignore::stepwell.AccuracyWarning")
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
@pytest.mark.parametrize(
    ("method", "name"), in_turn([m.name for m in sw.methods() if not m.is_exact and m.name != "wisdom_holman"], list(MAKERS))
)
def test_members_with_steps_of_their_own_are_stepped_together(method: str, name: str, pieces: list[int]) -> None:
    """With the bits of runs one by one, whatever the chunks and pieces."""
    make, v, y = MAKERS[name]
    system = make(omega=1.0) if callable(make) else make
    if not fits(system, sw.method(method)):
        pytest.skip("the method does not step it")
    axes = {"omega": ("run", OMEGA), "dt": ("run", EACH)}
    ask: dict[str, Any] = {"v": v, "y": y, "steps": 30, "transient": 7, "t0": 0.7, "outcomes": ["last", "extremes"], "observe": 3}
    whole = sw.sweep(make, axes, method, **ask)
    assert set(pieces) == {21}
    for chunk in (4, 21):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(task, "MAX_STEPS_OF_MEMBERS", 5 * chunk)
            assert sw.sweep(make, axes, method, **ask, chunk=chunk).equals(whole)
    for i in range(0, 21, 5):
        run = sw.integrate(make(omega=OMEGA[i]), method, v=v, y=y, dt=EACH[i], steps=37, every=1, t0=0.7)
        blocks = {"v": run.v, "y": run.y}
        for block, states in blocks.items():
            np.testing.assert_array_equal(whole[f"{block}_last"].values[i], states[-1])
            seen = states[[*range(7, 37, 3), 37]]
            np.testing.assert_array_equal(whole[f"{block}_max"].values[i], seen.max(axis=0) + 0.0)


@looped("i, name", enumerate(SYSTEMS))
def test_every_system_in_steps_of_each_member(i: int, name: str) -> None:
    """Those that are stepped together have the bits that each has alone."""
    rng, methods = np.random.default_rng(4), ("leapfrog", "standard_heun", "rodas4")
    system = SYSTEMS[name](rng, 3)
    state = [rng.uniform(0.1, 0.4, (*shape, 3)) for shape in (system.v_shape, system.y_shape)]
    method = next(m for m in (*methods[i % 3 :], "standard_heun") if fits(system, sw.method(m)))
    system = system.for_state_shapes(*state)
    ask: dict[str, Any] = {"v": state[0], "y": state[1], "t0": 0.2}
    if not mixed_steps.together(system, sw.method(method), (sw.sweeps.Last(),), {"fused": False}):
        return
    steps = np.array([0.01, 0.02, 0.013])
    run = mixed_steps.Lengths(system, sw.method(method), ask, steps, 20).make(20, 5)
    for k, dt in enumerate(steps):
        one = sw.integrate(system, method, **ask, dt=dt, steps=20, every=5)
        for block in ("v", "y"):
            np.testing.assert_array_equal(getattr(run, block)[..., k], getattr(one, block)[..., k])
        np.testing.assert_array_equal(run.t[:, k], one.t)


def test_one_step_for_each_and_steps_that_cannot_be() -> None:
    found = sw.sweep(sw.Oscillator(), {"dt": ("run", [0.1, 0.1, 0.1])}, "rk4", v=0.0, y=1.0, steps=10)
    run = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    np.testing.assert_array_equal(found.y_last, np.full(3, run.y[-1]))
    axes = {"omega": ("run", [1.0, 1.0]), "dt": ("run", [1.0, 1e-20])}
    with pytest.raises(ArgumentError, match="dt, t0: expected a time that moves on"):
        sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, steps=10, t0=1.0)
    axes = {"omega": ("omega", [1.0, 2.0]), "dt": ("omega", [0.1, 0.05])}
    with pytest.raises(ArgumentError, match=r"two coordinates would .* such as \{'omega': \(\"run\", values\), …\}"):
        sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, steps=10)


@looped(
    "options",
    [
        {"outcomes": "mean"},
        {"fused": True},
        {"dtype": "float32"},
        {"force": 0.1},
        {"outcomes": sw.sweeps.Extremes("energy")},
        {"outcomes": lambda run: {"end": run.y[-1]}},
    ],
)
def test_what_needs_one_step_is_computed_one_by_one(options: dict[str, Any], pieces: list[int]) -> None:
    axes = {"omega": ("run", OMEGA), "dt": ("run", EACH)}
    sw.sweep(sw.Oscillator, axes, "rk4", v=0.0, y=1.0, steps=10, **options)
    assert not pieces


def test_growth_and_divergence_of_members_with_steps_of_their_own() -> None:
    """The member, the step and the limit that are named are those of the member."""
    axes = {"omega": ("run", [1.0, 1.0, 1.0]), "dt": ("run", [0.1, 2.2, 0.2])}
    with pytest.warns(sw.AccuracyWarning, match=r"at omega = 1, dt = 2.2: each step of 2.2 by .* its stability limit is 2"):
        sw.sweep(sw.Oscillator, axes, "false_euler", v=0.0, y=1.0, steps=100)
    with pytest.warns(sw.DivergenceWarning, match=r"1 of 3 members diverged, that at omega = 1, dt = 2.2, at step"):
        found = sw.sweep(sw.Oscillator, axes, "false_euler", v=0.0, y=1.0, steps=3000)
    with pytest.warns(sw.DivergenceWarning):
        run = sw.integrate(sw.Oscillator(1.0), "false_euler", v=0.0, y=1.0, dt=2.2, steps=3000)
    assert found.first_bad_step.values.tolist() == [-1, int(run.first_bad_step), -1]
