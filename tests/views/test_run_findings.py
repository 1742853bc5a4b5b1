"""Titles of the pictures of runs say what came out, by numbers that are known; controlled runs are shown beside free ones."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.views.charts.runs import RunPicture, own_picture, run_picture
from stepwell.views.charts.runs_finding import finding, percent, tenfold
from support.pictured import looked_at, picture_of

START: dict[str, Any] = {"v": 0.0, "y": 1.0, "every": 1}


@sw.system
def free(t: Any, v: Any, y: Any, *, damping: Any = 0.0) -> Any:
    return -y - damping * v


@free.invariant
def energy(v: Any, y: Any) -> Any:
    return 0.5 * (v * v + y * y)


def headline(picture: RunPicture) -> str:
    title = picture.plot().texts
    return next(text.get_text() for text in title if text.get_weight() == "bold")


def test_a_growing_or_a_wrong_motion_says_so() -> None:
    """Standard Euler multiplies the amplitude by √(1 + Φ²) a step: by 10^8.05 in 430 steps of Φ = 0.3."""
    assert 430 * 0.5 * math.log10(1.09) == pytest.approx(8.05, abs=0.01)
    picture = looked_at(sw.scenes.oscillator(), "standard_euler", 0.3, steps=430)
    assert finding(picture) == "grows to 10⁸ times the exact motion"
    assert headline(picture) == "Undamped oscillator by Standard Euler: grows to 10⁸ times the exact motion"
    # False Euler's phase error at Φ = 1.9 is Ψ/Φ − 1 = 0.32 a step: after five steps it is opposite, and as large as itself.
    picture = looked_at(sw.scenes.oscillator(), "false_euler", 1.9, steps=30)
    assert 1.5 < picture.state_error.max() < 10.0
    assert finding(picture) == f"not the exact motion, the error reaches {picture.state_error.max():.2g}"
    thrown = picture_of("gone")
    assert finding(thrown).startswith("grows to ")
    assert finding(thrown).endswith(" times the exact motion")


def test_an_accurate_run_says_how_many_digits() -> None:
    """Runge-Kutta 4 errs by Φ⁵/120·√(1 + (Φ/1.2)²)… a step: in 100 steps of 0.1 by 8.3e-6, in ten of 0.7 by 1.4e-2."""
    # That is |R(iΦ)ⁿ − e^(inΦ)|, computed here by R = 1 + z + z²/2 + z³/6 + z⁴/24; v and y take turns to have nearly all of it.
    for dt, steps, words in ((0.1, 100, "the exact motion to 5 digits"), (0.7, 10, "up to {} from the exact motion")):
        z = 1j * dt
        r = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
        error = max(abs(r**n - np.exp(n * z)) for n in range(steps + 1))
        picture = looked_at(sw.scenes.oscillator(), "rk4", dt, steps=steps)
        assert 0.6 * error < picture.state_error.max() <= 1.01 * error
        assert finding(picture) == words.format(percent(picture.state_error.max()))


def test_without_an_exact_solution_the_energy_is_told() -> None:
    """Leapfrog keeps ½v² + ½(1 − Φ²/4)y²: from y = 1 at rest the energy falls by Φ²/4 of itself at y = 0."""
    for dt, words in ((0.2, "energy changes by up to 1 %"), (0.04, "energy kept to 3 digits")):
        picture = own_picture(sw.integrate(sw.Oscillator(), "leapfrog", dt=dt, steps=round(200 / dt), **START))
        assert picture.energy_error.max() == pytest.approx(dt**2 / 4, rel=0.01)
        assert finding(picture) == words
    assert headline(picture) == f"Oscillator by Leapfrog: {words}"
    run = sw.integrate(sw.Pendulum(), "standard_euler", dt=0.1, steps=200, v=0.0, y=1.0, every=1)
    worst = run.energy[np.argmax(abs(run.energy - run.energy[0]))]
    assert worst > 2.0 * run.energy[0]
    assert finding(own_picture(run)) == f"energy goes from {run.energy[0]:.3g} to {worst:.3g}"


def test_an_energy_that_forces_change_is_no_error() -> None:
    """Nothing is wrong with it: it is drawn as it is, and the title says what y did."""
    for options in ({"damping": 0.5}, {"drag": 1.0}, {"friction": 0.1}, {"a": 0.5}, None):
        system = sw.Pendulum(damping=0.5) if options is None else sw.Oscillator(**options)
        run = sw.integrate(system, "rk4", dt=0.05, steps=200, **START)
        picture = own_picture(run)
        assert picture.energy_error is None, system
        assert picture.columns()["energy"].tolist() == run.energy.tolist()
        assert finding(picture) == f"y from {run.y.min():.3g} to {run.y.max():.3g}".replace(" -", " −")
    energy = picture.plot().axes[-1]
    assert energy.get_title(loc="left").startswith("energy over time")
    assert np.array_equal(energy.lines[0].get_ydata(), run.energy)
    # The first turn of a damped oscillator is at −e^(−πD/√(1 − D²)) = −0.163 for D = ½.
    run = sw.integrate(sw.Oscillator(damping=0.5), "rk4", dt=0.01, steps=2000, **START)
    assert round(-math.exp(-math.pi * 0.5 / math.sqrt(0.75)), 3) == -0.163
    assert finding(own_picture(run)) == "y from −0.163 to 1"


def test_a_zero_damping_or_an_energy_of_ones_own_is_kept() -> None:
    for system in (sw.Oscillator(damping=0.0), free):
        picture = own_picture(sw.integrate(system, "rk4", dt=0.1, steps=100, **START))
        assert picture.energy_error is not None
        assert finding(picture).startswith("energy kept to")
    assert picture.title == "free by Runge-Kutta 4"


def test_a_run_says_where_it_settled_or_when_it_broke_off() -> None:
    """The steady turn of a commanded roll of 30°: 27.17730° and 6.66655°."""
    run = sw.integrate(sw.Aircraft(roll=30.0), "false_euler", v=0.0, y=0.0, dt=0.1, steps=600, every=1)
    assert finding(own_picture(run)) == "settles at 27.2° roll and 6.7° pitch"
    moving = own_picture(sw.integrate(sw.Aircraft(roll=30.0), "false_euler", v=0.0, y=0.0, dt=0.1, steps=20, every=1))
    assert finding(moving).startswith("roll from 0° to ")
    picture = picture_of("crash")
    assert finding(picture) == f"diverges at step {int(picture.run.first_bad_step)}"
    scene, at = sw.scenes.kepler(), np.linspace(0.0, 10.0, 50)
    with pytest.warns(sw.ToleranceWarning):
        run = sw.integrate(scene.system, "merson", v=scene.v, y=scene.y, tolerance=1e-9, at=at, max_steps=20)
    picture = run_picture(scene, run)
    assert finding(picture) == f"stops at t = {float(run.paces.t):.4g}"
    words = " ".join(text.get_text() for text in picture.plot().texts)
    assert "Stopped at t = " in words
    assert f"{int(run.paces.accepted)} adaptive steps" in words


@sw.system(order=1)
def decay(t: Any, y: Any, *, k: Any = 1.0) -> Any:
    return -k * y


@sw.system(order=1)
def lorenz(t: Any, y: Any) -> Any:
    return np.array([10.0 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])


@sw.system
def duffing(t: Any, v: Any, y: Any, *, gamma: Any = 0.5) -> Any:
    return gamma * np.cos(1.2 * t) - 0.3 * v + y - y**3


def test_equations_of_first_order_are_drawn(tmp_path: Path) -> None:
    """They have no v; each curve has the whole width, for no error is known."""
    run = sw.integrate(decay, "rk4", y=1.0, dt=0.01, steps=200, every=1)
    assert finding(own_picture(run)) == f"y from {math.exp(-2.0):.3g} to 1"
    (axes,) = run.plot().axes
    assert np.array_equal(axes.lines[0].get_ydata(), run.y)
    assert axes.get_position().width > 0.85
    three = sw.integrate(lorenz, "rk4", y=np.ones(3), dt=0.01, steps=500, every=1)
    (axes,) = three.plot().axes
    drawn = [line.get_ydata() for line in axes.lines if len(line.get_xdata()) == len(three.t)]
    assert len(drawn) == 3
    for each, name in ((run, "run.html"), (three, "run.html"), (three, "run.gif")):
        each.animate(tmp_path / name, seconds=0.2, fps=10)
        assert (tmp_path / name).stat().st_size > 1000


def test_a_motion_of_which_no_error_is_known_shows_its_phase_plane() -> None:
    run = sw.integrate(duffing, "rk4", dt=0.01, steps=2000, **START)
    above, below, plane = run.plot().axes
    assert np.array_equal(above.lines[0].get_ydata(), run.y)
    assert np.array_equal(below.lines[0].get_ydata(), run.v)
    assert plane.get_title(loc="left").startswith("phase plane")
    assert np.array_equal(plane.lines[0].get_xydata(), np.stack([run.y, run.v], axis=1))
    words = [text.get_text() for text in run.plot().texts]
    assert "Its energy and its exact solution are not known, so neither are errors." in words


def controlled(steps: int = 4000, **options: Any) -> sw.Run:
    scene = sw.scenes.energy_control()
    arguments: dict[str, Any] = {"v": scene.v, "y": scene.y, "dt": scene.dt, "steps": steps, "every": 4}
    return sw.integrate(scene.system, "standard_euler", **arguments | options)


@pytest.fixture(scope="module")
def both() -> RunPicture:
    with pytest.warns(sw.AccuracyWarning, match="met within step"):
        return own_picture(controlled(control=sw.EnergyControl(0.3)))


def test_before_is_the_same_run_without_its_control(both: RunPicture) -> None:
    with pytest.warns(sw.AccuracyWarning):
        free = controlled()
    before = both.before
    for name in ("t", "v", "y", "energy"):
        assert np.array_equal(getattr(before.run, name), getattr(free, name)), name
    assert not np.array_equal(before.run.y, both.run.y)
    assert before.run.system.keeper is None
    assert before.before is None  # nothing is before it
    # A run that began at another time and step number: without control it has the same times.
    run = controlled(steps=100, control=sw.EnergyControl(0.3), t0=2.0, start_step=50)
    before = own_picture(run).before
    assert np.array_equal(before.run.t, run.t)
    assert np.array_equal(before.run.y[0], run.y[0])
    assert both.energy_error is not None
    assert both.before.energy_error is not None
    factor = np.median(both.before.energy_error) / np.median(both.energy_error)
    assert factor > 10.0
    assert finding(both) == f"control makes the energy error {factor:.2g} times smaller"


def test_the_error_of_the_state_is_told_with_that_of_the_energy() -> None:
    """A correct energy alone does not make a motion correct, so it is not told alone."""
    scene = sw.scenes.figure_eight()
    picture = looked_at(scene, "rk4", scene.period / 250 if scene.period else None, steps=1000, control=sw.Projection("scaling"))
    before = picture.before
    changes = []
    for new, old in ((picture.energy_error, before.energy_error), (picture.state_error, before.state_error)):
        assert new is not None
        assert old is not None
        changes.append(np.median(old) / np.median(new))
    assert changes[0] > 1e6
    assert 1.5 < changes[1] < 100.0
    words = f"10{str(round(math.log10(changes[0]))).translate(str.maketrans('0123456789', '⁰¹²³⁴⁵⁶⁷⁸⁹'))} times smaller"
    assert finding(picture) == (f"control makes the energy error {words}, the state error {changes[1]:.2g} times smaller")


def test_what_control_is_not_judged_by_the_energy_before() -> None:
    for control in (sw.LengthControl(0.5), sw.Projection("length")):
        picture = looked_at(sw.scenes.conical_pendulum(), "rk4", control=control)
        assert picture.before is not None
        assert "exact motion" in finding(picture)
    scene = sw.scenes.energy_control()
    options: dict[str, Any] = {"tolerance": 1e-6, "at": np.linspace(0.0, 2.0, 50), "control": sw.Projection("scaling")}
    adaptive = sw.integrate(scene.system, "dop853", v=scene.v, y=scene.y, **options)
    for run in (controlled(steps=100), adaptive):
        picture = own_picture(run)
        assert picture.before is None
        assert "without control" not in [axes.get_title(loc="left") for axes in picture.plot().axes]


def test_control_and_none_stand_side_by_side(both: RunPicture) -> None:
    figure = both.plot()
    left, right, *_, energy = figure.axes
    assert [axes.get_title(loc="left") for axes in (left, right)] == ["without control", "with control"]
    assert left.get_xlim() == right.get_xlim()
    assert left.get_ylim() == right.get_ylim()
    for axes, picture in ((left, both.before), (right, both)):
        drawn = [line.get_xydata() for line in axes.lines if len(line.get_xdata()) == len(picture.run.t)]
        assert np.array_equal(np.stack(drawn, axis=1), picture.run.y)
    with_control, without = energy.lines[:2]
    shown = without.get_ydata()
    assert np.array_equal(shown[1:], both.before.energy_error[1:])
    assert np.array_equal(with_control.get_ydata()[1:], both.energy_error[1:])
    legend = energy.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["with control", "without"]


def test_a_control_that_saves_the_run_says_so() -> None:
    """Standard Euler grows by √1.09 a step, past 10^308 after 16 458; a projection onto the energy holds it."""

    run = sw.integrate(free, "standard_euler", dt=0.3, steps=17_000, v=0.0, y=1.0, every=100, control=sw.Projection("energy"))
    picture = own_picture(run)
    assert picture.before.run.status
    assert int(picture.before.run.first_bad_step) == pytest.approx(308.25 / (0.5 * math.log10(1.09)), abs=20)
    assert finding(picture) == f"finite with control, diverges at step {int(picture.before.run.first_bad_step)} without"


def test_numbers_in_words() -> None:
    assert [percent(share) for share in (0.0123, 0.5, 0.00999, 1.0)] == ["1.2 %", "50 %", "1 %", "100 %"]
    assert [tenfold(number) for number in (387.0, 1.2e20, 9.9e19)] == ["a factor of 387", "10²⁰", "10²⁰"]
