"""``sensitivity=``: the derivatives of a run beside its states; that they are those of the scheme is in test_columns.py."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.devices import NAMES, needs_device
from support.refusals import refused

FIXED, ADAPTIVE = {"dt": 0.05, "steps": 40, "every": 20}, {"tolerance": 1e-9, "at": [1.0, 2.0]}


@sw.system
def duffing(t: Any, v: Any, y: Any, *, beta: Any = 1.0, delta: Any = 0.3, gains: Any = (0.5, 0.1)) -> Any:
    """With a parameter of two numbers."""
    return gains[0] * np.cos(1.2 * t) - delta * v + y - beta * y**3 + gains[1]


def differences(name: str, method: str, options: dict[str, Any], j: int | None = None) -> Any:
    """∂y/∂p and ∂v/∂p by differences of runs."""
    h, ends = 1e-5, []
    for sign in (1.0, -1.0):
        value = np.array({"beta": [1.0, 1.3], "delta": 0.3, "gains": [0.5, 0.1], "v": 0.2, "y": 1.0}[name])
        value = value + sign * h * (1.0 if j is None else np.eye(2)[j])
        start = {"v": 0.2, "y": 1.0} | ({name: value} if name in ("v", "y") else {})
        numbers = {"beta": np.array([1.0, 1.3])} | ({} if name in ("v", "y") else {name: value})
        ends.append(sw.integrate(duffing(**numbers), method, **start, **options))
    return [(getattr(ends[0], block) - getattr(ends[1], block)) / (2.0 * h) for block in "yv"]


@pytest.mark.parametrize("options", [FIXED, ADAPTIVE])
@pytest.mark.parametrize("method", ["rk4", "false_euler", "dop853", "tsit5", "taylor", "rodas5p"])
def test_derivatives_are_those_of_runs_and_states_are_as_without(method: str, options: dict[str, Any]) -> None:
    if options is ADAPTIVE and sw.method(method).error_order is None:
        return
    names = ["beta", "delta", "gains", "v", "y"]
    system = duffing(beta=np.array([1.0, 1.3]))
    run = sw.integrate(system, method, v=0.2, y=1.0, **options, sensitivity=names)
    plain = sw.integrate(system, method, v=0.2, y=1.0, **options)
    assert (run.t.tobytes(), run.v.tobytes(), run.y.tobytes()) == (plain.t.tobytes(), plain.v.tobytes(), plain.y.tobytes())
    assert list(run.sensitivity) == list(run.sensitivity_of_v) == names
    assert run.system == plain.system
    for name in names:
        own = (2,) if name == "gains" else ()
        assert run.sensitivity[name].shape == (len(run.t), *own, 2)
        for j in range(2) if own else (None,):
            place = (slice(None), j) if own else (slice(None),)
            for found, true in zip((run.sensitivity, run.sensitivity_of_v), differences(name, method, options, j), strict=True):
                # Differences err by h²/6 of third derivatives, some hundreds here, and by steps of other lengths.
                np.testing.assert_allclose(found[name][place], true, rtol=0, atol=2e-6)


def test_both_backends_and_threads_agree() -> None:
    y = np.linspace(0.5, 1.5, 300)
    for options in (FIXED, ADAPTIVE):
        ask: dict[str, Any] = {"v": 0.2, "y": y, "sensitivity": ["beta", "y"], **options}
        runs = [
            sw.integrate(duffing(), "dop853", **ask, **more) for more in ({"threads": 1}, {"threads": 2}, {"backend": "numpy"})
        ]
        for other in runs[1:]:
            for name in ("beta", "y"):
                assert runs[0].sensitivity[name].tobytes() == other.sensitivity[name].tobytes()
        alone = sw.integrate(duffing(), "dop853", **ask | {"y": y[7]})
        assert alone.sensitivity["beta"].tobytes() == runs[0].sensitivity["beta"][:, 7].tobytes()


@needs_device
@pytest.mark.parametrize(("method", "options"), [("rk4", FIXED), ("dop853", ADAPTIVE), ("rodas5p", ADAPTIVE)])
def test_a_device_makes_the_same(method: str, options: dict[str, Any]) -> None:
    ask: dict[str, Any] = {"v": 0.2, "y": np.linspace(0.5, 1.5, 50), "sensitivity": ["beta", "y"], **options}
    runs = [sw.integrate(duffing(), method, **ask, device=device) for device in (NAMES[0], "cpu")]
    for name in ("beta", "y"):
        assert runs[0].sensitivity[name].tobytes() == runs[1].sensitivity[name].tobytes()


def test_it_goes_with_other_options() -> None:
    more: dict[str, Any] = {"v": 0.2, "y": 1.0, "force": 0.1, "record": ["energy"]}
    pendulum = sw.Pendulum(1.5, 0.0)
    run = sw.integrate(pendulum, "rk4", **more, **FIXED, sensitivity="omega")
    plain = sw.integrate(pendulum, "rk4", **more, **FIXED)
    # Increments of built-in systems are written otherwise: some roundings in each of 40 steps.
    np.testing.assert_allclose(run.y, plain.y, rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.recorded["energy"], plain.recorded["energy"], rtol=1e-12)
    assert run.force is not None
    ends = [sw.integrate(sw.Pendulum(1.5 + h), "rk4", **more, **FIXED).y for h in (1e-5, -1e-5)]
    np.testing.assert_allclose(run.sensitivity["omega"], (ends[0] - ends[1]) / 2e-5, rtol=0, atol=1e-7)

    @sw.system(order=1, shape=(2,))
    def decay(t: Any, y: Any, *, k: Any = 3.0) -> Any:
        return np.array([-k * y[0], k * y[0] - y[1]])

    start: dict[str, Any] = {"y": np.array([1.0, 0.0]), "tolerance": 1e-8}
    each = sw.integrate(decay(), "dop853", **start, at=2.0, every=1, sensitivity=["k", "y"], positive=True, max_step=0.25)
    assert each.sensitivity["k"].shape == (len(each.t), 2)
    assert each.sensitivity["y"].shape == (len(each.t), 2, 2)
    # y₀ = e^(−kt), so that ∂y₀/∂k = −t·e^(−kt); and the first row of ∂y/∂y(0) is (e^(−kt), 0).
    np.testing.assert_allclose(each.sensitivity["k"][:, 0], -each.t * np.exp(-3.0 * each.t), rtol=0, atol=1e-7)
    np.testing.assert_allclose(each.sensitivity["y"][-1, 0], [np.exp(-6.0), 0.0], rtol=0, atol=1e-7)


def test_inputs_are_those_of_runs_without() -> None:
    @sw.system
    def driven(t: Any, v: Any, y: Any, *, a: Any = 0.0, k: Any = 2.0) -> Any:
        return a - k * y - 0.1 * v

    sine, samples = sw.Sinusoid(0.7, 1.3, 0.2), sw.Sampled(np.sin(0.1 * np.arange(99)), interval=0.05)
    for method, steps in (
        ("rk4", FIXED),
        ("implicit_midpoint", FIXED),
        ("rodas5p", ADAPTIVE),
        ("dop853", ADAPTIVE),
        ("taylor", ADAPTIVE),
    ):
        for given in (sine, samples):
            if given is samples and method == "taylor":
                continue
            ask: dict[str, Any] = {"v": 0.1, "y": 0.5, **steps}
            run = sw.integrate(driven(a=given), method, **ask, sensitivity="k")
            assert run.y.tobytes() == sw.integrate(driven(a=given), method, **ask).y.tobytes()
            ends = [sw.integrate(driven(a=given, k=2.0 + h), method, **ask).y for h in (1e-5, -1e-5)]
            np.testing.assert_allclose(run.sensitivity["k"], (ends[0] - ends[1]) / 2e-5, rtol=0, atol=1e-6)
            by_numpy = {"backend": "numpy", "sensitivity": "k", **ask}
            if given is samples:
                refused(
                    sw.StepwellError, "sensitivity: goes with sampled inputs", sw.integrate, driven(a=given), method, **by_numpy
                )
            else:
                assert (
                    sw.integrate(driven(a=given), method, **by_numpy).sensitivity["k"].tobytes() == run.sensitivity["k"].tobytes()
                )


def test_numbers_and_structures_are_apart() -> None:
    """What is differentiated once holds for other numbers, and for nothing else."""
    from stepwell.runs import sensitivities

    ask: dict[str, Any] = {"v": 0.2, "y": 1.0, "sensitivity": ["beta", "gains"], **FIXED}
    systems = [duffing(), duffing(beta=2.0), duffing(beta=np.array([1.0, 2.0])), duffing(gains=(0.1, 0.2)), duffing(beta=2.0)]
    runs = [sw.integrate(system, "rk4", **ask) for system in systems]
    for system, run in zip(systems, runs, strict=True):
        sensitivities._kept.clear()
        alone = sw.integrate(system, "rk4", **ask)
        assert run.system == alone.system
        for name in ("beta", "gains"):
            assert run.sensitivity[name].tobytes() == alone.sensitivity[name].tobytes()


def test_runs_go_on_are_selected_and_saved(tmp_path: Path) -> None:
    for method, options, more in (
        ("dop853", ADAPTIVE, {"at": [3.0]}),
        ("taylor", ADAPTIVE, {"at": [3.0]}),
        ("rk4", FIXED, {"steps": 9}),
    ):
        options = options | ({"max_step": 0.25} if options is ADAPTIVE else {})
        run = sw.integrate(duffing(), method, v=0.2, y=1.0, **options, sensitivity=["beta"])
        plain = sw.integrate(duffing(), method, v=0.2, y=1.0, **options)
        assert run.options == plain.options
        on, other = (sw.integrate(duffing(), method, resume=each, **more) for each in (run, plain))
        assert on.y.tobytes() == other.y.tobytes()
        assert not on.sensitivity
        last = run.select(-1)
        assert last.sensitivity["beta"].tobytes() == run.sensitivity["beta"][-1:].tobytes()
        run.save(tmp_path / "run.npz")
        assert sw.load(tmp_path / "run.npz", system=duffing()).sensitivity["beta"].tobytes() == run.sensitivity["beta"].tobytes()


def test_what_has_no_such_derivative_is_refused() -> None:
    before = sw.integrate(duffing(), "rk4", v=0.2, y=1.0, **FIXED)
    right: dict[str, Any] = {"system": duffing(), "method": "rk4", "v": 0.2, "y": 1.0, "sensitivity": ["beta"], **FIXED}
    bouncing = sw.Particles([1.0], dim=2, floor=sw.Floor())
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"sensitivity": ["betta"]}, "sensitivity: there is no 'betta'; did you mean 'beta'"),
        ({"sensitivity": ["beta", "beta"]}, "sensitivity: expected each name once, got 'beta' twice"),
        ({"sensitivity": 3}, "sensitivity: expected"),
        ({"events": lambda t, v, y: y}, "sensitivity: goes without events="),
        ({"fused": True}, "sensitivity: goes with float64 and without fused="),
        ({"dtype": "float32"}, "sensitivity: goes with float64"),
        ({"resume": before, "v": None, "y": None}, "sensitivity: goes without resume="),
        ({"system": sw.Oscillator(), "method": "exact", "sensitivity": ["omega"]}, "sensitivity: exact steps by matrices"),
        ({"system": sw.NBody([1.0, 1.0], dim=2), "v": np.zeros((2, 2)), "y": np.eye(2), "sensitivity": ["masses"]},
         "sensitivity: there is no 'masses'"),
        ({"system": bouncing, "v": np.zeros((1, 2)), "y": np.ones((1, 2)), "sensitivity": ["y"]},
         "sensitivity: what is around"),
    ]  # fmt: skip
    for more, message in wrong:
        refused(sw.StepwellError, message, sw.integrate, **right | more)
    refused(
        sw.StepwellError, "sensitivity: a world does not keep states", sw.World, duffing(), "rk4", dt=0.1, sensitivity=["beta"]
    )


@pytest.mark.mutant
def test_a_column_by_another_parameter_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    from stepwell.model.derivatives import columns

    right = columns.parameters_of
    monkeypatch.setattr(columns, "parameters_of", lambda system: dict.fromkeys(right(system), right(system)["delta"]))
    with pytest.raises(AssertionError):
        test_derivatives_are_those_of_runs_and_states_are_as_without("rk4", FIXED)
