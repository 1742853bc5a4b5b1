"""Exported steps in float32: the bits of ``integrate(dtype="float32")`` in every language."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.views import cli
from support.abroad import Journey, run
from support.export import LANGUAGES, assert_same, languages, shown

F = np.float32
BODIES: dict[str, Any] = {"v": np.array([[0.0, 0.5], [0.0, -0.5]]), "y": np.array([[1.0, 0.1], [-1.0, 0.0]])}


@sw.system
def chosen(t: Any, v: Any, y: Any, *, a: Any = 0.3) -> Any:
    """Functions of float32, a choice, and operations on bits."""
    return np.where(y < a, -np.sin(y), np.exp(-a * y) * np.cos(t)) - 0.1 * v * np.abs(v) + np.log(1.0 + y * y)


def journey(system: sw.System, method: str, v: Any = 0.3, y: Any = 1.1, steps: int = 30, **options: Any) -> Journey:
    return Journey(system, method, v, y, steps=steps, options={"dtype": "float32", **options})


def journeys() -> list[Journey]:
    """Every kind of rates and of methods: what carries something, controls, inputs, what diverges, what is changed."""
    rng = np.random.default_rng(5)
    drive = {"a": sw.Sinusoid(1.0, 2.0, 0.3)}
    masses = sw.LinearSystem([[-0.1, 0.0, -1.0, 0.0], [0.0, -0.2, 0.0, -2.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    every = [
        journey(sw.Oscillator(1.3, 0.1, **drive, form="physical"), "rk4"),
        journey(sw.Pendulum(1.1, 0.2, **drive), "merson"),
        journey(sw.Pendulum(1.1), "verlet", start="second_order"),
        journey(sw.Oscillator(0.7), "leapfrog"),
        journey(sw.Chain(4), "semi_false_heun", rng.normal(size=4), rng.normal(size=4)),
        journey(masses, "fehlberg", rng.normal(size=2), rng.normal(size=2)),
        journey(sw.NBody([1.0, 2.0], force="newton"), "pefrl", **BODIES),
        journey(sw.NBody([1.0, 2.0]), "rk4", **BODIES, control=sw.EnergyControl(0.3)),
        journey(sw.NBody([1.0, 2.0]), "false_heun", **BODIES, control=sw.Projection()),
        journey(chosen(), "standard_heun"),
        journey(sw.Oscillator(50.0), "rk4", 0.0, 1.0, steps=40),
        journey(sw.NBody([1.0, 1.0]), "damped_euler", np.zeros((2, 2)), np.zeros((2, 2)), steps=3),
        # The smallest numbers, which have fewer digits.
        journey(sw.Pendulum(1.0), "false_euler", 1e-42, 3e-41),
    ]
    every.append(
        Journey(
            sw.Pendulum(1.0, 0.1, **drive),
            "standard_euler",
            0.5,
            1.0,
            options={"dtype": "float32"},
            changed={"omega": 1.3, "damping": 0.4, "a_amplitude": 0.3},
            twin=sw.Pendulum(1.3, 0.4, a=sw.Sinusoid(0.3, 2.0, 0.3)),
        )
    )
    return every


@languages
def test_every_bit_is_that_of_integrate(language: str, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        warnings.simplefilter("ignore", sw.ControlWarning)
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        every = journeys()
    # All are numbers of float32 but what controls added up, which is told in float64; and those of float64 are others.
    assert all(float(F(x)) == x or x != x for each in every for x in each.expected[: None if not each.works else -1])
    wide = [Journey(e.system, e.method, e.v, e.y, 30, options=e.options | {"dtype": "float64"}) for e in every[:10]]
    assert not any(a.expected == b.expected for a, b in zip(every, wide, strict=False))
    assert any(math.isnan(x) for each in every for x in each.expected)
    assert any(0.0 < abs(x) < 2.0**-126 for each in every for x in each.expected)
    assert_same(every, run(language, every, tmp_path))


@pytest.mark.mutant
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_a_step_that_rounds_less_is_noticed(tmp_path: Path) -> None:
    """The same text with numbers of float64 in their place is another step."""
    each = journey(sw.Pendulum(1.1), "rk4")
    source = each.export("python", "step_0").source
    assert_same([each], run("python", [each], tmp_path, [source]))
    wrong = source.replace("numpy.float32", "numpy.float64").replace("uint32", "uint64")
    assert each.expected != run("python", [each], tmp_path, [wrong])[0]


@languages
def test_every_bit_of_fused_steps(language: str, tmp_path: Path) -> None:
    if language in ("javascript", "python"):
        with pytest.raises(UnsupportedError, match=r"fused: (JavaScript|Python) has no fused multiply-add"):
            sw.export(sw.Oscillator(), "rk4", language, fused=True, dtype="float32")  # type: ignore[arg-type]
        return
    every = [
        journey(sw.Oscillator(1.3, 0.1, form="physical"), "rk4", fused=True),
        journey(sw.Pendulum(1.1), "verlet", fused=True),
        journey(sw.NBody([1.0, 2.0], force="newton"), "leapfrog", **BODIES, fused=True),
        journey(chosen(), "merson", fused=True),
    ]
    plain = [replace(each, options=each.options | {"fused": False}) for each in every]
    assert all(a.expected != b.expected for a, b in zip(every, plain, strict=True))
    assert_same(every, run(language, every, tmp_path))


@languages
def test_the_example_prints_what_integrate_gives(language: str, tmp_path: Path) -> None:
    step = sw.export(sw.Pendulum(1.1), "rk4", language, dt=0.02, t0=0.3, v=0.1, y=0.7, dtype="float32")  # type: ignore[arg-type]
    run = sw.integrate(sw.Pendulum(1.1), "rk4", v=0.1, y=0.7, dt=0.02, t0=0.3, steps=1000, dtype="float32")
    assert F(shown(step, tmp_path)) == run.y[-1]


def test_what_a_file_says() -> None:
    for language in LANGUAGES:
        step = sw.export(sw.Oscillator(0.1), "rk4", language, dt=0.1, t0=0.1, dtype=F)  # type: ignore[arg-type]
        assert step.dtype == "float32"
        assert 'integrate(..., dtype="float32"), to the last bit' in step.source
        assert repr(step).endswith("operations, float32>")
        assert "t0 = 0.1" in step.source.replace(":", " =")  # the time is computed in float64
        assert step.as_dict()["dtype"] == "float32"
    source = sw.export(sw.Oscillator(0.1), "rk4", "c", dt=0.1, dtype="float32").source
    assert "m->omega = 0.1f;" in source
    assert "0.16666667f" in source


def test_what_does_not_go_is_refused() -> None:
    sampled = sw.Oscillator(a=sw.Sampled([1.0, 2.0], 1.0))
    for system, method, options, error, message in (
        (sampled, "rk4", {}, UnsupportedError, "dtype: an exported step has numbers of one width"),
        (sw.Oscillator(), "taylor", {}, UnsupportedError, "dtype: float32 does not go with taylor"),
        (sw.Oscillator(), "rk4", {"y": 1e39}, ArgumentError, "y: expected numbers up to 3.4e38"),
        (
            sw.Oscillator(),
            "rk4",
            {"dt": 1e-50},
            ArgumentError,
            "dt: expected a number of size 1.4e-45 to 3.4e38 units of time in float32",
        ),
    ):
        with pytest.raises(error, match=message):
            sw.export(system, method, "c", dtype="float32", **options)  # type: ignore[arg-type]


def test_the_command(capsys: Any) -> None:
    assert cli.main(["export", "pendulum", "--method", "leapfrog", "--language", "c", "--float32"]) == 0
    assert "const float" in capsys.readouterr().out
