"""What a run keeps, how shapes broadcast, who diverged and when."""

import itertools
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.runs import encounters, engine
from support.families import family
from support.heard import quiet

FREE = sw.Oscillator(1.0)


def test_shapes_of_one_trajectory() -> None:
    run = sw.integrate(FREE, "false_euler", v=0.0, y=1.0, dt=0.3, steps=200, every=1)
    assert run.t.shape == run.v.shape == run.y.shape == run.energy.shape == (201,)
    assert run.status.shape == run.first_bad_step.shape == ()
    assert (run.status, run.first_bad_step) == (sw.Status.OK, -1)
    np.testing.assert_array_equal(run.t, 0.3 * np.arange(201))
    last = sw.integrate(FREE, "false_euler", v=0.0, y=1.0, dt=0.3, steps=200)
    assert (last.y.tolist(), last.t.tolist()) == ([run.y[-1]], [60.0])


@pytest.mark.parametrize(("form", "backend"), [("direct", "rust"), ("matrix", "rust"), ("direct", "numpy")])
def test_everything_broadcasts(form: str, backend: str) -> None:
    omega = np.linspace(0.5, 2.0, 4)[:, None, None]
    damping = np.linspace(0.0, 0.5, 3)[:, None]
    y = np.arange(5.0)
    system = sw.Oscillator(omega, damping, x=sw.Sampled(np.arange(6.0).reshape(2, 3, 1), 0.5))
    options = {"dt": 0.1, "steps": 12, "every": 4, "backend": backend, "form": form}
    run = sw.integrate(system, "rk4", v=0.0, y=y, **options)
    assert run.y.shape == (4, 4, 3, 5)
    assert run.status.shape == (4, 3, 5)
    one = sw.Oscillator(omega[2, 0, 0], damping[1, 0], x=sw.Sampled([1.0, 4.0], 0.5))
    np.testing.assert_array_equal(run.y[:, 2, 1, 3], sw.integrate(one, "rk4", v=0.0, y=3.0, **options).y)


def test_every_keeps_the_first_and_the_last() -> None:
    for steps, every, saved in ((10, 3, [0, 3, 6, 9, 10]), (9, 3, [0, 3, 6, 9]), (5, 100, [0, 5])):
        run = sw.integrate(FREE, "rk4", v=0.0, y=1.0, dt=0.5, steps=steps, every=every, start_step=100, t0=7.0)
        np.testing.assert_array_equal(run.t, 7.0 + (100 + np.array(saved, dtype=float)) * 0.5)


def test_energy_of_each_system() -> None:
    free = sw.integrate(sw.Oscillator(2.0), "rk4", v=3.0, y=4.0, dt=1e-3, steps=1, every=1)
    assert free.energy[0] == 12.5
    physical = sw.integrate(sw.Oscillator(2.0, form="physical"), "rk4", v=3.0, y=4.0, dt=1e-3, steps=1, every=1)
    assert physical.energy[0] == 4.5 + 32.0
    # Each energy is conserved to the method's order on an undriven, undamped system: fourth order, 1000 steps of 0.01.
    rng = np.random.default_rng(5)
    for system in (sw.NBody(), sw.Chain(3, stiffness=[1.0, 2.0, 0.5, 1.5], mass=[1.0, 3.0, 0.7])):
        y = rng.normal(size=system.y_shape)
        run = sw.integrate(system, "rk4", v=0.1, y=3 * y, dt=1e-3, steps=1000, every=100)
        assert np.ptp(run.energy) < 1e-9 * (1 + abs(run.energy[0]))
        assert np.ptp(0.5 * (run.v**2).reshape(11, -1).sum(axis=1)) > 1e-4  # something moved


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_who_diverged_and_when(backend: str) -> None:
    """False Euler past its limit: each member leaves the range at its own step, and its neighbours do not notice."""
    phi = np.array([0.5, 2.5, 1.9, 3.0, 1.0])
    options = {"v": 0.0, "y": 1.0, "dt": 1.0, "steps": 3000, "backend": backend}
    with pytest.warns(sw.DivergenceWarning, match=r"2 of 5 members diverged; the first was member 3 at step \d+ \(t = \d+\)"):
        run = sw.integrate(sw.Oscillator(phi), "false_euler", **options)
    np.testing.assert_array_equal(run.status, [0, 1, 0, 1, 0])
    for i, p in enumerate(phi):
        first = run.first_bad_step[i]
        assert (first == -1) == (p < 2)
        if first > 0:
            # Exact: finite one step before, not at it.
            before = sw.integrate(sw.Oscillator(p), "false_euler", **(options | {"steps": int(first) - 1}))
            at = quiet(sw.integrate, sw.Oscillator(p), "false_euler", **(options | {"steps": int(first)}))
            assert np.isfinite([before.v, before.y]).all()
            assert not np.isfinite([at.v, at.y]).all()
            # It grows by r = −p ± √(p²−1), p = 1 − Φ²/2, a step: overflow where r^n passes the largest double.
            growth = np.log(p**2 / 2 - 1 + np.sqrt((p**2 / 2 - 1) ** 2 - 1))
            assert first == pytest.approx(np.log(np.finfo(float).max) / growth, abs=5)
    alone = sw.integrate(sw.Oscillator(1.9), "false_euler", **options)
    assert run.y[-1, 2] == alone.y[-1]


def test_the_warning_names_the_member() -> None:
    options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": 1.0, "steps": 3000}
    omega = np.ones((4, 6))
    omega[2, 5] = 9.0
    of_grid = r"1 of 24 members diverged: member \(2, 5\) at step"
    for rates, words in ((9.0, r"^the run diverged at step"), (omega, of_grid)):
        with pytest.warns(sw.DivergenceWarning, match=words) as caught:
            sw.integrate(sw.Oscillator(rates), "false_euler", **options)
        assert caught[0].filename == __file__


def test_inputs_are_not_touched_and_integers_and_lists_are_welcome() -> None:
    v, y = np.zeros(40), np.ones(40)
    sw.integrate(FREE, "false_euler", v=v, y=y, dt=0.1, steps=10)
    np.testing.assert_array_equal(v, 0.0)
    np.testing.assert_array_equal(y, 1.0)
    run = sw.integrate(sw.Oscillator([1, 2]), "rk4", v=0, y=[1, 2], dt=1, steps=np.int64(1))
    assert run.y.dtype == np.float64


def test_a_sample_is_not_missed_by_rounding() -> None:
    """Users of other tools lose output times to accumulated rounding; here k·dt finds sample k for every k."""
    n, dt = 5000, 0.1
    samples = np.arange(n, dtype=float)
    system = sw.Oscillator(1e-8, a=sw.Sampled(samples, dt), form="physical")
    run = sw.integrate(system, "standard_euler", v=0.0, y=0.0, dt=dt, steps=n, every=1)
    np.testing.assert_array_equal(np.round(np.diff(run.v) / dt), samples)


def test_a_run_says_what_it_is() -> None:
    run = sw.integrate(FREE, "false_euler", v=0.0, y=1.0, dt=0.3, steps=2)
    assert repr(run) == (
        "<run of Oscillator(omega=1.0, form='canonical') by false_euler: 2 steps of 0.3, t = 0 to 0.6, 1 saved, 1 member: finite>"
    )


def test_progress_shows_a_bar(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """On stderr, on a terminal only: what a program prints stays as it is."""
    options: dict[str, Any] = {"v": 0.0, "y": np.ones(500), "dt": 0.1, "steps": 2000, "progress": True}
    for terminal, backend in itertools.product((False, True), ("rust", "numpy")):
        if terminal:
            monkeypatch.setenv("FORCE_COLOR", "1")
        sw.integrate(FREE, "rk4", **options, backend=backend)
        shown = capsys.readouterr()
        assert ("Runge-Kutta 4, 2000 steps" in shown.err) == terminal
        assert shown.out == ""


@pytest.mark.parametrize("backend", ["rust", "numpy"])
def test_progress_goes_up(backend: str) -> None:
    shares: list[float] = []
    steps = 10**6 if backend == "rust" else 1000
    plan = engine.Plan(FREE, sw.method("rk4"), (500,), 0.1, steps=steps, threads=1, backend=backend, progress=shares.append)
    engine.advance(plan, np.zeros(500), np.ones(500))
    assert len(shares) > 2  # fifty a second, however long the run takes
    assert shares == sorted(shares)
    assert 0 <= shares[0] < 0.5 < shares[-1] <= 1


FORMS = [
    ("false_euler", "direct", "rust"),
    *(("verlet", *each) for each in (("direct", "rust"), ("matrix", "rust"), ("direct", "numpy"))),
]


@pytest.mark.parametrize(("method", "form", "backend"), FORMS)
def test_a_run_goes_on_after_somebody_diverged(method: str, form: str, backend: str) -> None:
    """In pieces as in one piece: who diverged before stays as it is and is not named again; who does now is."""
    system = sw.Oscillator(np.linspace(1.0, 5.0, 70))
    options: dict[str, Any] = {"dt": 1.0, "every": 50, "form": form, "backend": backend}
    whole = quiet(sw.integrate, system, method, v=0.0, y=1.0, steps=900, **options)
    assert 0 < np.count_nonzero(whole.first_bad_step > 400) < np.count_nonzero(whole.first_bad_step > 0)
    first = quiet(sw.integrate, system, method, v=0.0, y=1.0, steps=400, **options)
    late = np.count_nonzero(whole.first_bad_step > 400)
    with pytest.warns(sw.DivergenceWarning, match=rf"^{late} of 70 member"):
        second = sw.integrate(system, method, steps=500, **options, resume=first)
    np.testing.assert_array_equal(second.first_bad_step, whole.first_bad_step)
    np.testing.assert_array_equal(second.y, whole.y[8:])
    np.testing.assert_array_equal(second.v, whole.v[8:])
    sw.integrate(system, method, steps=5, **options, resume=second)  # no warning, which would be an error


def test_collisions_say_who_met_whom_and_when() -> None:
    """Equal positions are 0/0 at once; three bodies that fall together meet at the centre. Neighbours go on."""
    c = np.sqrt(0.75)
    triangle = np.array([[-c, -0.5], [c, -0.5], [0.0, 1.0]])
    equal = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    y = np.stack([triangle, equal, 3.0 * triangle], axis=-1)
    with pytest.warns(sw.DivergenceWarning, match=r"1 of 3 members diverged: member 1 .* bodies 0 and 2 were 0 apart"):
        run = sw.integrate(sw.NBody(force="newton", G=[1.0, 2.0, 1e-3]), "false_euler", v=0.0, y=y, dt=0.01, steps=10)
    assert run.first_bad_step.tolist() == [-1, 1, -1]
    (met,) = run.collisions
    assert (met.member, met.step, met.bodies, met.distance) == ((1,), 1, (0, 2), 0.0)
    assert np.isfinite(run.y[-1][..., [0, 2]]).all()
    start = y.copy()
    y[...] = 7.0  # the user's to change
    assert run.collisions == (met,)
    y = start
    alone = sw.integrate(sw.NBody(force="newton", G=1e-3), "false_euler", v=0.0, y=y[..., 2], dt=0.01, steps=10)
    np.testing.assert_array_equal(alone.y[-1], run.y[-1][..., 2])
    with pytest.raises(sw.errors.UnsupportedError, match="collisions"):
        _ = sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1).collisions


def test_a_warning_does_not_run_a_long_run_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(encounters, "MAX_RERUN", 0)
    equal = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    with pytest.warns(sw.DivergenceWarning) as caught:
        run = sw.integrate(sw.NBody(), "rk4", v=0.0, y=equal, dt=0.01, steps=3)
    assert "apart" not in str(caught[0].message)
    assert run.collisions[0].bodies == (0, 2)


def test_a_collision_after_many_steps_is_found_by_running_again() -> None:
    """Two bodies fall together from rest: the pair and its distance are those of the state before the first bad step."""
    system = sw.NBody([1.0, 1.0, 0.0], force="printed")
    y = np.array([[0.0, 0.0], [0.0, 1.0], [5.0, 5.0]])
    control = sw.EnergyControl(1e4, "printed", target=10.0)  # too strong: it overflows
    with pytest.warns(sw.ControlWarning), pytest.warns(sw.DivergenceWarning, match="apart before it"):
        run = sw.integrate(system, "standard_euler", v=0.1, y=y, dt=0.01, steps=1000, control=control)
    (met,) = run.collisions
    assert met.step == run.first_bad_step > 2
    with pytest.warns(sw.ControlWarning):
        before = sw.integrate(system, "standard_euler", v=0.1, y=y, dt=0.01, steps=met.step - 1, control=control)
    apart = np.linalg.norm(before.y[-1][:, None] - before.y[-1][None], axis=-1)
    assert met.distance == apart[met.bodies]


# A member has diverged at the first step after which a number of its v or y is not finite: one rule for all methods.
ALL = [m.name for m in sw.methods()]
#: Of the structures of a step: explicit, with a carried state, with stages, implicit, with a series.
FEW = ("false_euler", "leapfrog", "verlet", "rk4", "trapezoidal", "rodas4", "taylor")


def first_not_finite(run: sw.Run, axes: int = 0) -> Any:
    """From a run that kept every step."""
    blocks = tuple(range(1, 1 + axes))
    finite = np.isfinite(run.v).all(axis=blocks) & np.isfinite(run.y).all(axis=blocks)
    finite[0] = True  # the start is no step
    return np.where(finite.all(axis=0), -1, run.start_step + np.argmin(finite, axis=0))


def growing(method: str, dt: float) -> tuple[sw.Oscillator, int]:
    """Oscillators that steps of this length make grow, but for the second one, and in how many steps beyond all numbers.

    By an implicit method none does that does not grow by itself.
    """
    if sw.method(method).is_implicit:
        return sw.Oscillator(np.array([0.9, 1e-3, 0.95]) / dt, -1.0, form="physical"), 1000
    return sw.Oscillator(np.array([9.0, 1e-3, 12.0, 40.0]) / dt, form="physical"), 420


@pytest.mark.parametrize("method", ALL)
def test_the_first_bad_step_is_that_of_the_states(method: str) -> None:
    """Whether all states are kept or the last alone, by both backends. 1e-5: a velocity overflows long before its coordinate."""
    for dt, form in ((3.0, "direct"), (1e-5, "direct"), (1e-5, "matrix")):
        if sw.method(method).is_implicit:
            system, steps = growing(method, dt)
        else:
            system, steps = sw.Oscillator(np.linspace(2.5, 40.0, 9) / dt, form="physical"), 700
        options: dict[str, Any] = {"v": 0.0, "y": 1.0, "dt": dt, "steps": steps, "form": form}
        whole = quiet(sw.integrate, system, method, every=1, **options)
        expected = first_not_finite(whole)
        assert (expected > 0).any()
        by_numpy = [{"every": 13, "backend": "numpy"}] if method in FEW else []
        for more in ({"every": 1}, {"every": None}, {"every": 13}, *by_numpy):
            np.testing.assert_array_equal(quiet(sw.integrate, system, method, **options, **more).first_bad_step, expected)
        np.testing.assert_array_equal(whole.status, expected > 0)


@pytest.mark.parametrize(("form", "steps"), [("direct", 300), ("matrix", 3000)])
def test_a_velocity_that_is_finite_again(form: str, steps: int) -> None:
    """Verlet's coordinates go on though the greatest velocities are infinite: it has diverged when the first one is."""
    method = "verlet"
    system = sw.Oscillator(np.array([100.0, 1.0, 30.0]), form="physical")
    options: dict[str, Any] = {"v": 0.0, "y": [1e307, 1.0, 1e307], "dt": 1e-3, "steps": steps, "form": form}
    whole = quiet(sw.integrate, system, method, every=1, **options)
    assert np.isfinite(whole.y).all()
    expected = first_not_finite(whole)
    assert expected[0] > 0
    assert expected[1] == -1
    np.testing.assert_array_equal(whole.first_bad_step, expected)
    for backend in ("rust", "numpy"):
        np.testing.assert_array_equal(quiet(sw.integrate, system, method, **options, backend=backend).first_bad_step, expected)


@pytest.mark.parametrize("method", ["leapfrog", "verlet"])
def test_of_large_systems_too(method: str) -> None:
    """A chain that is stepped row by row, and bodies."""
    chain, y = sw.Chain(600), np.random.default_rng(1).normal(size=(600, 2))
    options: dict[str, Any] = {"v": 0.0, "y": y, "dt": 2.5, "steps": 600}
    whole = quiet(sw.integrate, chain, method, every=1, **options)
    expected = first_not_finite(whole, 1)
    assert (expected > 0).all()
    for more in ({}, {"backend": "numpy"}, {"every": 7}):
        np.testing.assert_array_equal(quiet(sw.integrate, chain, method, **options, **more).first_bad_step, expected)
    y = np.array([[0.0, 0.0], [0.0, 1e-160], [1.0, 0.0]])  # the square of the distance is less than any number
    for backend in ("rust", "numpy"):
        assert quiet(sw.integrate, sw.NBody(), method, v=0.0, y=y, dt=0.1, steps=5, backend=backend).first_bad_step == 1


@pytest.mark.parametrize("form", ["direct", "matrix"])
@pytest.mark.parametrize("method", family(ALL, FEW.__contains__))
def test_every_run_can_be_resumed(method: str, form: str) -> None:
    """Wherever it stops: also where a velocity has just become infinite and nothing else has. And in pieces as in one piece."""
    system, many = growing(method, 1.0)
    options: dict[str, Any] = {"dt": 1.0, "form": form}
    whole = quiet(sw.integrate, system, method, v=0.0, y=1.0, **options, steps=many)
    first = int(whole.first_bad_step[whole.first_bad_step > 0].min())
    for steps in range(max(1, first - 2), first + 2):
        half = quiet(sw.integrate, system, method, v=0.0, y=1.0, **options, steps=steps)
        finite = np.isfinite(half.v[-1]) & np.isfinite(half.y[-1])
        np.testing.assert_array_equal(half.status == 0, finite)
        rest = quiet(sw.integrate, system, method, **options, steps=many - steps, resume=half)
        for name in ("first_bad_step", "v", "y"):
            np.testing.assert_array_equal(getattr(rest, name), getattr(whole, name))
