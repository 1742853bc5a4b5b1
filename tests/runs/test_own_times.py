"""A time of step 0 for each member: its bits are those of a run alone that begins then."""

import copy
import functools
import itertools
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, ShapeError, UnsupportedError
from support.heard import quiet
from support.refusals import refused
from support.ways import assert_equal_ways


@sw.system
def swept(t: Any, v: Any, y: Any, *, k: Any = 1.0, drive: Any = 0.0) -> Any:
    return np.cos(0.7 * t) / (1.0 + 0.1 * t * t) + drive - k * np.sin(y)


#: A method of each kind of step.
KINDS = ("false_euler", "rk4", "leapfrog", "verlet", "dop853", "taylor", "trapezoidal", "rodas4")
BESIDE = ("by the reference", "at each level", "alone", "in company")


def test_one_time_is_a_list_of_one() -> None:
    one, other = (sw.integrate(sw.Pendulum(), "dop853", v=0.0, y=1.0, tolerance=1e-6, at=at) for at in (2.0, [2.0]))
    np.testing.assert_array_equal(one.y, other.y)
    assert one.t.tolist() == other.t.tolist() == [2.0]
    for wrong in (1, -2, "a", [0, 1]):
        with pytest.raises(ArgumentError, match="saved: expected an index of the 1 saved states, got "):
            one.select(wrong)


def test_two_axes_of_members_forward_and_back() -> None:
    begins = np.linspace(-3.0, 4.0, 70).reshape(7, 10)
    for method, dt in itertools.product(("rk4", "leapfrog", "taylor"), (0.1, -0.1)):
        start, y = {"v": 0.3, "dt": dt, "steps": 60}, np.linspace(0.5, 1.5, 10)
        run = sw.integrate(swept(), method, y=y, t0=begins, **start)
        assert run.y.shape == run.t.shape == (1, 7, 10)
        np.testing.assert_array_equal(run.t[0], begins + 60 * dt)
        alone = sw.integrate(swept(), method, y=y[7], t0=begins[3, 7], **start)
        np.testing.assert_array_equal((run.v[0, 3, 7], run.y[0, 3, 7]), (alone.v[0], alone.y[0]))


@pytest.mark.parametrize("method", KINDS)
def test_means_of_several_samples_within_a_step(method: str) -> None:
    """Which are others for each t0; samples are the same for all members, or of each; and a sinusoid."""
    rng = np.random.default_rng(5)
    common, own = sw.Sampled(rng.normal(size=140), 0.03, -1.3), sw.Sampled(rng.normal(size=(110, 5)), 0.04, -1.1)
    start = {"v": np.full(5, 0.3), "y": np.linspace(0.5, 1.5, 5), "t0": np.array([-1.0, 0.3, 2.013, -0.5, 1.0])}
    for system in (swept(k=own, drive=common), sw.Pendulum(1.5, a=own), sw.Oscillator(1.5, x=sw.Sinusoid(0.5, 1.3), a=common)):
        for fused in (False, True) if method in ("rk4", "leapfrog") else (False,):
            assert_equal_ways(system, method, ways=BESIDE, dt=0.1, steps=20, every=9, fused=fused, **start)


def falls(t: Any, v: Any, y: Any) -> Any:
    return y - 0.01 * t


EVENTS: dict[str, list[sw.Event]] = {
    "seen": [sw.Event(falls, name="low"), sw.Event(lambda t, v, y: t - 4.03, name="four")],
    "one stops": [sw.Event(falls, name="low"), sw.Event(lambda t, v, y: t - 4.0, name="four", terminal=True)],
    "both change": [
        sw.Event(falls, direction=-1, then=lambda t, v, y: (-0.9 * v, y), name="low"),
        sw.Event(lambda t, v, y: t - 4.0, then=lambda t, v, y: (v + 0.1 * t, y), name="four"),
    ],
}


@pytest.mark.parametrize("method", ["rk4", "leapfrog"])
@pytest.mark.parametrize("kind", EVENTS)
def test_events_are_at_the_times_of_their_members(kind: str, method: str) -> None:
    """Of many members the core notices changes of sign by itself, where it knows their times; of a system without time, too."""
    many = 16 if kind == "both change" else 200
    for system, members, every, backend in (
        (swept(), 3, None, "rust"), (swept(), 3, 7, "numpy"), (swept(), many, 7, "rust"), (sw.Pendulum(1.5), many, None, "rust"),
    ):  # fmt: skip
        begins, y = np.linspace(-2.0, 3.0, members), np.linspace(0.5, 1.5, members)
        start: dict[str, Any] = {"v": 0.3, "dt": 0.1, "steps": 70, "every": every, "events": EVENTS[kind], "backend": backend}
        run = sw.integrate(system, method, y=y, t0=begins, **start)
        for i in (0, members // 2, members - 1):
            alone = sw.integrate(system, method, y=y[i], t0=float(begins[i]), **start)
            assert len(alone.events["four"].t) == 1
            for name in ("low", "four"):
                np.testing.assert_array_equal(run.events[name].t[run.events[name].member == i], alone.events[name].t)
            np.testing.assert_array_equal(run.stopped_at if run.stopped_at is None else run.stopped_at[i], alone.stopped_at)
            np.testing.assert_array_equal((run.v[:, i], run.y[:, i]), (alone.v, alone.y))


def test_what_knows_no_time_is_only_told_other_times() -> None:
    scene = sw.scenes.figure_eight()
    begins = np.array([0.0, 5.0])
    wide = {"v": np.stack([scene.v] * 2, axis=-1), "y": np.stack([scene.y] * 2, axis=-1)}
    run = sw.integrate(scene.system, "leapfrog", t0=begins, dt=0.01, steps=100, every=50, **wide)
    one = sw.integrate(scene.system, "leapfrog", v=scene.v, y=scene.y, dt=0.01, steps=100, every=50)
    np.testing.assert_array_equal(run.y[..., 1], one.y)
    np.testing.assert_array_equal(run.t, one.t[:, np.newaxis] + begins)
    assert run.encounters == ()
    assert "t = 0 to 6" in repr(run)


def test_messages_name_the_time_of_the_member() -> None:
    late = sw.system(lambda t, v, y: -y + np.sqrt(10.0 - t))
    with pytest.warns(sw.DivergenceWarning, match=r"1 of 2 members diverged: member 1 at step 51 \(t = 10.1\), by rk4"):
        run = sw.integrate(late(), "rk4", v=0.0, y=1.0, t0=np.array([0.0, 5.0]), dt=0.1, steps=70)
    assert run.first_bad_step.tolist() == [-1, 51]
    with pytest.raises(ArgumentError, match=r"dt, t0: expected a time that moves on .* of member 1"):
        sw.integrate(late(), "rk4", v=0.0, y=1.0, t0=np.array([0.0, 1e300]), dt=0.1, steps=3)
    refused(ShapeError, "t0", sw.integrate, late(), "rk4", v=0.0, y=np.ones(3), t0=np.zeros(2), dt=0.1, steps=3)
    with pytest.raises(ArgumentError, match="t0: expected finite numbers"):
        sw.integrate(late(), "rk4", v=0.0, y=1.0, t0=np.array([0.0, np.nan]), dt=0.1, steps=3)
    with pytest.raises(UnsupportedError, match="t0: an array works with float64 only"):
        sw.integrate(late(), "rk4", v=0.0, y=1.0, t0=np.zeros(2), dt=0.1, steps=3, dtype="float32")
    free = sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, t0=np.arange(2.0), dt=0.1, steps=3, dtype="float32")
    np.testing.assert_array_equal(free.t[0], np.arange(2.0) + 3 * float(np.float32(0.1)))


@sw.system
def many(t: Any, v: Any, y: Any) -> Any:
    return np.sin(t + np.arange(300.0)) - y * np.sqrt(1.0 + y * y) + np.roll(y, 1)


def test_long_steps() -> None:
    """300 coordinates, each driven at its own phase: nearly as many operations as one tape has."""
    v, y = np.random.default_rng(3).normal(size=(2, 300, 6))
    assert_equal_ways(many(), "rk4", ways=("alone",), v=v, y=y, t0=np.linspace(0.0, 3.0, 6), dt=0.05, steps=5)


def test_a_step_too_long_for_one_tape_is_refused() -> None:
    """Its rates are computed at one time for all members, t + c·h, where each t0 + k·h must be rounded first."""
    large = sw.LinearSystem(-np.eye(200), np.ones((200, 1)), x=sw.Sinusoid(1.0, 1.3))
    with pytest.raises(UnsupportedError, match=r"t0: a step of about .* operations is too long for times of its members' own"):
        sw.integrate(large, "dop853", v=0.0, y=np.ones((100, 2)), t0=np.arange(2.0), dt=0.05, steps=5)


@sw.system
def driven(t: Any, v: Any, y: Any) -> Any:
    return np.cos(0.7 * t) - np.sin(y)


@driven.invariant
def energy(v: Any, y: Any) -> Any:
    return 0.5 * v * v - np.cos(y)


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_zeros_of_times_have_one_sign(backend: Any) -> None:
    """At −0 and steps back t0 + 0·dt would be −0 alone, and 0 where the clock is 0: 1/t tells them apart."""
    pole = sw.system(lambda t, v, y: np.where(1.0 / t > 0.0, 1.0, -1.0) + 0.0 * y)
    start: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": -0.1, "steps": 1, "backend": backend}
    run = sw.integrate(pole(), "standard_euler", t0=np.array([-0.0, 0.0]), **start)
    for i, begin in enumerate((-0.0, 0.0)):
        assert run.v[0, i] == sw.integrate(pole(), "standard_euler", t0=begin, **start).v[0] == -0.1


def test_a_run_keeps_times_of_its_own() -> None:
    begins = np.array([0.0, 1.0])
    run = sw.integrate(swept(), "rk4", v=0.3, y=1.0, t0=begins, dt=-0.1, steps=4, every=2)
    begins[:] = 7.0
    assert run.t0.tolist() == [0.0, 1.0]
    assert "t = 1 to -0.4" in repr(run)
    adaptive = sw.integrate(swept(), "dop853", v=0.3, y=1.0, t0=run.t0, at=np.array([[1.0, 2.0], [3.0, 5.0]]), tolerance=1e-8)
    assert "t = 0 to 5" in repr(adaptive)


def test_outputs_and_limits_along_a_run_are_at_the_times_of_their_members() -> None:
    begins = np.array([0.0, 1.0])
    start: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": 0.1, "steps": 20, "every": 1}
    run, nonlinear = (sw.integrate(system, "rk4", t0=begins, **start) for system in (MASS, swept()))
    for i, begin in enumerate(begins):
        np.testing.assert_array_equal(run.z[..., i], sw.integrate(MASS, "rk4", t0=begin, **start).z)
        alone = sw.stability_along(sw.integrate(swept(), "rk4", t0=begin, **start))
        assert sw.stability_along(nonlinear).when[i] == alone.when
    with pytest.raises(UnsupportedError, match="at: expected a run whose members have their times in common"):
        sw.analyse(swept(), "rk4", dt=0.1, at=nonlinear)
    back = sw.integrate(swept(), "rk4", **start | {"dt": -0.1})
    for judged in (sw.stability_along, lambda run: sw.analyse(swept(), "rk4", dt=0.1, at=run)):
        refused(UnsupportedError, r"run: expected steps forward in time, got dt = -0.1", judged, back)


def bodies(method: str, **options: Any) -> sw.Run:
    scene = sw.scenes.figure_eight()
    wide = {"v": np.stack([scene.v] * 2, axis=-1), "y": np.stack([scene.y] * 2, axis=-1)}
    return sw.integrate(scene.system, method, **wide, **options)


BEGINS, AT = np.array([0.0, 5.0]), np.array([[1.0, 7.0], [8.0, 9.0]])
FIXED: dict[str, Any] = {"v": 0.3, "y": 1.0, "t0": BEGINS, "dt": 0.1, "steps": 20, "every": 5}
ADAPTIVE: dict[str, Any] = {"v": 0.3, "y": 1.0, "tolerance": 1e-8}
MASS = sw.LinearSystem([[-0.2, -4.0], [1.0, 0.0]], B=[1.0, 0.0], C=[0.2, 4.0], D=1.0, x=sw.Sinusoid(1.0, 2.0), velocities=1)

#: Runs whose members begin, or are saved, at times of their own.
OF_OWN_TIMES: dict[str, Callable[[], sw.Run]] = {
    "t0": lambda: sw.integrate(driven(), "rk4", **FIXED),
    "t0 of one member": lambda: sw.integrate(driven(), "rk4", **FIXED | {"t0": BEGINS[1:]}),
    "t0 of rows": lambda: sw.integrate(driven(), "rk4", **FIXED | {"t0": BEGINS[:, np.newaxis], "y": np.ones((2, 3))}),
    "t0, recorded": lambda: sw.integrate(driven(), "verlet", **FIXED, record="energy"),
    "t0, events": lambda: sw.integrate(driven(), "rk4", **FIXED, events=sw.Event(lambda t, v, y: y - 0.5, name="half")),
    "t0, bodies": lambda: bodies("leapfrog", t0=BEGINS, dt=0.01, steps=20),
    "t0, outputs": lambda: sw.integrate(MASS, "rk4", **FIXED),
    "t0, tolerance": lambda: sw.integrate(driven(), "dop853", t0=BEGINS, at=[6.0, 8.0], **ADAPTIVE),
    "at": lambda: sw.integrate(driven(), "dop853", at=AT, **ADAPTIVE),
    "t0 and at": lambda: sw.integrate(driven(), "dop853", t0=BEGINS, at=AT, **ADAPTIVE),
    "at of columns": lambda: sw.integrate(driven(), "dop853", at=AT, **ADAPTIVE | {"y": np.ones((3, 2))}),
    "at of rows": lambda: sw.integrate(driven(), "dop853", at=AT[..., np.newaxis], **ADAPTIVE | {"y": np.ones((2, 3))}),
    "at, events": lambda: sw.integrate(driven(), "dop853", at=AT, events=sw.Event(lambda t, v, y: y, name="zero"), **ADAPTIVE),
    "at, stopped": lambda: quiet(sw.integrate, driven(), "dop853", at=AT, max_steps=3, **ADAPTIVE),
    "at, bodies": lambda: bodies("dop853", at=0.1 * AT, tolerance=1e-8),
    "at, outputs": lambda: sw.integrate(MASS, "dop853", t0=BEGINS, at=AT, **ADAPTIVE),
}


def _goes_on(run: sw.Run) -> sw.Run:
    options: dict[str, Any] = {"steps": 5} if run.paces is None else {"at": run.t[-1:] + 3.0}
    return quiet(sw.integrate, run.system, run.method.name, **options, resume=run)


def _saved(run: sw.Run, folder: Path, ending: str) -> None:
    run.save(folder / f"run{ending}")
    back = sw.load(folder / f"run{ending}", system=None if "own" not in type(run.system).__module__ else driven)
    assert back == run
    assert repr(back) == repr(run)
    assert _goes_on(back).y.tobytes() == _goes_on(run).y.tobytes()


def _xarray(run: sw.Run, _: Path) -> None:
    pytest.importorskip("xarray")
    table = run.to_xarray()
    assert table.y.shape == run.y.shape
    if run.t.ndim > 1:
        np.testing.assert_array_equal(table.time, run.t)


def _dataframe(run: sw.Run, _: Path) -> None:
    pytest.importorskip("pandas")
    frame = run.to_dataframe()
    assert len(frame) == run.status.size * len(run.t)
    if run.t.ndim > 1:
        np.testing.assert_array_equal(frame["time"].to_numpy().reshape(run.t.shape), run.t)


def _of_each_time(run: sw.Run, _: Path) -> None:
    """Times and states have the same saved states and members, or all members have one time."""
    assert run.t.shape in (run.y.shape[:1], (len(run.y), *run.status.shape))
    assert np.shape(run.t0) in ((), run.status.shape)


def _along(run: sw.Run, _: Path) -> None:
    assert np.shape(sw.stability_along(run).when) == run.status.shape


#: All that is done with a run, and the words in which it refuses one of own times, if it does.
USES: dict[str, tuple[Callable[[sw.Run, Path], Any], str]] = {
    "shapes": (_of_each_time, ""),
    "repr": (lambda run, _: repr(run), ""),
    "_repr_html_": (lambda run, _: run._repr_html_(), ""),
    "save npz": (lambda run, folder: _saved(run, folder, ".npz"), ""),
    "save zarr": (lambda run, folder: pytest.importorskip("zarr") and _saved(run, folder, ".zarr"), ""),
    "resume": (lambda run, _: _goes_on(run), ""),
    "pickle": (lambda run, _: pickle.loads(pickle.dumps(_told(run))), ""),
    "copy": (lambda run, _: copy.deepcopy(run), ""),
    "to_xarray": (_xarray, ""),
    "to_dataframe": (_dataframe, ""),
    "plot": (lambda run, _: run.plot(), "run: expected a run of one member, got a batch of shape"),
    "animate": (lambda run, folder: run.animate(folder / "a.html"), "run: expected a run of one member, got a batch of shape"),
    "quantity": (lambda run, _: run.quantity("energy"), "has no energy of its own"),
    "energy": (lambda run, _: run.energy, "has no energy of its own"),
    "dtype": (lambda run, _: run.dtype, ""),
    "changed_by": (lambda run, _: run.changed_by, ""),
    "z": (lambda run, _: run.z, "has no auxiliary outputs"),
    "findings": (lambda run, _: run.findings, ""),
    "select": (lambda run, _: np.testing.assert_array_equal(run.select(-1).y, run.y[-1:]), ""),
    "is_part": (lambda run, _: run.select(slice(0, 0)).is_part or pytest.fail("a part of a run says so"), ""),
    "collisions": (lambda run, _: run.collisions, "has no bodies that collide|expected a run with fixed steps"),
    "encounters": (lambda run, _: run.encounters, "has no bodies that meet|expected a run with fixed steps"),
    "stability_along": (_along, ""),
    "analyse": (
        lambda run, _: sw.analyse(run.system, "rk4", dt=0.1, at=run),
        "at: expected a run whose members have their times in common",
    ),
    "run_picture": (
        lambda run, _: sw.charts.run_picture(sw.scenes.figure_eight(), run),
        "run: expected one member with states of shape|run: expected a run of the scene",
    ),
    "has_each_step": (lambda run, _: run(run.t[0, 0]) if run.has_each_step else None, "t: .* within the run|not known after"),
    "state_error": (lambda run, _: sw.scenes.figure_eight().state_error(run), "run: expected a run of the scene"),
}


def _told(run: sw.Run) -> dict[str, Any]:
    return {name: getattr(run, name) for name in ("t", "v", "y", "t0")}


@functools.cache
def run_of(which: str) -> sw.Run:
    """The run of that name, which no use changes."""
    return OF_OWN_TIMES[which]()


@pytest.mark.parametrize("use", USES)
def test_a_run_of_own_times_is_used_or_refused_in_words(use: str, tmp_path: Path) -> None:
    function, refusal = USES[use]
    for which in OF_OWN_TIMES:
        folder, words = tmp_path / which, ""
        folder.mkdir()
        try:
            function(run_of(which), folder)
        except sw.StepwellError as error:
            words = str(error)
        assert not words or (refusal and re.search(refusal, words)), f"{which}: {words}"


def test_every_public_name_of_a_run_is_tried() -> None:
    public = {name for name in vars(sw.Run) if not name.startswith("_") or name in ("__repr__", "_repr_html_")}
    tried = {use.partition(" ")[0] for use in USES} | {"__repr__"}
    assert public <= tried, public - tried


def test_what_is_wrong_with_times_is_said_of_their_member() -> None:
    """The first of them, by its index."""
    wrong: list[tuple[dict[str, Any], Any, str]] = [
        ({"y": np.ones(3), "at": np.ones((2, 5))}, ShapeError, r"do not broadcast to one: y \(3,\), at \(5,\)"),
        ({"t0": np.zeros(3), "at": np.ones((2, 5))}, ShapeError, r"do not broadcast to one: t0 \(3,\), at \(5,\)"),
        ({"t0": np.zeros((3, 2)), "at": np.ones((1, 3, 3))}, ShapeError, r"t0 \(3, 2\), at \(3, 3\)"),
        ({"at": np.ones((2, 0))}, ShapeError, r"at: expected times along the first axis, got shape \(2, 0\)"),
        ({"at": [[1.0, 3.0], [2.0, 2.5]]}, ArgumentError, r"ascend from t0 = 0 on, got \[3.0, 2.5\] of member 1$"),
        ({"at": [[-1.0, -2.0], [-3.0, -1.5]]}, ArgumentError, r"descend from t0 = 0 on, got \[-2.0, -1.5\] of member 1$"),
        ({"t0": [0.0, 2.0, 5.0], "at": [3.0, 4.0]}, ArgumentError, r"some of each"),
        ({"t0": [0.0, 2.0, 3.5], "at": [3.0, 4.0]}, ArgumentError, r"ascend from t0 = 3.5 on, got \[3.0, 4.0\] of member 2$"),
        (
            {"t0": [0.0, 5.0], "at": [[6.0, 4.0], [7.0, 8.0]], "y": np.ones((3, 2))},
            ArgumentError,
            r"ascend from t0 = 5 on, got \[4.0, 8.0\] of member \(0, 1\)$",
        ),
        ({"at": [2.0, 1.0], "y": np.ones(3)}, ArgumentError, r"ascend from t0 = 0 on, got \[2.0, 1.0\]$"),
    ]
    for options, kind, message in wrong:
        refused(kind, message, sw.integrate, swept(), "dop853", **ADAPTIVE | options)


def test_a_run_that_goes_on_says_which_member_was_further() -> None:
    half = sw.integrate(swept(), "dop853", at=AT, **ADAPTIVE)
    with pytest.raises(ArgumentError, match=r"from the last time of the run that goes on, 9, on, got \[8.5\] of member 1$"):
        sw.integrate(swept(), "dop853", at=[[9.0, 8.5]], resume=half)


def test_times_over_some_axes_are_those_of_each_member() -> None:
    """``at`` and ``t0`` that broadcast are the same run as those of the whole batch, and are arrays of the run's own."""
    at, begins, y = AT[..., np.newaxis].copy(), BEGINS[:, np.newaxis].copy(), np.linspace(0.5, 1.5, 3)
    run = sw.integrate(swept(), "dop853", t0=begins, at=at, **ADAPTIVE | {"y": y})
    whole = {"t0": np.repeat(begins, 3, 1), "at": np.repeat(at, 3, 2), "y": np.broadcast_to(y, (2, 3))}
    assert run == sw.integrate(swept(), "dop853", **ADAPTIVE | whole)
    begins[:] = at[:] = 7.0
    assert run.t0[1].tolist() == [5.0] * 3
    assert run.t[:, 1, 2].tolist() == [7.0, 9.0]


def test_exponents_say_what_times_they_take() -> None:
    with pytest.raises(ShapeError, match=r"at: expected times along one axis, the same for all members, got shape \(2, 2\)"):
        sw.lyapunov(swept(), "dop853", at=AT, **ADAPTIVE)
