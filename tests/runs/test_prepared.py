"""A prepared run is that of ``integrate``, to the bit, with its errors and warnings; and ``integrate`` itself prepares."""

import copy
import gc
import itertools
import math
import pickle
import re
import threading
import warnings
import weakref
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs import short_runs as module
from support.cases import SYSTEMS, number
from support.families import family
from support.heard import heard
from support.looped import looped
from support.own_systems import duffing, lorenz, lotka_volterra, pendulum, top
from support.refusals import refused

OPTIONS: list[dict[str, Any]] = [
    {}, {"every": 1}, {"every": 7}, {"dtype": "float32"}, {"fused": True}, {"t0": 3.0, "start_step": 5, "every": 3},
    {"record": "energy", "every": 2}, {"form": "matrix"}, {"backend": "numpy"}, {"threads": 2}, {"dt": -0.05},
]  # fmt: skip
DT = {"dt": 0.05, "steps": 20}


@pytest.fixture(autouse=True)
def nothing_recent() -> None:
    """No test knows the runs of another."""
    module._kept.clear()


def assert_same(run: sw.Run, other: sw.Run) -> None:
    """All attributes are equal, arrays to the bit."""
    assert vars(run).keys() == vars(other).keys()
    for name, value in vars(run).items():
        of_other = vars(other)[name]
        if isinstance(value, np.ndarray):
            assert (value.dtype, value.shape, value.tobytes()) == (of_other.dtype, of_other.shape, of_other.tobytes()), name
        elif name == "recorded":
            assert {key: each.tobytes() for key, each in value.items()} == {key: each.tobytes() for key, each in of_other.items()}
        elif not callable(value):
            assert value == of_other, name
    assert run.findings == other.findings


def whole(*arguments: Any, **options: Any) -> sw.Run:
    """What ``integrate`` makes without anything that it kept."""
    module._kept.clear()
    return sw.integrate(*arguments, **options)


def with_warnings(call: Any) -> tuple[sw.Run, list[str]]:
    """The run and what was warned of, with the file of the line."""
    run, caught = heard(lambda: call())  # so that the line is one of this file
    return run, [f"{each.filename} {each.category.__name__} {each.message}" for each in caught]


def in_threads(work: Any, number: int = 8) -> None:
    """``work(i)`` in so many threads at once; what one of them raises is raised."""
    with ThreadPoolExecutor(number) as pool:
        list(pool.map(work, range(number)))


#: Methods of each kind of step: explicit, with a carry of each sort, with an estimate, a series, implicit, and exact.
KINDS = ("false_euler", "rk4", "verlet", "leapfrog", "dop853", "taylor", "rodas4", "trapezoidal", "wisdom_holman", "exact")


@pytest.mark.parametrize("method", KINDS)
def test_it_makes_the_run_of_integrate(method: str) -> None:
    """With each option, for one member and for many."""
    starts = ((0.1, 1.0), (0.3, -2.0), (0.0, 0.0))
    for options in OPTIONS:
        for system in (sw.Oscillator(1.3), sw.Oscillator(np.linspace(0.5, 2.0, 37)), sw.Pendulum(2.0), duffing(beta=np.ones(3))):
            arguments = {**DT, **options}
            try:
                expected = [whole(system, method, v=v, y=y, **arguments) for v, y in starts]
            except sw.StepwellError as error:
                refused(type(error), re.escape(str(error)), sw.prepare, system, method, v=0.1, y=1.0, **arguments)
                continue
            run = sw.prepare(system, method, v=0.1, y=1.0, **arguments)
            long = {"record", "form", "backend"} & options.keys() or sw.method(method).is_exact
            assert (run._short is None) == bool(long), (system, options)
            for start, other in zip(starts, expected, strict=True):
                assert_same(run(*start), other)


ORBIT: dict[str, Any] = {"tolerance": 1e-6, "at": [0.5, 3.0]}


ADAPTIVE: list[dict[str, Any]] = [
    {}, {"at": [2.0]}, {"at": np.linspace(0.0, 3.0, 7)}, {"at": [-1.0, -3.0]}, {"tolerance": (1e-6, 1e-9)},
    {"t0": 3.0, "at": [5.0]},
    {"tolerance": (1e-6, 5.0)}, {"tolerance": 0.3}, {"dt": 0.1, "at": [0.5, 3.0]}, {"max_step": 0.05}, {"jumps": [0.3, 0.7]},
    {"fused": True}, {"max_steps": 5}, {"threads": 2},
]  # fmt: skip
FIGURE_EIGHT = sw.scenes.scene("figure_eight")
STARTS: list[Any] = [
    (sw.Oscillator(1.3), [(0.1, 1.0), (0.0, 0.0), (3.0, -1e-300)]),
    (sw.Oscillator(np.linspace(1.0, 2.0, 3)), [(0.0, np.ones(3)), (1.0, np.arange(3.0))]),
    (sw.Oscillator(2.0, damping=0.1), [(0.0, 1.0), (1.0, 1.0)]),
    (sw.Pendulum(2.0), [(0.0, 1.0), (0.0, 3.1), (4.1, 0.0)]),
    (sw.RestrictedThreeBody(0.0123), [(np.array([0.0, -2.0]), np.array([0.994, 0.0])), (np.zeros(2), np.array([0.5, 0.5]))]),
    (lorenz(), [(None, np.ones(3)), (None, np.array([3.0, 1.0, 20.0])), (None, -np.ones(3))]),
    (duffing(beta=1.0), [(0.0, 1.0), (0.5, 0.1)]),
    (pendulum(), [(0.0, 1.0), (0.0, 3.14), (2.1, 0.0)]),
    (top(), [(np.ones(3), np.array([1.0, 0.0, 0.0, 0.0])), (np.arange(3.0), np.ones(4))]),
    (FIGURE_EIGHT.system, [(FIGURE_EIGHT.v, FIGURE_EIGHT.y), (0.5 * FIGURE_EIGHT.v, FIGURE_EIGHT.y)]),
    (lotka_volterra(), [(None, np.array([1.0, 1.0])), (None, np.array([1e-3, 5.0])), (None, np.array([-1.0, 1.0]))]),
]  # fmt: skip


@pytest.mark.parametrize(
    ("method", "every"),
    family(
        itertools.product(("fehlberg", "dop853", "taylor", "rosenbrock23", "rodas5p"), (1, 8)),
        lambda method, every: every > 1,
    ),
)
def test_adaptive_runs_are_those_of_integrate(method: str, every: int) -> None:
    """Systems with and without an energy, a barrier, amounts and many members, with their warnings."""
    of_all = [(options, *each) for options in ADAPTIVE for each in STARTS]
    for options, system, starts in of_all[number(method) % every :: every]:
        arguments = {**ORBIT, **options}
        expected = []
        try:
            for v, y in starts:
                expected.append(with_warnings(partial(whole, system, method, v=v, y=y, **arguments)))
        except sw.StepwellError as error:
            refused(type(error), re.escape(str(error)), sw.prepare, system, method, v=v, y=y, **arguments)
            continue
        run = sw.prepare(system, method, v=starts[0][0], y=starts[0][1], **arguments)
        assert run._short is not None
        if method != "rosenbrock23":  # whose steps may be very many
            for start, (other, _) in zip(starts, expected, strict=True):
                assert (run._short.run(*start) is None) == bool(other.status.any())
        for _ in range(2):
            for (v, y), (other, said) in zip(starts, expected, strict=True):
                for call in (partial(run, v, y), partial(sw.integrate, system, method, v=v, y=y, **arguments)):
                    got, warned = with_warnings(call)
                    assert_same(got, other)
                    assert warned == said


def test_arrays_and_lists_among_the_options_are_copied() -> None:
    """What is written into them later is not seen."""
    for at in (np.array([1.0, 2.0]), [1.0, 2.0]):
        push, relative = np.array(1.0), np.array(1e-6)
        run = sw.prepare(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=(relative, 1e-9), at=at, force=push)
        expected = run(0.0, 1.0).y.copy()
        at[1], push[...], relative[...] = 5.0, 7.0, 1e-2
        run._request = run._short = None  # what was checked is checked again
        for _ in range(2):
            assert run(0.0, 1.0).y.tobytes() == expected.tobytes()


def test_systems_of_first_order_have_no_velocities() -> None:
    """v is left out, by place or by name."""
    run = sw.prepare(lorenz(), "rk4", y=[1.0, 1.0, 1.0], dt=0.01, steps=10)
    assert_same(run(y=[1.0, 2.0, 3.0]), whole(lorenz(), "rk4", y=[1.0, 2.0, 3.0], dt=0.01, steps=10))
    assert_same(run(None, np.array([1.0, 2.0, 3.0])), run(y=[1.0, 2.0, 3.0]))
    assert run._short is not None


def test_starts_of_other_shapes_mean_what_they_mean_for_integrate() -> None:
    """One number for all, an array for each member, other batches, and arrays that broadcast."""
    many, one = sw.Oscillator(np.linspace(0.5, 2.0, 5)), sw.Oscillator(1.1)
    starts: list[tuple[Any, Any]] = [
        (0.0, 1.0), (0.0, np.ones(5)), (np.arange(5.0), np.ones(5)), (np.arange(5.0), 1.0), (0, 1), (np.float64(0.5), 1.0),
        (np.zeros((1,)), np.ones(5)), (np.arange(10.0)[::2], np.ones(5)), (np.zeros(5, np.float32), 1.0), (np.array(0.5), 1.0),
    ]  # fmt: skip
    for system in (many, one):
        run = sw.prepare(system, "rk4", v=0.0, y=1.0, **DT)
        for start in [*starts, *reversed(starts)]:
            assert_same(run(*start), whole(system, "rk4", v=start[0], y=start[1], **DT))


def test_errors_are_those_of_integrate() -> None:
    """Of the start at each call, of everything else at once."""
    system, arguments = sw.Oscillator(), {"dt": 0.1, "steps": 5}
    starts: list[tuple[Any, Any]] = [
        ("a", 1.0), (0.0, None), (None, 1.0), (np.nan, 1.0), (0.0, np.inf), (0.0, np.array(np.nan)), (1j, 1.0),
        (np.zeros(2), np.zeros(3)),
    ]  # fmt: skip
    for dtype, v, y in [("float64", *start) for start in starts] + [("float32", 0.0, 1e39)]:
        run = sw.prepare(system, "rk4", v=0.0, y=1.0, dtype=dtype, **arguments)
        with pytest.raises(sw.StepwellError) as expected:
            whole(system, "rk4", v=v, y=y, dtype=dtype, **arguments)
        with pytest.raises(type(expected.value)) as raised:
            run(v, y)
        assert str(raised.value) == str(expected.value)
    positive = sw.prepare(lorenz(), "dop853", y=np.ones(3), positive=2, **ORBIT)
    with pytest.raises(sw.errors.ArgumentError, match=r"positive: expected a start at which y\[2\] is not negative"):
        positive(None, [1.0, 1.0, -1.0])
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"resume": whole(system, "rk4", v=0.0, y=1.0, **arguments)}, "resume: a prepared run begins at the start of its call"),
        ({"steps": 0, "v": 0.0, "y": 1.0}, "steps"),
    ]
    for options, message in wrong:
        refused(sw.errors.ArgumentError, message, sw.prepare, system, "rk4", **arguments | options)


WARNED: list[Any] = [
    (lorenz(), "euler", (None, [1.0, 1.0, 1e9]), {"dt": 1.0, "steps": 20}),  # diverges
    (lorenz(), "euler", (None, [1e-3, 1e-3, 1e-3]), {"dt": 1.0, "steps": 20}),
    (sw.Oscillator(), "euler", (0.0, 1.0), {"dt": 3.0, "steps": 60}),  # grows by its steps alone
    (sw.Oscillator(), "euler", (0.0, 1e-200), {"dt": 3.0, "steps": 13}),
    (sw.Oscillator([1.0, 3.0]), "rk4", (0.0, 1.0), {"dt": 1.0, "steps": 400}),
    (sw.Pendulum(), "rk4", (1e300, 1.0), {"dt": 1.0, "steps": 3}),  # an angle without a sine
    (sw.Pendulum(), "verlet", (0.0, 3.1), {"dt": 0.5, "steps": 3000}),
    (sw.Oscillator(30.0, damping=2e4), "dop853", (0.0, 1.0), {"tolerance": 1e-3, "at": [1.0]}),  # stiff
]


def test_warnings_are_those_of_integrate() -> None:
    """The same words, at the line of the caller, from the first call and from later ones."""
    kinds: set[str] = set()
    for system, method, start, arguments in WARNED:
        expected, said = with_warnings(partial(whole, system, method, v=start[0], y=start[1], **arguments))
        kinds.update(each.split()[1] for each in said)
        gentle = (None, [1.0, 1.0, 1.0]) if start[0] is None else (0.0, 1e-3)
        run = sw.prepare(system, method, v=gentle[0], y=gentle[1], **arguments)
        for _ in range(3):
            for call in (partial(run, *start), partial(sw.integrate, system, method, v=start[0], y=start[1], **arguments)):
                got, warned = with_warnings(call)
                assert_same(got, expected)
                assert warned == said
    assert kinds == {"DivergenceWarning", "AccuracyWarning", "StiffnessWarning"}


def test_runs_share_no_arrays() -> None:
    """What is written into one run is not seen in another."""
    run = sw.prepare(sw.Oscillator(np.ones(3)), "leapfrog", v=0.0, y=1.0, dt=0.1, steps=4, every=2)
    first, expected = run(0.0, 1.0), whole(sw.Oscillator(np.ones(3)), "leapfrog", v=0.0, y=1.0, dt=0.1, steps=4, every=2)
    for array in (first.t, first.v, first.y, first.status, first.first_bad_step, first.carry):
        assert array is not None
        array[...] = 7
    first.recorded["own"] = first.y
    assert_same(run(0.0, 1.0), expected)


@looped("pace", [{"dt": 0.1, "steps": 4, "every": 2}, {"tolerance": 1e-6, "at": [0.0, 0.5, 1.0]}])
@looped("t0", [0.0, 2.0, np.array([0.0, 1.0])])
def test_what_is_written_into_a_run_of_integrate_is_in_no_other(pace: dict[str, Any], t0: Any) -> None:
    def arrays(run: sw.Run) -> list[Any]:
        return [np.copy(each) for each in (run.t, run.t0, run.v, run.y, run.status, run.first_bad_step)]

    at = {"at": np.expand_dims(pace["at"], 1) + t0 if np.ndim(t0) else np.add(pace["at"], t0).tolist()} if "at" in pace else {}
    system, prepared = sw.Oscillator(np.ones(2)), []
    start = {"v": 0.0, "y": 1.0, **pace, **at, "t0": t0}
    prepared = sw.prepare(system, "dop853", **start)
    for make in (lambda: sw.integrate(system, "dop853", **start), lambda: prepared(0.0, 1.0)):
        expected = arrays(make())
        for _ in range(4):
            run = make()
            for own, other in zip(arrays(run), expected, strict=True):
                assert np.array_equal(own, other)
            for each in (run.t, run.t0, run.v, run.y, run.status, run.first_bad_step):
                if isinstance(each, np.ndarray):
                    each[...] = 7


def test_zeros_of_either_sign_are_different_options() -> None:
    for t0 in (0.0, -0.0, 0.0, -0.0, 0.0, -0.0, *map(np.float64, (0.0, -0.0, 0.0, -0.0, 0.0, -0.0))):
        run = sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=1e-6, at=[t0, 1.0], t0=t0)
        assert np.signbit(run.t).tolist() == [t0.hex()[0] == "-", False]
        assert math.copysign(1.0, run.t0) == math.copysign(1.0, t0)
        run = sw.integrate(sw.Oscillator(), "dop853", v=0.0, y=1.0, tolerance=1e-6, at=1.0, t0=t0)
        assert math.copysign(1.0, run.t0) == math.copysign(1.0, t0)


def test_copies_make_the_same_runs() -> None:
    """Also in another process, by pickle."""
    run = sw.prepare(sw.Oscillator(1.7), "rk4", v=0.0, y=1.0, dt=0.1, steps=4)
    for other in (copy.copy(run), copy.deepcopy(run), pickle.loads(pickle.dumps(run))):
        assert repr(other) == repr(run) == "<prepared run of Oscillator(omega=1.7, form='canonical') by rk4>"
        for _ in range(2):
            assert_same(other(0.5, 1.0), run(0.5, 1.0))


def test_threads_may_call_it_at_once() -> None:
    """Every call has its own start and result; from the first adaptive one what does not depend on the start is known."""
    run = sw.prepare(sw.Oscillator(np.linspace(1.0, 2.0, 200)), "rk4", v=0.0, y=1.0, dt=0.01, steps=300)
    fixed = [run(0.0, float(i)).y for i in range(8)]
    in_threads(lambda i: [np.testing.assert_array_equal(run(0.0, float(i)).y, fixed[i]) for _ in range(50)])
    adaptive = [whole(sw.Oscillator(), "dop853", v=0.0, y=float(i), **ORBIT) for i in range(8)]
    for _ in range(50):
        first, gate = sw.prepare(sw.Oscillator(), "dop853", v=0.0, y=1.0, **ORBIT), threading.Barrier(8)

        def work(i: int, run: Any = first, gate: Any = gate) -> None:
            gate.wait()
            assert_same(run(0.0, float(i)), adaptive[i])

        in_threads(work)


def test_threads_may_call_integrate_at_once() -> None:
    """More runs than are kept, of systems that are made anew."""
    ask, omegas = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 3}, 1.0 + np.arange(2 * module.MOST_KEPT)
    expected = [whole(sw.Oscillator(omega), "rk4", **ask).y.tobytes() for omega in omegas]

    def work(_: int) -> None:
        for _ in range(10):
            assert [sw.integrate(sw.Oscillator(omega), "rk4", **ask).y.tobytes() for omega in omegas] == expected

    in_threads(work)
    assert len(module._kept) <= module.MOST_KEPT + 8


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("of_start", [np.float32, np.float64])
def test_starts_of_either_precision_are_taken(of_start: Any, dtype: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the short way, and others are not prepared anew at each call."""
    system = sw.Oscillator(np.linspace(0.5, 2.0, 5))
    v, y = np.linspace(0.1, 0.3, 5).astype(of_start), np.linspace(1.0, 0.7, 5).astype(of_start)
    expected = whole(system, "rk4", v=v, y=y, dtype=dtype, **DT)
    run = sw.prepare(system, "rk4", v=v, y=y, dtype=dtype, **DT)
    assert run._short is not None
    got = run._short.run(v, y)
    assert got is not None
    assert_same(got, expected)
    monkeypatch.setattr("stepwell.runs.prepared.short_run_of_request", None)
    for _ in range(2):
        assert_same(run(v.tolist(), y.tolist()), whole(system, "rk4", v=v.tolist(), y=y.tolist(), dtype=dtype, **DT))


def test_only_what_depends_on_the_start_is_checked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A prepared run makes no request, and nor does ``integrate`` from its third call on."""
    system = sw.Oscillator()
    run, expected = sw.prepare(system, "rk4", v=0.0, y=1.0, **DT), whole(system, "rk4", v=0.5, y=1.5, **DT)
    for _ in range(2):
        sw.integrate(system, "rk4", v=0.0, y=1.0, **DT)
    monkeypatch.setattr("stepwell.runs.request.Request.of", None)
    assert_same(run(0.5, 1.5), expected)
    assert_same(sw.integrate(system, "rk4", v=0.5, y=1.5, **DT), expected)


def test_of_adaptive_steps_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where times and tolerances are lists and pairs, which may be written to."""
    system, at = sw.RestrictedThreeBody(0.0123), [1.0, 2.0]
    for times, tolerance in ((at, (1e-6, 1e-9)), (np.array(at), np.float64(1e-6)), ([np.float64(1.0), 2], 1e-6)):
        arguments: dict[str, Any] = {"v": np.array([0.0, -2.0]), "y": np.array([0.994, 0.0]), "tolerance": tolerance}
        expected = whole(system, "dop853", at=times, **arguments)
        for _ in range(3):
            sw.integrate(system, "dop853", at=times, **arguments)
        with monkeypatch.context() as patched:
            patched.setattr("stepwell.runs.request.Request.of", None)
            assert_same(sw.integrate(system, "dop853", at=times, **arguments), expected)
        later = whole(system, "dop853", at=[1.0, 3.0], **arguments)
        times[1] = 3.0
        assert_same(sw.integrate(system, "dop853", at=times, **arguments), later)
        times[1] = 2.0


def test_a_long_run_is_made_as_any_other() -> None:
    """It is given up after some tenths of a millisecond, and not tried again."""
    arguments: dict[str, Any] = {"tolerance": 1e-9, "at": [1e4]}
    run = sw.prepare(sw.Oscillator(), "dop853", v=0.0, y=1.0, **arguments)
    assert run._short is not None
    assert_same(run(0.0, 1.0), whole(sw.Oscillator(), "dop853", v=0.0, y=1.0, **arguments))
    assert run._short.run(0.0, 1.0) is None


def test_integrate_knows_a_run_by_all_of_its_options() -> None:
    """Equal numbers of other types, other systems at the same place, and options that are written to."""
    system = sw.Oscillator(1.5)
    for _ in range(3):
        sw.integrate(system, "rk4", v=0.0, y=1.0, dt=1.0, steps=1)
    refused(sw.StepwellError, "steps", sw.integrate, system, "rk4", v=0.0, y=1.0, dt=1.0, steps=True)
    with pytest.raises(sw.StepwellError, match="fused"):
        sw.integrate(system, "rk4", v=0.0, y=1.0, dt=1.0, steps=1, fused=0)  # type: ignore[arg-type]
    for omega in np.linspace(0.5, 2.0, 50):
        for _ in range(3):
            run = sw.integrate(sw.Oscillator(omega), "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
        assert_same(run, whole(sw.Oscillator(omega), "rk4", v=0.0, y=1.0, dt=0.1, steps=3))
    push = np.zeros(())
    for size in (0.0, 1.0, 2.0):
        push[...] = size
        run = sw.integrate(system, "rk4", v=0.0, y=1.0, force=push, dt=0.1, steps=3)
        assert run.y.tobytes() == whole(system, "rk4", v=0.0, y=1.0, force=size, dt=0.1, steps=3).y.tobytes()


def test_integrate_knows_a_system_by_its_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is made anew for each call is the same if all of its numbers are, to the bit, and belongs to its run."""
    kinds: list[Any] = [
        lambda x: sw.Oscillator(np.array([1.0, 1.5 + x])), lambda x: sw.Oscillator(2.0, a=sw.Sinusoid(x, 2.0)),
        lambda x: sw.Pendulum(2.0, a=x), lambda x: sw.RestrictedThreeBody(0.0123 + 0.1 * x),
    ]  # fmt: skip
    for make in kinds:
        start = (np.zeros(2), np.array([0.5, 0.5])) if make is kinds[-1] else (0.0, 1.0)
        arguments = {"v": start[0], "y": start[1], "dt": 0.1, "steps": 3}
        expected = [whole(make(x), "rk4", **arguments) for x in (0.0, -0.0, 0.5)]
        assert len({run.y.tobytes() for run in expected}) >= 2
        for _ in range(3):
            for x, other in zip((0.0, -0.0, 0.5), expected, strict=True):
                system = make(x)
                run = sw.integrate(system, "rk4", **arguments)
                assert_same(run, other)
                assert run.system is system
        with monkeypatch.context() as patched:
            patched.setattr("stepwell.runs.request.Request.of", None)
            assert_same(sw.integrate(make(0.5), "rk4", **arguments), expected[-1])


#: Systems by one number that reaches the step as it is, and a start.
OTHER_NUMBERS: dict[str, tuple[Any, dict[str, Any]]] = {
    "own": (lambda x: duffing(beta=x), {"v": 0.1, "y": 1.0}),
    "own, with an invariant": (lambda x: lotka_volterra(a=x), {"y": np.array([1.0, 2.0])}),
    "own, of members": (lambda x: lorenz(rho=x * np.linspace(0.5, 2.0, 7)), {"y": np.ones((3, 7))}),
    "own, an axis of its own": (lambda x: top(inertia=x * np.array([[1.0, 2.0], [2.0, 2.0], [3.0, 4.0]])),
                                {"v": np.ones((3, 2)), "y": np.ones((4, 2))}),
    "built-in": (lambda x: sw.Oscillator(x), {"v": 0, "y": [1.0, 2.0]}),
    "with samples": (lambda x: sw.Oscillator(x, a=sw.Sampled(np.linspace(0.0, 1.0, 40), interval=0.1)), {"v": 0.1, "y": 1.0}),
    "damping that may be none": (lambda x: sw.Pendulum(2.0, damping=x - 1.0), {"v": 0.1, "y": 1.0}),
}  # fmt: skip
WAYS: list[tuple[str, dict[str, Any]]] = [
    ("rk4", DT), ("false_euler", {**DT, "every": 3}), ("leapfrog", DT), ("rk4", {**DT, "dtype": "float32"}),
    ("rk4", {**DT, "fused": True}), ("dop853", {"tolerance": 1e-7, "at": [0.5, 1.5]}),
    ("taylor", {"tolerance": 1e-9, "at": 1.5}), ("rodas5p", {"tolerance": 1e-6, "at": 2.0}),
]  # fmt: skip


def test_other_numbers_of_a_system_take_the_short_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """The runs, findings and systems are those of a call that knows nothing; only the first two calls make a request."""
    for (kind, (make, start)), (method, options) in itertools.product(OTHER_NUMBERS.items(), WAYS):
        # Rates that depend on velocities, or have none; and a series does not see that samples change.
        if (method == "leapfrog" and kind not in ("built-in", "with samples")) or (kind, method) == ("with samples", "taylor"):
            continue
        numbers = (1.0, 1.5, 0.75, 1.0, 1.25)
        if kind == "damping that may be none" and "tolerance" in options:
            numbers = (1.5, 1.25, 1.75)  # undamped ones are judged by their energy, by the long way
        expected = [whole(make(x), method, **start, **options) for x in numbers]
        module._kept.clear()
        sw.integrate(make(2.0), method, **start, **options)
        sw.integrate(make(1.75), method, **start, **options)
        with monkeypatch.context() as patched:
            patched.setattr("stepwell.runs.request.Request.of", None)
            for x, run in zip(numbers, expected, strict=True):
                system = make(x)
                got = sw.integrate(system, method, **start, **options)
                assert_same(got, run)
                assert repr(got.system) == repr(system), kind
    assert len({run.y.tobytes() for run in expected}) == len(set(numbers))


def test_other_numbers_of_every_system_are_its_own() -> None:
    """Of every kind there is, with numbers, inputs and parts drawn anew: what was prepared of one is never the run of another."""
    ways = [("rk4", DT), ("false_euler", {**DT, "every": 4}), ("dop853", {"tolerance": 1e-6, "at": [0.3, 0.7]})]
    ways += [("rk4", {**DT, "dtype": "float32"}), ("rosenbrock23", {"tolerance": 1e-4, "at": 0.5})]
    kept = 0
    for name, make in SYSTEMS.items():
        method, options = ways[number(name, "way") % len(ways)]
        b = 1 + 2 * (number(name, "members") % 2)
        systems = [make(np.random.default_rng(number(name, k)), b) for k in range(4)]
        rng = np.random.default_rng(number(name))
        v, y = 0.3 * rng.normal(size=(*systems[0].v_shape, b)), rng.normal(size=(*systems[0].y_shape, b))
        module._kept.clear()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                runs = [(k, sw.integrate(systems[k], method, v=v, y=y, **options)) for k in (0, 1, 2, 0, 0, 3, 1)]
            except sw.errors.UnsupportedError:  # of this kind by this method
                continue
            kept += any(each.run is not None for each in module._kept.values())
            for k, run in runs:
                assert_same(run, whole(systems[k], method, v=v, y=y, **options))
    assert kept > 30


def test_other_numbers_are_checked_and_judged() -> None:
    """What depends on numbers beside the steps goes the long way: errors, switches of the time, warnings, an energy to keep."""

    @sw.system
    def switched(t: Any, v: Any, y: Any, *, at: Any = 0.5) -> Any:
        return np.where(t < at, 1.0, -1.0) - y

    def capped(t: Any, v: Any, y: Any, *, most: Any = 1.0) -> Any:
        return -np.minimum(y, most)

    def turned(t: Any, y: Any, *, of: Any = 1.0) -> Any:
        return np.array([-y[1], y[0]])

    def length(y: Any, *, of: Any) -> Any:
        return of * (y[0] * y[0] + y[1] * y[1])

    def compared(make: Any, numbers: Sequence[Any], method: str, **arguments: Any) -> list[int]:
        """The numbers of warnings of runs, one after the other, that are those of calls that know nothing."""
        module._kept.clear()
        made = [with_warnings(lambda x=x: sw.integrate(make(x), method, **arguments)) for x in numbers]
        for x, (run, warned) in zip(numbers, made, strict=True):
            alone, anew = with_warnings(lambda x=x: whole(make(x), method, **arguments))
            assert_same(run, alone)
            assert warned == anew
            assert repr(run.system) == repr(make(x))
        return [len(warned) for _, warned in made]

    short: dict[str, Any] = {"v": 0.0, "y": 1.0, "tolerance": 1e-8, "at": 1.0}
    assert compared(lambda x: switched(at=x), (0.5, 0.3, 0.7, 0.45), "dop853", **short) == [0, 0, 0, 0]
    # Undamped, it is judged by its energy.
    loose = short | {"tolerance": 0.3, "at": 60.0}
    springs = lambda x: sw.Oscillator(1.0, damping=x, form="physical")  # noqa: E731 (it is an argument)
    assert compared(springs, (0.5, 0.25, 0.0, 0.125, 0.0), "merson", **loose) == [0, 0, 1, 0, 1]
    turning = sw.system(turned, order=1)
    turning.invariant(length)
    circle = loose | {"v": None, "y": np.array([1.0, 0.0])}
    assert compared(lambda x: turning(of=x), (0.0, 0.0, 1.0), "merson", **circle) == [0, 0, 0]
    module._kept.clear()
    for _ in range(2):
        sw.integrate(turning(of=0.0), "merson", **circle)
    ((run,),) = [[each.run for each in module._kept.values()]]
    arrays = [np.empty(shape) for shape in run.shapes]  # type: ignore[union-attr]
    numbers = [turning(of=x).numbers_of_step((), series=False) for x in (0.0, 1.0, 0.0)]
    # What it keeps is multiplied by the number: the core is certain that it has not changed only where that is zero.
    assert [run.core.run(None, circle["y"], *arrays, each) for each in numbers] == [2, 1, 2]  # type: ignore[union-attr]
    # The member that came last to its end comes first in the next run.
    rates = (np.array([1.0, 6.0]), np.array([6.0, 1.0]))
    assert compared(lambda x: pendulum(omega=x), 3 * rates, "taylor", **short) == [0] * 6
    steps: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 40}
    assert compared(sw.Oscillator, (1.0, 1.5, 30.0, 1.25, 31.0), "rk4", **steps) == [0, 0, 1, 0, 1]
    assert sw.Aircraft().structure() is None  # own equations with attributes beside their parameters
    system = sw.system(capped)
    for most in (1.0, 2.0, 3.0):
        sw.integrate(system(most=most), "rk4", v=0.0, y=1.0, dtype="float32", **DT)
    refused(sw.errors.ArgumentError, "most", sw.integrate, system(most=1e39), "rk4", v=0.0, y=1.0, dtype="float32", **DT)
    refused(sw.errors.ArgumentError, "y: ", sw.integrate, duffing(beta=1.5), "rk4", v=0.0, y=math.nan, **DT)


STIFFNESS = 1.0


def test_a_function_that_reads_something_else_is_another_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Globals, what is captured, defaults by keyword, code and declared invariants may change between two calls."""
    captured = 1.0

    @sw.system
    def sprung(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        return -STIFFNESS * captured * scaled() * k * y

    def scaled(*, by: float = 1.0) -> float:
        return by

    def end(k: float) -> float:
        return float(sw.integrate(sprung(k=k), "rk4", v=0.0, y=1.0, dt=0.1, steps=3).y[-1])

    def expected(strength: float) -> float:
        return float(whole(sw.Oscillator(np.sqrt(strength)), "rk4", v=0.0, y=1.0, dt=0.1, steps=3).y[-1])

    def all_right(strength: float) -> None:
        for k in (1.0, 2.0, 3.0):
            assert end(k) == pytest.approx(expected(strength * k), rel=1e-12)

    all_right(1.0)
    monkeypatch.setitem(globals(), "STIFFNESS", 2.0)
    all_right(2.0)
    captured = 1.5
    all_right(3.0)
    assert scaled.__kwdefaults__ is not None
    scaled.__kwdefaults__["by"] = 2.0
    all_right(6.0)
    scaled.__code__ = (lambda *, by: 3.0 * by).__code__
    all_right(18.0)

    @sprung.invariant
    def energy(v: Any, y: Any, *, k: Any) -> Any:
        return 0.5 * v**2 + 0.5 * k * y**2

    run = sw.integrate(sprung(k=1.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=3, record="energy")
    kept = 0.5 * float(run.v[-1] ** 2 + run.y[-1] ** 2)
    assert run.recorded["energy"][-1] == pytest.approx(kept)

    def declared_again(v: Any, y: Any, *, k: Any) -> Any:
        return v**2 + k * y**2

    declared_again.__name__ = "energy"
    sprung.invariant(declared_again)
    run = sw.integrate(sprung(k=1.0), "rk4", v=0.0, y=1.0, dt=0.1, steps=3, record="energy")
    assert run.recorded["energy"][-1] == pytest.approx(2.0 * kept)


STRENGTH = [1.0]


def test_an_own_equation_is_known_as_this_object() -> None:
    """Since its function may read what changes."""

    @sw.system
    def pulled(t: Any, v: Any, y: Any) -> Any:
        return -STRENGTH[0] * y

    for strength in (1.0, 2.0, 3.0):
        STRENGTH[0] = strength
        for _ in range(3):
            run = sw.integrate(pulled(), "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
        assert_same(run, whole(pulled(), "rk4", v=0.0, y=1.0, dt=0.1, steps=3))
        assert run.y[-1] == pytest.approx(np.cos(np.sqrt(strength) * 0.3), abs=1e-4)


def test_integrate_notices_another_level(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run of another level of kernels is another run, and an unknown level is an error."""
    system = sw.Oscillator()
    for level in sw.isa_levels():
        monkeypatch.setenv("STEPWELL_KERNELS", level)
        for _ in range(3):
            sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.1, steps=3)
    assert len(module._kept) == len(sw.isa_levels())
    monkeypatch.setenv("STEPWELL_KERNELS", "mmx")
    refused(sw.errors.ArgumentError, "mmx", sw.integrate, system, "rk4", v=0.0, y=1.0, dt=0.1, steps=3)


def test_integrate_keeps_little_memory() -> None:
    """Some runs, of systems with few parameters, and of others nothing."""
    systems = [sw.Oscillator(1.0 + i) for i in range(100)]
    for system in systems:
        for _ in range(3):
            sw.integrate(system, "rk4", v=0.0, y=1.0, dt=0.01, steps=3)
    assert len(module._kept) <= module.MOST_KEPT
    large = sw.Oscillator(np.ones(100_000))
    for _ in range(3):
        sw.integrate(large, "rk4", v=0.0, y=1.0, dt=0.01, steps=3)
    assert all(each.run is None or each.run.system is not large for each in module._kept.values())
    small, start = sw.Oscillator(), np.ones(100_000)
    for _ in range(3):
        sw.integrate(small, "rk4", v=0.0, y=start, dt=0.01, steps=3)
        sw.integrate(small, "rk4", v=0.0, y=1.0, dt=1e-6, steps=10_000, every=1)
    kept, start = weakref.ref(start), None  # type: ignore[assignment]
    gc.collect()
    assert kept() is None
    assert all(each.run is None for each in module._kept.values() if each.system() is small)
