"""Sweeps whose members a device steps, computing outcomes meanwhile: the bits of the CPU, and no history crosses the bus."""

import itertools
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.device import adaptive, fixed, opencl
from stepwell.device.reductions import Extremes, Observer
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.studies.sweeps import ensemble
from support.devices import NAMES, assert_alike, needs_device
from support.families import family
from support.for_each import for_each
from support.sweeping import driven, swinging

pytest.importorskip("xarray")

pytestmark = needs_device

E, M = sw.sweeps.Extremes, sw.sweeps.Mean
Crossing, Period = sw.sweeps.Crossing, sw.sweeps.Period


@sw.system(order=1)
def lorenz(t: Any, y: Any, *, rho: Any = 28.0) -> Any:
    return np.array([10.0 * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])


@sw.system(order=1)
def explodes(t: Any, y: Any, *, rate: float = 1.0) -> Any:
    return rate * y * y


def bodies(mass: Any) -> sw.NBody:
    """Three bodies in a plane."""
    return sw.NBody(np.stack([np.ones_like(mass), mass, 0.5 * np.ones_like(mass)]), softening=0.1)


MU = {"mu": ("mu", np.linspace(0.5, 4.0, 5)), "y": ("y0", np.linspace(-2.0, 2.0, 13))}
PLANE: dict[str, Any] = {
    "v": np.array([[0.0, 0.1], [0.3, 0.0], [0.1, -0.8]]),
    "y": np.array([[0.0, 0.0], [1.0, 0.2], [-0.6, 1.0]]),
}
BODIES = {"mass": ("mass", np.linspace(0.3, 2.0, 9))}
OMEGA = {"omega": ("omega", np.linspace(0.5, 3.0, 11)), "y": ("y0", np.linspace(-2.0, 2.0, 7))}

#: System, axes, method, further arguments.
CASES: dict[str, tuple[Any, dict[str, Any], str, dict[str, Any]]] = {
    "both blocks": (driven, MU, "rk4", {"outcomes": ["extremes", "mean", "last"]}),
    "one block": (driven, MU, "rk4", {"outcomes": [E("y"), M("v", name="drift")]}),
    "passages": (driven, MU, "rk4", {"dt": 0.05, "outcomes": [Period(), Crossing("v", 0.1, -1), "extremes"]}),
    "both ways": (driven, MU, "rk4", {"dt": 0.05, "outcomes": [Period(direction=0), Crossing("y", -1.5, 0), "last"]}),
    "after a transient": (driven, MU, "rk4", {"transient": 40, "observe": 7, "outcomes": ["extremes", "mean", "period"]}),
    "a longer interval than the run": (driven, MU, "rk4", {"observe": 5000, "outcomes": ["extremes", "mean", "period"]}),
    "a method with a carry": (swinging, MU, "leapfrog", {"transient": 3, "observe": 3, "outcomes": ["mean", "period"]}),
    "another carry": (swinging, MU, "verlet", {"outcomes": ["extremes", "mean", Crossing("v")]}),
    "components": (lorenz, {"rho": ("rho", np.linspace(10.0, 40.0, 70))}, "rk4", {
        "y": np.array([1.0, 2.0, 3.0]), "dt": 0.01, "v": None,
        "outcomes": [E(("y", 2)), M(("y", 0)), M(("y", 1)), Period(("y", 0)), Crossing(("y", 2), 25.0), "last"],
    }),
    "a quantity": (sw.Oscillator, OMEGA, "false_euler", {"outcomes": [E("energy"), M("energy"), Crossing("energy", 0.5, 0)]}),
    "bodies": (bodies, BODIES, "pefrl", {
        **PLANE, "outcomes": [E("energy"), M("energy"), E(), M(("y", 1, 0)), E("closest"), Period(("y", 2, 1))],
    }),
    "under control": (bodies, BODIES, "rk4", {**PLANE, "control": sw.Projection(), "outcomes": [E("energy"), M("energy")]}),
    "a force": (driven, MU, "rk4", {"force": 0.1, "fused": True, "outcomes": ["mean", "extremes"]}),
    "float32": (driven, MU, "rk4", {"dtype": "float32", "transient": 10, "outcomes": ["last", "extremes", "mean", "period"]}),
    "float32, fused": (driven, MU, "rk4", {"dtype": "float32", "fused": True, "observe": 3, "outcomes": ["mean", "crossing"]}),
    "exact steps": (sw.Oscillator, OMEGA, "exact", {"outcomes": ["mean", "extremes", "period"]}),
    "with a function": (driven, MU, "rk4", {"steps": 30, "every": 10, "outcomes": ["mean", lambda run: {"first": run.y[0]}]}),
    "with exponents": (driven, MU, "rk4", {"steps": 40, "outcomes": ["mean", "lyapunov"]}),
}  # fmt: skip


@pytest.fixture
def bus(monkeypatch: Any) -> list[int]:
    """The sizes of all arrays that are taken from devices from now on."""
    sizes: list[int] = []
    before = opencl.Machine.get

    def get(self: Any, array: Any, buffer: Any, offset: int = 0) -> None:
        sizes.append(array.nbytes)
        before(self, array, buffer, offset)

    monkeypatch.setattr(opencl.Machine, "get", get)
    return sizes


def both(system: Any, axes: Any, method: str, **options: Any) -> tuple[Any, Any]:
    """The sweep by the CPU and by a device, which warn of the same."""
    results, said = [], []
    for device in ("cpu", "opencl"):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            results.append(sw.sweep(system, axes, method, device=device, **options))
        said.append([str(each.message) for each in caught])
    assert said[0] == said[1]
    return results[0], results[1]


#: What is also in a case of every day, with other things beside it, or is the text of one in other types.
LONG_CASES = ("one block", "passages", "a method with a carry", "a force", "float32, fused", "exact steps", "with exponents")


@pytest.mark.parametrize("case", family(CASES, lambda case: case not in LONG_CASES))
def test_the_bits_are_those_of_the_cpu(case: str, bus: list[int]) -> None:
    system, axes, method, options = CASES[case]
    options = {"dt": 0.02, "v": 0.3, "steps": 800} | options
    cpu, device = both(system, axes, method, **{key: value for key, value in options.items() if value is not None})
    assert_alike(cpu, device)
    members = cpu["status"].size
    states = 1 + ("transient" in options) + ("every" in options) * 4
    assert sum(bus) / 8 < members * (100 + 24 * states), "histories would be 1600 numbers of each member, or more"


def test_what_comes_back_does_not_grow_with_the_run(bus: list[int]) -> None:
    """Of n numbers of a state come back the state, a last step that was bad, and 2n, n, 5 + 2n and 9 + 4n of the outcomes."""
    sizes, outcomes = [], ["extremes", "mean", Crossing(("y", 0)), Period(("y", 1))]
    axes = {"rho": ("rho", np.linspace(10.0, 40.0, 70))}
    for steps in (10, 1000):
        bus.clear()
        sw.sweep(lorenz, axes, "rk4", y=1.0, dt=0.01, steps=steps, outcomes=outcomes, device="opencl")
        sizes.append(sum(bus))
    assert sizes[0] == sizes[1] == 8 * 70 * (3 + 1 + 6 + 3 + 11 + 21)


def test_what_must_see_the_states_sees_them(bus: list[int]) -> None:
    """A history, a function of Python, events, quantities in float32: saved states cross the bus, with the same results."""
    plain: dict[str, Any] = {"v": 0.3, "dt": 0.02, "steps": 300}
    outcomes: list[dict[str, Any]] = [
        {"outcomes": ["mean", "history"], "every": 10},
        {"outcomes": ["extremes", M(lambda t, v, y: v * y, name="power")]},
        {"outcomes": "extremes", "events": sw.Event(lambda t, v, y: y, name="ground")},
        {"outcomes": ["extremes", E("energy")], "dtype": "float32"},
    ]
    for each in outcomes:
        bus.clear()
        system = sw.Oscillator if "dtype" in each else driven
        cpu, device = both(system, OMEGA if "dtype" in each else MU, "rk4", **plain, **each)
        assert_alike(cpu, device)
        assert sum(bus) > 8 * 300


@pytest.mark.parametrize(
    ("method", "system"), family([("rk4", driven), ("leapfrog", swinging)], lambda method, _: method != "rk4")
)
def test_launches_and_chunks(method: str, system: Any, monkeypatch: Any) -> None:
    """Where launches end makes no difference: within an interval, at its end, behind several. A carry goes over them, too."""
    options: dict[str, Any] = {"v": 0.3, "dt": 0.02, "steps": 205, "transient": 2, "observe": 6}
    outcomes: Any = ["mean", "extremes", "period", Crossing("v", 0.1, -1)]
    cpu = sw.sweep(system, MU, method, outcomes=outcomes, **options)
    for most in (1, 4, 6, 7, 40):
        monkeypatch.setattr(fixed, "MOST_STEPS", most)
        assert_alike(cpu, sw.sweep(system, MU, method, outcomes=outcomes, device="opencl", **options))
    monkeypatch.undo()
    for more in ({"chunk": 7}, {"memory": 1e5}, {"chunk": 9, "threads": 3}):
        assert_alike(cpu, sw.sweep(system, MU, method, outcomes=outcomes, device="opencl", **more, **options))


#: One without a carry, and one whose velocities are computed, each with other numbers.
DIVERGING = itertools.product(("rk4", "leapfrog", "verlet"), ("float64", "float32"))
FEW_DIVERGING = (("rk4", "float64"), ("verlet", "float32"))


@pytest.mark.parametrize(("method", "dtype"), family(DIVERGING, lambda *each: each in FEW_DIVERGING))
def test_members_that_diverge(dtype: str, method: str, bus: list[int]) -> None:
    """States that are not finite are in the extremes and means, also where only velocities are not; and zeros have one sign."""
    axes = {"omega": ("omega", np.geomspace(0.5, 3000.0, 40)), "y": ("y0", [0.0, -0.0, 1.0])}
    outcomes = ["extremes", "mean", "period", "last"]
    options: dict[str, Any] = {"v": 0.0, "dt": 0.01, "steps": 700, "transient": 20, "observe": 50, "outcomes": outcomes}
    cpu, device = both(sw.Oscillator, axes, method, dtype=dtype, **options)
    assert_alike(cpu, device)
    assert 0 < int((cpu.status > 0).sum()) < cpu.status.size
    assert bool(np.isnan(cpu.y_mean).any())
    both_now, both_device = both(explodes, {"rate": [0.1, 3.0, 0.2, 9.0]}, "rk4", y=1.0, dt=0.1, steps=200, outcomes=outcomes)
    assert_alike(both_now, both_device)


#: Each method and each outcome, of which the first need no times.
OF_EACH_MEMBER = itertools.product(("rk4", "verlet"), (["last", "extremes"], ["mean", "period"]))


@pytest.mark.parametrize(
    ("method", "outcomes"), family(OF_EACH_MEMBER, lambda method, outcomes: (method == "verlet") == ("last" in outcomes))
)
def test_steps_of_each_member(method: str, outcomes: list[str], bus: list[int]) -> None:
    axes = {"omega": ("run", [1.0, 2.0, 4.0]), "dt": ("run", [0.01, 0.02, 0.04])}
    cpu, device = both(sw.Oscillator, axes, method, v=0.0, y=1.0, steps=500, transient=7, outcomes=outcomes)
    assert_alike(cpu, device)
    assert "mean" in outcomes or sum(bus) < 8 * 3 * 40


#: Methods and further arguments of sweeps with a tolerance.
WITH_A_TOLERANCE: dict[str, tuple[str, dict[str, Any]]] = {
    "merson": ("merson", {}),
    "dop853, an absolute part": ("dop853", {"tolerance": (1e-8, 1e-6)}),
    "a series": ("taylor", {"tolerance": 1e-10}),
    "stiff": ("rodas4", {"tolerance": 1e-5}),
    "float32": ("merson", {"dtype": "float32", "tolerance": 1e-5}),
    "backward": ("merson", {"at": -np.linspace(0.0, 0.4, 200)}),
    "jumps": ("merson", {"jumps": [1.0, 2.5], "max_step": 0.3}),
    "stopped": ("merson", {"max_steps": 405}),
    "irregular times": ("merson", {"at": np.array([0.0, 1e-9, 1.0, 1.0000001, 5.0, 11.0])}),
}
#: One list for all, so that the kernel of a method is compiled once.
SEEN: list[Any] = ["extremes", "mean", Crossing("v", 0.1, -1), Period(direction=0), "last", "evaluations"]


@pytest.mark.parametrize("case", family(WITH_A_TOLERANCE, lambda case: case not in ("dop853, an absolute part", "stiff")))
def test_with_a_tolerance(case: str, bus: list[int]) -> None:
    """By a pair, and by a series, which sees states within its steps; other methods differ in their attempts alone."""
    method, options = WITH_A_TOLERANCE[case]
    options = {"v": 0.3, "tolerance": 1e-7, "at": np.linspace(0.0, 12.0, 800)} | options
    cpu, device = both(driven, MU, method, outcomes=SEEN, **options)
    assert_alike(cpu, device)
    assert case != "stopped" or 0 < int((cpu.status > 0).sum()) < cpu.status.size
    assert sum(bus) < 8 * 65 * 400 or case in ("backward", "irregular times")


def test_a_tolerance_in_shares_and_launches(monkeypatch: Any) -> None:
    options: dict[str, Any] = {"v": 0.3, "tolerance": 1e-7, "at": np.linspace(0.5, 12.0, 40), "outcomes": SEEN}
    cpu = sw.sweep(driven, MU, "merson", **options)
    for attempts, saved in ((1, 1 << 14), (3, 1 << 28), (1000, 1 << 13)):
        monkeypatch.setattr(adaptive, "MOST_ATTEMPTS", attempts)
        monkeypatch.setattr(adaptive, "MOST_SAVED", saved)
        assert_alike(cpu, sw.sweep(driven, MU, "merson", device="opencl", **options))
    assert_alike(cpu, sw.sweep(driven, MU, "merson", device="opencl", chunk=9, threads=3, **options))


def test_what_is_seen_here() -> None:
    options: dict[str, Any] = {"v": 0.3, "tolerance": 1e-7, "at": np.linspace(0.0, 5.0, 40), "outcomes": ["mean", E("energy")]}
    assert_alike(*both(sw.Oscillator, OMEGA, "merson", **options))
    rng = np.random.default_rng(4)
    options: dict[str, Any] = {"v": rng.normal(size=(64, 2)), "y": rng.normal(size=(64, 2)), "dt": 0.001, "steps": 3}

    def many(strength: float) -> sw.NBody:
        return sw.NBody(np.ones(64), G=strength, softening=0.1)

    axes = {"strength": ("strength", [0.5, 1.0])}
    cpu, device = both(many, axes, "leapfrog", outcomes=["extremes", "mean"], **options)
    assert_alike(cpu, device)
    # As of ``np.minimum``; the text is that of C.
    lines = "\n".join(Observer(1, (Extremes((0,)),), 1).see())
    assert "if (q0 < o0 || q0 != q0) o0 = q0;" in lines


#: The same rows, reduced otherwise: what is kept of a text in a process goes by both.
ORDERS: list[tuple[str, list[Any]]] = [
    (kind, outcomes)
    for kind in ("fixed", "adaptive")
    for outcomes in (
        [["extremes", "mean"], ["mean", "extremes"]],
        [["mean", M("y", name="other")], [M("y", name="other"), E("y")]],
    )
]


@pytest.mark.parametrize(
    ("kind", "orders"), family(ORDERS, lambda kind, orders: kind == "fixed" or orders[0] == ["extremes", "mean"])
)
def test_outcomes_in_another_order(kind: str, orders: list[Any]) -> None:
    """By the same steps in one process."""
    method, more = "rk4", {"dt": 0.02, "steps": 50}
    if kind == "adaptive":
        method, more = "merson", {"tolerance": 1e-6, "at": np.linspace(0.0, 2.0, 20)}
    for outcomes in orders:
        assert_alike(*both(sw.Oscillator, OMEGA, method, outcomes=outcomes, v=0.3, **more))


#: Sweeps whose states come back, or members that stop; by a method with a carry, over a transient, an interval, an event.
STATES: dict[str, tuple[str, dict[str, Any]]] = {
    "last": ("rk4", {"steps": 90}),
    "no transient of any length": ("rk4", {"steps": 1, "transient": 1}),
    "history": ("rk4", {"steps": 90, "every": 20, "outcomes": ["history", "mean"], "observe": 8}),
    "a function": ("rk4", {"steps": 90, "every": 9, "outcomes": lambda run: run.y.max(axis=0)}),
    "events": ("rk4", {"steps": 90, "events": sw.Event(lambda t, v, y: y, name="ground"), "outcomes": "extremes"}),
    "after a transient": ("leapfrog", {"steps": 90, "transient": 40}),
    "at intervals": ("leapfrog", {"steps": 90, "transient": 11, "outcomes": ["last", "extremes", "mean"], "observe": 7}),
    "stopped": ("leapfrog", {"steps": 90, "events": sw.Event(lambda t, v, y: y - 1.0, name="ground", terminal=True)}),
}


@for_each("case", STATES)
def test_states_that_come_back_are_those_of_the_cpu(case: str) -> None:
    method, options = STATES[case]
    assert_alike(*both(swinging if method == "leapfrog" else driven, MU, method, dt=0.02, v=0.3, **options))


def test_the_variable_names_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []
    before = ensemble._compute

    def watched(task: Any, *rest: Any) -> None:
        seen.append(task.options.get("device"))
        before(task, *rest)

    monkeypatch.setattr(ensemble, "_compute", watched)
    monkeypatch.setenv("STEPWELL_DEVICE", "opencl")
    sw.sweep(driven, MU, "rk4", v=0.0, dt=0.02, steps=5)
    sw.sweep(driven, MU, "rk4", v=0.0, dt=0.02, steps=5, device="cpu")
    assert seen == [NAMES[0], "cpu"]


def test_a_store_goes_on_with_another_device_but_no_wrong_one(tmp_path: Any) -> None:
    pytest.importorskip("zarr")
    options: dict[str, Any] = {"v": 0.0, "dt": 0.02, "steps": 20, "store": tmp_path / "results.zarr", "chunk": 10}
    one = sw.sweep(driven, MU, "rk4", **options)
    other = sw.sweep(driven, MU, "rk4", device="opencl", **options)
    assert one.attrs["bits"] == other.attrs["bits"]
    with pytest.raises(ArgumentError, match="device: expected 'cpu', 'opencl'"):
        sw.sweep(driven, MU, "rk4", v=0.0, dt=0.02, steps=20, device="gpu")
    with pytest.raises(UnsupportedError, match="device: there is no opencl:99"):
        sw.sweep(driven, MU, "rk4", v=0.0, dt=0.02, steps=20, device="opencl:99")


@pytest.mark.parametrize("more", [{"dt": 0.1, "steps": 5}, {"tolerance": 1e-3, "at": [1.0]}])
def test_what_is_too_long_is_refused_before_any_work(more: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ensemble, "_compute", lambda *_: pytest.fail("work"))

    def chains(k: Any) -> sw.System:
        return sw.Springs([(i, i + 1) for i in range(6000)], stiffness=k, rest=1.0, dim=3)

    start = {"v": 0.0, "y": np.arange(18003.0).reshape(6001, 3, 1)}
    with pytest.raises(UnsupportedError, match="too long for a kernel, which has at most 100000"):
        sw.sweep(chains, {"k": ("k", [1.0, 2.0])}, "dop853", device="opencl", **start, **more)
