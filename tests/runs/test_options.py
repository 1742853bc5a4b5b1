"""The table of options: what it says of each is what users see, in signatures, documentation, and refusals."""

import inspect
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs.options import OPTIONS
from stepwell.runs.options.option import No

START = {"v": 0.0, "y": 1.0}
FIXED, ADAPTIVE = {"dt": 0.1, "steps": 2}, {"tolerance": 1e-6, "at": [1.0]}
#: Something that is not the default, of each option that does not go with every run.
SOMETHING: dict[str, Any] = {
    "steps": 3, "every": 1, "tolerance": 1e-6, "at": [1.0], "record": "energy", "form": "matrix", "start": "first_order",
    "max_steps": 9, "max_step": 0.1, "jumps": [0.5], "positive": True, "progress": True, "threads": 2, "backend": "numpy",
    "start_step": 1, "sensitivity": "y", "resume": sw.integrate(sw.Oscillator(), "rk4", **START, **FIXED),
}  # fmt: skip
REFUSED = [(name, way) for name, option in OPTIONS.items() for way, no in option.ways.items() if isinstance(no, No)]


def called(way: str, **options: Any) -> Any:
    """A run of that way with some options."""
    oscillator, axes = sw.Oscillator(), {"y": ("y", [1.0, 2.0])}
    match way:
        case "fixed":
            return sw.integrate(oscillator, "rk4", **START | FIXED | options)
        case "adaptive":
            return sw.integrate(oscillator, "dop853", **START | ADAPTIVE | options)
        case "World":
            return sw.World(oscillator, "rk4", **{"v": np.zeros(()), "y": np.ones(()), "dt": 0.1} | options)
    pytest.importorskip("xarray")
    return sw.sweep(sw.Oscillator, axes, "rk4", **{"v": 0.0} | FIXED | options)


@pytest.mark.parametrize(("name", "way"), REFUSED)
def test_what_an_option_does_not_go_with_is_refused_for_its_reason(name: str, way: str) -> None:
    called(way)
    no = OPTIONS[name].ways[way]  # type: ignore[index]
    assert isinstance(no, No)
    with pytest.raises(sw.StepwellError) as refused:
        called(way, **{name: SOMETHING[name]})
    because = "and tolerance= or at= was given"
    assert f"{name}: {no.why.format(adaptive=because)}" == str(refused.value)


def test_signatures_and_documentation_are_of_the_table() -> None:
    for function, way in ((sw.integrate, None), (sw.World, "World"), (sw.sweep, "sweep")):
        parameters, text = inspect.signature(function).parameters, inspect.getdoc(function) or ""
        for name, option in OPTIONS.items():
            said = option.text_of(way)  # type: ignore[arg-type]
            assert (name in parameters) == (said is not None), (function, name)
            assert (f"\n    {name}: " in text) == (said is not None), (function, name)
            if said is not None:
                assert " ".join(said.split()) in " ".join(text.split())
        assert "**options" not in text
        assert not any(each.kind is each.VAR_KEYWORD for each in parameters.values())


def test_a_name_that_is_none_is_corrected() -> None:
    with pytest.raises(TypeError, match=r"prepare.. got an unexpected keyword argument 'step'; did you mean 'steps'"):
        sw.prepare(sw.Oscillator(), "rk4", **START, dt=0.1, step=5)  # type: ignore[call-arg]
    for way in ("fixed", "World", "sweep"):
        with pytest.raises(TypeError, match=r"got an unexpected keyword argument 'forse'; did you mean 'force'\?"):
            called(way, forse=1.0)
        with pytest.raises(sw.StepwellError, match=r"y0: \w+ has no such argument; the state at the start is y="):
            called(way, y0=1.0)


@pytest.mark.parametrize("name", [name for name, option in OPTIONS.items() if option.batch is not None])
def test_a_sweep_takes_an_option_for_all_members(name: str) -> None:
    """One for each member would be one for each member of a chunk."""
    own = {"jumps": np.ones((1, 2)), "at": np.ones((1, 2)), "control": sw.EnergyControl([0.1, 0.2])}
    options = {name: own.get(name, np.array([0.1, 0.2]))}
    if name not in ("dt", "force", "control", "t0"):
        options = {"steps": None, "dt": None, **ADAPTIVE} | options
    if name in ("v", "y"):
        return  # a block of components
    with pytest.raises(sw.StepwellError, match=f"^{name}: |^axes: "):
        called("sweep", **options)


def test_what_goes_on_does_not_change_with_the_users_arrays() -> None:
    jumps = np.array([1.5])
    run = sw.integrate(sw.Oscillator(), "dop853", **START, **ADAPTIVE, jumps=jumps, max_step=0.25)
    jumps[:] = 1.75
    assert run.options == {"max_step": 0.25, "jumps": np.array([1.5])}
    with pytest.raises(sw.StepwellError):
        run.options["max_step"] = 1.0
