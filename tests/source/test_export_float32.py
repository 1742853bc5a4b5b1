"""What only exported steps in float32 have; test_export.py and test_export_files.py run them beside those in float64."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.views import cli
from support.abroad import Journey, run
from support.export import LANGUAGES, assert_same
from support.export_float32 import single, singles

F = np.float32


@pytest.mark.filterwarnings(
    "ignore::stepwell.DivergenceWarning", "ignore::stepwell.ControlWarning", "ignore::stepwell.AccuracyWarning"
)
def test_the_steps_that_are_exported_have_something_of_everything() -> None:
    """What test_export.py runs in every language: NaN and the smallest numbers, and never the bits of float64."""
    every = singles()
    # All are numbers of float32 but what controls added up, which is told in float64; and those of float64 are others.
    assert all(float(F(x)) == x or x != x for each in every for x in each.expected[: None if not each.works else -1])
    wide = [Journey(e.system, e.method, e.v, e.y, 30, options=e.options | {"dtype": "float64"}) for e in every[:10]]
    assert not any(a.expected == b.expected for a, b in zip(every, wide, strict=False))
    assert any(math.isnan(x) for each in every for x in each.expected)
    assert any(0.0 < abs(x) < 2.0**-126 for each in every for x in each.expected)


@pytest.mark.mutant
@pytest.mark.filterwarnings("ignore::stepwell.DivergenceWarning")
def test_a_step_that_rounds_less_is_noticed(tmp_path: Path) -> None:
    """The same text with numbers of float64 in their place is another step."""
    each = single(sw.Pendulum(1.1), "rk4")
    source = each.export("python", "step_0").source
    assert_same([each], run("python", [each], tmp_path, [source]))
    wrong = source.replace("numpy.float32", "numpy.float64").replace("uint32", "uint64")
    assert each.expected != run("python", [each], tmp_path, [wrong])[0]


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
    for language in ("csharp", "javascript", "python"):
        with pytest.raises(UnsupportedError, match=r"fused: (C#|JavaScript|Python) has no fused multiply-add"):
            sw.export(sw.Oscillator(), "rk4", language, fused=True, dtype="float32")  # type: ignore[arg-type]
    sampled = sw.Oscillator(a=sw.Sampled([1.0, 2.0], 1.0))
    for system, method, options, error, message in (
        (sampled, "rk4", {}, UnsupportedError, "dtype: an exported step has numbers of one width"),
        (sw.Oscillator(), "taylor", {}, UnsupportedError, "dtype: float32 does not work with taylor"),
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
